//! The backbone of one direction: its present shape, its deterioration, and where a line meets it.

use gusset_quantity::state;

use super::Direction;

/// A point of the force–displacement plane, positive in its direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub disp: f64,
    pub force: f64,
}

state! { Point { disp, force } }

/// The present backbone of one direction and the targets of reloading, in positive numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    pub yield_force: f64,
    pub hardening: f64,
    pub softening: f64,
    pub cap: Point,
    /// The last reversal, or where a line to the bound began: no unloading line meets the bound before it.
    pub last_peak: Point,
    /// The reversal at the largest displacement, moved by the deterioration. Peak-oriented response only.
    pub largest_peak: Point,
    /// The ultimate displacement is passed, or no force is left.
    pub lost: bool,
}

state! { Side { yield_force, hardening, softening, cap, last_peak, largest_peak, lost } }

impl Side {
    pub(super) fn virgin(direction: &Direction) -> Self {
        let force = direction.yield_force;
        let first_yield = Point {
            disp: direction.yield_disp,
            force,
        };
        let plastic = direction.cap_disp - direction.yield_disp;
        Self {
            yield_force: force,
            hardening: direction.hardening,
            softening: direction.softening,
            cap: Point {
                disp: direction.cap_disp,
                force: force + direction.hardening * plastic,
            },
            last_peak: first_yield,
            largest_peak: first_yield,
            lost: false,
        }
    }

    /// Lowers the yield force and the hardening by the factor `strength`, and the softening line by the factor `post_capping`; the
    /// cap is where both lines then meet. Ibarra, Medina & Krawinkler 2005, section "Cyclic deterioration". Real-time: yes.
    pub(super) fn weaken(&mut self, stiffness: f64, strength: f64, post_capping: f64) {
        let softening = self.softening;
        self.weaken_softening(stiffness, strength, post_capping, softening);
    }

    /// As [`Side::weaken`]. The softening slope decreases with the yield force, which keeps the line above the residual force. Where the
    /// hardening line would lie below that force, it is turned around the cap, so that a line that passes `arrival` at the
    /// residual force meets it there. Real-time: yes.
    pub(super) fn weaken_bilinear(
        &mut self,
        direction: &Direction,
        stiffness: f64,
        (strength, post_capping): (f64, f64),
        arrival: f64,
    ) {
        let residual = direction.residual;
        let left = self.yield_force * strength - residual;
        let softening = direction.softening * (left / (direction.yield_force - residual)).max(0.0);
        self.weaken_softening(stiffness, strength, post_capping, softening);
        let above = self.cap.force - residual;
        let turned = above / (self.cap.disp - arrival);
        if above > 0.0 && turned > 0.0 {
            self.hardening = self.hardening.min(turned);
        }
    }

    fn weaken_softening(
        &mut self,
        stiffness: f64,
        strength: f64,
        post_capping: f64,
        softening: f64,
    ) {
        let at_zero = (self.cap.force - self.softening * self.cap.disp) * post_capping;
        self.yield_force *= strength;
        self.hardening *= strength;
        self.softening = softening;
        let hardening_at_zero = self.yield_force * (1.0 - self.hardening / stiffness);
        self.cap.disp = if self.hardening > softening {
            (at_zero - hardening_at_zero) / (self.hardening - softening)
        } else {
            0.0
        };
        self.cap.force = hardening_at_zero + self.hardening * self.cap.disp;
    }

    /// The largest force over the displacement. Real-time: yes.
    pub(super) fn bound(&self, residual: f64) -> Bound {
        Bound {
            cap: self.cap,
            hardening: self.hardening,
            softening: self.softening,
            floor: residual,
        }
    }
}

/// The largest force over the displacement: the lower of hardening and softening line, but at least the floor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bound {
    cap: Point,
    hardening: f64,
    softening: f64,
    /// In N, at least 0.
    pub floor: f64,
}

impl Bound {
    pub(super) fn flat(floor: f64) -> Self {
        Self {
            cap: Point {
                disp: 0.0,
                force: floor,
            },
            hardening: 0.0,
            softening: 0.0,
            floor,
        }
    }

    fn hardening_line(&self, disp: f64) -> f64 {
        self.cap.force + self.hardening * (disp - self.cap.disp)
    }

    fn softening_line(&self, disp: f64) -> f64 {
        self.cap.force + self.softening * (disp - self.cap.disp)
    }

    /// The force at `disp`. Real-time: yes.
    pub(super) fn force(&self, disp: f64) -> f64 {
        let line = if disp < self.cap.disp {
            self.hardening_line(disp)
        } else {
            self.softening_line(disp)
        };
        line.max(self.floor)
    }

    /// Where the softening line reaches the floor; −∞ if all lies on the floor. Real-time: yes.
    pub(super) fn floor_begins(&self) -> f64 {
        if self.softening < 0.0 {
            self.cap.disp + (self.floor - self.cap.force) / self.softening
        } else if self.cap.force > self.floor {
            f64::INFINITY
        } else {
            f64::NEG_INFINITY
        }
    }

    /// The slope from `disp` on, and the displacement at which it ends. Real-time: yes.
    pub(super) fn slope(&self, disp: f64) -> (f64, f64) {
        let above = self.cap.force - self.floor;
        if above <= 0.0 {
            return (0.0, f64::INFINITY);
        }
        let rise = if self.hardening > 0.0 {
            self.cap.disp - above / self.hardening
        } else {
            f64::NEG_INFINITY
        };
        let fall = self.floor_begins();
        if disp < rise {
            (0.0, rise)
        } else if disp < self.cap.disp {
            (self.hardening, self.cap.disp)
        } else if disp < fall {
            (self.softening, fall)
        } else {
            (0.0, f64::INFINITY)
        }
    }

    /// Where a rising line from below through `from` meets the bound. On or above it: not beyond `from`. Real-time: yes.
    pub(super) fn meeting(&self, from: Point, slope: f64) -> f64 {
        let ahead = |force: f64, by: f64| from.disp + (force - from.force) / (slope - by);
        let hardening = if slope > self.hardening {
            ahead(self.hardening_line(from.disp), self.hardening)
        } else {
            f64::INFINITY
        };
        let softening = ahead(self.softening_line(from.disp), self.softening);
        hardening.min(softening).max(ahead(self.floor, 0.0))
    }
}
