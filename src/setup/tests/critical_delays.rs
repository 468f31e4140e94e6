//! Tables of critical delays, of test files.

use super::*;
use gusset_numerics::spectral::delay::{DiscreteLimit, continuous};
use gusset_proof::Analysis;

fn analysis(text: &str) -> Analysis {
    let loaded = parse(Path::new("test.toml"), text.to_owned(), &[]).unwrap();
    let prepared = crate::build(&loaded).unwrap();
    prepared.facts.structure.unwrap().analysis.unwrap()
}

const TIME: &str = "[time]\nrate_hz = 1000\nduration_s = 1\n[integrator]\nlambda = 4\n\
    [excitation.ground_acceleration.signal.sine]\namplitude = 1.0\nfrequency_hz = 1.0\n";

/// A specimen of this law in a structure of 2 t, 1 MN/m and 5 kN s/m, and the same structure with a linear specimen of 0.5 MN/m,
/// the stiffness of the law at rest.
fn at_rest_as_linear(law: &str) {
    let with = |law: &str| {
        analysis(&format!(
            "{TIME}[structure.matrices]\nmass = [[2000]]\nstiffness = [[1e6]]\ndamping = [[5e3]]\n\
             [[specimen]]\nname = \"it\"\nrows = [[1]]\nreach_vel_m_per_s = 0.5\nlaw.parallel = [\
             {{ linear.stiffness_n_per_m = 5e5 }}{law}]\n"
        ))
    };
    let (found, linear) = (with(law), with(""));
    let delay = |of: &Analysis| of.loops[0].continuous().unwrap().unwrap().delay;
    // 10.1277 ms, from |L| = 1.
    assert!(
        (delay(&linear) - 10.127_7e-3).abs() < 1e-7,
        "{}",
        delay(&linear)
    );
    assert!((delay(&found) - delay(&linear)).abs() < 1e-12, "{law}");
    let table = |of: &Analysis| of.critical_delays(&[true], &[vec![f64::NAN]]).unwrap();
    let (found_at, linear_at) = (&table(&found)[0][0], &table(&linear)[0][0]);
    let close = found_at.at(5e5) / linear_at.at(5e5) - 1.0;
    // Entries of tables that reach to different ends, and a line between them.
    assert!(close.abs() < 5e-3, "{law}: {close}");
    let per_second = |of: &Analysis| of.delayed_modes()[0].per_second[0][0];
    let off = per_second(&found) / per_second(&linear) - 1.0;
    assert!(off.abs() < 1e-12, "{law}: {off}");
}

#[test]
fn damper_without_tangent_opposes_no_delay() {
    at_rest_as_linear(
        ", { power_damper = { force_at_unit_velocity_n = 2e4, exponent = 1.5, reference_damping_n_s_per_m = 4e3 } }",
    );
}

#[test]
fn open_gap_takes_no_part_in_a_delay() {
    at_rest_as_linear(", { gap = { stiffness_n_per_m = 1e6, gap_m = 0.05, side = \"tension\" } }");
}

#[test]
fn parallel_laws_count_separately() {
    // The one has no end of its tangent at rest, so that its reference counts; the other has none at all.
    let root = |more: &str| {
        let one = "power_damper = { force_at_unit_velocity_n = 1e3, exponent = 0.5, reference_damping_n_s_per_m = 1e3 }";
        let found = analysis(&format!(
            "{TIME}[structure.matrices]\nmass = [[1000]]\nstiffness = [[1e5]]\ndamping = [[200]]\n\
             [[specimen]]\nname = \"it\"\nrows = [[1]]\nreach_vel_m_per_s = 0.5\nlaw.parallel = [\
             {{ linear.stiffness_n_per_m = 5e4 }}, {{ {one} }}{more}]\n"
        ));
        found.loops[0].continuous().unwrap().unwrap().delay
    };
    let idle = ", { power_damper = { force_at_unit_velocity_n = 1e3, exponent = 2, reference_damping_n_s_per_m = 5e3 } }";
    assert!((root(idle) / root("") - 1.0).abs() < 1e-12);
}

