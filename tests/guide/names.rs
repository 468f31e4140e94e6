//! Whether the lists of the guide have every name that the program has.

use std::collections::BTreeSet;
use std::fs;

use gusset::catalog::limit::Limit;
use serde_json::Value;

use super::columns::{SERVER_COLUMNS, TEST_COLUMNS};
use super::limits::FURTHER_LIMITS;
use super::pages::{root, schemas};

/// Names that only one of two sets has.
fn differences(kind: &str, program: &BTreeSet<String>, listed: &BTreeSet<String>) -> Vec<String> {
    let missing = program
        .difference(listed)
        .map(|name| format!("{kind} `{name}` is not listed in tests/guide/"));
    let surplus = listed
        .difference(program)
        .map(|name| format!("{kind} `{name}` is listed, but the program has none"));
    missing.chain(surplus).collect()
}

fn set<'a>(names: impl Iterator<Item = &'a str>) -> BTreeSet<String> {
    names.map(str::to_owned).collect()
}

pub fn limits() -> Vec<String> {
    let mut wrong = Vec::new();
    let schemas = schemas();
    let test = schemas[0].1.root();
    for [key, _, _, _, table] in FURTHER_LIMITS {
        let owner = if table == "safety" {
            "SafetyTable"
        } else {
            "LinkSpec"
        };
        if test["$defs"][owner]["properties"].get(key).is_none() {
            wrong.push(format!("limit `{key}`: [{table}] has no such key"));
        }
    }
    wrong
}

/// The text in quotes at the beginning, after blanks.
fn quoted(text: &str) -> Option<&str> {
    text.trim_start().strip_prefix('"')?.split('"').next()
}

/// The first texts of the entries of a constant array or of the calls of a function, in a source file.
fn first_texts(file: &str, start: &str, end: &str, before: &str) -> BTreeSet<String> {
    let text = fs::read_to_string(root().join(file)).unwrap();
    let part = text
        .split(start)
        .nth(1)
        .and_then(|rest| rest.split(end).next());
    let part = part.unwrap_or_else(|| panic!("{file} has no {start}"));
    let names = part
        .match_indices(before)
        .filter_map(|(at, _)| quoted(&part[at + before.len()..]));
    let names = names.filter(|name| {
        !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c == '_')
    });
    set(names)
}

pub fn columns() -> Vec<String> {
    const COLUMNS: &str = "src/engine/columns.rs";
    const PORT: &str = "src/engine/port_columns.rs";
    let stem = |name: &'static str| name.split_once("_S").map_or(name, |(stem, _)| stem);
    let listed = set(TEST_COLUMNS.iter().map(|row| row[0]).map(stem));
    let mut program = first_texts(COLUMNS, "const BOOKKEEPING", "];\n", "(");
    program.extend(first_texts(COLUMNS, "const TIMING", "];\n", "(\n"));
    program.extend(set([
        "ground",
        "xN",
        "vN",
        "aN",
        "comp_NAME",
        "judged_NAME",
        "seq",
        "status",
        "margin",
    ]
    .into_iter()));
    program.extend(first_texts(PORT, "fn port_columns", "\n}\n", "add("));
    program.extend(first_texts(
        PORT,
        "fn port_columns",
        "\n}\n",
        "            (",
    ));
    let kept = Limit::OF_TEST
        .iter()
        .filter(|quantity| !quantity.is_of_misses());
    program.extend(kept.map(|quantity| quantity.key().to_owned()));
    let mut wrong = differences("column", &program, &listed);

    const RIG: &str = "src/link/rig/columns.rs";
    let stem = |name: &'static str| {
        name.strip_suffix("_1_A")
            .or(name.strip_suffix("_1"))
            .unwrap_or(name)
    };
    let listed = set(SERVER_COLUMNS.iter().map(|row| row[0]).map(stem));
    let mut program = first_texts(RIG, "const HEAD", "];\n", "(");
    program.extend(first_texts(RIG, "const AXIS", "];\n", "("));
    program.extend(set(["commits", "status"].into_iter()));
    wrong.extend(differences("server column", &program, &listed));
    wrong
}

/// Columns of a run that are not listed, or listed with another unit.
pub fn columns_of(layout: &str) -> Vec<String> {
    let layout: Value = serde_json::from_str(layout).unwrap();
    let mut wrong = Vec::new();
    for column in layout["columns"].as_array().unwrap() {
        let name = column["name"].as_str().unwrap();
        let unit = column["unit"].as_str().unwrap().replace('2', "²");
        let Some(row) = TEST_COLUMNS.iter().find(|row| fits(name, row[0])) else {
            wrong.push(format!("column `{name}` is not listed in tests/guide/"));
            continue;
        };
        let given = row[1];
        let is_same = given.split(" or ").any(|one| one == unit)
            || (given == "unit of the axis" && !unit.is_empty())
            || given.starts_with("of the ");
        if !is_same {
            wrong.push(format!("column `{name}`: unit {unit}, listed {given}"));
        }
    }
    wrong
}

/// True if the name is an instance of the pattern.
fn fits(name: &str, pattern: &str) -> bool {
    if let Some(letter) = pattern.strip_suffix('N') {
        return name
            .strip_prefix(letter)
            .is_some_and(|rest| rest.parse::<usize>().is_ok());
    }
    let mut stem = name;
    let mut places = pattern;
    for end in ["_A", "_C", "_S"] {
        if let Some(rest) = places.strip_suffix(end) {
            places = rest;
            let Some((before, number)) = stem.rsplit_once('_') else {
                return false;
            };
            if number.parse::<usize>().is_err() {
                return false;
            }
            stem = before;
        }
    }
    match places.strip_suffix("NAME") {
        Some(start) => stem.starts_with(start),
        None => stem == places,
    }
}
