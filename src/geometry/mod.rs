//! The kinematics of a loading unit: from the pose of a platform to the strokes of the actuators that hold it, and back.
//!
//! A rigid platform is held by up to six actuators, each with a pin on the reaction frame and one on the platform. Its pose q
//! is what the structure asks for: translations of a control point in m and rotations in rad, in the plane (`ux`, `uy`, `rz`)
//! or in space (a rotation vector, `rx`, `ry`, `rz`); coordinates that the structure does not drive stay at zero. Then
//!
//! ```text
//! strokes         s(q)            change of the distances between the pins, positive when an actuator gets longer
//! velocities      ṡ = J(q) q̇      J = ∂s/∂q, analytic
//! forces          F = J(q)ᵀ f     so that fᵀ ṡ = Fᵀ q̇ : the work is the same on both sides
//! measured pose   s(q) = s        Newton with J; least squares where there are more actuators than coordinates
//! ```
//!
//! A linear geometry (a matrix of the user's, or J at the reference pose for small displacements) is the same with a J that
//! does not change. Invariants: a [`Placed`] that was made without an error holds finite numbers and a Jacobian of full rank;
//! every loop has a bound; nothing allocates after construction; the result depends on the arguments alone. What cannot be
//! is a [`Fault`], which names the pose; what follows from it is not decided here.
//!
//! ```
//! use gusset::geometry::{Coordinate, GeometrySpec, PlanePins};
//!
//! // Actuators of 4 m along x and of 3 m along y hold a point.
//! let pins = |base_m| PlanePins { base_m, joint_m: [0.0, 0.0], length_m: None };
//! let spec = GeometrySpec {
//!     coordinates: Some(vec![Coordinate::Ux, Coordinate::Uy]),
//!     plane: Some(vec![pins([-4.0, 0.0]), pins([0.0, -3.0])]),
//!     ..GeometrySpec::default()
//! };
//! let geometry = spec.build(1.0).unwrap();
//! let mut placed = geometry.reference();
//! geometry.place(&[0.0, 3.0], &mut placed).unwrap();
//! assert_eq!(placed.strokes()[..2], [1.0, 3.0], "the first is 5 m long now, the second 6 m");
//! let found = { geometry.find(&[1.0, 3.0], &mut geometry.reference()) };
//! assert!(found.is_ok());
//! ```

mod fault;
mod normal;
mod plane;
mod space;
mod spec;

pub use fault::{Fault, Wrong};
pub use spec::{GeometryError, GeometrySpec, LawPlace, PlanePins, SpacePins};

use plane::PlaneArm;
use serde::{Deserialize, Serialize};
use space::SpaceArm;

/// Largest number of actuators, and of coordinates.
pub const MOST: usize = 6;

/// One number for each actuator or coordinate; those that are not there are zero.
type Six = [f64; MOST];

/// Newton's steps; a pose that is not found after so many is none. From a pose a fifth of an actuator's length away it takes
/// five or six.
const MOST_STEPS: usize = 30;
/// Largest step, in shortest actuators and radians: beyond it the Jacobian says nothing.
const LONGEST_STEP: f64 = 0.3;
/// After a Newton step of this size the error, its square, is below roundoff.
const SQUARED_AWAY: f64 = 1e-9;
/// Gauss–Newton steps get shorter by a factor each: this is roundoff.
const ROUNDOFF: f64 = 4.0 * f64::EPSILON;

/// A coordinate of a platform.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Coordinate {
    /// Translation of the control point along x, m.
    Ux,
    /// Along y, m.
    Uy,
    /// Along z, m.
    Uz,
    /// Rotation about x, rad.
    Rx,
    /// About y, rad.
    Ry,
    /// About z, rad.
    Rz,
}

impl Coordinate {
    /// All of them, in the order of a full pose.
    pub const ALL: [Coordinate; MOST] = [
        Coordinate::Ux,
        Coordinate::Uy,
        Coordinate::Uz,
        Coordinate::Rx,
        Coordinate::Ry,
        Coordinate::Rz,
    ];

