//! Deadline misses in a stretch of time, and when they are warned of.

use super::checks::TestQuantity;
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
    /// More than so many in the window end the test; this is also how many are remembered.
    pub most_in_window: u64,
}

/// What was judged, its value, and what it is beyond.
pub(super) type Judged = (TestQuantity, f64, Option<(Level, f64)>);

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
                TestQuantity::MissesInARow,
                missed.in_a_row,
                self.warn_in_a_row,
                u64::MAX,
            ),
            at(
                TestQuantity::MissesInWindow,
                missed.in_window,
                self.warn_in_window,
                self.most_in_window,
            ),
            at(
                TestQuantity::Misses,
                missed.in_all,
                self.warn_in_all,
                u64::MAX,
            ),
        ]
    }
}

/// Ticks of the latest misses, one more than are allowed.
#[derive(Debug)]
pub(super) struct MissWindow {
    ticks: u64,
    latest: Vec<u64>,
    next: usize,
}

impl MissWindow {
    /// For these levels; remembers nothing where there is no bound.
    pub fn new(levels: &MissLevels) -> Self {
        let kept = if levels.window_ticks == 0 {
            0
        } else {
            // A window cannot hold more misses than ticks.
            levels.most_in_window.min(levels.window_ticks) + 1
        };
        Self {
            ticks: levels.window_ticks,
            latest: Vec::with_capacity(usize::try_from(kept).unwrap_or(0)),
            next: 0,
        }
    }

    /// Takes note of a miss in `tick`; how many there are among the last ticks, as far as is remembered. Takes as long as
    /// the memory is, but there is time: the deadline is missed. Real-time: yes.
    pub fn note(&mut self, tick: u64) -> u64 {
        if self.latest.capacity() == 0 {
            return 0;
        }
        if self.latest.len() < self.latest.capacity() {
            // Within its capacity a push does not allocate.
            self.latest.push(tick);
        } else if let Some(oldest) = self.latest.get_mut(self.next) {
            *oldest = tick;
            self.next = (self.next + 1) % self.latest.len();
        }
        let ticks = self.ticks;
        let inside = |then: &&u64| tick.saturating_sub(**then) < ticks;
        self.latest.iter().filter(inside).count() as u64
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
