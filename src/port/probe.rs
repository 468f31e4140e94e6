//! Which way round is it wired? A small smooth motion away from where a specimen stands and back, axis after axis, and
//! the judgement on what was measured meanwhile.
//!
//! Each axis holds, goes by its amplitude in the positive direction along half a period of a cosine, holds, comes back
//! the same way and holds: the last command is the first one to the last bit. Readings of the second half of each hold
//! are averaged; their scatter says what is noise. Quasi-static: a specimen without stiffness (a damper, an open gap) has
//! no direction that this could show.

use super::wiring_fault::{Channel, WiringFault};
use crate::units::AxisUnits;

/// A difference of two averages below so many of its own standard deviations may be noise.
pub(super) const SIGMAS: f64 = 5.0;
/// A displacement that follows by less than this part of the amplitude does not follow.
const FOLLOWS: f64 = 0.25;
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
    pub fn variance(&self) -> f64 {
        self.squares / (self.count - 1.0).max(1.0)
    }

    pub fn add(&mut self, value: f64) {
        self.count += 1.0;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count;
        self.squares += from_mean * (value - self.mean);
    }
}

/// Displacement and force at the bottom, at the top, and at the bottom again.
#[derive(Debug, Clone, Copy)]
struct AxisProbe {
    amplitude: f64,
    stiffness: f64,
    units: AxisUnits,
    disp: [Average; 3],
    force: [Average; 3],
}

/// A probe of one specimen. Real-time: yes, after its making.
#[derive(Debug, Clone)]
pub struct Probe {
    start: Vec<f64>,
    axes: Vec<AxisProbe>,
    pace: Pace,
    axis: usize,
    /// Exchanges of this axis that were begun.
    exchanges: u32,
    /// What is missing to the end of the last of them, 0 … 1: more than 0 only after one that went slower.
    missing: f64,
}

impl Probe {
    /// A probe from `start`, by `amplitude` along each axis (0: this axis is left alone), of a specimen whose diagonal
    /// stiffness is believed to be `stiffness`; all in `units`.
    #[must_use]
    pub fn new(
        start: &[f64],
        amplitude: &[f64],
        stiffness: &[f64],
        units: &[AxisUnits],
        pace: Pace,
    ) -> Self {
        let axes = amplitude.iter().zip(stiffness).zip(units);
        let axes = axes.map(|((amplitude, stiffness), units)| AxisProbe {
            amplitude: *amplitude,
            stiffness: *stiffness,
            units: *units,
            disp: Default::default(),
            force: Default::default(),
        });
        Self {
            start: start.to_vec(),
            axes: axes.collect(),
            pace,
            axis: 0,
            exchanges: 0,
            missing: 0.0,
        }
    }

    /// From one exchange to the next, in ns.
    #[must_use]
    pub const fn period_ns(&self) -> u64 {
        self.pace.period_ns
    }

    /// The next command, one entry per axis; false if there is none. Real-time: yes.
    pub fn next(&mut self, disp: &mut [f64], vel: &mut [f64]) -> bool {
        self.go_on(1.0, disp, vel)
    }

