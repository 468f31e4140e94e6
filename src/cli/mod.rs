//! The commands. Only this module prints; what a command does is the library's business.
//!
//! One JSON document goes to stdout with `--json`, everything else to stderr; progress goes to stderr and only to
//! a terminal. Text leaves through [`tell`] and [`answer`] and never by the print macros, which panic when a terminal
//! has hung up or the disk under a log is full: that must not end a test.

mod attend;
mod benchmark;
mod check;
mod doctor;
mod exit;
mod export;
mod following;
mod frontier;
mod jitter;
mod limits;
mod operate;
mod progress;
mod rehearsed;
mod replay;
mod report;
mod run;
mod schema;
mod serve;
mod serve_openfresco;
mod serve_tls;
mod spectrum;
mod table;
mod verify;

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};

pub use exit::Exit;

use crate::config::Diagnostics;
use crate::session::Request;

/// Real-time hybrid simulation: joins a structure that is computed to a specimen that is measured.
#[derive(Debug, Parser)]
#[command(
    name = "gusset",
    version,
    about,
    max_term_width = 100,
    after_help = "Example:\n  gusset check config/frame-bouc-wen.toml\n  gusset run config/frame-bouc-wen.toml"
)]
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
    gusset run --resume runs/first --out runs/second"
)]
struct RunArgs {
    /// The test file.
    #[arg(required_unless_present = "resume")]
    test: Option<PathBuf>,
    /// Goes on with an interrupted test where its folder's record ends, into a folder of its own; refused if a specimen does
    /// not stand where it was left, or a file was changed.
    #[arg(long, value_name = "RUN_DIR", conflicts_with_all = ["sets", "clock"])]
    resume: Option<PathBuf>,
    /// Run folder; must not exist yet [default: runs/<title>-<start time>].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Overrides the clock of the test file.
    #[arg(long, value_enum)]
    clock: Option<ClockArg>,
    /// Overrides any key by its dotted path, e.g. --set integrator.lambda=4 --set specimen.0.storey=2.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    /// Confirm what the sensors read before the test, unseen.
    #[arg(long)]
    yes: bool,
    /// Print the summary as JSON on stdout.
    #[arg(long)]
    json: bool,
    /// Do not print the progress line and the closing summary.
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset replay runs/first\n\nExits with 1 if a number differs or the recording has a gap."
)]
struct ReplayArgs {
    /// The run folder, finished or not.
    run: PathBuf,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct OperateArgs {
    /// The run folder of the test.
    run: PathBuf,
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
    /// Do not rehearse the test on the simulated clock: what it needs of each axis is then neither shown nor compared with
    /// the limits.
    #[arg(long)]
    no_rehearsal: bool,
    /// Print the findings as JSON on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset jitter --rate 4096 --duration 60 --load --out jitter-4096\n  \
    gusset jitter --model chain"
)]
struct JitterArgs {
    /// Ticks per second: an integer, a decimal or a fraction "a/b".
    #[arg(
        long,
        default_value = "1000",
        value_name = "HZ",
        allow_negative_numbers = true,
        conflicts_with = "model"
    )]
    rate: String,
    /// How long to measure.
    #[arg(
        long,
        default_value_t = 10.0,
        value_name = "S",
        allow_negative_numbers = true,
        conflicts_with = "model"
    )]
    duration: f64,
    /// Find the largest model that keeps 99.99 % of its deadlines, at each of --rates.
    #[arg(long, value_enum)]
    model: Option<ModelArg>,
    /// For --model: ticks per second, separated by commas.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "256,512,1024,2048,4096",
        value_name = "HZ",
        requires = "model"
    )]
    rates: Vec<String>,
    /// For --model: prove each size with 1000 ticks instead of 10 000.
    #[arg(long, requires = "model")]
    quick: bool,
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

