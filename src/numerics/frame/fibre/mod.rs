//! Fibres of members: stresses of uniaxial materials, added up over cross-sections.
//!
//! [`Fibres`] holds all fibres of one member in blocks of eight lanes. A block belongs to one section and one material, whose
//! law computes it at once. Sums are in a fixed order, so that the bits are equal with all [`Lanes`]. Laws follow the straight
//! path from the committed strain to the trial one. A NaN strain gives a NaN stress.

mod concrete;
mod eight;
mod material;
mod power;
mod spec;
mod steel;

use super::symmetric::{Sym, mirror};
use crate::linalg::Lanes;
use crate::linalg::lanes::{Isa, Kernel, Portable};
use concrete::{Concrete01, Concrete02};
use eight::Eight;
use gusset_quantity::state;
pub(super) use material::Material;
pub use spec::{Concrete01Spec, Concrete02Spec, MaterialSpec, MenegottoPintoSpec, YoungSpec};
use steel::MenegottoPinto;

#[cfg(test)]
mod tests;

/// Values of eight fibres in each row.
type Rows<const N: usize> = [[f64; 8]; N];

/// Fibre of a cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fibre {
    /// Distances from the axis of the member along the local axes y and z, in m. z is 0 in a plane.
    pub y: f64,
    pub z: f64,
    /// In m².
    pub area: f64,
    /// Place of its material in the list.
    pub material: usize,
}

/// Stress resultants of a section and their derivatives: two in a plane, three in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SectionResponse<const S: usize> {
    /// Axial force Σ σ A, and moments −Σ σ A y about z and Σ σ A z about y.
    pub force: [f64; S],
    /// Σ E A l lᵀ with l = (1, −y, z).
    pub stiffness: Sym<S>,
}

/// Sums of a section: forces, and the upper half of its stiffness.
type Sums<I, const S: usize> = ([Eight<I>; S], [[Eight<I>; S]; S]);

impl<const S: usize> Default for SectionResponse<S> {
    fn default() -> Self {
        Self {
            force: [0.0; S],
            stiffness: [[0.0; S]; S],
        }
    }
}

impl<const S: usize> SectionResponse<S> {
    /// Adds the lanes in their order.
    #[inline(always)]
    fn of<I: Isa>((force, stiffness): Sums<I, S>) -> Self {
        let sum = |lanes: [f64; 8]| lanes.into_iter().fold(0.0, |sum, lane| sum + lane);
        let mut whole = stiffness.map(|row| row.map(|lanes| sum(lanes.array())));
        mirror(&mut whole);
        Self {
            force: force.map(|lanes| sum(lanes.array())),
            stiffness: whole,
        }
    }
}

/// Eight fibres of one material. Lanes without a fibre repeat the last one without area.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// −y and z.
    levers: [[f64; 8]; 2],
    area: [f64; 8],
    material: Material,
}

impl Block {
    fn new(fibres: &[Fibre], material: Material) -> Self {
        let (mut levers, mut area) = ([[0.0; 8]; 2], [0.0; 8]);
        let [of_y, of_z] = &mut levers;
        for (k, (y, z)) in of_y.iter_mut().zip(of_z).enumerate() {
            if let Some(fibre) = fibres.get(k).or(fibres.last()) {
                (*y, *z) = (-fibre.y, fibre.z);
            }
        }
        for (area, fibre) in area.iter_mut().zip(fibres) {
            *area = fibre.area;
        }
        Self {
            levers,
            area,
            material,
        }
    }

    /// Adds stresses and tangents of this block to the sums of a section.
    #[inline(always)]
    fn add<I: Isa, const S: usize>(
        &self,
        [stress, tangent]: [Eight<I>; 2],
        (forces, stiffness): &mut Sums<I, S>,
    ) {
        let isa = stress.0;
        let area = Eight::load(isa, &self.area);
        let (force, rigidity) = (stress * area, tangent * area);
        forces[0] = forces[0] + force;
        stiffness[0][0] = stiffness[0][0] + rigidity;
        for i in 1..S {
            let lever = Eight::load(isa, &self.levers[i - 1]);
            forces[i] = forces[i] + force * lever;
            let moment = rigidity * lever;
            stiffness[0][i] = stiffness[0][i] + moment;
            for (sum, other) in stiffness[i][i..].iter_mut().zip(&self.levers[i - 1..]) {
                *sum = *sum + moment * Eight::load(isa, other);
            }
        }
    }
}

/// All fibres of one member, the same ones in each of its sections.
#[derive(Debug, Clone)]
pub(super) struct Fibres {
    /// Those of one section.
    blocks: Vec<Block>,
    /// Rows of state, by section and block.
    committed: Vec<[f64; 8]>,
    trial: Vec<[f64; 8]>,
    /// Largest strain so far of each section, in yield strains.
    demand: Vec<f64>,
}

state! {
    Fibres as "fibres" { committed, demand } keeps { blocks, trial }
    restored { trial.copy_from_slice(committed); }
}

impl Fibres {
    /// Fibres at rest. The layout is that of one section; each fibre names a material of the list.
    pub(super) fn new(sections: usize, layout: &[Fibre], materials: &[Material]) -> Self {
        debug_assert!(layout.iter().all(|fibre| fibre.material < materials.len()));
        let mut blocks = Vec::new();
        for (place, material) in materials.iter().enumerate() {
            let own = layout.iter().filter(|fibre| fibre.material == place);
            let own: Vec<Fibre> = own.copied().collect();
            blocks.extend(own.chunks(8).map(|fibres| Block::new(fibres, *material)));
        }
        let section: Vec<[f64; 8]> = blocks
            .iter()
            .flat_map(|block| block.material.virgin())
            .map(|value| [value; 8])
            .collect();
        let committed = section.repeat(sections);
        Self {
            blocks,
            trial: committed.clone(),
            committed,
            demand: vec![0.0; sections],
        }
    }

