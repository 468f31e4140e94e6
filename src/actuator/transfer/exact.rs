//! Linear systems over one tick, exactly, for inputs that ramp from one value to another. A held input has equal ends: that is the
//! zero-order hold.
//!
//! With time counted in ticks and A, B scaled accordingly, the exponential of \[A B 0; 0 0 I; 0 0 0\] holds everything: the state
//! transition, and the contributions of a held input and of its ramp (first-order hold; Van Loan 1978). Accurate to roundoff.

/// A square matrix by rows.
pub(crate) type Square<const D: usize> = [[f64; D]; D];

/// Terms of the Taylor series; with a norm of at most 1/2 the omitted ones are below 1e-20.
const TERMS: usize = 16;

fn product<const D: usize>(a: &Square<D>, b: &Square<D>) -> Square<D> {
    let mut out = [[0.0; D]; D];
    for (row, a) in out.iter_mut().zip(a) {
        for (factor, b) in a.iter().zip(b) {
            if *factor != 0.0 {
                for (entry, b) in row.iter_mut().zip(b) {
                    *entry += factor * b;
                }
            }
        }
    }
    out
}

/// The exponential of a matrix, by scaling and squaring. Not finite where the matrix is not.
#[must_use]
pub(crate) fn exponential<const D: usize>(a: &Square<D>) -> Square<D> {
    let rows = a.iter().map(|row| row.iter().map(|v| v.abs()).sum::<f64>());
    let mut norm = rows.fold(0.0, f64::max);
    let mut squarings = 0;
    while norm > 0.5 && squarings < 200 {
        norm *= 0.5;
        squarings += 1;
    }
    let factor = libm::ldexp(1.0, -squarings);
    let mut scaled = *a;
    scaled.iter_mut().flatten().for_each(|v| *v *= factor);
    let mut sum = [[0.0; D]; D];
    for (i, row) in sum.iter_mut().enumerate() {
        if let Some(entry) = row.get_mut(i) {
            *entry = 1.0;
        }
    }
    let mut term = sum;
    for k in 1..=TERMS {
        term = product(&term, &scaled);
        term.iter_mut().flatten().for_each(|v| *v /= k as f64);
        for (sum, term) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
            *sum += term;
        }
    }
    for _ in 0..squarings {
        sum = product(&sum, &sum);
    }
    sum
}

/// One tick of N states under M inputs that ramp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramped<const N: usize, const M: usize> {
    state: [[f64; N]; N],
    /// Contribution of the inputs at the start of the tick.
    start: [[f64; M]; N],
    /// Contribution of the inputs at its end.
    end: [[f64; M]; N],
}

impl<const N: usize, const M: usize> Ramped<N, M> {
    /// A tick in which nothing moves, until the true one is known.
    #[must_use]
    pub(crate) fn still() -> Self {
        // The exponential of zero; D does not matter for zeros as long as the states fit.
        Self::new::<9>(&[[0.0; N]; N], &[[0.0; M]; N], &[1.0; N])
    }

    /// For ẋ = A x + B u with time counted in ticks. `units` is the size of each state, so that the exponential is one of
    /// numbers of one size; `D` must be N + 2 M.
    #[must_use]
    pub(crate) fn new<const D: usize>(
        a: &[[f64; N]; N],
        b: &[[f64; M]; N],
        units: &[f64; N],
    ) -> Self {
        let mut whole = [[0.0; D]; D];
        for (((row, a), b), unit) in whole.iter_mut().zip(a).zip(b).zip(units) {
            let of_state = a.iter().zip(units).map(|(a, of)| a * of / unit);
            for (entry, value) in row
                .iter_mut()
                .zip(of_state.chain(b.iter().map(|b| b / unit)))
            {
                *entry = value;
            }
        }
        for j in 0..M {
            if let Some(entry) = whole.get_mut(N + j).and_then(|row| row.get_mut(N + M + j)) {
                *entry = 1.0;
            }
        }
        let all = exponential(&whole);
        let mut tick = Self {
            state: [[0.0; N]; N],
            start: [[0.0; M]; N],
            end: [[0.0; M]; N],
        };
        let rows = tick
            .state
            .iter_mut()
            .zip(&mut tick.start)
            .zip(&mut tick.end);
        for ((((state, start), end), all), unit) in rows.zip(&all).zip(units) {
            let mut from = all.iter().map(|entry| entry * unit);
            for (entry, of) in state.iter_mut().zip(units) {
                *entry = from.next().unwrap_or(f64::NAN) / of;
            }
            for entry in start.iter_mut() {
                *entry = from.next().unwrap_or(f64::NAN);
            }
            for (end, start) in end.iter_mut().zip(start) {
                *end = from.next().unwrap_or(f64::NAN);
                *start -= *end;
            }
        }
        tick
    }