    /// As files and columns spell it.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Coordinate::Ux => "ux",
            Coordinate::Uy => "uy",
            Coordinate::Uz => "uz",
            Coordinate::Rx => "rx",
            Coordinate::Ry => "ry",
            Coordinate::Rz => "rz",
        }
    }

    /// True if it is an angle.
    #[must_use]
    pub const fn is_rotation(self) -> bool {
        matches!(self, Coordinate::Rx | Coordinate::Ry | Coordinate::Rz)
    }

    /// SI unit.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        if self.is_rotation() { "rad" } else { "m" }
    }

    /// SI unit of what does work on it.
    #[must_use]
    pub const fn force_unit(self) -> &'static str {
        if self.is_rotation() { "N m" } else { "N" }
    }

    /// Its place in a full pose.
    const fn index(self) -> usize {
        self as usize
    }
}

/// How strokes follow from a pose.
#[derive(Debug, Clone)]
enum Form {
    /// By the Jacobian of the reference pose, which is that of every pose.
    Linear,
    /// By the distances between the pins.
    Plane(Vec<PlaneArm>),
    /// The same in space.
    Space(Vec<SpaceArm>),
}

/// The kinematics of one loading unit. Valid once it exists: at the reference pose it is not singular.
#[derive(Debug, Clone)]
pub struct Geometry {
    form: Form,
    actuators: usize,
    coordinates: Vec<Coordinate>,
    /// Pin to pin at the reference pose, m; infinite where it is not known.
    lengths: Six,
    /// Shortest and longest stroke, m; infinite where there is no bound.
    strokes: [[f64; 2]; MOST],
    /// Length in m by which translations are measured, and by which rotations are brought to metres.
    shortest: f64,
    arm: f64,
    reference: Placed,
}

/// Strokes and Jacobian at a pose: made at the reference pose by [`Geometry::reference`], moved by the other functions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Driven coordinates, in their order.
    pose: Six,
    strokes: Six,
    /// One row for each actuator, one column for each driven coordinate.
    jacobian: [Six; MOST],
    /// Of JᵀJ.
    factor: normal::Factor,
}

impl Geometry {
    /// Puts the parts together and looks at the reference pose.
    fn new(
        form: Form,
        coordinates: Vec<Coordinate>,
        actuators: usize,
        lengths: Six,
        strokes: [[f64; 2]; MOST],
        arm: f64,
    ) -> Result<Self, Fault> {
        let shortest = lengths.iter().take(actuators).copied();
        let shortest = shortest.fold(f64::INFINITY, f64::min);
        let reference = Placed {
            pose: [0.0; MOST],
            strokes: [0.0; MOST],
            jacobian: [[0.0; MOST]; MOST],
            factor: normal::Factor::default(),
        };
        let mut geometry = Self {
            form,
            actuators,
            coordinates,
            lengths,
            strokes,
            shortest: if shortest.is_finite() { shortest } else { 1.0 },
            arm: if arm > 0.0 { arm } else { 1.0 },
            reference,
        };
        let mut placed = reference;
        geometry.place(&[0.0; MOST], &mut placed)?;
        geometry.reference = placed;
        Ok(geometry)
    }

    /// A linear geometry with these rows: strokes = rows · pose.
    fn linear(
        rows: &[Six],
        coordinates: Vec<Coordinate>,
        lengths: Six,
        strokes: [[f64; 2]; MOST],
        arm: f64,
    ) -> Result<Self, Fault> {
        let actuators = rows.len();
        let mut geometry = Self {
            form: Form::Linear,
            actuators,
            lengths,
            strokes,
            shortest: 1.0,
            arm: if arm > 0.0 { arm } else { 1.0 },
            reference: Placed {
                pose: [0.0; MOST],
                strokes: [0.0; MOST],
                jacobian: [[0.0; MOST]; MOST],
                factor: normal::Factor::default(),
            },
            coordinates,
        };
        let shortest = lengths.iter().take(actuators).copied();
        let shortest = shortest.fold(f64::INFINITY, f64::min);
        if shortest.is_finite() {
            geometry.shortest = shortest;
        }
        for (to, from) in geometry.reference.jacobian.iter_mut().zip(rows) {
            *to = *from;
        }
        let mut placed = geometry.reference;
        geometry.factor(&mut placed)?;
        geometry.reference = placed;
        Ok(geometry)
    }

