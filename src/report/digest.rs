//! What a page needs of the rows, read from them in one pass, or in a few where a test is so long that the columns that are
//! needed whole do not fit into memory together.
//!
//! Invariant: only rows of the running test are physics ([`super::sieve`]), and of them only those are measurements that the specimen
//! answered ([`super::stale`]); those in which it zeroed its sensors
//! (`state` 4) are what noise is known from. What needs steps at even times is not there where some are missing. Nothing here fails
//! but the reading itself.

use std::io;

use super::axes::{AxisDigest, Grid};
use super::first::First;
use super::left::AxisEnd;
use super::shaking::Shaking;
use super::sieve::{Gap, Passed, Sieve, Stretch};
use super::source::{Earlier, Source};
use super::stale::{Stale, status_of};
use super::table::Table;
use super::worst::WorstTick;
use crate::metrics::energy::Model;
use crate::metrics::falsified::Scale;
use crate::metrics::tracking::Noise;
use crate::record::{COMMITS, Column};

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
    /// Columns at the ends of steps, and columns at every tick.
    pub(super) table: Table,
    pub(super) ticks: Table,
    /// Rows of all states.
    pub(super) recorded: u64,
    /// What has passed of the test, and what is missing of it.
    pub(super) passed: Passed,
    /// What of the test stands in another folder; the ground there is among `shaking`.
    pub(super) earlier: Option<Earlier>,
    /// Ticks in a step.
    pub(super) ticks_per_step: u64,
    /// True if steps are known by their numbers.
    pub(super) counted: bool,
    /// Interval of the steps in s; none where they are not at even times.
    pub(super) interval: Option<f64>,
    /// Rows that became two entries of a table; 1 if all are there.
    pub(super) every: usize,
    /// DOFs with a recorded displacement.
    pub(super) dofs: Vec<u32>,
    /// Axes with a recorded force.
    pub(super) all_axes: Vec<SpecimenAxis>,
    pub(super) axes: Vec<AxisDigest>,
    /// Specimens whose measured displacement is the command.
    pub(super) without_disp: Vec<u32>,
    /// Specimens of which some ticks of the test have no measurement, and how many.
    pub(super) stale: Vec<(u32, u64)>,
    /// The last of every axis, and what the way out took.
    pub(super) ends: Vec<AxisEnd>,
    pub(super) shaking: Option<Shaking>,
    /// Amplitude spectra of displacements: DOF, (Hz, m s).
    pub(super) spectra: Vec<(u32, Vec<(f64, f64)>)>,
    /// Energies over time; empty where there is no model.
    pub(super) energy: Table,
    /// What energy errors are measured by; none where there is no model.
    pub(super) scale: Option<Scale>,
    pub(super) worst: Vec<WorstTick>,
    /// Mean displacement of the last part of the test, by DOF.
    pub(super) residuals: Vec<(u32, f64)>,
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
    /// True if it is made of every tick, and not of the ends of steps.
    pub const fn is_of_ticks(self) -> bool {
        matches!(self, Item::Axis(_))
    }

    /// The specimen that it is of.
    const fn specimen(self) -> Option<u32> {
        match self {
            Item::Axis(axis) => Some(axis.specimen),
            Item::Ground | Item::Dof(_) => None,
        }
    }

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

/// Why something is not there that needs rows at even times.
pub(super) const MISSING: &str = "rows are missing in the record, or not at even times";

/// Why there are no tracking metrics of a specimen whose answers hold forces only.
pub(super) const WITHOUT_DISP: &str =
    "no displacement is measured, and the record repeats the command";

impl Digest {
    /// False of an axis whose measured displacement is the command.
    pub(super) fn measures_disp(&self, axis: SpecimenAxis) -> bool {
        !self.without_disp.contains(&axis.specimen)
    }

    /// Axes of which rows are missing or not at even times, so that nothing can be said that needs that.
    pub(super) fn broken(&self) -> impl Iterator<Item = SpecimenAxis> {
        let broken = self.axes.iter().filter(|axis| axis.dt.is_none());
        let is_timed = self.passed.step_s.is_some();
        broken.map(|axis| axis.axis).filter(move |_| is_timed)
    }

    /// Motion of the ground at the steps before the first of the rows; empty where there are none, or it is not known.
    pub(super) fn ground_before(&self) -> &[f64] {
        let first = self.passed.range.map_or(0, |(first, _)| first);
        let known = self.earlier.as_ref().map(|earlier| &earlier.ground);
        let whole = known.filter(|ground| ground.len() as u64 == first);
        whole.map_or(&[], Vec::as_slice)
    }

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
            ticks_per_step: source.ticks_per_step().max(1),
            earlier: source.earlier().cloned(),
            without_disp: source.without_disp().to_vec(),
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
                pass.finish(&mut digest)
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

