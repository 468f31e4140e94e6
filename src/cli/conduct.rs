//! What every command that takes specimens through a run shares: the folder, who attends, and how a run that could not be made
//! is told.

use std::path::Path;

use anyhow::Context;

use super::attend::Attendant;
use super::exit::{Exit, WithExit};
use super::screen::in_colour;
use super::{tell, warn};
use crate::engine::{Control, PhaseCell};
use crate::record::RunFolder;
use crate::rt::wall::Wall;
use crate::session::{Finish, Finished, Judged, SessionError, Signal, Signals};
use crate::setup::Facts;

/// Notices of the loop that may wait to be read.
const NOTICES: usize = 1024;

/// Shows the findings of the verdict, and refuses the test if it forbids it.
pub(super) fn obey(judged: &Judged) -> anyhow::Result<()> {
    let Some(loaded) = &judged.test.loaded else {
        return Ok(());
    };
    let found = loaded.diagnose(judged.verdict.shown(false));
    if !judged.verdict.forbids() {
        warn(&found);
        return Ok(());
    }
    tell(found.render(in_colour()));
    let keys = judged.verdict.open_keys();
    let text = format!(
        "the verdict forbids this test, because it moves a specimen behind a link; nothing was moved\n\
         mend it, or give a reason in [safety]: {}",
        keys.map(|key| format!("{key} = \"…\""))
            .collect::<Vec<_>>()
            .join(", ")
    );
    Err(WithExit(Exit::Usage, text).into())
}

/// The folder that was asked for, or one of its own.
pub(super) fn folder(out: Option<&Path>, title: &str) -> anyhow::Result<RunFolder> {
    match out {
        Some(path) => RunFolder::create(path),
        None => RunFolder::create_default(Path::new("runs"), title, Wall::now().0),
    }
    .context("the run folder cannot be made")
}

/// The loop hears the signals and the desk; its notices are attended to from now on.
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
        desk: Some(signals.operator()),
    })
}

/// What came of a run; what of it could not be written is told.
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

/// The exit code of a test that ended like this; an interruption has the code of its `signal`.
pub(super) const fn exit_of(finish: Finish, signal: Option<Signal>) -> Exit {
    match finish {
        Finish::Completed => Exit::Done,
        Finish::Stopped => Exit::Stopped,
        Finish::Refused | Finish::Unfit => Exit::Usage,
        Finish::Interrupted => match signal {
            Some(Signal::Terminate) => Exit::Terminated,
            Some(Signal::Interrupt) | None => Exit::Interrupted,
        },
        Finish::NotConnected | Finish::WiringFault | Finish::LinkFailed => Exit::Link,
        Finish::Panicked => Exit::Panic,
    }
}

/// How a test ended, as a heading.
pub(super) const fn headline(finish: Finish) -> &'static str {
    match finish {
        Finish::Completed => "completed",
        Finish::Stopped => "STOPPED",
        Finish::Refused => "REFUSED: a specimen has changed since the interruption",
        Finish::Unfit => "REFUSED: a specimen does not meet the needs of this test",
        Finish::Interrupted => "interrupted",
        Finish::NotConnected => "FAILED: a specimen could not be connected",
        Finish::WiringFault => "FAILED: wiring check",
        Finish::LinkFailed => "FAILED: a link was lost",
        Finish::Panicked => "FAILED: internal error, the specimens were retired",
    }
}

/// Ends a command whose test ended with `exit`. Every code but 0 has a reason on stderr: the caller's table gave it, or this
/// error does.
pub(super) fn end(finished: &Finished, exit: Exit, is_told: bool) -> anyhow::Result<Exit> {
    if is_told || exit == Exit::Done {
        return Ok(exit);
    }
    let (headline, reason) = (headline(finished.finish), &finished.summary.reason);
    Err(WithExit(exit, format!("{headline}: {reason}")).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_failure_has_its_own_headline_and_code() {
        let failures = [
            (Finish::Refused, Exit::Usage),
            (Finish::Unfit, Exit::Usage),
            (Finish::NotConnected, Exit::Link),
            (Finish::WiringFault, Exit::Link),
            (Finish::LinkFailed, Exit::Link),
        ];
        for (finish, exit) in failures {
            assert_eq!(exit_of(finish, None), exit);
        }
        let headlines = failures.map(|(finish, _)| headline(finish));
        assert!((1..headlines.len()).all(|at| !headlines[..at].contains(&headlines[at])));
    }
}
