//! How a port is left: where its specimen is moved, slowly, when a test is over or has tripped.
//!
//! The default is to freeze, since driving a damaged specimen home can destroy it. Anything else is asked for by name, and
//! needs a speed. Works from the last command and measurement alone.
//!
//! The way to zero force goes by what is measured on it ([`super::unloading`]), and rests while an answer stays away. It is not
//! gone where a load cell came out of its range: the ways to a displacement do not go by that.
//!
//! The way out keeps the limits of the commands, or it would end itself where it began: it starts from rest, since nobody
//! judges the stop, and takes as long as half of `command_accel_m_per_s2` wants. What is estimated of a running test rests.

use crate::catalog::limit::Limit;
use std::f64::consts::{FRAC_PI_2, PI};

use super::Port;
use super::posed::Posed;
use super::unloading::{Along, Astray, Leg, Unloading};

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

/// Share of an acceleration limit that it uses at its fastest.
const SHARE_OF_ACCEL: f64 = 0.5;

/// A port on its way out.
#[derive(Debug)]
pub enum Departure {
    /// To displacements.
    Ramp {
        /// Of how many ticks.
        ticks: u64,
        /// The tick.
        tick: u64,
        /// The same as time in s.
        seconds: f64,
        /// At its end.
        arrived: bool,
    },
    /// To zero force.
    Unload {
        /// The way.
        unloading: Box<Unloading>,
        /// How a platform goes it.
        along: Option<Box<Along>>,
    },
}

impl Departure {
    /// Its end: where the specimen is to be left, or why it is somewhere else. None before it, and where something else ends it.
    #[must_use]
    pub fn end(&self) -> Option<Result<(), Astray>> {
        match self {
            Self::Ramp { arrived, .. } => arrived.then_some(Ok(())),
            Self::Unload { unloading, .. } => unloading.end(),
        }
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
        let limit = self.limits().get(axis);
        limit.map_or(f64::INFINITY, |limits| {
            SHARE_OF_ACCEL * limits.size(Limit::CommandAccel).lower()
        })
    }

    /// Time in s of a way of `distance` m along half a cosine, at most at `speed` in m/s and with the acceleration that an axis
    /// may use.
    pub(super) fn cosine_time(&self, axis: usize, distance: f64, speed: f64) -> f64 {
        // Half a cosine is π/2 times as fast in the middle as on the average, and π²/2 D/T² are its ends.
        let by_speed = FRAC_PI_2 * distance / speed;
        by_speed.max(PI * (0.5 * distance / self.exit_accel(axis)).sqrt())
    }

    /// It stops where it is, and its own end judges what comes next from rest, as this one does. A link that is lost shows with
    /// the next command.
    pub fn halt(&mut self) {
        if self.has_begun() {
            let _ = self.substructure.halt();
        }
    }

