//! Where the specimens of a test are left.

use super::phase::Phase;
use super::stop::{Ending, Stop};
use crate::port::{UnloadFailure, WayBack};

/// Where a specimen was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndPosition {
    /// At its last command: the test file asks for nothing else, or too little was known of it to move it.
    Stayed,
    /// Where the test file wants it.
    Reached,
    /// Somewhere else, although the test file wants it moved; and why, where it was not something else that ended its way.
    NotReached(Option<UnloadFailure>),
    /// Its link is lost: wherever its own end holds or leaves it.
    Lost,
}

impl EndPosition {
    /// As the files spell it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            EndPosition::Stayed => "stayed",
            EndPosition::Reached => "reached",
            EndPosition::NotReached(_) => "not_reached",
            EndPosition::Lost => "lost",
        }
    }
}

/// A shutdown that did not complete.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IncompleteShutdown {
    /// What stopped it.
    pub stop: Stop,
    /// How the test had ended before.
    pub after: Ending,
}

/// How the specimens of a test ended.
#[derive(Debug, Clone)]
pub(super) struct Ends {
    /// Where each specimen was left.
    pub left: Vec<EndPosition>,
    /// Specimens that did not answer the last message.
    pub unheard: Vec<usize>,
    /// Specimens that were still getting ready when the operator ended the test.
    pub unarmed: Vec<usize>,
    /// What stopped the shutdown.
    pub unfinished: Option<IncompleteShutdown>,
    /// The wiring check found what the user accepts.
    pub wiring_is_accepted: bool,
    /// The axis of a wiring check that was interrupted, from 0, and how it went back.
    pub way_back: Option<(usize, WayBack)>,
    /// How the test ended whose shutdown is performed.
    after: Option<Ending>,
}

impl Ends {
    /// Every specimen stays where it is.
    pub(crate) fn new(ports: usize) -> Self {
        Self {
            left: vec![EndPosition::Stayed; ports],
            unheard: Vec::new(),
            unarmed: Vec::new(),
            unfinished: None,
            wiring_is_accepted: false,
            way_back: None,
            after: None,
        }
    }

    /// The wiring check found what the user accepts.
    pub(crate) const fn accept_wiring(&mut self) {
        self.wiring_is_accepted = true;
    }

    /// The shutdown of a test that ended so begins.
    pub(crate) fn begin(&mut self, after: Ending) {
        self.after = Some(after);
    }

    /// True if the operator ended the test.
    pub(crate) fn is_after_operator(&self) -> bool {
        self.after == Some(Ending::Stopped(Stop::Operator))
    }

    /// True if what trips in this phase does so in the shutdown that the operator asked for. Real-time: yes.
    pub(crate) fn is_operators(&self, phase: Phase) -> bool {
        phase == Phase::Leaving && self.is_after_operator()
    }

    /// The link of a specimen is lost.
    pub(crate) fn mark_lost(&mut self, port: usize) {
        if let Some(left) = self.left.get_mut(port) {
            *left = EndPosition::Lost;
        }
    }
}
