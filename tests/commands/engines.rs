//! `gusset campaign submit`: the files of every engine, and what is refused.
//!
//! Here the launchers are small scripts. The real ones are in `slurm` and `hyperqueue`. These modules belong to the commands and
//! not to `tests/opensees`, because they compare tables of `gusset campaign` with the helpers of `campaign`.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use crate::campaign::{TASKS, campaign, complete, planned, study, undisturbed};
use crate::common::{Said, gusset, say};

/// A planned campaign with 5 chunks in a folder whose name needs quotes.
fn planned_in_an_odd_folder() -> (TempDir, PathBuf) {
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().join("it's 100% \"odd\"");
    fs::create_dir(&folder).unwrap();
    let study = study(&folder);
    let out = folder.join("campaign");
    let out_text = out.to_str().unwrap();
    let said = campaign(
        "plan",
        &study,
        &["--out", out_text, "--tasks-per-chunk", "5"],
    );
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    (temp, out)
}

/// Scripts in place of the programs of a launcher. Each writes its arguments into a file with its name.
struct Launcher(TempDir);

impl Launcher {
    /// `programs` are names with the further lines of their scripts.
    fn new(programs: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, lines) in programs {
            let path = folder.path().join(name);
            let text = format!("#!/bin/sh\nprintf '%s\\n' \"$@\" > \"$0.arguments\"\n{lines}\n");
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        }
        Self(folder)
    }

    /// `gusset campaign submit` with these programs on the path and no others.
    fn submit(&self, out: &Path, more: &[&str]) -> Said {
        let mut command = gusset();
        command.args(["campaign", "submit"]).arg(out).args(more);
        command.env("PATH", self.0.path()).output().unwrap().into()
    }

    /// Arguments of the last call of a program.
    fn arguments(&self, program: &str) -> Vec<String> {
        let path = self.0.path().join(format!("{program}.arguments"));
        let text = fs::read_to_string(path).unwrap();
        text.lines().map(str::to_owned).collect()
    }
}

/// Runs a text as a script of a shell in another folder, without a path.
fn shell(text: &str, element: Option<usize>) -> Option<i32> {
    let mut command = Command::new("/bin/sh");
    command.args(["-c", text]).current_dir("/");
    if let Some(element) = element {
        command.env("SLURM_ARRAY_TASK_ID", element.to_string());
    }
    command.output().unwrap().status.code()
}

/// The chunks of each line of a file of commands.
fn chunks_of_lines(path: &Path) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap();
    let words = text.lines().map(|line| line.rsplit(' ').next().unwrap());
    words.map(str::to_owned).collect()
}

#[test]
fn each_line_alone_computes_its_open_chunks() {
    let (_folder, out) = planned_in_an_odd_folder();
    let lines = out.join("lines.txt");
    let submit = |more: &[&str]| {
        let mut arguments = vec!["--engine", "lines"];
        arguments.extend(more);
        let said = campaign("submit", &out, &arguments);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        said
    };
    let said = submit(&[]);
    assert_eq!(Path::new(said.stdout.trim()), lines);
    assert_eq!(chunks_of_lines(&lines), ["1", "2", "3", "4", "5"]);
    let text = fs::read_to_string(&lines).unwrap();
    assert_eq!(shell(text.lines().nth(1).unwrap(), None), Some(0));
    submit(&[]);
    assert_eq!(chunks_of_lines(&lines), ["1", "3", "4", "5"]);
    // Seven tasks are two chunks of five.
    submit(&["--tasks-per-job", "7"]);
    assert_eq!(chunks_of_lines(&lines), ["1,3", "4-5"]);
    for line in fs::read_to_string(&lines).unwrap().lines() {
        assert_eq!(shell(line, None), Some(0), "{line}");
    }
    // Nothing is open now, and no old list stays.
    submit(&[]);
    assert!(!lines.exists());
    assert!(complete(&campaign("collect", &out, &[]), &out) == undisturbed());
}

