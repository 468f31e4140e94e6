//! Strong-motion records in the formats of the networks that publish them.
//!
//! | `format` | network, layout |
//! |---|---|
//! | `knet` | K-NET and KiK-net (Japan), ASCII: 17 header lines, counts times the scale factor |
//! | `cosmos` | COSMOS V1 and V2: headers of integers and reals, one or more channels |
//! | `csmip` | CSMIP, CDMG and USC (California) V1 and V2, BHRC (Iran) V1: one or more channels |
//! | `renadic` | RENADIC (Chile): pairs of time and acceleration in g/10 |
//! | `esm` | ESM, ITACA and AFAD (Europe, Italy, Türkiye), ASCII: `KEY: value` lines, then one value a line |
//! | `geonet` | GeoNet (New Zealand) V1A and V2A: three components in mm/s² |
//! | `nsmn` | NSMN (Türkiye): three columns in gal |
//! | `cwa` | CWA, formerly CWB (Taiwan), free format: time and three columns |
//! | `smc` | USGS SMC: one component |
//! | `bbp` | SCEC Broadband Platform: time and three columns |
//! | `unam` | ASA (Mexico): one column for each channel |
//!
//! A file with several components needs `column`: the name of a component, or its number from 1. Accelerations are
//! counted first, then velocities, then displacements. Each count that a header states is compared with the values
//! of the file; each stated duration and peak, too. Nothing is filtered, and no offset is removed.

mod binary;
mod columns;
mod cosmos;
mod csmip;
mod esm;
mod geonet;
mod knet;
mod lines;
mod smc;
#[cfg(test)]
mod tests;

use super::peer::chosen_step;
use super::text::{lines, shorten_to};
use super::{Column, ReadOptions, Record, RecordFormat, RecordSource};
use crate::error::{MotionError, all_finite, positive};
use crate::unit::{Quantity, Unit};

use self::lines::Lines;
pub(super) use binary::refuse as refuse_binary;

/// One component of a recording.
#[derive(Debug, Default)]
struct Channel {
    /// The name by which `column` chooses it.
    name: String,
    /// Other names that the file gives it.
    aliases: Vec<String>,
    /// Time step in s.
    dt: Option<f64>,
    unit: Option<Unit>,
    /// The largest magnitude that the header states, in `unit`.
    stated_peak: Option<f64>,
    stated_durations: Vec<StatedDuration>,
    values: Vec<f64>,
}

/// Second word in the name of a component that is no acceleration.
fn kind(unit: Option<Unit>) -> &'static str {
    match unit.map(Unit::quantity) {
        Some(Quantity::Velocity) => " velocity",
        Some(Quantity::Displacement) => " displacement",
        _ => "",
    }
}

/// A duration that the header of a component states.
#[derive(Debug, Clone, Copy)]
struct StatedDuration {
    /// What states it, as the header calls it.
    key: &'static str,
    /// Line of the file, from 1.
    line: usize,
    seconds: f64,
    /// How much its print hides, in s.
    slack: f64,
}

impl Channel {
    /// The count of values times their step must be each stated duration, or one step more.
    fn check_durations(&self, file: &str) -> Result<(), MotionError> {
        let Some(dt) = self.dt else {
            return Ok(());
        };
        let points = self.values.len();
        let whole = points as f64 * dt;
        let differs = |stated: &&StatedDuration| {
            // Headers print a step to 1 ns.
            (stated.seconds - whole).abs() > 1.5 * dt + stated.slack + 1e-9 * points as f64
        };
        match self.stated_durations.iter().find(differs) {
            None => Ok(()),
            Some(stated) => Err(MotionError::Duration {
                file: file.into(),
                line: stated.line,
                key: stated.key,
                stated: stated.seconds,
                points,
                dt,
            }),
        }
    }
}

/// All components of a file.
#[derive(Debug, Default)]
struct Recording {
    title: String,
    channels: Vec<Channel>,
    warnings: Vec<String>,
}

/// Components that a file may have.
const MOST_CHANNELS: usize = 1000;

impl Recording {
    /// Adds a component.
    fn push(&mut self, lines: &Lines<'_>, channel: Channel) -> Result<(), MotionError> {
        self.channels.push(channel);
        if self.channels.len() > MOST_CHANNELS {
            return Err(MotionError::TooLarge {
                file: lines.file.into(),
                what: "components",
                found: self.channels.len(),
                limit: MOST_CHANNELS,
            });
        }
        Ok(())
    }
}

