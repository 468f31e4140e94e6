//! Errors that late specimens introduce into a test as a whole: in the damping of its modes, and in its energy.
//!
//! A delay τ of one axis acts beside the specimen as the damping −k τ (Horiuchi et al. 1999). On a mode with the
//! mass-normalised shape φ it acts as Δζ ≈ −k φ² τ/(2 ω), φ taken at the axis; the damping error of the test is the sum over
//! all axes. It is the first order of the complex modes of the delayed system: for a delay that is a large part of a period it
//! gives only the order of magnitude. Axes that stiffen each other count with both. Delays are those of a whole test.

use serde::{Deserialize, Serialize};

use super::floor::Judged;

/// A mode of a structure with its specimens, and what a delay of each axis would add to its damping.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio without any delay.
    pub damping_ratio: f64,
    /// Δζ per second of delay, −k φ²/(2 ω), by specimen and axis.
    pub per_second: Vec<Vec<f64>>,
}

/// Damping that the delays of a test added to one mode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FalseDamping {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio without delays.
    pub damping_ratio: f64,
    /// Δζ; negative where the test was damped too little.
    pub damping_error: Judged,
}

impl Mode {
    /// Δζ of `delays`: specimen and axis (both from 1) and the delay in s. The floor is that of all delays together, with
    /// independent noise; `None` where one of them has no floor. The result is `None` where no axis has a delay. An axis that
    /// is not listed counts as on time.
    #[must_use]
    pub fn falsified(&self, delays: &[(u32, u32, Judged)]) -> Option<FalseDamping> {
        let weight = |specimen: u32, axis: u32| {
            let specimen = self.per_second.get(specimen.checked_sub(1)? as usize)?;
            specimen.get(axis.checked_sub(1)? as usize).copied()
        };
        let mut known = false;
        let (mut error, mut square) = (0.0, Some(0.0));
        for (specimen, axis, delay) in delays {
            let Some(weight) = weight(*specimen, *axis) else {
                continue;
            };
            known = true;
            error += weight * delay.value;
            let part = delay.floor.map(|floor| weight * floor);
            square = square.zip(part).map(|(sum, part)| sum + part * part);
        }
        let floor = square.map(f64::sqrt);
        (known && error.is_finite()).then(|| FalseDamping {
            frequency_hz: self.frequency_hz,
            damping_ratio: self.damping_ratio,
            damping_error: Judged::scattered(error, floor, 0.0),
        })
    }
}

/// Reference energies of a test, J.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Default)]
pub struct Scale {
    /// Largest energy that went in up to any step: work of the loads and of the ground, and the kinetic energy at the beginning.
    pub input_energy_j: f64,
    /// Largest elastic strain energy ½ xᵀ K x: the structure and its specimens at their tangent stiffness at rest.
    pub strain_energy_j: f64,
}

impl Scale {
    /// Input and strain energy together: the denominator of Mosqueda, Stojadinović and Mahin (2007). None without any.
    #[must_use]
    pub(crate) fn sum(&self) -> Option<f64> {
        let sum = self.input_energy_j + self.strain_energy_j;
        (sum > 0.0 && sum.is_finite()).then_some(sum)
    }

    /// An energy error in parts of it.
    #[must_use]
    pub fn share(&self, error: Judged) -> Option<Judged> {
        let sum = self.sum()?;
        Some(Judged {
            value: error.value / sum,
            floor: error.floor.map(|floor| floor / sum),
            corrected: error.corrected.map(|corrected| corrected / sum),
        })
    }
}

/// The energy errors of all axes together, with independent noise. `None` without errors.
#[must_use]
pub fn together(errors: &[Judged]) -> Option<Judged> {
    let squares = errors.iter().map(|error| Some(error.floor? * error.floor?));
    let floor = squares.sum::<Option<f64>>().map(f64::sqrt);
    let value: f64 = errors.iter().map(|error| error.value).sum();
    (!errors.is_empty()).then(|| Judged::scattered(value, floor, 0.0))
}

/// The smallest margin of an axis to its critical delay, estimated while the test ran.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Margin {
    /// Name of the specimen.
    pub specimen: String,
    /// Its axis, from 1.
    pub axis: u32,
    /// Critical delay at the stiffness of the last seconds less their lag, s of test time; negative where the test was expected to grow, null
    /// where every delay was stable or nothing was known.
    pub smallest_s: Option<f64>,
    /// Test time of it in s.
    pub at_s: Option<f64>,
    /// What noise scatters it by, s: that of the lag, which is fitted over the last while.
    pub floor_s: Option<f64>,
}

/// Errors that delays introduced into a test with a structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct Falsified {
    /// Energy errors of all axes together.
    pub energy_error_j: Option<Judged>,
    /// The energy error over [`Scale::sum`]; null without an energy balance.
    pub energy_error_share: Option<Judged>,
    /// Reference energies; null without an energy balance.
    pub energy_scale: Option<Scale>,
    /// Damping of each mode; empty where the modes are not known.
    pub modes: Vec<FalseDamping>,
    /// Margins to the critical delay, one per axis that was watched.
    pub delay_margins: Vec<Margin>,
    /// Why something above is null or empty, in words.
    pub missing: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(value: f64, floor: Option<f64>) -> Judged {
        Judged::scattered(value, floor, 0.0)
    }

    #[test]
    fn delays_add_and_noise_adds_in_squares() {
        let mode = Mode {
            frequency_hz: 2.0,
            damping_ratio: 0.02,
            per_second: vec![vec![-3.0, 0.5], vec![-4.0]],
        };
        let delays = [
            (1, 1, judged(1e-3, Some(1e-5))),
            (1, 2, judged(2e-3, Some(0.0))),
            (2, 1, judged(-2e-3, Some(1e-5))),
            // An axis that does not exist.
            (3, 1, judged(1.0, None)),
        ];
        let found = mode.falsified(&delays).unwrap().damping_error;
        assert!((found.value - (-3e-3 + 1e-3 + 8e-3)).abs() < 1e-15);
        assert!((found.floor.unwrap() - 5e-5).abs() < 1e-15);
        assert_eq!(found.corrected, Some(found.value));
        // Within twice its scatter it counts as zero.
        let small = [(2, 1, judged(1.9e-5, Some(1e-5)))];
        let found = mode.falsified(&small).unwrap().damping_error;
        assert_eq!(found.corrected, Some(0.0));
        let unknown = [(1, 1, judged(1e-3, None))];
        assert_eq!(mode.falsified(&unknown).unwrap().damping_error.floor, None);
        assert_eq!(mode.falsified(&[]), None);
    }

    #[test]
    fn energy_error_is_scaled_by_both_energies() {
        let scale = Scale {
            input_energy_j: 6.0,
            strain_energy_j: 2.0,
        };
        let share = scale.share(judged(0.4, Some(0.08))).unwrap();
        assert_eq!((share.value, share.floor), (0.05, Some(0.01)));
        assert_eq!(share.corrected, Some(0.05));
        assert_eq!(Scale::default().share(judged(0.4, None)), None);
        let all = together(&[judged(3.0, Some(3.0)), judged(-1.0, Some(4.0))]).unwrap();
        assert_eq!(
            (all.value, all.floor, all.corrected),
            (2.0, Some(5.0), Some(0.0))
        );
        assert_eq!(together(&[]), None);
    }
}
