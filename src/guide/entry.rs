//! Tables and keys of the configuration reference, found by their dotted path.
//!
//! The page `configuration` has one heading per table, ``## `[specimen.limits]` ``, and one list item per key, which begins
//! with ``- **`command_disp_m`**``. A line that begins with "Also: " names further tables with the same keys.

use super::page;

/// A table or a key of the configuration reference.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Dotted path without brackets and numbers: `specimen.limits.command_disp_m`.
    pub path: String,
    /// True for a table with its keys.
    pub is_table: bool,
    /// The Markdown text.
    pub text: &'static str,
}

const TABLE: &str = "## `[";
const KEY: &str = "- **`";
const ALSO: &str = "Also: ";

/// Every table and key of the configuration reference, under each of its paths.
#[must_use]
pub fn entries() -> Vec<Entry> {
    page("configuration").map_or_else(Vec::new, |page| entries_of(page.text))
}

fn entries_of(text: &'static str) -> Vec<Entry> {
    let mut found = Vec::new();
    for section in pieces(text, "## ") {
        let paths = paths_of(section);
        for path in paths.iter().filter(|path| !path.is_empty()) {
            found.push(Entry {
                path: path.clone(),
                is_table: true,
                text: section,
            });
        }
        for item in pieces(section, KEY) {
            let key = item
                .strip_prefix(KEY)
                .and_then(|rest| rest.split('`').next());
            for (path, key) in paths.iter().zip(std::iter::repeat(key.unwrap_or_default())) {
                found.push(Entry {
                    path: joined(path, key),
                    is_table: false,
                    text: item,
                });
            }
        }
    }
    found
}

/// The pieces of a text that begin at lines with this start, each up to the next one or to the end.
fn pieces(text: &'static str, start: &str) -> Vec<&'static str> {
    let line_start = format!("\n{start}");
    let mut places: Vec<usize> = text
        .match_indices(&line_start)
        .map(|(at, _)| at + 1)
        .collect();
    if text.starts_with(start) {
        places.insert(0, 0);
    }
    let ends = places.iter().skip(1).copied().chain([text.len()]);
    let pairs = places.iter().copied().zip(ends);
    pairs.filter_map(|(from, to)| text.get(from..to)).collect()
}

/// The paths of a section's table: that of its heading, then the further ones.
fn paths_of(section: &str) -> Vec<String> {
    // The keys of a file outside of all tables stand under a heading in words.
    let Some(heading) = section
        .strip_prefix(TABLE)
        .and_then(|rest| rest.split('`').next())
    else {
        return vec![String::new()];
    };
    let also = section.lines().find(|line| line.starts_with(ALSO));
    let also = also
        .into_iter()
        .flat_map(|line| line.split('`').skip(1).step_by(2));
    let all = std::iter::once(heading).chain(also);
    all.map(|path| path.replace(['[', ']'], "")).collect()
}

fn joined(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

/// The entries with this path, or else those whose path ends with it. Brackets and numbers of a path do not count:
/// `specimen.0.storey` is `specimen.storey`.
///
/// For a key that opens a table, the result is the table. The first names of a longer path may differ, because several paths
/// share one table.
#[must_use]
pub fn find(query: &str) -> Vec<Entry> {
    let mut wanted = query;
    loop {
        let found = found_in(entries(), wanted);
        match wanted.split_once('.') {
            Some((_, end)) if found.is_empty() && end.contains('.') => wanted = end,
            _ => return found,
        }
    }
}

fn found_in(entries: Vec<Entry>, query: &str) -> Vec<Entry> {
    let query = query.to_lowercase().replace(['[', ']'], "");
    let parts = query.split('.').map(str::trim);
    let wanted = parts.filter(|part| !part.is_empty() && part.parse::<usize>().is_err());
    let wanted = wanted.collect::<Vec<_>>().join(".");
    if wanted.is_empty() {
        return Vec::new();
    }
    let end = format!(".{wanted}");
    let (exact, rest): (Vec<_>, Vec<_>) = entries
        .into_iter()
        .filter(|entry| entry.path == wanted || entry.path.ends_with(&end))
        .partition(|entry| entry.path == wanted);
    let mut found = if exact.is_empty() { rest } else { exact };
    let tables: Vec<String> = found
        .iter()
        .filter(|entry| entry.is_table)
        .map(|entry| entry.path.clone())
        .collect();
    let opens_a_table = |entry: &Entry| entry.text.contains("\n  Keys: [");
    found.retain(|entry| {
        entry.is_table
            || !(tables.contains(&entry.path) || (!tables.is_empty() && opens_a_table(entry)))
    });
    // One text is shown once, under its first path.
    let mut shown: Vec<&str> = Vec::new();
    found.retain(|entry| {
        let is_new = !shown.contains(&entry.text);
        shown.push(entry.text);
        is_new
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "# Configuration reference\n\n## `[time]`\n\nSteps.\n\n- **`step_s`** · s\n\n  Step.\n\n\
        ## `[[specimen]]`\n\nOne.\n\n- **`limits`** · table\n\n  Keys: [`[specimen.limits]`](#a)\n\n- **`storey`** · number\n\n\
        ## `[specimen.limits]`\n\nAlso: `[specimen.axis.limits]`.\n\n- **`lag_s`** · s\n";

    fn paths(query: &str) -> Vec<String> {
        let found = found_in(entries_of(PAGE), query);
        found.into_iter().map(|entry| entry.path).collect()
    }

    #[test]
    fn key_is_found_by_the_end_of_its_path() {
        assert_eq!(paths("time.step_s"), ["time.step_s"]);
        assert_eq!(paths("step_s"), ["time.step_s"]);
        assert_eq!(paths("specimen.0.storey"), ["specimen.storey"]);
        assert_eq!(paths("[[specimen]]"), ["specimen"]);
        assert_eq!(paths("steps"), [""; 0]);
    }

    #[test]
    fn a_table_stands_for_the_key_that_opens_it() {
        let found = found_in(entries_of(PAGE), "specimen.limits");
        assert_eq!(found.len(), 1);
        assert!(found[0].is_table && found[0].text.contains("lag_s"));
    }

    #[test]
    fn a_key_of_several_tables_is_shown_once() {
        assert_eq!(paths("limits.lag_s"), ["specimen.limits.lag_s"]);
        assert_eq!(
            paths("specimen.axis.limits.lag_s"),
            ["specimen.axis.limits.lag_s"]
        );
    }
}
