//! CSMIP, CDMG and USC (California), BHRC (Iran) and RENADIC (Chile): volumes V1 and V2 of the tape layout of the 1970s.
//!
//! Text lines, then 100 integers and 50 or 100 reals, then blocks of values:
//!
//! | volume | blocks |
//! |---|---|
//! | V2, and V1 of digital recorders | `n points of accel data equally spaced at .02 sec, in cm/sec2. (8f10.6)` or `n accelerogram points at 200 pts/sec in units of g`, and n values; velocity and displacement follow in V2 |
//! | V1 of film, and RENADIC | no announcement: pairs of time and acceleration, `10F7.3`, n as `NO. OF POINTS` states it |
//! | V1 of BHRC | no announcement: n accelerations over the `DURATION` |
//!
//! A line `/&` ends a channel. A film has points at unequal times: straight lines between them give the values at the
//! mean interval. V3 files hold spectra and are refused.

use super::lines::{
    BlockEnd, Lines, ends_channel, field_width, is_text, leading_number, number_after,
    uniform_step, unit_and_factor,
};
use super::{Channel, Recording, StatedDuration, kind};
use crate::error::{MotionError, Short};
use crate::unit::Unit;

const FORMAT: &str = "CSMIP";
/// Lines of integers and reals of a V1 header: 100 in `16I5`, 50 in `8F10`.
const V1_NUMBER_LINES: usize = 14;
/// Lines of integers and reals that any header may have: 100 in `16I5`, 100 in `8F10`.
const MOST_NUMBER_LINES: usize = 20;
const ANNOUNCEMENT: &str = "a line such as `1000 points of accel data equally spaced at .02 sec`";
/// First words of a V1 file of BHRC.
const BHRC: &str = "* VOL1DS FILE";
/// Longest interval between points of a film, in mean intervals. A longer one is a gap.
const LONGEST_INTERVAL: f64 = 4.0;

/// True of the first line of such a file, in capital letters.
pub(super) fn is_first_line(upper: &str) -> bool {
    is_uncorrected(upper)
        || upper.starts_with(BHRC)
        || (upper.starts_with("CORRECTED ACCELEROGRAM") && !upper.contains("GNS SCIENCE"))
        || upper.starts_with("RESPONSE AND FOURIER AMPLITUDE SPECTRA")
}

/// True of the first line of a V1 channel. That of USC begins with the number of the file.
fn is_uncorrected(upper: &str) -> bool {
    const MARK: &str = "UNCORRECTED ACCELEROGRAM DATA";
    upper.starts_with(MARK) || (upper.starts_with("FILE ") && upper.contains(MARK))
}

