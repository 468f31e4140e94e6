//! The thread that waits for the disk so that the writer need not.

use std::thread::JoinHandle;

use crossbeam_channel::Sender;

use crate::record::append::Syncer;

/// A running thread that syncs when asked.
#[derive(Debug)]
pub(super) struct SyncThread {
    ask: Sender<()>,
    thread: JoinHandle<u64>,
}

impl SyncThread {
    /// Starts it on the files behind `syncers`.
    pub(super) fn spawn(mut syncers: Vec<Syncer>) -> std::io::Result<Self> {
        let (ask, asked) = crossbeam_channel::bounded::<()>(1);
        let work = move || {
            let mut failures = 0;
            let mut sync = || {
                for result in syncers.iter_mut().map(|sync| sync()) {
                    if let Err(error) = result {
                        failures += 1;
                        if failures == 1 {
                            tracing::error!("cannot sync the run folder to disk: {error}");
                        }
                    }
                }
            };
            for () in &asked {
                sync();
            }
            sync();
            failures
        };
        let thread = std::thread::Builder::new()
            .name("gusset-sync".to_owned())
            .spawn(work)?;
        Ok(Self { ask, thread })
    }

    /// Asks for a sync; if one is waiting already, that one will do.
    pub(super) fn ask(&self) {
        let _one_waits_already = self.ask.try_send(());
    }

    /// One last sync; the number of syncs that failed.
    pub(super) fn finish(self) -> u64 {
        drop(self.ask);
        self.thread.join().unwrap_or(1)
    }
}
