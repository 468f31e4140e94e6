//! Which way round is it wired? A small smooth motion away from where a specimen stands and back, axis after axis, and
//! the judgement on what was measured meanwhile.
//!
//! Each axis holds, goes by its amplitude in the positive direction along half a period of a cosine, holds, comes back
//! the same way and holds: the last command is the first one to the last bit. Readings of the second half of each hold
//! are averaged; their scatter says what is noise. Quasi-static: a specimen without stiffness (a damper, an open gap) has
//! no direction that this could show. The forces of all axes beside the motion of one are a column of the stiffness:
//! [`super::stiffness_check`] compares it with the estimate.
//!
//! An interrupted probe can turn back: its command comes to rest, rests, and returns to the start along half a cosine, never faster
//! than the probe itself. A force beyond those that were passed ends the return.

use super::passed::Passed;
use super::stiffness_check::{Column, compare};
use super::wiring_fault::{Channel, WiringFault};
use gusset_quantity::units::AxisUnits;

/// A difference of two averages below so many of its own standard deviations may be noise.
pub(super) const SIGMAS: f64 = 5.0;
/// A displacement that follows by less than this part of the amplitude does not follow.
const FOLLOWS: f64 = 0.25;
/// A displacement beyond this multiple of the amplitude is not that of the command.
const FOLLOWS_AT_MOST: f64 = 2.0;
/// A force that changes by less than this part of what the estimate says is not that of the specimen.
const ANSWERS: f64 = 0.05;

/// How long the parts of a probe take, in exchanges; at least two each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pace {
    /// Each way.
    pub ramp: u32,
    /// Each hold.
    pub hold: u32,
    /// From one exchange to the next, in ns.
    pub period_ns: u64,
}

/// Longest part of a probe, in exchanges.
const LONGEST: f64 = 1e6;
/// Shortest way, in exchanges.
const SHORTEST_RAMP: u32 = 4;
/// Shortest hold, in exchanges: half of it is averaged.
const SHORTEST_HOLD: f64 = 16.0;
/// Longest rest before a return, in s, and shortest, in exchanges.
const REST_S: f64 = 0.2;
const SHORTEST_REST: u32 = 8;
/// A hold takes this part of the time of a ramp.
const HOLD: f64 = 0.4;

impl Pace {
    /// A ramp of `ramp_s` with one exchange every `period_s`, both positive.
    #[must_use]
    pub fn of(ramp_s: f64, period_s: f64) -> Self {
        let ramp = (ramp_s / period_s)
            .ceil()
            .clamp(f64::from(SHORTEST_RAMP), LONGEST);
        let hold = (HOLD * ramp).ceil().clamp(SHORTEST_HOLD, LONGEST);
        Self {
            ramp: ramp as u32,
            hold: hold as u32,
            period_ns: (period_s * 1e9) as u64,
        }
    }

    /// True if a way takes as few exchanges as it may, and not the time that was asked for.
    #[must_use]
    pub const fn is_shortest(self) -> bool {
        self.ramp == SHORTEST_RAMP
    }

    const fn whole(self) -> u32 {
        // Bounded by `LONGEST`.
        2 * self.ramp + 3 * self.hold
    }
}

/// What a probe found on one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Axis, from 0.
    pub axis: usize,
    /// Change of the measured displacement.
    pub disp: f64,
    /// Change of the measured force.
    pub force: f64,
}

/// Mean and scatter of readings at rest.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Average {
    pub count: f64,
    pub mean: f64,
    squares: f64,
}

impl Average {
    pub(crate) fn variance(&self) -> f64 {
        self.squares / (self.count - 1.0).max(1.0)
    }

    pub(crate) fn add(&mut self, value: f64) {
        self.count += 1.0;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count;
        self.squares += from_mean * (value - self.mean);
    }
}

