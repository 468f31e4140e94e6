//! The specimen behind an OpenFresco server: what a command, a commit, a request and a step that is taken back do
//! to it.
//!
//! Invariant: the force that stands in [`Host::response`] belongs to the displacement beside it, however often and
//! in whatever order it is asked for; and a formula is evaluated once for each new command, what moves for each one that
//! comes, neither ever for a request. No socket, no bytes, no clock.

use thiserror::Error;

use super::Transformation;
use super::remarks::Remark;
use super::role::Nature;
use super::tally::Tally;
use crate::catalog::ending::Cause;
use crate::link::rig::{Law, Rig as _, Station, TestEnd, Trip, Visitor, Wanted};
use crate::specimen::Specimen;
use crate::substructure::{Command, Measurement};
use crate::units::AxisUnits;
use crate::wire::openfresco::{Course, Matrix, Response};

/// Why a host refuses to go on. A formula is left at its last committed state, what moves where it is.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HostFault {
    /// OpenSees gave up a step that a real specimen has already made.
    #[error(
        "the client takes back the step to t = {time} s, which a physical specimen cannot: the \
         test must end here (let the analysis converge without cutting steps, or use an explicit \
         or operator-splitting integrator)"
    )]
    TakenBack {
        /// Test time in s that the client goes back to.
        time: f64,
    },
    /// OpenSees gave up more than a step.
    #[error(
        "the client goes back to t = {time} s, past the last committed step, which a physical \
         specimen cannot: the test must end here"
    )]
    Reversed {
        /// Test time of the command, in s.
        time: f64,
    },
    /// No test takes so long.
    #[error("test time {time} s is beyond what can be")]
    Leap {
        /// Test time of the command, in s.
        time: f64,
    },
    /// The specimen holds: a limit, an interlock, or a lost link.
    #[error("{holds}{trip}", trip = .0, holds = if matches!(.0, Trip::Lost(_)) { "" } else { "the specimen holds: " })]
    Tripped(#[from] Trip),
    /// The server was told to stop while the specimen's answer was waited for.
    #[error("the server was stopped")]
    Unwanted,
    /// The specimen cannot take part in this test; why was told when the sizes came.
    #[error("the specimen cannot take part")]
    Unavailable,
}

/// Test time in s beyond which there is no test.
const LATEST_S: f64 = 1e9;

/// A specimen as a server sees it.
#[derive(Debug)]
pub struct Host {
    station: Station,
    nature: Nature,
    step: Option<f64>,
    sequence: u64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    accel: Vec<f64>,
    measured: Measurement,
    time: f64,
    /// Test time of a command that was furthest from 0, in s.
    latest_time: f64,
    committed_disp: Vec<f64>,
    pending: bool,
    begun: bool,
    /// By rows, as the wire module wants them.
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    mass: Vec<f64>,
    tangent: Vec<f64>,
    columns: Vec<f64>,
    /// Between the displacements of the client and the axes, where they differ.
    transformation: Option<Transformation>,
    tally: Tally,
}

impl Host {
    /// A host of `specimen` in its present committed state, without limits and without a log. `step` is the test time in
    /// s of one step, for clients that send no time; without it such a client drives rate effects by its velocities alone.
    #[must_use]
    pub fn new(specimen: Box<dyn Specimen>, nature: Nature, step: Option<f64>) -> Self {
        let law = Law::new(specimen, nature == Nature::Physical);
        let (stiffness, mass) = law.reference();
        let units = vec![AxisUnits::SI; law.axes()];
        let station = Station::new("specimen".into(), Box::new(law), units, stiffness, mass);
        Self::of(station, nature, step)
    }

