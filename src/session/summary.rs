//! Makes the summary of a run: how it ended, its peaks, metrics, limits and verdict (guide: run-folder).

use std::collections::BTreeMap;
use std::time::Duration;

use super::connect::Unconnected;
use super::guarded::Ended;
use super::reason::{self, last_words};
use super::rehearsal::beyond_declared;
use gusset_config::ClockChoice;
use gusset_control::engine::{Ending, Gaps, Outcome};
use gusset_quantity::catalog::ending::Cause;
use gusset_record::rt::Granted;
use gusset_record::rt::timing::export::write_hgrm;
use gusset_record::rt::timing::{Quantity, Timing};
use gusset_record::rt::wall::Wall;
use gusset_record::summary::{
    ClockKind, InOrder, Lambda, LinkCounts, MemberDemand, Peak, Realtime,
};
use gusset_record::{FolderError, Recorded, RunFolder, Summary, times};
use gusset_setup::Facts;

/// When the loop began, and how long it took on the wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    /// UTC of the start.
    pub began: Wall,
    /// Seconds of wall time.
    pub seconds: f64,
}

/// timing.json, one .hgrm per quantity, and the interval log of all of them. Files that could not be written are listed in
/// `unwritten`.
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
    note(folder.write_timing(&timing.with_bins()));
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
) -> (Cause, Summary) {
    let outcome = ended.outcome.as_ref();
    let (cause, reason) = match (&ended.fault, &ended.unconnected, outcome) {
        (None, Some(Unconnected::Refused(text)), _) => {
            (Cause::NotConnected, format!("{text}; nothing was moved"))
        }
        (None, Some(Unconnected::Unfit(text)), _) => {
            (Cause::Unfit, format!("{text}; nothing was moved"))
        }
        (None, Some(Unconnected::Stopped), _) => (
            Cause::Operator,
            "stopped by the operator while the specimens were being connected; nothing was moved"
                .to_owned(),
        ),
        (Some(fault), _, _) => (Cause::Internal, format!("internal error: {fault}")),
        (None, None, Some(outcome)) => reason::ending(outcome),
        (None, None, None) => (Cause::Internal, "internal error".to_owned()),
    };
    let (cause, reason) = match cause {
        Cause::Done if facts.record_required && recorded.rows_lost() > 0 => (
            Cause::RecordDamaged,
            format!("{} rows lost, and [record] required", recorded.rows_lost()),
        ),
        Cause::Done if facts.record_required && !recorded.damaged.is_empty() => (
            Cause::RecordDamaged,
            format!("{}, and [record] required", recorded.damaged.join("; ")),
        ),
        _ => (cause, reason),
    };
    let mut warnings = facts.warnings.clone();
    warnings.extend(recorded.warned.iter().cloned());
    warnings.extend(recorded.damaged.iter().cloned());
    warnings.extend(unwritten.iter().map(|text| format!("not written: {text}")));
    warnings.extend(recorded.loss());
    warnings.extend(outcome.map(unsettled).into_iter().flatten());
    let beyond = outcome.map(|outcome| outcome.beyond_declared.iter());
    warnings.extend(beyond.into_iter().flatten().map(beyond_declared));
    warnings.extend(outcome.map(held).into_iter().flatten());
    warnings.extend(outcome.and_then(|outcome| gaps(outcome.pace.gaps)));
    let last_words = outcome.map(last_words).into_iter().flatten();
    warnings.extend(last_words.map(|(_, text)| text));
    let ending = outcome.map(|outcome| &outcome.ending);
    let ending = ending.filter(|ending| ending.cause() == cause);
    let summary = Summary {
        status: cause.status(),
        cause: Some(ending.map_or(cause.word(), Ending::word).to_owned()),
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
        deadline_misses: outcome.map_or(0, |outcome| outcome.pace.misses),
        stretched_ticks: outcome.map_or(0, |outcome| outcome.pace.stretched),
        members: outcome.map(demands).unwrap_or_default(),
        peak: outcome
            .map(|outcome| peak(outcome, facts))
            .unwrap_or_default(),
        timing: outcome.map(|outcome| outcome.pace.timing.summarised()),
        realtime: Realtime {
            asked: granted.is_none().then_some(false),
            granted: granted.cloned(),
            ..Realtime::default()
        },
        link: outcome.map(links).unwrap_or_default(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        about: facts.about.clone(),
        rows_lost: recorded.rows_lost(),
        inputs: folder.inputs().to_vec(),
        miss_classes: recorded.misses,
        warnings,
        limits: Some(facts.limits.clone()),
        machine: Some(machine()),
        left: outcome.map(left).unwrap_or_default(),
        force_on_the_way_in: outcome.map(on_the_way_in).unwrap_or_default(),
        accepted: facts.accepted.clone(),
        ..Summary::default()
    };
    (cause, summary)
}

/// Demands of the members of a frame that can yield.
fn demands(outcome: &Outcome) -> Vec<MemberDemand> {
    let each = outcome.demands.iter();
    let each = each.map(|(name, demand)| MemberDemand {
        name: name.clone(),
        demand: demand.map(|x| x.is_finite().then_some(x)),
    });
    each.collect()
}

/// Specimens whose actuator–specimen iteration did not converge, in sentences.
fn unsettled(outcome: &Outcome) -> Vec<String> {
    let each = outcome.ports.iter().filter(|port| port.2.unsettled > 0);
    let sentence = |(name, _, link): &(String, Vec<f64>, gusset_control::port::LinkCount)| {
        format!(
            "specimen \"{name}\": the actuator–specimen iteration did not converge in {} ticks, whose measurements are not exact; \
             increase `time.ticks_per_step`",
            link.unsettled
        )
    };
    each.map(sentence).collect()
}

/// Ticks without a command, in a sentence.
fn gaps(gaps: Gaps) -> Option<String> {
    let (times, longest_s) = (times(gaps.times), gaps.longest_ns as f64 * 1e-9);
    let sentence = format!(
        "no command was sent for up to {longest_s:.2} s, {times}, during startup, shutdown or a hold: the program was suspended, or it \
         waited for a reply (`gap` in events.jsonl)"
    );
    (gaps.times > 0).then_some(sentence)
}

/// Specimens that reported a hold by their own watchdog, in sentences.
fn held(outcome: &Outcome) -> Vec<String> {
    let each = outcome.ports.iter().filter(|port| port.2.holds > 0);
    let sentence = |(name, _, link): &(String, Vec<f64>, gusset_control::port::LinkCount)| {
        let times = times(link.holds);
        format!(
            "specimen \"{name}\": it reported {times} that its own watchdog holds it, because commands had stopped: measurements \
             during this time do not belong to the commands (`specimen_holds` in events.jsonl)"
        )
    };
    each.map(sentence).collect()
}

/// Topics of the machine for a reader of a report.
const MACHINE: [&str; 5] = [
    "kernel",
    "processors",
    "hypervisor",
    "clock source",
    "isolated processors",
];

/// Description of this machine from its own files, by topic.
fn machine() -> InOrder<String> {
    let found = gusset_record::rt::doctor::read();
    let told = found
        .into_iter()
        .filter(|finding| MACHINE.contains(&finding.topic));
    let told = told.map(|finding| (finding.topic.to_owned(), finding.found));
    InOrder(told.collect())
}

fn finite(values: &[f64]) -> Vec<Option<f64>> {
    values
        .iter()
        .map(|value| value.is_finite().then_some(*value))
        .collect()
}

pub(super) fn peak(outcome: &Outcome, facts: &Facts) -> Peak {
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
    let ports = outcome.ports.iter();
    let counts = ports.map(|(name, _, link)| {
        let counts = LinkCounts::of(link.sent, link.received, &link.stats);
        (name.clone(), counts)
    });
    counts.collect()
}
