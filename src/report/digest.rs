//! What a page needs of the rows, read from them in one pass, or in a few where a test is so long that the columns that are
//! needed whole do not fit into memory together.
//!
//! Invariant: only rows in which the test was running (`state` 3) are physics; those in which it zeroed its sensors
//! (`state` 4) are what noise is known from. Nothing here fails but the reading itself.

use std::io;

use super::axes::AxisDigest;
use super::first::First;
use super::shaking::Shaking;
use super::source::Source;
use super::table::Table;
use super::worst::WorstTick;
use crate::metrics::energy::Model;
use crate::metrics::falsified::Scale;
use crate::metrics::tracking::Noise;
use crate::record::Column;

/// State of a row in which the test runs, and in which it zeroes its sensors.
pub(super) const RUNNING: f64 = 3.0;
pub(super) const ZEROING: f64 = 4.0;
/// DOFs of which columns are kept.
pub(super) const MOST_DOFS: usize = 24;
/// Axes that are judged.
pub(super) const MOST_AXES: usize = 40;
/// DOFs of which spectra are made.
const MOST_SPECTRA: usize = 4;
/// Bytes of columns that are held whole at a time.
const HELD: u64 = 400 << 20;

/// One axis of one specimen, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SpecimenAxis {
    pub specimen: u32,
    pub axis: u32,
}

impl SpecimenAxis {
    /// Name of a column of this axis: "force" gives "force_1_1".
    pub fn column(self, kind: &str) -> String {
        format!("{kind}_{}_{}", self.specimen, self.axis)
    }
}

/// A column that is the difference of two: a storey drift.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Its name.
    pub name: String,
    /// What it means.
    pub meaning: String,
    /// Name of the column that counts.
    pub of: String,
    /// Name of the one that is taken off; none for zero.
    pub less: Option<String>,
}

/// Everything a page needs of the rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Digest {
    pub(super) table: Table,
    /// Rows of all states, and those in which the test was running.
    pub(super) recorded: u64,
    pub(super) running: u64,
    /// True if no step is missing between the first and the last; none without a column of steps.
    pub(super) gapless: Option<bool>,
    /// Mean interval of the running rows in s.
    pub(super) interval: Option<f64>,
    /// Rows that became two entries of the table; 1 if all are there.
    pub(super) every: usize,
    /// DOFs with a recorded displacement.
    pub(super) dofs: Vec<u32>,
    /// Axes with a recorded force.
    pub(super) all_axes: Vec<SpecimenAxis>,
    pub(super) axes: Vec<AxisDigest>,
    pub(super) shaking: Option<Shaking>,
    /// Amplitude spectra of displacements: DOF, (Hz, m s).
    pub(super) spectra: Vec<(u32, Vec<(f64, f64)>)>,
    /// Energies over time; empty where there is no model.
    pub(super) energy: Vec<(Column, Vec<f64>)>,
    /// What energy errors are measured by; none where there is no model.
    pub(super) scale: Option<Scale>,
    pub(super) worst: Vec<WorstTick>,
}

/// DOFs with a displacement among `columns`, rising.
fn dofs(columns: &[Column]) -> Vec<u32> {
    let names = columns.iter().map(|c| c.name.as_str());
    let mut dofs: Vec<u32> = names
        .filter_map(|name| name.strip_prefix('x')?.parse().ok())
        .collect();
    dofs.sort_unstable();
    dofs.dedup();
    dofs
}

/// Axes of specimens with a force among `columns`, rising.
fn axes(columns: &[Column]) -> Vec<SpecimenAxis> {
    let parse = |name: &str| {
        let (specimen, axis) = name.strip_prefix("force_")?.split_once('_')?;
        Some(SpecimenAxis {
            specimen: specimen.parse().ok()?,
            axis: axis.parse().ok()?,
        })
    };
    let mut axes: Vec<_> = columns.iter().filter_map(|c| parse(&c.name)).collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}

/// `most` entries of `list`, spread evenly, first and last among them.
pub(super) fn spread(list: &[u32], most: usize) -> Vec<u32> {
    if list.len() <= most {
        return list.to_vec();
    }
    (0..most)
        .filter_map(|i| list.get(i * (list.len() - 1) / (most - 1)).copied())
        .collect()
}

/// What is to be made of columns that are held whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Item {
    Ground,
    Dof(u32),
    Axis(SpecimenAxis),
}

impl Item {
    /// Names of the columns that it is made of.
    pub fn columns(self) -> Vec<String> {
        match self {
            Item::Ground => vec!["ground".to_owned()],
            Item::Dof(dof) => vec![format!("x{dof}")],
            Item::Axis(axis) => ["target", "meas", "force"]
                .map(|kind| axis.column(kind))
                .into(),
        }
    }
}

