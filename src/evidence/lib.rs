//! evidence

pub mod benchmark;
pub mod frontier;
pub mod verify;
