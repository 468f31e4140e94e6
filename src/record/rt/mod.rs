//! Requests to the operating system and its answers, the real clock, and the timing of the loop.
//!
//! A run asks for real-time conditions with an [`RtPlan`]; [`apply`](apply::apply) asks for them one by one on the
//! calling thread and answers with a [`Granted`]. It states for each whether it was granted and, if not, why and what
//! to do about it. Refusal is not an error here: the program continues and reports what is missing, or, when
//! real-time conditions are required, the caller refuses to start ([`Granted::must_refuse`]).
//!
//! Deliberately absent: deadlines and their policy, which belong to the loop, and any text on a terminal.
//!
//! | file | holds |
//! |---|---|
//! | [`os`] | system calls, the only unsafe code |
//! | [`mod@apply`] | asking, and the advice on refusal |
//! | [`throttle`] | the kernel's budget for real-time threads, and the spin that fits into it |
//! | [`clock`] | the monotonic clock: sleep, then spin |
//! | [`control_socket`] | a local socket for programs of the same user |
//! | [`wall`] | UTC |
//! | [`timing`] | histograms of the tick, misses and their first classification |
//! | [`sampler`] | context switches, page faults and steal, watched from another processor |
//! | [`secret_file`] | files that hold a secret |
//! | [`load`] | a hungry neighbour, for measurements |
//! | [`doctor`] | what this machine gives and lacks |
//! | [`proc`] | readers of the kernel's text files |

use std::fs::File;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub mod apply;
pub mod clock;
pub mod control_socket;
pub mod doctor;
pub mod load;
pub mod os;
pub mod packet;
pub mod proc;
pub mod sampler;
pub mod secret_file;
pub mod throttle;
pub mod timing;
pub mod wall;

pub use apply::{apply, pin_away};
pub use clock::MonotonicClock;
pub use throttle::Spin;

/// Requests of a run to the operating system for its loop's thread.
#[derive(Debug, Clone, PartialEq)]
pub struct RtPlan {
    /// Priority under SCHED_FIFO, 1 to 98; none for normal scheduling.
    pub fifo_priority: Option<u8>,
    /// Processor of the loop; none: the last one that the process may use, so that 0 is left to the system.
    pub cpu: Option<usize>,
    /// Keep all memory of the process in RAM.
    pub lock_memory: bool,
    /// Keep idle processors out of deep sleep.
    pub hold_cpu_awake: bool,
    /// Spin before each edge, in nanoseconds.
    pub spin_ns: u64,
    /// Length of a tick in nanoseconds: bounds the spin.
    pub period_ns: u64,
    /// Refuse to start when the system refuses any request.
    pub require: bool,
}

/// One request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Want {
    /// The loop's thread runs on a processor of the loop's choice.
    Affinity,
    /// SCHED_FIFO.
    Policy,
    /// mlockall.
    LockMemory,
    /// A touched stack.
    Prefault,
    /// A zero in /dev/cpu_dma_latency.
    CpuAwake,
    /// Timers that are not bundled.
    TimerSlack,
    /// Signals go to other threads.
    Signals,
}

/// Answer to one request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Feature {
    /// Kind of request.
    pub want: Want,
    /// The request in words.
    pub asked: String,
    /// True if it was granted.
    pub granted: bool,
    /// Error number of the refusal.
    pub errno: Option<i32>,
    /// Why it was refused.
    pub reason: Option<String>,
    /// What to do about it.
    pub advice: Option<String>,
}

/// The operating system's answers. Holds the processors awake for as long as it, or a clone of it, lives.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Granted {
    /// True if no request was refused.
    pub complete: bool,
    /// True if the run must not start without all of it.
    pub required: bool,
    /// The loop's processor; none if it is not bound to one.
    pub cpu: Option<usize>,
    /// The answer to each request, in order.
    pub features: Vec<Feature>,
    /// The spin before each edge and the kernel's budget.
    pub spin: Spin,
    #[serde(skip)]
    _awake: Option<Arc<File>>,
}

impl PartialEq for Granted {
    fn eq(&self, other: &Self) -> bool {
        let answers = |of: &Self| {
            (
                of.complete,
                of.required,
                of.cpu,
                of.features.clone(),
                of.spin.clone(),
            )
        };
        answers(self) == answers(other)
    }
}

impl Granted {
    /// Requests that were refused.
    pub fn missing(&self) -> impl Iterator<Item = &Feature> {
        self.features.iter().filter(|feature| !feature.granted)
    }

    /// True if real-time conditions are required and not all of them were granted: nothing may be moved.
    #[must_use]
    pub fn must_refuse(&self) -> bool {
        self.required && !self.complete
    }

    /// True if `want` was requested and granted.
    #[must_use]
    pub(crate) fn has(&self, want: Want) -> bool {
        self.features.iter().any(|f| f.want == want && f.granted)
    }

    /// The clock that the plan and the kernel's budget allow.
    #[must_use]
    pub fn clock(&self) -> MonotonicClock {
        MonotonicClock::new(self.spin.used_ns())
    }

    /// True while idle processors are held out of deep sleep.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn holds_cpu_awake(&self) -> bool {
        self._awake.is_some()
    }
}
