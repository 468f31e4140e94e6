//! A recorded test is replayed bit for bit, from its folder alone; every change in it is found and named.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::change;
use gusset_control::engine::{Operator, OperatorCommands, Phase};
use gusset_record::{Run, RunFolder};
use gusset_session::{self as session, Watches, replay};

const FRAME: &str = r#"
title = "replayed"
[time]
rate_hz = 512
duration_s = 3
clock = "simulated"
[structure]
static_load_n = [10e3, 5e3]
initial_displacement_m = [0.002, 0.003]
[structure.shear_building]
mass_kg = [20e3, 18e3]
stiffness_n_per_m = [0, 14e6]
[structure.damping.rayleigh_ratio]
ratio = 0.02
modes = [1, 2]
[excitation.ground_acceleration.signal.file]
path = "motion.csv"
unit = "m/s2"
[[specimen]]
name = "s"
storey = 1
law = { bouc_wen = { stiffness_n_per_m = 15e6, yield_force_n = 60e3, post_yield_ratio = 0.08, beta = 0.55, gamma = 0.45,
        exponent = 1.6 } }
[safety]
zero_s = 0.02
ramp_s = 0.1
ease_s = 0.0
[timing]
warmup_ticks = 7
"#;

/// A test file with its motion beside it.
fn test_in(home: &Path, more: &str) -> PathBuf {
    let motion: String = (0..1500)
        .map(|k| {
            let t = f64::from(k) * 0.002;
            format!("{t:.3},{:.6}\n", 4.0 * libm::sin(9.0 * t) * libm::exp(-t))
        })
        .collect();
    std::fs::write(home.join("motion.csv"), format!("t,a\n{motion}")).unwrap();
    let path = home.join("test.toml");
    std::fs::write(&path, format!("{FRAME}{more}")).unwrap();
    path
}

/// Runs it while an operator gives these commands, one a tick from the first tick on.
fn record(home: &Path, words: &[Operator]) -> PathBuf {
    record_of(&test_in(home, ""), words)
}

fn record_of(test: &Path, words: &[Operator]) -> PathBuf {
    let loaded = gusset_config::load(test, &[]).unwrap_or_else(|e| panic!("{e}"));
    let test = gusset_setup::build(&loaded).unwrap_or_else(|e| panic!("{e}"));
    let path = loaded.path.with_file_name("run");
    let folder = RunFolder::create(&path).unwrap();
    let (says, requests) = crossbeam_channel::bounded(words.len().max(1));
    for word in words {
        says.send(*word).unwrap();
    }
    session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap();
    path
}

fn gusset(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gusset"))
        .args(args)
        .output()
        .unwrap()
}

#[test]
fn replay_works_wherever_the_folder_is() {
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &[]);
    let elsewhere = tempfile::tempdir().unwrap();
    let moved = elsewhere.path().join("moved");
    std::fs::rename(&run, &moved).unwrap();
    drop(home);
    let found = replay(&moved).unwrap();
    assert!(found.is_exact(), "{found:?}");
    let read = Run::open(&moved).unwrap();
    let rows = read.columns(&["state"]).unwrap()[0].len();
    assert_eq!(found.rows, rows as u64);
    assert!(rows > 1537 + 10, "those before t = 0 too");
}

/// No machine makes a step of 40 000 masses in 20 µs: the test does not begin, and its specimen returns from there.
#[test]
fn unstarted_test_is_replayed() {
    const SLOW: &str = r#"
title = "slow"
[time]
rate_hz = 50000
duration_s = 0.01
[structure.chain]
dofs = 40000
mass_kg = 150
stiffness_n_per_m = 2.5e5
damping_n_s_per_m = 10
[excitation.base_displacement.signal.sine]
amplitude = 0.1
frequency_hz = 1
[timing]
policy = "ordinary"
[[specimen]]
name = "first"
storey = 1
law.linear = { stiffness_n_per_m = 2.5e4 }
"#;
    for exit in [
        "",
        "[safety]\non_trip = \"zero_displacement\"\nexit_speed_m_per_s = 0.01\n",
    ] {
        let home = tempfile::tempdir().unwrap();
        let test = home.path().join("test.toml");
        std::fs::write(&test, format!("{SLOW}{exit}")).unwrap();
        let path = record_of(&test, &[]);
        let run = Run::open(&path).unwrap();
        let reason = &run.summary().unwrap().reason;
        assert!(reason.contains("not begun"), "{reason}");
        let events = run.events().unwrap().to_json();
        let named = |name: &str| events.iter().filter(|event| event["event"] == name).count();
        assert_eq!([named("no_go"), named("go"), named("started")], [1, 0, 0]);
        let found = replay(&path).unwrap();
        assert!(found.is_exact(), "{exit}: {found:?}");
        let rows = run.columns(&["state"]).unwrap()[0].len() as u64;
        assert!(
            rows >= 200 && found.rows == rows,
            "{exit}: {rows} {found:?}"
        );
    }
}

