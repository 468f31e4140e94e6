//! No import cycle among sibling files of one folder.
//!
//! The test reads the source as text: `use` declarations and paths that begin with `crate`, `self` or `super`. It follows
//! re-exports. A name that a macro makes, or a path through a type, is not seen.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Path of a module: `["link", "tls"]`.
type Module = Vec<String>;

/// Folders with cycles that are still to be mended, each with the reason. This list may only shrink.
const EXEMPT: &[(&str, &str)] = &[];

/// The modules of the program and what each names.
struct Sources {
    code: BTreeMap<Module, String>,
    /// Names that a module imports, with their paths.
    imports: BTreeMap<Module, BTreeMap<String, Module>>,
    /// Members of the workspace in `src/`.
    members: BTreeSet<Module>,
}

impl Sources {
    fn read(root: &Path) -> Self {
        let (mut code, mut members) = (BTreeMap::new(), BTreeSet::new());
        for path in super::sources() {
            let inside = path.strip_prefix(root).unwrap();
            let is_test = inside.components().any(|part| {
                let name = part.as_os_str().to_str().unwrap();
                name == "tests" || name.ends_with("tests.rs")
            });
            let is_root = ["main.rs", "lib.rs"]
                .iter()
                .any(|name| inside == Path::new(name));
            if inside.ends_with("lib.rs") && !is_root {
                members.insert(module_of(inside));
            }
            if !is_test && !is_root {
                code.insert(module_of(inside), without_tests(&path));
            }
        }
        let imports = code.iter().map(|(module, code)| {
            let named = uses(code).into_iter().filter_map(|path| {
                let name = path.iter().rev().find(|part| *part != "self")?.clone();
                Some((name, path))
            });
            (module.clone(), named.collect())
        });
        Self {
            imports: imports.collect(),
            code,
            members,
        }
    }

    /// The root of the member that holds `module`. That of the root package has no folder.
    fn member_of(&self, module: &Module) -> Module {
        let member = module.iter().take(1).cloned().collect();
        if self.members.contains(&member) {
            member
        } else {
            Module::new()
        }
    }

    /// The module that holds what `path` names, seen from `module`.
    fn target(&self, module: &Module, path: &[String], depth: usize) -> Option<Module> {
        let (mut at, mut rest) = match path.first()?.as_str() {
            "crate" => (self.member_of(module), &path[1..]),
            "self" => (module.clone(), &path[1..]),
            "super" => {
                let ups = path.iter().take_while(|part| *part == "super").count();
                let kept = module.len().checked_sub(ups)?;
                (module[..kept].to_vec(), &path[ups..])
            }
            _ => (module.clone(), path),
        };
        let is_relative = !["crate", "self", "super"].contains(&path[0].as_str());
        if is_relative && !self.code.contains_key(&below(&at, &path[0])) {
            return None;
        }
        while let Some(name) = rest.first() {
            let child = below(&at, name);
            if self.code.contains_key(&child) {
                (at, rest) = (child, &rest[1..]);
                continue;
            }
            let import = self.imports.get(&at).and_then(|imports| imports.get(name));
            return match import.filter(|_| depth < 8) {
                Some(import) => {
                    let whole = [import.as_slice(), &rest[1..]].concat();
                    self.target(&at, &whole, depth + 1).or(Some(at))
                }
                None => Some(at),
            };
        }
        Some(at)
    }

    /// Folder → file → siblings that it names.
    fn edges(&self) -> BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> {
        let mut edges: BTreeMap<Module, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
        for (module, code) in &self.code {
            for path in uses(code).into_iter().chain(paths(code)) {
                let Some(target) = self.target(module, &path, 0) else {
                    continue;
                };
                let pairs = module.iter().zip(&target);
                let shared = pairs.take_while(|(a, b)| a == b).count();
                if let (true, Some(from), Some(to)) =
                    (shared > 0, module.get(shared), target.get(shared))
                {
                    let of_folder = edges.entry(module[..shared].to_vec()).or_default();
                    of_folder
                        .entry(from.clone())
                        .or_default()
                        .insert(to.clone());
                }
            }
        }
        edges
    }
}

fn below(module: &Module, name: &str) -> Module {
    let mut child = module.clone();
    child.push(name.to_owned());
    child
}

fn module_of(inside: &Path) -> Module {
    let plain = inside.with_extension("");
    let parts = plain.iter().map(|part| part.to_str().unwrap().to_owned());
    parts
        .filter(|part| !["mod", "lib"].contains(&part.as_str()))
        .collect()
}

/// The code without comments, and without what is only compiled for tests.
fn without_tests(path: &PathBuf) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let lines = text
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    let code = lines.collect::<Vec<_>>().join("\n");
    let mut kept = String::new();
    let mut rest = code.as_str();
    while let Some((before, after)) = rest.split_once("#[cfg(test)]") {
        kept.push_str(before);
        let end = after.find([';', '{']).unwrap_or(after.len());
        if after[end..].starts_with('{') && !after[..end].contains("use ") {
            // A block of tests is the last of its file, or ends with a brace in the first column.
            rest = after.split_once("\n}\n").map_or("", |(_, behind)| behind);
        } else {
            let end = after.find(';').map_or(after.len(), |end| end + 1);
            rest = &after[end..];
        }
    }
    kept + rest
}

