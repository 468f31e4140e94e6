//! `[[specimen]]`: what a specimen sees, what is believed of it, and what stands for it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::certificate::{CapacityTable, IdentifiedTable};
use super::safety::ZeroChoice;
use super::value::MatrixValue;
use super::variant;
use crate::compensation::CompensationSpec;
use crate::control::AxisUnits;
use crate::control::limits::LimitsSpec;
use crate::geometry::{GeometrySpec, LawPlace};
use crate::link::LinkSpec;
use crate::link::openfresco::RemoteSettings;
use crate::specimen::SpecimenLaw;
use crate::transfer::TransferSpec;
use crate::wire::handshake::Unit;

/// One specimen. Exactly one of `law`, `laws`, `coupled` and `link` is given; with a structure also exactly one of `storey` and
/// `rows`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpecimenTable {
    /// Name, unique in the file: letters, digits, `-`, `_` and `.`, for it names files.
    pub name: String,
    /// Storey, from 1 at the bottom, whose deformation the specimen sees.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub storey: Option<usize>,
    /// Rows B of the transformation d = B·x: one row per axis (with `geometry` one per coordinate of its platform), one column
    /// per DOF. In a file of `gusset serve` x are the displacements that a client of OpenFresco's protocols commands: it gets the
    /// force Bᵀ·f and the matrices Bᵀ·K·B, in the one unit of all axes. A displacement that it asks for is the nearest to its
    /// command that agrees with the measured d. `limits` are those of the axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rows: Option<Vec<Vec<f64>>>,
    /// Loading unit: the axes are the actuators that hold a platform, and `rows` give its pose. Default: none, every axis is
    /// a deformation by itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<GeometrySpec>,
    /// Estimate of the initial stiffness in N/m at the structure's scale, which enters K0: a number or a matrix. Too
    /// large costs accuracy, too small costs stability. Default: the law's own; behind a link it must be given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_n_per_m: Option<MatrixValue>,
    /// Estimate of the initial damping in N s/m at the structure's scale, which enters C0. Default: the law's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_n_s_per_m: Option<MatrixValue>,
    /// Upper bound of the tangent stiffness of a specimen behind a link, as a multiple of `stiffness_n_per_m`, for the
    /// proof of stability. Default: 1, it never hardens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hardening_bound: Option<f64>,
    /// Largest deformation expected in m: bounds the tangent of a hardening law for the proof of stability.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach_disp_m: Option<f64>,
    /// Largest velocity of deformation expected in m/s: bounds the tangent of a nonlinear damper.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach_vel_m_per_s: Option<f64>,
    /// Mass in kg whose inertia is already in the measured force: it loads the structure but is not counted in M. The force is a
    /// step late, so the proof of stability takes it from M. A damping rule counts it: its ratios are those of all that moves. Not
    /// with a base displacement.
    #[serde(default)]
    pub mass_in_force_kg: f64,
    /// Scale of the specimen to the structure. Default: full scale.
    #[serde(default)]
    pub similitude: SimilitudeTable,
    /// One table per axis: gear, offsets and units. Default for all axes: none, zero, SI.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axis: Vec<AxisTable>,
    /// Bounds of every axis. Each `warn` and each `trip` of an axis' own `limits` replaces the one here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSpec>,
    /// The same law on every axis, each with a memory of its own.
    #[serde(
        default,
        deserialize_with = "read_law",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "law_schema")]
    pub law: Option<SpecimenLaw>,
    /// One law per axis; the axes do not know of each other.
    #[serde(
        default,
        deserialize_with = "read_laws",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "laws_schema")]
    pub laws: Option<SpecimenLaw>,
    /// Axes that know of each other: one law between them.
    #[serde(
        default,
        deserialize_with = "read_coupled",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "coupled_schema")]
    pub coupled: Option<SpecimenLaw>,
    /// Actuator and sensors that the law stands behind. Default: none, the law follows its command at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transfer: Option<TransferSpec>,
    /// How commands are made up for the actuator, between targets and what is sent. Default: not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensation: Option<CompensationSpec>,
    /// Displacement of each axis in m, at the specimen's scale, at which it is left by "safe_displacement".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safe_disp_m: Option<Vec<f64>>,
    /// A specimen at the other end of a network. Its waits have longest ones: `connect_timeout_s`, `reply_timeout_s`,
    /// `max_stale_s` and `watchdog_s` 3600 s, `probe_ramp_s` 600 s; and `spin_us` is at most 1e6.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<LinkSpec>,
    /// What stands for a specimen behind a link when `check` rehearses the test: `law`, `laws` or `coupled`, as for a
    /// specimen of this process, at the specimen's scale. Default: linear, by `stiffness_n_per_m` and `damping_n_s_per_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stand_in: Option<SpecimenLaw>,
    /// Actuator and sensors that the stand-in of a specimen behind a link stands behind when `check` rehearses the test.
    /// Default: those of `identified`, else none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stand_in_transfer: Option<TransferSpec>,
    /// A drill: the code of this specimen breaks down on purpose, to see the test end as it would with a bug. Only for a
    /// specimen that is computed by `gusset run`; rehearsals, replays, identifications and a test that goes on after it are
    /// without it. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drill: Option<DrillTable>,
    /// What was identified of the specimen, its actuator and its sensors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identified: Option<IdentifiedTable>,
    /// What the rig can give.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capacity: Option<CapacityTable>,
}

