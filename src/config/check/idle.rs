//! The keys that have no effect under a condition: one table for each table of a file.
//!
//! A key counts as given where it differs from its default, so that a file that states its defaults (like `resolved.toml`)
//! gets no reports. Other checks refuse a key that contradicts another.

use super::rules::Idle;
use crate::axis_table::AxisTable;
use crate::bus_spec::{BusSample, BusSpec};
use crate::link_table::{Carrier, LinkCoupling, LinkSpec, Protocol, StaleChoice};
use crate::safety::{ExitChoice, ZeroChoice};
use crate::schema::{StructureTable, TestFile};
use crate::specimen::SpecimenTable;
use crate::timing_table::{OnMiss, Policy, TimingSpec};
use crate::value::LambdaValue;
use gusset_actuator::compensation::CompensationSpec;
use gusset_numerics::law::Reach;

type OfTest = fn(&TestFile) -> bool;
type OfTiming = fn(&TimingSpec) -> bool;
type OfSpecimen = fn(&SpecimenTable) -> bool;
type InTest = fn(&SpecimenTable, &TestFile) -> bool;
type OfAxis = fn(&AxisTable) -> bool;
type OfLink = fn(&LinkSpec) -> bool;
type OfBus = fn(&BusSpec) -> bool;

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
        "stability_used step_audit static_unbalance",
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
            let loaded = loaded.is_some_and(StructureTable::has_static_load);
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
        "law laws coupled bearing transfer",
        |table| table.link.is_some(),
        "a gateway has no rehearsal",
    ),
    (
        "reach_disp_m reach_vel_m_per_s hardening_bound identified capacity drill damped",
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

pub(super) const IDLE_BUS: &[Idle<OfBus>] = &[
    (
        "sample_after",
        |spec| spec.sample == BusSample::NextTick,
        "only for `sample = \"same_tick\"`",
    ),
    (
        "probe_ramp_s",
        |spec| spec.probe_m.is_none(),
        "only with `probe_m`, which is missing",
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
