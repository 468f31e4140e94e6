//! Members without their rigid motions: the forces q = (N, M₁, M₂) at deformations v = (elongation, rotations of both ends from
//! the chord), with a fixed number of operations. In space v and q have the rotations and moments about the local axis y at both ends
//! and the twist and torque after these.
//!
//! A force-based member holds its forces exactly in balance along its length and comes to compatible deformations over several
//! evaluations: each corrects q with the flexibility of all sections, and what is left unbalanced in a section enters the next one
//! (Neuenhofer & Filippou 1997, J. Struct. Eng. 123(7); Kolay & Ricles 2018, J. Struct. Eng. 144(2)). Where a material cracks, crushes
//! or opens, one correction is not enough: such a member corrects up to [`PASSES`] times in one evaluation. Hinges in series with an
//! elastic member are sections of no length.

use super::super::fibre::{Fibres, SectionResponse};
use super::super::section::Rigidity;
use super::super::symmetric::{
    Sym, dot, inverse, inverse_of_section, product, visit_upper, widened,
};
use crate::law::{Bearing, Law};
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
    Force(Box<ForceBased<2, 3>>),
    Displacement(Box<DisplacementBased<2>>),
    Hinged(Box<Hinged>),
    Link(Box<dyn Law>),
    Bearing(Box<Bearing>),
    ForceInSpace(Box<ForceBased<3, 5>>),
    DisplacementInSpace(Box<DisplacementBased<3>>),
}

/// Forces and tangent of a member at its last evaluation.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Answer {
    pub(super) force: [f64; 6],
    pub(super) stiffness: Sym<6>,
    /// ∂q₀/∂v̇₀.
    pub(super) damping: f64,
}

impl Answer {
    /// With zeros for the last deformations.
    fn of<const D: usize>(force: &[f64; D], stiffness: &Sym<D>) -> Self {
        let mut all = [0.0; 6];
        for (to, from) in all.iter_mut().zip(force) {
            *to = *from;
        }
        Self {
            force: all,
            stiffness: widened(stiffness),
            damping: 0.0,
        }
    }
}

/// The first deformations.
fn first<const D: usize>(of: &[f64; 6]) -> [f64; D] {
    let mut out = [0.0; D];
    for (to, from) in out.iter_mut().zip(of) {
        *to = *from;
    }
    out
}

/// The place of a deformation among the forces of a section: axial, about z, about z, about y, about y.
const fn of_section(deformation: usize) -> usize {
    deformation.div_ceil(2)
}

impl Basic {
    /// From the committed state of laws and fibres to `disp`. Real-time: yes.
    pub(super) fn trial(
        &mut self,
        disp: &[f64; 6],
        rates: &[f64; 6],
        dt: f64,
        lanes: Lanes,
    ) -> Answer {
        match self {
            Self::Force(member) => member.trial(first(disp), lanes),
            Self::Displacement(member) => member.trial(disp, lanes),
            Self::ForceInSpace(member) => member.trial(first(disp), lanes),
            Self::DisplacementInSpace(member) => member.trial(disp, lanes),
            Self::Hinged(member) => member.trial(first(disp)),
            Self::Link(law) => {
                let force = law.trial(disp[0], rates[0], dt);
                let tangent = law.tangent();
                Answer {
                    damping: tangent.damping,
                    ..Answer::of(&[force], &[[tangent.stiffness]])
                }
            }
            Self::Bearing(bearing) => {
                let mut answer = Answer::default();
                let count = bearing.axes();
                let of = |all: &[f64; 6]| [all[0], all[1], all[2]];
                let (disp, rates, mut force) = (of(disp), of(rates), [0.0; 3]);
                if let (Some(disp), Some(rates), Some(force)) = (
                    disp.get(..count),
                    rates.get(..count),
                    force.get_mut(..count),
                ) {
                    bearing.trial(disp, rates, force);
                }
                answer.force[..3].copy_from_slice(&force);
                answer.stiffness = of_bearing(bearing, |to| bearing.tangent(to));
                answer
            }
        }
    }

    /// Unbalanced forces along a member at its last evaluation, in parts of its largest forces so far. Real-time: yes.
    pub(super) fn unbalance(&self) -> f64 {
        match self {
            Self::Force(member) => member.unbalance(),
            Self::ForceInSpace(member) => member.unbalance(),
            _ => 0.0,
        }
    }

