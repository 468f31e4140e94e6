//! The limits of one specimen, tick by tick: past values, differences, and the warnings that were given already.

use super::judge::{AllInner, COMMAND, ESTIMATE, Inner, MEASUREMENT, RECORDED, TRACKING};
use super::past::{Pace, Past};
use super::sawtooth::Sawtooth;
use super::trips::GoesOn;
use super::{AxisLimits, Found, Hit};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtSpecimen;
use gusset_quantity::state;

/// One axis: its limits, the bounds within which no value is beyond a level, and its past values.
#[derive(Debug, Clone)]
struct Axis {
    limits: AxisLimits,
    inner: AllInner,
    past: Past,
}

state! { Axis { past } keeps { limits, inner } }

/// Where a sawtooth is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Targets {
    /// Each command is a target.
    AreCommands,
    /// Targets of steps are known beside the commands, which may go on a smooth path between them.
    AreTold,
}

state! { enum Targets { AreCommands, AreTold } }

/// Watches the limits of one specimen. Real-time after `new`.
#[derive(Debug, Clone)]
pub struct Watch {
    axes: Vec<Axis>,
    /// Wall time of one tick in s.
    tick: f64,
    /// The same for the last command; 0: no other than the next.
    tick_before: f64,
    /// Commands that have left, up to two: a difference needs something to differ from.
    sent: u8,
    measured: bool,
    targets: Targets,
    /// On the way out after a trip.
    leaves: bool,
    /// It comes to rest after a trip, which is the mildest end: only what is not a number ends that.
    brakes: bool,
}

// A running test does not leave.
state! {
    Watch as "watch" { tick, tick_before, sent: choice(&[0, 1, 2]), measured, targets, axes } keeps { leaves, brakes }
}

impl Watch {
    /// For axes with these limits, and ticks of `tick` seconds of wall time.
    #[must_use]
    pub fn new(limits: Vec<AxisLimits>, tick: f64) -> Self {
        let axis = |limits: AxisLimits| Axis {
            inner: AllInner::of(&limits),
            limits,
            past: Past::new(),
        };
        Self {
            axes: limits.into_iter().map(axis).collect(),
            tick,
            tick_before: 0.0,
            sent: 0,
            measured: false,
            targets: Targets::AreCommands,
            leaves: false,
            brakes: false,
        }
    }

    /// The limits of `fresh`; past values stay.
    pub(crate) fn take_limits(&mut self, fresh: &Self) {
        for (own, fresh) in self.axes.iter_mut().zip(&fresh.axes) {
            own.limits = fresh.limits;
            own.inner = fresh.inner;
        }
    }

    /// Wall time in s from the last command to the next, where it is not always the same. Real-time: yes.
    pub fn tick_is(&mut self, tick: f64) {
        self.tick = tick;
    }

    const fn pace(&self) -> Pace {
        Pace {
            tick: self.tick,
            before: self.tick_before,
        }
    }

    /// A tick begins: nothing was judged in it. Real-time: yes.
    #[inline]
    pub(crate) fn begin_tick(&mut self) {
        for Axis { past, .. } in &mut self.axes {
            past.begin_tick();
        }
    }

