//! `[excitation]`: ground motion, forces and prescribed displacements.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ground::{GroundDirection, GroundMotions};
use gusset_motion::{Processing, Scaling, Signal};

/// Excitation of the structure, or of the specimens in a test without a structure. Several
/// contributions are added.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExcitationTable {
    /// Ground acceleration in m/s², with the structure in relative coordinates: F = −M·ι·a_g. One table,
    /// or a list `[[excitation.ground_acceleration]]` with one table for each component.
    #[serde(skip_serializing_if = "GroundMotions::is_empty")]
    pub ground_acceleration: GroundMotions,
    /// Angle by which the components x and y are turned in plan, from x to y, before they act. a_x cos θ −
    /// a_y sin θ acts in x, a_x sin θ + a_y cos θ in y.
    #[schemars(example = 30.0)]
    pub incident_angle_deg: Option<f64>,
    /// One factor for all components of the ground acceleration.
    pub scaling: Option<Scaling>,
    /// Base displacement in m, with the structure in absolute coordinates: F = K·ι·x_g + C·ι·v_g.
    pub base_displacement: Option<GroundTable>,
    /// Displacements of supports of a frame in m, with the frame in absolute coordinates:
    /// F = −K_fs·x_s + C·R·v_s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub support_motion: Vec<SupportMotionTable>,
    /// Forces on DOFs that follow one time history.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nodal_force: Vec<NodalForceTable>,
    /// Forces on all DOFs, read from a table.
    pub nodal_table: Option<NodalFileTable>,
    /// Displacement of an axis of a specimen, for a test without a structure.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub prescribed_displacement: Vec<PrescribedTable>,
}

/// Motion of the base.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroundTable {
    /// Time history of the motion.
    pub signal: Signal,
    /// Processing of the time history before the test, for example scaling.
    #[serde(default)]
    pub processing: Processing,
    /// Influence vector ι, one number for each DOF. Default: the influence vector of the structure.
    /// A base displacement accepts only that default.
    #[schemars(example = [1.0, 1.0, 0.0])]
    pub influence: Option<Vec<f64>>,
}

/// Displacement of supports of a frame. Give exactly one of `node` and `nodes`. Members at a moving support
/// must be elastic, without hinges and without `p_delta`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SupportMotionTable {
    /// Name of the node that moves. It must be fixed in the direction.
    #[schemars(example = &"B1")]
    pub node: Option<String>,
    /// Names of nodes that move alike.
    #[schemars(example = ["B1", "B2"])]
    pub nodes: Option<Vec<String>>,
    /// Direction of the motion: "x" or "y".
    #[schemars(example = &"x")]
    pub direction: GroundDirection,
    /// Time history of the displacement.
    pub signal: Signal,
    /// Processing of the time history before the test. `displacement` makes it of an acceleration.
    #[serde(default)]
    pub processing: Processing,
}

impl SupportMotionTable {
    /// Names of the nodes.
    pub fn named(&self) -> impl Iterator<Item = &str> {
        let all = self.nodes.iter().flatten().chain(&self.node);
        all.map(String::as_str)
    }
}

/// Force on DOFs with one time history. Give exactly one of `dofs` and `pattern`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodalForceTable {
    /// Numbers of the DOFs on which the force acts, from 1. The full force acts on each of them.
    #[schemars(example = [3])]
    pub dofs: Option<Vec<usize>>,
    /// Factor of the force for each DOF.
    #[schemars(example = [0.2, 0.5, 1.0])]
    pub pattern: Option<Vec<f64>>,
    /// Time history of the force, in N unless the signal has its own `unit`.
    pub signal: Signal,
    /// Processing of the time history before the test, for example scaling.
    #[serde(default)]
    pub processing: Processing,
}

/// Forces from a table with one column for each DOF and one row for each step from t = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodalFileTable {
    /// File (.csv or .npy) that contains the forces, relative to the test file.
    #[schemars(example = &"forces.csv")]
    pub file: String,
    /// Factor that converts the numbers of the file to N.
    #[serde(default = "unity")]
    #[schemars(example = 1000.0)]
    pub scale: f64,
}

/// Prescribed displacement of one axis of one specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PrescribedTable {
    /// Name of the specimen.
    pub specimen: String,
    /// Number of the axis, from 1.
    #[serde(default = "first")]
    #[schemars(range(min = 1))]
    #[schemars(example = 1)]
    pub axis: usize,
    /// Meaning of `axis` for a specimen with `geometry`: a coordinate of its platform, or an
    /// actuator.
    #[serde(default, skip_serializing_if = "PrescribedPlace::is_platform")]
    #[schemars(example = &"actuators")]
    pub at: PrescribedPlace,
    /// Time history of the displacement, in m or rad unless the signal has its own `unit`.
    pub signal: Signal,
    /// Processing of the time history before the test, for example scaling.
    #[serde(default)]
    pub processing: Processing,
    /// Time over which the motion grows smoothly from zero at the start of the test.
    #[serde(default)]
    pub ease_in_s: f64,
    /// Time over which the motion returns smoothly to zero before the end of the test.
    #[serde(default)]
    #[schemars(example = 2.0)]
    pub ease_out_s: f64,
}

/// Prescribed quantity of a loading unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PrescribedPlace {
    /// Coordinate of the platform. All actuators move as this motion requires.
    #[default]
    Platform,
    /// Stroke of an actuator, positive when it extends. Actuators without a prescribed stroke keep
    /// their length. The specimen must not have more actuators than coordinates.
    Actuators,
}

impl PrescribedPlace {
    fn is_platform(&self) -> bool {
        *self == Self::Platform
    }
}

const fn unity() -> f64 {
    1.0
}

const fn first() -> usize {
    1
}
