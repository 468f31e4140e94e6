//! A rehearsal as `gusset check` prints it: the needs of each axis beside its limits.

use serde_json::{Value, json};

use super::table::Table;
use gusset_control::engine::{Ending, Stop};
use gusset_control::port::Poses;
use gusset_quantity::units::{duration, number, quantity};
use gusset_session::rehearsal::{FullRehearsal, Held, Need, Rehearsal, Speeds, StandIn, Used};

/// The needs of each axis beside its limits: one line per quantity.
pub fn tabulate(full: &FullRehearsal, table: &mut Table) {
    let Rehearsal {
        time,
        ending,
        wall_s,
        tick_s,
        specimens,
        ..
    } = &full.rehearsal;
    let each = tick_s.map(|tick| format!(", {} a tick", duration(tick)));
    let how = match ending {
        Ending::Completed => "",
        Ending::Stopped(Stop::Operator) => "; the rest exceeds the rehearsal budget",
        Ending::Stopped(_) => ", then the test would stop",
    };
    let text = format!(
        "{} of test time on the simulated clock in {}{}{how}",
        duration(*time),
        duration(*wall_s),
        each.unwrap_or_default()
    );
    table.row("rehearsal", &text);
    for needs in specimens {
        table.row(
            &needs.name,
            &format!("rehearsed with {}", needs.stand_in.words()),
        );
        let word = match &needs.poses {
            Some(poses) => {
                table.row("  platform", &platform(poses));
                "actuator"
            }
            None => "axis",
        };
        for (axis, all) in needs.axes.iter().enumerate() {
            let lines: Vec<String> = all.iter().map(line).collect();
            let mut text = lines.join("\n");
            if let Some(found) = needs.found.get(axis)
                && needs.stand_in != StandIn::Nothing
            {
                let power = quantity(found.power.high, "W");
                text.push_str(&format!("\npower up to {power}"));
            }
            for used in needs.used(axis) {
                text.push_str(&format!("\n{}", of_rig(&used)));
            }
            table.row(&format!("  {word} {} needs", axis + 1), &text);
        }
    }
    tabulate_speeds(full, table);
    if let Some(text) = full.held.as_ref().and_then(held) {
        table.row("a hold", &text);
    }
}

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

/// The needs of the fastest axis in a hold at its fastest moment.
fn held(held: &Held) -> Option<String> {
    let (specimen, axis) = held.fastest;
    let name = &held.specimens.get(specimen)?.name;
    let lines: Vec<String> = held.needs().map(line).collect();
    Some(format!(
        "requested at {}, where axis {} of `{name}` is fastest, needs\n{}",
        duration(held.at),
        axis + 1,
        lines.join("\n")
    ))
}

/// The range of the platform of a loading unit.
fn platform(poses: &Poses) -> String {
    let each = poses.range.iter().map(|(coordinate, low, high)| {
        let value = |value: f64| quantity(value, coordinate.unit());
        format!("{} {} to {}", coordinate.key(), value(*low), value(*high))
    });
    let each: Vec<String> = each.collect();
    let [at_rest, worst] = poses.condition;
    let worst = if worst > at_rest {
        format!("; at worst {worst:.3} at {}", poses.worst)
    } else {
        String::new()
    };
    format!(
        "{}\ncondition {at_rest:.3} at the reference pose{worst}",
        each.join(", ")
    )
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

/// A capacity of the rig and the used share.
fn of_rig(used: &Used) -> String {
    let verdict = if used.is_within() {
        ""
    } else {
        " — MORE THAN THE RIG CAN GIVE"
    };
    format!(
        "{} of the rig: {} of {} used ({:.0} %){verdict}",
        used.key.split('_').next().unwrap_or(used.key),
        quantity(used.needed, used.unit),
        quantity(used.capacity, used.unit),
        100.0 * used.share()
    )
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

fn line(need: &Need) -> String {
    let unit = need.quantity.shown_unit();
    let value = |value: f64| quantity(value, unit);
    let needed = if need.quantity.is_range() {
        format!("{} to {}", value(need.needed.low), value(need.needed.high))
    } else {
        format!("up to {}", value(need.needed.high))
    };
    let [low, high] = need.trip;
    let limit = match (low.is_finite(), high.is_finite()) {
        (false, false) => "no trip level".to_owned(),
        (true, true) => format!("trips outside {} to {}", value(low), value(high)),
        (true, false) => format!("trips below {}", value(low)),
        (false, true) => format!("trips above {}", value(high)),
    };
    let margin = need.margin().map_or_else(String::new, |margin| {
        format!(", margin {:.0} %", 100.0 * margin)
    });
    let verdict = if need.trips() {
        " — WOULD TRIP"
    } else if need.warns() {
        " — would warn"
    } else {
        ""
    };
    format!(
        "{}: {needed}; {limit}{margin}{verdict}",
        need.quantity.words()
    )
}
