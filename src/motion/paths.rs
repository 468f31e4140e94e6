//! Signals in closed form that go from place to place: steps, ramps with rests, cycles of given amplitudes.
//!
//! Amplitudes are in the key `unit` beside them, or in the SI unit of the quantity if `unit` is absent; speeds are in that
//! unit per second. A step and a ramp stay where they went. At a corner the rate is that of what follows.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, finite, inside, not_negative, positive};
use super::shapes::{Curve, factor, one_of, reached, smooth_rise};
use super::unit::{Quantity, Unit};

/// Zero, then constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Step {
    /// In `unit`, or in the SI unit of the quantity.
    pub amplitude: f64,
    /// Unit of the amplitude; SI if absent.
    pub unit: Option<Unit>,
    /// Time of the step in s; 0 if absent.
    #[serde(default)]
    pub start_s: f64,
    /// Time of a smooth rise (fifth-order polynomial, no jump in velocity or acceleration) in s; 0, a jump, if absent.
    #[serde(default)]
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
        })
    }
}

/// How a ramp goes from level to level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RampShape {
    /// At constant speed.
    #[default]
    Linear,
    /// Half a cosine whose highest speed is the given one.
    Smooth,
}

/// From level to level at a given speed, with a rest at each; starts at zero and stays at the last level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct RampAndHold {
    /// In `unit`, or in the SI unit of the quantity; end with 0 to come home.
    pub levels: Vec<f64>,
    /// Unit of the levels; SI if absent.
    pub unit: Option<Unit>,
    /// Highest speed of the ramps, in the unit of the levels per second.
    pub speed: f64,
    /// Rest at each level in s.
    pub hold_s: f64,
    /// Time of the start in s; 0 if absent.
    #[serde(default)]
    pub start_s: f64,
    /// `linear` (the default) or `smooth`.
    #[serde(default)]
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
        if ramps.is_empty() {
            return Err(MotionError::Length {
                what: "levels",
                wanted: 1,
                found: 0,
            });
        }
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
        })
    }
}

/// Form of one cycle; both start at zero and rise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CyclicShape {
    /// A sine.
    #[default]
    Sine,
    /// Straight lines: constant speed.
    Triangle,
}

/// Cycles of growing (or any) amplitude: the test before every hybrid test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct Cyclic {
    /// In `unit`, or in the SI unit of the quantity; a negative one starts downwards.
    pub amplitudes: Vec<f64>,
    /// Unit of the amplitudes; SI if absent.
    pub unit: Option<Unit>,
    /// Whole cycles at each amplitude.
    pub cycles_per_amplitude: u32,
    /// `sine` (the default) or `triangle`.
    #[serde(default)]
    pub shape: CyclicShape,
    /// Frequency of every cycle in Hz; this or `speed`.
    pub frequency_hz: Option<f64>,
    /// Highest speed of every cycle, in the unit of the amplitudes per second; this or `frequency_hz`.
    pub speed: Option<f64>,
    /// Rest at zero after each amplitude in s; 0 if absent.
    #[serde(default)]
    pub rest_s: f64,
    /// Time of the start in s; 0 if absent.
    #[serde(default)]
    pub start_s: f64,
}

impl Cyclic {
    pub(super) fn curve(&self, quantity: Quantity) -> Result<Curve, MotionError> {
        one_of("frequency_hz, speed", self.frequency_hz, self.speed)?;
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
            let hz = match (self.frequency_hz, self.speed) {
                (Some(hz), _) => positive("frequency_hz", hz)?,
                (_, speed) => {
                    let speed = positive("speed", speed.unwrap_or(f64::NAN))?;
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
        if blocks.is_empty() {
            return Err(MotionError::Length {
                what: "amplitudes",
                wanted: 1,
                found: 0,
            });
        }
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
        })
    }
}