    /// The same by `share` (more than 0, at most 1) of an exchange: a probe that is being held, or goes on after that.
    /// Real-time: yes.
    pub fn go_on(&mut self, share: f64, disp: &mut [f64], vel: &mut [f64]) -> bool {
        if self.gone() >= f64::from(self.pace.whole()) {
            (self.exchanges, self.missing) = (0, 0.0);
            self.axis += 1;
        }
        while self.axes.get(self.axis).is_some_and(|a| a.amplitude == 0.0) {
            self.axis += 1;
        }
        let Some(amplitude) = self.axes.get(self.axis).map(|axis| axis.amplitude) else {
            return false;
        };
        self.missing -= share;
        if self.missing < 0.0 {
            self.missing += 1.0;
            self.exchanges += 1;
        }
        if self.exchanges > self.pace.whole() {
            (self.exchanges, self.missing) = (self.pace.whole(), 0.0);
        }
        let (part, slope) = self.shape(self.gone());
        for (to, start) in disp.iter_mut().zip(&self.start) {
            *to = *start;
        }
        vel.fill(0.0);
        if let (Some(disp), Some(vel)) = (disp.get_mut(self.axis), vel.get_mut(self.axis)) {
            *disp += amplitude * part;
            *vel = amplitude * slope * share;
        }
        true
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
    pub fn give_again(&mut self) {
        self.exchanges -= u32::from(self.counts_for().is_some());
    }

    /// What the last command gave. Real-time: yes.
    pub fn take(&mut self, disp: &[f64], force: &[f64]) {
        let Some(part) = self.counts_for() else {
            return;
        };
        let Some(axis) = self.axes.get_mut(self.axis) else {
            return;
        };
        if let (Some(to), Some(value)) = (axis.disp.get_mut(part), disp.get(self.axis)) {
            to.add(*value);
        }
        if let (Some(to), Some(value)) = (axis.force.get_mut(part), force.get(self.axis)) {
            to.add(*value);
        }
    }

    /// The judgement, when there is no next command: what was found on each axis.
    ///
    /// # Errors
    /// The first axis that must not be armed.
    pub fn verdict(&self) -> Result<Vec<Found>, WiringFault> {
        let probed = self.axes.iter().enumerate();
        let probed = probed.filter(|(_, axis)| axis.amplitude != 0.0);
        probed.map(|(index, axis)| axis.verdict(index)).collect()
    }
}

/// Change from the bottom to the top, and what of it may be noise.
fn change([bottom, top, again]: &[Average; 3]) -> (f64, f64) {
    let change = top.mean - 0.5 * (bottom.mean + again.mean);
    let count = bottom.count + top.count + again.count;
    let squares = bottom.squares + top.squares + again.squares;
    let variance = squares / (count - 3.0).max(1.0);
    let spread = 1.0 / top.count + 0.25 / bottom.count + 0.25 / again.count;
    (change, SIGMAS * (variance * spread).sqrt())
}

impl AxisProbe {
    fn verdict(&self, axis: usize) -> Result<Found, WiringFault> {
        let (disp, disp_noise) = change(&self.disp);
        let (force, force_noise) = change(&self.force);
        let force_expected = self.stiffness * self.amplitude;
        for (channel, found, noise, expected, part, unit) in [
            (
                Channel::Disp,
                disp,
                disp_noise,
                self.amplitude,
                FOLLOWS,
                self.units.disp,
            ),
            (
                Channel::Force,
                force,
                force_noise,
                force_expected,
                ANSWERS,
                self.units.force,
            ),
        ] {
            // Written so that what is no number fails.
            let is_told_from_noise = found.abs() > noise;
            let is_large_enough = found.abs() >= part * expected.abs();
            if is_told_from_noise && is_large_enough {
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
        let follows = disp * self.amplitude > 0.0;
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
            units: (self.units.disp, self.units.force),
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
            &[STIFFNESS, STIFFNESS],
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
        probe.verdict()
    }

    #[test]
    fn the_motion_is_smooth_one_axis_at_a_time_and_its_velocity_is_its_derivative() {
        let mut probe = Probe::new(
            &[0.0, 1.0],
            &[0.0, 2.0],
            &[1.0, 1.0],
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
    fn a_spring_that_is_wired_rightly_passes_with_its_stiffness() {
        let found = probed(|d| (d, STIFFNESS * d)).unwrap();
        assert_eq!(found.len(), 2);
        for axis in found {
            assert!((axis.disp - AMPLITUDE).abs() < 1e-15);
            assert!((axis.force / axis.disp - STIFFNESS).abs() < 1e-3);
        }
    }

    #[test]
    fn each_reversed_channel_is_told_from_the_others() {
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
    fn a_dead_channel_is_named_with_what_was_expected() {
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
        let nan = probed(|d| (d, f64::NAN)).unwrap_err();
        assert_eq!(nan.name(), "force_dead");
    }

    /// Noise of a standard deviation of 6 % of the force: half of 40 readings at the top and twice at the bottom give a
    /// standard deviation of the change of 0.06 · √(1/20 + 0.5/20) = 0.016, five of which are 8 %: seen in every seed. With
    /// five times that noise the sign is still sure (five deviations are 41 %); with eight times the force it is not.
    #[test]
    fn noise_hides_a_direction_only_when_it_is_larger_than_the_signal() {
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
}
