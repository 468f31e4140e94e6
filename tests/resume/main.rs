//! An interrupted test resumes where its record ends: the same bits as without the interruption, from its folder alone, into a new
//! folder. A changed, damaged or moved run is refused, and the first run's folder stays unchanged.

#[path = "../common/mod.rs"]
mod common;
#[path = "../link_common/mod.rs"]
mod link_common;

mod changed;
mod earlier_peaks;
mod fresh;
mod memory;
mod refusals;
mod restored_state;
mod rigs;
mod same_bits;
mod standing;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use common::killed::{column, killed};
use common::{completed, copy, say, write};
use gusset_control::engine::{Operator, Phase};
use gusset_control::port::{Axis, AxisSpec, Port, PortSpec};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;
use gusset_record::{Run, RunFolder};
use gusset_session::{
    self as session, Allowed, ReplayError, ResumeError, Watches, replay, resume_allowed,
};
use sha2::{Digest, Sha256};

/// A frame whose bottom storey is a Bouc–Wen formula and whose upper storey has a yielding element: both remember.
fn frame(rate: u32, ticks: u32, seconds: f64, ease: f64) -> String {
    format!(
        "title = \"Interrupted\"\n[time]\nrate_hz = {rate}\nduration_s = {seconds}\nclock = \"simulated\"\nticks_per_step = \
         {ticks}\n[structure]\nstatic_load_n = [500.0, 200.0]\n[structure.shear_building]\nmass_kg = [1000.0, 900.0]\n\
         stiffness_n_per_m = [0, 2e5]\n[[structure.element]]\nfrom = 1\nto = 2\nlaw.bilinear = {{ stiffness_n_per_m = 2e5, \
         yield_force_n = 800.0, post_yield_ratio = 0.1 }}\n[excitation.ground_acceleration.signal.file]\npath = \
         \"motion.csv\"\nunit = \"m/s2\"\n[timing]\nwarmup_ticks = 4\n[safety]\nramp_s = 0.1\nease_s = {ease}\n[record]\n\
         checkpoint_s = 0.1\n[[specimen]]\nname = \"storey\"\nstorey = 1\n[specimen.law.bouc_wen]\nstiffness_n_per_m = 5e5\n\
         yield_force_n = 1.5e3\npost_yield_ratio = 0.1\nbeta = 0.5\ngamma = 0.5\nexponent = 1.5\n"
    )
}

/// A test whose force came to its limit in the middle, and tripped.
fn tripped_in(home: &Path, out: &Path) {
    let text = frame(200, 1, 2.0, 0.0)
        + "[specimen.limits]\nmeasured_force_n = { trip = [-1.2e3, 1.2e3] }\n";
    let test = test_in(home, &text);
    let said = common::run(&test, out, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
}

fn test_in(home: &Path, text: &str) -> PathBuf {
    let line = |k: i32| {
        let t = f64::from(k) * 0.005;
        format!(
            "{t:.3},{:.6}\n",
            4.0 * libm::sin(9.0 * t) + 2.0 * libm::cos(23.0 * t)
        )
    };
    write(
        home,
        "motion.csv",
        &format!("t,a\n{}", (0..1200).map(line).collect::<String>()),
    );
    write(home, "test.toml", text)
}

/// Rows that never reached the file of a run.
fn without_rows(run: &Path, rows: std::ops::Range<usize>) {
    let stride = Run::open(run).unwrap().layout().stride();
    let path = run.join("samples.bin");
    let mut bytes = std::fs::read(&path).unwrap();
    let end = (rows.end * stride).min(bytes.len());
    bytes.drain(rows.start * stride..end);
    std::fs::write(path, bytes).unwrap();
}

/// Step → the bits of its row, over runs that follow each other; a step that is there twice is the later one's.
fn steps(runs: &[&Path]) -> BTreeMap<u64, Vec<u64>> {
    let names = [
        "x1",
        "x2",
        "v1",
        "v2",
        "a1",
        "a2",
        "force_1_1",
        "target_1_1",
        "cmd_1_1",
        "ground",
        "time",
    ];
    let mut all = BTreeMap::new();
    for run in runs {
        let run = Run::open(run).unwrap();
        let head = run.columns(&["step", "state"]).unwrap();
        let columns = run.columns(&names).unwrap();
        for row in 0..head[0].len() {
            if head[1][row] == 3.0 {
                let bits = columns.iter().map(|column| column[row].to_bits()).collect();
                all.insert(head[0][row] as u64, bits);
            }
        }
    }
    all
}

fn go_on(from: &Path, out: &Path) -> common::Said {
    go_on_with(from, out, &[])
}

fn go_on_with(from: &Path, out: &Path, more: &[&str]) -> common::Said {
    let (from, out) = (from.to_str().unwrap(), out.to_str().unwrap());
    let mut args = vec!["run", "--resume", from, "--out", out];
    args.extend(more);
    say(args)
}

fn bytes(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let files = common::names(folder)
        .into_iter()
        .filter(|name| folder.join(name).is_file());
    files
        .map(|name| (name.clone(), std::fs::read(folder.join(name)).unwrap()))
        .collect()
}

/// Prepares the test in `folder` for a resume, after a trip only with that permission.
fn resume(
    folder: &Path,
    test: Option<&Path>,
    after_trip: bool,
) -> Result<gusset_setup::Prepared, ResumeError> {
    let allowed = Allowed {
        after_trip,
        ..Allowed::default()
    };
    resume_allowed(folder, test, allowed)
}

fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn refused(from: &Path, word: &str, more: &[&str]) {
    let out = from.with_extension("out");
    let mut args = vec![
        "run",
        "--resume",
        from.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    args.extend(more);
    let said = say(args);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains(word), "{word}: {}", said.stderr);
    assert!(!out.exists(), "nothing began");
}
