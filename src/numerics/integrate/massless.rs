//! Degrees of freedom without mass: they follow the others statically.
//!
//! With s the rows without mass and m the others, x_s\[n+1\] is where the forces of these rows balance at the x_m\[n+1\] that the
//! method has found. The first place is predicted with the tangents of the committed state, P = x_s\[n\] + K_t⁻¹ r. Newton's
//! places follow, each with the tangents at the one before. A step that goes too far, as at the corner of a plastic law, is cut to
//! where the force along it vanishes, by the secant. Where nine places do not suffice, the search begins again at the safe place
//! S = x_s\[n\] + K_0⁻¹ r, with the upper bound K_0 of the tangents. Each place is a trial of the laws from their committed state. There
//! are at most fourteen of them, so that the work of a step is bounded; two are enough where nothing bends. The best one is kept.
//!
//! Balance is measured by φ = r_sᵀ K_0⁻¹ r_s, with K_0 the upper bound of the tangents, in parts of ψ = Σ f²/K_0 with the largest
//! force f so far on each row.
//!
//! A dashpot on such a row acts at the backward difference (x_s\[n+1\] − x_s\[n\])/Δt, and counts as the stiffness C/Δt. A specimen
//! cannot hang on such a row: its force is a step late.

use super::State;
use crate::linalg::{Banded, NotPositiveDefinite, Spd, SymMatrix};
use crate::model::{Base, End, Motion, Structure};
use gusset_quantity::state;

/// Places that are tried at most, and those after which the search begins again.
const PLACES: u32 = 14;
const RESTART: u32 = 9;
/// φ in parts of ψ below which nothing is left to balance.
const BALANCED: f64 = 1e-20;
/// Both for members of fibres, which cost more: they bend gently, and the residual enters the next step. A third place changed
/// no displacement of the compared frames by 1e-5.
const OF_FIBRES: (u32, f64) = (2, 1e-14);
/// Share of the force at its beginning that a step may leave against it at its end.
const OVERSHOOT: f64 = 0.5;
/// Share of K_0 that is added to tangents that are not positive definite.
const LEAST_STIFFNESS: f64 = 1e-3;

/// The rows without mass of one structure, and what their predictor remembers. n: degrees of freedom, s: rows without mass.
#[derive(Debug)]
pub struct Massless {
    dt: f64,
    /// Places that are tried at most, and φ in parts of ψ below which nothing is left to balance.
    places: u32,
    balanced: f64,
    /// All of them are tried.
    exhausts: bool,
    /// Degrees of freedom, rising.
    rows: Vec<usize>,
    /// Place of a degree of freedom among them.
    place: Vec<Option<usize>>,
    /// K_0 + C_0/Δt of these rows: its factor and its diagonal.
    safe: Spd,
    diagonal: Vec<f64>,
    /// Entries of K_0 + C_0/Δt, and of the tangents that do not change, (s, s, value); the factor of the tangents at one place, without
    /// which the safe one serves.
    stiffest: Vec<(usize, usize, f64)>,
    constant: Vec<(usize, usize, f64)>,
    tangent: Banded,
    is_tangent: bool,
    /// No element has a tangent that changes.
    is_linear: bool,
    /// Size of the forces on each degree of freedom at the step last closed (n).
    gross: Vec<f64>,
    /// The largest such force so far (s).
    largest: Vec<f64>,
    /// ψ.
    scale: f64,
    /// √(φ/ψ) of the last steps, the newest first, and the degree of freedom with the largest part of it.
    shares: [f64; 6],
    worst_dof: usize,
    /// x and v of the step last closed (n).
    disp: Vec<f64>,
    vel: Vec<f64>,
    /// Change of x and v (n).
    change: Vec<f64>,
    rate: Vec<f64>,
    /// Loads, and forces of a trial (n).
    load: Vec<f64>,
    forces: Vec<f64>,
    /// F of the next step (s).
    external: Vec<f64>,
    /// A place that is tried, the one that a step leads there from, and the best (s).
    tried: Trial,
    from: Trial,
    best: Trial,
    step: Vec<f64>,
    work: Vec<f64>,
    search: Search,
    /// Displacement and velocity of the base in the next step.
    base: [f64; 2],
}

