//! The proof of stability and the choice of λ.
//!
//! The recursion with frozen tangents K_t, C_t has all roots in the closed unit disc if and only if
//!
//! ```text
//! S(λ) = 4 M + 2 Δt (C0 − C_t) + (4 Δt²/λ) K0 − Δt² K_t ⪰ 0
//! ```
//!
//! Mass m inside a measured force, whose acceleration is the second difference of the commands and so a step late, is not in M
//! and takes 4 Σ m bᵀb from S.
//!
//! S grows as λ falls, so the largest admissible λ is found by bisection on one question that every storage of
//! [`Spd`] answers: is S positive definite? It needs no modes; for one degree of freedom it is equation (41) of
//! Gui et al. (2014), for linear systems (33). Tangents during a run are not watched here.

use std::f64::consts::TAU;
use std::fmt;

use thiserror::Error;

use gusset_numerics::integrate::Lambda;
use gusset_numerics::linalg::{Condensation, Spd, SymMatrix};
use gusset_numerics::model::Part;
use gusset_quantity::units::quantity;

/// λ of least period error over the usual steps (Gui et al. 2014, section 3.2); `auto` never exceeds it.
pub const ACCURATE_LAMBDA: f64 = 11.5;

/// Default bound on the gain of force errors when a measured force closes the loop.
pub const GAIN_HYBRID: f64 = 2.0;

/// Default bound on the gain of force errors of a purely numerical run.
pub const GAIN_NUMERICAL: f64 = 10.0;

/// Hands every part to a visitor, in order; may be called more than once.
pub type Parts<'a> = &'a dyn Fn(&mut dyn FnMut(&Part));

/// What stability rests on: matrices in SI units, all n × n.
#[derive(Debug, Clone)]
pub struct StabilityProof {
    /// M.
    pub mass: SymMatrix,
    /// C0, as in M_eff.
    pub damping: SymMatrix,
    /// K0, as in M_eff.
    pub stiffness: SymMatrix,
    /// C_max, upper bound of the damping tangents.
    pub damping_bound: SymMatrix,
    /// K_max, upper bound of the stiffness tangents.
    pub stiffness_bound: SymMatrix,
    /// Δt in s.
    pub dt: f64,
    /// Mass whose inertia is inside the measured forces: not in M, and a step late. `None` without such mass.
    pub late_mass: Option<SymMatrix>,
    /// Degrees of freedom without mass that follow statically, rising. Empty if every one has mass, or the method moves them itself.
    pub massless: Vec<usize>,
}

/// What sets the limit.
#[derive(Debug, Clone, PartialEq)]
pub struct Governing {
    /// The part, or the degree of freedom.
    pub place: Place,
    /// Its share of the destabilising energy in the critical shape, 0 to 1.
    pub share: f64,
    /// Frequency of the critical shape at the bounds, rad/s; infinite if it moves no mass.
    pub frequency: f64,
}

/// Where the limit is set.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// An element, storey or specimen, by its name.
    Part(String),
    /// No single part dominates (a structure given by matrices): the degree of freedom, from 0, that moves most energy.
    Dof(usize),
}

/// 1/λ of a test that counts as stable for every λ, where rows follow statically.
const LEAST_INVERSE: f64 = 1e-9;

/// Frequency above which the shape moves no mass but that of rounding, rad/s.
const FASTEST: f64 = 1e9;

impl fmt::Display for Governing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Place::Part(name) => f.write_str(name)?,
            Place::Dof(dof) => write!(f, "degree of freedom {}", dof + 1)?,
        }
        write!(f, " ({:.0} % of the critical shape", 100.0 * self.share)?;
        if self.frequency < FASTEST {
            write!(f, " at {})", quantity(self.frequency / TAU, "Hz"))
        } else {
            f.write_str(", which moves no mass)")
        }
    }
}

/// λ, how far it is from the limit, and what sets the limit.
#[derive(Debug, Clone, PartialEq)]
pub struct LambdaChoice {
    /// λ to use.
    pub lambda: Lambda,
    /// Largest λ that is stable at the declared bounds; `None` if every λ is.
    pub limit: Option<f64>,
    /// limit / λ: stable at the declared bounds if ≥ 1; infinite without a limit.
    pub margin: f64,
    /// Largest λ that also keeps the gain bound; `None` if every λ does, 0 if none does.
    pub limit_with_gain: Option<f64>,
    /// What sets the limit (of the two, the one with the gain bound if only that exists).
    pub governing: Option<Governing>,
}

impl LambdaChoice {
    /// True if S is positive semi-definite at the declared bounds.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.margin >= 1.0
    }
}

