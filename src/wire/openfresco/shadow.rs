//! Dialect B as a client: the shadow of a remote site.
//!
//! The set-up runs by itself: send what [`Shadow::open`] gives, feed what comes, send what `reply` holds, until
//! [`ShadowEvent::Ready`].

use super::action::{Action, Reading};
use super::actor::{ENDIAN_CHECK, RECEIVED};
use super::exchange::{Asking, Came, Owed, Phase};
use super::hello::{ENDIAN, HELLO, UdpGreeting};
use super::inbox::{Carrier, Inbox};
use super::sizes::{BLOCK_LEN, DEFAULT_DATA_SIZE, Sizes};
use super::vector::Response;
use crate::WireError;
use crate::bytes::{array, finite, get_f64, put_doubles};
use gusset_quantity::substructure::{Command, Measurement};

/// How to talk to an actor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowSettings {
    /// What carries the bytes.
    pub carrier: Carrier,
    /// Signals and length of the vectors. The far side must be able to use them.
    pub sizes: Sizes,
    /// Our site tag.
    pub site: f64,
    /// The version number to claim, such as 2.8: both sides compare it for exact equality.
    pub version: f64,
    /// Bytes before everything else, over UDP only.
    pub greeting: UdpGreeting,
}

/// What came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShadowEvent {
    /// Not a whole message yet.
    NeedMore,
    /// A step of the set-up is done; `reply` holds what to send now.
    Greeted,
    /// The actor opened with the right version; `reply` holds setup and sizes. Commands may follow.
    Ready {
        /// Site tag of the actor.
        site: f64,
    },
    /// The answer that was owed; [`Shadow::measured`] holds it.
    Answer,
    /// The actor has ended.
    Finished,
}

/// Message that the set-up waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    Hello,
    Endian,
    Opened,
}

/// A shadow site.
#[derive(Debug)]
pub struct Shadow {
    settings: ShadowSettings,
    step: Step,
    asking: Asking,
    setup: Inbox,
    opening: Vec<u8>,
    reply_len: usize,
}

/// Length of the vectors before the setup.
const OPENING_LEN: usize = 8 * DEFAULT_DATA_SIZE;

impl Shadow {
    /// A shadow that has sent nothing yet.
    ///
    /// # Errors
    /// Sizes without a displacement in the command or a force in the answer; a tag or version that is not a
    /// number.
    pub fn new(settings: ShadowSettings) -> Result<Self, WireError> {
        let sizes = settings.sizes;
        for (field, found) in [
            ("commanded displacements", sizes.ctrl().disp),
            ("measured forces", sizes.daq().force),
        ] {
            let found = i64::try_from(found).unwrap_or(i64::MAX);
            super::sizes::inside(field, 1, super::MAX_COUNT, found)?;
        }
        finite("site tag and version", &[settings.site, settings.version])?;
        Ok(Self {
            settings,
            step: Step::Hello,
            asking: Asking::new(
                settings.carrier,
                *sizes.ctrl(),
                *sizes.daq(),
                sizes.data_size(),
            ),
            setup: Inbox::new(settings.carrier, 1),
            opening: vec![0; OPENING_LEN + 2 * BLOCK_LEN],
            reply_len: 0,
        })
    }

    /// The first bytes to send.
    ///
    /// # Errors
    /// [`WireError::Order`] if it was called before.
    pub fn open(&mut self) -> Result<&[u8], WireError> {
        self.asking.begin(Phase::Greeting)?;
        match self.settings.carrier {
            Carrier::Stream => {
                self.step = Step::Endian;
                self.setup.expect(ENDIAN_CHECK.len());
                Ok(&ENDIAN_CHECK)
            }
            Carrier::Datagrams if self.settings.greeting.hello => {
                self.step = Step::Hello;
                self.setup.expect(1);
                Ok(&[HELLO])
            }
            Carrier::Datagrams => {
                self.greet()?;
                Ok(self.reply())
            }
        }
    }

    /// A command and the request for its answer, as two vectors in one piece: one write on a stream, two
    /// datagrams. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Order`] before the set-up is through or while an answer is owed; wrong numbers.
    pub fn command(&mut self, command: &Command<'_>) -> Result<&[u8], WireError> {
        self.asking.running("a command")?;
        self.asking.command(command, Reading::All)
    }

    /// A command without a request. Real-time: yes.
    ///
    /// # Errors
    /// As [`Shadow::command`].
    pub fn trial(&mut self, response: &Response<'_>) -> Result<&[u8], WireError> {
        self.asking.running("a command")?;
        self.asking.trial(response)
    }

    /// A request without a command. Real-time: yes.
    ///
    /// # Errors
    /// As [`Shadow::command`].
    pub fn request(&mut self) -> Result<&[u8], WireError> {
        self.asking.running("a request")?;
        self.asking
            .request(Action::Read(Reading::All), Owed::Signals)
    }

    /// The last command is accepted, at `time`. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Order`]; a time that is not finite.
    pub fn commit(&mut self, time: f64) -> Result<&[u8], WireError> {
        self.asking.running("a commit")?;
        self.asking.free("a commit")?;
        self.asking.notice(Action::Commit, Some(time))
    }

    /// The end of the test; the actor answers it. An answer that is still owed comes first on the wire, so the
    /// end waits for it.
    ///
    /// # Errors
    /// [`WireError::Order`].
    pub fn die(&mut self) -> Result<&[u8], WireError> {
        self.asking.running("an end")?;
        self.asking.request(Action::Die, Owed::Farewell)?;
        let length = self.asking.vector_len();
        let vector = self.asking.outbox.get_mut(..length).unwrap_or_default();
        put_doubles(vector, 8, &[self.settings.site])?;
        Ok(vector)
    }

