//! The specimens of a test file: their rows of B, their laws, and what they add to K0, C0 and their bounds.

mod compensation;
pub(in crate::config) mod loading;
mod stand_in;
mod sums;

use nalgebra::DMatrix;

use super::gear::{Rows, axis, scaled};
use super::{Refused, Site, links, path, safety};
use crate::config::{Finding, KeyPath, MatrixValue, SpecimenTable};
use crate::control::limits::LimitsSpec;
use crate::control::{Axis, Believed, Declared, Direction, Order, Pace, Port, Trend, WaitRules};
use crate::law::Reach;
use crate::linalg::SymMatrix;
use crate::link::LinkSpec;
use crate::link::NativeLink;
use crate::link::openfresco::Remote;
use crate::link::spec::{ProbeChoice, Protocol};
use crate::model::StructureSpec;
use crate::specimen::{InProcess, InUnits, Specimen, SpecimenLaw};
use crate::substructure::Substructure;
use loading::{Loading, at_actuators, behind_actuators, loading};

/// One specimen with everything that is known of it, in the structure's units and at its scale.
#[derive(Debug)]
struct Entry {
    name: String,
    stand: Stand,
    axes: Vec<Axis>,
    /// The loading unit whose actuators the axes are.
    loading: Option<Loading>,
    units: Vec<(f64, f64)>,
    /// k̂ and ĉ, by rows.
    stiffness: Rows,
    damping: Rows,
    /// Stiffness before anything moves: k̂ if it was given, else the tangent of the law, which is 0 for an open gap.
    stiffness_at_rest: Rows,
    /// What the structure carries for the specimen.
    mass: Rows,
    /// Upper bounds of the tangents; the axis (from 0) whose reach is missing otherwise.
    bounds: Result<(Rows, Rows), usize>,
    mass_in_force: f64,
}

/// What stands for a specimen.
#[derive(Debug)]
enum Stand {
    Law(Box<dyn Specimen>),
    Native(Box<NativeLink>, WaitRules),
    OpenFresco(Box<Remote>, WaitRules),
    /// In a rehearsal: k̂ and ĉ.
    Believed,
}

/// What one specimen adds to the structure, by rows.
pub(super) struct Loop<'a> {
    pub name: &'a str,
    pub rows: Vec<&'a [(usize, f64)]>,
    pub stiffness: &'a [Vec<f64>],
    pub damping: &'a [Vec<f64>],
    pub mass_in_force: f64,
}

/// All specimens of a test, in order.
#[derive(Debug)]
pub(super) struct Specimens(Vec<Entry>);

/// Reads all specimens.
pub(super) fn specimens(site: &mut Site<'_>) -> Result<Specimens, Refused> {
    let tables = &site.loaded.file.specimen;
    let mut entries = Vec::with_capacity(tables.len());
    for (index, table) in tables.iter().enumerate() {
        entries.push(entry(site, index, table)?);
    }
    Ok(Specimens(entries))
}

