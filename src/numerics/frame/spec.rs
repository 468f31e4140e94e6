//! A frame as a test file describes it. Plain data; [`super::build`] makes a model of it.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::MaterialSpec;
use crate::law::{BearingSpec, LawSpec};

/// Plane or space frame: nodes, members and links between them, constraints and static loads.
/// In a plane y points upwards, in space z. Rotations follow the right-hand rule. DOFs are the free
/// directions of the nodes, in the order of the nodes and of x, y, z, rx, ry, rz. `gusset check
/// --verbose` lists them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameSpec {
    /// 2 for a plane frame in x and y, 3 for a space frame.
    #[serde(default = "plane", skip_serializing_if = "is_plane")]
    #[schemars(range(min = 2, max = 3))]
    #[schemars(example = 3)]
    pub dimension: usize,
    /// File with all other tables of the frame, relative to the test file. They are at its top level
    /// or beneath `[structure.frame]`. Default: the tables are in the test file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"frame.toml")]
    pub file: Option<String>,
    /// Nodes, one `[[structure.frame.node]]` table each.
    #[serde(default)]
    pub node: Vec<NodeSpec>,
    /// Materials of sections, by their names.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub material: BTreeMap<String, MaterialSpec>,
    /// Cross-sections, by their names.
    #[serde(default)]
    pub section: BTreeMap<String, SectionSpec>,
    /// Moments of hinges over their rotations, by their names: N m for N and rad for m.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub hinge: BTreeMap<String, LawSpec>,
    /// Members, one `[[structure.frame.member]]` table each.
    #[serde(default)]
    pub member: Vec<MemberSpec>,
    /// Springs and dampers between nodes, one `[[structure.frame.link]]` table each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<FrameLinkSpec>,
    /// Constraints between nodes, one `[[structure.frame.constraint]]` table each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constraint: Vec<ConstraintSpec>,
    /// Static loads, one `[[structure.frame.load]]` table each. They are applied before t = 0 and
    /// stay constant.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub load: Vec<NodeLoadSpec>,
}

impl Default for FrameSpec {
    /// A plane frame of nothing.
    fn default() -> Self {
        Self {
            dimension: plane(),
            file: None,
            node: Vec::new(),
            material: BTreeMap::new(),
            section: BTreeMap::new(),
            hinge: BTreeMap::new(),
            member: Vec::new(),
            link: Vec::new(),
            constraint: Vec::new(),
            load: Vec::new(),
        }
    }
}

const fn plane() -> usize {
    2
}

fn is_plane(dimension: &usize) -> bool {
    *dimension == plane()
}

/// Node of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeSpec {
    /// Name of the node, unique in the frame.
    #[schemars(example = &"B1")]
    pub name: String,
    /// Coordinates x and y; in space x, y and z.
    #[schemars(example = [6.0, 3.5])]
    pub at_m: Vec<f64>,
    /// Mass in x, y and z. A direction without mass follows the others statically. Default: 0.
    #[serde(default)]
    #[schemars(example = 30e3)]
    pub mass_kg: f64,
    /// Directions in which `mass_kg` has no inertia. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["y"])]
    pub massless: Vec<Direction>,
    /// Mass moment of inertia about z. Default: 0.
    #[serde(default)]
    #[schemars(example = 500.0)]
    pub rotary_mass_kg_m2: f64,
    /// Mass moments of inertia about x and y, in space. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = [200.0, 200.0])]
    pub tilting_mass_kg_m2: [f64; 2],
    /// Directions that the ground holds. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["x", "y", "rz"])]
    pub fixed: Vec<Direction>,
}

/// Direction of a node: "x", "y" or "rz"; in space "x", "y", "z", "rx", "ry" or "rz".
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Displacement along x.
    X,
    /// Displacement along y.
    Y,
    /// Displacement along z.
    Z,
    /// Rotation about x.
    Rx,
    /// Rotation about y.
    Ry,
    /// Rotation about z, from x to y.
    Rz,
}

impl Direction {
    /// All of them, in the order of the DOFs.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Rx, Self::Ry, Self::Rz];

    /// Those of a plane frame.
    pub const PLANE: [Self; 3] = [Self::X, Self::Y, Self::Rz];

    /// As a test file spells it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::Rx => "rx",
            Self::Ry => "ry",
            Self::Rz => "rz",
        }
    }

    /// True of a rotation.
    #[must_use]
    pub const fn turns(self) -> bool {
        matches!(self, Self::Rx | Self::Ry | Self::Rz)
    }
}

