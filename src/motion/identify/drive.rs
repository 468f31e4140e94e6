//! The motion that a specimen is driven with, and how far it may go.
//!
//! Rest, motion, rest. Every motion is proportional to its amplitude, so that a limit of displacement, velocity or
//! acceleration is a limit of the amplitude: velocity and acceleration are differences of the commands sent, like the
//! values that the loop's own limits check.

use serde::Serialize;
use thiserror::Error;

use super::Band;
use crate::{
    BandLimitedNoise, Grid, Motion, MotionError, Quantity, RampAndHold, RampShape, Signal, Sweep,
    SweepKind,
};
use gusset_quantity::units::rate;

/// What kind of motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// A sine whose frequency goes evenly through the band.
    Sweep,
    /// Noise within the band.
    Noise,
    /// Steps between changing levels, each with a smooth rise.
    Steps,
}

/// A motion that cannot be.
#[derive(Debug, Error)]
pub enum CourseError {
    /// The band is empty.
    #[error(
        "the band goes from {from_hz} Hz to {to_hz} Hz, but must begin above 0 and end above its beginning"
    )]
    NoBand {
        /// Lower edge.
        from_hz: f64,
        /// Upper edge.
        to_hz: f64,
    },
    /// The ticks do not carry it.
    #[error(
        "the band ends at {to_hz} Hz, but a loop at {} carries less than {}", rate(*rate_hz), rate(*largest)
    )]
    BeyondNyquist {
        /// Upper edge.
        to_hz: f64,
        /// Ticks per second.
        rate_hz: f64,
        /// Half of them.
        largest: f64,
    },
    /// The duration is not positive.
    #[error("the duration is {found} s, but must be finite and greater than 0")]
    Duration {
        /// The requested duration.
        found: f64,
    },
    /// Too short for its band.
    #[error(
        "{duration_s} s is too short for a band from {from_hz} Hz to {to_hz} Hz: at least {shortest:.3} s are needed"
    )]
    TooShort {
        /// Duration requested.
        duration_s: f64,
        /// Lower edge.
        from_hz: f64,
        /// Upper edge.
        to_hz: f64,
        /// Duration that is enough.
        shortest: f64,
    },
    /// The motion cannot be laid out.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// Velocity and acceleration that a motion demands of an actuator, per metre of its amplitude.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Demand {
    /// Greatest velocity in 1/s.
    pub vel: f64,
    /// Greatest acceleration in 1/s².
    pub accel: f64,
}

/// A motion of one axis without its amplitude.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    shape: Shape,
    band: Band,
    /// Its length in s.
    pub duration: f64,
    seed: u64,
    /// The signal's own amplitude, per metre of the largest displacement.
    own: f64,
    /// Demand on an actuator.
    pub demand: Demand,
}

/// Lines of the spectrum that a band must hold at least, and cycles of its lowest frequency.
const LINES: f64 = 32.0;
const CYCLES: f64 = 2.0;
/// Share of the duration, and seconds, over which a motion comes and goes.
const TAPER: f64 = 0.05;
const TAPER_S: f64 = 1.0;

