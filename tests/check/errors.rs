//! Errors of method and coupling: numbers, findings, and what they forbid.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use super::verdict::{Said, gusset};
use crate::common::test_file::TestFile;

/// Mass on a spring in series with a yielding spring. The joint has no mass.
const SERIES: &str = r#"[time]
rate_hz = 1024
duration_s = 10
clock = "simulated"
[structure.matrices]
mass = [[1000.0, 0], [0, 0]]
stiffness = [[1e6, -1e6], [-1e6, 1e6]]
influence = [1, 1]
[[structure.element]]
from = "ground"
to = 2
law.bilinear = { stiffness_n_per_m = 1e7, yield_force_n = 5000.0, post_yield_ratio = 0.01 }
[excitation.ground_acceleration]
signal.sine = { amplitude = 4.0, frequency_hz = 2.3, duration_s = 10 }
[integrator]
lambda = 3.9
"#;

/// Mass, spring and dashpot, whose spring is the specimen.
fn oscillator(specimen: &str, integrator: &str, clock: &str) -> String {
    format!(
        "[time]\nrate_hz = 512\nduration_s = 12\nclock = \"{clock}\"\n\
         [structure.matrices]\nmass = [[1000.0]]\nstiffness = [[0.0]]\ndamping = [[{DAMPING}]]\n{integrator}\
         [excitation.ground_acceleration.signal.sine]\namplitude = 0.5\nfrequency_hz = 2.0\nduration_s = 12\n\
         [[specimen]]\nname = \"spring\"\nrows = [[1]]\nstiffness_n_per_m = {STIFFNESS}\n{specimen}"
    )
}

const STIFFNESS: f64 = 1.6e5;
const DAMPING: f64 = 1265.0;
const LAW: &str = "law.linear = { stiffness_n_per_m = 1.6e5 }\n";

fn check(text: &str) -> Said {
    gusset(TempDir::new().unwrap().path(), "check", text, &[])
}

fn findings<'a>(said: &'a Said, kind: &str) -> Vec<&'a Value> {
    let all = said.json["verdict"]["findings"].as_array().unwrap();
    all.iter().filter(|one| one["kind"] == kind).collect()
}

#[test]
fn massless_joint_follows_with_any_lambda() {
    for lambda in ["3.9", "2", "11.0", "'auto'"] {
        let said = check(&SERIES.with(&format!("integrator.lambda = {lambda}")));
        assert_eq!(said.code, 0, "{}", said.stderr);
        let method = &said.json["verdict"]["errors"]["method"];
        let of_mass = &method["directions"].as_array().unwrap();
        let of_mass = of_mass.iter().find(|one| one["name"] == "DOF 1").unwrap();
        let number = |key: &str| of_mass[key].as_f64().unwrap();
        // Condensed by hand, the structure moves by 8.61 mm. Half a unit of the last digit.
        assert!((number("reference") - 8.61e-3).abs() < 5e-6, "{of_mass}");
        assert!((number("largest") - 8.61e-3).abs() < 5e-6, "{of_mass}");
    }
    let proven = check(&SERIES.with("integrator.lambda = 'auto'"));
    assert_eq!(proven.json["structure"]["lambda"], 11.5);
}

/// Its last row grows: the weights of the method leave nothing of it at rest.
#[test]
fn massless_joint_of_alpha_is_an_error() {
    let series = SERIES
        .without("integrator.lambda")
        .with("integrator.method = 'kr_alpha'\nintegrator.rho_infinity = 1.0");
    let said = check(&series);
    assert_eq!(said.code, 1, "{}", said.stderr);
    let found = findings(&said, "error");
    assert_eq!(found[0]["severity"], "error");
    assert_eq!(found[0]["key"], "integrator");
    let accepted = format!("{series}[safety]\naccept_error = \"a study\"\n");
    let said = check(&accepted);
    assert_eq!(said.code, 0);
    assert_eq!(said.json["verdict"]["outcome"], "accepted");
    let wide = format!("{series}[safety]\nerror_warn = 0.1\nerror_refuse = 20.0\n");
    let said = check(&wide);
    assert_eq!((said.code, findings(&said, "error").len()), (0, 1));
    assert_eq!(findings(&said, "error")[0]["severity"], "warning");
    for wrong in ["error_warn = 0.3", "error_warn = 5\nerror_refuse = 5"] {
        assert_eq!(check(&format!("{series}[safety]\n{wrong}\n")).code, 2);
    }
}

