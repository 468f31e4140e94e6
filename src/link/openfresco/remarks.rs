//! Warnings about a client, for the log and the run folder, each once in a session. Its commands show them; the protocol has
//! no message for them.

use super::role::{Nature, Role};
use super::tally::Tally;
use gusset_quantity::catalog::event as catalog;
use gusset_wire::openfresco::Sizes;

/// A warning about a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Remark {
    /// The client has sent this number of commands without a commit. Iterations of a step count only if no time separates
    /// them from steps.
    NoCommits(u64),
    /// The client returned to the start of its analysis.
    Reset,
}

impl Remark {
    /// Its name in the events of a run folder.
    pub(super) const fn event(self) -> catalog::Remark {
        match self {
            Self::NoCommits(_) => catalog::Remark::ClientWithoutCommits,
            Self::Reset => catalog::Remark::ClientReset,
        }
    }

    /// The consequence for a specimen of this nature.
    pub(super) fn text(self, nature: Nature) -> String {
        match self {
            Self::NoCommits(commands) => {
                let follows = match nature {
                    Nature::Simulated => {
                        "the computed specimen starts each of them from its initial state, so it has no history (hysteresis and \
                         rate effects are wrong)"
                    }
                    Nature::Physical => {
                        "no step is ever accepted, so a step that the client takes back cannot be recognised"
                    }
                };
                format!(
                    "the client has sent {commands} commands without a commit: {follows}; the client must send action 5 after each \
                     step"
                )
            }
            Self::Reset => {
                let follows = match nature {
                    Nature::Simulated => {
                        "the computed specimen keeps its committed state, and is in its initial state again only for a new \
                         connection"
                    }
                    Nature::Physical => "the specimen keeps what the test has done to it",
                };
                format!(
                    "the client went back to displacement 0 at time 0, as OpenSees does on `reset` or `revertToStart`: the protocol \
                     has no message for that; {follows}"
                )
            }
        }
    }
}

/// Commands without a commit after which a client is taken for one that never commits: an iteration takes fewer.
const MANY_COMMANDS: u64 = 10;

/// The warnings of one session.
#[derive(Debug)]
pub(crate) struct Remarks {
    /// The protocol of this client has commits.
    has_commits: bool,
    /// The client sends the time, so iterations do not count.
    sends_time: bool,
    has_told_of_commits: bool,
    has_told_of_reset: bool,
}

impl Remarks {
    pub(crate) fn of(role: Role, sizes: &Sizes) -> Self {
        Self {
            // GenericTCP never commits: there each target accepts the one before.
            has_commits: role != Role::Controller,
            sends_time: sizes.ctrl().time > 0,
            has_told_of_commits: false,
            has_told_of_reset: false,
        }
    }

    /// The warning that is due after some commands. Real-time: yes.
    pub(crate) fn after(&mut self, tally: Tally) -> Option<Remark> {
        self.commits(tally, MANY_COMMANDS)
    }

    /// The warning that is due when the session ends: no commit can follow.
    pub(crate) fn at_end(&mut self, tally: Tally) -> Option<Remark> {
        self.commits(tally, 2)
    }

    fn commits(&mut self, tally: Tally, least: u64) -> Option<Remark> {
        // A client that holds its command, as before a test begins, makes no history.
        let fresh = tally.commands.saturating_sub(tally.repeats);
        let commands = match (self.sends_time, tally.later_times) {
            (false, _) => fresh,
            // A time that is always 0 separates steps from iterations no better than no time.
            (true, 0) if fresh >= MANY_COMMANDS => fresh,
            (true, later_times) => later_times,
        };
        let is_due = self.has_commits
            && !self.has_told_of_commits
            && tally.commits == 0
            && commands >= least;
        self.has_told_of_commits |= is_due;
        is_due.then_some(Remark::NoCommits(commands))
    }

    /// The client returned to the start. Real-time: yes.
    pub(crate) fn reset(&mut self) -> Option<Remark> {
        let is_due = !std::mem::replace(&mut self.has_told_of_reset, true);
        is_due.then_some(Remark::Reset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_wire::openfresco::Counts;

    fn remarks(role: Role, time: usize) -> Remarks {
        let counts = Counts::new(1, 0, 0, 0, time);
        let sizes = Sizes::new(counts, Counts::new(0, 0, 0, 1, 0), 3).unwrap();
        Remarks::of(role, &sizes)
    }

    fn tally(commands: u64, commits: u64) -> Tally {
        Tally {
            commands,
            commits,
            ..Tally::default()
        }
    }

    #[test]
    fn missing_commits_are_reported_once() {
        let mut timeless = remarks(Role::Application, 0);
        assert_eq!(timeless.after(tally(9, 0)), None);
        assert_eq!(timeless.after(tally(10, 0)), Some(Remark::NoCommits(10)));
        assert_eq!(timeless.after(tally(11, 0)), None);
        assert_eq!(timeless.at_end(tally(11, 0)), None);
        assert_eq!(remarks(Role::Application, 0).at_end(tally(1, 0)), None);
        let short = remarks(Role::Application, 0).at_end(tally(2, 0));
        assert_eq!(short, Some(Remark::NoCommits(2)));
        assert_eq!(remarks(Role::Application, 0).at_end(tally(50, 1)), None);
        let rising = Tally {
            later_times: 50,
            ..tally(50, 0)
        };
        for time in [0, 1] {
            assert_eq!(remarks(Role::Controller, time).at_end(rising), None);
        }
    }

    #[test]
    fn iterations_with_a_time_do_not_count() {
        for role in [Role::Application, Role::Actor, Role::Simulink] {
            let mut timed = remarks(role, 1);
            let at = |later_times| Tally {
                later_times,
                ..tally(60, 0)
            };
            assert_eq!(timed.after(at(9)), None);
            assert_eq!(timed.after(at(10)), Some(Remark::NoCommits(10)));
            assert_eq!(timed.at_end(at(10)), None);
            assert_eq!(remarks(role, 1).at_end(at(1)), None);
            // The time is always 0.
            assert_eq!(remarks(role, 1).at_end(tally(9, 0)), None);
            let still = remarks(role, 1).after(tally(10, 0));
            assert_eq!(still, Some(Remark::NoCommits(10)));
            assert_eq!(remarks(role, 1).at_end(at(2)), Some(Remark::NoCommits(2)));
        }
    }

    #[test]
    fn repeated_commands_do_not_count() {
        for time in [0, 1] {
            let held = |repeats| Tally {
                repeats,
                ..tally(50, 0)
            };
            assert_eq!(remarks(Role::Application, time).after(held(41)), None);
            let moved = remarks(Role::Application, time).after(held(40));
            assert_eq!(moved, Some(Remark::NoCommits(10)));
        }
    }

    #[test]
    fn only_a_computed_specimen_restarts() {
        for remark in [Remark::NoCommits(10), Remark::Reset] {
            assert!(remark.text(Nature::Simulated).contains("initial state"));
            assert!(!remark.text(Nature::Physical).contains("initial state"));
        }
    }

    #[test]
    fn reset_is_reported_once() {
        let mut remarks = remarks(Role::Application, 1);
        assert_eq!(remarks.reset(), Some(Remark::Reset));
        assert_eq!(remarks.reset(), None);
    }
}
