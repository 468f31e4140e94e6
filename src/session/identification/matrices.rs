//! Stiffness and damping between the axes of a specimen as matrices: as its axes count, as the structure sees them, and of the
//! coordinates of a platform where the axes are the actuators that hold it.
//!
//! A column holds the forces of all axes while one moved and the others were held. Invariant: every matrix is symmetric to the
//! last bit and without negative eigenvalues, as a test file requires.

use nalgebra::DMatrix;

use super::outcome::Axis;
use gusset_actuator::geometry::{GeometrySpec, LawPlace};
use gusset_config::SpecimenTable;
use gusset_motion::identify::{Estimate, Felt, Identification, SpecimenFit};

/// Stiffness in N/m and damping in N s/m.
#[derive(Debug, Clone)]
pub(super) struct Matrices {
    pub stiffness: DMatrix<f64>,
    pub damping: DMatrix<f64>,
}

/// Matrices for the specimen's law, and for the estimates in its table.
#[derive(Debug)]
pub(super) struct Found {
    pub law: Matrices,
    pub estimate: Matrices,
}

/// Matrices of a specimen with this table: all its axes in order; `to_hz` is the end of the band.
pub(super) fn found(
    table: &SpecimenTable,
    known: &[(&Axis, &Identification)],
    to_hz: f64,
) -> Found {
    let axes = at_axes(known, to_hz);
    let ratio = |axis: usize| {
        let gear = table.axis.get(axis);
        gear.map_or(1.0, |gear| f64::from(gear.sign) * gear.scale)
    };
    let n = known.len();
    let gears = DMatrix::from_fn(n, n, |i, j| if i == j { ratio(i) } else { 0.0 });
    let strokes = axes.seen_through(&gears);
    let similitude = &table.similitude;
    let share = similitude.force / similitude.length;
    let at_structure = Matrices {
        stiffness: &strokes.stiffness * share,
        damping: &strokes.damping * (share * similitude.time),
    };
    let platform = table.geometry.as_ref();
    let platform = platform.filter(|spec| spec.law_at == LawPlace::Platform);
    let both =
        platform.and_then(|spec| Some((jacobian(spec, 1.0)?, jacobian(spec, similitude.length)?)));
    match both {
        Some((own, scaled)) => Found {
            law: strokes.seen_through(&own),
            estimate: at_structure.seen_through(&scaled),
        },
        None => Found {
            law: axes,
            estimate: at_structure,
        },
    }
}

/// Strokes per coordinate at the reference pose.
fn jacobian(spec: &GeometrySpec, scale: f64) -> Option<DMatrix<f64>> {
    let geometry = spec.build(scale).ok()?;
    let at = geometry.reference();
    let (rows, columns) = (geometry.actuators(), geometry.coordinates().len());
    Some(DMatrix::from_fn(rows, columns, |i, j| at.slope(i, j)))
}

/// As the axes count, at the specimen.
fn at_axes(known: &[(&Axis, &Identification)], to_hz: f64) -> Matrices {
    let n = known.len();
    let own = |of: fn(&SpecimenFit) -> Estimate, index: usize| {
        let (_, found) = known[index];
        let value = found.specimen.as_ref().map_or(0.0, |s| of(s).value);
        // A little less than nothing is nothing: standard errors are beside it.
        value.max(0.0)
    };
    // A damping counts as zero if its force at the end of the band is negligible beside that of the stiffness.
    let omega = 2.0 * std::f64::consts::PI * to_hz;
    let between = |of: fn(&Felt) -> Estimate, per: f64, moved: usize, held: usize| {
        let (axis, _) = known[moved];
        let felt = axis.felt.iter().find(|(other, _)| *other == held);
        let estimate = of(&felt?.1);
        let counts = estimate.counts_beside(axis.own_stiffness() / per);
        counts.then_some(estimate.value)
    };
    let matrix = |of_own: fn(&SpecimenFit) -> Estimate, of: fn(&Felt) -> Estimate, per: f64| {
        let mut all = DMatrix::zeros(n, n);
        for i in 0..n {
            all[(i, i)] = own(of_own, i);
            for j in 0..i {
                let one = match (between(of, per, i, j), between(of, per, j, i)) {
                    (Some(a), Some(b)) => 0.5 * (a + b),
                    (Some(one), None) | (None, Some(one)) => one,
                    (None, None) => 0.0,
                };
                (all[(i, j)], all[(j, i)]) = (one, one);
            }
        }
        without_negative(all)
    };
    Matrices {
        stiffness: matrix(|s| s.stiffness, |f| f.stiffness, 1.0),
        damping: matrix(|s| s.damping, |f| f.damping, omega),
    }
}

/// The nearest matrix without negative eigenvalues: it removes the effect of noise on a small one.
fn without_negative(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = matrix.clone().symmetric_eigen();
    if eigen.eigenvalues.iter().all(|value| *value >= 0.0) {
        return matrix;
    }
    let values = DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0)));
    mirrored(&eigen.eigenvectors * values * eigen.eigenvectors.transpose())
}

/// One half, twice.
fn mirrored(matrix: DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        // Zeros get no sign.
        matrix[(i.min(j), i.max(j))] + 0.0
    })
}

impl Matrices {
    /// Tᵀ M T for motions that are T times others.
    fn seen_through(&self, motion: &DMatrix<f64>) -> Self {
        let of = |matrix: &DMatrix<f64>| mirrored(motion.transpose() * matrix * motion);
        Self {
            stiffness: of(&self.stiffness),
            damping: of(&self.damping),
        }
    }

    /// True if no axis knows of another.
    pub(crate) fn is_diagonal(&self) -> bool {
        let n = self.stiffness.nrows();
        let each = [&self.stiffness, &self.damping];
        let each = each.into_iter();
        each.flat_map(|matrix| (0..n).flat_map(move |i| (0..i).map(move |j| matrix[(i, j)])))
            .all(|entry| entry == 0.0)
    }
}

/// By rows.
pub(super) fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let row = |i: usize| (0..matrix.ncols()).map(|j| matrix[(i, j)]).collect();
    (0..matrix.nrows()).map(row).collect()
}
