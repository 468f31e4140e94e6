//! The response history as CSV.
//!
//! A header; then one row per step from t = 0, the last tick of each step, or every tick. Columns: `time`; `x<dof>`
//! of all recorded DOFs, then `v<dof>`, then `a<dof>`; then for each specimen s and axis j `target_s_j`, `cmd_s_j`,
//! `meas_s_j`, `force_s_j`. 17 significant digits, so that every double reads back to the same bits; what does not
//! exist is empty. The columns are found by name in `samples.json`.
//!
//! The file appears whole or not at all. It is pure data: what a reader should know beside it (an unfinished run,
//! lost rows) comes back as [`Notice`]s for the caller to say.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::atomic::AtomicFile;
use super::folder::FolderError;
use super::journal::{End, Journal};
use super::layout::Layout;
use super::run::Run;

/// Which rows are exported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rows {
    /// From t = 0 the last tick of each step.
    Step,
    /// Every tick, also those before t = 0.
    Tick,
}

/// Why there is no export.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The samples have no such column.
    #[error("the samples have no column {0:?}, which an export needs")]
    NoColumn(&'static str),
    /// The run folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The samples cannot be read.
    #[error("cannot read the samples: {0}")]
    Read(io::Error),
    /// The file cannot be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// What a reader of the export should know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Notice {
    /// The run has no summary: it is still running or was killed.
    Unfinished,
    /// So many rows never reached the file.
    RowsLost(u64),
    /// The samples end in the middle of a row or in damage.
    Ended(End),
}

impl std::fmt::Display for Notice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unfinished => write!(
                f,
                "the run is unfinished (no summary.json): it is still running or was killed"
            ),
            Self::RowsLost(rows) => {
                write!(f, "{rows} rows were lost while recording and are missing")
            }
            Self::Ended(end) => write!(f, "{end}"),
        }
    }
}

/// What an export came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exported {
    /// Rows written, the header not counted.
    pub rows: u64,
    /// What a reader should know.
    pub notices: Vec<Notice>,
}

/// Writes the CSV of a run to `out`, replacing what is there.
///
/// # Errors
/// [`ExportError`]; `out` is then as it was.
pub fn export_csv(run: &Run, rows: Rows, out: &Path) -> Result<Exported, ExportError> {
    let failed = |source| ExportError::Write {
        path: out.to_owned(),
        source,
    };
    let plan = Plan::new(run.layout())?;
    let mut journal = run.journal()?;
    let mut file = BufWriter::with_capacity(1 << 17, AtomicFile::create(out).map_err(failed)?);
    let written = write_csv(&plan, &mut journal, rows, &mut file).map_err(|error| match error {
        Trouble::Read(source) => ExportError::Read(source),
        Trouble::Write(source) => failed(source),
    })?;
    let file = file
        .into_inner()
        .map_err(|error| failed(error.into_error()))?;
    file.commit().map_err(failed)?;

    let unfinished = run.summary().is_none().then_some(Notice::Unfinished);
    // Rows lost at the very end leave no gap in the file; the summary knows of them.
    let lost = run.summary().map_or(0, |s| s.rows_lost).max(journal.lost());
    let lost = (lost > 0).then_some(Notice::RowsLost(lost));
    let ended = journal
        .end()
        .filter(|end| *end != End::Clean)
        .map(Notice::Ended);
    Ok(Exported {
        rows: written,
        notices: [unfinished, lost, ended].into_iter().flatten().collect(),
    })
}

enum Trouble {
    Read(io::Error),
    Write(io::Error),
}

fn write_csv(
    plan: &Plan,
    journal: &mut Journal<impl io::Read>,
    rows: Rows,
    out: &mut impl Write,
) -> Result<u64, Trouble> {
    let mut line = Vec::with_capacity(26 * plan.places.len());
    let mut held: Vec<f64> = Vec::new();
    let mut written = 0;
    out.write_all(plan.header.as_bytes())
        .map_err(Trouble::Write)?;
    let mut emit = |row: &[f64]| {
        plan.line(row, &mut line)
            .and_then(|()| out.write_all(&line))
            .map_err(Trouble::Write)
    };
    while let Some(row) = journal.next_row().map_err(Trouble::Read)? {
        if rows == Rows::Tick {
            let state = plan.state.and_then(|place| row.values.get(place));
            if state == Some(&WARMING_UP) {
                continue;
            }
            emit(row.values)?;
            written += 1;
            continue;
        }
        let at = |row: &[f64], place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        let same_step = !held.is_empty() && at(&held, plan.step) == at(row.values, plan.step);
        // Before the test, between two steps and in holds nothing is new but commands and measurements.
        let is_step = plan.state.is_none_or(|place| {
            let state = at(row.values, place);
            state == RUNNING || (state == TRIPPED && !same_step)
        });
        let begun = at(row.values, plan.time) >= 0.0;
        if !begun || !is_step {
            continue;
        }
        // The row held back is the last of its step once a row of another step is there.
        if !held.is_empty() && at(&held, plan.step) != at(row.values, plan.step) {
            emit(&held)?;
            written += 1;
        }
        held.clear();
        held.extend_from_slice(row.values);
    }
    if !held.is_empty() {
        emit(&held)?;
        written += 1;
    }
    Ok(written)
}