/// The format whose marks the first lines of a file contain, if they are those of one of these formats.
pub(super) fn detect(start: &str) -> Option<RecordFormat> {
    // A byte-order mark and blank lines may precede the first line.
    let start = start.trim_start_matches('\u{feff}').trim_start();
    let all = || lines(start).map(|(_, line)| line);
    let first: Vec<String> = all()
        .take(12)
        .map(|line| line.trim().to_ascii_uppercase())
        .collect();
    let line = |at: usize| first.get(at).map_or("", String::as_str);
    let any = |mark: &str| first.iter().any(|line| line.contains(mark));
    let is_labelled = |key: &str| all().any(|line| line.starts_with(key));
    if line(0).starts_with("ORIGIN TIME") && any("STATION CODE") {
        return Some(RecordFormat::Knet);
    }
    if line(0).contains("(FORMAT V") && line(0).contains("TEXT LINES") {
        return Some(RecordFormat::Cosmos);
    }
    if line(0).contains("GNS SCIENCE") && line(0).contains("ACCELEROGRAM") {
        return Some(RecordFormat::Geonet);
    }
    if smc::is_first_line(line(0)) && line(1).starts_with('*') {
        return Some(RecordFormat::Smc);
    }
    if csmip::is_first_line(line(0)) {
        let chile = any("RENADIC");
        return Some(if chile {
            RecordFormat::Renadic
        } else {
            RecordFormat::Csmip
        });
    }
    if line(0).starts_with("EVENT_NAME:") && is_labelled("EVENT_ID:") {
        return Some(RecordFormat::Esm);
    }
    if line(0).contains("STRONG GROUND MOTION RECORDS OF TURKIYE") {
        return Some(RecordFormat::Nsmn);
    }
    if is_labelled("#SampleRate") && is_labelled("#AmplitudeUnit") {
        return Some(RecordFormat::Cwa);
    }
    if any("ARCHIVO ESTANDAR DE ACELERACION") {
        return Some(RecordFormat::Unam);
    }
    all()
        .any(|line| columns::bbp_heading(line).is_some())
        .then_some(RecordFormat::Bbp)
}

/// Reads the text of a file in one of these formats.
///
/// # Errors
/// Those of [`MotionError`] that name a file.
pub(super) fn parse(
    name: &str,
    text: &str,
    format: RecordFormat,
    options: &ReadOptions,
) -> Result<Record, MotionError> {
    let what = "a record of a strong-motion network";
    let read = match format {
        RecordFormat::Knet => knet::parse,
        RecordFormat::Cosmos => cosmos::parse,
        RecordFormat::Csmip | RecordFormat::Renadic => csmip::parse,
        RecordFormat::Esm => esm::parse,
        RecordFormat::Geonet => geonet::parse,
        RecordFormat::Nsmn => columns::nsmn,
        RecordFormat::Cwa => columns::cwa,
        RecordFormat::Smc => smc::parse,
        RecordFormat::Bbp => columns::bbp,
        RecordFormat::Unam => columns::unam,
        RecordFormat::Peer
        | RecordFormat::Table
        | RecordFormat::Csv
        | RecordFormat::TwoColumn
        | RecordFormat::OneColumn
        | RecordFormat::List
        | RecordFormat::Npy => {
            let key = "format";
            return Err(MotionError::NotApplicable { key, what });
        }
    };
    if options.time_column.is_some() {
        let key = "time_column";
        return Err(MotionError::NotApplicable { key, what });
    }
    record(name, read(&mut Lines::new(name, text))?, options)
}

/// The chosen component as a record.
fn record(name: &str, recording: Recording, options: &ReadOptions) -> Result<Record, MotionError> {
    let Recording {
        title,
        mut channels,
        mut warnings,
    } = recording;
    channels.sort_by_key(|channel| rank(channel.unit));
    let at = choose(name, &channels, options.column.as_ref())?;
    let is_one_of_several = channels.len() > 1;
    let channel = channels.swap_remove(at);
    if channel.values.is_empty() {
        return Err(MotionError::Empty { file: name.into() });
    }
    all_finite("the record in the unit of the file", &channel.values)?;
    if let Some(dt) = channel.dt {
        positive("the time step of the file", dt)?;
    }
    if options.dt.is_none() {
        channel.check_durations(name)?;
    }
    let dt = chosen_step(name, channel.dt, options.dt, &mut warnings)?;
    warn_of_peak_and_offset(name, &channel, &mut warnings);
    Ok(Record {
        dt,
        values: channel.values,
        unit: channel.unit,
        title: shorten_to(title.trim(), 200),
        warnings,
        source: RecordSource {
            format: None,
            column: is_one_of_several.then_some(at + 1),
            name: (!channel.name.is_empty()).then_some(channel.name),
            ..RecordSource::default()
        },
    })
}

