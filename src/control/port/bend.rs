//! The way of a loading unit from one place to another, before and after the test.
//!
//! If every actuator went straight from stroke to stroke, the platform would go along a curve, and what is stiff in one direction, a
//! column along its axis, would feel how far that is from the way between the two poses. So the platform goes straight, and the
//! strokes along a bend:
//!
//! ```text
//! bend(w) = s(q₀ + w (q₁ − q₀)) − (1 − w) s(q₀) − w s(q₁)      w from 0 to 1
//! ```
//!
//! It is zero at both ends: what strokes have beside poses, by a compensator or where there are more of them than coordinates,
//! goes straight as before. Where the poses in between cannot be, all of it does.

use gusset_actuator::geometry::{Fault, Geometry, MOST, Placed};
use gusset_quantity::frame::AtStructure;

/// Parts of a way after each of which it is looked at before it is gone.
const PARTS: u32 = 16;

/// One way. Real-time: yes.
#[derive(Debug)]
pub(super) struct Bend {
    ends: [Placed; 2],
    at: Placed,
    is_possible: bool,
    /// Of each stroke its largest change per change of w, m.
    steepest: [f64; MOST],
}

impl Bend {
    /// None yet, of a loading unit that stands at `reference`.
    pub(crate) const fn new(reference: Placed) -> Self {
        Self {
            ends: [reference; 2],
            at: reference,
            is_possible: false,
            steepest: [0.0; MOST],
        }
    }

    /// The next way leads from the first of these strokes, in m, to the second.
    pub(crate) fn begin(&mut self, geometry: &Geometry, strokes: [AtStructure<&[f64]>; 2]) {
        // In a linear geometry straight strokes are straight poses.
        self.is_possible = geometry.is_exact();
        self.steepest = [0.0; MOST];
        self.is_possible = self.is_possible && self.look(geometry, strokes).is_ok();
    }

    fn look(
        &mut self,
        geometry: &Geometry,
        strokes: [AtStructure<&[f64]>; 2],
    ) -> Result<(), Fault> {
        let mut placed = geometry.reference();
        for (end, strokes) in self.ends.iter_mut().zip(strokes) {
            geometry.find(&strokes, &mut placed)?;
            // Its strokes to the last bit, so that nothing is left of the bend there.
            let pose = *placed.pose();
            geometry.place(&pose, &mut placed)?;
            *end = placed;
        }
        for part in 0..=PARTS {
            let slopes = self.go(geometry, f64::from(part) / f64::from(PARTS))?;
            geometry.within_reach(&self.at)?;
            for (most, slope) in self.steepest.iter_mut().zip(slopes) {
                *most = most.max(slope.abs());
            }
        }
        Ok(())
    }

    /// Goes to a share of the way; what each stroke changes there per change of it, m.
    fn go(&mut self, geometry: &Geometry, way: f64) -> Result<[f64; MOST], Fault> {
        let [from, to] = self.ends.map(|end| *end.pose());
        let (mut pose, mut rates, mut slopes) = (from, [0.0; MOST], [0.0; MOST]);
        let each = pose.iter_mut().zip(&mut rates);
        for ((pose, rate), to) in each.zip(to) {
            *rate = to - *pose;
            *pose += way * *rate;
        }
        geometry.place(&pose, &mut self.at)?;
        geometry.stroke_rates(&self.at, &rates, &mut slopes);
        Ok(slopes)
    }

    /// Bend at a share `way` of the way, and its change per change of that, per actuator in m; none where strokes go straight.
    pub(crate) fn at(
        &mut self,
        geometry: &Geometry,
        way: f64,
    ) -> Option<impl Iterator<Item = (f64, f64)> + use<>> {
        if !self.is_possible {
            return None;
        }
        let slopes = self.go(geometry, way).ok()?;
        let [from, to] = self.ends.map(|end| *end.strokes());
        let all = self.at.strokes().iter().copied().zip(slopes);
        let mut bends = [(0.0, 0.0); MOST];
        for (bend, ((stroke, slope), (from, to))) in
            bends.iter_mut().zip(all.zip(from.into_iter().zip(to)))
        {
            *bend = (
                stroke - ((1.0 - way) * from + way * to),
                slope - (to - from),
            );
        }
        Some(bends.into_iter())
    }

    /// Largest change of the stroke of an actuator per change of the share of the way, m; 0 where strokes go straight.
    pub(crate) fn steepest(&self, actuator: usize) -> f64 {
        let steepest = self.steepest.get(actuator).copied();
        steepest.filter(|_| self.is_possible).unwrap_or(0.0)
    }
}
