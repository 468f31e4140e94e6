//! A step of a moment frame of ten storeys and five bays, 110 force-based members of five sections with twenty fibres each, against
//! the real OpenSees with Newmark's method and Newton's iteration.
//!
//! Run with `cargo bench --bench frame`. Without `GUSSET_OPENSEES_PYTHON` it measures our steps only. Timed: everything that the loop does
//! for a step of the numerical side, on one thread, without the record. The worst case is a step in which every search tries as many
//! places as it may, and no fibre is elastic.

#![allow(clippy::disallowed_macros, reason = "a bench prints its result")]

use std::process::Command;

use gusset_control::engine::Side;
use gusset_evidence::frontier::{Scalable, moment_frame};
use gusset_record::rt::os::monotonic_ns;

const DT: f64 = 1.0 / 1024.0;
const STEPS: usize = 4096;

fn main() {
    let dofs = 3 * 6 * 10;
    let members = moment_frame(6, 10).member.len();
    let mut times = Vec::with_capacity(STEPS);
    let Ok(Side::Structure(mut side)) = Scalable::moment_frame(6, 10, DT, STEPS) else {
        panic!("the frame cannot be built");
    };
    let mut largest = 0.0_f64;
    for step in 0..STEPS as u64 {
        let begun = monotonic_ns();
        side.close(step, DT, &mut []);
        side.advance(step).unwrap();
        times.push((monotonic_ns() - begun) as f64 * 1e-3);
        largest = side
            .state
            .disp
            .iter()
            .fold(largest, |most, x| most.max(x.abs()));
    }
    let worst = side.worst_step(DT, &mut monotonic_ns);
    let worst = worst.unwrap() as f64 * 1e-3;
    let elastic = median(times[..100].to_vec());
    times.sort_by(f64::total_cmp);
    println!(
        "{members} members, {dofs} degrees of freedom, largest displacement {:.0} mm",
        1e3 * largest
    );
    println!(
        "step: elastic {elastic:.0} µs, median {:.0} µs, 99.9 % {:.0} µs, largest {:.0} µs",
        times[STEPS / 2],
        times[STEPS * 999 / 1000],
        times[STEPS - 1]
    );
    println!(
        "worst case: {worst:.0} µs, {} evaluations of the members",
        side.most_evaluations()
    );
    let Some(python) = std::env::var_os("GUSSET_OPENSEES_PYTHON") else {
        println!("OpenSees: not measured, GUSSET_OPENSEES_PYTHON is not set");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("frame.toml");
    let frame = toml::to_string(&moment_frame(6, 10)).unwrap();
    let frame = frame
        .replace("[[", "[[structure.frame.")
        .replace("\n[section", "\n[structure.frame.section")
        .replace("\n[material", "\n[structure.frame.material");
    let text = format!(
        "{frame}\n[structure.damping.rayleigh]\nmass_coefficient_per_s = 0.3\nstiffness_coefficient_s = 0.0\n\
         [time]\nrate_hz = 1024\nduration_s = 4\n[excitation.ground_acceleration.signal.sine]\namplitude = 3.0\nfrequency_hz = 1.0\n"
    );
    std::fs::write(&file, text).unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/frame.py");
    let said = Command::new(python)
        .arg(script)
        .arg(&file)
        .arg("1")
        .output()
        .unwrap();
    let line = String::from_utf8_lossy(&said.stdout).into_owned();
    let told: serde_json::Value = serde_json::from_str(line.lines().last().unwrap_or_default())
        .unwrap_or_else(|_| panic!("{line}{}", String::from_utf8_lossy(&said.stderr)));
    let theirs = told["seconds_per_step"].as_f64().unwrap() * 1e6;
    println!(
        "OpenSees: {theirs:.0} µs a step; ratio {:.1} to our worst case, {:.1} to our median",
        theirs / worst,
        theirs / times[STEPS / 2]
    );
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
