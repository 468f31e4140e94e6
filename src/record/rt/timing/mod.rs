//! Timing of the loop: one histogram per quantity of a tick, misses, and a first guess at their cause.
//!
//! The loop takes a handful of clock readings per tick ([`TickStamps`]) and hands them over once; everything else
//! follows. All buffers are allocated and touched at construction; recording allocates nothing. Lateness
//! is never negative: an early wake-up counts as zero and is counted apart.
//!
//! **Stalls are not hidden.** When the loop is stalled for several periods and the grid is moved on by n ticks, those
//! n ticks never happened, and a plain histogram would show one bad tick where n were due (coordinated omission).
//! [`Timing::swallowed`] counts them. On the grid before it was moved, tick k + j would have started j periods after
//! tick k, so it was late by (late − j·T). That lateness is recorded in `wakeup_lateness` and `command_lateness` for
//! every j from 1 to n. When missed ticks run back to back instead, each records its own lateness and nothing is
//! added. `miss` holds one value per miss that really happened.
//!
//! Values are kept in nanoseconds with 3 significant digits, up to 10 s, and reported in microseconds.

use hdrhistogram::Histogram;

use gusset_quantity::time::Nanos;

pub mod export;
pub mod suspect;
mod tally;

pub use export::{Percentiles, TimingEntry, Timings};
pub use suspect::Suspect;
use suspect::Typical;
use tally::{Tally, histogram};

/// A timed part of the tick. The keys are those of `timing.json`, `summary.json` and `jitter --json`.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Edge → first instruction after the wait.
    WakeupLateness,
    /// Edge → the last send has returned.
    CommandLateness,
    /// Send → reply decoded, all specimens together.
    RoundTrip,
    /// Last reply decoded → next command ready.
    Compute,
    /// Next command ready → row pushed.
    Record,
    /// First instruction after the wait → row pushed.
    TickTime,
    /// Row pushed → next edge, when positive.
    Slack,
    /// Next edge → row pushed, when that is later.
    Miss,
}

impl Quantity {
    /// All quantities, in the order of reports.
    pub const ALL: [Quantity; 8] = [
        Self::WakeupLateness,
        Self::CommandLateness,
        Self::RoundTrip,
        Self::Compute,
        Self::Record,
        Self::TickTime,
        Self::Slack,
        Self::Miss,
    ];

    /// Key in every file.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::WakeupLateness => "wakeup_lateness",
            Self::CommandLateness => "command_lateness",
            Self::RoundTrip => "round_trip",
            Self::Compute => "compute",
            Self::Record => "record",
            Self::TickTime => "tick_time",
            Self::Slack => "slack",
            Self::Miss => "miss",
        }
    }
}

/// Clock readings of one tick, in the order in which they are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TickStamps {
    /// The loop was done with the tick before and began to wait.
    pub idle: Nanos,
    /// Edge t_k, before any stretch that this tick causes.
    pub release: Nanos,
    /// First instruction after the wait.
    pub woke: Nanos,
    /// The last send has returned.
    pub sent: Nanos,
    /// The last reply is decoded.
    pub decoded: Nanos,
    /// The next command is ready.
    pub ready: Nanos,
    /// The row is pushed. To have `record` include the histograms' own cost, hand tick k over in tick k + 1.
    pub pushed: Nanos,
    /// Edge t_{k+1}.
    pub deadline: Nanos,
}

/// A deadline miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Miss {
    /// Lateness, in nanoseconds.
    pub late_ns: u64,
    /// Cause by the stamps alone.
    pub suspect: Suspect,
}

/// Histograms of one run.
#[derive(Debug, Clone)]
pub struct Timing {
    wakeup_lateness: Tally,
    command_lateness: Tally,
    compute: Tally,
    record: Tally,
    tick_time: Tally,
    slack: Tally,
    miss: Tally,
    /// One per specimen, in the order of the test.
    round_trip: Vec<(String, Tally)>,
    typical: Typical,
    warmup_ticks: u64,
    counts: Counts,
    warmup: Counts,
}

/// Plain counts beside the histograms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Ticks handed over.
    pub ticks: u64,
    /// Deadline misses among them.
    pub misses: u64,
    /// Wake-ups before the edge, counted as lateness zero.
    pub early_wakeups: u64,
    /// Ticks skipped in a stall: they were due and never happened.
    pub swallowed: u64,
}

