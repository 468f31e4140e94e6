//! Pacing: a received target becomes a smooth path of several commands.
//!
//! The path leads from the last target to the new one in N ticks of the server, from rest to rest:
//!
//! ```text
//! s(x) = 10 x³ − 15 x⁴ + 6 x⁵,   x = 1/N, 2/N … 1
//! ```
//!
//! Velocity and acceleration vanish at both ends. So a client that is late, pauses or disconnects leaves the specimen at rest at
//! its last target. The lead of a compensator ends when its history of the motion has passed: settle ticks wait for this. The
//! largest speed is 15/8 of the mean, and the largest acceleration 10/√3 of distance/time². A stop during a path slows the
//! specimen down from the next tick on, in the shortest time that the declared accelerations allow. The lead of a compensator
//! multiplies changes of acceleration: such a specimen slows down along a smooth curve, not linearly, and then settles at rest.
//! The second half of a path slows down by itself: it is completed if it ends as soon. The path is one of the client's
//! displacements: a loading unit follows the poses between two targets. The first target of a session is reached by a ramp of the
//! port. With [`Predicting`] the later targets are not rested at: see [`super::predicted_exchange`].

use std::f64::consts::{FRAC_PI_2, PI};

use gusset_control::port::{Order, Prediction, SlowDown};
use gusset_quantity::frame::{AtAxis, AtClient};
use gusset_quantity::state::TestState;
use gusset_quantity::substructure::Measurement;
use gusset_quantity::time::{Clock, Nanos};
use gusset_record::rt::os;

/// Largest speed of a path, of the mean speed.
pub(super) const FASTEST: f64 = 1.875;
/// Largest acceleration of a path, in distance/time²: 10/√3.
pub(super) const HARDEST: f64 = 5.773_502_691_896_258;
/// Least slowing after a stop in s where an axis declares no limit of acceleration or a compensator leads: the usual hold ramp.
const SLOWING_S: f64 = 0.25;
/// Such a slowing takes at most this share of the time of its path.
const SLOWING_SHARE: f64 = 0.5;
/// Share of a limit of acceleration that a slowing uses.
const SHARE_OF_ACCEL: f64 = 0.5;

/// The clock of paced commands.
#[derive(Debug, Clone, Copy)]
pub struct PaceClock {
    /// The present, ns.
    pub now_ns: fn() -> u64,
    /// Sleeps until a time in ns.
    pub sleep_until_ns: fn(u64),
}

impl PaceClock {
    /// The clock of the machine.
    pub const MACHINE: Self = Self {
        now_ns: os::monotonic_ns,
        sleep_until_ns: os::sleep_until_ns,
    };
}

impl Clock for PaceClock {
    fn now(&self) -> Nanos {
        Nanos((self.now_ns)())
    }

    fn sleep_until(&self, at: Nanos) {
        (self.sleep_until_ns)(at.0);
    }
}

/// The ticks of a server that paces its client.
#[derive(Debug, Clone, Copy)]
pub struct Pacing {
    /// Commands on the path to each target.
    pub ticks: u32,
    /// Further commands at the target, before the answer is read.
    pub settle_ticks: u32,
    /// From one command to the next, in ns.
    pub period_ns: u64,
    /// The clock that releases them.
    pub clock: PaceClock,
    /// The specimen keeps moving while the next target is not known; else it rests at each target.
    pub predict: Option<Predicting>,
}

/// Axes of a specimen whose motion is predicted, at most.
pub const MOST_PREDICTED: usize = 6;

/// How the specimen moves while the next target is not known.
#[derive(Debug, Clone, Copy)]
pub struct Predicting {
    /// Where it slows down and rests.
    pub slow: SlowDown,
    /// The prediction.
    pub order: Order,
    /// Largest distance of each axis from the last target, in m or rad of the specimen.
    pub within: [f64; MOST_PREDICTED],
    /// Largest correction of a force by the initial stiffness, in N or N m of the controller's structure; 0: none is made.
    pub correct_at_most: f64,
    /// Time in s by which compensators lead a steady motion.
    pub lead_s: f64,
}

