//! Causes of the trip of an interrupted test, from its events and from the causes in its rows.
//!
//! Rows are written before events. If the process ends in between, only the rows show that the test tripped. Recordings of
//! versions up to 0.2.0 have no column `cause`. There, a row with the state *tripped* needs an event that explains it.

use super::ResumeError;
use crate::checksum::unreadable;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::phase::Phase;
use gusset_record::summary::Status;
use gusset_record::{Event, EventLine, FolderError, Run};

/// Name of a trip that neither events nor rows name.
const UNKNOWN: &str = "unknown";

/// Everything that tripped a test, or may have.
#[derive(Debug)]
pub(super) struct Trips {
    /// Keys of limits, and words of other causes. A lost link is no trip, but a force that is not finite is a trip.
    pub names: Vec<String>,
    /// False where unreadable events might report a trip.
    pub certain: bool,
    /// Lines of the events that cannot be read.
    pub unreadable: usize,
}

impl Trips {
    /// Reads the trips of a run.
    pub(crate) fn of(run: &Run) -> Result<Self, ResumeError> {
        let told = Told::of(run)?;
        let in_rows = trips_in_rows(run, told.explained)?;
        let may_hide = told.may_hide(run.summary().map(|summary| summary.status));
        let mut names = told.trips;
        let certain = !names.is_empty() || !in_rows.is_empty();
        if names.is_empty() {
            names = in_rows;
        }
        if names.is_empty() && may_hide {
            names.push(UNKNOWN.to_owned());
        }
        Ok(Self {
            names,
            certain,
            unreadable: told.unreadable,
        })
    }
}

/// Findings in the events of a test.
#[derive(Debug, Default)]
struct Told {
    trips: Vec<String>,
    /// An event contains the cause of the end, whether it is a trip or not.
    explained: bool,
    unreadable: usize,
    /// The last line is one of those, and was never finished.
    is_torn: bool,
    /// The loop reported its end.
    have_end: bool,
}

impl Told {
    fn of(run: &Run) -> Result<Self, FolderError> {
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
        let mut trip = line.event.latched().map(|trip| trip.into_owned());
        match &line.event {
            Event::Ended => self.have_end = true,
            Event::Phase {
                to: Phase::Tripped,
                cause,
                ..
            } => match Cause::of_word(cause) {
                // The event of the trip itself may be lost.
                Some(known) if known.is_trip() => trip = Some(cause.to_string()),
                Some(_) => self.explained = true,
                None => {}
            },
            _ => {}
        }
        self.trips
            .extend(trip.filter(|trip| !self.trips.contains(trip)));
    }

    /// Whether the event of a trip may be one of the lines that cannot be read. A test that completed or that the operator stopped
    /// did not trip. A kill leaves half a line at the end.
    fn may_hide(&self, ended: Option<Status>) -> bool {
        match ended {
            Some(Status::Completed | Status::Interrupted) => false,
            Some(Status::Stopped) if !self.have_end => true,
            Some(_) => self.unreadable > 0,
            None => self.unreadable > usize::from(self.is_torn),
        }
    }
}

/// Words of the trips in the rows. Without the column `cause`, a row with the state *tripped* is one unless an event explains it.
/// The rows are read one after the other.
fn trips_in_rows(run: &Run, explained: bool) -> Result<Vec<String>, ResumeError> {
    let place = |name: &str| run.layout().index_of(name);
    let state = place("state").ok_or_else(|| FolderError::NoColumn("state".to_owned()))?;
    let cause = place("cause");
    let mut words: Vec<String> = Vec::new();
    let mut journal = run.journal()?;
    let failed = |source| unreadable(&run.path().join("samples.bin"), source);
    while let Some(row) = journal.next_row().map_err(failed)? {
        let at = |place: usize| row.values.get(place).copied().unwrap_or(f64::NAN);
        let word = match cause {
            Some(place) => trip_of(at(place)),
            None if at(state) == Phase::Tripped.code() && !explained => Some(UNKNOWN),
            None => None,
        };
        if let Some(word) = word
            && words.iter().all(|known| known != word)
        {
            words.push(word.to_owned());
        }
    }
    Ok(words)
}

/// The word of a cause in the column `cause`, if it is a trip.
fn trip_of(code: f64) -> Option<&'static str> {
    let cause = Cause::of_column(code).filter(|cause| cause.is_trip());
    cause.map(Cause::word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn force_that_is_not_finite_is_a_trip() {
        let link =
            |fault: &str| EventLine::from(json!({"event": "link", "specimen": 1, "fault": fault}));
        let all = ["closed", "timeout", "not_finite", "malformed", "diverged"].map(link);
        let mut told = Told::default();
        all.iter().for_each(|event| told.take(event));
        assert_eq!(told.trips, ["not_finite", "diverged"]);
        assert!(!told.explained);
        let causes = [
            Cause::Link,
            Cause::Stale,
            Cause::Operator,
            Cause::LinkNotFinite,
            Cause::Late,
        ];
        let trips = causes.map(|cause| trip_of(f64::from(cause.code())));
        assert_eq!(trips, [None, None, None, Some("link"), Some("late")]);
        assert_eq!([trip_of(0.0), trip_of(f64::NAN)], [None; 2]);
    }

    #[test]
    fn phase_reports_a_trip_without_an_event() {
        let told = |cause: &str| {
            let line =
                json!({"event": "phase", "from": "running", "to": "tripped", "cause": cause});
            let mut told = Told::default();
            told.take(&EventLine::from(line));
            (told.trips, told.explained)
        };
        let trip = |name: &str| (vec![name.to_owned()], false);
        assert_eq!(told("measured_force_n"), trip("measured_force_n"));
        assert_eq!(told("interlock"), trip("interlock"));
        assert_eq!(told("stale"), (Vec::new(), true));
        assert_eq!(told("link"), (Vec::new(), true));
        assert_eq!(told(""), (Vec::new(), false));
    }
}
