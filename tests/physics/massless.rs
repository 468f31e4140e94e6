//! Degrees of freedom without mass follow the others statically, and P-Δ lowers a storey.

use crate::common::engine::{Run, distance, prepare, run};
use crate::common::test_file::TestFile;
use gusset_control::engine::Ending;

/// A mass on a spring, on a joint without mass that a law holds, under a sine. The joint is DOF 2.
const SERIES: &str = r#"
[time]
rate_hz = 1024
duration_s = 6
[integrator]
lambda = 4
[structure.matrices]
mass = [[1000.0, 0], [0, 0]]
stiffness = [[1e6, -1e6], [-1e6, 1e6]]
influence = [1, 1]
[excitation.ground_acceleration]
signal.sine = { amplitude = 4.0, frequency_hz = 2.3 }
"#;

/// The structure without the joint, where both springs are linear: 1e6 and 1e7 N/m in series.
const CONDENSED: &str = "
[time]
rate_hz = 1024
duration_s = 6
[integrator]
lambda = 4
[structure.shear_building]
mass_kg = [1000.0]
stiffness_n_per_m = [909090.9090909091]
[excitation.ground_acceleration]
signal.sine = { amplitude = 4.0, frequency_hz = 2.3 }
";

fn held(law: &str) -> String {
    format!("{SERIES}[[structure.element]]\nfrom = \"ground\"\nto = 2\nlaw.{law}\n")
}

const ELASTIC: &str = "linear = { stiffness_n_per_m = 1e7 }";
const STEEL: &str =
    "bilinear = { stiffness_n_per_m = 1e7, yield_force_n = 5000.0, post_yield_ratio = 0.01 }";

fn peak(run: &Run, column: &str) -> f64 {
    let values = run.column(column);
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}

#[test]
fn linear_joint_takes_the_condensed_steps() {
    let rule = "structure.damping.rayleigh = { mass_coefficient_per_s = 0.3, stiffness_coefficient_s = 2e-3 }";
    for damping in ["", rule] {
        let with = |text: &str| match damping {
            "" => text.to_owned(),
            rule => text.with(rule),
        };
        let whole = run(&with(CONDENSED));
        let joint = run(&with(&held(ELASTIC)));
        for letter in ["x", "v", "a"] {
            let [found, expected] = [&joint, &whole].map(|run| run.column(&format!("{letter}1")));
            let off = distance(&found, &expected);
            assert!(off < 1e-9, "{damping} {letter}: {off:e}");
        }
        let share: Vec<f64> = whole.column("x1").iter().map(|x| x / 11.0).collect();
        assert!(distance(&joint.column("x2"), &share) < 1e-9);
    }
}

/// A base that moves, and a force on the joint itself, of which the mass feels what the springs hand on.
#[test]
fn base_and_loads_reach_a_joint() {
    let bare = |text: &str| text.without("excitation.ground_acceleration");
    let moved =
        "excitation.base_displacement.signal.sine = { amplitude = 0.01, frequency_hz = 2.3 }";
    let pushed = |dof: usize, newtons: f64| {
        format!(
            "[[excitation.nodal_force]]\ndofs = [{dof}]\nsignal.sine = {{ amplitude = {newtons}, frequency_hz = 2.3 }}\n"
        )
    };
    for (of_joint, of_one) in [
        (moved.to_owned(), moved.to_owned()),
        (pushed(2, 1.1e4), pushed(1, 1e3)),
    ] {
        let joint = run(&bare(&held(ELASTIC)).with(&of_joint));
        let whole = run(&bare(CONDENSED).with(&of_one));
        let off = distance(&joint.column("x1"), &whole.column("x1"));
        assert!(off < 1e-9, "{of_joint}: {off:e}");
        assert!(peak(&joint, "static_unbalance") < 1e-9);
    }
}

#[test]
fn yielding_joint_is_right_at_every_step() {
    let fine = run(&held(STEEL).with("time.rate_hz = 8192"));
    // Condensed by hand: 8.61 mm, half a unit of the last digit.
    assert!((peak(&fine, "x1") - 8.61e-3).abs() < 5e-6);
    for (rate, lambda) in [("256", "4"), ("512", "11"), ("1024", "2"), ("1024", "11.5")] {
        let keys = format!("time.rate_hz = {rate}\nintegrator.lambda = {lambda}");
        let coarse = run(&held(STEEL).with(&keys));
        let off = peak(&coarse, "x1") / peak(&fine, "x1") - 1.0;
        assert!(off.abs() < 2e-3, "{keys}: {off:e}");
        assert!(peak(&coarse, "static_unbalance") < 1e-9);
    }
}

fn refusal(text: String) -> String {
    let read = gusset_config::parse(std::path::Path::new("test.toml"), text, &[]).unwrap();
    gusset_setup::build(&read).unwrap_err().to_string()
}

