//! Members without their rigid motions: the forces q = (N, M₁, M₂) at deformations v = (elongation, rotations of both ends from
//! the chord), with a fixed number of operations.
//!
//! A force-based member holds its forces exactly in balance along its length and comes to compatible deformations over several
//! evaluations: each corrects q with the flexibility of all sections, and what is left unbalanced in a section enters the next one
//! (Neuenhofer & Filippou 1997, J. Struct. Eng. 123(7); Kolay & Ricles 2018, J. Struct. Eng. 144(2)). Where a material cracks, crushes
//! or opens, one correction is not enough: such a member corrects up to [`PASSES`] times in one evaluation. Hinges in series with an
//! elastic member are sections of no length.

use super::super::fibre::{Fibres, SectionResponse};
use super::super::section::Rigidity;
use super::symmetric::{Sym2, Sym3, inverse2, inverse3, product3};
use crate::law::Law;
use crate::linalg::Lanes;
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, Visit};

/// Corrections in one evaluation of a force-based member with a brittle material, at most.
const PASSES: u32 = 12;
/// Share of a correction that is made even if it makes the balance worse.
const LEAST_SHARE: f64 = 0.2;
/// Square of the unbalance of sections, in parts of the largest forces so far, that is no unbalance.
const BALANCED: f64 = 1e-10;

/// A member of one kind.
#[derive(Debug)]
pub(in crate::frame) enum Basic {
    Force(Box<ForceBased>),
    Displacement(Box<DisplacementBased>),
    Hinged(Box<Hinged>),
    Link(Box<dyn Law>),
}

/// Forces and tangent of a member at its last evaluation.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Answer {
    pub(super) force: [f64; 3],
    pub(super) stiffness: Sym3,
    /// ∂q₀/∂v̇₀.
    pub(super) damping: f64,
}

impl Basic {
    /// From the committed state of laws and fibres to `disp`. Real-time: yes.
    pub(super) fn trial(&mut self, disp: [f64; 3], rate: f64, dt: f64, lanes: Lanes) -> Answer {
        match self {
            Self::Force(member) => member.trial(disp, lanes),
            Self::Displacement(member) => member.trial(disp, lanes),
            Self::Hinged(member) => member.trial(disp),
            Self::Link(law) => {
                let force = law.trial(disp[0], rate, dt);
                let tangent = law.tangent();
                Answer {
                    force: [force, 0.0, 0.0],
                    stiffness: [tangent.stiffness, 0.0, 0.0, 0.0, 0.0, 0.0],
                    damping: tangent.damping,
                }
            }
        }
    }

    /// Unbalanced forces along a member at its last evaluation, in parts of its largest forces so far. Real-time: yes.
    pub(super) fn unbalance(&self) -> f64 {
        match self {
            Self::Force(member) => member.unbalance(),
            _ => 0.0,
        }
    }

    /// From now on it makes all of its passes, or no more than it needs.
    pub(super) fn exhaust(&mut self, yes: bool) {
        if let Self::Force(member) = self {
            member.exhausts = yes;
        }
    }

    /// Real-time: yes.
    pub(super) fn commit(&mut self) {
        match self {
            Self::Force(member) => member.fibres.commit(),
            Self::Displacement(member) => member.fibres.commit(),
            Self::Hinged(member) => member.commit(),
            Self::Link(law) => law.commit(),
        }
    }

    /// Stiffness of the virgin member.
    pub(in crate::frame) fn initial(&self) -> Sym3 {
        match self {
            Self::Force(member) => member.initial,
            Self::Displacement(member) => member.stiffness(|_| member.fibres.initial_stiffness()),
            Self::Hinged(member) => member.initial,
            Self::Link(law) => [law.reference().stiffness, 0.0, 0.0, 0.0, 0.0, 0.0],
        }
    }

    /// The largest use of its start and its end so far, in parts of what makes them yield.
    pub(super) fn demand(&self) -> [f64; 2] {
        match self {
            Self::Force(member) => at_ends(&member.fibres, &member.points),
            Self::Displacement(member) => at_ends(&member.fibres, &member.points),
            Self::Hinged(member) => member.demand,
            Self::Link(_) => [0.0; 2],
        }
    }
}

