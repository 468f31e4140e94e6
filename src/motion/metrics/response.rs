//! Numbers read off recorded columns: lag, tracking error, peaks, energy.
//!
//! Pure functions over slices of equal length; a longer slice is cut to the shorter. A NaN is a missing sample and
//! takes no part. Each returns `None` where the number does not exist (no data, no motion) instead of a NaN.
//! Nothing here knows of columns, units or pictures.

use std::borrow::Cow;

/// Largest magnitude of a series, with its sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Sample at which it is first reached.
    pub index: usize,
    /// The value there.
    pub value: f64,
}

/// The sample of largest magnitude.
#[must_use]
pub fn peak(values: &[f64]) -> Option<Peak> {
    let mut best: Option<Peak> = None;
    for (index, &value) in values.iter().enumerate() {
        if value.is_finite() && best.is_none_or(|b| value.abs() > b.value.abs()) {
            best = Some(Peak { index, value });
        }
    }
    best
}

/// Mean of the last `samples` finite values: what is left when the shaking is over.
#[must_use]
pub fn residual(values: &[f64], samples: usize) -> Option<f64> {
    let tail = values
        .iter()
        .rev()
        .copied()
        .filter(|v| v.is_finite())
        .take(samples.max(1));
    let (sum, n) = tail.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    (n > 0.0).then(|| sum / n)
}

/// Energy that went into the specimen, ∮ f dd in J, by the trapezoidal rule: dissipated, and what is stored at the end.
///
/// Over whole cycles of a specimen that returns to its start it is the dissipated energy. A step with a
/// missing sample on either side is left out.
#[must_use]
pub fn absorbed_energy(disp: &[f64], force: &[f64]) -> Option<f64> {
    let mut sum = 0.0;
    let mut steps = 0usize;
    for (d, f) in disp.windows(2).zip(force.windows(2)) {
        let work = 0.5 * (f[0] + f[1]) * (d[1] - d[0]);
        if work.is_finite() {
            sum += work;
            steps += 1;
        }
    }
    (steps > 0).then_some(sum)
}

/// Delay of `measured` behind `command` in samples, with a fraction.
///
/// Positive means that the measured displacement comes later: measured(t) ≈ command(t − lag·dt). The search takes the largest
/// correlation coefficient over whole lags −`most` … `most` (at most a quarter of the data). There it fits the command, moved by a
/// fraction of a sample too, to the measured displacement with a gain and an offset. For a signal well below half the sampling rate
/// the result is the delay itself, however much of a cycle the data holds. Exactly 0 if the two do not differ. `None` without
/// motion, for a straight ramp (every lag fits equally well), or when the largest correlation lies at the end of the range.
#[must_use]
pub fn lag(command: &[f64], measured: &[f64], most: usize) -> Option<f64> {
    let n = command.len().min(measured.len());
    let most = most.min(n / 4);
    if most < 1 || n < 8 {
        return None;
    }
    // The command's window is fixed, so its mean and norm are those of every lag; the measured one slides.
    let (command, measured) = (filled(&command[..n])?, filled(&measured[..n])?);
    let window = &command[most..n - most];
    let length = window.len() as f64;
    let mean = window.iter().sum::<f64>() / length;
    let window: Vec<f64> = window.iter().map(|c| c - mean).collect();
    let norm = window.iter().map(|c| c * c).sum::<f64>();
    let base = measured.iter().sum::<f64>() / n as f64;
    let measured: Vec<f64> = measured.iter().map(|m| m - base).collect();
    let coefficient = |shift: usize| {
        let (mut product, mut sum, mut square) = (0.0, 0.0, 0.0);
        for (c, m) in window.iter().zip(&measured[shift..]) {
            product += c * m;
            sum += m;
            square += m * m;
        }
        product / (norm * (square - sum * sum / length)).sqrt()
    };
    let table: Vec<f64> = (0..=2 * most).map(coefficient).collect();
    let best = table
        .iter()
        .enumerate()
        .filter(|(_, r)| r.is_finite())
        .max_by(|a, b| a.1.total_cmp(b.1))?
        .0;
    if best == 0 || best == 2 * most {
        return None;
    }
    let least = table.iter().copied().fold(f64::INFINITY, f64::min);
    if table[best] - least < ALIKE {
        return None;
    }
    let whole = best as isize - most as isize;
    let fraction = fraction(&command, &measured, whole).unwrap_or(0.0);
    Some(whole as f64 + fraction)
}

