//! The specimen behind an OpenFresco server: what a command, a commit, a request and a step that is taken back do
//! to it.
//!
//! Invariant: the force that stands in [`Host::response`] belongs to the displacement beside it, however often and
//! in whatever order it is asked for; and a specimen is evaluated once for each new command, never for a
//! request. No socket, no bytes, no clock.

use thiserror::Error;

use crate::specimen::Specimen;
use crate::wire::openfresco::{Course, Matrix, Response};

/// Whether a specimen can go back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Nature {
    /// A formula: a step that is taken back is forgotten, and each client finds it in its virgin state.
    #[default]
    Simulated,
    /// Something that moves, or a gateway to it: a step that is taken back is refused and the test ends, and a new
    /// client finds it as the last one left it.
    Physical,
}

/// Why a host refuses to go on. The specimen is left at its last committed state.
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
    /// Time runs backwards, past what was committed.
    #[error("test time runs backwards to {time} s, past the last committed step")]
    Reversed {
        /// Test time of the command, in s.
        time: f64,
    },
    /// The law gives no finite force.
    #[error("the specimen's force on axis {axis} is {force} at a displacement of {disp}")]
    NotFinite {
        /// Axis, from 1.
        axis: usize,
        /// The displacement.
        disp: f64,
        /// What came out.
        force: f64,
    },
}

/// What a host has done for one client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Commands, repeats included.
    pub commands: u64,
    /// Accepted steps.
    pub commits: u64,
    /// Steps taken back.
    pub taken_back: u64,
    /// Requests answered.
    pub answers: u64,
}

/// A specimen as a server sees it.
#[derive(Debug)]
pub struct Host {
    specimen: Box<dyn Specimen>,
    nature: Nature,
    step: Option<f64>,
    virgin: Vec<f64>,
    disp: Vec<f64>,
    vel: Vec<f64>,
    accel: Vec<f64>,
    force: Vec<f64>,
    time: f64,
    committed_disp: Vec<f64>,
    committed_force: Vec<f64>,
    pending: bool,
    /// By rows, as the wire module wants them.
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    mass: Vec<f64>,
    tangent: Vec<f64>,
    columns: Vec<f64>,
    tally: Tally,
}

