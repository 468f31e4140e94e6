//! Deadline misses in a stretch of time.

use super::TestLimits;
use gusset_quantity::catalog::limit::Limit;

/// Most entries that a window keeps: there may be a window of an hour at any rate.
const MOST_KEPT: u64 = 1 << 14;

/// The latest misses, one more than are allowed, and how many of them are inside the window.
///
/// Where more than `MOST_KEPT` are allowed, several in a row share an entry and leave the window with the last of them. A miss
/// may then be counted longer than it should be, never shorter.
#[derive(Debug)]
pub(super) struct MissWindow {
    ticks: u64,
    /// Misses that share an entry.
    share: u64,
    /// A ring. Tick of the last miss of each entry, and how many there are.
    latest: Vec<(u64, u64)>,
    /// The entry written last.
    last: usize,
    /// The oldest entry inside the window, if any is.
    oldest: usize,
    /// Misses inside the window.
    inside: u64,
}

impl MissWindow {
    /// For these levels; remembers nothing where there is no bound.
    pub(crate) fn new(limits: &TestLimits) -> Self {
        let kept = if limits.window_ticks == 0 {
            0
        } else {
            // A window cannot hold more misses than ticks.
            let most = limits.of_test(Limit::MissesInWindow).trip as u64;
            most.min(limits.window_ticks).saturating_add(1)
        };
        let share = kept.div_ceil(MOST_KEPT).max(1);
        Self {
            ticks: limits.window_ticks,
            share,
            // One more, for the entry that is being filled.
            latest: Vec::with_capacity((kept.div_ceil(share) + u64::from(share > 1)) as usize),
            last: 0,
            oldest: 0,
            inside: 0,
        }
    }

    /// Takes a miss in `tick`, and returns how many there are among the last ticks, as far as is remembered. Real-time: yes.
    pub(crate) fn note(&mut self, tick: u64) -> u64 {
        if self.at(tick) == 0 {
            self.begin(tick);
            return self.inside;
        }
        match self.latest.get_mut(self.last) {
            Some((at, count)) if *count < self.share => {
                (*at, *count) = (tick, *count + 1);
                self.inside += 1;
            }
            _ => self.begin(tick),
        }
        self.inside
    }

    /// How many misses there are among the last ticks up to `tick`, which never goes back. Real-time: yes.
    #[inline]
    pub(crate) fn at(&mut self, tick: u64) -> u64 {
        while self.inside > 0
            && let Some((then, count)) = self.latest.get(self.oldest)
            && tick.saturating_sub(*then) >= self.ticks
        {
            self.inside -= count;
            self.oldest = (self.oldest + 1) % self.latest.len();
        }
        self.inside
    }

    /// A new entry, in place of the oldest where there is no more room. Real-time: yes.
    fn begin(&mut self, tick: u64) {
        if self.latest.capacity() == 0 {
            return;
        }
        if self.latest.len() < self.latest.capacity() {
            self.last = self.latest.len();
            // Within its capacity a push does not allocate.
            self.latest.push((tick, 1));
        } else {
            self.last = (self.last + 1) % self.latest.len();
            let overwrites = self.inside > 0 && self.last == self.oldest;
            if let Some(entry) = self.latest.get_mut(self.last) {
                self.inside -= if overwrites { entry.1 } else { 0 };
                *entry = (tick, 1);
            }
            if overwrites {
                self.oldest = (self.oldest + 1) % self.latest.len();
            }
        }
        if self.inside == 0 {
            self.oldest = self.last;
        }
        self.inside += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::limits::Bound;

    /// Levels of the window.
    fn levels(window_ticks: u64, most: f64) -> TestLimits {
        let mut limits = TestLimits::NONE;
        limits.window_ticks = window_ticks;
        limits.set(Limit::MissesInWindow, Bound::trip(most));
        limits
    }

    #[test]
    fn only_recent_misses_are_counted() {
        let mut window = MissWindow::new(&levels(100, 3.0));
        let counted: Vec<u64> = [10, 20, 109, 110, 111, 112, 300]
            .into_iter()
            .map(|tick| window.note(tick))
            .collect();
        // At 110 the one at 10 is a hundred ticks old and outside; at 120 that at 20 would be.
        assert_eq!(counted, [1, 2, 3, 3, 4, 4, 1]);
        assert_eq!(MissWindow::new(&TestLimits::NONE).note(5), 0);
    }

    #[test]
    fn count_is_that_of_misses_in_the_window() {
        let mut window = MissWindow::new(&levels(100, 3.0));
        let missed = |tick: u64| tick * tick % 101 < 3;
        for tick in 0..2000_u64 {
            let found = if missed(tick) {
                window.note(tick)
            } else {
                window.at(tick)
            };
            let inside = (tick.saturating_sub(99)..=tick).filter(|tick| missed(*tick));
            assert_eq!(found, (inside.count() as u64).min(4), "{tick}");
        }
    }

    #[test]
    fn long_windows_take_little_memory() {
        for most in [MOST_KEPT - 2, MOST_KEPT, 100_000] {
            let mut window = MissWindow::new(&levels(1_000_000, most as f64));
            for tick in 0..=most {
                assert_eq!(window.note(tick), tick + 1);
            }
            // Those that share an entry with one that is inside are counted, and no more.
            let found = window.note(1_000_000 + most / 2);
            let exact = most - most / 2 + 1;
            assert!((exact..=exact + window.share).contains(&found), "{found}");
        }
        let mut endless = MissWindow::new(&levels(u64::MAX, f64::MAX));
        assert!(endless.latest.capacity() as u64 <= MOST_KEPT + 1);
        assert_eq!([endless.note(1), endless.note(2)], [1, 2]);
    }
}