/// Why no λ can be chosen.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StabilityError {
    /// S leaves the range of a double.
    #[error(
        "stability cannot be judged with a step of {dt} s: a mass, damping or stiffness is so large that \
         4 M + 2 Δt (C0 − C_t) + (4 Δt²/λ) K0 − Δt² K_t overflows"
    )]
    Overflow {
        /// Δt in s.
        dt: f64,
    },
    /// A direction that K0 does not stiffen is unstable for every λ: the tangents exceed what M and C0 hold.
    #[error(
        "no lambda is stable at the declared bounds with a step of {dt} s: {} has a tangent that its initial \
         stiffness and damping do not cover",
        governing.as_ref().map_or_else(|| "the structure".to_owned(), ToString::to_string)
    )]
    NoneAdmissible {
        /// Δt in s.
        dt: f64,
        /// Where.
        governing: Option<Governing>,
    },
}

/// Relative width at which the bisection stops: each halving is a factorisation, so large models get the six digits
/// that a report prints.
fn resolution(n: usize) -> f64 {
    if n <= 1000 { 1e-11 } else { 1e-6 }
}

/// The share of the tangents in S.
pub(super) enum Tangents {
    /// Every row has its own motion.
    Whole,
    /// The matrix of the rows that remain, and what brings the others back.
    Condensed(SymMatrix, Box<Condensation>),
}

impl StabilityProof {
    /// S(λ) of all rows; a finite `gain` g adds −(Δt²/g) K0, which keeps the response to a force error at the sawtooth below g
    /// times the static one.
    #[must_use]
    pub fn matrix(&self, lambda: Lambda, gain: f64) -> SymMatrix {
        self.whole(lambda.inverse(), gain)
    }

    fn whole(&self, inverse: f64, gain: f64) -> SymMatrix {
        self.without_lambda(gain)
            .plus(self.per_inverse() * inverse, &self.stiffness)
    }

    /// The share of the tangents in S where rows follow statically, condensed by them: Δt² K_t + 2 Δt C_t + (Δt²/g) K0. `None` where
    /// nothing holds these rows.
    fn tangents(&self, gain: f64) -> Option<Tangents> {
        if self.massless.is_empty() {
            return Some(Tangents::Whole);
        }
        let square = self.dt * self.dt;
        let matrix = SymMatrix::zeros(self.mass.n())
            .plus(square, &self.stiffness_bound)
            .plus(2.0 * self.dt, &self.damping_bound)
            .plus(square / gain, &self.stiffness);
        let mut condensation = Condensation::new(&matrix, &self.massless).ok()?;
        Some(Tangents::Condensed(
            condensation.complement(),
            Box::new(condensation),
        ))
    }

    /// S at 1/λ = `inverse`. Rows that follow statically are condensed, those of 4 M_eff and those of the tangents apart. `None` where
    /// nothing holds them.
    fn at(&self, inverse: f64, gain: f64, tangents: &Tangents) -> Option<SymMatrix> {
        let Tangents::Condensed(tangents, _) = tangents else {
            return Some(self.whole(inverse, gain));
        };
        let mut effective = SymMatrix::zeros(self.mass.n())
            .plus(4.0, &self.mass)
            .plus(2.0 * self.dt, &self.damping)
            .plus(self.per_inverse() * inverse, &self.stiffness);
        if let Some(late) = &self.late_mass {
            effective = effective.plus(-4.0, late);
        }
        let mut effective = Condensation::new(&effective, &self.massless).ok()?;
        Some(effective.complement().plus(-1.0, tangents))
    }

    /// The factor of S(λ), and what brings condensed rows back; see [`StabilityProof::at`].
    pub(super) fn factor(&self, lambda: Lambda) -> Option<(Spd, Tangents)> {
        let tangents = self.tangents(f64::INFINITY)?;
        let matrix = self.at(lambda.inverse(), f64::INFINITY, &tangents)?;
        Some((Spd::factor(&matrix).ok()?, tangents))
    }

    /// The terms of S that do not depend on λ.
    fn without_lambda(&self, gain: f64) -> SymMatrix {
        let square = self.dt * self.dt;
        let terms = SymMatrix::zeros(self.mass.n())
            .plus(4.0, &self.mass)
            .plus(2.0 * self.dt, &self.damping)
            .plus(-2.0 * self.dt, &self.damping_bound)
            .plus(-square / gain, &self.stiffness)
            .plus(-square, &self.stiffness_bound);
        match &self.late_mass {
            Some(late) => terms.plus(-4.0, late),
            None => terms,
        }
    }

    /// Factor of K0 in S per unit of 1/λ.
    fn per_inverse(&self) -> f64 {
        4.0 * self.dt * self.dt
    }

    /// True if S(λ) is positive definite at the declared bounds.
    #[must_use]
    pub fn holds(&self, lambda: Lambda) -> bool {
        self.factor(lambda).is_some()
    }

