//! Common part of all commands that take specimens through a run: the folder, the attendant, and reports of failed runs.

use std::path::Path;

use anyhow::Context;

use super::attend::Attendant;
use super::exit::{Exit, WithExit};
use super::screen::in_colour;
use super::{tell, warn};
use gusset_config::Locator;
use gusset_control::engine::{Control, PhaseCell};
use gusset_proof::Verdict;
use gusset_record::RunFolder;
use gusset_record::rt::wall::Wall;
use gusset_session::{Finished, Judged, SessionError, Signals};
use gusset_setup::Facts;

/// Notices of the loop that may wait to be read.
const NOTICES: usize = 1024;

/// Shows the findings of the verdict, and refuses the test if it forbids it.
pub(super) fn obey(judged: &Judged) -> anyhow::Result<()> {
    match &judged.test.loaded {
        Some(loaded) => obey_verdict(&judged.verdict, &loaded.locator, "test"),
        None => Ok(()),
    }
}

/// Shows the findings of a verdict. Refuses the judged subject (a "test" or a "gateway") if it forbids it.
pub(super) fn obey_verdict(verdict: &Verdict, locator: &Locator, what: &str) -> anyhow::Result<()> {
    let found = locator.diagnose_all(verdict.shown(false));
    if !verdict.forbids() {
        warn(&found);
        return Ok(());
    }
    tell(found.render(in_colour()));
    let keys = verdict.open_keys();
    anyhow::bail!(
        "the verdict forbids this {what}, because it moves a specimen behind a link; nothing was moved\n\
         mend it, or give a reason in [safety]: {}",
        keys.map(|key| format!("{key} = \"…\""))
            .collect::<Vec<_>>()
            .join(", ")
    )
}

/// The requested folder, or a new default one.
pub(super) fn folder(out: Option<&Path>, title: &str) -> anyhow::Result<RunFolder> {
    match out {
        Some(path) => RunFolder::create(path),
        None => RunFolder::create_default(Path::new("runs"), title, Wall::now().0),
    }
    .context("the run folder cannot be made")
}

/// Connects the loop with the signals and the control socket, and attends to its notices from now on.
pub(super) fn attended(
    signals: &Signals,
    facts: &Facts,
    folder: &RunFolder,
    yes: bool,
) -> anyhow::Result<Control> {
    let (notices, heard) = crossbeam_channel::bounded(NOTICES);
    let phase = PhaseCell::default();
    let attendant = Attendant {
        names: facts.specimens.clone(),
        units: facts.units.clone(),
        run: folder.path().to_owned(),
        phase: phase.clone(),
        operator: signals.operator(),
        yes,
    };
    attendant.attend(heard)?;
    Ok(Control {
        requests: signals.requests(),
        notices,
        phase,
        request_socket: Some(signals.operator()),
    })
}

/// The result of a run; reports the files that could not be written.
pub(super) fn finished(run: Result<Finished, SessionError>) -> anyhow::Result<Finished> {
    let finished = run.map_err(|error| match error {
        SessionError::NotRealTime { .. } => {
            WithExit(Exit::NoRealTime, format!("{error}\nnothing was moved")).into()
        }
        other => anyhow::Error::new(other),
    })?;
    for text in &finished.unwritten {
        tell(format_args!("warning: not written: {text}"));
    }
    Ok(finished)
}

/// Ends a command whose test ended with `exit`. Every code but 0 has a reason on stderr: the caller's table gave it, or this
/// error does.
pub(super) fn end(finished: &Finished, exit: Exit, is_told: bool) -> anyhow::Result<Exit> {
    if is_told || exit == Exit::Done {
        return Ok(exit);
    }
    let (heading, reason) = (finished.cause.heading(), &finished.summary.reason);
    Err(WithExit(exit, format!("{heading}: {reason}")).into())
}
