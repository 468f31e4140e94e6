//! The rows of received targets: one for each exchange, and their columns.

use super::phase::Phase;
use super::received::{Received, ReceivedTarget};
use super::tick::Tick;
use crate::port::{LoadingUnit, Port, ReceivedPort};
use gusset_actuator::geometry::Coordinate;
use gusset_quantity::catalog::column::{
    Each, Kind, Origin, SERVER, SERVER_COMPENSATION, SERVER_RAW_DISP, SERVER_RAW_FORCE,
};
use gusset_quantity::substructure::Status;
use gusset_quantity::units::AxisUnits;
use gusset_record::Column;

impl Received {
    /// The row of an exchange in this state. Real-time: yes.
    pub(super) fn write(&self, tick: &Tick, state: f64, port: &Port, values: &mut [f64]) {
        let row = &self.row;
        let (received_s, round_trip_s) = self.times();
        let head = [
            super::columns::number(self.counts.exchanges),
            0.0,
            state,
            tick.time,
            row.elapsed,
            row.number.map_or_else(
                || port.exchange().count().sent.saturating_sub(1) as f64,
                |number| number as f64,
            ),
            super::columns::number(row.commits),
            f64::from(row.trip),
            received_s,
            round_trip_s,
        ];
        for (to, from) in values.iter_mut().zip(head) {
            *to = from;
        }
        let is_kept_back = state == Phase::Tripped.code();
        self.write_axes(
            is_kept_back,
            port,
            values.get_mut(HEAD..).unwrap_or_default(),
        );
        if let Some(status) = values.last_mut() {
            let raw = port.feedback().raw().status.0 & !Status::HELD.0;
            let stale = if is_kept_back { Status::STALE.0 } else { 0 };
            *status = f64::from(row.status.map_or(raw, |status| status.0) | stale);
        }
    }

    /// The columns of the axes, [`WIDTH`] each, those of the coordinates, and those of tracking, as in the row of a run. Real-time: yes.
    fn write_axes(&self, is_kept_back: bool, port: &Port, row: &mut [f64]) {
        let axes = WIDTH * port.axes();
        let (row, coordinates) = row.split_at_mut(axes.min(row.len()));
        let commands = port.goal().0.iter().zip(*port.command());
        let commands = commands.zip(*port.command_vel()).zip(&self.port_units);
        for (slot, (axis, (((goal, command), vel), units))) in
            row.chunks_exact_mut(WIDTH).zip(commands.enumerate())
        {
            let [target, _, meas, force, raw_disp, raw_force] = port.motion_of(axis);
            let AxisUnits {
                metres, newtons, ..
            } = units;
            let target = match self.row.target {
                ReceivedTarget::Aimed => target,
                ReceivedTarget::Sought => *goal,
                ReceivedTarget::NoNumber => f64::NAN,
            };
            let sent = if is_kept_back { f64::NAN } else { *command };
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
const HEAD: usize = count(Each::Test);
/// Columns of every axis.
const WIDTH: usize = count(Each::Axis);
/// Columns of every coordinate of a loading unit.
const COORDINATE_WIDTH: usize = count(Each::Coordinate);

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
#[must_use]
pub fn received_columns(
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
