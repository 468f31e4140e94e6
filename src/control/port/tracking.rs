//! How well a specimen follows its targets while the test runs: delay, gain, and the delay-induced damping error.
//!
//! Over a window that forgets, the measured displacement is fitted by the target and its velocity, m ≈ a x + b ẋ. With the mean
//! frequency ω² = Σẋ²/Σx², gain = √(a² + ω²b²) and lag = atan2(−ωb, a)/ω, exact for one frequency. A lag τ on a stiffness k_e is the
//! damping −k_e τ (Horiuchi et al. 1999); k_e is fitted likewise from the force, so that sensor noise does not bias it. The delay
//! margin is the critical delay at k_e, tabulated before the test, less the lag. Invariant: there is no value before the window holds
//! two periods of motion well above the noise. Limits: it moves nothing; it feeds columns and limits.

use super::command_path::VelocityOf;
use super::estimates::Observation;
use gusset_proof::CriticalDelay;
use gusset_quantity::state;

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

/// Fading sums of target x, velocity v, measured displacement m and force f.
#[derive(Debug, Clone, Copy, Default)]
struct FitSums {
    weight: f64,
    xx: f64,
    xv: f64,
    vv: f64,
    xm: f64,
    vm: f64,
    xf: f64,
    vf: f64,
}

state! { FitSums { weight, xx, xv, vv, xm, vm, xf, vf } }

impl FitSums {
    #[inline]
    fn add(&mut self, keep: f64, [x, v]: [f64; 2], [m, f]: [f64; 2]) {
        self.weight = keep * self.weight + 1.0;
        self.xx = keep * self.xx + x * x;
        self.xv = keep * self.xv + x * v;
        self.vv = keep * self.vv + v * v;
        self.xm = keep * self.xm + x * m;
        self.vm = keep * self.vm + v * m;
        self.xf = keep * self.xf + x * f;
        self.vf = keep * self.vf + v * f;
    }
}

/// Result of the fit; NaN where nothing is known.
#[derive(Debug, Clone, Copy)]
struct TrackingFit {
    lag: f64,
    gain: f64,
    stiffness: f64,
}

state! { TrackingFit { lag, gain, stiffness } }

impl TrackingFit {
    const UNKNOWN: Self = Self {
        lag: f64::NAN,
        gain: f64::NAN,
        stiffness: f64::NAN,
    };
}

/// Memory of one axis.
#[derive(Debug, Clone, Copy)]
struct AxisTracking {
    /// Target, measured displacement and force where the test began, and the target's velocity of the tick before.
    start: Option<[f64; 3]>,
    last_vel: f64,
    sums: FitSums,
    fit: TrackingFit,
    /// Time since the window holds motion, s, and whether that was two periods.
    fitted_for: f64,
    settled: bool,
    least: f64,
}

state! { AxisTracking { start, last_vel, sums, fit, fitted_for, least, settled } }

impl AxisTracking {
    const NONE: Self = Self {
        start: None,
        last_vel: 0.0,
        sums: FitSums {
            weight: 0.0,
            xx: 0.0,
            xv: 0.0,
            vv: 0.0,
            xm: 0.0,
            vm: 0.0,
            xf: 0.0,
            vf: 0.0,
        },
        fit: TrackingFit::UNKNOWN,
        fitted_for: 0.0,
        settled: false,
        least: LEAST_M,
    };

