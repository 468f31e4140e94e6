//! A running test as people and programs look at it: the live page, the status on a terminal, the text for Prometheus.
//!
//! ```text
//! loop → ring → writer ─ Tap (present values, peaks, 60 bins a second) → Board ← page, terminal, metrics
//! ```
//!
//! Invariants. The loop does not know of viewers: the writer reads the rows between the ring and the file. The writer never
//! waits for a viewer: it tries the lock of the [`Board`]. A slow viewer skips data; no queue grows without bound. Requests
//! of an operator take the same path as those of `gusset hold RUN_DIR`: the bounded channel that the loop polls once a tick.
//!
//! The loop keeps the limits. The page only shows their levels and the present values, computed as the loop computes them.
//!
//! | file | holds |
//! |---|---|
//! | `subject`, `marks` | the test on the page: names, units, places in a row; limits |
//! | `tap`, `specimen`, `axis`, `latency` | reading the rows: one row, one specimen, one axis, the timing columns |
//! | `trip` | reading the events: why a test has tripped |
//! | `history` | the course of the test, thinned without losing a peak |
//! | `board` | present state, from the writer to the viewers |
//! | `metrics`, `exposition` | metrics for Prometheus, and their text format |
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
pub use marks::{ActuatorEnds, Mark, share};
pub use metrics::metrics;
pub use subject::{
    About, Channel, ChannelKind, GoesOn, LambdaUse, Places, Subject, WatchedAxis, WatchedSpecimen,
};
pub use tap::Tap;
pub use trip::Trip;
