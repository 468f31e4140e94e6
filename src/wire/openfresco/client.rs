//! Dialects A and C as a client: our controller commands a force server or an OpenSees adapter element.
//!
//! Command and request leave in one write. In dialect C a request must be followed by a command and nothing is
//! ever committed: OpenSees ends its whole process on anything else, so the machine refuses to send it.

use super::action::{Action, Matrix, Reading};
use super::exchange::{Asking, Came, Owed, Phase};
use super::hello::{HELLO, UdpGreeting};
use super::inbox::Carrier;
use super::sizes::{SIZES_LEN, Sizes};
use super::vector::Response;
use crate::WireError;
use gusset_quantity::substructure::{Command, Measurement};

/// What listens at the other end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ClientDialect {
    /// A: a site or element server.
    Application,
    /// C: an OpenSees `adapter`, `actuator` or `corotActuator`.
    Adapter,
}

/// How to talk to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClientSettings {
    /// The dialect.
    pub dialect: ClientDialect,
    /// What carries the bytes.
    pub carrier: Carrier,
    /// Signals and length of the vectors.
    pub sizes: Sizes,
    /// Bytes before the sizes, over UDP only. Dialects A and C have no endian byte.
    pub greeting: UdpGreeting,
}

/// Kind of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// [`Client::measured`] and [`Client::measurement`] hold it.
    Signals,
    /// [`Client::matrix`] holds it.
    Matrix(Matrix),
}

/// What came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClientEvent {
    /// Not a whole message yet.
    NeedMore,
    /// The server answered the hello; `reply` holds the sizes to send now, and commands may follow.
    Greeted,
    /// The answer that was owed.
    Answer(Asked),
}

/// A client of a force server.
#[derive(Debug)]
pub struct Client {
    settings: ClientSettings,
    reading: Reading,
    asking: Asking,
    opening: [u8; SIZES_LEN],
    reply_len: usize,
    /// In dialect C the last message was an answered request: only a command may follow.
    command_due: bool,
}

impl Client {
    /// A client that has sent nothing yet.
    ///
    /// # Errors
    /// Sizes without a force in the answer or a displacement in the command; in dialect C also a time in the
    /// answer of more than one axis, or an answer without displacement, which the element does not check.
    pub fn new(settings: ClientSettings) -> Result<Self, WireError> {
        let sizes = settings.sizes;
        let most = super::MAX_COUNT;
        let at_least_one = |field, found: usize| {
            super::sizes::inside(field, 1, most, i64::try_from(found).unwrap_or(i64::MAX))
        };
        at_least_one("commanded displacements", sizes.ctrl().disp)?;
        at_least_one("measured forces", sizes.daq().force)?;
        if settings.dialect == ClientDialect::Adapter {
            at_least_one("measured displacements", sizes.daq().disp)?;
        }
        // 10 refreshes only the force in a genuine server, 6 everything; an adapter knows 10 only.
        let only_force = sizes.daq().total() == sizes.daq().force;
        let reading = if only_force || settings.dialect == ClientDialect::Adapter {
            Reading::Force
        } else {
            Reading::All
        };
        let mut opening = [0; SIZES_LEN];
        sizes.write(&mut opening)?;
        Ok(Self {
            settings,
            reading,
            asking: Asking::new(
                settings.carrier,
                *sizes.ctrl(),
                *sizes.daq(),
                sizes.data_size(),
            ),
            opening,
            reply_len: 0,
            command_due: false,
        })
    }

    /// The first bytes to send: the sizes, or over UDP perhaps a hello, whose answer must be fed before anything
    /// else.
    ///
    /// # Errors
    /// [`WireError::Order`] if it was called before.
    pub fn open(&mut self) -> Result<&[u8], WireError> {
        if self.settings.carrier == Carrier::Datagrams && self.settings.greeting.hello {
            self.asking.begin(Phase::Greeting)?;
            return Ok(&[HELLO]);
        }
        self.asking.begin(Phase::Running)?;
        Ok(&self.opening)
    }

    /// A command and the request for its answer, as two vectors in one piece: one write on a stream, two datagrams
    /// (see [`super::datagrams`]). The velocity is sent if the sizes contain it; accelerations and forces of a
    /// command are zeros. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Order`] before the opening or while an answer is owed; wrong numbers.
    pub fn command(&mut self, command: &Command<'_>) -> Result<&[u8], WireError> {
        self.asking.running("a command")?;
        self.command_due = self.settings.dialect == ClientDialect::Adapter;
        self.asking.command(command, self.reading)
    }

    /// A command without a request. Real-time: yes.
    ///
    /// # Errors
    /// As [`Client::command`].
    pub fn trial(&mut self, response: &Response<'_>) -> Result<&[u8], WireError> {
        self.asking.running("a command")?;
        self.command_due = false;
        self.asking.trial(response)
    }

