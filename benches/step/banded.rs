//! Banded models: the solve of one step beside a straightforward banded Cholesky solve.

use gusset_numerics::linalg::{Spd, SymMatrix};

use crate::{timed, verdict};

const N: usize = 5000;
/// ms.
const GOAL: f64 = 0.2;

/// Springs between all pairs within half bandwidth `b`, and to the ground.
fn model(b: usize) -> SymMatrix {
    let mut entries = Vec::new();
    for i in 0..N {
        entries.push((i, i, 1.0));
        for j in i + 1..(i + b + 1).min(N) {
            let k = 1.0 / (j - i) as f64;
            entries.extend([(i, i, k), (j, j, k), (i, j, -k)]);
        }
    }
    SymMatrix::from_triplets(N, entries)
}

/// L of A = L Lᵀ by rows of b + 1 entries, the textbook's loops.
struct Plain {
    b: usize,
    rows: Vec<f64>,
}

impl Plain {
    fn factor(matrix: &SymMatrix, b: usize) -> Self {
        let at = |i: usize, j: usize| i * (b + 1) + (j + b - i);
        let mut rows = vec![0.0; N * (b + 1)];
        for i in 0..N {
            for j in i.saturating_sub(b)..=i {
                let mut sum = matrix.get(i, j);
                for k in i.saturating_sub(b)..j {
                    if j - k <= b {
                        sum -= rows[at(i, k)] * rows[at(j, k)];
                    }
                }
                rows[at(i, j)] = if i == j {
                    sum.sqrt()
                } else {
                    sum / rows[at(j, j)]
                };
            }
        }
        Self { b, rows }
    }

    fn solve(&self, x: &mut [f64]) {
        let b = self.b;
        for i in 0..N {
            let row = &self.rows[i * (b + 1)..(i + 1) * (b + 1)];
            let first = i.saturating_sub(b);
            let mut sum = x[i];
            for j in first..i {
                sum -= row[j + b - i] * x[j];
            }
            x[i] = sum / row[b];
        }
        for i in (0..N).rev() {
            let row = &self.rows[i * (b + 1)..(i + 1) * (b + 1)];
            let first = i.saturating_sub(b);
            x[i] /= row[b];
            for j in first..i {
                x[j] -= row[j + b - i] * x[i];
            }
        }
    }
}

pub fn run() {
    println!("\nBanded models, n = {N}, one solve; ms, p50\n");
    println!(
        "{:>15}{:>10}{:>10}{:>10}{:>8}{:>8}  goal",
        "half bandwidth", "storage", "ours", "plain", "ratio", "goal"
    );
    for b in [8, 32] {
        let matrix = model(b);
        let mut factor = Spd::factor(&matrix).expect("definite");
        let rhs: Vec<f64> = (0..N).map(|i| ((7 * i + 3) % 11) as f64 - 5.0).collect();
        let (mut x, mut y) = (rhs.clone(), rhs.clone());
        let (ours, _) = timed(400, |_| {
            x.copy_from_slice(&rhs);
            factor.solve_in_place(&mut x);
        });
        let plain = Plain::factor(&matrix, b);
        let (theirs, _) = timed(400, |_| {
            y.copy_from_slice(&rhs);
            plain.solve(&mut y);
        });
        let apart = x
            .iter()
            .zip(&y)
            .fold(0.0, |m: f64, (x, y)| m.max((x - y).abs()));
        assert!(apart < 1e-11, "{apart}");
        let chosen = factor.storage();
        println!(
            "{b:>15}{:>10}{:>10.4}{:>10.4}{:>7.2}x{GOAL:>8}  {}",
            chosen.to_string(),
            ours * 1e-3,
            theirs * 1e-3,
            theirs / ours,
            verdict(ours * 1e-3, GOAL)
        );
    }
}
