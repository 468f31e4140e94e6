//! When ticks begin: the grid of edges, and what a late tick does to it.
//!
//! All readings of the clock go through here. A step is never skipped: what moves is the grid, by whole ticks, so that the
//! specimens see slower time and never a burst of commands.

use super::OnMiss;
use gusset_quantity::time::{Clock, Nanos, Ratio, Schedule};
use gusset_record::rt::timing::TickStamps;

/// From the end of the set-up to the first edge, so that the first edge can be met.
const LEAD_NS: u64 = 2_000_000;

/// The grid of edges and the clock that it belongs to.
pub(super) struct Pace {
    clock: Box<dyn Clock>,
    period: Ratio,
    on_miss: OnMiss,
    schedule: Schedule,
    /// Number of the next edge.
    edge: u64,
    /// The latest reading that was kept.
    now: Nanos,
    first_edge: Nanos,
}

impl Pace {
    /// A grid of this period that has not begun.
    pub(crate) fn new(clock: Box<dyn Clock>, period: Ratio, on_miss: OnMiss) -> Self {
        Self {
            clock,
            period,
            on_miss,
            schedule: Schedule::new(Nanos(0), period),
            edge: 0,
            now: Nanos(0),
            // No time has passed since an edge that is not there yet.
            first_edge: Nanos(u64::MAX),
        }
    }

    /// True on simulated time.
    #[inline]
    pub(crate) fn is_simulated(&self) -> bool {
        self.clock.is_simulated()
    }

    /// Policy for a tick that is late by a period or more.
    #[inline]
    pub(crate) const fn on_miss(&self) -> OnMiss {
        self.on_miss
    }

    /// Reads the clock. Real-time: yes.
    #[inline]
    pub(crate) fn read(&self) -> Nanos {
        self.clock.now()
    }

    /// Reads the clock and keeps the reading for events. Real-time: yes.
    #[inline]
    pub(crate) fn keep_reading(&mut self) -> Nanos {
        self.now = self.clock.now();
        self.now
    }

    /// The reading that was kept. Real-time: yes.
    #[inline]
    pub(crate) const fn now(&self) -> Nanos {
        self.now
    }

    /// Sleeps. Real-time: yes.
    #[inline]
    pub(crate) fn sleep_until(&self, at: Nanos) {
        self.clock.sleep_until(at);
    }

    /// From here on edges have this period; the next one has passed already. Returns the period before.
    pub(crate) fn take_period(&mut self, period: Ratio) -> Ratio {
        self.schedule = Schedule::new(Nanos(0), period);
        self.edge = 0;
        std::mem::replace(&mut self.period, period)
    }

    /// The edge after the present tick comes a whole period after its wake-up, however late that was. Real-time: yes.
    pub(crate) fn count_from(&mut self, woke: Nanos) {
        self.schedule = Schedule::new(woke, self.period);
        self.edge = 1;
    }

    /// A new grid that begins shortly after now.
    pub(crate) fn begin(&mut self) {
        self.edge = 0;
        let now = self.keep_reading();
        let start = self.clock.grid_start(now.plus(LEAD_NS));
        self.schedule = Schedule::new(start, self.period);
        self.first_edge = self.schedule.tick(0);
    }

    /// The test begins: rows count wall time from its first edge, which can be met.
    pub(crate) fn begin_test(&mut self) {
        let now = self.read();
        self.skip_edges_before(now);
        self.first_edge = self.schedule.tick(self.edge);
    }

    /// Waits until a received command may leave: if it `is_paced` for the next edge, else not at all. A command that comes late moves the
    /// edges behind it. True if it came late by more than half a period. Real-time: yes.
    pub(crate) fn wait_for_client(&mut self, is_paced: bool, stamps: &mut TickStamps) -> bool {
        if !is_paced {
            // The clock was read when it came.
            (stamps.release, stamps.woke) = (self.now, self.now);
            return false;
        }
        let now = self.read();
        let edge = self.next_edge();
        let late_ns = now.since(edge);
        if late_ns > 0 {
            self.schedule = Schedule::new(now, self.period);
            self.edge = 0;
        } else {
            self.sleep_until(edge);
        }
        stamps.release = self.next_edge();
        self.begin_tick(stamps);
        late_ns > self.period_ns() / 2
    }

    /// True if the next command comes later than a tick after its edge. Real-time: yes.
    pub(crate) fn is_behind(&self) -> bool {
        self.read().since(self.next_edge()) > self.period_ns()
    }

    /// The edge from which rows count wall time.
    #[inline]
    pub(crate) const fn first_edge(&self) -> Nanos {
        self.first_edge
    }

    /// Time of the next edge. Real-time: yes.
    #[inline]
    pub(crate) fn next_edge(&self) -> Nanos {
        self.schedule.tick(self.edge)
    }

    /// Number of the next edge. Real-time: yes.
    #[inline]
    pub(crate) const fn edge(&self) -> u64 {
        self.edge
    }

    /// The tick of the next edge begins: reads the clock and moves on to the edge that ends the tick. Real-time: yes.
    #[inline]
    pub(crate) fn begin_tick(&mut self, stamps: &mut TickStamps) {
        stamps.woke = self.keep_reading();
        self.edge += 1;
        stamps.deadline = self.schedule.tick(self.edge);
    }

    /// Period in ns, rounded. Real-time: yes.
    #[inline]
    pub(crate) const fn period_ns(&self) -> u64 {
        self.schedule.period_ns()
    }

    /// Period in s.
    pub(crate) fn period_s(&self) -> f64 {
        self.period.value()
    }

    /// Whole ticks by which the grid was moved. Real-time: yes.
    #[inline]
    pub(crate) const fn stretched(&self) -> u64 {
        self.schedule.stretched()
    }

    /// Moves on to the first edge at or after `now`. Returns the number of edges skipped. Steps are not counted by edges: none is
    /// lost. Real-time: yes.
    pub(crate) fn skip_edges_before(&mut self, now: Nanos) -> u64 {
        let behind = now.since(self.schedule.tick(self.edge));
        let ticks = behind.div_ceil(self.schedule.period_ns().max(1));
        self.edge += ticks;
        ticks
    }

    /// Moves the grid by the whole periods in `late_ns`, as far as the policy wants it. Returns the ticks. Real-time: yes.
    #[inline]
    pub(crate) fn stretch(&mut self, late_ns: u64) -> u64 {
        let period = self.schedule.period_ns().max(1);
        if late_ns < period {
            return 0;
        }
        let whole = late_ns / period;
        let ticks = match self.on_miss {
            OnMiss::Stretch => whole,
            OnMiss::CatchUp { at_most } => whole.saturating_sub(at_most),
            OnMiss::Stop => 0,
        };
        if ticks > 0 {
            self.schedule.stretch(ticks);
        }
        ticks
    }
}
