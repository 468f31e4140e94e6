//! Faults of a simulated bus, played from a script.

use serde::Deserialize;

/// A fault, and when it happens.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// What happens.
    pub what: FaultKind,
    /// First exchange of process data with all devices in OP in which it happens, from 0.
    pub at_tick: Option<u64>,
    /// Instead of `at_tick`: the first frame of all in which it happens, from 0.
    pub at_frame: Option<u64>,
    /// How many ticks or frames it lasts. Default: 1. A state that a device takes stays.
    #[serde(default = "one")]
    pub lasts: u64,
}

/// A script: `[[fault]]` tables.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultScript {
    /// Its faults.
    pub fault: Vec<Fault>,
}

const fn one() -> u64 {
    1
}

/// What happens.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum FaultKind {
    /// The frame is lost.
    Drop,
    /// The frame comes back this much later.
    Late {
        /// In µs.
        micros: u64,
    },
    /// The frame comes back twice.
    Duplicate,
    /// A device does not take part in the exchange of process data.
    Wkc {
        /// Its name.
        device: String,
    },
    /// The cable behind a device is cut.
    Cut {
        /// Its name.
        device: String,
    },
    /// A device falls to SAFE-OP.
    AlError {
        /// Its name.
        device: String,
        /// Its AL status code.
        code: u16,
    },
    /// A drive has a fault.
    DriveFault {
        /// Its name.
        device: String,
        /// Its error code (603F).
        code: u16,
    },
    /// A device reports an emergency by its mailbox.
    Emergency {
        /// Its name.
        device: String,
        /// Its error code.
        code: u16,
    },
    /// The inputs of a device do not change.
    FrozenInput {
        /// Its name.
        device: String,
    },
    /// The clocks of all devices run fast by this much, from the beginning.
    ClockPpm {
        /// In ppm.
        ppm: f64,
    },
    /// A device refuses a state, always.
    RefuseState {
        /// Its name.
        device: String,
        /// "PRE-OP", "SAFE-OP" or "OP".
        state: String,
        /// Its AL status code.
        code: u16,
    },
    /// The interlocks of all specimens open.
    Interlock,
    /// The flags of all sensors are wrong.
    BadSensor,
    /// A frame of another master is on the line.
    Foreign,
    /// The devices do not say that they are simulated, from the beginning: a test treats them as real ones.
    Unmarked,
}

impl FaultKind {
    /// True if it needs no time: it is there from the beginning.
    pub(crate) const fn is_lasting(&self) -> bool {
        matches!(
            self,
            Self::ClockPpm { .. } | Self::RefuseState { .. } | Self::Unmarked
        )
    }

    /// Name of the device that it concerns, if it concerns one.
    pub(crate) fn device(&self) -> Option<&str> {
        match self {
            Self::Wkc { device }
            | Self::Cut { device }
            | Self::AlError { device, .. }
            | Self::DriveFault { device, .. }
            | Self::Emergency { device, .. }
            | Self::FrozenInput { device }
            | Self::RefuseState { device, .. } => Some(device),
            _ => None,
        }
    }
}

impl Fault {
    /// True if it happens in this frame, which may be the exchange of a tick in OP.
    pub(crate) fn is_on(&self, frame: u64, tick: Option<u64>) -> bool {
        let within = |first: u64, now: u64| now >= first && now - first < self.lasts;
        match (self.at_tick, self.at_frame) {
            (_, Some(first)) => within(first, frame),
            (Some(first), None) => tick.is_some_and(|tick| within(first, tick)),
            (None, None) => self.what.is_lasting(),
        }
    }

    /// True if it begins in this tick.
    pub(crate) fn begins(&self, frame: u64, tick: Option<u64>) -> bool {
        match (self.at_tick, self.at_frame) {
            (_, Some(first)) => first == frame,
            (first, None) => first.is_some() && first == tick,
        }
    }
}
