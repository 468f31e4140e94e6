//! The `[about]` table: who tests what, for archives and later readers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Who tests what. All keys are optional, and none changes the test. An empty text counts as not given. They are in the report, in
/// `summary.json`, in `gusset list`, and in the exports `hdf5`, `mat`, `mat73`, `parquet`, `mcap` and `designsafe`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AboutTable {
    /// Persons who run the test, with semicolons between them: "given name family name" or "family name, given name".
    #[schemars(example = &"Anna Müller; Muster, B.")]
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
    /// Remarks, in one line or several.
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
    /// DOI of the data set.
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

    /// Leaves out texts without content, and specimens without any.
    pub(crate) fn leave_out_empty(&mut self) {
        for text in [
            &mut self.operator,
            &mut self.laboratory,
            &mut self.project,
            &mut self.notes,
            &mut self.licence,
            &mut self.doi,
        ] {
            text.take_if(|text| is_blank(text));
        }
        self.keywords.retain(|word| !is_blank(word));
        for AboutSpecimen {
            material, state, ..
        } in &mut self.specimen
        {
            material.take_if(|text| is_blank(text));
            state.take_if(|text| is_blank(text));
        }
        self.specimen.retain(|specimen| !is_blank(&specimen.id));
    }

    /// True if nothing is said.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// True of a text that says nothing.
pub(crate) fn is_blank(text: &str) -> bool {
    text.trim().is_empty()
}
