//! The state of the law and its way along a straight path, from event to event.

use gusset_quantity::state;

use super::super::envelope::Point;
use super::{Constants, Direction};

/// The line on which the force moves.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Virgin: around zero, before the first corner of both envelopes.
    Elastic,
    /// On the envelope.
    Envelope,
    /// On the way from a reversal to the target.
    Way,
}

state! { enum Phase { Elastic, Envelope, Way } }

/// The lines from a reversal to the target.
#[derive(Debug, Clone, Copy, Default)]
struct Way {
    disp: [f64; 4],
    force: [f64; 4],
}

state! { Way { disp, force } }

impl Way {
    fn of(points: [Point; 4]) -> Self {
        Self {
            disp: points.map(|point| point.disp),
            force: points.map(|point| point.force),
        }
    }

    fn point(&self, place: usize) -> Point {
        Point {
            disp: self.disp.get(place).copied().unwrap_or_default(),
            force: self.force.get(place).copied().unwrap_or_default(),
        }
    }

    fn target(&self) -> Point {
        self.point(3)
    }

    /// The line at `disp`: a point on it, its slope and its end.
    fn line(&self, disp: f64) -> (Point, f64, f64) {
        let place = (1..3).find(|place| disp < self.point(*place).disp);
        let end = self.point(place.unwrap_or(3));
        let start = self.point(place.unwrap_or(3) - 1);
        (end, start.slope_to(end), end.disp)
    }
}

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
    cycles: f64,
    /// Largest displacement ahead, moved outwards by damage.
    demand_ahead: f64,
    demand_behind: f64,
    way: Way,
    /// Damage of the stiffness and of the strength since the last reversal.
    softened: f64,
    weakened: f64,
    /// Damages when the motion last left the range up to the ultimate displacement.
    kept: [f64; 3],
}

state! {
    State {
        direction, phase, disp, force, slope, energy, cycles, demand_ahead, demand_behind, way, softened, weakened, kept
    }
}

impl State {
    pub(super) fn virgin(law: &Constants) -> Self {
        Self {
            direction: 1.0,
            phase: Phase::Elastic,
            disp: 0.0,
            force: 0.0,
            slope: law.stiffness,
            energy: 0.0,
            cycles: 0.0,
            demand_ahead: law.positive.envelope.corners[1].disp,
            demand_behind: law.negative.envelope.corners[1].disp,
            way: Way::default(),
            softened: 0.0,
            weakened: 0.0,
            kept: [0.0; 3],
        }
    }

    pub(super) fn signed_force(&self) -> f64 {
        self.direction * self.force
    }

