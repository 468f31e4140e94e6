//! Matrices from the bytes of a file: `.csv`, `.npy` and Matrix Market `.mtx`. No file is opened here.
//!
//! Only non-zero entries are kept, so that a sparse model of ten thousand degrees of freedom stays small. Sizes that a
//! header claims are bounded before they are used.

use thiserror::Error;

use super::npy::{NpyError, parse_npy};
use super::table::{LARGEST_SIDE, MatrixTable};

/// Why bytes are not a matrix. Lines, rows and columns count from 1.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ParseError {
    /// An extension that names no known format.
    #[error("{file}: unknown matrix format, expected .csv, .npy or .mtx")]
    Extension {
        /// Name of the file.
        file: String,
    },
    /// Text that is not UTF-8.
    #[error("{file}: not text: byte {offset} is not UTF-8")]
    NotText {
        /// Name of the file.
        file: String,
        /// Position of the first bad byte, from 0.
        offset: usize,
    },
    /// The file has no numbers.
    #[error("{file}: holds no numbers")]
    Empty {
        /// Name of the file.
        file: String,
    },
    /// A field that is not a finite number.
    #[error("{file}, line {line}, field {field}: \"{found}\" is not a finite number")]
    Number {
        /// Name of the file.
        file: String,
        /// Line.
        line: usize,
        /// Field within the line.
        field: usize,
        /// The text.
        found: String,
    },
    /// A line with another number of fields than needed.
    #[error("{file}, line {line}: found {found} numbers, expected {expected}")]
    Fields {
        /// Name of the file.
        file: String,
        /// Line.
        line: usize,
        /// Numbers wanted.
        expected: usize,
        /// Numbers found.
        found: usize,
    },
    /// A header that is not understood.
    #[error("{file}, line {line}: found \"{found}\", expected {expected}")]
    Header {
        /// Name of the file.
        file: String,
        /// Line.
        line: usize,
        /// The value found.
        found: String,
        /// The accepted values.
        expected: &'static str,
    },
    /// A claimed size beyond the limit.
    #[error("{file}: claims {rows} rows and {columns} columns, the limit is {LARGEST_SIDE} each")]
    TooLarge {
        /// Name of the file.
        file: String,
        /// Rows claimed.
        rows: usize,
        /// Columns claimed.
        columns: usize,
    },
    /// An index beyond the size that the header claims.
    #[error("{file}, line {line}: entry ({row}, {column}) lies outside of the {rows} by {columns} matrix{}", if *upper { " or above the diagonal of a symmetric one" } else { "" })]
    Outside {
        /// Name of the file.
        file: String,
        /// Line.
        line: usize,
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
    #[error("{file}: holds {found} entries, but its header claims {expected}")]
    Count {
        /// Name of the file.
        file: String,
        /// Claimed.
        expected: usize,
        /// Found.
        found: usize,
    },
    /// A `.npy` file that is not understood.
    #[error("{file}: {source}")]
    Npy {
        /// Name of the file.
        file: String,
        /// The error.
        source: NpyError,
    },
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
    match extension.as_deref() {
        Some("csv") => parse_csv(name, text(name, bytes)?),
        Some("mtx") => parse_market(name, text(name, bytes)?),
        Some("npy") => parse_npy(bytes).map_err(|source| ParseError::Npy {
            file: name.to_owned(),
            source,
        }),
        _ => Err(ParseError::Extension {
            file: name.to_owned(),
        }),
    }
}

fn text<'a>(name: &str, bytes: &'a [u8]) -> Result<&'a str, ParseError> {
    let text = std::str::from_utf8(bytes).map_err(|error| ParseError::NotText {
        file: name.to_owned(),
        offset: error.valid_up_to(),
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// Lines that hold something, with their number from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with(['#', '%']))
}

fn number(file: &str, line: usize, field: usize, found: &str) -> Result<f64, ParseError> {
    match found.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(ParseError::Number {
            file: file.to_owned(),
            line,
            field,
            found: found.to_owned(),
        }),
    }
}

fn parse_csv(file: &str, text: &str) -> Result<MatrixTable, ParseError> {
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
            return Err(ParseError::Fields {
                file: file.to_owned(),
                line,
                expected: table.columns,
                found: fields.len(),
            });
        }
        for (column, field) in fields.into_iter().enumerate() {
            let value = number(file, line, column + 1, field)?;
            if value != 0.0 {
                table.entries.push((table.rows, column, value));
            }
        }
        table.rows += 1;
    }
    if table.rows == 0 {
        return Err(ParseError::Empty {
            file: file.to_owned(),
        });
    }
    Ok(table)
}

/// Matrix Market: R. Boisvert, R. Pozo, K. Remington (1996), NISTIR 5935.
fn parse_market(file: &str, text: &str) -> Result<MatrixTable, ParseError> {
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
            return Err(ParseError::Header {
                file: file.to_owned(),
                line: 1,
                found: header.to_owned(),
                expected: "\"%%MatrixMarket matrix coordinate|array real|integer general|symmetric\"",
            });
        }
    };
    let mut content = lines(text);
    let (line, size) = content.next().ok_or_else(|| ParseError::Empty {
        file: file.to_owned(),
    })?;
    let sizes: Vec<usize> = size
        .split_whitespace()
        .map_while(|w| w.parse().ok())
        .collect();
    let wanted = if coordinate { 3 } else { 2 };
    if sizes.len() != wanted || size.split_whitespace().count() != wanted {
        return Err(ParseError::Header {
            file: file.to_owned(),
            line,
            found: size.to_owned(),
            expected: if coordinate {
                "rows, columns and number of entries"
            } else {
                "rows and columns"
            },
        });
    }
    let (rows, columns) = (sizes[0], sizes[1]);
    if rows > LARGEST_SIDE || columns > LARGEST_SIDE {
        return Err(ParseError::TooLarge {
            file: file.to_owned(),
            rows,
            columns,
        });
    }
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
            return Err(ParseError::Fields {
                file: file.to_owned(),
                line,
                expected: wanted,
                found: fields.len(),
            });
        }
        found += 1;
        if found > expected {
            continue;
        }
        let (i, j) = if coordinate {
            let index = |field: usize| {
                fields[field]
                    .parse::<usize>()
                    .map_err(|_| ParseError::Number {
                        file: file.to_owned(),
                        line,
                        field: field + 1,
                        found: fields[field].to_owned(),
                    })
            };
            let (row, column) = (index(0)?, index(1)?);
            let inside = (1..=rows).contains(&row) && (1..=columns).contains(&column);
            if !inside || (symmetric && row < column) {
                return Err(ParseError::Outside {
                    file: file.to_owned(),
                    line,
                    row,
                    column,
                    rows,
                    columns,
                    upper: symmetric,
                });
            }
            (row - 1, column - 1)
        } else {
            place
        };
        let value = number(file, line, wanted, fields[wanted - 1])?;
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
        return Err(ParseError::Count {
            file: file.to_owned(),
            expected,
            found,
        });
    }
    Ok(MatrixTable {
        rows,
        columns,
        entries,
    })
}
