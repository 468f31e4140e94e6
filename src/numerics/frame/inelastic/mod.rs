//! Members of a frame whose forces are not linear, and links: evaluated in each step, beside K.
//!
//! A trial starts the laws and fibres from their committed state. Force-based and hinged members go on from the forces of the trial
//! before, so that several trials of one step bring them nearer to compatible deformations.

mod basic;
mod quadrature;
#[cfg(test)]
mod tests;

use basic::of_bearing;
pub(super) use basic::{Basic, HingeLaw};
use std::ops::Range;

use basic::{Answer, DisplacementBased, ForceBased, Hinged, Point};

use super::corotation::Corotation;
use super::fibre::Fibres;
use super::member::Beside;
use super::section::Rigidity;
use super::symmetric::{Sym, dot, product, visit_upper, widened};
use crate::law::Reach;
use crate::linalg::Lanes;
use gusset_quantity::state::{Stateful, Visit};

/// Steps of which the least unbalance counts: what one step leaves over at a kink, the next ones remove.
const STEPS: usize = 6;
/// An unbalance along a member that a further evaluation is to remove.
const BALANCED: f64 = 1e-5;

/// All members of a frame that are not part of K.
#[derive(Debug, Default)]
pub struct Members {
    each: Vec<Member>,
    /// Largest unbalance along a member in the last steps, the newest first.
    unbalances: [f64; STEPS],
    /// A step evaluates members once, because no search for balance repeats it.
    is_single: bool,
}

impl Stateful for Members {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        for member in &mut self.each {
            member.visit_state(visit);
        }
        if !self.each.is_empty() {
            self.unbalances.iter_mut().for_each(|x| visit.number(x));
        }
    }
}

/// A member or link between degrees of freedom.
#[derive(Debug)]
pub struct Member {
    /// From 1: members, then links.
    number: usize,
    name: String,
    is_recorded: bool,
    /// A link that acts on rotations.
    turns: bool,
    place: Place,
    basic: Basic,
    /// Deformations in space that stay linear.
    beside: Option<Beside>,
    /// Its place where it moves far.
    moving: Option<Box<Moving>>,
    reach: Reach,
    /// v, and what the last trial gave.
    disp: [f64; 6],
    answer: Answer,
}

impl Stateful for Member {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.basic.visit_state(visit);
        let count = self.count();
        let own = self.disp.iter_mut().take(count);
        let own = own.chain(self.answer.force.iter_mut().take(count));
        own.for_each(|x| visit.number(x));
        visit_upper(&mut self.answer.stiffness, count, visit);
        visit.number(&mut self.answer.damping);
        if let Some(moving) = &mut self.moving {
            moving.moved.iter_mut().for_each(|x| visit.number(x));
            visit.number(&mut moving.largest);
            visit.number(&mut moving.least);
            let disp = moving.turn();
            moving.note(disp[0], &self.answer.force);
        }
    }
}

/// A member with corotational geometry: its place now.
#[derive(Debug)]
pub(super) struct Moving {
    of: Corotation,
    /// Displacements and rotations of both nodes for each of its degrees of freedom, and for its base.
    columns: Vec<[f64; 12]>,
    base: [f64; 12],
    /// Those of the last trial.
    moved: [f64; 12],
    place: Place,
    /// Of its degrees of freedom: how much less than its ends the chord turns.
    turns: Vec<[f64; 2]>,
    /// N l, and the shear forces of both bendings.
    forces: [f64; 3],
    declared: Declared,
    /// Cosine of the rotation of its axis at the last trial.
    cosine: f64,
    /// The largest tension so far, N, and the least cosine.
    largest: f64,
    least: f64,
}

/// Largest motion that a user expects of a corotational member.
#[derive(Debug)]
pub(super) struct Declared {
    /// Tension, N.
    pub(super) tension: f64,
    /// Rotation of its axis, rad.
    pub(super) rotation: Option<f64>,
    /// The stiffness across the axis at rest that both make. A member of axial stiffness a and stiffness b across turns by φ: its
    /// stiffness is at most twice that of a and b + a sin² φ.
    pub(super) stiffening: Vec<(usize, usize, f64)>,
}

