//! A run folder's samples and events in memory, byte for byte as in the files: for thousands of tests.

use super::event_log::{EventContext, EventLog, Moment};
use super::journal::encode;
use super::{Recorder, TimedEvent};

/// The contents of `samples.bin` and `events.jsonl`.
pub struct FolderImage {
    columns: usize,
    samples: Vec<u8>,
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
        Self::into_memory(Vec::new(), columns, specimens)
    }

    /// An image in the memory of an earlier test: its content is discarded, its allocation reused.
    #[must_use]
    pub fn into_memory(mut samples: Vec<u8>, columns: usize, specimens: Vec<String>) -> Self {
        samples.clear();
        let context = EventContext {
            specimens,
            ..EventContext::default()
        };
        Self {
            columns,
            samples,
            events: EventLog::new(Vec::new(), context),
            rows: 0,
        }
    }

    /// The bytes of `samples.bin`.
    #[must_use]
    pub fn samples(&self) -> &[u8] {
        &self.samples
    }

    /// Takes the bytes of `samples.bin` out, to reuse their memory.
    #[must_use]
    pub fn into_samples(self) -> Vec<u8> {
        self.samples
    }

    /// Writes the events that wait; the bytes of `events.jsonl`.
    pub fn events(&mut self) -> &[u8] {
        self.events.finish(Moment::default());
        &self.events.lines.store
    }
}

impl Recorder for FolderImage {
    fn row(&mut self, row: &[f64]) -> bool {
        let fits = row.len() == self.columns;
        if fits {
            encode(self.rows, row, &mut self.samples);
        }
        self.rows += 1;
        fits
    }

    fn event(&mut self, event: TimedEvent) -> bool {
        self.events.event(event, Moment::default());
        true
    }
}
