//! Go or no-go: whether the loop kept its ticks when it was warm, judged before the test moves anything.
//!
//! The first half of a warm-up is for caches and branch predictors. In the second half each step costs what it will cost in
//! the test, so deadlines that are missed there would be missed there, too, whoever is to blame: they are held against the
//! test's own bounds. A share of misses is believed less three standard deviations of their count, so that a hiccup stops
//! nothing.

use super::test_hit::TestHit;
use super::{Engine, Stop};
use crate::catalog::limit::Limit;
use crate::record::{Event, WarmUp};
use crate::rt::timing::TickStamps;

/// Standard deviations of a count by which it may be too large by chance.
const CHANCE: f64 = 3.0;

/// How the ticks of the second half of a warm-up were kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Readiness {
    ticks: u64,
    missed: u64,
    now_in_a_row: u64,
    most_in_a_row: u64,
    /// From wake-up to the end of the tick's work, in all and at most.
    sum_ns: u64,
    longest_ns: u64,
}

impl Readiness {
    /// Takes note of a tick in which `waited_ns` were waited that the test does not wait. Real-time: yes.
    pub fn note(&mut self, stamps: &TickStamps, waited_ns: u64) {
        let pushed = stamps.pushed.minus(waited_ns);
        let took_ns = pushed.since(stamps.woke);
        self.ticks += 1;
        self.sum_ns += took_ns;
        self.longest_ns = self.longest_ns.max(took_ns);
        if pushed > stamps.deadline {
            self.missed += 1;
            self.now_in_a_row += 1;
            self.most_in_a_row = self.most_in_a_row.max(self.now_in_a_row);
        } else {
            self.now_in_a_row = 0;
        }
    }

    /// Misses to be expected at least among so many ticks.
    fn expected(&self, ticks: u64) -> f64 {
        let missed = self.missed as f64;
        let surely = (missed - CHANCE * missed.sqrt()).max(0.0);
        surely / self.ticks.max(1) as f64 * ticks as f64
    }
}

impl Engine {
    /// Says that the test may begin, or ends it. What a simulated clock shows is nobody's time.
    pub(super) fn judge_readiness(&mut self, found: &Readiness) -> Result<(), Stop> {
        if found.ticks == 0 || self.clock.is_simulated() {
            return Ok(());
        }
        let hit = self.what_is_missed_too_often(found);
        let warm_up = WarmUp {
            ticks: found.ticks,
            missed: found.missed,
            in_a_row: found.most_in_a_row,
            mean_ns: found.sum_ns / found.ticks,
            longest_ns: found.longest_ns,
        };
        self.report_now(match hit {
            None => Event::Go(warm_up),
            Some(_) => Event::NoGo(warm_up),
        });
        hit.map_or(Ok(()), |hit| Err(Stop::TestLimit(hit)))
    }

    fn what_is_missed_too_often(&self, found: &Readiness) -> Option<TestHit> {
        let limits = &self.limits.test;
        let ticks_per_step = self.ride.tempo.ticks_per_step();
        let left = (self.steps - self.steps_done) as f64 * ticks_per_step;
        let [in_window, in_all] =
            [limits.window_ticks, left as u64].map(|ticks| found.expected(ticks));
        [
            (Limit::MissesInARow, found.most_in_a_row as f64),
            (Limit::MissesInWindow, in_window.min(in_all).floor()),
            (Limit::Misses, in_all.floor()),
        ]
        .map(|(quantity, value)| (quantity, value, limits.of_test(quantity).trip))
        .into_iter()
        .find(|(_, value, most)| value > most)
        .map(|(quantity, value, bound)| TestHit {
            quantity,
            value,
            bound,
            worst: None,
            in_warm_up: true,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Nanos;

    fn found(lates: impl Iterator<Item = bool>, waited_ns: u64) -> Readiness {
        let mut found = Readiness::default();
        for late in lates {
            let stamps = TickStamps {
                woke: Nanos(1000),
                pushed: Nanos(if late { 2500 } else { 1500 }),
                deadline: Nanos(2000),
                ..TickStamps::default()
            };
            found.note(&stamps, waited_ns);
        }
        found
    }

    #[test]
    fn a_hiccup_lets_expect_nothing_and_what_is_always_late_almost_everything() {
        assert_eq!(found((0..100).map(|k| k < 9), 0).expected(1_000_000), 0.0);
        let always = found((0..100).map(|_| true), 0);
        assert_eq!(always.expected(1000), 700.0);
        assert_eq!((always.most_in_a_row, always.longest_ns), (100, 1500));
        let often = found((0..100).map(|k| k % 4 < 3), 0);
        assert_eq!((often.missed, often.most_in_a_row), (75, 3));
        assert_eq!(Readiness::default().expected(1000), 0.0);
        // What was only waited for a partner that the test does not wait for.
        let waited = found((0..100).map(|_| true), 600);
        assert_eq!((waited.missed, waited.longest_ns), (0, 900));
    }
}
