//! The layout of `samples.bin`, as `samples.json` describes it.
//!
//! A record, little-endian, of `stride = 16 + 8 n` bytes for n columns:
//!
//! | offset | size | type | meaning |
//! |---|---|---|---|
//! | 0 | 8 | u64 | sequence number of the row, counted by the loop from 0; a gap is rows that were lost |
//! | 8 | 8 n | f64 | the columns, in the order of `samples.json` |
//! | 8 + 8 n | 4 | u32 | CRC-32 (IEEE 802.3, as zlib's) of all bytes before it |
//! | 12 + 8 n | 4 | u32 | the marker 0x0A574F52, the bytes `ROW\n` |
//!
//! The file has no header and no footer, so it maps as a plain array of records.

use std::collections::HashSet;

use gusset_quantity::catalog::column;
use serde::{Deserialize, Serialize};
use serde_json::json;
use thiserror::Error;

use super::Column;

/// Last four bytes of every record.
pub(crate) const MARKER: [u8; 4] = *b"ROW\n";
/// Bytes of a record before the columns: the sequence number.
pub const HEAD: usize = 8;
/// Bytes of a record after the columns: checksum and marker.
pub const TAIL: usize = 8;

/// The column that only a server's record has.
pub const COMMITS: &str = column::COMMITS.name();

const FORMAT: &str = "gusset-samples";
const VERSION: u32 = 1;
/// Names that the fields of the record itself have.
const RESERVED: [&str; 3] = ["sequence", "crc32", "marker"];

/// Why a list of columns cannot be a layout, or a `samples.json` cannot be read.
#[derive(Debug, Error)]
pub enum LayoutError {
    /// Without columns.
    #[error("a row must have at least one column")]
    Empty,
    /// A name that is empty, reserved, or contains what a header line or a script could not take.
    #[error(
        "column {index} has the name {name:?}; a name is letters, digits and underscores and not one of sequence, crc32, marker"
    )]
    Name {
        /// Column, from 0.
        index: usize,
        /// Its name.
        name: String,
    },
    /// Two columns of one name.
    #[error("column {index} repeats the name {name:?}")]
    Repeated {
        /// Column, from 0.
        index: usize,
        /// Its name.
        name: String,
    },
    /// Not the JSON of a layout.
    #[error("not a description of samples: {0}")]
    Json(#[from] serde_json::Error),
    /// Another format or a later version.
    #[error(
        "format is {format:?} version {version}, this program reads {FORMAT:?} version {VERSION}"
    )]
    Version {
        /// Format named in the file.
        format: String,
        /// Version named in the file.
        version: u32,
    },
    /// The stride does not follow from the number of columns.
    #[error("stride is {found} bytes, {columns} columns need {expected}")]
    Stride {
        /// Number of columns.
        columns: usize,
        /// Bytes that they need.
        expected: usize,
        /// Bytes that the file states.
        found: usize,
    },
    /// A column with an offset other than that of the layout, or bytes in another order.
    #[error("column {name:?} is at offset {found}, the layout puts it at {expected}")]
    Offset {
        /// Column.
        name: String,
        /// The correct offset.
        expected: usize,
        /// Where the file says it is.
        found: usize,
    },
    /// A byte order other than little-endian.
    #[error("byte order is {0:?}, wanted \"little\"")]
    ByteOrder(String),
}

/// The columns of a run and their places in a record. A `Layout` that exists is valid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    columns: Vec<Column>,
}

