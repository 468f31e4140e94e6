//! actuator

pub mod compensation;
pub mod geometry;
pub mod specimen;
pub mod transfer;
