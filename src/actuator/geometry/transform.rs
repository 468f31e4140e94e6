//! Conversion of a pose to strokes, of strokes to a pose, and of velocities and forces between them. All of it is on the
//! real-time path.

use super::{Coordinate, Fault, Form, Geometry, MOST, Placed, Six, Wrong, plane, space};

/// Newton's steps; a pose that is not found after this many does not exist. From a pose a fifth of an actuator's length away
/// it takes five or six.
const MOST_STEPS: usize = 30;
/// Largest step, in shortest actuators and radians: the Jacobian is not valid beyond it.
const LONGEST_STEP: f64 = 0.3;
/// After a Newton step of this size the error is about its square; one more step with the old Jacobian removes the rest.
const SQUARED_AWAY: f64 = 1e-7;
/// Gauss–Newton steps get shorter by a factor each: this is roundoff.
const ROUNDOFF: f64 = 4.0 * f64::EPSILON;

impl Geometry {
    /// Moves `placed` to a pose: driven coordinates in their order. After an error its pose is arbitrary. Real-time:
    /// yes.
    ///
    /// # Errors
    /// Two pins meet, the Jacobian loses rank, or something is not a finite number. Strokes are not judged: see
    /// [`Geometry::within_reach`].
    pub fn place(&self, pose: &[f64], placed: &mut Placed) -> Result<(), Fault> {
        self.measure(pose, placed)?;
        if self.is_exact() {
            self.factor(placed)?;
        }
        Ok(())
    }

    /// Like `place`, but without the quantities of [`Geometry::stroke_forces`] and [`Geometry::pose_rates`]. Real-time:
    /// yes.
    fn measure(&self, pose: &[f64], placed: &mut Placed) -> Result<(), Fault> {
        let n = self.coordinates.len();
        for (to, from) in placed.pose.iter_mut().zip(pose) {
            *to = *from;
        }
        match &self.form {
            Form::Linear => {
                let rows = self.reference.jacobian.iter().zip(&mut placed.strokes);
                for (row, stroke) in rows.take(self.actuators) {
                    *stroke = dot(row, &placed.pose[..n]);
                }
                if placed.strokes.iter().all(|stroke| stroke.is_finite()) {
                    return Ok(());
                }
                Err(self.fault(Wrong::NotFinite, placed))
            }
            Form::Plane(arms) => {
                let full = self.full(placed);
                let turn = plane::Turn::new(full[Coordinate::Rz.index()]);
                self.lay(arms.iter().map(|arm| arm.at(&full, &turn)), placed)
            }
            Form::Space(arms) => {
                let full = self.full(placed);
                let turn = space::Turn::new([full[3], full[4], full[5]]);
                self.lay(arms.iter().map(|arm| arm.at(&full, &turn)), placed)
            }
        }
    }

    /// Strokes and their derivatives, actuator after actuator; none where its pins meet. Real-time: yes.
    fn lay(
        &self,
        arms: impl Iterator<Item = Option<(f64, Six)>>,
        placed: &mut Placed,
    ) -> Result<(), Fault> {
        let rows = placed.strokes.iter_mut().zip(&mut placed.jacobian);
        for (index, (found, (stroke, row))) in arms.zip(rows).enumerate() {
            let Some((change, by_all)) = found else {
                return Err(self.fault(Wrong::PinsMeet { actuator: index }, placed));
            };
            *stroke = change;
            pick(&self.coordinates, &by_all, row);
        }
        Ok(())
    }

    pub(super) fn factor(&self, placed: &mut Placed) -> Result<(), Fault> {
        let rows = &placed.jacobian[..self.actuators];
        let columns = self.coordinates.len();
        if placed.factor.remake(rows, columns, &self.weights) {
            Ok(())
        } else if rows.iter().flatten().all(|entry| entry.is_finite()) {
            Err(self.fault(Wrong::Singular, placed))
        } else {
            Err(self.fault(Wrong::NotFinite, placed))
        }
    }

    /// Whether the actuators can be as long as that. Real-time: yes.
    ///
    /// # Errors
    /// The first actuator whose `length_m` does not allow it.
    pub fn within_reach(&self, placed: &Placed) -> Result<(), Fault> {
        let all = placed
            .strokes
            .iter()
            .zip(&self.strokes)
            .take(self.actuators);
        for (actuator, (stroke, [least, most])) in all.enumerate() {
            if !(stroke >= least && stroke <= most) {
                let bound = if stroke > most { *most } else { *least };
                let wrong = Wrong::OutOfReach {
                    actuator,
                    stroke: *stroke,
                    bound,
                };
                return Err(self.fault(wrong, placed));
            }
        }
        Ok(())
    }

    /// Moves `placed` from its present pose to the pose in which the actuators have these strokes; with more actuators than
    /// coordinates, to the pose that fits them best. Real-time: yes, at most `MOST_STEPS` steps.
    ///
    /// # Errors
    /// There is no such pose near, or the path leads through an impossible one.
    pub fn find(&self, strokes: &[f64], placed: &mut Placed) -> Result<(), Fault> {
        self.find_for_forces(strokes, placed)?;
        if self.is_exact() {
            self.factor(placed)?;
        }
        Ok(())
    }

