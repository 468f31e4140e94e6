//! Source of the rows: read in blocks, as often as needed, never all at once.

use std::io;

use gusset_record::Column;

/// The part of a test that is in another folder: a resumed test begins after its first step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Earlier {
    /// The folders, with their steps where they are several.
    pub folders: String,
    /// The last step in that folder.
    pub step: u64,
    /// Motion of the ground at the steps from 0 to that one, for each of its columns; empty where it is not known.
    pub grounds: Vec<Vec<f64>>,
}

/// Recorded rows that can be read from the first to the last, more than once.
pub trait Source {
    /// The columns of a row.
    fn columns(&self) -> &[Column];

    /// About how many rows there are.
    fn rows(&self) -> u64;

    /// Test time from step to step in s, if it is known.
    fn step_s(&self) -> Option<f64>;

    /// Ticks in a step.
    fn ticks_per_step(&self) -> u64 {
        1
    }

    /// The part of the test that is in another folder, if any.
    fn earlier(&self) -> Option<&Earlier> {
        None
    }

    /// Numbers from 1 of the specimens whose measured displacement is the command.
    fn without_disp(&self) -> &[u32] {
        &[]
    }

    /// Reads the columns at the places `wanted` from the first row to the last, in blocks of one vector per column, all of one
    /// length.
    ///
    /// # Errors
    /// The rows cannot be read.
    fn read(&self, wanted: &[usize], take: &mut dyn FnMut(&[Vec<f64>])) -> io::Result<()>;
}

/// Rows of a block.
pub const BLOCK: usize = 2048;

/// Rows in memory: one vector per column. Entries beyond the shortest column are omitted.
pub(super) struct Memory<'a> {
    pub columns: &'a [Column],
    pub data: &'a [Vec<f64>],
    pub step_s: Option<f64>,
    pub ticks_per_step: u64,
    pub without_disp: Vec<u32>,
}

impl Source for Memory<'_> {
    fn columns(&self) -> &[Column] {
        &self.columns[..self.columns.len().min(self.data.len())]
    }

    fn rows(&self) -> u64 {
        let named = self.data.iter().take(self.columns.len());
        named.map(Vec::len).min().unwrap_or(0) as u64
    }

    fn step_s(&self) -> Option<f64> {
        self.step_s
    }

    fn ticks_per_step(&self) -> u64 {
        self.ticks_per_step
    }

    fn without_disp(&self) -> &[u32] {
        &self.without_disp
    }

    fn read(&self, wanted: &[usize], take: &mut dyn FnMut(&[Vec<f64>])) -> io::Result<()> {
        let rows = self.rows() as usize;
        for from in (0..rows).step_by(BLOCK) {
            let to = (from + BLOCK).min(rows);
            let block: Vec<Vec<f64>> = wanted
                .iter()
                .map(|&place| self.data[place][from..to].to_vec())
                .collect();
            take(&block);
        }
        Ok(())
    }
}
