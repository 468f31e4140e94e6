//! The run folder: its content, replay, reports, exports, and folders of old versions.

#[path = "../common/mod.rs"]
mod common;

mod contents;
#[cfg(feature = "hdf5")]
mod exports;
mod old_runs;
#[cfg(feature = "hdf5")]
mod readers;
mod replay;
mod report;
#[cfg(feature = "hdf5")]
mod trace;
