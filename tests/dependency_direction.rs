//! Modules depend on each other in one direction only. This table is the authority: an edge that is not here is a
//! decision to be discussed, not a line to be added in passing.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Module → what it may name. `cli` may name everything.
const ALLOWED: &[(&str, &[&str])] = &[
    ("time", &[]),
    ("units", &[]),
    ("assets", &[]),
    ("law", &[]),
    ("linalg", &[]),
    ("substructure", &["time"]),
    ("geometry", &[]),
    ("specimen", &["geometry", "law", "substructure", "time"]),
    ("transfer", &["law", "specimen"]),
    ("model", &["law", "linalg"]),
    ("metrics", &[]),
    // A record is scaled to a response spectrum, of which there is one.
    ("motion", &["metrics"]),
    ("spectral", &[]),
    ("integrate", &["linalg", "model"]),
    ("benchmark", &["compensation", "metrics", "transfer"]),
    ("identify", &["motion"]),
    ("compensation", &[]),
    (
        "control",
        &["compensation", "geometry", "substructure", "time", "units"],
    ),
    ("record", &["substructure", "text", "units"]),
    ("text", &[]),
    ("wire", &["substructure", "text"]),
    (
        "link",
        &[
            "control",
            "record",
            "rt",
            "specimen",
            "substructure",
            "text",
            "time",
            "wire",
        ],
    ),
    ("rt", &["time"]),
    // Substructures say what the bits of a status column mean.
    (
        "report",
        &["assets", "metrics", "record", "substructure", "text"],
    ),
    // Looks at what passes and sends an operator's requests; decides nothing.
    (
        "monitor",
        &[
            "assets",
            "control",
            "engine",
            "integrate",
            "record",
            "rt",
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
            "report",
            "spectral",
            "time",
        ],
    ),
    (
        "engine",
        &[
            "control",
            "geometry",
            "integrate",
            "linalg",
            "model",
            "motion",
            "record",
            "rt",
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
    (
        "config",
        &[
            "compensation",
            "control",
            "engine",
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
            "substructure",
            "text",
            "time",
            "transfer",
            "units",
            "wire",
        ],
    ),
    // Proofs and verdicts of a test that is built.
    (
        "stability",
        &["config", "record", "spectral", "transfer", "units"],
    ),
    (
        "session",
        &[
            "config",
            "control",
            "engine",
            "metrics",
            "model",
            "motion",
            "record",
            "report",
            "rt",
            "stability",
            "substructure",
            "time",
            // The same counter gives noise and draws.
            "transfer",
        ],
    ),
];

/// Modules that know no system: no files, sockets, threads, clocks or logs.
const PURE: &[&str] = &[
    "law",
    "linalg",
    "metrics",
    "model",
    "motion",
    "spectral",
    "integrate",
    "specimen",
    "transfer",
    "compensation",
    "geometry",
    "benchmark",
    "identify",
    "control",
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
    let first = relative
        .components()
        .next()
        .unwrap()
        .as_os_str()
        .to_str()
        .unwrap();
    first.trim_end_matches(".rs").to_owned()
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
        found.insert(word);
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
            if name != module && !allowed.contains(&name.as_str()) {
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
