//! A specimen on an EtherCAT bus: the controller's end of the bus, and a simulated bus to test it against.
//!
//! | module | what it does |
//! |---|---|
//! | [`mapping`] | entries of process data: their text in a test file, their bytes in a frame |
//! | [`plan`] | what a test file says about a bus: its devices, their process data, its clock |
//!
//! The codecs and the simulated devices know no socket, clock or thread. A [`plan::BusPlan`] comes from the test file; nothing here
//! reads one. This member must not know the loop, the test file or the run folder. Begin reading with [`plan`].
//!
//! It follows ETG.1000 (data link and application layer) and ETG.6010 (drives). It was never tried on hardware.

pub mod plan;

pub use gusset_wire::process_data as mapping;
