//! The line of `events.jsonl` for an event of the loop, and the sentence for it in the log.
//!
//! The line has numbers in full precision under the names of the contract. The sentence is for people: it names the specimen
//! and rounds its numbers.

use serde_json::{Map, Value};

use super::super::append::Store;
use super::super::miss::{Evidence, ON_MISS, classify, late_words};
use super::super::utc::rfc3339;
use super::super::{Event, EventKind, MissCause};
use super::names::{fault_name, kind_name};
use super::{BEARS_A_FORCE, EventLog, reference_words};
use crate::substructure::{AGREED, LinkFault};
use crate::units::{compared, compared_within, duration, number, reading, unit_of_key};

/// Log lines of one kind before they move to the debug level; the file has them all.
const LOUD: u64 = 5;

impl<S: Store> EventLog<S> {
    /// Fills a line, and writes the sentence to the log.
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
                tracing::info!("{}{}", at(event), name.replace('_', " "));
            }
            EventKind::ContinueDropped { hold, latest } => {
                put(line, "hold", hold);
                put(line, "latest", latest);
                tracing::warn!(
                    "{}`continue` is ignored: it was for hold {hold}, and the latest hold is {latest}",
                    at(event)
                );
            }
            EventKind::Grid { of, first_edge_ns } => {
                put(line, "of", of.word());
                put(line, "first_edge_ns", first_edge_ns);
            }
            EventKind::Gap { late_ns, ticks } => {
                put(line, "late_ns", late_ns);
                put(line, "ticks", ticks);
                tracing::warn!(
                    "{}no command was sent for {}",
                    at(event),
                    duration(late_ns as f64 / 1e9)
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
                        "{}deadline missed by {}; cause: {}",
                        at(event),
                        duration(late_ns as f64 / 1e9),
                        cause_words(class)
                    );
                }
            }
            EventKind::Stale { port, age } => {
                self.specimen(line, port);
                put(line, "age", age);
                if loud(&mut self.logged[1]) {
                    tracing::warn!(
                        "{}{}: stale measurement, {age} ticks old",
                        at(event),
                        self.of(port)
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
                    LinkFault::Diverged => "the computation failed",
                    _ => "the link is lost",
                };
                tracing::error!("{}{}: {lost}: {fault}", at(event), self.of(port));
            }
            EventKind::Unacknowledged { port } => {
                self.specimen(line, port);
                tracing::warn!(
                    "{}: the server did not acknowledge the end of the test: {AGREED}",
                    self.of(port)
                );
            }
            EventKind::Interlock { port } => {
                self.specimen(line, port);
                tracing::error!("{}{}: the interlock is open", at(event), self.of(port));
            }
            EventKind::Probing { port } => {
                self.specimen(line, port);
                // Loud: it moves.
                tracing::warn!(
                    "{}: wiring check: each axis moves a little and back",
                    self.of(port)
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
                    "{}: wiring check: displacement {}, force {} (units of the axis)",
                    self.axis(port, axis),
                    number(disp),
                    number(force)
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
                let [found, left, within] = compared_within(found, left, within);
                tracing::warn!(
                    "{}: the load cell reads {found}, and {left} ± {within} is expected after the interruption (unit of the axis); {}",
                    self.axis(port, axis),
                    if is_taken {
                        "the difference is taken for drift of its zero"
                    } else {
                        "its zero stays unchanged"
                    }
                );
            }
            EventKind::DirectionUnknown { port, axis } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                tracing::warn!(
                    "{}: the static load does not show which way round it is wired",
                    self.axis(port, axis)
                );
            }
            EventKind::Stands { port, axis, values } | EventKind::Moved { port, axis, values } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                let [found, left, within] = values;
                put(line, "found", found);
                put(line, "left", left);
                put(line, "within", within);
                let [found, left, within] = compared_within(found, left, within);
                let text = format!(
                    "{}: it is at {found}, and was left at {left} ± {within} (unit of the axis)",
                    self.axis(port, axis)
                );
                if matches!(event.kind, EventKind::Stands { .. }) {
                    tracing::info!("{text}");
                } else {
                    tracing::error!("{text}: it has moved since the interruption");
                }
            }
            EventKind::Misfit { port, axis, what } => {
                self.specimen(line, port);
                put(line, "axis", axis + 1);
                put(line, "what", what);
                tracing::error!(
                    "{}: not armed: the wiring check found {}",
                    self.axis(port, axis),
                    what.replace('_', " ")
                );
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
                    "{}{}: geometry: {}",
                    at(event),
                    self.of(port),
                    what.replace('_', " ")
                );
            }
            EventKind::Saturated { port } => {
                self.specimen(line, port);
                tracing::error!(
                    "{}{}: a sensor or actuator is at the end of its range",
                    at(event),
                    self.of(port)
                );
            }
            EventKind::Holds { port } => {
                self.specimen(line, port);
                tracing::warn!(
                    "{}{}: it reports that its own watchdog holds it: commands do not move it",
                    at(event),
                    self.of(port)
                );
            }
            EventKind::HoldsOn { port } => {
                self.specimen(line, port);
                tracing::error!(
                    "{}{}: it still reports that its own watchdog holds it",
                    at(event),
                    self.of(port)
                );
            }
            EventKind::Unsettled { port, ticks } => {
                self.specimen(line, port);
                put(line, "ticks", ticks);
                tracing::warn!(
                    "{}{}: the actuator–specimen iteration did not converge in {ticks} ticks",
                    at(event),
                    self.of(port)
                );
            }
            EventKind::Pace { from, to, share } => {
                put(line, "from", from);
                put(line, "to", to);
                put(line, "share", share);
                if loud(&mut self.logged[4]) {
                    tracing::info!("{}{from} → {to}", at(event));
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
                tracing::info!("{}{from} → {to} ({})", at(event), cause.replace('_', " "));
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
                    tracing::warn!(
                        "{}{}: {}",
                        at(event),
                        self.axis(port, axis),
                        limit_words(quantity, trip, value, bound)
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
                    let most = worst.map_or_else(String::new, |(port, axis)| {
                        format!(", most of it at {}", self.axis(port, axis))
                    });
                    let words = limit_words(quantity, trip, value, bound);
                    tracing::warn!("{}{words}{most}", at(event));
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
                let [mean, longest] = [mean_ns, longest_ns].map(|ns| duration(ns as f64 / 1e9));
                let text = format!(
                    "warm-up of {ticks} ticks: {missed} deadlines missed, at most {in_a_row} in a row; a tick took {mean} on \
                     average and {longest} at most"
                );
                if go {
                    tracing::info!("{text}: the test starts");
                } else {
                    tracing::error!("{text}: the test does not start");
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
                let [force, most] = compared(force, most, "N");
                let (axis, of) = (self.axis(port, axis), reference_words(of));
                tracing::warn!("{axis}: {BEARS_A_FORCE}: {force}, allowed {most} ({of})");
            }
            EventKind::Zeroed { port, axis, values } => {
                self.specimen(line, port);
                put(line, "axis", u64::from(axis) + 1);
                let [disp, force, disp_noise, force_noise] = values;
                put(line, "disp", disp);
                put(line, "force", force);
                put(line, "disp_noise_rms", disp_noise);
                put(line, "force_noise_rms", force_noise);
                let [disp, _] = reading(disp, Some(disp_noise));
                let [force, _] = reading(force, Some(force_noise));
                tracing::info!(
                    "{}: zero readings: displacement {disp}, force {force} (units of the axis)",
                    self.axis(port, axis)
                );
            }
            EventKind::RowLost => {
                if loud(&mut self.logged[2]) {
                    tracing::error!("{}row lost: the queue to the writer is full", at(event));
                }
            }
            EventKind::Diverged { dof } => {
                put(line, "dof", u64::from(dof) + 1);
                tracing::error!("{}the response of DOF {} diverged", at(event), dof + 1);
            }
        }
    }

    /// A specimen by its name.
    fn of(&self, port: u32) -> String {
        match self.specimens.get(port as usize) {
            Some(name) => format!("specimen \"{name}\""),
            None => format!("specimen {}", port + 1),
        }
    }

    /// An axis of a specimen, by the name of the specimen.
    fn axis(&self, port: u32, axis: u32) -> String {
        format!("{}, axis {}", self.of(port), axis + 1)
    }

    fn specimen(&self, line: &mut Map<String, Value>, port: u32) {
        put(line, "specimen", u64::from(port) + 1);
        if let Some(name) = self.specimens.get(port as usize) {
            put(line, "name", name.as_str());
        }
    }
}

