//! How a port is led from one target to the next: the way of its command, the reading that belongs to a target, and the
//! numbers on the link of a partner that is commanded once a step.
//!
//! A specimen is commanded at every tick, along a [`Path`]; or, if it is slow, once a step: it is told its target as soon as
//! that is known, and has the time in which the others go there for its answer.

use super::path::Path;
use super::{Order, Port, Stride};
use crate::substructure::{Coupling, LinkFault, Status};

/// What a port keeps of its way.
#[derive(Debug)]
pub(super) struct Pursuit {
    path: Path,
    goal: Vec<f64>,
    goal_vel: Vec<f64>,
    /// Target, measured displacement and force of the tick in which the target was reached.
    kept: [Vec<f64>; 3],
    /// The last command of an interrupted test.
    returns: Vec<f64>,
    /// A way out led it away from there, and it may not be able to say so.
    pub led_away: bool,
    per_step: bool,
    /// The target has not been sent yet.
    waits: bool,
    /// It was, and is not answered.
    asked: bool,
    /// Number in the test of the command that was sent last.
    sent: u64,
    /// What was added to it for the link, and what taken off.
    shift: (u64, u64),
    /// Ticks without a command: by so much the numbers on the link are behind the test's.
    skipped: u64,
}

impl Pursuit {
    pub fn new(axes: usize) -> Self {
        Self {
            path: Path::new(axes, Order::default()),
            goal: vec![0.0; axes],
            goal_vel: vec![0.0; axes],
            kept: [vec![0.0; axes], vec![0.0; axes], vec![0.0; axes]],
            returns: Vec::new(),
            led_away: false,
            per_step: false,
            waits: false,
            asked: false,
            sent: 0,
            shift: (0, 0),
            skipped: 0,
        }
    }

    /// The number on the link of a command that leaves now. Real-time: yes.
    #[inline]
    pub fn number(&mut self, sequence: u64, ahead: u64) -> u64 {
        self.sent = sequence;
        self.shift = (ahead, self.skipped);
        self.on_link(sequence)
    }

    /// The number on the link of the first of many commands.
    pub fn first_number(&self, sequence: u64, ahead: u64) -> u64 {
        (sequence + ahead).saturating_sub(self.skipped)
    }

    /// A number of the test on the link, as of the last command. Real-time: yes.
    #[inline]
    pub fn on_link(&self, sequence: u64) -> u64 {
        (sequence + self.shift.0).saturating_sub(self.shift.1)
    }

    /// A number on the link in the test, as of the last command. Real-time: yes.
    #[inline]
    pub fn in_test(&self, number: u64) -> u64 {
        (number + self.shift.1).saturating_sub(self.shift.0)
    }

    /// Where an axis is at a point of the way beyond now, and a whole step after the last target, if the next is known, the
    /// integrator's own velocity there in m/s. Real-time: yes.
    pub fn point(&self, axis: usize, share: f64, whole: bool) -> (f64, Option<f64>) {
        let goal = self.goal.get(axis).zip(self.goal_vel.get(axis));
        match goal {
            Some((goal, vel)) if whole && self.path.is_known() => (*goal, Some(*vel)),
            _ => (self.path.at(axis, share).disp, None),
        }
    }

    /// The number of the command that `sequence` accepts: its own, if it was told its target some ticks ago. Real-time: yes.
    #[inline]
    pub fn accepts(&self, sequence: u64) -> u64 {
        if self.per_step { self.sent } else { sequence }
    }
}

impl Port {
    /// Commands it once a step, and lets it take several ticks for its answer; predicts the way of the others with `order`.
    #[must_use]
    pub fn with_pace(mut self, per_step: bool, order: Order) -> Self {
        self.pursuit.per_step = per_step;
        self.pursuit.path.set_order(order);
        self
    }

    /// True if it is commanded once a step.
    #[inline]
    #[must_use]
    pub const fn is_per_step(&self) -> bool {
        self.pursuit.per_step
    }

    /// The way of its command.
    #[must_use]
    pub const fn path(&self) -> &Path {
        &self.pursuit.path
    }

