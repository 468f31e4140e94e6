//! The motion that a client commands, in its displacements.

use gusset_wire::openfresco::Response;

/// The signals of the last command, and the displacements of the last commit.
#[derive(Debug)]
pub(super) struct ClientMotion {
    pub disp: Vec<f64>,
    pub vel: Vec<f64>,
    pub accel: Vec<f64>,
    /// Test time, s.
    pub time: f64,
    /// Test time of the command that was furthest from 0, s.
    latest_time: f64,
    pub committed_disp: Vec<f64>,
}

impl ClientMotion {
    /// At rest at zero, for this number of displacements.
    pub(crate) fn zeros(n: usize) -> Self {
        Self {
            disp: vec![0.0; n],
            vel: vec![0.0; n],
            accel: vec![0.0; n],
            time: 0.0,
            latest_time: 0.0,
            committed_disp: vec![0.0; n],
        }
    }

    /// A new client: its test begins at time 0, at rest.
    pub(crate) fn restart(&mut self) {
        self.time = 0.0;
        self.latest_time = 0.0;
        self.vel.fill(0.0);
        self.accel.fill(0.0);
    }

    /// True if this time is further from 0 than all before it. Real-time: yes.
    pub(crate) fn is_later(&mut self, time: f64) -> bool {
        let is_later = time.abs() > self.latest_time;
        if is_later {
            self.latest_time = time.abs();
        }
        is_later
    }

    /// Takes the signals of a command. `dt` is the length of its step, s; 0 if it takes no time. A velocity that the client does not
    /// send is the difference of displacements over the step. Real-time: yes.
    pub(crate) fn take(&mut self, command: &Response<'_>, dt: f64) {
        self.time = command.time;
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
    }

    /// The last command is accepted. Real-time: yes.
    pub(crate) fn commit(&mut self) {
        self.committed_disp.copy_from_slice(&self.disp);
    }

    /// The last command is forgotten.
    pub(crate) fn revert(&mut self) {
        self.disp.copy_from_slice(&self.committed_disp);
    }
}

/// Copies the signals that the client sends; the others keep their value.
pub(super) fn copy(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}
