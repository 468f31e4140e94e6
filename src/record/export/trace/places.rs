//! Places of the lines of `events.jsonl` on the grid of a trace.
//!
//! An event knows its step and the loop's clock; the `grid` events give the time of zero on that clock. In folders of
//! earlier versions a miss ties the two to the nanosecond, since it gives the time after its edge at which it was found.
//! Without a miss, events may be up to a tick early there.

use std::collections::BTreeMap;

use serde_json::Value;

use super::{EVENTS, Stamped, instant};
use crate::export::plan::Choice;
use crate::run::Run;
use crate::{Event, EventLine};

/// Places of the events' steps on the grid.
pub(super) struct Places {
    wanted: Vec<usize>,
    /// Step → first and last edge of it, and how many ticks it had.
    steps: BTreeMap<u64, (f64, f64, u64)>,
    /// The edge before, and the shortest way between two.
    edge: f64,
    shortest: f64,
}

impl Places {
    pub(crate) fn wanted(told: &[EventLine], choice: &Choice) -> Self {
        let inside = |event: &EventLine| match event.time {
            Some(time) => choice.holds(time),
            None => !choice.is_part(),
        };
        let wanted = told.iter().enumerate();
        let wanted: Vec<usize> = wanted
            .filter(|(_, event)| inside(event))
            .map(|(index, _)| index)
            .collect();
        let step = |index: &usize| told.get(*index)?.tick;
        let steps = wanted.iter().filter_map(step);
        Self {
            steps: steps.map(|step| (step, (f64::NAN, f64::NAN, 0))).collect(),
            wanted,
            edge: f64::NAN,
            shortest: f64::INFINITY,
        }
    }

    pub(crate) fn note(&mut self, tick: &Stamped) {
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

    /// Period by the summary; for an unfinished run the shortest time between two edges.
    pub(crate) fn period_us(&self, run: &Run) -> f64 {
        let rate = run.summary().map(|summary| summary.rate_hz);
        rate.filter(|rate| *rate > 0.0 && rate.is_finite())
            .map_or(self.shortest, |rate| 1e6 / rate)
    }

    fn step(&self, event: &EventLine) -> Option<&(f64, f64, u64)> {
        let tick = event.tick?;
        self.steps.get(&tick).filter(|(_, _, count)| *count > 0)
    }

    fn events<'a>(&self, told: &'a [EventLine]) -> impl Iterator<Item = &'a EventLine> {
        self.wanted.iter().filter_map(|i| told.get(*i))
    }

    /// When zero was on the loop's clock, µs, as far as events and rows show it: exact from a miss in a step of one tick,
    /// else not later than this.
    pub(crate) fn origin_us(&self, told: &[EventLine], period_us: f64) -> Option<f64> {
        let (mut exact, mut bound) = (Vec::new(), f64::INFINITY);
        for event in self.events(told) {
            if let (Some(clock), Some((first, _, count))) = (event.clock_ns, self.step(event)) {
                let clock = clock as f64 / 1e3;
                match event.event {
                    Event::Miss { late_ns, .. } if *count == 1 => {
                        exact.push(clock - late_ns as f64 / 1e3 - period_us - first);
                    }
                    _ => bound = bound.min(clock - first),
                }
            }
        }
        exact.sort_unstable_by(f64::total_cmp);
        let origin = exact.get(exact.len() / 2).copied().unwrap_or(bound);
        origin.is_finite().then_some(origin)
    }

    /// The events of the window in order, each at its place on the grid.
    pub(crate) fn placed(&self, told: &[EventLine], origin_us: Option<f64>) -> Vec<(f64, Value)> {
        let placed = self.events(told).filter_map(|event| {
            let of_step = self.step(event).map(|(_, last, _)| *last);
            let of_clock = event.clock_ns;
            let of_clock = of_clock
                .zip(origin_us)
                .map(|(ns, origin)| ns as f64 / 1e3 - origin);
            // Before the first edge there is no time on the grid.
            let at = of_clock.or(of_step)?.max(0.0);
            Some((at, shown(event, at)))
        });
        placed.collect()
    }
}

fn shown(event: &EventLine, at: f64) -> Value {
    let name = match event.event {
        Event::Miss { .. } => "deadline missed",
        _ => event.name(),
    };
    instant(EVENTS, "event", name, at, &Value::Object(event.to_map()))
}
