//! Signals in closed form: value and rate of change at any time.
//!
//! Every amplitude has the unit of the key `unit` beside it, or the SI unit of the quantity of the signal
//! (m/s², m or N) if `unit` is absent. Outside their duration these shapes are zero. Those that go from place to place
//! are in `paths`.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, OutOfDomain, Short, finite, inside, not_negative, positive};
use super::unit::{Quantity, Unit};

/// A function of time: (value, rate) in SI units.
pub(super) struct Curve {
    /// Value and rate at a time in s.
    pub(super) at: Box<dyn Fn(f64) -> (f64, f64)>,
    /// Highest frequency in Hz that it is meant to hold, where it has one.
    pub(super) top_hz: Option<f64>,
    /// End of the signal in s; infinite if it has no end.
    pub(super) end: f64,
}

impl Curve {
    /// Begins `delay` s later, and is zero before.
    pub(super) fn delay(&mut self, delay: f64) {
        if delay > 0.0 {
            let own = std::mem::replace(&mut self.at, Box::new(|_| (0.0, 0.0)));
            self.at = Box::new(move |time| match reached(time, delay) {
                true => own((time - delay).max(0.0)),
                false => (0.0, 0.0),
            });
            self.end += delay;
        }
    }

    /// Largest magnitude at `points` points between two times.
    fn peak(&self, [from, to]: [f64; 2], points: u32) -> f64 {
        let step = (to - from) / f64::from(points);
        let at = |point| (self.at)(f64::from(point).mul_add(step, from)).0.abs();
        (0..=points).map(at).fold(0.0, f64::max)
    }

    /// That a test ends at `test` s, before the signal does.
    pub(super) fn cut_warning(&self, test: f64, warnings: &mut Vec<String>) {
        /// Enough to see the peaks of a few hundred cycles.
        const POINTS: u32 = 20_000;
        let Some(left_out) = left_out(self.end, test) else {
            return;
        };
        let (within, beyond) = (
            self.peak([0.0, test], POINTS),
            self.peak([test, self.end], POINTS),
        );
        if beyond > 1e-9 * within {
            let most = if within > 0.0 {
                format!(
                    "its largest is {:.3} times that of the test",
                    beyond / within
                )
            } else {
                "nothing but zero is before that".to_owned()
            };
            warnings.push(format!("{left_out}; {most}"));
        }
    }
}

/// That a test ends at `test` s, before a signal that has an end does; none if it does not.
pub(super) fn left_out(end: f64, test: f64) -> Option<String> {
    (end.is_finite() && end > test * (1.0 + 1e-9)).then(|| {
        format!(
            "the signal ends at {} s, but the test already ends at {} s: the rest of the signal is not used",
            Short(end),
            Short(test)
        )
    })
}

/// SI units in one of `unit`, which must measure `quantity`.
pub(super) fn factor(unit: Option<Unit>, quantity: Quantity) -> Result<f64, MotionError> {
    match unit {
        None => Ok(1.0),
        Some(unit) if unit.quantity() == quantity => Ok(unit.to_si()),
        Some(unit) => Err(MotionError::UnitMismatch {
            key: None,
            unit,
            quantity,
        }),
    }
}

/// Factor of the unit under `key` of the processing.
pub(super) fn factor_of(
    key: &'static str,
    unit: Unit,
    quantity: Quantity,
) -> Result<f64, MotionError> {
    factor(Some(unit), quantity).map_err(|_| MotionError::UnitMismatch {
        key: Some(key),
        unit,
        quantity,
    })
}

/// One of two keys, of which exactly one is given.
#[derive(Clone, Copy)]
pub(super) enum OneOf {
    /// The first, and its number.
    First(f64),
    /// The second, and its number.
    Second(f64),
}

