//! Signals in closed form that go from place to place: steps, ramps with rests, cycles of given amplitudes.
//!
//! Amplitudes are in the key `unit` beside them, or in the SI unit of the quantity if `unit` is absent; speeds are in that
//! unit per second. A step and a ramp stay where they went. At a corner the rate is that of what follows.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, finite, inside, not_negative, positive};
use super::shapes::{Curve, OneOf, factor, one_of, reached, smooth_rise};
use super::unit::{Quantity, Unit};

/// Step: zero before its start, then constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Step {
    /// Value after the step, in `unit` or the SI unit of the quantity.
    #[schemars(example = 0.01)]
    pub amplitude: f64,
    /// Unit of the amplitude. Default: the SI unit of the quantity.
    #[schemars(example = &"mm")]
    pub unit: Option<Unit>,
    /// Test time of the step.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
    /// Length of a smooth rise by a polynomial of fifth order, without a jump in velocity or
    /// acceleration. 0 is a sudden step.
    #[serde(default)]
    #[schemars(example = 0.5)]
    pub rise_s: f64,
}

impl Step {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        let amplitude = finite("amplitude", self.amplitude)? * factor(self.unit, quantity)?;
        let start = not_negative("start_s", self.start_s)?;
        let rise = not_negative("rise_s", self.rise_s)?;
        Ok(Curve {
            at: Box::new(move |time| {
                if !reached(time, start) {
                    return (0.0, 0.0);
                }
                if rise == 0.0 {
                    return (amplitude, 0.0);
                }
                let (s, rate) = smooth_rise(time - start, rise);
                (amplitude * s, amplitude * rate)
            }),
            top_hz: None,
            end: start + rise,
        })
    }
}

/// Shape of a ramp between two levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RampShape {
    /// Constant speed.
    #[default]
    Linear,
    /// Half a cosine whose highest speed is `speed`.
    Smooth,
}

/// Ramps between levels at a given speed, with a rest at each level. The motion starts at zero and
/// stays at the last level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct RampAndHold {
    /// Levels, in `unit` or the SI unit of the quantity. End with 0 to return to the start.
    #[schemars(example = [0.01, -0.01, 0.0])]
    pub levels: Vec<f64>,
    /// Unit of the levels. Default: the SI unit of the quantity.
    #[schemars(example = &"mm")]
    pub unit: Option<Unit>,
    /// Highest speed of the ramps, in the unit of the levels per second.
    #[schemars(example = 0.002)]
    pub speed: f64,
    /// Rest at each level.
    #[schemars(example = 2.0)]
    pub hold_s: f64,
    /// Test time at which the first ramp begins.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
    /// Shape of the ramps.
    #[serde(default)]
    #[schemars(example = &"smooth")]
    pub shape: RampShape,
}

impl RampAndHold {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        let unit = factor(self.unit, quantity)?;
        let speed = positive("speed", self.speed)? * unit;
        let hold = not_negative("hold_s", self.hold_s)?;
        let shape = self.shape;
        let mut start = not_negative("start_s", self.start_s)?;
        let mut from = 0.0;
        // (start, end, from, to) of each ramp.
        let mut ramps = Vec::with_capacity(self.levels.len());
        for level in &self.levels {
            let to = finite("levels", *level)? * unit;
            let stretch = match shape {
                RampShape::Linear => 1.0,
                RampShape::Smooth => 0.5 * PI,
            };
            let end = start + stretch * (to - from).abs() / speed;
            ramps.push((start, end, from, to));
            start = end + hold;
            from = to;
        }
        let Some(&(_, last, ..)) = ramps.last() else {
            return Err(MotionError::Length {
                what: "levels",
                wanted: 1,
                found: 0,
            });
        };
        Ok(Curve {
            at: Box::new(move |time| {
                let begun = ramps.partition_point(|(start, ..)| reached(time, *start));
                let Some(&(start, end, from, to)) = begun.checked_sub(1).and_then(|i| ramps.get(i))
                else {
                    return (0.0, 0.0);
                };
                let duration = end - start;
                let t = (time - start).max(0.0);
                if t >= duration {
                    return (to, 0.0);
                }
                match shape {
                    RampShape::Linear => {
                        let rate = (to - from) / duration;
                        (from + rate * t, rate)
                    }
                    RampShape::Smooth => {
                        let (sine, cosine) = libm::sincos(PI * t / duration);
                        (
                            from + (to - from) * 0.5 * (1.0 - cosine),
                            (to - from) * 0.5 * PI / duration * sine,
                        )
                    }
                }
            }),
            top_hz: None,
            end: last,
        })
    }
}

/// Shape of one cycle. Each shape starts at zero and rises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CyclicShape {
    /// Sine wave.
    #[default]
    Sine,
    /// Straight lines with constant speed.
    Triangle,
}