impl Digest {
    /// Reads `source`; `differences` are made of its columns, `model` closes the energy balance.
    ///
    /// # Errors
    /// The rows cannot be read.
    pub fn of(
        source: &dyn Source,
        differences: &[Difference],
        model: Option<&mut dyn Model>,
    ) -> io::Result<Self> {
        let columns = source.columns();
        let (dofs, all_axes) = (dofs(columns), axes(columns));
        let judged = all_axes.iter().take(MOST_AXES);
        let mut items: Vec<Item> = judged.map(|axis| Item::Axis(*axis)).collect();
        items.extend(spread(&dofs, MOST_SPECTRA).into_iter().map(Item::Dof));
        items.push(Item::Ground);
        let room = (HELD / (8 * source.rows().max(1))) as usize;
        let mut digest = Self {
            dofs,
            all_axes,
            ..Self::default()
        };
        let mut noise: Vec<(SpecimenAxis, Option<Noise>)> = Vec::new();
        let mut model = model;
        let mut first = true;
        while first || !items.is_empty() {
            // At least one item a pass, and time.
            let mut taken = 0;
            let mut width = 1;
            while let Some(item) = items.get(taken) {
                width += item.columns().len();
                if taken > 0 && width > room {
                    break;
                }
                taken += 1;
            }
            let batch: Vec<Item> = items.drain(..taken).collect();
            let held = if first {
                let mut pass = First::new(source, differences, model.take(), &digest, &batch);
                source.read(&pass.wanted.clone(), &mut |block| pass.take(block))?;
                noise = pass.noise();
                let held = pass.held();
                pass.finish(&mut digest);
                held
            } else {
                hold(source, &batch)?
            };
            for item in batch {
                digest.conclude(item, &held, &noise);
            }
            first = false;
        }
        digest.axes.sort_by_key(|axis| axis.axis);
        Ok(digest)
    }

    fn conclude(&mut self, item: Item, held: &Table, noise: &[(SpecimenAxis, Option<Noise>)]) {
        let time = held.get("time").unwrap_or_default();
        match item {
            Item::Ground => {
                let ground = held.get("ground").zip(self.interval);
                self.shaking =
                    ground.and_then(|(ground, dt)| Shaking::of(ground, held.unit("ground"), dt));
            }
            Item::Dof(dof) => {
                let disp = held.get(&format!("x{dof}")).zip(self.interval);
                self.spectra.extend(
                    disp.and_then(|(x, dt)| super::axes::envelope(x, dt))
                        .map(|s| (dof, s)),
                );
            }
            Item::Axis(axis) => {
                let noise = noise
                    .iter()
                    .find(|(a, _)| *a == axis)
                    .and_then(|(_, noise)| *noise);
                let mut digest = AxisDigest::of(axis, held, time, self.interval, noise);
                if let (Some(tracking), Some(scale)) = (&mut digest.tracking, self.scale) {
                    tracking.energy_error_share = scale.share(tracking.energy_error_j);
                }
                self.axes.push(digest);
            }
        }
    }
}

/// The columns of `batch` and time, whole, in running rows.
fn hold(source: &dyn Source, batch: &[Item]) -> io::Result<Table> {
    let mut names: Vec<String> = vec!["state".to_owned(), "time".to_owned()];
    names.extend(batch.iter().flat_map(|item| item.columns()));
    let found: Vec<(usize, &Column)> = names
        .iter()
        .filter_map(|name| {
            source
                .columns()
                .iter()
                .enumerate()
                .find(|(_, c)| c.name == *name)
        })
        .collect();
    let wanted: Vec<usize> = found.iter().map(|(place, _)| *place).collect();
    let state = found.iter().position(|(_, c)| c.name == "state");
    let mut held: Vec<Vec<f64>> = vec![Vec::new(); found.len()];
    source.read(&wanted, &mut |block| {
        let is_running = |row: usize| state.is_none_or(|at| block[at][row] == RUNNING);
        let rows = block.first().map_or(0, Vec::len);
        if (0..rows).all(is_running) {
            held.iter_mut()
                .zip(block)
                .for_each(|(to, from)| to.extend_from_slice(from));
        } else {
            for (to, from) in held.iter_mut().zip(block) {
                to.extend(
                    from.iter()
                        .enumerate()
                        .filter(|(row, _)| is_running(*row))
                        .map(|(_, v)| *v),
                );
            }
        }
    })?;
    let columns = found.into_iter().map(|(_, column)| column.clone());
    Ok(Table::new(columns.zip(held).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_has_both_ends() {
        let list: Vec<u32> = (1..=100).collect();
        assert_eq!(spread(&list, 4), [1, 34, 67, 100]);
        assert_eq!(spread(&list[..3], 4), [1, 2, 3]);
    }
}
