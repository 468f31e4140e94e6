//! `gusset schema`.

use super::answer;
use super::exit::Exit;
use crate::config;

/// Prints the JSON Schema of the test file.
pub fn schema() -> anyhow::Result<Exit> {
    answer(config::json_schema())?;
    Ok(Exit::Done)
}
