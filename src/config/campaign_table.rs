//! The tables of a study of `gusset campaign`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bus_spec::OnBuses;
use super::certificate::UncertaintyTable;
use gusset_motion::Unit;
use gusset_motion::metrics::pair::PairMeasure;

/// Most values of one range, and most motions of one table.
pub(super) const MOST_VALUES: usize = 100_000;

/// Names of the tables that a study has beside those of its test.
pub(super) const OWN: [&str; 6] = ["test", "campaign", "vary", "sample", "records", "measure"];

/// Study of `gusset campaign`: what varies in a test, and what is measured. The study contains the tables of the test too,
/// unless `test` names another file.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StudyFile {
    /// Test file, relative to the study. Default: the study contains the tables of the test.
    pub test: Option<String>,
    /// Design, replicates and seed.
    pub campaign: CampaignTable,
    /// Keys of the test file with a list of values.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub vary: Vec<VaryTable>,
    /// Numbers of the test file with a distribution. The controller does not know the drawn values.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sample: Vec<UncertaintyTable>,
    /// Ground motions, with the intensities to which they are scaled.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub records: Vec<RecordsTable>,
    /// Measures in the table of results.
    pub measure: MeasureTable,
}

impl OnBuses for StudyFile {}

/// Design, replicates and seed of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CampaignTable {
    /// Title of the report. Default: the name of the study file.
    pub title: String,
    /// How the values of `vary` are combined.
    pub design: Design,
    /// How `sample` is drawn.
    pub sampling: Sampling,
    /// Draws for each combination of values and ground motions. Equal draws are used for all
    /// combinations. A study has at most 100 000 000 tests.
    pub replicates: u64,
    /// Seed of all draws.
    pub seed: u64,
    /// If true, `[[uncertainty]]` of the test file is sampled too.
    pub sample_uncertainty: bool,
}

impl Default for CampaignTable {
    fn default() -> Self {
        Self {
            title: String::new(),
            design: Design::Grid,
            sampling: Sampling::Random,
            replicates: 1,
            seed: 1,
            sample_uncertainty: false,
        }
    }
}

/// How the values of several keys are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Design {
    /// Every combination of values.
    #[default]
    Grid,
    /// The test file itself, then each value alone.
    OneAtATime,
}

/// How numbers are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// Independent draws.
    #[default]
    Random,
    /// One draw in each of `replicates` equally probable intervals of each number.
    LatinHypercube,
    /// Scrambled Sobol sequence, which fills the space of all numbers evenly. `replicates` is at most 65 536, and should be
    /// a power of two.
    Sobol,
}

/// A key of the test file with its values. Give exactly one of `values`, `linear` and `log`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VaryTable {
    /// Path of the key, as for `--set`, for example integrator.lambda.
    pub key: String,
    /// List of values.
    #[schemars(example = [0.02, 0.05])]
    pub values: Option<Vec<Scalar>>,
    /// Numbers with equal differences.
    pub linear: Option<SpanTable>,
    /// Numbers with equal ratios.
    pub log: Option<SpanTable>,
}

/// A value of a list.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Scalar {
    /// Integer.
    Whole(i64),
    /// Number.
    Real(f64),
    /// Text.
    Text(String),
    /// True or false.
    Flag(bool),
}

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl serde::de::Visitor<'_> for Visitor {
            type Value = Scalar;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number, a text, true or false")
            }

            fn visit_i64<E>(self, value: i64) -> Result<Scalar, E> {
                Ok(Scalar::Whole(value))
            }

            fn visit_f64<E>(self, value: f64) -> Result<Scalar, E> {
                Ok(Scalar::Real(value))
            }

            fn visit_str<E>(self, value: &str) -> Result<Scalar, E> {
                Ok(Scalar::Text(value.to_owned()))
            }

            fn visit_bool<E>(self, value: bool) -> Result<Scalar, E> {
                Ok(Scalar::Flag(value))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl Scalar {
    /// The value as TOML.
    #[must_use]
    pub fn toml(&self) -> String {
        match self {
            Self::Whole(value) => value.to_string(),
            Self::Real(value) => format!("{value:?}"),
            Self::Text(value) => toml::Value::from(value.as_str()).to_string(),
            Self::Flag(value) => value.to_string(),
        }
    }
}

/// Ends and number of values of a range.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpanTable {
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of values, at most 100 000.
    pub count: usize,
}

/// Ground motions of the test. Give exactly one of `folder`, `files` and `synthetic`. With levels, each motion is scaled to
/// each of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordsTable {
    /// Folder of records, relative to the study. All files that are not hidden are read, in the order of their names.
    #[schemars(example = &"records")]
    pub folder: Option<String>,
    /// Names of the files of `folder` that are read: `*` fits any letters, `?` one letter. Upper and lower case are alike.
    #[schemars(example = &"*.AT2")]
    pub pattern: Option<String>,
    /// Names of the two horizontal components of each record in `folder`, instead of `pattern`. `*` fits the
    /// letters that both share. The files go to the first and the second component of the test.
    #[schemars(example = ["*H1.AT2", "*H2.AT2"])]
    pub components: Option<[String; 2]>,
    /// Records, relative to the study.
    #[schemars(example = ["elcentro.at2", "kobe.at2"])]
    pub files: Option<Vec<String>>,
    /// Motions of the random signal of the test file, with other seeds.
    pub synthetic: Option<SyntheticTable>,
    /// Unit of the records. Default: the unit in the file.
    #[schemars(example = &"g")]
    pub record_unit: Option<Unit>,
    /// Measure of intensity.
    pub intensity: Intensity,
    /// Unit of the levels.
    pub unit: Option<Unit>,
    /// Levels of intensity as a list.
    #[schemars(example = [0.1, 0.2, 0.4])]
    pub values: Option<Vec<f64>>,
    /// Levels with equal differences.
    pub linear: Option<SpanTable>,
    /// Levels with equal ratios.
    pub log: Option<SpanTable>,
    /// Period of a spectral acceleration. Default: the first period of the structure.
    #[schemars(example = 0.5)]
    pub period_s: Option<f64>,
    /// Damping ratio for `intensity = "sa"`. Default: 0.05.
    #[schemars(example = 0.02)]
    pub damping_ratio: Option<f64>,
}

