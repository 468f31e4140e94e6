//! What goes wrong in a laboratory: one model of faults, for a simulated link and for a real server.
//!
//! A [`Script`](gusset_config::fault_script::Script) says what happens, counted in commands since arming. A [`FaultyWire`] plays what happens to frames on
//! their way, a [`Bench`] what happens to actuator, specimen and sensors, a `StallingClock` what happens to the
//! controller's loop. Neither opens a socket or reads a clock of its own. Two plays of one script are the same: chance
//! begins with its seed. What a controller should make of it is not decided here.

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
