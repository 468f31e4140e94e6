//! From a table to a record: which column is time, which is the signal, and is the time uniform.
//!
//! Printed times are rounded, so a column of times is judged against the digits it is printed with: a file of
//! 1024 Hz whose times have three decimals is uniform, one in which a line is missing is not. Where most steps
//! are equal, the others must recur at equal distances, as rounding makes them, or they are refused.

use super::peer::chosen_step;
use super::{Column, Print, RawTable, ReadOptions, Record};
use crate::motion::error::MotionError;
use crate::motion::unit::{Unit, is_second, is_time_but_no_second};

/// Chooses the columns and makes a record of them.
pub(super) fn record(
    name: &str,
    table: RawTable,
    options: &ReadOptions,
) -> Result<Record, MotionError> {
    let (time, value) = columns(name, &table, options)?;
    let mut warnings = table.warnings.clone();
    let stated = match time {
        None => None,
        Some(time) => {
            if let (Some(title), None) = (table.names.get(time), options.dt)
                && states_no_seconds(title)
            {
                return Err(MotionError::TimeUnit {
                    file: name.into(),
                    column: title.clone(),
                });
            }
            let axis = uniform(name, &table, time)?;
            // Many files begin with their first step; more than that is worth a word.
            if axis.first.abs() > 1.5 * axis.dt {
                warnings.push(format!(
                    "{name}: its times begin at {} s; that is taken as the start",
                    axis.first
                ));
            }
            if let (Some(slack), None) = (axis.doubt, options.dt) {
                warnings.push(format!(
                    "{name}: its step of {:.6} s is inferred from rounded times, to ± {slack:.1e} s; dt_s states it",
                    axis.dt
                ));
            }
            Some(axis.dt)
        }
    };
    let dt = chosen_step(name, stated, options.dt, &mut warnings)?;
    let title = table.names.get(value).cloned().unwrap_or_default();
    Ok(Record {
        dt,
        values: table.column(value).collect(),
        unit: unit_in(&title),
        title,
        warnings,
    })
}

/// Index of the column of times, if there is one, and of the column of values.
fn columns(
    name: &str,
    table: &RawTable,
    options: &ReadOptions,
) -> Result<(Option<usize>, usize), MotionError> {
    let find = |column: &Column| find(name, table, column);
    let value = options.column.as_ref().map(find).transpose()?;
    let time = options.time_column.as_ref().map(find).transpose()?;
    if let (Some(value), true) = (value, time == value) {
        return Err(MotionError::ColumnForBoth {
            file: name.into(),
            number: value + 1,
        });
    }
    let time = time.or_else(|| {
        if table.names.is_empty() {
            // Without names the first of several columns is the time.
            (table.columns > 1 && value != Some(0)).then_some(0)
        } else {
            let named = table.names.iter().position(|n| is_time(n));
            named.filter(|t| value != Some(*t))
        }
    });
    if let Some(value) = value {
        return Ok((time, value));
    }
    let mut others = (0..table.columns).filter(|i| Some(*i) != time);
    match (others.next(), others.next()) {
        (Some(only), None) => Ok((time, only)),
        _ => Err(MotionError::ColumnChoice {
            file: name.into(),
            available: available(table),
        }),
    }
}

