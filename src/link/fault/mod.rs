//! Faults of a laboratory: one model of faults, for a simulated link and for a real server.
//!
//! A [`Script`](gusset_config::fault_script::Script) lists faults, counted in commands since arming. A [`FaultyWire`] injects
//! faults into frames in transit. A [`Bench`] injects faults into actuator, specimen and sensors. A `StallingClock` stalls the
//! controller's loop. Neither opens a socket or reads a real clock. Two runs of one script are identical: random numbers begin
//! with its seed. This module does not decide how a controller should react.

mod bench;
mod dice;
mod queue;
#[cfg(any(test, feature = "test-doubles"))]
mod stall;
mod wire;

pub(crate) use bench::Bench;
pub(crate) use queue::Queue;
#[cfg(any(test, feature = "test-doubles"))]
pub use stall::StallingClock;
pub(crate) use wire::FaultyWire;
