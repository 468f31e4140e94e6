//! `gusset schema`.

use super::exit::Exit;
use crate::config;

/// Prints the JSON Schema of the test file.
pub fn schema() -> anyhow::Result<Exit> {
    println!("{}", config::json_schema());
    Ok(Exit::Done)
}
