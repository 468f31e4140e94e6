//! How a port is left: where its specimen is moved, slowly, when a test is over or has tripped.
//!
//! The default is to freeze, since driving a damaged specimen home can destroy it. Anything else is asked for by name, and
//! needs a speed. Works from the last command and measurement alone.
//!
//! The way to zero force goes by what is measured on it: it begins with the first force that is measured at rest, since the one
//! before may be what tripped the test, and it rests while an answer stays away. An actuator answers late: the approach is so slow
//! that it does not swing behind one, and ends where the force has been small for longer than it is late. It is not gone where a
//! load cell came out of its range: the ways to a displacement do not go by that.
//!
//! The way out keeps the limits of the commands, or it would end itself where it began: it starts from rest, since nobody
//! judges the stop, and takes as long as half of `command_accel_m_per_s2` wants. What is estimated of a running test rests.

use std::f64::consts::{FRAC_PI_2, PI};

use super::Port;

/// Where a specimen is left.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Exit {
    /// Where it is.
    #[default]
    Freeze,
    /// Where its forces are small: the command creeps against the measured force.
    ZeroForce,
    /// At zero deformation.
    ZeroDisp,
    /// At these displacements, one per axis, in the specimen's unit.
    Safe(Vec<f64>),
}

/// Where and how fast.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Exits {
    /// After a trip.
    pub on_trip: Exit,
    /// After the last step, or when the operator ends the test.
    pub at_end: Exit,
    /// Largest speed of either in m/s of the specimen.
    pub speed: f64,
}

impl Exits {
    /// Where a specimen is left when a test has tripped, or has ended well.
    #[must_use]
    pub const fn after(&self, tripped: bool) -> &Exit {
        if tripped { &self.on_trip } else { &self.at_end }
    }

    /// True if it is to be moved there.
    #[must_use]
    pub fn moves(&self, tripped: bool) -> bool {
        *self.after(tripped) != Exit::Freeze
    }
}

/// Longest way back to zero force, in s of wall time.
const LONGEST_S: f64 = 120.0;
/// Time constant in s of the approach to zero force, and the largest share of the way, by k̂, that one tick goes. Behind a delay
/// of up to 1/e of it the approach does not go beyond, and it dies out behind one of up to π/2 of it.
const APPROACH_S: f64 = 0.1;
const SHARE: f64 = 0.05;
/// A force is small where its mean over this time in s is so twice in a row: a single answer may be a glitch, or noise.
const BLOCK_S: f64 = 0.05;
const BLOCKS: u32 = 2;
/// Share of an acceleration limit that it uses at its fastest.
const SHARE_OF_ACCEL: f64 = 0.5;
/// Share of the largest force so far, that on the way out included, that counts as none.
const SMALL: f64 = 0.01;
/// So many times the noise of the force, as it was read while zeroing, counts as none, too.
const NOISE: f64 = 3.0;
/// The way back to zero force may be so many times as long as k̂ says.
const STRAY: f64 = 3.0;

/// One axis on its way to zero force.
#[derive(Debug, Clone, Copy, Default)]
struct Creep {
    /// k̂ in raw units of force per raw unit of displacement.
    stiffness: f64,
    /// Of the way, that one tick goes at most.
    share: f64,
    /// Largest |force| of the test in raw units, without what stopped it.
    largest: f64,
    small: f64,
    /// Of the answers of the block so far.
    sum: f64,
    /// Ways in the specimen's unit: of one tick, by which that may change from tick to tick, and the last.
    longest_step: f64,
    slew: f64,
    step: f64,
    farthest: f64,
    from: f64,
}

/// A port on its way out.
#[derive(Debug)]
pub struct Departure {
    creeps: Vec<Creep>,
    /// For displacements: ticks of the ramp, and the tick.
    ticks: u64,
    tick: u64,
    to_zero_force: bool,
    /// To zero force: it is known how far that is.
    begun: bool,
    seconds: f64,
    /// To zero force: answers of the block so far, those of a whole one, and how many blocks in a row were small in all forces.
    answers: u32,
    of_a_block: u32,
    small_blocks: u32,
    arrived: bool,
}

