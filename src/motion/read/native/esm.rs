//! ESM, ITACA and AFAD, ASCII: lines `KEY: value` (64 in version 1.2), then one value a line.

use super::lines::{BlockEnd, Lines, is_text, leading_number, unit_and_factor};
use super::{Channel, Recording, StatedDuration};
use crate::error::MotionError;

/// Lines that a header may have.
const LONGEST_HEADER: usize = 200;

pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let (mut points, mut unit) = (None, None);
    let mut channel = Channel::default();
    let mut peaks = Vec::new();
    let mut title = Vec::new();
    while let Some(line) = lines.peek().filter(|line| is_text(line)) {
        lines.next();
        if lines.at > LONGEST_HEADER {
            return Err(lines.refuse("the first value after at most 200 header lines", line));
        }
        let Some((key, value)) = line.split_once(':') else {
            return Err(lines.refuse("a header line KEY: value", line));
        };
        let (key, value) = (key.trim(), value.trim());
        match key {
            "SAMPLING_INTERVAL_S" => {
                let dt = leading_number(value).filter(|dt| *dt > 0.0);
                channel.dt = Some(dt.ok_or_else(|| lines.refuse("a positive time step", value))?);
            }
            "NDATA" => {
                const WANTED: &str = "a whole NDATA";
                let count = leading_number(value).ok_or_else(|| lines.refuse(WANTED, value))?;
                points = Some(lines.points(count, WANTED)?);
            }
            "DURATION_S" => channel
                .stated_durations
                .extend(leading_number(value).map(|seconds| StatedDuration {
                    key: "DURATION_S",
                    line: lines.at,
                    seconds,
                    slack: 0.01,
                })),
            "UNITS" => {
                unit = unit_and_factor(value);
                if unit.is_none() {
                    return Err(
                        lines.refuse("a unit of acceleration, velocity or displacement", value)
                    );
                }
            }
            "DATA_TYPE" if value.to_ascii_uppercase().contains("SPECTR") => {
                return Err(lines.unsupported("ESM", "it holds a spectrum, not a record in time"));
            }
            "STREAM" => value.clone_into(&mut channel.name),
            "EVENT_NAME" | "STATION_CODE" | "EVENT_ID" => title.push(value),
            _ if key.starts_with("PGA_") || key.starts_with("PGV_") || key.starts_with("PGD_") => {
                peaks.push((key, value));
            }
            _ => {}
        }
    }
    let missing = |what| lines.refuse(what, "the end of the header");
    let points = points.ok_or_else(|| missing("a line NDATA:"))?;
    let (unit, factor) = unit.ok_or_else(|| missing("a line UNITS:"))?;
    channel.unit = Some(unit);
    // `PGA_CM/S^2: 12.3`: the key ends with the unit of the peak.
    channel.stated_peak = peaks.iter().find_map(|(key, value)| {
        let stated = unit_and_factor(key.get(4..)?)?;
        (stated.0 == unit).then(|| leading_number(value))?
    });
    channel.values = lines.values(points, "NDATA", None, BlockEnd::Text)?;
    channel.values.iter_mut().for_each(|value| *value *= factor);
    title.push(&channel.name);
    Ok(Recording {
        title: title.join(" "),
        channels: vec![channel],
        warnings: Vec::new(),
    })
}
