//! The command line: every command with its arguments.
//!
//! The texts here are `--help`, the completions of the shells and the man pages. One or two plain sentences each; details
//! belong into the guide, which each command names at its end.

#![allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "clap prints these comments, with names of tables in brackets and of values in angle brackets"
)]

#[cfg(feature = "ethercat")]
mod bus;
mod campaign;
mod check;
mod files;
mod folders;
mod guide;
mod identify;
mod import;
mod machine;
mod run;
mod serve;

use clap::{Parser, Subcommand, ValueEnum};
use tracing::level_filters::LevelFilter;

#[cfg(feature = "ethercat")]
pub(super) use bus::{BusCommand, BusResetArgs, ScanArgs, SimulateArgs};
pub(super) use campaign::{
    CampaignArgs, CampaignCommand, CollectArgs, EngineArg, FolderArgs, PlanArgs, ResultArgs,
    RunCampaignArgs, SubmitArgs, WorkArgs,
};
pub(super) use check::{CheckArgs, VerifyArgs};
pub(super) use files::{
    CompletionsArgs, ListArgs, ManArgs, NewArgs, SchemaArgs, ShellArg, TemplateArg,
};
pub(super) use folders::{
    DerivedArg, ExportArgs, FormatArg, OperateArgs, RateArg, ReplayArgs, ReportArgs, ResetArgs,
};
pub(super) use guide::GuideArgs;
pub(super) use identify::IdentifyArgs;
pub(super) use import::ImportArgs;
pub(super) use machine::{DoctorArgs, JitterArgs, ModelArg};
pub(super) use run::{RunArgs, StatusArg, TestRunArgs};
pub(super) use serve::{ProtocolArg, ServeArgs, SignalOrderArg, TlsArgs, TransportArg};

use super::benchmark;

/// Real-time hybrid simulation: couples a computed structure to a measured specimen.
#[derive(Debug, Parser)]
#[command(
    name = "gusset",
    bin_name = "gusset",
    version,
    about,
    max_term_width = 100,
    after_help = "Examples:\n  gusset new first\n  gusset check first.toml\n  gusset run first.toml --out runs/first\n  \
                  gusset --log info run first.toml --out runs/second\n\n\
                  More: gusset guide first-test"
)]
pub(super) struct Cli {
    /// Least severe messages to log on stderr. The default is that of the environment variable GUSSET_LOG, or else `warn`.
    #[arg(
        long,
        global = true,
        value_enum,
        ignore_case = true,
        value_name = "LEVEL"
    )]
    pub log: Option<LogArg>,
    #[command(subcommand)]
    pub command: Command,
}

/// Severity of a message of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum LogArg {
    /// No messages.
    Off,
    /// Errors only.
    Error,
    /// Warnings too.
    Warn,
    /// Events of a normal test too.
    Info,
    /// Messages for developers too.
    Debug,
    /// All messages.
    Trace,
}

impl From<LogArg> for LevelFilter {
    fn from(log: LogArg) -> Self {
        match log {
            LogArg::Off => LevelFilter::OFF,
            LogArg::Error => LevelFilter::ERROR,
            LogArg::Warn => LevelFilter::WARN,
            LogArg::Info => LevelFilter::INFO,
            LogArg::Debug => LevelFilter::DEBUG,
            LogArg::Trace => LevelFilter::TRACE,
        }
    }
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Write a commented test file that runs unchanged.
    New(NewArgs),
    /// Write a test file from the model of another program.
    Import(ImportArgs),
    /// Check and rehearse a test. Nothing moves.
    Check(CheckArgs),
    /// Run one hybrid test.
    Run(RunArgs),
    /// Stop a running test. Its specimens then rest as `safety.at_end` says.
    #[command(after_help = "Example:\n  gusset stop runs/first\n\nMore: gusset guide operation")]
    Stop(OperateArgs),
    /// Hold a running test: test time stops, and the specimens stay in place.
    #[command(after_help = "Example:\n  gusset hold runs/first\n\nMore: gusset guide operation")]
    Hold(OperateArgs),
    /// Continue a held test, or confirm the readings that a test shows before it moves.
    #[command(
        after_help = "Example:\n  gusset continue runs/first\n\nMore: gusset guide operation"
    )]
    Continue(OperateArgs),
    /// List the runs below a folder, newest first.
    List(ListArgs),
    /// Write the report of a run again, or compare two runs.
    Report(ReportArgs),
    /// Export the response history of a run for other programs.
    Export(ExportArgs),
    /// Repeat a recorded test from its measurements and prove that every number is equal.
    Replay(ReplayArgs),
    /// Identify a specimen and its actuator with a small motion.
    Identify(IdentifyArgs),
    /// Serve a specimen to controllers on a network, until Ctrl-C.
    Serve(ServeArgs),
    /// Clear the latched trip of a specimen, and confirm where it stands.
    Reset(ResetArgs),
    /// Scan, simulate or reset the devices of an EtherCAT bus.
    #[cfg(feature = "ethercat")]
    #[command(subcommand, after_help = "More: gusset guide ethercat")]
    Bus(BusCommand),
    /// Report what this machine has and lacks for real-time tests.
    Doctor(DoctorArgs),
    /// Measure the timing of the real-time loop on this machine, without a specimen.
    Jitter(JitterArgs),
    /// Reproduce the published results of the integration methods and compare them.
    Verify(VerifyArgs),
    /// Run a published benchmark of hybrid simulation.
    #[command(subcommand)]
    Benchmark(benchmark::Of),
    /// Run many simulated tests of one study, on this machine or on many.
    Campaign(CampaignArgs),
    /// Show the guide: the contents, a page, or a configuration key.
    Guide(GuideArgs),
    /// Print the JSON Schema of the test file, for editors.
    Schema(SchemaArgs),
    /// Print the completions of a shell.
    Completions(CompletionsArgs),
    /// Write the man pages.
    Man(ManArgs),
}
