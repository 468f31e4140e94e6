//! The first reading of the rows: everything that needs each of them once.

use super::axis::is_drawable;
use super::axis_end::Ends;
use super::columns::{ERROR, MOST_AXES, MOST_DOFS, MOST_LINES, SpecimenAxis, spread};
use super::digest::Digest;
use super::even::Evenness;
use super::farthest::{FarthestPass, frame};
use super::loop_line::Loop;
use super::row_filter::{RowFilter, Stretch};
use super::source::Source;
use super::stale::Stale;
use super::table::{Table, Thinner};
use super::tested::storeys;
use super::worst::Worst;
use crate::TestFile;
use gusset_motion::metrics::absorbed_energy;
use gusset_motion::metrics::energy::{Balance, Energies, Model};
use gusset_motion::metrics::tracking::Noise;
use gusset_quantity::catalog::column::{self, COMMAND, DISP, Each, FORCE, JUDGED, MEASURED};
use gusset_quantity::catalog::phase::Phase;
use gusset_record::Column;

/// Readings at rest that are kept at most.
const MOST_READINGS: usize = 1 << 17;
/// Products that an energy balance may cost; a larger structure has none.
const MOST_WORK: f64 = 2e10;

/// One energy of a balance.
type EnergyOf = fn(&Energies) -> f64;

/// Columns of the energy balance.
const ENERGIES: [(&str, EnergyOf); 6] = [
    ("input", |now| now.input),
    ("kinetic", |now| now.kinetic),
    ("damping", |now| now.damping),
    ("springs", |now| now.springs),
    ("specimens", |now| now.specimens),
    ("remainder", Energies::remainder),
];

/// The measurements of an axis while the rows pass.
#[derive(Debug)]
pub(super) struct Measured {
    pub axis: SpecimenAxis,
    /// Places of target, measured displacement and force in a block.
    places: [Option<usize>; 3],
    /// Their smallest and largest values in ticks of the test.
    ranges: [Option<(f64, f64)>; 3],
    /// Readings of displacement and force at rest.
    rest: [Vec<f64>; 2],
    /// The last measurement, and the energy into the specimen so far, straight across missing ones.
    before: Option<(f64, f64)>,
    pub absorbed: Option<f64>,
}

impl Measured {
    fn new(axis: SpecimenAxis, at: impl Fn(&str) -> Option<usize>) -> Self {
        Self {
            axis,
            places: ["target", "meas", "force"].map(|kind| at(&axis.column(kind))),
            ranges: [None; 3],
            rest: Default::default(),
            before: None,
            absorbed: None,
        }
    }

    fn values(&self, block: &[Vec<f64>], row: usize) -> [f64; 3] {
        let value = |place: usize| block[place][row];
        self.places.map(|place| place.map_or(f64::NAN, value))
    }

    /// Takes a row at rest.
    fn rests(&mut self, block: &[Vec<f64>], row: usize) {
        let [_, disp, force] = self.values(block, row);
        if self.rest[0].len() < MOST_READINGS {
            self.rest[0].push(disp);
            self.rest[1].push(force);
        }
    }

    /// Takes a tick of the test.
    fn moves(&mut self, block: &[Vec<f64>], row: usize) {
        let values = self.values(block, row);
        for (range, value) in self.ranges.iter_mut().zip(values) {
            if is_drawable(value) {
                let (lo, hi) = range.unwrap_or((value, value));
                *range = Some((value.min(lo), value.max(hi)));
            }
        }
        let [_, disp, force] = values;
        if !(disp.is_finite() && force.is_finite()) {
            return;
        }
        if let Some((disp_before, force_before)) = self.before.replace((disp, force)) {
            let work = absorbed_energy(&[disp_before, disp], &[force_before, force]);
            self.absorbed = work
                .map(|work| self.absorbed.unwrap_or(0.0) + work)
                .or(self.absorbed);
        }
    }

    /// Noise at rest.
    pub(crate) fn noise(&self) -> Option<Noise> {
        Noise::of(&self.rest[0], &self.rest[1])
    }

    /// Empty lines of force over measured displacement, and of measured over target.
    pub(crate) fn loops(&self) -> [Loop; 2] {
        let [target, meas, force] = self.ranges;
        [Loop::new(meas, force), Loop::new(target, meas)]
    }
}

/// True of a column that a limit of an axis is about.
fn is_limited(column: &Column) -> bool {
    let kinds = [&JUDGED, &COMMAND, &MEASURED, &FORCE];
    kinds.iter().any(|kind| kind.fits(&column.name))
}

/// The first reading.
pub(super) struct First<'a> {
    /// Places of the required columns.
    pub wanted: Vec<usize>,
    columns: Vec<Column>,
    /// Places in a block.
    state: Option<usize>,
    step: Option<usize>,
    time: Option<usize>,
    row_filter: RowFilter,
    /// Columns at the ends of steps, and at every tick.
    parts: [Part; 2],
    energy: Option<EnergyPass<'a>>,
    energy_thinner: Thinner,
    worst: Worst,
    farthest: Option<FarthestPass>,
    measured: Vec<Measured>,
    evenness: Evenness,
    /// Places of the columns that a limit is about, and their values farthest from zero.
    largest: Vec<(usize, f64)>,
    ends: Ends,
    stale: Stale,
    recorded: u64,
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
    column.timing
        || kind.is_some_and(|kind| !matches!(kind.each, Each::Test | Each::Dof | Each::Member))
}

