//! `gusset campaign`: workers and interruptions do not change the table, and wrong input is
//! refused before anything is computed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{FRAME, Said, gusset, physics, say};

const RECORD: &str = "time,accel\n0,0\n0.1,1\n0.2,-1\n0.3,0.5\n0.4,0\n";

/// A study of 2 values × 2 records × 3 intensities × 2 draws, and its folder.
pub fn study(folder: &Path) -> PathBuf {
    fs::write(folder.join("frame.toml"), FRAME).unwrap();
    let records = folder.join("records");
    fs::create_dir(&records).unwrap();
    fs::write(records.join("a.csv"), RECORD).unwrap();
    fs::write(records.join("b.csv"), RECORD.replace("-1", "-0.8")).unwrap();
    let path = folder.join("study.toml");
    let text = r#"
test = "frame.toml"
[campaign]
replicates = 2
[[vary]]
key = "structure.damping.rayleigh_ratio.ratio"
values = [0.02, 0.05]
[[sample]]
key = "specimen.0.law.bouc_wen.yield_force_n"
std_share = 0.1
[[records]]
folder = "records"
record_unit = "m/s2"
values = [0.5, 1.0, 2.0]
unit = "m/s2"
[measure]
residual = true
energy = true
tracking = true
collapse = { measure = "max_drift", above = 0.006 }
"#;
    fs::write(&path, text).unwrap();
    path
}

pub const TASKS: u64 = 24;

/// A planned campaign with 5 chunks.
pub fn planned() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("campaign");
    plan(&study(folder.path()), &out, "5");
    (folder, out)
}

/// Plans the study into `out`.
#[track_caller]
pub fn plan(study: &Path, out: &Path, tasks_per_chunk: &str) {
    let out = out.to_str().unwrap();
    let more = ["--out", out, "--tasks-per-chunk", tasks_per_chunk];
    let said = campaign("plan", study, &more);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
}

pub fn campaign(command: &str, folder: &Path, more: &[&str]) -> Said {
    let mut arguments = vec!["campaign", command, folder.to_str().unwrap()];
    arguments.extend(more);
    say(arguments)
}

/// The table of a complete campaign.
#[track_caller]
pub fn complete(said: &Said, out: &Path) -> Vec<u8> {
    assert_eq!(said.code, Some(0), "{}\n{}", said.stdout, said.stderr);
    fs::read(out.join("table.csv")).unwrap()
}

pub fn parts(out: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(out.join("parts"));
    let mut found: Vec<PathBuf> = entries
        .into_iter()
        .flatten()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "part"))
        .collect();
    found.sort();
    found
}

/// The table of an undisturbed run with one job.
pub fn undisturbed() -> Vec<u8> {
    let (_folder, out) = planned();
    complete(&campaign("run", &out, &["--jobs", "1"]), &out)
}

#[test]
fn every_command_shows_an_example() {
    for command in ["plan", "run", "submit", "work", "collect", "status"] {
        let help = say(["campaign", command, "--help"]);
        assert_eq!(help.code, Some(0));
        let example = format!("gusset campaign {command} ");
        let (_, examples) = help.stdout.split_once("Example").unwrap();
        assert!(examples.contains(&example), "{}", help.stdout);
    }
}