/// A limit trips halfway; the resumed test is the same one, and so are its errors.
#[test]
fn resume_keeps_errors_of_the_first_part() {
    let folder = tempfile::tempdir().unwrap();
    let text = SERIES.with("time.duration_s = 3\nexcitation.ground_acceleration.signal.sine.duration_s = 3\n[[specimen]]\nname = \"weak\"\nrows = [[1, 0]]\nlaw.linear = { stiffness_n_per_m = 1.0 }\n\
           limits.command_disp_m = { trip = [-0.004, 0.004] }\n");
    let first = gusset(folder.path(), "run", &text, &[]);
    assert_eq!(first.code, 1, "{}", first.stderr);
    let mut again = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    let wide = "specimen.0.limits.command_disp_m.trip=[-1,1]";
    again.args(["run", "--after-trip", "--set", wide, "--reason", "wider"]);
    again.arg("--resume").arg(folder.path().join("out"));
    let out = folder.path().join("resumed");
    let said = again.arg("--out").arg(&out).output().unwrap();
    assert!(
        said.status.success(),
        "{}",
        String::from_utf8_lossy(&said.stderr)
    );
    let summary = |out: &Path| -> Value {
        serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap()
    };
    let [one, two] = [folder.path().join("out"), out].map(|out| summary(&out));
    assert!(one["verdict"]["errors"].is_object());
    assert_eq!(one["verdict"]["errors"], two["verdict"]["errors"]);
}

#[test]
fn ideal_linear_test_has_small_known_errors() {
    let said = check(&oscillator(LAW, "[integrator]\nlambda = 4\n", "simulated"));
    assert_eq!(said.code, 0, "{}", said.stderr);
    let errors = &said.json["verdict"]["errors"];
    // Period error (1/4 − 1/24)... of Ω = 12.65/512: 0.02²·(1/8 − 1/24) is 5e-5 a cycle; 24 cycles change the peak by less than 1 %.
    for key in ["drift", "energy"] {
        assert!(errors["method"][key].as_f64().unwrap() < 0.01, "{errors}");
        assert!(errors["coupling"][key].as_f64().unwrap() < 1e-9, "{errors}");
    }
    assert!(errors["modes"].as_array().unwrap().is_empty());
    assert!(findings(&said, "error").is_empty());
}

#[test]
fn delay_is_an_error_of_the_coupling() {
    // Half of 0.05 is lost: ζ_c = −ω τ/2 to the first order, of the lag of a delay sin(ω τ)/2.
    let omega = (STIFFNESS / 1000.0).sqrt();
    let delay = 0.006;
    let specimen = format!("{LAW}transfer.delay_s = {delay}\n");
    let said = check(&oscillator(&specimen, "", "simulated"));
    let errors = &said.json["verdict"]["errors"];
    let mode = &errors["modes"][0];
    let added = mode["added_ratio"].as_f64().unwrap();
    assert!(
        (added + libm::sin(omega * delay) / 2.0).abs() < 1e-6,
        "{mode}"
    );
    let own = mode["damping_ratio"].as_f64().unwrap();
    assert!((own - DAMPING / (2.0 * 1000.0 * omega)).abs() < 1e-12);
    // At resonance the response is 1/(2ζ): 0.05 against 0.05 − 0.038.
    assert!(
        errors["coupling"]["drift"].as_f64().unwrap() > 0.5,
        "{errors}"
    );
    // A delay adds energy.
    assert!(errors["coupling"]["added_energy"].as_f64().unwrap() > 0.1);
    let found = findings(&said, "error");
    let severities: Vec<_> = found.iter().map(|one| &one["severity"]).collect();
    assert_eq!(severities, ["error", "warning"], "{found:?}");
    assert_eq!(said.code, 1);
}

#[test]
fn large_error_behind_a_link_is_refused() {
    let link = "link = { address = \"127.0.0.1:1\", computed = true, connect_timeout_s = 0.2 }\n\
                transfer.delay_s = 0.006\n\
                limits = { command_disp_m = { trip = [-1, 1] }, measured_force_n = { trip = [-1e6, 1e6] } }\n";
    let folder = TempDir::new().unwrap();
    let text = oscillator(link, "", "real");
    let said = gusset(folder.path(), "run", &text, &[]);
    assert_eq!(said.code, 2, "{}", said.stderr);
    assert!(said.stderr.contains("accept_error"), "{}", said.stderr);
    assert!(!folder.path().join("out").exists());
    let accepted = format!("[safety]\naccept_error = \"a study\"\n{text}");
    // It connected, and the link failed without a listener.
    let said = gusset(folder.path(), "run", &accepted, &[]);
    assert_eq!(said.code, 3, "{}", said.stderr);
    assert_eq!(said.json["accepted"]["accept_error"], "a study");
}

