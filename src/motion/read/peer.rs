//! PEER strong-motion files: `.AT2` (acceleration), `.VT2` (velocity), `.DT2` (displacement).
//!
//! A few lines of words, the last of which states the count and the step. Each generation of the database spells
//! that line in its own way:
//!
//! ```text
//! PEER NGA STRONG MOTION DATABASE RECORD
//! SOMEWHERE, 1/1/2001, STATION, 090
//! ACCELERATION TIME SERIES IN UNITS OF G
//! NPTS=  1559, DT= .02000 SEC      or   NPTS: 1559  DT: .02000
//! 3930 0.00500 NPTS, DT            or   NPTS, DT 3930 0.00500
//! 3930 0.00500                     the fourth line, after a line that states `UNITS OF`
//! ```
//!
//! `DT` may also be on the line below `NPTS`. Then come numbers in reading order, five to the line as `.1297983E-02` or eight as
//! Fortran's `8F10.5`, where a full field leaves no gap. A file with another count than it announces is damaged and refused, and so
//! is one with decimal commas: read as gaps, they would make whole numbers of its digits.

use std::ops::Range;

use super::text::{self, finite_number, lines, number, refuse_decimal_comma, shorten, words};
use super::{MOST_VALUES, Record, RecordSource, has_ending};
use crate::error::{MotionError, Short, inside};
use crate::unit::{Unit, is_time_but_no_second};

/// Lines among which the header must end.
const LONGEST_HEADER: usize = 40;

/// True if one of the first lines is the last of a PEER header.
pub(super) fn looks_like(start: &str) -> bool {
    let mut before = "";
    lines(start).take(LONGEST_HEADER).any(|(_, line)| {
        let upper = line.to_ascii_uppercase();
        let named = upper.contains("NPTS") && upper.contains("DT");
        let is_last = named || (is_series_title(before) && bare_counts(line).is_some());
        before = line;
        is_last
    })
}

/// `ACCELERATION TIME HISTORY IN UNITS OF G`: the line above that of the count and the step.
fn is_series_title(line: &str) -> bool {
    let upper = line.to_ascii_uppercase();
    upper.contains("UNITS OF") && (upper.contains("TIME HISTORY") || upper.contains("TIME SERIES"))
}

/// A whole count and a step below 1 s, alone on a line: `3930 0.00500`.
fn bare_counts(line: &str) -> Option<Counts> {
    let mut words = line.split_whitespace();
    let points = words.next()?.parse().ok().filter(|n| *n > 1)?;
    let dt = number(words.next()?).filter(|dt| *dt > 0.0 && *dt < 1.0)?;
    words.next().is_none().then_some(Counts {
        points: Some(points),
        dt: Some(dt),
    })
}

/// Reads the text of a file named `name`; `dt` overrules the header.
pub(super) fn parse(name: &str, text: &str, dt: Option<f64>) -> Result<Record, MotionError> {
    let mut warnings = Vec::new();
    let mut all = lines(text).peekable();
    let mut head: Vec<&str> = Vec::new();
    let counts = loop {
        let missing = |line: usize, found: &str| MotionError::Header {
            file: name.into(),
            line,
            wanted: "a header line with NPTS and DT",
            found: shorten(found),
        };
        let Some((line_number, line)) = all.next() else {
            if head.iter().all(|line| line.trim().is_empty()) {
                return Err(MotionError::Empty { file: name.into() });
            }
            return Err(missing(head.len(), head.last().copied().unwrap_or("")));
        };
        if line.to_ascii_uppercase().contains("NPTS") {
            let mut counts = Counts::read(name, line_number, line)?;
            if counts.dt.is_none()
                && let Some((below, line)) = all.peek().copied()
                && line.to_ascii_uppercase().contains("DT")
            {
                counts.dt = Counts::read(name, below, line)?.dt;
                all.next();
            }
            break counts;
        }
        if let (true, Some(counts)) = (
            head.last().is_some_and(|line| is_series_title(line)),
            bare_counts(line),
        ) {
            break counts;
        }
        if line_number >= LONGEST_HEADER {
            return Err(missing(line_number, line));
        }
        head.push(line);
    };

    let mut values = Vec::new();
    for (line_number, line) in all {
        read_numbers(name, line_number, line, &mut values)?;
        if values.len() > MOST_VALUES {
            return Err(MotionError::TooLarge {
                file: name.into(),
                what: "values",
                found: values.len(),
                limit: MOST_VALUES,
            });
        }
    }
    if values.is_empty() {
        return Err(MotionError::Empty { file: name.into() });
    }
    match counts.points {
        None => warnings.push(format!(
            "{name}: the header says no count; all {} values are used",
            values.len()
        )),
        Some(announced) if announced != values.len() => {
            return Err(MotionError::Count {
                file: name.into(),
                announced,
                found: values.len(),
            });
        }
        Some(_) => {}
    }
    let dt = chosen_step(name, counts.dt, dt, &mut warnings)?;
    let unit = unit(name, &head, &mut warnings);
    let stated = head.iter().find(|line| stated_unit(line).is_some());
    Ok(Record {
        dt,
        values,
        unit,
        title: title(&head),
        warnings,
        source: RecordSource {
            unknown_unit: stated
                .filter(|_| unit.is_none())
                .map(|line| text::shorten_to(line.trim(), 200)),
            ..RecordSource::default()
        },
    })
}

