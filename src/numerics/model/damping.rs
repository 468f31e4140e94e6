//! Rayleigh and modal damping matrices.

use std::f64::consts::PI;

use thiserror::Error;

use super::{DampingSpec, ModalSpec, RayleighRatioSpec, RayleighSpec};
use crate::linalg::{EigenError, LARGEST_DENSE, SymMatrix, frequencies, modes};
use gusset_quantity::domain::{OutOfDomain, inside, not_negative};

/// Why a rule gives no damping matrix.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DampingError {
    /// A number outside its range.
    #[error(transparent)]
    Parameter(#[from] OutOfDomain),
    /// Neither or both of two frequencies and two modes.
    #[error("give either first_hz and second_hz, or modes")]
    WhichFrequencies,
    /// A mode that does not exist.
    #[error("mode {mode} does not exist: modes count from 1 and the structure has {available}")]
    NoSuchMode {
        /// As given.
        mode: usize,
        /// Modes of the structure.
        available: usize,
    },
    /// Twice the same frequency, or a rigid-body mode.
    #[error(
        "the two frequencies are {first_hz} Hz and {second_hz} Hz, but must be different and greater than 0"
    )]
    Frequencies {
        /// First one.
        first_hz: f64,
        /// Second one.
        second_hz: f64,
    },
    /// A number of ratios that is neither one nor one per mode.
    #[error("{found} damping ratios for {modes} modes: give one per mode, or a single one for all")]
    Ratios {
        /// Ratios given.
        found: usize,
        /// Modes of the structure.
        modes: usize,
    },
    /// Too large for all modes.
    #[error(
        "modal damping fills the damping matrix and needs every mode: {n} degrees of freedom are beyond the limit of {LARGEST_DENSE}; use rayleigh damping"
    )]
    TooLarge {
        /// Degrees of freedom.
        n: usize,
    },
    /// No natural frequencies.
    #[error(transparent)]
    Eigen(#[from] EigenError),
}

/// C by `rule` for the given M and K (n × n), and its coefficient of K, if it has one. Frequencies and modes are those of the first
/// K, and the second one makes the damping.
///
/// # Errors
/// See [`DampingError`].
pub(super) fn damping_matrix(
    rule: &DampingSpec,
    mass: &SymMatrix,
    [stiffness, damped]: [&SymMatrix; 2],
) -> Result<(SymMatrix, Option<f64>), DampingError> {
    let [a, b] = match rule {
        DampingSpec::Rayleigh(RayleighSpec {
            mass_coefficient_per_s,
            stiffness_coefficient_s,
            stiffness_part: _,
        }) => {
            not_negative("mass_coefficient_per_s", *mass_coefficient_per_s)?;
            not_negative("stiffness_coefficient_s", *stiffness_coefficient_s)?;
            [*mass_coefficient_per_s, *stiffness_coefficient_s]
        }
        DampingSpec::RayleighRatio(rule) => rayleigh_ratio(rule, mass, stiffness)?,
        DampingSpec::Modal(ModalSpec { ratios }) => {
            return Ok((modal(ratios, mass, stiffness)?, None));
        }
    };
    let damping = SymMatrix::zeros(mass.n()).plus(a, mass).plus(b, damped);
    Ok((damping, Some(b)))
}

fn check_ratio(key: &'static str, found: f64) -> Result<f64, OutOfDomain> {
    let is_inside = (0.0..1.0).contains(&found);
    inside(
        key,
        found,
        is_inside,
        "a fraction of critical from 0 to below 1",
    )
}

/// [a, b]: a = 2 ξ ω₁ ω₂/(ω₁ + ω₂), b = 2 ξ/(ω₁ + ω₂): ratio ξ at both.
fn rayleigh_ratio(
    rule: &RayleighRatioSpec,
    mass: &SymMatrix,
    stiffness: &SymMatrix,
) -> Result<[f64; 2], DampingError> {
    check_ratio("ratio", rule.ratio)?;
    let [first, second] = match (rule.first_hz, rule.second_hz, rule.modes) {
        (Some(first), Some(second), None) => [2.0 * PI * first, 2.0 * PI * second],
        (None, None, Some(numbers)) => {
            let highest = numbers[0].max(numbers[1]);
            let available = (0..mass.n()).filter(|&i| !mass.row_is_zero(i)).count();
            for mode in numbers {
                if !(1..=available).contains(&mode) {
                    return Err(DampingError::NoSuchMode { mode, available });
                }
            }
            let found = frequencies(stiffness, mass, highest)?;
            let of = |mode: usize| found.get(mode - 1).copied().unwrap_or(0.0);
            numbers.map(of)
        }
        _ => return Err(DampingError::WhichFrequencies),
    };
    let valid = |omega: f64| omega > 0.0 && omega.is_finite();
    if !(valid(first) && valid(second) && first != second) {
        return Err(DampingError::Frequencies {
            first_hz: first / (2.0 * PI),
            second_hz: second / (2.0 * PI),
        });
    }
    let b = 2.0 * rule.ratio / (first + second);
    Ok([b * first * second, b])
}

/// C = M Φ diag(2 ξ ω) Φᵀ M; rigid-body modes stay undamped.
fn modal(
    ratios: &[f64],
    mass: &SymMatrix,
    stiffness: &SymMatrix,
) -> Result<SymMatrix, DampingError> {
    for &ratio in ratios {
        check_ratio("ratios", ratio)?;
    }
    let n = mass.n();
    if n > LARGEST_DENSE {
        return Err(DampingError::TooLarge { n });
    }
    let all = modes(stiffness, mass)?;
    let count = all.frequencies.len();
    if ratios.len() != 1 && ratios.len() != count {
        return Err(DampingError::Ratios {
            found: ratios.len(),
            modes: count,
        });
    }
    let mut entries = Vec::new();
    for (mode, omega) in all.frequencies.iter().enumerate() {
        let ratio = ratios.get(mode).or(ratios.first()).copied().unwrap_or(0.0);
        let mut momentum = vec![0.0; n];
        mass.subtract_product(all.shapes.column(mode).as_slice(), &mut momentum);
        let weight = 2.0 * ratio * omega;
        for i in 0..n {
            for j in i..n {
                entries.push((i, j, weight * momentum[i] * momentum[j]));
            }
        }
    }
    Ok(SymMatrix::from_triplets(n, entries))
}
