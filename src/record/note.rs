//! Notes: events from outside the loop, on their way to `events.jsonl` and the log.

use serde_json::{Map, Value};

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

/// An event from outside the loop: a state change, a warning, what the system granted.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// How grave.
    pub level: NoteLevel,
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
            event: event.to_owned(),
            fields: Map::new(),
        }
    }

    /// The note with one more key.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.fields.insert(key.to_owned(), value.into());
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
