//! The numerical side of a test: a structure that is integrated, or a deformation that is prescribed.

use crate::control::Port;
use crate::integrate::{Integrator, State};
use crate::model::{Acceleration, Base, Structure};
use crate::motion::{Excitation, Prescribed};

/// What decides where the specimens go.
#[derive(Debug)]
pub enum Side {
    /// A structure under load, closed by the measured forces.
    Structure(Box<Numerical>),
    /// Given deformations, no structure: the test before every hybrid test. One history per axis of all ports in
    /// order; an axis without one holds zero.
    Prescribed(Vec<Option<Prescribed>>),
}

/// A structure, its loads, its integrator and the state between two ticks. All buffers have one entry per DOF.
#[derive(Debug)]
pub struct Numerical {
    /// M, C, K and the nonlinear elements.
    pub structure: Structure,
    /// Loads and base motion on the step grid.
    pub excitation: Excitation,
    acceleration: Acceleration,
    integrator: Box<dyn Integrator>,
    /// x and v of the step that is about to be closed.
    pub state: State,
    residual: Vec<f64>,
    /// r = F − R_d(v) − R_s(x) − Bᵀf of the step last closed.
    pub inertia: Vec<f64>,
    /// Velocity to report for the step last closed.
    pub reported_vel: Vec<f64>,
    /// a = M⁻¹ r of the step last closed; NaN for a massless DOF.
    pub accel: Vec<f64>,
}

/// Points every port along its prescribed histories. Real-time: yes.
pub(super) fn aim_along(histories: &[Option<Prescribed>], step: usize, ports: &mut [Port]) {
    let mut along = histories.iter().map(|history| {
        let (disp, vel) = history
            .as_ref()
            .map_or((&[][..], &[][..]), |history| history.at(step));
        (
            disp.first().copied().unwrap_or(0.0),
            vel.first().copied().unwrap_or(0.0),
        )
    });
    for port in ports {
        port.aim_at(&mut along);
    }
}

impl Numerical {
    /// Puts the parts together; the lengths are those of `structure`.
    #[must_use]
    pub fn new(
        structure: Structure,
        acceleration: Acceleration,
        excitation: Excitation,
        integrator: Box<dyn Integrator>,
        state: State,
    ) -> Self {
        let n = structure.dofs();
        Self {
            structure,
            acceleration,
            excitation,
            integrator,
            state,
            residual: vec![0.0; n],
            inertia: vec![0.0; n],
            reported_vel: vec![0.0; n],
            accel: vec![0.0; n],
        }
    }

    /// Base displacement and velocity at a step.
    #[must_use]
    pub fn base(&self, step: u64) -> Base {
        let (disp, vel) = self.excitation.base(index(step));
        Base { disp, vel }
    }

    /// r at `step`, with the forces that the ports hold; `dt` is the time since the last accepted step.
    /// Numerical elements commit. Real-time: yes.
    pub fn close(&mut self, step: u64, dt: f64, ports: &mut [Port]) {
        let base = self.base(step);
        self.excitation.load_into(index(step), &mut self.residual);
        self.structure.subtract_internal(
            &self.state.disp,
            &self.state.vel,
            base,
            dt,
            &mut self.residual,
        );
        for port in ports {
            port.subtract_force(&mut self.residual);
        }
        self.inertia.copy_from_slice(&self.residual);
    }

    /// x and v of the next step: one solve. Real-time: yes.
    pub fn advance(&mut self) {
        self.integrator
            .advance(&mut self.state, &mut self.residual, &mut self.reported_vel);
    }

    /// a of the step last closed, for the record only. Real-time: yes.
    pub fn output_accel(&mut self) {
        self.acceleration.accel_into(&self.inertia, &mut self.accel);
    }

    /// Runs the whole numerical path `times` times and leaves no trace, so that caches and branch predictors are
    /// warm at the first tick.
    pub fn rehearse(&mut self, times: usize, ports: &mut [Port]) {
        let state = self.state.clone();
        let mut memory = Vec::new();
        self.structure.freeze(&mut memory);
        for _ in 0..times {
            self.close(0, 0.0, ports);
            self.advance();
            self.output_accel();
            self.state.clone_from(&state);
        }
        self.structure.thaw(&memory);
        for output in [&mut self.inertia, &mut self.reported_vel, &mut self.accel] {
            output.fill(0.0);
        }
    }
}

/// Step numbers are u64 on the grid and usize in memory; beyond memory there is no load.
fn index(step: u64) -> usize {
    usize::try_from(step).unwrap_or(usize::MAX)
}
