//! The deadline misses among the events, to be found by the deadline that was missed.

use serde_json::{Value, json};

use crate::{Event, EventLine};

/// A miss by its event; µs from zero.
#[derive(Debug, Clone)]
pub(super) struct Missed {
    pub deadline: f64,
    pub pushed: f64,
    pub told: EventLine,
}

/// Deadlines of rows and events are the same to this, µs: a nanosecond of the grid's fractions, and rounding.
const SAME: f64 = 0.5;

/// The misses of a run, in order.
pub(super) struct Misses(Vec<Missed>);

impl Misses {
    pub(crate) fn of(told: &[EventLine], origin_us: Option<f64>) -> Self {
        let missed = told.iter().filter_map(|event| {
            let Event::Miss { late_ns, .. } = event.event else {
                return None;
            };
            let pushed = event.clock_ns? as f64 / 1e3 - origin_us?;
            Some(Missed {
                deadline: pushed - late_ns as f64 / 1e3,
                pushed,
                told: event.clone(),
            })
        });
        let mut missed: Vec<Missed> = missed.collect();
        missed.sort_by(|a, b| a.deadline.total_cmp(&b.deadline));
        Self(missed)
    }

    /// The miss of this deadline.
    pub(crate) fn at(&self, deadline: f64) -> Option<&Missed> {
        let next = self
            .0
            .partition_point(|missed| missed.deadline < deadline - SAME);
        let missed = self.0.get(next)?;
        (missed.deadline <= deadline + SAME).then_some(missed)
    }
}

/// Name and text of the slice of a miss.
pub(super) fn words(missed: Option<&Missed>, late_us: f64) -> (String, Value) {
    let class = missed.and_then(|missed| missed.told.fields().get("class")?.as_str());
    let name = class.map_or_else(
        || "miss: cause not recorded".to_owned(),
        |class| format!("miss: {}", class.replace('_', " ")),
    );
    let mut args = json!({ "late_us": super::rounded(late_us) });
    if let (Some(args), Some(told)) = (
        args.as_object_mut(),
        missed.map(|missed| missed.told.fields()),
    ) {
        let evidence = [
            "class",
            "stretched",
            "involuntary_switches",
            "minor_faults",
            "steal_ms",
            "waited_us",
        ];
        for key in evidence {
            if let Some(value) = told.get(key) {
                args.insert(key.to_owned(), value.clone());
            }
        }
    }
    (name, args)
}
