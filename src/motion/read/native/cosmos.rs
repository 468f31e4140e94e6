//! COSMOS V1 and V2: text lines, 100 integers, 100 reals, comments, then one series; repeated for each channel.
//!
//! The first line states how many text lines follow. Each block of numbers is announced with its count and its
//! Fortran format. The series is announced as `1000 acceleration pts, …, units=g (02)Format=(8f9.6)`; the code in
//! brackets is that of the physical units (table 2 of the format). Real 62 is the step in ms, real 63 the length in s,
//! real 64 the peak. A line `End-of-data` or `/&` ends a channel. Unknown numbers are −999, or as the header states it.

use super::lines::{BlockEnd, Lines, ends_channel, field_width, leading_number, number_after};
use super::{Channel, Recording, StatedDuration, kind};
use crate::error::MotionError;
use crate::unit::Unit;

const FORMAT: &str = "COSMOS";
/// Text lines that a header may have.
const MOST_TEXT_LINES: f64 = 60.0;
/// Comment lines that a channel may have.
const MOST_COMMENTS: f64 = 10_000.0;

pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let mut recording = Recording::default();
    while lines.peek().is_some() {
        channel(lines, &mut recording)?;
    }
    Ok(recording)
}

/// Reads one channel with its headers.
fn channel(lines: &mut Lines<'_>, recording: &mut Recording) -> Result<(), MotionError> {
    let first = lines.expect("the first line of a COSMOS channel")?;
    let upper = first.to_ascii_uppercase();
    if upper.contains("SPECTR") || upper.contains("FOURIER") {
        return Err(lines.unsupported(FORMAT, "it holds spectra, not a record in time"));
    }
    if !upper.contains("(FORMAT V") {
        return Err(lines.refuse("a first line with (Format v… with … text lines)", first));
    }
    let text_lines = number_after(first, " WITH")
        .filter(|count| (1.0..=MOST_TEXT_LINES).contains(count))
        .ok_or_else(|| lines.refuse("a count of text lines", first))?;
    let mut head = Channel::default();
    let mut unknown = -999.0;
    // The count includes the first line in some files only.
    let is_integers = |line: &str| line.to_ascii_uppercase().contains("INTEGER-HEADER");
    for _ in 0..text_lines as usize {
        if lines.peek().is_some_and(is_integers) {
            break;
        }
        let line = lines.expect("the text lines of a COSMOS header")?;
        if line.to_ascii_uppercase().contains("UNKNOWN") {
            unknown = number_after(line, "unspecified:").unwrap_or(unknown);
        }
        if let Some((name, detail)) = channel_name(line) {
            head.name = name;
            head.aliases.extend(detail);
        }
        if recording.title.is_empty() && line.starts_with("Statn No") {
            recording.title = line.trim().to_owned();
        }
    }
    let integers = header_block(lines, "INTEGER", "the integer header")?;
    let reals = header_block(lines, "REAL", "the real header")?;
    let line_of_reals = lines.at;
    comments(lines, &mut head)?;
    let known = |at: usize| reals.get(at).copied().filter(|value| *value != unknown);
    let is_ended = series(lines, &mut head, integers.get(2).copied())?;
    let (step_ms, length) = (known(61), known(62));
    head.dt = step_ms.map(|ms| ms / 1000.0).or(known(33));
    if let Some(dt) = head.dt.filter(|dt| *dt <= 0.0) {
        return Err(lines.refuse("a positive step as real 62 of the header", &dt.to_string()));
    }
    head.stated_durations
        .extend(length.map(|seconds| StatedDuration {
            key: "real 63 of the header",
            line: line_of_reals,
            seconds,
            slack: 1e-3,
        }));
    head.stated_peak = known(63);
    if head.name.is_empty() {
        head.name = format!("Chan {}", recording.channels.len() + 1);
    }
    if !is_ended {
        recording.warnings.push(format!(
            "{}: the line End-of-data or /& of {} is missing: its last value may be cut off",
            lines.file, head.name
        ));
    }
    recording.push(lines, head)
}

/// `Sta Chan  1: 360 deg (Rcrdr Chan  1)`: the name and the direction.
fn channel_name(line: &str) -> Option<(String, Option<String>)> {
    let upper = line.to_ascii_uppercase();
    let at = upper.find("CHAN")?;
    let (number, direction) = line.get(at + 4..)?.split_once(':')?;
    let number: u32 = number.trim().parse().ok()?;
    let direction = direction.split('(').next().unwrap_or("").trim();
    let direction = (!direction.is_empty()).then(|| direction.to_owned());
    Some((format!("Chan {number}"), direction))
}