    /// One tick of `dt` s in which `passed` s of test time pass, less where its pace eases: target, its velocity of `age` ticks ago,
    /// measured displacement and force. Real-time: yes.
    fn take(
        &mut self,
        target: f64,
        (vel, age): (f64, f64),
        (measured, force): (f64, f64),
        (dt, passed): (f64, f64),
    ) {
        let [x0, m0, f0] = *self.start.get_or_insert([target, measured, force]);
        // On along a straight line: the velocity of now.
        let now = vel + age * (vel - self.last_vel);
        self.last_vel = vel;
        let keep = 1.0 - (dt / WINDOW_S).min(1.0);
        let (x, m, f) = (target - x0, measured - m0, force - f0);
        self.sums.add(keep, [x, now], [m, f]);
        let FitSums {
            weight,
            xx,
            xv,
            vv,
            xm,
            vm,
            xf,
            vf,
        } = self.sums;
        let determinant = xx * vv - xv * xv;
        let moves = xx > weight * self.least * self.least;
        // Written so that NaN says nothing.
        if !(moves && determinant > INDEPENDENT * xx * vv) {
            self.fit = TrackingFit::UNKNOWN;
            (self.fitted_for, self.settled) = (0.0, false);
            return;
        }
        let a = (xm * vv - vm * xv) / determinant;
        let b = (vm * xx - xm * xv) / determinant;
        let omega = (vv / xx).sqrt();
        self.fitted_for += passed;
        self.settled |= omega * self.fitted_for >= SETTLED;
        if !self.settled {
            return;
        }
        let gain = (a * a + omega * omega * b * b).sqrt();
        let a_f = (xf * vv - vf * xv) / determinant;
        let b_f = (vf * xx - xf * xv) / determinant;
        self.fit = TrackingFit {
            lag: libm::atan2(-omega * b, a) / omega,
            gain,
            stiffness: (a_f * a + omega * omega * b_f * b) / (gain * gain),
        };
    }
}

/// How delay and gain of the axes are estimated.
#[derive(Debug, Default)]
pub struct TrackingSpec {
    /// Test time from command to command, s.
    pub dt: f64,
    /// By how much of `dt` the velocity that comes with a target is older: half where it is the backward difference of the
    /// family, γ with the α methods, nothing where it is prescribed.
    pub age: f64,
    /// Declared noise of the displacement sensors, m of the specimen rms: smaller motion gives no estimate until noise is read.
    pub noise_m: Option<f64>,
    /// Critical delays, one table per axis; empty if they are not known.
    pub critical: Vec<CriticalDelay>,
}

/// How all axes of a specimen follow.
#[derive(Debug)]
pub struct Tracking {
    axes: Vec<AxisTracking>,
    dt: f64,
    /// By this many ticks the velocities that come with targets are older than these.
    age: f64,
    /// Critical delays by stiffness: one per axis, or none at all.
    critical: Vec<CriticalDelay>,
    /// Delay and gain are estimated.
    is_on: bool,
    /// The test runs: what moves the specimen is part of it.
    test_runs: bool,
    /// Test time in s that passes with the command in force; none if that is no motion of the test.
    passes: Option<f64>,
}

state! { Tracking as "tracking" { axes, test_runs, passes } keeps { dt, age, critical, is_on } }

impl Tracking {
    pub(crate) fn new(axes: usize) -> Self {
        Self {
            axes: vec![AxisTracking::NONE; axes],
            dt: 0.0,
            age: 0.0,
            critical: Vec::new(),
            is_on: false,
            test_runs: false,
            passes: None,
        }
    }

    /// Estimates delay and gain from here on.
    pub(crate) fn begin(&mut self, spec: TrackingSpec) {
        (self.is_on, self.dt, self.age) = (true, spec.dt, spec.age);
        self.critical = spec.critical;
    }

    /// Everything is forgotten but what is declared: another test begins later.
    pub(crate) fn restart(&mut self) {
        for axis in &mut self.axes {
            *axis = AxisTracking {
                least: axis.least,
                ..AxisTracking::NONE
            };
        }
        (self.test_runs, self.passes) = (false, None);
    }