/// A failure that is meant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrillTable {
    /// Test time in s from which on the specimen answers with a panic of the program: every specimen is retired with its last
    /// command, the rows are kept, and `gusset run` exits with 5.
    pub panic_at_s: f64,
}

impl SpecimenTable {
    /// Actuator and sensors as far as they are known: the specimen's own, those of its stand-in, else what was identified.
    /// `pace` is the test time in a second of wall time.
    #[must_use]
    pub fn believed_transfer(&self, pace: f64) -> Option<TransferSpec> {
        let own = match &self.link {
            Some(_) => self.stand_in_transfer.as_ref(),
            None => return self.transfer.clone(),
        };
        let identified = || self.identified?.transfer(pace);
        own.cloned().or_else(identified)
    }

    /// Number of axes as far as the table alone says it, without a structure to take deformations from.
    #[must_use]
    pub fn axes_by_itself(&self) -> usize {
        if let Some(geometry) = &self.geometry {
            return geometry.actuators();
        }
        let said = match (&self.laws, &self.coupled, &self.link) {
            (Some(SpecimenLaw::Laws(laws)), ..) => laws.len(),
            (_, Some(SpecimenLaw::Coupled(coupled)), _) => coupled.stiffness_n_per_m.len(),
            (_, _, Some(link)) => {
                let estimate = self.stiffness_n_per_m.as_ref();
                let named = link.axis_names.as_ref().map_or(0, Vec::len);
                estimate.map_or(0, |matrix| matrix.rows().len()).max(named)
            }
            _ => 1,
        };
        said.max(self.axis.len()).max(1)
    }

    /// Number of axes as far as the table says it.
    #[must_use]
    pub fn axes(&self) -> usize {
        match (&self.geometry, &self.storey, &self.rows) {
            (None, Some(_), _) => 1,
            (None, _, Some(rows)) => rows.len(),
            _ => self.axes_by_itself(),
        }
    }

    /// The settings of its link where the answers of that are known to hold forces only, and no measured displacement.
    #[must_use]
    pub fn force_only_link(&self) -> Option<RemoteSettings> {
        let link = self.link.as_ref()?;
        // A mistake in the settings is reported where the link is built.
        let settings = RemoteSettings::from_spec(link, self.axes()).ok()??;
        (!settings.measures_disp()).then_some(settings)
    }

    /// Number of axes of its laws and estimates: those of the specimen, or the coordinates of its platform.
    #[must_use]
    pub fn law_axes(&self) -> usize {
        match &self.geometry {
            Some(geometry) if geometry.law_at == LawPlace::Platform => geometry.width(),
            _ => self.axes(),
        }
    }

