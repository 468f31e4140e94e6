//! Cost of a campaign beside other ways to run the same tests.
//!
//! `cargo bench --bench campaign`. Each part prints ours, an opponent's time, and the ratio, from one run:
//!
//! - *overhead*: tasks of a campaign on one core, against a loop over the same tests in this process that measures nothing;
//! - *shell loop*: a whole `gusset campaign run`, against one `gusset run` after the other;
//! - *two cores*: the same chunk with two threads and with one;
//! - *many tasks*: plan, collect and memory of 1000 and of 100 000 tasks (`cargo bench --bench campaign -- many`: about two minutes);
//! - *OpenSees*: the same incremental dynamic analysis in OpenSeesPy with one process for each core, if it is installed (`tools/test`
//!   installs it, and `GUSSET_OPENSEES_PYTHON` names another interpreter).
#![allow(clippy::disallowed_macros, reason = "a measurement is printed")]
#![allow(clippy::disallowed_methods, reason = "whole programs are timed")]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use gusset_control::engine::{Connected, Control};
use gusset_quantity::time::SimClock;
use gusset_record::{Recorder, TimedEvent};
use gusset_session::campaign::{Campaign, Program, plan, work};
use gusset_setup as setup;

/// The frame of `config/frame-bouc-wen.toml` with a bilinear first storey, which OpenSees has too.
const FRAME: &str = r#"
[time]
rate_hz = 1024
duration_s = DURATION
clock = "simulated"
[structure.shear_building]
mass_kg = [20e3, 20e3, 18e3]
stiffness_n_per_m = [0, 14e6, 11e6]
[structure.damping.rayleigh]
mass_coefficient_per_s = 0.4
stiffness_coefficient_s = 0
[excitation.ground_acceleration.processing]
zero_tail = true
[excitation.ground_acceleration.signal.kanai_tajimi]
ground_frequency_hz = 2.4
ground_damping_ratio = 0.6
envelope = { jennings_housner = { rise_s = 0.2, strong_s = 7, decay_per_s = 0.4 } }
duration_s = DURATION
seed = 1
peak = 3
[[specimen]]
name = "storey"
storey = 1
[specimen.law.bilinear]
stiffness_n_per_m = 15e6
yield_force_n = 120e3
post_yield_ratio = 0.08
"#;

/// Nothing is kept of a test.
struct Nothing;

impl Recorder for Nothing {
    fn row(&mut self, _: &[f64]) -> bool {
        true
    }

    fn event(&mut self, _: TimedEvent) -> bool {
        true
    }
}

struct Bench {
    folder: tempfile::TempDir,
    made: u32,
}

impl Bench {
    /// A new study of the frame: `more` holds its tables.
    fn study(&mut self, duration_s: f64, more: &str) -> PathBuf {
        self.made += 1;
        let path = self.folder.path().join(format!("study-{}.toml", self.made));
        let frame = FRAME.replace("DURATION", &duration_s.to_string());
        fs::write(&path, frame + more).expect("a study");
        path
    }

    /// A planned campaign of it.
    fn planned(&mut self, study: &Path, tasks_per_chunk: u64) -> Campaign {
        self.made += 1;
        let out = self.folder.path().join(format!("campaign-{}", self.made));
        plan(study, &out, Some(tasks_per_chunk), &Program::default()).expect("a plan")
    }
}

/// What differs between the tests of a study.
const VARIED: &str = "structure.damping.rayleigh.mass_coefficient_per_s";

/// `count` tests that differ in the damping.
fn varied(count: u64) -> String {
    format!("[[vary]]\nkey = \"{VARIED}\"\nlinear = {{ from = 0.3, to = 0.5, count = {count} }}\n")
}

