//! The tables of a test file that say what moves it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::motion::{Processing, Signal};

/// What moves the structure, or the specimens where there is none. Contributions add up.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExcitationTable {
    /// Acceleration of the ground in m/s², the structure in relative coordinates: F = −M·ι·a_g.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground_acceleration: Option<GroundTable>,
    /// Displacement of the base in m, the structure in absolute coordinates: F = K·ι·x_g + C·ι·v_g.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_displacement: Option<GroundTable>,
    /// Forces on DOFs that share one history.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nodal_force: Vec<NodalForceTable>,
    /// Forces on every DOF from a table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodal_table: Option<NodalFileTable>,
    /// Displacement of a specimen's axis in m, for a test without a structure.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub prescribed_displacement: Vec<PrescribedTable>,
}

/// A motion of the ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroundTable {
    /// The history.
    pub signal: Signal,
    /// What is done to it before the test.
    #[serde(default)]
    pub processing: Processing,
    /// Influence vector ι, one number per DOF. Default: ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub influence: Option<Vec<f64>>,
}

/// A force history on some DOFs: exactly one of `dofs` and `pattern` is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodalForceTable {
    /// DOFs, from 1, that each take the whole force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dofs: Option<Vec<usize>>,
    /// Factor of the force for every DOF.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pattern: Option<Vec<f64>>,
    /// The history, in N.
    pub signal: Signal,
    /// What is done to it before the test.
    #[serde(default)]
    pub processing: Processing,
}

/// Forces from a table: one column per DOF, one row per step from t = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodalFileTable {
    /// The file (.csv, .npy), relative to the test file.
    pub file: String,
    /// Factor that makes N of its numbers.
    #[serde(default = "unity")]
    pub scale: f64,
}

/// A prescribed displacement of one axis of one specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PrescribedTable {
    /// Name of the specimen.
    pub specimen: String,
    /// Axis, from 1.
    #[serde(default = "first")]
    #[schemars(range(min = 1))]
    pub axis: usize,
    /// What `axis` counts where the specimen has a `geometry`: coordinates of its platform, or its actuators.
    #[serde(default, skip_serializing_if = "PrescribedPlace::is_platform")]
    pub at: PrescribedPlace,
    /// The history, in m; in rad for a coordinate that is an angle.
    pub signal: Signal,
    /// What is done to it before the test.
    #[serde(default)]
    pub processing: Processing,
    /// Time in s over which the motion grows from zero.
    #[serde(default)]
    pub ease_in_s: f64,
    /// Time in s over which the motion returns to zero before the end of the test.
    #[serde(default)]
    pub ease_out_s: f64,
}

/// What of a loading unit is prescribed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PrescribedPlace {
    /// A coordinate of the platform: all actuators move as it needs.
    #[default]
    Platform,
    /// The stroke of an actuator, positive as it gets longer: every other one keeps its length unless it is prescribed
    /// likewise, and the platform moves as that needs. Only where there are no more actuators than coordinates.
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