// The rest is made again in each step. A state is taken when a search has begun, with its first place.
state! {
    Massless as "rows without mass" { largest, scale, shares, disp, external, tried, base }
    keeps {
        dt, places, balanced, exhausts, rows, place, safe, diagonal, stiffest, constant, tangent, is_tangent, is_linear, gross, worst_dof, vel, change,
        rate, load, forces, from, best, step, work, search
    }
}

/// Matrices of [`Massless`], n × n in SI units.
#[derive(Debug)]
pub struct MasslessBounds {
    /// K_0: upper bound of the tangent stiffness.
    pub stiffness: SymMatrix,
    /// C_0: upper bound of the tangent damping.
    pub damping: SymMatrix,
}

/// Displacements of the rows without mass, and the residual forces there.
#[derive(Debug, Clone)]
struct Trial {
    disp: Vec<f64>,
    residual: Vec<f64>,
    /// φ.
    energy: f64,
}

state! { Trial { disp } keeps { residual, energy } }

impl Trial {
    fn zeros(s: usize) -> Self {
        Self {
            disp: vec![0.0; s],
            residual: vec![0.0; s],
            energy: f64::NAN,
        }
    }

    fn copy_from(&mut self, other: &Self) {
        self.disp.copy_from_slice(&other.disp);
        self.residual.copy_from_slice(&other.residual);
        self.energy = other.energy;
    }

    /// The force along a step.
    fn along(&self, step: &[f64]) -> f64 {
        let both = self.residual.iter().zip(step);
        both.map(|(r, by)| r * by).sum()
    }

    /// Goes to a step from another place.
    fn go(&mut self, from: &Self, step: &[f64]) {
        for (to, (from, by)) in self.disp.iter_mut().zip(from.disp.iter().zip(step)) {
            *to = from + by;
        }
    }
}

impl Massless {
    /// For `structure`, with steps of `dt` s; `None` if every degree of freedom has mass.
    ///
    /// # Errors
    /// A row without mass that nothing holds.
    pub fn new(
        structure: &Structure,
        bounds: MasslessBounds,
        dt: f64,
    ) -> Result<Option<Self>, NotPositiveDefinite> {
        let n = structure.dofs();
        let rows = structure.massless();
        if rows.is_empty() {
            return Ok(None);
        }
        let s = rows.len();
        let mut place = vec![None; n];
        for (at, &row) in rows.iter().enumerate() {
            place[row] = Some(at);
        }
        let whole = bounds.stiffness.plus(1.0 / dt, &bounds.damping);
        let block = whole.block(&rows);
        let safe = Spd::factor(&block).map_err(|failure| NotPositiveDefinite {
            dof: rows.get(failure.dof).copied().unwrap_or(failure.dof),
            ..failure
        })?;
        // Couplings that are zero or cancel in K_0 need room, too.
        let mut pairs: Vec<_> = block.entries().map(|(i, j, _)| (i, j, 1.0)).collect();
        structure.for_each_entry(dt, &mut |i, j, _| {
            if let (Some(i), Some(j)) = (place[i], place[j]) {
                pairs.push((i.min(j), i.max(j), 1.0));
            }
        });
        structure.for_each_tangent(&mut |from, to, _| {
            if let (End::Dof(i), End::Dof(j)) = (from, to)
                && let (Some(i), Some(j)) = (place[i], place[j])
            {
                pairs.push((i.min(j), i.max(j), 1.0));
            }
        });
        let pattern = SymMatrix::from_triplets(s, pairs);
        let constant = structure.stiffness().plus(1.0 / dt, structure.damping());
        let (places, balanced) = if structure.members().has_fibres() {
            OF_FIBRES
        } else {
            (PLACES, BALANCED)
        };
        Ok(Some(Self {
            dt,
            places,
            balanced,
            exhausts: false,
            place,
            safe,
            diagonal: (0..s).map(|i| block.get(i, i)).collect(),
            stiffest: block.entries().collect(),
            constant: constant.block(&rows).entries().collect(),
            tangent: Banded::like(&pattern),
            is_tangent: false,
            is_linear: structure.is_linear(),
            gross: vec![0.0; n],
            largest: vec![0.0; s],
            scale: 0.0,
            shares: [0.0; 6],
            worst_dof: 0,
            disp: vec![0.0; n],
            vel: vec![0.0; n],
            change: vec![0.0; n],
            rate: vec![0.0; n],
            load: vec![0.0; n],
            forces: vec![0.0; n],
            external: vec![0.0; s],
            tried: Trial::zeros(s),
            from: Trial::zeros(s),
            step: vec![0.0; s],
            best: Trial::zeros(s),
            work: vec![0.0; s],
            search: Search::default(),
            base: [0.0; 2],
            rows,
        }))
    }