/// Which column of the row goes where.
struct Plan {
    step: usize,
    state: Option<usize>,
    time: usize,
    header: String,
    /// One per CSV column; `None` where the samples have no such column.
    places: Vec<Option<usize>>,
}

/// State of a row in which a step is made.
const RUNNING: f64 = 3.0;
/// State of a row in which the loop only runs warm.
const WARMING_UP: f64 = 10.0;
/// State of the row that ends a test, whose step is not made.
const TRIPPED: f64 = 8.0;

const DOF: [&str; 3] = ["x", "v", "a"];
const AXIS: [&str; 4] = ["target", "cmd", "meas", "force"];

impl Plan {
    fn new(layout: &Layout) -> Result<Self, ExportError> {
        let need = |name| layout.index_of(name).ok_or(ExportError::NoColumn(name));
        let (step, time) = (need("step")?, need("time")?);
        let mut dofs: BTreeMap<u32, [Option<usize>; 3]> = BTreeMap::new();
        let mut axes: BTreeMap<(u32, u32), [Option<usize>; 4]> = BTreeMap::new();
        for (place, column) in layout.columns().iter().enumerate() {
            if let Some((kind, dof)) = dof_column(&column.name) {
                dofs.entry(dof).or_default()[kind] = Some(place);
            } else if let Some((kind, axis)) = axis_column(&column.name) {
                axes.entry(axis).or_default()[kind] = Some(place);
            }
        }
        let mut header = String::from("time");
        let mut places = vec![Some(time)];
        for (kind, letter) in DOF.iter().enumerate() {
            for (dof, found) in &dofs {
                header.push_str(&format!(",{letter}{dof}"));
                places.push(found[kind]);
            }
        }
        for ((specimen, axis), found) in &axes {
            for (word, place) in AXIS.iter().zip(found) {
                header.push_str(&format!(",{word}_{specimen}_{axis}"));
                places.push(*place);
            }
        }
        header.push('\n');
        Ok(Self {
            step,
            state: layout.index_of("state"),
            time,
            header,
            places,
        })
    }

    /// The line of a row, without allocating once `line` has its size.
    fn line(&self, row: &[f64], line: &mut Vec<u8>) -> io::Result<()> {
        line.clear();
        for place in &self.places {
            let value = place.and_then(|place| row.get(place));
            if let Some(value) = value.filter(|value| !value.is_nan()) {
                write!(line, "{value:.16e}")?;
            }
            line.push(b',');
        }
        // Never empty: `time` is always there.
        if let Some(last) = line.last_mut() {
            *last = b'\n';
        }
        Ok(())
    }
}

/// `x3` → (0, 3).
fn dof_column(name: &str) -> Option<(usize, u32)> {
    let kind = DOF.iter().position(|letter| name.starts_with(letter))?;
    Some((kind, number(name.get(1..)?)?))
}

/// `cmd_2_1` → (1, (2, 1)).
fn axis_column(name: &str) -> Option<(usize, (u32, u32))> {
    let (word, rest) = name.split_once('_')?;
    let kind = AXIS.iter().position(|known| *known == word)?;
    let (specimen, axis) = rest.split_once('_')?;
    Some((kind, (number(specimen)?, number(axis)?)))
}

