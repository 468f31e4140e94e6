//! Why a test ended, in words, and the reports of its specimens after the last command.

use super::origin::ACCEPT;
use gusset_control::engine::{EndPosition, Ending, IncompleteShutdown, Outcome, Stop};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{AGREED, Holder};

/// How a test ended, and why in words.
#[must_use]
pub fn ending(outcome: &Outcome) -> (Cause, String) {
    let of = |index: usize| named(index, outcome);
    let mut reason = match &outcome.unfinished {
        None => {
            let mut reason = words(&outcome.ending, outcome);
            for (index, left) in outcome.left.iter().enumerate() {
                let EndPosition::NotReached(why) = left else {
                    continue;
                };
                reason = format!("{reason}; {} did not reach its end position", of(index));
                if let Some(why) = why {
                    reason = format!("{reason}: {why}");
                }
            }
            reason
        }
        Some(IncompleteShutdown { stop, after }) => {
            let (stop, before) = (
                words(&Ending::Stopped(*stop), outcome),
                words(after, outcome),
            );
            if outcome.ending == *after {
                format!("{before}; shutdown not completed: {stop}")
            } else {
                format!(
                    "{stop}; this happened during the shutdown ({before}), which is not completed"
                )
            }
        }
    };
    let lost = left_as(outcome, EndPosition::Lost);
    for (index, _) in lost.filter(|(index, _)| !outcome.unheard.contains(index)) {
        let name = of(index);
        reason.push_str(&match outcome.holders.get(index) {
            Some(Holder::ItsWatchdog) => {
                format!("; {name}: {AGREED}")
            }
            Some(Holder::NeverArmed) => {
                format!("; {name} was never armed: no command was sent to it")
            }
            Some(Holder::Unknown) => {
                format!("; only the server of {name} knows its position")
            }
            Some(Holder::Nobody) => {
                format!("; no watchdog holds {name}: it is where its own controller leaves it")
            }
            Some(Holder::Needless) | None => String::new(),
        });
    }
    for index in &outcome.unarmed {
        reason = format!(
            "{reason}; {} was being armed: it moved a little if a wiring check was due, and its server holds it",
            of(*index)
        );
    }
    for index in &outcome.unheard {
        reason = format!(
            "{reason}; {} did not acknowledge the end of the test: {AGREED}",
            of(*index)
        );
    }
    for (index, text) in news(outcome) {
        reason = format!("{reason}; {} reported after the test: {text}", of(*index));
    }
    (outcome.ending.cause(), reason)
}

/// The specimens with this end position.
fn left_as(outcome: &Outcome, how: EndPosition) -> impl Iterator<Item = (usize, &EndPosition)> {
    let left = outcome.left.iter().enumerate();
    left.filter(move |(_, left)| **left == how)
}

/// Why a test stopped, with the specimen by its name.
fn stop_words(stop: &Stop, outcome: &Outcome) -> String {
    stop.with_name(|port| named(port, outcome))
}

/// A specimen by its name.
fn named(port: usize, outcome: &Outcome) -> String {
    match outcome.ports.get(port) {
        Some((name, ..)) => format!("specimen \"{name}\""),
        None => format!("specimen {}", port + 1),
    }
}

fn words(ending: &Ending, outcome: &Outcome) -> String {
    let Ending::Stopped(stop) = ending else {
        return ending.to_string();
    };
    let told = match stop {
        // A gateway reports which of its limits opened the interlock.
        Stop::Link { port, .. } | Stop::Interlock { port } => {
            outcome.complaints.iter().find(|(index, _)| index == port)
        }
        _ => None,
    };
    let mut reason = stop_words(stop, outcome);
    if let Some((_, text)) = told {
        reason = format!("{reason} ({text})");
    }
    match stop {
        Stop::Link { fault, .. } => reason = format!("{reason}: {}", fault.advice()),
        Stop::Stale { .. } => {
            reason.push_str(
                ": its replies are late, lost or all to one old command. `link` in the summary counts them. The limit is \
                 `max_stale` in [specimen.link], or `stale_ticks` of its bus",
            );
        }
        Stop::Moved { .. } => {
            reason = format!(
                "{reason}: the specimen has changed since the interruption. Nothing was moved. `[safety] resume_within_m` is the tolerance; {ACCEPT}"
            );
        }
        Stop::ForceChanged { .. } => {
            reason = format!(
                "{reason}: the specimen has changed since the interruption. Nothing was moved. `[safety] resume_within_n` is the tolerance; {ACCEPT}"
            );
        }
        Stop::HoldsOn { .. } => {
            reason.push_str(
                ": look at the specimen's server, whose watchdog acted when commands stopped",
            );
        }
        _ => {}
    }
    reason
}

/// Reports of specimens after the last command beyond a plain goodbye: by the number of the specimen, from 0, in sentences. A
/// report that the reason of the end already contains is not repeated.
pub(super) fn last_words(outcome: &Outcome) -> Vec<(usize, String)> {
    let sentence = |(index, text): &(usize, String)| {
        let name = outcome.ports.get(*index).map(|port| port.0.as_str());
        let name = name.unwrap_or_default();
        let text = format!("specimen \"{name}\" reported after the test: {text}");
        (*index, text)
    };
    news(outcome).map(sentence).collect()
}

/// Sentences about the ending in the specimens' own words.
fn news(outcome: &Outcome) -> impl Iterator<Item = &(usize, String)> {
    let mut reason = words(&outcome.ending, outcome);
    if let Some(IncompleteShutdown { stop, after }) = &outcome.unfinished {
        reason.push_str(&words(&Ending::Stopped(*stop), outcome));
        reason.push_str(&words(after, outcome));
    }
    outcome.last_words.iter().filter(move |(index, text)| {
        let mut complaints = outcome.complaints.iter();
        !complaints.any(|(of, told)| of == index && text.ends_with(told) && reason.contains(told))
    })
}
