//! The shapes Ψ of a reduced model, and what becomes of matrices, loads and motions.

use std::sync::{Arc, Mutex, PoisonError};

use gusset_numerics::linalg::{NotPositiveDefinite, SymMatrix};
use nalgebra::DMatrix;
use thiserror::Error;

use crate::factor::Factor;
use crate::modes::{extend, lowest};
use crate::{add, dot, times};

/// Most numbers of all shapes together: 2 GB.
const MOST_NUMBERS: usize = 250_000_000;
/// Shapes that are solved for at a time.
const AT_A_TIME: usize = 32;

/// Why a structure cannot be reduced. Degrees of freedom count from 0 here and from 1 in the text.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ReductionError {
    /// Every direction is kept.
    #[error("all {0} DOFs are kept, so nothing is reduced: remove `reduce`, or keep fewer DOFs")]
    Nothing(usize),
    /// More modes than the interior has.
    #[error("`modes` is {asked}, but the DOFs that are not kept have only {most} modes")]
    Modes {
        /// As given.
        asked: usize,
        /// Directions of the interior that have mass.
        most: usize,
    },
    /// The interior can move while all kept directions rest.
    #[error(
        "DOF {} moves without stiffness while all kept DOFs are held: keep it, or connect it",
        .0.dof + 1
    )]
    Loose(NotPositiveDefinite),
    /// The mass matrix is not valid.
    #[error("the mass matrix is {0}")]
    Mass(NotPositiveDefinite),
    /// Too many shapes for the memory.
    #[error(
        "{shapes} shapes of {dofs} DOFs need too much memory: keep fewer DOFs, at most about {most}"
    )]
    TooLarge {
        /// Kept directions and modes.
        shapes: usize,
        /// Degrees of freedom of the interior.
        dofs: usize,
        /// Shapes that are allowed.
        most: usize,
    },
    /// The iteration for the modes fails.
    #[error(
        "the lowest {0} modes did not converge: too many of their frequencies are nearly equal, or the stiffness is badly scaled. Use another number of `modes`"
    )]
    NotConverged(usize),
}

/// A degree of freedom of the reduced model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// A kept direction of the full model, from 0.
    Kept(usize),
    /// A mode with all kept directions fixed, from 1. Its coordinate is the largest displacement of its shape.
    Mode(usize),
    /// The part with mass of the static shape of a kept direction that has no mass itself, from 0.
    Shape(usize),
}

/// A reduced model: kept directions, then modes, then shapes.
#[derive(Debug)]
pub struct Reduction {
    mass: SymMatrix,
    stiffness: SymMatrix,
    kept: Vec<usize>,
    modes: usize,
    /// The other directions, rising.
    interior: Vec<usize>,
    coordinates: Vec<Coordinate>,
    /// Displacements of the interior for a unit of each coordinate.
    shapes: DMatrix<f64>,
    /// ω of the last mode in rad/s; 0 without modes.
    highest: f64,
    /// M and K of the reduced model.
    reduced: [SymMatrix; 2],
}

/// The last reduction: `gusset check` builds the structure of a test several times.
static LAST: Mutex<Option<Arc<Reduction>>> = Mutex::new(None);

impl Reduction {
    /// Reduces M and K (n × n) to the directions `kept`, rising from 0, and this number of modes. The last result is kept for the
    /// next call with the same input.
    ///
    /// # Errors
    /// See [`ReductionError`].
    pub fn new(
        mass: SymMatrix,
        stiffness: SymMatrix,
        kept: Vec<usize>,
        modes: usize,
    ) -> Result<Arc<Self>, ReductionError> {
        let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
        let is_same = |last: &&Arc<Self>| {
            (&last.kept, last.modes) == (&kept, modes)
                && last.mass == mass
                && last.stiffness == stiffness
        };
        if let Some(known) = last.as_ref().filter(is_same) {
            return Ok(Arc::clone(known));
        }
        *last = None;
        let made = Arc::new(Self::made(mass, stiffness, kept, modes)?);
        *last = Some(Arc::clone(&made));
        Ok(made)
    }