impl Departure {
    /// True if the specimen is where it is to be left.
    #[must_use]
    pub const fn has_arrived(&self) -> bool {
        self.arrived
    }

    /// An answer on the way to zero force was taken.
    fn count(&mut self) {
        self.answers += 1;
        if self.answers < self.of_a_block {
            return;
        }
        let answers = f64::from(std::mem::take(&mut self.answers));
        let mut all_small = true;
        for creep in &mut self.creeps {
            let sum = std::mem::take(&mut creep.sum);
            all_small &= (sum / answers).abs() <= creep.small;
        }
        self.small_blocks = if all_small { self.small_blocks + 1 } else { 0 };
        self.arrived = self.small_blocks >= BLOCKS;
    }
}

impl Port {
    /// The test is over: the last command counts as one at rest, and nothing is estimated from here on. Whoever owes an answer
    /// is told nothing before it has given it.
    pub fn end_test(&mut self) {
        self.partner.owes_the_last = self.owes();
        self.await_what_is_owed();
        self.guard.watch.rests();
        self.rest();
        self.pause_following();
    }

    /// True if what its way out goes by is known: no force that its load cell cannot read.
    #[must_use]
    pub fn can_be_led(&self, tripped: bool) -> bool {
        !(self.partner.unfelt && *self.exits.after(tripped) == Exit::ZeroForce)
    }

    /// Acceleration in m/s² that a way in or out may use on an axis.
    fn exit_accel(&self, axis: usize) -> f64 {
        let limit = self.limits().get(axis).map(|limits| limits.command_accel);
        limit.map_or(f64::INFINITY, |limit| {
            SHARE_OF_ACCEL * limit.warn.min(limit.trip)
        })
    }

    /// Time in s of a way of `distance` m along half a cosine, at most at `speed` in m/s and with the acceleration that an axis
    /// may use.
    pub(super) fn cosine_time(&self, axis: usize, distance: f64, speed: f64) -> f64 {
        // Half a cosine is π/2 times as fast in the middle as on the average, and π²/2 D/T² are its ends.
        let by_speed = FRAC_PI_2 * distance / speed;
        by_speed.max(PI * (0.5 * distance / self.exit_accel(axis)).sqrt())
    }

    /// Begins to leave with ticks of `tick` seconds of wall time; none where the specimen is to stay.
    pub fn depart(&mut self, tripped: bool, tick: f64) -> Option<Departure> {
        let (exit, speed) = (self.exits.after(tripped).clone(), self.exits.speed);
        self.leave_pose();
        let goal = match exit {
            Exit::Freeze => return None,
            Exit::ZeroForce => {
                let creeps = (0..self.axes()).map(|axis| self.creep(axis, speed, tick));
                return Some(Departure {
                    creeps: creeps.collect(),
                    ticks: (LONGEST_S / tick) as u64,
                    tick: 0,
                    to_zero_force: true,
                    begun: false,
                    seconds: LONGEST_S,
                    answers: 0,
                    of_a_block: (BLOCK_S / tick).ceil() as u32,
                    small_blocks: 0,
                    arrived: false,
                });
            }
            Exit::ZeroDisp => self.axes.iter().map(|axis| axis.disp_offset).collect(),
            Exit::Safe(disp) => disp,
        };
        self.command.copy_from_slice(&goal);
        self.begin_ramp();
        let times = (0..self.axes()).map(|axis| {
            let distance = self.sent.get(axis).zip(self.command.get(axis));
            let distance = distance.map_or(0.0, |(from, to)| (to - from).abs());
            let distance = distance.max(self.steepest(axis)) * self.guard.metres_of(axis);
            self.cosine_time(axis, distance, speed)
        });
        let seconds = times.fold(0.0, f64::max);
        Some(Departure {
            creeps: Vec::new(),
            ticks: (seconds / tick).ceil() as u64,
            tick: 0,
            to_zero_force: false,
            begun: true,
            seconds: seconds.max(tick),
            answers: 0,
            of_a_block: 0,
            small_blocks: 0,
            arrived: false,
        })
    }

