//! The way to zero force of a platform: what its law feels is the pose, and there its stiffness is the same everywhere.
//!
//! At the actuators it is not: they turn as the platform goes, and where it is stiff along one and soft along another, a
//! way by the stiffness of the reference pose loads what it should unload. So the way is led in the strokes that small motions
//! would have, and turned into those of the actuators tick by tick:
//!
//! ```text
//! r = J₀ q      forces  J₀⁺ᵀ J(q)ᵀ f      stiffness  the declared one, for every pose
//! ```
//!
//! Real-time: yes.

use gusset_actuator::geometry::{Fault, Geometry, MOST, Placed};
use gusset_quantity::frame::AtStructure;

/// Where a platform is led to, and where it was measured.
#[derive(Debug)]
pub(crate) struct PlatformUnloading {
    reference: Placed,
    led: Placed,
    seen: Placed,
    /// How much more an actuator may go than the strokes of small motions, at most.
    steepest: f64,
    /// The longest way of each actuator in one tick, m.
    longest: [f64; MOST],
}

impl PlatformUnloading {
    /// From these strokes in m on.
    ///
    /// # Errors
    /// No pose belongs to them.
    pub(crate) fn new(geometry: &Geometry, strokes: AtStructure<&[f64]>) -> Result<Self, Fault> {
        let reference = geometry.reference();
        let mut led = reference;
        geometry.find(&strokes, &mut led)?;
        let mut sums = [0.0; MOST];
        for unit in 0..geometry.actuators() {
            let (mut one, mut rates, mut turned) = ([0.0; MOST], [0.0; MOST], [0.0; MOST]);
            if let Some(one) = one.get_mut(unit) {
                *one = 1.0;
            }
            geometry.pose_rates(&reference, &one, &mut rates);
            geometry.stroke_rates(&led, &rates, &mut turned);
            for (sum, turned) in sums.iter_mut().zip(turned) {
                *sum += turned.abs();
            }
        }
        Ok(Self {
            reference,
            led,
            seen: led,
            steepest: sums.into_iter().fold(1.0, f64::max),
            longest: [f64::INFINITY; MOST],
        })
    }

    /// By so much shorter are steps of small motions, so that no actuator goes farther than `longest`, in m, in one tick.
    pub(crate) fn slower(&mut self, longest: impl Iterator<Item = f64>) -> f64 {
        for (most, longest) in self.longest.iter_mut().zip(longest) {
            *most = longest;
        }
        1.0 / self.steepest
    }

    /// Forces of small motions from those of the actuators at the pose that is led.
    pub(crate) fn forces(&self, geometry: &Geometry, forces: &[f64]) -> [f64; MOST] {
        turned(geometry, [&self.reference, &self.led], forces)
    }

    /// Strokes in m and forces in N of small motions, from those that were measured.
    ///
    /// # Errors
    /// No pose belongs to them.
    pub(crate) fn answer(
        &mut self,
        geometry: &Geometry,
        measured: impl Iterator<Item = (f64, f64)>,
    ) -> Result<impl Iterator<Item = (f64, f64)>, Fault> {
        let (mut strokes, mut forces) = ([0.0; MOST], [0.0; MOST]);
        for ((stroke, force), measured) in strokes.iter_mut().zip(&mut forces).zip(measured) {
            (*stroke, *force) = measured;
        }
        geometry.find_for_forces(&strokes, &mut self.seen)?;
        let mut small = [0.0; MOST];
        geometry.stroke_rates(&self.reference, self.seen.pose(), &mut small);
        let forces = turned(geometry, [&self.reference, &self.seen], &forces);
        Ok(small.into_iter().zip(forces))
    }

    /// Goes back by these strokes of small motions; by how much each actuator goes back, in m. Stays where the next pose cannot be.
    pub(crate) fn go_back(
        &mut self,
        geometry: &Geometry,
        steps: impl Iterator<Item = f64>,
    ) -> [f64; MOST] {
        let (mut small, mut rates) = ([0.0; MOST], [0.0; MOST]);
        for (small, step) in small.iter_mut().zip(steps) {
            *small = step;
        }
        geometry.pose_rates(&self.reference, &small, &mut rates);
        let mut back = [0.0; MOST];
        let mut part = 1.0;
        // The strokes are nearly straight within a tick: the second time is within the bound, but for curvature.
        for _ in 0..2 {
            let mut pose = *self.led.pose();
            for (pose, rate) in pose.iter_mut().zip(rates) {
                *pose -= part * rate;
            }
            let mut next = self.led;
            let placed = geometry.place(&pose, &mut next);
            if placed.and_then(|()| geometry.within_reach(&next)).is_err() {
                return [0.0; MOST];
            }
            let mut over: f64 = 1.0;
            let ends = self.led.strokes().iter().zip(next.strokes());
            for ((back, (from, to)), longest) in back.iter_mut().zip(ends).zip(self.longest) {
                *back = from - to;
                over = over.max(back.abs() / longest);
            }
            if over <= 1.0 {
                self.led = next;
                return back;
            }
            part *= (1.0 - 1e-6) / over;
        }
        [0.0; MOST]
    }
}

/// J₀⁺ᵀ Jᵀ f: the forces of small motions that do the same work on a motion of the platform.
fn turned(geometry: &Geometry, [reference, at]: [&Placed; 2], forces: &[f64]) -> [f64; MOST] {
    let (mut pose_forces, mut turned) = ([0.0; MOST], [0.0; MOST]);
    let n = geometry.coordinates().len();
    if let Some(pose_forces) = pose_forces.get_mut(..n) {
        geometry.pose_forces(at, forces, pose_forces);
    }
    geometry.stroke_forces(reference, &pose_forces, &mut turned);
    turned
}