impl Moving {
    /// From the motions of both nodes: terms of each of their displacements and rotations.
    pub(super) fn new(
        of: Corotation,
        motions: &[&[(usize, f64)]],
        declared: Declared,
        place: &Place,
        influence: &[f64],
    ) -> Self {
        let mut columns = vec![[0.0; 12]; place.dofs.len()];
        let mut base = [0.0; 12];
        for (k, motion) in motions.iter().enumerate() {
            for (dof, share) in *motion {
                if let Some(at) = place.dofs.iter().position(|known| known == dof) {
                    columns[at][k] += share;
                }
                base[k] -= share * influence[*dof];
            }
        }
        let mut new = Self {
            of,
            turns: vec![[0.0; 2]; columns.len()],
            columns,
            base,
            moved: [0.0; 12],
            place: place.clone(),
            forces: [0.0; 3],
            declared,
            cosine: 1.0,
            largest: 0.0,
            least: 1.0,
        };
        new.turn();
        new
    }

    /// The deformations at this place. Real-time: yes.
    fn go(&mut self, disp: &[f64], base: f64) -> [f64; 6] {
        self.moved = self.base.map(|share| share * base);
        for (column, &dof) in self.columns.iter().zip(&self.place.dofs) {
            let by = disp.get(dof).copied().unwrap_or(f64::NAN);
            for (moved, share) in self.moved.iter_mut().zip(column) {
                *moved += share * by;
            }
        }
        self.turn()
    }

    /// The rows and the deformations at `moved`. Real-time: yes.
    fn turn(&mut self) -> [f64; 6] {
        let (disp, slopes) = self.of.at(&self.moved);
        let turns = self.of.turns(&slopes);
        self.cosine = self.of.cosine(&slopes);
        let places = self.place.rows.iter_mut().zip(&mut self.turns);
        for ((row, turn), column) in places.zip(&self.columns) {
            *row = product_of(&slopes, column);
            *turn = product_of(&turns, column);
        }
        disp
    }

    /// Takes the forces there, with the elongation. Real-time: yes.
    fn note(&mut self, stretch: f64, force: &[f64; 6]) {
        let [axial, start, end, weak_start, weak_end, _] = force;
        let length = self.of.length(stretch);
        self.forces = [
            axial * length,
            (start + end) / length,
            (weak_start + weak_end) / length,
        ];
    }

    /// Entries of the stiffness of its forces, each beside the diagonal once. Real-time: yes, if `to` is.
    fn spread_forces(&self, to: &mut dyn FnMut(usize, usize, f64)) {
        let [along, shears @ ..] = self.forces;
        let all = self
            .place
            .dofs
            .iter()
            .zip(&self.place.rows)
            .zip(&self.turns);
        for (i, ((&first, row), turns)) in all.clone().enumerate() {
            for ((&second, other), others) in all.clone().skip(i) {
                let mut sum = 0.0;
                for ((shear, turn), other_turn) in shears.iter().zip(turns).zip(others) {
                    sum +=
                        along * turn * other_turn - shear * (row[0] * other_turn + turn * other[0]);
                }
                to(first, second, sum);
            }
        }
    }
}

/// m x. Real-time: yes.
fn product_of<const N: usize>(m: &[[f64; 12]; N], x: &[f64; 12]) -> [f64; N] {
    m.each_ref().map(|row| dot(row, x))
}

/// Rows of the deformations of a member: v = Σ row · x, counted from a base that moves to the right.
#[derive(Debug, Default, Clone)]
pub(super) struct Place {
    dofs: Vec<usize>,
    /// Coefficients of the deformations, by degree of freedom.
    rows: Vec<[f64; 6]>,
    /// Coefficients of the displacement of the base.
    base: [f64; 6],
    /// Deformations in a plane.
    is_plane: bool,
}

impl Place {
    /// From terms (degree of freedom, coefficient) of each deformation, three in a plane and six in space, and the influence vector of
    /// the ground.
    pub(super) fn new(
        terms: impl IntoIterator<Item = Vec<(usize, f64)>>,
        influence: &[f64],
    ) -> Self {
        let mut place = Self::default();
        let mut count = 0;
        for (k, row) in terms.into_iter().enumerate() {
            count = k + 1;
            for (dof, coefficient) in row {
                let at = place.dofs.iter().position(|known| *known == dof);
                let at = at.unwrap_or_else(|| {
                    place.dofs.push(dof);
                    place.rows.push([0.0; 6]);
                    place.dofs.len() - 1
                });
                place.rows[at][k] += coefficient;
                place.base[k] -= coefficient * influence[dof];
            }
        }
        place.is_plane = count <= 3;
        place
    }