/// Cycles with given amplitudes. Use it for a cyclic test before a hybrid test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Cyclic {
    /// Amplitudes, in `unit` or the SI unit of the quantity. A negative amplitude starts in the
    /// negative direction.
    pub amplitudes: Vec<f64>,
    /// Unit of the amplitudes. Default: the SI unit of the quantity.
    #[schemars(example = &"mm")]
    pub unit: Option<Unit>,
    /// Number of cycles with each amplitude.
    #[schemars(range(min = 1, max = u32::MAX))]
    pub cycles_per_amplitude: u32,
    /// Shape of one cycle.
    #[serde(default)]
    pub shape: CyclicShape,
    /// Frequency of each cycle. Give this or `speed`.
    pub frequency_hz: Option<f64>,
    /// Highest speed of each cycle, in the unit of the amplitudes per second. Give this or
    /// `frequency_hz`.
    #[schemars(example = 0.005)]
    pub speed: Option<f64>,
    /// Rest at zero after each amplitude.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub rest_s: f64,
    /// Test time at which the first cycle begins.
    #[serde(default)]
    #[schemars(example = 1.0)]
    pub start_s: f64,
}

impl Cyclic {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        let pace = one_of("frequency_hz, speed", self.frequency_hz, self.speed)?;
        let unit = factor(self.unit, quantity)?;
        let shape = self.shape;
        let rest = not_negative("rest_s", self.rest_s)?;
        let mut start = not_negative("start_s", self.start_s)?;
        let cycles = f64::from(self.cycles_per_amplitude);
        inside("cycles_per_amplitude", cycles, cycles >= 1.0, "at least 1")?;
        // (start, end, amplitude, frequency) of each block.
        let mut blocks = Vec::with_capacity(self.amplitudes.len());
        let mut top_hz = 0.0_f64;
        for amplitude in &self.amplitudes {
            let is_some = *amplitude != 0.0;
            let amplitude = inside("amplitudes", *amplitude, is_some, "finite and not zero")?;
            let hz = match pace {
                OneOf::First(hz) => positive("frequency_hz", hz)?,
                OneOf::Second(speed) => {
                    let speed = positive("speed", speed)?;
                    match shape {
                        CyclicShape::Sine => speed / (2.0 * PI * amplitude.abs()),
                        CyclicShape::Triangle => speed / (4.0 * amplitude.abs()),
                    }
                }
            };
            let end = start + cycles / hz;
            blocks.push((start, end, amplitude * unit, hz));
            start = end + rest;
            top_hz = top_hz.max(hz);
        }
        let Some(&(_, last, ..)) = blocks.last() else {
            return Err(MotionError::Length {
                what: "amplitudes",
                wanted: 1,
                found: 0,
            });
        };
        Ok(Curve {
            at: Box::new(move |time| {
                let begun = blocks.partition_point(|(start, ..)| reached(time, *start));
                let Some(&(start, end, amplitude, hz)) =
                    begun.checked_sub(1).and_then(|i| blocks.get(i))
                else {
                    return (0.0, 0.0);
                };
                if time >= end {
                    return (0.0, 0.0);
                }
                let turns = hz * (time - start).max(0.0);
                match shape {
                    CyclicShape::Sine => {
                        let (sine, cosine) = libm::sincos(2.0 * PI * turns);
                        (amplitude * sine, amplitude * 2.0 * PI * hz * cosine)
                    }
                    CyclicShape::Triangle => {
                        let phase = turns - turns.floor();
                        let (form, sign) = if phase < 0.25 {
                            (4.0 * phase, 1.0)
                        } else if phase < 0.75 {
                            (2.0 - 4.0 * phase, -1.0)
                        } else {
                            (4.0 * phase - 4.0, 1.0)
                        };
                        (amplitude * form, amplitude * sign * 4.0 * hz)
                    }
                }
            }),
            top_hz: Some(top_hz),
            end: last,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::tests::rate_is_the_derivative;

    fn cyclic() -> Cyclic {
        Cyclic {
            amplitudes: vec![1.0, -2.0],
            unit: Some(Unit::Millimetre),
            cycles_per_amplitude: 2,
            shape: CyclicShape::Sine,
            frequency_hz: Some(0.5),
            speed: None,
            rest_s: 1.0,
            start_s: 0.5,
        }
    }

    fn ramp() -> RampAndHold {
        RampAndHold {
            levels: vec![2.0, -1.0, 0.0],
            unit: Some(Unit::Centimetre),
            speed: 4.0,
            hold_s: 0.5,
            start_s: 1.0,
            shape: RampShape::Linear,
        }
    }

    #[test]
    fn cycles_have_amplitudes_and_rests() {
        let curve = cyclic().curve(Quantity::Displacement).unwrap();
        let at = |t: f64| (curve.at)(t).0;
        // Two cycles of 2 s from 0.5 s, a rest of 1 s, two cycles of the other amplitude from 5.5 s.
        for (t, value) in [
            (0.2, 0.0),
            (1.0, 1e-3),
            (2.0, -1e-3),
            (3.0, 1e-3),
            (5.0, 0.0),
            (6.0, -2e-3),
            (7.0, 2e-3),
            (9.6, 0.0),
        ] {
            assert!((at(t) - value).abs() < 1e-17, "{t}: {}", at(t));
        }
        rate_is_the_derivative(&curve, 10.0, &[0.5, 4.5, 5.5, 9.5]);
    }

    #[test]
    fn triangle_moves_at_its_speed() {
        let triangle = Cyclic {
            shape: CyclicShape::Triangle,
            frequency_hz: None,
            speed: Some(4.0),
            start_s: 0.0,
            rest_s: 0.0,
            ..cyclic()
        };
        // Periods 4A/v: 1 s, then 2 s; 4 mm/s throughout.
        let curve = triangle.curve(Quantity::Displacement).unwrap();
        for (t, value) in [
            (0.25, 1e-3),
            (0.5, 0.0),
            (0.75, -1e-3),
            (1.125, 0.5e-3),
            (2.5, -2e-3),
            (3.5, 2e-3),
        ] {
            assert!(((curve.at)(t).0 - value).abs() < 1e-17, "{t}");
        }
        for i in 0..600 {
            let (_, rate) = (curve.at)(0.01 * f64::from(i) + 0.0033);
            assert!((rate.abs() - 4e-3).abs() < 1e-17);
        }
        rate_is_the_derivative(
            &curve,
            6.0,
            &[0.25, 0.75, 1.25, 1.75, 2.0, 2.5, 3.5, 4.5, 5.5, 6.0],
        );
        // A sine of given peak speed: f = v / 2πA.
        let sine = Cyclic {
            shape: CyclicShape::Sine,
            ..triangle
        };
        let curve = sine.curve(Quantity::Displacement).unwrap();
        assert!(((curve.at)(0.0).1 - 4e-3).abs() < 1e-17);
    }

    #[test]
    fn ramps_keep_their_speed_and_level() {
        let curve = ramp().curve(Quantity::Displacement).unwrap();
        // 2 cm in 0.5 s, rest 0.5 s, 3 cm in 0.75 s, rest, 1 cm in 0.25 s.
        for (t, value, rate) in [
            (0.9, 0.0, 0.0),
            (1.25, 0.01, 0.04),
            (1.75, 0.02, 0.0),
            (2.375, 0.005, -0.04),
            (3.0, -0.01, 0.0),
            (3.375, -0.005, 0.04),
            (9.0, 0.0, 0.0),
        ] {
            let found = (curve.at)(t);
            assert!((found.0 - value).abs() < 1e-16, "{t}: {found:?}");
            assert!((found.1 - rate).abs() < 1e-15, "{t}: {found:?}");
        }
        let smooth = RampAndHold {
            shape: RampShape::Smooth,
            ..ramp()
        };
        let curve = smooth.curve(Quantity::Displacement).unwrap();
        rate_is_the_derivative(&curve, 6.0, &[]);
        let top = (0..60_000)
            .map(|i| (curve.at)(1e-4 * f64::from(i)).1.abs())
            .fold(0.0, f64::max);
        // Read every 0.1 ms: the top of half a cosine is missed by (π·5e-5/0.4)²/2 = 8e-8 at most.
        assert!((top / 0.04 - 1.0).abs() < 1e-7);
    }

    #[test]
    fn step_rises_smoothly_on_request() {
        let step = Step {
            amplitude: 3.0,
            unit: None,
            start_s: 0.3,
            rise_s: 0.0,
        };
        let curve = step.curve(Quantity::Force).unwrap();
        assert_eq!((curve.at)(0.29), (0.0, 0.0));
        // 3 · 0.1 is not 0.3, but it is the step of that name.
        assert_eq!((curve.at)(3.0 * 0.1), (3.0, 0.0));
        let smooth = Step {
            rise_s: 1.0,
            ..step
        };
        let curve = smooth.curve(Quantity::Force).unwrap();
        assert!(((curve.at)(0.8).0 - 1.5).abs() < 1e-15);
        assert_eq!((curve.at)(1.4), (3.0, 0.0));
        rate_is_the_derivative(&curve, 2.0, &[]);
    }

    #[test]
    fn empty_lists_and_zero_cycles_are_refused() {
        let refused = |c: Cyclic| c.curve(Quantity::Displacement).is_err();
        assert!(!refused(cyclic()));
        assert!(refused(Cyclic {
            amplitudes: vec![],
            ..cyclic()
        }));
        assert!(refused(Cyclic {
            amplitudes: vec![0.0],
            ..cyclic()
        }));
        assert!(refused(Cyclic {
            amplitudes: vec![f64::NAN],
            ..cyclic()
        }));
        assert!(refused(Cyclic {
            cycles_per_amplitude: 0,
            ..cyclic()
        }));
        assert!(refused(Cyclic {
            speed: Some(1.0),
            ..cyclic()
        }));
        assert!(refused(Cyclic {
            frequency_hz: None,
            ..cyclic()
        }));
        let refused = |r: RampAndHold| r.curve(Quantity::Displacement).is_err();
        assert!(!refused(ramp()));
        assert!(refused(RampAndHold {
            levels: vec![],
            ..ramp()
        }));
        assert!(refused(RampAndHold {
            speed: 0.0,
            ..ramp()
        }));
        assert!(refused(RampAndHold {
            hold_s: f64::NAN,
            ..ramp()
        }));
    }
}
