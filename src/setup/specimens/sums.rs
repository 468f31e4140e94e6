//! Contribution of all specimens together to the matrices of the structure: Σ Bᵀ (·) B, n × n in the structure's units.

use super::{Axis, Entry, Rows, Specimens};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::Part;
use gusset_proof::{Advice, SpecimenShare};

impl Specimens {
    /// Σ Bᵀ k̂ B.
    pub(crate) fn stiffness(&self, dofs: usize) -> SymMatrix {
        self.gathered(dofs, |entry| Some(&entry.estimate.stiffness))
    }

    /// Σ Bᵀ k B before anything moves.
    pub(crate) fn stiffness_at_rest(&self, dofs: usize) -> SymMatrix {
        self.gathered(dofs, |entry| Some(&entry.estimate.stiffness_at_rest))
    }

    /// The part of it of specimens with `damped`.
    pub(crate) fn damped_stiffness(&self, dofs: usize) -> SymMatrix {
        self.gathered(dofs, |entry| {
            entry.damped.then_some(&entry.estimate.stiffness_at_rest)
        })
    }

    /// The part of a damping rule with the coefficient `b` of K that comes from the stiffness of each specimen, by axes, with its
    /// unit. Empty for a specimen of a frame without `damped`.
    pub(crate) fn damping_by_rule(
        &self,
        b: f64,
        is_frame: bool,
        rotations: &[usize],
    ) -> Vec<Vec<(f64, &'static str)>> {
        let turns = |axis: &Axis| axis.row.iter().all(|(dof, _)| rotations.contains(dof));
        let each = self.0.iter().map(|entry| {
            let axes = entry.axes.iter().enumerate();
            let axes = axes.filter(|_| entry.damped || !is_frame);
            let own = axes.map(|(k, axis)| {
                let unit = if turns(axis) { "N m s" } else { "N s/m" };
                (b * entry.estimate.stiffness_at_rest[k][k], unit)
            });
            own.collect()
        });
        each.collect()
    }

    /// Σ Bᵀ m B of the masses that the structure carries for the specimens.
    pub(crate) fn mass(&self, dofs: usize) -> SymMatrix {
        let weighs = |entry: &&Entry| entry.mass.iter().flatten().any(|m| *m != 0.0);
        self.gathered(dofs, |entry| {
            Some(entry).filter(weighs).map(|entry| &entry.mass)
        })
    }

    /// Σ Bᵀ ĉ B.
    pub(crate) fn damping(&self, dofs: usize) -> SymMatrix {
        self.gathered(dofs, |entry| Some(&entry.estimate.damping))
    }

    /// Σ Bᵀ c B of the damping that acts around rest only.
    pub(crate) fn rest_damping(&self, dofs: usize) -> SymMatrix {
        let acts = |entry: &&Entry| {
            entry
                .estimate
                .rest_damping
                .iter()
                .flatten()
                .any(|c| *c != 0.0)
        };
        self.gathered(dofs, |entry| {
            Some(entry)
                .filter(acts)
                .map(|entry| &entry.estimate.rest_damping)
        })
    }

    /// Keeps only `share` of the damping that acts around rest in ĉ.
    pub(crate) fn keep_rest_damping(&mut self, share: f64) {
        for entry in &mut self.0 {
            let rest = entry.estimate.rest_damping.iter().flatten();
            for (value, rest) in entry.estimate.damping.iter_mut().flatten().zip(rest) {
                *value += (share - 1.0) * rest;
            }
        }
    }

    /// Σ Bᵀ c B before anything moves.
    pub(crate) fn damping_at_rest(&self, dofs: usize) -> SymMatrix {
        self.gathered(dofs, |entry| Some(&entry.estimate.damping_at_rest))
    }

    /// Upper bounds of the tangents, the damping as it counts in a sawtooth; or the specimen (from 0) whose law needs a
    /// declared reach.
    pub(crate) fn bounds(&self, dofs: usize) -> Result<(SymMatrix, SymMatrix), usize> {
        if let Some(index) = self.0.iter().position(|entry| entry.bounds.is_err()) {
            return Err(index);
        }
        let bound = |entry: &Entry| entry.bounds.clone().ok();
        let stiffness: Vec<_> = self.0.iter().map(|e| bound(e).map(|b| b.0)).collect();
        let counted = |entry: &Entry| {
            let (_, mut damping) = bound(entry)?;
            for value in damping.iter_mut().flatten() {
                *value *= entry.sawtooth;
            }
            Some(damping)
        };
        let damping: Vec<_> = self.0.iter().map(counted).collect();
        let gather = |all: &[Option<Rows>]| {
            let mut index = 0;
            self.gathered(dofs, |_| {
                index += 1;
                all.get(index - 1).and_then(Option::as_ref)
            })
        };
        Ok((gather(&stiffness), gather(&damping)))
    }

