//! A late displacement as a weighted sum of the targets of steps.

/// Most targets in the command of a tick.
const TARGETS: usize = 5;

/// The command of a tick by the targets, from the one that its step ends at back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Weights of the displacement.
    pub disp: [f64; TARGETS],
    /// Weights of its change per step.
    pub slope: [f64; TARGETS],
}

/// A displacement that is late, and its velocity, by the targets.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Late {
    /// Weights of the targets from the newest back.
    pub disp: Vec<f64>,
    /// Weights of its change per step. `None` where the velocity is the integrator's own, with the weights of the
    /// displacement.
    pub slope: Option<Vec<f64>>,
}

impl Late {
    /// A displacement `steps` steps late, by linear interpolation between the commands of the `ticks` of a step, or between
    /// targets if `ticks` is empty.
    pub(crate) fn of(ticks: &[Weights], steps: f64) -> Self {
        let per_step = ticks.len().max(1);
        let back = steps * per_step as f64;
        let whole = back.floor();
        let (whole, share) = (whole as usize, back - whole);
        // The oldest command is needed with a weight unless the delay is a whole number of ticks.
        let places = [(whole, 1.0 - share), (whole + 1, share)];
        let places = places.into_iter().take(if share > 0.0 { 2 } else { 1 });
        if ticks.is_empty() {
            let mut disp = vec![0.0; whole];
            disp.extend(places.map(|(_, weight)| weight));
            return Self { disp, slope: None };
        }
        let mut found = [Vec::new(), Vec::new()];
        for (tick, weight) in places {
            let (step, of) = (tick / per_step, &ticks[tick % per_step]);
            for (sum, of) in found.iter_mut().zip([&of.disp, &of.slope]) {
                sum.resize(step + TARGETS, 0.0);
                for (sum, of) in sum.iter_mut().skip(step).zip(of) {
                    *sum += weight * of;
                }
            }
        }
        // Both get the length of the longer one.
        let is_used = |i: &usize| found.iter().any(|of| of[*i] != 0.0);
        let length = (0..found[0].len()).rev().find(is_used).map_or(1, |i| i + 1);
        let [mut disp, mut slope] = found;
        disp.truncate(length);
        slope.truncate(length);
        Self {
            disp,
            slope: Some(slope),
        }
    }

    /// Targets before the newest that it needs.
    pub(crate) fn past(&self) -> usize {
        self.disp.len() - 1
    }
}
