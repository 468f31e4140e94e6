//! `[safety]`: how a test begins, what ends it, and how its specimens are left.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::control::limits::BoundSpec;

/// How a test begins, what ends it, and how its specimens are left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyTable {
    /// Displacement of any DOF of the structure in m beyond which the test counts as diverged and stops. A value that is
    /// not finite always stops it. Absent: ten times the largest displacement of the rehearsal, but at least 0.1 m, if a
    /// specimen is behind a link, the loop is not found unstable and the rehearsal reached the end of the test. Else 1000.
    /// A measured displacement beyond 1000 always trips.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub divergence_m: Option<f64>,
    /// Wall time in s over which every sensor is averaged before anything moves, while the specimens hold where they
    /// stand, at most 600. Answers that stay away are not averaged: it takes so much longer. 0: not at all. Absent: 0.2 if a
    /// specimen is behind a link or a channel is relative, else 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero_s: Option<f64>,
    /// Whether the operator must confirm what was read, which must then be something: not with a `zero_s` of 0. Where nothing is
    /// read, as of computed specimens without a `zero_s`, nobody is asked. Where a channel takes its zero from it, he must in any
    /// case.
    pub confirm: bool,
    /// Shortest wall time in s in which a specimen is moved to where the test begins, and in which a static load comes on;
    /// longer where half of a velocity limit would be passed, and at least 1 s on the way from where a specimen says that it
    /// stands if it has no such limit. Nobody is moved before every specimen has answered. A static load takes longer, too, where
    /// an actuator lags: after each part of it every specimen comes to rest first. At most 3600.
    pub ramp_s: f64,
    /// Wall time in s in which a hold brings the specimens to rest, and in which they come to the test's pace again; the first
    /// steps after a resumed test's start are eased in the same way. What a compensator is ahead by changes no faster than that,
    /// also where a late target slows the test down. 0: at once, at the next tick. At most 600.
    pub ease_s: f64,
    /// Where the specimens are left after a trip. "zero_force" needs a stiffness of every axis. One that cannot be relied on is not
    /// moved, whatever is chosen: its link is lost, its answers stay away, its interlock is open, or it reports a sensor or actuator
    /// at the end of its range. On the way of "zero_force" all axes go together, as the stiffness has it, until the forces are
    /// small (1 % of the largest) and still. The specimen stays where `sensor_force_n` tripped, or where the force has jumped by
    /// more than `force_step_n` and not come back: there is no force to go by. The way ends where the force does not follow the
    /// motion, grows, or is gone at once, and after 120 s, or three times what it takes by the stiffness. The ways to a displacement
    /// need no force. What tripped stops the way out only if it gets worse by 5 % or is crossed on its other side. While an actuator
    /// only goes on to where its last command has sent it, neither its displacement and following error nor a force of its specimen
    /// stop it; any other limit that trips on the way leaves all specimens where
    /// they are.
    pub on_trip: ExitChoice,
    /// Where they are left after the last step, or when the operator ends the test. A test that ends in motion stops there at once,
    /// whatever acceleration that is; a hold before the end eases it. Of the stop the far end of a link of our own protocol is told;
    /// the server of another one may trip on it by a limit of its own.
    pub at_end: ExitChoice,
    /// `gusset run --resume`: how far in m, at the specimen, each axis may stand from where it was left. Absent: half as much
    /// again as it was ever off its command; after a kill or an internal error, or where it was lost, also the way of its last
    /// commands in 0.05 s, or of one command where that is longer, since as much of the record can be lost. An axis that stands
    /// elsewhere is refused, unless `--accept-changed` gives a reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resume_within_m: Option<f64>,
    /// `gusset run --resume`: how far in N, at the specimen, the force of each axis may differ from the last one of the interrupted
    /// test. Absent: 2 % of the recorded peak force, and five times the noise of the load cell: as declared, else as measured
    /// before the test. Where the displacement differs too, the force is expected to differ by the initial stiffness times that. After a
    /// kill the specimen may have yielded on the way of the lost commands: a force between the two passes as well. What differs by more
    /// is refused, unless `--accept-changed` gives a reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resume_within_n: Option<f64>,
    /// `gusset run --resume`: whether a load cell with a relative zero takes what it reads now beyond its last reading for drift
    /// of its zero. Else the old zero holds, and the difference is told: what was left in motion has lost a real force.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub resume_takes_force_drift: bool,
    /// Largest speed in m/s of the specimen on the way there, at least 1e-6; needed for every way but "freeze".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exit_speed_m_per_s: Option<f64>,
    /// Share of the room for stability that tangents beyond their declared bounds use up, by the estimates of all axes:
    /// below 1 the integration is stable. Absent: warned of beyond 1. Known where the proof of stability is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stability_used: Option<BoundSpec>,
    /// Lag of a specimen in parts of the critical delay at its stiffness, both as fitted over the last seconds of motion: the worst
    /// of all axes, after two periods of motion; at 1 the margin is used up and the test grows. The critical delay is that of a
    /// linear structure with one axis late at a time, in continuous time, with gaps as they are at rest and dampers as small motions
    /// find them: what only a damper of a power beyond 1 holds goes beyond 1 here, and may stay small all the same. Absent: warned of beyond 1. Known of specimens with a
    /// `transfer`, a `compensation` or a bound of their lag, of all if it is given, in structures that are small enough to tabulate
    /// it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_used: Option<BoundSpec>,
    /// What the exact audit of the steps leaves over, in parts of the energy turned over: roundoff unless the program is at
    /// fault. Absent: warned of beyond 1e-9, and the test stops beyond 1e-6, for structures of up to 64 DOFs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_audit: Option<BoundSpec>,
    /// Energy that the transfer systems of all specimens have added because they are not where they should be, in parts of the
    /// energy that the test has taken in so far: the work of loads and base, and the largest kinetic energy. Absent: not
    /// bounded. `added_energy_j` at a specimen's limits bounds one axis in J.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub added_energy_share: Option<ShareSpec>,
    /// Why a specimen behind a link may be without a trip level of `command_disp_m` and `measured_force_n`; without a reason
    /// such a test is refused. Limits that are given hold all the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unlimited: Option<String>,
    /// Why a test whose loop is unstable, or whose method has no proof of stability, may move a specimen behind a link.
    /// Without a reason `run` refuses such a test. The reason is written to the summary and the report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accept_unstable: Option<String>,
    /// Why a test may move a specimen behind a link although its rehearsal diverges, stops early, trips a limit or needs more
    /// than a capacity. Without a reason `run` refuses such a test. The reason is written to the summary and the report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accept_trip: Option<String>,
}

