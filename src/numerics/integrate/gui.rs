//! The Gui-λ family: Gui, Wang, Jin, Chen, Zhou (2014), Development of a family of explicit algorithms for
//! structural dynamics with unconditional stability.
//!
//! With α₁ = α₂ = α, equations (2), (3) and (18), (19) become one solve with
//! M_eff = M + (Δt/2) C0 + (Δt²/λ) K0, factored once:
//!
//! ```text
//! w[n]   = M_eff⁻¹ r[n]          (= α a[n])
//! v[n+1] = v[n] + Δt w[n]
//! x[n+1] = x[n] + Δt v[n+1]
//! ```
//!
//! α and inverses are never formed, so the factor is as sparse as M + C0 + K0 and massless degrees of freedom work.
//! `gusset_proof` checks whether the chosen λ is stable.

use std::ops::Range;

use thiserror::Error;

use super::{Integrator, Lambda, LambdaError, RowForces, Start, State, fill_all};
use crate::linalg::lanes::{Isa, Kernel};
use crate::linalg::{Aligned, Lanes, NotPositiveDefinite, Rows, Spd, Storage, SymMatrix};

/// Reason why there is no integrator.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum GuiError {
    /// Δt is not a positive number.
    #[error("the step is {found} s, but must be finite and greater than 0")]
    Step {
        /// The value given.
        found: f64,
    },
    /// λ is not a positive number.
    #[error(transparent)]
    Lambda(#[from] LambdaError),
    /// M, C0 and K0 differ in size.
    #[error(
        "mass has {mass} degrees of freedom, damping {damping} and stiffness {stiffness}, but all must agree"
    )]
    Sizes {
        /// Rows of M.
        mass: usize,
        /// Rows of C0.
        damping: usize,
        /// Rows of K0.
        stiffness: usize,
    },
    /// M_eff has a pivot that is not positive: a massless degree of freedom that nothing holds, or a wrong sign.
    #[error("the effective mass M + (Δt/2) C0 + (Δt²/λ) K0 is {0}")]
    EffectiveMass(NotPositiveDefinite),
}

/// Checks what all methods share.
pub(super) fn check(
    mass: &SymMatrix,
    damping: &SymMatrix,
    stiffness: &SymMatrix,
    dt: f64,
) -> Result<(), GuiError> {
    if !(dt > 0.0 && dt.is_finite()) {
        return Err(GuiError::Step { found: dt });
    }
    if mass.n() != damping.n() || mass.n() != stiffness.n() {
        return Err(GuiError::Sizes {
            mass: mass.n(),
            damping: damping.n(),
            stiffness: stiffness.n(),
        });
    }
    Ok(())
}

/// One member of the family, ready to step.
#[derive(Debug)]
pub struct Gui {
    dt: f64,
    start: Start,
    effective_mass: Spd,
    reciprocal_condition: f64,
    lanes: Lanes,
}

impl Gui {
    /// Factors M_eff. `damping` and `stiffness` are C0 and K0, specimens' estimates included.
    ///
    /// # Errors
    /// See [`GuiError`].
    pub fn new(
        mass: &SymMatrix,
        damping: &SymMatrix,
        stiffness: &SymMatrix,
        dt: f64,
        lambda: Lambda,
        start: Start,
    ) -> Result<Self, GuiError> {
        check(mass, damping, stiffness, dt)?;
        let lambda = Lambda::new(lambda.value())?;
        let matrix = effective_mass(mass, damping, stiffness, dt, lambda);
        let mut effective_mass = Spd::factor(&matrix).map_err(GuiError::EffectiveMass)?;
        let reciprocal_condition = effective_mass.reciprocal_condition(&matrix);
        Ok(Self {
            dt,
            start,
            effective_mass,
            reciprocal_condition,
            lanes: Lanes::best_for(mass.n()),
        })
    }

    /// 1/κ of M_eff, see [`Spd::reciprocal_condition`].
    #[must_use]
    pub const fn reciprocal_condition(&self) -> f64 {
        self.reciprocal_condition
    }

