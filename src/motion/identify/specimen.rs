//! Stiffness, damping and moving mass: force against measured displacement.
//!
//! f = k x + c ẋ (+ m ẍ), on the lines of the band. Both sides carry noise; least squares of one on the other would be
//! biased towards zero. So the actuator model's response to the command, which has no noise, serves as the instrument
//! (two-stage least squares). The unexplained share of the whole record is given beside it: for a specimen that yields, k
//! is a secant.
//!
//! The coupling to the other, held axes is found in the same way, without a mass and of either sign.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::fit::Fit;
use super::lines::{C64, Lines};
use super::{Estimate, IdentifyError};

/// Part of the force's power below which residuals are roundoff.
const EXACT: f64 = 1e-14;
/// A mass counts beyond this many standard errors.
const CERTAIN: f64 = 3.0;
/// Share of the force's power that remains unexplained when there is nothing but noise.
const NOISE: f64 = 0.95;
/// Share of a stiffness that counts as zero.
const NEGLIGIBLE: f64 = 1e-6;

/// Resistance to the actuator.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpecimenFit {
    /// k in N/m at the specimen's scale.
    pub stiffness: Estimate,
    /// c in N s/m.
    pub damping: Estimate,
    /// m in kg that the load cell feels, if it is detectable.
    pub mass: Option<Estimate>,
    /// Root mean square of the force over the whole record that this does not explain, as a share of all.
    pub residual: f64,
    /// The residual due to the noise at rest alone: that of a linear specimen.
    pub floor: f64,
    /// Correlation of force and explained force in the band.
    pub lines: usize,
}

impl SpecimenFit {
    /// True if it leaves clearly more over than noise.
    #[must_use]
    pub fn is_nonlinear(&self) -> bool {
        self.residual > 0.02 && self.residual > 3.0 * self.floor
    }
}

/// Force on a held axis per motion of the one that moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Felt {
    /// N per m of the axis that moves, at the specimen's scale.
    pub stiffness: Estimate,
    /// N s per m of it.
    pub damping: Estimate,
}

impl Estimate {
    /// True if it is more than its own uncertainty, and more than a roundoff of `scale`.
    #[must_use]
    pub fn counts_beside(&self, scale: f64) -> bool {
        self.value.abs() > CERTAIN * self.std && self.value.abs() > NEGLIGIBLE * scale.abs()
    }
}

/// Fits what a held axis feels; none if that is no more than noise.
pub(super) fn felt(lines: &Lines, actuator: Option<&Fit>) -> Option<Felt> {
    let power: f64 = lines.force.iter().map(C64::norm_sqr).sum();
    let found = solve(lines, &expected(lines, actuator), 2)?;
    let is_felt = found.unexplained <= NOISE * power && power > 0.0;
    let (&[stiffness, damping], &[of_stiffness, of_damping]) =
        (found.values.as_slice(), found.errors.as_slice())
    else {
        return None;
    };
    is_felt.then_some(Felt {
        stiffness: Estimate {
            value: stiffness,
            std: of_stiffness,
        },
        damping: Estimate {
            value: damping,
            std: of_damping,
        },
    })
}

/// The actuator's response to the command, on the lines of the band; without a model of it the command itself.
fn expected(lines: &Lines, actuator: Option<&Fit>) -> Vec<C64> {
    let pairs = lines.omega.iter().zip(&lines.command);
    match actuator.map(|fit| (fit.model, fit.values())) {
        Some((model, values)) => pairs
            .map(|(omega, u)| model.response(&values, *omega, lines.dt) * u)
            .collect(),
        None => lines.command.clone(),
    }
}

