//! NumPy's archive: `d = numpy.load("run.npz")`, then `d["x1"]`. No pickle, nothing compressed.
//!
//! One array per column, doubles but for `sequence`; beside them the arrays of text `columns`, `units` and `meanings`, in
//! the order of the columns, and `summary`, the text of summary.json. Layout of an array after NumPy's format version 1.0;
//! the archive is the `zip` crate's. The same run gives the same bytes.

use std::io::{self, Seek, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::columns::Columns;
use super::plan::{Choice, Source};
use super::{ExportError, Exported, Extra};
use crate::atomic::AtomicFile;
use crate::run::Run;

const TEXTS: [&str; 4] = ["columns", "units", "meanings", "summary"];

/// Writes all columns.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let (mut columns, exported) = Columns::new(run, choice, &extra.sums)?;
    let mut archive = ZipWriter::new(AtomicFile::create(out).map_err(failed)?);
    let names = columns.plan.names(&TEXTS);
    let shape = format!("({},)", columns.rows);
    for (index, name) in names.iter().enumerate() {
        let source = columns.plan.columns.get(index).map(|c| &c.source);
        let kind = match source {
            Some(Source::Sequence) => "<i8",
            _ => "<f8",
        };
        let values = columns.take(index)?;
        entry(&mut archive, name, &header(kind, &shape), &values).map_err(failed)?;
    }
    let described = columns.plan.columns.iter().map(|c| &c.column);
    let units: Vec<&str> = described.clone().map(|c| c.unit.as_str()).collect();
    let meanings: Vec<&str> = described.map(|c| c.meaning.as_str()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let summary = columns.text("summary.json");
    let listed = format!("({},)", names.len());
    let [of_names, of_units, of_meanings, of_summary] = TEXTS;
    for (name, texts, shape) in [
        (of_names, names.as_slice(), listed.as_str()),
        (of_units, &units, &listed),
        (of_meanings, &meanings, &listed),
        (of_summary, &[summary.as_str()], "()"),
    ] {
        let (head, letters) = array(texts, shape);
        entry(&mut archive, name, &head, &letters).map_err(failed)?;
    }
    let file = archive.finish().map_err(|error| failed(error.into()))?;
    file.commit().map_err(failed)?;
    Ok(exported)
}

/// Adds an array to the archive.
fn entry(
    archive: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    head: &[u8],
    values: &[u8],
) -> io::Result<()> {
    let size = (head.len() + values.len()) as u64;
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        // From 4 GiB on its sizes need fields of 64 bits.
        .large_file(size >= u64::from(u32::MAX));
    archive.start_file(format!("{name}.npy"), options)?;
    archive.write_all(head)?;
    archive.write_all(values)
}

/// Header before the values of an array.
fn header(kind: &str, shape: &str) -> Vec<u8> {
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    // Magic, version and length are ten bytes, the line feed one; all together a multiple of 64.
    while (text.len() + 11) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    // A shape and a type are far shorter than 65,535 characters.
    out.extend_from_slice(&(text.len() as u16).to_le_bytes());
    out.extend_from_slice(text.as_bytes());
    out
}

/// An array of text: every character four bytes, every text as long as the longest.
fn array(texts: &[&str], shape: &str) -> (Vec<u8>, Vec<u8>) {
    let width = texts.iter().map(|text| text.chars().count()).max();
    let width = width.unwrap_or(0).max(1);
    let mut letters = Vec::new();
    for text in texts {
        let padded = text.chars().map(u32::from).chain(std::iter::repeat(0));
        letters.extend(padded.take(width).flat_map(u32::to_le_bytes));
    }
    (header(&format!("<U{width}"), shape), letters)
}