/// Content of the text lines of one channel.
#[derive(Default)]
struct Head {
    is_corrected: bool,
    /// Single values follow, not pairs with their times.
    is_bhrc: bool,
    duration: Option<StatedDuration>,
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
            if is_announcement(&upper) {
                announced(lines, line, &head, &mut recording)?;
                head.has_values = true;
            } else if !ends_channel(line) {
                let is_without_values = head.is_without_values();
                head.read(line.trim(), upper.trim(), lines.at, &mut recording.title);
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
            if head.is_bhrc {
                singles(lines, &head, &mut recording)?;
            } else {
                pairs(lines, &head, &mut recording)?;
            }
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
    fn read(&mut self, line: &str, upper: &str, at: usize, title: &mut String) {
        let is_corrected = upper.starts_with("CORRECTED ACCELEROGRAM");
        let is_bhrc = upper.starts_with(BHRC);
        // The second line of a V2 header names the V1 file behind it.
        let is_source = self.is_corrected && self.name.is_empty();
        for key in ["RECORD LENGTH", "DURATION"] {
            if let Some(seconds) = number_after(upper, key) {
                // That of a V2 file may be the length of its V1 file.
                let share = if self.is_corrected { 0.05 } else { 1e-4 };
                self.duration = Some(StatedDuration {
                    key,
                    line: at,
                    seconds,
                    slack: 1e-3 + share * seconds.abs(),
                });
            }
        }
        if is_corrected || is_bhrc || (is_uncorrected(upper) && !is_source) {
            *self = Self {
                is_corrected,
                is_bhrc,
                ..Self::default()
            };
        } else if upper.starts_with("CHAN")
            && let Some((number, direction)) = line.get(4..).and_then(|l| l.split_once(':'))
            && let Ok(number) = number.trim().parse::<u32>()
        {
            self.name = format!("Chan {number}");
            let direction = direction.split('(').next().unwrap_or("").trim();
            self.aliases = vec![direction.to_owned()];
        } else if let Some(name) = line.strip_prefix("COMP ") {
            // `COMP N90E      9`: USC counts the characters of each line.
            self.name = name.split_whitespace().next().unwrap_or("").to_owned();
        } else if upper.starts_with("NO. OF POINTS") {
            self.points = number_after(upper, "NO. OF POINTS");
        } else if let Some((_, rest)) = upper
            .split_once("UNITS OF UNCOR ACCEL")
            .or_else(|| upper.split_once("UNITS ARE"))
        {
            let words = rest.split("MAX").next().unwrap_or("");
            self.unit = words.split_whitespace().find_map(unit_and_factor);
        } else if title.is_empty()
            && (upper.starts_with("RCRD OF")
                || upper.contains("EARTHQUAKE")
                || upper.starts_with("STATION NO"))
        {
            line.split("   ").next().unwrap_or("").clone_into(title);
        }
    }

    /// A channel of this head. Velocities and displacements have their quantity in the name.
    fn channel(&self, unit: Option<(Unit, f64)>, number: usize) -> Channel {
        let name = match self.name.as_str() {
            "" => format!("Chan {number}"),
            name => name.to_owned(),
        };
        let unit = unit.map(|(unit, _)| unit);
        let kind = kind(unit);
        Channel {
            name: format!("{name}{kind}"),
            aliases: self.aliases.iter().map(|a| format!("{a}{kind}")).collect(),
            unit,
            stated_durations: self.duration.into_iter().collect(),
            ..Channel::default()
        }
    }
}

/// True of the line before a block of values, in capital letters.
fn is_announcement(upper: &str) -> bool {
    (upper.contains("POINTS OF") && upper.contains("SPACED AT"))
        || (upper.contains("ACCELEROGRAM POINTS AT") && upper.contains("PTS/SEC"))
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
        .or_else(|| number_after(line, "POINTS AT").map(f64::recip))
        .filter(|dt| *dt > 0.0 && dt.is_finite())
        .ok_or_else(|| lines.refuse("a positive time step or rate behind `at`", line))?;
    let upper = line.to_ascii_uppercase();
    let unit = upper
        .split_once("UNITS:")
        .or_else(|| upper.split_once("IN UNITS OF "))
        .or_else(|| upper.split_once("IN UNITS "))
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
    let accels: Vec<f64> = numbers.iter().skip(1).step_by(2).copied().collect();
    let mut channel = head.channel(head.unit, recording.channels.len() + 1);
    let factor = head.unit.map_or(1.0, |(_, factor)| factor);
    let step = uniform_step(lines.file, &times, first).map_err(|error| match error {
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
    });
    let (dt, accels) = match step {
        Ok(dt) => (dt, accels),
        Err(error) => {
            let (dt, even, most) = evenly_spaced(&times, &accels).ok_or(error)?;
            recording.warnings.push(format!(
                "{}: the points of {} have unequal times, up to {} s from equal ones: straight lines between \
                 them give the values every {} s",
                lines.file,
                channel.name,
                Short(most),
                Short(dt)
            ));
            (dt, even)
        }
    };
    channel.dt = Some(dt);
    channel.values = accels.iter().map(|value| value * factor).collect();
    recording.push(lines, channel)
}

/// Values at the mean interval on the straight lines between points of a film: the interval, the values, and the
/// largest distance of a point from its equal time.
///
/// `None` if the times do not rise, or have a gap.
fn evenly_spaced(times: &[f64], values: &[f64]) -> Option<(f64, Vec<f64>, f64)> {
    let (start, end) = (*times.first()?, *times.last()?);
    let dt = (end - start) / (times.len() - 1) as f64;
    let is_film = times.len() > 1
        && times.windows(2).all(|pair| {
            let interval = pair[1] - pair[0];
            interval > 0.0 && interval <= LONGEST_INTERVAL * dt
        });
    if !is_film {
        return None;
    }
    let equal = |row: usize| start + row as f64 * dt;
    let far = (0..)
        .zip(times)
        .map(|(row, time)| (time - equal(row)).abs());
    let most = far.fold(0.0, f64::max);
    let mut next = 1;
    let even = (0..times.len()).map(|row| {
        let time = equal(row).min(end);
        while times[next] < time {
            next += 1;
        }
        let share = (time - times[next - 1]) / (times[next] - times[next - 1]);
        values[next - 1] + share * (values[next] - values[next - 1])
    });
    Some((dt, even.collect(), most))
}

/// Accelerations of BHRC, as many as `NO. OF POINTS` states, over the `DURATION`.
fn singles(
    lines: &mut Lines<'_>,
    head: &Head,
    recording: &mut Recording,
) -> Result<(), MotionError> {
    let points = lines.points(head.points.unwrap_or(0.0), "a whole NO. OF POINTS")?;
    let duration = head
        .duration
        .filter(|duration| duration.seconds > 0.0)
        .ok_or_else(|| lines.refuse("a positive DURATION", "none"))?;
    let mut channel = head.channel(head.unit, recording.channels.len() + 1);
    channel.values = lines.values(points, "NO. OF POINTS", Some(13), BlockEnd::Text)?;
    let factor = head.unit.map_or(1.0, |(_, factor)| factor);
    channel.values.iter_mut().for_each(|value| *value *= factor);
    channel.dt = Some(duration.seconds / points as f64);
    recording.push(lines, channel)
}
