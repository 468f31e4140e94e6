//! How the proof of stability and the modes treat specimens: damping between the steps, inertia a step late, negative
//! stiffness.

use super::*;
use crate::{Facts, build};
use gusset_proof::Kind;

/// One mass in m, all of whose stiffness and damping are those of a specimen.
fn one(time: &str, mass: f64, rest: &str) -> String {
    format!(
        "[time]\nstep_s = 0.01\nduration_s = 1\n{time}\n[structure.matrices]\nmass = [[{mass}]]\nstiffness = [[0]]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 1\nfrequency_hz = 1\n[[specimen]]\nname = \"it\"\n\
         rows = [[1]]\n{rest}\n"
    )
}

fn facts(text: &str) -> Facts {
    build(&accepted(text, &[]))
        .unwrap_or_else(|error| panic!("{error}"))
        .facts
}

fn limit(text: &str) -> Option<f64> {
    let structure = facts(text).structure.unwrap();
    structure.choice().unwrap().limit
}

fn refusal(text: &str) -> String {
    build(&accepted(text, &[])).unwrap_err().to_string()
}

/// λ (Δt² k − 4 m + 4 m_e + 2 Δt (r − 1) c) ≤ 4 Δt² k, if all of k and c are those of the specimen.
#[test]
fn specimen_damping_counts_more_in_sawtooth() {
    let (mass, k, c, dt) = (200.0, 2e6, 4e4, 0.01);
    let law = format!("law.linear = {{ stiffness_n_per_m = {k}, damping_n_s_per_m = {c} }}");
    for (order, counts) in [(1, 1.0), (2, 2.0), (3, 10.0 / 3.0)] {
        let time = format!("ticks_per_step = 10\nprediction_order = {order}");
        let pull = dt * dt * k - 4.0 * mass + 2.0 * dt * (counts - 1.0) * c;
        let expected = (pull > 0.0).then(|| 4.0 * dt * dt * k / pull);
        let found = limit(&one(&time, mass, &law));
        match (found, expected) {
            (None, None) => assert_eq!(order, 1),
            // The bisection stops at a relative 1e-11.
            (Some(found), Some(expected)) => {
                assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
            }
            _ => panic!("{order}: {found:?}, not {expected:?}"),
        }
    }
    // In whole steps it is the integrator's own velocity that is commanded.
    assert_eq!(limit(&one("prediction_order = 3", mass, &law)), None);
    let asked = format!(
        "{}[integrator]\nlambda = 8\n",
        one("ticks_per_step = 2", mass, &law)
    );
    let doubts = build(&accepted(&asked, &[])).unwrap().doubts;
    let [(Kind::Unstable, finding)] = &doubts[..] else {
        panic!("{doubts:?}");
    };
    assert_eq!(finding.numbers[0], ("lambda", 8.0));
    assert!((finding.numbers[1].1 - 4.0).abs() < 1e-9, "{finding:?}");
    assert!(
        finding
            .help
            .iter()
            .any(|line| line.contains("`prediction_order = 1`"))
    );
}

#[test]
fn inertia_in_a_force_lowers_frequency() {
    let (mass, late, k, dt): (f64, f64, f64, f64) = (20.0, 19.0, 2e5, 0.01);
    let rest = format!("mass_in_force_kg = {late}\nlaw.linear = {{ stiffness_n_per_m = {k} }}");
    let text = one("", mass, &rest);
    let expected = 4.0 * dt * dt * k / (dt * dt * k - 4.0 * (mass - late));
    let found = limit(&text).unwrap();
    assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
    let structure = facts(&text).structure.unwrap();
    let omega = (k / (mass + late)).sqrt();
    let analysis = structure.analysis.unwrap();
    let modes = analysis.modes(dt, structure.lambda.unwrap());
    for found in [
        structure.frequencies[0],
        modes[0].frequency,
        analysis.highest().unwrap(),
    ] {
        assert!((found / omega - 1.0).abs() < 1e-9, "{found} {omega}");
    }
    // More of it than the structure and its stiffness make up for: no member of the family is stable.
    let soft = "specimen = { mass_in_force_kg = 21, law.linear.stiffness_n_per_m = 0 }";
    let refusal = refusal(&text.with(soft));
    assert!(refusal.contains("`mass_in_force_kg`"), "{refusal}");
}

#[test]
fn falling_stiffness_is_refused() {
    let text = |last: &str, more: &str| {
        format!(
            "[time]\nstep_s = 0.01\nduration_s = 1\n[structure.matrices]\nmass = [[1000, 0], [0, 1000]]\n\
             stiffness = [[1e5, -1e5], [-1e5, {last}]]\n[excitation.ground_acceleration.signal.sine]\namplitude = 1\n\
             frequency_hz = 1\n{more}"
        )
    };
    let refused = refusal(&text("0.9e5", ""));
    assert!(refused.contains("negative eigenvalue"), "{refused}");
    assert!(refused.contains("stiffness = [[1e5, -1e5]"), "{refused}");
    facts(&text("1e5", ""));
    // A spring beside it holds it; a law that begins with a falling branch is warned of.
    let element = |stiffness: &str| {
        format!(
            "[[structure.element]]\nfrom = \"ground\"\nto = 2\nlaw.linear = {{ stiffness_n_per_m = {stiffness} }}\n"
        )
    };
    let held = facts(&text("0.9e5", &element("3e4")));
    assert!(
        held.warnings
            .iter()
            .all(|text| !text.contains("eigenvalue")),
        "{:?}",
        held.warnings
    );
}