    /// True if delay and gain are estimated: they have columns.
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.is_on
    }

    /// The test runs from here on, or does not. Real-time: yes.
    pub(crate) const fn test_runs(&mut self, runs: bool) {
        self.test_runs = runs;
    }

    /// A command leaves that moves the specimen for `passes` s of test time, or the last one leaves again. Real-time: yes.
    #[inline]
    pub(crate) fn note_sent(&mut self, passes: Option<f64>) {
        self.passes = passes.filter(|_| self.test_runs);
    }

    /// Smallest motion that counts, of what the displacement sensors are declared to add, m rms per axis.
    pub(crate) fn declare_noise(&mut self, rms: impl Iterator<Item = f64>) {
        for (axis, rms) in self.axes.iter_mut().zip(rms) {
            axis.least = axis.least.max(ABOVE_NOISE * rms);
        }
    }

    /// The noise of each axis was read while zeroing, in m at the structure, from enough readings to know it or from fewer.
    pub(crate) fn read_noise(&mut self, noise: impl Iterator<Item = (f64, bool)>) {
        for (axis, (rms, is_known)) in self.axes.iter_mut().zip(noise) {
            let known = if is_known { LEAST_M } else { axis.least };
            axis.least = known.max(ABOVE_NOISE * rms);
        }
    }

    /// Takes a fresh measurement; false if it is not part of the test, or nothing is estimated. Real-time: yes.
    #[inline]
    pub(crate) fn take(&mut self, observed: &Observation<'_>) -> bool {
        let Some(passes) = self.passes.filter(|_| self.is_on) else {
            return false;
        };
        let Observation {
            path,
            feedback,
            stiffness,
            ..
        } = observed;
        let ticks = (self.dt, passes);
        let age = match path.velocity_of() {
            VelocityOf::Integrator => self.age,
            VelocityOf::Path => 0.0,
        };
        let measured = feedback.disp();
        let values = path.target().iter().zip(*measured).zip(*feedback.force());
        let axes = self.axes.iter_mut().zip(values.enumerate());
        for (axis, (index, (((target, vel), disp), force))) in axes {
            let own = force - stiffness.force_of_others(index, measured);
            axis.take(*target, (*vel, age), (*disp, own), ticks);
        }
        true
    }

    /// Values of each axis for the limits. Real-time: yes.
    #[inline]
    pub(crate) fn judged(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let axes = self.axes.iter();
        axes.map(|axis| [axis.fit.lag.abs(), (axis.fit.gain - 1.0).abs()])
    }

    /// Lag, gain, stiffness, and the damping that the lag adds; empty where nothing is estimated. Real-time: yes.
    #[inline]
    pub fn values(&self) -> impl Iterator<Item = [f64; 4]> + '_ {
        let axes = if self.is_on {
            self.axes.as_slice()
        } else {
            &[]
        };
        axes.iter().map(|axis| {
            let TrackingFit {
                lag,
                gain,
                stiffness,
            } = axis.fit;
            [lag, gain, stiffness, -stiffness * lag]
        })
    }

    /// True if delay margins are known as soon as the lag is. Real-time: yes.
    #[inline]
    pub(crate) fn knows_margin(&self) -> bool {
        self.is_on && !self.critical.is_empty()
    }

    /// Lag and critical delay in s of test time, per axis; not a number where it is not known. Empty without tables. Real-time:
    /// yes.
    fn lags(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let axes = self.critical.iter().zip(self.values());
        axes.map(|(table, [lag, _, stiffness, _])| (lag, table.at(stiffness)))
    }

    /// Critical delay at the stiffness of the last seconds less their lag, s of test time, per axis: negative where the test is expected to
    /// grow, infinite where every delay is stable, not a number where nothing is known yet. Real-time: yes.
    pub(crate) fn delay_margins(&self) -> impl Iterator<Item = f64> + '_ {
        self.lags().map(|(lag, critical)| critical - lag)
    }

    /// The largest share of its critical delay that an axis uses; not a number while nothing is known. Real-time: yes.
    pub(crate) fn delay_used(&self) -> f64 {
        // A number wins against none.
        self.delay_used_by_axis().fold(f64::NAN, f64::max)
    }

    /// The share of each axis. Real-time: yes.
    pub(crate) fn delay_used_by_axis(&self) -> impl Iterator<Item = f64> + '_ {
        let lags = self.lags();
        lags.map(|(lag, critical)| lag.max(0.0) / critical + 0.0 * lag)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{Axis, AxisSpec, PortSpec};
    use gusset_quantity::substructure::{
        Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
    };
    use gusset_quantity::time::Nanos;

    /// Age of the velocities of targets: half a tick for backward differences, or a given number of ticks.
    #[derive(Debug, Clone, Copy)]
    enum Vel {
        Difference,
        Old(f64),
    }

    fn follow(gain: f64, delay: f64, hertz: f64, dt: f64, kind: Vel) -> AxisTracking {
        let mut follow = AxisTracking::NONE;
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
            assert!(
                follow.fit.lag.is_nan() || t > 1.0 / hertz,
                "{t}: {follow:?}"
            );
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
            assert!((found.fit.stiffness / 3e5 - 1.0).abs() < 0.01, "{found:?}");
            // The window ripples with the sine, and forgets unevenly.
            assert!((found.fit.gain - gain).abs() < 0.01 * gain, "{found:?}");
            assert!(
                (found.fit.lag - delay).abs() < 0.03 * delay.abs() + 1e-5,
                "{found:?}"
            );
        }
    }

    #[test]
    fn delay_of_part_of_a_tick_is_found() {
        // Half a tick is 0.1 rad here: taken for another moment it would be up to 0.4 ticks of lag, and 4 % of gain.
        let (dt, hertz) = (1.0 / 256.0, 8.0);
        // A backward difference, the velocity of now, and that of an α method with γ = 0.9.
        for kind in [Vel::Difference, Vel::Old(0.0), Vel::Old(0.9)] {
            for ticks in [0.0, 0.3, 0.5, 1.0, 2.5, 4.0, 7.0] {
                let found = follow(0.97, ticks * dt, hertz, dt, kind);
                // A straight line of velocities is up to 0.9 (ωΔt)² = 3.3 % too large, and so is the frequency.
                let off = found.fit.lag / dt - ticks;
                assert!(off.abs() < 0.02 + 0.04 * ticks, "{kind:?} {ticks}: {off}");
                let gain = found.fit.gain / 0.97 - 1.0;
                assert!(gain.abs() < 0.02, "{kind:?} {ticks}: {gain}");
            }
        }
    }

    #[test]
    fn nothing_is_said_of_noise_or_of_rest() {
        let mut quiet = AxisTracking::NONE;
        quiet.least = 1e-4;
        for k in 0..10_000 {
            let target = 1e-6 * libm::sin(f64::from(k));
            quiet.take(target, (1e-3, 0.5), (1e-5, 1.0), (1e-3, 1e-3));
        }
        assert!(quiet.fit.lag.is_nan() && quiet.fit.gain.is_nan() && quiet.fit.stiffness.is_nan());
    }

    #[test]
    fn two_periods_are_of_test_time() {
        let (hertz, dt) = (2.0, 1e-3);
        let omega = std::f64::consts::TAU * hertz;
        let first_said = |pace: f64| {
            let mut follow = AxisTracking::NONE;
            let said = (1..100_000).find(|k| {
                let at = 0.8 + omega * dt * pace * f64::from(*k);
                let (sine, cosine) = libm::sincos(at);
                let x = 0.01 * sine;
                let ticks = (dt, pace * dt);
                follow.take(x, (0.01 * omega * cosine, 0.0), (x, 3e5 * x), ticks);
                !follow.fit.lag.is_nan()
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
    fn measured_noise_replaces_the_declared() {
        let least = |declared: f64, readings: u32| {
            let rig = Box::new(Noisy(1e-6));
            let mut spec = PortSpec::new(
                "rig",
                rig,
                1,
                vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 1e6)],
            );
            spec.tracking = Some(TrackingSpec {
                dt: 1e-3,
                age: 0.5,
                noise_m: Some(declared),
                critical: Vec::new(),
            });
            let mut port = spec.build().unwrap();
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
