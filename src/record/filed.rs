//! Description of a run for a file: who tested what, when, where and by which program.

use serde_json::Value;

use super::origin::{Build, Origin};
use super::run::Run;

/// Who tested what, when, where and by which program: keys and texts, for the head of a report and the metadata of an export. What is
/// not known is left out.
#[must_use]
pub fn filed(run: &Run) -> Vec<(&'static str, String)> {
    pairs(run.about().as_ref(), run.origin().as_ref())
}

/// [`filed`] for `[about]` and an origin.
#[must_use]
pub fn pairs(about: Option<&Value>, origin: Option<&Origin>) -> Vec<(&'static str, String)> {
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
    let said = SAID
        .into_iter()
        .filter_map(|key| Some((key, in_words(about?.get(key)?))));
    let mut all: Vec<_> = said.collect();
    if let Some(origin) = origin {
        let Build {
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
        Value::String(text) => text.lines().map(str::trim).collect::<Vec<_>>().join(" "),
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
    use crate::events::EventLine;
    use crate::folder::tests::recorded;
    use crate::layout::tests::named;
    use serde_json::json;
    use std::io::Write as _;

    #[test]
    fn who_and_what_come_first() {
        let about = json!({
            "operator": "A", "notes": "one\ntwo", "keywords": ["x", "y"],
            "specimen": [{ "id": "B-07", "material": "steel", "state": "virgin" }, { "id": "B-08" }],
        });
        let origin = json!({ "began": "then", "host": "lab", "program": { "version": "1.2.3", "target": "t" } });
        let origin = serde_json::from_value(origin).unwrap();
        let told = pairs(Some(&about), Some(&origin));
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
        assert_eq!(of("notes"), Some("one two"));
        assert_eq!(of("host"), Some("lab"));
        assert_eq!(of("program"), Some("Gusset 1.2.3"));
        assert_eq!(of("build"), Some("t"));
        assert_eq!(of("laboratory"), None);
        assert!(pairs(None, None).is_empty());
    }
    #[test]
    fn killed_run_is_described() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let mut folder = recorded(&path, &["time"], &[]);
        folder
            .keep(b"", "[about]\noperator = \"A\"\n", &[])
            .unwrap();
        let files = folder.files_event(b"", "", &named(&["time"]));
        let line = EventLine::new(files, (None, None), 0, None, &[]).to_map();
        let mut events = folder.open_events().unwrap();
        writeln!(events, "{}", Value::from(line)).unwrap();
        let run = Run::open(&path).unwrap();
        assert!(run.summary().is_none());
        let keys: Vec<&str> = filed(&run).into_iter().map(|(key, _)| key).collect();
        assert_eq!(keys[..3], ["operator", "date", "date_local"]);
    }
}
