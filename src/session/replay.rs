//! A recorded test once more: what was measured goes through the same loop, and every number must come out bit for bit.
//!
//! The folder alone is enough: `resolved.toml` and the copies of its inputs make the experiment; in place of each specimen
//! stands a reader of the recorded rows. What was decided while the test ran is a column, so holds and stale measurements
//! happen again where they happened. The simulated clock keeps time; columns that depend on the wall clock are not compared.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crossbeam_channel::Sender;
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::config::{self, ConfigError};
use crate::engine::{Control, Ending, Engine, Experiment, Operator, Phase};
use crate::record::{Column, End, Event, FolderError, Journal, Layout, Recorder, Run};
use crate::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use crate::time::{Nanos, SimClock};

/// Why a folder cannot be replayed.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// It is no run folder, or a damaged one.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Its configuration is not one of this program.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A copy of an input is not what the test read.
    #[error("{}: its SHA-256 is {found}, but the test read {wanted}", path.display())]
    Input {
        /// The copy.
        path: PathBuf,
        /// As the summary has it.
        wanted: String,
        /// As it is.
        found: String,
    },
    /// A copy of an input cannot be read.
    #[error("{}: {source}", path.display())]
    Unreadable {
        /// The copy.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The columns are not those of the configuration.
    #[error("the samples have {}, but the configuration makes {}", found.as_deref().unwrap_or("no such column"), wanted.as_deref().unwrap_or("no such column"))]
    Columns {
        /// First column that differs, as recorded.
        found: Option<String>,
        /// As it should be.
        wanted: Option<String>,
    },
}

/// The first number that came out otherwise.
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
    /// What the file says.
    pub recorded: f64,
    /// What came out.
    pub replayed: f64,
}

/// What a replay came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Rows that are the same.
    pub rows: u64,
    /// Columns that were compared.
    pub columns: usize,
    /// Test time of the last of them, s.
    pub time: f64,
    /// The first that is not.
    pub difference: Option<Difference>,
    /// What ends the proof before the end of the test; none if all of it is proven.
    pub short: Option<String>,
}

impl Replay {
    /// True if every recorded number came out again.
    #[must_use]
    pub const fn is_exact(&self) -> bool {
        self.difference.is_none() && self.short.is_none()
    }
}

/// Rows to come that must be known: this one, and the one in which a confirmation shows.
const AHEAD: usize = 2;

/// The recorded rows, as far as the replay has come.
struct Tape {
    journal: Journal<Box<dyn Read + Send>>,
    columns: Vec<Column>,
    ahead: VecDeque<Vec<f64>>,
    /// Rows that are the same.
    row: u64,
    time: f64,
    state: usize,
    hold: usize,
    at_time: usize,
    /// Whether the operator wanted a hold before the row that comes.
    holding: bool,
    /// Number of steps of the test, and state and step of the row before the one that comes.
    steps: f64,
    before: Option<(f64, f64)>,
    operator: Sender<Operator>,
    difference: Option<Difference>,
    short: Option<String>,
}

impl Tape {
    fn fill(&mut self) {
        while self.ahead.len() < AHEAD && self.short.is_none() {
            match self.journal.next_row() {
                Ok(Some(row)) => {
                    let expected = self.row + self.ahead.len() as u64;
                    if row.sequence == expected {
                        self.ahead.push_back(row.values.to_vec());
                    } else {
                        self.short = Some(format!("row {expected} was lost when it was recorded"));
                    }
                }
                Ok(None) => return,
                Err(error) => self.short = Some(error.to_string()),
            }
        }
    }

    fn phase(&self, ahead: usize) -> Option<f64> {
        self.ahead.get(ahead)?.get(self.state).copied()
    }

    /// What the operator said before the tick of the row that comes: a wish for a hold stands in it, a confirmation shows in
    /// the row behind it.
    fn request(&mut self) -> Option<Operator> {
        if self.phase(0) == Some(Phase::Leaving.code())
            && let Some((state, step)) = self.before
        {
            let completed = state == Phase::Running.code() && step >= self.steps;
            let on_its_way = state == Phase::Leaving.code() || state == Phase::Tripped.code();
            if !completed && !on_its_way {
                return Some(Operator::Stop);
            }
        }
        let row = self.ahead.front()?;
        let holding = made_at(Some(row), self.hold) > 0.0;
        if holding != self.holding {
            self.holding = holding;
            return Some(if holding {
                Operator::Hold
            } else {
                Operator::Continue
            });
        }
        let (now, next) = (self.phase(0)?, self.phase(1)?);
        let confirmed = now == Phase::Zeroing.code() && now != next;
        confirmed.then_some(Operator::Continue)
    }

