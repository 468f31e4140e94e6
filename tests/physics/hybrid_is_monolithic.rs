//! With an ideal specimen the hybrid run is the monolithic run of the same structure, to roundoff, for every law.
//!
//! A law is used once as `[[specimen]]`, commanded and measured through a port, and once as `[[structure.element]]`. A command
//! needs no value of step n + 1, so the two recursions are the same and differ by rounding alone. In each of N = 2048 ticks some
//! ten operations on forces of the size of the peak have a relative error of 1.1e-16. The stable recursion adds it up at most
//! linearly: 2048 · 10 · 1.1e-16 = 2.3e-12 of the peak.

use crate::common::engine::{Run, distance, run};
use crate::common::test_file::TestFile;
use gusset_control::engine::Phase;
use gusset_numerics::law::LawSpec;
use gusset_view::report::metrics::identify;

const ROUNDOFF: f64 = 2.3e-12;

/// A damped three-storey frame with these storey stiffnesses, under a synthetic earthquake of 0.35 g, and `rest`.
fn frame(storeys: &str, rest: &str) -> String {
    frame_with(storeys, "", rest)
}

fn frame_with(storeys: &str, structure: &str, rest: &str) -> String {
    format!(
        r#"
        [time]
        rate_hz = 256
        duration_s = 8
        [integrator]
        lambda = 2
        [structure]
        {structure}
        [structure.shear_building]
        mass_kg = [20e3, 20e3, 18e3]
        stiffness_n_per_m = {storeys}
        [structure.damping.rayleigh_ratio]
        ratio = 0.02
        first_hz = 1.2
        second_hz = 6.0
        [excitation.ground_acceleration.signal.kanai_tajimi]
        ground_frequency_hz = 2.4
        ground_damping_ratio = 0.6
        envelope = {{ jennings_housner = {{ rise_s = 1, strong_s = 5, decay_per_s = 0.4 }} }}
        duration_s = 8
        seed = 20140402
        peak = 0.35
        unit = "g"
        {rest}"#
    )
}

fn element(from: &str, to: usize, law: &str) -> String {
    format!("\n[[structure.element]]\nfrom = {from}\nto = {to}\nlaw = {{ {law} }}\n")
}

fn specimen(name: &str, sees: &str, law: &str) -> String {
    format!("\n[[specimen]]\nname = \"{name}\"\n{sees}\nlaw = {{ {law} }}\n")
}

/// x, v and a of every DOF agree within `tolerance` of their peaks.
fn assert_same(hybrid: &Run, whole: &Run, tolerance: f64, what: &str) {
    for letter in ["x", "v", "a"] {
        for dof in 1..=3 {
            let name = format!("{letter}{dof}");
            let found = distance(&hybrid.column(&name), &whole.column(&name));
            assert!(
                found <= tolerance,
                "{what}: {name} differs by {found:e} of its peak"
            );
        }
    }
}

const STEEL: &str =
    "bilinear = { stiffness_n_per_m = 9e6, yield_force_n = 70e3, post_yield_ratio = 0.05 }";
const WEN: &str = "bouc_wen = { stiffness_n_per_m = 9e6, yield_force_n = 60e3, \
                   post_yield_ratio = 0.08, beta = 0.55, gamma = 0.45, exponent = 1.6 }";

