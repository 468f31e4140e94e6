//! How well a specimen follows its targets, while the test runs: delay, gain, and the damping that they falsify.
//!
//! Over a window that forgets, the measured displacement is fitted by the target and its velocity, m ≈ a x + b ẋ; with the
//! mean frequency ω² = Σẋ²/Σx² of the window, gain = √(a² + ω²b²) and lag = atan2(−ωb, a)/ω, exact for one frequency. A lag τ
//! on a stiffness k_e is the damping −k_e τ (Horiuchi et al. 1999); k_e is fitted likewise, f ≈ a' x + b' ẋ, as the real part of
//! (a' + iωb')/(a + iωb): sensors' noise is in neither x nor ẋ, and does not bias it. Nothing is said before the window holds motion well above
//! the noise that was read while zeroing, or is declared where too little was read, and two periods of it: a fit that has just begun
//! overshoots. It moves nothing: columns and limits only.

use super::Port;
use super::limits::Found;

/// Time in which the window forgets, s of test time.
const WINDOW_S: f64 = 2.0;
/// The motion's rms over the noise's, from which on something is said.
const ABOVE_NOISE: f64 = 10.0;
/// Smallest motion in m that is looked at where no noise is known.
const LEAST_M: f64 = 1e-7;
/// Angle of motion in rad, by the window's mean frequency, after which a fit has settled: two periods.
const SETTLED: f64 = 4.0 * std::f64::consts::PI;
/// 1 − ρ² of target and velocity below which they are one direction.
const INDEPENDENT: f64 = 1e-3;

/// Which moment the velocity that belongs to a target is of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum VelOf {
    /// That of the integrator, some part of a tick ago.
    #[default]
    Published,
    /// Now: the slope of the way on which a command is led between two targets.
    Now,
}

/// What is remembered of one axis.
#[derive(Debug, Clone, Copy, Default)]
struct Follow {
    /// Target, measured displacement and force where the test began, and the target's velocity of the tick before.
    start: Option<(f64, f64, f64)>,
    last_vel: f64,
    weight: f64,
    xx: f64,
    xv: f64,
    vv: f64,
    xm: f64,
    vm: f64,
    xf: f64,
    vf: f64,
    lag: f64,
    gain: f64,
    stiffness: f64,
    /// Time since the window holds motion, s, and whether that was two periods.
    fitted_for: f64,
    settled: bool,
    least: f64,
}

impl Follow {
    /// One tick of `dt` s in which `passed` s of test time pass, less where its pace eases: target, its velocity of `age` ticks ago,
    /// measured displacement and force. Real-time: yes.
    fn take(
        &mut self,
        target: f64,
        (vel, age): (f64, f64),
        (measured, force): (f64, f64),
        (dt, passed): (f64, f64),
    ) {
        let (x0, m0, f0) = *self.start.get_or_insert((target, measured, force));
        // On along a straight line: the velocity of now.
        let now = vel + age * (vel - self.last_vel);
        self.last_vel = vel;
        let keep = 1.0 - (dt / WINDOW_S).min(1.0);
        let (x, m, f) = (target - x0, measured - m0, force - f0);
        self.weight = keep * self.weight + 1.0;
        self.xx = keep * self.xx + x * x;
        self.xv = keep * self.xv + x * now;
        self.vv = keep * self.vv + now * now;
        self.xm = keep * self.xm + x * m;
        self.vm = keep * self.vm + now * m;
        self.xf = keep * self.xf + x * f;
        self.vf = keep * self.vf + now * f;
        let determinant = self.xx * self.vv - self.xv * self.xv;
        let moves = self.xx > self.weight * self.least * self.least;
        // Written so that NaN says nothing.
        if !(moves && determinant > INDEPENDENT * self.xx * self.vv) {
            (self.lag, self.gain, self.stiffness) = (f64::NAN, f64::NAN, f64::NAN);
            (self.fitted_for, self.settled) = (0.0, false);
            return;
        }
        let a = (self.xm * self.vv - self.vm * self.xv) / determinant;
        let b = (self.vm * self.xx - self.xm * self.xv) / determinant;
        let omega = (self.vv / self.xx).sqrt();
        self.fitted_for += passed;
        self.settled |= omega * self.fitted_for >= SETTLED;
        if !self.settled {
            return;
        }
        self.gain = (a * a + omega * omega * b * b).sqrt();
        self.lag = libm::atan2(-omega * b, a) / omega;
        let a_f = (self.xf * self.vv - self.vf * self.xv) / determinant;
        let b_f = (self.vf * self.xx - self.xf * self.xv) / determinant;
        self.stiffness = (a_f * a + omega * omega * b_f * b) / (self.gain * self.gain);
    }
}

