//! The command that waits for a specimen behind a link, with the notices of a hold or a stop around it.
//!
//! Such a specimen gets the newest command that came while it was busy, never a burst. A notice that follows the waiting
//! command must reach the specimen after it, because a command ends a hold.

use gusset_wire::native::Cause;

/// A command that has come and was not passed on yet. Its vectors are the next ones of the command in force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WaitingCommand {
    pub sequence: u64,
    /// Test time, s.
    pub time: f64,
    /// Test time of its step, s.
    pub dt: f64,
}

/// Commands that a client of paced targets may have sent after the last answer: the present one, and one more, because a client
/// in real time does not wait for a late answer.
const MOST_UNANSWERED: u32 = 2;

/// The newest waiting command.
#[derive(Debug, Default)]
pub(super) struct Backlog {
    command: Option<WaitingCommand>,
    /// Commands that came after the last answer.
    unanswered: u32,
    /// A hold or a stop that came after that command.
    hold_follows: Option<Cause>,
    /// A stop came between that command and the one before, which was never passed on.
    halt_precedes: bool,
}

impl Backlog {
    /// Number of the waiting command.
    pub(crate) fn sequence(&self) -> Option<u64> {
        self.command.map(|command| command.sequence)
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.command.is_none()
    }

    /// A newer command takes the place of the one that waits.
    pub(crate) fn put(&mut self, command: WaitingCommand) {
        self.command = Some(command);
        self.unanswered = self.unanswered.saturating_add(1);
        let followed = self.hold_follows.take();
        self.halt_precedes |= followed.is_some_and(|cause| cause != Cause::Operator);
    }

    /// The command in force was answered.
    pub(crate) fn answered(&mut self) {
        self.unanswered = u32::from(self.command.is_some());
    }

    /// True if the client is more than one command ahead of the one that it must wait for.
    pub(crate) const fn is_too_far_ahead(&self) -> bool {
        self.unanswered > MOST_UNANSWERED
    }

    /// A notice of a hold or a stop. A stop stays one, whatever comes late.
    pub(crate) fn follow(&mut self, cause: Cause) {
        match cause {
            Cause::Operator => {
                self.hold_follows.get_or_insert(cause);
            }
            cause => self.hold_follows = Some(cause),
        }
    }

    /// The command to pass on now; with it, whether a stop comes first.
    pub(crate) fn take(&mut self) -> Option<(WaitingCommand, bool)> {
        let command = self.command.take()?;
        Some((command, std::mem::take(&mut self.halt_precedes)))
    }

    /// The notice that follows the command that was passed on.
    pub(crate) fn take_notice(&mut self) -> Option<Cause> {
        self.hold_follows.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(sequence: u64) -> WaitingCommand {
        WaitingCommand {
            sequence,
            time: 0.0,
            dt: 0.0,
        }
    }

    #[test]
    fn stop_precedes_the_newer_command() {
        let mut backlog = Backlog::default();
        backlog.put(command(1));
        backlog.follow(Cause::Tripped);
        // A hold that comes late does not take the stop back.
        backlog.follow(Cause::Operator);
        backlog.put(command(2));
        assert_eq!(backlog.take(), Some((command(2), true)));
        assert_eq!(backlog.take_notice(), None);
        backlog.put(command(3));
        backlog.follow(Cause::Operator);
        assert_eq!(backlog.take(), Some((command(3), false)));
        assert_eq!(backlog.take_notice(), Some(Cause::Operator));
        assert!(backlog.is_empty());
    }
}
