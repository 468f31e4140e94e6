//! `[specimen.link]`: where a remote specimen is, what it speaks, and how it is waited for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::openfresco::{OpenFrescoSpec, Role};
use super::tls::TlsSpec;
use crate::wire::openfresco::{APPLICATION_PORT, CONTROLLER_PORT, SITE_PORT};

/// Longest silence in s after which a specimen must hold, whoever hosts it or asks for it.
pub const WATCHDOG_MAX_S: f64 = 3600.0;

/// A specimen at the other end of a network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct LinkSpec {
    /// What the far end speaks.
    #[serde(default)]
    pub protocol: Protocol,
    /// How the bytes travel.
    #[serde(default)]
    pub transport: Carrier,
    /// The far end: "rig.lab:4823", "192.0.2.7:4823" or "[2001:db8::7]:4823". Every address behind a name is tried; over UDP,
    /// where nothing shows that nobody is there, the first.
    pub address: String,
    /// File with the pre-shared key, relative to the test file. It is never copied into the run folder. A file that all users of
    /// the machine can read or change is refused (`chmod 600`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key_file: Option<String>,
    /// Whether a reply is owed for each command, or the specimen lives in its own time.
    #[serde(default)]
    pub coupling: LinkCoupling,
    /// How long the connection and its set-up may take, in s.
    #[serde(default = "five")]
    pub connect_timeout_s: f64,
    /// How long a lockstep specimen may owe a reply before the link counts as lost, in s.
    #[serde(default = "five")]
    pub reply_timeout_s: f64,
    /// What is done with the force when a sampled measurement is not there in time.
    #[serde(default)]
    pub on_stale: StaleChoice,
    /// Whether the specimen is commanded at every tick or, where it is slow or far away, once a step. Then it is told its
    /// target as soon as that is known, and may take as long for its answer as the others take on their way there; if it takes
    /// longer, they follow a prediction, slow down and hold. Only with `ticks_per_step` above 1.
    #[serde(default)]
    pub commands: CommandPace,
    /// Stale measurements in a row after which the test stops; without a single answer before its first tick, at once. Absent: as
    /// many as `max_stale_s` says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_stale: Option<u64>,
    /// Wall time in s with stale measurements only after which the test stops; with `max_stale`, whichever comes first.
    /// Absent: as many as `max_stale` says; without that 0.1 s, at least ten ticks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_stale_s: Option<f64>,
    /// The specimen must hold when no command has come for so long, in s, at most 3600. Default: 0.25 s, at least ten ticks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub watchdog_s: Option<f64>,
    /// The force is sampled after this fraction of the tick, above 0, at most 1. Default: when the command comes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_after: Option<f64>,
    /// Names of the axes, as the far end calls them. Default: "axis 1", "axis 2", …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_names: Option<Vec<String>>,
    /// Busy loop at the beginning of each wait for a reply, in µs; after it the thread sleeps until bytes come. Shortened at
    /// rates where it would use up the kernel's real-time budget.
    #[serde(default = "sixty")]
    pub spin_us: f64,
    /// For `transport = "tls"`: who we are and whom we trust. Default: the files that OpenFresco's programs look for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tls: Option<TlsSpec>,
    /// Before each test every axis of the specimen goes so far in its positive direction and back, in m at the specimen,
    /// and is not armed if it turns out to be wired the wrong way round. It must stay in the elastic range. Default: no
    /// motion; a static load shows the direction, too, and without either the user is warned. A link that answers with forces only
    /// (OpenFresco's element servers) shows the sign of the force; whether the actuator follows stays unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe_m: Option<f64>,
    /// Time that this motion takes each way, in s; four ticks at least.
    #[serde(default = "half")]
    pub probe_ramp_s: f64,
    /// The far end is a computation and no machine. On the simulated clock a test commands it as fast as it answers; whoever
    /// neither says so himself nor is said to be one here is not commanded then. No gateway and no OpenFresco server says so.
    #[serde(default, skip_serializing_if = "is_false")]
    pub computed: bool,
    /// Where the specimen stands before a test, in m as each axis counts, one entry per axis: for what cannot be asked, OpenFresco's
    /// element servers and actor sites and OpenSees' adapters, and for one behind the protocol of Gusset that does not tell it (where it does, its own word
    /// counts). It is held there first and led from there to where the test begins; a gateway judges the first command of its
    /// first test as a step from there, and that of every later test from where it told it to go last. Needed unless `computed`
    /// says that nothing moves there; OpenFresco's site servers tell it. Without it a gateway refuses each test with a specimen of
    /// our own protocol that does not tell where it stands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stands_at_m: Option<Vec<f64>>,
    /// "none": the direction is not checked, and nobody is warned of that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probe: Option<ProbeChoice>,
    /// For `protocol = "openfresco…"` only: what its set-up cannot find out by itself. Such a link is always lockstep.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub openfresco: Option<OpenFrescoSpec>,
}

