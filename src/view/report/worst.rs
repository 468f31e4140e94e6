//! The ticks that took longest, with their known causes.

use gusset_quantity::catalog::column;
use gusset_record::Column;

/// Ticks that are kept.
const KEPT: usize = 10;

/// One tick that took long: its step and test time; wake-up lateness, command lateness, round trip and compute time, which are in s;
/// and the whole ticks by which the grid had been moved after it.
pub(super) type Tick = [f64; 7];

/// From the edge of a tick to the next command ready, s.
pub(super) fn total([.., sent, round_trip, compute, _]: &Tick) -> f64 {
    sent + round_trip + compute
}

/// Keeps the longest of the ticks that pass.
#[derive(Debug, Clone)]
pub(super) struct Worst {
    places: Option<[usize; 7]>,
    kept: Vec<Tick>,
}

impl Worst {
    /// For rows of these columns; keeps nothing where a column is missing.
    pub(crate) fn new(columns: &[Column]) -> Self {
        let at = |name: &str| columns.iter().position(|c| c.name == name);
        let kinds = [
            column::STEP,
            column::TIME,
            column::WAKEUP,
            column::COMMAND_LATENESS,
            column::ROUND_TRIP,
            column::COMPUTE,
            column::STRETCHED,
        ];
        let places = kinds.map(|kind| at(kind.name()));
        let known = places.iter().all(Option::is_some);
        Self {
            places: known.then(|| places.map(Option::unwrap_or_default)),
            kept: Vec::new(),
        }
    }

    /// Takes rows.
    pub(crate) fn take(&mut self, block: &[&[f64]]) {
        let Some(places) = self.places else {
            return;
        };
        let rows = 0..block[places[0]].len();
        for tick in rows.map(|row| places.map(|place| block[place][row])) {
            let took = total(&tick);
            let is_worse =
                self.kept.len() < KEPT || self.kept.last().is_some_and(|last| took > total(last));
            if is_worse && took > 0.0 && took.is_finite() {
                let place = self.kept.partition_point(|other| total(other) >= took);
                self.kept.insert(place, tick);
                self.kept.truncate(KEPT);
            }
        }
    }

    /// The longest first.
    pub(crate) fn finish(self) -> Vec<Tick> {
        self.kept
    }
}
