//! What the command line takes: the commands, and the arguments of those that read a test file.

mod folders;
mod guide;
mod machine;
mod serve;

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};

pub(super) use folders::{
    DerivedArg, ExportArgs, FormatArg, OperateArgs, RateArg, ReplayArgs, ReportArgs, ResetArgs,
};
pub(super) use guide::GuideArgs;
pub(super) use machine::{DoctorArgs, JitterArgs, ModelArg};
pub(super) use serve::{ProtocolArg, ServeArgs, SignalOrderArg, TlsArgs, TransportArg};

use super::run::load;
use super::{benchmark, identify};
use crate::config::Loaded;

/// Real-time hybrid simulation: joins a structure that is computed to a specimen that is measured.
#[derive(Debug, Parser)]
#[command(
    name = "gusset",
    version,
    about,
    max_term_width = 100,
    after_help = "Example:\n  gusset check config/frame-bouc-wen.toml\n  gusset run config/frame-bouc-wen.toml"
)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Run one hybrid test.
    Run(RunArgs),
    /// Read a test without moving anything: is it valid, what will it do, is λ stable?
    Check(CheckArgs),
    /// Drive a specimen with a small motion and find out what its actuator and it are.
    Identify(identify::IdentifyArgs),
    /// Measure the loop's own timing on this machine, with nothing attached.
    Jitter(JitterArgs),
    /// Say what this machine gives and lacks for real-time work, and what to do about it.
    Doctor(DoctorArgs),
    /// Write a run's whole response history in a form that other programs read.
    Export(ExportArgs),
    /// Write a run's report.html again, or a page that compares two runs.
    Report(ReportArgs),
    /// End a running test in an orderly way.
    #[command(after_help = "Example:\n  gusset stop runs/first")]
    Stop(OperateArgs),
    /// Let a running test stand still: test time stops, the specimens hold.
    #[command(after_help = "Example:\n  gusset hold runs/first")]
    Hold(OperateArgs),
    /// Let a test that is held go on; of one that is not, confirm what its sensors read if it asks for that. It ends the hold
    /// that it finds, and no later one.
    #[command(after_help = "Example:\n  gusset continue runs/first")]
    Continue(OperateArgs),
    /// Feed a recorded test through the loop again and prove that every number comes out bit for bit the same.
    Replay(ReplayArgs),
    /// Host a specimen for controllers that command it over a network, until told to stop.
    Serve(ServeArgs),
    /// Clear the latched trip of a served specimen, so that a test may begin again.
    Reset(ResetArgs),
    /// Obtain the published tables, equations, figures and examples of the integration family anew, and judge them.
    Verify(VerifyArgs),
    /// Run a published benchmark of hybrid simulation.
    #[command(subcommand)]
    Benchmark(benchmark::Of),
    /// Show the guide: the contents, a page, or a configuration key.
    Guide(GuideArgs),
    /// Print the JSON Schema of the test file.
    #[command(
        after_help = "Example:\n  gusset schema > gusset.schema.json\n\nAn editor with a TOML language server completes \
                      and checks a test file that begins with the line\n  #:schema ./gusset.schema.json"
    )]
    Schema,
}

/// A reason that says something.
fn reason(text: &str) -> Result<String, String> {
    match text.trim() {
        "" => Err("it is empty: say why the test may go on".to_owned()),
        reason => Ok(reason.to_owned()),
    }
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset run config/frame-bouc-wen.toml --out runs/first\n  \
    gusset run config/frame-bouc-wen.toml --clock simulated --set integrator.lambda=4\n  \
    gusset run config/frame-bouc-wen.toml --live\n  \
    gusset run --resume runs/first --out runs/second\n  \
    gusset run --resume runs/first --out runs/second --after-trip measured_force_n"
)]
pub(super) struct RunArgs {
    /// The test file.
    #[arg(required_unless_present = "resume")]
    pub test: Option<PathBuf>,
    /// Goes on with an interrupted test where its folder's record ends, into a folder of its own; refused if a specimen does
    /// not stand where it was left or bears another force, a file was changed, or another test has continued it already and
    /// moved its specimens.
    #[arg(long, value_name = "RUN_DIR", conflicts_with_all = ["sets", "clock"])]
    pub resume: Option<PathBuf>,
    /// With --resume: the test had tripped and may go on, each trip by its name: the key of a limit, or interlock, saturated,
    /// geometry, diverged, not_finite, unknown (a row says that it tripped, no event says by what; or it may have tripped: not
    /// all of its events can be read). --yes does not say so.
    #[arg(long, value_name = "TRIP", requires = "resume")]
    pub after_trip: Vec<String>,
    /// With --resume: the record is damaged or has a gap, and the test may go on after the last checkpoint before that, this
    /// step, or another test went on after this step already: though specimens behind links are then led once more through what
    /// they have been through; a refusal names it.
    #[arg(long, value_name = "STEP", requires = "resume")]
    pub back_to_step: Option<u64>,
    /// With --resume: the test may go on although a specimen has changed since the interruption, for this reason. Without it the
    /// test is refused (exit 2) where a specimen stands elsewhere, its force is another one, or it is computed by a server that
    /// does not keep its state ([serve] remembers). The reason is kept in the summary and in the report.
    #[arg(long, value_name = "REASON", requires = "resume", value_parser = reason)]
    pub accept_changed: Option<String>,
    #[command(flatten)]
    pub test_run: TestRunArgs,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    pub json: bool,
    /// Do not print the progress and the closing summary.
    #[arg(long)]
    pub quiet: bool,
    /// What a terminal shows while the test runs.
    #[arg(long, value_enum, default_value_t = StatusArg::Line, conflicts_with = "quiet")]
    pub status: StatusArg,
    #[cfg(feature = "monitor")]
    #[command(flatten)]
    pub live: LiveArgs,
}