struct EnergyPass<'a> {
    balance: Balance<'a>,
    disp: Vec<usize>,
    axes: Vec<(usize, usize)>,
}

impl<'a> First<'a> {
    pub(crate) fn new(
        source: &dyn Source,
        test: &TestFile,
        model: Option<&'a mut dyn Model>,
        digest: &Digest,
    ) -> Self {
        let all = source.columns();
        let combinations = storeys(test);
        // Those that are listed, and those of which histories are drawn.
        let mut listed = spread(&digest.dofs, MOST_DOFS);
        listed.extend(spread(&digest.dofs, MOST_LINES));
        listed.sort_unstable();
        listed.dedup();
        let drawn: Vec<SpecimenAxis> = digest.all_axes.iter().take(MOST_AXES).copied().collect();
        let needs_all = model
            .as_ref()
            .is_some_and(|model| model.dofs() == digest.dofs.len())
            || frame(test).is_some();
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
            let of_axis = kind.axis_in(name).filter(|_| !is_limited(column));
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
        let limited = (0..columns.len()).filter(|&place| is_limited(&columns[place]));
        Self {
            state: at("state"),
            step: at("step"),
            time: at("time"),
            row_filter: RowFilter::of(source, &columns),
            parts,
            energy_thinner: Thinner::new(steps, 7, Some(0)),
            worst: Worst::new(&columns),
            farthest: FarthestPass::new(test, at),
            measured: drawn.iter().map(|axis| Measured::new(*axis, at)).collect(),
            evenness: Evenness::new(),
            largest: limited.map(|place| (place, 0.0)).collect(),
            ends: Ends::new(&drawn, at),
            stale: Stale::new(&columns),
            energy: pass,
            recorded: 0,
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
            self.measured
                .iter_mut()
                .for_each(|one| one.rests(measured, row));
        }
        for (place, most) in &mut self.largest {
            for value in &block[*place] {
                if value.abs() > most.abs() {
                    *most = *value;
                }
            }
        }
        let sorted = self.row_filter.sort(block);
        for (kind, (stretches, block)) in sorted.iter().zip([block, measured]).enumerate() {
            for stretch in stretches {
                self.stretch(kind, stretch, block);
            }
        }
        for stretch in &sorted[1] {
            self.stale.count(stretch, block);
            self.ticks(stretch, measured);
        }
        self.ends.take(measured, self.row_filter.ways());
    }

    /// Takes ticks of the test.
    fn ticks(&mut self, stretch: &Stretch, block: &[Vec<f64>]) {
        if let (Some(gap), Some(_)) = (stretch.gap, self.time) {
            self.evenness.take(gap.time, f64::NAN);
        }
        for &row in &stretch.rows {
            if let Some(time) = self.time {
                let state = self.state.map_or(f64::NAN, |place| block[place][row]);
                self.evenness.take(block[time][row], state);
            }
            self.measured
                .iter_mut()
                .for_each(|one| one.moves(block, row));
        }
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
        if let Some(farthest) = &mut self.farthest {
            farthest.take(block);
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
                    let values = ENERGIES.iter().map(|(_, value)| value(&now));
                    let values = std::iter::once(*time).chain(values);
                    let all = found.iter_mut().zip(values);
                    all.for_each(|(to, value)| to.push(value));
                }
            }
            let slices: Vec<&[f64]> = found.iter().map(Vec::as_slice).collect();
            self.energy_thinner.take(&slices);
        }
    }

    /// The measurements of the axes, and which ticks are at even times.
    pub(crate) fn finish(self, digest: &mut Digest) -> (Vec<Measured>, Evenness) {
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
        digest.farthest = self.farthest.and_then(FarthestPass::finish);
        // A balance with missing steps is not valid.
        let whole = digest.passed.missing_steps == 0;
        let largest = self.largest.iter();
        let largest = largest.map(|(place, most)| (self.columns[*place].name.clone(), *most));
        digest.largest = largest.collect();
        if let Some(energy) = self.energy.filter(|_| whole) {
            digest.scale = Some(energy.balance.scale);
            let column = |name: &str, unit: &str| Column {
                name: name.to_owned(),
                unit: unit.to_owned(),
                meaning: String::new(),
                timing: false,
            };
            let names = ENERGIES.iter().map(|(name, _)| column(name, "J"));
            let columns = std::iter::once(column("time", "s")).chain(names);
            digest.energy = self.energy_thinner.table(columns);
        }
        let [table, ticks] = self.parts.map(|part| part.finish(&self.columns));
        (digest.table, digest.ticks) = (table, ticks);
        (self.measured, self.evenness)
    }
}