    /// The values of an axis that were judged in this tick, in the order of [`super::RECORDED`]: those of the command that left,
    /// and those of the measurement. NaN where nothing was judged. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn judged(&self, axis: usize) -> Option<&[f64; RECORDED.len()]> {
        self.axes.get(axis).map(|axis| &axis.past.judged)
    }

    /// The specimen is known to stand at `disp`: the first command is a step from there.
    pub fn stands_at(&mut self, disp: impl Iterator<Item = AtSpecimen<f64>>) {
        for (Axis { past, .. }, AtSpecimen(disp)) in self.axes.iter_mut().zip(disp) {
            past.command = [disp; 2];
            past.sawtooth = Sawtooth::at_rest(disp);
        }
        self.sent = 2;
        self.tick_before = 0.0;
    }

    /// A session begins: nothing was measured, warned of or tripped in it. The commands stay.
    pub(crate) fn begins_session(&mut self) {
        for Axis { past, .. } in &mut self.axes {
            *past = past.of_a_session();
        }
        (self.measured, self.leaves, self.brakes) = (false, false, false);
    }

    /// The specimen is found at `disp`, and keeps the speed of its last commands. Without a command before it is at rest.
    pub(crate) fn is_found_at(&mut self, disp: impl Iterator<Item = AtSpecimen<f64>>) {
        if self.sent == 0 {
            return self.stands_at(disp);
        }
        for (Axis { past, .. }, AtSpecimen(disp)) in self.axes.iter_mut().zip(disp) {
            let [last, before] = past.command;
            if disp != last {
                past.command = [disp, disp - (last - before)];
                past.sawtooth = Sawtooth::at_rest(disp);
            }
        }
    }

    /// True if it is known where the specimen was sent last. Real-time: yes.
    pub(crate) const fn was_told(&self) -> bool {
        self.sent > 0
    }

    /// Judges the next command, one displacement per axis, before it leaves. Real-time: yes.
    #[inline]
    pub fn command(&mut self, disp: impl Iterator<Item = AtSpecimen<f64>>) -> Found {
        let mut found = Found::default();
        self.judge_command(disp, &mut found);
        found
    }

    /// The same, added to `found`. Real-time: yes.
    #[inline]
    pub(crate) fn judge_command(
        &mut self,
        disp: impl Iterator<Item = AtSpecimen<f64>>,
        found: &mut Found,
    ) {
        let (pace, sent, brakes) = (self.pace(), self.sent, self.brakes);
        let aims = self.targets == Targets::AreTold;
        for ((index, axis), AtSpecimen(disp)) in self.axes.iter_mut().enumerate().zip(disp) {
            let Axis {
                limits,
                inner,
                past,
            } = axis;
            let values = past.of_command(disp, pace, aims, sent);
            if brakes && values.iter().all(|value| value.is_finite()) {
                continue;
            }
            if !(sent >= 2 && past.warned == 0 && inner.command.covers(&values)) {
                let mut judge = past.judge(index, limits, found);
                judge.judge_group(COMMAND, &values, sent);
            }
        }
    }

    /// Takes note of a command that leaves. Real-time: yes.
    #[inline]
    pub fn sent(&mut self, disp: impl Iterator<Item = AtSpecimen<f64>>) {
        for (Axis { limits, past, .. }, AtSpecimen(disp)) in self.axes.iter_mut().zip(disp) {
            if self.targets == Targets::AreCommands {
                past.sawtooth = past.sawtooth.after(disp);
            }
            let step = (disp - past.command[0]).abs();
            let speed = if self.sent >= 1 {
                step / self.tick
            } else {
                0.0
            };
            past.speed.take(speed, self.tick, limits.following_time);
            past.stuck_travel += step;
            past.note_sent();
            past.command = [disp, past.command[0]];
        }
        self.sent = (self.sent + 1).min(2);
        self.tick_before = self.tick;
    }

    /// A specimen that has tripped comes to rest, or rests.
    pub(crate) const fn brakes(&mut self, brakes: bool) {
        self.brakes = brakes;
    }

    /// A specimen that has tripped is on its way back: what it tripped at counts again only if it gets worse, or on the other side,
    /// and not while an actuator only goes on to where the last command has sent it. `noise` of the displacement sensors in m, one
    /// per axis, as far as it is known.
    pub(crate) fn excuse(&mut self, noise: impl Iterator<Item = AtSpecimen<f64>>) {
        for (Axis { past, .. }, AtSpecimen(noise)) in self.axes.iter_mut().zip(noise) {
            past.trips.excuse(past.stands, past.command[0], noise);
        }
        self.leaves = true;
    }

    /// On the way out, whether any axis only goes on to where it was sent before, measured here. Real-time: yes.
    fn goes_on(&mut self, stands: impl Iterator<Item = f64>) -> bool {
        let mut any = false;
        for (Axis { past, .. }, stands) in self.axes.iter_mut().zip(stands) {
            past.trips.follow(stands, self.tick);
            any |= past.trips.goes_on();
        }
        any
    }

    /// The next of the trips and warnings that [`Found::more`] stands for. Real-time: yes.
    pub(crate) fn next_untold(&mut self) -> Option<Hit> {
        let mut axes = self.axes.iter_mut().enumerate();
        axes.find_map(|(index, axis)| axis.past.trips.next_untold(index))
    }

    /// True if this has tripped on an axis.
    #[must_use]
    pub(crate) fn has_tripped(&self, limit: Limit) -> bool {
        self.axes.iter().any(|axis| axis.past.trips.has(limit))
    }

    /// The force of an axis before it first jumped beyond its trip level, and that level, in N; none if it has not.
    #[must_use]
    pub(crate) fn jump(&self, axis: usize) -> Option<AtSpecimen<[f64; 2]>> {
        self.axes.get(axis)?.past.jump.map(AtSpecimen)
    }

    /// Change in m from the last command but one to the last; 0 before the second.
    #[must_use]
    pub(crate) fn last_step(&self, axis: usize) -> AtSpecimen<f64> {
        let axis = self.axes.get(axis).filter(|_| self.sent >= 2);
        AtSpecimen(axis.map_or(0.0, |Axis { past, .. }| past.command[0] - past.command[1]))
    }

    /// Targets of steps are told from here on, and stand at `disp`: a sawtooth is looked for in them.
    pub(crate) fn aims_from(&mut self, disp: impl Iterator<Item = AtSpecimen<f64>>) {
        for (Axis { past, .. }, AtSpecimen(disp)) in self.axes.iter_mut().zip(disp) {
            past.sawtooth = Sawtooth::at_rest(disp);
        }
        self.targets = Targets::AreTold;
    }

    /// The target of the next step, which the next commands approach. Real-time: yes.
    #[inline]
    pub(crate) fn aims_at(&mut self, disp: impl Iterator<Item = AtSpecimen<f64>>) {
        for (Axis { past, .. }, AtSpecimen(disp)) in self.axes.iter_mut().zip(disp) {
            past.sawtooth = past.sawtooth.after(disp);
        }
    }

    /// Takes note that the last command leaves once more. Real-time: yes.
    pub(crate) fn sent_again(&mut self) {
        for Axis { limits, past, .. } in &mut self.axes {
            past.speed.take(0.0, self.tick, limits.following_time);
        }
        self.rests();
    }

    /// The last command counts as one at rest: the next is judged by that. Its specimen may still be on the way to it. Real-time:
    /// yes.
    pub fn rests(&mut self) {
        for Axis { past, .. } in &mut self.axes {
            past.command = [past.command[0]; 2];
            if self.targets == Targets::AreCommands {
                past.sawtooth = Sawtooth::at_rest(past.command[0]);
            }
        }
    }

    /// The test goes on where an interrupted one stood that was watched by `before`: what was commanded since then is none of it.
    pub fn goes_on_from(&mut self, before: &Self) {
        for (axis, before) in self.axes.iter_mut().zip(&before.axes) {
            axis.past.command = before.past.command;
        }
        (self.sent, self.tick_before) = (before.sent, before.tick_before);
    }

    /// True if this is the last command once more. Real-time: yes.
    pub(crate) fn is_at(&self, disp: impl Iterator<Item = AtSpecimen<f64>>) -> bool {
        let mut axes = self.axes.iter().zip(disp);
        axes.all(|(axis, AtSpecimen(disp))| axis.past.command[0] == disp)
    }

    /// What stands came here by these steps before, in a test that goes on: its speed is not one that begins at rest. Real-time:
    /// yes.
    pub(crate) fn came_by(&mut self, steps: impl Iterator<Item = AtSpecimen<f64>>) {
        for (Axis { past, .. }, AtSpecimen(step)) in self.axes.iter_mut().zip(steps) {
            past.command[1] = past.command[0] - step;
        }
        self.tick_before = 0.0;
    }

    /// The last command has not counted, and leaves once more. It was judged: here it comes as fast as the one before.
    pub(crate) fn takes_back_the_last(&mut self) {
        for Axis { past, .. } in &mut self.axes {
            let [last, before] = past.command;
            past.command = [before, 2.0 * before - last];
        }
    }

    /// The next measurement is the first: it can neither jump nor be stuck. Real-time: yes.
    pub(crate) fn forget_measurements(&mut self) {
        self.measured = false;
        for Axis { past, .. } in &mut self.axes {
            (past.stuck_ticks, past.stuck_travel) = (0, 0.0);
            past.jump = None;
        }
    }

    /// Judges a fresh measurement: (displacement, force) per axis. Real-time: yes.
    #[inline]
    pub fn measured(
        &mut self,
        values: impl Iterator<Item = AtSpecimen<(f64, f64)>> + Clone,
    ) -> Found {
        let mut found = Found::default();
        let values = values.map(|AtSpecimen((disp, force))| AtSpecimen((disp, force, disp)));
        self.judge_measured(values, &mut found);
        found
    }

    /// The same, added to `found`; the third of each axis is the displacement that is held against its command. Real-time:
    /// yes.
    #[inline]
    pub(crate) fn judge_measured(
        &mut self,
        values: impl Iterator<Item = AtSpecimen<(f64, f64, f64)>> + Clone,
        found: &mut Found,
    ) {
        let (seen_before, brakes) = (self.measured, self.brakes);
        // All of them first: what one axis feels another may have done.
        let any =
            self.leaves && self.goes_on(values.clone().map(|AtSpecimen((.., stands))| stands));
        for ((index, axis), AtSpecimen(values)) in self.axes.iter_mut().enumerate().zip(values) {
            let Axis {
                limits,
                inner,
                past,
            } = axis;
            let values = past.of_measurement(values, seen_before, limits);
            if brakes && values.iter().all(|value| value.is_finite()) {
                continue;
            }
            if !(seen_before && past.warned == 0 && inner.measurement.covers(&values)) {
                let own = past.trips.goes_on();
                let mut judge = past.judge(index, limits, found);
                judge.goes_on = GoesOn { own, any };
                judge.judge_group(MEASUREMENT, &values, u8::from(seen_before));
            }
        }
        self.measured = true;
    }

    /// Judges the estimates of each axis, in the order of [`Estimated`], and adds the findings to `found`. A value that is not
    /// finite is not known. Real-time: yes.
    #[inline]
    pub(crate) fn estimated(&mut self, values: impl Iterator<Item = Estimated>, found: &mut Found) {
        self.judge_known(ESTIMATE, |inner| &inner.estimate, values, found);
    }

    /// Judges [|lag| in s, |gain − 1|] behind the targets of each axis, and adds the findings to `found`. A value that is not
    /// finite is not known. Real-time: yes.
    pub(crate) fn tracked(&mut self, values: impl Iterator<Item = [f64; 2]>, found: &mut Found) {
        const {
            assert!(matches!(TRACKING, [Limit::Lag, Limit::GainError]));
        }
        self.judge_known(TRACKING, |inner| &inner.tracking, values, found);
    }

    /// Judges a group of values that may be unknown, one entry per axis. Real-time: yes.
    #[inline]
    fn judge_known<const N: usize>(
        &mut self,
        group: [Limit; N],
        bounds: impl Fn(&AllInner) -> &Inner<N>,
        values: impl Iterator<Item = [f64; N]>,
        found: &mut Found,
    ) {
        for ((index, axis), values) in self.axes.iter_mut().enumerate().zip(values) {
            let Axis {
                limits,
                inner,
                past,
            } = axis;
            if !(past.warned == 0 && bounds(inner).covers_known(&values)) {
                past.judge(index, limits, found)
                    .judge_group(group, &values, 0);
            }
        }
    }
}

const _: () = assert!(matches!(
    ESTIMATE,
    [
        Limit::StiffnessRatio,
        Limit::DampingRatio,
        Limit::AddedEnergy,
    ]
));

/// The estimates of one axis: tangent stiffness and tangent damping over their declared bounds, and the energy in J that the
/// transfer system has added.
pub type Estimated = [f64; ESTIMATE.len()];