    /// Rows that a base does not move.
    pub(super) fn of(terms: impl IntoIterator<Item = Vec<(usize, f64)>>) -> Self {
        let terms: Vec<_> = terms.into_iter().collect();
        let dofs = terms.iter().flatten().map(|(dof, _)| dof + 1).max();
        Self::new(terms, &vec![0.0; dofs.unwrap_or(0)])
    }

    /// The elongation alone.
    pub(super) fn stretched(mut self) -> Self {
        for row in self.rows.iter_mut().chain([&mut self.base]) {
            row.iter_mut().skip(1).for_each(|entry| *entry = 0.0);
        }
        self.is_plane = true;
        self
    }

    /// Real-time: yes.
    fn deformation(&self, of_dofs: &[f64], of_base: f64) -> [f64; 6] {
        let mut out = self.base.map(|coefficient| coefficient * of_base);
        for (row, &dof) in self.rows.iter().zip(&self.dofs) {
            let moved = of_dofs.get(dof).copied().unwrap_or(f64::NAN);
            for (out, coefficient) in out.iter_mut().zip(row) {
                *out += coefficient * moved;
            }
        }
        out
    }

    /// Adds how large the forces are at each degree of freedom. The larger end moment counts at both ends: the free end of a cantilever
    /// has none. Real-time: yes.
    fn sizes(
        &self,
        [axial, start, end, weak_start, weak_end, torque]: [f64; 6],
        gross: &mut [f64],
    ) {
        let moment = start.abs().max(end.abs());
        let weak = weak_start.abs().max(weak_end.abs());
        for (&dof, [a, b, c, d, e, t]) in self.dofs.iter().zip(&self.rows) {
            if let Some(gross) = gross.get_mut(dof) {
                *gross += (a * axial).abs() + (b.abs() + c.abs()) * moment;
                if !self.is_plane {
                    *gross += (t * torque).abs() + (d.abs() + e.abs()) * weak;
                }
            }
        }
    }

    /// [`Place::spread_matrix`] as a list of (i ≤ j, value).
    pub(super) fn matrix(&self, m: &Sym<6>) -> Vec<(usize, usize, f64)> {
        let mut entries = Vec::new();
        self.spread_matrix(m, |i, j, value| entries.push((i.min(j), i.max(j), value)));
        entries
    }

    /// Forces at each degree of freedom. Real-time: yes, if `to` is.
    fn spread(&self, force: &[f64; 6], mut to: impl FnMut(usize, f64)) {
        for (&dof, row) in self.dofs.iter().zip(&self.rows) {
            to(dof, dot(row, force));
        }
    }

    /// Entries of rowᵀ m row, each beside the diagonal once. Real-time: yes, if `to` is.
    fn spread_matrix(&self, m: &Sym<6>, mut to: impl FnMut(usize, usize, f64)) {
        for (i, (&first, row)) in self.dofs.iter().zip(&self.rows).enumerate() {
            let of = product(m, row);
            for (&second, row) in self.dofs.iter().zip(&self.rows).skip(i) {
                to(first, second, dot(&of, row));
            }
        }
    }
}

/// A force-based member; `None` if its sections have no stiffness.
pub(super) fn force_based(
    length: f64,
    points: usize,
    fibres: Fibres,
    in_space: bool,
) -> Option<Basic> {
    let points = along(length, quadrature::gauss_lobatto(points));
    Some(if in_space {
        Basic::ForceInSpace(Box::new(ForceBased::new(points, fibres)?))
    } else {
        Basic::Force(Box::new(ForceBased::new(points, fibres)?))
    })
}

/// A displacement-based member.
pub(super) fn displacement_based(
    length: f64,
    points: usize,
    fibres: Fibres,
    in_space: bool,
) -> Basic {
    let points = along(length, quadrature::gauss_legendre(points));
    if in_space {
        let new = DisplacementBased::new(points, fibres, length, true);
        Basic::DisplacementInSpace(Box::new(new))
    } else {
        let new = DisplacementBased::new(points, fibres, length, true);
        Basic::Displacement(Box::new(new))
    }
}

/// A member with an axial force alone.
pub(super) fn truss(length: f64, fibres: Fibres) -> Basic {
    let points = along(length, quadrature::gauss_legendre(1));
    Basic::Displacement(Box::new(DisplacementBased::new(
        points, fibres, length, false,
    )))
}

