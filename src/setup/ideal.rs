//! A test with ideal specimens in one system of equations: no actuator, no sensor, no compensation, no path between two steps.
//!
//! This system is the reference for the errors of method and actuators. Its specimens are their laws, the declared stand-ins
//! or linear ones, and they receive the velocities of the test. Nothing here is on the real-time path.

use std::cell::{Cell, RefCell};
use std::sync::Arc;

use super::gear::scaled;
use super::reduced::Reduced;
use super::specimens::{IdealLaw, IdealPort};
use super::{Initial, Refused, Site, Trial, excitation, method, proof, site, specimens, structure};
use gusset_config::{ConfigError, LambdaValue, Loaded};
use gusset_control::port::Axis;
use gusset_motion::Excitation;
use gusset_numerics::integrate::{
    Forces, Lambda, Massless, MethodError, Moment, Newmark, NewmarkBeta, NewtonSettings, State,
    Stepper, Tangents,
};
use gusset_numerics::linalg::{Spd, SymMatrix};
use gusset_numerics::model::{Base, Motion, Structure};
use gusset_quantity::frame::AtStructure;
use gusset_reduction::Reduction;

/// Parts in which a static load is applied.
const PARTS: u32 = 20;
/// Newton iterations for each part.
const ITERATIONS: u32 = 60;
/// Change of the displacement, relative to the largest, at which a part is in equilibrium.
const SETTLED: f64 = 1e-10;
/// Change of the displacement at which a step of the reference is in equilibrium: far below the errors.
const CONVERGED: f64 = 1e-8;
/// DOFs that an evaluation of the forces counts at least.
const LEAST_DOFS: u64 = 16;
/// Operations of a factorization that cost as much as the forces at one DOF.
const OPERATIONS: u64 = 64;
/// Evaluations of the forces in a step of the reference, where everything is linear.
const EVALUATIONS: u64 = 3;

/// Structure, load and specimens, in virgin state.
#[derive(Debug)]
pub struct Ideal {
    system: System,
    damping: SymMatrix,
    stiffness: SymMatrix,
    state: State,
    load: Option<Vec<f64>>,
    reduced: Option<Reduced>,
    stepper: Stepper,
    dt: f64,
}

/// Everything that has forces.
#[derive(Debug)]
struct System {
    structure: Structure,
    excitation: Excitation,
    specimens: Vec<IdealPort>,
    /// Steps of the method in one step of the test.
    divider: u64,
    spare: Vec<f64>,
    /// Work so far, in DOFs whose forces were evaluated.
    work: Cell<u64>,
    /// The tangents of specimens that were assembled last, and the whole. Most of them stay the same from step to step.
    assembled: RefCell<Option<(Vec<f64>, Tangents)>>,
}

/// Why a course could not be computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoCourse {
    /// A step or the static load has no equilibrium that the iteration finds.
    NoEquilibrium,
    /// The response is no finite number any more.
    Diverged,
    /// It takes more work than is allowed.
    BeyondBudget,
}

/// Course of a test: displacements of all DOFs, step after step.
#[derive(Debug, Clone, Default)]
pub struct IdealCourse {
    /// DOFs.
    pub dofs: usize,
    /// In m or rad, at the steps of the test from t = 0.
    pub disp: Vec<f64>,
}

/// The test with ideal specimens and the λ with which it runs.
///
/// # Errors
/// As [`super::build`].
pub fn build_ideal(loaded: &Loaded, lambda: Option<f64>) -> Result<Ideal, ConfigError> {
    let mut ideal = loaded.clone();
    for table in &mut ideal.file.specimen {
        table.transfer = None;
        table.identified = None;
        table.compensation = None;
        if table.geometry.take().is_some() {
            // The rows give the coordinates of the platform, and the law acts there.
            table.axis.clear();
        }
    }
    match lambda {
        Some(f64::INFINITY) => ideal.file.integrator.lambda = LambdaValue::Infinite,
        Some(value) => ideal.file.integrator.lambda = LambdaValue::Number(value),
        None => {}
    }
    let trial = Trial {
        ideal: true,
        at_test_speed: true,
        ..Trial::default()
    };
    site::build(&ideal, Some(&trial), None, assemble)
}

