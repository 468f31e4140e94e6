//! CSMIP and CDMG (California), and RENADIC (Chile): volumes V1 and V2 of the tape layout of the 1970s.
//!
//! Text lines, then 100 integers and 50 or 100 reals, then blocks of values:
//!
//! | volume | blocks |
//! |---|---|
//! | V2, and V1 of digital recorders | `n points of accel data equally spaced at .02 sec, in cm/sec2. (8f10.6)` and n values; velocity and displacement follow |
//! | V1 of film, and RENADIC | no announcement: pairs of time and acceleration, `10F7.3`, n as `NO. OF POINTS` states it |
//!
//! V3 files hold spectra and are refused.

use super::lines::{
    BlockEnd, Lines, field_width, is_text, leading_number, number_after, uniform_step,
    unit_and_factor,
};
use super::{Channel, Recording};
use crate::motion::error::MotionError;
use crate::motion::unit::{Quantity, Unit};

const FORMAT: &str = "CSMIP";
/// Lines of integers and reals of a V1 header: 100 in `16I5`, 50 in `8F10`.
const V1_NUMBER_LINES: usize = 14;
/// Lines of integers and reals that any header may have: 100 in `16I5`, 100 in `8F10`.
const MOST_NUMBER_LINES: usize = 20;
const ANNOUNCEMENT: &str = "a line such as `1000 points of accel data equally spaced at .02 sec`";

/// True of the first line of such a file, in capital letters.
pub(super) fn is_first_line(upper: &str) -> bool {
    upper.starts_with("UNCORRECTED ACCELEROGRAM DATA")
        || (upper.starts_with("CORRECTED ACCELEROGRAM") && !upper.contains("GNS SCIENCE"))
        || upper.starts_with("RESPONSE AND FOURIER AMPLITUDE SPECTRA")
}

/// Content of the text lines of one channel.
#[derive(Default)]
struct Head {
    is_corrected: bool,
    name: String,
    aliases: Vec<String>,
    points: Option<f64>,
    unit: Option<(Unit, f64)>,
    /// Lines of numbers since the last text line.
    number_lines: usize,
    has_numbers: bool,
    /// A block of values belongs to it.
    has_values: bool,
}

pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let mut recording = Recording::default();
    let mut head = Head::default();
    while let Some(line) = lines.peek() {
        if is_text(line) {
            lines.next();
            let upper = line.to_ascii_uppercase();
            if upper.contains("FOURIER AMPLITUDE SPECTRA") {
                let reason = "it is a V3 file, which holds spectra; read the V2 file of the record";
                return Err(lines.unsupported(FORMAT, reason));
            }
            if upper.contains("POINTS OF") && upper.contains("SPACED AT") {
                announced(lines, line, &head, &mut recording)?;
                head.has_values = true;
            } else {
                let is_without_values = head.is_without_values();
                head.read(line.trim(), upper.trim(), &mut recording.title);
                if is_without_values && !head.has_numbers {
                    return Err(lines.refuse(ANNOUNCEMENT, line));
                }
                head.number_lines = 0;
            }
            continue;
        }
        head.number_lines += 1;
        head.has_numbers = true;
        let is_past_header = !head.is_corrected && head.number_lines > V1_NUMBER_LINES;
        if is_past_header && head.points.is_some() {
            pairs(lines, &head, &mut recording)?;
            head.has_values = true;
        } else if head.number_lines > MOST_NUMBER_LINES {
            lines.next();
            return Err(lines.refuse(ANNOUNCEMENT, line));
        } else {
            lines.next();
        }
    }
    if recording.channels.is_empty() || head.is_without_values() {
        return Err(lines.refuse(ANNOUNCEMENT, "the end of the file"));
    }
    Ok(recording)
}

impl Head {
    /// True if numbers follow it, but no line announces values.
    fn is_without_values(&self) -> bool {
        self.has_numbers && !self.has_values
    }

