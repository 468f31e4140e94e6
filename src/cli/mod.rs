//! The commands. Only this module prints; what a command does is the library's business.
//!
//! One JSON document goes to stdout with `--json`, everything else to stderr; progress goes to stderr and only to
//! a terminal.

#![allow(
    clippy::disallowed_macros,
    reason = "the command line is where text leaves"
)]

mod check;
mod doctor;
mod exit;
mod export;
mod jitter;
mod progress;
mod report;
mod run;
mod schema;
mod spectrum;
mod table;
mod verify;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};

pub use exit::Exit;

/// Real-time hybrid simulation: joins a structure that is computed to a specimen that is measured.
#[derive(Debug, Parser)]
#[command(name = "gusset", version, about, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run one hybrid test.
    Run(RunArgs),
    /// Read a test without moving anything: is it valid, what will it do, is λ stable?
    Check(CheckArgs),
    /// Measure the loop's own timing on this machine, with nothing attached.
    Jitter(JitterArgs),
    /// Say what this machine gives and lacks for real-time work, and what to do about it.
    Doctor(DoctorArgs),
    /// Write a run's whole response history in a form that other programs read.
    Export(ExportArgs),
    /// Write a run's report.html again.
    Report(ReportArgs),
    /// Obtain the published tables, equations, figures and examples of the integration family anew, and judge them.
    Verify(VerifyArgs),
    /// Print the JSON Schema of the test file.
    Schema,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset run config/frame-bouc-wen.toml --out runs/first\n  \
    gusset run config/frame-bouc-wen.toml --clock simulated --set integrator.lambda=4"
)]
struct RunArgs {
    /// The test file.
    test: PathBuf,
    /// Run folder; must not exist yet [default: runs/<title>-<start time>].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Overrides the clock of the test file.
    #[arg(long, value_enum)]
    clock: Option<ClockArg>,
    /// Overrides any key by its dotted path, e.g. --set integrator.lambda=4 --set specimen.0.storey=2.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Do not print the progress line and the closing summary.
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ClockArg {
    /// Hard real time.
    Real,
    /// As fast as it goes; same numbers.
    Simulated,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset check config/frame-bouc-wen.toml\n  \
    gusset check config/frame-bouc-wen.toml --plot curves")]
struct CheckArgs {
    /// The test file.
    test: PathBuf,
    /// Overrides any key by its dotted path.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Write the curves of period error, damping error and growth over delay here (SVG, CSV); must not exist yet.
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset jitter --rate 4096 --duration 60 --load --out jitter-4096"
)]
struct JitterArgs {
    /// Ticks per second: an integer, a decimal or a fraction "a/b".
    #[arg(long, default_value = "1000", value_name = "HZ")]
    rate: String,
    /// How long to measure.
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    duration: f64,
    /// Core of the loop [default: the last one].
    #[arg(long)]
    cpu: Option<usize>,
    /// FIFO priority of the loop.
    #[arg(long, default_value_t = 90)]
    priority: u8,
    /// Put a memory- and cpu-hungry load on another core.
    #[arg(long)]
    load: bool,
    /// Write .hgrm files, timing.json and a picture here; must not exist yet.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset doctor")]
struct DoctorArgs {
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset export runs/first --format csv --out first.csv")]
struct ExportArgs {
    /// The run folder, finished or not.
    run: PathBuf,
    /// File format.
    #[arg(long, value_enum, default_value_t = FormatArg::Csv)]
    format: FormatArg,
    /// The file to write; must not exist yet.
    #[arg(long)]
    out: PathBuf,
    /// One row per step, or every tick.
    #[arg(long, value_enum, default_value_t = RateArg::Step)]
    rate: RateArg,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FormatArg {
    /// Comma-separated values, 17 significant digits.
    Csv,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum RateArg {
    /// The last tick of each step.
    Step,
    /// All ticks.
    Tick,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset report runs/first")]
struct ReportArgs {
    /// The run folder, finished or not.
    run: PathBuf,
    /// Also draw one wide picture of the run (SVG) here; must not exist yet.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset verify --quick\n  gusset verify example-4.2 --out verification\n\n\
    Exits with 1 if anything is not as published."
)]
struct VerifyArgs {
    /// Topics, as --list names them [default: all].
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    /// List the topics.
    #[arg(long)]
    list: bool,
    /// Fewer random systems and smaller models: seconds in place of minutes.
    #[arg(long)]
    quick: bool,
    /// Write index.html, every figure as SVG and its data as CSV here; must not exist yet.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print everything as JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// Runs the command line and returns the exit code of contracts: 0 done, 1 stopped, 2 wrong usage, 3 link, 4 no real
/// time, 5 our own fault, 130 and 143 interrupted.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Check(args) => check::check(&args),
        Command::Jitter(args) => jitter::jitter(&args),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Export(args) => export::export(&args),
        Command::Report(args) => report::report(&args),
        Command::Verify(args) => verify::verify(&args),
        Command::Schema => schema::schema(),
    };
    match result {
        Ok(exit) => exit.into(),
        Err(error) => {
            eprintln!("error: {error:#}");
            exit::of(&error).into()
        }
    }
}
