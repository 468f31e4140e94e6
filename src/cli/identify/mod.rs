//! `gusset identify`: drives the specimens of a test file with a small motion, and says what they and their actuators are.
//!
//! The run is an ordinary one, with the loop, the limits, the record and the retirement of `gusset run`, into a run folder
//! that `report`, `export` and `replay` read. What was identified is added to the folder afterwards.

mod amplitude;
mod course;
mod matrices;
mod outcome;
mod page;
mod text;
mod twin;

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};

use super::args::TestRunArgs;
use super::attend;
use super::conduct;
use super::exit::{Exit, WithExit};
use super::progress::ProgressLine;
use super::run::refused;
use super::{answer, tell, warn};
use crate::config::{ConfigError, Loaded};
use crate::identify::Shape;
use crate::record::{Progress, RunFolder};
use crate::session::rehearsal::FullRehearsal;
use crate::session::{self, Finished, Signals, Watches};
use crate::setup::{self, Facts, Prepared};

use course::Plan;
use outcome::Outcome;

/// What `gusset identify` takes.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset identify config/vrths-case-1.toml --amplitude 0.002 --out runs/floor-1\n  \
    gusset check runs/floor-1/identified.toml\n\n\
    The limits of the test file apply. Axes move one after the other. identified.toml in the run folder is a test file with \
    the identified specimen.\n\n\
    Exits with 1 if the motion was stopped or if a measured displacement does not follow the command.\n\n\
    More: gusset guide actuators"
)]
pub(super) struct IdentifyArgs {
    /// The test file.
    pub test: PathBuf,
    /// The specimen to identify. The others are neither connected nor moved [default: all, one after the other].
    #[arg(long, value_name = "NAME")]
    pub specimen: Option<String>,
    /// Amplitude of the motion in m, at the specimen [default: 5 % of the free range of `command_disp_m`, or less to stay below half
    /// of the other limits].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub amplitude: Option<f64>,
    /// Lowest and highest frequency in Hz [default: 0.2 and 10, at most a fifth of the ticks per second].
    #[arg(
        long,
        value_name = "F1,F2",
        value_delimiter = ',',
        num_args = 1,
        allow_negative_numbers = true
    )]
    pub band: Option<Vec<f64>>,
    /// Duration of the motion of each axis in s.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 30.0,
        allow_negative_numbers = true
    )]
    pub duration: f64,
    /// Kind of motion.
    #[arg(long, value_enum, default_value_t = MotionArg::Sweep)]
    pub motion: MotionArg,
    /// Seed of the random numbers of noise and steps.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[command(flatten)]
    pub test_run: TestRunArgs,
    /// Print the results as JSON on stdout.
    #[arg(long)]
    pub json: bool,
    /// Do not print the progress line.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum MotionArg {
    /// A sine whose frequency sweeps through the band.
    Sweep,
    /// Noise within the band.
    Noise,
    /// Steps between random levels.
    Steps,
}

impl From<MotionArg> for Shape {
    fn from(arg: MotionArg) -> Self {
        match arg {
            MotionArg::Sweep => Self::Sweep,
            MotionArg::Noise => Self::Noise,
            MotionArg::Steps => Self::Steps,
        }
    }
}

/// A refusal before anything moves.
fn usage(text: String) -> anyhow::Error {
    WithExit(Exit::Usage, format!("{text}\nnothing was moved")).into()
}

