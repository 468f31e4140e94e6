//! The file of `gusset serve`: specimens and how they are offered.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::about_table::AboutTable;
use super::axis_table::{DispUnit, ForceUnit};
use super::bus_spec::OnBuses;
use super::bus_table::BusTable;
use super::link_table::{Carrier, Offer};
use super::openfresco_table::OpenFrescoServeSpec;
use super::safety::SafetyTable;
use super::schema::RecordTable;
use super::specimen::{SpecimenTable, link_specimens};
use super::timing_table::TimingSpec;
use super::tls_table::ServeTlsSpec;

/// Specimens for `gusset serve`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ServeFile {
    /// Title of the file.
    #[serde(default)]
    pub title: String,
    /// Who tests what: for archives and later readers.
    #[serde(default, skip_serializing_if = "AboutTable::is_empty")]
    pub about: AboutTable,
    /// Specimens, one table each. `gusset serve` serves one of them at a time.
    #[serde(default)]
    pub specimen: Vec<SpecimenTable>,
    /// EtherCAT buses of this computer, for a gateway to a specimen on one of them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub bus: BTreeMap<String, BusTable>,
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

impl OnBuses for ServeFile {
    fn link_specimens(&mut self) {
        link_specimens(&self.bus, &mut self.specimen);
    }
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

/// Pacing of a gateway. Each target of the client becomes a path of commands. The gateway replies when
/// the target is reached. With `between = "rest"` the path begins and ends at rest; the largest speed is 1.875 times the mean speed of the path. The way to the
/// first target takes longer where a limit of speed requires that. More: guide, gateway.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = 15)]
    pub settle_ticks: u32,
    /// Motion of the specimen while the next target is not known. Default: "rest".
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = &"predict")]
    pub between: BetweenTargets,
    /// Order of the polynomial through the last targets that predicts the motion with `between =
    /// "predict"`: 0 (rest) to 3. Default: 3.
    #[schemars(example = 2)]
    pub prediction_order: Option<u8>,
    /// If true, the velocities that the client sends predict the motion, and not a polynomial. Default: false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub prediction_by_velocity: bool,
    /// Share of a step at which the specimen slows down without a new target. Default: 0.6.
    #[schemars(example = 0.5)]
    pub slow_at: Option<f64>,
    /// Share of a step at which it then rests. Default: 0.8.
    #[schemars(example = 0.75)]
    pub slow_until: Option<f64>,
    /// Largest distance beyond the last target that the command may go before a new target is known. It
    /// includes compensation and the way to rest. One number, or one for each axis, in m (rad of a
    /// rotation) of the specimen. Required with `between = "predict"`.
    #[schemars(example = 0.005)]
    pub predict_within_m: Option<PerAxis>,
    /// Correction of the force at a target for what the specimen lacks to it, with `between = "predict"`.
    /// The record keeps the measured force and has a column for the correction. Default: "none".
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = &"initial_stiffness")]
    pub correct: Correction,
    /// Largest correction of a force in N (N m of a moment) of the client's structure. Required with
    /// `correct = "initial_stiffness"`.
    #[schemars(example = 2000.0)]
    pub correct_at_most_n: Option<f64>,
}

/// How the force at a target is corrected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Correction {
    /// The client receives the measured force.
    #[default]
    None,
    /// The estimate `stiffness_n_per_m` times the difference of target and measured displacement is
    /// added; not after a rest on the way to the target.
    InitialStiffness,
}

/// Motion of a specimen between two targets of a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BetweenTargets {
    /// It moves from rest to rest. While the next target is late, it stays at the last one.
    #[default]
    Rest,
    /// It moves along a prediction, and arrives at the next target on the move. While the target is late,
    /// it slows down to rest.
    Predict,
}

/// One number for all axes, or one for each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PerAxis {
    /// For all axes.
    All(f64),
    /// For each axis.
    Each(Vec<f64>),
}

impl PerAxis {
    /// The numbers of `axes` axes; none where there is another number of them.
    #[must_use]
    pub fn of(&self, axes: usize) -> Option<Vec<f64>> {
        match self {
            Self::All(one) => Some(vec![*one; axes]),
            Self::Each(each) => (each.len() == axes).then(|| each.clone()),
        }
    }
}

/// True of a key that need not be written.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl PaceTable {
    /// True with `between = "predict"`.
    #[must_use]
    pub fn predicts(&self) -> bool {
        self.between == BetweenTargets::Predict
    }

    /// Shares of a step at which a specimen without a target slows down, and rests.
    #[must_use]
    pub fn slows(&self) -> [f64; 2] {
        [self.slow_at.unwrap_or(0.6), self.slow_until.unwrap_or(0.8)]
    }

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
