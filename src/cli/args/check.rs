//! Arguments of `gusset check` and `gusset verify`.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset check config/frame-bouc-wen.toml\n  \
    gusset check config/frame-bouc-wen.toml --plot curves\n  \
    gusset check config/vrths-case-1.toml --rehearse --trials 50\n\n\
    Exits with 1 if a finding forbids the test.\n\n\
    More: gusset guide first-test, gusset guide real-specimen (certificate)"
)]
pub(in crate::cli) struct CheckArgs {
    /// The test file, or a file for `gusset serve`.
    pub test: PathBuf,
    /// For a file for `gusset serve`: which specimen of the file. Required if the file has several.
    #[arg(long, value_name = "NAME")]
    pub specimen: Option<String>,
    /// Override a key by its dotted path, for example --set integrator.lambda=4.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Write curves of period error, damping error and growth over delay into this folder (SVG, CSV). The folder must be new or
    /// empty.
    #[arg(long, value_name = "DIR")]
    pub plot: Option<PathBuf>,
    /// Skip the rehearsal. The needs of each axis are then neither shown nor compared with its limits.
    #[arg(long)]
    pub no_rehearsal: bool,
    /// Certify the test: rehearse it many times with its uncertainties. Exits with 0 for go and 1 for no-go.
    #[arg(long, conflicts_with = "no_rehearsal")]
    pub rehearse: bool,
    /// For --rehearse: number of rehearsals [default: as in the file, else 200].
    #[arg(long, value_name = "N", requires = "rehearse", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub trials: Option<u64>,
    /// For --rehearse: seed of the random numbers [default: as in the file, else 1].
    #[arg(long, value_name = "S", requires = "rehearse")]
    pub seed: Option<u64>,
    /// Show everything: modes, delays, all limits, and what a trip does.
    #[arg(long)]
    pub verbose: bool,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset verify --quick\n  gusset verify example-4.2 --out verification\n\n\
    Exits with 1 if any value differs from the published one.\n\nMore: gusset guide mathematics-integrator"
)]
pub(in crate::cli) struct VerifyArgs {
    /// Topics; --list shows their names [default: all].
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    /// List the topics.
    #[arg(long)]
    pub list: bool,
    /// Use fewer random systems and smaller models. This takes a few seconds.
    #[arg(long)]
    pub quick: bool,
    /// Write index.html, each figure as SVG and its data as CSV into this folder. The folder must be new or empty.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the results as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