    pub(super) fn slope(&self) -> f64 {
        self.slope
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
            self.advance(law, self.direction * disp);
        }
        self
    }

    /// The direction of motion, and the other one.
    fn directions<'a>(&self, law: &'a Constants) -> [&'a Direction; 2] {
        if self.direction > 0.0 {
            [&law.positive, &law.negative]
        } else {
            [&law.negative, &law.positive]
        }
    }

    /// The damages of this moment.
    fn damages(&self, law: &Constants) -> [f64; 3] {
        let [ahead, behind] = self.directions(law);
        if self.disp.abs() >= law.damage.ultimate {
            return self.kept;
        }
        let loaded = if self.force > 0.0 { ahead } else { behind };
        let stiffness = loaded.stiffness() * (1.0 - self.softened);
        let elastic = if stiffness > 0.0 {
            0.5 * self.force * self.force / stiffness
        } else {
            0.0
        };
        let largest = self.demand_ahead.max(self.demand_behind);
        let mut damages =
            law.damage
                .after(largest, self.energy, self.energy - elastic, self.cycles);
        // Unloading is not softer than the secant to the largest displacement.
        let secant = |direction: &Direction, demand: f64| {
            let force = direction.envelope.force(demand) * (1.0 - self.weakened);
            force / demand / direction.stiffness()
        };
        let stiffest = secant(ahead, self.demand_ahead).max(secant(behind, self.demand_behind));
        damages[0] = damages[0].min((1.0 - stiffest).max(0.0));
        damages
    }

    /// Looks the other way. Beyond the elastic range a new way begins here.
    fn turn(&mut self, law: &Constants) {
        let [softened, moved, weakened] = self.damages(law);
        let reached = self.disp;
        self.direction = -self.direction;
        self.disp = -self.disp;
        self.force = -self.force;
        std::mem::swap(&mut self.demand_ahead, &mut self.demand_behind);
        if self.phase == Phase::Elastic {
            return;
        }
        if self.phase == Phase::Envelope {
            let damaged = self.demand_behind * (1.0 + moved);
            self.demand_behind = self.demand_behind.max(reached).max(damaged);
        }
        self.phase = Phase::Way;
        (self.softened, self.weakened) = (softened, weakened);
        let [ahead, _] = self.directions(law);
        let disp = self.demand_ahead * (1.0 + moved);
        let target = Point {
            disp,
            force: ahead.envelope.force(disp) * (1.0 - weakened),
        };
        self.way = self.way_to(target, law);
    }

    /// Unloading, a pinched line and reloading from here to the target. Where these do not fit between both, the way is straight.
    fn way_to(&self, target: Point, law: &Constants) -> Way {
        let here = Point {
            disp: self.disp,
            force: self.force,
        };
        let between = |from: Point, to: Point, share: f64| Point {
            disp: from.disp + share * (to.disp - from.disp),
            force: from.force + share * (to.force - from.force),
        };
        let straight = [
            here,
            between(here, target, 0.33),
            between(here, target, 0.67),
            target,
        ];
        if here.disp * target.disp >= 0.0 {
            return Way::of(straight);
        }
        let [unloaded, reloading] = self.corners(here, target, law);
        let [unloaded, reloading] = match (unloaded, reloading) {
            (Some(unloaded), Some(reloading)) => [unloaded, reloading],
            _ => [straight[1], straight[2]],
        };
        let points = [here, unloaded, reloading, target];
        let falls = |pair: &[Point]| match pair {
            [from, to] => to.disp < from.disp || to.force < from.force,
            _ => false,
        };
        if !points.windows(2).any(falls) {
            return Way::of(points);
        }
        let chord = here.slope_to(target);
        if chord > 1e-8 && chord < target.force / target.disp {
            return Way::of([
                here,
                between(Point::default(), here, 0.5),
                Point::default(),
                target,
            ]);
        }
        Way::of(straight)
    }

    /// The end of unloading and the begin of reloading; none where the way is straight.
    fn corners(&self, here: Point, target: Point, law: &Constants) -> [Option<Point>; 2] {
        const NONE: [Option<Point>; 2] = [None, None];
        let [ahead, behind] = self.directions(law);
        let left = 1.0 - self.softened;
        let (stiffness, unloading) = (ahead.stiffness() * left, behind.stiffness() * left);
        let pinch = ahead.pinch;
        let strength = (1.0 - self.weakened) * ahead.strength(self.demand_ahead);
        let middle = |from: Point, to: Point| Point {
            disp: 0.5 * (from.disp + to.disp),
            force: 0.5 * (from.force + to.force),
        };

        let force = target.force * pinch.r_force;
        let mut reloading = Point {
            disp: target.disp * pinch.r_disp,
            force,
        };
        if reloading.slope_to(target) > stiffness {
            reloading.disp = target.disp - (target.force - force) / stiffness;
        }
        if reloading.disp < here.disp {
            return NONE;
        }
        let force = pinch.u_force * strength;
        let mut unloaded = Point {
            disp: here.disp + (force - here.force) / unloading,
            force,
        };
        if unloaded.disp < here.disp {
            unloaded = middle(here, reloading);
        } else if unloaded.slope_to(reloading) > stiffness.max(unloading) {
            return NONE;
        } else if unloaded.disp > reloading.disp || unloaded.force > reloading.force {
            if unloaded.disp > 0.0 {
                unloaded = middle(here, reloading);
            } else if reloading.disp < 0.0 {
                reloading = middle(unloaded, target);
            } else {
                // A nearly flat line halfway between both forces.
                let mean = 0.5 * (unloaded.force + reloading.force);
                let (up, down) = (reloading.slope_to(target), here.slope_to(unloaded));
                reloading.force = mean + 0.01 * mean.abs();
                unloaded.force = mean - 0.01 * mean.abs();
                reloading.disp = target.disp - (target.force - reloading.force) / up;
                unloaded.disp = here.disp + (unloaded.force - here.force) / down;
            }
        }
        [Some(unloaded), Some(reloading)]
    }

    /// Follows the path up to `to`. Each line leads to a later line or phase, and none comes twice: the loop ends.
    fn advance(&mut self, law: &Constants, to: f64) {
        while self.disp < to {
            let [ahead, _] = self.directions(law);
            let limit = law.damage.ultimate;
            let before = if self.disp < limit {
                limit
            } else {
                f64::INFINITY
            };
            let (on, slope, end) = match self.phase {
                Phase::Elastic => (
                    Point::default(),
                    law.stiffness,
                    ahead.envelope.corners[0].disp,
                ),
                Phase::Way if self.disp < self.way.target().disp => self.way.line(self.disp),
                Phase::Way | Phase::Envelope => {
                    self.phase = Phase::Envelope;
                    let (on, slope, end) = ahead.envelope.line(self.disp);
                    let kept = 1.0 - self.weakened;
                    let on = Point {
                        disp: on.disp,
                        force: kept * on.force,
                    };
                    (on, kept * slope, end)
                }
            };
            let stop = end.min(to).min(before).max(self.disp);
            let force = on.force + slope * (stop - on.disp);
            let kept = if stop >= before { Some(stop) } else { None };
            self.energy += 0.5 * (self.force + force) * (stop - self.disp);
            let largest = self.demand_ahead.max(self.demand_behind);
            self.cycles += (stop - self.disp) / (4.0 * largest);
            (self.disp, self.force, self.slope) = (stop, force, slope);
            if self.phase == Phase::Elastic && stop >= end {
                self.phase = Phase::Envelope;
            }
            if kept.is_some() {
                // Beyond the ultimate displacement the damages do not change.
                self.disp = stop * (1.0 - f64::EPSILON);
                self.kept = self.damages(law);
                self.disp = stop;
            }
        }
    }
}