    /// The same for small displacements: with the Jacobian of the reference pose.
    ///
    /// # Errors
    /// None that the exact geometry has not: the reference pose is the same.
    pub fn small(&self) -> Result<Self, Fault> {
        Self::linear(
            &self.reference.jacobian[..self.actuators],
            self.coordinates.clone(),
            self.lengths,
            self.strokes,
            self.arm,
        )
    }

    /// Number of actuators.
    #[must_use]
    pub const fn actuators(&self) -> usize {
        self.actuators
    }

    /// The coordinates that are driven, in their order.
    #[must_use]
    pub fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// True if the Jacobian depends on the pose.
    #[must_use]
    pub const fn is_exact(&self) -> bool {
        !matches!(self.form, Form::Linear)
    }

    /// Shortest and longest stroke of an actuator in m, by its `length_m`; infinite where there is no bound.
    #[must_use]
    pub fn stroke_range(&self, actuator: usize) -> [f64; 2] {
        let open = [f64::NEG_INFINITY, f64::INFINITY];
        self.strokes.get(actuator).copied().unwrap_or(open)
    }

    /// Pin to pin at the reference pose, m; none for a matrix of the user's.
    #[must_use]
    pub fn length(&self, actuator: usize) -> Option<f64> {
        let length = self.lengths.get(actuator).copied();
        length.filter(|length| length.is_finite())
    }

    /// The pose zero.
    #[must_use]
    pub const fn reference(&self) -> Placed {
        self.reference
    }

    /// Moves `placed` to a pose: driven coordinates in their order. After an error it stands anywhere. Real-time: yes.
    ///
    /// # Errors
    /// Two pins meet, the Jacobian loses rank, or something is not a finite number. Strokes are not judged: see
    /// [`Geometry::within_reach`].
    pub fn place(&self, pose: &[f64], placed: &mut Placed) -> Result<(), Fault> {
        for (to, from) in placed.pose.iter_mut().zip(pose) {
            *to = *from;
        }
        match &self.form {
            Form::Linear => {
                let rows = self.reference.jacobian.iter().zip(&mut placed.strokes);
                for (row, stroke) in rows.take(self.actuators) {
                    *stroke = dot(row, &placed.pose);
                }
                if placed.strokes.iter().all(|stroke| stroke.is_finite()) {
                    return Ok(());
                }
                return Err(self.fault(Wrong::NotFinite, placed));
            }
            Form::Plane(arms) => {
                let full = self.full(placed);
                let turn = plane::Turn::new(full[Coordinate::Rz.index()]);
                let rows = placed.strokes.iter_mut().zip(&mut placed.jacobian);
                for (index, (arm, (stroke, row))) in arms.iter().zip(rows).enumerate() {
                    let Some((change, by_all)) = arm.at(&full, &turn) else {
                        return Err(self.fault(Wrong::PinsMeet { actuator: index }, placed));
                    };
                    *stroke = change;
                    pick(&self.coordinates, &by_all, row);
                }
            }
            Form::Space(arms) => {
                let full = self.full(placed);
                let turn = space::Turn::new([full[3], full[4], full[5]]);
                let rows = placed.strokes.iter_mut().zip(&mut placed.jacobian);
                for (index, (arm, (stroke, row))) in arms.iter().zip(rows).enumerate() {
                    let Some((change, by_all)) = arm.at(&full, &turn) else {
                        return Err(self.fault(Wrong::PinsMeet { actuator: index }, placed));
                    };
                    *stroke = change;
                    pick(&self.coordinates, &by_all, row);
                }
            }
        }
        self.factor(placed)
    }