    /// A host of a station: a formula of that nature, or a specimen across another link, which is always physical.
    #[must_use]
    pub fn of(station: Station, nature: Nature, step: Option<f64>) -> Self {
        let n = station.axes();
        let rows = |columns: &[f64]| {
            let mut rows = vec![0.0; n * n];
            transpose(n, columns, &mut rows);
            rows
        };
        let nature = if station.is_remote() {
            Nature::Physical
        } else {
            nature
        };
        Self {
            nature,
            step,
            sequence: 0,
            disp: vec![0.0; n],
            vel: vec![0.0; n],
            accel: vec![0.0; n],
            measured: Measurement::zeros(n),
            time: 0.0,
            latest_time: 0.0,
            committed_disp: vec![0.0; n],
            pending: false,
            begun: false,
            stiffness: rows(station.stiffness()),
            damping: vec![0.0; n * n],
            mass: rows(station.mass()),
            tangent: vec![0.0; n * n],
            columns: vec![0.0; n * n],
            transformation: None,
            tally: Tally::default(),
            station: match nature {
                Nature::Simulated => station,
                Nature::Physical => station.moving(),
            },
        }
    }

    /// Serves clients that command displacements x, of which the axes get B·x. The transformation has as many
    /// rows as the specimen has axes.
    #[must_use]
    pub fn transformed(mut self, mut transformation: Transformation) -> Self {
        let n = transformation.dofs();
        for values in [
            &mut self.disp,
            &mut self.vel,
            &mut self.accel,
            &mut self.committed_disp,
        ] {
            *values = vec![0.0; n];
        }
        for (rows, columns) in [
            (&mut self.stiffness, self.station.stiffness()),
            (&mut self.mass, self.station.mass()),
        ] {
            *rows = vec![0.0; n * n];
            transformation.matrix(columns, rows);
        }
        self.damping = vec![0.0; n * n];
        self.tangent = vec![0.0; n * n];
        self.transformation = Some(transformation);
        self
    }

    /// Number of displacements that a client commands.
    #[must_use]
    pub fn axes(&self) -> usize {
        self.disp.len()
    }

    /// Whether the specimen is computed or moves.
    #[must_use]
    pub const fn nature(&self) -> Nature {
        self.nature
    }

    /// What was done since [`Host::begin`].
    #[must_use]
    pub const fn tally(&self) -> Tally {
        self.tally
    }

    /// The processor that the log's threads leave to the data.
    pub fn keep_log_away_from(&mut self, cpu: Option<usize>) {
        self.station.keep_log_away_from(cpu);
    }

    /// A new client: a simulated specimen becomes virgin again, a physical one stays as it is, one across another link is
    /// connected, and moves before the test for as long as that is `wanted`. Returns what whoever watches should know.
    ///
    /// # Errors
    /// Why there is no test.
    pub fn begin(
        &mut self,
        visitor: &Visitor,
        wanted: &mut Wanted<'_>,
    ) -> Result<Vec<String>, TestEnd> {
        self.tally = Tally::default();
        self.pending = false;
        self.begun = false;
        self.time = 0.0;
        self.latest_time = 0.0;
        self.sequence = 0;
        self.vel.fill(0.0);
        self.accel.fill(0.0);
        let told = self.station.begin(visitor, wanted)?;
        self.begun = true;
        let at_rest = self.station.measured();
        self.measured.clone_from(at_rest);
        match &mut self.transformation {
            None => self.disp.copy_from_slice(&at_rest.disp),
            Some(transformation) => {
                self.disp.fill(0.0);
                transformation.measure(at_rest, &self.disp);
                self.disp.copy_from_slice(transformation.disp());
            }
        }
        self.committed_disp.copy_from_slice(&self.disp);
        Ok(told)
    }

    /// True between the sizes of a client and its end.
    #[must_use]
    pub const fn has_begun(&self) -> bool {
        self.begun
    }

    /// Nothing was asked for a while: notices a specimen that has gone. Does not block.
    ///
    /// # Errors
    /// It has.
    pub fn attend(&mut self) -> Result<(), HostFault> {
        Ok(self.station.attend()?)
    }

    /// The operator's next step, if a trip is latched.
    #[must_use]
    pub fn next_step(&self) -> Option<String> {
        self.station.next_step()
    }

    /// A warning about the client, for the log and the run folder.
    pub(in crate::link) fn warn(&mut self, remark: Remark) {
        let text = remark.text(self.nature);
        self.station.warn(remark.event(), &text);
    }

    /// A fault with what the specimen's link has to say.
    #[must_use]
    pub fn whole(&self, fault: HostFault) -> String {
        match fault {
            HostFault::Tripped(trip) => self.station.whole(trip),
            other => other.to_string(),
        }
    }

