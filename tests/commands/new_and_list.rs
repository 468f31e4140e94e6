//! `gusset new`, `list`, `completions`, `man` and `schema`: what a new user meets first.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::common::{FRAME, Said, completed, gusset, say, write};
use gusset_record::{Run, RunFolder};
use serde_json::Value;

/// Runs the binary in `folder`.
fn within(folder: &Path, arguments: &[&str]) -> Said {
    let mut command = gusset();
    command.current_dir(folder).args(arguments);
    command.output().unwrap().into()
}

#[track_caller]
fn done(folder: &Path, arguments: &[&str]) -> Said {
    let said = within(folder, arguments);
    assert_eq!(said.code, Some(0), "{arguments:?}: {}", said.stderr);
    said
}

fn files(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap();
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name();
    entries
        .map(|entry| name(entry).into_string().unwrap())
        .collect()
}

/// The file that the first line of a test file names as its schema is there, and knows every key of the file.
#[track_caller]
fn schema_is_there(folder: &Path, file: &str) {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    let schema = text.lines().next().unwrap();
    let schema = schema.strip_prefix("#:schema ./").unwrap();
    let schema: Value =
        serde_json::from_str(&fs::read_to_string(folder.join(schema)).unwrap()).unwrap();
    assert_eq!(
        schema["$schema"],
        "https://json-schema.org/draft/2020-12/schema"
    );
    let table: toml::Table = text.parse().unwrap();
    for key in table.keys() {
        assert!(schema["properties"].get(key).is_some(), "{file}: {key}");
    }
}

/// A server on a free port; ended with this value.
struct Server {
    child: Child,
    address: String,
}

impl Server {
    fn start(folder: &Path, file: &str) -> Self {
        Self::of(
            gusset().args(["serve", file, "--listen", "127.0.0.1:0"]),
            folder,
        )
    }

    /// A program that prints its address in its first line.
    fn of(command: &mut Command, folder: &Path) -> Self {
        let mut child = command
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        out.read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on ").map(str::to_owned);
        let address = address.unwrap_or_else(|| panic!("{line:?}"));
        Self { child, address }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn each_template_runs_unchanged() {
    for template in [
        "shear-building",
        "actuator",
        "prescribed",
        "benchmark",
        "frame",
        "tuned-mass-damper",
        "isolated-building",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        done(at, &["new", "--template", template]);
        let file = format!("{template}.toml");
        schema_is_there(at, &file);
        let found = done(at, &["check", &file, "--json"]);
        let found: Value = serde_json::from_str(&found.stdout).unwrap();
        assert_ne!(found["verdict"]["outcome"], "refused", "{template}");
        done(
            at,
            &["run", &file, "--clock", "simulated", "--out", "runs/a"],
        );
        let status = &crate::common::json(&at.join("runs/a"), "summary.json")["status"];
        assert_eq!(status, "completed", "{template}");
    }
}

#[test]
fn remote_template_runs_with_its_server() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["new", "lab", "--template", "remote"]);
    assert_eq!(
        files(at).into_iter().collect::<Vec<_>>(),
        [
            "gusset-schema.json",
            "gusset-serve-schema.json",
            "lab-specimen.toml",
            "lab.toml"
        ]
    );
    schema_is_there(at, "lab.toml");
    schema_is_there(at, "lab-specimen.toml");
    done(at, &["check", "lab.toml"]);
    // The port of the template may be taken on this machine.
    let server = Server::start(at, "lab-specimen.toml");
    let address = format!("specimen.0.link.address=\"{}\"", server.address);
    done(
        at,
        &["run", "lab.toml", "--set", &address, "--out", "runs/a"],
    );
}

/// A specimen in Python by a law that the program has, too, gives the same motion.
#[test]
fn python_template_is_its_bilinear_law() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["new", "mine", "--template", "python"]);
    assert_eq!(
        files(at).into_iter().collect::<Vec<_>>(),
        [
            "gusset-schema.json",
            "gusset_specimen.py",
            "mine.py",
            "mine.toml"
        ]
    );
    schema_is_there(at, "mine.toml");
    let server = Server::of(Command::new("python3").arg("mine.py").arg("0"), at);
    let address = format!("specimen.0.link.address=\"{}\"", server.address);
    done(
        at,
        &[
            "run",
            "mine.toml",
            "--set",
            &address,
            "--out",
            "runs/python",
        ],
    );
    let text = fs::read_to_string(at.join("mine.toml")).unwrap();
    let (before, link) = text.split_once("# How the controller reaches").unwrap();
    let (_, law) = link.split_once("[specimen.law.bilinear]").unwrap();
    write(
        at,
        "law.toml",
        &format!("{before}[specimen.law.bilinear]{law}"),
    );
    done(at, &["run", "law.toml", "--out", "runs/law"]);
    let [python, law] = ["runs/python", "runs/law"].map(|run| {
        let run = Run::open(&at.join(run)).unwrap();
        run.columns(&["x1", "x2"]).unwrap()
    });
    for (mine, its) in python.iter().zip(&law) {
        // Rows of the startup come first: a remote specimen has more of them.
        let mine = &mine[mine.len() - its.len()..];
        let peak = its.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        assert!(peak > 0.01, "{peak}");
        for (a, b) in mine.iter().zip(its) {
            // Both sum their forces in another order: 3840 steps of rounding.
            assert!((a - b).abs() <= 1e-9 * peak, "{a} {b}");
        }
    }
}

