//! `summary.json`: how a run ended, with its peaks, timing, metrics and limits (guide: run-folder).

use std::collections::BTreeMap;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use super::MissClasses;
pub use super::in_order::InOrder;
pub use super::limit_facts::{ActuatorFacts, LimitFact, LimitFacts, LoadingFacts, SpecimenLimits};
use super::origin::Origin;
use super::rt::Granted;
use super::rt::timing::Timings;
use gusset_motion::metrics::Tracking;
use gusset_motion::metrics::falsified::Falsified;
pub use gusset_proof::RecordedVerdict;
pub use gusset_quantity::catalog::ending::Status;
use gusset_quantity::substructure::LinkStats;

/// Clock of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClockKind {
    /// The wall.
    #[default]
    Real,
    /// As fast as it goes.
    Simulated,
}

/// λ of the Gui family: a number, or `"inf"`, which JSON has no number for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lambda(pub f64);

impl Serialize for Lambda {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0 == f64::INFINITY {
            serializer.serialize_str("inf")
        } else {
            serializer.serialize_f64(self.0)
        }
    }
}

impl<'de> Deserialize<'de> for Lambda {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        match (value.as_f64(), value.as_str()) {
            (Some(number), _) => Ok(Self(number)),
            (None, Some("inf")) => Ok(Self(f64::INFINITY)),
            _ => Err(D::Error::custom(format!(
                "lambda is {value}, wanted a number or \"inf\""
            ))),
        }
    }
}

/// Largest magnitudes over the run, all DOFs whether recorded or not. For a resumed run they cover the whole test, the steps in
/// the other folder too. A value that does not exist or is not finite is null.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Peak {
    /// DOFs, from 1, that are rotations.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rotations: Vec<usize>,
    /// Per DOF, m; rad of a rotation.
    pub displacement: Vec<Option<f64>>,
    /// Per DOF, m/s or rad/s.
    pub velocity: Vec<Option<f64>>,
    /// Per DOF, m/s² or rad/s²; null for a massless DOF.
    pub acceleration: Vec<Option<f64>>,
    /// Per specimen by name, one value per axis, N.
    pub force: BTreeMap<String, Vec<Option<f64>>>,
}

/// The time of a gateway between targets: in the whole test, and where 5 to 95 % of ∫ a² dt of the targets is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimeBetweenTargets {
    /// In the whole test.
    pub whole: StageShares,
    /// In its strong part.
    pub strong_part: StageShares,
}

/// Shares of wall time, 0 to 1, and slow-downs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StageShares {
    /// Time in the laboratory, s.
    #[serde(default)]
    pub laboratory_s: f64,
    /// Towards a known target.
    pub correcting: f64,
    /// Along the prediction at full pace.
    pub predicting: f64,
    /// Slower, because the target was late.
    pub slowing: f64,
    /// At rest, because the target was late.
    pub holding: f64,
    /// Number of slow-downs.
    pub slow_downs: u64,
    /// Longest time from the begin of a slow-down to its target, s.
    pub longest_slow_down_s: f64,
}

/// Traffic with one specimen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LinkCounts {
    /// Commands sent.
    pub sent: u64,
    /// Measurements received in time.
    pub received: u64,
    /// Measurements that came after their deadline.
    pub late: u64,
    /// Commands never answered.
    pub lost: u64,
    /// Messages that could not be read.
    pub corrupt: u64,
    /// Messages that came more than once.
    #[serde(default)]
    pub duplicates: u64,
    /// Lost answers that were recovered from the history of a later one.
    #[serde(default)]
    pub recovered: u64,
    /// Commands that never arrived, as the server counts them.
    #[serde(default)]
    pub missed: u64,
    /// ICMP errors in a signed session over datagrams.
    #[serde(default)]
    pub unreachable: u64,
}

impl LinkCounts {
    /// Of this many commands, the measurements that came in time, and the counts of the link.
    #[must_use]
    pub const fn of(sent: u64, received: u64, stats: &LinkStats) -> Self {
        Self {
            sent,
            received,
            late: stats.late,
            lost: sent.saturating_sub(received + stats.late),
            corrupt: stats.corrupt,
            duplicates: stats.duplicates,
            recovered: stats.recovered,
            missed: stats.missed,
            unreachable: stats.unreachable,
        }
    }
}

/// A file that the test read and of which the folder has a copy.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// The copy, relative to the folder: `inputs/…`.
    pub path: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
}

/// Requests to the operating system and its answers. A test on the simulated clock makes none, and neither does a server.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Realtime {
    /// False where nothing was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub asked: Option<bool>,
    /// Content of a server's record, in words; only there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub role: Option<String>,
    /// UTC in ns at which the controller's test began; only in the record of a server.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub began_utc_ns: Option<u64>,
    /// Largest |displacement| of each axis in m; only in the record of a server.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_displacement_m: Option<Vec<Option<f64>>>,
    /// The answers.
    #[serde(flatten)]
    pub granted: Option<Granted>,
}

