//! Loading units, actuators, compensators and computed specimens, as values: from a command to the force of a specimen.
//!
//! [`geometry`] turns the pose of a loading unit into the strokes of its actuators, and back. [`transfer`] simulates delay, actuator,
//! limits and sensors. [`compensation`] computes commands that make up for the lag of an actuator. [`specimen`] holds the specimens
//! that are computed in the process, with their laws.
//!
//! Every part with a state gives it to a visitor, so that a test can be interrupted and resumed. A tick allocates nothing here. This
//! member knows no clock of the machine, no file, no socket and no limit. Begin reading with [`transfer`].

pub mod compensation;
pub mod geometry;
pub mod specimen;
pub mod transfer;