    /// Takes bytes up to the end of one message (of a datagram: all of them); returns how many were used and
    /// what they mean. Real-time: yes.
    ///
    /// # Errors
    /// Nonsense, another version, or bytes that were not requested. The shadow is failed then and stays so.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(usize, ShadowEvent), WireError> {
        self.reply_len = 0;
        let outcome = self.hear(bytes);
        if outcome.is_err() {
            self.asking.enter(Phase::Failed);
        }
        outcome
    }

    /// Bytes to send after the last event. Over UDP these are separate messages: cut them with
    /// [`Shadow::reply_messages`].
    #[must_use]
    pub fn reply(&self) -> &[u8] {
        self.opening.get(..self.reply_len).unwrap_or_default()
    }

    /// [`Shadow::reply`], message by message.
    pub fn reply_messages(&self) -> impl Iterator<Item = &[u8]> {
        let (vector, blocks) = self
            .reply()
            .split_at_checked(OPENING_LEN)
            .unwrap_or((self.reply(), &[]));
        std::iter::once(vector)
            .chain(blocks.chunks(BLOCK_LEN))
            .filter(|message| !message.is_empty())
    }

    /// The signals of the last answer.
    #[must_use]
    pub fn measured(&self) -> Response<'_> {
        self.asking.measured()
    }

    /// Fills a measurement with the last answer; see [`super::Client::measurement`]. Real-time: yes.
    ///
    /// # Errors
    /// [`WireError::Count`] for a measurement of another number of axes.
    pub fn measurement(&self, into: &mut Measurement) -> Result<(), WireError> {
        self.asking.measurement(into)
    }

    /// Bytes of one vector, once the set-up is through.
    #[must_use]
    pub const fn vector_len(&self) -> usize {
        self.asking.vector_len()
    }

    fn hear(&mut self, bytes: &[u8]) -> Result<(usize, ShadowEvent), WireError> {
        match self.asking.hear(bytes)? {
            Came::Nothing(used) => Ok((used, ShadowEvent::NeedMore)),
            Came::Greeting => self.setting_up(bytes),
            Came::Answer(used, answered) => Ok((used, self.answered(answered)?)),
        }
    }

    fn setting_up(&mut self, bytes: &[u8]) -> Result<(usize, ShadowEvent), WireError> {
        let (used, message) = self.setup.take(bytes)?;
        let Some(message) = message else {
            return Ok((used, ShadowEvent::NeedMore));
        };
        let event = match (self.step, self.settings.carrier) {
            (Step::Hello, _) if self.settings.greeting.endian => {
                self.step = Step::Endian;
                self.setup.expect(1);
                if let Some(place) = self.opening.first_mut() {
                    *place = ENDIAN;
                }
                self.reply_len = 1;
                ShadowEvent::Greeted
            }
            (Step::Endian, Carrier::Stream) => {
                let found: [u8; 4] = array(message, 0)?;
                if found != ENDIAN_CHECK {
                    return Err(WireError::Magic {
                        expected: ENDIAN_CHECK,
                        found,
                    });
                }
                self.greet()?;
                ShadowEvent::Greeted
            }
            (Step::Hello | Step::Endian, _) => {
                self.greet()?;
                ShadowEvent::Greeted
            }
            _ => self.opened()?,
        };
        Ok((used, event))
    }

    /// Writes the open message.
    fn greet(&mut self) -> Result<(), WireError> {
        self.opening.fill(0);
        let words = [
            Action::Open.code(),
            self.settings.site,
            self.settings.version,
        ];
        put_doubles(&mut self.opening, 0, &words)?;
        self.reply_len = OPENING_LEN;
        self.setup.expect(OPENING_LEN);
        self.step = Step::Opened;
        Ok(())
    }

    /// Reads the actor's answer to open, and writes setup and sizes.
    fn opened(&mut self) -> Result<ShadowEvent, WireError> {
        let answer = self.setup.message();
        let (status, site, version) = (
            get_f64(answer, 0)?,
            get_f64(answer, 8)?,
            get_f64(answer, 16)?,
        );
        finite("status, site tag and version", &[status, site, version])?;
        if version != self.settings.version {
            return Err(WireError::SiteVersion {
                expected: self.settings.version,
                found: version,
            });
        }
        self.opening.fill(0);
        let sizes = self.settings.sizes;
        // At most 2^16: exact as a double.
        let words = [Action::Setup.code(), sizes.data_size() as f64];
        put_doubles(&mut self.opening, 0, &words)?;
        sizes.ctrl().write(&mut self.opening, OPENING_LEN)?;
        sizes
            .daq()
            .write(&mut self.opening, OPENING_LEN + BLOCK_LEN)?;
        self.reply_len = OPENING_LEN + 2 * BLOCK_LEN;
        self.asking.enter(Phase::Running);
        Ok(ShadowEvent::Ready { site })
    }

    fn answered(&mut self, answered: Option<Owed>) -> Result<ShadowEvent, WireError> {
        Ok(match answered {
            None => ShadowEvent::NeedMore,
            Some(Owed::Signals | Owed::Matrix(_)) => ShadowEvent::Answer,
            Some(Owed::Farewell) => {
                let found = get_f64(self.asking.message(), 0)?;
                if found != RECEIVED {
                    return Err(WireError::Action { found });
                }
                self.asking.enter(Phase::Finished);
                ShadowEvent::Finished
            }
        })
    }
}
