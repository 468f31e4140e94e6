//! What a certificate goes by: what was identified of a specimen, what its rig can give, what is uncertain, and what is allowed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::{KeyPath, Segment};
use super::{ConfigError, Loaded, parse};
use crate::transfer::{ActuatorSpec, ProportionalSpec, TransferSpec};

/// What was identified of a specimen with its actuator and sensors; `gusset identify` writes it. A certificate compares the
/// delay with the critical one, and varies what has a standard deviation. For a specimen behind a link without
/// `stand_in_transfer`, delay, gain and noise are the actuator and the sensors of its stand-in.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IdentifiedTable {
    /// Delay of the measured behind the commanded displacement, in s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
    /// Its standard deviation in s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_std_s: Option<f64>,
    /// Measured over commanded displacement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// Stiffness in N/m at the structure's scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_n_per_m: Option<f64>,
    /// Its standard deviation in N/m: of every axis alike, as a share of `stiffness_n_per_m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_std_n_per_m: Option<f64>,
    /// Root mean square of the displacement sensor's noise in m, at the specimen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_disp_m: Option<f64>,
    /// Root mean square of the load cell's noise in N, at the specimen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_force_n: Option<f64>,
}

impl IdentifiedTable {
    /// Every value with its key, and the key of the value that it is the spread of.
    pub(super) fn entries(&self) -> [(&'static str, Option<f64>, Option<&'static str>); 8] {
        [
            ("delay_s", self.delay_s, None),
            ("delay_std_s", self.delay_std_s, Some("delay_s")),
            ("gain", self.gain, None),
            ("gain_std", self.gain_std, Some("gain")),
            ("stiffness_n_per_m", self.stiffness_n_per_m, None),
            (
                "stiffness_std_n_per_m",
                self.stiffness_std_n_per_m,
                Some("stiffness_n_per_m"),
            ),
            ("noise_disp_m", self.noise_disp_m, None),
            ("noise_force_n", self.noise_force_n, None),
        ]
    }

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

/// What the rig of a specimen can give on each axis, at the specimen's own scale. `check` compares it with what its rehearsal
/// needs, and refuses a test that needs more, or that would be left faster or farther; a certificate does so with all its trials.
/// Nothing in the loop does: that is what `limits` are for.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CapacityTable {
    /// Greatest commanded displacement either way, in m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stroke_m: Option<f64>,
    /// Greatest commanded velocity in m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_m_per_s: Option<f64>,
    /// Greatest force either way, in N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_n: Option<f64>,
    /// Greatest power in W: measured force times commanded velocity, either sign.
    #[serde(skip_serializing_if = "Option::is_none")]
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

/// A number of this file that is not known exactly. Exactly one of `std`, `std_share` and `range`. Normal draws, uniform ones
/// in a range; what the file could not be with is drawn anew. A whole number stays one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UncertaintyTable {
    /// Its dotted path, as for `--set`: specimen.0.law.linear.stiffness_n_per_m.
    pub key: String,
    /// Standard deviation, in the unit of the key.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
    /// Standard deviation as a share of the value in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub std_share: Option<f64>,
    /// Smallest and largest value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
}

/// What `gusset check --rehearse` runs and allows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CertificateTable {
    /// How often the test is rehearsed, each time with other draws.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub trials: u32,
    /// Seed of all draws: same seed, same certificate.
    pub seed: u64,
    /// Greatest probability of a trip that is allowed. The upper end of its confidence interval (95 %) must be below it.
    pub trip_probability: f64,
    /// Greatest tracking error that is allowed in 95 % of the trials: standard deviation of measured less target displacement,
    /// as a share of the target's.
    pub tracking_error: f64,
    /// Greatest response error that is allowed in 95 % of the trials: standard deviation of a DOF's displacement less that
    /// with ideal actuators and sensors, as a share of the latter's.
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
    /// What the file has.
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

    /// True if it is a number of an actuator or of sensors.
    #[must_use]
    pub fn is_of_transfer(&self) -> bool {
        let transfer = |segment: &Segment| matches!(segment, Segment::Key(key) if key == "transfer" || key == "stand_in_transfer");
        let segments = self.key.segments();
        matches!(segments.first(), Some(Segment::Key(key)) if key == "specimen")
            && segments.get(2).is_some_and(transfer)
    }
}

impl Loaded {
    /// Every number that the file calls uncertain; a checked file has them all.
    #[must_use]
    pub fn uncertain(&self) -> Vec<Uncertain> {
        let Ok(complete) = toml::Value::try_from(&self.file) else {
            return Vec::new();
        };
        let each = self.file.uncertainty.iter().filter_map(|one| {
            let key = KeyPath::parse(&one.key).ok()?;
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

    /// The same test with further overrides, written as for `--set`; read and checked anew.
    ///
    /// # Errors
    /// As [`parse`].
    pub fn varied(&self, sets: &[String]) -> Result<Self, ConfigError> {
        if sets.is_empty() {
            return Ok(self.clone());
        }
        parse(&self.path, self.effective.clone(), sets)
    }
}

/// A number in a configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Number {
    Whole(i64),
    Real(f64),
}

impl Number {
    pub const fn value(self) -> f64 {
        match self {
            Self::Whole(value) => value as f64,
            Self::Real(value) => value,
        }
    }
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
