//! The properties of a served specimen that never change.

use super::client_scale::ClientScale;
use gusset_quantity::units::{AxisUnits, position};

/// Constant properties of a served specimen.
#[derive(Debug)]
pub(super) struct Identity {
    pub name: String,
    /// The units in which a controller counts.
    pub units: Vec<AxisUnits>,
    /// Signals that a controller commands.
    pub scale: ClientScale,
    /// n × n by columns, in `units`.
    pub stiffness: Vec<f64>,
    pub mass: Vec<f64>,
    /// Keys of its limits that need a measured displacement.
    pub needs_measured_disp: Vec<&'static str>,
    /// It moves: its speed is judged by the wall clock.
    pub moves: bool,
    /// It is computed and keeps its state between sessions.
    pub remembers: bool,
}

impl Identity {
    /// True if a session continues with the specimen's last state: the history of its limits and its trip stay, too.
    pub(crate) const fn is_lasting(&self) -> bool {
        self.moves || self.remembers
    }

    /// The units of the axes.
    pub(crate) fn axis_units(&self) -> &[AxisUnits] {
        self.scale.axis_units(&self.units)
    }

    /// A place of the axes, one after the other.
    pub(crate) fn in_words(&self, place: &[f64]) -> String {
        let axes = place.iter().zip(self.axis_units());
        let words: Vec<_> = axes
            .map(|(disp, units)| position(*disp, units.disp))
            .collect();
        words.join(", ")
    }
}
