//! What comes back from a specimen: the raw measurement, and displacement and force at the structure.
//!
//! Invariant: an older measurement never replaces a newer one. Fresh measurements alone raise peaks: an old force in
//! place of an answer was not measured.

use std::ops::Range;

use super::axis::Axis;
use super::rest::Rest;
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::state;
use gusset_quantity::substructure::{Freshness, LinkFault, Measurement, Status};

/// The measured side of a port. All vectors have one entry per axis.
#[derive(Debug)]
pub struct Feedback {
    /// The newest measurement, in the specimen's units.
    raw: Measurement,
    /// Where the substructure writes. Between two exchanges its axes are those of `raw`.
    incoming: Measurement,
    /// Displacement in m at the structure.
    disp: Vec<f64>,
    /// Restoring force in N that enters equilibrium.
    force: Vec<f64>,
    /// Displacement and force of the tick in which the target was reached.
    kept: [Vec<f64>; 2],
    /// Force of a lost answer that was recovered last, N.
    recovered: Vec<f64>,
    /// Largest |force| in the test, and without what was measured after the last command.
    peak: Vec<f64>,
    peak_before_last: Vec<f64>,
    /// Largest |force| of the exchanges before the test.
    peak_at_startup: Vec<f64>,
}

// When a step is closed nothing is kept.
state! {
    Feedback as "feedback" { raw, disp, force, recovered, peak, peak_before_last, peak_at_startup }
    keeps { incoming, kept }
    restored { copy(raw, incoming) }
}

/// `to` ← `from`, which has as many axes. Real-time: yes.
#[inline]
fn copy(from: &Measurement, to: &mut Measurement) {
    to.sequence = from.sequence;
    to.time = from.time;
    to.status = from.status;
    let values = to.disp.iter_mut().zip(&mut to.force);
    for ((disp, force), (from_disp, from_force)) in values.zip(from.disp.iter().zip(&from.force)) {
        (*disp, *force) = (*from_disp, *from_force);
    }
}

/// Raises peaks to forces that are larger. Real-time: yes.
#[inline]
fn raise(peaks: &mut [f64], forces: &[f64]) {
    for (peak, force) in peaks.iter_mut().zip(forces) {
        let size = force.abs();
        if size > *peak && size < f64::INFINITY {
            *peak = size;
        }
    }
}

impl Feedback {
    pub(crate) fn new(axes: usize) -> Self {
        let zeros = || vec![0.0; axes];
        Self {
            raw: Measurement::zeros(axes),
            incoming: Measurement::zeros(axes),
            disp: zeros(),
            force: zeros(),
            kept: [zeros(), zeros()],
            recovered: zeros(),
            peak: zeros(),
            peak_before_last: zeros(),
            peak_at_startup: zeros(),
        }
    }

    /// The raw measurement of the last exchange, in the specimen's units.
    #[inline]
    #[must_use]
    pub const fn raw(&self) -> &Measurement {
        &self.raw
    }

    #[cfg(test)]
    pub(crate) const fn raw_mut(&mut self) -> &mut Measurement {
        &mut self.raw
    }

    /// Measured displacement, brought back to the structure's metres.
    #[inline]
    #[must_use]
    pub fn disp(&self) -> AtStructure<&[f64]> {
        AtStructure(&self.disp)
    }

    /// Restoring force in N that enters equilibrium.
    #[inline]
    #[must_use]
    pub fn force(&self) -> AtStructure<&[f64]> {
        AtStructure(&self.force)
    }

    /// Force of an answer that was recovered last, N.
    #[inline]
    pub(crate) fn recovered(&self) -> AtStructure<&[f64]> {
        AtStructure(&self.recovered)
    }

    /// Largest |force| of the test so far, N.
    #[must_use]
    pub fn peak(&self) -> AtStructure<&[f64]> {
        AtStructure(&self.peak)
    }

    pub(crate) fn peak_before_last(&self) -> AtStructure<&[f64]> {
        AtStructure(&self.peak_before_last)
    }

    /// Largest |force| of every exchange before the test, N.
    pub(crate) fn peak_at_startup(&self) -> AtStructure<&[f64]> {
        AtStructure(&self.peak_at_startup)
    }

    /// True if the raw measurement answers the command of the exchange. Real-time: yes.
    #[inline]
    pub(crate) const fn is_fresh(&self) -> bool {
        !self.raw.status.has(Status::STALE)
    }

    /// The next answers are counted from another number on.
    pub(crate) const fn forget_number(&mut self) {
        self.raw.sequence = 0;
    }

    /// Where the next answer is to be written: it holds the newest measurement. Real-time: yes.
    #[inline]
    pub(crate) const fn incoming(&mut self) -> &mut Measurement {
        // The numbers of the axes are there already.
        self.incoming.time = self.raw.time;
        self.incoming.status = self.raw.status;
        self.incoming.sequence = self.raw.sequence;
        &mut self.incoming
    }