impl FrameSpec {
    /// Directions of a node.
    #[must_use]
    pub const fn directions(&self) -> &'static [Direction] {
        match self.dimension {
            3 => &Direction::ALL,
            _ => &Direction::PLANE,
        }
    }

    /// The direction upwards.
    #[must_use]
    pub const fn upwards(&self) -> Direction {
        match self.dimension {
            3 => Direction::Z,
            _ => Direction::Y,
        }
    }
}

/// Cross-section. Its depth lies in the plane, or in the direction of the `orientation` of its
/// member. A solid shape has either `young_pa` or the `material` of its fibres. In space it twists
/// with G = E/2.6.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum SectionSpec {
    /// Area and second moment of area.
    Elastic(ElasticSpec),
    /// Rectangle.
    Rectangle(RectangleSpec),
    /// Doubly symmetric I or H shape. Fillets are not counted. In a plane, a rectangular tube is an
    /// I shape with a web of two walls.
    IShape(IShapeSpec),
    /// Solid circle.
    Circle(CircleSpec),
    /// Round tube.
    Tube(TubeSpec),
    /// Rectangle of reinforced concrete.
    RcRectangle(RcRectangleSpec),
    /// Single fibres.
    Fibres(Vec<FibreSpec>),
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
    /// Second moment of area for bending over the depth.
    #[schemars(example = 2.517e-4)]
    pub inertia_m4: f64,
    /// Second moment of area for bending over the width. Needed in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 8.563e-5)]
    pub weak_inertia_m4: Option<f64>,
    /// Torsion constant J; G is E/2.6. Needed in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.85e-6)]
    pub torsion_m4: Option<f64>,
}

/// Rectangular section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RectangleSpec {
    /// Young's modulus of an elastic material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 3.0e10)]
    pub young_pa: Option<f64>,
    /// Name of its material, instead of `young_pa`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"s355")]
    pub material: Option<String>,
    /// Width, normal to the plane.
    #[schemars(example = 0.3)]
    pub width_m: f64,
    /// Depth, in the plane.
    #[schemars(example = 0.5)]
    pub depth_m: f64,
    /// Number of fibres over the depth. Default: 20.
    #[serde(default = "twenty")]
    #[schemars(example = 40)]
    pub layers: usize,
    /// Number of fibres over the width in space. Default: 8.
    #[serde(default = "eight")]
    #[schemars(example = 12)]
    pub layers_across: usize,
}

/// I or H section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IShapeSpec {
    /// Young's modulus of an elastic material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 2.1e11)]
    pub young_pa: Option<f64>,
    /// Name of its material, instead of `young_pa`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"s355")]
    pub material: Option<String>,
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
    /// Number of fibres over the depth: a fifth of them in each flange, the others in the web.
    /// Default: 20.
    #[serde(default = "twenty")]
    #[schemars(example = 40)]
    pub layers: usize,
    /// Number of fibres over the width in space. Default: 8.
    #[serde(default = "eight")]
    #[schemars(example = 12)]
    pub layers_across: usize,
}

/// Solid circular section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CircleSpec {
    /// Young's modulus of an elastic material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 2.1e11)]
    pub young_pa: Option<f64>,
    /// Name of its material, instead of `young_pa`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"s355")]
    pub material: Option<String>,
    /// Diameter.
    #[schemars(example = 0.4)]
    pub diameter_m: f64,
    /// Number of fibres over the diameter; in space of sectors. Default: 20.
    #[serde(default = "twenty")]
    #[schemars(example = 40)]
    pub layers: usize,
}

/// Round tube.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TubeSpec {
    /// Young's modulus of an elastic material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 2.1e11)]
    pub young_pa: Option<f64>,
    /// Name of its material, instead of `young_pa`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"s355")]
    pub material: Option<String>,
    /// Outer diameter.
    #[schemars(example = 0.3)]
    pub diameter_m: f64,
    /// Thickness of the wall.
    #[schemars(example = 0.01)]
    pub thickness_m: f64,
    /// Number of fibres over the diameter; in space of sectors. Default: 20.
    #[serde(default = "twenty")]
    #[schemars(example = 40)]
    pub layers: usize,
}

