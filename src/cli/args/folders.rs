//! Arguments of the commands that read a run folder or control a running test.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset replay runs/first\n\nExits with 1 if a number differs, if the record has a gap, or if summary.json \
                  contradicts the replay.\n\nMore: gusset guide operation"
)]
pub(in crate::cli) struct ReplayArgs {
    /// Run folder, finished or not.
    pub run: PathBuf,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct OperateArgs {
    /// Run folder of the test.
    pub run: PathBuf,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset serve config/serve/gateway.toml --out runs/gateway\n  gusset reset runs/gateway\n  \
    gusset reset test.toml\n\n\
    After a trip, or a motion without a regular end, every test is refused until this command. Inspect the specimen first.\n\n\
    More: gusset guide specimen-record"
)]
pub(in crate::cli) struct ResetArgs {
    /// Where the server listens for this command: its --control, the folder of its --out, or its file. Without a server: the file
    /// of the specimens, or a run folder.
    pub control: PathBuf,
    /// Confirm without a question that the next test may begin where the specimen stands.
    #[arg(long)]
    pub yes: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset export runs/first --out first.csv\n  \
    gusset export runs/first --with storey-drift,storey-shear --out storeys.csv\n  \
    gusset export runs/first --format mat --out first.mat\n  \
    gusset export runs/first --format npz --rate tick --out first.npz\n  \
    gusset export runs/first --format trace --from 2 --to 2.5 --out first.json\n\n\
    More: gusset guide reading-data (pandas, NumPy, MATLAB, Octave, Julia, R, Foxglove)"
)]
pub(in crate::cli) struct ExportArgs {
    /// Run folder, finished or not.
    pub run: PathBuf,
    /// Format of the file.
    #[arg(long, value_enum, default_value_t = FormatArg::Csv)]
    pub format: FormatArg,
    /// File to write (designsafe: folder). It must not exist yet.
    #[arg(long)]
    pub out: PathBuf,
    /// Which rows. A trace always has every tick.
    #[arg(long, value_enum, default_value_t = RateArg::Step)]
    pub rate: RateArg,
    /// First test time, in seconds.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub from: Option<f64>,
    /// Last test time, in seconds.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// Additional computed columns, separated by commas. A trace has none.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT")]
    pub with: Vec<DerivedArg>,
    /// Omit the second line of a CSV file, a comment with the units: `# units: time s,x1 m,…`.
    #[arg(long)]
    pub no_units_line: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum DerivedArg {
    /// `abs_a<dof>`: absolute acceleration of each DOF.
    AbsoluteAcceleration,
    /// `drift<storey>`: displacement of each floor relative to the floor below.
    StoreyDrift,
    /// `shear<storey>`: shear force of each storey, from the inertia of the floors above.
    StoreyShear,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum FormatArg {
    /// Comma-separated values with 17 significant digits. The first two lines are names and units.
    Csv,
    /// NumPy archive, one array per column.
    Npz,
    /// MATLAB file, also for Octave, SciPy and R, one vector per column: level 5 up to 2 GB, else 7.3.
    Mat,
    /// MATLAB 7.3 file of any size, for MATLAB, Octave and h5py.
    Mat73,
    /// HDF5 file, one dataset per column.
    Hdf5,
    /// Apache Parquet file, compressed, with units in its metadata, for pandas, Polars, DuckDB and R.
    Parquet,
    /// MCAP file for Foxglove and PlotJuggler: one channel for each group of columns, and the events.
    Mcap,
    /// Timeline of the real-time loop for ui.perfetto.dev or chrome://tracing.
    Trace,
    /// Folder for a DesignSafe hybrid-simulation project.
    #[value(name = "designsafe")]
    DesignSafe,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum RateArg {
    /// The last tick of each step.
    Step,
    /// All ticks.
    Tick,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset report runs/first\n  gusset report runs/rehearsal runs/test --out comparison.html\n\n\
                  Exits with 1 if rows or events contradict summary.json. The page is written in any case.\n\n\
                  More: gusset guide run-folder"
)]
pub(in crate::cli) struct ReportArgs {
    /// Run folder, finished or not.
    pub run: PathBuf,
    /// Further runs, at most five, each compared with the first. Runs with equal steps are compared row by row.
    #[arg(num_args = 0..=5)]
    pub against: Vec<PathBuf>,
    /// File of the comparison; an older page is replaced [default: FIRST-against-SECOND.html in the current folder].
    #[arg(long, value_name = "FILE", requires = "against")]
    pub out: Option<PathBuf>,
    /// Also draw one wide picture of the run (SVG) into this file. It must not exist yet.
    #[arg(long, value_name = "FILE", conflicts_with = "against")]
    pub picture: Option<PathBuf>,
}
