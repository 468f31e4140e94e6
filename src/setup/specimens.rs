//! The specimens of a test file: their rows of B, their laws, and their contributions to K0, C0 and their bounds.

pub(super) mod compensation;
mod entry;
pub(crate) mod loading;
mod rest;
mod stand_in;
mod sums;
mod unwatched;

use super::gear::Rows;
use super::links::wiring_check;
use super::{Estimate, Refused, Site, path, safety};
use entry::entry;
use gusset_actuator::geometry::Geometry;
use gusset_actuator::specimen::{InProcess, InUnits, Specimen};
use gusset_config::check::measured::needing_measured_disp;
use gusset_config::steps::Time;
use gusset_config::{Finding, LinkSpec, Loaded};
use gusset_control::port::limits::AxisLimits;
use gusset_control::port::{
    Axis, AxisSpec, Compensation, Declared, LinearStandIn, LoadingUnitSpec, NeedsMeasuredDisp,
    Order, Port, PortSpec, TrackingSpec, Trend, WaitRules, WiringCheck,
};
use gusset_ethercat::BusPort;
use gusset_link::NativeLink;
use gusset_link::openfresco::Remote;
use gusset_numerics::spectral::delay::Weights;
use gusset_proof::Attached;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::Substructure;

/// One specimen with everything that is known of it, in the structure's units and at its scale.
#[derive(Debug)]
struct Entry {
    name: String,
    stand: Stand,
    axes: Vec<Axis>,
    /// The loading unit whose actuators the axes are.
    loading: Option<LoadingUnitSpec>,
    units: Vec<(f64, f64)>,
    estimate: Estimate,
    /// Whether a damping rule of a frame refers to its stiffness.
    damped: bool,
    /// Mass that the structure carries for the specimen.
    mass: Rows,
    /// Upper bounds of the tangents; the axis (from 0) whose reach is missing otherwise.
    bounds: Result<(Rows, Rows), usize>,
    /// How much of its damping counts in a sawtooth of period 2 steps, in parts of that at the integrator's own velocity.
    sawtooth: f64,
    /// Weights of its commands, as [`gusset_numerics::spectral::delay::Delayed::ticks`].
    ticks: Vec<Weights>,
    mass_in_force: f64,
}

/// True if its position is known before its first command: from the file, or from its far end, as our own protocol and some
/// of OpenFresco's can report it.
fn is_known_to_stand(link: &LinkSpec, axes: usize) -> bool {
    link.stands_at_m.is_some() || link.reports_position(axes) != Some(false)
}

/// The object that represents a specimen.
#[derive(Debug)]
enum Stand {
    Law(Box<dyn Specimen>),
    Native(Box<NativeLink>, WaitRules),
    OpenFresco(Box<Remote>, WaitRules),
    Bus(Box<BusPort>, WaitRules),
    /// In a rehearsal: k̂ and ĉ.
    LinearStandIn,
}

/// All specimens of a test, in order.
#[derive(Debug)]
pub(super) struct Specimens(Vec<Entry>);

/// A specimen that follows the structure exactly.
#[derive(Debug)]
pub(super) struct IdealPort {
    pub axes: Vec<Axis>,
    /// Metres and newtons in one unit of each axis.
    pub units: Vec<(f64, f64)>,
    pub law: IdealLaw,
    pub disp: Vec<f64>,
    pub vel: Vec<f64>,
    pub force: Vec<f64>,
}

/// Behaviour of such a specimen.
#[derive(Debug)]
pub(super) enum IdealLaw {
    /// In SI units, at its own scale.
    Law(Box<dyn Specimen>),
    /// k̂ and ĉ, at the scale of the structure.
    Linear { stiffness: Rows, damping: Rows },
}

/// Reads all specimens.
pub(super) fn specimens(site: &mut Site<'_>) -> Result<Specimens, Refused> {
    let tables = &site.loaded.file.specimen;
    let mut entries = Vec::with_capacity(tables.len());
    for (index, table) in tables.iter().enumerate() {
        entries.push(entry(site, index, table)?);
    }
    Ok(Specimens(entries))
}

/// Order of the interpolation between two targets.
fn order(loaded: &Loaded) -> Order {
    match loaded.file.time.prediction_order {
        1 => Order::Linear,
        2 => Order::Quadratic,
        _ => Order::Cubic,
    }
}

