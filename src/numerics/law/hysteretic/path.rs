//! The state of the law and its way along a straight path, from event to event.

use gusset_quantity::state;

use super::super::envelope::{Envelope, Point};
use super::Constants;

/// Largest target, in displacements of the first corner.
const FARTHEST: f64 = 1e6;

/// The line on which the force moves.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Away from a peak of the other direction, down to zero force.
    Unloading,
    /// With the unloading stiffness, below the line of reloading.
    Rising,
    /// On the line of reloading towards the target.
    Reloading,
    /// On the envelope.
    Envelope,
}

state! { enum Phase { Unloading, Rising, Reloading, Envelope } }

/// Memory of one direction, in positive numbers of that direction.
#[derive(Debug, Clone, Copy)]
struct Side {
    /// The target of reloading: the largest displacement, moved outwards by damage. 0 before the first motion.
    target: f64,
    /// Displacement at which the last unloading from this direction met zero force.
    rest: f64,
}

state! { Side { target, rest } }

/// The state as the motion sees it: displacements and forces are positive in the direction of the last motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    /// +1 or −1.
    direction: f64,
    phase: Phase,
    disp: f64,
    force: f64,
    /// Slope of the line just followed.
    slope: f64,
    /// ∫ f dd.
    energy: f64,
    ahead: Side,
    behind: Side,
    /// The virgin law has the slope of its first line.
    moved: bool,
}

state! { State { direction, phase, disp, force, slope, energy, ahead, behind, moved } }

/// The line of reloading: no force up to `start`, then over `bend` to the target on the envelope.
#[derive(Debug, Clone, Copy)]
struct Reloading {
    start: f64,
    bend: Point,
    target: Point,
    /// Unloading stiffness of the direction. No line is steeper.
    steepest: f64,
}

impl Reloading {
    /// The piece at `disp`: a point on it, its slope and its end.
    fn piece(&self, disp: f64) -> (Point, f64, f64) {
        let Self {
            start,
            bend,
            target,
            ..
        } = *self;
        let from = Point {
            disp: start,
            force: 0.0,
        };
        if disp < start {
            (from, 0.0, start)
        } else if disp < bend.disp {
            (from, from.slope_to(bend), bend.disp)
        } else {
            (bend, bend.slope_to(target), target.disp)
        }
    }
}

impl State {
    pub(super) const VIRGIN: Self = {
        let side = Side {
            target: 0.0,
            rest: 0.0,
        };
        Self {
            direction: 1.0,
            phase: Phase::Envelope,
            disp: 0.0,
            force: 0.0,
            slope: 0.0,
            energy: 0.0,
            ahead: side,
            behind: side,
            moved: false,
        }
    };

    pub(super) fn signed_force(&self) -> f64 {
        self.direction * self.force
    }

    pub(super) fn slope(&self, law: &Constants) -> f64 {
        if self.moved {
            self.slope
        } else {
            law.positive.stiffness()
        }
    }

    /// The state at `disp`, on a straight path from this one. Real-time: yes.
    pub(super) fn moved(mut self, law: &Constants, disp: f64) -> Self {
        let travel = self.direction * disp - self.disp;
        if travel.is_nan() {
            self.force = f64::NAN;
            return self;
        }
        if travel < 0.0 {
            self.turn(law);
        }
        if travel != 0.0 {
            self.moved = true;
            self.advance(law, self.direction * disp);
        }
        self
    }

