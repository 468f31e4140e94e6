//! Keys without an effect are reported, each with its reason. A file that only states its defaults gets no such report.

use super::*;
use crate::build;

const LINKED: &str = r#"
[time]
rate_hz = 100
duration_s = 1
[structure.shear_building]
mass_kg = [1000]
stiffness_n_per_m = [1e6]
[excitation.ground_acceleration]
signal = { sine = { amplitude = 2.0, frequency_hz = 1.5 } }
[[specimen]]
name = "rig"
storey = 1
stiffness_n_per_m = 1e5
[specimen.link]
address = "127.0.0.1:4823"
[specimen.limits]
command_disp_m = { trip = [-0.1, 0.1] }
measured_force_n = { trip = [-1e4, 1e4] }
"#;

const BARE: &str = r#"
time = { rate_hz = 100, duration_s = 1 }
structure = { shear_building = { mass_kg = [1000], stiffness_n_per_m = [1e6] } }
excitation = { ground_acceleration = { signal = { sine = { amplitude = 2.0, frequency_hz = 1.5 } } } }
"#;

/// Headlines and labels of the reports about `text` with these overrides.
fn told(text: &str, sets: &[&str]) -> Vec<String> {
    let loaded = accepted(text, sets);
    let warnings = loaded.warnings.iter();
    let words = warnings.map(|warning| format!("{}: {}", warning.headline, warning.place.1));
    words.collect()
}

/// Exactly one key is reported, with these words.
#[track_caller]
fn idle(text: &str, sets: &[&str], path: &str, why: &str) {
    let told = told(text, sets);
    let [one] = told.as_slice() else {
        panic!("{sets:?}: {told:?}");
    };
    shows(one, &format!("`{path}`"));
    shows(one, why);
}

#[test]
fn effective_keys_give_no_report() {
    for text in [GOOD, PRESCRIBED, LINKED, BARE] {
        assert_eq!(told(text, &[]), [""; 0]);
    }
    let all = [
        "specimen.0.limits.following_error_m.trip=1e-3",
        "specimen.0.limits.following_time_s=0.01",
        "specimen.0.limits.stuck_ticks.trip=20",
        "specimen.0.limits.stuck_travel_m=1e-3",
        "specimen.0.limits.alternating_ticks.trip=9",
        "specimen.0.link.max_stale=3",
        "specimen.0.link.probe_m=1e-3",
        "specimen.0.link.probe_ramp_s=2",
        "specimen.0.safe_disp_m=[0.0]",
        "safety.on_trip=safe_displacement",
        "safety.exit_speed_m_per_s=0.01",
        "safety.confirm=true",
        "timing.require_realtime=true",
        "integrator.gain_bound=3",
        "integrator.allow_unstable_lambda=true",
    ];
    assert_eq!(told(LINKED, &all), [""; 0]);
}

#[test]
fn written_defaults_give_no_report() {
    let loaded = accepted(LINKED, &["specimen.0.link.on_stale=stop"]);
    let written = toml::to_string(&loaded.file).unwrap();
    assert!(written.contains("spin_us") && written.contains("probe_ramp_s"));
    assert_eq!(told(&written, &[]), [""; 0]);
}

