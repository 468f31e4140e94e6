//! The look at one specimen, tick by tick: past values, differences, and what was warned of already.

use super::{AxisLimits, Bound, Found, Hit, Level, Quantity, Range};

/// Beyond so many times the value that tripped, it trips again.
const WORSE: f64 = 1.05;

/// What is remembered of one axis, SI.
#[derive(Debug, Clone, Copy, Default)]
struct Past {
    /// Commands that left: the last, and the one before.
    command: [f64; 2],
    /// Speed of the last command.
    speed: f64,
    measured: f64,
    force: f64,
    stuck_ticks: u64,
    stuck_travel: f64,
    sawtooth: Sawtooth,
    /// One bit per quantity that is beyond its warning level.
    warned: u32,
    /// What has tripped, and how far it was: no further trip until it gets worse.
    excused: Option<(Quantity, f64)>,
}

/// Watches the limits of one specimen. Real-time after `new`.
#[derive(Debug, Clone)]
pub struct Watch {
    limits: Vec<AxisLimits>,
    past: Vec<Past>,
    /// Wall time of one tick in s.
    tick: f64,
    /// Commands that have left, up to two: a difference needs something to differ from.
    sent: u8,
    measured: bool,
    /// Whether targets are told apart from commands, which may go on a smooth way between them.
    aims: bool,
}

impl Watch {
    /// For axes with these limits, and ticks of `tick` seconds of wall time.
    #[must_use]
    pub fn new(limits: Vec<AxisLimits>, tick: f64) -> Self {
        Self {
            past: vec![Past::default(); limits.len()],
            limits,
            tick,
            sent: 0,
            measured: false,
            aims: false,
        }
    }

    /// The limits, one per axis.
    #[must_use]
    pub fn limits(&self) -> &[AxisLimits] {
        &self.limits
    }

    /// Wall time in s from the last command to the next, where it is not always the same. Real-time: yes.
    pub fn tick_is(&mut self, tick: f64) {
        self.tick = tick;
    }

    /// The specimen is known to stand at `disp`: the first command is a step from there.
    pub fn stands_at(&mut self, disp: impl Iterator<Item = f64>) {
        for (past, disp) in self.past.iter_mut().zip(disp) {
            past.command = [disp; 2];
            past.sawtooth = Sawtooth::at_rest(disp);
        }
        self.sent = 2;
    }

    /// Judges the next command, one displacement per axis, before it leaves. Real-time: yes.
    pub fn command(&mut self, disp: impl Iterator<Item = f64>) -> Found {
        let mut found = Found::default();
        let (tick, sent) = (self.tick, self.sent);
        let axes = self.limits.iter().zip(&mut self.past).zip(disp);
        for (axis, ((limits, past), disp)) in axes.enumerate() {
            let [last, before] = past.command;
            let sawtooth = past.sawtooth.after(disp, limits.alternating_floor);
            let sawtooth = if self.aims { past.sawtooth } else { sawtooth };
            let alternating = sawtooth.ticks as f64;
            let mut look = Look {
                axis,
                warned: &mut past.warned,
                excused: past.excused,
                found: &mut found,
            };
            look.at(Quantity::CommandDisp, disp, &limits.command_disp);
            if sent >= 1 {
                let step = (disp - last).abs();
                look.at(Quantity::CommandStep, step, &limits.command_step);
                let vel = step / tick;
                look.at(Quantity::CommandVel, vel, &limits.command_vel);
            }
            if sent >= 2 {
                let accel = (disp - 2.0 * last + before).abs() / (tick * tick);
                look.at(Quantity::CommandAccel, accel, &limits.command_accel);
            }
            look.at(
                Quantity::Alternation,
                alternating,
                &limits.alternating_ticks,
            );
        }
        found
    }

    /// Takes note of a command that leaves. Real-time: yes.
    pub fn sent(&mut self, disp: impl Iterator<Item = f64>) {
        let axes = self.past.iter_mut().zip(&self.limits).zip(disp);
        for ((past, limits), disp) in axes {
            if !self.aims {
                past.sawtooth = past.sawtooth.after(disp, limits.alternating_floor);
            }
            past.speed = if self.sent >= 1 {
                (disp - past.command[0]).abs() / self.tick
            } else {
                0.0
            };
            past.stuck_travel += (disp - past.command[0]).abs();
            past.command = [disp, past.command[0]];
        }
        self.sent = (self.sent + 1).min(2);
    }