#[test]
fn campaign_gives_one_row_for_each_task() {
    let (_folder, out) = planned();
    let plan = fs::read_to_string(out.join("plan.json")).unwrap();
    let plan: Value = serde_json::from_str(&plan).unwrap();
    assert_eq!(
        (&plan["tasks"], &plan["tasks_per_chunk"]),
        (&TASKS.into(), &5.into())
    );
    for chunk in 1..=5 {
        let said = campaign("work", &out, &["--chunk", &chunk.to_string()]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
    }
    let status = campaign("status", &out, &["--json"]);
    let status_json: Value = serde_json::from_str(&status.stdout).unwrap();
    assert_eq!(
        (status.code, &status_json["done"]),
        (Some(0), &TASKS.into())
    );
    let said = campaign("collect", &out, &["--json", "--prove", "100%"]);
    let table = String::from_utf8(complete(&said, &out)).unwrap();
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(rows.len() as u64, TASKS + 1);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    let column = |name: &str| rows[0].iter().position(|cell| *cell == name).unwrap();
    // Every combination of value, record, intensity and draw occurs once.
    let keys = [
        "structure.damping.rayleigh_ratio.ratio",
        "record",
        "intensity",
        "replicate",
    ];
    let mut seen: Vec<Vec<&str>> = rows[1..]
        .iter()
        .map(|row| keys.iter().map(|key| row[column(key)]).collect())
        .collect();
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(seen.len() as u64, TASKS);
    assert!(rows[1..].iter().all(|row| row[column("ended")] == "done"));
    // The scaled record moves the frame more at each level.
    let drift = |row: usize| rows[row][column("max_drift")].parse::<f64>().unwrap();
    assert!(drift(1) < drift(3) && drift(3) < drift(5));
    let summary: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(summary["complete"], true);
    let proved = &summary["provenance"]["tasks_computed_again_with_equal_bits"];
    assert_eq!(proved.as_u64(), Some(TASKS));
    // The named largest value is that of its row and the largest of the column.
    let largest = &summary["largest"][0];
    let place = column(largest["measure"].as_str().unwrap());
    let first = &largest["tasks"][0];
    let value = |row: usize| rows[row][place].parse::<f64>().unwrap();
    let most = (1..rows.len()).map(value).fold(0.0, f64::max);
    let task = first["task"].as_u64().unwrap() as usize;
    assert_eq!((first["value"].as_f64(), value(task)), (Some(most), most));
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    for text in [
        "IDA curves",
        "84 % fractile",
        "Fragility",
        "Exceedance",
        "Provenance",
    ] {
        assert!(report.contains(text), "{text}");
    }
}

#[test]
fn two_jobs_give_the_same_table_as_one() {
    let (_folder, out) = planned();
    let two = complete(&campaign("run", &out, &["--jobs", "2"]), &out);
    assert!(two == undisturbed());
}

/// A peak of the table is the peak of the same test under `gusset run`.
#[test]
fn a_task_has_the_numbers_of_gusset_run() {
    let (folder, out) = planned();
    let text = "test = \"frame.toml\"\n[[vary]]\nkey = \"time.duration_s\"\nvalues = [0.4]\n";
    let study = folder.path().join("one.toml");
    fs::write(&study, text).unwrap();
    let one = out.with_file_name("one");
    let said = campaign("run", &study, &["--out", one.to_str().unwrap()]);
    let table = String::from_utf8(complete(&said, &one)).unwrap();
    let run = folder.path().join("run");
    let frame = folder.path().join("frame.toml");
    let said = say([
        "run",
        frame.to_str().unwrap(),
        "--set",
        "time.duration_s=0.4",
        "--out",
        run.to_str().unwrap(),
    ]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    let place = rows[0].iter().position(|cell| *cell == "peak_x2").unwrap();
    let found: f64 = rows[1][place].parse().unwrap();
    let columns = physics(&run);
    let column = |name: &str| &columns.iter().find(|(other, _)| other == name).unwrap().1;
    let running = column("state")
        .iter()
        .map(|state| f64::from_bits(*state) == 3.0);
    let disps = column("x2").iter().map(|disp| f64::from_bits(*disp).abs());
    let peak = disps.zip(running).filter(|(_, running)| *running);
    let peak = peak.map(|(disp, _)| disp).fold(0.0, f64::max);
    assert_eq!(found.to_bits(), peak.to_bits());
}

#[test]
fn killed_run_continues_to_the_same_table() {
    let (_folder, out) = planned();
    let mut run = gusset();
    run.args(["campaign", "run", out.to_str().unwrap(), "--jobs", "1"]);
    let mut run = run
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while parts(&out).is_empty() && run.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    // SIGKILL: the worker cannot clean up. It may also have finished already.
    run.kill().unwrap();
    run.wait().unwrap();
    let before = parts(&out).len();
    assert!(before >= 1);
    let said = campaign("run", &out, &[]);
    assert!(complete(&said, &out) == undisturbed());
    assert!(
        !said.stderr.contains("24 tests computed"),
        "{}",
        said.stderr
    );
}

#[test]
fn chunk_that_runs_twice_is_counted_once() {
    let (_folder, out) = planned();
    let spawn = |chunk: &str| {
        let mut work = gusset();
        work.args(["campaign", "work", out.to_str().unwrap(), "--chunk", chunk]);
        work.stderr(Stdio::null()).spawn().unwrap()
    };
    for chunk in ["1", "2"] {
        let mut both = [spawn(chunk), spawn(chunk)];
        assert!(both.iter_mut().all(|one| one.wait().unwrap().success()));
    }
    let said = campaign("run", &out, &[]);
    assert!(complete(&said, &out) == undisturbed());
}

#[test]
fn cut_part_is_computed_again() {
    let (_folder, out) = planned();
    complete(&campaign("run", &out, &[]), &out);
    let part = &parts(&out)[0];
    let bytes = fs::read(part).unwrap();
    fs::write(part, &bytes[..bytes.len() / 2]).unwrap();
    let said = campaign("collect", &out, &["--json"]);
    assert_eq!(said.code, Some(1));
    let summary: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(
        (&summary["complete"], &summary["missing"]),
        (&false.into(), &5.into())
    );
    assert_eq!(summary["table"], "table.partial.csv");
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!out.join("table.csv").exists() && report.contains("PARTIAL"));
    assert!(complete(&campaign("run", &out, &[]), &out) == undisturbed());
    assert!(!out.join("table.partial.csv").exists());
}

/// A part with a valid digest whose numbers were changed: a chosen task that is computed again shows it.
#[test]
fn a_result_with_other_bits_is_refused() {
    let (_folder, out) = planned();
    complete(&campaign("run", &out, &[]), &out);
    let part = &parts(&out)[0];
    let text = fs::read_to_string(part).unwrap();
    let forged = with_other_bits(&text);
    // Alone, only a proof finds it.
    fs::write(part, &forged).unwrap();
    let said = campaign("collect", &out, &["--prove", "100%"]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    // The wrong part does not count any more.
    assert!(!part.exists() && part.with_extension("refuted").exists());
    assert!(complete(&campaign("run", &out, &[]), &out) == undisturbed());
    // Beside the true part, the merge finds it.
    fs::write(part, &text).unwrap();
    fs::write(part.with_file_name("chunk-000001-other.part"), &forged).unwrap();
    let said = campaign("collect", &out, &["--prove", "0"]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
}

/// The choice of the proven tasks is in no file before the collection, and a given seed repeats it.
#[test]
fn each_collection_draws_its_own_proof() {
    let (_folder, out) = planned();
    let table = complete(&campaign("run", &out, &[]), &out);
    let collected = |more: &[&str]| {
        let said = campaign("collect", &out, &[&["--json"], more].concat());
        assert!(complete(&said, &out) == table);
        let summary: Value = serde_json::from_str(&said.stdout).unwrap();
        summary["provenance"]["prove_seed"].as_u64().unwrap()
    };
    let one = ["--prove", "1"];
    assert_ne!(collected(&one), collected(&one));
    assert_eq!(collected(&["--prove", "1", "--prove-seed", "7"]), 7);
    // A changed row is found by some choices of half of the tasks, and not by others.
    let part = &parts(&out)[0];
    let text = fs::read_to_string(part).unwrap();
    let forged = with_other_bits(&text);
    let mut found = 0;
    for seed in 0..12 {
        fs::write(part, &forged).unwrap();
        let seed = seed.to_string();
        let said = campaign("collect", &out, &["--prove", "12", "--prove-seed", &seed]);
        assert!(matches!(said.code, Some(0 | 1)), "{}", said.stderr);
        found += u32::from(said.code == Some(1));
    }
    assert!((1..12).contains(&found), "{found} of 12");
}

/// A part with a valid digest and other bits in its first row.
fn with_other_bits(text: &str) -> String {
    let (body, _) = text.trim_end().rsplit_once('\n').unwrap();
    let mut lines: Vec<String> = body.lines().map(str::to_owned).collect();
    let last = lines[1].pop().unwrap();
    lines[1].push(if last == '0' { '1' } else { '0' });
    let body = lines.join("\n") + "\n";
    let digest = blake3::hash(body.as_bytes()).to_hex();
    format!("{body}end\t{digest}\n")
}

#[test]
fn changed_files_or_program_are_refused() {
    for file in ["frame.toml", "records/b.csv", "study.toml"] {
        let (folder, out) = planned();
        let path = folder.path().join(file);
        let text = fs::read_to_string(&path).unwrap();
        let changed = match file {
            "records/b.csv" => text.replace("0.5", "0.6"),
            _ => format!("# changed\n{text}"),
        };
        fs::write(&path, changed).unwrap();
        for command in ["work", "collect", "run"] {
            let more: &[&str] = if command == "work" {
                &["--chunk", "1"]
            } else {
                &[]
            };
            let said = campaign(command, &out, more);
            assert_eq!(said.code, Some(2), "{file}, {command}: {}", said.stderr);
            let name = file.rsplit('/').next().unwrap();
            assert!(said.stderr.contains(name), "{file}: {}", said.stderr);
        }
        assert!(parts(&out).is_empty());
    }
    let (_folder, out) = planned();
    let plan = out.join("plan.json");
    let text = fs::read_to_string(&plan).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    let digest = value["program"]["results"].as_str().unwrap();
    let other = "0".repeat(digest.len());
    for changed in [
        text.replace(digest, &other),
        text.replace("\"format\": 2", "\"format\": 99"),
    ] {
        assert_ne!(changed, text);
        fs::write(&plan, changed).unwrap();
        let said = campaign("work", &out, &["--chunk", "1"]);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(said.stderr.contains("plan"), "{}", said.stderr);
    }
}

#[test]
fn bad_studies_are_refused_with_the_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = study(folder.path());
    let good = fs::read_to_string(&path).unwrap();
    fs::create_dir(folder.path().join("empty")).unwrap();
    for (old, new, words) in [
        ("values = [0.02, 0.05]", "valeus = [0.02, 0.05]", "valeus"),
        ("values = [0.02, 0.05]", "values = []", "`values`"),
        (
            "values = [0.02, 0.05]",
            "linear = { from = 1, to = 2, count = 0 }",
            "count",
        ),
        (
            "values = [0.02, 0.05]",
            "log = { from = 0, to = 2, count = 3 }",
            "log",
        ),
        ("values = [0.02, 0.05]", "", "`linear`"),
        ("rayleigh_ratio.ratio", "rayleigh_ratio.ration", "ration"),
        ("folder = \"records\"", "folder = \"empty\"", "no records"),
        ("folder = \"records\"", "folder = \"missing\"", "missing"),
        ("std_share = 0.1", "range = [2, 1]", "range"),
        (
            "bouc_wen.yield_force_n",
            "bouc_wen.yeild_force_n",
            "yeild_force_n",
        ),
        (
            "measure = \"max_drift\"",
            "measure = \"max_draft\"",
            "max_draft",
        ),
        ("replicates = 2", "replicates = 0", "replicates"),
        // Counts that no memory has room for, with the most that is allowed.
        (
            "values = [0.02, 0.05]",
            "linear = { from = 1, to = 2, count = 1000000000000000 }",
            "1 to 100000",
        ),
        (
            "values = [0.5, 1.0, 2.0]",
            "log = { from = 1, to = 2, count = 1000000000000000 }",
            "1 to 100000",
        ),
        (
            "folder = \"records\"",
            "synthetic = { count = 1000000000000000 }",
            "1 to 100000",
        ),
        (
            "replicates = 2",
            "replicates = 1000000000000000",
            "100000000 tasks",
        ),
        (
            "[campaign]\n",
            "[campaign]\nsampling = \"sobol\"\nreplicates = 1000000000000000\n#",
            "65536",
        ),
        (
            "values = [0.02, 0.05]",
            "linear = { from = 0.01, to = 0.02, count = 100000 }\n[[vary]]\nkey = \"integrator.lambda\"\n\
             linear = { from = 2, to = 4, count = 100000 }",
            "100000000 tasks",
        ),
        ("unit = \"m/s2\"\n[measure]", "[measure]", "unit"),
    ] {
        assert!(good.contains(old), "{old}");
        fs::write(&path, good.replace(old, new)).unwrap();
        let out = folder.path().join("out");
        let said = campaign("plan", &path, &["--out", out.to_str().unwrap()]);
        assert_eq!(said.code, Some(2), "{new}: {}", said.stderr);
        assert!(said.stderr.contains(words), "{new}: {}", said.stderr);
        assert!(!said.stderr.contains("panicked") && !out.exists(), "{new}");
    }
}

#[test]
fn wrong_folders_and_chunks_are_refused() {
    let (folder, out) = planned();
    let there = out.to_str().unwrap();
    let path = folder.path().join("study.toml");
    let said = campaign("plan", &path, &["--out", there]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    for chunk in ["0", "6", "0-2", "4-6", "1,9"] {
        let said = campaign("work", &out, &["--chunk", chunk]);
        assert_eq!(said.code, Some(2));
        assert!(said.stderr.contains("1 to 5"), "{}", said.stderr);
    }
    for chunk in ["", "one", "3-1", "1-"] {
        let said = campaign("work", &out, &["--chunk", chunk]);
        assert_eq!(said.code, Some(2), "{}", said.stderr);
    }
    assert!(parts(&out).is_empty());
    for command in ["collect", "status", "run"] {
        let said = campaign(command, folder.path(), &[]);
        assert_eq!(said.code, Some(2));
        assert!(said.stderr.contains("plan.json"), "{}", said.stderr);
    }
    let said = campaign("collect", &out, &["--prove", "many"]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
}

/// Paths of a plan do not depend on the current folder.
#[test]
fn studies_of_the_repository_can_be_planned() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ida");
    let study = Path::new("config/campaigns/ida-frame.toml");
    let said = campaign("plan", study, &["--out", out.to_str().unwrap(), "--json"]);
    let plan: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(plan["tasks"], 240);
    let mut submit = gusset();
    submit.args([
        "campaign",
        "submit",
        out.to_str().unwrap(),
        "--engine",
        "lines",
    ]);
    let said = submit.current_dir(folder.path()).output().unwrap();
    assert!(
        said.status.success(),
        "{}",
        String::from_utf8_lossy(&said.stderr)
    );
    for (name, tasks) in [("vrths-monte-carlo", 100), ("compensator-tuning", 16)] {
        let path = format!("config/campaigns/{name}.toml");
        let study = gusset_session::campaign::Study::load(Path::new(&path)).unwrap();
        assert_eq!(study.tasks, tasks, "{name}");
    }
}
