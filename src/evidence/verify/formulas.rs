//! Table 1 and equations (11) to (19).

use nalgebra::{DMatrix, DVector};

use super::drive::{Alone, Random, oscillator, stepped};
use super::{Check, Effort, Proof};
use gusset_numerics::integrate::{
    Gui, Integrator, Lambda, Newmark, NewmarkBeta, NewtonSettings, Offline, Start, State,
};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::spectral::{self, Tabulated, Transfer};

const OMEGAS: [f64; 9] = [0.01, 0.1, 0.4, 0.9, 1.5, 1.99, 2.6, 4.0, 9.0];
const RATIOS: [f64; 6] = [0.0, 0.02, 0.1, 0.5, 1.0, 1.6];

/// Deviation of `found` from `wanted`, relative to 1 + |wanted|.
fn apart(found: f64, wanted: f64) -> f64 {
    (found - wanted).abs() / (1.0 + wanted.abs())
}

/// The larger; a NaN counts as infinite.
fn worse(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Table 1: the printed poles against the family, against the program's own step, and solved for α.
pub(super) fn table_1(_: Effort) -> Proof {
    let mut checks = Vec::new();
    for row in Tabulated::ALL {
        let lambda = row.lambda();
        let (mut of_family, mut of_step, mut alphas) = (0.0f64, 0.0f64, 0.0f64);
        for omega in OMEGAS {
            for ratio in RATIOS {
                let [first, second] = spectral::table_1(row, omega, ratio);
                let (sum, product) = ((first + second).re, (first * second).re);
                let [a1, a2, a3] = spectral::coefficients(omega, ratio, lambda);
                of_family = worse(of_family, apart(-a2 / a1, sum));
                of_family = worse(of_family, apart(a3 / a1, product));
                // Δt = 1: k = Ω², c = 2 ξ Ω.
                let (trace, determinant) = stepped(omega, ratio, lambda);
                of_step = worse(of_step, apart(trace, sum));
                of_step = worse(of_step, apart(determinant, product));
                // (12) solved for both parameters: 1 − sum + product = α1 Ω², 2 − sum = α2 Ω² + 2 α1 Ω ξ.
                let square = omega * omega;
                let alpha_1 = (1.0 - sum + product) / square;
                let alpha_2 = (2.0 - sum - 2.0 * alpha_1 * omega * ratio) / square;
                let given = spectral::alpha(omega, ratio, lambda);
                // The numerators cancel down to Ω².
                let scale = square.min(1.0);
                alphas = worse(alphas, (alpha_1 - given).abs() * scale);
                alphas = worse(alphas, (alpha_2 - given).abs() * scale);
            }
        }
        let name = row.name();
        let lambda = super::number(lambda);
        let poles = format!("{name}: printed poles − poles of the family at λ = {lambda}");
        // The printed form cancels for real poles: ε |z|², with |z| up to 40 here.
        checks.push(Check::within(&poles, "equal", of_family, 1e-12));
        let step = format!("{name}: printed poles − poles of one step of the program");
        checks.push(Check::within(&step, "equal", of_step, 1e-12));
        let both = format!("{name}: α1 and α2 solved from (12) − (13)");
        checks.push(Check::within(
            &both,
            "α1 = α2 = λ/(λ + λΩξ + Ω²)",
            alphas,
            1e-13,
        ));
    }
    (checks, Vec::new())
}

/// Equations (11) to (19).
pub(super) fn transfer(effort: Effort) -> Proof {
    let mut random = Random::new(11);
    let (mut series, mut mapping, mut general) = (0.0f64, 0.0f64, 0.0f64);
    let (mut printed, mut numerators) = (0.0f64, 0.0f64);
    for _ in 0..effort.of(20, 200) {
        let (mass, dt) = (random.spread(0.1, 1e4), random.spread(1e-3, 0.1));
        let (omega, ratio) = (random.between(0.05, 1.9), random.between(0.0, 0.3));
        let lambda = random.spread(1.0, 100.0);
        let alpha = spectral::alpha(omega, ratio, lambda);
        let transfer = Transfer::new(mass, omega, ratio, dt, alpha, alpha);
        let given = transfer.impulse_response(200);
        let size = given.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let found = impulse(mass, omega, ratio, dt, lambda, given.len());
        for (a, b) in given.iter().zip(&found) {
            series = worse(series, (a - b).abs() / size);
        }
        // Any α1 and α2: (12) and (17) are one polynomial.
        let (alpha_1, alpha_2) = (random.between(0.1, 1.0), random.between(0.1, 1.0));
        let [a2, a1, a0] = Transfer::new(mass, omega, ratio, dt, alpha_1, alpha_2).denominator;
        let (matrix, _) = spectral::amplification(mass, omega, ratio, dt, alpha_1, alpha_2);
        mapping = worse(mapping, apart(-matrix.trace(), a1 / a2));
        mapping = worse(mapping, apart(matrix.determinant(), a0 / a2));
        printed = worse(printed, amplified(mass, omega, ratio, dt, lambda));
        numerators = worse(numerators, against_newmark(mass, omega, ratio, dt));
        general = worse(general, many_dofs(&mut random, dt, lambda));
    }
    let checks = vec![
        Check::within(
            "(11): impulse response of G(z) − that of the program's step",
            "equal",
            series,
            1e-9,
        ),
        Check::within(
            "(12) and (17): pole mapping − eigenvalue mapping, any α1 and α2",
            "identical polynomials",
            mapping,
            1e-12,
        ),
        Check::within(
            "(14) to (16): A X + B F as printed − one step of the program, any state and force",
            "equal",
            printed,
            1e-12,
        ),
        Check::within(
            "the same poles with other numerators: x of Newmark = β x⁺ + (1 − 2β) x + β x⁻ of the family, β = 1/λ",
            "same numerical properties",
            numerators,
            1e-9,
        ),
        Check::within(
            "(18), (19): α as printed, with its inverse − the program's one solve, random full M, C, K",
            "equal",
            general,
            1e-10,
        ),
        Check::note(
            "numerical properties of Newmark's family",
            "same poles",
            "same poles, not the same response".to_owned(),
            "the numerators differ as above: in a forced response the two agree to about β (ω̄Δt)², not to roundoff",
        ),
        Check::note(
            "remark after (17)",
            "(17) is identical to the characteristic equation of (11)",
            "to (12)".to_owned(),
            "(11) is the transfer function; its characteristic equation has the number (12)",
        ),
    ];
    (checks, Vec::new())
}

/// x of the program's step after a unit force at step 0.
fn impulse(mass: f64, omega: f64, ratio: f64, dt: f64, lambda: f64, points: usize) -> Vec<f64> {
    let natural = omega / dt;
    let (c, k) = (2.0 * ratio * natural * mass, natural * natural * mass);
    let Some(mut gui) = oscillator((mass, c, k), dt, lambda, Start::Published) else {
        return vec![f64::NAN; points];
    };
    let mut state = State::at_rest(1);
    let mut found = Vec::with_capacity(points);
    for step in 0..points {
        found.push(state.disp[0]);
        let force = if step == 0 { 1.0 } else { 0.0 };
        let r = [force - c * state.vel[0] - k * state.disp[0]];
        gui.advance(&mut state, &r, &mut [0.0]);
    }
    found
}

/// Deviation of A X + B F with (16) from one step of the program.
fn amplified(mass: f64, omega: f64, ratio: f64, dt: f64, lambda: f64) -> f64 {
    let alpha = spectral::alpha(omega, ratio, lambda);
    let (a, b) = spectral::amplification(mass, omega, ratio, dt, alpha, alpha);
    let natural = omega / dt;
    let (c, k) = (2.0 * ratio * natural * mass, natural * natural * mass);
    let (x, v, force) = (0.3, -0.7 * natural, 0.4 * k);
    let wanted = a * nalgebra::Vector2::new(x, v) + b * force;
    let Some(mut gui) = oscillator((mass, c, k), dt, lambda, Start::Published) else {
        return f64::NAN;
    };
    let mut state = State::new(vec![x], vec![v]);
    gui.advance(&mut state, &[force - c * v - k * x], &mut [0.0]);
    // Displacement is of size 1, velocity of size ω.
    worse(
        (state.disp[0] - wanted[0]).abs(),
        (state.vel[0] - wanted[1]).abs() / natural,
    )
}

/// Deviation of Newmark's response to a single impulse from the three-point mean of the family's, over its peak.
fn against_newmark(mass: f64, omega: f64, ratio: f64, dt: f64) -> f64 {
    const STEPS: usize = 120;
    let natural = omega / dt;
    let (c, k) = (2.0 * ratio * natural * mass, natural * natural * mass);
    let scalar = |value| SymMatrix::diagonal(&[value]);
    let members = [
        NewmarkBeta::Average,
        NewmarkBeta::Linear,
        NewmarkBeta::Explicit,
    ];
    let mut most = 0.0f64;
    for member in members {
        let beta = member.value();
        let lambda = if beta > 0.0 {
            1.0 / beta
        } else {
            f64::INFINITY
        };
        // The family has its impulse at step 0; Newmark's, at step 1, acts through equilibrium at that step already.
        let family = impulse(mass, omega, ratio, dt, lambda, STEPS + 2);
        let newton = NewtonSettings::default();
        let made = Newmark::new(&scalar(mass), &scalar(c), &scalar(k), dt, member, newton);
        let Ok(mut newmark) = made else {
            return f64::NAN;
        };
        let mut forces = Alone {
            damping: c,
            stiffness: k,
            force: |step| if step == 1.0 { 1.0 } else { 0.0 },
        };
        let mut state = State::at_rest(1);
        newmark.begin(&state, &[0.0]);
        let size = family.iter().fold(0.0f64, |p, x| p.max(x.abs()));
        for step in 1..=STEPS {
            if newmark
                .step(step as u64, &mut state, &mut forces, &mut [0.0])
                .is_err()
            {
                return f64::NAN;
            }
            // x of the family is one step later: index i of Newmark, impulse at 1, is index i − 1 there.
            let of = |i: usize| family.get(i).copied().unwrap_or(0.0);
            let before = if step >= 2 { of(step - 2) } else { 0.0 };
            let wanted = beta * of(step) + (1.0 - 2.0 * beta) * of(step - 1) + beta * before;
            most = worse(most, (state.disp[0] - wanted).abs() / size);
        }
    }
    most
}

/// Largest relative deviation of w = M_eff⁻¹ r from α M⁻¹ r with α as (18) prints it.
fn many_dofs(random: &mut Random, dt: f64, lambda: f64) -> f64 {
    const N: usize = 4;
    let mut positive = |size: f64| {
        let half = DMatrix::from_fn(N, N, |_, _| random.between(-1.0, 1.0));
        (&half * half.transpose() + DMatrix::identity(N, N)) * size
    };
    let (m, c, k) = (positive(1.0), positive(1.0 / dt), positive(1.0 / (dt * dt)));
    let r = DVector::from_fn(N, |i, _| 1.0 + i as f64);
    let printed = (&m * (2.0 * lambda) + &c * (lambda * dt) + &k * (2.0 * dt * dt))
        .try_inverse()
        .map(|inverse| inverse * (2.0 * lambda) * &m);
    let accel = m.clone().try_inverse().map(|inverse| inverse * &r);
    let symmetric = |matrix: &DMatrix<f64>| SymMatrix::from_dense(matrix).ok();
    let made = (|| {
        Gui::new(
            &symmetric(&m)?,
            &symmetric(&c)?,
            &symmetric(&k)?,
            dt,
            Lambda::Finite(lambda),
            Start::Published,
        )
        .ok()
    })();
    let (Some(printed), Some(accel), Some(mut gui)) = (printed, accel, made) else {
        return f64::NAN;
    };
    let wanted = printed * accel;
    let mut state = State::at_rest(N);
    gui.advance(&mut state, &[1.0, 2.0, 3.0, 4.0], &mut [0.0; N]);
    let rows = state.weighted_accel.iter().zip(wanted.iter());
    rows.map(|(found, wanted)| (found - wanted).abs())
        .fold(0.0, worse)
        / wanted.norm()
}
