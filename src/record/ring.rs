//! The loop's end of the recording: two wait-free single-producer rings, one of rows and one of events.
//!
//! * A row is pushed whole or not at all, in one copy, without allocation, lock or system call.
//! * Every row offered takes a sequence number, whether there was room for it or not: a gap in the numbers that
//!   arrive is exactly the rows that were lost, and where.
//! * Full means drop and count ([`WhenFull::Drop`], the real clock) or yield until there is room
//!   ([`WhenFull::Wait`], the simulated clock, where no wall time is at stake).
//! * Both rings are filled and drained once by [`ring`]: a first touch of their pages costs up to 70 µs.
//! * The state of a checkpoint goes through separate buffers, and is skipped if no buffer is free.
//! * The reader polls. The loop never wakes a thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rtrb::{Consumer, Producer, PushError, RingBuffer};
use thiserror::Error;

use super::buffers::{StateReceiver, StateSender, state_buffers};
use super::{Event, Recorder, TimedEvent};
use gusset_quantity::state::{StateError, TestState};

/// Behaviour of the recorder when a row finds the ring full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WhenFull {
    /// The row is dropped and counted; the caller never waits. For the real clock.
    Drop,
    /// The caller yields until there is room, as long as the reader lives. For the simulated clock.
    Wait,
}

/// How much the rings hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RingSize {
    /// Rows, at least one.
    pub rows: usize,
    /// Events, at least one.
    pub events: usize,
}

/// Memory that the default ring may take: it is locked for the whole run.
const RING_BYTES: usize = 64 << 20;

impl RingSize {
    /// `seconds` of rows at `rate_hz`, at least 1024 rows, at most 64 MiB (but never less than 64 rows).
    ///
    /// Four seconds are the default because the writer's file writes can be held up by the disk for that long and no longer in
    /// ordinary trouble (a journal commit, a dirty-page stall); see the notes at [`super::writer`].
    #[must_use]
    pub fn for_rate(columns: usize, rate_hz: f64, seconds: f64) -> Self {
        // Saturating: a rate that is not a number becomes 0 here and the floor below takes over.
        let wanted = ((seconds * rate_hz) as usize).max(1024);
        let fits = (RING_BYTES / (8 * (columns + 1))).max(64);
        Self {
            rows: wanted.min(fits),
            events: 4096,
        }
    }
}

/// Why no ring could be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum RingError {
    /// A capacity of zero, or one whose size in memory cannot be expressed.
    #[error(
        "ring of {rows} rows of {columns} columns and {events} events: each must be at least 1 and fit in memory"
    )]
    Size {
        /// Rows requested.
        rows: usize,
        /// Columns per row.
        columns: usize,
        /// Events requested.
        events: usize,
    },
}

/// Rows and events lost because a ring was full; readable from any thread, also after the run.
#[derive(Debug, Clone, Default)]
pub struct LostCounts(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    rows: AtomicU64,
    events: AtomicU64,
}

impl LostCounts {
    /// Rows lost so far.
    #[must_use]
    pub(crate) fn rows(&self) -> u64 {
        self.0.rows.load(Ordering::Relaxed)
    }

    /// Events lost so far.
    #[must_use]
    pub(crate) fn events(&self) -> u64 {
        self.0.events.load(Ordering::Relaxed)
    }
}

/// The two ends of a new recording of rows with `columns` values, its pages already touched.
///
/// # Errors
/// [`RingError::Size`] if a capacity or the number of columns is zero or absurd.
pub fn ring(
    columns: usize,
    size: RingSize,
    when_full: WhenFull,
) -> Result<(RingRecorder, RingReader), RingError> {
    let RingSize { rows, events } = size;
    let refused = RingError::Size {
        rows,
        columns,
        events,
    };
    let framed = columns.checked_add(1).ok_or(refused)?;
    let slots = framed.checked_mul(rows).ok_or(refused)?;
    let inside = slots <= isize::MAX as usize / 16 && events <= isize::MAX as usize / 256;
    if !(columns > 0 && rows > 0 && events > 0 && inside) {
        return Err(refused);
    }
    let (row_in, row_out) = RingBuffer::new(slots);
    let (event_in, event_out) = RingBuffer::new(events);
    let lost = LostCounts::default();
    let (states_in, states_out) = state_buffers();
    let mut recorder = RingRecorder {
        rows: row_in,
        events: event_in,
        states: states_in,
        framed: vec![0.0; framed],
        next: 0,
        when_full,
        lost: lost.clone(),
    };
    let mut reader = RingReader {
        rows: row_out,
        events: event_out,
        states_skipped: Arc::clone(&states_out.skipped),
        states: Some(states_out),
        framed: vec![0.0; framed],
        lost,
    };
    warm(&mut recorder, &mut reader);
    Ok((recorder, reader))
}

