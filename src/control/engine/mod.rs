//! The loop, the same under the real and the simulated clock.
//!
//! An [`Experiment`] is plain data. The life cycle ([`Connected`], [`Ready`], [`Stopped`], [`Retired`]) owns it on the loop's
//! thread, and lets the engine run inside a panic boundary. The engine performs maneuvers: wiring check, zeroing, static load,
//! ramp, warm-up, the steps of the test, and the shutdown. Each of them goes through the one tick loop, in `cycle`: wait for
//! the edge, exchange, judge, record, hand over. Time, operator and record are in `environment`. No command leaves that was
//! not judged, no step is skipped, and every specimen is retired however the test ends. The engine knows neither files
//! nor threads nor the links behind its ports.

mod audit;
mod columns;
mod commanding;
mod cycle;
mod deadlines;
mod end_positions;
mod environment;
mod exchange;
mod experiment;
mod intake;
mod journal;
mod life_cycle;
mod loading;
mod misses;
mod numerical;
mod opening;
mod operator;
mod order;
mod outcome;
mod owned_test;
mod pace;
mod phase;
mod place;
mod plan;
mod port_columns;
mod ramping;
mod received;
mod received_columns;
mod resumption;
mod rules;
mod running_state;
mod shutdown;
mod stage_times;
mod standing;
mod startup;
mod static_load;
mod step_progress;
mod stepping;
mod stop;
mod supervision;
mod test_hit;
mod test_judge;
mod test_limits;
mod tick;
mod warm_up;
mod wiring_check;

pub use audit::StepAudit;
pub use deadlines::Gaps;
pub use end_positions::{EndPosition, IncompleteShutdown};
pub use experiment::{Experiment, FollowedClock};
pub use gusset_numerics::integrate::Peaks;
pub use intake::Intake;
pub use life_cycle::{Connected, Ready, Retired, Retraced, Stopped};
pub use numerical::{Numerical, Side};
pub use opening::{InitialForce, StartupSettings};
pub use operator::{Control, Notice, Operator, OperatorCommands, Watch};
pub use outcome::{Outcome, PaceOutcome};
pub use phase::{Glimpse, Phase, PhaseCell};
pub use received::{ReceivedCommand, ReceivedSettings, ReceivedTest};
pub use received_columns::{
    Between, ReceivedCounts, ReceivedRow, ReceivedTarget, received_columns,
};
pub use resumption::{EarlierPeaks, Place, Resumption};
pub use rules::{Limits, OnMiss};
pub use stage_times::StageTimes;
pub use static_load::StaticLoad;
pub use step_progress::Pacing;
pub use stop::{Ending, Stop};
pub use test_hit::TestHit;
pub use test_limits::{TestLimits, Worst, kept_limits};
pub use tick::Tick;

pub use gusset_quantity::catalog::phase::{GIVEN_UP, NOT_AWAITED};

use pace::Pace;
use plan::Plan;
