//! Factors against each other, against dense algebra and against closed forms.

use gusset_quantity::assert_is;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::*;

/// Fixed-free chain of unit springs with `extra` on the diagonal.
fn chain(n: usize, extra: f64) -> SymMatrix {
    let diagonal = (0..n).map(|i| (i, i, extra + if i + 1 < n { 2.0 } else { 1.0 }));
    SymMatrix::from_triplets(n, diagonal.chain((1..n).map(|i| (i - 1, i, -1.0))))
}

/// Five-point Laplacian on a `side` × `side` grid plus 0.1 I: sparse, wide band.
fn grid(side: usize) -> SymMatrix {
    let at = |i: usize, j: usize| i * side + j;
    let mut entries = Vec::new();
    for i in 0..side {
        for j in 0..side {
            entries.push((at(i, j), at(i, j), 4.1));
            if i + 1 < side {
                entries.push((at(i, j), at(i + 1, j), -1.0));
            }
            if j + 1 < side {
                entries.push((at(i, j), at(i, j + 1), -1.0));
            }
        }
    }
    SymMatrix::from_triplets(side * side, entries)
}

/// Same matrix with its indices scrambled by the permutation i → (a i + 1) mod n, gcd(a, n) = 1.
fn scrambled(matrix: &SymMatrix, a: usize) -> SymMatrix {
    let n = matrix.n();
    let to = |i: usize| (a * i + 1) % n;
    SymMatrix::from_triplets(n, matrix.entries().map(|(i, j, v)| (to(i), to(j), v)))
}

const ALL: [Storage; 6] = [
    Storage::Diagonal,
    Storage::Tridiagonal,
    Storage::Partitioned,
    Storage::Banded,
    Storage::Dense,
    Storage::Sparse,
];

fn right_hand_side(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((7 * i + 3) % 11) as f64 - 5.0).collect()
}

