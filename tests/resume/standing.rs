//! The position of a specimen behind a link, and the force that it carries there.

use super::*;
use crate::common::test_file::TestFile;

/// A spring behind a private link, whose sensor reads `off` more than its command.
struct Far {
    off: f64,
    damping: f64,
    disp: f64,
    vel: f64,
    sequence: u64,
}

impl Substructure for Far {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.disp, self.sequence) = (command.disp[0], command.sequence);
        self.vel = command.vel[0];
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (
            self.disp + self.off,
            3e5 * self.disp + self.damping * self.vel,
        );
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// The frame whose bottom storey is behind a link, with these keys.
fn linked(keys: &str) -> String {
    let frame = frame(200, 1, 2.0, 0.0).without("specimen.0.law");
    let link = "link = { address = \"127.0.0.1:9\", coupling = \"lockstep\" }";
    frame.with(&format!(
        "{keys}\n[specimen]\nstiffness_n_per_m = 5e5\n{link}\n"
    ))
}

#[test]
fn specimen_at_another_place_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let linked = linked(
        "[safety]\nunlimited = \"a spring\"\non_trip = \"zero_displacement\"\nexit_speed_m_per_s = 0.01\n",
    );
    let test = test_in(home.path(), &linked);
    let far = |off: f64| -> Port {
        let far = Far {
            off,
            damping: 0.0,
            disp: 0.0,
            vel: 0.0,
            sequence: 0,
        };
        PortSpec::new(
            "far",
            Box::new(far),
            2,
            vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 5e5)],
        )
        .build()
        .unwrap()
    };
    let under = |mut test: gusset_setup::Prepared, off: f64, out: &str, words: Vec<Operator>| {
        test.experiment.ports[0].go_live(far(off));
        test.experiment.ports[0].startup_mut().set_computed(true);
        let folder = RunFolder::create(&at(out)).unwrap();
        let (says, requests) = crossbeam_channel::bounded(words.len() + 1);
        for word in words {
            says.send(word).unwrap();
        }
        session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
    };
    let conclude = |test, off, out: &str| under(test, off, out, Vec::new());
    let loaded = gusset_config::load(&test, &[]).unwrap_or_else(|e| panic!("{e}"));
    let whole = gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(conclude(whole, 0.0, "whole").cause, Cause::Done);
    killed(&at("whole"), &at("first"), 400);
    let again = || resume(&at("first"), None, false).unwrap_or_else(|e| panic!("{e}"));
    let ended = conclude(again(), 0.0, "second");
    assert_eq!(ended.cause, Cause::Done, "{}", ended.summary.reason);
    assert_eq!(
        steps(&[&at("first"), &at("second")]),
        steps(&[&at("whole")])
    );
    let found = replay(&at("second")).unwrap();
    assert!(found.is_exact(), "{found:?}");

    killed(&at("whole"), &at("other"), 400);
    let again = || resume(&at("other"), None, false).unwrap_or_else(|e| panic!("{e}"));
    let is_told = |ended: &session::Finished, how: &str| {
        let mut warnings = ended.summary.warnings.iter();
        warnings.any(|text| text.contains("left it") && text.contains(how))
    };
    assert!(!is_told(&ended, ""), "{:?}", ended.summary.warnings);
    let ended = conclude(again(), 1e-5, "near");
    assert_eq!(ended.cause, Cause::Done, "{}", ended.summary.reason);
    assert!(
        is_told(&ended, "within its"),
        "{:?}",
        ended.summary.warnings
    );
    killed(&at("whole"), &at("third"), 400);
    let allowed = Allowed {
        changed: Some("it was moved by hand"),
        ..Allowed::default()
    };
    let accepted = resume_allowed(&at("third"), None, allowed).unwrap_or_else(|e| panic!("{e}"));
    let ended = conclude(accepted, 0.05, "accepted");
    assert!(is_told(&ended, "BEYOND"), "{:?}", ended.summary.warnings);
    killed(&at("whole"), &at("other-again"), 400);
    let again = || resume(&at("other-again"), None, false).unwrap_or_else(|e| panic!("{e}"));
    let ended = conclude(again(), 0.05, "moved");
    assert_eq!(ended.cause, Cause::Moved);
    assert!(
        ended.summary.reason.contains("left it"),
        "{}",
        ended.summary.reason
    );
    let commands = Run::open(&at("moved"))
        .unwrap()
        .columns(&["cmd_1_1"])
        .unwrap();
    let recorded = Run::open(&at("first"))
        .unwrap()
        .columns(&["cmd_1_1"])
        .unwrap();
    assert!(
        commands[0].iter().all(|c| Some(c) == recorded[0].last()),
        "nothing moved"
    );

    // After a clean end everything is known: a tenth of a millimetre is somewhere else.
    let mut words = vec![Operator::Continue; 300];
    words.push(Operator::Stop);
    let whole = gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
    let ended = under(whole, 0.0, "stopped", words);
    assert_eq!(ended.cause, Cause::Operator);
    let again = || resume(&at("stopped"), None, false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        conclude(again(), 1e-4, "aside").cause,
        Cause::Moved,
        "it was moved by 0.1 mm"
    );
    let told = std::fs::read_to_string(at("aside").join("events.jsonl")).unwrap();
    assert!(told.contains("\"event\":\"stands\"") && told.contains("\"event\":\"moved\""));
    assert_eq!(conclude(again(), 0.0, "there").cause, Cause::Done);
}

