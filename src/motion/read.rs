//! Strong-motion and table files: bytes and a name in, numbers out.
//!
//! No file is opened here. What a file does not say (its step, its unit, which of several columns) is asked
//! of the caller and never guessed; one that contradicts itself (in its count of points) is refused. Every error
//! names the file and, where there is one, the line and column. Sizes are bounded before memory is taken; arbitrary
//! bytes never panic.
//!
//! | format | is |
//! |---|---|
//! | `peer` | PEER `.AT2`, `.VT2`, `.DT2`: a header that ends with NPTS and DT, then numbers in reading order |
//! | `csv` | fields separated by `,` `;` or a tab, with or without a header line; `0,5` is read where `;` separates |
//! | `two_column` | time and value, separated by blanks or commas |
//! | `one_column` | one value a line |
//! | `list` | values in reading order, several a line |
//! | `npy` | NumPy array, versions 1 to 3, `f4` or `f8`, of one or two dimensions |
//! | `knet` `cosmos` `csmip` `esm` `geonet` `nsmn` `cwa` `smc` `bbp` `unam` `renadic` | the formats of strong-motion networks: see `native` |
//!
//! Lines that begin with `#`, `%` or `!` are comments in text files, except in `peer`.

mod axis;
mod native;
mod npy;
mod peer;
mod text;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, positive};
use super::unit::Unit;

/// Most bytes of one file.
pub const LARGEST_FILE: usize = 1 << 29;
/// Most numbers of one file.
pub const MOST_VALUES: usize = 1 << 25;
/// Most columns of one table.
pub const MOST_COLUMNS: usize = 1 << 16;

/// How the bytes of a file are to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordFormat {
    /// PEER `.AT2`, `.VT2` or `.DT2`.
    Peer,
    /// Fields separated by commas, semicolons or tabs.
    Csv,
    /// Time and value on each line.
    TwoColumn,
    /// One value on each line; the step must be given.
    OneColumn,
    /// Values in reading order, any number on a line; the step must be given.
    List,
    /// NumPy array.
    Npy,
    /// K-NET or KiK-net (Japan), ASCII.
    Knet,
    /// COSMOS V1 or V2.
    Cosmos,
    /// CSMIP, CDMG or USC (California), V1 or V2.
    Csmip,
    /// ESM, ITACA or AFAD single component, ASCII.
    Esm,
    /// GeoNet (New Zealand), V1A or V2A.
    Geonet,
    /// NSMN (Türkiye), three columns.
    Nsmn,
    /// CWA, formerly CWB (Taiwan), free format.
    Cwa,
    /// USGS SMC.
    Smc,
    /// SCEC Broadband Platform.
    Bbp,
    /// UNAM (Mexico), ASA.
    Unam,
    /// RENADIC (Chile), V1.
    Renadic,
}

/// One column of a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Column {
    /// As the header line calls it.
    Name(String),
    /// Counted from 1.
    Number(usize),
}

/// What the caller knows of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReadOptions {
    /// The format; by default the ending of the name and the first lines tell.
    pub format: Option<RecordFormat>,
    /// Time step in s; overrules what the file says, with a warning if they differ.
    pub dt: Option<f64>,
    /// The column of values, where there are several.
    pub column: Option<Column>,
    /// The column of times; by default one named `t` or `time`, or the first of a table without names.
    pub time_column: Option<Column>,
}

