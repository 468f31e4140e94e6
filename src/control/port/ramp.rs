//! A ramp before or after the test: along half a cosine from the last command to the next one.

use gusset_quantity::frame::AtAxis;
use std::f64::consts::{FRAC_PI_2, PI};

use super::axis::Axis;
use super::axis_motion::AxisMotion;

/// Time of a ramp in s that nothing else bounds.
pub(crate) const UNBOUNDED_RAMP_S: f64 = 1.0;

/// Share of a speed limit that a ramp uses at its fastest.
pub const SHARE_OF_SPEED: f64 = 0.5;

/// Where the last ramp began, and where it goes, in the specimen's units.
#[derive(Debug)]
pub(super) struct Ramp {
    from: AtAxis<Vec<f64>>,
    to: AtAxis<Vec<f64>>,
}

impl Ramp {
    /// For `axes` axes; none yet.
    pub(crate) fn new(axes: usize) -> Self {
        Self {
            from: AtAxis(vec![0.0; axes]),
            to: AtAxis(vec![0.0; axes]),
        }
    }

    /// The next ramp goes from one place to the other.
    pub(crate) fn begin(&mut self, [from, to]: [AtAxis<&[f64]>; 2]) {
        self.from.copy_from_slice(&from);
        self.to.copy_from_slice(&to);
    }

    /// Part of the way at this share (0 … 1) of the time. Real-time: yes.
    pub(crate) fn way(share: f64) -> f64 {
        0.5 * (1.0 - libm::cos(PI * share))
    }

    /// Change of that part per second of a ramp of `seconds`. Real-time: yes.
    fn rate([share, seconds]: [f64; 2]) -> f64 {
        FRAC_PI_2 * libm::sin(PI * share) / seconds
    }

    /// Makes the command at a share of a ramp that takes `seconds` of test time. Real-time: yes.
    pub(crate) fn go_to(
        &self,
        share: f64,
        seconds: f64,
        axes: &[Axis],
        command: &mut AtAxis<AxisMotion>,
    ) {
        let way = Self::way(share);
        let rate = Self::rate([share, seconds]);
        let ends = self.from.iter().zip(&*self.to);
        let commands = command.iter_mut();
        for (((command, vel), (from, to)), axis) in commands.zip(ends).zip(axes) {
            // The end is met to the last bit.
            *command = if share < 1.0 {
                from + way * (to - from)
            } else {
                *to
            };
            *vel = rate * (to - from) * axis.vel_gain / axis.disp_gain;
        }
    }

    /// Adds the bends of the poses between both ends of the same ramp. Real-time: yes.
    pub(crate) fn bend(
        at: [f64; 2],
        axes: &[Axis],
        bends: impl Iterator<Item = (f64, f64)>,
        command: &mut AtAxis<AxisMotion>,
    ) {
        let rate = Self::rate(at);
        let commands = command.iter_mut();
        for (((command, vel), axis), (bend, slope)) in commands.zip(axes).zip(bends) {
            *command += axis.disp_gain * bend;
            *vel += rate * slope * axis.vel_gain;
        }
    }
}
