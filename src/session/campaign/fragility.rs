//! Lognormal fragility curve by maximum likelihood: P(collapse | x) = Φ(ln(x/θ)/β).
//!
//! The counts at each level are binomial (Baker 2015, Earthquake Spectra 31, 579–599). With η = a + b ln x the fit is a probit
//! regression, solved by Fisher scoring. θ = exp(−a/b) and β = 1/b. Standard errors follow from the Fisher information.

use std::f64::consts::{PI, SQRT_2};

use serde::Serialize;

/// Counts at one level of intensity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Level {
    /// Intensity.
    pub level: f64,
    /// Number of tests that collapsed or completed.
    pub tests: f64,
    /// Number of collapses among them.
    pub collapses: f64,
    /// Further tests that a limit or a fault stopped: whether the structure would have collapsed is not known.
    pub censored: f64,
}

/// Counts of collapses at one point of the design, and the curve through them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Collapses {
    /// Values of the axes at the point; empty without axes.
    pub point: String,
    /// The curve; none if the counts do not determine one.
    pub fit: Option<Fragility>,
    /// The counts.
    pub levels: Vec<Level>,
}

/// A fitted fragility curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fragility {
    /// Median θ, in the unit of the intensity.
    pub median: f64,
    /// Dispersion β of ln x.
    pub dispersion: f64,
    /// Standard error of ln θ.
    pub ln_median_error: f64,
    /// Standard error of β.
    pub dispersion_error: f64,
    /// Logarithm of the likelihood, without the binomial coefficients.
    pub log_likelihood: f64,
}

/// Most iterations of a fit.
const MOST: usize = 200;
/// A slope above this is no finite dispersion: the counts jump from none to all.
const STEEPEST: f64 = 1e3;

impl Fragility {
    /// Fits the counts of `levels`; none if they do not determine a curve.
    #[must_use]
    pub(crate) fn fit(levels: &[Level]) -> Option<Self> {
        let levels: Vec<Level> = levels
            .iter()
            .copied()
            .filter(|one| one.level > 0.0 && one.tests > 0.0)
            .collect();
        // A maximum exists only if some structure collapsed at a lower level than another one survived. Otherwise the likelihood
        // rises with the slope without end (Albert and Anderson 1984, Biometrika 71, 1–10).
        let collapsed = levels.iter().filter(|one| one.collapses > 0.0);
        let survived = levels.iter().filter(|one| one.collapses < one.tests);
        let first = collapsed.map(|one| one.level).fold(f64::INFINITY, f64::min);
        let last = survived.map(|one| one.level).fold(0.0, f64::max);
        if first >= last {
            return None;
        }
        let middle =
            levels.iter().map(|one| libm::log(one.level)).sum::<f64>() / levels.len() as f64;
        let mut at = [-2.5 * middle, 2.5];
        let mut best = likelihood(&levels, at);
        for _ in 0..MOST {
            let (step, _) = scoring(&levels, at)?;
            let mut share = 1.0;
            let next = loop {
                let next = [at[0] + share * step[0], at[1] + share * step[1]];
                let found = likelihood(&levels, next);
                if found >= best || share < 1e-10 {
                    break (next, found);
                }
                share *= 0.5;
            };
            let moved = (next.0[0] - at[0]).abs() + (next.0[1] - at[1]).abs();
            (at, best) = (next.0, next.1.max(best));
            if moved < 1e-12 * (1.0 + at[0].abs() + at[1].abs()) {
                break;
            }
        }
        let [a, b] = at;
        if !(b > 0.0 && b < STEEPEST) {
            return None;
        }
        let (_, [aa, ab, bb]) = scoring(&levels, at)?;
        let (da, db) = (-1.0 / b, a / (b * b));
        // The counts cannot separate such a slope from zero.
        if bb.sqrt() >= b {
            return None;
        }
        Some(Self {
            median: libm::exp(-a / b),
            dispersion: 1.0 / b,
            ln_median_error: (da * da * aa + 2.0 * da * db * ab + db * db * bb).sqrt(),
            dispersion_error: bb.sqrt() / (b * b),
            log_likelihood: best,
        })
    }

    /// Probability of a collapse at the intensity `level`.
    #[must_use]
    pub(crate) fn probability(&self, level: f64) -> f64 {
        normal(libm::log(level / self.median) / self.dispersion)
    }
}

