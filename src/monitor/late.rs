//! Deadlines missed in a row and in a stretch of time, as the loop counts them: found again from the timing columns.
//!
//! A tick is late if its row was handed over after the next edge; how long the handing over took stands in the row after it.

use super::subject::Places;
use super::tap::at;
use crate::catalog::limit::Limit;
use crate::engine::{MissLevels, MissWindow};

/// Counts of one test.
#[derive(Debug)]
pub(super) struct Late {
    tick_s: f64,
    window: MissWindow,
    /// Of the tick of the last row: its number, and s from its edge to the next command ready. None outside of the test.
    open: Option<(u64, f64)>,
    /// The last tick that was in the test.
    last: u64,
    in_a_row: u64,
    most: [u64; 2],
}

impl Late {
    pub fn new(tick_s: f64, levels: &MissLevels) -> Self {
        Self {
            tick_s,
            window: MissWindow::new(levels),
            open: None,
            last: 0,
            in_a_row: 0,
            most: [0; 2],
        }
    }

    /// The row of tick `tick` of the grid, of the test itself if `counts`. When the tick before was over, in s from its edge, if
    /// that was in the test.
    pub fn row(&mut self, tick: u64, counts: bool, row: &[f64], places: &Places) -> Option<f64> {
        let open = self.open.take();
        let open = open.map(|(before, taken)| (before, taken + at(row, places.record_before)));
        if let Some((before, taken)) = open {
            if taken > self.tick_s {
                self.in_a_row += 1;
                let in_window = self.window.note(before);
                self.most = [self.most[0].max(self.in_a_row), self.most[1].max(in_window)];
            } else {
                self.in_a_row = 0;
            }
        }
        if counts {
            // From the edge: command lateness, round trip, compute.
            let parts = places.timing.iter().skip(1).map(|place| at(row, *place));
            self.open = Some((tick, parts.sum()));
            self.last = tick;
        }
        open.map(|(_, taken)| taken)
    }

    /// Present value and largest of one quantity; not a number of what is not counted here.
    pub fn of(&self, quantity: Limit) -> [f64; 2] {
        let [in_a_row, in_window] = self.most;
        let pair = |now: u64, most: u64| [now as f64, most as f64];
        match quantity {
            Limit::MissesInARow => pair(self.in_a_row, in_a_row),
            Limit::MissesInWindow => pair(self.window.at(self.last), in_window),
            _ => [f64::NAN; 2],
        }
    }
}
