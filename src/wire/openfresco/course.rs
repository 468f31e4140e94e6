//! What a new command means: the next step, another try, or a step that is taken back.
//!
//! The protocol says none of this; it follows from displacement and time of the commands and from the commits
//! (section 5.7 of the protocol notes, all of it observed with OpenSees and OpenFresco). The judgement is pure;
//! what a specimen does about it (a formula reverts, an actuator refuses and stops safely) is the host's.

use super::vector::{Signals, same_bits};

/// What a command means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Course {
    /// The first command of the connection. OpenSees' `genericClient` sends zeros when the element is created.
    First,
    /// The first try of a new step.
    Step,
    /// Another try of the same step.
    Iteration,
    /// All bits as the command before: nothing new.
    Repeat,
    /// The client gives the step up: it is back at the last commit, in time and displacement, and will go on
    /// from there with another step length.
    TakenBack,
    /// Time runs backwards past the last commit in the middle of a step. Nothing can be taken back so far.
    Reversed,
    /// Time begins anew after a commit: OpenSees' `loadConst -time 0` between a gravity and a transient analysis
    /// does this. Nothing is wrong, but the length of this step is not known.
    NewOrigin,
}

/// Follows commands and commits of one connection.
#[derive(Debug)]
pub(super) struct Tracker {
    /// In dialect D nobody commits: a new target accepts the one before.
    implicit: bool,
    /// Commands since the set-up.
    commands: u64,
    /// Commands since the last commit.
    trials: u32,
    /// Time of the last commit, if it is known. A connection begins at 0.
    base: Option<f64>,
    committed_disp: Vec<f64>,
    /// The last command was at the last commit: the opening zeros, or a step taken back.
    at_base: bool,
}

impl Tracker {
    pub(super) fn new(axes: usize, implicit: bool) -> Self {
        Self {
            implicit,
            commands: 0,
            trials: 0,
            base: Some(0.0),
            committed_disp: vec![0.0; axes],
            at_base: true,
        }
    }

    /// Judges `new` against `last`, the command before. Real-time: yes.
    pub(super) fn judge(&mut self, new: &Signals, last: &Signals) -> Course {
        let first = self.commands == 0;
        self.commands = self.commands.saturating_add(1);
        if first {
            self.trials = 1;
            self.at_base = match new.time() {
                Some(time) => time == 0.0,
                None => same_bits(new.response().disp, &self.committed_disp),
            };
            return Course::First;
        }
        if new.same_bits(last) {
            self.trials = self.trials.saturating_add(1);
            return Course::Repeat;
        }
        if self.implicit && self.trials > 0 {
            self.commit(last, last.time());
        }
        let course = self.compare(new, last);
        if course == Course::NewOrigin {
            self.base = None;
        }
        self.at_base = course == Course::TakenBack;
        self.trials = self.trials.saturating_add(1);
        course
    }

    fn compare(&self, new: &Signals, last: &Signals) -> Course {
        let disp = new.response().disp;
        if let (Some(time), Some(last_time), Some(base)) = (new.time(), last.time(), self.base) {
            if time < base {
                return if self.trials == 0 {
                    Course::NewOrigin
                } else {
                    Course::Reversed
                };
            }
            if self.trials > 0 && time == base && last_time > base {
                return Course::TakenBack;
            }
        } else {
            // Without a time only the displacement tells. An iteration that comes back to the very bits of the
            // committed displacement is not to be expected.
            let back = same_bits(disp, &self.committed_disp);
            let away = !same_bits(last.response().disp, &self.committed_disp);
            if self.trials > 0 && back && away {
                return Course::TakenBack;
            }
        }
        if self.trials == 0 || self.at_base {
            Course::Step
        } else {
            Course::Iteration
        }
    }

    /// The last command is accepted at `time`, if there is one. Returns how many commands came since the last
    /// commit. Real-time: yes.
    pub(super) fn commit(&mut self, last: &Signals, time: Option<f64>) -> u32 {
        self.base = time;
        for (kept, new) in self.committed_disp.iter_mut().zip(last.response().disp) {
            *kept = *new;
        }
        std::mem::take(&mut self.trials)
    }

    /// Test time from the last commit to `trial`, if both are known. Real-time: yes.
    pub(super) fn dt(&self, trial: &Signals) -> Option<f64> {
        Some(trial.time()? - self.base?)
    }
}
