//! The kinematics of a loading unit: from the pose of a platform to the strokes of the actuators that hold it, and back.
//!
//! A rigid platform is held by up to six actuators, each with a pin on the reaction frame and one on the platform. The
//! structure commands its pose q: translations of a control point in m and rotations in rad, in the plane (`ux`, `uy`, `rz`)
//! or in space (a rotation vector, `rx`, `ry`, `rz`). Coordinates that the structure does not drive stay at zero. Then
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
//! every loop has a bound; nothing allocates after construction; the result depends on the arguments alone. An impossible
//! pose is a [`Fault`], which names it; the reaction to it is not decided here.
//!
//! ```
//! use gusset_actuator::geometry::{Coordinate, GeometrySpec, PlanePins};
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
//! let [first, second, ..] = *placed.strokes();
//! assert!((first - 1.0).abs() < 1e-15 && (second - 3.0).abs() < 1e-15, "5 m and 6 m long now");
//! let found = { geometry.find(&[1.0, 3.0], &mut geometry.reference()) };
//! assert!(found.is_ok());
//! ```

mod error;
mod fault;
mod normal;
mod plane;
mod space;
mod spec;
mod transform;

pub use error::GeometryError;
pub use fault::{Fault, Wrong};
pub use spec::{GeometrySpec, LawPlace, PlanePins, SpacePins};

use plane::PlaneArm;
use serde::{Deserialize, Serialize};
use space::SpaceArm;

use gusset_quantity::state;

/// Largest number of actuators, and of coordinates.
pub const MOST: usize = 6;

/// One number for each actuator or coordinate; those that are not there are zero.
type Six = [f64; MOST];

/// Coordinate of a platform.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Coordinate {
    /// Translation of the control point along x, in m.
    Ux,
    /// Translation of the control point along y, in m.
    Uy,
    /// Translation of the control point along z, in m.
    Uz,
    /// Rotation about x, in rad.
    Rx,
    /// Rotation about y, in rad.
    Ry,
    /// Rotation about z, in rad.
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
    /// Actuators in space.
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
    /// 1 for a translation, 1/arm² for a rotation.
    weights: Six,
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

state! { Placed as "placed" { pose, strokes, jacobian, factor } }

impl Geometry {
    /// Everything but the reference pose.
    fn begun(
        form: Form,
        coordinates: Vec<Coordinate>,
        actuators: usize,
        lengths: Six,
        strokes: [[f64; 2]; MOST],
        arm: f64,
    ) -> Self {
        let shortest = lengths.iter().take(actuators).copied();
        let shortest = shortest.fold(f64::INFINITY, f64::min);
        let arm = if arm > 0.0 { arm } else { 1.0 };
        let mut weights = [1.0; MOST];
        for (weight, coordinate) in weights.iter_mut().zip(&coordinates) {
            if coordinate.is_rotation() {
                *weight = 1.0 / (arm * arm);
            }
        }
        Self {
            form,
            actuators,
            coordinates,
            lengths,
            strokes,
            shortest: if shortest.is_finite() { shortest } else { 1.0 },
            arm,
            weights,
            reference: Placed {
                pose: [0.0; MOST],
                strokes: [0.0; MOST],
                jacobian: [[0.0; MOST]; MOST],
                factor: normal::Factor::default(),
            },
        }
    }

    /// Puts the parts together and looks at the reference pose.
    fn new(
        form: Form,
        coordinates: Vec<Coordinate>,
        actuators: usize,
        lengths: Six,
        strokes: [[f64; 2]; MOST],
        arm: f64,
    ) -> Result<Self, Fault> {
        let mut geometry = Self::begun(form, coordinates, actuators, lengths, strokes, arm);
        let mut placed = geometry.reference;
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
        let mut geometry = Self::begun(Form::Linear, coordinates, actuators, lengths, strokes, arm);
        let mut placed = geometry.reference;
        for (to, from) in placed.jacobian.iter_mut().zip(rows) {
            *to = *from;
        }
        geometry.factor(&mut placed)?;
        geometry.reference = placed;
        Ok(geometry)
    }

    /// A transformation for small displacements, with the Jacobian of the reference pose.
    ///
    /// # Errors
    /// None that the exact geometry has not: the reference pose is the same.
    pub(crate) fn small(&self) -> Result<Self, Fault> {
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
}

impl Placed {
    /// Driven coordinates, in their order; entries beyond their number are zero.
    #[must_use]
    pub const fn pose(&self) -> &[f64; MOST] {
        &self.pose
    }

    /// Strokes of the actuators, m; entries beyond their number are zero.
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
            .unwrap_or(f64::NAN)
    }

    /// How far the Jacobian is from losing rank: what the actuators feel of the coordinate that they hold worst over what they
    /// feel of the best held one. 0 at a singular pose, about one over [`Geometry::condition`] near it.
    #[must_use]
    pub fn independence(&self) -> f64 {
        self.factor.least().sqrt()
    }
}

#[cfg(test)]
mod tests;