/// Accelerations come first, then velocities, then displacements.
fn rank(unit: Option<Unit>) -> u8 {
    match unit.map(Unit::quantity) {
        None | Some(Quantity::Acceleration | Quantity::Force) => 0,
        Some(Quantity::Velocity) => 1,
        Some(Quantity::Displacement) => 2,
    }
}

/// Index of the component that `column` names. Without `column`: the only component, or the only acceleration.
fn choose(name: &str, channels: &[Channel], column: Option<&Column>) -> Result<usize, MotionError> {
    let unknown = |wanted: String| MotionError::ColumnUnknown {
        file: name.into(),
        wanted,
        available: available(channels),
    };
    match column {
        Some(Column::Number(number)) => number
            .checked_sub(1)
            .filter(|at| *at < channels.len())
            .ok_or_else(|| unknown(number.to_string())),
        Some(Column::Name(text)) => {
            let wanted = plain(text);
            let is_called = |channel: &Channel| {
                plain(&channel.name) == wanted
                    || channel.aliases.iter().any(|alias| plain(alias) == wanted)
            };
            let mut found = (0..).zip(channels).filter(|(_, c)| is_called(c));
            match (found.next(), found.next()) {
                (None, _) => Err(unknown(format!("{text:?}"))),
                (Some((at, _)), None) => Ok(at),
                (Some((first, _)), Some((second, _))) => Err(MotionError::ColumnTwice {
                    file: name.into(),
                    column: text.clone(),
                    numbers: [first + 1, second + 1],
                }),
            }
        }
        None => {
            let accelerations = channels.iter().filter(|c| rank(c.unit) == 0).count();
            match (channels.len(), accelerations) {
                (0, _) => Err(MotionError::Empty { file: name.into() }),
                (1, _) | (_, 1) => Ok(0),
                _ => Err(MotionError::ColumnChoice {
                    file: name.into(),
                    available: available(channels),
                }),
            }
        }
    }
}

/// A name in the spelling that is compared: `N-S` and `ns` are equal, `Channel 3` and `Chan 3`, too.
fn plain(name: &str) -> String {
    let upper = name.to_ascii_uppercase().replace("CHANNEL", "CHAN");
    upper.chars().filter(char::is_ascii_alphanumeric).collect()
}

/// The components with their numbers, for a message.
fn available(channels: &[Channel]) -> String {
    const SHOWN: usize = 12;
    let mut list = (1..)
        .zip(channels)
        .take(SHOWN)
        .map(|(number, channel)| match channel.aliases.first() {
            Some(alias) => format!("{number} = {:?} ({alias})", channel.name),
            None => format!("{number} = {:?}", channel.name),
        })
        .collect::<Vec<_>>()
        .join(", ");
    if channels.len() > SHOWN {
        list.push_str(&format!(" and {} more", channels.len() - SHOWN));
    }
    list
}

/// Share of the peak by which a stated peak may differ, and which an offset may reach, without a warning.
const NEGLIGIBLE: f64 = 0.02;

/// Warns where the header states another peak, and where an acceleration has an offset.
fn warn_of_peak_and_offset(name: &str, channel: &Channel, warnings: &mut Vec<String>) {
    let values = &channel.values;
    let unit = channel.unit.map_or("", Unit::name);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let peak_about = |zero: f64| {
        values
            .iter()
            .fold(0.0, |peak: f64, v| peak.max((v - zero).abs()))
    };
    let (raw, centred) = (peak_about(0.0), peak_about(mean));
    if let Some(stated) = channel.stated_peak.map(f64::abs) {
        let differs = |found: f64| (found - stated).abs() > NEGLIGIBLE * stated.max(found);
        if differs(raw) && differs(centred) {
            warnings.push(format!(
                "{name}: the header states a peak of {stated:.4} {unit}, the values reach {raw:.4} {unit}: \
                 check unit and scale"
            ));
        }
    }
    if rank(channel.unit) == 0 && mean.abs() > NEGLIGIBLE * centred {
        warnings.push(format!(
            "{name}: the acceleration has an offset of {mean:.4} {unit} (its mean) beside a peak of \
             {centred:.4} {unit}; the offset stays in the motion: set processing.detrend to remove it"
        ));
    }
}