/// Fills and drains both rings once, then resets the sequence numbers.
fn warm(recorder: &mut RingRecorder, reader: &mut RingReader) {
    while recorder.rows.push_entire_slice(&recorder.framed).is_ok() {}
    while reader.row().is_some() {}
    let event = || TimedEvent {
        tick: 0,
        time: 0.0,
        clock_ns: 0,
        kind: Event::Started,
    };
    while recorder.events.push(event()).is_ok() {}
    while reader.event().is_some() {}
}

/// The loop's end.
#[derive(Debug)]
pub struct RingRecorder {
    rows: Producer<f64>,
    events: Producer<TimedEvent>,
    states: StateSender,
    /// Sequence number (its bits), then the row.
    framed: Vec<f64>,
    next: u64,
    when_full: WhenFull,
    lost: LostCounts,
}

impl RingRecorder {
    /// The counters of lost rows and events; keep a clone to read them after the run.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn lost(&self) -> LostCounts {
        self.lost.clone()
    }
}

impl Recorder for RingRecorder {
    /// Takes one row; false if it was dropped: the ring is full, the reader is gone (under
    /// [`WhenFull::Wait`]), or the row has not as many values as there are columns. Real-time: yes.
    fn row(&mut self, row: &[f64]) -> bool {
        let sequence = self.next;
        self.next += 1;
        let taken = match self.framed.split_first_mut() {
            Some((head, body)) if body.len() == row.len() => {
                *head = f64::from_bits(sequence);
                body.copy_from_slice(row);
                push(&mut self.rows, self.when_full, |rows| {
                    rows.push_entire_slice(&self.framed).is_ok()
                })
            }
            _ => false,
        };
        if !taken {
            self.lost.0.rows.fetch_add(1, Ordering::Relaxed);
        }
        taken
    }

    fn allocate_states(&mut self, room: &TestState) {
        self.states.allocate(room);
    }

    /// Hands over a state without waiting. Real-time: yes.
    fn state(
        &mut self,
        step: u64,
        take: &mut dyn FnMut(&mut TestState) -> Result<(), StateError>,
    ) -> bool {
        self.states.hand_over(step, self.next, take)
    }

    /// Takes one event; false if it was dropped. Real-time: yes.
    fn event(&mut self, event: TimedEvent) -> bool {
        let mut waiting = Some(event);
        let taken = push(&mut self.events, self.when_full, |events| {
            let Some(event) = waiting.take() else {
                return true;
            };
            match events.push(event) {
                Ok(()) => true,
                Err(PushError::Full(event)) => {
                    waiting = Some(event);
                    false
                }
            }
        });
        if !taken {
            self.lost.0.events.fetch_add(1, Ordering::Relaxed);
        }
        taken
    }
}

/// One attempt, or attempts until there is room or no reader is left. Real-time: yes (under `Drop`).
fn push<T>(
    ring: &mut Producer<T>,
    when_full: WhenFull,
    mut attempt: impl FnMut(&mut Producer<T>) -> bool,
) -> bool {
    loop {
        if attempt(ring) {
            return true;
        }
        if when_full == WhenFull::Drop || ring.is_abandoned() {
            return false;
        }
        // Ends when the reader makes room or is dropped.
        std::thread::yield_now();
    }
}

/// The writer's end. It polls.
#[derive(Debug)]
pub struct RingReader {
    rows: Consumer<f64>,
    events: Consumer<TimedEvent>,
    states: Option<StateReceiver>,
    states_skipped: Arc<AtomicU64>,
    framed: Vec<f64>,
    lost: LostCounts,
}

impl RingReader {
    /// Values per row.
    #[must_use]
    pub(crate) fn columns(&self) -> usize {
        self.framed.len() - 1
    }

    /// Whole rows that wait now.
    #[must_use]
    pub(crate) fn waiting(&self) -> usize {
        self.rows.slots() / self.framed.len()
    }

    /// Rows that the ring holds at most.
    #[must_use]
    pub(crate) fn capacity(&self) -> usize {
        self.rows.buffer().capacity() / self.framed.len()
    }

    /// The oldest row and its sequence number.
    pub fn row(&mut self) -> Option<(u64, &[f64])> {
        self.rows.pop_entire_slice(&mut self.framed).ok()?;
        let (head, body) = self.framed.split_first()?;
        Some((head.to_bits(), body))
    }

    /// Events that wait now.
    #[must_use]
    pub(crate) fn events_waiting(&self) -> usize {
        self.events.slots()
    }

    /// The oldest event.
    pub(crate) fn event(&mut self) -> Option<TimedEvent> {
        self.events.pop().ok()
    }