    /// `residual` ← F − R for the step that is closed, where it holds F (n): a trial, as [`Structure::subtract_trial`]. Notes how well
    /// the rows without mass balance. Real-time: yes.
    pub fn close(&mut self, structure: &mut Structure, motion: Motion<'_>, residual: &mut [f64]) {
        let (mut from, mut budget) = (0, usize::MAX);
        self.close_in_parts(structure, motion, residual, &mut from, &mut budget);
    }

    /// [`Massless::close`] as far as `budget` evaluations of members suffice, from part `from` on, 0 at first. True if it is done.
    /// Real-time: yes.
    pub fn close_in_parts(
        &mut self,
        structure: &mut Structure,
        motion: Motion<'_>,
        residual: &mut [f64],
        from: &mut usize,
        budget: &mut usize,
    ) -> bool {
        if self.search.is_evaluated {
            // The last trial was at this place.
            for (residual, force) in residual.iter_mut().zip(&self.forces) {
                *residual += force;
            }
        } else {
            if *from == 0 {
                for (to, force) in self.gross.iter_mut().zip(residual.iter()) {
                    *to = force.abs();
                }
                structure.weigh(motion, &self.rows, &mut self.gross);
            }
            if !structure.go_on_weighed(motion, residual, &mut self.gross, from, budget) {
                return false;
            }
        }
        self.search.is_evaluated = false;
        let (mut scale, mut worst) = (0.0, (0.0, 0));
        let rows = self.rows.iter().zip(&self.diagonal);
        let rows = rows.zip(&mut self.largest).zip(&mut self.tried.residual);
        for (((&row, k0), largest), to) in rows {
            *largest = f64::max(*largest, at(&self.gross, row));
            scale += *largest * *largest / k0;
            *to = at(residual, row);
            let own = *to * *to / k0;
            if own > worst.0 {
                worst = (own, row);
            }
        }
        self.scale = scale;
        self.worst_dof = worst.1;
        let found = self.energy();
        self.shares.rotate_right(1);
        // Before the first force there is no residual.
        self.shares[0] = if scale == 0.0 {
            0.0
        } else {
            (found / scale).sqrt()
        };
        true
    }

    /// The least √(φ/ψ) of the last six steps: what one step leaves over at a kink, the next ones remove. Real-time: yes.
    #[must_use]
    pub fn lasting_unbalance(&self) -> f64 {
        // A share that is not a number lasts.
        let least = |least: f64, share: &f64| {
            if least.is_nan() || least < *share {
                least
            } else {
                *share
            }
        };
        self.shares.iter().fold(f64::INFINITY, least)
    }

    /// From now on every search tries all of its places, or no more than it needs.
    pub fn exhaust(&mut self, yes: bool) {
        self.exhausts = yes;
    }

    /// Most places that a search tries.
    #[must_use]
    pub const fn most_places(&self) -> u32 {
        self.places
    }

    /// Degree of freedom, from 0, with the largest part of the last unbalance.
    #[must_use]
    pub fn worst_dof(&self) -> usize {
        self.worst_dof
    }

    /// φ of the residual forces of the trial. Real-time: yes.
    fn energy(&mut self) -> f64 {
        self.work.copy_from_slice(&self.tried.residual);
        self.safe.solve_in_place(&mut self.work);
        let both = self.work.iter().zip(&self.tried.residual);
        both.map(|(x, r)| x * r).sum()
    }