    /// A command has come. `dt` is the test time since the last commit, where it is known; an answer is waited for as long as it is
    /// `wanted`. Real-time: yes.
    ///
    /// # Errors
    /// A step taken back from a physical specimen, a time that cannot be, a force that is not finite.
    pub fn trial(
        &mut self,
        course: Course,
        command: &Response<'_>,
        dt: Option<f64>,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<(), HostFault> {
        if !self.begun {
            return Err(HostFault::Unavailable);
        }
        self.tally.commands = self.tally.commands.saturating_add(1);
        let time = command.time;
        if !(time.abs() <= LATEST_S && dt.is_none_or(|dt| dt <= LATEST_S)) {
            return Err(HostFault::Leap { time });
        }
        if time.abs() > self.latest_time {
            self.latest_time = time.abs();
            self.tally.later_times = self.tally.later_times.saturating_add(1);
        }
        if course == Course::Repeat {
            self.tally.repeats = self.tally.repeats.saturating_add(1);
        }
        match (course, self.nature) {
            (Course::Repeat, Nature::Simulated) => return Ok(()),
            (Course::Reversed, Nature::Physical) => return Err(HostFault::Reversed { time }),
            (Course::TakenBack, Nature::Physical) => return Err(HostFault::TakenBack { time }),
            (Course::TakenBack | Course::Reversed, Nature::Simulated) => {
                self.tally.taken_back = self.tally.taken_back.saturating_add(1);
                self.station.revert();
            }
            // What moves may have done so since, and whoever watches it hears that its controller is there.
            (Course::Repeat, Nature::Physical)
            | (Course::First | Course::Step | Course::Iteration | Course::NewOrigin, _) => {}
        }
        // A length that is negative is that of a load factor, not of time; over zero nothing is integrated.
        let known = dt.filter(|dt| *dt >= 0.0).or(self.step);
        let dt = known.filter(|dt| *dt > 0.0).unwrap_or(0.0);
        self.time = time;
        copy(&mut self.disp, command.disp);
        copy(&mut self.accel, command.accel);
        if command.vel.is_empty() {
            let travelled = self.disp.iter().zip(&self.committed_disp);
            for (vel, (new, old)) in self.vel.iter_mut().zip(travelled) {
                *vel = if dt > 0.0 { (new - old) / dt } else { 0.0 };
            }
        } else {
            copy(&mut self.vel, command.vel);
        }
        self.evaluate(dt, wanted)?;
        self.pending = true;
        Ok(())
    }

    /// The last command is accepted. Without a new one since the last commit there is nothing to do. Real-time: yes.
    pub fn commit(&mut self) {
        self.tally.commits = self.tally.commits.saturating_add(1);
        if std::mem::take(&mut self.pending) {
            self.station.commit();
            self.committed_disp.copy_from_slice(&self.disp);
        }
    }

    /// The client has gone or is refused: a formula forgets what was not committed, what moves holds where it was led last, and
    /// the log is closed.
    pub fn end(&mut self, cause: Cause, text: &str) {
        self.begun = false;
        if self.nature == Nature::Simulated {
            self.station.revert();
            self.disp.copy_from_slice(&self.committed_disp);
        }
        self.station.end(cause, text);
        self.pending = false;
        self.vel.fill(0.0);
    }

    /// Everything that can be measured, for the last command. Real-time: yes.
    pub fn response(&mut self) -> Response<'_> {
        self.tally.answers = self.tally.answers.saturating_add(1);
        let (disp, force) = match &self.transformation {
            None => (&self.measured.disp[..], &self.measured.force[..]),
            Some(transformation) => (transformation.disp(), transformation.force()),
        };
        Response {
            disp,
            vel: &self.vel,
            accel: &self.accel,
            force,
            time: self.time,
        }
    }

