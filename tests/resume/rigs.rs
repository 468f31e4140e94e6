//! Two rigs, one of which ends the test: where both are, and how the test resumes.

use super::*;
use crate::common::test_file::TestFile;

/// How the link of a rig ends, after a number of commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    Closed,
    NotANumber,
    Panic,
}

/// A spring that reports its position, and keeps it when no controller is connected.
pub struct Rig {
    place: Arc<Mutex<f64>>,
    ends: Option<(u32, End)>,
    told: u32,
    sequence: u64,
    /// It does not report its position.
    is_mute: bool,
}

impl Rig {
    /// A rig that does not report its position, as an actor of OpenFresco.
    fn mute(place: &Arc<Mutex<f64>>) -> Box<dyn Substructure> {
        Box::new(Self {
            place: Arc::clone(place),
            ends: None,
            told: 0,
            sequence: 0,
            is_mute: true,
        })
    }

    pub fn boxed(place: &Arc<Mutex<f64>>, ends: Option<(u32, End)>) -> Box<dyn Substructure> {
        Box::new(Self {
            place: Arc::clone(place),
            ends,
            told: 0,
            sequence: 0,
            is_mute: false,
        })
    }
}

impl Substructure for Rig {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        let place = *self.place.lock().unwrap();
        Ok(Introduction {
            standing: if self.is_mute { vec![] } else { vec![place] },
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        *self.place.lock().unwrap() = command.disp[0];
        (self.sequence, self.told) = (command.sequence, self.told + 1);
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let disp = *self.place.lock().unwrap();
        let end = self.ends.filter(|(at, _)| self.told >= *at);
        let force = match end.map(|(_, end)| end) {
            None => 3e5 * disp,
            Some(End::Closed) => return Err(LinkFault::Closed),
            Some(End::NotANumber) => f64::NAN,
            Some(End::Panic) => panic!("the loop is at fault"),
        };
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (disp, force);
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// Two storeys, each a rig behind a link. 10 ticks of reading, 4 of warm-up, a ramp of 40 where it is one.
pub fn two_rigs(home: &Path, safety: &str) -> PathBuf {
    let rig = |name: &str, storey: u32| {
        let port = 8 + storey;
        format!(
            "[[specimen]]\nname = \"{name}\"\nstorey = {storey}\nstiffness_n_per_m = 3e5\nlink = {{ address = \
             \"127.0.0.1:{port}\", coupling = \"lockstep\", probe = \"none\" }}\n"
        )
    };
    let text = format!(
        "[time]\nrate_hz = 200\nduration_s = 2\nclock = \"simulated\"\n[structure.shear_building]\nmass_kg = [1000, 900]\n\
         stiffness_n_per_m = [0, 0]\n[excitation.ground_acceleration.signal.sine]\namplitude = 4\nfrequency_hz = 1.4\n\
         [timing]\nwarmup_ticks = 4\n[safety]\nunlimited = \"springs\"\nzero_s = 0.05\nramp_s = 0.2\nease_s = 0\n{safety}\n\
         {}{}",
        rig("one", 1),
        rig("other", 2)
    );
    write(home, "test.toml", &text)
}

/// Runs it with these rigs, and with an operator who stops it after `stops_after` ticks.
pub fn run_rigs(
    mut test: gusset_setup::Prepared,
    rigs: [Box<dyn Substructure>; 2],
    out: &Path,
    stops_after: Option<usize>,
) -> session::Finished {
    for (port, rig) in test.experiment.ports.iter_mut().zip(rigs) {
        port.put_recording(rig).unwrap();
        port.startup_mut().set_computed(true);
    }
    let ticks = stops_after.unwrap_or(0);
    let (says, requests) = crossbeam_channel::bounded(ticks + 1);
    for _ in 0..ticks {
        says.send(Operator::Continue).unwrap();
    }
    if stops_after.is_some() {
        says.send(Operator::Stop).unwrap();
    }
    let folder = RunFolder::create(out).unwrap();
    session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap()
}

pub fn built(test: &Path) -> gusset_setup::Prepared {
    let loaded = gusset_config::load(test, &[]).unwrap_or_else(|e| panic!("{e}"));
    gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"))
}

/// Moves the two rigs by hand.
fn put(places: &[Arc<Mutex<f64>>; 2], to: [f64; 2]) {
    for (place, to) in places.iter().zip(to) {
        *place.lock().unwrap() = to;
    }
}

/// The other specimen received its command in the tick in which the first link was lost: it is there, and on record. After a panic
/// it may be there.
#[test]
fn test_resumes_after_one_link_was_lost() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = two_rigs(home.path(), "");
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let put = |to: [f64; 2]| put(&places, to);
    let rigs = |ends| [Rig::boxed(&places[0], ends), Rig::boxed(&places[1], None)];
    let whole = run_rigs(built(&test), rigs(None), &at("whole"), None);
    assert_eq!(whole.cause, Cause::Done);
    for (end, cause, after) in [
        (End::Closed, Cause::Link, false),
        (End::NotANumber, Cause::LinkNotFinite, true),
        (End::Panic, Cause::Internal, false),
    ] {
        let [first, second] = ["first", "second"].map(|name| at(&format!("{name}-{end:?}")));
        put([0.0; 2]);
        let ended = run_rigs(built(&test), rigs(Some((180, end))), &first, None);
        assert_eq!(ended.cause, cause, "{}", ended.summary.reason);
        assert_eq!(ended.summary.left["other"], "stayed");
        let stands = [0, 1].map(|rig: usize| *places[rig].lock().unwrap());
        let (commands, states) = (column(&first, "cmd_2_1"), column(&first, "state"));
        if end == End::Panic {
            assert_ne!(commands.last(), Some(&stands[1]));
        } else {
            assert_eq!(commands.last(), Some(&stands[1]), "{end:?}");
            assert_eq!(states.last(), Some(&Phase::Tripped.code()));
            let found = replay(&first).unwrap();
            assert!(found.is_exact(), "{end:?}: {found:?}");
            assert_eq!(found.rows, states.len() as u64);
        }
        let again = || resume(&first, None, after).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(resume(&first, None, false).is_err(), after, "{end:?}");
        // Further than any record can lack.
        put([stands[0], stands[1] + 0.5]);
        let moved = run_rigs(again(), rigs(None), &at(&format!("moved-{end:?}")), None);
        assert_eq!(moved.cause, Cause::Moved, "{}", moved.summary.reason);
        put(stands);
        let ended = run_rigs(again(), rigs(None), &second, None);
        assert_eq!(ended.cause, Cause::Done, "{}", ended.summary.reason);
        assert_eq!(steps(&[&first, &second]), steps(&[&at("whole")]), "{end:?}");
        let found = replay(&second).unwrap();
        assert!(found.is_exact(), "{end:?}: {found:?}");
    }
}

/// In the shutdown a lost link ends it for both, and both are where the record ends.
#[test]
fn link_lost_in_shutdown_keeps_commands() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let leaves = "at_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.01\n";
    let test = two_rigs(home.path(), leaves);
    // In its first tick, and later.
    for (name, ticks) in [("first", 0), ("later", 7)] {
        let places: [Arc<Mutex<f64>>; 2] = Default::default();
        let ends = Some((151 + ticks, End::Closed));
        let rigs = [Rig::boxed(&places[0], ends), Rig::boxed(&places[1], None)];
        let ended = run_rigs(built(&test), rigs, &at(name), Some(150));
        assert_eq!(ended.cause, Cause::Link, "{}", ended.summary.reason);
        let leaving = column(&at(name), "state");
        let leaving = leaving
            .iter()
            .filter(|state| **state == Phase::Leaving.code());
        assert_eq!(leaving.count(), ticks as usize);
        for (rig, place) in (1..).zip(&places) {
            let commands = column(&at(name), &format!("cmd_{rig}_1"));
            assert_eq!(commands.last(), Some(&*place.lock().unwrap()));
        }
        let found = replay(&at(name)).unwrap();
        assert!(found.is_exact(), "{name}: {found:?}");
        assert_eq!(found.rows, column(&at(name), "state").len() as u64);
    }
}

/// A specimen moved to its end position, and unable to report it: its commands are checked from where it was left.
#[test]
fn mute_specimen_resumes_within_its_limits() {
    for pace in ["every_tick", "every_step"] {
        goes_on_within_its_limits(pace);
    }
}

fn goes_on_within_its_limits(pace: &str) {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = two_rigs(
        home.path(),
        "at_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n",
    );
    let mut text = std::fs::read_to_string(&test).unwrap();
    for specimen in [0, 1] {
        text = text.with(&format!(
            "time.ticks_per_step = 2\n[specimen.{specimen}]\nlink.commands = \"{pace}\"\n\
             limits = {{ command_vel_m_per_s.trip = 1.5, following_error_m.trip = 1e-3 }}"
        ));
    }
    std::fs::write(&test, text).unwrap();
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let rigs = || places.each_ref().map(Rig::mute);
    let whole = run_rigs(built(&test), rigs(), &at("whole"), None);
    assert_eq!(whole.cause, Cause::Done, "{}", whole.summary.reason);
    put(&places, [0.0; 2]);
    let ended = run_rigs(built(&test), rigs(), &at("first"), Some(190));
    assert_eq!(
        ended.summary.left["one"], "reached",
        "{}",
        ended.summary.reason
    );
    let moved = column(&at("first"), "cmd_1_1")
        .iter()
        .fold(0.0, |m: f64, d| m.max(d.abs()));
    assert!(
        moved > 0.01,
        "less than a jump of 1.5 m/s in a step: {moved}"
    );
    let again = resume(&at("first"), None, false).unwrap_or_else(|e| panic!("{e}"));
    let went_on = run_rigs(again, rigs(), &at("second"), None);
    assert_eq!(
        went_on.cause,
        Cause::Done,
        "{pace}: {}",
        went_on.summary.reason
    );
    assert_eq!(
        steps(&[&at("first"), &at("second")]),
        steps(&[&at("whole")])
    );
}

/// A resumed test that was killed, stopped or refused before its first step can be resumed again. Its specimens are where it left
/// them, and the state is that of the test before it.
#[test]
fn resume_works_after_a_failed_startup() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let leaves = "at_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n";
    let test = two_rigs(home.path(), leaves);
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let put = |to: [f64; 2]| put(&places, to);
    let rigs = || places.each_ref().map(|place| Rig::boxed(place, None));
    let again = |from: &str| resume(&at(from), None, false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        run_rigs(built(&test), rigs(), &at("whole"), None).cause,
        Cause::Done
    );
    put([0.0; 2]);
    let ended = run_rigs(built(&test), rigs(), &at("first"), Some(190));
    assert_eq!(ended.cause, Cause::Operator);
    assert_eq!(ended.summary.left["one"], "reached");
    // Copies of this interruption for other specimens, since each resumes once.
    for name in ["same", "third"] {
        copy(&at("first"), &at(name));
    }
    let goes_on = |from: &str, to: &str| {
        let ended = run_rigs(again(from), rigs(), &at(to), None);
        assert_eq!(ended.cause, Cause::Done, "{from}: {}", ended.summary.reason);
        assert_eq!(
            steps(&[&at("first"), &at(to)]),
            steps(&[&at("whole")]),
            "{from}"
        );
        let found = replay(&at(to)).unwrap();
        assert!(found.is_exact(), "{from}: {found:?}");
        let warned = ended.summary.warnings.join("; ");
        assert_eq!(
            warned.contains("during startup"),
            from != "first",
            "{warned}"
        );
        let again = resume(&at(from), None, false).err().unwrap();
        assert!(matches!(again, ResumeError::WentOn { .. }), "{again}");
    };
    goes_on("first", "second");