/// ‖b − A x‖∞ / (‖A‖∞ ‖x‖∞): the backward error, a few n·ε for a stable solve whatever the conditioning.
fn backward_error(matrix: &SymMatrix, x: &[f64], b: &[f64]) -> f64 {
    let mut residual = b.to_vec();
    matrix.subtract_product(x, &mut residual);
    let norm = (0..matrix.n())
        .map(|i| matrix.row(i).map(|(_, v)| v.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    largest(&residual) / (norm * largest(x) + largest(b)).max(f64::MIN_POSITIVE)
}

#[test]
fn each_shape_gets_the_storage_made_for_it() {
    let storage = |m: &SymMatrix| Spd::factor(m).unwrap().storage();
    assert_eq!(storage(&SymMatrix::diagonal(&[1.0; 50])), Storage::Diagonal);
    assert_eq!(storage(&chain(5000, 0.0)), Storage::Partitioned);
    assert_eq!(storage(&chain(50, 0.0)), Storage::Tridiagonal);
    // A chain numbered at random is narrow again after reordering.
    assert_eq!(storage(&scrambled(&chain(500, 0.1), 7)), Storage::Banded);
    let full = SymMatrix::from_triplets(
        12,
        (0..12).flat_map(|i| (i..12).map(move |j| (i, j, if i == j { 13.0 } else { 1.0 }))),
    );
    assert_eq!(storage(&full), Storage::Dense);
    assert_eq!(storage(&grid(40)), Storage::Sparse);
    assert_eq!(Storage::Sparse.to_string(), "sparse");
}

#[test]
fn every_storage_solves_every_size_of_chain() {
    for n in 1..=40 {
        let matrix = chain(n, 0.25);
        for storage in ALL {
            let mut factor = Spd::factor_as(&matrix, storage).unwrap();
            let b = right_hand_side(n);
            let mut x = b.clone();
            factor.solve_in_place(&mut x);
            assert!(
                backward_error(&matrix, &x, &b) < 4.0 * f64::EPSILON * (n as f64 + 4.0),
                "{storage} n = {n}"
            );
        }
    }
}

#[test]
fn fixed_free_chain_tip_has_closed_form() {
    // Unit springs, unit force at the tip: x_i = i + 1. Error bounded by condition 4n²/π² times ε, n = 1000.
    let mut factor = Spd::factor(&chain(1000, 0.0)).unwrap();
    let mut x = vec![0.0; 1000];
    x[999] = 1.0;
    factor.solve_in_place(&mut x);
    for (i, x) in x.iter().enumerate() {
        assert!((x - (i + 1) as f64).abs() < 4e5 * f64::EPSILON * 1000.0);
    }
}

#[test]
fn failing_dof_has_the_user_number() {
    // Two separate blocks; the only negative pivot is at the marked place, whatever the order of elimination.
    for bad in [0, 3, 17, 39] {
        let matrix = scrambled(&chain(40, 0.5), 9);
        let spoiled = matrix.plus(-5.0, &SymMatrix::from_triplets(40, [(bad, bad, 1.0)]));
        // An isolated degree of freedom: its pivot does not depend on the others.
        let isolated = SymMatrix::from_triplets(
            40,
            spoiled
                .entries()
                .filter(|&(i, j, _)| i == j || (i != bad && j != bad)),
        );
        for storage in ALL {
            let failure = Spd::factor_as(&isolated, storage).unwrap_err();
            assert_eq!(failure.dof, bad, "{storage}");
            assert!(
                (failure.pivot - isolated.get(bad, bad)).abs() < 1e-12,
                "{storage}"
            );
            assert!(failure.to_string().contains(&(bad + 1).to_string()));
        }
    }
}

#[test]
fn negative_pivot_is_reported() {
    // [[1, 2], [2, 1]] beside two healthy rows, full by small couplings of the first: pivot 2 is 1 − 4 = −3.
    let full = SymMatrix::from_triplets(
        4,
        [
            (0, 0, 1.0),
            (0, 1, 2.0),
            (1, 1, 1.0),
            (2, 2, 9.0),
            (3, 3, 9.0),
            (0, 2, 1.0),
            (0, 3, 1.0),
            (2, 3, 1.0),
        ],
    );
    let failure = Spd::factor_as(&full, Storage::Dense).unwrap_err();
    assert_eq!((failure.dof, failure.pivot), (1, -3.0));
    assert!(Spd::factor_as(&full, Storage::Sparse).is_err());
    assert!(Spd::factor_as(&full, Storage::Banded).is_err());
}

#[test]
fn sums_of_matrices_are_sums_of_entries() {
    let (a, b) = (chain(30, 0.3), scrambled(&chain(30, 1.0), 7));
    let sum = a.plus(-2.5, &b);
    assert!((sum.to_dense() - (a.to_dense() - b.to_dense() * 2.5)).amax() == 0.0);
    assert_eq!(sum, SymMatrix::from_dense(&sum.to_dense()).unwrap());
}

#[test]
fn all_storages_refuse_a_singular_matrix() {
    // Free-free: integer arithmetic makes the last pivot exactly zero.
    let mut entries: Vec<_> = chain(30, 0.0).entries().collect();
    entries.push((0, 0, -1.0));
    let free = SymMatrix::from_triplets(30, entries);
    for storage in ALL {
        assert!(Spd::factor_as(&free, storage).is_err(), "{storage}");
    }
    assert!(Spd::factor(&SymMatrix::diagonal(&[1.0, f64::NAN])).is_err());
    assert!(Spd::factor(&SymMatrix::diagonal(&[1.0, 0.0])).is_err());
}

#[test]
fn solving_allocates_nothing() {
    let matrix = grid(12);
    for (matrix, storage) in [
        (SymMatrix::diagonal(&[2.0; 144]), Storage::Diagonal),
        (chain(144, 0.1), Storage::Tridiagonal),
        (matrix.clone(), Storage::Banded),
        (matrix.clone(), Storage::Dense),
        (matrix, Storage::Sparse),
    ] {
        let mut factor = Spd::factor_as(&matrix, storage).unwrap();
        assert_eq!(factor.storage(), storage);
        let mut x = right_hand_side(144);
        let counted = allocation_counter::measure(|| {
            factor.solve_in_place(&mut x);
            matrix.subtract_product(&right_hand_side_on_stack(), &mut x);
        });
        assert_eq!(counted.count_total, 0, "{storage}");
    }
}

fn right_hand_side_on_stack() -> [f64; 144] {
    std::array::from_fn(|i| i as f64)
}

#[test]
fn bad_entries_are_named() {
    let refused = |m: DMatrix<f64>| SymMatrix::from_dense(&m).unwrap_err();
    assert_is!(refused(DMatrix::zeros(2, 3)) => MatrixError::NotSquare { rows: 2, columns: 3 });
    let mut matrix = DMatrix::identity(3, 3);
    matrix[(0, 2)] = 0.5;
    let mirrored = refused(matrix.clone());
    assert_is!(mirrored => MatrixError::Asymmetric { row: 0, column: 2, here: 0.5, there: 0.0 });
    // Users count from 1.
    assert!(mirrored.to_string().contains("(1, 3)"), "{mirrored}");
    matrix[(2, 0)] = 0.5 + 1e-8;
    assert_is!(refused(matrix.clone()) => MatrixError::Asymmetric { there: 0.500_000_01, .. });
    matrix[(2, 0)] = 0.5 + 1e-12;
    let accepted = SymMatrix::from_dense(&matrix).unwrap();
    assert_eq!(accepted.get(0, 2), accepted.get(2, 0));
    assert!((accepted.get(0, 2) - 0.5 - 5e-13).abs() < 1e-16);
    matrix[(1, 1)] = f64::NAN;
    assert_is!(refused(matrix) => MatrixError::NotFinite { row: 1, column: 1, .. });
}

#[test]
fn duplicates_add_and_zeros_are_dropped() {
    let matrix = SymMatrix::from_triplets(
        3,
        [
            (0, 1, 1.0),
            (1, 0, 2.0),
            (2, 2, 4.0),
            (2, 2, 0.5),
            (0, 2, 3.0),
            (2, 0, -3.0),
        ],
    );
    assert_eq!(matrix.get(0, 1), 3.0);
    assert_eq!(matrix.get(1, 0), 3.0);
    assert_eq!(matrix.get(2, 2), 4.5);
    assert_eq!(
        matrix.entries().collect::<Vec<_>>(),
        [(0, 1, 3.0), (2, 2, 4.5)]
    );
    assert_eq!(matrix.half_bandwidth(), 1);
    assert!(matrix.plus(-1.0, &matrix).is_zero());
    assert_eq!(matrix.block(&[1, 0]).get(0, 1), 3.0);
}

#[test]
fn two_mass_frequencies_match_closed_form() {
    // ω² of [[k1+k2, −k2], [−k2, k2]] with m1, m2: roots of m1 m2 s² − (m2 (k1+k2) + m1 k2) s + k1 k2 = 0.
    // Values of example 4.1 of Gui et al. 2014.
    let (m1, m2, k1, k2) = (1e3, 4e3, 2e6, 1e5);
    let mass = SymMatrix::diagonal(&[m1, m2]);
    let stiffness = SymMatrix::from_triplets(2, [(0, 0, k1 + k2), (1, 1, k2), (0, 1, -k2)]);
    let (a, b, c): (f64, f64, f64) = (m1 * m2, m2 * (k1 + k2) + m1 * k2, k1 * k2);
    let high = (b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
    let low = c / (a * high);
    let found = frequencies(&stiffness, &mass, 9).unwrap();
    assert!((found[0] / low.sqrt() - 1.0).abs() < 1e-13);
    assert!((found[1] / high.sqrt() - 1.0).abs() < 1e-13);
    assert!((found[0] - 4.88).abs() < 0.005 && (found[1] - 45.84).abs() < 0.005);
    let highest = highest_frequency(&stiffness, &mass).unwrap();
    assert!((highest / high.sqrt() - 1.0).abs() < 1e-9);
}

#[test]
fn chain_frequencies_match_closed_form() {
    // Fixed-free chain of unit masses and springs: ω_j = 2 sin((2j − 1) π / (2 (2n + 1))).
    for n in [30, 250, 5000] {
        let mass = SymMatrix::diagonal(&vec![1.0; n]);
        let found = frequencies(&chain(n, 0.0), &mass, 3).unwrap();
        for (j, found) in found.iter().enumerate() {
            let angle = (2 * j + 1) as f64 * std::f64::consts::PI / (2 * (2 * n + 1)) as f64;
            let exact = 2.0 * libm::sin(angle);
            // ω² carries an absolute error of about ε ‖K‖: relative 4ε/ω² (ω² = 1e-7 at n = 5000).
            assert!(
                (found / exact - 1.0).abs() < 1e-7,
                "n = {n}: {found} against {exact}"
            );
        }
    }
}

#[test]
fn free_body_has_zero_massless_is_condensed() {
    // Two masses 2 and 3 joined by springs 4 and 12 in series through a massless joint: k = 3,
    // ω² = k (1/2 + 1/3) = 2.5.
    let mass = SymMatrix::diagonal(&[2.0, 0.0, 3.0]);
    let stiffness = SymMatrix::from_triplets(
        3,
        [
            (0, 0, 4.0),
            (0, 1, -4.0),
            (1, 1, 16.0),
            (1, 2, -12.0),
            (2, 2, 12.0),
        ],
    );
    let found = modes(&stiffness, &mass).unwrap();
    assert_eq!(found.frequencies.len(), 2);
    assert_eq!(found.frequencies[0], 0.0);
    assert!((found.frequencies[1] - 2.5f64.sqrt()).abs() < 1e-14);
    // The joint follows: 4 (x1 − x0) + 12 (x1 − x2) = 0.
    for j in 0..2 {
        let x = found.shapes.column(j);
        assert!((16.0 * x[1] - 4.0 * x[0] - 12.0 * x[2]).abs() < 1e-13);
    }
    assert_eq!(highest_frequency(&stiffness, &mass), None);
    let loose = SymMatrix::from_triplets(3, [(0, 0, 4.0), (2, 2, 1.0)]);
    assert!(matches!(modes(&loose, &mass), Err(EigenError::Massless(e)) if e.dof == 1));
    let falling = SymMatrix::diagonal(&[-1.0, 1.0, 1.0]);
    assert!(
        matches!(modes(&falling, &mass), Err(EigenError::Negative { squared }) if (squared + 0.5).abs() < 1e-15)
    );
    let heavy = SymMatrix::from_triplets(2, [(0, 0, 1.0), (0, 1, 2.0), (1, 1, 1.0)]);
    assert!(
        matches!(modes(&SymMatrix::diagonal(&[1.0, 1.0]), &heavy), Err(EigenError::Mass(e)) if e.dof == 1)
    );
}

#[test]
fn free_chain_has_one_zero_frequency() {
    let n = 400;
    let mut entries: Vec<_> = chain(n, 0.0).entries().collect();
    entries.push((0, 0, -1.0));
    let stiffness = SymMatrix::from_triplets(n, entries);
    let mass = SymMatrix::diagonal(&vec![1.0; n]);
    let found = frequencies(&stiffness, &mass, 4).unwrap();
    assert_eq!(found[0], 0.0);
    for (j, found) in found.iter().enumerate().skip(1) {
        let exact = 2.0 * libm::sin(j as f64 * std::f64::consts::PI / (2 * n) as f64);
        assert!((found / exact - 1.0).abs() < 1e-9);
    }
}

/// A random symmetric positive definite matrix: random pattern, diagonally dominant by a random margin.
fn random_spd() -> impl Strategy<Value = SymMatrix> {
    (1usize..40).prop_flat_map(|n| {
        let entries = proptest::collection::vec((0..n, 0..n, -1.0f64..1.0), 0..3 * n);
        (entries, 1e-3f64..10.0).prop_map(move |(entries, margin)| {
            let off: Vec<_> = entries.into_iter().filter(|&(i, j, _)| i != j).collect();
            let dominance = off
                .iter()
                .flat_map(|&(i, j, v)| [(i, i, v.abs()), (j, j, v.abs())]);
            let floor = (0..n).map(|i| (i, i, margin));
            SymMatrix::from_triplets(n, off.iter().copied().chain(dominance).chain(floor))
        })
    })
}

proptest! {
    #[test]
    fn all_storages_match_dense_elimination(matrix in random_spd()) {
        let n = matrix.n();
        let b = right_hand_side(n);
        let exact = matrix.to_dense().lu().solve(&DVector::from_vec(b.clone())).unwrap();
        // Dominance bounds the inverse by 1/margin ≤ 1e3 and the norm by about 1e2: condition ≤ 1e5.
        let tolerance = 1e5 * 40.0 * f64::EPSILON * exact.amax().max(1e-3);
        for storage in ALL {
            let mut factor = Spd::factor_as(&matrix, storage).unwrap();
            let mut x = b.clone();
            factor.solve_in_place(&mut x);
            for (x, exact) in x.iter().zip(exact.iter()) {
                prop_assert!((x - exact).abs() <= tolerance, "{}: {} against {}", storage, x, exact);
            }
            let mut again = b.clone();
            factor.solve_in_place(&mut again);
            prop_assert!(x.iter().zip(&again).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn products_agree_with_dense_products(matrix in random_spd()) {
        let x = right_hand_side(matrix.n());
        let dense = matrix.to_dense() * DVector::from_vec(x.clone());
        let mut out = vec![0.0; x.len()];
        matrix.subtract_product(&x, &mut out);
        for (a, b) in out.iter().zip(dense.iter()) {
            prop_assert!((a + b).abs() < 1e-11);
        }
        let quadratic: f64 = x.iter().zip(dense.iter()).map(|(a, b)| a * b).sum();
        prop_assert!((matrix.quadratic(&x) - quadratic).abs() < 1e-9);
        let back = SymMatrix::from_dense(&matrix.to_dense()).unwrap();
        prop_assert_eq!(back, matrix);
    }

    #[test]
    fn modes_match_an_independent_eigensolver(stiffness in random_spd(), seed in 0u64..1000) {
        let n = stiffness.n();
        let masses: Vec<f64> = (0..n).map(|i| 1.0 + ((i as u64 * 37 + seed) % 17) as f64).collect();
        let mass = SymMatrix::diagonal(&masses);
        let found = modes(&stiffness, &mass).unwrap();
        let scaled = DMatrix::from_fn(n, n, |i, j| stiffness.get(i, j) / (masses[i] * masses[j]).sqrt());
        let mut values: Vec<f64> = scaled.symmetric_eigen().eigenvalues.iter().copied().collect();
        values.sort_by(f64::total_cmp);
        for (omega, squared) in found.frequencies.iter().zip(&values) {
            prop_assert!((omega * omega - squared).abs() < 1e-11 * (1.0 + values[n - 1]));
        }
        let m = mass.to_dense();
        let gram = found.shapes.transpose() * &m * &found.shapes;
        prop_assert!((gram - DMatrix::identity(n, n)).amax() < 1e-11);
    }
}

#[test]
fn sparse_factor_is_equal_on_all_lanes() {
    let matrix = scrambled(&grid(23), 13);
    let b = right_hand_side(matrix.n());
    let solve = |lanes: Lanes| {
        let mut factor = Spd::factor_as(&matrix, Storage::Sparse).unwrap();
        factor.set_lanes(lanes);
        let mut x = b.clone();
        factor.solve_in_place(&mut x);
        x.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    for lanes in Lanes::available() {
        assert_eq!(solve(lanes), solve(Lanes::Portable), "{lanes}");
    }
}

#[test]
fn panels_of_every_shape_solve() {
    // From separate entries over bands and arrows to a full matrix: wide and narrow panels, with and without rows below.
    let arrow = |n: usize| {
        let spokes = (1..n).map(move |i| (0, i, -1.0));
        SymMatrix::from_triplets(n, (0..n).map(|i| (i, i, n as f64)).chain(spokes))
    };
    let full = |n: usize| {
        let pairs = (0..n).flat_map(move |i| (i + 1..n).map(move |j| (i, j, -0.5)));
        SymMatrix::from_triplets(n, (0..n).map(|i| (i, i, n as f64)).chain(pairs))
    };
    let band = |n: usize, b: usize| {
        let pairs =
            (0..n).flat_map(move |i| (i + 1..(i + b + 1).min(n)).map(move |j| (i, j, -1.0)));
        SymMatrix::from_triplets(n, (0..n).map(|i| (i, i, 2.0 * b as f64 + 1.0)).chain(pairs))
    };
    for matrix in [
        arrow(70),
        full(97),
        full(33),
        band(200, 9),
        band(50, 33),
        grid(19),
    ] {
        let b = right_hand_side(matrix.n());
        let mut factor = Spd::factor_as(&matrix, Storage::Sparse).unwrap();
        let mut x = b.clone();
        factor.solve_in_place(&mut x);
        let error = backward_error(&matrix, &x, &b);
        assert!(
            error < 32.0 * f64::EPSILON,
            "{error:e} for n = {}",
            matrix.n()
        );
    }
}
