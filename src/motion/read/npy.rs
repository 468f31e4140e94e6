//! NumPy's `.npy`, versions 1 to 3: real numbers of one or two dimensions.
//!
//! | offset | size | meaning |
//! |---|---|---|
//! | 0 | 6 | `\x93NUMPY` |
//! | 6 | 1 | major version: 1, 2 or 3 |
//! | 7 | 1 | minor version: 0 |
//! | 8 | 2 (v1) or 4 (v2, v3) | length of the header, little endian |
//! | then | that length | a Python dictionary: `descr`, `fortran_order`, `shape` |
//! | then | | the numbers, by rows unless `fortran_order` |

use super::text::shorten;
use super::{MOST_COLUMNS, MOST_VALUES, Print, RawTable};
use crate::error::MotionError;

/// First bytes of every such file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// Reads the whole array; a row of one dimension is one column.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<RawTable, MotionError> {
    let refuse = |wanted: &'static str, found: &str| MotionError::Header {
        file: name.into(),
        line: 1,
        wanted,
        found: shorten(found),
    };
    let rest = bytes
        .strip_prefix(MAGIC)
        .ok_or_else(|| refuse("the first bytes of a .npy file", "others"))?;
    let (version, rest) = split(rest, 2).ok_or_else(|| refuse("a version", "the end"))?;
    let width = match version {
        [1, _] => 2,
        [2 | 3, _] => 4,
        _ => return Err(refuse("version 1, 2 or 3", &format!("{version:?}"))),
    };
    let (length, rest) = split(rest, width).ok_or_else(|| refuse("a header", "the end"))?;
    let length = length
        .iter()
        .rev()
        .fold(0_usize, |sum, &byte| (sum << 8) | usize::from(byte));
    let (header, data) = split(rest, length).ok_or_else(|| refuse("a whole header", "the end"))?;
    let header = String::from_utf8_lossy(header);

    let kind =
        quoted(&header, "descr").ok_or_else(|| refuse("a `descr` of one real number", &header))?;
    let read: fn(&[u8]) -> f64 = match kind {
        "<f8" => |b| f64::from_le_bytes(sized(b)),
        ">f8" => |b| f64::from_be_bytes(sized(b)),
        "<f4" => |b| f64::from(f32::from_le_bytes(sized(b))),
        ">f4" => |b| f64::from(f32::from_be_bytes(sized(b))),
        other => return Err(refuse("numbers of type f8 or f4", other)),
    };
    let size = if kind.ends_with('8') { 8 } else { 4 };
    let by_columns = match value_after(&header, "fortran_order") {
        Some(rest) if rest.starts_with("True") => true,
        Some(rest) if rest.starts_with("False") => false,
        _ => return Err(refuse("`fortran_order` True or False", &header)),
    };
    let shape = shape(&header).ok_or_else(|| refuse("a `shape` of whole numbers", &header))?;
    let (rows, columns) = match shape.as_slice() {
        [n] => (*n, 1),
        // MATLAB and others keep a vector as one row.
        [1, n] => (*n, 1),
        [rows, columns] => (*rows, *columns),
        _ => return Err(refuse("one or two dimensions", &format!("{shape:?}"))),
    };
    let too_large = |what, found, limit| MotionError::TooLarge {
        file: name.into(),
        what,
        found,
        limit,
    };
    let count = rows.saturating_mul(columns);
    if count == 0 {
        return Err(MotionError::Empty { file: name.into() });
    }
    if count > MOST_VALUES {
        return Err(too_large("values", count, MOST_VALUES));
    }
    if columns > MOST_COLUMNS {
        return Err(too_large("columns", columns, MOST_COLUMNS));
    }
    if data.len() != count * size {
        return Err(MotionError::Truncated {
            file: name.into(),
            wanted: count * size,
            found: data.len(),
        });
    }
    let mut values: Vec<f64> = data.chunks_exact(size).map(read).collect();
    if by_columns && rows > 1 && columns > 1 {
        values = (0..count)
            .map(|i| values[(i % columns) * rows + i / columns])
            .collect();
    }
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        return Err(MotionError::NotFinite {
            file: name.into(),
            line: at / columns + 1,
            column: at % columns + 1,
            found: values[at].to_string(),
        });
    }
    // Doubles carry their times to the last bit; single precision to six digits.
    let digits = if size == 8 { 15 } else { 6 };
    Ok(RawTable {
        columns,
        values,
        lines: (1..=rows).collect(),
        prints: vec![
            Print {
                decimals: 300,
                digits
            };
            columns
        ],
        ..RawTable::default()
    })
}

/// The first `at` bytes and the rest, if there are as many.
fn split(bytes: &[u8], at: usize) -> Option<(&[u8], &[u8])> {
    bytes.split_at_checked(at)
}