/// An elastic member with hinges in series, each with its moment at yield; `None` if it has no stiffness.
pub(super) fn hinged(length: f64, of: Rigidity, hinges: [Option<HingeLaw>; 2]) -> Option<Basic> {
    Some(Basic::Hinged(Box::new(Hinged::new(length, of, hinges)?)))
}

fn along(length: f64, points: Vec<(f64, f64)>) -> Vec<Point> {
    let each = points.into_iter();
    each.map(|(xi, weight)| Point {
        xi,
        weight: length * weight,
    })
    .collect()
}

/// Where a structure is: x and v (n), and those of its base.
#[derive(Debug, Clone, Copy)]
pub(crate) struct At<'a> {
    pub(crate) disp: &'a [f64],
    pub(crate) vel: &'a [f64],
    pub(crate) base: [f64; 2],
    pub(crate) dt: f64,
}

/// A spring or damper between nodes.
pub(crate) struct Link<'a> {
    pub(crate) name: &'a str,
    pub(crate) row: Vec<(usize, f64)>,
    pub(crate) stiffness_bound: Option<f64>,
    pub(crate) damping: f64,
    pub(crate) damping_bound: Option<f64>,
}

/// State to which stiffness and damping of a link refer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Which {
    /// What enters K0 and C0.
    Reference,
    /// Upper bound of the tangents.
    Bound,
    /// Around rest: the stiffness there, and the part of the reference damping that acts there only.
    Rest,
}

/// A stiffness with what stays linear beside it.
pub(super) fn with(mut stiffness: Sym<6>, beside: Option<&Beside>) -> Sym<6> {
    if let Some(beside) = beside {
        beside.stiffen(&mut stiffness);
    }
    stiffness
}

impl Member {
    /// Stiffness and damping of a link or a bearing; `None` for a bound that needs a reach.
    fn links(&self, which: Which) -> [Option<Sym<6>>; 2] {
        match &self.basic {
            Basic::Link(law) => {
                let reference = law.reference();
                let (stiffness, damping) = match which {
                    Which::Bound => law.bound(self.reach),
                    Which::Reference => (Some(reference.stiffness), Some(reference.damping)),
                    Which::Rest => (Some(reference.stiffness), Some(law.rest_damping())),
                };
                [stiffness, damping].map(|value| Some(widened(&[[value?]])))
            }
            Basic::Bearing(bearing) => {
                let mut is_known = true;
                let mut both = [[[0.0; 6]; 6]; 2];
                for (kind, out) in both.iter_mut().enumerate() {
                    *out = of_bearing(bearing, |to| {
                        let mut other = [0.0; 9];
                        let other = &mut other[..to.len()];
                        let [stiffness, damping] = match kind {
                            0 => [to, other],
                            _ => [other, to],
                        };
                        match which {
                            Which::Bound => {
                                let reach = [self.reach; 3];
                                is_known &= bearing.bound(&reach, stiffness, damping).is_ok();
                            }
                            Which::Reference => bearing.reference(stiffness, damping),
                            Which::Rest => {
                                bearing.reference(stiffness, damping);
                                bearing.rest_damping(damping);
                            }
                        }
                    });
                }
                both.map(|matrix| is_known.then_some(matrix))
            }
            _ => [None; 2],
        }
    }

    /// Its rows at the last trial. Real-time: yes.
    fn now(&self) -> &Place {
        self.moving
            .as_ref()
            .map_or(&self.place, |moving| &moving.place)
    }

    /// Entries of a tangent over its deformations, and of its forces where it moves far; each beside the diagonal once. Real-time: yes, if
    /// `to` is.
    fn spread_tangent(&self, tangent: &Sym<6>, to: &mut dyn FnMut(usize, usize, f64)) {
        self.now().spread_matrix(tangent, &mut *to);
        if let Some(moving) = &self.moving {
            moving.spread_forces(to);
        }
    }

    /// K of the virgin member.
    fn initial(&self) -> Sym<6> {
        with(self.basic.initial(), self.beside.as_ref())
    }

    /// Its name in messages.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its number from 1: members, then links.
    #[must_use]
    pub const fn number(&self) -> usize {
        self.number
    }

    /// Whether a link acts on rotations; none for a member.
    #[must_use]
    pub const fn link_turns(&self) -> Option<bool> {
        match self.basic {
            Basic::Link(_) | Basic::Bearing(_) => Some(self.turns),
            _ => None,
        }
    }

