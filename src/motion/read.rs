//! Strong-motion and table files: bytes and a name in, numbers out.
//!
//! No file is opened here. The caller provides missing properties (step, unit, one of several columns); they are never
//! guessed. A file that contradicts itself (in its count of points) is refused. Every error
//! names the file and, where there is one, the line and column. Sizes are bounded before memory is taken; arbitrary
//! bytes never panic.
//!
//! | format | is |
//! |---|---|
//! | `peer` | PEER `.AT2`, `.VT2`, `.DT2`: a header that ends with NPTS and DT, then numbers in reading order |
//! | `npy` | NumPy array, versions 1 to 3, `f4` or `f8`, of one or two dimensions |
//! | `table` | any table in text: what follows are tables of which more is known |
//! | `csv` | fields separated by `,` `;` or a tab |
//! | `two_column` | time and value on a line |
//! | `one_column` | one value a line |
//! | `list` | values in reading order, several a line |
//! | `knet` `cosmos` `csmip` `esm` `geonet` `nsmn` `cwa` `smc` `bbp` `unam` `renadic` | the formats of strong-motion networks: see `native` |
//!
//! One reader reads every table in text. It finds the separator, the header, the names and units of the
//! columns, decimal commas, and a first line with count and step. Lines that begin with `#`, `%` or `!` are comments in
//! tables. One of them names the columns only where no other line does. A unit in running text counts only if it is marked,
//! as in `unit = g`, and the file has one column of values.

mod axis;
mod header;
mod label;
mod layout;
mod native;
mod npy;
mod peer;
mod remark;
mod rows;
mod text;
mod uniform;

use gusset_quantity::npy::MAGIC;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, positive};
use super::unit::Unit;
use header::Header;
use rows::Settings;

/// Most bytes of one file.
pub(crate) const LARGEST_FILE: usize = 1 << 29;
/// Most numbers of one file.
pub const MOST_VALUES: usize = 1 << 25;
/// Most columns of one table.
pub(crate) const MOST_COLUMNS: usize = 1 << 16;

/// Endings of the names of PEER files.
const PEER_ENDINGS: [&str; 3] = ["at2", "vt2", "dt2"];

/// Format of a record file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordFormat {
    /// PEER `.AT2`, `.VT2` or `.DT2`.
    Peer,
    /// Text table with any separator. A header may give column names and units.
    Table,
    /// Text table with commas, semicolons or tabs between the columns.
    Csv,
    /// Time and value on each line.
    TwoColumn,
    /// One value on each line. `dt_s` is required.
    OneColumn,
    /// Values in reading order, any number on a line. `dt_s` is required, unless a line before the
    /// values contains their number and their time step.
    List,
    /// NumPy array (`.npy`).
    Npy,
    /// K-NET or KiK-net (Japan), ASCII.
    Knet,
    /// COSMOS V1 or V2.
    Cosmos,
    /// CSMIP, CDMG or USC (California), V1 or V2; BHRC (Iran), V1.
    Csmip,
    /// ESM, ITACA or AFAD, ASCII with one component.
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

impl RecordFormat {
    /// The spelling of the test file.
    #[must_use]
    pub fn name(self) -> String {
        let written = serde_json::to_value(self).ok();
        let text = written.as_ref().and_then(serde_json::Value::as_str);
        text.unwrap_or_default().to_owned()
    }
}

/// Column of a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Column {
    /// Name of the column in the header.
    Name(String),
    /// Number of the column, from 1.
    Number(usize),
}

/// Known properties of a file.
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
    /// Lines of a table in text that are skipped before anything is read.
    pub skip_rows: usize,
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
    /// Title in the file, or an empty text.
    pub title: String,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Where in the file it was found.
    pub source: RecordSource,
}

/// Where in its file a record was found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordSource {
    /// The format as which the file was read; [`parse_record`] fills it in.
    pub format: Option<RecordFormat>,
    /// Its column or component from 1, where there are several.
    pub column: Option<usize>,
    /// The name of that column in the file.
    pub name: Option<String>,
    /// The text of its unit, where that is not understood.
    pub unknown_unit: Option<String>,
    /// The line of its header, from 1, whose running text states the unit; none if the column itself does.
    pub unit_line: Option<usize>,
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
    /// Warnings for the user.
    pub warnings: Vec<String>,
    header: Header,
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
        self.header.time()
    }

    /// The unit that the header gives for a column.
    #[must_use]
    pub fn unit_of(&self, column: usize) -> Option<Unit> {
        self.header.any_unit_of(column)
    }
}