    fn creep(&self, index: usize, speed: f64, tick: f64) -> Creep {
        let value = |values: &[f64]| values.get(index).copied().unwrap_or(0.0);
        let Some(axis) = self.axes.get(index) else {
            return Creep::default();
        };
        let change = self.exit_accel(index) * tick * tick;
        let share = SHARE.min(tick / APPROACH_S);
        Creep {
            share,
            stiffness: value(&self.stiffness) / (axis.force_gain * axis.disp_gain),
            largest: (value(&self.carried) / axis.force_gain).abs(),
            // The approach slows down by a share of its step from tick to tick.
            longest_step: (speed * tick).min(change / share) / self.guard.metres_of(index),
            slew: change / self.guard.metres_of(index),
            from: value(&self.sent),
            ..Creep::default()
        }
    }

    /// How far it is at most, and beside what it must be small, by the force that is measured at rest. What is beyond the bound at
    /// which it trips is taken for that: more than the specimen was meant to carry is more likely the sensor.
    fn begin(&self, creeps: &mut [Creep]) {
        let axes = self.axes.iter().zip(self.limits()).zip(self.units());
        let values = self.raw.force.iter().zip(axes);
        for (index, (creep, (raw, ((axis, limits), (_, newtons))))) in
            creeps.iter_mut().zip(values).enumerate()
        {
            let [least, most] = limits.measured_force.trip;
            let force = (raw * newtons).max(least).min(most) / newtons - axis.force_offset;
            let largest = creep.largest.max(force.abs());
            creep.small = (SMALL * largest).max(NOISE * self.reading(index).force_noise);
            // Without k̂ nobody knows how far it is, nor which way.
            let far = STRAY * (force / creep.stiffness).abs();
            creep.farthest = if far.is_finite() { far } else { 0.0 };
        }
    }

