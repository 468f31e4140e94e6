//! The compensator of one axis, and the two points of the grid between which its lead is.

use super::gap::Gap;
use crate::port::Axis;
use gusset_actuator::compensation::Compensator;
use gusset_quantity::state;

/// What is kept of one axis.
#[derive(Debug)]
pub(super) struct AxisCompensator {
    pub one: Box<dyn Compensator>,
    /// Metres in one unit of the axis.
    pub metres: f64,
    /// Target at the newest point, as it came out, and its velocity in m/s of wall time.
    disp: f64,
    pub vel: f64,
    /// The velocity of the last command before it was led, in the axis' unit.
    pub own_vel: f64,
    /// Target and led target, at the newest point of the grid and at the one before.
    points: [(f64, f64); 2],
    /// Ticks of the undisturbed test since it was disturbed, measured or filled in, and how many it takes to forget what was
    /// before.
    heard: u32,
    memory: u32,
    gap: Gap,
}

state! {
    AxisCompensator { disp, vel, own_vel, points, heard, gap, one } keeps { metres, memory }
}

impl AxisCompensator {
    pub(crate) fn new(one: Box<dyn Compensator>, metres: f64) -> Self {
        let memory = one.memory();
        Self {
            memory,
            gap: Gap::new(memory),
            one,
            metres,
            disp: 0.0,
            vel: 0.0,
            own_vel: 0.0,
            points: [(0.0, 0.0); 2],
            heard: u32::MAX,
        }
    }

    /// The command for what has always stood at `disp`, and for which nothing is remembered but that. Real-time: yes.
    pub(crate) fn at_rest(&mut self, disp: f64) -> f64 {
        self.one.reset(disp);
        let command = self.one.predict(disp, 0.0, 0.0);
        self.one.reset(disp);
        self.gap.begin(disp);
        self.disp = disp;
        let led = self.one.stands(disp);
        self.points = [(disp, led); 2];
        command
    }

    /// Asks for the next point: led target of this target. `vel` is the integrator's own velocity in m/s of wall time, which is its
    /// ∇d/Δt; on the way from target to target it has none, and that of the points is taken. Real-time: yes.
    #[inline]
    pub(crate) fn ask(&mut self, disp: f64, vel: Option<f64>, tick: f64) -> f64 {
        let vel = vel.unwrap_or((disp - self.disp) / tick);
        let accel = (vel - self.vel) / tick;
        let led = self.one.lead(disp, vel, accel);
        (self.disp, self.vel) = (disp, vel);
        let [newest, _] = self.points;
        self.points = [(disp, led), newest];
        led
    }

    /// The newest point was foretold, and came out otherwise; `vel` as in [`AxisCompensator::ask`]. Real-time: yes.
    #[inline]
    pub(crate) fn amend(&mut self, disp: f64, vel: Option<f64>, tick: f64) {
        self.one.amend(disp);
        self.vel = vel.unwrap_or(self.vel + (disp - self.disp) / tick);
        self.disp = disp;
    }

    /// The led target of `disp`, so many points before the newest, at this pace. Real-time: yes.
    pub(crate) fn between(&self, disp: f64, back: f64, pace: f64) -> f64 {
        let [newest, before] = self.points.map(|(disp, led)| led - self.one.stands(disp));
        self.one.stands(disp) + pace * (newest + back * (before - newest))
    }

    /// Leads the velocity of a command as its displacement is: `vel` of the target in m/s of wall time, a tick in s of it, at this
    /// pace of an eased test, which by itself makes `of_test` seconds of test time in one of wall time. Real-time: yes.
    pub(crate) fn lead_vel(
        &mut self,
        vel: f64,
        tick: f64,
        pace: f64,
        of_test: f64,
        axis: &Axis,
        command_vel: &mut f64,
    ) {
        let [newest, before] = self.points.map(|(disp, led)| led - self.one.stands(disp));
        let further = (self.one.stands(vel) - vel) + pace * (newest - before) / tick;
        self.own_vel = *command_vel;
        // What is not led keeps its bits.
        if further != 0.0 {
            *command_vel += further / (axis.disp_gain * self.metres * of_test) * axis.vel_gain;
        }
    }

    /// What was measured of a command; nothing is learnt while the test is disturbed, nor as long after it as that is remembered,
    /// nor of what is filled in. Real-time: yes.
    #[inline]
    pub(crate) fn hear(&mut self, command: f64, measured: f64, undisturbed: bool) {
        let one = &mut self.one;
        self.gap
            .fill(measured, |command, measured| one.notice(command, measured));
        self.count(undisturbed);
        if self.heard > self.memory {
            self.one.observe(command, measured);
        } else {
            self.one.notice(command, measured);
        }
    }

    /// The measurement of a command stays away: it is filled in when the next one comes, if that is soon. Real-time: yes.
    #[inline]
    pub(crate) fn lacks(&mut self, command: f64, undisturbed: bool) {
        if self.gap.takes(command) {
            self.count(undisturbed);
        } else {
            self.misses();
        }
    }

    #[inline]
    fn count(&mut self, undisturbed: bool) {
        self.heard = if undisturbed {
            self.heard.saturating_add(1)
        } else {
            0
        };
    }

    /// Ticks at rest after which a gap teaches nothing wrong: what is shorter is filtered out. Real-time: yes.
    pub(crate) const fn ticks_to_rest(&self) -> u32 {
        self.gap.most()
    }

    /// What is measured next does not follow what was measured last. Real-time: yes.
    pub(crate) fn misses(&mut self) {
        self.heard = 0;
        self.gap.forget();
    }
}
