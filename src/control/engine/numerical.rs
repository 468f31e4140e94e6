//! The numerical side of a test: a structure that is integrated, or a deformation that is prescribed.

use std::ops::Range;

use super::audit::StepAudit;
use super::intake::{Closed, Intake};
use super::received_columns::Received;
use crate::port::Port;
use gusset_motion::{Excitation, Prescribed};
use gusset_numerics::integrate::{
    Explicit, Loaded, Massless, RowForces, State, StepError, Stepper,
};
use gusset_numerics::linalg::Aligned;
use gusset_numerics::model::{Acceleration, Base, Motion, Structure};
use gusset_quantity::frame::AtStructure;
use gusset_quantity::state;
use gusset_quantity::state::{Stateful, TestState, Visit};

/// What decides where the specimens go.
#[derive(Debug)]
pub enum Side {
    /// A structure under load, closed by the measured forces.
    Structure(Box<Numerical>),
    /// Given deformations, no structure: the test before every hybrid test. One history per axis of all ports in
    /// order; an axis without one holds zero.
    Prescribed(Vec<Option<Prescribed>>),
    /// Targets that another controller sends to the only specimen.
    Received(Box<Received>),
}

impl Stateful for Side {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        match self {
            Self::Structure(numerical) => numerical.visit_state(visit),
            Self::Prescribed(_) | Self::Received(_) => {}
        }
    }
}

impl Side {
    /// True of targets that another controller sends. Real-time: yes.
    #[inline]
    pub(crate) const fn is_received(&self) -> bool {
        matches!(self, Self::Received(_))
    }
}

/// How far the work on a step is that needs no measured force: it is done while the specimens move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ahead {
    /// The whole of it is done when the step is closed.
    Never,
    /// Nothing yet.
    Pending,
    /// The rows without mass are on their way.
    Following,
    /// The forces of the members from this part on are missing.
    Closing(usize),
    /// `inertia` holds F − R without the measured forces.
    Ready,
}

impl Stateful for Ahead {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        if !matches!(self, Self::Never | Self::Pending) {
            visit.refuse();
        }
    }
}

/// A structure, its loads, its integrator and the state between two ticks. All buffers have one entry per DOF.
#[derive(Debug)]
pub struct Numerical {
    /// M, C, K and the nonlinear elements.
    pub structure: Structure,
    /// Loads and base motion on the step grid.
    pub excitation: Excitation,
    acceleration: Acceleration,
    stepper: Stepper,
    ahead: Ahead,
    /// The audit of the steps made so far.
    pub audit: Option<StepAudit>,
    intake: Option<Intake>,
    /// x and v of the step that is about to be closed.
    pub state: State,
    /// r = F − R_d(v) − R_s(x) − Bᵀf of the step last closed.
    pub inertia: Aligned,
    /// M a of the step that an offline method has made ahead.
    next_inertia: Aligned,
    /// Velocity to report for the step last closed.
    pub reported_vel: Aligned,
    /// a = M⁻¹ r of the step last closed; NaN for a massless DOF.
    pub accel: Aligned,
}

state! {
    Numerical as "numerical side" {
        structure, state, stepper, ahead, audit: configured(), intake: configured(),
        inertia, next_inertia, reported_vel, accel
    }
    keeps { excitation, acceleration }
}

/// Points every port along its prescribed histories. Real-time: yes.
pub(super) fn aim_along(histories: &[Option<Prescribed>], step: usize, ports: &mut [Port]) {
    let mut along = histories.iter().map(|history| at(history.as_ref(), step));
    for port in ports {
        port.aim_at(&mut along);
    }
}

/// The next target of every port along its prescribed histories. Real-time: yes.
pub(super) fn seek_along(histories: &[Option<Prescribed>], step: usize, ports: &mut [Port]) {
    let mut along = histories.iter().map(|history| at(history.as_ref(), step));
    for port in ports {
        port.seek_at(&mut along);
    }
}

fn at(history: Option<&Prescribed>, step: usize) -> AtStructure<(f64, f64)> {
    let (disp, vel) = history.map_or((&[][..], &[][..]), |history| history.at(step));
    AtStructure((
        disp.first().copied().unwrap_or(0.0),
        vel.first().copied().unwrap_or(0.0),
    ))
}

