//! What tripped an interrupted test: by its events, and where those were lost by its rows.

use super::ResumeError;
use crate::control::OnStale;
use crate::engine::{Experiment, Phase};
use crate::record::summary::Status as Ended;
use crate::record::{Event, EventLine, FolderError, Run};
use crate::session::recorded::Replaced;
use crate::session::retrace::{prepared, unreadable};
use crate::substructure::Status;

/// The trips of a test according to its events, which are read one after the other.
#[derive(Debug, Default)]
pub(super) struct Told {
    /// Keys of limits, and the names of other alarms. A lost link is no trip; a NaN or infinity from a link or a law is one.
    pub trips: Vec<String>,
    /// Lines that cannot be read.
    pub unreadable: usize,
    /// The last line is one of those, and was never finished.
    is_torn: bool,
    /// The loop said that it was over.
    have_end: bool,
}

impl Told {
    /// By the events of a run.
    pub fn of(run: &Run) -> Result<Self, FolderError> {
        let mut lines = run.event_lines()?;
        let mut told = Self::default();
        for event in &mut lines {
            if let Some(event) = event? {
                told.take(&event);
            }
        }
        (told.unreadable, told.is_torn) = (lines.unreadable, lines.is_torn);
        Ok(told)
    }

    fn take(&mut self, line: &EventLine) {
        self.have_end |= line.event == Event::Ended;
        let trip = line.event.latched().map(|trip| trip.into_owned());
        self.trips
            .extend(trip.filter(|trip| !self.trips.contains(trip)));
    }

    /// Whether the event of a trip may be one of those that cannot be read: a test that `ended` so and not by itself, nor by its
    /// operator; none if it was killed, which leaves half a line at the end.
    pub fn may_hide(&self, ended: Option<Ended>) -> bool {
        match ended {
            Some(Ended::Completed | Ended::Interrupted) => false,
            Some(Ended::Stopped) if !self.have_end => true,
            Some(_) => self.unreadable > 0,
            None => self.unreadable > usize::from(self.is_torn),
        }
    }
}

/// A row says that the test tripped there, and not only for a link. Rows are written before events: whatever ended the
/// process in between left no more than this. The rows are read one after the other.
pub(super) fn has_a_row_of_one(run: &Run) -> Result<bool, ResumeError> {
    let columns = run.layout().columns().iter().enumerate();
    let statuses = columns.filter(|(_, column)| column.name.starts_with("status_"));
    let statuses: Vec<usize> = statuses.map(|(place, _)| place).collect();
    let state = run
        .layout()
        .index_of("state")
        .ok_or_else(|| FolderError::NoColumn("state".to_owned()))?;
    // Most records have no such row: then the test need not be built.
    let tripped = Phase::Tripped.code();
    if !any_row(run, |row| row.get(state) == Some(&tripped))? {
        return Ok(false);
    }
    let bounds = stale_bounds(&prepared(run, Replaced::Remote, false)?.experiment);
    let mut links = Links::new(&bounds);
    any_row(run, |row| {
        let at = |place: &usize| Status(row.get(*place).map_or(0, |status| *status as u32));
        let of_a_link = links.pass(statuses.iter().map(at));
        row.get(state) == Some(&tripped) && !of_a_link
    })
}

/// Whether any row of a run is one of these; they are read up to the first.
fn any_row(run: &Run, mut is_one: impl FnMut(&[f64]) -> bool) -> Result<bool, ResumeError> {
    let mut journal = run.journal()?;
    let failed = |source| unreadable(&run.path().join("samples.bin"), source);
    while let Some(row) = journal.next_row().map_err(failed)? {
        if is_one(row.values) {
            return Ok(true);
        }
    }
    Ok(false)
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

/// The links in the rows so far: a specimen that was lost, or whose measurement was stale more often than allowed. One stale
/// measurement does not explain a trip.
struct Links<'a> {
    /// Stale measurements in a row that each specimen is allowed.
    bounds: &'a [Option<u64>],
    /// Of each specimen: stale measurements in a row so far, and whether it was lost in the row before.
    each: Vec<(u64, bool)>,
}

impl<'a> Links<'a> {
    fn new(bounds: &'a [Option<u64>]) -> Self {
        Self {
            bounds,
            each: vec![(0, false); bounds.len()],
        }
    }

    /// Takes the statuses of the next row. True if a link alone can have ended the test there.
    fn pass(&mut self, statuses: impl Iterator<Item = Status>) -> bool {
        let mut ended = false;
        let each = self.each.iter_mut().zip(self.bounds);
        for (((stale, lost), bound), status) in each.zip(statuses) {
            *stale = if status.has(Status::STALE) {
                *stale + 1
            } else {
                0
            };
            let was_lost = std::mem::replace(lost, status.has(Status::LOST));
            ended |= *lost && !was_lost;
            ended |= bound.is_some_and(|bound| *stale > bound);
        }
        ended
    }
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
        let link =
            |fault: &str| EventLine::from(json!({"event": "link", "specimen": 1, "fault": fault}));
        let all = ["closed", "timeout", "not_finite", "malformed", "diverged"].map(link);
        let mut told = Told::default();
        all.iter().for_each(|event| told.take(event));
        assert_eq!(told.trips, ["not_finite", "diverged"]);
    }

    /// Whether one of these rows counts as that of a trip.
    fn has_one(states: &[f64], statuses: &[Vec<f64>], bounds: &[Option<u64>]) -> bool {
        let mut links = Links::new(bounds);
        (0..states.len()).any(|row| {
            let at = |column: &Vec<f64>| Status(column[row] as u32);
            let of_a_link = links.pass(statuses.iter().map(at));
            states[row] == TRIPPED && !of_a_link
        })
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