    /// The state a tick later. Real-time: yes.
    #[must_use]
    pub fn step(&self, state: &[f64; N], start: &[f64; M], end: &[f64; M]) -> [f64; N] {
        let mut next = [0.0; N];
        let rows = self.state.iter().zip(&self.start).zip(&self.end);
        for (next, ((of_state, of_start), of_end)) in next.iter_mut().zip(rows) {
            let mut sum = 0.0;
            for (a, x) in of_state.iter().zip(state) {
                sum += a * x;
            }
            for (b, u) in of_start.iter().zip(start) {
                sum += b * u;
            }
            for (b, u) in of_end.iter().zip(end) {
                sum += b * u;
            }
            *next = sum;
        }
        next
    }

    /// Adds the effect of a change of input `input` at the end of the tick to the state. Real-time: yes.
    pub fn add_to_end(&self, state: &mut [f64; N], input: usize, change: f64) {
        for (entry, row) in state.iter_mut().zip(&self.end) {
            *entry += row.get(input).copied().unwrap_or(f64::NAN) * change;
        }
    }
}

/// True if every root of the polynomial, coefficients from the highest power down, has a negative real part (Routh).
#[must_use]
pub(crate) fn is_hurwitz(coefficients: &[f64]) -> bool {
    let every_other =
        |from: usize| -> Vec<f64> { coefficients.iter().skip(from).step_by(2).copied().collect() };
    let (mut above, mut row) = (every_other(0), every_other(1));
    let at = |row: &[f64], i: usize| row.get(i).copied().unwrap_or(0.0);
    for _ in 1..coefficients.len() {
        // Written so that NaN fails.
        if !(at(&above, 0) > 0.0 && at(&row, 0) > 0.0) {
            return false;
        }
        let ratio = at(&above, 0) / at(&row, 0);
        let next = (0..row.len().max(1))
            .map(|i| at(&above, i + 1) - ratio * at(&row, i + 1))
            .collect();
        above = std::mem::replace(&mut row, next);
    }
    at(&above, 0) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_of_any_rotation_is_exact() {
        for angle in [0.1, 3.0, 40.0] {
            let turned = exponential(&[[0.0, -angle], [angle, 0.0]]);
            let (s, c) = libm::sincos(angle);
            // Each squaring doubles the relative error; 40 needs 7 of them.
            for (found, wanted) in turned.iter().flatten().zip([c, -s, s, c]) {
                assert!((found - wanted).abs() < 1e-13, "{found} {wanted}");
            }
        }
    }

    #[test]
    fn first_order_lag_follows_a_ramp_exactly() {
        // x' = (u − x)/T, u = t: x = t − T (1 − e^{−t/T}); one tick of length 1 with T = 3.
        let lag = Ramped::<1, 1>::new::<3>(&[[-1.0 / 3.0]], &[[1.0 / 3.0]], &[1.0]);
        let mut x = [0.0];
        for k in 0..50 {
            x = lag.step(&x, &[f64::from(k)], &[f64::from(k + 1)]);
            let t = f64::from(k + 1);
            let wanted = t - 3.0 * (1.0 - libm::exp(-t / 3.0));
            assert!((x[0] - wanted).abs() < 1e-13 * t.max(1.0));
        }
    }

    #[test]
    fn routh_separates_stable_polynomials() {
        // (s + 1)(s + 2)(s² + s + 4) and the same with s² − s/10 + 4.
        assert!(is_hurwitz(&[1.0, 4.0, 9.0, 14.0, 8.0]));
        assert!(!is_hurwitz(&[1.0, 2.9, 5.7, 11.8, 8.0]));
        assert!(!is_hurwitz(&[1.0, f64::NAN, 1.0]));
        assert!(is_hurwitz(&[1.0, 2.0]) && !is_hurwitz(&[1.0, -2.0]));
    }
}