impl Numerical {
    /// Puts the parts together; the lengths are those of `structure`.
    #[must_use]
    pub fn new(
        mut structure: Structure,
        acceleration: Acceleration,
        excitation: Excitation,
        stepper: impl Into<Stepper>,
        mut state: State,
    ) -> Self {
        let n = structure.dofs();
        let stepper = stepper.into();
        if let Stepper::Explicit(explicit) = &stepper {
            explicit.integrator.prepare(&mut state);
            structure.forget_tangents();
        }
        let works_ahead = match &stepper {
            Stepper::Explicit(explicit) => explicit.massless.is_some() || structure.has_members(),
            Stepper::Offline(_) => false,
        };
        Self {
            ahead: if works_ahead {
                Ahead::Pending
            } else {
                Ahead::Never
            },
            structure,
            acceleration,
            excitation,
            stepper,
            audit: None,
            intake: None,
            state,
            inertia: Aligned::zeros(n),
            next_inertia: Aligned::zeros(n),
            reported_vel: Aligned::zeros(n),
            accel: Aligned::zeros(n),
        }
    }

    /// The same with an audit of its steps, which must be those of the family with this effective mass.
    #[must_use]
    pub fn audited(mut self, audit: StepAudit) -> Self {
        self.audit = Some(audit);
        self
    }

    /// The same with an account of the energy that it takes in.
    #[must_use]
    pub fn counted(mut self, intake: Intake) -> Self {
        self.intake = Some(intake);
        self
    }

    /// The energy taken in so far, if it is counted.
    #[must_use]
    pub(crate) const fn intake(&self) -> Option<&Intake> {
        self.intake.as_ref()
    }

    /// Base displacement and velocity at a step.
    #[inline]
    #[must_use]
    pub(crate) fn base(&self, step: u64) -> Base {
        let (disp, vel) = self.excitation.base(index(step));
        Base { disp, vel }
    }

    /// What moves the degrees of freedom without mass, if there are any.
    #[must_use]
    pub(crate) fn massless(&self) -> Option<&Massless> {
        match &self.stepper {
            Stepper::Explicit(explicit) => explicit.massless.as_deref(),
            Stepper::Offline(_) => None,
        }
    }

    /// True if the method needs the forces of the step that it is making: no specimen can hang on it.
    #[inline]
    #[must_use]
    pub(crate) fn is_offline(&self) -> bool {
        matches!(self.stepper, Stepper::Offline(_))
    }

    /// True if a is what the method goes on with, and not what equilibrium at the end of a step gives.
    #[must_use]
    pub(crate) fn has_own_accel(&self) -> bool {
        matches!(&self.stepper, Stepper::Offline(method) if method.has_own_accel())
    }

    /// r at `step`, with the forces that the ports hold; `dt` is the time since the last accepted step.
    /// Numerical elements commit. Real-time: yes, unless the method is offline.
    #[inline]
    pub fn close(&mut self, step: u64, dt: f64, ports: &mut [Port]) {
        if self.is_offline() && step > 0 {
            // Equilibrium was found and committed when the step was made.
            self.inertia.copy_from_slice(&self.next_inertia);
            self.reported_vel.copy_from_slice(&self.state.vel);
            return;
        }
        let base = self.base(step);
        if self.ahead == Ahead::Never {
            self.load(step);
            let (disp, vel): (&[f64], &[f64]) = (&self.state.disp, &self.state.vel);
            self.structure
                .subtract_internal(disp, vel, base, dt, &mut self.inertia);
        } else {
            self.work_ahead(step, dt, usize::MAX);
            self.ahead = Ahead::Pending;
        }
        let residual: &mut [f64] = &mut self.inertia;
        let (disp, vel): (&[f64], &[f64]) = (&self.state.disp, &self.state.vel);
        for port in ports {
            port.subtract_force(0..residual.len(), residual);
        }
        if let Some(intake) = &mut self.intake {
            intake.note(&Closed {
                disp,
                residual,
                base,
                kinetic: 0.5 * self.structure.mass().quadratic(vel),
            });
        }
        if let Stepper::Offline(method) = &mut self.stepper {
            method.begin(&self.state, &self.inertia);
            self.reported_vel.copy_from_slice(&self.state.vel);
        }
    }

    /// F at `step`. Real-time: yes.
    fn load(&mut self, step: u64) {
        self.excitation.load_into(index(step), &mut self.inertia);
        if let Some(intake) = &mut self.intake {
            intake.loaded(&self.inertia);
        }
    }

    /// How often a step evaluates the members of a frame at most.
    #[must_use]
    pub fn most_evaluations(&self) -> usize {
        1 + self.massless().map_or(0, Massless::most_places) as usize
    }

