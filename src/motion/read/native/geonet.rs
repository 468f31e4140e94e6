//! GeoNet (GNS Science, New Zealand) V1A and V2A: three components, one after the other.
//!
//! Each has 16 text lines, 4 lines of ten integers and 6 of ten reals in fields of 8 characters, then the values,
//! ten to the line: accelerations in mm/s², and in V2A velocities in mm/s and displacements in mm. The counts are in the
//! fourth line of integers (the first of V1A, the fourth to sixth of V2A), the step in the third line of reals.

use super::lines::{BlockEnd, Lines, is_text, number_after};
use super::{Channel, Recording};
use crate::error::{MotionError, Short};
use crate::unit::Unit;

/// Text lines that a component may have.
const LONGEST_TEXT: usize = 40;
/// Numbers of the header of a component, and the width of their fields.
const NUMBERS: usize = 100;
const WIDTH: usize = 8;

/// Content of the text lines of a component.
#[derive(Default)]
struct Head {
    is_corrected: bool,
    name: String,
    alias: String,
    points: Option<f64>,
    duration: Option<f64>,
    interval: Option<f64>,
    peak: Option<f64>,
}

pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let mut recording = Recording::default();
    while let Some(first) = lines.peek() {
        if !first.to_ascii_uppercase().contains("ACCELEROGRAM") {
            lines.next();
            return Err(lines.refuse("the first line of a component, with `accelerogram`", first));
        }
        if recording.title.is_empty() {
            first.trim().clone_into(&mut recording.title);
        }
        component(lines, &mut recording)?;
    }
    Ok(recording)
}

/// Reads one component.
fn component(lines: &mut Lines<'_>, recording: &mut Recording) -> Result<(), MotionError> {
    let head = text(lines)?;
    let numbers = lines.header_numbers(NUMBERS, WIDTH, "a header of 100 numbers")?;
    let number = |row: usize, column: usize| numbers.get(10 * row + column).copied().unwrap_or(0.0);
    let counts = if head.is_corrected {
        [number(3, 3), number(3, 4), number(3, 5)]
    } else {
        [number(3, 0), 0.0, 0.0]
    };
    let stored = number(6, if head.is_corrected { 5 } else { 4 });
    let dt = head.interval.unwrap_or(stored);
    if dt > 0.0 && stored > 0.0 && (dt - stored).abs() > 0.02 * dt {
        let both = format!(
            "{} s in the text, {} s in the numbers",
            Short(dt),
            Short(stored)
        );
        return Err(lines.refuse("one time step in the text and in the numbers", &both));
    }
    let points = lines.points(counts[0], "a whole count of accelerations")?;
    if let Some(stated) = head.points.filter(|stated| *stated != points as f64) {
        return Err(lines.count("Number of points", stated as usize, points));
    }
    if let Some(duration) = head.duration
        && (duration - points as f64 * dt).abs() > 1.5 * dt + 0.01
    {
        let found = format!("{points} points at {} s in {duration} s", Short(dt));
        return Err(lines.refuse("a duration of count times step", &found));
    }
    let series = [
        ("", Unit::MillimetrePerSecond2, head.peak),
        (" velocity", Unit::MillimetrePerSecond, None),
        (" displacement", Unit::Millimetre, None),
    ];
    for ((kind, unit, peak), count) in series.into_iter().zip(counts) {
        if count == 0.0 {
            continue;
        }
        let points = lines.points(count, "a whole count of values")?;
        let values = lines.values(
            points,
            "the fourth line of integers",
            Some(WIDTH),
            BlockEnd::Count,
        )?;
        let channel = Channel {
            name: format!("{}{kind}", head.name),
            aliases: vec![format!("{}{kind}", head.alias)],
            dt: (dt > 0.0).then_some(dt),
            unit: Some(unit),
            stated_peak: peak,
            stated_durations: Vec::new(),
            values,
        };
        recording.push(lines, channel)?;
    }
    if let Some(line) = lines.peek().filter(|line| !is_text(line)) {
        lines.next();
        return Err(lines.refuse("the next component, or the end of the file", line));
    }
    Ok(())
}

/// Reads the text lines of a component.
fn text(lines: &mut Lines<'_>) -> Result<Head, MotionError> {
    let mut head = Head::default();
    let mut count = 0;
    while let Some(line) = lines.peek().filter(|line| is_text(line)) {
        lines.next();
        count += 1;
        if count > LONGEST_TEXT {
            return Err(lines.refuse("a header of numbers after 16 text lines", line));
        }
        let upper = line.to_ascii_uppercase();
        if count == 1 {
            head.is_corrected = !upper.contains("UNCORRECTED");
        }
        if upper.starts_with("NUMBER OF POINTS") {
            head.points = number_after(line, "NUMBER OF POINTS");
            head.duration = number_after(line, "DURATION");
        } else if upper.contains("SEC INTERVALS") {
            head.interval = number_after(line, " AT ").filter(|dt| *dt > 0.0);
        } else if let Some(rest) = upper.strip_prefix("COMPONENT ") {
            let rest = rest.trim();
            let (name, alias) = rest.split_once(' ').unwrap_or((rest, ""));
            name.clone_into(&mut head.name);
            alias.trim().clone_into(&mut head.alias);
        } else if upper.starts_with("ACCELERATION:") {
            head.peak = number_after(line, "PEAK").filter(|_| upper.contains("MM/S/S"));
        }
    }
    Ok(head)
}
