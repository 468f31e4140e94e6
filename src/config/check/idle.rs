//! Keys without an effect in their file: a warning reports each, with its reason.
//!
//! A key counts as given where it differs from its default, so that a file that states its defaults (like `resolved.toml`)
//! gets no reports. A key that contradicts another is not idle but an error, which is reported elsewhere.

mod specimen;

pub(super) use specimen::{check_idle_link, check_idle_specimen};

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::excitation::PrescribedPlace;
use crate::safety::{ExitChoice, SafetyTable, ZeroChoice};
use crate::schema::{IntegratorTable, RecordTable, TestFile};
use crate::specimen::SpecimenTable;
use crate::timetable::{ClockChoice, TimeTable};
use crate::timing_table::{OnMiss, Policy, TimingSpec};
use crate::value::LambdaValue;

impl Findings {
    /// `key` of the table at `at`, if it is given: it has no effect, for this reason.
    pub(super) fn idle(&mut self, at: &KeyPath, key: &str, given: bool, why: &str) {
        if given {
            let at = at.key(key);
            let headline = format!("`{at}` has no effect");
            self.0
                .push(Finding::warning(at, headline).at_key().label(why));
        }
    }

    /// Reports several keys of one table.
    fn all_idle(&mut self, at: &KeyPath, keys: &[(&str, bool)], why: &str) {
        for (key, given) in keys {
            self.idle(at, key, *given, why);
        }
    }
}

/// The whole file except its specimens. `clock_is_chosen`: the user overrides the clock for this run, and knows which keys it
/// ignores.
pub(super) fn check_idle(file: &TestFile, clock_is_chosen: bool, findings: &mut Findings) {
    let root = KeyPath::root();
    check_time(file, &root.key("time"), findings);
    check_integrator(file, &root.key("integrator"), findings);
    check_excitation(file, &root.key("excitation"), findings);
    check_safety(file, &root.key("safety"), findings);
    check_timing(&file.timing, &root.key("timing"), findings);
    if file.time.clock == ClockChoice::Simulated && !clock_is_chosen {
        check_clock(&file.timing, &root, findings);
    }
    findings.idle(
        &root.key("record"),
        "dofs",
        file.record.dofs.is_some() && file.structure.is_none(),
        "the test has no structure, so it has no DOFs",
    );
}

fn check_integrator(file: &TestFile, at: &KeyPath, findings: &mut Findings) {
    let IntegratorTable {
        method,
        lambda,
        allow_unstable_lambda,
        gain_bound,
        rest_damping_share,
        start,
        rho_infinity,
        weighting,
        newton_tolerance,
        newton_iterations,
    } = &file.integrator;
    if file.structure.is_none() {
        let usual = IntegratorTable::default();
        let keys = [
            ("method", *method != usual.method),
            ("lambda", *lambda != usual.lambda),
            ("allow_unstable_lambda", *allow_unstable_lambda),
            ("gain_bound", gain_bound.is_some()),
            ("rest_damping_share", rest_damping_share.is_some()),
            ("start", *start != usual.start),
            ("rho_infinity", rho_infinity.is_some()),
            ("weighting", weighting.is_some()),
            ("newton_tolerance", newton_tolerance.is_some()),
            ("newton_iterations", newton_iterations.is_some()),
        ];
        findings.all_idle(at, &keys, "the test has no structure to integrate");
        return;
    }
    findings.idle(
        at,
        "gain_bound",
        gain_bound.is_some() && *lambda != LambdaValue::Auto,
        "for `lambda = \"auto\"` only, and `lambda` is a number here",
    );
}

fn check_time(file: &TestFile, at: &KeyPath, findings: &mut Findings) {
    let TimeTable {
        prediction_order, ..
    } = file.time;
    findings.idle(
        at,
        "prediction_order",
        prediction_order != 2 && file.specimen.is_empty(),
        "for specimens only, and the test has no specimen",
    );
}

fn check_excitation(file: &TestFile, at: &KeyPath, findings: &mut Findings) {
    let each = file.excitation.prescribed_displacement.iter();
    for (index, prescribed) in each.enumerate() {
        let named = |specimen: &&SpecimenTable| specimen.name == prescribed.specimen;
        let specimen = file.specimen.iter().find(named);
        findings.idle(
            &at.key("prescribed_displacement").index(index),
            "at",
            prescribed.at != PrescribedPlace::Platform
                && specimen.is_some_and(|s| s.geometry.is_none()),
            "only for a specimen with a `geometry`: without one, each axis is one deformation",
        );
    }
}

