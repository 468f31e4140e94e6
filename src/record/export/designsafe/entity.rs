//! The entity "hybrid simulation" as DesignSafe publishes it, from `[about]` and the record of the run.
//!
//! Its fields are those of the public metadata model of DesignSafe's portal (DesignSafe-CI/portal, `HybridSimulation` with its authors),
//! which refuses unknown ones. The facility is a choice of their form, and the licence is chosen when the data are published:
//! `project.json` has the licence.

use serde_json::{Value, json};

use super::super::Notice;
use super::test::Test;
use crate::run::Run;
use crate::utc;

/// Keys of `[about]` that an archive asks for.
const ASKED: [&str; 5] = ["operator", "laboratory", "specimen", "keywords", "licence"];

/// The keys that an archive asks for, and the run does not have.
pub(super) fn unfiled(run: &Run) -> Option<Notice> {
    let about = run.about().unwrap_or_default();
    let missing: Vec<&str> = ASKED
        .into_iter()
        .filter(|key| about.get(key).is_none())
        .collect();
    (!missing.is_empty()).then(|| Notice::Unfiled(missing.join(", ")))
}

/// The persons that `operator` names, with semicolons between them. A comma follows a family name that comes first.
pub(super) fn authors(about: &Value) -> Vec<Value> {
    let names = about["operator"].as_str().unwrap_or_default();
    let names = names
        .split(';')
        .map(str::trim)
        .filter(|name| !name.is_empty());
    let author = |(order, name): (usize, &str)| {
        let (last, first) = name.split_once(',').unwrap_or_else(|| {
            let (first, last) = name.rsplit_once(' ').unwrap_or(("", name));
            (last, first)
        });
        let (first, last) = (first.trim(), last.trim());
        let name = format!("{first} {last}");
        let mut author = json!({
            "order": order, "name": name.trim(), "fname": first, "lname": last, "guest": true, "authorship": true,
        });
        if let Some(laboratory) = about["laboratory"].as_str() {
            author["inst"] = laboratory.into();
        }
        author
    };
    names.enumerate().map(author).collect()
}

/// The entity.
pub(super) fn entity(test: &Test, run: &Run) -> Value {
    let (about, origin) = (run.about().unwrap_or_default(), run.origin());
    let shakes = test
        .table
        .get("excitation")
        .is_some_and(|table| table.get("ground_acceleration").is_some());
    let kind = if shakes {
        json!({"id": "earthquake", "name": "Earthquake"})
    } else {
        json!({"id": "other", "name": "Other"})
    };
    let began = origin.as_ref().map(|origin| origin.began.as_str());
    let ended = began
        .and_then(utc::instant)
        .zip(run.summary())
        .map(|(ns, summary)| {
            let lasted = (summary.wall_seconds.max(0.0) * 1e9) as u64;
            utc::rfc3339(ns.saturating_add(lasted))
        });
    let list = |value: &Value| match value {
        Value::Array(all) => all.clone(),
        _ => Vec::new(),
    };
    json!({
        "title": test.title,
        "description": about["notes"].as_str().unwrap_or_default(),
        "simulationType": kind,
        "procedureStart": began,
        "procedureEnd": ended,
        "keywords": list(&about["keywords"]),
        "authors": authors(&about),
        "dois": about["doi"].as_str().into_iter().collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operators_become_authors() {
        let found = authors(
            &json!({"operator": "A. B. Muster; Beispiel; Müller, Anna", "laboratory": "Lab"}),
        );
        assert_eq!(found.len(), 3);
        assert_eq!(
            (&found[0]["fname"], &found[0]["lname"], &found[0]["inst"]),
            (&json!("A. B."), &json!("Muster"), &json!("Lab"))
        );
        assert_eq!(
            (&found[1]["fname"], &found[1]["lname"], &found[1]["order"]),
            (&json!(""), &json!("Beispiel"), &json!(1))
        );
        assert_eq!(
            (&found[2]["fname"], &found[2]["lname"], &found[2]["name"]),
            (&json!("Anna"), &json!("Müller"), &json!("Anna Müller"))
        );
        assert!(authors(&Value::Null).is_empty());
    }
}
