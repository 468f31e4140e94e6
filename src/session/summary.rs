//! What a run came to, in the words and keys of the contract.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::Finish;
use crate::config::{ClockChoice, Facts};
use crate::engine::{Ending, Outcome, Stop};
use crate::record::summary::{ClockKind, Lambda, LinkCounts, Peak, Status};
use crate::record::{FolderError, Recorded, RunFolder, Summary};
use crate::rt::Granted;
use crate::rt::timing::export::write_hgrm;
use crate::rt::timing::{Quantity, Timing};

/// timing.json and one .hgrm per quantity.
pub(super) fn write_timing(folder: &RunFolder, timing: &Timing) -> Result<(), FolderError> {
    folder.write_timing(&timing.to_json_with_bins())?;
    for quantity in Quantity::ALL {
        let mut text = Vec::new();
        // Writing into memory cannot fail.
        if write_hgrm(&timing.histogram(quantity), &mut text).is_ok() {
            folder.write_histogram(quantity.key(), &String::from_utf8_lossy(&text))?;
        }
    }
    Ok(())
}

/// The summary of a run, and how it ended.
pub(super) fn summarise(
    facts: &Facts,
    folder: &RunFolder,
    result: &Result<Outcome, String>,
    recorded: &Recorded,
    granted: Option<&Granted>,
) -> (Finish, Summary) {
    let (finish, reason) = match result {
        Ok(outcome) => ending(&outcome.ending),
        Err(panic) => (Finish::Panicked, format!("internal error: {panic}")),
    };
    let (finish, reason) = match finish {
        Finish::Completed if facts.record_required && recorded.rows_lost() > 0 => (
            Finish::Stopped,
            format!("{} rows lost, and [record] required", recorded.rows_lost()),
        ),
        _ => (finish, reason),
    };
    let outcome = result.as_ref().ok();
    let mut warnings = facts.warnings.clone();
    if recorded.rows_lost() > 0 {
        let cause = recorded
            .first_error
            .as_deref()
            .unwrap_or("the queue was full");
        warnings.push(format!("{} rows are LOST: {cause}", recorded.rows_lost()));
    }
    let summary = Summary {
        status: match finish {
            Finish::Completed => Status::Completed,
            Finish::Stopped => Status::Stopped,
            Finish::Interrupted => Status::Interrupted,
            Finish::LinkFailed | Finish::Panicked => Status::Failed,
        },
        reason,
        steps: outcome.map_or(0, |outcome| outcome.steps),
        dt: facts.dt,
        lambda: facts.lambda().map(Lambda),
        clock: match facts.clock {
            ClockChoice::Real => ClockKind::Real,
            ClockChoice::Simulated => ClockKind::Simulated,
        },
        wall_seconds: outcome.map_or(0.0, |outcome| outcome.wall_ns as f64 * 1e-9),
        rate_hz: facts.rate_hz,
        deadline_misses: outcome.map_or(0, |outcome| outcome.misses),
        stretched_ticks: outcome.map_or(0, |outcome| outcome.stretched),
        peak: outcome.map(peak).unwrap_or_default(),
        timing: outcome.map_or(Value::Null, |outcome| outcome.timing.to_json()),
        realtime: granted.map_or_else(|| json!({ "asked": false }), |granted| json!(granted)),
        link: outcome.map(links).unwrap_or_default(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        rows_lost: recorded.rows_lost(),
        inputs: folder.inputs().to_vec(),
        miss_classes: recorded.misses,
        warnings,
    };
    (finish, summary)
}

fn ending(ending: &Ending) -> (Finish, String) {
    match ending {
        Ending::Completed => (Finish::Completed, "end of the test".to_owned()),
        Ending::Stopped(stop) => {
            let finish = match stop {
                Stop::Operator => Finish::Interrupted,
                Stop::Link { .. } => Finish::LinkFailed,
                Stop::Late { .. }
                | Stop::Stale { .. }
                | Stop::Diverged { .. }
                | Stop::NotFinite { .. }
                | Stop::Step(_)
                | Stop::CannotCommand
                | Stop::NotSettled { .. } => Finish::Stopped,
            };
            (finish, stop.to_string())
        }
    }
}

fn finite(values: &[f64]) -> Vec<Option<f64>> {
    values
        .iter()
        .map(|value| value.is_finite().then_some(*value))
        .collect()
}

fn peak(outcome: &Outcome) -> Peak {
    let force = outcome
        .ports
        .iter()
        .map(|(name, force, _)| (name.clone(), finite(force)));
    Peak {
        displacement: finite(&outcome.peaks.disp),
        velocity: finite(&outcome.peaks.vel),
        acceleration: finite(&outcome.peaks.accel),
        force: force.collect(),
    }
}

fn links(outcome: &Outcome) -> BTreeMap<String, LinkCounts> {
    let counts = |link: &crate::control::LinkCount| LinkCounts {
        sent: link.sent,
        received: link.received,
        late: link.late,
        lost: link.sent.saturating_sub(link.received + link.late),
        corrupt: 0,
    };
    outcome
        .ports
        .iter()
        .map(|(name, _, link)| (name.clone(), counts(link)))
        .collect()
}