/// Largest demand of both ends of a member of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MemberDemand {
    /// Its name in the test file, or "member" and its number from 1.
    pub name: String,
    /// Demands of its start and its end: 1 where the member begins to yield. A demand that is not finite is null.
    pub demand: [Option<f64>; 2],
}

/// Content of `summary.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// How the run ended.
    pub status: Status,
    /// Why, in words.
    #[serde(deserialize_with = "gusset_quantity::text::words")]
    pub reason: String,
    /// Steps of integration done.
    pub steps: u64,
    /// Δt in s of test time.
    pub dt: f64,
    /// λ as used; null in a test without a structure.
    pub lambda: Option<Lambda>,
    /// The clock.
    pub clock: ClockKind,
    /// Wall time of the loop in s.
    pub wall_seconds: f64,
    /// Requested ticks per second of wall time.
    pub rate_hz: f64,
    /// Deadline misses, warm-up not counted.
    pub deadline_misses: u64,
    /// Whole ticks by which the grid was moved.
    pub stretched_ticks: u64,
    /// Largest magnitudes.
    pub peak: Peak,
    /// Per timing quantity: count, min, p50, p90, p99, p99_9, max in µs.
    pub timing: Option<Timings>,
    /// Requests to the system and its answers.
    pub realtime: Realtime,
    /// Traffic per specimen by name.
    pub link: BTreeMap<String, LinkCounts>,
    /// How a gateway that keeps its specimen moving has spent its time. Null of every other test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between_targets: Option<TimeBetweenTargets>,
    /// Version of this program.
    pub version: String,
    /// `[about]` of the test file: who tests what.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<Value>,
    /// Its time, its machine and its program. Older runs lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    /// Rows that are not in `samples.bin`.
    #[serde(default)]
    pub rows_lost: u64,
    /// The files that the test read.
    #[serde(default)]
    pub inputs: Vec<InputFile>,
    /// Deadline misses by class.
    #[serde(default)]
    pub miss_classes: MissClasses,
    /// Warnings for the user.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// The limits, who checked them, and the effect of a trip.
    #[serde(default)]
    pub limits: Option<LimitFacts>,
    /// The machine that the test ran on, by topic: what its own files say.
    #[serde(default)]
    pub machine: Option<InOrder<String>>,
    /// Tracking metrics by specimen, one entry per axis, each with its noise floor; null before they are known. They cover the rows
    /// in this folder, as the whole-test errors do: no steps that are in another one.
    #[serde(default)]
    pub metrics: Option<InOrder<Vec<Option<Tracking>>>>,
    /// Why metrics are null though an axis may have moved, in words: rows were lost. Empty where nothing is missing.
    #[serde(default)]
    pub metrics_missing: Vec<String>,
    /// Errors that the transfer systems introduced into the test as a whole, each number with its noise floor: energy error in
    /// J and as a share, and per mode its frequency, damping ratio and the damping that the delays added. Null in a test
    /// without a structure.
    #[serde(default)]
    pub falsified: Option<Falsified>,
    /// Final position of each specimen, by name. `reached`: where the test file wants it. `not_reached`. `stayed`: at its
    /// last command, because the file requests no other, or because its direction, zero or position was not known yet.
    /// `lost`: its link is gone, and its position depends on its own end.
    #[serde(default)]
    pub left: BTreeMap<String, String>,
    /// Largest |force| before t = 0, zeroing, ramp, static load and warm-up included, whose rows are kept only where they
    /// mattered: per specimen by name, one value per axis, N. Of a test that made no step it is all there is; in `peak` are
    /// steps, and the corrections of a static load.
    #[serde(default)]
    pub force_on_the_way_in: BTreeMap<String, Vec<Option<f64>>>,
    /// Findings that would have refused the test, and that the user has accepted: the name of each override and the reason given.
    #[serde(default)]
    pub accepted: BTreeMap<String, String>,
    /// The verdict of `check` on the test; null where there is no verdict, and in folders of earlier versions.
    #[serde(default)]
    pub verdict: Option<RecordedVerdict>,
    /// Why, as events spell it: of a limit its key. Older runs lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
    /// Demands of the members of a frame that can yield.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<MemberDemand>,
}

