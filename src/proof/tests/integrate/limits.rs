//! Limits of stability: the published limits, examples 4.1 and 4.2, and the choice of lambda.

use super::*;

#[test]
fn linear_limit_is_as_published() {
    // (λ − 4) Ω² ≤ 4 λ: 1 % inside stays, 1 % outside grows as a sawtooth.
    for lambda in [5.0f64, 11.5, f64::INFINITY] {
        let limit = (4.0 / (1.0 - 4.0 / lambda)).sqrt();
        for ratio in [0.0, 0.02, 0.2] {
            let largest = |omega: f64| {
                let (c, k) = (2.0 * ratio * omega, omega * omega);
                let mut gui = sdof(1.0, c, k, 1.0, lambda, Start::Published);
                let (c, k) = (scalar(c), scalar(k));
                let (x, _) = run(
                    &mut gui,
                    State::new(vec![1e-3], vec![0.0]),
                    1500,
                    linear(&c, &k),
                );
                peak(&x, 0) / 1e-3
            };
            // Inside, the envelope 1/√(1 − Ω²/Ω_lim²)-like factor is below 20 at 1 %.
            assert!(largest(0.99 * limit) < 20.0, "λ = {lambda}, ξ = {ratio}");
            assert!(grows(largest(1.01 * limit)), "λ = {lambda}, ξ = {ratio}");
        }
    }
}

#[test]
fn changed_tangent_has_the_published_bound() {
    // (41): λ (Ω_t² − 4 + 2 Δt (c_t − c_0)/m) ≤ 4 Ω0².
    let dt = 0.5;
    for (lambda, k0, c0, ct) in [
        (1.0, 40.0, 0.0, 0.0),
        (4.0, 30.0, 0.8, 0.8),
        (4.0, 30.0, 0.8, 1.4),
        (11.5, 8.0, 0.2, 0.5),
    ] {
        let kt = (4.0 * k0 * dt * dt / lambda + 4.0 - 2.0 * dt * (ct - c0)) / (dt * dt);
        let proof = |k: f64| StabilityProof {
            mass: scalar(1.0),
            damping: scalar(c0),
            stiffness: scalar(k0),
            damping_bound: scalar(ct),
            stiffness_bound: scalar(k),
            dt,
            late_mass: None,
            massless: Vec::new(),
        };
        let largest = |k: f64| {
            let mut gui = sdof(1.0, c0, k0, dt, lambda, Start::Published);
            let (c, k) = (scalar(ct), scalar(k));
            let (x, _) = run(
                &mut gui,
                State::new(vec![1e-3], vec![0.0]),
                3000,
                linear(&c, &k),
            );
            peak(&x, 0) / 1e-3
        };
        assert!(largest(0.99 * kt) < 50.0, "λ = {lambda}");
        assert!(grows(largest(1.01 * kt)), "λ = {lambda}");
        let given = Lambda::Finite(lambda);
        assert!(proof(0.999_999 * kt).holds(given) && !proof(1.000_001 * kt).holds(given));
        let limit = proof(kt).limit(f64::INFINITY, &[]).unwrap().unwrap();
        assert!((limit / lambda - 1.0).abs() < 1e-9);
    }
}

/// Two undamped storeys under a_g = 20 sin t, as in examples 4.1 and 4.2.
struct TwoStoreys {
    m: [f64; 2],
    k: [f64; 2],
}

const EXAMPLE_4_1: TwoStoreys = TwoStoreys {
    m: [1e3, 4e3],
    k: [2e6, 1e5],
};
const EXAMPLE_4_2: TwoStoreys = TwoStoreys {
    m: [1e3, 6e3],
    k: [1e7, 1e5],
};

impl TwoStoreys {
    fn proof(&self) -> StabilityProof {
        StabilityProof {
            mass: SymMatrix::diagonal(&self.m),
            damping: SymMatrix::zeros(2),
            stiffness: storeys(&self.k),
            damping_bound: SymMatrix::zeros(2),
            stiffness_bound: storeys(&self.k),
            dt: 0.05,
            late_mass: None,
            massless: Vec::new(),
        }
    }

    fn parts(&self) -> Vec<Part> {
        let rows = [vec![(0, 1.0)], vec![(0, -1.0), (1, 1.0)]];
        let parts = rows.into_iter().zip(self.k).enumerate();
        parts
            .map(|(i, (row, k))| Part {
                name: format!("storey {}", i + 1),
                row,
                stiffness_bound: k,
                damping: 0.0,
                damping_bound: 0.0,
            })
            .collect()
    }

