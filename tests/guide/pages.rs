//! The generated pages, each from data in the program.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::examples::{Examples, toml_files};
use super::reference::Reference;
use super::schema::Schema;
use super::{columns, events, limits};

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Folders with files whose values are examples.
fn folders() -> Vec<PathBuf> {
    ["src/assets/templates", "src/cli/templates", "config"]
        .map(|folder| root().join(folder))
        .to_vec()
}

/// The schemas of all kinds of files, with a heading for each.
pub fn schemas() -> [(&'static str, Schema); 4] {
    [
        ("Test file", Schema::new(&gusset_config::json_schema())),
        (
            "Study file",
            Schema::new(&gusset_config::study_json_schema()),
        ),
        (
            "Served file",
            Schema::new(&gusset_config::schema_of::<gusset_config::ServeFile>()),
        ),
        (
            "Fault script",
            Schema::new(&gusset_config::schema_of::<
                gusset_config::fault_script::Script,
            >()),
        ),
    ]
}

/// The text of a generated page.
pub fn generated(id: &str) -> String {
    match id {
        "configuration" => configuration(),
        "limit-table" => limits::limit_table(),
        "events" => events::events(),
        "columns" => columns::columns(),
        "studies" => studies(),
        other => panic!("no generator of the page {other}"),
    }
}

/// Keys without an example, as `owner.key`.
pub fn without_example() -> Vec<String> {
    let schemas = schemas();
    let examples = Examples::new(&schemas, &folders());
    let mut missing = Vec::new();
    for (_, schema) in &schemas {
        missing.extend(examples.missing(&Reference::new(schema).plain_keys()));
    }
    missing.sort();
    missing.dedup();
    missing
}

fn configuration() -> String {
    let files = schemas();
    let [test, study, served, script] = schemas();
    let study = (study.0, study.1.without_keys_of(&test.1));
    let schemas = [test, study, served, script];
    let references: Vec<_> = schemas
        .iter()
        .map(|(top, schema)| (top, Reference::new(schema)))
        .collect();
    let mut text = String::from(
        "# Configuration reference\n\n\
         This page lists every table and key of a test file, of a study, of a served file and of a fault script.\n\n\
         Each key shows its unit, the values that it takes, and its default or whether it is required. All quantities are in SI \
         units, and the end of a key names the unit. `gusset guide KEY` prints one entry, for example \
         `gusset guide time.step_s`.\n\n",
    );
    let mut written = BTreeMap::new();
    for (top, reference) in &references {
        let _ = writeln!(text, "- [{top}](#{})", gusset::guide::anchor(top));
        reference.contents(&written, &mut text);
        written.extend(reference.headings());
    }
    let examples = Examples::new(&files, &folders());
    let mut written = BTreeMap::new();
    for (top, reference) in &references {
        reference.write(top, &written, &examples, &mut text);
        written.extend(reference.headings());
    }
    format!("{}\n", text.trim_end())
}

/// One line for every file below `config/`.
fn studies() -> String {
    let mut text = String::from(
        "# Studies\n\nThis page lists the files in `config/` and what each of them shows.\n\n\
         Every file directly in `config/` runs by itself: `gusset run config/FILE.toml --clock simulated`. A file in a subfolder \
         needs a second program, or a second program reads it.\n",
    );
    let config = root().join("config");
    let mut folders: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in toml_files(&config) {
        let below = path.strip_prefix(root()).unwrap().parent().unwrap();
        folders
            .entry(below.to_str().unwrap().to_owned())
            .or_default()
            .push(path);
    }
    for (folder, files) in folders {
        let _ = writeln!(text, "\n## `{folder}/`\n");
        let rows: Vec<_> = files.iter().map(|path| (path, about(path))).collect();
        let is_explained = rows.iter().any(|(_, (_, shows))| !shows.is_empty());
        text.push_str(if is_explained {
            "| file | title | what it shows |\n|---|---|---|\n"
        } else {
            "| file | title |\n|---|---|\n"
        });
        for (path, (title, shows)) in rows {
            let name = path.file_name().unwrap().to_str().unwrap();
            let _ = write!(text, "| `{name}` | {} |", in_cell(&title));
            text.push_str(&if is_explained {
                format!(" {} |\n", in_cell(&shows))
            } else {
                "\n".to_owned()
            });
        }
    }
    text
}

/// Text for a cell of a table. Brackets in code are not escaped.
fn in_cell(text: &str) -> String {
    let mut cell = String::with_capacity(text.len());
    let mut in_code = false;
    for c in text.chars() {
        in_code ^= c == '`';
        if c == '|' || (!in_code && "<[".contains(c)) {
            cell.push('\\');
        }
        cell.push(c);
    }
    cell
}

/// The title of a file, and the first sentence of its first comment.
fn about(path: &Path) -> (String, String) {
    let text = std::fs::read_to_string(path).unwrap();
    let file: toml::Table = toml::from_str(&text).unwrap_or_default();
    // A study has its title in `[campaign]`.
    let campaign = file.get("campaign").and_then(|table| table.get("title"));
    let title = file.get("title").or(campaign);
    let title = title.and_then(|title| title.as_str());
    let lines = text
        .lines()
        .skip_while(|line| line.starts_with("#:") || line.is_empty());
    let comment = lines.take_while(|line| line.starts_with('#'));
    let comment: Vec<&str> = comment
        .map(|line| line.trim_start_matches('#').trim())
        .collect();
    let comment = comment.join(" ");
    // A full stop ends the sentence where a capital letter follows: "et al. (2014)" does not end there.
    let ends = comment.match_indices(". ").map(|(at, _)| at + 1);
    let end = ends.into_iter().find(|at| {
        let next = comment[*at..].trim_start().chars().next();
        next.is_some_and(char::is_uppercase)
    });
    let sentence = &comment[..end.unwrap_or(comment.len())];
    (
        title.unwrap_or_default().to_owned(),
        sentence.trim().to_owned(),
    )
}
