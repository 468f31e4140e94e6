//! `resolved.toml` of any version, as far as a page needs it. The reader of tests is `gusset_config`.

use std::collections::BTreeMap;

use serde::de::IgnoredAny;
use serde::{Deserialize, Deserializer};

use super::lenient;

/// A number or a word.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum NumberOrWord {
    /// A number.
    Number(f64),
    /// A word.
    Word(String),
}

impl std::fmt::Display for NumberOrWord {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Word(word) => word.fmt(f),
        }
    }
}

/// A choice: a word, a table with one key, or a list of choices.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Variant {
    /// Its names.
    pub names: Vec<String>,
    /// The file that it reads, if it names one.
    pub path: Option<String>,
}

impl<'de> Deserialize<'de> for Variant {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        struct Inner {
            #[serde(default)]
            path: Option<String>,
        }
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Written {
            Word(String),
            List(Vec<Variant>),
            File(BTreeMap<String, Inner>),
            Table(BTreeMap<String, IgnoredAny>),
        }
        let name = |name: Option<String>| name.into_iter().collect();
        Ok(match Written::deserialize(deserializer)? {
            Written::Word(word) => Self {
                names: vec![word],
                path: None,
            },
            Written::List(list) => Self {
                names: list.into_iter().flat_map(|one| one.names).collect(),
                path: None,
            },
            Written::File(table) => {
                let mut entries = table.into_iter();
                let first = entries.next();
                Self {
                    path: first.as_ref().and_then(|(_, inner)| inner.path.clone()),
                    names: name(first.map(|(name, _)| name)),
                }
            }
            Written::Table(table) => Self {
                names: name(table.into_keys().next()),
                path: None,
            },
        })
    }
}

/// `[structure.shear_building]`, `[structure.matrices]` or `[structure.chain]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Matrices {
    /// Masses of storeys or DOFs, kg.
    #[serde(deserialize_with = "lenient::items")]
    pub mass_kg: Vec<f64>,
    /// Stiffness of each storey, N/m.
    #[serde(deserialize_with = "lenient::items")]
    pub stiffness_n_per_m: Vec<f64>,
    /// Rows of the mass matrix.
    #[serde(deserialize_with = "lenient::items")]
    pub mass: Vec<Vec<f64>>,
    /// Number of DOFs of a chain.
    #[serde(deserialize_with = "lenient::field")]
    pub dofs: Option<u64>,
}

/// `[structure]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Structure {
    /// Storeys.
    #[serde(deserialize_with = "lenient::field")]
    pub shear_building: Option<Matrices>,
    /// Matrices.
    #[serde(deserialize_with = "lenient::field")]
    pub matrices: Option<Matrices>,
    /// A chain.
    #[serde(deserialize_with = "lenient::field")]
    pub chain: Option<Matrices>,
    /// Kind of damping.
    #[serde(deserialize_with = "lenient::field")]
    pub damping: Option<Variant>,
    /// Nonlinear elements.
    #[serde(deserialize_with = "lenient::items")]
    pub element: Vec<IgnoredAny>,
}

impl Structure {
    /// Name of its kind and its table.
    #[must_use]
    pub(crate) fn kind(&self) -> Option<(&'static str, &Matrices)> {
        let kinds = [
            ("shear building", &self.shear_building),
            ("matrices", &self.matrices),
            ("chain", &self.chain),
        ];
        let mut known = kinds.into_iter();
        known.find_map(|(name, table)| Some((name, table.as_ref()?)))
    }
}

/// An amount with its unit; of a spectral acceleration with the period.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Amount {
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Period in s.
    #[serde(default)]
    pub period_s: Option<f64>,
}

/// How a signal is scaled.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Processing {
    /// To a peak.
    #[serde(deserialize_with = "lenient::field")]
    pub target_peak: Option<Amount>,
    /// To a spectral acceleration.
    #[serde(deserialize_with = "lenient::field")]
    pub target_sa: Option<Amount>,
    /// By a factor.
    #[serde(deserialize_with = "lenient::field")]
    pub scale_factor: Option<f64>,
}

/// One excitation.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Excitation {
    /// Its signal.
    #[serde(deserialize_with = "lenient::field")]
    pub signal: Option<Variant>,
    /// Its scaling.
    #[serde(deserialize_with = "lenient::field")]
    pub processing: Processing,
}

/// One excitation or a list of them.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Excitations {
    One(Excitation),
    Many(Vec<Excitation>),
}

/// `[[specimen.axis]]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct AxisTable {
    /// Unit of its displacement.
    #[serde(deserialize_with = "lenient::field")]
    pub unit_disp: Option<String>,
    /// Unit of its force.
    #[serde(deserialize_with = "lenient::field")]
    pub unit_force: Option<String>,
    /// Sign.
    #[serde(deserialize_with = "lenient::field")]
    pub sign: Option<f64>,
    /// Scale.
    #[serde(deserialize_with = "lenient::field")]
    pub scale: Option<f64>,
}

/// `[specimen.similitude]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Similitude {
    /// Scale of lengths.
    #[serde(deserialize_with = "lenient::field")]
    pub length: Option<f64>,
    /// Scale of forces.
    #[serde(deserialize_with = "lenient::field")]
    pub force: Option<f64>,
}

