//! `[specimen.bus]`: the process data of a specimen on an EtherCAT bus, and its link.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::bus_table::{BusTable, Flow};
use super::link_table::{
    Carrier, CommandPace, LinkCoupling, LinkSpec, ProbeChoice, Protocol, StaleChoice, five, half,
    sixty,
};

/// Specimen on an EtherCAT bus: the process data that command and measure its axes. It was never
/// tried on hardware.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusSpec {
    /// Name of the bus: "rig" for the table `[bus.rig]`.
    #[schemars(example = &"rig")]
    pub bus: String,
    /// Command that the measurement of a tick answers.
    #[serde(default)]
    #[schemars(example = &"next_tick")]
    pub sample: BusSample,
    /// Fraction of the tick after which the inputs are read, above 0 and at most 0.85. Only for
    /// `sample = "same_tick"`.
    #[serde(default = "seven_tenths")]
    #[schemars(example = 0.6)]
    pub sample_after: f64,
    /// Process data of each axis, one `[[specimen.bus.axis]]` table each.
    pub axis: Vec<BusAxis>,
    /// Inputs that must have a value in each tick from arming on, for example an emergency stop: a
    /// table or a list of tables. Default: none.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_several"
    )]
    #[schemars(with = "OneOrSeveral")]
    pub interlock: Vec<BusCondition>,
    /// Longest time until all devices are in safe operation, at most 3600 s.
    #[serde(default = "five")]
    #[schemars(example = 10.0)]
    pub connect_timeout_s: f64,
    /// Names of the axes. Default: "axis 1", "axis 2", ….
    #[schemars(example = serde_json::json!(["north", "south"]))]
    pub axis_names: Option<Vec<String>>,
    /// Amplitude of the wiring check before each test, at the specimen. Each axis moves this far
    /// and back; a specimen with a wrong sign is refused. Keep it in the elastic range. Default: no
    /// motion; a static load can also show the sign, otherwise a warning is written.
    #[schemars(example = 0.0005)]
    pub probe_m: Option<f64>,
    /// Time of the motion of the wiring check in each direction, at least four ticks and at most
    /// 600 s.
    #[serde(default = "half")]
    #[schemars(example = 1.0)]
    pub probe_ramp_s: f64,
    /// "none" omits the wiring check without a warning. Default: a warning if neither `probe_m` nor
    /// a static load shows the sign of an axis.
    #[schemars(example = &"none")]
    pub probe: Option<ProbeChoice>,
    /// Initial position of each axis before the test, in m. The outputs command it when they become
    /// active. Required if an axis has `command`: an output does not report its position.
    #[schemars(example = [0.0])]
    pub stands_at_m: Option<Vec<f64>>,
}

/// Command to which the measurement of a tick belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BusSample {
    /// The inputs are read again late in the tick, after the command of the same tick.
    #[default]
    SameTick,
    /// The inputs are read with the outputs, so they belong to the command of the tick before.
    NextTick,
}

/// Process data of one axis. Give exactly one of `command` and `drive`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusAxis {
    /// Output that commands the displacement, for example the external command of a servo
    /// controller.
    #[schemars(example = serde_json::json!({"at": "servo.command", "m_per_count": 3.05e-6}))]
    pub command: Option<BusCommand>,
    /// Drive that moves the axis.
    #[schemars(example = serde_json::json!({"device": "axis 1", "m_per_count": 1.0e-7}))]
    pub drive: Option<BusDrive>,
    /// Input that measures the force.
    pub force: BusForce,
    /// Input that measures the displacement. Default: the actual position of the drive. An axis with
    /// `command` then has no measured displacement.
    #[schemars(example = serde_json::json!({"at": "lvdt.position", "m_per_count": 1.0e-6}))]
    pub disp: Option<BusDisp>,
    /// Inputs that must have a value for a measurement to be valid: a table or a list of tables.
    /// Default: none.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_several"
    )]
    #[schemars(with = "OneOrSeveral")]
    pub good: Vec<BusCondition>,
}

/// Output that commands a displacement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusCommand {
    /// Output as "device.entry", with the names of `[bus.NAME]`.
    #[schemars(example = &"servo.command")]
    pub at: String,
    /// Displacement of one count, negative if the output acts in the opposite direction.
    #[schemars(example = 3.05e-6)]
    pub m_per_count: f64,
    /// Counts at zero displacement. Default: 0.
    #[serde(default)]
    #[schemars(example = 120.0)]
    pub offset_count: f64,
}

/// Drive that moves an axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusDrive {
    /// Name of the device. Its process data need the objects 6040, 607A, 6041 and 6064.
    #[schemars(example = &"axis 1")]
    pub device: String,
    /// Displacement of one count of its position, negative if it is mounted the other way.
    #[schemars(example = 1.0e-7)]
    pub m_per_count: f64,
    /// Mode of operation.
    #[serde(default)]
    #[schemars(example = &"csp")]
    pub profile: DriveProfile,
}

