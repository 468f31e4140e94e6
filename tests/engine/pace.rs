//! Steps of many ticks: the command moves from target to target without a corner, a slow specimen delays no other, and a hold comes
//! to rest and resumes slowly. Whatever the pace, the response does not change, and a replay finds the same bits.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use crate::common::engine::{Run, prepare, run, run_on, run_under};
use crate::common::spring::Spring;
use crate::common::test_file::TestFile;
use gusset_control::engine::{Control, Ending, NOT_AWAITED, Operator, Phase};
use gusset_control::port::{Axis, AxisSpec, Order, PortSpec};
use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::{Nanos, SimClock};
use gusset_record::RunFolder;
use gusset_session::{self as session, Allowed, Watches, replay};

/// Steps of 10 ms, springs of 2e5 N/m on the bottom storey; `ticks` of them.
fn frame(ticks: u32, more: &str) -> String {
    format!(
        "{more}\n[time]\nstep_s = 0.01\nduration_s = 1.5\nclock = \"simulated\"\nticks_per_step = {ticks}\n[integrator]\n\
         lambda = 2\n[structure.shear_building]\nmass_kg = [2e3, 2e3]\nstiffness_n_per_m = [3e5, 3e5]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 1\nphase_rad = 1\n[timing]\n\
         warmup_ticks = 3\n"
    )
}

const SPRING: &str =
    "[[specimen]]\nname = \"near\"\nstorey = 1\nlaw.linear = { stiffness_n_per_m = 2e5 }\n";
const STIFFNESS: f64 = 2e5;

/// Number and test time of every command.
type Commands = Arc<Mutex<Vec<(u64, f64)>>>;

/// A spring whose answer takes some polls: `late[k % n]` for its command k, from 1.
fn slow(late: &[u32]) -> (Spring, Commands) {
    let (late, commands) = (late.to_vec(), Commands::default());
    let heard = Arc::clone(&commands);
    let spring = Spring::new(1e5, move |command| {
        let mut heard = heard.lock().unwrap();
        heard.push((command.sequence, command.time));
    });
    let slow = spring.answering(move |looks, told| looks > late[told % late.len()]);
    (slow, commands)
}

/// The frame with a spring in each storey, the upper one behind a slow link.
fn with_slow(ticks: u32, late: &[u32]) -> (Run, Commands) {
    let mut experiment = prepare(&format!("{}{SPRING}", frame(ticks, ""))).experiment;
    let (slow, commands) = slow(late);
    let axis = Axis::plain(vec![(0, -1.0), (1, 1.0)]);
    let axes = vec![AxisSpec::new(axis, 1e5)];
    let mut spec = PortSpec::new("far", Box::new(slow), 2, axes);
    (spec.per_step, spec.order) = (true, Order::Quadratic);
    experiment.ports.push(spec.build().unwrap());
    (run_on(experiment, SimClock::new()), commands)
}

/// Largest second difference of a series, over its largest value.
fn corner(series: &[f64]) -> f64 {
    let size = series.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let turns = series.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]).abs());
    turns.fold(0.0, f64::max) / size
}

fn count(run: &Run, code: f64) -> usize {
    run.all("state")
        .iter()
        .filter(|state| **state == code)
        .count()
}

#[test]
fn ticks_per_step_change_only_the_command() {
    let plain = run(&format!("{}{SPRING}", frame(1, "")));
    let fine = run(&format!("{}{SPRING}", frame(20, "")));
    for column in ["x1", "x2", "v2", "a1", "force_1_1", "target_1_1", "time"] {
        assert_eq!(fine.column(column), plain.column(column), "{column}");
    }
    assert_eq!(count(&fine, 11.0), 150 * 19);
    let command: Vec<f64> = fine.all("cmd_1_1").into_iter().collect();
    // The response is at most 3.2 Hz (the second mode of the frame). Sampled at 2 kHz a smooth path turns by (2π 3.2/2000)² a tick,
    // 1e-4; four times as much for the cubics between the targets. A ramp with a corner at each target would turn by a whole step's
    // change of slope at once: 20 times (2π 3.2/100)²/20.
    let turn = (std::f64::consts::TAU * 3.2 / 2000.0).powi(2);
    assert!(corner(&command) < 4.0 * turn, "{} {turn}", corner(&command));
    let time = fine.all("time");
    assert!(time.windows(2).all(|w| w[1] >= w[0]));
    // In between, the force is that of the command of that very tick.
    let (raw, force) = (fine.all("raw_force_1_1"), fine.all("cmd_1_1"));
    assert!(raw.iter().zip(&force).all(|(f, d)| *f == STIFFNESS * d));
}

