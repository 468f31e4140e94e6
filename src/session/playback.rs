//! The recorded rows of a test, fed to the loop in place of its specimens, and compared with the rows that the loop
//! makes.
//!
//! The rows contain all decisions of the test: the commands of the operator, stale measurements, and when a slow specimen
//! answered. So each of them happens again in the same row. Checkpoints are compared as they come. Columns are found by
//! name; a column that the recording does not have is not compared.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::sync::{Arc, Mutex};

use crossbeam_channel::Sender;

use super::earlier_rows::EarlierRows;
use super::replay_error::ReplayError;
use gusset_control::engine::{Experiment, Operator, OperatorCommands, Phase};
use gusset_quantity::catalog::column::SEQUENCE;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::phase::{NOT_AWAITED, Part};
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::work::Work;
use gusset_record::{
    Column, Event, EventLine, EventLines, FolderError, Journal, Layout, Recorder, Run, TimedEvent,
    WarmUpRows,
};

/// Columns that place a row within a step.
const MOMENT: [&str; 2] = ["sub_tick", "time"];

/// A checkpoint that was replayed as recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Verified {
    /// Its step.
    pub step: u64,
    /// Rows up to it.
    pub rows: u64,
}

/// The first number that was not reproduced.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Row, from 0.
    pub row: u64,
    /// Its step and test time.
    pub step: u64,
    /// Test time in s.
    pub time: f64,
    /// Name of the column.
    pub column: String,
    /// Value in the recording.
    pub recorded: f64,
    /// Value of the replay.
    pub replayed: f64,
}

/// A recording: rows, and the digests of checkpoints.
pub(super) struct Recording {
    journal: Journal<Box<dyn Read + Send>>,
    checkpoints: Option<Checkpoints>,
}

impl Recording {
    /// The recording of a run folder.
    pub(crate) fn of(run: &Run) -> Result<Self, ReplayError> {
        let path = run.path().join("samples.bin");
        let samples = match File::open(&path) {
            Ok(samples) => Box::new(samples),
            Err(source) => return Err(ReplayError::Unreadable { path, source }),
        };
        let Self { journal, .. } = Self::without_checkpoints(samples, run.layout());
        Ok(Self {
            journal: journal.watched(Work::begin("replaying the record", run.places()?)),
            checkpoints: Some(Checkpoints::of(run)?),
        })
    }

    /// Of rows alone.
    pub(crate) fn without_checkpoints(samples: Box<dyn Read + Send>, layout: &Layout) -> Self {
        Self {
            journal: Journal::new(samples, layout.columns().len()),
            checkpoints: None,
        }
    }
}

/// Facts of the test whose rows a playback feeds.
#[derive(Debug)]
pub(super) struct Course<'a> {
    columns: Cow<'a, [Column]>,
    specimens: usize,
    /// One step in s, and their number.
    dt: f64,
    steps: u64,
}

impl<'a> Course<'a> {
    /// A test of a server, which integrates nothing.
    pub(crate) const fn of_a_server(columns: &'a [Column]) -> Self {
        Self {
            columns: Cow::Borrowed(columns),
            specimens: 1,
            dt: f64::NAN,
            steps: u64::MAX,
        }
    }
}

impl From<&Experiment> for Course<'_> {
    fn from(experiment: &Experiment) -> Self {
        Self {
            columns: experiment.columns().into(),
            specimens: experiment.ports.len(),
            dt: experiment.dt,
            steps: experiment.steps,
        }
    }
}