/// Displacement and force at the bottom, at the top, and at the bottom again.
#[derive(Debug, Clone)]
struct AxisProbe {
    amplitude: f64,
    units: AxisUnits,
    disp: [Average; 3],
    /// Forces of all axes.
    forces: Vec<[Average; 3]>,
}

/// The way of an interrupted probe back to its start.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Back {
    /// The displacement of a command changes by `change`, and by `brake` less in each exchange.
    Brakes { change: f64, brake: f64 },
    /// At rest, for this number of exchanges.
    Rests(u32),
    /// After `gone` exchanges from `from`.
    Returns { from: f64, gone: f64 },
    /// A force was beyond those that were passed.
    Ended { axis: usize },
}

/// How an interrupted probe ended its way back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WayBack {
    /// At the start.
    Complete,
    /// Where it is: it was interrupted, or lost.
    Incomplete,
    /// Where the force of this axis (from 0) was beyond the forces that were passed.
    Force(usize),
}

impl WayBack {
    /// Its word in events.
    #[must_use]
    pub(crate) const fn word(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Incomplete => "incomplete",
            Self::Force(_) => "beyond_passed_force",
        }
    }
}

/// A probe of one specimen. Real-time: yes, after its making.
#[derive(Debug, Clone)]
pub struct Probe {
    start: Vec<f64>,
    axes: Vec<AxisProbe>,
    /// The estimate, n × n by rows.
    stiffness: Vec<f64>,
    /// A wrong amount of stiffness is accepted.
    accepts: bool,
    pace: Pace,
    axis: usize,
    /// Exchanges of this axis that were begun.
    exchanges: u32,
    /// What is missing to the end of the last of them, 0 … 1: more than 0 only after one that went slower.
    missing: f64,
    /// Displacements of this axis from the start in the last commands, the newest first.
    made: [f64; 3],
    passed: Vec<Passed>,
    back: Option<Back>,
}

/// The result of a probe.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Wiring {
    /// The changes of each axis.
    pub found: Vec<Found>,
    /// The differences that the user accepts.
    pub accepted: Vec<WiringFault>,
}

impl Probe {
    /// A probe from `start`, by `amplitude` along each axis (0: this axis is left alone), of a specimen whose estimated stiffness
    /// is `stiffness`, n × n by rows; all in `units`. `accepts`: a wrong amount of stiffness is accepted.
    #[must_use]
    pub(crate) fn new(
        start: &[f64],
        amplitude: &[f64],
        (stiffness, accepts): (&[f64], bool),
        units: &[AxisUnits],
        pace: Pace,
    ) -> Self {
        let n = amplitude.len();
        let axes = amplitude.iter().zip(units);
        let axes = axes.map(|(amplitude, units)| AxisProbe {
            amplitude: *amplitude,
            units: *units,
            disp: Default::default(),
            forces: vec![Default::default(); n],
        });
        Self {
            start: start.to_vec(),
            axes: axes.collect(),
            stiffness: stiffness.to_vec(),
            accepts,
            pace,
            axis: 0,
            exchanges: 0,
            missing: 0.0,
            made: [0.0; 3],
            passed: vec![Passed::NOTHING; n],
            back: None,
        }
    }

    /// From one exchange to the next, in ns.
    #[must_use]
    pub const fn period_ns(&self) -> u64 {
        self.pace.period_ns
    }

    /// Axis that moves, from 0.
    #[must_use]
    pub const fn axis(&self) -> usize {
        self.axis
    }

    /// The next command, one entry per axis; false if there is none. Real-time: yes.
    pub fn next(&mut self, disp: &mut [f64], vel: &mut [f64]) -> bool {
        self.go_on(1.0, disp, vel)
    }