    /// Deformations of a member: three in a plane, six in space.
    #[must_use]
    pub const fn count(&self) -> usize {
        if self.place.is_plane { 3 } else { 6 }
    }

    /// Deformations with a meaning: [`Member::count`], one of a link, two or three of a bearing.
    #[must_use]
    pub fn axes(&self) -> usize {
        match &self.basic {
            Basic::Link(_) => 1,
            Basic::Bearing(bearing) => bearing.axes(),
            _ => self.count(),
        }
    }

    /// Deformations and forces at the last evaluation: v in m and rad, then q in N and N m, [`Member::axes`] each. Real-time: yes.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        let count = self.axes();
        let (disp, force) = (self.disp.into_iter(), self.answer.force.into_iter());
        disp.take(count).chain(force.take(count))
    }
}

impl Place {
    /// q of a member of this stiffness at displacements of the frame.
    pub(super) fn first_force(&self, stiffness: &Sym<6>, disp: &[f64]) -> [f64; 6] {
        product(stiffness, &self.deformation(disp, 0.0))
    }
}

impl Members {
    pub(super) fn push(
        &mut self,
        (number, name, is_recorded): (usize, String, bool),
        place: Place,
        (basic, beside): (Basic, Option<Beside>),
        moving: Option<Box<Moving>>,
        (reach, turns): (Reach, bool),
    ) {
        let answer = Answer {
            stiffness: with(basic.initial(), beside.as_ref()),
            ..Answer::default()
        };
        let disp = [0.0; 6];
        self.each.push(Member {
            number,
            name,
            is_recorded,
            turns,
            place,
            basic,
            beside,
            moving,
            reach,
            disp,
            answer,
        });
    }

    /// Degrees of freedom between which members lie.
    pub fn dofs(&self) -> impl Iterator<Item = usize> {
        self.each
            .iter()
            .flat_map(|member| member.place.dofs.iter().copied())
    }

    /// Gives the degrees of freedom other numbers: `new` has the new number of each old one.
    pub fn renumber(&mut self, new: impl Fn(usize) -> usize) {
        for member in &mut self.each {
            let own = member.place.dofs.iter_mut();
            own.for_each(|dof| *dof = new(*dof));
            if let Some(moving) = &mut member.moving {
                moving.place.dofs.clone_from(&member.place.dofs);
                for (i, j, _) in &mut moving.declared.stiffening {
                    (*i, *j) = (new(*i).min(new(*j)), new(*i).max(new(*j)));
                }
            }
        }
    }

    /// True if there is a member of fibres.
    #[must_use]
    pub(crate) fn has_fibres(&self) -> bool {
        let mut each = self.each.iter();
        each.any(|member| {
            !matches!(
                member.basic,
                Basic::Hinged(_) | Basic::Link(_) | Basic::Bearing(_)
            )
        })
    }

    /// Evaluates members twice in a step from now on: no degree of freedom without mass repeats it.
    pub(crate) fn repeat(&mut self) {
        self.is_single = true;
    }

    /// Members and links.
    #[must_use]
    pub fn count(&self) -> usize {
        self.each.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.each.is_empty()
    }

    /// residual ← residual − forces of some of them, a trial; `gross` gains the size of each force where it has an entry for its row. Real-time: yes.
    pub(crate) fn subtract(
        &mut self,
        part: Range<usize>,
        at: At<'_>,
        lanes: Lanes,
        residual: &mut [f64],
        gross: &mut [f64],
    ) {
        for member in self.each.get_mut(part).unwrap_or_default() {
            member.disp = match &mut member.moving {
                Some(moving) => moving.go(at.disp, at.base[0]),
                None => member.place.deformation(at.disp, at.base[0]),
            };
            let rates = member.place.deformation(at.vel, at.base[1]);
            if self.is_single {
                member.basic.trial(&member.disp, &rates, at.dt, lanes);
            }
            member.answer = member.basic.trial(&member.disp, &rates, at.dt, lanes);
            if let Some(beside) = &member.beside {
                beside.add(&member.disp, &mut member.answer.force);
                beside.stiffen(&mut member.answer.stiffness);
            }
            if let Some(moving) = &mut member.moving {
                moving.note(member.disp[0], &member.answer.force);
            }
            let place = member.now();
            place.spread(&member.answer.force, |dof, force| {
                if let Some(r) = residual.get_mut(dof) {
                    *r -= force;
                }
            });
            if !gross.is_empty() {
                place.sizes(member.answer.force, gross);
            }
        }
    }