#[test]
fn run_and_report_carry_the_errors() {
    let folder = TempDir::new().unwrap();
    let specimen = format!("{LAW}transfer.delay_s = 0.006\n");
    let text = oscillator(&specimen, "", "simulated");
    let said = gusset(folder.path(), "run", &text, &[]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let drift = said.json["verdict"]["errors"]["coupling"]["drift"].as_f64();
    assert!(drift.unwrap() > 0.5);
    assert!(said.stderr.contains("error, coupling"), "{}", said.stderr);
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("class=\"verdict bad\""));
    assert!(page.contains("Error of the coupling"));
    let ideal = TempDir::new().unwrap();
    let text = oscillator(LAW, "", "simulated");
    assert_eq!(gusset(ideal.path(), "run", &text, &[]).code, 0);
    let page = std::fs::read_to_string(ideal.path().join("out/report.html")).unwrap();
    assert!(page.contains("class=\"verdict good\""));
}

#[test]
fn error_without_a_reference_is_not_known() {
    let limits = "limits = { command_disp_m = { trip = [-1, 1] }, measured_force_n = { trip = [-1e6, 1e6] } }\n";
    let link = "damping_n_s_per_m = 0\nlink = { address = \"127.0.0.1:1\", computed = true }\n";
    let text = oscillator(&format!("{link}{limits}"), "", "simulated")
        .with("specimen.stiffness_n_per_m = 0\nstructure.matrices.stiffness = [[1.6e5]]");
    let said = check(&text);
    let errors = &said.json["verdict"]["errors"];
    for key in ["method", "coupling"] {
        assert!(errors[key]["not_known"].is_string(), "{errors}");
        assert!(errors[key]["drift"].is_null());
    }
    assert_eq!(findings(&said, "unknown").len(), 2);
    // Too long for the budget of the rehearsal.
    let long = oscillator(LAW, "", "simulated").with("time.duration_s = 600");
    let said = check(&long);
    assert!(said.json["verdict"]["errors"]["method"]["not_known"].is_string());
    // The actuator of a specimen behind a link is not known.
    let real = "link = { address = \"127.0.0.1:1\" }\n";
    let said = check(&oscillator(&format!("{real}{limits}"), "", "simulated"));
    let errors = &said.json["verdict"]["errors"];
    assert!(errors["coupling"]["not_known"].is_string(), "{errors}");
    assert!(errors["method"]["drift"].as_f64().unwrap() < 0.01);
}

/// A mass between two wells: whether it crosses the middle depends on the step.
#[test]
fn double_well_has_no_known_error() {
    let wells = "[time]\nrate_hz = 256\nduration_s = 40\nclock = \"simulated\"\n\
        [structure.shear_building]\nmass_kg = [1000]\nstiffness_n_per_m = [0]\n[integrator]\nlambda = 4\n\
        [[specimen]]\nname = \"buckled\"\nstorey = 1\n\
        law.cubic = { stiffness_n_per_m = -40e3, cubic_n_per_m3 = 40e7, reference_stiffness_n_per_m = 80e3 }\n\
        [excitation.ground_acceleration]\nsignal.sine = { amplitude = 2, frequency_hz = 0.9, duration_s = 40 }\n";
    let said = check(wells);
    let method = &said.json["verdict"]["errors"]["method"];
    assert!(method["not_known"].is_string(), "{method}");
    assert!(!findings(&said, "unknown").is_empty());
}