    /// The same by `share` (more than 0, at most 1) of an exchange: a probe that is being held, or goes on after that.
    /// Real-time: yes.
    pub(crate) fn go_on(&mut self, share: f64, disp: &mut [f64], vel: &mut [f64]) -> bool {
        let motion = match self.back {
            Some(back) => self.go_back(back, share),
            None => self.go_forth(share),
        };
        let Some((way, speed)) = motion else {
            return false;
        };
        let [last, before, _] = self.made;
        self.made = [way, last, before];
        for (to, start) in disp.iter_mut().zip(&self.start) {
            *to = *start;
        }
        vel.fill(0.0);
        if let (Some(disp), Some(vel)) = (disp.get_mut(self.axis), vel.get_mut(self.axis)) {
            *disp += way;
            *vel = speed;
        } else {
            disp.fill(f64::NAN);
        }
        true
    }

    /// Displacement from the start and velocity of the next command of the check.
    fn go_forth(&mut self, share: f64) -> Option<(f64, f64)> {
        if self.gone() >= f64::from(self.pace.whole()) {
            (self.exchanges, self.missing) = (0, 0.0);
            self.axis += 1;
        }
        while self.axes.get(self.axis).is_some_and(|a| a.amplitude == 0.0) {
            self.axis += 1;
        }
        let amplitude = self.axes.get(self.axis).map(|axis| axis.amplitude)?;
        self.missing -= share;
        if self.missing < 0.0 {
            self.missing += 1.0;
            self.exchanges += 1;
        }
        if self.exchanges > self.pace.whole() {
            (self.exchanges, self.missing) = (self.pace.whole(), 0.0);
        }
        let (part, slope) = self.shape(self.gone());
        Some((amplitude * part, amplitude * slope * share))
    }

    /// Displacement and velocity of the next command of the return; none at its end.
    fn go_back(&mut self, back: Back, share: f64) -> Option<(f64, f64)> {
        let [last, ..] = self.made;
        let (next, motion) = match back {
            Back::Brakes { change, brake } => {
                let change = change.signum() * (change.abs() - brake).max(0.0);
                let amplitude = self.axes.get(self.axis).map_or(0.0, |axis| axis.amplitude);
                // No command leaves the range of the check.
                let way = (last + change).clamp(amplitude.min(0.0), amplitude.max(0.0));
                let next = if way == last {
                    Back::Rests(self.rest())
                } else {
                    Back::Brakes { change, brake }
                };
                (next, (way, change / self.period_s()))
            }
            Back::Rests(exchanges) => {
                let next = match exchanges.checked_sub(1) {
                    Some(rest) => Back::Rests(rest),
                    None => Back::Returns {
                        from: last,
                        gone: 0.0,
                    },
                };
                (next, (last, 0.0))
            }
            Back::Returns { from, gone } => {
                let ramp = self.ramp_from(from);
                if gone >= ramp {
                    return None;
                }
                let gone = (gone + share).min(ramp);
                let angle = std::f64::consts::PI * gone / ramp;
                let motion = if gone >= ramp {
                    (0.0, 0.0)
                } else {
                    let peak = 0.5 * std::f64::consts::PI * from / (ramp * self.period_s());
                    let speed = -peak * libm::sin(angle) * share;
                    (0.5 * from * (1.0 + libm::cos(angle)), speed)
                };
                (Back::Returns { from, gone }, motion)
            }
            Back::Ended { .. } => return None,
        };
        self.back = Some(next);
        Some(motion)
    }

    /// Exchanges of the return from a displacement: the largest velocity and acceleration are at most those of the probe.
    fn ramp_from(&self, from: f64) -> f64 {
        let amplitude = self.axes.get(self.axis).map_or(1.0, |axis| axis.amplitude);
        let ramp = f64::from(self.pace.ramp) * (from / amplitude).abs().sqrt();
        ramp.ceil().max(f64::from(SHORTEST_RAMP))
    }

    /// Exchanges at rest before the return: an actuator arrives where it was sent, and the forces there are passed.
    fn rest(&self) -> u32 {
        let longest = (REST_S / self.period_s()).min(LONGEST) as u32;
        (self.pace.hold / 2).min(longest.max(SHORTEST_REST))
    }

