//! The exact audit of the steps: `½ Δ(vᵀ M_eff v) = Σ ½ (x[i+1] − x[i−1])ᵀ r[i]`, for any law and any λ (guide:
//! mathematics-errors).
//!
//! Left and right are made of different numbers: velocities and M_eff as it was before it was factored, against
//! displacements and forces. Their difference is roundoff as long as every step was made with the forces that it closed
//! with and no state was changed between two steps. It audits this program, not a specimen. Real-time after `new`.

use gusset_numerics::linalg::{Condensation, SymMatrix};
use gusset_quantity::state;

/// Displacement over its size that counts as roundoff: a structure that stands under a load moves by as much.
const ROUNDOFF: f64 = 64.0 * f64::EPSILON;

/// Roundings of x[i+1] − x[i−1] in parts of x.
const LAST_BIT: f64 = 4.0 * f64::EPSILON;

/// The audit of one run, begun by its first step.
#[derive(Debug)]
pub struct StepAudit {
    effective_mass: SymMatrix,
    /// Degrees of freedom without mass, which do not follow the method: in the sums they stand where M_eff holds them.
    massless: Option<Condensation>,
    now: [Vec<f64>; 2],
    /// Energy of a motion by roundoff in a step, J per m² of displacement.
    roundoff: Vec<f64>,
    /// `x[i−1]` and `x[i]`.
    older: Vec<f64>,
    newer: Vec<f64>,
    begun: bool,
    /// ½ vᵀ M_eff v after the last step, J.
    energy: f64,
    /// What roundoff alone leaves over, J.
    forgiven: f64,
    /// Sum of what is left over, and of the sizes of what was added; largest energy. J.
    residual: f64,
    turnover: f64,
    largest: f64,
}

state! {
    StepAudit as "audit" { older, newer, begun, energy, forgiven, residual, turnover, largest }
    keeps { effective_mass, massless, now, roundoff }
}

impl StepAudit {
    /// For this M_eff = M + (Δt/2) C0 + (Δt²/λ) K0, the degrees of freedom without mass, and this Δt in s.
    #[must_use]
    pub fn new(effective_mass: SymMatrix, massless: &[usize], dt: f64) -> Self {
        let n = effective_mass.n();
        let per_s = ROUNDOFF / dt;
        let of_disp = |dof| effective_mass.get(dof, dof) * per_s * per_s;
        let roundoff = (0..n).map(of_disp).collect();
        Self {
            massless: (!massless.is_empty())
                .then(|| Condensation::new(&effective_mass, massless).ok())
                .flatten(),
            now: [vec![0.0; n], vec![0.0; n]],
            effective_mass,
            roundoff,
            older: vec![0.0; n],
            newer: vec![0.0; n],
            begun: false,
            energy: 0.0,
            forgiven: 0.0,
            residual: 0.0,
            turnover: 0.0,
            largest: 0.0,
        }
    }

    /// The state that a step is about to be made from. Real-time: yes.
    #[inline]
    pub fn before(&mut self, disp: &[f64]) {
        if !self.begun {
            self.newer.copy_from_slice(disp);
            if let Some(massless) = &mut self.massless {
                massless.follow(&mut self.newer);
            }
        }
    }

    /// The state that the step has led to, and r of the state before it. The first step only begins the audit: its
    /// velocity depends on the start that was chosen. Real-time: yes.
    #[inline]
    pub fn after(&mut self, disp: &[f64], vel: &[f64], residual: &[f64]) {
        let [now_disp, now_vel] = &mut self.now;
        let (disp, vel) = match &mut self.massless {
            None => (disp, vel),
            Some(massless) => {
                now_disp.copy_from_slice(disp);
                now_vel.copy_from_slice(vel);
                massless.follow(now_disp);
                massless.follow(now_vel);
                (&now_disp[..], &now_vel[..])
            }
        };
        let energy = 0.5 * self.effective_mass.quadratic(vel);
        let (mut work, mut roundoff, mut forgiven) = (0.0, 0.0, 0.0);
        let ends = disp.iter().zip(&mut self.older).zip(residual);
        for (((x, old), r), per_m2) in ends.zip(&self.roundoff) {
            work += 0.5 * (x - *old) * r;
            roundoff += per_m2 * x * x;
            // The last bit of a displacement, which a structure near rest does not outrun, does this much work.
            forgiven += LAST_BIT * (x * r).abs();
            *old = *x;
        }
        std::mem::swap(&mut self.older, &mut self.newer);
        if self.begun {
            self.residual += (energy - self.energy) - work;
            self.turnover += f64::abs(work) + roundoff;
            self.forgiven += forgiven;
        }
        self.begun = true;
        self.energy = energy;
        self.largest = self.largest.max(energy);
    }

