//! The guide and the README: generated pages are fresh, links resolve, and every command block works.
//!
//! `GUSSET_WRITE_GUIDE=1 cargo test --test guide` updates the generated pages and the lists in `tests/guide/`.

mod columns;
mod commands;
#[path = "../common/mod.rs"]
mod common;
mod events;
mod examples;
mod execute;
mod limits;
mod markdown;
mod names;
mod pages;
mod reference;
mod schema;
mod values;

use std::fs;
use std::sync::Mutex;

use gusset::guide::PAGES;

use common::say;
use execute::Place;
use markdown::{Block, Markdown};
use pages::{generated, root, schemas, without_example};
use schema::parsed;

/// Words of a written page.
const MOST_WORDS: usize = 1400;
/// Words and lines of the README.
const README_WORDS: usize = 900;
const README_LINES: usize = 120;
/// Tables that a study has beside those of a test. `gusset check` takes no study.
const STUDY_TABLES: [&str; 5] = ["campaign", "vary", "sample", "records", "measure"];
/// Pages whose blocks are executed at the same time.
const THREADS: usize = 2;

fn writes() -> bool {
    std::env::var_os("GUSSET_WRITE_GUIDE").is_some_and(|value| value == "1")
}

/// Every text of the guide, by name, with the README and the contents page.
fn texts() -> Vec<(String, String)> {
    let pages = PAGES.iter().map(|page| format!("src/guide/{}.md", page.id));
    let names = ["README.md", "src/guide/README.md"]
        .map(str::to_owned)
        .into_iter()
        .chain(pages);
    let read = |name: String| {
        let text = fs::read_to_string(root().join(&name)).unwrap();
        (name, text)
    };
    names.map(read).collect()
}

