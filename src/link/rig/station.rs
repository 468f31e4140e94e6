//! What a server commands: a rig with its limits, its direction check and its log.

mod allowed;
mod announced;
mod attempt;
mod beginning;
mod ending;
mod first;
mod guard;
mod ready;
#[cfg(test)]
mod tests;

pub(in crate::link) use first::words as first_words;

pub use guard::GuardStore;

use std::collections::BTreeSet;

use announced::Announced;
use attempt::Origin;
use guard::SpecimenGuard;

use super::latch::Latch;
use super::log::{Log, LogSettings};
use super::settings::{ProbeSettings, TestEnd};
use super::{Rig, Trip};
use crate::catalog::event::{Remark, Severity};
use crate::catalog::limit::Limit;
use crate::config::LimitsSpec;
use crate::link::quota::Allowance;
use crate::port::limits::{AxisLimits, Watch};
use crate::record::Event;
use crate::rt::os;
use crate::substructure::{Command, LinkStats, Measurement};
use crate::time::Nanos;
use crate::units::AxisUnits;

/// From one command to the next in s, until it is known.
const USUAL_TICK_S: f64 = 0.01;

/// A specimen as a server commands it. Ends its test when it is dropped.
pub struct Station {
    name: String,
    rig: Box<dyn Rig>,
    units: Vec<AxisUnits>,
    stiffness: Vec<f64>,
    mass: Vec<f64>,
    /// In a session that of the specimen, which is the store's; else one without a past.
    guard: SpecimenGuard,
    store: GuardStore,
    /// Keys of its limits that need a measured displacement.
    needs_measured_disp: Vec<&'static str>,
    /// A trip of a session before.
    latch: Latch,
    announced: Option<Announced>,
    /// True for what moves: its speed is judged by the wall clock.
    moves: bool,
    /// A computed specimen that keeps its state between sessions.
    remembers: bool,
    /// The wall time of whoever commands it; the machine's own until that is told.
    now: Option<Nanos>,
    probe: ProbeSettings,
    /// What is played on every test, in words.
    played: Option<String>,
    keeping: Option<LogSettings>,
    away_from: Option<usize>,
    log: Option<Log>,
    begun: bool,
    /// The specimen has heard the last word of this test.
    is_dismissed: bool,
    /// Where the specimen stands, until the first command of a controller that did not say where that will be has passed.
    stands: Option<Vec<f64>>,
    /// The same in m for what moves, whoever commands it.
    leaves: Option<Vec<f64>>,
    /// Of what moves: the first command of a controller that asked to be armed, and where it said that it will be.
    begins: Option<(u64, Vec<f64>)>,
    /// Test time of the first command since it was armed, and whether one has moved it since that passed.
    goes_on_from: Option<f64>,
    runs: bool,
    /// Where the last command went that was passed on; empty before one.
    passed_on: Vec<f64>,
    measured: Measurement,
    /// What its sensors read when all of them last gave a number.
    sound: Measurement,
    tripped: Option<Trip>,
    commits: u64,
    /// Answers of a simulated actuator that did not come to terms with what it moves.
    unsettled: u64,
    /// Answers in a row in which the specimen says that it holds by its own watchdog.
    holding: u64,
    /// Of a specimen in this process: what its controller's link did to its commands, which have no other. Of another: what its
    /// own has counted when it was dismissed.
    link: LinkStats,
}

impl std::fmt::Debug for Station {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Station")
            .field("name", &self.name)
            .field("axes", &self.units.len())
            .finish_non_exhaustive()
    }
}

impl Station {
    /// A station without limits and without a log; `stiffness` and `mass` are n × n by columns, in `units`.
    #[must_use]
    pub fn new(
        name: String,
        rig: Box<dyn Rig>,
        units: Vec<AxisUnits>,
        stiffness: Vec<f64>,
        mass: Vec<f64>,
    ) -> Self {
        let axes = units.len();
        let probe = if rig.is_remote() {
            ProbeSettings::Unchecked { silent: false }
        } else {
            ProbeSettings::Needless
        };
        Self {
            name,
            guard: SpecimenGuard::new(vec![AxisLimits::NONE; axes], rig.is_remote()),
            store: GuardStore::default(),
            needs_measured_disp: Vec::new(),
            latch: Latch::default(),
            announced: None,
            moves: rig.is_remote(),
            remembers: false,
            now: None,
            rig,
            units,
            stiffness,
            mass,
            probe,
            played: None,
            keeping: None,
            away_from: None,
            log: None,
            begun: false,
            is_dismissed: false,
            stands: None,
            leaves: None,
            begins: None,
            goes_on_from: None,
            runs: false,
            passed_on: Vec::with_capacity(axes),
            measured: Measurement::zeros(axes),
            sound: Measurement::zeros(axes),
            tripped: None,
            commits: 0,
            unsettled: 0,
            holding: 0,
            link: LinkStats::default(),
        }
    }

