//! MATLAB's file, level 5: `load('run.mat')` in MATLAB and Octave, `scipy.io.loadmat` in Python, `R.matlab` in R.
//!
//! One column vector per column, doubles but for `sequence` (int64); beside them the structs `units` and `meanings` with
//! a field per column, `summary`, the text of summary.json (`jsondecode(summary)`), and the struct `metadata`. Not compressed.
//! A character beyond U+FFFF becomes U+FFFD, because SciPy does not read a file with a surrogate pair. Layout after MathWorks,
//! "MAT-File Format", chapter 1. A file of this level has at most 2 GB: a longer one is of level 7.3, with the same variables.

use std::io::Write as _;
use std::path::Path;

use super::columns::Columns;
use super::mat_content::{Content, LONGEST_NAME};
use super::plan::{Choice, Source};
use super::{ExportError, Exported, Extra};
use crate::atomic::AtomicFile;
use crate::run::Run;

/// Most bytes of a file: readers count them as `int32`.
const MOST: u64 = i32::MAX as u64;

/// Types of the bytes of an element.
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const INT64: u32 = 12;
const MATRIX: u32 = 14;
const UTF16: u32 = 17;

/// Classes of an array.
const STRUCT: u32 = 2;
const CHAR: u32 = 4;
const OF_DOUBLES: u32 = 6;
const OF_INT64: u32 = 14;

/// Writes all columns.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let (mut columns, exported) = Columns::new(run, choice, &extra.sums)?;
    let content = Content::of(&columns);
    let mut texts = Vec::new();
    for (name, fields) in &content.structs {
        structure(name, fields, &mut texts);
    }
    text("summary", &content.summary, &mut texts);
    let Some(rows) = rows_that_fit(columns.rows, content.names.len(), texts.len()) else {
        return longer(columns, content, exported, out);
    };

    let mut file = AtomicFile::create(out).map_err(failed)?;
    let mut head = format!(
        "MATLAB 5.0 MAT-file, written by Gusset {}",
        env!("CARGO_PKG_VERSION")
    );
    head.extend(std::iter::repeat_n(' ', 124 - head.len()));
    // Version 1 of the layout, then the mark of the byte order.
    let head = [head.as_bytes(), b"\x00\x01IM"].concat();
    file.write_all(&head).map_err(failed)?;
    for (index, name) in content.names.iter().enumerate() {
        let source = columns.plan.columns.get(index).map(|c| &c.source);
        let (class, kind) = match source {
            Some(Source::Sequence) => (OF_INT64, INT64),
            _ => (OF_DOUBLES, DOUBLE),
        };
        let mut array = Vec::new();
        begin(class, [rows, 1], name, &mut array);
        array.extend(tag(kind, 8 * rows));
        let size = array.len() as u32 + 8 * rows;
        let values = columns.take(index)?;
        for part in [&tag(MATRIX, size)[..], &array, &values] {
            file.write_all(part).map_err(failed)?;
        }
    }
    file.write_all(&texts).map_err(failed)?;
    file.commit().map_err(failed)?;
    Ok(exported.written_as("MATLAB level 5"))
}

#[cfg(feature = "hdf5")]
use super::mat73::write as longer;

#[cfg(not(feature = "hdf5"))]
fn longer(_: Columns, _: Content, _: Exported, _: &Path) -> Result<Exported, ExportError> {
    Err(super::without("a .mat of more than 2 GB", "hdf5"))
}

/// Rows of such a file if it may be of level 5.
pub(super) fn rows_that_fit(rows: u64, columns: usize, texts: usize) -> Option<u32> {
    // The tags and the name of a column take less than 128 bytes, as does the head.
    let column = rows.checked_mul(8)?.checked_add(128)?;
    let size = column
        .checked_mul(columns as u64)?
        .checked_add(128 + texts as u64)?;
    (size <= MOST).then(|| u32::try_from(rows).ok()).flatten()
}

/// Type and size of what follows.
fn tag(kind: u32, bytes: u32) -> [u8; 8] {
    let (mut tag, parts) = ([0; 8], [kind.to_le_bytes(), bytes.to_le_bytes()]);
    tag.copy_from_slice(parts.as_flattened());
    tag
}

/// Adds a short element, filled up to a multiple of eight bytes.
fn element(kind: u32, bytes: &[u8], out: &mut Vec<u8>) {
    out.extend(tag(kind, bytes.len() as u32));
    out.extend_from_slice(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
}

/// Adds the parts of an array before its values.
fn begin(class: u32, size: [u32; 2], name: &str, out: &mut Vec<u8>) {
    element(UINT32, [class, 0].map(u32::to_le_bytes).as_flattened(), out);
    element(INT32, size.map(u32::to_le_bytes).as_flattened(), out);
    element(INT8, name.as_bytes(), out);
}

/// Adds a row of characters. Octave cuts a text in UTF-8 off where a letter has several bytes.
fn text(name: &str, text: &str, out: &mut Vec<u8>) {
    let mut array = Vec::new();
    let letter = |c: char| u16::try_from(c).unwrap_or(0xfffd).to_le_bytes();
    let letters: Vec<_> = text.chars().map(letter).collect();
    let length = letters.len() as u32;
    begin(CHAR, [length.min(1), length], name, &mut array);
    element(UTF16, letters.as_flattened(), &mut array);
    element(MATRIX, &array, out);
}

/// Adds a struct of texts.
fn structure(name: &str, fields: &[(String, String)], out: &mut Vec<u8>) {
    let mut array = Vec::new();
    begin(STRUCT, [1, 1], name, &mut array);
    // Bytes of each field name with the zero behind it, as an element whose tag and value are eight bytes.
    let width = LONGEST_NAME + 1;
    array.extend(tag((4 << 16) | INT32, width as u32));
    let mut names = Vec::new();
    for (index, (field, _)) in fields.iter().enumerate() {
        names.extend_from_slice(field.as_bytes());
        names.resize((index + 1) * width, 0);
    }
    element(INT8, &names, &mut array);
    for (_, value) in fields {
        text("", value, &mut array);
    }
    element(MATRIX, &array, out);
}
