//! The rows of a run show its end, its steps and its largest magnitudes.

use crate::row_peaks::RowPeaks;
use gusset_quantity::catalog::phase::{GIVEN_UP, Phase};
use gusset_record::summary::Peak;
use gusset_record::{FolderError, Run};

/// Findings in the rows of a run.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// A limit, a fault or the clock ended the test in one of them.
    pub tripped: bool,
    /// The last step that has a row.
    pub steps: Option<u64>,
    /// Largest magnitudes of the DOFs and specimens that were recorded.
    pub peak: Peak,
    /// Largest magnitudes in all rows, with those of stale measurements.
    pub most: Peak,
    /// None of them is missing or damaged.
    pub are_whole: bool,
}

impl Rows {
    pub(crate) fn of(run: &Run, table: &toml::Table) -> Result<Self, FolderError> {
        let at = |name: &str| run.layout().index_of(name).unwrap_or(usize::MAX);
        let (state, step) = (at("state"), at("step"));
        let names = specimens(table);
        let mut peaks = RowPeaks::of_test(run, names.len());
        let mut most = RowPeaks::of_every_row(run, names.len());
        let mut found = Self::default();
        let mut journal = run.journal()?;
        let path = run.path().join("samples.bin");
        let io = |source| FolderError::Io {
            path: path.clone(),
            source,
        };
        while let Some(row) = journal.next_row().map_err(io)? {
            let value = |place: usize| row.values.get(place).copied().unwrap_or(f64::NAN);
            let state = value(state);
            found.tripped |= state == Phase::Tripped.code() || state == GIVEN_UP;
            if state == Phase::Running.code() {
                found.steps = Some(value(step) as u64);
            }
            peaks.take(row.values, true);
            most.take(row.values, true);
        }
        found.are_whole = journal.end() == Some(gusset_record::End::Clean) && journal.lost() == 0;
        found.peak = peaks.finish(names.iter().cloned());
        found.most = most.finish(names.into_iter());
        Ok(found)
    }
}

/// Names of the specimens, in order.
fn specimens(table: &toml::Table) -> Vec<String> {
    let all = table.get("specimen").and_then(toml::Value::as_array);
    let name = |specimen: &toml::Value| Some(specimen.get("name")?.as_str()?.to_owned());
    all.into_iter().flatten().filter_map(name).collect()
}