impl Layout {
    /// A layout of these columns, in this order.
    ///
    /// # Errors
    /// [`LayoutError`] if there is no column, or a name is unfit or repeated.
    pub fn new(columns: Vec<Column>) -> Result<Self, LayoutError> {
        if columns.is_empty() {
            return Err(LayoutError::Empty);
        }
        let mut seen = HashSet::new();
        for (index, column) in columns.iter().enumerate() {
            let name = column.name.as_str();
            let fit = |c: char| c.is_ascii_alphanumeric() || c == '_';
            if name.is_empty() || !name.chars().all(fit) || RESERVED.contains(&name) {
                return Err(LayoutError::Name {
                    index,
                    name: name.to_owned(),
                });
            }
            if !seen.insert(name) {
                return Err(LayoutError::Repeated {
                    index,
                    name: name.to_owned(),
                });
            }
        }
        Ok(Self { columns })
    }

    /// The columns in order.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Bytes per record.
    #[must_use]
    pub fn stride(&self) -> usize {
        stride(self.columns.len())
    }

    /// Place of the column of this name in a row, from 0.
    #[must_use]
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }

    /// True of a server's record of a controller's test: exchanges and no steps.
    #[must_use]
    pub fn is_served(&self) -> bool {
        self.index_of(COMMITS).is_some()
    }

    /// The text of `samples.json`, with the lines that open the file in NumPy and MATLAB.
    #[must_use]
    pub fn to_json(&self) -> String {
        let count = self.columns.len();
        let stride = self.stride();
        let names = self.columns.iter().map(|column| column.name.as_str());
        let names = ["sequence"]
            .into_iter()
            .chain(names)
            .chain(["crc32", "marker"]);
        let formats = ["<u8"].into_iter().chain((0..count).map(|_| "<f8"));
        let offsets = (0..=count + 1).map(|k| 8 * k).chain([12 + 8 * count]);
        let columns = self.columns.iter().enumerate();
        let columns = columns.map(|(index, column)| Placed {
            column: column.clone(),
            offset: HEAD + 8 * index,
        });
        let field = |name: &str, offset: usize, kind: &str, count: usize, meaning: &str| json!({ "name": name, "offset": offset, "type": kind, "count": count, "meaning": meaning });
        let crc32 = HEAD + 8 * count;
        let described = json!({
            "format": FORMAT,
            "version": VERSION,
            "file": "samples.bin",
            "byte_order": "little",
            "stride": stride,
            "record": [
                field("sequence", 0, "u64", 1, "number of the row, counted from 0; a gap is rows that were lost"),
                field("columns", HEAD, "f64", count, "the columns below, in their order"),
                field("crc32", crc32, "u32", 1, "CRC-32 (IEEE 802.3, zlib) of all bytes of the record before it"),
                field("marker", crc32 + 4, "u32", 1, "0x0A574F52, the bytes ROW and a line feed"),
            ],
            "columns": columns.collect::<Vec<_>>(),
            "numpy_dtype": {
                "names": names.collect::<Vec<_>>(),
                "formats": formats.chain(["<u4", "<u4"]).collect::<Vec<_>>(),
                "offsets": offsets.collect::<Vec<_>>(),
                "itemsize": stride,
            },
            "numpy": format!(
                "import json, os, numpy as np; d = json.load(open('samples.json')); \
                 s = np.memmap('samples.bin', np.dtype(d['numpy_dtype']), 'r', \
                 shape=(os.path.getsize('samples.bin') // {stride},)); s['time']"
            ),
            "matlab": format!(
                "f = dir('samples.bin'); m = memmapfile('samples.bin', 'Format', \
                 {{'uint64', [1 1], 'sequence'; 'double', [{count} 1], 'columns'; \
                 'uint32', [1 1], 'crc32'; 'uint32', [1 1], 'marker'}}, \
                 'Repeat', floor(f.bytes / {stride})); s = [m.Data.columns]'; % one row per record, columns as in samples.json"
            ),
        });
        format!("{described:#}\n")
    }

    /// Reads the text of a `samples.json`.
    ///
    /// # Errors
    /// [`LayoutError`] that names the mismatch.
    pub(crate) fn from_json(text: &str) -> Result<Self, LayoutError> {
        let described: Described = serde_json::from_str(text)?;
        if described.format != FORMAT || described.version != VERSION {
            return Err(LayoutError::Version {
                format: described.format,
                version: described.version,
            });
        }
        if described.byte_order != "little" {
            return Err(LayoutError::ByteOrder(described.byte_order));
        }
        let count = described.columns.len();
        if described.stride != stride(count) {
            return Err(LayoutError::Stride {
                columns: count,
                expected: stride(count),
                found: described.stride,
            });
        }
        for (index, placed) in described.columns.iter().enumerate() {
            let expected = HEAD + 8 * index;
            if placed.offset != expected {
                return Err(LayoutError::Offset {
                    name: placed.column.name.clone(),
                    expected,
                    found: placed.offset,
                });
            }
        }
        let columns = described.columns.into_iter();
        Self::new(columns.map(|placed| placed.column).collect())
    }
}