#[test]
fn specimen_on_a_joint_is_refused() {
    let rows = format!("[[specimen]]\nname = \"joint\"\nrows = [[0, 1]]\nlaw.{ELASTIC}\n");
    let refused = refusal(format!("{SERIES}{rows}"));
    assert!(refused.contains("DOF 2"), "{refused}");
}

/// The forces of springs of K alone are the scale, wherever the structure stands.
#[test]
fn balance_is_judged_without_elements() {
    let building = "
        [time]
        rate_hz = 512
        duration_s = 4
        [structure.shear_building]
        mass_kg = [1000.0, 0.0, 1000.0, 0.0, 500.0]
        stiffness_n_per_m = [1e6, 2e6, 1e6, 3e6, 1e6]
        [structure.damping.rayleigh]
        mass_coefficient_per_s = 0.3
        stiffness_coefficient_s = 1e-3
        [excitation.base_displacement.signal.sine]
        amplitude = 0.02
        frequency_hz = 1.5";
    let run = run(building);
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert!(peak(&run, "static_unbalance") < 1e-9);
}

/// KR-α moves the joint by its own weights, with the forces of every element.
#[test]
fn elements_act_in_every_method() {
    let alpha = |kind: &str| {
        let method = "integrator = { method = 'kr_alpha', rho_infinity = 0.8 }";
        run(&held(kind).without("integrator").with(method))
    };
    for law in [ELASTIC, STEEL] {
        let off = peak(&alpha(law), "x1") / peak(&run(&held(law)), "x1") - 1.0;
        assert!(off.abs() < 5e-3, "{law}: {off:e}");
    }
}

/// A mass in a force is late, with a joint elsewhere as without one.
#[test]
fn late_mass_counts_beside_a_joint() {
    let text = |mass: &str, stiffness: &str, rows: &str| {
        format!(
            "[time]\nrate_hz = 100\nduration_s = 1\n[structure.matrices]\nmass = {mass}\nstiffness = {stiffness}\n\
             [excitation.ground_acceleration.signal.sine]\namplitude = 1\nfrequency_hz = 1\n[[specimen]]\nname = \"rig\"\n\
             rows = [{rows}]\nstiffness_n_per_m = 1e6\nmass_in_force_kg = 900\nlaw.linear = {{ stiffness_n_per_m = 1e6 }}\n"
        )
    };
    let lambda = |text: String| {
        prepare(&text)
            .facts
            .structure
            .unwrap()
            .lambda
            .unwrap()
            .value()
    };
    let alone = lambda(text("[[1000]]", "[[2e6]]", "[1]"));
    // Two springs in series between the ground and a joint, and a third one to the mass: 2e6 N/m.
    let joint = lambda(text(
        "[[1000, 0], [0, 0]]",
        "[[4e6, -4e6], [-4e6, 8e6]]",
        "[1, 0]",
    ));
    assert!((joint / alone - 1.0).abs() < 1e-6, "{joint} {alone}");
}

#[test]
fn lambda_is_that_of_the_masses() {
    let lambda = |text: &str| {
        let facts = prepare(&text.with("integrator.lambda = 'auto'")).facts;
        facts.structure.unwrap().lambda.unwrap().value()
    };
    assert_eq!(lambda(&held(STEEL)), 11.5);
    // A stiff mass: as if the joint were not there.
    let stiff = "time.rate_hz = 20";
    let off = lambda(&held(ELASTIC).with(stiff)) / lambda(&CONDENSED.with(stiff)) - 1.0;
    assert!(off.abs() < 1e-6, "{off:e}");
}

#[test]
fn initial_place_without_mass_must_balance() {
    let begun = |x: &str| held(ELASTIC).with(&format!("structure.initial_displacement_m = {x}"));
    let free = run(&begun("[0.011, 0.001]"));
    assert!((free.column("x2")[0] - 1e-3).abs() < 1e-15);
    let refused = refusal(begun("[0.011, 0.0]"));
    assert!(refused.contains("initial_displacement_m"), "{refused}");
    let moving = |v: &str| held(ELASTIC).with(&format!("structure.initial_velocity_m_per_s = {v}"));
    let free = run(&moving("[0.11, 0.01]"));
    assert_eq!(free.outcome.ending, Ending::Completed);
    let refused = refusal(moving("[0.11, 0.0]"));
    assert!(refused.contains("initial_velocity_m_per_s"), "{refused}");
}

/// ω² = (k − W/h)/m, with the weight of a leaning column beside the mass.
#[test]
fn weight_lengthens_the_period() {
    let text = CONDENSED
        .with("structure.shear_building.p_delta = { storey_height_m = [2.0], weight_n = [4e5] }");
    let facts = prepare(&text).facts.structure.unwrap();
    let expected = ((909090.9090909091_f64 - 2e5) / 1000.0).sqrt();
    let found = facts.frequencies[0];
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
}