#[test]
fn opensees_template_is_served() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["new", "--template", "opensees"]);
    schema_is_there(at, "opensees.toml");
    let server = Server::start(at, "opensees.toml");
    assert!(server.address.starts_with("127.0.0.1:"));
    let script = fs::read_to_string(at.join("opensees.py")).unwrap();
    assert!(script.contains("genericClient") && script.contains("gusset serve opensees.toml"));
}

#[test]
fn new_never_overwrites() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "first.AT2", "mine");
    let said = within(at, &["new", "first"]);
    assert_eq!((said.code, said.stdout.as_str()), (Some(2), ""));
    assert!(said.stderr.contains("first.AT2"), "{}", said.stderr);
    assert_eq!(files(at).into_iter().collect::<Vec<_>>(), ["first.AT2"]);
    for wrong in ["a/b", "..", "/tmp/x", "a b"] {
        let said = within(at, &["new", wrong]);
        assert_eq!(said.code, Some(2), "{wrong}");
    }
    assert_eq!(files(at).len(), 1);
    assert_eq!(fs::read_to_string(at.join("first.AT2")).unwrap(), "mine");
}

#[test]
fn second_test_shares_the_first_ones_schema() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["new", "one", "--template", "prescribed"]);
    let said = done(at, &["new", "two", "--template", "prescribed"]);
    assert_eq!(said.stderr, "");
    write(at, "gusset-schema.json", "{}");
    let said = done(at, &["new", "three", "--template", "prescribed"]);
    assert!(
        said.stderr.contains("gusset-schema.json"),
        "{}",
        said.stderr
    );
    let kept = fs::read_to_string(at.join("gusset-schema.json")).unwrap();
    assert_eq!(kept, "{}");
}

#[test]
fn new_lists_every_template() {
    let folder = tempfile::tempdir().unwrap();
    let listed = done(folder.path(), &["new", "--list"]).stdout;
    let names: Vec<&str> = listed
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    let known = [
        "shear-building",
        "actuator",
        "prescribed",
        "benchmark",
        "frame",
        "tuned-mass-damper",
        "isolated-building",
        "remote",
        "bus",
        "python",
        "opensees",
    ];
    assert_eq!(names, known);
    assert!(listed.lines().all(|line| line.chars().count() <= 100));
    assert!(files(folder.path()).is_empty());
}

#[test]
fn list_shows_damaged_and_unfinished_runs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let test = write(at, "frame.toml", FRAME);
    completed(&test, &at.join("runs/first"), &[]);
    completed(&test, &at.join("runs/below/second"), &[]);
    // A killed run has no summary; a damaged one has a summary that is no JSON.
    crate::common::copy(&at.join("runs/first"), &at.join("runs/killed"));
    fs::remove_file(at.join("runs/killed/summary.json")).unwrap();
    crate::common::copy(&at.join("runs/first"), &at.join("runs/damaged"));
    write(&at.join("runs/damaged"), "summary.json", "{");
    fs::create_dir(at.join("runs/other")).unwrap();

    let said = done(at, &["list", "--json"]);
    let listed: Value = serde_json::from_str(&said.stdout).unwrap();
    let runs = listed["runs"].as_array().unwrap();
    let status = |folder: &str| {
        let run = runs.iter().find(|run| run["folder"] == folder).unwrap();
        run["status"].as_str().unwrap().to_owned()
    };
    assert_eq!(runs.len(), 4);
    assert_eq!(runs[0]["folder"], "runs/below/second");
    assert_eq!(status("runs/first"), "completed");
    assert_eq!(status("runs/killed"), "unfinished");
    assert_eq!(status("runs/damaged"), "damaged");
    let second = &runs[0];
    assert_eq!(second["title"], "Frame");
    assert_eq!(second["steps"], 100);
    let peaks = crate::common::json(&at.join("runs/below/second"), "summary.json");
    assert_eq!(
        second["peak"]["displacement_m"],
        peaks["peak"]["displacement"][1]
    );
    assert_eq!(second["peak"]["dof"], 2);

    let text = done(at, &["list"]).stdout;
    assert_eq!(text.lines().count(), 8);
    assert!(text.lines().all(|line| line.chars().count() <= 100));
    assert!(text.starts_with("runs/below/second  Frame\n"));
}

