//! The largest stable λ with the tangents that a running test shows, in place of their declared bounds.
//!
//! The numerical side stays at its declared bounds; every axis of a specimen takes the tangent that is estimated of it:
//! K_t = K_max + Σ (k_t − k_max) bᵀb, C_t likewise, and [`StabilityProof::limit`] answers. Some forty factorisations: for a
//! thread that has time, not for the loop.

use super::criterion::StabilityProof;
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::Part;

/// Inputs of the online limit.
#[derive(Debug, Clone)]
pub struct OnlineLimit {
    /// At the declared bounds.
    pub(super) proof: StabilityProof,
    /// Those of the specimens, whose bounds are in the proof.
    pub(super) axes: Vec<Part>,
    /// Share of each axis's damping that counts in a sawtooth, as in the bounds: its velocity is then not that of the
    /// integrator. 1 for axes beyond the list.
    pub(super) sawtooths: Vec<f64>,
}

impl OnlineLimit {
    /// The largest stable λ with tangent stiffness in N/m and tangent damping in N s/m of every axis, in order; where there is no
    /// finite number the declared bound applies. Infinite if every λ is stable, 0 if none is.
    #[must_use]
    pub fn limit(&self, tangents: impl IntoIterator<Item = (f64, Option<f64>)>) -> f64 {
        let n = self.proof.mass.n();
        let (mut stiffness, mut damping) = (Vec::new(), Vec::new());
        let counts = self.sawtooths.iter().copied();
        let counts = counts.chain(std::iter::repeat(1.0));
        for ((axis, count), (k, c)) in self.axes.iter().zip(counts).zip(tangents) {
            if k.is_finite() {
                outer(&axis.row, k - axis.stiffness_bound, &mut stiffness);
            }
            if let Some(c) = c.filter(|c| c.is_finite()) {
                outer(&axis.row, count * c - axis.damping_bound, &mut damping);
            }
        }
        let mut proof = self.proof.clone();
        let more = SymMatrix::from_triplets(n, stiffness);
        proof.stiffness_bound = proof.stiffness_bound.plus(1.0, &more);
        let more = SymMatrix::from_triplets(n, damping);
        proof.damping_bound = proof.damping_bound.plus(1.0, &more);
        match proof.limit(f64::INFINITY, &self.axes) {
            Ok(limit) => limit.unwrap_or(f64::INFINITY),
            Err(_) => 0.0,
        }
    }
}

