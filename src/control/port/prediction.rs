//! Targets of another controller that comes late: between two of them the axes go on along a prediction, and slow down before they go too
//! far.
//!
//! Each target is judged when it comes, before the axes go there: the way to it, the way on from it, and the way to rest must keep the
//! limits. So no command that the pacer makes is too fast, but for what a compensator adds.

use super::Stage;
use super::interpolation::{Order, PathPoint};
use super::late_pacer::{LatePacer, SlowDown};
use super::limits::Hit;
use super::received::ReceivedPort;
use super::step_pacer::PacerTick;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtStructure;

/// Places of a way at which it is judged.
const LOOKS: u32 = 16;

/// A command on the way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Made {
    /// Share of the step; 1 at the target.
    pub share: f64,
    /// Where it is in the chart.
    pub stage: Stage,
}

impl Made {
    /// True at the target.
    #[must_use]
    pub fn lands(&self) -> bool {
        self.share >= 1.0
    }
}

/// The way to rest after a target would lead too far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ahead {
    /// Axis, from 0.
    pub axis: usize,
    /// Distance beyond the target, m or rad of the specimen.
    pub way: f64,
    /// The largest allowed one.
    pub within: f64,
}

/// Why the axes do not go to a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// A limit, and how many times slower would keep it.
    Limit(Hit, f64),
    /// A place beyond a limit.
    Place(Hit),
    /// The way to rest.
    Ahead(Ahead),
}

/// The commands between received targets.
#[derive(Debug)]
pub struct Prediction {
    pacer: LatePacer,
    slow: SlowDown,
    order: Order,
    /// Wall time of a tick, s.
    tick_s: f64,
    /// Largest distance from the last target, for each axis in m or rad of the specimen.
    within: Vec<f64>,
    /// Time in s by which compensators lead a steady motion.
    lead_s: f64,
    /// It has come to rest since the last full pace in this step.
    has_rested: bool,
    /// Ticks without a command.
    waits: bool,
}

impl Prediction {
    /// At the first target, with ticks of `tick_s` s and compensators that lead by `lead_s`.
    #[must_use]
    pub fn new(slow: SlowDown, order: Order, [tick_s, lead_s]: [f64; 2], within: Vec<f64>) -> Self {
        Self {
            pacer: LatePacer::new(slow),
            slow,
            order,
            tick_s,
            lead_s,
            within,
            has_rested: true,
            waits: true,
        }
    }

    /// Nothing is known of an earlier motion.
    pub fn reset(&mut self) {
        self.pacer = LatePacer::new(self.slow);
        (self.has_rested, self.waits) = (true, true);
    }

    /// The axes rest at the first target.
    pub fn begin(&mut self, port: &mut ReceivedPort) {
        self.reset();
        port.0.rest_on_the_way();
    }

