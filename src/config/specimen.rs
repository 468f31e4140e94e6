//! `[[specimen]]`: deformation, estimates, law or link, limits and capacity of a specimen.

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

/// One specimen: simulated by exactly one of `law`, `laws` and `coupled`, or reached by a `link`. In a
/// test with a structure, also give exactly one of `storey` and `rows`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpecimenTable {
    /// Name of the specimen, unique in the file. Letters, digits, `-`, `_` and `.` are allowed,
    /// because the name is part of file names.
    pub name: String,
    /// Storey whose deformation the specimen follows, from 1 at the bottom. Use `rows` for any
    /// other deformation.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    #[schemars(example = 1)]
    pub storey: Option<usize>,
    /// Transformation B from the DOFs to the axes, d = B·x. Give one row for each axis, or for each
    /// coordinate of the platform with `geometry`. In a file of `gusset serve`, B transforms the
    /// displacements of an OpenFresco client. More: guide, opensees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rows: Option<Vec<Vec<f64>>>,
    /// Loading unit: several actuators that hold one platform. The axes are then the actuators, and
    /// `rows` give the pose of the platform. Default: none, each axis is one deformation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<GeometrySpec>,
    /// Estimate of the initial stiffness at the structure's scale: a number or a matrix. Too large
    /// a value costs accuracy, too small a value costs stability. Default: the initial stiffness of
    /// the law. Required with `link`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_n_per_m: Option<MatrixValue>,
    /// Estimate of the initial damping at the structure's scale: a number or a matrix. Default: the
    /// initial damping of the law; zero with `link`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_n_s_per_m: Option<MatrixValue>,
    /// Upper bound of the tangent stiffness of a specimen with `link`, divided by
    /// `stiffness_n_per_m`. The proof of stability uses it. Default: 1, the specimen never becomes
    /// stiffer.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.5)]
    pub hardening_bound: Option<f64>,
    /// Largest expected deformation, at the structure's scale. The proof of stability uses it to
    /// bound the tangent stiffness of a hardening law. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.05)]
    pub reach_disp_m: Option<f64>,
    /// Largest expected deformation velocity, at the structure's scale. The proof of stability uses
    /// it to bound the tangent damping of a nonlinear damper. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.5)]
    pub reach_vel_m_per_s: Option<f64>,
    /// Mass whose inertia is already part of the measured force, so the structure must not contain
    /// it. The proof of stability subtracts it from M, because the measured force is one step late.
    /// Damping rules include it. A base displacement is refused with it.
    #[serde(default)]
    pub mass_in_force_kg: f64,
    /// Scale factors between structure and specimen. Default: full scale.
    #[serde(default)]
    pub similitude: SimilitudeTable,
    /// Scale, offset and units of each axis, one `[[specimen.axis]]` table each. Default: no scale,
    /// no offset, SI units.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axis: Vec<AxisTable>,
    /// Limits of all axes. `limits` of a single `axis` override single levels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSpec>,
    /// Force law of a simulated specimen. All axes have the same law, and each axis has its own
    /// state. Beside a `link`, it is the stand-in: a rehearsal uses it in place of the specimen, at
    /// the specimen's scale. Default of the stand-in: linear, with `stiffness_n_per_m` and
    /// `damping_n_s_per_m`.
    #[serde(
        default,
        deserialize_with = "read_law",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "law_schema")]
    pub law: Option<SpecimenLaw>,
    /// Force law of each axis of a simulated specimen. The axes are independent of each other.
    /// Beside a `link`, it is the stand-in for rehearsals.
    #[serde(
        default,
        deserialize_with = "read_laws",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "laws_schema")]
    #[schemars(example = serde_json::json!([{"linear": {"stiffness_n_per_m": 1.0e6}}, {"linear": {"stiffness_n_per_m": 5.0e5}}]))]
    pub laws: Option<SpecimenLaw>,
    /// Linear law of a simulated specimen with several coupled axes. Beside a `link`, it is the
    /// stand-in for rehearsals.
    #[serde(
        default,
        deserialize_with = "read_coupled",
        serialize_with = "variant::write",
        skip_serializing_if = "Option::is_none"
    )]
    #[schemars(schema_with = "coupled_schema")]
    pub coupled: Option<SpecimenLaw>,
    /// Simulated actuator and sensors of a simulated specimen. Default: none, the specimen follows
    /// its command at once. Beside a `link`, they are those of the stand-in for rehearsals. Their
    /// default is then the delay, gain and noise of `identified`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transfer: Option<TransferSpec>,
    /// Compensation of the actuator dynamics. It computes the commands from the targets. Default:
    /// none, the command is the target. More: guide, actuators.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensation: Option<CompensationSpec>,
    /// Displacement of each axis, at the specimen's scale, for the end position
    /// "safe_displacement".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.0])]
    pub safe_disp_m: Option<Vec<f64>>,
    /// Network connection to a specimen that another program controls or computes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<LinkSpec>,
    /// Fault injection: this simulated specimen fails on purpose. Use it to see how the test ends
    /// after an internal error. Rehearsals, replays and resumed tests ignore it. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drill: Option<DrillTable>,
    /// Measured properties of the specimen, its actuator and its sensors. `gusset identify` writes
    /// this table. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identified: Option<IdentifiedTable>,
    /// Capacity of the actuators. `check` refuses a test whose rehearsal needs more. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capacity: Option<CapacityTable>,
}

