//! Many degrees of freedom: the exact criterion S ⪰ 0 against the recursion, and the paper's mode-wise use of (41) beside it.

use nalgebra::{DMatrix, DVector};

use super::drive::{Random, solved, transition_of};
use super::figure::{Axes, Figure, Scale, Series};
use super::{Check, Effort, Proof};
use gusset_numerics::integrate::Lambda;
use gusset_numerics::linalg::{SymMatrix, modes};
use gusset_numerics::spectral::{lambda_limit_changed, spectral_radius};
use gusset_proof::StabilityProof;

/// Random storeys with grown tangents.
pub(super) fn storeys(random: &mut Random, n: usize, size: f64) -> SymMatrix {
    let values: Vec<f64> = (0..n).map(|_| size * random.between(0.1, 1.0)).collect();
    let mut entries = Vec::new();
    for (i, &k) in values.iter().enumerate() {
        entries.push((i, i, k));
        if i > 0 {
            entries.extend([(i - 1, i - 1, k), (i - 1, i, -k)]);
        }
    }
    SymMatrix::from_triplets(n, entries)
}

/// λ by the paper's use of (41), mode by mode: instantaneous mode j beside initial mode j.
fn mode_wise(proof: &StabilityProof) -> Option<f64> {
    let initial = modes(&proof.stiffness, &proof.mass).ok()?.frequencies;
    let current = modes(&proof.stiffness_bound, &proof.mass).ok()?.frequencies;
    let pairs = initial.iter().zip(&current);
    let limits = pairs.map(|(w0, wt)| lambda_limit_changed(w0 * proof.dt, wt * proof.dt, 0.0));
    Some(limits.fold(f64::INFINITY, f64::min))
}

/// A random structure of up to six storeys whose tangents have grown by something.
pub(super) fn random_system(random: &mut Random, damped: bool) -> StabilityProof {
    let n = 1 + (random.between(0.0, 6.0) as usize).min(5);
    let damping = storeys(random, n, 2.0);
    let grown: Vec<f64> = (0..n).map(|_| random.between(0.0, 0.3)).collect();
    let hardening = random.between(0.3, 3.0);
    let mass: Vec<f64> = (0..n).map(|_| random.between(0.1, 1.0)).collect();
    let damping_bound = if damped {
        damping.plus(1.0, &SymMatrix::diagonal(&grown))
    } else {
        damping.clone()
    };
    StabilityProof {
        mass: SymMatrix::diagonal(&mass),
        damping_bound,
        damping,
        stiffness: storeys(random, n, 1000.0),
        stiffness_bound: storeys(random, n, 1000.0 * hardening),
        dt: random.between(0.02, 0.5),
        late_mass: None,
        massless: Vec::new(),
    }
}

/// A random system whose storeys have all changed by nearly one factor: their mode shapes stay alike.
fn nearly_alike(random: &mut Random, spread: f64) -> StabilityProof {
    let mut proof = random_system(random, false);
    let n = proof.mass.n();
    let factor = random.between(0.5, 3.0);
    let mut entries = Vec::new();
    for i in 0..n {
        let k = if i == 0 {
            proof.stiffness.row(0).map(|(_, k)| k).sum::<f64>()
        } else {
            -proof.stiffness.get(i - 1, i)
        };
        let k = k * factor * random.between(1.0 - spread, 1.0 + spread);
        entries.push((i, i, k));
        if i > 0 {
            entries.extend([(i - 1, i - 1, k), (i - 1, i, -k)]);
        }
    }
    proof.stiffness_bound = SymMatrix::from_triplets(n, entries);
    proof
}

/// Exact limit, and the mode-wise one over it.
fn beside(proof: &StabilityProof) -> Option<(f64, f64)> {
    let exact = proof.limit(f64::INFINITY, &[]).ok().flatten()?;
    let by_modes = mode_wise(proof).filter(|limit| limit.is_finite())?;
    Some((exact, by_modes / exact))
}

/// Deviation of one step of the program from x → −x, started in the response to an alternating force that S predicts.
fn sawtooth(proof: &StabilityProof, lambda: f64) -> Option<f64> {
    let n = proof.mass.n();
    let dt = proof.dt;
    let force = DVector::from_fn(n, |i, _| 1.0 + i as f64);
    let s = proof.matrix(Lambda::new(lambda).ok()?, f64::INFINITY);
    let wanted = s.to_dense().lu().solve(&force)? * (-dt * dt);
    let step: DMatrix<f64> = transition_of(proof, lambda)?;
    // The share of the force in one step, from the program: x⁺ − (transition) is linear in it.
    let state = DVector::from_fn(2 * n, |i, _| {
        if i < n {
            wanted[i]
        } else {
            2.0 * wanted[i - n]
        }
    });
    let effective = solved(proof, lambda, force.as_slice())?;
    let moved = &step * &state;
    let gaps = (0..n).map(|i| {
        let next = moved[i] + dt * dt * effective[i];
        (next + wanted[i]).abs()
    });
    Some(gaps.fold(0.0, f64::max) / wanted.amax())
}

