//! Matrices from the bytes of a file: `.csv`, `.npy` and Matrix Market `.mtx`. No file is opened here.
//!
//! Only non-zero entries are kept, so that a sparse model of ten thousand degrees of freedom stays small. Sizes that a
//! header claims are bounded before they are used.

use gusset_quantity::npy::{Array, NpyError};
use thiserror::Error;

use super::table::{LARGEST_SIDE, MatrixTable};

/// Why bytes are not a matrix.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{file}{place}: {fault}")]
pub struct ParseError {
    /// Name of the file.
    pub file: String,
    /// Line and field, if the fault is in one of them.
    pub place: String,
    /// Fault of the file.
    pub fault: ParseFault,
}

/// Fault of a file with a matrix. Lines, rows and columns count from 1.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ParseFault {
    /// An extension that names no known format.
    #[error("unknown matrix format, expected .csv, .npy or .mtx")]
    Extension,
    /// Text that is not UTF-8; holds the position of the first bad byte, from 0.
    #[error("not text: byte {0} is not UTF-8")]
    NotText(usize),
    /// The file has no numbers.
    #[error("holds no numbers")]
    Empty,
    /// A field that is not a finite number.
    #[error("\"{0}\" is not a finite number")]
    Number(String),
    /// An entry of a `.npy` file that is not finite.
    #[error("entry ({row}, {column}) is {found}, but must be finite")]
    NotFinite {
        /// Row.
        row: usize,
        /// Column.
        column: usize,
        /// The value found.
        found: f64,
    },
    /// A line with another number of fields than needed.
    #[error("found {found} numbers, expected {expected}")]
    Fields {
        /// Numbers wanted.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// A header that is not understood.
    #[error("found \"{found}\", expected {expected}")]
    Header {
        /// The value found.
        found: String,
        /// The accepted values.
        expected: &'static str,
    },
    /// A claimed size beyond the limit.
    #[error("claims {rows} rows and {columns} columns, the limit is {LARGEST_SIDE} each")]
    TooLarge {
        /// Rows claimed.
        rows: usize,
        /// Columns claimed.
        columns: usize,
    },
    /// An index beyond the size that the header claims.
    #[error("entry ({row}, {column}) lies outside of the {rows} by {columns} matrix{}", if *upper { " or above the diagonal of a symmetric one" } else { "" })]
    Outside {
        /// Row as given.
        row: usize,
        /// Column as given.
        column: usize,
        /// Rows claimed.
        rows: usize,
        /// Columns claimed.
        columns: usize,
        /// True if the file is symmetric, so that only the lower triangle is allowed.
        upper: bool,
    },
    /// Fewer or more entries than the header claims.
    #[error("holds {found} entries, but its header claims {expected}")]
    Count {
        /// Claimed.
        expected: usize,
        /// Found.
        found: usize,
    },
    /// A `.npy` file that is not understood.
    #[error(transparent)]
    Npy(#[from] NpyError),
}

/// A matrix, or its fault and the place of it.
type Parsed<T> = Result<T, (String, ParseFault)>;

/// A fault that belongs to no line.
fn whole(fault: impl Into<ParseFault>) -> (String, ParseFault) {
    (String::new(), fault.into())
}

fn in_line(line: usize, fault: ParseFault) -> (String, ParseFault) {
    (format!(", line {line}"), fault)
}

fn in_field(line: usize, field: usize, found: &str) -> (String, ParseFault) {
    let fault = ParseFault::Number(found.to_owned());
    (format!(", line {line}, field {field}"), fault)
}

/// Reads a matrix from the bytes of the file `name`, whose extension gives the format.
///
/// `.csv`: one row per line; comma, semicolon, tab or blanks between numbers; lines that are empty or start with `#` or
/// `%` are skipped. `.npy`: versions 1 to 3, little-endian f8, f4, i8, i4, both orders, one or two axes. `.mtx`:
/// coordinate or array, real or integer, general or symmetric.
///
/// # Errors
/// See [`ParseError`].
pub fn parse_matrix(name: &str, bytes: &[u8]) -> Result<MatrixTable, ParseError> {
    let extension = name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase());
    let parsed = match extension.as_deref() {
        Some("csv") => text(bytes).and_then(parse_csv),
        Some("mtx") => text(bytes).and_then(parse_market),
        Some("npy") => parse_npy(bytes).map_err(whole),
        _ => Err(whole(ParseFault::Extension)),
    };
    parsed.map_err(|(place, fault)| ParseError {
        file: name.to_owned(),
        place,
        fault,
    })
}

