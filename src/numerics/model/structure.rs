//! [`Structure`]: the matrices, the elements, and the internal force of one instant.

use std::borrow::Cow;
use std::ops::Range;

use super::element::{row, stamp};
use super::elements::{Elements, Seen, bound};
use super::rows::{Alone, EvenChain};
use super::{Base, Element, End, ModelError, Motion, Part, sound};
use crate::frame::{At, Members, Which};
use crate::law::Tangent;
use crate::linalg::{Lanes, SymMatrix};
use gusset_quantity::state;

/// The numerical substructure.
#[derive(Debug)]
pub struct Structure {
    mass: SymMatrix,
    damping: SymMatrix,
    stiffness: SymMatrix,
    influence: Vec<f64>,
    /// Rows of K ι and C ι that are not zero: (degree of freedom, N/m, N s/m).
    tied_to_base: Vec<(usize, f64, f64)>,
    elements: Elements,
    /// Those of a frame that are not part of K.
    members: Members,
    lanes: Lanes,
    /// Coefficient of the stiffness in a damping rule.
    stiffness_coefficient: Option<f64>,
    /// Their collective name, and each storey.
    storeys: (&'static str, Vec<Storey>),
}

state! {
    Structure { elements, members }
    keeps { mass, damping, stiffness, influence, tied_to_base, lanes, stiffness_coefficient, storeys }
}

impl Structure {
    /// Joins matrices (n × n, SI units), influence vector ι (n) and elements.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn new(
        mass: SymMatrix,
        damping: SymMatrix,
        stiffness: SymMatrix,
        influence: Vec<f64>,
        elements: impl IntoIterator<Item = Element>,
    ) -> Result<Self, ModelError> {
        let n = mass.n();
        let matrices = [
            ("mass", &mass),
            ("damping", &damping),
            ("stiffness", &stiffness),
        ];
        sound::check(matrices, &influence)?;
        let tied_to_base = sound::tied_to_base(&stiffness, &damping, &influence);
        let has_massless = (0..n).any(|dof| mass.row_is_zero(dof));
        Ok(Self {
            mass,
            damping,
            stiffness,
            influence,
            tied_to_base,
            elements: Elements::new(elements, n, has_massless)?,
            members: Members::default(),
            lanes: Lanes::best_for(n),
            stiffness_coefficient: None,
            storeys: ("", Vec::new()),
        })
    }

    /// Names the springs and dashpots that make up the linear K and C, for reports on stability: "`word` 1" between the
    /// base and the first degree of freedom, "`word` 2" between the first and the second, and so on.
    #[must_use]
    pub(crate) fn with_storeys(mut self, word: &'static str, each: Vec<Storey>) -> Self {
        self.storeys = (word, each);
        self
    }

    /// Adds the members of a frame, whose rows are those of this structure.
    #[must_use]
    pub(crate) fn with_members(mut self, members: Members) -> Self {
        self.members = members;
        if self.massless().is_empty() {
            self.members.repeat();
        }
        self
    }

    /// The members of a frame that are not part of K.
    #[must_use]
    pub fn members(&self) -> &Members {
        &self.members
    }

    /// True if members of a frame are evaluated in each step.
    #[must_use]
    pub fn has_members(&self) -> bool {
        !self.members.is_empty()
    }

