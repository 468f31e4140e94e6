//! HDF5, as every version of its library since 1.8 and MATLAB, Octave, Python, Julia and R read it.
//!
//! `/samples` has a dataset per column that is the same between clocks and repeats, `/timing` those that depend on wall
//! time, each with the attributes `unit` and `meaning`; the file has the attributes `summary`, `test` and `resolved`: the
//! texts of these files. Datasets are contiguous and not compressed, so a reader maps them. Written by `hdf5-pure`: first
//! the groups, then as many datasets at a time as are held in memory.

use std::io;
use std::path::Path;

use hdf5_pure::{
    AttrValue, Error, File, FileAccessProperties, FileBuilder, FileLocking, LibVer, MemoryStrategy,
    SyncPolicy, make_f64_type, make_i64_type,
};

use super::columns::Columns;
use super::plan::{Choice, Source};
use super::{ExportError, Exported, Extra, metadata};
use crate::atomic::AtomicFile;
use crate::run::Run;

/// Writes all columns.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let refused = |error: Error| failed(system(error));
    let (mut columns, exported) = Columns::new(run, choice, &extra.sums)?;
    let mut file = AtomicFile::create(out).map_err(failed)?;
    groups(&columns).finish_to(&mut file).map_err(refused)?;
    // The library opens the file again and locks it itself.
    file.unlock();

    let access = FileAccessProperties::new()
        .with_memory_strategy(MemoryStrategy::Bounded)
        // The file has no name yet that another could know, and it is synced before it gets one.
        .with_locking(FileLocking::BestEffort)
        .with_sync_policy(SyncPolicy::OnClose);
    let opened = File::open_rw_with_options(file.path(), access).map_err(refused)?;
    let root = opened.root();
    for index in 0..columns.plan.columns.len() {
        let values = columns.take(index)?;
        let Some(exposed) = columns.plan.columns.get(index) else {
            break;
        };
        let kind = match exposed.source {
            Source::Sequence => make_i64_type(),
            Source::Place(_) | Source::Sum(_) | Source::Nothing => make_f64_type(),
        };
        let column = &exposed.column;
        let group = if column.timing { "timing" } else { "samples" };
        let rows = columns.rows;
        root.create_dataset(&format!("{group}/{}", column.name), |dataset| {
            dataset
                .with_raw_data(kind, values, rows)
                .set_attr("unit", text(&column.unit))
                .set_attr("meaning", text(&column.meaning));
        })
        .map_err(refused)?;
        if columns.is_last_held(index) {
            opened.commit().map_err(refused)?;
        }
    }
    drop(root);
    opened.close().map_err(refused)?;
    file.commit().map_err(failed)?;
    Ok(exported)
}

/// The file before its first dataset.
fn groups(columns: &Columns) -> FileBuilder {
    let mut file = FileBuilder::new();
    // Superblock 2: MATLAB before R2021b opens no newer one.
    file.with_libver_bounds(LibVer::Earliest, LibVer::V18);
    for (key, value) in metadata(&columns.run) {
        file.set_attr(key, text(&value));
    }
    for name in ["samples", "timing"] {
        let group = file.create_group(name);
        file.add_group(group.finish());
    }
    file
}

/// A string of any length in UTF-8: Python gives it as `str`, and it may exceed the 64 KiB of an attribute itself.
fn text(text: &str) -> AttrValue {
    AttrValue::VarLenString(text.to_owned())
}

/// Error of the operating system, or else of the library.
pub(super) fn system(error: Error) -> io::Error {
    match error {
        Error::Io(error) => error,
        other => io::Error::other(other),
    }
}
