//! The compensators of a specimen: one per axis, in m, between the command that a target asks for and the one that is sent.
//!
//! Before the test runs they hold: a command passes with its gain and without lead. In the running test each gives its lead
//! on one grid of test time, N points a step, where the ticks of an undisturbed test end. Between two points the lead is
//! interpolated and scaled by the pace. So a command changes in a tick by no more than the gain times the target's change, the
//! change of the lead from point to point, and the lead over the ticks of easing. At full pace and on the grid it is the
//! compensator's own command, to the last bit. A tick without a fresh measurement is filled in when the next one comes. While the
//! pace is eased, and as long after that as is remembered, nothing is learned. Limits: a specimen that is commanded once a step
//! is compensated from target to target. The compensators themselves are in [`gusset_actuator::compensation`].

mod axis_compensator;
mod gap;

use axis_compensator::AxisCompensator;

use super::axis::Axis;
use super::axis_motion::AxisMotion;
use super::step_pacer::PacerTick;
use super::target_path::TargetPath;
use gusset_actuator::compensation::{Compensator, Parameter};
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, TestState};

/// How commands make up for the lag of the actuators.
#[derive(Debug)]
pub struct Compensation {
    /// One per axis.
    pub compensators: Vec<Box<dyn Compensator>>,
    /// Wall time from command to command, s.
    pub tick: f64,
    /// Test time that passes in one second of it.
    pub pace: f64,
    /// The compensated delay is one of test time: that of an actuator which is simulated in this process.
    pub delay_in_test_time: bool,
    /// The base moves: targets come with velocities that are no differences of theirs.
    pub base_moves: bool,
}

/// Which time a compensated delay is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DelayIn {
    /// That of an actuator: only the pace of it passes in test time.
    WallTime,
    /// That of an actuator simulated in this process.
    TestTime,
}

/// Kind of the velocity of a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum TargetVelocity {
    /// Its ∇d/Δt.
    Difference,
    /// The velocity of now: the base moves.
    Own,
}

/// Activity of the compensators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LeadActivity {
    /// Commands pass with their gain: the test does not run.
    Holding,
    /// Commands are led.
    Running,
    /// A command that was made of a target is in force, and its measurement is to come.
    Awaiting,
}

state! { enum LeadActivity { Holding, Running, Awaiting } }

/// How the next command was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LeadCourse {
    Undisturbed,
    /// Between two points of the grid, or at another pace.
    Disturbed,
}

state! { enum LeadCourse { Undisturbed, Disturbed } }

/// Kind of the velocity of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CommandVelocity {
    OfTarget,
    /// With what the lead adds.
    Led,
}

state! { enum CommandVelocity { OfTarget, Led } }

/// The compensators of one specimen.
///
/// With r(g) the led target at a point g of the grid and s(d) what a compensator makes of a place at rest, the command for a target
/// d between two points is
///
/// ```text
/// s(d) + ρ · ((1 − θ)(r(g₀) − s(d(g₀))) + θ (r(g₁) − s(d(g₁))))
/// ```
///
/// g₁ is the first point at or after the end of the tick, g₀ the one before, θ the share of the way between them, and ρ the pace:
/// a delay is one of wall time, in which only ρ of it passes in test time. The velocity that goes with it is s(v) + ρ Δ(r − s)/Δg.
#[derive(Debug)]
pub(crate) struct Compensators {
    axes: Vec<AxisCompensator>,
    /// Tick in s of wall time, and seconds of test time in one of wall time.
    tick: f64,
    pace: f64,
    delay_in: DelayIn,
    target_velocity: TargetVelocity,
    activity: LeadActivity,
    course: LeadCourse,
    /// Velocities of the next command and of the command in force.
    velocities: [CommandVelocity; 2],
    grid: LeadGrid,
    /// The state before the next command was made, where a record is retraced.
    before: Option<TestState>,
}

state! {
    Compensators as "compensators" { activity, course, velocities, grid, axes }
    keeps { tick, pace, delay_in, target_velocity, before }
}