    /// What is left over, in parts of all energy that was turned over. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn relative(&self) -> f64 {
        let scale = self.turnover + self.largest;
        let beyond = self.residual.abs() - self.forgiven;
        if scale > 0.0 && beyond <= 0.0 {
            0.0
        } else if scale > 0.0 {
            beyond / scale
        } else {
            // Nothing has moved; NaN stays NaN.
            self.residual.abs()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_numerics::integrate::{Gui, Integrator, Lambda, Start, State};
    use gusset_quantity::state::{Stateful, TestState};

    const DT: f64 = 0.02;

    fn matrices() -> (SymMatrix, SymMatrix, SymMatrix) {
        let mass = SymMatrix::diagonal(&[1e3, 2e3]);
        let entries = nalgebra::DMatrix::from_row_slice(2, 2, &[5e5, -1e5, -1e5, 1e5]);
        let stiffness = SymMatrix::from_dense(&entries).unwrap();
        (mass, stiffness.plus(-0.99, &stiffness), stiffness)
    }

    /// 500 steps under a load, with a force that hardens; `spoil` may change the state or r before a step is made.
    fn audited(start: Start, spoil: impl Fn(usize, &mut State, &mut [f64])) -> f64 {
        let (mass, damping, stiffness) = matrices();
        let lambda = Lambda::Finite(4.0);
        let mut gui = Gui::new(&mass, &damping, &stiffness, DT, lambda, start).unwrap();
        let effective = mass
            .plus(DT / 2.0, &damping)
            .plus(DT * DT / 4.0, &stiffness);
        let mut audit = StepAudit::new(effective, &[], DT);
        let mut state = State::new(vec![0.01, -0.02], vec![0.3, 0.1]);
        let mut reported = [0.0; 2];
        for step in 0..500 {
            let load = 3e3 * libm::sin(0.1 * step as f64);
            let mut r = [load - 1e9 * state.disp[0].powi(3), 2.0 * load];
            stiffness.subtract_product(&state.disp, &mut r);
            damping.subtract_product(&state.vel, &mut r);
            let mut used = r;
            spoil(step, &mut state, &mut used);
            audit.before(&state.disp);
            gui.advance(&mut state, &used, &mut reported);
            audit.after(&state.disp, &state.vel, &r);
        }
        audit.relative()
    }

    #[test]
    fn energy_balance_closes_to_roundoff() {
        for start in [Start::Published, Start::SecondOrder] {
            // Some thousand roundings of energies that are a part of the turnover.
            let found = audited(start, |_, _, _| {});
            assert!(found < 1e-12, "{start:?}: {found:e}");
        }
    }

    #[test]
    fn wrong_forces_and_states_unbalance_energy() {
        // What is left over may be too much or too little.
        for booked in [1.0, -1.0] {
            let force = audited(Start::Published, |step, _, used| {
                if step == 250 {
                    used[1] += booked;
                }
            });
            assert!(force > 1e-8, "1 N of some thousand, once: {force:e}");
        }
        let state = audited(Start::Published, |step, state, _| {
            if step == 250 {
                state.vel[0] *= 1.0 + 1e-4;
            }
        });
        assert!(state > 1e-9, "{state:e}");
        let lost = audited(Start::Published, |_, _, used| used[0] = f64::NAN);
        assert!(lost.is_nan());
    }

    #[test]
    fn restored_audit_has_equal_bits() {
        let mass = SymMatrix::diagonal(&[1e3, 2e3]);
        let step = |audit: &mut StepAudit, k: u32| {
            let at = |phase: f64| [libm::sin(0.1 * f64::from(k) + phase), 0.3 * phase];
            audit.before(&at(0.0));
            audit.after(&at(0.1), &at(1.0), &at(2.0).map(|r| 1e3 * r));
            audit.relative().to_bits()
        };
        for taken in [0, 1, 50] {
            let mut one = StepAudit::new(mass.clone(), &[], DT);
            (0..taken).for_each(|k| {
                step(&mut one, k);
            });
            let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
            let mut other = StepAudit::new(mass.clone(), &[], DT);
            step(&mut other, 7);
            state.restore(|visit| other.visit_state(visit)).unwrap();
            for k in taken..taken + 50 {
                assert_eq!(step(&mut one, k), step(&mut other, k), "{taken} {k}");
            }
        }
    }
}