/// `100 Integer-header values follow on 10 lines, Format= (10I8)` and the numbers.
fn header_block(
    lines: &mut Lines<'_>,
    mark: &'static str,
    wanted: &'static str,
) -> Result<Vec<f64>, MotionError> {
    let line = lines.expect(wanted)?;
    let count = leading_number(line);
    match (count, field_width(line)) {
        (Some(count), Some(width)) if line.to_ascii_uppercase().contains(mark) => {
            let count = lines.points(count, wanted)?;
            lines.header_numbers(count, width, wanted)
        }
        _ => Err(lines.refuse(wanted, line)),
    }
}

/// `1 Comment line(s) follow …` and the lines. `<SCNL>` in them names the channel by its code, too.
fn comments(lines: &mut Lines<'_>, head: &mut Channel) -> Result<(), MotionError> {
    const WANTED: &str = "a count of comment lines";
    let line = lines.expect(WANTED)?;
    let count = leading_number(line)
        .filter(|count| (0.0..=MOST_COMMENTS).contains(count))
        .filter(|_| line.to_ascii_uppercase().contains("COMMENT"))
        .ok_or_else(|| lines.refuse(WANTED, line))?;
    for _ in 0..count as usize {
        let line = lines.expect("the comment lines of a COSMOS header")?;
        if let Some((_, code)) = line.split_once("<SCNL>") {
            let code = code.split(['.', ' ']).nth(1).unwrap_or("");
            head.aliases
                .extend((!code.is_empty()).then(|| code.to_owned()));
        }
    }
    Ok(())
}

/// The line that announces the series, and the values. True if a line `End-of-data` or `/&` ends them.
fn series(
    lines: &mut Lines<'_>,
    head: &mut Channel,
    code: Option<f64>,
) -> Result<bool, MotionError> {
    const WANTED: &str = "a line such as `1000 acceleration pts, …, units=g (02)Format=(8f9.6)`";
    let line = lines.expect(WANTED)?;
    let upper = line.to_ascii_uppercase();
    let count = leading_number(line).filter(|_| upper.contains("PTS"));
    let points = lines.points(count.ok_or_else(|| lines.refuse(WANTED, line))?, WANTED)?;
    // `approx  70 secs`: a whole number, rounded or cut off.
    head.stated_durations
        .extend(number_after(line, "APPROX").map(|seconds| StatedDuration {
            key: "`approx … secs`",
            line: lines.at,
            seconds,
            slack: 1.0 + 0.01 * seconds.abs(),
        }));
    // The announcement repeats the code of the integer header; some files omit it.
    let (before, format) = match upper.find("FORMAT") {
        Some(at) => line.split_at(at),
        None => (line, ""),
    };
    let announced = before
        .rsplit_once('(')
        .and_then(|(_, code)| leading_number(code));
    let code = announced
        .or(code)
        .ok_or_else(|| lines.refuse("a code of the physical units", line))?;
    let factor;
    (head.unit, factor) = match code as i64 {
        2 => (Some(Unit::Gravity), 1.0),
        4 => (Some(Unit::CentimetrePerSecond2), 1.0),
        5 => (Some(Unit::CentimetrePerSecond), 1.0),
        6 => (Some(Unit::Centimetre), 1.0),
        7 => (Some(Unit::InchPerSecond2), 1.0),
        8 => (Some(Unit::InchPerSecond), 1.0),
        9 => (Some(Unit::Inch), 1.0),
        10 => (Some(Unit::Gal), 1.0),
        11 => (Some(Unit::Gravity), 1e-3),
        12 => (Some(Unit::Gravity), 1e-6),
        50..=52 => {
            let reason =
                "it holds counts or volts of the recorder (V0), which no sensitivity has converted";
            return Err(lines.unsupported(FORMAT, reason));
        }
        _ => return Err(lines.unsupported(FORMAT, "its physical units measure no translation")),
    };
    let kind = kind(head.unit);
    head.name.push_str(kind);
    for alias in &mut head.aliases {
        alias.push_str(kind);
    }
    let width = field_width(format);
    head.values = lines.values(points, "the line with `pts`", width, BlockEnd::Text)?;
    head.values.iter_mut().for_each(|value| *value *= factor);
    let is_end = |line: &str| line.to_ascii_uppercase().starts_with("END") || ends_channel(line);
    let is_ended = lines.peek().is_some_and(is_end);
    if is_ended {
        lines.next();
    }
    Ok(is_ended)
}