/// The script without Slurm: a shell runs each array element alone.
#[test]
fn array_element_alone_computes_its_chunks() {
    let (_folder, out) = planned_in_an_odd_folder();
    let done = campaign("work", &out, &["--chunk", "2"]);
    assert_eq!(done.code, Some(0), "{}", done.stderr);
    let launcher = Launcher::new(&[
        ("sbatch", "echo Submitted batch job 7"),
        ("scontrol", "echo 'MaxArraySize            = 4'"),
    ]);
    let slurm = |more: &[&str]| {
        let mut arguments = vec!["--engine", "slurm"];
        arguments.extend(more);
        launcher.submit(&out, &arguments)
    };
    let said = slurm(&["--", "--partition=debug", "--time=1"]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stderr.contains("batch job 7"), "{}", said.stderr);
    let script = out.join("slurm.sh");
    let expected = ["--partition=debug", "--time=1", script.to_str().unwrap()];
    assert_eq!(launcher.arguments("sbatch"), expected);
    // Four open chunks, and at most three elements.
    let text = fs::read_to_string(&script).unwrap();
    assert!(text.contains("\n#SBATCH --array=1-2\n"), "{text}");
    for element in 1..=2 {
        assert_eq!(shell(&text, Some(element)), Some(0));
    }
    assert_ne!(shell(&text, None), Some(0));
    assert!(complete(&campaign("collect", &out, &[]), &out) == undisturbed());
    // A second submission has nothing to submit.
    fs::remove_file(launcher.0.path().join("sbatch.arguments")).unwrap();
    let said = slurm(&[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(!launcher.0.path().join("sbatch.arguments").exists() && !script.exists());
}

#[test]
fn hyperqueue_receives_the_job_file() {
    let (_folder, out) = planned_in_an_odd_folder();
    let launcher = Launcher::new(&[("hq", "echo Job submitted successfully, job ID: 3")]);
    let said = launcher.submit(&out, &["--engine", "hyperqueue", "--", "--server-dir=/s"]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stderr.contains("job ID: 3"), "{}", said.stderr);
    let file = out.join("hyperqueue.toml");
    let expected = [
        "job",
        "submit-file",
        "--server-dir=/s",
        file.to_str().unwrap(),
    ];
    assert_eq!(launcher.arguments("hq"), expected);
    let text = fs::read_to_string(&file).unwrap();
    let table: toml::Table = text.parse().unwrap();
    assert_eq!(table["task"].as_array().unwrap().len(), 5);
}

#[test]
fn failing_launcher_exits_with_code_2() {
    let (_folder, out) = planned();
    for (engine, program, file) in [
        ("slurm", "sbatch", "slurm.sh"),
        ("hyperqueue", "hq", "hyperqueue.toml"),
    ] {
        let none = Launcher::new(&[]);
        let said = none.submit(&out, &["--engine", engine]);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        for word in [program, file] {
            assert!(said.stderr.contains(word), "{}", said.stderr);
        }
        assert!(out.join(file).exists());
        let failing = Launcher::new(&[(program, "echo no such queue >&2; exit 3")]);
        let said = failing.submit(&out, &["--engine", engine]);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(said.stderr.contains("no such queue"), "{}", said.stderr);
    }
}

#[test]
fn senseless_arguments_are_refused() {
    let (_folder, out) = planned();
    let launcher = Launcher::new(&[("scontrol", "echo 'MaxArraySize = 3'"), ("sbatch", "")]);
    let more = (TASKS + 1).to_string();
    for (arguments, word) in [
        (
            vec!["--engine", "lines", "--tasks-per-job", "0"],
            "--tasks-per-job",
        ),
        (
            vec!["--engine", "lines", "--tasks-per-job", &more],
            "1 to 24",
        ),
        // Five chunks of five tasks, and at most two elements: three chunks each.
        (
            vec!["--engine", "slurm", "--tasks-per-job", "10"],
            "--tasks-per-job 11",
        ),
        (vec!["--engine", "lines", "--", "--time=1"], "lines"),
        (vec!["--engine", "pbs"], "pbs"),
    ] {
        let said = launcher.submit(&out, &arguments);
        assert_eq!(said.code, Some(2), "{arguments:?}: {}", said.stderr);
        assert!(said.stderr.contains(word), "{arguments:?}: {}", said.stderr);
    }
    let all = launcher.submit(&out, &["--engine", "slurm", "--tasks-per-job", "11"]);
    assert_eq!(all.code, Some(0), "{}", all.stderr);
    let said = say(["campaign", "submit", "/nowhere", "--engine", "lines"]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
}
