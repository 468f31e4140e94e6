//! The sampler of a session: the kernel's counters of the loop's thread, on their way to the writer.

use crossbeam_channel::Sender;

use crate::record::SchedSample;
use crate::rt::Granted;
use crate::rt::sampler::{Sampler, SchedSample as SamplerReading};

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

impl From<SamplerReading> for SchedSample {
    fn from(reading: SamplerReading) -> Self {
        Self {
            clock_ns: reading.clock_ns,
            involuntary_switches: reading.involuntary_switches,
            minor_faults: reading.minor_faults,
            steal_ticks: reading.steal_ticks,
            waited_ns: reading.waited_ns,
            continued: reading.continued,
        }
    }
}
