//! Compares `summary.json` with the record: status, cause, steps and peaks.
//!
//! A replay compares it with the loop that was rebuilt ([`with_loop`]), a report with the rows and events ([`with_record`]): a
//! report builds no test, and checks only the recorded DOFs. A summary that was edited, or that belongs to another test, shows
//! here. Folders of earlier versions may differ for other reasons: their differences are warnings.

mod rows;

use std::fmt::{Display, Formatter};

use serde::Serialize;

use super::origin::Origin;
use super::summary::finite;
use gusset_config::{Time, TimeTable};
use gusset_control::engine::{Ending, Outcome, Phase, Stop};
use gusset_quantity::catalog::ending::{Cause, Kind};
use gusset_quantity::catalog::phase::Part;
use gusset_quantity::substructure::LinkFault;
use gusset_record::summary::{Peak, Status};
use gusset_record::{Event, EventLine, FolderError, Run, Summary};
use rows::Rows;

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

/// Whether this version wrote the run, if the event names one.
fn is_of_this_version(line: &EventLine) -> Option<bool> {
    match &line.event {
        Event::Files { version, .. } => Some(version == env!("CARGO_PKG_VERSION")),
        _ => None,
    }
}

/// True if an earlier version wrote the run of these events: its summary may differ for other reasons than that it was edited.
pub(super) fn is_of_an_earlier_version<'a>(
    mut events: impl Iterator<Item = &'a EventLine>,
) -> bool {
    events.find_map(is_of_this_version) == Some(false)
}

/// True if an earlier version wrote the run; false if its events name none. Its events are read up to the one that names the
/// version.
///
/// # Errors
/// The events cannot be read.
pub(super) fn of_an_earlier_version(run: &Run) -> Result<bool, FolderError> {
    for event in run.event_lines()? {
        if let Some(is_of_this) = event?.as_ref().and_then(is_of_this_version) {
            return Ok(!is_of_this);
        }
    }
    Ok(false)
}

/// Differences from the result of the loop when all recorded rows have passed through it again. `required`: the test file makes a
/// damaged record a stopped test.
pub(super) fn with_loop(
    summary: &Summary,
    outcome: &Outcome,
    required: bool,
) -> Vec<SummaryDifference> {
    let differs = ending(summary, Some(found(outcome)), required).into_iter();
    differs.chain(steps_and_peaks(summary, outcome)).collect()
}

/// How the loop ended, as far as measurements show it.
fn found(outcome: &Outcome) -> Found {
    let ending = &outcome.ending;
    // How many deadlines were missed only the clock knows.
    let is_known = !ending.is_for_being_late() && *ending != Ending::Stopped(Stop::Internal);
    let word = is_known.then(|| ending.word().to_owned());
    (ending.cause().status(), word)
}

/// Differences of a test whose rows do not show its end, since nothing moved after it: the events contain it. In any case, a test
/// of fewer steps than its `duration_s` is not completed.
///
/// # Errors
/// The events cannot be read.
pub(super) fn with_events(
    run: &Run,
    summary: &Summary,
    outcome: &Outcome,
    (required, steps): (bool, u64),
) -> Result<Vec<SummaryDifference>, FolderError> {
    let mut all = Vec::new();
    let differs = ending(summary, Events::of(run)?.ending, required);
    all.extend(differs.or_else(|| too_few(summary, outcome.steps, steps)));
    if outcome.ending == Ending::Stopped(Stop::Operator) {
        all.extend(steps_and_peaks(summary, outcome));
    }
    Ok(all)
}

