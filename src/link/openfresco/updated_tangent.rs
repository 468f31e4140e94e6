//! The tangent stiffness of a specimen that only measures: Broyden's update of the estimate with each target at which a client requests it.
//!
//! K ← K + (Δf − K Δx) (W Δx)ᵀ / (Δxᵀ W Δx), with W the diagonal of the estimate, so that displacements and rotations weigh by their
//! forces (Broyden 1965, Math. Comp. 19). For one axis this is the slope of the last step. A step that is too small changes nothing.

/// Part of the largest displacement so far that a step must have: less may be noise.
const LEAST_STEP: f64 = 1e-4;

/// The tangent of n axes, by columns.
#[derive(Debug)]
pub(super) struct UpdatedTangent {
    initial: Vec<f64>,
    columns: Vec<f64>,
    weights: Vec<f64>,
    /// Displacements and forces of the last step that counted.
    last: [Vec<f64>; 2],
    /// Largest √(xᵀ W x) so far.
    largest: f64,
    change: Vec<f64>,
    lacks: Vec<f64>,
}

impl UpdatedTangent {
    /// From the estimate, n × n by columns.
    pub(super) fn new(estimate: &[f64], n: usize) -> Self {
        let diagonal = (0..n).map(|i| estimate.get(i * n + i).copied().unwrap_or(0.0));
        Self {
            initial: estimate.to_vec(),
            columns: estimate.to_vec(),
            weights: diagonal.map(f64::abs).collect(),
            last: [vec![0.0; n], vec![0.0; n]],
            largest: 0.0,
            change: vec![0.0; n],
            lacks: vec![0.0; n],
        }
    }

    /// A test begins where the specimen measures this: the estimate counts again.
    pub(super) fn begin(&mut self, disp: &[f64], force: &[f64]) {
        self.columns.copy_from_slice(&self.initial);
        self.largest = 0.0;
        self.note(disp, force);
    }

    fn note(&mut self, disp: &[f64], force: &[f64]) {
        let [last_disp, last_force] = &mut self.last;
        last_disp.copy_from_slice(disp);
        last_force.copy_from_slice(force);
    }

    fn size(&self, of: &[f64]) -> f64 {
        let parts = of.iter().zip(&self.weights).map(|(x, w)| w * x * x);
        parts.sum::<f64>().sqrt()
    }

    /// The specimen measures this at a target. Real-time: yes.
    pub(super) fn take(&mut self, disp: &[f64], force: &[f64]) {
        let n = self.weights.len();
        let [last_disp, last_force] = &self.last;
        for (change, (now, before)) in self.change.iter_mut().zip(disp.iter().zip(last_disp)) {
            *change = now - before;
        }
        for (row, (lacks, (now, before))) in self
            .lacks
            .iter_mut()
            .zip(force.iter().zip(last_force))
            .enumerate()
        {
            let of_row = self.columns.iter().skip(row).step_by(n);
            let by: f64 = of_row.zip(&self.change).map(|(k, x)| k * x).sum();
            *lacks = now - before - by;
        }
        self.largest = self.largest.max(self.size(disp));
        let size = self.size(&self.change);
        if size <= LEAST_STEP * self.largest || !size.is_finite() {
            return;
        }
        let own = self.change.iter().zip(&self.weights);
        for (column, (change, weight)) in self.columns.chunks_exact_mut(n.max(1)).zip(own) {
            let share = weight * change / (size * size);
            for (k, lacks) in column.iter_mut().zip(&self.lacks) {
                *k += lacks * share;
            }
        }
        self.note(disp, force);
    }

    /// The tangent, by columns.
    pub(super) fn columns(&self) -> &[f64] {
        &self.columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_axis_has_the_slope_of_the_last_step() {
        let mut tangent = UpdatedTangent::new(&[100.0], 1);
        tangent.begin(&[0.0], &[0.0]);
        for (x, f, slope) in [
            (0.1, 10.0, 100.0),
            (0.2, 11.0, 10.0),
            (0.2 + 1e-6, 50.0, 10.0),
            (0.1, 1.0, 100.0),
        ] {
            tangent.take(&[x], &[f]);
            assert!((tangent.columns()[0] / slope - 1.0).abs() < 1e-9, "{x}");
        }
        tangent.begin(&[0.1], &[1.0]);
        assert_eq!(tangent.columns(), [100.0]);
    }

    /// Steps in n directions show a linear specimen whose stiffness is not the estimate.
    #[test]
    fn steps_in_all_directions_show_a_matrix() {
        let truth = [[50.0, -20.0], [-20.0, 3.0]];
        let mut tangent = UpdatedTangent::new(&[100.0, 0.0, 0.0, 4.0], 2);
        tangent.begin(&[0.0; 2], &[0.0; 2]);
        for k in 0..40 {
            let x = [
                libm::sin(0.7 * f64::from(k)),
                5.0 * libm::cos(1.3 * f64::from(k)),
            ];
            let f = truth.map(|[a, b]| a * x[0] + b * x[1]);
            tangent.take(&x, &f);
        }
        for (found, expected) in tangent.columns().iter().zip(truth.iter().flatten()) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }
}