/// Numbers at equal distances in time, in the unit of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Time step in s.
    pub dt: f64,
    /// The numbers, at 0, dt, 2 dt …, all finite, at least one.
    pub values: Vec<f64>,
    /// The unit that the file states, if it does.
    pub unit: Option<Unit>,
    /// What the file calls itself, empty if nothing.
    pub title: String,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Rows of numbers: a load history with one column per degree of freedom, or a matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns; empty if the file has no header.
    pub names: Vec<String>,
    /// Number of columns.
    pub columns: usize,
    /// Numbers by rows, all finite.
    pub values: Vec<f64>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl Table {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.values.len().checked_div(self.columns).unwrap_or(0)
    }

    /// The column that is called a time, in whatever unit, if one is; from 0.
    #[must_use]
    pub fn column_of_times(&self) -> Option<usize> {
        let before = |name: &String| axis::is_time(name.split(['(', '[']).next().unwrap_or(""));
        self.names
            .iter()
            .position(|name| axis::is_time(name) || before(name))
    }

    /// The unit in the brackets of a column's name.
    #[must_use]
    pub fn unit_of(&self, column: usize) -> Option<Unit> {
        self.names.get(column).and_then(|name| axis::unit_in(name))
    }
}

/// Reads a record. `name` decides the format if `options` does not, and stands in every error.
///
/// # Errors
/// Those of [`MotionError`] that name a file, and `dt_s` outside its domain.
pub fn parse_record(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
) -> Result<Record, MotionError> {
    check_size(name, bytes)?;
    native::refuse_binary(name, bytes)?;
    if let Some(dt) = options.dt {
        positive("dt_s", dt)?;
    }
    let format = options.format.unwrap_or_else(|| detect(name, bytes));
    let only_tables = |key| match (&options.column, &options.time_column) {
        (None, None) => Ok(()),
        _ => Err(MotionError::NotApplicable {
            key: "column",
            what: key,
        }),
    };
    match format {
        RecordFormat::Peer => {
            only_tables("a PEER file: it holds one component")?;
            peer::parse(name, text::decode(name, bytes)?.as_ref(), options.dt)
        }
        RecordFormat::Csv => {
            let table = text::parse(name, bytes, text::Layout::Separated)?;
            axis::record(name, table, options)
        }
        RecordFormat::TwoColumn => {
            only_tables("a two_column file")?;
            let table = blank_columns(name, bytes, 2)?;
            let both = ReadOptions {
                column: Some(Column::Number(2)),
                time_column: Some(Column::Number(1)),
                ..options.clone()
            };
            axis::record(name, table, &both)
        }
        RecordFormat::OneColumn => {
            only_tables("a one_column file")?;
            let table = blank_columns(name, bytes, 1)?;
            axis::record(name, table, options)
        }
        RecordFormat::List => {
            only_tables("a list")?;
            let table = text::parse(name, bytes, text::Layout::Running)?;
            axis::record(name, table, options)
        }
        RecordFormat::Npy => axis::record(name, npy::parse(name, bytes)?, options),
        network => {
            let text = text::decode(name, bytes)?;
            native::parse(name, text.as_ref(), network, options)
        }
    }
}

/// A table of so many columns with blanks between them.
fn blank_columns(name: &str, bytes: &[u8], wanted: usize) -> Result<RawTable, MotionError> {
    let read = text::parse(name, bytes, text::Layout::Blank)
        .and_then(|table| table.want_columns(name, wanted).map(|()| table));
    if let Err(MotionError::Ragged { line, .. }) = &read {
        text::refuse_decimal_comma_between_blanks(name, bytes, *line, wanted)?;
    }
    read
}

/// Reads a table of numbers: `.npy`, `.csv`, or text with blanks between the columns.
///
/// # Errors
/// Those of [`MotionError`] that name a file.
pub fn parse_table(name: &str, bytes: &[u8]) -> Result<Table, MotionError> {
    check_size(name, bytes)?;
    let raw = if bytes.starts_with(npy::MAGIC) || has_ending(name, &["npy"]) {
        npy::parse(name, bytes)?
    } else if has_ending(name, &["csv", "tsv"]) {
        text::parse(name, bytes, text::Layout::Separated)?
    } else {
        text::parse(name, bytes, text::Layout::Blank)?
    };
    Ok(raw.into_table())
}

