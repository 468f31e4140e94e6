//! The tests with the largest values of a measure, and the command that gives the run folder of each.

use maud::Markup;
use serde::Serialize;

use super::drawing::short;
use super::measure::Measure;
use super::plan::Campaign;
use super::task::Task;
use gusset_view::report::table;

/// Tests that are named for each measure.
const NAMED: usize = 5;

/// A test with one of the largest values.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Largest {
    /// Number of the task, from 1.
    pub task: u64,
    /// Draws before that of the test.
    #[serde(skip)]
    pub attempt: u64,
    /// The value, SI.
    pub value: f64,
}

/// The largest sizes of one measure, in descending order.
#[derive(Debug, Clone, Default)]
pub(super) struct Leaders(Vec<Largest>);

impl Leaders {
    /// Keeps a value if it is among the largest. Of equal values the earlier task stays before the later one.
    pub(crate) fn take(&mut self, task: u64, attempt: u64, value: f64) {
        if !value.is_finite() {
            return;
        }
        let place = self
            .0
            .partition_point(|known| known.value.abs() >= value.abs());
        if place < NAMED {
            self.0.truncate(NAMED - 1);
            let largest = Largest {
                task,
                attempt,
                value,
            };
            self.0.insert(place, largest);
        }
    }

    pub(crate) fn into_all(self) -> Vec<Largest> {
        self.0
    }
}

/// The tests as a table with their overrides.
pub(super) fn largest(campaign: &Campaign, measure: &Measure, all: &[Largest]) -> Markup {
    let unit = match measure.unit.as_str() {
        "1" => String::new(),
        unit => format!(" in {unit}"),
    };
    let value = format!("{}{unit}", measure.name);
    let rows = all.iter().map(|one| {
        let study = &campaign.study;
        let task = Task::of(study, one.task - 1).attempted(study, one.attempt);
        let sets: Vec<&str> = task
            .sets
            .iter()
            .chain(&task.drawn)
            .map(String::as_str)
            .collect();
        vec![one.task.to_string(), short(one.value), sets.join("\n")]
    });
    table(&["task", &value, "settings"], &rows.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_sizes_are_kept_in_order() {
        let mut leaders = Leaders::default();
        for (task, value) in [1.0, -7.0, f64::NAN, 3.0, 7.0, 2.0, 5.0, 0.5]
            .into_iter()
            .enumerate()
        {
            leaders.take(task as u64 + 1, 0, value);
        }
        let found: Vec<(u64, f64)> = leaders
            .into_all()
            .iter()
            .map(|one| (one.task, one.value))
            .collect();
        assert_eq!(found, [(2, -7.0), (5, 7.0), (7, 5.0), (4, 3.0), (6, 2.0)]);
    }
}