    /// Notes the state that the next step is made from. Real-time: yes.
    pub(super) fn before(&mut self, state: &State) {
        self.disp.copy_from_slice(&state.disp);
        self.vel.copy_from_slice(&state.vel);
    }

    /// Velocities to report for the step last closed: those that its forces were made with. Real-time: yes.
    pub(super) fn report(&self, reported_vel: &mut [f64]) {
        for &row in &self.rows {
            if let Some(to) = reported_vel.get_mut(row) {
                *to = at(&self.vel, row);
            }
        }
    }

    /// Begins to move the rows without mass of `state`, whose other rows are a step on, to where they balance. `residual` is r of the step
    /// last closed (n); `load` writes F of that step (0) or of the next (1) over its argument and returns the base there. Real-time:
    /// yes, if `load` is.
    pub fn begin(
        &mut self,
        structure: &Structure,
        state: &State,
        residual: &[f64],
        load: &mut dyn FnMut(u8, &mut [f64]) -> Base,
    ) {
        let before = load(0, &mut self.load);
        for (to, &row) in self.step.iter_mut().zip(&self.rows) {
            *to = at(residual, row) - at(&self.load, row);
        }
        let base = load(1, &mut self.load);
        self.base = [base.disp, base.vel];
        let rows = self.step.iter_mut().zip(&mut self.external);
        for ((to, external), &row) in rows.zip(&self.rows) {
            *to += at(&self.load, row);
            *external = at(&self.load, row);
        }
        self.note_change(state);
        let base_change = Base {
            disp: base.disp - before.disp,
            vel: base.vel - before.vel,
        };
        self.predict(structure, base_change);
        self.search = Search::default();
    }

    /// Continues the search that has begun, until `budget` evaluations of members are used up; it is lowered by those that were made.
    /// True if the rows of `state` are where they balance best. The laws of `structure` are evaluated, none commits. Real-time: yes.
    pub fn work(
        &mut self,
        structure: &mut Structure,
        state: &mut State,
        budget: &mut usize,
    ) -> bool {
        loop {
            if !self.evaluate(structure, state, budget) {
                return false;
            }
            if !self.judge(structure) {
                // The last place that was tried is often the best.
                self.search.is_evaluated = self.best.energy.total_cmp(&self.tried.energy).is_eq();
                if !self.search.is_evaluated {
                    std::mem::swap(&mut self.best, &mut self.tried);
                    self.put(state);
                }
                return true;
            }
        }
    }

    /// Notes the place that was tried; false if the search is over, else another one is to be tried. Real-time: yes.
    fn judge(&mut self, structure: &Structure) -> bool {
        let Search {
            places,
            kind,
            may_restart,
            ..
        } = &mut self.search;
        *places += 1;
        let (places, kind, may_restart) = (*places, *kind, *may_restart);
        match kind {
            PlaceKind::First => {
                self.search.kind = PlaceKind::Searched;
                self.best.copy_from(&self.tried);
            }
            PlaceKind::Stays => {
                self.search.kind = PlaceKind::Searched;
                self.go_safely();
                return true;
            }
            PlaceKind::Searched => {
                if self.tried.energy < self.best.energy || self.best.energy.is_nan() {
                    self.best.copy_from(&self.tried);
                }
                let along = [&self.from, &self.tried].map(|trial| trial.along(&self.step));
                let [ahead, behind] = along;
                self.search.is_far = ahead > 0.0 && behind < -OVERSHOOT * ahead;
                if self.search.is_far {
                    let share = ahead / (ahead - behind);
                    self.step.iter_mut().for_each(|by| *by *= share);
                }
            }
        }
        let is_balanced =
            self.best.energy <= self.balanced * self.scale && structure.members().are_balanced();
        if places >= self.places || !self.exhausts && is_balanced {
            return false;
        }
        if may_restart && places >= RESTART {
            self.search.may_restart = false;
            self.search.kind = PlaceKind::Stays;
            self.stay();
        } else if self.search.is_far {
            self.tried.go(&self.from, &self.step);
        } else {
            self.next(structure);
        }
        true
    }

