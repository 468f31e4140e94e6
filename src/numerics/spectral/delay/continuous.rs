//! In continuous time: the frequencies at which the loop gain |L(iω)| is one.
//!
//! L(s) = (k_e + c_e s + m_e s²) bᵀ (s² M + s C + K_n)⁻¹ b. With a realisation (A, B, C, D) of L and R = 1 − D²,
//! |L(iω)| = 1 exactly where iω is an eigenvalue of [[A', B Bᵀ/R], [−Cᵀ C/R, −A'ᵀ]], A' = A + B D C/R, so that no narrow
//! resonance can slip through a grid of frequencies.

use std::f64::consts::PI;

use nalgebra::{Complex, ComplexField as _, DMatrix, DVector};

use super::super::eigenvalues;
use super::{DelayError, Delayed};

/// A delay and the frequency that it makes unstable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Critical {
    /// τ in s.
    pub delay: f64,
    /// ω in rad/s.
    pub omega: f64,
}

/// The smallest delay of a specimen of one axis that is not stable; none if every delay is.
///
/// # Errors
/// [`DelayError::Massless`], [`DelayError::Axes`], [`DelayError::Eigenvalues`].
pub fn continuous(system: &Delayed) -> Result<Option<Critical>, DelayError> {
    let (axes, n) = system.rows.shape();
    if axes != 1 {
        return Err(DelayError::Axes { axes });
    }
    let inverse = system
        .mass
        .clone()
        .cholesky()
        .ok_or(DelayError::Massless)?
        .inverse();
    // Time in units of 1/scale: displacement and velocity of one size.
    let whole =
        &system.stiffness + system.rows.transpose() * &system.specimen_stiffness * &system.rows;
    let scale = (whole.trace().abs() / system.mass.trace()).sqrt();
    if !(scale > 0.0 && scale.is_finite()) {
        return Ok(None);
    }
    let mut a = DMatrix::zeros(2 * n, 2 * n);
    a.view_mut((0, n), (n, n)).fill_with_identity();
    a.view_mut((n, 0), (n, n))
        .copy_from(&(-&inverse * &system.stiffness / (scale * scale)));
    a.view_mut((n, n), (n, n))
        .copy_from(&(-&inverse * &system.damping / scale));
    let row: DVector<f64> = system.rows.row(0).transpose();
    let (stiffness, damping) = (
        system.specimen_stiffness[(0, 0)],
        system.specimen_damping[(0, 0)],
    );
    let inertia = system.specimen_mass * scale * scale;
    // Input and output carry the square root of the gain each, so that the two blocks have one size.
    let gain = stiffness.abs().max(damping.abs() * scale);
    let gain = gain.max(inertia).sqrt() / scale;
    if gain == 0.0 {
        return Ok(None);
    }
    let mut input = DVector::zeros(2 * n);
    input.rows_mut(n, n).copy_from(&(&inverse * &row * gain));
    let mut output = DVector::zeros(2 * n);
    let per_gain = 1.0 / (gain * scale * scale);
    output
        .rows_mut(0, n)
        .copy_from(&(&row * (stiffness * per_gain)));
    output
        .rows_mut(n, n)
        .copy_from(&(&row * (damping * scale * per_gain)));
    let mut through = 0.0;
    if inertia != 0.0 {
        // Acceleration is the lower half of A z + B u.
        output += a.rows(n, n).transpose() * &row * (inertia * per_gain);
        through = inertia * per_gain * row.dot(&input.rows(n, n));
    }
    if through >= 1.0 {
        // At high frequencies the loop gain stays above one: no delay is short enough.
        return Ok(Some(Critical {
            delay: 0.0,
            omega: f64::INFINITY,
        }));
    }
    let rest = 1.0 - through * through;
    a += &input * output.transpose() * (through / rest);

    let mut hamiltonian = DMatrix::zeros(4 * n, 4 * n);
    hamiltonian.view_mut((0, 0), (2 * n, 2 * n)).copy_from(&a);
    hamiltonian
        .view_mut((0, 2 * n), (2 * n, 2 * n))
        .copy_from(&(&input * input.transpose() / rest));
    hamiltonian
        .view_mut((2 * n, 0), (2 * n, 2 * n))
        .copy_from(&(-&output * output.transpose() / rest));
    hamiltonian
        .view_mut((2 * n, 2 * n), (2 * n, 2 * n))
        .copy_from(&(-a.transpose()));
    let all = eigenvalues(&hamiltonian).ok_or(DelayError::Eigenvalues)?;
    let largest = all.iter().map(|z| z.modulus()).fold(0.0, f64::max);
    let mut best: Option<Critical> = None;
    for z in all.iter().filter(|z| z.im > 1e-9 * largest) {
        // Eigenvalues that nearly touch the axis carry √ε: the gain itself decides.
        if z.re.abs() > 1e-5 * largest {
            continue;
        }
        let Some((omega, loop_gain)) = refine(system, z.im * scale) else {
            continue;
        };
        // A lag stays below half a turn; at half a turn, without damping, its sign is roundoff.
        let angle = loop_gain.argument();
        let angle = if angle > PI - 1e-6 {
            angle - 2.0 * PI
        } else {
            angle
        };
        let delay = ((PI + angle) / omega).max(0.0);
        if best.is_none_or(|found| delay < found.delay) {
            best = Some(Critical { delay, omega });
        }
    }
    Ok(best)
}

/// L(iω); none where the matrix is singular.
fn loop_gain(system: &Delayed, omega: f64) -> Option<Complex<f64>> {
    let n = system.mass.nrows();
    let dynamic = DMatrix::from_fn(n, n, |i, j| {
        Complex::new(
            system.stiffness[(i, j)] - omega * omega * system.mass[(i, j)],
            omega * system.damping[(i, j)],
        )
    });
    let row = DVector::from_fn(n, |i, _| Complex::new(system.rows[(0, i)], 0.0));
    let moved = dynamic.lu().solve(&row)?;
    let specimen = Complex::new(
        system.specimen_stiffness[(0, 0)] - omega * omega * system.specimen_mass,
        omega * system.specimen_damping[(0, 0)],
    );
    Some(specimen * row.dot(&moved))
}

/// Newton on ln|L| from a frequency at which it is nearly zero; none if it is not a crossing after all.
fn refine(system: &Delayed, start: f64) -> Option<(f64, Complex<f64>)> {
    let mut omega = start;
    for _ in 0..30 {
        let gain = loop_gain(system, omega)?;
        let value = libm::log(gain.modulus());
        if value.abs() < 1e-13 {
            return Some((omega, gain));
        }
        let h = 1e-6 * omega;
        let (up, down) = (loop_gain(system, omega + h)?, loop_gain(system, omega - h)?);
        let slope = (libm::log(up.modulus()) - libm::log(down.modulus())) / (2.0 * h);
        let change = -value / slope;
        if !(change.is_finite() && change.abs() < 0.1 * omega) {
            break;
        }
        omega += change;
        if change.abs() < 1e-14 * omega {
            break;
        }
    }
    let gain = loop_gain(system, omega)?;
    let is_crossing = (gain.modulus() - 1.0).abs() < 1e-6 && (omega / start - 1.0).abs() < 0.05;
    is_crossing.then_some((omega, gain))
}