/// The paths of the `use` declarations, each written out.
fn uses(code: &str) -> Vec<Module> {
    let mut found = Vec::new();
    let mut rest = code;
    while let Some(at) = rest.find("use ") {
        let begins = rest[..at]
            .chars()
            .next_back()
            .is_none_or(|c| c.is_whitespace());
        let tail = &rest[at + 4..];
        let Some(end) = tail.find(';').filter(|_| begins) else {
            rest = tail;
            continue;
        };
        written_out(&[], &tail[..end], &mut found);
        rest = &tail[end..];
    }
    found
}

/// The paths of a tree of imports below `before`.
fn written_out(before: &[String], tree: &str, found: &mut Vec<Module>) {
    let tree = tree.trim();
    let Some((head, list)) = tree.split_once('{') else {
        let plain = tree.split(" as ").next().unwrap_or_default();
        let parts = plain.split("::").map(|part| part.trim().to_owned());
        let path: Module = before.iter().cloned().chain(parts).collect();
        if !path.last().is_some_and(String::is_empty) {
            found.push(path);
        }
        return;
    };
    let head = head.split("::").map(|part| part.trim().to_owned());
    let head: Module = before
        .iter()
        .cloned()
        .chain(head.filter(|part| !part.is_empty()))
        .collect();
    let list = list.trim_end().strip_suffix('}').unwrap_or(list);
    let (mut depth, mut start) = (0, 0);
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                written_out(&head, &list[start..at], found);
                start = at + 1;
            }
            _ => {}
        }
    }
    written_out(&head, &list[start..], found);
}

/// The paths in expressions and types.
fn paths(code: &str) -> Vec<Module> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let words = code.split(|c: char| !is_part(c));
    let roots = ["crate::", "self::", "super::"];
    words
        .filter(|word| roots.iter().any(|root| word.starts_with(root)))
        .map(|word| {
            let parts = word.split("::").filter(|part| !part.is_empty());
            parts.map(str::to_owned).collect()
        })
        .collect()
}

/// The files that can be reached from each other, in groups of two and more.
fn cycles(edges: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<Vec<String>> {
    let reached = |from: &str| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(file) = open.pop() {
            for next in edges.get(file).into_iter().flatten() {
                if seen.insert(next.as_str()) {
                    open.push(next);
                }
            }
        }
        seen
    };
    let all: BTreeMap<&str, BTreeSet<&str>> = edges
        .keys()
        .map(|file| (file.as_str(), reached(file)))
        .collect();
    let group = |file: &str| -> Vec<String> {
        let back = |other: &&&str| {
            all.get(**other)
                .is_some_and(|reached| reached.contains(file))
        };
        all[file]
            .iter()
            .filter(back)
            .map(|other| (*other).to_owned())
            .collect()
    };
    all.keys()
        .map(|file| group(file))
        .filter(|group| group.len() > 1)
        .collect()
}

#[test]
fn sibling_files_import_in_one_direction() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut wrong, mut mended) = (Vec::new(), BTreeSet::new());
    mended.extend(EXEMPT.iter().map(|(folder, _)| (*folder).to_owned()));
    for (folder, edges) in Sources::read(&root).edges() {
        let folder = folder.join("/");
        for cycle in cycles(&edges) {
            mended.remove(&folder);
            if !EXEMPT.iter().any(|(exempt, _)| *exempt == folder) {
                let one = |file: &String| {
                    let named = edges.get(file).into_iter().flatten();
                    let inside: Vec<&str> = named
                        .filter(|to| cycle.contains(to))
                        .map(String::as_str)
                        .collect();
                    format!("  {file} → {}", inside.join(", "))
                };
                let lines: Vec<String> = cycle.iter().map(one).collect();
                wrong.push(format!("{folder}:\n{}", lines.join("\n")));
            }
        }
    }
    assert!(wrong.is_empty(), "cycles:\n{}", wrong.join("\n"));
    assert!(
        mended.is_empty(),
        "free of cycles, and still exempt: {mended:?}"
    );
}

#[test]
fn a_tree_of_imports_is_written_out() {
    let found = uses("pub use a::{self, b::{C, D as E}, f};\nuse super::g;");
    let found: Vec<String> = found.iter().map(|path| path.join("::")).collect();
    assert_eq!(found, ["a::self", "a::b::C", "a::b::D", "a::f", "super::g"]);
}

#[test]
fn two_files_that_import_each_other_cycle() {
    let all = [("a", "b"), ("b", "c"), ("b", "d"), ("c", "a"), ("e", "d")];
    let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (from, to) in all {
        edges
            .entry(from.to_owned())
            .or_default()
            .insert(to.to_owned());
    }
    let found: Vec<Vec<String>> = cycles(&edges).into_iter().collect();
    assert_eq!(found, [["a", "b", "c"]]);
}