    fn made(
        mass: SymMatrix,
        stiffness: SymMatrix,
        kept: Vec<usize>,
        modes: usize,
    ) -> Result<Self, ReductionError> {
        let n = mass.n();
        let mut is_kept = vec![false; n];
        kept.iter().for_each(|&dof| is_kept[dof] = true);
        let interior: Vec<usize> = (0..n).filter(|&dof| !is_kept[dof]).collect();
        if interior.is_empty() {
            return Err(ReductionError::Nothing(n));
        }
        if mass.half_bandwidth() > 0 {
            let massive: Vec<usize> = (0..n).filter(|&row| !mass.row_is_zero(row)).collect();
            Factor::new(&mass.block(&massive)).map_err(|failure| {
                ReductionError::Mass(NotPositiveDefinite {
                    dof: massive[failure.dof],
                    ..failure
                })
            })?;
        }
        let inner_mass = mass.block(&interior);
        let massive = (0..interior.len()).filter(|&row| !inner_mass.row_is_zero(row));
        let most = massive.count();
        if modes > most {
            return Err(ReductionError::Modes { asked: modes, most });
        }
        let massless: Vec<usize> = (0..kept.len())
            .filter(|&at| mass.row_is_zero(kept[at]))
            .collect();
        let count = kept.len() + modes + massless.len();
        if count * interior.len() > MOST_NUMBERS {
            return Err(ReductionError::TooLarge {
                shapes: count,
                dofs: interior.len(),
                most: MOST_NUMBERS / interior.len(),
            });
        }
        let inner_stiffness = stiffness.block(&interior);
        let in_full = |failure: NotPositiveDefinite| {
            ReductionError::Loose(NotPositiveDefinite {
                dof: interior[failure.dof],
                ..failure
            })
        };
        let mut factor = Factor::new(&inner_stiffness).map_err(in_full)?;
        let mut shapes = DMatrix::zeros(interior.len(), kept.len());
        let mut place = vec![usize::MAX; n];
        for (at, &dof) in interior.iter().enumerate() {
            place[dof] = at;
        }
        for (mut shape, &dof) in shapes.column_iter_mut().zip(&kept) {
            for (row, k) in stiffness.row(dof).filter(|(row, _)| !is_kept[*row]) {
                shape[place[row]] = -k;
            }
        }
        for first in (0..kept.len()).step_by(AT_A_TIME) {
            let some = first..(first + AT_A_TIME).min(kept.len());
            let mut block = shapes.columns_range(some.clone()).into_owned();
            factor.solve(&mut block);
            shapes.columns_range_mut(some).copy_from(&block);
        }
        let found = lowest(&mut factor, &inner_mass, modes);
        let found = found.ok_or(ReductionError::NotConverged(modes))?;
        drop(factor);
        let highest = found.squared.last().map_or(0.0, |squared| squared.sqrt());
        let mut basis: Vec<Vec<f64>> = (found.shapes.column_iter())
            .map(|shape| shape.as_slice().to_vec())
            .collect();
        let mut coordinates: Vec<Coordinate> = kept.iter().copied().map(Coordinate::Kept).collect();
        coordinates.extend((1..=modes).map(Coordinate::Mode));
        let follows: Vec<usize> = (0..interior.len())
            .filter(|&row| inner_mass.row_is_zero(row))
            .collect();
        let mut still = DMatrix::zeros(follows.len(), massless.len());
        for (mut still, &at) in still.column_iter_mut().zip(&massless) {
            for (row, k) in stiffness.row(kept[at]).filter(|(row, _)| !is_kept[*row]) {
                if let Ok(row) = follows.binary_search(&place[row]) {
                    still[row] = -k;
                }
            }
        }
        if !massless.is_empty() {
            let mut factor = Factor::new(&inner_stiffness.block(&follows)).map_err(|failure| {
                in_full(NotPositiveDefinite {
                    dof: follows[failure.dof],
                    ..failure
                })
            })?;
            factor.solve(&mut still);
        }
        for (still, &at) in still.column_iter().zip(&massless) {
            let mut moving = shapes.column(at).as_slice().to_vec();
            shapes.column_mut(at).fill(0.0);
            for (&row, x) in follows.iter().zip(still.iter()) {
                moving[row] -= x;
                shapes[(row, at)] = *x;
            }
            if modes < most {
                extend(&mut basis, &inner_mass, &moving);
                if basis.len() + kept.len() > coordinates.len() {
                    coordinates.push(Coordinate::Shape(kept[at]));
                }
            }
        }
        let mut all = shapes.resize_horizontally(coordinates.len(), 0.0);
        for (to, mut shape) in (kept.len()..).zip(basis) {
            let largest = shape.iter().fold(0.0_f64, |most, x| {
                // A later one must be clearly larger: roundoff does not decide the sign of a symmetric shape.
                if x.abs() > most.abs() * (1.0 + 1e-9) {
                    *x
                } else {
                    most
                }
            });
            shape.iter_mut().for_each(|x| *x /= largest);
            all.column_mut(to).copy_from_slice(&shape);
        }
        let mut made = Self {
            reduced: [0, 1].map(|_| SymMatrix::zeros(0)),
            mass,
            stiffness,
            kept,
            modes,
            interior,
            coordinates,
            shapes: all,
            highest,
        };
        made.reduced = [&made.mass, &made.stiffness].map(|matrix| made.project(matrix));
        Ok(made)
    }

