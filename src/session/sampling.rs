//! The sampler of a session: the kernel's counters of the loop's thread, on their way to the writer.

use crossbeam_channel::Sender;

use crate::record::SchedSample;
use crate::record::threads::{Roll, What};
use crate::rt::Granted;
use crate::rt::sampler::{Sampler, SchedSample as SamplerReading};

/// Watches the loop's thread; without it misses are not classed.
pub(super) fn spawn_sampler(
    thread_id: i32,
    granted: &Option<Granted>,
    into: Sender<SchedSample>,
    roll: Roll,
) -> Option<Sampler> {
    let cpu = granted.as_ref().and_then(|granted| granted.cpu);
    // On the sampler's own thread, with its first look.
    let mut stamper = None;
    let looked = move |began_ns| {
        let stamper = stamper.get_or_insert_with(|| roll.enter());
        stamper.since(What::Look, began_ns, 0);
    };
    match Sampler::spawn_told(thread_id, cpu, into, looked) {
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
        }
    }
}