fn check_size(name: &str, bytes: &[u8]) -> Result<(), MotionError> {
    if bytes.is_empty() {
        return Err(MotionError::Empty { file: name.into() });
    }
    if bytes.len() > LARGEST_FILE {
        return Err(MotionError::TooLarge {
            file: name.into(),
            what: "bytes",
            found: bytes.len(),
            limit: LARGEST_FILE,
        });
    }
    Ok(())
}

/// True if the name ends in a dot and one of `endings`, whatever the case.
fn has_ending(name: &str, endings: &[&str]) -> bool {
    name.rsplit_once('.')
        .is_some_and(|(_, e)| endings.iter().any(|w| e.eq_ignore_ascii_case(w)))
}

/// The format that the name and the first lines tell.
fn detect(name: &str, bytes: &[u8]) -> RecordFormat {
    if bytes.starts_with(npy::MAGIC) || has_ending(name, &["npy"]) {
        return RecordFormat::Npy;
    }
    if has_ending(name, &["at2", "vt2", "dt2"]) {
        return RecordFormat::Peer;
    }
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    if let Some(native) = native::detect(&start) {
        return native;
    }
    if has_ending(name, &["csv", "tsv"]) {
        return RecordFormat::Csv;
    }
    if peer::looks_like(&start) {
        return RecordFormat::Peer;
    }
    match text::first_row_width(&start) {
        1 => RecordFormat::OneColumn,
        2 => RecordFormat::TwoColumn,
        // Three and more: a table; the columns must be chosen, which `csv` asks for.
        _ => RecordFormat::Csv,
    }
}

/// A table as read, with what error messages need.
#[derive(Debug)]
pub(super) struct RawTable {
    names: Vec<String>,
    columns: usize,
    values: Vec<f64>,
    /// Line of each row.
    lines: Vec<usize>,
    /// How finely each column is written.
    prints: Vec<Print>,
    warnings: Vec<String>,
}

/// How finely the numbers of a column are written: what rounding in print can hide.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Print {
    /// Most digits after the point, exponent included.
    decimals: i32,
    /// Most significant digits.
    digits: i32,
}

impl RawTable {
    fn column(&self, index: usize) -> impl Iterator<Item = f64> + '_ {
        self.values
            .iter()
            .skip(index)
            .step_by(self.columns.max(1))
            .copied()
    }

    fn want_columns(&self, name: &str, wanted: usize) -> Result<(), MotionError> {
        if self.columns == wanted {
            return Ok(());
        }
        Err(MotionError::Ragged {
            file: name.into(),
            line: self.lines.first().copied().unwrap_or(1),
            wanted,
            found: self.columns,
        })
    }

    fn into_table(self) -> Table {
        Table {
            names: self.names,
            columns: self.columns,
            values: self.values,
            warnings: self.warnings,
        }
    }
}

