//! A fault script as a file says it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What goes wrong in a laboratory, and what a test must make of it. Everything is counted in commands since arming, so
/// that the same script means the same in simulated and in real time.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// For people: what happens.
    pub title: String,
    /// Where chance begins, for faults with a `probability` and for those that throw dice themselves.
    #[serde(default)]
    pub seed: u64,
    /// What happens, in any order; several at once is allowed.
    #[serde(default)]
    pub fault: Vec<Fault>,
    /// Changes to the test file of the laboratory, as `gusset run --set` takes them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
    /// How a test in the laboratory must take it. A server does not look at it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expect: Option<Expect>,
}

/// One thing that goes wrong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// The first command that it concerns, from 0 at the arming. Default: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<u64>,
    /// How many commands it concerns. Default: all from there on.
    #[serde(default, rename = "for", skip_serializing_if = "Option::is_none")]
    pub lasts: Option<u64>,
    /// The axis of the specimen, from 1. Default: all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<usize>,
    /// Which way of the link: "replies" (the default) or "commands".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on: Option<Way>,
    /// How probable it is for each command that it concerns. Default: certain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// What goes wrong.
    pub kind: Kind,
}

/// A way of the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// From the specimen to the controller.
    #[default]
    Replies,
    /// From the controller to the specimen; over a stream, only where a frame comes by itself.
    Commands,
}

/// Which sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// The displacement sensor.
    Disp,
    /// The load cell.
    Force,
    /// Both.
    #[default]
    Both,
}

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Kind {
    // On the link.
    /// A frame does not arrive.
    Lost,
    /// A frame arrives later by so many ticks of the test.
    Late {
        /// Ticks; may be a fraction.
        ticks: f64,
    },
    /// A frame arrives later by anything up to so many ticks: frames overtake each other.
    Jitter {
        /// Ticks; may be a fraction.
        ticks: f64,
    },
    /// A frame arrives again, so many times.
    Duplicated {
        /// Copies besides the frame itself.
        times: u32,
    },
    /// A frame arrives behind the next one.
    Reordered,
    /// An old frame arrives again, besides the new one.
    OldAgain {
        /// Its age in frames, 1 to 64.
        age: usize,
    },
    /// Bits of a frame are flipped: its checksum tells.
    Corrupted {
        /// How many; by chance which.
        bits: u32,
    },
    /// The length in the head of a frame is wrong.
    WrongLength,
    /// A frame is cut short.
    Truncated,
    /// Bytes by chance arrive instead of a frame.
    Garbage,
    /// A force that is no number, in a frame that is otherwise right.
    NotANumberSent,
    /// A measurement says that it answers a command that was not sent yet.
    AnswersTheFuture {
        /// By so many commands.
        by: u64,
    },
    /// The connection breaks. Over UDP nobody is told.
    Closed,
    /// The far end hangs: what comes meanwhile is taken all at once afterwards, what it says is lost.
    Hangs {
        /// For so many ticks of the test.
        ticks: f64,
    },
    /// The specimen's clock is too fast or too slow, from the arming on.
    ClockDrift {
        /// By so many millionths.
        ppm: f64,
    },
    /// The request to arm is never answered.
    ArmingUnanswered,

    // At the actuator.
    /// The actuator stands still.
    Frozen,
    /// The actuator reaches the end of its stroke.
    Stroke {
        /// Either way, in m.
        disp_m: f64,
    },
    /// The actuator is not faster than this.
    Rate {
        /// Either way, in m/s.
        vel_m_per_s: f64,
    },
    /// The actuator has no more force than this, and stands when it meets it.
    ForceLimit {
        /// Either way, in N.
        force_n: f64,
    },
    /// The actuator is behind by whole commands.
    Lag {
        /// How many, 1 to 64.
        commands: usize,
    },
    /// The specimen is not where the test believes, and refuses to be armed.
    Elsewhere {
        /// How far away, in m.
        disp_m: f64,
    },

    // At the sensors.
    /// Sensors go on saying what they said last.
    Stuck {
        /// Which.
        #[serde(default)]
        channel: Channel,
    },
    /// Something is added to what the sensors say.
    Bias {
        /// In m.
        #[serde(default)]
        disp_m: f64,
        /// In N.
        #[serde(default)]
        force_n: f64,
    },
    /// The same, growing with every command.
    Drift {
        /// In m per command.
        #[serde(default)]
        disp_m: f64,
        /// In N per command.
        #[serde(default)]
        force_n: f64,
    },
    /// Noise, evenly distributed.
    Noise {
        /// Either way, in m.
        #[serde(default)]
        disp_m: f64,
        /// Either way, in N.
        #[serde(default)]
        force_n: f64,
    },
    /// Sensors read zero.
    Dropout {
        /// Which.
        #[serde(default)]
        channel: Channel,
    },
    /// Sensors are wired the wrong way round.
    Reversed {
        /// Which.
        channel: Channel,
    },
    /// The load cell reads this many times the force.
    Gain {
        /// Factor.
        factor: f64,
    },
    /// The load cell gives no number.
    NotANumber,

    // At the specimen's end as a whole.
    /// The interlock or emergency stop opens.
    Interlock,
    /// A sensor or actuator reports that it is at the end of its range.
    Saturated,
    /// The specimen's end says goodbye.
    Goodbye,

    // At the controller.
    /// The controller's loop stalls. Only in simulated time: a server cannot do that to its controller.
    ControllerStalls {
        /// For so many ticks.
        ticks: u64,
    },
}

/// What a test must make of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    /// The phases of the test, from "connected" to "safe".
    pub path: Vec<String>,
    /// Words that the reason for the end must have; absent where the test reaches its last step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The exit code of `gusset run`.
    pub exit: u8,
    /// Words that the far end must have said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub far_end: Option<String>,
}

/// Where in the laboratory a fault happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
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
pub(super) const MEMORY: usize = 64;

impl Kind {
    pub(super) const fn place(self) -> Place {
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
    pub fn word(self) -> String {
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
    pub(super) fn concerns(&self, number: u64) -> bool {
        let at = self.at.unwrap_or(0);
        number >= at && self.lasts.is_none_or(|lasts| number - at < lasts)
    }
}

impl Script {
    /// That it is played, for whoever watches a test or reads its record.
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
    pub(super) fn faults_at(&self, place: Place) -> Vec<Fault> {
        let all = self.fault.iter();
        all.filter(|fault| fault.kind.place() == place)
            .cloned()
            .collect()
    }
}