    /// From now on it makes all of its passes, or no more than it needs.
    pub(super) fn exhaust(&mut self, yes: bool) {
        match self {
            Self::Force(member) => member.exhausts = yes,
            Self::ForceInSpace(member) => member.exhausts = yes,
            _ => {}
        }
    }

    /// Real-time: yes.
    pub(super) fn commit(&mut self) {
        match self {
            Self::Force(member) => member.fibres.commit(),
            Self::Displacement(member) => member.fibres.commit(),
            Self::ForceInSpace(member) => member.fibres.commit(),
            Self::DisplacementInSpace(member) => member.fibres.commit(),
            Self::Hinged(member) => member.commit(),
            Self::Link(law) => law.commit(),
            Self::Bearing(bearing) => bearing.commit(),
        }
    }

    /// Stiffness of the virgin member.
    pub(in crate::frame) fn initial(&self) -> Sym<6> {
        match self {
            Self::Force(member) => widened(&member.initial),
            Self::Displacement(member) => member.stiffness(|_| member.fibres.initial_stiffness()),
            Self::ForceInSpace(member) => widened(&member.initial),
            Self::DisplacementInSpace(member) => {
                member.stiffness(|_| member.fibres.initial_stiffness())
            }
            Self::Hinged(member) => widened(&member.initial),
            Self::Link(law) => widened(&[[law.reference().stiffness]]),
            Self::Bearing(bearing) => {
                of_bearing(bearing, |to| bearing.reference(to, &mut [0.0; 9]))
            }
        }
    }

    /// The largest use of its start and its end so far, in parts of what makes them yield.
    pub(super) fn demand(&self) -> [f64; 2] {
        match self {
            Self::Force(member) => at_ends(&member.fibres, &member.points),
            Self::Displacement(member) => at_ends(&member.fibres, &member.points),
            Self::ForceInSpace(member) => at_ends(&member.fibres, &member.points),
            Self::DisplacementInSpace(member) => at_ends(&member.fibres, &member.points),
            Self::Hinged(member) => member.demand,
            Self::Link(_) | Self::Bearing(_) => [0.0; 2],
        }
    }
}

/// A matrix of a bearing, which `fill` writes column by column. Real-time: yes.
pub(super) fn of_bearing(bearing: &Bearing, fill: impl FnOnce(&mut [f64])) -> Sym<6> {
    let count = bearing.axes();
    let mut entries = [0.0; 9];
    if let Some(entries) = entries.get_mut(..count * count) {
        fill(entries);
    }
    let mut out = [[0.0; 6]; 6];
    for (row, out) in out.iter_mut().enumerate().take(count) {
        for (column, out) in out.iter_mut().enumerate().take(count) {
            *out = entries.get(row + count * column).copied().unwrap_or(0.0);
        }
    }
    out
}

fn at_ends(fibres: &Fibres, points: &[Point]) -> [f64; 2] {
    [0, points.len().saturating_sub(1)].map(|section| fibres.demand(section))
}

impl Stateful for Basic {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        match self {
            Self::Force(member) => member.visit_state(visit),
            Self::Displacement(member) => member.visit_state(visit),
            Self::ForceInSpace(member) => member.visit_state(visit),
            Self::DisplacementInSpace(member) => member.visit_state(visit),
            Self::Hinged(member) => member.visit_state(visit),
            Self::Link(law) => law.visit_state(visit),
            Self::Bearing(bearing) => bearing.visit_state(visit),
        }
    }
}

/// Place ξ along a member, and its weight in m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    pub(super) xi: f64,
    pub(super) weight: f64,
}

/// Sections at points along a member, with forces that vary linearly between its ends: S forces of a section, D deformations.
#[derive(Debug)]
pub(in crate::frame) struct ForceBased<const S: usize, const D: usize> {
    points: Vec<Point>,
    fibres: Fibres,
    initial: Sym<D>,
    /// Stiffness of a virgin section, and its inverse.
    virgin: Sym<S>,
    soft: Sym<S>,
    force: [f64; D],
    disp: [f64; D],
    tangent: Sym<D>,
    strains: Vec<[f64; S]>,
    sections: Vec<SectionResponse<S>>,
    /// Work of the section forces on a virgin section, ∫ sᵀ f₀ s dx: the largest so far, and that of the present unbalance.
    largest: f64,
    left_over: f64,
    /// Strains, and their change by the next correction; forces and unbalance before it.
    before: Vec<[[f64; S]; 2]>,
    force_before: [f64; D],
    left_before: f64,
    passes: u32,
    /// All passes are made.
    exhausts: bool,
}

