//! Shared by the tests of the exports: programs that judge, and runs made by hand.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use gusset_record::journal::encode;
use gusset_record::{Column, Layout};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// All forms of the same numbers.
pub const TABLES: [&str; 7] = ["csv", "npz", "mat", "mat73", "hdf5", "parquet", "mcap"];

/// Python with what reads the exports. Without it a test says SKIPPED, and fails where CI=true.
pub fn python() -> Option<PathBuf> {
    let made = Path::new(ROOT).join("target/export-venv/bin/python");
    let python = std::env::var_os("GUSSET_EXPORT_PYTHON").map_or(made, PathBuf::from);
    found(
        python,
        "the readers of the exports are not installed; `tools/test` installs them",
    )
}

/// Octave, under the same conditions.
pub fn octave() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut folders = std::env::split_paths(&path).map(|folder| folder.join("octave-cli"));
    let octave = folders.find(|program| program.exists()).unwrap_or_default();
    found(
        octave,
        "Octave is not installed (Debian: apt-get install octave)",
    )
}

fn found(program: PathBuf, else_say: &str) -> Option<PathBuf> {
    if program.exists() {
        return Some(program);
    }
    let text = format!("SKIPPED: {else_say}\n");
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{text}");
    // Past the capture of the test harness, which hides the output of a passing test.
    let _ = std::io::stderr().write_all(text.as_bytes());
    None
}

/// Has the exports in `exports` judged; the last line of the verdict.
pub fn judge(run: &Path, exports: &Path, rate: &str, formats: &[&str]) -> Option<String> {
    let mut command = Command::new(python()?);
    command.arg(Path::new(ROOT).join("tests/run_folder/readers/judge.py"));
    command.arg(Path::new(ROOT).join("tools"));
    command.arg(run).arg(exports).arg(rate).args(formats);
    Some(verdict(&mut command))
}

/// Judges every tick of MATLAB's files and HDF5 in Octave.
pub fn judge_in_octave(run: &Path, exports: &Path) -> Option<String> {
    let mut command = Command::new(octave()?);
    command.args(["--quiet", "--norc"]);
    command.arg(Path::new(ROOT).join("tests/run_folder/readers/judge.m"));
    command.env("TOOLS", Path::new(ROOT).join("tools"));
    command.env("RUN_DIR", run).env("EXPORTS", exports);
    Some(verdict(&mut command))
}

fn verdict(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}{errors}");
    said.trim().to_owned()
}

/// The columns of a run made by hand: two whose names a format may stumble over, and the stamps of a tick.
pub const COLUMNS: [&str; 11] = [
    "step",
    "state",
    "time",
    "x1",
    "units",
    "9lives",
    "release_s",
    "wakeup_lateness_s",
    "command_lateness_s",
    "round_trip_s",
    "compute_s",
];

/// A run folder with these rows of [`COLUMNS`], and no summary.
pub fn by_hand(path: &Path, rows: impl Iterator<Item = [f64; 11]>) {
    std::fs::create_dir_all(path).unwrap();
    let column = |name: &str| Column {
        name: name.to_owned(),
        unit: if name.ends_with("_s") { "s" } else { "m" }.to_owned(),
        meaning: format!("what \"{name}\" means, in µ and m²"),
        timing: name.ends_with("_s"),
    };
    let layout = Layout::new(COLUMNS.map(column).to_vec()).unwrap();
    std::fs::write(path.join("samples.json"), layout.to_json()).unwrap();
    let file = std::fs::File::create(path.join("samples.bin")).unwrap();
    let mut file = std::io::BufWriter::with_capacity(1 << 20, file);
    let mut bytes = Vec::new();
    for (sequence, row) in (0..).zip(rows) {
        bytes.clear();
        encode(sequence, &row, &mut bytes);
        file.write_all(&bytes).unwrap();
    }
    file.flush().unwrap();
}

/// Row `k` of a run at 1 kHz: step k, awake 10 µs late, sent 5 µs later, answered after 300 µs, ready 100 µs after that.
pub fn row(k: u32) -> [f64; 11] {
    let t = f64::from(k) * 1e-3;
    let x = if k % 7 == 3 {
        f64::NAN
    } else {
        (f64::from(k)).sqrt()
    };
    [
        f64::from(k),
        3.0,
        t,
        x,
        -x,
        t * t,
        t,
        10e-6,
        15e-6,
        300e-6,
        100e-6,
    ]
}