#[test]
fn idle_link_keys_are_reported() {
    let stop = "specimen.0.link.on_stale=stop";
    let set = "specimen.0.link.max_stale=3";
    let path = "specimen[0].link.max_stale";
    idle(LINKED, &[stop, set], path, "stops at the first one");
    let lockstep = "specimen.0.link.coupling=lockstep";
    idle(LINKED, &[lockstep, set], path, "waits for every reply");
    let openfresco = "specimen.0.link.protocol=openfresco";
    let stands = "specimen.0.link.stands_at_m=[0]";
    idle(
        LINKED,
        &[openfresco, stands, set],
        path,
        "OpenFresco's protocols wait",
    );
    idle(
        LINKED,
        &[
            "specimen.0.link.coupling=lockstep",
            "specimen.0.link.on_stale=extrapolate",
        ],
        "specimen[0].link.on_stale",
        "no measurement is stale",
    );
    idle(
        LINKED,
        &["specimen.0.link.probe_ramp_s=2"],
        "specimen[0].link.probe_ramp_s",
        "`probe_m`, which is missing",
    );
    let openfresco = "specimen.0.link.protocol=openfresco";
    for (key, value) in [("udp_hello", "true"), ("version", "2.7"), ("site", "3")] {
        let set = format!("specimen.0.link.openfresco.{key}={value}");
        let path = format!("specimen[0].link.openfresco.{key}");
        let stands = "specimen.0.link.stands_at_m=[0]";
        idle(LINKED, &[openfresco, stands, &set], &path, "for ");
    }
}

#[test]
fn modifiers_without_bounds_are_reported() {
    for (key, bound) in [
        ("following_time_s", "following_error_m"),
        ("stuck_travel_m", "stuck_ticks"),
    ] {
        let set = format!("specimen.0.limits.{key}=1e-3");
        let path = format!("specimen[0].limits.{key}");
        idle(LINKED, &[&set], &path, &format!("`{bound}`"));
        // A bound of one axis alone is enough for a key of all axes.
        let own = format!("specimen.0.axis=[{{limits={{{bound}={{trip=5}}}}}}]");
        assert_eq!(told(LINKED, &[&set, &own]), [""; 0]);
        let own = format!("specimen.0.axis=[{{limits={{{key}=1e-3}}}}]");
        let path = format!("specimen[0].axis[0].limits.{key}");
        idle(LINKED, &[&own], &path, &format!("`{bound}`"));
    }
}

#[test]
fn idle_safety_keys_are_reported() {
    let speed = "safety.exit_speed_m_per_s=0.01";
    idle(
        LINKED,
        &[speed],
        "safety.exit_speed_m_per_s",
        "\"freeze\", which moves nothing",
    );
    idle(
        LINKED,
        &["specimen.0.safe_disp_m=[0.01]"],
        "specimen[0].safe_disp_m",
        "only for `on_trip` or `at_end`",
    );
    idle(
        LINKED,
        &["safety.resume_takes_force_drift=true"],
        "safety.resume_takes_force_drift",
        "zero_force",
    );
    idle(
        PRESCRIBED,
        &["safety.divergence_m=5"],
        "safety.divergence_m",
        "no structure",
    );
    for (key, value) in [
        ("lambda", "1000"),
        ("start", "\"second-order\""),
        ("gain_bound", "3"),
    ] {
        let set = format!("integrator.{key}={value}");
        let path = format!("integrator.{key}");
        idle(PRESCRIBED, &[&set], &path, "the test has no structure");
    }
    let audit = "safety.step_audit={warn=1e-9}";
    idle(PRESCRIBED, &[audit], "safety.step_audit", "no structure");
    idle(
        GOOD,
        &["safety.confirm=true"],
        "safety.confirm",
        "only with `zero_s`",
    );
    assert_eq!(
        told(GOOD, &["safety.confirm=true", "safety.zero_s=0.1"]),
        [""; 0]
    );
    for (key, value) in [
        ("confirm", "true"),
        ("zero_s", "1"),
        ("exit_speed_m_per_s", "1"),
        ("resume_within_m", "1"),
        ("resume_within_n", "1"),
        ("added_energy_share", "{warn=0.1,floor_j=1}"),
        ("stability_used", "{warn=0.5}"),
        ("ramp_s", "3"),
    ] {
        let set = format!("safety.{key}={value}");
        idle(BARE, &[&set], &format!("safety.{key}"), "specimen");
    }
    let settled = "structure.static_load_n=[1.0]";
    assert_eq!(told(BARE, &["safety.ramp_s=3", settled]), [""; 0]);
    assert_eq!(told(BARE, &["safety.ease_s=3"]), [""; 0]);
}

