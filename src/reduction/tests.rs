use std::f64::consts::PI;
use std::sync::Arc;

use gusset_numerics::linalg::{Spd, SymMatrix, frequencies};

use crate::factor::Factor;
use crate::modes::lowest;
use crate::{Coordinate, Reduction, ReductionError, times};

const STIFFNESS: f64 = 2e6;
const MASS: f64 = 500.0;

/// A chain of springs, fixed at both ends.
fn chain(n: usize) -> SymMatrix {
    let entries = (0..n).flat_map(|i| {
        let beside = (i + 1 < n).then_some((i, i + 1, -STIFFNESS));
        [Some((i, i, 2.0 * STIFFNESS)), beside]
            .into_iter()
            .flatten()
    });
    SymMatrix::from_triplets(n, entries)
}

fn masses(n: usize) -> SymMatrix {
    SymMatrix::diagonal(&vec![MASS; n])
}

/// ω² of mode j, from 1, of a fixed chain of n masses.
fn squared(n: usize, j: usize) -> f64 {
    let sine = libm::sin(j as f64 * PI / (2.0 * (n + 1) as f64));
    4.0 * STIFFNESS / MASS * sine * sine
}

/// A grid of springs with one direction at each point, held at its first row.
fn grid(side: usize) -> SymMatrix {
    let at = |i: usize, j: usize| i * side + j;
    let mut entries = Vec::new();
    for i in 0..side {
        for j in 0..side {
            entries.push((at(i, j), at(i, j), if i == 0 { 1.0 } else { 0.0 }));
            for (k, l) in [(i + 1, j), (i, j + 1)] {
                if k < side && l < side {
                    entries.push((at(i, j), at(i, j), 1.0));
                    entries.push((at(k, l), at(k, l), 1.0));
                    entries.push((at(i, j), at(k, l), -1.0));
                }
            }
        }
    }
    SymMatrix::from_triplets(side * side, entries)
}

fn made(mass: &SymMatrix, stiffness: &SymMatrix, kept: &[usize], modes: usize) -> Arc<Reduction> {
    Reduction::new(mass.clone(), stiffness.clone(), kept.to_vec(), modes).unwrap()
}

fn near(found: f64, expected: f64, tolerance: f64) {
    let error = (found - expected).abs() / expected.abs();
    assert!(
        error <= tolerance,
        "{found} instead of {expected}: {error:e}"
    );
}

#[test]
fn modes_of_fixed_chains_have_closed_form() {
    // Both halves are alike, so every frequency occurs twice.
    let (stiffness, mass) = (chain(41), masses(41));
    let reduction = made(&mass, &stiffness, &[20], 6);
    let [k, m] = [&stiffness, &mass].map(|matrix| reduction.project(matrix));
    for mode in 0..6 {
        let at = 1 + mode;
        near(
            k.get(at, at) / m.get(at, at),
            squared(20, mode / 2 + 1),
            1e-10,
        );
        assert_eq!(reduction.coordinates()[at], Coordinate::Mode(mode + 1));
    }
    near(reduction.highest().powi(2), squared(20, 3), 1e-10);
}

#[test]
fn all_modes_give_the_full_model() {
    let (stiffness, mass) = (chain(41), masses(41));
    let reduction = made(&mass, &stiffness, &[3, 20], 39);
    let [k, m] = [&stiffness, &mass].map(|matrix| reduction.project(matrix));
    let found = frequencies(&k, &m, 41).unwrap();
    for (mode, omega) in found.iter().enumerate() {
        near(omega * omega, squared(41, mode + 1), 1e-9);
    }
    let shape: Vec<f64> = (0..41).map(|dof| libm::sin(dof as f64)).collect();
    let coordinates = reduction.motion(&shape);
    let energy = 0.5 * k.quadratic(&coordinates);
    near(energy, 0.5 * stiffness.quadratic(&shape), 1e-9);
    // A load does the same work on both.
    let [work, of_reduced] = [(&shape, &shape), (&reduction.load(&shape), &coordinates)]
        .map(|(force, disp)| force.iter().zip(disp).map(|(f, x)| f * x).sum::<f64>());
    near(of_reduced, work, 1e-9);
}

