//! A rehearsal as `gusset check --json` prints it, and the specimens that move at another velocity.

use serde_json::{Value, json};

use super::table::Table;
use gusset_control::engine::{Ending, Stop};
use gusset_control::port::Poses;
use gusset_quantity::units::{number, quantity};
use gusset_session::rehearsal::{FullRehearsal, Need, Rehearsal, Speeds, Used};

/// A row for each specimen that does not move at the velocities of the test.
pub fn tabulate_speeds(full: &FullRehearsal, table: &mut Table) {
    for speeds in &full.speeds {
        let name = full.rehearsal.specimens.get(speeds.specimen);
        let name = name.map_or("", |needs| needs.name.as_str());
        for (axis, [here, meant]) in speeds.axes.iter().enumerate() {
            let text = format!(
                "{name}, axis {}: {} times the velocity of the test: up to {} and {} in the laboratory, {} and {} in the test",
                axis + 1,
                number(speeds.ratio),
                quantity(here.vel, "m/s"),
                quantity(here.force, "N"),
                quantity(meant.vel, "m/s"),
                quantity(meant.force, "N"),
            );
            table.row("speed", &text);
        }
    }
}

fn speeds_json(speeds: &Speeds) -> Value {
    let peaks = |of: usize| -> Vec<Value> {
        let axes = speeds.axes.iter().map(|axis| &axis[of]);
        axes.map(|peak| json!({"velocity_m_per_s": peak.vel, "force_n": peak.force}))
            .collect()
    };
    json!({
        "specimen": speeds.specimen + 1,
        "ratio": speeds.ratio,
        "laboratory": peaks(0),
        "test": peaks(1),
    })
}

/// `rehearsal` of `check --json`.
pub fn as_json(full: &FullRehearsal) -> Value {
    let Rehearsal {
        time,
        ending,
        wall_s,
        tick_s,
        specimens,
        peak_disp,
        ..
    } = &full.rehearsal;
    let level = |value: f64| value.is_finite().then_some(value);
    let need = |need: &Need| {
        json!({
            "quantity": need.quantity.key(),
            "low": need.needed.low,
            "low_at_s": need.needed.low_at,
            "high": need.needed.high,
            "high_at_s": need.needed.high_at,
            "warn": need.warn.map(level),
            "trip": need.trip.map(level),
            "margin": need.margin(),
            "trips": need.trips(),
            "warns": need.warns(),
        })
    };
    let specimens: Vec<Value> = specimens
            .iter()
            .map(|needs| {
                let axes = needs.axes.iter();
                let axes: Vec<Vec<Value>> =
                    axes.map(|all| all.iter().map(need).collect()).collect();
                let mut found = json!({
                    "name": needs.name,
                    "stand_in": needs.stand_in.key(),
                    "axes": axes,
                    "power_w": needs.found.iter().map(|found| found.power.high).collect::<Vec<_>>(),
                    "capacity": (0..needs.found.len()).map(|axis| capacity_json(&needs.used(axis))).collect::<Vec<_>>(),
                });
                if let (Some(found), Some(poses)) = (found.as_object_mut(), &needs.poses) {
                    found.insert("platform".to_owned(), platform_json(poses));
                }
                found
            })
            .collect();
    let hold = full.held.as_ref().map(|held| {
        let (specimen, axis) = held.fastest;
        json!({
            "time_s": held.at,
            "specimen": specimen + 1,
            "axis": axis + 1,
            "needs": held.needs().map(need).collect::<Vec<_>>(),
        })
    });
    let findings = full.findings.iter().chain(&full.unknown);
    let findings = findings.map(|finding| &finding.headline);
    json!({
        "time_s": time,
        "peak_displacement": peak_disp,
        "wall_s": wall_s,
        "tick_s": tick_s,
        "complete": *ending == Ending::Completed,
        "stopped": match ending {
            Ending::Stopped(Stop::Operator) => Some("out of budget".to_owned()),
            Ending::Stopped(stop) => Some(stop.to_string()),
            Ending::Completed => None,
        },
        "specimens": specimens,
        "speeds": full.speeds.iter().map(speeds_json).collect::<Vec<_>>(),
        "hold": hold,
        "findings": findings.collect::<Vec<_>>(),
    })
}

fn platform_json(poses: &Poses) -> Value {
    let range = poses.range.iter().map(|(coordinate, low, high)| {
        json!({ "coordinate": coordinate.key(), "unit": coordinate.unit(), "low": low, "high": high })
    });
    json!({
        "range": range.collect::<Vec<_>>(),
        "condition": poses.condition[0],
        "worst_condition": poses.condition[1],
        "worst_pose": poses.worst,
    })
}

fn capacity_json(used: &[Used]) -> Value {
    let each = used.iter().map(|used| {
        json!({
            "key": used.key,
            "unit": used.unit,
            "needed": used.needed,
            "capacity": used.capacity,
            "share": used.share(),
        })
    });
    Value::Array(each.collect())
}
