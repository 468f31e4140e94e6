//! Where the lines of `events.jsonl` stand on the grid of a trace.
//!
//! An event knows its step and the loop's clock, a row its place on the grid. A miss says how long after its edge it was
//! seen, so it ties the two to the nanosecond; without a miss the events may stand as much as a tick early.

use std::collections::{BTreeMap, VecDeque};

use serde_json::{Value, json};

use super::{EVENTS, Stamped, rounded};
use crate::record::export::plan::Choice;
use crate::record::run::Run;

/// Where the steps of the events stand on the grid.
pub(super) struct Places {
    wanted: Vec<usize>,
    /// Step → first and last edge of it, and how many ticks it had.
    steps: BTreeMap<u64, (f64, f64, u64)>,
    /// The edge before, and the shortest way between two.
    edge: f64,
    shortest: f64,
}

impl Places {
    pub fn wanted(told: &[Value], choice: &Choice) -> Self {
        let inside = |event: &Value| match event["time"].as_f64() {
            Some(time) => choice.holds(time),
            None => !choice.is_part(),
        };
        let wanted = told.iter().enumerate();
        let wanted: Vec<usize> = wanted
            .filter(|(_, event)| inside(event))
            .map(|(index, _)| index)
            .collect();
        let step = |index: &usize| told.get(*index)?["tick"].as_u64();
        let steps = wanted.iter().filter_map(step);
        Self {
            steps: steps.map(|step| (step, (f64::NAN, f64::NAN, 0))).collect(),
            wanted,
            edge: f64::NAN,
            shortest: f64::INFINITY,
        }
    }

    pub fn note(&mut self, tick: &Stamped) {
        if !tick.is_stamped() {
            return;
        }
        let way = tick.release - self.edge;
        if way > 0.0 {
            self.shortest = self.shortest.min(way);
        }
        self.edge = tick.release;
        // Steps are counts and exact; what is before the first counts as the first.
        if let Some((first, last, count)) = self.steps.get_mut(&(tick.step.max(0.0) as u64)) {
            if first.is_nan() {
                *first = tick.release;
            }
            *last = tick.release;
            *count += 1;
        }
    }

    /// As the summary has it; of an unfinished run the shortest way between two edges.
    pub fn period_us(&self, run: &Run) -> f64 {
        let rate = run.summary().map(|summary| summary.rate_hz);
        rate.filter(|rate| *rate > 0.0 && rate.is_finite())
            .map_or(self.shortest, |rate| 1e6 / rate)
    }

    /// The events of the window in order, each at its place on the grid.
    pub fn placed(&self, told: &[Value], period_us: f64) -> VecDeque<(f64, Value)> {
        let events: Vec<&Value> = self.wanted.iter().filter_map(|i| told.get(*i)).collect();
        let step = |event: &Value| {
            let tick = event["tick"].as_u64()?;
            self.steps.get(&tick).filter(|(_, _, count)| *count > 0)
        };
        let late_us = |event: &Value| Some(event["late_ns"].as_u64()? as f64 / 1e3);
        // Nanoseconds of the loop's clock at the first edge, from every event that says when: exact from a miss in a step
        // of one tick, else not later than this.
        let (mut exact, mut bound) = (Vec::new(), f64::INFINITY);
        for event in &events {
            if let (Some(clock), Some((first, _, count))) =
                (event["clock_ns"].as_u64(), step(event))
            {
                let clock = clock as f64 / 1e3;
                match late_us(event) {
                    Some(late) if *count == 1 && event["event"] == "miss" => {
                        exact.push(clock - late - period_us - first);
                    }
                    _ => bound = bound.min(clock - first),
                }
            }
        }
        exact.sort_unstable_by(f64::total_cmp);
        let origin = exact.get(exact.len() / 2).copied().unwrap_or(bound);
        let mut placed: Vec<(f64, Value)> = events
            .into_iter()
            .filter_map(|event| {
                let of_step = step(event).map(|(_, last, _)| *last);
                let of_clock = event["clock_ns"]
                    .as_u64()
                    .map(|ns| ns as f64 / 1e3 - origin);
                let at = of_clock.filter(|at| at.is_finite()).or(of_step)?;
                // Before the first edge there is no time on the grid.
                Some((at.max(0.0), shown(event, at.max(0.0))))
            })
            .collect();
        placed.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        placed.into()
    }
}

fn shown(event: &Value, at: f64) -> Value {
    let name = event["event"].as_str().unwrap_or("event");
    let name = if name == "miss" {
        "deadline missed"
    } else {
        name
    };
    json!({
        "name": name, "cat": "event", "ph": "i", "s": "t", "pid": 1, "tid": EVENTS, "ts": rounded(at), "args": event,
    })
}
