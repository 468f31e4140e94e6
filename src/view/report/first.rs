//! The first pass over the rows: everything that needs each of them once, and the first batch of columns that are held whole.

use std::collections::VecDeque;

use super::axis_end::Ends;
use super::columns::{
    Combination, ERROR, MOST_AXES, MOST_DOFS, MOST_LINES, SpecimenAxis, TAIL, spread,
};
use super::digest::Digest;
use super::holder::{Holder, Item, row_filter};
use super::row_filter::{RowFilter, Stretch};
use super::source::Source;
use super::stale::Stale;
use super::table::{Table, Thinner};
use super::worst::Worst;
use gusset_motion::metrics::energy::{Balance, Energies, Model};
use gusset_motion::metrics::tracking::Noise;
use gusset_quantity::catalog::column::{self, DISP, Each};
use gusset_quantity::catalog::phase::Phase;
use gusset_record::Column;

/// Readings at rest that are kept at most.
const MOST_READINGS: usize = 1 << 20;
/// Products that an energy balance may cost; a larger structure has none.
const MOST_WORK: f64 = 2e10;

/// An axis at rest: the places of its measured displacement and force in a block, and their readings.
struct Read {
    axis: SpecimenAxis,
    places: [usize; 2],
    disp: Vec<f64>,
    force: Vec<f64>,
}

/// The first pass: everything that needs every row once, and the first batch of whole columns.
pub(super) struct First<'a> {
    /// Places of the required columns.
    pub wanted: Vec<usize>,
    columns: Vec<Column>,
    /// Places in a block.
    state: Option<usize>,
    step: Option<usize>,
    time: Option<usize>,
    row_filter: RowFilter,
    holder: Holder,
    /// Columns at the ends of steps, and at every tick.
    parts: [Part; 2],
    energy: Option<EnergyPass<'a>>,
    energy_thinner: Thinner,
    worst: Worst,
    readings: Vec<Read>,
    ends: Ends,
    stale: Stale,
    recorded: u64,
    /// Displacements of the last steps: DOF, place in a block, values; and how many are kept.
    tails: Vec<(u32, usize, VecDeque<f64>)>,
    tail: usize,
}

/// Columns that are kept thinned, side by side.
struct Part {
    /// Their places in a block.
    places: Vec<usize>,
    /// Combinations: name and meaning, and the places that they are made of with their factors.
    made: Vec<(Column, Vec<(usize, f64)>)>,
    thinner: Thinner,
}

impl Part {
    fn new(
        columns: &[Column],
        places: Vec<usize>,
        made: Vec<(Column, Vec<(usize, f64)>)>,
        rows: u64,
    ) -> Self {
        let time = places.iter().position(|&at| columns[at].name == "time");
        Self {
            thinner: Thinner::new(rows, places.len() + made.len(), time),
            places,
            made,
        }
    }

    /// Takes rows: one slice per column of a block.
    fn take(&mut self, block: &[&[f64]]) {
        let made = self.made.iter().map(|(_, terms)| combined(block, terms));
        let made: Vec<Vec<f64>> = made.collect();
        let kept = self.places.iter().map(|&at| block[at]);
        let slices: Vec<&[f64]> = kept.chain(made.iter().map(Vec::as_slice)).collect();
        self.thinner.take(&slices);
    }

    fn finish(self, columns: &[Column]) -> Table {
        let kept = self.places.iter().map(|&at| columns[at].clone());
        let made = self.made.into_iter().map(|(column, _)| column);
        self.thinner.table(kept.chain(made))
    }
}

/// The sum of columns of a block, each with its factor.
fn combined(block: &[&[f64]], terms: &[(usize, f64)]) -> Vec<f64> {
    let Some(((first, factor), rest)) = terms.split_first() else {
        return Vec::new();
    };
    let mut sum: Vec<f64> = block[*first].iter().map(|value| factor * value).collect();
    for (place, factor) in rest {
        let values = sum.iter_mut().zip(block[*place]);
        values.for_each(|(sum, value)| *sum += factor * value);
    }
    sum
}

/// True of a column that is of a specimen or of the loop's own timing: it has something new at every tick.
pub(super) fn is_of_tick(column: &Column) -> bool {
    let kind = column::find(&column.name);
    column.timing || kind.is_some_and(|kind| !matches!(kind.each, Each::Test | Each::Dof))
}

struct EnergyPass<'a> {
    balance: Balance<'a>,
    disp: Vec<usize>,
    axes: Vec<(usize, usize)>,
}