#[test]
fn static_friction_does_not_slow_the_motion() {
    let text = |law: &str, integrator: &str| {
        format!(
            "[time]\nrate_hz = 1024\nduration_s = 6\nclock = \"simulated\"\n\
             [structure.matrices]\nmass = [[50e3]]\nstiffness = [[5e6]]\ndamping = [[2e4]]\n\
             [[structure.element]]\nfrom = \"ground\"\nto = 1\nlaw.{law}\n\
             [integrator]\nstart = \"second-order\"\n{integrator}\
             [excitation.ground_acceleration.signal.sine]\namplitude = 2.0\nfrequency_hz = 1.3\nduration_s = 6\n"
        )
    };
    let friction = "smooth_friction = { slip_force_n = 40e3, reference_velocity_m_per_s = 0.001 }";
    let damper = "power_damper = { force_at_unit_velocity_n = 50e3, exponent = 0.5, linear_below_m_per_s = 0.01 }";
    let drift = |text: &str| {
        let said = check(text);
        let drift = said.json["verdict"]["errors"]["method"]["drift"].as_f64();
        drift.unwrap_or_else(|| panic!("{}", said.stderr))
    };
    for law in [friction, damper] {
        let element = text(law, "");
        assert!(drift(&element) < 0.01, "{law}");
        // The law of a specimen is treated as that of an element.
        let specimen = format!("[[specimen]]\nname = 'law'\nrows = [[1]]\nlaw.{law}");
        let specimen = element.without("structure.element").with(&specimen);
        assert!(drift(&specimen) < 0.01, "{law}");
    }
    // All damping at rest in C0 adds Δt/2 · 4e7 N s/m = 19.5 t to 50 t.
    let whole = text(friction, "rest_damping_share = 1.0\n");
    assert!(drift(&whole) > 0.05);
    assert_eq!(check(&text(friction, "rest_damping_share = 1.5\n")).code, 2);
}

/// Four storeys; the first one is behind a link and follows 5 ms late, which is close to its critical delay of 5.8 ms.
const NEARLY_CRITICAL: &str = r#"[time]
rate_hz = 1024
duration_s = 6
clock = "simulated"
[structure.shear_building]
mass_kg = [30e3, 30e3, 30e3, 25e3]
stiffness_n_per_m = [0, 35e6, 30e6, 25e6]
[structure.damping.rayleigh_ratio]
ratio = 0.03
modes = [1, 2]
[excitation.ground_acceleration]
signal.sine = { amplitude = 1.0, frequency_hz = 5.0, duration_s = 6 }
[[specimen]]
name = "storey1"
storey = 1
transfer.delay_s = 0.005
law.bilinear = { stiffness_n_per_m = 40e6, yield_force_n = 320e3, post_yield_ratio = 0.05 }
"#;

#[test]
fn nearly_critical_delay_is_shown() {
    let said = check(NEARLY_CRITICAL);
    let errors = &said.json["verdict"]["errors"];
    let mode = &errors["modes"][1];
    assert!((mode["damping_ratio"].as_f64().unwrap() - 0.03).abs() < 1e-9);
    // 0.5 % of 3 % is left.
    let added = mode["added_ratio"].as_f64().unwrap();
    assert!((added + 0.0254).abs() < 1e-4, "{mode}");
    let drift = errors["coupling"]["drift"].as_f64().unwrap();
    assert!(drift > 0.05, "{errors}");
    let storeys = errors["coupling"]["directions"].as_array().unwrap();
    assert_eq!(storeys.len(), 4);
    assert!(storeys.iter().all(|one| one["unit"] == "m"));
    let found = findings(&said, "error");
    let of_modes: Vec<_> = (found.iter().map(|one| &one["numbers"]["added_ratio"]))
        .filter_map(Value::as_f64)
        .collect();
    assert!(of_modes.contains(&added), "{found:?}");
    let folder = TempDir::new().unwrap();
    let said = gusset(folder.path(), "run", NEARLY_CRITICAL, &[]);
    assert_eq!(said.code, 0, "{}", said.stderr);
    let summary = std::fs::read_to_string(folder.path().join("out/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(&summary["verdict"]["errors"], errors);
    assert!(said.stderr.contains("error, coupling"), "{}", said.stderr);
    assert!(said.stderr.contains("to mode 2"));
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(!page.contains("class=\"verdict good\""));
    assert!(page.contains("coupling is"));
    assert!(page.contains("to mode 2"));
}

#[test]
fn undamped_mode_may_lose_little_damping() {
    let undamped = |delay: f64| {
        let specimen = format!("{LAW}transfer.delay_s = {delay}\n");
        let text = oscillator(&specimen, "", "simulated");
        let said = check(&text.without("structure.matrices.damping"));
        let added = said.json["verdict"]["errors"]["modes"][0]["added_ratio"].as_f64();
        let found = findings(&said, "error").into_iter();
        let found = found.filter(|one| one["numbers"]["added_ratio"].is_f64());
        let severities: Vec<_> = found.map(|one| one["severity"].clone()).collect();
        (added.unwrap(), severities)
    };
    // ζ_c = −sin(ω τ)/2 is −0.04 % and −0.06 %; the limit is −0.05 %.
    let omega = (STIFFNESS / 1000.0).sqrt();
    for (share, is_found) in [(4e-4, false), (6e-4, true)] {
        let (added, severities) = undamped(2.0 * share / omega);
        assert!((added + share).abs() < 1e-6, "{added}");
        assert_eq!(severities.len(), usize::from(is_found));
        assert!(severities.iter().all(|one| one == "warning"));
    }
}

/// A damper behind a link at a rate of a tenth.
#[test]
fn slow_damper_is_an_error_of_the_coupling() {
    let text = |scale: f64| {
        format!(
            "[time]\nrate_hz = 200\nduration_s = 4\nclock = \"real\"\nscale = {scale}\n\
             [structure.matrices]\nmass = [[40e3]]\nstiffness = [[5e6]]\ndamping = [[8e3]]\n\
             [excitation.ground_acceleration.signal.sine]\namplitude = 1.0\nfrequency_hz = 1.8\nduration_s = 4\n\
             [[specimen]]\nname = \"damper\"\nrows = [[1]]\nstiffness_n_per_m = 0\ndamping_n_s_per_m = 6e4\n\
             limits = {{ command_disp_m = {{ trip = [-0.5, 0.5] }}, measured_force_n = {{ trip = [-2e5, 2e5] }} }}\n\
             link = {{ address = \"127.0.0.1:1\", computed = true }}\n"
        )
    };
    let worst = |said: &Said| said.json["verdict"]["errors"]["coupling"]["directions"][0].clone();
    let (own, slow) = (check(&text(1.0)), check(&text(10.0)));
    assert!(worst(&own)["error"].as_f64().unwrap() < 1e-9);
    let found = findings(&slow, "error");
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0]["severity"], "error");
    // The reference is the test at its own velocities.
    let (own, slow) = (worst(&own), worst(&slow));
    assert!(slow["error"].as_f64().unwrap() > 0.5, "{slow}");
    let reference = |of: &Value| of["reference"].as_f64().unwrap();
    assert!((reference(&own) / reference(&slow) - 1.0).abs() < 1e-9);
}