    /// The command that stands ready is the first target; everything has rested there.
    pub fn begin_way(&mut self) {
        self.pursuit.goal.copy_from_slice(&self.target);
        self.pursuit.goal_vel.copy_from_slice(&self.target_vel);
        self.pursuit.path.rest(&self.target);
        self.pursuit.waits = self.pursuit.per_step;
        self.pursuit.asked = false;
        self.guard.aims_from(&self.axes, &self.pursuit.goal);
    }

    /// The target of the next step, from the structure's state. Real-time: yes.
    #[inline]
    pub fn seek(&mut self, disp: &[f64], vel: &[f64], base_disp: f64, base_vel: f64) {
        let (goal, goal_vel) = (&mut self.pursuit.goal, &mut self.pursuit.goal_vel);
        if let Some(posed) = &mut self.posed {
            posed.seek([disp, vel], [base_disp, base_vel], goal, goal_vel);
            return;
        }
        let goals = goal.iter_mut().zip(goal_vel);
        for (axis, (goal, goal_vel)) in self.axes.iter().zip(goals) {
            (*goal, *goal_vel) = axis.dots([disp, vel], [base_disp, base_vel]);
        }
    }

    /// The same from prescribed deformations. Real-time: yes.
    pub fn seek_at(&mut self, along: &mut impl Iterator<Item = (f64, f64)>) {
        let (goal, goal_vel) = (&mut self.pursuit.goal, &mut self.pursuit.goal_vel);
        if let Some(posed) = &mut self.posed {
            posed.seek_at(along, goal, goal_vel);
            return;
        }
        let goals = goal.iter_mut().zip(goal_vel);
        for ((goal, goal_vel), (disp, vel)) in goals.zip(along) {
            *goal = disp;
            *goal_vel = vel;
        }
    }

    /// The next target is known from here on, `share` of the step after the last. Real-time: yes.
    #[inline]
    pub fn know(&mut self, share: f64) {
        self.pursuit.path.aim(&self.pursuit.goal, share);
        self.guard.aims_at(&self.axes, &self.pursuit.goal);
        if self.pursuit.per_step {
            self.pursuit.waits = true;
            self.land();
            self.prepare_command();
        } else {
            self.amend_compensation();
        }
    }

    /// The command reaches its target in this tick: from here on the next is sought. Real-time: yes.
    #[inline]
    pub fn reach(&mut self) {
        self.pursuit.path.reach();
        self.begin_grid();
    }

    #[inline]
    fn land(&mut self) {
        let goals = self.pursuit.goal.iter().zip(&self.pursuit.goal_vel);
        let targets = self.target.iter_mut().zip(&mut self.target_vel);
        for ((target, target_vel), (goal, goal_vel)) in targets.zip(goals) {
            (*target, *target_vel) = (*goal, *goal_vel);
        }
        self.tracking.is_published();
    }

    /// Makes the command at the end of a stride, with steps of `dt` seconds of test time. Real-time: yes.
    #[inline]
    pub fn ride(&mut self, stride: &Stride, dt: f64) {
        if self.pursuit.per_step {
            return;
        }
        if stride.lands() && stride.length >= 1.0 {
            // A whole step in one tick: the integrator's own velocity belongs to it.
            self.land();
        } else {
            let axes = self.target.iter_mut().zip(&mut self.target_vel);
            for (axis, (target, target_vel)) in axes.enumerate() {
                let point = self.pursuit.path.at(axis, stride.share);
                *target = point.disp;
                *target_vel = point.slope / dt;
            }
            self.tracking.is_on_the_way();
        }
        self.command_the_target();
        self.compensate_along(stride);
    }

    /// Keeps what belongs to the target that was just reached, until the slowest partner has answered. Real-time: yes.
    pub fn keep(&mut self) {
        if self.pursuit.per_step {
            return;
        }
        let [target, measured, force] = &mut self.pursuit.kept;
        target.copy_from_slice(&self.target);
        measured.copy_from_slice(&self.measured);
        force.copy_from_slice(&self.force);
    }

    /// Takes what was kept for what enters equilibrium now. Real-time: yes.
    pub fn take_kept(&mut self) {
        if self.pursuit.per_step {
            return;
        }
        let [target, measured, force] = &self.pursuit.kept;
        self.target.copy_from_slice(target);
        self.measured.copy_from_slice(measured);
        self.force.copy_from_slice(force);
    }

