//! The columns of a run, whole, one after another.
//!
//! The log holds rows, and the libraries of the other formats want columns. The log is read once to count the rows that
//! are sound and wanted, then once for every [`MEMORY`] of columns, at least one at a time: memory grows with the run only
//! where a single column is longer than that. No temporary file is made. The values are the bits of the log,
//! little-endian, eight bytes each.

use std::io;
use std::ops::Range;

use super::plan::{Choice, Exposed, Plan, Source, Sum};
use super::{ExportError, Exported};
use crate::run::Run;

/// Bytes of columns that are held at once, if one column is not longer already.
const MEMORY: u64 = 256 << 20;
/// Bytes of rows that are turned at once: small enough for a cache, every column's share still long enough that the copy
/// does not count.
const BLOCK: usize = 1 << 20;

/// The chosen rows of a run as columns.
pub(super) struct Columns {
    pub run: Run,
    pub plan: Plan,
    choice: Choice,
    pub rows: u64,
    memory: u64,
    /// Columns whose values are held.
    held: Range<usize>,
    /// Their values; those that were taken are empty.
    values: Vec<Vec<u8>>,
}

impl Columns {
    /// Counts the rows. A running test adds rows later; the export takes only those counted.
    pub(crate) fn new(
        run: &Run,
        choice: &Choice,
        sums: &[Sum],
    ) -> Result<(Self, Exported), ExportError> {
        Self::within(run, choice, sums, MEMORY)
    }

    /// The columns within another bound of memory.
    pub(crate) fn within(
        run: &Run,
        choice: &Choice,
        sums: &[Sum],
        memory: u64,
    ) -> Result<(Self, Exported), ExportError> {
        let plan = Plan::new(run.layout(), sums)?;
        let mut counting = run.journal()?;
        let rows = plan
            .walk(&mut counting, choice, u64::MAX, |_, _| Ok(()))
            .map_err(|trouble| trouble.told(ExportError::Read))?;
        let exported = Exported::new(run, rows, &counting).of_table(&plan);
        let columns = Self {
            run: run.clone(),
            plan,
            choice: *choice,
            rows,
            memory,
            held: 0..0,
            values: Vec::new(),
        };
        Ok((columns, exported))
    }

    /// A text file of the run folder; empty if it does not exist or is not text.
    pub(crate) fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.run.path().join(name)).unwrap_or_default()
    }

    /// Whether nothing is held behind this column: the next one is read from the log.
    #[cfg(feature = "hdf5")]
    pub(crate) const fn is_last_held(&self, index: usize) -> bool {
        index + 1 >= self.held.end
    }

    /// The values of a column. Each is given once; requests in order read the log least often.
    pub(crate) fn take(&mut self, index: usize) -> Result<Vec<u8>, ExportError> {
        if !self.held.contains(&index) {
            self.read(index)?;
        }
        let held = self.values.get_mut(index - self.held.start);
        Ok(held.map(std::mem::take).unwrap_or_default())
    }

    /// Reads columns from this one on, as many as memory may hold.
    fn read(&mut self, first: usize) -> Result<(), ExportError> {
        self.values.clear();
        let bytes = 8 * self.rows;
        let fitting = usize::try_from(self.memory / bytes.max(8)).unwrap_or(usize::MAX);
        let chosen = self.plan.columns.get(first..).unwrap_or_default();
        let chosen = chosen.get(..fitting.max(1)).unwrap_or(chosen);
        for _ in chosen {
            let mut whole = Vec::new();
            usize::try_from(bytes)
                .ok()
                .and_then(|bytes| whole.try_reserve_exact(bytes).ok())
                .ok_or(ExportError::Memory { bytes })?;
            self.values.push(whole);
        }
        let mut block = Block::new(chosen, BLOCK, self.rows);
        let values = &mut self.values;
        let mut collect = |block: &mut Block| {
            for (whole, share) in values.iter_mut().zip(block.shares()) {
                whole.extend_from_slice(share);
            }
            block.clear();
        };
        let mut journal = self.run.journal()?;
        let rows = self
            .plan
            .walk(&mut journal, &self.choice, self.rows, |sequence, row| {
                block.push(sequence, row);
                if block.is_full() {
                    collect(&mut block);
                }
                Ok(())
            })
            .map_err(|trouble| trouble.told(ExportError::Read))?;
        collect(&mut block);
        if rows != self.rows {
            let changed = "they have become fewer while they were read";
            return Err(ExportError::Read(io::Error::other(changed)));
        }
        self.held = first..first + chosen.len();
        Ok(())
    }
}

/// Some rows, transposed: the values of a column lie together, little-endian.
struct Block {
    sources: Vec<Source>,
    bytes: Vec<u8>,
    depth: usize,
    rows: usize,
}

impl Block {
    /// A block of about `size` bytes, but at least 16 rows deep and not deeper than `rows`.
    fn new(columns: &[Exposed], size: usize, rows: u64) -> Self {
        let sources: Vec<Source> = columns.iter().map(|c| c.source.clone()).collect();
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

    const fn is_full(&self) -> bool {
        self.rows == self.depth
    }

    const fn clear(&mut self) {
        self.rows = 0;
    }

    /// Takes a row; one too many is left out, so look whether it is full.
    fn push(&mut self, sequence: u64, row: &[f64]) {
        let (slots, _) = self.bytes.as_chunks_mut::<8>();
        let at = self.rows;
        for (column, source) in slots.chunks_exact_mut(self.depth).zip(&self.sources) {
            let bits = match source {
                Source::Sequence => sequence,
                Source::Place(_) | Source::Sum(_) | Source::Nothing => source.value(row).to_bits(),
            };
            if let Some(slot) = column.get_mut(at) {
                *slot = bits.to_le_bytes();
            }
        }
        self.rows = (self.rows + 1).min(self.depth);
    }

    /// The bytes of each column.
    fn shares(&self) -> impl Iterator<Item = &[u8]> {
        let held = 8 * self.rows;
        self.bytes
            .chunks_exact(8 * self.depth)
            .map(move |column| column.get(..held).unwrap_or_default())
    }
}