    /// The receiving end of the states. The first call takes it; later calls return none.
    pub(super) const fn take_states(&mut self) -> Option<StateReceiver> {
        self.states.take()
    }

    /// States that found no free buffer, or could not be taken.
    pub(super) fn states_skipped(&self) -> u64 {
        self.states_skipped.load(Ordering::Relaxed)
    }

    /// The counters of lost rows and events.
    #[must_use]
    pub(crate) fn lost(&self) -> LostCounts {
        self.lost.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: RingSize = RingSize { rows: 3, events: 2 };

    fn event(tick: u64) -> TimedEvent {
        TimedEvent {
            tick,
            time: 0.5,
            clock_ns: 7,
            kind: Event::RowLost,
        }
    }

    #[test]
    fn full_ring_drops_and_counts_whole_rows() {
        let (mut recorder, mut reader) = ring(2, SIZE, WhenFull::Drop).unwrap();
        for k in 0..5 {
            assert_eq!(recorder.row(&[k as f64, -1.0]), k < 3);
        }
        assert_eq!((reader.lost().rows(), reader.waiting()), (2, 3));
        for k in 0..3u64 {
            assert_eq!(reader.row(), Some((k, &[k as f64, -1.0][..])));
        }
        assert_eq!(reader.row(), None);
        // The next row shows by its number that two are missing before it.
        assert!(recorder.row(&[9.0, 9.0]));
        assert_eq!(reader.row(), Some((5, &[9.0, 9.0][..])));
        for tick in 0..3 {
            assert_eq!(recorder.event(event(tick)), tick < 2);
        }
        assert_eq!(recorder.lost().events(), 1);
        assert_eq!(reader.event(), Some(event(0)));
    }

    #[test]
    fn row_of_wrong_length_is_refused() {
        let (mut recorder, mut reader) = ring(2, SIZE, WhenFull::Wait).unwrap();
        assert!(!recorder.row(&[1.0]));
        assert!(recorder.row(&[1.0, 2.0]));
        assert_eq!(reader.lost().rows(), 1);
        assert_eq!(reader.row(), Some((1, &[1.0, 2.0][..])));
    }

    #[test]
    fn wait_delivers_every_row_in_order() {
        let (mut recorder, reader) = ring(2, SIZE, WhenFull::Wait).unwrap();
        let lost = recorder.lost();
        let count = 20_000u64;
        std::thread::scope(move |scope| {
            scope.spawn(move || {
                for k in 0..count {
                    assert!(recorder.row(&[k as f64, 0.5 * k as f64]));
                }
            });
            // Dropped at the end of the scope, so that a failed assertion does not leave the other thread waiting.
            let mut reader = reader;
            let mut expected = 0u64;
            while expected < count {
                match reader.row() {
                    Some((sequence, row)) => {
                        assert_eq!(sequence, expected);
                        assert_eq!(row, [expected as f64, 0.5 * expected as f64]);
                        expected += 1;
                    }
                    None => std::thread::yield_now(),
                }
            }
        });
        assert_eq!(lost.rows(), 0);
    }

    #[test]
    fn dead_reader_ends_the_wait() {
        let (mut recorder, reader) = ring(1, SIZE, WhenFull::Wait).unwrap();
        drop(reader);
        let taken = (0..5).filter(|_| recorder.row(&[1.0])).count();
        assert_eq!((taken, recorder.lost().rows()), (3, 2));
    }

    #[test]
    fn pushing_allocates_nothing() {
        let (mut recorder, mut reader) = ring(40, SIZE, WhenFull::Drop).unwrap();
        let row = [1.5; 40];
        let used = allocation_counter::measure(|| {
            for _ in 0..100 {
                recorder.row(&row);
                recorder.event(event(1));
                reader.row();
                reader.event();
            }
            // And full.
            for _ in 0..10 {
                recorder.row(&row);
                recorder.event(event(1));
            }
        });
        assert_eq!((used.count_total, recorder.lost().rows()), (0, 7));
    }

    #[test]
    fn impossible_ring_sizes_are_refused() {
        for (columns, rows, events) in [(0, 1, 1), (1, 0, 1), (1, 1, 0), (1, usize::MAX, 1)] {
            assert!(ring(columns, RingSize { rows, events }, WhenFull::Drop).is_err());
        }
        assert_eq!(RingSize::for_rate(20, 4096.0, 4.0).rows, 16_384);
        assert_eq!(RingSize::for_rate(20, f64::NAN, 4.0).rows, 1024);
        assert_eq!(
            RingSize::for_rate(20_000, 1e9, 4.0).rows,
            RING_BYTES / (8 * 20_001)
        );
    }
}
