//! A servo-valve and a cylinder with the linear estimate of their load.

use super::exact::Ramped;
use super::spec::ServoHydraulicSpec;

/// States: displacement first, velocity second; the cylinder's force and the valve's two after them.
pub(super) const STATES: usize = 5;
pub(super) const DISP: usize = 0;
pub(super) const VEL: usize = 1;
pub(super) const FORCE: usize = 2;

/// A valve, a cylinder and the linear estimate of their load.
#[derive(Debug, Clone)]
pub(super) struct Servo {
    pub spec: ServoHydraulicSpec,
    pub stiffness: f64,
    pub damping: f64,
    pub tick: Ramped<STATES, 2>,
    /// The tick of a piston at the end of its stroke: nothing moves, and nothing bleeds the cylinder.
    pub at_stop: Ramped<STATES, 2>,
}

impl Servo {
    pub(crate) fn new(spec: ServoHydraulicSpec, stiffness: f64, damping: f64) -> Self {
        Self {
            spec,
            stiffness,
            damping,
            tick: Ramped::still(),
            at_stop: Ramped::still(),
        }
    }

    pub(crate) fn lay_out(&mut self, dt: f64) {
        let of = |moves| tick(&self.spec, self.stiffness, self.damping, dt, moves);
        (self.tick, self.at_stop) = (of(true), of(false));
    }

    /// Force in N that velocity feedback takes from the cylinder over a displacement in m of the piston.
    pub(crate) fn bled(&self, way: f64) -> f64 {
        self.spec.velocity_feedback_n_per_m * way
    }
}

/// One tick of valve, cylinder and a linear specimen: states x, v, f, q, q̇; inputs the command and a further force on the
/// specimen, against its motion.
#[must_use]
pub fn servo_tick(
    spec: &ServoHydraulicSpec,
    stiffness: f64,
    damping: f64,
    dt: f64,
) -> Ramped<5, 2> {
    tick(spec, stiffness, damping, dt, true)
}

fn tick(
    spec: &ServoHydraulicSpec,
    stiffness: f64,
    damping: f64,
    dt: f64,
    moves: bool,
) -> Ramped<STATES, 2> {
    let mass = spec.mass_kg;
    let feedback = spec.velocity_feedback_n_per_m;
    let mut a = [
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [-stiffness / mass, -damping / mass, 1.0 / mass, 0.0, 0.0],
        [0.0, -feedback, -spec.leakage_per_s, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0],
        [
            -spec.valve_gain,
            0.0,
            0.0,
            -spec.valve_stiffness_per_s2,
            -spec.valve_damping_per_s,
        ],
    ];
    let mut b = [
        [0.0, 0.0],
        [0.0, -1.0 / mass],
        [0.0, 0.0],
        [0.0, 0.0],
        [spec.gain * spec.valve_gain, 0.0],
    ];
    if !moves {
        (a[DISP], a[VEL], b[VEL]) = ([0.0; STATES], [0.0; STATES], [0.0; 2]);
    }
    let force = feedback.max(stiffness).max(mass);
    let units = [1.0, 1.0 / dt, force, force / dt, force / (dt * dt)];
    let a = a.map(|row| row.map(|v| v * dt));
    let b = b.map(|row| row.map(|v| v * dt));
    Ramped::new::<9>(&a, &b, &units)
}
