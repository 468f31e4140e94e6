//! `gusset run --resume`: from the folder of an interrupted test to an experiment that resumes it.
//!
//! The loop retraces all rows, bit for bit: some hundred times faster than the test ran. Digests of the state, written while the
//! test ran, prove that the state is the same. If no specimen is behind a link, the newest state that a checkpoint kept replaces
//! the rows before it. Where the last rows are damaged, the test resumes after the last reproduced checkpoint, and specimens
//! behind links repeat the steps after it. If that is more than a kill can lose, the record is damaged and the resume is refused.
//! Files that were changed since are refused. Nothing is written to the interrupted run. A trip stays latched: a test that ended
//! with one resumes only with `--after-trip`.

mod error;
mod places;
mod trips;
mod widened;

use std::path::{Path, PathBuf};

use super::checksum::{check_files as check_files_of, read, rows_sha256, sha256, unreadable};
use super::continued;
use super::origin::{Kept, Origin};
use super::recorded::Replaced;
use super::request_socket::{Request, Unanswered, ask};
use super::retrace::{
    Build, Retraced, go_on_from, prepared_to_resume, recorded_file, retrace, unusable_states,
};
use super::row_peaks::peak_of;
pub use error::ResumeError;
#[cfg(any(test, feature = "test-doubles"))]
use gusset_config::Loaded;
use gusset_config::resolve_again;
use gusset_control::port::Port;
use gusset_quantity::units::duration;
use gusset_record::summary::Status;
use gusset_record::{BEFORE, MissingEnd, Run, ToldBy};
#[cfg(any(test, feature = "test-doubles"))]
use gusset_setup::Dial;
use gusset_setup::{self as setup, Facts, Prepared};
use places::{Tolerances, places, ticks_lost};
use trips::Trips;

/// Name of the override in `accepted` of the summary.
const CHANGED: &str = "accept_changed";
const ON_ITS_WAY_IN: &str = "it ended during startup and made no step: its state is that of the run before it, and the specimens \
    are where it left them";
const UNTRIED: &str =
    "the wiring check is not repeated: start a new test if the wiring was changed";

/// Name of the reason for wider limits in `accepted` of the summary.
const WIDENED: &str = "wider_limits";

/// Permissions of the user for a test that is resumed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Allowed<'a> {
    /// It may resume although it tripped.
    pub after_trip: bool,
    /// Why it may resume although a specimen changed since the interruption: its position or force differs, or a server computes
    /// it without keeping its state.
    pub changed: Option<&'a str>,
    /// Limits that it widens, as `KEY=VALUE`, and why.
    pub wider: Option<(&'a [String], &'a str)>,
}

/// Prepares the test in `folder` to continue, with all permissions of the user. `test`: the test file, if one was given; it must be the
/// interrupted one.
///
/// # Errors
/// See [`ResumeError`].
pub fn resume_allowed(
    folder: &Path,
    test: Option<&Path>,
    allowed: Allowed<'_>,
) -> Result<Prepared, ResumeError> {
    resume_by(folder, test, allowed, &mut setup::build)
}

/// Resumes over transports that are connected already: those that `dial` makes, one after the other.
///
/// # Errors
/// As [`resume_allowed`].
#[cfg(any(test, feature = "test-doubles"))]
pub fn resume_over(
    folder: &Path,
    after_trip: bool,
    dial: &mut Dial<'_>,
) -> Result<Prepared, ResumeError> {
    let build = &mut |loaded: &Loaded| setup::build_over(loaded, dial);
    let allowed = Allowed {
        after_trip,
        ..Allowed::default()
    };
    resume_by(folder, None, allowed, build)
}

