//! `resolved.toml`: the complete configuration, from which the same test runs again.
//!
//! It contains every default and override as a value. An automatic λ is replaced by the number that was found, with the
//! request in a comment beside it; input files point into the run folder's `inputs/`.

use thiserror::Error;
use toml_edit::visit_mut::{VisitMut, visit_table_like_kv_mut};
use toml_edit::{DocumentMut, Item, KeyMut, Value};

use super::Loaded;
use super::inputs::Inputs;
use super::safety::DIVERGENCE_M;
use super::schema::TestFile;
use super::value::LambdaValue;

/// Why the resolved text could not be written; each is a fault of the schema, not of the user.
#[derive(Debug, Error)]
pub enum ResolveError {
    /// A value has no form in TOML.
    #[error("the configuration cannot be written as TOML: {0}")]
    Write(#[from] toml::ser::Error),
    /// The text that was written is not TOML.
    #[error("the resolved configuration is not TOML: {0}")]
    Read(#[from] toml_edit::TomlError),
    /// An input was read, but no key names it: the text would point out of the run folder.
    #[error("input {requested:?} is named by no key that holds a path")]
    Unplaced {
        /// As the test file spells it.
        requested: String,
    },
}

/// The text of `resolved.toml`. `lambda` is the λ that an "auto" gave; `inputs` are the files that were read.
///
/// # Errors
/// [`ResolveError`].
pub fn resolve(
    file: &TestFile,
    lambda: Option<f64>,
    inputs: &Inputs,
) -> Result<String, ResolveError> {
    let mut file = file.clone();
    let request = match (file.integrator.lambda, lambda) {
        (LambdaValue::Auto, Some(value)) => {
            file.integrator.lambda = if value == f64::INFINITY {
                LambdaValue::Infinite
            } else {
                LambdaValue::Number(value)
            };
            Some(" # requested \"auto\"")
        }
        _ => None,
    };
    if file.structure.is_some() {
        file.safety.divergence_m.get_or_insert(DIVERGENCE_M);
    }
    // The whole frame is written, with the overrides in it.
    let frame = file
        .structure
        .as_mut()
        .and_then(|table| table.frame.as_mut());
    let frame_file = frame.and_then(|frame| frame.file.take());
    let mut document: DocumentMut = toml::to_string(&file)?.parse()?;
    if let Some(comment) = request
        && let Some(item) = document
            .get_mut("integrator")
            .and_then(|t| t.get_mut("lambda"))
        && let Some(value) = item.as_value_mut()
    {
        value.decor_mut().set_suffix(comment);
    }
    let mut paths = Paths {
        inputs,
        placed: frame_file.into_iter().collect(),
    };
    paths.visit_document_mut(&mut document);
    let all = inputs.files().iter().flat_map(|input| &input.requested);
    match all.into_iter().find(|r| !paths.placed.contains(r)) {
        Some(requested) => Err(ResolveError::Unplaced {
            requested: requested.clone(),
        }),
        None => Ok(document.to_string()),
    }
}

/// The text of a `resolved.toml` after overrides. The request for an automatic λ stays beside its number.
///
/// # Errors
/// [`ResolveError`].
pub fn resolve_again(loaded: &Loaded) -> Result<String, ResolveError> {
    let before: DocumentMut = loaded.text.parse()?;
    let mut document: DocumentMut = toml::to_string(&loaded.file)?.parse()?;
    let lambda = before.get("integrator").and_then(|t| t.get("lambda"));
    let table = document.get_mut("integrator");
    if let (Some(lambda), Some(table)) = (lambda, table.and_then(Item::as_table_like_mut)) {
        table.insert("lambda", lambda.clone());
    }
    Ok(document.to_string())
}

/// Points every key that holds the path of an input into the run folder.
struct Paths<'a> {
    inputs: &'a Inputs,
    placed: Vec<String>,
}

/// Keys that hold paths: `file`, `path`, and keys that end in `_file`.
fn holds_a_path(key: &str) -> bool {
    matches!(key, "file" | "path") || key.ends_with("_file")
}

impl VisitMut for Paths<'_> {
    fn visit_table_like_kv_mut(&mut self, key: KeyMut<'_>, item: &mut Item) {
        if holds_a_path(key.get())
            && let Some(requested) = item.as_str()
            && let Some(path) = self.inputs.path_in_run_folder(requested)
        {
            self.placed.push(requested.to_owned());
            *item = Item::Value(Value::from(path));
            return;
        }
        visit_table_like_kv_mut(self, key, item);
    }
}
