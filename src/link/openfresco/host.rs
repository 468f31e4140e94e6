//! The specimen behind an OpenFresco server: the effect of a command, a commit, a request and a step that is taken
//! back.
//!
//! Invariant: the force in [`Host::response`] belongs to the displacement beside it, however often and in whatever order
//! a client requests it. A formula is evaluated once for each new command, a moving specimen once for each command, and
//! neither for a request. No socket, no bytes, no clock.

use thiserror::Error;

use super::Transformation;
use super::matrices::ClientMatrices;
use super::motion::ClientMotion;
use super::remarks::Remark;
use super::role::Nature;
use super::tally::Tally;
use super::trials::Trials;
use super::updated_tangent::UpdatedTangent;
use crate::served::{Computed, Controller, ServedSpecimen, TestEnd, Trip, Wanted};
use gusset_actuator::specimen::Specimen;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{Command, Measurement};
use gusset_quantity::time::Nanos;
use gusset_wire::openfresco::{Course, Matrix, Response};

/// Why a host stops. A formula stays at its last committed state, a physical specimen where it is.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HostFault {
    /// OpenSees gave up a step that a real specimen has already made.
    #[error(
        "the client takes back the step to t = {time} s, which a physical specimen cannot: the \
         test must end here (let the analysis converge without cutting steps, or use an explicit \
         or operator-splitting integrator)"
    )]
    TakenBack {
        /// Test time in s to which the client returns.
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
    /// The client iterates, but the specimen keeps moving between targets.
    #[error(
        "the client sends a second target in the step to t = {time} s, but with `between = \"predict\"` the specimen moves on: use an \
         integrator that does not iterate, or `between = \"rest\"`"
    )]
    Iterates {
        /// Test time of the command, in s.
        time: f64,
    },
    /// The client sends no time, but the specimen keeps moving between targets.
    #[error(
        "the client sends no time: `between = \"predict\"` needs `step_s` in [serve.openfresco] then"
    )]
    NoStep,
    /// A step is not as long as the first, but the specimen keeps moving between targets.
    #[error(
        "the step to t = {time} s has another length ({found} s) than the first ({first} s): `between = \"predict\"` needs equal steps"
    )]
    OtherStep {
        /// Test time of the command, in s.
        time: f64,
        /// Length in s.
        found: f64,
        /// That of the first step.
        first: f64,
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
    /// The server was stopped while it waited for the specimen's answer.
    #[error("the server was stopped")]
    Unwanted,
    /// The specimen cannot take part in this test; the reason was reported when the sizes came.
    #[error("the specimen cannot take part")]
    Unavailable,
}

/// Test time in s beyond which a test is impossible.
const LATEST_S: f64 = 1e9;
/// Relative difference of the lengths of two steps that are equal: they are differences of times.
const SAME_STEP: f64 = 1e-6;

/// A specimen as a server sees it.
#[derive(Debug)]
pub struct Host {
    served: ServedSpecimen,
    nature: Nature,
    step: Option<f64>,
    sequence: u64,
    motion: ClientMotion,
    measured: Measurement,
    pending: bool,
    begun: bool,
    /// Length of the first step of a client whose specimen keeps moving between targets, s.
    first_step: Option<f64>,
    matrices: ClientMatrices,
    /// The tangent of a specimen that only measures, for clients that request it.
    updated: Option<UpdatedTangent>,
    /// Between the displacements of the client and the axes, where they differ.
    transformation: Option<Transformation>,
    trials: Trials,
    tally: Tally,
}

impl Host {
    /// A host of `specimen` in its present committed state, without limits and without a log. `step` is the test time in
    /// s of one step, for clients that send no time; without it such a client drives rate effects by its velocities alone.
    #[must_use]
    pub fn new(specimen: Box<dyn Specimen>, nature: Nature, step: Option<f64>) -> Self {
        let law = Computed::new(specimen, nature == Nature::Physical);
        let (stiffness, mass) = law.reference();
        let name = "specimen".to_owned();
        let served = ServedSpecimen::new(name, Box::new(law), Vec::new(), stiffness, mass);
        Self::of(served, nature, step)
    }

    /// A host of a served: a formula of that nature, or a specimen across another link, which is always physical.
    #[must_use]
    pub fn of(served: ServedSpecimen, nature: Nature, step: Option<f64>) -> Self {
        let n = served.axes();
        let nature = if served.is_remote() {
            Nature::Physical
        } else {
            nature
        };
        Self {
            nature,
            step,
            sequence: 0,
            motion: ClientMotion::zeros(n),
            measured: Measurement::zeros(n),
            pending: false,
            begun: false,
            first_step: None,
            matrices: ClientMatrices::of(&served, n, None),
            updated: None,
            transformation: None,
            trials: Trials::new(n, None),
            tally: Tally::default(),
            served: match nature {
                Nature::Simulated => served,
                Nature::Physical => served.moving(),
            },
        }
    }

