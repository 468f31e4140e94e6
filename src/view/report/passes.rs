//! The passes over the rows that make a digest: one, or a few where a test is so long that the columns that are needed whole do
//! not fit into memory together. The only failure is that rows cannot be read.

use std::io;

use super::axes::{AxisDigest, Grid};
use super::columns::{Combination, MOST_AXES, MOST_LINES, SpecimenAxis, spread};
use super::digest::Digest;
use super::first::First;
use super::holder::{Item, hold};
use super::shaking::Shaking;
use super::source::Source;
use super::table::Table;
use gusset_motion::metrics::energy::Model;
use gusset_motion::metrics::tracking::Noise;
use gusset_quantity::catalog::column::{COMMAND, DISP, FORCE, JUDGED, MEASURED};
use gusset_record::Column;

/// DOFs of which spectra are made.
const MOST_SPECTRA: usize = MOST_LINES;
/// Bytes of columns that are held whole at a time.
const HELD: u64 = 400 << 20;

/// DOFs with a displacement among `columns`, rising.
fn dofs(columns: &[Column]) -> Vec<u32> {
    let names = columns.iter().map(|c| c.name.as_str());
    let mut dofs: Vec<u32> = names.filter_map(|name| DISP.dof_in(name)).collect();
    dofs.sort_unstable();
    dofs.dedup();
    dofs
}

/// Axes of specimens with a force among `columns`, rising.
fn axes(columns: &[Column]) -> Vec<SpecimenAxis> {
    let parse = |name: &str| {
        let (specimen, axis) = FORCE.axis_in(name)?;
        Some(SpecimenAxis { specimen, axis })
    };
    let mut axes: Vec<_> = columns.iter().filter_map(|c| parse(&c.name)).collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}

/// The farthest value from zero of each column that a limit of an axis is about, by its name.
fn largest(source: &dyn Source) -> io::Result<Vec<(String, f64)>> {
    let columns = source.columns().iter().enumerate();
    let (places, mut largest): (Vec<usize>, Vec<(String, f64)>) = columns
        .filter(|(_, column)| {
            let kinds = [&JUDGED, &COMMAND, &MEASURED, &FORCE];
            kinds.iter().any(|kind| kind.fits(&column.name))
        })
        .map(|(place, column)| (place, (column.name.clone(), 0.0)))
        .unzip();
    if !places.is_empty() {
        source.read(&places, &mut |block| {
            for ((_, most), values) in largest.iter_mut().zip(block) {
                for value in values {
                    if value.abs() > f64::abs(*most) {
                        *most = *value;
                    }
                }
            }
        })?;
    }
    Ok(largest)
}

impl Digest {
    /// Reads `source`; `combinations` are made of its columns, `model` closes the energy balance.
    ///
    /// # Errors
    /// The rows cannot be read.
    pub fn of(
        source: &dyn Source,
        combinations: &[Combination],
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
                let mut pass = First::new(source, combinations, model.take(), &digest, &batch);
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
        digest.largest = largest(source)?;
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
