//! The limits of a port: no command leaves that was not judged, and every fresh measurement is.

use super::limits::{AxisLimits, Found, Hit, Level, RECORDED, Watch};
use super::posed::Posed;
use super::{Axis, Port};
use crate::catalog::limit::Limit;
use crate::substructure::Substructure;

/// What a port knows about its limits.
#[derive(Debug)]
pub(super) struct Guard {
    pub watch: Watch,
    /// As they are declared; a rehearsal trips at none of them.
    declared: Vec<AxisLimits>,
    /// Axis and place in [`RECORDED`] of each judged value that has a column.
    recorded: Vec<(usize, usize)>,
    /// Metres and newtons in one unit of each axis.
    units: Vec<(f64, f64)>,
    /// Wall time in s from command to command of a specimen that is told once a step, beside the test and in it.
    ticks: Option<[f64; 2]>,
    /// The watch of an interrupted test over a specimen that is told once a step: its commands were, and will be, of whole steps.
    interrupted: Option<Watch>,
    /// True if the command that stands ready may leave.
    pub cleared: bool,
}

impl Guard {
    /// For `axes` axes in SI units, without a limit.
    pub fn open(axes: usize) -> Self {
        Self {
            watch: Watch::new(vec![AxisLimits::NONE; axes], 1.0),
            declared: vec![AxisLimits::NONE; axes],
            recorded: Vec::new(),
            units: vec![(1.0, 1.0); axes],
            ticks: None,
            interrupted: None,
            cleared: false,
        }
    }

    /// What is commanded from here on is none of the test, until [`Guard::go_on`]. Where the last command of the test is to leave
    /// once more, it is `told_again`.
    pub fn interrupt(&mut self, told_again: bool) {
        let mut watch = self.watch.clone();
        if told_again {
            watch.takes_back_the_last();
        }
        self.interrupted = Some(watch);
    }

    /// The interrupted test goes on.
    pub fn go_on(&mut self) {
        if let Some(before) = self.interrupted.take() {
            self.watch.goes_on_from(&before);
        }
    }