/// Synthetic motions: seeds of the random signal of the test file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SyntheticTable {
    /// Number of motions, at most 100 000.
    pub count: u64,
    /// Seed of the first motion. Each further motion has the next seed.
    #[serde(default = "one")]
    pub seed: u64,
}

const fn one() -> u64 {
    1
}

/// Measure of the intensity of a ground motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Intensity {
    /// Peak ground acceleration.
    #[default]
    Pga,
    /// Pseudo-spectral acceleration at one period.
    Sa,
    /// Geometric mean of the spectral accelerations of two components, at one period and 5 % damping.
    GeometricMean,
    /// Median of the spectral acceleration of two components over all horizontal directions.
    #[serde(rename = "rotd50")]
    RotD50,
    /// Largest spectral acceleration of two components of all horizontal directions.
    #[serde(rename = "rotd100")]
    RotD100,
}

impl Intensity {
    /// The measure of two components together; none of a single one.
    #[must_use]
    pub const fn of_pair(self) -> Option<PairMeasure> {
        match self {
            Self::Pga | Self::Sa => None,
            Self::GeometricMean => Some(PairMeasure::GeometricMean),
            Self::RotD50 => Some(PairMeasure::RotD50),
            Self::RotD100 => Some(PairMeasure::RotD100),
        }
    }
}

/// Measures in the table of results. The time at the end, `end_s`, is always measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MeasureTable {
    /// Largest absolute displacement and relative acceleration of each recorded DOF, and force of each axis.
    #[schemars(example = false)]
    pub peaks: bool,
    /// Largest absolute drift of each storey of a shear building.
    #[schemars(example = false)]
    pub drifts: bool,
    /// Heights of the storeys. With them the drifts are divided by the heights.
    pub storey_height_m: Vec<f64>,
    /// Mean displacement of each recorded DOF over the last second.
    pub residual: bool,
    /// Work of each axis: the integral of force over target displacement.
    pub energy: bool,
    /// Tracking error of each axis: standard deviation of measured minus target displacement, divided by that of the target.
    pub tracking: bool,
    /// Criterion of collapse.
    pub collapse: Option<CollapseTable>,
    /// Measures with pictures in the report. Default: the largest drift, or the first peak.
    pub report: Vec<String>,
}

impl Default for MeasureTable {
    fn default() -> Self {
        Self {
            peaks: true,
            drifts: true,
            storey_height_m: Vec::new(),
            residual: false,
            energy: false,
            tracking: false,
            collapse: None,
            report: Vec::new(),
        }
    }
}

/// Criterion of collapse: a measure above a value. A test that stopped before its end counts as a collapse too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CollapseTable {
    /// Name of the measure, as in the table.
    pub measure: String,
    /// Value above which the structure has collapsed.
    pub above: f64,
}

impl SpanTable {
    /// The values of a linear range.
    #[must_use]
    pub(crate) fn linear(self) -> Vec<f64> {
        self.each(|share| self.from + (self.to - self.from) * share)
    }

    /// The values of a range with equal ratios.
    #[must_use]
    pub(crate) fn log(self) -> Vec<f64> {
        self.each(|share| self.from * libm::pow(self.to / self.from, share))
    }

    /// At most [`MOST_VALUES`] values: a check refuses more, and no memory is taken for them before.
    fn each(self, of: impl Fn(f64) -> f64) -> Vec<f64> {
        let count = self.count.min(MOST_VALUES);
        let last = count.saturating_sub(1);
        let value = |i: usize| match i {
            _ if i == last && last > 0 => self.to,
            _ => rounded(of(i as f64 / last.max(1) as f64)),
        };
        (0..count).map(value).collect()
    }
}

/// The number with fifteen digits: 0.3, not 0.30000000000000004.
fn rounded(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}

impl VaryTable {
    /// The values in order.
    #[must_use]
    pub fn all(&self) -> Vec<Scalar> {
        let real = |values: Vec<f64>| values.into_iter().map(Scalar::Real).collect();
        match (&self.values, self.linear, self.log) {
            (Some(values), ..) => values.clone(),
            (_, Some(span), _) => real(span.linear()),
            (.., Some(span)) => real(span.log()),
            (None, None, None) => Vec::new(),
        }
    }
}

impl RecordsTable {
    /// The levels of intensity in order; none if the motions are not scaled.
    #[must_use]
    pub fn levels(&self) -> Vec<f64> {
        match (&self.values, self.linear, self.log) {
            (Some(values), ..) => values.clone(),
            (_, Some(span), _) => span.linear(),
            (.., Some(span)) => span.log(),
            (None, None, None) => Vec::new(),
        }
    }
}
