//! The rows of a server: one per exchange, and their columns.

use super::Trip;
use gusset_actuator::geometry::Coordinate;
use gusset_control::port::{LoadingUnit, ReceivedPort};
use gusset_quantity::catalog::column::{
    Each, Kind, Origin, SERVER, SERVER_COMPENSATION, SERVER_RAW_DISP, SERVER_RAW_FORCE,
};
use gusset_quantity::catalog::phase::Phase;
use gusset_quantity::substructure::{Command, Measurement};
use gusset_quantity::units::AxisUnits;
use gusset_record::Column;

/// One recorded exchange.
pub(super) struct Exchange<'a> {
    /// The port was aimed at the command; else it only sought the target, if that is a number.
    pub is_aimed: bool,
    pub state: f64,
    pub command: &'a Command<'a>,
    pub elapsed: f64,
    /// The port that converts the controller's commands, if its numbers are not those of the axes.
    pub port: Option<&'a ReceivedPort>,
    pub commits: u64,
    pub measured: &'a Measurement,
    pub trip: Option<Trip>,
    pub received_ns: u64,
    pub answered_ns: u64,
}

impl Exchange<'_> {
    /// Values of the column `state`, as in a controller's record: commands that are kept back count as tripped.
    pub(crate) const PROBING: f64 = Phase::Probing.code();
    pub const RUNNING: f64 = Phase::Running.code();
    pub(crate) const RAMPING: f64 = Phase::Ramping.code();
    pub(crate) const KEPT_BACK: f64 = Phase::Tripped.code();

    /// True if the command was not passed on.
    pub(crate) fn is_kept_back(&self) -> bool {
        self.state == Self::KEPT_BACK
    }

    /// Writes the columns of the axes, [`WIDTH`] each, those of the coordinates, and those of tracking. Real-time: yes.
    pub(crate) fn write(&self, units: &[AxisUnits], row: &mut [f64]) {
        match self.port {
            None => self.write_passed(units, row),
            Some(port) => self.write_converted(port, row),
        }
    }

    /// Writes the row of a specimen whose axes the controller commands directly.
    fn write_passed(&self, units: &[AxisUnits], row: &mut [f64]) {
        let numbers = self.command.disp.iter().zip(self.command.vel);
        let measurements = self.measured.disp.iter().zip(&self.measured.force);
        for ((slot, units), ((disp, vel), (measured_disp, force))) in row
            .chunks_exact_mut(WIDTH)
            .zip(units)
            .zip(numbers.zip(measurements))
        {
            let AxisUnits {
                metres, newtons, ..
            } = units;
            slot.copy_from_slice(&[
                metres * disp,
                self.sent(*disp),
                metres * measured_disp,
                newtons * force,
                *measured_disp,
                *force,
                *vel,
            ]);
        }
    }

    /// Writes the row of a port that converts: commands and measurements of the axes, at the structure's scale and at their own.
    fn write_converted(&self, port: &ReceivedPort, row: &mut [f64]) {
        let axes = WIDTH * port.axes();
        let (row, coordinates) = row.split_at_mut(axes.min(row.len()));
        let raw = port.feedback().raw();
        let is_number = self.command.disp.iter().all(|disp| disp.is_finite());
        let targets = if self.is_aimed {
            port.target()
        } else {
            port.goal()
        };
        let commands = targets
            .iter()
            .map(|target| if is_number { *target } else { f64::NAN })
            .zip(port.command().0.iter().zip(port.command_vel().0));
        let measured = port
            .feedback()
            .disp()
            .0
            .iter()
            .zip(port.feedback().force().0);
        let measured = measured.zip(raw.disp.iter().zip(&raw.force));
        for (slot, ((target, (disp, vel)), ((meas, force), (raw_disp, raw_force)))) in
            row.chunks_exact_mut(WIDTH).zip(commands.zip(measured))
        {
            slot.copy_from_slice(&[
                target,
                self.sent(*disp),
                *meas,
                *force,
                *raw_disp,
                *raw_force,
                *vel,
            ]);
        }
        let slots = coordinates.chunks_exact_mut(COORDINATE_WIDTH);
        for (slot, (_, values)) in
            slots.zip(port.loading_unit().into_iter().flat_map(LoadingUnit::pose))
        {
            slot.copy_from_slice(&values);
        }
        let further = coordinates.get_mut(COORDINATE_WIDTH * port.coordinates()..);
        let values = port
            .tracking()
            .values()
            .flatten()
            .chain(port.path().compensation_parameters());
        // The last column is the status.
        for (slot, value) in further.into_iter().flatten().zip(values) {
            *slot = value;
        }
    }

    /// Command of the column `cmd`: NaN if the command was kept back.
    fn sent(&self, disp: f64) -> f64 {
        if self.is_kept_back() { f64::NAN } else { disp }
    }

    /// Measured displacement and force of one axis after the other, SI. Real-time: yes.
    pub(crate) fn measured_si(&self, units: &'_ [AxisUnits]) -> impl Iterator<Item = (f64, f64)> {
        let measured = self
            .port
            .map_or(self.measured, |port| port.feedback().raw());
        let measured = measured.disp.iter().zip(&measured.force).zip(units);
        measured.map(|((disp, force), unit)| (unit.metres * disp, unit.newtons * force))
    }
}

