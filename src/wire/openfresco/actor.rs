//! Dialect B as a server: the actor behind a remote site.
//!
//! Set-up: endian check (4 bytes over a stream, single bytes over UDP), open with its version number, setup with
//! N, two arrays of five sizes. Vectors are 256 doubles long until the first setup, then N; a later setup is
//! sent in the length that holds when it is sent.

use super::action::{Action, Reading};
use super::course::Course;
use super::exchange::Served;
use super::followed::Followed;
use super::hello::{ENDIAN, HELLO, HELLO_ANSWER};
use super::inbox::{Carrier, Inbox};
use super::opening::NOT_READY;
use super::sizes::{BLOCK_LEN, Counts, DEFAULT_DATA_SIZE, Interface, Sizes, inside};
use super::vector::{Response, read_lead};
use crate::WireError;
use crate::bytes::{array, finite, get_f64, put};

/// The endian check over a stream: the integer 1, both ways.
pub(super) const ENDIAN_CHECK: [u8; 4] = 1_i32.to_le_bytes();
/// The endian check of a peer with the other byte order.
const ENDIAN_SWAPPED: [u8; 4] = 1_i32.to_be_bytes();
/// Double 0 of the answer to DIE.
pub(super) const RECEIVED: f64 = 4.0;

/// What came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ActorEvent {
    /// Not a whole message yet.
    NeedMore,
    /// A greeting; `reply` holds the answer.
    Greeted,
    /// The shadow opened; `reply` holds the answer, which carries the shadow's own version number.
    Opened {
        /// Site tag of the shadow.
        site: f64,
        /// Its version number, such as 2.8.
        version: f64,
    },
    /// The sizes are known and fit. Comes again after a later setup.
    Ready(Sizes),
    /// A command: it is held as the trial. The specimen is evaluated now, not at the request.
    Trial(Course),
    /// The last command is accepted.
    Commit {
        /// Commands since the last commit.
        trials: u32,
    },
    /// 6, to be answered by [`Actor::answer`].
    Read,
    /// An action that an actor does not know. It is not answered.
    Ignored(f64),
    /// The end; `reply` holds the answer.
    Finished,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Endian,
    Vectors,
    SizeTrial { data_size: usize },
    SizeOut { data_size: usize, trial: Counts },
    Finished,
    Failed,
}

/// An actor site.
#[derive(Debug)]
pub struct Actor {
    interface: Interface,
    site: f64,
    state: State,
    inbox: Inbox,
    vector_len: usize,
    greetings: u8,
    served: Option<Served>,
    outbox: Vec<u8>,
    reply_len: usize,
}

impl Actor {
    /// An actor with its own site tag that waits for a shadow.
    #[must_use]
    pub fn new(carrier: Carrier, interface: Interface, site: f64) -> Self {
        let vector_len = 8 * DEFAULT_DATA_SIZE;
        let (state, first) = match carrier {
            Carrier::Stream => (State::Endian, ENDIAN_CHECK.len()),
            Carrier::Datagrams => (State::Vectors, vector_len),
        };
        Self {
            interface,
            site,
            state,
            inbox: Inbox::new(carrier, first),
            vector_len,
            greetings: 0,
            served: None,
            outbox: vec![0; vector_len],
            reply_len: 0,
        }
    }