impl<const S: usize, const D: usize> Stateful for ForceBased<S, D> {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.fibres.visit_state(visit);
        let own = self.force.iter_mut().chain(&mut self.disp);
        own.for_each(|x| visit.number(x));
        visit_upper(&mut self.tangent, D, visit);
        let own = [&mut self.largest, &mut self.left_over];
        own.into_iter().for_each(|x| visit.number(x));
        self.strains
            .iter_mut()
            .flatten()
            .for_each(|x| visit.number(x));
        for section in &mut self.sections {
            section.force.iter_mut().for_each(|x| visit.number(x));
            visit_upper(&mut section.stiffness, S, visit);
        }
    }
}

impl<const S: usize, const D: usize> ForceBased<S, D> {
    /// `None` if its sections have no stiffness.
    pub(super) fn new(points: Vec<Point>, fibres: Fibres) -> Option<Self> {
        let virgin = fibres.initial_stiffness();
        let count = points.len();
        let section = SectionResponse {
            force: [0.0; S],
            stiffness: virgin,
        };
        let mut new = Self {
            points,
            passes: if fibres.are_brittle() { PASSES } else { 1 },
            exhausts: false,
            largest: 0.0,
            left_over: 0.0,
            before: vec![[[0.0; S]; 2]; count],
            force_before: [0.0; D],
            left_before: 0.0,
            fibres,
            initial: [[0.0; D]; D],
            virgin,
            soft: inverse_of_section(&virgin, &virgin),
            force: [0.0; D],
            disp: [0.0; D],
            tangent: [[0.0; D]; D],
            strains: vec![[0.0; S]; count],
            sections: vec![section; count],
        };
        new.initial = inverse(&new.flexibility().0)?;
        new.tangent = new.initial;
        Some(new)
    }

    /// Force of a section that each force of the member makes: the axial one all along, moments linearly. Real-time: yes.
    fn shares(point: &Point) -> [f64; D] {
        let mut shares = [1.0; D];
        for (k, share) in shares.iter_mut().enumerate().skip(1) {
            *share = if k % 2 == 1 { point.xi - 1.0 } else { point.xi };
        }
        shares
    }

    /// Flexibility, and the deformations that the sections would have without their unbalanced forces. Real-time: yes.
    fn flexibility(&self) -> (Sym<D>, [f64; D]) {
        let (mut flexibility, mut disp) = ([[0.0; D]; D], [0.0; D]);
        let sections = self.strains.iter().zip(&self.sections);
        for (point, (strain, section)) in self.points.iter().zip(sections) {
            let f = inverse_of_section(&section.stiffness, &self.virgin);
            let shares = Self::shares(point);
            let left = self.left(point, section);
            let mut whole = *strain;
            for (whole, row) in whole.iter_mut().zip(&f) {
                *whole = row
                    .iter()
                    .zip(&left)
                    .fold(*whole, |sum, (f, x)| sum + f * x);
            }
            let w = point.weight;
            for (r, (row, share)) in flexibility.iter_mut().zip(&shares).enumerate() {
                let own = f.get(of_section(r));
                for (c, (sum, other)) in row.iter_mut().zip(&shares).enumerate() {
                    let f = own.and_then(|own| own.get(of_section(c)));
                    *sum += w * (f.copied().unwrap_or(0.0) * share * other);
                }
                if let (Some(sum), Some(whole)) = (disp.get_mut(r), whole.get(of_section(r))) {
                    *sum += w * (whole * share);
                }
            }
        }
        (flexibility, disp)
    }

    /// Forces of the member at a point beyond those of its section. Real-time: yes.
    fn left(&self, point: &Point, section: &SectionResponse<S>) -> [f64; S] {
        let mut of = [-0.0; S];
        for (k, (force, share)) in self.force.iter().zip(Self::shares(point)).enumerate() {
            if let Some(sum) = of.get_mut(of_section(k)) {
                *sum += share * force;
            }
        }
        for (of, force) in of.iter_mut().zip(&section.force) {
            *of -= force;
        }
        of
    }