    /// The largest λ that keeps the gain bound `gain` (infinite: stability alone); `None` if every λ does. The value
    /// is on the safe side of the limit by at most a relative 1e-11, 1e-6 beyond 1000 degrees of freedom.
    ///
    /// # Errors
    /// See [`StabilityError`].
    pub fn limit(&self, gain: f64, parts: &[Part]) -> Result<Option<f64>, StabilityError> {
        self.limit_of(gain, &|visit| parts.iter().for_each(visit))
    }

    fn limit_of(&self, gain: f64, parts: Parts<'_>) -> Result<Option<f64>, StabilityError> {
        let fixed = self.without_lambda(gain);
        let tangents = self.tangents(gain);
        let admissible = |inverse: f64| {
            let matrix = self.at(inverse, gain, tangents.as_ref()?);
            Spd::factor(&matrix?).ok()
        };
        let admissible = |inverse: f64| admissible(inverse).is_some();
        let is_finite =
            |matrix: &SymMatrix| matrix.entries().all(|(_, _, value)| value.is_finite());
        if !(is_finite(&fixed) && is_finite(&self.stiffness)) {
            return Err(StabilityError::Overflow { dt: self.dt });
        }
        // Rows without mass leave M_eff without an inverse at λ = ∞ itself.
        let largest = if self.massless.is_empty() {
            0.0
        } else {
            LEAST_INVERSE
        };
        if admissible(largest) {
            return Ok(None);
        }
        // In 1/λ: not admissible at `low`, admissible at `high`.
        let (mut low, mut high) = (largest, 1.0 / ACCURATE_LAMBDA);
        while !admissible(high) {
            low = high;
            high *= 2.0;
            // λ below 1e-9 is no longer an integration method but a clamp.
            if high > 1e9 {
                return Err(StabilityError::NoneAdmissible {
                    dt: self.dt,
                    governing: self.governing(low, gain, parts),
                });
            }
        }
        let resolution = resolution(self.mass.n());
        while high - low > resolution * high {
            let middle = (low + high) / 2.0;
            if middle <= low || middle >= high {
                break;
            }
            if admissible(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Ok(Some(1.0 / high))
    }

    /// λ by `request`, or by the rule λ = min(11.5, λ_g) without one, with its limit and what governs it. `parts`
    /// name the elements, storeys and specimens that make up K_max and C_max.
    ///
    /// # Errors
    /// See [`StabilityError`].
    #[cfg(test)]
    pub(crate) fn choose(
        &self,
        request: Option<Lambda>,
        gain: f64,
        parts: &[Part],
    ) -> Result<LambdaChoice, StabilityError> {
        self.choose_of(request, gain, &|visit| parts.iter().for_each(visit))
    }

    /// The choice of λ. `parts` makes them one at a time, since a chain of a million masses has two million of them.
    ///
    /// # Errors
    /// See [`StabilityError`].
    pub(crate) fn choose_of(
        &self,
        request: Option<Lambda>,
        gain: f64,
        parts: Parts<'_>,
    ) -> Result<LambdaChoice, StabilityError> {
        let limit = self.limit_of(f64::INFINITY, parts)?;
        let limit_with_gain = match (self.limit_of(gain, parts), request) {
            // A λ that the user gives need not keep the gain bound.
            (Err(StabilityError::NoneAdmissible { .. }), Some(_)) => Some(0.0),
            (found, _) => found?,
        };
        let lambda = request.unwrap_or(Lambda::Finite(
            limit_with_gain.map_or(ACCURATE_LAMBDA, |limit| limit.min(ACCURATE_LAMBDA)),
        ));
        let governing = match (limit, limit_with_gain) {
            (Some(limit), _) => self.governing(1.0 / limit, f64::INFINITY, parts),
            (None, Some(limit)) if limit > 0.0 => self.governing(1.0 / limit, gain, parts),
            (None, _) => None,
        };
        Ok(LambdaChoice {
            lambda,
            limit,
            margin: limit.map_or(f64::INFINITY, |limit| limit * lambda.inverse()),
            limit_with_gain,
            governing,
        })
    }

    /// Names what carries the near-null vector of S at 1/λ = `inverse`.
    fn governing(&self, inverse: f64, gain: f64, parts: Parts<'_>) -> Option<Governing> {
        let mut tangents = self.tangents(gain)?;
        let mut shape = near_null(&self.at(inverse, gain, &tangents)?)?;
        let n = self.mass.n();
        if let Tangents::Condensed(_, condensed) = &mut tangents {
            let mut whole = vec![0.0; n];
            for (&row, value) in condensed.kept().iter().zip(&shape) {
                whole[row] = *value;
            }
            condensed.follow(&mut whole);
            shape = whole;
        }
        let square = self.dt * self.dt;
        let mut pulled = vec![0.0; n];
        let excess = self.damping_bound.plus(-1.0, &self.damping);
        let destabilising = SymMatrix::zeros(n)
            .plus(square, &self.stiffness_bound)
            .plus(2.0 * self.dt, &excess);
        destabilising.subtract_product(&shape, &mut pulled);
        let of_dof = |dof: usize| -shape[dof] * pulled[dof];
        let total: f64 = (0..n).map(of_dof).sum();
        // A direction without any tangent has no share of it to name.
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let late = self.late_mass.as_ref();
        let moving = self.mass.quadratic(&shape) + late.map_or(0.0, |late| late.quadratic(&shape));
        let heaviest = (0..n)
            .map(|dof| self.mass.get(dof, dof))
            .fold(0.0, f64::max);
        // What rounding left of a shape where it has no part moves nothing.
        let frequency = if moving > heaviest * (64.0 * f64::EPSILON).powi(2) {
            (self.stiffness_bound.quadratic(&shape) / moving).sqrt()
        } else {
            f64::INFINITY
        };
        let energy = |part: &Part| {
            let deformation = part.deformation(&shape);
            let excess = part.damping_bound - part.damping;
            (square * part.stiffness_bound + 2.0 * self.dt * excess) * deformation * deformation
        };
        let (mut best, mut listed) = (None::<(String, f64)>, 0.0);
        parts(&mut |part| {
            let energy = energy(part);
            listed += energy;
            let share = energy / total;
            // The last of equal ones.
            if best
                .as_ref()
                .is_none_or(|best| best.1.total_cmp(&share).is_le())
            {
                best = Some((part.name.clone(), share));
            }
        });
        let dof = (0..n).max_by(|&i, &j| of_dof(i).total_cmp(&of_dof(j)))?;
        let (place, share) = match best {
            // The parts must explain the shape at least as well as what they leave unexplained.
            Some((name, share)) if share >= 1.0 - listed / total => (Place::Part(name), share),
            _ => (Place::Dof(dof), of_dof(dof) / total),
        };
        Some(Governing {
            place,
            share,
            frequency,
        })
    }
}

/// Unit vector of the eigenvalue of S nearest to zero from below or above: inverse iteration on S + s I, with s just
/// large enough to make it definite. `None` where no such vector exists, or roundoff hides it.
fn near_null(matrix: &SymMatrix) -> Option<Vec<f64>> {
    let n = matrix.n();
    let norm = (0..n)
        .map(|i| matrix.row(i).map(|(_, v)| v.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let mut shift = 1e-12 * norm;
    // No shift of such a matrix would grow beyond its norm.
    if !(shift > 0.0 && norm.is_finite()) {
        return None;
    }
    let identity = SymMatrix::diagonal(&vec![1.0; n]);
    let mut factor = loop {
        match Spd::factor(&matrix.plus(shift, &identity)) {
            Ok(factor) => break factor,
            // Gershgorin: definite at the latest for a shift beyond the norm.
            Err(_) if shift <= norm => shift *= 4.0,
            Err(_) => return None,
        }
    };
    // Any start that is not orthogonal to the vector; the middle digits of multiples of √2 are not.
    let mut vector: Vec<f64> = (1..=n)
        .map(|i| 0.5 + (i as f64 * std::f64::consts::SQRT_2).fract())
        .collect();
    for _ in 0..60 {
        factor.solve_in_place(&mut vector);
        let length = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        for v in &mut vector {
            *v /= length;
        }
    }
    Some(vector)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn critical_shape_has_a_frequency_in_hz() {
        let told = |frequency| {
            let governing = Governing {
                place: Place::Part("storey 1".to_owned()),
                share: 0.97,
                frequency,
            };
            governing.to_string()
        };
        assert!(told(TAU * 12.5).contains(" at 12.5 Hz"));
        // The mass is that of rounding alone.
        assert!(told(2.2e14).contains("no mass"));
        assert!(told(f64::INFINITY).contains("no mass"));
    }

    #[test]
    fn zero_or_huge_matrix_has_no_limit() {
        for entry in [0.0, -1e-320, f64::INFINITY, f64::MAX] {
            assert_eq!(near_null(&SymMatrix::diagonal(&[entry, entry])), None);
        }
        let zeros = || SymMatrix::zeros(2);
        let proof = StabilityProof {
            mass: SymMatrix::diagonal(&[1.0, 1e308]),
            damping: zeros(),
            stiffness: SymMatrix::diagonal(&[1.0, 1.0]),
            damping_bound: zeros(),
            stiffness_bound: SymMatrix::diagonal(&[1.0, 1.0]),
            dt: 0.01,
            late_mass: None,
            massless: Vec::new(),
        };
        assert_eq!(
            proof.limit(f64::INFINITY, &[]),
            Err(StabilityError::Overflow { dt: 0.01 })
        );
    }
}
