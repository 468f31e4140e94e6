//! Frames that arrive later.

use std::collections::VecDeque;

use gusset_quantity::time::Nanos;

/// Frames with the time at which each arrives; of those with one time the first in comes first. Its buffers are used
/// again.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    waiting: VecDeque<(Nanos, Vec<u8>)>,
    spare: Vec<Vec<u8>>,
}

impl Queue {
    pub(crate) fn push(&mut self, at: Nanos, frame: &[u8]) {
        let bytes = self.copy(frame);
        self.put(at, bytes);
    }

    /// `frame` in a buffer that returns with [`Queue::put`] or [`Queue::discard`].
    pub(crate) fn copy(&mut self, frame: &[u8]) -> Vec<u8> {
        let mut bytes = self.spare.pop().unwrap_or_default();
        bytes.clear();
        bytes.extend_from_slice(frame);
        bytes
    }

    pub(crate) fn put(&mut self, at: Nanos, bytes: Vec<u8>) {
        if self.waiting.back().is_none_or(|(last, _)| *last <= at) {
            self.waiting.push_back((at, bytes));
            return;
        }
        let behind = self.waiting.iter().rposition(|(other, _)| *other <= at);
        self.waiting
            .insert(behind.map_or(0, |last| last + 1), (at, bytes));
    }

    pub(crate) fn discard(&mut self, bytes: Vec<u8>) {
        self.spare.push(bytes);
    }

    /// When the next frame arrives.
    #[inline]
    pub(crate) fn next_at(&self) -> Option<Nanos> {
        self.waiting.front().map(|(at, _)| *at)
    }

    /// Takes the next frame, if it arrives by `until`, as far as it fits.
    #[inline]
    pub(crate) fn take(&mut self, until: Nanos, buffer: &mut [u8]) -> Option<usize> {
        self.pass(until, |bytes| {
            let count = bytes.len().min(buffer.len());
            if let (Some(to), Some(from)) = (buffer.get_mut(..count), bytes.get(..count)) {
                to.copy_from_slice(from);
            }
            count
        })
    }

    /// Like `get`, but lends the frame to `act`.
    #[inline]
    pub(crate) fn pass<R>(&mut self, until: Nanos, act: impl FnOnce(&[u8]) -> R) -> Option<R> {
        if self.next_at()? > until {
            return None;
        }
        let (_, bytes) = self.waiting.pop_front()?;
        let outcome = act(&bytes);
        self.spare.push(bytes);
        Some(outcome)
    }
}