    /// Chooses the instructions of block arithmetic, for comparisons; see [`Spd::set_lanes`].
    #[cfg(any(test, feature = "test-doubles"))]
    pub fn set_lanes(&mut self, lanes: Lanes) {
        self.lanes = lanes;
        self.effective_mass.set_lanes(lanes);
    }

    /// How M_eff is stored.
    #[must_use]
    pub fn storage(&self) -> Storage {
        self.effective_mass.storage()
    }
}

/// M_eff = M + (Δt/2) C0 + (Δt²/λ) K0; the last term is absent for λ = ∞.
pub(super) fn effective_mass(
    mass: &SymMatrix,
    damping: &SymMatrix,
    stiffness: &SymMatrix,
    dt: f64,
    lambda: Lambda,
) -> SymMatrix {
    let with_damping = mass.plus(dt / 2.0, damping);
    match lambda {
        Lambda::Finite(value) => with_damping.plus(dt * dt / value, stiffness),
        Lambda::Infinite => with_damping,
    }
}

impl Integrator for Gui {
    fn dt(&self) -> f64 {
        self.dt
    }

    fn advance(&mut self, state: &mut State, residual: &[f64], reported_vel: &mut [f64]) {
        let State {
            disp,
            vel,
            weighted_accel,
            begun,
            memory: _,
        } = state;
        debug_assert_eq!(residual.len(), self.effective_mass.n());
        debug_assert_eq!((disp.len(), vel.len()), (residual.len(), residual.len()));
        let (pace, lanes) = (self.pace(*begun), self.lanes);
        let go_on = |rows: Range<usize>, weighted_accel: &[f64]| {
            if let (Some(disp), Some(vel), Some(reported)) = (
                disp.get_mut(rows.clone()),
                vel.get_mut(rows.clone()),
                reported_vel.get_mut(rows),
            ) {
                lanes.run(Move {
                    disp,
                    vel,
                    reported,
                    weighted_accel,
                    pace,
                });
            } else {
                disp.fill(f64::NAN);
            }
        };
        // Rows are moved while the solve still has them at hand.
        self.effective_mass
            .solve_into(residual, weighted_accel, go_on);
        *begun = true;
    }

    fn step(
        &mut self,
        state: &mut State,
        forces: &mut dyn RowForces,
        residual: &mut [f64],
        reported_vel: &mut Aligned,
    ) {
        let pace = self.pace(state.begun);
        // Rows are moved one block after their forces are made.
        let near = forces.reach() <= self.effective_mass.rows_at_a_time();
        if !(near && pace.lead == 0.0 && reported_vel.len() == state.vel.len()) {
            fill_all(forces, &state.disp, &state.vel, residual);
            self.advance(state, residual, reported_vel);
            return;
        }
        self.effective_mass.solve_rows(&mut Moving {
            disp: &mut state.disp,
            vel: &state.vel,
            next_vel: reported_vel,
            weighted_accel: &mut state.weighted_accel,
            residual,
            forces,
            pace,
            lanes: self.lanes,
        });
        // The velocity to report is the one that the step was made from.
        std::mem::swap(&mut state.vel, reported_vel);
        state.begun = true;
    }
}

impl Gui {
    fn pace(&self, begun: bool) -> Pace {
        let dt = self.dt;
        let (lead, gain) = match (self.start, begun) {
            (Start::Published, _) => (0.0, dt),
            (Start::SecondOrder, false) => (0.0, dt / 2.0),
            (Start::SecondOrder, true) => (dt / 2.0, dt),
        };
        Pace { dt, lead, gain }
    }
}

/// Δt; velocity reported for n: v\[n\] + lead · w\[n\]; velocity gained on the way to n + 1: gain · w\[n\].
#[derive(Debug, Clone, Copy)]
struct Pace {
    dt: f64,
    lead: f64,
    gain: f64,
}

