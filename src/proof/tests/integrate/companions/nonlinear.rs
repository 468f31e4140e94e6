//! Nonlinear structures, equilibrium, fast modes, refusals, allocation.

use super::*;

fn element(name: &str, from: End, to: End, law: Box<dyn Law>) -> Element {
    Element {
        name: name.to_owned(),
        from,
        to,
        law,
        reach: Reach::default(),
        hardening_ratio: None,
        damping_ratio: None,
    }
}

/// Two masses: a cubic spring to the ground, a yielding one between them, a biviscous damper on the upper one.
pub(super) fn nonlinear() -> Structure {
    let cubic = CubicSpec {
        stiffness_n_per_m: 200.0,
        cubic_n_per_m3: 4e5,
        reference_stiffness_n_per_m: None,
    };
    let yielding: BilinearSpec =
        toml::from_str("stiffness_n_per_m = 300.0\nyield_force_n = 2.0\npost_yield_ratio = 0.1")
            .unwrap();
    let damper = BiviscousSpec {
        damping_n_s_per_m: 4.0,
        post_yield_damping_n_s_per_m: 1.0,
        yield_velocity_m_per_s: 0.05,
    };
    Structure::new(
        SymMatrix::diagonal(&[1.0, 2.0]),
        storeys(&[0.5, 0.2]),
        SymMatrix::zeros(2),
        vec![1.0; 2],
        vec![
            element(
                "a",
                End::Ground,
                End::Dof(0),
                Box::new(cubic.build().unwrap()),
            ),
            element(
                "b",
                End::Dof(0),
                End::Dof(1),
                Box::new(yielding.build().unwrap()),
            ),
            element(
                "c",
                End::Ground,
                End::Dof(1),
                Box::new(damper.build().unwrap()),
            ),
        ],
    )
    .unwrap()
}

fn push(t: f64, out: &mut [f64]) {
    out[0] = 2.0 * libm::sin(3.0 * t);
    out[1] = 4.0 * libm::sin(7.0 * t);
}

#[test]
fn nonlinear_systems_converge_to_one_answer() {
    let run = |way, steps: usize| {
        let dt = 2.0 / steps as f64;
        course(way, &mut nonlinear(), (dt, steps), State::at_rest(2), push)
    };
    let fine = run(Way::Newmark(NewmarkBeta::Average), 16_000);
    let sampled: Vec<_> = fine.disp.iter().step_by(40).cloned().collect();
    let size = distance(&sampled, &vec![vec![0.0; 2]; sampled.len()]);
    let drift = |x: &Vec<f64>| (x[1] - x[0]).abs();
    let most = fine.disp.iter().map(drift).fold(0.0, f64::max);
    assert!(most > 3.0 * 2.0 / 300.0, "the spring must yield: {most}");
    let kr = AlphaWeights::kr(0.8).unwrap();
    for way in DIRECT
        .into_iter()
        .chain([Way::Alpha(kr), Way::AlphaAtState(kr)])
    {
        let apart = distance(&run(way, 400).disp, &sampled);
        // Kinks of the laws cost order, and nonlinear damping costs the α methods one more; a wrong force shows at 1.
        let bound = if matches!(way, Way::Alpha(_) | Way::AlphaAtState(_)) {
            0.03
        } else {
            0.01
        };
        assert!(apart < bound * size, "{way:?}: {apart} of {size}");
    }
    // M a + R = F at every step, checked against a structure that walks the same path by itself.
    let dt = 2.0 / 400.0;
    let found = run(Way::Newmark(NewmarkBeta::Average), 400);
    let mut alone = nonlinear();
    let motion = found.disp.iter().zip(&found.vel).zip(&found.inertia);
    for (step, ((x, v), inertia)) in motion.enumerate() {
        let mut r = [0.0; 2];
        push(step as f64 * dt, &mut r);
        let since = if step == 0 { 0.0 } else { dt };
        alone.subtract_internal(x, v, Base::default(), since, &mut r);
        for (r, inertia) in r.iter().zip(inertia) {
            // Newton stops within 1e-10 of the response, times M/(β Δt²).
            assert!((r - inertia).abs() < 1e-4, "step {step}: {r} {inertia}");
        }
    }
}

#[test]
fn only_alpha_methods_damp_fast_modes() {
    // Ω = 1e4: the first steps overshoot, later ones shrink by ρ a step, or stay. The undamped ones turn by π − 4/Ω a
    // step, so that forty steps stay near a peak.
    let dt = 1e4;
    let stiff = || linear(scalar(1.0), scalar(0.0), scalar(1.0));
    let tail = |way| {
        let state = State::new(vec![1.0], vec![0.0]);
        let found = course(way, &mut stiff(), (dt, 40), state, |_, f| f[0] = 0.0);
        let largest = |range: std::ops::Range<usize>| {
            found.disp[range]
                .iter()
                .map(|x| x[0].abs())
                .fold(0.0, f64::max)
        };
        largest(36..41) / largest(6..11)
    };
    for rho in [0.3, 0.7] {
        for weights in [
            AlphaWeights::kr(rho).unwrap(),
            AlphaWeights::mkr(rho).unwrap(),
        ] {
            let shrunk = tail(Way::Alpha(weights));
            // ρ³⁰; multiple roots multiply by a polynomial of the step.
            assert!(shrunk < 100.0 * rho.powi(30), "{rho}: {shrunk}");
        }
    }
    assert!(tail(Way::Newmark(NewmarkBeta::Average)) > 0.9);
    assert!(tail(Way::Alpha(AlphaWeights::kr(1.0).unwrap())) > 0.9);
}

