//! The file of `gusset serve`: specimens and how they are offered.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::axis_table::{DispUnit, ForceUnit};
use super::link_table::{Carrier, Offer};
use super::openfresco_table::OpenFrescoServeSpec;
use super::safety::SafetyTable;
use super::schema::RecordTable;
use super::specimen::SpecimenTable;
use super::timing_table::TimingSpec;
use super::tls_table::ServeTlsSpec;

/// Specimens for `gusset serve`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ServeFile {
    /// Title of the file.
    #[serde(default)]
    pub title: String,
    /// Specimens, one table each. `gusset serve` serves one of them at a time.
    #[serde(default)]
    pub specimen: Vec<SpecimenTable>,
    /// Address, protocol and access.
    #[serde(default)]
    pub serve: ServeTable,
    /// Only `unlimited` has an effect. All other keys need the response of a structure, which a
    /// server does not have.
    pub safety: Option<SafetyTable>,
    /// Real-time scheduling of the data thread. Default: normal scheduling.
    pub timing: Option<TimingSpec>,
    /// Recording with `--out`. Only `queue_s` and `required` have an effect.
    pub record: Option<RecordTable>,
}

/// Address, protocol and access of `gusset serve`. Options of the command line override these keys.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServeTable {
    /// Address and port of the server, "host:port". Default: "127.0.0.1:4823".
    #[schemars(example = &"0.0.0.0:4823")]
    pub listen: Option<String>,
    /// Protocol of the server. Default: "gusset".
    #[schemars(example = &"openfresco")]
    pub protocol: Option<Offer>,
    /// Transport of the data: TCP, UDP or TLS. Default: "tcp".
    #[schemars(example = &"tls")]
    pub transport: Option<Carrier>,
    /// Certificates for `transport = "tls"`.
    pub tls: ServeTlsSpec,
    /// File that contains the pre-shared key, relative to this file. Beyond loopback, the protocol
    /// of Gusset requires this or TLS. Other users must not have access to it (`chmod 600`).
    #[schemars(example = &"laboratory.key")]
    pub key_file: Option<String>,
    /// Unit of the displacements that the client commands, for a gateway that converts them to the
    /// axes by `geometry`, `similitude`, `scale`, `sign` or offsets. Velocities and stiffnesses use it
    /// too. With this key a gateway converts units alone, too. Default: "m". A gateway that converts
    /// nothing uses the units of the axes.
    #[schemars(example = &"in")]
    pub unit_disp: Option<DispUnit>,
    /// Unit of the forces that the client receives from a gateway that converts. A moment has this
    /// unit times `unit_disp`. Default: "N".
    #[schemars(example = &"kip")]
    pub unit_force: Option<ForceUnit>,
    /// If true, a simulated specimen keeps its state, the history of its limits and its trip
    /// between sessions, as a physical one does. An interrupted test can then be resumed. Default:
    /// false, each session starts with a new specimen.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub remembers: bool,
    /// Ticks of a gateway that makes a smooth path of each target of its client. Default: none, each
    /// target is one command.
    pub pace: Option<PaceTable>,
    /// Settings for `protocol = "openfresco…"`.
    pub openfresco: OpenFrescoServeSpec,
}

/// Pacing of a gateway. Each target of the client becomes a path of commands that begins and ends at
/// rest. The gateway replies when the target is reached. While the next target is late, the specimen
/// stays at the last one. The largest speed is 1.875 times the mean speed of the path. The way to the
/// first target takes longer where a limit of speed requires that. More: guide, gateway.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PaceTable {
    /// Commands for each target.
    #[schemars(example = 20)]
    pub ticks_per_step: u32,
    /// Commands per second of wall time.
    #[schemars(example = 1000.0)]
    pub rate_hz: f64,
    /// Further commands at the target before the gateway replies, so that a rig with a lag arrives.
    /// The reply is the last measurement. Default: 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    #[schemars(example = 15)]
    pub settle_ticks: u32,
}

const fn is_zero(number: &u32) -> bool {
    *number == 0
}

impl PaceTable {
    /// Period of the commands in ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        (1e9 / self.rate_hz).round() as u64
    }
}

impl ServeTable {
    /// True if a key names a unit of the client.
    #[must_use]
    pub(crate) const fn names_units(&self) -> bool {
        self.unit_disp.is_some() || self.unit_force.is_some()
    }
}
