//! The record of a test reports its course: injected faults, a hold and its end, losses on the link. A script restarts after
//! each arming.

use std::path::Path;

use super::*;
use crate::served::RecordSettings;
use gusset_config::fault_script::Script;
use gusset_record::Run;
use gusset_record::summary::{Status as Ended, Summary};

const TITLE: &str = "the fault";
const SAID: &str = "FAULTS are played: the fault";
/// The bytes of a script are kept unchanged, whatever they contain.
const BYTES: &str = "# a script\n";

fn scripted(fault: &str) -> Host {
    let text = format!("title = \"{TITLE}\"\n[[fault]]\n{fault}\n");
    let script: Script = toml::from_str(&text).unwrap();
    host().faulty(script).unwrap()
}

pub(super) fn kept(root: &Path) -> RecordSettings {
    RecordSettings {
        root: root.into(),
        file: Vec::new(),
        resolved: String::new(),
        about: None,
        inputs: vec![("scripts/wrong.toml".into(), BYTES.into())],
        queue_s: 4.0,
        required: true,
        accepted: Default::default(),
        verdict: None,
        ended: None,
    }
}

/// The events with their texts, and the summary.
pub(super) fn record(root: &Path) -> (Vec<(String, String)>, Summary) {
    let run = Run::open(&root.join("test-0001")).unwrap();
    let word = |event: &serde_json::Value, key: &str| event[key].as_str().unwrap_or("").to_owned();
    let events = run.events().unwrap().to_json();
    let events = events.iter().map(|e| (word(e, "event"), word(e, "text")));
    (events.collect(), run.summary().unwrap().clone())
}

impl Controller {
    fn leave(&mut self, sequence: u64) {
        let cause = Cause::Orderly;
        let notice = Notice { sequence, cause };
        let length = self.encoder.retire(notice, &mut self.out).unwrap();
        self.send(length);
        self.hear().unwrap().unwrap();
    }

    /// Whether only the server knows the specimen's position after the last test.
    fn lost_it(&self) -> bool {
        let tap = self.tap.lock().unwrap();
        let lost = tap.iter().rev().find_map(|tapped| match tapped {
            Tapped::Event {
                event: ServerEvent::Ended { is_lost, .. },
                ..
            } => Some(*is_lost),
            _ => None,
        });
        lost.unwrap()
    }
}

#[test]
fn record_keeps_the_fault_script() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    let host = scripted("at = 1\nkind = { bias = { force_n = 500.0 } }");
    let mut controller = Controller::of(host.recorded(kept(root)), axis());
    let forces = [0, 1].map(|k| controller.told(k, 0.001, 0.001).unwrap().unwrap().force[0]);
    assert_eq!(forces, [8.0, 508.0]);
    controller.leave(1);
    let (events, summary) = record(root);
    assert_eq!(events[2], ("faults".into(), SAID.into()));
    assert_eq!(summary.status, Ended::Completed);
    assert_eq!(summary.warnings, [SAID]);
    assert_eq!(summary.inputs.len(), 1);
    assert_eq!(summary.inputs[0].path, "inputs/wrong.toml");
    let copy = std::fs::read_to_string(root.join("test-0001/inputs/wrong.toml"));
    assert_eq!(copy.unwrap(), BYTES);
}

#[test]
fn record_of_an_unbegun_test_keeps_faults() {
    let root = tempfile::tempdir().unwrap();
    let host = scripted("kind = { elsewhere = { disp_m = 0.01 } }").recorded(kept(root.path()));
    let controller = crate::served::Controller::unnamed(([127, 0, 0, 1], 1).into());
    let mut served = host.specimen(false).unwrap();
    assert!(served.begin(&controller, &mut || Ok(())).is_err());
    let (events, summary) = record(root.path());
    assert_eq!(events[2], ("faults".into(), SAID.into()));
    assert_eq!(summary.warnings, [SAID]);
}

#[test]
fn record_shows_holds_and_lost_commands() {
    let root = tempfile::tempdir().unwrap();
    let mut controller = Controller::of(host().recorded(kept(root.path())), axis());
    assert_eq!(controller.command(0, 0.0, 0.001), FINE);
    assert_eq!(controller.command(1, 0.001, 0.001), FINE);
    controller.clock.advance(600_000_000);
    // Signs of life.
    while controller.hear().unwrap().is_some() {}
    assert_eq!(controller.command(4, 0.002, 0.001), FINE);
    controller.leave(4);
    let (events, summary) = record(root.path());
    let names: Vec<&str> = events.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "files",
            "controller",
            "ready",
            "holding",
            "commands_again",
            "counts",
            "ended"
        ]
    );
    assert!(events[4].1.ends_with(" 4"), "{events:?}");
    assert!(events[5].1.contains("2 missed"), "{events:?}");
    assert_eq!(
        (summary.link["rig"].missed, summary.link["rig"].sent),
        (2, 3)
    );
    assert!(summary.warnings.is_empty());
}

