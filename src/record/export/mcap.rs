//! The run as MCAP, which Foxglove and PlotJuggler open.
//!
//! | channel | message |
//! |---|---|
//! | `/state` | response of the structure, ground motion, requested sums |
//! | `/specimen/NAME` | what was commanded and measured at a specimen |
//! | `/members` | deformations and forces of the recorded members |
//! | `/loop`, `/timing` | all other columns; those that depend on wall time |
//! | `/events` | the lines of `events.jsonl` |
//!
//! A message is a JSON object with a field per column and its test time; a value that does not exist is left out. Its log time is
//! the wall time at which its tick began or its event happened. The first `grid` event has a wall time and a time of the loop's clock,
//! which convert all others. A served test and an older folder lack it or the stamps: the log time is then the start of the run plus
//! the test time. The schema of a channel (JSON Schema) has the meaning and unit of each field, and the metadata of the channel has the
//! units by field. Nothing is compressed.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use serde_json::{Map, Value, json};

use super::designsafe::test::Test;
use super::plan::{Choice, Exposed, Plan, Source};
use super::trace::{grid::Grid, stamps::Stamps};
use super::{ExportError, Exported, Extra, Notice, metadata};
use crate::atomic::AtomicFile;
use crate::run::Run;
use crate::utc;
use crate::{Event, EventLine};
use gusset_quantity::catalog::column::{self, Each, GROUND};

type Out = Writer<BufWriter<AtomicFile>>;

/// Writes all columns and the events.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let refused = |error: McapError| failed(system(error));
    let plan = Plan::new(run.layout(), &extra.sums)?;
    let told = run.events()?;
    let left_out = told.left_out.values().sum();
    let mut times = Times::of(run, &plan, &told.events);
    let is_wanted = |event: &EventLine| event.time.is_none_or(|time| choice.holds(time));
    let mut events = told
        .events
        .iter()
        .filter(|event| is_wanted(event))
        .peekable();

    let file = AtomicFile::create(out).map_err(failed)?;
    let options = WriteOptions::new()
        .compression(None)
        .library(concat!("gusset ", env!("CARGO_PKG_VERSION")));
    let mut file = options.create(BufWriter::new(file)).map_err(refused)?;
    let pairs = metadata(run).into_iter();
    file.write_metadata(&Metadata {
        name: "gusset".to_owned(),
        metadata: pairs.map(|(key, value)| (key.to_owned(), value)).collect(),
    })
    .map_err(refused)?;
    let mut channels = Vec::new();
    for (topic, columns) in groups(&plan, &Test::read(run)) {
        channels.push(Channel::of_columns(&mut file, &topic, &columns).map_err(refused)?);
    }
    let mut of_events = Channel::of_events(&mut file).map_err(refused)?;

    let mut journal = run.journal()?;
    let mut text = Vec::new();
    let (mut now_ns, mut rows) = (times.start_ns, 0);
    // The grid needs all rows, also those before the window.
    let every = Choice {
        from: None,
        to: None,
        ..*choice
    };
    plan.walk(&mut journal, &every, u64::MAX, |sequence, row| {
        let time = row.get(plan.time).copied().unwrap_or(f64::NAN);
        let at_ns = times.of_row(row, time);
        if !choice.holds(time) {
            return Ok(());
        }
        // An event without a time happened between its neighbours.
        let is_before =
            |event: &EventLine| times.of_event(event).is_none_or(|ns| Some(ns) <= at_ns);
        while let Some(event) = events.next_if(|event| is_before(event)) {
            now_ns = times.of_event(event).unwrap_or(now_ns);
            of_events.event(&mut file, now_ns, event)?;
        }
        now_ns = at_ns.unwrap_or(now_ns);
        rows += 1;
        for channel in &mut channels {
            channel.object(sequence, row, &mut text)?;
            channel.send(&mut file, now_ns, &text)?;
        }
        Ok(())
    })
    .map_err(|trouble| trouble.told(failed))?;
    for event in events {
        now_ns = times.of_event(event).unwrap_or(now_ns);
        of_events.event(&mut file, now_ns, event).map_err(failed)?;
    }
    file.finish().map_err(refused)?;
    let file = file.into_inner().into_inner();
    let file = file.map_err(|error| failed(error.into_error()))?;
    file.commit().map_err(failed)?;
    let mut exported = Exported::new(run, rows, &journal).of_table(&plan);
    if left_out > 0 {
        exported.notices.push(Notice::EventsLeftOut(left_out));
    }
    Ok(exported)
}