    /// Part of the work on `step` that needs no measured force, as far as `budget` evaluations of members suffice. The results do not
    /// depend on the parts. Real-time: yes.
    pub(crate) fn work_ahead(&mut self, step: u64, dt: f64, mut budget: usize) {
        let base = self.base(step);
        loop {
            let Stepper::Explicit(Explicit { massless, .. }) = &mut self.stepper else {
                return;
            };
            self.ahead = match (self.ahead, massless) {
                (Ahead::Never | Ahead::Ready, _) => return,
                (Ahead::Pending, Some(_)) if step > 0 => Ahead::Following,
                (Ahead::Following, Some(massless)) => {
                    if !massless.work(&mut self.structure, &mut self.state, &mut budget) {
                        return;
                    }
                    self.load(step);
                    Ahead::Closing(0)
                }
                (Ahead::Pending | Ahead::Following, _) => {
                    self.load(step);
                    Ahead::Closing(0)
                }
                (Ahead::Closing(mut from), massless) => {
                    let (disp, vel) = (&self.state.disp, &self.state.vel);
                    let motion = Motion::new(disp, vel, base, dt);
                    let (structure, residual) = (&mut self.structure, &mut self.inertia);
                    let is_done = match massless {
                        Some(massless) => massless.close_in_parts(
                            structure,
                            motion,
                            residual,
                            &mut from,
                            &mut budget,
                        ),
                        None => structure.go_on(motion, residual, &mut from, &mut budget),
                    };
                    if is_done {
                        structure.commit();
                        Ahead::Ready
                    } else {
                        self.ahead = Ahead::Closing(from);
                        return;
                    }
                }
            };
        }
    }

    /// x and v of the step after `step`: one solve for an integrator, as many as it takes for an offline method.
    /// Real-time: yes, unless the method is offline.
    ///
    /// # Errors
    /// An offline method finds no equilibrium.
    #[inline]
    pub fn advance(&mut self, step: u64) -> Result<(), StepError> {
        match &mut self.stepper {
            Stepper::Explicit(explicit) => {
                if let Some(audit) = &mut self.audit {
                    audit.before(&self.state.disp);
                }
                explicit.advance_masses(&mut self.state, &self.inertia, &mut self.reported_vel);
                // The rest of their way is made when the command has left.
                if let Some(massless) = &mut explicit.massless {
                    let excitation = &self.excitation;
                    massless.begin(
                        &self.structure,
                        &self.state,
                        &self.inertia,
                        &mut |next, out| loaded(excitation, step + u64::from(next), out),
                    );
                }
                if let Some(audit) = &mut self.audit {
                    audit.after(&self.state.disp, &self.state.vel, &self.inertia);
                }
                Ok(())
            }
            Stepper::Offline(method) => {
                // Nothing is recorded of a step beyond the test.
                if index(step) >= self.excitation.steps() {
                    return Ok(());
                }
                let excitation = &self.excitation;
                let mut forces = Loaded::new(&mut self.structure, |step, out: &mut [f64]| {
                    loaded(excitation, step, out)
                });
                method.step(
                    step + 1,
                    &mut self.state,
                    &mut forces,
                    &mut self.next_inertia,
                )
            }
        }
    }

    /// [`Numerical::close`] and [`Numerical::advance`] at once, with the same bits: an explicit method moves some rows
    /// while their forces are near. Real-time: yes, unless the method is offline.
    ///
    /// # Errors
    /// An offline method finds no equilibrium.
    #[inline]
    pub(crate) fn make_step(
        &mut self,
        step: u64,
        dt: f64,
        ports: &mut [Port],
    ) -> Result<(), StepError> {
        // The account of energy looks at the whole of a closed step.
        let (Stepper::Explicit(Explicit { integrator, .. }), None, Ahead::Never) =
            (&mut self.stepper, &self.intake, self.ahead)
        else {
            self.close(step, dt, ports);
            return self.advance(step);
        };
        let by_rows = self.excitation.is_by_rows();
        if !by_rows {
            self.excitation.load_into(index(step), &mut self.inertia);
        }
        let (disp, vel) = self.excitation.base(index(step));
        let mut forces = StepForces {
            structure: &mut self.structure,
            excitation: by_rows.then_some(&self.excitation),
            ports,
            step: index(step),
            base: Base { disp, vel },
            dt,
        };
        if let Some(audit) = &mut self.audit {
            audit.before(&self.state.disp);
        }
        integrator.step(
            &mut self.state,
            &mut forces,
            &mut self.inertia,
            &mut self.reported_vel,
        );
        if let Some(audit) = &mut self.audit {
            audit.after(&self.state.disp, &self.state.vel, &self.inertia);
        }
        Ok(())
    }

    /// a of the step last closed, for the record only. Real-time: yes.
    #[inline]
    pub(crate) fn output_accel(&mut self) {
        self.acceleration.accel_into(&self.inertia, &mut self.accel);
    }

    /// What a rehearsal goes back to; none for an offline method, which has no deadline to be warm for.
    #[must_use]
    pub(crate) fn scratch(&mut self) -> Option<Scratch> {
        if self.is_offline() {
            return None;
        }
        let memory = TestState::of(|visit| self.visit_memory(visit)).ok()?;
        let state = self.state.clone();
        Some(Scratch { state, memory })
    }

