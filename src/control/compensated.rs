//! The compensators of a port: one per axis, in m at the specimen, between the command that the target asks for and the one
//! that is sent.
//!
//! Until the test runs they hold: whatever comes before (static load, ramps, warm-up) is quasi-static, passes as a place at
//! rest does, with the gain that a compensator makes up for and no lead, and is the history that the first prediction starts
//! from. A tick in which time stands still, or without a fresh measurement,
//! teaches them nothing.

use super::Port;
use crate::compensation::{Compensator, Parameter};

/// Compensators of one port.
#[derive(Debug)]
pub(super) struct Compensation {
    of: Vec<Box<dyn Compensator>>,
    /// Metres in one unit of each axis.
    metres: Vec<f64>,
    /// Tick in s of wall time, and seconds of test time in one of wall time.
    tick: f64,
    pace: f64,
    running: bool,
    /// A command that was made of a target is in force, and its measurement is still to come.
    asked: bool,
    vel: Vec<f64>,
    /// The state before the command that stands ready was made, where a record is followed to be gone on with.
    before: Option<Vec<f64>>,
}

/// Relative difference of two displacements that are the same.
const ROUNDOFF: f64 = 1e-12;

/// The command for what has always stood at `disp`, and for which nothing is remembered but that. Real-time: yes.
fn at_rest(one: &mut dyn Compensator, disp: f64) -> f64 {
    one.reset(disp);
    let command = one.predict(disp, 0.0, 0.0);
    one.reset(disp);
    command
}

impl Compensation {
    fn freeze(&self, out: &mut Vec<f64>) {
        out.push(f64::from(u8::from(self.running)));
        out.extend(&self.vel);
        for one in &self.of {
            one.freeze(out);
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
            self.compensation = Some(Compensation {
                of,
                metres,
                tick,
                pace,
                running: false,
                asked: false,
                vel: vec![0.0; n],
                before: None,
            });
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
        let of = self.compensation.iter().flat_map(|all| &all.of);
        of.enumerate()
            .flat_map(|(axis, one)| one.names().iter().map(move |name| (axis, *name)))
    }

    /// The parameters of the moment, in the order of their names. Real-time: yes.
    #[inline]
    pub fn compensation_parameters(&self) -> impl Iterator<Item = f64> {
        let of = self.compensation.iter().flat_map(|all| &all.of);
        of.flat_map(|one| one.parameters().iter().copied())
    }

    /// From here on the state before each command is kept, too: the last one never leaves, and is made again.
    pub fn follow_compensation(&mut self) {
        if let Some(compensation) = &mut self.compensation {
            compensation.before = Some(Vec::new());
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

    /// Takes them back from the front of `from` and returns the rest.
    pub fn thaw_compensation<'a>(&mut self, from: &'a [f64]) -> &'a [f64] {
        let Some(compensation) = &mut self.compensation else {
            return from;
        };
        let mut rest = from;
        if let Some((running, tail)) = rest.split_first() {
            compensation.running = *running != 0.0;
            rest = tail;
        }
        for vel in &mut compensation.vel {
            if let Some((first, tail)) = rest.split_first() {
                *vel = *first;
                rest = tail;
            }
        }
        for one in &mut compensation.of {
            rest = one.thaw(rest);
        }
        rest
    }

    /// Makes the command of the target's. Real-time: yes.
    pub(super) fn compensate(&mut self) {
        if let Some(compensation) = &mut self.compensation
            && let Some(mut before) = compensation.before.take()
        {
            before.clear();
            compensation.freeze(&mut before);
            compensation.before = Some(before);
        }
        let Some(Compensation {
            of,
            metres,
            tick,
            pace,
            running,
            vel: last_vel,
            ..
        }) = &mut self.compensation
        else {
            return;
        };
        let axes = self.axes.iter().zip(&mut self.command).zip(&self.target);
        let rest = self.target_vel.iter().zip(last_vel).zip(metres).zip(of);
        for (((axis, command), target), (((vel, last_vel), metres), one)) in axes.zip(rest) {
            let disp = axis.disp_gain * target * *metres;
            let vel = axis.disp_gain * vel * *metres * *pace;
            if *running {
                let accel = (vel - *last_vel) / *tick;
                *command = one.predict(disp, vel, accel) / *metres + axis.disp_offset;
            } else {
                let at_rest = at_rest(one.as_mut(), disp);
                // Weights that sum up to 1 but for roundoff change nothing.
                if (at_rest - disp).abs() > ROUNDOFF * disp.abs() {
                    *command = at_rest / *metres + axis.disp_offset;
                }
            }
            *last_vel = vel;
        }
    }

    /// A command that was made of a target leaves, or one that only stands still. Real-time: yes.
    #[inline]
    pub(super) fn compensation_asks(&mut self, moves: bool) {
        self.tracking.moves = moves && self.runs;
        if let Some(compensation) = &mut self.compensation {
            compensation.asked = moves;
        }
    }

    /// A fresh measurement is there. Real-time: yes.
    pub(super) fn compensation_hears(&mut self) {
        let Some(Compensation {
            of,
            metres,
            running: true,
            asked: asked @ true,
            ..
        }) = &mut self.compensation
        else {
            return;
        };
        *asked = false;
        let axes = self.axes.iter().zip(&self.sent).zip(&self.raw.disp);
        for (((axis, sent), raw), (metres, one)) in axes.zip(metres.iter().zip(of)) {
            let command = (sent - axis.disp_offset) * metres;
            let measured = (raw - axis.measured_offset - axis.disp_offset) * metres;
            if measured.is_finite() {
                one.observe(command, measured);
            }
        }
    }
}
