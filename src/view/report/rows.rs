//! The digested rows by name, as the sections of the page ask for them.

use std::borrow::Cow;

use maud::{Markup, html};

use super::columns::SpecimenAxis;
use super::digest::Digest;
use super::html::{note, section};
use super::row_filter::Passed;
use super::source::Earlier;
use super::table::{Marks, Table};
use super::text::{count, moment};

/// A view of a run's rows in which the test was running; of a long test the extremes of every few.
pub(super) struct Rows<'a> {
    digest: &'a Digest,
}

/// A column over test time.
pub(super) struct History<'a> {
    pub time: Cow<'a, [f64]>,
    pub values: Cow<'a, [f64]>,
}

impl<'a> Rows<'a> {
    /// The rows of a digest.
    pub(crate) const fn new(digest: &'a Digest) -> Self {
        Self { digest }
    }

    /// The digest itself.
    pub(crate) const fn digest(&self) -> &'a Digest {
        self.digest
    }

    /// Number of steps that were recorded.
    pub(crate) const fn running(&self) -> u64 {
        self.digest.passed.steps
    }

    /// Number of all rows.
    pub(crate) const fn recorded(&self) -> u64 {
        self.digest.recorded
    }

    /// The last step of the interrupted test that this one resumes, if it does.
    pub(crate) fn after(&self) -> Option<u64> {
        self.digest.earlier.as_ref().map(|earlier| earlier.step)
    }

    /// The steps in these rows, if the test was resumed and other steps are in another folder.
    pub(crate) fn steps(&self) -> Option<String> {
        self.digest.earlier.as_ref()?;
        let (first, last) = self.digest.passed.range?;
        Some(format!("steps {} to {}", count(first), count(last)))
    }

    /// The steps of these rows, and the place of the others.
    pub(crate) fn part(&self) -> Option<String> {
        let Earlier { folders, step, .. } = self.digest.earlier.as_ref()?;
        let before = count(*step);
        Some(self.steps().map_or_else(
            || format!("no step of the test; those up to {before} are in {folders}"),
            |steps| format!("{steps} only; the steps before are in {folders}"),
        ))
    }

    /// A section on these rows: a note reports it if they are not the whole test.
    pub(crate) fn section(&self, heading: &str, inside: Markup) -> Markup {
        let part = self.part().map(|part| note(&format!("Of {part}.")));
        section(
            heading,
            html! { @if let Some(part) = part { (part) } (inside) },
        )
    }

    /// A column: of the structure at the ends of steps, of specimens at every tick. `time` is that of the ends of steps.
    pub(crate) fn get(&self, name: &str) -> Option<Cow<'a, [f64]>> {
        let found = self.digest.table.get(name);
        found
            .or_else(|| self.digest.ticks.get(name))
            .map(Cow::Borrowed)
    }

    /// The table with this column.
    fn table_of(&self, name: &str) -> &'a Table {
        match self.digest.table.get(name) {
            Some(_) => &self.digest.table,
            None => &self.digest.ticks,
        }
    }

    /// Test time of the entries of a column.
    pub(crate) fn time_of(&self, name: &str) -> Option<Cow<'a, [f64]>> {
        self.table_of(name).time_of(name).map(Cow::Borrowed)
    }

    /// A column that holds at least one number, with the times of its entries.
    pub(crate) fn history(&self, name: &str) -> Option<History<'a>> {
        Some(History {
            values: self.filled(name)?,
            time: self.time_of(name)?,
        })
    }

    /// Extremes and last value of a column, each that of a single row.
    pub(crate) fn marks(&self, name: &str) -> Marks {
        self.table_of(name).marks(name)
    }

    /// A test time with the digits that name its tick.
    pub(crate) fn moment(&self, time: f64) -> String {
        let ticks = self.digest.ticks_per_step.max(1) as f64;
        let tick = self.digest.passed.step_s.map(|step| step / ticks);
        moment(time, tick)
    }

    /// A column that holds at least one number.
    pub(crate) fn filled(&self, name: &str) -> Option<Cow<'a, [f64]>> {
        self.get(name)
            .filter(|values| values.iter().any(|v| v.is_finite()))
    }

    /// Unit of a column.
    pub(crate) fn unit(&self, name: &str) -> &'a str {
        self.table_of(name).unit(name)
    }

    /// Unit of the displacement of a DOF; that of all that are not recorded where this is not.
    pub(crate) fn disp_unit(&self, dof: u32) -> &'a str {
        let name = format!("x{dof}");
        let is_recorded = self.get(&name).is_some();
        if is_recorded { self.unit(&name) } else { "m" }
    }

    /// Names of all columns that are kept.
    pub(crate) fn names(&self) -> Vec<String> {
        let tables = [&self.digest.table, &self.digest.ticks];
        let names = tables.into_iter().flat_map(Table::names);
        names.map(str::to_owned).collect()
    }

    /// Numbers of the DOFs with a recorded displacement, rising.
    pub(crate) fn dofs(&self) -> &'a [u32] {
        &self.digest.dofs
    }

    /// Axes of specimens with a recorded force, rising.
    pub(crate) fn axes(&self) -> &'a [SpecimenAxis] {
        &self.digest.all_axes
    }

    /// Counts of recorded and missing rows.
    pub(crate) const fn passed(&self) -> &'a Passed {
        &self.digest.passed
    }
}
