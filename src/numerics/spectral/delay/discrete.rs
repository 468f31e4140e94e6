//! In discrete time: the recursion of the family with the command history appended to its state.
//!
//! The achieved displacement is d\[i − q\] and d\[i − q − 1\], weighed by linear interpolation, with τ = (q + φ) Δt. With several
//! ticks a step the interpolation is between the commands of ticks, which are weighted sums of targets, as is their velocity. α
//! follows from the total stiffness and damping, specimen included, as in a test.

use std::cell::RefCell;
use std::collections::HashMap;
use std::f64::consts::PI;

use nalgebra::{Complex, ComplexField as _, DMatrix, DVector};

use super::super::{eigenvalues, unstable_roots};
use super::late::Late;
use super::{DelayError, Delayed};

/// Longest delay in the search, in steps.
pub(crate) const LONGEST_STEPS: usize = 96;
/// Growth per step below which a root counts as lying on the unit circle.
const ROUNDOFF: f64 = 1e-10;
/// Delays at which the eigenvalues confirm what the count of turns has found.
const LOOKS: u32 = 6;

/// Where the recursion becomes unstable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DiscreteLimit {
    /// At this delay in s.
    At(f64),
    /// Not up to this delay in s, the longest in the search.
    Beyond(f64),
}

/// M_eff = M + Δt/2 C0 + Δt² K̃, with the specimen's contribution.
fn effective(system: &Delayed, dt: f64, lambda: f64) -> DMatrix<f64> {
    let total = |own: &DMatrix<f64>, of_specimen: &DMatrix<f64>| {
        own + system.rows.transpose() * of_specimen * &system.rows
    };
    &system.mass
        + total(&system.damping, &system.specimen_damping) * (dt / 2.0)
        + match &system.weighted {
            Some(weighted) => weighted * (dt * dt),
            None => total(&system.stiffness, &system.specimen_stiffness) * (dt * dt / lambda),
        }
}

/// One step of the recursion with a delay of `delay` (s); `lambda` counts where K̃ = K0/λ. State (x, Δt v, d\[i−1\] …, and Δt ḋ\[i−1\] … if the specimen damps).
///
/// # Errors
/// [`DelayError::Massless`] if a row has no mass or M_eff no inverse, [`DelayError::Parameter`].
pub fn recursion(
    system: &Delayed,
    dt: f64,
    lambda: f64,
    delay: f64,
) -> Result<DMatrix<f64>, DelayError> {
    for (name, found) in [("dt", dt), ("lambda", lambda)] {
        if found.is_nan() || found <= 0.0 {
            return Err(DelayError::Parameter { name, found });
        }
    }
    let (axes, n) = system.rows.shape();
    // Without mass a row follows at once in a test, also where a dashpot gives it an entry of M_eff.
    if (0..n).any(|row| system.mass[(row, row)] <= 0.0) {
        return Err(DelayError::Massless);
    }
    let late = Late::of(&system.ticks, delay / dt);
    // Inertia is a second difference.
    let weighs = system.specimen_mass != 0.0;
    let past = late.past() + if weighs { 2 } else { 0 };
    let damps = system.specimen_damping.iter().any(|c| *c != 0.0) && late.slope.is_none();
    let kinds = if damps { 2 } else { 1 };
    let size = 2 * n + kinds * axes * past;
    let factor = effective(system, dt, lambda)
        .cholesky()
        .ok_or(DelayError::Massless)?;

    // Δt² r as rows over the state.
    let mut force = DMatrix::zeros(n, size);
    force
        .view_mut((0, 0), (n, n))
        .copy_from(&(&system.stiffness * (-dt * dt)));
    force
        .view_mut((0, n), (n, n))
        .copy_from(&(&system.damping * -dt));
    let of_specimen = |matrix: &DMatrix<f64>, by: f64| system.rows.transpose() * matrix * -by;
    let inertia = DMatrix::identity(axes, axes) * system.specimen_mass;
    // Kind of the history, steps back, and the force due to the command then.
    let mut parts = Vec::new();
    // The velocity is of the targets, or of those of the integrator.
    let (of_velocity, velocity) = match &late.slope {
        Some(slope) => (0, slope),
        None => (1, &late.disp),
    };
    for (back, (&weight, by_velocity)) in late.disp.iter().zip(velocity).enumerate() {
        parts.push((
            0,
            back,
            of_specimen(&system.specimen_stiffness, weight * dt * dt),
        ));
        parts.push((
            of_velocity,
            back,
            of_specimen(&system.specimen_damping, by_velocity * dt),
        ));
        for (further, second) in [(0, 1.0), (1, -2.0), (2, 1.0)] {
            parts.push((0, back + further, of_specimen(&inertia, weight * second)));
        }
    }
    for (kind, back, force_of_axes) in parts {
        if kind >= kinds || force_of_axes.iter().all(|entry| *entry == 0.0) {
            continue;
        }
        if back == 0 {
            let now = &force_of_axes * &system.rows;
            let mut block = force.view_mut((0, kind * n), (n, n));
            block += now;
        } else {
            let at = 2 * n + kind * axes * past + (back - 1) * axes;
            let mut block = force.view_mut((0, at), (n, axes));
            block += &force_of_axes;
        }
    }
    let gained = factor.solve(&force);
    let mut step = DMatrix::zeros(size, size);
    step.view_mut((n, 0), (n, size)).copy_from(&gained);
    for i in 0..n {
        step[(n + i, n + i)] += 1.0;
    }
    // x⁺ = x + Δt v⁺.
    let vel = step.view((n, 0), (n, size)).into_owned();
    step.view_mut((0, 0), (n, size)).copy_from(&vel);
    for i in 0..n {
        step[(i, i)] += 1.0;
    }
    for kind in 0..kinds {
        let start = 2 * n + kind * axes * past;
        if past > 0 {
            step.view_mut((start, kind * n), (axes, n))
                .copy_from(&system.rows);
        }
        for row in axes..axes * past {
            step[(start + row, start + row - axes)] = 1.0;
        }
    }
    Ok(step)
}