    fn run(&self, lambda: f64, dt: f64, seconds: f64, theta: [f64; 2]) -> Vec<Vec<f64>> {
        let lambda = Lambda::new(lambda).unwrap();
        let (m, c) = (SymMatrix::diagonal(&self.m), SymMatrix::zeros(2));
        let mut gui = Gui::new(&m, &c, &storeys(&self.k), dt, lambda, Start::Published).unwrap();
        let steps = (seconds / dt).round() as usize;
        let force =
            |i: usize, drift: f64| self.k[i] * drift * (1.0 + theta[i] * drift.abs().sqrt());
        let (x, _) = run(&mut gui, State::at_rest(2), steps, |i, s, r| {
            let a = 20.0 * libm::sin(i as f64 * dt);
            let bottom = force(0, s.disp[0]);
            let top = force(1, s.disp[1] - s.disp[0]);
            r[0] = -self.m[0] * a - bottom + top;
            r[1] = -self.m[1] * a - top;
        });
        x
    }
}

#[test]
fn example_4_1_is_as_published() {
    let found = gusset_numerics::linalg::frequencies(
        &storeys(&EXAMPLE_4_1.k),
        &SymMatrix::diagonal(&EXAMPLE_4_1.m),
        2,
    )
    .unwrap();
    assert!((found[0] - 4.88).abs() < 0.005 && (found[1] - 45.84).abs() < 0.005);
    let limit = EXAMPLE_4_1
        .proof()
        .limit(f64::INFINITY, &[])
        .unwrap()
        .unwrap();
    assert!((limit - 16.77).abs() < 0.005, "{limit}");
    let reference = peak(&EXAMPLE_4_1.run(f64::INFINITY, 1e-4, 20.0, [0.0; 2]), 0);
    for lambda in [2.0, 4.0, 11.5] {
        // "Good" by the measure of the acceptance values: R ≤ 1.05.
        let ratio = peak(&EXAMPLE_4_1.run(lambda, 0.05, 20.0, [0.0; 2]), 0) / reference;
        assert!(ratio <= 1.05, "λ = {lambda}: {ratio}");
    }
    for lambda in [17.0, f64::INFINITY] {
        let ratio = peak(&EXAMPLE_4_1.run(lambda, 0.05, 20.0, [0.0; 2]), 0) / reference;
        assert!(unstable(ratio), "λ = {lambda}: {ratio}");
    }
}

#[test]
fn example_4_2_is_as_published() {
    let limit = EXAMPLE_4_2
        .proof()
        .limit(f64::INFINITY, &[])
        .unwrap()
        .unwrap();
    assert!((limit - 4.75).abs() < 0.005, "{limit}");
    // Least limit over the run, from the tangents of the reference: 4.75 softening (at rest), 3.79 hardening.
    for (theta, least, good, bad) in [
        ([-0.1, -0.2], 4.75, &[2.0, 4.0, 4.7][..], &[4.9, 11.5][..]),
        ([1.0, 2.0], 3.79, &[1.2, 3.7], &[3.9, 4.0, 11.5]),
    ] {
        let exact = EXAMPLE_4_2.run(f64::INFINITY, 1e-4, 15.0, theta);
        let limits = exact.iter().step_by(100).map(|x| {
            let tangent = |i: usize, drift: f64| {
                EXAMPLE_4_2.k[i] * (1.0 + 1.5 * theta[i] * drift.abs().sqrt())
            };
            let stiffness_bound = storeys(&[tangent(0, x[0]), tangent(1, x[1] - x[0])]);
            let proof = StabilityProof {
                stiffness_bound,
                ..EXAMPLE_4_2.proof()
            };
            proof.limit(f64::INFINITY, &[]).unwrap().unwrap()
        });
        let found = limits.fold(f64::INFINITY, f64::min);
        assert!((found - least).abs() < 0.0051, "θ = {theta:?}: {found}");

        // R = peak bottom drift over that of the reference: good to 1.05, unstable beyond 3.
        let reference = peak(&exact, 0);
        let ratio = |lambda| peak(&EXAMPLE_4_2.run(lambda, 0.05, 15.0, theta), 0) / reference;
        for &lambda in good {
            assert!(ratio(lambda) <= 1.05, "θ = {theta:?}, λ = {lambda}");
        }
        for &lambda in bad {
            assert!(unstable(ratio(lambda)), "θ = {theta:?}, λ = {lambda}");
        }
        if theta[0] < 0.0 {
            let fluctuating = ratio(4.8);
            assert!(fluctuating > 1.05 && fluctuating <= 3.0, "{fluctuating}");
        }
    }
}