    /// Wall time of a step at full pace, s.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.tick_s * f64::from(self.slow.ticks)
    }

    /// Ticks of a step at full pace.
    #[must_use]
    pub const fn ticks(&self) -> u32 {
        self.slow.ticks
    }

    /// True if no motion is under way.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.waits || self.pacer.stands()
    }

    /// True if the axes have rested on the way to the last target. Real-time: yes.
    #[must_use]
    pub const fn has_rested(&self) -> bool {
        self.has_rested
    }

    /// The target that the port seeks is known, which is `step_s` s of the controller's time after the last. Real-time: yes.
    ///
    /// # Errors
    /// The way to it, or on from it, exceeds a limit: the axes do not go there.
    pub fn know(&mut self, port: &mut ReceivedPort, step_s: f64) -> Result<(), Refusal> {
        let share = if self.waits { 0.0 } else { self.pacer.share() };
        port.0.path.predict(self.order, step_s);
        port.0.know_on_the_way(share);
        if let Err(refusal) = self.judge(&port.0, share) {
            port.0.path.forget_goal();
            return Err(refusal);
        }
        self.has_rested = self.waits || self.pacer.stands();
        self.waits = false;
        self.pacer.know();
        Ok(())
    }

    /// Whether the ways to the target and on from it keep the limits.
    fn judge(&self, port: &super::Port, from: f64) -> Result<(), Refusal> {
        let width = self.slow.width() / f64::from(self.slow.ticks);
        for index in 0..port.axes.len() {
            let way = port.path.way();
            let target = way.at(index, 1.0).disp;
            let within = self.within.get(index).copied().unwrap_or(0.0);
            let mut bends = [None; 2];
            for look in 0..=LOOKS {
                let s = f64::from(look) / f64::from(LOOKS);
                let to = way.at(index, from + (1.0 - from) * s);
                let on = way.beyond(index, self.slow.until * s);
                let rest = way.beyond(index, width * s);
                let spans = [1.0 - from, self.slow.until];
                for ((point, span), before) in [to, on].iter().zip(spans).zip(&mut bends) {
                    let jerk = before.map_or(0.0, |before: f64| {
                        (point.bend - before).abs() * f64::from(LOOKS) / span
                    });
                    *before = Some(point.bend);
                    self.judge_point(port, index, point, jerk)?;
                }
                for point in [to, rest] {
                    judge_place(port, index, point.disp)?;
                }
                let lead = self.lead_s * rest.slope.abs() / self.step_s();
                let way = in_metres(port, index) * ((rest.disp - target).abs() + lead);
                if way > within {
                    let axis = index;
                    return Err(Refusal::Ahead(Ahead { axis, way, within }));
                }
            }
        }
        Ok(())
    }

    /// Speed and acceleration of a place of the way, whose bend changes by `jerk`, and of a slow-down there, with the lead of
    /// compensators.
    fn judge_point(
        &self,
        port: &super::Port,
        index: usize,
        point: &PathPoint,
        jerk: f64,
    ) -> Result<(), Refusal> {
        let Some(limits) = port.guard.declared().get(index) else {
            return Ok(());
        };
        let (metres, step_s) = (in_metres(port, index), self.step_s());
        let speed = metres * point.slope.abs() / step_s;
        let bend = metres * point.bend.abs() / (step_s * step_s);
        let slows = speed * self.slow.steepest() / self.tick_s;
        let jerk = metres * jerk / (step_s * step_s * step_s)
            + speed * self.slow.sharpest() / (self.tick_s * self.tick_s);
        let accel = bend + slows + self.lead_s * jerk;
        let led = speed + self.lead_s * (bend + slows);
        for (quantity, value) in [
            (Limit::CommandVel, led),
            (Limit::CommandStep, led * self.tick_s),
            (Limit::CommandAccel, accel),
        ] {
            let bound = limits.size(quantity).trip;
            if value > bound {
                let excess = value / bound;
                let slower = match quantity {
                    Limit::CommandAccel => excess.sqrt(),
                    _ => excess,
                };
                let hit = Hit::trip(index, quantity, value, bound);
                return Err(Refusal::Limit(hit, slower));
            }
        }
        Ok(())
    }

    /// Makes the next command of the port: none if nothing moves before the next target. Real-time: yes.
    pub fn next(&mut self, port: &mut ReceivedPort) -> Option<Made> {
        let port = &mut port.0;
        // The commands are strokes, whatever pose was sought last.
        port.leave_pose();
        if !self.pacer.knows() && !self.waits && self.leads_too_far(port) {
            self.pacer.slow_down();
        }
        let tick = if self.waits { None } else { self.pacer.next() };
        let Some(tick) = tick else {
            port.path.hold();
            self.has_rested = true;
            return None;
        };
        let known = self.pacer.knows();
        if tick.share >= 1.0 && !(known && tick.share == 1.0) {
            // A last way to rest passes the target.
            self.reached_by(port);
        }
        let share = self.pacer.share();
        let lands = known && tick.share == 1.0;
        let made = PacerTick {
            share: if lands { 1.0 } else { share },
            point: if tick.share > 1.0 {
                tick.point - f64::from(self.slow.ticks)
            } else {
                tick.point
            },
            ..tick
        };
        // Velocities are those of the wall clock.
        port.path
            .go_along(&made, self.step_s() / tick.pace, &port.axes);
        Some(Made {
            share: made.share,
            stage: made.stage,
        })
    }

    /// Whether a fall that begins after the next tick, and what the compensators lead, would go beyond the bound. Real-time: yes.
    fn leads_too_far(&self, port: &super::Port) -> bool {
        let tick = 1.0 / f64::from(self.slow.ticks);
        let (from, to) = (self.pacer.share(), self.pacer.rests_at() + tick);
        let commands = port.path.command().iter();
        let commands = commands.zip(port.path.target().disp.iter());
        commands
            .zip(&port.axes)
            .enumerate()
            .any(|(index, (((command, _), target), axis))| {
                let way = port.path.way();
                let last = way.at(index, 0.0).disp;
                let metres = in_metres(port, index);
                let of_target = axis.command(AtStructure(*target)).0;
                let lead = port.guard.metres_of(index) * (command - of_target).abs();
                let within = self.within.get(index).copied().unwrap_or(0.0);
                let mut lead = lead;
                (0..=LOOKS).any(|look| {
                    let share = from + (to - from) * f64::from(look) / f64::from(LOOKS);
                    let point = way.at(index, share);
                    lead = lead.max(metres * self.lead_s * point.slope.abs() / self.step_s());
                    metres * (point.disp - last).abs() + lead > within
                        || judge_place(port, index, point.disp).is_err()
                })
            })
    }

    /// The command at the target has left and was answered. Real-time: yes.
    pub fn reached(&mut self, port: &mut ReceivedPort) {
        self.reached_by(&mut port.0);
    }

    fn reached_by(&mut self, port: &mut super::Port) {
        port.path.reach();
        self.pacer.begin();
    }

    /// No further target will come. Real-time: yes.
    pub fn end(&mut self) {
        self.pacer.end();
    }
}

/// Metres (or radians) of the specimen in one of the structure.
fn in_metres(port: &super::Port, index: usize) -> f64 {
    let gain = port.axes.get(index).map_or(f64::NAN, |axis| axis.disp_gain);
    gain.abs() * port.guard.metres_of(index)
}

/// Judges where an axis would rest.
fn judge_place(port: &super::Port, index: usize, disp: f64) -> Result<(), Refusal> {
    let (Some(axis), Some(limits)) = (port.axes.get(index), port.guard.declared().get(index))
    else {
        return Ok(());
    };
    let value = axis.command(AtStructure(disp)).0 * port.guard.metres_of(index);
    let [low, high] = limits.get(Limit::CommandDisp).trip;
    if value >= low && value <= high {
        return Ok(());
    }
    let bound = if value > high { high } else { low };
    let hit = Hit::trip(index, Limit::CommandDisp, value, bound);
    Err(Refusal::Place(hit))
}
