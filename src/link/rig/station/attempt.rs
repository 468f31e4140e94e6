//! One exchange of a station: what is judged before it leaves, and what is judged of the answer.

use super::allowed::Times;
use super::{Station, USUAL_TICK_S, first, metres, not_finite};
use crate::catalog::event::Remark;
use crate::link::rig::Trip;
use crate::link::rig::columns::Exchange;
use crate::port::limits::{Found, Level};
use crate::rt::os;
use crate::substructure::{Command, Measurement, Status};
use crate::time::Nanos;

/// Whose motion a command is part of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Origin {
    /// A command of the client's test.
    Client,
    /// A command of ours before the test. It has `period_s` for its motion.
    Own { period_s: f64 },
}

impl Origin {
    /// Its value in the column `state`.
    const fn state(self) -> f64 {
        match self {
            Self::Client => Exchange::RUNNING,
            Self::Own { .. } => Exchange::PROBING,
        }
    }
}

/// Answers in a row in which a specimen may say that it holds: as many as a controller's loop puts up with at least.
const HOLDING_IN_A_ROW: u64 = 10;

impl Station {
    pub(super) fn exchange_as(
        &mut self,
        origin: Origin,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        // Only the log wants to know the time.
        let received_ns = self.log.as_ref().map_or(0, |_| os::monotonic_ns());
        if let Some(log) = &mut self.log {
            log.begins(command.time);
        }
        let mut answered_ns = None;
        let mut is_answered = true;
        if self.tripped.is_none() {
            match self.attempt(command, elapsed, origin, wanted, &mut answered_ns) {
                Ok(answered) => is_answered = answered,
                Err(trip) => self.trip(trip),
            }
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
        if !is_answered {
            into.status.0 |= Status::OWED.0;
        }
        if let Some(log) = &mut self.log {
            log.exchange(&Exchange {
                state: answered_ns.map_or(Exchange::KEPT_BACK, |_| origin.state()),
                command,
                elapsed,
                commits: self.commits,
                measured: into,
                trip: self.tripped,
                received_ns,
                answered_ns: answered_ns.unwrap_or(received_ns),
            });
        }
        self.tripped.map_or(Ok(is_answered), Err)
    }

    /// `answered_ns` stays empty for a command that is not passed on. False if its answer is owed, and not
    /// `wanted` any more.
    fn attempt(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        origin: Origin,
        wanted: &mut dyn FnMut() -> bool,
        answered_ns: &mut Option<u64>,
    ) -> Result<bool, Trip> {
        if let Some(axis) = not_finite(command.disp, command.vel) {
            let measured = false;
            return Err(Trip::NotFinite { axis, measured });
        }
        let is_theirs = origin == Origin::Client;
        let time = self.time_of(command, elapsed, origin);
        if let Some(time) = time {
            self.guard.watch.tick_is(time.own);
        }
        if is_theirs
            && let Some((number, place)) = &self.begins
            && command.sequence == *number
            && let Some(axis) = first::elsewhere(
                metres(&self.units, place),
                metres(&self.units, command.disp),
            )
        {
            return Err(Trip::Elsewhere(axis));
        }
        if is_theirs
            && let Some(leaves) = &self.leaves
            && let Some(hit) = first::judge(
                &self.guard.limits,
                leaves,
                metres(&self.units, command.disp),
            )
        {
            return Err(Trip::Limit(hit));
        }
        if is_theirs {
            self.take_up_pace(command, elapsed);
        }
        let found = self.guard.watch.command(metres(&self.units, command.disp));
        self.heed(found)?;
        // Our own small motions before the test are none of the controller's.
        let mut announced = self.announced.as_mut().filter(|_| is_theirs);
        if let Some(announced) = &mut announced {
            announced.command(
                time.map_or(USUAL_TICK_S, |time| time.announced),
                metres(&self.units, command.disp),
            )?;
        }
        self.guard.watch.sent(metres(&self.units, command.disp));
        self.passed_on.clear();
        self.passed_on.extend_from_slice(command.disp);
        if is_theirs {
            (self.stands, self.leaves) = (None, None);
        }
        let outcome = self.rig.trial(command, elapsed, wanted, &mut self.measured);
        *answered_ns = Some(self.log.as_ref().map_or(0, |_| os::monotonic_ns()));
        if !outcome.map_err(Trip::Lost)? {
            return Ok(false);
        }
        self.unsettled += u64::from(self.measured.status.has(Status::UNSETTLED));
        if let Some(axis) = not_finite(&self.measured.disp, &self.measured.force) {
            self.answer_what_was_read();
            let measured = true;
            return Err(Trip::NotFinite { axis, measured });
        }
        self.sound.disp.clone_from(&self.measured.disp);
        self.sound.force.clone_from(&self.measured.force);
        let found = {
            let values = metres(&self.units, &self.measured.disp).zip(
                self.measured
                    .force
                    .iter()
                    .zip(&self.units)
                    .map(|(force, units)| force * units.newtons),
            );
            let found = self.guard.watch.measured(values.clone());
            if let Some(announced) = self.announced.as_mut().filter(|_| is_theirs) {
                announced.measured(values)?;
            }
            found
        };
        self.heed(found)?;
        if self.measured.status.has(Status::SATURATED) {
            return Err(Trip::Saturated);
        }
        if self.measured.status.has(Status::INTERLOCK) {
            return Err(Trip::Interlock);
        }
        self.judge_holding()?;
        Ok(true)
    }

    /// A specimen that holds by its own watchdog is moved by no command, and what it answers belongs to none. Real-time: yes, where
    /// it does not.
    fn judge_holding(&mut self) -> Result<(), Trip> {
        let status = self.measured.status;
        if !status.has(Status::HOLDING) {
            self.holding = 0;
            return Ok(());
        }
        let before = self.holding;
        self.holding = if status.has(Status::HELD) {
            0
        } else {
            before + 1
        };
        // No word of a link.
        self.measured.status.0 &= !Status::HELD.0;
        if before == 0 {
            let text = "the specimen says that it holds by its own watchdog, since commands had stopped: what it answers meanwhile \
                        does not belong to the commands";
            self.warn_once(Remark::SpecimenHolds, text);
        }
        if self.holding > HOLDING_IN_A_ROW {
            return Err(Trip::Holds(self.holding));
        }
        Ok(())
    }

    /// Something that whoever reads the summary must know; there it stands once.
    pub(super) fn warn_once(&mut self, event: Remark, text: &str) {
        match &mut self.log {
            Some(log) if !log.has_warned(text) => log.warn(event, text),
            _ => self.note(event, text),
        }
    }

    /// What is no number goes no further: such an axis is answered with what it read before, and the status says that a sensor
    /// is at its end. Real-time: yes.
    fn answer_what_was_read(&mut self) {
        let Measurement {
            disp,
            force,
            status,
            ..
        } = &mut self.measured;
        let before = self.sound.disp.iter().zip(&self.sound.force);
        for ((disp, force), before) in disp.iter_mut().zip(force).zip(before) {
            if !(disp.is_finite() && force.is_finite()) {
                (*disp, *force) = (*before.0, *before.1);
            }
        }
        status.0 |= Status::SATURATED.0;
    }

    /// A test that goes on begins at its own speed. By that, as it is announced, the acceleration of the first command that moves is
    /// judged, and not from the rest in which the specimen waited. What moves while test time stands still is none of it. Real-time:
    /// yes.
    fn take_up_pace(&mut self, command: &Command<'_>, elapsed: f64) {
        let from = *self.goes_on_from.get_or_insert(command.time);
        // A test that begins does so at rest.
        let goes_on = from > 0.0 && command.time > from;
        let disp = metres(&self.units, command.disp);
        if goes_on && !self.runs && !self.guard.watch.is_at(disp) {
            self.runs = true;
            let steps = metres(&self.units, command.vel).map(|vel| vel * elapsed);
            self.guard.watch.came_by(steps);
        }
    }

    /// The times that a command has for its motion, if anything is known of them. Our own small motions before the test keep to
    /// a pace of ours, and no client decides their time. Real-time: yes.
    fn time_of(&mut self, command: &Command<'_>, elapsed: f64, origin: Origin) -> Option<Times> {
        if let Origin::Own { period_s } = origin {
            return Some(Times::both(period_s));
        }
        let now = self.now.unwrap_or_else(|| Nanos(os::monotonic_ns()));
        let disp = metres(&self.units, command.disp);
        let (time, rested) = self.guard.time_of(command.sequence, elapsed, disp, now);
        if let (true, Some(announced)) = (rested, &mut self.announced) {
            announced.rests();
        }
        time
    }

    /// Warnings are told, and so is what trips beside the first; that ends the test.
    fn heed(&mut self, found: Found) -> Result<(), Trip> {
        let mut untold = found.warning;
        while let Some(hit) = untold.take().or_else(|| self.guard.watch.next_untold()) {
            // Each time that the level is crossed from inside.
            let what = match hit.level {
                Level::Warning => "a warning",
                Level::Trip => "it trips, too",
            };
            let text = format!("{hit} ({}): {what}", hit.quantity.key());
            self.note(Remark::Limit, &text);
        }
        found.trip.map_or(Ok(()), |hit| Err(Trip::Limit(hit)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Station;
    use super::*;
    use crate::link::rig::{Rig, TestEnd, Visitor, Wanted};
    use crate::substructure::{Introduction, LinkFault, Retirement};
    use crate::units::AxisUnits;

    /// Two springs of 10 N/m; from the command with this number on the load cell of the second says no number.
    #[derive(Debug)]
    struct Broken {
        from: u64,
    }

    impl Rig for Broken {
        fn axes(&self) -> usize {
            2
        }
        fn connect(&mut self, _: &Visitor, _: &mut Wanted<'_>) -> Result<Introduction, TestEnd> {
            Ok(Introduction::default())
        }
        fn arm(
            &mut self,
            _: u64,
            _: &[f64],
            _: &mut dyn FnMut() -> bool,
        ) -> Result<bool, LinkFault> {
            Ok(true)
        }
        fn trial(
            &mut self,
            command: &Command<'_>,
            _: f64,
            _: &mut dyn FnMut() -> bool,
            into: &mut Measurement,
        ) -> Result<bool, LinkFault> {
            into.disp.copy_from_slice(command.disp);
            into.force = command.disp.iter().map(|disp| 10.0 * disp).collect();
            if command.sequence >= self.from {
                into.force[1] = f64::NAN;
            }
            Ok(true)
        }
        fn commit(&mut self) -> Result<(), LinkFault> {
            Ok(())
        }
        fn revert(&mut self) {}
        fn tangent(&mut self, _: &mut [f64]) {}
        fn end(&mut self, _: Retirement) -> Option<String> {
            None
        }
    }

    #[test]
    fn a_sensor_without_a_number_is_answered_with_what_it_read_last_and_marked() {
        let units = vec![AxisUnits::SI; 2];
        let mut station = Station::new(
            "rig".into(),
            Box::new(Broken { from: 3 }),
            units,
            vec![0.0; 4],
            vec![0.0; 4],
        );
        let visitor = Visitor::unnamed(([127, 0, 0, 1], 1).into());
        station.begin(&visitor, &mut || Ok(())).unwrap();
        let mut into = Measurement::zeros(2);
        let mut exchange = |sequence: u64| {
            let disp = [0.5 * sequence as f64, 0.25 * sequence as f64];
            let command = Command {
                sequence,
                time: 0.0,
                dt: 0.01,
                disp: &disp,
                vel: &[0.0; 2],
            };
            let trip = station
                .exchange(&command, 0.01, &mut || true, &mut into)
                .err();
            (trip, into.clone())
        };
        for sequence in 0..=2 {
            assert_eq!(exchange(sequence).0, None);
        }
        let (axis, measured) = (1, true);
        let is_none = Some(Trip::NotFinite { axis, measured });
        // And so it stays.
        for sequence in 3..=4 {
            let (trip, into) = exchange(sequence);
            assert_eq!(trip, is_none);
            assert_eq!((into.disp, into.force), (vec![1.5, 0.5], vec![15.0, 5.0]));
            assert!(into.status.has(Status::INTERLOCK) && into.status.has(Status::SATURATED));
        }
    }

    /// Stands for three commands at test time `from`, and then goes on by 0.1 m in each 0.01 s, with a limit that bounds any change
    /// of that speed. Whether it trips, and where.
    fn goes_on(from: f64, vel: f64, steps: &[f64]) -> Option<u64> {
        let limits: crate::config::LimitsSpec =
            toml::from_str("command_accel_m_per_s2 = { trip = 50.0 }").unwrap();
        let units = vec![AxisUnits::SI; 2];
        let rig = Box::new(Broken { from: u64::MAX });
        let station = Station::new("rig".into(), rig, units, vec![0.0; 4], vec![0.0; 4]);
        let mut station = station.limited(&[limits; 2]);
        let visitor = Visitor::unnamed(([127, 0, 0, 1], 1).into());
        station.begin(&visitor, &mut || Ok(())).unwrap();
        let mut into = Measurement::zeros(2);
        let (mut time, mut disp) = (from, [0.0; 2]);
        let still = [0.0; 3];
        (0..)
            .zip(still.iter().chain(steps))
            .find_map(|(sequence, step)| {
                let dt = if sequence < 3 { 0.0 } else { 0.01 };
                time += dt;
                disp = disp.map(|disp| disp + step);
                let command = Command {
                    sequence,
                    time,
                    dt,
                    disp: &disp,
                    vel: &[if dt > 0.0 { vel } else { 0.0 }; 2],
                };
                let trip = station
                    .exchange(&command, 0.01, &mut || true, &mut into)
                    .err();
                trip.map(|_| sequence)
            })
    }

    #[test]
    fn the_first_step_of_a_test_that_goes_on_is_judged_by_its_announced_speed_and_no_other_is() {
        let steady = [0.1; 5];
        assert_eq!(goes_on(2.0, 10.0, &steady), None);
        // It begins, or comes faster than it says, or changes its speed later.
        assert_eq!(goes_on(0.0, 10.0, &steady), Some(3));
        assert_eq!(goes_on(2.0, 0.0, &steady), Some(3));
        assert_eq!(goes_on(2.0, 10.0, &[0.1, 0.1, 0.0]), Some(5));
        assert_eq!(goes_on(2.0, 10.0, &[0.1, 0.2]), Some(4));
        // It is told once more where it stands.
        assert_eq!(goes_on(2.0, 10.0, &[0.0, 0.1, 0.1]), None);
    }
}
