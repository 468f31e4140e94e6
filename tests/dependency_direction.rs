//! A separate binary: it names nothing of the crate, so `rustc --test` builds it in seconds.
//!
//! Modules depend on each other in one direction only. This table is the authority: an edge that is not here is a
//! decision to be discussed, not a line to be added in passing.

#[path = "dependency/cycles.rs"]
mod cycles;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Module → what it may name. `cli` may name everything.
///
/// Every module may name `catalog`. A folder with a separate line (`view/live`) counts as a module.
const ALLOWED: &[(&str, &[&str])] = &[
    ("catalog", &[]),
    ("time", &[]),
    ("units", &[]),
    ("finding", &[]),
    ("work", &[]),
    ("assets", &[]),
    // The state of a test, of which every part that changes in a test is one.
    ("state", &[]),
    ("law", &["state"]),
    ("linalg", &[]),
    ("substructure", &["state", "time"]),
    ("geometry", &["state"]),
    (
        "specimen",
        &["geometry", "law", "state", "substructure", "time"],
    ),
    ("transfer", &["law", "specimen", "state"]),
    ("model", &["law", "linalg", "state"]),
    ("metrics", &[]),
    // A record is scaled to a response spectrum, of which there is one.
    ("motion", &["metrics"]),
    ("spectral", &[]),
    ("integrate", &["linalg", "model", "state"]),
    (
        "benchmark",
        &["compensation", "metrics", "motion", "transfer"],
    ),
    ("identify", &["motion", "units"]),
    ("compensation", &["state"]),
    // Every proof and verdict.
    (
        "stability",
        &[
            "compensation",
            "finding",
            "integrate",
            "linalg",
            "model",
            "spectral",
            "transfer",
            "units",
        ],
    ),
    (
        "port",
        &[
            "compensation",
            // The levels of the limits.
            "config",
            "geometry",
            // Tables of critical delays.
            "stability",
            "state",
            "substructure",
            "time",
            "units",
        ],
    ),
    // A summary repeats the verdict.
    (
        "record",
        &[
            "stability",
            "state",
            "substructure",
            "text",
            "units",
            "work",
        ],
    ),
    ("text", &[]),
    // Pages and their rendering: they describe the program, and no code of it.
    ("guide", &[]),
    ("wire", &["substructure", "text"]),
    (
        "link",
        &[
            // Fault scripts, and names of protocols and transports.
            "config",
            // Poses that a gateway refuses, and the coordinates in its records.
            "geometry",
            "port",
            "record",
            "rt",
            "specimen",
            "state",
            "substructure",
            "text",
            "time",
            "units",
            "wire",
        ],
    ),
    ("rt", &["time"]),
    // Substructures say what the bits of a status column mean.
    (
        "view",
        &[
            "assets",
            "config",
            "metrics",
            "record",
            "stability",
            "substructure",
            "text",
        ],
    ),
    // Looks at what passes and sends an operator's requests; decides nothing.
    (
        "view/live",
        &[
            "assets",
            "config",
            "port",
            "engine",
            "integrate",
            "record",
            "rt",
            "stability",
            "substructure",
            "text",
        ],
    ),
    (
        "verify",
        &[
            "integrate",
            "law",
            "linalg",
            "model",
            "view",
            "spectral",
            "stability",
            "time",
        ],
    ),
    (
        "engine",
        &[
            "port",
            "geometry",
            "integrate",
            "linalg",
            "model",
            "motion",
            "record",
            "rt",
            "state",
            "substructure",
            "time",
            "units",
        ],
    ),
    (
        "frontier",
        &[
            "engine",
            "integrate",
            "law",
            "linalg",
            "model",
            "motion",
            "verify",
        ],
    ),
    // The schema of a file: it knows no engine, and a view may use it.
    (
        "config",
        &[
            "compensation",
            "finding",
            "geometry",
            "law",
            "model",
            "motion",
            "specimen",
            "text",
            "time",
            "transfer",
            "units",
            "wire",
        ],
    ),
    // From a test file to an experiment.
    (
        "setup",
        &[
            "compensation",
            "config",
            "port",
            "engine",
            "finding",
            "geometry",
            "integrate",
            "law",
            "linalg",
            "link",
            "model",
            "motion",
            "rt",
            "specimen",
            "spectral",
            "stability",
            "substructure",
            "time",
            "transfer",
            "units",
            "wire",
        ],
    ),
    (
        "session",
        &[
            "compensation",
            "config",
            "port",
            "engine",
            "frontier",
            "geometry",
            "identify",
            "integrate",
            "law",
            "metrics",
            "model",
            "motion",
            "record",
            "view",
            "rt",
            "setup",
            "specimen",
            "stability",
            "substructure",
            "time",
            "transfer",
            "work",
            "units",
        ],
    ),
    // Many simulated tests. It uses rehearsals and no part of the loop.
    (
        "campaign",
        &[
            "config", "engine", "model", "motion", "record", "rt", "session", "setup", "units",
            "view", "work",
        ],
    ),
];

