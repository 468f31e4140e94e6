//! A linear specimen whose axes know of each other: f = K d + C v.
//!
//! The declared mass enters the structure's mass (OpenFresco 15); no inertia force is computed here, so it is not
//! counted twice. No memory.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Specimen;
use gusset_numerics::law::{LawError, Reach};
use gusset_quantity::domain::inside;
use gusset_quantity::state;

/// Linear specimen with full matrices, one row for each axis. Each matrix is symmetric without
/// negative eigenvalues.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct CoupledSpec {
    /// Stiffness matrix K by rows. Entries of rotations are in N or N m.
    #[schemars(example = [[2.0e6, -5.0e5], [-5.0e5, 1.0e6]])]
    pub stiffness_n_per_m: Vec<Vec<f64>>,
    /// Damping matrix C by rows. Default: no damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [[2.0e4, 0.0], [0.0, 1.0e4]])]
    pub damping_n_s_per_m: Option<Vec<Vec<f64>>>,
    /// Mass matrix by rows that is added to the structure. The force of the specimen does not
    /// contain its inertia. Default: no mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [[100.0, 0.0], [0.0, 50.0]])]
    pub mass_kg: Option<Vec<Vec<f64>>>,
}

impl CoupledSpec {
    /// Builds the specimen for `axes` axes.
    ///
    /// # Errors
    /// A matrix of another size, with an entry that is not finite, not symmetric, or with a negative eigenvalue.
    pub fn build(&self, axes: usize) -> Result<Coupled, LawError> {
        let none = || vec![0.0; axes * axes];
        let optional = |name, rows: &Option<Vec<Vec<f64>>>| match rows {
            Some(rows) => matrix(name, rows, axes),
            None => Ok(none()),
        };
        Ok(Coupled {
            axes,
            stiffness: matrix("stiffness_n_per_m", &self.stiffness_n_per_m, axes)?,
            damping: optional("damping_n_s_per_m", &self.damping_n_s_per_m)?,
            mass: optional("mass_kg", &self.mass_kg)?,
        })
    }
}

/// Differences and eigenvalues below this share of the largest entry count as rounding of the entries.
const ROUNDING: f64 = 1e-9;

/// Rows from the file as a checked matrix by columns (and equally by rows, because it is symmetric).
fn matrix(name: &'static str, rows: &[Vec<f64>], axes: usize) -> Result<Vec<f64>, LawError> {
    let size = |what, found| {
        if found == axes {
            Ok(())
        } else {
            Err(LawError::Size {
                name,
                what,
                found,
                wanted: axes,
            })
        }
    };
    size("rows", rows.len())?;
    for row in rows {
        size("columns in a row", row.len())?;
    }
    let mut largest = 0.0;
    for value in rows.iter().flatten() {
        inside(name, *value, true, "finite in every entry")?;
        largest = f64::max(largest, value.abs());
    }
    let by_columns = nalgebra::DMatrix::from_fn(axes, axes, |i, j| rows[i][j]);
    for i in 0..axes {
        for j in 0..i {
            let (found, mirror) = (by_columns[(i, j)], by_columns[(j, i)]);
            if (found - mirror).abs() > ROUNDING * largest {
                return Err(LawError::Asymmetric {
                    name,
                    row: i + 1,
                    column: j + 1,
                    found,
                    mirror,
                });
            }
        }
    }
    // The mean of both halves: later steps rely on exact symmetry.
    let symmetric = (&by_columns + by_columns.transpose()) * 0.5;
    let eigenvalue = symmetric.symmetric_eigenvalues().min();
    if eigenvalue >= -ROUNDING * largest {
        Ok(symmetric.as_slice().to_vec())
    } else {
        Err(LawError::Indefinite { name, eigenvalue })
    }
}

/// See [`CoupledSpec`].
#[derive(Debug, Clone)]
pub struct Coupled {
    axes: usize,
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    mass: Vec<f64>,
}

state! { Coupled as "coupled" {} keeps { axes, stiffness, damping, mass } }

