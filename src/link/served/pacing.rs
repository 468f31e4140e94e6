//! Pacing: a received target becomes a smooth path of several commands.
//!
//! The path leads from the last target to the new one in N ticks of the server, from rest to rest:
//!
//! ```text
//! s(x) = 10 x³ − 15 x⁴ + 6 x⁵,   x = 1/N, 2/N … 1
//! ```
//!
//! Velocity and acceleration vanish at both ends. So a client that is late, pauses or is gone leaves the specimen at rest at its last
//! target, whenever that happens, and the lead of a compensator ends with the motion. The largest speed is 15/8 of the mean. The
//! path is one of the client's displacements: a loading unit follows the poses between two targets. Limits: nothing is predicted.

use crate::rt::os;

/// The ticks of a server that paces its client.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pacing {
    /// Commands for each target.
    pub ticks: u32,
    /// From one command to the next, in ns.
    pub period_ns: u64,
}

impl Pacing {
    /// From one command to the next, in s.
    #[must_use]
    pub fn period_s(self) -> f64 {
        self.period_ns as f64 * 1e-9
    }

    /// From one target to the next, in s, at least.
    #[must_use]
    pub fn step_s(self) -> f64 {
        self.period_s() * f64::from(self.ticks)
    }
}

/// The path to the last target.
#[derive(Debug)]
pub(super) struct PacedPath {
    pub pacing: Pacing,
    from: Vec<f64>,
    to: Vec<f64>,
    tick: u32,
    /// The next command, in the client's displacements; velocities are of wall time.
    pub disp: Vec<f64>,
    pub vel: Vec<f64>,
    /// Number of the next command.
    pub sequence: u64,
    /// Where the axes are at the target, in their units.
    pub place: Vec<f64>,
    /// Earliest time of the next command, ns.
    edge_ns: u64,
}

/// Share of the way, and its slope, at a share of the time.
fn shape(x: f64) -> (f64, f64) {
    let share = x * x * x * (10.0 + x * (6.0 * x - 15.0));
    let slope = 30.0 * x * x * (1.0 - x) * (1.0 - x);
    (share, slope)
}

impl PacedPath {
    /// For a client of `signals` displacements, and so many axes.
    pub fn new(pacing: Pacing, signals: usize, axes: usize) -> Self {
        let zeros = || vec![0.0; signals];
        Self {
            pacing,
            from: zeros(),
            to: zeros(),
            tick: pacing.ticks,
            disp: zeros(),
            vel: zeros(),
            sequence: 0,
            place: vec![0.0; axes],
            edge_ns: 0,
        }
    }

    /// The specimen rests at these displacements of the client. The next command has this number.
    pub fn rests_at(&mut self, sequence: u64, disp: &[f64]) {
        for (to, disp) in self.to.iter_mut().zip(disp) {
            *to = *disp;
        }
        (self.sequence, self.tick) = (sequence, self.pacing.ticks);
    }

    /// The next target. Real-time: yes.
    pub fn aim(&mut self, target: &[f64]) {
        self.from.copy_from_slice(&self.to);
        for (to, target) in self.to.iter_mut().zip(target) {
            *to = *target;
        }
        self.tick = 0;
    }

    /// Makes the next command, the share of the way in time; none at the target. Real-time: yes.
    pub fn next(&mut self) -> Option<f64> {
        let ticks = self.pacing.ticks;
        if self.tick >= ticks {
            return None;
        }
        self.tick += 1;
        let x = f64::from(self.tick) / f64::from(ticks);
        let (share, slope) = shape(x);
        let rate = slope / self.pacing.step_s();
        let ends = self.from.iter().zip(&self.to);
        let made = self.disp.iter_mut().zip(&mut self.vel);
        for ((disp, vel), (from, to)) in made.zip(ends) {
            // The target itself, to the last bit.
            *disp = if self.tick == ticks {
                *to
            } else {
                from + share * (to - from)
            };
            *vel = rate * (to - from);
        }
        Some(x)
    }

    /// Waits for the edge of the next command: a command that came late moves those behind it.
    pub fn wait(&mut self) {
        let now = os::monotonic_ns();
        if now < self.edge_ns {
            os::sleep_until_ns(self.edge_ns);
        }
        self.edge_ns = self.edge_ns.max(now) + self.pacing.period_ns;
    }

    /// The last command has left. Real-time: yes.
    pub const fn count(&mut self) {
        self.sequence = self.sequence.saturating_add(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// From rest to rest, with the bounds of the polynomial on speed and acceleration, and the target to the last bit.
        #[test]
        fn a_path_begins_and_ends_at_rest(
            ticks in 2u32..400,
            targets in proptest::collection::vec(-1.0..1.0f64, 1..6),
        ) {
            let pacing = Pacing { ticks, period_ns: 1_000_000 };
            let mut path = PacedPath::new(pacing, 1, 1);
            let (mut places, mut from) = (vec![0.0; 3], 0.0);
            for target in targets {
                let way = (target - from).abs();
                path.aim(&[target]);
                let mut count = 0;
                while path.next().is_some() {
                    count += 1;
                    places.push(path.disp[0]);
                    let speed = (places[places.len() - 1] - places[places.len() - 2]) / 1e-3;
                    prop_assert!(speed.abs() <= 1.875 * way / pacing.step_s() * (1.0 + 1e-9) + 1e-12);
                    prop_assert!(path.vel[0].abs() <= 1.875 * way / pacing.step_s() * (1.0 + 1e-9));
                }
                prop_assert_eq!(count, ticks);
                prop_assert_eq!(path.disp[0].to_bits(), target.to_bits());
                prop_assert_eq!(path.vel[0], 0.0);
                // A late target finds it at rest.
                places.extend([target; 3]);
                from = target;
            }
            // The largest acceleration is 10/√3 of way/time², and the way at most 2.
            let bound = 20.0 / (f64::sqrt(3.0) * f64::from(ticks) * f64::from(ticks));
            for window in places.windows(3) {
                let bend = (window[2] - 2.0 * window[1] + window[0]).abs();
                prop_assert!(bend <= bound * (1.0 + 1e-9) + 1e-14, "{bend} {bound}");
            }
        }
    }
}