    /// Bounds of each of `axes` axes.
    #[must_use]
    pub fn limits_of(&self, axes: usize) -> Vec<LimitsSpec> {
        let all = self.limits.unwrap_or_default();
        let own = |index: usize| self.axis.get(index).and_then(|axis| axis.limits);
        let merged = |index| own(index).unwrap_or_default().over(&all);
        (0..axes).map(merged).collect()
    }

    /// True if a displacement or a force of an axis is another for the structure, units apart.
    #[must_use]
    pub fn is_scaled(&self) -> bool {
        let is_geared = |axis: &AxisTable| axis.scale != 1.0 || axis.sign != 1;
        let similitude = &self.similitude;
        self.axis.iter().any(is_geared) || similitude.length != 1.0 || similitude.force != 1.0
    }

    /// Units of each of `axes` axes.
    #[must_use]
    pub fn units_of(&self, axes: usize) -> Vec<AxisUnits> {
        let units = |index: usize| {
            let axis = self.axis.get(index).cloned().unwrap_or_default();
            AxisUnits {
                metres: axis.unit_disp.metres(),
                newtons: axis.unit_force.newtons(),
                disp: axis.unit_disp.symbol(),
                force: axis.unit_force.symbol(),
            }
        };
        (0..axes).map(units).collect()
    }

    /// The laws that stand for the specimen, by key; a checked file has exactly one, or a link.
    #[must_use]
    pub fn sources(&self) -> Vec<(&'static str, &SpecimenLaw)> {
        [
            ("law", &self.law),
            ("laws", &self.laws),
            ("coupled", &self.coupled),
        ]
        .into_iter()
        .filter_map(|(key, source)| source.as_ref().map(|law| (key, law)))
        .collect()
    }
}

/// Ratios of the structure's quantities to the specimen's: d_structure = length · d_specimen, and so on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimilitudeTable {
    /// Lengths of the structure per length of the specimen: 10 for a specimen at one tenth.
    pub length: f64,
    /// Forces of the structure per force of the specimen.
    pub force: f64,
    /// Times of the structure per time of the specimen; velocities scale by length / time.
    pub time: f64,
}

impl Default for SimilitudeTable {
    fn default() -> Self {
        Self {
            length: 1.0,
            force: 1.0,
            time: 1.0,
        }
    }
}

/// What lies between a deformation and the number that an axis is told.
///
/// Out: axis = (sign · scale · deformation + offset) in `unit_disp`. Back: force = sign · scale · (measured − offset), the
/// measured one in `unit_force`; with the same factor on both ways the work is the same on both sides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AxisTable {
    /// Gear of a lever between deformation and axis, greater than zero.
    pub scale: f64,
    /// 1, or −1 where the axis counts the other way.
    #[schemars(extend("enum" = [-1, 1]))]
    pub sign: i8,
    /// Axis position in m at which the deformation is zero. What stands in a rehearsal for a specimen behind a link has its zero
    /// there, too; a `law` in this process is told the axis' position, as a controller of its own would be, and has its zero
    /// where that is zero (at the reference pose if it stands at the platform of a `geometry`).
    pub offset_m: f64,
    /// Reading of the load cell in N at which the force is zero: it is taken off what a `law` in this process gives, too.
    pub offset_n: f64,
    /// Unit of the displacements that the axis is commanded. Velocities, stiffnesses, dampings and masses on a link count in it, too.
    /// Inches are for OpenFresco's protocols only. Limits stay in SI.
    pub unit_disp: DispUnit,
    /// Unit in which the axis tells its force. Stiffnesses, dampings and masses on a link count in it, too. "lbf" and "kip" are for
    /// OpenFresco's protocols only.
    pub unit_force: ForceUnit,
    /// Bounds of this axis. Each `warn` and each `trip` that is absent is as the specimen's `limits` say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSpec>,
    /// "relative": the deformation is zero where the axis stands before the test, and `offset_m` is not needed.
    pub zero_disp: ZeroChoice,
    /// "relative": the force is zero as the load cell reads it before the test, and `offset_n` is not needed.
    pub zero_force: ZeroChoice,
}

