//! When the page's thread was at work: from waking up to going to sleep, with the bytes that it made for viewers meanwhile.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use crate::record::{Stamper, What};

/// Work shorter than this that made nothing for a viewer is a timer that rang, and none, ns.
const NOTHING_NS: u64 = 50_000;

/// The work of one thread; what is in it is only touched there.
#[derive(Debug, Default)]
pub(super) struct Work {
    stamper: OnceLock<Stamper>,
    woke_ns: AtomicU64,
    bytes: AtomicU64,
}

impl Work {
    /// Three hands on the same.
    pub fn shared() -> (Arc<Self>, Arc<Self>, Arc<Self>) {
        let work = Arc::<Self>::default();
        (Arc::clone(&work), Arc::clone(&work), work)
    }

    /// The thread begins, on a roll.
    pub fn begins(&self, stamper: Stamper) {
        self.woke_ns.store(stamper.now(), Ordering::Relaxed);
        let _once = self.stamper.set(stamper);
    }

    /// So many bytes were made for a viewer.
    pub fn made(&self, bytes: usize) {
        self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    /// The thread has something to do.
    pub fn wakes(&self) {
        if let Some(stamper) = self.stamper.get() {
            self.woke_ns.store(stamper.now(), Ordering::Relaxed);
        }
    }

    /// The thread has nothing more to do.
    pub fn sleeps(&self) {
        let Some(stamper) = self.stamper.get() else {
            return;
        };
        let began_ns = self.woke_ns.load(Ordering::Relaxed);
        let bytes = self.bytes.swap(0, Ordering::Relaxed);
        if bytes > 0 || stamper.now().saturating_sub(began_ns) >= NOTHING_NS {
            stamper.since(What::Page, began_ns, bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::threads::{Roll, ThreadLog, ThreadReader, ThreadRecord, Who};
    use crate::rt::os;

    #[test]
    fn a_batch_is_one_slice_and_a_timer_that_rings_for_nobody_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("threads.bin");
        let roll = Roll::new(os::monotonic_ns, || Who {
            name: "gusset-page".to_owned(),
            id: os::thread_id(),
        });
        let mut log = ThreadLog::new(std::fs::File::create(&path).unwrap(), roll.clone());
        let (work, _, _) = Work::shared();
        work.sleeps();
        work.begins(roll.enter());
        work.sleeps();
        for frames in [[0, 0], [400, 30], [0, 0], [0, 5]] {
            work.wakes();
            frames.into_iter().for_each(|bytes| work.made(bytes));
            work.sleeps();
        }
        assert_eq!(log.finish(0), 0);
        let mut reader = ThreadReader::new(std::fs::File::open(&path).unwrap());
        let mut batches = Vec::new();
        while let Some(record) = reader.next_record().unwrap() {
            if let ThreadRecord::Stamp(stamp) = record
                && stamp.amount > 0
            {
                batches.push((stamp.what, stamp.amount));
            }
        }
        // One that took long without a viewer may be there too: the machine is shared.
        assert_eq!(batches, [(What::Page, 430), (What::Page, 5)]);
    }
}
