//! Columns that stand one after another in a file, each at a place known before the first row is read.
//!
//! The log is read twice: once to count the rows that are sound and wanted, once to turn them. Turned are some
//! megabytes at a time, each column's share then goes to its place, so memory does not grow with the run and no
//! temporary file is made. A format says where everything stands ([`Columnar`]); the values are the bits of the log.

use std::io;
use std::path::Path;

use crc32fast::Hasher;

use super::plan::{Choice, Exposed, Plan, Source};
use super::{ExportError, Exported};
use crate::record::atomic::AtomicFile;
use crate::record::run::Run;

/// Bytes that are turned at once: every column's share is still long enough that the call does not count.
const BLOCK: usize = 8 << 20;

/// What a format lays out.
pub(super) struct Table<'a> {
    pub run: &'a Run,
    pub plan: &'a Plan,
    /// Rows of every column.
    pub rows: u64,
}

impl Table<'_> {
    pub fn columns(&self) -> &[Exposed] {
        self.plan.columns()
    }

    /// A text file of the run folder; empty if there is none or it is not text.
    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.run.path().join(name)).unwrap_or_default()
    }

    /// Refuses what one column of the format cannot hold.
    pub fn at_most(&self, limit: u64, format: &'static str) -> Result<(), ExportError> {
        if self.rows <= limit {
            return Ok(());
        }
        Err(ExportError::TooLong {
            format,
            rows: self.rows,
            limit,
        })
    }
}

/// Bytes and where they stand.
pub(super) type Piece = (u64, Vec<u8>);

/// A file without its columns.
pub(super) struct Skeleton {
    /// All but the columns.
    pub pieces: Vec<Piece>,
    /// Where the first value of each column stands; eight bytes a value.
    pub places: Vec<u64>,
    /// Length of the file.
    pub length: u64,
    /// One per column if the format has checksums, begun over what stands before the values; else none.
    pub checksums: Vec<Hasher>,
}

/// A format of columns side by side.
pub(super) trait Columnar: Sized {
    /// Where everything stands.
    fn lay_out(table: &Table<'_>) -> Result<(Self, Skeleton), ExportError>;

    /// What can be written only now.
    fn close(self, _checksums: &[u32]) -> Vec<Piece> {
        Vec::new()
    }
}

/// Writes a run in a format of columns side by side.
pub(super) fn export<F: Columnar>(
    run: &Run,
    choice: &Choice,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    let plan = Plan::new(run.layout())?;
    let mut counting = run.journal()?;
    let rows = plan
        .walk(&mut counting, choice, u64::MAX, |_, _| Ok(()))
        .map_err(|trouble| trouble.told(failed))?;
    let exported = Exported::new(run, rows, &counting);
    let table = Table {
        run,
        plan: &plan,
        rows,
    };
    let (format, skeleton) = F::lay_out(&table)?;

    let file = AtomicFile::create(out).map_err(failed)?;
    file.set_len(skeleton.length).map_err(failed)?;
    let put = |(place, bytes): &Piece| file.write_all_at(bytes, *place);
    skeleton.pieces.iter().try_for_each(put).map_err(failed)?;
    let mut sums = skeleton.checksums;
    let mut block = Block::new(plan.columns(), BLOCK, rows);
    let mut done = 0;
    let mut flush = |block: &mut Block, done: &mut u64| {
        for (index, (bytes, place)) in block.shares().zip(&skeleton.places).enumerate() {
            if let Some(sum) = sums.get_mut(index) {
                sum.update(bytes);
            }
            file.write_all_at(bytes, place + 8 * *done)?;
        }
        *done += block.rows() as u64;
        block.clear();
        io::Result::Ok(())
    };
    // A run that goes on has more rows by now: those that were counted are taken.
    plan.walk(&mut run.journal()?, choice, rows, |sequence, row| {
        block.push(sequence, row);
        if block.is_full() {
            flush(&mut block, &mut done)?;
        }
        Ok(())
    })
    .map_err(|trouble| trouble.told(failed))?;
    flush(&mut block, &mut done).map_err(failed)?;
    if done != rows {
        let changed = "they have become fewer while they were read";
        return Err(ExportError::Read(io::Error::other(changed)));
    }
    let sums: Vec<u32> = sums.into_iter().map(Hasher::finalize).collect();
    let put = |(place, bytes): &Piece| file.write_all_at(bytes, *place);
    format
        .close(&sums)
        .iter()
        .try_for_each(put)
        .map_err(failed)?;
    file.commit().map_err(failed)?;
    Ok(exported)
}

/// Some rows, turned: the values of a column stand together, little-endian.
pub(super) struct Block {
    sources: Vec<Source>,
    bytes: Vec<u8>,
    depth: usize,
    rows: usize,
}

impl Block {
    /// Of about so many bytes, but at least 16 rows deep and not deeper than `rows`.
    pub fn new(columns: &[Exposed], size: usize, rows: u64) -> Self {
        let sources: Vec<Source> = columns.iter().map(|exposed| exposed.source).collect();
        let fitting = (size / (8 * sources.len().max(1))).max(16);
        let depth = usize::try_from(rows).map_or(fitting, |rows| fitting.min(rows.max(1)));
        // An odd depth: columns a power of two apart would fight for the same lines of the cache.
        let depth = depth | 1;
        Self {
            bytes: vec![0; 8 * depth * sources.len()],
            sources,
            depth,
            rows: 0,
        }
    }

    pub const fn rows(&self) -> usize {
        self.rows
    }

    pub const fn is_full(&self) -> bool {
        self.rows == self.depth
    }

    pub const fn clear(&mut self) {
        self.rows = 0;
    }

    /// Takes a row; one too many is left out, so look whether it is full.
    pub fn push(&mut self, sequence: u64, row: &[f64]) {
        let (slots, _) = self.bytes.as_chunks_mut::<8>();
        let at = self.rows;
        for (column, source) in slots.chunks_exact_mut(self.depth).zip(&self.sources) {
            let bits = match source {
                Source::Place(place) => row.get(*place).copied().unwrap_or(f64::NAN).to_bits(),
                Source::Sequence => sequence,
                Source::Nothing => f64::NAN.to_bits(),
            };
            if let Some(slot) = column.get_mut(at) {
                *slot = bits.to_le_bytes();
            }
        }
        self.rows = (self.rows + 1).min(self.depth);
    }

    /// The bytes of each column.
    pub fn shares(&self) -> impl Iterator<Item = &[u8]> {
        let held = 8 * self.rows;
        self.bytes
            .chunks_exact(8 * self.depth)
            .map(move |column| column.get(..held).unwrap_or_default())
    }
}