    /// Runs the whole numerical path once and leaves no trace, so that the processor, its caches and branch predictors
    /// are warm at the first tick. Real-time: yes.
    pub(crate) fn rehearse(&mut self, scratch: &Scratch, ports: &mut [Port]) {
        self.try_step(ports);
        self.undo(scratch);
    }

    /// The work of one step; [`Numerical::undo`] is to follow. Real-time: yes.
    pub(super) fn try_step(&mut self, ports: &mut [Port]) {
        // What the audit and the account of energy have seen of the test stays as it is.
        let (audit, intake) = (self.audit.take(), self.intake.take());
        // The way that a step of the test goes. An integrator does not fail.
        let _ = if intake.is_some() {
            self.close(0, 0.0, ports);
            self.advance(0)
        } else {
            self.make_step(0, 0.0, ports)
        };
        self.output_accel();
        (self.audit, self.intake) = (audit, intake);
    }

    /// The values that a step changes besides the state of the integration.
    fn visit_memory(&mut self, visit: &mut dyn Visit) {
        self.structure.visit_state(visit);
        self.stepper.visit_state(visit);
    }

    /// Time that a step takes in the worst case, by a clock that counts ns: no fibre is elastic, all turn round, and every search
    /// tries as many places as it may. The median of some; nothing is left of them. None for an offline method.
    pub fn worst_step(&mut self, dt: f64, now_ns: &mut dyn FnMut() -> u64) -> Option<u64> {
        const BENT: f64 = 0.1;
        let scratch = self.scratch()?;
        let (audit, intake) = (self.audit.take(), self.intake.take());
        let mut times = [0; 31];
        for (round, time) in times.iter_mut().enumerate() {
            self.exhaust(true);
            let sign = if round % 2 == 0 { BENT } else { -BENT };
            for (dof, x) in self.state.disp.iter_mut().enumerate() {
                *x = sign * libm::sin(1.0 + 7.3 * dof as f64);
            }
            let begun = now_ns();
            self.close(1, dt, &mut []);
            let _ = self.advance(1);
            *time = now_ns().saturating_sub(begun);
        }
        self.exhaust(false);
        self.undo(&scratch);
        (self.audit, self.intake) = (audit, intake);
        times.sort_unstable();
        times.get(times.len() / 2).copied()
    }

    fn exhaust(&mut self, yes: bool) {
        self.structure.exhaust_members(yes);
        if let Stepper::Explicit(explicit) = &mut self.stepper
            && let Some(massless) = &mut explicit.massless
        {
            massless.exhaust(yes);
        }
    }

    /// Takes back what was only tried. Real-time: yes.
    pub(super) fn undo(&mut self, scratch: &Scratch) {
        self.state.copy_from(&scratch.state);
        // It is the structure's own.
        let _ = scratch.memory.restore(|visit| self.visit_memory(visit));
        for output in [&mut self.inertia, &mut self.reported_vel, &mut self.accel] {
            output.fill(0.0);
        }
    }
}

/// F of a step into `out`, and the base there. Real-time: yes.
#[inline]
fn loaded(excitation: &Excitation, step: u64, out: &mut [f64]) -> Base {
    excitation.load_into(index(step), out);
    let (disp, vel) = excitation.base(index(step));
    Base { disp, vel }
}

/// r of one step, some rows at a time.
struct StepForces<'a> {
    structure: &'a mut Structure,
    /// None if the loads are in the residual already.
    excitation: Option<&'a Excitation>,
    ports: &'a mut [Port],
    step: usize,
    base: Base,
    dt: f64,
}

impl RowForces for StepForces<'_> {
    fn reach(&self) -> usize {
        self.structure.reach()
    }

    fn fill(&mut self, rows: Range<usize>, disp: &[f64], vel: &[f64], residual: &mut [f64]) {
        let loads = self.excitation;
        let fresh = loads.is_some_and(|e| !e.load_rows(self.step, rows.clone(), residual));
        let motion = Motion::new(disp, vel, self.base, self.dt);
        let structure = &mut *self.structure;
        structure.subtract_rows(rows.clone(), motion, residual, fresh);
        for port in &mut *self.ports {
            port.subtract_force(rows.clone(), residual);
        }
    }
}

/// State and memory of the numerical side before t = 0.
#[derive(Debug)]
pub(crate) struct Scratch {
    state: State,
    memory: TestState,
}

/// Step numbers are u64 on the grid and usize in memory; beyond memory there is no load.
#[inline]
fn index(step: u64) -> usize {
    usize::try_from(step).unwrap_or(usize::MAX)
}
