//! Arguments of `gusset run`, and those of every command that moves specimens.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use crate::cli::test_file::load;
use gusset_config::Loaded;
use gusset_quantity::text::is_reason;

/// A reason in words.
fn reason(text: &str) -> Result<String, String> {
    if is_reason(text) {
        Ok(text.trim().to_owned())
    } else {
        Err("a reason needs at least one letter: say why the test may continue".to_owned())
    }
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset run config/frame-bouc-wen.toml --out runs/first\n  \
    gusset run config/frame-bouc-wen.toml --clock simulated --set integrator.lambda=4\n  \
    gusset run config/frame-bouc-wen.toml --live\n  \
    gusset run --resume runs/first --out runs/second\n  \
    gusset run --resume runs/first --out runs/second --after-trip\n  \
    gusset run --resume runs/first --set specimen.0.limits.force_step_n.trip=2e3 --reason yielded\n\n\
    More: gusset guide operation (hold, stop, resume), gusset guide limits (endings and exit codes)"
)]
pub(in crate::cli) struct RunArgs {
    /// The test file.
    #[arg(required_unless_present = "resume")]
    pub test: Option<PathBuf>,
    /// Resume an interrupted test at the end of its record, in a new run folder. Gusset refuses if a file or a specimen has
    /// changed. `--set` may widen limits, with a `--reason`.
    #[arg(long, value_name = "RUN_DIR", conflicts_with = "clock")]
    pub resume: Option<PathBuf>,
    /// With --resume: the test may resume although it tripped. Inspect its specimens first; without this flag, the refusal lists
    /// what tripped.
    #[arg(long, requires = "resume")]
    pub after_trip: bool,
    /// With --resume: the test may go on although a specimen has changed, for this reason. Summary and report keep it.
    #[arg(long, value_name = "REASON", requires = "resume", value_parser = reason)]
    pub accept_changed: Option<String>,
    /// With --resume and --set: why limits are widened. Summary and report keep it.
    #[arg(long, value_name = "REASON", requires_all = ["resume", "sets"], value_parser = reason)]
    pub reason: Option<String>,
    #[command(flatten)]
    pub test_run: TestRunArgs,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    pub json: bool,
    /// Print neither progress nor the closing summary.
    #[arg(long)]
    pub quiet: bool,
    /// Status on the terminal during the test.
    #[arg(long, value_enum, default_value_t = StatusArg::Line, conflicts_with = "quiet")]
    pub status: StatusArg,
    #[cfg(feature = "monitor")]
    #[command(flatten)]
    pub live: LiveArgs,
}

/// Arguments of every command that runs a test into a run folder.
#[derive(Debug, Args)]
pub(in crate::cli) struct TestRunArgs {
    /// Run folder: a new or an empty one [default: runs/<title>-<start time>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Clock, instead of the one in the test file.
    #[arg(long, value_enum)]
    pub clock: Option<ClockArg>,
    /// Override a key by its dotted path, for example --set integrator.lambda=4 --set specimen.0.storey=2.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Confirm the sensor readings before the test without showing them first. This does not end a hold.
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

/// Status on the terminal during a test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum StatusArg {
    /// One line: phase, time, deadline misses, and the axis closest to a limit.
    Line,
    /// Several lines: every axis with its limits, lateness, and the stability margin.
    Full,
    /// No status.
    Off,
}

#[cfg(feature = "monitor")]
#[derive(Debug, Args)]
pub(in crate::cli) struct LiveArgs {
    /// Serve a live page of the test, and metrics for Prometheus under /metrics [default ADDR: 127.0.0.1:4824]. At another
    /// ADDR a reader needs a token; operating the test always needs the printed token.
    #[arg(
        long,
        value_name = "ADDR",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1:4824",
        value_parser = gusset_view::live::page::parse_address,
    )]
    pub live: Option<String>,
    /// For --live: file with the token for readers, one line of at least 16 characters. Other users must not be able to
    /// read the file.
    #[arg(long, value_name = "FILE", requires = "live")]
    pub live_token: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum ClockArg {
    /// Real time, required for a real specimen.
    Real,
    /// As fast as possible, with the same numbers.
    Simulated,
}