    /// Change of x and v where the rows without mass stay. Real-time: yes.
    fn note_change(&mut self, state: &State) {
        let rows = self
            .place
            .iter()
            .zip(self.change.iter_mut().zip(&mut self.rate));
        let now = state.disp.iter().zip(state.vel.iter());
        let before = self.disp.iter().zip(&self.vel);
        for (((place, (change, rate)), (x, v)), (old_x, old_v)) in rows.zip(now).zip(before) {
            (*change, *rate) = match place {
                Some(_) => (0.0, -old_v),
                None => (x - old_x, v - old_v),
            };
        }
    }

    /// The first place, with the tangents of the committed state; `step` holds r + ΔF. Real-time: yes.
    fn predict(&mut self, structure: &Structure, base: Base) {
        self.forces.fill(0.0);
        let change = Motion::new(&self.change, &self.rate, base, self.dt);
        structure.subtract_tangent(change, &mut self.forces);
        for (to, &row) in self.step.iter_mut().zip(&self.rows) {
            *to += at(&self.forces, row);
        }
        self.take_tangents(structure);
        self.solve();
        let places = self.tried.disp.iter_mut().zip(&self.step);
        for ((tried, by), &row) in places.zip(&self.rows) {
            *tried = at(&self.disp, row) + by;
        }
    }

    /// Newton's next place, from the one that was tried. Real-time: yes.
    fn next(&mut self, structure: &Structure) {
        self.from.copy_from(&self.tried);
        self.take_tangents(structure);
        self.step.copy_from_slice(&self.from.residual);
        self.solve();
        self.tried.go(&self.from, &self.step);
    }

    /// The place of the step last closed. Real-time: yes.
    fn stay(&mut self) {
        for (to, &row) in self.tried.disp.iter_mut().zip(&self.rows) {
            *to = at(&self.disp, row);
        }
    }

    /// The next place, from the one that was tried, with the bounds of the tangents: it goes too far for no law. Real-time: yes.
    fn go_safely(&mut self) {
        self.from.copy_from(&self.tried);
        self.step.copy_from_slice(&self.from.residual);
        self.safe.solve_in_place(&mut self.step);
        self.tried.go(&self.from, &self.step);
    }

    /// The factor of the tangents at the last trial. Where they are not positive definite, a little of the bounds is added; where
    /// that does not suffice, the bounds serve. Real-time: yes.
    fn take_tangents(&mut self, structure: &Structure) {
        if self.is_linear && self.is_tangent {
            return;
        }
        self.is_tangent = self.factor(structure, 0.0) || self.factor(structure, LEAST_STIFFNESS);
    }

    /// Whether K_t and a share of K_0 are positive definite. Real-time: yes.
    fn factor(&mut self, structure: &Structure, share: f64) -> bool {
        let Self {
            tangent, place, dt, ..
        } = self;
        tangent.clear();
        for &(i, j, value) in &self.constant {
            tangent.add(i, j, value);
        }
        if share > 0.0 {
            for &(i, j, value) in &self.stiffest {
                tangent.add(i, j, share * value);
            }
        }
        structure.for_each_tangent(&mut |from, to, element| {
            let value = element.stiffness + element.damping / *dt;
            let of = |end: End| match end {
                End::Dof(dof) => place.get(dof).copied().flatten(),
                End::Ground | End::Fixed => None,
            };
            let ends = (of(from), of(to));
            for end in [ends.0, ends.1].into_iter().flatten() {
                tangent.add(end, end, value);
            }
            if let (Some(from), Some(to)) = ends {
                tangent.add(from, to, -value);
            }
        });
        structure.for_each_entry(*dt, &mut |i, j, value| {
            let of = |dof: usize| place.get(dof).copied().flatten();
            if let (Some(i), Some(j)) = (of(i), of(j)) {
                tangent.add(i, j, value);
            }
        });
        tangent.eliminate().is_ok()
    }

    /// step ← K_t⁻¹ step. Real-time: yes.
    fn solve(&mut self) {
        if self.is_tangent {
            self.tangent.solve_in_place(&mut self.step);
        } else {
            self.safe.solve_in_place(&mut self.step);
        }
    }

