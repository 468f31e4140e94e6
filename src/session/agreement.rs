//! Compares `summary.json` with the record: status, cause, steps and peaks.
//!
//! A replay compares it with the loop that was rebuilt ([`with_loop`]), a report with the rows and events ([`with_record`]): a
//! report builds no test, and checks only the recorded DOFs. A summary that was edited, or that belongs to another test, shows
//! here. Folders of earlier versions may differ for other reasons: their differences are warnings.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Formatter};

use serde::Serialize;

use super::origin::Origin;
use super::row_peaks::{RowPeaks, raise_all};
use gusset_config::{Time, TimeTable};
use gusset_control::engine::{Ending, Outcome, Phase, Stop};
use gusset_link::served::ServedSpecimen;
use gusset_quantity::catalog::ending::{Cause, Kind};
use gusset_quantity::catalog::phase::{GIVEN_UP, Part};
use gusset_quantity::substructure::LinkFault;
use gusset_record::summary::{Peak, Status};
use gusset_record::{End, Event, EventLine, FolderError, Run, Summary};

/// A key of `summary.json` that differs from the record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SummaryDifference {
    /// The key.
    pub key: String,
    /// Its value in `summary.json`.
    pub summary: String,
    /// The value that the record shows.
    pub found: String,
}

impl SummaryDifference {
    /// Both as JSON spells them.
    fn new(key: impl Into<String>, summary: impl Serialize, found: impl Serialize) -> Self {
        Self {
            key: key.into(),
            summary: json(summary),
            found: json(found),
        }
    }
}

impl Display for SummaryDifference {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self {
            key,
            summary,
            found,
        } = self;
        write!(
            f,
            "summary.json has `{key}` = {summary}, but the record shows {found}"
        )
    }
}

fn json(value: impl Serialize) -> String {
    serde_json::to_string(&value).unwrap_or_default()
}

/// True if an earlier version wrote the run of these events: its summary may differ for other reasons than that it was edited.
pub(super) fn is_of_an_earlier_version<'a>(
    mut events: impl Iterator<Item = &'a EventLine>,
) -> bool {
    let written = events.find_map(|line| match &line.event {
        Event::Files { version, .. } => Some(version),
        _ => None,
    });
    written.is_some_and(|version| version != env!("CARGO_PKG_VERSION"))
}

/// Status and cause of an ending; no cause where the record does not show it.
type Found = (Status, Option<String>);

/// Differences from the result of the loop when all recorded rows have passed through it again. Where nothing moved after the rows
/// (`ran_out`), they do not show the end, and the events contain it. `required`: the test file makes a damaged record a stopped test.
///
/// # Errors
/// The events cannot be read.
pub(super) fn with_loop(
    run: &Run,
    summary: &Summary,
    (outcome, found): (&Outcome, &Peak),
    ran_out: bool,
    (required, steps): (bool, u64),
) -> Result<Vec<SummaryDifference>, FolderError> {
    let mut all = Vec::new();
    if ran_out {
        let differs = ending(summary, Events::of(run)?.ending, required);
        all.extend(differs.or_else(|| too_few(summary, steps)));
    } else {
        let ending_of = &outcome.ending;
        // How many deadlines were missed only the clock knows.
        let is_known =
            !ending_of.is_for_being_late() && *ending_of != Ending::Stopped(Stop::Internal);
        let word = is_known.then(|| ending_of.word().to_owned());
        all.extend(ending(
            summary,
            Some((ending_of.cause().status(), word)),
            required,
        ));
    }
    let is_whole = !ran_out || outcome.ending == Ending::Stopped(Stop::Operator);
    if is_whole && !has_no_outcome(summary) {
        if summary.steps != outcome.steps {
            all.push(SummaryDifference::new(
                "steps",
                summary.steps,
                outcome.steps,
            ));
        }
        all.extend(peaks(&summary.peak, found, found));
    }
    Ok(all)
}

/// Differences from a served specimen at the end of its replay.
pub(super) fn with_served(summary: &Summary, served: &ServedSpecimen) -> Vec<SummaryDifference> {
    let (name, counts, peak) = (served.name(), served.counts(), served.peak());
    let mut all = peaks(&summary.peak, &peak, &peak);
    let link = summary.link.get(name).cloned().unwrap_or_default();
    // The last command may be accepted after its row.
    let (commits, steps) = (served.commits(), summary.steps);
    let steps_found = if steps == commits + 1 { steps } else { commits };
    let counted = [
        ("steps".to_owned(), steps, steps_found),
        (format!("link.{name}.sent"), link.sent, counts.passed_on),
        (
            format!("link.{name}.received"),
            link.received,
            counts.answered,
        ),
    ];
    let differs = counted.into_iter().filter(|(_, told, found)| told != found);
    all.extend(differs.map(|(key, told, found)| SummaryDifference::new(key, told, found)));
    if let Some(trip) = served.tripped() {
        let word = trip.cause().word();
        if summary.cause.as_deref() != Some(word) {
            all.push(SummaryDifference::new("cause", &summary.cause, word));
        }
    }
    all
}

