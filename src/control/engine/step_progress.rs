//! Where the command path stands between two targets.
//!
//! With one tick a step every tick reaches a target. With more, or while a hold ramps in or out, or while a specimen that is
//! commanded once a step owes its reply, there are ticks in between.

use super::tick::Tick;
use crate::port::{PacerTick, Stage, StepPacer};
use gusset_quantity::state;

/// How the integration and the ticks of the controller belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pacing {
    /// Ticks of one step.
    pub ticks_per_step: u32,
    /// Ticks in which a hold comes to rest and the test comes to its pace again; 0: at once.
    pub ease_ticks: u32,
    /// Ticks from one checkpoint to the next, at least.
    pub checkpoint_ticks: u64,
}

impl Default for Pacing {
    /// A step every tick, holds at once, no checkpoints.
    fn default() -> Self {
        Self {
            ticks_per_step: 1,
            ease_ticks: 0,
            checkpoint_ticks: u64::MAX,
        }
    }
}

/// The target of the current step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Target {
    /// The commands are on the way to it.
    Ahead,
    /// The last command is at it.
    Reached,
    /// It was reached some ticks ago, and what was measured there is kept.
    Kept,
}

state! { enum Target { Ahead, Reached, Kept } }

/// The step pacer, and the step whose target is on the way, or reached and not closed.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepProgress {
    pacer: StepPacer,
    /// The pacer before it made the next stride.
    before: StepPacer,
    /// The stride of the next command.
    stride: PacerTick,
    step: u64,
    target: Target,
    /// Ticks since the last step was closed.
    sub_tick: u64,
    /// Ticks since the last checkpoint.
    unchecked: u64,
    stage: Stage,
}

state! {
    StepProgress as "step progress" { pacer, before, stride, step, target, sub_tick, unchecked, stage }
}

impl StepProgress {
    /// The specimens are at the first target.
    pub(crate) fn new(pacing: Pacing) -> Self {
        let mut pacer = StepPacer::new(pacing.ticks_per_step, pacing.ease_ticks);
        pacer.know();
        Self {
            pacer,
            before: pacer,
            stride: PacerTick::none(),
            step: 0,
            target: Target::Ahead,
            sub_tick: 0,
            unchecked: 0,
            stage: Stage::Correct,
        }
    }

    /// The step whose target is on the way, or reached and not closed. Real-time: yes.
    #[inline]
    pub(crate) const fn step(&self) -> u64 {
        self.step
    }

    /// The step pacer. Real-time: yes.
    #[inline]
    pub(crate) const fn pacer(&self) -> &StepPacer {
        &self.pacer
    }

    /// The stride of the next command. Real-time: yes.
    #[inline]
    pub(crate) const fn stride(&self) -> PacerTick {
        self.stride
    }

    /// Rows of a hold count on; the next tick follows them. Real-time: yes.
    pub(crate) const fn set_sub_tick(&mut self, sub_tick: u64) {
        self.sub_tick = sub_tick;
    }

    /// Test time stands, as after a hold.
    pub(crate) fn stand(&mut self) {
        self.pacer.stand();
    }

    /// The next command never left: the pacer goes back to before it was made.
    pub(crate) fn take_back_the_next(&mut self) {
        self.pacer = self.before;
    }

    /// True if the target of the step is reached. Real-time: yes.
    #[inline]
    pub(crate) fn has_reached(&self) -> bool {
        self.target != Target::Ahead
    }

    /// The tick of the next command, with steps of `dt`. Real-time: yes.
    #[inline]
    pub(crate) fn tick(&self, dt: f64) -> Tick {
        let reached = self.has_reached();
        let lands = self.stride.lands() && !reached;
        let last = if reached {
            self.step
        } else {
            self.step.saturating_sub(1)
        };
        let time = if lands {
            self.step as f64 * dt
        } else {
            (last as f64 + self.stride.share) * dt
        };
        let closes_at_best = lands || reached;
        Tick {
            step: if closes_at_best { self.step } else { last },
            sub_tick: self.sub_tick,
            time,
            dt: self.stride.length * dt,
        }
    }

    /// The command has left. Returns true if it reaches the target in this tick. Real-time: yes.
    #[inline]
    pub(crate) fn arrive(&mut self) -> bool {
        if self.has_reached() || !self.stride.lands() {
            return false;
        }
        self.target = Target::Reached;
        self.pacer.begin();
        true
    }

    /// The step is not closed in this tick. Returns true if what was measured at its target must be kept. Real-time: yes.
    #[inline]
    pub(crate) fn keep(&mut self) -> bool {
        let first = self.target == Target::Reached;
        if first {
            self.target = Target::Kept;
        }
        first
    }

    /// True if what was measured at the target was kept some ticks ago. Real-time: yes.
    #[inline]
    pub(crate) fn is_kept(&self) -> bool {
        self.target == Target::Kept
    }

    /// The next target is known. Returns where on the way to it. Real-time: yes.
    #[inline]
    pub(crate) fn know_the_next(&mut self) -> f64 {
        self.step += 1;
        self.target = Target::Ahead;
        self.sub_tick = 0;
        let share = self.pacer.share();
        self.pacer.know();
        share
    }

    /// True if the last of `steps` is reached and not closed: a reply is owed, and there is no further target. Real-time: yes.
    #[inline]
    pub(crate) fn is_at_the_end(&self, steps: u64) -> bool {
        self.has_reached() && self.step >= steps
    }

    /// Makes the next stride; `held`: the operator wants a hold. Returns it, or none if nothing moves. Real-time: yes.
    #[inline]
    pub(crate) fn next(&mut self, held: bool, steps: u64) -> Option<PacerTick> {
        self.before = self.pacer;
        self.sub_tick += 1;
        let at_the_end = self.is_at_the_end(steps);
        if at_the_end {
            self.pacer.stand();
        }
        let holds = held || at_the_end;
        self.stride = self.pacer.next(holds);
        if holds && self.pacer.stands() {
            None
        } else {
            Some(self.stride)
        }
    }

    /// The stage of the stride that has left; the one before if the change is an event. Real-time: yes.
    #[inline]
    pub(crate) fn change_stage(&mut self, stage: Stage) -> Option<Stage> {
        let slow = |stage| stage == Stage::SlowDown;
        let before = std::mem::replace(&mut self.stage, stage);
        (slow(stage) != slow(before)).then_some(before)
    }

    /// Counts a tick for the next checkpoint. Real-time: yes.
    #[inline]
    pub(crate) const fn count_tick(&mut self) {
        self.unchecked += 1;
    }

    /// True if a checkpoint is due after this number of ticks; the count restarts. Real-time: yes.
    #[inline]
    pub(crate) const fn is_checkpoint(&mut self, ticks: u64) -> bool {
        let due = self.unchecked >= ticks;
        if due {
            self.unchecked = 0;
        }
        due
    }
}
