//! The path of a command between two targets, per axis: value and slope are continuous, whatever becomes known when.
//!
//! Targets are one step apart; u counts steps from the last one reached (u = 0) to the next (u = 1). While the next is
//! unknown, the way is the polynomial of order p (1 to 3) through the last p + 1 targets,
//!
//! ```text
//! P(u) = x₀ + u ∇ + u(u + 1)/2 ∇² + u(u + 1)(u + 2)/6 ∇³      (Newton, backward differences)
//! ```
//!
//! Once it is known at u₀, the way is the cubic that leaves P(u₀) with its slope and meets the target with the slope that
//! the polynomial through the target has there, which is the slope with which the next prediction begins. So there is no
//! corner at u₀ and none at a target. u₀ = 0, the target known at once, is plain cubic interpolation with p-th order slopes.
//!
//! A smooth way has no jump of the second derivative, either: it is the quintic with that of the polynomial at both ends. Order 0 waits
//! at the last target, and arrives at rest. A prediction by velocities v per step is P(u) = x₀ + u v₀ + u²/2 (v₀ − v₋₁).
//!
//! No input or output, no clock. Real-time: everything but [`Interpolation::new`].

use gusset_quantity::state;

/// Targets that are remembered.
const PAST: usize = 4;

/// Value and derivatives by u of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PathPoint {
    /// Displacement.
    pub disp: f64,
    /// Its change per step.
    pub slope: f64,
    /// The change of that per step.
    pub bend: f64,
}

/// One axis.
#[derive(Debug, Clone, Copy, Default)]
struct Way {
    /// x₀, x₋₁, x₋₂, x₋₃.
    past: [f64; PAST],
    goal: f64,
    /// v₀ and v₋₁, and that of the goal.
    vel: [f64; 2],
    goal_vel: f64,
}

// Only a gateway, whose test no other resumes, predicts by velocities.
state! { Way { past, goal } keeps { vel, goal_vel } }

/// The ways of all axes of one specimen.
#[derive(Debug, Clone)]
pub(crate) struct Interpolation {
    order: Order,
    is_smooth: bool,
    ways: Vec<Way>,
    /// u₀, where the next target became known; none while it is not.
    joined: Option<f64>,
}

state! { Interpolation { ways, joined } keeps { order, is_smooth } }

/// Order of the prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Order {
    /// None: at rest.
    Constant,
    /// A straight line.
    Linear,
    /// A parabola.
    #[default]
    Quadratic,
    /// A cubic.
    Cubic,
    /// The velocities that come with the targets.
    Velocities,
}

impl Way {
    /// ∇, ∇² and ∇³ of these targets, or the velocities instead.
    fn differences(past: [f64; PAST], [v, w]: [f64; 2], order: Order) -> [f64; 3] {
        let [a, b, c, d] = past;
        let first = a - b;
        let second = (a - b) - (b - c);
        let third = second - ((b - c) - (c - d));
        match order {
            Order::Constant => [0.0; 3],
            Order::Linear => [first, 0.0, 0.0],
            Order::Quadratic => [first, second, 0.0],
            Order::Cubic => [first, second, third],
            // u v + u²/2 (v − w) = u (v + w)/2 + u (u + 1)/2 (v − w)
            Order::Velocities => [f64::midpoint(v, w), v - w, 0.0],
        }
    }

    fn predict(&self, u: f64, order: Order) -> PathPoint {
        let [first, second, third] = Self::differences(self.past, self.vel, order);
        PathPoint {
            disp: self.past[0]
                + u * first
                + u * (u + 1.0) / 2.0 * second
                + u * (u + 1.0) * (u + 2.0) / 6.0 * third,
            slope: first
                + (2.0 * u + 1.0) / 2.0 * second
                + (3.0 * u * u + 6.0 * u + 2.0) / 6.0 * third,
            bend: second + (u + 1.0) * third,
        }
    }

    fn at_goal(&self, order: Order) -> PathPoint {
        let [a, b, c, _] = self.past;
        let vel = [self.goal_vel, self.vel[0]];
        let [first, second, third] = Self::differences([self.goal, a, b, c], vel, order);
        PathPoint {
            disp: self.goal,
            slope: first + second / 2.0 + third / 3.0,
            bend: second + third,
        }
    }

