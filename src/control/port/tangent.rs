//! Tangents of one axis as they show during a test: least squares of the change of force over the change of displacement,
//! and of velocity where damping is declared, over a short fading window (guide: mathematics-integrator).
//!
//! A change counts when the axis has moved by more than its noise; between two turning points only, so that a chord across
//! the corner of a hysteresis loop is not taken for a tangent. Until there is one, and while nothing moves, the last
//! value stands. Pure: no clock, no bounds. Real-time after `new`.

use gusset_quantity::state;

/// Share of the past that the next sample leaves: a memory of eight samples, of 32 where two slopes are told apart, because
/// displacement and velocity are in proportion over shorter stretches.
const FADING: f64 = 7.0 / 8.0;
const FADING_OF_TWO: f64 = 31.0 / 32.0;
/// Below this relative determinant displacement and velocity are in proportion, and no two slopes can be told.
const IN_PROPORTION: f64 = 1e-6;
/// Change of displacement, in parts of the largest displacement, that roundoff could make by itself.
const ROUNDOFF: f64 = 1e-9;

/// What an axis shows at one time, in the structure's units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Point {
    /// Measured displacement, m.
    pub disp: f64,
    /// Velocity, m/s.
    pub vel: f64,
    /// Measured force, N.
    pub force: f64,
}

state! { Point { disp, vel, force } }

/// The estimate of one axis.
#[derive(Debug, Clone, Copy)]
pub struct Tangent {
    /// N/m.
    stiffness: f64,
    /// N s/m.
    damping: f64,
    with_damping: bool,
    /// Change of displacement in m that counts.
    step: f64,
    largest: f64,
    begun: bool,
    from: Point,
    furthest: Point,
    /// Of dd, dv, vv, df, vf.
    sums: [f64; 5],
}

state! {
    Tangent { stiffness, damping, step, largest, begun, from, furthest, sums } keeps { with_damping }
}

impl Tangent {
    /// Begins with the declared values; damping is estimated only if it is declared.
    #[must_use]
    pub(crate) fn new(stiffness: f64, damping: f64, with_damping: bool) -> Self {
        Self {
            stiffness,
            damping,
            with_damping,
            step: 0.0,
            largest: 0.0,
            begun: false,
            from: Point::default(),
            furthest: Point::default(),
            sums: [0.0; 5],
        }
    }

    /// Forgets the samples but not the values, and counts changes of at least `step` m from now on.
    pub(crate) fn begin(&mut self, step: f64) {
        *self = Self {
            step,
            ..Self::new(self.stiffness, self.damping, self.with_damping)
        };
    }

    /// What was measured last has nothing to do with what comes next; the values stay.
    pub(crate) fn forget_samples(&mut self) {
        self.begin(self.step);
    }

