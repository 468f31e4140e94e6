//! What commands take that look at the machine itself.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset jitter --rate 4096 --duration 60 --load --out jitter-4096\n  \
    gusset jitter --model chain"
)]
pub(in crate::cli) struct JitterArgs {
    /// Ticks per second: an integer, a decimal or a fraction "a/b".
    #[arg(
        long,
        default_value = "1000",
        value_name = "HZ",
        allow_negative_numbers = true,
        conflicts_with = "model"
    )]
    pub rate: String,
    /// How long to measure.
    #[arg(
        long,
        default_value_t = 10.0,
        value_name = "S",
        allow_negative_numbers = true,
        conflicts_with = "model"
    )]
    pub duration: f64,
    /// Find the largest model that keeps 99.99 % of its deadlines, at each of --rates.
    #[arg(long, value_enum)]
    pub model: Option<ModelArg>,
    /// For --model: ticks per second, separated by commas [default: 256,512,1024,2048,4096].
    #[arg(long, value_delimiter = ',', value_name = "HZ", requires = "model")]
    pub rates: Vec<String>,
    /// For --model: prove each size with 1000 ticks instead of 10 000.
    #[arg(long, requires = "model")]
    pub quick: bool,
    /// Core of the loop [default: the last one].
    #[arg(long)]
    pub cpu: Option<usize>,
    /// FIFO priority of the loop.
    #[arg(long, default_value_t = 90)]
    pub priority: u8,
    /// Put a memory- and cpu-hungry load on another core.
    #[arg(long, conflicts_with = "model")]
    pub load: bool,
    /// Write .hgrm files, timing.json and a picture here [default: nothing is kept]; with --model frontier.svg and frontier.csv
    /// [default: runs/frontier-MODEL-TIME]; must not exist yet.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// What `gusset jitter --model` makes larger and larger.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum ModelArg {
    /// Example 4.3 of Gui et al. 2014.
    Chain,
    /// A plane frame with yielding braces.
    Frame,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset doctor")]
pub(in crate::cli) struct DoctorArgs {
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