fn at_ends(fibres: &Fibres, points: &[Point]) -> [f64; 2] {
    [0, points.len().saturating_sub(1)].map(|section| fibres.demand(section))
}

impl Stateful for Basic {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        match self {
            Self::Force(member) => member.visit_state(visit),
            Self::Displacement(member) => member.visit_state(visit),
            Self::Hinged(member) => member.visit_state(visit),
            Self::Link(law) => law.visit_state(visit),
        }
    }
}

/// Place ξ along a member, and its weight in m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) xi: f64,
    pub(super) weight: f64,
}

/// Sections at points along a member, with forces that vary linearly between its ends.
#[derive(Debug)]
pub(in crate::frame) struct ForceBased {
    points: Vec<Point>,
    fibres: Fibres,
    initial: Sym3,
    /// Stiffness of a virgin section.
    virgin: Sym2,
    force: [f64; 3],
    disp: [f64; 3],
    tangent: Sym3,
    strains: Vec<[f64; 2]>,
    sections: Vec<SectionResponse>,
    /// Work of the section forces on a virgin section, ∫ sᵀ f₀ s dx: the largest so far, and that of the present unbalance.
    largest: f64,
    left_over: f64,
    /// Strains, and their change by the next correction; forces and unbalance before it.
    before: Vec<[[f64; 2]; 2]>,
    force_before: [f64; 3],
    left_before: f64,
    passes: u32,
    /// All passes are made.
    exhausts: bool,
}

impl Stateful for ForceBased {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.fibres.visit_state(visit);
        let own = self.force.iter_mut().chain(&mut self.disp);
        let own = own.chain(&mut self.tangent);
        let own = own.chain([&mut self.largest, &mut self.left_over]);
        own.for_each(|x| visit.number(x));
        self.strains
            .iter_mut()
            .flatten()
            .for_each(|x| visit.number(x));
        for section in &mut self.sections {
            let both = section.force.iter_mut().chain(&mut section.stiffness);
            both.for_each(|x| visit.number(x));
        }
    }
}

impl ForceBased {
    /// `None` if its sections have no stiffness.
    pub(super) fn new(points: Vec<Point>, fibres: Fibres) -> Option<Self> {
        let virgin = fibres.initial_stiffness();
        let count = points.len();
        let section = SectionResponse {
            force: [0.0; 2],
            stiffness: virgin,
        };
        let mut new = Self {
            points,
            passes: if fibres.are_brittle() { PASSES } else { 1 },
            exhausts: false,
            largest: 0.0,
            left_over: 0.0,
            before: vec![[[0.0; 2]; 2]; count],
            force_before: [0.0; 3],
            left_before: 0.0,
            fibres,
            initial: [0.0; 6],
            virgin,
            force: [0.0; 3],
            disp: [0.0; 3],
            tangent: [0.0; 6],
            strains: vec![[0.0; 2]; count],
            sections: vec![section; count],
        };
        new.initial = inverse3(new.flexibility().0)?;
        new.tangent = new.initial;
        Some(new)
    }

    /// Flexibility, and the deformations that the sections would have without their unbalanced forces. Real-time: yes.
    fn flexibility(&self) -> (Sym3, [f64; 3]) {
        let (mut flexibility, mut disp) = ([0.0; 6], [0.0; 3]);
        let sections = self.strains.iter().zip(&self.sections);
        for (point, (strain, section)) in self.points.iter().zip(sections) {
            let f = inverse2(section.stiffness, self.virgin);
            let (start, end) = (point.xi - 1.0, point.xi);
            let left = self.left(point, section);
            let stretch = strain[0] + f[0] * left[0] + f[1] * left[1];
            let curve = strain[1] + f[1] * left[0] + f[2] * left[1];
            let w = point.weight;
            let terms = [
                f[0],
                f[1] * start,
                f[1] * end,
                f[2] * start * start,
                f[2] * start * end,
                f[2] * end * end,
            ];
            for (sum, term) in flexibility.iter_mut().zip(terms) {
                *sum += w * term;
            }
            for (sum, term) in disp.iter_mut().zip([stretch, curve * start, curve * end]) {
                *sum += w * term;
            }
        }
        (flexibility, disp)
    }

