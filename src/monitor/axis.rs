//! One axis of a specimen, row by row: present values, what its limits are held against, and its hysteresis loop.
//!
//! The values are those that the loop judges, found again from the rows; where a rule needs more than rows tell (a sawtooth
//! between targets) there is no value. Nothing here decides anything.

use super::board::AxisView;
use super::subject::WatchedAxis;
use super::tap::at;
use crate::control::limits::Quantity;

/// What one row says of an axis, SI at the specimen's own scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Now {
    pub command: f64,
    pub measured: f64,
    pub force: f64,
    pub error: f64,
}

/// Past values of an axis.
#[derive(Debug, Clone)]
pub(super) struct AxisTap {
    pub now: Now,
    tick_s: f64,
    /// Sequence number of the last row.
    sequence: Option<u64>,
    /// Change of the command in the last tick, if the row before was the one before.
    change: Option<f64>,
    force_change: f64,
    accel: f64,
    speed: f64,
    stuck: f64,
    travel: f64,
    stiffness: f64,
    tangent_damping: f64,
    added: f64,
    /// Largest tangents of the window before, and of this one.
    stiffest: [f64; 2],
    damping: [f64; 2],
    lag: f64,
    gain_error: f64,
    /// Present and smallest so far.
    margin: [f64; 2],
    limits: Vec<[f64; 3]>,
    /// Points of smallest and of largest displacement of the open bin, each with the order in which it came.
    ends: Option<[(u64, [f32; 2]); 2]>,
    points: u64,
}

impl AxisTap {
    pub fn new(axis: &WatchedAxis, tick_s: f64) -> Self {
        let none = f64::NAN;
        Self {
            now: Now {
                command: none,
                measured: none,
                force: none,
                error: none,
            },
            tick_s,
            sequence: None,
            change: None,
            force_change: none,
            accel: none,
            speed: 0.0,
            stuck: 0.0,
            travel: 0.0,
            stiffness: none,
            tangent_damping: none,
            added: none,
            stiffest: [none; 2],
            damping: [none; 2],
            lag: none,
            gain_error: none,
            margin: [none; 2],
            limits: vec![[none; 3]; axis.marks.len()],
            ends: None,
            points: 0,
        }
    }

    pub fn row(&mut self, sequence: u64, row: &[f64], axis: &WatchedAxis) {
        let places = &axis.places;
        let command = at(row, places.command) * axis.metres;
        let measured = at(row, places.raw_disp) * axis.metres;
        let force = at(row, places.raw_force) * axis.newtons;
        let before = self.now;
        let follows = self.sequence.is_some_and(|last| last + 1 == sequence);
        self.sequence = Some(sequence);
        let change = follows.then_some(command - before.command);
        self.accel = match (change, self.change) {
            (Some(now), Some(before)) => (now - before).abs() / (self.tick_s * self.tick_s),
            _ => f64::NAN,
        };
        self.change = change;
        self.speed = change.map_or(0.0, |change| change.abs() / self.tick_s);
        self.force_change = if follows {
            (force - before.force).abs()
        } else {
            f64::NAN
        };
        let moved = measured.to_bits() != before.measured.to_bits()
            || force.to_bits() != before.force.to_bits();
        // As long as the command does not travel an unchanged reading is none that is stuck.
        self.travel += change.map_or(0.0, f64::abs);
        if moved {
            (self.stuck, self.travel) = (0.0, 0.0);
        } else if self.travel > axis.stuck_travel {
            self.stuck += 1.0;
        }
        self.now = Now {
            command,
            measured,
            force,
            error: measured - command,
        };
        self.stiffness = at(row, places.stiffness);
        self.stiffest[1] = self.stiffest[1].max(self.stiffness);
        self.tangent_damping = at(row, places.damping);
        self.damping[1] = self.damping[1].max(self.tangent_damping);
        self.added = at(row, places.added);
        self.lag = at(row, places.lag).abs();
        self.gain_error = (at(row, places.gain) - 1.0).abs();
        let margin = at(row, places.margin);
        self.margin = [margin, self.margin[1].min(margin)];
        for place in 0..self.limits.len() {
            let mark = axis.marks.get(place).map(|mark| mark.quantity);
            let value = mark.map_or(f64::NAN, |quantity| self.value(quantity, axis));
            if let Some(kept) = self.limits.get_mut(place) {
                *kept = [value, kept[1].min(value), kept[2].max(value)];
            }
        }
        self.take_point(at(row, places.measured), at(row, places.force));
    }

    /// What a limit is held against.
    fn value(&self, quantity: Quantity, axis: &WatchedAxis) -> f64 {
        match quantity {
            Quantity::CommandDisp => self.now.command,
            Quantity::CommandStep => self.change.map_or(f64::NAN, f64::abs),
            Quantity::CommandVel => self.change.map_or(f64::NAN, |_| self.speed),
            Quantity::CommandAccel => self.accel,
            Quantity::MeasuredDisp | Quantity::SensorDisp => self.now.measured,
            Quantity::MeasuredForce | Quantity::SensorForce => self.now.force,
            Quantity::FollowingError => {
                (self.now.error.abs() - axis.following_time * self.speed).max(0.0)
            }
            Quantity::ForceStep => self.force_change,
            Quantity::StuckSensor => self.stuck,
            Quantity::StiffnessRatio => self.stiffness / axis.stiffness_bound,
            Quantity::DampingRatio => self.tangent_damping / axis.damping_bound,
            Quantity::AddedEnergy => self.added,
            Quantity::Lag => self.lag,
            Quantity::GainError => self.gain_error,
            Quantity::Alternation => f64::NAN,
        }
    }

    /// A point of the loop as the structure sees it.
    fn take_point(&mut self, disp: f64, force: f64) {
        let point = [disp as f32, force as f32];
        if !(point[0].is_finite() && point[1].is_finite()) {
            return;
        }
        self.points += 1;
        let new = (self.points, point);
        let [low, high] = self.ends.unwrap_or([new, new]);
        self.ends = Some([
            if point[0] < low.1[0] { new } else { low },
            if point[0] > high.1[0] { new } else { high },
        ]);
    }

    /// The ends of the loop in the bin that is closed.
    pub fn take_loop(&mut self) -> [[f32; 2]; 2] {
        match self.ends.take() {
            Some([low, high]) if low.0 <= high.0 => [low.1, high.1],
            Some([low, high]) => [high.1, low.1],
            None => [[f32::NAN; 2]; 2],
        }
    }

    /// Forgets the tangents of the window before the last.
    pub fn next_window(&mut self) {
        self.stiffest = [self.stiffest[1], f64::NAN];
        self.damping = [self.damping[1], f64::NAN];
    }

    pub fn view(&self) -> AxisView {
        AxisView {
            command: self.now.command,
            measured: self.now.measured,
            force: self.now.force,
            error: self.now.error,
            stiffness: self.stiffness,
            stiffest: self.stiffest[0].max(self.stiffest[1]),
            damping: self.damping[0].max(self.damping[1]),
            added: self.added,
            margin: self.margin,
            limits: self.limits.clone(),
        }
    }
}