/// What the far end speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Protocol {
    /// Our own protocol, described in tools/PROTOCOL.md.
    #[default]
    Gusset,
    /// OpenFresco's application protocol: an element or site server.
    #[serde(rename = "openfresco")]
    OpenFresco,
    /// OpenFresco's protocol between sites: its `ActorSite`.
    #[serde(rename = "openfresco-shadow")]
    OpenFrescoShadow,
    /// OpenSees' `adapter`, `actuator` and `corotActuator`.
    #[serde(rename = "openfresco-adapter")]
    OpenFrescoAdapter,
}

/// How often a specimen is commanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CommandPace {
    /// At every tick of the controller.
    #[default]
    EveryTick,
    /// Once in each step of the integration.
    EveryStep,
}

/// Wall time in s with stale measurements only after which a test stops, unless the file says otherwise.
const STALE_S: f64 = 0.1;
/// At least so many of them.
const STALE_TICKS: u64 = 10;

impl LinkSpec {
    /// True of a partner that is commanded once a step, however many ticks that has.
    #[must_use]
    pub fn is_per_step(&self) -> bool {
        self.commands == CommandPace::EveryStep
    }

    /// Stale measurements in a row that are put up with, with ticks of `period` seconds.
    #[must_use]
    pub fn stale_bound(&self, period: f64) -> u64 {
        let fit = |seconds: f64| ((seconds / period).ceil() as u64).max(1);
        match (self.max_stale, self.max_stale_s) {
            (Some(count), Some(seconds)) => count.min(fit(seconds)),
            (Some(count), None) => count,
            (None, Some(seconds)) => fit(seconds),
            (None, None) => fit(STALE_S).max(STALE_TICKS),
        }
    }
}

/// Whether the direction of a specimen is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProbeChoice {
    /// It is not.
    None,
}

/// What a server speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Offer {
    /// Our own protocol, described in tools/PROTOCOL.md.
    #[default]
    Gusset,
    /// An element server for OpenSees `genericClient` and OpenFresco's experimental elements.
    #[serde(rename = "openfresco")]
    OpenFresco,
    /// The actor behind OpenFresco's `ShadowSite`.
    #[serde(rename = "openfresco-actor")]
    OpenFrescoActor,
    /// The laboratory controller behind OpenFresco's `GenericTCP`, or `SimFEAdapter`.
    #[serde(rename = "openfresco-controller")]
    OpenFrescoController,
    /// The model behind OpenFresco's `SimSimulink`.
    #[serde(rename = "openfresco-simulink")]
    OpenFrescoSimulink,
}

impl Offer {
    /// The role that is played and its usual port; `None` for our own protocol.
    #[must_use]
    pub const fn openfresco(self) -> Option<(Role, u16)> {
        match self {
            Self::Gusset => None,
            Self::OpenFresco => Some((Role::Application, APPLICATION_PORT)),
            Self::OpenFrescoActor => Some((Role::Actor, SITE_PORT)),
            Self::OpenFrescoController => Some((Role::Controller, CONTROLLER_PORT)),
            Self::OpenFrescoSimulink => Some((Role::Simulink, CONTROLLER_PORT)),
        }
    }
}

/// How the bytes travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Carrier {
    /// A TCP connection.
    #[default]
    Tcp,
    /// UDP datagrams.
    Udp,
    /// A TCP connection with TLS on it; both ends show a certificate. A helper thread encrypts, which is the one exception to
    /// the loop's rule of no allocation and no promise about time.
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

/// Whether a reply is owed for each command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkCoupling {
    /// The specimen lives in its own time; a measurement that is not there in time is stale.
    #[default]
    Sampled,
    /// One reply is owed for each command; the test waits for it. Always so on the simulated clock.
    Lockstep,
}

/// What is done with a stale force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StaleChoice {
    /// The newest force known is used as it is.
    #[default]
    Hold,
    /// It is moved along the tangent, as it was estimated up to then and within its bounds, to where the specimen should be.
    Extrapolate,
    /// The test stops.
    Stop,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
const fn is_false(given: &bool) -> bool {
    !*given
}

const fn five() -> f64 {
    5.0
}

const fn half() -> f64 {
    0.5
}

const fn sixty() -> f64 {
    60.0
}
