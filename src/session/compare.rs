//! Two run folders on one page.

use std::path::{Path, PathBuf};

use super::page::{PageError, read, write};
use gusset_record::{FolderError, Journal, Run};
use gusset_view::report::{self, Matched, Matcher, Next, RunView};

/// A page that was written, and its results in sentences.
#[derive(Debug)]
pub struct Compared {
    /// The file.
    pub path: PathBuf,
    /// Result for each further run against the first.
    pub verdicts: Vec<String>,
    /// Missing parts of the runs' records, and findings of their verdicts, in words.
    pub damages: Vec<String>,
}

/// Writes the page that compares the run in `first` with those in `others` to `out`, replacing an earlier file. Runs that cannot
/// be compared row by row are compared as far as possible, and the page gives the reason.
///
/// # Errors
/// [`PageError`]; `out` is then unchanged.
pub fn compare(first: &Path, others: &[PathBuf], out: &Path) -> Result<Compared, PageError> {
    let folders: Vec<&Path> = std::iter::once(first)
        .chain(others.iter().map(PathBuf::as_path))
        .collect();
    let runs = folders
        .iter()
        .map(|folder| read(folder))
        .collect::<Result<Vec<_>, _>>()?;
    let further = folders.iter().zip(&runs).skip(1);
    let against = further.map(|(folder, run)| matched((first, &runs[0]), (folder, run)));
    let against = against.collect::<Result<Vec<_>, _>>()?;
    let names = (1..)
        .zip(&folders)
        .map(|(number, folder)| name(folder).unwrap_or_else(|| format!("run {number}")));
    let names: Vec<String> = names.collect();
    let named: Vec<(&str, &RunView)> = names.iter().map(String::as_str).zip(&runs).collect();
    let page = report::compare(&named, &against);
    let runs: Vec<&RunView> = runs.iter().collect();
    Ok(Compared {
        path: write(out, &page)?,
        verdicts: against.iter().map(report::verdict).collect(),
        damages: [report::damages(&runs), report::doubts(&runs)].concat(),
    })
}

/// Default path of the page: in the working directory, named after all runs.
#[must_use]
pub fn compared_name(first: &Path, others: &[PathBuf]) -> PathBuf {
    let of = |path: &Path| name(path).unwrap_or_else(|| "run".to_owned());
    let others = others.iter().map(|path| format!("-against-{}", of(path)));
    PathBuf::from(format!("{}{}.html", of(first), others.collect::<String>()))
}

fn name(folder: &Path) -> Option<String> {
    let whole = folder.canonicalize().ok()?;
    Some(whole.file_name()?.to_string_lossy().into_owned())
}

fn matched(
    (first, a): (&Path, &RunView),
    (second, b): (&Path, &RunView),
) -> Result<Result<Matched, String>, PageError> {
    let dt = |run: &RunView| run.summary.as_ref().map(|summary| summary.dt);
    if let (Some(x), Some(y)) = (dt(a), dt(b))
        && (x / y - 1.0).abs() > 1e-9
    {
        return Ok(Err(format!(
            "their steps are {x} s and {y} s long, so that no row of the one belongs to a row of the other; histories, loops and \
             metrics stand side by side"
        )));
    }
    let (one, two) = (Run::open(first)?, Run::open(second)?);
    let bytes =
        |path: &Path| std::fs::metadata(path.join("samples.bin")).map_or(0, |file| file.len());
    let rows = bytes(first) / one.layout().stride() as u64;
    let rows = rows.max(bytes(second) / two.layout().stride() as u64);
    let Some(mut matcher) = Matcher::new(one.layout().columns(), two.layout().columns(), rows)
    else {
        return Ok(Err(
            "they have no column of a structure or a specimen in common, or no steps to be matched by".to_owned(),
        ));
    };
    let (mut one, mut two) = (Rows::of(&one, first)?, Rows::of(&two, second)?);
    one.next(|row, before| matcher.is_running(row, before, false))?;
    two.next(|row, before| matcher.is_running(row, before, true))?;
    while one.is_there && two.is_there {
        let next = matcher.take(&one.row, &two.row);
        if next != Next::Second {
            one.next(|row, before| matcher.is_running(row, before, false))?;
        }
        if next != Next::First {
            two.next(|row, before| matcher.is_running(row, before, true))?;
        }
    }
    let left = (
        one.left(|row, before| matcher.is_running(row, before, false))?,
        two.left(|row, before| matcher.is_running(row, before, true))?,
    );
    Ok(Ok(matcher.finish(left)))
}

/// The ticks of a run's running test, one after the other.
struct Rows {
    journal: Journal<std::fs::File>,
    path: PathBuf,
    row: Vec<f64>,
    is_there: bool,
}

impl Rows {
    fn of(run: &Run, folder: &Path) -> Result<Self, FolderError> {
        Ok(Self {
            journal: run.journal()?,
            path: folder.join("samples.bin"),
            row: Vec::new(),
            is_there: false,
        })
    }

    fn next(&mut self, is_running: impl Fn(&[f64], &[f64]) -> bool) -> Result<(), PageError> {
        self.is_there = false;
        loop {
            let row = self.journal.next_row().map_err(|source| PageError::File {
                path: self.path.clone(),
                source,
            })?;
            let Some(row) = row else { return Ok(()) };
            if is_running(row.values, &self.row) {
                self.row.clear();
                self.row.extend_from_slice(row.values);
                self.is_there = true;
                return Ok(());
            }
        }
    }

    /// Rows from this one to the end.
    fn left(&mut self, is_running: impl Fn(&[f64], &[f64]) -> bool) -> Result<u64, PageError> {
        let mut count = 0;
        while self.is_there {
            count += 1;
            self.next(&is_running)?;
        }
        Ok(count)
    }
}
