//! `[specimen.link]`: address, protocol and timeouts of a specimen over a network.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::address::share_a_port;
use super::openfresco_table::{OpenFrescoSpec, ServerKind};
use super::tls_table::TlsSpec;
use gusset_wire::openfresco::{Counts, Peer};

/// Longest allowed `watchdog_s`, for every server and client.
pub const WATCHDOG_MAX_S: f64 = 3600.0;

/// Network connection to a specimen that another program controls or computes. More: guide,
/// network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct LinkSpec {
    /// Protocol of the server or client at the other end.
    #[serde(default)]
    #[schemars(example = &"openfresco")]
    pub protocol: Protocol,
    /// Transport of the data: TCP, UDP or TLS.
    #[serde(default)]
    pub transport: Carrier,
    /// Host and port of the specimen: `rig.lab:4823`, `192.0.2.7:4823` or `[2001:db8::7]:4823`. All
    /// addresses of a host name are tried, with UDP only the first.
    pub address: String,
    /// File that contains the pre-shared key, relative to the test file. Other users must not have
    /// access to it (`chmod 600`). It is never copied into the run folder. Default: no key.
    #[schemars(example = &"laboratory.key")]
    pub key_file: Option<String>,
    /// Time behaviour of the specimen: it measures continuously, or it answers each command.
    #[serde(default)]
    pub coupling: LinkCoupling,
    /// Longest time for connecting and the handshake, at most 3600 s.
    #[serde(default = "five")]
    pub connect_timeout_s: f64,
    /// Longest time that a lockstep specimen may need for a reply, at most 3600 s. After it, the
    /// link counts as lost.
    #[serde(default = "five")]
    pub reply_timeout_s: f64,
    /// Force to use if a sampled measurement is not received in time.
    #[serde(default)]
    #[schemars(example = &"extrapolate")]
    pub on_stale: StaleChoice,
    /// Interval of the commands. "every_step" suits a slow or distant specimen, which then has a
    /// whole step for its reply. If it needs longer, the other specimens slow down and hold. It
    /// requires lockstep coupling and `ticks_per_step` above 1.
    #[serde(default)]
    #[schemars(example = &"every_step")]
    pub commands: CommandPace,
    /// Number of successive stale measurements after which the test stops. If no measurement
    /// arrives before the first tick, it stops at once. Default: the number of ticks in 0.1 s, at
    /// least ten.
    #[schemars(example = 20)]
    pub max_stale: Option<u64>,
    /// Time without a command after which the specimen must hold, at most 3600 s. Default: 0.25 s,
    /// at least ten ticks.
    #[schemars(example = 0.1)]
    pub watchdog_s: Option<f64>,
    /// Fraction of the tick after which the specimen samples its force, above 0 and at most 1.
    /// Default: when the command arrives.
    #[schemars(example = 0.5)]
    pub sample_after: Option<f64>,
    /// Names of the axes, as the server of the specimen uses them. Default: "axis 1", "axis 2", ….
    #[schemars(example = serde_json::json!(["north", "south"]))]
    pub axis_names: Option<Vec<String>>,
    /// Time of active waiting for a reply before the thread sleeps, at most 1e6. At high rates it
    /// is shortened to the kernel's real-time budget.
    #[serde(default = "sixty")]
    #[schemars(example = 100.0)]
    pub spin_us: f64,
    /// Certificates for `transport = "tls"`. Default: the file names that OpenFresco uses.
    pub tls: Option<TlsSpec>,
    /// Amplitude of the wiring check before each test, at the specimen. Each axis moves this far
    /// and back; a specimen with a wrong sign is refused. Keep it in the elastic range. Default: no
    /// motion; a static load can also show the sign, otherwise a warning is written.
    pub probe_m: Option<f64>,
    /// Time of the motion of the wiring check in each direction, at least four ticks and at most
    /// 600 s.
    #[serde(default = "half")]
    pub probe_ramp_s: f64,
    /// If true, the specimen is a computation without a machine. The simulated clock then commands
    /// it at full speed. Without this key, the simulated clock refuses a specimen unless its server
    /// declares itself as computed. Default: false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub computed: bool,
    /// Initial position of each axis before the test, in m. The specimen holds there and then moves
    /// to the start of the test. Required for element servers and actor sites of OpenFresco and
    /// adapters of OpenSees, unless `computed` is true. More: guide, opensees.
    #[schemars(example = [0.0])]
    pub stands_at_m: Option<Vec<f64>>,
    /// What moves the axes of a specimen on a bus.
    #[serde(skip)]
    pub movers: Option<String>,
    /// "none" omits the wiring check without a warning. Default: a warning if neither `probe_m` nor
    /// a static load shows the sign of an axis.
    #[schemars(example = &"none")]
    pub probe: Option<ProbeChoice>,
    /// Settings for `protocol = "openfresco…"`, which always uses lockstep coupling.
    pub openfresco: Option<OpenFrescoSpec>,
}

/// Protocol between controller and specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// Protocol of Gusset, described in `tools/PROTOCOL.md`.
    #[default]
    Gusset,
    /// Application protocol of OpenFresco, to an element server or a site server.
    #[serde(rename = "openfresco")]
    OpenFresco,
    /// Protocol between the sites of OpenFresco, to its `ActorSite`.
    #[serde(rename = "openfresco-shadow")]
    OpenFrescoShadow,
    /// Protocol of `adapter`, `actuator` and `corotActuator` in OpenSees.
    #[serde(rename = "openfresco-adapter")]
    OpenFrescoAdapter,
    /// EtherCAT bus of this computer. A test file has `[specimen.bus]` instead of this word.
    #[serde(skip_deserializing)]
    #[schemars(skip)]
    Ethercat,
}

