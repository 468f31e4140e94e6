//! `[safety]`: startup of a test, limits of the whole test, and the end position of its specimens.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::levels::BoundSpec;

/// Default of `divergence_m` in m, and the trip level of a measured displacement without another one. No structure moves as far as this:
/// such a response is one of the integration.
pub const DIVERGENCE_M: f64 = 1e3;

/// Startup of a test, limits of the whole test, and the end position of its specimens. More: guide,
/// limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyTable {
    /// Largest displacement of any DOF of the structure. Beyond it the test counts as diverged and
    /// stops. Default: 1000 m. With `link` on the real clock it is ten times the peak of the rehearsal,
    /// at least 0.1 m. This requires a stable loop and a complete rehearsal.
    #[schemars(example = 0.5)]
    pub divergence_m: Option<f64>,
    /// Wall time over which all sensors are averaged before anything moves, at most 600 s. The
    /// specimens hold meanwhile. 0 skips it. Default: 0.2 s with `link` or a relative zero,
    /// otherwise 0.
    pub zero_s: Option<f64>,
    /// If true, the operator must confirm the averaged readings before anything moves. `zero_s`
    /// must not be 0 then. A relative zero always needs a confirmation.
    #[schemars(example = true)]
    pub confirm: bool,
    /// Shortest wall time of the move to the start of the test, and of applying the static load, at
    /// most 3600 s. The time is longer if the speed would exceed half of a velocity limit. Without
    /// such a limit, the move takes at least 1 s.
    #[schemars(example = 5.0)]
    pub ramp_s: f64,
    /// Wall time of the hold ramp, at most 600 s. A hold brings the specimens to rest in this time,
    /// and a continued or resumed test returns to its pace in it. 0 stops at the next tick.
    #[schemars(example = 1.0)]
    pub ease_s: f64,
    /// End position of the specimens after a trip. Every choice but "freeze" moves them and
    /// requires `exit_speed_m_per_s`. A specimen with a lost link, an open interlock or a saturated
    /// sensor or actuator never moves. More: guide, limits.
    #[schemars(example = &"zero_force")]
    pub on_trip: ExitChoice,
    /// End position of the specimens after the last step, or after the operator stops the test.
    /// Every choice but "freeze" requires `exit_speed_m_per_s`. A test that is still in motion at
    /// its last step stops abruptly; a hold before the end avoids that.
    #[schemars(example = &"zero_displacement")]
    pub at_end: ExitChoice,
    /// Largest difference between the position of an axis at `gusset run --resume` and its last
    /// position, at the specimen. Default: 1.5 times the largest following error; after a kill also
    /// the motion of the last 0.05 s. `--accept-changed` accepts a larger difference.
    #[schemars(example = 0.0005)]
    pub resume_within_m: Option<f64>,
    /// Largest difference between the force of an axis at `gusset run --resume` and its last force,
    /// at the specimen. Default: 2 % of the recorded peak force plus five times the noise. A change
    /// of position adds its elastic force. `--accept-changed` accepts a larger difference.
    #[schemars(example = 500.0)]
    pub resume_within_n: Option<f64>,
    /// If true, `gusset run --resume` treats a changed reading of a load cell with a relative zero
    /// as drift of that zero. If false, the old zero stays valid and the difference is a real
    /// force. Default: false.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub resume_takes_force_drift: bool,
    /// Largest speed of a specimen on the move to its end position, at least 1e-6. Required by
    /// every end position but "freeze".
    #[schemars(example = 0.001)]
    pub exit_speed_m_per_s: Option<f64>,
    /// Stability margin used by tangents that exceed their declared bounds, estimated from all
    /// axes. Below 1 the integration is stable. Default: a warning above 1. Not available without a
    /// proof of stability.
    #[schemars(example = serde_json::json!({"warn": 0.8, "trip": 1.0}))]
    pub stability_used: Option<BoundSpec>,
    /// Lag of a specimen divided by its critical delay, for the worst axis, over the last seconds
    /// of motion. At 1 the response of a linear structure grows. Default: a warning above 1. More:
    /// guide, mathematics-coupling.
    #[schemars(example = serde_json::json!({"warn": 0.7, "trip": 1.0}))]
    pub delay_used: Option<BoundSpec>,
    /// Residual of the energy audit of the steps, divided by the exchanged energy. It is only
    /// roundoff, unless the program has an error. Default: a warning above 1e-9 and a trip above
    /// 1e-6, for up to 64 DOFs.
    #[schemars(example = serde_json::json!({"warn": 1.0e-9, "trip": 1.0e-6}))]
    pub step_audit: Option<BoundSpec>,
    /// Energy added by the tracking errors of all specimens, divided by the energy input so far.
    /// The input is the work of loads and base motion, plus the largest kinetic energy. Default: no
    /// limit. `limits.added_energy_j` limits a single axis.
    pub added_energy_share: Option<ShareSpec>,
    /// Unbalance of the DOFs without mass, as a share of the largest forces on them. They follow the
    /// others statically. The limit judges the least of the last six steps. Default: a warning above
    /// 1e-3 and a trip above 1e-2.
    #[schemars(example = serde_json::json!({"warn": 1.0e-3, "trip": 1.0e-2}))]
    pub static_unbalance: Option<BoundSpec>,
    /// Reason why a specimen with `link` may move without trip levels of `command_disp_m` and
    /// `measured_force_n`. Without a reason, such a test is refused. All other limits stay active.
    #[schemars(example = &"Elastic specimen; the servo controller has its own limits")]
    pub unlimited: Option<String>,
    /// Reason why a test may move a specimen with `link` although its loop is unstable or stability
    /// is not proven. Without a reason, `run` refuses such a test. The reason is written to the
    /// summary and the report.
    #[schemars(example = &"Stability is shown by the identified tangent, see the test plan")]
    pub accept_unstable: Option<String>,
    /// Reason why a test may move a specimen with `link` although its rehearsal diverges, stops
    /// early, trips or exceeds a capacity. Without a reason, `run` refuses such a test. The reason
    /// is written to the summary and the report.
    #[schemars(example = &"The rehearsal trips only at the end, where the specimen may fail")]
    pub accept_trip: Option<String>,
    /// Reason why a test may move a specimen whose stiffness in the wiring check differs from
    /// `stiffness_n_per_m`. It differs by a ratio outside 1/2 to 2, or by another coupling. Opposite
    /// signs are always refused. The reason is written to the summary and the report.
    #[schemars(example = &"The specimen is cracked; its stiffness is a third of the estimate")]
    pub accept_wiring: Option<String>,
    /// Reason why a specimen with `link` that resists velocity may move at other velocities than
    /// those of the test. They differ if `time.scale` is not 1 / `similitude.time`, or if a gateway
    /// rests at each target. Without a reason, `run` and `serve` refuse such a specimen. The reason
    /// is written to the summary and the report.
    #[schemars(example = &"The damping of the specimen is below 0.5 % of critical")]
    pub accept_speed: Option<String>,
    /// Error of a largest drift from which the test has a finding, as a share of this drift. It holds
    /// for the error of the method and for the error of the coupling.
    #[schemars(example = 0.05)]
    pub error_warn: f64,
    /// Error of a largest drift from which a test with `link` is refused, as a share of this drift. It
    /// must not be less than `error_warn`.
    #[schemars(example = 0.2)]
    pub error_refuse: f64,
    /// Reason why a test may move a specimen with `link` although an error exceeds `error_refuse`, or
    /// its actuators take all damping from a mode. Without a reason, `run` refuses such a test. The
    /// reason is written to the summary and the report.
    #[schemars(example = &"The test studies the effect of the delay")]
    pub accept_error: Option<String>,
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
            static_unbalance: None,
            added_energy_share: None,
            unlimited: None,
            accept_unstable: None,
            accept_trip: None,
            accept_wiring: None,
            accept_speed: None,
            error_warn: 0.05,
            error_refuse: 0.2,
            accept_error: None,
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

    /// True if it says more than the reasons that a server knows, too.
    #[must_use]
    pub(crate) fn bounds_a_test(&self) -> bool {
        let rest = Self {
            unlimited: None,
            accept_wiring: None,
            accept_speed: None,
            ..self.clone()
        };
        rest != Self::default()
    }
}

