//! Resuming a long record takes no more memory than a short one.

use crate::common::test_file::TestFile;
use serde_json::json;

use super::*;

/// Twenty seconds of a frame with a rig, so that there is a place to be found, and a checkpoint every hundredth of a second.
#[test]
fn resume_uses_constant_memory() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let text = frame(500, 1, 20.0, 0.0).with("record.checkpoint_s = 0.01");
    let motion = |k: i32| {
        format!(
            "{:.3},{:.6}\n",
            f64::from(k) * 0.005,
            libm::sin(f64::from(k) * 0.045)
        )
    };
    let motion: String = (0..4100).map(motion).collect();
    let test = write(home.path(), "test.toml", &text);
    write(home.path(), "motion.csv", &format!("t,a\n{motion}"));
    completed(&test, &at("whole"), &[]);
    let most = |name: &str, row: usize| {
        killed(&at("whole"), &at(name), row);
        // A checkpoint with a state for each row, as at a low rate.
        let checkpoint = |step: usize| {
            let sha256 = format!("{step:064x}");
            let line = json!({"tick": step, "event": "checkpoint", "digest": "00ab00ab00ab00ab", "sha256": sha256});
            format!("{line}\n")
        };
        let path = at(name).join("events.jsonl");
        let lines = std::fs::read_to_string(&path).unwrap();
        let more: String = (0..row).map(checkpoint).collect();
        std::fs::write(path, lines + &more).unwrap();
        let info = allocation_counter::measure(|| {
            resume(&at(name), None, false).unwrap_or_else(|e| panic!("{e}"));
        });
        info.bytes_max
    };
    let (short, long) = (most("short", 500), most("long", 9500));
    let bytes = |name: &str| {
        std::fs::metadata(at(name).join("samples.bin"))
            .unwrap()
            .len()
    };
    let more = bytes("long") - bytes("short");
    assert!(more > 1_000_000, "{more}");
    assert!(
        long < short + more / 20,
        "{long} bytes, {short} for a short record"
    );
}
