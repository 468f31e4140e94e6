//! What the command line takes.

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};

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
    /// Let a test that holds go on, or confirm what its sensors read.
    #[command(after_help = "Example:\n  gusset continue runs/first")]
    Continue(OperateArgs),
    /// Feed a recorded test through the loop again and prove that every number comes out bit for bit the same.
    Replay(ReplayArgs),
    /// Host a specimen for controllers that command it over a network, until told to stop.
    Serve(ServeArgs),
    /// Obtain the published tables, equations, figures and examples of the integration family anew, and judge them.
    Verify(VerifyArgs),
    /// Run a published benchmark of hybrid simulation.
    #[command(subcommand)]
    Benchmark(benchmark::Of),
    /// Print the JSON Schema of the test file.
    #[command(
        after_help = "Example:\n  gusset schema > gusset.schema.json\n\nAn editor with a TOML language server completes \
                      and checks a test file that begins with the line\n  #:schema ./gusset.schema.json"
    )]
    Schema,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset run config/frame-bouc-wen.toml --out runs/first\n  \
    gusset run config/frame-bouc-wen.toml --clock simulated --set integrator.lambda=4\n  \
    gusset run config/frame-bouc-wen.toml --live\n  \
    gusset run --resume runs/first --out runs/second"
)]
pub(super) struct RunArgs {
    /// The test file.
    #[arg(required_unless_present = "resume")]
    pub test: Option<PathBuf>,
    /// Goes on with an interrupted test where its folder's record ends, into a folder of its own; refused if a specimen does
    /// not stand where it was left, or a file was changed.
    #[arg(long, value_name = "RUN_DIR", conflicts_with_all = ["sets", "clock"])]
    pub resume: Option<PathBuf>,
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
    /// Overrides any key by its dotted path, e.g. --set integrator.lambda=4 --set specimen.0.storey=2.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Confirm what the sensors read before the test, unseen.
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
    /// For --live: the token for looking, in place of a fresh one for every test: one line of 16 letters or more.
    #[arg(long, value_name = "FILE", requires = "live")]
    pub live_token: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset replay runs/first\n\nExits with 1 if a number differs or the recording has a gap."
)]
pub(super) struct ReplayArgs {
    /// The run folder, finished or not.
    pub run: PathBuf,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub(super) struct OperateArgs {
    /// The run folder of the test.
    pub run: PathBuf,
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
    /// the limits.
    #[arg(long)]
    pub no_rehearsal: bool,
    /// Certify the test: rehearse it many times over what is uncertain, and say go (exit 0) or no-go (exit 1) with reasons.
    #[arg(long, conflicts_with = "no_rehearsal")]
    pub rehearse: bool,
    /// Rehearsals of the certificate [default: as the file says, else 200].
    #[arg(long, value_name = "N", requires = "rehearse", value_parser = clap::value_parser!(u64).range(1..))]
    pub trials: Option<u64>,
    /// Seed of their draws [default: as the file says, else 1].
    #[arg(long, value_name = "S", requires = "rehearse")]
    pub seed: Option<u64>,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset jitter --rate 4096 --duration 60 --load --out jitter-4096\n  \
    gusset jitter --model chain"
)]
pub(super) struct JitterArgs {
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
    /// For --model: ticks per second, separated by commas.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "256,512,1024,2048,4096",
        value_name = "HZ",
        requires = "model"
    )]
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
    #[arg(long)]
    pub load: bool,
    /// Write .hgrm files, timing.json and a picture here; must not exist yet.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

/// What `gusset jitter --model` makes larger and larger.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum ModelArg {
    /// Example 4.3 of Gui et al. 2014.
    Chain,
    /// A plane frame with yielding braces.
    Frame,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  gusset doctor")]
