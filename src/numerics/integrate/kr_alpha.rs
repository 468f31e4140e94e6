//! KR-α (Kolay and Ricles, EESD 43:1361, 2014) and MKR-α (J. Earthq. Eng. 23:771, 2019): explicit, with numerical damping
//! of high frequencies set by ρ, the spectral radius there.
//!
//! As printed, with A = M + γ Δt C0 + β Δt² K0:
//!
//! ```text
//! α1 = A⁻¹ M,   α2 = (½ + γ) α1,   α3 = A⁻¹ (α_m M + α_f γ Δt C0 + α_f β Δt² K0)
//! v⁺ = v + Δt α1 a,   x⁺ = x + Δt v + Δt² α2 a
//! M [(I − α3) a⁺ + α3 a] = (1 − α_f) r⁺ + α_f r,   r = F − R_d(v) − R_s(x)
//! ```
//!
//! Since α3 = α_f I − (α_f − α_m) α1, all of it runs on w = α1 a = A⁻¹ M a with one factor,
//! N = (1 − α_f) A + (α_f − α_m) M, as sparse as A:
//!
//! ```text
//! N w⁺ = (1 − α_f) r⁺ + α_f r − α_f A w + (α_f − α_m) M w
//! ```
//!
//! No inverse is formed, M is not divided by, and a step is one solve. [`KrAlpha`] weighs forces, as above, and may
//! command a specimen. [`KrAlphaAtState`] evaluates R at the weighted state instead, as open-source finite-element
//! programs do: the same for linear systems; the state where forces are evaluated is not the one that is reported.

use super::gui::check;
use super::offline::{Forces, MethodError, Moment, Offline, StepError};
use super::{Integrator, State};
use crate::linalg::{Spd, SymMatrix};
use gusset_quantity::domain::{OutOfDomain, inside};
use gusset_quantity::state;

/// α_m, α_f, γ, β of one method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlphaWeights {
    /// Weight of the old inertia.
    pub alpha_m: f64,
    /// Weight of the old forces.
    pub alpha_f: f64,
    /// γ.
    pub gamma: f64,
    /// β.
    pub beta: f64,
}

impl AlphaWeights {
    /// KR-α with the spectral radius ρ at infinite frequency; ρ = 1 is λ = 4 for linear systems.
    ///
    /// # Errors
    /// ρ outside of 0 to 1.
    pub fn kr(rho: f64) -> Result<Self, OutOfDomain> {
        let rho = check_rho(rho)?;
        let alpha_f = rho / (rho + 1.0);
        let alpha_m = (2.0 * rho - 1.0) / (rho + 1.0);
        let gamma = 0.5 - alpha_m + alpha_f;
        let root = 0.5 + gamma;
        Ok(Self {
            alpha_m,
            alpha_f,
            gamma,
            beta: root * root / 4.0,
        })
    }

    /// MKR-α with ρ∞*; ρ = 1 is λ = 2 for linear systems.
    ///
    /// # Errors
    /// ρ outside of 0 to 1.
    pub fn mkr(rho: f64) -> Result<Self, OutOfDomain> {
        let rho = check_rho(rho)?;
        let (square, cube) = (rho * rho, rho * rho * rho);
        let alpha_f = rho / (rho + 1.0);
        let alpha_m = (2.0 * cube + square - 1.0) / (cube + square + rho + 1.0);
        let gamma = 0.5 - alpha_m + alpha_f;
        Ok(Self {
            alpha_m,
            alpha_f,
            gamma,
            beta: (0.5 + gamma) / 2.0,
        })
    }
}

fn check_rho(rho: f64) -> Result<f64, OutOfDomain> {
    let is_inside = (0.0..=1.0).contains(&rho);
    inside("rho_infinity", rho, is_inside, "from 0 to 1")
}

/// Factors and products that both weightings share.
#[derive(Debug)]
struct Operators {
    dt: f64,
    weights: AlphaWeights,
    mass: SymMatrix,
    /// A.
    matrix: SymMatrix,
    /// Factor of A, for the first step.
    start: Spd,
    /// Factor of N.
    factor: Spd,
    /// The smaller 1/κ of both.
    reciprocal_condition: f64,
    work: Vec<f64>,
    scaled: Vec<f64>,
}

impl Operators {
    fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        weights: AlphaWeights,
    ) -> Result<Self, MethodError> {
        check(mass, damping, stiffness, dt)?;
        let AlphaWeights {
            alpha_m,
            alpha_f,
            gamma,
            beta,
        } = weights;
        let matrix = mass
            .plus(gamma * dt, damping)
            .plus(beta * dt * dt, stiffness);
        let factored = |matrix: &SymMatrix| {
            let factor = Spd::factor(matrix).map_err(|source| MethodError::Factor {
                what: "the effective mass M + γ Δt C0 + β Δt² K0",
                source,
            });
            factor.map(|mut factor| {
                let condition = factor.reciprocal_condition(matrix);
                (factor, condition)
            })
        };
        let combined = SymMatrix::zeros(mass.n())
            .plus(1.0 - alpha_f, &matrix)
            .plus(alpha_f - alpha_m, mass);
        let ((start, of_start), (factor, of_factor)) = (factored(&matrix)?, factored(&combined)?);
        Ok(Self {
            dt,
            weights,
            mass: mass.clone(),
            start,
            factor,
            reciprocal_condition: of_start.min(of_factor),
            matrix,
            work: vec![0.0; mass.n()],
            scaled: vec![0.0; mass.n()],
        })
    }

    /// w ← the next w, from `work` = (1 − α_f) r⁺ + α_f r. Real-time: yes.
    fn next(&mut self, w: &mut [f64]) {
        let AlphaWeights {
            alpha_m, alpha_f, ..
        } = self.weights;
        // Products subtract and want their factor on the vector.
        for (matrix, factor) in [(&self.matrix, alpha_f), (&self.mass, alpha_m - alpha_f)] {
            for (scaled, w) in self.scaled.iter_mut().zip(w.iter()) {
                *scaled = factor * w;
            }
            matrix.subtract_product(&self.scaled, &mut self.work);
        }
        self.factor.solve_in_place(&mut self.work);
        w.copy_from_slice(&self.work);
    }

    /// x and v of the next step. Real-time: yes.
    fn advance(&self, disp: &mut [f64], vel: &mut [f64], w: &[f64]) {
        let dt = self.dt;
        let ahead = dt * dt * (0.5 + self.weights.gamma);
        for ((x, v), w) in disp.iter_mut().zip(vel).zip(w) {
            *x += dt * *v + ahead * w;
            *v += dt * w;
        }
    }
}