    /// A matrix, row by row. The damping matrix is zero: OpenSees' `genericClient` adds damping · velocity to the
    /// force it reads (seen with 3.7.1: a damper of 40 N s/m acts as one of 80), and what a damper resists is in our
    /// force already, as it is in every measured one. Real-time: yes.
    pub fn matrix(&mut self, which: Matrix) -> &[f64] {
        self.tally.answers = self.tally.answers.saturating_add(1);
        match which {
            Matrix::InitialStiffness => &self.stiffness,
            Matrix::Damping => &self.damping,
            Matrix::Mass => &self.mass,
            Matrix::TangentStiffness => {
                self.station.tangent(&mut self.columns);
                match &mut self.transformation {
                    None => transpose(self.disp.len(), &self.columns, &mut self.tangent),
                    Some(transformation) => {
                        transformation.matrix(&self.columns, &mut self.tangent);
                    }
                }
                &self.tangent
            }
        }
    }

    fn evaluate(&mut self, dt: f64, wanted: &mut dyn FnMut() -> bool) -> Result<(), HostFault> {
        let (disp, vel) = match &mut self.transformation {
            None => (&self.disp[..], &self.vel[..]),
            Some(transformation) => transformation.command(&self.disp, &self.vel),
        };
        let command = Command {
            sequence: self.sequence,
            time: self.time,
            dt,
            disp,
            vel,
        };
        self.sequence += 1;
        let measured = &mut self.measured;
        if !self.station.exchange(&command, dt, wanted, measured)? {
            return Err(HostFault::Unwanted);
        }
        if let Some(transformation) = &mut self.transformation {
            transformation.measure(&self.measured, &self.disp);
        }
        Ok(())
    }
}

