//! USGS SMC: 11 text lines, 48 integers, 50 reals, comments that begin with `|`, then one series.
//!
//! Integer 16 counts the comments, integer 17 the values; real 2 is the sampling rate, real 30 the peak. Unknown reals
//! are as the first states it (1.7e38). Values are in cm/s², cm/s or cm, eight to the line in fields of ten characters.

use super::lines::{BlockEnd, Lines};
use super::{Channel, Recording};
use crate::error::MotionError;
use crate::unit::Unit;

const TEXT_LINES: usize = 11;

/// True of the first line of such a file, in capital letters: `2 CORRECTED ACCELEROGRAM`.
pub(super) fn is_first_line(upper: &str) -> bool {
    series_of(upper).is_some()
}

/// The unit of the series that the first line names, or why the file is refused.
fn series_of(upper: &str) -> Option<Result<Unit, &'static str>> {
    let (volume, kind) = upper.trim().split_once(' ')?;
    if volume.len() != 1 || !volume.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    match kind.trim() {
        kind if kind.contains("SPECTR") => Some(Err("it holds spectra, not a record in time")),
        kind if kind.ends_with("ACCELEROGRAM") => Some(Ok(Unit::CentimetrePerSecond2)),
        "VELOCITY" => Some(Ok(Unit::CentimetrePerSecond)),
        "DISPLACEMENT" => Some(Ok(Unit::Centimetre)),
        _ => None,
    }
}

pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let first = lines.expect("the first line of an SMC file")?;
    let unit = series_of(&first.to_ascii_uppercase())
        .ok_or_else(|| lines.refuse("a first line such as `2 CORRECTED ACCELEROGRAM`", first))?
        .map_err(|reason| lines.unsupported("SMC", reason))?;
    let mut channel = Channel {
        unit: Some(unit),
        ..Channel::default()
    };
    let mut title = "";
    for at in 1..TEXT_LINES {
        let line = lines.expect("the 11 text lines of an SMC header")?;
        if at == 3 {
            title = line.trim();
        }
        if let Some((_, component)) = line.split_once("component=") {
            component.trim().clone_into(&mut channel.name);
        }
    }
    let integers = lines.header_numbers(48, 10, "a header of 48 integers")?;
    let reals = lines.header_numbers(50, 15, "a header of 50 reals")?;
    let integer = |at: usize| integers.get(at).copied().unwrap_or(0.0);
    let real = |at: usize| reals.get(at).copied().unwrap_or(0.0);
    let rate = real(1);
    if rate > 0.0 && rate == real(0) {
        let reason = "it states no sampling rate: the points of a film have unequal times; read the corrected record";
        return Err(lines.unsupported("SMC", reason));
    }
    if !(rate > 0.0 && rate < 1e5) {
        return Err(lines.refuse("a sampling rate as real 2 of the header", &rate.to_string()));
    }
    let comments = integer(15);
    if !(0.0..=1e4).contains(&comments) {
        return Err(lines.refuse("a count of comments as integer 16", &comments.to_string()));
    }
    for _ in 0..comments as usize {
        let line = lines.expect("the comments of an SMC header")?;
        if !line.starts_with('|') {
            return Err(lines.refuse("as many comments with | as integer 16 states", line));
        }
    }
    let points = lines.points(integer(16), "a count of values as integer 17")?;
    let mut warnings = Vec::new();
    if integer(17) == 1.0 {
        warnings.push(format!(
            "{}: the header flags a problem of the record: read its comments",
            lines.file
        ));
    }
    channel.dt = Some(1.0 / rate);
    channel.stated_peak = Some(real(29)).filter(|peak| *peak != real(0) && peak.abs() < 1e30);
    channel.values = lines.values(points, "integer 17 of the header", Some(10), BlockEnd::Text)?;
    Ok(Recording {
        title: title.to_owned(),
        channels: vec![channel],
        warnings,
    })
}
