//! [`Event`]: everything that can happen in a test, with the fields of its line in `events.jsonl`.
//!
//! A new event is one variant here and one row of [`crate::catalog::event`], which has its severity and its sentence. The name of
//! an event is that of its variant in snake_case. The loop makes only variants without text of its own, which need no memory.
//! Specimens, axes and degrees of freedom count from 0 here and from 1 in the file. A line that no variant fits is
//! [`Event::Other`]: a line of another version is kept, and shown by its name.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::super::miss::{Evidence, ON_MISS};
use super::super::{GridOf, MissCause};
use crate::catalog::event::{self, EventRow, Remark};
use crate::catalog::limit::{Limit, Scope};
use crate::catalog::phase::Phase;
use crate::substructure::LinkFault;

/// A word of the program: a constant where the program writes it, a text where it reads a file.
pub type Word = Cow<'static, str>;

/// What happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The first command is about to leave.
    Started,
    /// The grid of ticks begins: rows count their wall time (`release_s`) from this edge on.
    Grid {
        /// What happens on it.
        of: GridOf,
        /// Its first edge, ns of the loop's clock.
        first_edge_ns: u64,
    },
    /// The loop has ended and every specimen is retired.
    Ended,
    /// A deadline was missed.
    Miss {
        /// Cause as the loop knows it; the writer refines it.
        class: MissCause,
        /// Size of the miss.
        #[serde(default)]
        late_ns: u64,
        /// Whole ticks by which the grid was moved (0: the next edge stood).
        #[serde(default)]
        stretched: u64,
        /// What the system counted meanwhile, as the writer knows it.
        #[serde(flatten)]
        evidence: Option<Evidence>,
    },
    /// Outside of the ticks of the test no command left for this long, and so many ticks had none.
    Gap {
        /// How late the next one is.
        late_ns: u64,
        /// Ticks without a command.
        ticks: u64,
    },
    /// The measurement of a specimen was stale.
    Stale {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Age in commands.
        age: u64,
    },
    /// A measurement that was stale or late and never came by itself stood in the history of a later one.
    Recovered {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
        /// Commands from the one that it answers to the newest one.
        age: u64,
        /// The force that belongs to it, N: what the equilibrium of its step would have had.
        #[serde(with = "real")]
        force: f64,
    },
    /// The link of a specimen failed, or it could not be connected.
    Link {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Kind of the fault; none if the specimen was never connected.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        fault: Option<LinkFault>,
        /// What happened, in words.
        #[serde(default)]
        message: Word,
    },
    /// A specimen did not acknowledge the end of the test.
    Unacknowledged {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
    },
    /// The interlock of a specimen is open.
    Interlock {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
    },
    /// A sensor or actuator of a specimen is at the end of its range.
    Saturated {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
    },
    /// A specimen reports that its own watchdog holds it.
    SpecimenHolds {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
    },
    /// It still reports that, although commands come.
    SpecimenHoldsOn {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
    },
    /// The actuator–specimen iteration of a simulated actuator did not converge.
    Unsettled {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Ticks in which it did not, so far.
        ticks: u64,
    },
    /// The row of this tick found the queue full and is lost.
    RowLost,
    /// A displacement or force ceased to be finite or ran beyond the divergence bound.
    Diverged {
        /// Degree of freedom.
        #[serde(with = "from_one")]
        dof: u32,
    },
    /// The operator asked for the end of the test.
    StopRequested,
    /// The operator asked for a hold.
    HoldRequested,
    /// The operator let a held test go on.
    ContinueRequested,
    /// A continue named an earlier hold and was dropped: the latest hold remains.
    ContinueDropped {
        /// The hold that it named.
        hold: u32,
        /// The latest hold.
        latest: u32,
    },
    /// The operator confirmed what the sensors read before anything moves.
    Confirmed,
    /// Where an axis stands when a test is resumed.
    Stands(Standing),
    /// An axis of a resumed test does not stand where it was left.
    Moved(Standing),
    /// The wiring check is about to move a specimen a little and back.
    Probing {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
    },
    /// What the wiring check found of an axis.
    Direction {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
        /// Change of the measured displacement, m.
        #[serde(with = "real")]
        disp: f64,
        /// Change of the measured force, N.
        #[serde(with = "real")]
        force: f64,
    },
    /// Nothing showed which way round an axis is wired.
    DirectionUnknown {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
    },
    /// A load cell reads another force than before the interruption of its test.
    ForceChanged {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
        /// The expected reading: the last one, moved elastically to where the axis is found, in its own unit.
        #[serde(with = "real")]
        left: f64,
        /// What it reads now.
        #[serde(with = "real")]
        found: f64,
        /// How far it may differ, in its own unit.
        #[serde(with = "real")]
        within: f64,
        /// True if the difference is taken for drift of its zero.
        taken_for_drift: bool,
    },
    /// A specimen is wired the wrong way round, or does not answer as it must.
    Misfit {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
        /// In one word.
        what: Word,
    },
    /// A pose that the actuators of a specimen cannot take, or strokes without a pose.
    Geometry {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Actuator, where it is one alone.
        #[serde(
            rename = "axis",
            default,
            skip_serializing_if = "Option::is_none",
            with = "from_one_if_any"
        )]
        actuator: Option<u32>,
        /// In one word.
        what: Word,
    },
    /// The pace of the commands changed between two targets.
    Pace {
        /// From here.
        from: Word,
        /// To here.
        to: Word,
        /// Share of the step that was made.
        #[serde(with = "real")]
        share: f64,
    },
    /// The state of the test after this step, as one number.
    Checkpoint {
        /// Of its bits.
        #[serde(with = "hexadecimal")]
        digest: u64,
    },
    /// The test enters another phase.
    Phase {
        /// From here.
        from: Phase,
        /// To here.
        to: Phase,
        /// Why: `done`, `operator`, or what stopped it.
        #[serde(default)]
        cause: Word,
        /// The specimen that this came from, if from one.
        #[serde(
            rename = "specimen",
            default,
            skip_serializing_if = "Option::is_none",
            with = "from_one_if_any"
        )]
        port: Option<u32>,
    },
    /// The warm-up kept its ticks, by the last half of them: the test begins.
    Go(WarmUp),
    /// The warm-up did not keep them: the test does not begin.
    NoGo(WarmUp),
    /// A value is beyond the `warn` level of a limit.
    LimitWarning(LimitReached),
    /// A value is beyond the `trip` level of a limit, which ends the test.
    LimitTrip(LimitReached),
    /// An axis bears a force before the test moves it.
    InitialForce {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
        /// Reference of the allowed force: `yield_force_n`, `measured_force_n`, or `noise` if neither is known.
        of: Word,
        /// The force that its displacement does not explain, N at the specimen.
        #[serde(with = "real")]
        force: f64,
        /// The allowed force, N at the specimen.
        #[serde(with = "real")]
        most: f64,
    },
    /// What was read of one axis while zeroing, in its own units. Noise that too few readings show is not a number.
    Zeroed {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
        /// Mean displacement.
        #[serde(with = "real")]
        disp: f64,
        /// Mean force.
        #[serde(with = "real")]
        force: f64,
        /// Noise of the displacement (rms).
        #[serde(with = "real")]
        disp_noise_rms: f64,
        /// Noise of the force (rms).
        #[serde(with = "real")]
        force_noise_rms: f64,
    },
    /// The input files and the version of the program.
    Files {
        /// Hash by file name.
        sha256: Map<String, Value>,
        /// Version of the program; none in the first folders.
        #[serde(default)]
        version: Word,
    },
    /// The live page is served.
    LivePage {
        /// Where.
        address: String,
    },
    /// A specimen behind a link is connected.
    Connected {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Its server.
        peer: String,
        /// False if its measured displacement is the command.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        measures_disp: Option<bool>,
        /// The position that it reports, in words.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        standing: Option<String>,
    },
    /// A message with which the specimen's end closed the link.
    LastWords {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// The message.
        text: String,
    },
    /// The live page received a request.
    ControlRequest {
        /// Its name.
        request: String,
        /// Address of the browser.
        from: String,
        /// True if the loop got it.
        accepted: bool,
        /// Why it was refused.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        why: Option<Word>,
    },
    /// The live page refused a request without the control token.
    ControlRefused {
        /// Its name.
        request: String,
        /// Address of the browser.
        from: String,
        /// Why.
        why: Word,
        /// How often since the last such line.
        times: u64,
    },
    /// Rows are missing from `samples.bin`.
    RowsLost {
        /// Rows.
        rows_lost: u64,
        /// Because the queue was full.
        #[serde(default)]
        to_full_queue: u64,
        /// Because the file could not be written.
        #[serde(default)]
        to_file_error: u64,
    },
    /// A file of the run folder cannot be written.
    WriteFailed {
        /// Why.
        error: String,
        /// The file.
        file: Word,
        /// Rows lost so far.
        #[serde(default)]
        rows_lost: u64,
    },
    /// A file of the run folder can be written again.
    WriteRecovered {
        /// The file.
        file: Word,
        /// Rows lost so far.
        #[serde(default)]
        rows_lost: u64,
    },
    /// Another program changed or deleted a file of the run folder.
    RecordDamaged {
        /// The file.
        file: Word,
        /// What was done to it.
        text: String,
    },
    /// A server: a controller begins a test.
    Controller {
        /// Address of the controller.
        peer: String,
        /// Title of the test.
        test: String,
        /// Program and version of the controller.
        software: String,
    },
    /// A server: a limit or a fault ends the controller's test and latches.
    Trip {
        /// What happened, in words.
        text: String,
        /// Name of the cause.
        #[serde(default)]
        what: Word,
        /// Code of the cause, as in the column `trip`.
        #[serde(default)]
        code: u32,
        /// The value of a limit.
        #[serde(flatten)]
        limit: Option<TripValue>,
    },
    /// An event whose only field is a sentence.
    #[serde(untagged)]
    Said {
        /// Which event.
        event: Remark,
        /// The sentence.
        text: String,
    },
    /// An event that this version does not know, or a line of a known event with other fields.
    #[serde(untagged)]
    Other {
        /// Its name.
        #[serde(default)]
        event: String,
        /// Its fields.
        #[serde(flatten)]
        fields: Map<String, Value>,
    },
}