    /// Responses of all sections to their axial strains and curvatures, from the committed state: the strain of a fibre is
    /// ε = ε₀ − y κ_z + z κ_y. Both lists are as long as there are sections. Real-time: yes.
    pub(super) fn trial<const S: usize>(
        &mut self,
        lanes: Lanes,
        strains: &[[f64; S]],
        out: &mut [SectionResponse<S>],
    ) {
        lanes.run(Pass {
            blocks: &self.blocks,
            old: &self.committed,
            new: &mut self.trial,
            strains,
            out,
        });
    }

    /// Makes the last trial the committed state. Real-time: yes.
    pub(super) fn commit(&mut self) {
        self.committed.copy_from_slice(&self.trial);
        let mut rows = self.committed.as_slice();
        for demand in &mut self.demand {
            for block in &self.blocks {
                let Some((own, rest)) = rows.split_at_checked(block.material.rows()) else {
                    return;
                };
                for strain in own.iter().take(1).flatten() {
                    *demand = demand.max(strain.abs());
                }
                rows = rest;
            }
        }
    }

    /// Forgets the last trial. Real-time: yes.
    #[cfg(test)]
    pub(super) fn revert(&mut self) {
        self.trial.copy_from_slice(&self.committed);
    }

    /// True if a material of them is.
    pub(super) fn are_brittle(&self) -> bool {
        self.blocks.iter().any(|block| block.material.is_brittle())
    }

    /// Stiffness of a section before the first motion, as [`SectionResponse::stiffness`].
    pub(super) fn initial_stiffness<const S: usize>(&self) -> Sym<S> {
        let zero = Eight::all(Portable, 0.0);
        let mut sums = ([zero; S], [[zero; S]; S]);
        for block in &self.blocks {
            let young = Eight::all(Portable, block.material.initial_stiffness());
            block.add([young; 2], &mut sums);
        }
        SectionResponse::of(sums).stiffness
    }

    /// Largest strain of the section at all commits, in yield strains of its material; 0 where no material yields. Real-time: yes.
    pub(super) fn demand(&self, section: usize) -> f64 {
        self.demand.get(section).copied().unwrap_or(0.0)
    }
}

struct Pass<'a, const S: usize> {
    blocks: &'a [Block],
    old: &'a [[f64; 8]],
    new: &'a mut [[f64; 8]],
    strains: &'a [[f64; S]],
    out: &'a mut [SectionResponse<S>],
}

impl<const S: usize> Kernel for Pass<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (mut old, mut new) = (self.old, self.new);
        let zero = Eight::all(isa, 0.0);
        for (strains, out) in self.strains.iter().zip(self.out) {
            let mut sums = ([zero; S], [[zero; S]; S]);
            for block in self.blocks {
                let mut strain = Eight::all(isa, strains[0]);
                for (curvature, lever) in strains[1..].iter().zip(&block.levers) {
                    strain = strain + Eight::load(isa, lever) * Eight::all(isa, *curvature);
                }
                let response = match &block.material {
                    Material::Elastic(young) => {
                        let young = Eight::all(isa, *young);
                        [young * strain, young]
                    }
                    Material::ElasticNoTension(young) => {
                        let tangent = zero.if_less(strain, zero, Eight::all(isa, *young));
                        [tangent * strain, tangent]
                    }
                    Material::MenegottoPinto(steel) => {
                        let Some((old, new)) = next(&mut old, &mut new) else {
                            return;
                        };
                        steel.respond(strain, old, new)
                    }
                    Material::Concrete01(concrete) => {
                        let Some((old, new)) = next(&mut old, &mut new) else {
                            return;
                        };
                        concrete.respond(strain, old, new)
                    }
                    Material::Concrete02(concrete) => {
                        let Some((old, new)) = next(&mut old, &mut new) else {
                            return;
                        };
                        concrete.respond(strain, old, new)
                    }
                };
                block.add(response, &mut sums);
            }
            *out = SectionResponse::of(sums);
        }
    }
}

/// The committed rows of the next block, and those of its trial.
#[inline(always)]
fn next<'a, const ROWS: usize>(
    old: &mut &'a [[f64; 8]],
    new: &mut &'a mut [[f64; 8]],
) -> Option<(&'a Rows<ROWS>, &'a mut Rows<ROWS>)> {
    let (own, rest) = old.split_first_chunk()?;
    *old = rest;
    let (trial, rest) = std::mem::take(new).split_first_chunk_mut()?;
    *new = rest;
    Some((own, trial))
}

/// One fibre's entries of rows.
#[inline(always)]
fn lane<const ROWS: usize>(rows: &Rows<ROWS>, k: usize) -> [f64; ROWS] {
    let mut entries = [0.0; ROWS];
    for (entry, row) in entries.iter_mut().zip(rows) {
        *entry = row[k];
    }
    entries
}

#[inline(always)]
fn put<const ROWS: usize>(entries: [f64; ROWS], rows: &mut Rows<ROWS>, k: usize) {
    for (entry, row) in entries.into_iter().zip(rows) {
        row[k] = entry;
    }
}
