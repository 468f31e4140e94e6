//! KR-α and MKR-α on a linear structure whose stiffness and damping differ from those in the method's parameters.
//!
//! The equations as printed, with A = M + γ Δt C0 + β Δt² K0 and w = A⁻¹ M a:
//!
//! ```text
//! x⁺ = x + Δt v + Δt² (½ + γ) w,   v⁺ = v + Δt w
//! [(1 − α_f) A + (α_f − α_m) M] w⁺ + [α_f A − (α_f − α_m) M] w = (1 − α_f) r⁺ + α_f r,   r = −C v − K x
//! ```

use nalgebra::DMatrix;

use crate::integrate::AlphaWeights;

/// The system that is stepped: matrices n × n in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct AlphaStep {
    /// α_m, α_f, γ, β.
    pub weights: AlphaWeights,
    /// Δt in s.
    pub dt: f64,
    /// M.
    pub mass: DMatrix<f64>,
    /// C0 and K0, of which A is made.
    pub initial: (DMatrix<f64>, DMatrix<f64>),
    /// C and K, of which the forces are.
    pub tangent: (DMatrix<f64>, DMatrix<f64>),
    /// Mass whose inertia is inside the measured forces, by the second difference of the commands, and not in M.
    pub late_mass: Option<DMatrix<f64>>,
}

impl AlphaStep {
    /// One step, for the state (x, Δt v, Δt² w, Δt² N⁻¹ r) with w and r of the step before, and x of the two steps before if inertia
    /// is late; none if N = (1 − α_f) A + (α_f − α_m) M is not positive definite.
    #[must_use]
    pub fn recursion(&self) -> Option<DMatrix<f64>> {
        let n = self.mass.nrows();
        let AlphaWeights {
            alpha_m,
            alpha_f,
            gamma,
            beta,
        } = self.weights;
        let square = self.dt * self.dt;
        let (damping, stiffness) = &self.initial;
        let matrix = &self.mass + damping * (gamma * self.dt) + stiffness * (beta * square);
        let more = &self.mass * (alpha_f - alpha_m);
        let factor = (&matrix * (1.0 - alpha_f) + &more).cholesky()?;
        let (damping, stiffness) = &self.tangent;
        let of_mass = self.late_mass.as_ref();
        let late = of_mass.map_or_else(|| DMatrix::zeros(n, n), |late| factor.solve(late));
        let size = if of_mass.is_some() { 6 * n } else { 4 * n };
        // Δt² N⁻¹ r as rows over the state.
        let mut force = DMatrix::zeros(n, size);
        let mut of = |place: usize, part: &DMatrix<f64>| {
            force.view_mut((0, place * n), (n, n)).copy_from(part);
        };
        of(0, &-(factor.solve(stiffness) * square + &late));
        of(1, &(factor.solve(damping) * -self.dt));
        if of_mass.is_some() {
            of(4, &(&late * 2.0));
            of(5, &-&late);
        }
        let identity = DMatrix::<f64>::identity(n, n);
        let mut next = &force * (1.0 - alpha_f);
        let mut add = |place: usize, part: &DMatrix<f64>| {
            let mut block = next.view_mut((0, place * n), (n, n));
            block += part;
        };
        add(2, &factor.solve(&(more - matrix * alpha_f)));
        add(3, &(&identity * alpha_f));
        let mut step = DMatrix::zeros(size, size);
        let mut rows = |place: usize, part: &DMatrix<f64>| {
            step.view_mut((place * n, 0), (n, size)).copy_from(part);
        };
        let unit = |place: usize| {
            let mut unit = DMatrix::zeros(n, size);
            unit.view_mut((0, place * n), (n, n)).copy_from(&identity);
            unit
        };
        rows(0, &(unit(0) + unit(1) + &next * (0.5 + gamma)));
        rows(1, &(unit(1) + &next));
        rows(2, &next);
        rows(3, &force);
        if of_mass.is_some() {
            rows(4, &unit(0));
            rows(5, &unit(4));
        }
        Some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::{alpha_method, spectral_radius};

    fn one(value: f64) -> DMatrix<f64> {
        DMatrix::from_element(1, 1, value)
    }

    fn radius(step: &AlphaStep) -> f64 {
        spectral_radius(&step.recursion().unwrap()).unwrap()
    }

    #[test]
    fn initial_stiffness_gives_printed_method() {
        for weights in [
            AlphaWeights::kr(0.6),
            AlphaWeights::mkr(0.3),
            AlphaWeights::kr(0.0),
        ]
        .map(Result::unwrap)
        {
            for (omega, ratio) in [(0.3, 0.05), (2.0, 0.02), (40.0, 0.1)] {
                let own = (one(2.0 * ratio * omega), one(omega * omega));
                let step = AlphaStep {
                    weights,
                    dt: 1.0,
                    mass: one(1.0),
                    initial: own.clone(),
                    tangent: own,
                    late_mass: None,
                };
                let printed = alpha_method(weights, omega, ratio);
                let printed = DMatrix::from_fn(3, 3, |i, j| printed[(i, j)]);
                let printed = spectral_radius(&printed).unwrap();
                // Poles that meet carry the square root of roundoff.
                assert!((radius(&step) - printed).abs() < 1e-6, "{omega}");
            }
        }
    }

    #[test]
    fn undamped_method_grows_like_the_family() {
        // S(λ) = 4 M − 4 m + 4 Δt²/λ K0 − Δt² K of one degree of freedom, M = Δt = 1.
        for (weights, lambda) in [(AlphaWeights::kr(1.0), 4.0), (AlphaWeights::mkr(1.0), 2.0)] {
            let weights = weights.unwrap();
            for (initial, late) in [(1.0, 0.0), (30.0, 0.0), (9.0, 0.3)] {
                let bound = 4.0 - 4.0 * late + 4.0 / lambda * initial;
                let step = |share: f64| AlphaStep {
                    weights,
                    dt: 1.0,
                    mass: one(1.0),
                    initial: (one(0.0), one(initial)),
                    tangent: (one(0.0), one(share * bound)),
                    late_mass: (late > 0.0).then(|| one(late)),
                };
                let (below, above) = (radius(&step(0.98)), radius(&step(1.02)));
                assert!(above > 1.01, "{lambda} {initial} {late}: {above}");
                // A mass that is late feeds its own motion, so that it may grow below the sawtooth, too.
                if late == 0.0 {
                    assert!(below < 1.0 + 1e-6, "{lambda} {initial}: {below}");
                }
            }
        }
    }
}
