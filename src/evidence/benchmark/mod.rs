//! The virtual real-time hybrid simulation benchmark (Silva, Gomez, Maghareh, Dyke & Spencer 2020), natively: a frame of
//! three storeys, the first of which is moved by a servo-hydraulic actuator.
//!
//! Two wirings. [`Wiring::Benchmark`] is the released one: the numerical side by the classical Runge–Kutta method, commands
//! held over the tick, the force one tick late, target and measurement of one tick for the compensator. [`Wiring::InTick`] is this
//! program's loop: the family at λ = 4, a command that was known a tick ahead and ramps or is held, the force of the same tick.
//!
//! The converters have 18 bits in the released model, [`QUANTUM`] volts each. How many metres and newtons are a volt is not
//! published; the sensors' gains are 1. Noise and quantisation are two separate choices. No file, no clock.

mod criteria;
mod frame;
mod ground;
mod trials;

#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Vector3};

pub use criteria::{Criteria, Histories};
pub(crate) use frame::SPECIMEN;
pub use frame::{DURATION_S, Frame, Motion, Part, RATE_HZ};
pub use ground::synthetic;
pub use trials::{Job, Line, Trials, controllers, jobs};

use gusset_actuator::compensation::Compensator;
use gusset_actuator::transfer::exact::Ramped;
use gusset_actuator::transfer::noise::normal_pair;
use gusset_actuator::transfer::{BetweenTicks, ServoHydraulicSpec, servo_tick};

/// How the two sides are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wiring {
    /// As released.
    Benchmark,
    /// As this program's loop.
    InTick(BetweenTicks),
}

impl Wiring {
    /// Course of the command between two ticks.
    #[must_use]
    pub const fn between_ticks(self) -> BetweenTicks {
        match self {
            Self::Benchmark => BetweenTicks::Held,
            Self::InTick(between_ticks) => between_ticks,
        }
    }
}

/// Standard deviation of both sensors' noise at 4096 Hz: powers 6.25e-14 m² s and 1.16e-3 N² s.
const NOISE_POWER: (f64, f64) = (6.25e-14, 1.16e-3);
/// Quantum of the released converters, in V.
pub(crate) const QUANTUM: f64 = 1.0 / (1_u32 << 18) as f64;
/// The actuator gives no more, N.
pub(crate) const FORCE_LIMIT_N: f64 = 8900.0;

/// The plant of one run: the published one, or one drawn from its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plant {
    /// Valve and cylinder.
    pub servo: ServoHydraulicSpec,
    /// Stiffness of the specimen in N/m.
    pub stiffness: f64,
    /// Its damping in N s/m.
    pub damping: f64,
}

impl Default for Plant {
    fn default() -> Self {
        let (mass_kg, damping, stiffness) = SPECIMEN;
        Self {
            servo: ServoHydraulicSpec {
                mass_kg,
                ..ServoHydraulicSpec::default()
            },
            stiffness,
            damping,
        }
    }
}

impl Plant {
    /// Plant `number` of the uncertain ones of `seed`: standard deviations of k_e 5e4 N/m, a₃ 1.3 1/s, β₁ 3.3 1/s, β₂
    /// 3.3e3 1/s². A negative leakage is unphysical: it is drawn again. Number 0 is the nominal plant.
    #[must_use]
    pub(crate) fn drawn(seed: u64, number: u64) -> Self {
        let mut plant = Self::default();
        if number == 0 {
            return plant;
        }
        let (stiffness, beta_1) = normal_pair(seed, 0, number, 0);
        plant.stiffness += 5e4 * stiffness;
        plant.servo.valve_damping_per_s += 3.3 * beta_1;
        for attempt in 0.. {
            let (leakage, beta_2) = normal_pair(seed, 1, number, attempt);
            let leakage = plant.servo.leakage_per_s + 1.3 * leakage;
            if leakage >= 0.0 {
                plant.servo.leakage_per_s = leakage;
                plant.servo.valve_stiffness_per_s2 += 3.3e3 * beta_2;
                break;
            }
        }
        plant
    }
}

/// One run to make: case, plant, coupling and disturbances.
#[derive(Debug, Clone, Copy)]
pub struct Setup<'a> {
    /// The case.
    pub frame: &'a Frame,
    /// The plant.
    pub plant: Plant,
    /// How the sides are joined.
    pub wiring: Wiring,
    /// Seed of the sensors' noise; none: perfect sensors.
    pub noise: Option<u64>,
    /// Commands in m, and readings in m and N, are multiples of this; 0: not quantised.
    pub quantum: f64,
    /// Ground acceleration in m/s² at each tick.
    pub ground: &'a [f64],
    /// Further whole ticks by which the force comes late.
    pub late: usize,
    /// Largest force of the actuator, in N.
    pub force_limit: f64,
}

/// Results of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Tick by tick.
    pub histories: Histories,
    /// Ticks in which the actuator was at its force limit, or a number was NaN or infinite.
    pub saturated: usize,
}

/// Largest lateness of the force in ticks.
const LATEST: usize = 64;

