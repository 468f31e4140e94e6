//! Notes: events from outside the loop, on their way to `events.jsonl` and the log.

use serde_json::{Map, Value};

use crate::text::printable;

/// How grave a note is; decides the level of its log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoteLevel {
    /// Worth knowing.
    Info,
    /// Worth a look.
    Warning,
    /// Something is lost or broken.
    Error,
}

/// Where a test stands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Position {
    /// Step of the test, as the column `step` of a row has it and the loop's own events do.
    pub tick: Option<u64>,
    /// Its test time in s.
    pub time: Option<f64>,
}

/// An event from outside the loop: a state change, a warning, what the system granted.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// How grave.
    pub level: NoteLevel,
    /// Where the test stood when it was made, and CLOCK_MONOTONIC in ns then; without it, as it is taken down.
    pub made: Option<(Position, u64)>,
    /// Name in snake_case.
    pub event: String,
    /// Further keys of the line; a key that every line has is overruled by the line's own.
    pub fields: Map<String, Value>,
}

impl Note {
    /// A note without further keys.
    #[must_use]
    pub fn new(level: NoteLevel, event: &str) -> Self {
        Self {
            level,
            made: None,
            event: event.to_owned(),
            fields: Map::new(),
        }
    }

    /// The note with one more key. A text may come from anywhere: hidden characters are spelled.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        let value = match value.into() {
            Value::String(text) => Value::String(printable(&text)),
            other => other,
        };
        self.fields.insert(key.to_owned(), value);
        self
    }

    /// The note as made there, and then.
    #[must_use]
    pub const fn made(mut self, position: Position, monotonic_ns: u64) -> Self {
        self.made = Some((position, monotonic_ns));
        self
    }

    /// Its line in the program's log.
    pub(super) fn log(&self, time: Option<f64>) {
        let mut words = self.event.replace('_', " ");
        for (key, value) in &self.fields {
            let value = value
                .as_str()
                .map_or_else(|| value.to_string(), str::to_owned);
            words.push_str(&match key.as_str() {
                "text" => format!(": {value}"),
                key => format!(" {key}={value}"),
            });
        }
        match self.level {
            NoteLevel::Info => tracing::info!(time, "{words}"),
            NoteLevel::Warning => tracing::warn!(time, "{words}"),
            NoteLevel::Error => tracing::error!(time, "{words}"),
        }
    }
}