#[test]
fn static_condensation_is_exact_where_kept() {
    let (stiffness, mass) = (chain(60), masses(60));
    let kept = [5, 31, 44];
    let reduction = made(&mass, &stiffness, &kept, 0);
    let mut load = vec![0.0; 60];
    load[31] = 7e3;
    load[12] = -2e3;
    let mut full = load.clone();
    Spd::factor(&stiffness).unwrap().solve_in_place(&mut full);
    let mut found = reduction.load(&load);
    let mut factor = Spd::factor(&reduction.project(&stiffness)).unwrap();
    factor.solve_in_place(&mut found);
    for (x, dof) in found.iter().zip(kept) {
        near(*x, full[dof], 1e-12);
    }
}

#[test]
fn kept_direction_without_mass_stays_so() {
    // Every third direction has no mass, kept or not.
    let n = 42;
    let stiffness = chain(n);
    let own: Vec<f64> = (0..n)
        .map(|i| if i % 3 == 0 { 0.0 } else { MASS })
        .collect();
    let mass = SymMatrix::diagonal(&own);
    let full = frequencies(&stiffness, &mass, 28).unwrap();
    for (modes, shapes, tolerance) in [(4, 2, 1e-2), (27, 0, 1e-9)] {
        let reduction = made(&mass, &stiffness, &[10, 21, 30], modes);
        assert_eq!(reduction.coordinates().len(), 3 + modes + shapes);
        let [k, m] = [&stiffness, &mass].map(|matrix| reduction.project(matrix));
        assert!(m.row_is_zero(1) && m.row_is_zero(2) && !m.row_is_zero(0));
        let found = frequencies(&k, &m, 4).unwrap();
        for (omega, full) in found.iter().zip(&full) {
            near(*omega, *full, tolerance);
        }
    }
}

#[test]
fn effective_masses_agree() {
    let (stiffness, mass) = (chain(60), masses(60));
    let reduction = made(&mass, &stiffness, &[5, 31], 12);
    // A spring beside K at a kept direction.
    let more = SymMatrix::from_triplets(reduction.coordinates().len(), [(1, 1, STIFFNESS)]);
    let [k, m] = [&stiffness, &mass].map(|matrix| reduction.project(matrix));
    let k = k.plus(1.0, &more);
    let ground = [(String::new(), vec![1.0; 60])];
    let found = reduction.accuracy([&k, &m], &ground, 4).unwrap();
    let spring = SymMatrix::from_triplets(60, [(31, 31, STIFFNESS)]);
    let expected = frequencies(&stiffness.plus(1.0, &spring), &mass, 4).unwrap();
    for ([full, reduced], expected) in found.frequencies.iter().zip(expected) {
        near(*full, expected, 1e-10);
        near(*reduced, expected, 1e-3);
        assert!(*reduced > full * (1.0 - 1e-12));
    }
    let sums = &found.grounds[0].sums;
    assert!(sums[3][0] > 0.7 && sums[3][0] < 1.0);
    near(sums[3][1], sums[3][0], 1e-3);
}

#[test]
fn equal_frequencies_share_their_mass() {
    // Two equal chains that nothing joins: every frequency occurs twice, and its shapes are arbitrary.
    let (n, whole) = (20, 41);
    let whole_chain = chain(whole);
    let springs = whole_chain
        .entries()
        .filter(|(i, j, _)| i == j || (*i != n && *j != n));
    let (stiffness, mass) = (SymMatrix::from_triplets(whole, springs), masses(whole));
    let reduction = made(&mass, &stiffness, &[n], 30);
    let [k, m] = [&stiffness, &mass].map(|matrix| reduction.project(matrix));
    let influence = (0..whole).map(|dof| if dof < n { 1.0 } else { 0.3 });
    let ground = [(String::new(), influence.collect())];
    let found = reduction.accuracy([&k, &m], &ground, 5).unwrap();
    let sums = &found.grounds[0].sums;
    assert_eq!(sums.len(), 5);
    for pair in sums[..4].chunks(2) {
        assert_eq!(pair[0], pair[1]);
        near(pair[0][1], pair[0][0], 1e-9);
    }
}