    /// Degrees of freedom of the full model.
    #[must_use]
    pub fn full(&self) -> usize {
        self.mass.n()
    }

    /// M and K of the reduced model.
    #[must_use]
    pub fn reduced(&self) -> &[SymMatrix; 2] {
        &self.reduced
    }

    /// M of the full model.
    #[must_use]
    pub fn mass(&self) -> &SymMatrix {
        &self.mass
    }

    /// K of the full model.
    pub(crate) fn stiffness(&self) -> &SymMatrix {
        &self.stiffness
    }

    /// The degrees of freedom of the reduced model, in order.
    #[must_use]
    pub fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// Number of a kept direction in the reduced model, both from 0.
    #[must_use]
    pub fn place(&self, dof: usize) -> Option<usize> {
        self.kept.binary_search(&dof).ok()
    }

    /// The kept directions, from 0, rising.
    #[must_use]
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// Circular frequency of the highest mode with all kept directions fixed, in rad/s; 0 without modes.
    #[must_use]
    pub fn highest(&self) -> f64 {
        self.highest
    }

    /// Displacements of the full model for a unit of one coordinate.
    fn column(&self, at: usize) -> Vec<f64> {
        let mut whole = vec![0.0; self.full()];
        for (&dof, x) in self.interior.iter().zip(self.shapes.column(at).iter()) {
            whole[dof] = *x;
        }
        if let Some(&dof) = self.kept.get(at) {
            whole[dof] = 1.0;
        }
        whole
    }

    /// Ψᵀ A Ψ.
    #[must_use]
    pub fn project(&self, matrix: &SymMatrix) -> SymMatrix {
        let count = self.coordinates.len();
        if matrix.is_zero() {
            return SymMatrix::zeros(count);
        }
        let rows = (0..count).flat_map(|at| {
            let seen = self.load(&times(matrix, &self.column(at)));
            seen.into_iter()
                .take(at + 1)
                .enumerate()
                .map(move |(row, value)| (row, at, value))
        });
        SymMatrix::from_triplets(count, rows)
    }

    /// Ψᵀ f of a load.
    #[must_use]
    pub fn load(&self, force: &[f64]) -> Vec<f64> {
        let inner: Vec<f64> = self.interior.iter().map(|&dof| force[dof]).collect();
        let each = self.shapes.column_iter().enumerate();
        each.map(|(at, shape)| {
            let own = self.kept.get(at).map_or(0.0, |&dof| force[dof]);
            own + dot(shape.as_slice(), &inner)
        })
        .collect()
    }

    /// −Ψᵀ M ι: the load of a unit acceleration along an influence vector of the full model.
    #[must_use]
    pub fn ground_load(&self, influence: &[f64]) -> Vec<f64> {
        let mut force = vec![0.0; self.full()];
        self.mass.subtract_product(influence, &mut force);
        self.load(&force)
    }

    /// Coordinates of a motion of the full model: exact at the kept directions, and nearest by mass elsewhere.
    #[must_use]
    pub fn motion(&self, disp: &[f64]) -> Vec<f64> {
        let mut rest = disp.to_vec();
        let mut found: Vec<f64> = self.kept.iter().map(|&dof| disp[dof]).collect();
        for (at, x) in found.iter().enumerate().filter(|(_, x)| **x != 0.0) {
            add(&mut rest, -x, &self.column(at));
        }
        let momentum = times(&self.mass, &rest);
        if rest.iter().all(|x| *x == 0.0) {
            found.resize(self.coordinates.len(), 0.0);
            return found;
        }
        for at in self.kept.len()..self.coordinates.len() {
            let shape = self.column(at);
            let size = dot(&shape, &times(&self.mass, &shape));
            found.push(dot(&shape, &momentum) / size);
        }
        found
    }
}