/// The status `completed` of a test that made fewer steps than it has.
fn too_few(summary: &Summary, made: u64, steps: u64) -> Option<SummaryDifference> {
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

/// Status and cause of an ending; no cause where the record does not show it.
type Found = (Status, Option<String>);

/// A status or cause that differs; none where it is not known.
fn ending(summary: &Summary, found: Option<Found>, required: bool) -> Option<SummaryDifference> {
    let (status, cause) = found?;
    if is_stopped_for_its_record(summary, required) {
        return None;
    }
    if status != summary.status {
        let (told, found) = (summary.status.word(), status.word());
        return Some(SummaryDifference::new("status", told, found));
    }
    let (told, found) = (summary.cause.as_deref().unwrap_or("none"), cause?);
    (*told != *found).then(|| SummaryDifference::new("cause", told, found))
}

/// Only the writer knows that a record is damaged which the test file requires.
fn is_stopped_for_its_record(summary: &Summary, required: bool) -> bool {
    let cause = summary.cause.as_deref();
    required && summary.status == Status::Stopped && cause == Some(Cause::RecordDamaged.word())
}

/// True for a test whose loop broke down: its summary has no steps and no peaks.
fn has_no_outcome(summary: &Summary) -> bool {
    summary.status == Status::Failed && summary.steps == 0 && summary.peak == Peak::default()
}

fn steps_and_peaks(summary: &Summary, outcome: &Outcome) -> Vec<SummaryDifference> {
    let mut all = Vec::new();
    if has_no_outcome(summary) {
        return all;
    }
    if summary.steps != outcome.steps {
        all.push(SummaryDifference::new(
            "steps",
            summary.steps,
            outcome.steps,
        ));
    }
    let forces = outcome.ports.iter();
    let peak = Peak {
        displacement: finite(&outcome.peaks.disp),
        velocity: finite(&outcome.peaks.vel),
        acceleration: finite(&outcome.peaks.accel),
        force: forces
            .map(|(name, force, _)| (name.clone(), finite(force)))
            .collect(),
        ..Peak::default()
    };
    all.extend(peaks(&summary.peak, &peak));
    all
}

/// Peaks that differ, each by its key.
fn peaks(told: &Peak, found: &Peak) -> Vec<SummaryDifference> {
    let mut all = Vec::new();
    let mut compare = |key: String, told: &[Option<f64>], found: &[Option<f64>]| {
        let most = told.len().max(found.len());
        let at = |values: &[Option<f64>], index: usize| values.get(index).copied().flatten();
        let differs = (0..most).find(|index| at(told, *index) != at(found, *index));
        all.extend(differs.map(|index| {
            let key = format!("{key}[{index}]");
            SummaryDifference::new(key, at(told, index), at(found, index))
        }));
    };
    let key = |name: &str| format!("peak.{name}");
    compare(key("displacement"), &told.displacement, &found.displacement);
    compare(key("velocity"), &told.velocity, &found.velocity);
    compare(key("acceleration"), &told.acceleration, &found.acceleration);
    let names = told.force.keys().chain(found.force.keys());
    let names: std::collections::BTreeSet<&String> = names.collect();
    for name in names {
        let of = |peak: &Peak| peak.force.get(name).cloned().unwrap_or_default();
        compare(key(&format!("force.{name}")), &of(told), &of(found));
    }
    all
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
    let origin = Origin::of(run.path()).ok().flatten();
    let mut all = Vec::new();
    let events = Events::of(run)?;
    let rows = Rows::of(run, &table)?;
    // A row does not show whether a limit or a link tripped the test there.
    let is_shown = rows.tripped && summary.status != Status::Failed;
    let found = events
        .ending
        .or(is_shown.then_some((Status::Stopped, None)));
    // The events may show that only the last rows are missing: that is reported elsewhere.
    let are_all = rows.are_whole && events.last_step.is_none_or(|last| last < summary.steps);
    let made = rows.steps.filter(|_| are_all).unwrap_or(summary.steps);
    let made = made.min(summary.steps);
    let differs = ending(summary, found, is_required(&table));
    all.extend(differs.or_else(|| too_few(summary, made, steps_of(&table)?)));
    if !rows.are_whole || summary.rows_lost > 0 || has_no_outcome(summary) {
        // Missing rows are reported elsewhere.
        return Ok(all);
    }
    let before = origin.as_ref().map_or(0, |origin| origin.step);
    let steps = rows.steps.unwrap_or(before);
    // Rows that are missing at the end are reported elsewhere, if the events go as far as the summary.
    let is_cut_off =
        steps < summary.steps && events.last_step.is_none_or(|last| last >= summary.steps);
    // The summary of a test that was refused before its loop began has no step.
    let is_refused = rows.steps.is_none() && summary.steps == 0;
    if steps != summary.steps && !is_cut_off && !is_refused {
        all.push(SummaryDifference::new("steps", summary.steps, steps));
    }
    let mut peak = rows.peak;
    if let Some(origin) = &origin {
        super::row_peaks::raise_all(&mut peak, &origin.peak);
    }
    all.extend(lower_peaks(&summary.peak, &peak));
    // Steps of a parent folder have their peaks there; a test without a step has the force before it.
    if origin.is_none() && rows.steps.is_some() && !is_cut_off {
        all.extend(higher_peaks(&summary.peak, &rows.most));
    }
    Ok(all)
}

fn is_required(table: &toml::Table) -> bool {
    let required = table
        .get("record")
        .and_then(|record| record.get("required"));
    required.and_then(toml::Value::as_bool) == Some(true)
}

/// Peaks of the summary that are smaller than those of the rows.
fn lower_peaks(told: &Peak, found: &Peak) -> Vec<SummaryDifference> {
    differing(told, found, |told, found| {
        told.is_none_or(|told| told < found)
    })
}

/// Peaks of the summary that are larger than in any row. A DOF that was not recorded cannot be checked.
fn higher_peaks(told: &Peak, most: &Peak) -> Vec<SummaryDifference> {
    differing(told, most, |told, most| {
        told.is_some_and(|told| told > most)
    })
}

/// Peaks for which `is_wrong` is true, given the number of the summary and that of the rows.
fn differing(
    told: &Peak,
    found: &Peak,
    is_wrong: impl Fn(Option<f64>, f64) -> bool,
) -> Vec<SummaryDifference> {
    let mut wrong = found.clone();
    let keep_wrong = |found: &mut Vec<Option<f64>>, told: &[Option<f64>]| {
        found.resize(told.len().max(found.len()), None);
        for (index, found) in found.iter_mut().enumerate() {
            let told = told.get(index).copied().flatten();
            if !found.is_some_and(|found| is_wrong(told, found)) {
                *found = told;
            }
        }
    };
    keep_wrong(&mut wrong.displacement, &told.displacement);
    keep_wrong(&mut wrong.velocity, &told.velocity);
    keep_wrong(&mut wrong.acceleration, &told.acceleration);
    for (name, told) in &told.force {
        keep_wrong(wrong.force.entry(name.clone()).or_default(), told);
    }
    peaks(told, &wrong)
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
