//! `[specimen.transfer]`: a transfer system in the test file.

use nalgebra::Complex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::between_ticks::BetweenTicks;
use super::exact::is_hurwitz;
use super::sensor::{DispSensorSpec, ForceSensorSpec};
use super::{TransferError, delay};
use gusset_quantity::domain::{not_negative, positive};

/// Simulated actuator and sensors between the command and the measurement of a simulated specimen.
/// The order is: delay, actuator, limits of rate, stroke and force, sensors. Each axis has its own.
/// Units are SI at the specimen. Without any key, nothing is changed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case", default)]
pub struct TransferSpec {
    /// Pure delay of the command. It need not be a whole number of ticks.
    #[schemars(example = 0.008)]
    pub delay_s: f64,
    /// Command between two ticks: a ramp or a constant value. The delay acts before it.
    #[schemars(example = &"held")]
    pub between_ticks: BetweenTicks,
    /// Dynamics of the actuator. Default: none, the actuator follows at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuator: Option<ActuatorSpec>,
    /// Largest speed of the actuator. Not for `servo_hydraulic`. Default: unlimited.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.5)]
    pub rate_limit_m_per_s: Option<f64>,
    /// Largest displacement of the actuator in both directions. Default: unlimited.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.1)]
    pub stroke_m: Option<f64>,
    /// Largest force of the actuator. The actuator stalls beyond it. Default: unlimited.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_limit_n: Option<f64>,
    /// Displacement sensor.
    pub disp_sensor: DispSensorSpec,
    /// Load cell.
    pub force_sensor: ForceSensorSpec,
    /// Seed of the sensor noise. Equal seeds give equal noise.
    pub seed: u64,
}

/// Dynamics of an actuator with command u and position x.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum ActuatorSpec {
    /// Gain without lag, x = g u.
    Proportional(ProportionalSpec),
    /// First-order lag, T ẋ + x = g u.
    FirstOrder(FirstOrderSpec),
    /// Second-order lag, ẍ + 2 ζ ω ẋ + ω² x = ω² g u.
    SecondOrder(SecondOrderSpec),
    /// Servo-hydraulic actuator that interacts with the specimen.
    ServoHydraulic(ServoHydraulicSpec),
}

/// Gain without lag, x = g u.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct ProportionalSpec {
    /// Gain g.
    #[schemars(example = 0.98)]
    pub gain: f64,
}

/// First-order lag, T ẋ + x = g u.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct FirstOrderSpec {
    /// Time constant T.
    #[schemars(example = 0.01)]
    pub time_constant_s: f64,
    /// Gain g.
    #[serde(default = "one")]
    #[schemars(example = 0.98)]
    pub gain: f64,
}

/// Second-order lag, ẍ + 2 ζ ω ẋ + ω² x = ω² g u.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct SecondOrderSpec {
    /// Natural frequency ω / 2π.
    #[schemars(example = 20.0)]
    pub frequency_hz: f64,
    /// Damping ratio ζ, greater than 0.
    #[schemars(example = 0.7)]
    pub damping_ratio: f64,
    /// Gain g.
    #[serde(default = "one")]
    #[schemars(example = 0.98)]
    pub gain: f64,
}

/// Servo-hydraulic actuator with control–structure interaction: two poles of the servo-valve, one
/// of the cylinder, and the specimen in the loop. The defaults are the plant of the virtual hybrid
/// simulation benchmark.
///
/// The servo-valve is q̈ + β₁ q̇ + β₂ q = A (g u − x). The cylinder is ḟ + a₃ f = q − a₂ ẋ, and the
/// specimen is m ẍ + R(x, ẋ) = f. R is the law of the specimen. The load cell measures f, which
/// includes inertia.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case", default)]
pub struct ServoHydraulicSpec {
    /// Gain A = a₁ β₀ of the servo-valve. Its unit is N/(m s³).
    #[schemars(example = 2.1283e13)]
    pub valve_gain: f64,
    /// Coefficient β₁ of the servo-valve.
    #[schemars(example = 425.0)]
    pub valve_damping_per_s: f64,
    /// Coefficient β₂ of the servo-valve.
    #[schemars(example = 9.9976e4)]
    pub valve_stiffness_per_s2: f64,
    /// Natural velocity feedback a₂ of the cylinder.
    #[schemars(example = 4.2297e6)]
    pub velocity_feedback_n_per_m: f64,
    /// Leakage a₃ of the cylinder.
    #[schemars(example = 3.3)]
    pub leakage_per_s: f64,
    /// Gain g of the command.
    #[schemars(example = 1.0261)]
    pub gain: f64,
    /// Mass m that the actuator moves and whose inertia the load cell measures. Also set
    /// `mass_in_force_kg` of the specimen to it.
    #[schemars(example = 29.13)]
    pub mass_kg: f64,
}