/// Columns before those of the axes.
pub(super) const HEAD: usize = count(Each::Test);
/// Columns of every axis.
pub(super) const WIDTH: usize = count(Each::Axis);
/// Columns of every coordinate of a loading unit.
pub(super) const COORDINATE_WIDTH: usize = count(Each::Coordinate);

/// Estimates are not counted: only an axis whose tracking is estimated has them.
const fn count(each: Each) -> usize {
    let (mut count, mut at) = (0, 0);
    while at < SERVER.len() {
        if SERVER[at].each as u8 == each as u8 && !is_estimate(&SERVER[at]) {
            count += 1;
        }
        at += 1;
    }
    count
}

const fn is_estimate(kind: &Kind) -> bool {
    kind.origin as u8 == Origin::Estimated as u8
}

fn kinds(each: Each) -> impl Iterator<Item = &'static Kind> {
    SERVER
        .iter()
        .filter(move |kind| kind.each == each && !is_estimate(kind))
}

/// The columns of a specimen whose axes have these units, and which are the actuators of a loading unit with these coordinates, if
/// there is one.
pub(super) fn columns(
    units: &[AxisUnits],
    coordinates: &[Coordinate],
    port: &ReceivedPort,
    name: &str,
) -> Vec<Column> {
    let column = |kind: &Kind, name: String, unit: &str, meaning: String| Column {
        name,
        unit: unit.to_owned(),
        meaning,
        timing: kind.is_timing(),
    };
    let of_test = |kind: &Kind| column(kind, kind.name().into(), kind.unit, kind.told(""));
    let mut columns: Vec<Column> = kinds(Each::Test).map(of_test).collect();
    for (axis, units) in (1..).zip(units) {
        for kind in kinds(Each::Axis) {
            // A rotation stays one, and a moment too: there is nothing to bring into metres.
            let unit = match kind.unit {
                unit if unit == SERVER_RAW_DISP.unit => units.disp,
                unit if unit == SERVER_RAW_FORCE.unit => units.force,
                _ => kind.unit_of(units.disp == "rad"),
            };
            let meaning = format!("{}; specimen \"{name}\", axis {axis}", kind.meaning);
            columns.push(column(kind, kind.of_axis(1, axis), unit, meaning));
        }
    }
    for (number, coordinate) in (1..).zip(coordinates) {
        columns.extend(kinds(Each::Coordinate).map(|kind| {
            let key = coordinate.key();
            let meaning = format!("{}; specimen \"{name}\", coordinate {key}", kind.meaning);
            let unit = kind.unit_of(coordinate.is_rotation());
            column(kind, kind.of_axis(1, number), unit, meaning)
        }));
    }
    for axis in (1..=port.axes()).filter(|_| port.tracking().is_on()) {
        let estimates = SERVER.iter().filter(|kind| is_estimate(kind));
        columns.extend(estimates.map(|kind| {
            let meaning = format!("{}; specimen \"{name}\", axis {axis}", kind.meaning);
            column(kind, kind.of_axis(1, axis), kind.unit, meaning)
        }));
    }
    for (axis, parameter) in port.path().compensation_names() {
        let (key, kind) = (parameter.name, &SERVER_COMPENSATION);
        let meaning = kind.meaning.replace("NAME", key);
        let meaning = format!("{meaning}; specimen \"{name}\", axis {}", axis + 1);
        let of = kind.of_parameter(key, 1, axis + 1);
        columns.push(column(kind, of, parameter.unit, meaning));
    }
    columns.extend(kinds(Each::Specimen).map(|kind| {
        let meaning = format!("{}; specimen \"{name}\"", kind.meaning);
        column(kind, kind.of_specimen(1), kind.unit, meaning)
    }));
    columns
}