/// Where on the grid of test time the compensators are.
#[derive(Debug, Clone, Copy, Default)]
struct LeadGrid {
    /// The newest point that they were asked for, counted from the last target.
    point: f64,
    /// How far that is ahead of the command, in points.
    ahead: f64,
    /// 1/N.
    spacing: f64,
}

state! { LeadGrid { point, ahead, spacing } }

impl LeadGrid {
    const fn of(tick: &PacerTick) -> Self {
        Self {
            point: tick.point,
            ahead: tick.ahead,
            spacing: tick.spacing,
        }
    }
}

/// Relative difference of two displacements that are the same.
const ROUNDOFF: f64 = 1e-12;

impl Compensators {
    /// One per axis, with the metres in one unit of each.
    pub(crate) fn new(spec: Compensation, metres: Vec<f64>) -> Self {
        let axes = spec.compensators.into_iter().zip(metres);
        let axes = axes.map(|(one, metres)| AxisCompensator::new(one, metres));
        Self {
            axes: axes.collect(),
            tick: spec.tick,
            pace: spec.pace,
            delay_in: if spec.delay_in_test_time {
                DelayIn::TestTime
            } else {
                DelayIn::WallTime
            },
            target_velocity: if spec.base_moves {
                TargetVelocity::Own
            } else {
                TargetVelocity::Difference
            },
            activity: LeadActivity::Holding,
            course: LeadCourse::Undisturbed,
            velocities: [CommandVelocity::OfTarget; 2],
            grid: LeadGrid::default(),
            before: None,
        }
    }

    /// The test runs: from the next target on commands are led.
    pub(crate) const fn begin(&mut self) {
        self.activity = LeadActivity::Running;
    }

    fn is_running(&self) -> bool {
        self.activity != LeadActivity::Holding
    }

    fn are_differences(&self) -> bool {
        self.target_velocity == TargetVelocity::Difference
    }

    /// Names of the parameters, axis by axis; the axis counts from 0.
    pub(crate) fn names(&self) -> impl Iterator<Item = (usize, Parameter)> {
        let axes = self.axes.iter().enumerate();
        axes.flat_map(|(index, axis)| axis.one.names().iter().map(move |name| (index, *name)))
    }

    /// The parameters of the moment, in the order of their names. Real-time: yes.
    #[inline]
    pub(crate) fn parameters(&self) -> impl Iterator<Item = f64> {
        let axes = self.axes.iter();
        axes.flat_map(|axis| axis.one.parameters().iter().copied())
    }

    /// From here on the state before each command is kept: the last one never leaves, and is made again.
    pub(crate) fn follow_record(&mut self) {
        self.before = Some(TestState::with_room(|visit| self.visit_state(visit)));
    }

    /// No command is made for the next tick, and measurements teach nothing meanwhile. Real-time: yes.
    pub(crate) fn hold(&mut self) {
        if self.delay_in == DelayIn::WallTime {
            self.axes.iter_mut().for_each(AxisCompensator::misses);
        }
        self.keep();
    }

    /// Ticks at rest after which ticks without a command teach nothing wrong. Real-time: yes.
    pub(crate) fn ticks_to_rest(&self) -> u32 {
        let axes = self.axes.iter().map(AxisCompensator::ticks_to_rest);
        axes.max().unwrap_or(0)
    }

    /// The state, for a test that is resumed later: before the next command, where a record was retraced.
    pub(crate) fn freeze(&mut self) -> Option<TestState> {
        let before = self.before.take().filter(|before| !before.is_empty());
        before.or_else(|| TestState::of(|visit| self.visit_state(visit)).ok())
    }

    /// Keeps the present state, where a record is retraced. Real-time: yes.
    fn keep(&mut self) {
        if let Some(mut before) = self.before.take() {
            // The room was made for it.
            let _ = before.take(|visit| self.visit_state(visit));
            self.before = Some(before);
        }
    }

