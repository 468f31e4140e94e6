//! A recorder that keeps everything in memory, for tests and short offline runs.
//!
//! It never drops. Inside the capacity given at construction it allocates nothing; beyond it, it grows.

use super::{Recorder, TimedEvent};

/// Rows and events in memory.
#[derive(Debug, Clone, Default)]
pub struct MemoryRecorder {
    columns: usize,
    values: Vec<f64>,
    events: Vec<TimedEvent>,
}

impl MemoryRecorder {
    /// A recorder of rows with `columns` values, with room for `rows` rows and `events` events.
    #[must_use]
    pub fn with_capacity(columns: usize, rows: usize, events: usize) -> Self {
        Self {
            columns,
            values: Vec::with_capacity(columns.saturating_mul(rows)),
            events: Vec::with_capacity(events),
        }
    }

    /// Number of rows.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.values.len().checked_div(self.columns).unwrap_or(0)
    }

    /// The rows in order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> + '_ {
        self.values.chunks_exact(self.columns.max(1))
    }

    /// One column over all rows; empty if there is no such column.
    #[cfg(test)]
    pub(crate) fn column(&self, index: usize) -> impl Iterator<Item = f64> + '_ {
        self.rows().filter_map(move |row| row.get(index).copied())
    }

    /// The events in order.
    #[must_use]
    pub fn events(&self) -> &[TimedEvent] {
        &self.events
    }
}

impl Recorder for MemoryRecorder {
    /// Takes one row; false if it has not as many values as there are columns. Real-time: inside the capacity.
    fn row(&mut self, row: &[f64]) -> bool {
        let fits = row.len() == self.columns;
        if fits {
            self.values.extend_from_slice(row);
        }
        fits
    }

    /// Takes one event. Real-time: inside the capacity.
    fn event(&mut self, event: TimedEvent) -> bool {
        self.events.push(event);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_columns_come_back_unchanged() {
        let mut recorder = MemoryRecorder::with_capacity(2, 2, 0);
        assert!(recorder.row(&[1.0, 2.0]));
        assert!(recorder.row(&[3.0, 4.0]));
        assert!(!recorder.row(&[5.0]));
        assert_eq!(recorder.len(), 2);
        assert_eq!(recorder.rows().last(), Some(&[3.0, 4.0][..]));
        assert_eq!(recorder.column(1).collect::<Vec<_>>(), [2.0, 4.0]);
    }
}