impl Host {
    /// A host of `specimen` in its present committed state. `step` is the test time in s of one step, for
    /// clients that send no time; without it such a client drives rate effects by its velocities alone.
    #[must_use]
    pub fn new(specimen: Box<dyn Specimen>, nature: Nature, step: Option<f64>) -> Self {
        let n = specimen.axes();
        let mut virgin = Vec::new();
        specimen.freeze(&mut virgin);
        let (mut k, mut c, mut m) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n * n]);
        specimen.reference(&mut k, &mut c, &mut m);
        let rows = |columns: &[f64]| {
            let mut rows = vec![0.0; n * n];
            transpose(n, columns, &mut rows);
            rows
        };
        Self {
            nature,
            step,
            virgin,
            disp: vec![0.0; n],
            vel: vec![0.0; n],
            accel: vec![0.0; n],
            force: vec![0.0; n],
            time: 0.0,
            committed_disp: vec![0.0; n],
            committed_force: vec![0.0; n],
            pending: false,
            stiffness: rows(&k),
            damping: vec![0.0; n * n],
            mass: rows(&m),
            tangent: vec![0.0; n * n],
            columns: vec![0.0; n * n],
            tally: Tally::default(),
            specimen,
        }
    }

    /// Number of axes.
    #[must_use]
    pub fn axes(&self) -> usize {
        self.disp.len()
    }

    /// What was done since [`Host::begin`].
    #[must_use]
    pub const fn tally(&self) -> Tally {
        self.tally
    }

    /// A new client: a simulated specimen becomes virgin again, a physical one stays as it is.
    ///
    /// # Errors
    /// [`HostFault::NotFinite`] if the specimen has no finite force where it stands.
    pub fn begin(&mut self) -> Result<(), HostFault> {
        self.tally = Tally::default();
        self.pending = false;
        self.time = 0.0;
        self.vel.fill(0.0);
        self.accel.fill(0.0);
        match self.nature {
            Nature::Simulated => {
                self.specimen.thaw(&self.virgin);
                self.specimen.revert();
                self.disp.fill(0.0);
            }
            Nature::Physical => self.disp.copy_from_slice(&self.committed_disp),
        }
        self.evaluate(0.0)?;
        self.specimen.revert();
        self.committed_disp.copy_from_slice(&self.disp);
        self.committed_force.copy_from_slice(&self.force);
        Ok(())
    }

    /// A command has come. `dt` is the test time since the last commit, where it is known. Real-time: yes.
    ///
    /// # Errors
    /// A step taken back from a physical specimen, a time that cannot be, a force that is not finite.
    pub fn trial(
        &mut self,
        course: Course,
        command: &Response<'_>,
        dt: Option<f64>,
    ) -> Result<(), HostFault> {
        self.tally.commands = self.tally.commands.saturating_add(1);
        let time = command.time;
        match (course, self.nature) {
            (Course::Repeat, _) => return Ok(()),
            (Course::Reversed, _) => return Err(HostFault::Reversed { time }),
            (Course::TakenBack, Nature::Physical) => return Err(HostFault::TakenBack { time }),
            (Course::TakenBack, Nature::Simulated) => {
                self.tally.taken_back = self.tally.taken_back.saturating_add(1);
                self.specimen.revert();
            }
            (Course::First | Course::Step | Course::Iteration | Course::NewOrigin, _) => {}
        }
        // A length that is zero or negative is never integrated over.
        let dt = dt.or(self.step).filter(|dt| *dt > 0.0).unwrap_or(0.0);
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
        self.evaluate(dt)?;
        self.pending = true;
        Ok(())
    }

    /// The last command is accepted. Without a new one since the last commit there is nothing to do. Real-time: yes.
    pub fn commit(&mut self) {
        self.tally.commits = self.tally.commits.saturating_add(1);
        if std::mem::take(&mut self.pending) {
            self.specimen.commit();
            self.committed_disp.copy_from_slice(&self.disp);
            self.committed_force.copy_from_slice(&self.force);
        }
    }

    /// The client has gone or is refused: what was not committed is forgotten, the specimen holds.
    pub fn abandon(&mut self) {
        self.specimen.revert();
        self.pending = false;
        self.disp.copy_from_slice(&self.committed_disp);
        self.force.copy_from_slice(&self.committed_force);
        self.vel.fill(0.0);
    }

    /// Everything that can be measured, for the last command. Real-time: yes.
    pub fn response(&mut self) -> Response<'_> {
        self.tally.answers = self.tally.answers.saturating_add(1);
        Response {
            disp: &self.disp,
            vel: &self.vel,
            accel: &self.accel,
            force: &self.force,
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
                self.specimen.tangent(&mut self.columns);
                transpose(self.disp.len(), &self.columns, &mut self.tangent);
                &self.tangent
            }
        }
    }

    fn evaluate(&mut self, dt: f64) -> Result<(), HostFault> {
        self.specimen
            .trial(&self.disp, &self.vel, dt, &mut self.force);
        let numbers = self.force.iter().zip(&self.disp).zip(1..);
        for ((force, disp), axis) in numbers {
            if !force.is_finite() {
                return Err(HostFault::NotFinite {
                    axis,
                    disp: *disp,
                    force: *force,
                });
            }
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

    fn host(law: &str, axes: usize, nature: Nature) -> Host {
        let law: SpecimenLaw = toml::from_str(law).unwrap();
        let mut host = Host::new(law.build(axes).unwrap(), nature, None);
        host.begin().unwrap();
        host
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
        host.trial(Course::Step, &at(&[0.03], 0.01), Some(0.01))
            .unwrap();
        let plastic = host.response().force[0];
        // 60 at 7.5 mm, then 400 N/m.
        assert!((plastic - (60.0 + 400.0 * 0.0225)).abs() < 1e-9);
        host.trial(Course::Iteration, &at(&[0.005], 0.01), Some(0.01))
            .unwrap();
        assert!((host.response().force[0] - 40.0).abs() < 1e-12);
        host.trial(Course::Repeat, &at(&[0.005], 0.01), Some(0.01))
            .unwrap();
        assert!((host.response().force[0] - 40.0).abs() < 1e-12);
        host.commit();
        host.commit();
        assert_eq!(host.tally().commands, 3);
        assert_eq!(host.tally().commits, 2);
    }

    #[test]
    fn a_step_taken_back_is_forgotten_by_a_formula_and_refused_by_what_moves() {
        for nature in [Nature::Simulated, Nature::Physical] {
            let mut host = host(BILINEAR, 1, nature);
            host.trial(Course::First, &at(&[0.0], 0.0), Some(0.0))
                .unwrap();
            host.trial(Course::Step, &at(&[0.004], 0.01), Some(0.01))
                .unwrap();
            host.commit();
            host.trial(Course::Step, &at(&[0.5], 0.02), Some(0.01))
                .unwrap();
            let back = host.trial(Course::TakenBack, &at(&[0.004], 0.01), Some(0.0));
            match nature {
                Nature::Simulated => {
                    back.unwrap();
                    assert!((host.response().force[0] - 32.0).abs() < 1e-12);
                }
                Nature::Physical => {
                    assert_eq!(back, Err(HostFault::TakenBack { time: 0.01 }));
                    host.abandon();
                    assert_eq!(host.response().disp, [0.004]);
                }
            }
            host.trial(Course::Step, &at(&[0.006], 0.015), Some(0.005))
                .unwrap();
            assert!((host.response().force[0] - 48.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_new_client_finds_a_formula_virgin_and_a_rig_as_it_was_left() {
        for (nature, left) in [(Nature::Simulated, 0.0), (Nature::Physical, 69.0)] {
            let mut host = host(BILINEAR, 1, nature);
            host.trial(Course::Step, &at(&[0.03], 0.01), Some(0.01))
                .unwrap();
            host.commit();
            host.begin().unwrap();
            assert!((host.response().force[0] - left).abs() < 1e-9);
        }
    }

    #[test]
    fn a_velocity_that_is_not_sent_is_the_difference_over_the_step() {
        let mut host = host(
            "law = { viscous = { damping_n_s_per_m = 50.0 } }",
            1,
            Nature::Simulated,
        );
        host.trial(Course::Step, &at(&[0.02], 0.1), Some(0.1))
            .unwrap();
        assert!((host.response().force[0] - 10.0).abs() < 1e-12);
        // Time that does not pass drives no rate effect.
        host.trial(Course::Iteration, &at(&[0.04], 0.0), Some(-1.0))
            .unwrap();
        assert_eq!(host.response().force[0], 0.0);
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
