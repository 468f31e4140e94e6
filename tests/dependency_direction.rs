//! A separate binary: it uses nothing of the crate, so `rustc --test` builds it in seconds.
//!
//! The compiler keeps the direction of dependencies between the members of the workspace. These tests keep the rules that it does
//! not know.

#[path = "dependency/cycles.rs"]
mod cycles;

use std::fs;
use std::path::{Path, PathBuf};

/// Members and modules without system calls: no files, sockets, threads, clocks or logs.
const PURE: &[&str] = &[
    "quantity/catalog",
    "quantity/finding",
    "quantity/state",
    "quantity/substructure",
    "quantity/text",
    "numerics",
    "motion",
    "actuator",
    "proof",
    "reduction",
    "wire",
    "control/port",
    "evidence/benchmark",
    "guide",
];

/// Ways to the system that a pure module must not take.
const SYSTEM: &[&str] = &[
    "std::fs",
    "std::net",
    "std::thread",
    "std::io::Read",
    "std::io::Write",
    "std::io::std",
    "std::process",
    "std::env",
    "tracing::",
    "rustix",
    "libc::",
    "tokio",
    "Instant",
    "SystemTime",
];

/// Types whose state is not derived: `state!` takes a type apart without `..`, so that no field is forgotten. These take all of
/// their fields or variants apart by hand, or have one of a single kind.
const STATES_BY_HAND: &[&str] = &[
    "Ahead",
    "Aligned",
    "Basic",
    "Delay",
    "DisplacementBased",
    "Elements",
    "Exchange",
    "ExchangeState",
    "ForceBased",
    "Hinged",
    "Hold",
    "Kept",
    "Phase",
    "Side",
    "Slider",
    "Status",
    "Stepper",
];

fn sources() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src")];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The code of the file without its tests and comments.
fn code_of(path: &Path) -> String {
    // A test may take its material from anywhere.
    let inside = path
        .strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("src"))
        .unwrap();
    if inside.ends_with("tests.rs") || inside.components().any(|part| part.as_os_str() == "tests") {
        return String::new();
    }
    let text = fs::read_to_string(path).unwrap();
    let body = text.split("#[cfg(test)]\nmod tests").next().unwrap();
    body.lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn pure_modules_do_not_touch_the_system() {
    let mut wrong = Vec::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let is_pure = |path: &&PathBuf| {
        let inside = path.strip_prefix(&root).unwrap().with_extension("");
        PURE.iter().any(|pure| inside.starts_with(pure))
    };
    let all = sources();
    assert!(
        PURE.iter()
            .all(|pure| root.join(pure).exists() || root.join(format!("{pure}.rs")).exists())
    );
    for path in all.iter().filter(is_pure) {
        let code = code_of(path);
        for way in SYSTEM.iter().filter(|way| code.contains(**way)) {
            wrong.push(format!("{}: names {way}", path.display()));
        }
    }
    assert!(
        wrong.is_empty(),
        "system calls in pure modules:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn unsafe_code_is_in_one_file_only() {
    for path in sources() {
        let code = code_of(&path);
        let unsafe_here = code.contains("unsafe {") || code.contains("unsafe fn");
        assert!(
            !unsafe_here || path.ends_with("src/record/rt/os.rs"),
            "{}",
            path.display()
        );
    }
}

/// Nothing but the sparse solver, and the eigenvalues of a loop, with which no test computes.
#[test]
fn few_states_are_written_by_hand() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    for path in sources() {
        let defines = ["quantity/state.rs", "quantity/frame.rs"];
        if defines.iter().any(|file| path == root.join(file)) {
            continue;
        }
        for rest in code_of(&path).split("Stateful for ").skip(1) {
            let name = rest.split(|c: char| !c.is_alphanumeric()).next();
            found.push(name.unwrap().to_owned());
        }
    }
    found.sort();
    assert_eq!(found, STATES_BY_HAND, "derive the others with `state!`");
}