    /// Named shares of K_max and C_max, one per axis.
    pub(crate) fn parts(&self) -> Vec<Part> {
        let mut parts = Vec::new();
        for entry in &self.0 {
            let Ok((stiffness, damping)) = &entry.bounds else {
                continue;
            };
            for (j, axis) in entry.axes.iter().enumerate() {
                let several = entry.axes.len() > 1;
                let name = if several {
                    format!("specimen \"{}\" axis {}", entry.name, j + 1)
                } else {
                    format!("specimen \"{}\"", entry.name)
                };
                parts.push(Part {
                    name,
                    row: axis.row.clone(),
                    stiffness_bound: stiffness[j][j],
                    damping: entry.estimate.damping[j][j],
                    damping_bound: entry.sawtooth * damping[j][j],
                });
            }
        }
        parts
    }

    /// The largest number that stability rests on of each specimen.
    pub(crate) fn sizes(&self) -> impl Iterator<Item = f64> {
        self.0.iter().map(|entry| {
            let bounds = entry.bounds.iter().flat_map(|(k, c)| [k, c]);
            let all = [
                &entry.estimate.stiffness,
                &entry.estimate.damping,
                &entry.mass,
            ];
            let all = all.into_iter().chain(bounds).flatten().flatten();
            all.fold(entry.mass_in_force.abs(), |size, value| {
                size.max(value.abs())
            })
        })
    }

    /// How much of the damping of each of those counts in a sawtooth.
    fn sawtooths(&self) -> Vec<f64> {
        let bounded = self.0.iter().filter(|entry| entry.bounds.is_ok());
        let each = bounded.flat_map(|entry| entry.axes.iter().map(|_| entry.sawtooth));
        each.collect()
    }

    /// The first specimen that is damped and of whose damping more counts, because ticks come between its targets.
    fn overcounted(&self) -> Option<&str> {
        let damped = |entry: &&Entry| match &entry.bounds {
            Ok((_, damping)) => damping.iter().flatten().any(|c| *c != 0.0),
            Err(_) => true,
        };
        let more = self.0.iter().filter(|entry| entry.sawtooth > 1.0);
        more.filter(damped).map(|entry| entry.name.as_str()).next()
    }

    /// Advice on specimens that burden a proof more than they seem to.
    pub(crate) fn advice(&self) -> Advice {
        Advice {
            overcounted: self.overcounted().map(str::to_owned),
            heavy: self.heavy().map(str::to_owned),
        }
    }

    /// The specimens in a proof of λ.
    pub(crate) fn share(&self) -> SpecimenShare {
        SpecimenShare {
            attached: self.attached(),
            parts: self.parts(),
            sawtooths: self.sawtooths(),
            advice: self.advice(),
        }
    }

    /// The first specimen with inertia inside its force.
    fn heavy(&self) -> Option<&str> {
        let found = self.0.iter().find(|entry| entry.mass_in_force != 0.0);
        found.map(|entry| entry.name.as_str())
    }

    /// Σ Bᵀ m B of the masses whose inertia is inside the measured forces.
    pub(crate) fn mass_in_force(&self, dofs: usize) -> SymMatrix {
        let masses: Vec<Rows> = self
            .0
            .iter()
            .map(|entry| {
                let n = entry.axes.len();
                let diagonal = |i, j| if i == j { entry.mass_in_force } else { 0.0 };
                (0..n)
                    .map(|i| (0..n).map(|j| diagonal(i, j)).collect())
                    .collect()
            })
            .collect();
        let mut index = 0;
        self.gathered(dofs, |_| {
            index += 1;
            masses.get(index - 1)
        })
    }

    /// The same; none where there are no such masses.
    pub(crate) fn late_mass(&self, dofs: usize) -> Option<SymMatrix> {
        self.heavy().map(|_| self.mass_in_force(dofs))
    }

    fn gathered<'a>(
        &'a self,
        dofs: usize,
        mut of: impl FnMut(&'a Entry) -> Option<&'a Rows>,
    ) -> SymMatrix {
        let mut triplets = Vec::new();
        for entry in &self.0 {
            let Some(matrix) = of(entry) else { continue };
            for (i, row_i) in entry.axes.iter().enumerate() {
                for (j, row_j) in entry.axes.iter().enumerate() {
                    for &(p, a) in &row_i.row {
                        for &(q, b) in &row_j.row {
                            // One half of the symmetric whole: the other is mirrored.
                            if p < q || (p == q && p < dofs) {
                                triplets.push((p, q, a * b * matrix[i][j]));
                            }
                        }
                    }
                }
            }
        }
        SymMatrix::from_triplets(
            dofs,
            triplets.into_iter().filter(|t| t.0 < dofs && t.1 < dofs),
        )
    }
}