    fn factor(&self, placed: &mut Placed) -> Result<(), Fault> {
        let rows = &placed.jacobian[..self.actuators];
        match normal::Factor::of(rows, self.coordinates.len()) {
            Some(factor) => {
                placed.factor = factor;
                Ok(())
            }
            None if placed.jacobian.iter().flatten().all(|v| v.is_finite()) => {
                Err(self.fault(Wrong::Singular, placed))
            }
            None => Err(self.fault(Wrong::NotFinite, placed)),
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

    /// Moves `placed` to the pose in which the actuators have these strokes, from where it stands; with more actuators than
    /// coordinates, to the pose that fits them best. Real-time: yes, at most [`MOST_STEPS`] steps.
    ///
    /// # Errors
    /// There is no such pose near, or the way leads through one that is none.
    pub fn find(&self, strokes: &[f64], placed: &mut Placed) -> Result<(), Fault> {
        let roundoff = if self.actuators > self.coordinates.len() {
            ROUNDOFF
        } else {
            SQUARED_AWAY
        };
        let (mut last, mut pose) = (f64::INFINITY, placed.pose);
        for _ in 0..MOST_STEPS {
            let mut left = [0.0; MOST];
            let both = strokes.iter().zip(&placed.strokes).take(self.actuators);
            for (left, (wanted, found)) in left.iter_mut().zip(both) {
                *left = wanted - found;
            }
            let step = self.motion(placed, &left);
            let mut size = 0.0f64;
            for (coordinate, step) in self.coordinates.iter().zip(&step) {
                let scale = if coordinate.is_rotation() {
                    1.0
                } else {
                    self.shortest
                };
                size = size.max(step.abs() / scale);
                // A NaN is passed over by `max`.
                if !step.is_finite() {
                    return Err(self.fault(Wrong::NotFinite, placed));
                }
            }
            let share = if size > LONGEST_STEP && self.is_exact() {
                LONGEST_STEP / size
            } else {
                1.0
            };
            for (pose, step) in pose.iter_mut().zip(&step) {
                *pose += share * step;
            }
            self.place(&pose, placed)?;
            if size <= roundoff || !self.is_exact() {
                return Ok(());
            }
            // Least squares come to rest where roundoff goes to and fro.
            if size <= SQUARED_AWAY && size >= last {
                return Ok(());
            }
            last = size;
        }
        Err(self.fault(Wrong::NotFound, placed))
    }

    /// q̇ from the actuators' velocities: J⁺ ṡ. Real-time: yes.
    fn motion(&self, placed: &Placed, strokes: &Six) -> Six {
        let mut sums = [0.0; MOST];
        for (row, stroke) in placed.jacobian.iter().zip(strokes).take(self.actuators) {
            for (sum, entry) in sums.iter_mut().zip(row) {
                *sum += entry * stroke;
            }
        }
        placed.factor.solve(&mut sums, self.coordinates.len());
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

    /// A pose in words: "ux = 0.012 m, uy = 0 m, rz = -0.003 rad".
    #[must_use]
    pub fn words(&self, placed: &Placed) -> String {
        fault::words(&self.coordinates, &placed.pose)
    }

    /// Largest over smallest singular value of J with rotations measured at the farthest joint: 1 is best; how much worse a
    /// pose is known, or held, in its weakest direction than in its strongest. Allocates.
    #[must_use]
    pub fn condition(&self, placed: &Placed) -> f64 {
        let (rows, columns) = (self.actuators, self.coordinates.len());
        let scaled = nalgebra::DMatrix::from_fn(rows, columns, |i, j| {
            let turns = self.coordinates[j].is_rotation();
            placed.jacobian[i][j] / if turns { self.arm } else { 1.0 }
        });
        let values = scaled.singular_values();
        values.max() / values.min()
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

impl Placed {
    /// Driven coordinates, in their order; what is beyond their number is zero.
    #[must_use]
    pub const fn pose(&self) -> &[f64; MOST] {
        &self.pose
    }

    /// Strokes of the actuators, m; what is beyond their number is zero.
    #[must_use]
    pub const fn strokes(&self) -> &[f64; MOST] {
        &self.strokes
    }

    /// ∂ stroke / ∂ coordinate.
    #[must_use]
    pub fn slope(&self, actuator: usize, coordinate: usize) -> f64 {
        let row = self.jacobian.get(actuator);
        row.and_then(|row| row.get(coordinate))
            .copied()
            .unwrap_or(0.0)
    }

    /// How far the Jacobian is from losing rank: sine of the angle between what a coordinate does to the actuators and what
    /// the ones before it can do; 1 where they do not know of each other, 0 at a singular pose.
    #[must_use]
    pub fn independence(&self) -> f64 {
        self.factor.least().sqrt()
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

#[cfg(test)]
mod tests;
