use std::fs;
use std::path::Path;

use super::*;

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/guide")
}

#[test]
fn every_page_file_is_in_the_table() {
    let mut ids: Vec<String> = fs::read_dir(folder())
        .unwrap()
        .filter_map(|entry| {
            let name = entry.unwrap().file_name().into_string().unwrap();
            name.strip_suffix(".md").map(str::to_owned)
        })
        .filter(|id| id != "README")
        .collect();
    ids.sort();
    let mut known: Vec<&str> = PAGES.iter().map(|page| page.id).collect();
    known.sort_unstable();
    assert_eq!(ids, known);
}

#[test]
fn every_page_begins_with_its_title() {
    for page in PAGES {
        assert!(page.text.starts_with("# "), "{}", page.id);
        assert!(!page.title().is_empty(), "{}", page.id);
    }
}

#[test]
fn rustdoc_and_contents_list_every_page() {
    let links = include_str!("rustdoc-links.txt");
    for page in PAGES {
        let module = page.id.replace('-', "_");
        let line = format!("[{}]: crate::guide::{module}\n", page.id);
        assert!(links.contains(&line), "no line {line}");
        let line = format!("[{0}]: {0}.md", page.id);
        assert!(CONTENTS.contains(&line), "no line {line}");
        assert!(CONTENTS.contains(&format!("][{}]", page.id)), "{}", page.id);
    }
    let definitions = links.lines().filter(|line| !line.is_empty()).count();
    assert_eq!(definitions, PAGES.len() + 1);
}

/// Every SVG file in the folder of the guide or a folder below it, relative to it.
fn pictures(folder: &Path, below: &str) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() {
            found.extend(pictures(&path, &format!("{below}{name}/")));
        } else if name.ends_with(".svg") {
            found.push(format!("{below}{name}"));
        }
    }
    found.sort();
    found
}

#[test]
fn every_picture_is_in_the_manual() {
    let mut known: Vec<&str> = PICTURES.iter().map(|(name, _)| *name).collect();
    known.sort_unstable();
    assert_eq!(
        pictures(&folder(), ""),
        known,
        "add it to PICTURES in src/guide/mod.rs"
    );
}
