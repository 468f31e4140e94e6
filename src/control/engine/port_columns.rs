//! The columns that a specimen has in a row: their description, and their numbers.
//!
//! Which number stands where is decided here, twice in the same order; [`super::columns::Row`] knows where the specimen's
//! part of a row begins.

use std::ops::Range;

use crate::port::{LoadingUnit, Port};
use gusset_quantity::catalog::column::{
    ACTUATOR_FORCE, ADDED, CLOCK_PPM, COMMAND, COMPENSATION, EXCHANGES, FALSE_DAMPING, FORCE, GAIN,
    JUDGED, Kind, LAG, MARGIN, MEASURED, MEASURED_POSE, POSE, POSE_FORCE, RAW_DISP, RAW_FORCE,
    SEQUENCE, STALE, STATUS, STIFFNESS, STROKE, TANGENT, TANGENT_DAMPING, TARGET,
};
use gusset_record::Column;

/// The numbers of a port, in the order of its columns. Real-time: yes.
#[inline]
pub(super) fn port_values(slots: &mut [f64], width: usize, port: &Port) {
    let raw = port.feedback().raw();
    if let [.., sequence, status, exchanges, stale] = &mut *slots {
        *sequence = raw.sequence as f64;
        *status = f64::from(raw.status.0);
        *exchanges = port.exchange().count().sent as f64;
        *stale = port.exchange().count().stale as f64;
    }
    let Some((axes, further)) = slots.split_at_mut_checked(width * port.axes()) else {
        return;
    };
    let slots_of_axes = axes.chunks_exact_mut(width).enumerate();
    for ((axis, slot), (stiffness, damping, energy)) in slots_of_axes.zip(port.estimates().values())
    {
        let Some((motion, [kt, added, rest @ ..])) = slot.split_first_chunk_mut() else {
            return;
        };
        *motion = port.motion_of(axis);
        *kt = stiffness;
        *added = energy;
        if let (Some(ct), Some(damping)) = (rest.first_mut(), damping) {
            *ct = damping;
        }
    }
    // The last four are written already.
    let Some((further, _)) = further.split_last_chunk_mut::<4>() else {
        return;
    };
    if !further.is_empty() {
        let tracking = port.tracking().values().flatten();
        let poses = port
            .loading_unit()
            .into_iter()
            .flat_map(LoadingUnit::pose)
            .flat_map(|(_, values)| values);
        let margins = port
            .tracking()
            .knows_margin()
            .then(|| port.tracking().delay_margins());
        let margins = margins.into_iter().flatten();
        let all = tracking
            .chain(margins)
            .chain(port.path().compensation_parameters())
            .chain(poses)
            .chain(port.guard().judged())
            .chain(port.exchange().clock_ppm());
        for (slot, value) in further.iter_mut().zip(all) {
            *slot = value;
        }
    }
}

/// Columns that every axis of a port has side by side.
pub(super) fn width_of_axis(port: &Port) -> usize {
    let damping = port
        .estimates()
        .values()
        .any(|(_, damping, _)| damping.is_some());
    8 + usize::from(damping)
}

pub(super) fn port_columns(columns: &mut Vec<Column>, number: usize, port: &Port) -> Range<usize> {
    let start = columns.len();
    let specimen = format!("specimen \"{}\"", port.name());
    let of_axis = |kind: &Kind, axis: usize| Column {
        meaning: format!("{}, {specimen}, axis {axis}", kind.meaning),
        ..named(kind, kind.of_axis(number, axis))
    };
    let (target, force) = if port.geometry().is_some() {
        (STROKE, ACTUATOR_FORCE)
    } else {
        (TARGET, FORCE)
    };
    let has_damping = port
        .estimates()
        .values()
        .any(|(_, damping, _)| damping.is_some());
    let always = [
        target, COMMAND, MEASURED, force, RAW_DISP, RAW_FORCE, TANGENT, ADDED,
    ];
    let damping = has_damping.then_some(TANGENT_DAMPING);
    let tracked = [LAG, GAIN, STIFFNESS, FALSE_DAMPING];
    for axis in 1..=port.axes() {
        let kinds = always.iter().chain(&damping);
        columns.extend(kinds.map(|kind| of_axis(kind, axis)));
    }
    if port.tracking().is_on() {
        for axis in 1..=port.axes() {
            columns.extend(tracked.iter().map(|kind| of_axis(kind, axis)));
        }
    }
    if port.tracking().knows_margin() {
        columns.extend((1..=port.axes()).map(|axis| of_axis(&MARGIN, axis)));
    }
    for (axis, parameter) in port.path().compensation_names() {
        let (key, axis) = (parameter.name, axis + 1);
        let meaning = COMPENSATION.meaning.replace("NAME", key);
        columns.push(Column {
            unit: parameter.unit.into(),
            meaning: format!("{meaning}, {specimen}, axis {axis}"),
            ..named(&COMPENSATION, COMPENSATION.of_parameter(key, number, axis))
        });
    }
    for (index, (coordinate, _)) in port
        .loading_unit()
        .into_iter()
        .flat_map(LoadingUnit::pose)
        .enumerate()
    {
        let (unit, force_unit) = (coordinate.unit(), coordinate.force_unit());
        let kinds = [
            (&POSE, unit),
            (&MEASURED_POSE, unit),
            (&POSE_FORCE, force_unit),
        ];
        for (kind, unit) in kinds {
            columns.push(Column {
                unit: unit.into(),
                meaning: format!("{}, {specimen}, {}", kind.meaning, coordinate.key()),
                ..named(kind, kind.of_axis(number, index + 1))
            });
        }
    }
    for (axis, limit) in port.guard().recorded_limits() {
        let (row, axis) = (limit.row(), axis + 1);
        columns.push(Column {
            unit: row.unit.into(),
            meaning: format!(
                "{}: value that `{}` judged in this tick, none where nothing was judged, {specimen}, axis {axis}",
                row.words, row.key
            ),
            ..named(&JUDGED, JUDGED.of_parameter(row.name, number, axis))
        });
    }
    let clock = port.exchange().clock_ppm().map(|_| &CLOCK_PPM);
    let kinds = clock
        .into_iter()
        .chain([&SEQUENCE, &STATUS, &EXCHANGES, &STALE]);
    for kind in kinds {
        columns.push(Column {
            meaning: kind.told(&specimen),
            ..named(kind, kind.of_specimen(number))
        });
    }
    start..columns.len()
}

/// The column of the test of this kind.
pub(super) fn of_test(kind: &Kind) -> Column {
    named(kind, kind.name().to_owned())
}

/// A column of this kind, as the catalogue describes it.
pub(super) fn named(kind: &Kind, name: String) -> Column {
    Column {
        name,
        unit: kind.unit.into(),
        meaning: kind.told(""),
        timing: kind.is_timing(),
    }
}
