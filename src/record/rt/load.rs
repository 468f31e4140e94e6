//! A hungry neighbour: streams through a large buffer and calculates, on another processor than the loop's.
//!
//! For measuring the loop under load. Ordinary priority; it takes cache, memory bandwidth and whatever of the
//! machine's power budget processors share, and no lock or system call of ours.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

use super::{apply, os};

/// A running load. Ends when it is stopped or dropped.
#[derive(Debug)]
pub struct Load {
    stop: Arc<AtomicBool>,
    streamed: Arc<AtomicU64>,
    /// Processors that the load may run on.
    pub cpus: Vec<usize>,
    thread: Option<JoinHandle<()>>,
}

/// Larger than the last-level cache of common processors.
pub const USUAL_BYTES: usize = 128 << 20;
/// Work between two looks at the stop flag: 64 kB.
const CHUNK: usize = 8192;

impl Load {
    /// Starts the load on any processor but `away_from`, the loop's, with a buffer of `bytes`.
    ///
    /// With one processor there is no other: then it runs beside the loop, and `cpus` is empty.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn start(away_from: usize, bytes: usize) -> io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let streamed = Arc::new(AtomicU64::new(0));
        let (flag, count) = (Arc::clone(&stop), Arc::clone(&streamed));
        let (ready, started) = crossbeam_channel::bounded(1);
        let thread = std::thread::Builder::new()
            .name("gusset-load".into())
            .spawn(move || {
                let cpus = apply::pin_away(away_from).unwrap_or_default();
                let _ = os::block_signals();
                let _ = ready.send(cpus);
                stream(bytes, &flag, &count);
            })?;
        let cpus = started.recv().unwrap_or_default();
        let thread = Some(thread);
        Ok(Self {
            stop,
            streamed,
            cpus,
            thread,
        })
    }

    /// Ends the load; returns the bytes it streamed.
    #[must_use]
    pub fn stop(mut self) -> u64 {
        self.end();
        self.streamed.load(Ordering::Relaxed)
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the load is not worth one of ours.
            let _ = thread.join();
        }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.end();
    }
}

fn stream(bytes: usize, stop: &AtomicBool, streamed: &AtomicU64) {
    let mut buffer = vec![1u64; (bytes / 8).max(CHUNK)];
    let mut seed = 0x9E37_79B9_7F4A_7C15_u64;
    while !stop.load(Ordering::Relaxed) {
        for chunk in buffer.chunks_mut(CHUNK) {
            if stop.load(Ordering::Relaxed) {
                return;
            }
            for word in chunk.iter_mut() {
                // Each word depends on the one before: keeps the adders busy while memory is fetched.
                seed = (seed ^ *word)
                    .wrapping_mul(0xD129_0D3C_7C2F_7A35)
                    .rotate_left(29);
                *word = seed;
            }
            streamed.fetch_add(16 * chunk.len() as u64, Ordering::Relaxed);
        }
        std::hint::black_box(&mut buffer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_avoids_the_loop_processor_and_ends() {
        let own = os::process_cpus().last().copied().unwrap();
        let load = Load::start(own, 1 << 20).unwrap();
        assert!(!load.cpus.contains(&own));
        while load.streamed.load(Ordering::Relaxed) == 0 {
            os::yield_now();
        }
        assert!(load.stop() > 0);
    }

    #[test]
    fn dropping_ends_the_load() {
        let load = Load::start(0, 0).unwrap();
        let streamed = Arc::clone(&load.streamed);
        drop(load);
        // The thread held the other two ends.
        assert_eq!(Arc::strong_count(&streamed), 1);
    }
}
