//! The part of an exchange that all dialects share: one half for the server, one for the client.

use super::action::{Action, Matrix, Reading};
use super::course::Course;
use super::followed::Followed;
use super::inbox::{Carrier, Inbox};
use super::sizes::Counts;
use super::vector::{Response, Signals, read_matrix, write_action, write_matrix, write_vector};
use crate::WireError;
use crate::bytes::{finite, get_f64, same_length};
use gusset_quantity::substructure::{Command, Measurement};

/// Answer that a server owes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Debt {
    Signals,
    Matrix,
    Switch,
}

impl Debt {
    const fn words(self) -> &'static str {
        match self {
            Self::Signals => "an answer with signals",
            Self::Matrix => "an answer with a matrix",
            Self::Switch => "an answer with a switch",
        }
    }

    /// Pays this debt out of what is `owed`. Real-time: yes.
    pub(super) fn settle(self, owed: &mut Option<Self>) -> Result<(), WireError> {
        if *owed == Some(self) {
            *owed = None;
            return Ok(());
        }
        Err(WireError::Order {
            expected: owed.map_or("no answer", Self::words),
            found: self.words(),
        })
    }
}

/// The serving half: the last command, its meaning, and the answers.
#[derive(Debug)]
pub(super) struct Served {
    daq: Counts,
    pub followed: Followed,
    outbox: Vec<u8>,
    debt: Option<Debt>,
}

impl Served {
    /// Only for set-up: allocates.
    pub(super) fn new(ctrl: Counts, daq: Counts, data_size: usize, implicit: bool) -> Self {
        Self {
            daq,
            followed: Followed::new(ctrl, implicit),
            outbox: vec![0; 8 * data_size],
            debt: None,
        }
    }

    /// A command has come. Real-time: yes.
    pub(super) fn command(&mut self, vector: &[u8]) -> Result<Course, WireError> {
        self.followed.command("trial response", vector)
    }

    /// A commit has come; returns the number of commands since the last one. Real-time: yes.
    pub(super) fn commit(&mut self, vector: &[u8]) -> Result<u32, WireError> {
        let counts = self.followed.counts();
        let time = if counts.time == 1 {
            let time = get_f64(vector, 8 * (1 + counts.before_time()))?;
            finite("time of the commit", &[time])?;
            Some(time)
        } else {
            None
        };
        Ok(self.followed.commit(time))
    }

    pub(super) fn owe_signals(&mut self) {
        self.debt = Some(Debt::Signals);
    }

    /// An error if the matrix does not fit into a vector.
    pub(super) fn owe_matrix(&mut self) -> Result<(), WireError> {
        let n = self.followed.counts().disp;
        super::sizes::inside(
            "data size N",
            n.saturating_mul(n),
            super::MAX_DATA_SIZE,
            i64::try_from(self.outbox.len() / 8).unwrap_or(i64::MAX),
        )?;
        self.debt = Some(Debt::Matrix);
        Ok(())
    }

    /// Encodes the answer that is owed. Real-time: yes.
    pub(super) fn answer(&mut self, response: &Response<'_>) -> Result<&[u8], WireError> {
        Debt::Signals.settle(&mut self.debt)?;
        write_vector(&mut self.outbox, None, &self.daq, response)?;
        Ok(&self.outbox)
    }

    /// Encodes the matrix that is owed. Real-time: yes.
    pub(super) fn answer_matrix(&mut self, rows: &[f64]) -> Result<&[u8], WireError> {
        Debt::Matrix.settle(&mut self.debt)?;
        write_matrix(&mut self.outbox, self.followed.counts().disp, rows)?;
        Ok(&self.outbox)
    }
}

/// How far an asking end has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// Nothing has been sent.
    New,
    /// The set-up is on its way.
    Greeting,
    Running,
    Finished,
    Failed,
}

/// Where the bytes that came belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Came {
    /// Nowhere: this number of bytes is skipped.
    Nothing(usize),
    /// Into the set-up, which the dialect handles.
    Greeting,
    /// This number of bytes is part of the owed answer; its kind, if it is complete now.
    Answer(usize, Option<Owed>),
}