    fn conclude(&mut self, item: Item, held: &[Table; 2], noise: &[(SpecimenAxis, Option<Noise>)]) {
        let held = &held[usize::from(item.is_of_ticks())];
        let time = held.get("time").unwrap_or_default();
        match item {
            Item::Ground => {
                let ground = held.get("ground").zip(self.interval);
                let unit = held.unit("ground");
                self.shaking = ground.and_then(|(ground, dt)| match self.ground_before() {
                    [] => Shaking::of(ground, unit, dt),
                    before => Shaking::of(&[before, ground].concat(), unit, dt),
                });
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
                let grid = Grid {
                    step_s: self.passed.step_s,
                    ticks_per_step: self.ticks_per_step,
                    is_whole: self.passed.missing_ticks == 0,
                };
                let mut digest = AxisDigest::of(axis, held, time, grid, noise);
                if let (Some(tracking), Some(scale)) = (&mut digest.tracking, self.scale) {
                    tracking.energy_error_share = scale.share(tracking.energy_error_j);
                }
                if !self.measures_disp(axis) {
                    digest.forget_measured_disp();
                }
                self.axes.push(digest);
            }
        }
    }
}

/// Columns that are held whole: at the ends of steps, and at every tick. Where rows are missing stands one without a number.
#[derive(Debug, Clone)]
pub(super) struct Holder {
    /// Their places in a block, and they themselves.
    parts: [(Vec<usize>, Vec<Vec<f64>>); 2],
    time: Option<usize>,
}

impl Holder {
    /// For the columns of `batch`, with time and state; `columns` are those of a block.
    pub fn new(columns: &[Column], batch: &[Item]) -> Self {
        let at = |name: &str| columns.iter().position(|c| c.name == name);
        let places = |of_ticks: bool| {
            let of = batch.iter().filter(|item| item.is_of_ticks() == of_ticks);
            let names = ["time", "state"].map(str::to_owned);
            let names = names.into_iter().chain(of.flat_map(|item| item.columns()));
            let mut places: Vec<usize> = names.filter_map(|name| at(&name)).collect();
            places.sort_unstable();
            places.dedup();
            let held = vec![Vec::new(); places.len()];
            (places, held)
        };
        Self {
            parts: [places(false), places(true)],
            time: at("time"),
        }
    }

    /// Takes a stretch of rows: `kind` 0 for ends of steps, 1 for ticks.
    pub fn take(&mut self, kind: usize, stretch: &Stretch, block: &[Vec<f64>]) {
        let (places, held) = &mut self.parts[kind];
        for (&place, to) in places.iter().zip(held) {
            if let Some(Gap { time, .. }) = stretch.gap {
                to.push(if self.time == Some(place) {
                    time
                } else {
                    f64::NAN
                });
            }
            to.extend(stretch.rows.iter().map(|&row| block[place][row]));
        }
    }

    /// The columns by name.
    pub fn finish(self, columns: &[Column]) -> [Table; 2] {
        self.parts.map(|(places, held)| {
            let names = places.iter().map(|&place| columns[place].clone());
            Table::new(names.zip(held).collect())
        })
    }
}

/// The columns of `batch`, whole.
fn hold(source: &dyn Source, batch: &[Item]) -> io::Result<[Table; 2]> {
    let mut names: Vec<String> = ["state", "step", "time"].map(str::to_owned).into();
    names.extend(batch.iter().flat_map(|item| item.columns()));
    let mut specimens: Vec<u32> = batch.iter().filter_map(|item| item.specimen()).collect();
    specimens.dedup();
    names.extend(specimens.into_iter().map(status_of));
    let place = |name: &String| source.columns().iter().position(|c| c.name == *name);
    let wanted: Vec<usize> = names.iter().filter_map(place).collect();
    let columns: Vec<Column> = wanted
        .iter()
        .map(|&place| source.columns()[place].clone())
        .collect();
    let mut sieve = sieve(source, &columns);
    let mut holder = Holder::new(&columns, batch);
    let stale = Stale::new(&columns);
    source.read(&wanted, &mut |block| {
        let block = &*stale.left_out(block);
        for (kind, stretches) in sieve.sort(block).iter().enumerate() {
            for stretch in stretches {
                holder.take(kind, stretch, block);
            }
        }
    })?;
    Ok(holder.finish(&columns))
}

/// What sorts the rows of `source`, of which blocks have these columns.
pub(super) fn sieve(source: &dyn Source, columns: &[Column]) -> Sieve {
    let at = |name: &str| columns.iter().position(|c| c.name == name);
    let places = ["state", "step", "time"].map(at);
    let is_served = source.columns().iter().any(|c| c.name == COMMITS);
    Sieve::new(places, source.step_s(), source.ticks_per_step()).of_a_server(is_served)
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
