//! The limits of a specimen: every command is judged before it leaves, and every fresh measurement.
//!
//! The guard keeps the declared limits, the watch over past values, and the units of the axes. Invariant: what is judged is SI at
//! the specimen's own scale. Limits: it decides nothing; it says what trips.

use super::axis::Axis;
use super::axis_motion::AxisMotion;
use super::brake::Brake;
use super::limits::{AxisLimits, Estimated, Found, Hit, RECORDED, Watch};
use super::startup::{SAME, Startup};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::{AtAxis, AtSpecimen, AtStructure};
use gusset_quantity::state;
use gusset_quantity::substructure::Measurement;
use std::f64::consts::{FRAC_PI_2, PI};

/// Share of an acceleration limit that a ramp or a return move uses at most.
const SHARE_OF_ACCEL: f64 = 0.5;
/// Share of a limit of acceleration that stops an axis.
const BRAKE_SHARE: f64 = 0.9;

/// The limits of a port.
#[derive(Debug, Clone)]
pub struct Guard {
    watch: Watch,
    /// Declared limits; a rehearsal trips at none of them.
    declared: Vec<AxisLimits>,
    /// Axis and place in [`RECORDED`] of each judged value that has a column.
    recorded: Vec<(usize, usize)>,
    /// Metres and newtons in one unit of each axis.
    units: Vec<(f64, f64)>,
    /// Steps of all axes from which a brake begins, in the specimen's units.
    last_steps: AtAxis<Box<[f64]>>,
    /// Wall time in s from command to command of a specimen of whole steps: beside the test, and in it.
    ticks: Option<[f64; 2]>,
    /// The watch of an interrupted test over a specimen of whole steps: its commands were, and will be, a step apart.
    interrupted: Option<Watch>,
    /// A load cell tripped at the end of its range: no return move goes by its force.
    force_is_unknown: bool,
}

// Only a resumption keeps a second watch, and only the shutdown mistrusts a force.
state! {
    Guard { watch }
    keeps { declared, recorded, units, last_steps, ticks, interrupted, force_is_unknown }
}

impl Guard {
    /// With these limits, metres and newtons in one unit of each axis, and ticks of `tick` s of wall time.
    #[must_use]
    pub fn new(limits: Vec<AxisLimits>, units: Vec<(f64, f64)>, tick: f64) -> Self {
        Self {
            recorded: recorded(&limits),
            declared: limits.clone(),
            watch: Watch::new(limits, tick),
            last_steps: AtAxis(vec![0.0; units.len()].into()),
            units,
            ticks: None,
            interrupted: None,
            force_is_unknown: false,
        }
    }

    /// From here on nothing trips but what is no number.
    pub fn open_all(&mut self) {
        self.watch = Watch::new(vec![AxisLimits::NONE; self.units.len()], 1.0);
    }

    /// Wall time in s of the next motion. Real-time: yes.
    pub fn set_motion_time(&mut self, seconds: f64) {
        self.watch.tick_is(seconds);
    }

    /// In the running test commands are `step` s apart, otherwise `tick` s.
    pub(super) const fn set_ticks(&mut self, tick: f64, step: f64) {
        self.ticks = Some([tick, step]);
    }

    /// Wall time in s from command to command of the test, in ticks of `tick` s.
    pub(super) fn command_time(&self, tick: f64) -> f64 {
        self.ticks.map_or(tick, |[_, step]| step)
    }

    /// Commands are a step apart from here on, or a tick again, for a specimen of whole steps.
    pub(crate) fn is_told_by_steps(&mut self, by_steps: bool) {
        if let Some([tick, step]) = self.ticks {
            self.watch.tick_is(if by_steps { step } else { tick });
        }
    }

    /// The limits of `fresh`, a guard of the same specimen: what was seen so far stays.
    pub(super) fn take_limits(&mut self, fresh: &Self) {
        self.watch.take_limits(&fresh.watch);
        self.declared.clone_from(&fresh.declared);
    }

    pub(super) const fn watch_mut(&mut self) -> &mut Watch {
        &mut self.watch
    }

    /// The guard's record of past commands.
    #[must_use]
    pub const fn watch(&self) -> &Watch {
        &self.watch
    }

    /// Another guard of the same specimen, which has seen nothing.
    #[must_use]
    pub fn forgetful(&self, tick: f64) -> Self {
        Self::new(self.declared.clone(), self.units.clone(), tick)
    }

