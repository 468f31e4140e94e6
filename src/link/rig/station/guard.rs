//! The guard of a served specimen: its limits and what they remember.
//!
//! A specimen that moves has one guard for as long as the server's process holds it. The guard keeps the speed allowance and
//! the history of commands, so an Arm, a new session or a new client begins where the last command ended. It is lent to one
//! session at a time ([`GuardStore`]). A computed specimen that does not remember has a new guard for each Arm.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::USUAL_TICK_S;
use super::allowed::{Allowed, MOST_S, Request, Times};
use crate::link::quota::{Allowance, Quota};
use crate::port::limits::{AxisLimits, Watch};
use crate::time::Nanos;

/// The limits of one specimen, and what they remember.
#[derive(Debug, Clone)]
pub(super) struct SpecimenGuard {
    pub limits: Vec<AxisLimits>,
    pub watch: Watch,
    allowed: Allowed,
}

impl SpecimenGuard {
    /// A guard of a specimen whose position is not known yet.
    pub fn new(limits: Vec<AxisLimits>, moves: bool) -> Self {
        Self {
            watch: Watch::new(limits.clone(), USUAL_TICK_S),
            allowed: Allowed::new(moves),
            limits,
        }
    }

    /// A session begins, whose client announced this rate. It forgets the measurements and warnings of the session before.
    pub fn begin(&mut self, rate: Option<(u64, u64)>) {
        self.watch.begins_session();
        self.watch.tick_is(USUAL_TICK_S);
        self.allowed.announced(rate);
    }

    /// Everything is forgotten but the limits and the announced rate.
    pub fn forget(&mut self) {
        self.watch = Watch::new(self.limits.clone(), USUAL_TICK_S);
        self.allowed.forget();
    }

    /// The specimen is at `disp`, in m. Commands start there, and the first has this number.
    pub fn arm(&mut self, sequence: u64, disp: impl Iterator<Item = f64>) {
        self.watch.is_found_at(disp);
        self.allowed.begin(sequence);
    }

    /// Commands may come from now on. Real-time: yes.
    pub fn starts(&mut self, now: Nanos) {
        self.allowed.starts(now);
    }

    /// Why a command was judged by less time than its client has for it, if it was.
    pub fn says_cut(&self) -> Option<String> {
        self.allowed.is_cut().then(|| {
            format!(
                "at a specimen that moves a command has at most {MOST_S} s for its motion: send smaller steps more often"
            )
        })
    }

    /// The times that a command of the client has for its motion, if anything is known of it, and whether the specimen has come to
    /// rest before. It goes to `disp`, in m. Real-time: yes.
    pub fn time_of(
        &mut self,
        sequence: u64,
        elapsed: f64,
        disp: impl Iterator<Item = f64>,
        now: Nanos,
    ) -> (Option<Times>, bool) {
        let rested = self.allowed.has_rested(now);
        if rested {
            self.watch.rests();
        }
        let request = Request {
            sequence,
            elapsed,
            stays: self.watch.is_at(disp),
        };
        (self.allowed.time_of(request, now), rested)
    }
}

/// Where a guard is between sessions, and how many warnings of the specimen were reported. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct GuardStore {
    guard: Arc<Mutex<Stored>>,
    warnings: Arc<Mutex<Quota>>,
}

#[derive(Debug, Default)]
enum Stored {
    /// There was no session yet.
    #[default]
    Unused,
    Here(Box<SpecimenGuard>),
    /// A session holds the guard.
    Lent,
}

impl GuardStore {
    fn stored(&self) -> MutexGuard<'_, Stored> {
        self.guard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What becomes of one more warning. A new session does not renew the quota.
    pub(super) fn warning(&self, now_ns: u64) -> Allowance {
        let mut quota = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        quota.take(now_ns)
    }

    /// The guard of the last session, or `new` before the first; none while a session holds it.
    pub(super) fn lend(&self, new: impl FnOnce() -> SpecimenGuard) -> Option<SpecimenGuard> {
        let mut stored = self.stored();
        match std::mem::replace(&mut *stored, Stored::Lent) {
            Stored::Unused => Some(new()),
            Stored::Here(guard) => Some(*guard),
            Stored::Lent => None,
        }
    }

    /// A session gives it back.
    pub(super) fn take_back(&self, guard: SpecimenGuard) {
        *self.stored() = Stored::Here(Box::new(guard));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_sessions_of_a_specimen_share_one_quota_of_warnings() {
        let store = GuardStore::default();
        let told = (0..1000).filter(|_| store.clone().warning(5).is_told);
        assert_eq!(told.count(), 100);
    }
}