    /// Real-time: yes.
    pub(crate) fn commit(&mut self) {
        self.unbalances.rotate_right(1);
        self.unbalances[0] = self.unbalance();
        for member in &mut self.each {
            member.basic.commit();
            if let Some(moving) = &mut member.moving {
                moving.largest = moving.largest.max(member.answer.force[0]);
                moving.least = moving.least.min(moving.cosine);
            }
        }
    }

    /// Largest unbalance along a member at its last evaluation. Real-time: yes.
    fn unbalance(&self) -> f64 {
        let each = self.each.iter().map(|member| member.basic.unbalance());
        // One that is not a number wins.
        each.fold(0.0, |most, one| {
            if one > most || one.is_nan() {
                one
            } else {
                most
            }
        })
    }

    /// True if a further evaluation would not bring a member nearer to balance along it. Real-time: yes.
    pub(crate) fn are_balanced(&self) -> bool {
        self.unbalance() <= BALANCED
    }

    /// The least unbalance along members of the last six steps, the largest of all members in each. Real-time: yes.
    #[must_use]
    pub fn lasting_unbalance(&self) -> f64 {
        let least = |least: f64, one: &f64| {
            if least.is_nan() || least < *one {
                least
            } else {
                *one
            }
        };
        self.unbalances.iter().fold(f64::INFINITY, least)
    }

    /// Number of the member with the largest unbalance along it at the last evaluation.
    #[must_use]
    pub fn worst(&self) -> Option<usize> {
        let each = self.each.iter();
        let worst = each.max_by(|a, b| a.basic.unbalance().total_cmp(&b.basic.unbalance()));
        worst.map(|member| member.number)
    }

    /// True if a member comes to balance along it step by step.
    #[must_use]
    pub fn can_lack_balance(&self) -> bool {
        let mut each = self.each.iter();
        each.any(|member| matches!(member.basic, Basic::Force(_) | Basic::ForceInSpace(_)))
    }

    /// From now on every evaluation makes all of its passes, or no more than it needs.
    pub fn exhaust(&mut self, yes: bool) {
        self.each
            .iter_mut()
            .for_each(|member| member.basic.exhaust(yes));
    }

    /// out ← out − K_t d − C_t v with the tangents of the last trial, for changes d and v. Real-time: yes.
    pub(crate) fn subtract_tangent(&self, change: At<'_>, out: &mut [f64]) {
        for member in &self.each {
            let place = member.now();
            let disp = place.deformation(change.disp, change.base[0]);
            let mut force = product(&member.answer.stiffness, &disp);
            if member.answer.damping != 0.0 {
                let [rate, ..] = member.place.deformation(change.vel, change.base[1]);
                force[0] += member.answer.damping * rate;
            }
            place.spread(&force, |dof, force| {
                if let Some(out) = out.get_mut(dof) {
                    *out -= force;
                }
            });
            if let Some(moving) = &member.moving {
                moving.spread_forces(&mut |i, j, value| {
                    let of = |dof: usize| change.disp.get(dof).copied().unwrap_or(f64::NAN);
                    let pairs = if i == j {
                        &[(i, j)][..]
                    } else {
                        &[(i, j), (j, i)]
                    };
                    for (row, column) in pairs {
                        if let Some(out) = out.get_mut(*row) {
                            *out -= value * of(*column);
                        }
                    }
                });
            }
        }
    }

    /// Entries of K_t + C_t/Δt of the last trial, each beside the diagonal once. Real-time: yes, if `to` is.
    pub(crate) fn for_each_tangent(&self, dt: f64, to: &mut dyn FnMut(usize, usize, f64)) {
        for member in &self.each {
            let mut tangent = member.answer.stiffness;
            tangent[0][0] += member.answer.damping / dt;
            member.spread_tangent(&tangent, to);
        }
    }

    /// Those whose forces and deformations are recorded.
    pub fn recorded(&self) -> impl Iterator<Item = &Member> {
        self.each.iter().filter(|member| member.is_recorded)
    }

