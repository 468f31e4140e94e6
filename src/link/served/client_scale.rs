//! The scale of a controller: the displacements that it commands and the forces that it gets, beside those of the specimen's axes.
//!
//! Most servers offer the axes of a specimen in their own units: then every number passes unchanged to the last bit. A gateway
//! with a geometry, a similitude or gears offers deformations at the structure's scale, or the coordinates of a loading unit.
//! Its port converts them as in a test.

use gusset_actuator::geometry::{Coordinate, Fault};
use gusset_control::port::ReceivedPort;
use gusset_quantity::frame::{AtAxis, AtClient, AtStructure};
use gusset_quantity::substructure::Measurement;
use gusset_quantity::units::AxisUnits;

/// Signals that a controller commands.
#[derive(Debug, Clone, Default)]
pub(crate) enum ClientScale {
    /// The axes of the specimen in their own units.
    #[default]
    Axes,
    /// The signals of the port at the structure's scale.
    Structure(Box<AxesBehind>),
}

/// The axes of a specimen behind the signals that a controller commands.
#[derive(Debug, Clone)]
pub struct AxesBehind {
    /// Their units, one entry per axis.
    pub units: Vec<AxisUnits>,
    /// Coordinates of the loading unit, if the axes are its actuators.
    pub coordinates: Vec<Coordinate>,
}

impl ClientScale {
    /// True if numbers pass unchanged.
    pub(crate) const fn is_of_axes(&self) -> bool {
        matches!(self, Self::Axes)
    }

    /// The units of the axes of a specimen whose controller counts in `client`.
    pub(crate) fn axis_units<'a>(&'a self, client: &'a [AxisUnits]) -> &'a [AxisUnits] {
        match self {
            Self::Axes => client,
            Self::Structure(behind) => &behind.units,
        }
    }

    /// The coordinates of a loading unit behind which the axes are; empty without one.
    pub(crate) fn coordinates(&self) -> &[Coordinate] {
        match self {
            Self::Axes => &[],
            Self::Structure(behind) => &behind.coordinates,
        }
    }

    /// Makes the next command of displacements and velocities of the controller, which counts in `client`. Real-time: yes.
    pub(crate) fn aim(
        &self,
        port: &mut ReceivedPort,
        [disp, vel]: [AtClient<&[f64]>; 2],
        client: &[AxisUnits],
    ) {
        let motion = disp.iter().zip(*vel);
        match self {
            Self::Axes => {
                port.aim_at(&mut motion.map(|(disp, vel)| AtStructure((*disp, *vel))));
            }
            Self::Structure(_) => {
                let motion = motion.zip(client);
                let mut motion = motion.map(|((disp, vel), unit)| {
                    AtStructure((disp * unit.metres, vel * unit.metres))
                });
                port.aim_at(&mut motion);
            }
        }
    }

    /// Makes the target of the port of displacements of the controller, and no command. Real-time: yes.
    pub(crate) fn seek(
        &self,
        port: &mut ReceivedPort,
        disp: AtClient<&[f64]>,
        client: &[AxisUnits],
    ) {
        match self {
            Self::Axes => port.seek_at(&mut disp.iter().map(|disp| AtStructure((*disp, 0.0)))),
            Self::Structure(_) => {
                let along = disp.iter().zip(client);
                port.seek_at(&mut along.map(|(disp, unit)| AtStructure((disp * unit.metres, 0.0))));
            }
        }
    }

    /// Writes the port's last measurement in the controller's units, where displacements and forces are finite. Returns the first
    /// signal where they are not, in the units of the controller or in m and N. Real-time: yes.
    ///
    /// # Errors
    /// The actuators cannot have the strokes that were measured.
    pub(crate) fn answer(
        &self,
        port: &mut ReceivedPort,
        client: &[AxisUnits],
        into: &mut Measurement,
    ) -> Result<Option<usize>, Fault> {
        if self.is_of_axes() {
            copy(port.feedback().raw(), into);
            let values = into.disp.iter().zip(&into.force).zip(client);
            let mut values = values.map(|((disp, force), unit)| {
                (disp * unit.metres).is_finite() && (force * unit.newtons).is_finite()
            });
            return Ok(values.position(|is_finite| !is_finite));
        }
        port.resolve_pose()?;
        let mut not_finite = None;
        port.read_signals(|index, AtStructure((disp, force))| {
            let places = into.disp.get_mut(index).zip(into.force.get_mut(index));
            let (Some((to_disp, to_force)), Some(unit)) = (places, client.get(index)) else {
                return;
            };
            let (disp, force) = (disp / unit.metres, force / unit.newtons);
            if disp.is_finite() && force.is_finite() {
                (*to_disp, *to_force) = (disp, force);
            } else {
                not_finite.get_or_insert(index);
            }
        });
        Ok(not_finite)
    }

    /// Where the axes are to be, in their units, for displacements of the controller.
    ///
    /// # Errors
    /// The actuators cannot have this pose.
    pub(crate) fn place_for(
        &self,
        port: &ReceivedPort,
        disp: AtClient<&[f64]>,
        client: &[AxisUnits],
    ) -> Result<AtAxis<Vec<f64>>, Fault> {
        if self.is_of_axes() || disp.is_empty() {
            return Ok(AtAxis(disp.to_vec()));
        }
        let signals = disp
            .iter()
            .zip(client)
            .map(|(disp, unit)| disp * unit.metres);
        let signals = AtStructure(signals.collect::<Vec<f64>>());
        port.commands_for(signals.part(Vec::as_slice))
    }

    /// Displacements of the controller for the position `place` of the axes, in their units.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    pub(crate) fn disp_at(
        &self,
        port: &ReceivedPort,
        place: AtAxis<&[f64]>,
        client: &[AxisUnits],
    ) -> Result<AtClient<Vec<f64>>, Fault> {
        if self.is_of_axes() {
            return Ok(AtClient(place.to_vec()));
        }
        let signals = port.signals_at(place)?;
        let signals = signals.iter().zip(client);
        let disp = signals.map(|(disp, unit)| disp / unit.metres);
        Ok(AtClient(disp.collect()))
    }
}

/// The numbers of the axes, where they are finite. Real-time: yes.
pub(super) fn copy(from: &Measurement, to: &mut Measurement) {
    let values = to.disp.iter_mut().zip(&mut to.force);
    for ((disp, force), (from_disp, from_force)) in values.zip(from.disp.iter().zip(&from.force)) {
        if from_disp.is_finite() && from_force.is_finite() {
            (*disp, *force) = (*from_disp, *from_force);
        }
    }
}
