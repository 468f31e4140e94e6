//! The rehearsal and the certificate of a test on a bus equal those of the same test in this process.

use serde_json::Value;

use super::common::say;
use super::same_bits::in_process;
use super::{OUTPUT, text};

fn certified(text: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.toml");
    let varied = "[certificate]\ntrials = 5\n[[uncertainty]]\nkey = \
                  \"excitation.ground_acceleration.signal.sine.amplitude\"\nstd_share = 0.1\n";
    let text = text.replacen("[structure.shear", &format!("{varied}[structure.shear"), 1);
    std::fs::write(&path, text).unwrap();
    let said = say(["check", "--rehearse", "--json", path.to_str().unwrap()]);
    serde_json::from_str(&said.stdout).unwrap_or_else(|_| panic!("{}", said.stderr))
}

#[test]
fn certificate_equals_that_in_process() {
    for (sample, delay_s) in [("same_tick", 0.0), ("next_tick", 0.002)] {
        let more = format!("sample = \"{sample}\"\nstands_at_m = [0.0]");
        let on_bus = text(OUTPUT, &more);
        let (own, other) = (certified(&on_bus), certified(&in_process(&on_bus, delay_s)));
        assert_eq!(own["rehearsal"]["complete"], true);
        let axes = |found: &Value| found["rehearsal"]["specimens"][0]["axes"].clone();
        assert_eq!(axes(&own), axes(&other), "{sample}");
        // The actuator on the bus is not known: it has no line on its delay.
        let lines = |found: &Value| {
            let all = found["certificate"]["lines"].as_array().unwrap().clone();
            let is_of_motion = |line: &Value| {
                let about = line["about"].as_str().unwrap();
                !about.starts_with("delay") && !about.starts_with("stability")
            };
            let lines = all.into_iter().filter(is_of_motion);
            lines.collect::<Vec<_>>()
        };
        assert!(lines(&own).len() >= 6);
        assert_eq!(lines(&own), lines(&other), "{sample}");
    }
}
