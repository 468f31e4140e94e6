//! Formats with one column for each component: NSMN, CWA, BBP and UNAM.

use super::lines::{Lines, is_text, leading_number, number_after, uniform_step, unit_and_factor};
use super::{Channel, Recording, StatedDuration};
use crate::error::{MotionError, Short};
use crate::unit::Unit;

/// Lines that a header may have.
const LONGEST_HEADER: usize = 400;

/// The next line of a header; `None` where the values begin.
fn header_line<'a>(lines: &mut Lines<'a>) -> Result<Option<&'a str>, MotionError> {
    // A rule of asterisks is no field that overflowed.
    let is_rule = |line: &str| line.trim().len() > 20 && line.trim().bytes().all(|b| b == b'*');
    let is_header = |line: &&str| is_text(line) || is_rule(line);
    let Some(line) = lines.peek().filter(is_header) else {
        return Ok(None);
    };
    lines.next();
    if lines.at > LONGEST_HEADER {
        return Err(lines.refuse(
            "the first row of values after at most 400 header lines",
            line,
        ));
    }
    Ok(Some(line.trim()))
}

/// One channel for each name, with its column of `table`.
fn channels(names: &[String], table: Vec<Vec<f64>>, dt: f64, unit: (Unit, f64)) -> Vec<Channel> {
    let (unit, factor) = unit;
    let scaled = |values: Vec<f64>| values.iter().map(|value| value * factor).collect();
    names
        .iter()
        .zip(table)
        .map(|(name, values)| Channel {
            name: name.clone(),
            aliases: Vec::new(),
            dt: Some(dt),
            unit: Some(unit),
            stated_peak: None,
            stated_durations: Vec::new(),
            values: scaled(values),
        })
        .collect()
}

/// NSMN: lines `KEY : value`, a line of names, then N-S, E-W and U-D in gal.
pub(super) fn nsmn(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let (mut points, mut dt) = (None, None);
    let mut title = "";
    while let Some(line) = header_line(lines)? {
        let (key, value) = line.split_once(':').unwrap_or((line, ""));
        let (key, value) = (key.to_ascii_uppercase(), value.trim());
        if key.starts_with("NUMBER OF DATA") {
            points = leading_number(value);
        } else if key.starts_with("SAMPLING INTERVAL") {
            dt = leading_number(value).filter(|dt| *dt > 0.0);
        } else if key.starts_with("STATION ID") {
            title = value;
        }
    }
    let missing = |what| lines.refuse(what, "the end of the header");
    let points = points.ok_or_else(|| missing("a line NUMBER OF DATA"))?;
    let dt = dt.ok_or_else(|| missing("a line SAMPLING INTERVAL with a positive step"))?;
    let points = lines.points(points, "a whole NUMBER OF DATA")?;
    let table = lines.rows(3, Some(12))?;
    check_rows(lines, "NUMBER OF DATA", points, &table)?;
    let names = ["N-S", "E-W", "U-D"].map(str::to_owned);
    Ok(Recording {
        title: title.to_owned(),
        channels: channels(&names, table, dt, (Unit::Gal, 1.0)),
        warnings: Vec::new(),
    })
}

fn check_rows(
    lines: &Lines<'_>,
    key: &'static str,
    announced: usize,
    table: &[Vec<f64>],
) -> Result<(), MotionError> {
    let found = table.first().map_or(0, Vec::len);
    if found == announced {
        return Ok(());
    }
    Err(lines.count(key, announced, found))
}