#[test]
fn massless_joint_is_refused_behind_a_link() {
    let (structure, _) = SERIES.split_once("[[structure.element]]").unwrap();
    let excitation = &SERIES[SERIES.find("[excitation").unwrap()..];
    let text = format!(
        "{structure}{excitation}[[specimen]]\nname = \"yielding\"\nrows = [[0, 1]]\nstiffness_n_per_m = 1e7\n\
         law.bilinear = {{ stiffness_n_per_m = 1e7, yield_force_n = 5000.0, post_yield_ratio = 0.01 }}\n\
         limits = {{ command_disp_m = {{ trip = [-1, 1] }}, measured_force_n = {{ trip = [-1e6, 1e6] }} }}\n\
         link = {{ address = \"127.0.0.1:1\", computed = true, connect_timeout_s = 0.2 }}\n"
    );
    let text = text.with("time.clock = 'real'");
    let folder = TempDir::new().unwrap();
    let said = gusset(folder.path(), "run", &text, &[]);
    assert_eq!(said.code, 2, "{}", said.stderr);
    assert!(said.stderr.contains("DOF 2"), "{}", said.stderr);
    assert!(!folder.path().join("out").exists());
}

#[test]
fn aliased_excitation_is_a_finding() {
    let plain = oscillator(LAW, "", "simulated");
    assert!(findings(&check(&plain), "error").is_empty());
    let high = plain.with("excitation.ground_acceleration.signal.sine.frequency_hz = 300.0");
    let said = check(&high);
    assert_eq!(
        findings(&said, "error").len(),
        1,
        "{}",
        said.json["verdict"]
    );

    // The record has 40 Hz beside 1 Hz, and the step follows 20 Hz.
    let folder = TempDir::new().unwrap();
    let record = |high: f64| {
        let tau = std::f64::consts::TAU;
        let value = |k: i32| {
            let time = f64::from(k) * 0.005;
            libm::sin(tau * time) + high * libm::sin(40.0 * tau * time)
        };
        let lines: Vec<String> = (0..=2400).map(|k| format!("{}", value(k))).collect();
        std::fs::write(folder.path().join("a.txt"), lines.join("\n")).unwrap();
    };
    let signal = "signal.file = { path = \"a.txt\", unit = \"m/s2\", dt_s = 0.005 }\n";
    let text = plain.without("excitation.ground_acceleration.signal");
    let text = text.with(&format!("[excitation.ground_acceleration]\n{signal}"));
    for (high, count) in [(0.01, 0), (0.5, 1)] {
        record(high);
        let coarse = text.with("time.rate_hz = 40");
        let said = gusset(folder.path(), "check", &coarse, &[]);
        let found = findings(&said, "error");
        let found = found.iter().filter(|one| one["path"] != "integrator");
        assert_eq!(found.count(), count, "{high}: {}", said.json["verdict"]);
    }
    // The peak of the record comes after the end of the test.
    let rising: Vec<String> = (0..=2400).map(|k| format!("{}e-4", k * (k % 2))).collect();
    std::fs::write(folder.path().join("a.txt"), rising.join("\n")).unwrap();
    let early = text.with("time = { duration_s = 3, rate_hz = 200 }");
    let said = gusset(folder.path(), "check", &early, &[]);
    let found = findings(&said, "error");
    assert!(
        found.iter().any(|one| one["path"] != "integrator"),
        "{found:?}"
    );
}

