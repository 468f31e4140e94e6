//! The identification of specimens and actuators: the motion, the results, and a virtual twin.
//!
//! A [`Plan`] is the motion of each axis, within the limits of the test file. An [`Outcome`] is read from the run folder of that
//! motion. [`files`] are its documents: numbers, twin and pictures. The methods are in the module `identify`.

mod amplitude;
mod matrices;
mod outcome;
mod page;
mod plan;
mod twin;
mod words;

use std::path::{Path, PathBuf};

use thiserror::Error;

pub use outcome::{Axis, Outcome};
pub use plan::{Driven, Plan};
pub use words::{felt, of_specimen, parameters, with_error};

use gusset_config::{ConfigError, Loaded};
use gusset_motion::identify::Shape;
use gusset_record::FolderError;

/// Folder of the pictures in the run folder.
pub const PICTURES: &str = "identification";

/// The motion that a user requests.
#[derive(Debug, Clone)]
pub struct Request {
    /// The test file.
    pub test: PathBuf,
    /// The specimen; none: all, one after the other.
    pub specimen: Option<String>,
    /// Amplitude in m at the specimen; none: from the limits.
    pub amplitude: Option<f64>,
    /// Lowest and highest frequency in Hz; none: the usual ones.
    pub band: Option<Vec<f64>>,
    /// Duration of the motion of each axis in s.
    pub duration: f64,
    /// Kind of motion.
    pub shape: Shape,
    /// Seed of noise and steps.
    pub seed: u64,
}

/// Why nothing is identified.
#[derive(Debug, Error)]
pub enum IdentificationError {
    /// The motion is refused before anything moves.
    #[error("{0}\nnothing was moved")]
    Refused(String),
    /// The test that makes the motion, or the twin, is not valid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The record has gaps.
    #[error("{0}: nothing is identified from a broken record")]
    Broken(&'static str),
    /// The record cannot be read.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The columns of an axis cannot be read.
    #[error("{axis}: {source}")]
    Axis {
        /// Specimen and axis.
        axis: String,
        /// Why.
        source: FolderError,
    },
    /// A document cannot be written.
    #[error("a document of the identification cannot be written: {0}")]
    Document(String),
}

/// A refusal before anything moves.
const fn refusal(text: String) -> IdentificationError {
    IdentificationError::Refused(text)
}

/// Path below the run folder and text of every document of an identification in `folder`.
///
/// # Errors
/// A document cannot be made.
pub fn files(
    outcome: &Outcome,
    plan: &Plan,
    driven: &Loaded,
    folder: &Path,
) -> Result<Vec<(String, String)>, IdentificationError> {
    let json = serde_json::to_string_pretty(&outcome.as_json(folder));
    let json = json.map_err(|error| IdentificationError::Document(error.to_string()))?;
    let mut files = vec![("identification.json".to_owned(), json)];
    if let Some(twin) = twin::text(outcome, plan, driven)? {
        files.push(("identified.toml".to_owned(), twin));
    }
    let page = page::files(outcome, driven).into_iter();
    files.extend(page.map(|(name, text)| (format!("{PICTURES}/{name}"), text)));
    Ok(files)
}