    /// Forces of the member at a point beyond those of its section. Real-time: yes.
    fn left(&self, point: &Point, section: &SectionResponse) -> [f64; 2] {
        let [axial, start, end] = self.force;
        let moment = (point.xi - 1.0) * start + point.xi * end;
        [axial - section.force[0], moment - section.force[1]]
    }

    fn trial(&mut self, disp: [f64; 3], lanes: Lanes) -> Answer {
        self.correct([0, 1, 2].map(|k| disp[k] - self.disp[k]));
        self.disp = disp;
        let mut left = self.passes;
        let mut share = 1.0;
        self.note();
        while left > 0 {
            self.pass(disp, share, lanes);
            left -= 1;
            if self.passes > 1
                && share > LEAST_SHARE
                && (self.left_over >= self.left_before || self.left_over.is_nan())
                && left > 0
            {
                // It went too far.
                share *= 0.5;
                self.force = self.force_before;
                continue;
            }
            if !self.exhausts && self.left_over <= BALANCED * self.largest {
                break;
            }
            share = 1.0;
            self.note();
        }
        Answer {
            force: self.force,
            stiffness: self.tangent,
            damping: 0.0,
        }
    }

    /// Unbalanced forces of the sections over their largest forces so far, at the last evaluation. Real-time: yes.
    fn unbalance(&self) -> f64 {
        if self.left_over == 0.0 {
            0.0
        } else {
            (self.left_over / self.largest).sqrt()
        }
    }

    /// Notes from where the next correction goes, and which way. Real-time: yes.
    fn note(&mut self) {
        self.force_before = self.force;
        let soft = inverse2(self.virgin, self.virgin);
        self.left_before = 0.0;
        for k in 0..self.points.len() {
            let (Some(point), Some(section)) = (self.points.get(k), self.sections.get(k)) else {
                continue;
            };
            let left = self.left(point, section);
            self.left_before += point.weight * work(soft, left);
            let f = inverse2(section.stiffness, self.virgin);
            let (Some(strain), Some(before)) = (self.strains.get(k), self.before.get_mut(k)) else {
                continue;
            };
            *before = [
                *strain,
                [
                    f[0] * left[0] + f[1] * left[1],
                    f[1] * left[0] + f[2] * left[1],
                ],
            ];
        }
    }

    /// A share of the correction that was noted. Real-time: yes.
    fn pass(&mut self, disp: [f64; 3], share: f64, lanes: Lanes) {
        for (strain, [from, by]) in self.strains.iter_mut().zip(&self.before) {
            *strain = [from[0] + share * by[0], from[1] + share * by[1]];
        }
        self.fibres.trial(lanes, &self.strains, &mut self.sections);
        let (flexibility, compatible) = self.flexibility();
        self.tangent = inverse3(flexibility).unwrap_or(self.initial);
        self.correct([0, 1, 2].map(|k| disp[k] - compatible[k]));
        let soft = inverse2(self.virgin, self.virgin);
        let (mut all, mut left_over) = (0.0, 0.0);
        for (point, section) in self.points.iter().zip(&self.sections) {
            all += point.weight * work(soft, section.force);
            left_over += point.weight * work(soft, self.left(point, section));
        }
        self.largest = self.largest.max(all);
        self.left_over = left_over;
    }

    /// Forces for a change of the deformations. Real-time: yes.
    fn correct(&mut self, change: [f64; 3]) {
        let by = product3(&self.tangent, change);
        for (force, by) in self.force.iter_mut().zip(by) {
            *force += by;
        }
    }
}

/// sᵀ f s of forces of a section. Real-time: yes.
fn work(f: Sym2, [n, m]: [f64; 2]) -> f64 {
    n * (f[0] * n + f[1] * m) + m * (f[1] * n + f[2] * m)
}