    fn trial(&mut self, disp: [f64; D], lanes: Lanes) -> Answer {
        self.correct(&difference(&disp, &self.disp));
        self.disp = disp;
        let mut left = self.passes;
        let mut share = 1.0;
        self.note();
        while left > 0 {
            self.pass(&disp, share, lanes);
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
        Answer::of(&self.force, &self.tangent)
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
        self.left_before = 0.0;
        for k in 0..self.points.len() {
            let (Some(point), Some(section)) = (self.points.get(k), self.sections.get(k)) else {
                continue;
            };
            let left = self.left(point, section);
            self.left_before += point.weight * work(&self.soft, &left);
            let f = inverse_of_section(&section.stiffness, &self.virgin);
            let (Some(strain), Some(before)) = (self.strains.get(k), self.before.get_mut(k)) else {
                continue;
            };
            *before = [*strain, product(&f, &left)];
        }
    }

    /// A share of the correction that was noted. Real-time: yes.
    fn pass(&mut self, disp: &[f64; D], share: f64, lanes: Lanes) {
        for (strain, [from, by]) in self.strains.iter_mut().zip(&self.before) {
            for (strain, (from, by)) in strain.iter_mut().zip(from.iter().zip(by)) {
                *strain = from + share * by;
            }
        }
        self.fibres.trial(lanes, &self.strains, &mut self.sections);
        let (flexibility, compatible) = self.flexibility();
        self.tangent = inverse(&flexibility).unwrap_or(self.initial);
        self.correct(&difference(disp, &compatible));
        let (mut all, mut left_over) = (0.0, 0.0);
        for (point, section) in self.points.iter().zip(&self.sections) {
            all += point.weight * work(&self.soft, &section.force);
            left_over += point.weight * work(&self.soft, &self.left(point, section));
        }
        self.largest = self.largest.max(all);
        self.left_over = left_over;
    }

    /// Forces for a change of the deformations. Real-time: yes.
    fn correct(&mut self, change: &[f64; D]) {
        let by = product(&self.tangent, change);
        for (force, by) in self.force.iter_mut().zip(by) {
            *force += by;
        }
    }
}

/// a − b. Real-time: yes.
fn difference<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    let mut out = *a;
    for (out, b) in out.iter_mut().zip(b) {
        *out -= b;
    }
    out
}

/// sᵀ f s of forces of a section. Real-time: yes.
fn work<const S: usize>(f: &Sym<S>, forces: &[f64; S]) -> f64 {
    dot(forces, &product(f, forces))
}

/// Sections at points along a member, with an axial strain that is constant and curvatures that vary linearly: S strains of a section.
#[derive(Debug)]
pub(in crate::frame) struct DisplacementBased<const S: usize> {
    pub(super) points: Vec<Point>,
    pub(super) fibres: Fibres,
    pub(super) length: f64,
    /// A truss member bends nowhere.
    pub(super) bends: bool,
    pub(super) strains: Vec<[f64; S]>,
    pub(super) sections: Vec<SectionResponse<S>>,
}

impl<const S: usize> Stateful for DisplacementBased<S> {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.fibres.visit_state(visit);
    }
}

impl<const S: usize> DisplacementBased<S> {
    pub(super) fn new(points: Vec<Point>, fibres: Fibres, length: f64, bends: bool) -> Self {
        let section = SectionResponse {
            force: [0.0; S],
            stiffness: fibres.initial_stiffness(),
        };
        let count = points.len();
        Self {
            points,
            fibres,
            length,
            bends,
            strains: vec![[0.0; S]; count],
            sections: vec![section; count],
        }
    }

    /// Deformations of a member with sections of S strains.
    const D: usize = 2 * S - 1;

    /// Curvature at a point for unit rotations. Real-time: yes.
    fn curves(&self, point: &Point) -> [f64; 2] {
        if self.bends {
            [6.0 * point.xi - 4.0, 6.0 * point.xi - 2.0].map(|x| x / self.length)
        } else {
            [0.0; 2]
        }
    }

    fn stiffness(&self, of: impl Fn(usize) -> Sym<S>) -> Sym<6> {
        let mut sum = [[0.0; 6]; 6];
        let along = 1.0 / self.length;
        for (k, point) in self.points.iter().enumerate() {
            let ([start, end], s) = (self.curves(point), of(k));
            let shares = [along, start, end, start, end];
            for (r, (row, share)) in sum.iter_mut().zip(shares).enumerate().take(Self::D) {
                let own = s.get(of_section(r));
                for (c, (sum, other)) in row.iter_mut().zip(shares).enumerate().take(Self::D) {
                    // The upper half decides the bits of both.
                    let [share, other] = if r <= c {
                        [share, other]
                    } else {
                        [other, share]
                    };
                    let s = own.and_then(|own| own.get(of_section(c)));
                    *sum += point.weight * (s.copied().unwrap_or(0.0) * share * other);
                }
            }
        }
        sum
    }

