//! The matrices that a client may request, in its displacements and row by row.

use super::Transformation;
use super::updated_tangent::UpdatedTangent;
use crate::served::ServedSpecimen;
use gusset_wire::openfresco::Matrix;

/// The matrices of one specimen.
#[derive(Debug)]
pub(super) struct ClientMatrices {
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    mass: Vec<f64>,
    tangent: Vec<f64>,
    /// The tangent stiffness of the axes, by columns.
    columns: Vec<f64>,
}

impl ClientMatrices {
    /// The matrices of a client that commands `n` displacements.
    pub(crate) fn of(
        served: &ServedSpecimen,
        n: usize,
        transformation: Option<&mut Transformation>,
    ) -> Self {
        let mut stiffness = vec![0.0; n * n];
        let mut mass = vec![0.0; n * n];
        match transformation {
            None => {
                transpose(n, served.stiffness(), &mut stiffness);
                transpose(n, served.mass(), &mut mass);
            }
            Some(transformation) => {
                transformation.matrix(served.stiffness(), &mut stiffness);
                transformation.matrix(served.mass(), &mut mass);
            }
        }
        Self {
            stiffness,
            damping: vec![0.0; n * n],
            mass,
            tangent: vec![0.0; n * n],
            columns: vec![0.0; served.stiffness().len()],
        }
    }

    /// A matrix, row by row. The damping matrix is zero: OpenSees' `genericClient` adds damping · velocity to the force that it
    /// reads (seen with 3.7.1: a damper of 40 N s/m acts as one of 80). Our force already includes the damping, as each measured
    /// force does. Real-time: yes.
    pub(crate) fn get(
        &mut self,
        which: Matrix,
        served: &mut ServedSpecimen,
        transformation: Option<&mut Transformation>,
        updated: Option<&UpdatedTangent>,
    ) -> &[f64] {
        match which {
            Matrix::InitialStiffness => &self.stiffness,
            Matrix::Damping => &self.damping,
            Matrix::Mass => &self.mass,
            Matrix::TangentStiffness => {
                match updated {
                    Some(updated) => self.columns.copy_from_slice(updated.columns()),
                    None => served.tangent(&mut self.columns),
                }
                match transformation {
                    None => {
                        let n = served.axes();
                        transpose(n, &self.columns, &mut self.tangent);
                    }
                    Some(transformation) => {
                        transformation.matrix(&self.columns, &mut self.tangent);
                    }
                }
                &self.tangent
            }
        }
    }
}

/// Writes a matrix that is stored by columns row by row.
fn transpose(n: usize, columns: &[f64], rows: &mut [f64]) {
    for (i, row) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        for (value, column) in row.iter_mut().zip(columns.iter().skip(i).step_by(n.max(1))) {
            *value = *column;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_written_row_by_row() {
        let mut rows = [0.0; 4];
        transpose(2, &[1.0, 2.0, 3.0, 4.0], &mut rows);
        assert_eq!(rows, [1.0, 3.0, 2.0, 4.0]);
    }
}