    /// The bounds of its axes.
    #[must_use]
    pub fn limited(mut self, limits: &[LimitsSpec]) -> Self {
        let mut own = self.guard.limits.clone();
        for (own, spec) in own.iter_mut().zip(limits) {
            *own = AxisLimits::of(spec);
        }
        self.guard = SpecimenGuard::new(own, self.moves);
        let needs = limits.iter().flat_map(LimitsSpec::needing_measured_disp);
        self.needs_measured_disp = needs.collect::<BTreeSet<_>>().into_iter().collect();
        self
    }

    /// Where its guard is between sessions, and the latch of its trips: those of the specimen, which outlive this station.
    #[must_use]
    pub fn guarded(mut self, store: GuardStore, latch: Latch) -> Self {
        (self.store, self.latch) = (store, latch);
        self
    }

    /// It is computed and keeps its state between sessions, and so its limits' history and its trip.
    #[must_use]
    pub fn remembering(mut self, remembers: bool) -> Self {
        self.remembers = remembers;
        self
    }

    /// How its direction is found out.
    #[must_use]
    pub fn probed(mut self, probe: ProbeSettings) -> Self {
        self.probe = probe;
        self
    }

    /// It moves, or stands for something that does, although it is no link.
    #[must_use]
    pub fn moving(mut self) -> Self {
        self.moves = true;
        self.guard = SpecimenGuard::new(self.guard.limits.clone(), true);
        self
    }

    /// True if a session finds the specimen as the last one left it: its limits' history and its trip stay, too.
    const fn is_lasting(&self) -> bool {
        self.moves || self.remembers
    }

    /// Faults are played on every test, as these words say: its record says so, too.
    #[must_use]
    pub fn played(mut self, words: Option<String>) -> Self {
        self.played = words;
        self
    }

    /// Each controller's test gets a run folder.
    #[must_use]
    pub fn recorded(mut self, keeping: Option<LogSettings>) -> Self {
        self.keeping = keeping;
        self
    }

    /// The processor that the log's threads leave to the data.
    pub fn keep_log_away_from(&mut self, cpu: Option<usize>) {
        self.away_from = cpu;
    }

    /// Number of axes.
    #[must_use]
    pub fn axes(&self) -> usize {
        self.units.len()
    }