/// Two masses on two springs and two dashpots of this sign, without a specimen or with these keys more.
fn dashpots(sign: f64, more: &str) -> String {
    format!(
        "[time]\nstep_s = 0.01\nduration_s = 1\n[structure.matrices]\nmass = [[1000, 0], [0, 1000]]\n\
         stiffness = [[2e5, -1e5], [-1e5, 1e5]]\ndamping = [[{}, {}], [{}, {}]]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 1\nfrequency_hz = 1\n{more}",
        2.0 * sign,
        -sign,
        -sign,
        sign
    )
}

const NEGATIVE_DAMPING: &str = "the damping has a negative eigenvalue";

#[test]
fn negative_damping_is_refused() {
    let refused = refusal(&dashpots(-100.0, ""));
    for words in [NEGATIVE_DAMPING, "damping = [[-200, 100], [100, -100]]"] {
        assert!(refused.contains(words), "{refused}");
    }
    let remote = "[[specimen]]\nname = \"s\"\nrows = [[1, 0]]\nstiffness_n_per_m = 1e4\n[specimen.limits]\n\
                  command_disp_m = { trip = [-0.5, 0.5] }\nmeasured_force_n = { trip = [-20e3, 20e3] }\n\
                  [specimen.link]\naddress = \"127.0.0.1:42801\"\n";
    assert!(refusal(&dashpots(-100.0, remote)).contains(NEGATIVE_DAMPING));
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("c.csv"), "-200,100\n100,-100\n").unwrap();
    let filed = dashpots(100.0, "")
        .without("structure.matrices.damping")
        .with("structure.matrices.damping_file = 'c.csv'");
    let loaded = parse(&folder.path().join("test.toml"), filed, &[]).unwrap();
    let refused = build(&loaded).unwrap_err().to_string();
    assert!(
        refused.contains(NEGATIVE_DAMPING) && refused.contains("damping_file = "),
        "{refused}"
    );
    // No damping, a singular one, and one with rounded digits are not negative; dashpots beside a negative one compensate it.
    let singular = dashpots(100.0, "").replace("[[200,", "[[100,");
    let rounded = singular.replace("[[100, -100], [-100,", "[[100, -100.00001], [-100.00001,");
    let element = "[[structure.element]]\nfrom = \"ground\"\nto = 1\nlaw.linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 1e3 }\n\
                   [[structure.element]]\nfrom = 1\nto = 2\nlaw.linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 1e3 }\n";
    for text in [
        dashpots(0.0, ""),
        singular,
        rounded,
        dashpots(-100.0, element),
    ] {
        let found = facts(&text);
        let told = found
            .warnings
            .iter()
            .any(|text| text.contains("eigenvalue"));
        assert!(!told, "{:?} of {text}", found.warnings);
        assert_eq!(found.structure.unwrap().analysis.unwrap().growth(), None);
    }
}

/// ĉ = [[0, c], [c, 0]] has the eigenvalue −c, which no diagonal shows. Where both masses are alike they move against each other
/// with a damping of 100 − c: at c = 500 that grows at 400/(2 · 1000) = 0.2 1/s.
#[test]
fn estimates_that_add_energy_are_reported() {
    let specimen = |damping: &str| {
        let text = dashpots(100.0, "").with(
            "structure.matrices.stiffness = [[2e5, -1e5], [-1e5, 2e5]]\n\
             structure.matrices.damping = [[100, 0], [0, 100]]",
        );
        format!(
            "{text}[[specimen]]\nname = \"s\"\nrows = [[1, 0], [0, 1]]\nstiffness_n_per_m = [[1e4, 0], [0, 1e4]]\n\
             damping_n_s_per_m = {damping}\nlaws = [{{ linear.stiffness_n_per_m = 1e4 }}, \
             {{ linear.stiffness_n_per_m = 1e4 }}]\n"
        )
    };
    let found = facts(&specimen("[[0, 500], [500, 0]]"));
    let words = "damping at rest";
    assert!(
        found.warnings.iter().any(|text| text.contains(words)),
        "{:?}",
        found.warnings
    );
    let growth = found.structure.unwrap().analysis.unwrap().growth().unwrap();
    assert!((growth - 0.2).abs() < 1e-9, "{growth}");
    let found = facts(&specimen("[[0, 50], [50, 0]]"));
    assert!(
        found.warnings.iter().all(|text| !text.contains(words)),
        "{:?}",
        found.warnings
    );
    assert_eq!(found.structure.unwrap().analysis.unwrap().growth(), None);
}

