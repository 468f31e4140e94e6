//! The keys that have no effect under a condition, and the numbers that a key may have: one table for each table of a file.
//!
//! A key counts as given where it differs from its default, so that a file that states its defaults (like `resolved.toml`)
//! gets no reports. Other checks refuse a key that contradicts another.

use super::Findings;
use crate::axis_table::AxisTable;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::echo::number;
use crate::link_table::{Carrier, LinkCoupling, LinkSpec, Protocol, StaleChoice, WATCHDOG_MAX_S};
use crate::safety::{ExitChoice, ZeroChoice};
use crate::schema::TestFile;
use crate::specimen::SpecimenTable;
use crate::steps::not_positive;
use crate::timing_table::{OnMiss, Policy, TimingSpec};
use crate::value::LambdaValue;
use gusset_actuator::compensation::CompensationSpec;
use gusset_numerics::law::Reach;

/// Keys of one table, separated by blanks (`*`: all keys), when they have no effect, and why.
pub(super) type Idle<When> = (&'static str, When, &'static str);
/// Keys of one table, separated by blanks, and what their numbers must be.
pub(super) type Range = (&'static str, Must);

type OfTest = fn(&TestFile) -> bool;
type OfTiming = fn(&TimingSpec) -> bool;
type OfSpecimen = fn(&SpecimenTable) -> bool;
type InTest = fn(&SpecimenTable, &TestFile) -> bool;
type OfAxis = fn(&AxisTable) -> bool;
type OfLink = fn(&LinkSpec) -> bool;

/// The allowed numbers of a key. Other checks report infinity and NaN.
#[derive(Debug, Clone, Copy)]
pub(super) enum Must {
    /// Greater than zero.
    Positive,
    /// At most this number, with its unit and the reason.
    AtMost(f64, &'static str, &'static str),
    /// Zero, or at least this number, with its unit and the reason.
    AtLeast(f64, &'static str, &'static str),
    /// Inside a range, in words, with a label.
    Be(fn(f64) -> bool, &'static str, &'static str),
}
use Must::{AtLeast, AtMost, Be, Positive};

/// Longest time in s in which the specimens hold and nothing happens yet: zeroing, warming up, easing.
pub(super) const STANDING_S: f64 = 600.0;
/// Longest time in s for an answer of one end, a ramp, or a tick.
pub(super) const OWED_S: f64 = 3600.0;

const NOT_NEGATIVE: &str = "must not be negative";
const STANDING: &str = "the specimens hold during this time";
const OWED: &str = "the test waits this long for a missing reply";

pub(super) const NUMBERS_OF_GRAVITY: &[Range] = &[("accel_m_per_s2", Positive)];

pub(super) const NUMBERS_OF_INTEGRATOR: &[Range] = &[
    ("gain_bound newton_tolerance newton_iterations", Positive),
    (
        "newton_iterations",
        // Newton's method needs a handful, or it has none.
        AtMost(
            1e4,
            "",
            "a step that needs more iterations does not converge",
        ),
    ),
    (
        "rest_damping_share",
        Be(is_share, "must be from 0 to 1", "a share"),
    ),
    (
        "rho_infinity",
        Be(
            is_share,
            "must be from 0 to 1",
            "rho_infinity is a spectral radius",
        ),
    ),
];

pub(super) const NUMBERS_OF_SAFETY: &[Range] = &[
    (
        "divergence_m exit_speed_m_per_s resume_within_m resume_within_n added_energy_share.floor_j",
        Positive,
    ),
    (
        "exit_speed_m_per_s",
        // A millimetre in a quarter of an hour.
        AtLeast(
            1e-6,
            " m/s",
            "a slower specimen would not reach its end position",
        ),
    ),
    (
        "zero_s ramp_s ease_s",
        Be(|s| s >= 0.0, NOT_NEGATIVE, "seconds"),
    ),
    ("zero_s ease_s", AtMost(STANDING_S, " s", STANDING)),
    (
        "ramp_s",
        AtMost(
            OWED_S,
            " s",
            "the shortest time of a motion; limits of speed make it longer where needed",
        ),
    ),
];

pub(super) const NUMBERS_OF_TIMING: &[Range] = &[
    (
        "priority",
        Be(
            |found| (1.0..=98.0).contains(&found),
            "must be 1 to 98",
            "a priority of SCHED_FIFO",
        ),
    ),
    (
        "spin_us",
        Be(
            |us| (0.0..=1e6).contains(&us),
            "must be 0 to 1000000",
            "microseconds",
        ),
    ),
    (
        "max_catch_up_ticks misses.in_a_row.trip misses.in_total.trip misses.in_window.trip",
        Be(
            |count| count >= 1.0,
            "must be at least 1",
            "0 would stop every test at once",
        ),
    ),
    (
        "misses.window_s",
        Be(
            |s| s > 0.0 && s <= 3600.0,
            "must be greater than 0 and at most 3600",
            "seconds",
        ),
    ),
];

pub(super) const NUMBERS_OF_RECORD: &[Range] = &[
    ("queue_s checkpoint_s", Positive),
    (
        "queue_s",
        AtMost(600.0, " s", "waiting rows are kept in memory"),
    ),
    (
        "checkpoint_s",
        AtMost(
            OWED_S,
            " s",
            "a resumed test is verified from one checkpoint to the next",
        ),
    ),
];

pub(super) const NUMBERS_OF_CERTIFICATE: &[Range] = &[
    ("tracking_error response_error", Positive),
    (
        "trials",
        Be(|n| n >= 1.0, "must be 1 or greater", "at least one trial"),
    ),
    (
        "trip_probability",
        Be(
            |share| share > 0.0 && share <= 1.0,
            "must be greater than 0 and at most 1",
            "a finite number of trials cannot show a probability of 0",
        ),
    ),
    (
        "trials",
        AtMost(1e6, "", "each trial repeats the whole test"),
    ),
];

pub(super) const NUMBERS_OF_UNCERTAINTY: &[Range] = &[("std std_share", Positive)];

pub(super) const NUMBERS_OF_SPECIMEN: &[Range] = &[
    (
        "reach_disp_m reach_vel_m_per_s similitude.length similitude.force similitude.time drill.panic_at_s \
         identified.gain identified.stiffness_n_per_m capacity.stroke_m capacity.velocity_m_per_s capacity.force_n \
         capacity.power_w",
        Positive,
    ),
    (
        "mass_in_force_kg",
        Be(
            |kg| kg >= 0.0,
            "a mass is not negative",
            "must be zero or greater",
        ),
    ),
    (
        "identified.delay_s identified.delay_std_s identified.gain_std identified.stiffness_std_n_per_m \
         identified.noise_disp_m identified.noise_force_n",
        Be(|found| found >= 0.0, "must be 0 or greater", "negative"),
    ),
    (
        "hardening_bound",
        Be(
            |factor| factor >= 1.0,
            "must be 1 or greater",
            "a factor on the initial tangent stiffness",
        ),
    ),
];

pub(super) const NUMBERS_OF_AXIS: &[Range] = &[("scale", Positive)];

pub(super) const NUMBERS_OF_LINK: &[Range] = &[
    (
        "connect_timeout_s reply_timeout_s watchdog_s sample_after probe_m probe_ramp_s",
        Positive,
    ),
    (
        "sample_after",
        Be(
            |part| part <= 1.0,
            "must be inside the tick",
            "a fraction of the tick, at most 1",
        ),
    ),
    (
        "max_stale",
        Be(
            |count| count >= 1.0,
            "must be 1 or greater",
            "`on_stale = \"stop\"` stops at the first stale measurement",
        ),
    ),
    (
        "spin_us",
        Be(|us| us >= 0.0, NOT_NEGATIVE, "must be zero or greater"),
    ),
    (
        "connect_timeout_s reply_timeout_s",
        AtMost(OWED_S, " s", OWED),
    ),
    (
        "watchdog_s",
        AtMost(
            WATCHDOG_MAX_S,
            " s",
            "the server holds after this time without a command",
        ),
    ),
    (
        "probe_ramp_s",
        AtMost(STANDING_S, " s", "the time of the motion in each direction"),
    ),
    // As in `[timing]`.
    (
        "spin_us",
        AtMost(1e6, " µs", "a busy loop occupies a processor"),
    ),
];

pub(super) const NUMBERS_OF_SERVE: &[Range] = &[
    (
        "openfresco.idle_timeout_s openfresco.step_s openfresco.iterates_within_m",
        Positive,
    ),
    (
        "openfresco.idle_timeout_s",
        AtMost(
            86_400.0,
            " s",
            "as long as a client that is gone keeps the specimen to itself",
        ),
    ),
    (
        "pace.rate_hz",
        Be(
            |hz| (1.0..=1e4).contains(&hz),
            "must be from 1 to 10000",
            "commands per second",
        ),
    ),
    (
        "pace.ticks_per_step",
        Be(
            |ticks| ticks >= 2.0,
            "must be at least 2",
            "commands for each target",
        ),
    ),
];

fn is_share(value: f64) -> bool {
    (0.0..=1.0).contains(&value)
}

fn no_structure(test: &TestFile) -> bool {
    test.structure.is_none()
}

fn no_specimen(test: &TestFile) -> bool {
    test.specimen.is_empty()
}

fn no_relative_zero(test: &TestFile, zero: fn(&AxisTable) -> ZeroChoice) -> bool {
    let mut axes = test.specimen.iter().flat_map(|specimen| &specimen.axis);
    axes.all(|axis| zero(axis) == ZeroChoice::Absolute)
}

const NO_SPECIMEN: &str = "the test has no specimen";

pub(super) const IDLE_TIME: &[Idle<OfTest>] = &[(
    "prediction_order",
    no_specimen,
    "for specimens only, and the test has no specimen",
)];

pub(super) const IDLE_INTEGRATOR: &[Idle<OfTest>] = &[
    ("*", no_structure, "the test has no structure to integrate"),
    (
        "gain_bound",
        |test| test.integrator.lambda != LambdaValue::Auto,
        "for `lambda = \"auto\"` only, and `lambda` is a number here",
    ),
];

pub(super) const IDLE_SAFETY: &[Idle<OfTest>] = &[
    (
        "divergence_m",
        no_structure,
        "for structures only, and the test has no structure",
    ),
    (
        "stability_used step_audit",
        no_structure,
        "for structures only, and the test has no structure to integrate",
    ),
    (
        "confirm on_trip at_end exit_speed_m_per_s resume_within_m resume_within_n resume_takes_force_drift \
         added_energy_share stability_used",
        no_specimen,
        NO_SPECIMEN,
    ),
    (
        "zero_s",
        |test| no_specimen(test) && test.safety.zero_s != Some(0.0),
        NO_SPECIMEN,
    ),
    (
        "ramp_s",
        |test| {
            let loaded = test.structure.as_ref();
            let loaded = loaded.is_some_and(|s| s.static_load_n.is_some() || s.gravity.is_some());
            no_specimen(test) && !loaded
        },
        "the test has no startup ramp: neither a specimen nor a static load",
    ),
    (
        "exit_speed_m_per_s",
        |test| [test.safety.on_trip, test.safety.at_end] == [ExitChoice::Freeze; 2],
        "`on_trip` and `at_end` are \"freeze\", which moves nothing",
    ),
    (
        "resume_takes_force_drift",
        |test| no_relative_zero(test, |axis| axis.zero_force),
        "no axis has `zero_force = \"relative\"`, so no load cell is zeroed",
    ),
    (
        "confirm",
        |test| {
            test.safety.zero_s.is_none()
                && test.specimen.iter().all(|specimen| specimen.link.is_none())
                && no_relative_zero(test, |axis| axis.zero_disp)
                && no_relative_zero(test, |axis| axis.zero_force)
        },
        "the sensors of simulated specimens are read before the test only with `zero_s`",
    ),
];

/// Whatever the clock, and in the file of a server too.
pub(super) const IDLE_TIMING: &[Idle<OfTiming>] = &[(
    "priority",
    |timing| timing.policy == Policy::Ordinary,
    "the policy \"ordinary\" has no priority",
)];

pub(super) const IDLE_TIMING_OF_TEST: &[Idle<OfTiming>] = &[(
    "max_catch_up_ticks",
    |timing| timing.on_miss != OnMiss::CatchUp,
    "only for `on_miss = \"catch_up\"`",
)];

pub(super) const IDLE_TIMING_OF_SERVER: &[Idle<OfTiming>] = &[(
    "on_miss misses max_catch_up_ticks warmup_ticks",
    |_| true,
    "a server has no ticks: the controller keeps the deadlines",
)];

/// Keys of the real clock. The ticks of the warm-up are run on every clock.
pub(super) const REAL_CLOCK: &str =
    "policy priority cpu spin_us lock_memory hold_cpu_awake require_realtime on_miss misses";

pub(super) const IDLE_RECORD: &[Idle<OfTest>] = &[(
    "dofs",
    no_structure,
    "the test has no structure, so it has no DOFs",
)];

pub(super) const IDLE_RECORD_OF_SERVER: (&str, &str) = (
    "dofs checkpoint_s",
    "only for tests: a server has no structure and resumes nothing",
);

const ONLY_SAFE: &str = "only for `on_trip` or `at_end` = \"safe_displacement\"";
const ON_A_STRUCTURE: &str = "acts on a structure, and this file has no `[structure]`";
const IS_BOUNDED: &str = "the tangent of this law is bounded without it";

pub(super) const IDLE_SPECIMEN: &[Idle<OfSpecimen>] = &[
    (
        "transfer.seed",
        |table| table.transfer.as_ref().is_some_and(|spec| !spec.is_noisy()),
        "no sensor of this specimen has noise",
    ),
    (
        "transfer.between_ticks",
        |table| table.transfer.as_ref().is_some_and(|spec| !spec.lags()),
        "only for an `actuator` with a lag",
    ),
    (
        "compensation.ats.delay_s compensation.ats.gain",
        |table| match &table.compensation {
            Some(CompensationSpec::Ats(ats)) => ats.start.is_some(),
            _ => false,
        },
        "`start` already gives the coefficients",
    ),
];

pub(super) const IDLE_SPECIMEN_OF_TEST: &[Idle<InTest>] = &[
    (
        "safe_disp_m",
        |_, test| {
            let leaves = [test.safety.on_trip, test.safety.at_end];
            !leaves.contains(&ExitChoice::SafeDisplacement)
        },
        ONLY_SAFE,
    ),
    (
        "mass_in_force_kg",
        |_, test| no_structure(test),
        ON_A_STRUCTURE,
    ),
    // A reach that turns actuators into a platform is not judged.
    (
        "reach_disp_m reach_vel_m_per_s",
        |table, _| table.link.is_some() && table.geometry.is_none(),
        "for a specimen behind a link use `hardening_bound`",
    ),
    (
        "reach_disp_m",
        |table, _| is_bounded(table, None, Some(1.0)),
        IS_BOUNDED,
    ),
    (
        "reach_vel_m_per_s",
        |table, _| is_bounded(table, Some(1.0), None),
        IS_BOUNDED,
    ),
];

const OF_CONTROLLER: &str =
    "only for the controller's test file: a server uses the numbers of the axes";

pub(super) const IDLE_SPECIMEN_OF_SERVER: &[Idle<OfSpecimen>] = &[
    ("safe_disp_m", |_| true, ONLY_SAFE),
    ("mass_in_force_kg", |_| true, ON_A_STRUCTURE),
    (
        "similitude",
        |table| table.link.is_none() && table.geometry.is_none(),
        OF_CONTROLLER,
    ),
    (
        "link.on_stale link.max_stale link.commands link.computed",
        |_| true,
        "a gateway forwards each command and waits for its reply",
    ),
    (
        "law laws coupled transfer",
        |table| table.link.is_some(),
        "a gateway has no rehearsal",
    ),
    (
        "reach_disp_m reach_vel_m_per_s hardening_bound identified capacity drill",
        |_| true,
        OF_CONTROLLER,
    ),
];

pub(super) const IDLE_AXIS_OF_TEST: &[Idle<OfAxis>] = &[
    (
        "offset_m",
        |axis| axis.zero_disp == ZeroChoice::Relative,
        "`zero_disp = \"relative\"` takes the zero from the reading before the test",
    ),
    (
        "offset_n",
        |axis| axis.zero_force == ZeroChoice::Relative,
        "`zero_force = \"relative\"` takes the zero from the reading before the test",
    ),
];

/// For a computed specimen: a gateway converts by those keys itself.
pub(super) const IDLE_AXIS_OF_SERVER: (&str, &str) = (
    "scale sign offset_m offset_n zero_disp zero_force",
    OF_CONTROLLER,
);

/// For a test. On the simulated clock every link is lockstep, whatever coupling the file has for the real clock.
pub(super) const IDLE_LINK: &[Idle<OfLink>] = &[
    (
        "on_stale max_stale",
        |link| link.protocol != Protocol::Gusset,
        "OpenFresco's protocols wait for every reply, so no measurement is stale",
    ),
    (
        "on_stale max_stale",
        |link| link.coupling == LinkCoupling::Lockstep,
        "`coupling = \"lockstep\"` waits for every reply, so no measurement is stale",
    ),
    (
        "max_stale",
        |link| link.on_stale == StaleChoice::Stop,
        "`on_stale = \"stop\"` stops at the first one",
    ),
    (
        "probe_ramp_s",
        |link| link.probe_m.is_none(),
        "only with `probe_m`, which is missing",
    ),
    (
        "openfresco.udp_hello",
        |link| link.transport != Carrier::Udp,
        "only for `transport = \"udp\"`",
    ),
    (
        "openfresco.version openfresco.site",
        |link| link.protocol != Protocol::OpenFrescoShadow,
        "only for `protocol = \"openfresco-shadow\"`",
    ),
    (
        "openfresco.server",
        |link| link.protocol != Protocol::OpenFresco,
        "only for `protocol = \"openfresco\"`",
    ),
];

/// True if the tangents of the law of a simulated specimen have bounds with this reach. A law that is missing or cannot be built
/// is an error, reported elsewhere.
fn is_bounded(table: &SpecimenTable, disp: Option<f64>, vel: Option<f64>) -> bool {
    let axes = table.law_axes();
    let (None, None, Some((_, source))) = (&table.link, &table.geometry, table.source()) else {
        return false;
    };
    source.build(axes).is_ok_and(|law| {
        let reach = vec![Reach { disp, vel }; axes];
        let (mut k, mut c) = (vec![0.0; axes * axes], vec![0.0; axes * axes]);
        law.bound(&reach, &mut k, &mut c).is_ok()
    })
}

impl Findings {
    /// Warns of each of these keys of the table at `at` that is given: it has no effect.
    pub(super) fn no_effect(&mut self, at: &KeyPath, keys: &str, why: &str) {
        for key in self.given(at, keys) {
            let headline = format!("`{key}` has no effect");
            self.push(Finding::warning(key, headline).at_key().label(why));
        }
    }

    /// Warns of the keys of the table at `at` that have no effect; `holds` judges a condition.
    pub(super) fn idle<When>(
        &mut self,
        at: &KeyPath,
        rules: &[Idle<When>],
        holds: impl Fn(&When) -> bool,
    ) {
        for (keys, when, why) in rules {
            if !self.given(at, keys).is_empty() && holds(when) {
                self.no_effect(at, keys, why);
            }
        }
    }

    /// Refuses the numbers of the table at `at` that are out of their ranges.
    pub(super) fn numbers(&mut self, at: &KeyPath, ranges: &[Range]) {
        for (keys, must) in ranges {
            for key in keys.split_whitespace() {
                let at = at.under(key);
                let found = match self.value(&at) {
                    Some(toml::Value::Float(value)) => *value,
                    Some(toml::Value::Integer(value)) => *value as f64,
                    _ => continue,
                };
                if found.is_finite()
                    && let Some(finding) = must.refuse(at, found)
                {
                    self.push(finding);
                }
            }
        }
    }
}

impl Must {
    /// The finding for a number that is something else.
    fn refuse(self, at: KeyPath, found: f64) -> Option<Finding> {
        let (headline, label, help) = match self {
            Positive => return (found <= 0.0).then(|| not_positive(at, found)),
            AtMost(most, unit, why) if found > most => (
                format!("`{at}` must be at most {}{unit}", number(most)),
                format!("found {}", number(found)),
                Some(why),
            ),
            AtLeast(least, unit, why) if found > 0.0 && found < least => (
                format!("`{at}` must be at least {}{unit}", number(least)),
                format!("found {}", number(found)),
                Some(why),
            ),
            Be(is_allowed, words, label) if !is_allowed(found) => (
                format!("`{at}` is {}, but {words}", number(found)),
                label.to_owned(),
                None,
            ),
            _ => return None,
        };
        let finding = Finding::error(at, headline).label(label);
        Some(help.into_iter().fold(finding, Finding::help))
    }
}