/// The step to use: the one given overrules the one stated.
pub(super) fn chosen_step(
    name: &str,
    stated: Option<f64>,
    given: Option<f64>,
    warnings: &mut Vec<String>,
) -> Result<f64, MotionError> {
    match (stated, given) {
        (None, None) => Err(MotionError::StepMissing { file: name.into() }),
        (Some(stated), None) => Ok(stated),
        (None, Some(given)) => Ok(given),
        (Some(stated), Some(given)) => {
            // Nine digits: more than any file prints of its step.
            let same = (stated - given).abs() <= 1e-9 * given;
            if !same {
                warnings.push(format!(
                    "{name}: the file says a step of {} s, dt_s = {given} overrules it",
                    Short(stated)
                ));
            }
            Ok(given)
        }
    }
}

/// Number of points and interval from the last line of the header.
struct Counts {
    points: Option<usize>,
    dt: Option<f64>,
}

impl Counts {
    fn read(file: &str, line_number: usize, line: &str) -> Result<Self, MotionError> {
        // A colon says what an equals sign says.
        let upper = line.to_ascii_uppercase().replace(':', "=");
        let names_end = upper.find("DT").map_or(upper.len(), |at| at + 2);
        let numbers = if upper.contains('=') {
            [value_of(&upper, "NPTS"), value_of(&upper, "DT")]
        } else {
            [0..upper.find("NPTS").unwrap_or(0), names_end..upper.len()]
        };
        for part in numbers {
            refuse_decimal_comma(file, line_number, line, part)?;
        }
        // `NPTS=` and `DT=` before their numbers, or `NPTS, DT` behind or before both.
        let (points, dt) = if upper.contains('=') {
            (after(&upper, "NPTS"), after(&upper, "DT"))
        } else {
            let pair = |text| {
                let mut numbers = words(text)
                    .map(|(_, word)| word)
                    .take_while(|word| number(word).is_some());
                (numbers.next(), numbers.next())
            };
            match pair(upper.split("NPTS").next().unwrap_or("")) {
                (None, None) => pair(upper.get(names_end..).unwrap_or("")),
                before => before,
            }
        };
        let refuse = |wanted, found: &str| MotionError::Header {
            file: file.into(),
            line: line_number,
            wanted,
            found: shorten(found),
        };
        // `DT = 5.0 MSEC`, `6 5.0 NPTS, DT (MSEC)`: one of the three words behind it.
        let (_, behind) = upper.split_once("DT").unwrap_or_default();
        let is_other = |word: &str| is_time_but_no_second(word.trim_matches(['(', ')', '[', ']']));
        if words(behind).take(3).any(|(_, word)| is_other(word)) {
            return Err(refuse("a time step DT in seconds", behind.trim()));
        }
        let points = points
            .map(|word| {
                // Some tools print the count as a real number.
                word.parse::<usize>()
                    .or_else(|_| word.trim_end_matches('0').trim_end_matches('.').parse())
                    .map_err(|_| refuse("a whole number of points after NPTS", word))
            })
            .transpose()?;
        let dt = dt
            .map(|word| match number(word) {
                Some(dt) => inside("DT", dt, dt > 0.0, "positive")
                    .map_err(|_| refuse("a positive time step DT", word)),
                None => Err(refuse("a time step after DT", word)),
            })
            .transpose()?;
        Ok(Self { points, dt })
    }
}

