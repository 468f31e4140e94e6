//! The first pass over the rows: everything that needs each of them once, and the first batch of columns that are held whole.

use super::digest::{
    Difference, Digest, Item, MOST_AXES, MOST_DOFS, RUNNING, SpecimenAxis, ZEROING, spread,
};
use super::source::Source;
use super::specimens::ERROR;
use super::table::{Table, Thinner};
use super::worst::Worst;
use crate::metrics::energy::{Balance, Energies, Model};
use crate::metrics::tracking::Noise;
use crate::record::Column;

/// Readings at rest that are kept at most.
const MOST_READINGS: usize = 1 << 20;
/// Products that an energy balance may cost; a larger structure has none.
const MOST_WORK: f64 = 2e10;

/// An axis at rest: where its measured displacement and force stand in a block, and what was read of them.
struct Read {
    axis: SpecimenAxis,
    places: [usize; 2],
    disp: Vec<f64>,
    force: Vec<f64>,
}

/// The first pass: everything that needs every row once, and the first batch of whole columns.
pub(super) struct First<'a> {
    /// Places of the columns that it wants.
    pub wanted: Vec<usize>,
    columns: Vec<Column>,
    /// Places in a block.
    state: Option<usize>,
    step: Option<usize>,
    time: Option<usize>,
    /// Differences: name and meaning, and the places that they are made of.
    made: Vec<(Column, usize, Option<usize>)>,
    held_places: Vec<usize>,
    held: Vec<Vec<f64>>,
    thinner: Thinner,
    energy: Option<EnergyPass<'a>>,
    energy_thinner: Thinner,
    worst: Worst,
    readings: Vec<Read>,
    recorded: u64,
    running: u64,
    ends: Option<(f64, f64)>,
    last_step: Option<f64>,
    gapless: bool,
    scratch: Vec<Vec<f64>>,
}

struct EnergyPass<'a> {
    balance: Balance<'a>,
    disp: Vec<usize>,
    axes: Vec<(usize, usize)>,
}

