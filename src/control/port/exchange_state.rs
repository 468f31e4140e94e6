//! The state of an exchange: what the loop and its partner owe each other.
//!
//! A partner of whole steps goes from `Pending` (its target is known) to `Awaiting` (the target was sent) to `Idle` (it has answered).
//! Every other command goes from `Idle` to `Awaiting` and back within one tick; before the test a pending target waits behind it. An
//! answer that is owed when the test ends is `Overdue`: the partner gets no command before the tick after it has come. A partner that
//! is `Lost` is not commanded any more. Invariant: a lost partner becomes commanded again only when a live one takes over.

use gusset_quantity::state::{Stateful, Visit};
use gusset_quantity::time::Nanos;

/// Why a partner is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Loss {
    /// The loop does not command it any more; its link may live.
    Distrusted,
    /// Its link is gone: nothing is known of it.
    Gone,
}

/// The part of a step that a partner of whole steps still needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Due {
    Nothing,
    /// Its target, which was not sent.
    Target,
    /// Its answer: the target was sent.
    Answer,
}

/// State of an exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ExchangeState {
    /// Nothing is owed.
    Idle,
    /// The target of the step is known and was not sent.
    Pending,
    /// A command has left, and its answer was not taken.
    Awaiting {
        /// When the loop first looked for the answer; none before.
        since: Option<Nanos>,
        /// The target of the step is still to be sent after the answer: the command was not that target.
        target_follows: bool,
    },
    /// The test has ended before the answer was here.
    Overdue {
        /// As in [`ExchangeState::Awaiting`].
        since: Option<Nanos>,
    },
    /// The overdue answer came in this tick.
    Answered,
    /// The partner is not commanded any more.
    Lost {
        cause: Loss,
        /// Owed at that time: a test that is resumed sends the target again.
        owed: Due,
    },
}

/// A state is taken when no answer is owed: a target may be pending.
impl Stateful for ExchangeState {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let mut is_pending = match self {
            Self::Idle => false,
            Self::Pending => true,
            Self::Awaiting { .. } | Self::Overdue { .. } | Self::Answered | Self::Lost { .. } => {
                visit.refuse();
                false
            }
        };
        visit.flag(&mut is_pending);
        if visit.restores() {
            *self = if is_pending {
                Self::Pending
            } else {
                Self::Idle
            };
        }
    }
}

impl ExchangeState {
    const fn owed(self) -> Due {
        match self {
            Self::Idle | Self::Answered => Due::Nothing,
            Self::Pending
            | Self::Awaiting {
                target_follows: true,
                ..
            } => Due::Target,
            Self::Awaiting { .. } | Self::Overdue { .. } => Due::Answer,
            Self::Lost { owed, .. } => owed,
        }
    }

    /// A command has left. Real-time: yes.
    #[inline]
    pub(crate) fn sent(&mut self) {
        *self = Self::Awaiting {
            since: None,
            target_follows: self.owed() == Due::Target,
        };
    }

    /// The answer was taken. Real-time: yes.
    #[inline]
    pub(crate) const fn answered(&mut self) {
        *self = match *self {
            Self::Awaiting {
                target_follows: true,
                ..
            } => Self::Pending,
            Self::Awaiting { .. } => Self::Idle,
            Self::Overdue { .. } => Self::Answered,
            other => other,
        };
    }

    /// A live partner takes over: it is not lost, and times of the other clock are void.
    pub(crate) fn go_live(&mut self) {
        *self = match self.owed() {
            Due::Nothing => Self::Idle,
            Due::Target => Self::Pending,
            Due::Answer => Self::Awaiting {
                since: None,
                target_follows: false,
            },
        };
    }

    /// A command has left, and its answer was not taken. Real-time: yes.
    #[inline]
    pub(crate) const fn owes(&self) -> bool {
        matches!(self.owed(), Due::Answer) || matches!(*self, Self::Awaiting { .. })
    }

    /// The target of the step is known and was not sent. Real-time: yes.
    #[inline]
    pub(crate) const fn is_pending(&self) -> bool {
        matches!(*self, Self::Pending)
    }

    /// True if it is not commanded any more. Real-time: yes.
    #[inline]
    pub(crate) const fn is_lost(&self) -> bool {
        matches!(*self, Self::Lost { .. })
    }

    /// True if it is lost because its link is gone: nothing is known of it. Real-time: yes.
    #[inline]
    pub(crate) const fn is_gone(&self) -> bool {
        matches!(
            *self,
            Self::Lost {
                cause: Loss::Gone,
                ..
            }
        )
    }

    /// It owed an answer when the test ended, and gets no command until the tick after that has come. Real-time: yes.
    #[inline]
    pub(crate) const fn owes_the_last(&self) -> bool {
        matches!(*self, Self::Overdue { .. } | Self::Answered)
    }

    /// It may be commanded. Real-time: yes.
    #[inline]
    pub(crate) const fn may_be_commanded(&self) -> bool {
        !self.is_lost() && !self.owes_the_last()
    }

    /// The target of a step is known. Real-time: yes.
    #[inline]
    pub(crate) const fn pend(&mut self) {
        match self {
            Self::Idle | Self::Pending => *self = Self::Pending,
            Self::Awaiting { target_follows, .. } => *target_follows = true,
            Self::Lost { owed, .. } => *owed = Due::Target,
            Self::Overdue { .. } | Self::Answered => {}
        }
    }

    /// The command in force is the target of the step: its answer is that of the target. Real-time: yes.
    #[inline]
    pub(crate) const fn told_the_target(&mut self) {
        if let Self::Awaiting { target_follows, .. } = self {
            *target_follows = false;
        }
    }

    /// The interrupted test is resumed: a partner of whole steps gets its target again unless it has answered it. True if the
    /// target was sent before.
    pub(crate) fn ask_again(&mut self, per_step: bool) -> bool {
        let owed = self.owed();
        *self = if per_step && owed != Due::Nothing {
            Self::Pending
        } else {
            Self::Idle
        };
        owed == Due::Answer
    }

    /// The test is over: an answer that is owed now is overdue.
    pub(crate) const fn end_test(&mut self) {
        if let Self::Awaiting { since, .. } = *self {
            *self = Self::Overdue { since };
        }
    }

    /// A tick of the shutdown is over: an overdue answer that came in it is not waited for any more. Real-time: yes.
    pub(crate) const fn close_tick_of_shutdown(&mut self) {
        if matches!(*self, Self::Answered) {
            *self = Self::Idle;
        }
    }

    /// The partner is not commanded any more. Real-time: yes.
    pub(crate) fn lose(&mut self, loss: Loss) {
        let cause = if self.is_gone() { Loss::Gone } else { loss };
        *self = Self::Lost {
            cause,
            owed: self.owed(),
        };
    }

    /// When the loop first looked for the answer that is owed; none if it is not owed, or was not looked for. Real-time: yes.
    #[inline]
    pub(crate) const fn asked_at(&self) -> Option<Nanos> {
        match *self {
            Self::Awaiting { since, .. } | Self::Overdue { since } => since,
            _ => None,
        }
    }

    /// When the loop first looked for the answer: now, if it has not before. Real-time: yes.
    #[inline]
    pub(crate) fn look_for_answer(&mut self, now: Nanos) -> Nanos {
        match self {
            Self::Awaiting { since, .. } | Self::Overdue { since } => *since.get_or_insert(now),
            _ => now,
        }
    }
}