    /// Makes the next command of the departure; false when there is no further to go.
    pub fn go_on(&mut self, departure: &mut Departure) -> bool {
        if departure.tick >= departure.ticks {
            departure.arrived |= !departure.to_zero_force;
            self.stand_still();
            return false;
        }
        departure.tick += 1;
        if !departure.to_zero_force {
            let share = departure.tick as f64 / departure.ticks as f64;
            self.ramp_to(share, departure.seconds);
            return true;
        }
        // What was measured last, before its first command, is of the test.
        let is_known = departure.tick > 1 && self.is_fresh();
        if is_known && !departure.begun {
            departure.begun = true;
            self.begin(&mut departure.creeps);
        }
        // Who is there comes to rest, whatever noise says.
        let is_there = departure.arrived;
        let (mut moving, mut all_small) = (!is_known, is_known);
        let axes = self.axes.iter().zip(&mut departure.creeps);
        let values = self.sent.iter().zip(&self.raw.force);
        let commands = self.command.iter_mut().zip(&mut self.command_vel);
        for (((command, vel), (sent, raw)), (axis, creep)) in commands.zip(values).zip(axes) {
            let force = raw - axis.force_offset;
            let step = creep.share * force / creep.stiffness;
            let step = step.clamp(-creep.longest_step, creep.longest_step);
            let is_small = force.abs() <= creep.small;
            creep.sum += if is_known { force } else { 0.0 };
            let is_near = (sent - step - creep.from).abs() <= creep.farthest;
            let on = is_known && !is_there && !is_small && is_near;
            let wanted = if on { step } else { 0.0 };
            creep.step = wanted.clamp(creep.step - creep.slew, creep.step + creep.slew);
            *command = sent - creep.step;
            *vel = 0.0;
            moving |= on || creep.step != 0.0;
            all_small &= is_small;
        }
        if is_known && !is_there {
            departure.count();
        }
        moving || (all_small && !departure.arrived)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::control::Axis;
    use crate::substructure::{
        Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
    };
    use crate::time::Nanos;

    const TICK: f64 = 1e-3;

    /// A spring of 2e5 N/m behind an actuator that is so many commands late.
    struct Spring {
        commands: VecDeque<f64>,
        /// Amplitude in N of what is no force, and its phase.
        noise: f64,
        phase: f64,
    }

    impl Substructure for Spring {
        fn axes(&self) -> usize {
            1
        }
        fn coupling(&self) -> Coupling {
            Coupling::Lockstep
        }
        fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
            self.commands.rotate_left(1);
            *self.commands.back_mut().unwrap() = command.disp[0];
            Ok(())
        }
        fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
            self.phase += 2.4;
            (into.disp[0], into.force[0]) = (
                self.commands[0],
                2e5 * self.commands[0] + self.noise * self.phase.sin(),
            );
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    /// How a way to zero force went.
    struct Way {
        ticks: u32,
        /// The last command, and where the specimen was at least.
        end: f64,
        least: f64,
        arrived: bool,
    }

    /// From 10 mm, with k̂ as it is believed, before any force was noted, with ticks of so many seconds.
    fn to_zero_force(stiffness: f64, tick: f64, late: usize) -> Way {
        noisy_to_zero_force(stiffness, tick, late, 0.0)
    }

    fn noisy_to_zero_force(stiffness: f64, tick: f64, late: usize, noise: f64) -> Way {
        let axis = Axis::plain(vec![(0, 1.0)]);
        let spring = Box::new(Spring {
            commands: VecDeque::from(vec![0.01; late + 1]),
            noise,
            phase: 0.0,
        });
        let mut port = Port::new("rig", vec![axis], spring, 1, vec![stiffness]).unwrap();
        port.exits.on_trip = Exit::ZeroForce;
        port.exits.speed = 0.05;
        let exchange = |port: &mut Port| {
            assert_eq!(port.clear().trip, None);
            port.issue(0, 0.0, tick).unwrap();
            port.collect(Nanos(0)).unwrap();
            port.raw.disp[0]
        };
        port.aim(&[0.01], &[0.0], 0.0, 0.0);
        exchange(&mut port);
        let mut departure = port.depart(true, tick).unwrap();
        let (mut ticks, mut least) = (0, f64::INFINITY);
        while port.go_on(&mut departure) {
            least = exchange(&mut port).min(least);
            ticks += 1;
        }
        let (end, arrived) = (port.sent[0], departure.has_arrived());
        Way {
            ticks,
            end,
            least,
            arrived,
        }
    }

    #[test]
    fn the_way_to_zero_force_ends_where_the_force_is_small_beside_what_it_was() {
        let way = to_zero_force(2e5, TICK, 0);
        assert!(
            way.arrived && way.end > 0.0 && way.end <= 1e-4,
            "{}",
            way.end
        );
        // 5 mm at 50 mm/s, and from 50 mm/s · 0.1 s = 5 mm to 0.1 mm with a time constant of 0.1 s; small for 0.1 s.
        assert!((550..650).contains(&way.ticks), "{}", way.ticks);
    }

    #[test]
    fn an_actuator_that_is_late_is_led_to_zero_force_without_a_swing() {
        for tick in [2e-4, 1e-3, 5e-3] {
            for late_s in [5e-3, 0.02, 0.035] {
                let late = (late_s / tick) as usize;
                let way = to_zero_force(2e5, tick, late);
                let told = format!("tick {tick}, {late} late: {} to {}", way.least, way.end);
                assert!(way.arrived && way.end.abs() <= 1e-4, "{told}");
                assert!(way.least >= -1e-4, "{told}");
            }
        }
    }

    /// Fifty times what counts as none, and not there while zeroing: it is the mean that counts.
    #[test]
    fn noise_does_not_keep_it_from_its_end() {
        for late in [0, 20] {
            let way = noisy_to_zero_force(2e5, TICK, late, 1e3);
            assert!(way.arrived && way.ticks < 2000, "{}", way.ticks);
            assert!(way.end.abs() <= 3e-4, "{}", way.end);
        }
    }

    #[test]
    fn without_a_stiffness_there_is_no_way_to_zero_force() {
        // One to see that there is a force.
        let way = to_zero_force(0.0, TICK, 0);
        assert_eq!((way.ticks, way.end, way.arrived), (1, 0.01, false));
    }
}
