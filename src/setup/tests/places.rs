//! Motions and places of a test file, against the allowed commands and the capacity of the rig; and loads that move nothing.

use super::*;
use crate::build;

const RIG: &str = r#"
[time]
rate_hz = 100
duration_s = 1
clock = "simulated"
[structure.shear_building]
mass_kg = [1000]
stiffness_n_per_m = [1e6]
[excitation.ground_acceleration]
signal = { sine = { amplitude = 2.0, frequency_hz = 1.5 } }
[[specimen]]
name = "rig"
storey = 1
stiffness_n_per_m = 4e5
capacity = { velocity_m_per_s = 0.2, force_n = 20e3, stroke_m = 0.05 }
[specimen.link]
address = "127.0.0.1:42823"
[specimen.limits]
command_disp_m = { trip = [-0.04, 0.1] }
measured_force_n = { trip = [-10e3, 30e3] }
"#;
const ADAPTER: &str = "specimen.0.link.protocol=openfresco-adapter";
const SAFE: &str = "safety.on_trip=safe_displacement";
const SLOWLY: &str = "safety.exit_speed_m_per_s=0.01";

/// The result for the rig: the refusal, or all warnings.
fn said(sets: &[&str]) -> String {
    let built = read(RIG, sets).and_then(|loaded| build(&loaded));
    built.map_or_else(|error| error.to_string(), |made| made.warnings.to_string())
}

#[test]
fn impossible_return_move_is_refused() {
    let at = |speed: &str, choice: &str| {
        let speed = format!("safety.exit_speed_m_per_s={speed}");
        said(&[
            &speed,
            &format!("safety.on_trip={choice}"),
            "safety.at_end=freeze",
        ])
    };
    for choice in ["zero_displacement", "zero_force"] {
        let refused = at("0.21", choice);
        for words in [
            "would move to its end position at 0.21 m/s, but its rig reaches only 0.2 m/s",
            "capacity = { velocity_m_per_s = 0.2",
        ] {
            shows(&refused, words);
        }
        assert!(!at("0.2", choice).contains("error: "));
    }
    let places = ["specimen.0.safe_disp_m=[0.06]", SAFE, SLOWLY];
    shows(&said(&places), "axis 1");
    shows(&said(&places), "0.06 m");
    assert!(!said(&["specimen.0.safe_disp_m=[0.02]", SAFE, SLOWLY]).contains("error: "));
}

/// 4e5 N/m: −12 kN at −0.03 m, and 20 kN at 0.05 m.
#[test]
fn safe_place_beyond_bounds_is_reported() {
    let safe = |place: &str, more: &[&str]| {
        let place = format!("specimen.0.safe_disp_m=[{place}]");
        said(&[&[place.as_str(), SAFE, SLOWLY], more].concat())
    };
    let words = "initial stiffness";
    for (place, force, why) in [
        ("-0.03", "-12000.0 N", "this limit trips first"),
        ("-0.026", "-10400.0 N", "this limit trips first"),
    ] {
        let told = safe(place, &[]);
        for part in [words, force, why] {
            shows(&told, part);
        }
    }
    for place in ["-0.024", "0.049"] {
        let told = safe(place, &[]);
        assert!(!told.contains(words), "{told}");
    }
    let stiffer = "specimen.0.stiffness_n_per_m=5e5";
    let told = safe("0.045", &[stiffer]);
    for part in ["22500.0 N", "the rig cannot apply this force"] {
        shows(&told, part);
    }
    // d = (−0.03 − 0.001)/−2 = 0.0155 m, which are 6200 N at the structure and −3100 N at the axis.
    let gear =
        "specimen.0.axis=[{scale=2,sign=-1,offset_m=0.001,unit_disp=\"mm\",unit_force=\"kN\"}]";
    let narrow = "specimen.0.limits.measured_force_n.trip=[-3e3,3e3]";
    shows(&safe("-0.03", &[gear, narrow]), "-3100.0 N");
    // No specimen moves there, or its deformation there is not known.
    let relative = "specimen.0.axis=[{zero_disp=\"relative\"}]";
    assert!(!safe("-0.03", &[relative]).contains(words));
    assert!(!said(&["specimen.0.safe_disp_m=[-0.03]", SLOWLY]).contains(words));
}

#[test]
fn position_and_check_beyond_bounds_fail() {
    let stands = |place: &str, more: &[&str]| {
        let place = format!("specimen.0.link.stands_at_m=[{place}]");
        said(&[&[ADAPTER, place.as_str()], more].concat())
    };
    let refused = stands("1.0", &[]);
    for words in [
        "axis 1 begins at 1 m, which is outside the allowed commands",
        "command_disp_m = { trip = [-0.04, 0.1] }",
    ] {
        shows(&refused, words);
    }
    assert_eq!(errors(&refused), 1, "{refused}");
    shows(&stands("0.06", &[]), "cannot reach");
    assert!(!stands("0.03", &[]).contains("error: "));
    let probe = |metres: &str| format!("specimen.0.link.probe_m={metres}");
    let no_room = "which its limits do not allow";
    for (place, metres, sign, fits) in [
        ("0.03", "0.015", "1", true),
        ("0.03", "0.025", "1", false),
        ("0.03", "0.025", "-1", true),
        ("-0.03", "0.015", "-1", false),
    ] {
        let sign = format!("specimen.0.axis=[{{sign={sign}}}]");
        let told = stands(place, &[&probe(metres), &sign]);
        assert_eq!(told.contains(no_room), !fits, "{told}");
    }
    // Wherever it is.
    shows(&said(&[&probe("0.11")]), no_room);
    assert!(!said(&[&probe("0.09")]).contains(no_room));
}

#[test]
fn levels_of_axis_and_specimen_must_agree() {
    let all = "specimen.0.limits.command_step_m={warn=0.001,trip=0.002}";
    for (own, refused) in [
        ("{warn=0.0015}", false),
        ("{trip=0.0015}", false),
        ("{warn=0.002}", true),
        ("{trip=0.001}", true),
        ("{warn=0.003,trip=0.004}", false),
    ] {
        let axis = format!("specimen.0.axis=[{{limits={{command_step_m={own}}}}}]");
        let told = said(&[all, &axis]);
        let words = "trip level";
        assert_eq!(told.contains(words), refused, "{own}: {told}");
        assert_eq!(errors(&told), usize::from(refused), "{own}: {told}");
    }
}

#[test]
fn zero_excitation_is_reported() {
    let nothing = "moves nothing";
    assert!(!said(&[]).contains(nothing));
    let ground = "excitation.ground_acceleration";
    let zeros = "zero from the start to the end";
    let factors = "all its factors are zero";
    for (set, why) in [
        (format!("{ground}.signal.sine.amplitude=0"), zeros),
        (format!("{ground}.influence=[0]"), factors),
        (format!("{ground}.processing.scale_factor=0"), zeros),
    ] {
        let told = said(&[&set]);
        shows(&told, &format!("`{ground}` {nothing}"));
        shows(&told, why);
    }
    let force = |pattern: &str, amplitude: &str| {
        let signal = format!("signal={{sine={{amplitude={amplitude},frequency_hz=1}}}}");
        said(&[&format!(
            "excitation.nodal_force=[{{pattern=[{pattern}],{signal}}}]"
        )])
    };
    assert!(!force("1", "1").contains(nothing));
    shows(&force("0", "1"), factors);
    shows(&force("1", "0"), zeros);
    let base =
        "excitation={base_displacement={signal={sine={amplitude=0,frequency_hz=1}}}}".to_owned();
    shows(
        &said(&[&base]),
        &format!("`excitation.base_displacement` {nothing}"),
    );
}