    /// N/m. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// N s/m. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) const fn damping(&self) -> f64 {
        self.damping
    }

    /// True if damping is estimated.
    #[inline]
    #[must_use]
    pub(crate) const fn with_damping(&self) -> bool {
        self.with_damping
    }

    /// Takes a fresh measurement. Real-time: yes.
    #[inline]
    pub(crate) fn take(&mut self, point: Point) {
        // What is not a number trips elsewhere.
        if !(point.disp.is_finite() && point.force.is_finite()) {
            return;
        }
        self.largest = self.largest.max(point.disp.abs());
        if !self.begun {
            self.begun = true;
            (self.from, self.furthest) = (point, point);
            return;
        }
        let step = self.step.max(ROUNDOFF * self.largest);
        let onward = point.disp - self.furthest.disp;
        if onward * (self.furthest.disp - self.from.disp) >= 0.0 {
            self.furthest = point;
        } else if onward.abs() > 0.5 * step {
            // It has turned: what follows is measured from the turning point.
            (self.from, self.furthest) = (self.furthest, point);
        }
        let change = Point {
            disp: point.disp - self.from.disp,
            vel: point.vel - self.from.vel,
            force: point.force - self.from.force,
        };
        if change.disp.abs() >= step && change.disp != 0.0 {
            (self.from, self.furthest) = (point, point);
            self.add(change);
        }
    }

    fn add(&mut self, change: Point) {
        let Point { disp, vel, force } = change;
        let fading = if self.with_damping {
            FADING_OF_TWO
        } else {
            FADING
        };
        let fresh = [
            disp * disp,
            disp * vel,
            vel * vel,
            disp * force,
            vel * force,
        ];
        for (sum, fresh) in self.sums.iter_mut().zip(fresh) {
            *sum = fading * *sum + fresh;
        }
        let [dd, dv, vv, df, vf] = self.sums;
        if !self.with_damping {
            self.stiffness = df / dd;
            return;
        }
        let determinant = dd * vv - dv * dv;
        if determinant > IN_PROPORTION * dd * vv {
            self.stiffness = (df * vv - vf * dv) / determinant;
            self.damping = (vf * dd - df * dv) / determinant;
        } else {
            self.stiffness = (df - self.damping * dv) / dd;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// PlatformUnloading d = A sin ωt at 1 kHz, half a hertz, with this law of force.
    fn along(tangent: &mut Tangent, steps: usize, force: impl Fn(f64, f64) -> f64) {
        for k in 0..steps {
            let t = k as f64 * 1e-3;
            let (disp, vel) = (0.01 * libm::sin(3.0 * t), 0.03 * libm::cos(3.0 * t));
            let force = force(disp, vel);
            tangent.take(Point { disp, vel, force });
        }
    }

    #[test]
    fn spring_shows_its_stiffness_at_once() {
        let mut tangent = Tangent::new(7.0, 0.0, false);
        assert_eq!(tangent.stiffness(), 7.0, "as declared");
        along(&mut tangent, 2, |d, _| 4e5 * d - 3e3);
        // A force of 3e3 N has 4.5e-13 N of roundoff, the change of 12 N: 4e-14 relative.
        assert!((tangent.stiffness() / 4e5 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_spring_and_a_dashpot_are_told_apart() {
        let mut tangent = Tangent::new(0.0, 1.0, true);
        along(&mut tangent, 300, |d, v| 4e5 * d + 5e3 * v);
        // Over 32 ticks of 3 mrad the relative determinant is (0.1)²/12 ~ 1e-3: roundoff grows to 1e-9 at the worst.
        assert!(
            (tangent.stiffness() / 4e5 - 1.0).abs() < 1e-6,
            "{tangent:?}"
        );
        assert!((tangent.damping() / 5e3 - 1.0).abs() < 1e-6, "{tangent:?}");
    }

    #[test]
    fn changed_stiffness_is_followed() {
        // 1e5 N/m up to 5 mm, three times that beyond: 50 samples later (7/8)^50 = 0.1 % of the old remains.
        let hardening = |d: f64, _| {
            if d < 5e-3 {
                1e5 * d
            } else {
                500.0 + 3e5 * (d - 5e-3)
            }
        };
        let mut tangent = Tangent::new(0.0, 0.0, false);
        along(&mut tangent, 170, hardening);
        assert!((tangent.stiffness() / 1e5 - 1.0).abs() < 1e-9);
        along(&mut tangent, 240, hardening);
        assert!(
            (tangent.stiffness() / 3e5 - 1.0).abs() < 5e-3,
            "{tangent:?}"
        );
    }

    #[test]
    fn noise_does_not_bias_a_stiffness() {
        let mut tangent = Tangent::new(4e5, 0.0, false);
        tangent.begin(1e-4);
        for k in 0..1000 {
            let noise = 1e-5 * f64::from(k % 7 - 3);
            tangent.take(Point {
                disp: noise,
                vel: 0.0,
                force: 1e3 * noise * f64::from(k % 5),
            });
        }
        assert_eq!(tangent.stiffness(), 4e5, "only noise");
        for k in 0..2000 {
            let disp = 1e-6 * f64::from(k);
            let noise = 1e-6 * f64::from(k % 3 - 1);
            let force = 2e5 * disp;
            tangent.take(Point {
                disp: disp + noise,
                vel: 0.0,
                force,
            });
        }
        // 2e-6 m of noise in changes of 1e-4 m.
        assert!(
            (tangent.stiffness() / 2e5 - 1.0).abs() < 0.02,
            "{tangent:?}"
        );
    }

    /// Elastic to 1 mm with 1e6 N/m, then flat, and elastic again as soon as it turns.
    struct Plastic {
        set: f64,
    }

    impl Plastic {
        fn force(&mut self, disp: f64) -> f64 {
            self.set = self.set.clamp(disp - 1e-3, disp + 1e-3);
            1e6 * (disp - self.set)
        }
    }

    #[test]
    fn corner_of_a_loop_is_no_stiffness() {
        // Changes of 0.4 mm, ticks of 0.07 mm, watched from a few ticks before it turns on its plateau: the chord across the
        // corner would have up to 1 + 5/6 times the stiffness.
        let mut largest: f64 = 0.0;
        for before in 0..6 {
            let (mut law, mut tangent) = (Plastic { set: 0.0 }, Tangent::new(0.0, 0.0, false));
            tangent.begin(4e-4);
            for k in 0..52i32 {
                let disp = 7e-5 * f64::from(40 - (k - 40).abs());
                let force = law.force(disp);
                if k >= 40 - before {
                    tangent.take(Point {
                        disp,
                        vel: 0.0,
                        force,
                    });
                }
                largest = largest.max(tangent.stiffness());
            }
        }
        assert!(
            largest > 0.99e6 && largest <= 1e6 * (1.0 + 1e-9),
            "{largest}"
        );
    }
}