/// Sections at points along a member, with an axial strain that is constant and a curvature that varies linearly.
#[derive(Debug)]
pub(in crate::frame) struct DisplacementBased {
    pub(super) points: Vec<Point>,
    pub(super) fibres: Fibres,
    pub(super) length: f64,
    /// A truss member bends nowhere.
    pub(super) bends: bool,
    pub(super) strains: Vec<[f64; 2]>,
    pub(super) sections: Vec<SectionResponse>,
}

impl Stateful for DisplacementBased {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.fibres.visit_state(visit);
    }
}

impl DisplacementBased {
    pub(super) fn new(points: Vec<Point>, fibres: Fibres, length: f64, bends: bool) -> Self {
        let section = SectionResponse {
            force: [0.0; 2],
            stiffness: fibres.initial_stiffness(),
        };
        let count = points.len();
        Self {
            points,
            fibres,
            length,
            bends,
            strains: vec![[0.0; 2]; count],
            sections: vec![section; count],
        }
    }

    /// Curvature at a point for unit rotations. Real-time: yes.
    fn curves(&self, point: &Point) -> [f64; 2] {
        if self.bends {
            [6.0 * point.xi - 4.0, 6.0 * point.xi - 2.0].map(|x| x / self.length)
        } else {
            [0.0; 2]
        }
    }

    fn stiffness(&self, of: impl Fn(usize) -> Sym2) -> Sym3 {
        let mut sum = [0.0; 6];
        for (k, point) in self.points.iter().enumerate() {
            let ([start, end], s) = (self.curves(point), of(k));
            let along = 1.0 / self.length;
            let terms = [
                s[0] * along * along,
                s[1] * along * start,
                s[1] * along * end,
                s[2] * start * start,
                s[2] * start * end,
                s[2] * end * end,
            ];
            for (sum, term) in sum.iter_mut().zip(terms) {
                *sum += point.weight * term;
            }
        }
        sum
    }

    fn trial(&mut self, disp: [f64; 3], lanes: Lanes) -> Answer {
        for k in 0..self.points.len() {
            let Some([start, end]) = self.points.get(k).map(|point| self.curves(point)) else {
                continue;
            };
            if let Some(strain) = self.strains.get_mut(k) {
                *strain = [disp[0] / self.length, start * disp[1] + end * disp[2]];
            }
        }
        self.fibres.trial(lanes, &self.strains, &mut self.sections);
        let mut force = [0.0; 3];
        for (point, section) in self.points.iter().zip(&self.sections) {
            let [start, end] = self.curves(point);
            let terms = [
                section.force[0] / self.length,
                section.force[1] * start,
                section.force[1] * end,
            ];
            for (sum, term) in force.iter_mut().zip(terms) {
                *sum += point.weight * term;
            }
        }
        let of = |k: usize| self.sections.get(k).map_or([0.0; 3], |s| s.stiffness);
        Answer {
            force,
            stiffness: self.stiffness(of),
            damping: 0.0,
        }
    }
}

/// An elastic member with hinges in series at its ends.
#[derive(Debug)]
pub(in crate::frame) struct Hinged {
    /// L/(E A), L/(3 E I).
    axial: f64,
    bending: f64,
    hinges: [Option<Hinge>; 2],
    initial: Sym3,
    force: [f64; 3],
    disp: [f64; 3],
    tangent: Sym3,
    /// Largest rotation in parts of that at yield.
    demand: [f64; 2],
}

/// The law of a hinge, and its moment at yield if it has one.
pub(in crate::frame) type HingeLaw = (Box<dyn Law>, Option<f64>);

#[derive(Debug)]
struct Hinge {
    law: Box<dyn Law>,
    yield_rotation: Option<f64>,
    rotation: f64,
    moment: f64,
    stiffness: f64,
}

state! { Hinge { law, rotation, moment, stiffness } keeps { yield_rotation } }