fn assemble(site: &mut Site<'_>) -> Result<Ideal, Refused> {
    let mut specimens = specimens::specimens(site)?;
    let mut structure = structure::structure(site, &mut specimens)?;
    let n = structure.dofs();
    let dt = site.loaded.time.step.value();
    let stiffness = structure
        .reference_stiffness()
        .plus(1.0, &specimens.stiffness(n));
    let (damping, _) = proof::damping(site, &structure, &mut specimens, &stiffness);
    let initial = Initial {
        damping: &damping,
        stiffness: &stiffness,
        dt,
    };
    let stepper = match method::companion(site, &structure, &initial)? {
        Some((stepper, _)) => stepper,
        None => {
            let lambda = match site.loaded.file.integrator.lambda {
                LambdaValue::Number(value) => Lambda::new(value).unwrap_or(Lambda::Infinite),
                _ => Lambda::Infinite,
            };
            let massless = proof::massless(site, &structure, &specimens, dt)?;
            method::family(site, &structure, &initial, lambda, massless)?.0
        }
    };
    let (excitation, loads) = excitation::excitation(site, &structure, &specimens, &stiffness)?;
    let at_rest = structure
        .stiffness_at_rest()
        .plus(1.0, &specimens.stiffness_at_rest(n));
    let state = structure::initial_state(site, &mut structure, &at_rest)?;
    let specimens = specimens.into_ideal(structure.influence());
    Ok(Ideal {
        system: System {
            structure,
            excitation,
            specimens,
            divider: 1,
            spare: vec![0.0; n],
            work: Cell::new(0),
            assembled: RefCell::new(None),
        },
        damping,
        stiffness,
        state,
        load: loads.map(|[_, load]| load),
        reduced: site.reduced.take(),
        stepper,
        dt,
    })
}

impl Ideal {
    /// Degrees of freedom.
    #[must_use]
    pub fn dofs(&self) -> usize {
        self.system.structure.dofs()
    }

    /// Displacement at t = 0 in m or rad, from the position under the static load.
    #[must_use]
    pub fn initial(&self) -> &[f64] {
        &self.state.disp
    }

    /// The reduction of its structure, and its degrees of freedom in words; none without it.
    #[must_use]
    pub fn reduction(&self) -> Option<(Arc<Reduction>, Vec<String>)> {
        let reduced = self.reduced.as_ref()?;
        Some((Arc::clone(&reduced.reduction), reduced.places()))
    }

    /// ι of the structure.
    #[must_use]
    pub fn influence(&self) -> &[f64] {
        self.system.structure.influence()
    }

    /// Least work of one step by the method and of `divided` steps by the reference, in DOFs whose forces are evaluated.
    #[must_use]
    pub fn work(&self, divided: u64) -> u64 {
        (1 + divided * EVALUATIONS) * self.system.dofs_of_forces()
    }

    /// Its loads and the motion of its base.
    #[must_use]
    pub const fn excitation(&self) -> &Excitation {
        &self.system.excitation
    }

    /// Rows of B of each specimen.
    #[must_use]
    pub fn rows(&self) -> Vec<Vec<Vec<(usize, f64)>>> {
        let specimens = self.system.specimens.iter();
        specimens
            .map(|port| port.axes.iter().map(|axis| axis.row.clone()).collect())
            .collect()
    }

    /// The course by the method of the test.
    ///
    /// # Errors
    /// See [`NoCourse`].
    pub fn by_method(mut self) -> Result<IdealCourse, NoCourse> {
        if let Stepper::Explicit(explicit) = &self.stepper {
            explicit.integrator.prepare(&mut self.state);
        }
        self.go(u64::MAX)
    }

    /// The course by Newmark's average acceleration with iteration, at `divider` steps in a step of the test. `most` bounds the
    /// [work](Self::work).
    ///
    /// # Errors
    /// See [`NoCourse`].
    pub fn by_newmark(mut self, divider: u64, most: u64) -> Result<IdealCourse, NoCourse> {
        let newton = NewtonSettings {
            tolerance: CONVERGED,
            ..NewtonSettings::default()
        };
        self.dt /= divider as f64;
        self.system.divider = divider;
        let made: Result<Newmark, MethodError> = Newmark::new(
            self.system.structure.mass(),
            &self.damping,
            &self.stiffness,
            self.dt,
            NewmarkBeta::Average,
            newton,
        );
        self.stepper = Stepper::Offline(Box::new(made.map_err(|_| NoCourse::NoEquilibrium)?));
        self.go(most)
    }

