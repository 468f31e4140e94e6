//! What commands take that read the folder of a run, or speak to a running one.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset replay runs/first\n\nExits with 1 if a number differs, the recording has a gap, or summary.json \
                  has another status, reason, number of steps or peak than the loop comes to."
)]
pub(in crate::cli) struct ReplayArgs {
    /// The run folder, finished or not.
    pub run: PathBuf,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct OperateArgs {
    /// The run folder of the test.
    pub run: PathBuf,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset serve config/serve/gateway.toml --out runs/gateway\n  gusset reset runs/gateway\n\n\
    A trip of a served specimen that moves refuses every further test until this command, also after a new start of the server. \
    Look at the specimen first."
)]
pub(in crate::cli) struct ResetArgs {
    /// Where the server is controlled: its --control, the folder of its --out, or FILE.control.sock beside its file.
    pub control: PathBuf,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset export runs/first --format csv --out first.csv                        pandas.read_csv('first.csv', comment='#')\n  \
    gusset export runs/first --with storey-drift,storey-shear --out storeys.csv\n  \
    gusset export runs/first --format mat --out first.mat                        load('first.mat')\n  \
    gusset export runs/first --format npz --rate tick --out first.npz            numpy.load('first.npz')\n  \
    gusset export runs/first --format trace --from 2 --to 2.5 --out first.json   opens in ui.perfetto.dev"
)]
pub(in crate::cli) struct ExportArgs {
    /// The run folder, finished or not.
    pub run: PathBuf,
    /// In which form.
    #[arg(long, value_enum, default_value_t = FormatArg::Csv)]
    pub format: FormatArg,
    /// The file to write (designsafe: the folder); must not exist yet.
    #[arg(long)]
    pub out: PathBuf,
    /// One row per step, or every tick. A trace has every tick.
    #[arg(long, value_enum, default_value_t = RateArg::Step)]
    pub rate: RateArg,
    /// Only from this test time on, in seconds.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub from: Option<f64>,
    /// Only up to this test time, in seconds.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// Further columns, computed from the recorded ones; several are separated by commas. A trace has none.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT")]
    pub with: Vec<DerivedArg>,
    /// Leave out the second line of a CSV, a comment with the units: `# units: time s,x1 m,…`.
    #[arg(long)]
    pub no_units_line: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum DerivedArg {
    /// `abs_a<dof>`: acceleration of each DOF against a point that rests.
    AbsoluteAcceleration,
    /// `drift<storey>`: displacement of each floor against the floor below.
    StoreyDrift,
    /// `shear<storey>`: force that each storey passes on, from the inertia of the floors above.
    StoreyShear,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum FormatArg {
    /// Comma-separated values, 17 significant digits, names and units in the first two lines; bit 262144 of `status_1` marks rows without a measurement of specimen 1.
    Csv,
    /// NumPy archive, one array per column.
    Npz,
    /// MATLAB 7.3 file (also h5py; Octave, where texts are codes: `char(summary)`), one vector per column.
    Mat,
    /// HDF5 file, one dataset per column.
    Hdf5,
    /// Timeline of the loop for ui.perfetto.dev or chrome://tracing.
    Trace,
    /// Folder in the shape of a DesignSafe hybrid-simulation project.
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
    after_help = "Example:\n  gusset report runs/first\n  gusset report runs/rehearsal runs/test --out comparison.html\n\n\
                  Exits with 1 if the rows or events contradict summary.json, or if the run names itself as an ancestor; the page is written all the same."
)]
pub(in crate::cli) struct ReportArgs {
    /// The run folder, finished or not.
    pub run: PathBuf,
    /// A second run: compare the two, row by row where their steps are of one length.
    pub against: Option<PathBuf>,
    /// Where the comparison goes, replacing what is there [default: FIRST-against-SECOND.html in the working directory].
    #[arg(long, value_name = "FILE", requires = "against")]
    pub out: Option<PathBuf>,
    /// Also draw one wide picture of the run (SVG) here; must not exist yet.
    #[arg(long, value_name = "FILE", conflicts_with = "against")]
    pub picture: Option<PathBuf>,
}