    /// Begins to leave with ticks of `tick` seconds of wall time; none where the specimen is to stay.
    pub fn depart(&mut self, tripped: bool, tick: f64) -> Option<Departure> {
        let (exit, speed) = (self.exits.after(tripped).clone(), self.exits.speed);
        self.leave_pose();
        let goal = match exit {
            Exit::Freeze => return None,
            Exit::ZeroForce => {
                return Some(self.unload(speed, tick));
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
        Some(Departure::Ramp {
            ticks: (seconds / tick).ceil() as u64,
            tick: 0,
            seconds: seconds.max(tick),
            arrived: false,
        })
    }

    fn unload(&self, speed: f64, tick: f64) -> Departure {
        let legs = (0..self.axes()).map(|axis| self.leg(axis, speed, tick));
        let mut legs: Vec<Leg> = legs.collect();
        let mut along = self.way_along();
        if let Some((along, geometry)) = along.as_mut().zip(self.geometry()) {
            let slower = along.slower(legs.iter().map(|leg| leg.by_speed));
            let turned = along.forces(geometry, &self.force);
            for ((leg, turned), force) in legs.iter_mut().zip(turned).zip(&self.force) {
                leg.by_speed *= slower;
                leg.slew *= slower;
                if let Some([before, _]) = &mut leg.jump {
                    *before += turned - force;
                }
            }
        }
        let unloading = Unloading::new(legs, self.declared_stiffness(), tick);
        Departure::Unload {
            unloading: Box::new(unloading),
            along: along.map(Box::new),
        }
    }

    /// What is known of an axis before it is unloaded.
    fn leg(&self, index: usize, speed: f64, tick: f64) -> Leg {
        let plain = super::Axis::plain(Vec::new());
        let axis = self.axes.get(index).unwrap_or(&plain);
        let (metres, newtons) = self.units().get(index).copied().unwrap_or((1.0, 1.0));
        let force = |raw: f64| axis.at_structure(0.0, raw / newtons).1;
        // Of the specimen's displacement in m.
        let disp = 1.0 / (metres * axis.disp_gain.abs());
        let limits = self.limits().get(index);
        let meant = limits.map_or([f64::NEG_INFINITY, f64::INFINITY], |limits| {
            limits.get(Limit::MeasuredForce).trip
        });
        let [one, other] = meant.map(force);
        let jump = self.guard.watch.jump(index);
        Leg {
            largest: self.carried.get(index).map_or(0.0, |force| force.abs()),
            noise: (axis.force_gain * self.reading(index).force_noise).abs(),
            meant: [one.min(other), one.max(other)],
            jump: jump
                .map(|[before, most]| [force(before), (axis.force_gain * most / newtons).abs()]),
            by_speed: speed * tick * disp,
            slew: self.exit_accel(index) * tick * tick * disp,
        }
    }

    /// Makes the next command of the departure; false when there is no further to go.
    pub fn go_on(&mut self, departure: &mut Departure) -> bool {
        match departure {
            Departure::Ramp {
                ticks,
                tick,
                seconds,
                arrived,
            } => {
                if *tick >= *ticks {
                    *arrived = true;
                    self.stand_still();
                    return false;
                }
                *tick += 1;
                self.ramp_to(*tick as f64 / *ticks as f64, *seconds);
                true
            }
            Departure::Unload { unloading, along } => {
                // What was measured last, before its first command, is of the test.
                let is_known = !unloading.is_new() && self.is_fresh();
                let raw = self.raw.disp.iter().zip(&self.raw.force);
                let answers = self.axes.iter().zip(raw);
                let answers = answers.map(|(axis, (disp, force))| axis.at_structure(*disp, *force));
                let answers = is_known.then_some(answers);
                let posed = self.posed.as_deref().map(Posed::geometry);
                let Some((along, geometry)) = along.as_deref_mut().zip(posed) else {
                    let goes_on = unloading.go_on(answers);
                    self.go_back(unloading.steps());
                    return goes_on;
                };
                let answers = answers.and_then(|answers| along.answer(geometry, answers).ok());
                let goes_on = unloading.go_on(answers);
                let steps = along.go_back(geometry, unloading.steps());
                self.go_back(steps.into_iter());
                goes_on
            }
        }
    }

    /// The next command is by so many m of the structure's behind the last.
    fn go_back(&mut self, steps: impl Iterator<Item = f64>) {
        let commands = self.command.iter_mut().zip(&mut self.command_vel);
        let steps = self.sent.iter().zip(&self.axes).zip(steps);
        for ((command, vel), ((sent, axis), step)) in commands.zip(steps) {
            *command = sent - axis.disp_gain * step;
            *vel = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::port::Axis;
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

    /// With k̂, and these commands on their way; a trip leads it to zero force.
    fn sprung(stiffness: f64, commands: Vec<f64>, noise: f64) -> Port {
        let axis = Axis::plain(vec![(0, 1.0)]);
        let spring = Box::new(Spring {
            commands: VecDeque::from(commands),
            noise,
            phase: 0.0,
        });
        let mut port = Port::new("rig", vec![axis], spring, 1, vec![stiffness]).unwrap();
        port.exits.on_trip = Exit::ZeroForce;
        port.exits.speed = 0.05;
        port
    }

    fn noisy_to_zero_force(stiffness: f64, tick: f64, late: usize, noise: f64) -> Way {
        let mut port = sprung(stiffness, vec![0.01; late + 1], noise);
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
        let (end, arrived) = (port.sent[0], departure.end() == Some(Ok(())));
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
        // 5 mm at 50 mm/s, and from 50 mm/s · 0.1 s = 5 mm to 0.1 mm with a time constant of 0.1 s; small for 0.1 s,
        // and as long before it moves.
        assert!((650..800).contains(&way.ticks), "{}", way.ticks);
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

    /// 20 N are none beside 2 kN in the test, however small the force is where it ended.
    #[test]
    fn a_force_that_is_small_beside_the_largest_of_the_test_is_none() {
        let mut port = sprung(2e5, vec![0.0], 0.0);
        let exchange = |port: &mut Port| {
            assert_eq!(port.clear().trip, None);
            port.issue(0, 0.0, TICK).unwrap();
            port.collect(Nanos(0)).unwrap();
            port.note_peak();
        };
        for disp in [0.01, 0.9e-4] {
            port.aim(&[disp], &[0.0], 0.0, 0.0);
            exchange(&mut port);
        }
        let mut departure = port.depart(true, TICK).unwrap();
        while port.go_on(&mut departure) {
            exchange(&mut port);
        }
        assert_eq!(departure.end(), Some(Ok(())));
        assert_eq!(port.sent[0], 0.9e-4, "nothing has moved");
    }

    #[test]
    fn without_a_stiffness_there_is_no_way_to_zero_force() {
        // Two blocks to see that there is a force, and one to see that nobody moves.
        let way = to_zero_force(0.0, TICK, 0);
        assert_eq!((way.end, way.arrived), (0.01, false));
        assert!(way.ticks < 200, "{}", way.ticks);
    }
}