#[test]
fn large_factor_solves() {
    let side = 56;
    let stiffness = grid(side);
    let mut factor = Factor::new(&stiffness).unwrap();
    assert!(matches!(factor, Factor::Large(..)));
    let expected: Vec<f64> = (0..side * side).map(|i| libm::cos(i as f64)).collect();
    let force = times(&stiffness, &expected);
    let mut columns = nalgebra::DMatrix::from_fn(side * side, 3, |i, j| force[i] * (j + 1) as f64);
    factor.solve(&mut columns);
    for (row, expected) in expected.iter().enumerate() {
        for j in 0..3 {
            let error = columns[(row, j)] - expected * (j + 1) as f64;
            assert!(error.abs() < 1e-9, "{error}");
        }
    }
    let mass = SymMatrix::diagonal(&vec![1.0; side * side]);
    let modes = lowest(&mut factor, &mass, 5).unwrap();
    // The sum of a chain that is free at both ends and one that is held at one.
    let along = |n: f64, j: f64| 4.0 * libm::sin(j * PI / (2.0 * n)).powi(2);
    let n = side as f64;
    let held = |j: f64| 4.0 * libm::sin((2.0 * j - 1.0) * PI / (2.0 * (2.0 * n + 1.0))).powi(2);
    let mut all: Vec<f64> = (1..9)
        .flat_map(|i| (0..8).map(move |j| held(f64::from(i)) + along(n, f64::from(j))))
        .collect();
    all.sort_by(f64::total_cmp);
    for (found, expected) in modes.squared.iter().zip(all) {
        near(*found, expected, 1e-9);
    }
}

#[test]
fn loose_interior_is_named() {
    let mut entries: Vec<_> = chain(30).entries().collect();
    // Directions 12 to 14 hang on nothing.
    entries.retain(|(i, j, _)| !(*i..=*j).any(|dof| (12..15).contains(&dof)));
    entries.extend([
        (12, 12, 1.0),
        (12, 13, -1.0),
        (13, 13, 2.0),
        (13, 14, -1.0),
        (14, 14, 1.0),
    ]);
    let loose = SymMatrix::from_triplets(30, entries);
    let refused = |mass: &SymMatrix, stiffness: &SymMatrix, kept: &[usize], modes| {
        Reduction::new(mass.clone(), stiffness.clone(), kept.to_vec(), modes).unwrap_err()
    };
    let ReductionError::Loose(found) = refused(&masses(30), &loose, &[3], 2) else {
        panic!("not refused as loose");
    };
    assert!((12..15).contains(&found.dof), "{}", found.dof);
    // A large one, of which one point hangs on nothing.
    let side = 56;
    let lone = SymMatrix::from_triplets(side * side, [(1234, 1234, -4.0)]);
    let mut entries: Vec<_> = grid(side).plus(1.0, &lone).entries().collect();
    entries.retain(|(i, j, _)| i == j || (*i != 1234 && *j != 1234));
    let loose = SymMatrix::from_triplets(side * side, entries);
    let mass = SymMatrix::diagonal(&vec![1.0; side * side]);
    let ReductionError::Loose(found) = refused(&mass, &loose, &[3], 2) else {
        panic!("not refused as loose");
    };
    assert_eq!(found.dof, 1234);
    assert_eq!(
        refused(&masses(30), &chain(30), &[3], 30),
        ReductionError::Modes {
            asked: 30,
            most: 29
        }
    );
    let all: Vec<usize> = (0..30).collect();
    assert_eq!(
        refused(&masses(30), &chain(30), &all, 0),
        ReductionError::Nothing(30)
    );
    let indefinite = SymMatrix::from_triplets(30, [(4, 5, 2.0 * MASS)]);
    let mass = masses(30).plus(1.0, &indefinite);
    assert!(matches!(
        refused(&mass, &chain(30), &[3], 2),
        ReductionError::Mass(_)
    ));
}

#[test]
fn equal_input_gives_equal_bits() {
    let stiffness = grid(56);
    let mass = SymMatrix::diagonal(&vec![1.0; 56 * 56]);
    let first = made(&mass, &stiffness, &[7, 1500], 6).project(&stiffness);
    made(&masses(9), &chain(9), &[3], 1);
    assert_eq!(
        made(&mass, &stiffness, &[7, 1500], 6).project(&stiffness),
        first
    );
}
