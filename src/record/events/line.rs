//! One line of `events.jsonl`: when something happened, and what.
//!
//! `specimen` and `axis` count from 1 in a line, as in the names of the columns. A line of any version can be read: what no
//! variant of [`Event`] fits keeps its name and its fields.

use serde_json::{Map, Value};

use super::kinds::Event;
use super::sentence;
use crate::TimedEvent;
use crate::utc::rfc3339;
use gusset_quantity::catalog::event::{self, EventRow, Group, Severity};
use gusset_quantity::text::{printable, received};

/// An event with the moment at which it happened.
#[derive(Debug, Clone, PartialEq)]
pub struct EventLine {
    /// Step of the test, as in the column `step`.
    pub tick: Option<u64>,
    /// Test time in s.
    pub time: Option<f64>,
    /// UTC as RFC 3339 with nanoseconds.
    pub wall: Option<String>,
    /// Nanoseconds of the loop's clock.
    pub clock_ns: Option<u64>,
    /// What happened.
    pub event: Event,
    /// Name of the event.
    name: String,
    /// All fields of the event, with the name of its specimen.
    fields: Map<String, Value>,
}

/// Fields that every line has.
const HEAD: [&str; 5] = ["tick", "time", "wall", "clock_ns", "event"];

/// Fields that are sentences for people.
const WORDS: [&str; 4] = ["text", "message", "error", "why"];

impl EventLine {
    /// A line that is to be written. Hidden characters of a text are spelled.
    pub(crate) fn new(
        event: Event,
        (tick, time): (Option<u64>, Option<f64>),
        wall_ns: u64,
        clock_ns: Option<u64>,
        specimens: &[String],
    ) -> Self {
        let mut name = String::new();
        let mut fields = Map::new();
        for (key, value) in event.fields() {
            if let (true, Value::String(text)) = (key == "event", &value) {
                name.clone_from(text);
            }
            let number = value.as_u64().filter(|_| key == "specimen");
            let value = match value {
                Value::String(text) => Value::String(printable(&text)),
                other => other,
            };
            fields.insert(key, value);
            let place = number.and_then(|number| usize::try_from(number).ok()?.checked_sub(1));
            if let Some(name) = place.and_then(|place| specimens.get(place)) {
                fields.insert("name".to_owned(), Value::String(printable(name)));
            }
        }
        Self {
            tick,
            time,
            wall: Some(rfc3339(wall_ns)),
            clock_ns,
            name,
            event,
            fields: own(fields),
        }
    }

    /// The line of an event of the loop, without its wall time; `specimens` are their names.
    #[must_use]
    pub fn of_loop(event: &TimedEvent, specimens: &[String]) -> Self {
        let position = (Some(event.tick), Some(event.time));
        let line = Self::new(
            event.kind.clone(),
            position,
            0,
            Some(event.clock_ns),
            specimens,
        );
        Self { wall: None, ..line }
    }

    /// Name of the event.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The fields of the event, with the name of its specimen, in full precision.
    #[must_use]
    pub const fn fields(&self) -> &Map<String, Value> {
        &self.fields
    }

    /// Its row in the table of events; none for an event of another version.
    #[must_use]
    pub(crate) fn row(&self) -> Option<&'static EventRow> {
        event::find(&self.name)
    }

    /// The group in which a report lists it.
    #[must_use]
    pub fn group(&self) -> Group {
        self.row().map_or(Group::Other, |row| row.group)
    }

    /// How grave it is.
    #[must_use]
    pub(crate) fn severity(&self) -> Severity {
        self.row().map_or(Severity::Info, |row| row.severity)
    }

    /// Its sentence for people, without the time; empty for an event that only programs read.
    #[must_use]
    pub fn sentence(&self) -> String {
        sentence::of(&self.name, &self.fields)
    }

    /// The line as JSON.
    #[must_use]
    pub(crate) fn to_map(&self) -> Map<String, Value> {
        let mut line = Map::new();
        line.insert("tick".to_owned(), self.tick.into());
        line.insert("time".to_owned(), self.time.into());
        line.insert("wall".to_owned(), self.wall.as_deref().into());
        line.insert("clock_ns".to_owned(), self.clock_ns.into());
        line.insert("event".to_owned(), self.name.as_str().into());
        line.extend(self.fields.clone());
        line
    }
}

/// Without the fields of the head: an event cannot forge them.
fn own(mut fields: Map<String, Value>) -> Map<String, Value> {
    fields.retain(|key, _| !HEAD.contains(&key.as_str()));
    fields
}

impl From<Map<String, Value>> for EventLine {
    /// Reads a line of any version.
    fn from(mut line: Map<String, Value>) -> Self {
        // `kind` is an earlier spelling of `event`.
        if !line.contains_key("event")
            && let Some(kind) = line.remove("kind")
        {
            line.insert("event".to_owned(), kind);
        }
        for key in WORDS {
            if let Some(Value::String(text)) = line.get_mut(key) {
                *text = received(std::mem::take(text));
            }
        }
        let name = line.get("event").and_then(Value::as_str);
        let name = name.unwrap_or_default().to_owned();
        let wall = line.get("wall").and_then(Value::as_str);
        let (tick, time) = (line.get("tick"), line.get("time"));
        let fields = own(line.clone());
        Self {
            tick: tick.and_then(Value::as_u64),
            time: time.and_then(Value::as_f64),
            wall: wall.map(str::to_owned),
            clock_ns: line.get("clock_ns").and_then(Value::as_u64),
            event: Event::read(&name, &fields),
            name,
            fields,
        }
    }
}

impl From<Value> for EventLine {
    /// A value that is no map gives an empty line.
    fn from(line: Value) -> Self {
        match line {
            Value::Object(line) => Self::from(line),
            _ => Self::from(Map::new()),
        }
    }
}
