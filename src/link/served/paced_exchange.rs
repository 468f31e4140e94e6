//! Paced exchanges: many commands, each with its own answer, move the specimen to a target of the controller.
//!
//! The ramp of the port leads to the first target of a session, as at the start of a test: from the specimen's position, and no
//! faster than half of the limits of speed. Compensators hold meanwhile. Each later target has a separate path.

use super::Trip;
use super::client_scale::copy;
use super::first_command::beyond;
use super::guarded_specimen::{GuardedSpecimen, Origin, in_metres, not_finite};
use super::pacing::{PacedPath, PathTick};
use super::path_limits::{allowed_accel, judge};
use gusset_control::engine::Between;
use gusset_control::port::{LoadingUnit, SHARE_OF_SPEED};
use gusset_quantity::catalog::event::Remark;
use gusset_quantity::frame::AtClient;
use gusset_quantity::substructure::{Command, Measurement};

impl GuardedSpecimen {
    /// Moves the specimen to a target of the controller, and returns the answer there. If that is no longer `wanted`, the
    /// specimen comes to rest on the path, and false is returned.
    pub(crate) fn follow(
        &mut self,
        path: &mut PacedPath,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        let is_finite = not_finite(command.disp, command.vel).is_none();
        if is_finite && path.is_repeated(AtClient(command.disp), self.commits()) {
            // OpenSees sends each target again with the velocity at the end of the step.
            (into.time, into.status) = (path.at_target.time, path.at_target.status);
            copy(&path.at_target, into);
            return Ok(true);
        }
        if !path.is_first && path.prediction.is_some() {
            return self.go_to(path, command, elapsed, wanted, into);
        }
        let begun = self.judge_target(path, command);
        let begun = begun.and_then(|()| self.begin_path(path, command));
        if let Err(trip) = begun {
            // No command of it leaves. The row shows that.
            self.trip(trip);
            return self.exchange_once(Origin::Controller, command, elapsed, wanted, into);
        }
        let mut is_wanted = true;
        let mut is_owed = false;
        loop {
            if is_wanted && !wanted() {
                is_wanted = false;
                self.between.add(Between::UNWANTED);
                path.stop(self.port.ticks_to_rest());
            }
            let Some(tick) = path.next() else { break };
            if is_owed {
                self.accept_on_the_way()?;
            }
            let period_s = path.pacing.period_s();
            let origin = self.prepare(path, tick);
            let theirs = Command {
                sequence: path.sequence,
                time: command.time - (1.0 - tick.gone) * elapsed,
                dt: period_s,
                disp: if path.is_first {
                    command.disp
                } else {
                    &path.disp
                },
                vel: &path.vel,
            };
            let share = elapsed * path.share_of_tick();
            // A stop lets the present exchange end, within the time limit of its reply, and slows down from there.
            let exchanged = self.exchange_once(origin, &theirs, share, &mut || true, into);
            // The first command of a path waits for the client.
            if is_owed && exchanged.is_ok() && self.test.was_late() {
                self.misses_edge();
            }
            exchanged?;
            path.count();
            is_owed = true;
        }
        if !is_wanted {
            self.between.remove(Between::UNWANTED);
            if !path.rests_on_the_way(self.test.told()) {
                // The answer at the target before remains.
                if let Some(announced) = &mut self.announced {
                    let stands = path.rests().part(Vec::as_slice);
                    announced.begin_at(in_metres(&self.identity.scale.units, stands));
                }
                return Ok(false);
            }
            self.between.add(Between::GIVEN_UP);
        } else if std::mem::take(&mut path.is_first) {
            self.port.begin_compensation();
            if let Some(prediction) = &mut path.prediction {
                prediction.begin(&mut self.port);
            }
        }
        self.note_answer(path, command, is_wanted.then_some(elapsed));
        Ok(is_wanted)
    }