/// k = 1e4 N/m beside an open gap of 1e7: the table reaches to 2e7, and is exact where the axis works.
#[test]
fn soft_axis_has_a_separate_critical_delay() {
    let with = |gap: &str| {
        let analysis = analysis(&format!(
            "{TIME}[structure.matrices]\nmass = [[1000]]\nstiffness = [[1e5]]\ndamping = [[400]]\n\
             [[specimen]]\nname = \"it\"\nrows = [[1]]\nlaw.parallel = [{{ linear.stiffness_n_per_m = 1e4 }}{gap}]\n"
        ));
        analysis
            .critical_delays(&[true], &[vec![f64::NAN]])
            .unwrap()[0][0]
            .clone()
    };
    let gap = ", { gap = { stiffness_n_per_m = 1e7, gap_m = 1.0, side = \"tension\" } }";
    let (stiff, plain) = (with(gap), with(""));
    assert!((stiff.at(1e4) / plain.at(1e4) - 1.0).abs() < 1e-9);
    for share in [0.6, 0.8, 1.2, 2.0] {
        let ratio = stiff.at(share * 1e4) / plain.at(share * 1e4);
        // Along straight lines between entries.
        assert!((0.95..=1.03).contains(&ratio), "{share}: {ratio}");
    }
}

/// Of two specimens the one, with 250 kg in its force, is on time: with the other late it moves with the structure.
#[test]
fn inertia_of_one_counts_for_another() {
    let found = analysis(&format!(
        "{TIME}[structure.shear_building]\nmass_kg = [1000, 900]\nstiffness_n_per_m = [1e6, 8e5]\n\
         [structure.damping.modal]\nratios = [0.02]\n\
         [[specimen]]\nname = \"heavy\"\nstorey = 2\nmass_in_force_kg = 250\nlaw.linear.stiffness_n_per_m = 1e5\n\
         [[specimen]]\nname = \"two\"\nstorey = 1\nlaw.linear.stiffness_n_per_m = 4e5\n"
    ));
    let critical = found.loops[1].continuous().unwrap().unwrap();
    // |L| = 1 by another program: 6.81 ms at 6.99 Hz, which is near the second mode.
    assert!(
        (critical.delay - 6.81e-3).abs() < 0.01e-3,
        "{}",
        critical.delay
    );
    let hz = critical.omega / std::f64::consts::TAU;
    assert!((hz - 6.99).abs() < 0.01, "{hz}");
}

/// Entries of a table.
const ENTRIES: usize = 33;

/// Critical delay in s of one degree of freedom with natural frequency `omega` (rad/s, of the total stiffness),
/// damping ratio `ratio` and the share `share` of its stiffness in the specimen. None if every delay is stable.
fn sdof(ratio: f64, share: f64, omega: f64) -> Option<f64> {
    let half = 1.0 - share - 2.0 * ratio * ratio;
    let radicand = half * half - (1.0 - 2.0 * share);
    if !(radicand >= 0.0 && share > 0.0 && omega > 0.0) {
        return None;
    }
    let roots = [half + radicand.sqrt(), half - radicand.sqrt()];
    let delays = roots
        .into_iter()
        .filter(|square| *square > 0.0)
        .map(|square| {
            let r = square.sqrt();
            let angle = libm::atan2(2.0 * ratio * r / share, (square - 1.0 + share) / share);
            let angle = if angle < 0.0 {
                angle + std::f64::consts::TAU
            } else {
                angle
            };
            angle / (r * omega)
        });
    delays.reduce(f64::min)
}