/// The key of the two that is given.
pub(super) fn one_of(
    names: &'static str,
    first: Option<f64>,
    second: Option<f64>,
) -> Result<OneOf, MotionError> {
    let exactly = |found| Err(MotionError::ExactlyOne { names, found });
    match (first, second) {
        (Some(first), None) => Ok(OneOf::First(first)),
        (None, Some(second)) => Ok(OneOf::Second(second)),
        (None, None) => exactly(0),
        (Some(_), Some(_)) => exactly(2),
    }
}

/// True from `at` on, rounding of a step's time forgiven.
pub(super) fn reached(time: f64, at: f64) -> bool {
    time >= at - 1e-12 * (1.0 + at.abs())
}

/// True between `start` and `end`, both included.
fn within(time: f64, start: f64, end: f64) -> bool {
    reached(time, start) && time <= end + 1e-12 * (1.0 + end.abs())
}

/// Half a cosine up over `rise`, level, and down over `rise` before `total`; (1, 0) if `rise` is 0. `total` may be
/// infinite.
pub(super) fn taper(time: f64, total: f64, rise: f64) -> (f64, f64) {
    if rise == 0.0 {
        return (1.0, 0.0);
    }
    let edge = |t: f64, sign: f64| {
        let (sine, cosine) = libm::sincos(PI * t / rise);
        (0.5 * (1.0 - cosine), sign * 0.5 * PI / rise * sine)
    };
    if time < rise {
        edge(time.max(0.0), 1.0)
    } else if total - time < rise {
        edge((total - time).max(0.0), -1.0)
    } else {
        (1.0, 0.0)
    }
}

/// 10 s³ − 15 s⁴ + 6 s⁵ over `rise` and its rate: from 0 to 1 without a jump in velocity or acceleration.
pub(super) fn smooth_rise(time: f64, rise: f64) -> (f64, f64) {
    if time >= rise {
        (1.0, 0.0)
    } else if time <= 0.0 {
        (0.0, 0.0)
    } else {
        let s = time / rise;
        let r = 1.0 - s;
        (
            s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
            30.0 * s * s * r * r / rise,
        )
    }
}

pub(super) fn check_taper(taper_s: f64, duration: f64) -> Result<f64, OutOfDomain> {
    inside(
        "taper_s",
        taper_s,
        taper_s >= 0.0 && 2.0 * taper_s <= duration,
        "at least zero and at most half the duration",
    )
}

/// Sine wave, amplitude · sin(ω (t − start) + phase). It is zero before its start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Sine {
    /// Amplitude, in `unit` or the SI unit of the quantity.
    pub amplitude: f64,
    /// Unit of the amplitude. Default: the SI unit of the quantity.
    #[schemars(example = &"mm")]
    pub unit: Option<Unit>,
    /// Frequency. Give this or `angular_frequency_rad_per_s`.
    pub frequency_hz: Option<f64>,
    /// Angular frequency ω. Give this or `frequency_hz`.
    pub angular_frequency_rad_per_s: Option<f64>,
    /// Phase at the start.
    #[serde(default)]
    #[schemars(example = 0.5)]
    pub phase_rad: f64,
    /// Test time at which the sine begins.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
    /// Number of cycles. Give this, `duration_s` or neither. Default: until the end of the test.
    #[schemars(example = 10.0)]
    pub cycles: Option<f64>,
    /// Duration of the sine. Give this, `cycles` or neither. Default: until the end of the test.
    #[schemars(example = 5.0)]
    pub duration_s: Option<f64>,
    /// Length of the half-cosine taper at each end of the sine.
    #[serde(default)]
    #[schemars(example = 0.5)]
    pub taper_s: f64,
}