fn fail_if_any(wrong: &[String]) {
    assert!(
        wrong.is_empty(),
        "{} faults:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}

/// Compares a file with the expected text, or writes the text.
fn fresh(path: &str, text: &str) -> Option<String> {
    let place = root().join(path);
    if writes() {
        fs::write(&place, text).unwrap();
    }
    let found = fs::read_to_string(&place).unwrap_or_default();
    let line = found
        .lines()
        .zip(text.lines())
        .position(|(found, text)| found != text);
    (found != text).then(|| {
        let line = line.unwrap_or_else(|| found.lines().count().min(text.lines().count())) + 1;
        format!("{path} is stale from line {line} on: GUSSET_WRITE_GUIDE=1 cargo test --test guide updates it")
    })
}

#[test]
fn generated_pages_are_fresh() {
    let generated_pages = PAGES.iter().filter(|page| page.is_generated);
    let stale = generated_pages
        .filter_map(|page| fresh(&format!("src/guide/{}.md", page.id), &generated(page.id)));
    fail_if_any(&stale.collect::<Vec<_>>());
}

/// The list of keys without an example only shrinks.
#[test]
fn every_key_has_an_example() {
    let known = fs::read_to_string(root().join("tests/guide/no-example.txt")).unwrap_or_default();
    let missing = without_example();
    let wrong: Vec<String> = missing
        .iter()
        .filter(|key| !writes() && !known.lines().any(|line| line == key.as_str()))
        .map(|key| format!("{key} has no example: give one with #[schemars(example = …)] or in a file of config/"))
        .collect();
    fail_if_any(&wrong);
    let text: String = missing.iter().map(|key| format!("{key}\n")).collect();
    fail_if_any(
        &fresh("tests/guide/no-example.txt", &text)
            .into_iter()
            .collect::<Vec<_>>(),
    );
}

#[test]
fn every_limit_and_column_is_listed() {
    fail_if_any(&names::limits());
}

#[test]
fn columns_are_listed_with_their_units() {
    let temp = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for (name, more) in [
        ("three-actuators", ["--set", "time.duration_s=0.25"]),
        ("vrths-case-1", ["--set", "time.duration_s=0.25"]),
    ] {
        let test = root().join(format!("config/{name}.toml"));
        let out = temp.path().join(name);
        common::completed(&test, &out, &["--clock", "simulated", more[0], more[1]]);
        let layout = fs::read_to_string(out.join("samples.json")).unwrap();
        wrong.extend(names::columns_of(&layout));
    }
    fail_if_any(&wrong);
}

#[test]
fn pages_are_short() {
    let mut wrong = Vec::new();
    let generated = PAGES.iter().filter(|page| page.is_generated);
    let generated: Vec<String> = generated
        .map(|page| format!("src/guide/{}.md", page.id))
        .collect();
    for (name, text) in texts() {
        let words = text.split_whitespace().count();
        if words > MOST_WORDS && name != "README.md" && !generated.contains(&name) {
            wrong.push(format!(
                "{name} has {words} words, allowed are {MOST_WORDS}"
            ));
        }
    }
    fail_if_any(&wrong);
}

#[test]
fn the_readme_is_short() {
    let text = fs::read_to_string(root().join("README.md")).unwrap();
    let (words, lines) = (text.split_whitespace().count(), text.lines().count());
    assert!(
        words <= README_WORDS,
        "{words} words, allowed are {README_WORDS}"
    );
    assert!(
        lines <= README_LINES,
        "{lines} lines, allowed are {README_LINES}"
    );
}

#[test]
fn every_block_names_a_known_language() {
    let mut wrong = Vec::new();
    for (name, text) in texts() {
        for block in markdown::read(&text).blocks {
            let place = format!("{name}:{}", block.line);
            if block.is_indented {
                wrong.push(format!(
                    "{place}: an indented block: use a fence with a language"
                ));
            } else if block.language.is_empty() {
                wrong.push(format!("{place}: a block without a language"));
            }
            for word in &block.unknown {
                wrong.push(format!("{place}: `{word}` behind the fence means nothing: use file=\"…\" or no-run=\"…\""));
            }
            if block.no_run.as_deref() == Some("") {
                wrong.push(format!("{place}: no-run without a reason"));
            }
        }
    }
    fail_if_any(&wrong);
}

#[test]
fn every_link_resolves() {
    let mut wrong = Vec::new();
    for (name, text) in texts() {
        let page = markdown::read(&text);
        let is_guide = name.starts_with("src/guide/");
        let folder = root().join(&name);
        let folder = folder.parent().unwrap();
        wrong.extend(
            page.unresolved
                .iter()
                .map(|label| format!("{name}: the label [{label}] has no definition")),
        );
        for link in &page.links {
            let target = &link.target;
            if target.contains("://") || target.starts_with('#') || target.starts_with("mailto:") {
                continue;
            }
            let file = target.split('#').next().unwrap_or_default();
            if !folder.join(file).exists() {
                wrong.push(format!("{name}: {target} does not exist"));
            } else if is_guide && !link.is_image {
                wrong.extend(
                    label_fault(target, link.label.as_deref())
                        .map(|what| format!("{name}: {what}")),
                );
            }
        }
    }
    fail_if_any(&wrong);
}

/// A link between pages has the page's id as label: rustdoc replaces its definition.
fn label_fault(target: &str, label: Option<&str>) -> Option<String> {
    let id = target.strip_suffix(".md");
    let id = if id == Some("README") {
        Some("guide")
    } else {
        id
    };
    match id {
        None => Some(format!(
            "{target} is no page of the guide: name the file as code"
        )),
        Some(id) if label != Some(id) => Some(format!(
            "write the link to {target} as [text][{id}], with the definition at the end of the page"
        )),
        Some(_) => None,
    }
}

#[test]
fn every_command_and_option_exists() {
    let program = gusset::cli::definition();
    let mut wrong = Vec::new();
    for (name, text) in texts() {
        let page = markdown::read(&text);
        for block in page.blocks.iter().filter(|block| block.language == "sh") {
            let found = commands::wrong(&block.text, &program);
            wrong.extend(
                found
                    .iter()
                    .map(|what| format!("{name}:{}: {what}", block.line)),
            );
        }
        for span in page.spans.iter().filter(|span| span.starts_with("gusset ")) {
            let found = commands::wrong(span, &program);
            wrong.extend(found.iter().map(|what| format!("{name}: {what}")));
        }
    }
    fail_if_any(&wrong);
}

/// A fragment fits a test file, a study, a served file or a fault script.
#[test]
fn every_key_of_a_toml_block_exists() {
    let schemas = schemas();
    let mut wrong = Vec::new();
    for (name, text) in texts() {
        for block in markdown::read(&text)
            .blocks
            .iter()
            .filter(|block| block.language == "toml")
        {
            let place = format!("{name}:{}", block.line);
            match parsed(&block.text) {
                Err(error) => wrong.push(format!("{place}: {error}")),
                Ok(file) => {
                    let unknown = schemas.iter().map(|(_, schema)| schema.unknown(&file));
                    let fewest = unknown.min_by_key(Vec::len).unwrap_or_default();
                    wrong.extend(
                        fewest
                            .iter()
                            .map(|key| format!("{place}: no file has the key `{key}`")),
                    );
                }
            }
        }
    }
    fail_if_any(&wrong);
}

#[test]
fn list_of_unexecuted_blocks_is_fresh() {
    let mut text =
        String::from("# Blocks that the tests do not execute: page | first line | reason\n");
    for (name, page) in texts() {
        for block in markdown::read(&page).blocks {
            if let Some(reason) = &block.no_run {
                let first = block.text.lines().next().unwrap_or_default();
                text.push_str(&format!("{name} | {first} | {reason}\n"));
            }
        }
    }
    fail_if_any(
        &fresh("tests/guide/not-run.txt", &text)
            .into_iter()
            .collect::<Vec<_>>(),
    );
}

/// Executes the blocks of one page in their order; returns the first fault.
fn executed(name: &str, page: &Markdown) -> Option<String> {
    let has_work = |block: &Block| block.language == "sh" || block.file.is_some();
    if !page.blocks.iter().any(has_work) {
        return None;
    }
    let place = Place::new();
    for block in &page.blocks {
        if let Err(what) = place.take(block) {
            return Some(format!("{name}:{}: {what}", block.line));
        }
    }
    let tests = page.blocks.iter().filter(|block| {
        let has = |table: &&str| parsed(&block.text).is_ok_and(|file| file.get(table).is_some());
        block.language == "toml" && has(&"time") && !STUDY_TABLES.iter().any(has)
    });
    for block in tests {
        if let Some(Err(what)) = block.file.as_ref().map(|file| place.check(file)) {
            return Some(format!("{name}:{}: {what}", block.line));
        }
    }
    None
}

#[test]
fn every_command_block_works() {
    let pages: Vec<(String, Markdown)> = texts()
        .into_iter()
        .map(|(name, text)| (name, markdown::read(&text)))
        .collect();
    let only = std::env::var("GUSSET_GUIDE_PAGE").ok();
    let waiting = Mutex::new(
        pages
            .iter()
            .filter(|(name, _)| only.as_ref().is_none_or(|page| name.contains(page))),
    );
    let wrong = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                loop {
                    let next = waiting.lock().unwrap().next();
                    let Some((name, page)) = next else {
                        break;
                    };
                    wrong.lock().unwrap().extend(executed(name, page));
                }
            });
        }
    });
    fail_if_any(&wrong.into_inner().unwrap());
}