    /// The place that is tried into `state`. Real-time: yes.
    fn put(&mut self, state: &mut State) {
        for (x, &row) in self.tried.disp.iter().zip(&self.rows) {
            let moved = x - at(&self.disp, row);
            let places = [&mut state.disp, &mut state.vel].map(|all| all.get_mut(row));
            for (to, value) in places.into_iter().zip([*x, moved / self.dt]) {
                if let Some(to) = to {
                    *to = value;
                }
            }
            if let Some(change) = self.change.get_mut(row) {
                *change = moved;
            }
        }
    }

    /// r and φ at the place that is tried; false if the budget does not suffice yet. Real-time: yes.
    fn evaluate(
        &mut self,
        structure: &mut Structure,
        state: &mut State,
        budget: &mut usize,
    ) -> bool {
        let [disp, vel] = self.base;
        let base = Base { disp, vel };
        if self.search.member == 0 {
            self.put(state);
            self.forces.fill(0.0);
            let motion = Motion::new(&state.disp, &state.vel, base, self.dt);
            self.gross.fill(0.0);
            for (force, &row) in self.external.iter().zip(&self.rows) {
                if let Some(gross) = self.gross.get_mut(row) {
                    *gross = force.abs();
                }
            }
            structure.weigh(motion, &self.rows, &mut self.gross);
        }
        let motion = Motion::new(&state.disp, &state.vel, base, self.dt);
        let (from, gross) = (&mut self.search.member, &mut self.gross);
        if !structure.go_on_weighed(motion, &mut self.forces, gross, from, budget) {
            return false;
        }
        let external = self.external.iter().zip(&self.rows);
        for (to, (external, &row)) in self.tried.residual.iter_mut().zip(external) {
            *to = external + at(&self.forces, row);
        }
        self.tried.energy = self.energy();
        true
    }
}

/// Where a search is.
#[derive(Debug, Clone, Copy)]
struct Search {
    /// Places that were tried.
    places: u32,
    kind: PlaceKind,
    is_far: bool,
    may_restart: bool,
    /// The next part of the evaluation at the place that is tried.
    member: usize,
    /// The place of the rows is the one that was tried last.
    is_evaluated: bool,
}

