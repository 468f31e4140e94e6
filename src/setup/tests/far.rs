//! Implausible numbers: a compensator that leads away from the target, an estimate of another unit, a structure of nothing.

use super::*;
use crate::build;

const TEST: &str = r#"
[time]
rate_hz = 100
duration_s = 1
[structure.shear_building]
mass_kg = [1000]
stiffness_n_per_m = [0]
[excitation.ground_acceleration]
signal = { sine = { amplitude = 2.0, frequency_hz = 1.5 } }
[[specimen]]
name = "rig"
storey = 1
law = { linear = { stiffness_n_per_m = 1e5 } }
"#;

const LINK: &str = r#"[specimen]
limits = { command_disp_m = { trip = [-0.1, 0.1] }, measured_force_n = { trip = [-1e4, 1e4] } }
link = { address = "127.0.0.1:4823" }
"#;

/// Result of the build of the test with one key more: warnings, or the refusal.
fn said(set: &str) -> Result<String, String> {
    match build(&accepted(TEST, &[set])) {
        Ok(test) => Ok(test.warnings.render(false)),
        Err(ConfigError::Invalid(refused)) => Err(refused.render(false)),
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn distant_compensator_start_is_reported() {
    for (compensation, gain) in [
        ("amb={start=[0.001,0,0,0]}", "0.001"),
        ("ats={order=1,start=[4.0,0.02]}", "4"),
        ("ats={delay_s=0.01,gain=1000}", "0.001"),
        ("model_inverse={coefficients=[3.0,0.1]}", "3"),
    ] {
        let said = said(&format!("specimen.0.compensation={{{compensation}}}")).unwrap();
        shows(&said, "constant target");
        shows(&said, &format!(" {gain} mm"));
    }
    for compensation in ["amb={start=[0,0,0,0]}", "ats={order=1,start=[0.0,0.02]}"] {
        let refused = said(&format!("specimen.0.compensation={{{compensation}}}")).unwrap_err();
        shows(&refused, "greater than");
        shows(&refused, "start");
    }
    for compensation in [
        "amb={}",
        "ats={delay_s=0.01,gain=0.9}",
        "recursive_fir={delay_s=0.01}",
    ] {
        let said = said(&format!("specimen.0.compensation={{{compensation}}}")).unwrap();
        assert!(!said.contains("constant target"), "{said}");
    }
}

#[test]
fn estimate_far_from_the_law_is_reported() {
    for (given, ratio) in [("1e8", "1000 times"), ("5e3", "0.05 times")] {
        let said = said(&format!("specimen.0.stiffness_n_per_m={given}")).unwrap();
        shows(&said, "stiffness estimate");
        shows(&said, ratio);
    }
    let said = said("specimen.0.stiffness_n_per_m=3e5").unwrap();
    assert!(!said.contains("stiffness estimate"), "{said}");
}

#[test]
fn structure_without_floors_is_refused() {
    let empty = TEST.with("structure.shear_building = { mass_kg = [], stiffness_n_per_m = [] }");
    let Err(ConfigError::Invalid(refused)) = build(&accepted(&empty, &[])) else {
        panic!("a structure of nothing");
    };
    let refused = refused.render(false);
    shows(&refused, "degree of");
    assert!(!refused.contains("storeys 1 to"), "{refused}");
}

#[test]
fn estimate_far_from_stand_in_is_reported() {
    let linked = TEST.with(LINK);
    for (given, told) in [("1e8", true), ("1.2e5", false)] {
        let set = format!("specimen.0.stiffness_n_per_m={given}");
        let test = build(&accepted(&linked, &[&set])).unwrap();
        let said = test.warnings.render(false);
        assert_eq!(said.contains(" 1000 times"), told, "{said}");
    }
}

#[test]
fn identified_stiffness_above_proof_warns() {
    let linked = TEST
        .without("specimen.0.law")
        .with(LINK)
        .with("specimen = { stiffness_n_per_m = 1e5, identified.stiffness_n_per_m = 1.3e5 }");
    for (set, is_warned) in [
        (None, true),
        (
            Some("specimen.0.identified.stiffness_std_n_per_m=2e4"),
            true,
        ),
        (
            Some("specimen.0.identified.stiffness_std_n_per_m=4e4"),
            false,
        ),
        (Some("specimen.0.hardening_bound=1.3"), false),
        (Some("specimen.0.stiffness_n_per_m=1.4e5"), false),
        (Some("specimen.0.identified.stiffness_n_per_m=9e4"), false),
    ] {
        let test = build(&accepted(&linked, set.as_slice())).unwrap();
        let said = test.warnings.render(false);
        let key = "`identified.stiffness_n_per_m`";
        assert_eq!(said.contains(key), is_warned, "{set:?}: {said}");
        if is_warned {
            for part in ["130 kN/m", "100 kN/m", "`hardening_bound`"] {
                shows(&said, part);
            }
        }
    }
}