/// Reads a record. `name` decides the format if `options` does not, and is part of each error.
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
    let format = match options.format {
        Some(format) => format,
        // A user who skips lines expects a table behind them.
        None if options.skip_rows > 0 => RecordFormat::Table,
        None => detect(name, bytes),
    };
    let refused = |key, what| Err(MotionError::NotApplicable { key, what });
    let without_columns = match format {
        RecordFormat::Peer => Some("a PEER file: it holds one component"),
        RecordFormat::TwoColumn => Some("a two_column file"),
        RecordFormat::OneColumn => Some("a one_column file"),
        RecordFormat::List => Some("a list"),
        _ => None,
    };
    if let Some(what) = without_columns
        && (options.column.is_some() || options.time_column.is_some())
    {
        return refused("column", what);
    }
    let is_text_table = matches!(
        format,
        RecordFormat::Table
            | RecordFormat::Csv
            | RecordFormat::TwoColumn
            | RecordFormat::OneColumn
            | RecordFormat::List
    );
    if !is_text_table && options.skip_rows > 0 {
        return refused("skip_rows", "a file that is no table in text");
    }
    let mut record = match format {
        RecordFormat::Peer => {
            let read = peer::parse(name, text::decode(name, bytes)?.as_ref(), options.dt);
            let is_told = options.format.is_some() || has_ending(name, &PEER_ENDINGS);
            let advice = "the file is read as peer because a line states NPTS and DT: \
                          format = \"table\" reads it as a table";
            read.map_err(|error| {
                if is_told {
                    error
                } else {
                    error.advised(advice)
                }
            })?
        }
        RecordFormat::Npy => axis::record(name, npy::parse(name, bytes)?, options)?,
        table if is_text_table => text_record(name, bytes, table, options)?,
        network => native::parse(name, text::decode(name, bytes)?.as_ref(), network, options)?,
    };
    record.source.format.get_or_insert(format);
    Ok(record)
}

/// Reads a table in text of which `format` says more or less.
fn text_record(
    name: &str,
    bytes: &[u8],
    format: RecordFormat,
    options: &ReadOptions,
) -> Result<Record, MotionError> {
    let settings = Settings {
        skip_rows: options.skip_rows,
        columns: match format {
            RecordFormat::OneColumn => Some(1),
            RecordFormat::TwoColumn => Some(2),
            _ => None,
        },
        reading_order: format == RecordFormat::List,
        separated: format == RecordFormat::Csv,
        named: format == RecordFormat::Csv || has_ending(name, &["csv", "tsv"]),
        counted: true,
    };
    let table = layout::parse(name, bytes, &settings)?;
    if format != RecordFormat::TwoColumn {
        return axis::record(name, table, options);
    }
    // Time and value, unless the names give the opposite order.
    let time = table.header.time().unwrap_or(0);
    let both = ReadOptions {
        time_column: Some(Column::Number(time + 1)),
        column: Some(Column::Number(2 - time)),
        ..options.clone()
    };
    axis::record(name, table, &both)
}