/// The floors of the linear frame without any partition.
#[must_use]
pub(crate) fn reference(frame: &Frame, ground: &[f64]) -> [Vec<f64>; 3] {
    let whole = frame.whole();
    let mut floors: [Vec<f64>; 3] = Default::default();
    let mut motion = Motion::REST;
    for (k, accel) in ground.iter().enumerate() {
        for (floor, disp) in floors.iter_mut().zip(&motion.disp) {
            floor.push(*disp);
        }
        let next = ground.get(k + 1).copied().unwrap_or(*accel);
        motion = whole.runge_kutta(motion, 1.0 / RATE_HZ, [*accel, next], 0.0);
    }
    floors
}

/// Valve, cylinder and specimen, tick by tick.
struct Rig {
    tick: Ramped<5, 2>,
    state: [f64; 5],
    command: f64,
    between_ticks: BetweenTicks,
    limit: f64,
    quantum: f64,
    saturated: usize,
}

impl Rig {
    /// One tick to the command `new`.
    fn go(&mut self, new: f64) {
        let last = std::mem::replace(&mut self.command, new);
        let start = self.converted(self.between_ticks.start(last, new));
        let end = self.converted(new);
        let mut next = self.tick.step(&self.state, &[start, 0.0], &[end, 0.0]);
        let excess = next[2] - next[2].clamp(-self.limit, self.limit);
        if excess != 0.0 {
            self.tick.add_to_end(&mut next, 1, excess);
            next[2] = self.limit.copysign(excess);
        }
        if excess != 0.0 || !next[0].is_finite() {
            self.saturated += 1;
        }
        self.state = next;
    }

    /// Half to even, as converters are specified.
    fn converted(&self, value: f64) -> f64 {
        if self.quantum > 0.0 {
            (value / self.quantum).round_ties_even() * self.quantum
        } else {
            value
        }
    }

    /// Displacement and force as the sensors read them.
    fn read(&self, noise: Option<u64>, tick: usize) -> (f64, f64) {
        let (mut disp, mut force) = (self.state[0], self.state[2]);
        if let Some(seed) = noise {
            let (a, b) = normal_pair(seed, 0, tick as u64, 0);
            let deviation = |power: f64| (power * RATE_HZ).sqrt();
            disp += deviation(NOISE_POWER.0) * a;
            force += deviation(NOISE_POWER.1) * b;
        }
        (self.converted(disp), self.converted(force))
    }
}

/// Makes the run. The compensator is not reset first.
pub fn run(setup: &Setup<'_>, controller: &mut dyn Compensator) -> Outcome {
    let dt = 1.0 / RATE_HZ;
    let n = setup.ground.len();
    let plant = &setup.plant;
    let mut rig = Rig {
        tick: servo_tick(&plant.servo, plant.stiffness, plant.damping, dt),
        state: [0.0; 5],
        command: 0.0,
        between_ticks: setup.wiring.between_ticks(),
        limit: setup.force_limit,
        quantum: setup.quantum,
        saturated: 0,
    };
    let part = setup.frame.numerical();
    let weight = effective_mass(setup.frame, &part, dt)
        .try_inverse()
        .unwrap_or_else(Matrix3::zeros);
    let mut histories = Histories {
        measured: Vec::with_capacity(n),
        floors: std::array::from_fn(|_| Vec::with_capacity(n)),
    };
    let mut motion = Motion::REST;
    let (mut last, mut last_vel) = (0.0, 0.0);
    // Forces of past ticks, newest at the tick's own place.
    let mut forces = [0.0; LATEST];
    let late = setup.late.min(LATEST - 2);
    let mut lead = |motion: &Motion, controller: &mut dyn Compensator| {
        let disp = motion.disp[0];
        let vel = (disp - last) / dt;
        let led = controller.lead(disp, vel, (vel - last_vel) / dt);
        (last, last_vel) = (disp, vel);
        led
    };
    for (k, accel) in setup.ground.iter().enumerate() {
        for (floor, disp) in histories.floors.iter_mut().zip(&motion.disp) {
            floor.push(*disp);
        }
        let (disp, force) = rig.read(setup.noise, k);
        histories.measured.push(disp);
        forces[k % LATEST] = force;
        let past = |ticks: usize| k.checked_sub(ticks).map_or(0.0, |at| forces[at % LATEST]);
        let command = match setup.wiring {
            Wiring::Benchmark => {
                // The command of this tick's target, against this tick's measurement: both sides of a fit are of one moment.
                let led = lead(&motion, controller);
                controller.observe(led, disp);
                let next = setup.ground.get(k + 1).copied().unwrap_or(*accel);
                motion = part.runge_kutta(motion, dt, [*accel, next], past(1 + late));
                controller.regulate(led)
            }
            Wiring::InTick(_) => {
                controller.observe(rig.command, disp);
                let pull = part.load * *accel
                    - part.damping * motion.vel
                    - part.stiffness * motion.disp
                    - Vector3::new(past(late), 0.0, 0.0);
                motion.vel += weight * pull * dt;
                motion.disp += motion.vel * dt;
                let led = lead(&motion, controller);
                controller.regulate(led)
            }
        };
        rig.go(command);
    }
    Outcome {
        histories,
        saturated: rig.saturated,
    }
}

/// M_eff = M + (Δt/2) C0 + (Δt²/4) K0: the mass of the numerical side alone, for the force brings the rest, and the damping
/// and stiffness of the whole.
fn effective_mass(frame: &Frame, part: &Part, dt: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&part.mass)
        + frame.damping * (dt / 2.0)
        + frame.stiffness * (dt * dt / 4.0)
}
