//! Transfer systems: the parts between a command and the motion of a specimen, and between its force and a reading.
//!
//! [`Transfer`] is a specimen round a specimen: delay, actuator, limits and sensors of every axis. It is the same object in
//! process, behind a server and in a simulated link. Linear parts are exact for a command that ramps over the tick, and for one
//! that is held ([`exact`]). Before the first committed command the actuator is at rest at the command. While test time is held
//! it does not move. Nothing here depends on the number of trials. No clock, no input or output.

mod axis;
mod between_ticks;
mod delay;
pub mod exact;
pub mod noise;
mod sensor;
mod servo;
mod spec;

#[cfg(test)]
mod tests;

use thiserror::Error;

use axis::{Axis, Bounds};
use delay::Delay;
use sensor::Sensor;

pub use between_ticks::BetweenTicks;
pub use delay::LONGEST;
pub use servo::servo_tick;
pub use spec::{
    ActuatorSpec, FirstOrderSpec, ProportionalSpec, SecondOrderSpec, ServoHydraulicSpec,
    TransferSpec,
};

use crate::specimen::Specimen;
use gusset_numerics::law::Reach;
use gusset_quantity::domain::OutOfDomain;
use gusset_quantity::state;

/// Errors of a transfer system.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum TransferError {
    /// A number outside its domain.
    #[error(transparent)]
    Parameter(#[from] OutOfDomain),
    /// Two keys that exclude each other.
    #[error("{first} and {second} are both given, but only one of them may be")]
    Exclusive {
        /// One of them.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// A key without a meaning here.
    #[error("{name} is not for {what}")]
    NotApplicable {
        /// Key.
        name: &'static str,
        /// The part that does not support it.
        what: &'static str,
    },
    /// The history of commands is too short.
    #[error(
        "delay_s is {delay}, which is {ticks:.1} ticks, but the history of commands holds {most}"
    )]
    History {
        /// In s.
        delay: f64,
        /// In ticks.
        ticks: f64,
        /// Most ticks.
        most: usize,
    },
    /// The actuator's own loop is unstable.
    #[error(
        "the servo-hydraulic actuator is unstable by itself with a specimen of {stiffness} N/m and {damping} N s/m: lower \
         valve_gain"
    )]
    Unstable {
        /// N/m.
        stiffness: f64,
        /// N s/m.
        damping: f64,
    },
}

impl TransferError {
    /// The configuration key to point at.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Parameter(OutOfDomain { name, .. }) | Self::NotApplicable { name, .. } => name,
            Self::Exclusive { second, .. } => second,
            Self::History { .. } => "delay_s",
            Self::Unstable { .. } => "servo_hydraulic",
        }
    }
}

/// Most rounds of the correction between a nonlinear specimen and an actuator in the loop. At a fine tick each gains a factor
/// of about k Δt²/6m, and four are enough; at a coarse one secants find the solution, where one exists.
const MOST_CORRECTIONS: u32 = 64;
/// Share of the specimen's force that a correction may reach: a larger one is reported.
const SETTLED: f64 = 1e-6;
/// Rounds of the search for the place where an actuator stalls; it ends within 2⁻²⁰ of a tick's step.
const STALL_ROUNDS: u32 = 20;
/// Rounds of the search for where a specimen rests.
const REST_ROUNDS: u32 = 60;

/// A specimen behind a transfer system.
#[derive(Debug)]
pub struct Transfer {
    law: Box<dyn Specimen>,
    axes: Vec<Axis>,
    sensors: Vec<(Sensor, Sensor)>,
    is_noisy: bool,
    feels: bool,
    limits_force: bool,
    seed: u64,
    /// Committed ticks and test time.
    ticks: u64,
    elapsed: f64,
    /// Readings since then while time stopped.
    readings: u64,
    /// Tick in s of the controller, 0 if it was not announced; the last one in which time passed; that of the last trial.
    tick: f64,
    dt: f64,
    trial_dt: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    measured: Vec<f64>,
    saturated: bool,
    settled: bool,
}

