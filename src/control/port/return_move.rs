//! The return move: where a specimen is moved, slowly, when a test is over or has tripped.
//!
//! The default is to freeze: to drive a damaged specimen home can destroy it. The test file names every other end, with its
//! speed. The move works from the last command and the last measurement alone. It keeps the limits of commands, starts from rest, and
//! uses half of `command_accel_m_per_s2`. The way to zero force goes by measurements ([`super::unloading`]), and rests while an
//! answer stays away. Limits: a load cell out of its range forbids the way to zero force, not the ways to a displacement.

use super::axis::Axis;
use super::command_path::CommandPath;
use super::estimates::Observation;
use super::feedback::Feedback;
use super::guard::Guard;
use super::loading_unit::LoadingUnit;
use super::startup::Startup;
use super::unloading::{Leg, PlatformUnloading, UnloadFailure, Unloading};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::{AtAxis, AtSpecimen, AtStructure};

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
    Safe(AtAxis<Vec<f64>>),
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
    /// After a trip the commands come to rest within the limit of acceleration, as after a stop of the operator: a drive follows a
    /// command that freezes with a jump of its velocity.
    pub comes_to_rest: bool,
}

impl Exits {
    /// Where a specimen is left when a test has tripped, or has ended well.
    #[must_use]
    pub const fn after(&self, tripped: bool) -> &Exit {
        if tripped { &self.on_trip } else { &self.at_end }
    }

    /// True if it is to be moved there.
    #[must_use]
    pub(crate) fn moves(&self, tripped: bool) -> bool {
        *self.after(tripped) != Exit::Freeze
    }
}

/// A return move of one specimen.
#[derive(Debug)]
pub(crate) enum ReturnMove {
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
        platform: Option<Box<PlatformUnloading>>,
    },
}

impl ReturnMove {
    /// Its end: where the specimen is to be left, or why it is somewhere else. None before it, and where something else ends it.
    #[must_use]
    pub(crate) fn end(&self) -> Option<Result<(), UnloadFailure>> {
        match self {
            Self::Ramp { arrived, .. } => arrived.then_some(Ok(())),
            Self::Unload { unloading, .. } => unloading.end(),
        }
    }

    /// A way to displacements that takes `seconds`, in ticks of `tick` s.
    pub(super) fn ramp(seconds: f64, tick: f64) -> Self {
        Self::Ramp {
            ticks: (seconds / tick).ceil() as u64,
            tick: 0,
            seconds: seconds.max(tick),
            arrived: false,
        }
    }

    /// The way to zero force, at most at `speed` in m/s of the specimen, in ticks of `tick` s.
    pub(super) fn unload(from: &ReturnStart<'_>, speed: f64, tick: f64) -> Self {
        let count = from.observed.axes.len();
        let legs = (0..count).map(|axis| from.leg(axis, speed, tick));
        let mut legs: Vec<Leg> = legs.collect();
        let mut platform = from.platform();
        if let Some((platform, unit)) = platform.as_mut().zip(from.unit) {
            let force = from.observed.feedback.force();
            let slower = platform.slower(legs.iter().map(|leg| leg.by_speed));
            let turned = platform.forces(unit.geometry(), &force);
            for ((leg, turned), force) in legs.iter_mut().zip(turned).zip(*force) {
                leg.by_speed *= slower;
                leg.slew *= slower;
                if let Some([before, _]) = &mut leg.jump {
                    *before += turned - force;
                }
            }
        }
        let unloading = Unloading::new(legs, from.observed.stiffness.matrix(), tick);
        Self::Unload {
            unloading: Box::new(unloading),
            platform: platform.map(Box::new),
        }
    }

    /// Makes the next command; false when there is no further to go.
    pub(super) fn go_on(
        &mut self,
        axes: &[Axis],
        path: &mut CommandPath,
        feedback: &Feedback,
        unit: Option<&mut LoadingUnit>,
    ) -> bool {
        match self {
            Self::Ramp {
                ticks,
                tick,
                seconds,
                arrived,
            } => {
                if *tick >= *ticks {
                    *arrived = true;
                    if let Some(unit) = unit {
                        unit.leave_pose();
                    }
                    path.stand_still();
                    return false;
                }
                *tick += 1;
                path.ramp_to(*tick as f64 / *ticks as f64, *seconds, axes, unit);
                true
            }
            Self::Unload {
                unloading,
                platform,
            } => {
                // What was measured last, before its first command, is of the test.
                let is_known = !unloading.is_new() && feedback.is_fresh();
                let raw = feedback.raw();
                let raw = raw.disp.iter().zip(&raw.force);
                let answers = axes.iter().zip(raw);
                let answers = answers
                    .map(|(axis, (disp, force))| axis.at_structure(AtAxis((*disp, *force))).0);
                let answers = is_known.then_some(answers);
                let geometry = unit.as_deref().map(LoadingUnit::geometry);
                let Some((platform, geometry)) = platform.as_deref_mut().zip(geometry) else {
                    let goes_on = unloading.go_on(answers);
                    path.go_back(unloading.steps().map(AtStructure), axes);
                    return goes_on;
                };
                let answers = answers.and_then(|answers| platform.answer(geometry, answers).ok());
                let goes_on = unloading.go_on(answers);
                let steps = platform.go_back(geometry, unloading.steps());
                path.go_back(steps.into_iter().map(AtStructure), axes);
                goes_on
            }
        }
    }
}

