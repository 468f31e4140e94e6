//! Matrix files: bytes written by hand, and arbitrary bytes that must not panic.

use proptest::prelude::*;

use crate::model::{MatrixTable, parse_matrix};

fn message(name: &str, bytes: &[u8]) -> String {
    parse_matrix(name, bytes).unwrap_err().to_string()
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
    assert_eq!(
        message("k.csv", b"# n\n1,2\n3,x\n"),
        "k.csv, line 3, field 2: \"x\" is not a finite number"
    );
    assert_eq!(
        message("k.csv", b"1,2\n3,nan\n"),
        "k.csv, line 2, field 2: \"nan\" is not a finite number"
    );
    assert_eq!(
        message("k.csv", b"1,2\n\n3,4,5\n"),
        "k.csv, line 3: found 3 numbers, expected 2"
    );
    assert_eq!(
        message("k.csv", b"1,,2\n"),
        "k.csv, line 1, field 2: \"\" is not a finite number"
    );
    assert_eq!(message("k.csv", b"# nothing\n"), "k.csv: holds no numbers");
    assert_eq!(
        message("k.csv", b"1,\xff\n"),
        "k.csv: not text: byte 2 is not UTF-8"
    );
    assert_eq!(
        message("k.xlsx", b""),
        "k.xlsx: unknown matrix format, expected .csv, .npy or .mtx"
    );
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
    let text = |body: &str| message("k.mtx", format!("{head}{body}").as_bytes());
    assert_eq!(
        text("2 2 1\n3 1 5\n"),
        "k.mtx, line 3: entry (3, 1) lies outside of the 2 by 2 matrix or above the diagonal of a symmetric one"
    );
    assert!(text("2 2 1\n1 2 5\n").contains("entry (1, 2)"));
    assert!(text("2 2 1\n0 1 5\n").contains("entry (0, 1)"));
    assert_eq!(
        text("2 2 2\n1 1 5\n"),
        "k.mtx: holds 1 entries, but its header claims 2"
    );
    assert_eq!(
        text("2 2 1\n1 1 5\n2 2 5\n"),
        "k.mtx: holds 2 entries, but its header claims 1"
    );
    assert_eq!(
        text("2 2 1\n1 1\n"),
        "k.mtx, line 3: found 2 numbers, expected 3"
    );
    assert_eq!(
        text("2 2\n"),
        "k.mtx, line 2: found \"2 2\", expected rows, columns and number of entries"
    );
    assert_eq!(
        text("2 2 1\n1 x 3\n"),
        "k.mtx, line 3, field 2: \"x\" is not a finite number"
    );
    assert!(text("9999999 9999999 1\n1 1 1\n").contains("the limit is 1000000 each"));
    assert!(text("").contains("holds no numbers"));
    for head in [
        "%%MatrixMarket matrix coordinate complex general",
        "%%MatrixMarket matrix coordinate real skew-symmetric",
        "1 2 3",
        "",
    ] {
        assert!(
            message("k.mtx", head.as_bytes()).contains("expected \"%%MatrixMarket matrix"),
            "{head}"
        );
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
    let text = |dictionary: &str, data: &[u8]| message("k.npy", &npy(1, dictionary, data));
    let good = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1), }";
    assert_eq!(
        message("k.npy", b"PK\x03\x04"),
        "k.npy: not a .npy file: it does not start with \\x93NUMPY"
    );
    assert!(message("k.npy", &npy(4, good, &[0; 8])).contains("version 4"));
    assert!(text(good, &[0; 7]).contains("holds 135 bytes, but its header claims 136"));
    assert!(text(good, &[0; 9]).contains("holds 137 bytes"));
    assert_eq!(
        text(&good.replace("<f8", "<c8"), &[0; 8]),
        "k.npy: the header says descr = '<c8', expected '<f8', '>f8', '<f4', '>f4', '<i8' or '<i4'"
    );
    assert!(text(&good.replace("False", "Maybe"), &[0; 8]).contains("fortran_order = Maybe"));
    assert!(text(&good.replace("(1, 1)", "(1, 1, 1)"), &[0; 8]).contains("shape = (1, 1, 1)"));
    assert!(
        text(&good.replace("(1, 1)", "(99999999999, 1)"), &[0; 8])
            .contains("the limit is 1000000 each")
    );
    assert!(text(&good.replace("(1, 1)", "()"), &[0; 8]).contains("shape = ()"));
    assert!(text(good, &f64::NAN.to_le_bytes()).contains("entry (1, 1) is NaN"));
    assert!(text("{'descr': '<f8'}", &[0; 8]).contains("fortran_order = nothing,"));
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
