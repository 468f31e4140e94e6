//! numerics

pub mod integrate;
pub mod law;
pub mod linalg;
pub mod model;
pub mod spectral;