impl AxisTable {
    /// Each unit that the protocol of Gusset has no word for, by its key, with the units that it has.
    pub(super) fn foreign_units(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        [
            ("unit_disp", "m or mm", self.unit_disp.on_the_wire()),
            ("unit_force", "N or kN", self.unit_force.on_the_wire()),
        ]
        .into_iter()
        .filter_map(|(key, known, unit)| unit.is_none().then_some((key, known)))
    }

    /// What stands between a deformation and the axis, key by key, and whether it is given.
    pub(super) fn gear(&self) -> [(&'static str, bool); 4] {
        [
            ("scale", self.scale != 1.0),
            ("sign", self.sign != 1),
            ("offset_m", self.offset_m != 0.0),
            ("offset_n", self.offset_n != 0.0),
        ]
    }
}

impl Default for AxisTable {
    fn default() -> Self {
        Self {
            scale: 1.0,
            sign: 1,
            offset_m: 0.0,
            offset_n: 0.0,
            unit_disp: DispUnit::Metre,
            unit_force: ForceUnit::Newton,
            limits: None,
            zero_disp: ZeroChoice::Absolute,
            zero_force: ZeroChoice::Absolute,
        }
    }
}

/// Units of displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum DispUnit {
    /// Metre.
    #[default]
    #[serde(rename = "m")]
    Metre,
    /// Millimetre.
    #[serde(rename = "mm")]
    Millimetre,
    /// Inch, 25.4 mm.
    #[serde(rename = "in")]
    Inch,
}

impl DispUnit {
    /// The unit in the protocol of Gusset; `None` if it has none.
    #[must_use]
    pub const fn on_the_wire(self) -> Option<Unit> {
        match self {
            Self::Metre => Some(Unit::Metre),
            Self::Millimetre => Some(Unit::Millimetre),
            Self::Inch => None,
        }
    }

    /// As people write it.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Millimetre => "mm",
            Self::Inch => "in",
        }
    }

    /// Metres in one unit.
    #[must_use]
    pub const fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => 1e-3,
            Self::Inch => 0.0254,
        }
    }
}

/// Units of force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum ForceUnit {
    /// Newton.
    #[default]
    #[serde(rename = "N")]
    Newton,
    /// Kilonewton.
    #[serde(rename = "kN")]
    Kilonewton,
    /// Pound-force, 4.4482216152605 N.
    #[serde(rename = "lbf")]
    PoundForce,
    /// Kip, 1000 lbf or 4448.2216152605 N.
    #[serde(rename = "kip")]
    Kip,
}

impl ForceUnit {
    /// The unit in the protocol of Gusset; `None` if it has none.
    #[must_use]
    pub const fn on_the_wire(self) -> Option<Unit> {
        match self {
            Self::Newton => Some(Unit::Newton),
            Self::Kilonewton => Some(Unit::Kilonewton),
            Self::PoundForce | Self::Kip => None,
        }
    }

    /// As people write it.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Newton => "N",
            Self::Kilonewton => "kN",
            Self::PoundForce => "lbf",
            Self::Kip => "kip",
        }
    }

    /// Newtons in one unit.
    #[must_use]
    pub const fn newtons(self) -> f64 {
        match self {
            Self::Newton => 1.0,
            Self::Kilonewton => 1e3,
            Self::PoundForce => 4.448_221_615_260_5,
            Self::Kip => 4_448.221_615_260_5,
        }
    }
}

fn read_law<'de, D: serde::Deserializer<'de>>(d: D) -> Result<Option<SpecimenLaw>, D::Error> {
    variant::read("law", d)
}

fn read_laws<'de, D: serde::Deserializer<'de>>(d: D) -> Result<Option<SpecimenLaw>, D::Error> {
    variant::read("laws", d)
}

fn read_coupled<'de, D: serde::Deserializer<'de>>(d: D) -> Result<Option<SpecimenLaw>, D::Error> {
    variant::read("coupled", d)
}

fn law_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    variant::schema::<SpecimenLaw>("law", generator)
}

fn laws_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    variant::schema::<SpecimenLaw>("laws", generator)
}

fn coupled_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
    variant::schema::<SpecimenLaw>("coupled", generator)
}