    fn go(mut self, most: u64) -> Result<IdealCourse, NoCourse> {
        self.settle()?;
        let n = self.dofs();
        let steps = self.system.excitation.steps() as u64 * self.system.divider;
        let mut course = IdealCourse {
            dofs: n,
            disp: Vec::with_capacity(n * (self.system.excitation.steps() + 1)),
        };
        let (system, state) = (&mut self.system, &mut self.state);
        let (mut residual, mut reported) = (vec![0.0; n], vec![0.0; n]);
        for step in 0..=steps {
            if !state.disp.iter().all(|x| x.is_finite()) {
                return Err(NoCourse::Diverged);
            }
            if system.work.get() > most {
                return Err(NoCourse::BeyondBudget);
            }
            if step.is_multiple_of(system.divider) {
                course.disp.extend_from_slice(&state.disp);
            }
            let passed = if step == 0 { 0.0 } else { self.dt };
            match &mut self.stepper {
                Stepper::Explicit(explicit) => {
                    let at = Moment::at(step);
                    system.residual_into(at, &state.disp, &state.vel, passed, &mut residual);
                    if let Some(massless) = &mut explicit.massless {
                        system.weigh(massless, state, step, passed);
                    }
                    system.commit();
                    let excitation = &system.excitation;
                    explicit.advance(
                        &mut system.structure,
                        state,
                        &residual,
                        &mut reported,
                        &mut |ahead, out| {
                            let step = step as usize + usize::from(ahead);
                            excitation.load_into(step, out);
                            let (disp, vel) = excitation.base(step);
                            Base { disp, vel }
                        },
                    );
                }
                Stepper::Offline(method) => {
                    if step == 0 {
                        let at = Moment::at(0);
                        system.residual_into(at, &state.disp, &state.vel, 0.0, &mut residual);
                        system.commit();
                        method.begin(state, &residual);
                    }
                    if step < steps {
                        let made = method.step(step + 1, state, system, &mut residual);
                        made.map_err(|_| NoCourse::NoEquilibrium)?;
                    }
                }
            }
        }
        Ok(course)
    }

    /// Applies the static load: initial displacements count from the position under it.
    fn settle(&mut self) -> Result<(), NoCourse> {
        let Some(load) = self.load.take() else {
            return Ok(());
        };
        let n = self.dofs();
        let (still, mut residual) = (vec![0.0; n], vec![0.0; n]);
        let mut disp = vec![0.0; n];
        let mut largest = 0.0_f64;
        for part in 1..=PARTS {
            let share = f64::from(part) / f64::from(PARTS);
            let mut iteration = 0;
            loop {
                for (r, load) in residual.iter_mut().zip(&load) {
                    *r = share * load;
                }
                self.system
                    .subtract(&disp, &still, Base::default(), 0.0, &mut residual);
                let tangent = self.system.tangents().stiffness;
                let stiffness = if 2 * iteration < ITERATIONS {
                    &tangent
                } else {
                    &self.stiffness
                };
                let factor = Spd::factor(stiffness).or_else(|_| Spd::factor(&self.stiffness));
                let mut factor = factor.map_err(|_| NoCourse::NoEquilibrium)?;
                factor.solve_in_place(&mut residual);
                let mut change = 0.0_f64;
                for (x, dx) in disp.iter_mut().zip(&residual) {
                    *x += dx;
                    change = change.max(dx.abs());
                    largest = largest.max(x.abs());
                }
                if !change.is_finite() || iteration == ITERATIONS {
                    return Err(NoCourse::NoEquilibrium);
                }
                if change <= SETTLED * largest {
                    break;
                }
                iteration += 1;
            }
            self.system.commit();
        }
        for (x, settled) in self.state.disp.iter_mut().zip(&disp) {
            *x += settled;
        }
        Ok(())
    }
}

impl System {
    fn dofs_of_forces(&self) -> u64 {
        (self.structure.dofs() as u64).max(LEAST_DOFS)
    }

    fn spend(&self, work: u64) {
        self.work.set(self.work.get().saturating_add(work));
    }

    /// residual ← residual less the forces of structure and specimens: a trial.
    fn subtract(&mut self, disp: &[f64], vel: &[f64], base: Base, dt: f64, residual: &mut [f64]) {
        self.structure.subtract_trial(disp, vel, base, dt, residual);
        for port in &mut self.specimens {
            port.subtract(disp, vel, base, dt, residual);
        }
    }
}

impl System {
    /// The forces of the structure in a step again, for the balance of the rows without mass.
    fn weigh(&mut self, massless: &mut Massless, state: &State, step: u64, dt: f64) {
        let step = step as usize;
        let (disp, vel) = self.excitation.base(step);
        let motion = Motion::new(&state.disp, &state.vel, Base { disp, vel }, dt);
        self.excitation.load_into(step, &mut self.spare);
        massless.close(&mut self.structure, motion, &mut self.spare);
    }
}

impl Forces for System {
    /// The load is linear between the steps of the test.
    fn residual_into(
        &mut self,
        at: Moment,
        disp: &[f64],
        vel: &[f64],
        dt: f64,
        residual: &mut [f64],
    ) {
        self.spend(self.dofs_of_forces());
        let place = (at.step as f64 - at.back).max(0.0) / self.divider as f64;
        let share = place.fract();
        let step = place as usize;
        self.excitation.load_into(step, residual);
        let (disp_0, vel_0) = self.excitation.base(step);
        let mut base = Base {
            disp: disp_0,
            vel: vel_0,
        };
        if share > 0.0 {
            let weigh = |old: f64, new: f64| (1.0 - share) * old + share * new;
            self.excitation.load_into(step + 1, &mut self.spare);
            for (old, new) in residual.iter_mut().zip(&self.spare) {
                *old = weigh(*old, *new);
            }
            let (disp_1, vel_1) = self.excitation.base(step + 1);
            base = Base {
                disp: weigh(base.disp, disp_1),
                vel: weigh(base.vel, vel_1),
            };
        }
        self.subtract(disp, vel, base, dt, residual);
    }