    /// The limits, one entry per axis.
    #[must_use]
    pub fn declared(&self) -> &[AxisLimits] {
        &self.declared
    }

    /// Metres and newtons in one unit of each axis.
    #[must_use]
    pub fn units(&self) -> &[(f64, f64)] {
        &self.units
    }

    /// Metres in one unit of an axis.
    #[must_use]
    pub fn metres_of(&self, axis: usize) -> f64 {
        self.units.get(axis).map_or(f64::NAN, |unit| unit.0)
    }

    /// Newtons in one unit of force of an axis.
    #[must_use]
    pub fn newtons_of(&self, axis: usize) -> f64 {
        self.units.get(axis).map_or(f64::NAN, |unit| unit.1)
    }

    /// Axis (from 0) and limit of each judged value that has a column.
    pub(crate) fn recorded_limits(&self) -> impl Iterator<Item = (usize, Limit)> + '_ {
        let recorded = self.recorded.iter();
        recorded.filter_map(|(axis, place)| Some((*axis, *RECORDED.get(*place)?)))
    }

    /// The values of [`Guard::recorded_limits`] that were judged in this tick; NaN where nothing was judged. Real-time: yes.
    #[inline]
    pub(crate) fn judged(&self) -> impl Iterator<Item = f64> + '_ {
        self.recorded.iter().map(|(axis, place)| {
            let judged = self.watch.judged(*axis);
            judged
                .and_then(|judged| judged.get(*place))
                .copied()
                .unwrap_or(f64::NAN)
        })
    }

    /// A tick begins: nothing was judged in it. Real-time: yes.
    #[inline]
    pub(crate) fn begin_tick(&mut self) {
        self.watch.begin_tick();
    }

    /// Judges a command. Real-time: yes.
    #[inline]
    pub(super) fn judge_command(&mut self, command: &AtAxis<AxisMotion>) -> Found {
        let mut found = Found::default();
        self.watch.judge_command(
            Self::metres(&self.units, command.part(AxisMotion::disp)),
            &mut found,
        );
        for (axis, vel) in command.vel.iter().enumerate() {
            if !vel.is_finite() {
                let hit = Hit::trip(axis, Limit::CommandVel, f64::NAN, f64::MAX);
                found.trip.get_or_insert(hit);
            }
        }
        found
    }

    /// Judges a fresh measurement of axes that were sent to `sent`. Real-time: yes.
    #[inline]
    pub(super) fn judge_measured(
        &mut self,
        raw: &Measurement,
        axes: &[Axis],
        sent: AtAxis<&[f64]>,
        startup: &Startup,
    ) -> Found {
        let values = raw.disp.iter().zip(&raw.force).zip(self.units.iter());
        let axes = axes.iter().zip(*sent).enumerate();
        let values = values.zip(axes).map(
            |(((disp, force), (metres, newtons)), (index, (axis, sent)))| {
                // Before the zero is taken the sensor's offset is no following error.
                let stands = if startup.awaits_zero(index) {
                    *sent
                } else {
                    disp - axis.measured_offset
                };
                AtSpecimen((disp * metres, force * newtons, stands * metres))
            },
        );
        let mut found = Found::default();
        self.watch.judge_measured(values, &mut found);
        found
    }

    /// Judges estimates of each axis, and adds to `found`. Real-time: yes.
    #[inline]
    pub(super) fn judge_estimates(
        &mut self,
        values: impl Iterator<Item = Estimated>,
        found: &mut Found,
    ) {
        self.watch.estimated(values, found);
    }

    /// Judges delay and gain of each axis, and adds to `found`. Real-time: yes.
    #[inline]
    pub(super) fn judge_tracking(
        &mut self,
        values: impl Iterator<Item = [f64; 2]>,
        found: &mut Found,
    ) {
        self.watch.tracked(values, found);
    }

    /// The next of the trips and warnings that were found beside the first. Real-time: yes.
    pub(crate) fn next_untold(&mut self) -> Option<Hit> {
        self.watch.next_untold()
    }

    /// A command leaves. Real-time: yes.
    #[inline]
    pub(super) fn sent(&mut self, disp: AtAxis<&[f64]>) {
        self.watch.sent(Self::metres(&self.units, disp));
    }

    /// The last command, `disp`, leaves once more: where none has left, it is where the specimen stands. Real-time: yes.
    pub(super) fn sent_again(&mut self, disp: AtAxis<&[f64]>) {
        if self.watch.was_told() {
            self.watch.sent_again();
        } else {
            self.stands_at(disp);
        }
    }

    /// The position before the first command is `disp`.
    pub(super) fn stands_at(&mut self, disp: AtAxis<&[f64]>) {
        self.watch.stands_at(Self::metres(&self.units, disp));
    }

    /// The specimen is found at `disp`: the next command is a step from there.
    pub fn is_found_at(&mut self, disp: AtAxis<&[f64]>) {
        self.watch.is_found_at(Self::metres(&self.units, disp));
    }

    /// True if `disp` is the last command once more. Real-time: yes.
    pub(super) fn is_at(&self, disp: AtAxis<&[f64]>) -> bool {
        self.watch.is_at(Self::metres(&self.units, disp))
    }

    /// The specimen came to where it stands with these velocities, for `seconds`. Real-time: yes.
    pub(super) fn came_with(&mut self, vel: AtAxis<&[f64]>, seconds: f64) {
        let steps = Self::metres(&self.units, vel).map(|vel| AtSpecimen(vel.0 * seconds));
        self.watch.came_by(steps);
    }

    /// Steps begin at `goal`.
    pub(super) fn aims_from(&mut self, axes: &[Axis], goal: AtStructure<&[f64]>) {
        self.watch.aims_from(Self::goals(&self.units, axes, goal));
    }

    /// The next step goes to `goal`. Real-time: yes.
    #[inline]
    pub(super) fn aims_at(&mut self, axes: &[Axis], goal: AtStructure<&[f64]>) {
        self.watch.aims_at(Self::goals(&self.units, axes, goal));
    }

    /// The last command counts as one at rest.
    pub(super) fn rests(&mut self) {
        self.watch.rests();
    }

    /// The next measurement is compared with none before it.
    pub(super) fn forget_measurements(&mut self) {
        self.watch.forget_measurements();
    }

    /// Commands from here on are not part of the test, until [`Guard::go_on`]. `told_again`: the last command of the test is to
    /// leave once more.
    pub(super) fn interrupt(&mut self, told_again: bool) {
        let mut watch = self.watch.clone();
        if told_again {
            watch.takes_back_the_last();
        }
        self.interrupted = Some(watch);
    }

    /// The interrupted test is resumed.
    pub(super) fn go_on(&mut self) {
        if let Some(before) = self.interrupted.take() {
            self.watch.goes_on_from(&before);
        }
    }

    /// The specimen is moved back from what it tripped at.
    pub(super) fn excuse(&mut self, startup: &Startup) {
        let noise = self.units.iter().enumerate();
        let noise =
            noise.map(|(axis, (metres, _))| AtSpecimen(startup.reading(axis).disp_noise * metres));
        self.watch.excuse(noise);
        self.watch.brakes(false);
        self.force_is_unknown |= self.watch.has_tripped(Limit::SensorForce);
    }

    /// A specimen that has tripped comes to rest: nothing but a value that is no number stops it.
    pub(super) const fn lets_brake(&mut self) {
        self.watch.brakes(true);
    }

    /// True if a load cell tripped at the end of its range.
    pub(super) const fn force_is_unknown(&self) -> bool {
        self.force_is_unknown
    }

    /// Another partner answers from here on.
    pub(super) const fn trust_force(&mut self) {
        self.force_is_unknown = false;
    }

    /// The force of an axis before it first jumped beyond its trip level, and that level, in N; none if it has not.
    pub(super) fn jump(&self, axis: usize) -> Option<AtSpecimen<[f64; 2]>> {
        self.watch.jump(axis)
    }

    /// Acceleration in m/s² that a ramp or a return move may use on an axis.
    pub(super) fn way_accel(&self, axis: usize) -> f64 {
        let limit = self.declared.get(axis);
        limit.map_or(f64::INFINITY, |limits| {
            SHARE_OF_ACCEL * limits.size(Limit::CommandAccel).lower()
        })
    }

    /// Acceleration in m/s² that an axis may be stopped with.
    pub(super) fn brake_accel(&self, axis: usize) -> f64 {
        BRAKE_SHARE / SHARE_OF_ACCEL * self.way_accel(axis)
    }

    /// The brake of a specimen from its last command, in ticks of `tick` s; none if it rests within a tick.
    pub(super) fn brake(&mut self, tick: f64) -> Option<Brake> {
        let mut ticks: f64 = 0.0;
        for axis in 0..self.units.len() {
            let metres = self.metres_of(axis);
            let step = self.watch.last_step(axis).0 / metres;
            let most = self.brake_accel(axis) * tick * tick / metres;
            ticks = ticks.max((step.abs() / most).ceil());
            self.last_steps[axis] = step;
        }
        let ticks = ticks as u64;
        (ticks > 1).then(|| Brake::new(ticks, tick))
    }

    /// The steps of all axes from which a brake begins, in the specimen's units.
    pub(super) fn last_steps(&self) -> AtAxis<&[f64]> {
        self.last_steps.part(|steps| &**steps)
    }

    /// Time in s of a way of `distance` m along half a cosine, at most at `speed` in m/s and with the acceleration that an axis
    /// may use.
    pub(super) fn cosine_time(
        &self,
        axis: usize,
        AtSpecimen(distance): AtSpecimen<f64>,
        speed: f64,
    ) -> f64 {
        // Half a cosine is π/2 times as fast in the middle as on the average, and π²/2 D/T² are its ends.
        let by_speed = FRAC_PI_2 * distance / speed;
        by_speed.max(PI * (0.5 * distance / self.way_accel(axis)).sqrt())
    }

    /// Shortest time in s of wall time of a way from one command to another, in ticks of `tick` s: `shortest`, or longer where it would
    /// be faster than `share` of a limit of speed or of the change in one tick; at least `unbounded` where no such limit is given; 0 if
    /// both are the same. `steepest`: see [`super::loading_unit::LoadingUnit::steepest`], in the unit of the axis.
    pub(super) fn way_time(
        &self,
        [from, to]: [AtAxis<&[f64]>; 2],
        steepest: impl Fn(usize) -> AtAxis<f64>,
        [share, tick]: [f64; 2],
        [shortest, unbounded]: [f64; 2],
    ) -> f64 {
        let mut time: f64 = 0.0;
        let axes = from.iter().zip(*to).zip(&self.declared);
        for (axis, ((from, to), limits)) in axes.enumerate() {
            // Along poses it may be faster than along the chord, or go there and back.
            let distance = (to - from).abs().max(steepest(axis).0);
            // Roundoff of the static load is no distance.
            if distance > SAME * from.abs().max(to.abs()) {
                let distance = distance * self.metres_of(axis);
                // Both bound the same.
                let speed = share
                    * limits
                        .size(Limit::CommandVel)
                        .lower()
                        .min(limits.size(Limit::CommandStep).lower() / tick);
                let shortest = if speed < f64::INFINITY {
                    shortest
                } else {
                    shortest.max(unbounded)
                };
                let least = self.cosine_time(axis, AtSpecimen(distance), speed);
                time = time.max(shortest).max(least);
            }
        }
        time
    }

    #[inline]
    fn metres<'a>(
        units: &'a [(f64, f64)],
        disp: AtAxis<&'a [f64]>,
    ) -> impl Iterator<Item = AtSpecimen<f64>> + 'a {
        let axes = disp.0.iter().zip(units);
        axes.map(|(disp, unit)| AtSpecimen(disp * unit.0))
    }

    /// The structure's deformations as the specimen's axes go, in m.
    #[inline]
    fn goals<'a>(
        units: &'a [(f64, f64)],
        axes: &'a [Axis],
        goal: AtStructure<&'a [f64]>,
    ) -> impl Iterator<Item = AtSpecimen<f64>> + 'a {
        let gears = axes.iter().zip(units);
        gears
            .zip(goal.0)
            .map(|((axis, unit), goal)| AtSpecimen(axis.disp_gain * unit.0 * goal))
    }
}

/// The judged values that have a column.
fn recorded(limits: &[AxisLimits]) -> Vec<(usize, usize)> {
    let of_axis = |(axis, limits): (usize, &AxisLimits)| {
        let places = RECORDED.map(|limit| limits.get(limit).is_some());
        let places = places.into_iter().enumerate();
        places.filter_map(move |(place, limited)| limited.then_some((axis, place)))
    };
    limits.iter().enumerate().flat_map(of_axis).collect()
}