fn computed(campaign: &Campaign, jobs: usize) -> Duration {
    let began = Instant::now();
    let done = work(campaign, 1..=1, jobs, &|| false, &|_| {}).expect("results");
    assert_eq!(done.computed, campaign.plan.tasks);
    began.elapsed()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn overhead(bench: &mut Bench) {
    const TASKS: u64 = 8;
    let study = bench.study(40.0, &varied(TASKS));
    let (mut ratios, mut each) = (Vec::new(), Vec::new());
    for _ in 0..7 {
        let campaign = bench.planned(&study, TASKS);
        let ours = computed(&campaign, 1).as_secs_f64();
        let began = Instant::now();
        for index in 0..TASKS {
            let damping = 0.3 + 0.2 * index as f64 / (TASKS - 1) as f64;
            let set = format!("{VARIED}={damping}");
            let test = campaign.study.loaded.test.varied(&[set]).expect("a test");
            let experiment = setup::build_rehearsal(&test).expect("a test").experiment;
            let clock = Box::new(SimClock::new());
            let test = Connected::new(experiment, clock, Box::new(Nothing));
            let _ = test.run(&Control::from(crossbeam_channel::never()));
        }
        let theirs = began.elapsed().as_secs_f64();
        ratios.push(ours / theirs);
        each.push(1e3 * theirs / TASKS as f64);
    }
    println!(
        "overhead     tests of {:.0} ms: campaign / loop in this process = {:.3}",
        median(each),
        median(ratios)
    );
}

fn shell_loop(bench: &mut Bench) {
    const TASKS: u64 = 200;
    const RUNS: u64 = 20;
    let study = bench.study(4.0, &varied(TASKS));
    let out = bench.folder.path().join("whole");
    let began = Instant::now();
    gusset(&["campaign", "run", text(&study), "--out", text(&out)]);
    let ours = began.elapsed().as_secs_f64() / TASKS as f64;
    let test = bench.study(4.0, "");
    let began = Instant::now();
    for run in 0..RUNS {
        let out = bench.folder.path().join(format!("run-{run}"));
        let set = format!(
            "structure.damping.rayleigh.mass_coefficient_per_s={}",
            0.3 + 1e-3 * run as f64
        );
        gusset(&["run", text(&test), "--set", &set, "--out", text(&out)]);
    }
    let theirs = began.elapsed().as_secs_f64() / RUNS as f64;
    println!(
        "shell loop   a campaign of {TASKS} tests: {:.1} ms a test; `gusset run`: {:.1} ms a test; {:.1} times faster",
        1e3 * ours,
        1e3 * theirs,
        theirs / ours
    );
}

fn two_cores(bench: &mut Bench) {
    let study = bench.study(20.0, &varied(24));
    let mut ratios = Vec::new();
    for _ in 0..5 {
        let [one, two] =
            [1, 2].map(|jobs| computed(&bench.planned(&study, 24), jobs).as_secs_f64());
        ratios.push(one / two);
    }
    println!("two cores    {:.2} times as fast as one", median(ratios));
}

fn many_tasks(bench: &mut Bench) {
    for side in [32_u64, 317] {
        let more = format!(
            "[[vary]]\nkey = \"specimen.0.law.bilinear.post_yield_ratio\"\nlinear = {{ from = 0.01, to = 0.1, count = {side} }}\n"
        );
        let study = bench.study(0.03125, &(varied(side) + &more));
        let out = bench.folder.path().join(format!("many-{side}"));
        let (planned, _) = watched(&["campaign", "plan", text(&study), "--out", text(&out)]);
        let (whole, of_run) = watched(&["campaign", "run", text(&out)]);
        let (collected, of_collect) = watched(&["campaign", "collect", text(&out)]);
        println!(
            "many tasks   {}: plan {planned:.1} s, run {whole:.1} s with {of_run} MB, collect {collected:.1} s with {of_collect} MB",
            side * side
        );
    }
}

fn opensees(bench: &mut Bench) {
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/opensees-venv/bin/python");
    let python = std::env::var_os("GUSSET_OPENSEES_PYTHON").map_or(made, PathBuf::from);
    if !python.exists() {
        println!("OpenSees     not installed: `tools/test` installs it");
        return;
    }
    let records = bench.folder.path().join("records");
    fs::create_dir(&records).expect("a folder");
    for seed in 0..10 {
        fs::write(records.join(format!("{seed}.csv")), record(seed)).expect("a record");
    }
    let levels = [0.5, 1.0, 2.0, 3.0, 4.5, 6.0];
    let words: Vec<String> = levels.iter().map(f64::to_string).collect();
    let words = words.join(",");
    let study = bench.study(
        20.0,
        &format!("[[records]]\nfolder = \"records\"\nrecord_unit = \"m/s2\"\nvalues = [{words}]\nunit = \"m/s2\"\n[measure]\nresidual = false\n"),
    );
    let out = bench.folder.path().join("ida");
    let began = Instant::now();
    gusset(&["campaign", "run", text(&study), "--out", text(&out)]);
    let ours = began.elapsed().as_secs_f64();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/ida.py");
    let cores = std::thread::available_parallelism()
        .map_or(1, usize::from)
        .to_string();
    let run = Command::new(python)
        .args([
            script,
            "--records",
            text(&records),
            "--levels",
            &words,
            "--processes",
            &cores,
        ])
        .output()
        .expect("OpenSees");
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let reply: serde_json::Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let theirs = reply["wall_s"].as_f64().expect("a time");
    let theirs_drifts = reply["drifts"]
        .as_array()
        .expect("drifts")
        .iter()
        .filter_map(serde_json::Value::as_f64);
    let table = fs::read_to_string(out.join("table.csv")).expect("a table");
    let head: Vec<&str> = table.lines().next().expect("a head").split(',').collect();
    let place = head
        .iter()
        .position(|name| *name == "max_drift")
        .expect("drifts");
    let drifts = table
        .lines()
        .skip(1)
        .filter_map(|line| line.split(',').nth(place)?.parse::<f64>().ok());
    let differences: Vec<f64> = drifts
        .zip(theirs_drifts)
        .map(|(a, b)| (a / b - 1.0).abs())
        .collect();
    println!(
        "OpenSees     {} tests of 20 s: campaign {ours:.2} s, OpenSeesPy {theirs:.2} s on {cores} processes; {:.1} times faster; \
         median difference of the largest drift {:.2} %",
        differences.len(),
        theirs / ours,
        100.0 * median(differences)
    );
}

/// A synthetic record of 20 s: filtered noise under an envelope, a function of the seed.
fn record(seed: u64) -> String {
    let mut state = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut noise = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let (mut one, mut other) = (0.0, 0.0);
    let mut text = String::from("time,accel\n");
    for step in 0..=20 * 1024 {
        let time = f64::from(step) / 1024.0;
        // Two poles at 2.4 Hz with a damping ratio of 0.6.
        let omega = std::f64::consts::TAU * 2.4 / 1024.0;
        other += omega * (100.0 * noise() - 1.2 * other - one);
        one += omega * other;
        let envelope = (time / 2.0).min(1.0) * libm::exp(-0.3 * (time - 7.0).max(0.0));
        // Writing to a string does not fail.
        let _ = writeln!(text, "{time},{}", envelope * other);
    }
    text
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path of letters")
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gusset"));
    command
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

fn gusset(arguments: &[&str]) {
    let status = command(arguments).status().expect("the program");
    assert!(status.success(), "{arguments:?}: {status}");
}

/// Wall time in s, and the largest memory in MB.
fn watched(arguments: &[&str]) -> (f64, u64) {
    let began = Instant::now();
    let mut child = command(arguments).spawn().expect("the program");
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    loop {
        let now = fs::read_to_string(&status).unwrap_or_default();
        let line = now.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kb = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        most = most.max(kb.unwrap_or(0));
        if let Some(status) = child.try_wait().expect("a child") {
            assert!(status.success(), "{arguments:?}: {status}");
            return (began.elapsed().as_secs_f64(), most / 1024);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// One measurement.
type Part = fn(&mut Bench);

fn main() {
    let only: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'))
        .collect();
    let wanted = |name: &str| {
        only.iter().any(|word| name.starts_with(word.as_str()))
            || (only.is_empty() && name != "many")
    };
    let mut bench = Bench {
        folder: tempfile::tempdir().expect("a folder"),
        made: 0,
    };
    let parts: [(&str, Part); 5] = [
        ("overhead", overhead),
        ("shell", shell_loop),
        ("cores", two_cores),
        ("opensees", opensees),
        ("many", many_tasks),
    ];
    for (_, part) in parts.iter().filter(|(name, _)| wanted(name)) {
        part(&mut bench);
    }
}
