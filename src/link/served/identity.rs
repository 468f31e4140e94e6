//! The properties of a served specimen that never change.

use super::client_scale::ClientScale;
use gusset_control::engine::received_columns;
use gusset_control::port::ReceivedPort;
use gusset_quantity::units::position;
use gusset_record::Column;

/// Constant properties of a served specimen.
#[derive(Debug)]
pub(super) struct Identity {
    pub name: String,
    /// Signals that a controller commands.
    pub scale: ClientScale,
    /// n × n by columns, in the units of the controller.
    pub stiffness: Vec<f64>,
    pub mass: Vec<f64>,
    /// It moves: its speed is judged by the wall clock.
    pub moves: bool,
    /// Largest correction of a force in N or N m; 0 where none is made.
    pub corrects_at_most: f64,
    /// It is computed and keeps its state between sessions.
    pub remembers: bool,
}

impl Identity {
    /// True if a session continues with the specimen's last state: the history of its limits and its trip stay, too.
    pub(crate) const fn is_lasting(&self) -> bool {
        self.moves || self.remembers
    }

    /// Columns of the rows of a test.
    pub(crate) fn columns(&self, port: &ReceivedPort) -> Vec<Column> {
        let scale = &self.scale;
        let signals = scale.units.len();
        received_columns(
            (signals, self.corrects_at_most > 0.0),
            scale.axis_units(),
            scale.coordinates(),
            port,
            &self.name,
        )
    }

    /// A place of the axes, one after the other.
    pub(crate) fn in_words(&self, place: &[f64]) -> String {
        let axes = place.iter().zip(self.scale.axis_units());
        let words: Vec<_> = axes
            .map(|(disp, units)| position(*disp, units.disp))
            .collect();
        words.join(", ")
    }
}