impl<'a> First<'a> {
    pub(crate) fn new(
        source: &dyn Source,
        combinations: &[Combination],
        model: Option<&'a mut dyn Model>,
        digest: &Digest,
        batch: &[Item],
    ) -> Self {
        let all = source.columns();
        // Those that are listed, and those of which histories are drawn.
        let mut listed = spread(&digest.dofs, MOST_DOFS);
        listed.extend(spread(&digest.dofs, MOST_LINES));
        listed.sort_unstable();
        listed.dedup();
        let drawn: Vec<SpecimenAxis> = digest.all_axes.iter().take(MOST_AXES).copied().collect();
        let needs_all = model
            .as_ref()
            .is_some_and(|model| model.dofs() == digest.dofs.len());
        let is_kept = |column: &Column| {
            let name = column.name.as_str();
            let Some(kind) = column::find(name) else {
                return true;
            };
            if let Some(dof) = kind.dof_in(name) {
                let mut terms = combinations.iter().flat_map(|made| &made.terms);
                let is_made_of = terms.any(|(of, _)| of == name);
                return listed.contains(&dof) || is_made_of || (needs_all && DISP.fits(name));
            }
            let of_axis = kind.axis_in(name);
            of_axis.is_none_or(|(specimen, axis)| drawn.contains(&SpecimenAxis { specimen, axis }))
        };
        let wanted: Vec<usize> = (0..all.len())
            .filter(|&place| is_kept(&all[place]))
            .collect();
        let columns: Vec<Column> = wanted.iter().map(|&place| all[place].clone()).collect();
        let at = |name: &str| columns.iter().position(|c| c.name == name);
        let made = combinations.iter().filter_map(|made| {
            let terms = made.terms.iter();
            let terms = terms.map(|(name, factor)| Some((at(name)?, *factor)));
            let column = Column {
                name: made.name.clone(),
                unit: made.unit.to_owned(),
                meaning: made.meaning.clone(),
                timing: false,
            };
            Some((column, terms.collect::<Option<Vec<_>>>()?))
        });
        let errors = drawn.iter().filter_map(|a| {
            let (of, less) = (at(&a.column("meas"))?, at(&a.column("target"))?);
            let column = Column {
                name: a.column(ERROR),
                meaning: "measured − target".to_owned(),
                ..columns.get(of)?.clone()
            };
            Some((column, vec![(of, 1.0), (less, -1.0)]))
        });
        let (drifts, errors): (Vec<_>, Vec<_>) = (made.collect(), errors.collect());
        let rows = source.rows();
        let work = |n: usize| 4.0 * (n * n) as f64 * rows as f64;
        let model = model
            .filter(|model| model.dofs() == digest.dofs.len() && work(model.dofs()) <= MOST_WORK);
        let axis_places = || {
            drawn
                .iter()
                .filter_map(|a| Some((at(&a.column("target"))?, at(&a.column("force"))?)))
        };
        let pass = model
            .filter(|_| drawn.len() == digest.all_axes.len())
            .and_then(|model| {
                let dt = source.step_s();
                let disp = digest
                    .dofs
                    .iter()
                    .map(|dof| at(&format!("x{dof}")))
                    .collect::<Option<Vec<_>>>()?;
                let axes: Vec<_> = axis_places().collect();
                let balance = Balance::new(model, dt?, axes.len());
                Some(EnergyPass {
                    balance,
                    disp,
                    axes,
                })
            });
        let holder = Holder::new(&columns, batch);
        let places = |of_ticks: bool| {
            let all = columns.iter().enumerate();
            let mine = all.filter(move |(_, c)| c.name == "time" || is_of_tick(c) == of_ticks);
            mine.map(|(place, _)| place).collect::<Vec<_>>()
        };
        let steps = rows.div_ceil(source.ticks_per_step().max(1));
        let parts = [
            Part::new(&columns, places(false), drifts, steps),
            Part::new(&columns, places(true), errors, rows),
        ];
        let tails = spread(&digest.dofs, MOST_DOFS);
        let tails: Vec<_> = tails
            .into_iter()
            .filter_map(|dof| Some((dof, at(&format!("x{dof}"))?, VecDeque::new())))
            .collect();
        let readings = drawn.iter().filter_map(|a| {
            Some(Read {
                axis: *a,
                places: [at(&a.column("meas"))?, at(&a.column("force"))?],
                disp: Vec::new(),
                force: Vec::new(),
            })
        });
        Self {
            state: at("state"),
            step: at("step"),
            time: at("time"),
            row_filter: row_filter(source, &columns),
            holder,
            parts,
            energy_thinner: Thinner::new(steps, 7, Some(0)),
            worst: Worst::new(&columns),
            readings: readings.collect(),
            ends: Ends::new(&drawn, at),
            stale: Stale::new(&columns),
            energy: pass,
            recorded: 0,
            tails,
            tail: steps as usize / TAIL + 1,
            wanted,
            columns,
        }
    }

