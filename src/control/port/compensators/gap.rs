//! Commands whose measurements stay away, until a fresh one says between which two places the specimen went meanwhile.
//!
//! Filters and differences count in ticks. Whoever learns of them takes part in every tick, on a straight line across those in
//! which nothing was measured; a straight line is good for a part of what the filters let through, and not for longer.

use gusset_quantity::state;

/// What is remembered over what a straight line stands for: 36 ms of the filter's 0.3 s where its corner is at 20 Hz.
const PARTS: u32 = 8;
/// Most ticks that are filled in at once, whatever the filter: they are all pushed in one.
const MOST: u32 = 256;

/// What is missing of one axis.
#[derive(Debug)]
pub(super) struct Gap {
    /// Measured last; none where what is measured next does not follow it.
    from: Option<f64>,
    /// Commands since, as they were sent.
    sent: Vec<f64>,
    /// Most of them.
    most: usize,
}

state! { Gap { from, sent: list(*most) } keeps { most } }

impl Gap {
    /// For a compensator that remembers measurements for so many ticks.
    pub(crate) fn new(memory: u32) -> Self {
        let most = (memory / PARTS).min(MOST) as usize;
        Self {
            from: None,
            sent: Vec::with_capacity(most),
            most,
        }
    }

    /// Most commands without a measurement that are filled in. Real-time: yes.
    pub(crate) const fn most(&self) -> u32 {
        self.most as u32
    }

    /// The specimen was measured last, or has always stood, at `measured`. Real-time: yes.
    pub(crate) fn begin(&mut self, measured: f64) {
        self.from = Some(measured);
        self.sent.clear();
    }

    /// What is measured next does not follow what was measured last. Real-time: yes.
    pub(crate) fn forget(&mut self) {
        self.from = None;
        self.sent.clear();
    }

    /// The measurement of a command stays away; false if it cannot be put in afterwards. Real-time: yes.
    pub(crate) fn takes(&mut self, command: f64) -> bool {
        let takes = self.from.is_some() && self.sent.len() < self.most;
        if takes {
            // Within its capacity a push does not allocate.
            self.sent.push(command);
        }
        takes
    }

    /// A fresh measurement is there: gives each command that has none with where the specimen was on the way to it. Real-time: yes.
    pub(crate) fn fill(&mut self, measured: f64, mut put: impl FnMut(f64, f64)) {
        if let Some(from) = self.from {
            let ticks = self.sent.len() as f64 + 1.0;
            for (tick, command) in (1..).zip(&self.sent) {
                let share = f64::from(tick) / ticks;
                put(*command, from + share * (measured - from));
            }
        }
        self.begin(measured);
    }
}