/// `[specimen.link]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct LinkTable {
    /// Protocol.
    #[serde(deserialize_with = "lenient::field")]
    pub protocol: Option<String>,
    /// Address.
    #[serde(deserialize_with = "lenient::field")]
    pub address: Option<String>,
}

/// `[specimen.coupled]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct CoupledTable {
    /// Stiffness, a row per axis.
    #[serde(deserialize_with = "lenient::items")]
    pub stiffness_n_per_m: Vec<Vec<f64>>,
}

/// `[[specimen]]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct SpecimenTable {
    /// Its name.
    #[serde(deserialize_with = "lenient::field")]
    pub name: Option<String>,
    /// Its law.
    #[serde(alias = "laws", deserialize_with = "lenient::field")]
    pub law: Option<Variant>,
    /// Its law where the axes are coupled.
    #[serde(deserialize_with = "lenient::field")]
    pub coupled: Option<CoupledTable>,
    /// Its link.
    #[serde(deserialize_with = "lenient::field")]
    pub link: Option<LinkTable>,
    /// Its storey.
    #[serde(deserialize_with = "lenient::field")]
    pub storey: Option<usize>,
    /// Rows of B.
    #[serde(deserialize_with = "lenient::items")]
    pub rows: Vec<Vec<f64>>,
    /// Its axes.
    #[serde(deserialize_with = "lenient::items")]
    pub axis: Vec<AxisTable>,
    /// Its scale.
    #[serde(deserialize_with = "lenient::field")]
    pub similitude: Similitude,
}

/// `[time]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
struct TimeTable {
    #[serde(deserialize_with = "lenient::field")]
    step_s: Option<f64>,
    #[serde(deserialize_with = "lenient::field")]
    rate_hz: Option<NumberOrWord>,
    #[serde(deserialize_with = "lenient::field")]
    ticks_per_step: Option<u64>,
    #[serde(deserialize_with = "lenient::field")]
    clock: Option<String>,
}

/// `[integrator]`.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct IntegratorTable {
    /// Its method.
    pub method: Option<String>,
    /// λ as asked for.
    pub lambda: Option<NumberOrWord>,
}

/// The tables of a test file.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct TestFile {
    /// The title.
    #[serde(deserialize_with = "lenient::field")]
    pub title: Option<String>,
    #[serde(deserialize_with = "lenient::field")]
    time: TimeTable,
    /// The numerical substructure; absent in a test of prescribed displacement.
    #[serde(deserialize_with = "lenient::field")]
    pub structure: Option<Structure>,
    /// The method of integration.
    pub integrator: IntegratorTable,
    #[serde(deserialize_with = "lenient::entries")]
    excitation: BTreeMap<String, Excitations>,
    /// The specimens.
    #[serde(deserialize_with = "lenient::items")]
    pub specimen: Vec<SpecimenTable>,
}

impl TestFile {
    /// Test time of a step in s.
    #[must_use]
    pub fn step_s(&self) -> Option<f64> {
        let rate = || match self.time.rate_hz.as_ref()? {
            NumberOrWord::Number(rate) => Some(1.0 / rate),
            NumberOrWord::Word(ratio) => {
                let (a, b) = ratio.split_once('/')?;
                Some(b.trim().parse::<f64>().ok()? / a.trim().parse::<f64>().ok()?)
            }
        };
        self.time.step_s.or_else(rate)
    }

    /// Ticks in a step.
    #[must_use]
    pub fn ticks_per_step(&self) -> u64 {
        self.time.ticks_per_step.unwrap_or(1).max(1)
    }

    /// The clock that was asked for.
    #[must_use]
    pub(crate) fn clock(&self) -> Option<&str> {
        self.time.clock.as_deref()
    }

    /// Kinds of excitation, each with its signals.
    pub(crate) fn excitations(&self) -> impl Iterator<Item = (&str, &[Excitation])> {
        self.excitation.iter().map(|(kind, entries)| {
            let entries = match entries {
                Excitations::One(one) => std::slice::from_ref(one),
                Excitations::Many(many) => many,
            };
            (kind.as_str(), entries)
        })
    }

    /// Whether there is an excitation of this kind.
    #[must_use]
    pub(crate) fn is_excited_by(&self, kind: &str) -> bool {
        self.excitation.contains_key(kind)
    }

    /// Specimen with a number from 1.
    #[must_use]
    pub(crate) fn specimen(&self, number: u32) -> Option<&SpecimenTable> {
        self.specimen.get(number.checked_sub(1)? as usize)
    }

    /// Name of the specimen with a number from 1.
    #[must_use]
    pub(crate) fn specimen_name(&self, number: u32) -> String {
        let name = self.specimen(number).and_then(|table| table.name.clone());
        let name = name.filter(|name| !name.trim().is_empty());
        name.unwrap_or_else(|| format!("specimen {number}"))
    }
}

/// `resolved.toml`: its text and its tables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResolvedTest {
    /// The text.
    pub text: String,
    /// Its tables; all empty where it cannot be read.
    pub file: TestFile,
}

impl From<String> for ResolvedTest {
    fn from(text: String) -> Self {
        let file = toml::from_str(&text).unwrap_or_default();
        Self { text, file }
    }
}

impl From<&str> for ResolvedTest {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}