    fn period_s(&self) -> f64 {
        self.pace.period_ns.max(1) as f64 * 1e-9
    }

    /// Turns an interrupted probe back to its start: from here on its commands are those of the return. `sent` is the last command
    /// that left, and `brake` the change of velocity in one exchange times its duration that an axis allows. False if there is
    /// nothing to undo. Real-time: yes.
    pub(crate) fn turn_back(
        &mut self,
        sent: impl Fn(usize) -> f64,
        brake: impl Fn(usize) -> f64,
    ) -> bool {
        let Some(start) = self.start.get(self.axis) else {
            return false;
        };
        let way = sent(self.axis) - start;
        let [newest, last, before] = self.made;
        // A command that was made and not sent is forgotten.
        if (way - last).abs() < (way - newest).abs() {
            self.made = [last, before, before];
        }
        let [last, before, _] = self.made;
        if last == 0.0 && before == 0.0 {
            return false;
        }
        self.back = Some(Back::Brakes {
            change: last - before,
            brake: brake(self.axis),
        });
        true
    }

    /// How the return ended.
    #[must_use]
    pub fn way_back(&self) -> WayBack {
        match self.back {
            Some(Back::Ended { axis }) => WayBack::Force(axis),
            Some(Back::Returns { from, gone }) if gone >= self.ramp_from(from) => WayBack::Complete,
            _ => WayBack::Incomplete,
        }
    }

    /// Exchanges of this axis that lie behind.
    fn gone(&self) -> f64 {
        f64::from(self.exchanges) - self.missing
    }

    /// Part of the amplitude after so many exchanges, and its change per second.
    fn shape(&self, gone: f64) -> (f64, f64) {
        let (ramp, hold) = (f64::from(self.pace.ramp), f64::from(self.pace.hold));
        let bell = |since: f64| {
            let way = std::f64::consts::PI * since / ramp;
            let length = ramp * self.pace.period_ns.max(1) as f64 * 1e-9;
            let slope = 0.5 * std::f64::consts::PI * libm::sin(way) / length;
            (0.5 * (1.0 - libm::cos(way)), slope)
        };
        let (up, top, down, back) = (
            hold,
            hold + ramp,
            2.0 * hold + ramp,
            2.0 * hold + 2.0 * ramp,
        );
        match gone {
            gone if gone <= up => (0.0, 0.0),
            gone if gone <= top => bell(gone - up),
            gone if gone <= down => (1.0, 0.0),
            gone if gone <= back => {
                let (part, slope) = bell(gone - down);
                (1.0 - part, -slope)
            }
            _ => (0.0, 0.0),
        }
    }

    /// The hold for which the last command counts; none if it does not.
    fn counts_for(&self) -> Option<usize> {
        let Pace { ramp, hold, .. } = self.pace;
        let (part, since) = match self.exchanges.checked_sub(1)? {
            k if k < hold => (0, k),
            k if (hold + ramp..2 * hold + ramp).contains(&k) => (1, k - hold - ramp),
            k if k >= 2 * (hold + ramp) => (2, k - 2 * (hold + ramp)),
            _ => return None,
        };
        (since >= hold / 2).then_some(part)
    }

    /// What the last command gave is not known: one that counts is the next command once more. Real-time: yes.
    pub(crate) fn give_again(&mut self) {
        if self.back.is_none() {
            self.exchanges -= u32::from(self.counts_for().is_some());
        }
    }