    /// Like [`Geometry::find`], but quicker: only [`Geometry::pose_forces`] and [`Geometry::stroke_rates`] are valid
    /// afterwards. Real-time: yes.
    ///
    /// # Errors
    /// As [`Geometry::find`].
    pub fn find_for_forces(&self, strokes: &[f64], placed: &mut Placed) -> Result<(), Fault> {
        let redundant = self.actuators > self.coordinates.len();
        let (mut last, mut pose) = (f64::INFINITY, placed.pose);
        for _ in 0..MOST_STEPS {
            let step = self.motion(placed, &self.left(strokes, placed));
            let size = self.size(&step);
            if !size.is_finite() {
                return Err(self.fault(Wrong::NotFinite, placed));
            }
            let share = if size > LONGEST_STEP && self.is_exact() {
                LONGEST_STEP / size
            } else {
                1.0
            };
            for (pose, step) in pose.iter_mut().zip(&step) {
                *pose += share * step;
            }
            self.measure(&pose, placed)?;
            if !self.is_exact() {
                return Ok(());
            }
            if size <= SQUARED_AWAY && !redundant {
                // The error is a few roundoffs at most; the Jacobian of here is that of the pose to as many digits.
                let rest = self.motion(placed, &self.left(strokes, placed));
                for (pose, rest) in placed.pose.iter_mut().zip(&rest) {
                    *pose += rest;
                }
                return Ok(());
            }
            // Least squares stop where roundoff alternates.
            if redundant && (size <= ROUNDOFF || (size <= SQUARED_AWAY && size >= last)) {
                return Ok(());
            }
            last = size;
            self.factor(placed)?;
        }
        Err(self.fault(Wrong::NotFound, placed))
    }

    /// The residual of the strokes. Real-time: yes.
    fn left(&self, strokes: &[f64], placed: &Placed) -> Six {
        let mut left = [0.0; MOST];
        let both = strokes.iter().zip(&placed.strokes).take(self.actuators);
        for (left, (wanted, found)) in left.iter_mut().zip(both) {
            *left = wanted - found;
        }
        left
    }

    /// Size of a step in shortest actuators and radians; infinite if it is NaN or infinite. Real-time: yes.
    fn size(&self, step: &Six) -> f64 {
        let mut size = 0.0f64;
        for (coordinate, step) in self.coordinates.iter().zip(step) {
            let step = if coordinate.is_rotation() {
                step.abs()
            } else {
                step.abs() / self.shortest
            };
            // A NaN is passed over by `max`.
            size = if step <= size { size } else { step };
            if step.is_nan() {
                return f64::INFINITY;
            }
        }
        size
    }

    /// q̇ from the actuators' velocities: J⁺ ṡ. Real-time: yes.
    fn motion(&self, placed: &Placed, strokes: &Six) -> Six {
        let n = self.coordinates.len();
        let mut sums = [0.0; MOST];
        for (row, stroke) in placed.jacobian.iter().zip(strokes).take(self.actuators) {
            for (sum, entry) in sums.iter_mut().zip(row).take(n) {
                *sum += entry * stroke;
            }
        }
        placed.factor.solve(&mut sums, n);
        sums
    }

    /// Velocities of the coordinates from those of the actuators, J⁺ ṡ. Real-time: yes.
    pub fn pose_rates(&self, placed: &Placed, strokes: &[f64], rates: &mut [f64]) {
        let mut given = [0.0; MOST];
        for (to, from) in given.iter_mut().zip(strokes) {
            *to = *from;
        }
        for (to, from) in rates.iter_mut().zip(self.motion(placed, &given)) {
            *to = from;
        }
    }

    /// Velocities of the actuators, J q̇. Real-time: yes.
    pub fn stroke_rates(&self, placed: &Placed, rates: &[f64], strokes: &mut [f64]) {
        let rates = rates.get(..self.coordinates.len()).unwrap_or(rates);
        for (to, row) in strokes.iter_mut().zip(&placed.jacobian) {
            *to = dot(row, rates);
        }
    }

    /// Forces of the coordinates in N and N m from those of the actuators, Jᵀ f. Real-time: yes.
    pub fn pose_forces(&self, placed: &Placed, actuators: &[f64], forces: &mut [f64]) {
        for (column, force) in forces.iter_mut().enumerate() {
            let mut sum = 0.0;
            for (row, actuator) in placed.jacobian.iter().zip(actuators) {
                if let Some(entry) = row.get(column) {
                    sum += entry * actuator;
                }
            }
            *force = sum;
        }
    }

    /// Forces of the actuators that are in balance with those of the coordinates, the smallest ones where there are more
    /// actuators than coordinates: J (JᵀJ)⁻¹ F. Real-time: yes.
    pub fn stroke_forces(&self, placed: &Placed, forces: &[f64], actuators: &mut [f64]) {
        let mut sums = [0.0; MOST];
        for (to, from) in sums.iter_mut().zip(forces) {
            *to = *from;
        }
        placed.factor.solve(&mut sums, self.coordinates.len());
        for (to, row) in actuators.iter_mut().zip(&placed.jacobian) {
            *to = dot(row, &sums);
        }
    }

    fn full(&self, placed: &Placed) -> Six {
        let mut full = [0.0; MOST];
        for (coordinate, value) in self.coordinates.iter().zip(&placed.pose) {
            full[coordinate.index()] = *value;
        }
        full
    }

    fn fault(&self, wrong: Wrong, placed: &Placed) -> Fault {
        Fault::new(wrong, &self.coordinates, &placed.pose)
    }
}

/// Real-time: yes.
fn dot(row: &Six, values: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in row.iter().zip(values) {
        sum += a * b;
    }
    sum
}

/// The columns of driven coordinates. Real-time: yes.
fn pick(coordinates: &[Coordinate], all: &Six, row: &mut Six) {
    for (to, coordinate) in row.iter_mut().zip(coordinates) {
        *to = all[coordinate.index()];
    }
}