/// A step whose forces are made, solved for and moved some rows at a time: these rows cross the caches once.
struct Moving<'a> {
    disp: &'a mut [f64],
    vel: &'a [f64],
    next_vel: &'a mut [f64],
    weighted_accel: &'a mut [f64],
    residual: &'a mut [f64],
    forces: &'a mut dyn RowForces,
    pace: Pace,
    lanes: Lanes,
}

impl Rows for Moving<'_> {
    fn rhs(&mut self, rows: Range<usize>) -> &[f64] {
        self.forces
            .fill(rows.clone(), self.disp, self.vel, self.residual);
        self.residual.get(rows).unwrap_or_default()
    }

    fn solution(&mut self, rows: Range<usize>) -> &mut [f64] {
        self.weighted_accel.get_mut(rows).unwrap_or_default()
    }

    fn solved(&mut self, rows: Range<usize>) {
        if let (Some(disp), Some(vel), Some(next_vel), Some(weighted_accel)) = (
            self.disp.get_mut(rows.clone()),
            self.vel.get(rows.clone()),
            self.next_vel.get_mut(rows.clone()),
            self.weighted_accel.get(rows),
        ) {
            self.lanes.run(MoveOver {
                disp,
                vel,
                next_vel,
                weighted_accel,
                pace: self.pace,
            });
        } else {
            self.disp.fill(f64::NAN);
        }
    }

    fn start(&mut self, n: usize) {
        debug_assert_eq!(n, self.residual.len());
        fill_all(self.forces, self.disp, self.vel, self.residual);
        self.weighted_accel.copy_from_slice(self.residual);
    }
}

/// |w| in m/s² that counts as rest: far below what any sum with the motion of a structure could show, and far
/// enough above the least normal number that no product with it in the next step becomes subnormal.
const STILL: f64 = 1e-200;

/// x and v of some rows, one step on.
struct Move<'a> {
    disp: &'a mut [f64],
    vel: &'a mut [f64],
    reported: &'a mut [f64],
    weighted_accel: &'a [f64],
    pace: Pace,
}

impl Kernel for Move<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Pace { dt, lead, gain } = self.pace;
        let rows = self.disp.iter_mut().zip(self.vel).zip(self.reported);
        for (((x, v), reported), w) in rows.zip(self.weighted_accel) {
            let old = *v;
            // Ahead of a wave numbers fall without end; below the normal ones each operation takes a hundred cycles.
            let w = if w.abs() < STILL { 0.0 } else { *w };
            let new = old + gain * w;
            *reported = old + lead * w;
            *v = new;
            *x += dt * new;
        }
    }
}

/// [`Move`] with the velocities of the next step in another vector. All slices are equally long.
struct MoveOver<'a> {
    disp: &'a mut [f64],
    vel: &'a [f64],
    next_vel: &'a mut [f64],
    weighted_accel: &'a [f64],
    pace: Pace,
}

impl Kernel for MoveOver<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Pace { dt, gain, .. } = self.pace;
        let (x, x_rest) = self.disp.as_chunks_mut::<8>();
        let (v, v_rest) = self.vel.as_chunks::<8>();
        let (next, next_rest) = self.next_vel.as_chunks_mut::<8>();
        let (w, w_rest) = self.weighted_accel.as_chunks::<8>();
        let (still, dts, gains) = (isa.splat(STILL), isa.splat(dt), isa.splat(gain));
        for (((x, v), next), w) in x.iter_mut().zip(v).zip(next).zip(w) {
            let w = isa.zero_below(isa.load(w), still);
            let new = isa.add(isa.load(v), isa.mul(gains, w));
            isa.store(new, next);
            isa.store(isa.add(isa.load(x), isa.mul(dts, new)), x);
        }
        let rows = x_rest.iter_mut().zip(v_rest).zip(next_rest);
        for (((x, v), next), w) in rows.zip(w_rest) {
            let w = if w.abs() < STILL { 0.0 } else { *w };
            *next = v + gain * w;
            *x += dt * *next;
        }
    }
}