/// Of all axes of a port.
#[derive(Debug)]
pub(super) struct Tracking {
    axes: Vec<Follow>,
    dt: f64,
    /// By so many ticks the velocities that come with targets are older than these; and which velocity the last one is.
    age: f64,
    vel_of: VelOf,
    /// Delay and gain are estimated.
    pub on: bool,
    /// A command that moves is in force.
    pub moves: bool,
    /// Test time in s that passes with it.
    pub passes: f64,
}

impl Tracking {
    pub fn new(axes: usize) -> Self {
        let unknown = Follow {
            lag: f64::NAN,
            gain: f64::NAN,
            stiffness: f64::NAN,
            least: LEAST_M,
            ..Follow::default()
        };
        Self {
            axes: vec![unknown; axes],
            dt: 0.0,
            age: 0.0,
            vel_of: VelOf::Published,
            on: false,
            moves: false,
            passes: 0.0,
        }
    }

    /// The target came with the velocity that was published for it. Real-time: yes.
    #[inline]
    pub fn is_published(&mut self) {
        self.vel_of = VelOf::Published;
    }

    /// True if it did. Real-time: yes.
    #[inline]
    pub fn has_published(&self) -> bool {
        self.vel_of == VelOf::Published
    }

    /// The target lies on a way, and its velocity is the slope of that. Real-time: yes.
    #[inline]
    pub fn is_on_the_way(&mut self) {
        self.vel_of = VelOf::Now;
    }
}

impl Port {
    /// True if delay and gain are estimated: columns of their own.
    #[must_use]
    pub fn tracks(&self) -> bool {
        self.tracking.on
    }

    /// Estimates delay and gain; `dt` is the test time from command to command in s, and the velocity that comes with a target
    /// is `age` of that older: half where it is the backward difference of the family, γ with the α methods, nothing where it
    /// is prescribed.
    #[must_use]
    pub fn with_tracking(mut self, dt: f64, age: f64) -> Self {
        (self.tracking.on, self.tracking.dt, self.tracking.age) = (true, dt, age);
        self
    }

    /// What the displacement sensors are declared to add, m of the specimen rms: nothing is said of less, until it is read.
    #[must_use]
    pub fn with_declared_noise(mut self, rms_m: f64) -> Self {
        let axes = self.axes.iter().zip(self.guard.units());
        for (follow, (axis, (metres, _))) in self.tracking.axes.iter_mut().zip(axes) {
            let least = ABOVE_NOISE * (rms_m / (metres * axis.disp_gain)).abs();
            follow.least = follow.least.max(least);
        }
        self
    }

    /// The noise was read while zeroing. Too few readings may show less of it than there is.
    pub(super) fn track_above_noise(&mut self) {
        for index in 0..self.axes.len() {
            let reading = self.reading(index);
            let axes = self.tracking.axes.iter_mut().zip(&self.axes);
            if let Some((follow, axis)) = axes.into_iter().nth(index) {
                let known = reading.noise().map_or(follow.least, |_| LEAST_M);
                let least = ABOVE_NOISE * (reading.disp_noise / axis.disp_gain).abs();
                follow.least = known.max(least);
            }
        }
    }

