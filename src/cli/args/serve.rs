//! Arguments of `gusset serve`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  gusset serve column.toml --listen 127.0.0.1:4823\n  \
    gusset serve column.toml --transport udp --key lab.key --listen 0.0.0.0:4823\n  \
    gusset serve column.toml --transport tls --listen 0.0.0.0:4823\n  \
    gusset serve test.toml --specimen ground-storey --protocol openfresco\n  \
    gusset serve config/serve/gateway.toml --out runs/gateway\n  \
    gusset serve config/faults/rig.toml --transport udp --fault config/faults/lost-burst.toml\n\n\
    A specimen with [specimen.link] makes this a gateway: every command passes [specimen.limits] on its way.\n\n\
    More: gusset guide network, gusset guide opensees"
)]
pub(in crate::cli) struct ServeArgs {
    /// File with [[specimen]] and [serve], or a test file.
    pub file: PathBuf,
    /// Address and port to listen on; port 0 takes a free one [default: 127.0.0.1 and the port of the protocol: 4823, 8090, 8091
    /// or 44000].
    #[arg(long, value_name = "ADDR:PORT")]
    pub listen: Option<String>,
    /// Protocol [default: gusset].
    #[arg(long, value_enum)]
    pub protocol: Option<ProtocolArg>,
    /// Transport of the protocol [default: tcp].
    #[arg(long, value_enum)]
    pub transport: Option<TransportArg>,
    /// Which specimen of the file. Required if the file has several.
    #[arg(long, value_name = "NAME")]
    pub specimen: Option<String>,
    /// The only machine that may command the specimen. OpenFresco's protocols need it beyond loopback, unless they use
    /// --transport tls.
    #[arg(long, value_name = "HOST")]
    pub client: Option<String>,
    /// For --protocol openfresco-simulink: order of the signals, as in the control points of the OpenFresco model. Required with
    /// several axes and several quantities; time is a quantity.
    #[arg(long, value_enum, value_name = "ORDER")]
    pub signal_order: Option<SignalOrderArg>,
    /// File with the pre-shared key of the gusset protocol. Beyond loopback this or --transport tls is required. Other users must
    /// not be able to read the file.
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    #[command(flatten)]
    pub tls: TlsArgs,
    /// Record each test in its own run folder below this one: test-0001, test-0002 and so on. Without it nothing is recorded.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Socket where `gusset reset` reaches this server, or a folder for it [default: the folder of --out, else
    /// FILE.control.sock].
    #[arg(long, value_name = "PATH")]
    pub control: Option<PathBuf>,
    /// Clear the record of the specimen at the start: a latched trip, and a motion without a regular end.
    #[arg(long)]
    pub reset: bool,
    /// Inject the faults of this script into every test. Only for computed specimens; config/faults has scripts.
    #[arg(long, value_name = "SCRIPT")]
    pub fault: Option<PathBuf>,
    /// Busy waiting before and after the expected time of the next command, in µs.
    #[arg(long, value_name = "US", default_value_t = 60.0)]
    pub spin: f64,
    /// Print only the line with the address.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub(in crate::cli) struct TlsArgs {
    /// For --transport tls: certificate of this server, PEM [default: server.crt beside the file, else in the current folder].
    #[arg(long, value_name = "FILE")]
    pub tls_certificate: Option<PathBuf>,
    /// For --transport tls: private key of that certificate, PEM [default: server.key, as above].
    #[arg(long, value_name = "FILE")]
    pub tls_key: Option<PathBuf>,
    /// For --transport tls: authorities that may sign the certificate of a client, PEM [default: server_ca.crt, as above].
    #[arg(long, value_name = "FILE")]
    pub tls_ca: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum ProtocolArg {
    /// The protocol of Gusset: tools/PROTOCOL.md.
    Gusset,
    /// Element server for genericClient of OpenSees and the elements of OpenFresco.
    Openfresco,
    /// Actor behind ShadowSite of OpenFresco.
    OpenfrescoActor,
    /// Laboratory controller behind GenericTCP or SimFEAdapter of OpenFresco.
    OpenfrescoController,
    /// Model behind SimSimulink of OpenFresco.
    OpenfrescoSimulink,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(in crate::cli) enum SignalOrderArg {
    /// d1 v1 d2 v2: all quantities of an axis, then those of the next axis, without time.
    ByAxis,
    /// d1 d2 v1 v2: one quantity of all axes, then the next quantity. Time is last.
    ByQuantity,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum TransportArg {
    /// A TCP connection.
    Tcp,
    /// UDP datagrams.
    Udp,
    /// A TCP connection with TLS; tools/make-certificates makes the files.
    Tls,
}