    /// What the last command gave. Real-time: yes.
    pub(crate) fn take(&mut self, disp: &[f64], force: &[f64]) {
        if let Some(Back::Returns { .. }) = self.back {
            self.judge_way_back(force);
            return;
        }
        for (passed, force) in self.passed.iter_mut().zip(force) {
            passed.take(*force);
        }
        let part = self.counts_for().filter(|_| self.back.is_none());
        let (Some(part), Some(axis)) = (part, self.axes.get_mut(self.axis)) else {
            return;
        };
        if let (Some(to), Some(value)) = (axis.disp.get_mut(part), disp.get(self.axis)) {
            to.add(*value);
        }
        for (to, value) in axis.forces.iter_mut().zip(force) {
            if let Some(to) = to.get_mut(part) {
                to.add(*value);
            }
        }
    }

    /// A force beyond those that were passed ends the return.
    fn judge_way_back(&mut self, force: &[f64]) {
        let noise = |axis: usize| {
            let probed = self.axes.get(self.axis);
            let forces = probed.and_then(|probed| probed.forces.get(axis));
            SIGMAS * forces.map_or(0.0, |holds| scatter(holds).sqrt())
        };
        let mut forces = self.passed.iter().zip(force).enumerate();
        let beyond = forces.find(|(axis, (passed, force))| !passed.has(**force, noise(*axis)));
        if let Some((axis, _)) = beyond {
            self.back = Some(Back::Ended { axis });
        }
    }

    /// The judgement, when there is no next command: what was found on each axis, and what the user accepts of it.
    ///
    /// # Errors
    /// The first fault for which the specimen must not be armed.
    pub fn verdict(&self) -> Result<Wiring, WiringFault> {
        let mut wiring = Wiring::default();
        let mut columns = Vec::new();
        for (index, axis) in self.axes.iter().enumerate() {
            if axis.amplitude == 0.0 {
                continue;
            }
            wiring.found.push(self.verdict_of(index, axis)?);
            columns.push(axis.column(index));
        }
        let units: Vec<AxisUnits> = self.axes.iter().map(|axis| axis.units).collect();
        for fault in compare(&columns, &self.stiffness, &units) {
            if !(self.accepts && fault.is_acceptable()) {
                return Err(fault);
            }
            wiring.accepted.push(fault);
        }
        Ok(wiring)
    }
}

/// Variance of the readings in the holds so far.
fn scatter([bottom, top, again]: &[Average; 3]) -> f64 {
    let holds = [bottom, top, again];
    let read = holds.iter().filter(|hold| hold.count > 0.0);
    let (count, squares) = read.fold((0.0, 0.0), |(count, squares), hold| {
        (count + hold.count - 1.0, squares + hold.squares)
    });
    squares / f64::max(count, 1.0)
}

/// Change from the bottom to the top, and its standard deviation.
fn change(holds: &[Average; 3]) -> (f64, f64) {
    let [bottom, top, again] = holds;
    let change = top.mean - 0.5 * (bottom.mean + again.mean);
    let spread = 1.0 / top.count + 0.25 / bottom.count + 0.25 / again.count;
    (change, (scatter(holds) * spread).sqrt())
}

impl AxisProbe {
    /// The column of the stiffness that the motion of this axis shows.
    fn column(&self, axis: usize) -> Column {
        Column {
            axis,
            disp: change(&self.disp).0,
            forces: self.forces.iter().map(change).collect(),
        }
    }
}

