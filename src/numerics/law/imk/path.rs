//! The state of a hinge and its way along a straight path, from event to event.

use gusset_quantity::state;

use super::backbone::{Bound, Point, Side};
use super::{Constants, Direction};

/// The line on which the force moves.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Virgin.
    Elastic,
    /// With the unloading stiffness through [`State::rest`]: away from the last peak, back to it, or up to the bound.
    Unloading,
    /// To the last peak. Peak-oriented response only, as the next.
    TowardLastPeak,
    /// To the largest peak.
    TowardLargestPeak,
    /// On the bound.
    Backbone,
}

state! { enum Phase { Elastic, Unloading, TowardLastPeak, TowardLargestPeak, Backbone } }

/// What ends a line.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    ZeroForce,
    LastPeak,
    Backbone,
    Corner,
}

/// The state of a hinge as the motion sees it: displacements and forces are positive in the direction of the last motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct State {
    /// +1 or −1.
    direction: f64,
    phase: Phase,
    disp: f64,
    force: f64,
    /// Slope of the line just followed.
    slope: f64,
    /// Unloading stiffness.
    stiffness: f64,
    /// Displacement at which the unloading line has no force.
    rest: f64,
    /// ∫ f dd.
    energy: f64,
    /// `energy` at the start of the excursion.
    energy_before: f64,
    /// The end of a softening line was passed: bilinear response unloads with half of the elastic stiffness from then on.
    residual: bool,
    ahead: Side,
    behind: Side,
}

