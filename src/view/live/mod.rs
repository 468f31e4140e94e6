//! A running test as people and programs look at it: the live page, the status on a terminal, the text for Prometheus.
//!
//! ```text
//! loop → ring → writer ─ Tap (present values, peaks, 60 bins a second) → Board ← page, terminal, metrics
//! ```
//!
//! Invariants. The loop does not know that it is watched: rows are looked at where they leave the ring for the file anyway.
//! The writer never waits for a looker: the [`Board`] is tried, not waited for. Every looker takes what it can and
//! skips the rest; nothing queues without bound. Requests of an operator go the same way as those of
//! `gusset hold RUN_DIR`: through the bounded channel that the loop polls once a tick.
//!
//! What it does not do: judge. Limits are kept by the loop; here their levels and the present values are only shown, reckoned as
//! the loop does it.
//!
//! | file | holds |
//! |---|---|
//! | `subject`, `marks` | what is watched: names, units, places in a row; limits |
//! | `tap`, `specimen`, `axis`, `latency` | the look at the rows: one row, one specimen, one axis, the timing columns |
//! | `trip` | the look at the events: why a test has tripped |
//! | `history` | the course of the test, thinned without losing a peak |
//! | `board` | where the writer puts up what he sees |
//! | `metrics`, `exposition` | what Prometheus is told, and the form of that text |
//! | `page` (feature `monitor`) | the live page: server, viewers, operators |

mod axis;
mod board;
mod exposition;
mod history;
mod latency;
mod marks;
mod metrics;
#[cfg(feature = "monitor")]
pub mod page;
mod specimen;
mod subject;
mod tap;
mod trip;

pub use board::{AxisView, Board, Ended, Margin, Snapshot, SpecimenView};
pub use history::{Bin, History};
pub use latency::{BOUNDS as LATENCY_BOUNDS, LatencyView};
pub use marks::{ActuatorEnds, Mark, TestMark, share};
pub use metrics::metrics;
pub use subject::{
    About, Channel, ChannelKind, GoesOn, LambdaUse, Places, Subject, WatchedAxis, WatchedSpecimen,
};
pub use tap::Tap;
pub use trip::Trip;