    // It is killed while it reads, at the beginning of its ramp and in the middle, with a tick that is not on record.
    let states = column(&at("second"), "state");
    let commands = ["cmd_1_1", "cmd_2_1"].map(|name| column(&at("second"), name));
    let ramps = states
        .iter()
        .position(|state| *state == Phase::Ramping.code());
    let ramps = ramps.unwrap();
    assert!(commands[0][ramps + 20].abs() > 1e-4);
    for row in [ramps - 5, ramps, ramps + 1, ramps + 20] {
        let (cut, on) = (format!("cut-{row}"), format!("on-{row}"));
        killed(&at("second"), &at(&cut), row);
        // It is the one that resumed the first, and the others never were.
        std::fs::remove_file(at("first/continued.json")).unwrap();
        put(commands.each_ref().map(|column| column[row]));
        goes_on(&cut, &on);
    }

    // The operator stops it there: it returns, and the next resumed test is killed in its ramp, too.
    put([0.0; 2]);
    let ended = run_rigs(again("same"), rigs(), &at("ended"), Some(35));
    assert_eq!(ended.cause, Cause::Operator);
    assert_eq!(ended.summary.left["one"], "reached");
    let stands = *places[0].lock().unwrap();
    assert_eq!(column(&at("ended"), "cmd_1_1").last(), Some(&stands));
    goes_on("ended", "after-that");
    // The test that resumed that one has also resumed this one.
    let went_on = resume(&at("same"), None, false).err().unwrap().to_string();
    assert!(went_on.contains("after-that, "), "{went_on}");
    killed(&at("after-that"), &at("cut-again"), ramps + 20);
    std::fs::remove_file(at("same/continued.json")).unwrap();
    put(commands.each_ref().map(|column| column[ramps + 20]));
    goes_on("cut-again", "at-last");

