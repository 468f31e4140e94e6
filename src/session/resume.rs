//! `gusset run --resume`: an interrupted test from its folder to an experiment that goes on with it.
//!
//! There is no snapshot of the state to be torn or stale. The record holds what was measured, and the loop makes the same
//! state of it bit for bit, some hundred times faster than the test ran; digests of the state, written while it ran
//! (checkpoints), prove that it is the same. Where the record is damaged the last checkpoint that came out again counts.
//! Files that were changed since are refused. Nothing of the interrupted test is written to. A trip stays latched: a test that
//! ended with one goes on only for someone who names it.

mod error;
mod trips;

use std::path::Path;

use super::desk::{Request, Unanswered, ask};
use super::recorded::Replaced;
use super::retrace::{
    Build, Origin, Retraced, check_files as check_files_of, prepared_by, read, retrace,
    rows_sha256, sha256, take_over,
};
use crate::config::{self, Dial, Loaded, Prepared};
use crate::control::Port;
use crate::engine::{Left, Phase};
use crate::record::summary::{Status, Summary};
use crate::record::{MissingEnd, Run};
use crate::substructure::Status as LinkStatus;
pub use error::ResumeError;

/// Name of a trip whose event is missing.
const UNKNOWN: &str = "unknown";
/// Wall time in s of which the record may be lost, and before that the time in which it went as fast as then.
const LOST_S: f64 = 0.05;
const LATEST_S: f64 = 1.0;
/// A specimen may be so many times as far off as it was ever off its command.
const SHARE: f64 = 1.5;
/// Relative size of what is nothing.
const NOTHING: f64 = 1e-9;

/// Prepares the test in `folder` to go on. `test`: the test file, if one was given; it must be the one that was
/// interrupted. `after`: the trips after which it may go on, by their names.
///
/// # Errors
/// See [`ResumeError`].
pub fn resume(
    folder: &Path,
    test: Option<&Path>,
    after: &[String],
) -> Result<Prepared, ResumeError> {
    resume_by(folder, test, after, &mut config::build)
}

/// The same with links over transports that are connected already: those that `dial` makes, one after the other.
///
/// # Errors
/// As [`resume`].
pub fn resume_over(
    folder: &Path,
    after: &[String],
    dial: &mut Dial<'_>,
) -> Result<Prepared, ResumeError> {
    let build = &mut |loaded: &Loaded| config::build_over(loaded, dial);
    resume_by(folder, None, after, build)
}

fn resume_by(
    folder: &Path,
    test: Option<&Path>,
    after: &[String],
    build: &mut Build<'_>,
) -> Result<Prepared, ResumeError> {
    let run = Run::open(folder)?;
    match ask(folder, Request::Phase) {
        Ok(_) => return Err(ResumeError::Running(folder.to_owned())),
        Err(Unanswered::Over(_)) => {}
        // It may be commanding the specimens this very moment.
        Err(unanswered) => {
            return Err(ResumeError::Unanswered {
                folder: folder.to_owned(),
                unanswered,
            });
        }
    }
    if run.summary().is_some_and(|s| s.status == Status::Completed) {
        return Err(ResumeError::Complete(folder.to_owned()));
    }
    if let Some(fault) = run.summary_fault() {
        return Err(ResumeError::Summary {
            folder: folder.to_owned(),
            fault: fault.to_owned(),
        });
    }
    if let Some(missing) = MissingEnd::of_run(&run) {
        return Err(ResumeError::Short {
            folder: folder.to_owned(),
            missing,
        });
    }
    check_files(&run, test)?;
    let ended = end_before(&run, after)?;
    let (traced, note) = trace(&run)?;
    let Some((side, ports, mut resumption)) = traced.state else {
        return Err(if traced.completed {
            ResumeError::Complete(folder.to_owned())
        } else {
            ResumeError::NotBegun(folder.to_owned())
        });
    };
    let mut next = prepared_by(&run, Replaced::Remote, true, build)?;
    let step = resumption.step();
    if step >= next.experiment.steps {
        // What stopped it was its way out.
        return Err(ResumeError::Complete(folder.to_owned()));
    }
    let time = step as f64 * next.facts.dt;
    let within = next.facts.resume_within;
    let left = places(&run, &ports, within, next.facts.rate_hz)?;
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let origin = Origin {
        parent: absolute.clone(),
        parent_absolute: absolute,
        rows: traced.rows,
        rows_sha256: rows_sha256(&run, traced.rows)?,
        resolved_sha256: sha256(&read(&folder.join("resolved.toml"))?),
        step,
        time,
        left,
    };
    resumption.left = origin.places();
    take_over(&mut next.experiment, side, ports);
    origin.put(&mut next.experiment.ports);
    next.experiment.resume = Some(resumption);
    next.files.test = read(&folder.join("test.toml"))?;
    next.files.resolved = String::from_utf8_lossy(&read(&folder.join("resolved.toml"))?).into();
    next.files.origin = serde_json::to_string_pretty(&origin).ok();
    let text = format!(
        "resumed from {} after step {step} ({time} s): {} rows retraced",
        folder.display(),
        traced.rows
    );
    for text in [text, ended] {
        next.facts.announced.push(text.clone());
        next.facts.warnings.push(text);
    }
    if let Some(note) = note {
        next.facts.announced.push(note.clone());
        next.facts.warnings.push(note);
    }
    Ok(next)
}

