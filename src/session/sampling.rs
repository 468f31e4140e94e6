//! The sampler of a session: it sends the kernel's counters of the loop's thread to the writer.

use crossbeam_channel::Sender;

use gusset_record::rt::Granted;
use gusset_record::rt::sampler::{Sampler, SchedSample};

/// Watches the loop's thread; without it misses are not classed.
pub(super) fn spawn_sampler(
    thread_id: i32,
    granted: &Option<Granted>,
    into: Sender<SchedSample>,
) -> Option<Sampler> {
    let cpu = granted.as_ref().and_then(|granted| granted.cpu);
    match Sampler::spawn(thread_id, cpu, into) {
        Ok(sampler) => Some(sampler),
        Err(error) => {
            tracing::warn!(
                "misses cannot be classed: the loop's thread cannot be watched: {error}"
            );
            None
        }
    }
}