/// When the code of a specimen is to break down; never in a rehearsal.
fn drill(site: &mut Site<'_>, index: usize) -> Result<Option<f64>, Refused> {
    let table = site.loaded.file.specimen.get(index);
    let (Some(drill), None) = (table.and_then(|table| table.drill), site.trial) else {
        return Ok(None);
    };
    let at = path("specimen").index(index).key("drill");
    let (time, end) = (drill.panic_at_s, site.loaded.file.time.duration_s);
    let comes = time <= end;
    if !comes {
        let text = format!("the fault of `drill` is at {time} s, but the test ends at {end} s");
        let at = at.key("panic_at_s");
        return site.refuse(Finding::error(at, text).label("it would not occur"));
    }
    let text = format!("fault injection: at {time} s the code of this specimen fails on purpose");
    site.warnings.push(Finding::warning(at, text).at_key());
    Ok(Some(time))
}

impl Entry {
    /// Bounds of its axes; `gains` are those of S.
    fn declared(&self, gains: Option<&Vec<f64>>) -> Vec<Declared> {
        let bound = |of: fn(&(Rows, Rows)) -> &Rows, axis: usize| {
            let bounds = self.bounds.as_ref();
            let bound = bounds.map_or(f64::NAN, |bounds| of(bounds)[axis][axis]);
            if bound.is_finite() { bound } else { f64::NAN }
        };
        let axes = 0..self.axes.len();
        axes.map(|axis| Declared {
            damping: self.estimate.damping[axis][axis],
            stiffness_bound: bound(|bounds| &bounds.0, axis),
            damping_bound: bound(|bounds| &bounds.1, axis),
            gain: gains
                .and_then(|gains| gains.get(axis))
                .copied()
                .unwrap_or(f64::NAN),
            sawtooth: self.sawtooth,
            step: 0.0,
        })
        .collect()
    }

