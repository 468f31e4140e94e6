//! One actuator: from the command of a tick to the position of the specimen at its end.
//!
//! Between commands lies a straight line or the new command, which the linear part follows exactly. Limits act at the ends of
//! ticks. While test time stops nothing moves, except a part that follows its command at once.

use super::between_ticks::BetweenTicks;
use super::delay::Delay;
use super::exact::Ramped;
use super::servo::{DISP, FORCE, STATES, Servo, VEL};
use super::spec::{ActuatorSpec, FirstOrderSpec, SecondOrderSpec};
use gusset_quantity::state;

/// A correction that falls by less than this a round does so slowly, or not at all.
const SLOWLY: f64 = 0.25;
/// Smallest and largest factor of a secant on a correction; the smallest also applies where it leads away. A slip from a
/// stiffness far above that of the mass and the tick needs the largest.
const SHARES: [f64; 2] = [1.0 / 64.0, 1024.0];

#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct State {
    /// Delayed command.
    drive: f64,
    x: [f64; STATES],
    /// The specimen's force beyond its linear estimate.
    residual: f64,
}

state! { State { drive, residual, x } }

#[derive(Debug, Clone)]
enum Dynamics {
    /// With a gain.
    Direct(f64),
    First(FirstOrderSpec, Ramped<1, 1>),
    Second(SecondOrderSpec, Ramped<2, 1>),
    Servo(Box<Servo>),
}

/// Limits; infinite where there is no limit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub rate: f64,
    pub stroke: f64,
    pub force: f64,
}

/// One axis of a transfer system.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    delay: Delay,
    /// Course of the delayed command between two ticks.
    pub between_ticks: BetweenTicks,
    dynamics: Dynamics,
    bounds: Bounds,
    /// Tick that the dynamics are made for, in s; 0 before the first.
    dt: f64,
    primed: bool,
    committed: State,
    trial: State,
    /// Whether this trial ends at the end of the stroke, for an actuator in the loop.
    stopped: bool,
    /// The last correction of this trial and its result; `None` before the first.
    corrected: Option<(f64, f64)>,
    command: [f64; 2],
    pub disp: f64,
    pub vel: f64,
    pub saturated: bool,
}

// The tick is part of the state: while test time is held, a correction lasts as long as the last tick.
state! {
    Axis { dynamics: by(|one, visit| visit.part(one.name())), primed, dt, committed, delay }
    keeps { between_ticks, bounds, trial, stopped, corrected, command, disp, vel, saturated }
    restored {
        if *dt > 0.0 {
            dynamics.lay_out(*dt);
        }
    }
}

impl Axis {
    /// `stiffness` and `damping` are the specimen's own estimates, for an actuator in the loop.
    pub(crate) fn new(
        delay: Delay,
        actuator: Option<&ActuatorSpec>,
        bounds: Bounds,
        stiffness: f64,
        damping: f64,
    ) -> Self {
        let dynamics = match actuator {
            None => Dynamics::Direct(1.0),
            Some(ActuatorSpec::Proportional(spec)) => Dynamics::Direct(spec.gain),
            Some(ActuatorSpec::FirstOrder(spec)) => Dynamics::First(*spec, Ramped::still()),
            Some(ActuatorSpec::SecondOrder(spec)) => Dynamics::Second(*spec, Ramped::still()),
            Some(ActuatorSpec::ServoHydraulic(spec)) => {
                Dynamics::Servo(Box::new(Servo::new(*spec, stiffness, damping)))
            }
        };
        Self {
            delay,
            between_ticks: BetweenTicks::default(),
            dynamics,
            bounds,
            dt: 0.0,
            primed: false,
            committed: State::default(),
            trial: State::default(),
            stopped: false,
            corrected: None,
            command: [0.0; 2],
            disp: 0.0,
            vel: 0.0,
            saturated: false,
        }
    }

    /// True if the specimen is part of the actuator's own loop.
    pub(crate) const fn feels_the_specimen(&self) -> bool {
        matches!(self.dynamics, Dynamics::Servo(_))
    }

    /// True if a command was committed.
    pub(crate) const fn is_primed(&self) -> bool {
        self.primed
    }

    pub(crate) const fn force_limit(&self) -> f64 {
        self.bounds.force
    }