/// Correlation coefficients that differ by less do so by rounding.
const ALIKE: f64 = 1e-10;

/// Points through which a command is drawn between its samples.
const POINTS: usize = 8;
/// Most improvements, and the size of one that counts as zero.
const ROUNDS: usize = 12;
const SETTLED: f64 = 1e-10;

/// How much more than `whole` samples `measured` is behind `command`, by least squares of measured = gain·command + offset, with
/// the command moved. `None` where the command's shape does not determine the time, or the fit leaves the neighbourhood.
fn fraction(command: &[f64], measured: &[f64], whole: isize) -> Option<f64> {
    let half = (POINTS / 2) as isize;
    // The stencil reaches from one sample more than half before to half behind, derivatives one more.
    let from = (whole + half + 1).max(0);
    let to = (command.len() as isize + whole - half - 1).min(measured.len() as isize);
    if to - from < 8 {
        return None;
    }
    let measured = &measured[from as usize..to as usize];
    let n = measured.len() as f64;
    let mean = measured.iter().sum::<f64>() / n;
    let mut fraction = 0.0;
    for _ in 0..ROUNDS {
        let weights = lagrange(fraction);
        // The command `fraction` samples later, from one sample before `from` to one behind `to`.
        let moved: Vec<f64> = (from - 1..=to)
            .map(|i| {
                let first = (i - whole - half) as usize;
                let near = &command[first..first + POINTS];
                near.iter().zip(&weights).map(|(c, w)| c * w).sum()
            })
            .collect();
        let slopes = moved.windows(3).map(|w| 0.5 * (w[2] - w[0]));
        let slopes: Vec<f64> = slopes.collect();
        let values = &moved[1..moved.len() - 1];
        let means = [
            values.iter().sum::<f64>() / n,
            slopes.iter().sum::<f64>() / n,
        ];
        let (mut cc, mut cs, mut ss, mut cm, mut sm) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((c, s), m) in values.iter().zip(&slopes).zip(measured) {
            let (c, s, m) = (c - means[0], s - means[1], m - mean);
            cc += c * c;
            cs += c * s;
            ss += s * s;
            cm += c * m;
            sm += s * m;
        }
        let determinant = cc * ss - cs * cs;
        // Measured = gain·c − gain·(what is left of the delay)·slope.
        let gain = (cm * ss - sm * cs) / determinant;
        let more = -(sm * cc - cm * cs) / determinant / gain;
        if !(determinant > 1e-12 * cc * ss && more.is_finite()) {
            return None;
        }
        fraction += more;
        if fraction.abs() > 1.0 {
            return None;
        }
        if more.abs() < SETTLED {
            break;
        }
    }
    // The remainder is roundoff.
    Some(if fraction.abs() < SETTLED {
        0.0
    } else {
        fraction
    })
}

/// Weights of the eight samples about a place: those from 4 before it to 3 behind, for the value `later` samples before it.
fn lagrange(later: f64) -> [f64; POINTS] {
    let place = (POINTS / 2) as f64 - later;
    std::array::from_fn(|i| {
        let others = (0..POINTS).filter(|&j| j != i);
        others
            .map(|j| (place - j as f64) / (i as f64 - j as f64))
            .product()
    })
}

/// The series with gaps held at the last value; none without two finite samples.
pub(super) fn filled(values: &[f64]) -> Option<Vec<f64>> {
    let mut held = values.iter().copied().find(|v| v.is_finite())?;
    let out = values.iter().map(|&v| {
        if v.is_finite() {
            held = v;
        }
        held
    });
    Some(out.collect())
}

/// Fills the gaps of `measured` for methods that need evenly spaced samples: the error to `command` is interpolated linearly from
/// the sample before the gap to the one behind. Unchanged where nothing is missing, or everything.
#[must_use]
pub fn bridged<'a>(command: &[f64], measured: &'a [f64]) -> Cow<'a, [f64]> {
    if measured.iter().all(|m| m.is_finite()) {
        return Cow::Borrowed(measured);
    }
    let errors: Vec<f64> = measured.iter().zip(command).map(|(m, c)| m - c).collect();
    let mut out = measured.to_vec();
    let mut before = None;
    let mut at = 0;
    while at < errors.len() {
        if errors[at].is_finite() {
            before = Some(at);
            at += 1;
            continue;
        }
        let behind = (at..errors.len()).find(|&i| errors[i].is_finite());
        let Some((from, to)) = before.or(behind).zip(behind.or(before)) else {
            break;
        };
        let end = behind.unwrap_or(errors.len());
        for i in at..end {
            let share = i.saturating_sub(from) as f64 / (to - from).max(1) as f64;
            let error = errors[from] + share * (errors[to] - errors[from]);
            if !out[i].is_finite() {
                out[i] = command[i] + error;
            }
        }
        at = end;
    }
    Cow::Owned(out)
}

