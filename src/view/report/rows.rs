//! The digested rows by name, as the sections of the page ask for them.

use maud::{Markup, html};

use super::digest::Digest;
use super::html::{note, section};
use super::source::Earlier;
use super::table::{Marks, Table};
use super::text::{count, moment};

/// A column over test time.
pub(super) struct History<'a> {
    pub time: &'a [f64],
    pub values: &'a [f64],
}

impl Digest {
    /// The last step of the interrupted test that this one resumes, if it does.
    pub(super) fn after(&self) -> Option<u64> {
        self.earlier.as_ref().map(|earlier| earlier.step)
    }

    /// The steps in these rows, if the test was resumed and other steps are in another folder.
    pub(super) fn steps(&self) -> Option<String> {
        self.earlier.as_ref()?;
        let (first, last) = self.passed.range?;
        Some(format!("steps {} to {}", count(first), count(last)))
    }

    /// The steps of these rows, and the place of the others.
    pub(super) fn part(&self) -> Option<String> {
        let Earlier { folders, step, .. } = self.earlier.as_ref()?;
        let before = count(*step);
        Some(self.steps().map_or_else(
            || format!("no step of the test; those up to {before} are in {folders}"),
            |steps| format!("{steps} only; the steps before are in {folders}"),
        ))
    }

    /// A section on these rows: a note reports it if they are not the whole test.
    pub(super) fn section(&self, heading: &str, inside: Markup) -> Markup {
        let part = self.part().map(|part| note(&format!("Of {part}.")));
        section(
            heading,
            html! { @if let Some(part) = part { (part) } (inside) },
        )
    }

    /// A column: of the structure at the ends of steps, of specimens at every tick. `time` is that of the ends of steps.
    pub(super) fn get(&self, name: &str) -> Option<&[f64]> {
        let found = self.table.get(name);
        found.or_else(|| self.ticks.get(name))
    }

    /// The table with this column.
    fn table_of(&self, name: &str) -> &Table {
        match self.table.get(name) {
            Some(_) => &self.table,
            None => &self.ticks,
        }
    }

    /// Test time of the entries of a column.
    pub(super) fn time_of(&self, name: &str) -> Option<&[f64]> {
        self.table_of(name).time_of(name)
    }

    /// A column that holds at least one number, with the times of its entries.
    pub(super) fn history(&self, name: &str) -> Option<History<'_>> {
        Some(History {
            values: self.filled(name)?,
            time: self.time_of(name)?,
        })
    }

    /// Extremes and last value of a column, each that of a single row.
    pub(super) fn marks(&self, name: &str) -> Marks {
        self.table_of(name).marks(name)
    }

    /// A test time with the digits that name its tick.
    pub(super) fn moment(&self, time: f64) -> String {
        let ticks = self.ticks_per_step.max(1) as f64;
        let tick = self.passed.step_s.map(|step| step / ticks);
        moment(time, tick)
    }

    /// A column that holds at least one number.
    pub(super) fn filled(&self, name: &str) -> Option<&[f64]> {
        self.get(name)
            .filter(|values| values.iter().any(|v| v.is_finite()))
    }

    /// Unit of a column.
    pub(super) fn unit(&self, name: &str) -> &str {
        self.table_of(name).unit(name)
    }

    /// Unit of the displacement of a DOF; that of all that are not recorded where this is not.
    pub(super) fn disp_unit(&self, dof: u32) -> &str {
        let name = format!("x{dof}");
        let is_recorded = self.get(&name).is_some();
        if is_recorded { self.unit(&name) } else { "m" }
    }

    /// Names of all columns that are kept.
    pub(super) fn names(&self) -> Vec<String> {
        let tables = [&self.table, &self.ticks];
        let names = tables.into_iter().flat_map(Table::names);
        names.map(str::to_owned).collect()
    }
}
