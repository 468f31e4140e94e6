//! The `[about]` table: who tests what, for archives and later readers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Who tests what. All keys are optional, and none changes the test. They are in the report, in
/// `summary.json`, in `gusset list` and in every export.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AboutTable {
    /// Names of the persons who run the test.
    #[schemars(example = &"A. Muster")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// Laboratory or institution.
    #[schemars(example = &"Structures Laboratory")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub laboratory: Option<String>,
    /// Project, or the number of a grant.
    #[schemars(example = &"Braced frames, phase 2")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub project: Option<String>,
    /// Physical specimens.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub specimen: Vec<AboutSpecimen>,
    /// Remarks.
    #[schemars(example = &"Bolts tightened again after test 3.")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub notes: Option<String>,
    /// Words under which an archive lists the data.
    #[schemars(example = ["hybrid simulation"])]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub keywords: Vec<String>,
    /// Licence of the data.
    #[schemars(example = &"CC-BY-4.0")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// DOI of the data or of their paper.
    #[schemars(example = &"10.17603/ds2-abcd-1234")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doi: Option<String>,
}

/// A physical specimen.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AboutSpecimen {
    /// Its identifier in the laboratory.
    #[schemars(example = &"B-07")]
    pub id: String,
    /// Material.
    #[schemars(example = &"steel S355")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// State before the test.
    #[schemars(example = &"virgin")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<String>,
}

impl AboutTable {
    /// The content of `about` in `summary.json`; none for an empty table.
    #[must_use]
    pub fn as_json(&self) -> Option<serde_json::Value> {
        if self.is_empty() {
            return None;
        }
        serde_json::to_value(self).ok()
    }

    /// True if nothing is said.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}
