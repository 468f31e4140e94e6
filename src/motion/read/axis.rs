//! From a table to a record: which column is time, which is the signal, and what are their units.

use super::label::Label;
use super::peer::chosen_step;
use super::text::shorten;
use super::uniform::Times;
use super::{Column, RawTable, ReadOptions, Record, RecordSource};
use crate::error::{MotionError, Short};
use crate::unit::TimeUnit;

/// Chooses the columns and makes a record of them.
pub(super) fn record(
    name: &str,
    mut table: RawTable,
    options: &ReadOptions,
) -> Result<Record, MotionError> {
    // A column selected by name means that the words of the header are names.
    let is_name = |column: &Option<Column>| matches!(column, Some(Column::Name(_)));
    table.header.may_be_title &= !(is_name(&options.column) || is_name(&options.time_column));
    let chosen = Chosen::of(name, &table, options)?;
    let mut warnings = table.warnings.clone();
    let (time, value) = (chosen.time, chosen.value?);
    let stated = match time {
        Some(time) => step(name, &table, time, options, &mut warnings)?,
        None => table.stated_dt,
    };
    if chosen.is_assumed && time.is_some_and(|time| counts_rows(&table, time)) {
        warnings.push(format!(
            "{name}: its first column counts 0, 1, 2 … and is taken as times in s: if it counts rows, give time_column or dt_s"
        ));
    }
    let dt = chosen_step(name, stated, options.dt, &mut warnings)?;
    let label = table.header.label(value);
    let is_only = table.columns - usize::from(time.is_some()) == 1;
    let unit = table.header.unit_of(value, is_only);
    Ok(Record {
        dt,
        values: table.column(value).collect(),
        unit: unit.map(|(unit, _)| unit),
        title: label.map(|label| label.name.clone()).unwrap_or_default(),
        warnings,
        source: RecordSource {
            format: table.format,
            column: (table.columns > 1).then_some(value + 1),
            name: label
                .filter(|_| table.columns > 1)
                .map(|label| label.name.clone()),
            unit_line: unit.and_then(|(_, line)| line),
            ..RecordSource::default()
        },
    })
}

/// The step in s that a column of times states, if it states one.
fn step(
    name: &str,
    table: &RawTable,
    time: usize,
    options: &ReadOptions,
    warnings: &mut Vec<String>,
) -> Result<Option<f64>, MotionError> {
    let unknown = |line: Option<usize>, header: &str| MotionError::TimeUnit {
        file: name.into(),
        line,
        column: shorten(header),
    };
    let label = table.header.label(time);
    let unit = match label.map_or(Ok(None), Label::time_unit) {
        Ok(Some(unit)) => unit,
        Ok(None) => match (&table.header.other_time, options.dt) {
            (Some((line, text)), None) => return Err(unknown(Some(*line), text)),
            (Some(_), Some(_)) => return Ok(None),
            (None, _) => TimeUnit::SECOND,
        },
        Err(_) if options.dt.is_some() => return Ok(None),
        Err(_) => return Err(unknown(None, label.map_or("", |label| &label.name))),
    };
    let times = Times::of(name, table, time, unit);
    let axis = match (times.uniform(), options.dt) {
        (Ok(axis), _) => axis,
        (Err(error), None) => return Err(true_reason(name, table, error)),
        (Err(_), Some(dt)) => {
            let (line, off) = times.departure_from(dt);
            warnings.push(format!(
                "{name}: dt_s = {dt} overrules its times, which are not uniform: that of line {line} is off by {} s",
                Short(off)
            ));
            return Ok(None);
        }
    };
    // Many files begin with their first step; more than that is worth a word.
    if axis.first.abs() > 1.5 * axis.dt {
        warnings.push(format!(
            "{name}: its times begin at {} s; that is taken as the start",
            Short(axis.first)
        ));
    }
    if let (Some(slack), None) = (axis.doubt, options.dt) {
        warnings.push(format!(
            "{name}: its step of {} s is inferred from rounded times, to ± {slack:.1e} s; dt_s states it",
            Short(axis.dt)
        ));
    }
    match table
        .stated_dt
        .filter(|dt| (dt - axis.dt).abs() > 1e-3 * axis.dt)
    {
        Some(dt) if options.dt.is_none() => Err(MotionError::Header {
            file: name.into(),
            line: table.lines.first().copied().unwrap_or(1).saturating_sub(1),
            wanted: "the step of the times in the first column",
            found: dt.to_string(),
        }),
        _ => Ok(Some(axis.dt)),
    }
}

