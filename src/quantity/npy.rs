//! NumPy's `.npy` format, versions 1 to 3 (NumPy Enhancement Proposal 1): real numbers of one or two axes.
//!
//! | offset | size | meaning |
//! |---|---|---|
//! | 0 | 6 | `\x93NUMPY` |
//! | 6 | 2 | version: major, minor |
//! | 8 | 2 (major 1) or 4 | length of the header, little-endian |
//! | 10 or 12 | that length | Python dictionary: `descr`, `fortran_order`, `shape` |
//! | after it | | the numbers, by rows unless `fortran_order` |

use thiserror::Error;

/// First bytes of every such file.
pub const MAGIC: &[u8] = b"\x93NUMPY";

const KINDS: &str = "'<f8', '>f8', '<f4', '>f4', '<i8' or '<i4'";

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
}

/// An array as its header claims it; no claim has been checked against the bytes that follow.
#[derive(Debug)]
pub struct Array<'a> {
    /// Rows.
    pub rows: usize,
    /// Columns; 1 of an array of one axis.
    pub columns: usize,
    /// Bytes of a number.
    pub size: usize,
    by_columns: bool,
    read: fn(&[u8]) -> f64,
    bytes: &'a [u8],
    data_at: usize,
}

impl<'a> Array<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// All of [`NpyError`].
    pub fn open(bytes: &'a [u8]) -> Result<Self, NpyError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(NpyError::Magic)?;
        let cut = |expected| NpyError::Length {
            expected,
            found: bytes.len(),
        };
        let (header_at, length) = match rest {
            [1, _, a, b, ..] => (10, usize::from(u16::from_le_bytes([*a, *b]))),
            [2 | 3, _, a, b, c, d, ..] => (12, u32::from_le_bytes([*a, *b, *c, *d]) as usize),
            [major, ..] if !(1..=3).contains(major) => {
                return Err(NpyError::Version { major: *major });
            }
            _ => return Err(cut(12)),
        };
        let data_at = header_at + length;
        let header = bytes.get(header_at..data_at).ok_or(cut(data_at))?;
        let header = String::from_utf8_lossy(header);
        let refuse = |key, expected| NpyError::Header {
            key,
            found: value_of(&header, key).to_owned(),
            expected,
        };
        let kind = value_of(&header, "descr").trim_matches(['\'', '"']);
        let (size, read): (usize, fn(&[u8]) -> f64) = match kind {
            "<f8" => (8, |b| f64::from_le_bytes(fixed(b))),
            ">f8" => (8, |b| f64::from_be_bytes(fixed(b))),
            "<f4" => (4, |b| f64::from(f32::from_le_bytes(fixed(b)))),
            ">f4" => (4, |b| f64::from(f32::from_be_bytes(fixed(b)))),
            "<i8" => (8, |b| i64::from_le_bytes(fixed(b)) as f64),
            "<i4" => (4, |b| f64::from(i32::from_le_bytes(fixed(b)))),
            _ => return Err(refuse("descr", KINDS)),
        };
        let by_columns = match value_of(&header, "fortran_order") {
            "True" => true,
            "False" => false,
            _ => return Err(refuse("fortran_order", "True or False")),
        };
        let sides: Option<Vec<usize>> = value_of(&header, "shape")
            .trim_matches(['(', ')'])
            .split(',')
            .map(str::trim)
            .filter(|side| !side.is_empty())
            .map(|side| side.parse().ok())
            .collect();
        let (rows, columns) = match sides.as_deref() {
            Some(&[rows]) => (rows, 1),
            Some(&[rows, columns]) => (rows, columns),
            _ => return Err(refuse("shape", "one or two axes")),
        };
        Ok(Self {
            rows,
            columns,
            size,
            by_columns,
            read,
            bytes,
            data_at,
        })
    }

    /// The numbers in the order of the file, each with its row and column.
    ///
    /// # Errors
    /// [`NpyError::Length`].
    pub fn entries(&self) -> Result<impl Iterator<Item = (usize, usize, f64)>, NpyError> {
        let (rows, columns, by_columns) = (self.rows, self.columns, self.by_columns);
        let claimed = rows.saturating_mul(columns).saturating_mul(self.size);
        let data = &self.bytes[self.data_at..];
        if data.len() != claimed {
            return Err(NpyError::Length {
                expected: claimed.saturating_add(self.data_at),
                found: self.bytes.len(),
            });
        }
        let numbers = data.chunks_exact(self.size).map(self.read).enumerate();
        Ok(numbers.map(move |(k, value)| {
            if by_columns {
                (k % rows, k / rows, value)
            } else {
                (k / columns, k % columns, value)
            }
        }))
    }
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
