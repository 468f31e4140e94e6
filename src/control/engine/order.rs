//! What one tick of a maneuver does.

use super::phase::Phase;
use super::tick::Tick;
use gusset_record::WarmUpRows;

/// Which command leaves in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sends {
    /// The next one, which was judged.
    Next,
    /// The last one again: nothing moves.
    Last,
}

/// The rules of a tick: how a late edge is treated, and what its row holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// A tick of the test. Late ticks follow the policy; the maneuver fills the row.
    Test,
    /// A tick of a hold within the test. No test time passes.
    Hold,
    /// A tick of this phase, before or after the test.
    Beside(Phase),
    /// A tick of the warm-up.
    WarmUp(WarmUpRows),
    /// A command that was received, or a tick of the path to a received target. Its server has the row recorded.
    Received {
        /// It leaves at the next edge, not at once.
        is_paced: bool,
    },
}

/// One tick of a maneuver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Order {
    /// Its place in the test, as the commands carry it.
    pub tick: Tick,
    /// The place that its row has. A step may close some ticks after its target was reached.
    pub place: Tick,
    /// The command that leaves.
    pub sends: Sends,
    /// Its rules.
    pub kind: Kind,
}

impl Order {
    /// A tick whose row has the same place.
    pub(crate) const fn new(tick: Tick, sends: Sends, kind: Kind) -> Self {
        Self {
            tick,
            place: tick,
            sends,
            kind,
        }
    }

    /// A tick before or after the test in which nothing moves.
    pub(crate) const fn still(tick: Tick, phase: Phase) -> Self {
        Self::new(tick, Sends::Last, Kind::Beside(phase))
    }

    /// A tick before or after the test that moves specimens.
    pub(crate) const fn moving(tick: Tick, phase: Phase) -> Self {
        Self::new(tick, Sends::Next, Kind::Beside(phase))
    }

    /// True if nothing moves before or after the test.
    pub(crate) const fn is_still(&self) -> bool {
        matches!((self.sends, self.kind), (Sends::Last, Kind::Beside(_)))
    }
}