#[test]
fn slow_specimen_delays_no_other() {
    let (quick, commands) = with_slow(10, &[0]);
    // Of 10 ticks a step 9 are between: an answer within 9 looks costs nothing.
    let (within, _) = with_slow(10, &[9, 4, 0]);
    // 13: into the prediction; 17, 40: into the slow-down and a hold.
    let (slow, _) = with_slow(10, &[13, 0, 17, 5, 40, 9, 12]);
    for run in [&quick, &within, &slow] {
        assert_eq!(run.outcome.ending, Ending::Completed);
        assert_eq!(count(run, Phase::Running.code()), 151);
        for column in [
            "x1",
            "x2",
            "v1",
            "a2",
            "force_1_1",
            "force_2_1",
            "target_1_1",
        ] {
            assert_eq!(run.column(column), quick.column(column), "{column}");
        }
    }
    let commands = commands.lock().unwrap();
    let running: Vec<_> = commands.iter().skip(3).collect();
    assert_eq!(
        running.len(),
        151,
        "once a step, after three ticks of warm-up"
    );
    assert!(
        running.windows(2).all(|w| w[1].0 == w[0].0 + 1),
        "no number is skipped"
    );
    // On the way to the first target the specimens already are in place. The 4 polls there are predicted without a loss.
    assert_eq!((count(&within, 12.0), count(&within, 13.0)), (3, 0));
    assert_eq!(within.rows.len(), quick.rows.len());
    assert!(count(&slow, 12.0) > 100 && count(&slow, 13.0) > 100);
    // No specimen moves for more than 0.8 of a step without a target; a corner there would show.
    let (time, step) = (slow.all("time"), slow.all("step"));
    let state = slow.all("state");
    let rows = time.iter().zip(&step).zip(&state);
    for ((time, step), _) in rows.filter(|(_, state)| **state == 13.0) {
        assert!(time / 0.01 - (step + 1.0) <= 0.8 + 1e-9, "{time} {step}");
    }
    let (smooth, eased) = (corner(&quick.all("cmd_1_1")), corner(&slow.all("cmd_1_1")));
    // A stop within one tick would turn by the motion of a tick, 2π 3.2/1000 = 0.02 of the amplitude. The slow-down takes 2 ticks
    // here (0.2 N), and the rest of a step after it, a fifth, is made up for in about 5.
    assert!(smooth < 2e-4 && eased < 0.3 * 0.02, "{eased} {smooth}");
    let pace = |e: &&gusset_record::TimedEvent| matches!(e.kind, gusset_record::Event::Pace { .. });
    assert!(slow.events.iter().filter(pace).count() > 20);
    assert_eq!(within.events.iter().filter(pace).count(), 0);
}

#[test]
fn specimen_that_never_answers_is_lost() {
    let text = frame(10, "");
    let mut experiment = prepare(&text).experiment;
    let (slow, _) = slow(&[u32::MAX]);
    let axis = Axis::plain(vec![(0, 1.0)]);
    let axes = vec![AxisSpec::new(axis, 1e5)];
    let mut spec = PortSpec::new("far", Box::new(slow), 2, axes);
    (spec.per_step, spec.order) = (true, Order::Linear);
    experiment.ports.push(spec.build().unwrap());
    experiment.limits.reply_timeout_ns = 300_000_000;
    let run = run_on(experiment, SimClock::new());
    let Ending::Stopped(stop) = run.outcome.ending else {
        panic!("it goes on");
    };
    assert!(stop.to_string().contains("time limit"));
    // 0.3 s are 300 ticks.
    let waited = run.all("state").iter().filter(|s| **s >= 12.0).count();
    assert!((300..=303).contains(&waited), "{waited}");
}