    fn correct(&self, u: f64, from: f64, order: Order, is_smooth: bool) -> PathPoint {
        let width = 1.0 - from;
        let s = (u - from) / width;
        let one = self.predict(from, order);
        let two = self.at_goal(order);
        let (rise, fall) = (one.slope * width, two.slope * width);
        let change = two.disp - one.disp;
        let (s2, s3) = (s * s, s * s * s);
        let disp = one.disp
            + change * (3.0 * s2 - 2.0 * s3)
            + rise * (s - 2.0 * s2 + s3)
            + fall * (s3 - s2);
        let by_s = change * (6.0 * s - 6.0 * s2)
            + rise * (1.0 - 4.0 * s + 3.0 * s2)
            + fall * (3.0 * s2 - 2.0 * s);
        let by_s2 = change * (6.0 - 12.0 * s) + rise * (6.0 * s - 4.0) + fall * (6.0 * s - 2.0);
        if !is_smooth {
            return PathPoint {
                disp,
                slope: by_s / width,
                bend: by_s2 / (width * width),
            };
        }
        // The bends at both ends lack something: c s²(1 − s)³/2 and d s³(1 − s)²/2 have no value and no slope there.
        let (t, t2) = (1.0 - s, (1.0 - s) * (1.0 - s));
        let lacks = |bend: f64, has: f64| bend * width * width - has;
        let c = lacks(one.bend, 6.0 * change - 4.0 * rise - 2.0 * fall);
        let d = lacks(two.bend, -6.0 * change + 2.0 * rise + 4.0 * fall);
        let more = 0.5 * s2 * t2 * (c * t + d * s);
        let more_by_s = 0.5 * s * t * (c * t * (2.0 - 5.0 * s) + d * s * (3.0 - 5.0 * s));
        let more_by_s2 =
            0.5 * (c * t * (2.0 - 16.0 * s + 20.0 * s2) + d * s * (6.0 - 24.0 * s + 20.0 * s2));
        PathPoint {
            disp: disp + more,
            slope: (by_s + more_by_s) / width,
            bend: (by_s2 + more_by_s2) / (width * width),
        }
    }
}

/// What every target has in the way at `share` of the step, of a target that is known at once: the one that the step ends at,
/// and those before it. Nothing for the real-time thread.
#[must_use]
pub fn shares(order: Order, share: f64) -> [PathPoint; PAST + 1] {
    std::array::from_fn(|target| {
        let unit = |at: usize| f64::from(u8::from(at == target));
        let way = Way {
            past: std::array::from_fn(|back| unit(back + 1)),
            goal: unit(0),
            ..Way::default()
        };
        if share >= 1.0 {
            way.at_goal(order)
        } else {
            way.correct(share, 0.0, order, false)
        }
    })
}

impl Interpolation {
    /// Of `axes` axes.
    #[must_use]
    pub(crate) fn new(axes: usize, order: Order) -> Self {
        Self {
            order,
            is_smooth: false,
            ways: vec![Way::default(); axes],
            joined: None,
        }
    }

    /// Predicts with another order from here on.
    pub(crate) fn set_order(&mut self, order: Order) {
        self.order = order;
    }

    /// From here on the second derivative does not jump.
    pub(crate) fn smooth(&mut self) {
        self.is_smooth = true;
    }

    /// Everything has always stood at `disp`, one value per axis.
    pub(crate) fn rest(&mut self, disp: &[f64]) {
        for (way, disp) in self.ways.iter_mut().zip(disp) {
            *way = Way {
                past: [*disp; PAST],
                goal: *disp,
                ..Way::default()
            };
        }
        self.joined = Some(0.0);
    }

    /// The target is reached: it is the past now, and the next is unknown. Does nothing if there was no target.
    #[inline]
    pub(crate) fn reach(&mut self) {
        if self.joined.take().is_none() {
            return;
        }
        for way in &mut self.ways {
            let [a, b, c, _] = way.past;
            way.past = [way.goal, a, b, c];
            way.vel = [way.goal_vel, way.vel[0]];
        }
    }

    /// The next target is unknown again. Real-time: yes.
    pub(crate) const fn forget(&mut self) {
        self.joined = None;
    }