/// Interval of the commands to a specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CommandPace {
    /// Each tick of the controller.
    #[default]
    EveryTick,
    /// Each integration step.
    EveryStep,
}

/// Wall time in s with stale measurements only after which a test stops, unless the file says otherwise.
const STALE_S: f64 = 0.1;
/// Smallest default number of stale measurements.
const STALE_TICKS: u64 = 10;

impl LinkSpec {
    /// True of a partner that is commanded once a step, however many ticks that has.
    #[must_use]
    pub fn is_per_step(&self) -> bool {
        self.commands == CommandPace::EveryStep
    }

    /// True if the server of this specimen and a server at `address` need the same port.
    ///
    /// A TCP port and a UDP port may have the same number. TLS uses TCP. A bus has no port.
    #[must_use]
    pub fn needs_port(&self, address: &str, carrier: Carrier) -> bool {
        self.protocol != Protocol::Ethercat
            && self.transport.is_stream() == carrier.is_stream()
            && share_a_port(&self.address, address)
    }

    /// The server at the other end of an OpenFresco protocol; none for the protocol of Gusset and a bus.
    #[must_use]
    pub fn peer(&self) -> Option<Peer> {
        let server = self.openfresco.as_ref().map(|more| more.server);
        match (self.protocol, server.unwrap_or_default()) {
            (Protocol::Gusset | Protocol::Ethercat, _) => None,
            (Protocol::OpenFresco, ServerKind::Element) => Some(Peer::Element),
            (Protocol::OpenFresco, ServerKind::Site) => Some(Peer::Site),
            (Protocol::OpenFrescoShadow, _) => Some(Peer::Actor),
            (Protocol::OpenFrescoAdapter, _) => Some(Peer::Adapter),
        }
    }

    /// Numbers of signals of a command and of an answer over an OpenFresco protocol, for a specimen of `axes` axes; none if
    /// the file gives numbers out of range.
    #[must_use]
    pub fn signals(&self, axes: usize) -> Option<(Counts, Counts)> {
        let (command, answer) = self.peer()?.usual_signals(axes);
        let more = self.openfresco.as_ref();
        if more.is_some_and(|more| !more.out_of_range(axes).is_empty()) {
            return None;
        }
        let given = |key: fn(&OpenFrescoSpec) -> Option<[usize; 5]>| {
            let [d, v, a, f, t] = key(more?)?;
            Some(Counts::new(d, v, a, f, t))
        };
        Some((
            given(|more| more.command_signals).unwrap_or(command),
            given(|more| more.answer_signals).unwrap_or(answer),
        ))
    }

    /// True if the specimen reports its position before the first command; none for the protocol of Gusset, in
    /// which the server reports it, and for a bus.
    #[must_use]
    pub fn reports_position(&self, axes: usize) -> Option<bool> {
        let (_, answer) = self.signals(axes)?;
        Some(self.peer()?.reports_position(answer, axes))
    }

    /// Largest number of successive stale measurements, with ticks of `period` seconds.
    #[must_use]
    pub fn stale_bound(&self, period: f64) -> u64 {
        self.max_stale
            .unwrap_or_else(|| ((STALE_S / period).ceil() as u64).max(STALE_TICKS))
    }
}

/// Omission of the wiring check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProbeChoice {
    /// No wiring check, and no warning.
    None,
}

/// Protocol of `gusset serve`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Offer {
    /// Protocol of Gusset, described in `tools/PROTOCOL.md`.
    #[default]
    Gusset,
    /// Element server for `genericClient` of OpenSees and the experimental elements of OpenFresco.
    #[serde(rename = "openfresco")]
    OpenFresco,
    /// Actor for `ShadowSite` of OpenFresco.
    #[serde(rename = "openfresco-actor")]
    OpenFrescoActor,
    /// Laboratory controller for `GenericTCP` or `SimFEAdapter` of OpenFresco.
    #[serde(rename = "openfresco-controller")]
    OpenFrescoController,
    /// Model for `SimSimulink` of OpenFresco.
    #[serde(rename = "openfresco-simulink")]
    OpenFrescoSimulink,
}

/// Transport of the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Carrier {
    /// TCP connection.
    #[default]
    Tcp,
    /// UDP datagrams.
    Udp,
    /// TCP connection with TLS, on which both ends present a certificate. A separate thread
    /// encrypts the data, so there is no real-time guarantee.
    Tls,
}

impl Carrier {
    /// True for a stream of bytes, false for datagrams.
    #[must_use]
    pub const fn is_stream(self) -> bool {
        match self {
            Self::Tcp | Self::Tls => true,
            Self::Udp => false,
        }
    }
}

impl std::fmt::Display for Carrier {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Carrier::Tcp => "TCP",
            Carrier::Udp => "UDP",
            Carrier::Tls => "TLS",
        })
    }
}

/// Time behaviour of a specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkCoupling {
    /// The specimen measures continuously. A measurement that is not received in time is stale.
    #[default]
    Sampled,
    /// The specimen answers each command, and the test waits for the reply. The simulated clock
    /// always uses it.
    Lockstep,
}

/// Force to use while measurements are stale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StaleChoice {
    /// Newest known force.
    #[default]
    Hold,
    /// Newest known force, moved along the estimated tangent to the position where the specimen
    /// should be.
    Extrapolate,
    /// The test stops.
    Stop,
}

pub(super) const fn five() -> f64 {
    5.0
}

pub(super) const fn half() -> f64 {
    0.5
}

pub(super) const fn sixty() -> f64 {
    60.0
}
