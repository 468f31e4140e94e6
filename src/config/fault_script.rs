//! A fault script: deliberate faults for a test of the controller or of a server.

use super::bus_spec::OnBuses;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Faults for `gusset serve --fault` and for simulated tests. All times are counted in commands
/// since arming, so that simulated time and real time give equal faults.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// Title of the script.
    pub title: String,
    /// Seed of the random numbers, for faults with a `probability` and for random faults.
    #[serde(default)]
    pub seed: u64,
    /// Faults in any order. Several faults may act at once.
    #[serde(default)]
    pub fault: Vec<Fault>,
    /// Changes to the test file, as for `gusset run --set`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
    /// Expected result of a test with these faults. A server ignores it.
    pub expect: Option<Expect>,
}

impl OnBuses for Script {}

/// One fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// First affected command, from 0 at arming. Default: 0.
    pub at: Option<u64>,
    /// Number of affected commands. Default: all commands after the first.
    #[serde(default, rename = "for")]
    pub lasts: Option<u64>,
    /// Affected axis, from 1. Default: all axes.
    #[schemars(example = 2)]
    pub axis: Option<usize>,
    /// Direction on the link. Default: "replies".
    pub on: Option<Way>,
    /// Probability for each affected command. Default: 1.
    pub probability: Option<f64>,
    /// Kind of the fault.
    pub kind: Kind,
}

/// Direction on the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// From the specimen to the controller.
    #[default]
    Replies,
    /// From the controller to the specimen. On a stream, only where a frame arrives alone.
    Commands,
}

/// Sensors that a fault affects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Displacement sensor.
    Disp,
    /// Load cell.
    Force,
    /// Displacement sensor and load cell.
    #[default]
    Both,
}

/// Kind of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Kind {
    // On the link.
    /// A frame is lost.
    Lost,
    /// A frame arrives later by this number of ticks.
    Late {
        /// Delay in ticks of the test. It may be a fraction.
        ticks: f64,
    },
    /// A frame arrives later by a random delay, so that frames overtake each other.
    Jitter {
        /// Largest delay in ticks of the test. It may be a fraction.
        ticks: f64,
    },
    /// A frame arrives several times.
    Duplicated {
        /// Number of copies besides the frame itself.
        times: u32,
    },
    /// A frame arrives after the next one.
    Reordered,
    /// An old frame arrives again, besides the new one.
    OldAgain {
        /// Age of the old frame in frames, from 1 to 64.
        age: usize,
    },
    /// Bits of a frame are flipped, so that its checksum is wrong.
    Corrupted {
        /// Number of random bits.
        bits: u32,
    },
    /// The length in the header of a frame is wrong.
    WrongLength,
    /// A frame is cut short.
    Truncated,
    /// Random bytes arrive instead of a frame.
    Garbage,
    /// The force is NaN in a frame that is otherwise correct.
    NotANumberSent,
    /// A measurement claims to answer a command that was not sent yet.
    AnswersTheFuture {
        /// Number of commands ahead.
        by: u64,
    },
    /// The connection breaks. With UDP, no end notices it.
    Closed,
    /// The other end hangs. It then receives all commands at once, and its replies are lost.
    Hangs {
        /// Length in ticks of the test.
        ticks: f64,
    },
    /// The clock of the specimen is too fast or too slow, from arming on.
    ClockDrift {
        /// Rate error in millionths.
        ppm: f64,
    },
    /// The request to arm is never answered.
    ArmingUnanswered,

    // At the actuator.
    /// The actuator does not move.
    Frozen,
    /// The actuator reaches the end of its stroke.
    Stroke {
        /// Stroke in both directions, in m.
        disp_m: f64,
    },
    /// The speed of the actuator is limited.
    Rate {
        /// Largest speed in both directions, in m/s.
        vel_m_per_s: f64,
    },
    /// The force of the actuator is limited. The actuator stalls at the limit.
    ForceLimit {
        /// Largest force in both directions, in N.
        force_n: f64,
    },
    /// The actuator lags by whole commands.
    Lag {
        /// Number of commands, from 1 to 64.
        commands: usize,
    },
    /// The specimen is not at the expected position, and refuses to be armed.
    Elsewhere {
        /// Distance from the expected position, in m.
        disp_m: f64,
    },

    // At the sensors.
    /// Sensors repeat their last reading.
    Stuck {
        /// Affected sensors.
        #[serde(default)]
        channel: Channel,
    },
    /// Sensors have a constant error.
    Bias {
        /// Error of the displacement, in m.
        #[serde(default)]
        disp_m: f64,
        /// Error of the force, in N.
        #[serde(default)]
        force_n: f64,
    },
    /// Sensors have an error that grows with each command.
    Drift {
        /// Growth of the displacement error per command, in m.
        #[serde(default)]
        disp_m: f64,
        /// Growth of the force error per command, in N.
        #[serde(default)]
        force_n: f64,
    },
    /// Sensors have uniformly distributed noise.
    Noise {
        /// Largest displacement noise in both directions, in m.
        #[serde(default)]
        disp_m: f64,
        /// Largest force noise in both directions, in N.
        #[serde(default)]
        force_n: f64,
    },
    /// Sensors read zero.
    Dropout {
        /// Affected sensors.
        #[serde(default)]
        channel: Channel,
    },
    /// Sensors have the wrong sign.
    Reversed {
        /// Affected sensors.
        channel: Channel,
    },
    /// The load cell has a wrong gain.
    Gain {
        /// Reading divided by force.
        factor: f64,
    },
    /// The load cell reads NaN.
    NotANumber,

    // At the specimen's end as a whole.
    /// The interlock or emergency stop opens.
    Interlock,
    /// A sensor or actuator reports that it is at the end of its range.
    Saturated,
    /// The specimen ends the session.
    Goodbye,

    // At the controller.
    /// The loop of the controller stalls. Only on the simulated clock, because a server cannot
    /// stall its controller.
    ControllerStalls {
        /// Length in ticks of the test.
        ticks: u64,
    },
}

