//! Points and weights of Gauss on 0 to 1, from the zeros of Legendre polynomials by Newton's iteration.

use std::f64::consts::PI;

/// Pₙ(x), Pₙ₋₁(x) and their derivatives.
fn legendre(n: usize, x: f64) -> [f64; 4] {
    let (mut before, mut p, mut slope_before, mut slope) = (0.0, 1.0, 0.0, 0.0);
    for k in 0..n {
        let k = k as f64;
        let next = ((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0);
        let next_slope = slope_before + (2.0 * k + 1.0) * p;
        (before, p, slope_before, slope) = (p, next, slope, next_slope);
    }
    [p, before, slope, slope_before]
}

/// `n` points of Gauss and Legendre, (ξ, weight), rising.
pub(super) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let of = |i: usize| {
        let mut x = -libm::cos(PI * (i as f64 + 0.75) / (n as f64 + 0.5));
        for _ in 0..20 {
            let [p, _, slope, _] = legendre(n, x);
            x -= p / slope;
        }
        let [_, _, slope, _] = legendre(n, x);
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(of).collect()
}

/// `n` ≥ 2 points of Gauss and Lobatto, both ends among them.
pub(super) fn gauss_lobatto(n: usize) -> Vec<(f64, f64)> {
    let m = n - 1;
    let of = |i: usize| {
        let mut x = -libm::cos(PI * i as f64 / m as f64);
        if i > 0 && i < m {
            for _ in 0..20 {
                // (1 − x²) P″ = 2 x P′ − m (m + 1) P.
                let [p, _, slope, _] = legendre(m, x);
                let curve = (2.0 * x * slope - (m * n) as f64 * p) / (1.0 - x * x);
                x -= slope / curve;
            }
        }
        let [p, ..] = legendre(m, x);
        (0.5 * (1.0 + x), 1.0 / ((m * n) as f64 * p * p))
    };
    (0..n).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ ξᵖ dξ = 1/(p + 1) up to the degree of each rule, and not beyond it.
    #[test]
    fn polynomials_are_integrated_exactly() {
        for n in 2..=10_usize {
            for (points, degree) in [
                (gauss_legendre(n), 2 * n - 1),
                (gauss_lobatto(n), 2 * n - 3),
            ] {
                let of = |p: usize| -> f64 {
                    let each = points.iter().map(|(x, w)| w * x.powi(p as i32));
                    each.sum::<f64>() * (p as f64 + 1.0) - 1.0
                };
                for p in 0..=degree {
                    assert!(of(p).abs() < 1e-13, "{n} points, degree {p}: {:e}", of(p));
                }
                assert!(of(degree + 1).abs() > 1e-12, "{n} points");
            }
            assert_eq!(gauss_lobatto(n)[0].0, 0.0);
            assert_eq!(gauss_lobatto(n)[n - 1].0, 1.0);
        }
    }
}