/// The recorded rows, as far as the loop has come.
pub(super) struct Playback {
    journal: Journal<Box<dyn Read + Send>>,
    /// Compared columns: name, place in the recording, place in the rows of the loop.
    compared: Vec<(String, usize, usize)>,
    /// The next row; empty after the last.
    coming: Vec<f64>,
    /// The row before it.
    passed: Vec<f64>,
    /// Places of the numbers that the specimens answered.
    sequences: Vec<usize>,
    /// Rows that are the same, with those that were passed over.
    pub row: u64,
    /// Test time of the last of them, s.
    pub time: f64,
    /// Places of `state`, `operator`, `time` and `cause`.
    places: [usize; 4],
    /// One step, s.
    dt: f64,
    /// For a recording without the column `operator`.
    earlier: Option<EarlierRows>,
    /// Number of steps of the test, and state and step of the row before the one that comes.
    steps: u64,
    before: Option<(f64, f64)>,
    /// Rows after which it is enough.
    until: u64,
    /// Whether to ignore the rows from the test's end on.
    only_the_test: bool,
    checkpoints: Option<Checkpoints>,
    pub verified: Option<Verified>,
    operator: Sender<Operator>,
    pub difference: Option<Difference>,
    /// Cause that ends the rows before the end of the recording.
    pub short: Option<String>,
    /// The rows ended while the loop would have continued: they do not show how the test ended.
    pub ran_out: bool,
    /// At the end of the rows the loop continues into the next tick: a trip before a command leaves has no row.
    pub goes_on: bool,
}

impl Playback {
    /// The rows of a recording in `layout`, for this test; `operator` is the loop's line. The loop begins with the first of
    /// `rows`. The rows before it are passed over, and only the one right before it must be complete.
    pub(crate) fn new(
        recording: Recording,
        layout: &Layout,
        course: &Course<'_>,
        operator: Sender<Operator>,
        rows: Range<u64>,
        only_the_test: bool,
    ) -> Self {
        let place = |name: &str| layout.index_of(name).unwrap_or(usize::MAX);
        let mut playback = Self {
            journal: recording.journal,
            compared: compared(layout.columns(), &course.columns),
            coming: Vec::new(),
            passed: Vec::new(),
            sequences: (1..=course.specimens)
                .map(|number| place(&SEQUENCE.of_specimen(number)))
                .collect(),
            row: 0,
            time: f64::NAN,
            places: ["state", "operator", "time", "cause"].map(place),
            dt: course.dt,
            earlier: EarlierRows::of(layout, course.steps),
            steps: course.steps,
            before: None,
            until: rows.end,
            only_the_test,
            checkpoints: recording.checkpoints,
            verified: None,
            operator,
            difference: None,
            short: None,
            ran_out: false,
            goes_on: false,
        };
        playback.pass_over(rows.start);
        playback.fill();
        playback.say();
        playback
    }

    /// Passes over the rows with numbers below `rows`: the loop has their state already.
    fn pass_over(&mut self, rows: u64) {
        while self.row < rows && self.short.is_none() {
            match self.journal.next_row() {
                Ok(Some(row)) if row.sequence < rows => {
                    self.row = row.sequence + 1;
                    self.passed.clear();
                    self.passed.extend_from_slice(row.values);
                }
                Ok(_) => self.short = Some(format!("row {} is not on record", rows - 1)),
                Err(error) => self.short = Some(error.to_string()),
            }
        }
        if self.row > 0 {
            let last = Some(&self.passed);
            self.time = at(last, self.places[2]);
            self.before = Some((at(last, self.places[0]), at(last, 0)));
        }
    }

    /// How the recording ends, if it was read that far.
    pub(crate) const fn end(&self) -> Option<gusset_record::End> {
        self.journal.end()
    }

    /// True after the last row to feed.
    pub(crate) fn is_over(&self) -> bool {
        let Some(next) = self.next() else {
            return true;
        };
        let state = at(Some(next), self.places[0]);
        self.row >= self.until || (self.only_the_test && is_after_the_test(state))
    }

    fn fill(&mut self) {
        self.coming.clear();
        if self.short.is_some() {
            return;
        }
        match self.journal.next_row() {
            Ok(Some(row)) if row.sequence == self.row => self.coming.extend_from_slice(row.values),
            Ok(Some(_)) => {
                self.short = Some(format!("row {} was lost when it was recorded", self.row));
            }
            Ok(None) => {}
            Err(error) => self.short = Some(error.to_string()),
        }
    }