#[test]
fn holds_happen_again_where_they_happened() {
    for before in [0, 1, 2, 40] {
        // Commands without effect: a hold is continued, and `continue` is repeated without a hold.
        let mut words = vec![Operator::Continue; before + 800];
        words.extend([Operator::Hold; 30]);
        words.push(Operator::Continue);
        words.extend([Operator::Continue; 12]);
        words.extend([Operator::Hold; 5]);
        words.push(Operator::Continue);
        let home = tempfile::tempdir().unwrap();
        let run = record(home.path(), &words);
        let states = Run::open(&run).unwrap().columns(&["state"]).unwrap();
        let held = states[0].iter().filter(|s| **s == Phase::Holding.code());
        assert_eq!(held.count(), 35);
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{before}: {found:?}");
        assert_eq!(found.rows, states[0].len() as u64);
    }
}

/// During zeroing, during the static load, and in the ramp after it.
#[test]
fn holds_before_the_test_are_replayed() {
    let rows = |run: &Path| Run::open(run).unwrap().columns(&["state"]).unwrap();
    let home = tempfile::tempdir().unwrap();
    let free = rows(&record(home.path(), &[]))[0].len();
    for at in (3..400).step_by(33) {
        let mut words = vec![Operator::Continue; at];
        words.extend([Operator::Hold; 20]);
        words.push(Operator::Continue);
        let home = tempfile::tempdir().unwrap();
        let run = record(home.path(), &words);
        assert!(rows(&run)[0].len() >= free + 10, "{at}");
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{at}: {found:?}");
    }
}

#[test]
fn stopped_test_is_proven_as_far_as_it_went() {
    let mut words = vec![Operator::Continue; 700];
    words.push(Operator::Stop);
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &words);
    let found = replay(&run).unwrap();
    assert!(found.is_exact(), "{found:?}");
    let steps = Run::open(&run).unwrap().summary().unwrap().steps;
    assert!(steps > 100 && steps < 1536, "{steps}");
}

/// Stopped between two steps, it returns from there. Older recordings begin their shutdown at the end of the last step.
#[test]
fn shutdown_between_two_steps_is_replayed() {
    let (mut between, mut at_ends) = (0, 0);
    for words in 700..704 {
        let home = tempfile::tempdir().unwrap();
        let test = test_in(home.path(), "");
        let text = FRAME.replace("512\n", "512\nticks_per_step = 4\n").replace(
            "ease_s = 0.0\n",
            "ease_s = 0.0\nat_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.5\n",
        );
        std::fs::write(&test, text).unwrap();
        let mut words = vec![Operator::Continue; words];
        words.push(Operator::Stop);
        let run = record_of(&test, &words);
        assert!(replay(&run).unwrap().is_exact());
        let columns = Run::open(&run).unwrap();
        let columns = columns.columns(&["state", "step", "sub_tick", "time"]);
        let [state, step, sub_tick, time] = &columns.unwrap()[..] else {
            panic!("four columns")
        };
        assert!(time.is_sorted());
        let leaving = |row: &usize| state[*row] == Phase::Leaving.code();
        let leaving: Vec<usize> = (0..state.len()).filter(leaving).collect();
        let last = *leaving.last().unwrap();
        if sub_tick[last] == 0.0 {
            at_ends += 1;
            continue;
        }
        between += 1;
        for row in leaving {
            change(&run, row as u64, "sub_tick", 0.0);
            change(&run, row as u64, "time", step[row] / 512.0);
        }
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{found:?}");
        change(&run, last as u64, "time", time[last] - 1e-4);
        let difference = replay(&run).unwrap().difference.unwrap();
        assert_eq!(difference.row, last as u64);
    }
    assert_eq!((between, at_ends), (3, 1));
}