#[test]
fn one_dof_table_is_the_closed_form() {
    // 1000 kg, 1e5 N/m of the numerical side, 2e5 N/m of the specimen; 400 N s/m.
    let analysis = analysis(&format!(
        "{TIME}[structure.matrices]\nmass = [[1000]]\nstiffness = [[1e5]]\ndamping = [[400]]\n\
         [[specimen]]\nname = \"it\"\nrows = [[1]]\nlaw.linear = {{ stiffness_n_per_m = 2e5 }}\n"
    ));
    let tables = analysis.critical_delays(&[true], &[vec![3e5]]).unwrap();
    let table = &tables[0][0];
    for entry in 0..ENTRIES {
        // Reaches twice the bound.
        let stiffness = 6e5 * entry as f64 / (ENTRIES - 1) as f64;
        let total = 1e5 + stiffness;
        let omega = (total / 1000.0).sqrt();
        let exact = sdof(400.0 / (2.0 * 1000.0 * omega), stiffness / total, omega);
        let (found, exact) = (table.at(stiffness), exact.unwrap_or(f64::INFINITY));
        let same = found == exact || (found / exact - 1.0).abs() < 1e-6;
        assert!(same, "{stiffness}: {found} and not {exact}");
    }
}

#[test]
fn coarse_steps_lower_the_table_equally() {
    let with = |rate: u32, ticks: u32| {
        analysis(&format!(
            "{}[structure.matrices]\nmass = [[1000]]\nstiffness = [[1e5]]\ndamping = [[400]]\n\
             [[specimen]]\nname = \"it\"\nrows = [[1]]\nlaw.linear = {{ stiffness_n_per_m = 2e5 }}\n",
            TIME.replace(
                "rate_hz = 1000",
                &format!("rate_hz = {rate}\nticks_per_step = {ticks}")
            )
        ))
    };
    let at = |analysis: &Analysis| {
        let tables = analysis
            .critical_delays(&[true], &[vec![f64::NAN]])
            .unwrap();
        tables[0][0].at(2e5)
    };
    let continuous = continuous(&with(1000, 1).loops[0].system).unwrap().unwrap();
    assert!((at(&with(1000, 10)) / continuous.delay - 1.0).abs() < 1e-6);
    // 17 rad/s at 32 steps a second: Ω = 0.54.
    let coarse = with(32, 10);
    let DiscreteLimit::At(recursion) = coarse.loops[0].discrete(1.0 / 32.0, 4.0).unwrap() else {
        panic!("bears every delay");
    };
    assert!(
        recursion < 0.97 * continuous.delay,
        "{recursion} {continuous:?}"
    );
    assert!((at(&coarse) / recursion - 1.0).abs() < 1e-6);
}

#[test]
fn table_interpolates_the_direct_result() {
    let analysis = analysis(&format!(
        "{TIME}[structure.shear_building]\nmass_kg = [1000, 900, 800]\nstiffness_n_per_m = [0, 4e5, 3e5]\n\
         [structure.damping.rayleigh_ratio]\nratio = 0.03\nmodes = [1, 2]\n\
         [[specimen]]\nname = \"it\"\nstorey = 1\nmass_in_force_kg = 30\n\
         law.linear = {{ stiffness_n_per_m = 5e5, damping_n_s_per_m = 200 }}\n"
    ));
    let tables = analysis
        .critical_delays(&[true], &[vec![f64::NAN]])
        .unwrap();
    let table = &tables[0][0];
    let mut system = analysis.loops[0].system.clone();
    for tenth in 1..=20 {
        // No bound is declared: it reaches twice k̂. Off the entries, which are k̂/16 apart.
        let stiffness = 5e5 * (f64::from(tenth) / 10.0 - 0.011);
        system.specimen_stiffness[(0, 0)] = stiffness;
        let direct = continuous(&system).unwrap().unwrap().delay;
        // 1/τ bends by less than a hundredth over an interval, and below a tenth of k̂ it turns up from its threshold.
        let within = if tenth <= 2 { 0.1 } else { 0.01 };
        let found = table.at(stiffness);
        assert!(
            (found / direct - 1.0).abs() < within,
            "{stiffness}: {found} and not {direct}"
        );
    }
}

