//! The board: the writer puts the present state there, and viewers copy it. The writer never waits for the lock: it tries
//! again two milliseconds later.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use serde::Serialize;

use super::history::{Bin, History};
use super::latency::LatencyView;
use super::subject::Subject;
use super::trip::Trip;
use gusset_control::engine::{Glimpse, Phase, PhaseCell};
use gusset_proof::OnlineLimit;
use gusset_record::MissClasses;

/// Time over which the stiffest tangent is kept: once to twice this, ns.
pub(super) const WINDOW_NS: u64 = 1_000_000_000;
/// Least time between two computations of the limit of λ, ns: every tangent enters at least one.
pub(super) const MARGIN_EVERY_NS: u64 = WINDOW_NS / 2;

/// State of a test, as known from its rows.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Snapshot {
    /// Monotonic clock when it was made, ns.
    #[serde(skip)]
    pub now_ns: u64,
    /// Monotonic clock when the last row came, ns, or when rows were held back last; 0 before the first.
    #[serde(skip)]
    pub row_ns: u64,
    /// Rows seen; rows that were lost before the board are not included.
    pub rows: u64,
    /// Step of the last row.
    pub step: f64,
    /// Steps that were closed.
    pub steps: u64,
    /// Test time in s.
    pub time: f64,
    /// Periods of the controller since the first row, s.
    pub elapsed: f64,
    /// The column `state`.
    pub state: f64,
    /// Whole ticks by which the grid was moved.
    pub stretched: f64,
    /// Rows in the file.
    pub rows_written: u64,
    /// Rows lost.
    pub rows_lost: u64,
    /// Events.
    pub events: u64,
    /// Deadline misses by class.
    pub misses: MissClasses,
    /// Deadline misses of the last 10 s of wall time.
    pub recent_misses: u64,
    /// How late and how long; empty on the simulated clock.
    pub timing: Vec<LatencyView>,
    /// Every axis of every specimen, in order.
    pub axes: Vec<AxisView>,
    /// Every specimen.
    pub specimens: Vec<SpecimenView>,
    /// The limits of the test as a whole, in order: present value and largest.
    pub test: Vec<[f64; 2]>,
    /// Causes of the trip, in the order of their events; empty without a trip.
    pub trips: Vec<Trip>,
}

/// One axis, SI at the specimen's scale; measured values are of its last answer. NaN where no value exists.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AxisView {
    /// Displacement that was sent.
    pub command: f64,
    /// Displacement that was measured.
    pub measured: f64,
    /// Force that was measured.
    pub force: f64,
    /// Measured − commanded, less the sensor's reading beyond the command where its zero was taken.
    pub error: f64,
    /// Tangent stiffness as estimated, at the structure.
    pub stiffness: f64,
    /// The largest of the last while.
    #[serde(skip)]
    pub stiffest: f64,
    /// Largest tangent damping of the last while.
    #[serde(skip)]
    pub damping: f64,
    /// Energy that the transfer system has added, J.
    pub added: f64,
    /// Critical delay at the stiffness of the last seconds less their lag, s of test time: present and smallest so far. Infinite
    /// where every delay is stable.
    pub margin: [f64; 2],
    /// Per limit: present value, smallest and largest so far.
    pub limits: Vec<[f64; 3]>,
}

/// One specimen's link, as known from rows.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SpecimenView {
    /// Commands sent so far, repeated ones included.
    pub exchanges: u64,
    /// Replies so far that were not there in time.
    pub stale: u64,
    /// Status flags of the last row; the README of the run folder names them.
    pub status: u32,
}

/// λ in use against its limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Margin {
    /// Largest stable λ with the tangents of the last while; infinite if every one is.
    pub limit: f64,
    /// The smallest of these so far.
    pub lowest: f64,
}

/// How a test ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ended {
    /// As in summary.json.
    pub status: String,
    /// In words.
    pub reason: String,
    /// The report, if it could be written.
    pub report: Option<String>,
    /// The run folder.
    pub data: String,
}

