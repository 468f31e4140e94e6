//! The run folder: its content, replay, reports, exports, and folders of old versions.

#[path = "../common/mod.rs"]
mod common;

mod contents;
#[cfg(all(feature = "hdf5", feature = "mcap", feature = "parquet"))]
mod exports;
mod old_runs;
#[cfg(all(feature = "hdf5", feature = "mcap", feature = "parquet"))]
mod readers;
mod replay;
mod report;
#[cfg(all(feature = "hdf5", feature = "mcap", feature = "parquet"))]
mod trace;