impl Sine {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        let omega = match one_of(
            "frequency_hz, angular_frequency_rad_per_s",
            self.frequency_hz,
            self.angular_frequency_rad_per_s,
        )? {
            OneOf::First(hz) => 2.0 * PI * positive("frequency_hz", hz)?,
            OneOf::Second(omega) => positive("angular_frequency_rad_per_s", omega)?,
        };
        let duration = match (self.cycles, self.duration_s) {
            (None, None) => f64::INFINITY,
            (Some(cycles), None) => positive("cycles", cycles)? * 2.0 * PI / omega,
            (None, Some(duration)) => positive("duration_s", duration)?,
            (Some(_), Some(_)) => {
                return Err(MotionError::AtMostOne {
                    names: "cycles, duration_s",
                    found: 2,
                });
            }
        };
        let amplitude = finite("amplitude", self.amplitude)? * factor(self.unit, quantity)?;
        let phase = finite("phase_rad", self.phase_rad)?;
        let start = not_negative("start_s", self.start_s)?;
        let rise = check_taper(self.taper_s, duration)?;
        Ok(Curve {
            at: Box::new(move |time| {
                if !within(time, start, start + duration) {
                    return (0.0, 0.0);
                }
                let t = time - start;
                let (sine, cosine) = libm::sincos(omega * t + phase);
                let (w, w_rate) = taper(t, duration, rise);
                (
                    amplitude * w * sine,
                    amplitude * (w * omega * cosine + w_rate * sine),
                )
            }),
            top_hz: Some(omega / (2.0 * PI)),
            end: start + duration,
        })
    }
}

/// Change of the frequency of a sweep with time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SweepKind {
    /// Linear in time, f = f₀ + (f₁ − f₀) t/T.
    Linear,
    /// Exponential in time, f = f₀ (f₁/f₀)^(t/T). Each octave takes equal time.
    Exponential,
}

/// Sine wave whose frequency changes from one value to another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Sweep {
    /// Amplitude, in `unit` or the SI unit of the quantity.
    pub amplitude: f64,
    /// Unit of the amplitude. Default: the SI unit of the quantity.
    #[schemars(example = &"mm")]
    pub unit: Option<Unit>,
    /// Frequency at the start.
    pub from_hz: f64,
    /// Frequency at the end. It may be lower than `from_hz`.
    pub to_hz: f64,
    /// Duration of the sweep.
    pub duration_s: f64,
    /// Change of the frequency with time.
    pub kind: SweepKind,
    /// Test time at which the sweep begins.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
    /// Length of the half-cosine taper at each end of the sweep.
    #[serde(default)]
    #[schemars(example = 0.5)]
    pub taper_s: f64,
}

impl Sweep {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        let amplitude = finite("amplitude", self.amplitude)? * factor(self.unit, quantity)?;
        let (f0, f1) = (
            positive("from_hz", self.from_hz)?,
            positive("to_hz", self.to_hz)?,
        );
        let duration = positive("duration_s", self.duration_s)?;
        let start = not_negative("start_s", self.start_s)?;
        let rise = check_taper(self.taper_s, duration)?;
        // An exponential sweep over no interval is a sine, as is the linear one.
        let kind = if f0 == f1 {
            SweepKind::Linear
        } else {
            self.kind
        };
        let octaves = libm::log(f1 / f0);
        Ok(Curve {
            at: Box::new(move |time| {
                if !within(time, start, start + duration) {
                    return (0.0, 0.0);
                }
                let t = (time - start).clamp(0.0, duration);
                let (turns, hz) = match kind {
                    SweepKind::Linear => {
                        let slope = (f1 - f0) / duration;
                        (f0 * t + 0.5 * slope * t * t, f0 + slope * t)
                    }
                    SweepKind::Exponential => {
                        let growth = libm::exp(octaves * t / duration);
                        // expm1 keeps the first turns exact.
                        let grown = libm::expm1(octaves * t / duration);
                        (f0 * duration / octaves * grown, f0 * growth)
                    }
                };
                let (sine, cosine) = libm::sincos(2.0 * PI * turns);
                let (w, w_rate) = taper(t, duration, rise);
                (
                    amplitude * w * sine,
                    amplitude * (w * 2.0 * PI * hz * cosine + w_rate * sine),
                )
            }),
            top_hz: Some(f0.max(f1)),
            end: start + duration,
        })
    }
}