    /// The row that comes.
    pub(crate) fn next(&self) -> Option<&Vec<f64>> {
        (!self.coming.is_empty()).then_some(&self.coming)
    }

    /// Whether the next row belongs to a test's end or shutdown: only there a specimen can be lost.
    pub(crate) fn is_over_next(&self) -> bool {
        let state = at(self.next(), self.places[0]);
        [Phase::Tripped.code(), Phase::Leaving.code(), NOT_AWAITED].contains(&state)
    }

    /// How a specimen was lost that the next row marks as lost.
    pub(crate) fn fault_next(&self) -> LinkFault {
        match Cause::of_column(at(self.next(), self.places[3])) {
            Some(Cause::LinkNotFinite) => LinkFault::NotFinite,
            Some(Cause::LinkDiverged) => LinkFault::Diverged,
            _ => LinkFault::Closed,
        }
    }

    /// Whether the row that comes is that in which the operator ended a wait.
    pub(crate) fn waits_in_vain_next(&self) -> bool {
        at(self.next(), self.places[0]) == NOT_AWAITED
    }

    /// Whether any specimen has answered since the row before: there was an exchange.
    pub(crate) fn has_an_answer_next(&self) -> bool {
        let (before, next) = (Some(&self.passed), self.next());
        let mut places = self.sequences.iter();
        places.any(|place| at(next, *place) > at(before, *place))
    }

    fn phase(&self) -> Option<f64> {
        self.coming.get(self.places[0]).copied()
    }

    /// Commands of the operator before the row that comes.
    fn commands(&mut self) -> OperatorCommands {
        match &mut self.earlier {
            Some(earlier) => earlier.commands(self.before, &self.coming),
            None => OperatorCommands::of(at(self.next(), self.places[1])),
        }
    }

    /// True if the loop ends by itself after the row before: that of the last step, of the shutdown, or of a trip.
    fn ends_by_itself(&self) -> bool {
        self.before.is_some_and(|(state, step)| {
            let is_last = state == Phase::Running.code() && step >= self.steps as f64;
            is_last || is_after_the_test(state)
        })
    }

    /// Repeats the operator's commands before the next row. After a difference the loop may end.
    fn say(&mut self) {
        let commands = if self.difference.is_some() {
            OperatorCommands::STOP
        } else if self.is_over() {
            self.ran_out = !self.ends_by_itself() && !self.goes_on;
            if !self.ran_out {
                return;
            }
            OperatorCommands::STOP
        } else {
            self.commands()
        };
        // The row itself ends a wait for a reply.
        for (command, request) in [
            (OperatorCommands::CONFIRM, Operator::Confirm),
            (OperatorCommands::CONTINUE, Operator::Continue),
            (OperatorCommands::HOLD, Operator::Hold),
            (OperatorCommands::STOP, Operator::Stop),
            (OperatorCommands::RETRACE, Operator::Interrupt),
            (OperatorCommands::GIVE_UP, Operator::GiveUp),
        ] {
            if commands.has(command) {
                let _ = self.operator.try_send(request);
            }
        }
    }

    /// Older recordings place the rows of a test's end and shutdown at the end of the last step, wherever between two steps the
    /// test was.
    fn stands_at_a_step(&self) -> bool {
        let next = self.next();
        let [step, sub_tick, time] = [0, 1, self.places[2]].map(|place| at(next, place));
        let state = at(next, self.places[0]);
        is_after_the_test(state) && sub_tick == 0.0 && time.to_bits() == (step * self.dt).to_bits()
    }

