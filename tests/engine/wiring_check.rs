//! The wiring check runs before a test moves a specimen. A reversed or dead channel is not armed, and each fault is distinguished
//! from the others. A correct specimen runs, and a formula does not remember the check.

use std::sync::{Arc, Mutex};

use crate::link_common::{Fake, ONE_AXIS, run, summary, test_file};
use gusset_record::Run;
use gusset_record::summary::Status as Ended;

const STEPS: u32 = 20;
const K: f64 = 4e5;
/// 0.1 mm, ramps of 50 ticks and holds of 20.
const PROBE: &str = "probe_m = 1e-4\nprobe_ramp_s = 0.05\n";
const PROBE_TICKS: usize = 2 * 50 + 3 * 20;

/// End of a test of one specimen with `keys` in its link and the readings `wiring`: exit code, reason or stderr, and the commands
/// to the specimen (`None`: it was armed again).
struct Tried {
    code: i32,
    reason: String,
    said: String,
    told: Vec<Option<f64>>,
    events: Vec<serde_json::Value>,
}

fn tried(keys: &str, wiring: impl FnMut(f64) -> (f64, f64) + Send + 'static) -> Tried {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let told = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&told);
    let address = Fake::start(move |mut fake| {
        fake.obey(wiring, |disp| heard.lock().unwrap().push(disp));
    });
    let link = format!("[specimen.link]\naddress = \"{address}\"\n{keys}\n");
    let (code, said) = run(
        folder,
        "run",
        &test_file(STEPS, &format!("{ONE_AXIS}{link}")),
    );
    let events = Run::open(&folder.join("run")).unwrap().events().unwrap();
    let summary = summary(folder, "run");
    assert_eq!(
        summary.status,
        if code == 0 {
            Ended::Completed
        } else {
            Ended::Failed
        }
    );
    let told = told.lock().unwrap().clone();
    Tried {
        code,
        reason: summary.reason,
        said,
        told,
        events: events.to_json(),
    }
}

/// A specimen that is not armed got the motion of the wiring check and no other command.
fn refused(wiring: impl FnMut(f64) -> (f64, f64) + Send + 'static, words: &str, name: &str) {
    let found = tried(PROBE, wiring);
    assert_eq!(found.code, 3, "{}", found.said);
    assert!(found.reason.contains(words), "{}", found.reason);
    assert!(found.reason.contains("not armed"), "{}", found.reason);
    // Rounded, with a prefix.
    assert!(!found.reason.contains("e-"), "{}", found.reason);
    let headline = " — FAILED: wiring check\n";
    assert!(found.said.contains(headline), "{}", found.said);
    assert_eq!(found.told.len(), PROBE_TICKS);
    for disp in found.told {
        assert!((0.0..=1e-4).contains(&disp.expect("it is not armed again")));
    }
    let misfit = found.events.iter().find(|e| e["event"] == "misfit");
    assert_eq!(misfit.unwrap()["what"], name);
    assert!(!found.events.iter().any(|e| e["event"] == "started"));
}

#[test]
fn correct_wiring_is_armed_and_tested() {
    let found = tried(PROBE, |d| (d, K * d));
    assert_eq!(found.code, 0, "{}", found.said);
    assert!(
        found.said.contains("0.1 mm"),
        "it is announced: {}",
        found.said
    );
    let (probe, rest) = found.told.split_at(PROBE_TICKS);
    let probe: Vec<f64> = probe.iter().map(|disp| disp.unwrap()).collect();
    let largest = probe.iter().fold(0.0, |m: f64, d| m.max(*d));
    assert_eq!(largest, 1e-4);
    assert_eq!(probe.last(), Some(&0.0), "back to the last bit");
    for pair in probe.windows(2) {
        // The steepest part of half a cosine in 50 ticks: π/2 · 1e-4 / 50.
        assert!((pair[1] - pair[0]).abs() < 3.2e-6);
    }
    assert_eq!(rest[0], None, "armed anew");
    assert_eq!(
        rest.len() as u32,
        1 + 5 + STEPS + 1,
        "warm-up, steps, step 0"
    );
    let direction = found.events.iter().find(|e| e["event"] == "direction");
    let direction = direction.unwrap();
    let [disp, force] = ["disp", "force"].map(|key| direction[key].as_f64().unwrap());
    assert!((disp - 1e-4).abs() < 1e-12 && (force / disp / K - 1.0).abs() < 1e-9);
    assert!(found.events.iter().any(|e| e["event"] == "probing"));
}

