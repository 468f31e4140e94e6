//! The command in force of a native session, and the count of commands.

use gusset_quantity::substructure::{Command, Measurement, Status};
use gusset_wire::WireError;
use gusset_wire::native::CommandFrame;

/// Test time may pass this many times as fast as wall time, by the announced rate.
const FASTEST: f64 = 1000.0;

/// The effect of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effect {
    /// A newer command is in force: nothing.
    Overtaken,
    /// It is in force already, and is answered again.
    Repeated,
    /// It is new; its vectors were read.
    New,
}

/// The vectors of the next command.
#[derive(Debug)]
pub(super) struct NextMotion {
    disp: Vec<f64>,
    vel: Vec<f64>,
}

/// The command in force, and the vectors of the next one.
#[derive(Debug)]
pub(super) struct CommandInForce {
    pub sequence: Option<u64>,
    pub time: f64,
    dt: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    pub next: NextMotion,
    pub measured: Measurement,
    /// Flags of the specimen itself.
    pub flags: Status,
}

impl CommandInForce {
    /// No command yet; the specimen was armed at `disp`.
    pub(crate) fn new(disp: &[f64]) -> Self {
        let axes = disp.len();
        Self {
            sequence: None,
            time: 0.0,
            dt: 0.0,
            disp: disp.to_vec(),
            vel: vec![0.0; axes],
            next: NextMotion {
                disp: vec![0.0; axes],
                vel: vec![0.0; axes],
            },
            measured: Measurement::zeros(axes),
            flags: Status::default(),
        }
    }

    /// The position of the command in force.
    pub(crate) fn disp(&self) -> &[f64] {
        &self.disp
    }

    /// The test begins again.
    pub(crate) const fn reset(&mut self) {
        self.sequence = None;
        (self.time, self.dt) = (0.0, 0.0);
    }

    /// True if the next command only repeats the position at the same test time. Real-time: yes.
    pub(crate) fn stays(&self, dt: f64) -> bool {
        self.sequence.is_some()
            && dt == 0.0
            && self.dt == 0.0
            && self.next.disp == self.disp
            && self.next.vel == self.vel
    }

    /// The next command is in force. Real-time: yes.
    pub(crate) fn advance(&mut self, sequence: u64, time: f64, dt: f64) {
        std::mem::swap(&mut self.disp, &mut self.next.disp);
        std::mem::swap(&mut self.vel, &mut self.next.vel);
        (self.sequence, self.time, self.dt) = (Some(sequence), time, dt);
    }

    /// The command for the specimen, the place of its measurement, and that of the next command. Real-time: yes.
    pub(crate) fn exchange(&mut self) -> (Command<'_>, &mut Measurement, &mut NextMotion) {
        let command = Command {
            sequence: self.sequence.unwrap_or_default(),
            time: self.time,
            dt: self.dt,
            disp: &self.disp,
            vel: &self.vel,
        };
        (command, &mut self.measured, &mut self.next)
    }
}

impl NextMotion {
    /// Judges a command by its number, and reads the vectors of a new one. `first` is the first number of the test; `newest` is
    /// that of the newest command. Real-time: yes.
    pub(crate) fn read(
        &mut self,
        command: &CommandFrame<'_>,
        first: u64,
        newest: Option<u64>,
    ) -> Result<Effect, WireError> {
        match newest {
            // A command from before the specimen was armed again.
            _ if command.sequence < first => Ok(Effect::Overtaken),
            Some(newest) if command.sequence < newest => Ok(Effect::Overtaken),
            Some(newest) if command.sequence == newest => Ok(Effect::Repeated),
            _ => command
                .read(&mut self.disp, &mut self.vel)
                .map(|()| Effect::New),
        }
    }
}

/// The numbers of the commands of a session.
#[derive(Debug)]
pub(super) struct CommandCount {
    /// New commands.
    pub commands: u64,
    /// Commands that did not arrive or were not passed on.
    pub missed: u32,
    next: u64,
    /// Wall time from one command to the next as announced, ns.
    period_ns: u64,
}

impl CommandCount {
    pub(crate) const fn new(first: u64, period_ns: u64) -> Self {
        Self {
            commands: 0,
            missed: 0,
            next: first,
            period_ns,
        }
    }

    /// The next command has this number. Real-time: yes.
    pub(crate) const fn expect(&mut self, next: u64) {
        self.next = next;
    }

    /// All commands up to this one that did not come are missed; returns their number. Real-time: yes.
    pub(crate) fn misses_up_to(&mut self, last: u64) -> u64 {
        let next = last.saturating_add(1);
        let gap = next.saturating_sub(self.next);
        self.missed = self
            .missed
            .saturating_add(u32::try_from(gap).unwrap_or(u32::MAX));
        self.next = self.next.max(next);
        gap
    }

    /// Longest test time that can have passed before this command, s. Real-time: yes.
    pub(crate) fn longest(&self, sequence: u64) -> f64 {
        let commands = sequence.saturating_sub(self.next).saturating_add(1);
        FASTEST * self.period_ns as f64 * 1e-9 * commands as f64
    }
}