    /// Each link, and each axis of a bearing, with its row: v = Σ row · x.
    pub(crate) fn links(&self) -> impl Iterator<Item = Link<'_>> {
        self.each.iter().flat_map(|member| {
            let axes = member.link_turns().map_or(0, |_| member.axes());
            let of = |which| member.links(which);
            let (bound, reference) = (of(Which::Bound), of(Which::Reference));
            (0..axes).map(move |axis| {
                let row = member.place.dofs.iter().zip(&member.place.rows);
                let at = |matrix: Sym<6>| matrix[axis][axis];
                Link {
                    name: &member.name,
                    row: row.map(|(dof, row)| (*dof, row[axis])).collect(),
                    stiffness_bound: bound[0].map(at),
                    damping: reference[1].map_or(0.0, at),
                    damping_bound: bound[1].map(at),
                }
            })
        })
    }

    /// Name of each corotational member that went beyond its declared tension or rotation, with its largest ones in N and rad.
    pub fn beyond_declared(&self) -> impl Iterator<Item = (&str, [f64; 2])> {
        self.each.iter().filter_map(|member| {
            let moving = member.moving.as_ref()?;
            let declared = &moving.declared;
            let rotation = libm::acos(moving.least.clamp(-1.0, 1.0));
            let is_beyond = moving.largest > declared.tension || rotation > declared.rotation?;
            is_beyond.then_some((member.name.as_str(), [moving.largest, rotation]))
        })
    }

    /// True if a member of this name is corotational.
    pub(crate) fn is_moving(&self, name: &str) -> bool {
        let mut own = self.each.iter().filter(|member| member.name == name);
        own.any(|member| member.moving.is_some())
    }

    /// Name of each member with its largest use so far at its start and its end, in parts of what makes it yield.
    pub fn demands(&self) -> impl Iterator<Item = (&str, [f64; 2])> {
        let members = self.each.iter();
        let members = members.filter(|member| member.link_turns().is_none());
        members.map(|member| (member.name.as_str(), member.basic.demand()))
    }

    /// Entries of K_t of the last trial, (i ≤ j, value).
    pub(crate) fn tangent_stiffness(&self) -> Vec<(usize, usize, f64)> {
        let mut entries = Vec::new();
        let mut push = |i: usize, j: usize, value| entries.push((i.min(j), i.max(j), value));
        for member in &self.each {
            member.spread_tangent(&member.answer.stiffness, &mut push);
        }
        entries
    }

    /// Entries of C_t of the last trial.
    pub(crate) fn tangent_damping(&self) -> Vec<(usize, usize, f64)> {
        self.collect(|member| widened(&[[member.answer.damping]]))
    }

    /// Entries of K of the virgin members and of the references or bounds of links.
    ///
    /// # Errors
    /// Name of a link whose bound needs a reach.
    pub(crate) fn stiffness(&self, which: Which) -> Result<Vec<(usize, usize, f64)>, String> {
        let kind = (which != Which::Rest, which == Which::Bound);
        self.of_kind(0, which, kind)
    }

    /// Entries of C of links, likewise.
    ///
    /// # Errors
    /// Name of a link whose bound needs a reach.
    pub(crate) fn damping(&self, which: Which) -> Result<Vec<(usize, usize, f64)>, String> {
        self.of_kind(1, which, (false, false))
    }

    /// Stiffness (0) or damping (1).
    fn of_kind(
        &self,
        kind: usize,
        which: Which,
        (is_stiffness, is_bound): (bool, bool),
    ) -> Result<Vec<(usize, usize, f64)>, String> {
        let mut entries = Vec::new();
        for member in &self.each {
            let matrix = match &member.basic {
                Basic::Link(_) | Basic::Bearing(_) => {
                    member.links(which)[kind].ok_or_else(|| member.name.clone())?
                }
                _ if kind == 0 => member.initial(),
                _ => continue,
            };
            let own = member.place.matrix(&matrix);
            let Some(moving) = member.moving.as_ref().filter(|_| is_stiffness) else {
                entries.extend(own);
                continue;
            };
            if moving.declared.rotation.is_none() && is_bound {
                return Err(member.name.clone());
            }
            let factor = if is_bound { 2.0 } else { 1.0 };
            let all = own.iter().chain(&moving.declared.stiffening);
            entries.extend(all.map(|(i, j, value)| (*i, *j, factor * value)));
        }
        Ok(entries)
    }

    fn collect(&self, of: impl Fn(&Member) -> Sym<6>) -> Vec<(usize, usize, f64)> {
        let each = self.each.iter();
        each.flat_map(|member| member.place.matrix(&of(member)))
            .collect()
    }
}