impl Probe {
    /// Direction and reaction of one axis.
    fn verdict_of(&self, axis: usize, probed: &AxisProbe) -> Result<Found, WiringFault> {
        let n = self.axes.len();
        let stiffness = self.stiffness.get(axis * (n + 1)).copied().unwrap_or(0.0);
        let AxisProbe {
            amplitude, units, ..
        } = probed;
        let (disp, disp_noise) = change(&probed.disp);
        let (force, force_noise) = probed.forces.get(axis).map_or((0.0, 0.0), change);
        let force_expected = stiffness * amplitude;
        for (channel, found, deviation, expected, part, unit) in [
            (
                Channel::Disp,
                disp,
                disp_noise,
                *amplitude,
                FOLLOWS,
                units.disp,
            ),
            (
                Channel::Force,
                force,
                force_noise,
                force_expected,
                ANSWERS,
                units.force,
            ),
        ] {
            let noise = SIGMAS * deviation;
            // Written so that what is no number fails.
            let is_told_from_noise = found.abs() > noise;
            let is_large_enough = found.abs() >= part * expected.abs();
            let is_small_enough =
                channel == Channel::Force || found.abs() <= FOLLOWS_AT_MOST * expected.abs();
            if is_told_from_noise && is_large_enough && is_small_enough {
                continue;
            }
            if noise >= expected.abs() {
                return Err(WiringFault::Noise {
                    axis,
                    channel,
                    noise,
                    expected,
                    unit,
                });
            }
            return Err(WiringFault::Dead {
                axis,
                channel,
                found,
                expected,
                unit,
            });
        }
        let follows = disp * amplitude > 0.0;
        let resists = force * force_expected > 0.0;
        let channel = match (follows, resists) {
            (true, true) => return Ok(Found { axis, disp, force }),
            (true, false) => Channel::Force,
            (false, true) => Channel::Disp,
            (false, false) => Channel::Command,
        };
        Err(WiringFault::Reversed {
            axis,
            channel,
            disp,
            force,
            units: (units.disp, units.force),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};

    const PACE: Pace = Pace {
        ramp: 50,
        hold: 40,
        period_ns: 10_000_000,
    };
    const AMPLITUDE: f64 = 1e-4;
    const STIFFNESS: f64 = 1e6;

    /// A probe of two axes of a spring; `wiring` makes readings of displacement and force of the true motion.
    fn probed(mut wiring: impl FnMut(f64) -> (f64, f64)) -> Result<Vec<Found>, WiringFault> {
        let mut probe = Probe::new(
            &[0.5, -0.25],
            &[AMPLITUDE, AMPLITUDE],
            (&[STIFFNESS, 0.0, 0.0, STIFFNESS], false),
            &[AxisUnits::SI; 2],
            PACE,
        );
        let (mut disp, mut vel) = ([0.0; 2], [0.0; 2]);
        let mut last = [0.0; 2];
        while probe.next(&mut disp, &mut vel) {
            let one = wiring(disp[0] - 0.5);
            let two = wiring(disp[1] + 0.25);
            probe.take(&[0.5 + one.0, two.0 - 0.25], &[one.1, two.1]);
            last = disp;
        }
        assert_eq!(last, [0.5, -0.25], "back to the last bit");
        probe.verdict().map(|wiring| wiring.found)
    }

    #[test]
    fn probe_moves_one_axis_smoothly() {
        let mut probe = Probe::new(
            &[0.0, 1.0],
            &[0.0, 2.0],
            (&[1.0, 0.0, 0.0, 1.0], false),
            &[AxisUnits::SI; 2],
            PACE,
        );
        let (mut disp, mut vel) = ([9.0; 2], [9.0; 2]);
        let mut path = Vec::new();
        while probe.next(&mut disp, &mut vel) {
            assert_eq!(
                (disp[0], vel[0]),
                (0.0, 0.0),
                "an axis without amplitude stays"
            );
            path.push((disp[1], vel[1]));
        }
        assert_eq!(path.len(), 2 * 50 + 3 * 40);
        let highest = path.iter().map(|p| p.0).fold(0.0, f64::max);
        assert_eq!(highest, 3.0);
        let dt = 0.01;
        // The largest second derivative of 2 · half a cosine over 0.5 s: 2 · π² / (2 · 0.25) = 39.5.
        for pair in path.windows(3) {
            let central = (pair[2].0 - pair[0].0) / (2.0 * dt);
            let bend = (pair[2].0 - 2.0 * pair[1].0 + pair[0].0) / (dt * dt);
            assert!(bend.abs() < 40.0, "{bend}");
            // At the corners between hold and bell the difference sees half of the bend: 40 · dt / 2.
            assert!(
                (central - pair[1].1).abs() < 0.21,
                "{central} {}",
                pair[1].1
            );
        }
    }

    #[test]
    fn well_wired_spring_shows_its_stiffness() {
        let found = probed(|d| (d, STIFFNESS * d)).unwrap();
        assert_eq!(found.len(), 2);
        for axis in found {
            assert!((axis.disp - AMPLITUDE).abs() < 1e-15);
            assert!((axis.force / axis.disp - STIFFNESS).abs() < 1e-3);
        }
    }

    #[test]
    fn each_reversed_channel_is_named() {
        let channel = |wiring: fn(f64) -> (f64, f64)| match probed(wiring) {
            Err(WiringFault::Reversed {
                axis: 0, channel, ..
            }) => channel,
            other => panic!("{other:?}"),
        };
        assert_eq!(channel(|d| (d, -STIFFNESS * d)), Channel::Force);
        assert_eq!(channel(|d| (-d, STIFFNESS * d)), Channel::Disp);
        assert_eq!(channel(|d| (-d, -STIFFNESS * d)), Channel::Command);
    }

    #[test]
    fn dead_channel_states_the_expected_value() {
        let force = probed(|d| (d, 7.0)).unwrap_err();
        assert!(
            matches!(force, WiringFault::Dead { channel: Channel::Force, expected, .. }
            if (expected - 100.0).abs() < 1e-9)
        );
        let disp = probed(|d| (0.0, STIFFNESS * d)).unwrap_err();
        assert!(matches!(
            disp,
            WiringFault::Dead {
                channel: Channel::Disp,
                ..
            }
        ));
        // A force in kN where N are expected.
        assert_eq!(
            probed(|d| (d, 1e-3 * STIFFNESS * d)).unwrap_err().name(),
            "force_dead"
        );
        // A command that is ten times as large as it says.
        let tenfold = probed(|d| (10.0 * d, 10.0 * STIFFNESS * d)).unwrap_err();
        assert_eq!(tenfold.name(), "displacement_too_large");
        let nan = probed(|d| (d, f64::NAN)).unwrap_err();
        assert_eq!(nan.name(), "force_dead");
    }

    /// Noise of a standard deviation of 6 % of the force: half of 40 readings at the top and twice at the bottom give a
    /// standard deviation of the change of 0.06 · √(1/20 + 0.5/20) = 0.016, five of which are 8 %: seen in every seed. With
    /// five times that noise the sign is still sure (five deviations are 41 %); with eight times the force it is not.
    #[test]
    fn only_large_noise_hides_a_direction() {
        for seed in 0..200 {
            let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
            let mut noise = |part: f64| {
                // Twelve uniform numbers: a variance of one.
                let sum: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
                part * STIFFNESS * AMPLITUDE * sum
            };
            let right = probed(|d| (d, STIFFNESS * d + noise(0.06)));
            assert!(right.is_ok(), "seed {seed}: {right:?}");
            let wrong = probed(|d| (d, -STIFFNESS * d + noise(0.3))).unwrap_err();
            assert_eq!(wrong.name(), "force_reversed", "seed {seed}");
            let hidden = probed(|d| (d, -STIFFNESS * d + noise(8.0)));
            assert!(
                matches!(
                    hidden,
                    Err(WiringFault::Noise { .. } | WiringFault::Reversed { .. })
                ),
                "never taken for right: seed {seed}: {hidden:?}"
            );
            let nothing = probed(|d| (d, noise(0.3))).unwrap_err();
            assert!(
                matches!(nothing.name(), "force_dead" | "probe_below_noise"),
                "seed {seed}: {nothing:?}"
            );
        }
    }

    /// A probe of one axis from 0.5 m that is turned back after this number of commands, with the change of a command in one exchange that its
    /// brake allows: commands, and how it ended. `force` is that of the specimen.
    fn turned_back(
        after: usize,
        brake: f64,
        mut force: impl FnMut(f64) -> f64,
    ) -> (Vec<f64>, Option<WayBack>) {
        let estimate = (&[STIFFNESS][..], false);
        let mut probe = Probe::new(&[0.5], &[AMPLITUDE], estimate, &[AxisUnits::SI], PACE);
        let (mut disp, mut vel) = ([0.5], [0.0]);
        let mut way = vec![0.5];
        for _ in 0..after {
            probe.next(&mut disp, &mut vel);
            probe.take(&disp, &[force(disp[0] - 0.5)]);
            way.push(disp[0]);
        }
        // The command after that is made, and does not leave.
        let goes_on = probe.next(&mut disp, &mut vel);
        let sent = *way.last().unwrap();
        if !goes_on || !probe.turn_back(|_| sent, |_| brake) {
            return (way, None);
        }
        while probe.next(&mut disp, &mut vel) {
            probe.take(&disp, &[force(disp[0] - 0.5)]);
            way.push(disp[0]);
        }
        (way, Some(probe.way_back()))
    }

    /// From each of its commands a probe comes back to the start, to the last bit, within the range that it passed, no faster than it
    /// went, and without a change of velocity beyond its brake.
    #[test]
    fn a_probe_turns_back_from_each_command() {
        let fastest = std::f64::consts::FRAC_PI_2 * AMPLITUDE / f64::from(PACE.ramp);
        // The bell itself needs π²/2 · A/ramp².
        let bell = 0.5 * std::f64::consts::PI.powi(2) * AMPLITUDE / f64::from(PACE.ramp).powi(2);
        for brake in [f64::INFINITY, 1.5 * bell] {
            for after in 0..(2 * PACE.ramp + 3 * PACE.hold) as usize {
                let (way, ended) = turned_back(after, brake, |d| STIFFNESS * d);
                let (passed, back) = way.split_at(after + 1);
                let is_displaced = passed.last() != Some(&0.5);
                assert!(
                    ended == Some(WayBack::Complete) || !is_displaced,
                    "{after}: {ended:?}"
                );
                assert_eq!(way.last().unwrap().to_bits(), 0.5f64.to_bits(), "{after}");
                let most = passed.iter().fold(0.5, |m: f64, d| m.max(*d));
                let slack = if brake.is_finite() {
                    fastest * fastest / brake
                } else {
                    0.0
                };
                for disp in back {
                    assert!((0.5..=most + slack).contains(disp), "{after}: {disp}");
                    assert!(*disp <= 0.5 + AMPLITUDE);
                }
                for pair in way.windows(2) {
                    assert!(
                        (pair[1] - pair[0]).abs() <= fastest * (1.0 + 1e-9),
                        "{after}"
                    );
                }
                if brake.is_finite() {
                    for three in way.windows(3) {
                        let bend = three[2] - 2.0 * three[1] + three[0];
                        assert!(bend.abs() <= brake * (1.0 + 1e-6), "{after}: {bend}");
                    }
                }
            }
        }
    }

    /// A specimen that has yielded pulls back before it is at its start: it rests there.
    #[test]
    fn a_force_that_was_not_passed_ends_it() {
        let mut plastic = 0.0;
        let yields = move |disp: f64| {
            let limit = 0.5 * STIFFNESS * AMPLITUDE;
            let force = STIFFNESS * (disp - plastic);
            plastic += (force.abs() - limit).max(0.0) / STIFFNESS * force.signum();
            STIFFNESS * (disp - plastic)
        };
        let top = (PACE.hold + PACE.ramp + 5) as usize;
        let (way, ended) = turned_back(top, f64::INFINITY, yields);
        assert_eq!(ended, Some(WayBack::Force(0)));
        let last = way.last().unwrap() - 0.5;
        // Its force is zero at half of the amplitude.
        assert!((0.45..0.5).contains(&(last / AMPLITUDE)), "{last}");
    }
}
