//! Messages of a known length, put together from whatever pieces the network brings.

use crate::WireError;

/// The longest datagram that OpenSees and OpenFresco send.
pub const DATAGRAM_LIMIT: usize = 9126;

/// What carries the bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Carrier {
    /// TCP or TLS: no boundaries.
    Stream,
    /// UDP: one message is one datagram or several, and no datagram holds two.
    Datagrams,
}

/// Cuts what is to be sent into datagrams: messages of `message` bytes, each in pieces of at most `piece` bytes.
///
/// A stream needs no cutting: one write for all of it. Real-time: yes.
pub fn datagrams(bytes: &[u8], message: usize, piece: usize) -> impl Iterator<Item = &[u8]> {
    bytes
        .chunks(message.max(1))
        .flat_map(move |message| message.chunks(piece.max(1)))
}

/// Gathers one message at a time. Its memory is fixed when the length is.
#[derive(Debug)]
pub struct Inbox {
    carrier: Carrier,
    buffer: Vec<u8>,
    filled: usize,
    piece: Option<usize>,
}

impl Inbox {
    pub(super) fn new(carrier: Carrier, length: usize) -> Self {
        Self {
            carrier,
            buffer: vec![0; length],
            filled: 0,
            piece: None,
        }
    }

    /// The next message has `length` bytes. Only for set-up: may allocate.
    pub(super) fn expect(&mut self, length: usize) {
        self.buffer.resize(length, 0);
        self.filled = 0;
    }

    /// Takes bytes up to the end of the message; returns how many, and the message if it is whole. A datagram is
    /// taken as a whole or refused. Real-time: yes.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Result<(usize, Option<&[u8]>), WireError> {
        let missing = self.buffer.len() - self.filled;
        if self.carrier == Carrier::Datagrams && bytes.len() > missing {
            return Err(WireError::Count {
                field: "bytes of a datagram",
                expected: missing,
                found: bytes.len(),
            });
        }
        if self.carrier == Carrier::Datagrams && self.filled == 0 && bytes.len() < missing {
            self.piece = Some(bytes.len());
        }
        let used = bytes.len().min(missing);
        let end = self.filled + used;
        if let (Some(place), Some(new)) = (self.buffer.get_mut(self.filled..end), bytes.get(..used))
        {
            place.copy_from_slice(new);
        }
        self.filled = end;
        if end < self.buffer.len() {
            return Ok((used, None));
        }
        self.filled = 0;
        Ok((used, Some(&self.buffer)))
    }

    /// True between messages.
    pub(super) const fn is_empty(&self) -> bool {
        self.filled == 0
    }

    /// Bytes of a message that has not come whole.
    #[must_use]
    pub const fn partial(&self) -> usize {
        self.filled
    }

    /// A datagram of one byte where a message begins: a greeting, or a stray of one.
    pub(super) fn is_single(&self, bytes: &[u8]) -> bool {
        self.carrier == Carrier::Datagrams && self.is_empty() && bytes.len() == 1
    }

    /// The last whole message. All have its length after the sizes.
    #[must_use]
    pub const fn message(&self) -> &[u8] {
        self.buffer.as_slice()
    }

    /// Over UDP: cut answers into pieces of this many bytes, as the peer cuts its messages.
    #[must_use]
    pub fn piece(&self) -> usize {
        self.piece.unwrap_or(DATAGRAM_LIMIT).min(DATAGRAM_LIMIT)
    }
}
