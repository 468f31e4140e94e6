//! MATLAB's file, version 7.3: `load('run.mat')` in MATLAB, any reader of HDF5 elsewhere.
//!
//! The variables are those of level 5. Written by `hdf5-pure`, which lays the file out first and then requests the columns, one
//! after another. Octave reads the same numbers and gives texts as their codes in UTF-16. SciPy's `loadmat` stops at
//! version 7; Python has `h5py`.

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hdf5_pure::mat::{Block, DataProducer, InvalidNamePolicy, MatBuilder, MatError, Options};

use super::columns::Columns;
use super::hdf5::system;
use super::mat_content::Content;
use super::plan::{Choice, Source};
use super::{ExportError, Exported, Extra};
use crate::atomic::AtomicFile;
use crate::run::Run;

/// Writes all columns.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let (columns, exported) = Columns::new(run, choice, &extra.sums)?;
    let content = Content::of(&columns);
    write(columns, content, exported, out)
}

pub(super) fn write(
    columns: Columns,
    content: Content,
    exported: Exported,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let refused = |error: MatError| {
        failed(match error {
            MatError::Io(error) => error,
            MatError::Hdf5(error) => system(error),
            other => std::io::Error::other(other),
        })
    };
    let sources: Vec<_> = columns
        .plan
        .columns
        .iter()
        .map(|c| c.source.clone())
        .collect();
    // A column beyond the address range does not fit into memory either; reading it reports that.
    let rows = usize::try_from(columns.rows).unwrap_or(usize::MAX);
    let feed = Arc::new(Mutex::new(ColumnFeed {
        columns,
        values: Vec::new(),
        trouble: None,
    }));

    let mut options = Options::default();
    options.invalid_name_policy = InvalidNamePolicy::Sanitize;
    let mut file = MatBuilder::new(options);
    for (index, (name, source)) in content.names.iter().zip(sources).enumerate() {
        let of = Box::new(OfColumn {
            index,
            feed: Arc::clone(&feed),
        });
        match source {
            Source::Sequence => file.write_blocks::<i64>(name, &[rows, 1], of),
            Source::Place(_) | Source::Sum(_) | Source::Nothing => {
                file.write_blocks::<f64>(name, &[rows, 1], of)
            }
        }
        .map_err(refused)?;
    }
    for (name, texts) in &content.structs {
        file.struct_(name, |fields| {
            for (key, text) in texts {
                fields.write_char(key, text)?;
            }
            Ok(())
        })
        .map_err(refused)?;
    }
    file.write_char("summary", &content.summary)
        .map_err(refused)?;

    let mut to = AtomicFile::create(out).map_err(failed)?;
    if let Err(error) = file.finish_to(&mut to) {
        let trouble = lock(&feed).trouble.take();
        return Err(trouble.unwrap_or_else(|| refused(error)));
    }
    to.commit().map_err(failed)?;
    Ok(exported.written_as("MATLAB 7.3"))
}

/// Source of the columns while the file is written.
struct ColumnFeed {
    columns: Columns,
    /// Values of the column that is being written.
    values: Vec<u8>,
    /// Why they are missing.
    trouble: Option<ExportError>,
}

struct OfColumn {
    index: usize,
    feed: Arc<Mutex<ColumnFeed>>,
}

/// One thread writes: the lock never waits, and a poisoned lock does no harm.
fn lock(feed: &Mutex<ColumnFeed>) -> MutexGuard<'_, ColumnFeed> {
    feed.lock().unwrap_or_else(PoisonError::into_inner)
}

impl DataProducer for OfColumn {
    fn block_bytes(&self, block: Block, out: &mut Vec<u8>) -> Result<(), MatError> {
        let mut feed = lock(&self.feed);
        if block.index == 0 {
            feed.values = Vec::new();
            match feed.columns.take(self.index) {
                Ok(values) => feed.values = values,
                Err(trouble) => {
                    feed.trouble = Some(trouble);
                    return Err(MatError::Custom("no samples".to_owned()));
                }
            }
        }
        let from = usize::try_from(8 * block.first_element).unwrap_or(usize::MAX);
        let values = feed.values.get(from..).unwrap_or_default();
        // The library refuses fewer values than it requested.
        out.extend_from_slice(values.get(..block.len()).unwrap_or(values));
        Ok(())
    }
}