/// Fault injection in a simulated specimen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrillTable {
    /// Test time at which the specimen panics. All specimens then stop, the record is kept, and
    /// `gusset run` exits with code 5.
    #[schemars(example = 5.0)]
    pub panic_at_s: f64,
}

impl SpecimenTable {
    /// The known actuator and sensors: those of the specimen, else those of its stand-in, else the identified ones.
    /// `pace` is the test time in a second of wall time.
    #[must_use]
    pub fn believed_transfer(&self, pace: f64) -> Option<TransferSpec> {
        let identified = || {
            self.link.as_ref()?;
            self.identified?.transfer(pace)
        };
        self.transfer.clone().or_else(identified)
    }

    /// The simulated actuator and sensors of a simulated specimen; none behind a link.
    #[must_use]
    pub const fn own_transfer(&self) -> Option<&TransferSpec> {
        match &self.link {
            Some(_) => None,
            None => self.transfer.as_ref(),
        }
    }

    /// The law that replaces a specimen behind a link in a rehearsal, with its key; none for a simulated specimen.
    #[must_use]
    pub fn stand_in(&self) -> Option<(&'static str, &SpecimenLaw)> {
        self.link.as_ref()?;
        self.sources().into_iter().next()
    }

    /// Number of axes as far as the table alone says it, without a structure to take deformations from.
    #[must_use]
    pub fn axes_by_itself(&self) -> usize {
        if let Some(geometry) = &self.geometry {
            return geometry.actuators();
        }
        let said = match (&self.link, &self.laws, &self.coupled) {
            (None, Some(SpecimenLaw::Laws(laws)), _) => laws.len(),
            (None, _, Some(SpecimenLaw::Coupled(coupled))) => coupled.stiffness_n_per_m.len(),
            (Some(link), ..) => {
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

    /// Symbols of the units of displacement and force of each axis.
    #[must_use]
    pub fn units(&self) -> Vec<[&'static str; 2]> {
        let symbols = |axis: &AxisTable| [axis.unit_disp.symbol(), axis.unit_force.symbol()];
        let default = AxisTable::default();
        let table = |index: usize| self.axis.get(index).unwrap_or(&default);
        (0..self.axes())
            .map(|index| symbols(table(index)))
            .collect()
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

    /// The laws that are given, by key. A checked file has exactly one, or a link and at most one.
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

/// Scale factors, quantity of the structure divided by quantity of the specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimilitudeTable {
    /// Length scale: d_structure = length · d_specimen. 10 is a specimen at a scale of one to ten.
    #[schemars(example = 2.0)]
    pub length: f64,
    /// Force scale: f_structure = force · f_specimen.
    #[schemars(example = 4.0)]
    pub force: f64,
    /// Time scale: t_structure = time · t_specimen. Velocities have the factor length / time.
    #[schemars(example = 1.414)]
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

/// Conversion between the deformation and the command and measurement of one axis.
///
/// The command is sign · scale · deformation + offset, in `unit_disp`. The force is sign · scale ·
/// (measured − offset), with the measurement in `unit_force`. The equal factors conserve work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AxisTable {
    /// Motion of the axis for a unit deformation, for example the ratio of a lever. It must be
    /// greater than 0.
    #[schemars(example = 0.5)]
    pub scale: f64,
    /// Sign between the axis and the deformation: 1, or −1 if the axis is positive in the opposite
    /// direction.
    #[schemars(extend("enum" = [-1, 1]))]
    #[schemars(example = -1)]
    pub sign: i8,
    /// Position of the axis at zero deformation. A simulated `law` has its own zero at axis
    /// position zero. The stand-in of a rehearsal has its zero at this offset.
    #[schemars(example = 0.012)]
    pub offset_m: f64,
    /// Reading of the load cell at zero force. It is also subtracted from the force of a simulated
    /// `law`.
    #[schemars(example = 150.0)]
    pub offset_n: f64,
    /// Unit of the displacements on a link. Velocities, stiffnesses, dampings and masses on the
    /// link use it too. "in" needs an OpenFresco protocol. Limits stay in SI units.
    pub unit_disp: DispUnit,
    /// Unit of the forces on a link. Stiffnesses, dampings and masses on the link use it too. "lbf"
    /// and "kip" need an OpenFresco protocol. Limits stay in SI units.
    pub unit_force: ForceUnit,
    /// Limits of this axis. Each `warn` and `trip` level that is absent here is taken from `limits`
    /// of the specimen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSpec>,
    /// Zero of the displacement. With "relative", the deformation is zero at the position before
    /// the test, and `offset_m` is not needed.
    #[schemars(example = &"relative")]
    pub zero_disp: ZeroChoice,
    /// Zero of the force. With "relative", the force is zero at the reading before the test, and
    /// `offset_n` is not needed.
    #[schemars(example = &"relative")]
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

    /// The keys that convert a deformation to the axis, and whether each is given.
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

/// Unit of displacement.
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

/// Unit of force.
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
    /// Kip (1000 lbf), 4448.2216152605 N.
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
