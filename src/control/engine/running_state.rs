//! The state of a running test: everything that its later rows depend on, shown to one visitor for every direction.
//!
//! A state is taken at the end of a tick that closed a step. What follows it is the next tick. Wall time, deadlines and the
//! record are not part of it, nor is the state of a specimen behind a link, which keeps its own.

use super::columns::Row;
use super::commanding::Exchanges;
use super::numerical::Side;
use super::place::Place;
use super::step_progress::StepProgress;
use super::supervision::Supervision;
use super::test_judge::TestJudge;
use super::tick::Tick;
use crate::port::Port;
use gusset_numerics::integrate::Peaks;
use gusset_quantity::state;

/// The parts of a running test that have a state.
pub(super) struct RunningState<'a> {
    pub ports: &'a mut [Port],
    pub side: &'a mut Side,
    pub peaks: &'a mut Peaks,
    pub progress: &'a mut StepProgress,
    pub exchanges: &'a mut Exchanges,
    pub judge: &'a mut TestJudge,
    pub place: &'a mut Place,
    pub supervision: &'a mut Supervision,
    pub row: &'a mut Row,
    /// The tick that closed the step.
    pub last: &'a mut Tick,
}

state! {
    RunningState<'_> as "test" {
        last, place, progress, exchanges, supervision, judge, peaks, row, side, ports
    }
}
