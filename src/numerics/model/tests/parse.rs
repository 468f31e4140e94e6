//! Matrix files: bytes written by hand, and arbitrary bytes that must not panic.

use proptest::prelude::*;

use gusset_quantity::assert_is;
use gusset_quantity::npy::NpyError;

use crate::model::{MatrixTable, ParseFault, parse_matrix};

/// The place and the fault of a file that is refused.
fn refused(name: &str, bytes: &[u8]) -> (String, ParseFault) {
    let error = parse_matrix(name, bytes).unwrap_err();
    assert_eq!(error.file, name);
    (error.place, error.fault)
}

fn in_field(line: usize, field: usize, found: &str) -> (String, ParseFault) {
    let fault = ParseFault::Number(found.to_owned());
    (format!(", line {line}, field {field}"), fault)
}

fn in_line(line: usize, fault: ParseFault) -> (String, ParseFault) {
    (format!(", line {line}"), fault)
}

fn whole(fault: ParseFault) -> (String, ParseFault) {
    (String::new(), fault)
}

fn fields(found: usize, expected: usize) -> ParseFault {
    ParseFault::Fields { expected, found }
}

fn rows(table: &MatrixTable) -> Vec<Vec<f64>> {
    let dense = table.to_dense();
    dense
        .row_iter()
        .map(|r| r.iter().copied().collect())
        .collect()
}