    /// The answer at a target stays, if it was reached `elapsed` s after the last.
    pub(super) fn note_answer(
        &mut self,
        path: &mut PacedPath,
        command: &Command<'_>,
        elapsed: Option<f64>,
    ) {
        path.answered = elapsed.map(|_| self.commits());
        path.times = [command.time, elapsed.unwrap_or(0.0)];
        (path.share, path.is_owed) = (0.0, false);
        (path.at_target.time, path.at_target.status) = (self.answer.time, self.answer.status);
        copy(&self.answer, &mut path.at_target);
    }

    /// Makes a target of the controller that of the port, if its numbers and its pose can be.
    pub(super) fn seek_target(&mut self, command: &Command<'_>) -> Result<(), Trip> {
        if let Some(axis) = not_finite(command.disp, command.vel) {
            let (axis, measured) = (Some(axis), false);
            return Err(Trip::NotFinite { axis, measured });
        }
        let motion = [command.disp, command.vel].map(AtClient);
        self.identity.scale.seek_moving(&mut self.port, motion);
        match self.port.loading_unit().and_then(LoadingUnit::fault) {
            Some(fault) => Err(Trip::Geometry(fault)),
            None => Ok(()),
        }
    }

    /// Judges a target before the specimen moves: its commands are judged one by one.
    fn judge_target(&mut self, path: &mut PacedPath, command: &Command<'_>) -> Result<(), Trip> {
        self.seek_target(command)?;
        let [last, next] = &mut path.places;
        self.port.write_goal(next);
        let [last, next] = [&*last, next].map(|place| place.part(Vec::as_slice));
        if let Some(hit) = beyond(&self.port, next) {
            return Err(Trip::Limit(hit));
        }
        self.first.judge(command, next, &self.port)?;
        let ends = [last, next];
        if !path.is_first {
            judge(&self.port, ends, path.pacing)?;
        }
        path.allowed = allowed_accel(&self.port, ends);
        path.places.swap(0, 1);
        Ok(())
    }

    /// The path to a target begins: a ramp of the port to the first one of a session.
    fn begin_path(&mut self, path: &mut PacedPath, command: &Command<'_>) -> Result<(), Trip> {
        path.aim(AtClient(command.disp));
        let mut seconds = path.pacing.motion_s();
        if path.is_first {
            path.vel.fill(0.0);
            let motion = [AtClient(command.disp), path.vel.part(Vec::as_slice)];
            self.identity.scale.aim(&mut self.port, motion);
            self.port.begin_ramp();
            let period_s = path.pacing.period_s();
            let needed = self.port.ramp_time(SHARE_OF_SPEED, period_s, seconds);
            seconds = path.takes(needed);
        } else if self.is_behind() && path.pacing.settle_ticks < self.port.ticks_to_rest() {
            // The specimen has moved on since its last answer.
            self.port.skips_commands();
        }
        if let Some(announced) = self.announced.as_mut() {
            let disp = in_metres(&self.identity.scale.units, AtClient(command.disp));
            announced.command(seconds, disp)?;
        }
        Ok(())
    }

    /// Makes the next command of the path, of which the port makes that of a ramp, and names its origin.
    fn prepare(&mut self, path: &mut PacedPath, tick: PathTick) -> Origin {
        let period_s = path.pacing.period_s();
        if !path.is_first {
            path.make(tick);
            return Origin::Paced { period_s };
        }
        let seconds = period_s * f64::from(path.ticks()) / tick.pace;
        self.port.ramp_to(tick.share, seconds);
        let lands = tick.share >= 1.0;
        Origin::Ramp { period_s, lands }
    }

    /// A command left late, because the specimen replied late.
    pub(super) fn misses_edge(&mut self) {
        if !self.recording.misses_edge() {
            return;
        }
        let text = "the specimen does not reply within one period of `serve.pace`, so commands leave late and the motion is slower: lower \
                    `rate_hz`, or let the rig reply faster";
        self.warn(Remark::LateReplies, text);
    }

    /// A command before the target is accepted: the controller accepts the target itself.
    pub(super) fn accept_on_the_way(&mut self) -> Result<(), Trip> {
        self.port.accepted(0).map_err(|fault| {
            let trip = fault.into();
            self.trip_between(trip);
            trip
        })
    }
}
