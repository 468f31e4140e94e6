//! Deadline misses in a stretch of time, and when they are warned of.

use crate::catalog::limit::Limit;
use crate::control::limits::{Bound, Level};

/// Levels of misses; the trip levels in a row and in all are in [`super::Limits`], where the loop looks at them first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissLevels {
    /// More than so many in a row are warned of.
    pub warn_in_a_row: u64,
    /// More than so many in all are warned of.
    pub warn_in_all: u64,
    /// Length of the window in ticks.
    pub window_ticks: u64,
    /// More than so many in the window are warned of.
    pub warn_in_window: u64,
    /// More than so many in the window end the test.
    pub most_in_window: u64,
}

/// What was judged, its value, and what it is beyond.
pub(super) type Judged = (Limit, f64, Option<(Level, f64)>);

/// Misses so far.
#[derive(Debug, Clone, Copy)]
pub(super) struct Missed {
    pub in_a_row: u64,
    pub in_window: u64,
    pub in_all: u64,
}

impl MissLevels {
    /// No level at all.
    pub const NONE: MissLevels = MissLevels {
        warn_in_a_row: u64::MAX,
        warn_in_all: u64::MAX,
        window_ticks: 0,
        warn_in_window: u64::MAX,
        most_in_window: u64::MAX,
    };

    /// Real-time: yes.
    pub(super) fn judge(&self, missed: Missed) -> [Judged; 3] {
        let at = |quantity, found: u64, warn: u64, most: u64| {
            let bound = Bound {
                warn: warn as f64,
                trip: most as f64,
            };
            (quantity, found as f64, bound.judge(found as f64))
        };
        [
            at(
                Limit::MissesInARow,
                missed.in_a_row,
                self.warn_in_a_row,
                u64::MAX,
            ),
            at(
                Limit::MissesInWindow,
                missed.in_window,
                self.warn_in_window,
                self.most_in_window,
            ),
            at(Limit::Misses, missed.in_all, self.warn_in_all, u64::MAX),
        ]
    }
}

/// Most entries that a window keeps: looked through at every miss, and there may be a window of an hour at any rate.
const MOST_KEPT: u64 = 1 << 14;

/// The latest misses, one more than are allowed. Where that is more than `MOST_KEPT`, several in a row share an entry and
/// leave the window together, with the last of them: up to one in so many is counted longer than it should be, never shorter.
#[derive(Debug)]
pub struct MissWindow {
    ticks: u64,
    /// Misses that share an entry.
    share: u64,
    /// Tick of the last one of each entry, and how many they are.
    latest: Vec<(u64, u64)>,
    /// The entry written last.
    last: usize,
}

impl MissWindow {
    /// For these levels; remembers nothing where there is no bound.
    #[must_use]
    pub fn new(levels: &MissLevels) -> Self {
        let kept = if levels.window_ticks == 0 {
            0
        } else {
            // A window cannot hold more misses than ticks.
            levels
                .most_in_window
                .min(levels.window_ticks)
                .saturating_add(1)
        };
        let share = kept.div_ceil(MOST_KEPT).max(1);
        Self {
            ticks: levels.window_ticks,
            share,
            // One more, for the entry that is being filled.
            latest: Vec::with_capacity((kept.div_ceil(share) + u64::from(share > 1)) as usize),
            last: 0,
        }
    }

    /// Takes note of a miss in `tick`; how many there are among the last ticks, as far as is remembered. Takes as long as
    /// the memory is, but there is time: the deadline is missed. Real-time: yes.
    pub fn note(&mut self, tick: u64) -> u64 {
        if self.latest.capacity() == 0 {
            return 0;
        }
        match self.latest.get_mut(self.last) {
            Some((at, count)) if *count < self.share => (*at, *count) = (tick, *count + 1),
            _ => self.begin(tick),
        }
        self.at(tick)
    }

    /// How many there are among the last ticks up to `tick`. Real-time: yes.
    #[must_use]
    pub fn at(&self, tick: u64) -> u64 {
        let ticks = self.ticks;
        let inside = |(then, _): &&(u64, u64)| tick.saturating_sub(*then) < ticks;
        let counts = self.latest.iter().filter(inside).map(|(_, count)| count);
        counts.sum()
    }

    /// A new entry, in place of the oldest where there is no more room. Real-time: yes.
    fn begin(&mut self, tick: u64) {
        if self.latest.len() < self.latest.capacity() {
            self.last = self.latest.len();
            // Within its capacity a push does not allocate.
            self.latest.push((tick, 1));
            return;
        }
        self.last = (self.last + 1) % self.latest.len();
        if let Some(oldest) = self.latest.get_mut(self.last) {
            *oldest = (tick, 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVELS: MissLevels = MissLevels {
        window_ticks: 100,
        warn_in_window: 2,
        most_in_window: 3,
        warn_in_a_row: 4,
        ..MissLevels::NONE
    };

    #[test]
    fn misses_are_counted_in_the_last_ticks_only() {
        let mut window = MissWindow::new(&LEVELS);
        let counted: Vec<u64> = [10, 20, 109, 110, 111, 112, 300]
            .into_iter()
            .map(|tick| window.note(tick))
            .collect();
        // At 110 the one at 10 is a hundred ticks old and outside; at 120 that at 20 would be.
        assert_eq!(counted, [1, 2, 3, 3, 4, 4, 1]);
        assert_eq!(MissWindow::new(&MissLevels::NONE).note(5), 0);
    }

    #[test]
    fn a_window_of_any_length_takes_little_memory_and_still_counts_up_to_its_bound() {
        let levels = |window_ticks, most_in_window| MissLevels {
            window_ticks,
            most_in_window,
            ..MissLevels::NONE
        };
        for most in [MOST_KEPT - 2, MOST_KEPT, 100_000] {
            let mut window = MissWindow::new(&levels(1_000_000, most));
            for tick in 0..=most {
                assert_eq!(window.note(tick), tick + 1);
            }
            // Those that share an entry with one that is inside are counted, and no more.
            let found = window.note(1_000_000 + most / 2);
            let exact = most - most / 2 + 1;
            assert!((exact..=exact + window.share).contains(&found), "{found}");
        }
        let mut endless = MissWindow::new(&levels(u64::MAX, u64::MAX - 1));
        assert!(endless.latest.capacity() as u64 <= MOST_KEPT + 1);
        assert_eq!([endless.note(1), endless.note(2)], [1, 2]);
    }

    #[test]
    fn each_level_is_passed_by_the_miss_beyond_it_and_not_by_the_one_before() {
        let judged = |in_a_row, in_window| {
            let missed = Missed {
                in_a_row,
                in_window,
                in_all: 9,
            };
            LEVELS.judge(missed).map(|(_, _, judged)| judged)
        };
        assert_eq!(judged(4, 2), [None, None, None]);
        let warned = judged(5, 3);
        assert_eq!(warned[0], Some((Level::Warning, 4.0)));
        assert_eq!(warned[1], Some((Level::Warning, 2.0)));
        assert_eq!(judged(1, 4)[1], Some((Level::Trip, 3.0)));
    }
}
