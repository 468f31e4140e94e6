//! What `gusset serve` takes.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset serve column.toml --listen 127.0.0.1:4823\n  \
    gusset serve test.toml --specimen ground-storey --transport udp --key lab.key --listen 0.0.0.0:4823\n  \
    gusset serve test.toml --specimen ground-storey --transport tls --listen 0.0.0.0:4823\n  \
    gusset serve test.toml --specimen ground-storey --protocol openfresco\n  \
    gusset serve config/serve/gateway.toml --out runs/gateway\n  \
    gusset serve config/faults/rig.toml --transport udp --fault config/faults/lost-burst.toml\n\n\
    A specimen that is itself behind a link ([specimen.link]) makes this a gateway: every exchange passes its limits \
    ([specimen.limits]). A limit that trips, or an interlock, holds the specimen where it is. No further test begins until \
    the operator of the specimen has cleared the trip (gusset reset). So it is with `physical = true`."
)]
pub(in crate::cli) struct ServeArgs {
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
    /// For --protocol openfresco-simulink: the order of the signals in commands and answers, as the control points of the
    /// OpenFresco model have them. Needed with more than one axis and more than one quantity, the time
    /// included.
    #[arg(long, value_enum, value_name = "ORDER")]
    pub signal_order: Option<SignalOrderArg>,
    /// Pre-shared key of our own protocol; beyond loopback it wants this or --transport tls. A file that all users of the
    /// machine can read or change is refused.
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    #[command(flatten)]
    pub tls: TlsArgs,
    /// Record every controller's test in a run folder of its own below this one: test-0001, test-0002 and so on, with one
    /// row per exchange. `gusset report` and `gusset export` read them. Without it nothing is recorded. A controller that
    /// would begin more than 30 tests within 30 s is refused.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Where `gusset reset` reaches this server: a socket, or a folder for control.sock [default: the folder of --out, else
    /// FILE.control.sock]. A trip of a specimen that moves is kept beside this socket (PATH.latch.json, or
    /// control.sock.latch.json in the folder). Without --control it is kept beside the served file, wherever --out
    /// records (FILE.control.latch.json, or FILE.control.SPECIMEN.latch.json if the file has several).
    #[arg(long, value_name = "PATH")]
    pub control: Option<PathBuf>,
    /// Clear the latched trip of a test before this start.
    #[arg(long)]
    pub reset: bool,
    /// Play the faults of this script on every controller's test, the same each time: a laboratory in which things go
    /// wrong. For a specimen that is computed; config/faults has scripts. What --out records says so and keeps the script.
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
pub(in crate::cli) struct TlsArgs {
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
pub(in crate::cli) enum ProtocolArg {
    /// Our own: tools/PROTOCOL.md.
    Gusset,
    /// An element server for OpenSees genericClient and OpenFresco's experimental elements.
    Openfresco,
    /// The actor behind OpenFresco's ShadowSite.
    OpenfrescoActor,
    /// The laboratory controller behind OpenFresco's GenericTCP, or SimFEAdapter.
    OpenfrescoController,
    /// The model behind OpenFresco's SimSimulink.
    OpenfrescoSimulink,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(in crate::cli) enum SignalOrderArg {
    /// d1 v1 d2 v2: all quantities of an axis, then those of the next axis. The time must be left out.
    ByAxis,
    /// d1 d2 v1 v2: one quantity of all axes, then the next quantity. The time stands last.
    ByQuantity,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum TransportArg {
    /// A TCP connection.
    Tcp,
    /// UDP datagrams.
    Udp,
    /// A TCP connection with TLS on it; tools/make-certificates makes the files.
    Tls,
}