#[test]
fn confirmation_without_readings_is_refused() {
    for (text, sets, waits) in [
        (GOOD, &["safety.confirm=true"][..], false),
        (GOOD, &["safety.confirm=true", "safety.zero_s=0.1"], true),
        (BARE, &["safety.confirm=true"], false),
        (LINKED, &["safety.confirm=true"], true),
        (LINKED, &[], false),
        (
            LINKED,
            &["specimen.0.axis=[{zero_force=\"relative\"}]"],
            true,
        ),
    ] {
        let prepared = build(&accepted(text, sets)).unwrap();
        let found = [prepared.facts.confirm, prepared.experiment.opening.confirm];
        assert_eq!(found, [waits; 2], "{sets:?} of {text}");
    }
    let error = read(GOOD, &["safety.confirm=true", "safety.zero_s=0"]).unwrap_err();
    shows(&error.to_string(), "to confirm");
}

#[test]
fn idle_specimen_keys_are_reported() {
    idle(
        PRESCRIBED,
        &["specimen.0.mass_in_force_kg=5"],
        "specimen[0].mass_in_force_kg",
        "no",
    );
    let seed = "specimen.0.transfer={delay_s=0.01,seed=7}";
    idle(
        GOOD,
        &[seed],
        "specimen[0].transfer.seed",
        "no sensor of this specimen has noise",
    );
    let held = "specimen.0.transfer={delay_s=0.01,between_ticks=\"held\"}";
    idle(
        GOOD,
        &[held],
        "specimen[0].transfer.between_ticks",
        "an `actuator` with a lag",
    );
    let zero = "specimen.0.axis=[{zero_disp=\"relative\",offset_m=0.01}]";
    idle(
        LINKED,
        &[zero],
        "specimen[0].axis[0].offset_m",
        "reading before the test",
    );
    let at = "excitation.prescribed_displacement.0.at=actuators";
    idle(
        PRESCRIBED,
        &[at],
        "excitation.prescribed_displacement[0].at",
        "`geometry`",
    );
    idle(PRESCRIBED, &["record.dofs=all"], "record.dofs", "no DOFs");
    idle(
        BARE,
        &["time.prediction_order=3"],
        "time.prediction_order",
        "no specimen",
    );
}

#[test]
fn idle_integrator_keys_are_reported() {
    let bound = ["integrator.gain_bound=3", "integrator.lambda=4"];
    idle(GOOD, &bound, "integrator.gain_bound", "is a number");
    let ordinary = ["timing.policy=ordinary", "timing.priority=50"];
    idle(GOOD, &ordinary, "timing.priority", "has no priority");
    let computed = ["timing.on_miss=catch_up", "timing.max_catch_up_ticks=7"];
    assert_eq!(told(GOOD, &computed), [""; 0]);
    idle(
        LINKED,
        &["timing.max_catch_up_ticks=5"],
        "timing.max_catch_up_ticks",
        "catch_up",
    );
}

#[test]
fn simulated_clock_reports_machine_keys() {
    let text = GOOD.with("time.clock = 'simulated'");
    let asked = [
        "timing.priority=50",
        "timing.misses.in_total.trip=3",
        "timing.warmup_ticks=4",
    ];
    let told_of = told(&text, &asked);
    let [one] = told_of.as_slice() else {
        panic!("{told_of:?}");
    };
    shows(one, "`priority`, `misses`");
    assert!(!one.contains("warmup_ticks"), "{one}");
    // A user who overrides the clock to be simulated knows it.
    let chosen = [asked.as_slice(), &["time.clock=simulated"]].concat();
    assert_eq!(told(GOOD, &chosen), [""; 0]);
}