impl Default for ServoHydraulicSpec {
    fn default() -> Self {
        Self {
            valve_gain: 2.1283e13,
            valve_damping_per_s: 425.0,
            valve_stiffness_per_s2: 9.9976e4,
            velocity_feedback_n_per_m: 4.2297e6,
            leakage_per_s: 3.3,
            gain: 1.0261,
            mass_kg: 29.13,
        }
    }
}

const fn one() -> f64 {
    1.0
}

impl TransferSpec {
    /// Every key for itself, and the delay against the longest history. `dt` is the tick in s of test time, if known.
    ///
    /// # Errors
    /// The first key that is wrong.
    pub(crate) fn check(&self, dt: Option<f64>) -> Result<(), TransferError> {
        not_negative("delay_s", self.delay_s)?;
        let entries = self.delay_s / dt.unwrap_or(DEFAULT_DT) + 2.0;
        if entries > delay::LONGEST as f64 {
            return Err(TransferError::History {
                delay: self.delay_s,
                ticks: entries - 2.0,
                most: delay::LONGEST - 2,
            });
        }
        for (name, value) in [
            ("rate_limit_m_per_s", self.rate_limit_m_per_s),
            ("stroke_m", self.stroke_m),
            ("force_limit_n", self.force_limit_n),
        ] {
            if let Some(value) = value {
                positive(name, value)?;
            }
        }
        self.disp_sensor.build()?;
        self.force_sensor.build()?;
        let gain = match &self.actuator {
            None => return Ok(()),
            Some(ActuatorSpec::Proportional(spec)) => spec.gain,
            Some(ActuatorSpec::FirstOrder(spec)) => {
                positive("time_constant_s", spec.time_constant_s)?;
                spec.gain
            }
            Some(ActuatorSpec::SecondOrder(spec)) => {
                positive("frequency_hz", spec.frequency_hz)?;
                positive("damping_ratio", spec.damping_ratio)?;
                spec.gain
            }
            Some(ActuatorSpec::ServoHydraulic(spec)) => {
                if self.rate_limit_m_per_s.is_some() {
                    return Err(TransferError::NotApplicable {
                        name: "rate_limit_m_per_s",
                        what: "`servo_hydraulic`, whose valve knows no limit of flow",
                    });
                }
                spec.check()?;
                spec.gain
            }
        };
        positive("gain", gain)?;
        Ok(())
    }

    /// True if the actuator lags behind its command.
    #[must_use]
    pub const fn lags(&self) -> bool {
        !matches!(self.actuator, None | Some(ActuatorSpec::Proportional(_)))
    }

    /// True if it changes velocities: an actuator that lags, or a limit of speed.
    #[must_use]
    pub fn has_its_own_time(&self) -> bool {
        self.lags() || self.rate_limit_m_per_s.is_some()
    }

    /// True if a sensor is noisy: no two seeds are the same.
    #[must_use]
    pub fn is_noisy(&self) -> bool {
        let (disp, force) = (&self.disp_sensor, &self.force_sensor);
        let noises = [
            disp.noise_rms_m,
            disp.noise_power_m2_s,
            force.noise_rms_n,
            force.noise_power_n2_s,
        ];
        noises.iter().flatten().any(|noise| *noise > 0.0)
    }

    /// Entries that the history of commands needs.
    pub(super) fn entries(&self, dt: Option<f64>) -> usize {
        match dt {
            Some(dt) => (self.delay_s / dt).ceil() as usize + 4,
            None => delay::LONGEST,
        }
    }

    /// [`TransferSpec::response`] for commands of `tick` seconds, including the effect of a held command.
    #[must_use]
    pub fn response_to_ticks(
        &self,
        omega: f64,
        stiffness: f64,
        damping: f64,
        tick: f64,
    ) -> Complex<f64> {
        let continuous = self.response(omega, stiffness, damping);
        if self.lags() {
            continuous * self.between_ticks.response(omega, tick)
        } else {
            continuous
        }
    }

