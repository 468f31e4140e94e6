//! Appending whole units to a file that may refuse: rows to `samples.bin`, lines to `events.jsonl`.
//!
//! Invariant: after every call the file holds whole units only, unless the store refuses even to be cut back;
//! then it is cut before anything else is written. What the store does not take is kept, up to a bound, and
//! offered again every 100 ms; beyond the bound, new units are refused and the caller counts them.
//! No clock is read here: the caller says what time it is.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

use super::intact::Extent;

/// Pause between two attempts on a store that failed.
const RETRY_NS: u64 = 100_000_000;

/// A call that brings what was written to the disk itself.
pub(crate) type Syncer = Box<dyn FnMut() -> io::Result<()> + Send>;

/// A store that takes bytes at its end and can be cut back.
pub trait Store: Write + Send {
    /// Cuts the store to its first `length` bytes and continues from there.
    ///
    /// # Errors
    /// The store refuses.
    fn cut(&mut self, length: u64) -> io::Result<()>;

    /// A call for another thread that syncs the store to disk; by default there is nothing to sync.
    ///
    /// # Errors
    /// The store refuses a second handle.
    fn syncer(&self) -> io::Result<Syncer> {
        Ok(Box::new(|| Ok(())))
    }

    /// Length and identity of the store, given that `written` bytes were written; `None` if it is no file.
    fn extent(&self, written: u64) -> Option<Extent> {
        let _no_file = written;
        None
    }
}

impl Store for File {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(|_| ())
    }

    fn syncer(&self) -> io::Result<Syncer> {
        let handle = self.try_clone()?;
        Ok(Box::new(move || handle.sync_data()))
    }

    fn extent(&self, written: u64) -> Option<Extent> {
        Extent::of(self, written).ok()
    }
}

impl Store for Box<dyn Store> {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        (**self).cut(length)
    }

    fn syncer(&self) -> io::Result<Syncer> {
        (**self).syncer()
    }

    fn extent(&self, written: u64) -> Option<Extent> {
        (**self).extent(written)
    }
}

impl Store for Vec<u8> {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.truncate(usize::try_from(length).unwrap_or(usize::MAX));
        Ok(())
    }
}

/// Kind of unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// This number of bytes, at least one.
    Stride(usize),
    /// Bytes up to and with a line feed.
    Line,
}

impl Unit {
    /// Length of the whole units at the front of `bytes`.
    fn whole(self, bytes: &[u8]) -> usize {
        match self {
            Self::Stride(stride) => bytes.len() - bytes.len() % stride.max(1),
            Self::Line => bytes
                .iter()
                .rposition(|&b| b == b'\n')
                .map_or(0, |at| at + 1),
        }
    }
}

/// Outcome of a flush.
#[derive(Debug)]
pub(crate) enum Flushed {
    /// Nothing was waiting, or everything was written.
    Clean,
    /// Everything was written, for the first time since the store failed.
    Recovered,
    /// The store failed; until now it had not.
    Failed(io::Error),
    /// The store has been failing and still is, or it is too early to try again.
    Failing,
}

/// Appends whole units to a store.
#[derive(Debug)]
pub(crate) struct Appender<S> {
    pub store: S,
    unit: Unit,
    /// Bytes of whole units in the store.
    pub length: u64,
    /// The store may hold bytes beyond `length`.
    torn: bool,
    /// Whole units that wait.
    pending: Vec<u8>,
    /// Bytes that may wait.
    bound: usize,
    /// Set while the store fails: when to try again.
    retry_ns: Option<u64>,
}

impl<S: Store> Appender<S> {
    /// An appender to an empty store, keeping at most `bound` bytes that the store does not take.
    #[must_use]
    pub(crate) fn new(store: S, unit: Unit, bound: usize) -> Self {
        Self {
            store,
            unit,
            length: 0,
            torn: false,
            pending: Vec::with_capacity(bound),
            bound,
            retry_ns: None,
        }
    }

