//! The codec of a native session: bytes become frames, and replies become bytes.
//!
//! The codec knows no socket and no clock. Over a stream the first wrong byte is final; over datagrams a wrong frame is
//! counted and dropped.

use std::ops::Range;

use super::native_handshake::{self, Greeted};
use crate::inbox::Inbox;
use gusset_quantity::substructure::Measurement;
use gusset_wire::WireError;
use gusset_wire::handshake::{self, Control, Refuse};
use gusset_wire::native::{
    Cause, Decoder, Encoder, Heartbeat, LARGEST_FRAME, Moment, Notice, Received,
};

/// The codec of one session.
pub(super) struct NativeCodec {
    inbox: Inbox,
    encoder: Encoder,
    decoder: Decoder,
    out: Vec<u8>,
    /// Version of the handshake that the client speaks.
    version: u16,
    /// Frames that failed a check.
    corrupt: u64,
}

impl NativeCodec {
    pub(crate) fn new(inbox: Inbox, greeted: Greeted) -> Self {
        Self {
            inbox,
            encoder: greeted.encoder,
            decoder: greeted.decoder,
            out: vec![0; LARGEST_FRAME],
            version: greeted.version,
            corrupt: 0,
        }
    }

    pub(crate) const fn is_stream(&self) -> bool {
        self.inbox.is_stream()
    }

    pub(crate) const fn corrupt(&self) -> u64 {
        self.corrupt
    }

    /// Room for the next bytes.
    pub(crate) fn space(&mut self) -> &mut [u8] {
        self.inbox.space()
    }

    /// This number of bytes of the room is filled.
    pub(crate) fn filled(&mut self, count: usize) {
        self.inbox.filled(count);
    }

    /// The place of the next complete frame. Real-time: yes.
    pub(crate) fn next(&mut self) -> Result<Option<Range<usize>>, WireError> {
        self.inbox.next()
    }

    /// Opens the frame at this place. Real-time: yes.
    pub(crate) fn open(&mut self, place: Range<usize>) -> Result<Received<'_>, WireError> {
        self.decoder.open(self.inbox.frame(place))
    }

    /// Counts a frame that failed a check. The error again, if it is final.
    pub(crate) fn failed(&mut self, error: WireError) -> Result<(), WireError> {
        let is_overtaken = matches!(error, WireError::Replayed { .. } | WireError::TooOld { .. });
        self.corrupt += u64::from(!is_overtaken);
        if self.is_stream() { Err(error) } else { Ok(()) }
    }

    /// Real-time: yes.
    pub(crate) fn measurement(
        &mut self,
        measured: &Measurement,
        moment: Moment,
    ) -> Result<&[u8], WireError> {
        let length = self.encoder.measurement(measured, moment, &mut self.out)?;
        Ok(self.written(length))
    }

    pub(crate) fn heartbeat(&mut self, beat: Heartbeat) -> Result<&[u8], WireError> {
        let length = self.encoder.heartbeat(beat, &mut self.out)?;
        Ok(self.written(length))
    }

    pub(crate) fn goodbye(&mut self, mut notice: Notice) -> Result<&[u8], WireError> {
        notice.cause = notice.cause.for_version(self.version);
        let length = self.encoder.goodbye(notice, &mut self.out)?;
        Ok(self.written(length))
    }

    /// A control message.
    pub(crate) fn control(&mut self, message: &[u8]) -> Result<&[u8], WireError> {
        let length = self.encoder.control(message, &mut self.out)?;
        Ok(self.written(length))
    }

    pub(crate) fn refusal(&mut self, refuse: Refuse) -> Result<&[u8], WireError> {
        let message = handshake::encode(&Control::Refuse(refuse))?;
        self.control(&message)
    }

    /// A message for people that the session ends.
    pub(crate) fn bye(&mut self, cause: Cause, text: &str) -> Result<&[u8], WireError> {
        let bye = native_handshake::bye(cause.for_version(self.version), text);
        let message = handshake::encode(&Control::Bye(bye))?;
        self.control(&message)
    }

    fn written(&self, length: usize) -> &[u8] {
        self.out.get(..length).unwrap_or_default()
    }
}
