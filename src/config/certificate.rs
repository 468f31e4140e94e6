//! The tables of a certificate: identified properties, capacities, uncertain values and allowed errors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::{KeyPath, Segment};
use super::{ConfigError, Loaded, Opened, Purpose, renamed, test_of};
use gusset_actuator::transfer::{ActuatorSpec, ProportionalSpec, TransferSpec};

/// Measured properties of a specimen with its actuator and sensors, written by `gusset identify`. A
/// certificate compares the delay with the critical delay and varies all values that have a
/// standard deviation. Without `transfer`, the stand-in of a specimen with `link` uses its
/// delay, gain and noise.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IdentifiedTable {
    /// Delay of the measured displacement behind the command. Default: unknown.
    #[schemars(example = 0.012)]
    pub delay_s: Option<f64>,
    /// Standard deviation of `delay_s`. Default: 0.
    #[schemars(example = 0.0005)]
    pub delay_std_s: Option<f64>,
    /// Measured displacement divided by commanded displacement. Default: unknown.
    #[schemars(example = 0.98)]
    pub gain: Option<f64>,
    /// Standard deviation of `gain`. Default: 0.
    #[schemars(example = 0.01)]
    pub gain_std: Option<f64>,
    /// Stiffness at the structure's scale. Default: unknown.
    #[schemars(example = 1.2e6)]
    pub stiffness_n_per_m: Option<f64>,
    /// Standard deviation of `stiffness_n_per_m`. It applies to all axes, in proportion to their
    /// stiffness. Default: 0.
    #[schemars(example = 5.0e4)]
    pub stiffness_std_n_per_m: Option<f64>,
    /// Root mean square of the noise of the displacement sensor, at the specimen. Default: unknown.
    #[schemars(example = 1.0e-5)]
    pub noise_disp_m: Option<f64>,
    /// Root mean square of the noise of the load cell, at the specimen. Default: unknown.
    #[schemars(example = 50.0)]
    pub noise_force_n: Option<f64>,
}

impl IdentifiedTable {
    /// An actuator and sensors with this delay (`pace`: test time in a second of wall time), gain and noise; none where none of
    /// them is known.
    pub(super) fn transfer(&self, pace: f64) -> Option<TransferSpec> {
        let known = [
            self.delay_s,
            self.gain,
            self.noise_disp_m,
            self.noise_force_n,
        ];
        known.iter().any(Option::is_some).then(|| {
            let mut spec = TransferSpec {
                delay_s: self.delay_s.unwrap_or(0.0) * pace,
                ..TransferSpec::default()
            };
            spec.actuator = self
                .gain
                .map(|gain| ActuatorSpec::Proportional(ProportionalSpec { gain }));
            spec.disp_sensor.noise_rms_m = self.noise_disp_m;
            spec.force_sensor.noise_rms_n = self.noise_force_n;
            spec
        })
    }

    /// Standard deviation of the stiffness as a share of it.
    #[must_use]
    pub fn stiffness_share(&self) -> f64 {
        match (self.stiffness_n_per_m, self.stiffness_std_n_per_m) {
            (Some(value), Some(std)) => std / value,
            _ => 0.0,
        }
    }
}

/// Capacity of the actuator of each axis, at the specimen's own scale. `check` refuses a test whose
/// rehearsal or end position needs more. A certificate checks all its trials. The loop does not
/// check it: use `limits` for that.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CapacityTable {
    /// Largest commanded displacement in both directions. Default: unlimited.
    #[schemars(example = 0.1)]
    pub stroke_m: Option<f64>,
    /// Largest commanded velocity. Default: unlimited.
    #[schemars(example = 0.5)]
    pub velocity_m_per_s: Option<f64>,
    /// Largest force in both directions. Default: unlimited.
    #[schemars(example = 1.0e5)]
    pub force_n: Option<f64>,
    /// Largest power, measured force times commanded velocity, with either sign. Default:
    /// unlimited.
    #[schemars(example = 2.0e4)]
    pub power_w: Option<f64>,
}