/// What the test ended with before, to be told. Its trips must be those in `after`.
fn end_before(run: &Run, after: &[String]) -> Result<String, ResumeError> {
    let reason = run.summary().map_or_else(
        || "it was killed: there is no summary.json".to_owned(),
        |summary| summary.reason.clone(),
    );
    let told = run.events()?;
    let mut trips = trips::of_events(&told.events);
    if trips.is_empty() && trips::has_a_row_of_one(run)? {
        trips.push(UNKNOWN.to_owned());
    }
    let folder = || run.path().to_owned();
    if let Some(named) = after.iter().find(|named| !trips.contains(named)) {
        return Err(ResumeError::AnotherTrip {
            folder: folder(),
            named: named.clone(),
            reason,
        });
    }
    if trips.iter().any(|trip| !after.contains(trip)) {
        let wanted: Vec<String> = trips
            .iter()
            .map(|trip| format!("`--after-trip {trip}`"))
            .collect();
        return Err(ResumeError::Tripped {
            folder: folder(),
            reason,
            wanted: wanted.join(" "),
        });
    }
    let mut text = if trips.is_empty() {
        format!("it had ended before: {reason}")
    } else {
        format!(
            "IT HAD TRIPPED: {reason}; it goes on because of `--after-trip` {}",
            trips.join(", ")
        )
    };
    if told.unreadable > 0 {
        text = format!(
            "{text}; {} lines of its events cannot be read",
            told.unreadable
        );
    }
    Ok(text)
}

/// The state after the last good row; where the record is damaged, that of the last checkpoint, and what is to be said of it.
fn trace(run: &Run) -> Result<(Retraced, Option<String>), ResumeError> {
    let traced = retrace(run, None, Replaced::Remote)?;
    let Some(trouble) = traced.trouble.clone() else {
        return Ok((traced, None));
    };
    let folder = run.path().to_owned();
    let Some(checkpoint) = traced.verified else {
        return Err(ResumeError::Damaged { folder, trouble });
    };
    let again = retrace(run, Some(checkpoint.rows), Replaced::Remote)?;
    if again.trouble.is_some() || again.state.is_none() {
        return Err(ResumeError::Damaged { folder, trouble });
    }
    let note = format!(
        "{trouble}: the test goes on after the last checkpoint before that, step {}",
        checkpoint.step
    );
    Ok((again, Some(note)))
}

/// The files are those that the test was made of, as its first events say.
fn check_files(run: &Run, test: Option<&Path>) -> Result<(), ResumeError> {
    let folder = run.path();
    if !check_files_of(run)? {
        return Err(ResumeError::Unproven(folder.to_owned()));
    }
    if let Some(given) = test {
        let kept = folder.join("test.toml");
        let (wanted, found) = (sha256(&read(&kept)?), sha256(&read(given)?));
        if wanted != found {
            let given = given.to_owned();
            return Err(ResumeError::AnotherTest {
                given,
                kept,
                wanted,
                found,
            });
        }
    }
    Ok(())
}