#[test]
fn reversed_channels_are_distinguished() {
    refused(|d| (d, -K * d), "force channel", "force_reversed");
    refused(
        |d| (-d, K * d),
        "displacement sensor",
        "displacement_reversed",
    );
    refused(|d| (-d, -K * d), "actuator moves", "command_reversed");
}

#[test]
fn a_dead_channel_is_not_armed() {
    refused(|d| (d, 12.0), "load cell", "force_dead");
    refused(|d| (0.003, K * d), "dead or", "displacement_dead");
    // Newtons where kilonewtons are meant.
    refused(|d| (d, 1e-3 * K * d), "another unit", "force_dead");
}

/// A cheap deterministic noise between −1 and 1.
fn noise() -> impl FnMut() -> f64 + Send {
    let mut state = 7u64;
    move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

#[test]
fn noise_above_the_signal_needs_more_motion() {
    let mut small = noise();
    // 40 N are expected; noise of ±8 N.
    let found = tried(PROBE, move |d| (d, K * d + 8.0 * small()));
    assert_eq!(found.code, 0, "{}", found.reason);
    let mut small = noise();
    refused(
        move |d| (d, -K * d + 8.0 * small()),
        "force channel",
        "force_reversed",
    );
    let mut large = noise();
    refused(
        move |d| (d, K * d + 4000.0 * large()),
        "`probe_m`",
        "probe_below_noise",
    );
}

#[test]
fn unchecked_direction_is_reported() {
    // A fake says that it is simulated: nothing can break.
    let found = tried("", |d| (d, K * d));
    assert_eq!(found.told.len() as u32, 5 + STEPS + 1, "no motion");
    assert!(!found.said.contains("WAY ROUND"), "{}", found.said);
    // An OpenFresco peer cannot say that.
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(
        STEPS,
        &format!("{ONE_AXIS}{}", crate::link_common::ONE_AXIS_LAW),
    );
    let served = crate::link_common::Served::start(folder, &local, &["--protocol", "openfresco"]);
    for (name, keys, warned) in [
        ("unchecked", "", true),
        ("waived", "probe = \"none\"", false),
        ("probed", PROBE, false),
    ] {
        let link = format!(
            "[specimen.link]\naddress = \"{}\"\nprotocol = \"openfresco\"\n{keys}\n",
            served.address
        );
        let (code, said) = run(
            folder,
            name,
            &test_file(STEPS, &format!("{ONE_AXIS}{link}")),
        );
        assert_eq!(code, 0, "{said}");
        let words = "WAY ROUND";
        assert_eq!(said.contains(words), warned, "{said}");
        let warnings = summary(folder, name).warnings;
        assert_eq!(warnings.iter().any(|w| w.contains(words)), warned);
    }
}

#[test]
fn static_load_stops_a_reversed_specimen() {
    let loaded = |wiring: fn(f64) -> (f64, f64)| {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let largest = Arc::new(Mutex::new(0.0f64));
        let seen = Arc::clone(&largest);
        let address = Fake::start(move |mut fake| {
            fake.obey(wiring, |disp| {
                let mut seen = seen.lock().unwrap();
                *seen = seen.max(disp.unwrap_or(0.0).abs());
            });
        });
        let link = format!("[specimen.link]\naddress = \"{address}\"\n");
        let text = test_file(STEPS, &format!("{ONE_AXIS}{link}")).replacen(
            "[structure.shear_building]",
            "[structure]\nstatic_load_n = [300.0, 100.0]\n[structure.shear_building]",
            1,
        );
        let (code, said) = run(folder, "run", &text);
        let largest = *largest.lock().unwrap();
        (code, said, summary(folder, "run").reason, largest)
    };
    let (code, said, ..) = loaded(|d| (d, K * d));
    assert_eq!(code, 0, "{said}");
    assert!(!said.contains("not show"), "{said}");
    for (wiring, words) in [
        ((|d| (d, -K * d)) as fn(f64) -> (f64, f64), "force channel"),
        (|d| (-d, K * d), "displacement sensor"),
        (|d| (-d, -K * d), "actuator moves"),
    ] {
        let (code, _, reason, largest) = loaded(wiring);
        assert_eq!(code, 3, "{reason}");
        assert!(reason.contains(words), "{reason}");
        // 400 N on 4e5 N/m are 1 mm; the first part of twenty is a twentieth of it.
        assert!(largest < 0.25e-3, "{largest}");
    }
    // A force that shows no direction is not a reversed one: the program warns the user.
    let (code, said, ..) = loaded(|d| (d, 0.5 * K * d - 0.499 * K * d));
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("not show"), "{said}");
}