/// A limit and what was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LimitReached {
    /// Specimen. Of a limit of the whole test: the specimen with the largest share, where that can be said.
    #[serde(
        rename = "specimen",
        default,
        skip_serializing_if = "Option::is_none",
        with = "from_one_if_any"
    )]
    pub port: Option<u32>,
    /// Axis.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        with = "from_one_if_any"
    )]
    pub axis: Option<u32>,
    /// Its key in the test file.
    pub limit: Word,
    /// What was found, SI.
    #[serde(default = "unknown", with = "real")]
    pub value: f64,
    /// What is allowed, SI.
    #[serde(default = "unknown", with = "real")]
    pub bound: f64,
}

impl LimitReached {
    /// True for a limit of the test as a whole.
    #[must_use]
    pub fn is_of_test(&self) -> bool {
        let limit = Limit::of_key(&self.limit);
        limit.map_or(self.limit == ON_MISS, |limit| limit.scope() == Scope::Test)
    }
}

/// Where an axis of a resumed test stands, in its own unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// Specimen.
    #[serde(rename = "specimen", with = "from_one")]
    pub port: u32,
    /// Axis.
    #[serde(with = "from_one")]
    pub axis: u32,
    /// Where it stands.
    #[serde(with = "real")]
    pub found: f64,
    /// Where it was left.
    #[serde(with = "real")]
    pub left: f64,
    /// How far off it may be.
    #[serde(with = "real")]
    pub within: f64,
}