/// Reads a table of numbers: `.npy` or text.
///
/// # Errors
/// Those of [`MotionError`] that name a file.
pub fn parse_table(name: &str, bytes: &[u8]) -> Result<Table, MotionError> {
    check_size(name, bytes)?;
    let raw = if bytes.starts_with(MAGIC) || has_ending(name, &["npy"]) {
        npy::parse(name, bytes)?
    } else {
        let settings = Settings {
            named: true,
            ..Settings::default()
        };
        layout::parse(name, bytes, &settings)?
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

/// The format according to the name and the first lines.
fn detect(name: &str, bytes: &[u8]) -> RecordFormat {
    if bytes.starts_with(MAGIC) || has_ending(name, &["npy"]) {
        return RecordFormat::Npy;
    }
    if has_ending(name, &PEER_ENDINGS) {
        return RecordFormat::Peer;
    }
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    if let Some(network) = native::detect(&start) {
        return network;
    }
    if !has_ending(name, &["csv", "tsv"]) && peer::looks_like(&start) {
        return RecordFormat::Peer;
    }
    RecordFormat::Table
}

/// A table as read, with the places that error messages need.
#[derive(Debug, Default)]
pub(super) struct RawTable {
    /// The format that its layout turned out to be.
    format: Option<RecordFormat>,
    columns: usize,
    values: Vec<f64>,
    /// Line of each row.
    lines: Vec<usize>,
    /// How finely each column is written.
    prints: Vec<Print>,
    header: Header,
    /// Step in s that a line before the numbers states.
    stated_dt: Option<f64>,
    /// The text of its first row.
    first_row: String,
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

impl Print {
    /// Digits of one printed number, with a point or a comma.
    fn of(field: &str) -> Self {
        let (mantissa, exponent) = field
            .split_once(['e', 'E', 'd', 'D'])
            .map_or((field, 0), |(m, e)| (m, e.parse().unwrap_or(0)));
        let count = |text: &str| text.bytes().filter(u8::is_ascii_digit).count() as i32;
        let after = mantissa
            .split_once(['.', ','])
            .map_or(0, |(_, after)| count(after));
        let leading_zeros = mantissa
            .bytes()
            .filter(|b| !b".,-+".contains(b))
            .take_while(|b| *b == b'0')
            .count() as i32;
        Self {
            decimals: after.saturating_sub(exponent),
            digits: count(mantissa) - leading_zeros,
        }
    }

    /// The finer of both.
    fn widen(&mut self, other: Self) {
        self.decimals = self.decimals.max(other.decimals);
        self.digits = self.digits.max(other.digits);
    }
}

impl RawTable {
    fn column(&self, index: usize) -> impl Iterator<Item = f64> + '_ {
        self.values
            .iter()
            .skip(index)
            .step_by(self.columns.max(1))
            .copied()
    }

    fn names(&self) -> impl Iterator<Item = &String> {
        self.header.labels.iter().map(|label| &label.name)
    }

    fn into_table(self) -> Table {
        Table {
            names: self.names().cloned().collect(),
            columns: self.columns,
            values: self.values,
            warnings: self.warnings,
            header: self.header,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::assert_is;
    use proptest::prelude::*;

    pub(super) const FORMATS: [RecordFormat; 18] = [
        RecordFormat::Peer,
        RecordFormat::Table,
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

    /// Whatever comes back is a valid record.
    fn read_all_ways(bytes: &[u8]) {
        for format in FORMATS {
            for dt in [None, Some(0.01)] {
                let options = ReadOptions {
                    format: Some(format),
                    dt,
                    ..ReadOptions::default()
                };
                for (skip_rows, column) in [(0, None), (1, Some(Column::Number(2)))] {
                    let options = ReadOptions {
                        skip_rows,
                        column,
                        ..options.clone()
                    };
                    if let Ok(record) = parse_record("any.txt", bytes, &options) {
                        assert!(record.dt > 0.0 && record.dt.is_finite());
                        assert!(!record.values.is_empty());
                        assert!(record.values.iter().all(|v| v.is_finite()));
                        assert!(record.source.format.is_some());
                    }
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
        fn parser_keywords_never_panic(
            text in "([0-9]{1,9}|[-+.,;eEdD =\t\"*#]|\r\r\n|\n|NPTS|DT|SEC|UNITS OF|NaN|inf|é){0,80}"
        ) {
            read_all_ways(text.as_bytes());
        }

        #[test]
        fn headers_and_rows_never_panic(
            text in "(Time|t|Acc|# |sep=;|\\[ms\\]|\\(g\\)|cm/s/s|in|µs|0,5|1\\.5|1,000|3 0\\.1|4|[ ,;\t\"-]|\x1a|\x00|\n|\r\n){0,60}"
        ) {
            read_all_ways(text.as_bytes());
            let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
            read_all_ways(&[&b"\xfe\xff"[..], &wide].concat());
        }

        #[test]
        fn table_reads_back_in_every_form(
            values in prop::collection::vec(-900_i32..900, 3..40),
            between in prop::sample::select(vec![";", "\t", " ", "   ", ", "]),
            has_commas in any::<bool>(),
            (header, factor) in prop::sample::select(vec![
                (["", ""], 1.0),
                (["# time [ms]", "acc [g]"], 1e-3),
                (["Time, s", "a_g"], 1.0),
                (["Time (min)", "Acc (g)"], 60.0),
                (["t/ms", "a/g"], 1e-3),
            ]),
            rate in prop::sample::select(vec![50_u32, 100, 200, 256, 1000]),
            end in prop::sample::select(vec!["\n", "\r\n"]),
        ) {
            // A name with a comma needs quotes between commas, and wide gaps between blanks.
            let has_comma = header[0].contains(',');
            prop_assume!(!has_comma || (between != ", " && between != " "));
            let mut text = String::new();
            if !header[0].is_empty() {
                text.push_str(&format!("{}{between}{}{end}", header[0], header[1]));
            }
            let is_decimal = has_commas && between != ", ";
            for (i, value) in values.iter().enumerate() {
                let time = i as f64 / (f64::from(rate) * factor);
                let row = format!("{time:.9}|{:.2}", f64::from(*value) / 100.0);
                let row = if is_decimal { row.replace('.', ",") } else { row };
                text.push_str(&(row.replace('|', between) + end));
            }
            let read = parse_record("a.txt", text.as_bytes(), &ReadOptions::default());
            let read = read.unwrap_or_else(|error| panic!("{text}\n{error}"));
            let wanted: Vec<f64> = values.iter().map(|v| f64::from(*v) / 100.0).collect();
            prop_assert_eq!(read.values, wanted);
            // Half a unit of the ninth decimal, in minutes, of steps of a millisecond.
            prop_assert!((read.dt * f64::from(rate) - 1.0).abs() < 1e-4, "{} {}", read.dt, text);
            prop_assert_eq!(read.unit, (!header[0].is_empty()).then_some(Unit::Gravity));
        }

        #[test]
        fn peer_header_before_any_text_never_panics(tail in "[-+.0-9eE \n*]{0,200}", npts in any::<u64>()) {
            let text = format!("a\nb\nACCELERATION TIME HISTORY IN UNITS OF G\nNPTS= {npts}, DT= .01 SEC\n{tail}");
            read_all_ways(text.as_bytes());
        }

        #[test]
        fn npy_header_before_any_bytes_never_panics(
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
    fn name_and_first_lines_set_the_format() {
        for (name, text, format) in [
            ("RSN6.AT2", "", RecordFormat::Peer),
            ("rsn6.vt2", "", RecordFormat::Peer),
            ("a.npy", "", RecordFormat::Npy),
            (
                "a.txt",
                "t\nx\ny\n 2 .01 NPTS, DT\n1 2\n",
                RecordFormat::Peer,
            ),
        ] {
            assert_eq!(detect(name, text.as_bytes()), format, "{name} {text}");
        }
        for (name, text, format) in [
            ("a.CSV", "t,a\n0,1\n1,2\n", RecordFormat::Csv),
            ("a.dat", "1\n2\n", RecordFormat::OneColumn),
            ("a", "# x\n0.0 1\n0.1 2\n", RecordFormat::TwoColumn),
            ("a.txt", "0, 1\n1, 2\n", RecordFormat::Csv),
            ("a.csv", "0 1\n1 2\n", RecordFormat::TwoColumn),
            ("a.txt", "t x y\n0 1 2\n1 2 3\n", RecordFormat::Table),
            ("a.txt", "3 0.1\n0 1 2\n", RecordFormat::List),
        ] {
            let options = ReadOptions {
                dt: (format != RecordFormat::List).then_some(1.0),
                column: (format == RecordFormat::Table).then(|| Column::Name("y".into())),
                ..ReadOptions::default()
            };
            let record = parse_record(name, text.as_bytes(), &options).unwrap();
            assert_eq!(record.source.format, Some(format), "{name} {text}");
        }
    }

    #[test]
    fn printed_digits_are_counted() {
        for (text, decimals, digits) in [
            ("0.010", 3, 2),
            ("0,010", 3, 2),
            ("12.5", 1, 3),
            (".1297983E-02", 9, 7),
            ("1e3", -3, 1),
            ("-7", 0, 1),
        ] {
            let print = Print::of(text);
            assert_eq!((print.decimals, print.digits), (decimals, digits), "{text}");
        }
    }

    #[test]
    fn empty_file_is_named() {
        for bytes in [&b""[..], b"\n\n", b"# only a comment\n"] {
            let error = parse_record("quiet.txt", bytes, &ReadOptions::default()).unwrap_err();
            assert_is!(error => MotionError::Empty { file } if file == "quiet.txt");
        }
    }

    #[test]
    fn step_must_be_positive_from_any_source() {
        for dt in [0.0, -0.01, f64::NAN, f64::INFINITY] {
            let options = ReadOptions {
                dt: Some(dt),
                ..ReadOptions::default()
            };
            let error = parse_record("a.txt", b"1\n2\n", &options).unwrap_err();
            assert!(matches!(error, MotionError::Parameter(out) if out.name == "dt_s"));
        }
    }

    #[test]
    fn load_table_reads_back_by_rows() {
        let table = parse_table("load.csv", b"f1,f2\n1,2\n3,4\n5,6\n").unwrap();
        assert_eq!(table.names, ["f1", "f2"]);
        assert_eq!((table.rows(), table.columns), (3, 2));
        assert_eq!(table.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let table = parse_table("load.txt", b"north east\n1 2\n3 4\n").unwrap();
        assert_eq!((table.rows(), table.names.len()), (2, 2));
        assert!(table.warnings[0].contains("header"));
    }
}