/// The loop of a specimen of one axis on the unit circle.
struct Circle<'a> {
    system: &'a Delayed,
    effective: DMatrix<f64>,
    dt: f64,
    /// bᵀ D⁻¹ b by the bits of the angle: it does not depend on the delay.
    known: RefCell<HashMap<u64, Option<Complex<f64>>>>,
    marks: Vec<(f64, f64)>,
}

/// Smallest angle in the search, in rad.
const SMALLEST: f64 = 1e-6;

impl<'a> Circle<'a> {
    /// `poles` are those of the recursion without delay. A mode of the structure has the angle ω Δt in continuous time only.
    /// The more its pole differs from that, the more likely a mark at ω Δt misses the turn about the pole.
    fn new(system: &'a Delayed, dt: f64, lambda: f64, poles: &[Complex<f64>]) -> Self {
        // Upon the positive real axis the grid itself is fine enough; at zero there is but the history.
        let marked = |pole: &&Complex<f64>| pole.im > 0.0 || (pole.im == 0.0 && pole.re < 0.0);
        let marks = poles.iter().filter(marked);
        Self {
            system,
            effective: effective(system, dt, lambda),
            dt,
            known: RefCell::default(),
            marks: marks
                .map(|pole| (pole.argument(), -libm::log(pole.modulus())))
                .collect(),
        }
    }

    /// True if every pole is known to be inside the circle.
    fn is_damped(&self) -> bool {
        let inside = |(at, width): &(f64, f64)| *width > 1e-7 * at;
        !self.marks.is_empty() && self.marks.iter().all(inside)
    }

    /// bᵀ D⁻¹ b, D = M_eff (z − 1)²/(z Δt²) + C (1 − 1/z)/Δt + K, at the angle θ.
    fn felt(&self, theta: f64) -> Option<Complex<f64>> {
        let make = || {
            let (sine, cosine) = libm::sincos(theta);
            let z = Complex::new(cosine, sine);
            let one = Complex::new(1.0, 0.0);
            // This form of 1 − cos θ loses no digits.
            let half = libm::sin(0.5 * theta);
            let difference = Complex::new(2.0 * half * half, sine);
            let second = Complex::new(-4.0 * half * half, 0.0) / (self.dt * self.dt);
            debug_assert!((difference - (one - z.conj())).modulus() < 1e-12);
            let n = self.system.mass.nrows();
            let matrix = DMatrix::from_fn(n, n, |i, j| {
                second * self.effective[(i, j)]
                    + difference * (self.system.damping[(i, j)] / self.dt)
                    + self.system.stiffness[(i, j)]
            });
            let row = DVector::from_fn(n, |i, _| Complex::new(self.system.rows[(0, i)], 0.0));
            Some(row.dot(&matrix.lu().solve(&row)?))
        };
        let mut known = self.known.borrow_mut();
        *known.entry(theta.to_bits()).or_insert_with(make)
    }

    /// True if a root lies outside the unit circle: 1 + g(z) bᵀ D⁻¹ b, g being the late force by the displacement, over the same
    /// without delay, goes round zero. None where that cannot be followed.
    fn is_unstable(&self, delay: f64) -> Option<bool> {
        let force = |steps: f64| {
            let late = Late::of(&self.system.ticks, steps);
            move |theta: f64| self.late_force(&late, theta)
        };
        let (late, on_time) = (force(delay / self.dt), force(0.0));
        let ratio = |theta: f64| {
            let felt = self.felt(theta)?;
            Some((late(theta) * felt + 1.0) / (on_time(theta) * felt + 1.0))
        };
        let roots = unstable_roots(ratio, SMALLEST, PI, &self.marks)?;
        Some(roots > 0)
    }