impl Timing {
    /// Empty histograms for specimens of these names.
    ///
    /// `awaits_peer`: a specimen answers over a link, so a long reply is the peer's doing and not ours. The first
    /// `warmup_ticks` ticks are counted apart and reach no histogram.
    #[must_use]
    pub fn new(specimens: &[&str], awaits_peer: bool, warmup_ticks: u64) -> Self {
        Self::with(specimens, awaits_peer, warmup_ticks, Tally::touched)
    }

    /// Histograms for simulated time, whose memory pages need not be touched beforehand: a short test costs little.
    #[must_use]
    pub fn untouched(specimens: &[&str], awaits_peer: bool, warmup_ticks: u64) -> Self {
        Self::with(specimens, awaits_peer, warmup_ticks, Tally::new)
    }

    /// Counts ticks and misses and keeps no histogram: for a loop whose clock measures no machine.
    #[must_use]
    pub fn counting() -> Self {
        Self::with(&[], false, u64::MAX, Tally::none)
    }

    fn with(
        specimens: &[&str],
        awaits_peer: bool,
        warmup_ticks: u64,
        tally: impl Fn() -> Tally,
    ) -> Self {
        Self {
            wakeup_lateness: tally(),
            command_lateness: tally(),
            compute: tally(),
            record: tally(),
            tick_time: tally(),
            slack: tally(),
            miss: tally(),
            round_trip: specimens
                .iter()
                .map(|name| ((*name).to_owned(), tally()))
                .collect(),
            typical: Typical::new(awaits_peer),
            warmup_ticks,
            counts: Counts::default(),
            warmup: Counts::default(),
        }
    }