/// How far a command may have gone after the last row of a test that was killed, in its own unit: as fast as at the end of it,
/// and at least to the command that stood ready.
fn way_lost(command: &[f64], port: &Port, axis: usize, rate_hz: f64) -> f64 {
    let latest = command
        .len()
        .saturating_sub((LATEST_S * rate_hz).ceil() as usize + 1);
    let steps = command.get(latest..).unwrap_or_default().windows(2);
    let steps = steps.map(|pair| (pair[1] - pair[0]).abs());
    let ready = port.command.get(axis).zip(port.sent.get(axis));
    let ready = ready.map(|(ready, sent)| (ready - sent).abs());
    steps.chain(ready).fold(0.0, f64::max) * (LOST_S * rate_hz).max(1.0)
}

/// Where each axis was left by the last command on record, and how far off it may stand: `within` in m if that is given.
fn places(
    run: &Run,
    ports: &[Port],
    within: Option<f64>,
    rate_hz: f64,
) -> Result<Vec<Vec<[String; 4]>>, ResumeError> {
    let mut all = Vec::new();
    // A test that ended in order has every row, and who was not lost stands at its last command.
    let is_all_known = |port: &Port| {
        let known = |summary: &Summary| {
            let left = summary.left.get(port.name.as_str()).map(String::as_str);
            let known = [Left::Stayed, Left::Reached].map(|left| Some(left.word()));
            summary.rows_lost == 0 && known.contains(&left)
        };
        run.summary().is_some_and(known)
    };
    for (index, port) in ports.iter().enumerate() {
        let is_all_known = is_all_known(port);
        let mut axes = Vec::new();
        for axis in 0..port.axes() {
            let name = |kind: &str| format!("{kind}_{}_{}", index + 1, axis + 1);
            let names = [name("cmd"), name("raw_disp"), name("raw_force")];
            let mut names: Vec<&str> = names.iter().map(String::as_str).collect();
            let status = format!("status_{}", index + 1);
            names.extend(["state", &status]);
            let columns = run.columns(&names)?;
            let [command, disp, force, state, status] = columns.as_slice() else {
                continue;
            };
            let is_old = |status: f64| LinkStatus(status as u32).has(LinkStatus::STALE);
            // What it reads beyond its command, on the average of the test itself: the offset of its sensor. An old measurement
            // says nothing of that.
            let rows = disp.iter().zip(command).zip(state.iter().zip(status));
            let errors: Vec<f64> = rows
                .filter(|(_, (state, status))| {
                    **state == Phase::Running.code() && !is_old(**status)
                })
                .map(|((disp, command), _)| disp - command)
                .collect();
            let beyond = errors.iter().sum::<f64>() / (errors.len().max(1) as f64);
            // The way out may have led it where a wrong scale reads another offset.
            let at_last = disp.last().zip(command.last()).zip(status.last());
            let at_last = at_last.filter(|(_, status)| !is_old(**status));
            let at_last = at_last.map(|((disp, command), _)| disp - command);
            let off = errors.iter().copied().chain(at_last);
            let off = off.map(|error| (error - beyond).abs()).fold(0.0, f64::max);
            let last = command.last().copied().unwrap_or(0.0);
            let lost = if is_all_known {
                0.0
            } else {
                way_lost(command, port, axis, rate_hz)
            };
            let own = SHARE * off + lost + NOTHING * last.abs();
            let own = within.map_or(own, |metres| metres / port.metres_of(axis));
            // A formula stands where it is told.
            let within = if port.is_formula() {
                f64::INFINITY
            } else {
                own
            };
            let force = force.last().copied().unwrap_or(0.0);
            axes.push([last, last + beyond, force, within].map(|value| format!("{value:?}")));
        }
        all.push(axes);
    }
    Ok(all)
}