/// How well the warm-up kept its ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct WarmUp {
    /// Ticks that were judged.
    pub ticks: u64,
    /// Those that missed their deadline.
    pub missed: u64,
    /// The most of them in a row.
    pub in_a_row: u64,
    /// What a tick took on the average.
    pub mean_ns: u64,
    /// What the longest took.
    pub longest_ns: u64,
}

/// The value of a limit that ended a controller's test, in the unit that the line names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TripValue {
    /// Axis.
    #[serde(with = "from_one")]
    pub axis: u32,
    /// Unit.
    pub unit: Word,
    /// What was found.
    #[serde(with = "real")]
    pub value: f64,
    /// What is allowed.
    #[serde(with = "real")]
    pub bound: f64,
}

impl Event {
    /// An event whose only field is a sentence.
    #[must_use]
    pub fn said(event: Remark, text: impl Into<String>) -> Self {
        Self::Said {
            event,
            text: text.into(),
        }
    }

    /// The failed link of a specimen, from 0.
    #[must_use]
    pub const fn link_lost(port: u32, fault: LinkFault) -> Self {
        Self::Link {
            port,
            fault: Some(fault),
            message: Cow::Borrowed(fault.text()),
        }
    }

    /// The event of a line: of this name, with these fields.
    #[must_use]
    pub(super) fn read(name: &str, fields: &Map<String, Value>) -> Self {
        let mut tagged = Map::new();
        tagged.insert("event".to_owned(), name.into());
        tagged.extend(fields.clone());
        serde_json::from_value(Value::Object(tagged)).unwrap_or_else(|_| Self::Other {
            event: name.to_owned(),
            fields: fields.clone(),
        })
    }