    /// Compares the row that was just made, and repeats the operator's commands before the next.
    fn compare(&mut self, made: &[f64]) {
        if self.coming.is_empty() {
            return;
        }
        let stands_at_a_step = self.stands_at_a_step();
        if self.difference.is_none() {
            let differs = |(name, recorded, made_at): &&(String, usize, usize)| {
                let [recorded, made] = [
                    self.coming.get(*recorded).copied(),
                    made.get(*made_at).copied(),
                ];
                let is_moved = stands_at_a_step && MOMENT.contains(&name.as_str());
                recorded.map(f64::to_bits) != made.map(f64::to_bits) && !is_moved
            };
            let column = self.compared.iter().find(differs);
            self.difference = column.map(|(name, recorded, made_at)| Difference {
                row: self.row,
                step: at(self.next(), 0) as u64,
                time: at(self.next(), self.places[2]),
                column: name.clone(),
                recorded: at(self.next(), *recorded),
                replayed: made.get(*made_at).copied().unwrap_or(f64::NAN),
            });
        }
        self.time = at(self.next(), self.places[2]);
        if self.difference.is_none() {
            let front = self.next();
            self.before = Some((at(front, self.places[0]), at(front, 0)));
            self.row += 1;
            std::mem::swap(&mut self.passed, &mut self.coming);
            self.fill();
        }
        self.say();
    }

    /// Compares a checkpoint of this step, whose row was the last.
    fn check(&mut self, step: u64, digest: u64) {
        let checkpoints = self.checkpoints.as_mut();
        let Some(recorded) = checkpoints.and_then(|checkpoints| checkpoints.of_step(step)) else {
            return;
        };
        if recorded == digest {
            self.verified = Some(Verified {
                step,
                rows: self.row,
            });
        } else if self.difference.is_none() {
            self.difference = Some(Difference {
                row: self.row.saturating_sub(1),
                step,
                time: self.time,
                column: "checkpoint".to_owned(),
                recorded: f64::NAN,
                replayed: f64::NAN,
            });
            self.say();
        }
    }
}

/// Columns to compare: those of the recording that do not depend on wall time and that the loop makes, too.
fn compared(recorded: &[Column], made: &[Column]) -> Vec<(String, usize, usize)> {
    let place = |name: &str| made.iter().position(|column| column.name == name);
    let columns = recorded.iter().enumerate().filter(|(_, c)| !c.timing);
    let pairs = columns.filter_map(|(at, c)| Some((c.name.clone(), at, place(&c.name)?)));
    pairs.collect()
}

/// The checkpoints of a recording, read as the replay reaches them.
struct Checkpoints {
    events: EventLines,
    /// The next one: its step and digest.
    coming: Option<(u64, u64)>,
}

impl Checkpoints {
    fn of(run: &Run) -> Result<Self, FolderError> {
        let mut checkpoints = Self {
            events: run.event_lines()?,
            coming: None,
        };
        checkpoints.read()?;
        Ok(checkpoints)
    }

    fn read(&mut self) -> Result<(), FolderError> {
        let one = |line: EventLine| match line.event {
            Event::Checkpoint { digest, .. } => Some((line.tick?, digest)),
            _ => None,
        };
        self.coming = None;
        while self.coming.is_none()
            && let Some(event) = self.events.next()
        {
            self.coming = event?.and_then(one);
        }
        Ok(())
    }

    /// The recorded digest of the checkpoint of this step, if it has one. Call this with ascending steps.
    fn of_step(&mut self, step: u64) -> Option<u64> {
        while self.coming.as_ref().is_some_and(|(at, _)| *at < step) {
            // Unreadable checkpoints prove nothing.
            self.read().ok()?;
        }
        let (_, digest) = self.coming.as_ref().filter(|(at, _)| *at == step)?;
        Some(*digest)
    }
}

/// True of the row of a trip and of the rows of the shutdown.
fn is_after_the_test(state: f64) -> bool {
    Part::Trip.has(state) || state == Phase::Leaving.code()
}

/// A number of a row; NaN if it is missing.
pub(super) fn at(row: Option<&Vec<f64>>, index: usize) -> f64 {
    row.and_then(|row| row.get(index))
        .copied()
        .unwrap_or(f64::NAN)
}

