//! What a specimen may be told, what it may answer, and which way round it is wired.
//!
//! Pure judgement on numbers, in the units of a specimen's own axes: nothing is sent, stopped or recorded here. Who
//! commands a specimen (the loop, or a gateway) asks before each command and after each measurement, and acts on the
//! answer. A limit that is not set is not checked, but a number that is not finite is always a breach.

mod guard;
mod limits;
mod probe;
mod stiffness;

pub use guard::{Breach, Guard, Kind};
pub use limits::{AxisUnits, Levels, LimitsError, LimitsSpec};
pub use probe::{Channel, Found, Misfit, Pace, Probe};
pub use stiffness::{Opinion, compare_stiffness};
