//! Everything a test needs, as plain data that can be sent to the loop's thread.

use super::columns::Row;
use super::{Limits, Pacing, Resumption, Side, StartupSettings, StaticLoad};
use crate::port::Port;
use gusset_quantity::time::{Clock, Ratio};
use gusset_record::Column;

/// Everything a test needs, as plain data.
#[derive(Debug)]
pub struct Experiment {
    /// Step Δt of test time.
    pub dt: f64,
    /// Period of the tick grid in s of wall time, exact.
    pub period: Ratio,
    /// Number of steps; rows 0 … steps.
    pub steps: u64,
    /// The numerical side.
    pub side: Side,
    /// How the specimens come to where the test begins.
    pub opening: StartupSettings,
    /// Static load before t = 0.
    pub settling: Option<StaticLoad>,
    /// One port per specimen.
    pub ports: Vec<Port>,
    /// DOFs to record, from 0.
    pub record_dofs: Vec<usize>,
    /// DOFs that are rotations, from 0: their columns are in rad.
    pub rotations: Vec<usize>,
    /// Bounds that the loop tolerates.
    pub limits: Limits,
    /// How steps and ticks belong together.
    pub pacing: Pacing,
    /// The state of an interrupted test that this one continues.
    pub resume: Option<Resumption>,
    /// A first signal makes the specimens go back to where the test began: that of an identification.
    pub retraces: bool,
    /// A clock over that of the machine, which the loop follows.
    pub followed: Option<FollowedClock>,
}

/// Makes a clock over another one.
type ClockOver = dyn FnOnce(Box<dyn Clock>) -> Box<dyn Clock> + Send;

/// Puts a clock over that of the machine: that of a bus.
pub struct FollowedClock(pub Box<ClockOver>);

impl std::fmt::Debug for FollowedClock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("FollowedClock")
    }
}

impl Experiment {
    /// Names, units and meanings of the columns that this experiment will record.
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        Row::new(
            (&self.record_dofs, &self.rotations),
            &self.side,
            &self.ports,
        )
        .1
    }
}
