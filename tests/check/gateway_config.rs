//! Mistakes in a gateway's file are shown at their place, before anything is connected.

use crate::common::test_file::TestFile;
use crate::link_common::{COMPUTED, finish, gateway, gusset, linked, write};
use gusset_config as config;
use gusset_quantity::catalog::limit::Limit;
use gusset_setup as setup;

const KNOWN: &str = "stiffness_n_per_m = 4e5\n";

fn served(text: &str) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "serve.toml", text);
    setup::load_served(&path, None)
        .map(|_| ())
        .map_err(|error| error.to_string())
}

fn complaint(table: &str, link: &str) -> String {
    served(&gateway("127.0.0.1:1", table, link)).unwrap_err()
}

fn shows(text: &str, part: &str) {
    assert!(text.contains(part), "{part:?} is not in:\n{text}");
}

#[test]
fn gateway_file_is_a_specimen_with_a_link() {
    assert_eq!(served(&gateway("127.0.0.1:1", KNOWN, "")), Ok(()));
    assert_eq!(served(&linked(10, "127.0.0.1:1", "")), Ok(()));
    let element = "protocol = \"openfresco\"";
    assert_eq!(served(&gateway("127.0.0.1:1", KNOWN, element)), Ok(()));
}

#[test]
fn ineffective_or_missing_keys_are_refused() {
    shows(&complaint("", ""), "`stiffness_n_per_m` is missing");
    let scaled = "axis = [{ scale = 2.0, sign = -1, offset_m = 0.1, offset_n = 5 }]\nsimilitude.length = 10\n";
    let converting = gateway("127.0.0.1:1", &format!("{KNOWN}{scaled}"), "");
    assert_eq!(served(&converting), Ok(()));
    // The controller of a test file converts: its numbers are not passed on to others.
    let of_a_test = linked(10, "127.0.0.1:1", "").with("specimen.similitude.length = 10");
    shows(&served(&of_a_test).unwrap_err(), "similitude");
    let led = gateway(
        "127.0.0.1:1",
        &format!("{KNOWN}compensation.ats = {{ delay_s = 0.01 }}\n"),
        "",
    );
    shows(&served(&led).unwrap_err(), "evenly spaced");
    let paced = |keys: &str| led.with(&format!("serve.pace = {{ {keys} }}"));
    assert_eq!(
        served(&paced("ticks_per_step = 20, rate_hz = 1000")),
        Ok(())
    );
    for (keys, key) in [
        ("ticks_per_step = 1, rate_hz = 1000", "ticks_per_step"),
        ("ticks_per_step = 20, rate_hz = 0.5", "rate_hz"),
        (
            "ticks_per_step = 20, rate_hz = 1000, settle_ticks = 70000",
            "settle_ticks",
        ),
    ] {
        shows(&served(&paced(keys)).unwrap_err(), key);
    }
    const PREDICTS: &str = "ticks_per_step = 20, rate_hz = 1000, between = \"predict\"";
    const LIMITS: &str = "specimen.limits = { command_vel_m_per_s = { trip = 1 }, command_accel_m_per_s2 = { trip = 1e5 } }";
    let predicts = |keys: &str| {
        let text = paced(&format!("{PREDICTS}, {keys}")).with("serve.protocol = \"openfresco\"");
        text.with(LIMITS)
    };
    assert_eq!(served(&predicts("predict_within_m = 0.01")), Ok(()));
    assert_eq!(
        served(&predicts(
            "predict_within_m = [0.01], prediction_by_velocity = true"
        )),
        Ok(())
    );
    for (keys, key) in [
        ("prediction_order = 3", "`predict_within_m`"),
        ("predict_within_m = 0", "`predict_within_m`"),
        ("predict_within_m = [0.01, 0.02]", "`predict_within_m`"),
        (
            "predict_within_m = 0.01, settle_ticks = 5",
            "`settle_ticks`",
        ),
        (
            "predict_within_m = 0.01, prediction_order = 4",
            "`serve.pace.prediction_order`",
        ),
        (
            "predict_within_m = 0.01, prediction_order = 2, prediction_by_velocity = true",
            "`prediction_order`",
        ),
        ("predict_within_m = 0.01, slow_at = 0.9", "`slow_at`"),
        ("predict_within_m = 0.01, slow_at = 0.75", "1.0 ticks"),
        (
            "predict_within_m = 0.01, correct = \"initial_stiffness\"",
            "`correct_at_most_n`",
        ),
        (
            "predict_within_m = 0.01, correct_at_most_n = 10",
            "`correct_at_most_n`",
        ),
    ] {
        shows(&served(&predicts(keys)).unwrap_err(), key);
    }
    // From 1 m/s to rest in 4 ticks takes 255 m/s²; here a compensator leads, too.
    let hard = "specimen.limits.command_accel_m_per_s2 = { trip = 255 }";
    shows(
        &served(&predicts("predict_within_m = 0.01").with(hard)).unwrap_err(),
        "`ticks_per_step` to",
    );
    let unbounded = LIMITS.replace("command_accel_m_per_s2", "command_step_m");
    shows(
        &served(
            &paced(&format!("{PREDICTS}, predict_within_m = 0.01"))
                .with("serve.protocol = \"openfresco\"")
                .with(&unbounded),
        )
        .unwrap_err(),
        "`command_accel_m_per_s2`",
    );
    shows(
        &served(&paced("ticks_per_step = 20, rate_hz = 1000, slow_at = 0.5")).unwrap_err(),
        "`serve.pace.slow_at` has no effect",
    );
    let udp = predicts("predict_within_m = 0.01").with("serve.transport = \"udp\"");
    shows(&served(&udp).unwrap_err(), "stream");
    let limited = format!("{KNOWN}limits.lag_s = {{ trip = 0.01 }}\n");
    let limited = gateway("127.0.0.1:1", &limited, "");
    shows(&served(&limited).unwrap_err(), "evenly spaced");
    let trials = gateway("127.0.0.1:1", KNOWN, "").with("serve.openfresco.iterates_within_m = -1");
    shows(&served(&trials).unwrap_err(), "iterates_within_m");
    let inches = format!("{KNOWN}[[specimen.axis]]\nunit_disp = \"in\"\n");
    shows(&complaint(&inches, ""), "`unit_disp`");
    shows(&complaint(KNOWN, "key_file = \"none.key\""), "be read");
    let two = "stiffness_n_per_m = 4e5\n[[specimen.axis]]\n[[specimen.axis]]\n";
    shows(&complaint(two, ""), "not 2 × 2");
}

