//! Sparse models: the effective mass of a plane frame and of a space grid, solved with one right-hand side.
//!
//! `tools/superlu` reads the matrices that `export` writes and times SciPy's SuperLU on them.

use std::fmt::Write as _;
use std::path::Path;

use gusset_control::engine::Side;
use gusset_evidence::frontier::Scalable;
use gusset_numerics::linalg::{Spd, SymMatrix};

use crate::timed;

/// M_eff = M + Δt²/4 K of the frame of `gusset jitter --model frame`: what a step of λ = 4 solves.
fn frame(n: usize) -> SymMatrix {
    let n = Scalable::Frame.size_near(n);
    let Ok(Side::Structure(numerical)) = Scalable::Frame.side(n, 1e-3, 1) else {
        panic!("no frame of {n}");
    };
    let structure = &numerical.structure;
    let stiffness = structure.reference_stiffness();
    structure.mass().plus(1e-6 / 4.0, &stiffness)
}

/// A cube of joints with three translations each, springs along edges and face diagonals: 3 side³ unknowns.
fn space_grid(side: usize) -> SymMatrix {
    let at = |p: [usize; 3]| 3 * ((p[2] * side + p[1]) * side + p[0]);
    let n = 3 * side * side * side;
    let (mass, k, dt) = (1.0e3, 5.0e8, 1e-3);
    let scale = dt * dt / 4.0 * k;
    let mut entries: Vec<_> = (0..n).map(|dof| (dof, dof, mass)).collect();
    let ways: [[i64; 3]; 9] = [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 1, 0],
        [1, -1, 0],
        [1, 0, 1],
        [1, 0, -1],
        [0, 1, 1],
        [0, 1, -1],
    ];
    for node in 0..side * side * side {
        let p = [node % side, node / side % side, node / side / side];
        for way in ways {
            let q = [0, 1, 2].map(|i| p[i] as i64 + way[i]);
            if q.iter().any(|c| *c < 0 || *c >= side as i64) {
                continue;
            }
            let (a, b) = (at(p), at(q.map(|c| c as usize)));
            let square: f64 = way.iter().map(|c| (c * c) as f64).sum();
            for i in 0..3 {
                for j in 0..3 {
                    let value = scale * (way[i] * way[j]) as f64 / square;
                    if i <= j {
                        entries.extend([(a + i, a + j, value), (b + i, b + j, value)]);
                    }
                    entries.push((a + i, b + j, -value));
                }
            }
        }
    }
    SymMatrix::from_triplets(n, entries)
}

/// Lower triangle in Matrix Market form, 17 digits.
fn export(folder: &Path, name: &str, matrix: &SymMatrix) -> std::io::Result<()> {
    let entries: Vec<_> = matrix.entries().collect();
    let mut text = format!(
        "%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n",
        entries.len(),
        n = matrix.n()
    );
    for (i, j, value) in entries {
        let _ = writeln!(text, "{} {} {value:.17e}", j + 1, i + 1);
    }
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join(format!("{name}.mtx")), text)
}

pub fn run(folder: Option<&Path>) {
    println!("\nSparse models, one solve; µs, p50\n");
    println!(
        "{:>14}{:>8}{:>11}{:>10}{:>11}{:>13}{:>11}",
        "model", "n", "stored", "storage", "ours", "bytes/solve", "GB/s"
    );
    for (name, matrix) in [
        ("plane-frame", frame(3 * 57 * 58)),
        ("space-grid", space_grid(15)),
    ] {
        if let Some(folder) = folder {
            export(folder, name, &matrix).expect("the folder takes the matrix");
        }
        let n = matrix.n();
        let mut factor = Spd::factor(&matrix).expect("definite");
        let rhs: Vec<f64> = (0..n).map(|i| ((7 * i + 3) % 11) as f64 - 5.0).collect();
        let mut x = rhs.clone();
        let (p50, _) = timed(100, |_| {
            x.copy_from_slice(&rhs);
            factor.solve_in_place(&mut x);
        });
        let mut left = rhs.clone();
        matrix.subtract_product(&x, &mut left);
        let worst = left.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        assert!(worst < 1e-11, "{worst}");
        let chosen = factor.storage();
        let bytes = factor.bytes();
        println!(
            "{name:>14}{n:>8}{:>11}{:>10}{p50:>11.1}{bytes:>13}{:>11.1}",
            matrix.stored(),
            chosen.to_string(),
            2.0 * bytes as f64 / (p50 * 1e3)
        );
    }
    println!(
        "goal: 1.5 x faster than SciPy's SuperLU on the same matrices: tools/superlu runs both and prints the ratio."
    );
}