    #[inline]
    fn metres<'a>(units: &'a [(f64, f64)], disp: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        disp.iter().zip(units).map(|(disp, unit)| disp * unit.0)
    }

    /// The structure's deformations as the specimen's axes go, in m.
    #[inline]
    fn goals<'a>(
        units: &'a [(f64, f64)],
        axes: &'a [Axis],
        goal: &'a [f64],
    ) -> impl Iterator<Item = f64> + 'a {
        let gears = axes.iter().zip(units);
        gears
            .zip(goal)
            .map(|((axis, unit), goal)| axis.disp_gain * unit.0 * goal)
    }

    /// Steps begin at `goal`.
    pub fn aims_from(&mut self, axes: &[Axis], goal: &[f64]) {
        self.watch.aims_from(Self::goals(&self.units, axes, goal));
    }

    /// The next step goes to `goal`. Real-time: yes.
    #[inline]
    pub fn aims_at(&mut self, axes: &[Axis], goal: &[f64]) {
        self.watch.aims_at(Self::goals(&self.units, axes, goal));
    }

    /// Metres and newtons in one unit of each axis.
    pub fn units(&self) -> &[(f64, f64)] {
        &self.units
    }

    /// Metres in one unit of an axis.
    pub fn metres_of(&self, axis: usize) -> f64 {
        self.units.get(axis).map_or(1.0, |unit| unit.0)
    }

    /// The specimen stands at `disp` before the first command.
    pub fn stands_at(&mut self, disp: &[f64]) {
        self.watch.stands_at(Self::metres(&self.units, disp));
    }

    /// Takes note that the last command, `disp`, leaves once more: where none has left, it is where the specimen stands. Real-time:
    /// yes.
    pub fn sent_again(&mut self, disp: &[f64]) {
        if self.watch.was_told() {
            self.watch.sent_again();
        } else {
            self.stands_at(disp);
        }
    }

    /// Takes note of a command that leaves. Real-time: yes.
    #[inline]
    pub fn sent(&mut self, disp: &[f64]) {
        self.cleared = false;
        self.watch.sent(Self::metres(&self.units, disp));
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

impl Port {
    /// Sets the limits, one entry per axis, SI at the specimen's own scale; `units` are the metres and newtons in one
    /// unit of each axis, `tick` the wall time of one tick in s.
    #[must_use]
    pub fn with_limits(
        mut self,
        limits: Vec<AxisLimits>,
        units: Vec<(f64, f64)>,
        tick: f64,
    ) -> Self {
        if limits.len() == self.axes.len() && units.len() == self.axes.len() {
            self.guard = Guard {
                recorded: recorded(&limits),
                declared: limits.clone(),
                watch: Watch::new(limits, tick),
                units,
                ticks: None,
                interrupted: None,
                cleared: false,
            };
        }
        self
    }

    /// While the test runs it is told something every `step` s only, and judged by that; beside it every `tick` s.
    #[must_use]
    pub const fn told_every(mut self, tick: f64, step: f64) -> Self {
        self.guard.ticks = Some([tick, step]);
        self
    }

    /// From here on it is told once a step, or every tick again, if it is one of those.
    pub fn is_told_by_steps(&mut self, by_steps: bool) {
        if let Some([tick, step]) = self.guard.ticks {
            self.guard.watch.tick_is(if by_steps { step } else { tick });
        }
    }

    /// The limits, one entry per axis.
    #[must_use]
    pub fn limits(&self) -> &[AxisLimits] {
        &self.guard.declared
    }

    /// A tick begins: nothing was judged in it. Real-time: yes.
    #[inline]
    pub fn begin_tick(&mut self) {
        self.guard.watch.begin_tick();
    }

    /// Axis (from 0) and limit of each judged value that has a column: the limit has a level, and no other column has the value.
    pub fn recorded_limits(&self) -> impl Iterator<Item = (usize, Limit)> + '_ {
        let recorded = self.guard.recorded.iter();
        recorded.filter_map(|(axis, place)| Some((*axis, *RECORDED.get(*place)?)))
    }

    /// The values of [`Port::recorded_limits`] that were judged in this tick, SI at the specimen; NaN where nothing was judged.
    /// Real-time: yes.
    #[inline]
    pub fn judged(&self) -> impl Iterator<Item = f64> + '_ {
        let Guard {
            watch, recorded, ..
        } = &self.guard;
        recorded.iter().map(|(axis, place)| {
            let judged = watch.judged(*axis);
            judged
                .and_then(|judged| judged.get(*place))
                .copied()
                .unwrap_or(f64::NAN)
        })
    }

    /// Metres and newtons in one unit of each axis.
    #[must_use]
    pub fn units(&self) -> &[(f64, f64)] {
        &self.guard.units
    }

    /// The same port for a rehearsal: `wrap` puts something round its substructure, and is told the metres and newtons in
    /// one unit of each axis. Limits are known but trip no more, except at what is no number.
    #[must_use]
    pub fn rehearsed(
        mut self,
        wrap: impl FnOnce(Box<dyn Substructure>, &[(f64, f64)]) -> Box<dyn Substructure>,
    ) -> Self {
        self.guard.watch = Watch::new(vec![AxisLimits::NONE; self.axes.len()], 1.0);
        self.substructure = wrap(self.substructure, &self.guard.units);
        self
    }

    /// The same port with something round its substructure that only looks: as [`Port::rehearsed`], limits and all.
    #[must_use]
    pub fn watched(
        mut self,
        wrap: impl FnOnce(Box<dyn Substructure>, &[(f64, f64)]) -> Box<dyn Substructure>,
    ) -> Self {
        self.substructure = wrap(self.substructure, &self.guard.units);
        self
    }

    /// True if a command has left.
    #[must_use]
    pub const fn has_begun(&self) -> bool {
        self.link.sent > 0
    }

    /// Judges the command that stands ready. Only if nothing trips may it leave. Real-time: yes.
    #[inline]
    pub fn clear(&mut self) -> Found {
        let Guard {
            watch,
            units,
            cleared,
            ..
        } = &mut self.guard;
        let mut found = Found::default();
        watch.judge_command(Guard::metres(units, &self.command), &mut found);
        for (axis, vel) in self.command_vel.iter().enumerate() {
            if !vel.is_finite() {
                found.trip.get_or_insert(Hit {
                    axis,
                    quantity: Limit::CommandVel,
                    level: Level::Trip,
                    value: f64::NAN,
                    bound: f64::MAX,
                });
            }
        }
        // No stroke belongs to a pose that cannot be.
        let is_posed = self.posed.as_deref().is_none_or(Posed::is_possible);
        *cleared = found.trip.is_none() && is_posed;
        found
    }

    /// The specimen is moved back from what it tripped at.
    pub fn excuse(&mut self) {
        let Guard { watch, units, .. } = &mut self.guard;
        let opening = &self.opening;
        let noise = units.iter().enumerate();
        watch.excuse(noise.map(|(axis, (metres, _))| opening.reading(axis).disp_noise * metres));
        self.partner.unfelt |= self.guard.watch.has_tripped(Limit::SensorForce);
    }

    /// The next of the trips and warnings that were found beside the first. Real-time: yes.
    pub fn next_untold(&mut self) -> Option<Hit> {
        self.guard.watch.next_untold()
    }

    /// Judges the measurement last taken, which must be a fresh one. Real-time: yes.
    #[inline]
    pub fn judge(&mut self) -> Found {
        let Guard { watch, units, .. } = &mut self.guard;
        let opening = &self.opening;
        let values = self.raw.disp.iter().zip(&self.raw.force).zip(units.iter());
        let axes = self.axes.iter().zip(&self.sent).enumerate();
        let values = values.zip(axes).map(
            |(((disp, force), (metres, newtons)), (index, (axis, sent)))| {
                // What the sensor reads beyond the command before its zero is taken is no error of following.
                let stands = if opening.awaits_zero(index) {
                    *sent
                } else {
                    disp - axis.measured_offset
                };
                (disp * metres, force * newtons, stands * metres)
            },
        );
        let mut found = Found::default();
        watch.judge_measured(values, &mut found);
        if !self.estimates.rests {
            self.estimate(&mut found);
        }
        if self.tracking.on && self.tracking.moves {
            self.track(&mut found);
        }
        found
    }
}