/// Range of the text after `key` and an equals sign, up to the next blank; empty if they are missing.
fn value_of(line: &str, key: &str) -> Range<usize> {
    let value = line.split_once(key).and_then(|(before, rest)| {
        let (blank, rest) = rest.split_once('=')?;
        let start =
            before.len() + key.len() + blank.len() + 1 + rest.len() - rest.trim_start().len();
        let word = rest.split_whitespace().next()?;
        blank.trim().is_empty().then_some(start..start + word.len())
    });
    value.unwrap_or(0..0)
}

/// The word that follows `key` and an equals sign.
fn after<'a>(line: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = line.split_once(key)?;
    let rest = rest.trim_start().strip_prefix('=')?;
    let word = words(rest).next().map(|(_, word)| word)?;
    // `DT=.0100SEC` leaves no gap.
    Some(word.strip_suffix("SEC").unwrap_or(word))
}

/// Appends the numbers of one line.
pub(super) fn read_numbers(
    file: &str,
    line_number: usize,
    line: &str,
    values: &mut Vec<f64>,
) -> Result<(), MotionError> {
    refuse_decimal_comma(file, line_number, line, 0..line.len())?;
    let before = values.len();
    for (start, word) in words(line) {
        if number(word).is_some() {
            values.push(finite_number(file, line_number, line, start, word)?);
        } else if let Some(several) = split_at_signs(word) {
            values.extend(several);
        } else if let Some(columns) = fixed_width(line) {
            values.truncate(before);
            values.extend(columns);
            return Ok(());
        } else {
            finite_number(file, line_number, line, start, word)?;
        }
    }
    Ok(())
}

/// Numbers that touch because the right one begins with its sign: `-0.00123-0.00456`; or one number whose
/// exponent of three digits pushed out its letter: `0.123-100`. `None` if the word is neither.
fn split_at_signs(word: &str) -> Option<Vec<f64>> {
    let mut parts = Vec::new();
    let mut start = 0;
    let bytes = word.as_bytes();
    for (at, pair) in bytes.windows(2).enumerate() {
        let is_inner_sign = (pair[1] == b'-' || pair[1] == b'+') && !b"eEdD".contains(&pair[0]);
        if is_inner_sign {
            parts.push(word.get(start..=at)?);
            start = at + 1;
        }
    }
    parts.push(word.get(start..)?);
    if let [mantissa, exponent] = parts.as_slice()
        && exponent.len() == 4
        && exponent[1..].bytes().all(|b| b.is_ascii_digit())
    {
        let value = number(&format!("{mantissa}e{exponent}"))?;
        return value.is_finite().then(|| vec![value]);
    }
    // Each must be a real number as Fortran prints it: with its point.
    parts
        .iter()
        .map(|part| {
            let value = number(part)?;
            (part.matches('.').count() == 1 && value.is_finite()).then_some(value)
        })
        .collect()
}

/// The line as equal fields with one point each, all at the same place: what `8F10.5` prints. `None` if it is not.
fn fixed_width(line: &str) -> Option<Vec<f64>> {
    let line = line.trim_end();
    if !line.is_ascii() {
        return None;
    }
    let points = line.bytes().filter(|&b| b == b'.').count();
    if points == 0 || !line.len().is_multiple_of(points) {
        return None;
    }
    let width = line.len() / points;
    let mut place = None;
    (0..points)
        .map(|i| {
            let field = line.get(i * width..(i + 1) * width)?;
            let point = field.find('.')?;
            let value = number(field.trim_start())?;
            (*place.get_or_insert(point) == point && value.is_finite()).then_some(value)
        })
        .collect()
}

/// The unit after `UNITS OF`, else the one that the ending of the name implies.
fn unit(name: &str, head: &[&str], warnings: &mut Vec<String>) -> Option<Unit> {
    if let Some(word) = &head.iter().find_map(|line| stated_unit(line)) {
        let unit = Unit::from_header(word);
        if unit.is_none() {
            warnings.push(format!(
                "{name}: the unit {:?} of the header is not known",
                shorten(word)
            ));
        }
        return unit;
    }
    let (unit, ending) = if has_ending(name, &["at2"]) {
        (Unit::Gravity, ".AT2")
    } else if has_ending(name, &["vt2"]) {
        (Unit::CentimetrePerSecond, ".VT2")
    } else if has_ending(name, &["dt2"]) {
        (Unit::Centimetre, ".DT2")
    } else {
        return None;
    };
    warnings.push(format!(
        "{name}: the header states no unit; {ending} files are in {unit}"
    ));
    Some(unit)
}