/// One of every kind, and more of the kinds that have several faces. True: not linear.
const LAWS: [(&str, bool); 28] = [
    (
        "linear = { stiffness_n_per_m = 9e6, damping_n_s_per_m = 9e4 }",
        false,
    ),
    (
        "square_root = { stiffness_n_per_m = 9e6, hardening_per_sqrt_m = 3.0 }",
        true,
    ),
    (
        "square_root = { stiffness_n_per_m = 9e6, hardening_per_sqrt_m = -2.0 }",
        true,
    ),
    (
        "cubic = { stiffness_n_per_m = 9e6, cubic_n_per_m3 = 8e9 }",
        true,
    ),
    (STEEL, true),
    (
        "bilinear = { post_yield_ratio = 0, stiffness_n_per_m = 9e6, yield_force_n = 90e3 }",
        true,
    ),
    (
        "bouc_wen = { stiffness_n_per_m = 9e6, yield_force_n = 60e3, post_yield_ratio = 0.08, \
      beta = 0.55, gamma = 0.45, exponent = 1 }",
        true,
    ),
    (
        "bouc_wen = { stiffness_n_per_m = 9e6, yield_force_n = 60e3, post_yield_ratio = 0.08, \
      a = 1.2, beta = 0.3, gamma = 0.7, exponent = 2 }",
        true,
    ),
    (WEN, true),
    (
        "bouc_wen = { stiffness_n_per_m = 9e6, yield_force_n = 60e3, post_yield_ratio = 0.08, \
      beta = 0.55, gamma = 0.45, exponent = 1.6, hardening_ratio = 1.3, \
      degradation = { strength = 0.02, stiffness = 0.03 }, pinching = { total_slip = 0.8, \
      slope = 0.1, initiation = 0.2, magnitude = 0.2, rate = 0.01, severity = 0.4 } }",
        true,
    ),
    (
        "gap = { stiffness_n_per_m = 9e6, gap_m = 0.006, side = \"both\" }",
        true,
    ),
    (
        "gap = { stiffness_n_per_m = 9e6, gap_m = 0.004, side = \"tension\" }",
        true,
    ),
    (
        "gap = { stiffness_n_per_m = 9e6, gap_m = 0.0, side = \"compression\" }",
        true,
    ),
    (
        "bilinear = { post_yield_ratio = 0, yield_force_n = 50e3, stiffness_n_per_m = 2e7 }",
        true,
    ),
    (
        "smooth_friction = { slip_force_n = 50e3, reference_velocity_m_per_s = 0.05 }",
        true,
    ),
    (
        "linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 3e5 }",
        false,
    ),
    (
        "biviscous = { damping_n_s_per_m = 6e5, post_yield_damping_n_s_per_m = 1e5, \
      yield_velocity_m_per_s = 0.05 }",
        true,
    ),
    (
        "power_damper = { force_at_unit_velocity_n = 2e5, exponent = 0.4, \
      linear_below_m_per_s = 0.01 }",
        true,
    ),
    (
        "power_damper = { force_at_unit_velocity_n = 4e5, exponent = 2, \
      reference_damping_n_s_per_m = 1e5 }",
        true,
    ),
    (
        "parallel = [ { bilinear = { stiffness_n_per_m = 6e6, yield_force_n = 50e3, \
      post_yield_ratio = 0.1 } }, { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 1e5 } }, \
      { gap = { stiffness_n_per_m = 5e6, gap_m = 0.01, side = \"both\" } } ]",
        true,
    ),
    (
        "parallel = [ { parallel = [ { bilinear = { post_yield_ratio = 0, yield_force_n = 30e3, stiffness_n_per_m = 2e7 } } ] } ]",
        true,
    ),
    (
        "imk = { stiffness_n_per_m = 2e7, yield_force_n = 30e3, capping_ratio = 1.2, plastic_disp_m = 0.01, \
         post_capping_disp_m = 0.05, ultimate_disp_m = 0.2, strength_lambda_m = 0.3 }",
        true,
    ),
    (
        "hysteretic = { positive = [{ disp_m = 0.003, force_n = 30e3 }, { disp_m = 0.02, force_n = 40e3 }], pinch_x = 0.7, \
         pinch_y = 0.3, damage_1 = 0.01, beta = 0.2 }",
        true,
    ),
    (
        "pinching4 = { positive = [{ disp_m = 0.003, force_n = 30e3 }, { disp_m = 0.01, force_n = 40e3 }, \
         { disp_m = 0.03, force_n = 42e3 }, { disp_m = 0.08, force_n = 20e3 }], \
         pinching = { r_disp = 0.5, r_force = 0.25, u_force = 0.05 }, g_f = [0.2, 0.1, 1, 1, 0.5] }",
        true,
    ),
    (
        "buckling_restrained = { stiffness_n_per_m = 9e6, yield_force_n = 50e3, strain_hardening = 1.3, \
         compression_overstrength = 1.1, post_yield_ratio = 0.03, saturation_disp_m = 0.03, exponent = 0.8 }",
        true,
    ),
    (
        "self_centring = { stiffness_n_per_m = 9e6, activation_force_n = 40e3, post_activation_ratio = 0.1, beta = 0.7 }",
        true,
    ),
    (
        "pounding = { stiffness_n_per_m1_5 = 5e7, gap_m = 0.004, side = \"both\", restitution = 0.8, \
         largest_penetration_m = 0.03, least_impact_velocity_m_per_s = 0.2 }",
        true,
    ),
    (
        "maxwell = { stiffness_n_per_m = 1e7, force_at_unit_velocity_n = 4e5, exponent = 0.5 }",
        true,
    ),
];