/// `value`·bᵀb, every entry beside the diagonal once, as [`SymMatrix::from_triplets`] wants it.
fn outer(row: &[(usize, f64)], value: f64, into: &mut Vec<(usize, usize, f64)>) {
    for (place, (i, a)) in row.iter().enumerate() {
        into.push((*i, *i, value * a * a));
        for (j, b) in row.iter().skip(place + 1) {
            // A row may name a degree of freedom twice: on the diagonal nothing is mirrored.
            let both = if i == j { 2.0 } else { 1.0 };
            into.push((*i, *j, both * value * a * b));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit_of(proof: StabilityProof, axis: Part) -> OnlineLimit {
        OnlineLimit {
            proof,
            axes: vec![axis],
            sawtooths: Vec::new(),
        }
    }

    /// One mass m on a storey whose bound is k_max, tested as a specimen: equation (41) has the limit in closed form,
    /// λ = 4 Δt² k0 / (Δt² k_t − 4 m − 2 Δt (c0 − c_t)).
    #[test]
    fn one_dof_limit_matches_the_closed_form() {
        let (m, k0, c0, dt) = (2.0, 5e5, 300.0, 0.01);
        let (k_max, c_max) = (8e5, 500.0);
        let one = |value| SymMatrix::diagonal(&[value]);
        let proof = StabilityProof {
            mass: one(m),
            damping: one(c0),
            stiffness: one(k0),
            damping_bound: one(c_max),
            stiffness_bound: one(k_max),
            dt,
            late_mass: None,
            massless: Vec::new(),
        };
        let axis = Part {
            name: "specimen".into(),
            row: vec![(0, 1.0)],
            stiffness_bound: k_max,
            damping: c0,
            damping_bound: c_max,
        };
        let online = limit_of(proof.clone(), axis);
        for (k, c) in [(k_max, c_max), (3e5, 100.0), (2e6, 900.0), (4e5, 0.0)] {
            let expected = 4.0 * dt * dt * k0 / (dt * dt * k - 4.0 * m - 2.0 * dt * (c0 - c));
            let found = online.limit([(k, Some(c))]);
            // The bisection stops at a relative 1e-11.
            assert!(
                (found / expected - 1.0).abs() < 1e-10,
                "{k} {c}: {found} {expected}"
            );
        }
        let at_bounds = proof.limit(f64::INFINITY, &[]).unwrap().unwrap();
        let unknown = online.limit([(f64::NAN, None)]);
        assert!((unknown / at_bounds - 1.0).abs() < 1e-10);
        assert_eq!(online.limit([(1e4, None)]), f64::INFINITY);
        // Where twice its damping counts, half of it leaves as much room.
        let twice = OnlineLimit {
            sawtooths: vec![2.0],
            ..online
        };
        let found = twice.limit([(6e5, Some(c_max / 2.0))]);
        let expected = 4.0 * dt * dt * k0 / (dt * dt * 6e5 - 4.0 * m - 2.0 * dt * (c0 - c_max));
        assert!((found / expected - 1.0).abs() < 1e-10, "{found} {expected}");
    }

    #[test]
    fn softer_specimen_raises_the_limit() {
        // Two storeys; only the first is a specimen. The second alone governs once the first is soft.
        let dt = 0.02;
        let chain = |k1: f64, k2: f64| {
            SymMatrix::from_triplets(2, [(0, 0, k1 + k2), (0, 1, -k2), (1, 1, k2)])
        };
        let proof = StabilityProof {
            mass: SymMatrix::diagonal(&[1.0, 1.0]),
            damping: SymMatrix::zeros(2),
            stiffness: chain(3e5, 2e5),
            damping_bound: SymMatrix::zeros(2),
            stiffness_bound: chain(6e5, 2e5),
            dt,
            late_mass: None,
            massless: Vec::new(),
        };
        let axis = Part {
            name: "one".into(),
            row: vec![(0, 1.0)],
            stiffness_bound: 6e5,
            damping: 0.0,
            damping_bound: 0.0,
        };
        let online = limit_of(proof.clone(), axis);
        let limits: Vec<f64> = [9e5, 6e5, 3e5, 1e5]
            .into_iter()
            .map(|k| online.limit([(k, None)]))
            .collect();
        assert!(
            limits.windows(2).all(|pair| pair[0] < pair[1]),
            "{limits:?}"
        );
        let same = StabilityProof {
            stiffness_bound: chain(1e5, 2e5),
            ..proof.clone()
        };
        let expected = same.limit(f64::INFINITY, &[]).unwrap().unwrap();
        assert!((limits[3] / expected - 1.0).abs() < 1e-10);
        // The second storey as a specimen: a row with two entries, one of them given in two parts.
        let between = |k: f64| {
            let axis = Part {
                name: "two".into(),
                row: vec![(0, -1.0), (1, 0.25), (1, 0.75)],
                stiffness_bound: 2e5,
                damping: 0.0,
                damping_bound: 0.0,
            };
            limit_of(proof.clone(), axis).limit([(k, None)])
        };
        for k in [1e5, 2e5, 7e5] {
            let same = StabilityProof {
                stiffness_bound: chain(6e5, k),
                ..proof.clone()
            };
            let expected = same.limit(f64::INFINITY, &[]).unwrap().unwrap();
            assert!((between(k) / expected - 1.0).abs() < 1e-10, "{k}");
        }
    }
}
