//! The virtual laboratory: the real loop, link, far end, records and replay on simulated time, with every fault of a laboratory, by
//! script and at random.

#![allow(clippy::disallowed_macros, reason = "a long run tells its counts")]

mod actuators;
mod allowance;
mod campaign;
mod held;
mod interrupted;
mod invariants;
mod lab;
mod recovered;
mod rig;
mod scripts;