impl Stateful for Hinged {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        for hinge in self.hinges.iter_mut().flatten() {
            hinge.visit_state(visit);
        }
        let own = self.force.iter_mut().chain(&mut self.disp);
        let own = own.chain(&mut self.tangent).chain(&mut self.demand);
        own.for_each(|x| visit.number(x));
    }
}

/// Share of its first stiffness below which a hinge counts as having that one: it would turn without end.
const LEAST_STIFFNESS: f64 = 1e-6;

impl Hinge {
    fn flexibility(&self) -> f64 {
        let least = LEAST_STIFFNESS * self.law.reference().stiffness;
        if self.stiffness.abs() < least {
            1.0 / least
        } else {
            1.0 / self.stiffness
        }
    }
}

impl Hinged {
    /// Between `hinges`, each with its moment at yield, if it has one.
    pub(super) fn new(length: f64, of: Rigidity, hinges: [Option<HingeLaw>; 2]) -> Option<Self> {
        let hinges = hinges.map(|hinge| {
            let (law, yields) = hinge?;
            let stiffness = law.reference().stiffness;
            Some(Hinge {
                law,
                yield_rotation: yields.map(|moment| moment / stiffness),
                rotation: 0.0,
                moment: 0.0,
                stiffness,
            })
        });
        let mut new = Self {
            axial: length / of.axial,
            bending: length / (3.0 * of.bending),
            hinges,
            initial: [0.0; 6],
            force: [0.0; 3],
            disp: [0.0; 3],
            tangent: [0.0; 6],
            demand: [0.0; 2],
        };
        new.initial = inverse3(new.flexibility().0)?;
        new.tangent = new.initial;
        Some(new)
    }

    fn commit(&mut self) {
        for (hinge, demand) in self.hinges.iter_mut().zip(&mut self.demand) {
            let Some(hinge) = hinge else { continue };
            hinge.law.commit();
            if let Some(at_yield) = hinge.yield_rotation {
                *demand = demand.max((hinge.rotation / at_yield).abs());
            }
        }
    }

    /// As [`ForceBased::flexibility`]. Real-time: yes.
    fn flexibility(&self) -> (Sym3, [f64; 3]) {
        let [axial, start, end] = self.force;
        let (own, other) = (self.bending, -0.5 * self.bending);
        let mut flexibility = [self.axial, 0.0, 0.0, own, other, own];
        let mut disp = [
            self.axial * axial,
            own * start + other * end,
            other * start + own * end,
        ];
        let ends = [(3, 1, start), (5, 2, end)];
        for (hinge, (entry, row, moment)) in self.hinges.iter().zip(ends) {
            let Some(hinge) = hinge else { continue };
            let f = hinge.flexibility();
            if let (Some(entry), Some(disp)) = (flexibility.get_mut(entry), disp.get_mut(row)) {
                *entry += f;
                *disp += hinge.rotation + f * (moment - hinge.moment);
            }
        }
        (flexibility, disp)
    }

    fn trial(&mut self, disp: [f64; 3]) -> Answer {
        self.correct([0, 1, 2].map(|k| disp[k] - self.disp[k]));
        self.disp = disp;
        let [_, start, end] = self.force;
        for (hinge, moment) in self.hinges.iter_mut().zip([start, end]) {
            let Some(hinge) = hinge else { continue };
            hinge.rotation += hinge.flexibility() * (moment - hinge.moment);
            hinge.moment = hinge.law.trial(hinge.rotation, 0.0, 0.0);
            hinge.stiffness = hinge.law.tangent().stiffness;
        }
        let (flexibility, compatible) = self.flexibility();
        self.tangent = inverse3(flexibility).unwrap_or(self.initial);
        self.correct([0, 1, 2].map(|k| disp[k] - compatible[k]));
        Answer {
            force: self.force,
            stiffness: self.tangent,
            damping: 0.0,
        }
    }

    /// Forces for a change of the deformations. Real-time: yes.
    fn correct(&mut self, change: [f64; 3]) {
        let by = product3(&self.tangent, change);
        for (force, by) in self.force.iter_mut().zip(by) {
            *force += by;
        }
    }
}
