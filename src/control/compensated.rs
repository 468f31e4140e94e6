//! The compensators of a port: one per axis, in m at the specimen, between the command that the target asks for and the one
//! that is sent.
//!
//! Until the test runs they hold: whatever comes before (static load, ramps, warm-up) is quasi-static, passes as a place at
//! rest does, with the gain that a compensator makes up for and no lead, and is the history that the first prediction starts
//! from. A tick in which time stands still, or without a fresh measurement, teaches them nothing; one without a measurement is
//! filled in when the next comes, so that what filters and differentiates goes on in ticks, and after many of them in a row nothing
//! is learnt for as long as after a hold.
//!
//! In the running test a compensator is asked for its lead on one grid of test time only: N points a step, where the ticks of
//! an undisturbed test end. While test time is stretched ([`super::Tempo`]) the path that it sees is that of the undisturbed
//! test, so there is no change of pace that it could differentiate. With r(g) its led target and s(d) what it makes of a place at
//! rest, the command for a target d between two points is
//!
//! ```text
//! s(d) + ρ · ((1 − θ)(r(g₀) − s(d(g₀))) + θ (r(g₁) − s(d(g₁))))
//! ```
//!
//! g₁ the first point at or after the end of the tick, g₀ the one before, θ the share of the way from one to the other. A
//! delay is one of wall time, in which only ρ of it in test time passes: what is ahead is scaled by the pace, which is eased
//! and not cut into whole ticks. The gain that makes up for one of the actuator is not. (What goes with the square or the cube of
//! the delay is scaled by ρ, too: more than it needs, continuous, and right at both ends.) So a command changes in a tick by no
//! more than the gain times the target's change, the lead's change from point to point, and the lead over the ticks of easing.
//! At ρ = 1 and on the grid it is r itself, to the last bit.
//!
//! The velocity that goes with it is its derivative at that pace, s(v) + ρ Δ(r − s)/Δg: v itself where nothing is led, and
//! what follows a led path at once resists with the velocity of that path. What a loop of a compensator's own adds is not in
//! it. A fit of the specimen's tangent goes on with v, which is what the specimen should have done by now.
//!
//! An actuator that is simulated in this process lives in test time (a tick is as long for it as it is for the test): its delay
//! is the same at every pace, and ρ is 1 for it throughout. A specimen that is commanded once a step is compensated from target to
//! target. Kind by kind, and what learns when: [`crate::compensation`].

mod axis;
mod gap;

use axis::Compensated;

use super::{Port, Stride};
use crate::compensation::{Compensator, Parameter};

/// Compensators of one port.
#[derive(Debug)]
pub(super) struct Compensation {
    axes: Vec<Compensated>,
    /// Tick in s of wall time, and seconds of test time in one of wall time.
    tick: f64,
    pace: f64,
    /// The delay that is made up for is one of test time.
    in_test_time: bool,
    /// The velocity of a target is its ∇d/Δt: not where the base moves, whose velocity is the one of now.
    are_differences: bool,
    running: bool,
    /// A command that was made of a target is in force, and its measurement is still to come.
    asked: bool,
    /// That command is one of an undisturbed test.
    undisturbed: bool,
    /// The command that stands ready, and the one in force, were made here: their velocity is not the target's.
    led: [bool; 2],
    grid: Grid,
    /// The state before the command that stands ready was made, where a record is followed to be gone on with.
    before: Option<Vec<f64>>,
}

/// Where on the grid of test time the compensators are.
#[derive(Debug, Clone, Copy, Default)]
struct Grid {
    /// The newest point that they were asked for, counted from the last target.
    point: f64,
    /// How far that is ahead of the command, in points.
    ahead: f64,
    /// 1/N.
    spacing: f64,
}

/// Relative difference of two displacements that are the same.
const ROUNDOFF: f64 = 1e-12;

impl Compensation {
    fn freeze(&mut self, out: &mut Vec<f64>) {
        let Grid {
            point,
            ahead,
            spacing,
        } = self.grid;
        out.push(f64::from(u8::from(self.running)));
        out.extend([point, ahead, spacing]);
        for axis in &mut self.axes {
            axis.freeze(out);
        }
    }

    /// Keeps the state as it is now, where a record is followed. Real-time: yes, where none is.
    fn keep(&mut self) {
        if let Some(mut before) = self.before.take() {
            before.clear();
            self.freeze(&mut before);
            self.before = Some(before);
        }
    }
}

impl Port {
    /// Puts a compensator on each axis; `tick` is the wall time from command to command in s, `pace` the test time that
    /// passes in one second of it. Without as many compensators as axes nothing changes.
    #[must_use]
    pub fn with_compensation(
        mut self,
        of: Vec<Box<dyn Compensator>>,
        metres: Vec<f64>,
        tick: f64,
        pace: f64,
    ) -> Self {
        let n = self.axes.len();
        if of.len() == n && metres.len() == n {
            let axes = of.into_iter().zip(metres);
            let axes = axes.map(|(one, metres)| Compensated::new(one, metres));
            self.compensation = Some(Compensation {
                axes: axes.collect(),
                tick,
                pace,
                in_test_time: false,
                are_differences: true,
                running: false,
                asked: false,
                undisturbed: true,
                led: [false; 2],
                grid: Grid::default(),
                before: None,
            });
        }
        self
    }

