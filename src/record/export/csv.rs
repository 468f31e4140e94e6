//! The response history as CSV: a header, a comment line with the units, then one line per row.
//!
//! 17 significant digits, so that every double reads back to the same bits; a missing value is empty. The units follow the header
//! as `# units: time s,x1 m,…`. A reader that skips one line and then comments finds numbers, and one that takes names from the
//! first line finds them. [`Extra::units_line`] leaves the line out.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::plan::{Choice, Exposed, Plan, Source, Trouble};
use super::{ExportError, Exported, Extra};
use crate::atomic::AtomicFile;
use crate::journal::Journal;
use crate::run::Run;

/// Writes the columns of a CSV.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let plan = Plan::new(run.layout(), &extra.sums)?;
    let mut sheet = Sheet::of(plan.csv_columns());
    if extra.units_line {
        sheet = sheet.with_units(plan.csv_columns());
    }
    let failed = ExportError::write(out);
    let mut journal = run.journal()?;
    let mut file = BufWriter::with_capacity(1 << 17, AtomicFile::create(out).map_err(failed)?);
    let rows = write(&plan, &sheet, &mut journal, choice, &mut file)
        .map_err(|trouble| trouble.told(failed))?;
    let file = file
        .into_inner()
        .map_err(|error| failed(error.into_error()))?;
    file.commit().map_err(failed)?;
    Ok(Exported::new(run, rows, &journal).of_table(&plan))
}

pub(super) fn write(
    plan: &Plan,
    sheet: &Sheet,
    journal: &mut Journal<impl io::Read>,
    choice: &Choice,
    out: &mut impl Write,
) -> Result<u64, Trouble> {
    let mut line = Vec::with_capacity(26 * sheet.sources.len());
    sheet.head(out).map_err(Trouble::Write)?;
    plan.walk(journal, choice, u64::MAX, |_, row| {
        sheet.line(row, &mut line)?;
        out.write_all(&line)
    })
}

/// Header of a CSV and the sources of its columns.
pub(super) struct Sheet {
    header: String,
    /// One per column of the CSV.
    sources: Vec<Source>,
}

impl Sheet {
    pub(crate) fn of<'a>(columns: impl IntoIterator<Item = &'a Exposed>) -> Self {
        let (mut header, mut sources) = (String::new(), Vec::new());
        for exposed in columns {
            header.push_str(&exposed.column.name);
            header.push(',');
            sources.push(exposed.source.clone());
        }
        header.pop();
        header.push('\n');
        Self { header, sources }
    }

    /// Adds a comment line with name and unit of each of these columns.
    pub(crate) fn with_units<'a>(mut self, columns: impl IntoIterator<Item = &'a Exposed>) -> Self {
        let each = columns.into_iter().map(|Exposed { column, .. }| {
            // A line break or comma of a foreign description would be another line or column.
            let unit = column.unit.replace([',', '\n', '\r'], " ");
            format!("{} {unit}", column.name)
        });
        let each: Vec<String> = each.collect();
        self.header
            .push_str(&format!("# units: {}\n", each.join(",")));
        self
    }

    /// Writes the line of names, and that of units.
    pub(crate) fn head(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(self.header.as_bytes())
    }

    /// The line of a row, without allocating once `line` has its size.
    pub(crate) fn line(&self, row: &[f64], line: &mut Vec<u8>) -> io::Result<()> {
        line.clear();
        for source in &self.sources {
            let value = source.value(row);
            if !value.is_nan() {
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

    #[cfg(test)]
    pub(crate) fn width(&self) -> usize {
        self.sources.len()
    }
}