    /// Takes a state back. Compensators in wall time forget the measurements before it.
    pub(crate) fn thaw(&mut self, state: &TestState) {
        // It is that of these compensators.
        let _ = state.restore(|visit| self.visit_state(visit));
        if self.activity == LeadActivity::Awaiting {
            self.activity = LeadActivity::Running;
        }
        if self.delay_in == DelayIn::WallTime {
            self.axes.iter_mut().for_each(AxisCompensator::misses);
        }
    }

    /// Takes the state back that these compensators had before any command.
    pub(crate) fn restart(&mut self, fresh: &TestState) {
        // It is that of these compensators.
        let _ = fresh.restore(|visit| self.visit_state(visit));
    }

    /// Command at rest over the displacement at which the axis is to rest. Real-time: yes.
    pub(crate) fn static_gain(&self, axis: usize) -> f64 {
        let gain = self.axes.get(axis);
        let gain = gain.map_or(f64::NAN, |axis| axis.one.stands(1.0));
        if (gain - 1.0).abs() <= ROUNDOFF {
            1.0
        } else {
            gain
        }
    }

    /// Makes the command of a target, which is a tick of the compensators' after the last. `is_published`: the target came with the
    /// integrator's velocity. Real-time: yes.
    #[inline]
    pub(crate) fn lead(
        &mut self,
        axes: &[Axis],
        target: &AtStructure<AxisMotion>,
        command: &mut AtAxis<AxisMotion>,
        is_published: bool,
    ) {
        self.keep();
        self.course = LeadCourse::Undisturbed;
        let running = self.is_running();
        self.velocities[0] = if running {
            CommandVelocity::Led
        } else {
            CommandVelocity::OfTarget
        };
        let (tick, pace) = (self.tick, self.pace);
        let is_published = is_published && self.are_differences();
        let targets = target.disp.iter().zip(&target.vel);
        let commands = command.iter_mut();
        let axes = axes.iter().zip(commands).zip(targets);
        for (((axis, (command, command_vel)), (target, vel)), made) in axes.zip(&mut self.axes) {
            let disp = axis.disp_gain * target * made.metres;
            let vel = axis.disp_gain * vel * made.metres * pace;
            if running {
                let led = made.ask(disp, is_published.then_some(vel), tick);
                *command = made.one.regulate(led) / made.metres + axis.disp_offset;
                made.lead_vel(vel, tick, 1.0, pace, axis, command_vel);
            } else {
                let at_rest = made.at_rest(disp);
                // Weights that sum up to 1 but for roundoff change nothing.
                if (at_rest - disp).abs() > ROUNDOFF * disp.abs() {
                    *command = at_rest / made.metres + axis.disp_offset;
                }
                made.vel = vel;
            }
        }
    }

    /// Makes the command at the end of a tick of the step pacer. Real-time: yes.
    #[inline]
    pub(crate) fn lead_along(
        &mut self,
        axes: &[Axis],
        path: &TargetPath,
        target: &AtStructure<AxisMotion>,
        command: &mut AtAxis<AxisMotion>,
        (is_published, tick): (bool, &PacerTick),
    ) {
        let pace = if self.delay_in == DelayIn::TestTime {
            1.0
        } else {
            tick.pace
        };
        let is_next = tick.point - self.grid.point == 1.0;
        if !self.is_running() || (pace == 1.0 && tick.ahead == 0.0 && is_next) {
            self.lead(axes, target, command, is_published);
            self.grid = LeadGrid::of(tick);
        } else {
            self.lead_between(axes, path, target, command, (tick, pace));
        }
    }

