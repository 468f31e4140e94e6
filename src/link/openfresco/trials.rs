//! The trials of a client in one step: a physical specimen follows the first one, and later ones only within the declared
//! distance.
//!
//! A client iterates if it commands another target before it commits the step. Where no commit has come yet, an equal test time
//! separates an iteration from a step. Limits: a client that never commits and sends no time cannot be recognised; each of its
//! targets is a step.

use super::motion::copy;
use crate::served::{ROUNDING, TrialFault};
use gusset_quantity::units::AxisUnits;

/// The trials of the present step.
#[derive(Debug, Default)]
pub(super) struct Trials {
    /// Largest distance in m (or rad) of later trials from the first; none allows only the same target again.
    within: Option<f64>,
    /// The first target of the step, its time, and the last target.
    first: Vec<f64>,
    time: f64,
    last: Vec<f64>,
}

impl Trials {
    /// For a specimen of `signals` displacements, behind the `rows` of its file.
    pub(crate) fn new(signals: usize, within: Option<f64>) -> Self {
        Self {
            within,
            first: vec![0.0; signals],
            time: 0.0,
            last: vec![0.0; signals],
        }
    }

    /// Judges a target. `is_open`: a target of this step came before, by the commits; `has_committed`: the client has
    /// committed a step. Real-time: yes.
    pub(crate) fn judge(
        &mut self,
        disp: &[f64],
        time: f64,
        (is_open, has_committed): (bool, bool),
        units: &[AxisUnits],
    ) -> Option<TrialFault> {
        let is_same_time = time != 0.0 && time == self.time;
        if !(is_open && (has_committed || is_same_time)) {
            copy(&mut self.first, disp);
            copy(&mut self.last, disp);
            self.time = time;
            return None;
        }
        let (again, _) = farthest(disp, &self.last, units);
        copy(&mut self.last, disp);
        let (distance, signal) = farthest(disp, &self.first, units);
        let is_allowed = again <= ROUNDING || distance <= self.within.unwrap_or(0.0);
        (!is_allowed).then_some(TrialFault {
            signal,
            distance,
            within: self.within,
        })
    }
}

/// The largest distance of one place from another, in m or rad, and its signal. NaN is infinitely far. Real-time: yes.
fn farthest(one: &[f64], other: &[f64], units: &[AxisUnits]) -> (f64, usize) {
    let mut most = (0.0, 0);
    for (signal, (one, other)) in one.iter().zip(other).enumerate() {
        let metres = units.get(signal).map_or(1.0, |unit| unit.metres);
        let distance = ((one - other) * metres).abs();
        let distance = if distance.is_nan() {
            f64::INFINITY
        } else {
            distance
        };
        if distance > most.0 {
            most = (distance, signal);
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    const INCH: AxisUnits = AxisUnits {
        metres: 0.0254,
        disp: "in",
        ..AxisUnits::SI
    };

    fn judge(trials: &mut Trials, disp: f64, time: f64, state: (bool, bool)) -> Option<TrialFault> {
        trials.judge(&[0.0, disp], time, state, &[INCH, INCH])
    }

    #[test]
    fn second_target_of_a_step_is_an_iteration() {
        let mut trials = Trials::new(2, None);
        assert_eq!(judge(&mut trials, 0.0, 0.0, (false, false)), None);
        // The first step after the zeros at the connection.
        assert_eq!(judge(&mut trials, 1.0, 0.01, (true, false)), None);
        assert_eq!(judge(&mut trials, 1.0, 0.01, (true, false)), None);
        let fault = judge(&mut trials, 1.5, 0.01, (true, false)).unwrap();
        assert_eq!((fault.signal, fault.within), (1, None));
        assert!((fault.distance - 0.0127).abs() < 1e-15);
        // After a commit; without a time only commits separate steps.
        assert_eq!(judge(&mut trials, 2.0, 0.0, (false, true)), None);
        assert!(judge(&mut trials, 2.1, 0.0, (true, true)).is_some());
        // A client that never commits and sends no time.
        assert_eq!(judge(&mut trials, 3.0, 0.0, (true, false)), None);
        assert_eq!(judge(&mut trials, 4.0, 0.0, (true, false)), None);
    }

    #[test]
    fn trials_stay_near_the_first_one() {
        let mut trials = Trials::new(2, Some(0.01));
        assert_eq!(judge(&mut trials, 1.0, 0.01, (false, true)), None);
        assert_eq!(judge(&mut trials, 1.3, 0.01, (true, true)), None);
        // From the first, not from the last.
        let fault = judge(&mut trials, 1.5, 0.01, (true, true)).unwrap();
        assert_eq!(fault.within, Some(0.01));
        assert!((fault.distance - 0.0127).abs() < 1e-15);
        assert!(judge(&mut trials, f64::NAN, 0.01, (true, true)).is_some());
    }
}
