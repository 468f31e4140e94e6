//! Watches the loop's thread from another processor: context switches, page faults, steal.
//!
//! The loop itself makes no such call. About a hundred times a second the sampler reads four files of the kernel into
//! fixed buffers and sends a [`SchedSample`]; the receiver joins them to the misses by time. /proc/stat counts in 10
//! ms units, so steal is evidence over a window and not proof for one miss. A full queue drops the sample; nothing waits.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

use crossbeam_channel::Sender;

use super::{apply, os, proc};

/// Readings of the kernel's counters of the loop's thread at one instant. All counts are since the thread (steal: the
/// machine) was started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SchedSample {
    /// CLOCK_MONOTONIC.
    pub clock_ns: u64,
    /// Times the processor was taken from the thread.
    pub involuntary_switches: u64,
    /// Times the thread gave the processor up.
    pub voluntary_switches: u64,
    /// Page faults served without reading from a disk.
    pub minor_faults: u64,
    /// Time the hypervisor took from the loop's processor, in 10 ms units.
    pub steal_ticks: u64,
    /// Time in which the thread was ready and waited for a processor, ns; 0 of a kernel that does not count it.
    pub waited_ns: u64,
    /// Times the process was continued after a stop.
    pub continued: u64,
}

/// Times the process was continued after a stop, as far as a handler has counted them.
static CONTINUED: AtomicU64 = AtomicU64::new(0);

/// The process was continued after a stop.
pub fn count_continuation() {
    CONTINUED.fetch_add(1, Ordering::Relaxed);
}

/// A sample every 10 ms.
const PERIOD_NS: u64 = 10_000_000;
/// After a pause of this length the next sample waits for the handler of a continuation.
const PAUSE_NS: u64 = 5 * PERIOD_NS;
/// Holds the lines of 256 processors, which come first in /proc/stat.
const BUFFER: usize = 32 * 1024;

/// A running sampler. Ends when it is dropped, or when the thread it watches is gone.
#[derive(Debug)]
pub struct Sampler {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Sampler {
    /// Watches thread `thread_id` of this process, which runs on processor `cpu`, from any other processor.
    ///
    /// # Errors
    /// The kernel's files of that thread cannot be opened, or no thread can be started.
    pub fn spawn(
        thread_id: i32,
        cpu: Option<usize>,
        samples: Sender<SchedSample>,
    ) -> io::Result<Self> {
        let mut source = Source::open(thread_id, cpu)?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::Builder::new()
            .name("gusset-sampler".into())
            .spawn(move || {
                // With one processor there is no other; the sampler is then a small disturbance.
                let _ = cpu.map(apply::pin_away);
                let _ = os::block_signals();
                let mut at = os::monotonic_ns();
                while !stopped.load(Ordering::Relaxed) {
                    let Some(sample) = source.read() else { break };
                    let _lost_if_full = samples.try_send(sample);
                    at = os::monotonic_ns().max(at + PERIOD_NS);
                    os::sleep_until_ns(at);
                    if os::monotonic_ns() > at + PAUSE_NS {
                        os::sleep_until_ns(os::monotonic_ns() + PERIOD_NS);
                    }
                }
            })?;
        let thread = Some(thread);
        Ok(Self { stop, thread })
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A sampler that panicked has nothing more to say.
            let _ = thread.join();
        }
    }
}

/// The open files and the buffer they are read into.
#[derive(Debug)]
struct Source {
    status: File,
    task: File,
    /// Absent in a kernel that does not count what threads wait.
    waits: Option<File>,
    machine: File,
    cpu: Option<usize>,
    buffer: Vec<u8>,
}

impl Source {
    fn open(thread_id: i32, cpu: Option<usize>) -> io::Result<Self> {
        Ok(Self {
            status: File::open(format!("/proc/self/task/{thread_id}/status"))?,
            task: File::open(format!("/proc/self/task/{thread_id}/stat"))?,
            waits: File::open(format!("/proc/self/task/{thread_id}/schedstat")).ok(),
            machine: File::open("/proc/stat")?,
            cpu,
            buffer: vec![0; BUFFER],
        })
    }