impl<'a> First<'a> {
    pub fn new(
        source: &dyn Source,
        differences: &[Difference],
        model: Option<&'a mut dyn Model>,
        digest: &Digest,
        batch: &[Item],
    ) -> Self {
        let all = source.columns();
        let listed = spread(&digest.dofs, MOST_DOFS);
        let drawn: Vec<SpecimenAxis> = digest.all_axes.iter().take(MOST_AXES).copied().collect();
        let needs_all = model
            .as_ref()
            .is_some_and(|model| model.dofs() == digest.dofs.len());
        let is_kept = |column: &Column| {
            let name = column.name.as_str();
            let of_dof = |letter| {
                name.strip_prefix(letter)
                    .and_then(|rest: &str| rest.parse::<u32>().ok())
            };
            if let Some(dof) = of_dof('x').or_else(|| of_dof('v')).or_else(|| of_dof('a')) {
                let is_made_of = differences
                    .iter()
                    .any(|d| d.of == name || d.less.as_deref() == Some(name));
                return listed.contains(&dof) || is_made_of || (needs_all && name.starts_with('x'));
            }
            match name.rsplitn(3, '_').collect::<Vec<_>>()[..] {
                [axis, specimen, _]
                    if axis.parse::<u32>().is_ok() && specimen.parse::<u32>().is_ok() =>
                {
                    drawn
                        .iter()
                        .any(|a| a.axis.to_string() == axis && a.specimen.to_string() == specimen)
                }
                _ => true,
            }
        };
        let wanted: Vec<usize> = (0..all.len())
            .filter(|&place| is_kept(&all[place]))
            .collect();
        let columns: Vec<Column> = wanted.iter().map(|&place| all[place].clone()).collect();
        let at = |name: &str| columns.iter().position(|c| c.name == name);
        let made = differences.iter().filter_map(|d| {
            let of = at(&d.of)?;
            let less = match &d.less {
                Some(name) => Some(at(name)?),
                None => None,
            };
            let column = Column {
                name: d.name.clone(),
                meaning: d.meaning.clone(),
                ..columns.get(of)?.clone()
            };
            Some((column, of, less))
        });
        let errors = drawn.iter().filter_map(|a| {
            let (of, less) = (at(&a.column("meas"))?, at(&a.column("target"))?);
            let column = Column {
                name: a.column(ERROR),
                meaning: "measured − target".to_owned(),
                ..columns.get(of)?.clone()
            };
            Some((column, of, Some(less)))
        });
        let made: Vec<_> = made.chain(errors).collect();
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
        let mut held_names = vec!["time".to_owned()];
        held_names.extend(batch.iter().flat_map(|item| item.columns()));
        let mut held_places: Vec<usize> = held_names.iter().filter_map(|name| at(name)).collect();
        held_places.sort_unstable();
        held_places.dedup();
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
            thinner: Thinner::new(rows, columns.len() + made.len(), at("time")),
            energy_thinner: Thinner::new(rows, 7, Some(0)),
            worst: Worst::new(&columns),
            held: vec![Vec::new(); held_places.len()],
            readings: readings.collect(),
            energy: pass,
            recorded: 0,
            running: 0,
            ends: None,
            last_step: None,
            gapless: true,
            scratch: Vec::new(),
            wanted,
            columns,
            made,
            held_places,
        }
    }

    pub fn take(&mut self, block: &[Vec<f64>]) {
        let rows = block.first().map_or(0, Vec::len);
        self.recorded += rows as u64;
        let state = |row: usize| self.state.map_or(RUNNING, |at| block[at][row]);
        for row in (0..rows).filter(|&row| state(row) == ZEROING) {
            for read in &mut self.readings {
                if read.disp.len() < MOST_READINGS {
                    let [disp, force] = read.places;
                    read.disp.push(block[disp][row]);
                    read.force.push(block[force][row]);
                }
            }
        }
        let is_running = |row: &usize| state(*row) == RUNNING;
        if (0..rows).all(|row| is_running(&row)) {
            let slices: Vec<&[f64]> = block.iter().map(Vec::as_slice).collect();
            self.running_rows(&slices);
        } else {
            let picked: Vec<usize> = (0..rows).filter(is_running).collect();
            if picked.is_empty() {
                return;
            }
            let kept: Vec<Vec<f64>> = block
                .iter()
                .map(|column| picked.iter().map(|&row| column[row]).collect())
                .collect();
            let slices: Vec<&[f64]> = kept.iter().map(Vec::as_slice).collect();
            self.running_rows(&slices);
        }
    }

    fn running_rows(&mut self, block: &[&[f64]]) {
        let rows = block.first().map_or(0, |column| column.len());
        self.running += rows as u64;
        if let Some(steps) = self.step.map(|at| block[at]) {
            for &step in steps {
                if let Some(last) = self.last_step {
                    self.gapless &= step == last || step == last + 1.0;
                }
                self.last_step = Some(step);
            }
        }
        if let Some(time) = self.time.map(|at| block[at])
            && let (Some(first), Some(last)) = (time.first(), time.last())
        {
            self.ends = Some((self.ends.map_or(*first, |ends| ends.0), *last));
        }
        for (held, &place) in self.held.iter_mut().zip(&self.held_places) {
            held.extend_from_slice(block[place]);
        }
        self.scratch.resize(self.made.len(), Vec::new());
        for ((_, of, less), out) in self.made.iter().zip(&mut self.scratch) {
            out.clear();
            match less {
                Some(less) => out.extend(block[*of].iter().zip(block[*less]).map(|(a, b)| a - b)),
                None => out.extend_from_slice(block[*of]),
            }
        }
        let slices: Vec<&[f64]> = block
            .iter()
            .copied()
            .chain(self.scratch.iter().map(Vec::as_slice))
            .collect();
        self.thinner.take(&slices);
        self.worst.take(block);
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

    pub fn noise(&self) -> Vec<(SpecimenAxis, Option<Noise>)> {
        let readings = self.readings.iter();
        readings
            .map(|read| (read.axis, Noise::of(&read.disp, &read.force)))
            .collect()
    }

    pub fn held(&mut self) -> Table {
        let held = std::mem::take(&mut self.held);
        let columns = self
            .held_places
            .iter()
            .map(|&place| self.columns[place].clone());
        Table::new(columns.zip(held).collect())
    }

    pub fn finish(self, digest: &mut Digest) {
        digest.recorded = self.recorded;
        digest.running = self.running;
        digest.gapless = self.last_step.map(|_| self.gapless);
        let span = self.ends.map(|(first, last)| last - first);
        let dt = span.map(|span| span / (self.running.saturating_sub(1) as f64));
        digest.interval = dt.filter(|dt| *dt > 0.0 && dt.is_finite());
        digest.every = self.thinner.every();
        let made = self.made.into_iter().map(|(column, _, _)| column);
        let columns = self.columns.into_iter().chain(made);
        digest.table = Table::new(columns.zip(self.thinner.finish()).collect());
        if let Some(energy) = &self.energy {
            digest.scale = Some(energy.balance.scale());
            let values = self.energy_thinner.finish();
            digest.energy = energy_columns().into_iter().zip(values).collect();
        }
        digest.worst = self.worst.finish();
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
