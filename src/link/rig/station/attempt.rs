//! One exchange of a station: what is judged before it leaves, and what is judged of the answer.

use super::{Station, USUAL_TICK_S, first, metres, not_finite};
use crate::control::limits::Found;
use crate::link::rig::Trip;
use crate::link::rig::log::Exchange;
use crate::record::NoteLevel;
use crate::rt::os;
use crate::substructure::{Command, Measurement, Status};
use crate::time::Nanos;

impl Station {
    pub(super) fn exchange_as(
        &mut self,
        state: f64,
        command: &Command<'_>,
        elapsed: f64,
        into: &mut Measurement,
    ) -> Result<(), Trip> {
        // Only the log wants to know the time.
        let received_ns = self.log.as_ref().map_or(0, |_| os::monotonic_ns());
        if let Some(log) = &mut self.log {
            log.begins(command.time);
        }
        let mut answered_ns = None;
        if self.tripped.is_none()
            && let Err(trip) = self.attempt(
                command,
                elapsed,
                state == Exchange::RUNNING,
                &mut answered_ns,
            )
        {
            self.trip(trip);
        }
        into.sequence = command.sequence;
        into.time = self.measured.time;
        into.status = self.measured.status;
        for (to, from) in into.disp.iter_mut().zip(&self.measured.disp) {
            *to = *from;
        }
        for (to, from) in into.force.iter_mut().zip(&self.measured.force) {
            *to = *from;
        }
        if self.tripped.is_some() {
            into.status.0 |= Status::INTERLOCK.0;
        }
        if let Some(log) = &mut self.log {
            log.exchange(&Exchange {
                state: answered_ns.map_or(Exchange::KEPT_BACK, |_| state),
                command,
                elapsed,
                commits: self.commits,
                measured: into,
                trip: self.tripped,
                received_ns,
                answered_ns: answered_ns.unwrap_or(received_ns),
            });
        }
        self.tripped.map_or(Ok(()), Err)
    }

    /// `answered_ns` stays empty for a command that is not passed on.
    fn attempt(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        is_theirs: bool,
        answered_ns: &mut Option<u64>,
    ) -> Result<(), Trip> {
        if let Some(axis) = not_finite(command.disp, command.vel) {
            let measured = false;
            return Err(Trip::NotFinite { axis, measured });
        }
        let time = self.time_of(command.sequence, elapsed, is_theirs);
        if let Some(time) = time {
            self.watch.tick_is(time);
        }
        if is_theirs
            && let Some(leaves) = &self.leaves
            && let Some(hit) = first::judge(&self.limits, leaves, metres(&self.units, command.disp))
        {
            return Err(Trip::Limit(hit));
        }
        let found = self.watch.command(metres(&self.units, command.disp));
        self.heed(found)?;
        // Our own small motions before the test are none of the controller's.
        let mut announced = self.announced.as_mut().filter(|_| is_theirs);
        if let Some(announced) = &mut announced {
            announced.command(
                time.unwrap_or(USUAL_TICK_S),
                metres(&self.units, command.disp),
            )?;
        }
        self.watch.sent(metres(&self.units, command.disp));
        if is_theirs {
            (self.stands, self.leaves) = (None, None);
        }
        let outcome = self.rig.trial(command, elapsed, &mut self.measured);
        *answered_ns = Some(self.log.as_ref().map_or(0, |_| os::monotonic_ns()));
        outcome.map_err(Trip::Lost)?;
        self.unsettled += u64::from(self.measured.status.has(Status::UNSETTLED));
        if let Some(axis) = not_finite(&self.measured.disp, &self.measured.force) {
            // What is no number goes no further.
            let Measurement { disp, force, .. } = &mut self.measured;
            for value in disp.iter_mut().chain(force) {
                if !value.is_finite() {
                    *value = 0.0;
                }
            }
            let measured = true;
            return Err(Trip::NotFinite { axis, measured });
        }
        let values = metres(&self.units, &self.measured.disp).zip(
            self.measured
                .force
                .iter()
                .zip(&self.units)
                .map(|(force, units)| force * units.newtons),
        );
        let found = self.watch.measured(values.clone());
        if let Some(announced) = self.announced.as_mut().filter(|_| is_theirs) {
            announced.measured(values)?;
        }
        self.heed(found)?;
        if self.measured.status.has(Status::SATURATED) {
            return Err(Trip::Saturated);
        }
        if self.measured.status.has(Status::INTERLOCK) {
            return Err(Trip::Interlock);
        }
        Ok(())
    }

    /// The time that a command has for its motion, if anything is known of it. Our own small motions before the test keep to
    /// a pace of ours. Real-time: yes.
    fn time_of(&mut self, sequence: u64, elapsed: f64, is_theirs: bool) -> Option<f64> {
        let now = self.now.unwrap_or_else(|| Nanos(os::monotonic_ns()));
        let allowed = self.allowed.as_mut().filter(|_| is_theirs);
        match allowed {
            Some(allowed) => allowed.time_of(sequence, elapsed, now),
            None => Some(elapsed).filter(|elapsed| *elapsed > 0.0),
        }
    }

    /// A warning is told, a trip ends the test.
    fn heed(&self, found: Found) -> Result<(), Trip> {
        if let Some(hit) = found.warning {
            // Each time that the level is crossed from inside.
            let text = format!("{hit} ({}): a warning", hit.quantity.key());
            self.note(NoteLevel::Warning, "limit", &text);
        }
        found.trip.map_or(Ok(()), |hit| Err(Trip::Limit(hit)))
    }
}