/// A trip while zeroing, and one in the shutdown: the row that trips is the last, and the replay repeats it.
#[test]
fn trip_outside_the_test_is_replayed() {
    for (more, led) in [
        (
            "[specimen.limits]\nmeasured_disp_m = { trip = [1e-3, 1.0] }\n",
            false,
        ),
        (
            "safe_disp_m = [0.3]\n[specimen.limits]\nmeasured_disp_m = { trip = [-0.2, 0.2] }\n",
            true,
        ),
    ] {
        let home = tempfile::tempdir().unwrap();
        let text = FRAME
            .replace("[safety]\n", &format!("{more}[safety]\n"))
            .replace(
                "ease_s = 0.0\n",
                "ease_s = 0.0\nat_end = \"safe_displacement\"\nexit_speed_m_per_s = 0.5\n",
            );
        let text = if led {
            text
        } else {
            text.replace("at_end = \"safe_displacement\"\n", "")
        };
        let test = test_in(home.path(), "");
        std::fs::write(&test, text).unwrap();
        let run = home.path().join("run");
        let said = gusset(&[
            "run",
            test.to_str().unwrap(),
            "--out",
            run.to_str().unwrap(),
        ]);
        let told = String::from_utf8_lossy(&said.stderr);
        assert_eq!(said.status.code(), Some(1), "{told}");
        let states = Run::open(&run).unwrap().columns(&["state"]).unwrap();
        let before = if led { Phase::Leaving } else { Phase::Zeroing };
        let last: Vec<f64> = states[0].iter().rev().take(2).copied().collect();
        assert_eq!(last[0], Phase::Tripped.code());
        assert!(
            last.get(1).is_none_or(|state| *state == before.code()),
            "{last:?}"
        );
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{found:?}");
    }
}

/// A test that was never confirmed is not taken for one that was, and the other way round. Only the operator's command in the row
/// distinguishes a refused first command from a trip in the wait. The first tick of the wait is that of the command after eleven.
#[test]
fn confirmation_is_in_the_record() {
    use Operator::{Confirm, Continue, Stop};
    let refusing = "[specimen.limits]\ncommand_disp_m = { trip = [-1.0, 1e-9] }\n[safety]\n";
    for (waits, says, refused) in [
        (0, [Continue, Confirm], false),
        (9, [Continue, Confirm], false),
        (9, [Continue, Confirm], true),
        (0, [Confirm, Continue], false),
        (9, [Confirm, Continue], false),
        (9, [Continue, Continue], false),
        (9, [Continue, Stop], false),
    ] {
        let home = tempfile::tempdir().unwrap();
        let mut text = FRAME.replace("ramp_s", "confirm = true\nramp_s");
        if refused {
            text = text.replace("[safety]\n", refusing);
            text = text.replace("static_load_n = [10e3, 5e3]\n", "");
        }
        let test = test_in(home.path(), "");
        std::fs::write(&test, &text).unwrap();
        // During zeroing, and in the wait: neither a hold nor its end is a confirmation.
        let mut words = vec![Operator::Hold; 11 + waits];
        words.extend(says);
        let place = says.iter().position(|word| *word == Confirm);
        if place.is_none() {
            words.push(Stop);
        }
        let run = record_of(&test, &words);
        let read = Run::open(&run)
            .unwrap()
            .columns(&["state", "hold", "operator"]);
        let [states, said, commands] = <[_; 3]>::try_from(read.unwrap()).unwrap();
        let found = replay(&run).unwrap();
        assert!(found.is_exact(), "{waits}, {says:?}: {found:?}");
        assert_eq!(found.rows, states.len() as u64);
        let confirms =
            |commands: &f64| OperatorCommands::of(*commands).has(OperatorCommands::CONFIRM);
        let confirmed = commands.iter().position(confirms);
        assert_eq!(confirmed, place.map(|place| 11 + waits + place));
        let Some(confirmed) = confirmed else {
            continue;
        };
        assert!(said[..11 + waits].iter().all(|word| *word == 1.0));
        assert_eq!(states[confirmed], Phase::Zeroing.code());
        assert_eq!(states.len() == confirmed + 1, refused);
        change(&run, confirmed as u64, "operator", 0.0);
        let found = replay(&run).unwrap();
        assert!(found.difference.is_some(), "{found:?}");
    }
}

