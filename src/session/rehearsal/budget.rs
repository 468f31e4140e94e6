//! How much may be rehearsed, counted in DOFs × ticks: the same on every machine, and never in wall time.

use gusset_control::engine::{Experiment, Side};

/// DOFs × ticks of a whole rehearsal: a million ticks of a small structure, which take one to two seconds.
const WHOLE: u64 = 64_000_000;
/// DOFs that a tick counts at least: specimens and the loop itself cost something, too.
const LEAST_DOFS: u64 = 64;

/// The remaining budget for rehearsals, in DOFs × ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget(u64);

impl Default for Budget {
    fn default() -> Self {
        Self(WHOLE)
    }
}

impl Budget {
    /// A budget of `dof_ticks` DOFs × ticks.
    #[must_use]
    pub const fn new(dof_ticks: u64) -> Self {
        Self(dof_ticks)
    }

    /// The cost of one tick of an experiment.
    pub(super) fn cost(experiment: &Experiment) -> u64 {
        let dofs = match &experiment.side {
            Side::Structure(numerical) => numerical.structure.dofs() as u64,
            Side::Prescribed(_) | Side::Received(_) => 0,
        };
        dofs.max(LEAST_DOFS)
    }

    /// Remaining ticks at `cost` each.
    pub(super) const fn ticks(self, cost: u64) -> u64 {
        self.0 / cost
    }

    /// Takes off `ticks` at `cost` each.
    pub(super) const fn spend(&mut self, ticks: u64, cost: u64) {
        self.0 = self.0.saturating_sub(ticks.saturating_mul(cost));
    }
}