/// True if the rows end in the running test, so that a limit may have tripped after them. No limit tripped if the operator or a
/// panic ended the test there, by its events.
///
/// # Errors
/// The events or rows cannot be read.
pub(super) fn may_trip_after_its_rows(run: &Run) -> Result<bool, FolderError> {
    let ended = Events::of(run)?.ending;
    let ended_before = matches!(ended, Some((Status::Interrupted | Status::Failed, _)));
    let state = run.layout().index_of("state");
    let last = run.last_row()?;
    let last = last.and_then(|(_, row)| row.get(state?).copied());
    Ok(!ended_before && last.is_some_and(|state| Part::Test.has(state)))
}

/// Differences from the rows and events of a run. Empty without a summary, and for a server's record, whose controller knows the
/// test. The rows are read once.
///
/// # Errors
/// The rows or events cannot be read.
pub(super) fn with_record(
    run: &Run,
    resolved: &str,
) -> Result<Vec<SummaryDifference>, FolderError> {
    let Some(summary) = run.summary().filter(|_| !run.layout().is_served()) else {
        return Ok(Vec::new());
    };
    let table: toml::Table = resolved.parse().unwrap_or_default();
    let required = (table.get("record")).and_then(|record| record.get("required")?.as_bool());
    let (events, rows) = (Events::of(run)?, Rows::of(run, &table)?);
    // A row does not show whether a limit or a link tripped the test there.
    let is_shown = rows.tripped && summary.status != Status::Failed;
    let found = events
        .ending
        .or(is_shown.then_some((Status::Stopped, None)));
    let differs = ending(summary, found, required == Some(true));
    let mut all = Vec::from_iter(differs.or_else(|| too_few(summary, steps_of(&table)?)));
    if !rows.are_whole || summary.rows_lost > 0 || has_no_outcome(summary) {
        // Missing rows are reported elsewhere.
        return Ok(all);
    }
    let origin = Origin::of(run.path()).ok().flatten();
    let steps = rows.steps.or(origin.as_ref().map(|origin| origin.step));
    let steps = steps.unwrap_or(0);
    // Rows that are missing at the end are reported elsewhere, if the events go as far as the summary.
    let is_cut_off =
        steps < summary.steps && events.last_step.is_none_or(|last| last >= summary.steps);
    // The summary of a test that was refused before its loop began has no step.
    let is_refused = rows.steps.is_none() && summary.steps == 0;
    if steps != summary.steps && !is_cut_off && !is_refused {
        all.push(SummaryDifference::new("steps", summary.steps, steps));
    }
    let (mut least, mut most) = (rows.least, rows.most);
    if let Some(origin) = &origin {
        raise_all(&mut least, &origin.peak);
    }
    // A test without a step has the force before it, and a resumed one the peaks of the steps before.
    if origin.is_some() || rows.steps.is_none() || is_cut_off {
        most = Peak::default();
    }
    all.extend(peaks(&summary.peak, &least, &most));
    Ok(all)
}

/// The status `completed` of a test that made fewer steps than it has.
fn too_few(summary: &Summary, steps: u64) -> Option<SummaryDifference> {
    let made = summary.steps;
    let is_too_few = summary.status == Status::Completed && made < steps;
    is_too_few.then(|| {
        let found = format!("{made} of {steps} steps");
        SummaryDifference::new("status", summary.status.word(), found)
    })
}

/// Number of steps of the test; none if this version does not understand its `[time]`.
fn steps_of(table: &toml::Table) -> Option<u64> {
    let time: TimeTable = table.get("time")?.clone().try_into().ok()?;
    Time::of(&time).ok().map(|time| time.steps)
}

/// A status or cause that differs; none where it is not known.
fn ending(summary: &Summary, found: Option<Found>, required: bool) -> Option<SummaryDifference> {
    let (status, cause) = found?;
    let told = summary.cause.as_deref();
    // Only the writer knows that a record is damaged which the test file requires.
    if required && told == Some(Cause::RecordDamaged.word()) && summary.status == Status::Stopped {
        return None;
    }
    if status != summary.status {
        let (told, found) = (summary.status.word(), status.word());
        return Some(SummaryDifference::new("status", told, found));
    }
    let (told, found) = (told.unwrap_or("none"), cause?);
    (*told != *found).then(|| SummaryDifference::new("cause", told, found))
}

/// True for a test whose loop broke down: its summary has no steps and no peaks.
fn has_no_outcome(summary: &Summary) -> bool {
    summary.status == Status::Failed && summary.steps == 0 && summary.peak == Peak::default()
}

/// Peaks below the `least` or above the `most` of the record, the first of each key. What the record does not have is not checked.
fn peaks(told: &Peak, least: &Peak, most: &Peak) -> Vec<SummaryDifference> {
    let [told, least, most] = [told, least, most].map(series);
    let keys: BTreeSet<&String> = least.keys().chain(most.keys()).collect();
    let first = |key: &String| {
        let of = |series: &BTreeMap<String, &[Option<f64>]>, index: usize| {
            series.get(key)?.get(index).copied().flatten()
        };
        let sizes = [&least, &most].map(|one| one.get(key).map_or(0, |values| values.len()));
        (0..sizes[0].max(sizes[1])).find_map(|index| {
            let own = of(&told, index);
            let below = of(&least, index).filter(|least| own.is_none_or(|own| own < *least));
            let above = of(&most, index).filter(|most| own.is_some_and(|own| own > *most));
            let found = below.or(above)?;
            Some(SummaryDifference::new(
                format!("peak.{key}[{index}]"),
                own,
                found,
            ))
        })
    };
    keys.into_iter().filter_map(first).collect()
}

