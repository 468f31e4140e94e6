//! Reads a test file for a command, and shows its mistakes.

use std::path::Path;

use super::exit::Mistakes;
use super::screen;
use gusset_config::{self as config, ConfigError, Loaded};

/// Reads a test file; its mistakes are shown with file, line and caret.
pub fn load(path: &Path, sets: &[String]) -> anyhow::Result<Loaded> {
    config::load(path, sets).map_err(refused)
}

/// A mistake of the user, in colour on a terminal.
pub fn refused(error: ConfigError) -> anyhow::Error {
    match error {
        ConfigError::Invalid(diagnostics) => {
            Mistakes(diagnostics.render(screen::in_colour())).into()
        }
        other => other.into(),
    }
}