/// A spring that falls at rest and stiffens with motion gives a warning, but no proof that the test grows.
#[test]
fn falling_branch_proves_no_growth() {
    let law = "[[structure.element]]\nfrom = \"ground\"\nto = 2\nreach_disp_m = 1\nlaw.cubic = { stiffness_n_per_m = -2e5, \
               cubic_n_per_m3 = 1e9, reference_stiffness_n_per_m = 1e5 }\n";
    let found = facts(&dashpots(100.0, law));
    let words = "stiffness at rest";
    assert!(
        found.warnings.iter().any(|text| text.contains(words)),
        "{:?}",
        found.warnings
    );
    assert_eq!(found.structure.unwrap().analysis.unwrap().growth(), None);
}

#[test]
fn inertial_frame_needs_absolute_coords() {
    let tied = GOOD.with(
        "[[structure.element]]\nfrom = \"fixed\"\nto = 3\nlaw.linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 1e3 }",
    );
    let said = read(&tied, &[]).unwrap_err().to_string();
    for words in [
        "from = \"fixed\"",
        "inertial frame",
        "relative coordinates",
        "`base_displacement`",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let chain = "[time]\nstep_s = 0.01\nduration_s = 1\n[structure.chain]\ndofs = 3\nmass_kg = 1\nstiffness_n_per_m = 1e3\n\
                 absolute_damper.linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 1 }\n[excitation.MOVED.signal.sine]\namplitude = 1\nfrequency_hz = 1\n";
    let said = read(&chain.replace("MOVED", "ground_acceleration"), &[])
        .unwrap_err()
        .to_string();
    assert!(said.contains("absolute dampers"), "{said}");
    accepted(&chain.replace("MOVED", "base_displacement"), &[]);
}

#[test]
fn inertia_in_a_force_needs_relative_coords() {
    let heavy = |motion: &str| {
        GOOD.replace("ground_acceleration", motion)
            .replace("storey = 1\n", "storey = 1\nmass_in_force_kg = 10\n")
    };
    let said = read(&heavy("base_displacement"), &[])
        .unwrap_err()
        .to_string();
    for words in [
        "mass_in_force_kg = 10",
        "acceleration",
        "absolute coordinates",
    ] {
        assert!(said.contains(words), "{said}");
    }
    accepted(&heavy("ground_acceleration"), &[]);
}

#[test]
fn lagging_actuator_knows_only_test_time() {
    let with = |time: &str, transfer: &str| {
        let more = format!("storey = 1\nsimilitude.time = {time}\ntransfer = {{ {transfer} }}\n");
        read(&GOOD.replace("storey = 1\n", &more), &[])
    };
    for lags in [
        "actuator.first_order.time_constant_s = 0.01",
        "rate_limit_m_per_s = 1",
    ] {
        let said = with("2", lags).unwrap_err().to_string();
        assert!(said.contains("`similitude.time` must be 1"), "{said}");
        with("1", lags).unwrap();
    }
    with("2", "delay_s = 0.01").unwrap();
}

#[test]
fn equal_noise_seeds_are_reported() {
    let noisy = |first: &str, second: &str| {
        let text = GOOD.with(&format!("specimen.transfer = {{ {first} }}"));
        let other =
            "[[specimen]]\nname = \"top\"\nstorey = 3\nlaw.linear.stiffness_n_per_m = 1e5\n";
        let loaded = accepted(&format!("{text}{other}transfer = {{ {second} }}\n"), &[]);
        Diagnostics(loaded.warnings.clone()).to_string()
    };
    let noise = "force_sensor.noise_rms_n = 2";
    let said = noisy(noise, noise);
    let words = "`bottom` and `top`";
    assert!(said.contains(words), "{said}");
    for other in ["delay_s = 0.01", "force_sensor.noise_rms_n = 2, seed = 1"] {
        let said = noisy(noise, other);
        assert!(!said.contains(words), "{said}");
    }
}

#[test]
fn diverging_structure_stops_the_test() {
    let bound = |text: &str, sets: &[&str]| {
        let prepared = build(&accepted(text, sets)).unwrap();
        prepared.experiment.limits.divergence
    };
    assert_eq!(bound(GOOD, &[]), 1e3);
    assert_eq!(bound(GOOD, &["safety.divergence_m=0.5"]), 0.5);
    assert_eq!(bound(PRESCRIBED, &[]), f64::MAX);
}

#[test]
fn wearing_law_names_its_missing_bound() {
    let worn = "law = { bouc_wen = { stiffness_n_per_m = 1e6, yield_force_n = 5e3, post_yield_ratio = 0.1, beta = 0.7, \
                gamma = 0.3, exponent = 2, degradation = { stiffness = 0.02, strength = 0.005 } } }\n";
    let (before, _) = GOOD.split_once("law = ").unwrap();
    let made = |text: &str| read(text, &[]).and_then(|loaded| crate::build(&loaded));
    let text = format!("{before}{worn}");
    let said = made(&text).unwrap_err().to_string();
    shows(&said, "`bouc_wen.hardening_ratio`");
    shows(&said, "no bound");
    // At the law, and not at the table that holds it.
    let column = worn.find("{ stiffness").unwrap() + 1;
    shows(&said, &format!(":{column}"));
    let given = text.replace("exponent = 2", "exponent = 2, hardening_ratio = 1.2");
    made(&given).unwrap();
}
