//! States on their way from the loop to the run folder.
//!
//! The writer computes the SHA-256 of a state for its event. A separate thread writes the file, because a sync may take
//! as long as the disk likes and must hold up neither rows nor events. Then the buffer goes back to the loop.

use std::thread::JoinHandle;

use crossbeam_channel::{Receiver, Sender};
use rtrb::{Consumer, Producer};

use crate::buffers::{BUFFERS, StateReceiver};
use crate::checkpoint::{Checkpoint, StateFolder};
use crate::checksum::Checksum;

/// A state with its SHA-256.
type Hashed = (Checkpoint, Checksum);

/// The writer's end of the states, and the thread that brings them to the disk.
pub(super) struct Snapshots {
    taken: Consumer<Checkpoint>,
    to_disk: Sender<Hashed>,
    thread: JoinHandle<Kept>,
}

/// What became of the states.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Kept {
    /// States written.
    pub written: u64,
    /// States that the folder refused.
    pub refused: u64,
    /// The first error.
    pub first_error: Option<String>,
}

impl Snapshots {
    pub(super) fn spawn(ends: StateReceiver, folder: StateFolder) -> std::io::Result<Self> {
        let StateReceiver { taken, free, .. } = ends;
        // Never full: there are no more buffers.
        let (to_disk, hashed) = crossbeam_channel::bounded(BUFFERS);
        let thread = std::thread::Builder::new()
            .name("gusset-state".to_owned())
            .spawn(move || keep_all(&hashed, free, &folder))?;
        Ok(Self {
            taken,
            to_disk,
            thread,
        })
    }

    /// SHA-256 of the state after `step`, which is on its way to the disk now; none if the loop had no buffer for it.
    pub(super) fn checksum_of(&mut self, step: u64) -> Option<Checksum> {
        loop {
            if self.taken.peek().ok()?.step > step {
                return None;
            }
            let state = self.taken.pop().ok()?;
            let checksum = state.checksum();
            let is_the_one = state.step == step;
            // A state whose event was lost is written, too. Without the event no reader uses it.
            let _the_thread_has_died = self.to_disk.try_send((state, checksum));
            if is_the_one {
                return Some(checksum);
            }
        }
    }

    /// Waits for the states that are under way.
    pub(super) fn finish(self) -> Kept {
        drop(self.to_disk);
        self.thread.join().unwrap_or_default()
    }
}

fn keep_all(
    hashed: &Receiver<Hashed>,
    mut free: Producer<Checkpoint>,
    folder: &StateFolder,
) -> Kept {
    let mut kept = Kept::default();
    for (state, checksum) in hashed {
        match folder.keep(&state, checksum) {
            Ok(()) => kept.written += 1,
            Err(error) => {
                kept.refused += 1;
                if kept.first_error.is_none() {
                    tracing::error!("cannot write the state of the test: {error}");
                    kept.first_error = Some(format!("state.bin: {error}"));
                }
            }
        }
        let _there_is_room = free.push(state);
    }
    kept
}
