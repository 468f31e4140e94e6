//! Shared by the end-to-end tests: the binary, a small test file, and a run read back.
#![allow(
    dead_code,
    reason = "every test is a separate crate and uses its share"
)]

pub mod engine;
pub mod killed;
pub mod refusal;
pub mod rig;
pub mod spring;
pub mod test_file;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use gusset_record::{Journal, Run, journal};

/// A frame of two storeys at 200 Hz whose bottom storey is a Bouc–Wen specimen: half a second, simulated clock.
pub const FRAME: &str = r#"title = "Frame"

[time]
rate_hz = 200
duration_s = 0.5
clock = "simulated"

[structure.shear_building]
mass_kg = [1000.0, 900.0]
stiffness_n_per_m = [0, 4e5]

[structure.damping.rayleigh_ratio]
ratio = 0.02
modes = [1, 2]

[integrator]
lambda = "auto"

[excitation.ground_acceleration.signal.sine]
amplitude = 3.0
frequency_hz = 2.0

[[specimen]]
name = "storey"
storey = 1

[specimen.law.bouc_wen]
stiffness_n_per_m = 5e5
yield_force_n = 1.5e3
post_yield_ratio = 0.1
beta = 0.5
gamma = 0.5
exponent = 1.5
"#;

/// Bounds that a busy machine does not reach: the tests judge numbers, never lateness.
pub const PATIENT: [&str; 6] = [
    "--set",
    "timing.misses.in_total.trip=1000000",
    "--set",
    "timing.misses.in_a_row.trip=1000000",
    "--set",
    "timing.misses.in_window.trip=1000000",
];

/// The binary, with nothing from the terminal that runs the tests.
pub fn gusset() -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    command.stdin(Stdio::null());
    command.env("GUSSET_STATE", state_folder());
    // To run all tests with other words in place of received texts. The test itself reads the true ones.
    if std::env::var_os("GUSSET_TEST_REWORD").is_some() {
        command.env("GUSSET_REWORD", "1");
    }
    command
}

/// A folder that does not exist yet, for the lasting records of specimens: no test sees those of another, or of this machine.
pub fn state_folder() -> PathBuf {
    static MADE: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
    let number = MADE.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let name = format!("gusset-state-{}-{number}", std::process::id());
    std::env::temp_dir().join(name)
}

/// Output and exit code of a command.
#[derive(Debug)]
pub struct Said {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl From<Output> for Said {
    fn from(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8 on both outputs");
        Self {
            code: output.status.code(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }
}

/// Runs the binary to its end.
pub fn say<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Said {
    gusset().args(arguments).output().unwrap().into()
}

/// Writes a test file into `folder`.
pub fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    // A secret that other users can read is refused.
    if [".key", ".token"].iter().any(|end| name.ends_with(end)) {
        use std::os::unix::fs::PermissionsExt;
        let owner = std::fs::Permissions::from_mode(0o600);
        std::fs::set_permissions(&path, owner).unwrap();
    }
    path
}

/// `gusset run test --out out` with further arguments.
pub fn run(test: &Path, out: &Path, more: &[&str]) -> Said {
    let mut command = gusset();
    command.arg("run").arg(test).arg("--out").arg(out);
    command.args(more).output().unwrap().into()
}

/// Runs the test, which must complete.
pub fn completed(test: &Path, out: &Path, more: &[&str]) -> Said {
    let said = run(test, out, more);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    said
}

/// A JSON file of a run folder.
pub fn json(folder: &Path, name: &str) -> serde_json::Value {
    let path = folder.join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Name and bits of every column that does not depend on wall time.
pub fn physics(folder: &Path) -> Vec<(String, Vec<u64>)> {
    let run = Run::open(folder).unwrap();
    let columns = run.layout().columns().iter().filter(|c| !c.timing);
    let names: Vec<&str> = columns.map(|c| c.name.as_str()).collect();
    let values = run.columns(&names).unwrap();
    let bits = |column: Vec<f64>| column.into_iter().map(f64::to_bits).collect();
    let named = names.iter().map(|name| (*name).to_owned());
    named.zip(values.into_iter().map(bits)).collect()
}

/// Both runs hold the same rows, bit for bit, in every column that does not depend on wall time.
pub fn same_physics(one: &Path, other: &Path) {
    let (one, other) = (physics(one), physics(other));
    let names = |all: &[(String, Vec<u64>)]| all.iter().map(|c| c.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&one), names(&other));
    assert!(one[0].1.len() > 1, "nothing was recorded");
    for ((name, here), (_, there)) in one.iter().zip(&other) {
        assert_eq!(here.len(), there.len(), "rows of {name}");
        let row = here.iter().zip(there).position(|(a, b)| a != b);
        assert_eq!(row, None, "first row in which {name} differs");
    }
}

/// Names in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Copies a folder with all that is in it.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Writes another number into one row, with the checksum that belongs to it.
pub fn change(run: &Path, row: u64, column: &str, value: f64) {
    let layout = std::fs::read_to_string(run.join("samples.json")).unwrap();
    let layout: serde_json::Value = serde_json::from_str(&layout).unwrap();
    let columns = layout["columns"].as_array().unwrap();
    let index = columns.iter().position(|found| found["name"] == column);
    let index = index.unwrap();
    let path = run.join("samples.bin");
    let mut bytes = std::fs::read(&path).unwrap();
    let stride = layout["stride"].as_u64().unwrap() as usize;
    let at = row as usize * stride;
    let mut journal = Journal::new(&bytes[at..at + stride], columns.len());
    // A row by itself does not follow from 0, but is read.
    let (sequence, mut values) = {
        let read = journal.next_row().unwrap().unwrap();
        (read.sequence, read.values.to_vec())
    };
    values[index] = value;
    let mut made = Vec::new();
    journal::encode(sequence, &values, &mut made);
    bytes[at..at + stride].copy_from_slice(&made);
    std::fs::write(path, bytes).unwrap();
}