fn text(bytes: &[u8]) -> Parsed<&str> {
    let text = std::str::from_utf8(bytes)
        .map_err(|error| whole(ParseFault::NotText(error.valid_up_to())))?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// An array of one axis is a single column.
fn parse_npy(bytes: &[u8]) -> Result<MatrixTable, ParseFault> {
    let array = Array::open(bytes)?;
    let (rows, columns) = (array.rows, array.columns);
    check_sides(rows, columns)?;
    let mut entries = Vec::new();
    for (row, column, value) in array.entries()? {
        if !value.is_finite() {
            return Err(ParseFault::NotFinite {
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

fn check_sides(rows: usize, columns: usize) -> Result<(), ParseFault> {
    if rows > LARGEST_SIDE || columns > LARGEST_SIDE {
        return Err(ParseFault::TooLarge { rows, columns });
    }
    Ok(())
}

/// Lines that hold something, with their number from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with(['#', '%']))
}

fn number(line: usize, field: usize, found: &str) -> Parsed<f64> {
    match found.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(in_field(line, field, found)),
    }
}

fn parse_csv(text: &str) -> Parsed<MatrixTable> {
    let mut table = MatrixTable {
        rows: 0,
        columns: 0,
        entries: Vec::new(),
    };
    for (line, content) in lines(text) {
        // A separator at the end of a line is common in exports and means nothing.
        let content = content.trim_end_matches([',', ';']);
        let fields: Vec<&str> = if content.contains([',', ';']) {
            content.split([',', ';']).map(str::trim).collect()
        } else {
            content.split_whitespace().collect()
        };
        if table.rows == 0 {
            table.columns = fields.len();
        } else if fields.len() != table.columns {
            let (expected, found) = (table.columns, fields.len());
            return Err(in_line(line, ParseFault::Fields { expected, found }));
        }
        for (column, field) in fields.into_iter().enumerate() {
            let value = number(line, column + 1, field)?;
            if value != 0.0 {
                table.entries.push((table.rows, column, value));
            }
        }
        table.rows += 1;
    }
    if table.rows == 0 {
        return Err(whole(ParseFault::Empty));
    }
    Ok(table)
}

/// Matrix Market: R. Boisvert, R. Pozo, K. Remington (1996), NISTIR 5935.
fn parse_market(text: &str) -> Parsed<MatrixTable> {
    let header = text.lines().next().unwrap_or("");
    let words: Vec<String> = header
        .split_whitespace()
        .map(str::to_ascii_lowercase)
        .collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let (coordinate, symmetric) = match words[..] {
        [
            "%%matrixmarket",
            "matrix",
            form @ ("coordinate" | "array"),
            "real" | "double" | "integer",
            symmetry @ ("general" | "symmetric"),
        ] => (form == "coordinate", symmetry == "symmetric"),
        _ => {
            let fault = ParseFault::Header {
                found: header.to_owned(),
                expected: "\"%%MatrixMarket matrix coordinate|array real|integer general|symmetric\"",
            };
            return Err(in_line(1, fault));
        }
    };
    let mut content = lines(text);
    let (line, size) = content.next().ok_or_else(|| whole(ParseFault::Empty))?;
    let sizes: Vec<usize> = size
        .split_whitespace()
        .map_while(|w| w.parse().ok())
        .collect();
    let wanted = if coordinate { 3 } else { 2 };
    if sizes.len() != wanted || size.split_whitespace().count() != wanted {
        let fault = ParseFault::Header {
            found: size.to_owned(),
            expected: if coordinate {
                "rows, columns and number of entries"
            } else {
                "rows and columns"
            },
        };
        return Err(in_line(line, fault));
    }
    let (rows, columns) = (sizes[0], sizes[1]);
    check_sides(rows, columns).map_err(whole)?;
    // By columns; of a symmetric array only i ≥ j is stored.
    let mut place = (0, 0);
    let expected = match (coordinate, symmetric) {
        (true, _) => sizes[2],
        (false, false) => rows * columns,
        (false, true) => (0..columns).map(|j| rows.saturating_sub(j)).sum(),
    };
    let mut entries = Vec::new();
    let mut found = 0usize;
    for (line, content) in content {
        let fields: Vec<&str> = content.split_whitespace().collect();
        let wanted = if coordinate { 3 } else { 1 };
        if fields.len() != wanted {
            let fault = ParseFault::Fields {
                expected: wanted,
                found: fields.len(),
            };
            return Err(in_line(line, fault));
        }
        found += 1;
        if found > expected {
            continue;
        }
        let (i, j) = if coordinate {
            let index = |field: usize| {
                let found = fields[field];
                found
                    .parse::<usize>()
                    .map_err(|_| in_field(line, field + 1, found))
            };
            let (row, column) = (index(0)?, index(1)?);
            let inside = (1..=rows).contains(&row) && (1..=columns).contains(&column);
            if !inside || (symmetric && row < column) {
                let fault = ParseFault::Outside {
                    row,
                    column,
                    rows,
                    columns,
                    upper: symmetric,
                };
                return Err(in_line(line, fault));
            }
            (row - 1, column - 1)
        } else {
            place
        };
        let value = number(line, wanted, fields[wanted - 1])?;
        if value != 0.0 {
            entries.push((i, j, value));
            if symmetric && i != j && j < rows && i < columns {
                entries.push((j, i, value));
            }
        }
        place.0 += 1;
        if place.0 >= rows {
            let next = place.1 + 1;
            place = (if symmetric { next } else { 0 }, next);
        }
    }
    if found != expected {
        return Err(whole(ParseFault::Count { expected, found }));
    }
    Ok(MatrixTable {
        rows,
        columns,
        entries,
    })
}