/// Why times are not uniform: the first row may state a wrong count, or commas may have cut numbers in two: `0,5` and `0,6`
/// are two columns, or one.
fn true_reason(name: &str, table: &RawTable, error: MotionError) -> MotionError {
    if let (Some(announced), MotionError::NotRising { line, .. }) = (stated_count(table), &error)
        && table.lines.get(1) == Some(line)
    {
        return MotionError::Count {
            file: name.into(),
            announced,
            found: table.values.len() - 2,
        };
    }
    let is_whole = table.prints.iter().all(|print| print.decimals <= 0);
    let may_be = table.columns == 2 && is_whole && table.header.labels.is_empty();
    match table.first_row.find(',') {
        Some(at) if may_be && !table.first_row.contains([' ', ';']) => MotionError::DecimalComma {
            file: name.into(),
            line: table.lines.first().copied().unwrap_or(1),
            column: at + 1,
            found: table.first_row.clone(),
        },
        _ => error,
    }
}

/// The count in a first row such as `400 0.01`.
fn stated_count(table: &RawTable) -> Option<usize> {
    let mut words = table.first_row.split_whitespace();
    let (count, step, end) = (words.next()?.parse().ok()?, words.next()?, words.next());
    let step: f64 = step.parse().ok()?;
    (end.is_none() && step > 0.0 && step < 1.0).then_some(count)
}

/// Indices of the columns.
struct Chosen {
    time: Option<usize>,
    /// True if neither the options nor a name identify the column of times.
    is_assumed: bool,
    /// An error if the options and the names leave it open.
    value: Result<usize, MotionError>,
}

impl Chosen {
    fn of(name: &str, table: &RawTable, options: &ReadOptions) -> Result<Self, MotionError> {
        let find = |column: &Column| find(name, table, column);
        let value = options.column.as_ref().map(find).transpose()?;
        let time = options.time_column.as_ref().map(find).transpose()?;
        if let (Some(value), true) = (value, time == value) {
            return Err(MotionError::ColumnForBoth {
                file: name.into(),
                number: value + 1,
            });
        }
        let known = time.or_else(|| table.header.time().filter(|time| value != Some(*time)));
        let time = known.or_else(|| assumed_time(name, table, options, value));
        let value = value.map_or_else(
            || {
                let mut others = (0..table.columns).filter(|i| Some(*i) != time);
                match (others.next(), others.next()) {
                    (Some(only), None) => Ok(only),
                    _ => Err(MotionError::ColumnChoice {
                        file: name.into(),
                        available: available(table),
                    }),
                }
            },
            Ok,
        );
        Ok(Self {
            time,
            is_assumed: known.is_none(),
            value,
        })
    }
}

/// The first column, if no name identifies the times: it is the time unless the step is given and the column does not
/// rise.
fn assumed_time(
    name: &str,
    table: &RawTable,
    options: &ReadOptions,
    value: Option<usize>,
) -> Option<usize> {
    let header = &table.header;
    let is_open = header.labels.is_empty() || header.may_be_title;
    let may_be = is_open && table.columns > 1 && value != Some(0);
    let rises = || {
        let times = Times::of(name, table, 0, TimeUnit::SECOND);
        !matches!(times.uniform(), Err(MotionError::NotRising { .. }))
    };
    (may_be && (options.dt.is_none() || rises())).then_some(0)
}

/// True of a column of whole numbers from 0 or 1 on, each one more than that before it.
fn counts_rows(table: &RawTable, column: usize) -> bool {
    let mut numbers = table.column(column);
    let first = numbers.next().unwrap_or(f64::NAN);
    let is_next = |(number, i): (f64, u32)| number == first + f64::from(i);
    (first == 0.0 || first == 1.0) && numbers.zip(1..).all(is_next)
}

