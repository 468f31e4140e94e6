//! Parts of a run according to its test file, and the columns of each.

use std::fs;

use crate::folder::slug;
use crate::run::Run;

/// The parsed test file, if it is readable.
pub(crate) struct Test {
    pub title: String,
    pub table: toml::Table,
    /// One per specimen: its number, its folder, its table.
    pub specimens: Vec<(u32, String, toml::Value)>,
}

impl Test {
    pub(crate) fn read(run: &Run) -> Self {
        let text = |name: &str| fs::read_to_string(run.path().join(name)).ok();
        let table = text("resolved.toml").or_else(|| text("test.toml"));
        let table: toml::Table = table.and_then(|text| text.parse().ok()).unwrap_or_default();
        let folder = run.path().file_name().map(|name| name.to_string_lossy());
        let title = table.get("title").and_then(toml::Value::as_str);
        let title = title.map_or_else(|| folder.unwrap_or_default().into_owned(), str::to_owned);
        let listed = table.get("specimen").and_then(toml::Value::as_array);
        let specimens = listed
            .into_iter()
            .flatten()
            .zip(1..)
            .map(|(specimen, number)| {
                let name = specimen.get("name").and_then(toml::Value::as_str);
                let folder = format!("{number}-{}", slug(name.unwrap_or("specimen")));
                (number, folder, specimen.clone())
            });
        Self {
            title,
            specimens: specimens.collect(),
            table,
        }
    }
}
