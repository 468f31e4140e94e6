//! MATLAB's file, level 5: `load('run.mat')` in MATLAB and Octave, `scipy.io.loadmat` in Python.
//!
//! One column vector per column, doubles but for `sequence` (int64); beside them the structs `units` and `meanings` with
//! a field per column, and `summary`, the text of summary.json (`jsondecode(summary)`). Not compressed. Level 5 and not 7.3,
//! because everything opens it and nothing has to be known beforehand; its limit, 2 GiB in one variable, is 18 hours at
//! 4096 Hz. Layout after "MAT-File Format", The MathWorks.

use std::collections::HashSet;

use super::ExportError;
use super::block::{Columnar, Skeleton, Table};
use super::plan::Source;

/// Types of data elements.
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const INT64: u32 = 12;
const MATRIX: u32 = 14;
const UTF16: u32 = 17;
/// Classes of arrays.
const STRUCT: u32 = 2;
const CHAR: u32 = 4;
const FULL: u32 = 6;
const FULL_INT64: u32 = 14;

/// Bytes of a variable: above, MATLAB does not read it.
const LARGEST: u64 = (1 << 31) - 1;
/// Bytes of a variable beside its values: eight tags and heads and a name, rounded up.
const AROUND: u64 = 256;
/// Letters of a name that MATLAB looks at.
const NAME: usize = 63;

const TEXTS: [&str; 3] = ["units", "meanings", "summary"];

/// Needs nothing at the end.
pub(super) struct Mat;

impl Columnar for Mat {
    fn lay_out(table: &Table<'_>) -> Result<(Self, Skeleton), ExportError> {
        table.at_most((LARGEST - AROUND) / 8, "MATLAB file")?;
        let names = fit(&table.plan.names(&TEXTS));
        let mut head = format!("{:<116}", "MATLAB 5.0 MAT-file, written by Gusset").into_bytes();
        head.extend_from_slice(&[0; 8]);
        head.extend_from_slice(&0x0100_u16.to_le_bytes());
        head.extend_from_slice(b"IM");
        let mut end = head.len() as u64;
        let (mut pieces, mut places) = (vec![(0, head)], Vec::new());
        for (name, exposed) in names.iter().zip(table.columns()) {
            let (class, kind) = match exposed.source {
                Source::Sequence => (FULL_INT64, INT64),
                Source::Place(_) | Source::Nothing => (FULL, DOUBLE),
            };
            let size = 8 * table.rows;
            // Fits: it was compared with the largest.
            let (rows, bytes) = (table.rows as u32, size as u32);
            let mut inner = array_head(class, [rows, 1], name);
            tag(&mut inner, kind, bytes);
            let mut whole = Vec::new();
            tag(&mut whole, MATRIX, inner.len() as u32 + bytes);
            whole.append(&mut inner);
            places.push(end + whole.len() as u64);
            let after = end + whole.len() as u64 + size;
            pieces.push((end, whole));
            end = after;
        }
        let columns = table.columns().iter().map(|exposed| &exposed.column);
        let units: Vec<&str> = columns.clone().map(|c| c.unit.as_str()).collect();
        let meanings: Vec<&str> = columns.map(|c| c.meaning.as_str()).collect();
        let mut last = structure("units", &names, &units);
        last.append(&mut structure("meanings", &names, &meanings));
        last.append(&mut characters("summary", &table.text("summary.json")));
        let length = end + last.len() as u64;
        pieces.push((end, last));
        let skeleton = Skeleton {
            pieces,
            places,
            length,
            checksums: Vec::new(),
        };
        Ok((Self, skeleton))
    }
}

/// Names that MATLAB takes: a letter first, not longer than it reads, none twice.
fn fit(names: &[String]) -> Vec<String> {
    let mut taken = HashSet::new();
    let fit = |name: &String| {
        let letter = name.starts_with(|c: char| c.is_ascii_alphabetic());
        let mut name = if letter {
            name.clone()
        } else {
            format!("c_{name}")
        };
        name.truncate(NAME);
        let mut number = 1;
        while !taken.insert(name.clone()) {
            number += 1;
            let suffix = format!("_{number}");
            name.truncate(NAME - suffix.len());
            name.push_str(&suffix);
        }
        name
    };
    names.iter().map(fit).collect()
}

fn tag(out: &mut Vec<u8>, kind: u32, bytes: u32) {
    out.extend_from_slice(&kind.to_le_bytes());
    out.extend_from_slice(&bytes.to_le_bytes());
}

/// An element of the file: its tag, its bytes, and zeros up to a multiple of eight.
fn element(out: &mut Vec<u8>, kind: u32, bytes: &[u8]) {
    tag(out, kind, bytes.len() as u32);
    out.extend_from_slice(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
}

/// What an array begins with. Everything before it must be a multiple of eight bytes long.
fn array_head(class: u32, dimensions: [u32; 2], name: &str) -> Vec<u8> {
    let mut out = Vec::new();
    tag(&mut out, UINT32, 8);
    tag(&mut out, class, 0);
    tag(&mut out, INT32, 8);
    let [rows, columns] = dimensions;
    tag(&mut out, rows, columns);
    element(&mut out, INT8, name.as_bytes());
    out
}

fn array(inner: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(inner.len() + 8);
    tag(&mut out, MATRIX, inner.len() as u32);
    out.extend_from_slice(inner);
    out
}

fn characters(name: &str, text: &str) -> Vec<u8> {
    // One unit per letter, or readers disagree about the length: what needs two is replaced.
    let unit = |letter: char| u16::try_from(u32::from(letter)).unwrap_or(0xFFFD);
    let units: Vec<u16> = text.chars().map(unit).collect();
    let rows = u32::from(!units.is_empty());
    let mut inner = array_head(CHAR, [rows, units.len() as u32], name);
    let bytes: Vec<u8> = units.into_iter().flat_map(u16::to_le_bytes).collect();
    element(&mut inner, UTF16, &bytes);
    array(&inner)
}

/// A struct of texts.
fn structure(name: &str, fields: &[String], texts: &[&str]) -> Vec<u8> {
    let mut inner = array_head(STRUCT, [1, 1], name);
    // The length of a field's name, in the short form of an element.
    let width = NAME + 1;
    tag(&mut inner, INT32 | 4 << 16, width as u32);
    let mut names = vec![0; width * fields.len()];
    for (slot, field) in names.chunks_exact_mut(width).zip(fields) {
        for (to, from) in slot.iter_mut().zip(field.bytes()) {
            *to = from;
        }
    }
    element(&mut inner, INT8, &names);
    for text in texts {
        inner.append(&mut characters("", text));
    }
    array(&inner)
}
