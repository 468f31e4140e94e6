//! The writer's end of the stamps: from the queue into `threads.bin`, behind the rows in everything.
//!
//! A file that refuses ends nothing and is not shouted about: stamps wait in little memory, and what finds no room is
//! counted with what was lost on the way here.

use super::super::append::{Appender, Store, Unit};
use super::{RECORD, Roll, Stamp, Stamper, What, encode_head, encode_lost, encode_name};

/// Bytes of records that may wait for a file that refuses: more than a full queue.
pub(super) const WAITING: usize = 128 << 10;

/// `threads.bin` of a run, and where its stamps come from.
pub struct ThreadLog {
    pub(super) file: Appender<Box<dyn Store>>,
    roll: Roll,
    named: usize,
    refused: u64,
    told: u64,
}

impl std::fmt::Debug for ThreadLog {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ThreadLog")
            .field("named", &self.named)
            .field("lost", &self.lost())
            .finish_non_exhaustive()
    }
}

impl ThreadLog {
    /// For the stamps of `roll`, into an empty store.
    #[must_use]
    pub fn new(store: impl Store + 'static, roll: Roll) -> Self {
        let store: Box<dyn Store> = Box::new(store);
        let mut file = Appender::new(store, Unit::Stride(RECORD), WAITING);
        file.offer(RECORD, encode_head);
        Self {
            file,
            roll,
            named: 0,
            refused: 0,
            told: 0,
        }
    }

    /// The roll.
    pub const fn roll(&self) -> &Roll {
        &self.roll
    }

    /// Takes a stamp of the writer itself.
    pub(in crate::record) fn own(
        &mut self,
        stamper: &Stamper,
        what: What,
        begin: u64,
        end: u64,
        amount: u64,
    ) {
        if let Some(stamp) = stamper.made(what, 1, begin, end, amount) {
            self.take(&stamp);
        }
    }

    fn take(&mut self, stamp: &Stamp) {
        let size = RECORD.saturating_mul(stamp.records());
        let taken = self.file.offer(size, |out| stamp.encode(out));
        self.refused += u64::from(!taken);
    }

    /// Takes what waits in the queue: names first.
    pub fn turn(&mut self, now_ns: u64) {
        let file = &mut self.file;
        let mut full = false;
        let mut named = self.named;
        self.roll.name_those_after(self.named, |number, who| {
            let id = u32::try_from(who.id).unwrap_or(0);
            full |= !file.offer(RECORD, |out| encode_name(number, &who.name, id, out));
            named += usize::from(!full);
        });
        self.named = named;
        // A handle of its own: the queue is not borrowed from what takes the stamps.
        let roll = self.roll.clone();
        roll.waiting().for_each(|stamp| self.take(&stamp));
        let lost = self.lost();
        let more = lost - self.told;
        if more > 0
            && self
                .file
                .offer(RECORD, |out| encode_lost(now_ns, more, out))
        {
            self.told = lost;
        }
    }

    /// Writes what waits for the file.
    pub fn flush(&mut self, now_ns: u64) {
        let _refusals_show_in_the_count = self.file.flush(now_ns);
    }

    /// Takes and writes everything; how many stamps were lost in all.
    pub fn finish(&mut self, now_ns: u64) -> u64 {
        self.turn(now_ns);
        let _refusals_show_in_the_count = self.file.flush_at_once(now_ns);
        self.lost() + self.file.waiting_units()
    }

    /// Stamps that found no room, in the queue or behind it.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.roll.lost() + self.refused
    }
}