/// The bytes of one number; `chunks_exact` made them as many as the type has.
fn sized<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.try_into().unwrap_or([0; N])
}

/// What follows `'key':`.
fn value_after<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    [format!("'{key}'"), format!("\"{key}\"")]
        .iter()
        .find_map(|quoted| header.split_once(quoted.as_str()))
        .and_then(|(_, rest)| rest.trim_start().strip_prefix(':'))
        .map(str::trim_start)
}

/// The string that follows `'key':`.
fn quoted<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let rest = value_after(header, key)?;
    let quote = rest.chars().next().filter(|c| *c == '\'' || *c == '"')?;
    rest[1..].split_once(quote).map(|(text, _)| text)
}

/// The lengths in the parentheses that follow `'shape':`.
fn shape(header: &str) -> Option<Vec<usize>> {
    let inner = value_after(header, "shape")?.strip_prefix('(')?;
    let (inner, _) = inner.split_once(')')?;
    inner
        .split(',')
        .map(str::trim)
        .filter(|part| !part.is_empty())
        .map(|part| part.parse().ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::assert_is;

    /// A file as NumPy writes it, put together by hand.
    fn file(version: u8, dict: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([version, 0]);
        let header = format!("{dict:<117}\n");
        match version {
            1 => bytes.extend((header.len() as u16).to_le_bytes()),
            _ => bytes.extend((header.len() as u32).to_le_bytes()),
        }
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn dict(kind: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}")
    }

    #[test]
    fn all_npy_variants_give_equal_numbers() {
        let numbers = [1.0_f64, -2.5, 3.0, 0.5, 8.0, -16.0];
        let little8: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        let big8: Vec<u8> = numbers.iter().flat_map(|v| v.to_be_bytes()).collect();
        let little4: Vec<u8> = numbers
            .iter()
            .flat_map(|v| (*v as f32).to_le_bytes())
            .collect();
        let big4: Vec<u8> = numbers
            .iter()
            .flat_map(|v| (*v as f32).to_be_bytes())
            .collect();
        for version in [1, 2, 3] {
            for (kind, data) in [
                ("<f8", &little8),
                (">f8", &big8),
                ("<f4", &little4),
                (">f4", &big4),
            ] {
                let table =
                    parse("a.npy", &file(version, &dict(kind, "False", "(6,)"), data)).unwrap();
                assert_eq!((table.values.as_slice(), table.columns), (&numbers[..], 1));
                let table = parse(
                    "a.npy",
                    &file(version, &dict(kind, "False", "(3, 2)"), data),
                )
                .unwrap();
                assert_eq!((table.values.as_slice(), table.columns), (&numbers[..], 2));
                // By columns: the first three numbers are the first column.
                let table =
                    parse("a.npy", &file(version, &dict(kind, "True", "(3, 2)"), data)).unwrap();
                assert_eq!(table.values, [1.0, 0.5, -2.5, 8.0, 3.0, -16.0]);
                let table = parse(
                    "a.npy",
                    &file(version, &dict(kind, "False", "(1, 6)"), data),
                )
                .unwrap();
                assert_eq!((table.lines.len(), table.columns), (6, 1));
            }
        }
    }

    #[test]
    fn unreadable_npy_is_reported() {
        let refused = |bytes: &[u8]| parse("a.npy", bytes).unwrap_err();
        assert_is!(
            refused(&file(1, &dict("<i4", "False", "(1,)"), &[0; 4]))
            => MotionError::Header { line: 1, found, .. } if found == "<i4"
        );
        assert_is!(
            refused(&file(1, &dict("<f8", "False", "(2,)"), &[0; 12]))
            => MotionError::Truncated { wanted: 16, found: 12, .. }
        );
        assert_is!(
            refused(&file(1, &dict("<f8", "False", "(1, 1, 1)"), &[0; 8]))
            => MotionError::Header { line: 1, found, .. } if found == "[1, 1, 1]"
        );
        let huge = file(1, &dict("<f8", "False", "(99999999999,)"), &[0; 8]);
        assert_is!(refused(&huge) => MotionError::TooLarge { what: "values", .. });
        assert_is!(refused(&file(9, "", &[])) => MotionError::Header { .. });
        let nan: Vec<u8> = [1.0, f64::NAN]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        assert_is!(
            refused(&file(1, &dict("<f8", "False", "(2,)"), &nan))
            => MotionError::NotFinite { line: 2, column: 1, .. }
        );
    }

    #[test]
    fn every_truncation_is_an_error() {
        let data: Vec<u8> = [1.0_f64, 2.0]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let whole = file(1, &dict("<f8", "False", "(2,)"), &data);
        assert!(parse("a.npy", &whole).is_ok());
        for length in 0..whole.len() {
            assert!(parse("a.npy", &whole[..length]).is_err(), "{length}");
        }
    }
}