#[test]
fn gateway_refuses_zeroing_it_does_not_do() {
    for (key, offset) in [("zero_force", "offset_n"), ("zero_disp", "offset_m")] {
        for more in ["", ", sign = -1", &format!(", {offset} = 0.5")] {
            let axis = format!("{KNOWN}axis = [{{ {key} = \"relative\"{more} }}]\n");
            let said = complaint(&axis, "");
            shows(&said, &format!("axis = [{{ {key}"));
            shows(&said, offset);
            assert!(!said.contains("no effect"), "{said}");
        }
    }
    // The controller of a test file takes the zero itself.
    let of_a_test = linked(10, "127.0.0.1:1", "")
        .with("safety.zero_s = 1\n[[specimen.axis]]\nzero_force = 'relative'");
    assert_eq!(served(&of_a_test), Ok(()));
}

#[test]
fn contradicting_limits_are_shown_at_keys() {
    for (limits, words) in [
        ("command_step_m = { warn = 2, trip = 1 }", "warns at 2"),
        ("command_disp_m = { trip = [1, -1] }", "leaves no room"),
        ("measured_force_n = {}", "neither a `warn` nor a `trip`"),
        ("force_n = { trip = 1 }", "force_n"),
        ("measured_force_n = { trp = [1, 2] }", "trip"),
    ] {
        let table = format!("{KNOWN}[specimen.limits]\n{limits}\n");
        shows(&complaint(&table, ""), words);
    }
    let of_axis =
        format!("{KNOWN}[[specimen.axis]]\nlimits = {{ command_step_m = {{ trip = 0 }} }}\n");
    shows(&complaint(&of_axis, ""), "greater than");
}