/// Ricker pulse, amplitude · (1 − 2a) e^{−a} with a = (π f (t − centre))². Its mean is zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Ricker {
    /// Peak value, in `unit` or the SI unit of the quantity.
    #[schemars(example = 1.0)]
    pub amplitude: f64,
    /// Unit of the amplitude. Default: the SI unit of the quantity.
    #[schemars(example = &"g")]
    pub unit: Option<Unit>,
    /// Frequency f with the largest Fourier amplitude.
    #[schemars(example = 2.0)]
    pub frequency_hz: f64,
    /// Test time of the peak. Default: 1.5 / f, so that the value at the start is below 1e-8 of the
    /// peak.
    #[schemars(example = 1.0)]
    pub centre_s: Option<f64>,
}

impl Ricker {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        let amplitude = finite("amplitude", self.amplitude)? * factor(self.unit, quantity)?;
        let hz = positive("frequency_hz", self.frequency_hz)?;
        let centre = finite("centre_s", self.centre_s.unwrap_or(1.5 / hz))?;
        let s = (PI * hz) * (PI * hz);
        Ok(Curve {
            at: Box::new(move |time| {
                let t = time - centre;
                let a = s * t * t;
                let decay = libm::exp(-a);
                (
                    amplitude * (1.0 - 2.0 * a) * decay,
                    -amplitude * 2.0 * s * t * (3.0 - 2.0 * a) * decay,
                )
            }),
            // Its spectrum f²e^{−f²} has fallen to 1e-5 of the peak there.
            top_hz: Some(4.0 * hz),
            end: centre + 1.5 / hz,
        })
    }
}

/// Constant value at all times.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Constant {
    /// Value, in `unit` or the SI unit of the quantity.
    #[schemars(example = 1.0)]
    pub value: f64,
    /// Unit of the value. Default: the SI unit of the quantity.
    #[schemars(example = &"mm")]
    pub unit: Option<Unit>,
}

