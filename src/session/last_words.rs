//! What specimens answer to the last words of a test beyond a plain goodbye: they may have tripped when nobody looked any more.

use super::summary::words;
use crate::engine::{Ending, Outcome, Unfinished};

/// By the number of the specimen, from 0, and in sentences. What the reason of the end tells already is not said again.
pub(super) fn last_words(outcome: &Outcome) -> Vec<(usize, String)> {
    let sentence = |(index, text): &(usize, String)| {
        let name = outcome.ports.get(*index).map(|port| port.0.as_str());
        let name = name.unwrap_or_default();
        let text = format!("specimen \"{name}\" reported after the test: {text}");
        (*index, text)
    };
    news(outcome).map(sentence).collect()
}

/// The same in the specimens' own words.
pub(super) fn news(outcome: &Outcome) -> impl Iterator<Item = &(usize, String)> {
    let mut reason = words(&outcome.ending, outcome);
    if let Some(Unfinished { stop, after }) = &outcome.unfinished {
        reason.push_str(&words(&Ending::Stopped(*stop), outcome));
        reason.push_str(&words(after, outcome));
    }
    outcome.last_words.iter().filter(move |(index, text)| {
        let mut complaints = outcome.complaints.iter();
        !complaints.any(|(of, told)| of == index && text.ends_with(told) && reason.contains(told))
    })
}
