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
#[derive(Debug, Clone)]
pub(crate) struct ClientScale {
    /// The units in which the controller counts, one entry per signal.
    pub units: Vec<AxisUnits>,
    /// The axes behind the signals of a port that converts, which are at the structure's scale; none if the controller commands the
    /// axes in their own units.
    pub behind: Option<AxesBehind>,
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
        self.behind.is_none()
    }

    /// The units of the axes.
    pub(crate) fn axis_units(&self) -> &[AxisUnits] {
        let behind = self.behind.as_ref();
        behind.map_or(&self.units, |behind| &behind.units)
    }

    /// The units of an axis, or of a signal, in which the port counts.
    pub(crate) fn port_units(&self, index: usize) -> &AxisUnits {
        let units = self.units.get(index);
        let units = units.filter(|_| self.is_of_axes());
        units.unwrap_or(&AxisUnits::SI)
    }

    /// The coordinates of a loading unit behind which the axes are; empty without one.
    pub(crate) fn coordinates(&self) -> &[Coordinate] {
        let behind = self.behind.as_ref();
        behind.map_or(&[], |behind| &behind.coordinates)
    }

    /// Units of the port's displacement in one of the controller.
    const fn disp_unit(&self, client: &AxisUnits) -> f64 {
        match self.behind {
            None => 1.0,
            Some(_) => client.metres,
        }
    }

    /// Displacements and velocities of the controller as the port counts. Real-time: yes.
    fn motion<'a>(
        &'a self,
        [disp, vel]: [AtClient<&'a [f64]>; 2],
    ) -> impl Iterator<Item = AtStructure<(f64, f64)>> + 'a {
        let motion = disp.0.iter().zip(vel.0).zip(&self.units);
        motion.map(|((disp, vel), unit)| {
            let factor = self.disp_unit(unit);
            AtStructure((disp * factor, vel * factor))
        })
    }

    /// Makes the next command of displacements and velocities of the controller. Real-time: yes.
    pub(crate) fn aim(&self, port: &mut ReceivedPort, motion: [AtClient<&[f64]>; 2]) {
        port.aim_at(&mut self.motion(motion));
    }

    /// Makes the target of the port of displacements of the controller, and no command. Real-time: yes.
    pub(crate) fn seek(&self, port: &mut ReceivedPort, disp: AtClient<&[f64]>) {
        let along = self.motion([disp; 2]);
        port.seek_at(&mut along.map(|AtStructure((disp, _))| AtStructure((disp, 0.0))));
    }

    /// Makes the target of the port of displacements and velocities of the controller, and no command. Real-time: yes.
    pub(crate) fn seek_moving(&self, port: &mut ReceivedPort, motion: [AtClient<&[f64]>; 2]) {
        port.seek_at(&mut self.motion(motion));
    }

    /// Writes the port's last measurement in the controller's units, where displacements and forces are finite. Returns the first
    /// signal where they are not, in the units of the controller or in m and N. Real-time: yes.
    ///
    /// # Errors
    /// The actuators cannot have the strokes that were measured.
    pub(crate) fn answer(
        &self,
        port: &mut ReceivedPort,
        into: &mut Measurement,
    ) -> Result<Option<usize>, Fault> {
        if self.is_of_axes() {
            copy(port.feedback().raw(), into);
            let values = into.disp.iter().zip(&into.force).zip(&self.units);
            let mut values = values.map(|((disp, force), unit)| {
                (disp * unit.metres).is_finite() && (force * unit.newtons).is_finite()
            });
            return Ok(values.position(|is_finite| !is_finite));
        }
        port.resolve_pose()?;
        let mut not_finite = None;
        port.read_signals(|index, AtStructure((disp, force))| {
            let places = into.disp.get_mut(index).zip(into.force.get_mut(index));
            let (Some((to_disp, to_force)), Some(unit)) = (places, self.units.get(index)) else {
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
    ) -> Result<AtAxis<Vec<f64>>, Fault> {
        if disp.is_empty() {
            return Ok(AtAxis(Vec::new()));
        }
        let signals = self.motion([disp; 2]);
        let signals: Vec<f64> = signals.map(|AtStructure((disp, _))| disp).collect();
        port.commands_for(AtStructure(&signals))
    }

    /// Displacements of the controller for the position `place` of the axes, in their units.
    ///
    /// # Errors
    /// The actuators cannot have these strokes.
    pub(crate) fn disp_at(
        &self,
        port: &ReceivedPort,
        place: AtAxis<&[f64]>,
    ) -> Result<AtClient<Vec<f64>>, Fault> {
        let signals = port.signals_at(place)?;
        let signals = signals.iter().zip(&self.units);
        let disp = signals.map(|(disp, unit)| disp / self.disp_unit(unit));
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