    /// A request without a command. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Order`] before the opening, while an answer is owed, or where an adapter needs a command.
    pub fn request(&mut self, reading: Reading) -> Result<&[u8], WireError> {
        self.asking.running("a request")?;
        if self.settings.dialect == ClientDialect::Adapter {
            if self.command_due || reading != Reading::Force {
                return Err(WireError::Order {
                    expected: "a command",
                    found: "a request",
                });
            }
            self.command_due = true;
        }
        self.asking.request(Action::Read(reading), Owed::Signals)
    }

    /// A request for a matrix; dialect A only, and only element servers answer. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Order`]; [`WireError::Bounds`] if N is smaller than n².
    pub fn request_matrix(&mut self, matrix: Matrix) -> Result<&[u8], WireError> {
        self.asking.running("a request for a matrix")?;
        self.application_only("a request for a matrix")?;
        let n = self.settings.sizes.ctrl().disp;
        super::sizes::inside(
            "data size N",
            n * n,
            super::MAX_DATA_SIZE,
            self.settings.sizes.data_size() as i64,
        )?;
        self.asking
            .request(Action::Give(matrix), Owed::Matrix(matrix))
    }

    /// The last command is accepted, at `time`; dialect A only. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Order`]; a time that is not finite.
    pub fn commit(&mut self, time: f64) -> Result<&[u8], WireError> {
        self.asking.running("a commit")?;
        self.application_only("a commit")?;
        self.asking.free("a commit")?;
        self.asking.notice(Action::Commit, Some(time))
    }

    /// The end of the test: send this, then close. It is not answered, and may be sent whatever is owed.
    ///
    /// # Errors
    /// [`WireError::Order`] before the opening or after an end.
    pub fn die(&mut self) -> Result<&[u8], WireError> {
        self.asking.running("an end")?;
        self.asking.enter(Phase::Finished);
        self.asking.notice(Action::Die, None)
    }

    /// Takes bytes up to the end of one answer (of a datagram: all of them); returns how many were used and what
    /// they mean. Real-time: yes.
    ///
    /// # Errors
    /// Nonsense, or bytes that were not requested. The client is failed then and stays so.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(usize, ClientEvent), WireError> {
        self.reply_len = 0;
        let outcome = self.step(bytes);
        if outcome.is_err() {
            self.asking.enter(Phase::Failed);
        }
        outcome
    }

    /// Bytes to send after the last event; empty for most.
    #[must_use]
    pub fn reply(&self) -> &[u8] {
        self.opening.get(..self.reply_len).unwrap_or_default()
    }

    /// The signals of the last answer.
    #[must_use]
    pub fn measured(&self) -> Response<'_> {
        self.asking.measured()
    }

    /// Fills a measurement with the last answer. Where the server measures no displacement it is the commanded one
    /// (`Client::measures_disp`); where it sends no time, 0. The status stays unchanged: the protocol has none.
    /// Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Count`] for a measurement of another number of axes.
    pub fn measurement(&self, into: &mut Measurement) -> Result<(), WireError> {
        self.asking.measurement(into)
    }

    /// False if the displacement of a measurement is the commanded one.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn measures_disp(&self) -> bool {
        self.settings.sizes.daq().disp > 0
    }

    /// Reads the last answer as a matrix, row by row.
    ///
    /// # Errors
    /// [`WireError::Count`] for a slice without n² entries, [`WireError::NotFinite`].
    pub fn matrix(&self, rows: &mut [f64]) -> Result<(), WireError> {
        self.asking.matrix(rows)
    }

    /// Bytes of one vector.
    #[must_use]
    pub const fn vector_len(&self) -> usize {
        self.asking.vector_len()
    }

    fn step(&mut self, bytes: &[u8]) -> Result<(usize, ClientEvent), WireError> {
        match self.asking.hear(bytes)? {
            Came::Nothing(used) => Ok((used, ClientEvent::NeedMore)),
            Came::Greeting => {
                crate::bytes::same_length("bytes of a hello answer", 1, bytes.len())?;
                self.asking.enter(Phase::Running);
                self.reply_len = SIZES_LEN;
                Ok((1, ClientEvent::Greeted))
            }
            Came::Answer(used, answered) => {
                let event = match answered {
                    None => ClientEvent::NeedMore,
                    Some(Owed::Matrix(matrix)) => ClientEvent::Answer(Asked::Matrix(matrix)),
                    Some(Owed::Signals | Owed::Farewell) => ClientEvent::Answer(Asked::Signals),
                };
                Ok((used, event))
            }
        }
    }

    fn application_only(&self, found: &'static str) -> Result<(), WireError> {
        match self.settings.dialect {
            ClientDialect::Application => Ok(()),
            ClientDialect::Adapter => Err(WireError::Order {
                expected: "only commands and force requests to an adapter",
                found,
            }),
        }
    }
}
