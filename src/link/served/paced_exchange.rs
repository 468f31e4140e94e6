//! Paced exchanges: the specimen is led to a target of the controller by many commands, each with its own answer.

use super::Trip;
use super::first_command::beyond;
use super::guarded_specimen::{GuardedSpecimen, Origin, in_metres, not_finite};
use super::identity::Identity;
use super::pacing::PacedPath;
use crate::substructure::{Command, Measurement};

impl GuardedSpecimen {
    /// Leads the specimen to a target of the controller, and returns the answer there.
    pub fn follow(
        &mut self,
        path: &mut PacedPath,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        if let Err(trip) = self.judge_target(path, command) {
            // Nothing of it leaves. The row says so.
            self.trip(trip);
            return self.exchange_once(Origin::Controller, command, elapsed, wanted, into);
        }
        let origin = Origin::Paced {
            period_s: path.pacing.period_s(),
        };
        let share = 1.0 / f64::from(path.pacing.ticks);
        path.aim(command.disp);
        while let Some(place) = path.next() {
            path.wait();
            if !wanted() {
                return Ok(false);
            }
            let tick = Command {
                sequence: path.sequence,
                time: command.time - (1.0 - place) * elapsed,
                dt: command.dt * share,
                disp: &path.disp,
                vel: &path.vel,
            };
            if !self.exchange_once(origin, &tick, elapsed * share, wanted, into)? {
                return Ok(false);
            }
            path.count();
            if place < 1.0 {
                self.accept_on_the_way()?;
            }
        }
        Ok(true)
    }

    /// Everything that is judged of a target before the specimen is led there: its commands are judged one by one.
    fn judge_target(&mut self, path: &mut PacedPath, command: &Command<'_>) -> Result<(), Trip> {
        if let Some(axis) = not_finite(command.disp, command.vel) {
            let measured = false;
            return Err(Trip::NotFinite { axis, measured });
        }
        let Identity { scale, units, .. } = &self.identity;
        scale.seek(&mut self.port, command.disp, units);
        if let Some(fault) = self.port.geometry_fault() {
            return Err(Trip::Geometry(fault));
        }
        self.port.write_goal(&mut path.place);
        if let Some(hit) = beyond(&self.port, &path.place) {
            return Err(Trip::Limit(hit));
        }
        self.first.judge(command, &path.place, &self.port)?;
        if let Some(announced) = self.announced.as_mut() {
            let disp = in_metres(units, command.disp);
            announced.command(path.pacing.step_s(), disp)?;
        }
        Ok(())
    }

    /// A command before the target is accepted: the controller accepts the target itself.
    fn accept_on_the_way(&mut self) -> Result<(), Trip> {
        self.port.accepted(0).map_err(|fault| {
            let trip = Trip::Lost(fault);
            self.trip(trip);
            trip
        })
    }
}
