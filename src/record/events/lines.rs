//! What a line of `events.jsonl` says of an event of the loop, and what the log says of it.

use serde_json::{Map, Value};

use super::super::append::Store;
use super::super::miss::{Evidence, classify};
use super::super::utc::rfc3339;
use super::super::{Event, EventKind};
use super::names::{fault_name, kind_name};
use super::{BEARS_A_FORCE, EventLog};
use crate::substructure::{AGREED, LinkFault};

/// Log lines of one kind before they move to the debug level; the file has them all.
const LOUD: u64 = 5;

impl<S: Store> EventLog<S> {
    /// Fills a line, and tells the log.
    pub(super) fn describe(&mut self, event: &Event, wall_ns: u64, line: &mut Map<String, Value>) {
        let name = kind_name(&event.kind);
        head(
            line,
            Some(event.tick),
            Some(event.time),
            wall_ns,
            Some(event.clock_ns),
            name,
        );
        match event.kind {
            EventKind::Started
            | EventKind::Ended
            | EventKind::StopRequested
            | EventKind::HoldRequested
            | EventKind::ContinueRequested
            | EventKind::Confirmed => {
                tracing::info!(tick = event.tick, time = event.time, "{name}");
            }
            EventKind::ContinueDropped { hold, latest } => {
                put(line, "hold", hold);
                put(line, "latest", latest);
                tracing::warn!(tick = event.tick, time = event.time, hold, latest, "{name}");
            }
            EventKind::Grid { of, first_edge_ns } => {
                put(line, "of", of.word());
                put(line, "first_edge_ns", first_edge_ns);
            }
            EventKind::Gap { late_ns, ticks } => {
                put(line, "late_ns", late_ns);
                put(line, "ticks", ticks);
                tracing::warn!(
                    tick = event.tick,
                    time = event.time,
                    late_ms = late_ns as f64 / 1e6,
                    "no command left meanwhile"
                );
            }
            EventKind::Miss {
                late_ns,
                stretched,
                cause,
            } => {
                // The miss began at the latest one tick before its deadline: in the tick that ended late.
                let from = event
                    .clock_ns
                    .saturating_sub(late_ns.saturating_add(self.tick_ns));
                let evidence = self.window.evidence(from, event.clock_ns);
                let class = classify(cause, evidence);
                self.classes.count(class);
                put(
                    line,
                    "class",
                    serde_json::to_value(class).unwrap_or_default(),
                );
                put(line, "late_ns", late_ns);
                put(line, "stretched", stretched);
                if let Some(Evidence {
                    involuntary_switches,
                    minor_faults,
                    steal_ms,
                }) = evidence
                {
                    put(line, "steal_ms", steal_ms);
                    put(line, "involuntary_switches", involuntary_switches);
                    put(line, "minor_faults", minor_faults);
                }
                if loud(&mut self.logged[0]) {
                    tracing::warn!(
                        tick = event.tick,
                        time = event.time,
                        late_us = late_ns as f64 / 1e3,
                        ?class,
                        "deadline missed"
                    );
                }
            }
            EventKind::Stale { port, age } => {
                self.specimen(line, port);
                put(line, "age", age);
                if loud(&mut self.logged[1]) {
                    tracing::warn!(
                        tick = event.tick,
                        time = event.time,
                        specimen = port + 1,
                        age,
                        "stale measurement"
                    );
                }
            }
            EventKind::Recovered {
                port,
                axis,
                age,
                force,
            } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                put(line, "age", age);
                put(line, "force", force);
            }
            EventKind::Link { port, fault } => {
                self.specimen(line, port);
                put(line, "fault", fault_name(fault));
                put(line, "message", fault.to_string());
                let lost = match fault {
                    LinkFault::Diverged => "computation lost",
                    _ => "link lost",
                };
                tracing::error!(
                    tick = event.tick,
                    time = event.time,
                    specimen = port + 1,
                    "{lost}: {fault}"
                );
            }
            EventKind::Unacknowledged { port } => {
                self.specimen(line, port);
                tracing::warn!(
                    specimen = port + 1,
                    "the end of the test was not acknowledged: {AGREED}"
                );
            }
            EventKind::Interlock { port } => {
                self.specimen(line, port);
                tracing::error!(
                    tick = event.tick,
                    time = event.time,
                    specimen = port + 1,
                    "interlock open"
                );
            }
            EventKind::Probing { port } => {
                self.specimen(line, port);
                // Loud: it moves.
                tracing::warn!(
                    specimen = port + 1,
                    "the specimen is moved a little and back, to see which way round it is wired"
                );
            }
            EventKind::Direction {
                port,
                axis,
                disp,
                force,
            } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                put(line, "disp", disp);
                put(line, "force", force);
                tracing::info!(
                    specimen = port + 1,
                    axis = axis + 1,
                    disp,
                    force,
                    "direction"
                );
            }
            EventKind::ForceChanged {
                port,
                axis,
                left,
                found,
                within,
                is_taken,
            } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                put(line, "left", left);
                put(line, "found", found);
                put(line, "within", within);
                put(line, "taken_for_drift", is_taken);
                tracing::warn!(
                    specimen = port + 1,
                    axis = axis + 1,
                    left,
                    found,
                    within,
                    "{}",
                    if is_taken {
                        "another force than the test was left with: taken for drift of the load cell"
                    } else {
                        "another force than the test was left with: the zero of the load cell stays"
                    }
                );
            }
            EventKind::DirectionUnknown { port, axis } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                tracing::warn!(
                    specimen = port + 1,
                    axis = axis + 1,
                    "the static load does not show which way round it is wired"
                );
            }
            EventKind::Stands { port, axis, values } | EventKind::Moved { port, axis, values } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                let [found, left, within] = values;
                put(line, "found", found);
                put(line, "left", left);
                put(line, "within", within);
                let (specimen, axis) = (port + 1, axis + 1);
                if matches!(event.kind, EventKind::Stands { .. }) {
                    tracing::info!(specimen, axis, found, left, within, "stands");
                } else {
                    let what = "it does not stand where it was left";
                    tracing::error!(specimen, axis, found, left, within, "{what}");
                }
            }
            EventKind::Misfit { port, axis, what } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                put(line, "what", what);
                tracing::error!(specimen = port + 1, axis = axis + 1, "not armed: {what}");
            }
            EventKind::Geometry {
                port,
                actuator,
                what,
            } => {
                self.specimen(line, port);
                if let Some(actuator) = actuator {
                    put(line, "axis", actuator + 1);
                }
                put(line, "what", what);
                tracing::error!(
                    tick = event.tick,
                    time = event.time,
                    specimen = port + 1,
                    "geometry: {what}"
                );
            }
            EventKind::Saturated { port } => {
                self.specimen(line, port);
                tracing::error!(
                    tick = event.tick,
                    time = event.time,
                    specimen = port + 1,
                    "a sensor or actuator is at the end of its range"
                );
            }
            EventKind::Holds { port } => {
                self.specimen(line, port);
                tracing::warn!(
                    tick = event.tick,
                    time = event.time,
                    specimen = port + 1,
                    "it says that it holds by its own watchdog: commands do not move it"
                );
            }
            EventKind::HoldsOn { port } => {
                self.specimen(line, port);
                tracing::error!(
                    tick = event.tick,
                    time = event.time,
                    specimen = port + 1,
                    "it goes on saying that its own watchdog holds it"
                );
            }
            EventKind::Unsettled { port, ticks } => {
                self.specimen(line, port);
                put(line, "ticks", ticks);
                tracing::warn!(
                    tick = event.tick,
                    time = event.time,
                    specimen = port + 1,
                    ticks,
                    "the simulated actuator did not come to terms with what it moves"
                );
            }
            EventKind::Pace { from, to, share } => {
                put(line, "from", from);
                put(line, "to", to);
                put(line, "share", share);
                if loud(&mut self.logged[4]) {
                    tracing::info!(tick = event.tick, time = event.time, "{from} → {to}");
                }
            }
            EventKind::Checkpoint { digest } => put(line, "digest", format!("{digest:016x}")),
            EventKind::Phase {
                from,
                to,
                cause,
                port,
            } => {
                put(line, "from", from);
                put(line, "to", to);
                put(line, "cause", cause);
                if let Some(port) = port {
                    self.specimen(line, port);
                }
                tracing::info!(tick = event.tick, time = event.time, cause, "{from} → {to}");
            }
            EventKind::Limit {
                port,
                axis,
                quantity,
                trip,
                value,
                bound,
            } => {
                self.specimen(line, port);
                put(line, "axis", u64::from(axis) + 1);
                put(line, "limit", quantity);
                put(line, "value", value);
                put(line, "bound", bound);
                if trip || loud(&mut self.logged[3]) {
                    let level = if trip { "trips" } else { "warning" };
                    tracing::warn!(
                        tick = event.tick,
                        time = event.time,
                        specimen = port + 1,
                        axis = axis + 1,
                        value,
                        bound,
                        "{quantity} {level}"
                    );
                }
            }
            EventKind::TestLimit {
                quantity,
                trip,
                value,
                bound,
                worst,
            } => {
                if let Some((port, axis)) = worst {
                    self.specimen(line, port);
                    put(line, "axis", axis + 1);
                }
                put(line, "limit", quantity);
                put(line, "value", value);
                put(line, "bound", bound);
                if trip || loud(&mut self.logged[3]) {
                    let level = if trip { "trips" } else { "warning" };
                    let (tick, time) = (event.tick, event.time);
                    let specimen = worst.map(|(port, _)| port + 1);
                    tracing::warn!(tick, time, specimen, value, bound, "{quantity} {level}");
                }
            }
            EventKind::Readiness {
                go,
                ticks,
                missed,
                in_a_row,
                mean_ns,
                longest_ns,
            } => {
                put(line, "ticks", ticks);
                put(line, "missed", missed);
                put(line, "in_a_row", in_a_row);
                put(line, "mean_ns", mean_ns);
                put(line, "longest_ns", longest_ns);
                if go {
                    tracing::info!(ticks, missed, in_a_row, mean_ns, longest_ns, "{name}");
                } else {
                    tracing::error!(ticks, missed, in_a_row, mean_ns, longest_ns, "{name}");
                }
            }
            EventKind::InitialForce {
                port,
                axis,
                of,
                force,
                most,
            } => {
                self.specimen(line, port);
                put(line, "axis", u64::from(axis) + 1);
                put(line, "of", of);
                put(line, "force", force);
                put(line, "most", most);
                let (specimen, axis) = (port + 1, axis + 1);
                tracing::warn!(specimen, axis, force, most, of, "{BEARS_A_FORCE}");
            }
            EventKind::Zeroed { port, axis, values } => {
                self.specimen(line, port);
                put(line, "axis", u64::from(axis) + 1);
                let [disp, force, disp_noise, force_noise] = values;
                put(line, "disp", disp);
                put(line, "force", force);
                put(line, "disp_noise_rms", disp_noise);
                put(line, "force_noise_rms", force_noise);
                tracing::info!(specimen = port + 1, axis = axis + 1, disp, force, "zeroed");
            }
            EventKind::RowLost => {
                if loud(&mut self.logged[2]) {
                    tracing::error!(
                        tick = event.tick,
                        time = event.time,
                        "row lost: the queue to the writer is full"
                    );
                }
            }
            EventKind::Diverged { dof } => {
                put(line, "dof", u64::from(dof) + 1);
                tracing::error!(
                    tick = event.tick,
                    time = event.time,
                    dof = dof + 1,
                    "diverged"
                );
            }
        }
    }

    fn specimen(&self, line: &mut Map<String, Value>, port: u32) {
        put(line, "specimen", u64::from(port) + 1);
        if let Some(name) = self.specimens.get(port as usize) {
            put(line, "name", name.as_str());
        }
    }
}

fn put(line: &mut Map<String, Value>, key: &str, value: impl Into<Value>) {
    line.insert(key.to_owned(), value.into());
}

pub(super) fn head(
    line: &mut Map<String, Value>,
    tick: Option<u64>,
    time: Option<f64>,
    wall_ns: u64,
    clock_ns: Option<u64>,
    event: &str,
) {
    put(line, "tick", tick);
    put(line, "time", time);
    put(line, "wall", rfc3339(wall_ns));
    put(line, "clock_ns", clock_ns);
    put(line, "event", event);
}

fn loud(count: &mut u64) -> bool {
    *count += 1;
    if *count == LOUD + 1 {
        tracing::warn!(
            "further events of this kind are not shown: a run folder that is kept has them in events.jsonl"
        );
    }
    *count <= LOUD
}
