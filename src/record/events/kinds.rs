//! [`Event`]: everything that can happen in a test, with the fields of its line in `events.jsonl`.
//!
//! A new event is one variant here and one row of [`gusset_quantity::catalog::event`], which has its severity and its sentence. The name of
//! an event is that of its variant in snake_case. The loop makes only variants without an own text, which allocate nothing.
//! Specimens, axes and degrees of freedom count from 0 here and from 1 in the file. A line that no variant fits is
//! [`Event::Other`]: a line of another version is kept, and shown by its name.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::encoding::{from_one, from_one_if_any, hexadecimal, real};
use super::payload::{LimitReached, Ready, Standing, TripValue, WarmUp, Word};
use crate::checksum::Checksum;
use crate::miss::Evidence;
use crate::origin::Origin;
use crate::{GridOf, MissCause};
use gusset_quantity::catalog::event::{self, EventRow, Remark};
use gusset_quantity::catalog::phase::Phase;
use gusset_quantity::substructure::LinkFault;

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
        /// Cause as the loop knows it; the writer refines it. The first records named it `cause`.
        #[serde(alias = "cause")]
        class: MissCause,
        /// Size of the miss.
        #[serde(default)]
        late_ns: u64,
        /// Whole ticks by which the grid was moved (0: the next edge stayed).
        #[serde(default)]
        stretched: u64,
        /// Counters of the system around the miss, from the writer.
        #[serde(flatten)]
        evidence: Option<Evidence>,
    },
    /// No command was sent for a time outside of the steps of the test.
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
    /// A missing measurement arrived within the history of a later one.
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
    /// The operator requested the end of the test.
    StopRequested,
    /// The operator requested a hold.
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
    /// Position or force of an axis when a test is resumed.
    Stands(Standing),
    /// An axis of a resumed test has moved since it was interrupted.
    Moved(Standing),
    /// The wiring check is about to move a specimen a little and back.
    Probing {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
    },
    /// Result of the wiring check for one axis.
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
    /// The wiring check found a difference that the user accepts.
    WiringAccepted {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// Axis.
        #[serde(with = "from_one")]
        axis: u32,
        /// The fault in one word.
        what: Word,
    },
    /// An interrupted motion went back to where it began.
    Retraced {
        /// Specimen.
        #[serde(rename = "specimen", with = "from_one")]
        port: u32,
        /// How it ended.
        what: Word,
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
        /// Present reading.
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
        /// Digest of its bits.
        #[serde(with = "hexadecimal")]
        digest: u64,
        /// SHA-256 of the file that holds the state; `None` if no file was written.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sha256: Option<Checksum>,
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
    /// An axis has a force before the test moves it.
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
    /// Readings of one axis during zeroing, in its own units. Noise is not a number if there are too few readings.
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
        /// Where the run comes from; none in older folders.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        origin: Option<Box<Origin>>,
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
        #[serde(default)]
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
        /// Description of the damage.
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
    /// A server: the specimen is ready for the first command of a controller's test.
    Ready(Box<Ready>),
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
        /// Kind of remark.
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
    pub(crate) fn fields(&self) -> Map<String, Value> {
        match serde_json::to_value(self) {
            Ok(Value::Object(fields)) => fields,
            // An event is a map of plain values under names.
            _ => Map::new(),
        }
    }

    /// Its name.
    #[must_use]
    pub(crate) fn name(&self) -> String {
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
            // There may be one in every tick, and the name of an event is found by writing it.
            Self::Miss { .. } | Self::Stale { .. } | Self::Recovered { .. } => None,
            _ => self.trip_row().map(|row| Cow::Borrowed(row.name)),
        }
    }

    /// Its row in the table, if it ends a test out of order.
    #[must_use]
    pub fn trip_row(&self) -> Option<&'static EventRow> {
        self.row().filter(|row| row.is_trip)
    }
}

#[cfg(test)]
mod tests;