/// Runs a test while an operator gives a command at each of these ticks.
fn with_words(text: &str, says: Vec<(u64, Operator)>) -> Run {
    let (ask, requests) = crossbeam_channel::bounded(8);
    let mut experiment = prepare(text).experiment;
    let axis = Axis::plain(vec![(0, 1.0)]);
    let mut tick = 0;
    let ear = Spring::new(STIFFNESS, move |_| {
        for (_, word) in says.iter().filter(|(at, _)| *at == tick) {
            ask.send(*word).unwrap();
        }
        tick += 1;
    });
    let port = PortSpec::new(
        "ear",
        Box::new(ear),
        2,
        vec![AxisSpec::new(axis, STIFFNESS)],
    )
    .build();
    experiment.ports.push(port.unwrap());
    run_under(experiment, SimClock::new(), &Control::from(requests))
}

#[test]
fn hold_ramps_keep_the_response() {
    for (ticks, ease) in [(1, 0.3), (10, 0.08)] {
        let eased = frame(ticks, &format!("safety.ease_s = {ease}"));
        let plain = with_words(&eased, vec![]);
        let at = u64::from(60 * ticks);
        let says = vec![(at, Operator::Hold), (at + 200, Operator::Continue)];
        let held = with_words(&eased, says.clone());
        assert_eq!(held.outcome.ending, Ending::Completed);
        for column in ["x1", "x2", "v1", "a2", "force_1_1", "target_1_1", "time"] {
            assert_eq!(held.column(column), plain.column(column), "{column}");
        }
        assert!(count(&held, Phase::Holding.code()) > 100 && count(&held, 13.0) > 5);
        let sudden = with_words(&frame(ticks, "safety.ease_s = 0"), says);
        let largest = |run: &Run| corner(&run.all("cmd_1_1"));
        let (gentle, hard, free) = (largest(&held), largest(&sudden), largest(&plain));
        // With ten ticks a step the stop shows no more; with one it can only go 1, 1/2, 1/3 … of a step a tick.
        let bound = if ticks == 1 { 0.75 * hard } else { 0.4 * hard };
        assert!(
            gentle <= bound.max(1.1 * free),
            "{ticks}: {gentle} {hard} {free}"
        );
        assert!(hard > 1.2 * free || ticks == 1, "{hard} {free}");
    }
}

/// A specimen in the upper storey that is commanded once a step.
fn far(name: &str) -> String {
    format!(
        "[[specimen]]\nname = \"{name}\"\nstorey = 2\nstiffness_n_per_m = 1e5\nlink = {{ address = \"127.0.0.1:{}\", coupling \
         = \"lockstep\", commands = \"every_step\" }}\n",
        // Each specimen has a separate server.
        1000 + name.bytes().map(u32::from).sum::<u32>()
    )
}

/// A recorded test of this text: the delays of its slow specimen are `late`, and the operator gives one of `words` a tick.
fn recorded(home: &Path, late: &[u32], words: &[Operator], ticks: u32) -> PathBuf {
    let safety = "safety.ease_s = 0.05\nsafety.unlimited = \"a spring\"\nsafety.zero_s = 0.01";
    let text = format!("{}{SPRING}{}", frame(ticks, safety), far("far"));
    recorded_of(home, &text, vec![Box::new(slow(late).0)], words)
}

/// A recorded test of this text, whose specimens behind the first are these.
fn recorded_of(
    home: &Path,
    text: &str,
    partners: Vec<Box<dyn Substructure>>,
    words: &[Operator],
) -> PathBuf {
    let path = home.join("test.toml");
    std::fs::write(&path, text).unwrap();
    let loaded = gusset_config::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
    let mut test = gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
    // They are polled as on the real clock; a socket under the simulated clock is not.
    for (port, partner) in test.experiment.ports[1..].iter_mut().zip(partners) {
        port.put_recording(partner).unwrap();
    }
    let folder = RunFolder::create(&home.join("run")).unwrap();
    let (says, requests) = crossbeam_channel::bounded(words.len().max(1));
    for word in words {
        says.send(*word).unwrap();
    }
    session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap();
    home.join("run")
}