fn find(name: &str, table: &RawTable, column: &Column) -> Result<usize, MotionError> {
    let (found, wanted) = match column {
        Column::Name(text) => {
            let mut named = (0..).zip(&table.names).filter(|(_, n)| *n == text);
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
    if table.names.is_empty() {
        return format!("{} column(s) without names", table.columns);
    }
    let mut list = table
        .names
        .iter()
        .take(SHOWN)
        .map(|n| format!("{n:?}"))
        .collect::<Vec<_>>()
        .join(", ");
    if table.names.len() > SHOWN {
        list.push_str(&format!(" and {} more", table.names.len() - SHOWN));
    }
    list
}

/// `t`, `time`, `time_s`, `Time (s)`, `time [sec]`.
pub(super) fn is_time(name: &str) -> bool {
    let plain: String = name
        .to_ascii_lowercase()
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .collect();
    matches!(
        plain.as_str(),
        "t" | "ts" | "time" | "times" | "timesec" | "tsec" | "timeseconds" | "seconds"
    )
}

/// `time (ms)`, `t [min]`, `time_ms`: what is in brackets must be seconds, what stands behind the name may be no other unit.
fn states_no_seconds(title: &str) -> bool {
    match in_brackets(title) {
        Some(inner) => !is_second(inner),
        None => {
            let mut words = title.split(|c: char| !c.is_alphanumeric());
            words.next_back().is_some_and(is_time_but_no_second)
        }
    }
}

/// The unit in the brackets of a column's name: `accel (g)`, `a [m/s2]`.
pub(super) fn unit_in(title: &str) -> Option<Unit> {
    in_brackets(title).and_then(Unit::from_header)
}

fn in_brackets(title: &str) -> Option<&str> {
    let (_, rest) = title.split_once(['(', '['])?;
    let (inner, _) = rest.split_once([')', ']'])?;
    Some(inner)
}

struct Axis {
    first: f64,
    dt: f64,
    /// By how much the step may be another, in s, where its times are unequal in print and too few to tell.
    doubt: Option<f64>,
}

/// Share of a step that it may be off without a word.
const KNOWN: f64 = 1e-3;

/// The step of a column of times, or the line that breaks it.
fn uniform(name: &str, table: &RawTable, column: usize) -> Result<Axis, MotionError> {
    let times: Vec<f64> = table.column(column).collect();
    let line = |row: usize| table.lines.get(row).copied().unwrap_or(row + 1);
    let broken = |row: usize, wanted: f64, found: f64| MotionError::NotUniform {
        file: name.into(),
        line: line(row),
        wanted,
        found,
    };
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
        return Err(MotionError::Empty { file: name.into() });
    };
    if times.len() < 2 {
        return Err(MotionError::StepMissing { file: name.into() });
    }
    let falls = |strictly: bool| {
        let fall = move |pair: &[f64]| pair[1] < pair[0] || (!strictly && pair[1] == pair[0]);
        let row = times.windows(2).position(fall)? + 1;
        Some(MotionError::NotRising {
            file: name.into(),
            line: line(row),
            before: times[row - 1],
            found: times[row],
        })
    };
    // Print may make later times equal, never earlier.
    if let Some(error) = falls(true) {
        return Err(error);
    }
    let print = table.prints.get(column).copied().unwrap_or_default();
    let rounding = Rounding(print);
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2];
    // Rows whose step from the row before is not the usual one, beyond what the print explains by its digits alone.
    let odd: Vec<usize> = steps
        .iter()
        .zip(times.windows(2))
        .enumerate()
        .filter(|(_, (step, pair))| {
            let slack = rounding.by_digits(pair[0]) + rounding.by_digits(pair[1]);
            (*step - median).abs() > slack + 1e-3 * median.abs()
        })
        .map(|(i, _)| i + 1)
        .collect();
    // The median names the one line that is off, where the mean would blame them all.
    let mostly_equal = 4 * odd.len() <= steps.len();
    if let Some(&row) = odd.first()
        && mostly_equal
        && !recurs(&odd)
    {
        return Err(broken(row, median, steps[row - 1]));
    }
    let intervals = (times.len() - 1) as f64;
    let mean = (last - first) / intervals;
    if mean == 0.0
        && let Some(error) = falls(false)
    {
        return Err(error);
    }
    if !(mean > 0.0 && mean.is_finite()) {
        return Err(broken(1, mean, steps[0]));
    }
    // Against the mean: slow drift, which single steps hide in their rounding.
    for (row, time) in times.iter().enumerate() {
        let wanted = first + mean * row as f64;
        let slack = rounding.of(*time) + rounding.of(first) + rounding.of(last) + 1e-3 * mean;
        if (time - wanted).abs() > slack {
            return Err(broken(row, wanted, *time));
        }
    }
    let slack = (rounding.of(first) + rounding.of(last)) / intervals;
    let is_unequal = !odd.is_empty();
    Ok(Axis {
        first,
        dt: plain(mean, slack),
        doubt: (is_unequal && slack > KNOWN * mean).then_some(slack),
    })
}

/// True if the rows recur at distances that differ by one at most, at least three times.
fn recurs(rows: &[usize]) -> bool {
    let gaps = || rows.windows(2).map(|pair| pair[1] - pair[0]);
    match (gaps().min(), gaps().max(), rows.first()) {
        (Some(least), Some(most), Some(first)) => {
            rows.len() >= 3 && most - least <= 1 && *first <= most + 1
        }
        _ => false,
    }
}

/// What rounding in print can have done to a number.
struct Rounding(Print);