    /// Puts the actuator at rest where `disp` takes it, as if it had always been commanded. `force` is the specimen's at
    /// the position that [`Axis::rest`] gave.
    pub(crate) fn prime(&mut self, disp: f64, force: f64) {
        self.delay.prime(disp);
        let mut state = State {
            drive: disp,
            ..State::default()
        };
        state.x[DISP] = self.rest(disp, force);
        if let Dynamics::Servo(servo) = &self.dynamics {
            state.x[FORCE] = force.clamp(-self.bounds.force, self.bounds.force);
            state.x[3] = servo.spec.leakage_per_s * state.x[FORCE];
            state.residual = force - servo.stiffness * state.x[DISP];
        }
        self.committed = state;
    }

    /// Where a command held for ever takes the specimen if it resists with `force` there.
    pub(crate) fn rest(&self, disp: f64, force: f64) -> f64 {
        let rest = match &self.dynamics {
            Dynamics::Direct(gain) => gain * disp,
            Dynamics::First(spec, _) => spec.gain * disp,
            Dynamics::Second(spec, _) => spec.gain * disp,
            Dynamics::Servo(servo) => {
                let spec = &servo.spec;
                let leak = spec.leakage_per_s * spec.valve_stiffness_per_s2 / spec.valve_gain;
                spec.gain * disp - leak * force
            }
        };
        rest.clamp(-self.bounds.stroke, self.bounds.stroke)
    }

    /// One tick of `dt` seconds to a command, from the committed state. Real-time: yes; a new `dt` costs an exponential.
    pub(crate) fn go(&mut self, disp: f64, vel: f64, dt: f64) {
        if dt > 0.0 && dt != self.dt {
            self.dt = dt;
            self.dynamics.lay_out(dt);
        }
        self.command = [disp, vel];
        let [drive, drive_vel] = self.delay.trial(self.command, dt);
        let before = self.committed;
        let mut now = State { drive, ..before };
        let first = self.between_ticks.start(before.drive, drive);
        let (start, end) = ([first], [drive]);
        self.saturated = false;
        self.stopped = false;
        match &self.dynamics {
            Dynamics::Direct(gain) => {
                if dt > 0.0 || self.bounds.rate.is_infinite() {
                    now.x[DISP] = gain * drive;
                    now.x[VEL] = gain * drive_vel;
                }
            }
            Dynamics::First(spec, tick) => {
                if dt > 0.0 {
                    let [x] = tick.step(&[before.x[DISP]], &start, &end);
                    now.x[DISP] = x;
                }
                now.x[VEL] = (spec.gain * drive - now.x[DISP]) / spec.time_constant_s;
            }
            Dynamics::Second(_, tick) => {
                if dt > 0.0 {
                    let [x, v] = tick.step(&[before.x[DISP], before.x[VEL]], &start, &end);
                    (now.x[DISP], now.x[VEL]) = (x, v);
                }
            }
            Dynamics::Servo(servo) => {
                if dt > 0.0 {
                    let held = before.residual;
                    self.stopped = self.is_pressed(servo);
                    let tick = if self.stopped {
                        &servo.at_stop
                    } else {
                        &servo.tick
                    };
                    now.x = tick.step(&before.x, &[first, held], &[drive, held]);
                }
            }
        }
        self.trial = now;
        self.corrected = None;
        self.limit(dt);
    }

    /// Takes the specimen's `force` at the place of [`Axis::go`]. Returns zero if it is as expected, else the unexpected share of
    /// it; the position changes then. Real-time: yes.
    pub(crate) fn correct(&mut self, force: f64) -> f64 {
        let Dynamics::Servo(servo) = &self.dynamics else {
            return 0.0;
        };
        let linear = servo.stiffness * self.disp + servo.damping * self.vel;
        let residual = force - linear;
        let change = residual - self.trial.residual;
        if self.stopped {
            // It stays, whatever the force; the residual applies when it leaves.
            self.trial.residual = residual;
            return 0.0;
        }
        let size = force.abs() + linear.abs();
        // The roundoff of both sums is no change.
        if change.abs() <= 1e-12 * size || self.dt <= 0.0 {
            return 0.0;
        }
        // A correction that falls quickly needs no help; else the secant through it and the last one gives the step.
        let step = match self.corrected {
            Some((before, way)) if change.abs() > SLOWLY * before.abs() => {
                let share = way / (before - change);
                let [least, most] = SHARES;
                change
                    * if share > least {
                        share.min(most)
                    } else {
                        least
                    }
            }
            _ => change,
        };
        self.corrected = Some((change, step));
        self.trial.residual = if step == change {
            residual
        } else {
            self.trial.residual + step
        };
        servo.tick.add_to_end(&mut self.trial.x, 1, step);
        self.limit(self.dt);
        // NaN or infinity is not a small share.
        if change.is_finite() {
            change.abs() / size
        } else {
            f64::INFINITY
        }
    }

