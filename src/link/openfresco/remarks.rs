//! Warnings about a client, for the log and the run folder, each once in a session. Its commands show them; the protocol has
//! no message for them.

use std::fmt;

use super::dialect::Role;
use super::host::Tally;
use crate::wire::openfresco::Sizes;

/// A warning about a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Remark {
    /// The client announced no time and has sent this number of commands without a commit.
    NoCommits(u64),
    /// The client went back to the start of its analysis.
    Reset,
}

impl Remark {
    /// Its name in the events of a run folder.
    pub(super) const fn event(self) -> &'static str {
        match self {
            Self::NoCommits(_) => "client_without_commits",
            Self::Reset => "client_reset",
        }
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCommits(commands) => write!(
                f,
                "the client announced no time and has sent {commands} commands without a commit: a computed specimen starts \
                 each of them from its initial state, so it has no history (hysteresis and rate effects are wrong); the client \
                 must send action 5 after each step"
            ),
            Self::Reset => f.write_str(
                "the client went back to displacement 0 at time 0, as OpenSees does on `reset` or `revertToStart`: the protocol \
                 has no message for that, so the specimen keeps its committed state; a computed specimen is in its initial \
                 state again only for a new connection",
            ),
        }
    }
}

/// Commands without a commit after which a client is taken for one that never commits: an iteration takes fewer.
const MANY_COMMANDS: u64 = 10;

/// The warnings of one session.
#[derive(Debug)]
pub(super) struct Remarks {
    /// Nothing but commits tells the steps of this client apart.
    needs_commits: bool,
    has_told_of_commits: bool,
    has_told_of_reset: bool,
}

impl Remarks {
    pub(super) fn of(role: Role, sizes: &Sizes) -> Self {
        Self {
            // GenericTCP never commits: there each target accepts the one before.
            needs_commits: role != Role::Controller && sizes.ctrl().time == 0,
            has_told_of_commits: false,
            has_told_of_reset: false,
        }
    }

    /// The warning that is due after some commands. Real-time: yes.
    pub(super) fn after(&mut self, tally: Tally) -> Option<Remark> {
        self.commits(tally, MANY_COMMANDS)
    }

    /// The warning that is due when the session ends: no commit can follow.
    pub(super) fn at_end(&mut self, tally: Tally) -> Option<Remark> {
        self.commits(tally, 2)
    }

    fn commits(&mut self, tally: Tally, least: u64) -> Option<Remark> {
        let is_due = self.needs_commits
            && !self.has_told_of_commits
            && tally.commits == 0
            && tally.commands >= least;
        self.has_told_of_commits |= is_due;
        is_due.then_some(Remark::NoCommits(tally.commands))
    }

    /// The client went back to the start. Real-time: yes.
    pub(super) fn reset(&mut self) -> Option<Remark> {
        let is_due = !std::mem::replace(&mut self.has_told_of_reset, true);
        is_due.then_some(Remark::Reset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::openfresco::Counts;

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
    fn missing_commits_are_told_once_and_only_of_a_client_without_a_time() {
        let mut timeless = remarks(Role::Application, 0);
        assert_eq!(timeless.after(tally(9, 0)), None);
        assert_eq!(timeless.after(tally(10, 0)), Some(Remark::NoCommits(10)));
        assert_eq!(timeless.after(tally(11, 0)), None);
        assert_eq!(timeless.at_end(tally(11, 0)), None);
        assert_eq!(remarks(Role::Application, 0).at_end(tally(1, 0)), None);
        let short = remarks(Role::Application, 0).at_end(tally(2, 0));
        assert_eq!(short, Some(Remark::NoCommits(2)));
        assert_eq!(remarks(Role::Application, 0).at_end(tally(50, 1)), None);
        for (role, time) in [(Role::Application, 1), (Role::Controller, 0)] {
            assert_eq!(remarks(role, time).at_end(tally(50, 0)), None);
        }
    }

    #[test]
    fn a_reset_is_told_once() {
        let mut remarks = remarks(Role::Application, 1);
        assert_eq!(remarks.reset(), Some(Remark::Reset));
        assert_eq!(remarks.reset(), None);
    }
}