#[test]
fn list_shows_a_run_in_progress_as_running() {
    let folder = tempfile::tempdir().unwrap();
    let run = RunFolder::create(&folder.path().join("runs/now")).unwrap();
    run.claim();
    let listed: Value =
        serde_json::from_str(&done(folder.path(), &["list", "--json"]).stdout).unwrap();
    assert_eq!(listed["runs"][0]["status"], "running");
    assert_eq!(listed["runs"][0]["title"], "now");
    run.release();
}

#[test]
fn empty_output_folder_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write(at, "frame.toml", FRAME);
    for name in ["run", "verify"] {
        fs::create_dir(at.join(name)).unwrap();
    }
    done(at, &["run", "frame.toml", "--out", "run"]);
    done(at, &["verify", "eq-33", "--quick", "--out", "verify"]);
    assert!(files(&at.join("run")).contains("summary.json"));
    assert!(files(&at.join("verify")).contains("index.html"));
    // Now both hold files.
    for arguments in [
        &["run", "frame.toml", "--out", "run"][..],
        &["verify", "eq-33", "--quick", "--out", "verify"],
    ] {
        let said = within(at, arguments);
        assert_eq!(said.code, Some(2));
        assert!(said.stderr.contains("holds "), "{}", said.stderr);
    }
}

#[test]
fn list_without_runs_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let none = done(folder.path(), &["list", "--json"]);
    let none: Value = serde_json::from_str(&none.stdout).unwrap();
    assert_eq!(none["runs"], Value::Array(Vec::new()));
    let said = within(folder.path(), &["list", "nowhere"]);
    assert_eq!(said.code, Some(2));
}

#[test]
fn bash_completions_cover_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let script = say(["completions", "bash"]).stdout;
    let file = write(folder.path(), "gusset.bash", &script);
    let valid = Command::new("bash").arg("-n").arg(&file).output().unwrap();
    assert!(valid.status.success(), "{valid:?}");
    for word in ["new", "list", "--template", "--resume", "shear-building"] {
        assert!(script.contains(word), "{word}");
    }
    assert!(
        say(["completions", "zsh"])
            .stdout
            .starts_with("#compdef gusset")
    );
    assert!(
        say(["completions", "fish"])
            .stdout
            .contains("complete -c gusset")
    );
    assert_eq!(say(["completions", "tcsh"]).code, Some(2));
}

#[test]
fn man_writes_a_page_per_command() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    done(at, &["man", "man1"]);
    let pages = files(&at.join("man1"));
    for command in ["run", "check", "new", "list", "serve", "benchmark-vrths"] {
        assert!(pages.contains(&format!("gusset-{command}.1")), "{command}");
    }
    let page = fs::read_to_string(at.join("man1/gusset-run.1")).unwrap();
    for heading in [
        ".TH gusset-run 1",
        ".SH NAME",
        ".SH SYNOPSIS",
        ".SH OPTIONS",
    ] {
        assert!(page.contains(heading), "{heading}");
    }
    // Pages of an older version are replaced.
    done(at, &["man", "man1"]);
}

#[test]
fn schema_of_a_served_file_has_its_tables() {
    let schema: Value = serde_json::from_str(&say(["schema", "--serve"]).stdout).unwrap();
    assert!(schema["properties"].get("serve").is_some());
    assert!(schema["properties"].get("time").is_none());
    assert_eq!(schema["additionalProperties"], false);
}

#[test]
fn help_is_short_and_fits_into_a_terminal() {
    let overview = say(["--help"]).stdout;
    assert!(overview.contains("Usage: gusset [OPTIONS] <COMMAND>"));
    let commands = overview
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter_map(|line| line.split_whitespace().next());
    let commands: Vec<&str> = commands.filter(|name| *name != "help").collect();
    assert!(commands.len() >= 20, "{commands:?}");
    for command in commands {
        let said = say([command, "--help"]);
        let help = &said.stdout;
        assert!(help.contains(&format!("Usage: gusset {command}")), "{help}");
        let names_guide = help.contains("gusset guide ");
        let needs_none = ["completions", "man", "benchmark"].contains(&command);
        assert!(names_guide || needs_none, "{command}: {help}");
        assert!(help.lines().all(|line| line.chars().count() <= 100));
        // An example that is too long would be wrapped and could not be copied.
        let examples = help.lines().skip_while(|line| !line.starts_with("Example"));
        for line in examples.skip(1).filter_map(|line| line.strip_prefix("  ")) {
            let begins = ["gusset ", "man ", "#:schema "];
            assert!(
                begins.iter().any(|word| line.starts_with(word)),
                "{command}: {line}"
            );
        }
    }
}
