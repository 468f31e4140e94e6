//! A specimen on an EtherCAT bus: the controller's end of the bus, and a simulated bus to test it against.
//!
//! | module | what it does |
//! |---|---|
//! | [`mod@line`] | frames to the devices and back |
//! | [`simulated`] | devices without wires, with a specimen behind them |
//! | [`plan`] | what a test file says about a bus: its devices, their process data, its clock |
//!
//! The codecs and the simulated devices know no socket, clock or thread. A [`plan::BusPlan`] comes from the test file; nothing here
//! reads one. This member must not know the loop, the test file or the run folder. Begin reading with [`plan`].
//!
//! It follows ETG.1000 (data link and application layer) and ETG.6010 (drives). It was never tried on hardware.

mod axis_drive;
mod bring_up;
mod clocks;
mod cycle;
mod drive_setup;
mod error;
mod follow;
pub mod line;
mod pdo;
pub mod plan;
mod port;
mod request;
mod shared;
pub mod simulated;
mod wire;

pub use bring_up::{Found, bring_up, reset_faults, scan};
pub use cycle::Bus;
pub use error::BusError;
pub use follow::{BusTime, FollowingClock};
pub use port::BusPort;
pub use shared::{Keeper, Opener, SharedBus};
