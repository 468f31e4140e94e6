//! `gusset run --resume`: an interrupted test from its folder to an experiment that goes on with it.
//!
//! There is no snapshot of the state to be torn or stale. The record holds what was measured, and the loop makes the same
//! state of it bit for bit, some hundred times faster than the test ran; digests of the state, written while it ran
//! (checkpoints), prove that it is the same. Where the record is damaged the last checkpoint that came out again counts;
//! specimens that are not made anew are led through the steps after it once more, so that further back than a kill can lose
//! the test goes only for someone who names the step. Files that were changed since are refused. Nothing of the interrupted
//! test is written to. A trip stays latched: a test that ended with one goes on only for someone who names it.

mod error;
mod places;
mod trips;

use std::path::Path;

use super::borne::{borne, peak_of};
use super::continued::{self, Now};
use super::desk::{Request, Unanswered, ask};
use super::recorded::Replaced;
use super::retrace::{
    Build, Origin, Retraced, check_files as check_files_of, prepared_by, read, retrace,
    rows_sha256, sha256, take_over,
};
use crate::config::{self, Dial, Loaded, Prepared};
use crate::control::Port;
use crate::record::summary::Status;
use crate::record::{MissingEnd, Run, ToldBy};
pub use error::ResumeError;
use places::{places, ticks_lost};

/// Name of a trip whose event is missing.
const UNKNOWN: &str = "unknown";

/// Prepares the test in `folder` to go on. `test`: the test file, if one was given; it must be the one that was
/// interrupted. `after`: the trips after which it may go on, by their names. `back_to`: the step that it may go back to where
/// its record is damaged, or after which another went on already, though specimens are then led once more through what they
/// have been through.
///
/// # Errors
/// See [`ResumeError`].
pub fn resume(
    folder: &Path,
    test: Option<&Path>,
    after: &[String],
    back_to: Option<u64>,
) -> Result<Prepared, ResumeError> {
    resume_by(folder, test, after, back_to, &mut config::build)
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
    resume_by(folder, None, after, None, build)
}

