//! What has tripped on one axis, and what of that is no further trip on the way out. Real-time.
//!
//! Whoever leads a specimen away from what it tripped at finds it beyond the same bound for a while: that is excused on the
//! side of the bound where it tripped, until it gets worse. An actuator that lags goes on, though, to where the last command
//! before the way out has sent it, as it would if it were left there: what is found while it only goes on there is told if it is
//! new and stops nothing. A force on one axis may be that of the motion of another. Beside the noise of its sensor an axis is seen
//! to go on if it has come farther a little while ago: one that is stuck is soon excused no more. Invariant: what is not a
//! number is never excused.

use super::{Hit, Level};
use gusset_quantity::catalog::limit::{AXIS_LIMITS, Limit};
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, Visit};

/// It has got worse by so much of the value that tripped.
const WORSE: f64 = 0.05;
/// Readings of the same place differ by so many times the root mean square of the noise at most.
const NOISE: f64 = 8.0;
/// Time in s in which an axis that goes on is found farther at least once.
const FARTHER_IN_S: f64 = 0.05;

/// A value that tripped or was warned of, and what it is beyond.
#[derive(Debug, Clone, Copy, Default)]
struct Kept {
    value: f64,
    bound: f64,
}

impl Stateful for Kept {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        let mut numbers = [self.value, self.bound];
        numbers.visit_state(visit);
        let [value, bound] = numbers;
        *self = Self { value, bound };
    }
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

/// Who only goes on to where it was sent before the way out.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GoesOn {
    /// The axis itself.
    pub own: bool,
    /// Any axis of its specimen.
    pub any: bool,
}

impl GoesOn {
    /// True if that motion changes a quantity. The end of a sensor's range is no such: what is read there says nothing.
    const fn moves(self, quantity: Limit) -> bool {
        match quantity {
            Limit::MeasuredDisp | Limit::FollowingError => self.own,
            Limit::MeasuredForce | Limit::ForceStep => self.any,
            _ => false,
        }
    }
}

/// An axis on its way out, m.
#[derive(Debug, Clone, Copy)]
struct Left {
    /// Where it was sent before.
    sent: f64,
    upwards: bool,
    /// The least that was left of the way there.
    nearest: f64,
    /// Readings that differ by so much may be of the same place.
    noise: f64,
    /// Time in s since it was found farther; infinite for one that had nowhere to go.
    since: f64,
    goes_on: bool,
}

impl Left {
    fn new(stands: f64, sent: f64, noise: f64) -> Self {
        let (nearest, noise) = ((sent - stands).abs(), NOISE * noise);
        Self {
            sent,
            upwards: sent > stands,
            nearest,
            noise,
            since: if nearest > noise { 0.0 } else { f64::INFINITY },
            goes_on: false,
        }
    }

    fn follow(&mut self, stands: f64, tick: f64) {
        let to_go = if self.upwards {
            self.sent - stands
        } else {
            stands - self.sent
        };
        let is_on_the_way = to_go >= -self.noise && to_go <= self.nearest + self.noise;
        // Beyond its end nothing is farther.
        let nearest = to_go.max(0.0);
        if is_on_the_way && nearest < self.nearest && self.since.is_finite() {
            (self.nearest, self.since) = (nearest, 0.0);
        } else {
            self.since += tick;
        }
        self.goes_on = is_on_the_way && self.since <= FARTHER_IN_S;
    }
}

/// The last trip of each quantity.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Trips {
    kept: [Option<Kept>; AXIS_LIMITS],
    /// One bit per quantity that tripped beside the first of its judgement, until it is reported.
    untold: u32,
    /// Warnings beside the first of a judgement, until they are reported: in the next tick the value may be within its level again.
    warnings: [Option<Kept>; AXIS_LIMITS],
    left: Option<Left>,
}

// Between two ticks nothing is untold, and only the shutdown leads an axis away.
state! { Trips { kept } keeps { untold, warnings, left } }

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
    /// From here on they are excused, of an axis that stands at `stands`, as far as the `noise` of its sensor tells, and was sent
    /// to `sent`.
    pub(crate) fn excuse(&mut self, stands: f64, sent: f64, noise: f64) {
        self.left = Some(Left::new(stands, sent, noise));
    }

    /// Takes note of where it is measured on its way out, `tick` seconds after the last time. Real-time: yes.
    pub(crate) fn follow(&mut self, stands: f64, tick: f64) {
        if let Some(left) = &mut self.left {
            left.follow(stands, tick);
        }
    }

    /// True while it only goes on to where it was sent before the way out.
    pub(crate) fn goes_on(&self) -> bool {
        self.left.is_some_and(|left| left.goes_on)
    }

    /// Judges a value beyond its trip level, and keeps it.
    pub(crate) fn judge(&mut self, hit: &Hit, goes_on: GoesOn) -> Verdict {
        let found = Kept {
            value: hit.value,
            bound: hit.bound,
        };
        let goes_on = goes_on.moves(hit.quantity) && found.value.is_finite();
        let Some(kept) = self.kept.get_mut(hit.quantity as usize) else {
            return Verdict::Trips;
        };
        // A displacement that tripped as a command was never gone to: the way out has no excuse to go there.
        let is_left = self.left.is_some() && hit.quantity != Limit::CommandDisp;
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

    /// It is to be reported, beside the first of its judgement.
    pub(crate) const fn tell(&mut self, quantity: Limit) {
        self.untold |= quantity.bit();
    }

    /// A warning is to be reported, beside the first of its judgement.
    pub(crate) fn tell_warning(&mut self, hit: &Hit) {
        if let Some(place) = self.warnings.get_mut(hit.quantity as usize) {
            *place = Some(Kept {
                value: hit.value,
                bound: hit.bound,
            });
        }
    }

    /// One that is to be told, once: what trips comes first.
    pub(crate) fn next_untold(&mut self, axis: usize) -> Option<Hit> {
        let place = self.untold.trailing_zeros() as usize;
        let (quantity, level, kept) = match Limit::OF_AXIS.get(place) {
            Some(&quantity) => {
                self.untold &= !quantity.bit();
                (quantity, Level::Trip, self.kept(quantity)?)
            }
            None => {
                let mut warnings = Limit::OF_AXIS.iter().zip(&mut self.warnings);
                let warning = |(quantity, kept): (&Limit, &mut Option<Kept>)| {
                    kept.take().map(|kept| (*quantity, kept))
                };
                let (quantity, kept) = warnings.find_map(warning)?;
                (quantity, Level::Warning, kept)
            }
        };
        let Kept { value, bound } = kept;
        Some(Hit {
            axis,
            quantity,
            level,
            value,
            bound,
        })
    }

    /// True if this has tripped.
    pub(crate) fn has(&self, quantity: Limit) -> bool {
        self.kept(quantity).is_some()
    }

    fn kept(&self, quantity: Limit) -> Option<Kept> {
        self.kept.get(quantity as usize).copied().flatten()
    }
}