/// Bytes per record of `columns` columns.
#[must_use]
pub(crate) const fn stride(columns: usize) -> usize {
    HEAD + 8 * columns + TAIL
}

/// The parts of a description that reading the rows needs.
#[derive(Deserialize)]
struct Described {
    format: String,
    version: u32,
    byte_order: String,
    stride: usize,
    columns: Vec<Placed>,
}

#[derive(Serialize, Deserialize)]
struct Placed {
    #[serde(flatten)]
    column: Column,
    offset: usize,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn named(names: &[&str]) -> Layout {
        let columns = names.iter().map(|name| Column {
            name: (*name).to_owned(),
            unit: "m".to_owned(),
            meaning: "a \"quoted\" meaning with µ".to_owned(),
            timing: name.starts_with("t_"),
        });
        Layout::new(columns.collect()).unwrap()
    }

    #[test]
    fn description_reads_back_as_its_layout() {
        let layout = named(&["step", "time", "x1", "t_wake"]);
        assert_eq!(Layout::from_json(&layout.to_json()).unwrap(), layout);
        let json: serde_json::Value = serde_json::from_str(&layout.to_json()).unwrap();
        assert_eq!(json["stride"], 48);
        assert_eq!(json["columns"][2]["offset"], 24);
        assert_eq!(json["columns"][3]["timing"], true);
        assert_eq!(json["numpy_dtype"]["itemsize"], 48);
        assert_eq!(
            json["numpy_dtype"]["offsets"],
            serde_json::json!([0, 8, 16, 24, 32, 40, 44])
        );
        for list in ["names", "formats"] {
            assert_eq!(json["numpy_dtype"][list].as_array().unwrap().len(), 7);
        }
    }

    #[test]
    fn unfit_names_are_refused() {
        let column = |name: &str| Column {
            name: name.to_owned(),
            unit: String::new(),
            meaning: String::new(),
            timing: false,
        };
        let refused =
            |names: &[&str]| Layout::new(names.iter().map(|n| column(n)).collect()).is_err();
        assert!(refused(&[]));
        for name in ["", "crc32", "sequence", "a,b", "a b", "ü", "a\n"] {
            assert!(refused(&["x1", name]), "{name:?}");
        }
        assert!(refused(&["x1", "v1", "x1"]));
        assert!(!refused(&["x1", "v1"]));
    }

    #[test]
    fn foreign_description_is_refused() {
        let good = named(&["time", "x1"]).to_json();
        for (from, to) in [
            ("\"version\": 1", "\"version\": 2"),
            ("\"stride\": 32", "\"stride\": 40"),
            ("\"little\"", "\"big\""),
            ("gusset-samples", "other"),
            (
                "\"timing\": false,\n      \"offset\": 16",
                "\"timing\": false,\n      \"offset\": 24",
            ),
        ] {
            assert!(good.contains(from), "{from}");
            assert!(Layout::from_json(&good.replace(from, to)).is_err(), "{to}");
        }
        for cut in 0..good.len() - 2 {
            assert!(Layout::from_json(good.get(..cut).unwrap_or("")).is_err());
        }
    }
}