    /// Takes the answer that was written, and brings it into the structure's units. Returns whether it is fresh, and whether every
    /// force is finite. Real-time: yes.
    #[inline]
    pub(crate) fn take(
        &mut self,
        answer: Result<Freshness, LinkFault>,
        axes: &[Axis],
    ) -> Result<(bool, bool), LinkFault> {
        let is_newest = self.incoming.sequence >= self.raw.sequence;
        if answer.is_err() || !is_newest {
            copy(&self.raw, &mut self.incoming);
        }
        let is_fresh = answer? == Freshness::Fresh && is_newest;
        let Measurement {
            sequence,
            time,
            status,
            disp,
            force,
        } = &self.incoming;
        (self.raw.sequence, self.raw.time, self.raw.status) = (*sequence, *time, *status);
        let raw = self.raw.disp.iter_mut().zip(&mut self.raw.force);
        let raw = raw.zip(disp.iter().zip(force));
        let at_structure = self.disp.iter_mut().zip(&mut self.force);
        let mut finite = true;
        for (((measured, force), (raw, (new_disp, new_force))), axis) in
            at_structure.zip(raw).zip(axes)
        {
            (*raw.0, *raw.1) = (*new_disp, *new_force);
            (*measured, *force) = axis.at_structure(AtAxis((*new_disp, *new_force))).0;
            finite &= force.is_finite();
        }
        if is_fresh {
            self.raw.status.0 &= !(Status::STALE.0 | Status::OWED.0);
        } else {
            self.raw.status.0 |= Status::STALE.0;
        }
        Ok((is_fresh, finite))
    }

    /// Takes displacements and forces in the specimen's units that were measured before the first command.
    pub(crate) fn take_at_rest(&mut self, at_rest: &Measurement, axes: &[Axis]) {
        let raw = self.raw.disp.iter_mut().zip(&mut self.raw.force);
        let read = at_rest.disp.iter().zip(&at_rest.force);
        let at_structure = self.disp.iter_mut().zip(&mut self.force);
        for ((raw, (disp, force)), (at_structure, axis)) in
            raw.zip(read).zip(at_structure.zip(axes))
        {
            (*raw.0, *raw.1) = (*disp, *force);
            (*at_structure.0, *at_structure.1) = axis.at_structure(AtAxis((*disp, *force))).0;
        }
        copy(&self.raw, &mut self.incoming);
    }

    /// Takes the means that were read at rest, where they are known better than by one answer; false where they are not. Real-time:
    /// yes.
    pub(crate) fn take_rest(&mut self, rest: &Rest, axes: &[Axis]) -> bool {
        let Some(means) = rest.means() else {
            return false;
        };
        let at_structure = self.disp.iter_mut().zip(&mut self.force);
        for (((measured, force), axis), (disp, raw)) in at_structure.zip(axes).zip(means) {
            (*measured, *force) = axis.at_structure(AtAxis((disp, raw))).0;
        }
        true
    }

    /// Takes the force of a lost answer that `recover` writes in the specimen's units; the number that it returns. Real-time: yes.
    pub(crate) fn take_recovered(
        &mut self,
        recover: impl FnOnce(&mut [f64]) -> Option<u64>,
        axes: &[Axis],
    ) -> Option<u64> {
        let number = recover(&mut self.recovered)?;
        for (force, axis) in self.recovered.iter_mut().zip(axes) {
            *force = axis.force_gain * (*force - axis.force_offset);
        }
        Some(number)
    }

    /// Moves a stale force along tangents from where it was measured to its target. Real-time: yes.
    pub(crate) fn extrapolate(
        &mut self,
        tangents: impl Iterator<Item = AtStructure<f64>>,
        target: AtStructure<&[f64]>,
    ) {
        let axes = self.force.iter_mut().zip(*target).zip(&self.disp);
        for (((force, target), measured), AtStructure(stiffness)) in axes.zip(tangents) {
            *force += stiffness * (target - measured);
        }
    }

    /// residual −= Bᵀ·force, by the rows of the axes: these rows of it. Real-time: yes.
    #[inline]
    pub(crate) fn subtract_force(&self, axes: &[Axis], rows: Range<usize>, residual: &mut [f64]) {
        for (axis, force) in axes.iter().zip(&self.force) {
            for &(dof, coefficient) in &axis.row {
                if rows.contains(&dof)
                    && let Some(entry) = residual.get_mut(dof)
                {
                    *entry -= coefficient * force;
                }
            }
        }
    }

    /// Keeps what belongs to the target that was just reached. Real-time: yes.
    pub(crate) fn keep(&mut self) {
        let [disp, force] = &mut self.kept;
        disp.copy_from_slice(&self.disp);
        force.copy_from_slice(&self.force);
    }

    /// Takes it back. Real-time: yes.
    pub(crate) fn take_kept(&mut self) {
        let [disp, force] = &self.kept;
        self.disp.copy_from_slice(disp);
        self.force.copy_from_slice(force);
    }

    /// Raises the peaks of the test. Real-time: yes.
    #[inline]
    pub(crate) fn note_peak(&mut self) {
        if self.is_fresh() {
            raise(&mut self.peak, &self.force);
        }
    }

    /// Raises the peaks before the test. Real-time: yes.
    pub(crate) fn note_peak_at_startup(&mut self) {
        if self.is_fresh() {
            raise(&mut self.peak_at_startup, &self.force);
        }
    }

    /// The next command leaves: what is measured from here on is behind it. Real-time: yes.
    #[inline]
    pub(crate) fn mark_command(&mut self) {
        self.peak_before_last.copy_from_slice(&self.peak);
    }

    /// The specimen is lost: its status shows that in every row from here on.
    pub(crate) const fn note_loss(&mut self) {
        self.raw.status.0 |= Status::LOST.0;
    }

    /// The command did not leave: the link is lost. Real-time: yes.
    pub(crate) const fn note_unsent(&mut self) {
        self.raw.status.0 |= Status::UNSENT.0;
    }

    /// The loop does not wait for the answer any more: the status shows that until it comes. Real-time: yes.
    pub(crate) const fn leave_owing(&mut self) {
        self.raw.status.0 |= Status::OWED.0;
    }

    /// True while its answer is owed and not waited for.
    pub(crate) const fn is_left_owing(&self) -> bool {
        self.raw.status.has(Status::OWED)
    }
}