impl CapacityTable {
    /// Every value with its key and unit.
    #[must_use]
    pub fn entries(&self) -> [(&'static str, &'static str, Option<f64>); 4] {
        [
            ("stroke_m", "m", self.stroke_m),
            ("velocity_m_per_s", "m/s", self.velocity_m_per_s),
            ("force_n", "N", self.force_n),
            ("power_w", "W", self.power_w),
        ]
    }
}

/// Uncertain value of this file. Give exactly one of `std`, `std_share` and `range`. Values that
/// the file must not have are drawn again. Integers stay integers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UncertaintyTable {
    /// Path of the value, as for `--set`, for example specimen.0.law.linear.stiffness_n_per_m.
    pub key: String,
    /// Standard deviation of a normal distribution, in the unit of the value.
    pub std: Option<f64>,
    /// Standard deviation of a normal distribution, divided by the value in the file.
    #[schemars(example = 0.1)]
    pub std_share: Option<f64>,
    /// Smallest and largest value of a uniform distribution.
    #[schemars(example = [1.0e6, 1.4e6])]
    pub range: Option<[f64; 2]>,
}

/// Number of trials and allowed errors of `gusset check --rehearse`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CertificateTable {
    /// Number of rehearsals. Each rehearsal draws new values for all entries of `uncertainty`.
    #[schemars(range(min = 1, max = 1_000_000))]
    #[schemars(example = 500)]
    pub trials: u32,
    /// Seed of all random draws. Equal seeds give equal certificates.
    #[schemars(example = 2)]
    pub seed: u64,
    /// Largest allowed probability of a trip. The upper end of its 95 % confidence interval must be
    /// below it.
    #[schemars(example = 0.02)]
    pub trip_probability: f64,
    /// Largest allowed tracking error in 95 % of the trials. It is the standard deviation of
    /// measured minus target displacement, divided by that of the target.
    #[schemars(example = 0.05)]
    pub tracking_error: f64,
    /// Largest allowed response error in 95 % of the trials. It is the standard deviation of the
    /// displacement error of a DOF, divided by that of its displacement. The error is relative to
    /// ideal actuators and sensors.
    #[schemars(example = 0.05)]
    pub response_error: f64,
}

impl Default for CertificateTable {
    fn default() -> Self {
        Self {
            trials: 200,
            seed: 1,
            trip_probability: 0.05,
            tracking_error: 0.1,
            response_error: 0.1,
        }
    }
}

impl CertificateTable {
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// How far a number may be from what the file has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spread {
    /// Normal, with this standard deviation.
    Normal(f64),
    /// Anywhere between these two alike.
    Uniform(f64, f64),
}

/// A number of a file that is not known exactly.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertain {
    /// Its path, as `--set` takes it.
    pub key: KeyPath,
    /// Value in the file.
    pub nominal: f64,
    /// Whether it is a whole number.
    pub whole: bool,
    /// How far it may be from that.
    pub spread: Spread,
}

impl Uncertain {
    /// In words.
    #[must_use]
    pub fn words(&self) -> String {
        match self.spread {
            Spread::Normal(std) => format!("{} = {} ± {std}", self.key, self.nominal),
            Spread::Uniform(low, high) => format!("{} from {low} to {high}", self.key),
        }
    }

    /// The value for a draw of the standard normal distribution. A range takes the share of draws that are smaller.
    #[must_use]
    pub fn value(&self, normal: f64) -> f64 {
        let value = match self.spread {
            Spread::Normal(std) => self.nominal + std * normal,
            Spread::Uniform(low, high) => {
                let share = 0.5 * libm::erfc(-normal / std::f64::consts::SQRT_2);
                low + (high - low) * share
            }
        };
        if self.whole { value.round() } else { value }
    }

    /// The override for [`Uncertain::value`].
    #[must_use]
    pub fn set(&self, normal: f64) -> String {
        let value = self.value(normal);
        if self.whole {
            format!("{}={}", self.key, value as i64)
        } else {
            format!("{}={value:?}", self.key)
        }
    }