/// Rectangular section of reinforced concrete, with bars near the top, near the bottom and at mid-depth.
/// The bars do not displace concrete. In space they lie at the corners and sides of the core.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RcRectangleSpec {
    /// Name of the material of the cover.
    #[schemars(example = &"cover")]
    pub concrete: String,
    /// Name of the material of the core, inside the stirrups. Default: that of the cover.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"core")]
    pub core: Option<String>,
    /// Name of the material of the bars.
    #[schemars(example = &"b500")]
    pub steel: String,
    /// Width, normal to the plane.
    #[schemars(example = 0.4)]
    pub width_m: f64,
    /// Depth, in the plane.
    #[schemars(example = 0.6)]
    pub depth_m: f64,
    /// Cover around the core; the bars lie on the edge of the core.
    #[schemars(example = 0.04)]
    pub cover_m: f64,
    /// Area of the bars near the top: on the left of the way from the first node of a member to its second.
    #[schemars(example = 1.2e-3)]
    pub top_area_m2: f64,
    /// Area of the bars near the bottom: on the right of that way.
    #[schemars(example = 1.2e-3)]
    pub bottom_area_m2: f64,
    /// Area of the bars at mid-depth. Default: 0.
    #[serde(default)]
    #[schemars(example = 8e-4)]
    pub middle_area_m2: f64,
    /// Number of fibres over the depth of the core. Default: 20.
    #[serde(default = "twenty")]
    #[schemars(example = 40)]
    pub layers: usize,
    /// Number of fibres over the width in space. Default: 8.
    #[serde(default = "eight")]
    #[schemars(example = 12)]
    pub layers_across: usize,
}

/// Fibre of a section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FibreSpec {
    /// Distance from the axis of the member, positive to the left of its direction.
    #[schemars(example = 0.14)]
    pub y_m: f64,
    /// Distance from the axis along the local axis z, in space. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = 0.05)]
    pub z_m: f64,
    /// Area.
    #[schemars(example = 2e-4)]
    pub area_m2: f64,
    /// Name of its material.
    #[schemars(example = &"s355")]
    pub material: String,
}

fn twenty() -> usize {
    20
}

fn eight() -> usize {
    8
}

/// Straight member between two nodes, without shear deformation.
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
    /// How it deforms. Default: "elastic".
    #[serde(default, skip_serializing_if = "is_default")]
    pub kind: MemberKind,
    /// Number of sections along a fibre member. Default: 5 if it is force-based, 3 if it is
    /// displacement-based.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 5)]
    pub points: Option<usize>,
    /// Name of the hinge at its start, in series with the elastic member, for bending over its depth.
    /// Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"beam end")]
    pub hinge_start: Option<String>,
    /// Name of the hinge at its end, in series with the elastic member, for bending over its depth.
    /// Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"beam end")]
    pub hinge_end: Option<String>,
    /// Ends that bear no bending moment. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["end"])]
    pub release: Vec<MemberEnd>,
    /// Rigid offset of the start of the member from its node, in x, y and, in space, z. Default: none.
    #[serde(default)]
    #[schemars(example = [0.15, 0.0])]
    pub offset_start_m: Vec<f64>,
    /// Rigid offset of the end of the member from its node, in x, y and, in space, z. Default: none.
    #[serde(default)]
    #[schemars(example = [-0.15, 0.0])]
    pub offset_end_m: Vec<f64>,
    /// A vector in space to which the depth of the section points: the part of it across the
    /// member. Its length is irrelevant. Default: z, and x for a member along z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.0, 0.0, 1.0])]
    pub orientation: Option<[f64; 3]>,
    /// Torsional rigidity G J in space. Needed for reinforced concrete and single fibres. Default:
    /// that of the section.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 2.0e6)]
    pub torsion_n_m2: Option<f64>,
    /// If true, the axial force of the static loads acts at the displaced ends of the member: P-Δ
    /// effect. The force stays constant. Default: false.
    #[serde(default)]
    #[schemars(example = true)]
    pub p_delta: bool,
    /// Corotational geometry: large displacements and rotations of a member with small deformations.
    /// Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corotational: Option<CorotationalSpec>,
    /// If true, its deformations and forces are recorded. An elastic member without hinges has no such
    /// columns. Default: false.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = true)]
    pub record: bool,
    /// Coefficient of the stiffness of this member in the damping, instead of that of the rule in
    /// `[structure.damping]`. 0 is no damping by stiffness. Only for "rayleigh" and
    /// "rayleigh_ratio". Default: that of the rule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.0)]
    pub stiffness_coefficient_s: Option<f64>,
}

impl FrameSpec {
    /// Name of a member or, after them, of a link by its number from 1, as in messages.
    #[must_use]
    pub fn name_of(&self, number: usize) -> String {
        let members = self.member.len();
        let given = match self.member.get(number - 1) {
            Some(member) => &member.name,
            None => match self.link.get(number - 1 - members) {
                Some(link) => &link.name,
                None => &None,
            },
        };
        given
            .clone()
            .unwrap_or_else(|| match number.checked_sub(members) {
                None | Some(0) => format!("member {number}"),
                Some(link) => format!("link {link}"),
            })
    }
}

