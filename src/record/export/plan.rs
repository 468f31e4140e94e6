//! Rows and columns of an export, whatever its format.
//!
//! Rows: from t = 0 the last tick of each step, or every tick. Columns, found by name in `samples.json`:
//!
//! 1. `time`;
//! 2. `x<dof>` of all recorded DOFs, then `v<dof>`, then `a<dof>`;
//! 3. for each specimen s and axis j `target_s_j`, `cmd_s_j`, `meas_s_j`, `force_s_j`;
//! 4. `status_s` of each specimen where it was recorded: it marks the rows whose measurement is of another tick;
//! 5. deformations and forces of the recorded members of a frame;
//! 6. the motion of the `ground` of a structure;
//! 7. the requested sums of recorded columns.
//!
//! A format that holds numbers in binary adds all other columns of the log, and the sequence numbers of the rows.

use std::collections::{BTreeMap, BTreeSet};
use std::io;

use super::ExportError;
use crate::Column;
use crate::journal::Journal;
use crate::layout::{COMMITS, Layout};
use gusset_quantity::catalog::column::{self, Kind};
use gusset_quantity::catalog::phase::Phase;

/// Rows of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rows {
    /// From t = 0 the last tick of each step.
    Step,
    /// Every tick, also those before t = 0; not those in which the loop only runs warm.
    Tick,
}

/// Part of a run to export.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The rows.
    pub rows: Rows,
    /// Only from this test time on, s.
    pub from: Option<f64>,
    /// Only up to this test time, s.
    pub to: Option<f64>,
}

impl Choice {
    /// All rows of this kind.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn all(rows: Rows) -> Self {
        Self {
            rows,
            from: None,
            to: None,
        }
    }

    pub(super) fn check(&self) -> Result<(), ExportError> {
        let (from, to) = self.window();
        if from <= to {
            Ok(())
        } else {
            Err(ExportError::Window { from, to })
        }
    }

    /// Whether only a part was requested.
    pub(super) const fn is_part(&self) -> bool {
        self.from.is_some() || self.to.is_some()
    }

    /// Whether a row of this test time belongs to it.
    pub(super) fn holds(&self, time: f64) -> bool {
        let (from, to) = self.window();
        !self.is_part() || (from - roundoff(from) <= time && time <= to + roundoff(to))
    }

    fn window(&self) -> (f64, f64) {
        (
            self.from.unwrap_or(f64::NEG_INFINITY),
            self.to.unwrap_or(f64::INFINITY),
        )
    }
}

/// Roundoff of a time in s that was computed from a count of ticks.
fn roundoff(time: f64) -> f64 {
    1e-12 * time.abs().min(f64::MAX)
}

/// A column that is a weighted sum of recorded ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Sum {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its meaning in words.
    pub meaning: String,
    /// Names of recorded columns, with their factors.
    pub terms: Vec<(String, f64)>,
}

/// Where the values of an exported column come from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Source {
    /// This place of the row.
    Place(usize),
    /// The sum of these places, each times its factor.
    Sum(Vec<(usize, f64)>),
    /// The number of the row.
    Sequence,
    /// Nowhere: it was not recorded.
    Nothing,
}

impl Source {
    /// The number of this column in a row, NaN if the row has no such number. The row does not hold its sequence number.
    pub(crate) fn value(&self, row: &[f64]) -> f64 {
        let at = |place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        match self {
            Self::Place(place) => at(*place),
            Self::Sum(terms) => {
                let terms = terms.iter().map(|(place, factor)| factor * at(*place));
                // The first term alone keeps its bits.
                terms.reduce(|sum, term| sum + term).unwrap_or(f64::NAN)
            }
            Self::Sequence | Self::Nothing => f64::NAN,
        }
    }
}

/// A column in the export.
#[derive(Debug, Clone)]
pub(super) struct Exposed {
    pub column: Column,
    pub source: Source,
}

/// The parts of a row that an export takes.
#[derive(Debug)]
pub(super) struct Plan {
    step: usize,
    state: Option<usize>,
    pub time: usize,
    /// How many columns the CSV has.
    csv: usize,
    /// The columns that an export has.
    pub columns: Vec<Exposed>,
}

/// State of a row in which a step is made.
const RUNNING: f64 = Phase::Running.code();
/// State of a row of the warm-up, which holds nothing of the test.
pub(super) const WARMING_UP: f64 = Phase::Armed.code();
/// State of the row that ends a test, whose step is not made.
const TRIPPED: f64 = Phase::Tripped.code();