#[test]
fn massless_joint_follows_statically() {
    let joint = || {
        linear(
            SymMatrix::diagonal(&[1.0, 0.0, 2.0]),
            SymMatrix::zeros(3),
            storeys(&[40.0, 60.0, 80.0]),
        )
    };
    let load = |t: f64, f: &mut [f64]| f.copy_from_slice(&[0.0, 0.0, libm::sin(t)]);
    for way in [
        Way::Newmark(NewmarkBeta::Average),
        Way::Alpha(AlphaWeights::kr(0.7).unwrap()),
    ] {
        let found = course(way, &mut joint(), (0.02, 300), State::at_rest(3), load);
        for x in &found.disp[5..] {
            // The joint divides its neighbours' distance as 1/60 to 1/80, up to the inertia of one step.
            let expected = (60.0 * x[0] + 80.0 * x[2]) / 140.0;
            assert!((x[1] - expected).abs() < 2e-3 * 0.05, "{way:?}: {x:?}");
        }
    }
    let (m, c, k) = (
        SymMatrix::diagonal(&[1.0, 0.0]),
        SymMatrix::zeros(2),
        storeys(&[1.0, 1.0]),
    );
    let newton = NewtonSettings::default();
    for refused in [
        Newmark::new(&m, &c, &k, 0.1, NewmarkBeta::Explicit, newton).err(),
        CentralDifference::new(&m, &c, &k, 0.1, newton).err(),
        Chang2002::new(&m, &c, &k, 0.1, newton).err(),
    ] {
        assert_is!(refused.unwrap() => MethodError::Massless { dof: 1 });
    }
}

#[test]
fn lost_equilibrium_names_step_and_dof() {
    let mut structure = nonlinear();
    let newton = NewtonSettings {
        iterations: 1,
        ..NewtonSettings::default()
    };
    let (c, k) = (
        structure.reference_damping(),
        structure.reference_stiffness(),
    );
    let mass = structure.mass().clone();
    let mut method = Newmark::new(&mass, &c, &k, 0.01, NewmarkBeta::Average, newton).unwrap();
    let mut state = State::at_rest(2);
    let mut forces = Loaded::new(&mut structure, |step, out: &mut [f64]| {
        push(step as f64 * 0.01, out);
        Base::default()
    });
    method.begin(&state, &[0.0; 2]);
    let failed = method
        .step(1, &mut state, &mut forces, &mut [0.0; 2])
        .unwrap_err();
    let StepError::NotConverged {
        step,
        iterations,
        residual,
        ..
    } = failed;
    assert_eq!((step, iterations), (1, 1));
    assert!(residual.is_finite());
}

#[test]
fn bad_parameters_are_refused_with_numbers() {
    for rho in [-0.1, 1.1, f64::NAN] {
        for refused in [AlphaWeights::kr(rho), AlphaWeights::mkr(rho)] {
            let text = refused.unwrap_err().to_string();
            assert!(text.starts_with("rho_infinity is") && text.ends_with("from 0 to 1"));
        }
    }
    let one = scalar(1.0);
    for dt in [0.0, f64::NAN] {
        let refused = Chang2002::new(&one, &one, &one, dt, NewtonSettings::default());
        assert!(matches!(
            refused,
            Err(MethodError::Gui(GuiError::Step { .. }))
        ));
    }
    let lax = NewtonSettings {
        tolerance: f64::NAN,
        iterations: 5,
    };
    let refused = CentralDifference::new(&one, &one, &one, 0.1, lax);
    assert!(matches!(refused, Err(MethodError::Parameter(_))));
    let refused = KrAlpha::new(
        &one,
        &SymMatrix::zeros(2),
        &one,
        0.1,
        AlphaWeights::kr(0.5).unwrap(),
    );
    assert!(matches!(
        refused,
        Err(MethodError::Gui(GuiError::Sizes { .. }))
    ));
}

#[test]
fn alpha_step_allocates_nothing() {
    let structure = frame();
    let weights = AlphaWeights::kr(0.5).unwrap();
    let make = || {
        KrAlpha::new(
            structure.mass(),
            structure.damping(),
            structure.stiffness(),
            0.01,
            weights,
        )
        .unwrap()
    };
    let (mut method, mut state) = (make(), State::at_rest(3));
    method.prepare(&mut state);
    let (r, mut reported) = ([1.0, -2.0, 0.5], [0.0; 3]);
    let counted = allocation_counter::measure(|| {
        for _ in 0..100 {
            method.advance(&mut state, &r, &mut reported);
        }
    });
    assert_eq!(counted.count_total, 0);
    // The memory belongs to the state: another instance continues with identical bits.
    let mut other = make();
    let mut copy = state.clone();
    method.advance(&mut state, &r, &mut reported);
    other.advance(&mut copy, &r, &mut reported);
    assert_eq!(state, copy);
}