    /// Compares the row that was just made, and says what the operator said before the next.
    fn compare(&mut self, made: &[f64]) {
        let Some(recorded) = self.ahead.front() else {
            return;
        };
        let pairs = self.columns.iter().zip(recorded).zip(made);
        for ((column, recorded), made) in pairs {
            if !column.timing && recorded.to_bits() != made.to_bits() && self.difference.is_none() {
                let at = |index: usize| made_at(self.ahead.front(), index);
                self.difference = Some(Difference {
                    row: self.row,
                    step: at(0) as u64,
                    time: at(self.at_time),
                    column: column.name.clone(),
                    recorded: *recorded,
                    replayed: *made,
                });
            }
        }
        self.time = made_at(self.ahead.front(), self.at_time);
        if self.difference.is_none() {
            let front = self.ahead.front();
            self.before = Some((made_at(front, self.state), made_at(front, 0)));
            self.row += 1;
            self.ahead.pop_front();
            self.fill();
        }
        // Nothing left to compare with: the loop may end.
        let request = if self.ahead.is_empty() || self.difference.is_some() {
            Some(Operator::Stop)
        } else {
            self.request()
        };
        if let Some(request) = request {
            let _ = self.operator.try_send(request);
        }
    }
}

fn made_at(row: Option<&Vec<f64>>, index: usize) -> f64 {
    row.and_then(|row| row.get(index))
        .copied()
        .unwrap_or(f64::NAN)
}

/// One tape for the recorder and all specimens. The lock is never contended: all are on one thread.
type Shared = Arc<Mutex<Tape>>;

fn with<T>(tape: &Shared, act: impl FnOnce(&mut Tape) -> T) -> T {
    match tape.lock() {
        Ok(mut tape) => act(&mut tape),
        Err(poisoned) => act(&mut poisoned.into_inner()),
    }
}

struct Comparing(Shared);

impl Recorder for Comparing {
    fn row(&mut self, row: &[f64]) -> bool {
        with(&self.0, |tape| tape.compare(row));
        true
    }

    fn event(&mut self, _: Event) -> bool {
        true
    }
}

/// Answers as the recorded specimen did.
struct Recorded {
    tape: Shared,
    /// Places of raw displacement and raw force of each axis, of the sequence number and of the status.
    axes: Vec<[usize; 2]>,
    sequence: usize,
    status: usize,
    issued: u64,
}

impl Recorded {
    /// Fails where the row that comes says so: there the specimen was lost.
    fn is_lost(&self, mark: Status) -> Result<(), LinkFault> {
        with(&self.tape, |tape| {
            let row = tape.ahead.front();
            let status = Status(made_at(row, self.status) as u32);
            let trips = made_at(row, tape.state) == Phase::Tripped.code();
            if trips && status.has(mark) {
                return Err(LinkFault::Closed);
            }
            Ok(())
        })
    }
}

impl Substructure for Recorded {
    fn axes(&self) -> usize {
        self.axes.len()
    }

    fn coupling(&self) -> Coupling {
        Coupling::Lockstep
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.issued = command.sequence;
        self.is_lost(Status::UNSENT)
    }

    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let issued = self.issued;
        self.is_lost(Status::LOST)?;
        with(&self.tape, |tape| {
            // The end of the recording ends the replay.
            let row = tape.ahead.front().ok_or(LinkFault::Closed)?;
            let at = |index: usize| made_at(Some(row), index);
            let recorded = at(self.sequence) as u64;
            let axes = into.disp.iter_mut().zip(&mut into.force);
            for ((disp, force), [disp_at, force_at]) in axes.zip(&self.axes) {
                (*disp, *force) = (at(*disp_at), at(*force_at));
            }
            into.status = Status(at(self.status) as u32);
            // Commands before the one that this row answers leave no row: the ticks of the warm-up.
            into.sequence = recorded.min(issued);
            // Ticks in which nothing moves share a number: there the row says how old its measurement is.
            let stale = issued == recorded && into.status.has(Status::STALE);
            Ok(if issued > recorded || stale {
                Freshness::Stale
            } else {
                Freshness::Fresh
            })
        })
    }

    /// A partner that takes several ticks answers in the row in which it answered.
    fn is_answered(&mut self) -> Result<bool, LinkFault> {
        self.is_lost(Status::LOST)?;
        with(&self.tape, |tape| {
            let row = tape.ahead.front().ok_or(LinkFault::Closed)?;
            Ok(made_at(Some(row), self.sequence) as u64 >= self.issued)
        })
    }

    fn retire(&mut self, _: Retirement) {}
}

/// Runs the recording in `folder` through the loop again.
///
/// # Errors
/// See [`ReplayError`]. A number that differs is no error but [`Replay::difference`].
pub fn replay(folder: &Path) -> Result<Replay, ReplayError> {
    let run = Run::open(folder)?;
    check_inputs(&run)?;
    let mut loaded = config::load(&folder.join("resolved.toml"), &[])?;
    // No specimen is spoken to: what only a link needs is not asked for.
    for link in loaded
        .file
        .specimen
        .iter_mut()
        .filter_map(|s| s.link.as_mut())
    {
        link.key_file = None;
    }
    let experiment = config::build(&loaded)?.experiment;
    let path = folder.join("samples.bin");
    let samples = File::open(&path).map_err(|source| ReplayError::Unreadable { path, source })?;
    let mut found = replay_rows(experiment, run.layout(), Box::new(samples))?;
    if found.is_exact() {
        found.short = missing_end(&run, &found);
    }
    Ok(found)
}