    fn tangents(&self) -> Tangents {
        let n = self.structure.dofs();
        let mut entries = [Vec::new(), Vec::new()];
        for port in &self.specimens {
            for (which, entries) in entries.iter_mut().enumerate() {
                port.add_tangent(which, entries);
            }
        }
        let values = entries.iter().flatten().map(|(_, _, value)| *value);
        let values: Vec<f64> = values.collect();
        let has_elements = !self.structure.is_linear();
        let mut assembled = self.assembled.borrow_mut();
        if let Some((of, known)) = assembled.as_ref()
            && !has_elements
            && *of == values
        {
            return known.clone();
        }
        let [stiffness, damping] = entries.map(|entries| SymMatrix::from_triplets(n, entries));
        let found = Tangents {
            stiffness: self.structure.tangent_stiffness().plus(1.0, &stiffness),
            damping: self.structure.tangent_damping().plus(1.0, &damping),
        };
        let is_known = assembled.as_ref().is_some_and(|(_, known)| *known == found);
        if !is_known {
            // They are factored.
            let band = found.stiffness.half_bandwidth() as u64 + 1;
            self.spend(n as u64 * band * band / OPERATIONS);
        }
        *assembled = Some((values, found.clone()));
        found
    }

    fn commit(&mut self) {
        self.structure.commit();
        for port in &mut self.specimens {
            if let IdealLaw::Law(law) = &mut port.law {
                law.commit();
            }
        }
    }
}

impl IdealPort {
    fn subtract(&mut self, disp: &[f64], vel: &[f64], base: Base, dt: f64, residual: &mut [f64]) {
        let motion = |row: &[(usize, f64)], of: &[f64]| -> f64 {
            row.iter().map(|(dof, b)| b * of[*dof]).sum()
        };
        for (axis, (d, v)) in self
            .axes
            .iter()
            .zip(self.disp.iter_mut().zip(&mut self.vel))
        {
            *d = motion(&axis.row, disp) - axis.base * base.disp;
            *v = motion(&axis.row, vel) - axis.base * base.vel;
        }
        match &mut self.law {
            IdealLaw::Law(law) => {
                let own = self.disp.iter_mut().zip(&mut self.vel);
                for ((axis, (d, v)), (metres, _)) in self.axes.iter().zip(own).zip(&self.units) {
                    *d = axis.command(AtStructure(*d)).0 * metres;
                    *v *= axis.vel_gain * metres;
                }
                law.trial(&self.disp, &self.vel, dt, &mut self.force);
                let forces = self.force.iter_mut().zip(&self.axes).zip(&self.units);
                for ((force, axis), (_, newtons)) in forces {
                    *force = axis.force_gain * (*force / newtons - axis.force_offset);
                }
            }
            IdealLaw::Linear { stiffness, damping } => {
                for (index, force) in self.force.iter_mut().enumerate() {
                    let of = |rows: &[Vec<f64>], values: &[f64]| -> f64 {
                        rows[index].iter().zip(values).map(|(a, b)| a * b).sum()
                    };
                    *force = of(stiffness, &self.disp) + of(damping, &self.vel);
                }
            }
        }
        for (axis, force) in self.axes.iter().zip(&self.force) {
            for (dof, b) in &axis.row {
                residual[*dof] -= b * force;
            }
        }
    }

    /// Adds the entries of Bᵀ K B (0) or Bᵀ C B (1) at the last trial, lower triangle.
    fn add_tangent(&self, which: usize, entries: &mut Vec<(usize, usize, f64)>) {
        let n = self.axes.len();
        let rows = match &self.law {
            IdealLaw::Linear { stiffness, damping } => [stiffness, damping][which].clone(),
            IdealLaw::Law(law) => {
                let mut flat = vec![0.0; n * n];
                let motion: fn(&Axis) -> f64 = if which == 0 {
                    law.tangent(&mut flat);
                    |axis: &Axis| axis.disp_gain
                } else {
                    law.tangent_damping(&mut flat);
                    |axis: &Axis| axis.vel_gain
                };
                scaled(&flat, &self.axes, &self.units, motion)
            }
        };
        for (i, row) in rows.iter().enumerate() {
            // A solver needs a symmetric tangent.
            for (j, own) in row.iter().enumerate() {
                let value = 0.5 * (own + rows[j][i]);
                for (p, a) in &self.axes[i].row {
                    for (q, b) in &self.axes[j].row {
                        if p >= q {
                            entries.push((*p, *q, value * a * b));
                        }
                    }
                }
            }
        }
    }
}
