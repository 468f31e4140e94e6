//! Position of the received bytes within the TLS records: all that must be known of a record without its key.
//!
//! A record is a header of five bytes, the last two its length in network order, and the body (RFC 8446, 5.1).

const HEAD: usize = 5;
/// Content types of TLS: 20 change of cipher, 21 alert, 22 handshake, 23 data, 24 heartbeat.
const KINDS: std::ops::RangeInclusive<u8> = 20..=24;

/// Follows the bytes of a stream of records.
#[derive(Debug, Default)]
pub(super) struct Records {
    head: [u8; HEAD],
    /// Bytes of the present record, its head included; 0 between two records.
    got: usize,
    /// Bytes of the present record, as far as its head is known.
    of: usize,
    first: Option<u8>,
    /// When the present record began to wait for the rest of it, ns.
    since: u64,
}

impl Records {
    /// Takes notice of bytes that came at `now`.
    pub(super) fn follow(&mut self, mut bytes: &[u8], now: u64) {
        if self.first.is_none() {
            self.first = bytes.first().copied();
        }
        while let Some((byte, rest)) = bytes.split_first() {
            if self.got == 0 {
                (self.of, self.since) = (HEAD, now);
            }
            if self.got < HEAD {
                if let Some(place) = self.head.get_mut(self.got) {
                    *place = *byte;
                }
                self.got += 1;
                bytes = rest;
                if self.got == HEAD {
                    self.of = HEAD + usize::from(u16::from_be_bytes([self.head[3], self.head[4]]));
                }
            } else {
                let taken = bytes.len().min(self.of - self.got);
                self.got += taken;
                bytes = bytes.get(taken..).unwrap_or_default();
            }
            if self.got >= HEAD && self.got == self.of {
                self.got = 0;
            }
        }
    }

    /// Bytes that came and bytes of the whole record, in the middle of one.
    pub(super) const fn unfinished(&self) -> Option<(u32, u32)> {
        if self.got == 0 {
            None
        } else {
            Some((self.got as u32, self.of as u32))
        }
    }

    /// Sequence of the waiting record, and when the record began, ns.
    pub(super) fn waiting(&self) -> Option<(u32, u32, u64)> {
        self.unfinished().map(|(got, of)| (got, of, self.since))
    }

    /// False if the very first byte was not TLS.
    pub(super) fn is_tls(&self) -> bool {
        self.first.is_none_or(|first| KINDS.contains(&first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cut_stream_knows_its_record_borders() {
        // Records of 0, 1 and 300 bytes.
        let mut stream = Vec::new();
        let mut ends = vec![0];
        for length in [0_u16, 1, 300] {
            stream.extend([23, 3, 3]);
            stream.extend(length.to_be_bytes());
            stream.extend(vec![9; usize::from(length)]);
            ends.push(stream.len());
        }
        for cut in 0..=stream.len() {
            for size in [1, 2, 7, 1000] {
                let mut records = Records::default();
                for piece in stream[..cut].chunks(size) {
                    records.follow(piece, 5);
                }
                let begun = *ends.iter().rfind(|end| **end <= cut).unwrap();
                let got = records.unfinished().map_or(0, |(got, _)| got as usize);
                assert_eq!(got, cut - begun, "cut at {cut} in pieces of {size}");
            }
        }
    }

    #[test]
    fn record_length_is_known_from_its_head() {
        let mut records = Records::default();
        records.follow(&[23, 3, 3, 1], 5);
        assert_eq!(records.waiting(), Some((4, 5, 5)));
        records.follow(&[4, 0], 6);
        assert_eq!(records.waiting(), Some((6, 265, 5)));
        assert!(records.is_tls());
        let mut other = Records::default();
        other.follow(b"GUST", 5);
        assert!(!other.is_tls());
    }
}