    /// The next target becomes known at `u`, one displacement and one velocity per step for each axis.
    #[inline]
    pub(crate) fn aim(&mut self, goals: impl Iterator<Item = (f64, f64)>, u: f64) {
        for (way, (goal, vel)) in self.ways.iter_mut().zip(goals) {
            (way.goal, way.goal_vel) = (goal, vel);
        }
        self.joined = Some(u);
    }

    /// The prediction that follows the next target, `u` steps after it. Real-time: yes.
    pub(crate) fn beyond(&self, axis: usize, u: f64) -> PathPoint {
        let way = self.ways.get(axis).copied().unwrap_or_default();
        let [a, b, c, _] = way.past;
        let behind = Way {
            past: [way.goal, a, b, c],
            vel: [way.goal_vel, way.vel[0]],
            ..way
        };
        behind.predict(u, self.order)
    }

    /// True if the next target is known.
    #[must_use]
    pub(crate) const fn is_known(&self) -> bool {
        self.joined.is_some()
    }

    /// One axis at `u`: also beyond now, for who wants to look ahead along a way that is known.
    #[must_use]
    pub(crate) fn at(&self, axis: usize, u: f64) -> PathPoint {
        let Some(way) = self.ways.get(axis) else {
            return PathPoint {
                disp: f64::NAN,
                slope: f64::NAN,
                bend: f64::NAN,
            };
        };
        match self.joined {
            None => way.predict(u, self.order),
            Some(_) if u >= 1.0 => way.at_goal(self.order),
            Some(from) if u > from => way.correct(u, from, self.order, self.is_smooth),
            Some(_) => way.predict(u, self.order),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ORDERS: [Order; 3] = [Order::Linear, Order::Quadratic, Order::Cubic];

    /// A polynomial of degree p is predicted and interpolated exactly by order p: both are unique.
    #[test]
    fn polynomial_of_its_order_is_exact() {
        for (order, degree) in ORDERS.into_iter().zip(1u32..) {
            let truth = |t: f64| {
                (0..=degree)
                    .map(|p| (f64::from(p) + 0.5) * libm::pow(t, f64::from(p)))
                    .sum::<f64>()
            };
            let rate = |t: f64| {
                (1..=degree)
                    .map(|p| f64::from(p) * (f64::from(p) + 0.5) * libm::pow(t, f64::from(p) - 1.0))
                    .sum::<f64>()
            };
            let mut path = Interpolation::new(1, order);
            path.rest(&[truth(0.0)]);
            for k in 1..=5 {
                path.reach();
                path.aim([(truth(f64::from(k) * 0.1), 0.0)].into_iter(), 0.0);
            }
            path.reach();
            for u in [0.0, 0.3, 0.7] {
                let (point, t) = (path.at(0, u), 0.5 + 0.1 * u);
                assert!((point.disp - truth(t)).abs() < 1e-13, "{order:?}");
                assert!((point.slope - 0.1 * rate(t)).abs() < 1e-13, "{order:?}");
            }
            path.aim([(truth(0.6), 0.0)].into_iter(), 0.45);
            for u in [0.45, 0.6, 0.99, 1.0] {
                let (point, t) = (path.at(0, u), 0.5 + 0.1 * u);
                assert!((point.disp - truth(t)).abs() < 1e-13, "{order:?} {u}");
                assert!((point.slope - 0.1 * rate(t)).abs() < 1e-12, "{order:?} {u}");
            }
        }
    }

    proptest! {
        /// At a target and where one becomes known, the ways before and behind have the same value and slope.
        #[test]
        fn value_and_slope_are_continuous(
            which in 0usize..3,
            steps in proptest::collection::vec((-1.0f64..1.0, 0.0f64..0.8), 4..20),
        ) {
            let mut path = Interpolation::new(1, ORDERS[which]);
            path.rest(&[0.3]);
            path.reach();
            // Rounding of slopes up to about 8 over ways as short as 0.2.
            let same = |a: PathPoint, b: PathPoint| (a.disp - b.disp).abs() < 1e-12 && (a.slope - b.slope).abs() < 1e-11;
            for (goal, known_at) in steps {
                let before = path.at(0, known_at);
                path.aim([(goal, 0.0)].into_iter(), known_at);
                let tiny = 1e-9;
                let behind = path.at(0, known_at + tiny);
                prop_assert!(same(path.at(0, known_at), before));
                // The cubic itself: one Taylor step from u₀, second derivative below 6·(8 + 2·8)/0.04.
                prop_assert!((behind.disp - before.disp - tiny * before.slope).abs() < 1e-12);
                prop_assert!((behind.slope - before.slope).abs() < 4e3 * tiny);
                let end = path.at(0, 1.0);
                prop_assert_eq!(end.disp, goal);
                let near = path.at(0, 1.0 - tiny);
                prop_assert!((near.disp - end.disp + tiny * end.slope).abs() < 1e-12);
                prop_assert!((near.slope - end.slope).abs() < 4e3 * tiny);
                path.reach();
                prop_assert!(same(path.at(0, 0.0), end));
            }
        }
    }

    #[test]
    fn shares_of_the_targets_make_the_way() {
        let targets = [0.7, -0.2, 0.4, 1.3, -0.9];
        for order in ORDERS {
            let mut path = Interpolation::new(1, order);
            for target in targets {
                path.reach();
                path.aim([(target, 0.0)].into_iter(), 0.0);
            }
            for share in [0.1, 0.5, 0.9, 1.0] {
                let found = path.at(0, share);
                let all = shares(order, share);
                let sum = |of: fn(&PathPoint) -> f64| -> f64 {
                    let newest_first = targets.iter().rev();
                    all.iter().zip(newest_first).map(|(s, x)| of(s) * x).sum()
                };
                assert!((found.disp - sum(|s| s.disp)).abs() < 1e-13, "{order:?}");
                assert!((found.slope - sum(|s| s.slope)).abs() < 1e-13, "{order:?}");
            }
        }
    }

    proptest! {
        /// A smooth way has the bend of the prediction where the target becomes known, and that of the next one at the target.
        #[test]
        fn smooth_way_has_no_jump(
            which in 0usize..5,
            steps in proptest::collection::vec((-1.0f64..1.0, -3.0f64..3.0, 0.0f64..0.8), 4..20),
        ) {
            let order = [Order::Constant, Order::Linear, Order::Quadratic, Order::Cubic, Order::Velocities][which];
            let mut path = Interpolation::new(1, order);
            path.smooth();
            path.rest(&[0.3]);
            path.reach();
            // Rounding, and Taylor's rest over the tiny distance: third derivatives are below 60·40/0.2³.
            let same = |a: PathPoint, b: PathPoint| {
                (a.disp - b.disp).abs() < 1e-7 && (a.slope - b.slope).abs() < 1e-6 && (a.bend - b.bend).abs() < 1e-2
            };
            let tiny = 1e-9;
            for (goal, vel, known_at) in steps {
                let before = path.at(0, known_at);
                path.aim([(goal, vel)].into_iter(), known_at);
                prop_assert!(same(path.at(0, known_at + tiny), before));
                let near = path.at(0, 1.0 - tiny);
                prop_assert_eq!(path.at(0, 1.0).disp, goal);
                // Slope and bend are the derivatives of the way.
                let [a, b, c] = [-1e-4, 0.0, 1e-4].map(|d| path.at(0, known_at + 0.6 * (1.0 - known_at) + d));
                prop_assert!(((c.disp - a.disp) / 2e-4 - b.slope).abs() < 1e-2, "{b:?}");
                prop_assert!(((c.slope - a.slope) / 2e-4 - b.bend).abs() < 1e-1, "{b:?}");
                path.reach();
                prop_assert!(same(path.at(0, 0.0), near));
                if order == Order::Velocities {
                    prop_assert!((path.at(0, 0.0).slope - vel).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn what_rests_stays_where_it_is() {
        let mut path = Interpolation::new(2, Order::Cubic);
        path.rest(&[0.25, -1.0]);
        path.reach();
        for u in [0.0, 0.5, 0.8] {
            assert_eq!(
                path.at(0, u),
                PathPoint {
                    disp: 0.25,
                    ..PathPoint::default()
                }
            );
            assert_eq!(path.at(1, u).disp, -1.0);
        }
    }
}