/// A version-1 or later file with the given header dictionary, padded as NumPy pads it.
fn npy(major: u8, dictionary: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([major, 0]);
    let mut header = dictionary.to_owned();
    let length_size = if major == 1 { 2 } else { 4 };
    while !(8 + length_size + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    if major == 1 {
        bytes.extend((header.len() as u16).to_le_bytes());
    } else {
        bytes.extend((header.len() as u32).to_le_bytes());
    }
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn csv_separators_and_comments_are_read() {
    let expected = vec![vec![1.0, -2.5e3], vec![-2.5e3, 4.0]];
    for text in [
        "1,-2.5e3\n-2.5e3,4\n",
        "# stiffness\r\n1; -2.5E3;\r\n\r\n-2500;4;\r\n",
        "% from a spreadsheet\n1\t-2500\n  -2500   4",
        "\u{feff}1 -2500\n-2500 4.0\n",
    ] {
        assert_eq!(
            rows(&parse_matrix("K.CSV", text.as_bytes()).unwrap()),
            expected,
            "{text:?}"
        );
    }
}

#[test]
fn csv_mistakes_are_named_by_line_and_field() {
    for (text, expected) in [
        (&b"# n\n1,2\n3,x\n"[..], in_field(3, 2, "x")),
        (b"1,2\n3,nan\n", in_field(2, 2, "nan")),
        (b"1,2\n\n3,4,5\n", in_line(3, fields(3, 2))),
        (b"1,,2\n", in_field(1, 2, "")),
        (b"# nothing\n", whole(ParseFault::Empty)),
        (b"1,\xff\n", whole(ParseFault::NotText(2))),
    ] {
        assert_eq!(refused("k.csv", text), expected);
    }
    assert_eq!(refused("k.xlsx", b""), whole(ParseFault::Extension));
}

#[test]
fn all_matrix_market_forms_are_read() {
    let expected = vec![
        vec![4.0, -1.0, 0.0],
        vec![-1.0, 4.0, 2.0],
        vec![0.0, 2.0, 5.0],
    ];
    for text in [
        "%%MatrixMarket matrix coordinate real symmetric\n% a comment\n3 3 5\n1 1 4\n2 1 -1.0\n2 2 4\n3 2 2\n3 3 5e0\n",
        "%%MatrixMarket matrix coordinate integer general\n3 3 7\n1 1 4\n1 2 -1\n2 1 -1\n2 2 4\n2 3 2\n3 2 2\n3 3 5\n",
        "%%MatrixMarket matrix array real general\n3 3\n4\n-1\n0\n-1\n4\n2\n0\n2\n5\n",
        "%%matrixmarket MATRIX Array Real Symmetric\n3 3\n4\n-1\n0\n4\n2\n5\n",
    ] {
        assert_eq!(
            rows(&parse_matrix("k.mtx", text.as_bytes()).unwrap()),
            expected,
            "{text}"
        );
    }
    // By columns, not rows.
    let text = "%%MatrixMarket matrix array real general\n2 3\n1\n2\n3\n4\n5\n6\n";
    let table = parse_matrix("a.mtx", text.as_bytes()).unwrap();
    assert_eq!(rows(&table), [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]);
    // Duplicates of a coordinate file add up.
    let text = "%%MatrixMarket matrix coordinate real general\n1 1 2\n1 1 4\n1 1 0.5\n";
    assert_eq!(
        rows(&parse_matrix("a.mtx", text.as_bytes()).unwrap()),
        [[4.5]]
    );
}

#[test]
fn matrix_market_mistakes_are_named_by_line() {
    let head = "%%MatrixMarket matrix coordinate real symmetric\n";
    let refuse = |body: &str| refused("k.mtx", format!("{head}{body}").as_bytes());
    let outside = |row, column| ParseFault::Outside {
        row,
        column,
        rows: 2,
        columns: 2,
        upper: true,
    };
    let count = |found, expected| whole(ParseFault::Count { expected, found });
    for (body, expected) in [
        ("2 2 1\n3 1 5\n", in_line(3, outside(3, 1))),
        ("2 2 1\n1 2 5\n", in_line(3, outside(1, 2))),
        ("2 2 1\n0 1 5\n", in_line(3, outside(0, 1))),
        ("2 2 2\n1 1 5\n", count(1, 2)),
        ("2 2 1\n1 1 5\n2 2 5\n", count(2, 1)),
        ("2 2 1\n1 1\n", in_line(3, fields(2, 3))),
        ("2 2 1\n1 x 3\n", in_field(3, 2, "x")),
        ("", whole(ParseFault::Empty)),
    ] {
        assert_eq!(refuse(body), expected, "{body}");
    }
    let (place, fault) = refuse("2 2\n");
    assert_eq!(place, ", line 2");
    assert_is!(fault => ParseFault::Header { found, .. } if found == "2 2");
    let (_, fault) = refuse("9999999 9999999 1\n1 1 1\n");
    assert_is!(fault => ParseFault::TooLarge { rows: 9_999_999, columns: 9_999_999 });
    for head in [
        "%%MatrixMarket matrix coordinate complex general",
        "%%MatrixMarket matrix coordinate real skew-symmetric",
        "1 2 3",
        "",
    ] {
        let (_, fault) = refused("k.mtx", head.as_bytes());
        assert_is!(fault => ParseFault::Header { found, .. } if found == head);
    }
}

#[test]
fn all_npy_forms_are_read() {
    let expected = vec![vec![1.0, 2.0, 3.0], vec![4.0, 5.0, -6.0]];
    let by_rows = [1.0f64, 2.0, 3.0, 4.0, 5.0, -6.0];
    let by_columns = [1.0f64, 4.0, 2.0, 5.0, 3.0, -6.0];
    for major in 1..=3 {
        for (fortran, values) in [("False", by_rows), ("True", by_columns)] {
            let data: [(&str, Vec<u8>); 4] = [
                ("<f8", values.iter().flat_map(|v| v.to_le_bytes()).collect()),
                (
                    "<f4",
                    values
                        .iter()
                        .flat_map(|v| (*v as f32).to_le_bytes())
                        .collect(),
                ),
                (
                    "<i8",
                    values
                        .iter()
                        .flat_map(|v| (*v as i64).to_le_bytes())
                        .collect(),
                ),
                (
                    "<i4",
                    values
                        .iter()
                        .flat_map(|v| (*v as i32).to_le_bytes())
                        .collect(),
                ),
            ];
            for (kind, data) in data {
                let dictionary =
                    format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': (2, 3), }}");
                let table = parse_matrix("k.npy", &npy(major, &dictionary, &data)).unwrap();
                assert_eq!(rows(&table), expected, "{dictionary}");
            }
        }
    }
    let column = npy(
        1,
        "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }",
        &[0; 16],
    );
    let table = parse_matrix("m.npy", &column).unwrap();
    assert_eq!((table.rows, table.columns, table.entries.len()), (2, 1, 0));
}

#[test]
fn npy_mistakes_are_explained() {
    let refuse = |dictionary: &str, data: &[u8]| refused("k.npy", &npy(1, dictionary, data)).1;
    let good = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1), }";
    let (_, fault) = refused("k.npy", b"PK\x03\x04");
    assert_is!(fault => ParseFault::Npy(NpyError::Magic));
    let (_, fault) = refused("k.npy", &npy(4, good, &[0; 8]));
    assert_is!(fault => ParseFault::Npy(NpyError::Version { major: 4 }));
    for found in [135, 137] {
        let length = NpyError::Length {
            expected: 136,
            found,
        };
        assert_eq!(refuse(good, &vec![0; found - 128]), ParseFault::Npy(length));
    }
    for (from, to, wrong, value) in [
        ("<f8", "<c8", "descr", "'<c8'"),
        ("False", "Maybe", "fortran_order", "Maybe"),
        ("(1, 1)", "(1, 1, 1)", "shape", "(1, 1, 1)"),
        ("(1, 1)", "()", "shape", "()"),
        (", 'fortran_order': False", "", "fortran_order", "nothing"),
    ] {
        assert_is!(
            refuse(&good.replace(from, to), &[0; 8])
            => ParseFault::Npy(NpyError::Header { key, found, .. }) if *key == wrong && found == value
        );
    }
    assert_is!(
        refuse(&good.replace("(1, 1)", "(99999999999, 1)"), &[0; 8])
        => ParseFault::TooLarge { rows: 99_999_999_999, columns: 1 }
    );
    assert_is!(
        refuse(good, &f64::NAN.to_le_bytes())
        => ParseFault::NotFinite { row: 1, column: 1, found } if found.is_nan()
    );
    let whole = npy(1, good, &[0; 8]);
    for length in 0..whole.len() {
        assert!(
            parse_matrix("k.npy", &whole[..length]).is_err(),
            "cut at {length}"
        );
    }
}

proptest! {
    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), text in "[-0-9eE.,; \n%]{0,200}") {
        for name in ["a.csv", "a.mtx", "a.npy"] {
            let _ = parse_matrix(name, &bytes);
            let _ = parse_matrix(name, text.as_bytes());
        }
        for form in ["coordinate", "array"] {
            for symmetry in ["general", "symmetric"] {
                let file = format!("%%MatrixMarket matrix {form} real {symmetry}\n{text}");
                if let Ok(table) = parse_matrix("a.mtx", file.as_bytes()) && table.rows < 1000 && table.columns < 1000 {
                    let _ = table.to_dense();
                    let _ = table.to_symmetric();
                }
            }
        }
        let mut junk = npy(1, "{'descr': '<i4', 'fortran_order': True, 'shape': (3, 2), }", &[1; 24]);
        for (at, byte) in bytes.iter().enumerate().take(40) {
            let place = (at * 7 + usize::from(*byte)) % junk.len();
            junk[place] = *byte;
        }
        let _ = parse_matrix("a.npy", &junk);
    }
}