state! {
    State {
        direction, phase, disp, force, slope, stiffness, rest, energy, energy_before, residual, ahead, behind
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
            stiffness: law.stiffness,
            rest: 0.0,
            energy: 0.0,
            energy_before: 0.0,
            residual: false,
            ahead: Side::virgin(&law.positive),
            behind: Side::virgin(&law.negative),
        }
    }

    pub(super) fn signed_force(&self) -> f64 {
        self.direction * self.force
    }

    fn point(&self) -> Point {
        Point {
            disp: self.disp,
            force: self.force,
        }
    }

    pub(super) fn slope(&self) -> f64 {
        self.slope
    }

    /// The state at `disp`, on a straight path from this one. Real-time: yes.
    pub(super) fn moved(mut self, law: &Constants, disp: f64) -> Self {
        let travel = self.direction * disp - self.disp;
        if travel < 0.0 {
            self.turn(law);
        }
        if travel.is_nan() {
            self.force = f64::NAN;
        } else if travel != 0.0 {
            self.advance(law, self.direction * disp);
        }
        self
    }

    /// Neither direction has any force left.
    fn failed(&self) -> bool {
        self.ahead.lost && self.behind.lost
    }

    fn fail(&mut self) {
        (self.ahead.lost, self.behind.lost) = (true, true);
    }

    /// The initial backbone of the direction of motion.
    fn initial<'a>(&self, law: &'a Constants) -> &'a Direction {
        if self.direction > 0.0 {
            &law.positive
        } else {
            &law.negative
        }
    }

    fn bound(&self, law: &Constants) -> Bound {
        let residual = self.initial(law).residual;
        if self.ahead.lost {
            Bound::flat(0.0)
        } else if self.behind.lost {
            Bound::flat(residual)
        } else {
            self.ahead.bound(residual)
        }
    }

    /// Looks the other way. If the force left a loading line, an unloading line begins.
    fn turn(&mut self, law: &Constants) {
        let peak = self.point();
        self.direction = -self.direction;
        self.disp = -self.disp;
        self.force = -self.force;
        self.rest = -self.rest;
        std::mem::swap(&mut self.ahead, &mut self.behind);
        if matches!(self.phase, Phase::Elastic | Phase::Unloading) {
            return;
        }
        self.phase = Phase::Unloading;
        self.behind.last_peak = peak;
        if peak.disp > self.behind.largest_peak.disp {
            self.behind.largest_peak = peak;
        }
        let elastic = 0.5 * self.force * self.force / self.stiffness;
        let dissipated = self.energy - elastic;
        let spent = dissipated - self.energy_before;
        let Some(lost) = law.unloading.lost_share(spent, dissipated) else {
            return self.fail();
        };
        self.stiffness = if self.residual && !law.peak_oriented {
            0.5 * law.stiffness
        } else {
            self.stiffness * (1.0 - lost)
        };
        self.rest = self.disp - self.force / self.stiffness;
        if self.rest <= self.disp {
            self.begin_excursion(law);
        }
    }

    /// Follows the path up to `to`. A line ends ahead or changes the phase, and no phase comes twice but at the few corners of the
    /// backbone: the loop ends.
    fn advance(&mut self, law: &Constants, to: f64) {
        while self.disp < to && !self.failed() {
            let bound = self.bound(law);
            let (event, slope, until) = self.line(&bound);
            let ultimate = if self.ahead.lost {
                f64::INFINITY
            } else {
                self.initial(law).ultimate
            };
            let end = until.min(to).min(ultimate);
            let on = |point: Point| point.force + slope * (end - point.disp);
            let force = match self.phase {
                Phase::Elastic | Phase::Unloading => slope * (end - self.rest),
                Phase::TowardLastPeak => on(self.ahead.last_peak),
                Phase::TowardLargestPeak => on(self.ahead.largest_peak),
                Phase::Backbone => bound.force(end),
            };
            self.energy += 0.5 * (self.force + force) * (end - self.disp);
            (self.disp, self.force, self.slope) = (end, force, slope);
            if end == until {
                self.pass(event, law);
            }
            let (floor, on_backbone) = (bound.floor_begins(), self.phase == Phase::Backbone);
            let past_softening = end >= floor;
            self.residual |= past_softening && (on_backbone || floor.is_finite());
            if end >= ultimate || (past_softening && on_backbone && self.force <= 0.0) {
                self.lose(law);
            }
        }
        if self.failed() {
            (self.disp, self.force, self.slope) = (to, 0.0, 0.0);
        }
    }

    /// The event that ends the present line, the slope of the line, and the displacement of the event.
    fn line(&self, bound: &Bound) -> (Event, f64, f64) {
        match self.phase {
            Phase::Unloading if self.disp < self.rest => {
                (Event::ZeroForce, self.stiffness, self.rest)
            }
            Phase::Elastic | Phase::Unloading => {
                let last = self.ahead.last_peak.disp;
                if self.disp < last {
                    return (Event::LastPeak, self.stiffness, last);
                }
                let meeting = bound.meeting(self.point(), self.stiffness);
                (Event::Backbone, self.stiffness, meeting.max(self.disp))
            }
            Phase::TowardLastPeak => (Event::LastPeak, self.slope, self.ahead.last_peak.disp),
            Phase::TowardLargestPeak => (Event::Backbone, self.slope, self.ahead.largest_peak.disp),
            Phase::Backbone => {
                let (slope, until) = bound.slope(self.disp);
                (Event::Corner, slope, until)
            }
        }
    }

    fn pass(&mut self, event: Event, law: &Constants) {
        match event {
            Event::ZeroForce => self.begin_excursion(law),
            Event::LastPeak if law.peak_oriented && self.disp < self.ahead.largest_peak.disp => {
                self.aim(law);
            }
            Event::LastPeak | Event::Backbone => self.phase = Phase::Backbone,
            Event::Corner => {}
        }
    }

    /// The force is zero on an unloading line: the backbone ahead deteriorates by the energy of the excursion that ends.
    fn begin_excursion(&mut self, law: &Constants) {
        let spent = self.energy - self.energy_before;
        let share = |capacity: &super::Capacity| capacity.lost_share(spent, self.energy);
        let (Some(strength), Some(post_capping), Some(reloading)) = (
            share(&law.strength),
            share(&law.post_capping),
            share(&law.reloading),
        ) else {
            return self.fail();
        };
        self.energy_before = self.energy;
        let initial = self.initial(law);
        let strength = 1.0 - strength * initial.factor;
        let post_capping = 1.0 - post_capping * initial.factor;
        if !law.peak_oriented {
            let arrival = self.rest + initial.residual / self.stiffness;
            let kept = (strength, post_capping);
            self.ahead
                .weaken_bilinear(initial, law.stiffness, kept, arrival);
            return self.rise();
        }
        self.ahead.weaken(law.stiffness, strength, post_capping);
        let target = self.ahead.largest_peak.disp * (1.0 + reloading * initial.factor);
        let force = self.ahead.bound(initial.residual).force(target);
        self.ahead.largest_peak = Point {
            disp: target,
            force,
        };
        if force > 0.0 {
            self.aim(law);
        } else {
            self.fail();
        }
    }

    /// Chooses the line of reloading from here: through the last peak if that is stiffer, or to the largest peak. Where that
    /// is not ahead or the line would be steeper than the elastic one, the unloading line continues.
    fn aim(&mut self, law: &Constants) {
        let toward = |peak: Point| {
            let slope = (peak.force - self.force) / (peak.disp - self.disp);
            (peak.disp > self.disp && slope <= law.stiffness).then_some(slope)
        };
        let (last, largest) = (self.ahead.last_peak, self.ahead.largest_peak);
        (self.phase, self.slope) = match (toward(last), toward(largest)) {
            (Some(near), Some(far)) if near > far && last.force < largest.force => {
                (Phase::TowardLastPeak, near)
            }
            (_, Some(far)) => (Phase::TowardLargestPeak, far),
            _ => return self.rise(),
        };
    }

    /// The unloading line continues from here up to the backbone.
    fn rise(&mut self) {
        self.phase = Phase::Unloading;
        self.rest = self.disp - self.force / self.stiffness;
        self.ahead.last_peak = self.point();
    }

    /// The direction of motion has no force any more. A hinge with peak-oriented response then has none at all.
    fn lose(&mut self, law: &Constants) {
        self.phase = Phase::Backbone;
        self.ahead.lost = true;
        self.behind.lost |= law.peak_oriented;
        self.residual = true;
        (self.force, self.slope) = (0.0, 0.0);
    }
}
