//! Everything that is rehearsed of a test: the test itself, a hold, and the limits that only the loop knows.

use super::{
    AxisNeed, Budget, Held, Rehearsal, Speeds, Tried, compare_speeds, large_drift, rehearse,
    rehearse_hold, try_limits,
};
use gusset_config::{ConfigError, Finding, Loaded, Severity};
use gusset_control::engine::Ending;

/// A test's rehearsals, and their findings.
#[derive(Debug, Clone)]
pub struct FullRehearsal {
    /// The undisturbed test.
    pub rehearsal: Rehearsal,
    /// An operator's hold where the test is fastest; none where nothing depends on it.
    pub held: Option<Held>,
    /// Forces and velocities of specimens that do not move at the velocities of the test.
    pub speeds: Vec<Speeds>,
    /// Findings on limits, an early end and capacities. A trip and an exceeded capacity are errors.
    pub findings: Vec<Finding>,
    /// Findings on parts that the budget did not cover.
    pub unknown: Vec<Finding>,
    /// A response that looks like that of another unit.
    pub units: Vec<Finding>,
}

impl FullRehearsal {
    /// Rehearses a test.
    ///
    /// # Errors
    /// As [`gusset_setup::build`].
    pub(crate) fn of(loaded: &Loaded) -> Result<Self, ConfigError> {
        let mut budget = Budget::default();
        let rehearsal = rehearse(loaded, None, &mut budget)?;
        let mut findings = rehearsal.findings(loaded);
        let held = rehearse_hold(loaded, &rehearsal, &mut budget)?;
        if let Some(held) = &held {
            findings.extend(held.findings(&rehearsal, loaded));
        }
        let mut unknown = Vec::from_iter(rehearsal.beyond_budget());
        match try_limits(loaded, &rehearsal, &mut budget)? {
            Tried::Nothing => {}
            Tried::Trips(finding) => findings.push(finding),
            Tried::BeyondBudget(finding) => unknown.push(finding),
        }
        findings.extend(rehearsal.beyond_capacity());
        let speeds = compare_speeds(loaded, &rehearsal, &mut budget)?;
        let units = Vec::from_iter(large_drift(loaded, &rehearsal));
        Ok(Self {
            units,
            rehearsal,
            held,
            speeds,
            findings,
            unknown,
        })
    }

    /// Needs of an axis in the undisturbed test.
    #[must_use]
    pub(crate) fn need(&self, specimen: usize, axis: usize) -> Option<&AxisNeed> {
        self.rehearsal.specimens.get(specimen)?.found.get(axis)
    }

    /// True if it reached the end of the test.
    #[must_use]
    pub(crate) fn is_complete(&self) -> bool {
        self.rehearsal.ending == Ending::Completed
    }

    /// True if no limit would trip, and every rig has the capacity for the test.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        self.errors().next().is_none()
    }

    /// Every error in one line.
    pub fn errors(&self) -> impl Iterator<Item = &str> {
        let errors = self.findings.iter();
        let errors = errors.filter(|finding| finding.severity == Severity::Error);
        errors.map(|finding| finding.headline.as_str())
    }
}
