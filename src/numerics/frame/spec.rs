//! A plane frame as a test file describes it. Plain data; [`super::build`] makes a model of it.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Plane frame: nodes in the x–y plane, elastic members between them, constraints and static loads.
/// y points upwards, and rotations are positive from x to y. DOFs are the free directions of the
/// nodes, in the order of the nodes and of x, y, rz. `gusset check --verbose` lists them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameSpec {
    /// Nodes, one `[[structure.frame.node]]` table each.
    pub node: Vec<NodeSpec>,
    /// Cross-sections, by their names.
    #[serde(default)]
    pub section: BTreeMap<String, SectionSpec>,
    /// Members, one `[[structure.frame.member]]` table each.
    #[serde(default)]
    pub member: Vec<MemberSpec>,
    /// Constraints between nodes, one `[[structure.frame.constraint]]` table each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constraint: Vec<ConstraintSpec>,
    /// Static loads, one `[[structure.frame.load]]` table each. They are applied before t = 0 and
    /// stay constant.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub load: Vec<NodeLoadSpec>,
}

/// Node of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeSpec {
    /// Name of the node, unique in the frame.
    #[schemars(example = &"B1")]
    pub name: String,
    /// Coordinates x and y.
    #[schemars(example = [6.0, 3.5])]
    pub at_m: [f64; 2],
    /// Mass in x and y. A direction without mass follows the others statically. Default: 0.
    #[serde(default)]
    #[schemars(example = 30e3)]
    pub mass_kg: f64,
    /// Mass moment of inertia. Default: 0.
    #[serde(default)]
    #[schemars(example = 500.0)]
    pub rotary_mass_kg_m2: f64,
    /// Directions that the ground holds. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["x", "y", "rz"])]
    pub fixed: Vec<Direction>,
}

/// Direction of a node: "x", "y" or "rz".
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Displacement to the right.
    X,
    /// Displacement upwards.
    Y,
    /// Rotation from x to y.
    Rz,
}

impl Direction {
    /// All of them, in the order of the DOFs.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Rz];

    /// As a test file spells it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Rz => "rz",
        }
    }
}

/// Elastic cross-section. Bending is about the axis normal to the plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum SectionSpec {
    /// Area and second moment of area.
    Elastic(ElasticSpec),
    /// Rectangle.
    Rectangle(RectangleSpec),
    /// Doubly symmetric I or H shape, bent about its strong axis. Fillets are not counted.
    IShape(IShapeSpec),
}

/// Area and second moment of area.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElasticSpec {
    /// Young's modulus.
    #[schemars(example = 2.1e11)]
    pub young_pa: f64,
    /// Area.
    #[schemars(example = 0.0149)]
    pub area_m2: f64,
    /// Second moment of area.
    #[schemars(example = 2.517e-4)]
    pub inertia_m4: f64,
}

/// Rectangular section.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RectangleSpec {
    /// Young's modulus.
    #[schemars(example = 3.0e10)]
    pub young_pa: f64,
    /// Width, normal to the plane.
    #[schemars(example = 0.3)]
    pub width_m: f64,
    /// Depth, in the plane.
    #[schemars(example = 0.5)]
    pub depth_m: f64,
}

/// I or H section.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IShapeSpec {
    /// Young's modulus.
    #[schemars(example = 2.1e11)]
    pub young_pa: f64,
    /// Depth over both flanges.
    #[schemars(example = 0.3)]
    pub depth_m: f64,
    /// Width of a flange.
    #[schemars(example = 0.3)]
    pub flange_width_m: f64,
    /// Thickness of a flange.
    #[schemars(example = 0.019)]
    pub flange_thickness_m: f64,
    /// Thickness of the web.
    #[schemars(example = 0.011)]
    pub web_thickness_m: f64,
}

/// Straight elastic member of Bernoulli and Euler between two nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MemberSpec {
    /// Name of the member in messages. Default: "member" and its number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"beam 1")]
    pub name: Option<String>,
    /// Names of its two nodes: start and end.
    #[schemars(example = ["A1", "B1"])]
    pub nodes: [String; 2],
    /// Name of its section.
    #[schemars(example = &"heb300")]
    pub section: String,
    /// Ends with a hinge. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["end"])]
    pub release: Vec<MemberEnd>,
    /// Rigid offset of the start of the member from its node, in x and y. Default: none.
    #[serde(default)]
    #[schemars(example = [0.15, 0.0])]
    pub offset_start_m: [f64; 2],
    /// Rigid offset of the end of the member from its node, in x and y. Default: none.
    #[serde(default)]
    #[schemars(example = [-0.15, 0.0])]
    pub offset_end_m: [f64; 2],
    /// If true, the axial force of the static loads acts at the displaced ends of the member: P-Δ
    /// effect. The force stays constant. Default: false.
    #[serde(default)]
    #[schemars(example = true)]
    pub p_delta: bool,
}

/// End of a member.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MemberEnd {
    /// Its first node.
    Start,
    /// Its second node.
    End,
}

/// Constraint: the directions of some nodes follow those of a master node exactly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum ConstraintSpec {
    /// Equal displacements or rotations.
    Equal(EqualSpec),
    /// Rigid body: the nodes move and turn with the master.
    Rigid(FollowersSpec),
    /// Rigid floor: the nodes have the x displacement of the master.
    Diaphragm(FollowersSpec),
}

/// Equal displacements or rotations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EqualSpec {
    /// Name of the node that is followed.
    #[schemars(example = &"A1")]
    pub master: String,
    /// Names of the nodes that follow.
    #[schemars(example = ["A2"])]
    pub nodes: Vec<String>,
    /// Directions that are equal.
    #[schemars(example = ["x", "y"])]
    pub directions: Vec<Direction>,
}

/// A master node and the nodes that follow it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FollowersSpec {
    /// Name of the node that is followed.
    #[schemars(example = &"A1")]
    pub master: String,
    /// Names of the nodes that follow.
    #[schemars(example = ["B1", "C1"])]
    pub nodes: Vec<String>,
}

/// Static load at a node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeLoadSpec {
    /// Name of the node.
    #[schemars(example = &"A1")]
    pub node: String,
    /// Force to the right. Default: 0.
    #[serde(default)]
    #[schemars(example = 1e3)]
    pub x_n: f64,
    /// Force upwards: a weight is negative. Default: 0.
    #[serde(default)]
    #[schemars(example = -2.9e5)]
    pub y_n: f64,
    /// Moment from x to y. Default: 0.
    #[serde(default)]
    #[schemars(example = 1e3)]
    pub rz_n_m: f64,
}
