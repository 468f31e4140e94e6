//! K-NET and KiK-net (NIED, Japan), ASCII: 17 header lines `key value`, then counts, eight to the line.
//!
//! Accelerations are counts times `Scale Factor`, which states numerator, unit and denominator: `2000(gal)/8388608`.
//! The counts have an offset, which the network leaves in. The file holds `Duration Time` × `Sampling Freq` values.

use super::lines::{BlockEnd, Lines, leading_number, unit_and_factor};
use super::{Channel, Recording};
use crate::error::MotionError;
use crate::unit::Unit;

/// Lines among which the header must end with `Memo.`.
const LONGEST_HEADER: usize = 24;

pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let (mut rate, mut duration, mut scale, mut peak) = (None, None, None, None);
    let (mut station, mut origin, mut direction) = ("", "", "");
    loop {
        let line = lines.expect("the line Memo., which ends a K-NET header")?;
        let value = |key: &str| {
            let (head, tail) = line.split_at_checked(key.len())?;
            head.eq_ignore_ascii_case(key).then(|| tail.trim())
        };
        if let Some(text) = value("Sampling Freq(Hz)") {
            let found = leading_number(text).filter(|rate| *rate > 0.0);
            rate = Some(found.ok_or_else(|| lines.refuse("a positive sampling frequency", text))?);
        } else if let Some(text) = value("Duration Time(s)") {
            let found = leading_number(text).filter(|time| *time > 0.0);
            duration = Some(found.ok_or_else(|| lines.refuse("a positive duration", text))?);
        } else if let Some(text) = value("Scale Factor") {
            scale =
                Some(scale_factor(text).ok_or_else(|| {
                    lines.refuse("a scale factor such as 3920(gal)/6182761", text)
                })?);
        } else if let Some(text) = value("Max. Acc. (gal)") {
            peak = leading_number(text);
        } else if let Some(text) = value("Station Code") {
            station = text;
        } else if let Some(text) = value("Origin Time") {
            origin = text;
        } else if let Some(text) = value("Dir.") {
            direction = text;
        } else if value("Memo").is_some() {
            break;
        }
        if lines.at >= LONGEST_HEADER {
            return Err(lines.refuse("the line Memo., which ends a K-NET header", line));
        }
    }
    let missing = |what| lines.refuse(what, "the end of the header");
    let rate = rate.ok_or_else(|| missing("a line Sampling Freq(Hz)"))?;
    let duration = duration.ok_or_else(|| missing("a line Duration Time(s)"))?;
    let (factor, unit) = scale.ok_or_else(|| missing("a line Scale Factor"))?;
    // Whole seconds at a whole rate: rounding removes the error of the product alone.
    let points = lines.points((rate * duration).round(), "a positive count of values")?;
    let key = "Duration Time × Sampling Freq";
    let counts = lines.values(points, key, None, BlockEnd::Text)?;
    let (name, aliases) = component(direction);
    Ok(Recording {
        title: format!("{station} {origin} {name}"),
        channels: vec![Channel {
            name,
            aliases,
            dt: Some(1.0 / rate),
            unit: Some(unit),
            stated_peak: peak,
            stated_durations: Vec::new(),
            values: counts.iter().map(|count| count * factor).collect(),
        }],
        warnings: Vec::new(),
    })
}

/// `2000(gal)/8388608` as a factor in the unit.
fn scale_factor(text: &str) -> Option<(f64, Unit)> {
    let (numerator, rest) = text.split_once('(')?;
    let (unit, denominator) = rest.split_once(')')?;
    let denominator = leading_number(denominator.trim_start().strip_prefix('/')?)?;
    let (unit, size) = unit_and_factor(unit)?;
    let factor = leading_number(numerator)? / denominator * size;
    (factor > 0.0 && factor.is_finite()).then_some((factor, unit))
}

/// KiK-net numbers its components: 1 to 3 in the borehole, 4 to 6 at the surface.
fn component(direction: &str) -> (String, Vec<String>) {
    let name = match direction {
        "1" | "4" => "N-S",
        "2" | "5" => "E-W",
        "3" | "6" => "U-D",
        other => return (other.to_owned(), Vec::new()),
    };
    let depth = if "123".contains(direction) {
        "borehole"
    } else {
        "surface"
    };
    (
        name.to_owned(),
        vec![format!("{direction}, {depth}"), direction.to_owned()],
    )
}
