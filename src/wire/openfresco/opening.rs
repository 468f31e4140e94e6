//! The course that dialects A and D share at the serving end: perhaps a hello, the 44 bytes of [`Sizes`], then vectors of the
//! length that they name, and an end.

use super::hello::{HELLO, HELLO_ANSWER};
use super::inbox::{Carrier, Inbox};
use super::sizes::{Interface, SIZES_LEN, Sizes};
use crate::WireError;

/// An answer before the sizes.
pub(super) const NOT_READY: WireError = WireError::Order {
    expected: "the sizes",
    found: "an answer",
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Sizes,
    Running,
    Finished,
    Failed,
}

/// What came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Came {
    /// Not a whole message yet, or nothing that matters any more.
    Nothing,
    /// A hello; [`Opening::reply`] holds the answer.
    Hello,
    /// A hello where none was due.
    Stray(f64),
    /// The sizes. They fit the interface; [`Opening::ready`] is due.
    Sizes(Sizes),
    /// A vector: [`Opening::vector`] holds it.
    Vector,
}

/// The bytes of one connection, message by message.
#[derive(Debug)]
pub(super) struct Opening {
    interface: Interface,
    state: State,
    pub inbox: Inbox,
    pub reply: &'static [u8],
}

impl Opening {
    pub(super) fn new(carrier: Carrier, interface: Interface) -> Self {
        Self {
            interface,
            state: State::Sizes,
            inbox: Inbox::new(carrier, SIZES_LEN),
            reply: &[],
        }
    }

    /// Takes bytes up to the end of one message. Real-time: yes.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Result<(usize, Came), WireError> {
        self.reply = &[];
        if self.state == State::Failed {
            return Err(WireError::Failed);
        }
        if bytes.is_empty() {
            return Ok((0, Came::Nothing));
        }
        if self.inbox.is_single(bytes) {
            return Ok((1, self.single_byte()));
        }
        if self.state == State::Finished {
            return Ok((bytes.len(), Came::Nothing));
        }
        let (used, message) = self.inbox.take(bytes)?;
        let Some(message) = message else {
            return Ok((used, Came::Nothing));
        };
        if self.state == State::Running {
            return Ok((used, Came::Vector));
        }
        let sizes = Sizes::parse(message)?;
        self.interface.check(sizes.ctrl(), sizes.daq())?;
        Ok((used, Came::Sizes(sizes)))
    }

    /// Before the sizes it is a hello, also a repeated one; later it is a stray.
    fn single_byte(&mut self) -> Came {
        if self.state == State::Sizes {
            self.reply = &[HELLO_ANSWER];
            return Came::Hello;
        }
        Came::Stray(f64::from(HELLO))
    }

    /// From here on vectors come. Only for set-up: allocates.
    pub(super) fn ready(&mut self, sizes: &Sizes) {
        self.inbox.expect(sizes.vector_len());
        self.state = State::Running;
    }

    /// True if something other than a stray greeting begins here, after the sizes.
    pub(super) fn begins(&self, bytes: &[u8]) -> bool {
        self.state == State::Running && self.inbox.is_empty() && !self.inbox.is_single(bytes)
    }

    pub(super) const fn vector(&self) -> &[u8] {
        self.inbox.message()
    }

    /// The client has ended the exchange.
    pub(super) const fn finish(&mut self) {
        self.state = State::Finished;
    }

    /// Nothing is understood any more.
    pub(super) const fn fail(&mut self) {
        self.state = State::Failed;
    }
}