fn resume_by(
    folder: &Path,
    test: Option<&Path>,
    after: &[String],
    back_to: Option<u64>,
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
    let went_on = continued::last_of(folder)?;
    if let Some(before) = &went_on
        && (back_to.is_none() || before.now == Now::Running)
    {
        return Err(ResumeError::WentOn {
            folder: folder.to_owned(),
            before: before.clone(),
        });
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
    let origin = Origin::of(folder)?;
    // One that ended on its way in has made no step of those that its summary tells of.
    let has_steps = |missing: &MissingEnd| {
        let before = origin.as_ref().map(|origin| origin.step);
        before.is_none_or(|step| missing.told_by != ToldBy::Summary(step))
    };
    if let Some(missing) = MissingEnd::of_run(&run).filter(has_steps) {
        return Err(ResumeError::Short {
            folder: folder.to_owned(),
            missing,
        });
    }
    check_files(&run, test, origin.as_ref())?;
    let ended = end_before(&run, after)?;
    let (mut traced, note) = trace(&run)?;
    let Some((side, ports, mut resumption)) = traced.state.take() else {
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
    check_way_back(&run, &traced, &ports, step, back_to, next.facts.rate_hz)?;
    let time = step as f64 * next.facts.dt;
    let within = next.facts.resume_within;
    let peak = peak_of(
        &run,
        traced.rows,
        &ports,
        origin.as_ref().map(|origin| &origin.peak),
    )?;
    let before = origin.filter(|_| traced.on_its_way_in);
    let pace = (next.facts.rate_hz, next.facts.ticks_per_step);
    let left = places(&run, &ports, within, pace, before.as_ref())?;
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
        peak,
    };
    resumption.left = origin.places();
    resumption.borne = borne(&origin.peak, &ports);
    take_over(&mut next.experiment, side, ports);
    origin.put(&mut next.experiment.ports);
    next.experiment.resume = Some(resumption);
    next.files.test = read(&folder.join("test.toml"))?;
    next.files.resolved = String::from_utf8_lossy(&read(&folder.join("resolved.toml"))?).into();
    next.facts.resumed = Some((folder.to_owned(), step));
    next.files.origin = serde_json::to_string_pretty(&origin).ok();
    let text = format!(
        "resumed from {} after step {step} ({time} s): {} rows retraced",
        folder.display(),
        traced.rows
    );
    let on_its_way_in = before.map(|_| {
        "it had ended on its way in, and made no step of its own: the state is that of the test before it, the specimens stand \
         where it left them"
            .to_owned()
    });
    // What a test tries before it begins is not tried again.
    let tried = !std::mem::take(&mut next.facts.announced).is_empty();
    let untried = tried.then(|| {
        "which way round the specimens are wired is not tried again: who has changed it since begins a new test".to_owned()
    });
    let again = went_on.map(|before| {
        format!("{before}: the specimens are led once more through the steps after step {step}, because of `--back-to-step`")
    });
    for text in [Some(text), Some(ended), again, on_its_way_in, untried, note]
        .into_iter()
        .flatten()
    {
        next.facts.announced.push(text.clone());
        next.facts.warnings.push(text);
    }
    Ok(next)
}

/// What the test ended with before, to be told. Its trips must be those in `after`.
fn end_before(run: &Run, after: &[String]) -> Result<String, ResumeError> {
    let mut reason = run.summary().map_or_else(
        || "it was killed: there is no summary.json".to_owned(),
        |summary| summary.reason.clone(),
    );
    let told = run.events()?;
    let mut trips = trips::of_events(&told.events);
    let may_hide = trips::may_hide(run.summary().map(|summary| summary.status), &told);
    let has_tripped = !trips.is_empty() || trips::has_a_row_of_one(run)?;
    if trips.is_empty() && (may_hide || has_tripped) {
        trips.push(UNKNOWN.to_owned());
        if may_hide {
            reason += "; not all of its events can be read, and one of a trip may be among them";
        }
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
            has_tripped,
            reason,
            wanted: wanted.join(" "),
        });
    }
    let mut text = if trips.is_empty() {
        format!("it had ended before: {reason}")
    } else {
        let tripped = if has_tripped {
            "HAD TRIPPED"
        } else {
            "MAY HAVE TRIPPED"
        };
        format!(
            "IT {tripped}: {reason}; it goes on because of `--after-trip` {}",
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

/// The state after the last good row; where the record is damaged, that of the last checkpoint, the trouble with what comes
/// after it, and what is to be said of it.
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
    let trouble = Some(trouble);
    Ok((Retraced { trouble, ..again }, Some(note)))
}

/// No specimen that is not made anew is led through more than a kill can lose once more, unless the step is named after which
/// that begins.
fn check_way_back(
    run: &Run,
    traced: &Retraced,
    ports: &[Port],
    step: u64,
    named: Option<u64>,
    rate_hz: f64,
) -> Result<(), ResumeError> {
    let folder = run.path().to_owned();
    if let Some(named) = named {
        let is_it = named == step;
        return is_it.then_some(()).ok_or(ResumeError::AnotherStep {
            folder,
            named,
            step,
        });
    }
    let Some(trouble) = &traced.trouble else {
        return Ok(());
    };
    let again = run.rows_made()?.saturating_sub(traced.rows) as f64;
    let remember: Vec<&str> = ports
        .iter()
        .filter(|port| !port.is_formula())
        .map(|port| port.name.as_str())
        .collect();
    if again <= ticks_lost(rate_hz) || remember.is_empty() {
        return Ok(());
    }
    Err(ResumeError::Back {
        folder,
        trouble: trouble.clone(),
        step,
        again_s: again / rate_hz,
        specimens: remember.join(", "),
    })
}

/// The files are those that the test was made of, as its first events say.
fn check_files(run: &Run, test: Option<&Path>, origin: Option<&Origin>) -> Result<(), ResumeError> {
    let folder = run.path();
    if !check_files_of(run)? {
        // It was killed before it wrote anything; one that was to go on with another is no beginning.
        if origin.is_none() && run.rows_made()? == 0 {
            return Err(ResumeError::NotBegun(folder.to_owned()));
        }
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
