//! What has tripped on one axis, and what of that is no further trip on the way out. Real-time.
//!
//! Whoever leads a specimen away from what it tripped at finds it beyond the same bound for a while: that is excused on the
//! side of the bound where it tripped, until it gets worse. An actuator that lags goes on, though, to where the last command
//! before the way out has sent it, as it would if it were left there: what is found while it only goes on there, each time
//! farther, is told if it is new and stops nothing. Invariant: what is not a number is never excused.

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

    /// Takes the worse of the two, on the same side.
    fn take_worse(&mut self, value: f64) {
        self.value = if self.is_above() {
            self.value.max(value)
        } else {
            self.value.min(value)
        };
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

/// True of what changes as an actuator moves, and is not the end of a sensor's range: what is read there says nothing.
const fn moves_along(quantity: Quantity) -> bool {
    matches!(
        quantity,
        Quantity::MeasuredDisp
            | Quantity::MeasuredForce
            | Quantity::FollowingError
            | Quantity::ForceStep
    )
}

/// The last trip of each quantity.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Trips {
    kept: [Option<Kept>; Quantity::ALL.len()],
    /// One bit per quantity that tripped beside the first of its look, until it is told.
    untold: u32,
    /// On the way out: how far it has come since, and where it was sent before.
    left: Option<[f64; 2]>,
}

/// What becomes of a value beyond its trip level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It trips.
    Trips,
    /// It is new, and no reason to stay there.
    Told,
    /// It was known.
    Excused,
}

impl Trips {
    /// From here on they are excused, of an axis that stands at `stands` and was sent to `sent`.
    pub const fn excuse(&mut self, stands: f64, sent: f64) {
        self.left = Some([stands, sent]);
    }

    /// Takes note of where it is measured on its way out; true while it only goes on to where it was sent before.
    pub fn goes_on(&mut self, stands: f64) -> bool {
        let Some([reached, sent]) = &mut self.left else {
            return false;
        };
        let goes_on = if *sent > *reached {
            stands > *reached && stands <= *sent
        } else {
            stands < *reached && stands >= *sent
        };
        if goes_on {
            *reached = stands;
        }
        goes_on
    }

    /// Judges a value beyond its trip level, and keeps it. `goes_on` of an axis as [`Trips::goes_on`] has it.
    pub fn judge(&mut self, hit: &Hit, goes_on: bool) -> Verdict {
        let found = Kept {
            value: hit.value,
            bound: hit.bound,
        };
        let goes_on = goes_on && moves_along(hit.quantity) && found.value.is_finite();
        let Some(kept) = self.kept.get_mut(hit.quantity as usize) else {
            return Verdict::Trips;
        };
        // A displacement that tripped as a command was never gone to: the way out has no excuse to go there.
        let is_left = self.left.is_some() && hit.quantity != Quantity::CommandDisp;
        match kept {
            Some(kept) if is_left && kept.is_above() == found.is_above() && goes_on => {
                kept.take_worse(found.value);
                Verdict::Excused
            }
            Some(kept) if is_left && kept.covers(&found) => Verdict::Excused,
            _ => {
                *kept = Some(found);
                if goes_on {
                    Verdict::Told
                } else {
                    Verdict::Trips
                }
            }
        }
    }

    /// It is to be told, beside the first of its look.
    pub const fn tell(&mut self, quantity: Quantity) {
        self.untold |= quantity.bit();
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