    /// A specimen that has tripped is on its way back: what it tripped at counts again only if it gets worse.
    pub fn excuse(&mut self, hit: &Hit) {
        if let Some(past) = self.past.get_mut(hit.axis) {
            past.excused = Some((hit.quantity, WORSE * hit.value.abs()));
        }
    }

    /// Targets of steps are told from here on, and stand at `disp`: a sawtooth is looked for in them.
    pub fn aims_from(&mut self, disp: impl Iterator<Item = f64>) {
        for (past, disp) in self.past.iter_mut().zip(disp) {
            past.sawtooth = Sawtooth::at_rest(disp);
        }
        self.aims = true;
    }

    /// The target of the next step, which the next commands approach. Real-time: yes.
    pub fn aims_at(&mut self, disp: impl Iterator<Item = f64>) {
        let axes = self.past.iter_mut().zip(&self.limits).zip(disp);
        for ((past, limits), disp) in axes {
            past.sawtooth = past.sawtooth.after(disp, limits.alternating_floor);
        }
    }

    /// Takes note that the last command leaves once more. Real-time: yes.
    pub fn sent_again(&mut self) {
        for past in &mut self.past {
            past.speed = 0.0;
            past.command = [past.command[0]; 2];
            if !self.aims {
                past.sawtooth = Sawtooth::at_rest(past.command[0]);
            }
        }
    }

    /// The next measurement is the first: it can neither jump nor be stuck. Real-time: yes.
    pub fn forget_measurements(&mut self) {
        self.measured = false;
        for past in &mut self.past {
            (past.stuck_ticks, past.stuck_travel) = (0, 0.0);
        }
    }

    /// Judges a fresh measurement: (displacement, force) per axis. Real-time: yes.
    pub fn measured(&mut self, values: impl Iterator<Item = (f64, f64)>) -> Found {
        let mut found = Found::default();
        let seen_before = self.measured;
        let axes = self.limits.iter().zip(&mut self.past).zip(values);
        for (axis, ((limits, past), (disp, force))) in axes.enumerate() {
            let moved = disp.to_bits() != past.measured.to_bits()
                || force.to_bits() != past.force.to_bits();
            if moved || !seen_before {
                (past.stuck_ticks, past.stuck_travel) = (0, 0.0);
            } else if past.stuck_travel > limits.stuck_travel {
                past.stuck_ticks += 1;
            }
            let stuck = past.stuck_ticks as f64;
            let jump = (force - past.force).abs();
            let error = (disp - past.command[0]).abs();
            // The share of motion is taken off, so that both levels get the same.
            let error = error - limits.following_time * past.speed;
            let mut look = Look {
                axis,
                warned: &mut past.warned,
                excused: past.excused,
                found: &mut found,
            };
            // A sensor at the end of its range comes first: what it reads is not what is.
            look.at(Quantity::SensorDisp, disp, &limits.sensor_disp);
            look.at(Quantity::SensorForce, force, &limits.sensor_force);
            look.at(Quantity::MeasuredDisp, disp, &limits.measured_disp);
            look.at(Quantity::MeasuredForce, force, &limits.measured_force);
            look.at(Quantity::FollowingError, error, &limits.following_error);
            if seen_before {
                look.at(Quantity::ForceStep, jump, &limits.force_step);
                look.at(Quantity::StuckSensor, stuck, &limits.stuck_ticks);
            }
            past.measured = disp;
            past.force = force;
        }
        self.measured = true;
        found
    }

    /// Judges what was estimated from the measurements, one entry per axis, and adds it to `found`. What is not known is not
    /// a finite number and is not judged. Real-time: yes.
    pub fn estimated(&mut self, values: impl Iterator<Item = Estimated>, found: &mut Found) {
        self.known(values, found, |limits, values| {
            [
                (
                    Quantity::StiffnessRatio,
                    values.stiffness_ratio,
                    limits.stiffness_ratio,
                ),
                (
                    Quantity::DampingRatio,
                    values.damping_ratio,
                    limits.damping_ratio,
                ),
                (
                    Quantity::AddedEnergy,
                    values.added_energy,
                    limits.added_energy,
                ),
            ]
        });
    }