fn resume_by(
    folder: &Path,
    test: Option<&Path>,
    allowed: Allowed<'_>,
    build: &mut Build<'_>,
) -> Result<Prepared, ResumeError> {
    let run = Run::open(folder)?;
    let before = Origin::of(folder)?;
    let interrupted = may_be_resumed(&run, before.as_ref())?;
    has_its_end(&run, before.as_ref())?;
    check_files(&run, test, before.as_ref())?;
    let ended = end_before(&run, allowed.after_trip)?;
    let (mut traced, note) = trace(&run)?;
    let Some((side, ports, resumption)) = traced.state.take() else {
        return Err(if traced.completed {
            ResumeError::Complete(folder.to_owned())
        } else {
            ResumeError::NotBegun(folder.to_owned())
        });
    };
    let sets = allowed.wider.map_or(&[][..], |(sets, _)| sets);
    let mut next = prepared_to_resume(&run, sets, build)?;
    next.files.resolved = String::from_utf8_lossy(&read(&folder.join("resolved.toml"))?).into();
    let earlier = before.as_ref().and_then(|one| one.wider_limits.clone());
    let wider = widened_limits(&run, allowed, earlier, &mut next)?;
    let step = resumption.step();
    if step >= next.experiment.steps {
        // It was stopped during its shutdown.
        return Err(ResumeError::Complete(folder.to_owned()));
    }
    let rate_hz = next.facts.rate_hz;
    check_way_back(&run, &traced, &ports, step, rate_hz)?;
    let on_its_way_in = traced.on_its_way_in;
    let origin = (before, &*interrupted);
    let origin = origin_of(&run, &traced, &ports, (step, &next.facts), origin, allowed)?;
    // The rows of a test that made no step do not count: those of the test before it do.
    let kept = if on_its_way_in {
        folder.join(BEFORE)
    } else {
        folder.to_owned()
    };
    go_on_from(&mut next.experiment, &origin, (side, ports, resumption));
    for (index, port) in next.experiment.ports.iter().enumerate() {
        if let Some(hit) = port.next_command_beyond() {
            let specimen = port.name().to_owned();
            return Err(ResumeError::NextBeyond {
                specimen,
                index,
                hit,
            });
        }
    }
    next.files.test = read(&folder.join("test.toml"))?;
    next.facts.resumed = Some((folder.to_owned(), step));
    let text = serde_json::to_string_pretty(&origin).ok();
    next.files.origin = text.map(|text| (kept, text));
    let retraced = match traced.restored {
        Some((step, rows)) => format!(
            "the state of step {step} restored, {} rows after it retraced",
            traced.rows - rows
        ),
        None => format!("{} rows retraced", traced.rows),
    };
    let resumed = format!(
        "resumed from {} after step {step} ({}): {retraced}",
        folder.display(),
        duration(origin.time)
    );
    // The wiring check is not repeated.
    let tried = !std::mem::take(&mut next.facts.announced).is_empty();
    let accepted = allowed.changed.map(|reason| {
        let reason = reason.to_owned();
        next.facts.accepted.insert(CHANGED.to_owned(), reason.clone());
        format!("`--accept-changed`: a specimen that has changed since the interruption does not stop the test; reason: {reason}")
    });
    let texts = [
        Some(resumed),
        Some(ended),
        on_its_way_in.then(|| ON_ITS_WAY_IN.to_owned()),
        tried.then(|| UNTRIED.to_owned()),
        note,
        accepted,
        wider,
    ];
    let unusable = unusable_states(&run)?;
    for text in texts.into_iter().flatten().chain(unusable) {
        next.facts.announced.push(text.clone());
        next.facts.warnings.push(text);
    }
    Ok(next)
}

/// The limits of `next` that are wider than those of `run` in words, or that they were widened `earlier` and why; none where all are
/// those of the first run.
fn widened_limits(
    run: &Run,
    allowed: Allowed<'_>,
    earlier: Option<String>,
    next: &mut Prepared,
) -> Result<Option<String>, ResumeError> {
    let (mut reasons, mut told) = (Vec::new(), Vec::new());
    if let Some(reason) = earlier {
        told.push(format!(
            "LIMITS WERE WIDENED in an earlier part of the test; reason: {reason}"
        ));
        reasons.push(reason);
    }
    if let Some(((_, reason), loaded)) = allowed.wider.zip(next.loaded.as_deref()) {
        let limits = widened::widened(&recorded_file(run.path(), &[])?, loaded)?;
        if !limits.is_empty() {
            let path = run.path().join("resolved.toml");
            next.files.resolved = resolve_again(loaded)
                .map_err(|error| unreadable(&path, std::io::Error::other(error)))?;
            told.push(format!(
                "LIMITS WERE WIDENED for this part of the test: {}; reason: {reason}",
                limits.join(", ")
            ));
            reasons.push(reason.to_owned());
        }
    }
    if reasons.is_empty() {
        return Ok(None);
    }
    let accepted = &mut next.facts.accepted;
    accepted.insert(WIDENED.to_owned(), reasons.join("; "));
    Ok(Some(told.join(". ")))
}

