//! One exchange of a port: the command is made from the target, sent, answered, and brought back into the structure's units.

use super::{Port, Rest};
use crate::substructure::{Command, Freshness, LinkFault, Measurement, Retirement, Status};
use crate::time::Nanos;

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

impl Port {
    /// Makes the next command from the structure's state. Real-time: yes.
    pub fn aim(&mut self, disp: &[f64], vel: &[f64], base_disp: f64, base_vel: f64) {
        let (target, target_vel) = (&mut self.target, &mut self.target_vel);
        if let Some(posed) = &mut self.posed {
            posed.seek([disp, vel], [base_disp, base_vel], target, target_vel);
        } else {
            for ((axis, target), target_vel) in self.axes.iter().zip(target).zip(target_vel) {
                (*target, *target_vel) = axis.dots([disp, vel], [base_disp, base_vel]);
            }
        }
        self.prepare_command();
    }

    /// Makes the next command from prescribed deformations: takes displacement and velocity of one axis (or of one coordinate
    /// of the loading unit) after the other from `along`. Real-time: yes.
    pub fn aim_at(&mut self, along: &mut impl Iterator<Item = (f64, f64)>) {
        let (target, target_vel) = (&mut self.target, &mut self.target_vel);
        if let Some(posed) = &mut self.posed {
            posed.seek_at(along, target, target_vel);
        } else {
            for ((target, target_vel), (disp, vel)) in target.iter_mut().zip(target_vel).zip(along)
            {
                *target = disp;
                *target_vel = vel;
            }
        }
        self.prepare_command();
    }

    #[inline]
    pub(super) fn prepare_command(&mut self) {
        self.command_the_target();
        self.compensate();
    }

    /// The command is the target itself. Real-time: yes.
    #[inline]
    pub(super) fn command_the_target(&mut self) {
        let commands = self.command.iter_mut().zip(&mut self.command_vel);
        let targets = self.target.iter().zip(&self.target_vel);
        for (((command, command_vel), (disp, vel)), axis) in commands.zip(targets).zip(&self.axes) {
            *command = axis.disp_gain * disp + axis.disp_offset;
            *command_vel = axis.vel_gain * vel;
        }
    }

    /// Sends the command that stands ready, if it was judged. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost, or the command was not judged ([`Port::clear`]).
    #[inline]
    pub fn issue(&mut self, sequence: u64, time: f64, dt: f64) -> Result<(), LinkFault> {
        if !self.guard.cleared {
            return Err(LinkFault::Refused);
        }
        self.guard.sent(&self.command);
        self.estimates.moves = true;
        self.carried.copy_from_slice(&self.peak_force);
        for (sent, command) in self.sent.iter_mut().zip(&self.command) {
            *sent = *command;
        }
        self.link.sent += 1;
        self.compensation_asks(true);
        self.tracking.passes = dt;
        self.issued = Some(sequence + self.ahead);
        let command = Command {
            sequence: self.pursuit.number(sequence, self.ahead),
            time,
            dt,
            disp: &self.command,
            vel: &self.command_vel,
        };
        let outcome = self.substructure.issue(&command);
        self.unsent = outcome.is_err();
        self.owes |= !self.unsent;
        outcome
    }

    /// True if a command has left whose answer was not taken. Real-time: yes.
    #[inline]
    #[must_use]
    pub const fn owes(&self) -> bool {
        self.owes
    }

    /// False of a partner that is told nothing: it is lost, or owes an answer of the test on the way out. Real-time: yes.
    #[inline]
    #[must_use]
    pub const fn is_heard(&self) -> bool {
        !self.partner.lost && !self.partner.owes_the_last
    }

    /// The specimen is lost: its status says so in every row from here on.
    pub fn note_loss(&mut self) {
        self.raw.status.0 |= Status::LOST.0;
        if self.unsent {
            self.raw.status.0 |= Status::UNSENT.0;
        }
    }