    /// Its name and its fields, as its line has them.
    #[must_use]
    pub fn fields(&self) -> Map<String, Value> {
        match serde_json::to_value(self) {
            Ok(Value::Object(fields)) => fields,
            // An event is a map of plain values under names.
            _ => Map::new(),
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Other { event, .. } => event.clone(),
            _ => match self.fields().remove("event") {
                Some(Value::String(name)) => name,
                _ => String::new(),
            },
        }
    }

    /// Its row in the table of events; none for an event of another version.
    #[must_use]
    pub fn row(&self) -> Option<&'static EventRow> {
        event::find(&self.name())
    }

    /// The name of the trip that a resume must accept, if this event is one: the key of the limit, the fault of a computation
    /// that diverged, else the name of the event. A test that never began, and a lost link, leave no trip.
    #[must_use]
    pub fn latched(&self) -> Option<Word> {
        match self {
            Self::LimitTrip(reached) => Some(reached.limit.clone()),
            Self::Link { fault, .. } => match fault {
                Some(LinkFault::NotFinite) => Some(Cow::Borrowed("not_finite")),
                Some(LinkFault::Diverged) => Some(Cow::Borrowed("diverged")),
                _ => None,
            },
            Self::Misfit { .. } | Self::Moved(_) | Self::NoGo(_) | Self::Trip { .. } => None,
            _ => self.trip_row().map(|row| Cow::Borrowed(row.name)),
        }
    }

    /// Its row in the table, if it ends a test out of order.
    #[must_use]
    pub fn trip_row(&self) -> Option<&'static EventRow> {
        self.row().filter(|row| row.is_trip)
    }
}

const fn unknown() -> f64 {
    f64::NAN
}

/// A number; one that is not finite is null in the file, and NaN when it is read.
mod real {
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_f64(*value)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Option::<f64>::deserialize(from).map(|value| value.unwrap_or(f64::NAN))
    }
}

/// An index from 0 that counts from 1 in the file.
mod from_one {
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub fn serialize<S: Serializer>(index: &u32, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u64(u64::from(*index) + 1)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
        let number = u32::deserialize(from)?;
        number
            .checked_sub(1)
            .ok_or_else(|| D::Error::custom("counts from 1"))
    }
}

/// The same where there may be none.
mod from_one_if_any {
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref, clippy::ref_option)]
    pub fn serialize<S: Serializer>(index: &Option<u32>, to: S) -> Result<S::Ok, S::Error> {
        match index {
            Some(index) => super::from_one::serialize(index, to),
            None => to.serialize_none(),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
        let number = Option::<u32>::deserialize(from)?;
        Ok(number.and_then(|number| number.checked_sub(1)))
    }
}