/// The board.
#[derive(Debug)]
pub struct Board {
    /// The displayed test.
    pub subject: Subject,
    phase: PhaseCell,
    latest: Mutex<Arc<Snapshot>>,
    history: Mutex<History>,
    ended: Mutex<Option<Ended>>,
    online: Option<OnlineLimit>,
    margin: Mutex<(u64, Option<Margin>)>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn try_lock<T>(mutex: &Mutex<T>) -> Option<MutexGuard<'_, T>> {
    match mutex.try_lock() {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

impl Board {
    /// An empty board for a test whose phase is in `phase`.
    #[must_use]
    pub fn new(subject: Subject, phase: PhaseCell, online: Option<OnlineLimit>) -> Self {
        Self {
            subject,
            phase,
            latest: Mutex::default(),
            history: Mutex::default(),
            ended: Mutex::default(),
            online,
            margin: Mutex::new((0, None)),
        }
    }

    /// Present state of the test; shared, not copied.
    #[must_use]
    pub fn latest(&self) -> Arc<Snapshot> {
        Arc::clone(&lock(&self.latest))
    }

    /// The phase of the test's life, which is known without a row.
    #[must_use]
    pub(crate) fn phase(&self) -> Phase {
        self.phase.get()
    }

    /// The phase and the operator's hold, which are known without a row.
    #[must_use]
    pub fn glimpse(&self) -> Glimpse {
        self.phase.glimpse()
    }

    /// How it ended, once it has.
    #[must_use]
    pub(crate) fn ended(&self) -> Option<Ended> {
        lock(&self.ended).clone()
    }

    /// Records how the test ended. The next reader computes the last margin of λ.
    #[cfg(feature = "monitor")]
    pub(crate) fn end(&self, mut ended: Ended) {
        ended.reason = gusset_quantity::text::printable(&ended.reason);
        lock(&self.margin).0 = 0;
        *lock(&self.ended) = Some(ended);
    }

    /// Copies the requested part of the history.
    #[cfg(feature = "monitor")]
    pub(crate) fn look_back<T>(&self, look: impl FnOnce(&History) -> T) -> T {
        look(&lock(&self.history))
    }

    /// Moves `bins` into the history, unless a viewer holds the lock.
    pub(super) fn try_append(&self, bins: &mut Vec<Bin>) {
        if let Some(mut history) = try_lock(&self.history) {
            bins.drain(..).for_each(|bin| history.push(bin));
        }
    }

    /// Shows the snapshot, unless a viewer holds the lock.
    pub(super) fn try_show(&self, snapshot: Snapshot) -> bool {
        match try_lock(&self.latest) {
            Some(mut latest) => {
                *latest = Arc::new(snapshot);
                true
            }
            None => false,
        }
    }

    /// Margin of λ with the recent tangents; none without a proof. It is computed on the thread of the caller, at most once
    /// per `MARGIN_EVERY_NS`. A caller at least as frequent misses no tangent.
    pub fn margin(&self, now_ns: u64) -> Option<Margin> {
        let online = self.online.as_ref()?;
        let mut guard = lock(&self.margin);
        let (at, known) = &mut *guard;
        if known.is_none() || now_ns.saturating_sub(*at) >= MARGIN_EVERY_NS {
            let latest = self.latest();
            if latest.rows == 0 {
                return None;
            }
            let axes = latest.axes.iter();
            let limit = online.limit(axes.map(|axis| (axis.stiffest, Some(axis.damping))));
            let lowest = known.map_or(limit, |margin| margin.lowest.min(limit));
            (*at, *known) = (now_ns, Some(Margin { limit, lowest }));
        }
        *known
    }
    /// The margin without a new computation.
    #[cfg(all(test, feature = "monitor"))]
    pub(super) fn known_margin(&self) -> Option<Margin> {
        lock(&self.margin).1
    }
}