/// Answer that a client waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Owed {
    Signals,
    Matrix(Matrix),
    /// The answer to DIE, in dialect B.
    Farewell,
}

/// The asking half: commands and requests out, answers in.
#[derive(Debug)]
pub(super) struct Asking {
    ctrl: Counts,
    inbox: Inbox,
    /// Room for a command and a request.
    pub(super) outbox: Vec<u8>,
    vector_len: usize,
    measured: Signals,
    /// The newest command: what is reported where the peer measures no displacement.
    commanded: Vec<f64>,
    zeros: Vec<f64>,
    sequence: u64,
    owed: Option<Owed>,
    phase: Phase,
}

impl Asking {
    /// Only for set-up: allocates. The inbox expects vectors.
    pub(super) fn new(carrier: Carrier, ctrl: Counts, daq: Counts, data_size: usize) -> Self {
        let vector_len = 8 * data_size;
        Self {
            ctrl,
            inbox: Inbox::new(carrier, vector_len),
            outbox: vec![0; 2 * vector_len],
            vector_len,
            measured: Signals::zeros(daq),
            commanded: vec![0.0; ctrl.disp],
            zeros: vec![0.0; ctrl.accel.max(ctrl.force)],
            sequence: 0,
            owed: None,
            phase: Phase::New,
        }
    }

    /// The opening is sent once.
    pub(super) fn begin(&mut self, next: Phase) -> Result<(), WireError> {
        if self.phase != Phase::New {
            return Err(WireError::Order {
                expected: "one opening",
                found: "another one",
            });
        }
        self.phase = next;
        Ok(())
    }

    pub(super) const fn enter(&mut self, phase: Phase) {
        self.phase = phase;
    }

    /// Only a connection that is set up and not over may be used.
    pub(super) fn running(&self, found: &'static str) -> Result<(), WireError> {
        let expected = match self.phase {
            Phase::Running => return Ok(()),
            Phase::Failed => return Err(WireError::Failed),
            Phase::New | Phase::Greeting => "the set-up",
            Phase::Finished => "nothing after the end",
        };
        Err(WireError::Order { expected, found })
    }

    /// Judges bytes by the phase, and takes what belongs to an answer. Real-time: yes.
    pub(super) fn hear(&mut self, bytes: &[u8]) -> Result<Came, WireError> {
        if bytes.is_empty() {
            return Ok(Came::Nothing(0));
        }
        match self.phase {
            Phase::Failed => Err(WireError::Failed),
            Phase::Finished => Ok(Came::Nothing(bytes.len())),
            Phase::New => Err(WireError::Order {
                expected: "nothing",
                found: "bytes before the opening",
            }),
            Phase::Greeting => Ok(Came::Greeting),
            // A greeting's answer that came twice.
            Phase::Running if self.inbox.is_single(bytes) => Ok(Came::Nothing(1)),
            Phase::Running => self
                .take(bytes)
                .map(|(used, owed)| Came::Answer(used, owed)),
        }
    }

    /// Nothing may leave while an answer is owed.
    pub(super) fn free(&self, found: &'static str) -> Result<(), WireError> {
        match self.owed {
            None => Ok(()),
            Some(_) => Err(WireError::Order {
                expected: "the answer that is owed",
                found,
            }),
        }
    }

    /// A command and its request, both in one write. Real-time: yes.
    pub(super) fn command(
        &mut self,
        command: &Command<'_>,
        reading: Reading,
    ) -> Result<&[u8], WireError> {
        self.free("a command")?;
        same_length("axes of the command", self.ctrl.disp, command.disp.len())?;
        let none: &[f64] = &[];
        let response = Response {
            disp: command.disp,
            vel: if self.ctrl.vel == 0 {
                none
            } else {
                command.vel
            },
            accel: self.zeros.get(..self.ctrl.accel).unwrap_or(none),
            force: self.zeros.get(..self.ctrl.force).unwrap_or(none),
            time: command.time,
        };
        let (first, second) = self
            .outbox
            .split_at_mut_checked(self.vector_len)
            .unwrap_or_default();
        write_vector(first, Some(Action::Trial.code()), &self.ctrl, &response)?;
        write_action(second, Action::Read(reading))?;
        self.remember(command.sequence, command.disp);
        self.owed = Some(Owed::Signals);
        Ok(&self.outbox)
    }

