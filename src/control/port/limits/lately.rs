//! The largest value of the last while, in two numbers. Pure; real-time.

use gusset_quantity::state;

/// Largest of the values of a while, which is kept for that long at least and for twice as long at most.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Lately {
    /// Largest since the first one that counts, and of those before it.
    largest: [f64; 2],
    /// Time in s since that first one.
    time: f64,
}

state! { Lately { largest, time } }

impl Lately {
    /// One more value, `tick` seconds after the last; it counts for `time` seconds. Real-time: yes.
    #[inline]
    pub(crate) fn take(&mut self, value: f64, tick: f64, time: f64) {
        let [largest, _] = self.largest;
        self.time += tick;
        if self.time < time {
            self.largest[0] = largest.max(value);
            return;
        }
        // Of those so far the last is one tick old.
        self.largest = [value, if tick < time { largest } else { 0.0 }];
        self.time = 0.0;
    }

    /// Real-time: yes.
    #[inline]
    pub(crate) const fn largest(&self) -> f64 {
        let [one, other] = self.largest;
        one.max(other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks of 1 s for which a value counts that is followed by smaller ones, wherever in the while it comes.
    fn counts_for(time: f64, before: u32) -> u32 {
        let mut lately = Lately::default();
        for _ in 0..before {
            lately.take(1.0, 1.0, time);
        }
        lately.take(5.0, 1.0, time);
        let mut ticks = 0;
        while lately.largest() == 5.0 {
            lately.take(1.0, 1.0, time);
            ticks += 1;
        }
        assert_eq!(lately.largest(), 1.0);
        ticks
    }

    #[test]
    fn value_counts_for_one_to_two_windows() {
        for time in [0.0, 0.3, 1.0] {
            assert_eq!(counts_for(time, 7), 1, "{time}: it is the last one only");
        }
        for before in 0..20 {
            let ticks = counts_for(6.0, before);
            assert!((6..=12).contains(&ticks), "{before}: {ticks}");
        }
    }

    #[test]
    fn older_maximum_hides_no_recent_one() {
        let mut lately = Lately::default();
        for value in [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0] {
            lately.take(value, 1.0, 3.0);
            assert!(lately.largest() >= value + if value < 8.0 { 2.0 } else { 0.0 });
        }
    }
}