#[test]
fn the_first_number_that_differs_is_named() {
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &[]);
    let states = Run::open(&run).unwrap().columns(&["state"]).unwrap();
    let start = states[0].iter().position(|s| *s == Phase::Running.code());
    let row = start.unwrap() as u64 + 300;
    change(&run, row, "x2", 0.125);
    let found = replay(&run).unwrap();
    let difference = found.difference.clone().unwrap();
    assert_eq!((difference.row, difference.step), (row, 300));
    assert_eq!(difference.column, "x2");
    assert_eq!((difference.recorded, found.rows), (0.125, row));
    let said = gusset(&["replay", run.to_str().unwrap()]);
    assert_eq!(said.status.code(), Some(1));
    let text = String::from_utf8_lossy(&said.stdout);
    assert!(text.contains("`x2` was 1.25e-1"), "{text}");
}

#[test]
fn changed_state_is_found_at_its_checkpoint() {
    let home = tempfile::tempdir().unwrap();
    let test = test_in(home.path(), "[record]\ncheckpoint_s = 0.5\n");
    let run = record_of(&test, &[]);
    assert!(replay(&run).unwrap().is_exact());
    let path = run.join("events.jsonl");
    let mut text = std::fs::read_to_string(&path).unwrap();
    let at = text.find("\"digest\":\"").unwrap() + "\"digest\":\"".len();
    let other = if text[at..].starts_with('0') {
        "1"
    } else {
        "0"
    };
    text.replace_range(at..=at, other);
    std::fs::write(&path, text).unwrap();
    let difference = replay(&run).unwrap().difference.unwrap();
    assert_eq!(difference.column, "checkpoint");
}

/// Whichever number is computed, from the first column on.
#[test]
fn the_last_bit_of_a_number_is_compared() {
    let home = tempfile::tempdir().unwrap();
    let path = record(home.path(), &[]);
    let run = Run::open(&path).unwrap();
    let states = run.columns(&["state"]).unwrap();
    let row = states[0].iter().position(|s| *s == Phase::Running.code());
    let row = row.unwrap() + 300;
    for name in [
        "step",
        "time",
        "x1",
        "x2",
        "a1",
        "target_1_1",
        "cmd_1_1",
        "force_1_1",
    ] {
        let was = run.columns(&[name]).unwrap()[0][row];
        change(&path, row as u64, name, f64::from_bits(was.to_bits() ^ 1));
        let difference = replay(&path).unwrap().difference.unwrap();
        assert_eq!(
            (difference.row, difference.column.as_str()),
            (row as u64, name)
        );
        change(&path, row as u64, name, was);
    }
    assert!(replay(&path).unwrap().is_exact());
}

#[test]
fn changed_force_shows_in_its_consequences() {
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &[]);
    let rows = Run::open(&run).unwrap().columns(&["state"]).unwrap()[0].len() as u64;
    change(&run, rows - 100, "raw_force_1_1", 1e3);
    let difference = replay(&run).unwrap().difference.unwrap();
    assert_eq!(
        (difference.row, difference.column.as_str()),
        (rows - 100, "a1")
    );
}

