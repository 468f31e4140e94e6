use nalgebra::ComplexField as _;
use std::f64::consts::TAU;

use rand::{RngExt as _, SeedableRng as _, rngs::Xoshiro256PlusPlus};

use super::*;

fn cyclic(n: usize, size: f64) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| if i == (j + 1) % n { size } else { 0.0 })
}

fn largest(all: &[Pole]) -> f64 {
    all.iter().map(|z| z.modulus()).fold(0.0, f64::max)
}

/// Largest distance of two sets of as many poles, each with the nearest that is left.
fn distance(one: &[Pole], other: &[Pole]) -> f64 {
    assert_eq!(one.len(), other.len());
    let mut left = other.to_vec();
    one.iter().fold(0.0, |most, pole| {
        let away = left
            .iter()
            .map(|other| (pole - other).modulus())
            .enumerate();
        let (index, away) = away.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        left.swap_remove(index);
        away.max(most)
    })
}

/// Kinds of [`drawn`].
const KINDS: usize = 7;

/// A matrix of one of the kinds that come up, or of those that are hard.
fn drawn(random: &mut Xoshiro256PlusPlus, kind: usize) -> DMatrix<f64> {
    let n = random.random_range(3..=14);
    let mut order: Vec<usize> = (0..n).collect();
    for place in (1..n).rev() {
        order.swap(place, random.random_range(0..=place));
    }
    let mut signed = || 2.0 * random.random::<f64>() - 1.0;
    let one = |is_one: bool| f64::from(u8::from(is_one));
    match kind {
        0 => DMatrix::from_fn(n, n, |_, _| signed()),
        1 => DMatrix::from_fn(n, n, |_, _| (1.5 * signed()).round()),
        2 => DMatrix::from_fn(n, n, |_, _| (signed() - 0.6).max(0.0)),
        // A Jordan block at one, turned.
        3 => {
            let turn = DMatrix::from_fn(n, n, |_, _| signed()).qr().q();
            let block = DMatrix::from_fn(n, n, |i, j| one(i == j || i + 1 == j));
            &turn * block * turn.transpose()
        }
        4 => DMatrix::from_fn(n, n, |i, j| one(order[j] == i)),
        5 => DMatrix::from_fn(n, n, |i, j| one(order[j] == i) + 1e-12 * signed()),
        // The companion of a polynomial of three unknowns that are alike.
        _ => {
            let weights = DMatrix::from_fn(1, n, |_, _| signed());
            DMatrix::from_fn(3 * n, 3 * n, |i, j| match i {
                0..3 => one(i == j % 3) * weights[j / 3],
                _ => one(i == j + 3),
            })
        }
    }
}

/// Both ways are backward stable: trace and determinant are those of a matrix that differs by an ε or two of its norm for each
/// sweep.
#[test]
fn both_methods_agree_on_invariants() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(24);
    let mut stuck = [0; KINDS];
    for case in 0..2800 {
        let kind = case % KINDS;
        let matrix = drawn(&mut random, kind);
        let n = matrix.nrows() as f64;
        let size = matrix.singular_values().max();
        let roundoff = 2.0 * SWEEPS as f64 * n * f64::EPSILON * size;
        let by_itself = by_double_shifts(&matrix);
        let always = by_exceptional_shifts(&matrix).unwrap();
        for found in by_itself.iter().chain([&always]) {
            let trace: Pole = found.iter().sum();
            assert!((trace - matrix.trace()).modulus() <= n * roundoff, "{case}");
            let product: Pole = found.iter().product();
            // Each of its n terms may be off by as much, with all others at their largest.
            let most = n * roundoff * size.max(1.0).powi(matrix.nrows() as i32 - 1);
            assert!((product - matrix.determinant()).modulus() <= most, "{case}");
            let conjugate: Vec<Pole> = found.iter().map(Pole::conj).collect();
            assert_eq!(distance(found, &conjugate), 0.0, "{case}");
            // The mean of the poles that split from a Jordan block stays at the place of the block.
            assert!(kind != 3 || largest(found) > 1.0 - roundoff, "{case}");
        }
        let Some(by_itself) = by_itself else {
            stuck[kind] += 1;
            continue;
        };
        // A pole of multiplicity k is off by the k-th root of the tolerance: 0.1 for k = 14.
        let within = if kind == 0 { 1e-8 } else { 0.5 };
        assert!(distance(&by_itself, &always) < within, "{case}");
    }
    // Else nothing here is hard.
    assert!(stuck[4] > 0 && stuck[6] > 0, "{stuck:?}");
    assert_eq!(stuck[0] + stuck[3], 0, "{stuck:?}");
}

#[test]
fn cyclic_permutation_has_roots_of_one() {
    for n in 3..40 {
        let roots = (0..n).map(|k| {
            nalgebra::ComplexField::exp(Pole::new(0.0, TAU * f64::from(k) / f64::from(n)))
        });
        let roots: Vec<Pole> = roots.collect();
        for size in [1e-100, 1.0, 1e100] {
            let found = eigenvalues(&cyclic(n as usize, size)).unwrap();
            let found: Vec<Pole> = found.iter().map(|z| z / size).collect();
            assert!(distance(&found, &roots) < 1e-13, "{n} {size}");
        }
    }
    let is_stuck = |n: &usize| by_double_shifts(&cyclic(*n, 1.0)).is_none();
    assert!((3..40).filter(is_stuck).count() > 10);
}

#[test]
fn invalid_matrix_has_no_eigenvalues() {
    assert!(eigenvalues(&DMatrix::from_element(3, 3, f64::NAN)).is_none());
    assert_eq!(spectral_radius(&DMatrix::zeros(4, 4)), Some(0.0));
    assert_eq!(
        by_exceptional_shifts(&DMatrix::zeros(4, 4)).unwrap().len(),
        4
    );
}