/// The criterion S ⪰ 0 against spectral radii of the recursion, and the mode-wise rule beside it.
pub(super) fn criterion(effort: Effort) -> Proof {
    let mut random = Random::new(7);
    let count = effort.of(60, 1000);
    let (mut below, mut above, mut limits, mut wrong) = (0.0f64, f64::INFINITY, 0usize, 0usize);
    let mut noise = 0.0f64;
    for _ in 0..count {
        let proof = random_system(&mut random, true);
        let radius =
            |lambda: f64| transition_of(&proof, lambda).and_then(|step| spectral_radius(&step));
        match proof.limit(f64::INFINITY, &[]) {
            Ok(Some(limit)) => {
                limits += 1;
                below = below.max(radius(0.99 * limit).unwrap_or(f64::INFINITY) - 1.0);
                above = above.min(radius(1.01 * limit).unwrap_or(0.0) - 1.0);
                noise = noise.max(sawtooth(&proof, 0.9 * limit).unwrap_or(f64::INFINITY));
            }
            Ok(None) => {
                // Every λ is stable: 1e6 as well as 1.
                let found = [1.0, 1e6, f64::INFINITY].map(radius);
                let stable = |r: Option<f64>| r.is_some_and(|r| r < 1.0 + 1e-7);
                wrong += usize::from(!found.into_iter().all(stable));
                wrong += usize::from(!proof.holds(Lambda::Infinite));
            }
            Err(_) => wrong += 1,
        }
    }
    let mut compared = |make: &mut dyn FnMut(&mut Random) -> StabilityProof| -> Vec<(f64, f64)> {
        let all = (0..count).filter_map(|_| beside(&make(&mut random)));
        all.collect()
    };
    let unlike = compared(&mut |random| random_system(random, false));
    let alike = compared(&mut |random| nearly_alike(random, 0.2));
    let equal = compared(&mut |random| nearly_alike(random, 0.0));
    let least = |of: &[(f64, f64)]| of.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let most = |of: &[(f64, f64)]| of.iter().map(|p| p.1).fold(0.0, f64::max);
    let of = format!("{limits} random systems with a limit, up to 6 degrees of freedom");
    let range = |of: &[(f64, f64)]| format!("{:.3} to {:.3}", least(of), most(of));
    let checks = vec![
        // Eigenvalues of a matrix that is not symmetric carry √ε.
        Check::within(
            &format!("S ⪰ 0 one per cent below λ_lim: spectral radius − 1, {of}"),
            "stable",
            below.max(0.0),
            1e-7,
        ),
        Check::holds(
            "one per cent above λ_lim: spectral radius − 1",
            "unstable",
            format!("at least {}", super::number(above)),
            "positive",
            above > 0.0,
        ),
        Check::within(
            "systems without a limit that are unstable for some λ",
            "0",
            wrong as f64,
            0.0,
        ),
        Check::within(
            "response to an alternating force − Δt² S⁻¹ f: S is the noise gain too",
            "(not in the paper)",
            noise,
            1e-9,
        ),
        // The limit is found to 1e-11 of itself, the frequencies to roundoff of the largest.
        Check::within(
            "mode-wise (41) over the exact λ_lim − 1, all storeys changed by one factor: shapes stay",
            "used in example 4.2",
            (most(&equal) - 1.0).abs().max((least(&equal) - 1.0).abs()),
            1e-8,
        ),
        Check::holds(
            "mode-wise (41) over the exact λ_lim, any change of the storeys",
            "used in example 4.2",
            range(&unlike),
            "never below 1 (it follows from the minimax principle): mode-wise use errs on the unsafe side",
            least(&unlike) > 1.0 - 1e-8 && least(&alike) > 1.0 - 1e-8,
        ),
        Check::note(
            "the same, storeys within 20 % of one common factor",
            "used in example 4.2",
            range(&alike),
            "pairing the instantaneous mode j with the initial mode j is close where shapes stay alike, and not a proof",
        ),
    ];
    let dots = |name: &str, of: &[(f64, f64)]| {
        let (x, y) = of.iter().copied().unzip();
        Series::dots(name, x, y)
    };
    let ends = vec![0.1, 100.0];
    let figure = Figure {
        file: "criterion",
        title: "The mode-wise limit over the exact one",
        claim: "Each dot is a random structure. Above one, the mode-wise rule calls a λ stable that is not.",
        across: Scale::fixed("exact λ_lim", "1", 0.1, 100.0),
        up: Scale::fixed("mode-wise λ_lim / exact λ_lim", "1", 0.8, 10.0),
        axes: Axes::Logarithmic,
        series: vec![
            dots("storeys changed at random", &unlike),
            dots("storeys within 20 % of one factor", &alike),
            Series::reference("equal", ends.clone(), vec![1.0; ends.len()]),
        ],
    };
    (checks, vec![figure])
}