impl Pacing {
    /// From one command to the next, in s.
    #[must_use]
    pub(crate) fn period_s(self) -> f64 {
        self.period_ns as f64 * 1e-9
    }

    /// Time of the motion to a target, in s.
    #[must_use]
    pub(crate) fn motion_s(self) -> f64 {
        self.period_s() * f64::from(self.ticks)
    }

    /// From one target to the next, in s, at least.
    #[must_use]
    pub(crate) fn step_s(self) -> f64 {
        self.motion_s() + self.period_s() * f64::from(self.settle_ticks)
    }
}

/// A command on the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PathTick {
    /// Share of the time of the path, 0 … 1.
    pub share: f64,
    /// Pace of the motion: less than 1 while it slows down.
    pub pace: f64,
    /// The elapsed ticks of the path and at the target, this one included, over all of them.
    pub gone: f64,
}

/// Acceleration in 1/s² that the axes allow on a motion of length 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AllowedAccel {
    /// The smallest declared one.
    pub largest: f64,
    /// Every axis that moves declares one.
    pub is_declared: bool,
}

/// Motion along a path.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Course {
    /// At full pace.
    Full,
    /// It slows down in a number of ticks, and then rests.
    Slows {
        /// Elapsed share of the time.
        share: f64,
        /// Ticks of the slowing, and those to come.
        ticks: u32,
        left: u32,
        /// The pace falls along a smooth curve.
        is_smooth: bool,
        /// Ticks at rest to come.
        rest: u32,
    },
}

/// The path to the last target.
#[derive(Debug)]
pub(super) struct PacedPath {
    pub pacing: Pacing,
    from: AtClient<Vec<f64>>,
    to: AtClient<Vec<f64>>,
    /// Ticks of the path; more than those of the pacing on the first one, if a limit demands that.
    ticks: u32,
    /// Ticks at the target; fewer after a stop.
    settle_ticks: u32,
    tick: u32,
    course: Course,
    /// The specimen rests between two targets.
    pub is_on_the_way: bool,
    /// The next target is the first one of a session.
    pub is_first: bool,
    /// The next command, in the client's displacements; velocities are of wall time.
    pub disp: AtClient<Vec<f64>>,
    pub vel: AtClient<Vec<f64>>,
    /// Number of the next command.
    pub sequence: u64,
    /// Where the axes are at the last target and at the next one, in their units.
    pub places: [AtAxis<Vec<f64>>; 2],
    /// Acceleration in 1/s² that the limits allow on a path of length 1.
    pub allowed: AllowedAccel,
    /// The compensators before any command.
    pub fresh: Option<TestState>,
    /// Commits of the controller when its last target was answered; none before.
    pub answered: Option<u64>,
    /// The answer at the last target.
    pub at_target: Measurement,
    /// The motion between the targets, if it is predicted.
    pub prediction: Option<Prediction>,
    /// Time of the last target, and from the one before, in s of the controller.
    pub times: [f64; 2],
    /// Share of the step of the last command that was predicted.
    pub share: f64,
    /// No command has left for longer than a tick, because the specimen rests.
    pub has_rested: bool,
    /// A command on the way is not accepted yet.
    pub is_owed: bool,
    /// The last answer on the way.
    pub on_the_way: Measurement,
}

/// Corrections of the forces at the targets.
#[derive(Debug)]
pub(super) struct Corrections {
    /// One for each signal in N or N m, and their energy so far in J.
    pub values: Vec<f64>,
    /// The last target, in the units of the client.
    pub target: Vec<f64>,
    /// The specimen has rested on the way to it.
    pub has_rested: bool,
}

impl Corrections {
    /// None so far.
    pub(crate) fn new(signals: usize) -> Self {
        Self {
            values: vec![0.0; signals + 1],
            target: vec![0.0; signals],
            has_rested: true,
        }
    }
}

