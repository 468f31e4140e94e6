//! The lowest modes of the reduced model beside those of the full one.

use gusset_numerics::linalg::SymMatrix;

use crate::factor::Factor;
use crate::modes::{Lowest, lowest};
use crate::{Reduction, ReductionError, dot, times};

/// Part of its terms below which a difference is roundoff.
const ROUNDOFF: f64 = 1e-12;
/// Part of ω² by which modes with one sum of effective masses differ at most.
const CLOSE: f64 = 1e-3;
/// Modes beyond those that are compared, which may share a frequency with the last one.
const BEYOND: usize = 2;

/// The lowest modes of both models.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// Circular frequencies in rad/s of each mode: of the full model, and of the reduced one.
    pub frequencies: Vec<[f64; 2]>,
    /// Effective masses in each direction of the ground.
    pub grounds: Vec<GroundShare>,
}

/// Effective masses along one influence vector.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundShare {
    /// End of the name of the column of the ground; empty for the only one.
    pub suffix: String,
    /// Sum of the effective masses up to each mode, as parts of the whole mass: of the full model, and of the reduced one. Modes whose
    /// frequencies are nearly equal have one sum, because their shapes are arbitrary.
    pub sums: Vec<[f64; 2]>,
}

impl Reduction {
    /// Compares the `count` lowest modes at rest. `stiffness` and `mass` are those of the reduced structure with its elements,
    /// members and specimens; the influence vectors are those of the full model.
    ///
    /// # Errors
    /// A motion without stiffness, or an iteration that does not settle.
    pub fn accuracy(
        &self,
        [stiffness, mass]: [&SymMatrix; 2],
        influences: &[(String, Vec<f64>)],
        count: usize,
    ) -> Result<Accuracy, ReductionError> {
        let whole_stiffness = self.with_others(self.stiffness(), [&self.reduced()[1], stiffness]);
        let whole_mass = self.with_others(self.mass(), [&self.reduced()[0], mass]);
        let massive = (0..mass.n()).filter(|&row| !mass.row_is_zero(row)).count();
        let found = (count + BEYOND).min(massive);
        let count = count.min(massive);
        let of = |stiffness: &SymMatrix, mass: &SymMatrix| -> Result<Lowest, ReductionError> {
            let mut factor = Factor::new(stiffness).map_err(ReductionError::Loose)?;
            lowest(&mut factor, mass, found).ok_or(ReductionError::NotConverged(found))
        };
        let both = [of(&whole_stiffness, &whole_mass)?, of(stiffness, mass)?];
        let squared = &both[0].squared;
        let last = |mode: usize| {
            let apart = |at: &usize| squared[*at + 1] > (1.0 + CLOSE) * squared[*at];
            (mode..found - 1).find(apart).unwrap_or(found - 1)
        };
        let grounds = influences.iter().map(|(suffix, iota)| {
            let pull = times(&whole_mass, iota);
            let whole = dot(&pull, iota);
            let pulls = [pull.clone(), self.load(&pull)];
            let mut sums = [0.0; 2];
            let each = (0..found).map(|mode| {
                for ((sum, found), pull) in sums.iter_mut().zip(&both).zip(&pulls) {
                    let part = dot(found.shapes.column(mode).as_slice(), pull);
                    *sum += part * part / whole;
                }
                sums
            });
            let each: Vec<[f64; 2]> = each.collect();
            GroundShare {
                suffix: suffix.clone(),
                sums: (0..count).map(|mode| each[last(mode)]).collect(),
            }
        });
        let of_both = squared.iter().zip(&both[1].squared).take(count);
        Ok(Accuracy {
            frequencies: of_both.map(|(a, b)| [a.sqrt(), b.sqrt()]).collect(),
            grounds: grounds.collect(),
        })
    }

    /// A matrix of the full model with what the reduced one has at kept directions beside its projection.
    fn with_others(&self, full: &SymMatrix, [own, reduced]: [&SymMatrix; 2]) -> SymMatrix {
        let more = reduced.entries().filter_map(|(i, j, value)| {
            let known = own.get(i, j);
            let more = value - known;
            let is_more = more.abs() > ROUNDOFF * (value.abs() + known.abs());
            is_more.then_some((*self.kept().get(i)?, *self.kept().get(j)?, more))
        });
        full.plus(1.0, &SymMatrix::from_triplets(full.n(), more))
    }
}
