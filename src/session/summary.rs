//! Makes the summary of a run: how it ended, its peaks, metrics, limits and verdict (guide: run-folder).

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use super::Finish;
use super::connect::Unconnected;
use super::guarded::Ended;
use super::last_words::{last_words, news};
use crate::config::ClockChoice;
use crate::engine::{Ending, Gaps, Left, Outcome, Stop, Unfinished};
use crate::record::summary::{ClockKind, Lambda, LinkCounts, Peak, Status};
use crate::record::{FolderError, Recorded, RunFolder, Summary, times};
use crate::rt::Granted;
use crate::rt::timing::export::write_hgrm;
use crate::rt::timing::{Quantity, Timing};
use crate::rt::wall::Wall;
use crate::setup::Facts;
use crate::substructure::{AGREED, Holder, LinkFault};

/// How the user resumes a test although a specimen has changed.
pub(super) const ACCEPT: &str = "`--accept-changed \"reason\"` resumes the test all the same";

/// When the loop began, and how long it took on the wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    /// UTC of the start.
    pub began: Wall,
    /// Seconds of wall time.
    pub seconds: f64,
}

/// timing.json, one .hgrm per quantity, and the interval log of all of them. What could not be written is told in `unwritten`.
pub(super) fn write_timing(
    folder: &RunFolder,
    timing: &Timing,
    span: Span,
    unwritten: &mut Vec<String>,
) {
    let mut note = |result: Result<(), FolderError>| {
        if let Err(error) = result {
            unwritten.push(error.to_string());
        }
    };
    note(folder.write_timing(&timing.to_json_with_bins()));
    for quantity in Quantity::ALL {
        let mut text = Vec::new();
        // Writing into memory cannot fail.
        if write_hgrm(&timing.histogram(quantity), &mut text).is_ok() {
            note(folder.write_histogram(quantity.key(), &String::from_utf8_lossy(&text)));
        }
    }
    let mut log = Vec::new();
    let lasted = Duration::from_secs_f64(span.seconds);
    if timing
        .write_interval_log(&mut log, span.began, lasted)
        .is_ok()
    {
        note(folder.write_interval_log(&log));
    }
}

