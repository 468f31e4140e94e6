//! Meaning of a new command: the next step, another iteration, or a step that is taken back.
//!
//! The protocol does not state it; it follows from displacement and time of the commands and from the commits
//! (section 5.7 of the protocol notes, all of it observed with OpenSees and OpenFresco). The decision is a pure
//! function; the host decides how a specimen reacts (a simulated one reverts, an actuator refuses and stops safely).

use super::vector::{Signals, same_bits};

/// Meaning of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Course {
    /// The first command of the connection. OpenSees' `genericClient` sends zeros when the element is created.
    First,
    /// The first try of a new step.
    Step,
    /// Another iteration of this step.
    Iteration,
    /// All bits equal those of the command before, and no time has passed: nothing new.
    Repeat,
    /// The client gives the step up: it is back at the last commit, and will continue from there with another step
    /// length.
    TakenBack,
    /// In the middle of a step, time and motion run backwards past the last commit, to another place than that.
    Reversed,
    /// Time restarts after a commit: OpenSees' `loadConst -time 0` between a gravity and a transient analysis does
    /// this. Nothing is wrong, but the length of this step is not known.
    NewOrigin,
}

/// OpenFresco's elements do not send a displacement again that has changed by no more than this.
const UNSENT: f64 = f64::EPSILON;

/// Follows commands and commits of one connection.
#[derive(Debug)]
pub(super) struct Tracker {
    /// Dialect D has no commits: a new target of another time accepts the one before.
    implicit: bool,
    /// Commands since the set-up.
    commands: u64,
    /// Commands since the last commit.
    trials: u32,
    /// A commit has come.
    has_committed: bool,
    /// Time of the last commit, if it is known, as the client counts: schemes that evaluate between or beyond two
    /// steps commit at that time, and say the true one when they come back. A connection begins at 0.
    base: Option<f64>,
    /// Time has restarted since: it is later than `base`, whatever its value.
    has_restarted: bool,
    committed_disp: Vec<f64>,
    /// A commit at a time beyond 0 had a displacement other than 0.
    has_left_start: bool,
    /// A command since the last commit was elsewhere: there is something to take back.
    away: bool,
    /// The last command was at the last commit: the opening zeros, or a step taken back.
    at_base: bool,
}

impl Tracker {
    pub(super) fn new(axes: usize, implicit: bool) -> Self {
        Self {
            implicit,
            commands: 0,
            trials: 0,
            has_committed: false,
            base: Some(0.0),
            has_restarted: false,
            committed_disp: vec![0.0; axes],
            has_left_start: false,
            away: false,
            at_base: true,
        }
    }

    /// Judges `new` against `last`, the command before. Real-time: yes.
    pub(super) fn judge(&mut self, new: &Signals, last: &Signals) -> Course {
        let first = self.commands == 0;
        self.commands = self.commands.saturating_add(1);
        if first {
            self.trials = 1;
            self.away = !self.is_home(new);
            self.at_base = match new.time() {
                Some(time) => time == 0.0,
                None => !self.away,
            };
            return Course::First;
        }
        if new.same_bits(last) && self.says_nothing_new(new) {
            if self.trials > 0 {
                self.trials = self.trials.saturating_add(1);
            }
            return Course::Repeat;
        }
        // A command with an unchanged test time is another iteration.
        let is_same_time = new.time().is_some_and(|time| time != 0.0) && new.time() == last.time();
        if self.implicit && self.trials > 0 && !is_same_time {
            self.commit(last, last.time());
        }
        let home = self.is_home(new);
        let course = self.compare(new, last, home);
        let back = match course {
            Course::TakenBack | Course::Reversed => true,
            // The client has only given up a look ahead from its present position.
            _ => self.trials > 0 && home && self.turns_back(new, last),
        };
        if back {
            self.base = new.time();
        }
        self.has_restarted = (self.has_restarted || course == Course::NewOrigin) && !back;
        self.away = (self.away && !back) || !home;
        self.at_base = back;
        self.trials = self.trials.saturating_add(1);
        course
    }

