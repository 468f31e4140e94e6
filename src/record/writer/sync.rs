//! The thread that waits for the disk so that the writer need not.

use std::thread::JoinHandle;

use crossbeam_channel::Sender;

use crate::append::Syncer;

/// Files that are synced: rows, then events.
const FILES: usize = 2;

/// A running thread that syncs on request. A request states whether it is the last.
#[derive(Debug)]
pub(super) struct SyncThread {
    ask: Sender<bool>,
    thread: JoinHandle<u64>,
}

impl SyncThread {
    /// Starts it on the files behind `syncers`: rows, then events.
    pub(super) fn spawn(
        mut syncers: [Syncer; FILES],
        away_from: Option<usize>,
    ) -> std::io::Result<Self> {
        let (ask, asked) = crossbeam_channel::bounded(1);
        let work = move || {
            super::leave(away_from);
            let mut failures = 0;
            let mut sync = || {
                for sync in &mut syncers {
                    if let Err(error) = sync() {
                        failures += 1;
                        if failures == 1 {
                            tracing::error!("cannot sync the run folder to disk: {error}");
                        }
                    }
                }
            };
            let mut done = false;
            for last in &asked {
                sync();
                done = last;
            }
            if !done {
                sync();
            }
            failures
        };
        let thread = std::thread::Builder::new()
            .name("gusset-sync".to_owned())
            .spawn(work)?;
        Ok(Self { ask, thread })
    }

    /// Asks for a sync. A request that waits already is enough.
    pub(super) fn ask(&self) {
        let _one_waits_already = self.ask.try_send(false);
    }

    /// One last sync; the number of syncs that failed.
    pub(super) fn finish(self) -> u64 {
        // Behind the one that may be waiting.
        let _its_panic_shows_below = self.ask.send(true);
        drop(self.ask);
        self.thread.join().unwrap_or(1)
    }
}