/// State at the begin of a return move.
pub(super) struct ReturnStart<'a> {
    pub observed: Observation<'a>,
    pub guard: &'a Guard,
    pub startup: &'a Startup,
    pub unit: Option<&'a LoadingUnit>,
}

impl ReturnStart<'_> {
    /// The unloading of a platform from where it was sent last.
    fn platform(&self) -> Option<PlatformUnloading> {
        let axes = self.observed.axes.iter();
        let strokes = axes.zip(self.observed.path.sent().each());
        let strokes = strokes.map(|(axis, sent)| axis.deformation(sent).0);
        let strokes: AtStructure<Vec<f64>> = AtStructure(strokes.collect());
        self.unit?.unloading_from(strokes.part(Vec::as_slice))
    }

    /// Data of an axis before it is unloaded.
    fn leg(&self, index: usize, speed: f64, tick: f64) -> Leg {
        let plain = Axis::plain(Vec::new());
        let axis = self.observed.axes.get(index).unwrap_or(&plain);
        let units = self.guard.units().get(index);
        let (metres, newtons) = units.copied().unwrap_or((1.0, 1.0));
        let force = |raw: f64| axis.at_structure(AtAxis((0.0, raw / newtons))).1;
        // From metres of the specimen to metres of the structure.
        let disp = 1.0 / (metres * axis.disp_gain.abs());
        let limits = self.guard.declared().get(index);
        let meant = limits.map_or([f64::NEG_INFINITY, f64::INFINITY], |limits| {
            limits.get(Limit::MeasuredForce).trip
        });
        let [one, other] = meant.map(force);
        let jump = self.guard.jump(index);
        let peak = self.observed.feedback.peak_before_last().get(index);
        Leg {
            largest: peak.map_or(0.0, |force| force.abs()),
            noise: (axis.force_gain * self.startup.reading(index).force_noise).abs(),
            meant: [one.min(other), one.max(other)],
            jump: jump.map(|AtSpecimen([before, most])| {
                [force(before), (axis.force_gain * most / newtons).abs()]
            }),
            by_speed: speed * tick * disp,
            slew: self.guard.way_accel(index) * tick * tick * disp,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::port::{Axis, AxisSpec, Port, PortSpec};
    use gusset_quantity::substructure::{
        Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
    };
    use gusset_quantity::time::Nanos;

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
        fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
            self.commands.rotate_left(1);
            *self.commands.back_mut().unwrap() = command.disp[0];
            Ok(())
        }
        fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
            self.phase += 2.4;
            (into.disp[0], into.force[0]) = (
                self.commands[0],
                2e5 * self.commands[0] + self.noise * libm::sin(self.phase),
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
        let mut port = PortSpec::new("rig", spring, 1, vec![AxisSpec::new(axis, stiffness)])
            .build()
            .unwrap();
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
            port.feedback().raw().disp[0]
        };
        port.aim(&[0.01], &[0.0], 0.0, 0.0);
        exchange(&mut port);
        let mut departure = port.begin_return_move(true, tick).unwrap();
        let (mut ticks, mut least) = (0, f64::INFINITY);
        while port.go_on(&mut departure) {
            least = exchange(&mut port).min(least);
            ticks += 1;
        }
        let (end, arrived) = (port.path().sent()[0], departure.end() == Some(Ok(())));
        Way {
            ticks,
            end,
            least,
            arrived,
        }
    }

    #[test]
    fn unloading_ends_at_a_small_force() {
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
    fn late_actuator_unloads_without_a_swing() {
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
    fn small_force_needs_no_unloading() {
        let mut port = sprung(2e5, vec![0.0], 0.0);
        let exchange = |port: &mut Port| {
            assert_eq!(port.clear().trip, None);
            port.issue(0, 0.0, TICK).unwrap();
            port.collect(Nanos(0)).unwrap();
            port.feedback_mut().note_peak();
        };
        for disp in [0.01, 0.9e-4] {
            port.aim(&[disp], &[0.0], 0.0, 0.0);
            exchange(&mut port);
        }
        let mut departure = port.begin_return_move(true, TICK).unwrap();
        while port.go_on(&mut departure) {
            exchange(&mut port);
        }
        assert_eq!(departure.end(), Some(Ok(())));
        assert_eq!(port.path().sent()[0], 0.9e-4, "nothing has moved");
    }

    #[test]
    fn no_stiffness_no_unloading() {
        // Two blocks to see that there is a force, and one to see that nobody moves.
        let way = to_zero_force(0.0, TICK, 0);
        assert_eq!((way.end, way.arrived), (0.01, false));
        assert!(way.ticks < 200, "{}", way.ticks);
    }
}
