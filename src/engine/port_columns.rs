//! The columns that a specimen has in a row: their description, and their numbers.
//!
//! Which number stands where is decided here, twice in the same order; [`super::columns::Row`] knows where the specimen's
//! part of a row begins.

use std::ops::Range;

use crate::control::Port;
use crate::record::Column;

/// The numbers of a port, in the order of its columns. Real-time: yes.
#[inline]
pub(super) fn port_values(slots: &mut [f64], width: usize, port: &Port) {
    let raw = port.raw();
    if let [.., sequence, status] = &mut *slots {
        *sequence = raw.sequence as f64;
        *status = f64::from(raw.status.0);
    }
    let Some((axes, further)) = slots.split_at_mut_checked(width * port.axes()) else {
        return;
    };
    let at = |values: &[f64], axis: usize| values.get(axis).copied().unwrap_or(f64::NAN);
    let slots_of_axes = axes.chunks_exact_mut(width).enumerate();
    for ((axis, slot), (stiffness, damping, energy)) in slots_of_axes.zip(port.estimates()) {
        let [
            target,
            command,
            measured,
            force,
            raw_disp,
            raw_force,
            kt,
            added,
            rest @ ..,
        ] = slot
        else {
            return;
        };
        *target = at(&port.target, axis);
        *command = at(&port.sent, axis);
        *measured = at(&port.measured, axis);
        *force = at(&port.force, axis);
        *raw_disp = at(&raw.disp, axis);
        *raw_force = at(&raw.force, axis);
        *kt = stiffness;
        *added = energy;
        if let (Some(ct), Some(damping)) = (rest.first_mut(), damping) {
            *ct = damping;
        }
    }
    // The last two are written already.
    let Some((further, _)) = further.split_last_chunk_mut::<2>() else {
        return;
    };
    if !further.is_empty() {
        let tracking = port.tracking().flatten();
        let poses = port.pose().flat_map(|(_, values)| values);
        let margins = port.knows_margin().then(|| port.delay_margins());
        let margins = margins.into_iter().flatten();
        let all = tracking
            .chain(margins)
            .chain(port.compensation_parameters())
            .chain(poses)
            .chain(port.judged());
        for (slot, value) in further.iter_mut().zip(all) {
            *slot = value;
        }
    }
}

/// Columns that every axis of a port has side by side.
pub(super) fn width_of_axis(port: &Port) -> usize {
    let damping = port.estimates().any(|(_, damping, _)| damping.is_some());
    8 + usize::from(damping)
}

pub(super) fn port_columns(columns: &mut Vec<Column>, number: usize, port: &Port) -> Range<usize> {
    let start = columns.len();
    let name = &port.name;
    for axis in 1..=port.axes() {
        let mut add = |kind: &str, unit: &str, meaning: &str| {
            let meaning = format!("{meaning}, specimen \"{name}\", axis {axis}");
            columns.push(column(
                &format!("{kind}_{number}_{axis}"),
                unit,
                &meaning,
                false,
            ));
        };
        let (target, force) = if port.geometry().is_some() {
            (
                "stroke of the actuator for the pose B·x",
                "force of the actuator, at the structure's scale",
            )
        } else {
            (
                "deformation B·x that the structure asks for",
                "restoring force that entered equilibrium",
            )
        };
        add("target", "m", target);
        add("cmd", "specimen unit", "displacement that was sent");
        add(
            "meas",
            "m",
            "measured displacement in the structure's units",
        );
        add("force", "N", force);
        add(
            "raw_disp",
            "specimen unit",
            "measured displacement as it came",
        );
        add("raw_force", "specimen unit", "measured force as it came");
        add(
            "kt",
            "N/m",
            "tangent stiffness, estimated; the declared one until the axis has moved",
        );
        add(
            "added",
            "J",
            "energy that the transfer system has added, negative if it has taken some",
        );
        if port.estimates().any(|(_, damping, _)| damping.is_some()) {
            add("ct", "N s/m", "tangent damping, estimated");
        }
    }
    let tracked = if port.tracks() { port.axes() } else { 0 };
    for axis in 1..=tracked {
        for (key, unit, meaning) in [
            ("lag", "s", "lag behind the target, estimated"),
            (
                "gain",
                "1",
                "measured displacement over the target, estimated",
            ),
            (
                "stiffness",
                "N/m",
                "stiffness as fitted over the last seconds of motion",
            ),
            ("false_c", "N s/m", "damping that the lag adds to it"),
        ] {
            let meaning = format!("{meaning}, specimen \"{name}\", axis {axis}");
            columns.push(column(
                &format!("{key}_{number}_{axis}"),
                unit,
                &meaning,
                false,
            ));
        }
    }
    let margins = if port.knows_margin() { port.axes() } else { 0 };
    for axis in 1..=margins {
        let meaning = format!(
            "critical delay at the stiffness of the last seconds less their lag: below 0 the test grows; inf where every delay is \
             stable, specimen \"{name}\", axis {axis}"
        );
        let key = format!("margin_{number}_{axis}");
        columns.push(column(&key, "s", &meaning, false));
    }
    for (axis, parameter) in port.compensation_names() {
        let (key, axis) = (parameter.name, axis + 1);
        let meaning =
            format!("parameter {key} of the compensation, specimen \"{name}\", axis {axis}");
        let key = format!("comp_{key}_{number}_{axis}");
        columns.push(column(&key, parameter.unit, &meaning, false));
    }
    for (index, (coordinate, _)) in port.pose().enumerate() {
        let (key, unit) = (coordinate.key(), coordinate.unit());
        for (kind, unit, meaning) in [
            ("pose", unit, "pose B·x that the structure asks for"),
            ("pose_meas", unit, "pose that the measured strokes have"),
            (
                "pose_force",
                coordinate.force_unit(),
                "force that entered equilibrium",
            ),
        ] {
            let meaning = format!("{meaning}, specimen \"{name}\", {key}");
            let key = format!("{kind}_{number}_{}", index + 1);
            columns.push(column(&key, unit, &meaning, false));
        }
    }
    for (axis, limit) in port.recorded_limits() {
        let (row, axis) = (limit.row(), axis + 1);
        let meaning = format!(
            "{}: value that `{}` judged in this tick, none where nothing was judged, specimen \"{name}\", axis {axis}",
            row.words, row.key
        );
        let key = format!("judged_{}_{number}_{axis}", row.name);
        columns.push(column(&key, row.unit, &meaning, false));
    }
    let meaning = format!("newest command in force when specimen \"{name}\" was sampled");
    columns.push(column(&format!("seq_{number}"), "1", &meaning, false));
    let meaning = format!(
        "status flags of specimen \"{name}\": 1 interlock, 2 holding, 4 saturated, 8 its simulated actuator not \
         settled; of the loop: 65536 lost, 131072 before its last command left, 262144 stale, \
         524288 its answer not waited for, 1048576 beside 2 it held until its last command came"
    );
    columns.push(column(&format!("status_{number}"), "1", &meaning, false));
    start..columns.len()
}

pub(super) fn column(name: &str, unit: &str, meaning: &str, timing: bool) -> Column {
    Column {
        name: name.into(),
        unit: unit.into(),
        meaning: meaning.into(),
        timing,
    }
}