    /// Takes what one text line says.
    fn read(&mut self, line: &str, upper: &str, title: &mut String) {
        let is_corrected = upper.starts_with("CORRECTED ACCELEROGRAM");
        let is_uncorrected = upper.starts_with("UNCORRECTED ACCELEROGRAM DATA");
        // The second line of a V2 header names the V1 file behind it.
        let is_source = self.is_corrected && self.name.is_empty();
        if is_corrected || (is_uncorrected && !is_source) {
            *self = Self {
                is_corrected,
                ..Self::default()
            };
        } else if upper.starts_with("CHAN")
            && let Some((number, direction)) = line.get(4..).and_then(|l| l.split_once(':'))
            && let Ok(number) = number.trim().parse::<u32>()
        {
            self.name = format!("Chan {number}");
            let direction = direction.split('(').next().unwrap_or("").trim();
            self.aliases = vec![direction.to_owned()];
        } else if upper.starts_with("NO. OF POINTS") {
            self.points = number_after(upper, "NO. OF POINTS");
        } else if let Some((_, rest)) = upper.split_once("UNITS OF UNCOR ACCEL") {
            let words = rest.split("MAX").next().unwrap_or("");
            self.unit = words.split_whitespace().find_map(unit_and_factor);
        } else if title.is_empty()
            && (upper.starts_with("RCRD OF")
                || upper.contains("EARTHQUAKE")
                || upper.starts_with("STATION NO"))
        {
            line.clone_into(title);
        }
    }

    /// A channel of this head. Velocities and displacements have their quantity in the name.
    fn channel(&self, unit: Option<(Unit, f64)>, number: usize) -> Channel {
        let name = match self.name.as_str() {
            "" => format!("Chan {number}"),
            name => name.to_owned(),
        };
        let kind = match unit.map(|(unit, _)| unit.quantity()) {
            Some(Quantity::Velocity) => " velocity",
            Some(Quantity::Displacement) => " displacement",
            _ => "",
        };
        Channel {
            name: format!("{name}{kind}"),
            aliases: self.aliases.iter().map(|a| format!("{a}{kind}")).collect(),
            unit: unit.map(|(unit, _)| unit),
            ..Channel::default()
        }
    }
}

/// A block whose count, step, unit and format its first line states.
fn announced(
    lines: &mut Lines<'_>,
    line: &str,
    head: &Head,
    recording: &mut Recording,
) -> Result<(), MotionError> {
    let count = leading_number(line).ok_or_else(|| lines.refuse(ANNOUNCEMENT, line))?;
    let points = lines.points(count, ANNOUNCEMENT)?;
    let dt = number_after(line, "SPACED AT")
        .filter(|dt| *dt > 0.0)
        .ok_or_else(|| lines.refuse("a positive time step behind `spaced at`", line))?;
    let upper = line.to_ascii_uppercase();
    let unit = upper
        .split_once("UNITS:")
        .or_else(|| upper.split_once("SEC, IN "))
        .or_else(|| upper.split_once("SECS, IN "))
        .and_then(|(_, rest)| rest.split_whitespace().next())
        .and_then(unit_and_factor)
        .or(head.unit.filter(|_| upper.contains("ACCEL")));
    let number = recording.channels.len() + 1;
    let mut channel = head.channel(unit, number);
    channel.dt = Some(dt);
    let key = "the line `points of … data equally spaced`";
    channel.values = lines.values(points, key, field_width(line), BlockEnd::Text)?;
    let factor = unit.map_or(1.0, |(_, factor)| factor);
    channel.values.iter_mut().for_each(|value| *value *= factor);
    recording.push(lines, channel)
}

/// Pairs of time and acceleration, as many as `NO. OF POINTS` states.
fn pairs(lines: &mut Lines<'_>, head: &Head, recording: &mut Recording) -> Result<(), MotionError> {
    const KEY: &str = "NO. OF POINTS (each with its time)";
    let first = lines.at + 1;
    let points = lines.points(head.points.unwrap_or(0.0), "a whole NO. OF POINTS")?;
    let numbers = lines.values(2 * points, KEY, Some(7), BlockEnd::Text)?;
    let times: Vec<f64> = numbers.iter().step_by(2).copied().collect();
    let dt = uniform_step(lines.file, &times, first).map_err(|error| match error {
        // Five pairs to the line.
        MotionError::NotUniform {
            file,
            line,
            wanted,
            found,
        } => MotionError::NotUniform {
            file,
            line: first + (line - first) / 5,
            wanted,
            found,
        },
        other => other,
    })?;
    let mut channel = head.channel(head.unit, recording.channels.len() + 1);
    channel.dt = Some(dt);
    let factor = head.unit.map_or(1.0, |(_, factor)| factor);
    channel.values = numbers
        .iter()
        .skip(1)
        .step_by(2)
        .map(|v| v * factor)
        .collect();
    recording.push(lines, channel)
}