/// No wildcard: a new kind of law must be added here.
fn kind(law: &LawSpec) -> usize {
    match law {
        LawSpec::Linear(_) => 0,
        LawSpec::SquareRoot(_) => 1,
        LawSpec::Cubic(_) => 2,
        LawSpec::Bilinear(_) => 3,
        LawSpec::BoucWen(_) => 4,
        LawSpec::Gap(_) => 5,
        LawSpec::SmoothFriction(_) => 6,
        LawSpec::Biviscous(_) => 7,
        LawSpec::PowerDamper(_) => 8,
        LawSpec::Parallel(_) => 9,
        LawSpec::Imk(_) => 10,
        LawSpec::Hysteretic(_) => 11,
        LawSpec::Pinching4(_) => 12,
        LawSpec::BucklingRestrained(_) => 13,
        LawSpec::SelfCentring(_) => 14,
        LawSpec::Pounding(_) => 15,
        LawSpec::Maxwell(_) => 16,
    }
}

#[test]
fn every_law_equals_its_element() {
    let mut kinds = [false; 17];
    for (law, nonlinear) in LAWS {
        kinds[kind(&toml::from_str(law).unwrap())] = true;
        for (storey, storeys, from) in [
            (1, "[4e6, 14e6, 11e6]", "\"ground\""),
            (2, "[15e6, 4e6, 11e6]", "1"),
        ] {
            let sees = format!("storey = {storey}");
            let hybrid = run(&frame(storeys, &specimen("s", &sees, law)));
            let whole = run(&frame(storeys, &element(from, storey, law)));
            assert_same(&hybrid, &whole, ROUNDOFF, law);
            // The law was nonlinear: no straight line explains its force.
            let (disp, force) = (hybrid.column("meas_1_1"), hybrid.column("force_1_1"));
            let line = identify(&disp, &disp, &force, 1.0 / 256.0).unwrap();
            assert_eq!(line.unexplained > 1e-3, nonlinear, "{law}: {line:?}");
        }
    }
    assert!(kinds.iter().all(|seen| *seen), "{kinds:?}");
}

#[test]
fn storey_of_the_specimen_alone_is_the_same() {
    for law in [STEEL, WEN, LAWS[9].0] {
        let hybrid = run(&frame("[0, 14e6, 11e6]", &specimen("s", "storey = 1", law)));
        let whole = run(&frame("[0, 14e6, 11e6]", &element("\"ground\"", 1, law)));
        assert_same(&hybrid, &whole, ROUNDOFF, law);
    }
}

/// A brace at an angle sees c·(x3 − x1): its force f(c Δ) enters as c f, so k, c and the yield force of the storey spring
/// that does the same are c² k, c² c_d and c F_y. Products of c round once more per tick: twice the tolerance.
#[test]
fn brace_over_two_storeys_sees_its_row_of_b() {
    let c = 0.8;
    let brace = |k: f64, fy: f64, cd: f64| {
        format!(
            "parallel = [ {{ bouc_wen = {{ stiffness_n_per_m = {k}, yield_force_n = {fy}, \
             post_yield_ratio = 0.05, beta = 0.6, gamma = 0.4, exponent = 2 }} }}, \
             {{ linear = {{ stiffness_n_per_m = 0, damping_n_s_per_m = {cd} }} }} ]"
        )
    };
    let (k, fy, cd) = (9e6, 60e3, 1e5);
    let rows = format!("rows = [[-{c}, 0, {c}]]");
    let hybrid = run(&frame(
        "[15e6, 8e6, 6e6]",
        &specimen("brace", &rows, &brace(k, fy, cd)),
    ));
    let law = brace(c * c * k, c * fy, c * c * cd);
    let whole = run(&frame("[15e6, 8e6, 6e6]", &element("1", 3, &law)));
    assert_same(&hybrid, &whole, 2.0 * ROUNDOFF, "brace");
}