/// CWA free format: lines `#Key: value`, then time and the columns that `#DataSequence` names.
pub(super) fn cwa(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let (mut rate, mut length, mut unit) = (None, None, None);
    let mut names: Vec<String> = Vec::new();
    let mut title = "";
    while let Some(line) = header_line(lines)? {
        let (key, value) = line.split_once(':').unwrap_or((line, ""));
        let value = value.trim();
        if key.starts_with("#SampleRate") {
            rate = leading_number(value).filter(|rate| *rate > 0.0);
        } else if key.starts_with("#RecordLength") {
            length = leading_number(value);
        } else if key.starts_with("#AmplitudeUnit") {
            unit = value.split_whitespace().next().and_then(unit_and_factor);
        } else if key.starts_with("#StationCode") {
            title = value;
        } else if key.starts_with("#DataSequence") {
            let columns = value.trim_start_matches("Time").split(';');
            names = columns
                .map(|column| column.split('(').next().unwrap_or("").trim().to_owned())
                .collect();
            if value.contains("(-)") {
                return Err(lines.refuse("columns with a positive sign (+)", value));
            }
        }
    }
    let missing = |what| lines.refuse(what, "the end of the header");
    let rate = rate.ok_or_else(|| missing("a line #SampleRate with a positive rate"))?;
    let unit = unit.ok_or_else(|| missing("a line #AmplitudeUnit with a known unit"))?;
    if names.is_empty() {
        return Err(missing("a line #DataSequence: Time U(+); N(+); E(+)"));
    }
    let first = lines.at + 1;
    let mut table = lines.rows(1 + names.len(), Some(10))?;
    let times = table.remove(0);
    let measured = uniform_step(lines.file, &times, first)?;
    let dt = 1.0 / rate;
    // A third of a step over the whole record: print rounds the last time by less.
    if (measured - dt).abs() * times.len() as f64 > dt / 3.0 {
        let found = format!(
            "{} Hz in the header, {} s between the rows",
            Short(rate),
            Short(measured)
        );
        return Err(lines.refuse("a column of times at the stated rate", &found));
    }
    let announced = length.map(|length| (length * rate).round());
    // Some records have the last instant, too.
    let found = times.len() as f64;
    if let Some(announced) = announced
        && !(announced..=announced + 1.0).contains(&found)
    {
        let announced = lines.points(announced, "a positive #RecordLength")?;
        return Err(lines.count("#RecordLength × #SampleRate", announced, times.len()));
    }
    Ok(Recording {
        title: title.to_owned(),
        channels: channels(&names, table, dt, unit),
        warnings: Vec::new(),
    })
}

/// The columns behind the time in the heading of a BBP file, with their units; `None` if a line is no such heading.
///
/// `#  time(sec)  N-S(cm/s/s)  E-W(cm/s/s)  U-D(cm/s/s)`
pub(super) fn bbp_heading(line: &str) -> Option<Vec<(String, (Unit, f64))>> {
    let mut words = line
        .strip_prefix(['#', '%'])?
        .trim_start_matches(['#', '%'])
        .split_whitespace();
    words.next().filter(|time| time.starts_with("time(s"))?;
    let columns: Option<Vec<_>> = words
        .map(|word| {
            let (name, unit) = word.split_once('(')?;
            Some((name.to_owned(), unit_and_factor(unit)?))
        })
        .collect();
    columns.filter(|columns| columns.first().is_some_and(|(name, _)| name == "N-S"))
}

/// BBP: comments, of which one names the columns and their units, then time and these columns.
pub(super) fn bbp(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    const WANTED: &str = "a heading such as `# time(sec) N-S(cm/s/s) E-W(cm/s/s) U-D(cm/s/s)`";
    let mut columns = Vec::new();
    let mut title = "";
    while let Some(line) = header_line(lines)? {
        match bbp_heading(line) {
            Some(heading) => columns = heading,
            None if title.is_empty() => title = line.trim_start_matches(['#', '%', ' ']),
            None => {}
        }
    }
    let Some((_, unit)) = columns.first().cloned() else {
        return Err(lines.refuse(WANTED, "the end of the header"));
    };
    if columns.iter().any(|(_, other)| *other != unit) {
        return Err(lines.refuse("columns of one unit", "several units"));
    }
    let first = lines.at + 1;
    let mut table = lines.rows(1 + columns.len(), None)?;
    let times = table.remove(0);
    let dt = uniform_step(lines.file, &times, first)?;
    if let Some(line) = lines.peek() {
        lines.next();
        return Err(lines.refuse("rows of numbers up to the end of the file", line));
    }
    let names: Vec<String> = columns.into_iter().map(|(name, _)| name).collect();
    Ok(Recording {
        title: title.to_owned(),
        channels: channels(&names, table, dt, unit),
        warnings: Vec::new(),
    })
}

