//! Peaks over all degrees of freedom, recorded or not.

use gusset_quantity::state;

use crate::linalg::Lanes;
use crate::linalg::lanes::{Isa, Kernel};

/// Largest absolute displacement, velocity and acceleration of each DOF.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Peaks {
    /// m.
    pub disp: Vec<f64>,
    /// m/s.
    pub vel: Vec<f64>,
    /// m/s²; NaN for a massless DOF, which has none.
    pub accel: Vec<f64>,
}

state! { Peaks as "peaks" { disp, vel, accel } }

impl Peaks {
    /// Peaks of nothing, for `dofs` degrees of freedom.
    #[must_use]
    pub fn zeros(dofs: usize) -> Self {
        Self {
            disp: vec![0.0; dofs],
            vel: vec![0.0; dofs],
            accel: vec![0.0; dofs],
        }
    }

    /// Forgets what was before t = 0.
    pub fn start(&mut self, disp: &[f64]) {
        for (peak, value) in self.disp.iter_mut().zip(disp) {
            *peak = value.abs();
        }
    }

    /// Raises the peaks to those of steps outside the state. Peaks that do not exist stay undefined.
    pub fn raise(&mut self, others: &Self) {
        let pairs = [
            (&mut self.disp, &others.disp),
            (&mut self.vel, &others.vel),
            (&mut self.accel, &others.accel),
        ];
        for (peaks, values) in pairs {
            Lanes::best_for(values.len()).run(Highest { peaks, values });
        }
    }

    /// Notes displacements. Real-time: yes.
    #[inline]
    pub fn note_disp(&mut self, disp: &[f64]) {
        let peaks = &mut self.disp;
        Lanes::best_for(disp.len()).run(Highest {
            peaks,
            values: disp,
        });
    }

    /// Notes velocities and accelerations. A DOF without mass has no acceleration: its peak becomes NaN.
    /// Real-time: yes.
    #[inline]
    pub fn note_rates(&mut self, vel: &[f64], accel: &[f64]) {
        let lanes = Lanes::best_for(vel.len());
        lanes.run(Highest {
            peaks: &mut self.vel,
            values: vel,
        });
        lanes.run(HighestOrNone {
            peaks: &mut self.accel,
            values: accel,
        });
    }
}

/// The first displacement beyond `bound`, or not a number. Real-time: yes.
#[inline]
pub fn first_beyond(disp: &[f64], bound: f64) -> Option<(usize, f64)> {
    if Lanes::best_for(disp.len()).run(Inside {
        values: disp,
        bound,
    }) {
        return None;
    }
    disp.iter().copied().enumerate().find(|(_, value)| {
        let size = value.abs();
        size.is_nan() || size > bound
    })
}

/// True if all values are within the bound.
struct Inside<'a> {
    values: &'a [f64],
    bound: f64,
}

impl Kernel for Inside<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> bool {
        let mut inside = 0u64;
        for value in self.values {
            // Counted, not branched on; NaN is not inside.
            inside += u64::from(value.abs() <= self.bound);
        }
        inside == self.values.len() as u64
    }
}

/// Raises peaks.
struct Highest<'a> {
    peaks: &'a mut [f64],
    values: &'a [f64],
}

impl Kernel for Highest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        for (peak, value) in self.peaks.iter_mut().zip(self.values) {
            let size = value.abs();
            *peak = if size > *peak { size } else { *peak };
        }
    }
}

/// Raises peaks where there are values; one NaN makes a peak NaN for good.
struct HighestOrNone<'a> {
    peaks: &'a mut [f64],
    values: &'a [f64],
}

impl Kernel for HighestOrNone<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        for (peak, value) in self.peaks.iter_mut().zip(self.values) {
            let size = value.abs();
            // False only for a number that is not larger.
            *peak = if size <= *peak { *peak } else { size };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::state::{Stateful, TestState};

    #[test]
    fn first_excessive_displacement_is_named() {
        let mut peaks = Peaks::zeros(3);
        peaks.note_disp(&[0.5, -2.0, 1.0]);
        peaks.note_disp(&[-0.25, 1.0, -1.5]);
        assert_eq!(peaks.disp, [0.5, 2.0, 1.5]);
        assert_eq!(first_beyond(&peaks.disp, 3.0), None);
        assert_eq!(first_beyond(&[0.0, 0.0, -4.0], 3.0), Some((2, -4.0)));
        let found = first_beyond(&[0.0, f64::NAN, 0.0], 3.0);
        assert!(matches!(found, Some((1, value)) if value.is_nan()));
    }

    #[test]
    fn restored_peaks_are_the_same() {
        let mut peaks = Peaks::zeros(2);
        peaks.note_disp(&[0.5, -2.0]);
        peaks.note_rates(&[1.0, -3.0], &[4.0, f64::NAN]);
        let state = TestState::of(|visit| peaks.visit_state(visit)).unwrap();
        let mut other = Peaks::zeros(2);
        state.restore(|visit| other.visit_state(visit)).unwrap();
        assert_eq!((&other.disp, &other.vel), (&peaks.disp, &peaks.vel));
        assert!(other.accel[0] == 4.0 && other.accel[1].is_nan());
    }

    #[test]
    fn massless_dof_has_no_peak_acceleration() {
        let mut peaks = Peaks::zeros(2);
        peaks.note_rates(&[1.0, -1.0], &[2.0, f64::NAN]);
        peaks.note_rates(&[0.5, -3.0], &[-1.0, f64::NAN]);
        assert_eq!(peaks.vel, [1.0, 3.0]);
        assert_eq!(peaks.accel[0], 2.0);
        assert!(peaks.accel[1].is_nan());
        let mut others = Peaks::zeros(2);
        others.note_rates(&[0.5, 4.0], &[3.0, 7.0]);
        others.accel[0] = f64::NAN;
        peaks.raise(&others);
        assert_eq!((peaks.vel[1], peaks.accel[0]), (4.0, 2.0));
        assert!(peaks.accel[1].is_nan(), "it has none all the same");
    }
}