/// A number from 1 as we write it: no sign, no leading zero.
fn number(text: &str) -> Option<u32> {
    let plain = text.bytes().all(|b| b.is_ascii_digit()) && !text.starts_with('0');
    plain.then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::folder::tests::recorded;
    use crate::record::summary::tests::example;
    use proptest::prelude::*;

    const NAMES: [&str; 15] = [
        "step",
        "sub_tick",
        "state",
        "time",
        "x2",
        "x10",
        "v2",
        "v10",
        "a2",
        "a10",
        "force_1_1",
        "target_1_1",
        "cmd_1_1",
        "meas_1_1",
        "vendor_flag",
    ];

    fn row(step: f64, sub_tick: f64, time: f64, x2: f64) -> Vec<f64> {
        let mut row = vec![step, sub_tick, 3.0, time, x2];
        row.extend((1..=10).map(f64::from));
        row[9] = f64::NAN;
        row
    }

    fn exported(rows: &[Vec<f64>], which: Rows) -> (String, Exported) {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        recorded(&path, &NAMES, &rows);
        let out = temp.path().join("out.csv");
        let exported = export_csv(&Run::open(&path).unwrap(), which, &out).unwrap();
        (std::fs::read_to_string(out).unwrap(), exported)
    }

    #[test]
    fn the_header_and_the_first_line_are_these() {
        let (text, _) = exported(&[row(0.0, 0.0, 0.0, -0.1)], Rows::Step);
        assert_eq!(
            text,
            "time,x2,x10,v2,v10,a2,a10,target_1_1,cmd_1_1,meas_1_1,force_1_1\n\
             0.0000000000000000e0,-1.0000000000000001e-1,1.0000000000000000e0,2.0000000000000000e0,\
             3.0000000000000000e0,4.0000000000000000e0,,7.0000000000000000e0,8.0000000000000000e0,\
             9.0000000000000000e0,6.0000000000000000e0\n"
        );
    }

    #[test]
    fn per_step_it_is_the_last_tick_of_each_step_from_t_0_and_per_tick_all() {
        let rows = [
            row(-1.0, 0.0, -0.75, 8.0),
            row(0.0, 0.0, -0.5, 9.0),
            row(0.0, 0.0, 0.0, 1.0),
            row(1.0, 0.0, 0.25, 2.0),
            row(1.0, 1.0, 0.5, 3.0),
            row(2.0, 0.0, 0.75, 4.0),
        ];
        let x2 = |text: &str| -> Vec<f64> {
            let cell = |line: &str| line.split(',').nth(1).unwrap().parse().unwrap();
            text.lines().skip(1).map(cell).collect()
        };
        let (text, result) = exported(&rows, Rows::Step);
        assert_eq!((x2(&text), result.rows), (vec![1.0, 3.0, 4.0], 3));
        let (text, result) = exported(&rows, Rows::Tick);
        assert_eq!(
            (x2(&text), result.rows),
            (vec![8.0, 9.0, 1.0, 2.0, 3.0, 4.0], 6)
        );
        let (text, result) = exported(&[], Rows::Step);
        assert_eq!((text.lines().count(), result.rows), (1, 0));
    }

    #[test]
    fn a_column_that_was_not_recorded_stays_empty_in_its_place() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let names = ["step", "time", "x1", "force_2_1", "x01", "force_1", "a0"];
        recorded(&path, &names, &[&[0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]]);
        let out = temp.path().join("out.csv");
        export_csv(&Run::open(&path).unwrap(), Rows::Step, &out).unwrap();
        assert_eq!(
            std::fs::read_to_string(&out).unwrap(),
            "time,x1,v1,a1,target_2_1,cmd_2_1,meas_2_1,force_2_1\n\
             0.0000000000000000e0,1.0000000000000000e0,,,,,,2.0000000000000000e0\n"
        );
    }

    #[test]
    fn what_is_wrong_with_a_run_is_said_and_what_is_right_is_exported() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let (a, b) = (row(0.0, 0.0, 0.0, 1.0), row(1.0, 0.0, 0.1, 2.0));
        let folder = recorded(&path, &NAMES, &[&a, &b]);
        let out = temp.path().join("out.csv");
        let export = || export_csv(&Run::open(&path).unwrap(), Rows::Step, &out).unwrap();
        assert_eq!(export().notices, [Notice::Unfinished]);
        let mut summary = example();
        folder.write_summary(&summary).unwrap();
        assert_eq!(export().notices, []);
        summary.rows_lost = 7;
        folder.write_summary(&summary).unwrap();
        let samples = path.join("samples.bin");
        let bytes = std::fs::read(&samples).unwrap();
        std::fs::write(&samples, &bytes[..bytes.len() - 1]).unwrap();
        let torn = End::Torn {
            bytes: bytes.len() / 2 - 1,
        };
        let result = export();
        assert_eq!(result.notices, [Notice::RowsLost(7), Notice::Ended(torn)]);
        assert_eq!(result.rows, 1);
    }

    #[test]
    fn an_export_that_fails_leaves_what_was_there() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        recorded(&path, &["x1"], &[&[1.0]]);
        let out = temp.path().join("out.csv");
        std::fs::write(&out, "old").unwrap();
        let run = Run::open(&path).unwrap();
        assert!(matches!(
            export_csv(&run, Rows::Step, &out),
            Err(ExportError::NoColumn("step"))
        ));
        assert_eq!(std::fs::read_to_string(&out).unwrap(), "old");
        assert_eq!(std::fs::read_dir(temp.path()).unwrap().count(), 2);

        let plan = Plan::new(&crate::record::layout::tests::named(&NAMES)).unwrap();
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let mut journal = Journal::new(&[][..], NAMES.len());
        let result = write_csv(&plan, &mut journal, Rows::Step, &mut Full);
        assert!(matches!(result, Err(Trouble::Write(_))));
    }

    #[test]
    fn a_line_is_made_without_allocation() {
        let plan = Plan::new(&crate::record::layout::tests::named(&NAMES)).unwrap();
        let values = row(1.0, 0.0, -1.2345678901234567e-300, f64::MAX);
        let mut line = Vec::with_capacity(26 * plan.places.len());
        let used = allocation_counter::measure(|| plan.line(&values, &mut line).unwrap());
        assert_eq!(used.count_total, 0);
    }

    proptest! {
        #[test]
        fn every_number_reads_back_to_the_same_bits(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            let plan = Plan::new(&crate::record::layout::tests::named(&["step", "time", "x1"])).unwrap();
            let mut line = Vec::new();
            plan.line(&[0.0, 0.0, value], &mut line).unwrap();
            let text = std::str::from_utf8(&line).unwrap();
            let cell = text.split(',').nth(1).unwrap();
            if value.is_nan() {
                prop_assert_eq!(cell, "");
            } else {
                prop_assert_eq!(cell.parse::<f64>().unwrap().to_bits(), bits);
            }
        }
    }
}