#[test]
fn controller_keys_of_a_server_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.toml");
    let served = |text: &str| {
        std::fs::write(&path, text).unwrap();
        load_serve_file(&path, None).unwrap().warnings
    };
    let usual = "[[specimen]]\nname = \"a\"\nlaw = { linear = { stiffness_n_per_m = 1e5 } }\n";
    assert_eq!(served(usual), [""; 0]);
    let limited = "[timing]\nspin_us = 10\npolicy = \"ordinary\"\n[record]\nqueue_s = 9\n";
    assert_eq!(served(&format!("{usual}{limited}")), [""; 0]);
    for (added, path) in [
        ("axis = [{ sign = -1 }]", "specimen[0].axis[0].sign"),
        ("axis = [{ scale = 2 }]", "specimen[0].axis[0].scale"),
        ("similitude = { length = 10 }", "specimen[0].similitude"),
        ("reach_disp_m = 0.1", "specimen[0].reach_disp_m"),
        ("capacity = { stroke_m = 0.1 }", "specimen[0].capacity"),
        ("mass_in_force_kg = 3", "specimen[0].mass_in_force_kg"),
        ("[timing]\non_miss = \"stop\"", "timing.on_miss"),
        ("[record]\ncheckpoint_s = 9", "record.checkpoint_s"),
    ] {
        let warnings = served(&format!("{usual}{added}\n"));
        let [one] = warnings.as_slice() else {
            panic!("{added}: {warnings:?}");
        };
        shows(one, &format!("`{path}`"));
    }
}

#[test]
fn bounds_without_estimates_are_reported() {
    let told = |text: &str, sets: &[&str]| {
        let prepared = build(&accepted(text, sets)).unwrap();
        prepared.facts.warnings
    };
    let ratio = "specimen.0.limits.damping_ratio.trip=2";
    let found = told(GOOD, &[ratio]);
    assert_eq!(found.len(), 1, "{found:?}");
    shows(&found[0], "`specimen[0].limits.damping_ratio`");
    shows(&found[0], "axis 1");
    let damped = "specimen.0.law={linear={stiffness_n_per_m=1e6,damping_n_s_per_m=100}}";
    assert_eq!(told(GOOD, &[ratio, damped]), [""; 0]);
    let audit = "safety.step_audit={trip=1e-3}";
    let found = told(
        GOOD,
        &[
            audit,
            "integrator.method=kr_alpha",
            "integrator.rho_infinity=0.5",
        ],
    );
    assert!(
        found
            .iter()
            .any(|text| text.contains("`safety.step_audit`")),
        "{found:?}"
    );
    assert_eq!(told(GOOD, &[audit]), [""; 0]);
}

#[test]
fn reach_of_a_bounded_law_is_reported() {
    let hardening = "specimen.0.law={square_root={stiffness_n_per_m=1e6,hardening_per_sqrt_m=1}}";
    for key in ["reach_disp_m", "reach_vel_m_per_s"] {
        let set = format!("specimen.0.{key}=0.1");
        let path = format!("specimen[0].{key}");
        for text in [GOOD, PRESCRIBED] {
            idle(text, &[&set], &path, "is bounded without it");
        }
        idle(LINKED, &[&set], &path, "`hardening_bound`");
    }
    assert_eq!(
        told(GOOD, &[hardening, "specimen.0.reach_disp_m=0.1"]),
        [""; 0]
    );
}

#[test]
fn gain_beside_coefficients_is_reported() {
    let ats =
        |gain: &str| format!("specimen.0.compensation={{ats={{order=1,start=[1.0,0.02]{gain}}}}}");
    idle(
        LINKED,
        &[&ats(",gain=0.9")],
        "specimen[0].compensation.ats.gain",
        "`start`",
    );
    idle(
        LINKED,
        &[&ats(",delay_s=0.02")],
        "specimen[0].compensation.ats.delay_s",
        "`start` already gives the coefficients",
    );
    assert_eq!(told(LINKED, &[&ats("")]), [""; 0]);
}