    /// The delay that is made up for is one of test time: that of an actuator which is simulated in this process.
    #[must_use]
    pub fn with_delay_in_test_time(mut self) -> Self {
        if let Some(compensation) = &mut self.compensation {
            compensation.in_test_time = true;
        }
        self
    }

    /// The base moves: targets come with velocities that are no differences of theirs.
    #[must_use]
    pub fn with_moving_base(mut self) -> Self {
        if let Some(compensation) = &mut self.compensation {
            compensation.are_differences = false;
        }
        self
    }

    /// The test runs: from the next target on commands are compensated, and it is seen how they are followed.
    pub fn begin_compensation(&mut self) {
        self.runs = true;
        if let Some(compensation) = &mut self.compensation {
            compensation.running = true;
        }
    }

    /// Names of the compensators' parameters, axis by axis; the axis counts from 0.
    pub fn compensation_names(&self) -> impl Iterator<Item = (usize, Parameter)> {
        let of = self.compensation.iter().flat_map(|all| &all.axes);
        of.enumerate()
            .flat_map(|(index, axis)| axis.one.names().iter().map(move |name| (index, *name)))
    }

    /// The parameters of the moment, in the order of their names. Real-time: yes.
    #[inline]
    pub fn compensation_parameters(&self) -> impl Iterator<Item = f64> {
        let of = self.compensation.iter().flat_map(|all| &all.axes);
        of.flat_map(|axis| axis.one.parameters().iter().copied())
    }

    /// From here on the state before each command is kept, too: the last one never leaves, and is made again.
    pub fn follow_compensation(&mut self) {
        if let Some(compensation) = &mut self.compensation {
            compensation.before = Some(Vec::new());
        }
    }

    /// No command is made for the next tick: the last one has left, and is repeated. What is measured meanwhile is not heard,
    /// and for what lives in wall time that is a gap. Real-time: yes, where no record is followed.
    #[inline]
    pub fn hold_compensation(&mut self) {
        // What is commanded once a step may still have its target before it.
        if self.is_per_step() {
            return;
        }
        if let Some(compensation) = &mut self.compensation {
            if !compensation.in_test_time {
                compensation.axes.iter_mut().for_each(Compensated::misses);
            }
            compensation.keep();
        }
    }

    /// What moves the specimen from here on is none of the test's: nothing is seen of how it follows.
    pub fn pause_following(&mut self) {
        self.runs = false;
    }

    /// The test goes on.
    pub fn go_on_following(&mut self) {
        self.runs = true;
    }

    /// The compensators' states, for a test that is to go on later: before the command that stands ready, where the record
    /// was followed.
    pub fn freeze_compensation(&mut self, out: &mut Vec<f64>) {
        let Some(compensation) = &mut self.compensation else {
            return;
        };
        match compensation.before.take() {
            Some(before) if !before.is_empty() => out.extend(before),
            _ => compensation.freeze(out),
        }
    }