/// UNAM, `archivo estándar de aceleración`: keys in Spanish with one entry `/…` for each channel, then the columns.
pub(super) fn unam(lines: &mut Lines<'_>) -> Result<Recording, MotionError> {
    let (mut steps, mut counts, mut directions) = (Vec::new(), Vec::new(), Vec::new());
    let (mut durations, mut peaks) = (Vec::new(), Vec::new());
    let (mut unit, mut decimation) = (None, None);
    let mut title = "";
    let mut line_of_durations = 0;
    while let Some(line) = header_line(lines)? {
        let (key, value) = line.split_once(':').unwrap_or((line, ""));
        let entries = || {
            value
                .split('/')
                .map(str::trim)
                .filter(|entry| !entry.is_empty())
        };
        if key.starts_with("INTERVALO DE MUESTREO, C1") {
            steps = entries().filter_map(leading_number).collect();
        } else if key.starts_with("NUM. TOTAL DE MUESTRAS, C1") {
            counts = entries().filter_map(leading_number).collect();
        } else if key.starts_with("ORIENTACION C1") {
            directions = entries().map(str::to_owned).collect();
        } else if key.starts_with("UNIDADES DE LOS DATOS") {
            unit = value.split_whitespace().find_map(unit_and_factor);
        } else if key.starts_with("DURACION DEL REGISTRO (s), C1") {
            durations = entries().map(leading_number).collect();
            line_of_durations = lines.at;
        } else if key.starts_with("ACEL. MAX.(") && key.contains("C1") {
            // `ACEL. MAX.(Gal), C1-C6`: the key states the unit of the peaks and of the data.
            unit = unit.or_else(|| number_unit(key));
            peaks = entries().map(leading_number).collect();
        } else if key.starts_with("FACTOR DE DECIMACION") {
            decimation = number_after(line, ":");
        } else if key.starts_with("NOMBRE DE LA ESTACION") {
            title = value.trim();
        }
    }
    let missing = |what| lines.refuse(what, "the end of the header");
    let dt = *steps
        .first()
        .ok_or_else(|| missing("a line INTERVALO DE MUESTREO, C1-C6"))?;
    let count = *counts
        .first()
        .ok_or_else(|| missing("a line NUM. TOTAL DE MUESTRAS, C1-C6"))?;
    let unit = unit.ok_or_else(|| missing("a line UNIDADES DE LOS DATOS with a known unit"))?;
    let is_uniform = steps.iter().all(|s| *s == dt) && counts.iter().all(|c| *c == count);
    if !is_uniform || steps.len() != counts.len() || dt <= 0.0 {
        return Err(missing("one positive step and one count for all channels"));
    }
    let points = lines.points(count, "a whole NUM. TOTAL DE MUESTRAS")?;
    let table = lines.rows(counts.len(), None)?;
    check_rows(lines, "NUM. TOTAL DE MUESTRAS", points, &table)?;
    let names: Vec<String> = (1..=counts.len())
        .map(|number| format!("Canal {number}"))
        .collect();
    let mut channels = channels(&names, table, dt, unit);
    for (channel, direction) in channels.iter_mut().zip(directions) {
        let plain = direction.split(';').next().unwrap_or("").trim();
        channel.aliases = vec![direction.clone(), plain.to_owned()];
        channel.aliases.dedup();
    }
    for (channel, seconds) in channels.iter_mut().zip(durations) {
        channel
            .stated_durations
            .extend(seconds.map(|seconds| StatedDuration {
                key: "DURACION DEL REGISTRO",
                line: line_of_durations,
                seconds,
                slack: 0.01,
            }));
    }
    for (channel, peak) in channels.iter_mut().zip(peaks) {
        channel.stated_peak = peak;
    }
    let mut warnings = Vec::new();
    if let Some(factor) = decimation.filter(|factor| *factor != 1.0) {
        warnings.push(format!(
            "{}: FACTOR DE DECIMACION is {factor}: check the step of {} s; dt_s overrules it",
            lines.file,
            Short(dt)
        ));
    }
    Ok(Recording {
        title: title.to_owned(),
        channels,
        warnings,
    })
}

/// The unit in the brackets of a key.
fn number_unit(key: &str) -> Option<(Unit, f64)> {
    let (_, rest) = key.split_once('(')?;
    unit_and_factor(rest.split(')').next()?)
}
