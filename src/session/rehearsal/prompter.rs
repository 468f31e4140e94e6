//! Sees to it that a rehearsal ends in time, and how long its ticks take.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crossbeam_channel::Sender;

use crate::engine::Operator;
use crate::record::{Event, Recorder};
use crate::rt::os;

/// Ticks from one look at the wall clock to the next.
const EVERY: u64 = 64;

/// Keeps nothing of what it is handed; asks the operator's way to stop when there is no more time.
pub struct Prompter {
    until_ns: u64,
    rows: u64,
    since_ns: u64,
    pace: Pace,
    operator: Sender<Operator>,
}

impl Prompter {
    /// For a rehearsal that begins now.
    pub fn new(budget: Duration, operator: Sender<Operator>) -> Self {
        let budget_ns = u64::try_from(budget.as_nanos()).unwrap_or(u64::MAX);
        Self {
            until_ns: os::monotonic_ns().saturating_add(budget_ns),
            rows: 0,
            since_ns: 0,
            pace: Pace::default(),
            operator,
        }
    }

    /// Hands over a word of the operator. Who is asked twice for the same hears the first.
    pub fn ask(&self, request: Operator) {
        let _room_or_asked_already = self.operator.try_send(request);
    }

    /// What it finds of the pace, to be read when the rehearsal is over.
    pub fn pace(&self) -> Pace {
        self.pace.clone()
    }
}

impl Recorder for Prompter {
    fn row(&mut self, _: &[f64]) -> bool {
        self.rows += 1;
        if self.rows.is_multiple_of(EVERY) {
            let now = os::monotonic_ns();
            if self.rows == EVERY {
                self.since_ns = now;
            } else {
                let ticks = self.rows - EVERY;
                self.pace.note(now.saturating_sub(self.since_ns), ticks);
            }
            if now > self.until_ns {
                self.ask(Operator::Stop);
            }
        }
        true
    }

    fn event(&mut self, _: Event) -> bool {
        true
    }
}

/// Wall time of a rehearsal's ticks, the first ones not counted.
#[derive(Debug, Default, Clone)]
pub struct Pace(Arc<AtomicU64>);

impl Pace {
    fn note(&self, wall_ns: u64, ticks: u64) {
        let each_ps = wall_ns.saturating_mul(1000) / ticks;
        self.0.store(each_ps, Ordering::Relaxed);
    }

    /// Mean wall time of a tick in s, if there were enough of them to tell.
    pub fn tick_s(&self) -> Option<f64> {
        let each_ps = self.0.load(Ordering::Relaxed);
        (each_ps > 0).then_some(each_ps as f64 * 1e-12)
    }
}
