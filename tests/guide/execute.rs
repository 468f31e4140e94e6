//! Executes the blocks of a page, one after another, in one temporary folder.

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};

use super::markdown::Block;
use super::pages::root;

/// Longest time of a block. A block that takes longer does not end by itself.
const LONGEST: Duration = Duration::from_secs(120);
/// Lines of output that a failure shows.
const SHOWN: usize = 40;

/// The folder of a page, with the programs that its blocks call.
pub struct Place {
    folder: tempfile::TempDir,
    programs: PathBuf,
}

impl Place {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let programs = folder.path().join(".programs");
        fs::create_dir(&programs).unwrap();
        let gusset = assert_cmd::cargo::cargo_bin!("gusset");
        std::os::unix::fs::symlink(gusset, programs.join("gusset")).unwrap();
        let python = python();
        if let Some(python) = &python {
            let text = format!("#!/bin/sh\nexec '{}' \"$@\"\n", python.display());
            let place = programs.join("python3");
            fs::write(&place, text).unwrap();
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(place, fs::Permissions::from_mode(0o755)).unwrap();
        }
        for name in ["config", "tools"] {
            copy(&root().join(name), &folder.path().join(name));
        }
        Self { folder, programs }
    }

    /// Writes the block's file, or executes the block. The error is the fault in words.
    pub fn take(&self, block: &Block) -> Result<(), String> {
        if let Some(name) = &block.file {
            let path = self.folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, &block.text).map_err(|error| format!("{name}: {error}"))?;
        }
        if block.no_run.is_some() || block.language != "sh" {
            return Ok(());
        }
        if let Some(package) = self.missing_package(block) {
            let text = format!(
                "SKIPPED: line {}: {package} is not installed; `tools/test` installs it\n",
                block.line
            );
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{text}");
            let _ = std::io::Write::write_all(&mut std::io::stderr(), text.as_bytes());
            return Ok(());
        }
        self.bash(&block.text, &format!("block-{}", block.line))
    }

    /// `gusset check` of a file that a block wrote: it is valid. A page may show a test that the check advises against.
    pub fn check(&self, name: &str) -> Result<(), String> {
        let script = format!("gusset check '{name}' || test $? -eq 1");
        self.bash(&script, "check")
    }

    /// The package of Python that the block, or a script that it calls, needs and that is not installed.
    fn missing_package(&self, block: &Block) -> Option<&'static str> {
        let scripts = block
            .text
            .split_whitespace()
            .filter(|word| word.ends_with(".py"));
        let texts: Vec<String> = scripts
            .filter_map(|name| fs::read_to_string(self.folder.path().join(name)).ok())
            .chain([block.text.clone()])
            .collect();
        let any = |is_wanted: &dyn Fn(&str) -> bool| {
            let mut lines = texts.iter().flat_map(|text| text.lines());
            lines.any(|line| is_wanted(line.trim()))
        };
        let is_import = |line: &str| line.starts_with("import ") || line.starts_with("from ");
        let package = if any(&|line| line.starts_with("gusset import matrices")) {
            "scipy"
        } else if any(&|line| line == "import gusset" || is_import(line) && line.contains("numpy"))
        {
            "numpy"
        } else {
            return None;
        };
        let found = self.bash(&format!("python3 -c 'import {package}'"), "package");
        found.is_err().then_some(package)
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "a program that does not end is killed"
    )]
    fn bash(&self, script: &str, name: &str) -> Result<(), String> {
        let log = self.programs.join(format!("{name}.log"));
        let output = fs::File::create(&log).unwrap();
        let path = std::env::var_os("PATH").unwrap_or_default();
        let paths = std::iter::once(self.programs.clone()).chain(std::env::split_paths(&path));
        let mut command = Command::new("bash");
        command
            .args(["-euo", "pipefail", "-c", script])
            .current_dir(self.folder.path())
            .env("PATH", std::env::join_paths(paths).unwrap())
            .env("PAGER", "cat")
            .env("GUSSET_STATE", self.folder.path().join(".state"))
            // As if the Python package were installed.
            .env("PYTHONPATH", self.folder.path().join("tools/python"))
            .env("GUSSET_BINARY", self.programs.join("gusset"))
            .stdin(Stdio::null())
            .stdout(output.try_clone().unwrap())
            .stderr(output)
            .process_group(0);
        let mut child = command.spawn().unwrap();
        let group = Pid::from_child(&child);
        let begun = Instant::now();
        let status = loop {
            match child.try_wait().unwrap() {
                Some(status) => break Some(status),
                None if begun.elapsed() > LONGEST => break None,
                None => std::thread::sleep(Duration::from_millis(20)),
            }
        };
        // Background processes of the block end with it.
        let _gone = kill_process_group(group, Signal::KILL);
        let _reaped = child.wait();
        if status.is_some_and(|status| status.success()) {
            return Ok(());
        }
        let text = fs::read_to_string(&log).unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        let tail = &lines[lines.len().saturating_sub(SHOWN)..];
        Err(format!(
            "{}\n{script}\n--- output\n{}",
            ending(status),
            tail.join("\n")
        ))
    }
}

fn ending(status: Option<ExitStatus>) -> String {
    match status {
        Some(status) => status.to_string(),
        None => format!("not over after {} s", LONGEST.as_secs()),
    }
}

/// Python with NumPy, where the tests of the exports have one.
fn python() -> Option<PathBuf> {
    let made = root().join("target/export-venv/bin/python");
    let python = std::env::var_os("GUSSET_EXPORT_PYTHON").map_or(made, PathBuf::from);
    python.exists().then_some(python)
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            if !path.join("CACHEDIR.TAG").exists() {
                copy(&path, &target);
            }
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}