#[test]
fn specimens_and_axes_equal_elements() {
    let pounding = "gap = { stiffness_n_per_m = 9e6, gap_m = 0.004, side = \"both\" }";
    let storeys = "[3e6, 14e6, 7e6]";
    let whole = element("\"ground\"", 1, WEN) + &element("2", 3, pounding);
    let whole = run(&frame(storeys, &whole));
    let two = specimen("lower", "storey = 1", WEN) + &specimen("upper", "storey = 3", pounding);
    assert_same(
        &run(&frame(storeys, &two)),
        &whole,
        ROUNDOFF,
        "two specimens",
    );
    let one = format!(
        "\n[[specimen]]\nname = \"both\"\nrows = [[1, 0, 0], [0, -1, 1]]\n\
         laws = [ {{ {WEN} }}, {{ {pounding} }} ]\n"
    );
    assert_same(&run(&frame(storeys, &one)), &whole, ROUNDOFF, "two axes");
}

/// K = [[9, −4], [−4, 6]] MN/m on floors 1 and 2 is three springs: 5 to the ground, 4 between, 2 to the ground. The mass
/// that the specimen declares is carried by the structure.
#[test]
fn coupled_specimen_is_its_springs() {
    let coupled = "\n[[specimen]]\nname = \"frame\"\nrows = [[1, 0, 0], [0, 1, 0]]\n\
                   [specimen.coupled]\nstiffness_n_per_m = [[9e6, -4e6], [-4e6, 6e6]]\n\
                   mass_kg = [[3e3, 0], [0, 2e3]]\n";
    let hybrid = run(&frame("[9e6, 8e6, 9e6]", coupled));
    let spring = |k: &str| format!("linear = {{ stiffness_n_per_m = {k} }}");
    let springs = element("\"ground\"", 1, &spring("5e6"))
        + &element("1", 2, &spring("4e6"))
        + &element("\"ground\"", 2, &spring("2e6"));
    let whole = frame("[9e6, 8e6, 9e6]", &springs)
        .with("structure.shear_building.mass_kg = [23e3, 22e3, 18e3]");
    assert_same(&hybrid, &run(&whole), ROUNDOFF, "coupled");
}

/// Millimetres, kilonewtons and a sign: each tick rounds a handful of conversions more, on top of the offsets. 1e-12 of the
/// peak for each of command and force, over a memory of a few hundred ticks (the damping of the frame): the same sum as above
/// with twice the operations.
#[test]
fn units_and_signs_change_only_the_wire() {
    let gear = "unit_disp = \"mm\"\nunit_force = \"kN\"\nsign = -1\n";
    let axis = |more: &str| format!("[[specimen.axis]]\n{gear}{more}");
    let cases = [
        // Odd laws do not care for the sign.
        (WEN, WEN, ""),
        // A spring preloaded by 12 mm: its load cell reads k · 12 mm = 108 kN where the deformation is zero.
        (
            "linear = { stiffness_n_per_m = 9e6, damping_n_s_per_m = 1e5 }",
            "linear = { stiffness_n_per_m = 9e6, damping_n_s_per_m = 1e5 }",
            "offset_m = 0.012\noffset_n = 108e3\n",
        ),
        // Taut at 4 mm on the axis, which is at 1 mm for d = 0 and reversed: compression at −3 mm.
        (
            "gap = { stiffness_n_per_m = 9e6, gap_m = 0.004, side = \"tension\" }",
            "gap = { stiffness_n_per_m = 9e6, gap_m = 0.003, side = \"compression\" }",
            "offset_m = 0.001\n",
        ),
    ];
    for (law, same, offsets) in cases {
        let specimen = specimen("rig", "storey = 1", law) + &axis(offsets);
        let hybrid = run(&frame("[4e6, 14e6, 11e6]", &specimen));
        let whole = run(&frame("[4e6, 14e6, 11e6]", &element("\"ground\"", 1, same)));
        assert_same(&hybrid, &whole, 2.0 * ROUNDOFF, law);
        // The link carries millimetres, reversed.
        let (target, sent) = (hybrid.column("target_1_1"), hybrid.column("cmd_1_1"));
        let offset = if offsets.contains("0.012") {
            12.0
        } else if offsets.is_empty() {
            0.0
        } else {
            1.0
        };
        let wanted: Vec<f64> = target.iter().map(|d| -1000.0 * d + offset).collect();
        assert!(distance(&sent, &wanted) < 1e-15);
    }
}