/// Standard normal distribution.
fn normal(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

fn likelihood(levels: &[Level], [a, b]: [f64; 2]) -> f64 {
    let one = |one: &Level| {
        let eta = a + b * libm::log(one.level);
        let (p, q) = (normal(eta), normal(-eta));
        let term = |count: f64, p: f64| {
            if count > 0.0 {
                count * libm::log(p)
            } else {
                0.0
            }
        };
        term(one.collapses, p) + term(one.tests - one.collapses, q)
    };
    levels.iter().map(one).sum()
}

/// Step of Fisher scoring and the inverse of the information (aa, ab, bb).
fn scoring(levels: &[Level], [a, b]: [f64; 2]) -> Option<([f64; 2], [f64; 3])> {
    let mut score = [0.0; 2];
    let mut information = [0.0; 3];
    for one in levels {
        let x = libm::log(one.level);
        let eta = a + b * x;
        let (p, q) = (normal(eta), normal(-eta));
        let density = libm::exp(-0.5 * eta * eta) / (2.0 * PI).sqrt();
        let spread = p * q;
        if spread <= f64::MIN_POSITIVE {
            continue;
        }
        let slope = density * (one.collapses - one.tests * p) / spread;
        let weight = one.tests * density * density / spread;
        score[0] += slope;
        score[1] += slope * x;
        information[0] += weight;
        information[1] += weight * x;
        information[2] += weight * x * x;
    }
    let [aa, ab, bb] = information;
    let determinant = aa * bb - ab * ab;
    if !(determinant > 0.0 && determinant.is_finite()) {
        return None;
    }
    let inverse = [bb / determinant, -ab / determinant, aa / determinant];
    let step = [
        inverse[0] * score[0] + inverse[1] * score[1],
        inverse[1] * score[0] + inverse[2] * score[1],
    ];
    Some((step, inverse))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts that are equal to their expectations have the likelihood's maximum at the true parameters.
    #[test]
    fn expected_counts_return_their_parameters() {
        let (median, dispersion) = (0.83, 0.37);
        let levels: Vec<Level> = (1..=12)
            .map(|i| {
                let level = 0.15 * f64::from(i);
                let p = normal(libm::log(level / median) / dispersion);
                Level {
                    level,
                    tests: 20.0,
                    collapses: 20.0 * p,
                    censored: 0.0,
                }
            })
            .collect();
        let fit = Fragility::fit(&levels).unwrap();
        // The score vanishes to rounding errors, which Fisher scoring amplifies by less than 1e3.
        assert!((fit.median / median - 1.0).abs() < 1e-9, "{fit:?}");
        assert!((fit.dispersion / dispersion - 1.0).abs() < 1e-9, "{fit:?}");
        assert!((fit.probability(median) - 0.5).abs() < 1e-9);
        assert!(fit.ln_median_error > 0.0 && fit.dispersion_error > 0.0);
    }

    /// No other pair of parameters in the neighbourhood is more likely.
    #[test]
    fn the_fit_of_whole_counts_is_a_maximum() {
        let counts = [0.0, 0.0, 3.0, 9.0, 14.0, 20.0];
        let levels: Vec<Level> = (1..)
            .zip(counts)
            .map(|(i, collapses)| Level {
                level: 0.2 * f64::from(i),
                tests: 20.0,
                collapses,
                censored: 0.0,
            })
            .collect();
        let fit = Fragility::fit(&levels).unwrap();
        let at = |median: f64, dispersion: f64| {
            likelihood(&levels, [-libm::log(median) / dispersion, 1.0 / dispersion])
        };
        let best = at(fit.median, fit.dispersion);
        for (m, d) in [(1.001, 1.0), (0.999, 1.0), (1.0, 1.001), (1.0, 0.999)] {
            assert!(at(m * fit.median, d * fit.dispersion) < best);
        }
    }

    #[test]
    fn jump_from_none_to_all_has_no_curve() {
        let level = |level: f64, collapses: f64| Level {
            level,
            tests: 20.0,
            collapses,
            censored: 0.0,
        };
        assert_eq!(Fragility::fit(&[level(0.5, 0.0), level(1.0, 20.0)]), None);
        assert_eq!(Fragility::fit(&[level(0.5, 0.0), level(1.0, 0.0)]), None);
        assert_eq!(Fragility::fit(&[]), None);
        // One mixed level is fitted by every slope.
        let one_mixed = [level(0.5, 0.0), level(1.0, 7.0), level(1.5, 20.0)];
        assert_eq!(Fragility::fit(&one_mixed), None);
        assert_eq!(Fragility::fit(&one_mixed[..2]), None);
        // As many collapses at each level: there is a maximum, but it determines nothing.
        let flat = [level(0.5, 7.0), level(1.0, 6.0), level(1.5, 7.0)];
        assert_eq!(Fragility::fit(&flat), None);
        // Two mixed levels have a curve.
        let two = [level(0.5, 3.0), level(1.0, 12.0), level(1.5, 20.0)];
        assert!(Fragility::fit(&two).is_some_and(|fit| fit.dispersion_error < fit.dispersion));
    }
}
