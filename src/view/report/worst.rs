//! The ticks that took longest, with their known causes.

use gusset_quantity::catalog::column;
use gusset_record::Column;

/// Ticks that are kept.
const KEPT: usize = 10;

/// One tick that took long; times in s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WorstTick {
    pub step: f64,
    pub time: f64,
    /// From the edge of the tick to the next command ready.
    pub total: f64,
    pub wakeup: f64,
    pub sent: f64,
    pub round_trip: f64,
    pub compute: f64,
    /// Whole ticks by which the grid had been moved after it.
    pub stretched: f64,
}

/// Keeps the longest of the ticks that pass.
#[derive(Debug, Clone)]
pub(super) struct Worst {
    /// step, time, wake-up, command, round trip, compute, stretched.
    places: Option<[usize; 7]>,
    kept: Vec<WorstTick>,
}

impl Worst {
    /// For rows of these columns; keeps nothing where a column is missing.
    pub(crate) fn new(columns: &[Column]) -> Self {
        let at = |name: &str| columns.iter().position(|c| c.name == name);
        let places = || {
            Some([
                at(column::STEP.name())?,
                at(column::TIME.name())?,
                at(column::WAKEUP.name())?,
                at(column::COMMAND_LATENESS.name())?,
                at(column::ROUND_TRIP.name())?,
                at(column::COMPUTE.name())?,
                at(column::STRETCHED.name())?,
            ])
        };
        Self {
            places: places(),
            kept: Vec::new(),
        }
    }

    /// Takes rows.
    pub(crate) fn take(&mut self, block: &[&[f64]]) {
        let Some([step, time, wakeup, sent, round_trip, compute, stretched]) = self.places else {
            return;
        };
        let times = block[sent]
            .iter()
            .zip(block[round_trip])
            .zip(block[compute]);
        for (row, ((s, r), c)) in times.enumerate() {
            let total = s + r + c;
            let is_worse =
                self.kept.len() < KEPT || self.kept.last().is_some_and(|last| total > last.total);
            if !(is_worse && total > 0.0 && total.is_finite()) {
                continue;
            }
            let tick = WorstTick {
                step: block[step][row],
                time: block[time][row],
                total,
                wakeup: block[wakeup][row],
                sent: *s,
                round_trip: *r,
                compute: *c,
                stretched: block[stretched][row],
            };
            let place = self.kept.partition_point(|other| other.total >= total);
            self.kept.insert(place, tick);
            self.kept.truncate(KEPT);
        }
    }

    /// The longest first.
    pub(crate) fn finish(self) -> Vec<WorstTick> {
        self.kept
    }
}