fn entry(site: &mut Site<'_>, index: usize, table: &SpecimenTable) -> Result<Entry, Refused> {
    let at = &path("specimen").index(index);
    let drawn = site
        .trial
        .and_then(|trial| trial.specimens.get(index).copied());
    let drawn = drawn.unwrap_or_default();
    let rows = rows(site, at, table)?;
    let (rows, loading) = loading(site, at, table, rows)?;
    let n = rows.len();
    let laws = loading.as_ref().map_or(n, |_| table.law_axes());
    let mut law = match (table.sources().into_iter().next(), &table.link) {
        (Some((key, source)), _) => {
            let law = built(site, at, table, (key, source), laws)?;
            let (at, spec) = (at.key("transfer"), table.transfer.as_ref());
            Some(stand_in::behind_transfer(site, &at, spec, law, &drawn)?)
        }
        (None, Some(_)) => None,
        (None, None) => {
            let text = "nothing stands for the specimen";
            return site.refuse(Finding::error(at.clone(), text));
        }
    };
    let mut axes = Vec::with_capacity(n);
    let mut units = Vec::with_capacity(n);
    let mut reach = Vec::with_capacity(n);
    for (index, row) in rows.into_iter().enumerate() {
        let gear = table.axis.get(index).cloned().unwrap_or_default();
        let (axis, to_si) = axis(table, &gear, row);
        // What the law sees at its own scale when the structure moves as far as is declared.
        let scale = gear.scale / table.similitude.length;
        reach.push(Reach {
            disp: table.reach_disp_m.map(|reach| reach * scale),
            vel: table
                .reach_vel_m_per_s
                .map(|reach| reach * scale * table.similitude.time),
        });
        axes.push(axis);
        units.push(to_si);
    }
    let (mut k, mut c, mut m) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n * n]);
    if let Some(law) = &law {
        law.reference(&mut k, &mut c, &mut m);
    }
    let scaled = |flat: &[f64], motion: fn(&Axis) -> f64| scaled(flat, &axes, &units, motion);
    let stiffness = match &table.stiffness_n_per_m {
        Some(given) => {
            let given = estimate(site, &at.key("stiffness_n_per_m"), given, laws)?;
            seen(table, &loading, given)
        }
        None => scaled(&k, |axis| axis.disp_gain),
    };
    let damping = match &table.damping_n_s_per_m {
        Some(given) => {
            let given = estimate(site, &at.key("damping_n_s_per_m"), given, laws)?;
            seen(table, &loading, given)
        }
        None => scaled(&c, |axis| axis.vel_gain),
    };
    let mut mass = scaled(&m, |axis| axis.vel_gain * axis.vel_gain / axis.disp_gain);
    let mut mass_in_force = table.mass_in_force_kg;
    if site.trial.is_some_and(|trial| trial.ideal) {
        for (axis, row) in mass.iter_mut().enumerate() {
            row[axis] += mass_in_force;
        }
        mass_in_force = 0.0;
    }
    let stiffness_at_rest = match (&table.stiffness_n_per_m, &mut law) {
        (None, Some(law)) => {
            let (still, mut force) = (vec![0.0; n], vec![0.0; n]);
            law.trial(&still, &still, 0.0, &mut force);
            law.tangent(&mut k);
            law.revert();
            scaled(&k, |axis| axis.disp_gain)
        }
        (Some(_), _) | (None, None) => stiffness.clone(),
    };
    let bounds = match &law {
        Some(law) => law.bound(&reach, &mut k, &mut c).map(|()| {
            (
                scaled(&k, |axis| axis.disp_gain),
                scaled(&c, |axis| axis.vel_gain),
            )
        }),
        None => {
            let ratio = table.hardening_bound.unwrap_or(1.0);
            let times = |row: &Vec<f64>| row.iter().map(|value| ratio * value).collect();
            Ok((stiffness.iter().map(times).collect(), damping.clone()))
        }
    };
    let stand_in = match &table.stand_in {
        Some(source) => Some(built(site, at, table, ("stand_in", source), laws)?),
        None => None,
    };
    let stand = match (law, &table.link) {
        (Some(law), _) => Stand::Law(law),
        (None, Some(_)) if site.trial.is_some() => {
            let known = stand_in::Known {
                table,
                axes: &axes,
                units: &units,
                stiffness: &stiffness,
                damping: &damping,
            };
            stand_in::stand_in(site, at, &known, stand_in, &drawn)?
        }
        (None, Some(link)) if link.protocol == Protocol::Gusset => {
            let (native, rules) = links::native(site, at, table, link, n)?;
            Stand::Native(Box::new(native), rules)
        }
        (None, Some(link)) => {
            let (remote, rules) = links::openfresco(site, at, link, n)?;
            Stand::OpenFresco(Box::new(remote), rules)
        }
        // Refused above.
        (None, None) => return Err(Refused),
    };
    Ok(Entry {
        name: table.name.clone(),
        stand,
        axes,
        loading,
        units,
        stiffness,
        damping,
        stiffness_at_rest,
        mass,
        bounds,
        mass_in_force,
    })
}

/// A law for so many axes, at the platform of its actuators if it stands there.
fn built(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
    (key, source): (&str, &SpecimenLaw),
    laws: usize,
) -> Result<Box<dyn Specimen>, Refused> {
    let law = match source.build(laws) {
        Ok(law) => law,
        Err(error) => return site.refuse_key(&at.key(key), error.key(), &error),
    };
    match behind_actuators(table, law) {
        Ok(law) => Ok(law),
        Err(error) => site.refuse_key(&at.key("geometry"), error.key(), &error),
    }
}

/// An estimate as the axes see it.
fn seen(table: &SpecimenTable, loading: &Option<Loading>, estimate: Rows) -> Rows {
    match loading {
        Some(loading) => at_actuators(table, &loading.geometry, estimate),
        None => estimate,
    }
}