/// The word after `UNITS OF`, in capital letters.
fn stated_unit(line: &str) -> Option<String> {
    let upper = line.to_ascii_uppercase();
    let (_, rest) = upper
        .split_once("UNITS OF")
        .or_else(|| upper.split_once("UNITS:"))?;
    let word = rest.trim_start().split([' ', ',', ';', '\t']).next()?;
    (!word.is_empty()).then(|| word.to_owned())
}

/// The line with the event and the station: usually the second.
fn title(head: &[&str]) -> String {
    let line = head
        .get(1)
        .or_else(|| head.first())
        .map_or("", |line| line.trim());
    text::shorten_to(line, 200)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::{ReadOptions, parse_record};
    use gusset_quantity::assert_is;

    const VALUES: &str =
        "  .1297983E-02  .2000000E-02 -.3000000E-02  .4000000E+00  .5000000E-02\n  .6000000E-02\n";
    const FIRST_SIX: [f64; 6] = [0.001_297_983, 0.002, -0.003, 0.4, 0.005, 0.006];

    fn file(third: &str, fourth: &str, data: &str) -> String {
        format!(
            "PEER NGA DATABASE RECORD\nSOMEWHERE 01/01/01, STATION, 090\n{third}\n{fourth}\n{data}"
        )
    }

    fn read_named(name: &str, text: &str) -> Result<Record, MotionError> {
        parse_record(name, text.as_bytes(), &ReadOptions::default())
    }

    fn read(fourth: &str, data: &str) -> Result<Record, MotionError> {
        read_named(
            "a.AT2",
            &file("ACCELERATION TIME HISTORY IN UNITS OF G", fourth, data),
        )
    }

    #[test]
    fn every_style_of_header_is_read() {
        for (fourth, dt) in [
            ("NPTS=     6, DT= .02000 SEC", 0.02),
            ("NPTS=   6, DT=   .0050 SEC,", 0.005),
            ("npts=6, dt=0.0024", 0.0024),
            ("NPTS= 6  DT= .01000", 0.01),
            ("NPTS = 6, DT = 5.0000E-03 SEC", 0.005),
            ("NPTS=6,DT=.0100SEC", 0.01),
            ("   6    0.00500    NPTS, DT", 0.005),
            ("6 .01 npts, dt", 0.01),
            ("  6.0  1.0D-02 NPTS, DT (SEC)", 0.01),
            ("NPTS: 6, DT: .0050 SEC", 0.005),
            ("NPTS, DT   6   .0050", 0.005),
            ("NPTS = 6\nDT = .0050 SEC", 0.005),
            ("    6   .00500", 0.005),
        ] {
            let record = read(fourth, VALUES).unwrap();
            assert_eq!(record.dt, dt, "{fourth}");
            assert_eq!(record.values, FIRST_SIX, "{fourth}");
            assert_eq!(record.unit, Some(Unit::Gravity));
            assert_eq!(record.title, "SOMEWHERE 01/01/01, STATION, 090");
            assert!(record.warnings.is_empty(), "{:?}", record.warnings);
        }
    }

    #[test]
    fn bare_count_and_step_need_a_series_title() {
        let title = "ACCELERATION TIME HISTORY IN UNITS OF G";
        let text = file(title, "   6    .0050", VALUES);
        let record = read_named("old.acc", &text).unwrap();
        assert_eq!((record.dt, record.values.len()), (0.005, 6));
        assert_eq!(record.unit, Some(Unit::Gravity));
        // Two numbers below other words are a row of a table.
        assert!(!looks_like("time accel\n 6 .0050\n"));
        // More than two numbers are values, not a count and a step.
        assert!(!looks_like(&file(title, "6 .0050 .0020", "")));
    }

    #[test]
    fn extra_carriage_returns_do_no_harm() {
        let text = file(
            "ACCELERATION TIME SERIES IN UNITS OF G",
            "NPTS= 6, DT= .02 SEC",
            VALUES,
        );
        for end in ["\r\n", "\r\r\n", "\r"] {
            let record = read_named("a.at2", &text.replace('\n', end)).unwrap();
            assert_eq!(record.values, FIRST_SIX, "{end:?}");
        }
    }

    #[test]
    fn touching_numbers_are_separated() {
        let header = "NPTS= 4, DT= .01 SEC";
        // The signs separate the numbers.
        let record = read(header, "-0.00123-0.00456 0.00789-0.00012\n").unwrap();
        assert_eq!(record.values, [-0.001_23, -0.004_56, 0.007_89, -0.000_12]);
        let record = read(header, " .1E-02-.2E-02 .3D+00-.4E-01\n").unwrap();
        assert_eq!(record.values, [0.001, -0.002, 0.3, -0.04]);
        // Only the width separates the numbers: 4F10.5 with full fields.
        let record = read(header, "1000.123451000.23456  -0.50000-100.12345\n").unwrap();
        assert_eq!(
            record.values,
            [1_000.123_45, 1_000.234_56, -0.5, -100.123_45]
        );
        // 4E12.6 with full fields: the first reading of the second word fails, the width decides.
        let record = read(header, "-.123456E-020.223456E-020.323456E-020.423456E-02\n").unwrap();
        let expected = [-0.001_234_56, 0.002_234_56, 0.003_234_56, 0.004_234_56];
        assert_eq!(record.values, expected);
        // Points at different places are no fixed format, and guessing is worse than refusing.
        let touching = read(header, "-.123456E-02.1234567E-020.123456E-020.123456E-02\n");
        assert!(matches!(
            touching.unwrap_err(),
            MotionError::NotANumber {
                line: 5,
                column: 1,
                ..
            }
        ));
        // Three digits of exponent push out its letter.
        let record = read("NPTS= 2, DT= .01", " 0.123-100 0.5\n").unwrap();
        assert_eq!(record.values, [1.23e-101, 0.5]);
    }

    #[test]
    fn wrong_count_is_refused_with_both_numbers() {
        for npts in [0, 5, 7] {
            let error = read(&format!("NPTS= {npts}, DT= .01 SEC"), VALUES).unwrap_err();
            assert_is!(
                error
                => MotionError::Count { announced, found: 6, .. } if *announced == npts
            );
        }
        let uncounted = read("NPTS, DT= .01 SEC", VALUES).unwrap();
        assert!(uncounted.warnings[0].contains("no count"));
    }

    #[test]
    fn decimal_comma_is_refused_at_its_place() {
        let comma = |fourth: &str, data: &str| match read(fourth, data).unwrap_err() {
            MotionError::DecimalComma {
                line,
                column,
                found,
                ..
            } => (format!("{line}:{column}"), found),
            other => panic!("{other}"),
        };
        let said = |place: &str, number: &str| (place.to_owned(), number.to_owned());
        let good = "NPTS= 6, DT= .01 SEC";
        for (data, place, number) in [
            (
                "  0,0000E+00  2,9552E-03  5,6464E-03\n",
                "5:4",
                "0,0000E+00",
            ),
            ("  0.1 0.2\n  0.3 -,5\n", "6:8", "-,5"),
            ("0.1 0.2 ,5\n", "5:9", ",5"),
            ("0.1;0,2;0.3\n", "5:6", "0,2"),
            ("1,234.5 2.0\n", "5:2", "1,234.5"),
            ("1.234,5 2.0\n", "5:6", "1.234,5"),
        ] {
            assert_eq!(comma(good, data), said(place, number));
        }
        for (fourth, place, number) in [
            ("NPTS=   6, DT=   0,0050 SEC", "4:19", "0,0050"),
            ("NPTS=   6, DT=   ,0050 SEC,", "4:18", ",0050"),
            ("NPTS=1,559, DT= .0050 SEC,", "4:7", "1,559"),
            ("   6    0,00500    NPTS, DT", "4:10", "0,00500"),
        ] {
            assert_eq!(comma(fourth, VALUES), said(place, number));
        }
        // Between numbers with points a comma is a gap.
        let record = read(good, "0.1,0.2, .3 ,.4\n.5;-0.6,\n").unwrap();
        assert_eq!(record.values, [0.1, 0.2, 0.3, 0.4, 0.5, -0.6]);
    }

    #[test]
    fn fault_is_reported_with_its_place() {
        let refused = |fourth: &str, data: &str| read(fourth, data).unwrap_err();
        let good = "NPTS= 2, DT= .01 SEC";
        assert_is!(
            refused(good, "0.1 0.2\n 0.3 NaN\n")
            => MotionError::NotFinite { line: 6, column: 6, .. }
        );
        assert_is!(
            refused(good, "0.1 ********* 0.2\n")
            => MotionError::NotANumber { line: 5, column: 5, found, .. } if found == "*********"
        );
        assert_is!(
            refused("NPTS= many, DT= .01 SEC", "1 2\n")
            => MotionError::Header { line: 4, found, .. } if found == "MANY"
        );
        assert_is!(
            refused("NPTS= 2, DT= 0.0 SEC", "1 2\n")
            => MotionError::Header { line: 4, found, .. } if found == "0.0"
        );
        for header in [
            "NPTS= 2, DT= 5.0 MSEC",
            "NPTS=2,DT=5 ms,",
            " 2 5.0 NPTS, DT (MSEC)",
        ] {
            assert_is!(refused(header, "1 2\n") => MotionError::Header { line: 4, .. });
        }
        assert_is!(refused(good, "") => MotionError::Empty { .. });
        assert!(matches!(
            read("NPTS= 2", "1 2\n").unwrap_err(),
            MotionError::StepMissing { .. }
        ));
        assert_is!(
            read_named("a.AT2", "just\nwords\n").unwrap_err()
            => MotionError::Header { line: 3, .. }
        );
    }

    #[test]
    fn unit_comes_from_the_third_line() {
        for (name, third, unit) in [
            (
                "a.AT2",
                "ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1",
                Some(Unit::Gravity),
            ),
            (
                "a.AT2",
                "ACCELERATION TIME SERIES IN UNITS OF CM/S/S",
                Some(Unit::CentimetrePerSecond2),
            ),
            (
                "a.VT2",
                "VELOCITY TIME SERIES IN UNITS OF CM/S",
                Some(Unit::CentimetrePerSecond),
            ),
            (
                "a.DT2",
                "DISPLACEMENT TIME SERIES IN UNITS OF CM",
                Some(Unit::Centimetre),
            ),
        ] {
            let record = read_named(name, &file(third, "NPTS= 6, DT= .01 SEC", VALUES)).unwrap();
            assert_eq!(record.unit, unit, "{third}");
            assert!(record.warnings.is_empty(), "{:?}", record.warnings);
        }
        for (name, unit) in [
            ("a.AT2", Some(Unit::Gravity)),
            ("a.VT2", Some(Unit::CentimetrePerSecond)),
            ("a.dt2", Some(Unit::Centimetre)),
        ] {
            let record =
                read_named(name, &file("no word of it", "NPTS= 6, DT= .01 SEC", VALUES)).unwrap();
            assert_eq!(record.unit, unit);
            assert!(record.warnings[0].contains(" unit"));
        }
        let record = read_named(
            "a.AT2",
            &file("IN UNITS OF FURLONGS", "NPTS= 6, DT= .01", VALUES),
        )
        .unwrap();
        assert_eq!(record.unit, None);
        assert!(record.warnings[0].contains("FURLONGS"));
    }

    #[test]
    fn unknown_unit_is_quoted_with_its_line() {
        let third = "ACCELERATION TIME SERIES IN UNITS OF G*100";
        let record = read_named("a.AT2", &file(third, "NPTS= 6, DT= .01", VALUES)).unwrap();
        assert_eq!(record.unit, None);
        assert_eq!(record.source.unknown_unit.as_deref(), Some(third));
    }

    #[test]
    fn table_like_a_peer_file_is_reported() {
        let text = "# npts=3, dt=0.01\n# Time (s) Acc (g)\n0.00 0.1\n0.01 0.2\n0.02 0.3\n";
        let error = read_named("a.txt", text).unwrap_err();
        assert!(
            matches!(&error, MotionError::NotANumber { line: 2, advice, .. } if advice.contains("as peer")),
            "{error}"
        );
        let as_table = ReadOptions {
            format: Some(crate::read::RecordFormat::Table),
            ..ReadOptions::default()
        };
        let record = parse_record("a.txt", text.as_bytes(), &as_table).unwrap();
        assert_eq!((record.dt, record.values.len()), (0.01, 3));
    }

    #[test]
    fn given_step_overrules_with_a_warning() {
        let text = file("IN UNITS OF G", "NPTS= 6, DT= .01 SEC", VALUES);
        let with = |dt| {
            let options = ReadOptions {
                dt: Some(dt),
                ..ReadOptions::default()
            };
            parse_record("a.AT2", text.as_bytes(), &options).unwrap()
        };
        assert!(with(0.01).warnings.is_empty());
        let other = with(0.005);
        assert_eq!(other.dt, 0.005);
        assert!(other.warnings[0].contains("0.01") && other.warnings[0].contains("0.005"));
    }
}
