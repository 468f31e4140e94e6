//! The table: one row for each task, in the order of the tasks, as CSV and as Parquet.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::perform::Performed;
use super::study::Study;
use super::task::Task;
use super::{CampaignError, at};
use gusset_config::Scalar;
use gusset_quantity::units::unit_in_name;
use gusset_record::atomic::AtomicFile;
use gusset_record::cell::{Cell, CellKind, TableColumn, quoted};
#[cfg(feature = "parquet")]
use gusset_record::parquet::ParquetTable;

/// Kind of a column with these values of an axis.
fn kind_of(values: &[Scalar]) -> CellKind {
    let is_whole = |value: &Scalar| matches!(value, Scalar::Whole(_));
    let is_number = |value: &Scalar| is_whole(value) || matches!(value, Scalar::Real(_));
    if values.iter().all(is_whole) {
        CellKind::Integer
    } else if values.iter().all(is_number) {
        CellKind::Number
    } else {
        CellKind::Text
    }
}

/// All columns of the table of a study.
pub(super) fn columns(study: &Study) -> Vec<TableColumn> {
    let column = |name: &str, unit: &str, kind: CellKind, meaning: &str| TableColumn {
        name: name.to_owned(),
        unit: unit.to_owned(),
        kind,
        meaning: meaning.to_owned(),
    };
    let (integer, number, text) = (CellKind::Integer, CellKind::Number, CellKind::Text);
    let mut all = vec![column("task", "1", integer, "number of the task, from 1")];
    let axes = study.axes.iter();
    all.extend(axes.map(|axis| {
        let words = "value that varies; empty: as in the test file";
        let kind = kind_of(&axis.values);
        let unit = if kind == text {
            ""
        } else {
            unit_in_name(&axis.key)
        };
        column(&axis.key, unit, kind, words)
    }));
    if !study.motions.is_empty() {
        all.push(column("record", "", text, "ground motion"));
    }
    if let Some(first) = study.levelled() {
        all.push(column("intensity", &first.unit(), number, &first.words()));
    }
    if study.loaded.study.campaign.replicates > 1 {
        all.push(column(
            "replicate",
            "1",
            integer,
            "number of the draw, from 1",
        ));
    }
    let samples = study.samples.iter();
    all.extend(samples.map(|one| {
        let key = one.key.to_string();
        let words = "drawn number, in the unit of the key";
        column(&key, unit_in_name(&key), number, words)
    }));
    let words = "done; or the cause that stopped the test; or invalid: there is no such test";
    all.push(column("ended", "", text, words));
    let measures = study.measures.iter();
    all.extend(measures.map(|one| column(&one.name, &one.unit, number, &one.meaning)));
    all
}

/// The row of a task, one cell for each column.
pub(super) fn cells(study: &Study, task: &Task, result: &Performed) -> Vec<Cell> {
    let mut cells = vec![Cell::count(task.index + 1)];
    let axes = study.axes.iter().zip(&task.values);
    cells.extend(axes.map(|(axis, value)| {
        let value = value.as_ref();
        value.map_or(Cell::Missing, |value| of_axis(value, kind_of(&axis.values)))
    }));
    if let Some((name, level)) = &task.motion {
        cells.push(Cell::Text(name.clone()));
        if study.levelled().is_some() {
            cells.push(level.map_or(Cell::Missing, Cell::number));
        }
    }
    if study.loaded.study.campaign.replicates > 1 {
        cells.push(Cell::count(task.replicate + 1));
    }
    cells.extend(task.draws.iter().map(|value| Cell::number(*value)));
    cells.push(Cell::Text(result.ended.clone()));
    cells.extend(result.values.iter().map(|value| Cell::number(*value)));
    cells
}

/// A value of an axis in a column of kind `kind`.
fn of_axis(value: &Scalar, kind: CellKind) -> Cell {
    match (kind, value) {
        (CellKind::Integer, Scalar::Whole(value)) => Cell::Integer(*value),
        (CellKind::Number, Scalar::Whole(value)) => Cell::Number(*value as f64),
        (CellKind::Number, Scalar::Real(value)) => Cell::number(*value),
        (_, Scalar::Text(value)) => Cell::Text(value.clone()),
        (_, value) => Cell::Text(value.toml()),
    }
}

/// The files of a table that is being written.
pub(super) struct Tables {
    folder: PathBuf,
    csv: BufWriter<AtomicFile>,
    #[cfg(feature = "parquet")]
    parquet: ParquetTable,
}

impl Tables {
    /// Begins the files of a table with `columns` in `folder`. The Parquet file gets `metadata`.
    #[cfg_attr(
        not(feature = "parquet"),
        expect(unused_variables, reason = "only the Parquet file has metadata")
    )]
    pub(crate) fn create(
        folder: &Path,
        columns: &[TableColumn],
        metadata: Vec<(&'static str, String)>,
    ) -> Result<Self, CampaignError> {
        let path = partial(folder, "csv");
        let file = AtomicFile::create(&path).map_err(at(&path))?;
        let mut csv = BufWriter::new(file);
        let names: Vec<String> = columns.iter().map(|one| quoted(&one.name)).collect();
        writeln!(csv, "{}", names.join(",")).map_err(at(&path))?;
        Ok(Self {
            folder: folder.to_owned(),
            csv,
            #[cfg(feature = "parquet")]
            parquet: {
                let path = partial(folder, "parquet");
                ParquetTable::create(&path, columns, metadata).map_err(at(&path))?
            },
        })
    }

    /// Adds a row.
    pub(crate) fn row(&mut self, cells: Vec<Cell>) -> Result<(), CampaignError> {
        let texts: Vec<String> = cells.iter().map(Cell::csv).collect();
        let line = writeln!(self.csv, "{}", texts.join(","));
        line.map_err(at(&partial(&self.folder, "csv")))?;
        #[cfg(feature = "parquet")]
        {
            let row = self.parquet.row(cells);
            row.map_err(at(&partial(&self.folder, "parquet")))?;
        }
        Ok(())
    }

    /// Ends the files, and returns the CSV file. An incomplete table keeps the name of a partial one.
    pub(crate) fn finish(self, is_complete: bool) -> Result<PathBuf, CampaignError> {
        let csv = partial(&self.folder, "csv");
        let file = self
            .csv
            .into_inner()
            .map_err(io::IntoInnerError::into_error);
        file.and_then(AtomicFile::commit).map_err(at(&csv))?;
        #[cfg(feature = "parquet")]
        {
            let finished = self.parquet.finish();
            finished.map_err(at(&partial(&self.folder, "parquet")))?;
        }
        for extension in ["parquet", "csv"] {
            let part = partial(&self.folder, extension);
            let whole = self.folder.join(format!("table.{extension}"));
            if !is_complete || !cfg!(feature = "parquet") && extension == "parquet" {
                // An old table of other parts would be taken for this one.
                let _there_may_be_none = fs::remove_file(&whole);
            } else {
                fs::rename(&part, &whole).map_err(at(&whole))?;
            }
        }
        let name = if is_complete {
            "table.csv"
        } else {
            "table.partial.csv"
        };
        Ok(self.folder.join(name))
    }
}

/// The table of an incomplete campaign.
fn partial(folder: &Path, extension: &str) -> PathBuf {
    folder.join(format!("table.partial.{extension}"))
}
