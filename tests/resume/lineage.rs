//! A run that continues itself, by a `resumed.json` that was changed, is refused by every command that reads it.

use super::*;
use sha2::{Digest, Sha256};

pub fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Makes the run in `folder` claim that it continued the one in `parent` after no row, with right digests.
fn continues(folder: &Path, parent: &Path) {
    let resolved = std::fs::read(parent.join("resolved.toml")).unwrap();
    let mut origin = common::json(folder, "resumed.json");
    origin["parent"] = parent.to_str().unwrap().into();
    origin["parent_absolute"] = parent.to_str().unwrap().into();
    origin["rows"] = 0.into();
    origin["rows_sha256"] = sha256(b"").into();
    origin["resolved_sha256"] = sha256(&resolved).into();
    std::fs::write(folder.join("resumed.json"), origin.to_string()).unwrap();
}

#[test]
fn a_run_that_continues_itself_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 1.0, 0.0));
    completed(&test, &at("whole"), &[]);
    killed(&at("whole"), &at("first"), 100);
    assert_eq!(go_on(&at("first"), &at("second")).code, Some(0));
    killed(&at("second"), &at("one"), 60);
    copy(&at("one"), &at("other"));
    copy(&at("one"), &at("itself"));
    continues(&at("itself"), &at("itself"));
    continues(&at("one"), &at("other"));
    continues(&at("other"), &at("one"));
    for name in ["itself", "one", "other"] {
        let folder = at(name);
        for command in ["replay", "report"] {
            let said = say([command, folder.to_str().unwrap()]);
            let wanted = if command == "replay" { 2 } else { 1 };
            assert_eq!(said.code, Some(wanted), "{command} {name}: {}", said.stderr);
            let told = said.stderr.contains("no test can be its own ancestor");
            assert!(told, "{command} {name}: {}", said.stderr);
        }
        refused(&folder, "no test can be its own ancestor", &[]);
    }
}