fn check_safety(file: &TestFile, at: &KeyPath, findings: &mut Findings) {
    let safety = &file.safety;
    let usual = SafetyTable::default();
    findings.idle(
        at,
        "divergence_m",
        safety.divergence_m.is_some() && file.structure.is_none(),
        "for structures only, and the test has no structure",
    );
    if file.structure.is_none() {
        let keys = [
            ("stability_used", safety.stability_used.is_some()),
            ("step_audit", safety.step_audit.is_some()),
        ];
        findings.all_idle(
            at,
            &keys,
            "for structures only, and the test has no structure to integrate",
        );
    }
    if file.specimen.is_empty() {
        let keys = [
            ("zero_s", safety.zero_s.is_some_and(|zero| zero != 0.0)),
            ("confirm", safety.confirm),
            ("on_trip", safety.on_trip != usual.on_trip),
            ("at_end", safety.at_end != usual.at_end),
            ("exit_speed_m_per_s", safety.exit_speed_m_per_s.is_some()),
            ("resume_within_m", safety.resume_within_m.is_some()),
            ("resume_within_n", safety.resume_within_n.is_some()),
            ("resume_takes_force_drift", safety.resume_takes_force_drift),
            ("added_energy_share", safety.added_energy_share.is_some()),
            ("stability_used", safety.stability_used.is_some()),
        ];
        findings.all_idle(at, &keys, "the test has no specimen");
        let static_load = file.structure.as_ref().is_some_and(|structure| {
            structure.static_load_n.is_some() || structure.gravity.is_some()
        });
        findings.idle(
            at,
            "ramp_s",
            safety.ramp_s != usual.ramp_s && !static_load,
            "the test has no startup ramp: neither a specimen nor a static load",
        );
        return;
    }
    let leaves = [safety.on_trip, safety.at_end];
    findings.idle(
        at,
        "exit_speed_m_per_s",
        safety.exit_speed_m_per_s.is_some() && leaves == [ExitChoice::Freeze; 2],
        "`on_trip` and `at_end` are \"freeze\", which moves nothing",
    );
    let mut axes = file.specimen.iter().flat_map(|specimen| &specimen.axis);
    findings.idle(
        at,
        "resume_takes_force_drift",
        safety.resume_takes_force_drift
            && !axes.any(|axis| axis.zero_force == ZeroChoice::Relative),
        "no axis has `zero_force = \"relative\"`, so no load cell is zeroed",
    );
}

/// `[timing]`, whatever the clock.
fn check_timing(timing: &TimingSpec, at: &KeyPath, findings: &mut Findings) {
    let usual = TimingSpec::default();
    findings.idle(
        at,
        "priority",
        timing.priority != usual.priority && timing.policy == Policy::Ordinary,
        "the policy \"ordinary\" has no priority",
    );
    let catches_up = timing.on_miss == OnMiss::CatchUp;
    findings.idle(
        at,
        "max_catch_up_ticks",
        timing.max_catch_up_ticks != usual.max_catch_up_ticks && !catches_up,
        "only for `on_miss = \"catch_up\"`",
    );
}

/// On the simulated clock no thread waits for an edge, and no request goes to the machine: one finding for all keys.
fn check_clock(timing: &TimingSpec, root: &KeyPath, findings: &mut Findings) {
    let keys = of_real_time(timing);
    let Some(first) = keys.first() else { return };
    let named: Vec<String> = keys.iter().map(|key| format!("`{key}`")).collect();
    let headline = format!(
        "the simulated clock needs no real-time settings and misses no deadlines, so these keys have no effect: {}",
        named.join(", ")
    );
    let finding = Finding::warning(root.key("timing").key(first), headline);
    findings.0.push(
        finding
            .at_key()
            .label("only for the real clock")
            .beside(root.key("time").key("clock"), "simulated here"),
    );
}

/// Keys of the real clock that differ from their defaults.
fn of_real_time(timing: &TimingSpec) -> Vec<&'static str> {
    let usual = TimingSpec::default();
    let TimingSpec {
        policy,
        priority,
        cpu,
        spin_us,
        lock_memory,
        hold_cpu_awake,
        require_realtime,
        on_miss,
        max_catch_up_ticks: _,
        misses,
        // Its ticks are run on every clock.
        warmup_ticks: _,
    } = timing;
    let keys = [
        ("policy", *policy != usual.policy),
        ("priority", *priority != usual.priority),
        ("cpu", cpu.is_some()),
        ("spin_us", *spin_us != usual.spin_us),
        ("lock_memory", *lock_memory != usual.lock_memory),
        ("hold_cpu_awake", *hold_cpu_awake != usual.hold_cpu_awake),
        ("require_realtime", *require_realtime),
        ("on_miss", *on_miss != usual.on_miss),
        ("misses", *misses != usual.misses),
    ];
    let given = keys.into_iter().filter(|(_, given)| *given);
    given.map(|(key, _)| key).collect()
}

/// `[timing]` and `[record]` of a file that is only served: it has no ticks, no DOFs and nothing to resume.
pub(super) fn check_idle_served(
    timing: Option<&TimingSpec>,
    record: Option<&RecordTable>,
    findings: &mut Findings,
) {
    let root = KeyPath::root();
    if let Some(timing) = timing {
        let at = root.key("timing");
        let usual = TimingSpec::default();
        findings.idle(
            &at,
            "priority",
            timing.priority != usual.priority && timing.policy == Policy::Ordinary,
            "the policy \"ordinary\" has no priority",
        );
        let of_the_machine = [
            "policy",
            "priority",
            "cpu",
            "spin_us",
            "lock_memory",
            "hold_cpu_awake",
            "require_realtime",
        ];
        let why = "a server has no ticks: the controller keeps the deadlines";
        for key in of_real_time(timing) {
            findings.idle(&at, key, !of_the_machine.contains(&key), why);
        }
        let keys = [
            (
                "max_catch_up_ticks",
                timing.max_catch_up_ticks != usual.max_catch_up_ticks,
            ),
            ("warmup_ticks", timing.warmup_ticks.is_some()),
        ];
        findings.all_idle(&at, &keys, why);
    }
    if let Some(record) = record {
        let at = root.key("record");
        let usual = RecordTable::default();
        let keys = [
            ("dofs", record.dofs.is_some()),
            ("checkpoint_s", record.checkpoint_s != usual.checkpoint_s),
        ];
        findings.all_idle(
            &at,
            &keys,
            "only for tests: a server has no structure and resumes nothing",
        );
    }
}
