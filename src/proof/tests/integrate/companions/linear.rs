//! Orders of accuracy, and what they reduce to.

use super::*;

/// log₂ of the error ratios of x and v between Δt and Δt/2, at t = 10.
fn slopes(way: Way) -> (f64, f64) {
    let errors = |steps: usize| {
        let dt = 10.0 / steps as f64;
        let load = |t: f64, out: &mut [f64]| out[0] = libm::sin(t);
        let found = course(way, &mut oscillator(), (dt, steps), State::at_rest(1), load);
        let largest = |of: fn(&Course, usize) -> f64, exact: fn(f64) -> f64| {
            (0..=steps)
                .map(|i| (of(&found, i) - exact(i as f64 * dt)).abs())
                .fold(0.0, f64::max)
        };
        (
            largest(|c, i| c.disp[i][0], |t| exact(t).0),
            largest(|c, i| c.vel[i][0], |t| exact(t).1),
        )
    };
    let (coarse, fine) = (errors(800), errors(1600));
    (libm::log2(coarse.0 / fine.0), libm::log2(coarse.1 / fine.1))
}

#[test]
fn every_method_has_its_stated_order() {
    for way in DIRECT {
        let (disp, vel) = slopes(way);
        assert!(
            (disp - 2.0).abs() < 0.05 && (vel - 2.0).abs() < 0.05,
            "{way:?}: {disp} {vel}"
        );
    }
    for rho in [0.0, 0.5, 0.8, 1.0] {
        for weights in [
            AlphaWeights::kr(rho).unwrap(),
            AlphaWeights::mkr(rho).unwrap(),
        ] {
            for way in [Way::Alpha(weights), Way::AlphaAtState(weights)] {
                // From zero acceleration displacements are of second order, as those of the family are; the velocity
                // belongs to an instant between the steps.
                let (disp, vel) = slopes(way);
                assert!((disp - 2.0).abs() < 0.1, "{way:?}: {disp}");
                assert!(vel > 0.9, "{way:?}: {vel}");
            }
        }
    }
}

#[test]
fn free_vibration_obeys_the_recursion() {
    // A1 x[i+2] + A2 x[i+1] + A3 x[i] = 0, equation (27), with λ = 4, 6, ∞, ∞ and 4.
    for (way, lambda) in DIRECT
        .into_iter()
        .zip([4.0, 6.0, f64::INFINITY, f64::INFINITY, 4.0])
    {
        for omega in [0.3, 1.5] {
            let dt = omega / OMEGA;
            let state = State::new(vec![1.0], vec![-2.0]);
            let found = course(way, &mut oscillator(), (dt, 50), state, |_, f| f[0] = 0.0);
            let added = omega * omega / lambda;
            let a = [
                1.0 + omega * XI + added,
                omega * omega - 2.0 * added - 2.0,
                1.0 - omega * XI + added,
            ];
            for x in found.disp.windows(3) {
                let sum = a[0] * x[2][0] + a[1] * x[1][0] + a[2] * x[0][0];
                // Convergence to 1e-10 of the response, a few steps deep.
                assert!(sum.abs() < 1e-9, "{way:?}, Ω = {omega}: {sum}");
            }
        }
    }
}

fn shake(t: f64, out: &mut [f64]) {
    for (i, f) in out.iter_mut().enumerate() {
        *f = (i + 1) as f64 * libm::sin(5.0 * t);
    }
}

#[test]
fn methods_reduce_to_each_other() {
    let run = |way| course(way, &mut frame(), (0.05, 400), State::at_rest(3), shake);
    let size = distance(&run(Way::Family(4.0)).disp, &vec![vec![0.0; 3]; 401]);
    let kr = |rho| AlphaWeights::kr(rho).unwrap();
    let mkr = |rho| AlphaWeights::mkr(rho).unwrap();
    for (one, other) in [
        (Way::Alpha(kr(1.0)), Way::Family(4.0)),
        (Way::Alpha(mkr(1.0)), Way::Family(2.0)),
        (Way::AlphaAtState(kr(0.6)), Way::Alpha(kr(0.6))),
        (Way::AlphaAtState(mkr(0.0)), Way::Alpha(mkr(0.0))),
        (
            Way::Newmark(NewmarkBeta::Explicit),
            Way::Family(f64::INFINITY),
        ),
        (Way::Central, Way::Newmark(NewmarkBeta::Explicit)),
    ] {
        let apart = distance(&run(one).disp, &run(other).disp);
        // Roundoff of 400 steps; Newton ends within 1e-10 of the response.
        assert!(
            apart < 1e-8 * size,
            "{one:?} and {other:?}: {apart} of {size}"
        );
    }
    // The printed form, with α1 and α3 as dense matrices, against the one solve.
    let weights = kr(0.6);
    let dense = printed(weights, &frame(), 0.05, 400);
    let apart = distance(&run(Way::Alpha(weights)).disp, &dense);
    assert!(apart < 1e-11 * size, "{apart}");
}

/// KR-α as printed, with inverses.
fn printed(weights: AlphaWeights, frame: &Structure, dt: f64, steps: usize) -> Vec<Vec<f64>> {
    use nalgebra::{DMatrix, DVector};
    let (m, c, k) = (
        frame.mass().to_dense(),
        frame.damping().to_dense(),
        frame.stiffness().to_dense(),
    );
    let AlphaWeights {
        alpha_m,
        alpha_f,
        gamma,
        beta,
    } = weights;
    let inverse = (&m + &c * (gamma * dt) + &k * (beta * dt * dt))
        .try_inverse()
        .unwrap();
    let alpha_1 = &inverse * &m;
    let alpha_3 =
        &inverse * (&m * alpha_m + &c * (alpha_f * gamma * dt) + &k * (alpha_f * beta * dt * dt));
    let rest = (&m * (DMatrix::identity(3, 3) - &alpha_3))
        .try_inverse()
        .unwrap();
    let force = |step: usize| {
        let mut f = [0.0; 3];
        shake(step as f64 * dt, &mut f);
        DVector::from_row_slice(&f)
    };
    let (mut x, mut v) = (DVector::zeros(3), DVector::zeros(3));
    let mut r = force(0) - &c * &v - &k * &x;
    let mut a = m.clone().try_inverse().unwrap() * &r;
    let mut disps = Vec::new();
    for step in 0..=steps {
        disps.push(x.as_slice().to_vec());
        let gained = &alpha_1 * &a;
        x += &v * dt + &gained * ((0.5 + gamma) * dt * dt);
        v += gained * dt;
        let next = force(step + 1) - &c * &v - &k * &x;
        a = &rest * (&next * (1.0 - alpha_f) + &r * alpha_f - &m * (&alpha_3 * &a));
        r = next;
    }
    disps
}