#[test]
fn only_three_files_name_faer() {
    for path in sources() {
        let mut may = [
            "src/numerics/linalg/sparse.rs",
            "src/numerics/spectral/eigen.rs",
            "src/reduction/factor.rs",
        ]
        .into_iter();
        assert!(
            !code_of(&path).contains("faer") || may.any(|file| path.ends_with(file)),
            "{} names faer",
            path.display()
        );
    }
}

/// The comments of each file, joined to one line.
fn comments() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut open: Vec<PathBuf> = ["src", "tests", "benches", "tools", "config", ".ci"]
        .map(|folder| root.join(folder))
        .into();
    let mut found = Vec::new();
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
                continue;
            }
            // Binary files and the documents themselves have no comments.
            let is_document = path.extension().is_some_and(|ending| ending == "md");
            let Some(text) = fs::read_to_string(&path).ok().filter(|_| !is_document) else {
                continue;
            };
            let lines = text.lines().map(str::trim_start);
            let lines = lines.filter(|line| {
                ["//", "#", "*", "%"]
                    .iter()
                    .any(|mark| line.starts_with(mark))
            });
            let bare = lines.map(|line| line.trim_start_matches(['/', '!', '#', '*', '%', ' ']));
            found.push((path, bare.collect::<Vec<_>>().join(" ")));
        }
    }
    found
}

#[test]
fn comments_cite_only_project_documents() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut wrong = Vec::new();
    for (path, text) in comments() {
        let beside = path.parent().unwrap();
        for (end, _) in text.match_indices(".md") {
            let is_name = |c: char| c.is_alphanumeric() || "-_./".contains(c);
            let start = text[..end].rfind(|c| !is_name(c)).map_or(0, |at| {
                at + text[at..].chars().next().map_or(1, char::len_utf8)
            });
            let name = format!("{}.md", &text[start..end]);
            let folders = [root, beside, &root.join("tools"), &root.join("src/guide")];
            // A pattern such as `<id>.md` names no file.
            if start < end && !folders.iter().any(|folder| folder.join(&name).exists()) {
                wrong.push(format!("{}: {name}", path.display()));
            }
        }
        for (at, mark) in text.match_indices("(guide: ") {
            let rest = &text[at + mark.len()..];
            let id = rest.split(')').next().unwrap();
            if !root.join("src/guide").join(format!("{id}.md")).exists() {
                wrong.push(format!("{}: page {id} of the guide", path.display()));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "cited, and not there:\n{}",
        wrong.join("\n")
    );
}

/// Quotes of the troubleshooting page that the program, a library or the system composes.
const COMPOSED: &[&str] = &[
    "must be a number",
    "must be an array",
    "array of length 2",
    "is in mm",
    "in m",
    "Address already in use",
    "in kN/mm?",
    "in t?",
    "in m/s2?",
    "is held by process",
];

/// The text of all sources, with strings that go over several lines joined.
fn program() -> String {
    let texts = sources()
        .into_iter()
        .map(|path| fs::read_to_string(path).unwrap());
    let mut joined = String::new();
    for text in texts {
        let mut parts = text.split("\\\n");
        joined.push_str(parts.next().unwrap());
        parts.for_each(|part| joined.push_str(part.trim_start()));
        joined.push('\n');
    }
    joined
}

#[test]
fn troubleshooting_quotes_program_messages() {
    let program = program();
    let page = include_str!("../src/guide/troubleshooting.md");
    let (mut quoted, mut wrong, mut in_table) = (0, Vec::new(), false);
    for line in page.lines() {
        in_table = line.starts_with("| message contains") || in_table && line.starts_with('|');
        let Some(cell) = line.split('|').nth(1).filter(|_| in_table) else {
            continue;
        };
        for quote in cell.split('`').skip(1).step_by(2) {
            quoted += 1;
            if !COMPOSED.contains(&quote) && !program.contains(quote) {
                wrong.push(quote);
            }
        }
    }
    assert!(quoted > 30, "{quoted} quotes");
    assert!(wrong.is_empty(), "no message contains: {wrong:?}");
}