#[cfg(any(test, feature = "test-doubles"))]
impl From<Value> for Summary {
    /// The summary of a test that did nothing, with these entries.
    fn from(entries: Value) -> Self {
        let mut summary = serde_json::json!({
            "status": "completed", "reason": "", "steps": 0, "dt": 0.0, "lambda": null, "clock": "real", "wall_seconds": 0.0,
            "rate_hz": 0.0, "deadline_misses": 0, "stretched_ticks": 0, "peak": {}, "timing": null, "realtime": {}, "link": {},
            "version": "0.0.0",
        });
        for (key, value) in entries.as_object().cloned().unwrap_or_default() {
            summary[key] = value;
        }
        serde_json::from_value(summary).expect("a summary")
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn example() -> Summary {
        Summary {
            status: Status::Completed,
            reason: "end of the record".to_owned(),
            steps: 40,
            dt: 0.01,
            lambda: Some(Lambda(4.75)),
            clock: ClockKind::Simulated,
            wall_seconds: 0.25,
            rate_hz: 100.0,
            deadline_misses: 0,
            stretched_ticks: 0,
            peak: Peak {
                rotations: vec![2],
                displacement: vec![Some(0.5), Some(0.1)],
                velocity: vec![Some(1.0), Some(f64::NAN)],
                acceleration: vec![Some(2.0), None],
                force: BTreeMap::from([("brace".to_owned(), vec![Some(1e3)])]),
            },
            timing: None,
            realtime: Realtime::default(),
            between_targets: None,
            link: BTreeMap::from([("brace".to_owned(), LinkCounts::default())]),
            version: "0.1.0".to_owned(),
            about: None,
            origin: None,
            rows_lost: 0,
            inputs: Vec::new(),
            miss_classes: MissClasses::default(),
            warnings: Vec::new(),
            limits: None,
            machine: None,
            metrics: None,
            metrics_missing: Vec::new(),
            falsified: None,
            left: BTreeMap::new(),
            force_on_the_way_in: BTreeMap::new(),
            accepted: BTreeMap::new(),
            verdict: None,
            cause: Some("done".to_owned()),
            members: Vec::new(),
        }
    }

    #[test]
    fn summary_has_the_documented_keys() {
        let json = serde_json::to_value(example()).unwrap();
        let keys: Vec<&str> = json
            .as_object()
            .unwrap()
            .keys()
            .map(String::as_str)
            .collect();
        let documented = [
            "status",
            "reason",
            "steps",
            "dt",
            "lambda",
            "clock",
            "wall_seconds",
            "rate_hz",
            "deadline_misses",
            "stretched_ticks",
            "peak",
            "timing",
            "realtime",
            "link",
            "version",
        ];
        let additions = [
            "rows_lost",
            "inputs",
            "miss_classes",
            "warnings",
            "limits",
            "machine",
            "metrics",
            "metrics_missing",
            "falsified",
            "left",
            "force_on_the_way_in",
            "accepted",
            "verdict",
            "cause",
        ];
        assert_eq!(keys, [&documented[..], &additions[..]].concat());
        assert_eq!(
            (&json["status"], &json["clock"]),
            (&"completed".into(), &"simulated".into())
        );
        assert_eq!(json["peak"]["acceleration"][1], Value::Null);
        assert_eq!(json["peak"]["velocity"][1], Value::Null, "not finite");
        assert_eq!(json["peak"]["force"]["brace"][0], 1e3);
        assert_eq!(json["link"]["brace"]["corrupt"], 0);
        for (status, word) in [
            (Status::Stopped, "stopped"),
            (Status::Interrupted, "interrupted"),
            (Status::Failed, "failed"),
        ] {
            assert_eq!(serde_json::to_value(status).unwrap(), word);
        }
    }

    #[test]
    fn demands_of_members_are_read_as_they_were_written() {
        let member = MemberDemand {
            name: "beam 1".to_owned(),
            demand: [Some(1.7), Some(f64::NAN)],
        };
        let summary = Summary {
            members: vec![member],
            ..example()
        };
        let json = serde_json::to_value(summary).unwrap();
        let written = serde_json::json!([{ "name": "beam 1", "demand": [1.7, null] }]);
        assert_eq!(json["members"], written);
        let read: Summary = serde_json::from_value(json).unwrap();
        assert_eq!(read.members[0].demand, [Some(1.7), None]);
    }

    #[test]
    fn requests_are_read_as_they_were_written() {
        let granted = serde_json::json!({
            "complete": false, "required": true, "cpu": null,
            "features": [{"want": "policy", "asked": "SCHED_FIFO, priority 80", "granted": false, "errno": 1, "reason": "EPERM",
                "advice": null}],
            "spin": {"asked_us": 60.0, "used_us": 0.5, "throttle": {"runtime_us": null, "period_us": 1_000_000}, "note": "spins"},
        });
        let served = serde_json::json!({
            "asked": false, "role": "served", "began_utc_ns": 17, "peak_displacement_m": [0.5, null],
        });
        for written in [serde_json::json!({ "asked": false }), granted, served] {
            let read: Realtime = serde_json::from_value(written.clone()).unwrap();
            assert_eq!(serde_json::to_string(&read).unwrap(), written.to_string());
        }
    }

    #[test]
    fn lambda_is_a_number_infinite_or_absent() {
        for (lambda, text) in [
            (Some(Lambda(f64::INFINITY)), "\"inf\""),
            (Some(Lambda(4.0)), "4.0"),
            (None, "null"),
        ] {
            assert_eq!(serde_json::to_string(&lambda).unwrap(), text);
            assert_eq!(
                serde_json::from_str::<Option<Lambda>>(text).unwrap(),
                lambda
            );
        }
        assert!(serde_json::from_str::<Lambda>("\"many\"").is_err());
    }
}