#[test]
fn predictions_and_holds_replay_exactly() {
    let home = tempfile::tempdir().unwrap();
    let mut words = vec![Operator::Continue; 400];
    words.extend([Operator::Hold; 120]);
    words.push(Operator::Continue);
    words.extend([Operator::Continue; 30]);
    words.extend([Operator::Hold; 20]);
    words.push(Operator::Continue);
    let run = recorded(home.path(), &[13, 0, 17, 5, 40, 9, 12], &words, 10);
    let states = gusset_record::Run::open(&run)
        .unwrap()
        .columns(&["state"])
        .unwrap();
    for code in [11.0, 12.0, 13.0, Phase::Holding.code()] {
        assert!(states[0].contains(&code), "{code}");
    }
    // The last answer, too, is waited for.
    assert!(states[0].ends_with(&[13.0, Phase::Running.code()]));
    let found = replay(&run).unwrap();
    assert!(found.is_exact(), "{found:?}");
    assert_eq!(found.rows, states[0].len() as u64);
}

/// One specimen falls silent for good; the others wait for it until the test is given up. The resumed test sends it its target once
/// more: the wait is no hold of the operator, in which no target is sent.
#[test]
fn resume_repeats_a_silent_ones_target() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let safety = "safety.ease_s = 0.05\nsafety.unlimited = \"a spring\"\nsafety.zero_s = 0.01";
    let partner = far("far").with("specimen.link.reply_timeout_s = 0.3");
    let text = format!("{}{SPRING}{partner}", frame(10, safety));
    let [whole, silent] = [0, u32::MAX].map(|asked| {
        let home = at(&format!("asked-{asked}"));
        std::fs::create_dir(&home).unwrap();
        recorded_of(&home, &text, vec![Late::boxed(0.4, asked)], &[])
    });
    let read = |run: &Path| gusset_record::Run::open(run).unwrap();
    let states = read(&silent).columns(&["state"]).unwrap();
    assert!(states[0].iter().filter(|state| **state == 13.0).count() > 200);
    for held in [false, true] {
        // Each interruption is gone on with once.
        let silent = {
            let same = at(&format!("silent-{held}"));
            crate::common::copy(&silent, &same);
            same
        };
        let mut test = session::resume_allowed(&silent, None, Allowed::default())
            .unwrap_or_else(|e| panic!("{e}"));
        test.experiment.ports[1]
            .put_recording(Late::boxed(0.4, 0))
            .unwrap();
        let on = at(&format!("on-{held}"));
        // An operator who holds the test from its beginning continues it; a test that never moves on is stopped.
        let mut words = vec![
            if held {
                Operator::Hold
            } else {
                Operator::Continue
            };
            300
        ];
        words.extend(vec![Operator::Continue; 4000]);
        words.push(Operator::Stop);
        let folder = RunFolder::create(&on).unwrap();
        let control = saying(&words);
        session::run(test, folder, control, Watches::default(), &mut |_| {}).unwrap();
        let summary = read(&on).summary().unwrap().clone();
        assert_eq!(format!("{:?}", summary.status), "Completed", "{held}");
        let names = ["state", "step", "x1", "x2", "force_1_1", "force_2_1"];
        let steps = |runs: &[&Path]| {
            let mut all = std::collections::BTreeMap::new();
            for columns in runs.iter().map(|run| read(run).columns(&names).unwrap()) {
                for row in (0..columns[0].len()).filter(|row| columns[0][*row] == 3.0) {
                    let of = |column: &Vec<f64>| column[row].to_bits();
                    all.insert(
                        columns[1][row] as u64,
                        columns.iter().map(of).collect::<Vec<_>>(),
                    );
                }
            }
            all
        };
        assert_eq!(steps(&[&silent, &on]), steps(&[&whole]), "{held}");
        if held {
            // In the hold it gets no command, although its target is known.
            let columns = read(&on).columns(&["hold", "cmd_2_1"]).unwrap();
            let rows = columns[0].iter().zip(&columns[1]);
            let told: Vec<f64> = rows
                .filter(|(hold, _)| **hold == 1.0)
                .map(|(_, to)| *to)
                .collect();
            assert!(told.len() > 200 && told.iter().all(|to| *to == told[0]));
        }
        let found = replay(&on).unwrap();
        assert!(found.is_exact(), "{held}: {found:?}");
    }
}

/// From this test time on, the spring is polled this number of times before it answers.
struct Late {
    spring: Spring,
    from: f64,
    asked: u32,
    time: f64,
}