/// Class of a miss in words.
pub(super) const fn cause_words(class: MissCause) -> &'static str {
    match class {
        MissCause::Preempted => "preempted (another thread had the processor)",
        MissCause::TakenAway => "hypervisor or interrupt (the processor was taken away)",
        MissCause::LateReply => "late reply of a specimen",
        MissCause::Ours => "own (long computation, page fault or full queue)",
    }
}

/// The beginning of a sentence about a moment of the test, to 0.1 ms.
fn at(event: &Event) -> String {
    format!("t = {:.4} s: ", event.time)
}

fn limit_words(limit: &str, trip: bool, value: f64, bound: f64) -> String {
    if limit == ON_MISS {
        return format!("TRIP: {}", late_words(value, bound));
    }
    let [value, bound] = compared(value, bound, unit_of_key(limit));
    if trip {
        format!("TRIP: {limit} is {value}, allowed {bound}")
    } else {
        format!("{limit} is {value}, beyond its warning level of {bound}")
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
            "no more events of this kind are shown; events.jsonl of a run folder has all of them"
        );
    }
    *count <= LOUD
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tick_late_by_a_period_is_told_with_units_and_its_key() {
        let words = limit_words(ON_MISS, true, 0.0206, 1.0 / 1024.0);
        for part in ["TRIP: ", "20.6 ms", "976.6 µs", "`timing.on_miss"] {
            assert!(words.contains(part), "no {part:?} in {words}");
        }
    }
}