    /// Takes one whole unit of `size` bytes, which `fill` appends; false if it would pass the bound.
    pub(crate) fn offer(&mut self, size: usize, fill: impl FnOnce(&mut Vec<u8>)) -> bool {
        let fits = self.pending.len() + size <= self.bound;
        if fits {
            fill(&mut self.pending);
        }
        fits
    }

    /// Bytes that wait.
    #[must_use]
    pub(crate) fn waiting(&self) -> usize {
        self.pending.len()
    }

    /// Units that wait.
    #[must_use]
    pub(crate) fn waiting_units(&self) -> u64 {
        match self.unit {
            Unit::Stride(stride) => (self.pending.len() / stride.max(1)) as u64,
            Unit::Line => self.pending.iter().filter(|&&b| b == b'\n').count() as u64,
        }
    }

    /// True while the store holds a torn tail that it did not let go of.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn is_torn(&self) -> bool {
        self.torn
    }

    /// Identity and length of the file, beside the bytes written; `None` if it is no file, or holds an incomplete
    /// unit.
    #[must_use]
    pub(crate) fn extent(&self) -> Option<Extent> {
        let whole = (!self.torn).then_some(&self.store);
        whole.and_then(|store| store.extent(self.length))
    }

    /// Writes what waits. A store that has failed is left alone for 100 ms after each attempt.
    pub(crate) fn flush(&mut self, now_ns: u64) -> Flushed {
        match self.retry_ns {
            Some(at) if now_ns < at => Flushed::Failing,
            _ => self.flush_at_once(now_ns),
        }
    }

    /// Writes what waits, also to a store that has just failed: the last attempt of a run.
    pub(crate) fn flush_at_once(&mut self, now_ns: u64) -> Flushed {
        let result = self.repair().and_then(|()| self.write_pending());
        match result {
            Ok(()) if self.retry_ns.take().is_some() => Flushed::Recovered,
            Ok(()) => Flushed::Clean,
            Err(error) => {
                let first = self.retry_ns.is_none();
                self.retry_ns = Some(now_ns.saturating_add(RETRY_NS));
                if first {
                    Flushed::Failed(error)
                } else {
                    Flushed::Failing
                }
            }
        }
    }

    fn repair(&mut self) -> io::Result<()> {
        if self.torn {
            self.store.cut(self.length)?;
            self.torn = false;
        }
        Ok(())
    }

    fn write_pending(&mut self) -> io::Result<()> {
        let mut done = 0;
        let result = loop {
            let rest = self.pending.get(done..).unwrap_or_default();
            if rest.is_empty() {
                break Ok(());
            }
            match self.store.write(rest) {
                Ok(0) => break Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => done += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => break Err(error),
            }
        };
        let written = self.pending.get(..done).unwrap_or(&self.pending);
        let whole = self.unit.whole(written);
        self.pending.drain(..whole);
        self.length += whole as u64;
        if result.is_err() {
            // A half unit must not stay even for the 100 ms until the next attempt: readers may come by.
            self.torn = true;
            let _later_if_not_now = self.repair();
        }
        result
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// A disk that takes `room` bytes in all and then says that it is full.
    #[derive(Debug, Clone, Default)]
    pub(crate) struct SmallDisk(pub(crate) Arc<Mutex<DiskState>>);

    #[derive(Debug, Default)]
    pub(crate) struct DiskState {
        pub bytes: Vec<u8>,
        pub room: usize,
        pub cuts_refused: bool,
        pub attempts: usize,
    }

    impl SmallDisk {
        pub(crate) fn with_room(room: usize) -> Self {
            let disk = Self::default();
            disk.0.lock().unwrap().room = room;
            disk
        }
        pub(crate) fn bytes(&self) -> Vec<u8> {
            self.0.lock().unwrap().bytes.clone()
        }
        pub(crate) fn set_room(&self, room: usize) {
            self.0.lock().unwrap().room = room;
        }
    }

    impl Write for SmallDisk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut disk = self.0.lock().unwrap();
            disk.attempts += 1;
            let free = disk.room.saturating_sub(disk.bytes.len());
            if free == 0 && !bytes.is_empty() {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let count = bytes.len().min(free);
            disk.bytes.extend_from_slice(&bytes[..count]);
            Ok(count)
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Store for SmallDisk {
        fn cut(&mut self, length: u64) -> io::Result<()> {
            let mut disk = self.0.lock().unwrap();
            if disk.cuts_refused {
                return Err(io::ErrorKind::PermissionDenied.into());
            }
            disk.bytes.truncate(length as usize);
            Ok(())
        }
    }

    fn offer(appender: &mut Appender<SmallDisk>, unit: &[u8]) -> bool {
        appender.offer(unit.len(), |pending| pending.extend_from_slice(unit))
    }

    #[test]
    fn full_disk_keeps_whole_units() {
        for room in 0..=16 {
            let disk = SmallDisk::with_room(room);
            let mut appender = Appender::new(disk.clone(), Unit::Stride(4), 16);
            for unit in [b"aaaa", b"bbbb", b"cccc"] {
                assert!(offer(&mut appender, unit));
            }
            let first = appender.flush(0);
            assert_eq!(matches!(first, Flushed::Failed(_)), room < 12, "{room}");
            assert_eq!(disk.bytes(), b"aaaabbbbcccc"[..(room / 4 * 4).min(12)]);
            assert_eq!(appender.length as usize, disk.bytes().len());
            disk.set_room(100);
            if room < 12 {
                let before = disk.0.lock().unwrap().attempts;
                assert!(matches!(appender.flush(RETRY_NS - 1), Flushed::Failing));
                assert_eq!(disk.0.lock().unwrap().attempts, before, "asked too early");
                assert!(matches!(appender.flush(RETRY_NS), Flushed::Recovered));
            }
            assert_eq!(disk.bytes(), b"aaaabbbbcccc");
        }
    }

    #[test]
    fn units_beyond_the_bound_are_refused() {
        let mut appender = Appender::new(SmallDisk::with_room(0), Unit::Stride(4), 10);
        assert!(offer(&mut appender, b"aaaa") && offer(&mut appender, b"bbbb"));
        assert!(!offer(&mut appender, b"cccc"));
        assert_eq!(appender.waiting(), 8);
    }

    #[test]
    fn torn_tail_is_cut_before_the_next_write() {
        let disk = SmallDisk::with_room(6);
        disk.0.lock().unwrap().cuts_refused = true;
        let mut appender = Appender::new(disk.clone(), Unit::Stride(4), 64);
        offer(&mut appender, b"aaaa");
        offer(&mut appender, b"bbbb");
        assert!(matches!(appender.flush(0), Flushed::Failed(_)));
        assert_eq!(
            (disk.bytes(), appender.is_torn()),
            (b"aaaabb".to_vec(), true)
        );
        disk.set_room(100);
        assert!(matches!(appender.flush(RETRY_NS), Flushed::Failing));
        assert_eq!(disk.bytes(), b"aaaabb");
        disk.0.lock().unwrap().cuts_refused = false;
        assert!(matches!(appender.flush(2 * RETRY_NS), Flushed::Recovered));
        assert_eq!(
            (disk.bytes(), appender.is_torn()),
            (b"aaaabbbb".to_vec(), false)
        );
    }

    #[test]
    fn lines_are_whole_too() {
        let disk = SmallDisk::with_room(7);
        let mut appender = Appender::new(disk.clone(), Unit::Line, 64);
        offer(&mut appender, b"one\n");
        offer(&mut appender, b"three\n");
        assert!(matches!(appender.flush(0), Flushed::Failed(_)));
        assert_eq!(disk.bytes(), b"one\n");
        disk.set_room(100);
        assert!(matches!(appender.flush_at_once(1), Flushed::Recovered));
        assert_eq!(disk.bytes(), b"one\nthree\n");
    }

    #[test]
    fn file_is_cut_back_and_appended() {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(b"aaaabb").unwrap();
        file.cut(4).unwrap();
        file.write_all(b"cccc").unwrap();
        file.syncer().unwrap()().unwrap();
        let mut text = String::new();
        file.seek(SeekFrom::Start(0)).unwrap();
        io::Read::read_to_string(&mut file, &mut text).unwrap();
        assert_eq!(text, "aaaacccc");
    }
}