impl Late {
    fn boxed(from: f64, asked: u32) -> Box<dyn Substructure> {
        Box::new(Self {
            spring: Spring::new(1e5, |_| {}),
            from,
            asked,
            time: 0.0,
        })
    }
}

impl Substructure for Late {
    fn axes(&self) -> usize {
        1
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.time = command.time;
        self.spring.issue(command)
    }
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        if wait_ns > 0 || self.time < self.from || self.asked == 0 {
            return self.spring.is_answered(wait_ns);
        }
        self.asked -= 1;
        Ok(false)
    }
    fn collect(&mut self, until: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.spring.collect(until, into)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// When the operator stops the test, one specimen no longer answers and two are slow. The specimen before them returns at once, a
/// slow one as soon as it has answered, from its position at that time. The test ends with a lost link.
#[test]
fn pending_answer_delays_no_other_shutdown() {
    let home = tempfile::tempdir().unwrap();
    let safety = "safety.unlimited = \"a spring\"\nsafety.zero_s = 0.01\nsafety.at_end = \"zero_displacement\"\n\
                  safety.exit_speed_m_per_s = 0.05";
    let names = ["dead", "slow", "slower"];
    let text = format!("{}{SPRING}{}", frame(10, safety), names.map(far).concat());
    let mut words = vec![Operator::Continue; 400];
    words.push(Operator::Stop);
    let partners = [u32::MAX, 300, 900].map(|asked| Late::boxed(0.2, asked));
    let run = recorded_of(home.path(), &text, partners.into(), &words);
    let read = gusset_record::Run::open(&run).unwrap();
    let summary = read.summary().unwrap();
    assert_eq!(
        format!("{:?}", summary.status),
        "Failed",
        "{}",
        summary.reason
    );
    let left = ["near", "dead", "slow", "slower"].map(|name| summary.left[name].as_str());
    assert_eq!(left, ["reached", "lost", "reached", "reached"]);
    let lost = |event: &&serde_json::Value| event["event"] == "link";
    assert_eq!(
        read.events().unwrap().to_json().iter().filter(lost).count(),
        1
    );
    let names = [
        "state", "cmd_1_1", "cmd_2_1", "cmd_3_1", "cmd_4_1", "status_2",
    ];
    let columns = read.columns(&names).unwrap();
    let leaving = |row: &usize| columns[0][*row] == Phase::Leaving.code();
    let rows: Vec<usize> = (0..columns[0].len()).filter(leaving).collect();
    let moving = |column: usize| {
        let moves = |pair: &&[usize]| columns[column][pair[0]] != columns[column][pair[1]];
        rows.windows(2)
            .filter(moves)
            .map(|pair| pair[1] - rows[0])
            .collect::<Vec<_>>()
    };
    let [near, dead, slow, slower] = [1, 2, 3, 4].map(moving);
    let begins = [&near, &slow, &slower].map(|moves| moves[0]);
    assert!(
        begins[0] <= 1 && (100..=110).contains(&begins[1]),
        "{begins:?}"
    );
    assert!((700..=710).contains(&begins[2]), "{begins:?}");
    assert!(dead.is_empty() && near[near.len() - 1] > begins[1]);
    let forces = read.columns(&["raw_force_4_1"]).unwrap();
    let there = rows[0] + begins[2] - 1;
    let known = 1e5 * columns[4][there];
    assert!(
        known != 0.0 && (forces[0][there] - known).abs() < 1e-9,
        "{known}"
    );
    let is_lost = |row: &&usize| Status(columns[5][**row] as u32).has(Status::LOST);
    assert!(rows.iter().filter(is_lost).count() > 0);
    let found = replay(&run).unwrap();
    assert!(found.is_exact(), "{found:?}");
}

#[test]
fn real_and_simulated_time_have_equal_bits() {
    let home = tempfile::tempdir().unwrap();
    let text = format!("{}{SPRING}", frame(8, "")).with("time.duration_s = 0.4");
    let test = crate::common::write(home.path(), "test.toml", &text);
    let (real, simulated) = (home.path().join("real"), home.path().join("simulated"));
    let mut more = vec!["--clock", "real", "--set", "timing.policy=\"ordinary\""];
    more.extend(crate::common::PATIENT);
    crate::common::completed(&test, &real, &more);
    crate::common::completed(&test, &simulated, &[]);
    crate::common::same_physics(&real, &simulated);
    let said = crate::common::say(["check", test.to_str().unwrap(), "--verbose"]);
    assert!(said.stdout.contains("800 Hz, 8"), "{}", said.stdout);
    let out = home.path().join("out.csv");
    let said = crate::common::say([
        "export",
        real.to_str().unwrap(),
        "--no-units-line",
        "--out",
        out.to_str().unwrap(),
    ]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let lines = std::fs::read_to_string(out).unwrap().lines().count();
    assert_eq!(lines, 1 + 41, "a header and the steps, not the ticks");
}

#[test]
fn a_pace_that_makes_no_sense_is_refused() {
    let link = "[[specimen]]\nname = \"far\"\nstorey = 2\nstiffness_n_per_m = 1e5\nlink = { address = \"h:9\", commands = \
                \"every_step\"";
    for (text, word) in [
        (frame(0, ""), "1 to 10000"),
        (frame(20_000, ""), "1 to 10000"),
        (frame(2, "").with("time.prediction_order = 4"), "1, 2 or 3"),
        (
            format!("{}{link} }}\n", frame(1, "safety.unlimited = \"t\"")),
            "one tick",
        ),
        (
            format!(
                "{}{link}, coupling = \"sampled\" }}\n",
                frame(4, "safety.unlimited = \"t\"")
            ),
            "every tick",
        ),
        (
            format!(
                "{}{link}, coupling = \"lockstep\" }}\n",
                frame(4, "safety.unlimited = \"t\"\n").with("timing.warmup_ticks = 0")
            ),
            "a warm-up",
        ),
        (frame(1, "safety.ease_s = -1"), "negative"),
        (frame(1, "record.checkpoint_s = 0"), "greater than"),
    ] {
        let read = gusset_config::parse(Path::new("test.toml"), text.clone(), &[]);
        let error = read.expect_err(&text).to_string();
        assert!(error.contains(word), "{error}");
    }
}

/// One operator command a tick: a hold of `ticks` after `after` ticks.
fn a_hold(after: usize, ticks: usize) -> Vec<Operator> {
    let mut words = vec![Operator::Continue; after];
    words.extend(vec![Operator::Hold; ticks]);
    words.push(Operator::Continue);
    words
}

/// An operator who gives one of these commands a tick.
fn saying(words: &[Operator]) -> Control {
    let (says, requests) = crossbeam_channel::bounded(words.len().max(1));
    for word in words {
        says.send(*word).unwrap();
    }
    Control::from(requests)
}

/// Largest change from tick to tick.
fn jump(series: &[f64]) -> f64 {
    let steps = series.windows(2).map(|w| (w[1] - w[0]).abs());
    steps.fold(0.0, f64::max)
}

/// The benchmark's first case: an adaptive compensator makes up for 24 ms at 4096 ticks a second, a hundred of them. A pace that
/// falls to a half in one tick must not come a hundred times, nor its square, into the command.
#[test]
fn hold_does_not_kick_compensated_commands() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/vrths-case-1.toml");
    let text = std::fs::read_to_string(config).unwrap();
    let text = text.with("time = { duration_s = 10, clock = 'simulated' }");
    let free = run(&text);
    let words = a_hold(6 * 4096, 3000);
    let held = run_under(prepare(&text).experiment, SimClock::new(), &saying(&words));
    assert_eq!(held.outcome.ending, Ending::Completed);
    // Over 0.25 s it comes to rest.
    assert_eq!(count(&held, Phase::Holding.code()), 3000 - 1024 + 1);
    let (usual, found) = (jump(&free.all("cmd_1_1")), jump(&held.all("cmd_1_1")));
    let target = jump(&free.all("target_1_1"));
    // Its actuator is simulated and lives in test time: a hold only slows its command.
    assert!(found <= 1.02 * usual, "{found} {usual}");
    // The inverse of the actuator at the structure's 3.6 Hz and above has a gain of up to 2.
    assert!(usual < 2.0 * target, "{usual} {target}");
    let (x, y) = (held.column("x1"), free.column("x1"));
    let off = crate::common::engine::distance(&x, &y);
    // The sensors' noise is drawn by ticks, and the coefficients rest for a while.
    assert!(off < 0.01, "{off}");
}

/// The lead of a real actuator's compensator decays during a hold: its command then equals the target.
#[test]
fn compensated_hold_replays_exactly() {
    for (ticks, made) in [
        (1, "polynomial = { order = 3, delay_s = 0.02 }"),
        (10, "ats = { delay_s = 0.02, gain = 0.9 }"),
        (4, "pi_lead = { proportional = 0.3, integral_per_s = 20 }"),
    ] {
        let home = tempfile::tempdir().unwrap();
        let text = format!(
            "{}{SPRING}[specimen.compensation]\n{made}\n",
            frame(ticks, "safety.ease_s = 0.1").with("time.step_s = 0.002")
        );
        let path = crate::common::write(home.path(), "test.toml", &text);
        let loaded = gusset_config::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
        let test = gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
        let folder = RunFolder::create(&home.path().join("run")).unwrap();
        let words = a_hold(250 * ticks as usize, 150 * ticks as usize);
        session::run(
            test,
            folder,
            saying(&words),
            Watches::default(),
            &mut |_| {},
        )
        .unwrap();
        let run = home.path().join("run");
        let columns = ["state", "cmd_1_1", "target_1_1"];
        let columns = gusset_record::Run::open(&run)
            .unwrap()
            .columns(&columns)
            .unwrap();
        let holding = |row: &usize| columns[0][*row] == Phase::Holding.code();
        assert!((0..columns[0].len()).filter(holding).count() > 50 * ticks as usize);
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{made}: {found:?}");
        assert_eq!(found.rows, columns[0].len() as u64);
    }
}

/// A spring that answers at once for a number of waits, and then only after a number of polls.
struct Owing {
    spring: Spring,
    waits_left: u32,
    late: u32,
}

impl Substructure for Owing {
    fn axes(&self) -> usize {
        1
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.spring.issue(command)
    }
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        if wait_ns > 0 && self.waits_left > 0 {
            self.waits_left -= 1;
            return Ok(true);
        }
        self.late = self.late.saturating_sub(1);
        Ok(self.late == 0)
    }
    fn collect(&mut self, until: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.spring.collect(until, into)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// The operator stops while the loop waits for an answer: while zeroing, in the test, in a hold, or in the shutdown that he asked
/// for. The commands of that tick have their own row. Specimens that answered return at once, the others when they answer. A replay
/// repeats all of it.
#[test]
fn stop_during_a_wait_is_replayed() {
    let safety = "safety.ease_s = 0.05\nsafety.unlimited = \"a spring\"\nsafety.zero_s = 0.01\n";
    let leaves = "safety.at_end = \"zero_displacement\"\nsafety.exit_speed_m_per_s = 0.05";
    let mut words = vec![Operator::Continue; 400];
    words.extend([Operator::Hold; 120]);
    let never = u32::MAX;
    let mut ways = std::collections::BTreeSet::new();
    // Per specimen: the number of answers before the late one, and the polls that it takes.
    for (first, second, exits) in [
        ((3, never), (never, 0), ""),
        ((3, never), (never, 0), leaves),
        ((200, never), (never, 0), ""),
        ((200, 2), (never, 0), leaves),
        ((200, 40), (never, 0), leaves),
        ((200, never), (never, 0), leaves),
        ((500, 40), (never, 0), leaves),
        ((500, never), (never, 0), ""),
        ((200, 40), (200, 70), leaves),
        ((200, 40), (201, 70), leaves),
        ((200, 40), (230, 70), leaves),
    ] {
        let home = tempfile::tempdir().unwrap();
        let names = ["far", "farther"].map(|name| far(name).without("specimen.0.link.commands"));
        let text = format!(
            "{}{SPRING}{}",
            frame(10, &format!("{safety}{exits}")),
            names.concat()
        );
        let partners = [first, second].map(|(waits_left, late)| {
            Box::new(Owing {
                spring: Spring::new(1e5, |_| {}),
                waits_left,
                late,
            }) as Box<dyn Substructure>
        });
        let run = recorded_of(home.path(), &text, partners.into(), &words);
        let case = format!("{first:?} {second:?} {exits}");
        let read = gusset_record::Run::open(&run).unwrap();
        let columns = read.columns(&["state", "status_2", "cmd_1_1"]).unwrap();
        let end = columns[0].iter().position(|state| *state == NOT_AWAITED);
        let end = end.unwrap_or_else(|| panic!("{case}"));
        assert!(Status(columns[1][end] as u32).has(Status::OWED), "{case}");
        ways.insert((columns[0][end - 1] as u32, end + 1 < columns[0].len()));
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{case}: {found:?}");
        assert_eq!(found.rows, columns[0].len() as u64, "{case}");
    }
    let states = [Phase::Zeroing, Phase::Holding].map(|phase| phase.code() as u32);
    assert!(states.iter().all(|state| ways.contains(&(*state, false))));
    // Between two steps of the test, followed by the shutdown.
    assert!(
        ways.contains(&(11, true)) || ways.contains(&(12, true)),
        "{ways:?}"
    );
}

/// The call at which a specimen is found to be lost.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Call {
    Accepted,
    Attend,
    Pause,
}

/// A spring whose link is lost at the n-th call of a kind, and stays lost.
struct Mortal {
    spring: Spring,
    dies_at: Call,
    calls_left: u32,
}

impl Mortal {
    fn lives(&mut self, call: Call) -> Result<(), LinkFault> {
        if call == self.dies_at && self.calls_left > 0 {
            self.calls_left -= 1;
        }
        if self.calls_left == 0 {
            return Err(LinkFault::Closed);
        }
        Ok(())
    }
}

impl Substructure for Mortal {
    fn axes(&self) -> usize {
        1
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.spring.issue(command)
    }
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.spring.is_answered(wait_ns)
    }
    fn collect(&mut self, until: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.spring.collect(until, into)
    }
    fn accepted(&mut self, _: u64) -> Result<(), LinkFault> {
        self.lives(Call::Accepted)
    }
    fn attend(&mut self) -> Result<(), LinkFault> {
        self.lives(Call::Attend)
    }
    fn pause(&mut self) -> Result<(), LinkFault> {
        self.lives(Call::Pause)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// The link fails between an answer and the next target, in a hold, as one begins, or when its answer was taken. The replay moves
/// the other specimens alike; where none moves, the last commands are in a row.
#[test]
fn loss_outside_an_exchange_is_replayed() {
    let freezes = "safety.ease_s = 0.05\nsafety.unlimited = \"a spring\"\nsafety.zero_s = 0.01\n";
    let leaves = "safety.on_trip = \"zero_displacement\"\nsafety.exit_speed_m_per_s = 0.05";
    let mut words = vec![Operator::Continue; 400];
    words.extend([Operator::Hold; 120]);
    let by_ticks = far("far").without("specimen.0.link.commands");
    for (dies_at, calls, partner, exits) in [
        (Call::Attend, 120, far("far"), leaves),
        (Call::Attend, 121, far("far"), leaves),
        (Call::Attend, 500, far("far"), leaves),
        (Call::Attend, 121, far("far"), ""),
        (Call::Attend, 500, far("far"), ""),
        (Call::Pause, 1, far("far"), leaves),
        (Call::Accepted, 300, by_ticks.clone(), leaves),
        (Call::Accepted, 301, by_ticks.clone(), leaves),
        (Call::Accepted, 301, by_ticks, ""),
    ] {
        let home = tempfile::tempdir().unwrap();
        let text = format!(
            "{}{SPRING}{partner}",
            frame(10, &format!("{freezes}{exits}"))
        );
        let mortal = Mortal {
            spring: slow(&[0]).0,
            dies_at,
            calls_left: calls,
        };
        let run = recorded_of(home.path(), &text, vec![Box::new(mortal)], &words);
        let read = gusset_record::Run::open(&run).unwrap();
        let columns = read.columns(&["state", "status_2"]).unwrap();
        let of = |row: usize| (columns[0][row], Status(columns[1][row] as u32));
        let lost = (0..columns[0].len()).find(|row| of(*row).1.has(Status::LOST));
        let (state, _) = of(lost.unwrap());
        assert_eq!(state, Phase::Tripped.code(), "{dies_at:?} {calls}");
        let end = if exits.is_empty() {
            Phase::Tripped
        } else {
            Phase::Leaving
        };
        assert_eq!(columns[0].last(), Some(&end.code()));
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{dies_at:?} {calls}: {found:?}");
        assert_eq!(found.rows, columns[0].len() as u64);
    }
}