    pub(crate) fn take(&mut self, block: &[Vec<f64>]) {
        let rows = block.first().map_or(0, Vec::len);
        self.recorded += rows as u64;
        // Equilibrium, at the ends of steps, uses the values of the loop; everything else uses measured values.
        let measured = &*self.stale.left_out(block);
        let is_zeroing = |row: &usize| {
            self.state
                .is_some_and(|at| block[at][*row] == Phase::Zeroing.code())
        };
        for row in (0..rows).filter(is_zeroing) {
            for read in &mut self.readings {
                if read.disp.len() < MOST_READINGS {
                    let [disp, force] = read.places;
                    read.disp.push(measured[disp][row]);
                    read.force.push(measured[force][row]);
                }
            }
        }
        let sorted = self.row_filter.sort(block);
        for (kind, (stretches, block)) in sorted.iter().zip([block, measured]).enumerate() {
            for stretch in stretches {
                self.holder.take(kind, stretch, block);
                self.stretch(kind, stretch, block);
            }
        }
        for stretch in &sorted[1] {
            self.stale.count(stretch, block);
        }
        self.ends.take(measured, self.row_filter.ways());
    }

    /// `kind` 0 for ends of steps, 1 for ticks.
    fn stretch(&mut self, kind: usize, stretch: &Stretch, block: &[Vec<f64>]) {
        if let Some(gap) = stretch.gap {
            self.parts[kind].thinner.gap(gap);
        }
        let all = block.first().map_or(0, Vec::len);
        let picked: Vec<Vec<f64>>;
        let slices: Vec<&[f64]> = if stretch.rows.len() == all {
            block.iter().map(Vec::as_slice).collect()
        } else if stretch.rows.is_empty() {
            return;
        } else {
            picked = block.iter().map(|column| stretch.of(column)).collect();
            picked.iter().map(Vec::as_slice).collect()
        };
        self.parts[kind].take(&slices);
        if kind == 0 {
            self.step_rows(&slices);
        } else {
            self.worst.take(&slices);
        }
    }

    fn step_rows(&mut self, block: &[&[f64]]) {
        for (_, place, kept) in &mut self.tails {
            kept.extend(block[*place]);
            let more = kept.len().saturating_sub(self.tail);
            kept.drain(..more);
        }
        if let (Some(energy), Some(step), Some(time)) = (&mut self.energy, self.step, self.time) {
            let mut found: [Vec<f64>; 7] = Default::default();
            for (row, (step, time)) in block[step].iter().zip(block[time]).enumerate() {
                let disp = energy.disp.iter().map(|&at| block[at][row]);
                let axes = energy
                    .axes
                    .iter()
                    .map(|&(d, f)| (block[d][row], block[f][row]));
                if let Some(now) = energy.balance.take(*step as u64, disp, axes) {
                    let values = energies(*time, &now);
                    found
                        .iter_mut()
                        .zip(values)
                        .for_each(|(to, value)| to.push(value));
                }
            }
            let slices: Vec<&[f64]> = found.iter().map(Vec::as_slice).collect();
            self.energy_thinner.take(&slices);
        }
    }

    pub(crate) fn noise(&self) -> Vec<(SpecimenAxis, Option<Noise>)> {
        let readings = self.readings.iter();
        readings
            .map(|read| (read.axis, Noise::of(&read.disp, &read.force)))
            .collect()
    }

    pub(crate) fn finish(self, digest: &mut Digest) -> [Table; 2] {
        digest.recorded = self.recorded;
        digest.ends = self.ends.finish();
        digest.stale = self.stale.found();
        digest.passed = self.row_filter.passed();
        digest.counted = self.step.is_some();
        digest.interval = digest.passed.step_s.filter(|_| digest.passed.is_even);
        digest.every = self.parts[0]
            .thinner
            .every()
            .max(self.parts[1].thinner.every());
        digest.worst = self.worst.finish();
        // A balance with missing steps is not valid.
        let whole = digest.passed.missing_steps == 0;
        let last = digest.passed.steps as usize / TAIL;
        let residuals = self.tails.iter().filter_map(|(dof, _, kept)| {
            let kept: Vec<f64> = kept.iter().copied().collect();
            Some((*dof, gusset_motion::metrics::residual(&kept, last)?))
        });
        digest.residuals = residuals.collect();
        if let Some(energy) = self.energy.filter(|_| whole) {
            digest.scale = Some(energy.balance.scale);
            digest.energy = self.energy_thinner.table(energy_columns());
        }
        let [table, ticks] = self.parts.map(|part| part.finish(&self.columns));
        (digest.table, digest.ticks) = (table, ticks);
        self.holder.finish(&self.columns)
    }
}

fn energies(time: f64, now: &Energies) -> [f64; 7] {
    let Energies {
        input,
        kinetic,
        damping,
        springs,
        specimens,
    } = *now;
    [
        time,
        input,
        kinetic,
        damping,
        springs,
        specimens,
        now.remainder(),
    ]
}

fn energy_columns() -> Vec<Column> {
    let column = |name: &str, unit: &str| Column {
        name: name.to_owned(),
        unit: unit.to_owned(),
        meaning: String::new(),
        timing: false,
    };
    let names = [
        "input",
        "kinetic",
        "damping",
        "springs",
        "specimens",
        "remainder",
    ];
    let of_time = std::iter::once(column("time", "s"));
    of_time.chain(names.map(|name| column(name, "J"))).collect()
}