impl MemberSpec {
    /// An elastic member without more.
    #[must_use]
    pub fn new(nodes: [String; 2], section: &str) -> Self {
        Self {
            name: None,
            nodes,
            section: section.to_owned(),
            kind: MemberKind::Elastic,
            points: None,
            hinge_start: None,
            hinge_end: None,
            release: Vec::new(),
            offset_start_m: Vec::new(),
            offset_end_m: Vec::new(),
            orientation: None,
            torsion_n_m2: None,
            p_delta: false,
            corotational: None,
            record: false,
            stiffness_coefficient_s: None,
        }
    }
}

/// Corotational geometry of a member.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CorotationalSpec {
    /// Largest rotation of its axis expected: a member that turns is stiff in other directions. λ is
    /// chosen for it. Without it `integrator.lambda` must be a number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.1)]
    pub largest_rotation_rad: Option<f64>,
    /// Largest tension expected, which stiffens it across its axis. λ is chosen for it. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = 2.0e5)]
    pub largest_tension_n: f64,
}

/// How a member deforms.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MemberKind {
    /// Elastic, after Bernoulli and Euler; with hinges at its ends if they are named.
    #[default]
    Elastic,
    /// Fibre sections at Gauss–Lobatto points, forces interpolated.
    ForceBased,
    /// Fibre sections at Gauss–Legendre points, displacements interpolated.
    DisplacementBased,
    /// Fibres with an axial force alone, between hinges.
    Truss,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Springs and dampers between two nodes, which may lie at one place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameLinkSpec {
    /// Name of the link in messages. Default: "link" and its number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"bearing")]
    pub name: Option<String>,
    /// Names of its two nodes: start and end.
    #[schemars(example = ["A0", "A1"])]
    pub nodes: [String; 2],
    /// Direction in which it acts: one of its nodes, or "axial" along the line from start to end. A
    /// bearing has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"axial")]
    pub direction: Option<LinkDirection>,
    /// Its force over the motion of the end from the start; for a rotation N m for N and rad for m.
    /// Give either `law` or `bearing`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<LawSpec>,
    /// Bearing of a space frame: it acts in x and y, and with a vertical stiffness in z. Its end is
    /// above its start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bearing: Option<BearingSpec>,
    /// Largest displacement that a bound of its tangent needs, for some laws. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.05)]
    pub reach_disp_m: Option<f64>,
    /// Largest velocity that a bound of its tangent needs, for some laws. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.0)]
    pub reach_vel_m_per_s: Option<f64>,
    /// If true, its deformation and force are recorded. Default: false.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = true)]
    pub record: bool,
    /// If true, the stiffness K of a damping rule includes this link. Default: false.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = true)]
    pub damped: bool,
}

/// Direction of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkDirection {
    /// Displacement along x.
    X,
    /// Displacement along y.
    Y,
    /// Displacement along z.
    Z,
    /// Rotation about x.
    Rx,
    /// Rotation about y.
    Ry,
    /// Rotation about z, from x to y.
    Rz,
    /// Along the line from its first node to its second.
    Axial,
}

impl LinkDirection {
    /// That of nodes; none along a line.
    #[must_use]
    pub const fn of_nodes(self) -> Option<Direction> {
        Some(match self {
            Self::X => Direction::X,
            Self::Y => Direction::Y,
            Self::Z => Direction::Z,
            Self::Rx => Direction::Rx,
            Self::Ry => Direction::Ry,
            Self::Rz => Direction::Rz,
            Self::Axial => return None,
        })
    }
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
    /// Rigid floor. In a plane the nodes have the x displacement of the master. In space they move and
    /// turn with it in x, y and rz.
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
    /// Force along x. Default: 0.
    #[serde(default)]
    #[schemars(example = 1e3)]
    pub x_n: f64,
    /// Force along y, in a plane upwards: a weight is negative. Default: 0.
    #[serde(default)]
    #[schemars(example = -2.9e5)]
    pub y_n: f64,
    /// Force along z, in space upwards: a weight is negative. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = -2.9e5)]
    pub z_n: f64,
    /// Moment about x, in space. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = 1e3)]
    pub rx_n_m: f64,
    /// Moment about y, in space. Default: 0.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(example = 1e3)]
    pub ry_n_m: f64,
    /// Moment about z, from x to y. Default: 0.
    #[serde(default)]
    #[schemars(example = 1e3)]
    pub rz_n_m: f64,
}

impl NodeLoadSpec {
    /// Key and value for each direction.
    #[must_use]
    pub const fn each(&self) -> [(&'static str, f64); 6] {
        [
            ("x_n", self.x_n),
            ("y_n", self.y_n),
            ("z_n", self.z_n),
            ("rx_n_m", self.rx_n_m),
            ("ry_n_m", self.ry_n_m),
            ("rz_n_m", self.rz_n_m),
        ]
    }
}
