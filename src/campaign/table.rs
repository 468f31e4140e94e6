//! The table: one row for each task, in the order of the tasks.

use std::io::{self, Write};

use super::perform::Performed;
use super::study::Study;
use super::task::Task;

/// A column of the table.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct TableColumn {
    /// Name, as in the first line of the table.
    pub name: String,
    /// SI unit, "1" for a pure number, "" for a text.
    pub unit: String,
    /// One line of explanation.
    pub meaning: String,
}

/// All columns of the table of a study.
pub(super) fn columns(study: &Study) -> Vec<TableColumn> {
    let column = |name: &str, unit: &str, meaning: &str| TableColumn {
        name: name.to_owned(),
        unit: unit.to_owned(),
        meaning: meaning.to_owned(),
    };
    let mut all = vec![column("task", "1", "number of the task, from 1")];
    let axes = study.axes.iter();
    all.extend(axes.map(|axis| {
        column(
            &axis.key,
            "",
            "value that varies; empty: as in the test file",
        )
    }));
    if let Some(first) = study.motions.first() {
        all.push(column("record", "", "ground motion"));
        if study.motions.iter().any(|one| !one.levels.is_empty()) {
            all.push(column("intensity", &first.unit(), &first.words()));
        }
    }
    if study.loaded.study.campaign.replicates > 1 {
        all.push(column("replicate", "1", "number of the draw, from 1"));
    }
    let samples = study.samples.iter();
    all.extend(samples.map(|one| {
        column(
            &one.key.to_string(),
            "",
            "drawn number, in the unit of the key",
        )
    }));
    all.push(column(
        "ended",
        "",
        "done; or the cause that stopped the test; or invalid: there is no such test",
    ));
    let measures = study.measures.iter();
    all.extend(measures.map(|one| column(&one.name, &one.unit, &one.meaning)));
    all
}

/// Writes the first line.
pub(super) fn head(out: &mut impl Write, columns: &[TableColumn]) -> io::Result<()> {
    let names: Vec<String> = columns.iter().map(|one| quoted(&one.name)).collect();
    writeln!(out, "{}", names.join(","))
}

/// Writes the row of a task.
pub(super) fn row(
    out: &mut impl Write,
    study: &Study,
    task: &Task,
    result: &Performed,
) -> io::Result<()> {
    let mut cells = vec![(task.index + 1).to_string()];
    let values = task.values.iter();
    cells
        .extend(values.map(|value| quoted(value.as_deref().unwrap_or_default().trim_matches('"'))));
    if let Some((name, level)) = &task.motion {
        cells.push(quoted(name));
        if study.motions.iter().any(|one| !one.levels.is_empty()) {
            cells.push(level.map_or_else(String::new, number));
        }
    }
    if study.loaded.study.campaign.replicates > 1 {
        cells.push((task.replicate + 1).to_string());
    }
    cells.extend(task.draws.iter().map(|value| number(*value)));
    cells.push(quoted(&result.ended));
    cells.extend(result.values.iter().map(|value| number(*value)));
    writeln!(out, "{}", cells.join(","))
}

/// The shortest text that reads back as the same number; nothing for a number that does not exist.
fn number(value: f64) -> String {
    if value.is_nan() {
        String::new()
    } else {
        format!("{value:?}")
    }
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
