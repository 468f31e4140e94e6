//! The recorded rows by name: which columns there are, and the part of them in which the test was running.
//!
//! Invariant: every slice that comes out has the same length, whatever the lengths of the columns that went in.
//! Only rows with `state` 3 are physics; rows in which a static load is brought on are not shown as response.

use std::borrow::Cow;
use std::ops::Range;

use super::RunData;

/// State of a row in which the test runs.
const RUNNING: f64 = 3.0;

/// One axis of one specimen, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SpecimenAxis {
    pub specimen: u32,
    pub axis: u32,
}

enum Selection {
    Span(Range<usize>),
    Picked(Vec<usize>),
}

/// A view of a run's rows.
pub(super) struct Rows<'a> {
    run: &'a RunData,
    length: usize,
    running: Selection,
}

impl<'a> Rows<'a> {
    /// The rows of `run`.
    pub fn new(run: &'a RunData) -> Self {
        let named = run.data.iter().take(run.columns.len());
        let length = named.map(Vec::len).min().unwrap_or(0);
        let mut rows = Self {
            run,
            length,
            running: Selection::Span(0..length),
        };
        if let Some(state) = rows.all("state") {
            let is_running = |s: &f64| *s == RUNNING;
            let first = state.iter().position(is_running);
            let last = state.iter().rposition(is_running);
            rows.running = match (first, last) {
                (Some(first), Some(last)) if state[first..=last].iter().all(is_running) => {
                    Selection::Span(first..last + 1)
                }
                _ => Selection::Picked((0..length).filter(|&i| is_running(&state[i])).collect()),
            };
        }
        rows
    }

    /// Number of rows in which the test was running.
    pub fn running(&self) -> usize {
        match &self.running {
            Selection::Span(span) => span.len(),
            Selection::Picked(picked) => picked.len(),
        }
    }

    /// Number of all rows.
    pub const fn recorded(&self) -> usize {
        self.length
    }

    /// A column over all rows.
    pub fn all(&self, name: &str) -> Option<&'a [f64]> {
        let at = self.run.columns.iter().position(|c| c.name == name)?;
        self.run.data.get(at)?.get(..self.length)
    }

    /// A column over the rows in which the test was running.
    pub fn get(&self, name: &str) -> Option<Cow<'a, [f64]>> {
        let all = self.all(name)?;
        Some(match &self.running {
            Selection::Span(span) => Cow::Borrowed(&all[span.clone()]),
            Selection::Picked(picked) => Cow::Owned(picked.iter().map(|&i| all[i]).collect()),
        })
    }

    /// A running column that holds at least one number.
    pub fn filled(&self, name: &str) -> Option<Cow<'a, [f64]>> {
        self.get(name)
            .filter(|values| values.iter().any(|v| v.is_finite()))
    }

    /// Unit of a column.
    pub fn unit(&self, name: &str) -> &'a str {
        self.run
            .columns
            .iter()
            .find(|c| c.name == name)
            .map_or("1", |c| c.unit.as_str())
    }

    /// Numbers of the DOFs with a recorded displacement, rising.
    pub fn dofs(&self) -> Vec<u32> {
        let names = self.run.columns.iter().map(|c| c.name.as_str());
        let mut dofs: Vec<u32> = names
            .filter_map(|name| name.strip_prefix('x')?.parse().ok())
            .collect();
        dofs.sort_unstable();
        dofs.dedup();
        dofs
    }

    /// Axes of specimens with a recorded force, rising.
    pub fn axes(&self) -> Vec<SpecimenAxis> {
        let parse = |name: &str| {
            let (specimen, axis) = name.strip_prefix("force_")?.split_once('_')?;
            Some(SpecimenAxis {
                specimen: specimen.parse().ok()?,
                axis: axis.parse().ok()?,
            })
        };
        let mut axes: Vec<_> = self
            .run
            .columns
            .iter()
            .filter_map(|c| parse(&c.name))
            .collect();
        axes.sort_unstable();
        axes.dedup();
        axes
    }

    /// True if the recorded steps run from the first to the last without a hole; none without a column of steps.
    pub fn is_gapless(&self) -> Option<bool> {
        let steps = self.get("step").filter(|steps| !steps.is_empty())?;
        Some(
            steps
                .windows(2)
                .all(|pair| pair[1] == pair[0] || pair[1] == pair[0] + 1.0),
        )
    }

    /// Mean interval of the running rows in s; none without two rows of rising time.
    pub fn interval(&self) -> Option<f64> {
        let time = self.get("time")?;
        let (first, last) = (time.first()?, time.last()?);
        let dt = (last - first) / (time.len().checked_sub(1)? as f64);
        (dt > 0.0 && dt.is_finite()).then_some(dt)
    }
}

impl SpecimenAxis {
    /// Name of a column of this axis: "force" gives "force_1_1".
    pub fn column(self, kind: &str) -> String {
        format!("{kind}_{}_{}", self.specimen, self.axis)
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::columns;
    use super::*;

    fn run(names: &[&str], data: Vec<Vec<f64>>) -> RunData {
        RunData {
            columns: columns(names),
            data,
            ..RunData::default()
        }
    }

    #[test]
    fn only_rows_of_the_running_test_are_physics() {
        let run = run(
            &["state", "x2", "x10", "force_2_1", "force_1_3"],
            vec![
                vec![1.0, 3.0, 3.0, 4.0],
                vec![10.0, 11.0, 12.0, 13.0],
                vec![0.0; 4],
                vec![0.0; 4],
                vec![0.0; 4],
            ],
        );
        let rows = Rows::new(&run);
        assert_eq!(rows.get("x2").unwrap().as_ref(), [11.0, 12.0]);
        assert_eq!(rows.dofs(), [2, 10]);
        assert_eq!(
            rows.axes()[0],
            SpecimenAxis {
                specimen: 1,
                axis: 3
            }
        );
        assert_eq!(rows.all("x2").unwrap().len(), 4);
    }

    #[test]
    fn a_hole_in_the_steps_is_seen_and_sub_ticks_are_none() {
        let gapless = |steps: Vec<f64>| Rows::new(&run(&["step"], vec![steps])).is_gapless();
        assert_eq!(gapless(vec![4.0, 5.0, 5.0, 6.0]), Some(true));
        assert_eq!(gapless(vec![4.0, 6.0]), Some(false));
        assert_eq!(gapless(vec![4.0, 3.0]), Some(false));
        assert_eq!(gapless(vec![]), None);
    }

    #[test]
    fn scattered_running_rows_are_picked_and_ragged_columns_cut() {
        let run = run(
            &["state", "x1"],
            vec![vec![3.0, 2.0, 3.0, 3.0], vec![0.0, 1.0, 2.0]],
        );
        let rows = Rows::new(&run);
        assert_eq!(rows.get("x1").unwrap().as_ref(), [0.0, 2.0]);
        assert_eq!((rows.running(), rows.recorded()), (2, 3));
        assert!(rows.interval().is_none() && rows.get("x3").is_none());
    }
}
