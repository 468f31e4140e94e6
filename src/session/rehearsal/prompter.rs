//! Ends a rehearsal when its budget is used up, and notes how long its ticks take.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam_channel::Sender;

use gusset_control::engine::Operator;
use gusset_quantity::work::Work;
use gusset_record::rt::os;
use gusset_record::{Recorder, TimedEvent};

/// Ticks from one look at the wall clock to the next.
const EVERY: u64 = 64;

/// Drops every row. It stops the test as an operator would when its ticks are used up.
pub(crate) struct Prompter {
    /// Ticks that may be made.
    ticks: u64,
    work: Work,
    since_ns: u64,
    pace: Pace,
    operator: Sender<Operator>,
}

impl Prompter {
    /// For a rehearsal of at most `ticks`.
    pub(crate) fn new(ticks: u64, expected: u64, operator: Sender<Operator>) -> Self {
        Self {
            ticks,
            work: Work::begin("rehearsal", expected.min(ticks)),
            since_ns: 0,
            pace: Pace::default(),
            operator,
        }
    }

    /// Passes on a request of the operator; one that waits already is enough.
    pub fn ask(&self, request: Operator) {
        let _room_or_asked_already = self.operator.try_send(request);
    }

    /// The pace, to be read when the rehearsal is over.
    pub(crate) fn pace(&self) -> Pace {
        self.pace.clone()
    }
}

impl Recorder for Prompter {
    fn row(&mut self, _: &[f64]) -> bool {
        let rows = self.pace.count();
        if rows.is_multiple_of(EVERY) {
            self.work.done(rows);
            let now = os::monotonic_ns();
            if rows == EVERY {
                self.since_ns = now;
            } else {
                self.pace
                    .note(now.saturating_sub(self.since_ns), rows - EVERY);
            }
        }
        if rows >= self.ticks {
            self.ask(Operator::Stop);
        }
        true
    }

    fn event(&mut self, _: TimedEvent) -> bool {
        true
    }
}

/// Ticks of a rehearsal, and the wall time of each, the first ones not counted.
#[derive(Debug, Default, Clone)]
pub struct Pace(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    rows: AtomicU64,
    each_ps: AtomicU64,
}

impl Pace {
    /// Counts one more row, and returns the count.
    fn count(&self) -> u64 {
        self.0.rows.fetch_add(1, Ordering::Relaxed) + 1
    }

    fn note(&self, wall_ns: u64, ticks: u64) {
        let each_ps = wall_ns.saturating_mul(1000) / ticks;
        self.0.each_ps.store(each_ps, Ordering::Relaxed);
    }

    /// Ticks that were made.
    pub(crate) fn ticks(&self) -> u64 {
        self.0.rows.load(Ordering::Relaxed)
    }

    /// Mean wall time of a tick in s, if there were enough of them.
    pub(crate) fn tick_s(&self) -> Option<f64> {
        let each_ps = self.0.each_ps.load(Ordering::Relaxed);
        (each_ps > 0).then_some(each_ps as f64 * 1e-12)
    }
}