impl Constant {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        let value = finite("value", self.value)? * factor(self.unit, quantity)?;
        Ok(Curve {
            at: Box::new(move |_| (value, 0.0)),
            top_hz: None,
            end: f64::INFINITY,
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use gusset_quantity::assert_is;

    /// The rate agrees with a difference of the values, away from `corners`.
    pub(crate) fn rate_is_the_derivative(curve: &Curve, end: f64, corners: &[f64]) {
        let h = 1e-5;
        let mut time = 0.003_1;
        let size = (0..2000)
            .map(|i| (curve.at)(end * f64::from(i) / 2000.0).1.abs())
            .fold(0.0, f64::max);
        while time < end {
            if corners.iter().all(|c| (time - c).abs() > 2.0 * h) {
                let value = |t: f64| (curve.at)(t).0;
                // Fourth-order difference: error h⁴ x⁗'/30, below 1e-9 of the rate at ωh < 1e-2; rounding 1e-16/h.
                let difference = (8.0 * (value(time + h) - value(time - h))
                    - (value(time + 2.0 * h) - value(time - 2.0 * h)))
                    / (12.0 * h);
                let rate = (curve.at)(time).1;
                assert!(
                    (rate - difference).abs() < 1e-7 * (size + 1.0),
                    "at {time}: {rate} {difference}"
                );
            }
            time += 0.017_3;
        }
    }

    fn sine() -> Sine {
        Sine {
            amplitude: 2.0,
            unit: None,
            frequency_hz: Some(1.5),
            angular_frequency_rad_per_s: None,
            phase_rad: 0.0,
            start_s: 0.0,
            cycles: None,
            duration_s: None,
            taper_s: 0.0,
        }
    }

    fn sweep(kind: SweepKind) -> Sweep {
        Sweep {
            amplitude: 0.5,
            unit: None,
            from_hz: 0.5,
            to_hz: 8.0,
            duration_s: 12.0,
            kind,
            start_s: 1.0,
            taper_s: 0.0,
        }
    }

    #[test]
    fn sine_has_its_formula() {
        let paper = Sine {
            amplitude: 20.0,
            frequency_hz: None,
            angular_frequency_rad_per_s: Some(1.0),
            ..sine()
        };
        let curve = paper.curve(Quantity::Force).unwrap();
        for i in 0..100 {
            let t = 0.05 * f64::from(i);
            let (value, rate) = (curve.at)(t);
            // Two implementations of the circle functions, each good to the last bit.
            assert!((value - 20.0 * libm::sin(t)).abs() < 1e-14 * 20.0);
            assert!((rate - 20.0 * libm::cos(t)).abs() < 1e-14 * 20.0);
        }
        let late = Sine {
            start_s: 1.0,
            cycles: Some(2.5),
            phase_rad: 0.3,
            unit: Some(Unit::Gravity),
            ..sine()
        };
        let curve = late.curve(Quantity::Acceleration).unwrap();
        assert_eq!((curve.at)(0.99), (0.0, 0.0));
        let inside = (curve.at)(1.5).0;
        let exact = 2.0 * 9.806_65 * libm::sin(2.0 * PI * 1.5 * 0.5 + 0.3);
        assert!((inside - exact).abs() < 1e-13);
        // 2.5 cycles of 1.5 Hz end at 1 + 5/3 s.
        assert!((curve.at)(2.66).0 != 0.0);
        assert_eq!((curve.at)(2.67), (0.0, 0.0));
    }

    #[test]
    fn sweep_frequency_follows_its_law() {
        // Zeros of sin 2πφ are where φ is a multiple of ½: they give the phase without its formula. φ is the integral
        // of the frequency, computed here by Simpson's rule from the frequency's own definition.
        for (kind, hz) in [
            (
                SweepKind::Linear,
                (|s: f64| 0.5 + 7.5 * s) as fn(f64) -> f64,
            ),
            (SweepKind::Exponential, |s: f64| {
                0.5 * libm::pow(16.0_f64, s)
            }),
        ] {
            let curve = sweep(kind).curve(Quantity::Displacement).unwrap();
            let phase = |t: f64| {
                let n = 2000;
                let h = t / f64::from(n);
                let sum: f64 = (0..=n)
                    .map(|i| {
                        let weight = match i {
                            0 => 1.0,
                            i if i == n => 1.0,
                            i if i % 2 == 1 => 4.0,
                            _ => 2.0,
                        };
                        weight * hz(f64::from(i) * h / 12.0)
                    })
                    .sum();
                sum * h / 3.0
            };
            for i in 0..60 {
                let t = 0.2 * f64::from(i);
                let exact = 0.5 * libm::sin(2.0 * PI * phase(t));
                // Simpson's error: below 1e-11 of the phase of 50 turns, times 2π.
                assert!(((curve.at)(1.0 + t).0 - exact).abs() < 1e-8, "{kind:?} {t}");
            }
            // Instantaneous frequency from the quadrature of value and rate: (x')² = (2πf)² (A² − x²).
            for i in 1..60 {
                let t = 0.2 * f64::from(i) + 0.013;
                let (value, rate) = (curve.at)(1.0 + t);
                if 0.25 - value * value > 0.02 {
                    let found = rate.abs() / (2.0 * PI * (0.25 - value * value).sqrt());
                    assert!((found / hz(t / 12.0) - 1.0).abs() < 1e-10, "{kind:?} {t}");
                }
            }
            assert_eq!((curve.at)(0.9), (0.0, 0.0));
            assert_eq!((curve.at)(13.1), (0.0, 0.0));
            assert_eq!(curve.top_hz, Some(8.0));
        }
    }

    #[test]
    fn rates_are_derivatives() {
        let tapered = Sine {
            taper_s: 0.4,
            duration_s: Some(2.0),
            phase_rad: 0.7,
            ..sine()
        };
        let curve = tapered.curve(Quantity::Displacement).unwrap();
        // The taper starts and ends with a kink in the second derivative, which the difference sees too.
        rate_is_the_derivative(&curve, 2.5, &[0.0, 0.4, 1.6, 2.0]);
        for kind in [SweepKind::Linear, SweepKind::Exponential] {
            let tapered = Sweep {
                taper_s: 2.0,
                ..sweep(kind)
            };
            let curve = tapered.curve(Quantity::Displacement).unwrap();
            rate_is_the_derivative(&curve, 13.0, &[1.0, 3.0, 11.0, 13.0]);
            assert!((curve.at)(1.0).0.abs() < 1e-15 && (curve.at)(13.0).0.abs() < 1e-15);
        }
        let ricker = Ricker {
            amplitude: 3.0,
            unit: None,
            frequency_hz: 2.0,
            centre_s: None,
        };
        let curve = ricker.curve(Quantity::Acceleration).unwrap();
        rate_is_the_derivative(&curve, 2.0, &[]);
        // Peak at 1.5/f; first zero where 2 (π f t)² = 1.
        assert_eq!((curve.at)(0.75), (3.0, -0.0));
        assert!((curve.at)(0.75 + 1.0 / (2.0 * PI * 2.0_f64.sqrt())).0.abs() < 1e-14);
        assert!((curve.at)(0.0).0.abs() < 1e-7);
    }

    #[test]
    fn exponential_sweep_of_no_width_is_a_sine() {
        let flat = Sweep {
            to_hz: 0.5,
            ..sweep(SweepKind::Exponential)
        };
        let curve = flat.curve(Quantity::Displacement).unwrap();
        let exact = 0.5 * libm::sin(2.0 * PI * 0.5 * 3.3);
        assert!(((curve.at)(4.3).0 - exact).abs() < 1e-13);
    }

    #[test]
    fn bad_parameters_are_named() {
        let refused = |sine: Sine| sine.curve(Quantity::Displacement).err().unwrap();
        assert_is!(
            refused(Sine { frequency_hz: Some(0.0), ..sine() })
            => MotionError::Parameter(OutOfDomain { name: "frequency_hz", found: 0.0, .. })
        );
        assert_is!(
            refused(Sine { angular_frequency_rad_per_s: Some(1.0), ..sine() })
            => MotionError::ExactlyOne { names: "frequency_hz, angular_frequency_rad_per_s", found: 2 }
        );
        assert_is!(
            refused(Sine { cycles: Some(1.0), duration_s: Some(1.0), ..sine() })
            => MotionError::AtMostOne { names: "cycles, duration_s", found: 2 }
        );
        assert_is!(
            refused(Sine { amplitude: f64::NAN, ..sine() })
            => MotionError::Parameter(OutOfDomain { name: "amplitude", .. })
        );
        assert_is!(
            refused(Sine { unit: Some(Unit::Gravity), ..sine() })
            => MotionError::UnitMismatch { unit: Unit::Gravity, quantity: Quantity::Displacement, .. }
        );
        assert_is!(
            refused(Sine { taper_s: 2.0, duration_s: Some(3.0), ..sine() })
            => MotionError::Parameter(OutOfDomain { name: "taper_s", found: 2.0, .. })
        );
        for value in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(
                Sweep {
                    duration_s: value,
                    ..sweep(SweepKind::Linear)
                }
                .curve(Quantity::Force)
                .is_err()
            );
            assert!(
                Sweep {
                    to_hz: value,
                    ..sweep(SweepKind::Linear)
                }
                .curve(Quantity::Force)
                .is_err()
            );
            assert!(
                Sine {
                    start_s: value,
                    ..sine()
                }
                .curve(Quantity::Force)
                .is_err()
            );
        }
    }
}
