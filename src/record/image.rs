//! A run folder's samples and events in memory, byte for byte as they would stand in the files: for tests by the
//! thousand.

use super::append::Flushed;
use super::events::{EventContext, EventLog, Moment};
use super::journal::JournalWriter;
use super::{Event, Recorder};

/// Bytes of rows that may wait; they are handed on at once.
const WAITING: usize = 64 << 10;

/// The contents of `samples.bin` and `events.jsonl`.
pub struct FolderImage {
    samples: JournalWriter<Vec<u8>>,
    events: EventLog<Vec<u8>>,
    rows: u64,
}

impl std::fmt::Debug for FolderImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FolderImage")
            .field("rows", &self.rows)
            .finish_non_exhaustive()
    }
}

impl FolderImage {
    /// For rows of `columns` values of a test of these specimens.
    #[must_use]
    pub fn new(columns: usize, specimens: Vec<String>) -> Self {
        let context = EventContext {
            specimens,
            ..EventContext::default()
        };
        Self {
            samples: JournalWriter::new(Vec::new(), columns, WAITING),
            events: EventLog::new(Vec::new(), context),
            rows: 0,
        }
    }

    /// The bytes of `samples.bin`.
    #[must_use]
    pub fn samples(&self) -> &[u8] {
        self.samples.store()
    }

    /// Writes the events that wait; the bytes of `events.jsonl`.
    pub fn events(&mut self) -> &[u8] {
        self.events.finish(Moment::default());
        self.events.store()
    }
}

impl Recorder for FolderImage {
    fn row(&mut self, row: &[f64]) -> bool {
        let taken = self.samples.row(self.rows, row);
        self.rows += 1;
        taken && matches!(self.samples.flush(0), Flushed::Clean)
    }

    fn event(&mut self, event: Event) -> bool {
        self.events.event(event, Moment::default());
        true
    }
}