    /// True if it is a number of an actuator or of sensors.
    #[must_use]
    pub fn is_of_transfer(&self) -> bool {
        let transfer =
            |segment: &Segment| matches!(segment, Segment::Key(key) if key == "transfer");
        let segments = self.key.segments();
        matches!(segments.first(), Some(Segment::Key(key)) if key == "specimen")
            && segments.get(2).is_some_and(transfer)
    }
}

impl Loaded {
    /// Every number that the file calls uncertain; a checked file has them all.
    #[must_use]
    pub fn uncertain(&self) -> Vec<Uncertain> {
        self.uncertain_by(&self.file.uncertainty)
    }

    /// The numbers that checked `tables` call uncertain.
    #[must_use]
    pub fn uncertain_by(&self, tables: &[UncertaintyTable]) -> Vec<Uncertain> {
        let Ok(complete) = toml::Value::try_from(&self.file) else {
            return Vec::new();
        };
        let each = tables.iter().filter_map(|one| {
            let key = KeyPath::parse(&one.key).ok()?;
            let key = current_key(&complete, key);
            let number = number_at(&complete, &key).ok()?;
            let nominal = number.value();
            let spread = match (one.std, one.std_share, one.range) {
                (Some(std), ..) => Spread::Normal(std),
                (_, Some(share), _) => Spread::Normal(share * nominal.abs()),
                (.., Some([low, high])) => Spread::Uniform(low, high),
                (None, None, None) => return None,
            };
            Some(Uncertain {
                key,
                nominal,
                whole: matches!(number, Number::Whole(_)),
                spread,
            })
        });
        each.collect()
    }

    /// Reads and checks the test again with further overrides, written as for `--set`.
    ///
    /// # Errors
    /// As [`load`](super::load).
    pub fn varied(&self, sets: &[String]) -> Result<Self, ConfigError> {
        if sets.is_empty() {
            return Ok(self.clone());
        }
        let mut opened = Opened {
            text: self.text.clone(),
            root: self.root.clone(),
            locator: self.locator.clone(),
            moves: Vec::new(),
            inputs: self.inputs(),
        };
        opened.set(Purpose::Run, &self.path, sets)?;
        let varied = test_of(Purpose::Run, &self.path, opened)?;
        Ok(Self {
            store: self.store.clone(),
            ..varied
        })
    }
}

/// A number in a configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Number {
    Whole(i64),
    Real(f64),
}

impl Number {
    pub(crate) const fn value(self) -> f64 {
        match self {
            Self::Whole(value) => value as f64,
            Self::Real(value) => value,
        }
    }
}

/// The key under which the number of an uncertainty stands today in the complete file.
pub(super) fn current_key(complete: &toml::Value, key: KeyPath) -> KeyPath {
    let holds = |path: &KeyPath| value_at(complete, path).is_some();
    renamed::current(&key, &holds).map_or(key, |(new, _)| new)
}

pub(super) fn value_at<'a>(root: &'a toml::Value, path: &KeyPath) -> Option<&'a toml::Value> {
    let mut segments = path.segments().iter();
    segments.try_fold(root, |node, segment| match segment {
        Segment::Key(key) => node.get(key.as_str()),
        Segment::Index(index) => node.get(*index),
    })
}

/// The number at `path` of a complete configuration; else how far the path goes: the last part that is there, and the keys
/// that may follow.
pub(super) fn number_at<'a>(
    root: &'a toml::Value,
    path: &KeyPath,
) -> Result<Number, (KeyPath, Vec<&'a str>)> {
    let mut at = KeyPath::root();
    let mut node = root;
    for segment in path.segments() {
        let (next, deeper) = match segment {
            Segment::Key(key) => (node.get(key.as_str()), at.key(key)),
            Segment::Index(index) => (node.get(*index), at.index(*index)),
        };
        let Some(next) = next else {
            let keys = node.as_table().into_iter().flat_map(|table| table.keys());
            return Err((at, keys.map(String::as_str).collect()));
        };
        (node, at) = (next, deeper);
    }
    match node {
        toml::Value::Integer(value) => Ok(Number::Whole(*value)),
        toml::Value::Float(value) => Ok(Number::Real(*value)),
        _ => Err((at, Vec::new())),
    }
}
