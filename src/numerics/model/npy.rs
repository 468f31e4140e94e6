//! NumPy's `.npy` format, versions 1 to 3 (NumPy Enhancement Proposal 1): numbers only, little-endian.
//!
//! | offset | size | meaning |
//! |---|---|---|
//! | 0 | 6 | `\x93NUMPY` |
//! | 6 | 2 | version: major, minor |
//! | 8 | 2 (major 1) or 4 | length of the header, little-endian |
//! | 10 or 12 | that length | Python dictionary: `descr`, `fortran_order`, `shape` |
//! | after it | | the numbers |

use thiserror::Error;

use super::table::{LARGEST_SIDE, MatrixTable};

/// Why bytes are not an array that we read.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NpyError {
    /// Does not start as a `.npy` file.
    #[error("not a .npy file: it does not start with \\x93NUMPY")]
    Magic,
    /// A version from the future.
    #[error("version {major} of the .npy format is unknown, expected 1, 2 or 3")]
    Version {
        /// As given.
        major: u8,
    },
    /// Ends too early or too late.
    #[error("holds {found} bytes, but its header claims {expected}")]
    Length {
        /// Bytes claimed.
        expected: usize,
        /// Bytes there.
        found: usize,
    },
    /// A key of the header is missing or not understood.
    #[error("the header says {key} = {found}, expected {expected}")]
    Header {
        /// Key of the dictionary.
        key: &'static str,
        /// Its value as found.
        found: String,
        /// The accepted values.
        expected: &'static str,
    },
    /// An entry that is not finite; row and column count from 1.
    #[error("entry ({row}, {column}) is {found}, but must be finite")]
    NotFinite {
        /// Row.
        row: usize,
        /// Column.
        column: usize,
        /// The value found.
        found: f64,
    },
}

/// Reads a matrix; an array of one axis is a single column.
pub(super) fn parse_npy(bytes: &[u8]) -> Result<MatrixTable, NpyError> {
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or(NpyError::Magic)?;
    let truncated = |expected| NpyError::Length {
        expected,
        found: bytes.len(),
    };
    let (header_at, header_length) = match rest {
        [1, _, a, b, ..] => (10, usize::from(u16::from_le_bytes([*a, *b]))),
        [2 | 3, _, a, b, c, d, ..] => (12, u32::from_le_bytes([*a, *b, *c, *d]) as usize),
        [major, ..] if !(1..=3).contains(major) => {
            return Err(NpyError::Version { major: *major });
        }
        _ => return Err(truncated(12)),
    };
    let data_at = header_at + header_length;
    let header = bytes.get(header_at..data_at).ok_or(truncated(data_at))?;
    let header = String::from_utf8_lossy(header);
    let descr = value_of(&header, "descr");
    let kind = descr.trim_matches(['\'', '"']);
    let (size, read): (usize, fn(&[u8]) -> f64) = match kind {
        "<f8" => (8, |b| f64::from_le_bytes(fixed(b))),
        "<f4" => (4, |b| f64::from(f32::from_le_bytes(fixed(b)))),
        "<i8" => (8, |b| i64::from_le_bytes(fixed(b)) as f64),
        "<i4" => (4, |b| f64::from(i32::from_le_bytes(fixed(b)))),
        _ => {
            return Err(NpyError::Header {
                key: "descr",
                found: descr.to_owned(),
                expected: "'<f8', '<f4', '<i8' or '<i4'",
            });
        }
    };
    let fortran = match value_of(&header, "fortran_order") {
        "True" => true,
        "False" => false,
        found => {
            return Err(NpyError::Header {
                key: "fortran_order",
                found: found.to_owned(),
                expected: "True or False",
            });
        }
    };
    let shape = value_of(&header, "shape");
    let bad_shape = || NpyError::Header {
        key: "shape",
        found: shape.to_owned(),
        expected: "one or two axes of at most 1000000 entries",
    };
    let sides: Option<Vec<usize>> = shape
        .trim_matches(['(', ')'])
        .split(',')
        .map(str::trim)
        .filter(|side| !side.is_empty())
        .map(|side| side.parse().ok().filter(|side| *side <= LARGEST_SIDE))
        .collect();
    let (rows, columns) = match sides.as_deref() {
        Some(&[rows]) => (rows, 1),
        Some(&[rows, columns]) => (rows, columns),
        _ => return Err(bad_shape()),
    };
    let data = &bytes[data_at..];
    // At most 1e12 entries of 8 bytes: no overflow.
    let expected = rows * columns * size;
    if data.len() != expected {
        return Err(truncated(data_at + expected));
    }
    let mut entries = Vec::new();
    for (k, number) in data.chunks_exact(size).enumerate() {
        let (row, column) = if fortran {
            (k % rows, k / rows)
        } else {
            (k / columns, k % columns)
        };
        let value = read(number);
        if !value.is_finite() {
            return Err(NpyError::NotFinite {
                row: row + 1,
                column: column + 1,
                found: value,
            });
        }
        if value != 0.0 {
            entries.push((row, column, value));
        }
    }
    Ok(MatrixTable {
        rows,
        columns,
        entries,
    })
}

/// The first N bytes; `chunks_exact` above hands over exactly N.
fn fixed<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

/// The text after `'key':` up to the comma or brace that ends it; a tuple whole; "nothing" if the key is missing.
fn value_of<'a>(header: &'a str, key: &str) -> &'a str {
    let Some(at) = header
        .find(&format!("'{key}'"))
        .or_else(|| header.find(&format!("\"{key}\"")))
    else {
        return "nothing";
    };
    let after = &header[at + key.len() + 2..];
    let after = after
        .trim_start()
        .strip_prefix(':')
        .unwrap_or("")
        .trim_start();
    let end = if after.starts_with('(') {
        after.find(')').map_or(after.len(), |i| i + 1)
    } else {
        after.find([',', '}']).unwrap_or(after.len())
    };
    after[..end].trim_end()
}