    /// True if its target is known and was not sent yet.
    #[inline]
    #[must_use]
    pub const fn wants_to_be_told(&self) -> bool {
        self.pursuit.waits
    }

    /// True if it owes an answer.
    #[inline]
    #[must_use]
    pub const fn is_asked(&self) -> bool {
        self.pursuit.asked
    }

    /// Sends its target, which was judged. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost, or the command was not judged.
    pub fn tell(&mut self, sequence: u64, time: f64, dt: f64) -> Result<(), LinkFault> {
        self.issue(sequence, time, dt)?;
        self.pursuit.waits = false;
        self.pursuit.asked = true;
        Ok(())
    }

    /// A tick without a command of its own. Real-time: yes.
    pub fn skip_command(&mut self) {
        self.pursuit.skipped += u64::from(!self.is_recorded);
    }

    /// True if its answer is here, or comes within `wait_ns` of wall time. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    #[inline]
    pub fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.substructure.is_answered(wait_ns)
    }

    /// True if its answer has to be waited for: it is owed, and comes from outside this process. A recording says whether it
    /// was. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn is_awaited(&self) -> bool {
        (self.is_remote() || self.is_recorded) && self.coupling() == Coupling::Lockstep
    }

    /// Its answer is not waited for any more: its status says so until it comes. Real-time: yes.
    pub fn leave_owing(&mut self) {
        self.raw.status.0 |= Status::OWED.0;
    }

    /// True while it is so.
    #[must_use]
    pub const fn is_left_owing(&self) -> bool {
        self.raw.status.has(Status::OWED)
    }

    /// Whoever owes an answer was asked for it, however often it is commanded.
    pub(super) fn await_what_is_owed(&mut self) {
        self.pursuit.asked |= self.owes();
    }

    /// Its answer was taken. Real-time: yes.
    #[inline]
    pub fn answered(&mut self) {
        self.pursuit.asked = false;
    }

    /// It is told its target once more: what it answered, if it did, is lost.
    pub fn ask_again(&mut self) {
        if self.pursuit.per_step {
            self.guard.interrupt(self.pursuit.asked);
        }
        self.pursuit.waits |= self.pursuit.asked;
        self.pursuit.asked = false;
        // Only now: what it was told in the test is kept.
        if std::mem::take(&mut self.pursuit.led_away) {
            self.guard.stands_at(&self.sent);
        }
    }

    /// True in a test that goes on where an interrupted one stood.
    pub(super) fn goes_on_from_before(&self) -> bool {
        !self.pursuit.returns.is_empty()
    }

    /// Makes the last command of the interrupted test again, at rest.
    pub fn return_to_the_test(&mut self) {
        if self.pursuit.returns.len() == self.command.len() {
            self.command.copy_from_slice(&self.pursuit.returns);
        }
        self.command_vel.fill(0.0);
    }

    /// The test goes on: the target that a partner which is commanded once a step has not been told, or has not answered, is its
    /// command again, and judged by those that it was told before. Everything else makes its next command of the way.
    pub fn take_up_target(&mut self) {
        self.guard.go_on();
        if self.pursuit.waits {
            self.land();
            self.prepare_command();
        }
    }

    /// Takes the live substructure of `fresh`, a port of the same test that was never used, in place of a recording; a formula
    /// stays, with all it remembers. The counts begin anew.
    pub fn go_live(&mut self, fresh: Port) {
        if fresh.is_remote() {
            self.substructure = fresh.substructure;
            self.is_recorded = false;
            self.was_commanded_since();
            self.ahead = 0;
            self.pursuit.skipped = 0;
        }
        // When it was asked, how often it was stale: by the clock of another test.
        self.partner = super::Partner::default();
        self.link = super::LinkCount::default();
        self.pursuit.returns.clone_from(&self.sent);
    }

    /// The operator holds the test. Who is commanded in every tick is told again where it stands, and need not know. Real-time:
    /// yes.
    ///
    /// # Errors
    /// The link is lost.
    pub fn pause(&mut self) -> Result<(), LinkFault> {
        if self.partner.lost || !self.is_per_step() {
            return Ok(());
        }
        self.substructure.pause()
    }

    /// Nothing to command: see [`crate::substructure::Substructure::attend`]. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    pub fn attend(&mut self) -> Result<(), LinkFault> {
        self.substructure.attend()
    }
}
