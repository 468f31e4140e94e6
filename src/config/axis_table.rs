//! `[[specimen.axis]]`: conversion between a deformation of the structure and one axis, and the units of that axis.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limit_table::LimitsSpec;
use super::safety::ZeroChoice;
use gusset_quantity::units::AxisUnits;
use gusset_wire::handshake::Unit;

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
    /// link use it too. "in" needs an OpenFresco protocol. Limits stay in SI units. An axis whose
    /// `rows` have only `structure.rotations` is in rad: only "m" is allowed for it, and its moment
    /// is in `unit_force` times m.
    pub unit_disp: DispUnit,
    /// Unit of the forces on a link. Stiffnesses, dampings and masses on the link use it too. "lbf"
    /// and "kip" need an OpenFresco protocol. Limits stay in SI units.
    pub unit_force: ForceUnit,
    /// Limits of this axis. Each `warn` and `trip` level that is absent here is taken from `limits`
    /// of the specimen.
    pub limits: Option<LimitsSpec>,
    /// Zero of the displacement. With "relative", the deformation is zero at the position before
    /// the test, and `offset_m` is not needed. Only in a test file: a server takes no zero.
    #[schemars(example = &"relative")]
    pub zero_disp: ZeroChoice,
    /// Zero of the force. With "relative", the force is zero at the reading before the test, and
    /// `offset_n` is not needed. Only in a test file: a server takes no zero.
    #[schemars(example = &"relative")]
    pub zero_force: ZeroChoice,
}

impl AxisTable {
    /// The units of the axis.
    #[must_use]
    pub(crate) const fn units(&self) -> AxisUnits {
        axis_units(self.unit_disp, self.unit_force)
    }

    /// Each unit that the protocol of Gusset has no word for, by its key, with the units that it has.
    pub(super) fn foreign_units(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        [
            ("unit_disp", "m or mm", self.unit_disp.row().wire),
            ("unit_force", "N or kN", self.unit_force.row().wire),
        ]
        .into_iter()
        .filter_map(|(key, known, unit)| unit.is_none().then_some((key, known)))
    }

    /// The keys that convert a deformation to the axis, and whether each is given.
    #[must_use]
    pub fn gear(&self) -> [(&'static str, bool); 4] {
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

/// The units of an axis.
#[must_use]
pub const fn axis_units(disp: DispUnit, force: ForceUnit) -> AxisUnits {
    let (disp, force) = (disp.row(), force.row());
    AxisUnits {
        metres: disp.si,
        newtons: force.si,
        disp: disp.symbol,
        force: force.symbol,
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

/// A unit: its symbol and its size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitRow {
    /// As people write it.
    pub symbol: &'static str,
    /// SI units in one of it.
    pub si: f64,
    /// The unit in the protocol of Gusset; `None` if it has none.
    pub wire: Option<Unit>,
}

impl UnitRow {
    const fn new(symbol: &'static str, si: f64, wire: Option<Unit>) -> Self {
        Self { symbol, si, wire }
    }
}

impl DispUnit {
    /// The unit in metres.
    #[must_use]
    pub const fn row(self) -> UnitRow {
        match self {
            Self::Metre => UnitRow::new("m", 1.0, Some(Unit::Metre)),
            Self::Millimetre => UnitRow::new("mm", 1e-3, Some(Unit::Millimetre)),
            Self::Inch => UnitRow::new("in", 0.0254, None),
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
    /// The unit in newtons.
    #[must_use]
    pub const fn row(self) -> UnitRow {
        match self {
            Self::Newton => UnitRow::new("N", 1.0, Some(Unit::Newton)),
            Self::Kilonewton => UnitRow::new("kN", 1e3, Some(Unit::Kilonewton)),
            Self::PoundForce => UnitRow::new("lbf", 4.448_221_615_260_5, None),
            Self::Kip => UnitRow::new("kip", 4_448.221_615_260_5, None),
        }
    }
}