    /// Envelope of the direction of motion, or of the other one.
    fn envelope<'a>(&self, law: &'a Constants, ahead: bool) -> &'a Envelope<3> {
        if (self.direction > 0.0) == ahead {
            &law.positive
        } else {
            &law.negative
        }
    }

    /// Stiffness with which the force of a direction is unloaded.
    fn unloading(law: &Constants, envelope: &Envelope<3>, side: &Side) -> f64 {
        let ductility = side.target / envelope.corners[0].disp;
        let softened = if ductility > 1.0 && law.beta > 0.0 {
            libm::pow(ductility, law.beta)
        } else {
            1.0
        };
        envelope.stiffness() / softened
    }

    /// Looks the other way. Where the force does not act in the new direction yet, an excursion ends: the target ahead moves.
    fn turn(&mut self, law: &Constants) {
        self.direction = -self.direction;
        self.disp = -self.disp;
        self.force = -self.force;
        std::mem::swap(&mut self.ahead, &mut self.behind);
        if !self.moved {
            return;
        }
        self.phase = Phase::Rising;
        if self.force <= 0.0 {
            self.phase = Phase::Unloading;
            let other = self.envelope(law, false);
            let stiffness = Self::unloading(law, other, &self.behind);
            self.behind.rest = self.force / stiffness - self.disp;
            let energy = self.energy - 0.5 * self.force * self.force / stiffness;
            let first = other.corners[0].disp;
            if self.behind.target > first {
                let share = law.by_energy * energy / law.capacity
                    + law.by_ductility * (self.behind.target - first) / first;
                // Damage without end has no other force than that at this distance.
                self.ahead.target = (self.ahead.target * (1.0 + share)).min(FARTHEST * first);
            }
        }
        let first = self.envelope(law, true).corners[0].disp;
        self.ahead.target = self.ahead.target.max(first);
    }

    /// Where reloading leads.
    fn reloading(&self, law: &Constants) -> Reloading {
        let envelope = self.envelope(law, true);
        let steepest = Self::unloading(law, envelope, &self.ahead);
        let target = Point {
            disp: self.ahead.target,
            force: envelope.force(self.ahead.target),
        };
        // An envelope that ended without force ahead of the rest keeps it without force up to there.
        let other = self.envelope(law, false);
        let lost = other.corners[2];
        let start = if lost.force == 0.0 && self.behind.target > lost.disp {
            f64::max(-self.behind.rest, -lost.disp)
        } else {
            -self.behind.rest
        };
        let force = law.pinch_y * target.force;
        let unpinched = target.disp - (target.force - force) / steepest;
        Reloading {
            start,
            bend: Point {
                disp: start + (unpinched - start) * law.pinch_x,
                force,
            },
            target,
            steepest,
        }
    }

    /// Follows the path up to `to`. Each line leads to a later piece or phase, and none comes twice: the loop ends.
    fn advance(&mut self, law: &Constants, to: f64) {
        let reloading = self.reloading(law);
        while self.disp < to {
            if self.disp >= self.ahead.target {
                self.phase = Phase::Envelope;
            }
            match self.phase {
                Phase::Unloading => {
                    let stiffness = Self::unloading(law, self.envelope(law, false), &self.behind);
                    let rest = -self.behind.rest;
                    let on = Point {
                        disp: rest,
                        force: 0.0,
                    };
                    self.follow(on, stiffness, rest, to);
                    if self.disp >= rest {
                        self.phase = Phase::Rising;
                    }
                }
                Phase::Rising => self.rise(&reloading, to),
                Phase::Reloading => {
                    let (on, slope, end) = reloading.piece(self.disp);
                    if slope > reloading.steepest {
                        self.phase = Phase::Rising;
                        self.rise(&reloading, to);
                    } else {
                        self.follow(on, slope, end, to);
                    }
                }
                Phase::Envelope => {
                    let (on, slope, end) = self.envelope(law, true).line(self.disp);
                    self.follow(on, slope, end, to);
                    self.ahead.target = self.ahead.target.max(self.disp);
                }
            }
        }
    }

    /// With the unloading stiffness up to the line of reloading.
    fn rise(&mut self, reloading: &Reloading, to: f64) {
        let (on, slope, end) = reloading.piece(self.disp);
        let gap = on.force + slope * (self.disp - on.disp) - self.force;
        let here = Point {
            disp: self.disp,
            force: self.force,
        };
        let closing = reloading.steepest - slope;
        let tiny = 1e-12 * reloading.target.force;
        if gap <= tiny && closing >= 0.0 {
            self.phase = Phase::Reloading;
        } else {
            let meeting = if closing > 0.0 {
                self.disp + gap / closing
            } else {
                f64::INFINITY
            };
            self.follow(here, reloading.steepest, end.min(meeting), to);
            if meeting <= end && self.disp >= meeting {
                self.phase = Phase::Reloading;
            }
        }
    }

    /// Along the line through `on` up to `end`, or to the end of the path.
    fn follow(&mut self, on: Point, slope: f64, end: f64, to: f64) {
        let end = end.min(to).max(self.disp);
        let force = on.force + slope * (end - on.disp);
        self.energy += 0.5 * (self.force + force) * (end - self.disp);
        (self.disp, self.force, self.slope) = (end, force, slope);
    }
}