#[test]
fn automatic_lambda_names_what_governs() {
    // Soft and well resolved: the accurate value.
    let mut proof = EXAMPLE_4_1.proof();
    proof.dt = 0.01;
    let choice = proof
        .choose(None, GAIN_NUMERICAL, &EXAMPLE_4_1.parts())
        .unwrap();
    assert_eq!(choice.lambda, Lambda::Finite(ACCURATE_LAMBDA));
    assert_eq!((choice.limit, choice.margin), (None, f64::INFINITY));
    assert!(choice.is_stable() && choice.governing.is_none());

    // One degree of freedom: λ_g = 4 Ω0²/(Ω0² (1 + 1/g) − 4), the closed form of the pencil.
    for gain in [2.0, 10.0] {
        let choice = EXAMPLE_4_2
            .proof()
            .choose(None, gain, &EXAMPLE_4_2.parts())
            .unwrap();
        let single = StabilityProof {
            mass: scalar(1.0),
            damping: scalar(0.0),
            stiffness: scalar(1e4),
            damping_bound: scalar(0.0),
            stiffness_bound: scalar(1e4),
            dt: 1.0,
            late_mass: None,
            massless: Vec::new(),
        };
        let limit = single.limit(gain, &[]).unwrap().unwrap();
        let exact = 4e4 / (1e4 * (1.0 + 1.0 / gain) - 4.0);
        assert!((limit / exact - 1.0).abs() < 1e-10);
        assert!((limit / (4.0 * gain / (gain + 1.0)) - 1.0).abs() < 1e-3);
        assert_eq!(choice.lambda.value(), choice.limit_with_gain.unwrap());
        let Governing {
            place,
            share,
            frequency,
        } = choice.governing.unwrap();
        assert_eq!(place, Place::Part("storey 1".to_owned()));
        assert!(share > 0.95);
        assert!((frequency - 100.50).abs() < 0.005);
    }

    // A λ by request is kept, and its margin says what it is worth.
    let choice = EXAMPLE_4_1
        .proof()
        .choose(Some(Lambda::Finite(17.0)), 10.0, &[])
        .unwrap();
    assert_eq!(choice.lambda, Lambda::Finite(17.0));
    assert!(!choice.is_stable() && (choice.margin - 16.77 / 17.0).abs() < 1e-3);
    assert_eq!(choice.governing.unwrap().place, Place::Dof(0));
    let choice = EXAMPLE_4_1
        .proof()
        .choose(Some(Lambda::Infinite), 10.0, &[])
        .unwrap();
    assert_eq!(choice.margin, 0.0);
}

#[test]
fn massless_critical_shape_has_no_frequency() {
    let coupled = [(0, 0, 4e6), (0, 1, -2e6), (1, 1, 3e6)];
    let stiffness = SymMatrix::from_triplets(2, coupled);
    let proof = |mass: f64| StabilityProof {
        mass: SymMatrix::diagonal(&[1e3, mass]),
        damping: SymMatrix::zeros(2),
        stiffness: stiffness.clone(),
        damping_bound: SymMatrix::zeros(2),
        stiffness_bound: stiffness.clone(),
        dt: 1.0 / 1024.0,
        late_mass: None,
        massless: Vec::new(),
    };
    for (mass, said) in [
        (0.0, "no mass)"),
        // The stiff end of √(k/m), little as that is.
        (1e-9, "at 8.717 MHz"),
    ] {
        let lambda = Some(Lambda::Finite(2.0));
        let choice = proof(mass).choose(lambda, GAIN_NUMERICAL, &[]).unwrap();
        let governing = choice.governing.unwrap().to_string();
        assert!(
            governing.contains("freedom 2") && governing.contains(said),
            "{governing}"
        );
    }
}

#[test]
fn case_without_a_stable_lambda_is_an_error() {
    // A damper that C0 does not know: 2 Δt c_max > 4 m and nothing in K0.
    let proof = StabilityProof {
        mass: SymMatrix::diagonal(&[1.0, 1.0]),
        damping: SymMatrix::zeros(2),
        stiffness: SymMatrix::diagonal(&[100.0, 0.0]),
        damping_bound: SymMatrix::diagonal(&[0.0, 50.0]),
        stiffness_bound: SymMatrix::diagonal(&[100.0, 0.0]),
        dt: 0.1,
        late_mass: None,
        massless: Vec::new(),
    };
    let damper = Part {
        name: "damper".to_owned(),
        row: vec![(1, 1.0)],
        stiffness_bound: 0.0,
        damping: 0.0,
        damping_bound: 50.0,
    };
    let error = proof.choose(None, 10.0, &[damper]).unwrap_err().to_string();
    assert!(
        error.contains("no lambda") && error.contains("damper"),
        "{error}"
    );
}
