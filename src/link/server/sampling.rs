//! The times of a session: arrival of the last command, the sample that is due, and when to read in a busy loop.
//!
//! The thread sleeps until shortly before the next command is expected, then reads in a busy loop until shortly after.

use crate::Wait;
use gusset_quantity::time::Nanos;

/// The times of one session.
#[derive(Debug)]
pub(super) struct SampleClock {
    begun: Nanos,
    arrived: Nanos,
    /// From the arrival of a command to the sample; none: at once.
    after_ns: Option<u64>,
    /// The sample of the command in force is due at this time.
    due_at: Option<Nanos>,
    period_ns: u64,
    spin_ns: u64,
}

impl SampleClock {
    pub(crate) const fn new(
        now: Nanos,
        after_ns: Option<u64>,
        period_ns: u64,
        spin_ns: u64,
    ) -> Self {
        Self {
            begun: now,
            arrived: now,
            after_ns,
            due_at: None,
            period_ns,
            spin_ns,
        }
    }

    /// A command arrived. Returns true if its sample is due later. Real-time: yes.
    pub(crate) fn arrive(&mut self, now: Nanos) -> bool {
        self.arrived = now;
        self.due_at = self.after_ns.map(|after| now.plus(after));
        self.due_at.is_some()
    }

    /// True if a sample is still to be taken. Real-time: yes.
    pub(crate) const fn is_waiting(&self) -> bool {
        self.due_at.is_some()
    }

    /// True if a sample is due now. Real-time: yes.
    pub(crate) fn is_due(&self, now: Nanos) -> bool {
        self.due_at.is_some_and(|at| now >= at)
    }

    /// The sample is taken, or no longer wanted. Returns the time since the command arrived, s. Real-time: yes.
    pub(crate) fn take(&mut self, now: Nanos) -> f64 {
        self.due_at = None;
        now.since(self.arrived) as f64 * 1e-9
    }

    /// Time since the session began, s. Real-time: yes.
    pub(crate) fn own_time(&self, now: Nanos) -> f64 {
        now.since(self.begun) as f64 * 1e-9
    }

    /// How to wait for bytes, and until when, but not after `until`. `runs`: commands come at the announced rate. Real-time: yes.
    pub(crate) fn wait(&self, now: Nanos, until: Nanos, runs: bool) -> (Wait, Nanos) {
        let until = self.due_at.map_or(until, |at| until.min(at));
        let expected = self.arrived.plus(self.period_ns);
        let (from, to) = (expected.minus(self.spin_ns), expected.plus(self.spin_ns));
        if runs && self.spin_ns > 0 && now >= from && now < to {
            (Wait::SPIN, until.min(to))
        } else if now < from {
            (Wait::SLEEP, until.min(from))
        } else {
            (Wait::SLEEP, until)
        }
    }
}
