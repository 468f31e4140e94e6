//! The Python package: a wheel is built, installed in a clean environment and tested there by `tools/python/tests`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Python with maturin and ruff. Without it a test says SKIPPED, and fails where CI=true.
fn python() -> Option<PathBuf> {
    let made = Path::new(ROOT).join("target/maturin-venv/bin/python");
    let python = std::env::var_os("GUSSET_MATURIN_PYTHON").map_or(made, PathBuf::from);
    if python.exists() {
        return Some(python);
    }
    let text = "SKIPPED: maturin is not installed; `tools/test` installs it\n";
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{text}");
    let _ = std::io::stderr().write_all(text.as_bytes());
    None
}

/// Runs a program to its end. A failure shows its output.
fn done(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{command:?}\n{}\n{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn the_python_code_keeps_its_style() {
    let Some(python) = python() else {
        return;
    };
    let ruff = python.parent().unwrap().join("ruff");
    for arguments in [
        ["check", "--no-cache", "."],
        ["format", "--check", "tools/python"],
    ] {
        done(Command::new(&ruff).args(arguments).current_dir(ROOT));
    }
}

#[test]
fn the_wheel_works_in_a_clean_environment() {
    let Some(builder) = python() else {
        return;
    };
    let temp = tempfile::tempdir().unwrap();
    let at = temp.path();
    let tests = Path::new(ROOT).join("tools/python/tests");
    let bin = builder.parent().unwrap();
    // maturin packs the program of these tests. It would compile another one, with other features of the dependencies.
    // It moves the file that it packs, so it gets a copy.
    let program = at.join("program/gusset");
    std::fs::create_dir(at.join("program")).unwrap();
    std::fs::copy(assert_cmd::cargo::cargo_bin!("gusset"), &program).unwrap();
    done(
        Command::new(bin.join("maturin"))
            .args(["build", "--profile", "dev", "--out"])
            .arg(at)
            .current_dir(ROOT)
            .env("CARGO", tests.join("cargo-with-built-program"))
            .env("GUSSET_BINARY", &program),
    );
    let entries = std::fs::read_dir(at).unwrap();
    let names = entries.map(|entry| entry.unwrap().path());
    let wheels: Vec<PathBuf> = names
        .filter(|path| path.extension().is_some_and(|end| end == "whl"))
        .collect();
    assert_eq!(wheels.len(), 1, "{wheels:?}");
    let venv = at.join("venv");
    done(Command::new(&builder).args(["-m", "venv"]).arg(&venv));
    let python = venv.join("bin/python");
    let wheel = format!("{}[test]", wheels[0].display());
    done(Command::new(&python).args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        &wheel,
    ]));
    done(
        Command::new(&python)
            .args(["-m", "pytest", "-q", "-p", "no:cacheprovider"])
            .arg(&tests)
            .current_dir(at)
            .env("GUSSET_WHEEL_TEST", "1")
            .env("GUSSET_MATURIN_PYTHON", &builder)
            .env("GUSSET_STATE", at.join("state"))
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env_remove("GUSSET_BINARY")
            .env_remove("PYTHONPATH"),
    );
}