/// What is proven is not all that there was: rows that are whole may be too few.
fn missing_end(run: &Run, found: &Replay) -> Option<String> {
    if found.rows == 0 {
        return Some("there are no rows to be compared".to_owned());
    }
    let summary = run.summary()?;
    let wanted = summary.steps as f64 * summary.dt;
    let is_there = found.time + 0.5 * summary.dt >= wanted;
    (!is_there).then(|| {
        format!(
            "the summary tells of {} steps, {wanted} s, but the rows end at {} s",
            summary.steps, found.time
        )
    })
}

/// Runs recorded rows through a loop that is made anew: `experiment` is the test, `samples` are its records in `layout`.
///
/// # Errors
/// [`ReplayError::Columns`]. A number that differs is no error but [`Replay::difference`].
pub fn replay_rows(
    mut experiment: Experiment,
    layout: &Layout,
    samples: Box<dyn Read + Send>,
) -> Result<Replay, ReplayError> {
    let columns = experiment.columns();
    same_columns(layout.columns(), &columns)?;
    let (operator, requests) = crossbeam_channel::bounded(4);
    let place = |name: &str| layout.index_of(name).unwrap_or(usize::MAX);
    let mut tape = Tape {
        journal: Journal::new(samples, layout.columns().len()),
        state: place("state"),
        hold: place("hold"),
        at_time: place("time"),
        holding: false,
        columns,
        ahead: VecDeque::with_capacity(AHEAD),
        row: 0,
        time: f64::NAN,
        steps: experiment.steps as f64,
        before: None,
        operator,
        difference: None,
        short: None,
    };
    tape.fill();
    if let Some(request) = tape.request() {
        let _ = tape.operator.try_send(request);
    }
    let tape = Arc::new(Mutex::new(tape));
    put_recorded(&mut experiment, &tape, place);
    let compared = layout.columns().iter().filter(|c| !c.timing).count();
    let recorder = Box::new(Comparing(Arc::clone(&tape)));
    let mut engine = Engine::new(experiment, Box::new(SimClock::new()), recorder);
    let outcome = engine.run(&Control::from(requests));
    Ok(with(&tape, |tape| {
        let left = !tape.ahead.is_empty() && tape.difference.is_none();
        let short = match (tape.journal.end(), &outcome.ending) {
            _ if tape.short.is_some() => tape.short.take(),
            _ if left => Some(match outcome.ending {
                Ending::Stopped(stop) => format!("the replay stops where the test did not: {stop}"),
                Ending::Completed => "the test went on where the replay ends".to_owned(),
            }),
            (Some(End::Clean) | None, _) => None,
            (Some(end), _) => Some(end.to_string()),
        };
        Replay {
            rows: tape.row,
            columns: compared,
            time: tape.time,
            difference: tape.difference.take(),
            short,
        }
    }))
}

fn put_recorded(experiment: &mut Experiment, tape: &Shared, place: impl Fn(&str) -> usize) {
    for (index, port) in experiment.ports.iter_mut().enumerate() {
        let s = index + 1;
        let axis = |j: usize| {
            [
                place(&format!("raw_disp_{s}_{j}")),
                place(&format!("raw_force_{s}_{j}")),
            ]
        };
        port.put_recording(Box::new(Recorded {
            tape: Arc::clone(tape),
            axes: (1..=port.axes()).map(axis).collect(),
            sequence: place(&format!("seq_{s}")),
            status: place(&format!("status_{s}")),
            issued: 0,
        }));
    }
}

fn check_inputs(run: &Run) -> Result<(), ReplayError> {
    for input in run.summary().map_or(&[][..], |summary| &summary.inputs) {
        let path = run.path().join(&input.path);
        let bytes = std::fs::read(&path).map_err(|source| ReplayError::Unreadable {
            path: path.clone(),
            source,
        })?;
        let digest = Sha256::digest(bytes);
        let found: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        if found != input.sha256 {
            return Err(ReplayError::Input {
                path,
                wanted: input.sha256.clone(),
                found,
            });
        }
    }
    Ok(())
}

fn same_columns(found: &[Column], wanted: &[Column]) -> Result<(), ReplayError> {
    let longest = found.len().max(wanted.len());
    let name = |columns: &[Column], index: usize| columns.get(index).map(|c| c.name.clone());
    let differs = (0..longest).find(|&index| name(found, index) != name(wanted, index));
    match differs {
        None => Ok(()),
        Some(index) => Err(ReplayError::Columns {
            found: name(found, index),
            wanted: name(wanted, index),
        }),
    }
}
