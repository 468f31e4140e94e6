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
        AxisUnits {
            metres: self.unit_disp.metres(),
            newtons: self.unit_force.newtons(),
            disp: self.unit_disp.symbol(),
            force: self.unit_force.symbol(),
        }
    }

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
    /// As people write it, metres in one unit, and the unit in the protocol of Gusset; `None` if it has none.
    const fn row(self) -> (&'static str, f64, Option<Unit>) {
        match self {
            Self::Metre => ("m", 1.0, Some(Unit::Metre)),
            Self::Millimetre => ("mm", 1e-3, Some(Unit::Millimetre)),
            Self::Inch => ("in", 0.0254, None),
        }
    }

    /// The unit in the protocol of Gusset; `None` if it has none.
    #[must_use]
    pub const fn on_the_wire(self) -> Option<Unit> {
        self.row().2
    }

    /// As people write it.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        self.row().0
    }

    /// Metres in one unit.
    #[must_use]
    pub const fn metres(self) -> f64 {
        self.row().1
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
    /// As people write it, newtons in one unit, and the unit in the protocol of Gusset; `None` if it has none.
    const fn row(self) -> (&'static str, f64, Option<Unit>) {
        match self {
            Self::Newton => ("N", 1.0, Some(Unit::Newton)),
            Self::Kilonewton => ("kN", 1e3, Some(Unit::Kilonewton)),
            Self::PoundForce => ("lbf", 4.448_221_615_260_5, None),
            Self::Kip => ("kip", 4_448.221_615_260_5, None),
        }
    }

    /// The unit in the protocol of Gusset; `None` if it has none.
    #[must_use]
    pub const fn on_the_wire(self) -> Option<Unit> {
        self.row().2
    }

    /// As people write it.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        self.row().0
    }

    /// Newtons in one unit.
    #[must_use]
    pub const fn newtons(self) -> f64 {
        self.row().1
    }
}