/// A specimen at one tenth, λ_L = 10, λ_F = 100, λ_T = √10: k_p = λ_F/λ_L k_m, F_p = λ_F F_m, c_p = λ_F λ_T/λ_L c_m.
#[test]
fn specimen_at_one_tenth_equals_full_storey() {
    let law = |k: f64, fy: f64, c: f64| {
        format!(
            "parallel = [ {{ bilinear = {{ stiffness_n_per_m = {k}, yield_force_n = {fy}, \
             post_yield_ratio = 0.05 }} }}, {{ linear = {{ stiffness_n_per_m = 0, damping_n_s_per_m = {c} }} }} ]"
        )
    };
    let root = 10f64.sqrt();
    let model = specimen("model", "storey = 1", &law(9e5, 700.0, 3e3))
        + &format!("[specimen.similitude]\nlength = 10\nforce = 100\ntime = {root}\n");
    let hybrid = run(&frame("[4e6, 14e6, 11e6]", &model));
    let prototype = law(9e6, 70e3, 100.0 * root / 10.0 * 3e3);
    let whole = run(&frame(
        "[4e6, 14e6, 11e6]",
        &element("\"ground\"", 1, &prototype),
    ));
    assert_same(&hybrid, &whole, 2.0 * ROUNDOFF, "model");
}

/// Under a static load, from an initial displacement and velocity: the specimen's commands before t = 0 and at t = 0 are the
/// displacements of the element. The two approach the static state by the same corrections, so the same tolerance holds.
#[test]
fn static_load_and_initial_motion_agree() {
    let structure = "static_load_n = [40e3, 20e3, 60e3]\n\
                     initial_displacement_m = [0.004, -0.002, 0.003]\n\
                     initial_velocity_m_per_s = [0.1, 0.25, -0.2]";
    let law = "parallel = [ { bilinear = { stiffness_n_per_m = 9e6, yield_force_n = 70e3, \
               post_yield_ratio = 0.05 } }, { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 2e5 } } ]";
    let text = |rest: &str| frame_with("[2e6, 14e6, 11e6]", structure, rest);
    let hybrid = run(&text(&specimen("s", "storey = 1", law)));
    let whole = run(&text(&element("\"ground\"", 1, law)));
    assert_same(&hybrid, &whole, ROUNDOFF, "static load");
    // The initial displacement counts from the loaded position, and the damper feels the initial velocity at once.
    let states = hybrid.all("state");
    let last = states.iter().rposition(|s| *s == Phase::Settling.code());
    let settled = hybrid.all("x1")[last.unwrap()];
    assert!((hybrid.column("x1")[0] - settled - 0.004).abs() < 1e-9 * settled);
    let (x, v) = (hybrid.column("x1")[0], hybrid.column("v1")[0]);
    assert_eq!(v, 0.1);
    // It settled beyond yield, on the upper branch, at which the return map puts it again after 4 mm more.
    let plastic = 0.05 * 9e6 * x + 0.95 * 70e3;
    assert!((hybrid.column("force_1_1")[0] - plastic - 2e5 * v).abs() < 1e-9 * plastic);
}

/// The inertia of 3 t in the measured force is not in M, but the ground shakes them too: F = −(M + Bᵀ m B) ι a_g. On floor 1 that
/// is the load of 23 t on 20 t, an influence of 1.15; a drift does not see a rigid motion at all.
#[test]
fn mass_in_the_measured_force_loads_only() {
    let storeys = "[4e6, 4e6, 11e6]";
    for (storey, from, influence) in [(1, "\"ground\"", "[1.15, 1, 1]"), (2, "1", "[1, 1, 1]")] {
        let sees = format!("storey = {storey}\nmass_in_force_kg = 3e3");
        // A rule that refers to the mass counts all that moves, and here nothing of that mass is anywhere: only the load is compared.
        let stiffness_alone = |text: String| {
            text.without("structure.damping.rayleigh_ratio").with(
                "structure.damping.rayleigh = { mass_coefficient_per_s = 0, stiffness_coefficient_s = 1e-3 }",
            )
        };
        let hybrid = run(&stiffness_alone(frame(
            storeys,
            &specimen("s", &sees, STEEL),
        )));
        let whole = frame(storeys, &element(from, storey, STEEL)).with(&format!(
            "excitation.ground_acceleration.influence = {influence}"
        ));
        // 1.15 · 20e3 rounds once.
        assert_same(&hybrid, &run(&stiffness_alone(whole)), ROUNDOFF, &sees);
    }
}
