//! A run as Apache Parquet: `pandas.read_parquet("run.parquet")`, and Polars, DuckDB, R and MATLAB.
//!
//! One column per column, doubles but for `sequence` (INT64); what was not recorded is null. Beside the pairs of every export, each
//! key beginning with `gusset.`, the metadata of the file has the units: `gusset.columns` has name, unit and meaning of all columns
//! as JSON.

use std::path::Path;

use super::plan::{Choice, Plan, Source};
use super::{ExportError, Exported, Extra, metadata};
use crate::cell::{Cell, CellKind, TableColumn};
use crate::parquet::ParquetTable;
use crate::run::Run;

/// Writes all columns.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let plan = Plan::new(run.layout(), &extra.sums)?;
    let columns = plan.columns.iter().map(|exposed| TableColumn {
        name: exposed.column.name.clone(),
        unit: exposed.column.unit.clone(),
        kind: match exposed.source {
            Source::Sequence => CellKind::Integer,
            _ => CellKind::Number,
        },
        meaning: exposed.column.meaning.clone(),
    });
    let columns: Vec<_> = columns.collect();
    let mut table = ParquetTable::create(out, &columns, metadata(run)).map_err(failed)?;
    let mut journal = run.journal()?;
    let rows = plan
        .walk(&mut journal, choice, u64::MAX, |sequence, row| {
            let cells = plan.columns.iter().map(|exposed| match &exposed.source {
                Source::Sequence => Cell::count(sequence),
                Source::Nothing => Cell::Missing,
                // A number that the log holds as NaN keeps its bits.
                source => Cell::Number(source.value(row)),
            });
            table.row(cells)
        })
        .map_err(|trouble| trouble.told(failed))?;
    table.finish().map_err(failed)?;
    Ok(Exported::new(run, rows, &journal).of_table(&plan))
}