    /// None once the thread is gone. Allocates nothing.
    fn read(&mut self) -> Option<SchedSample> {
        let switches = proc::switches(read_into(&self.status, &mut self.buffer)?)?;
        let minor_faults = proc::minor_faults(read_into(&self.task, &mut self.buffer)?)?;
        let waits = self.waits.as_ref();
        let waits = waits.and_then(|file| read_into(file, &mut self.buffer));
        let waited_ns = waits.and_then(proc::waited_ns).unwrap_or(0);
        let machine = read_into(&self.machine, &mut self.buffer)?;
        // A machine that does not count steal has none to show.
        let steal_ticks = proc::steal_ticks(machine, self.cpu).unwrap_or(0);
        Some(SchedSample {
            clock_ns: os::monotonic_ns(),
            involuntary_switches: switches.involuntary,
            voluntary_switches: switches.voluntary,
            minor_faults,
            steal_ticks,
            waited_ns,
            continued: CONTINUED.load(Ordering::Relaxed),
        })
    }
}

/// The kernel regenerates these files for every read from their start.
fn read_into<'a>(file: &File, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    let mut filled = 0;
    loop {
        match file.read_at(buffer.get_mut(filled..)?, filled as u64) {
            Ok(0) => return buffer.get(..filled),
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_ordered_and_counts_rise() {
        let (sender, receiver) = crossbeam_channel::bounded(64);
        let sampler = Sampler::spawn(os::thread_id(), None, sender).unwrap();
        // This thread waits for each of them, so its voluntary switches must grow sooner or later.
        let mut samples: Vec<SchedSample> = vec![receiver.recv().unwrap()];
        let grows = |samples: &[SchedSample]| {
            let last = samples[samples.len() - 1];
            last.minor_faults > 0 && last.voluntary_switches > samples[0].voluntary_switches
        };
        while samples.len() < 3 || (!grows(&samples) && samples.len() < 2000) {
            // 40 MB come from the kernel as new pages, whose first touches are faults to count.
            std::hint::black_box(vec![1_u8; 40 << 20]);
            let pause = std::time::Duration::from_millis(1);
            crossbeam_channel::after(pause).recv().unwrap();
            samples.push(receiver.recv().unwrap());
        }
        drop(sampler);
        for pair in samples.windows(2) {
            let (first, second) = (pair[0], pair[1]);
            assert!(second.clock_ns > first.clock_ns);
            assert!(second.involuntary_switches >= first.involuntary_switches);
            assert!(second.voluntary_switches >= first.voluntary_switches);
            assert!(second.minor_faults >= first.minor_faults);
            assert!(second.steal_ticks >= first.steal_ticks);
        }
        assert!(grows(&samples));
    }

    #[test]
    fn full_queue_never_waits() {
        let (sender, receiver) = crossbeam_channel::bounded(0);
        drop(Sampler::spawn(os::thread_id(), None, sender).unwrap());
        drop(receiver);
    }

    #[test]
    fn sampler_ends_with_its_thread() {
        let (sender, receiver) = crossbeam_channel::bounded::<SchedSample>(64);
        assert!(Sampler::spawn(i32::MAX, None, sender.clone()).is_err());
        let (done, wait) = crossbeam_channel::bounded::<()>(0);
        let (tell, told) = crossbeam_channel::bounded(1);
        let watched = std::thread::spawn(move || {
            tell.send(os::thread_id()).unwrap();
            let _ = wait.recv();
        });
        let sampler = Sampler::spawn(told.recv().unwrap(), None, sender).unwrap();
        receiver.recv().unwrap();
        drop(done);
        watched.join().unwrap();
        // The sampler's end of the channel closes when it finds the thread gone.
        while receiver.recv().is_ok() {}
        drop(sampler);
    }

    #[test]
    fn one_reading_allocates_nothing() {
        let mut source = Source::open(os::thread_id(), Some(0)).unwrap();
        let info = allocation_counter::measure(|| {
            for _ in 0..5 {
                assert!(source.read().is_some());
            }
        });
        assert_eq!(info.count_total, 0);
    }

    #[test]
    fn long_file_is_cut_at_the_buffer() {
        let file = File::open("/proc/stat").unwrap();
        let mut small = [0; 16];
        let text = read_into(&file, &mut small).unwrap();
        assert!(text.starts_with(b"cpu"));
    }
}