    /// Serves clients that command displacements x, of which the axes get B·x. The transformation has as many
    /// rows as the specimen has axes.
    #[must_use]
    pub fn transformed(mut self, mut transformation: Transformation) -> Self {
        let n = transformation.dofs();
        self.motion = ClientMotion::zeros(n);
        self.matrices = ClientMatrices::of(&self.served, n, Some(&mut transformation));
        self.transformation = Some(transformation);
        self
    }

    /// Clients get a tangent that is updated from target to target.
    #[must_use]
    pub fn updating_tangent(mut self, yes: bool) -> Self {
        let n = self.served.axes();
        self.updated = yes.then(|| UpdatedTangent::new(self.served.stiffness(), n));
        self
    }

    /// A physical specimen follows later trials of a step this far from the first one, in m or rad at the client's
    /// scale.
    #[must_use]
    pub fn iterating_within(mut self, distance: Option<f64>) -> Self {
        self.trials = Trials::new(self.served.axes(), distance);
        self
    }

    /// Number of displacements that a client commands.
    #[must_use]
    pub fn axes(&self) -> usize {
        self.motion.disp.len()
    }

    /// Whether the specimen is computed or moves.
    #[must_use]
    pub(crate) const fn nature(&self) -> Nature {
        self.nature
    }

    /// True if each target of a client becomes a path of commands.
    #[must_use]
    pub(crate) const fn is_paced(&self) -> bool {
        self.served.is_paced()
    }

    /// Counts of commands since [`Host::begin`].
    #[must_use]
    pub(crate) const fn tally(&self) -> Tally {
        self.tally
    }

    /// The processor that the log's threads leave to the data.
    pub(crate) fn keep_record_away_from(&mut self, cpu: Option<usize>) {
        self.served.keep_record_away_from(cpu);
    }

    /// Begins a test of a new client. A simulated specimen becomes virgin again; a physical one stays unchanged. One
    /// across another link is connected, and moves before the test for as long as that is `wanted`. Returns remarks for
    /// the operator.
    ///
    /// # Errors
    /// Why the test cannot begin.
    pub(crate) fn begin(
        &mut self,
        controller: &Controller,
        wanted: &mut Wanted<'_>,
    ) -> Result<Vec<String>, TestEnd> {
        self.tally = Tally::default();
        self.pending = false;
        self.begun = false;
        self.first_step = None;
        self.sequence = 0;
        self.motion.restart();
        let told = self.served.begin(controller, wanted)?;
        self.begun = true;
        let at_rest = self.served.measured();
        self.measured.clone_from(at_rest);
        if let Some(updated) = &mut self.updated {
            updated.begin(&at_rest.disp, &at_rest.force);
        }
        match &mut self.transformation {
            None => self.motion.disp.copy_from_slice(&at_rest.disp),
            Some(transformation) => {
                let disp = &mut self.motion.disp;
                disp.fill(0.0);
                transformation.measure(at_rest, disp);
                disp.copy_from_slice(transformation.disp());
            }
        }
        self.motion.commit();
        Ok(told)
    }

    /// True between the sizes of a client and its end.
    #[must_use]
    pub(crate) const fn has_begun(&self) -> bool {
        self.begun
    }

    /// No request came for a while: notices a specimen that is lost. Does not block.
    ///
    /// # Errors
    /// It has.
    pub(crate) fn attend(&mut self) -> Result<(), HostFault> {
        Ok(self.served.attend()?)
    }

    /// The operator's next step, if a trip is latched.
    #[must_use]
    pub(crate) fn next_step(&self) -> Option<String> {
        self.served.next_step()
    }

    /// A warning about the client, for the log and the run folder.
    pub(crate) fn warn(&mut self, remark: Remark) {
        let text = remark.text(self.nature);
        self.served.warn(remark.event(), &text);
    }

    /// A fault with the details of the specimen's link.
    #[must_use]
    pub(crate) fn whole(&self, fault: HostFault) -> String {
        match fault {
            HostFault::Tripped(trip) => self.served.whole(trip),
            other => other.to_string(),
        }
    }

