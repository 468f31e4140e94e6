//! Notes: events from outside the loop, on their way to `events.jsonl` and the log.

use serde_json::{Map, Value};

use crate::text::printable;
use crate::units::{in_axis_unit, unit_of_key};

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
        let words = self.words(time);
        match self.level {
            NoteLevel::Info => tracing::info!("{words}"),
            NoteLevel::Warning => tracing::warn!("{words}"),
            NoteLevel::Error => tracing::error!("{words}"),
        }
    }

    /// Its sentence for people: place, event, reason, details. A key is left out if the sentence has its value already; the
    /// file has every key in full precision.
    fn words(&self, time: Option<f64>) -> String {
        let mut words = time.map_or_else(String::new, |time| format!("t = {time:.4} s: "));
        words.push_str(&self.subject());
        words.push_str(&match self.event.as_str() {
            "link" => "could not be connected".to_owned(),
            "trip" => "TRIP".to_owned(),
            "ended" => "the test ended".to_owned(),
            other => other.replace('_', " "),
        });
        let reason = REASONS.iter().find_map(|key| self.fields.get(*key));
        if let Some(reason) = reason {
            words.push_str(": ");
            words.push_str(&plain(reason));
        }
        let details = self.fields.iter().filter_map(|(key, value)| {
            let is_told = IN_THE_PLACE.contains(&key.as_str()) || REASONS.contains(&key.as_str());
            // A limit is named with its numbers in the text.
            let is_in_the_text = reason.is_some() && IN_THE_TEXT.contains(&key.as_str());
            (!is_told && !is_in_the_text && !value.is_object()).then(|| self.detail(key, value))
        });
        let details: Vec<String> = details.collect();
        if !details.is_empty() {
            words.push_str(&format!(" ({})", details.join(", ")));
        }
        words
    }

    /// The specimen by its name, or by its number.
    fn subject(&self) -> String {
        let text = |key: &str| self.fields.get(key).map(plain);
        match (text("name"), text("specimen")) {
            (Some(name), _) => format!("specimen \"{name}\": "),
            (None, Some(number)) => format!("specimen {number}: "),
            (None, None) => String::new(),
        }
    }

    /// One more key in words, with the unit that the note gives, or that the key ends with.
    fn detail(&self, key: &str, value: &Value) -> String {
        let given = self.fields.get("unit").and_then(Value::as_str);
        let unit = match key {
            "value" | "bound" => given.unwrap_or_default(),
            key => unit_of_key(key),
        };
        let number = value
            .as_f64()
            .filter(|_| !value.is_i64() && !value.is_u64());
        let value = number.map_or_else(|| plain(value), |number| in_axis_unit(number, unit));
        match key {
            "bound" => format!("allowed {value}"),
            "rows_lost" => format!("{value} rows lost"),
            "to_full_queue" => format!("{value} of them because the queue was full"),
            "to_file_error" => format!("{value} of them because a file could not be written"),
            key => format!("{} {value}", key.replace('_', " ")),
        }
    }
}

/// Keys of what happened, in words.
const REASONS: [&str; 4] = ["text", "message", "error", "why"];
/// Keys that say where it happened.
const IN_THE_PLACE: [&str; 3] = ["specimen", "name", "unit"];
/// Keys of a limit, which the text of a trip names and rounds.
const IN_THE_TEXT: [&str; 6] = ["what", "code", "axis", "unit", "value", "bound"];

/// A text without quotation marks, anything else as JSON writes it.
fn plain(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_line_names_the_specimen_and_rounds_its_numbers() {
        let refused = Note::new(NoteLevel::Error, "link")
            .with("specimen", 1)
            .with("name", "column")
            .with("message", "127.0.0.1:27000: connection refused");
        assert_eq!(
            refused.words(None),
            "specimen \"column\": could not be connected: 127.0.0.1:27000: connection refused"
        );
        let value = 70_043.014_535_514_17;
        let trip = |text: Option<&str>| {
            let note = Note::new(NoteLevel::Error, "trip")
                .with("what", "measured_force_n")
                .with("code", 6)
                .with("axis", 1)
                .with("unit", "N")
                .with("value", value)
                .with("bound", 7e4);
            match text {
                Some(text) => note.with("text", text),
                None => note,
            }
        };
        let text = "axis 1: measured force 70.04 kN, allowed 70 kN (measured_force_n)";
        let words = trip(Some(text)).words(Some(1.0 / 3.0));
        assert_eq!(words, format!("t = 0.3333 s: TRIP: {text}"));
        let words = trip(None).words(None);
        assert!(
            words.contains("value 70.04 kN") && words.contains("allowed 70 kN"),
            "{words}"
        );
        // The file keeps full precision.
        assert_eq!(trip(None).fields["value"], value);
        let lost = Note::new(NoteLevel::Error, "write_failed")
            .with("error", "no space left")
            .with("file", "samples.bin")
            .with("rows_lost", 12);
        assert_eq!(
            lost.words(None),
            "write failed: no space left (file samples.bin, 12 rows lost)"
        );
    }
}