/// Share of the distance, and its slope, at a share of the time.
fn shape(x: f64) -> (f64, f64) {
    // Rounding leads not beyond the target.
    let share = (x * x * x * (10.0 + x * (6.0 * x - 15.0))).min(1.0);
    let slope = 30.0 * x * x * (1.0 - x) * (1.0 - x);
    (share, slope)
}

impl PacedPath {
    /// For a client of `signals` displacements, and `axes` axes.
    pub(crate) fn new(pacing: Pacing, signals: usize, axes: usize) -> Self {
        let zeros = || AtClient(vec![0.0; signals]);
        Self {
            pacing,
            from: zeros(),
            to: zeros(),
            ticks: pacing.ticks,
            settle_ticks: pacing.settle_ticks,
            tick: pacing.ticks.saturating_add(pacing.settle_ticks),
            course: Course::Full,
            is_on_the_way: false,
            is_first: true,
            disp: zeros(),
            vel: zeros(),
            sequence: 0,
            places: [AtAxis(vec![0.0; axes]), AtAxis(vec![0.0; axes])],
            allowed: AllowedAccel {
                largest: f64::INFINITY,
                is_declared: false,
            },
            fresh: None,
            answered: None,
            at_target: Measurement::zeros(signals),
            prediction: pacing.predict.map(|predict| {
                let within = predict.within.get(..axes).unwrap_or_default().to_vec();
                let times = [pacing.period_s(), predict.lead_s];
                Prediction::new(predict.slow, predict.order, times, within)
            }),
            times: [0.0; 2],
            share: 0.0,
            has_rested: true,
            is_owed: false,
            on_the_way: Measurement::zeros(signals),
        }
    }

    /// The specimen rests at these displacements of the client, and its axes at this place. The next command has this number.
    pub(crate) fn rests_at(
        &mut self,
        sequence: u64,
        disp: AtClient<&[f64]>,
        place: AtAxis<&[f64]>,
    ) {
        for (to, disp) in self.to.iter_mut().zip(*disp) {
            *to = *disp;
        }
        let [last, _] = &mut self.places;
        last.copy_from_slice(&place);
        (self.ticks, self.settle_ticks) = (self.pacing.ticks, self.pacing.settle_ticks);
        (self.sequence, self.tick) = (sequence, self.all_ticks());
        (self.is_first, self.answered) = (true, None);
        self.is_on_the_way = false;
        if let Some(prediction) = &mut self.prediction {
            prediction.reset();
        }
        (self.times, self.share) = ([0.0; 2], 0.0);
        (self.is_owed, self.has_rested) = (false, true);
    }

    /// True of the last target once more, in the same step, after its answer. Real-time: yes.
    pub(crate) fn is_repeated(&self, target: AtClient<&[f64]>, commits: u64) -> bool {
        self.answered == Some(commits) && self.to.part(Vec::as_slice) == target
    }

    /// Ticks to a target, and at it.
    const fn all_ticks(&self) -> u32 {
        self.ticks.saturating_add(self.settle_ticks)
    }

    /// The next target. Real-time: yes.
    pub(crate) fn aim(&mut self, target: AtClient<&[f64]>) {
        self.from.copy_from_slice(&self.to);
        for (to, target) in self.to.iter_mut().zip(*target) {
            *to = *target;
        }
        (self.ticks, self.tick) = (self.pacing.ticks, 0);
        self.settle_ticks = self.pacing.settle_ticks;
        self.course = Course::Full;
        self.is_on_the_way = false;
    }

    /// The specimen rests after a stop, with its axes at `place`: the next path leads away from there. False if nothing has
    /// moved since the target before. Real-time: yes.
    pub(crate) fn rests_on_the_way(&mut self, place: AtAxis<&[f64]>) -> bool {
        if self.tick == 0 {
            self.to.copy_from_slice(&self.from);
            self.places.swap(0, 1);
            return false;
        }
        if self.course == Course::Full {
            return true;
        }
        self.is_on_the_way = true;
        // A ramp begins where the port is.
        if !self.is_first {
            self.to.copy_from_slice(&self.disp);
        }
        let [last, _] = &mut self.places;
        for (last, place) in last.iter_mut().zip(*place) {
            *last = *place;
        }
        true
    }