/// The lists of numbers of a peak, by their keys.
fn series(peak: &Peak) -> BTreeMap<String, &[Option<f64>]> {
    let of_structure = [
        ("displacement", &peak.displacement),
        ("velocity", &peak.velocity),
        ("acceleration", &peak.acceleration),
    ];
    let of_structure = of_structure.map(|(name, values)| (name.to_owned(), &**values));
    let forces = peak.force.iter();
    let forces = forces.map(|(name, values)| (format!("force.{name}"), &**values));
    of_structure.into_iter().chain(forces).collect()
}

/// How the test ended according to its events.
#[derive(Debug, Default)]
struct Events {
    /// `None` if it is not known: some events cannot be read, or the loop did not report its end.
    ending: Option<Found>,
    /// The step in which the loop reported its end.
    last_step: Option<u64>,
}

impl Events {
    fn of(run: &Run) -> Result<Self, FolderError> {
        let mut lines = run.event_lines()?;
        let (mut ending, mut last_step, mut of_link) = (None, None, Cause::Link);
        for event in &mut lines {
            let Some(event) = event? else {
                continue;
            };
            match &event.event {
                Event::Ended => last_step = event.tick,
                Event::Link { fault, .. } => of_link = fault.map_or(Cause::Link, LinkFault::cause),
                Event::Phase {
                    from, to, cause, ..
                } => {
                    let of_word = match Cause::of_word(cause) {
                        Some(Cause::Link) => Some(of_link),
                        cause => cause,
                    };
                    if let Some(of_word) = of_word
                        && Self::ends(ending.as_ref(), [*from, *to], of_word)
                    {
                        ending = Some((of_word.status(), Some(cause.to_string())));
                    }
                }
                _ => {}
            }
        }
        let is_known = last_step.is_some() && lines.unreadable == 0;
        Ok(Self {
            ending: ending.filter(|_| is_known),
            last_step: last_step.filter(|_| is_known),
        })
    }

    /// True for a change of phase that is the end: a trip after a clean end counts, an event after a trip does not.
    fn ends(before: Option<&Found>, [from, to]: [Phase; 2], cause: Cause) -> bool {
        let is_orderly = matches!(
            before,
            None | Some((Status::Completed | Status::Interrupted, _))
        );
        let runs = [Phase::Running, Phase::Holding].contains(&from);
        let ends = [Phase::Leaving, Phase::Safe].contains(&to);
        let is_end = match cause.kind() {
            Kind::Internal => true,
            _ if to == Phase::Tripped => true,
            Kind::Completion => runs && ends,
            Kind::Operator => ends,
            _ => false,
        };
        is_orderly && is_end
    }
}

/// Findings in the rows of a run.
#[derive(Debug, Default)]
struct Rows {
    /// A limit, a fault or the clock ended the test in one of them.
    tripped: bool,
    /// The last step that has a row.
    steps: Option<u64>,
    /// Largest magnitudes of the DOFs and specimens that were recorded.
    least: Peak,
    /// Largest magnitudes in all rows, with those of stale measurements.
    most: Peak,
    /// None of them is missing or damaged.
    are_whole: bool,
}

impl Rows {
    fn of(run: &Run, table: &toml::Table) -> Result<Self, FolderError> {
        let at = |name: &str| run.layout().index_of(name).unwrap_or(usize::MAX);
        let (state, step) = (at("state"), at("step"));
        let specimens = table.get("specimen").and_then(toml::Value::as_array);
        let name = |specimen: &toml::Value| Some(specimen.get("name")?.as_str()?.to_owned());
        let names: Vec<String> = (specimens.into_iter().flatten()).filter_map(name).collect();
        let mut least = RowPeaks::of_test(run, names.len());
        let mut most = RowPeaks::of_every_row(run, names.len());
        let mut found = Self::default();
        let mut journal = run.journal()?;
        let path = run.path().join("samples.bin");
        let io = |source| FolderError::Io {
            path: path.clone(),
            source,
        };
        while let Some(row) = journal.next_row().map_err(io)? {
            let value = |place: usize| row.values.get(place).copied().unwrap_or(f64::NAN);
            let state = value(state);
            found.tripped |= state == Phase::Tripped.code() || state == GIVEN_UP;
            if state == Phase::Running.code() {
                found.steps = Some(value(step) as u64);
            }
            least.take(row.values, true);
            most.take(row.values, true);
        }
        found.are_whole = journal.end() == Some(End::Clean) && journal.lost() == 0;
        found.least = least.finish(names.iter().cloned());
        found.most = most.finish(names.into_iter());
        Ok(found)
    }
}