    /// Phase lag in s at ω in rad/s for commands of `tick` seconds. A held command leads by half a tick.
    #[must_use]
    pub fn lag_to_ticks(&self, omega: f64, stiffness: f64, damping: f64, tick: f64) -> f64 {
        let lead = match self.between_ticks {
            BetweenTicks::Held if self.lags() => 0.5 * tick,
            BetweenTicks::Held | BetweenTicks::Ramped => 0.0,
        };
        self.lag(omega, stiffness, damping) - lead
    }

    /// Measured over commanded displacement at ω in rad/s, without limits and sensors, for a specimen of `stiffness`
    /// (N/m) and `damping` (N s/m), and a command that is continuous in time.
    #[must_use]
    pub fn response(&self, omega: f64, stiffness: f64, damping: f64) -> Complex<f64> {
        let s = Complex::new(0.0, omega);
        let (sine, cosine) = libm::sincos(-omega * self.delay_s);
        let delayed = Complex::new(cosine, sine);
        delayed
            * match &self.actuator {
                None => Complex::new(1.0, 0.0),
                Some(ActuatorSpec::Proportional(spec)) => Complex::new(spec.gain, 0.0),
                Some(ActuatorSpec::FirstOrder(spec)) => {
                    Complex::new(spec.gain, 0.0) / (s * spec.time_constant_s + 1.0)
                }
                Some(ActuatorSpec::SecondOrder(spec)) => {
                    let natural = 2.0 * std::f64::consts::PI * spec.frequency_hz;
                    let square = natural * natural;
                    Complex::new(spec.gain * square, 0.0)
                        / (s * s + s * (2.0 * spec.damping_ratio * natural) + square)
                }
                Some(ActuatorSpec::ServoHydraulic(spec)) => {
                    let from_high = spec.characteristic(stiffness, damping);
                    let below = from_high
                        .iter()
                        .fold(Complex::new(0.0, 0.0), |sum, c| sum * s + c);
                    Complex::new(spec.gain * spec.valve_gain, 0.0) / below
                }
            }
    }

    /// Phase lag in s at ω in rad/s.
    #[must_use]
    pub fn lag(&self, omega: f64, stiffness: f64, damping: f64) -> f64 {
        // The delay's own phase may go round more than once; the actuator's phase is taken for itself.
        let without = Self {
            delay_s: 0.0,
            ..self.clone()
        };
        let response = without.response(omega, stiffness, damping);
        self.delay_s - libm::atan2(response.im, response.re) / omega
    }
}

/// Tick that histories are sized for where it is not known: that of a fast controller.
const DEFAULT_DT: f64 = 1.0 / 8000.0;

impl ServoHydraulicSpec {
    /// Coefficients of the characteristic polynomial of the loop with the specimen inside, from s⁵ down.
    #[must_use]
    pub fn characteristic(&self, stiffness: f64, damping: f64) -> [f64; 6] {
        let (m, a2, a3) = (
            self.mass_kg,
            self.velocity_feedback_n_per_m,
            self.leakage_per_s,
        );
        let cylinder = [
            m,
            damping + a3 * m,
            stiffness + a3 * damping + a2,
            a3 * stiffness,
        ];
        let valve = [1.0, self.valve_damping_per_s, self.valve_stiffness_per_s2];
        let mut all = [0.0; 6];
        for (i, c) in cylinder.iter().enumerate() {
            for (entry, v) in all.iter_mut().skip(i).zip(&valve) {
                *entry += c * v;
            }
        }
        all[5] += self.valve_gain;
        all
    }

    fn check(&self) -> Result<(), TransferError> {
        for (name, value) in [
            ("valve_gain", self.valve_gain),
            ("valve_damping_per_s", self.valve_damping_per_s),
            ("valve_stiffness_per_s2", self.valve_stiffness_per_s2),
            ("mass_kg", self.mass_kg),
        ] {
            positive(name, value)?;
        }
        not_negative("velocity_feedback_n_per_m", self.velocity_feedback_n_per_m)?;
        not_negative("leakage_per_s", self.leakage_per_s)?;
        Ok(())
    }

    /// The loop with a specimen of these properties inside is stable.
    ///
    /// # Errors
    /// It is not.
    pub(crate) fn check_loop(&self, stiffness: f64, damping: f64) -> Result<(), TransferError> {
        if is_hurwitz(&self.characteristic(stiffness, damping)) {
            Ok(())
        } else {
            Err(TransferError::Unstable { stiffness, damping })
        }
    }
}