/// 64 bits as 16 hexadecimal digits.
mod hexadecimal {
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub fn serialize<S: Serializer>(bits: &u64, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&format_args!("{bits:016x}"))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
        let digits = String::deserialize(from)?;
        u64::from_str_radix(&digits, 16).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::super::EventLine;
    use super::*;
    use crate::catalog::event::{EVENTS, Severity};
    use serde_json::json;

    /// A line of every variant, as folders have it; the server's lines of a name that a test has, too, come after.
    fn examples() -> Vec<Value> {
        let standing =
            json!({"specimen": 1, "axis": 2, "found": 0.5, "left": 0.25, "within": 0.125});
        let warm_up = json!({"ticks": 100, "missed": 2, "in_a_row": 1, "mean_ns": 9000, "longest_ns": 50_000});
        let reached = json!({"specimen": 1, "axis": 1, "limit": "measured_force_n", "value": 2.0, "bound": 1.0});
        let of = |name: &str, fields: &Value| {
            let mut line = json!({"event": name});
            let fields = fields.as_object().unwrap().clone();
            line.as_object_mut().unwrap().extend(fields);
            line
        };
        vec![
            json!({"event": "files", "sha256": {"test.toml": "ab"}, "version": "0.2.0"}),
            json!({"event": "warning", "text": "the record is short"}),
            json!({"event": "not_granted", "text": "locked memory"}),
            json!({"event": "live_page", "address": "127.0.0.1:8080"}),
            json!({"event": "connected", "specimen": 1, "peer": "rig 2.1", "measures_disp": false, "standing": "0.5"}),
            json!({"event": "connected", "text": "rig 2.1"}),
            json!({"event": "grid", "of": "opening", "first_edge_ns": 12}),
            json!({"event": "phase", "from": "running", "to": "tripped", "cause": "stale", "specimen": 1}),
            json!({"event": "zeroed", "specimen": 1, "axis": 1, "disp": 0.5, "force": 2.0, "disp_noise_rms": 0.125, "force_noise_rms": 0.5}),
            json!({"event": "initial_force", "specimen": 1, "axis": 1, "of": "noise", "force": 20.0, "most": 10.0}),
            json!({"event": "confirmed"}),
            json!({"event": "probing", "specimen": 1}),
            json!({"event": "probing", "text": "a small motion"}),
            json!({"event": "direction", "specimen": 1, "axis": 1, "disp": 0.5, "force": 2.0}),
            json!({"event": "direction", "text": "axis 1"}),
            json!({"event": "direction_unknown", "specimen": 1, "axis": 1}),
            json!({"event": "misfit", "specimen": 1, "axis": 1, "what": "wrong_sign"}),
            of("stands", &standing),
            of("moved", &standing),
            json!({"event": "force_changed", "specimen": 1, "axis": 1, "left": 0.5, "found": 2.0, "within": 0.25, "taken_for_drift": true}),
            of("go", &warm_up),
            of("no_go", &warm_up),
            json!({"event": "started"}),
            json!({"event": "checkpoint", "digest": "00ab00ab00ab00ab"}),
            json!({"event": "hold_requested"}),
            json!({"event": "continue_requested"}),
            json!({"event": "continue_dropped", "hold": 1, "latest": 2}),
            json!({"event": "stop_requested"}),
            json!({"event": "control_request", "request": "hold", "from": "127.0.0.1:1", "accepted": false, "why": "the test has ended"}),
            json!({"event": "control_refused", "request": "hold", "from": "127.0.0.1:1", "why": "no token", "times": 3}),
            json!({"event": "pace", "from": "correct", "to": "slow_down", "share": 0.5}),
            of("limit_warning", &reached),
            of("limit_trip", &reached),
            json!({"event": "interlock", "specimen": 1}),
            json!({"event": "saturated", "specimen": 1}),
            json!({"event": "geometry", "specimen": 1, "axis": 2, "what": "too_short"}),
            json!({"event": "diverged", "dof": 3}),
            json!({"event": "specimen_holds", "specimen": 1}),
            json!({"event": "specimen_holds", "text": "it holds"}),
            json!({"event": "specimen_holds_on", "specimen": 1}),
            json!({"event": "unsettled", "specimen": 1, "ticks": 4}),
            json!({"event": "unsettled", "text": "4 answers"}),
            json!({"event": "miss", "class": "taken_away", "late_ns": 120_000, "stretched": 1, "steal_ms": 10, "involuntary_switches": 0, "minor_faults": 2}),
            json!({"event": "miss", "class": "ours", "late_ns": 120_000, "stretched": 0}),
            json!({"event": "gap", "late_ns": 120_000, "ticks": 3}),
            json!({"event": "stale", "specimen": 1, "age": 2}),
            json!({"event": "recovered", "specimen": 1, "axis": 1, "age": 2, "force": 0.5}),
            json!({"event": "link", "specimen": 1, "fault": "timeout", "message": "no reply within the time limit"}),
            json!({"event": "link", "specimen": 1, "message": "connection refused"}),
            json!({"event": "link", "text": "the server is gone"}),
            json!({"event": "unacknowledged", "specimen": 1}),
            json!({"event": "last_words", "specimen": 1, "text": "it tripped"}),
            json!({"event": "last_words", "text": "it tripped"}),
            json!({"event": "row_lost"}),
            json!({"event": "rows_lost", "rows_lost": 3, "to_full_queue": 1, "to_file_error": 2}),
            json!({"event": "write_failed", "error": "no space left", "file": "samples.bin", "rows_lost": 3}),
            json!({"event": "write_recovered", "file": "samples.bin", "rows_lost": 3}),
            json!({"event": "record_damaged", "file": "samples.bin", "text": "samples.bin was cut"}),
            json!({"event": "internal_error", "text": "a panic"}),
            json!({"event": "ended"}),
            json!({"event": "controller", "peer": "127.0.0.1:1", "test": "frame", "software": "gusset 0.2.0"}),
            json!({"event": "armed_again", "text": "again"}),
            json!({"event": "holding", "text": "no command"}),
            json!({"event": "commands_again", "text": "they come"}),
            json!({"event": "limit", "text": "a warning"}),
            json!({"event": "trip", "text": "too far", "what": "measured_force_n", "code": 6, "axis": 1, "unit": "N", "value": 2.0, "bound": 1.0}),
            json!({"event": "trip", "text": "interlock", "what": "interlock", "code": 3}),
            json!({"event": "faults", "text": "played"}),
            json!({"event": "left_aside", "text": "a commit"}),
            json!({"event": "client_without_commits", "text": "none"}),
            json!({"event": "client_reset", "text": "reset"}),
            json!({"event": "counts", "text": "3 commands"}),
        ]
    }

