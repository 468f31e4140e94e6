//! Least squares over a moving window, without going through the window.
//!
//! Sums are updated by adding each new row and subtracting each old one. A second set of sums restarts with every window
//! and replaces the first when it holds exactly the window. So roundoff grows over one window only.

use gusset_quantity::state;

/// Most unknowns.
const MOST: usize = 4;
/// Weight of the present coefficients, as a share of the scaled sums.
const PULL: f64 = 1e-3;

#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// φ φᵀ, lower triangle by rows.
    matrix: [[f64; MOST]; MOST],
    right: [f64; MOST],
}

state! { Sums { matrix, right } }

impl Sums {
    fn add(&mut self, row: &[f64; MOST + 1], sign: f64) {
        let (phi, u) = (&row[..MOST], row[MOST]);
        for (i, (entries, right)) in self.matrix.iter_mut().zip(&mut self.right).enumerate() {
            let value = sign * phi[i];
            for (entry, other) in entries.iter_mut().zip(phi).take(i + 1) {
                *entry += value * other;
            }
            *right += value * u;
        }
    }
}

/// A window of this many rows (φ, u).
#[derive(Debug, Clone)]
pub(super) struct Window {
    rows: Vec<[f64; MOST + 1]>,
    next: usize,
    full: bool,
    sums: Sums,
    fresh: Sums,
}

state! { Window { next: index(rows.len()), full, sums, fresh, rows } }

impl Window {
    pub(crate) fn new(rows: usize) -> Self {
        Self {
            rows: vec![[0.0; MOST + 1]; rows.max(1)],
            next: 0,
            full: false,
            sums: Sums::default(),
            fresh: Sums::default(),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.next = 0;
        self.full = false;
        self.sums = Sums::default();
        self.fresh = Sums::default();
    }

    /// Real-time: yes.
    pub(crate) fn push(&mut self, phi: [f64; MOST], u: f64) {
        let row = [phi[0], phi[1], phi[2], phi[3], u];
        if let Some(place) = self.rows.get_mut(self.next) {
            if self.full {
                self.sums.add(place, -1.0);
            }
            *place = row;
        }
        self.sums.add(&row, 1.0);
        self.fresh.add(&row, 1.0);
        self.next += 1;
        if self.next == self.rows.len() {
            self.next = 0;
            self.full = true;
            self.sums = self.fresh;
            self.fresh = Sums::default();
        }
    }

    /// Mean of φ₀² over a whole window; 0 before the first.
    pub(crate) fn mean_square(&self) -> f64 {
        if self.full {
            self.sums.matrix[0][0] / self.rows.len() as f64
        } else {
            0.0
        }
    }

    /// The first `n` coefficients that fit best, drawn a little towards `present`; `None` where nothing is to be fitted.
    /// Real-time: yes.
    pub(crate) fn solve(&self, n: usize, present: &[f64]) -> Option<[f64; MOST]> {
        let mut size = [1.0; MOST];
        for (i, size) in size.iter_mut().enumerate().take(n) {
            *size = self.sums.matrix[i][i].sqrt();
            if !(size.is_finite() && *size > 0.0) {
                return None;
            }
        }
        // Scaled to a unit diagonal; Cholesky in place.
        let mut l = [[0.0; MOST]; MOST];
        let mut x = [0.0; MOST];
        for i in 0..n {
            x[i] = self.sums.right[i] / size[i] + PULL * present.get(i)? * size[i];
            for j in 0..=i {
                let mut sum = self.sums.matrix[i][j] / (size[i] * size[j]);
                if i == j {
                    sum += PULL;
                }
                for (a, b) in l[i].iter().zip(&l[j]).take(j) {
                    sum -= a * b;
                }
                l[i][j] = if i == j {
                    // Positive but for roundoff: the pull is on the diagonal.
                    sum.max(0.1 * PULL).sqrt()
                } else {
                    sum / l[j][j]
                };
            }
        }
        for i in 0..n {
            for k in 0..i {
                x[i] -= l[i][k] * x[k];
            }
            x[i] /= l[i][i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                x[i] -= l[k][i] * x[k];
            }
            x[i] /= l[i][i];
        }
        for (x, size) in x.iter_mut().zip(size).take(n) {
            *x /= size;
        }
        Some(x)
    }
}
