//! Bytes that came, and the whole frames of our protocol in them.
//!
//! Invariant: the buffer never grows, and a frame that it cannot hold does not exist (its length was bounded by
//! [`split`]). Real-time: yes, but for the making.

use std::ops::Range;

use gusset_wire::native::{LARGEST_FRAME, split};
use gusset_wire::{Progress, WireError};

/// Reassembles a stream, or holds one datagram.
#[derive(Debug)]
pub(super) struct Inbox {
    bytes: Vec<u8>,
    start: usize,
    end: usize,
    stream: bool,
}

impl Inbox {
    /// For a stream of bytes, or for datagrams, each of which begins with a frame and ends with one.
    pub(super) fn new(stream: bool) -> Self {
        Self {
            bytes: vec![0; 2 * LARGEST_FRAME],
            start: 0,
            end: 0,
            stream,
        }
    }

    /// True for a stream of bytes.
    pub(super) const fn is_stream(&self) -> bool {
        self.stream
    }

    /// Room for the next bytes; never empty after [`Inbox::next`] has found no whole frame.
    pub(super) fn space(&mut self) -> &mut [u8] {
        if !self.stream || self.start == self.end {
            (self.start, self.end) = (0, 0);
        } else if self.bytes.len() - self.end < LARGEST_FRAME {
            self.bytes.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
        }
        self.bytes.get_mut(self.end..).unwrap_or_default()
    }

    /// Records that `count` more bytes of the buffer are filled.
    pub(super) fn filled(&mut self, count: usize) {
        self.end = (self.end + count).min(self.bytes.len());
    }

    /// Copies as many of these bytes as there is room for; returns their number.
    pub(super) fn add(&mut self, bytes: &[u8]) -> usize {
        let space = self.space();
        let count = bytes.len().min(space.len());
        if let (Some(to), Some(from)) = (space.get_mut(..count), bytes.get(..count)) {
            to.copy_from_slice(from);
        }
        self.filled(count);
        count
    }

    /// The place of the next whole frame, and behind it. On datagrams an error drops the whole datagram; on a stream
    /// it is final.
    pub(super) fn next(&mut self) -> Result<Option<Range<usize>>, WireError> {
        let rest = self.bytes.get(self.start..self.end).unwrap_or_default();
        if rest.is_empty() {
            return Ok(None);
        }
        let found = rest.len();
        let outcome = split(rest);
        if !self.stream && !matches!(outcome, Ok(Progress::Frame { .. })) {
            self.start = self.end;
        }
        match outcome? {
            Progress::Frame { consumed } => {
                let frame = self.start..self.start + consumed;
                self.start += consumed;
                Ok(Some(frame))
            }
            Progress::NeedMore if self.stream => Ok(None),
            Progress::NeedMore => Err(WireError::Truncated {
                needed: found + 1,
                found,
            }),
        }
    }

    /// The bytes at a place that [`Inbox::next`] gave, until the next [`Inbox::space`].
    pub(super) fn frame(&self, place: Range<usize>) -> &[u8] {
        self.bytes.get(place).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_wire::Side;
    use gusset_wire::native::Encoder;

    impl Inbox {
        fn preload(&mut self, bytes: &[u8]) {
            self.space()[..bytes.len()].copy_from_slice(bytes);
            self.filled(bytes.len());
        }
    }

    fn greeting(message: &[u8]) -> Vec<u8> {
        let mut out = vec![0; 200];
        let length = Encoder::greeting(Side::Controller)
            .control(message, &mut out)
            .unwrap();
        out.truncate(length);
        out
    }

    fn all(inbox: &mut Inbox) -> Vec<Vec<u8>> {
        let mut frames = Vec::new();
        while let Some(place) = inbox.next().unwrap() {
            frames.push(inbox.frame(place).to_vec());
        }
        frames
    }

    #[test]
    fn split_stream_gives_the_same_frames() {
        let frames: Vec<_> = [&b"one"[..], b"two two", b""].map(greeting).to_vec();
        let bytes = frames.concat();
        for size in 1..bytes.len() {
            let mut inbox = Inbox::new(true);
            let mut found = Vec::new();
            for piece in bytes.chunks(size) {
                inbox.preload(piece);
                found.extend(all(&mut inbox));
            }
            assert_eq!(found, frames);
        }
    }

    #[test]
    fn cut_datagram_leaves_nothing_behind() {
        let frame = greeting(b"one");
        let mut inbox = Inbox::new(false);
        inbox.preload(&frame[..20]);
        assert!(inbox.next().is_err());
        inbox.preload(&frame);
        assert_eq!(all(&mut inbox), [frame]);
    }

    #[test]
    fn a_long_stream_never_runs_out_of_room() {
        let frame = greeting(&[0; 150]);
        let mut inbox = Inbox::new(true);
        for _ in 0..2_000 {
            inbox.preload(&frame);
            assert_eq!(all(&mut inbox).len(), 1);
        }
    }
}
