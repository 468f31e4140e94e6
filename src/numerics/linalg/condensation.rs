//! Static condensation (R. J. Guyan 1965, AIAA Journal 3(2), 380): rows without a load follow the others.

use super::{NotPositiveDefinite, Spd, SymMatrix};

/// A matrix A whose rows `gone` follow the rows `kept`: x_g = −A_gg⁻¹ A_gk x_k.
#[derive(Debug)]
pub struct Condensation {
    kept: Vec<usize>,
    gone: Vec<usize>,
    matrix: SymMatrix,
    factor: Spd,
    work: Vec<f64>,
}

impl Condensation {
    /// For `matrix` (n × n), of which the rows `gone` follow, rising from 0.
    ///
    /// # Errors
    /// The block of these rows is not positive definite; the degree of freedom is one of `matrix`.
    pub fn new(matrix: &SymMatrix, gone: &[usize]) -> Result<Self, NotPositiveDefinite> {
        let factor = Spd::factor(&matrix.block(gone)).map_err(|failure| NotPositiveDefinite {
            dof: gone.get(failure.dof).copied().unwrap_or(failure.dof),
            ..failure
        })?;
        let is_kept = |row: &usize| gone.binary_search(row).is_err();
        Ok(Self {
            kept: (0..matrix.n()).filter(is_kept).collect(),
            gone: gone.to_vec(),
            matrix: matrix.clone(),
            factor,
            work: vec![0.0; gone.len()],
        })
    }

    /// The rows that remain, rising.
    #[must_use]
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// x_g ← −A_gg⁻¹ A_gk x_k; `x` has n entries. Real-time: yes.
    pub fn follow(&mut self, x: &mut [f64]) {
        for &row in &self.gone {
            if let Some(x) = x.get_mut(row) {
                *x = 0.0;
            }
        }
        for (to, &row) in self.work.iter_mut().zip(&self.gone) {
            let terms = self.matrix.row(row);
            *to = -terms
                .map(|(column, a)| a * x.get(column).copied().unwrap_or(f64::NAN))
                .sum::<f64>();
        }
        self.factor.solve_in_place(&mut self.work);
        for (from, &row) in self.work.iter().zip(&self.gone) {
            if let Some(x) = x.get_mut(row) {
                *x = *from;
            }
        }
    }

    /// A_kk − A_kg A_gg⁻¹ A_gk.
    #[must_use]
    pub fn complement(&mut self) -> SymMatrix {
        self.seen_by(&self.matrix.clone())
    }

    /// Tᵀ `other` T, where x = T x_k: what the rows that remain see of another matrix (n × n).
    #[must_use]
    pub fn seen_by(&mut self, other: &SymMatrix) -> SymMatrix {
        let n = self.matrix.n();
        let mut place = vec![usize::MAX; n];
        for (at, &row) in self.kept.iter().enumerate() {
            place[row] = at;
        }
        let kept = self.kept.clone();
        // Columns of T with more than their own one.
        let mut follows = vec![false; n];
        for &row in &self.gone {
            self.matrix
                .row(row)
                .for_each(|(column, _)| follows[column] = true);
        }
        let mut entries = Vec::new();
        let mut shape = vec![0.0; n];
        for &column in &kept {
            shape.fill(0.0);
            shape[column] = 1.0;
            if follows[column] {
                self.follow(&mut shape);
            }
            let (mut product, mut through) = (vec![0.0; n], vec![0.0; n]);
            other.subtract_product(&shape, &mut product);
            self.pull(&product, &mut through);
            for &row in kept.iter().filter(|row| **row >= column) {
                let value = -(product[row] + through[row]);
                if value != 0.0 {
                    entries.push((place[column], place[row], value));
                }
            }
        }
        SymMatrix::from_triplets(self.kept.len(), entries)
    }

    /// `out_k` ← −A_kg A_gg⁻¹ p_g: what a force on the rows that follow does to the others.
    fn pull(&mut self, force: &[f64], out: &mut [f64]) {
        for (to, &row) in self.work.iter_mut().zip(&self.gone) {
            *to = force.get(row).copied().unwrap_or(f64::NAN);
        }
        self.factor.solve_in_place(&mut self.work);
        for (from, &row) in self.work.iter().zip(&self.gone) {
            for (column, a) in self.matrix.row(row) {
                if let Some(out) = out.get_mut(column) {
                    *out -= a * from;
                }
            }
        }
    }

    /// bᵀ T for a row b: entries (row that remains, counted among those that remain, coefficient).
    #[must_use]
    pub fn row(&mut self, entries: &[(usize, f64)]) -> Vec<(usize, f64)> {
        let n = self.matrix.n();
        let (mut whole, mut through) = (vec![0.0; n], vec![0.0; n]);
        for &(row, b) in entries {
            if let Some(whole) = whole.get_mut(row) {
                *whole += b;
            }
        }
        self.pull(&whole, &mut through);
        let kept = self.kept.iter().enumerate();
        kept.map(|(place, &row)| (place, whole[row] + through[row]))
            .filter(|(_, b)| *b != 0.0)
            .collect()
    }
}
