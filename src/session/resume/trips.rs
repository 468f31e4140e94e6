//! What tripped an interrupted test: by its events, and where those were lost by its rows.

use serde_json::Value;

use super::ResumeError;
use crate::control::OnStale;
use crate::engine::{Experiment, Phase};
use crate::record::summary::Status as Ended;
use crate::record::{Events, Run};
use crate::session::recorded::Replaced;
use crate::session::retrace::prepared;
use crate::substructure::Status;

/// What tripped a test, by its events: keys of limits, and the names of other alarms. A link that was lost is none; a number
/// that is none has come over it, or out of a law.
pub(super) fn of_events(events: &[Value]) -> Vec<String> {
    let mut trips = Vec::new();
    for event in events {
        let word = |key: &str| event.get(key).and_then(Value::as_str);
        let trip = match word("event") {
            Some("limit_trip") => word("limit"),
            Some(
                alarm @ ("interlock" | "saturated" | "specimen_holds_on" | "geometry" | "diverged"),
            ) => Some(alarm),
            Some("link") => {
                word("fault").filter(|fault| ["not_finite", "diverged"].contains(fault))
            }
            _ => None,
        };
        let trip = trip.map(str::to_owned);
        trips.extend(trip.filter(|trip| !trips.contains(trip)));
    }
    trips
}

/// Whether the event of a trip may be one of those that cannot be read: a test that `ended` so and not by itself, nor by its
/// operator; none if it was killed, which leaves half a line at the end.
pub(super) fn may_hide(ended: Option<Ended>, told: &Events) -> bool {
    match ended {
        Some(Ended::Completed | Ended::Interrupted) => false,
        Some(Ended::Stopped) if !told.have_end() => true,
        Some(_) => told.unreadable > 0,
        None => told.unreadable > usize::from(told.is_torn),
    }
}

/// A row says that the test tripped there, and not only for a link. Rows are written before events: whatever ended the
/// process in between left no more than this.
pub(super) fn has_a_row_of_one(run: &Run) -> Result<bool, ResumeError> {
    let columns = run.layout().columns().iter();
    let statuses = columns.filter(|column| column.name.starts_with("status_"));
    let names: Vec<&str> = ["state"]
        .into_iter()
        .chain(statuses.map(|column| column.name.as_str()))
        .collect();
    let columns = run.columns(&names)?;
    let Some((states, statuses)) = columns.split_first() else {
        return Ok(false);
    };
    if !states.contains(&Phase::Tripped.code()) {
        return Ok(false);
    }
    let bounds = stale_bounds(&prepared(run, Replaced::Remote, false)?.experiment);
    Ok(has_one(states, statuses, &bounds))
}

/// How many stale measurements in a row each specimen is allowed; none where rows cannot count them.
fn stale_bounds(experiment: &Experiment) -> Vec<Option<u64>> {
    let ports = experiment.ports.iter();
    let bound = |port: &crate::control::Port| match port.wait {
        // Its status stays as it is in the rows between two answers.
        _ if port.is_per_step() => None,
        Some(own) if own.on_stale == OnStale::Stop => Some(0),
        Some(own) => Some(own.stale_in_a_row),
        None => Some(experiment.limits.stale_in_a_row),
    };
    ports.map(bound).collect()
}

/// Whether any row of a trip is believed to be one: that of a link is the row in which a specimen was lost, or in which its
/// measurement was stale more often than allowed. That it is stale there for once says nothing of another specimen.
fn has_one(states: &[f64], statuses: &[Vec<f64>], bounds: &[Option<u64>]) -> bool {
    let has = |column: &[f64], row: usize, mark: Status| {
        let status = column.get(row).map(|status| Status(*status as u32));
        status.is_some_and(|status| status.has(mark))
    };
    let is_lost_here = |column: &Vec<f64>, row: usize| {
        let before = row.checked_sub(1);
        has(column, row, Status::LOST) && !before.is_some_and(|at| has(column, at, Status::LOST))
    };
    let is_too_old = |(column, bound): (&Vec<f64>, &Option<u64>), row: usize| {
        let back = (0..=row).rev();
        let stale = back
            .take_while(|at| has(column, *at, Status::STALE))
            .count();
        bound.is_some_and(|bound| stale as u64 > bound)
    };
    let of_a_link = |row: usize| {
        let mut specimens = statuses.iter().zip(bounds);
        statuses.iter().any(|column| is_lost_here(column, row))
            || specimens.any(|one| is_too_old(one, row))
    };
    let mut rows = states.iter().enumerate();
    rows.any(|(row, state)| *state == Phase::Tripped.code() && !of_a_link(row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const RUNNING: f64 = Phase::Running.code();
    const TRIPPED: f64 = Phase::Tripped.code();
    const LOST: f64 = Status::LOST.0 as f64;
    const STALE: f64 = Status::STALE.0 as f64;

    #[test]
    fn a_force_that_is_no_number_is_a_trip_and_a_link_that_is_lost_is_none() {
        let link = |fault: &str| json!({"event": "link", "specimen": 1, "fault": fault});
        let all = ["closed", "timeout", "not_finite", "malformed", "diverged"].map(link);
        assert_eq!(of_events(&all), ["not_finite", "diverged"]);
    }

    #[test]
    fn a_row_of_a_trip_is_one_unless_a_link_alone_can_have_ended_the_test_there() {
        let runs = [RUNNING, RUNNING, RUNNING, TRIPPED];
        let bounds = [Some(2), Some(2)];
        let fine = vec![0.0; 4];
        let says = |second: [f64; 4], bounds: &[Option<u64>]| {
            has_one(&runs, &[fine.clone(), second.to_vec()], bounds)
        };
        assert!(says([0.0; 4], &bounds));
        assert!(!has_one(
            &[RUNNING; 4],
            std::slice::from_ref(&fine),
            &bounds
        ));
        // Somebody else's measurement is stale for once, or as often as allowed.
        assert!(says([0.0, 0.0, 0.0, STALE], &bounds));
        assert!(says([STALE, 0.0, STALE, STALE], &bounds));
        assert!(!says([0.0, STALE, STALE, STALE], &bounds));
        assert!(!says([0.0, 0.0, 0.0, STALE], &[Some(2), Some(0)]));
        assert!(says([STALE; 4], &[Some(2), None]));
        assert!(!says([0.0, 0.0, 0.0, LOST], &bounds));
        // One that was lost before does not trip again: it was another.
        let leaves = [RUNNING, TRIPPED, Phase::Leaving.code(), TRIPPED];
        assert!(has_one(&leaves, &[vec![0.0, LOST, LOST, LOST]], &bounds));
        assert!(!has_one(&leaves[..3], &[vec![0.0, LOST, LOST]], &bounds));
    }
}
