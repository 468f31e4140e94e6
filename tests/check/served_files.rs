//! `gusset check` of a file for `gusset serve`: it refuses what the server would refuse, and every option that has no effect.

use std::path::Path;

use serde_json::Value;

use crate::link_common::{finish, gateway, gusset, linked, write};

const KNOWN: &str = "stiffness_n_per_m = 4e5\n";
const ELEMENT: &str = "protocol = \"openfresco\"";
const TITLE: &str = "[safety]";

/// Exit code, stdout and stderr of `gusset check` with these options.
fn check(file: &Path, options: &[&str]) -> (Option<i32>, String, String) {
    let mut command = gusset();
    command.arg("check").arg(file).args(options);
    let output = finish(command);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

fn json(file: &Path, options: &[&str]) -> Value {
    let (code, said, complaint) = check(file, &[options, &["--json"]].concat());
    assert_eq!(code, Some(0), "{complaint}");
    serde_json::from_str(&said).unwrap()
}

#[test]
fn check_refuses_what_the_protocol_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let openfresco =
        |text: &str| text.replace(TITLE, "[serve]\nprotocol = \"openfresco\"\n[safety]");
    for (table, key) in [
        ("axis = [{ unit_disp = \"in\" }]\n", "unit_disp"),
        ("rows = [[0.5, 0.5]]\n", "rows"),
    ] {
        let text = gateway("127.0.0.1:1", &format!("{KNOWN}{table}"), ELEMENT);
        assert!(text.contains(TITLE));
        let file = write(folder.path(), "gateway.toml", &text);
        let (code, _, said) = check(&file, &[]);
        assert_eq!(code, Some(2), "{said}");
        for part in [key, "[serve]"] {
            assert!(said.contains(part), "{part}: {said}");
        }
        let file = write(folder.path(), "openfresco.toml", &openfresco(&text));
        let found = json(&file, &[]);
        let behind = if key == "rows" {
            "limits_behind_rows"
        } else {
            "limits_of_the_client"
        };
        assert_eq!(found[behind].as_array().unwrap().len(), 1, "{found}");
        let (_, page, _) = check(&file, &[]);
        assert_eq!(page.contains("for the client"), key != "rows", "{page}");
    }
}

#[test]
fn check_takes_the_specimen_that_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let law = "law.linear = { stiffness_n_per_m = 1e6 }\n";
    let text = format!("[[specimen]]\nname = \"a\"\n{law}[[specimen]]\nname = \"b\"\n{law}");
    let file = write(folder.path(), "two.toml", &text);
    let (code, _, said) = check(&file, &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("--specimen"), "{said}");
    for name in ["a", "b"] {
        assert_eq!(json(&file, &["--specimen", name])["specimen"], name);
    }
}

#[test]
fn test_options_are_refused_for_served_file() {
    let folder = tempfile::tempdir().unwrap();
    let text = gateway("127.0.0.1:1", KNOWN, "");
    let file = write(folder.path(), "gateway.toml", &text);
    let plots = folder.path().join("plots");
    let plots = plots.to_str().unwrap();
    for options in [
        &["--rehearse"][..],
        &["--rehearse", "--trials", "3"],
        &["--set", "nonsense=1"],
        &["--plot", plots],
    ] {
        let (code, said, complaint) = check(&file, options);
        assert_eq!((code, said.as_str()), (Some(2), ""), "{complaint}");
        assert!(complaint.contains(options[0]), "{complaint}");
    }
    assert!(!Path::new(plots).exists());
    assert_eq!(
        json(&file, &["--no-rehearsal", "--verbose"])["file"],
        "serve"
    );
    // A test is checked with all its specimens.
    let test = write(folder.path(), "test.toml", &linked(10, "127.0.0.1:1", ""));
    let (code, _, complaint) = check(&test, &["--specimen", "column"]);
    assert_eq!(code, Some(2), "{complaint}");
    assert!(complaint.contains("--specimen"), "{complaint}");
}
