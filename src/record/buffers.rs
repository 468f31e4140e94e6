//! Buffers in which the loop hands states to the writer and gets them back, without waiting.
//!
//! The loop allocates a few buffers before it begins. A state is taken straight into a free buffer; the buffer passes
//! through one wait-free ring to the writer and comes back through another when its file is on the disk. If no buffer is
//! free, the state of this checkpoint is skipped and counted: the rows are then retraced from the checkpoint before.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rtrb::{Consumer, Producer, RingBuffer};

use super::checkpoint::Checkpoint;
use gusset_quantity::state::{StateError, TestState};

/// Buffers of one test: one with the writer, one at the disk, one free.
pub(super) const BUFFERS: usize = 3;

/// The two ends of a new set of buffers; the loop has still to allocate them.
pub(super) fn state_buffers() -> (StateSender, StateReceiver) {
    let (taken_in, taken_out) = RingBuffer::new(BUFFERS);
    let (free_in, free_out) = RingBuffer::new(BUFFERS);
    let sender = StateSender {
        spare: Vec::with_capacity(BUFFERS),
        free: free_out,
        taken: taken_in,
        skipped: Arc::default(),
    };
    let receiver = StateReceiver {
        taken: taken_out,
        free: free_in,
        skipped: Arc::clone(&sender.skipped),
    };
    (sender, receiver)
}

/// The loop's end.
#[derive(Debug)]
pub(super) struct StateSender {
    /// Buffers that are at hand.
    spare: Vec<Checkpoint>,
    free: Consumer<Checkpoint>,
    taken: Producer<Checkpoint>,
    skipped: Arc<AtomicU64>,
}

impl StateSender {
    /// Allocates the buffers, each with the room of `room`.
    pub(crate) fn allocate(&mut self, room: &TestState) {
        self.spare.clear();
        self.spare.extend((0..BUFFERS).map(|_| Checkpoint {
            step: 0,
            rows: 0,
            state: room.with_same_room(),
        }));
    }

    /// Has `take` write the state after `step` into a free buffer, and hands the buffer over. False if there is no buffer or no
    /// state. Real-time: yes.
    pub(crate) fn hand_over(
        &mut self,
        step: u64,
        rows: u64,
        take: &mut dyn FnMut(&mut TestState) -> Result<(), StateError>,
    ) -> bool {
        let free = self.free.pop().ok();
        let Some(mut buffer) = free.or_else(|| self.spare.pop()) else {
            self.skipped.fetch_add(1, Ordering::Relaxed);
            return false;
        };
        (buffer.step, buffer.rows) = (step, rows);
        let back = match take(&mut buffer.state) {
            Ok(()) => match self.taken.push(buffer) {
                Ok(()) => return true,
                Err(rtrb::PushError::Full(buffer)) => buffer,
            },
            Err(_) => buffer,
        };
        // There is room: it has come from here or from the other ring.
        self.spare.push(back);
        self.skipped.fetch_add(1, Ordering::Relaxed);
        false
    }
}

/// The writer's end: states that were taken, the ring that returns their buffers, and the count of skipped states.
#[derive(Debug)]
pub(super) struct StateReceiver {
    pub taken: Consumer<Checkpoint>,
    pub free: Producer<Checkpoint>,
    pub skipped: Arc<AtomicU64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_without_a_free_buffer_is_skipped() {
        let (mut sender, mut receiver) = state_buffers();
        let mut values = [0.0; 4];
        let room = TestState::with_room(|visit| visit.numbers(&mut values));
        sender.allocate(&room);
        let mut arrived = Vec::with_capacity(10);
        let used = allocation_counter::measure(|| {
            for step in 0..5 {
                values[0] = step as f64;
                let taken = sender.hand_over(step, 10 * step, &mut |state| {
                    state.take(|visit| visit.numbers(&mut values))
                });
                assert_eq!(taken, step < BUFFERS as u64);
            }
            for _ in 0..2 {
                let buffer = receiver.taken.pop().unwrap();
                arrived.push((buffer.step, buffer.rows, buffer.state.words()[0]));
                receiver.free.push(buffer).unwrap();
            }
            // A state that cannot be taken leaves its buffer free.
            for step in 5..8 {
                assert!(!sender.hand_over(step, 0, &mut |_| Err(StateError::Pending)));
            }
            for step in 8..10 {
                assert!(sender.hand_over(step, 0, &mut |state| {
                    state.take(|visit| visit.numbers(&mut values))
                }));
            }
        });
        assert_eq!(used.count_total, 0);
        assert_eq!(arrived, [(0, 0, 0), (1, 10, 1.0_f64.to_bits())]);
        assert_eq!(receiver.skipped.load(Ordering::Relaxed), 5);
        let rest: Vec<u64> = std::iter::from_fn(|| receiver.taken.pop().ok())
            .map(|buffer| buffer.step)
            .collect();
        assert_eq!(rest, [2, 8, 9]);
    }

    #[test]
    fn loop_without_buffers_keeps_nothing() {
        let (mut sender, mut receiver) = state_buffers();
        assert!(!sender.hand_over(1, 1, &mut |_| Ok(())));
        assert!(receiver.taken.pop().is_err());
    }
}