/// One replay source for the recorder and all specimens. The lock is never contended: all are on one thread.
pub(super) type Shared = Arc<Mutex<Playback>>;

pub(super) fn with<T>(playback: &Shared, act: impl FnOnce(&mut Playback) -> T) -> T {
    match playback.lock() {
        Ok(mut playback) => act(&mut playback),
        Err(poisoned) => act(&mut poisoned.into_inner()),
    }
}

/// A recorder that keeps nothing and compares everything.
pub(super) struct Comparing(pub Shared);

impl Recorder for Comparing {
    /// Where the rows of the test come next, nothing of the warm-up was kept.
    fn warm_up(&mut self) -> WarmUpRows {
        with(&self.0, |playback| match playback.phase() {
            Some(state) if Part::Test.has(state) => WarmUpRows::Never,
            _ => WarmUpRows::AsTheyCome,
        })
    }

    fn row(&mut self, row: &[f64]) -> bool {
        with(&self.0, |playback| playback.compare(row));
        true
    }

    fn event(&mut self, event: TimedEvent) -> bool {
        if let Event::Checkpoint { digest, .. } = event.kind {
            with(&self.0, |playback| playback.check(event.tick, digest));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_record::journal::encode;

    const TEST: &str = "title = \"a mass\"\n[time]\nstep_s = 0.01\nduration_s = 0.2\nclock = \"simulated\"\n\
        [structure.shear_building]\nmass_kg = [1e3]\nstiffness_n_per_m = [1e5]\n";

    /// The rows of `numbers`, each with its number as step and time, and the state of a running test.
    fn playback(numbers: &[u64], rows: Range<u64>) -> Playback {
        let loaded = gusset_config::parse("test.toml".as_ref(), TEST.to_owned(), &[]).unwrap();
        let experiment = gusset_setup::build(&loaded).unwrap().experiment;
        let layout = Layout::new(experiment.columns()).unwrap();
        let mut bytes = Vec::new();
        for number in numbers {
            let values = layout.columns().iter().map(|column| match &*column.name {
                "step" | "time" => *number as f64,
                "state" => Phase::Running.code(),
                _ => 0.0,
            });
            encode(*number, &values.collect::<Vec<_>>(), &mut bytes);
        }
        let samples = Box::new(std::io::Cursor::new(bytes));
        let recording = Recording::without_checkpoints(samples, &layout);
        let (operator, _) = crossbeam_channel::bounded(4);
        let course = Course::from(&experiment);
        Playback::new(recording, &layout, &course, operator, rows, true)
    }

    #[test]
    fn a_recording_can_begin_with_any_row() {
        for first in 0..6 {
            let playback = playback(&[0, 1, 2, 3, 4, 5, 6], first..6);
            assert_eq!((playback.row, playback.short.as_deref()), (first, None));
            assert_eq!(at(playback.next(), 0), first as f64);
            let before = (first > 0).then(|| (Phase::Running.code(), first as f64 - 1.0));
            assert_eq!(playback.before, before);
            assert!(!playback.is_over());
        }
        assert!(playback(&[0, 1, 2, 3], 3..3).is_over());
    }

    /// Rows that were lost long before are no trouble; the one right before the first, and the first itself, are needed.
    #[test]
    fn only_rows_around_the_first_are_needed() {
        let of = |numbers: &[u64]| {
            let playback = playback(numbers, 4..9);
            (playback.short.is_none(), playback.next().is_some())
        };
        assert_eq!(of(&[0, 3, 4, 5]), (true, true));
        assert_eq!(of(&[3, 4, 5]), (true, true));
        assert_eq!(of(&[0, 1, 2, 3]), (true, false));
        assert_eq!(of(&[0, 1, 2, 4, 5]), (false, false));
        assert_eq!(of(&[0, 1, 2]), (false, false));
        assert_eq!(of(&[0, 1, 2, 3, 5]), (false, false));
    }
}
