//! The state of a resumed test goes back to its last step that counts. Its largest magnitudes keep what came after that step.

use super::*;
use crate::common::test_file::TestFile;
use gusset_setup::Prepared;

/// Runs a test that is stopped after this number of ticks.
fn concluded(test: Prepared, out: &Path, ticks: usize) -> session::Finished {
    let (says, requests) = crossbeam_channel::bounded(ticks + 1);
    for _ in 0..ticks {
        says.send(Operator::Continue).unwrap();
    }
    says.send(Operator::Stop).unwrap();
    let folder = RunFolder::create(out).unwrap();
    session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
}

/// The largest of these is that of the trip, in no row that counts.
#[test]
fn tripping_force_is_a_resumed_tests_peak() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    tripped_in(home.path(), &at("first"));
    let summary = |name: &str| common::json(&at(name), "summary.json");
    let peak = summary("first")["peak"].clone();
    let tripped = peak["force"]["storey"][0].as_f64().unwrap();
    assert!(tripped > 1.2e3, "{peak}");

    // Each is stopped before its first own step: its peaks of the whole test are those of the first.
    let mut before = "first";
    for (name, after_trip) in [("second", true), ("third", false)] {
        let next = resume(&at(before), None, after_trip).unwrap_or_else(|e| panic!("{e}"));
        let ended = concluded(next, &at(name), 2);
        assert_eq!(ended.cause, Cause::Operator);
        assert_eq!(summary(name)["peak"], peak, "{name}");
        let origin = common::json(&at(name), "resumed.json");
        assert_eq!(origin["peak"], peak, "{name}");
        let found = replay(&at(name)).unwrap();
        assert!(found.difference.is_none(), "{name}: {found:?}");
        before = name;
    }

    // A recording from before such files had that is still resumed.
    let older = at("second").join("resumed.json");
    let mut origin = common::json(&at("second"), "resumed.json");
    origin.as_object_mut().unwrap().remove("peak");
    std::fs::write(older, origin.to_string()).unwrap();
    let found = replay(&at("second")).unwrap();
    assert!(found.difference.is_none(), "{found:?}");
}

/// Neither a summary nor the loop reports the rows behind a gap.
#[test]
fn force_after_the_checkpoint_is_a_peak() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    // It grows.
    let text = frame(200, 1, 2.0, 0.0)
        .without("excitation.ground_acceleration.signal.file")
        .with("excitation.ground_acceleration.signal.sine = { amplitude = 2, frequency_hz = 1.4 }");
    let test = test_in(home.path(), &text);
    completed(&test, &at("whole"), &[]);
    killed(&at("whole"), &at("gap"), 380);
    without_rows(&at("gap"), 200..210);
    // A state that was kept after the gap would replace the checkpoint before it.
    for name in ["state.bin", "state-before.bin"] {
        let _none = std::fs::remove_file(at("gap").join(name));
    }
    let next = resume(&at("gap"), None, false).unwrap_or_else(|e| panic!("{e}"));
    let from = next.experiment.resume.as_ref().unwrap();
    let [state, step] = ["state", "step"].map(|name| column(&at("gap"), name));
    let later = |name: &str| {
        let values = column(&at("gap"), name);
        let rows = values.iter().zip(state.iter().zip(&step));
        let rows = rows.filter(|(_, (state, step))| **state == 3.0 && **step > from.step() as f64);
        rows.map(|(value, _)| value.abs()).fold(0.0, f64::max)
    };
    let earlier = &from.earlier;
    assert_eq!(earlier.forces, [[later("force_1_1")]]);
    assert_eq!(earlier.peaks.disp, [later("x1"), later("x2")]);
    assert_eq!(earlier.peaks.vel, [later("v1"), later("v2")]);
    assert_eq!(earlier.peaks.accel, [later("a1"), later("a2")]);
    assert!(later("force_1_1") > 0.0);

    let stopped = concluded(next, &at("second"), 12);
    assert_eq!(stopped.cause, Cause::Operator);
    let peak = common::json(&at("second"), "summary.json")["peak"].clone();
    let all = |name: &str| {
        let rows = column(&at("gap"), name).into_iter().zip(&state);
        let rows = rows.filter(|(_, state)| **state == 3.0);
        rows.map(|(value, _)| value.abs()).fold(0.0, f64::max)
    };
    assert_eq!(peak["displacement"][1].as_f64(), Some(all("x2")));
    assert_eq!(peak["force"]["storey"][0].as_f64(), Some(all("force_1_1")));
}