    /// The specimen's force by the displacement of its axis at the angle θ.
    fn late_force(&self, late: &Late, theta: f64) -> Complex<f64> {
        let stiffness = self.system.specimen_stiffness[(0, 0)];
        let damping = self.system.specimen_damping[(0, 0)] / self.dt;
        let mass = self.system.specimen_mass / (self.dt * self.dt);
        let half = libm::sin(0.5 * theta);
        let difference = Complex::new(2.0 * half * half, libm::sin(theta));
        let back = Complex::new(1.0, 0.0) - difference;
        // With a long delay all but the last weights are zero.
        let sum = |weights: &[f64]| {
            let none = weights.iter().take_while(|weight| **weight == 0.0).count();
            let weights = weights.get(none..).unwrap_or_default();
            let zero = Complex::new(0.0, 0.0);
            let sum = weights.iter().rev().fold(zero, |sum, w| sum * back + w);
            let (sine, cosine) = libm::sincos(-theta * none as f64);
            Complex::new(cosine, sine) * sum
        };
        let disp = sum(&late.disp);
        match &late.slope {
            None => disp * (difference * difference * mass + difference * damping + stiffness),
            Some(slope) => {
                disp * (difference * difference * mass + stiffness) + sum(slope) * damping
            }
        }
    }
}

/// The smallest delay at which the spectral radius exceeds one. `hint` is a delay near which it is expected; the search
/// is finest up to there.
///
/// # Errors
/// As [`recursion`]; [`DelayError::Unstable`], [`DelayError::Eigenvalues`].
pub fn discrete(
    system: &Delayed,
    dt: f64,
    lambda: f64,
    hint: Option<f64>,
) -> Result<DiscreteLimit, DelayError> {
    let poles_at = |delay: f64| {
        eigenvalues(&recursion(system, dt, lambda, delay)?).ok_or(DelayError::Eigenvalues)
    };
    let radius = |delay: f64| Ok(largest(&poles_at(delay)?));
    let poles = poles_at(0.0)?;
    let at_rest = largest(&poles);
    // A free body has a double root at one, which carries √ε.
    if at_rest > 1.0 + 1e-6 {
        return Err(DelayError::Unstable { radius: at_rest });
    }
    let bound = 1.0 + ROUNDOFF.max(4.0 * (at_rest - 1.0));
    let by_eigenvalues = |delay: f64| Ok::<_, DelayError>(radius(delay)? > bound);
    // Without damping there are poles on the circle itself, and the eigenvalues have to decide.
    let circle = (system.rows.nrows() == 1).then(|| Circle::new(system, dt, lambda, &poles));
    if let Some(circle) = circle.filter(Circle::is_damped) {
        let found = search(dt, hint, |delay| match circle.is_unstable(delay) {
            Some(found) => Ok(found),
            None => by_eigenvalues(delay),
        })?;
        if is_confirmed(found, bound, radius)? {
            return Ok(found);
        }
    }
    search(dt, hint, by_eigenvalues)
}

fn largest(poles: &[Complex<f64>]) -> f64 {
    poles.iter().map(|pole| pole.modulus()).fold(0.0, f64::max)
}

/// True if the spectral radius says the same as the count of turns: within its bound at delays up to the one that was found,
/// and not clearly inside the circle beyond it.
fn is_confirmed(
    found: DiscreteLimit,
    bound: f64,
    radius: impl Fn(f64) -> Result<f64, DelayError>,
) -> Result<bool, DelayError> {
    let (DiscreteLimit::At(limit) | DiscreteLimit::Beyond(limit)) = found;
    for part in 1..=LOOKS {
        let delay = 0.99 * limit * f64::from(part) / f64::from(LOOKS);
        if radius(delay)? > bound {
            return Ok(false);
        }
    }
    match found {
        DiscreteLimit::At(limit) => Ok(radius(1.01 * limit)? > 1.0 - ROUNDOFF),
        DiscreteLimit::Beyond(_) => Ok(true),
    }
}

fn search(
    dt: f64,
    hint: Option<f64>,
    is_unstable: impl Fn(f64) -> Result<bool, DelayError>,
) -> Result<DiscreteLimit, DelayError> {
    let longest = LONGEST_STEPS as f64 * dt;
    let fine = hint
        .map_or(8.0 * dt, |hint| (1.25 * hint).max(dt))
        .min(longest);
    let (mut low, mut delay) = (0.0, 0.0);
    let mut step = (fine / 48.0).max(dt / 4.0).min(fine);
    loop {
        if delay >= longest {
            return Ok(DiscreteLimit::Beyond(longest));
        }
        if delay >= fine {
            step *= 1.25;
        }
        delay = (delay + step).min(longest);
        if is_unstable(delay)? {
            break;
        }
        low = delay;
    }
    let mut high = delay;
    // Without damping no delay is stable: the search for it ends a millionth of a step above zero.
    while high - low > 1e-7 * high && high > 1e-6 * dt {
        let middle = (low + high) / 2.0;
        if is_unstable(middle)? {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(DiscreteLimit::At(high))
}

#[cfg(test)]
mod tests;