/// Mode of operation of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DriveProfile {
    /// Cyclic synchronous position: each tick gives a target position.
    #[default]
    Csp,
}

/// Input that measures a force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusForce {
    /// Input as "device.entry", with the names of `[bus.NAME]`.
    #[schemars(example = &"load cell.force")]
    pub at: String,
    /// Force of one count.
    #[schemars(example = 3.05)]
    pub n_per_count: f64,
    /// Counts at zero force. Default: 0.
    #[serde(default)]
    #[schemars(example = -14.0)]
    pub zero_count: f64,
}

/// Input that measures a displacement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusDisp {
    /// Input as "device.entry", with the names of `[bus.NAME]`.
    #[schemars(example = &"lvdt.position")]
    pub at: String,
    /// Displacement of one count.
    #[schemars(example = 1.0e-6)]
    pub m_per_count: f64,
    /// Counts at zero displacement. Default: 0.
    #[serde(default)]
    #[schemars(example = 16384.0)]
    pub zero_count: f64,
}

/// Input whose bits must have a value.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusCondition {
    /// Input as "device.entry", with the names of `[bus.NAME]`. Its type must be an integer.
    #[schemars(example = &"load cell.state")]
    pub at: String,
    /// Bits that are compared, for example 0x43. Default: all bits.
    #[schemars(example = 0x43)]
    pub mask: Option<u32>,
    /// Value of these bits.
    #[schemars(example = 0)]
    pub equals: u32,
}

impl BusSpec {
    /// Fraction of the tick after which the inputs are read again; none if those of the exchange count.
    #[must_use]
    pub fn samples_after(&self) -> Option<f64> {
        (self.sample == BusSample::SameTick).then_some(self.sample_after)
    }

    /// True if an axis has no measured displacement.
    #[must_use]
    pub(crate) fn is_force_only(&self) -> bool {
        let is_blind = |axis: &BusAxis| axis.drive.is_none() && axis.disp.is_none();
        self.axis.iter().any(is_blind)
    }

    /// The interface with the devices, counted from 1, and entries that move the axes: it tells specimens apart, whatever their names.
    fn movers(&self, bus: &BusTable) -> String {
        let each = self
            .axis
            .iter()
            .filter_map(|axis| match (&axis.command, &axis.drive) {
                (Some(command), _) => {
                    let (device, entry) = bus.place(Flow::Outputs, &command.at)?;
                    Some(format!(" {}.{}", device + 1, entry + 1))
                }
                (None, Some(drive)) => Some(format!(" {}", bus.number_of(&drive.device)? + 1)),
                (None, None) => None,
            });
        std::iter::once(bus.interface.clone()).chain(each).collect()
    }

    /// The link as which the controller sees this specimen. `bus`: its bus, unless the name is wrong.
    pub(crate) fn link(&self, bus: Option<&BusTable>) -> LinkSpec {
        LinkSpec {
            protocol: Protocol::Ethercat,
            transport: Carrier::default(),
            address: self.bus.clone(),
            key_file: None,
            coupling: LinkCoupling::Sampled,
            connect_timeout_s: self.connect_timeout_s,
            reply_timeout_s: five(),
            on_stale: StaleChoice::Hold,
            commands: CommandPace::EveryTick,
            max_stale: bus.map(|bus| bus.stale_ticks),
            watchdog_s: bus.map(|bus| bus.watchdog_s),
            sample_after: self.samples_after(),
            axis_names: self.axis_names.clone(),
            spin_us: sixty(),
            tls: None,
            probe_m: self.probe_m,
            probe_ramp_s: self.probe_ramp_s,
            computed: false,
            movers: bus.map(|bus| self.movers(bus)),
            stands_at_m: self.stands_at_m.clone(),
            probe: self.probe,
            openfresco: None,
        }
    }
}

/// A file whose specimens may be on a bus.
pub(crate) trait OnBuses {
    /// Gives each specimen on a bus its link. The file does not show this link when it is written.
    fn link_specimens(&mut self) {}
}

/// True of the link of a specimen on a bus, which is written as `bus`.
pub(crate) fn is_not_written(link: &Option<LinkSpec>) -> bool {
    let link = link.as_ref();
    link.is_none_or(|link| link.protocol == Protocol::Ethercat)
}

/// Reads a table, or a list of tables.
fn one_or_several<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    struct Tables<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Tables<T> {
        type Value = Vec<T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a table or a list of tables")
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Vec<T>, A::Error> {
            Ok(vec![T::deserialize(MapAccessDeserializer::new(map))?])
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Vec<T>, A::Error> {
            let mut read = Vec::new();
            while let Some(one) = from.next_element()? {
                read.push(one);
            }
            Ok(read)
        }
    }

    deserializer.deserialize_any(Tables(PhantomData))
}

/// The schema of [`one_or_several`] conditions.
struct OneOrSeveral;

impl JsonSchema for OneOrSeveral {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "OneOrSeveral".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<BusCondition>();
        json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}

const fn seven_tenths() -> f64 {
    0.7
}
