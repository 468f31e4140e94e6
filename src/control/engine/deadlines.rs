//! Deadline misses, gaps and the histograms of the loop's timing.

use super::columns::{Lateness, Row, number};
use super::misses::MissWindow;
use super::{OnMiss, Pace, TestLimits};
use gusset_record::MissCause;
use gusset_record::rt::timing::{Miss, Suspect, TickStamps, Timing};

/// Times in which no command left although each tick has one, outside of the ticks of the test, where such are misses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Gaps {
    /// How many.
    pub times: u64,
    /// The longest, ns.
    pub longest_ns: u64,
}

/// Shortest gap that is reported, in ns; a specimen that is commanded once a step may take its time.
const GAP_NS: u64 = 100_000_000;
const GAP_PER_STEP_NS: u64 = 1_000_000_000;

/// One deadline miss.
#[derive(Debug, Clone, Copy)]
pub(super) struct Missed {
    pub cause: MissCause,
    pub late_ns: u64,
    /// Ticks by which the grid was moved for it.
    pub stretched: u64,
    /// The tick was late by a whole period or more.
    pub by_a_period: bool,
}

/// Counts of misses and the histograms.
pub(super) struct Deadlines {
    timing: Timing,
    /// The tick whose stamps are not in the histograms yet.
    unrecorded: Option<TickStamps>,
    total: u64,
    in_a_row: u64,
    window: MissWindow,
    gaps: Gaps,
    shortest_gap_ns: u64,
}

impl Deadlines {
    /// Counts from 0. `per_step`: a specimen is commanded once a step.
    pub(crate) fn new(timing: Timing, limits: &TestLimits, per_step: bool) -> Self {
        Self {
            timing,
            unrecorded: None,
            total: 0,
            in_a_row: 0,
            window: MissWindow::new(limits),
            gaps: Gaps::default(),
            shortest_gap_ns: if per_step { GAP_PER_STEP_NS } else { GAP_NS },
        }
    }

    /// Misses in all. Real-time: yes.
    #[inline]
    pub(crate) const fn total(&self) -> u64 {
        self.total
    }

    /// Misses in a row. Real-time: yes.
    #[inline]
    pub(crate) const fn in_a_row(&self) -> u64 {
        self.in_a_row
    }

    /// Gaps so far.
    pub(crate) const fn gaps(&self) -> Gaps {
        self.gaps
    }

    /// Counts a gap; false if it is too short to be reported. Real-time: yes.
    pub(crate) fn gap(&mut self, late_ns: u64) -> bool {
        if late_ns < self.shortest_gap_ns {
            return false;
        }
        self.gaps.times += 1;
        self.gaps.longest_ns = self.gaps.longest_ns.max(late_ns);
        true
    }

    /// Round trip of one port. Real-time: yes.
    #[inline]
    pub(crate) fn round_trip(&mut self, port: usize, ns: u64) {
        self.timing.round_trip(port, ns);
    }

    /// A tick of the warm-up. Real-time: yes.
    pub(crate) fn warm_up_tick(&mut self, stamps: &TickStamps) {
        self.timing.tick(stamps);
    }

    /// Forgets the times so far: they do not belong to the test.
    pub(crate) fn forget_timing(&mut self) {
        self.timing.reset();
    }

    /// The last tick of the test goes into the histograms.
    pub(crate) fn flush(&mut self) {
        if let Some(stamps) = self.unrecorded.take() {
            self.timing.tick(&stamps);
        }
    }

    /// The histograms. They are megabytes: a second call has none.
    pub(crate) fn take_timing(&mut self) -> Timing {
        std::mem::replace(&mut self.timing, Timing::counting())
    }

    /// Moves the grid after a stall, and counts the ticks that never happened. `booked_ns` is added to count the lateness from the
    /// edge of the tick in which the stall showed. Real-time: yes.
    #[inline]
    pub(crate) fn stretch(&mut self, pace: &mut Pace, late_ns: u64, booked_ns: u64) -> u64 {
        let ticks = pace.stretch(late_ns);
        if ticks > 0 {
            let period = pace.period_ns().max(1);
            self.timing.swallowed(late_ns + booked_ns, period, ticks);
        }
        ticks
    }

    /// Ends a tick of the test, before which `stalled` ticks were skipped. Counts a miss and moves the grid by the policy.
    /// Real-time: yes.
    #[inline]
    pub(crate) fn close(
        &mut self,
        pace: &mut Pace,
        row: &mut Row,
        mut stamps: TickStamps,
        stalled: u64,
    ) -> Option<Missed> {
        // The histograms of the tick before are updated here, so that their cost is inside `record`.
        if let Some(before) = &self.unrecorded {
            self.timing.tick(before);
        }
        stamps.pushed = pace.keep_reading();
        row.record_before = number(stamps.pushed.since(stamps.ready)) * 1e-9;
        if stamps.pushed <= stamps.deadline {
            self.unrecorded = Some(stamps);
            self.in_a_row = 0;
            row.lateness.in_a_row = 0;
            row.lateness.in_window = self.window.at(pace.edge());
            return None;
        }
        self.unrecorded = None;
        let miss = self.timing.tick(&stamps)?;
        Some(self.count(miss, pace, row, &stamps, stalled))
    }

    #[cold]
    fn count(
        &mut self,
        Miss {
            suspect, late_ns, ..
        }: Miss,
        pace: &mut Pace,
        row: &mut Row,
        stamps: &TickStamps,
        stalled: u64,
    ) -> Missed {
        let period = pace.period_ns();
        let overrun_ns = stamps.pushed.since(pace.next_edge());
        let skipped = self.stretch(pace, overrun_ns, period);
        self.total += 1;
        self.in_a_row += 1;
        row.lateness = Lateness {
            in_a_row: self.in_a_row,
            in_window: self.window.note(pace.edge()),
            in_total: self.total,
            skipped_by_wakeup: 0,
            skipped_by_work: skipped,
            overrun_ns: if skipped > 0 { overrun_ns + period } else { 0 },
        };
        Missed {
            cause: match suspect {
                Suspect::LateReply => MissCause::LateReply,
                Suspect::TakenAway => MissCause::TakenAway,
                Suspect::Ours => MissCause::Ours,
            },
            late_ns,
            stretched: stalled + skipped,
            by_a_period: stamps.woke.since(stamps.release).max(late_ns) >= period,
        }
    }

    /// True if the policy ends the test at this miss. Real-time: yes.
    pub(crate) fn ends_the_test(missed: &Missed, policy: OnMiss) -> bool {
        policy == OnMiss::Stop && missed.by_a_period
    }
}