#[cfg(test)]
const FORMATS: [RecordFormat; 17] = [
    RecordFormat::Peer,
    RecordFormat::Csv,
    RecordFormat::TwoColumn,
    RecordFormat::OneColumn,
    RecordFormat::List,
    RecordFormat::Npy,
    RecordFormat::Knet,
    RecordFormat::Cosmos,
    RecordFormat::Csmip,
    RecordFormat::Esm,
    RecordFormat::Geonet,
    RecordFormat::Nsmn,
    RecordFormat::Cwa,
    RecordFormat::Smc,
    RecordFormat::Bbp,
    RecordFormat::Unam,
    RecordFormat::Renadic,
];

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Whatever comes back is a valid record.
    fn read_all_ways(bytes: &[u8]) {
        for format in FORMATS {
            for dt in [None, Some(0.01)] {
                let options = ReadOptions {
                    format: Some(format),
                    dt,
                    ..ReadOptions::default()
                };
                if let Ok(record) = parse_record("any.txt", bytes, &options) {
                    assert!(record.dt > 0.0 && record.dt.is_finite());
                    assert!(!record.values.is_empty());
                    assert!(record.values.iter().all(|v| v.is_finite()));
                }
            }
        }
        for name in ["a.at2", "a.csv", "a.npy", "a.txt", "a"] {
            let _ = parse_record(name, bytes, &ReadOptions::default());
            let _ = parse_table(name, bytes);
        }
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            read_all_ways(&bytes);
        }

        #[test]
        fn text_made_of_what_parsers_look_for_never_panics(
            text in "([0-9]{1,9}|[-+.,;eEdD =\t\"*#]|\r\r\n|\n|NPTS|DT|SEC|UNITS OF|NaN|inf|é){0,80}"
        ) {
            read_all_ways(text.as_bytes());
        }

        #[test]
        fn a_peer_header_before_arbitrary_text_never_panics(tail in "[-+.0-9eE \n*]{0,200}", npts in any::<u64>()) {
            let text = format!("a\nb\nACCELERATION TIME HISTORY IN UNITS OF G\nNPTS= {npts}, DT= .01 SEC\n{tail}");
            read_all_ways(text.as_bytes());
        }

        #[test]
        fn an_npy_header_before_arbitrary_bytes_never_panics(
            rows in any::<u64>(),
            columns in prop::option::of(0u64..5),
            kind in prop::sample::select(vec!["<f8", ">f4", "<i4", "x"]),
            tail in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            let shape = columns.map_or(format!("({rows},)"), |c| format!("({rows}, {c})"));
            let dict = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((dict.len() as u16).to_le_bytes());
            bytes.extend(dict.as_bytes());
            bytes.extend(tail);
            read_all_ways(&bytes);
        }
    }

    #[test]
    fn the_name_and_the_first_lines_tell_the_format() {
        for (name, text, format) in [
            ("RSN6.AT2", "", RecordFormat::Peer),
            ("rsn6.vt2", "", RecordFormat::Peer),
            ("a.CSV", "", RecordFormat::Csv),
            ("a.npy", "", RecordFormat::Npy),
            ("a.dat", "1\n2\n", RecordFormat::OneColumn),
            ("a", "# x\n0.0 1\n0.1 2\n", RecordFormat::TwoColumn),
            ("a.txt", "0, 1\n", RecordFormat::TwoColumn),
            (
                "a.txt",
                "t\nx\ny\n 2 .01 NPTS, DT\n1 2\n",
                RecordFormat::Peer,
            ),
        ] {
            assert_eq!(detect(name, text.as_bytes()), format, "{name} {text}");
        }
    }

    #[test]
    fn an_empty_file_is_named() {
        for bytes in [&b""[..], b"\n\n", b"# only a comment\n"] {
            let error = parse_record("quiet.txt", bytes, &ReadOptions::default()).unwrap_err();
            assert_eq!(error.to_string(), "quiet.txt: holds no numbers");
        }
    }

    #[test]
    fn a_step_must_be_positive_wherever_it_comes_from() {
        for dt in [0.0, -0.01, f64::NAN, f64::INFINITY] {
            let options = ReadOptions {
                dt: Some(dt),
                ..ReadOptions::default()
            };
            let error = parse_record("a.txt", b"1\n2\n", &options).unwrap_err();
            assert!(matches!(error, MotionError::Parameter { name: "dt_s", .. }));
        }
    }

    #[test]
    fn a_load_table_comes_back_by_rows() {
        let table = parse_table("load.csv", b"f1,f2\n1,2\n3,4\n5,6\n").unwrap();
        assert_eq!(table.names, ["f1", "f2"]);
        assert_eq!((table.rows(), table.columns), (3, 2));
        assert_eq!(table.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let table = parse_table("load.txt", b"north east\n1 2\n3 4\n").unwrap();
        assert_eq!((table.rows(), table.names.len()), (2, 2));
        assert!(table.warnings[0].contains("taken as a header"));
    }
}
