//! When the helper of a link was at work, without a stamp for each of the thousands of small pieces a second.
//!
//! A piece that takes long stands alone, since it is what delays a reply. Short ones are put together: how many, from when to
//! when, and how long all of them took. A helper that works for no run leaves none, and reads no clock for it.

use crate::record::{Roll, Stamper, What};

/// A piece of this length stands alone, ns.
const LONG_NS: u64 = 100_000;
/// Short pieces of so much time are put together, ns.
const SPAN_NS: u64 = 20_000_000;

/// Short pieces so far.
#[derive(Debug, Clone, Copy)]
struct Pieces {
    count: u16,
    begin_ns: u64,
    end_ns: u64,
    work_ns: u64,
}

/// The work of one helper.
#[derive(Debug, Default)]
pub(super) struct Carried {
    stamper: Option<Stamper>,
    /// Since when it is awake.
    woke_ns: u64,
    bytes: u64,
    pieces: Option<Pieces>,
}

impl Carried {
    /// Enters the calling thread on the roll, if there is one.
    pub fn of(roll: Option<Roll>) -> Self {
        let stamper = roll.map(|roll| roll.enter());
        let woke_ns = stamper.as_ref().map_or(0, Stamper::now);
        Self {
            stamper,
            woke_ns,
            ..Self::default()
        }
    }

    /// So many bytes went on.
    pub const fn add(&mut self, bytes: usize) {
        self.bytes += bytes as u64;
    }

    /// The helper is about to sleep.
    pub fn sleeps(&mut self) {
        let Some(stamper) = &self.stamper else {
            return;
        };
        let bytes = std::mem::take(&mut self.bytes);
        if bytes > 0 {
            let now_ns = stamper.now();
            self.note(self.woke_ns, now_ns, bytes);
        }
    }

    /// The helper is awake again.
    pub fn wakes(&mut self) {
        if let Some(stamper) = &self.stamper {
            self.woke_ns = stamper.now();
        }
    }

    fn note(&mut self, begin_ns: u64, end_ns: u64, bytes: u64) {
        let work_ns = end_ns.saturating_sub(begin_ns);
        let fits = |pieces: &Pieces| {
            pieces.count < u16::MAX && end_ns.saturating_sub(pieces.begin_ns) <= SPAN_NS
        };
        if work_ns >= LONG_NS || !self.pieces.as_ref().is_none_or(fits) {
            self.tell();
        }
        if work_ns >= LONG_NS {
            if let Some(stamper) = &self.stamper {
                stamper.pieces(What::Carry, 1, begin_ns, end_ns, bytes);
            }
            return;
        }
        let pieces = self.pieces.get_or_insert(Pieces {
            count: 0,
            begin_ns,
            end_ns,
            work_ns: 0,
        });
        pieces.count += 1;
        pieces.end_ns = end_ns;
        pieces.work_ns += work_ns;
    }

    /// Leaves a stamp of the short pieces.
    fn tell(&mut self) {
        if let (Some(stamper), Some(pieces)) = (&self.stamper, self.pieces.take()) {
            let Pieces {
                count,
                begin_ns,
                end_ns,
                work_ns,
            } = pieces;
            stamper.pieces(What::Carries, count, begin_ns, end_ns, work_ns);
        }
    }
}

impl Drop for Carried {
    fn drop(&mut self) {
        self.tell();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::threads::{ThreadLog, ThreadReader, ThreadRecord, Who};

    fn left(work: impl FnOnce(&mut Carried)) -> Vec<(What, u16, u64, u64, u64)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("threads.bin");
        let roll = Roll::new(
            || 0,
            || Who {
                name: "gusset-tls".to_owned(),
                id: 1,
            },
        );
        let mut log = ThreadLog::new(std::fs::File::create(&path).unwrap(), roll.clone());
        let mut carried = Carried::of(Some(roll));
        work(&mut carried);
        drop(carried);
        assert_eq!(log.finish(0), 0);
        let mut reader = ThreadReader::new(std::fs::File::open(&path).unwrap());
        let mut stamps = Vec::new();
        while let Some(record) = reader.next_record().unwrap() {
            if let ThreadRecord::Stamp(s) = record {
                stamps.push((s.what, s.pieces, s.begin_ns, s.duration_ns, s.amount));
            }
        }
        stamps
    }

    #[test]
    fn short_pieces_are_put_together_and_a_long_one_stands_alone() {
        const MS: u64 = 1_000_000;
        let stamps = left(|carried| {
            for k in 0..30 {
                carried.note(k * MS, k * MS + 5_000, 100);
            }
            carried.note(30 * MS, 31 * MS, 700);
            carried.note(32 * MS, 32 * MS + 7_000, 100);
        });
        let expected = [
            (What::Carries, 20, 0, 19 * MS + 5_000, 100_000),
            (What::Carries, 10, 20 * MS, 9 * MS + 5_000, 50_000),
            (What::Carry, 1, 30 * MS, MS, 700),
            (What::Carries, 1, 32 * MS, 7_000, 7_000),
        ];
        assert_eq!(stamps, expected);
    }

    #[test]
    fn a_wake_up_that_carries_nothing_is_none() {
        let stamps = left(|carried| {
            carried.wakes();
            carried.sleeps();
            carried.add(10);
            carried.sleeps();
        });
        assert_eq!(stamps, [(What::Carries, 1, 0, 0, 0)]);
    }
}