    /// Whether a repeated command may be ignored. With a client that sends no time and holds its command, only the
    /// commit shows that time continues; at an unchanged test time nothing is new.
    fn says_nothing_new(&self, new: &Signals) -> bool {
        new.time().is_some() || (self.trials > 0 && !self.implicit)
    }

    fn compare(&self, new: &Signals, last: &Signals, home: bool) -> Course {
        let earlier = |time: Option<f64>| {
            let times = new.time().zip(time);
            times.is_some_and(|(new, other)| new < other)
        };
        if self.trials == 0 {
            return if earlier(self.base) {
                Course::NewOrigin
            } else {
                Course::Step
            };
        }
        if home && self.away && self.turns_back(new, last) {
            return Course::TakenBack;
        }
        // In a static analysis under displacement control "time" is a load factor, which may fall. It is time only
        // where velocities change with it.
        if earlier(last.time()) && !self.has_restarted && moves(new, last) {
            if earlier(self.base) {
                return Course::Reversed;
            }
            if new.time() == self.base {
                return Course::TakenBack;
            }
        }
        if self.at_base {
            Course::Step
        } else {
            Course::Iteration
        }
    }

    /// True if time moves as it never does in a continuing step. A step that its load factor leads may come back to
    /// that of the last commit from below. Without a time only the displacement decides: an iteration that comes back
    /// to that of the last commit is not expected. A client that has never committed has no step to take back.
    fn turns_back(&self, new: &Signals, last: &Signals) -> bool {
        match (new.time(), last.time()) {
            (Some(time), Some(last)) => time < last || (time != last && self.base == Some(time)),
            _ => self.has_committed,
        }
    }

    /// True if `new`, before it is classified, goes back to the start of the client's analysis after a commit: OpenSees sends
    /// zeros at time 0 then. A step that is taken back to that start does not count, nor does a client whose commits never left
    /// it. Real-time: yes.
    pub(super) fn is_reset(&self, new: &Signals) -> bool {
        let is_start = new.time().is_some() && new.values().iter().all(|value| *value == 0.0);
        let has_time_passed = !self.has_restarted && self.base.is_some_and(|base| base > 0.0);
        self.has_left_start && is_start && (has_time_passed || !self.is_home(new))
    }

    /// True for the displacement of the last commit.
    fn is_home(&self, new: &Signals) -> bool {
        let disp = new.response().disp.iter();
        disp.zip(&self.committed_disp)
            .all(|(new, committed)| (new - committed).abs() <= UNSENT)
    }

    /// The last command is accepted at `time`, if there is one. Matlab's elements commit with zeros behind the action: a time
    /// before that of the command is ignored, and the time of the command holds. Returns how many commands came since the last
    /// commit. Real-time: yes.
    pub(super) fn commit(&mut self, last: &Signals, time: Option<f64>) -> u32 {
        self.base = match (time, last.time()) {
            (Some(told), Some(of_command)) if told < of_command => {
                if self.trials > 0 {
                    Some(of_command)
                } else {
                    self.base
                }
            }
            _ => time,
        };
        self.has_restarted = false;
        self.away = false;
        self.has_committed = true;
        for (kept, new) in self.committed_disp.iter_mut().zip(last.response().disp) {
            *kept = *new;
        }
        let has_time_passed = self.base.is_some_and(|base| base > 0.0);
        let is_away = self.committed_disp.iter().any(|disp| *disp != 0.0);
        self.has_left_start |= has_time_passed && is_away;
        std::mem::take(&mut self.trials)
    }

    /// Test time from the last commit to `trial`, if both are known. Real-time: yes.
    pub(super) fn dt(&self, trial: &Signals) -> Option<f64> {
        let base = self.base.filter(|_| !self.has_restarted)?;
        Some(trial.time()? - base)
    }
}

/// True if velocities or accelerations have changed.
fn moves(new: &Signals, last: &Signals) -> bool {
    let (new, last) = (new.response(), last.response());
    !(same_bits(new.vel, last.vel) && same_bits(new.accel, last.accel))
}