pub(super) struct DoctorArgs {
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset export runs/first --format csv --out first.csv\n  \
    gusset export runs/first --format mat --out first.mat                        load('first.mat')\n  \
    gusset export runs/first --format npz --rate tick --out first.npz            numpy.load('first.npz')\n  \
    gusset export runs/first --format trace --from 2 --to 2.5 --out first.json   opens in ui.perfetto.dev"
)]
pub(super) struct ExportArgs {
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
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum FormatArg {
    /// Comma-separated values, 17 significant digits.
    Csv,
    /// NumPy archive, one array per column.
    Npz,
    /// MATLAB 7.3 file (also h5py, Octave), one vector per column.
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
pub(super) enum RateArg {
    /// The last tick of each step.
    Step,
    /// All ticks.
    Tick,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset report runs/first\n  gusset report runs/rehearsal runs/test --out comparison.html"
)]
pub(super) struct ReportArgs {
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

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset serve column.toml --listen 127.0.0.1:4823\n  \
    gusset serve test.toml --specimen ground-storey --transport udp --key lab.key --listen 0.0.0.0:4823\n  \
    gusset serve test.toml --specimen ground-storey --transport tls --listen 0.0.0.0:4823\n  \
    gusset serve test.toml --specimen ground-storey --protocol openfresco\n  \
    gusset serve config/serve/gateway.toml --out runs/gateway\n  \
    gusset serve config/faults/rig.toml --transport udp --fault config/faults/lost-burst.toml\n\n\
    A specimen that is itself behind a link ([specimen.link]) makes this a gateway: every exchange passes its limits \
    ([specimen.limits]). A limit that trips, or an interlock, holds the specimen where it is until the controller's test is \
    over; the next test begins anew."
)]
pub(super) struct ServeArgs {
    /// A file with [[specimen]] and [serve], or a test file.
    pub file: PathBuf,
    /// Where to listen; port 0 takes any free one [default: 127.0.0.1 and the usual port of the protocol: 4823, 8090,
    /// 8091, 44000].
    #[arg(long, value_name = "ADDR:PORT")]
    pub listen: Option<String>,
    /// What is spoken [default: gusset].
    #[arg(long, value_enum)]
    pub protocol: Option<ProtocolArg>,
    /// How the bytes travel [default: tcp].
    #[arg(long, value_enum)]
    pub transport: Option<TransportArg>,
    /// Which specimen of the file, if there are several.
    #[arg(long, value_name = "NAME")]
    pub specimen: Option<String>,
    /// The one machine that may command the specimen, for OpenFresco's protocols: they know no key, so beyond loopback
    /// it is required, unless --transport tls requires certificates.
    #[arg(long, value_name = "HOST")]
    pub client: Option<String>,
    /// Pre-shared key of our own protocol; beyond loopback it wants this or --transport tls.
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    #[command(flatten)]
    pub tls: TlsArgs,
    /// Record every controller's test in a run folder of its own below this one: test-0001, test-0002 and so on, with one
    /// row per exchange. `gusset report` and `gusset export` read them. Without it nothing is recorded.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Play the faults of this script on every controller's test, the same each time: a laboratory in which things go
    /// wrong. For a specimen that is computed; config/faults has scripts.
    #[arg(long, value_name = "SCRIPT")]
    pub fault: Option<PathBuf>,
    /// Busy loop around the moment at which the next command is expected, on either side of it.
    #[arg(long, value_name = "US", default_value_t = 60.0)]
    pub spin: f64,
    /// Print only the line that says where it listens.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub(super) struct TlsArgs {
    /// For --transport tls: our certificate, PEM [default: server.crt beside the file, else in the working directory].
    #[arg(long, value_name = "FILE")]
    pub tls_certificate: Option<PathBuf>,
    /// For --transport tls: the private key of our certificate, PEM [default: server.key, as above].
    #[arg(long, value_name = "FILE")]
    pub tls_key: Option<PathBuf>,
    /// For --transport tls: who may have signed a client's certificate, PEM [default: server_ca.crt, as above].
    #[arg(long, value_name = "FILE")]
    pub tls_ca: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum ProtocolArg {
    /// Our own: tools/PROTOCOL.md.
    Gusset,
    /// An element server for OpenSees genericClient and OpenFresco's experimental elements.
    Openfresco,
    /// The actor behind OpenFresco's ShadowSite.
    OpenfrescoActor,
    /// The laboratory controller behind OpenFresco's GenericTCP.
    OpenfrescoController,
    /// The model behind OpenFresco's SimSimulink.
    OpenfrescoSimulink,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum TransportArg {
    /// A TCP connection.
    Tcp,
    /// UDP datagrams.
    Udp,
    /// A TCP connection with TLS on it; tools/make-certificates makes the files.
    Tls,
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
    /// Fewer random systems and smaller models: seconds in place of minutes.
    #[arg(long)]
    pub quick: bool,
    /// Write index.html, every figure as SVG and its data as CSV here; must not exist yet.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print everything as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