/// Expected result of a test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    /// Phases of the test, from "connected" to "safe".
    pub path: Vec<String>,
    /// Words in the reason for the end. Default: the test reaches its last step.
    pub reason: Option<String>,
    /// Exit code of `gusset run`.
    pub exit: u8,
    /// Words that the specimen must have reported.
    pub far_end: Option<String>,
}

/// Where in the laboratory a fault happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Frames on their way.
    Frames,
    /// The connection as a whole.
    Connection,
    /// Actuator, specimen and sensors.
    Rig,
    /// The controller's loop.
    Controller,
}

/// Longest memory of a fault, in commands or frames.
pub const MEMORY: usize = 64;

impl Kind {
    /// Where it happens.
    #[must_use]
    pub(crate) const fn place(self) -> Place {
        match self {
            Self::Lost
            | Self::Late { .. }
            | Self::Jitter { .. }
            | Self::Duplicated { .. }
            | Self::Reordered
            | Self::OldAgain { .. }
            | Self::Corrupted { .. }
            | Self::WrongLength
            | Self::Truncated
            | Self::Garbage
            | Self::NotANumberSent
            | Self::AnswersTheFuture { .. } => Place::Frames,
            Self::Closed
            | Self::Hangs { .. }
            | Self::ClockDrift { .. }
            | Self::ArmingUnanswered => Place::Connection,
            Self::Frozen
            | Self::Stroke { .. }
            | Self::Rate { .. }
            | Self::ForceLimit { .. }
            | Self::Lag { .. }
            | Self::Elsewhere { .. }
            | Self::Stuck { .. }
            | Self::Bias { .. }
            | Self::Drift { .. }
            | Self::Noise { .. }
            | Self::Dropout { .. }
            | Self::Reversed { .. }
            | Self::Gain { .. }
            | Self::NotANumber
            | Self::Interlock
            | Self::Saturated
            | Self::Goodbye => Place::Rig,
            Self::ControllerStalls { .. } => Place::Controller,
        }
    }

    /// Its name in a file.
    #[must_use]
    pub(crate) fn word(self) -> String {
        // Made of plain values: a table of one entry, or its name alone.
        match serde_json::to_value(self) {
            Ok(serde_json::Value::String(name)) => name,
            Ok(serde_json::Value::Object(table)) => {
                table.keys().next().cloned().unwrap_or_default()
            }
            Ok(_) | Err(_) => String::new(),
        }
    }
}

impl Fault {
    /// True if it concerns command `number` since arming. Real-time: yes.
    #[must_use]
    pub fn concerns(&self, number: u64) -> bool {
        let at = self.at.unwrap_or(0);
        number >= at && self.lasts.is_none_or(|lasts| number - at < lasts)
    }
}

impl Script {
    /// The notice of this script in a test and its record.
    #[must_use]
    pub fn words(&self) -> String {
        format!("FAULTS are played: {}", self.title)
    }

    /// The first fault that happens at the controller and not at the specimen, from 0.
    #[must_use]
    pub fn at_the_controller(&self) -> Option<usize> {
        let mut places = self.fault.iter().map(|fault| fault.kind.place());
        places.position(|place| place == Place::Controller)
    }

    /// Where the controller's loop stalls: number of the tick since arming, and for how many ticks.
    #[must_use]
    pub fn stalls(&self) -> Vec<(u64, u64)> {
        let stall = |fault: &Fault| match fault.kind {
            Kind::ControllerStalls { ticks } => Some((fault.at.unwrap_or(0), ticks)),
            _ => None,
        };
        self.fault.iter().filter_map(stall).collect()
    }

    /// Its faults at one place.
    #[must_use]
    pub fn faults_at(&self, place: Place) -> Vec<Fault> {
        let all = self.fault.iter();
        all.filter(|fault| fault.kind.place() == place)
            .cloned()
            .collect()
    }
}