#[test]
fn last_unsent_command_is_recorded_missing() {
    // The last that came is pending when the retire does, which counts one more.
    for (last, missed) in [(2, 2), (3, 3), (0, 2)] {
        let root = tempfile::tempdir().unwrap();
        let (host, _) = gateway(None);
        let host = host.recorded(kept(root.path()));
        let mut controller = Controller::of(host, axis());
        assert_eq!(controller.command(0, 0.0, 0.001), FINE);
        controller.tell(2, 0.001, 0.001);
        controller.leave(last);
        let (events, _) = record(root.path());
        let counts = format!("1 commands, {missed} missed, 0 frames corrupt");
        assert!(events.contains(&("counts".into(), counts)), "{events:?}");
    }
    // Nothing was sent at all, and the retire has to name a number.
    let root = tempfile::tempdir().unwrap();
    let mut controller = Controller::of(host().recorded(kept(root.path())), axis());
    controller.leave(0);
    let (events, _) = record(root.path());
    let counts = "0 commands, 0 missed, 0 frames corrupt".to_owned();
    assert!(events.contains(&("counts".into(), counts)), "{events:?}");
}

#[test]
fn kept_back_command_has_no_measurement() {
    let root = tempfile::tempdir().unwrap();
    let limits = toml::from_str("command_step_m = { trip = 0.002 }").unwrap();
    let host = host().limited(vec![limits]).recorded(kept(root.path()));
    let mut controller = Controller::of(host, axis());
    for (sequence, disp) in (0..).zip([0.0, 0.001, 0.01, 0.0011]) {
        controller.told(sequence, disp, 0.001).unwrap().unwrap();
    }
    controller.leave(3);
    let run = Run::open(&root.path().join("test-0001")).unwrap();
    let names = ["state", "target_1_1", "cmd_1_1", "status_1"];
    let columns = run.columns(&names).unwrap();
    assert_eq!(columns[0], [3.0, 3.0, 8.0, 8.0]);
    assert_eq!(columns[1], [0.0, 0.001, 0.01, 0.0011]);
    assert_eq!(columns[2][..2], [0.0, 0.001]);
    assert!(columns[2][2..].iter().all(|sent| sent.is_nan()));
    let stale = f64::from(Status::STALE.0 | Status::INTERLOCK.0);
    assert_eq!(columns[3], [0.0, 0.0, stale, stale]);
}

#[test]
fn single_fault_repeats_after_each_arming() {
    let mut controller = Controller::of(
        scripted("at = 2\nkind = { hangs = { ticks = 3.0 } }"),
        axis(),
    );
    let answers = |controller: &mut Controller, first: u64| {
        [0, 1, 2].map(|k| controller.told(first + k, 0.0, 0.001).unwrap().is_some())
    };
    assert_eq!(answers(&mut controller, 0), [true, true, false]);
    controller.clock.advance(10_000_000);
    while controller.hear().unwrap().is_some() {}
    // The third time while it hangs still.
    for first in [10, 20] {
        assert!(matches!(controller.arm(first, 0.0), Some(Control::Arm(_))));
        assert_eq!(answers(&mut controller, first), [true, true, false]);
    }
}

#[test]
fn record_shows_who_closed_the_connection() {
    for (kind, words) in [("closed", "(closed)"), ("goodbye", "switched off")] {
        let root = tempfile::tempdir().unwrap();
        let host = scripted(&format!("at = 1\nkind = \"{kind}\""));
        let mut controller = Controller::of(host.recorded(kept(root.path())), axis());
        assert_eq!(controller.command(0, 0.001, 0.001), FINE);
        controller.tell(1, 0.002, 0.001);
        while let Ok(Some(_)) = controller.hear() {}
        let (_, summary) = record(root.path());
        assert_eq!(summary.status, Ended::Failed);
        assert!(summary.reason.contains(words), "{}", summary.reason);
        assert!(!controller.lost_it(), "a formula in this process");
    }
}