    // Somebody has moved it: refused, and a second resume is refused, too.
    for (from, to) in [("third", "refused"), ("refused", "refused-again")] {
        put([5e-3, 0.0]);
        let ended = run_rigs(again(from), rigs(), &at(to), None);
        assert_eq!(ended.cause, Cause::Moved, "{}", ended.summary.reason);
        assert!(ended.summary.reason.contains("left it"));
    }
    put([0.0; 2]);
    goes_on("refused-again", "put-back");
    put([0.5, 0.0]);
    killed(&at("second"), &at("cut-anew"), ramps - 5);
    std::fs::remove_file(at("first/continued.json")).unwrap();
    let ended = run_rigs(again("cut-anew"), rigs(), &at("aside"), None);
    assert_eq!(ended.cause, Cause::Moved, "{}", ended.summary.reason);
}

/// Specimens that remember must not repeat their motion: neither after an end nor after a kill of the test that moved them,
/// wherever its folder is, nor if they returned near to their start. A refused test has moved them nowhere.
#[test]
fn interruption_is_resumed_once() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = two_rigs(home.path(), "");
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let put = |to: [f64; 2]| put(&places, to);
    let rigs = || places.each_ref().map(|place| Rig::boxed(place, None));
    let ended = run_rigs(built(&test), rigs(), &at("first"), Some(190));
    assert_eq!(ended.cause, Cause::Operator);
    let stands = [0, 1].map(|rig: usize| *places[rig].lock().unwrap());
    let mark = at("first/continued.json");
    let again = || resume(&at("first"), None, false);
    let next = || again().unwrap_or_else(|e| panic!("{e}"));

    put([stands[0], stands[1] + 0.5]);
    let ended = run_rigs(next(), rigs(), &at("refused"), None);
    assert_eq!(ended.cause, Cause::Moved, "{}", ended.summary.reason);
    std::fs::remove_dir_all(at("refused")).unwrap();
    assert!(!mark.exists(), "it takes its word back");
    put(stands);
    // A resumed test that cannot record this in the first folder does not begin.
    let test = next();
    std::fs::create_dir(&mark).unwrap();
    let folder = RunFolder::create(&at("unsaid")).unwrap();
    let (_says, requests) = crossbeam_channel::bounded(1);
    let unsaid = session::run(test, folder, requests, Watches::default(), &mut |_| {});
    let unsaid = unsaid.unwrap_err().to_string();
    let told = "run resumes";
    assert!(unsaid.contains(told), "{unsaid}");
    assert!(!at("unsaid").exists());
    std::fs::remove_dir(&mark).unwrap();

    let step = next().experiment.resume.unwrap().step();
    let ended = run_rigs(next(), rigs(), &at("second"), Some(100));
    assert_eq!(ended.cause, Cause::Operator);
    let reached = ended.summary.steps;
    assert!(reached > step + 10);
    put(stands);
    let refusal = |folder: &str, words: &[&str]| {
        let refused = resume(&at(folder), None, false).err().unwrap();
        assert!(matches!(refused, ResumeError::WentOn { .. }), "{refused}");
        let text = refused.to_string();
        for word in words {
            assert!(text.contains(word), "{word}: {text}");
        }
    };
    let after = format!("it was resumed after step {step} in");
    let far = format!("second, as far as step {reached}");
    refusal("first", &[&after, &far, "`--resume "]);
    let found = replay(&at("first")).unwrap();
    assert!(found.is_exact(), "{found:?}");
    for command in ["report", "stop"] {
        let said = say([command, at("first").to_str().unwrap()]);
        assert!(
            matches!(said.code, Some(0 | 2)),
            "{command}: {}",
            said.stderr
        );
    }
    // It ended a while ago, and may be gone: its mark still holds.
    copy(&at("first"), &at("kept/first"));
    std::fs::rename(at("second"), at("elsewhere")).unwrap();
    let gone = "is not there any more";
    refusal("first", &[&after, &far, gone]);
    // Moved together they find each other.
    copy(&at("elsewhere"), &at("kept/second"));
    refusal("kept/first", &[&after, "kept/"]);

    // After a kill only its own record shows how far it came.
    let said = std::fs::read_to_string(&mark).unwrap();
    let unknown = said.replace(&format!("\"reached\": {reached}"), "\"reached\": null");
    assert_ne!(said, unknown);
    std::fs::write(&mark, unknown).unwrap();
    refusal("first", &[&after, "is unknown", gone]);
    let states = column(&at("elsewhere"), "state");
    let begins = states
        .iter()
        .position(|state| *state == Phase::Running.code());
    let begins = begins.unwrap();
    for (row, has_led) in [(begins - 1, false), (begins, false), (begins + 1, true)] {
        let _ = std::fs::remove_dir_all(at("second"));
        killed(&at("elsewhere"), &at("second"), row);
        assert_eq!(again().is_err(), has_led, "{row}");
    }
    refusal("first", &["second, ", "--resume"]);

    // A run that completed the test.
    std::fs::remove_file(&mark).unwrap();
    put(stands);
    let ended = run_rigs(next(), rigs(), &at("rest"), None);
    assert_eq!(ended.cause, Cause::Done, "{}", ended.summary.reason);
    refusal("first", &["rest, ", "new test"]);
}