impl Specimen for Coupled {
    fn axes(&self) -> usize {
        self.axes
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], _dt: f64, force: &mut [f64]) {
        let rows = self
            .stiffness
            .chunks_exact(self.axes)
            .zip(self.damping.chunks_exact(self.axes));
        for ((stiffness, damping), force) in rows.zip(force) {
            let mut sum = 0.0;
            for (k, d) in stiffness.iter().zip(disp) {
                sum += k * d;
            }
            for (c, v) in damping.iter().zip(vel) {
                sum += c * v;
            }
            *force = sum;
        }
    }

    fn commit(&mut self) {}

    fn revert(&mut self) {}

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        copy(stiffness, &self.stiffness);
        copy(damping, &self.damping);
        copy(mass, &self.mass);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        copy(stiffness, &self.stiffness);
    }

    fn bound(
        &self,
        _reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        copy(stiffness, &self.stiffness);
        copy(damping, &self.damping);
        Ok(())
    }
}

/// Like `copy_from_slice`, without its panic.
fn copy(to: &mut [f64], from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::assert_is;

    fn spec(stiffness: [[f64; 2]; 2]) -> CoupledSpec {
        CoupledSpec {
            stiffness_n_per_m: stiffness.map(Vec::from).to_vec(),
            damping_n_s_per_m: Some(vec![vec![10.0, -4.0], vec![-4.0, 6.0]]),
            mass_kg: None,
        }
    }

    #[test]
    fn forces_are_matrix_times_motion() {
        let mut specimen = spec([[3e6, -1e6], [-1e6, 2e6]]).build(2).unwrap();
        let mut force = [0.0; 2];
        specimen.trial(&[1e-3, -2e-3], &[0.5, 0.25], 0.01, &mut force);
        assert_eq!(force, [5000.0 + 4.0, -5000.0 - 0.5]);
        let (mut stiffness, mut damping, mut mass) = ([0.0; 4], [0.0; 4], [1.0; 4]);
        specimen.reference(&mut stiffness, &mut damping, &mut mass);
        assert_eq!(stiffness, [3e6, -1e6, -1e6, 2e6]);
        assert_eq!(damping, [10.0, -4.0, -4.0, 6.0]);
        assert_eq!(mass, [0.0; 4]);
    }

    #[test]
    fn free_body_is_allowed_indefinite_is_not() {
        assert!(spec([[1e6, -1e6], [-1e6, 1e6]]).build(2).is_ok());
        let error = spec([[1e6, -3e6], [-3e6, 1e6]]).build(2).unwrap_err();
        let LawError::Indefinite { name, eigenvalue } = error else {
            panic!("{error}");
        };
        assert_eq!(name, "stiffness_n_per_m");
        assert!((eigenvalue + 2e6).abs() < 1e-6);
    }

    #[test]
    fn invalid_matrix_is_refused() {
        let refused = |spec: &CoupledSpec, axes| spec.build(axes).unwrap_err();
        assert_is!(
            refused(&spec([[1.0, 0.5], [0.4, 1.0]]), 2)
            => LawError::Asymmetric { row: 2, column: 1, found: 0.4, mirror: 0.5, .. }
        );
        assert_is!(
            refused(&spec([[1.0, 0.0], [0.0, f64::NAN]]), 2)
            => LawError::Parameter(gusset_quantity::domain::OutOfDomain { name: "stiffness_n_per_m", .. })
        );
        assert_is!(
            refused(&spec([[1.0, 0.0], [0.0, 1.0]]), 3)
            => LawError::Size { name: "stiffness_n_per_m", found: 2, wanted: 3, .. }
        );
        let mut ragged = spec([[1.0, 0.0], [0.0, 1.0]]);
        ragged.mass_kg = Some(vec![vec![1.0, 0.0], vec![1.0]]);
        assert_is!(
            refused(&ragged, 2)
            => LawError::Size { name: "mass_kg", found: 1, wanted: 2, .. }
        );
    }
}