state! {
    Transfer as "transfer" { ticks, elapsed, readings, dt, axes, law }
    keeps {
        sensors, is_noisy, feels, limits_force, seed, tick, trial_dt, disp, vel, measured, saturated, settled
    }
}

impl Transfer {
    /// `law` behind the transfer system of `spec`. `dt` is the tick in s of test time, if it is known.
    ///
    /// # Errors
    /// A key outside its domain, a delay beyond the history, an actuator that is unstable with this specimen.
    pub fn new(
        spec: &TransferSpec,
        law: Box<dyn Specimen>,
        dt: Option<f64>,
    ) -> Result<Self, TransferError> {
        spec.check(dt)?;
        let n = law.axes();
        let (mut k, mut c, mut m) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n * n]);
        law.reference(&mut k, &mut c, &mut m);
        let sensors = (spec.disp_sensor.build()?, spec.force_sensor.build()?);
        let infinite = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
        let bounds = Bounds {
            rate: infinite(spec.rate_limit_m_per_s),
            stroke: infinite(spec.stroke_m),
            force: infinite(spec.force_limit_n),
        };
        let mut axes = Vec::with_capacity(n);
        for axis in 0..n {
            let (stiffness, damping) = (k[axis * (n + 1)], c[axis * (n + 1)]);
            if let Some(ActuatorSpec::ServoHydraulic(servo)) = &spec.actuator {
                servo.check_loop(stiffness, damping)?;
            }
            let delay = Delay::new(spec.delay_s, spec.entries(dt), dt);
            let actuator = spec.actuator.as_ref();
            let mut axis = Axis::new(delay, actuator, bounds, stiffness, damping);
            axis.between_ticks = spec.between_ticks;
            axes.push(axis);
        }
        let feels = axes.iter().any(Axis::feels_the_specimen);
        Ok(Self {
            law,
            axes,
            sensors: vec![sensors; n],
            is_noisy: sensors.0.is_noisy() || sensors.1.is_noisy(),
            feels,
            limits_force: !feels && bounds.force.is_finite(),
            seed: spec.seed,
            ticks: 0,
            elapsed: 0.0,
            readings: 0,
            tick: 0.0,
            dt: 0.0,
            trial_dt: 0.0,
            disp: vec![0.0; n],
            vel: vec![0.0; n],
            measured: vec![0.0; n],
            saturated: false,
            settled: true,
        })
    }

    /// Position of the specimen at the last trial, in m: the truth, not a sensor's reading.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn achieved(&self) -> &[f64] {
        &self.disp
    }

    /// Puts the actuators at rest where the first command takes them.
    fn prime(&mut self, disp: &[f64], force: &mut [f64]) {
        self.vel.fill(0.0);
        force.fill(0.0);
        for _ in 0..REST_ROUNDS {
            for ((axis, at), (disp, force)) in self
                .axes
                .iter()
                .zip(&mut self.disp)
                .zip(disp.iter().zip(&*force))
            {
                *at = axis.rest(*disp, *force);
            }
            self.law.trial(&self.disp, &self.vel, 0.0, force);
            if !self.feels {
                break;
            }
        }
        for (axis, (disp, force)) in self.axes.iter_mut().zip(disp.iter().zip(&*force)) {
            axis.prime(*disp, *force);
        }
    }

    fn gather(&mut self) {
        let places = self.disp.iter_mut().zip(&mut self.vel);
        for ((disp, vel), axis) in places.zip(&self.axes) {
            (*disp, *vel) = (axis.disp, axis.vel);
        }
    }

    /// Specimen and actuators move each other. Real-time: yes.
    fn move_together(&mut self, dt: f64, force: &mut [f64]) {
        for _ in 0..MOST_CORRECTIONS {
            self.law.trial(&self.disp, &self.vel, dt, force);
            let mut left = 0.0_f64;
            for (axis, force) in self.axes.iter_mut().zip(&*force) {
                left = left.max(axis.correct(*force));
            }
            self.settled = left <= SETTLED;
            if left == 0.0 {
                break;
            }
            self.gather();
        }
        for (axis, force) in self.axes.iter().zip(force) {
            if let Some(given) = axis.force() {
                *force = given;
            }
        }
    }

    /// If a force exceeds the actuators' limit, they stall within the tick. Real-time: yes.
    fn stall(&mut self, dt: f64, force: &mut [f64]) {
        let too_much = |axes: &[Axis], force: &[f64]| {
            let mut pairs = axes.iter().zip(force);
            pairs.any(|(axis, force)| force.abs() > axis.force_limit())
        };
        if !too_much(&self.axes, force) {
            return;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for round in 0..=STALL_ROUNDS {
            // The last round returns to a share that is known to be possible.
            let share = if round == STALL_ROUNDS {
                low
            } else {
                0.5 * (low + high)
            };
            for axis in &mut self.axes {
                axis.stall_at(share);
            }
            self.gather();
            self.law.trial(&self.disp, &self.vel, dt, force);
            if too_much(&self.axes, force) {
                high = share;
            } else {
                low = share;
            }
        }
        self.saturated = true;
    }

    /// Computes the readings of the sensors. Real-time: yes.
    fn sense(&mut self, dt: f64, force: &mut [f64]) {
        let (tick, reading) = if dt > 0.0 {
            (self.ticks + 1, 0)
        } else {
            self.readings += 1;
            (self.ticks, self.readings)
        };
        // Noise of a given power is that of the tick, also while time stops.
        if dt > 0.0 {
            self.dt = dt;
        }
        let tick_dt = if self.tick > 0.0 { self.tick } else { self.dt };
        let elapsed = self.elapsed + dt;
        let readings = self.measured.iter_mut().zip(force).zip(&self.disp);
        for (channel, (((measured, force), disp), (of_disp, of_force))) in
            readings.zip(&self.sensors).enumerate()
        {
            let (a, b) = if self.is_noisy {
                noise::normal_pair(self.seed, channel as u64, tick, reading)
            } else {
                (0.0, 0.0)
            };
            let (disp, disp_ends) = of_disp.read(*disp, a, elapsed, tick_dt);
            let (sensed, force_ends) = of_force.read(*force, b, elapsed, tick_dt);
            (*measured, *force) = (disp, sensed);
            self.saturated |= disp_ends || force_ends;
        }
    }
}