    /// The place of the last target, in the client's displacements.
    pub(crate) const fn rests(&self) -> &AtClient<Vec<f64>> {
        &self.to
    }

    /// Ticks of the path.
    pub(crate) const fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Share of the time between two targets that one command takes.
    pub(crate) fn share_of_tick(&self) -> f64 {
        1.0 / f64::from(self.all_ticks())
    }

    /// The path takes `seconds`, if that is longer than usual; returns the time that it takes.
    pub(crate) fn takes(&mut self, seconds: f64) -> f64 {
        let period = self.pacing.period_s();
        let ticks = (seconds / period).ceil().min(f64::from(u32::MAX));
        self.ticks = self.pacing.ticks.max(ticks as u32);
        period * f64::from(self.ticks)
    }

    /// Stops the specimen as soon as it smoothly can: it slows down from the next tick on, and stays for `rest` ticks then. A
    /// path that has not begun does not begin. Real-time: yes.
    pub(crate) fn stop(&mut self, rest: u32) {
        if self.course != Course::Full {
            return;
        }
        self.settle_ticks = self.settle_ticks.min(rest);
        if self.tick >= self.ticks {
            return;
        }
        let needed = self.ticks_to_slow();
        let slows_by_itself = self.tick >= self.ticks.div_ceil(2);
        if slows_by_itself && needed >= f64::from(self.ticks - self.tick) {
            // The end of the path is as near, and within the limits.
            return;
        }
        let ticks = needed as u32;
        let (left, rest) = if self.tick == 0 {
            (0, 0)
        } else {
            (ticks, rest)
        };
        self.course = Course::Slows {
            share: f64::from(self.tick) / f64::from(self.ticks),
            ticks,
            left,
            is_smooth: self.is_led(),
            rest,
        };
    }

    /// A compensator leads the commands; on the ramp to the first target it holds.
    const fn is_led(&self) -> bool {
        self.fresh.is_some() && !self.is_first
    }