    /// Takes bytes up to the end of one message (of a datagram: all of them); returns how many were used and
    /// what they mean. Allocates only when sizes arrive. Real-time: yes.
    ///
    /// # Errors
    /// Nonsense. The actor is failed then and stays so.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(usize, ActorEvent), WireError> {
        self.reply_len = 0;
        let outcome = self.step(bytes);
        if outcome.is_err() {
            self.state = State::Failed;
        }
        outcome
    }

    /// Bytes to send after the last event; empty for most. Requests are answered by `answer`.
    #[must_use]
    pub fn reply(&self) -> &[u8] {
        self.outbox.get(..self.reply_len).unwrap_or_default()
    }

    /// The last command and its course. `None` before the sizes.
    #[must_use]
    pub fn followed(&self) -> Option<&Followed> {
        self.served.as_ref().map(|served| &served.followed)
    }

    /// Encodes the answer to the last request. Kinds that the shadow does not want may be empty. Real-time: yes.
    ///
    /// # Errors
    /// No answer is owed, wrong number of signals, a number that is not finite.
    pub fn answer(&mut self, response: &Response<'_>) -> Result<&[u8], WireError> {
        self.served.as_mut().ok_or(NOT_READY)?.answer(response)
    }

    /// The messages of the client.
    #[must_use]
    pub const fn inbox(&self) -> &Inbox {
        &self.inbox
    }

    fn step(&mut self, bytes: &[u8]) -> Result<(usize, ActorEvent), WireError> {
        if self.state == State::Failed {
            return Err(WireError::Failed);
        }
        if bytes.is_empty() {
            return Ok((0, ActorEvent::NeedMore));
        }
        if self.inbox.is_single(bytes) {
            return Ok((1, self.single_byte(bytes)));
        }
        if self.state == State::Finished {
            return Ok((bytes.len(), ActorEvent::NeedMore));
        }
        let (used, message) = self.inbox.take(bytes)?;
        if message.is_none() {
            return Ok((used, ActorEvent::NeedMore));
        }
        let event = match self.state {
            State::Endian => self.endian()?,
            State::Vectors => self.vector()?,
            State::SizeTrial { data_size } => {
                let trial = Counts::parse(self.inbox.message(), 0)?;
                self.state = State::SizeOut { data_size, trial };
                self.inbox.expect(BLOCK_LEN);
                ActorEvent::NeedMore
            }
            State::SizeOut { data_size, trial } => self.ready(data_size, trial)?,
            State::Finished | State::Failed => return Err(WireError::Failed),
        };
        Ok((used, event))
    }

    /// Datagrams of one byte before anything else: hello, then perhaps the endian byte. Later they are strays.
    fn single_byte(&mut self, bytes: &[u8]) -> ActorEvent {
        let answer = match (self.state, self.greetings, bytes.first()) {
            (State::Vectors, 1.., Some(&ENDIAN)) if self.served.is_none() => ENDIAN,
            (State::Vectors, _, Some(_)) if self.served.is_none() => HELLO_ANSWER,
            _ => return ActorEvent::Ignored(f64::from(HELLO)),
        };
        self.greetings = self.greetings.saturating_add(1);
        if let Some(place) = self.outbox.first_mut() {
            *place = answer;
        }
        self.reply_len = 1;
        ActorEvent::Greeted
    }

    fn endian(&mut self) -> Result<ActorEvent, WireError> {
        // The check is answered even if it looks swapped; but all numbers that follow would be nonsense.
        let found: [u8; 4] = array(self.inbox.message(), 0)?;
        crate::not_foreign(&found)?;
        if found != ENDIAN_CHECK && found != ENDIAN_SWAPPED {
            return Err(WireError::Magic {
                expected: ENDIAN_CHECK,
                found,
            });
        }
        put(&mut self.outbox, 0, ENDIAN_CHECK)?;
        self.reply_len = ENDIAN_CHECK.len();
        self.state = State::Vectors;
        self.inbox.expect(self.vector_len);
        Ok(ActorEvent::Greeted)
    }

    fn vector(&mut self) -> Result<ActorEvent, WireError> {
        let vector = self.inbox.message();
        let code = read_lead(vector)?;
        Ok(match (Action::whole(code)?, &mut self.served) {
            (Some(Action::Open), _) => self.open()?,
            (Some(Action::Setup), _) => self.setup()?,
            (Some(Action::Die), _) => self.die()?,
            (Some(Action::Trial), Some(served)) => ActorEvent::Trial(served.command(vector)?),
            (Some(Action::Commit), Some(served)) => ActorEvent::Commit {
                trials: served.commit(vector)?,
            },
            (Some(Action::Read(Reading::All)), Some(served)) => {
                served.owe_signals();
                ActorEvent::Read
            }
            (Some(Action::Trial | Action::Commit | Action::Read(Reading::All)), None) => {
                return Err(WireError::Order {
                    expected: "open or setup",
                    found: "an action that needs the sizes",
                });
            }
            _ => ActorEvent::Ignored(code),
        })
    }

    fn open(&mut self) -> Result<ActorEvent, WireError> {
        let site = get_f64(self.inbox.message(), 8)?;
        let version = get_f64(self.inbox.message(), 16)?;
        finite("site tag and version", &[site, version])?;
        // Return the version unchanged: the shadow compares for exact equality and ends if it differs.
        self.answer_words(&[0.0, self.site, version])?;
        Ok(ActorEvent::Opened { site, version })
    }

    fn setup(&mut self) -> Result<ActorEvent, WireError> {
        let wish = get_f64(self.inbox.message(), 8)?;
        // "is inside", so that NaN fails; at most 2^16, so the cast is exact.
        if !(wish >= 1.0 && wish <= super::MAX_DATA_SIZE as f64 && wish.fract() == 0.0) {
            return Err(WireError::Range {
                field: "data size N",
                index: 0,
                found: wish,
            });
        }
        self.state = State::SizeTrial {
            data_size: wish as usize,
        };
        self.inbox.expect(BLOCK_LEN);
        Ok(ActorEvent::NeedMore)
    }

    fn ready(&mut self, data_size: usize, trial: Counts) -> Result<ActorEvent, WireError> {
        let out = Counts::parse(self.inbox.message(), 0)?;
        let sizes = Sizes::new(trial, out, data_size)?;
        // The answers to open and DIE are longer than a command needs to be.
        inside("data size N", 2, super::MAX_DATA_SIZE, data_size as i64)?;
        self.interface.check(&trial, &out)?;
        self.served = Some(Served::new(trial, out, data_size, false));
        self.vector_len = sizes.vector_len();
        self.outbox.clear();
        self.outbox.resize(self.vector_len, 0);
        self.inbox.expect(self.vector_len);
        self.state = State::Vectors;
        Ok(ActorEvent::Ready(sizes))
    }

    fn die(&mut self) -> Result<ActorEvent, WireError> {
        self.answer_words(&[RECEIVED, self.site])?;
        self.state = State::Finished;
        Ok(ActorEvent::Finished)
    }

    /// A vector of these doubles and zeros. What does not fit into a short vector is left out.
    fn answer_words(&mut self, values: &[f64]) -> Result<(), WireError> {
        self.outbox.fill(0);
        let fitting = values.len().min(self.outbox.len() / 8);
        let values = values.get(..fitting).unwrap_or_default();
        crate::bytes::put_doubles(&mut self.outbox, 0, values)?;
        self.reply_len = self.vector_len;
        Ok(())
    }
}