#[test]
fn damage_or_a_foreign_file_ends_the_proof() {
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &[]);
    let text = run.to_str().unwrap();
    assert_eq!(gusset(&["replay", text]).status.code(), Some(0));

    let samples = run.join("samples.bin");
    let whole = std::fs::read(&samples).unwrap();
    let mut damaged = whole.clone();
    damaged[whole.len() / 2] ^= 4;
    std::fs::write(&samples, &damaged).unwrap();
    let said = gusset(&["replay", text]);
    assert_eq!(said.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&said.stdout).contains("is damaged"));
    std::fs::write(&samples, &whole[..whole.len() - 3]).unwrap();
    assert_eq!(gusset(&["replay", text]).status.code(), Some(1));
    std::fs::write(&samples, &whole).unwrap();

    // Another structure than the one that was tested.
    let resolved = run.join("resolved.toml");
    let before = std::fs::read_to_string(&resolved).unwrap();
    std::fs::write(
        &resolved,
        before.replace("18e3", "18.5e3").replace("18000", "18500"),
    )
    .unwrap();
    let said = gusset(&["replay", text]);
    assert_eq!(said.status.code(), Some(2), "{said:?}");
    let told = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(told.contains("resolved.toml was changed"), "{told}");
    // Without any description, the rows show it.
    let events = run.join("events.jsonl");
    let told = std::fs::read_to_string(&events).unwrap();
    let silent = told
        .lines()
        .filter(|line| !line.contains("\"event\":\"files\""));
    let silent: String = silent.map(|line| format!("{line}\n")).collect();
    std::fs::write(&events, silent).unwrap();
    let said = gusset(&["replay", text]);
    assert_eq!(said.status.code(), Some(1), "{said:?}");
    assert!(String::from_utf8_lossy(&said.stderr).contains("not proven"));
    std::fs::write(&events, &told).unwrap();
    std::fs::write(&resolved, &before).unwrap();

    let inputs = std::fs::read_dir(run.join("inputs")).unwrap();
    let copy = inputs.map(|entry| entry.unwrap().path()).next().unwrap();
    let kept = std::fs::read_to_string(&copy).unwrap();
    std::fs::write(&copy, kept.replacen("0.9", "0.8", 1)).unwrap();
    let said = gusset(&["replay", text]);
    assert_eq!(said.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&said.stderr).contains("SHA-256"));
}

/// Copies the run, spoils the copy, and replays it; returns the exit code and the output.
fn spoilt(run: &Path, spoil: impl FnOnce(&Path)) -> (i32, String) {
    let home = tempfile::tempdir().unwrap();
    let copy = home.path().join("copy");
    crate::common::copy(run, &copy);
    spoil(&copy);
    let said = gusset(&["replay", copy.to_str().unwrap()]);
    let (out, error) = (
        String::from_utf8(said.stdout).unwrap(),
        String::from_utf8(said.stderr).unwrap(),
    );
    assert!(!error.contains("panicked"), "{error}");
    (said.status.code().unwrap(), format!("{out}{error}"))
}

#[test]
fn too_few_whole_rows_are_no_proof() {
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &[]);
    let layout = Run::open(&run).unwrap().layout().clone();
    let keep = |rows: usize| {
        move |copy: &Path| {
            let path = copy.join("samples.bin");
            let bytes = std::fs::read(&path).unwrap();
            std::fs::write(path, &bytes[..rows * layout.stride()]).unwrap();
        }
    };
    let (code, said) = spoilt(&run, keep.clone()(400));
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("400 rows") && said.contains("1536 steps"),
        "{said}"
    );
    let (code, said) = spoilt(&run, keep(0));
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("is proven") && said.contains("no rows"),
        "{said}"
    );
    // The end of a killed run is unknown: it is proven as far as it went.
    let unfinished = |copy: &Path| std::fs::remove_file(copy.join("summary.json")).unwrap();
    assert_eq!(spoilt(&run, unfinished).0, 0);
}