    /// True while ticks are counted apart. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn is_warming_up(&self) -> bool {
        self.warmup.ticks < self.warmup_ticks
    }

    /// Records one exchange with specimen `port` (from 0); an unknown port is ignored. Real-time: yes.
    #[inline]
    pub fn round_trip(&mut self, port: usize, ns: u64) {
        if self.is_warming_up() {
            return;
        }
        if let Some((_, tally)) = self.round_trip.get_mut(port) {
            tally.record(ns);
        }
    }

    /// Records one tick; returns a missed deadline. Real-time: yes.
    #[inline]
    pub fn tick(&mut self, stamps: &TickStamps) -> Option<Miss> {
        let late_ns = stamps.pushed.since(stamps.deadline);
        let suspect = self.typical.judge(stamps, late_ns > 0);
        let warming_up = self.is_warming_up();
        let counts = if warming_up {
            &mut self.warmup
        } else {
            &mut self.counts
        };
        counts.ticks += 1;
        counts.misses += u64::from(late_ns > 0);
        counts.early_wakeups += u64::from(stamps.woke < stamps.release);
        if !warming_up {
            self.wakeup_lateness
                .record(stamps.woke.since(stamps.release));
            self.command_lateness
                .record(stamps.sent.since(stamps.release));
            self.compute.record(stamps.ready.since(stamps.decoded));
            self.record.record(stamps.pushed.since(stamps.ready));
            self.tick_time.record(stamps.pushed.since(stamps.woke));
            if late_ns > 0 {
                self.miss.record(late_ns);
            } else {
                self.slack.record(stamps.deadline.since(stamps.pushed));
            }
        }
        (late_ns > 0).then_some(Miss { late_ns, suspect })
    }

    /// Counts `ticks` ticks that were due while the loop was stalled and that the grid was moved past.
    ///
    /// `late_ns` is the lateness, against the edge before it was moved, of the tick at which the stall showed: its
    /// wake-up lateness, or its miss plus one period when the stall came after the wake-up. Skipped tick j (from 1)
    /// is recorded as late by `late_ns` − j·`period_ns`, not below zero. All are counted; beyond 1024 neighbours
    /// share one value, so that the work is bounded. Real-time: yes.
    pub fn swallowed(&mut self, late_ns: u64, period_ns: u64, ticks: u64) {
        const MOST_VALUES: u64 = 1024;
        if self.is_warming_up() {
            self.warmup.swallowed += ticks;
            return;
        }
        self.counts.swallowed += ticks;
        let group = ticks.div_ceil(MOST_VALUES).max(1);
        let mut j = 0;
        while j < ticks {
            let count = group.min(ticks - j);
            let middle = j + count.div_ceil(2);
            let late = late_ns.saturating_sub(middle.saturating_mul(period_ns));
            self.wakeup_lateness.record_n(late, count);
            self.command_lateness.record_n(late, count);
            j += count;
        }
    }

    /// Forgets everything counted so far, except what is typical. Not for the loop: it writes megabytes.
    pub fn reset(&mut self) {
        for tally in [
            &mut self.wakeup_lateness,
            &mut self.command_lateness,
            &mut self.compute,
            &mut self.record,
            &mut self.tick_time,
            &mut self.slack,
            &mut self.miss,
        ] {
            tally.forget();
        }
        for (_, tally) in &mut self.round_trip {
            tally.forget();
        }
        self.counts = Counts::default();
        self.warmup = Counts::default();
    }

    /// Counts of the measured ticks.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Counts of the warm-up ticks.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn warmup_counts(&self) -> Counts {
        self.warmup
    }

    /// The histogram of one quantity, in nanoseconds; round trips of all specimens merged.
    #[must_use]
    pub fn histogram(&self, quantity: Quantity) -> Histogram<u64> {
        match quantity {
            Quantity::WakeupLateness => self.wakeup_lateness.read(),
            Quantity::CommandLateness => self.command_lateness.read(),
            Quantity::RoundTrip => {
                let mut merged = histogram();
                for (_, one) in &self.round_trip {
                    // Same bounds: the counts add one by one and nothing can be out of range.
                    let _ = merged.add(one.read());
                }
                merged
            }
            Quantity::Compute => self.compute.read(),
            Quantity::Record => self.record.read(),
            Quantity::TickTime => self.tick_time.read(),
            Quantity::Slack => self.slack.read(),
            Quantity::Miss => self.miss.read(),
        }
    }

    /// Round trips of each specimen by name, in nanoseconds.
    pub(crate) fn round_trips(&self) -> impl Iterator<Item = (&str, Histogram<u64>)> {
        self.round_trip
            .iter()
            .map(|(name, tally)| (name.as_str(), tally.read()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: u64 = 1_000_000;

    /// A tick at `release` that wakes late by `late` and works 200 µs.
    fn tick(release: u64, late: u64) -> TickStamps {
        let woke = release + late;
        TickStamps {
            idle: Nanos(release.saturating_sub(500_000)),
            release: Nanos(release),
            woke: Nanos(woke),
            sent: Nanos(woke + 5_000),
            decoded: Nanos(woke + 150_000),
            ready: Nanos(woke + 190_000),
            pushed: Nanos(woke + 200_000),
            deadline: Nanos(release + T),
        }
    }

    #[test]
    fn each_quantity_follows_its_stamps() {
        let mut timing = Timing::new(&["a"], false, 0);
        assert_eq!(timing.tick(&tick(10 * T, 1_000)), None);
        timing.round_trip(0, 145_000);
        timing.round_trip(1, 1);
        let expected = [
            (Quantity::WakeupLateness, 1_000),
            (Quantity::CommandLateness, 6_000),
            (Quantity::RoundTrip, 145_000),
            (Quantity::Compute, 40_000),
            (Quantity::Record, 10_000),
            (Quantity::TickTime, 200_000),
            (Quantity::Slack, 799_000),
        ];
        for (quantity, ns) in expected {
            let histogram = timing.histogram(quantity);
            assert_eq!(histogram.len(), 1, "{quantity:?}");
            // 3 significant digits: the cell that holds the value holds nothing 0.1 % away.
            assert!(
                histogram.equivalent(histogram.max(), ns),
                "{quantity:?} {}",
                histogram.max()
            );
        }
        assert_eq!(timing.histogram(Quantity::Miss).len(), 0);
    }

    #[test]
    fn miss_has_a_size_and_no_slack() {
        let mut timing = Timing::new(&[], false, 0);
        let miss = timing.tick(&tick(10 * T, 850_000)).unwrap();
        assert_eq!(miss.late_ns, 50_000);
        assert_eq!(timing.counts().misses, 1);
        assert_eq!(timing.histogram(Quantity::Miss).len(), 1);
        assert_eq!(timing.histogram(Quantity::Slack).len(), 0);
    }

    #[test]
    fn early_wakeup_counts_as_lateness_zero() {
        let mut timing = Timing::new(&[], false, 0);
        let mut early = tick(10 * T, 0);
        early.woke = Nanos(10 * T - 300);
        timing.tick(&early);
        assert_eq!(timing.counts().early_wakeups, 1);
        assert_eq!(timing.histogram(Quantity::WakeupLateness).max(), 0);
    }

    #[test]
    fn stall_counts_each_tick_with_its_lateness() {
        let mut timing = Timing::new(&[], false, 0);
        // Ninety good ticks, then one that is late by 10.5 periods: the grid moves by ten ticks.
        for k in 0..90 {
            timing.tick(&tick(k * T, 0));
        }
        let late = 10 * T + T / 2;
        timing.tick(&tick(90 * T, late));
        timing.swallowed(late, T, 10);
        let histogram = timing.histogram(Quantity::WakeupLateness);
        assert_eq!(histogram.len(), 90 + 1 + 10);
        assert_eq!(timing.counts().swallowed, 10);
        // Late by 10.5, 9.5, … 0.5 periods: one in each interval.
        for j in 0..=10 {
            assert_eq!(
                histogram.count_between(j * T + T / 4, j * T + 3 * T / 4),
                1,
                "{j}"
            );
        }
        // 11 of 101 ticks were late by 0.5 ms or more: the 95th percentile must show it. Without the ten skipped
        // ticks (1 bad in 91) it would read 0.
        assert!(histogram.value_at_quantile(0.95) >= 5 * T);
    }

    #[test]
    fn huge_stall_is_counted_in_bounded_work() {
        let mut timing = Timing::new(&[], false, 0);
        let (period, ticks) = (50_000, 100_003);
        timing.swallowed(period * ticks, period, ticks);
        let histogram = timing.histogram(Quantity::CommandLateness);
        assert_eq!(histogram.len(), ticks);
        assert!(histogram.distinct_values() > 0);
        // Lateness is uniform from 0 to 5 s: its median is 2.5 s, to a group of 98 ticks and 3 digits.
        let median = histogram.value_at_quantile(0.5) as f64;
        assert!((median / 2.5e9 - 1.0).abs() < 0.003, "{median}");
    }

    #[test]
    fn warm_up_ticks_reach_no_histogram() {
        let mut timing = Timing::new(&["a"], false, 3);
        for k in 0..5 {
            timing.round_trip(0, 7);
            timing.tick(&tick(k * T, if k < 3 { 900_000 } else { 0 }));
        }
        assert_eq!(
            (timing.warmup_counts().ticks, timing.warmup_counts().misses),
            (3, 3)
        );
        assert_eq!((timing.counts().ticks, timing.counts().misses), (2, 0));
        assert_eq!(timing.histogram(Quantity::TickTime).len(), 2);
        assert_eq!(timing.histogram(Quantity::RoundTrip).len(), 2);
    }

    #[test]
    fn round_trips_are_kept_by_specimen() {
        let mut timing = Timing::new(&["left", "right"], true, 0);
        timing.round_trip(0, 100);
        timing.round_trip(1, 300);
        timing.round_trip(1, 301);
        assert_eq!(timing.histogram(Quantity::RoundTrip).len(), 3);
        let counts: Vec<_> = timing
            .round_trips()
            .map(|(name, h)| (name, h.len()))
            .collect();
        assert_eq!(counts, [("left", 1), ("right", 2)]);
    }

    #[test]
    fn values_beyond_ten_seconds_are_clamped() {
        let mut timing = Timing::new(&["a"], false, 0);
        timing.round_trip(0, u64::MAX);
        let histogram = timing.histogram(Quantity::RoundTrip);
        assert_eq!(histogram.len(), 1);
        assert!(histogram.max() >= tally::BOUNDS.1);
    }

    #[test]
    fn reset_leaves_nothing() {
        let mut timing = Timing::new(&["a"], false, 0);
        timing.tick(&tick(T, 900_000));
        timing.round_trip(0, 5);
        timing.swallowed(5 * T, T, 4);
        timing.reset();
        assert!(
            Quantity::ALL
                .iter()
                .all(|q| timing.histogram(*q).is_empty())
        );
        assert_eq!(timing.counts(), Counts::default());
    }

    #[test]
    fn recording_allocates_nothing() {
        let mut timing = Timing::new(&["a", "b"], true, 10);
        let info = allocation_counter::measure(|| {
            for k in 0..2000 {
                timing.round_trip(0, k * 977);
                timing.round_trip(1, k * 12_345_678);
                timing.tick(&tick(k * T, (k * 7919) % (3 * T)));
                timing.swallowed(k * T, T, k);
            }
        });
        assert_eq!(info.count_total, 0);
    }
}