    /// True if the committed state is at the end of the stroke, and the cylinder presses it there. If it leaves within a tick, it
    /// stays to the end of that tick: the loss is at most the cube of a tick of its path. Real-time: yes.
    fn is_pressed(&self, servo: &Servo) -> bool {
        let State { x, residual, .. } = &self.committed;
        let left = x[FORCE] - (servo.stiffness * x[DISP] + residual);
        x[DISP].abs() >= self.bounds.stroke && x[VEL] == 0.0 && left * x[DISP] > 0.0
    }

    fn limit(&mut self, dt: f64) {
        let Bounds {
            rate,
            stroke,
            force,
        } = self.bounds;
        let state = &mut self.trial;
        if let Dynamics::Servo(servo) = &self.dynamics {
            let excess = state.x[FORCE] - state.x[FORCE].clamp(-force, force);
            if excess != 0.0 {
                // The mass does not receive the force that the cylinder cannot give.
                if !self.stopped {
                    servo.tick.add_to_end(&mut state.x, 1, excess);
                }
                state.x[FORCE] = force.copysign(excess);
                self.saturated = true;
            }
        } else if dt > 0.0 {
            let way = state.x[DISP] - self.committed.x[DISP];
            if way.abs() > rate * dt {
                state.x[DISP] = self.committed.x[DISP] + (rate * dt).copysign(way);
                state.x[VEL] = rate.copysign(way);
            }
        }
        self.saturated |= self.stopped;
        if state.x[DISP].abs() > stroke {
            let end = stroke.copysign(state.x[DISP]);
            if let Dynamics::Servo(servo) = &self.dynamics {
                // The displacement that it did not make has not bled the cylinder.
                state.x[FORCE] += servo.bled(state.x[DISP] - end);
                state.x[FORCE] = state.x[FORCE].clamp(-force, force);
                self.stopped = true;
            }
            state.x[DISP] = end;
            state.x[VEL] = 0.0;
            self.saturated = true;
        }
        self.disp = state.x[DISP];
        self.vel = state.x[VEL];
    }

    /// The actuator stalls: it stops after this share of the step. Real-time: yes.
    pub(crate) fn stall_at(&mut self, share: f64) {
        let before = self.committed.x[DISP];
        self.disp = before + share * (self.trial.x[DISP] - before);
        self.vel = share * self.trial.x[VEL];
    }

    /// Force of the actuator, where it is part of the loop. At the end of the stroke the stop takes the force beyond the
    /// specimen's.
    pub(crate) fn force(&self) -> Option<f64> {
        (self.feels_the_specimen() && !self.stopped).then_some(self.trial.x[FORCE])
    }

    /// Real-time: yes.
    pub(crate) fn commit(&mut self, dt: f64) {
        self.primed = true;
        if dt > 0.0 {
            self.trial.x[DISP] = self.disp;
            self.trial.x[VEL] = self.vel;
            self.committed = self.trial;
        } else if matches!(self.dynamics, Dynamics::Direct(_)) {
            self.committed.x[DISP] = self.disp;
            self.committed.drive = self.trial.drive;
        } else {
            self.committed.drive = self.trial.drive;
        }
        self.delay.commit(self.command, dt);
    }
}

impl Dynamics {
    const fn name(&self) -> &'static str {
        match self {
            Self::Direct(_) => "direct",
            Self::First(..) => "first_order",
            Self::Second(..) => "second_order",
            Self::Servo(_) => "servo_hydraulic",
        }
    }

    fn lay_out(&mut self, dt: f64) {
        match self {
            Self::Direct(_) => {}
            Self::First(spec, tick) => {
                let per_tick = dt / spec.time_constant_s;
                *tick = Ramped::new::<3>(&[[-per_tick]], &[[spec.gain * per_tick]], &[1.0]);
            }
            Self::Second(spec, tick) => {
                let omega = 2.0 * std::f64::consts::PI * spec.frequency_hz;
                let square = omega * omega;
                let a = [
                    [0.0, dt],
                    [-square * dt, -2.0 * spec.damping_ratio * omega * dt],
                ];
                *tick = Ramped::new::<4>(&a, &[[0.0], [spec.gain * square * dt]], &[1.0, 1.0 / dt]);
            }
            Self::Servo(servo) => servo.lay_out(dt),
        }
    }
}