/// The summary of a run, and how it ended. `unwritten` are the files that the folder lacks.
pub(super) fn summarise(
    facts: &Facts,
    folder: &RunFolder,
    ended: &Ended,
    recorded: &Recorded,
    granted: Option<&Granted>,
    unwritten: &[String],
) -> (Finish, Summary) {
    let outcome = ended.outcome.as_ref();
    let (finish, reason) = match (&ended.fault, &ended.unconnected, outcome) {
        (None, Some(Unconnected::Refused(text)), _) => {
            (Finish::NotConnected, format!("{text}; nothing was moved"))
        }
        (None, Some(Unconnected::Unfit(text)), _) => {
            (Finish::Unfit, format!("{text}; nothing was moved"))
        }
        (None, Some(Unconnected::Stopped), _) => (
            Finish::Interrupted,
            "stopped by the operator while the specimens were being connected; nothing was moved"
                .to_owned(),
        ),
        (Some(fault), _, _) => (Finish::Panicked, format!("internal error: {fault}")),
        (None, None, Some(outcome)) => ending(outcome),
        (None, None, None) => (Finish::Panicked, "internal error".to_owned()),
    };
    let (finish, reason) = match finish {
        Finish::Completed if facts.record_required && recorded.rows_lost() > 0 => (
            Finish::Stopped,
            format!("{} rows lost, and [record] required", recorded.rows_lost()),
        ),
        Finish::Completed if facts.record_required && !recorded.damaged.is_empty() => (
            Finish::Stopped,
            format!("{}, and [record] required", recorded.damaged.join("; ")),
        ),
        _ => (finish, reason),
    };
    let mut warnings = facts.warnings.clone();
    warnings.extend(recorded.warned.iter().cloned());
    warnings.extend(recorded.damaged.iter().cloned());
    warnings.extend(unwritten.iter().map(|text| format!("not written: {text}")));
    if recorded.rows_lost() > 0 {
        let cause = recorded
            .first_error
            .as_deref()
            .unwrap_or("the queue was full");
        warnings.push(format!("{} rows are LOST: {cause}", recorded.rows_lost()));
    }
    warnings.extend(outcome.map(unsettled).into_iter().flatten());
    warnings.extend(outcome.map(held).into_iter().flatten());
    warnings.extend(outcome.and_then(|outcome| gaps(outcome.gaps)));
    let last_words = outcome.map(last_words).into_iter().flatten();
    warnings.extend(last_words.map(|(_, text)| text));
    let summary = Summary {
        status: status_of(finish),
        reason,
        steps: outcome.map_or(0, |outcome| outcome.steps),
        dt: facts.dt,
        lambda: facts.lambda().map(Lambda),
        clock: match facts.clock {
            ClockChoice::Real => ClockKind::Real,
            ClockChoice::Simulated => ClockKind::Simulated,
        },
        wall_seconds: ended.wall_ns as f64 * 1e-9,
        rate_hz: facts.rate_hz,
        deadline_misses: outcome.map_or(0, |outcome| outcome.misses),
        stretched_ticks: outcome.map_or(0, |outcome| outcome.stretched),
        peak: outcome
            .map(|outcome| peak(outcome, facts))
            .unwrap_or_default(),
        timing: outcome.map_or(Value::Null, |outcome| outcome.timing.to_json()),
        realtime: granted.map_or_else(|| json!({ "asked": false }), |granted| json!(granted)),
        link: outcome.map(links).unwrap_or_default(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        rows_lost: recorded.rows_lost(),
        inputs: folder.inputs().to_vec(),
        miss_classes: recorded.misses,
        warnings,
        limits: json!(facts.limits),
        machine: machine(),
        metrics: Value::Null,
        metrics_missing: Vec::new(),
        falsified: Value::Null,
        left: outcome.map(left).unwrap_or_default(),
        force_on_the_way_in: outcome.map(on_the_way_in).unwrap_or_default(),
        accepted: facts.accepted.clone(),
        verdict: None,
    };
    (finish, summary)
}

/// As the summary spells it.
pub(super) const fn status_of(finish: Finish) -> Status {
    match finish {
        Finish::Completed => Status::Completed,
        Finish::Stopped | Finish::Refused | Finish::Unfit => Status::Stopped,
        Finish::Interrupted => Status::Interrupted,
        Finish::NotConnected | Finish::WiringFault | Finish::LinkFailed | Finish::Panicked => {
            Status::Failed
        }
    }
}

/// Specimens whose simulated actuators did not come to terms with what they move, in sentences.
fn unsettled(outcome: &Outcome) -> Vec<String> {
    let each = outcome.ports.iter().filter(|port| port.2.unsettled > 0);
    let sentence = |(name, _, link): &(String, Vec<f64>, crate::control::LinkCount)| {
        format!(
            "specimen \"{name}\": the actuator–specimen iteration did not converge in {} ticks, whose measurements are not exact; \
             increase `time.ticks_per_step`",
            link.unsettled
        )
    };
    each.map(sentence).collect()
}

/// Where no command left, in a sentence.
fn gaps(gaps: Gaps) -> Option<String> {
    let (times, longest_s) = (times(gaps.times), gaps.longest_ns as f64 * 1e-9);
    let sentence = format!(
        "no command was sent for up to {longest_s:.2} s, {times}, during startup, shutdown or a hold: the program was suspended, or it \
         waited for a reply (`gap` in events.jsonl)"
    );
    (gaps.times > 0).then_some(sentence)
}

/// Specimens that said that they hold by their own watchdog, in sentences.
fn held(outcome: &Outcome) -> Vec<String> {
    let each = outcome.ports.iter().filter(|port| port.2.holds > 0);
    let sentence = |(name, _, link): &(String, Vec<f64>, crate::control::LinkCount)| {
        let times = times(link.holds);
        format!(
            "specimen \"{name}\": it reported {times} that its own watchdog holds it, because commands had stopped: measurements \
             during this time do not belong to the commands (`specimen_holds` in events.jsonl)"
        )
    };
    each.map(sentence).collect()
}

/// Topics of the machine that a reader of a report wants to know.
const MACHINE: [&str; 5] = [
    "kernel",
    "processors",
    "hypervisor",
    "clock source",
    "isolated processors",
];

/// What this machine's own files say of it, by topic.
fn machine() -> Value {
    let found = crate::rt::doctor::read();
    let told = found
        .into_iter()
        .filter(|finding| MACHINE.contains(&finding.topic));
    told.map(|finding| (finding.topic.to_owned(), Value::from(finding.found)))
        .collect()
}

/// How a test ended, and why in words.
#[must_use]
pub fn ending(outcome: &Outcome) -> (Finish, String) {
    let of = |index: usize| named(index, outcome);
    let finish = match &outcome.ending {
        Ending::Completed => Finish::Completed,
        Ending::Stopped(stop) => finish_of(stop),
    };
    let mut reason = match &outcome.unfinished {
        None => {
            let mut reason = words(&outcome.ending, outcome);
            for (index, left) in outcome.left.iter().enumerate() {
                let Left::NotReached(why) = left else {
                    continue;
                };
                reason = format!("{reason}; {} did not reach its end position", of(index));
                if let Some(why) = why {
                    reason = format!("{reason}: {why}");
                }
            }
            reason
        }
        Some(Unfinished { stop, after }) => {
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
    let lost = left_as(outcome, Left::Lost);
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
    (finish, reason)
}

/// The specimens that were left so.
fn left_as(outcome: &Outcome, how: Left) -> impl Iterator<Item = (usize, &Left)> {
    let left = outcome.left.iter().enumerate();
    left.filter(move |(_, left)| **left == how)
}

const fn finish_of(stop: &Stop) -> Finish {
    match stop {
        Stop::Operator => Finish::Interrupted,
        // There is no link to fail where a law is computed in this process.
        Stop::Link {
            fault: LinkFault::Diverged,
            ..
        } => Finish::Stopped,
        Stop::Link { .. } => Finish::LinkFailed,
        Stop::Misfit { .. } => Finish::WiringFault,
        Stop::Internal => Finish::Panicked,
        // The specimen is another than the one of the interrupted test: it was not moved.
        Stop::Moved { .. } | Stop::ForceChanged { .. } => Finish::Refused,
        Stop::Interlock { .. }
        | Stop::Saturated { .. }
        | Stop::HoldsOn { .. }
        | Stop::Limit { .. }
        | Stop::Geometry { .. }
        | Stop::TestLimit(_)
        | Stop::Late { .. }
        | Stop::Stale { .. }
        | Stop::Diverged { .. }
        | Stop::NotFinite { .. }
        | Stop::Step(_)
        | Stop::CannotCommand
        | Stop::NotSettled { .. }
        | Stop::DoesNotFollow { .. }
        | Stop::NotAtRest { .. } => Finish::Stopped,
    }
}

/// Why a test stopped, with the specimen by its name.
pub(super) fn stop_words(stop: &Stop, outcome: &Outcome) -> String {
    let text = stop.to_string();
    match stop.port() {
        None => text,
        Some(port) => text.replacen(&format!("specimen {}", port + 1), &named(port, outcome), 1),
    }
}

/// A specimen by its name.
pub(super) fn named(port: usize, outcome: &Outcome) -> String {
    match outcome.ports.get(port) {
        Some((name, ..)) => format!("specimen \"{name}\""),
        None => format!("specimen {}", port + 1),
    }
}

pub(super) fn words(ending: &Ending, outcome: &Outcome) -> String {
    let Ending::Stopped(stop) = ending else {
        return "end of the test".to_owned();
    };
    let told = match stop {
        // A gateway says which of its limits opened the interlock.
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
                 `max_stale` in [specimen.link]",
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

pub(super) fn finite(values: &[f64]) -> Vec<Option<f64>> {
    values
        .iter()
        .map(|value| value.is_finite().then_some(*value))
        .collect()
}

fn peak(outcome: &Outcome, facts: &Facts) -> Peak {
    let force = outcome
        .ports
        .iter()
        .map(|(name, force, _)| (name.clone(), finite(force)));
    let rotations = facts.structure.iter().flat_map(|s| &s.rotations);
    Peak {
        rotations: rotations.map(|dof| dof + 1).collect(),
        displacement: finite(&outcome.peaks.disp),
        velocity: finite(&outcome.peaks.vel),
        acceleration: finite(&outcome.peaks.accel),
        force: force.collect(),
    }
}

fn on_the_way_in(outcome: &Outcome) -> BTreeMap<String, Vec<Option<f64>>> {
    let ports = outcome.ports.iter().zip(&outcome.forces_on_the_way_in);
    ports
        .map(|((name, ..), forces)| (name.clone(), finite(forces)))
        .collect()
}

fn left(outcome: &Outcome) -> BTreeMap<String, String> {
    let ports = outcome.ports.iter().zip(&outcome.left);
    ports
        .map(|((name, ..), left)| (name.clone(), left.word().to_owned()))
        .collect()
}

fn links(outcome: &Outcome) -> BTreeMap<String, LinkCounts> {
    let counts = |link: &crate::control::LinkCount| LinkCounts {
        sent: link.sent,
        received: link.received,
        late: link.stats.late,
        lost: link.sent.saturating_sub(link.received + link.stats.late),
        corrupt: link.stats.corrupt,
        duplicates: link.stats.duplicates,
        recovered: link.stats.recovered,
        missed: link.stats.missed,
        unreachable: link.stats.unreachable,
    };
    outcome
        .ports
        .iter()
        .map(|(name, _, link)| (name.clone(), counts(link)))
        .collect()
}