/// Modules that know no system: no files, sockets, threads, clocks or logs.
const PURE: &[&str] = &[
    "catalog",
    "law",
    "linalg",
    "metrics",
    "model",
    "motion",
    "spectral",
    "integrate",
    "specimen",
    "transfer",
    "stability",
    "state",
    "finding",
    "compensation",
    "geometry",
    "guide",
    "benchmark",
    "identify",
    "port",
    "substructure",
    "text",
    "wire",
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

fn module_of(path: &Path) -> String {
    let relative = path
        .strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("src"))
        .unwrap();
    let relative = relative.to_str().unwrap();
    let folders = ALLOWED.iter().map(|(module, _)| *module);
    let folder = folders
        .filter(|module| module.contains('/'))
        .find(|module| {
            let rest = relative.strip_prefix(module);
            rest.is_some_and(|rest| rest.starts_with(['/', '.']))
        });
    let first = relative.split('/').next().unwrap();
    folder.unwrap_or(first.trim_end_matches(".rs")).to_owned()
}

/// The file without its tests and without comments: what the program is made of.
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

/// Every module named after `crate::`, in `use` lines (braces included) and in paths.
fn named(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let list = rest.strip_prefix('{').map_or(rest, |inner| inner);
        let word: String = list
            .trim_start()
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect();
        let folders = ALLOWED.iter().map(|(module, _)| *module);
        let folder = folders
            .filter(|module| module.contains('/'))
            .find(|module| {
                let after = rest.strip_prefix(&module.replace('/', "::"));
                after.is_some_and(|after| {
                    !after.starts_with(|c: char| c.is_alphanumeric() || c == '_')
                })
            });
        found.insert(folder.map_or(word, str::to_owned));
        assert!(
            !rest.starts_with('{'),
            "one `use crate::…` a module, please: {}",
            &rest[..40]
        );
    }
    found
}

#[test]
fn modules_depend_only_on_what_the_table_allows() {
    let table: BTreeMap<&str, &[&str]> = ALLOWED.iter().copied().collect();
    let mut wrong = Vec::new();
    for path in sources() {
        let module = module_of(&path);
        if matches!(module.as_str(), "main" | "lib" | "cli") {
            continue;
        }
        let allowed = table.get(module.as_str()).unwrap_or_else(|| {
            panic!("module {module} has no line in the table: decide what it may depend on")
        });
        for name in named(&code_of(&path)) {
            if name != module && name != "catalog" && !allowed.contains(&name.as_str()) {
                wrong.push(format!(
                    "{}: {module} must not depend on {name}",
                    path.display()
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "forbidden edges:\n{}", wrong.join("\n"));
}

#[test]
fn the_table_has_no_cycle() {
    let table: BTreeMap<&str, &[&str]> = ALLOWED.iter().copied().collect();
    fn visit<'a>(
        module: &'a str,
        table: &BTreeMap<&'a str, &'a [&'a str]>,
        path: &mut Vec<&'a str>,
    ) {
        assert!(
            !path.contains(&module),
            "cycle: {} → {module}",
            path.join(" → ")
        );
        path.push(module);
        for next in table.get(module).copied().unwrap_or_default() {
            visit(next, table, path);
        }
        path.pop();
    }
    for (module, _) in ALLOWED {
        visit(module, &table, &mut Vec::new());
    }
}

#[test]
fn pure_modules_do_not_touch_the_system() {
    let mut wrong = Vec::new();
    for path in sources()
        .iter()
        .filter(|p| PURE.contains(&module_of(p).as_str()))
    {
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
fn unsafe_code_stands_in_one_file_only() {
    for path in sources() {
        let code = code_of(&path);
        let unsafe_here = code.contains("unsafe {") || code.contains("unsafe fn");
        assert!(
            !unsafe_here || path.ends_with("src/rt/os.rs"),
            "{}",
            path.display()
        );
    }
}

/// Nothing but the sparse solver, and the eigenvalues of a loop, with which no test computes.
#[test]
fn only_two_files_name_faer() {
    for path in sources() {
        let mut may = ["src/linalg/sparse.rs", "src/spectral/eigen.rs"].into_iter();
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
fn comments_cite_only_documents_of_the_project() {
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
fn troubleshooting_quotes_messages_of_the_program() {
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