impl Default for SafetyTable {
    fn default() -> Self {
        Self {
            divergence_m: None,
            zero_s: None,
            confirm: false,
            ramp_s: 1.0,
            ease_s: 0.25,
            on_trip: ExitChoice::Freeze,
            at_end: ExitChoice::Freeze,
            resume_within_m: None,
            resume_within_n: None,
            resume_takes_force_drift: false,
            exit_speed_m_per_s: None,
            stability_used: None,
            delay_used: None,
            step_audit: None,
            added_energy_share: None,
            unlimited: None,
            accept_unstable: None,
            accept_trip: None,
        }
    }
}

impl SafetyTable {
    /// Keys that are given and judge the specimens by their measured displacements.
    pub fn needing_measured_disp(&self) -> impl Iterator<Item = &'static str> {
        [
            ("delay_used", self.delay_used.is_some()),
            ("added_energy_share", self.added_energy_share.is_some()),
        ]
        .into_iter()
        .filter_map(|(key, is_given)| is_given.then_some(key))
    }

    /// True if it says more than why a specimen is without limits.
    #[must_use]
    pub fn bounds_a_test(&self) -> bool {
        let rest = Self {
            unlimited: None,
            ..self.clone()
        };
        rest != Self::default()
    }
}

/// Levels of a share of energy; at least one of them is given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShareSpec {
    /// Beyond this share an event is written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warn: Option<f64>,
    /// Beyond this share the test ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trip: Option<f64>,
    /// J that count as taken in from the start: a test that has hardly begun must not trip over a trifle.
    pub floor_j: f64,
}

impl ShareSpec {
    /// The levels alone.
    #[must_use]
    pub const fn levels(self) -> BoundSpec {
        BoundSpec {
            warn: self.warn,
            trip: self.trip,
        }
    }
}

/// Where a specimen is left. Driving a damaged one home can destroy it: everything but "freeze" is asked for by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExitChoice {
    /// Where it is.
    #[default]
    Freeze,
    /// Where its forces are small, by their means over twice 0.05 s: a hundredth of the largest of the test, but for the measurement
    /// that tripped it, or within the noise. While answers stay away it rests.
    ZeroForce,
    /// At zero deformation.
    ZeroDisplacement,
    /// At its `safe_disp_m`.
    SafeDisplacement,
}

impl ExitChoice {
    /// As the file spells it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            ExitChoice::Freeze => "freeze",
            ExitChoice::ZeroForce => "zero_force",
            ExitChoice::ZeroDisplacement => "zero_displacement",
            ExitChoice::SafeDisplacement => "safe_displacement",
        }
    }
}

/// Whether a channel keeps its declared zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ZeroChoice {
    /// The declared offset holds; what is read before the test is only told.
    #[default]
    Absolute,
    /// What is read before the test is the zero.
    Relative,
}