    /// Ticks that a stop here needs: one half of each limit of acceleration is for the slowing, and less where the path itself slows
    /// down more. The other half is for poses, which do not follow the path linearly.
    fn ticks_to_slow(&self) -> f64 {
        let x = f64::from(self.tick) / f64::from(self.ticks);
        let [slope, bend] = if self.is_first {
            [
                FRAC_PI_2 * libm::sin(PI * x),
                PI * FRAC_PI_2 * libm::cos(PI * x),
            ]
        } else {
            [shape(x).1, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)]
        };
        let AllowedAccel {
            largest,
            is_declared,
        } = self.allowed;
        let period = self.pacing.period_s();
        let seconds = period * f64::from(self.ticks);
        let slows = (-bend).max(0.0) / (seconds * seconds);
        let allowed = (SHARE_OF_ACCEL * largest).min(largest - slows);
        let is_led = self.is_led();
        let least = if is_declared && !is_led {
            0.0
        } else {
            SLOWING_S.min(SLOWING_SHARE * seconds)
        };
        // The steepest place of the smooth curve.
        let steepest = if is_led { FASTEST } else { 1.0 };
        if allowed > 0.0 {
            let needed = steepest * slope / seconds / allowed;
            (needed.max(least) / period).ceil().max(1.0)
        } else {
            f64::INFINITY
        }
    }

    /// The next tick of the path; none at its end. Real-time: yes.
    pub(crate) fn next(&mut self) -> Option<PathTick> {
        let all_ticks = self.all_ticks();
        let of_path = f64::from(self.ticks);
        let tick = match &mut self.course {
            Course::Full if self.tick >= all_ticks => return None,
            Course::Full => {
                self.tick += 1;
                PathTick {
                    share: f64::from(self.tick.min(self.ticks)) / of_path,
                    pace: 1.0,
                    gone: f64::from(self.tick) / f64::from(all_ticks),
                }
            }
            Course::Slows {
                left: 0, rest: 0, ..
            } => return None,
            Course::Slows {
                share,
                ticks,
                left,
                is_smooth,
                rest,
            } => {
                let pace = if *left > 0 {
                    *left -= 1;
                    let linear = f64::from(*left) / f64::from(*ticks);
                    if *is_smooth { shape(linear).0 } else { linear }
                } else {
                    *rest -= 1;
                    0.0
                };
                *share = (*share + pace / of_path).min(1.0);
                if *share >= 1.0 {
                    *left = 0;
                }
                PathTick {
                    share: *share,
                    pace,
                    gone: *share * of_path / f64::from(all_ticks),
                }
            }
        };
        Some(tick)
    }

    /// Makes the command of a tick from the client's displacements. Real-time: yes.
    pub(crate) fn make(&mut self, tick: PathTick) {
        let (share, slope) = shape(tick.share);
        let rate = tick.pace * slope / (self.pacing.period_s() * f64::from(self.ticks));
        let ends = self.from.iter().zip(&*self.to);
        let made = self.disp.iter_mut().zip(&mut *self.vel);
        for ((disp, vel), (from, to)) in made.zip(ends) {
            // The target itself, to the last bit.
            *disp = if tick.share < 1.0 {
                from + share * (to - from)
            } else {
                *to
            };
            *vel = rate * (to - from);
        }
    }

    /// The last command has left. Real-time: yes.
    pub(crate) const fn count(&mut self) {
        self.sequence = self.sequence.saturating_add(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The commands of one path from here to `target`; stopped after `stop` of them, if given.
    fn go(path: &mut PacedPath, target: f64, stop: Option<u32>) -> Vec<[f64; 2]> {
        path.aim(AtClient(&[target]));
        let mut made = Vec::new();
        loop {
            if stop == u32::try_from(made.len()).ok() {
                path.stop(0);
            }
            let Some(tick) = path.next() else {
                return made;
            };
            path.make(tick);
            made.push([path.disp[0], path.vel[0]]);
        }
    }

    proptest! {
        /// From rest to rest, with the bounds of the polynomial on speed and acceleration, and the target to the last bit.
        #[test]
        fn a_path_begins_and_ends_at_rest(
            ticks in 2u32..400,
            settle_ticks in 0u32..20,
            targets in proptest::collection::vec(-1.0..1.0f64, 1..6),
        ) {
            let pacing = Pacing { ticks, settle_ticks, period_ns: 1_000_000, clock: PaceClock::MACHINE, predict: None };
            let mut path = PacedPath::new(pacing, 1, 1);
            let (mut places, mut from) = (vec![0.0; 3], 0.0);
            for target in targets {
                let way = (target - from).abs();
                let fastest = 1.875 * way / pacing.motion_s() * (1.0 + 1e-9);
                let made = go(&mut path, target, None);
                prop_assert_eq!(made.len(), (ticks + settle_ticks) as usize);
                for [disp, vel] in &made {
                    let speed = (disp - places[places.len() - 1]) / 1e-3;
                    prop_assert!(speed.abs() <= fastest + 1e-12 && vel.abs() <= fastest);
                    places.push(*disp);
                }
                for [disp, vel] in &made[ticks as usize - 1..] {
                    prop_assert_eq!((disp.to_bits(), *vel), (target.to_bits(), 0.0));
                }
                // A late target finds it at rest.
                places.extend([target; 3]);
                from = target;
            }
            // The largest acceleration is 10/√3 of distance/time², and the distance at most 2.
            let bound = 20.0 / (f64::sqrt(3.0) * f64::from(ticks) * f64::from(ticks));
            for window in places.windows(3) {
                let bend = (window[2] - 2.0 * window[1] + window[0]).abs();
                prop_assert!(bend <= bound * (1.0 + 1e-9) + 1e-14, "{bend} {bound}");
            }
        }

        /// A stop on a path without declared acceleration limits: at rest within half of the time of the path, or 0.25
        /// s.
        #[test]
        fn stop_on_a_path_slows_down(ticks in 4u32..1000, settle_ticks in 0u32..9, share in 0.0..1.1f64) {
            let pacing = Pacing { ticks, settle_ticks, period_ns: 1_000_000, clock: PaceClock::MACHINE, predict: None };
            let mut path = PacedPath::new(pacing, 1, 1);
            let stop = (share * f64::from(ticks)) as u32;
            let made = go(&mut path, 1.0, Some(stop));
            let further = made.len() as u32 - stop.min(made.len() as u32);
            prop_assert!(further <= (ticks / 2 + 1).min(251));
            if stop == 0 {
                prop_assert!(made.is_empty());
                return Ok(());
            }
            let [last, vel] = made[made.len() - 1];
            prop_assert!(last <= 1.0 && vel == 0.0);
            let mut places = vec![0.0; 3];
            places.extend(made.iter().map(|[disp, _]| *disp));
            places.extend([last; 3]);
            let n = f64::from(ticks);
            // Half of the time at half pace is a quarter: s(3/4) is 0.9.
            prop_assert!(f64::from(stop) >= 0.5 * n || last < 0.9, "{stop} {last}");
            // The slowing in half of the time, and the part of the path: less than its own largest acceleration.
            let bound = HARDEST.max(1.875 * n / f64::from((ticks / 2).min(250))) + HARDEST;
            for window in places.windows(3) {
                let bend = (window[2] - 2.0 * window[1] + window[0]).abs();
                prop_assert!(bend <= bound / (n * n) + 1e-14, "{bend} {}", bound / (n * n));
                prop_assert!((window[1] - window[0]) * n <= 1.875 * (1.0 + 1e-9));
            }
        }

        /// A stop begins in the next tick, takes the time that a declared acceleration needs, and keeps it.
        #[test]
        fn stop_takes_the_time_of_its_limit(
            ticks in 40u32..400,
            longer in 1.0..50.0f64,
            is_first in proptest::bool::ANY,
            margin in 1.0..2000.0f64,
            share in 0.01..0.99f64,
        ) {
            let pacing = Pacing { ticks, settle_ticks: 0, period_ns: 10_000_000, clock: PaceClock::MACHINE, predict: None };
            let mut path = PacedPath::new(pacing, 1, 1);
            path.is_first = is_first;
            path.aim(AtClient(&[1.0]));
            let seconds = path.takes(longer * pacing.motion_s());
            let largest = margin * HARDEST / (seconds * seconds);
            path.allowed = AllowedAccel { largest, is_declared: true };
            let stop = (share * f64::from(path.ticks)).max(1.0) as u32;
            let way = |share: f64| if is_first { 0.5 - 0.5 * libm::cos(PI * share) } else { shape(share).0 };
            let (mut places, mut further) = (vec![0.0; 2], 0);
            for gone in 0.. {
                if gone == stop {
                    path.stop(0);
                }
                let Some(tick) = path.next() else { break };
                places.push(way(tick.share));
                further += u32::from(gone >= stop);
            }
            let all = f64::from(path.ticks);
            let at = stop as usize + 1;
            // The next tick is slower than this one, unless the limit hardly exceeds the path's own need to gain speed.
            let steps = [places[at] - places[at - 1], places[at + 1] - places[at]];
            prop_assert!(steps[1] < steps[0] || margin < 3.0, "{steps:?}");
            places.extend([places[places.len() - 1]; 2]);
            // The slowing from the largest speed at half of the limit, or the rest of the path.
            let needed = (1.875 * all * 2.0 / (HARDEST * margin)).max(0.5 * all / margin);
            prop_assert!(f64::from(further) <= needed + 2.0, "{further} {needed}");
            let bound = largest * 1e-4;
            for window in places.windows(3) {
                let bend = (window[2] - 2.0 * window[1] + window[0]).abs();
                prop_assert!(bend <= bound * 1.02, "{bend} {bound}");
            }
        }
    }
}
