//! A histogram in which a value that comes many times in a row, or in turns with another, costs an addition.
//!
//! Under the simulated clock most durations are the same tick after tick, or one of two where the period is no whole number
//! of nanoseconds; under the real one nearly none is, and the extra cost is a comparison. A reader gets the values of a
//! plain histogram.

use hdrhistogram::Histogram;

/// Smallest resolved value, largest value, significant digits: 200 kB a histogram.
pub(super) const BOUNDS: (u64, u64, u8) = (1, 10_000_000_000, 3);

/// Values in nanoseconds.
#[derive(Debug, Clone)]
pub(super) struct Tally {
    histogram: Histogram<u64>,
    /// The last value and the one before that was another.
    last: Waiting,
    other: Waiting,
}

/// A value, and its count since it was last added to the histogram.
#[derive(Debug, Clone, Copy, Default)]
struct Waiting {
    ns: u64,
    count: u64,
}

pub(super) fn histogram() -> Histogram<u64> {
    let (low, high, digits) = BOUNDS;
    Histogram::new_with_bounds(low, high, digits)
        .expect("the bounds are constants that satisfy low >= 1, high >= 2 low and digits <= 5")
}

impl Tally {
    pub(crate) fn new() -> Self {
        Self::over(histogram())
    }

    /// Every count is written once, so that no page of it is met for the first time in the loop.
    pub(crate) fn touched() -> Self {
        let mut fresh = histogram();
        fresh.reset();
        Self::over(fresh)
    }

    /// Holds nothing worth reading.
    pub(crate) fn none() -> Self {
        Self::over(Histogram::new_with_bounds(1, 2, 0).expect("the smallest bounds that there are"))
    }

    const fn over(histogram: Histogram<u64>) -> Self {
        Self {
            histogram,
            last: Waiting { ns: 0, count: 0 },
            other: Waiting { ns: 0, count: 0 },
        }
    }

    /// One more. Real-time: yes.
    #[inline]
    pub(crate) fn record(&mut self, ns: u64) {
        self.record_n(ns, 1);
    }

    /// `count` more of one size. Real-time: yes.
    #[inline]
    pub(crate) fn record_n(&mut self, ns: u64, count: u64) {
        if ns != self.last.ns {
            std::mem::swap(&mut self.last, &mut self.other);
            if ns != self.last.ns {
                let Waiting { ns: value, count } = self.last;
                if count > 0 {
                    self.histogram.saturating_record_n(value, count);
                }
                self.last = Waiting { ns, count: 0 };
            }
        }
        self.last.count += count;
    }

    /// An empty one is left alone: there is much to write.
    pub(crate) fn forget(&mut self) {
        (self.last.count, self.other.count) = (0, 0);
        if !self.histogram.is_empty() {
            self.histogram.reset();
        }
    }

    /// With everything that was recorded.
    pub(crate) fn read(&self) -> Histogram<u64> {
        let mut whole = self.histogram.clone();
        for Waiting { ns, count } in [self.last, self.other] {
            if count > 0 {
                whole.saturating_record_n(ns, count);
            }
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Long runs of few values, and values that never come twice.
        #[test]
        fn it_holds_what_a_plain_histogram_holds(
            values in prop::collection::vec((prop_oneof![Just(0_u64), Just(976), Just(977), 0..20_000_000_000_u64], 1..4_u64), 0..200),
        ) {
            let (mut tally, mut plain) = (Tally::new(), histogram());
            for (value, count) in values {
                tally.record_n(value, count);
                tally.record(value);
                plain.saturating_record_n(value, count + 1);
                prop_assert_eq!(tally.read().len(), plain.len());
            }
            prop_assert_eq!(tally.read(), plain);
        }
    }
}