#[test]
fn foreign_folder_is_refused_in_words() {
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &[]);
    let remove = |name: &'static str| {
        move |copy: &Path| {
            let path = copy.join(name);
            if path.is_dir() {
                std::fs::remove_dir_all(path).unwrap();
            } else {
                std::fs::remove_file(path).unwrap();
            }
        }
    };
    let put = |name: &'static str, bytes: &'static [u8]| {
        move |copy: &Path| std::fs::write(copy.join(name), bytes).unwrap()
    };
    let edit = |name: &'static str, from: &'static str, to: &'static str| {
        move |copy: &Path| {
            let text = std::fs::read_to_string(copy.join(name)).unwrap();
            assert!(text.contains(from), "{text}");
            std::fs::write(copy.join(name), text.replacen(from, to, 1)).unwrap();
        }
    };
    let everything = |copy: &Path| {
        std::fs::remove_dir_all(copy).unwrap();
        std::fs::create_dir(copy).unwrap();
    };
    let foreign = |copy: &Path| {
        std::fs::remove_dir_all(copy).unwrap();
        std::fs::create_dir(copy).unwrap();
        std::fs::write(copy.join("holiday.jpg"), b"JFIF").unwrap();
    };
    // A folder of a version whose events do not describe the columns.
    let of_before = |copy: &Path| {
        let path = copy.join("events.jsonl");
        let text = std::fs::read_to_string(&path).unwrap();
        let (before, after) = text.split_once(",\"samples.json\":\"").unwrap();
        let after = after.split_once('"').unwrap().1;
        std::fs::write(path, format!("{before}{after}")).unwrap();
    };
    assert_eq!(spoilt(&run, of_before).0, 0);
    type Spoil<'a> = Box<dyn FnOnce(&Path) + 'a>;
    let cases: Vec<(Spoil<'_>, &[&str])> = vec![
        (
            Box::new(|copy: &Path| std::fs::remove_dir_all(copy).unwrap()),
            &["does not exist"],
        ),
        (
            Box::new(everything),
            &["is empty: no run was recorded there"],
        ),
        (Box::new(foreign), &["is not a run folder"]),
        (Box::new(remove("samples.json")), &["has no samples.json"]),
        (
            Box::new(remove("samples.bin")),
            &["samples.bin: No such file"],
        ),
        (
            Box::new(remove("resolved.toml")),
            &["resolved.toml: No such file"],
        ),
        (
            Box::new(remove("inputs")),
            &["inputs/motion.csv: No such file"],
        ),
        (
            Box::new(put("samples.json", b"{\"a\":")),
            &["samples.json: not a description of samples"],
        ),
        (
            Box::new(put("resolved.toml", b"\xff\xfe")),
            &["resolved.toml is not UTF-8"],
        ),
        (
            Box::new(put("resolved.toml", b"[time\n")),
            &["not valid TOML", "resolved.toml:1"],
        ),
        (
            Box::new(edit("samples.json", "\"x1\"", "\"y1\"")),
            &["samples.json was changed"],
        ),
        (
            Box::new(edit("samples.json", "\"unit\": \"m\"", "\"unit\": \"k\"")),
            &["samples.json was changed"],
        ),
        (
            Box::new(|copy: &Path| {
                of_before(copy);
                edit("samples.json", "\"x1\"", "\"y1\"")(copy);
            }),
            &["have y1", "makes x1", "not of one test"],
        ),
        (
            Box::new(edit("resolved.toml", "[time]", "[time]\nrate = 3")),
            &["unknown key `rate`", "did you mean"],
        ),
        (
            Box::new(edit("resolved.toml", "storey = 1", "storey = 7")),
            &["storey = 7", "no such storey"],
        ),
    ];
    for (spoil, words) in cases {
        let (code, said) = spoilt(&run, spoil);
        assert_eq!(code, 2, "{words:?}: {said}");
        assert!(said.starts_with("error: "), "{said}");
        for word in words {
            assert!(said.contains(word), "{word}: {said}");
        }
    }
    // The rows of another test of the same shape: whole, in order, and not what comes out.
    let other = tempfile::tempdir().unwrap();
    let loaded = gusset_config::load(
        &test_in(other.path(), ""),
        &["structure.initial_displacement_m=[0.001,0.001]".to_owned()],
    );
    let test = gusset_setup::build(&loaded.unwrap_or_else(|e| panic!("{e}"))).unwrap();
    let path = other.path().join("run");
    let folder = RunFolder::create(&path).unwrap();
    let nobody = crossbeam_channel::never();
    session::run(test, folder, nobody, Watches::default(), &mut |_| {}).unwrap();
    let (code, said) = spoilt(&run, |copy| {
        std::fs::copy(path.join("samples.bin"), copy.join("samples.bin")).unwrap();
    });
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("comes out"), "{said}");
    // Noise in place of rows.
    let noise: Vec<u8> = (0..10_000u32)
        .map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    let (code, said) = spoilt(&run, |copy| {
        std::fs::write(copy.join("samples.bin"), &noise).unwrap()
    });
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("row 0"), "{said}");
}

