//! The guard of a served specimen between sessions.
//!
//! A specimen that moves has one guard for as long as the server's process holds it. The guard keeps the history of commands and
//! the speed allowance. So an Arm, a new session or a new client begins where the last command ended. It is lent to one session
//! at a time. A computed specimen that does not remember has a new guard for each Arm.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::speed_allowance::SpeedAllowance;
use crate::quota::{Allowance, Quota};
use gusset_control::port::Guard;

/// The guard of one specimen and its speed allowance, which outlive a session.
#[derive(Debug, Clone)]
pub(super) struct LastingGuard {
    pub guard: Guard,
    pub allowance: SpeedAllowance,
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
    Here(Box<LastingGuard>),
    /// A session holds the guard.
    Lent,
}

impl GuardStore {
    fn stored(&self) -> MutexGuard<'_, Stored> {
        self.guard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether one more warning is shown. A new session does not renew the quota.
    pub(super) fn warning(&self, now_ns: u64) -> Allowance {
        let mut quota = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        quota.take(now_ns)
    }

    /// The guard of the last session, or `new` before the first; none while a session holds it.
    pub(super) fn lend(&self, new: impl FnOnce() -> LastingGuard) -> Option<LastingGuard> {
        let mut stored = self.stored();
        match std::mem::replace(&mut *stored, Stored::Lent) {
            Stored::Unused => Some(new()),
            Stored::Here(guard) => Some(*guard),
            Stored::Lent => None,
        }
    }

    /// A session gives it back.
    pub(super) fn take_back(&self, guard: LastingGuard) {
        *self.stored() = Stored::Here(Box::new(guard));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_sessions_share_one_warning_quota() {
        let store = GuardStore::default();
        let told = (0..1000).filter(|_| store.clone().warning(5).is_told);
        assert_eq!(told.count(), 100);
    }
}
