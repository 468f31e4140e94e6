//! `gusset import`: the importer in Python gets the options and ends for the command. A shell script takes the place of Python.

use std::path::Path;

use crate::common::{Said, gusset};
use serde_json::{Value, json};

const STAND_IN: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/tests/commands/stand-in-python"
);

fn import(python: impl AsRef<Path>, error: &str, arguments: &[&str]) -> Said {
    let mut command = gusset();
    command.arg("import").args(arguments);
    command
        .env("GUSSET_PYTHON", python.as_ref())
        .env("STAND_IN_ERROR", error);
    Said::from(command.output().unwrap())
}

#[track_caller]
fn options(arguments: &[&str]) -> Value {
    let said = import(STAND_IN, "", arguments);
    assert_eq!(said.code, Some(7), "{}", said.stderr);
    assert_eq!(said.stderr, "-m gusset.importer\n");
    serde_json::from_str(&said.stdout).unwrap()
}

#[test]
fn importer_gets_all_options() {
    let few = options(&["opensees", "frame.py", "--units", "kN,m,s"]);
    let expected = json!({
        "source": "opensees", "model": "frame.py", "units": "kN,m,s", "out": "model.toml", "list": false, "replace": [],
        "accept_damping": false, "timeout_s": 300,
    });
    assert_eq!(few, expected);
    let all = options(&[
        "opensees",
        "a.tcl",
        "--units",
        "kip,in,s",
        "--out",
        "b.toml",
        "--list",
        "--replace",
        "1=a",
        "--replace",
        "2=b",
        "--accept-damping",
        "--timeout",
        "9",
    ]);
    let expected = json!({
        "source": "opensees", "model": "a.tcl", "units": "kip,in,s", "out": "b.toml", "list": true, "replace": ["1=a", "2=b"],
        "accept_damping": true, "timeout_s": 9,
    });
    assert_eq!(all, expected);
    let matrices = options(&[
        "matrices", "a.mtx", "b.mtx", "--units", "N,mm,s", "--mass", "a.mtx",
    ]);
    let expected = json!({
        "source": "matrices", "files": ["a.mtx", "b.mtx"], "units": "N,mm,s", "mass": "a.mtx", "stiffness": null, "damping": null,
        "dofs": null, "direction": "x", "out": "model",
    });
    assert_eq!(matrices, expected);
}

const ARGUMENTS: [&str; 4] = ["matrices", "a.mat", "--units", "N,m,s"];

#[test]
fn missing_importer_says_what_to_install() {
    let missing = "ModuleNotFoundError: No module named 'numpy'";
    let said = import(STAND_IN, missing, &ARGUMENTS);
    assert_eq!(said.code, Some(2));
    for word in [missing, "pip install .", "GUSSET_PYTHON"] {
        assert!(said.stderr.contains(word), "{}", said.stderr);
    }
    assert!(!said.stderr.contains("Traceback"), "{}", said.stderr);
}

#[test]
fn missing_python_is_refused() {
    let said = import("/nowhere/python", "", &ARGUMENTS);
    assert_eq!(said.code, Some(2));
    assert!(
        said.stderr.contains("/nowhere/python") && said.stderr.contains("GUSSET_PYTHON"),
        "{}",
        said.stderr
    );
}
