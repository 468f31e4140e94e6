//! Limits with warnings while a test ran: how often, and the value when each was first passed. Axes with a force before the
//! test moved them. Axes of a resumed test whose position or force differs from the record.

use super::events::{Event, EventLine, LimitReached, Standing, Word};
use gusset_quantity::units::{compared, unit_of_key};

/// All of them, in the order in which they were first met.
#[derive(Debug, Default)]
pub(super) struct Warned {
    passed: Vec<Passed>,
    initial: Vec<String>,
}

/// One limit that was passed.
#[derive(Debug)]
struct Passed {
    /// Specimen and axis from 0; none for a limit of the whole test.
    of: Option<(u32, u32)>,
    limit: Word,
    times: u64,
    /// The value in the tick in which the limit was first passed, and the bound.
    value: f64,
    bound: f64,
}

impl Warned {
    /// Counts a warning; ignores all other events.
    pub(crate) fn count(&mut self, line: &EventLine) {
        let reached = match &line.event {
            Event::LimitWarning(reached) => reached,
            Event::InitialForce { .. } => {
                let sentence = line.sentence();
                self.initial.push(format!(
                    "{sentence}; it may have yielded in an earlier test"
                ));
                return;
            }
            Event::Stands(Standing {
                found,
                left,
                within,
                differs: true,
                ..
            })
            | Event::ForceChanged {
                found,
                left,
                within,
                ..
            } => {
                let is_allowed = (found - left).abs() <= *within;
                let allowed = if is_allowed { "within" } else { "BEYOND" };
                let sentence = line.sentence();
                self.initial
                    .push(format!("{sentence}; {allowed} its tolerance"));
                return;
            }
            _ => return,
        };
        let LimitReached {
            limit,
            value,
            bound,
            ..
        } = reached.clone();
        let of = reached.port.zip(reached.axis);
        let of = of.filter(|_| !reached.is_of_test());
        let known = self
            .passed
            .iter_mut()
            .find(|p| p.of == of && p.limit == limit);
        if let Some(passed) = known {
            passed.times += 1;
        } else {
            self.passed.push(Passed {
                of,
                limit,
                times: 1,
                value,
                bound,
            });
        }
    }

    /// In sentences; `specimens` are their names.
    pub(crate) fn sentences(&self, specimens: &[String]) -> Vec<String> {
        let sentence = |passed: &Passed| {
            let Passed {
                of,
                limit,
                times,
                value,
                bound,
            } = passed;
            let whose = of.map_or_else(
                || "the test".to_owned(),
                |(port, axis)| {
                    let name = specimens.get(port as usize);
                    let name = name.map_or("", String::as_str);
                    format!("specimen \"{name}\" axis {}", axis + 1)
                },
            );
            let times = self::times(*times);
            let [value, bound] = compared(*value, *bound, unit_of_key(limit));
            format!(
                "{whose} passed the warning level of {limit} {times}, first with {value}, allowed {bound}"
            )
        };
        let initial = self.initial.iter().cloned();
        initial.chain(self.passed.iter().map(sentence)).collect()
    }
}

/// "once", "2 times".
pub fn times(count: u64) -> String {
    match count {
        1 => "once".to_owned(),
        count => format!("{count} times"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimedEvent;

    #[test]
    fn each_limit_is_reported_once_with_counts() {
        let mut warned = Warned::default();
        let reached = |axis, value, bound| LimitReached {
            port: Some(0),
            axis: Some(axis),
            limit: "measured_force_n".into(),
            value,
            bound,
        };
        let specimens = ["brace".to_owned()];
        for kind in [
            Event::LimitWarning(reached(0, 51.0, 50.0)),
            Event::LimitWarning(reached(0, -62.0, -50.0)),
            Event::LimitWarning(reached(0, 55.0, 50.0)),
            Event::LimitWarning(reached(1, 1.5, 1.0)),
            Event::LimitTrip(reached(1, 100.0, 10.0)),
            Event::RowLost,
        ] {
            let event = TimedEvent {
                tick: 0,
                time: 0.0,
                clock_ns: 0,
                kind,
            };
            warned.count(&EventLine::of_loop(&event, &specimens));
        }
        assert_eq!(
            warned.sentences(&specimens),
            [
                "specimen \"brace\" axis 1 passed the warning level of measured_force_n 3 times, first with 51 N, allowed 50 N",
                "specimen \"brace\" axis 2 passed the warning level of measured_force_n once, first with 1.5 N, allowed 1 N",
            ]
        );
    }
}