/// A test that a limit of its specimen stopped.
fn tripped(home: &Path) -> PathBuf {
    let limits = "[specimen.limits]\ncommand_disp_m = { trip = [-4e-3, 4e-3] }\n";
    record_of(&test_in(home, limits), &[])
}

/// The verdict of `replay --json` and `report` on a run with another summary: exit codes, differing keys, and the headline.
fn judged(
    run: &Path,
    edit: impl FnOnce(&mut serde_json::Value),
) -> ([Option<i32>; 2], Vec<String>, String) {
    let original = std::fs::read(run.join("summary.json")).unwrap();
    let mut summary = serde_json::from_slice(&original).unwrap();
    edit(&mut summary);
    std::fs::write(run.join("summary.json"), summary.to_string()).unwrap();
    let replayed = gusset(&["replay", "--json", run.to_str().unwrap()]);
    let reported = gusset(&["report", run.to_str().unwrap()]);
    std::fs::write(run.join("summary.json"), original).unwrap();
    let told: serde_json::Value = serde_json::from_slice(&replayed.stdout).unwrap();
    let keys = told["summary"].as_array().unwrap().iter();
    let keys = keys.map(|one| one["key"].as_str().unwrap().to_owned());
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    let headline = page.split("<p class=\"headline\">").nth(1).unwrap();
    let headline = headline.split("</p>").next().unwrap().to_owned();
    (
        [replayed.status.code(), reported.status.code()],
        keys.collect(),
        headline,
    )
}

fn says_completed(summary: &mut serde_json::Value) {
    summary["status"] = "completed".into();
    summary["cause"] = "done".into();
    summary["reason"] = "end of the test".into();
}

#[test]
fn edited_summary_hides_no_trip() {
    let home = tempfile::tempdir().unwrap();
    let run = tripped(home.path());
    let (codes, keys, headline) = judged(&run, |_| {});
    assert_eq!((codes, keys), ([Some(0); 2], vec![]), "{headline}");
    assert!(headline.starts_with("Stopped"), "{headline}");

    let (codes, keys, headline) = judged(&run, says_completed);
    assert_eq!(codes, [Some(1); 2]);
    assert_eq!(keys, ["status"]);
    assert!(
        headline.starts_with("Contradicted") && headline.contains("`status`"),
        "{headline}"
    );

    // The record of an earlier version differs for other reasons: the replay reports it, and the headline is no better.
    let events = std::fs::read_to_string(run.join("events.jsonl")).unwrap();
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(events.contains(&version), "{events}");
    let older = events.replace(&version, "\"version\":\"0.0.9\"");
    std::fs::write(run.join("events.jsonl"), older).unwrap();
    let (codes, keys, headline) = judged(&run, says_completed);
    assert_eq!(codes, [Some(0); 2]);
    assert_eq!(keys, ["status"]);
    assert!(headline.starts_with("Contradicted"), "{headline}");
}

/// With a limit that trips before a command leaves, the rows do not show the trip: the next tick of the loop does.
#[test]
fn lost_events_hide_no_trip() {
    let home = tempfile::tempdir().unwrap();
    let run = tripped(home.path());
    let path = run.join("events.jsonl");
    let events = std::fs::read_to_string(&path).unwrap();
    let torn = format!("{events}{{\"event\":\n");
    let without: String = events
        .lines()
        .filter(|line| {
            !["\"phase\"", "\"ended\""]
                .iter()
                .any(|word| line.contains(word))
        })
        .map(|line| format!("{line}\n"))
        .collect();
    for (what, left) in [
        ("torn", Some(torn)),
        ("without", Some(without)),
        ("deleted", None),
    ] {
        match left {
            Some(text) => std::fs::write(&path, text).unwrap(),
            None => std::fs::remove_file(&path).unwrap(),
        }
        let (codes, keys, headline) = judged(&run, says_completed);
        assert_eq!(codes, [Some(1); 2], "{what}: {headline}");
        assert_eq!(keys, ["status"], "{what}");
        assert!(
            headline.starts_with("Contradicted") && headline.contains("`status`"),
            "{what}: {headline}"
        );
    }
}