fn find(name: &str, table: &RawTable, column: &Column) -> Result<usize, MotionError> {
    let (found, wanted) = match column {
        Column::Name(text) => {
            let mut named = (0..).zip(table.names()).filter(|(_, n)| *n == text);
            let found = named.next().map(|(first, _)| first);
            if let (Some(first), Some((second, _))) = (found, named.next()) {
                return Err(MotionError::ColumnTwice {
                    file: name.into(),
                    column: text.clone(),
                    numbers: [first + 1, second + 1],
                });
            }
            (found, format!("{text:?}"))
        }
        Column::Number(number) => (
            number.checked_sub(1).filter(|i| *i < table.columns),
            number.to_string(),
        ),
    };
    found.ok_or_else(|| MotionError::ColumnUnknown {
        file: name.into(),
        wanted,
        available: available(table),
    })
}

/// The columns of a table, for a message.
fn available(table: &RawTable) -> String {
    const SHOWN: usize = 8;
    let count = table.header.labels.len();
    if count == 0 {
        return format!("{} column(s) without names", table.columns);
    }
    let shown = table.names().take(SHOWN).map(|name| format!("{name:?}"));
    let mut list = shown.collect::<Vec<_>>().join(", ");
    if count > SHOWN {
        list.push_str(&format!(" and {} more", count - SHOWN));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::{RecordFormat, parse_record};
    use crate::unit::Unit;
    use gusset_quantity::assert_is;

    fn read(name: &str, text: &str) -> Result<Record, MotionError> {
        parse_record(name, text.as_bytes(), &ReadOptions::default())
    }

    fn two_columns(times: impl Iterator<Item = String>) -> String {
        times.map(|t| format!("{t}  0.5\n")).collect()
    }

    #[test]
    fn csv_is_read_by_name_and_number() {
        let text = "time (s),east (g),north (g)\n0.00,1,10\n0.01,2,20\n0.02,3,30\n";
        let with = |column| {
            let options = ReadOptions {
                column: Some(column),
                ..ReadOptions::default()
            };
            parse_record("a.csv", text.as_bytes(), &options)
        };
        let north = with(Column::Name("north (g)".into())).unwrap();
        assert_eq!(north.values, [10.0, 20.0, 30.0]);
        assert_eq!((north.dt, north.unit), (0.01, Some(Unit::Gravity)));
        assert_eq!(with(Column::Number(2)).unwrap().values, [1.0, 2.0, 3.0]);
        assert_is!(
            with(Column::Name("up".into())).unwrap_err()
            => MotionError::ColumnUnknown { wanted, available, .. } if wanted.contains("up") && available.matches(" (").count() == 3
        );
        assert_is!(
            with(Column::Number(4)).unwrap_err()
            => MotionError::ColumnUnknown { wanted, .. } if wanted == "4"
        );
        assert!(with(Column::Number(0)).is_err());
        assert_is!(
            read("a.csv", text).unwrap_err()
            => MotionError::ColumnChoice { file, available } if file == "a.csv" && available.contains("north (g)")
        );
    }

    #[test]
    fn ambiguous_column_choices_are_refused() {
        let refused = |text: &str, column: Column, time_column: Option<Column>| {
            let options = ReadOptions {
                column: Some(column),
                time_column,
                ..ReadOptions::default()
            };
            parse_record("a.csv", text.as_bytes(), &options).unwrap_err()
        };
        let named = |name: &str| Column::Name(name.into());
        let twice = "t,a,a\n0.00,1,5\n0.01,2,10\n";
        assert_is!(
            refused(twice, named("a"), None)
            => MotionError::ColumnTwice { column, numbers: [2, 3], .. } if column == "a"
        );
        for (value, time) in [(named("t"), named("t")), (Column::Number(1), named("t"))] {
            assert_is!(
                refused("t,a\n0.00,1\n0.01,2\n", value, Some(time))
                => MotionError::ColumnForBoth { number: 1, .. }
            );
        }
    }

    #[test]
    fn column_without_times_needs_a_step() {
        for (name, text) in [("a.csv", "accel\n1\n2\n"), ("a.txt", "1\n2\n")] {
            assert!(matches!(
                read(name, text).unwrap_err(),
                MotionError::StepMissing { .. }
            ));
            let options = ReadOptions {
                dt: Some(0.02),
                ..ReadOptions::default()
            };
            let record = parse_record(name, text.as_bytes(), &options).unwrap();
            assert_eq!((record.dt, record.values), (0.02, vec![1.0, 2.0]));
        }
    }

    #[test]
    fn list_is_read_in_reading_order() {
        let options = ReadOptions {
            format: Some(RecordFormat::List),
            dt: Some(0.1),
            ..ReadOptions::default()
        };
        let record = parse_record("a.txt", b"1 2 3\n4\n5 6\n", &options).unwrap();
        assert_eq!(record.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        // One value a line means one.
        let strict = ReadOptions {
            format: Some(RecordFormat::OneColumn),
            ..options
        };
        let refused = parse_record("a.txt", b"1 2 3\n4 5 6\n", &strict).unwrap_err();
        assert_is!(refused => MotionError::Ragged { line: 1, wanted: 1, found: 3, .. });
    }

    #[test]
    fn extra_column_by_comma_is_a_decimal_comma() {
        let options = ReadOptions {
            format: Some(RecordFormat::TwoColumn),
            ..ReadOptions::default()
        };
        let refused = |text: &str| {
            let read = parse_record("a.txt", text.as_bytes(), &options);
            read.unwrap_err()
        };
        let read = parse_record("a.txt", b"0,00 0,5\n0,01 0,6\n", &options).unwrap();
        assert_eq!((read.dt, read.values), (0.01, vec![0.5, 0.6]));
        assert_is!(
            refused("0 0.5\n0,01 0.6\n")
            => MotionError::DecimalComma { line: 2, column: 2, found, .. } if found == "0,01"
        );
        let one = ReadOptions {
            format: Some(RecordFormat::OneColumn),
            dt: Some(0.1),
            ..ReadOptions::default()
        };
        let read = parse_record("a.txt", b"0,5\n0,6\n", &one);
        assert_is!(read.unwrap_err() => MotionError::DecimalComma { line: 1, column: 2, .. });
        // Where commas part the columns it is a column more.
        for text in ["0,0.5\n1,0,6\n", "0, 0.5\n1, 0, 6\n"] {
            assert_is!(refused(text) => MotionError::Ragged { line: 2, wanted: 2, found: 3, .. });
        }
    }

    #[test]
    fn time_units_in_any_header_are_converted() {
        for (text, dt) in [
            ("Time [min]  Displacement [mm]\n0 1\n0.5 2\n1 3\n", 30.0),
            ("Time [msec] Disp\n0 1\n10 2\n20 3\n", 0.01),
            ("time_ms,acc\n0,1\n10,2\n20,3\n", 0.01),
            ("Time (ms),acc\n0,1\n10,2\n20,3\n", 0.01),
            ("\"Time, s\";acc\n0;1\n0,5;2\n1;3\n", 0.5),
            ("t/s a/g\n0 1\n0.5 2\n1 3\n", 0.5),
            ("Time  Acc\n(ms)  (g)\n0 1\n10 2\n20 3\n", 0.01),
            ("# time [ms], acc [g]\n0 1\n10 2\n20 3\n", 0.01),
            ("Time_µs acc\n0 1\n500 2\n1000 3\n", 0.0005),
            ("Time [ms]  Acc\n0,1\n10,2\n20,3\n", 0.01),
            ("t,acc\nms,g\n0,1\n3.90625,2\n7.8125,3\n", 1.0 / 256.0),
        ] {
            let read = read("a.txt", text).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_eq!((read.dt, read.values), (dt, vec![1.0, 2.0, 3.0]), "{text}");
        }
    }

    #[test]
    fn value_units_in_any_header_are_used() {
        for (text, unit) in [
            (
                "Acceleration in cm/s/s\n0 1\n1 2\n",
                Some(Unit::CentimetrePerSecond2),
            ),
            ("Time Acc\n(s) (gal)\n0 1\n1 2\n", Some(Unit::Gal)),
            ("# units: g\n# time acc\n0 1\n1 2\n", Some(Unit::Gravity)),
            ("t,Disp_mm\n0,1\n1,2\n", Some(Unit::Millimetre)),
            ("# Units: s, g\n0 1\n1 2\n", Some(Unit::Gravity)),
            ("Borehole at a depth of 5 m\n0 1\n1 2\n", None),
            ("t a\n0 1\n1 2\n", None),
            // Two units: whose?
            ("acc in g, disp in mm\nt a\n0 1\n1 2\n", None),
        ] {
            assert_eq!(read("a.txt", text).unwrap().unit, unit, "{text}");
        }
    }

    #[test]
    fn unknown_time_unit_needs_a_given_step() {
        for text in [
            "time (samples),acc (g)\n0,1\n10,2\n20,3\n",
            "recorded with time in ms\nt a\n0 1\n10 2\n20 3\n",
            "Minutes acc\n0 1\n10 2\n20 3\n",
            "Time|ms acc\n0 1\n10 2\n20 3\n",
            "Time.ms acc\n0 1\n10 2\n20 3\n",
        ] {
            let error = read("a.txt", text).unwrap_err();
            assert!(matches!(error, MotionError::TimeUnit { .. }), "{error}");
            let given = ReadOptions {
                dt: Some(0.01),
                ..ReadOptions::default()
            };
            let read = parse_record("a.txt", text.as_bytes(), &given).unwrap();
            assert_eq!((read.dt, read.values.len()), (0.01, 3));
        }
        for time in ["time (s)", "t[sec]", "Time_Seconds", "time", "at", "t_end"] {
            let text = format!("{time},acc (g)\n0,1\n10,2\n20,3\n");
            let chosen = ReadOptions {
                column: Some(Column::Number(2)),
                time_column: Some(Column::Name(time.into())),
                ..ReadOptions::default()
            };
            let read = parse_record("a.csv", text.as_bytes(), &chosen);
            assert_eq!(read.unwrap().dt, 10.0, "{time}");
        }
    }

    #[test]
    fn latin_1_header_keeps_its_units() {
        let text = b"t_\xb5s a_m/s\xb2\n0 1\n500 2\n";
        let record = parse_record("a.txt", text, &ReadOptions::default()).unwrap();
        assert_eq!(
            (record.dt, record.unit),
            (0.0005, Some(Unit::MetrePerSecond2))
        );
    }

    #[test]
    fn any_number_of_columns_between_blanks() {
        let text = "0.00 1.0e-3 2 3\n0.01 4 5 6\n0.02 7 8 9\n";
        let third = ReadOptions {
            column: Some(Column::Number(3)),
            ..ReadOptions::default()
        };
        let record = parse_record("disp.out", text.as_bytes(), &third).unwrap();
        assert_eq!((record.dt, record.values), (0.01, vec![2.0, 5.0, 8.0]));
        assert_eq!(record.source.column, Some(3));
        assert!(matches!(
            read("disp.out", text).unwrap_err(),
            MotionError::ColumnChoice { .. }
        ));
        // No column of times: the step is given.
        let given = ReadOptions {
            dt: Some(0.02),
            ..third
        };
        let record = parse_record("a.out", b"1 2 3\n-1 5 6\n0 8 9\n", &given).unwrap();
        assert_eq!((record.dt, record.values), (0.02, vec![3.0, 6.0, 9.0]));
        assert!(record.warnings.is_empty(), "{:?}", record.warnings);
    }

    #[test]
    fn given_step_overrules_times() {
        let given = ReadOptions {
            dt: Some(0.01),
            ..ReadOptions::default()
        };
        let text = "t a\n0 1\n0.01 2\n0.05 3\n0.04 4\n";
        let record = parse_record("a.txt", text.as_bytes(), &given).unwrap();
        assert_eq!((record.dt, record.values.len()), (0.01, 4));
        let told = record.warnings.iter().find(|w| w.contains("overrules"));
        let told = told.unwrap_or_else(|| panic!("{:?}", record.warnings));
        assert!(told.contains("line 4") && told.contains("0.03 s"), "{told}");
    }

    #[test]
    fn count_and_step_before_values_are_used() {
        let record = read("a.txt", "Some title\n4 0.005\n0.1\n0.2\n0.3\n0.4\n").unwrap();
        assert_eq!((record.dt, record.values.len()), (0.005, 4));
        let both = "3 0.02\n0.00 1\n0.01 2\n0.02 3\n";
        assert!(matches!(
            read("a.txt", both).unwrap_err(),
            MotionError::Header { line: 1, .. }
        ));
    }

    #[test]
    fn commas_without_rising_times_are_decimals() {
        assert!(matches!(
            read("a.txt", "0,5\n0,6\n0,2\n").unwrap_err(),
            MotionError::DecimalComma {
                line: 1,
                column: 2,
                ..
            }
        ));
        assert_eq!(read("a.txt", "0,5\n1,6\n2,2\n").unwrap().dt, 1.0);
    }

    #[test]
    fn line_that_breaks_the_grid_is_named() {
        // Lines 1..=10, then 0.11 on line 11 where 0.10 should be (one line is missing).
        let text = two_columns(
            (0..40)
                .filter(|i| *i != 10)
                .map(|i| format!("{:.2}", 0.01 * f64::from(i))),
        );
        match read("a.txt", &text).unwrap_err() {
            MotionError::NotUniform {
                line,
                wanted,
                found,
                ..
            } => {
                assert_eq!(line, 11);
                assert!((wanted - 0.01).abs() < 1e-12 && (found - 0.02).abs() < 1e-12);
            }
            other => panic!("{other}"),
        }
        for (text, times) in [
            ("0 1\n0 1\n0 1\n", [0.0, 0.0]),
            ("2 1\n1 1\n0 1\n", [2.0, 1.0]),
            ("0 1\n-1e300 1\n", [0.0, -1e300]),
        ] {
            let refused = read("a.txt", text).unwrap_err();
            assert_is!(
                refused
                => MotionError::NotRising { line: 2, before, found, .. } if [*before, *found] == times
            );
        }
        // A step that grows by 1e-3 of itself each line hides in no rounding.
        let text = two_columns(
            (0..50).map(|i| format!("{:.9}", 0.01 * f64::from(i) + 5e-6 * f64::from(i * i))),
        );
        assert!(matches!(
            read("a.txt", &text).unwrap_err(),
            MotionError::NotUniform { .. }
        ));
    }

    #[test]
    fn rounded_times_give_the_intended_rate() {
        for (rate, decimals) in [
            (1024.0, 3),
            (1024.0, 9),
            (50.0, 2),
            (4096.0, 6),
            (300.0, 4),
            (256.0, 4),
            (256.0, 5),
            (240.0, 3),
            (240.0, 4),
            (150.0, 3),
            (128.0, 3),
            (128.0, 6),
            (1.0 / 0.007, 3),
        ] {
            let text =
                two_columns((0..5000).map(|i| format!("{:.decimals$}", f64::from(i) / rate)));
            let record = read("a.txt", &text).unwrap();
            assert_eq!(record.dt, 1.0 / rate, "{rate} Hz with {decimals} decimals");
        }
        // Six significant digits, trailing zeros dropped, as printf's %g does: 10.0005 s is the finest there.
        let text = two_columns((0..12_000).map(|i| {
            let t = f64::from(i) / 1000.0;
            format!("{t}")
        }));
        assert_eq!(read("a.txt", &text).unwrap().dt, 0.001);
        // Equal in print: the step is what is printed, not the whole rate beside it.
        for step in [0.03, 0.06, 0.15] {
            let text = two_columns((0..4).map(|i| format!("{:.2}", step * f64::from(i))));
            assert_eq!(read("a.txt", &text).unwrap().dt, step);
        }
        // No whole rate: the shortest decimal.
        let text = two_columns((0..100).map(|i| format!("{:.4}", 0.0024 * f64::from(i))));
        assert_eq!(read("a.txt", &text).unwrap().dt, 0.0024);
    }

    #[test]
    fn whole_rate_far_from_the_mean_is_found() {
        let text = two_columns((0..2000).map(|i| format!("{:.2E}", f64::from(i) / 1024.0)));
        assert_eq!(read("a.txt", &text).unwrap().dt, 1.0 / 1024.0);
    }

    #[test]
    fn step_left_open_by_repeats_is_reported() {
        let rows = (0..6000).filter(|i| *i != 3000);
        let text = two_columns(rows.map(|i| format!("{:.2}", f64::from(i) / 500.0)));
        let warnings = read("a.txt", &text).unwrap().warnings;
        assert!(
            warnings.iter().any(|w| w.contains("inferred")),
            "{warnings:?}"
        );
    }

    #[test]
    fn wrong_count_before_pairs_is_reported() {
        let text = format!("151 0.01\n{}", "0.3 0.2\n0.1 0.4\n0.2 0.1\n".repeat(25));
        match read("a.txt", &text).unwrap_err() {
            MotionError::Count {
                announced, found, ..
            } => assert_eq!((announced, found), (151, 150)),
            other => panic!("{other}"),
        }
    }

    #[test]
    fn missing_row_among_rounded_times_is_named() {
        for (rate, decimals) in [(256.0, 4), (240.0, 3), (100.0, 2), (200.0, 3), (1024.0, 4)] {
            for missing in [3, 100, 498] {
                let rows = (0..500).filter(|i| *i != missing);
                let text = two_columns(rows.map(|i| format!("{:.decimals$}", f64::from(i) / rate)));
                match read("a.txt", &text).unwrap_err() {
                    MotionError::NotUniform { line, .. } => {
                        assert_eq!(line, missing as usize + 1, "{rate} Hz, {decimals}");
                    }
                    other => panic!("{other}"),
                }
            }
        }
    }

    #[test]
    fn single_precision_times_are_uniform() {
        let rows = (0..20_000).map(|i| f64::from((0.005 * f64::from(i)) as f32).to_string());
        let record = read("a.txt", &two_columns(rows)).unwrap();
        assert_eq!(record.dt, 0.005);
        assert!(record.warnings.is_empty(), "{:?}", record.warnings);
    }

    #[test]
    fn step_left_open_by_rounding_is_reported() {
        let text = "0 1\n0.01 2\n0.03 3\n0.04 4\n";
        let record = read("a.txt", text).unwrap();
        let [warning] = record.warnings.as_slice() else {
            panic!("{:?}", record.warnings)
        };
        assert!(warning.contains(" 0.0133333 s"), "{warning}");
        assert!(warning.contains("± 3.3e-3 s"), "{warning}");
        let options = ReadOptions {
            dt: Some(0.0125),
            ..ReadOptions::default()
        };
        let given = parse_record("a.txt", text.as_bytes(), &options).unwrap();
        assert!(given.warnings.iter().all(|w| !w.contains("inferred")));
        // Equal in print, or many: nothing to report.
        assert!(
            read("a.txt", "0 1\n0.1 2\n0.2 3\n")
                .unwrap()
                .warnings
                .is_empty()
        );
        let many = two_columns((0..5000).map(|i| format!("{:.2}", f64::from(i) / 150.0)));
        assert!(read("a.txt", &many).unwrap().warnings.is_empty());
    }

    #[test]
    fn times_that_begin_late_are_mentioned() {
        let record = read("a.txt", "5.0 1\n5.1 2\n5.2 3\n").unwrap();
        assert!((record.dt - 0.1).abs() < 1e-15);
        assert!(record.warnings[0].contains(" 5 s"));
        assert!(
            read("a.txt", "0.1 1\n0.2 2\n0.3 3\n")
                .unwrap()
                .warnings
                .is_empty()
        );
    }
}