    #[test]
    fn every_row_has_a_variant_and_every_variant_a_row_and_its_line_comes_back() {
        for example in examples() {
            let fields = example.as_object().unwrap();
            let event: Event = serde_json::from_value(example.clone()).unwrap();
            assert!(!matches!(event, Event::Other { .. }), "{example}");
            assert_eq!(&event.fields(), fields);
            assert!(event.row().is_some(), "{example}");
            // Its sentence needs no field that the line does not have.
            let sentence = EventLine::from(example.clone()).sentence();
            let is_silent = event.row().unwrap().severity == Severity::Debug;
            assert!(!sentence.is_empty() || is_silent, "{example}");
            let name = event.name();
            assert!(
                !sentence.starts_with(&format!("{} (", name.replace('_', " "))),
                "{sentence}"
            );
        }
        for row in EVENTS {
            let mut all = examples().into_iter();
            assert!(all.any(|line| line["event"] == row.name), "{}", row.name);
        }
    }

    #[test]
    fn a_line_of_another_version_keeps_its_name_and_its_fields() {
        let line = json!({"tick": 3, "time": 0.5, "wall": "2025-03-04T09:12:07Z", "clock_ns": 1, "event": "sang", "song": 4});
        let read = EventLine::from(line.clone());
        assert_eq!(
            (read.name(), read.tick, read.time),
            ("sang", Some(3), Some(0.5))
        );
        assert_eq!(Value::Object(read.to_map()), line);
        assert_eq!(read.sentence(), "sang (song 4)");
        // A known event with other fields.
        let read = EventLine::from(json!({"event": "stale", "since": 4}));
        assert!(matches!(read.event, Event::Other { .. }));
        assert_eq!(
            (read.name(), read.sentence().as_str()),
            ("stale", "stale (since 4)")
        );
    }