/// Rows of B: of a storey, given, or one without any entry for a test without a structure.
fn rows(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
) -> Result<Vec<Vec<(usize, f64)>>, Refused> {
    let kinds = site
        .loaded
        .file
        .structure
        .as_ref()
        .map(|structure| structure.kinds());
    let spec: Option<&StructureSpec> = kinds.and_then(|kinds| kinds.first().map(|kind| kind.1));
    match (table.storey, &table.rows, spec) {
        (Some(storey), _, Some(spec)) => match spec.storey_row(storey) {
            Ok(row) => Ok(vec![row]),
            Err(error) => {
                let finding = Finding::error(at.key("storey"), error.to_string());
                site.refuse(finding.label("no such storey"))
            }
        },
        (None, Some(rows), _) => {
            let sparse = |row: &Vec<f64>| {
                let entries = row.iter().copied().enumerate();
                entries.filter(|(_, entry)| *entry != 0.0).collect()
            };
            Ok(rows.iter().map(sparse).collect())
        }
        // Without a structure there is nothing to transform: as many axes as the laws or the axis tables say.
        (_, _, None) => Ok(vec![Vec::new(); table.axes_by_itself()]),
        (None, None, Some(_)) => {
            let text = "which deformation does the specimen see: `storey` or `rows`";
            site.refuse(Finding::error(at.clone(), text))
        }
    }
}

fn estimate(
    site: &mut Site<'_>,
    at: &KeyPath,
    given: &MatrixValue,
    n: usize,
) -> Result<Rows, Refused> {
    let rows = given.rows();
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        let text = format!("the estimate is not {n} × {n}, one row and column per axis");
        return site.refuse(Finding::error(at.clone(), text));
    }
    let matrix = DMatrix::from_fn(n, n, |i, j| rows[i][j]);
    match SymMatrix::from_dense(&matrix) {
        Ok(_) => Ok(rows),
        Err(error) => site.refuse(Finding::error(at.clone(), error.to_string())),
    }
}

impl Entry {
    /// What its axes are watched against; `gains` are those of S.
    fn declared(&self, gains: Option<&Vec<f64>>) -> Vec<Declared> {
        let bound = |of: fn(&(Rows, Rows)) -> &Rows, axis: usize| {
            let bounds = self.bounds.as_ref();
            let bound = bounds.map_or(f64::NAN, |bounds| of(bounds)[axis][axis]);
            if bound.is_finite() { bound } else { f64::NAN }
        };
        let axes = 0..self.axes.len();
        axes.map(|axis| Declared {
            damping: self.damping[axis][axis],
            stiffness_bound: bound(|bounds| &bounds.0, axis),
            damping_bound: bound(|bounds| &bounds.1, axis),
            gain: gains
                .and_then(|gains| gains.get(axis))
                .copied()
                .unwrap_or(f64::NAN),
            step: 0.0,
        })
        .collect()
    }

    /// How the direction of a specimen behind a link is found out: as the file says, else by the static load.
    fn direction(&self, link: &LinkSpec, period_s: f64, settles: bool) -> Direction {
        match (link.probe_m, link.probe) {
            (Some(metres), _) => {
                let gears = self.axes.iter().zip(&self.units);
                let way = gears.map(|(axis, (unit, _))| metres / (axis.disp_gain * unit).abs());
                Direction::Probe {
                    amplitude: way.collect(),
                    pace: Pace::of(link.probe_ramp_s, period_s),
                }
            }
            (None, Some(ProbeChoice::None)) => Direction::Known,
            (None, None) if settles => {
                let stiffness = self.stiffness.iter().flatten().copied().collect();
                Direction::Settling(Trend::new(self.axes.len(), stiffness))
            }
            (None, None) => Direction::Unchecked,
        }
    }
}

impl Specimens {
    /// True if no specimen closes the loop.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Names, in order.
    pub(super) fn names(&self) -> Vec<String> {
        self.0.iter().map(|entry| entry.name.clone()).collect()
    }

    /// Name and number of deformations that can be prescribed, in order: axes, or coordinates of the platform.
    pub(super) fn axes(&self) -> impl Iterator<Item = (&str, usize)> {
        self.0.iter().map(|entry| {
            let loading = entry.loading.as_ref();
            let driven = loading.map_or(entry.axes.len(), |loading| loading.rows.len());
            (entry.name.as_str(), driven)
        })
    }

