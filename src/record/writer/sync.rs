//! The thread that waits for the disk so that the writer need not.

use std::thread::JoinHandle;

use crossbeam_channel::Sender;

use crate::record::append::Syncer;
use crate::record::threads::{Roll, What};

/// The files that are synced, in the order of their syncers.
const FILES: [What; 2] = [What::SyncRows, What::SyncEvents];

/// Bytes that the files have.
pub(super) type Lengths = [u64; FILES.len()];

/// What is asked for: files that have so many bytes, and whether that was the last time.
type Asked = (Lengths, bool);

/// A running thread that syncs when asked.
#[derive(Debug)]
pub(super) struct SyncThread {
    ask: Sender<Asked>,
    thread: JoinHandle<u64>,
}

impl SyncThread {
    /// Starts it on the files behind `syncers`: rows, then events.
    pub(super) fn spawn(
        mut syncers: [Syncer; FILES.len()],
        roll: Option<Roll>,
    ) -> std::io::Result<Self> {
        let (ask, asked) = crossbeam_channel::bounded::<Asked>(1);
        let work = move || {
            let stamper = roll.map(|roll| roll.enter());
            let (mut failures, mut synced) = (0, Lengths::default());
            let mut sync = |lengths: Lengths| {
                let each = syncers
                    .iter_mut()
                    .zip(FILES)
                    .zip(lengths.iter().zip(synced));
                for ((sync, what), (length, before)) in each {
                    let begin_ns = stamper.as_ref().map(|stamper| stamper.now());
                    if let Err(error) = sync() {
                        failures += 1;
                        if failures == 1 {
                            tracing::error!("cannot sync the run folder to disk: {error}");
                        }
                    }
                    if let (Some(stamper), Some(begin_ns)) = (&stamper, begin_ns) {
                        stamper.since(what, begin_ns, length.saturating_sub(before));
                    }
                }
                synced = lengths;
            };
            let (mut latest, mut done) = (Lengths::default(), false);
            for (lengths, last) in &asked {
                sync(lengths);
                (latest, done) = (lengths, last);
            }
            if !done {
                sync(latest);
            }
            failures
        };
        let thread = std::thread::Builder::new()
            .name("gusset-sync".to_owned())
            .spawn(work)?;
        Ok(Self { ask, thread })
    }

    /// Asks for a sync of files that have so many bytes; if one is waiting already, that one will do.
    pub(super) fn ask(&self, lengths: Lengths) {
        let _one_waits_already = self.ask.try_send((lengths, false));
    }

    /// One last sync of files that have so many bytes; the number of syncs that failed.
    pub(super) fn finish(self, lengths: Lengths) -> u64 {
        // Behind the one that may be waiting.
        let _its_panic_shows_below = self.ask.send((lengths, true));
        drop(self.ask);
        self.thread.join().unwrap_or(1)
    }
}