    /// True if commands leave this process.
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.rig.is_remote()
    }

    /// Initial stiffness, n × n by columns.
    #[must_use]
    pub fn stiffness(&self) -> &[f64] {
        &self.stiffness
    }

    /// Mass, n × n by columns.
    #[must_use]
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// Tangent stiffness, n × n by columns. Real-time: yes.
    pub fn tangent(&mut self, stiffness: &mut [f64]) {
        self.rig.tangent(stiffness);
    }

    /// Commands may come from now on. Real-time: yes.
    pub fn starts(&mut self, now: Nanos) {
        self.now = Some(now);
        self.guard.starts(now);
    }

    /// The present wall time, by a clock other than the machine's. Real-time: yes.
    pub const fn now_is(&mut self, now: Nanos) {
        self.now = Some(now);
    }

    /// What was measured last.
    #[must_use]
    pub const fn measured(&self) -> &Measurement {
        &self.measured
    }

    /// Why the specimen holds, if it does.
    #[must_use]
    pub const fn tripped(&self) -> Option<Trip> {
        self.tripped
    }

    /// The latch of the specimen's trips.
    #[must_use]
    pub const fn latch(&self) -> &Latch {
        &self.latch
    }

    /// The operator's next step, if a trip is latched.
    #[must_use]
    pub fn next_step(&self) -> Option<String> {
        let trip = self.latch.trip();
        trip.map(|_| format!("no test begins until {}", self.latch.next_step()))
    }

    /// A trip with what its link has to say.
    #[must_use]
    pub fn whole(&self, trip: Trip) -> String {
        match (trip, self.rig.complaint(), &self.stands, &self.leaves) {
            (Trip::Lost(_), Some(complaint), ..) => format!("{trip} ({complaint})"),
            (Trip::Limit(hit), _, stands, leaves) if hit.quantity.is_of_motion() => {
                let mut text = trip.to_string();
                if let Some(stands) = stands {
                    text.push_str(&format!(
                        ": the specimen is at {}, and the first command leads away from there",
                        self.in_words(stands)
                    ));
                }
                let limits = &self.guard.limits;
                let why = leaves.as_ref().and_then(|_| first::why(limits, &hit));
                if let Some(why) = why {
                    text.push_str(&format!(" ({why})"));
                }
                let is_timed = hit.quantity != Limit::CommandStep;
                if let Some(cut) = self.guard.says_cut().filter(|_| is_timed) {
                    text.push_str(&format!(" ({cut})"));
                }
                text
            }
            _ => trip.to_string(),
        }
    }

    /// One exchange: limits, rig, limits, log. `elapsed` is the test time since the last commit. `into` holds what was
    /// measured last, with the interlock flag while a trip is latched. False if the answer is owed, and not `wanted` any more.
    /// Real-time: yes, as far as the rig is.
    ///
    /// # Errors
    /// The specimen holds; this command, or the one that tripped, was not passed on or must be the last.
    pub fn exchange(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        wanted: &mut dyn FnMut() -> bool,
        into: &mut Measurement,
    ) -> Result<bool, Trip> {
        self.exchange_as(Origin::Client, command, elapsed, wanted, into)
    }

    /// Latches the trip of a lasting specimen: no session begins before its operator has cleared it. A lost link is not latched.
    fn trip(&mut self, trip: Trip) {
        self.tripped = Some(trip);
        let text = self.whole(trip);
        if self.is_lasting() && !matches!(trip, Trip::Lost(_)) {
            self.latch.set(&self.name, trip.name(), &text);
        }
        if let Some(log) = &self.log {
            log.tripped(trip, &text);
        }
    }

    /// The last command is accepted. A specimen that is lost meanwhile shows at the next command. Real-time: yes.
    pub fn commit(&mut self) {
        if self.tripped.is_some() {
            return;
        }
        self.commits += 1;
        if let Err(fault) = self.rig.commit() {
            self.trip(Trip::Lost(fault));
        }
    }

    /// What was not committed is forgotten, by what can forget.
    pub fn revert(&mut self) {
        self.rig.revert();
    }

    /// Nothing to command for now: notices a specimen that has gone. Does not block.
    ///
    /// # Errors
    /// It has.
    pub fn attend(&mut self) -> Result<(), Trip> {
        if self.begun
            && self.tripped.is_none()
            && let Err(fault) = self.rig.attend()
        {
            self.trip(Trip::Lost(fault));
            return Err(Trip::Lost(fault));
        }
        Ok(())
    }

    /// Its controller is held by an operator.
    pub fn pause(&mut self) {
        // A specimen that is lost shows when it is attended to.
        let _ = self.rig.pause();
    }

    /// Its controller ends its test here: it stops, and what comes next comes from rest.
    pub fn halt(&mut self) {
        self.guard.watch.rests();
        if let Some(announced) = &mut self.announced {
            announced.rests();
        }
        // As in a hold.
        let _ = self.rig.halt();
    }

    /// A warning about the client: for the program's log, and for the events and the summary of the run folder.
    pub fn warn(&mut self, event: Remark, text: &str) {
        self.warn_once(event, text);
    }

    /// Something for the log.
    pub fn note(&self, event: Remark, text: &str) {
        let event = Event::said(event, text);
        let is_warning = event
            .row()
            .is_some_and(|row| row.severity == Severity::Warning);
        match &self.log {
            Some(log) => log.note(event.into()),
            None if is_warning => {
                let Allowance { is_told, notice } = self.store.warning(os::monotonic_ns());
                let text = is_told.then_some(text);
                for text in text.into_iter().chain(notice.as_deref()) {
                    tracing::warn!("{text}");
                }
            }
            // Whoever watches the server is told of these.
            None => {}
        }
    }
}

fn metres<'a>(units: &'a [AxisUnits], disp: &'a [f64]) -> impl Iterator<Item = f64> + Clone + 'a {
    disp.iter()
        .zip(units)
        .map(|(disp, units)| disp * units.metres)
}

/// The first axis (from 0) on which a number is none. Real-time: yes.
fn not_finite(one: &[f64], other: &[f64]) -> Option<usize> {
    let mut pairs = one.iter().zip(other);
    pairs.position(|(one, other)| !(one.is_finite() && other.is_finite()))
}