/// Divisor of the root mean square of the error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Denominator {
    /// Root mean square of the command: √(Σ(m−c)² / Σc²).
    CommandRms,
    /// Range of the command, max − min.
    CommandRange,
}

/// Normalised root mean square of `measured` − `command`, as a fraction.
#[must_use]
pub fn nrmse(command: &[f64], measured: &[f64], by: Denominator) -> Option<f64> {
    let pairs = || {
        command
            .iter()
            .zip(measured)
            .filter(|(c, m)| c.is_finite() && m.is_finite())
    };
    let (mut error, mut square, mut n) = (0.0, 0.0, 0.0);
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for (&c, &m) in pairs() {
        error += (m - c) * (m - c);
        square += c * c;
        lo = c.min(lo);
        hi = c.max(hi);
        n += 1.0;
    }
    let denominator: f64 = match by {
        Denominator::CommandRms => (square / n).sqrt(),
        Denominator::CommandRange => hi - lo,
    };
    let ratio = (error / n).sqrt() / denominator;
    (denominator > 0.0 && ratio.is_finite()).then_some(ratio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    const DT: f64 = 1.0 / 1024.0;

    fn sampled(n: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..n).map(|i| f(i as f64 * DT)).collect()
    }

    #[test]
    fn gap_is_bridged_by_errors_on_both_sides() {
        let nan = f64::NAN;
        let command = [0.0, 1.0, 4.0, 9.0, 4.0, 1.0, 0.0];
        let measured = [nan, 1.0, 4.0, nan, nan, 1.75, nan];
        let found = bridged(&command, &measured);
        // Errors 0 before, then 0, 0, 0.25, 0.5, 0.75, and as behind.
        assert_eq!(*found, [0.0, 1.0, 4.0, 9.25, 4.5, 1.75, 0.75]);
        assert!(matches!(bridged(&command, &command), Cow::Borrowed(_)));
        assert!(bridged(&command, &[nan; 7]).iter().all(|m| m.is_nan()));
    }

    /// Many sines of fixed phases up to `top_hz`: noise that can be delayed by any fraction exactly.
    fn noise(top_hz: f64, t: f64) -> f64 {
        (1..60)
            .map(|k| libm::sin(TAU * top_hz * f64::from(k) / 60.0 * t + 2.4 * f64::from(k * k)))
            .sum()
    }

    #[test]
    fn sine_delay_is_found_with_its_sign() {
        // A line through eight points of a sine of ω rad a sample is off by ω⁸/70/2⁸ at most: roundoff at ω = 0.031, 5e-8 at 0.4.
        for (omega, bound) in [(TAU * 5.0, 1e-9), (TAU * 65.0, 1e-6)] {
            for delay in [0.0, 0.3, 1.5, 7.5, 12.25, -4.4] {
                // No whole number of cycles.
                let command = sampled(8000, |t| libm::sin(omega * t));
                let measured = sampled(8000, |t| 0.93 * libm::sin(omega * (t - delay * DT)) + 0.2);
                let most = if bound < 1e-8 { 60 } else { 6 };
                if delay.abs() < most as f64 {
                    let found = lag(&command, &measured, most).unwrap();
                    assert!((found - delay).abs() < bound, "{delay}: {found}");
                }
            }
        }
    }

    #[test]
    fn equal_signals_have_lag_zero() {
        for omega in [3.0, 17.0, 400.0] {
            let wave = sampled(5001, |t| t * libm::sin(omega * t) + 0.3);
            assert_eq!(lag(&wave, &wave, 7), Some(0.0));
        }
    }

    #[test]
    fn delays_of_sweep_and_noise_are_found() {
        // Band up to 20 Hz: ω < 0.123 rad/sample, the line through eight points is off by 1e-11.
        for delay in [3.0, 8.4, 20.7] {
            let sweep = |t: f64| libm::sin(TAU * (0.5 * t + 1.2 * t * t));
            let hum = |t: f64| noise(20.0, t);
            for signal in [&sweep as &dyn Fn(f64) -> f64, &hum] {
                let command = sampled(8192, signal);
                let measured = sampled(8192, |t| signal(t - delay * DT));
                let found = lag(&command, &measured, 60).unwrap();
                assert!((found - delay).abs() < 1e-6, "{delay}: {found}");
            }
        }
    }

    #[test]
    fn straight_ramp_has_no_lag() {
        for delay in [0.0, 4.0] {
            let command = sampled(520, |t| 0.02 * t);
            let measured = sampled(520, |t| 0.02 * (t - delay * DT) + 1e-3);
            assert_eq!(lag(&command, &measured, 50), None);
        }
        // At its turning point it has one.
        let command = sampled(520, |t| 0.02 * (t - 0.3).abs());
        let measured = sampled(520, |t| 0.02 * (t - 0.3 - 4.0 * DT).abs());
        assert!((lag(&command, &measured, 50).unwrap() - 4.0).abs() < 0.1);
    }

    #[test]
    fn no_motion_or_lag_out_of_range_is_none() {
        let wave = sampled(2048, |t| libm::sin(TAU * t));
        assert_eq!(lag(&vec![1.0; 2048], &wave, 50), None);
        assert_eq!(lag(&wave, &vec![0.0; 2048], 50), None);
        assert_eq!(lag(&[], &[], 50), None);
        assert_eq!(lag(&[f64::NAN; 64], &[f64::NAN; 64], 50), None);
        let late = sampled(2048, |t| libm::sin(TAU * (t - 0.1)));
        assert_eq!(lag(&wave, &late, 50), None);
        assert!(lag(&wave, &late, 150).is_some());
    }

    #[test]
    fn energy_of_an_elliptic_loop_is_its_area() {
        // f = k d + c ḋ over one cycle: π c ω A². The trapezoid of a smooth periodic function errs by (ω dt)²/6.
        let (c, omega, a) = (500.0, TAU * 2.0, 0.01);
        let disp = sampled(513, |t| a * libm::sin(omega * t));
        let force = sampled(513, |t| {
            1e5 * a * libm::sin(omega * t) + c * a * omega * libm::cos(omega * t)
        });
        let exact = TAU / 2.0 * c * omega * a * a;
        assert!((absorbed_energy(&disp, &force).unwrap() / exact - 1.0).abs() < 1e-4);
        assert_eq!(absorbed_energy(&[0.0], &[1.0]), None);
    }

    #[test]
    fn gain_and_delay_error_has_closed_form() {
        // |1 − g e^{−iωτ}| for a sine over whole cycles: gain 0.95, delay 3.1 ms, 2 Hz gives 6.278 %.
        let omega = TAU * 2.0;
        let command = sampled(8192, |t| libm::sin(omega * t));
        let measured = sampled(8192, |t| 0.95 * libm::sin(omega * (t - 3.1e-3)));
        let found = nrmse(&command, &measured, Denominator::CommandRms).unwrap();
        assert!((found - 0.06278).abs() < 1e-5, "{found}");
        let by_range = nrmse(&command, &measured, Denominator::CommandRange).unwrap();
        assert!((by_range - found / (2.0 * 2f64.sqrt())).abs() < 1e-6);
        assert_eq!(nrmse(&[0.0; 9], &[1.0; 9], Denominator::CommandRms), None);
    }

    #[test]
    fn peaks_and_residuals_pass_over_gaps() {
        assert_eq!(
            peak(&[1.0, f64::NAN, -3.0, 3.0]),
            Some(Peak {
                index: 2,
                value: -3.0
            })
        );
        assert_eq!(peak(&[f64::NAN]), None);
        assert_eq!(residual(&[9.0, 1.0, f64::NAN, 3.0], 2), Some(2.0));
        assert_eq!(residual(&[], 3), None);
    }

    proptest! {
        #[test]
        fn no_input_gives_nan_or_a_panic(
            a in prop::collection::vec(prop_oneof![8 => -1e6f64..1e6, 1 => Just(f64::NAN), 1 => Just(1e308)], 0..80),
            b in prop::collection::vec(prop_oneof![8 => -1e6f64..1e6, 1 => Just(f64::INFINITY)], 0..80),
        ) {
            for value in [lag(&a, &b, 9), nrmse(&a, &b, Denominator::CommandRms), absorbed_energy(&a, &b)] {
                prop_assert!(value.is_none_or(|v| !v.is_nan()));
            }
        }
    }
}