    fn trial(&mut self, disp: &[f64; 6], lanes: Lanes) -> Answer {
        for k in 0..self.points.len() {
            let Some([start, end]) = self.points.get(k).map(|point| self.curves(point)) else {
                continue;
            };
            if let Some(strain) = self.strains.get_mut(k) {
                let [stretch, turns @ ..] = disp;
                let (pairs, _) = turns.as_chunks::<2>();
                let curves = pairs.iter().map(|[a, b]| start * a + end * b);
                let all = std::iter::once(stretch / self.length).chain(curves);
                strain.iter_mut().zip(all).for_each(|(to, from)| *to = from);
            }
        }
        self.fibres.trial(lanes, &self.strains, &mut self.sections);
        let mut force = [0.0; 6];
        for (point, section) in self.points.iter().zip(&self.sections) {
            let [start, end] = self.curves(point);
            let [axial, moments @ ..] = &mut force;
            if let Some(own) = section.force.first() {
                *axial += point.weight * (own / self.length);
            }
            let (pairs, _) = moments.as_chunks_mut::<2>();
            for ([first, second], own) in pairs.iter_mut().zip(section.force.iter().skip(1)) {
                *first += point.weight * (own * start);
                *second += point.weight * (own * end);
            }
        }
        let of = |k: usize| self.sections.get(k).map_or([[0.0; S]; S], |s| s.stiffness);
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
    initial: Sym<3>,
    force: [f64; 3],
    disp: [f64; 3],
    tangent: Sym<3>,
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
        own.for_each(|x| visit.number(x));
        visit_upper(&mut self.tangent, 3, visit);
        self.demand.iter_mut().for_each(|x| visit.number(x));
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
            initial: [[0.0; 3]; 3],
            force: [0.0; 3],
            disp: [0.0; 3],
            tangent: [[0.0; 3]; 3],
            demand: [0.0; 2],
        };
        new.initial = inverse(&new.flexibility().0)?;
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
    fn flexibility(&self) -> (Sym<3>, [f64; 3]) {
        let [axial, start, end] = self.force;
        let (own, other) = (self.bending, -0.5 * self.bending);
        let mut flexibility = [[self.axial, 0.0, 0.0], [0.0, own, other], [0.0, other, own]];
        let mut disp = [
            self.axial * axial,
            own * start + other * end,
            other * start + own * end,
        ];
        let [_, of_start, of_end] = &mut flexibility;
        let [_, turn, other_turn] = &mut disp;
        let ends = [
            (&mut of_start[1], turn, start),
            (&mut of_end[2], other_turn, end),
        ];
        for (hinge, (entry, disp, moment)) in self.hinges.iter().zip(ends) {
            let Some(hinge) = hinge else { continue };
            let f = hinge.flexibility();
            *entry += f;
            *disp += hinge.rotation + f * (moment - hinge.moment);
        }
        (flexibility, disp)
    }

    fn trial(&mut self, disp: [f64; 3]) -> Answer {
        self.correct(&difference(&disp, &self.disp));
        self.disp = disp;
        let [_, start, end] = self.force;
        for (hinge, moment) in self.hinges.iter_mut().zip([start, end]) {
            let Some(hinge) = hinge else { continue };
            hinge.rotation += hinge.flexibility() * (moment - hinge.moment);
            hinge.moment = hinge.law.trial(hinge.rotation, 0.0, 0.0);
            hinge.stiffness = hinge.law.tangent().stiffness;
        }
        let (flexibility, compatible) = self.flexibility();
        self.tangent = inverse(&flexibility).unwrap_or(self.initial);
        self.correct(&difference(&disp, &compatible));
        Answer::of(&self.force, &self.tangent)
    }

    /// Forces for a change of the deformations. Real-time: yes.
    fn correct(&mut self, change: &[f64; 3]) {
        let by = product(&self.tangent, change);
        for (force, by) in self.force.iter_mut().zip(by) {
            *force += by;
        }
    }
}