    /// Takes them back from the front of `from` and returns the rest. For what lives in wall time what was measured before lies
    /// in another time.
    pub fn thaw_compensation<'a>(&mut self, from: &'a [f64]) -> &'a [f64] {
        let Some(compensation) = &mut self.compensation else {
            return from;
        };
        let mut rest = from;
        if let Some((&[running, point, ahead, spacing], tail)) = rest.split_first_chunk::<4>() {
            compensation.running = running != 0.0;
            compensation.grid = Grid {
                point,
                ahead,
                spacing,
            };
            rest = tail;
        }
        for axis in &mut compensation.axes {
            rest = axis.thaw(rest, compensation.in_test_time);
        }
        rest
    }

    /// Makes the command of the target's, which is a tick of the compensators' after the last. Real-time: yes.
    pub(super) fn compensate(&mut self) {
        let Some(compensation) = &mut self.compensation else {
            return;
        };
        compensation.keep();
        compensation.undisturbed = true;
        compensation.led[0] = compensation.running;
        let (tick, pace) = (compensation.tick, compensation.pace);
        let is_published = self.tracking.has_published() && compensation.are_differences;
        let targets = self.target.iter().zip(&self.target_vel);
        let commands = self.command.iter_mut().zip(&mut self.command_vel);
        let axes = self.axes.iter().zip(commands).zip(targets);
        for (((axis, (command, command_vel)), (target, vel)), made) in
            axes.zip(&mut compensation.axes)
        {
            let disp = axis.disp_gain * target * made.metres;
            let vel = axis.disp_gain * vel * made.metres * pace;
            if compensation.running {
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

    /// Makes the command at the end of a stride. Real-time: yes.
    #[inline]
    pub(super) fn compensate_along(&mut self, stride: &Stride) {
        let Some(compensation) = &mut self.compensation else {
            return;
        };
        let pace = if compensation.in_test_time {
            1.0
        } else {
            stride.pace
        };
        let is_next = stride.point - compensation.grid.point == 1.0;
        if !compensation.running || (pace == 1.0 && stride.ahead == 0.0 && is_next) {
            self.compensate();
            self.lay_grid(stride);
        } else {
            self.compensate_between(stride, pace);
        }
    }

    fn lay_grid(&mut self, stride: &Stride) {
        if let Some(compensation) = &mut self.compensation {
            compensation.grid = Grid {
                point: stride.point,
                ahead: stride.ahead,
                spacing: stride.spacing,
            };
        }
    }

    /// The same where the pace is not the full one, or has not always been in this step. Real-time: yes.
    fn compensate_between(&mut self, stride: &Stride, pace: f64) {
        let Some(compensation) = &mut self.compensation else {
            return;
        };
        compensation.keep();
        compensation.undisturbed = false;
        compensation.led[0] = true;
        let targets = self.target.iter().zip(&self.target_vel);
        let commands = self.command.iter_mut().zip(&mut self.command_vel);
        let axes = self.axes.iter().zip(commands).zip(targets);
        for (index, (((axis, (command, command_vel)), (target, vel)), made)) in
            axes.zip(&mut compensation.axes).enumerate()
        {
            let in_metres = axis.disp_gain * made.metres;
            // One point at the most, or two where roundoff has a part in it: no tick is longer than a full one.
            let mut point = compensation.grid.point;
            while point < stride.point {
                point += 1.0;
                let whole = stride.spacing == 1.0;
                let (mut disp, vel) = self.pursuit.point(index, point * stride.spacing, whole);
                if point == stride.point && stride.ahead == 0.0 {
                    disp = *target;
                }
                let vel = vel.map(|vel| in_metres * vel * compensation.pace);
                let vel = vel.filter(|_| compensation.are_differences);
                made.ask(in_metres * disp, vel, compensation.tick);
            }
            let led = made.between(in_metres * target, stride.ahead, pace);
            *command = made.one.regulate(led) / made.metres + axis.disp_offset;
            let vel = in_metres * vel * compensation.pace;
            made.lead_vel(
                vel,
                compensation.tick,
                pace,
                compensation.pace,
                axis,
                command_vel,
            );
        }
        self.lay_grid(stride);
    }

    /// A target is reached: points count from there. Real-time: yes.
    #[inline]
    pub(super) fn begin_grid(&mut self) {
        if let Some(compensation) = &mut self.compensation {
            (compensation.grid.point, compensation.grid.ahead) = (0.0, 0.0);
        }
    }

    /// The next target is known: a point ahead of the command that was asked for while it was foretold is put right, so that
    /// the next lead is not one of the difference. Real-time: yes.
    #[inline]
    pub(super) fn amend_compensation(&mut self) {
        let Some(compensation) = &mut self.compensation else {
            return;
        };
        let Grid {
            point,
            ahead,
            spacing,
        } = compensation.grid;
        if ahead == 0.0 {
            return;
        }
        for (index, (axis, made)) in self.axes.iter().zip(&mut compensation.axes).enumerate() {
            let share = point * spacing;
            let (disp, vel) = self.pursuit.point(index, share, spacing == 1.0);
            let in_metres = axis.disp_gain * made.metres;
            let vel = vel.map(|vel| in_metres * vel * compensation.pace);
            let vel = vel.filter(|_| compensation.are_differences);
            made.amend(in_metres * disp, vel, compensation.tick);
        }
    }

    /// A command that was made of a target leaves, or one that only stands still. Real-time: yes.
    #[inline]
    pub(super) fn compensation_asks(&mut self, moves: bool) {
        self.tracking.moves = moves && self.runs;
        if let Some(compensation) = &mut self.compensation {
            compensation.asked = moves;
            let ready = compensation.led[0];
            compensation.led = if moves {
                [false, ready]
            } else {
                [ready, false]
            };
        }
    }

    /// The velocity of the command in force without what it is led by, if it is; in the axis' unit. Real-time: yes.
    #[inline]
    pub(super) fn unled_vel(compensation: Option<&Compensation>, axis: usize) -> Option<f64> {
        let made = compensation.filter(|all| all.led[1])?;
        Some(made.axes.get(axis)?.own_vel)
    }

    /// The answer to a command is there, or an old one in place of it. Real-time: yes.
    pub(super) fn compensation_hears(&mut self, is_fresh: bool) {
        let Some(Compensation {
            axes: made,
            running: true,
            asked: asked @ true,
            undisturbed,
            ..
        }) = &mut self.compensation
        else {
            return;
        };
        *asked = false;
        let axes = self.axes.iter().zip(&self.sent).zip(&self.raw.disp);
        for (((axis, sent), raw), made) in axes.zip(made) {
            let command = (sent - axis.disp_offset) * made.metres;
            let measured = (raw - axis.measured_offset - axis.disp_offset) * made.metres;
            if is_fresh && measured.is_finite() {
                made.hear(command, measured, *undisturbed);
            } else {
                made.lacks(command, *undisturbed);
            }
        }
    }
}

#[cfg(test)]
mod tests;
