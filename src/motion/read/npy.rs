//! NumPy's `.npy`: [`gusset_quantity::npy`] reads it.

use gusset_quantity::npy::Array;

use super::{MOST_COLUMNS, MOST_VALUES, Print, RawTable};
use crate::error::MotionError;

/// Reads the whole array; a row of one axis is one column.
pub(super) fn parse(name: &str, bytes: &[u8]) -> Result<RawTable, MotionError> {
    let refuse = |source| MotionError::Npy {
        file: name.into(),
        source,
    };
    let array = Array::open(bytes).map_err(refuse)?;
    let (rows, columns) = (array.rows, array.columns);
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
    // MATLAB and others keep a vector as one row.
    let (lines, width) = if rows == 1 {
        (columns, 1)
    } else {
        (rows, columns)
    };
    if width > MOST_COLUMNS {
        return Err(too_large("columns", width, MOST_COLUMNS));
    }
    let mut values = vec![0.0; count];
    for (row, column, value) in array.entries().map_err(refuse)? {
        let at = row * columns + column;
        if !value.is_finite() {
            return Err(MotionError::NotFinite {
                file: name.into(),
                line: at / width + 1,
                column: at % width + 1,
                found: value.to_string(),
            });
        }
        values[at] = value;
    }
    // Doubles carry their times to the last bit; single precision to six digits.
    let digits = if array.size == 8 { 15 } else { 6 };
    Ok(RawTable {
        columns: width,
        values,
        lines: (1..=lines).collect(),
        prints: vec![
            Print {
                decimals: 300,
                digits
            };
            width
        ],
        ..RawTable::default()
    })
}

#[cfg(test)]
mod tests {
    use gusset_quantity::assert_is;
    use gusset_quantity::npy::{MAGIC, NpyError};

    use super::*;

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
        let npy = |bytes: &[u8]| match refused(bytes) {
            MotionError::Npy { source, .. } => source,
            other => panic!("{other:?}"),
        };
        assert_is!(
            npy(&file(1, &dict("<c8", "False", "(1,)"), &[0; 8]))
            => NpyError::Header { key: "descr", found, .. } if found == "'<c8'"
        );
        assert_is!(
            npy(&file(1, &dict("<f8", "False", "(2,)"), &[0; 12]))
            => NpyError::Length { expected: 144, found: 140 }
        );
        assert_is!(
            npy(&file(1, &dict("<f8", "False", "(1, 1, 1)"), &[0; 8]))
            => NpyError::Header { key: "shape", found, .. } if found == "(1, 1, 1)"
        );
        assert_is!(npy(&file(9, "", &[])) => NpyError::Version { major: 9 });
        let huge = file(1, &dict("<f8", "False", "(99999999999,)"), &[0; 8]);
        assert_is!(refused(&huge) => MotionError::TooLarge { found: 99_999_999_999, .. });
        let nan: Vec<u8> = [1.0, f64::NAN]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        assert_is!(
            refused(&file(1, &dict("<f8", "False", "(2,)"), &nan))
            => MotionError::NotFinite { line: 2, column: 1, found, .. } if found == "NaN"
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