#[test]
fn static_load_hides_no_error() {
    let lag = format!("{LAW}transfer.delay_s = 0.002\n");
    let plain = oscillator(&lag, "", "simulated");
    let loaded = plain.with("structure.static_load_n = [1.6e5]");
    let of = |text: &str| {
        let said = check(text);
        let error = said.json["verdict"]["errors"]["coupling"]["drift"].as_f64();
        error.unwrap_or_else(|| panic!("{}", said.json["verdict"]))
    };
    let (plain, loaded) = (of(&plain), of(&loaded));
    assert!(
        plain > 0.05 && (loaded / plain - 1.0).abs() < 0.01,
        "{plain} {loaded}"
    );
}

#[test]
fn small_drift_of_a_specimen_is_compared() {
    // The other DOF moves a thousand times as far.
    let lag = format!("{LAW}transfer.delay_s = 0.006\n");
    let text = oscillator(&lag, "", "simulated");
    let two = text.with(
        "[structure.matrices]\nmass = [[1000.0, 0], [0, 1000]]\nstiffness = [[0.0, 0], [0, 160]]\n\
         damping = [[1265, 0], [0, 1]]\n[specimen]\nrows = [[1, 0]]\n\
         [[excitation.nodal_force]]\ndofs = [2]\nsignal.step.amplitude = 2e4\n",
    );
    let said = check(&two);
    let coupling = &said.json["verdict"]["errors"]["coupling"];
    assert_eq!(coupling["direction"], "DOF 1", "{}", said.stderr);
    assert!(coupling["drift"].as_f64().unwrap() > 0.5, "{coupling}");
}

#[test]
fn free_vibration_has_known_errors() {
    let free = |specimen: &str, load: &str| {
        let text = oscillator(specimen, "", "simulated").without("excitation.ground_acceleration");
        check(&text.with(&format!(
            "[structure]\ninitial_displacement_m = [0.01]\n{load}"
        )))
    };
    let said = free(LAW, "");
    let errors = &said.json["verdict"]["errors"];
    for name in ["method", "coupling"] {
        let drift = errors[name]["drift"].as_f64();
        assert!(drift.is_some_and(|drift| drift < 1e-3), "{errors}");
        assert!(errors[name]["energy"].is_null(), "{errors}");
    }
    // With ζ_c = −ω τ/2, the largest drift after half of a cycle is exp(π ω τ/2) times as large.
    let late = format!("{LAW}transfer.delay_s = 0.004\n");
    let said = free(&late, "");
    let omega = (STIFFNESS / 1000.0).sqrt();
    let larger = libm::exp(std::f64::consts::PI * omega * 0.004 / 2.0) - 1.0;
    let coupling = &said.json["verdict"]["errors"]["coupling"];
    let drift = coupling["drift"].as_f64().unwrap();
    assert!((drift / larger - 1.0).abs() < 0.15, "{drift} {larger}");
    // Under a static load the drift counts from the position under it.
    let loaded = free(&late, "static_load_n = [1.6e4]\n");
    let coupling = &loaded.json["verdict"]["errors"]["coupling"];
    let of_loaded = coupling["drift"].as_f64().unwrap();
    assert!(
        (of_loaded / drift - 1.0).abs() < 0.02,
        "{of_loaded} {drift}"
    );
    assert_eq!(
        findings(&said, "error").len(),
        2,
        "{}",
        said.json["verdict"]
    );
}