    /// A command alone. Real-time: yes.
    pub(super) fn trial(&mut self, response: &Response<'_>) -> Result<&[u8], WireError> {
        self.free("a command")?;
        let first = self.outbox.get_mut(..self.vector_len).unwrap_or_default();
        write_vector(first, Some(Action::Trial.code()), &self.ctrl, response)?;
        self.remember(self.sequence.saturating_add(1), response.disp);
        Ok(self.first())
    }

    /// A request alone. Real-time: yes.
    pub(super) fn request(&mut self, action: Action, owed: Owed) -> Result<&[u8], WireError> {
        self.free("a request")?;
        let first = self.outbox.get_mut(..self.vector_len).unwrap_or_default();
        write_action(first, action)?;
        self.owed = Some(owed);
        Ok(self.first())
    }

    /// A message without an answer. A time, if given, takes the place that it has in a command. Real-time: yes.
    pub(super) fn notice(&mut self, action: Action, time: Option<f64>) -> Result<&[u8], WireError> {
        let first = self.outbox.get_mut(..self.vector_len).unwrap_or_default();
        write_action(first, action)?;
        if let Some(time) = time.filter(|_| self.ctrl.time == 1) {
            finite("time of the commit", &[time])?;
            let at = 8 * (1 + self.ctrl.before_time());
            crate::bytes::put(first, at, time.to_le_bytes())?;
        }
        Ok(self.first())
    }

    /// Takes the answer that is owed. Real-time: yes.
    fn take(&mut self, bytes: &[u8]) -> Result<(usize, Option<Owed>), WireError> {
        let Some(owed) = self.owed else {
            return Err(WireError::Order {
                expected: "nothing",
                found: "a reply without a request",
            });
        };
        let (used, message) = self.inbox.take(bytes)?;
        let Some(message) = message else {
            return Ok((used, None));
        };
        match owed {
            Owed::Signals => self.measured.read("measured response", message, 0)?,
            Owed::Matrix(_) | Owed::Farewell => {}
        }
        self.owed = None;
        Ok((used, Some(owed)))
    }

    pub(super) fn measured(&self) -> Response<'_> {
        self.measured.response()
    }

    /// Fills a measurement with the last answer. Real-time: yes.
    pub(super) fn measurement(&self, into: &mut Measurement) -> Result<(), WireError> {
        let measured = self.measured.response();
        let counts = self.measured.counts();
        let disp = if counts.disp == 0 {
            &self.commanded
        } else {
            measured.disp
        };
        same_length("measured displacements", into.disp.len(), disp.len())?;
        same_length("measured forces", into.force.len(), measured.force.len())?;
        into.disp.copy_from_slice(disp);
        into.force.copy_from_slice(measured.force);
        into.sequence = self.sequence;
        into.time = measured.time;
        Ok(())
    }

    /// Reads the last answer as a matrix, row by row. Real-time: yes.
    pub(super) fn matrix(&self, rows: &mut [f64]) -> Result<(), WireError> {
        read_matrix(self.inbox.message(), self.ctrl.disp, rows)
    }

    /// The last answer.
    pub(super) const fn message(&self) -> &[u8] {
        self.inbox.message()
    }

    pub(super) const fn vector_len(&self) -> usize {
        self.vector_len
    }

    fn remember(&mut self, sequence: u64, disp: &[f64]) {
        self.sequence = sequence;
        for (kept, new) in self.commanded.iter_mut().zip(disp) {
            *kept = *new;
        }
    }

    fn first(&self) -> &[u8] {
        self.outbox.get(..self.vector_len).unwrap_or_default()
    }
}