/// Levels of an energy ratio. Give `warn`, `trip` or both.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShareSpec {
    /// Beyond this ratio, the controller writes an event.
    #[schemars(example = 0.05)]
    pub warn: Option<f64>,
    /// Beyond this ratio, the specimens hold and the test ends.
    #[schemars(example = 0.1)]
    pub trip: Option<f64>,
    /// Energy that is added to the energy input from the start. It prevents a trip while the test
    /// has hardly begun.
    #[schemars(example = 1.0)]
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

/// End position of a specimen. A move can destroy a damaged specimen, so the default is "freeze".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExitChoice {
    /// Current position. The specimen does not move.
    #[default]
    Freeze,
    /// Position with zero force: all axes move together until their mean forces are below 1 % of
    /// the largest force, or within the noise. Each axis needs a stiffness. The move stops if the
    /// force does not follow. It lasts at most 120 s, or three times the expected time if that is
    /// longer.
    ZeroForce,
    /// Position with zero deformation.
    ZeroDisplacement,
    /// Position given by `safe_disp_m` of the specimen.
    SafeDisplacement,
}

impl ExitChoice {
    /// As the file spells it.
    #[must_use]
    pub(crate) const fn word(self) -> &'static str {
        match self {
            ExitChoice::Freeze => "freeze",
            ExitChoice::ZeroForce => "zero_force",
            ExitChoice::ZeroDisplacement => "zero_displacement",
            ExitChoice::SafeDisplacement => "safe_displacement",
        }
    }
}

/// Zero of a measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ZeroChoice {
    /// The offset in the file is the zero. The reading before the test is only reported.
    #[default]
    Absolute,
    /// The reading before the test is the zero.
    Relative,
}
