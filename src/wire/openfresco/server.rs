//! Dialect A as a server, and dialect D behind `GenericTCP`.
//!
//! Both begin with the 44 bytes of [`Sizes`]; then come vectors. In dialect D nobody commits: a new target
//! accepts the one before. Requests 6 to 11 are answered with all signals, 12 to 15 with a matrix, all else with
//! nothing.

use super::action::{Action, Matrix, Reading};
use super::course::Course;
use super::exchange::Served;
use super::hello::{HELLO, HELLO_ANSWER};
use super::inbox::{Carrier, Inbox};
use super::sizes::{Interface, SIZES_LEN, Sizes};
use super::vector::{Response, read_lead};
use crate::wire::WireError;

/// Length of a line of `GenericTCP`'s init file.
const LINE_LEN: usize = 16_385;
/// Its first byte. No action of this dialect begins so: all are whole numbers, whose first byte is zero.
const LINE_MARK: u8 = 2;
/// So much of a line is kept, for the log.
const LINE_KEPT: usize = 120;

/// Who calls.
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
    /// A line of an init file; [`Server::init_line`] holds its beginning.
    InitLine,
    /// A command: [`Server::trial`] holds it.
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Sizes,
    Running,
    Line { left: usize },
    Finished,
    Failed,
}

/// A force server.
#[derive(Debug)]
pub struct Server {
    dialect: ServerDialect,
    interface: Interface,
    state: State,
    inbox: Inbox,
    served: Option<Served>,
    commanded: bool,
    reply: &'static [u8],
    line: [u8; LINE_KEPT],
    line_len: usize,
}

impl Server {
    /// A server that waits for its client.
    #[must_use]
    pub fn new(dialect: ServerDialect, carrier: Carrier, interface: Interface) -> Self {
        Self {
            dialect,
            interface,
            state: State::Sizes,
            inbox: Inbox::new(carrier, SIZES_LEN),
            served: None,
            commanded: false,
            reply: &[],
            line: [0; LINE_KEPT],
            line_len: 0,
        }
    }

    /// Takes bytes up to the end of one message (of a datagram: all of them); returns how many were used and
    /// what they mean. Allocates only when the sizes arrive. Real-time: yes.
    ///
    /// # Errors
    /// Nonsense. The server is failed then and stays so; close the connection and make a new one.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(usize, Event), WireError> {
        self.reply = &[];
        let outcome = self.step(bytes);
        if outcome.is_err() {
            self.state = State::Failed;
        }
        outcome
    }

    /// Bytes to send after the last event; empty for most. Requests are answered by `answer`.
    #[must_use]
    pub const fn reply(&self) -> &[u8] {
        self.reply
    }

    /// The last command; zeros before the first. `None` before the sizes.
    #[must_use]
    pub fn trial(&self) -> Option<Response<'_>> {
        self.served.as_ref().map(Served::trial)
    }

    /// Test time from the last commit to the last command: what a rate-dependent specimen integrates over. May be
    /// zero or negative (then nothing is to be integrated); `None` if the client sends no time or has begun a
    /// new one.
    #[must_use]
    pub fn dt(&self) -> Option<f64> {
        self.served.as_ref().and_then(Served::dt)
    }

    /// The beginning of the last line of an init file, up to its zero byte.
    #[must_use]
    pub fn init_line(&self) -> &[u8] {
        let kept = self.line.get(..self.line_len).unwrap_or_default();
        kept.split(|byte| *byte == 0).next().unwrap_or_default()
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

    /// Over UDP: cut answers into pieces of this many bytes, as the client cuts its vectors.
    #[must_use]
    pub fn piece(&self) -> usize {
        self.inbox.piece()
    }

    fn step(&mut self, bytes: &[u8]) -> Result<(usize, Event), WireError> {
        if self.state == State::Failed {
            return Err(WireError::Failed);
        }
        if bytes.is_empty() {
            return Ok((0, Event::NeedMore));
        }
        if self.inbox.carrier() == Carrier::Datagrams && bytes.len() == 1 && self.inbox.is_empty() {
            return Ok((1, self.single_byte()));
        }
        match self.state {
            State::Failed => Err(WireError::Failed),
            State::Finished => Ok((bytes.len(), Event::NeedMore)),
            State::Sizes => self.sizes(bytes),
            State::Line { left } => Ok(self.line(bytes, left)),
            State::Running => {
                if self.expects_line() && bytes.first() == Some(&LINE_MARK) {
                    self.line_len = 0;
                    return Ok(self.line(bytes, LINE_LEN));
                }
                self.message(bytes)
            }
        }
    }

    /// A datagram of one byte. Before the sizes it is a hello, also a repeated one; later it is a stray.
    fn single_byte(&mut self) -> Event {
        if self.state == State::Sizes {
            self.reply = &[HELLO_ANSWER];
            return Event::Greeted;
        }
        Event::Ignored(f64::from(HELLO))
    }

    fn sizes(&mut self, bytes: &[u8]) -> Result<(usize, Event), WireError> {
        let (used, message) = self.inbox.take(bytes)?;
        let Some(message) = message else {
            return Ok((used, Event::NeedMore));
        };
        let sizes = Sizes::parse(message)?;
        self.interface.check(sizes.ctrl(), sizes.daq())?;
        let implicit = self.dialect == ServerDialect::Controller;
        self.served = Some(Served::new(
            *sizes.ctrl(),
            *sizes.daq(),
            sizes.data_size(),
            implicit,
        ));
        self.inbox.expect(sizes.vector_len());
        self.state = State::Running;
        Ok((used, Event::Ready(sizes)))
    }

    const fn expects_line(&self) -> bool {
        matches!(self.dialect, ServerDialect::Controller)
            && !self.commanded
            && self.inbox.is_empty()
    }

    fn line(&mut self, bytes: &[u8], left: usize) -> (usize, Event) {
        let used = bytes.len().min(left);
        let skip = usize::from(left == LINE_LEN);
        for byte in bytes.iter().take(used).skip(skip) {
            if let Some(place) = self.line.get_mut(self.line_len) {
                *place = *byte;
                self.line_len += 1;
            }
        }
        if used < left {
            self.state = State::Line { left: left - used };
            return (used, Event::NeedMore);
        }
        self.state = State::Running;
        (used, Event::InitLine)
    }

    fn message(&mut self, bytes: &[u8]) -> Result<(usize, Event), WireError> {
        let served = self.served.as_mut().ok_or(NOT_READY)?;
        let (used, message) = self.inbox.take(bytes)?;
        let Some(vector) = message else {
            return Ok((used, Event::NeedMore));
        };
        let code = read_lead(vector)?;
        let event = match Action::cut(code)? {
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
                self.state = State::Finished;
                Event::Finished
            }
            Some(
                Action::Open
                | Action::Setup
                | Action::Execute
                | Action::TargetTaken
                | Action::TargetDone
                | Action::SwitchedBack
                | Action::Shutdown,
            )
            | None => Event::Ignored(code),
        };
        Ok((used, event))
    }
}

pub(super) const NOT_READY: WireError = WireError::Order {
    expected: "the sizes",
    found: "an answer",
};