/// What every command takes that moves specimens into a run folder.
#[derive(Debug, Args)]
pub(super) struct TestRunArgs {
    /// Run folder; must not exist yet [default: runs/<title>-<start time>].
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Overrides the clock of the test file.
    #[arg(long, value_enum)]
    pub clock: Option<ClockArg>,
    /// Overrides any key by its dotted path, each once, e.g. --set integrator.lambda=4 --set specimen.0.storey=2.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Confirm what the sensors read before the test, unseen. A hold is not ended by it.
    #[arg(long)]
    pub yes: bool,
}

impl TestRunArgs {
    /// The test file with everything that overrides it.
    pub fn load(&self, test: &Path) -> anyhow::Result<Loaded> {
        let mut sets = self.sets.clone();
        if let Some(clock) = self.clock {
            let clock = match clock {
                ClockArg::Real => "real",
                ClockArg::Simulated => "simulated",
            };
            sets.push(format!("time.clock=\"{clock}\""));
        }
        load(test, &sets)
    }
}

/// What a terminal shows while a test runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum StatusArg {
    /// One line: phase, time, misses, the axis that is closest to a limit.
    Line,
    /// Some lines: every axis against its limits, lateness, the room of lambda.
    Full,
    /// Nothing.
    Off,
}

#[cfg(feature = "monitor")]
#[derive(Debug, Args)]
pub(super) struct LiveArgs {
    /// Serve a page that shows the running test, and metrics for Prometheus under /metrics: on this machine alone, or at
    /// ADDR, where looking needs a token [default ADDR: 127.0.0.1:4824]. Operating needs the token that is printed at start.
    #[arg(
        long,
        value_name = "ADDR",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1:4824",
        value_parser = crate::monitor::page::parse_address,
    )]
    pub live: Option<String>,
    /// For --live: the token for looking, in place of a fresh one for every test: one line of 16 letters or more, in a
    /// file that not all users of the machine can read.
    #[arg(long, value_name = "FILE", requires = "live")]
    pub live_token: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum ClockArg {
    /// Hard real time.
    Real,
    /// As fast as it goes; same numbers.
    Simulated,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset check config/frame-bouc-wen.toml\n  \
    gusset check config/frame-bouc-wen.toml --plot curves")]
pub(super) struct CheckArgs {
    /// The test file.
    pub test: PathBuf,
    /// Overrides any key by its dotted path.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Write the curves of period error, damping error and growth over delay here (SVG, CSV); must not exist yet.
    #[arg(long, value_name = "DIR")]
    pub plot: Option<PathBuf>,
    /// Do not rehearse the test on the simulated clock: what it needs of each axis is then neither shown nor compared with
    /// the limits and the capacity of the rig.
    #[arg(long)]
    pub no_rehearsal: bool,
    /// Certify the test: rehearse it many times over what is uncertain, and say go (exit 0) or no-go (exit 1) with reasons.
    #[arg(long, conflicts_with = "no_rehearsal")]
    pub rehearse: bool,
    /// Rehearsals of the certificate [default: as the file says, else 200].
    #[arg(long, value_name = "N", requires = "rehearse", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub trials: Option<u64>,
    /// Seed of their draws [default: as the file says, else 1].
    #[arg(long, value_name = "S", requires = "rehearse")]
    pub seed: Option<u64>,
    /// Show everything that is known: modes, delays, all limits, and what a trip does.
    #[arg(long)]
    pub verbose: bool,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset verify --quick\n  gusset verify example-4.2 --out verification\n\n\
    Exits with 1 if anything is not as published."
)]
pub(super) struct VerifyArgs {
    /// Topics, as --list names them [default: all].
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// List the topics.
    #[arg(long)]
    pub list: bool,
    /// Fewer random systems and smaller models: a few seconds.
    #[arg(long)]
    pub quick: bool,
    /// Write index.html, every figure as SVG and its data as CSV here; must not exist yet.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print everything as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
