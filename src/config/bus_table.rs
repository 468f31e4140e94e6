//! `[bus.NAME]`: an EtherCAT bus and its devices.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use gusset_wire::process_data::{Entry, SetupWrite};

/// The buses of a file by their names.
pub(crate) type Buses = BTreeMap<String, BusTable>;

/// EtherCAT bus at a network interface of this computer, with its devices. It was never tried on
/// hardware.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BusTable {
    /// Network interface that the first device is connected to. No other program may use it.
    #[schemars(example = &"enp3s0")]
    pub interface: String,
    /// Clock of the ticks: "follow" follows the distributed clock of the bus, "free" uses no
    /// distributed clock.
    #[serde(default)]
    #[schemars(example = &"free")]
    pub clock: BusClock,
    /// Time without new outputs after which a device leaves normal operation by itself. It must be
    /// longer than three ticks and at most 6.5 s. It is written to each device with outputs.
    #[serde(default = "tenth")]
    #[schemars(example = 0.05)]
    pub watchdog_s: f64,
    /// Number of successive ticks without a valid exchange after which the test stops, from 1 to
    /// 1000.
    #[serde(default = "three")]
    #[schemars(range(min = 1, max = 1000), example = 2)]
    pub stale_ticks: u64,
    /// Devices in the order of the bus, one `[[bus.NAME.device]]` table each. `gusset bus scan`
    /// writes these tables.
    pub device: Vec<DeviceTable>,
}

/// Clock of the ticks of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BusClock {
    /// The controller follows the distributed clock of the first device that has one.
    #[default]
    Follow,
    /// The controller uses its own clock, and no device uses a distributed clock.
    Free,
}

/// Device of a bus: its identity and its process data. A difference to the device that answers is
/// refused before anything moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeviceTable {
    /// Name of the device, unique on its bus and without a dot. The axes of a specimen use it.
    #[schemars(example = &"load cell")]
    pub name: String,
    /// Identity that the device must have.
    pub product: ProductTable,
    /// Process data that the device receives, in the order of its mapping. Each entry has an object, a
    /// type and an optional name: "7000:01 i16 command". Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "texts")]
    #[schemars(with = "Vec<String>", example = ["7000:01 i16 command", "7010:01 i16"])]
    pub outputs: Vec<Entry>,
    /// Process data that the device sends, in the order of its mapping, written as `outputs`.
    /// Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "texts")]
    #[schemars(with = "Vec<String>", example = ["6000:01 u16 state", "6000:11 i16 force"])]
    pub inputs: Vec<Entry>,
    /// Objects that are written before the process data begin. Each entry has an object, a type and a
    /// value: "8000:05 u8 2". Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "texts")]
    #[schemars(with = "Vec<String>", example = ["8000:05 u8 2"])]
    pub setup: Vec<SetupWrite>,
    /// If true, the mapping of `outputs` and `inputs` is written to the device. Default: false, the
    /// mapping of the device is compared with them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub assign: bool,
    /// Behaviour of this device that the operator accepts, although it can move or release the specimen
    /// when the test stops. It needs `accept_reason`. Default: nothing is accepted.
    #[schemars(example = &"torque off at quick stop")]
    pub accept: Option<Acceptance>,
    /// Reason for `accept`, which the summary of the run repeats.
    #[schemars(example = &"the axis is horizontal and cannot drop")]
    pub accept_reason: Option<String>,
}

/// Behaviour of a device that the operator accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Acceptance {
    /// An output terminal goes to 0 V when its watchdog expires.
    #[serde(rename = "zero volts on watchdog")]
    ZeroVolts,
    /// A drive ends its quick stop without torque.
    #[serde(rename = "torque off at quick stop")]
    TorqueOff,
}

/// Identity of a device: the values of its identity object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProductTable {
    /// Vendor ID.
    #[schemars(example = 2)]
    pub vendor: u32,
    /// Product code. A hexadecimal number such as 0x0c1e3052 is allowed.
    #[schemars(example = 0x0c1e_3052)]
    pub code: u32,
    /// Revision number. Default: any.
    #[schemars(example = 0x0011_0000)]
    pub revision: Option<u32>,
}

/// Direction of process data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// From the controller to the device.
    Outputs,
    /// From the device to the controller.
    Inputs,
}

impl Flow {
    /// The key of its list in a device.
    pub(crate) const fn key(self) -> &'static str {
        match self {
            Self::Outputs => "outputs",
            Self::Inputs => "inputs",
        }
    }

    /// One entry of this direction, in words.
    pub(crate) const fn kind(self) -> &'static str {
        match self {
            Self::Outputs => "output",
            Self::Inputs => "input",
        }
    }

    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Outputs => Self::Inputs,
            Self::Inputs => Self::Outputs,
        }
    }
}

impl DeviceTable {
    /// The process data of one direction.
    #[must_use]
    pub fn entries(&self, flow: Flow) -> &[Entry] {
        match flow {
            Flow::Outputs => &self.outputs,
            Flow::Inputs => &self.inputs,
        }
    }
}

impl BusTable {
    /// The device with this name.
    #[must_use]
    pub(crate) fn device(&self, name: &str) -> Option<&DeviceTable> {
        self.device.iter().find(|device| device.name == name)
    }

    /// Number of the device with this name, from 0.
    #[must_use]
    pub fn number_of(&self, name: &str) -> Option<usize> {
        self.device.iter().position(|device| device.name == name)
    }

    /// Number of the device and of its entry, from 0, that `at` names as "device.entry".
    #[must_use]
    pub fn place(&self, flow: Flow, at: &str) -> Option<(usize, usize)> {
        let (name, entry) = at.split_once('.')?;
        let device = self.number_of(name)?;
        let mut entries = self.device.get(device)?.entries(flow).iter();
        let entry = entries.position(|known| known.name.as_deref() == Some(entry))?;
        Some((device, entry))
    }
}

/// Lists of texts that are read and written by their type.
mod texts {
    use std::fmt::{self, Display};
    use std::marker::PhantomData;
    use std::str::FromStr;

    use serde::de::{Error, Visitor};
    use serde::{Deserialize, Deserializer, Serializer};

    struct Text<T>(T);

    impl<'de, T: FromStr<Err: Display>> Deserialize<'de> for Text<T> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            struct One<T>(PhantomData<T>);

            impl<T: FromStr<Err: Display>> Visitor<'_> for One<T> {
                type Value = Text<T>;

                fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                    f.write_str("a text in quotes, such as \"6000:11 i16\"")
                }

                fn visit_str<E: Error>(self, text: &str) -> Result<Text<T>, E> {
                    text.parse().map(Text).map_err(E::custom)
                }
            }

            deserializer.deserialize_str(One(PhantomData))
        }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(
        deserializer: D,
    ) -> Result<Vec<T>, D::Error> {
        let read = Vec::<Text<T>>::deserialize(deserializer)?;
        Ok(read.into_iter().map(|text| text.0).collect())
    }

    pub(super) fn serialize<S: Serializer, T: Display>(
        list: &[T],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(list.iter().map(T::to_string))
    }
}

const fn tenth() -> f64 {
    0.1
}

const fn three() -> u64 {
    3
}
