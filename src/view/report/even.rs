//! Which ticks of a test are at even times.

use super::row_filter::{HOLDING, RUNNING, TRIPPED, is_apart};

/// Ticks that a column at even times is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Chosen {
    All,
    /// All but those of a hold.
    Unheld,
    /// The ends of steps, where the test slowed down.
    Steps,
}

/// Smallest and largest time from one row to the next.
#[derive(Debug, Clone, Copy)]
struct Apart {
    last: f64,
    least: f64,
    most: f64,
    is_known: bool,
}

impl Apart {
    const NONE: Self = Self {
        last: f64::NAN,
        least: f64::INFINITY,
        most: f64::NEG_INFINITY,
        is_known: true,
    };

    fn take(&mut self, time: f64, is_first: bool) {
        let apart = time - self.last;
        self.last = time;
        if !is_first {
            self.is_known &= !apart.is_nan();
            (self.least, self.most) = (self.least.min(apart), self.most.max(apart));
        }
    }

    fn is_even(&self, dt: f64) -> bool {
        let has_none = self.most < self.least;
        self.is_known && (has_none || (is_apart(self.least, dt) && is_apart(self.most, dt)))
    }
}

/// Which ticks are at even times. Of several rows at one time, which a waiting controller makes, only the last counts.
#[derive(Debug)]
pub(super) struct Evenness {
    /// Of all ticks, of those outside a hold, and of the ends of steps.
    apart: [Apart; 3],
    counts: [u64; 3],
    /// Time and state of the last tick.
    last: Option<(f64, f64)>,
    /// The last row only records a trip: its time is not after that of the row before it.
    pub repeats: bool,
}

impl Evenness {
    pub(crate) const fn new() -> Self {
        Self {
            apart: [Apart::NONE; 3],
            counts: [0; 3],
            last: None,
            repeats: false,
        }
    }

    /// Takes the next tick; the state of missing rows is not a number.
    pub(crate) fn take(&mut self, time: f64, state: f64) {
        self.put(0, time);
        let before = self.last.replace((time, state));
        self.repeats = state == TRIPPED && before.is_some_and(|(before, _)| time <= before);
        if let Some((time, state)) = before {
            self.settle(time, state);
        }
    }

    fn settle(&mut self, time: f64, state: f64) {
        if state != HOLDING {
            self.put(1, time);
        }
        if state == RUNNING && time != self.apart[2].last {
            self.put(2, time);
        }
    }

    fn put(&mut self, which: usize, time: f64) {
        self.apart[which].take(time, self.counts[which] == 0);
        self.counts[which] += 1;
    }

    /// The ticks at even times, their number and their interval; `None` where some of them are missing.
    pub(crate) fn chosen(
        &mut self,
        step_s: f64,
        ticks_per_step: u64,
        has_state: bool,
    ) -> Option<(Chosen, f64)> {
        let tick_s = step_s / ticks_per_step.max(1) as f64;
        if let Some((time, state)) = self.last.take_if(|_| !self.repeats) {
            self.settle(time, state);
        }
        let kinds = [
            (Chosen::All, tick_s),
            (Chosen::Unheld, tick_s),
            (Chosen::Steps, step_s),
        ];
        let mut even = kinds.into_iter().zip(self.apart);
        let found = even.find(|((_, dt), apart)| apart.is_even(*dt));
        let found = found.map(|(found, _)| found);
        found.filter(|(kind, _)| has_state || *kind == Chosen::All)
    }
}
