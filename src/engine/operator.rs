//! What passes between the loop and whoever attends it: requests in, notices out.

use crossbeam_channel::{Receiver, Sender};

use super::phase::PhaseCell;

/// What an operator can ask of a running test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operator {
    /// End in an orderly way.
    Stop,
    /// Let test time stand still.
    Hold,
    /// Go on after a hold; confirm the offsets.
    Continue,
    /// Give the test up as being late. No operator asks for it: a replay does, whose clock is never late.
    GiveUp,
}

/// What the loop tells whoever attends it, besides rows and events. Never waited on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Notice {
    /// What was read of one axis while zeroing.
    Zeroed {
        /// Specimen, from 0.
        port: usize,
        /// Axis, from 0.
        axis: usize,
        /// In the axis' own units.
        reading: crate::control::Reading,
    },
    /// The offsets are to be confirmed with [`Operator::Continue`].
    AwaitingConfirmation,
}

/// The operator's line into the loop: polled once a tick, never waited on.
#[derive(Debug, Clone)]
pub struct Control {
    /// Requests; bounded.
    pub requests: Receiver<Operator>,
    /// Where notices go; bounded, and dropped when full.
    pub notices: Sender<Notice>,
    /// Where the phase is left.
    pub phase: PhaseCell,
    /// The other end of `requests`, if other programs may speak to the test through its run folder.
    pub desk: Option<Sender<Operator>>,
}

impl From<Receiver<Operator>> for Control {
    /// An operator who asks and is told nothing.
    fn from(requests: Receiver<Operator>) -> Self {
        Self {
            requests,
            ..Self::unattended()
        }
    }
}

impl Control {
    /// A control that nobody holds: for tests and offline runs.
    #[must_use]
    pub fn unattended() -> Self {
        Self {
            requests: crossbeam_channel::never(),
            notices: crossbeam_channel::bounded(0).0,
            phase: PhaseCell::default(),
            desk: None,
        }
    }
}

/// Something to do on the loop's own thread just before the first and just after the last tick of the grid: tests put
/// a guard there that counts system calls and allocations.
pub type Watch = Box<dyn FnMut() + Send>;