const DOF: [Kind; 3] = [column::DISP, column::VEL, column::ACCEL];
const AXIS: [Kind; 4] = [
    column::TARGET,
    column::COMMAND,
    column::MEASURED,
    column::FORCE,
];

const MEMBER: [Kind; 16] = [
    column::STRETCH,
    column::START_ROTATION,
    column::END_ROTATION,
    column::MEMBER_FORCE,
    column::START_MOMENT,
    column::END_MOMENT,
    column::WEAK_START_ROTATION,
    column::WEAK_END_ROTATION,
    column::TWIST,
    column::WEAK_START_MOMENT,
    column::WEAK_END_MOMENT,
    column::TORQUE,
    column::STRETCH_Y,
    column::STRETCH_Z,
    column::MEMBER_FORCE_Y,
    column::MEMBER_FORCE_Z,
];

/// Why a walk ended early.
pub(super) enum Trouble {
    Read(io::Error),
    Write(io::Error),
}

impl Trouble {
    pub(crate) fn told(self, write: impl Fn(io::Error) -> ExportError) -> ExportError {
        match self {
            Self::Read(source) => ExportError::Read(source),
            Self::Write(source) => write(source),
        }
    }
}

impl Plan {
    pub(crate) fn new(layout: &Layout, sums: &[Sum]) -> Result<Self, ExportError> {
        let need = |name| layout.index_of(name).ok_or(ExportError::NoColumn(name));
        let (step, time) = (need("step")?, need("time")?);
        // A server numbers exchanges, some of which are trials; the steps are those of its controller.
        let step = layout.index_of(COMMITS).unwrap_or(step);
        let mut dofs: BTreeMap<u32, [Option<usize>; 3]> = BTreeMap::new();
        let mut axes: BTreeMap<(u32, u32), [Option<usize>; 4]> = BTreeMap::new();
        let mut statuses: BTreeMap<u32, usize> = BTreeMap::new();
        for (place, column) in layout.columns().iter().enumerate() {
            let name = column.name.as_str();
            for (kind, of) in DOF.iter().enumerate() {
                if let Some(dof) = of.dof_in(name) {
                    dofs.entry(dof).or_default()[kind] = Some(place);
                }
            }
            for (kind, of) in AXIS.iter().enumerate() {
                if let Some(axis) = of.axis_in(name) {
                    axes.entry(axis).or_default()[kind] = Some(place);
                }
            }
            if let Some(specimen) = column::STATUS.specimen_in(name) {
                statuses.insert(specimen, place);
            }
        }
        let mut wanted = vec![("time".to_owned(), "s", Some(time))];
        for (place, kind) in DOF.iter().enumerate() {
            for (dof, found) in &dofs {
                wanted.push((kind.of_dof(*dof), kind.unit_of(false), found[place]));
            }
        }
        for ((specimen, axis), found) in &axes {
            for (kind, place) in AXIS.iter().zip(found) {
                wanted.push((kind.of_axis(*specimen, *axis), kind.unit, *place));
            }
        }
        for (specimen, place) in statuses {
            wanted.push((column::STATUS.of_specimen(specimen), "1", Some(place)));
        }
        for (place, column) in layout.columns().iter().enumerate() {
            let of_member = |kind: &Kind| kind.member_in(&column.name).is_some();
            if MEMBER.iter().any(of_member) {
                wanted.push((column.name.clone(), "", Some(place)));
            }
        }
        if !dofs.is_empty() {
            for (place, column) in layout.columns().iter().enumerate() {
                if column::is_ground(&column.name) {
                    wanted.push((column.name.clone(), column::GROUND.unit, Some(place)));
                }
            }
        }
        let sums = sums
            .iter()
            .map(|sum| exposed(layout, sum))
            .collect::<Result<Vec<_>, _>>()?;
        let csv = wanted.len() + sums.len();
        let taken: BTreeSet<usize> = wanted.iter().filter_map(|(_, _, place)| *place).collect();
        let in_csv = wanted.into_iter().map(|(name, unit, place)| {
            match place.and_then(|p| layout.columns().get(p)) {
                Some(column) => (column.clone(), place.map_or(Source::Nothing, Source::Place)),
                None => {
                    let meaning = "was not recorded";
                    (column(name, unit, meaning), Source::Nothing)
                }
            }
        });
        let others = layout.columns().iter().enumerate();
        let others = others
            .filter(|(place, _)| !taken.contains(place))
            .map(|(place, column)| (column.clone(), Source::Place(place)));
        let sequence = column(
            "sequence".to_owned(),
            "1",
            "number of the row as the loop counted; a gap is rows that were lost",
        );
        let columns = in_csv
            .chain(sums)
            .chain(others)
            .chain([(sequence, Source::Sequence)])
            .map(|(column, source)| Exposed { column, source })
            .collect();
        Ok(Self {
            step,
            state: layout.index_of("state"),
            time,
            csv,
            columns,
        })
    }

