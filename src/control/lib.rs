//! control

pub mod engine;
pub mod port;