impl Default for Search {
    fn default() -> Self {
        Self {
            places: 0,
            kind: PlaceKind::First,
            is_far: false,
            may_restart: true,
            member: 0,
            is_evaluated: false,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PlaceKind {
    First,
    Searched,
    /// That of the step last closed, from which the search begins again.
    Stays,
}

/// An entry; a missing one is not a number, which stops the test.
fn at(values: &[f64], index: usize) -> f64 {
    values.get(index).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::integrate::{Explicit, Gui, Integrator, Lambda, Start};
    use crate::law::LawSpec;
    use crate::model::Element;

    const DT: f64 = 1.0 / 1024.0;

    /// Masses (0: none) in a row, the first at the ground, with one law between each two.
    fn chain(mass: &[f64], laws: &[&str]) -> Structure {
        let n = mass.len();
        let end = |i: usize| if i == 0 { End::Ground } else { End::Dof(i - 1) };
        let elements = laws.iter().enumerate().map(|(i, text)| {
            let spec: LawSpec = toml::from_str(text).unwrap();
            Element {
                name: format!("spring {i}"),
                from: end(i),
                to: end(i + 1),
                law: spec.build().unwrap(),
                reach: crate::law::Reach {
                    disp: Some(1.0),
                    vel: Some(1.0),
                },
                hardening_ratio: None,
                damping_ratio: None,
            }
        });
        let zeros = || SymMatrix::zeros(n);
        Structure::new(
            SymMatrix::diagonal(mass),
            zeros(),
            zeros(),
            vec![1.0; n],
            elements,
        )
        .unwrap()
    }

    fn massless(structure: &Structure, dt: f64) -> Massless {
        let bounds = MasslessBounds {
            stiffness: structure.bound_stiffness().unwrap(),
            damping: structure.bound_damping().unwrap(),
        };
        Massless::new(structure, bounds, dt).unwrap().unwrap()
    }

    /// The steps under F(t) on the last mass; x of each step, and the largest lasting unbalance.
    fn run(
        mut structure: Structure,
        lambda: f64,
        dt: f64,
        steps: u32,
        force: impl Fn(f64) -> f64,
    ) -> (Vec<Vec<f64>>, f64) {
        let n = structure.dofs();
        let gui: Box<dyn Integrator> = Box::new(
            Gui::new(
                structure.mass(),
                &structure.reference_damping(),
                &structure.reference_stiffness(),
                dt,
                Lambda::Finite(lambda),
                Start::Published,
            )
            .unwrap(),
        );
        let mut method = Explicit {
            integrator: gui,
            massless: Some(Box::new(massless(&structure, dt))),
        };
        let mut state = State::at_rest(n);
        let (mut r, mut reported, mut all, mut worst) =
            (vec![0.0; n], vec![0.0; n], Vec::new(), 0.0);
        for step in 0..steps {
            let loaded = |step: u32, out: &mut [f64]| {
                out.fill(0.0);
                out[n - 1] = force(f64::from(step) * dt);
                Base::default()
            };
            loaded(step, &mut r);
            let own = method.massless.as_mut().unwrap();
            let passed = if step == 0 { 0.0 } else { dt };
            let motion = Motion::new(&state.disp, &state.vel, Base::default(), passed);
            own.close(&mut structure, motion, &mut r);
            structure.commit();
            worst = f64::max(worst, own.lasting_unbalance());
            all.push(state.disp.to_vec());
            method.advance(
                &mut structure,
                &mut state,
                &r,
                &mut reported,
                &mut |ahead, out| loaded(step + u32::from(ahead), out),
            );
        }
        (all, worst)
    }

    const SPRING: &str = "linear = { stiffness_n_per_m = 1e6 }";

    /// Springs in series are one spring, whatever the λ: the structure without its joint takes the same steps.
    #[test]
    fn linear_joint_is_condensed() {
        for lambda in [1.0, 4.0, 11.5] {
            let force = |t: f64| 4e3 * libm::sin(14.0 * t);
            let joint = chain(
                &[0.0, 1000.0],
                &["linear = { stiffness_n_per_m = 3e6 }", SPRING],
            );
            let one = chain(&[1000.0], &["linear = { stiffness_n_per_m = 7.5e5 }"]);
            let (found, unbalance) = run(joint, lambda, DT, 4096, force);
            assert!(unbalance < 1e-12, "{unbalance:e}");
            let mut gui = Gui::new(
                one.mass(),
                &one.reference_damping(),
                &one.reference_stiffness(),
                DT,
                Lambda::Finite(lambda),
                Start::Published,
            )
            .unwrap();
            let mut state = State::at_rest(1);
            for (step, found) in found.iter().enumerate() {
                assert!(
                    (found[1] - state.disp[0]).abs() < 1e-9 * 5e-3,
                    "step {step}"
                );
                assert!((found[0] - 0.25 * found[1]).abs() < 1e-9 * 5e-3);
                let r = force(step as f64 * DT) - 7.5e5 * state.disp[0];
                gui.advance(&mut state, &[r], &mut [0.0]);
            }
        }
    }

    /// A Maxwell damper, spring k and dashpot c in series, under a harmonic motion: its force is k c iω/(k + c iω).
    #[test]
    fn maxwell_damper_matches_its_closed_form() {
        let (k, c, omega) = (1e6, 2e4, 30.0);
        // A mass that the force cannot disturb.
        let mass = 1e9;
        let pushed = |t: f64| -mass * omega * omega * 0.01 * libm::sin(omega * t);
        let laws = [
            "linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 2e4 }",
            SPRING,
        ];
        let amplitude = |dt: f64| {
            let structure = chain(&[0.0, mass], &laws);
            let (found, unbalance) = run(structure, 4.0, dt, (2.0 / dt) as u32, pushed);
            assert!(unbalance < 1e-9, "{unbalance:e}");
            // Begun at rest, the mass drifts as well: that makes a constant force.
            let tail = &found[found.len() / 2..];
            let force = |x: &Vec<f64>| k * (x[1] - x[0]);
            let ends = tail
                .iter()
                .map(force)
                .fold((f64::MAX, f64::MIN), |(low, high), f| {
                    (low.min(f), high.max(f))
                });
            0.5 * (ends.1 - ends.0)
        };
        let ratio = c * omega / k;
        let expected = 0.01 * k * ratio / (1.0 + ratio * ratio).sqrt();
        let (coarse, fine) = (amplitude(1.0 / 512.0), amplitude(1.0 / 2048.0));
        assert!((fine / expected - 1.0).abs() < 0.02, "{fine} {expected}");
        assert!((fine - expected).abs() < (coarse - expected).abs());
    }

    proptest! {
        /// Joints of plastic and hardening laws under steps, ramps and sudden loads: the residual falls below the tolerance
        /// within a few steps, and never cycles.
        #[test]
        fn plastic_joints_come_to_balance(
            yields in prop::array::uniform3(1e3f64..2e4),
            ratios in prop::array::uniform3(0.02f64..0.3),
            stiffness in prop::array::uniform3(3e5f64..3e7),
            amplitude in 1.0f64..30.0,
            hz in 0.5f64..20.0,
        ) {
            let law = |i: usize| {
                let (k, f, a) = (stiffness[i], yields[i], ratios[i]);
                format!("bilinear = {{ stiffness_n_per_m = {k}, yield_force_n = {f}, post_yield_ratio = {a} }}")
            };
            let laws: Vec<String> = (0..3).map(law).collect();
            let laws: Vec<&str> = laws.iter().map(String::as_str).collect();
            let force = |t: f64| {
                let jump = if t > 0.5 { 0.3 } else { 0.0 };
                1000.0 * amplitude * (libm::sin(2.0 * std::f64::consts::PI * hz * t) + jump)
            };
            let (found, unbalance) = run(chain(&[0.0, 0.0, 1000.0], &laws), 4.0, DT, 1536, force);
            prop_assert!(found.iter().flatten().all(|x| x.is_finite()));
            prop_assert!(unbalance < 1e-9, "{unbalance:e}");
        }

        /// At a constant command the rows come to rest in one step, wherever they began, and stay there.
        #[test]
        fn nothing_cycles_at_rest(
            ratio in 0.001f64..1.0,
            start in -3.0f64..3.0,
            force in 0.2f64..3.0,
        ) {
            let law = |k: f64| {
                format!("bilinear = {{ stiffness_n_per_m = {k}, yield_force_n = 1e3, post_yield_ratio = {ratio} }}")
            };
            let mut structure = chain(&[0.0, 1e12], &[&law(1e6), &law(3e6)]);
            let mut own = massless(&structure, DT);
            let mut state = State::new(vec![start * 1e-3, 2e-3 * force], vec![0.0; 2]);
            let mut r = [0.0; 2];
            let mut places = Vec::new();
            for _ in 0..8 {
                r.fill(0.0);
                let motion = Motion::new(&state.disp, &[0.0; 2], Base::default(), DT);
                own.close(&mut structure, motion, &mut r);
                structure.commit();
                own.before(&state);
                own.begin(&structure, &state, &r, &mut |_, out| {
                    out.fill(0.0);
                    Base::default()
                });
                while !own.work(&mut structure, &mut state, &mut 1) {}
                places.push((state.disp[0], own.shares[0]));
            }
            for pair in places[1..].windows(2) {
                prop_assert!((pair[1].0 - pair[0].0).abs() < 1e-9 * 1e-3, "{places:?}");
                prop_assert!(pair[1].1 < 1e-9, "{places:?}");
            }
        }
    }

    #[test]
    fn loose_row_is_named() {
        let structure = chain(
            &[0.0, 1000.0],
            &[
                "linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 0 }",
                "linear = { stiffness_n_per_m = 0 }",
            ],
        );
        let bounds = MasslessBounds {
            stiffness: structure.bound_stiffness().unwrap(),
            damping: structure.bound_damping().unwrap(),
        };
        assert_eq!(Massless::new(&structure, bounds, DT).unwrap_err().dof, 0);
    }
}