    /// The columns of a CSV: time, response, specimens, members, ground, then the requested sums.
    pub(crate) fn csv_columns(&self) -> &[Exposed] {
        self.columns.get(..self.csv).unwrap_or_default()
    }

    /// Names of those of them that were not recorded.
    pub(crate) fn not_recorded(&self) -> Vec<&str> {
        let none = self.csv_columns().iter();
        let none = none.filter(|exposed| exposed.source == Source::Nothing);
        none.map(|exposed| exposed.column.name.as_str()).collect()
    }

    /// The names of all columns, so that none is among `reserved`: those get an underscore behind them.
    pub(crate) fn names(&self, reserved: &[&str]) -> Vec<String> {
        let known: BTreeSet<&str> = self
            .columns
            .iter()
            .map(|c| c.column.name.as_str())
            .collect();
        let fit = |name: &str| {
            let mut name = name.to_owned();
            while reserved.contains(&name.as_str()) {
                name.push('_');
                while known.contains(name.as_str()) {
                    name.push('_');
                }
            }
            name
        };
        self.columns.iter().map(|c| fit(&c.column.name)).collect()
    }

    /// Gives the chosen rows to `emit`, at most `limit` of them, and says how many there were.
    pub(crate) fn walk(
        &self,
        journal: &mut Journal<impl io::Read>,
        choice: &Choice,
        limit: u64,
        mut emit: impl FnMut(u64, &[f64]) -> io::Result<()>,
    ) -> Result<u64, Trouble> {
        let at = |row: &[f64], place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        let mut given = 0;
        let mut give = |sequence: u64, row: &[f64]| {
            if !choice.holds(at(row, self.time)) {
                return Ok(given);
            }
            given += 1;
            emit(sequence, row).map_err(Trouble::Write).map(|()| given)
        };
        let mut held: Vec<f64> = Vec::new();
        let mut held_sequence = 0;
        let mut had = 0;
        while had < limit
            && let Some(row) = journal.next_row().map_err(Trouble::Read)?
        {
            if choice.rows == Rows::Tick {
                if self
                    .state
                    .is_some_and(|place| at(row.values, place) == WARMING_UP)
                {
                    continue;
                }
                had = give(row.sequence, row.values)?;
                continue;
            }
            let same_step = !held.is_empty() && at(&held, self.step) == at(row.values, self.step);
            // Between two steps and in holds nothing is new but commands and measurements; a trip before the first is of none.
            let is_step = self.state.is_none_or(|place| {
                let state = at(row.values, place);
                state == RUNNING || (state == TRIPPED && !held.is_empty() && !same_step)
            });
            let begun = at(row.values, self.time) >= 0.0;
            if !begun || !is_step {
                continue;
            }
            // The row held back is the last of its step once a row of another step is there.
            if !held.is_empty() && !same_step {
                had = give(held_sequence, &held)?;
            }
            held.clear();
            held.extend_from_slice(row.values);
            held_sequence = row.sequence;
        }
        if !held.is_empty() && had < limit {
            give(held_sequence, &held)?;
        }
        Ok(given)
    }
}

fn exposed(layout: &Layout, sum: &Sum) -> Result<(Column, Source), ExportError> {
    let place = |name: &str| {
        let needs = || ExportError::NotRecorded {
            name: sum.name.clone(),
            needs: name.to_owned(),
        };
        layout.index_of(name).ok_or_else(needs)
    };
    let terms = sum
        .terms
        .iter()
        .map(|(name, factor)| Ok((place(name)?, *factor)))
        .collect::<Result<Vec<_>, ExportError>>()?;
    let column = column(sum.name.clone(), &sum.unit, &sum.meaning);
    Ok((column, Source::Sum(terms)))
}

fn column(name: String, unit: &str, meaning: &str) -> Column {
    Column {
        name,
        unit: unit.to_owned(),
        meaning: meaning.to_owned(),
        timing: false,
    }
}