    /// Takes the measurement last taken, which must be a fresh one, and judges what it shows. Real-time: yes.
    pub(super) fn track(&mut self, found: &mut Found) {
        let ticks = (self.tracking.dt, self.tracking.passes);
        let age = match self.tracking.vel_of {
            VelOf::Published => self.tracking.age,
            VelOf::Now => 0.0,
        };
        let targets = self.target.iter().zip(&self.target_vel);
        let values = targets.zip(&self.measured).zip(&self.force).enumerate();
        let axes = self.tracking.axes.iter_mut().zip(values);
        for (follow, (index, (((target, vel), measured), force))) in axes {
            let own = force - self.estimates.of_others(index, &self.measured);
            follow.take(*target, (*vel, age), (*measured, own), ticks);
        }
        let judged = self.tracking.axes.iter();
        let judged = judged.map(|follow| [follow.lag.abs(), (follow.gain - 1.0).abs()]);
        self.guard.watch.tracked(judged, found);
    }

    /// Lag in s, gain, stiffness in N/m, and the damping in N s/m that the lag adds to it, per axis at the structure; NaN where
    /// nothing is known. Empty where nothing is estimated. Real-time: yes.
    #[inline]
    pub fn tracking(&self) -> impl Iterator<Item = [f64; 4]> + '_ {
        let axes = if self.tracking.on {
            self.tracking.axes.as_slice()
        } else {
            &[]
        };
        axes.iter().map(|follow| {
            let Follow {
                lag,
                gain,
                stiffness,
                ..
            } = *follow;
            [lag, gain, stiffness, -stiffness * lag]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Axis;
    use super::*;
    use crate::substructure::{
        Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
    };
    use crate::time::Nanos;

    /// How velocities come with targets: as backward differences, which are half a tick old, or as they were so many ticks ago.
    #[derive(Debug, Clone, Copy)]
    enum Vel {
        Difference,
        Old(f64),
    }

    fn follow(gain: f64, delay: f64, hertz: f64, dt: f64, kind: Vel) -> Follow {
        let mut follow = Tracking::new(1).axes[0];
        let omega = std::f64::consts::TAU * hertz;
        // From rest.
        let at = |t: f64| 0.01 * libm::sin(omega * t.max(0.0));
        let rate = |t: f64| {
            if t < 0.0 {
                0.0
            } else {
                0.01 * omega * libm::cos(omega * t)
            }
        };
        for k in 0..(20.0 / dt) as i32 {
            let t = f64::from(k) * dt;
            // ω is known to a few percent when it is first said, and never by less than a period.
            assert!(follow.lag.is_nan() || t > 1.0 / hertz, "{t}: {follow:?}");
            let vel = match kind {
                Vel::Difference => ((at(t) - at(t - dt)) / dt, 0.5),
                Vel::Old(age) => (rate(t - age * dt), age),
            };
            let measured = gain * at(t - delay);
            // A spring whose noise is in no regressor, so that only its scatter is left.
            let noise = 0.2e-3 * libm::sin(1e5 * f64::from(k));
            follow.take(at(t), vel, (measured + noise, 3e5 * measured), (dt, dt));
        }
        follow
    }

    #[test]
    fn delay_and_gain_of_a_sine_are_found() {
        for (gain, delay, hertz) in [
            (0.95, 3.1e-3, 2.0),
            (0.916, 23.7e-3, 3.6),
            (1.02, -4e-3, 5.0),
        ] {
            let found = follow(gain, delay, hertz, 1.0 / 4096.0, Vel::Difference);
            assert!((found.stiffness / 3e5 - 1.0).abs() < 0.01, "{found:?}");
            // The window ripples with the sine, and forgets unevenly.
            assert!((found.gain - gain).abs() < 0.01 * gain, "{found:?}");
            assert!(
                (found.lag - delay).abs() < 0.03 * delay.abs() + 1e-5,
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_delay_of_a_part_of_a_tick_is_found_whatever_moment_the_velocity_is_of() {
        // Half a tick is 0.1 rad here: taken for another moment it would be up to 0.4 ticks of lag, and 4 % of gain.
        let (dt, hertz) = (1.0 / 256.0, 8.0);
        // A backward difference, the velocity of now, and that of an α method with γ = 0.9.
        for kind in [Vel::Difference, Vel::Old(0.0), Vel::Old(0.9)] {
            for ticks in [0.0, 0.3, 0.5, 1.0, 2.5, 4.0, 7.0] {
                let found = follow(0.97, ticks * dt, hertz, dt, kind);
                // A straight line of velocities is up to 0.9 (ωΔt)² = 3.3 % too large, and so is the frequency.
                let off = found.lag / dt - ticks;
                assert!(off.abs() < 0.02 + 0.04 * ticks, "{kind:?} {ticks}: {off}");
                let gain = found.gain / 0.97 - 1.0;
                assert!(gain.abs() < 0.02, "{kind:?} {ticks}: {gain}");
            }
        }
    }

    #[test]
    fn nothing_is_said_of_noise_or_of_rest() {
        let mut quiet = Tracking::new(1).axes[0];
        quiet.least = 1e-4;
        for k in 0..10_000 {
            let target = 1e-6 * libm::sin(f64::from(k));
            quiet.take(target, (1e-3, 0.5), (1e-5, 1.0), (1e-3, 1e-3));
        }
        assert!(quiet.lag.is_nan() && quiet.gain.is_nan() && quiet.stiffness.is_nan());
    }

    #[test]
    fn two_periods_are_of_test_time_however_slowly_it_passes() {
        let (hertz, dt) = (2.0, 1e-3);
        let omega = std::f64::consts::TAU * hertz;
        let first_said = |pace: f64| {
            let mut follow = Tracking::new(1).axes[0];
            let said = (1..100_000).find(|k| {
                let at = 0.8 + omega * dt * pace * f64::from(*k);
                let (sine, cosine) = libm::sincos(at);
                let x = 0.01 * sine;
                let ticks = (dt, pace * dt);
                follow.take(x, (0.01 * omega * cosine, 0.0), (x, 3e5 * x), ticks);
                !follow.lag.is_nan()
            });
            f64::from(said.unwrap()) * dt * pace
        };
        let at_full_pace = first_said(1.0);
        assert!(at_full_pace > 1.0 / hertz, "{at_full_pace}");
        assert!(
            first_said(0.25) > 0.8 * at_full_pace,
            "{}",
            first_said(0.25)
        );
    }

    /// Stands, and reads one thing or the other.
    struct Noisy(f64);

    impl Substructure for Noisy {
        fn axes(&self) -> usize {
            1
        }
        fn coupling(&self) -> Coupling {
            Coupling::Lockstep
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            self.0 = -self.0;
            Ok(())
        }
        fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
            into.disp[0] = self.0;
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    #[test]
    fn declared_noise_is_a_floor_until_enough_readings_show_another() {
        let least = |declared: f64, readings: u32| {
            let axes = vec![Axis::plain(vec![(0, 1.0)])];
            let rig = Box::new(Noisy(1e-6));
            let port = Port::new("rig", axes, rig, 1, vec![1e6]).unwrap();
            let mut port = port.with_tracking(1e-3, 0.5).with_declared_noise(declared);
            for k in 0..u64::from(readings) {
                port.repeat(k, 0.0).unwrap();
                port.collect(Nanos(0)).unwrap();
                port.take_reading();
            }
            if readings > 0 {
                port.take_zero();
            }
            let least = port.tracking.axes[0].least;
            (least * 1e12).round() / 1e12
        };
        assert_eq!(least(0.0, 0), LEAST_M);
        assert_eq!(least(3e-6, 0), 3e-5);
        // One reading shows no noise, two or seven some of it.
        assert_eq!(least(3e-6, 1), 3e-5);
        assert_eq!(least(3e-6, 2), 3e-5);
        assert_eq!(least(0.0, 2), 1e-5);
        assert_eq!(least(3e-6, 8), 1e-5);
    }
}
