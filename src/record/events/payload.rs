//! Groups of fields that several kinds of events share, or that other modules fill in.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::encoding::{from_one, from_one_if_any, real};
use crate::miss::ON_MISS;
use gusset_quantity::catalog::limit::{Limit, Scope};

/// A word of the program: a constant where the program writes it, a text where it reads a file.
pub type Word = Cow<'static, str>;

/// A limit and what was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LimitReached {
    /// Specimen. Of a limit of the whole test: the specimen with the largest share, where that can be said.
    #[serde(
        rename = "specimen",
        default,
        skip_serializing_if = "Option::is_none",
        with = "from_one_if_any"
    )]
    pub port: Option<u32>,
    /// Axis.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        with = "from_one_if_any"
    )]
    pub axis: Option<u32>,
    /// Its key in the test file.
    pub limit: Word,
    /// Value, SI.
    #[serde(default = "unknown", with = "real")]
    pub value: f64,
    /// Allowed value, SI.
    #[serde(default = "unknown", with = "real")]
    pub bound: f64,
}

impl LimitReached {
    /// True for a limit of the test as a whole.
    #[must_use]
    pub fn is_of_test(&self) -> bool {
        let limit = Limit::of_key(&self.limit);
        limit.map_or(self.limit == ON_MISS, |limit| limit.scope() == Scope::Test)
    }
}

/// Position or force of an axis of a resumed test, in its own unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// Specimen.
    #[serde(rename = "specimen", with = "from_one")]
    pub port: u32,
    /// Axis.
    #[serde(with = "from_one")]
    pub axis: u32,
    /// The value found.
    #[serde(with = "real")]
    pub found: f64,
    /// The value when the test was interrupted.
    #[serde(with = "real")]
    pub left: f64,
    /// How far off it may be.
    #[serde(with = "real")]
    pub within: f64,
    /// True if it differs by more than the noise of its sensor, also within what is allowed.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub differs: bool,
}

/// How well the warm-up kept its ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct WarmUp {
    /// Ticks that counted.
    pub ticks: u64,
    /// Those that missed their deadline.
    pub missed: u64,
    /// The most of them in a row.
    pub in_a_row: u64,
    /// Average duration of a tick.
    pub mean_ns: u64,
    /// Longest duration of a tick.
    pub longest_ns: u64,
}

/// The value of a limit that ended a controller's test, in the unit that the line names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TripValue {
    /// Axis.
    #[serde(with = "from_one")]
    pub axis: u32,
    /// Unit.
    pub unit: Word,
    /// Value.
    #[serde(with = "real")]
    pub value: f64,
    /// Allowed value.
    #[serde(with = "real")]
    pub bound: f64,
}

/// Everything with which a controller's test begins, and its replay. Numbers are in the units of the server.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ready {
    /// Name of the specimen.
    pub specimen: String,
    /// It keeps its state from test to test.
    pub remembers: bool,
    /// It moves, or represents one that moves.
    pub moves: bool,
    /// Number of the first command.
    pub first: u64,
    /// Commands per announced number of seconds.
    pub rate: Option<[u64; 2]>,
    /// Announced place of the first command; empty if the controller did not announce it.
    pub start: Vec<f64>,
    /// Announced limits of each axis: smallest and largest displacement, largest speed and force. Null where there is no limit.
    pub limits: Vec<[Option<f64>; 4]>,
    /// Place of the specimen by its introduction, and whether that was measured.
    pub standing: Vec<f64>,
    /// See `standing`.
    pub measured: bool,
    /// Force by its introduction; empty without one.
    pub force: Vec<f64>,
    /// Displacement and force of each axis before the first command.
    pub at_rest: Vec<[f64; 2]>,
}

const fn unknown() -> f64 {
    f64::NAN
}
