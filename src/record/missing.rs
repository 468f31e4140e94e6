//! What a record lacks at its end: rows that are whole may be too few.

use super::run::Run;
use super::summary::Summary;

/// The rows end before the test did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissingEnd {
    /// Steps that the summary tells of.
    pub steps: u64,
    /// Test time of the last of them, s.
    pub until_s: f64,
    /// Test time of the last row, s; none without a row.
    pub ends_s: Option<f64>,
    /// Steps that are missing.
    pub missing: u64,
}

impl MissingEnd {
    /// Of a run whose last row is of this test time; none if nothing is missing, or if that cannot be known: the summary of a
    /// served specimen counts commands and no steps.
    #[must_use]
    pub fn of(run: &Run, ends_s: Option<f64>) -> Option<Self> {
        let summary = run.summary().filter(|_| !run.layout().is_served())?;
        Self::of_test(summary, ends_s)
    }

    fn of_test(summary: &Summary, ends_s: Option<f64>) -> Option<Self> {
        let until_s = summary.steps as f64 * summary.dt;
        let is_there = ends_s.map_or(summary.steps == 0, |ends| {
            ends + 0.5 * summary.dt >= until_s
        });
        let left = ends_s.map_or(f64::INFINITY, |ends| (until_s - ends) / summary.dt);
        (!is_there).then_some(Self {
            steps: summary.steps,
            until_s,
            ends_s,
            // The step at t = 0 is one more.
            missing: (left.round() as u64).min(summary.steps + 1),
        })
    }

    /// Of a recorded run, by the last whole row of its file; none if nothing is missing, or if that cannot be known.
    #[must_use]
    pub fn of_run(run: &Run) -> Option<Self> {
        let place = run.layout().index_of("time")?;
        let last = run.last_row().ok()?;
        let time = match &last {
            Some(row) => Some(*row.get(place)?),
            None => None,
        };
        Self::of(run, time)
    }
}

impl std::fmt::Display for MissingEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { steps, until_s, .. } = self;
        write!(f, "the summary tells of {steps} steps, {until_s} s, but ")?;
        match self.ends_s {
            Some(ends) => write!(f, "the rows end at {ends} s"),
            None => write!(f, "there is no row"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::summary::tests::example;

    #[test]
    fn rows_that_end_a_step_too_early_are_missed_and_none_that_end_in_time() {
        let summary = Summary {
            steps: 100,
            dt: 0.01,
            ..example()
        };
        let missing = |ends| MissingEnd::of_test(&summary, ends).map(|end| end.missing);
        assert_eq!(missing(Some(1.0)), None);
        assert_eq!(missing(Some(1.2)), None, "it was left slowly");
        assert_eq!(missing(Some(0.99)), Some(1));
        assert_eq!(missing(Some(0.25)), Some(75));
        assert_eq!(missing(None), Some(101));
        let words = MissingEnd::of_test(&summary, Some(0.25))
            .unwrap()
            .to_string();
        assert_eq!(
            words,
            "the summary tells of 100 steps, 1 s, but the rows end at 0.25 s"
        );
        let nothing = Summary {
            steps: 0,
            ..summary
        };
        assert_eq!(
            MissingEnd::of_test(&nothing, None),
            None,
            "nothing was moved"
        );
    }
}
