//! The stiffness that a wiring check measures, compared with the estimate as a whole matrix.
//!
//! Each motion of one axis gives a column: forces of all axes over its measured displacement. A wrong sign of one axis, exchanged
//! connections, a forgotten scale and a wrong unit show in signs and amounts of the whole matrix, and not only on its diagonal.

use super::wiring_fault::WiringFault;
use gusset_quantity::units::AxisUnits;

/// A larger amount, in standard deviations, is not noise.
const SIGMAS: f64 = 3.0;
/// A term of this share of √(kᵢᵢ kⱼⱼ) at least has a sign that counts: no estimate knows a smaller coupling.
const HAS_SIGN: f64 = 0.05;
/// A measured stiffness is within this ratio of the estimate, or of its inverse.
const RATIO: f64 = 2.0;
/// A coupling differs from its estimate by this share of √(kᵢᵢ kⱼⱼ) at most.
const COUPLING: f64 = 0.3;
/// Rounding error of a measured stiffness, relative.
const ROUNDING: f64 = 1e-9;

/// The motion of one axis: a column of the measured stiffness.
#[derive(Debug, Clone)]
pub(super) struct Column {
    /// The axis that moved, from 0.
    pub axis: usize,
    /// Change of its measured displacement.
    pub disp: f64,
    /// Change of the force of every axis, and its standard deviation.
    pub forces: Vec<(f64, f64)>,
}