    /// Executes a command. `dt` is the test time since the last commit, where it is known. The host waits for an answer while
    /// it is `wanted`. Real-time: yes.
    ///
    /// # Errors
    /// A step taken back from a physical specimen, a time that cannot be, a force that is not finite.
    pub(crate) fn trial(
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
        if self.motion.is_later(time) {
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
                self.served.revert();
            }
            // A moving specimen may have moved since, and its watchdog learns that the controller is alive.
            (Course::Repeat, Nature::Physical)
            | (Course::First | Course::Step | Course::Iteration | Course::NewOrigin, _) => {}
        }
        // A length that is negative is that of a load factor, not of time; over zero nothing is integrated.
        let known = dt.filter(|dt| *dt >= 0.0).or(self.step);
        let dt = known.filter(|dt| *dt > 0.0).unwrap_or(0.0);
        if self.served.predicts() {
            if course == Course::Step && known.is_none() {
                return Err(HostFault::NoStep);
            }
            self.judge_step(course, command, dt)?;
        }
        self.motion.take(command, dt);
        self.evaluate(dt, wanted)?;
        self.pending = true;
        Ok(())
    }

    /// Judges a target of a specimen that keeps moving between targets.
    fn judge_step(
        &mut self,
        course: Course,
        command: &Response<'_>,
        found: f64,
    ) -> Result<(), HostFault> {
        let time = command.time;
        match course {
            // AlphaOS sends the target of a step again with its last velocity.
            Course::Iteration if command.disp != self.motion.disp => {
                return Err(HostFault::Iterates { time });
            }
            Course::NewOrigin => self.first_step = None,
            Course::Step if found > 0.0 => {
                let first = *self.first_step.get_or_insert(found);
                if (found - first).abs() > SAME_STEP * first {
                    return Err(HostFault::OtherStep { time, found, first });
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The specimen keeps moving while the client computes, if that is due. Returns when the next tick is; none if nothing moves.
    ///
    /// # Errors
    /// The specimen holds.
    pub(crate) fn go_on(&mut self) -> Result<Option<Nanos>, HostFault> {
        Ok(self.served.go_on()?)
    }

    /// The last command is accepted. Without a new one since the last commit there is nothing to do. Real-time: yes.
    pub(crate) fn commit(&mut self) {
        self.tally.commits = self.tally.commits.saturating_add(1);
        if std::mem::take(&mut self.pending) {
            self.served.commit();
            self.motion.commit();
        }
    }

    /// The client wants nothing any more: a specimen that moves comes to rest.
    pub(crate) fn come_to_rest(&mut self) {
        if self.begun {
            self.served.come_to_rest();
        }
    }

    /// The client has disconnected or is refused. A formula forgets uncommitted steps, a physical specimen holds at its last
    /// command, and the log is closed.
    pub(crate) fn end(&mut self, cause: Cause, text: &str) {
        self.begun = false;
        if self.nature == Nature::Simulated {
            self.served.revert();
            self.motion.revert();
        }
        self.served.end(cause, text);
        self.pending = false;
        self.motion.vel.fill(0.0);
    }

    /// Everything that can be measured, for the last command. Real-time: yes.
    pub(crate) fn response(&mut self) -> Response<'_> {
        self.tally.answers = self.tally.answers.saturating_add(1);
        let (disp, force) = match &self.transformation {
            None => (&self.measured.disp[..], &self.measured.force[..]),
            Some(transformation) => (transformation.disp(), transformation.force()),
        };
        Response {
            disp,
            vel: &self.motion.vel,
            accel: &self.motion.accel,
            force,
            time: self.motion.time,
        }
    }

    /// A matrix, row by row. Real-time: yes.
    pub(crate) fn matrix(&mut self, which: Matrix) -> &[f64] {
        self.tally.answers = self.tally.answers.saturating_add(1);
        let transformation = self.transformation.as_mut();
        if let Some(updated) = &mut self.updated {
            updated.take(&self.measured.disp, &self.measured.force);
        }
        let updated = self.updated.as_ref();
        self.matrices
            .get(which, &mut self.served, transformation, updated)
    }

    fn evaluate(&mut self, dt: f64, wanted: &mut dyn FnMut() -> bool) -> Result<(), HostFault> {
        let (disp, vel) = match &mut self.transformation {
            None => (&self.motion.disp[..], &self.motion.vel[..]),
            Some(transformation) => transformation.command(&self.motion.disp, &self.motion.vel),
        };
        if self.nature == Nature::Physical {
            let state = (self.pending, self.tally.commits > 0);
            let units = self.served.units();
            let fault = self.trials.judge(disp, self.motion.time, state, units);
            if let Some(fault) = fault {
                self.served.trip(Trip::Trial(fault));
            }
        }
        let command = Command {
            sequence: self.sequence,
            time: self.motion.time,
            dt,
            disp,
            vel,
        };
        self.sequence += 1;
        let measured = &mut self.measured;
        if !self.served.exchange(&command, dt, wanted, measured)? {
            return Err(HostFault::Unwanted);
        }
        if let Some(transformation) = &mut self.transformation {
            transformation.measure(&self.measured, &self.motion.disp);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