/// Refuses a test that runs, may be running, is complete, or was resumed already. Returns the folder of the interrupted test: that of
/// `run`, or of the test before it if `run` made no step.
fn may_be_resumed(run: &Run, origin: Option<&Origin>) -> Result<PathBuf, ResumeError> {
    let folder = run.path();
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
    let interrupted = continued::interrupted(run, origin);
    if let Some(before) = continued::last_of(&interrupted)? {
        return Err(ResumeError::WentOn {
            folder: interrupted,
            before,
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
    Ok(interrupted)
}

/// Refuses a record whose last rows are missing.
fn has_its_end(run: &Run, origin: Option<&Origin>) -> Result<(), ResumeError> {
    // A test that ended during startup has made none of the steps in its summary.
    let has_steps = |missing: &MissingEnd| {
        let before = origin.map(|origin| origin.step);
        before.is_none_or(|step| missing.told_by != ToldBy::Summary(step))
    };
    match MissingEnd::of_run(run).filter(has_steps) {
        None => Ok(()),
        Some(missing) => Err(ResumeError::Short {
            folder: run.path().to_owned(),
            missing,
        }),
    }
}

/// The content of `resumed.json` for the resumed test; `before` is that of the interrupted test.
fn origin_of(
    run: &Run,
    traced: &Retraced,
    ports: &[Port],
    (step, facts): (u64, &Facts),
    (before, interrupted): (Option<Origin>, &Path),
    allowed: Allowed<'_>,
) -> Result<Origin, ResumeError> {
    let peak = before.as_ref().map(|before| &before.peak);
    let peak = peak_of(run, traced.rows, ports, peak)?;
    let by = Tolerances {
        within_m: facts.resume_within,
        within_n: facts.resume_within_n,
        noise_n: &facts.force_noise_n,
        peak: &peak,
        pace: (facts.rate_hz, facts.ticks_per_step),
    };
    let before = before.filter(|_| traced.on_its_way_in);
    let left = places(run, ports, &by, before.as_ref())?;
    let (rows, rows_sha256) = match before {
        Some(before) => (before.rows, before.rows_sha256),
        None => (traced.rows, rows_sha256(run, traced.rows)?),
    };
    Ok(Origin {
        parent: std::path::absolute(interrupted).unwrap_or_else(|_| interrupted.to_owned()),
        rows,
        rows_sha256,
        step,
        time: step as f64 * facts.dt,
        places: (left.iter())
            .map(|axes| axes.iter().map(Kept::words).collect())
            .collect(),
        peak,
        accepted_changed: allowed.changed.map(str::to_owned),
        wider_limits: facts.accepted.get(WIDENED).cloned(),
    })
}

/// How the test ended before, to be reported. A test that tripped, or may have, needs `--after-trip`.
fn end_before(run: &Run, after_trip: bool) -> Result<String, ResumeError> {
    let reason = run.summary().map_or_else(
        || "it was killed: there is no summary.json".to_owned(),
        |summary| summary.reason.clone(),
    );
    let Trips {
        names,
        certain,
        unreadable,
    } = Trips::of(run)?;
    let mut text = if names.is_empty() {
        format!("it had ended before: {reason}")
    } else if after_trip {
        let tripped = if certain { "HAD" } else { "MAY HAVE" };
        let names = names.join(", ");
        format!(
            "THE TEST {tripped} TRIPPED ({names}): {reason}; it resumes because of `--after-trip`"
        )
    } else {
        return Err(ResumeError::Tripped {
            folder: run.path().to_owned(),
            certain,
            names: names.join(", "),
            reason,
        });
    };
    if unreadable > 0 {
        text = format!("{text}; {unreadable} lines of its events cannot be read");
    }
    Ok(text)
}

/// The state after the last good row. For a damaged record: that of the last checkpoint, the damage after it, and the text
/// about it.
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
        "{trouble}: the test resumes after the last checkpoint before that, step {}",
        checkpoint.step
    );
    let trouble = Some(trouble);
    Ok((Retraced { trouble, ..again }, Some(note)))
}

/// Refuses a damaged record, where specimens behind links would repeat more than a kill can lose.
fn check_way_back(
    run: &Run,
    traced: &Retraced,
    ports: &[Port],
    step: u64,
    rate_hz: f64,
) -> Result<(), ResumeError> {
    let Some(trouble) = &traced.trouble else {
        return Ok(());
    };
    let again = run.rows_made()?.saturating_sub(traced.rows) as f64;
    let remember: Vec<&str> = ports
        .iter()
        .filter(|port| !port.exchange().is_formula())
        .map(|port| port.name())
        .collect();
    if again <= ticks_lost(rate_hz) || remember.is_empty() {
        return Ok(());
    }
    Err(ResumeError::Back {
        folder: run.path().to_owned(),
        trouble: trouble.clone(),
        step,
        again_s: again / rate_hz,
        specimens: remember.join(", "),
    })
}

/// Checks that the files are those of the test, by its first events.
fn check_files(run: &Run, test: Option<&Path>, origin: Option<&Origin>) -> Result<(), ResumeError> {
    let folder = run.path();
    if !check_files_of(run)? {
        // It was killed before it wrote anything; a resumed test is not a beginning.
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
