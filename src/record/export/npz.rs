//! NumPy's archive: `d = numpy.load("run.npz")`, then `d["x1"]`. No pickle, nothing compressed.
//!
//! One array per column, doubles but for `sequence`; beside them the arrays of text `columns`, `units` and `meanings`, in
//! the order of the columns, and `summary`, the text of summary.json. Layout after NumPy's format version 1.0.

use crc32fast::Hasher;

use super::ExportError;
use super::block::{Columnar, Piece, Skeleton, Table};
use super::plan::Source;
use super::zip::Archive;

const TEXTS: [&str; 4] = ["columns", "units", "meanings", "summary"];

/// The archive, whose first entries are the columns.
pub(super) struct Npz(Archive);

impl Columnar for Npz {
    fn lay_out(table: &Table<'_>) -> Result<(Self, Skeleton), ExportError> {
        let mut archive = Archive::default();
        let (mut pieces, mut places, mut checksums) = (Vec::new(), Vec::new(), Vec::new());
        let names = table.plan.names(&TEXTS);
        for (name, exposed) in names.iter().zip(table.columns()) {
            let kind = match exposed.source {
                Source::Sequence => "<i8",
                Source::Place(_) | Source::Nothing => "<f8",
            };
            let head = header(kind, &format!("({},)", table.rows));
            let mut sum = Hasher::new();
            sum.update(&head);
            checksums.push(sum);
            let size = head.len() as u64 + 8 * table.rows;
            let (local, place) = archive.add(&format!("{name}.npy"), size, 0);
            places.push(place + head.len() as u64);
            pieces.extend([local, (place, head)]);
        }
        let mut text = |name: &str, bytes: Vec<u8>| {
            let sum = crc32fast::hash(&bytes);
            let (local, place) = archive.add(&format!("{name}.npy"), bytes.len() as u64, sum);
            pieces.extend([local, (place, bytes)]);
        };
        let columns = table.columns().iter().map(|exposed| &exposed.column);
        let units: Vec<&str> = columns.clone().map(|c| c.unit.as_str()).collect();
        let meanings: Vec<&str> = columns.map(|c| c.meaning.as_str()).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let listed = format!("({},)", names.len());
        let [of_names, of_units, of_meanings, of_summary] = TEXTS;
        text(of_names, array(&names, &listed));
        text(of_units, array(&units, &listed));
        text(of_meanings, array(&meanings, &listed));
        text(of_summary, array(&[&table.text("summary.json")], "()"));
        let (end, directory) = archive.directory();
        let skeleton = Skeleton {
            pieces,
            places,
            length: end + directory,
            checksums,
        };
        Ok((Self(archive), skeleton))
    }

    fn close(mut self, checksums: &[u32]) -> Vec<Piece> {
        let mut pieces: Vec<Piece> = (0..)
            .zip(checksums)
            .filter_map(|(index, sum)| self.0.amend(index, *sum))
            .collect();
        let (end, _) = self.0.directory();
        pieces.push((end, self.0.closing()));
        pieces
    }
}

/// What stands before the values of an array.
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
fn array(texts: &[&str], shape: &str) -> Vec<u8> {
    let width = texts.iter().map(|text| text.chars().count()).max();
    let width = width.unwrap_or(0).max(1);
    let mut out = header(&format!("<U{width}"), shape);
    for text in texts {
        let padded = text.chars().map(u32::from).chain(std::iter::repeat(0));
        out.extend(padded.take(width).flat_map(u32::to_le_bytes));
    }
    out
}
