//! Where a run comes from: its time, its machine and its program.

use std::path::Path;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::rt::wall::Wall;
use super::summary::Summary;
use super::utc::{local, rfc3339};

/// A build of this program.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Program {
    /// Its version.
    pub version: String,
    /// Commit of its sources, or "unknown".
    pub commit: String,
    /// Its features, with commas between them.
    pub features: String,
    /// The platform for which it was built.
    pub target: String,
    /// The compiler.
    pub compiler: String,
}

/// The program that runs, as its `main` says it.
static PROGRAM: OnceLock<Program> = OnceLock::new();

/// Says which program runs, once.
pub fn introduce(program: Program) {
    let _it_may_be_known = PROGRAM.set(program);
}

/// Where a run comes from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Origin {
    /// UTC at which it began, as RFC 3339.
    pub began: String,
    /// This instant on the clock of the laboratory, with its distance from UTC and its time zone.
    pub began_local: String,
    /// Name of the machine.
    pub host: String,
    /// Its folder, as an absolute path.
    pub folder: String,
    /// The program that made it.
    pub program: Program,
}

impl Origin {
    /// The origin of the run in `folder`, which began then on this machine and is made by this program.
    #[must_use]
    pub fn new(began: Wall, folder: &Path) -> Self {
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let program = PROGRAM.get().cloned();
        Self {
            began: rfc3339(began.0),
            began_local: local(began.0),
            host: rustix::system::uname()
                .nodename()
                .to_string_lossy()
                .into_owned(),
            folder: folder.display().to_string(),
            program: program.unwrap_or_else(|| Program {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                ..Program::default()
            }),
        }
    }
}

/// Who tested what, when, where and by which program: keys and texts, for the head of a report and the metadata of an export. What is
/// not known is left out.
#[must_use]
pub fn filed(summary: &Summary) -> Vec<(&'static str, String)> {
    const SAID: [&str; 8] = [
        "specimen",
        "operator",
        "laboratory",
        "project",
        "notes",
        "keywords",
        "licence",
        "doi",
    ];
    let about = summary.about.as_ref();
    let said = SAID
        .into_iter()
        .filter_map(|key| Some((key, in_words(about?.get(key)?))));
    let mut all: Vec<_> = said.collect();
    if let Some(origin) = &summary.origin {
        let Program {
            version,
            commit,
            features,
            target,
            ..
        } = &origin.program;
        let build = [commit, target, features].map(String::as_str);
        let build: Vec<&str> = build.into_iter().filter(|part| !part.is_empty()).collect();
        let second = origin.began.get(..19).unwrap_or(&origin.began);
        all.extend([
            ("date", format!("{second}Z")),
            ("date_local", origin.began_local.clone()),
            ("host", origin.host.clone()),
            ("run_folder", origin.folder.clone()),
            ("program", format!("Gusset {version}")),
            ("build", build.join(" ")),
        ]);
    }
    all
}

/// A value of `[about]` in one line.
fn in_words(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(all) => all.iter().map(in_words).collect::<Vec<_>>().join(", "),
        Value::Object(table) => {
            let each: Vec<String> = table.values().map(in_words).collect();
            match each.split_first() {
                Some((id, [])) => id.clone(),
                Some((id, more)) => format!("{id} ({})", more.join("; ")),
                None => String::new(),
            }
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn who_and_what_come_first() {
        let summary = Summary::from(json!({
            "about": {
                "operator": "A", "keywords": ["x", "y"],
                "specimen": [{ "id": "B-07", "material": "steel", "state": "virgin" }, { "id": "B-08" }],
            },
            "origin": { "began": "then", "host": "lab", "program": { "version": "1.2.3", "target": "t" } },
        }));
        let told = filed(&summary);
        let of = |name: &str| {
            told.iter()
                .find(|(known, _)| *known == name)
                .map(|(_, text)| text.as_str())
        };
        assert_eq!(
            told[0],
            ("specimen", "B-07 (steel; virgin), B-08".to_owned())
        );
        assert_eq!(of("keywords"), Some("x, y"));
        assert_eq!(of("host"), Some("lab"));
        assert_eq!(of("program"), Some("Gusset 1.2.3"));
        assert_eq!(of("build"), Some("t"));
        assert_eq!(of("laboratory"), None);
        assert!(filed(&Summary::from(json!({}))).is_empty());
    }

    #[test]
    fn origin_is_of_this_machine() {
        let origin = Origin::new(Wall(1_772_366_400_000_000_000), Path::new("runs/a"));
        assert_eq!(origin.began, "2026-03-01T12:00:00.000000000Z");
        assert!(
            origin.began_local.starts_with("2026-03-01")
                || origin.began_local.starts_with("2026-02-28")
        );
        assert!(Path::new(&origin.folder).is_absolute() && !origin.host.is_empty());
    }
}
