//! Dialect A as a server, and dialect D behind `GenericTCP`.
//!
//! Both begin with the 44 bytes of [`Sizes`]; then come vectors. Dialect D has no commits: a new target accepts the
//! one before. Requests 6 to 11 are answered with all signals, 12 to 15 with a matrix, all else with nothing.

use super::action::{Action, Matrix, Reading};
use super::course::Course;
use super::exchange::Served;
use super::followed::Followed;
use super::inbox::{Carrier, Inbox};
use super::opening::{Came, NOT_READY, Opening};
use super::sizes::{Interface, Sizes};
use super::vector::{Response, read_lead};
use crate::WireError;

/// Length of a line of `GenericTCP`'s init file.
const LINE_LEN: usize = 16_385;
/// Its first byte. No action of this dialect begins so: all are whole numbers, whose first byte is zero.
const LINE_MARK: u8 = 2;

/// Calling program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ServerDialect {
    /// A: a finite element program, which commits its steps.
    Application,
    /// D: OpenFresco's `GenericTCP`, which does not.
    Controller,
}

/// What came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// Not a whole message yet.
    NeedMore,
    /// A UDP hello; `reply` holds the answer.
    Greeted,
    /// The sizes are known and fit.
    Ready(Sizes),
    /// A line of an init file, which is ignored.
    InitLine,
    /// A command: it is held as the trial.
    Trial(Course),
    /// The last command is accepted: the step is over.
    Commit {
        /// Commands since the last commit; 0 if the displacement has not changed since.
        trials: u32,
    },
    /// To be answered by [`Server::answer`]. May come before the first command, and any number of times.
    Read(Reading),
    /// To be answered by [`Server::answer_matrix`].
    Matrix(Matrix),
    /// An action that this dialect does not know. It is not answered; log it, the client may wait for ever.
    Ignored(f64),
    /// The client ends the test. Nothing is answered, what follows is ignored.
    Finished,
}

/// A force server.
#[derive(Debug)]
pub struct Server {
    dialect: ServerDialect,
    opening: Opening,
    served: Option<Served>,
    commanded: bool,
    /// Bytes of a line that are still to come.
    line_left: usize,
}

impl Server {
    /// A server that waits for its client.
    #[must_use]
    pub fn new(dialect: ServerDialect, carrier: Carrier, interface: Interface) -> Self {
        Self {
            dialect,
            opening: Opening::new(carrier, interface),
            served: None,
            commanded: false,
            line_left: 0,
        }
    }

    /// Takes bytes up to the end of one message (of a datagram: all of them); returns how many were used and
    /// what they mean. Allocates only when the sizes arrive. Real-time: yes.
    ///
    /// # Errors
    /// Nonsense. The server is failed then and stays so; close the connection and make a new one.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(usize, Event), WireError> {
        let outcome = self.step(bytes);
        if outcome.is_err() {
            self.opening.fail();
        }
        outcome
    }

    /// Bytes to send after the last event; empty for most. Requests are answered by `answer`.
    #[must_use]
    pub const fn reply(&self) -> &[u8] {
        self.opening.reply
    }

    /// The last command and its course. `None` before the sizes.
    #[must_use]
    pub fn followed(&self) -> Option<&Followed> {
        self.served.as_ref().map(|served| &served.followed)
    }

    /// Encodes the answer to the last request 6 to 11. Kinds that the client does not want may be empty.
    /// Real-time: yes.
    ///
    /// # Errors
    /// No such answer is owed, wrong number of signals, a number that is not finite.
    pub fn answer(&mut self, response: &Response<'_>) -> Result<&[u8], WireError> {
        self.served.as_mut().ok_or(NOT_READY)?.answer(response)
    }

    /// Encodes the answer to the last request 12 to 15 from an n×n matrix given row by row. Real-time: yes.
    ///
    /// # Errors
    /// No such answer is owed, wrong number of entries, a number that is not finite.
    pub fn answer_matrix(&mut self, rows: &[f64]) -> Result<&[u8], WireError> {
        self.served.as_mut().ok_or(NOT_READY)?.answer_matrix(rows)
    }

    /// The messages of the client.
    #[must_use]
    pub const fn inbox(&self) -> &Inbox {
        &self.opening.inbox
    }

    fn step(&mut self, bytes: &[u8]) -> Result<(usize, Event), WireError> {
        if self.line_left > 0 || self.begins_line(bytes) {
            return Ok(self.line(bytes));
        }
        let (used, came) = self.opening.take(bytes)?;
        let event = match came {
            Came::Nothing => Event::NeedMore,
            Came::Hello => Event::Greeted,
            Came::Stray(byte) => Event::Ignored(byte),
            Came::Sizes(sizes) => {
                let implicit = self.dialect == ServerDialect::Controller;
                let (ctrl, daq) = (*sizes.ctrl(), *sizes.daq());
                self.served = Some(Served::new(ctrl, daq, sizes.data_size(), implicit));
                self.opening.ready(&sizes);
                Event::Ready(sizes)
            }
            Came::Vector => self.vector()?,
        };
        Ok((used, event))
    }

    fn begins_line(&mut self, bytes: &[u8]) -> bool {
        let begins = self.dialect == ServerDialect::Controller
            && !self.commanded
            && self.opening.begins(bytes)
            && bytes.first() == Some(&LINE_MARK);
        if begins {
            self.line_left = LINE_LEN;
        }
        begins
    }

    fn line(&mut self, bytes: &[u8]) -> (usize, Event) {
        let used = bytes.len().min(self.line_left);
        self.line_left -= used;
        let whole = self.line_left == 0;
        (
            used,
            if whole {
                Event::InitLine
            } else {
                Event::NeedMore
            },
        )
    }

    fn vector(&mut self) -> Result<Event, WireError> {
        let served = self.served.as_mut().ok_or(NOT_READY)?;
        let vector = self.opening.vector();
        let code = read_lead(vector)?;
        Ok(match Action::whole(code)? {
            Some(Action::Trial) => {
                self.commanded = true;
                Event::Trial(served.command(vector)?)
            }
            Some(Action::Commit) => Event::Commit {
                trials: served.commit(vector)?,
            },
            Some(Action::Read(reading)) => {
                served.owe_signals();
                Event::Read(reading)
            }
            Some(Action::Give(matrix)) => {
                served.owe_matrix()?;
                Event::Matrix(matrix)
            }
            Some(Action::Die) => {
                self.opening.finish();
                Event::Finished
            }
            _ => Event::Ignored(code),
        })
    }
}
