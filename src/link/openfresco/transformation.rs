//! The transformation d = B·x between the displacements x of a client and the axes d of the specimen.
//!
//! The client commands x, with one entry per degree of freedom. The axes are commanded d = B·x, and the client gets the force
//! Bᵀ·f, the tangent Bᵀ·K·B, and the displacement nearest to its command that agrees with the measured d. Pure: no
//! socket and no clock; nothing is allocated after [`Transformation::new`].

use nalgebra::DMatrix;

use gusset_quantity::substructure::Measurement;

/// Singular values below this part of the largest count as zero.
const RANK: f64 = 1e-12;

/// The rows of B, and buffers for their products.
#[derive(Debug, Clone)]
pub struct Transformation {
    /// One row per axis.
    rows: Vec<Vec<f64>>,
    /// The pseudoinverse of B, one row per degree of freedom.
    inverse: Vec<Vec<f64>>,
    axes_disp: Vec<f64>,
    axes_vel: Vec<f64>,
    disp: Vec<f64>,
    force: Vec<f64>,
    /// K·B of one column of B.
    product: Vec<f64>,
}

impl Transformation {
    /// The transformation with these rows, one per axis; every row has one number per degree of freedom of the client.
    ///
    /// # Errors
    /// No number, rows of different lengths, or a number that is not finite.
    pub fn new(rows: Vec<Vec<f64>>) -> Result<Self, String> {
        let (m, n) = (rows.len(), rows.first().map_or(0, Vec::len));
        if n == 0 || rows.iter().any(|row| row.len() != n) {
            return Err("every row must have one number per degree of freedom".to_owned());
        }
        if rows.iter().flatten().any(|entry| !entry.is_finite()) {
            return Err("every number must be finite".to_owned());
        }
        let matrix = DMatrix::from_fn(m, n, |i, j| rows[i][j]);
        let parts = matrix.svd(true, true);
        let least = RANK * parts.singular_values.max();
        let inverse = parts.pseudo_inverse(least).map_err(str::to_owned)?;
        let row = |i| inverse.row(i).iter().copied().collect();
        Ok(Self {
            inverse: (0..n).map(row).collect(),
            rows,
            axes_disp: vec![0.0; m],
            axes_vel: vec![0.0; m],
            disp: vec![0.0; n],
            force: vec![0.0; n],
            product: vec![0.0; m],
        })
    }

    /// Number of axes of the specimen.
    #[must_use]
    pub(crate) const fn axes(&self) -> usize {
        self.rows.len()
    }

    /// Number of degrees of freedom of the client.
    #[must_use]
    pub(crate) const fn dofs(&self) -> usize {
        self.inverse.len()
    }

    /// Displacements and velocities of the axes for those of the client. Real-time: yes.
    pub(crate) fn command(&mut self, disp: &[f64], vel: &[f64]) -> (&[f64], &[f64]) {
        times(&self.rows, disp, &mut self.axes_disp);
        times(&self.rows, vel, &mut self.axes_vel);
        (&self.axes_disp, &self.axes_vel)
    }

    /// Takes a measurement of the axes after the command `disp` of the client. Real-time: yes.
    pub(crate) fn measure(&mut self, measured: &Measurement, disp: &[f64]) {
        self.force.fill(0.0);
        for (row, force) in self.rows.iter().zip(&measured.force) {
            for (sum, entry) in self.force.iter_mut().zip(row) {
                *sum += entry * force;
            }
        }
        // Components that B does not see stay as commanded.
        times(&self.rows, disp, &mut self.axes_disp);
        for (left, read) in self.axes_disp.iter_mut().zip(&measured.disp) {
            *left = read - *left;
        }
        times(&self.inverse, &self.axes_disp, &mut self.disp);
        for (value, commanded) in self.disp.iter_mut().zip(disp) {
            *value += commanded;
        }
    }

    /// The client's displacements after the last measurement.
    #[must_use]
    pub(crate) fn disp(&self) -> &[f64] {
        &self.disp
    }

    /// The client's forces after the last measurement.
    #[must_use]
    pub(crate) fn force(&self) -> &[f64] {
        &self.force
    }