/// Runs a test with a damper behind its link, to its end.
fn concluded(mut test: gusset_setup::Prepared, out: &Path) -> session::Finished {
    let far = Far {
        off: 0.0,
        damping: 2e4,
        disp: 0.0,
        vel: 0.0,
        sequence: 0,
    };
    let far = PortSpec::new(
        "far",
        Box::new(far),
        2,
        vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 5e5)],
    )
    .build()
    .unwrap();
    test.experiment.ports[0].go_live(far);
    test.experiment.ports[0].startup_mut().set_computed(true);
    let (ask, requests) = crossbeam_channel::bounded(100);
    for _ in 0..100 {
        ask.send(Operator::Confirm).unwrap();
    }
    let folder = RunFolder::create(out).unwrap();
    session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
}

/// The frame whose bottom storey is the damper.
fn damped(home: &Path, safety: &str, specimen: &str) -> gusset_setup::Prepared {
    // A specimen that carries a force only in motion carries another one at rest.
    let safety = format!("[safety]\nunlimited = \"a damper\"\nresume_within_n = 1e6\n{safety}");
    let test = test_in(home, &linked(&format!("{safety}{specimen}")));
    let loaded = gusset_config::load(&test, &[]).unwrap_or_else(|e| panic!("{e}"));
    gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"))
}

/// A damper's force is gone when a killed test resumes: that is no drift of its load cell, and the response is that of a test
/// without an interruption. A user who knows of a drift sets the key before the test.
#[test]
fn force_lost_at_rest_is_not_drift() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    for (zero, takes, key) in [
        ("relative", false, ""),
        ("relative", true, "resume_takes_force_drift = true\n"),
        ("absolute", false, ""),
    ] {
        let [whole, first, second] =
            ["whole", "first", "second"].map(|n| format!("{n}-{zero}-{takes}"));
        let axis = format!("[[specimen.axis]]\nzero_force = \"{zero}\"\n");
        let built = damped(home.path(), key, &axis);
        assert_eq!(concluded(built, &at(&whole)).cause, Cause::Done);
        killed(&at(&whole), &at(&first), 400);
        let next = resume(&at(&first), None, false).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(concluded(next, &at(&second)).cause, Cause::Done);
        let same = steps(&[&at(&first), &at(&second)]) == steps(&[&at(&whole)]);
        assert_eq!(same, !takes);
        let events = Run::open(&at(&second)).unwrap().events().unwrap().to_json();
        let told = events
            .iter()
            .find(|e| e["event"] == "force_changed")
            .unwrap();
        let [left, found] = ["left", "found"].map(|key| told[key].as_f64().unwrap());
        assert!((left - found).abs() > 1.0, "{left} {found}");
        assert_eq!(told["taken_for_drift"], takes);
    }
}

/// The force of a motion is gone at rest: no sensor has jumped.
#[test]
fn readings_at_rest_are_not_checked_to_last() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let free = damped(home.path(), "", "");
    assert_eq!(concluded(free, &at("free")).cause, Cause::Done);
    let forces = column(&at("free"), "raw_force_1_1");
    let steps = forces.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let most = 1.2 * steps.fold(0.0, f64::max);

    let limits = format!("[specimen.limits]\nforce_step_n = {{ trip = {most} }}\n");
    let watched = damped(home.path(), "", &limits);
    assert_eq!(concluded(watched, &at("whole")).cause, Cause::Done);
    killed(&at("whole"), &at("first"), 400);
    let next = resume(&at("first"), None, false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(concluded(next, &at("second")).cause, Cause::Done);
    let events = Run::open(&at("second"))
        .unwrap()
        .events()
        .unwrap()
        .to_json();
    let changed = events.iter().find(|e| e["event"] == "force_changed");
    let [left, found] = ["left", "found"].map(|key| changed.unwrap()[key].as_f64().unwrap());
    assert!((left - found).abs() > most, "{left} {found} {most}");
}

/// It keeps the test's position: the shutdown, which is in its record, is no drift of any sensor.
#[test]
fn relative_zeros_resume_with_the_same_bits() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let text = frame(200, 1, 2.0, 0.0).with(
        "[safety]\nzero_s = 0.05\nat_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n\
         resume_takes_force_drift = true\n[specimen]\n\
         axis = [{ zero_disp = \"relative\", zero_force = \"relative\" }]",
    );
    let test = test_in(home.path(), &text);
    let conclude = |test, out: &str, words: usize| {
        let (says, requests) = crossbeam_channel::bounded(words + 101);
        for _ in 0..100 {
            says.send(Operator::Confirm).unwrap();
        }
        for _ in 0..words {
            says.send(Operator::Continue).unwrap();
        }
        if words > 0 {
            says.send(Operator::Stop).unwrap();
        }
        let folder = RunFolder::create(&at(out)).unwrap();
        session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
    };
    assert_eq!(conclude(rigs::built(&test), "whole", 0).cause, Cause::Done);
    let ended = conclude(rigs::built(&test), "first", 300);
    assert_eq!(ended.cause, Cause::Operator);
    let way = column(&at("first"), "cmd_1_1");
    let furthest = way.iter().fold(0.0, |most: f64, cmd| most.max(cmd.abs()));
    assert!(
        way.last().unwrap().abs() < 1e-3 * furthest,
        "it was led out"
    );

    let next = resume(&at("first"), None, false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(conclude(next, "second", 0).cause, Cause::Done);
    assert_eq!(
        steps(&[&at("first"), &at("second")]),
        steps(&[&at("whole")])
    );
    let [meas, target] = ["meas_1_1", "target_1_1"].map(|name| column(&at("second"), name));
    let off = meas.iter().zip(&target).zip(column(&at("second"), "state"));
    let off = off
        .filter(|(_, state)| *state == 3.0)
        .map(|((m, t), _)| (m - t).abs());
    assert!(off.fold(0.0, f64::max) < 1e-12);
    let found = replay(&at("second")).unwrap();
    assert!(found.is_exact(), "{found:?}");
}