impl Course {
    /// A motion for ticks of `dt` seconds.
    ///
    /// # Errors
    /// [`CourseError`].
    pub fn new(
        shape: Shape,
        band: Band,
        duration: f64,
        seed: u64,
        dt: f64,
    ) -> Result<Self, CourseError> {
        let Band { from_hz, to_hz } = band;
        let is_band = from_hz > 0.0 && to_hz > from_hz && to_hz.is_finite();
        if !is_band {
            return Err(CourseError::NoBand { from_hz, to_hz });
        }
        let nyquist = 0.5 / dt;
        let carried = to_hz < nyquist;
        if !carried {
            return Err(CourseError::BeyondNyquist {
                to_hz,
                rate_hz: 1.0 / dt,
                largest: nyquist,
            });
        }
        let is_length = duration > 0.0 && duration.is_finite();
        if !is_length {
            return Err(CourseError::Duration { found: duration });
        }
        let shortest = (LINES / (to_hz - from_hz)).max(CYCLES / from_hz);
        let enough = duration >= shortest;
        if !enough {
            return Err(CourseError::TooShort {
                duration_s: duration,
                from_hz,
                to_hz,
                shortest,
            });
        }
        let mut course = Self {
            shape,
            band,
            duration,
            seed,
            own: 1.0,
            demand: Demand {
                vel: 0.0,
                accel: 0.0,
            },
        };
        let steps = (duration / dt).ceil() as usize + 2;
        let grid = Grid::new(dt, steps)?;
        let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        let series = course
            .motion(1.0, dt)
            .evaluate(Quantity::Displacement, grid, &none)?;
        let values = &series.values;
        let largest =
            |all: &mut dyn Iterator<Item = f64>| all.fold(0.0, |m: f64, v| m.max(v.abs()));
        let top = largest(&mut values.iter().copied());
        let vel = largest(&mut values.windows(2).map(|w| w[1] - w[0])) / dt;
        let accel = largest(&mut values.windows(3).map(|w| w[2] - 2.0 * w[1] + w[0])) / (dt * dt);
        course.own = 1.0 / top;
        course.demand = Demand {
            vel: vel / top,
            accel: accel / top,
        };
        Ok(course)
    }

    /// The motion from `start` seconds on, up to `amplitude` metres either way.
    #[must_use]
    pub fn motion(&self, amplitude: f64, start: f64) -> Motion {
        let amplitude = amplitude * self.own;
        let Band { from_hz, to_hz } = self.band;
        let duration = self.duration;
        let taper = (TAPER * duration).min(TAPER_S);
        Motion::plain(match self.shape {
            Shape::Sweep => Signal::Sweep(Sweep {
                amplitude,
                unit: None,
                from_hz,
                to_hz,
                duration_s: duration,
                kind: SweepKind::Linear,
                start_s: start,
                taper_s: taper,
            }),
            Shape::Noise => Signal::BandLimitedNoise(BandLimitedNoise {
                rms: amplitude,
                unit: None,
                from_hz,
                to_hz,
                duration_s: duration,
                seed: self.seed,
                start_s: start,
                taper_s: taper,
            }),
            Shape::Steps => {
                let speed = SPEED * to_hz;
                let hold = HOLD / to_hz;
                let levels = levels(self.seed, duration, speed, hold);
                Signal::RampAndHold(RampAndHold {
                    levels: levels.iter().map(|level| amplitude * level).collect(),
                    unit: None,
                    speed: amplitude * speed,
                    hold_s: hold,
                    start_s: start,
                    shape: RampShape::Smooth,
                })
            }
        })
    }
}

/// Highest speed of a step of height 1, in steps per period of the highest frequency: it rises in 0.7 periods, whose spectrum has
/// its first zero at twice that frequency.
const SPEED: f64 = 2.24;
/// Rest at each level, in periods of the highest frequency: actuators arrive.
const HOLD: f64 = 3.0;

/// Levels between −1 and 1 that never repeat, and home.
fn levels(seed: u64, duration: f64, speed: f64, hold: f64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let (mut all, mut at, mut time) = (Vec::new(), 0.0_f64, 0.0);
    let lasts = |way: f64| 0.5 * std::f64::consts::PI * way / speed + hold;
    loop {
        // A linear congruence: only that no two steps are alike matters.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let size = 0.3 + 0.7 * (state >> 40) as f64 / (1_u64 << 24) as f64;
        let level = match all.len() {
            0 => 1.0,
            _ if at > 0.0 && (state >> 39) & 3 != 0 => -size,
            _ => size,
        };
        let spent = lasts((level - at).abs());
        if time + spent + lasts(level.abs()) > duration {
            all.push(0.0);
            return all;
        }
        time += spent;
        at = level;
        all.push(level);
    }
}