    #[test]
    fn a_number_that_is_none_is_null_in_the_file_and_nan_when_it_is_read() {
        let reached = LimitReached {
            port: Some(0),
            axis: Some(0),
            limit: "command_disp_m".into(),
            value: f64::NAN,
            bound: 0.1,
        };
        let fields = Event::LimitTrip(reached).fields();
        assert_eq!(fields["value"], Value::Null);
        match serde_json::from_value(Value::Object(fields)).unwrap() {
            Event::LimitTrip(read) => assert!(read.value.is_nan() && read.port == Some(0)),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn every_limit_goes_through_its_events_with_its_key_and_unit() {
        for limit in Limit::OF_AXIS.into_iter().chain(Limit::OF_TEST) {
            let reached = LimitReached {
                port: Some(1),
                axis: Some(0),
                limit: limit.key().into(),
                value: 3.0,
                bound: 2.0,
            };
            let is_of_test = limit.scope() == Scope::Test;
            assert_eq!(reached.is_of_test(), is_of_test, "{limit:?}");
            for event in [
                Event::LimitWarning(reached.clone()),
                Event::LimitTrip(reached.clone()),
            ] {
                let fields = event.fields();
                assert_eq!(fields["limit"], limit.key());
                let read = EventLine::from(Value::Object(fields));
                assert_eq!(read.event, event);
                let sentence = read.sentence();
                let unit = match limit.shown_unit() {
                    "1" => "",
                    unit => unit,
                };
                let found = format!("{} is 3 {unit}", limit.key());
                assert!(sentence.contains(found.trim_end()), "{sentence}");
            }
        }
    }

    #[test]
    fn a_sentence_names_the_specimen_and_rounds_its_numbers() {
        let sentence = |line: Value| EventLine::from(line).sentence();
        let trip = json!({"event": "limit_trip", "specimen": 1, "name": "column", "axis": 2, "limit": "measured_force_n", "value": 70_043.014_535, "bound": 7e4});
        assert_eq!(
            sentence(trip),
            "specimen \"column\", axis 2: TRIP: measured_force_n is 70.04 kN, allowed 70 kN"
        );
        let late = json!({"event": "limit_trip", "limit": "on_miss", "value": 0.0206, "bound": 1.0 / 1024.0});
        let words = sentence(late);
        for part in ["TRIP: ", "20.6 ms", "976.6 µs", "`timing.on_miss"] {
            assert!(words.contains(part), "no {part:?} in {words}");
        }
        let refused = json!({"event": "link", "specimen": 1, "name": "column", "message": "connection refused"});
        assert_eq!(
            sentence(refused),
            "specimen \"column\": could not be connected: connection refused"
        );
    }

    #[test]
    fn only_what_ends_a_test_is_a_trip() {
        let latched = |line: Value| EventLine::from(line).event.latched().map(Word::into_owned);
        let link = |fault: &str| json!({"event": "link", "specimen": 1, "fault": fault});
        assert_eq!(latched(link("closed")), None);
        assert_eq!(latched(link("not_finite")).as_deref(), Some("not_finite"));
        assert_eq!(
            latched(json!({"event": "interlock", "specimen": 1})).as_deref(),
            Some("interlock")
        );
        let trip = json!({"event": "limit_trip", "limit": "measured_force_n"});
        assert_eq!(latched(trip).as_deref(), Some("measured_force_n"));
        assert_eq!(
            latched(json!({"event": "stale", "specimen": 1, "age": 2})),
            None
        );
    }
}