    /// Makes the command where the pace is not the full one, or was not in all of this step. Real-time: yes.
    fn lead_between(
        &mut self,
        axes: &[Axis],
        path: &TargetPath,
        target: &AtStructure<AxisMotion>,
        command: &mut AtAxis<AxisMotion>,
        (tick, pace): (&PacerTick, f64),
    ) {
        self.keep();
        self.course = LeadCourse::Disturbed;
        self.velocities[0] = CommandVelocity::Led;
        let are_differences = self.are_differences();
        let targets = target.disp.iter().zip(&target.vel);
        let commands = command.iter_mut();
        let axes = axes.iter().zip(commands).zip(targets);
        for (index, (((axis, (command, command_vel)), (target, vel)), made)) in
            axes.zip(&mut self.axes).enumerate()
        {
            let in_metres = axis.disp_gain * made.metres;
            // One point at the most, or two where roundoff has a part in it: no tick is longer than a full one.
            let mut point = self.grid.point;
            while point < tick.point {
                point += 1.0;
                let whole = tick.spacing == 1.0;
                let (mut disp, vel) = path.point(index, point * tick.spacing, whole);
                if point == tick.point && tick.ahead == 0.0 {
                    disp = *target;
                }
                let vel = vel.map(|vel| in_metres * vel * self.pace);
                let vel = vel.filter(|_| are_differences);
                made.ask(in_metres * disp, vel, self.tick);
            }
            let led = made.between(in_metres * target, tick.ahead, pace);
            *command = made.one.regulate(led) / made.metres + axis.disp_offset;
            let vel = in_metres * vel * self.pace;
            made.lead_vel(vel, self.tick, pace, self.pace, axis, command_vel);
        }
        self.grid = LeadGrid::of(tick);
    }

    /// A target is reached: points count from there. Real-time: yes.
    #[inline]
    pub(crate) const fn begin_grid(&mut self) {
        (self.grid.point, self.grid.ahead) = (0.0, 0.0);
    }

    /// The next target is known: a point ahead of the command that was predicted is corrected, so that the
    /// next lead is not one of the difference. Real-time: yes.
    #[inline]
    pub(crate) fn amend(&mut self, axes: &[Axis], path: &TargetPath) {
        let LeadGrid {
            point,
            ahead,
            spacing,
        } = self.grid;
        if ahead == 0.0 {
            return;
        }
        let are_differences = self.are_differences();
        for (index, (axis, made)) in axes.iter().zip(&mut self.axes).enumerate() {
            let share = point * spacing;
            let (disp, vel) = path.point(index, share, spacing == 1.0);
            let in_metres = axis.disp_gain * made.metres;
            let vel = vel.map(|vel| in_metres * vel * self.pace);
            let vel = vel.filter(|_| are_differences);
            made.amend(in_metres * disp, vel, self.tick);
        }
    }

    /// A command that was made of a target leaves, or the last one leaves again. Real-time: yes.
    #[inline]
    pub(crate) fn note_sent(&mut self, moves: bool) {
        if self.is_running() {
            self.activity = if moves {
                LeadActivity::Awaiting
            } else {
                LeadActivity::Running
            };
        }
        let [ready, _] = self.velocities;
        self.velocities = if moves {
            [CommandVelocity::OfTarget, ready]
        } else {
            [ready, CommandVelocity::OfTarget]
        };
    }

    /// The velocity of the command in force without what the lead adds, if it adds anything; in the axis' unit. Real-time: yes.
    #[inline]
    pub(crate) fn own_vel(&self, axis: usize) -> Option<f64> {
        if self.velocities[1] == CommandVelocity::OfTarget {
            return None;
        }
        Some(self.axes.get(axis).map_or(f64::NAN, |axis| axis.own_vel))
    }

    /// The answer to a command is there, or an old one in place of it. `sent` and `raw` are in the specimen's units. Real-time: yes.
    #[inline]
    pub(crate) fn hear(
        &mut self,
        axes: &[Axis],
        sent: AtAxis<&[f64]>,
        raw: AtAxis<&[f64]>,
        is_fresh: bool,
    ) {
        if self.activity != LeadActivity::Awaiting {
            return;
        }
        self.activity = LeadActivity::Running;
        let undisturbed = self.course == LeadCourse::Undisturbed;
        let axes = axes.iter().zip(*sent).zip(*raw);
        for (((axis, sent), raw), made) in axes.zip(&mut self.axes) {
            let command = (sent - axis.disp_offset) * made.metres;
            let measured = (raw - axis.measured_offset - axis.disp_offset) * made.metres;
            if is_fresh && measured.is_finite() {
                made.hear(command, measured, undisturbed);
            } else {
                made.lacks(command, undisturbed);
            }
        }
    }
}

#[cfg(test)]
mod tests;