/// An open stopper or a damper without effect at rest does not change the critical delay, however large their shares of
/// K0 and C0 are.
#[test]
fn open_gap_and_idle_damper_do_nothing() {
    let with = |element: &str| {
        analysis(&format!(
            "{TIME}[structure.shear_building]\nmass_kg = [1000, 1000]\nstiffness_n_per_m = [71e3, 326e3]\n\
             damping_n_s_per_m = [400, 1400]\n{element}\
             [[specimen]]\nname = \"it\"\nstorey = 1\nlaw.linear = {{ stiffness_n_per_m = 129e3 }}\n"
        ))
    };
    let element = |law: &str| {
        format!("[[structure.element]]\nname = \"idle\"\nfrom = \"ground\"\nto = 1\n{law}\n")
    };
    let gap = "law.gap = { stiffness_n_per_m = 2e6, gap_m = 0.5, side = \"both\" }";
    let damper = "reach_vel_m_per_s = 0.5\nlaw.power_damper = { force_at_unit_velocity_n = 2e3, exponent = 2, \
                  reference_damping_n_s_per_m = 2000 }";
    let plain = with("");
    let limit = |analysis: &Analysis| continuous(&analysis.loops[0].system).unwrap().unwrap();
    // By another formulation: |k bᵀ D⁻¹ b| = 1.
    assert!((limit(&plain).delay - 4.453e-3).abs() < 1e-5);
    assert!(plain.loops[0].closed.is_none());
    let none = [vec![f64::NAN]];
    for law in [gap, damper] {
        let idle = with(&element(law));
        assert_eq!(limit(&idle), limit(&plain), "{law}");
        assert_eq!(
            idle.critical_delays(&[true], &none),
            plain.critical_delays(&[true], &none)
        );
        assert_eq!(
            idle.strain_energy(&[0.1, 0.2]),
            plain.strain_energy(&[0.1, 0.2])
        );
        let frequencies = |analysis: &Analysis| -> Vec<f64> {
            let modes = analysis.delayed_modes();
            modes.iter().map(|mode| mode.frequency).collect()
        };
        assert_eq!(frequencies(&idle), frequencies(&plain));
        // Their shares of K0 and C0 are in M_eff all the same: the recursion has more inertia and other poles.
        let recursion = |analysis: &Analysis| {
            let limit = analysis.loops[0].discrete(1e-3, 4.0).unwrap();
            let gusset_numerics::spectral::delay::DiscreteLimit::At(delay) = limit else {
                panic!("{limit:?}");
            };
            delay
        };
        let (found, exact) = (recursion(&idle), limit(&plain).delay);
        assert!((found / exact - 1.0).abs() < 0.01, "{law}: {found} {exact}");
        assert_ne!(found, recursion(&plain), "{law}");
    }
    let closed = with(&element(gap)).loops[0].closed.clone().unwrap();
    let closed = continuous(&closed).unwrap().unwrap().delay;
    assert!((closed - 21.40e-3).abs() < 0.3e-3, "{closed}");
}

#[test]
fn slow_or_undamped_table_is_refused() {
    let chain = |dofs: usize| {
        analysis(&format!(
            "{TIME}[structure.chain]\ndofs = {dofs}\nmass_kg = 1000\nstiffness_n_per_m = 4e5\ndamping_n_s_per_m = 300\n\
             [[specimen]]\nname = \"it\"\nrows = [[{}1]]\nlaw.linear = {{ stiffness_n_per_m = 2e5 }}\n",
            "0, ".repeat(dofs - 1)
        ))
    };
    let none = [vec![f64::NAN]];
    assert!(chain(12).critical_delays(&[true], &none).is_ok());
    let why = chain(13).critical_delays(&[true], &none).unwrap_err();
    assert!(why.contains("13 DOFs"), "{why}");
    assert_eq!(
        chain(13).critical_delays(&[false], &none),
        Ok(vec![Vec::new()])
    );
    let undamped = analysis(&format!(
        "{TIME}[structure.matrices]\nmass = [[1000]]\nstiffness = [[1e5]]\n\
         [[specimen]]\nname = \"it\"\nrows = [[1]]\nlaw.linear = {{ stiffness_n_per_m = 2e5 }}\n"
    ));
    let why = undamped.critical_delays(&[true], &none).unwrap_err();
    assert!(why.contains("no damping"), "{why}");
}