    /// True if the internal forces are K x + C v, whatever the motion.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        self.elements.is_empty() && self.members.is_empty()
    }

    /// Number of degrees of freedom n.
    #[must_use]
    pub fn dofs(&self) -> usize {
        self.mass.n()
    }

    /// M; a zero row is a massless degree of freedom.
    #[inline]
    #[must_use]
    pub fn mass(&self) -> &SymMatrix {
        &self.mass
    }

    /// Degrees of freedom without mass, rising.
    #[must_use]
    pub fn massless(&self) -> Vec<usize> {
        let rows = 0..self.dofs();
        rows.filter(|&dof| self.mass.row_is_zero(dof)).collect()
    }

    /// The linear C, without elements.
    #[must_use]
    pub fn damping(&self) -> &SymMatrix {
        &self.damping
    }

    /// Coefficient b of K in the damping rule, in s; none without such a rule.
    #[must_use]
    pub fn stiffness_coefficient(&self) -> Option<f64> {
        self.stiffness_coefficient
    }

    /// The linear K, without elements.
    #[must_use]
    pub fn stiffness(&self) -> &SymMatrix {
        &self.stiffness
    }

    /// ι: displacement of each degree of freedom per unit displacement of a rigid base.
    #[must_use]
    pub fn influence(&self) -> &[f64] {
        &self.influence
    }

    /// Names of the elements.
    pub fn element_names(&self) -> impl Iterator<Item = Cow<'_, str>> {
        self.elements.iter().map(|element| element.name)
    }

    /// Declares that no caller will query the tangents of this structure. Equal laws that are evaluated side by side
    /// then need not remember their last trial, and those tangents stay the ones at rest.
    pub fn forget_tangents(&mut self) {
        self.elements.forget_tangents();
    }

    /// Chooses the instructions of block arithmetic, for comparisons: the fastest are chosen anyway, and the bits are
    /// the same with all of them.
    #[cfg(any(test, feature = "test-doubles"))]
    pub fn set_lanes(&mut self, lanes: Lanes) {
        self.lanes = lanes;
        self.elements.set_lanes(lanes);
    }

    /// −M ι: the load per unit ground acceleration in relative coordinates, in kg.
    #[must_use]
    pub fn ground_load(&self) -> Vec<f64> {
        let mut load = vec![0.0; self.dofs()];
        self.mass.subtract_product(&self.influence, &mut load);
        load
    }

    /// K0 of the numerical side: K and the reference stiffness of the elements.
    #[must_use]
    pub fn reference_stiffness(&self) -> SymMatrix {
        let all = self.assemble(&self.stiffness, |element| element.law.reference().stiffness);
        self.with(
            all,
            self.members.stiffness(Which::Reference).unwrap_or_default(),
        )
    }

    /// C0 of the numerical side: C and the reference damping of the elements.
    #[must_use]
    pub fn reference_damping(&self) -> SymMatrix {
        let all = self.assemble(&self.damping, |element| element.law.reference().damping);
        self.with(
            all,
            self.members.damping(Which::Reference).unwrap_or_default(),
        )
    }

    /// Part of the reference damping of the elements that acts around rest only.
    #[must_use]
    pub fn rest_damping(&self) -> SymMatrix {
        let nothing = SymMatrix::zeros(self.dofs());
        let all = self.assemble(&nothing, |element| element.law.rest_damping());
        self.with(all, self.members.damping(Which::Rest).unwrap_or_default())
    }

    /// Tangent stiffness at the last internal force.
    #[must_use]
    pub fn tangent_stiffness(&self) -> SymMatrix {
        let all = self.assemble(&self.stiffness, |element| element.tangent().stiffness);
        self.with(all, self.members.tangent_stiffness())
    }

    /// Tangent damping at the last internal force.
    #[must_use]
    pub fn tangent_damping(&self) -> SymMatrix {
        let all = self.assemble(&self.damping, |element| element.tangent().damping);
        self.with(all, self.members.tangent_damping())
    }

    /// Tangent stiffness of the undeformed structure: what damping by ratios refers to. Takes a trial of every law
    /// at zero and forgets it.
    #[must_use]
    pub fn stiffness_at_rest(&mut self) -> SymMatrix {
        let at_rest = self.elements.at_rest();
        let ends = self.elements.iter().zip(&at_rest);
        let entries =
            ends.flat_map(|(element, at)| stamp(&row(element.from, element.to), at.stiffness));
        let all = (self.stiffness).plus(1.0, &SymMatrix::from_triplets(self.dofs(), entries));
        self.with(all, self.members.stiffness(Which::Rest).unwrap_or_default())
    }

    /// Damping of the structure at rest: of each element its tangent there, or its reference where that is less. Takes a trial
    /// of every law at zero and forgets it.
    #[must_use]
    pub fn damping_at_rest(&mut self) -> SymMatrix {
        let at_rest = self.elements.at_rest();
        let mut at_rest = at_rest.iter();
        let all = self.assemble(&self.damping, |element| {
            let reference = element.law.reference().damping;
            at_rest
                .next()
                .map_or(reference, |at| reference.min(at.damping))
        });
        self.with(
            all,
            self.members.damping(Which::Reference).unwrap_or_default(),
        )
    }

    fn with(&self, matrix: SymMatrix, entries: Vec<(usize, usize, f64)>) -> SymMatrix {
        if entries.is_empty() {
            return matrix;
        }
        matrix.plus(1.0, &SymMatrix::from_triplets(self.dofs(), entries))
    }

    /// Replaces the linear C by that of a damping rule, which may have a coefficient of K.
    ///
    /// # Errors
    /// Another size, or an entry that is not finite.
    pub(crate) fn set_damping(
        &mut self,
        damping: SymMatrix,
        stiffness_coefficient: Option<f64>,
    ) -> Result<(), ModelError> {
        sound::check_matrix("damping", &damping, self.dofs())?;
        self.tied_to_base = sound::tied_to_base(&self.stiffness, &damping, &self.influence);
        self.damping = damping;
        self.stiffness_coefficient = stiffness_coefficient;
        Ok(())
    }

    /// K_max: upper bound of the tangent stiffness.
    ///
    /// # Errors
    /// [`ModelError::NoBound`] for an element whose bound needs a declared reach that is missing.
    pub fn bound_stiffness(&self) -> Result<SymMatrix, ModelError> {
        let bounds = self.bounds()?;
        let mut bounds = bounds.iter();
        let all = self.assemble(&self.stiffness, |_| {
            bounds.next().map_or(0.0, |bound| bound.stiffness)
        });
        let of_members = self.members.stiffness(Which::Bound);
        let of_members = of_members.map_err(|name| {
            if self.members.is_moving(&name) {
                return ModelError::NoBound {
                    element: name,
                    tangent: "stiffness",
                    key: "corotational.largest_rotation_rad",
                    ratio: "integrator.lambda",
                };
            }
            no_bound(name, "stiffness")
        });
        Ok(self.with(all, of_members?))
    }

    /// C_max: upper bound of the tangent damping.
    ///
    /// # Errors
    /// [`ModelError::NoBound`] for an element whose bound needs a declared reach that is missing.
    pub fn bound_damping(&self) -> Result<SymMatrix, ModelError> {
        let bounds = self.bounds()?;
        let mut bounds = bounds.iter();
        let all = self.assemble(&self.damping, |_| {
            bounds.next().map_or(0.0, |bound| bound.damping)
        });
        let of_members = self.members.damping(Which::Bound);
        Ok(self.with(all, of_members.map_err(|link| no_bound(link, "damping"))?))
    }

    /// The named parts of K_max and C_max: storeys or springs, then elements.
    ///
    /// # Errors
    /// As [`Structure::bound_stiffness`].
    #[cfg(test)]
    pub(crate) fn parts(&self) -> Result<Vec<Part>, ModelError> {
        let mut parts = Vec::new();
        self.for_each_part(&mut |part| parts.push(part.clone()))?;
        Ok(parts)
    }

    /// Hands the named parts of K_max and C_max to `visit` one at a time, storeys or springs first, then elements.
    ///
    /// # Errors
    /// As [`Structure::bound_stiffness`].
    pub fn for_each_part(&self, visit: &mut dyn FnMut(&Part)) -> Result<(), ModelError> {
        let (word, storeys) = &self.storeys;
        for (i, storey) in storeys.iter().enumerate() {
            visit(&Part {
                name: format!("{word} {}", i + 1),
                row: storey_row(i),
                stiffness_bound: storey.stiffness,
                damping: storey.damping,
                damping_bound: storey.damping,
            });
        }
        for element in self.elements.iter() {
            let bound = bound(&element)?;
            visit(&Part {
                row: row(element.from, element.to),
                stiffness_bound: bound.stiffness,
                damping: element.law.reference().damping,
                damping_bound: bound.damping,
                name: element.name.into_owned(),
            });
        }
        for link in self.members.links() {
            let missing = |tangent| no_bound(link.name.to_owned(), tangent);
            visit(&Part {
                name: link.name.to_owned(),
                stiffness_bound: link.stiffness_bound.ok_or_else(|| missing("stiffness"))?,
                damping: link.damping,
                damping_bound: link.damping_bound.ok_or_else(|| missing("damping"))?,
                row: link.row,
            });
        }
        Ok(())
    }

    /// residual ← residual − R_d(v) − R_s(x) in N, everything counted from the base: one trial and one commit of every
    /// element, so call it once per accepted tick. `dt` is the time in s since the last call, 0 for the first or a
    /// hold. Slices have n entries. Under ground acceleration (relative coordinates) `base` is zero.
    /// Real-time: yes.
    #[inline]
    pub fn subtract_internal(
        &mut self,
        disp: &[f64],
        vel: &[f64],
        base: Base,
        dt: f64,
        residual: &mut [f64],
    ) {
        let motion = Motion::new(disp, vel, base, dt);
        self.walk::<true>(motion, residual, &mut []);
        self.step_members(motion, residual);
    }

    /// Forces of all members, and their commit. Real-time: yes.
    fn step_members(&mut self, motion: Motion<'_>, residual: &mut [f64]) {
        let all = 0..self.members.count();
        self.members
            .subtract(all, at(motion), self.lanes, residual, &mut []);
        self.members.commit();
    }

    /// How large the forces of K and C are on `rows`: `gross` of such a row gains the size of what each spring and dashpot bears.
    /// Real-time: yes.
    pub(crate) fn weigh(&self, motion: Motion<'_>, rows: &[usize], gross: &mut [f64]) {
        for &row in rows {
            let sizes = [(&self.stiffness, motion.disp), (&self.damping, motion.vel)];
            if let Some(gross) = gross.get_mut(row) {
                *gross += sizes
                    .map(|(matrix, of)| sizes_of(matrix, row, of))
                    .iter()
                    .sum::<f64>();
            }
        }
    }

    /// [`Structure::subtract_trial`] in parts: as many members as `budget` allows, from part `from` on, which is 0 at first. Both
    /// are moved on; true if it is done, and `from` is 0 again. Real-time: yes.
    pub fn go_on(
        &mut self,
        motion: Motion<'_>,
        residual: &mut [f64],
        from: &mut usize,
        budget: &mut usize,
    ) -> bool {
        self.go_on_weighed(motion, residual, &mut [], from, budget)
    }

    /// The same; `gross` gains the size of each force of an element or a member where it has an entry for its row. Real-time: yes.
    pub(crate) fn go_on_weighed(
        &mut self,
        motion: Motion<'_>,
        residual: &mut [f64],
        gross: &mut [f64],
        from: &mut usize,
        budget: &mut usize,
    ) -> bool {
        if *from == 0 {
            self.walk::<false>(motion, residual, gross);
            *from = 1;
        }
        let count = self.members.count();
        let end = count.min((*from - 1).saturating_add(*budget));
        *budget -= end - (*from - 1);
        let part = *from - 1..end;
        self.members
            .subtract(part, at(motion), self.lanes, residual, gross);
        *from = if end == count { 0 } else { end + 1 };
        end == count
    }

    /// out ← out − K_t d − C_t v with the tangents at the last trial of every element. `change` holds d and v, and those of the
    /// base. For structures with massless degrees of freedom. Real-time: yes.
    pub(crate) fn subtract_tangent(&self, change: Motion<'_>, out: &mut [f64]) {
        self.subtract_linear(0..out.len(), change, out);
        self.members.subtract_tangent(at(change), out);
        for element in self.elements.iter() {
            let of = |end: End, of_dofs: &[f64], of_base: f64| match end {
                End::Dof(dof) => of_dofs.get(dof).copied().unwrap_or(f64::NAN),
                End::Ground => of_base,
                End::Fixed => 0.0,
            };
            let between = |of_dofs: &[f64], of_base: f64| {
                of(element.to, of_dofs, of_base) - of(element.from, of_dofs, of_base)
            };
            let tangent = element.tangent();
            let force = tangent.stiffness * between(change.disp, change.base.disp)
                + tangent.damping * between(change.vel, change.base.vel);
            for (end, sign) in [(element.from, 1.0), (element.to, -1.0)] {
                if let End::Dof(dof) = end
                    && let Some(out) = out.get_mut(dof)
                {
                    *out += sign * force;
                }
            }
        }
    }

    /// Hands the tangents of every element to `visit`, at its last trial. Real-time: yes, if `visit` is.
    pub(crate) fn for_each_tangent(&self, visit: &mut dyn FnMut(End, End, Tangent)) {
        for element in self.elements.iter() {
            visit(element.from, element.to, element.tangent());
        }
    }

    /// Hands the entries of K_t + C_t/Δt of every member to `visit`, each beside the diagonal once. Real-time: yes, if `visit` is.
    pub(crate) fn for_each_entry(&self, dt: f64, visit: &mut dyn FnMut(usize, usize, f64)) {
        self.members.for_each_tangent(dt, visit);
    }

    /// From now on every evaluation of a member makes all of its passes, or no more than it needs.
    pub fn exhaust_members(&mut self, yes: bool) {
        self.members.exhaust(yes);
    }

    /// As [`Structure::subtract_internal`], without the commit: a trial from the committed state, which may be
    /// repeated. [`Structure::commit`] keeps the last one.
    pub fn subtract_trial(
        &mut self,
        disp: &[f64],
        vel: &[f64],
        base: Base,
        dt: f64,
        residual: &mut [f64],
    ) {
        let (mut from, mut budget) = (0, usize::MAX);
        let motion = Motion::new(disp, vel, base, dt);
        self.go_on(motion, residual, &mut from, &mut budget);
    }

    /// The last trial of every element becomes its committed state.
    pub fn commit(&mut self) {
        self.elements.commit();
        self.members.commit();
    }

    /// Forgets the last trial of every element.
    #[cfg(test)]
    pub(crate) fn revert(&mut self) {
        self.elements.revert();
    }

    /// Some rows at a time while they are near, then what does not act row by row. Real-time: yes.
    #[inline]
    fn walk<const COMMIT: bool>(
        &mut self,
        motion: Motion<'_>,
        residual: &mut [f64],
        gross: &mut [f64],
    ) {
        let n = residual.len();
        let mut first = 0;
        while first < n {
            let rows = first..(first + NEAR).min(n);
            first = rows.end;
            self.subtract_linear(rows.clone(), motion, residual);
            if !self.elements.is_empty() {
                self.elements.subtract_anchored(rows, motion, residual);
            }
        }
        if !self.elements.is_empty() {
            self.elements
                .subtract_rest::<COMMIT>(motion, residual, gross);
        }
    }

    /// What K, C and the moving base do to some rows. Real-time: yes.
    #[inline]
    fn subtract_linear(&self, rows: Range<usize>, motion: Motion<'_>, residual: &mut [f64]) {
        let lanes = self.lanes;
        self.stiffness
            .subtract_rows(rows.clone(), motion.disp, residual, lanes);
        if !self.damping.is_zero() {
            self.damping
                .subtract_rows(rows.clone(), motion.vel, residual, lanes);
        }
        for (dof, stiffness, damping) in self.tied(&rows, motion.base) {
            if let Some(r) = residual.get_mut(*dof) {
                *r += stiffness * motion.base.disp + damping * motion.base.vel;
            }
        }
    }

    /// The rows among these that the base moves; a base at rest adds nothing.
    #[inline]
    fn tied(&self, rows: &Range<usize>, base: Base) -> &[(usize, f64, f64)] {
        if base == Base::default() {
            return &[];
        }
        let place = |row| self.tied_to_base.partition_point(|tied| tied.0 < row);
        self.tied_to_base
            .get(place(rows.start)..place(rows.end))
            .unwrap_or_default()
    }

    /// Number of rows above the requested ones whose displacements [`Structure::subtract_rows`] needs. All of them as long
    /// as the tangents of equal elements are kept.
    #[must_use]
    pub fn reach(&self) -> usize {
        if !self.members.is_empty() {
            return usize::MAX;
        }
        let matrices = [&self.stiffness, &self.damping];
        let of_matrices = matrices.map(SymMatrix::reach).into_iter().max();
        self.elements.reach().max(of_matrices.unwrap_or(0))
    }

    /// As [`Structure::subtract_internal`] for some rows only, with the same bits; all slices are whole. In one step rows
    /// are requested in ascending order, each once, and every element is committed with the first of its rows.
    /// Displacements of rows further above than [`Structure::reach`] are not read. With `fresh` the residual begins with
    /// zeros, whatever is there. Real-time: yes.
    #[inline]
    pub fn subtract_rows(
        &mut self,
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
        fresh: bool,
    ) {
        if self.elements.keeps_tangents() || !self.members.is_empty() {
            debug_assert_eq!(rows, 0..residual.len(), "the reach is all rows");
            if fresh {
                residual.fill(0.0);
            }
            self.walk::<true>(motion, residual, &mut []);
            return self.step_members(motion, residual);
        }
        if !self.subtract_even(rows.clone(), motion, residual, fresh) {
            if fresh && let Some(residual) = residual.get_mut(rows.clone()) {
                residual.fill(0.0);
            }
            self.subtract_linear(rows.clone(), motion, residual);
            self.elements.subtract_rows(0, rows, motion, residual);
        }
    }

    /// [`Structure::subtract_rows`] where inner rows of both K and C are alike, in one pass over them. False if nothing was done.
    #[inline]
    fn subtract_even(
        &mut self,
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
        fresh: bool,
    ) -> bool {
        let (Some(stiffness), Some(damping)) = (self.stiffness.even(), self.damping.even()) else {
            return false;
        };
        let n = self.dofs();
        let inner = rows.start.max(1)..rows.end.min(n.saturating_sub(1));
        if inner.is_empty() || !self.tied(&inner, motion.base).is_empty() {
            return false;
        }
        let entries = (stiffness, damping);
        let chain = EvenChain::new(inner.clone(), entries, motion, residual, fresh);
        let joined = self.elements.join(chain, motion);
        if !joined {
            let chain = EvenChain::new(inner.clone(), entries, motion, residual, fresh);
            self.lanes.run(Alone(chain));
        }
        for end in [rows.start..inner.start, inner.end..rows.end] {
            if end.is_empty() {
                continue;
            }
            if fresh && let Some(residual) = residual.get_mut(end.clone()) {
                residual.fill(0.0);
            }
            self.subtract_linear(end.clone(), motion, residual);
            if joined {
                self.elements.subtract_first(end, motion, residual);
            }
        }
        let skipped = usize::from(joined);
        self.elements.subtract_rows(skipped, rows, motion, residual);
        true
    }

    fn bounds(&self) -> Result<Vec<Tangent>, ModelError> {
        self.elements
            .iter()
            .map(|element| bound(&element))
            .collect()
    }

    /// `linear` plus one value per element.
    fn assemble(&self, linear: &SymMatrix, mut value: impl FnMut(&Seen<'_>) -> f64) -> SymMatrix {
        if self.elements.is_empty() {
            return linear.clone();
        }
        let entries = self.elements.iter().flat_map(|element| {
            let value = value(&element);
            stamp(&row(element.from, element.to), value)
        });
        linear.plus(1.0, &SymMatrix::from_triplets(self.dofs(), entries))
    }
}

