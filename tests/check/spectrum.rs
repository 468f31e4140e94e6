//! `gusset check` predicts the effect of a test's modes and delays, against closed forms.

use std::f64::consts::TAU;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::test_file::TestFile;

/// One degree of freedom, ω = 2π, ξ = 2 %, half of its stiffness in the specimen, λ = 4.
const TEST: &str = r#"
[time]
rate_hz = 256
duration_s = 1

[structure.shear_building]
mass_kg = [1000]
stiffness_n_per_m = [19739.208802178716]
damping_n_s_per_m = [251.32741228718345]

[structure]
initial_displacement_m = [0.01]

[integrator]
lambda = 4

[[specimen]]
name = "spring"
storey = 1
law = { linear = { stiffness_n_per_m = 19739.208802178716 } }
"#;

fn check(text: &str, more: &[&str]) -> (i32, String, String) {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("test.toml");
    std::fs::write(&file, text).unwrap();
    let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    process.arg("check").arg(&file).args(more).arg("--verbose");
    let output = process.output().unwrap();
    (
        output.status.code().unwrap(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn stiff_part_reports_its_lost_digits() {
    let building = |stiffness: &str| {
        TEST.with(&format!(
            "structure.initial_displacement_m = [0.01, 0.01]\n[structure.shear_building]\nmass_kg = [1000, 1000]\n\
             stiffness_n_per_m = {stiffness}\ndamping_n_s_per_m = [0, 0]\n"
        ))
    };
    let reciprocal = |text: &str| {
        let (code, text, complaint) = check(text, &["--json", "--no-rehearsal"]);
        assert_eq!(code, 0, "{complaint}");
        let facts: Value = serde_json::from_str(&text).unwrap();
        let found = facts["structure"]["reciprocal_condition"].as_f64().unwrap();
        let warnings = facts["warnings"].as_array().unwrap().clone();
        let told = warnings
            .iter()
            .any(|text| text.as_str().unwrap().contains("of 16 digits"));
        (found, told)
    };
    // M_eff = M + Δt²/4 K0 with the specimen's spring: [[m + s + a + b, −b], [−b, m + b]], rows scaled to a diagonal of one.
    let closed = |k: [f64; 2]| {
        let part = |k: f64| k / (4.0 * 256.0 * 256.0);
        let (a, b) = (part(k[0] + 19739.208802178716), part(k[1]));
        let c = b / ((1000.0 + a + b) * (1000.0 + b)).sqrt();
        (1.0 - c) / (1.0 + c)
    };
    let (alone, told) = reciprocal(TEST);
    // The square of a root.
    assert!((alone - 1.0).abs() < 4.0 * f64::EPSILON && !told, "{alone}");
    for (text, k, warned) in [
        ("[2e4, 2e4]", [2e4, 2e4], false),
        ("[1e3, 1e10]", [1e3, 1e10], false),
        // Two masses on one another: the digits of their common motion are lost.
        ("[1e3, 1e17]", [1e3, 1e17], true),
        // A part that is fixed to rock costs none.
        ("[1e17, 1e3]", [1e17, 1e3], false),
    ] {
        let (found, told) = reciprocal(&building(text));
        let exact = closed(k);
        // 1 − c is a difference of sums of the size of κ⁻¹ to roundoff.
        let roundoff = 1e-12 + 20.0 * f64::EPSILON / exact;
        assert!(
            (found / exact - 1.0).abs() < roundoff,
            "{text}: {found:e} {exact:e}"
        );
        assert_eq!(told, warned, "{text}");
    }
    let (_, text, complaint) = check(&building("[1e3, 1e17]"), &[]);
    assert!(complaint.contains("7 of 16"), "{complaint}");
    assert!(text.contains("factored for"), "{text}");
}

#[test]
fn modes_match_the_closed_form() {
    let (code, text, complaint) = check(TEST, &["--json"]);
    assert_eq!(code, 0, "{complaint}");
    let facts: Value = serde_json::from_str(&text).unwrap();
    let mode = &facts["structure"]["modes"][0];
    let number = |key: &str| mode[key].as_f64().unwrap();
    let omega = TAU / 256.0;
    assert!((number("omega") / omega - 1.0).abs() < 1e-12);
    assert!((number("damping_ratio") / 0.02 - 1.0).abs() < 1e-12);
    // PE ≈ Ω² (1/(2λ) − 1/24) = Ω²/12 for small Ω and damping.
    assert!((number("period_error") / (omega * omega / 12.0) - 1.0).abs() < 0.02);
    assert!(number("damping_error").abs() < 0.02 * omega);
}

#[test]
fn critical_delay_matches_the_closed_form() {
    // ω = 2π, ξ = 0.02, half of the stiffness in the specimen.
    let closed = 0.012745994077000876;
    let (_, text, _) = check(TEST, &["--json"]);
    let facts: Value = serde_json::from_str(&text).unwrap();
    let delay = &facts["structure"]["critical_delays"][0];
    assert_eq!(delay["specimen"], "spring");
    let of = |way: &str| delay[way]["delay_s"].as_f64().unwrap();
    assert!((of("continuous") / closed - 1.0).abs() < 1e-9);
    // Δt is 0.4 % of the period.
    assert!(
        (of("discrete") / closed - 1.0).abs() < 5e-3,
        "{closed} {delay}"
    );
    let (_, table, _) = check(TEST, &[]);
    assert!(table.contains("critical delay"), "{table}");
    // Ω = 2π/256; period error Ω²/12.
    for words in ["1.0000 Hz", "0.024544", "+0.0050 %", "2.0000 %"] {
        assert!(table.contains(words), "no {words:?} in {table}");
    }
}

#[test]
fn curves_are_written_to_the_given_path() {
    let folder = TempDir::new().unwrap();
    let plots = folder.path().join("curves");
    let (code, _, _) = check(TEST, &["--plot", plots.to_str().unwrap()]);
    assert_eq!(code, 0);
    for name in ["period-error", "damping-error", "delay-1"] {
        let svg = std::fs::read_to_string(plots.join(format!("{name}.svg"))).unwrap();
        assert!(
            svg.matches("<path").count() > 1 && svg.contains("h0"),
            "{name}"
        );
        assert!(plots.join(format!("{name}.csv")).exists());
    }
    let (code, _, complaint) = check(TEST, &["--plot", plots.to_str().unwrap()]);
    assert_eq!(code, 2);
    assert!(complaint.contains("not empty"), "{complaint}");
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let (code, _, _) = check(TEST, &["--plot", empty.to_str().unwrap()]);
    assert_eq!(code, 0);
    assert!(empty.join("period-error.svg").exists());
}

/// One degree of freedom without damping: any delay is a negative dashpot.
#[test]
fn undamped_system_tolerates_no_delay() {
    let text = TEST.without("structure.shear_building.damping_n_s_per_m");
    let (code, table, _) = check(&text, &[]);
    assert_eq!(code, 0);
    assert!(table.contains("without damping"), "{table}");
    assert!(!table.contains("-0.0000"), "{table}");
}

/// No number of a text is NaN or an infinity. The note on a specimen without limits names both.
fn numbers_are_finite(text: &str) {
    let text = text.replace("only NaN or infinity trips", "");
    let words = text.split(|c: char| !c.is_alphanumeric() && c != '.');
    let bad = |word: &&str| ["NaN", "nan", "inf", "Infinity"].contains(word);
    let bad: Vec<&str> = words.filter(bad).collect();
    assert!(bad.is_empty(), "{bad:?} in {text}");
}

/// Ω = π at λ = 8 is beyond √(4λ/(λ − 4)) = 2.83: the recursion grows without any delay. This is a separate finding, and no
/// critical delay is shown.
#[test]
fn unstable_without_delay_is_a_finding() {
    let actuator = "[specimen.transfer]\nactuator = { first_order = { time_constant_s = 0.05 } }\n";
    let coarse = "time.rate_hz = 2\nintegrator.lambda = 8\n";
    let text = TEST.with(&format!("{coarse}{actuator}"));
    let (_, table, complaint) = check(&text, &["--no-rehearsal"]);
    for words in ["without delay", "UNSTABLE", "recursion"] {
        assert!(table.contains(words), "no {words:?} in {table}{complaint}");
    }
    numbers_are_finite(&table);
    let (_, found, _) = check(&text, &["--no-rehearsal", "--json"]);
    let facts: Value = serde_json::from_str(&found).unwrap();
    let delay = &facts["structure"]["critical_delays"][0];
    // One degree of freedom: z² + (α Ω² + …) at the root beyond −1.
    assert!(
        delay["discrete"]["spectral_radius"].as_f64().unwrap() > 1.0,
        "{delay}"
    );
    for place in [delay, &facts["following"][0]] {
        let why = place["unstable_without_delay"].as_str();
        assert!(why.is_some_and(|why| why.contains("it grows")), "{place}");
    }
    let (_, table, _) = check(&text, &["--rehearse", "--trials", "1"]);
    assert!(table.contains("NO-GO"), "{table}");
    // A stable one has no such line.
    let (_, table, _) = check(&format!("{TEST}{actuator}"), &["--no-rehearsal"]);
    assert!(!table.contains("without delay"), "{table}");
    let (_, found, _) = check(&format!("{TEST}{actuator}"), &["--no-rehearsal", "--json"]);
    let facts: Value = serde_json::from_str(&found).unwrap();
    assert!(facts["following"][0]["unstable_without_delay"].is_null());
    assert!(facts["following"][0]["lag_s"].as_f64().unwrap() > 0.0);
}

/// Two equal masses, 100 N s/m each, and an estimate of damping that couples them with `coupling`: beyond 100 it grows.
fn coupled(coupling: f64) -> String {
    format!(
        "[time]\nstep_s = 0.01\nduration_s = 0.5\nclock = \"simulated\"\n[structure.matrices]\n\
         mass = [[1000, 0], [0, 1000]]\nstiffness = [[2e5, -1e5], [-1e5, 2e5]]\ndamping = [[100, 0], [0, 100]]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 0.1\nfrequency_hz = 1\n[[specimen]]\nname = \"s\"\n\
         rows = [[1, 0], [0, 1]]\nstiffness_n_per_m = [[1e4, 0], [0, 1e4]]\n\
         damping_n_s_per_m = [[0, {coupling}], [{coupling}, 0]]\n\
         laws = [{{ linear.stiffness_n_per_m = 1e4 }}, {{ linear.stiffness_n_per_m = 1e4 }}]\n"
    )
}

/// The rehearsal, whose law has no such damping, completes: the proof forbids the test.
#[test]
fn proven_growth_is_refused() {
    for (coupling, possible) in [(500.0, false), (50.0, true)] {
        let text = coupled(coupling);
        let (code, table, said) = check(&text, &[]);
        assert_eq!(code, i32::from(!possible), "{table}{said}");
        assert_eq!(table.contains("NOT POSSIBLE"), !possible, "{table}");
        assert_eq!(said.contains("[structure.matrices]"), !possible, "{said}");
        assert_eq!(table.contains("UNSTABLE"), !possible, "{table}");
        let (code, found, _) = check(&text, &["--json"]);
        assert_eq!(code, i32::from(!possible));
        let facts: Value = serde_json::from_str(&found).unwrap();
        assert_eq!(facts["valid"], possible, "{facts:#}");
        assert_eq!(facts["structure"]["stable"], possible);
        let (code, found, _) = check(&text, &["--rehearse", "--trials", "1", "--json"]);
        let facts: Value = serde_json::from_str(&found).unwrap();
        let integration = &facts["certificate"]["lines"][0];
        assert_eq!(integration["about"], "integration");
        let verdict = if possible { "go" } else { "no-go" };
        assert_eq!(integration["verdict"], verdict, "{integration}");
        if !possible {
            assert_eq!(
                (code, &facts["certificate"]["go"]),
                (1, &Value::Bool(false))
            );
        }
    }
}

/// There is no proof for several axes, but they are checked: the critical delay of the table is known.
#[test]
fn axes_later_than_allowed_give_a_warning() {
    for (delay, late) in [(0.1, true), (1e-4, false)] {
        let text = format!("{}[specimen.transfer]\ndelay_s = {delay}\n", coupled(50.0));
        let (code, table, said) = check(&text, &["--no-rehearsal"]);
        // The proof of all axes together and the critical delay of the recursion agree.
        assert_eq!(code, i32::from(late), "{said}");
        assert_eq!(said.contains("is unstable"), late, "{said}");
        assert!(table.contains("critical delay"), "{table}");
        assert_eq!(said.contains("together"), late, "{said}");
    }
}

/// An actuator with more delay than the loop tolerates: the exit code and the JSON agree.
#[test]
fn refused_actuator_loop_is_not_valid_json() {
    let with = |delay: f64| format!("{TEST}[specimen.transfer]\ndelay_s = {delay}\n");
    for (delay, possible) in [(0.1, false), (1e-3, true)] {
        let (code, found, said) = check(&with(delay), &["--json", "--no-rehearsal"]);
        let facts: Value = serde_json::from_str(&found).unwrap();
        assert_eq!(code, i32::from(!possible), "{said}");
        assert_eq!(said.contains("[specimen.transfer]"), !possible, "{said}");
        assert_eq!(facts["following"][0]["possible"], possible, "{facts:#}");
        assert_eq!(facts["valid"], possible);
    }
}

/// With more mass in the specimen's force than beside it the loop gain stays above one at every frequency. No delay is short
/// enough, and the actuator's lag at an infinite frequency does not exist.
#[test]
fn no_lag_is_shown_without_a_stable_delay() {
    let text = "[time]\nstep_s = 0.01\nduration_s = 0.1\n[structure.matrices]\nmass = [[20]]\nstiffness = [[0]]\n\
                [excitation.ground_acceleration.signal.sine]\namplitude = 1\nfrequency_hz = 1\n[[specimen]]\nname = \"it\"\n\
                rows = [[1]]\nmass_in_force_kg = 21\nlaw.linear = { stiffness_n_per_m = 2e5 }\n[specimen.transfer]\n\
                actuator = { first_order = { time_constant_s = 0.001 } }\n";
    let (_, table, complaint) = check(text, &["--no-rehearsal"]);
    let words = "the inertia inside";
    assert!(table.contains(words), "{table}{complaint}");
    numbers_are_finite(&table);
    let (_, found, _) = check(text, &["--no-rehearsal", "--json"]);
    numbers_are_finite(&found);
    let facts: Value = serde_json::from_str(&found).unwrap();
    let followed = &facts["following"][0];
    assert_eq!(followed["critical_delay_s"], 0.0, "{followed}");
    assert!(followed["lag_s"].is_null() && followed["at_rad_per_s"].is_null());
}

/// 5000 masses: the lowest and the highest frequency are those of the closed form 2 √(k/m) sin((2j − 1) π/(2 (2n + 1))).
#[test]
fn large_structure_shows_its_lowest_modes() {
    let text = "[time]\nrate_hz = 100\nduration_s = 1\n[structure.chain]\ndofs = 5000\nmass_kg = 150\n\
                stiffness_n_per_m = 2.5e5\n[excitation.base_displacement]\nsignal.sine = { amplitude = 0.1, frequency_hz = 1 }\n";
    let (code, found, complaint) = check(text, &["--json"]);
    assert_eq!(code, 0, "{complaint}");
    let facts: Value = serde_json::from_str(&found).unwrap();
    let structure = &facts["structure"];
    let exact =
        |j: f64| 2.0 * (2.5e5f64 / 150.0).sqrt() * libm::sin((2.0 * j - 1.0) * TAU / 4.0 / 10001.0);
    let modes = structure["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 6);
    for (j, mode) in modes.iter().enumerate() {
        let frequency = mode["frequency_rad_per_s"].as_f64().unwrap();
        assert!(
            (frequency / exact(j as f64 + 1.0) - 1.0).abs() < 1e-6,
            "{mode}"
        );
    }
    let highest = structure["highest_frequency_rad_per_s"].as_f64().unwrap();
    assert!((highest / exact(5000.0) - 1.0).abs() < 1e-9);
    let (_, table, _) = check(text, &[]);
    assert!(table.contains("  highest "), "{table}");
}

/// Two storeys; a stop between the floors, far from closing, makes the first storey the only one that moves once it closes.
fn with_a_stop(more: &str) -> String {
    format!(
        "[time]\nrate_hz = 1000\nduration_s = 0.5\nclock = \"simulated\"\n[integrator]\nlambda = 4\n\
         [structure.shear_building]\nmass_kg = [1000, 1000]\nstiffness_n_per_m = [71e3, 326e3]\n\
         damping_n_s_per_m = [400, 1400]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 0.1\nfrequency_hz = 1\n{more}\
         [[specimen]]\nname = \"it\"\nstorey = 1\nlaw.linear = {{ stiffness_n_per_m = 129e3 }}\n"
    )
}

const STOP: &str = "[[structure.element]]\nname = \"stop\"\nfrom = 1\nto = 2\n\
                    law.gap = { stiffness_n_per_m = 2e6, gap_m = 0.5, side = \"both\" }\n";

/// The row of the short page of `check` that begins with `name`, in one line.
fn short_row(text: &str, name: &str) -> String {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("test.toml");
    std::fs::write(&file, text).unwrap();
    let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    let output = process
        .arg("check")
        .arg(&file)
        .arg("--no-rehearsal")
        .output();
    let page = String::from_utf8(output.unwrap().stdout).unwrap();
    let mut lines = page.lines().skip_while(|line| !line.starts_with(name));
    let first = lines
        .next()
        .unwrap_or_else(|| panic!("no {name:?} in {page}"));
    let rest = lines.take_while(|line| line.starts_with(' '));
    let words = std::iter::once(first)
        .chain(rest)
        .flat_map(str::split_whitespace);
    words.collect::<Vec<_>>().join(" ")
}

#[test]
fn short_page_shows_smallest_critical_delay() {
    // 4.448 ms at rest, 3.122 ms with the stop closed.
    let actuator = "[specimen.transfer]\ndelay_s = 0.001\n";
    for (stop, shown, condition) in [
        ("", "4.448 ms", "recursion"),
        (STOP, "3.122 ms", "gaps closed"),
    ] {
        let row = short_row(&with_a_stop(stop), "critical delay");
        assert!(row.contains(shown) && row.contains(condition), "{row}");
        let row = short_row(&format!("{}{actuator}", with_a_stop(stop)), "actuator");
        let delay = format!("critical delay {shown}");
        assert!(row.contains(&delay) && row.contains(condition), "{row}");
    }
}

#[test]
fn short_page_claims_only_examined_range() {
    // Critical damping and a soft specimen: the loop gain is below one at every frequency. The recursion is examined up to
    // 96 steps of 1/256 s.
    let text = TEST.with(
        "structure.shear_building.damping_n_s_per_m = [12566.370614359172]\nspecimen.law.linear.stiffness_n_per_m = 1e4",
    );
    let row = short_row(&text, "critical delay");
    assert!(row.contains("every delay"), "{row}");
    assert!(row.contains("375 ms"), "{row}");
}