/// What `gusset jitter --model` makes larger and larger.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum ModelArg {
    /// Example 4.3 of Gui et al. 2014.
    Chain,
    /// A plane frame with yielding braces.
    Frame,
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
struct ServeArgs {
    /// A file with [[specimen]] and [serve], or a test file.
    file: PathBuf,
    /// Where to listen; port 0 takes any free one [default: 127.0.0.1 and the usual port of the protocol: 4823, 8090,
    /// 8091, 44000].
    #[arg(long, value_name = "ADDR:PORT")]
    listen: Option<String>,
    /// What is spoken [default: gusset].
    #[arg(long, value_enum)]
    protocol: Option<ProtocolArg>,
    /// How the bytes travel [default: tcp].
    #[arg(long, value_enum)]
    transport: Option<TransportArg>,
    /// Which specimen of the file, if there are several.
    #[arg(long, value_name = "NAME")]
    specimen: Option<String>,
    /// The one machine that may command the specimen, for OpenFresco's protocols: they know no key, so beyond loopback
    /// it is required, unless --transport tls requires certificates.
    #[arg(long, value_name = "HOST")]
    client: Option<String>,
    /// Pre-shared key of our own protocol; beyond loopback it wants this or --transport tls.
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    #[command(flatten)]
    tls: TlsArgs,
    /// Record every controller's test in a run folder of its own below this one: test-0001, test-0002 and so on, with one
    /// row per exchange. `gusset report` and `gusset export` read them. Without it nothing is recorded.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Play the faults of this script on every controller's test, the same each time: a laboratory in which things go
    /// wrong. For a specimen that is computed; config/faults has scripts.
    #[arg(long, value_name = "SCRIPT")]
    fault: Option<PathBuf>,
    /// Busy loop around the moment at which the next command is expected, on either side of it.
    #[arg(long, value_name = "US", default_value_t = 60.0)]
    spin: f64,
    /// Print only the line that says where it listens.
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct TlsArgs {
    /// For --transport tls: our certificate, PEM [default: server.crt beside the file, else in the working directory].
    #[arg(long, value_name = "FILE")]
    tls_certificate: Option<PathBuf>,
    /// For --transport tls: the private key of our certificate, PEM [default: server.key, as above].
    #[arg(long, value_name = "FILE")]
    tls_key: Option<PathBuf>,
    /// For --transport tls: who may have signed a client's certificate, PEM [default: server_ca.crt, as above].
    #[arg(long, value_name = "FILE")]
    tls_ca: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ProtocolArg {
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
enum TransportArg {
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
        Command::Stop(args) => operate::operate(&args, Request::Stop),
        Command::Hold(args) => operate::operate(&args, Request::Hold),
        Command::Continue(args) => operate::operate(&args, Request::Continue),
        Command::Replay(args) => replay::replay(&args),
        Command::Serve(args) => serve::serve(&args),
        Command::Verify(args) => verify::verify(&args),
        Command::Benchmark(benchmark::Of::Vrths(args)) => benchmark::vrths(&args),
        Command::Schema => schema::schema(),
    };
    match result {
        Ok(exit) => exit.into(),
        Err(error) => {
            match error.downcast_ref::<exit::Mistakes>() {
                Some(exit::Mistakes(pictures)) => tell(pictures),
                None => tell(format_args!("error: {}", in_one_line(&error))),
            }
            exit::of(&error).into()
        }
    }
}

/// The error and what caused it; causes that it quotes already are not said twice.
fn in_one_line(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
    }
    text
}

/// A line to whoever reads stderr. If nobody can, nothing is lost but the line.
fn tell(text: impl Display) {
    let _nobody_reads = writeln!(io::stderr(), "{text}");
}

/// The result to stdout. A reader who has seen enough (`| head`) is no error.
fn answer(text: impl Display) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// Warnings as pictures; in colour on a terminal.
fn warn(warnings: &Diagnostics) {
    if !warnings.0.is_empty() {
        tell(warnings.render(io::stderr().is_terminal()));
    }
}