impl Specimen for Transfer {
    fn axes(&self) -> usize {
        self.axes.len()
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]) {
        if !self.axes.first().is_some_and(Axis::is_primed) {
            self.prime(disp, force);
        }
        for (axis, (disp, vel)) in self.axes.iter_mut().zip(disp.iter().zip(vel)) {
            axis.go(*disp, *vel, dt);
        }
        self.gather();
        self.saturated = false;
        self.settled = true;
        if self.feels {
            self.move_together(dt, force);
        } else {
            self.law.trial(&self.disp, &self.vel, dt, force);
            if self.limits_force {
                self.stall(dt, force);
            }
        }
        self.saturated |= self.axes.iter().any(|axis| axis.saturated);
        self.sense(dt, force);
        self.trial_dt = dt;
    }

    fn commit(&mut self) {
        let dt = self.trial_dt;
        for axis in &mut self.axes {
            axis.commit(dt);
        }
        self.law.commit();
        if dt > 0.0 {
            self.ticks += 1;
            self.elapsed += dt;
            self.readings = 0;
        }
    }

    fn revert(&mut self) {
        self.law.revert();
        self.readings = 0;
    }

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        self.law.reference(stiffness, damping, mass);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        self.law.tangent(stiffness);
    }

    fn tangent_damping(&self, damping: &mut [f64]) {
        self.law.tangent_damping(damping);
    }

    fn rest_damping(&self, damping: &mut [f64]) {
        self.law.rest_damping(damping);
    }

    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        self.law.bound(reach, stiffness, damping)
    }

    fn measured(&mut self, disp: &mut [f64]) {
        for (to, from) in disp.iter_mut().zip(&self.measured) {
            *to = *from;
        }
    }

    fn is_saturated(&self) -> bool {
        self.saturated
    }

    fn is_settled(&self) -> bool {
        self.settled && self.law.is_settled()
    }

    fn commanded_every(&mut self, seconds: f64) {
        self.tick = seconds;
        self.law.commanded_every(seconds);
    }
}