/// Fits the specimen; none if there is no force.
pub(super) fn fit(
    lines: &Lines,
    actuator: Option<&Fit>,
    noise_force: f64,
) -> Result<Option<SpecimenFit>, IdentifyError> {
    let power: f64 = lines.force.iter().map(C64::norm_sqr).sum();
    // Without a model of the actuator the command itself is the instrument.
    let values = actuator.map(|fit| (fit.model, fit.values()));
    let response = |omega: f64| match &values {
        Some((model, values)) => model.response(values, omega, lines.dt),
        None => C64::new(1.0, 0.0),
    };
    let expected = expected(lines, actuator);
    let Some(plain) = solve(lines, &expected, 2) else {
        return Ok(None);
    };
    // A load cell that reads nothing but noise knows no specimen.
    let is_felt = plain.unexplained <= NOISE * power && power > 0.0;
    if !is_felt {
        return Ok(None);
    }
    let count = 2.0 * lines.omega.len() as f64;
    let criterion = |solution: &Solution| {
        let unexplained = (solution.unexplained / power).max(EXACT);
        count * libm::log(unexplained) + solution.values.len() as f64 * libm::log(count)
    };
    let with_mass = solve(lines, &expected, 3).filter(|solution| {
        let [_, _, mass] = solution.values[..] else {
            return false;
        };
        mass > CERTAIN * solution.errors[2] && criterion(solution) < criterion(&plain)
    });
    let best = with_mass.unwrap_or(plain);
    let estimate = |index: usize| {
        let pair = best.values.get(index).zip(best.errors.get(index));
        pair.map(|(value, std)| Estimate {
            value: *value,
            std: *std,
        })
    };
    let (Some(stiffness), Some(damping)) = (estimate(0), estimate(1)) else {
        return Ok(None);
    };
    if stiffness.value < -CERTAIN * stiffness.std {
        return Err(IdentifyError::ForceReversed {
            stiffness: stiffness.value,
        });
    }
    // Over the whole record: what a specimen that yields does outside of the band counts, too.
    let (mut unexplained, mut all) = (0.0, 0.0);
    for (index, (u, f)) in lines.all_command.iter().zip(&lines.all_force).enumerate() {
        let omega = lines.omega_of(index);
        let explained = resist(&best.values, omega) * response(omega) * u;
        unexplained += (f - explained).norm_sqr();
        all += f.norm_sqr();
    }
    let samples = lines.samples as f64;
    // Noise of variance σ² has σ² n on each of n/2 lines.
    let noise = noise_force * noise_force * samples * lines.all_force.len() as f64;
    Ok(Some(SpecimenFit {
        stiffness,
        damping,
        mass: estimate(2),
        residual: (unexplained / all).sqrt(),
        floor: (noise / all).sqrt().min(1.0),
        lines: lines.omega.len(),
    }))
}

/// k + iωc − ω²m.
fn resist(values: &[f64], omega: f64) -> C64 {
    let s = C64::new(0.0, omega);
    values
        .iter()
        .rev()
        .fold(C64::new(0.0, 0.0), |sum, value| sum * s + *value)
}

struct Solution {
    values: Vec<f64>,
    errors: Vec<f64>,
    /// Sum of the squared residuals in the band.
    unexplained: f64,
}

fn solve(lines: &Lines, expected: &[C64], count: usize) -> Option<Solution> {
    let middle = lines.omega.get(lines.omega.len() / 2)?;
    // Powers of ω over the middle one: columns of one size.
    let column = |disp: &C64, omega: f64, j: usize| {
        let s = C64::new(0.0, omega / middle);
        (0..j).fold(*disp, |value, _| value * s)
    };
    let product = |a: C64, b: C64| a.re * b.re + a.im * b.im;
    let each = || lines.omega.iter().zip(expected).zip(&lines.measured);
    let cross: DMatrix<f64> = DMatrix::from_fn(count, count, |i, j| {
        each()
            .map(|((w, x), y)| product(column(x, *w, i), column(y, *w, j)))
            .sum::<f64>()
    });
    let own: DMatrix<f64> = DMatrix::from_fn(count, count, |i, j| {
        each()
            .map(|((w, x), _)| product(column(x, *w, i), column(x, *w, j)))
            .sum::<f64>()
    });
    let right: DVector<f64> = DVector::from_fn(count, |i, _| {
        let pairs = each().zip(&lines.force);
        pairs
            .map(|(((w, x), _), f)| product(column(x, *w, i), *f))
            .sum::<f64>()
    });
    let solution = cross.lu().solve(&right)?;
    let unexplained: f64 = each()
        .zip(&lines.force)
        .map(|(((w, _), y), f)| {
            let explained: C64 = (0..count).map(|j| column(y, *w, j) * solution[j]).sum();
            (f - explained).norm_sqr()
        })
        .sum();
    let freedom = 2.0 * lines.omega.len() as f64 - count as f64;
    let covariance = own.try_inverse()? * (unexplained / freedom);
    let scale = |j: usize| (0..j).fold(1.0, |value, _| value / middle);
    let values: Vec<f64> = (0..count).map(|j| solution[j] * scale(j)).collect();
    let errors: Vec<f64> = (0..count)
        .map(|j| covariance[(j, j)].max(0.0).sqrt() * scale(j))
        .collect();
    let sound = values.iter().chain(&errors).all(|v| v.is_finite());
    sound.then_some(Solution {
        values,
        errors,
        unexplained,
    })
}