/// Identifies.
pub fn identify(args: &IdentifyArgs) -> anyhow::Result<Exit> {
    let loaded = args.test_run.load(&args.test)?;
    let (plan, driven) = allowed(args, &loaded)?;
    refuse_forces_only(&plan, &driven)?;
    for line in plan.announced(&loaded) {
        tell(line);
    }
    let mut test = setup::build(&driven).map_err(refused)?;
    warn(&test.warnings);
    for text in &test.facts.announced {
        tell(format_args!("note: {text}"));
    }
    for axis in &plan.axes {
        if let Some(port) = test.experiment.ports.get_mut(axis.place) {
            port.needs_measured_disp.own = vec!["`gusset identify`".to_owned()];
        }
    }
    attend::can_confirm(&mut test.facts, args.test_run.yes)?;
    let facts = test.facts.clone();
    let (mut finished, exit) = carry_out(args, test, &facts)?;
    let report = session::conclude(&mut finished);
    if let Err(error) = &report {
        tell(format_args!("warning: not written: {error}"));
    }
    if exit != Exit::Done {
        let (headline, reason) = (conduct::headline(finished.finish), &finished.summary.reason);
        let text = format!("nothing is identified: {headline}: {reason}");
        return Err(WithExit(exit, text).into());
    }
    if !finished.folder.is_there() {
        let text = "the run folder was deleted, and nothing is identified";
        return Err(WithExit(Exit::Stopped, text.to_owned()).into());
    }
    let folder = finished.folder.path();
    let outcome = Outcome::read(folder, &plan, &driven)?;
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

/// Refuses a specimen whose link is known to answer with forces only: against its command it would follow without fault.
fn refuse_forces_only(plan: &Plan, driven: &Loaded) -> anyhow::Result<()> {
    let specimens = &driven.file.specimen;
    let mut without = plan.axes.iter().filter(|axis| {
        let specimen = specimens.get(axis.place);
        specimen.is_some_and(|of| of.force_only_link().is_some())
    });
    without.next().map_or(Ok(()), |axis| {
        Err(usage(format!(
            "{}: its link answers with forces only, so its actuator cannot be identified: the command would be compared with itself. \
             State `delay_s` in [specimen.identified] as the laboratory measured it",
            axis.words()
        )))
    })
}

/// The motion, and the test that makes it: no limit of the file would trip in it. An amplitude that was not asked for is halved
/// until that is so.
fn allowed(args: &IdentifyArgs, loaded: &Loaded) -> anyhow::Result<(Plan, Loaded)> {
    let mut halved = 0;
    loop {
        let plan = Plan::of(args, loaded, halved)?;
        let driven = loaded
            .beside(&plan.said(args), &plan.file)
            .map_err(refused)?;
        // A linear stand-in shows forces, and limits that are not those of the command.
        let full = FullRehearsal::of(&driven).map_err(refused)?;
        let possible = full.is_possible();
        if possible || args.amplitude.is_some() || halved == MOST_HALVED {
            let diagnostics = driven.diagnose(full.findings);
            if !possible {
                return Err(refused(ConfigError::Invalid(diagnostics)));
            }
            warn(&diagnostics);
            return Ok((plan, driven));
        }
        halved += 1;
    }
}

/// How often an amplitude is halved.
const MOST_HALVED: i32 = 6;

/// Runs the motion into a folder; returns how it ended, and the exit code for that.
fn carry_out(
    args: &IdentifyArgs,
    test: Prepared,
    facts: &Facts,
) -> anyhow::Result<(Finished, Exit)> {
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let folder = conduct::folder(args.test_run.out.as_deref(), &facts.title)?;
    let line = ProgressLine::new(facts, !args.quiet);
    let control = conduct::attended(&signals, facts, &folder, args.test_run.yes)?;
    let watches = Watches::default();
    let finished = session::run(
        test,
        folder,
        control,
        watches,
        &mut |progress: &Progress| line.show(progress),
    );
    line.clear();
    let finished = conduct::finished(finished)?;
    let exit = conduct::exit_of(finished.finish, signals.seen());
    Ok((finished, exit))
}

/// Folder of the pictures in the run folder.
const PICTURES: &str = "identification";

/// Writes what was found into the run folder.
fn keep(outcome: &Outcome, plan: &Plan, driven: &Loaded, folder: &RunFolder) -> anyhow::Result<()> {
    folder.make(PICTURES)?;
    let json = serde_json::to_string_pretty(&outcome.as_json(folder.path()))?;
    let mut files = vec![("identification.json".to_owned(), json)];
    if let Some(twin) = twin::text(outcome, plan, driven)? {
        files.push(("identified.toml".to_owned(), twin));
    }
    let page = page::files(outcome, driven).into_iter();
    files.extend(page.map(|(name, text)| (format!("{PICTURES}/{name}"), text)));
    for (name, text) in files {
        folder.write_extra(&name, text.as_bytes())?;
    }
    Ok(())
}
