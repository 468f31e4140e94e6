//! What has tripped on one axis, and what of that is no further trip on the way out. Real-time.
//!
//! Whoever leads a specimen away from what it tripped at finds it beyond the same bound for a while: that is excused on the
//! side of the bound where it tripped, until it gets worse. Invariant: what is not a number is never excused.

use super::{Hit, Level, Quantity};

/// It has got worse by so much of the value that tripped.
const WORSE: f64 = 0.05;

/// A value that tripped, and what it is beyond.
#[derive(Debug, Clone, Copy)]
struct Kept {
    value: f64,
    bound: f64,
}

impl Kept {
    /// True if it is beyond an upper bound.
    fn is_above(&self) -> bool {
        self.value > self.bound
    }

    /// True of a value on the same side that is not much worse.
    fn covers(&self, other: &Kept) -> bool {
        let farthest = WORSE * self.value.abs();
        if self.is_above() {
            other.is_above() && other.value <= self.value + farthest
        } else {
            !other.is_above() && other.value >= self.value - farthest
        }
    }
}

/// The last trip of each quantity.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Trips {
    kept: [Option<Kept>; Quantity::ALL.len()],
    /// One bit per quantity that tripped beside the first of its look, until it is told.
    untold: u32,
    /// It is on its way out.
    leaves: bool,
}

impl Trips {
    /// From here on they are excused.
    pub const fn excuse(&mut self) {
        self.leaves = true;
    }

    /// True if this was known before it was left, and is no worse. A displacement that tripped as a command was never gone to: the
    /// way out has no excuse to go there.
    pub fn excuses(&self, hit: &Hit) -> bool {
        let Hit { value, bound, .. } = *hit;
        let kept = self.kept(hit.quantity);
        self.leaves
            && hit.quantity != Quantity::CommandDisp
            && kept.is_some_and(|kept| kept.covers(&Kept { value, bound }))
    }

    /// Takes note of a trip; one that is not the `first` of its look is to be told.
    pub fn take(&mut self, hit: &Hit, first: bool) {
        let Hit { value, bound, .. } = *hit;
        if let Some(kept) = self.kept.get_mut(hit.quantity as usize) {
            *kept = Some(Kept { value, bound });
        }
        if !first {
            self.untold |= hit.quantity.bit();
        }
    }

    /// One that is to be told, once.
    pub fn next_untold(&mut self, axis: usize) -> Option<Hit> {
        let place = self.untold.trailing_zeros() as usize;
        let quantity = *Quantity::ALL.get(place)?;
        self.untold &= !quantity.bit();
        self.kept(quantity).map(|Kept { value, bound }| Hit {
            axis,
            quantity,
            level: Level::Trip,
            value,
            bound,
        })
    }

    /// True if this has tripped.
    pub fn has(&self, quantity: Quantity) -> bool {
        self.kept(quantity).is_some()
    }

    fn kept(&self, quantity: Quantity) -> Option<Kept> {
        self.kept.get(quantity as usize).copied().flatten()
    }
}