    /// Bᵀ·K·B by rows, of a matrix K of the axes by columns. Real-time: yes.
    pub(crate) fn matrix(&mut self, columns: &[f64], rows: &mut [f64]) {
        let (m, n) = (self.axes().max(1), self.dofs().max(1));
        for j in 0..n {
            self.product.fill(0.0);
            for (column, row) in columns.chunks_exact(m).zip(&self.rows) {
                let entry = row.get(j).copied().unwrap_or(0.0);
                for (sum, k) in self.product.iter_mut().zip(column) {
                    *sum += k * entry;
                }
            }
            for (i, line) in rows.chunks_exact_mut(n).enumerate() {
                let terms = self.rows.iter().zip(&self.product);
                let terms = terms.map(|(row, value)| row.get(i).copied().unwrap_or(0.0) * value);
                if let Some(place) = line.get_mut(j) {
                    *place = terms.sum();
                }
            }
        }
    }
}

/// `into` = `rows` · `vector`.
fn times(rows: &[Vec<f64>], vector: &[f64], into: &mut [f64]) {
    for (value, row) in into.iter_mut().zip(rows) {
        *value = row.iter().zip(vector).map(|(b, x)| b * x).sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(disp: &[f64], force: &[f64]) -> Measurement {
        let mut measured = Measurement::zeros(disp.len());
        measured.disp.copy_from_slice(disp);
        measured.force.copy_from_slice(force);
        measured
    }

    #[test]
    fn forces_and_matrices_follow_the_work() {
        let rows = vec![vec![-1.0, 1.0, 0.0], vec![0.0, 0.6, 0.8]];
        let mut between = Transformation::new(rows).unwrap();
        assert_eq!((between.axes(), between.dofs()), (2, 3));
        let (disp, vel) = between.command(&[0.1, 0.3, 0.5], &[1.0, 0.0, 2.0]);
        assert!((disp[0] - 0.2).abs() < 1e-15 && (disp[1] - 0.58).abs() < 1e-15);
        assert!((vel[0] + 1.0).abs() < 1e-15 && (vel[1] - 1.6).abs() < 1e-15);
        between.measure(&measured(&[0.2, 0.58], &[10.0, 5.0]), &[0.1, 0.3, 0.5]);
        let wanted = [-10.0, 13.0, 4.0];
        for (force, wanted) in between.force().iter().zip(wanted) {
            assert!((force - wanted).abs() < 1e-12);
        }
        // K = [[2, 1], [3, 4]], which is not symmetric.
        let mut found = [0.0; 9];
        between.matrix(&[2.0, 3.0, 1.0, 4.0], &mut found);
        let wanted = [2.0, -2.6, -0.8, -3.8, 5.84, 2.72, -2.4, 4.32, 2.56];
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
    }

    #[test]
    fn displacement_is_nearest_to_the_command() {
        let mut between = Transformation::new(vec![vec![-1.0, 1.0]]).unwrap();
        // Exactly as commanded, to the last bit.
        let disp = [0.1, 0.3];
        let followed = between.command(&disp, &[0.0; 2]).0.to_vec();
        between.measure(&measured(&followed, &[0.0]), &disp);
        assert_eq!(between.disp(), disp);
        // An actuator that stays behind by 0.02: each node takes half of it.
        between.measure(&measured(&[followed[0] - 0.02], &[0.0]), &disp);
        assert!((between.disp()[0] - 0.11).abs() < 1e-15);
        assert!((between.disp()[1] - 0.29).abs() < 1e-15);
    }

    #[test]
    fn more_axes_than_dofs_are_served() {
        let mut two = Transformation::new(vec![vec![1.0], vec![1.0]]).unwrap();
        two.measure(&measured(&[0.1, 0.3], &[3.0, 4.0]), &[0.2]);
        assert!((two.disp()[0] - 0.2).abs() < 1e-15);
        assert_eq!(two.force(), [7.0]);
        for rows in [
            vec![],
            vec![vec![]],
            vec![vec![1.0], vec![1.0, 2.0]],
            vec![vec![f64::NAN]],
        ] {
            assert!(Transformation::new(rows).is_err());
        }
    }
}
