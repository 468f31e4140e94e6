//! Errors of a sensor: noise, bias, drift, range and quantum, in this order.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::TransferError;
use gusset_quantity::domain::{finite, not_negative, positive};

/// Displacement sensor. Without any key, it has no error.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case", default)]
pub struct DispSensorSpec {
    /// Root mean square of white noise. Use it instead of `noise_power_m2_s`. Default: no noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.0e-5)]
    pub noise_rms_m: Option<f64>,
    /// Power of white noise. The variance of a reading is this value divided by the length of a
    /// tick. Use it instead of `noise_rms_m`. Default: no noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_power_m2_s: Option<f64>,
    /// Constant error.
    #[schemars(example = 0.0001)]
    pub bias_m: f64,
    /// Error that grows with test time.
    #[schemars(example = 1.0e-6)]
    pub drift_m_per_s: f64,
    /// Largest reading in both directions. Beyond it, the specimen reports saturation. Default:
    /// unlimited.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.15)]
    pub range_m: Option<f64>,
    /// Resolution: readings are whole multiples of this value. 0 is unlimited resolution.
    #[schemars(example = 1.0e-6)]
    pub quantum_m: f64,
}

/// Load cell. Without any key, it has no error.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case", default)]
pub struct ForceSensorSpec {
    /// Root mean square of white noise. Use it instead of `noise_power_n2_s`. Default: no noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 50.0)]
    pub noise_rms_n: Option<f64>,
    /// Power of white noise. The variance of a reading is this value divided by the length of a
    /// tick. Use it instead of `noise_rms_n`. Default: no noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_power_n2_s: Option<f64>,
    /// Constant error.
    #[schemars(example = 100.0)]
    pub bias_n: f64,
    /// Error that grows with test time.
    #[schemars(example = 1.0)]
    pub drift_n_per_s: f64,
    /// Largest reading in both directions. Beyond it, the specimen reports saturation. Default:
    /// unlimited.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 2.0e5)]
    pub range_n: Option<f64>,
    /// Resolution: readings are whole multiples of this value. 0 is unlimited resolution.
    #[schemars(example = 10.0)]
    pub quantum_n: f64,
}

/// Noise by its root mean square, or by its power, in this order.
type Noise = [Option<f64>; 2];

/// One sensor of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensor {
    noise: Noise,
    bias: f64,
    drift: f64,
    range: f64,
    quantum: f64,
}

impl DispSensorSpec {
    /// Root mean square of its noise in m where a tick is `dt` s of test time.
    #[must_use]
    pub fn noise_rms(&self, dt: f64) -> f64 {
        rms([self.noise_rms_m, self.noise_power_m2_s], dt)
    }

    /// The sensor.
    ///
    /// # Errors
    /// A key outside its domain.
    pub(crate) fn build(&self) -> Result<Sensor, TransferError> {
        Ok(Sensor {
            noise: noise(
                ["noise_rms_m", "noise_power_m2_s"],
                [self.noise_rms_m, self.noise_power_m2_s],
            )?,
            bias: finite("bias_m", self.bias_m)?,
            drift: finite("drift_m_per_s", self.drift_m_per_s)?,
            range: range("range_m", self.range_m)?,
            quantum: not_negative("quantum_m", self.quantum_m)?,
        })
    }
}

impl ForceSensorSpec {
    /// Root mean square of its noise in N where a tick is `dt` s of test time.
    #[must_use]
    pub fn noise_rms(&self, dt: f64) -> f64 {
        rms([self.noise_rms_n, self.noise_power_n2_s], dt)
    }

    /// The sensor.
    ///
    /// # Errors
    /// A key outside its domain.
    pub(crate) fn build(&self) -> Result<Sensor, TransferError> {
        Ok(Sensor {
            noise: noise(
                ["noise_rms_n", "noise_power_n2_s"],
                [self.noise_rms_n, self.noise_power_n2_s],
            )?,
            bias: finite("bias_n", self.bias_n)?,
            drift: finite("drift_n_per_s", self.drift_n_per_s)?,
            range: range("range_n", self.range_n)?,
            quantum: not_negative("quantum_n", self.quantum_n)?,
        })
    }
}

/// Root mean square of a noise where a tick is `dt` s of test time. Real-time: yes.
fn rms([rms, power]: Noise, dt: f64) -> f64 {
    match (rms, power) {
        (Some(rms), _) => rms,
        (None, Some(power)) if dt > 0.0 => (power / dt).sqrt(),
        (None, _) => 0.0,
    }
}

fn noise(keys: [&'static str; 2], noise: Noise) -> Result<Noise, TransferError> {
    if noise.iter().all(Option::is_some) {
        let [first, second] = keys;
        return Err(TransferError::Exclusive { first, second });
    }
    for (key, value) in keys.into_iter().zip(noise) {
        not_negative(key, value.unwrap_or(0.0))?;
    }
    Ok(noise)
}

fn range(key: &'static str, value: Option<f64>) -> Result<f64, TransferError> {
    Ok(match value {
        Some(value) => positive(key, value)?,
        None => f64::INFINITY,
    })
}

impl Sensor {
    /// True if it draws noise.
    #[must_use]
    pub(crate) fn is_noisy(&self) -> bool {
        self.noise != [None; 2]
    }

    /// The reading of `value` after `elapsed` seconds of test, `normal` being the noise of the moment in standard deviations
    /// and `dt` the tick; and whether it is at the end of the range. Real-time: yes.
    #[must_use]
    pub(crate) fn read(&self, value: f64, normal: f64, elapsed: f64, dt: f64) -> (f64, bool) {
        let sensed = value + self.bias + self.drift * elapsed + rms(self.noise, dt) * normal;
        let within = sensed.clamp(-self.range, self.range);
        let read = if self.quantum > 0.0 {
            // Half to even, as converters are specified; std's `round` needs no library.
            (within / self.quantum).round_ties_even() * self.quantum
        } else {
            within
        };
        (read, sensed.abs() > self.range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sensor_fault_follows_its_key() {
        let spec = DispSensorSpec {
            noise_power_m2_s: Some(6.25e-14),
            bias_m: 1e-3,
            drift_m_per_s: 1e-4,
            range_m: Some(0.02),
            quantum_m: 1e-6,
            ..DispSensorSpec::default()
        };
        let sensor = spec.build().unwrap();
        // The benchmark's LVDT at 4096 Hz: 16.0 µm.
        let (read, end) = sensor.read(0.0, 1.0, 10.0, 1.0 / 4096.0);
        assert!(!end && (read - (1e-3 + 1e-3 + 16e-6)).abs() < 1e-12);
        assert_eq!(sensor.read(0.05, 0.0, 0.0, 0.01), (0.02, true));
        assert_eq!(sensor.read(-0.05, 0.0, 0.0, 0.01), (-0.02, true));
        let plain = DispSensorSpec::default().build().unwrap();
        assert_eq!(plain.read(0.1234567, 3.0, 5.0, 0.01), (0.1234567, false));
    }

    #[test]
    fn noise_is_declared_once() {
        let spec = ForceSensorSpec {
            noise_rms_n: Some(1.0),
            noise_power_n2_s: Some(1.0),
            ..ForceSensorSpec::default()
        };
        let error = spec.build().unwrap_err();
        assert_eq!(error.key(), "noise_power_n2_s");
    }
}
