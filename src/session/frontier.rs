//! The largest model that keeps its deadlines at a rate: each size runs in the loop of a test on this machine.

use std::fmt;
use std::path::PathBuf;

use thiserror::Error;
use tracing::subscriber::NoSubscriber;

use super::{SessionError, Signals, Watches, loop_round, run};
use gusset_config::TimingSpec;
use gusset_evidence::frontier::{Length, ModelError, Point, Scalable, Search, Trial, largest};
use gusset_quantity::time::Ratio;
use gusset_record::rt::timing::Quantity;
use gusset_record::{FolderError, Progress, RunFolder};

/// Share of the deadlines that a model must keep.
pub const WANTED: f64 = 0.9999;
/// The largest number of degrees of freedom that is tried. A model takes 1 kB each while it is made.
const MOST: usize = 4_000_000;
/// Size to begin with at the highest rate, before anything is known.
const BEGIN: usize = 1000;
/// Duration of a short trial in s, and its least number of ticks.
const LOOK_S: f64 = 0.5;
const LOOK_TICKS: u64 = 200;

/// Why a size cannot be tried.
#[derive(Debug, Error)]
pub enum FrontierError {
    /// The model cannot be made.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The folder of a trial cannot be made.
    #[error("the folder cannot be made: {0}")]
    Folder(#[from] FolderError),
    /// The trial cannot be run.
    #[error(transparent)]
    Session(#[from] SessionError),
}

/// Runs one size at one rate in the loop of a test, on its own thread, recorded as any test.
pub struct Trials<'a> {
    /// The model.
    pub model: Scalable,
    /// Requested real-time settings.
    pub timing: TimingSpec,
    /// Ticks that judge a size.
    pub proof: u64,
    /// Folder of a trial, which is removed after it.
    pub scratch: PathBuf,
    /// The operator.
    pub signals: &'a Signals,
    /// Receives a line about each trial.
    pub told: &'a dyn Fn(&str),
}

impl fmt::Debug for Trials<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut all = f.debug_struct("Trials");
        all.field("model", &self.model).field("proof", &self.proof);
        all.finish_non_exhaustive()
    }
}

impl Trials<'_> {
    /// Ticks that usually judge a size.
    pub const PROOF: u64 = 10_000;
    /// Ticks that judge a size quickly.
    pub const QUICK_PROOF: u64 = 1000;

    /// The largest size at a rate and its trial, beginning with the result of the rate before; `None` if not even the least size
    /// is kept, or the operator has ended the search. `each` is called before each trial.
    ///
    /// # Errors
    /// A trial cannot be run.
    pub fn largest(
        &self,
        rate: Ratio,
        before: Option<&Point>,
        each: &dyn Fn(),
    ) -> Result<Option<(usize, Trial)>, FrontierError> {
        let begin = before.map_or(BEGIN, |last| (last.dof_hz() / rate.value()) as usize);
        let search = Search {
            begin,
            range: (self.model.least(), MOST),
            wanted: WANTED,
        };
        largest(search, &mut |n, length| {
            each();
            self.run(n, rate, length)
        })
    }

    /// The size that was really run and its result; `None` if the operator ended the search.
    fn run(
        &self,
        wanted: usize,
        rate: Ratio,
        length: Length,
    ) -> Result<Option<(usize, Trial)>, FrontierError> {
        if self.signals.seen().is_some() {
            return Ok(None);
        }
        let n = self.model.size_near(wanted);
        let rate_hz = rate.value();
        let ticks = match length {
            Length::Short => LOOK_TICKS.max((LOOK_S * rate_hz) as u64),
            Length::Long => self.proof,
        };
        let side = self.model.side(n, 1.0 / rate_hz, ticks as usize)?;
        let words = (
            format!("{n} degrees of freedom at {rate} Hz"),
            format!("# gusset jitter --model: {n} degrees of freedom at {rate} Hz\n"),
        );
        let test = loop_round(side, &[0, n - 1], rate, ticks, self.timing.clone(), words);
        let folder = RunFolder::create(&self.scratch).map_err(FrontierError::Folder)?;
        let requests = self.signals.requests();
        // Deadlines are missed on purpose here: they are counted, not reported one by one.
        let finished = tracing::subscriber::with_default(NoSubscriber::new(), || {
            let unseen = &mut |_: &Progress| {};
            run(test, folder, requests, Watches::default(), unseen)
        });
        // A trial is not a test worth keeping.
        let _ = std::fs::remove_dir_all(&self.scratch);
        let summary = finished?.summary;
        if self.signals.seen().is_some() {
            return Ok(None);
        }
        let timing = summary.timing.as_ref();
        let compute = timing.map(|timing| timing.percentiles(Quantity::Compute));
        let compute = compute.unwrap_or_default();
        // No program prevents these.
        let classes = summary.miss_classes;
        let taken_away = classes.taken_away + classes.stopped + classes.unknown;
        let trial = Trial {
            ticks: summary.steps + 1,
            missed: summary.deadline_misses - taken_away,
            taken_away,
            compute_us: [compute.p50, compute.p99_9],
        };
        let what = match length {
            Length::Short => "looks",
            Length::Long => "proof",
        };
        (self.told)(&format!(
            "{:>8} Hz {n:>9} DOFs, {what}: {} of {} deadlines missed, {} more by the hypervisor or an interrupt; step {:.1} µs",
            rate_hz, trial.missed, trial.ticks, trial.taken_away, trial.compute_us[0],
        ));
        Ok(Some((n, trial)))
    }
}
