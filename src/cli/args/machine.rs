//! Arguments of `gusset jitter` and `gusset doctor`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset jitter --rate 4096 --duration 60 --load --out jitter-4096\n  \
    gusset jitter --model chain\n\nMore: gusset guide real-time"
)]
pub(in crate::cli) struct JitterArgs {
    /// Ticks per second: an integer, a decimal number or a fraction "a/b".
    #[arg(
        long,
        default_value = "1000",
        value_name = "HZ",
        allow_negative_numbers = true,
        conflicts_with = "model"
    )]
    pub rate: String,
    /// Duration of the measurement in seconds.
    #[arg(
        long,
        default_value_t = 10.0,
        value_name = "S",
        allow_negative_numbers = true,
        conflicts_with = "model"
    )]
    pub duration: f64,
    /// Find the largest model that meets 99.99 % of its deadlines, at each of --rates.
    #[arg(long, value_enum)]
    pub model: Option<ModelArg>,
    /// For --model: ticks per second, separated by commas [default: 256,512,1024,2048,4096].
    #[arg(long, value_delimiter = ',', value_name = "HZ", requires = "model")]
    pub rates: Vec<String>,
    /// For --model: test each size with 1000 ticks instead of 10 000.
    #[arg(long, requires = "model")]
    pub quick: bool,
    /// Processor core of the loop [default: the last one].
    #[arg(long)]
    pub cpu: Option<usize>,
    /// Real-time priority (SCHED_FIFO) of the loop, 1 to 98.
    #[arg(long, default_value_t = 90, value_parser = clap::value_parser!(u8).range(1..=98))]
    pub priority: u8,
    /// Load another core with computation and memory traffic meanwhile.
    #[arg(long, conflicts_with = "model")]
    pub load: bool,
    /// Folder for histograms (.hgrm), timing.json and a picture; with --model for frontier.svg and frontier.csv. The folder must be
    /// new or empty [default: none; with --model runs/frontier-MODEL-TIME].
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print the results as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Models of `gusset jitter --model`.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum ModelArg {
    /// Chain of masses: example 4.3 of Gui et al. 2014.
    Chain,
    /// Plane frame of yielding steel members.
    Frame,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset doctor\n\nMore: gusset guide real-time")]
pub(in crate::cli) struct DoctorArgs {
    /// Also examine this network interface, which is to carry an EtherCAT bus.
    #[arg(long, value_name = "NAME")]
    pub interface: Option<String>,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