/// The faults of the measured columns beside `stiffness`, n × n by rows, the gravest first. What the check of a single axis
/// refuses is not looked for.
pub(super) fn compare(
    columns: &[Column],
    stiffness: &[f64],
    units: &[AxisUnits],
) -> Vec<WiringFault> {
    let n = units.len();
    let estimate = |i: usize, j: usize| stiffness.get(i * n + j).copied().unwrap_or(0.0);
    let (mut reversed, mut amounts, mut couplings) = (Vec::new(), Vec::new(), Vec::new());
    for column in columns {
        let j = column.axis;
        for (i, (force, deviation)) in column.forces.iter().enumerate() {
            let found = force / column.disp;
            let noise = SIGMAS * (deviation / column.disp).abs();
            let expected = estimate(i, j);
            let unit = |axis: usize| units.get(axis).copied().unwrap_or(AxisUnits::SI);
            let units = (unit(i).force, unit(j).disp);
            if i == j {
                let ratio = found / expected;
                let is_near = (1.0 / RATIO - ROUNDING..=RATIO + ROUNDING).contains(&ratio);
                if !is_near {
                    amounts.push(WiringFault::Stiffness {
                        axis: i,
                        found,
                        expected,
                        units,
                    });
                }
                continue;
            }
            let size = (estimate(i, i) * estimate(j, j)).abs().sqrt();
            let has_sign = |term: f64| term.abs() > noise.max(HAS_SIGN * size);
            let coupling = |is_reversed| WiringFault::Coupling {
                axis: i,
                moved: j,
                found,
                expected,
                units,
                is_reversed,
            };
            if found * expected < 0.0 && has_sign(found) && has_sign(expected) {
                reversed.push(coupling(true));
                continue;
            }
            let is_near = (found - expected).abs() <= (COUPLING + ROUNDING) * size;
            if !is_near {
                couplings.push(coupling(false));
            } else if noise > COUPLING * size {
                couplings.push(WiringFault::HiddenCoupling {
                    axis: i,
                    moved: j,
                    times: noise / (COUPLING * size),
                });
            }
        }
    }
    reversed.append(&mut amounts);
    reversed.append(&mut couplings);
    reversed
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};

    /// A specimen of three coupled axes, by rows.
    const K: [[f64; 3]; 3] = [[4e6, -1e6, 5e5], [-1e6, 3e6, -6e5], [5e5, -6e5, 1.5e6]];
    const UNITS: [AxisUnits; 3] = [AxisUnits::SI; 3];
    /// Amplitude of the motion.
    const WAY: f64 = 1e-3;

    fn flat(rows: [[f64; 3]; 3]) -> Vec<f64> {
        rows.into_iter().flatten().collect()
    }

    /// The faults of a specimen with this stiffness beside the estimate K, with noise of its forces.
    fn found_with(rows: [[f64; 3]; 3], mut noise: impl FnMut() -> (f64, f64)) -> Vec<WiringFault> {
        let columns = [0, 1, 2].map(|axis| Column {
            axis,
            disp: WAY,
            forces: rows
                .iter()
                .map(|row| {
                    let (error, deviation) = noise();
                    (row[axis] * WAY + error, deviation)
                })
                .collect(),
        });
        compare(&columns, &flat(K), &UNITS)
    }

    fn names(rows: [[f64; 3]; 3]) -> Vec<&'static str> {
        let found = found_with(rows, || (0.0, 0.0));
        found.iter().map(WiringFault::name).collect()
    }

    /// With other signs of an axis, and axes in another order.
    fn wired(signs: [f64; 3], order: [usize; 3]) -> [[f64; 3]; 3] {
        let entry = |i: usize, j: usize| signs[i] * signs[j] * K[order[i]][order[j]];
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)))
    }

    #[test]
    fn a_right_specimen_has_no_fault() {
        assert!(names(K).is_empty());
        // A tenth softer, as a used one is.
        assert!(names(K.map(|row| row.map(|k| 0.9 * k))).is_empty());
    }

    #[test]
    fn each_wrong_wiring_shows() {
        for axis in 0..3 {
            let mut signs = [1.0; 3];
            signs[axis] = -1.0;
            let found = found_with(wired(signs, [0, 1, 2]), || (0.0, 0.0));
            assert_eq!(found[0].name(), "coupling_reversed", "{axis}");
            assert!(!found[0].is_acceptable());
        }
        for order in [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0]] {
            assert!(!names(wired([1.0; 3], order)).is_empty(), "{order:?}");
        }
        let times = |scale: f64| names(K.map(|row| row.map(|k| scale * k)));
        for scale in [10.0, 0.1, 3.0, 1e3, 1e-3] {
            assert_eq!(times(scale)[0], "stiffness_differs", "{scale}");
        }
        let mut other = K;
        (other[0][1], other[1][0]) = (-2.5e6, -2.5e6);
        assert_eq!(names(other), ["coupling_differs"; 2]);
    }

    /// √(k₁₁ k₂₂) = 3.464e6: 0.3 of it is 1.0392e6, 0.05 of it 1.732e5.
    #[test]
    fn the_rules_hold_at_their_borders() {
        let diagonal = |ratio: f64| {
            let mut other = K;
            other[1][1] *= ratio;
            names(other).len()
        };
        assert_eq!([0.5, 2.0].map(diagonal), [0, 0]);
        assert_eq!([0.499, 2.001].map(diagonal), [1, 1]);
        let coupling = |value: f64| {
            let mut other = K;
            other[1][0] = value;
            names(other)
        };
        assert!(coupling(-2.039e6).is_empty() && coupling(0.03e6).is_empty());
        assert_eq!(coupling(-2.040e6), ["coupling_differs"]);
        assert_eq!(coupling(0.05e6), ["coupling_differs"]);
        assert_eq!(coupling(0.172e6), ["coupling_differs"]);
        assert_eq!(coupling(0.174e6), ["coupling_reversed"]);
    }

    #[test]
    fn what_is_no_number_is_a_fault() {
        let mut other = K;
        other[0][1] = f64::NAN;
        other[2][2] = f64::NAN;
        assert_eq!(names(other), ["stiffness_differs", "coupling_differs"]);
    }

    /// A standard deviation of 4e4 N/m changes no verdict. One of 6e5 N/m hides the couplings of a right specimen: three of them are
    /// more than 0.3 √(kᵢᵢ kⱼⱼ), and their ratio is the factor of a motion that shows the coupling.
    #[test]
    fn noise_hides_a_coupling_and_says_so() {
        for seed in 0..200 {
            let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
            let mut noise = |part: f64| {
                let sum: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
                let deviation = part * 2e6 * WAY;
                (deviation * sum, deviation)
            };
            assert!(found_with(K, || noise(0.02)).is_empty(), "seed {seed}");
            let reversed = wired([-1.0, 1.0, 1.0], [0, 1, 2]);
            let found = found_with(reversed, || noise(0.02));
            assert_eq!(found[0].name(), "coupling_reversed", "seed {seed}");
            let hidden = found_with(K, || noise(0.3));
            let times = hidden.iter().filter_map(|fault| match fault {
                WiringFault::HiddenCoupling { times, .. } => Some(*times),
                _ => None,
            });
            for times in times {
                // Between √(3e6 · 1.5e6) and √(4e6 · 3e6): 3 · 0.3 · 2e6 / (0.3 · those).
                assert!((1.7..2.9).contains(&times), "seed {seed}: {times}");
            }
            assert!(!hidden.is_empty(), "seed {seed}");
            assert!(
                hidden
                    .iter()
                    .all(|fault| fault.name() != "coupling_reversed")
            );
        }
    }
}