    /// Takes the answer and brings it into the structure's units. One that is older than what is known already counts
    /// as stale and changes nothing. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost, or the force is not a finite number.
    #[inline]
    pub fn collect(&mut self, deadline: Nanos) -> Result<Freshness, LinkFault> {
        // The numbers of the axes are there already.
        self.incoming.time = self.raw.time;
        self.incoming.status = self.raw.status;
        self.incoming.sequence = self.pursuit.on_link(self.raw.sequence);
        let answer = self.substructure.collect(deadline, &mut self.incoming);
        self.owes &= answer.is_err();
        self.incoming.sequence = self.pursuit.in_test(self.incoming.sequence);
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
        let seen = self.measured.iter_mut().zip(&mut self.force);
        let mut finite = true;
        for (((measured, force), (raw, (new_disp, new_force))), axis) in
            seen.zip(raw).zip(&self.axes)
        {
            (*raw.0, *raw.1) = (*new_disp, *new_force);
            (*measured, *force) = axis.at_structure(*new_disp, *new_force);
            finite &= force.is_finite();
        }
        if is_fresh {
            self.link.received += 1;
            self.partner.measured = true;
            self.raw.status.0 &= !(Status::STALE.0 | Status::OWED.0);
        } else {
            self.link.stale += 1;
            self.raw.status.0 |= Status::STALE.0;
        }
        self.compensation_hears(is_fresh);
        match (finite, is_fresh) {
            (false, _) => Err(LinkFault::NotFinite),
            (true, true) => Ok(Freshness::Fresh),
            (true, false) => Ok(Freshness::Stale),
        }
    }

    /// Displacement and force are those that were read at rest, where they are known better than by one answer; false where they
    /// are not. Real-time: yes.
    pub fn take_rest(&mut self, rest: &Rest) -> bool {
        let Some(means) = rest.means() else {
            return false;
        };
        let seen = self.measured.iter_mut().zip(&mut self.force);
        for (((measured, force), axis), (disp, raw)) in seen.zip(&self.axes).zip(means) {
            (*measured, *force) = axis.at_structure(disp, raw);
        }
        true
    }

    /// The force of an answer that was lost and stood in the history of a later one is in [`Port::recovered`], and this is the
    /// number of its command in the test. Each call takes one. Real-time: yes.
    pub fn recover(&mut self) -> Option<u64> {
        let number = self.substructure.recover(&mut self.recovered)?;
        for (force, axis) in self.recovered.iter_mut().zip(&self.axes) {
            *force = axis.force_gain * (*force - axis.force_offset);
        }
        Some(self.pursuit.in_test(number))
    }

    /// Moves a stale force along the tangent, as far as it is known and not beyond its bounds, from where it was measured to
    /// where the specimen should be by now. Real-time: yes.
    pub fn extrapolate(&mut self) {
        let tangents = self.estimates.bounded(&self.stiffness);
        let axes = self.force.iter_mut().zip(&self.target).zip(&self.measured);
        for (((force, target), measured), stiffness) in axes.zip(tangents) {
            *force += stiffness * (target - measured);
        }
    }

    /// residual −= Bᵀ·force. Real-time: yes.
    #[inline]
    pub fn subtract_force(&mut self, residual: &mut [f64]) {
        if let Some(posed) = &self.posed {
            posed.subtract_force(residual);
            return;
        }
        for (axis, force) in self.axes.iter().zip(&self.force) {
            for &(dof, coefficient) in &axis.row {
                if let Some(entry) = residual.get_mut(dof) {
                    *entry -= coefficient * force;
                }
            }
        }
    }

    /// Notes the peak of the force, whatever is made of it. What stands in for an answer that stayed away was not measured: it
    /// is no peak; nor is a force that is recovered later, which moved nothing and which no recording holds. Real-time: yes.
    #[inline]
    pub fn note_peak(&mut self) {
        if self.is_fresh() {
            raise(&mut self.peak_force, &self.force);
        }
    }

    /// The same before the test. Real-time: yes.
    pub fn note_force_on_the_way_in(&mut self) {
        if self.is_fresh() {
            raise(&mut self.force_on_the_way_in, &self.force);
        }
    }

    /// The step is accepted. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    #[inline]
    pub fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        let sequence = self.pursuit.accepts(sequence);
        let number = self.pursuit.on_link(sequence);
        self.substructure.accepted(number)
    }

    /// Last words.
    pub fn retire(&mut self, how: Retirement) {
        self.substructure.retire(how);
    }

    /// True of a specimen that need not answer the last words.
    #[must_use]
    pub fn is_left_unasked(&self) -> bool {
        self.substructure.has_acknowledged().is_none()
    }

    /// What it answered to the last words beyond a plain goodbye.
    #[must_use]
    pub fn last_words(&self) -> Option<String> {
        self.substructure.last_words()
    }

    /// True of a specimen that should have answered the last words, and did not.
    #[must_use]
    pub fn is_unheard(&self) -> bool {
        self.substructure.has_acknowledged() == Some(false)
    }
}
