//! Arguments of `gusset campaign`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use gusset_session::campaign::Chunks;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset campaign run config/campaigns/ida-frame.toml --out ida\n  \
    gusset campaign status ida\n\nMore: gusset guide campaigns"
)]
pub(in crate::cli) struct CampaignArgs {
    #[command(subcommand)]
    pub command: CampaignCommand,
}

#[derive(Debug, Subcommand)]
pub(in crate::cli) enum CampaignCommand {
    /// Expand a study into tasks and write a campaign folder. At most three tasks are timed.
    Plan(PlanArgs),
    /// Run a study or a campaign folder on this machine, and collect the results. Tasks that are done are not repeated.
    Run(RunCampaignArgs),
    /// Submit all chunks with missing tasks to Slurm or HyperQueue, or write their commands for another launcher.
    Submit(SubmitArgs),
    /// Compute chunks of tasks. Every machine that shares the campaign folder can compute chunks.
    Work(WorkArgs),
    /// Merge the results into a table, a summary and a report.
    Collect(CollectArgs),
    /// Show how many tasks are done.
    Status(FolderArgs),
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset campaign plan config/campaigns/ida-frame.toml --out ida\n\n\
    More: gusset guide campaigns"
)]
pub(in crate::cli) struct PlanArgs {
    /// The study file.
    pub study: PathBuf,
    /// Write the campaign into this folder. The folder must be new or empty.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Tasks of one chunk [default: as many as take a minute on one core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub tasks_per_chunk: Option<u64>,
    /// Print the plan as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset campaign run config/campaigns/ida-frame.toml --out ida\n  \
    gusset campaign run ida --jobs 2\n\n\
    Ctrl-C stops after the current tests. The command with the folder continues there.\n\n\
    Exits with 1 if results are missing or different, or if a task has no valid test.\n\nMore: gusset guide campaigns"
)]
pub(in crate::cli) struct RunCampaignArgs {
    /// A study file or a campaign folder.
    #[arg(value_name = "STUDY|DIR")]
    pub study: PathBuf,
    /// For a study: write the campaign into this folder. The folder must be new or empty [default: campaigns/NAME].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Number of tests at the same time [default: number of processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    #[command(flatten)]
    pub results: ResultArgs,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset campaign submit ida --engine lines\n  \
    gusset campaign submit ida --engine slurm -- --time=00:30:00 --partition=normal\n  \
    gusset campaign submit ida --engine slurm --tasks-per-job 120\n  \
    gusset campaign submit ida --engine hyperqueue\n\n\
    All machines must see the campaign folder, the study and the program under the same paths.\n\
    Wait for the end of the jobs before you submit again: jobs that still run are submitted twice.\n\n\
    More: gusset guide campaigns"
)]
pub(in crate::cli) struct SubmitArgs {
    /// The campaign folder.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Launcher of the chunks.
    #[arg(long, value_enum)]
    pub engine: EngineArg,
    /// Tasks of one job, rounded up to whole chunks [default: one chunk, or more if an array job of Slurm would be too long].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub tasks_per_job: Option<u64>,
    /// Further arguments of `sbatch` or `hq job submit-file`, behind `--`.
    #[arg(last = true, value_name = "ARGUMENT")]
    pub arguments: Vec<String>,
}

/// Launcher of the chunks of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum EngineArg {
    /// A file with one command a line, for GNU parallel, PyLauncher and others.
    Lines,
    /// An array job of Slurm.
    Slurm,
    /// A job of HyperQueue.
    Hyperqueue,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset campaign work ida --chunk 1\n  gusset campaign work ida --chunk 2-4,7 --jobs 2\n\n\
    More: gusset guide campaigns"
)]
pub(in crate::cli) struct WorkArgs {
    /// The campaign folder.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Numbers of the chunks, from 1: K, K-L or a list such as 1-4,7.
    #[arg(long, value_name = "K")]
    pub chunk: Chunks,
    /// Number of tests at the same time.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: u16,
}

/// Arguments of the commands that collect results.
#[derive(Debug, Args)]
pub(in crate::cli) struct ResultArgs {
    /// Tasks that are computed again to prove the results: a number, or a share such as 1%.
    #[arg(long, value_name = "N|P%", default_value = "20")]
    pub prove: String,
    /// Seed of the choice of these tasks, to repeat a proof [default: a new random number].
    #[arg(long, value_name = "N")]
    pub prove_seed: Option<u64>,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset campaign collect ida --prove 1%\n\n\
    Exits with 1 if results are missing or different, or if a task has no valid test. The tables of an incomplete campaign are table.partial.csv and \
    table.partial.parquet.\n\n\
    More: gusset guide campaigns")]
pub(in crate::cli) struct CollectArgs {
    /// The campaign folder.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    #[command(flatten)]
    pub results: ResultArgs,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset campaign status ida\n\nExits with 1 if tasks are missing.\n\nMore: gusset guide campaigns"
)]
pub(in crate::cli) struct FolderArgs {
    /// The campaign folder.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Print the status as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