    /// How the direction of a specimen behind a link is checked: as configured, else by the static load.
    fn direction(
        &self,
        link: &LinkSpec,
        period_s: f64,
        settles: bool,
        accepted: Option<String>,
    ) -> WiringCheck {
        let stiffness: Vec<f64> = self.estimate.stiffness.iter().flatten().copied().collect();
        let gears = self.axes.iter().zip(&self.units);
        let gears = gears.map(|(axis, (unit, _))| axis.disp_gain * unit);
        let estimate = (stiffness.clone(), accepted);
        match wiring_check(link, gears, estimate, period_s, Vec::new()) {
            WiringCheck::Unchecked if settles => {
                WiringCheck::Settling(Trend::new(self.axes.len(), stiffness))
            }
            check => check,
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

    /// The loading unit of each specimen, in order.
    pub(super) fn geometries(&self) -> impl Iterator<Item = Option<&Geometry>> {
        let loading = self.0.iter().map(|entry| entry.loading.as_ref());
        loading.map(|loading| Some(&loading?.geometry))
    }

    /// Each specimen in the structure, in order.
    pub(super) fn attached(&self) -> Vec<Attached> {
        let each = self.0.iter().map(|entry| Attached {
            name: entry.name.clone(),
            rows: entry.axes.iter().map(|axis| axis.row.clone()).collect(),
            stiffness: entry.estimate.stiffness.clone(),
            stiffness_at_rest: entry.estimate.stiffness_at_rest.clone(),
            damping: entry.estimate.damping.clone(),
            damping_at_rest: entry.estimate.damping_at_rest.clone(),
            mass_in_force: entry.mass_in_force,
            ticks: entry.ticks.clone(),
        });
        each.collect()
    }

    /// Estimates that the controller has of each specimen, in order.
    pub(super) fn estimates(self) -> Vec<Estimate> {
        self.0.into_iter().map(|entry| entry.estimate).collect()
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

    /// Every DOF (from 0) that a specimen or its loading unit sees.
    pub(super) fn touched(&self) -> impl Iterator<Item = usize> {
        let axes = self.0.iter().flat_map(|entry| &entry.axes);
        let units = self.0.iter().flat_map(|entry| &entry.loading);
        let rows = axes.map(|axis| &axis.row);
        let rows = rows.chain(units.flat_map(|unit| unit.rows.iter().map(|row| &row.row)));
        rows.flatten().map(|(dof, _)| *dof)
    }

    /// Gives the DOFs of all rows other numbers.
    pub(super) fn renumber(&mut self, new: impl Fn(usize) -> usize) {
        for entry in &mut self.0 {
            let axes = entry.axes.iter_mut().map(|axis| &mut axis.row);
            let units = entry.loading.iter_mut().flat_map(|unit| &mut unit.rows);
            for (dof, _) in axes.chain(units.map(|row| &mut row.row)).flatten() {
                *dof = new(*dof);
            }
        }
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

    /// Specimens without links, commands and sensors, in a structure with this influence vector.
    pub(super) fn into_ideal(self, influence: &[f64]) -> Vec<IdealPort> {
        let each = self.0.into_iter().map(|mut entry| {
            for axis in &mut entry.axes {
                let parts = axis.row.iter();
                axis.base = parts.map(|(dof, b)| b * influence[*dof]).sum();
            }
            let zeros = || vec![0.0; entry.axes.len()];
            IdealPort {
                disp: zeros(),
                vel: zeros(),
                force: zeros(),
                law: match entry.stand {
                    Stand::Law(law) => IdealLaw::Law(law),
                    // A rehearsal has no links.
                    _ => IdealLaw::Linear {
                        stiffness: entry.estimate.stiffness,
                        damping: entry.estimate.damping,
                    },
                },
                axes: entry.axes,
                units: entry.units,
            }
        });
        each.collect()
    }

    /// Everything that the port of each specimen is built from.
    pub(super) fn into_specs(
        self,
        site: &mut Site<'_>,
        dofs: usize,
        settles: bool,
        gains: Vec<Vec<f64>>,
    ) -> Result<Vec<PortSpec>, Refused> {
        let influence = influence(site, dofs);
        let each = self.0.into_iter().enumerate();
        let each = each.map(|(index, mut entry)| {
            entry.move_base(&influence);
            let wiring = entry.wiring(site, index, settles);
            let is_simulated = matches!(entry.stand, Stand::Law(_));
            let declared = entry.declared(gains.get(index));
            let spec = entry.into_spec(site, (index, dofs), wiring, declared)?;
            follow(spec, site, (index, is_simulated))
        });
        each.collect()
    }
}

/// The influence vector of the structure; empty without one.
fn influence(site: &Site<'_>, dofs: usize) -> Vec<f64> {
    let Some(structure) = &site.loaded.file.structure else {
        return Vec::new();
    };
    let given = structure.kind().and_then(|(_, spec)| spec.influence());
    let given = given.unwrap_or_else(|| vec![1.0; site.dofs_of_file(dofs)]);
    match &site.reduced {
        Some(one) => one.reduction.kept().iter().map(|dof| given[*dof]).collect(),
        None => given,
    }
}

impl Entry {
    /// The part of a base displacement that no deformation sees.
    fn move_base(&mut self, influence: &[f64]) {
        let iota = |dof: usize| influence.get(dof).copied().unwrap_or(0.0);
        let base = |row: &[(usize, f64)]| row.iter().map(|&(dof, b)| b * iota(dof)).sum();
        for axis in &mut self.axes {
            axis.base = base(&axis.row);
        }
        for row in self
            .loading
            .iter_mut()
            .flat_map(|loading| &mut loading.rows)
        {
            row.base = base(&row.row);
        }
    }

    /// How its wiring is checked.
    fn wiring(&self, site: &Site<'_>, index: usize, settles: bool) -> WiringCheck {
        let table = site.loaded.file.specimen.get(index);
        let Some(link) = table.and_then(|table| table.link.as_ref()) else {
            return WiringCheck::Known;
        };
        let accepted = site.loaded.file.safety.accept_wiring.clone();
        self.direction(link, site.loaded.time.period.value(), settles, accepted)
    }

    /// Axes, limits, link and exits of a port in a structure of `dofs` degrees of freedom.
    fn into_spec(
        self,
        site: &mut Site<'_>,
        (index, dofs): (usize, usize),
        wiring: WiringCheck,
        declared: Vec<Declared>,
    ) -> Result<PortSpec, Refused> {
        let n = self.axes.len();
        let diagonal: Vec<f64> = (0..n)
            .map(|axis| self.estimate.stiffness[axis][axis])
            .collect();
        let metres: Vec<f64> = self.units.iter().map(|unit| unit.0).collect();
        let (substructure, wait): (Box<dyn Substructure>, _) = match self.stand {
            Stand::Law(law) => {
                let computed = InProcess::new(InUnits::around(law, &self.units));
                match drill(site, index)? {
                    Some(time) => (Box::new(computed.breaking_at(time)), None),
                    None => (Box::new(computed), None),
                }
            }
            Stand::Native(native, rules) => (native, Some(rules)),
            Stand::OpenFresco(remote, rules) => (remote, Some(rules)),
            Stand::Bus(port, rules) => (port, Some(rules)),
            Stand::LinearStandIn => {
                let (axes, stiffness) = (self.axes.clone(), self.estimate.stiffness.clone());
                (
                    Box::new(LinearStandIn::new(axes, stiffness, self.estimate.damping)),
                    None,
                )
            }
        };
        let exits = safety::exits(site, index, &metres, &diagonal)?;
        safety::warn_of_force(
            site,
            index,
            &self.axes,
            &self.units,
            &self.estimate.stiffness,
        );
        let table = &site.loaded.file.specimen[index];
        let limits = table.limits_of(n);
        unwatched::unwatched(site, index, &limits, &declared);
        let references = safety::references(table, n).into_iter();
        let each = self.axes.into_iter().zip(diagonal).zip(self.units);
        let each = each.zip(limits.iter().zip(references).zip(declared));
        let axes = each.map(
            |(((axis, stiffness), units), ((limits, reference), declared))| {
                // `divergence_m` is of the structure, whose scale may be another.
                let limits = AxisLimits::of(limits);
                AxisSpec {
                    axis,
                    stiffness,
                    units,
                    limits,
                    reference,
                    declared,
                }
            },
        );
        let time = site.loaded.time;
        let link = table.link.as_ref();
        let per_step = link.is_some_and(LinkSpec::is_per_step);
        let at = path("specimen").index(index);
        let needs = needing_measured_disp(table, &at).into_iter();
        let of_the_test = site.loaded.file.safety.needing_measured_disp();
        Ok(PortSpec {
            coupling: self.estimate.stiffness,
            loading_unit: self.loading,
            dt: time.step.value(),
            tick: time.period.value(),
            step: Some(time.period.value() * ticks_per_command(&time, per_step)),
            per_step,
            order: order(site.loaded),
            wait,
            wiring,
            is_computed: link.is_some_and(|link| link.computed),
            needs_measured_disp: NeedsMeasuredDisp {
                own: needs.map(|(place, _)| place.to_string()).collect(),
                of_the_test: of_the_test
                    .map(|key| path("safety").key(key).to_string())
                    .collect(),
            },
            exits,
            stands_at_m: link.and_then(|link| link.stands_at_m.clone()),
            ..PortSpec::new(self.name, substructure, dofs.max(1), axes.collect())
        })
    }
}

/// Ticks from command to command in the running test.
fn ticks_per_command(time: &Time, per_step: bool) -> f64 {
    f64::from(if per_step { time.ticks_per_step } else { 1 })
}

/// Adds how the commands of specimen `index` make up for the lag of its actuators, which may be simulated, and how that is seen.
fn follow(
    mut spec: PortSpec,
    site: &mut Site<'_>,
    (index, is_simulated): (usize, bool),
) -> Result<PortSpec, Refused> {
    let time = site.loaded.time;
    let ticks = ticks_per_command(&time, spec.per_step);
    let tick = time.period.value() * ticks;
    let passes = compensation::test_time(time) * ticks;
    let axes = spec.axes.len();
    let compensators = compensation::compensators(site, index, axes, tick)?;
    let file = &site.loaded.file;
    let table = &file.specimen[index];
    let known = table.transfer_in_the_loop(1.0, time.period.value());
    spec.compensation = compensators.map(|compensators| Compensation {
        compensators,
        tick,
        pace: passes / tick,
        delay_in_test_time: is_simulated && known.is_some(),
        base_moves: file.excitation.base_displacement.is_some(),
    });
    if compensation::is_tracked(file, table, axes) {
        let noise = known.map(|known| known.disp_sensor.noise_rms(compensation::test_time(time)));
        spec.tracking = Some(TrackingSpec {
            dt: passes,
            age: compensation::velocity_age(file),
            noise_m: noise,
            critical: Vec::new(),
        });
    }
    Ok(spec)
}

/// The port of each specimen.
pub(super) fn build(site: &mut Site<'_>, specs: Vec<PortSpec>) -> Result<Vec<Port>, Refused> {
    let mut ports = Vec::with_capacity(specs.len());
    for (index, spec) in specs.into_iter().enumerate() {
        let at = path("specimen").index(index);
        let port = spec.build();
        let mut port = port.or_else(|error| site.refuse(Finding::error(at, error.to_string())))?;
        let link = site.loaded.file.specimen[index].link.as_ref();
        let stands = link.is_some_and(|link| is_known_to_stand(link, port.axes()));
        // The stand-in of a specimen without a measured position starts like the specimen itself, from zero
        // deformation: it is not queried.
        if site.trial.is_some() && stands {
            let unbent = port.path().sent().to_vec();
            port.startup_mut().report_position(AtAxis(&unbent));
        }
        ports.push(port);
    }
    Ok(ports)
}