fn at(motion: Motion<'_>) -> At<'_> {
    let Motion {
        disp,
        vel,
        base,
        dt,
    } = motion;
    At {
        disp,
        vel,
        base: [base.disp, base.vel],
        dt,
    }
}

fn no_bound(element: String, tangent: &'static str) -> ModelError {
    let (key, ratio) = match tangent {
        "stiffness" => ("reach_disp_m", "hardening_ratio"),
        _ => ("reach_vel_m_per_s", "damping_ratio"),
    };
    ModelError::NoBound {
        element,
        tangent,
        key,
        ratio,
    }
}

/// Spring and dashpot of one storey, or of one place in a chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Storey {
    /// N/m.
    pub stiffness: f64,
    /// N s/m.
    pub damping: f64,
}

/// Σ |force| of the springs of one row: between x_i and each x_j, and to the ground. Real-time: yes.
fn sizes_of(matrix: &SymMatrix, row: usize, x: &[f64]) -> f64 {
    let of = |index: usize| x.get(index).copied().unwrap_or(f64::NAN);
    let (mut between, mut held) = (0.0, 0.0);
    for (column, k) in matrix.row(row) {
        if column == row {
            held += k;
        } else {
            held -= k.abs();
            between += (k.abs() * of(row) + k * of(column)).abs();
        }
    }
    between + (held * of(row)).abs()
}

/// Rows that are made at a time: their vectors stay in the nearest cache.
const NEAR: usize = 1024;

/// b of a storey or spring, from 0 at the ground.
fn storey_row(i: usize) -> Vec<(usize, f64)> {
    match i {
        0 => vec![(0, 1.0)],
        _ => vec![(i - 1, -1.0), (i, 1.0)],
    }
}
