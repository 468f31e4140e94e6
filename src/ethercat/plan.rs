//! What a test file says about a bus: its devices, their process data and its clock.

use crate::mapping::{Entry, SetupWrite};

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
    /// Name of its position, in counts per metre of the axis: `target = d · counts_per_m`. Negative if it is mounted the other way.
    pub counts_per_m: f64,
    /// Largest acceleration in m/s² with which a target comes to rest when no command follows.
    pub accel_m_per_s2: f64,
    /// Largest following-error window (6065) in m; none if nothing limits it.
    pub following_error_m: Option<f64>,
    /// Why a quick-stop option (605A) that ends without torque is accepted.
    pub accepts_free_stop: bool,
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
    /// Successive ticks without a valid exchange after which the bus is lost.
    pub stale_ticks: u32,
}
