//! The units in which an axis counts.

/// The units of an axis: metres and newtons in one of them, and their symbols.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisUnits {
    /// Metres in one unit of displacement.
    pub metres: f64,
    /// Newtons in one unit of force.
    pub newtons: f64,
    /// Symbol of the unit of displacement.
    pub disp: &'static str,
    /// Symbol of the unit of force.
    pub force: &'static str,
}

impl AxisUnits {
    /// Metres and newtons.
    pub const SI: AxisUnits = AxisUnits {
        metres: 1.0,
        newtons: 1.0,
        disp: "m",
        force: "N",
    };
}