/// KR-α or MKR-α with weighted forces, ready to step.
#[derive(Debug)]
pub struct KrAlpha(Operators);

impl KrAlpha {
    /// `damping` and `stiffness` are C0 and K0, specimens' estimates included.
    ///
    /// # Errors
    /// See [`MethodError`].
    pub fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        weights: AlphaWeights,
    ) -> Result<Self, MethodError> {
        Operators::new(mass, damping, stiffness, dt, weights).map(Self)
    }

    /// 1/κ of the factored matrix, see [`Spd::reciprocal_condition`].
    #[must_use]
    pub const fn reciprocal_condition(&self) -> f64 {
        self.0.reciprocal_condition
    }
}

impl Integrator for KrAlpha {
    fn dt(&self) -> f64 {
        self.0.dt
    }

    fn prepare(&self, state: &mut State) {
        state.memory.resize(self.0.mass.n(), 0.0);
    }

    fn advance(&mut self, state: &mut State, residual: &[f64], reported_vel: &mut [f64]) {
        let State {
            disp,
            vel,
            weighted_accel,
            begun,
            memory,
        } = state;
        let operators = &mut self.0;
        if *begun && memory.len() == residual.len() {
            let old = operators.weights.alpha_f;
            let rows = residual.iter().zip(memory.iter());
            for (work, (new, before)) in operators.work.iter_mut().zip(rows) {
                *work = (1.0 - old) * new + old * before;
            }
            operators.next(weighted_accel);
        } else {
            // M a = r: w = A⁻¹ r. No room is needed if the state was prepared.
            memory.resize(residual.len(), 0.0);
            weighted_accel.copy_from_slice(residual);
            operators.start.solve_in_place(weighted_accel);
        }
        memory.copy_from_slice(residual);
        reported_vel.copy_from_slice(vel);
        operators.advance(disp, vel, weighted_accel);
        *begun = true;
    }
}

/// KR-α or MKR-α with forces at the weighted state, for comparison with programs that do it so.
#[derive(Debug)]
pub struct KrAlphaAtState {
    operators: Operators,
    accel: Vec<f64>,
    disp: Vec<f64>,
    vel: Vec<f64>,
}

state! { KrAlphaAtState as "kr_alpha_at_state" { accel } keeps { operators, disp, vel } }

impl KrAlphaAtState {
    /// `damping` and `stiffness` are C0 and K0.
    ///
    /// # Errors
    /// See [`MethodError`].
    pub fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        weights: AlphaWeights,
    ) -> Result<Self, MethodError> {
        let n = mass.n();
        Ok(Self {
            operators: Operators::new(mass, damping, stiffness, dt, weights)?,
            accel: vec![0.0; n],
            disp: vec![0.0; n],
            vel: vec![0.0; n],
        })
    }
}

impl Offline for KrAlphaAtState {
    fn dt(&self) -> f64 {
        self.operators.dt
    }

    fn has_own_accel(&self) -> bool {
        true
    }

    fn begin(&mut self, _state: &State, residual: &[f64]) {
        self.accel.copy_from_slice(residual);
        self.operators.start.solve_in_place(&mut self.accel);
    }

    fn step(
        &mut self,
        to: u64,
        state: &mut State,
        forces: &mut dyn Forces,
        inertia: &mut [f64],
    ) -> Result<(), StepError> {
        let Self {
            operators,
            accel: w,
            disp,
            vel,
        } = self;
        let old = operators.weights.alpha_f;
        disp.copy_from_slice(&state.disp);
        vel.copy_from_slice(&state.vel);
        operators.advance(&mut state.disp, &mut state.vel, w);
        let weigh = |before: &mut [f64], now: &[f64]| {
            for (before, now) in before.iter_mut().zip(now) {
                *before = (1.0 - old) * now + old * *before;
            }
        };
        weigh(disp, &state.disp);
        weigh(vel, &state.vel);
        let at = Moment {
            step: to,
            back: old,
        };
        forces.residual_into(at, disp, vel, operators.dt, &mut operators.work);
        forces.commit();
        operators.next(w);
        state.begun = true;
        // M a = A w.
        inertia.fill(0.0);
        operators.matrix.subtract_product(w, inertia);
        for minus in inertia {
            *minus = -*minus;
        }
        Ok(())
    }
}