/// Wall times of rows and events, in ns since 1970.
struct Times {
    /// When the run began.
    start_ns: u64,
    /// The stamps that place rows on the loop's clock, and one moment as wall time and on that clock; none if the folder lacks them.
    clock: Option<(Stamps, (u64, u64))>,
    grid: Grid,
}

impl Times {
    fn of(run: &Run, plan: &Plan, events: &[EventLine]) -> Self {
        let mut grids = events
            .iter()
            .filter(|line| matches!(line.event, Event::Grid { .. }));
        let moment = grids.find_map(|line| utc::instant(line.wall.as_deref()?).zip(line.clock_ns));
        Self {
            start_ns: start(run, events),
            clock: Stamps::find(run.layout(), plan.time).ok().zip(moment),
            grid: Grid::of(events),
        }
    }

    /// Wall time at which the tick of a row began; none if the row belongs to no tick.
    fn of_row(&mut self, row: &[f64], time: f64) -> Option<u64> {
        let Some((stamps, moment)) = &self.clock else {
            return Some(after(self.start_ns, time));
        };
        let release_us = self.grid.place(&stamps.read(row)).release;
        let clock_us = self.grid.zero_us()? + release_us;
        clock_us
            .is_finite()
            .then(|| on_wall(*moment, (clock_us * 1e3).round() as u64))
    }

    fn of_event(&self, event: &EventLine) -> Option<u64> {
        match &self.clock {
            Some((_, moment)) => Some(on_wall(*moment, event.clock_ns?)),
            None => Some(after(self.start_ns, event.time?)),
        }
    }
}

/// Wall time of a moment of the loop's clock.
const fn on_wall((wall_ns, then_ns): (u64, u64), clock_ns: u64) -> u64 {
    wall_ns.saturating_add_signed(clock_ns.cast_signed().saturating_sub(then_ns.cast_signed()))
}

/// Wall time in ns at which the run began; 0 if the folder does not tell.
fn start(run: &Run, events: &[EventLine]) -> u64 {
    let served = run.summary().and_then(|s| s.realtime.began_utc_ns);
    let first = || events.iter().find_map(|event| event.wall.as_deref());
    served
        .or_else(|| first().and_then(utc::instant))
        .unwrap_or_default()
}

/// The log time of a test time in s.
fn after(start_ns: u64, time: f64) -> u64 {
    // A conversion from a float saturates, and NaN is zero.
    start_ns.saturating_add_signed((time * 1e9).round() as i64)
}

/// The columns of each channel, test time first.
fn groups<'a>(plan: &'a Plan, test: &Test) -> Vec<(String, Vec<&'a Exposed>)> {
    let time = plan.columns.iter().filter(|c| is_time(c));
    let mut groups: Vec<(String, Vec<&Exposed>)> = Vec::new();
    for exposed in plan.columns.iter().filter(|c| !is_time(c)) {
        let topic = topic(exposed, test);
        let found = groups.iter_mut().find(|(name, _)| *name == topic);
        match found {
            Some((_, columns)) => columns.push(exposed),
            None => groups.push((topic, time.clone().chain([exposed]).collect())),
        }
    }
    groups
}

fn is_time(exposed: &Exposed) -> bool {
    exposed.column.name == "time"
}

fn topic(exposed: &Exposed, test: &Test) -> String {
    let name = exposed.column.name.as_str();
    let kind = column::find(name);
    if let Some(number) = kind.and_then(|kind| kind.specimen_in(name)) {
        let named = test.specimens.iter().find(|(n, _, _)| *n == number);
        let named = named.and_then(|(_, _, table)| table.get("name")?.as_str());
        return named.map_or_else(
            || format!("/specimen/{number}"),
            |name| format!("/specimen/{name}"),
        );
    }
    let is_state = matches!(exposed.source, Source::Sum(_)) || GROUND.fits(name);
    match kind.map(|kind| kind.each) {
        _ if is_state => "/state",
        Some(Each::Dof) => "/state",
        Some(Each::Member) => "/members",
        _ if exposed.column.timing => "/timing",
        _ => "/loop",
    }
    .to_owned()
}

