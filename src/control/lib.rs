//! The controller: the specimens as the loop sees them, and the loop.
//!
//! [`port`] joins all that belongs to one specimen: axes, path of the command, exchange, compensation, limits, wiring check and return
//! moves. [`engine`] owns a test from its connection to its end, and has the only loop over ticks. Each maneuver says what differs in
//! it.
//!
//! The thread of the loop allocates nothing, locks nothing, writes no log and never panics. Real and simulated time take the same
//! path, bit for bit. This member knows traits for clock, specimen and recorder. It knows no socket, no page and no reading of files;
//! from `gusset_config` it takes the levels of the limits. Begin reading with [`engine`], whose tick is in `engine/cycle.rs`.

pub mod engine;
pub mod port;