/// As many as there are; a kind that the client does not send leaves what was there.
fn copy(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

fn transpose(n: usize, columns: &[f64], rows: &mut [f64]) {
    for (i, row) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        for (value, column) in row.iter_mut().zip(columns.iter().skip(i).step_by(n.max(1))) {
            *value = *column;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::SpecimenLaw;
    use crate::time::Nanos;

    fn host(law: &str, axes: usize, nature: Nature) -> Host {
        let law: SpecimenLaw = toml::from_str(law).unwrap();
        let law = Law::new(law.build(axes).unwrap(), nature == Nature::Physical);
        let (stiffness, mass) = law.reference();
        // Steps are bounded, as they must be for a first one of some length to what moves.
        let limits = toml::from_str("command_step_m = { trip = 1.0 }").unwrap();
        let units = vec![AxisUnits::SI; axes];
        let station = Station::new("rig".into(), Box::new(law), units, stiffness, mass);
        let mut host = Host::of(station.limited(&vec![limits; axes]), nature, None);
        host.begin(&visitor(), &mut || Ok(())).unwrap();
        host
    }

    fn visitor() -> Visitor {
        Visitor::unnamed(([127, 0, 0, 1], 1).into())
    }

    const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";

    fn at<'a>(disp: &'a [f64], time: f64) -> Response<'a> {
        Response {
            disp,
            time,
            ..Response::default()
        }
    }

    #[test]
    fn iterations_start_from_the_committed_state_and_repeats_change_nothing() {
        let mut host = host(BILINEAR, 1, Nature::Simulated);
        host.trial(Course::Step, &at(&[0.03], 0.01), Some(0.01), &mut || true)
            .unwrap();
        let plastic = host.response().force[0];
        // 60 at 7.5 mm, then 400 N/m.
        assert!((plastic - (60.0 + 400.0 * 0.0225)).abs() < 1e-9);
        host.trial(
            Course::Iteration,
            &at(&[0.005], 0.01),
            Some(0.01),
            &mut || true,
        )
        .unwrap();
        assert!((host.response().force[0] - 40.0).abs() < 1e-12);
        host.trial(Course::Repeat, &at(&[0.005], 0.01), Some(0.01), &mut || {
            true
        })
        .unwrap();
        assert!((host.response().force[0] - 40.0).abs() < 1e-12);
        host.commit();
        host.commit();
        assert_eq!(host.tally().commands, 3);
        assert_eq!(host.tally().commits, 2);
    }

    #[test]
    fn a_formula_passes_over_a_repeat_and_what_moves_measures_anew() {
        for (nature, evaluated) in [(Nature::Simulated, 1), (Nature::Physical, 2)] {
            let mut host = host(BILINEAR, 1, nature);
            for course in [Course::Step, Course::Repeat] {
                host.trial(course, &at(&[0.005], 0.01), Some(0.01), &mut || true)
                    .unwrap();
            }
            assert_eq!(host.sequence, evaluated);
            assert!((host.response().force[0] - 40.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_load_factor_that_falls_is_no_length_of_a_step() {
        let law: SpecimenLaw = toml::from_str(
            "law = { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 50.0 } }",
        )
        .unwrap();
        let law = law.build(1).unwrap();
        let mut host = Host::new(law, Nature::Simulated, Some(0.1));
        host.begin(&visitor(), &mut || Ok(())).unwrap();
        host.trial(
            Course::Iteration,
            &at(&[0.02], 40.0),
            Some(-7.0),
            &mut || true,
        )
        .unwrap();
        // One step as the file says.
        assert!((host.response().force[0] - 10.0).abs() < 1e-12);
    }

    #[test]
    fn a_formula_follows_its_client_past_the_last_commit_and_what_moves_does_not() {
        for nature in [Nature::Simulated, Nature::Physical] {
            let mut host = host(BILINEAR, 1, nature);
            host.trial(Course::Step, &at(&[0.004], 0.02), Some(0.02), &mut || true)
                .unwrap();
            host.commit();
            let back = host.trial(
                Course::Reversed,
                &at(&[0.003], 0.01),
                Some(0.0),
                &mut || true,
            );
            match nature {
                Nature::Simulated => {
                    back.unwrap();
                    assert!((host.response().force[0] - 24.0).abs() < 1e-12);
                    assert_eq!(host.tally().taken_back, 1);
                }
                Nature::Physical => assert_eq!(back, Err(HostFault::Reversed { time: 0.01 })),
            }
        }
    }

    #[test]
    fn only_commands_of_a_later_time_than_all_before_count_as_such() {
        let mut host = host(BILINEAR, 1, Nature::Simulated);
        for test in 0..2 {
            // A step of three tries, one that is taken back and cut, and the next one.
            let sign = [1.0, -1.0][test];
            for time in [0.0, 0.01, 0.01, 0.01, 0.0, 0.005, 0.01, 0.02] {
                let disp = [time];
                let command = at(&disp, sign * time);
                host.trial(Course::Iteration, &command, None, &mut || true)
                    .unwrap();
            }
            assert_eq!(host.tally().later_times, 2, "{test}");
            host.begin(&visitor(), &mut || Ok(())).unwrap();
            assert_eq!(host.tally().later_times, 0);
        }
    }

    #[test]
    fn a_time_that_cannot_be_is_refused() {
        let mut host = host(BILINEAR, 1, Nature::Simulated);
        for time in [1e300, -1e300] {
            let fault = host.trial(Course::Step, &at(&[0.001], time), Some(time), &mut || true);
            assert_eq!(fault, Err(HostFault::Leap { time }));
        }
    }

    #[test]
    fn a_step_that_hardly_takes_time_passes_no_limit_that_is_not_there() {
        for time in [5e-324, 1e-200] {
            let mut host = host(BILINEAR, 1, Nature::Simulated);
            for _ in 0..2 {
                host.trial(Course::Step, &at(&[time], time), Some(time), &mut || true)
                    .unwrap();
                host.commit();
            }
        }
    }

    #[test]
    fn a_step_taken_back_is_forgotten_by_a_formula_and_refused_by_what_moves() {
        for nature in [Nature::Simulated, Nature::Physical] {
            let mut host = host(BILINEAR, 1, nature);
            host.trial(Course::First, &at(&[0.0], 0.0), Some(0.0), &mut || true)
                .unwrap();
            host.trial(Course::Step, &at(&[0.004], 0.01), Some(0.01), &mut || true)
                .unwrap();
            host.commit();
            host.trial(Course::Step, &at(&[0.5], 0.02), Some(0.01), &mut || true)
                .unwrap();
            let back = host.trial(
                Course::TakenBack,
                &at(&[0.004], 0.01),
                Some(0.0),
                &mut || true,
            );
            match nature {
                Nature::Simulated => {
                    back.unwrap();
                    assert!((host.response().force[0] - 32.0).abs() < 1e-12);
                }
                Nature::Physical => {
                    assert_eq!(back, Err(HostFault::TakenBack { time: 0.01 }));
                    assert_eq!(host.committed_disp, [0.004]);
                }
            }
            host.trial(Course::Step, &at(&[0.006], 0.015), Some(0.005), &mut || {
                true
            })
            .unwrap();
            assert!((host.response().force[0] - 48.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_new_client_finds_a_formula_virgin_and_a_rig_as_it_was_left() {
        for (nature, left) in [(Nature::Simulated, 0.0), (Nature::Physical, 69.0)] {
            let mut host = host(BILINEAR, 1, nature);
            host.trial(Course::Step, &at(&[0.03], 0.01), Some(0.01), &mut || true)
                .unwrap();
            host.commit();
            host.begin(&visitor(), &mut || Ok(())).unwrap();
            assert!((host.response().force[0] - left).abs() < 1e-9);
        }
    }

    #[test]
    fn what_a_client_did_not_commit_before_it_went_is_forgotten_by_a_formula_and_stays_with_what_moves()
     {
        for (nature, stands, force) in [
            (Nature::Simulated, 0.0, 0.0),
            (Nature::Physical, 0.01, 61.0),
        ] {
            let mut host = host(BILINEAR, 1, nature);
            host.trial(Course::Step, &at(&[0.005], 0.01), Some(0.01), &mut || true)
                .unwrap();
            host.commit();
            host.trial(Course::Step, &at(&[0.01], 0.02), Some(0.01), &mut || true)
                .unwrap();
            host.end(Cause::Protocol, "");
            host.begin(&visitor(), &mut || Ok(())).unwrap();
            assert_eq!(host.response().disp, [stands]);
            assert!((host.response().force[0] - force).abs() < 1e-9);
        }
    }

    /// What moves, within limits.
    fn limited(limits: &str) -> Host {
        let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
        let law = Law::new(law.build(1).unwrap(), true);
        let limits = toml::from_str(limits).unwrap();
        let units = vec![AxisUnits::SI];
        let station = Station::new("rig".into(), Box::new(law), units, vec![8e3], vec![0.0]);
        Host::of(station.limited(&[limits]), Nature::Physical, None)
    }

    #[test]
    fn the_first_command_is_a_step_from_where_the_specimen_stands() {
        let mut host = limited("command_step_m = { trip = 0.00101 }");
        host.begin(&visitor(), &mut || Ok(())).unwrap();
        for k in 1..=40 {
            let time = 0.01 * f64::from(k);
            let command = [1e-3 * f64::from(k)];
            host.trial(Course::Step, &at(&command, time), Some(0.01), &mut || true)
                .unwrap();
            host.commit();
        }
        host.end(Cause::Done, "");
        // As genericClient does: it begins at zero, whatever the specimen stands at.
        let told = host.begin(&visitor(), &mut || Ok(())).unwrap();
        assert!(told.iter().any(|text| text.contains("is at 40 mm")));
        assert_eq!(host.response().disp, [0.04]);
        let fault = host.trial(Course::First, &at(&[0.0], 0.0), None, &mut || true);
        let text = host.whole(fault.unwrap_err());
        assert!(text.contains("command_step_m"), "{text}");
        assert!(text.contains("is at 40 mm"), "{text}");
        host.end(Cause::Protocol, "");
        let over = host.begin(&visitor(), &mut || Ok(())).unwrap_err();
        assert!(over.text.contains("command_step_m"), "{}", over.text);
        host.station.latch().clear().unwrap();
        host.begin(&visitor(), &mut || Ok(())).unwrap();
        host.trial(Course::First, &at(&[0.0395], 0.0), None, &mut || true)
            .unwrap();
        let fault = host.trial(Course::Step, &at(&[0.0], 0.01), Some(0.01), &mut || true);
        let text = host.whole(fault.unwrap_err());
        assert!(!text.contains("stands"), "{text}");
    }

    #[test]
    fn a_first_command_whose_step_nothing_bounds_goes_a_twentieth_of_the_range_or_a_millimetre() {
        for (limits, holds, trips) in [
            ("command_disp_m = { trip = [-0.05, 0.05] }", 0.0049, 0.0051),
            (
                "command_disp_m = { warn = [-0.05, 0.05] }",
                0.00099,
                0.00101,
            ),
            (
                "measured_force_n = { trip = [-900, 900] }",
                0.00099,
                0.00101,
            ),
            ("command_step_m = { trip = 0.02 }", 0.019, 0.021),
            // Whoever bounds the speed has bounded the step of a tick.
            ("command_vel_m_per_s = { trip = 10.0 }", 0.05, 0.11),
        ] {
            for disp in [holds, trips] {
                let mut host = limited(limits);
                host.begin(&visitor(), &mut || Ok(())).unwrap();
                let outcome = host.trial(Course::First, &at(&[disp], 0.0), None, &mut || true);
                assert_eq!(
                    outcome.is_ok(),
                    disp == holds,
                    "{limits} {disp}: {outcome:?}"
                );
                if outcome.is_ok() {
                    host.commit();
                    // What follows is not judged so.
                    let next = [disp.mul_add(2.0, 1e-4)];
                    let next = host.trial(Course::Step, &at(&next, 0.01), Some(0.01), &mut || true);
                    assert!(next.is_ok(), "{limits}: {next:?}");
                }
            }
        }
        // A formula is not moved.
        let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
        let mut host = Host::new(law.build(1).unwrap(), Nature::Simulated, None);
        host.begin(&visitor(), &mut || Ok(())).unwrap();
        host.trial(Course::First, &at(&[0.04], 0.0), None, &mut || true)
            .unwrap();
    }

    #[test]
    fn the_speed_of_what_moves_is_judged_by_the_wall() {
        // A millimetre in 0.02 s of test time, every 0.02 s or every 0.2 ms.
        for (period_ns, holds) in [(20_000_000, true), (200_000, false)] {
            let mut host = limited("command_vel_m_per_s = { trip = 0.11 }");
            host.begin(&visitor(), &mut || Ok(())).unwrap();
            let tripped = (1..=40_u32).any(|k| {
                host.station.now_is(Nanos(u64::from(k) * period_ns));
                let (disp, time) = ([1e-3 * f64::from(k)], 0.02 * f64::from(k));
                let outcome = host.trial(Course::Step, &at(&disp, time), Some(0.02), &mut || true);
                host.commit();
                outcome.is_err()
            });
            assert_eq!(tripped, !holds, "every {period_ns} ns");
        }
    }

    #[test]
    fn a_velocity_that_is_not_sent_is_the_difference_over_the_step() {
        let mut host = host(
            "law = { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 50.0 } }",
            1,
            Nature::Simulated,
        );
        host.trial(Course::Step, &at(&[0.02], 0.1), Some(0.1), &mut || true)
            .unwrap();
        assert!((host.response().force[0] - 10.0).abs() < 1e-12);
        // Time that does not pass drives no rate effect.
        host.trial(
            Course::Iteration,
            &at(&[0.04], 0.0),
            Some(-1.0),
            &mut || true,
        )
        .unwrap();
        assert_eq!(host.response().force[0], 0.0);
    }

    #[test]
    fn a_step_that_begins_where_the_last_one_ended_begins_with_its_tangent() {
        let mut host = host(BILINEAR, 1, Nature::Simulated);
        for (disp, tangent) in [(0.005, 8e3), (0.03, 400.0), (0.03, 400.0), (0.029, 8e3)] {
            host.trial(Course::Step, &at(&[disp], 0.01), Some(0.01), &mut || true)
                .unwrap();
            assert_eq!(host.matrix(Matrix::TangentStiffness), [tangent], "{disp}");
            host.commit();
        }
    }

    #[test]
    fn matrices_come_row_by_row() {
        let law = "coupled = { stiffness_n_per_m = [[2.0, -1.0], [-1.0, 3.0]] }";
        let mut host = host(law, 2, Nature::Simulated);
        assert_eq!(
            host.matrix(Matrix::InitialStiffness),
            [2.0, -1.0, -1.0, 3.0]
        );
        assert_eq!(
            host.matrix(Matrix::TangentStiffness),
            [2.0, -1.0, -1.0, 3.0]
        );
        assert_eq!(host.matrix(Matrix::Mass), [0.0; 4]);
        let mut rows = [0.0; 4];
        transpose(2, &[1.0, 2.0, 3.0, 4.0], &mut rows);
        assert_eq!(rows, [1.0, 3.0, 2.0, 4.0]);
    }
}
