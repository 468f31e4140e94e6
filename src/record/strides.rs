//! Records of one size, one behind the other, read from a source as they come. The caller decides what a record means,
//! and whether it is valid.

use std::io::{self, Read};

/// Bytes read at once: fits the second-level cache, large enough that the call does not count.
pub(super) const BUFFER: usize = 256 << 10;

/// What comes next.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next<'a> {
    /// A whole record.
    Record(&'a [u8]),
    /// The source has ended, with this number of bytes behind the last whole record.
    End(usize),
}

/// Reads records one by one, without allocating per record.
#[derive(Debug)]
pub(super) struct Strides<R> {
    source: R,
    stride: usize,
    buffer: Vec<u8>,
    start: usize,
    filled: usize,
}

impl<R: Read> Strides<R> {
    /// Reads records of `stride` bytes, at least one. No need to buffer `source`.
    pub(crate) fn new(source: R, stride: usize) -> Self {
        let stride = stride.max(1);
        Self {
            source,
            stride,
            buffer: vec![0; (BUFFER / stride).max(1) * stride],
            start: 0,
            filled: 0,
        }
    }

    /// The next record, or the end; at a later call the source may have more.
    pub(crate) fn next(&mut self) -> io::Result<Next<'_>> {
        if self.filled - self.start < self.stride {
            self.refill()?;
        }
        let available = self.buffer.get(self.start..self.filled).unwrap_or_default();
        Ok(match available.get(..self.stride) {
            Some(record) => {
                self.start += self.stride;
                Next::Record(record)
            }
            None => Next::End(available.len()),
        })
    }

    fn refill(&mut self) -> io::Result<()> {
        self.buffer.copy_within(self.start..self.filled, 0);
        self.filled -= self.start;
        self.start = 0;
        while let Some(room) = self.buffer.get_mut(self.filled..).filter(|r| !r.is_empty()) {
            match self.source.read(room) {
                Ok(0) => break,
                Ok(count) => self.filled += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