/// The operator's end leaves no row: a test with fewer steps than its duration is not completed, whatever its events say.
#[test]
fn test_of_too_few_steps_is_never_completed() {
    let mut words = vec![Operator::Continue; 900];
    words.push(Operator::Stop);
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &words);
    let path = run.join("events.jsonl");
    let events = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, format!("{events}{{\"event\":\n")).unwrap();
    let (codes, keys, headline) = judged(&run, |_| {});
    assert_eq!((codes, keys), ([Some(0); 2], vec![]), "{headline}");
    let (codes, keys, headline) = judged(&run, says_completed);
    assert_eq!((codes, keys), ([Some(1); 2], vec!["status".to_owned()]));
    assert!(headline.contains("`status`"), "{headline}");
}

#[test]
fn summary_with_other_peaks_is_found() {
    let home = tempfile::tempdir().unwrap();
    let run = tripped(home.path());
    let (codes, keys, headline) = judged(&run, |summary| {
        summary["steps"] = (summary["steps"].as_u64().unwrap() + 1).into();
    });
    assert_eq!(
        (codes[1], headline.contains("`steps`")),
        (Some(1), true),
        "{headline}"
    );
    // The rows end before the steps of this summary. The replay fails for the missing rows and lists no key.
    assert_eq!((codes[0], keys.len()), (Some(1), 0));
    let (codes, keys, headline) = judged(&run, |summary| {
        let peak = summary["peak"]["displacement"][1].as_f64().unwrap();
        summary["peak"]["displacement"][1] = (0.5 * peak).into();
    });
    assert_eq!(
        (codes, keys),
        ([Some(1); 2], vec!["peak.displacement[1]".to_owned()])
    );
    assert!(headline.contains("peak.displacement[1]"), "{headline}");
    let (codes, keys, headline) = judged(&run, |summary| {
        summary["peak"]["force"]["s"][0] = 1e6.into();
    });
    assert_eq!(
        (codes, keys),
        ([Some(1); 2], vec!["peak.force.s[0]".to_owned()])
    );
    assert!(headline.contains("peak.force.s[0]"), "{headline}");
    let (codes, keys, headline) = judged(&run, |summary| {
        assert_eq!(summary["cause"], "command_disp_m");
        summary["cause"] = "measured_disp_m".into();
    });
    assert_eq!((codes, keys), ([Some(1); 2], vec!["cause".to_owned()]));
    assert!(headline.contains("`cause`"), "{headline}");
    // Other words for the same ending.
    let (codes, keys, headline) = judged(&run, |summary| summary["reason"] = "reworded".into());
    assert_eq!((codes, keys), ([Some(0); 2], vec![]), "{headline}");
    let (codes, keys, _) = judged(&run, |summary| summary["cause"] = serde_json::Value::Null);
    assert_eq!((codes, keys), ([Some(1); 2], vec!["cause".to_owned()]));
}

/// Its rows end where it was stopped, as those of a test that was killed there: the events say who stopped it.
#[test]
fn interruption_differs_from_a_panic() {
    let mut words = vec![Operator::Continue; 900];
    words.push(Operator::Stop);
    let home = tempfile::tempdir().unwrap();
    let run = record(home.path(), &words);
    let (codes, keys, headline) = judged(&run, |_| {});
    assert_eq!((codes, keys), ([Some(0); 2], vec![]), "{headline}");
    for status in ["completed", "failed", "stopped"] {
        let (codes, keys, headline) = judged(&run, |summary| summary["status"] = status.into());
        assert_eq!(
            (codes, keys),
            ([Some(1); 2], vec!["status".to_owned()]),
            "{status}"
        );
        assert!(headline.contains("`status`"), "{headline}");
    }
}