/// A channel with what its messages need.
struct Channel {
    id: u16,
    sent: u32,
    /// The columns: their names as keys of an object, and their sources.
    fields: Vec<(String, Source)>,
}

impl Channel {
    fn begun(
        file: &mut Out,
        topic: &str,
        properties: &Map<String, Value>,
        units: &BTreeMap<String, String>,
    ) -> Result<Self, McapError> {
        let schema = json!({"title": topic, "type": "object", "properties": properties});
        let schema = schema.to_string();
        let schema = file.add_schema(topic, "jsonschema", schema.as_bytes())?;
        Ok(Self {
            id: file.add_channel(schema, topic, "json", units)?,
            sent: 0,
            fields: Vec::new(),
        })
    }

    fn of_columns(file: &mut Out, topic: &str, columns: &[&Exposed]) -> Result<Self, McapError> {
        let properties = columns.iter().map(|Exposed { column, source }| {
            let kind = match source {
                Source::Sequence => "integer",
                _ => "number",
            };
            let about = json!({"type": kind, "description": column.meaning, "unit": column.unit});
            (column.name.clone(), about)
        });
        let units = columns
            .iter()
            .map(|c| (c.column.name.clone(), c.column.unit.clone()));
        let mut channel = Self::begun(file, topic, &properties.collect(), &units.collect())?;
        let fields = columns.iter().map(|Exposed { column, source }| {
            let key = Value::from(column.name.as_str());
            (format!("{key}:"), source.clone())
        });
        channel.fields = fields.collect();
        Ok(channel)
    }

    fn of_events(file: &mut Out) -> Result<Self, McapError> {
        let known = [
            ("event", "string", ""),
            ("sentence", "string", ""),
            ("time", "number", "s"),
            ("tick", "integer", "1"),
            ("wall", "string", ""),
            ("clock_ns", "integer", "ns"),
        ];
        let properties = known.map(|(name, kind, unit)| {
            let about = json!({"type": [kind, "null"], "unit": unit});
            (name.to_owned(), about)
        });
        let units = known.map(|(name, _, unit)| (name.to_owned(), unit.to_owned()));
        Self::begun(
            file,
            "/events",
            &properties.into_iter().collect(),
            &units.into(),
        )
    }

    /// The numbers of a row as an object.
    fn object(&self, sequence: u64, row: &[f64], text: &mut Vec<u8>) -> io::Result<()> {
        text.clear();
        let mut between: &[u8] = b"{";
        for (key, source) in &self.fields {
            let value = source.value(row);
            let is_count = *source == Source::Sequence;
            if !is_count && !value.is_finite() {
                continue;
            }
            text.extend_from_slice(between);
            text.extend_from_slice(key.as_bytes());
            if is_count {
                write!(text, "{sequence}")?;
            } else {
                serde_json::to_writer(&mut *text, &value)?;
            }
            between = b",";
        }
        if text.is_empty() {
            text.push(b'{');
        }
        text.push(b'}');
        Ok(())
    }

    fn event(&mut self, file: &mut Out, log_time: u64, event: &EventLine) -> io::Result<()> {
        let mut line = event.to_map();
        line.insert("sentence".to_owned(), event.sentence().into());
        self.send(file, log_time, Value::from(line).to_string().as_bytes())
    }

    fn send(&mut self, file: &mut Out, log_time: u64, message: &[u8]) -> io::Result<()> {
        let header = MessageHeader {
            channel_id: self.id,
            sequence: self.sent,
            log_time,
            publish_time: log_time,
        };
        self.sent = self.sent.wrapping_add(1);
        file.write_to_known_channel(&header, message)
            .map_err(system)
    }
}

/// Error of the operating system, or else of the library.
fn system(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}
