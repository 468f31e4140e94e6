//! A bus as the test file describes it: its devices, their process data and its clock.

use gusset_wire::process_data::{Entry, SetupWrite};

/// Who gives the time of the ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeSource {
    /// The loop follows the clock of the first device that has a distributed clock.
    Bus,
    /// The loop's own clock; no device uses a distributed clock.
    Loop,
}

/// One device, in the order of the bus.
#[derive(Debug, Clone, PartialEq)]
pub struct DevicePlan {
    /// Name in the test file.
    pub name: String,
    /// Vendor ID of its identity object.
    pub vendor: u32,
    /// Product code of its identity object.
    pub code: u32,
    /// Revision; any if none is given.
    pub revision: Option<u32>,
    /// Process data that it receives.
    pub outputs: Vec<Entry>,
    /// Process data that it sends.
    pub inputs: Vec<Entry>,
    /// The mapping is written to the device; else the mapping of the device is compared with it.
    pub assign: bool,
    /// Objects that are written in PRE-OP.
    pub setup: Vec<SetupWrite>,
    /// A CiA-402 drive in cyclic synchronous position mode.
    pub drive: Option<DrivePlan>,
}

/// A CiA-402 drive: what is required of it before it may have torque.
#[derive(Debug, Clone, PartialEq)]
pub struct DrivePlan {
    /// Counts of its position in one unit of the axis; negative if it is mounted the other way.
    pub counts_per_unit: f64,
    /// Largest acceleration, in units of the axis per s², with which a target comes to rest when no command follows.
    pub accel: f64,
    /// Largest window of the following error (6065) in counts; none if nothing limits it.
    pub following_counts: Option<f64>,
    /// A quick-stop option (605A) that ends without torque is accepted.
    pub accepts_free_stop: bool,
}

/// Place of an entry: its device in the order of the bus, and its number among the inputs or outputs of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct EntryPlace {
    /// Device, from 0.
    pub device: usize,
    /// Entry, from 0.
    pub entry: usize,
}

/// A quantity in counts of an entry: `value = per_count · (count − zero_count)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scaled {
    /// The entry.
    pub at: EntryPlace,
    /// Value of one count, in the unit of the axis.
    pub per_count: f64,
    /// Count where the value is zero.
    pub zero_count: f64,
}

impl Scaled {
    /// The value of a count.
    #[must_use]
    pub fn value(&self, count: f64) -> f64 {
        (count - self.zero_count) * self.per_count
    }

    /// The count of a value, with its fraction.
    #[must_use]
    pub fn count(&self, value: f64) -> f64 {
        value / self.per_count + self.zero_count
    }
}

/// An input with flags: `(count & mask) == equals` is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Check {
    /// The input.
    pub at: EntryPlace,
    /// Bits that count.
    pub mask: u32,
    /// Their right value.
    pub equals: u32,
}

/// What carries the command of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CommandPlan {
    /// An output, for instance ±10 V to a servo controller.
    Output(Scaled),
    /// A drive: its device, from 0.
    Drive(usize),
}

/// One axis of a specimen on the bus.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisPlan {
    /// Its command.
    pub command: CommandPlan,
    /// Its force.
    pub force: Scaled,
    /// Its displacement. Default: that of the drive, or else the command.
    pub disp: Option<Scaled>,
    /// Flags of its sensors.
    pub good: Vec<Check>,
}

/// One specimen on the bus.
#[derive(Debug, Clone, PartialEq)]
pub struct SpecimenPlan {
    /// Its axes.
    pub axes: Vec<AxisPlan>,
    /// Its interlock is closed if all are right.
    pub interlock: Vec<Check>,
}

/// A bus.
#[derive(Debug, Clone, PartialEq)]
pub struct BusPlan {
    /// Name in the test file.
    pub name: String,
    /// Devices in the order of the bus.
    pub devices: Vec<DevicePlan>,
    /// Time from tick to tick in ns.
    pub period_ns: u64,
    /// Who gives the time.
    pub time: TimeSource,
    /// Watchdog of the process data of every device with outputs, in ns.
    pub watchdog_ns: u64,
    /// Share of the tick after which the inputs are read again; none: the inputs of the exchange count.
    pub sample_after_ns: Option<u64>,
    /// How long a change of state, or a drive on its way to torque, may take, in ns.
    pub patience_ns: u64,
    /// Successive ticks without a valid exchange after which the bus is lost.
    pub stale_ticks: u32,
}