    /// Judges |lag| in s and |gain − 1| behind the targets, one pair per axis, and adds it to `found`. What is not known is
    /// not a finite number and is not judged. Real-time: yes.
    pub fn tracked(&mut self, values: impl Iterator<Item = (f64, f64)>, found: &mut Found) {
        self.known(values, found, |limits, (lag, gain_error)| {
            [
                (Quantity::Lag, lag, limits.lag),
                (Quantity::GainError, gain_error, limits.gain_error),
            ]
        });
    }

    /// Judges what is known of the quantities that `of` names, axis by axis.
    fn known<V, const N: usize>(
        &mut self,
        values: impl Iterator<Item = V>,
        found: &mut Found,
        of: impl Fn(&AxisLimits, V) -> [(Quantity, f64, Bound); N],
    ) {
        let axes = self.limits.iter().zip(&mut self.past).zip(values);
        for (axis, ((limits, past), values)) in axes.enumerate() {
            let mut look = Look {
                axis,
                warned: &mut past.warned,
                excused: past.excused,
                found,
            };
            for (quantity, value, bound) in of(limits, values) {
                if value.is_finite() {
                    look.at(quantity, value, &bound);
                }
            }
        }
    }
}

/// What is estimated of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// Tangent stiffness over its declared bound.
    pub stiffness_ratio: f64,
    /// Tangent damping over its declared bound.
    pub damping_ratio: f64,
    /// Energy that the transfer system has added, J.
    pub added_energy: f64,
}

/// A sequence of displacements whose second differences may alternate and grow.
#[derive(Debug, Clone, Copy, Default)]
struct Sawtooth {
    /// The last, and the one before; as many as there were, up to two.
    disp: [f64; 2],
    seen: u8,
    /// Their second difference, and for how long it has changed its sign and grown.
    bend: f64,
    ticks: u64,
}

impl Sawtooth {
    const fn at_rest(disp: f64) -> Self {
        Self {
            disp: [disp; 2],
            seen: 2,
            bend: 0.0,
            ticks: 0,
        }
    }

    /// With one more. Real-time: yes.
    fn after(&self, disp: f64, floor: f64) -> Self {
        let [last, before] = self.disp;
        let mut next = Self {
            disp: [disp, last],
            seen: (self.seen + 1).min(2),
            ..Self::default()
        };
        if self.seen == 2 {
            next.bend = disp - 2.0 * last + before;
            // By sign and not by product, which underflows.
            let turns = self.bend != 0.0 && (self.bend > 0.0) != (next.bend > 0.0);
            if turns && next.bend.abs() > floor && next.bend.abs() > self.bend.abs() {
                next.ticks = self.ticks + 1;
            }
        }
        next
    }
}

/// What a value is judged by.
trait Limit {
    /// What `value` is beyond, and the bound. Real-time: yes.
    fn judge(&self, value: f64) -> Option<(Level, f64)>;
}

impl Limit for Bound {
    fn judge(&self, value: f64) -> Option<(Level, f64)> {
        Bound::judge(*self, value)
    }
}

impl Limit for Range {
    fn judge(&self, value: f64) -> Option<(Level, f64)> {
        Range::judge(self, value)
    }
}

/// The look at one axis.
struct Look<'a> {
    axis: usize,
    warned: &'a mut u32,
    excused: Option<(Quantity, f64)>,
    found: &'a mut Found,
}

impl Look<'_> {
    fn is_excused(&self, quantity: Quantity, value: f64) -> bool {
        self.excused
            .is_some_and(|(excused, worst)| excused == quantity && value.abs() <= worst)
    }

    /// Judges `value`; keeps the first trip, and the first warning that is new.
    fn at(&mut self, quantity: Quantity, value: f64, limit: &impl Limit) {
        let bit = quantity.bit();
        let Some((level, bound)) = limit.judge(value) else {
            *self.warned &= !bit;
            return;
        };
        let hit = Hit {
            axis: self.axis,
            quantity,
            level,
            value,
            bound,
        };
        match level {
            Level::Trip if self.is_excused(quantity, value) => {}
            Level::Trip => {
                self.found.trip.get_or_insert(hit);
            }
            // A second new warning of the same tick is given in the next: its bit is not set yet.
            Level::Warning if *self.warned & bit == 0 && self.found.warning.is_none() => {
                *self.warned |= bit;
                self.found.warning = Some(hit);
            }
            Level::Warning => {}
        }
    }
}
