//! The rows of a server: one per exchange, and their columns.

use super::Trip;
use gusset_actuator::geometry::Coordinate;
use gusset_control::port::{LoadingUnit, ReceivedPort};
use gusset_quantity::catalog::column::{
    Each, Kind, Origin, SERVER, SERVER_COMPENSATION, SERVER_RAW_DISP, SERVER_RAW_FORCE,
};
use gusset_quantity::catalog::phase::Phase;
use gusset_quantity::substructure::{Command, Status};
use gusset_quantity::units::AxisUnits;
use gusset_record::Column;

/// One recorded exchange.
pub(super) struct Exchange<'a> {
    /// The port was aimed at the command; else it only sought the target, if that is a number.
    pub is_aimed: bool,
    pub state: f64,
    pub command: &'a Command<'a>,
    pub elapsed: f64,
    pub port: &'a ReceivedPort,
    pub commits: u64,
    /// Flags that the controller received.
    pub status: Status,
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

    /// Writes the columns of the axes, [`WIDTH`] each, those of the coordinates, and those of tracking, as the row of a run.
    /// The port counts in `units`. Real-time: yes.
    pub(crate) fn write(&self, units: &[AxisUnits], row: &mut [f64]) {
        let port = self.port;
        let axes = WIDTH * port.axes();
        let (row, coordinates) = row.split_at_mut(axes.min(row.len()));
        let is_number = self.command.disp.iter().all(|disp| disp.is_finite());
        let commands = port.goal().0.iter().zip(*port.command());
        let commands = commands.zip(*port.command_vel()).zip(units).enumerate();
        for (slot, (axis, (((goal, command), vel), units))) in
            row.chunks_exact_mut(WIDTH).zip(commands)
        {
            let [target, _, meas, force, raw_disp, raw_force] = port.motion_of(axis);
            let AxisUnits {
                metres, newtons, ..
            } = units;
            let target = match (is_number, self.is_aimed) {
                (false, _) => f64::NAN,
                (true, true) => target,
                (true, false) => *goal,
            };
            let sent = if self.is_kept_back() {
                f64::NAN
            } else {
                *command
            };
            slot.copy_from_slice(&[
                metres * target,
                sent,
                metres * meas,
                newtons * force,
                raw_disp,
                raw_force,
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
