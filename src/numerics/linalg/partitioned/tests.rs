//! The partitioned factor against dense algebra, against the other tridiagonal factor, and against itself on other lanes.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::{LENGTHS, Partitioned, SEGMENTS};
use crate::linalg::{Lanes, Spd, Storage, SymMatrix};

/// A chain of springs `link` with a spring to the ground at each mass: dominance by `ground`/`link`.
fn chain(links: &[f64], ground: &[f64]) -> SymMatrix {
    let n = ground.len();
    let mut entries: Vec<_> = ground.iter().enumerate().map(|(i, g)| (i, i, *g)).collect();
    for (i, k) in links.iter().enumerate().take(n.saturating_sub(1)) {
        entries.extend([(i, i, *k), (i + 1, i + 1, *k), (i, i + 1, -k)]);
    }
    SymMatrix::from_triplets(n, entries)
}

fn uniform(n: usize, ground: f64) -> SymMatrix {
    chain(&vec![1.0; n], &vec![ground; n])
}

fn right_hand_side(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((7 * i + 3) % 11) as f64 - 5.0).collect()
}

fn solved(factor: &mut Partitioned, b: &[f64]) -> Vec<f64> {
    let mut x = b.to_vec();
    factor.solve_in_place(&mut x);
    x
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}

/// ‖b − A x‖ / (‖A‖ ‖x‖ + ‖b‖): a few ε for a stable solve, whatever the condition.
fn backward_error(matrix: &SymMatrix, x: &[f64], b: &[f64]) -> f64 {
    let mut residual = b.to_vec();
    matrix.subtract_product(x, &mut residual);
    let norm = (0..matrix.n())
        .map(|i| matrix.row(i).map(|(_, v)| v.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    largest(&residual) / (norm * largest(x) + largest(b)).max(f64::MIN_POSITIVE)
}

#[test]
fn sizes_near_tile_bounds_are_solved() {
    // Rows per tile of the shortest length: 640. Sizes about blocks, segments and tiles, with fill that dies out within
    // a segment (ground = 1) and fill that never does (ground = 1e-6).
    let edges = [
        1, 2, 3, 7, 8, 9, 15, 16, 17, 39, 40, 41, 63, 64, 65, 127, 128, 129,
    ];
    let long = [
        319, 320, 321, 599, 600, 601, 639, 640, 641, 1279, 1280, 1281, 1319, 1921,
    ];
    for n in edges.into_iter().chain(long) {
        for ground in [1.0, 1e-2, 1e-6] {
            let matrix = uniform(n, ground);
            let b = right_hand_side(n);
            let mut factor = Partitioned::factor(&matrix).unwrap();
            let error = backward_error(&matrix, &solved(&mut factor, &b), &b);
            assert!(
                error < 16.0 * f64::EPSILON,
                "n = {n}, ground = {ground}: {error:e}"
            );
        }
    }
}

#[test]
fn segment_is_as_long_as_the_fill() {
    // Per row the fill falls to ρ = 1 + g/2 − √(g + g²/4) (g = ground/link); 64 binary digits take 44.4/|ln ρ| rows.
    for (ground, length) in [(1.5, LENGTHS[0]), (0.2, LENGTHS[1]), (0.05, LENGTHS[2])] {
        let g: f64 = ground;
        let decay = 1.0 + g / 2.0 - (g + g * g / 4.0).sqrt();
        assert!(
            44.4 / -libm::log(decay) < length as f64,
            "the premise for {g}"
        );
        let factor = Partitioned::factor(&uniform(20_000, g)).unwrap();
        assert_eq!(factor.length, length);
        assert!(factor.interfaces.multiplier.is_empty());
        assert_eq!(factor.swept.len(), 2);
    }
    // No length is enough: the interfaces see each other.
    let factor = Partitioned::factor(&uniform(20_000, 1e-6)).unwrap();
    assert_eq!(
        factor.interfaces.multiplier.len(),
        factor.of_tile.len() * SEGMENTS
    );
}

#[test]
fn inner_tiles_of_uniform_chains_are_shared() {
    let factor = Partitioned::factor(&uniform(100_000, 1.5)).unwrap();
    assert_eq!(factor.of_tile.len(), 157);
    assert_eq!(factor.coefficients.len(), 3);
    // Less than half a byte per row: 3 tiles of 640 rows with at most three numbers each, and the interfaces.
    assert!(factor.bytes() < 3 * 640 * 24 + 157 * 128 + 1);
}

#[test]
fn all_lanes_give_the_same_bits() {
    for (n, ground) in [(641, 1.0), (5000, 1.5), (5000, 1e-3), (3001, 1e-6)] {
        let links: Vec<f64> = (0..n).map(|i| 1.0 + ((i * 37) % 11) as f64 / 7.0).collect();
        let grounds: Vec<f64> = (0..n).map(|i| ground * (1.0 + (i % 5) as f64)).collect();
        let mut factor = Partitioned::factor(&chain(&links, &grounds)).unwrap();
        let b = right_hand_side(n);
        factor.set_lanes(Lanes::Portable);
        let wanted = solved(&mut factor, &b);
        for lanes in Lanes::available() {
            factor.set_lanes(lanes);
            let found = solved(&mut factor, &b);
            let same = found
                .iter()
                .zip(&wanted)
                .all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same, "{lanes}, n = {n}, ground = {ground}");
        }
    }
}

#[test]
fn rows_are_handed_over_once_in_order() {
    for (n, ground) in [(1, 1.0), (640, 1.0), (2000, 1.0), (2000, 1e-6)] {
        let matrix = uniform(n, ground);
        let b = right_hand_side(n);
        for storage in [Storage::Partitioned, Storage::Banded] {
            let mut factor = Spd::factor_as(&matrix, storage).unwrap();
            let mut wanted = b.clone();
            factor.solve_in_place(&mut wanted);
            let (mut x, mut handed) = (vec![f64::NAN; n], Vec::new());
            factor.solve_into(&b, &mut x, |rows, values| {
                assert_eq!((rows.start, rows.len()), (handed.len(), values.len()));
                handed.extend_from_slice(values);
            });
            assert_eq!(x, wanted);
            assert_eq!(handed, wanted);
        }
    }
}

#[test]
fn bad_pivot_is_named_anywhere() {
    // Without links each pivot is its own diagonal entry: inside a segment, at an interface, at the ends.
    for bad in [0, 38, 39, 40, 639, 640, 1999] {
        let mut ground = vec![1.0; 2000];
        ground[bad] = -2.0;
        let failure = Partitioned::factor(&chain(&[], &ground)).unwrap_err();
        assert_eq!((failure.dof, failure.pivot), (bad, -2.0));
    }
    // Indefinite as a whole only: every 2 × 2 block is definite, the chain is not.
    let n = 2000;
    let matrix = uniform(n, 0.0).plus(-1e-4, &SymMatrix::diagonal(&vec![1.0; n]));
    assert!(Partitioned::factor(&matrix).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Random definite chains, sizes about the multiples of a segment and tiny ones, against dense Cholesky.
    #[test]
    fn random_chains_match_dense_algebra(
        multiple in 0usize..18,
        off in -2i64..3,
        exponent in -4.0f64..1.0,
        seed in 0u64..1_000_000,
    ) {
        let n = (40 * multiple as i64 + off).max(1) as usize;
        let mut state = seed;
        let mut random = || {
            // A step of a linear congruence; its high bits are enough for coefficients.
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        let links: Vec<f64> = (0..n).map(|_| 0.1 + random()).collect();
        let ground: Vec<f64> = (0..n).map(|_| libm::pow(10.0, exponent) * (0.01 + random())).collect();
        let b: Vec<f64> = (0..n).map(|_| random() - 0.5).collect();
        let matrix = chain(&links, &ground);
        let mut factor = Partitioned::factor(&matrix).unwrap();
        let x = solved(&mut factor, &b);
        prop_assert!(backward_error(&matrix, &x, &b) < 16.0 * f64::EPSILON);
        // Forward error: condition times ε. All eigenvalues lie between the least ground spring and 4·1.1 + 10.
        let dense: DMatrix<f64> = matrix.to_dense();
        let wanted = dense.cholesky().unwrap().solve(&DVector::from_vec(b));
        let condition = 15.0 / (libm::pow(10.0, exponent) * 0.01);
        let bound = 64.0 * f64::EPSILON * condition * largest(wanted.as_slice());
        for (x, wanted) in x.iter().zip(wanted.iter()) {
            prop_assert!((x - wanted).abs() <= bound);
        }
    }
}