    /// Name, rows of B, k̂ and ĉ of every specimen.
    pub(super) fn loops(&self) -> impl Iterator<Item = Loop<'_>> {
        self.0.iter().map(|entry| Loop {
            name: &entry.name,
            rows: entry.axes.iter().map(|axis| axis.row.as_slice()).collect(),
            stiffness: &entry.stiffness,
            damping: &entry.damping,
            mass_in_force: entry.mass_in_force,
        })
    }

    /// Every DOF (from 0) that a specimen sees.
    pub(super) fn dofs(&self) -> Vec<usize> {
        let rows = self
            .0
            .iter()
            .flat_map(|entry| &entry.axes)
            .flat_map(|axis| &axis.row);
        rows.map(|(dof, _)| *dof).collect()
    }

    /// Rows of B that reach beyond the structure are refused.
    pub(super) fn check_rows(&self, site: &mut Site<'_>, dofs: usize) -> Result<(), Refused> {
        let tables = site.loaded.file.specimen.iter().enumerate();
        for (index, table) in tables {
            let at = path("specimen").index(index).key("rows");
            for (row, entries) in table.rows.iter().flatten().enumerate() {
                if entries.len() != dofs {
                    let found = entries.len();
                    let text = format!(
                        "row {} of B has {found} entries, but the structure has {dofs} DOFs",
                        row + 1
                    );
                    return site.refuse(Finding::error(at.index(row), text));
                }
            }
        }
        Ok(())
    }

    /// One port per specimen.
    pub(super) fn into_ports(
        self,
        site: &mut Site<'_>,
        dofs: usize,
        settles: bool,
        gains: Vec<Vec<f64>>,
    ) -> Result<Vec<Port>, Refused> {
        let influence = match &site.loaded.file.structure {
            Some(structure) => structure
                .matrices
                .as_ref()
                .and_then(|spec| match spec {
                    StructureSpec::Matrices(matrices) => matrices.influence.clone(),
                    _ => None,
                })
                .unwrap_or_else(|| vec![1.0; dofs]),
            None => Vec::new(),
        };
        let mut ports = Vec::with_capacity(self.0.len());
        for (index, mut entry) in self.0.into_iter().enumerate() {
            let iota = |dof: usize| influence.get(dof).copied().unwrap_or(0.0);
            let base = |row: &[(usize, f64)]| row.iter().map(|&(dof, b)| b * iota(dof)).sum();
            for axis in &mut entry.axes {
                axis.base = base(&axis.row);
            }
            for row in entry.loading.iter_mut().flat_map(|l| &mut l.rows) {
                row.base = base(&row.row);
            }
            let diagonal = (0..entry.axes.len())
                .map(|i| entry.stiffness[i][i])
                .collect();
            let declared = entry.declared(gains.get(index));
            let stiffness = entry.stiffness.clone();
            let link = site.loaded.file.specimen.get(index);
            let direction = match link.and_then(|table| table.link.as_ref()) {
                Some(link) => entry.direction(link, site.loaded.time.period.value(), settles),
                None => Direction::Known,
            };
            let (substructure, wait): (Box<dyn Substructure>, _) = match entry.stand {
                Stand::Law(law) => (
                    Box::new(InProcess::new(InUnits::new(law, &entry.units))),
                    None,
                ),
                Stand::Native(native, rules) => (native, Some(rules)),
                Stand::OpenFresco(remote, rules) => (remote, Some(rules)),
                Stand::Believed => {
                    let axes = entry.axes.clone();
                    (
                        Box::new(Believed::new(axes, entry.stiffness, entry.damping)),
                        None,
                    )
                }
            };
            let metres: Vec<f64> = entry.units.iter().map(|unit| unit.0).collect();
            let exits = safety::exits(site, index, &metres)?;
            let axes = entry.axes.len();
            match Port::new(entry.name, entry.axes, substructure, dofs.max(1), diagonal) {
                Ok(port) => {
                    let table = &site.loaded.file.specimen[index];
                    let specs = table.limits_of(axes);
                    let limits = specs.iter().map(LimitsSpec::limits).collect();
                    let time = site.loaded.time;
                    let per_step = table.link.as_ref().is_some_and(links::is_per_step);
                    let ticks = if per_step { time.ticks_per_step } else { 1 };
                    let tick = time.period.value() * f64::from(ticks);
                    let order = match site.loaded.file.time.prediction_order {
                        1 => Order::Linear,
                        2 => Order::Quadratic,
                        _ => Order::Cubic,
                    };
                    let mut port = port
                        .with_limits(limits, entry.units, tick)
                        .with_pace(per_step, order)
                        .with_references(safety::references(table, axes))
                        .with_declared(&declared, &stiffness, time.step.value());
                    let passes = compensation::test_time(time) * f64::from(ticks);
                    if let Some(compensators) = compensation::compensators(site, index, axes, tick)?
                    {
                        let pace = passes / tick;
                        port = port.with_compensation(compensators, metres, tick, pace);
                    }
                    if compensation::is_tracked(&site.loaded.file, table, axes) {
                        port = port.with_tracking(passes);
                    }
                    if let Some(Loading { geometry, rows }) = entry.loading {
                        port = port.with_geometry(geometry, rows);
                    }
                    port.wait = wait;
                    port.direction = direction;
                    port.exits = exits;
                    ports.push(port);
                }
                Err(error) => {
                    let at = path("specimen").index(index);
                    return site.refuse(Finding::error(at, error.to_string()));
                }
            }
        }
        Ok(ports)
    }
}