#[test]
fn guide_prints_pages_and_suggests_topics() {
    let contents = say(["guide"]);
    assert_eq!(contents.code, Some(0));
    for page in PAGES {
        assert!(
            contents.stdout.contains(&format!("[{}]", page.id)),
            "{}",
            page.id
        );
        let said = say(["guide", page.id]);
        assert_eq!(said.code, Some(0), "{}", page.id);
        assert!(said.stdout.starts_with(page.title()), "{}", page.id);
        assert!(
            !said.stdout.contains("]: "),
            "{} shows a definition",
            page.id
        );
    }
    let key = say(["guide", "limits.command_disp_m"]);
    assert_eq!(key.code, Some(0));
    assert!(
        key.stdout.starts_with("specimen.limits.command_disp_m\n"),
        "{}",
        key.stdout
    );
    let table = say(["guide", "integrator"]);
    assert!(table.stdout.contains("`lambda`"), "{}", table.stdout);
    for (name, page) in [("limit_trip", "events"), ("target_1_1", "columns")] {
        let said = say(["guide", name]);
        assert_eq!(said.code, Some(0), "{name}: {}", said.stderr);
        let more = format!("gusset guide {page}");
        assert!(said.stdout.contains(&more), "{}", said.stdout);
    }
    let unknown = say(["guide", "trouble-shooting"]);
    assert_eq!(unknown.code, Some(2));
    assert!(
        unknown.stderr.contains("`troubleshooting`"),
        "{}",
        unknown.stderr
    );
}

#[test]
fn lines_of_the_guide_fit_a_terminal() {
    for page in PAGES {
        let blocks = markdown::read(page.text).blocks;
        let is_code = |line: &str| blocks.iter().any(|block| block.text.contains(line.trim()));
        for line in say(["guide", page.id]).stdout.lines() {
            let is_one_word = line.split_whitespace().count() <= 2;
            let fits = line.chars().count() <= 100 || is_code(line) || is_one_word;
            assert!(fits, "{}: {line}", page.id);
        }
    }
}