impl Rounding {
    /// Half a unit of the last digit.
    fn of(&self, value: f64) -> f64 {
        (0.5 * power_of_ten(-self.0.decimals)).max(self.by_digits(value))
    }

    /// Half a unit of the last significant digit, where these and not the decimals limit the print; else 0.
    fn by_digits(&self, value: f64) -> f64 {
        let size = value.abs();
        if size == 0.0 {
            return 0.0;
        }
        let leading = libm::floor(libm::log10(size)) as i32;
        let unit = power_of_ten(leading + 1 - self.0.digits);
        if unit > 1.5 * power_of_ten(-self.0.decimals) {
            0.5 * unit
        } else {
            0.0
        }
    }
}

fn power_of_ten(power: i32) -> f64 {
    libm::pow(10.0, f64::from(power.clamp(-300, 300)))
}

/// The number a person meant by `dt`, known to ± `slack`: a whole rate, else the shortest decimal, else itself.
fn plain(dt: f64, slack: f64) -> f64 {
    let slack = slack.max(4.0 * f64::EPSILON * dt);
    let whole_rate = 1.0 / (1.0 / dt).round();
    if (whole_rate - dt).abs() <= slack {
        return whole_rate;
    }
    (0..12)
        .filter_map(|digits: usize| format!("{dt:.digits$e}").parse::<f64>().ok())
        .find(|short| (short - dt).abs() <= slack)
        .unwrap_or(dt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::read::{RecordFormat, parse_record};

    fn read(name: &str, text: &str) -> Result<Record, MotionError> {
        parse_record(name, text.as_bytes(), &ReadOptions::default())
    }

    fn two_columns(times: impl Iterator<Item = String>) -> String {
        times.map(|t| format!("{t}  0.5\n")).collect()
    }

    #[test]
    fn a_csv_is_read_by_name_and_by_number() {
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
        assert_eq!(
            with(Column::Name("up".into())).unwrap_err().to_string(),
            "a.csv: no column \"up\": it has \"time (s)\", \"east (g)\", \"north (g)\""
        );
        assert_eq!(
            with(Column::Number(4)).unwrap_err().to_string(),
            "a.csv: no column 4: it has \"time (s)\", \"east (g)\", \"north (g)\""
        );
        assert!(with(Column::Number(0)).is_err());
        assert_eq!(
            read("a.csv", text).unwrap_err().to_string(),
            "a.csv: which column? choose one with column = { name = \"…\" } or { number = 1 }: it has \"time (s)\", \"east (g)\", \"north (g)\""
        );
    }

    #[test]
    fn a_name_that_two_columns_have_and_one_column_for_times_and_values_are_refused() {
        let refused = |text: &str, column: Column, time_column: Option<Column>| {
            let options = ReadOptions {
                column: Some(column),
                time_column,
                ..ReadOptions::default()
            };
            let refused = parse_record("a.csv", text.as_bytes(), &options);
            refused.unwrap_err().to_string()
        };
        let named = |name: &str| Column::Name(name.into());
        let twice = "t,a,a\n0.00,1,5\n0.01,2,10\n";
        assert_eq!(
            refused(twice, named("a"), None),
            "a.csv: columns 2 and 3 are both called \"a\": choose one by column = { number = 2 }"
        );
        for (value, time) in [(named("t"), named("t")), (Column::Number(1), named("t"))] {
            assert_eq!(
                refused("t,a\n0.00,1\n0.01,2\n", value, Some(time)),
                "a.csv: column 1 is asked for as the times and as the values"
            );
        }
    }

    #[test]
    fn a_column_without_times_needs_a_step() {
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
    fn a_list_is_read_in_reading_order() {
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
        assert_eq!(
            parse_record("a.txt", b"1 2 3\n4 5 6\n", &strict)
                .unwrap_err()
                .to_string(),
            "a.txt:1: wanted 1 columns, found 3"
        );
    }

    #[test]
    fn a_comma_that_makes_one_column_more_between_blanks_is_told_as_a_decimal_comma() {
        let options = ReadOptions {
            format: Some(RecordFormat::TwoColumn),
            ..ReadOptions::default()
        };
        let refused = |text: &str| {
            let read = parse_record("a.txt", text.as_bytes(), &options);
            read.unwrap_err().to_string()
        };
        let comma = |place: &str, number: &str| {
            format!(
                "a.txt:{place}: wanted a decimal point, found a comma inside a number (a decimal comma?): {number:?}"
            )
        };
        assert_eq!(refused("0,00 0,5\n0,01 0,6\n"), comma("1:2", "0,00"));
        assert_eq!(refused("0 0.5\n0,01 0.6\n"), comma("2:2", "0,01"));
        let one = ReadOptions {
            format: Some(RecordFormat::OneColumn),
            dt: Some(0.1),
            ..ReadOptions::default()
        };
        let read = parse_record("a.txt", b"0,5\n0,6\n", &one);
        assert_eq!(read.unwrap_err().to_string(), comma("1:2", "0,5"));
        // Where commas part the columns it is a column more.
        for text in ["0,0.5\n1,0,6\n", "0, 0.5\n1, 0, 6\n"] {
            assert_eq!(refused(text), "a.txt:2: wanted 2 columns, found 3");
        }
    }

    #[test]
    fn times_in_another_unit_than_the_second_are_refused_unless_the_step_is_given() {
        let refused = |name: &str, text: &str, options: &ReadOptions| {
            let error = parse_record(name, text.as_bytes(), options).unwrap_err();
            let text = error.to_string();
            assert!(text.contains("but s is wanted"), "{text}");
        };
        let chosen = |column: &str| ReadOptions {
            column: Some(Column::Number(2)),
            time_column: Some(Column::Name(column.into())),
            ..ReadOptions::default()
        };
        let usual = ReadOptions::default();
        for time in [
            "time (ms)",
            "t [min]",
            "time_ms",
            "time (samples)",
            "Time_µs",
        ] {
            let text = format!("{time},acc (g)\n0,1\n10,2\n20,3\n");
            refused("a.csv", &text, &chosen(time));
            let given = ReadOptions {
                dt: Some(0.01),
                ..chosen(time)
            };
            assert_eq!(
                parse_record("a.csv", text.as_bytes(), &given).unwrap().dt,
                0.01
            );
        }
        refused("a.txt", "time(ms) acc(g)\n0 1\n10 2\n20 3\n", &usual);
        for time in ["time (s)", "t[sec]", "Time_Seconds", "time", "at", "t_end"] {
            let text = format!("{time},acc (g)\n0,1\n10,2\n20,3\n");
            let read = parse_record("a.csv", text.as_bytes(), &chosen(time));
            assert_eq!(read.unwrap().dt, 10.0, "{time}");
        }
    }

    #[test]
    fn the_line_that_breaks_the_grid_is_named() {
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
        for (text, said) in [
            ("0 1\n0 1\n0 1\n", "found 0.0 s after 0.0 s"),
            ("2 1\n1 1\n0 1\n", "found 1.0 s after 2.0 s"),
            ("0 1\n-1e300 1\n", "found -1e300 s after 0.0 s"),
        ] {
            let wanted = format!("a.txt:2: times must rise from row to row, {said}");
            assert_eq!(read("a.txt", text).unwrap_err().to_string(), wanted);
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
    fn times_rounded_in_print_are_uniform_and_give_the_rate_meant() {
        for (rate, decimals) in [(1024.0, 3), (1024.0, 9), (50.0, 2), (4096.0, 6), (300.0, 4)] {
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
        // No whole rate: the shortest decimal.
        let text = two_columns((0..100).map(|i| format!("{:.4}", 0.0024 * f64::from(i))));
        assert_eq!(read("a.txt", &text).unwrap().dt, 0.0024);
    }

    #[test]
    fn a_step_that_rounded_times_leave_open_is_mentioned_unless_it_is_given() {
        let text = "0 1\n0.01 2\n0.03 3\n0.04 4\n";
        let record = read("a.txt", text).unwrap();
        let [warning] = record.warnings.as_slice() else {
            panic!("{:?}", record.warnings)
        };
        assert!(warning.contains("step of 0.013333 s"), "{warning}");
        assert!(warning.contains("± 3.3e-3 s"), "{warning}");
        let options = ReadOptions {
            dt: Some(0.0125),
            ..ReadOptions::default()
        };
        let given = parse_record("a.txt", text.as_bytes(), &options).unwrap();
        assert!(given.warnings.iter().all(|w| !w.contains("inferred")));
        // Equal in print, or many: nothing to tell.
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
        assert!(record.warnings[0].contains("begin at 5 s"));
        assert!(
            read("a.txt", "0.1 1\n0.2 2\n0.3 3\n")
                .unwrap()
                .warnings
                .is_empty()
        );
    }
}
