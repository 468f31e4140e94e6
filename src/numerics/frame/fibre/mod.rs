//! Fibres of plane members: stresses of uniaxial materials, added up over cross-sections.
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
    /// Distance from the axis of the member, in m.
    pub y: f64,
    /// In m².
    pub area: f64,
    /// Place of its material in the list.
    pub material: usize,
}

/// Stress resultants of a section and their derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct SectionResponse {
    /// Axial force Σ σ A and moment −Σ σ A y.
    pub force: [f64; 2],
    /// Σ E A, −Σ E A y and Σ E A y².
    pub stiffness: [f64; 3],
}

impl SectionResponse {
    /// Adds the lanes in their order.
    #[inline(always)]
    fn of<I: Isa>(sums: [Eight<I>; 5]) -> Self {
        let [n, m, a, b, c] = sums;
        let sum = |lanes: [f64; 8]| lanes.into_iter().fold(0.0, |sum, lane| sum + lane);
        Self {
            force: [sum(n.array()), -sum(m.array())],
            stiffness: [sum(a.array()), -sum(b.array()), sum(c.array())],
        }
    }
}

/// Eight fibres of one material. Lanes without a fibre repeat the last one without area.
#[derive(Debug, Clone, Copy)]
struct Block {
    y: [f64; 8],
    area: [f64; 8],
    material: Material,
}

impl Block {
    fn new(fibres: &[Fibre], material: Material) -> Self {
        let (mut y, mut area) = ([0.0; 8], [0.0; 8]);
        for (k, y) in y.iter_mut().enumerate() {
            *y = fibres.get(k).or(fibres.last()).map_or(0.0, |fibre| fibre.y);
        }
        for (area, fibre) in area.iter_mut().zip(fibres) {
            *area = fibre.area;
        }
        Self { y, area, material }
    }

    /// Adds stresses and tangents of this block to the sums of a section.
    #[inline(always)]
    fn add<I: Isa>(&self, [stress, tangent]: [Eight<I>; 2], sums: &mut [Eight<I>; 5]) {
        let (y, area) = (
            Eight::load(stress.0, &self.y),
            Eight::load(stress.0, &self.area),
        );
        let (force, rigidity) = (stress * area, tangent * area);
        let [n, m, a, b, c] = sums;
        *n = *n + force;
        *m = *m + force * y;
        *a = *a + rigidity;
        *b = *b + rigidity * y;
        *c = *c + rigidity * y * y;
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
    /// ε = ε₀ − y κ. Both lists are as long as there are sections. Real-time: yes.
    pub(super) fn trial(
        &mut self,
        lanes: Lanes,
        strains: &[[f64; 2]],
        out: &mut [SectionResponse],
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
    pub(super) fn initial_stiffness(&self) -> [f64; 3] {
        let mut sums = [Eight::all(Portable, 0.0); 5];
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

struct Pass<'a> {
    blocks: &'a [Block],
    old: &'a [[f64; 8]],
    new: &'a mut [[f64; 8]],
    strains: &'a [[f64; 2]],
    out: &'a mut [SectionResponse],
}

impl Kernel for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (mut old, mut new) = (self.old, self.new);
        let zero = Eight::all(isa, 0.0);
        for ([axial, curvature], out) in self.strains.iter().zip(self.out) {
            let mut sums = [zero; 5];
            for block in self.blocks {
                let y = Eight::load(isa, &block.y);
                let strain = Eight::all(isa, *axial) - y * Eight::all(isa, *curvature);
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