#[test]
fn impossible_probe_is_shown_at_its_key() {
    let probe = |known: &str, keys: &str| {
        let file = gateway("127.0.0.1:1", known, "").without("specimen.0.link.probe");
        served(&file.with(&format!("[specimen.link]\n{keys}"))).unwrap_err()
    };
    shows(&probe(KNOWN, "probe_m = 0"), "probe_m");
    shows(&probe(KNOWN, "probe_m = -1e-3"), "greater than");
    shows(
        &probe(KNOWN, "probe_m = 1e-3\nprobe_ramp_s = 0"),
        "probe_ramp_s",
    );
    shows(&probe(KNOWN, "probe = \"maybe\""), "none");
    shows(&complaint(KNOWN, "probe_m = 1e-3"), "contradict");
    shows(
        &probe("stiffness_n_per_m = 0\n", "probe_m = 1e-3"),
        "stiffness",
    );
}

#[test]
fn limits_of_a_test_are_kept_by_its_loop() {
    let text = linked(10, "127.0.0.1:1", "").with("specimen.limits.command_step_m.trip = 1");
    let path = std::path::Path::new("test.toml");
    let built = config::parse(path, text, &[]).and_then(|loaded| setup::build(&loaded));
    let limits = built.unwrap().experiment.ports[0].guard().declared()[0];
    assert_eq!(limits.size(Limit::CommandStep).trip, 1.0);
}

/// A gateway with these keys of `[serve]`, to a specimen with these of its table. Returns its verdict and the exit codes of `check`
/// and `serve`; the latter only where the gateway would refuse.
fn judged(serve: &str, table: &str, link: &str) -> (serde_json::Value, i32, Option<i32>) {
    let folder = tempfile::tempdir().unwrap();
    let text = gateway("127.0.0.1:1", &format!("{KNOWN}{table}"), "");
    let text = text
        .without("specimen.0.link.computed")
        .with(&format!("[specimen.link]\n{link}"));
    let path = write(
        folder.path(),
        "serve.toml",
        &format!("[serve]\n{serve}\n{text}"),
    );
    let mut check = gusset();
    check.arg("check").arg(&path).arg("--json");
    let check = finish(check);
    let found: serde_json::Value = serde_json::from_slice(&check.stdout).unwrap();
    let code = check.status.code().unwrap();
    let served = (code != 0).then(|| {
        let mut serve = gusset();
        serve.arg("serve").arg(&path);
        serve.args(["--listen", "127.0.0.1:0"]);
        finish(serve).status.code().unwrap()
    });
    (found["verdict"].clone(), code, served)
}

#[test]
fn gateway_that_rests_refuses_a_damper() {
    const PACED: &str = "pace = { ticks_per_step = 20, rate_hz = 1000 }";
    const ELEMENT: &str = "protocol = \"openfresco\"";
    const DAMPED: &str = "damping_n_s_per_m = 4e3\n";
    const FRICTION: &str =
        "law.smooth_friction = { slip_force_n = 1e3, reference_velocity_m_per_s = 0.01 }\n";
    for (serve, table, link, key) in [
        (PACED, DAMPED, COMPUTED, "serve.pace"),
        (PACED, FRICTION, COMPUTED, "serve.pace"),
        (ELEMENT, DAMPED, "", "specimen[0].link"),
    ] {
        let (verdict, check, serve) = judged(serve, table, link);
        assert_eq!((check, serve), (1, Some(2)), "{verdict}");
        let finding = &verdict["findings"][0];
        assert_eq!(finding["kind"], "speed");
        assert_eq!(finding["severity"], "error");
        assert_eq!(finding["key"], key);
    }
    // A computed specimen takes the velocity of each target, and the protocol of Gusset has ticks.
    for (serve, table, link) in [
        (ELEMENT, DAMPED, COMPUTED),
        ("", DAMPED, ""),
        (PACED, "", COMPUTED),
    ] {
        let (verdict, check, _) = judged(serve, table, link);
        assert_eq!(check, 0);
        assert_eq!(verdict["outcome"], "clear");
    }
}
