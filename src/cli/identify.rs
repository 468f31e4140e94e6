//! `gusset identify`: drives the specimens of a test file with a small motion, and identifies them and their actuators.
//!
//! The run is an ordinary one, with the loop, the limits, the record and the retirement of `gusset run`, into a run folder
//! that `report`, `export` and `replay` read. The identified properties are added to the folder afterwards.

mod text;

use anyhow::Context;

use super::args::IdentifyArgs;
use super::attend;
use super::conduct;
use super::exit::{Exit, WithExit};
use super::progress::ProgressLine;
use super::test_file::refused;
use super::{answer, tell, warn};
use gusset_config::{ConfigError, Loaded};
use gusset_record::{Progress, RunFolder};
use gusset_session::identification::{
    IdentificationError, Outcome, PICTURES, Plan, Request, files,
};
use gusset_session::{self as session, Finished, Judged, Signals, Watches};
use gusset_setup::{self as setup, Facts};

/// An error with its exit code.
fn told(error: IdentificationError) -> anyhow::Error {
    let exit = match error {
        IdentificationError::Config(error) => return refused(error),
        IdentificationError::Refused(_) => Exit::Usage,
        IdentificationError::Broken(_) => Exit::Stopped,
        other => return other.into(),
    };
    WithExit(exit, error.to_string()).into()
}

/// Identifies.
pub fn identify(args: &IdentifyArgs) -> anyhow::Result<Exit> {
    let loaded = args.test_run.load(&args.test)?;
    let request = Request {
        test: args.test.clone(),
        specimen: args.specimen.clone(),
        amplitude: args.amplitude,
        band: args.band.clone(),
        duration: args.duration,
        shape: args.motion.into(),
        seed: args.seed,
    };
    let (plan, driven, full) = Plan::within_limits(&request, &loaded).map_err(told)?;
    if !full.is_possible() {
        let diagnostics = driven.diagnose(full.findings);
        return Err(refused(ConfigError::Invalid(diagnostics)));
    }
    plan.refuse_forces_only(&driven).map_err(told)?;
    for line in plan.announced(&loaded) {
        tell(line);
    }
    let mut test = setup::build(&driven).map_err(refused)?;
    warn(&test.warnings);
    for text in &test.facts.announced {
        tell(format_args!("note: {text}"));
    }
    test.experiment.retraces = true;
    for axis in &plan.axes {
        if let Some(port) = test.experiment.ports.get_mut(axis.place) {
            port.startup_mut().needs_measured_disp_mut().own = vec!["`gusset identify`".to_owned()];
        }
    }
    let mut judged = Judged::without_rehearsal(test);
    if judged.verdict.behind_link {
        judged = judged.with(full);
    } else {
        warn(&driven.diagnose(full.findings));
    }
    conduct::obey(&judged)?;
    attend::can_confirm(&mut judged.test.facts, args.test_run.yes)?;
    let facts = judged.test.facts.clone();
    let (mut finished, exit) = carry_out(args, judged, &facts)?;
    let report = session::conclude(&finished.folder, &mut finished.summary);
    if let Err(error) = &report {
        tell(format_args!("warning: not written: {error}"));
    }
    if exit != Exit::Done {
        let (headline, reason) = (finished.cause.heading(), &finished.summary.reason);
        let text = format!("nothing is identified: {headline}: {reason}");
        return Err(WithExit(exit, text).into());
    }
    if !finished.folder.is_there() {
        let text = "the run folder was deleted, and nothing is identified";
        return Err(WithExit(Exit::Stopped, text.to_owned()).into());
    }
    let folder = finished.folder.path();
    let outcome = Outcome::read(folder, &plan, &driven).map_err(told)?;
    keep(&outcome, &plan, &driven, &finished.folder)?;
    if args.json {
        answer(serde_json::to_string_pretty(&outcome.as_json(folder))?)?;
    } else {
        answer(text::table(&outcome, folder))?;
    }
    match outcome.first_error() {
        None => Ok(Exit::Done),
        Some(text) => Err(WithExit(Exit::Stopped, text).into()),
    }
}

/// Runs the motion into a folder; returns how it ended, and the exit code for that.
fn carry_out(args: &IdentifyArgs, test: Judged, facts: &Facts) -> anyhow::Result<(Finished, Exit)> {
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let folder = conduct::folder(args.test_run.out.as_deref(), &facts.title)?;
    let line = ProgressLine::new(facts, !args.quiet);
    let control = conduct::attended(&signals, facts, &folder, args.test_run.yes)?;
    let watches = Watches {
        specimen_records: super::control::records(&test.test, "gusset identify"),
        ..Watches::default()
    };
    let finished = session::run(
        test,
        folder,
        control,
        watches,
        &mut |progress: &Progress| line.show(progress),
    );
    line.clear();
    let finished = conduct::finished(finished)?;
    let exit = finished.exit(signals.seen());
    Ok((finished, exit))
}

/// Writes the results into the run folder.
fn keep(outcome: &Outcome, plan: &Plan, driven: &Loaded, folder: &RunFolder) -> anyhow::Result<()> {
    folder.make(PICTURES)?;
    let files = files(outcome, plan, driven, folder.path()).map_err(told)?;
    for (name, text) in files {
        folder.write(&name, text.as_bytes())?;
    }
    Ok(())
}
