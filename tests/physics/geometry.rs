//! Specimens whose axes are the actuators of a loading unit. The work is the same on both sides, so a hybrid test with them is the
//! monolithic one. They are served, replayed, resumed and refused like any other specimen.

use crate::common::test_file::TestFile;
use std::path::Path;

use crate::common::engine::{distance, prepare, run};
use crate::common::killed::killed;
use crate::common::{completed, json, physics, same_physics, say, write};
use crate::link_common::{Served, columns};
use gusset_control::engine::Ending;
use gusset_record::Run;

/// Pins on the frame and on the platform of three actuators, with joint offsets.
const PINS: [([f64; 2], [f64; 2]); 3] = [
    ([-1.6, 0.1], [-0.4, 0.15]),
    ([-0.5, -1.2], [-0.5, -0.1]),
    ([0.6, -1.3], [0.5, -0.1]),
];
const SPRING: f64 = 4e5;
const STIFFNESS: [[f64; 4]; 4] = [
    [3e5, 0.0, 1e5, -2e5],
    [0.0, 8e5, 0.0, 0.0],
    [1e5, 0.0, 4e5, -1e5],
    [-2e5, 0.0, -1e5, 2e5],
];
const STEPS: usize = 1024;

/// A node with two translations and a rotation, and a mass above it.
fn structure(stiffness: &[[f64; 4]; 4], amplitude: f64, time: &str) -> String {
    let rows: Vec<Vec<f64>> = stiffness.iter().map(|row| row.to_vec()).collect();
    let damping = STIFFNESS.map(|row| row.map(|entry| 0.004 * entry).to_vec());
    format!(
        "title = \"unit\"\n[time]\nrate_hz = 256\nduration_s = {}\nclock = \"simulated\"\n{time}\n[integrator]\nlambda = 2\n\
         [structure.matrices]\nmass = [[2e3, 0, 0, 0], [0, 2e3, 0, 0], [0, 0, 300, 0], [0, 0, 0, 1500]]\n\
         stiffness = {rows:?}\ndamping = {damping:?}\ninfluence = [1, 0.4, 0, 1]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = {amplitude}\nfrequency_hz = 1.3\n",
        STEPS as f64 / 256.0
    )
}

const SEEN: &str =
    "[[specimen]]\nname = \"column\"\nrows = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]\n";

fn unit(keys: &str) -> String {
    let pins = PINS.map(|(b, j)| format!("{{ base_m = {b:?}, joint_m = {j:?} }}"));
    format!(
        "[specimen.geometry]\nplane = [{}]\n{keys}\n",
        pins.join(", ")
    )
}

fn springs(exact: bool, amplitude: f64) -> String {
    let unit = unit(&format!("exact = {exact}\nlaw_at = \"actuators\""));
    let law = format!("[specimen.law.linear]\nstiffness_n_per_m = {SPRING}\n");
    structure(&STIFFNESS, amplitude, "") + SEEN + &unit + &law
}

const LAWS: &str = "[[specimen.laws]]
bouc_wen = { stiffness_n_per_m = 6e5, yield_force_n = 1500.0, post_yield_ratio = 0.1, beta = 0.5, gamma = 0.5, exponent = 2 }
[[specimen.laws]]
linear = { stiffness_n_per_m = 5e5, damping_n_s_per_m = 800.0 }
[[specimen.laws]]
bilinear = { stiffness_n_per_m = 2e5, yield_force_n = 150.0, post_yield_ratio = 0.2 }
";

/// A column of Bouc–Wen, a spring with a damper and a yielding hinge at the node.
fn column(amplitude: f64, time: &str, keys: &str) -> String {
    structure(&STIFFNESS, amplitude, time) + SEEN + &unit(keys) + LAWS
}

/// x and v agree within `tolerance` of their peaks.
#[track_caller]
fn assert_same(
    one: &crate::common::engine::Run,
    other: &crate::common::engine::Run,
    tolerance: f64,
) {
    for dof in 1..=4 {
        for letter in ["x", "v"] {
            let name = format!("{letter}{dof}");
            let found = distance(&one.column(&name), &other.column(&name));
            assert!(
                found <= tolerance,
                "{name} differs by {found:e} of its peak"
            );
        }
    }
}

/// Springs of three actuators for small displacements are K + JᵀkJ, with J written down by hand: (eₓ, e_y, a × e).
fn monolith(amplitude: f64) -> String {
    let mut whole = STIFFNESS;
    for (base, joint) in PINS {
        let span = [joint[0] - base[0], joint[1] - base[1]];
        let length = libm::hypot(span[0], span[1]);
        let e = span.map(|value| value / length);
        let row = [e[0], e[1], joint[0] * e[1] - joint[1] * e[0]];
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row.iter().enumerate() {
                // Equal to the last bit on both sides of the diagonal.
                whole[i][j] += SPRING * (a * b);
            }
        }
    }
    structure(&whole, amplitude, "")
}

/// Some forty operations on forces of the size of the peak in each of 1024 ticks, added up linearly: 1024·40·1.1e-16.
#[test]
fn actuator_springs_equal_the_monolith() {
    let (hybrid, whole) = (run(&springs(false, 2.0)), run(&monolith(2.0)));
    assert_same(&hybrid, &whole, 4.5e-12);
    // The force that enters equilibrium is that of the platform, the row holds both.
    let (strokes, forces) = (hybrid.column("meas_1_1"), hybrid.column("force_1_1"));
    for (stroke, force) in strokes.iter().zip(&forces) {
        assert!((SPRING * stroke - force).abs() <= 1e-9 * SPRING);
    }
    let (pose, x) = (hybrid.column("pose_1_3"), hybrid.column("x3"));
    assert_eq!(pose, x);
}

/// With the pins where they are, the same springs differ by the square of the displacement: half the motion, a quarter of the
/// difference, up to the cubic share of some percent.
#[test]
fn exact_strokes_differ_by_the_square() {
    let difference = |amplitude: f64| {
        let (exact, whole) = (run(&springs(true, amplitude)), run(&monolith(amplitude)));
        let pairs = exact.column("x1").into_iter().zip(whole.column("x1"));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let (large, small) = (difference(0.1), difference(0.05));
    let ratio = large / small;
    assert!((ratio - 4.0).abs() < 0.25, "{large:e} {small:e}");
    assert!(large > 1e-7, "{large:e}");
}

/// A law at the platform gives, through exact actuators (Newton's method on both sides), the response without any actuator. A pose
/// is known to 1e-14 m (roundoff of lengths through the inverse Jacobian) of a peak of 1e-2 m: 1e-12 a tick, over 1024 ticks.
#[test]
fn platform_law_does_not_feel_its_actuators() {
    let plain = run(&(structure(&STIFFNESS, 2.0, "") + SEEN + LAWS));
    let peak = plain
        .column("x1")
        .iter()
        .fold(0.0, |m: f64, x| m.max(x.abs()));
    assert!(peak > 1e-2, "{peak}");
    for keys in ["exact = true", "exact = false"] {
        let held = run(&column(2.0, "", keys));
        assert_same(&held, &plain, 1e-9);
        for coordinate in 1..=3 {
            let felt = held.column(&format!("pose_force_1_{coordinate}"));
            let exact = plain.column(&format!("force_1_{coordinate}"));
            assert!(distance(&felt, &exact) < 1e-9);
        }
    }
    // A user's matrix must give the same response; the second actuator is reversed and in millimetres.
    let matrix = "[specimen.geometry]\ncoordinates = [\"ux\", \"uy\", \"rz\"]\nmatrix = [[1, 0.2, 0.1], [0, 1, -0.5], [0, 1, 0.5]]\n\
                  [[specimen.axis]]\n[[specimen.axis]]\nsign = -1\nunit_disp = \"mm\"\nunit_force = \"kN\"\n[[specimen.axis]]\n";
    let held = run(&(structure(&STIFFNESS, 2.0, "") + SEEN + matrix + LAWS));
    assert_same(&held, &plain, 1e-9);
}

/// At one tenth of the size with exact pins: the same angles, lengths and forces by the similitude.
#[test]
fn model_at_one_tenth_takes_the_same_course() {
    let whole = run(&springs(true, 2.0));
    let tenth = PINS.map(|(b, j)| {
        let scaled = |pin: [f64; 2]| pin.map(|value| value / 10.0);
        format!("{{ base_m = {:?}, joint_m = {:?} }}", scaled(b), scaled(j))
    });
    // F = 100 f and d = 10 δ: the model's springs have a tenth of the stiffness.
    let text = format!(
        "{}{SEEN}similitude = {{ length = 10, force = 100 }}\n[specimen.geometry]\nlaw_at = \"actuators\"\nplane = [{}]\n\
         [specimen.law.linear]\nstiffness_n_per_m = {}\n",
        structure(&STIFFNESS, 2.0, ""),
        tenth.join(", "),
        SPRING / 10.0
    );
    assert_same(&run(&text), &whole, 1e-9);
}

#[test]
fn prescribed_pose_moves_all_actuators() {
    let text = format!(
        "[time]\nrate_hz = 200\nduration_s = 1\nclock = \"simulated\"\n[[specimen]]\nname = \"column\"\n{}{LAWS}\
         [[excitation.prescribed_displacement]]\nspecimen = \"column\"\naxis = 3\n\
         signal.sine = {{ amplitude = 0.2, frequency_hz = 2 }}\n",
        unit("")
    );
    let run = run(&text);
    let turns = run.column("pose_1_3");
    assert!(turns.iter().any(|turn| turn.abs() > 0.19));
    for (index, (base, joint)) in PINS.iter().enumerate() {
        let strokes = run.column(&format!("target_1_{}", index + 1));
        for (turn, stroke) in turns.iter().zip(strokes) {
            let (s, c) = libm::sincos(*turn);
            let x = c * joint[0] - s * joint[1] - base[0];
            let y = s * joint[0] + c * joint[1] - base[1];
            let rest = libm::hypot(joint[0] - base[0], joint[1] - base[1]);
            assert!((libm::hypot(x, y) - rest - stroke).abs() < 1e-14);
        }
    }
}

/// A platform that moves 100 mm sideways turns its upright actuators: their strokes are curved and return, so the difference of the
/// end points is far too small.
#[test]
fn startup_along_poses_keeps_half_the_speed() {
    let at = |axis: u32, value: f64| {
        format!(
            "[[excitation.prescribed_displacement]]\nspecimen = \"column\"\naxis = {axis}\nat = \"platform\"\n\
             signal.constant = {{ value = {value} }}\n"
        )
    };
    let limited =
        "[[specimen.axis]]\n[[specimen.axis]]\nlimits.command_vel_m_per_s = { trip = 0.0025 }\n";
    for upwards in [0.0, 0.001, 0.0036] {
        let text = format!(
            "[time]\nrate_hz = 1000\nduration_s = 0.1\nclock = \"simulated\"\n{}{}\
             [[specimen]]\nname = \"column\"\n[specimen.geometry]\ncoordinates = [\"ux\", \"uy\", \"rz\"]\n\
             exact = true\nlaw_at = \"platform\"\nplane = [\n\
             {{ base_m = [-1.65, 0.05], joint_m = [-0.25, 0.0] }},\n\
             {{ base_m = [-0.60, 1.55], joint_m = [-0.60, 0.15] }},\n\
             {{ base_m = [0.60, 1.55], joint_m = [0.60, 0.15] }},\n]\n{limited}[[specimen.axis]]\n\
             [specimen.coupled]\nstiffness_n_per_m = [[7e6, 0, 5e6], [0, 6e8, 0], [5e6, 0, 6e6]]\n",
            at(1, 0.1),
            at(2, upwards)
        );
        let run = run(&text);
        assert_eq!(run.outcome.ending, Ending::Completed, "{upwards}");
        let stroke = run.all("cmd_1_2");
        let speed = stroke.windows(2).map(|two| (two[1] - two[0]).abs() * 1e3);
        let fastest = speed.fold(0.0, f64::max);
        // Slower where its steepest place is not its middle, a little faster between the places that are looked at.
        assert!((0.0005..0.0013).contains(&fastest), "{upwards}: {fastest}");
    }
}

#[test]
fn served_actuators_equal_in_process_ones() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // The declared values are equal, so K0 is, too.
    let seen = format!(
        "{SEEN}stiffness_n_per_m = [[6e5, 0, 0], [0, 5e5, 0], [0, 0, 2e5]]\ndamping_n_s_per_m = [[0, 0, 0], [0, 800, 0], \
         [0, 0, 0]]\n{}",
        unit("")
    );
    let local = structure(&STIFFNESS, 2.0, "") + &seen + LAWS + "[safety]\nzero_s = 0\n";
    assert_eq!(crate::link_common::run(folder, "local", &local).0, 0);
    let served = Served::start(folder, &local, &[]);
    let remote = format!(
        "{}{seen}[specimen.link]\naddress = \"{}\"\nwatchdog_s = 20\n[safety]\nzero_s = 0\nunlimited = \"a formula\"\n",
        structure(&STIFFNESS, 2.0, ""),
        served.address
    );
    let (code, said) = crate::link_common::run(folder, "remote", &remote);
    assert_eq!(code, 0, "{said}");
    assert_eq!(columns(folder, "local", ""), columns(folder, "remote", ""));
}

/// Several ticks a step, the first lines of a checkpointed record, and the whole way again.
#[test]
fn replay_and_resume_find_the_same_bits() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let text = column(2.0, "ticks_per_step = 4", "") + "[record]\ncheckpoint_s = 0.1\n";
    let test = write(home, "test.toml", &text);
    let whole = home.join("whole");
    completed(&test, &whole, &[]);
    let said = say(["replay".as_ref(), whole.as_os_str()]);
    assert_eq!(said.code, Some(0), "{} {}", said.stdout, said.stderr);
    let kept = home.join("killed");
    killed(&whole, &kept, 1500);
    let next = home.join("next");
    let said = say(["run", "--resume"].map(Path::new).into_iter().chain([
        kept.as_path(),
        Path::new("--out"),
        &next,
    ]));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    // Counts of the link restart, and so does the energy.
    let anew = ["seq_", "added_", "hold"];
    let last = |folder: &Path| {
        let last = |(name, bits): (String, Vec<u64>)| (name, bits.last().copied());
        let all = physics(folder).into_iter().map(last);
        all.filter(|(name, _)| !anew.iter().any(|one| name.starts_with(one)))
            .collect::<Vec<_>>()
    };
    assert_eq!(last(&whole), last(&next));
    // A repeated run gives the same physics.
    let again = home.join("again");
    completed(&test, &again, &[]);
    same_physics(&whole, &again);
}

/// A pose beyond what an actuator can reach ends the test before any command goes there, and the message names the pose; so does
/// `check`.
#[test]
fn pose_beyond_reach_is_named_early() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    let text = column(2.0, "", "").with("specimen.geometry.plane.0.length_m = [1.19, 1.21]");
    let test = write(home, "test.toml", &text);
    let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    for words in ["would stop", "actuator 1", "ux = "] {
        assert!(said.stderr.contains(words), "{}", said.stderr);
    }
    let out = home.join("out");
    let said = crate::common::run(&test, &out, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    let summary = json(&out, "summary.json");
    let reason = summary["reason"].as_str().unwrap();
    let words = "actuator 1 would";
    assert!(reason.contains(words), "{reason}");
    assert!(
        reason.contains("uy = ") && reason.contains("rz = "),
        "{reason}"
    );
    let events = std::fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(events.contains("\"out_of_reach\""), "{events}");
    let length = libm::hypot(1.2, 0.05);
    let sent = Run::open(&out).unwrap().columns(&["cmd_1_1"]).unwrap();
    assert!(sent[0].len() > 10);
    for stroke in &sent[0] {
        let now = length + stroke;
        assert!((1.19..=1.21).contains(&now), "{now}");
    }
}

#[test]
fn check_shows_the_actuators_needs() {
    let home = tempfile::tempdir().unwrap();
    let test = write(home.path(), "test.toml", &column(2.0, "", ""));
    let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    for words in [
        "ux, uy, rz",
        "platform's coordinates",
        "actuator 2, ",
        "platform ux ",
        "condition",
    ] {
        assert!(said.stdout.contains(words), "{words}: {}", said.stdout);
    }
    let said = say(["check".as_ref(), test.as_os_str(), "--json".as_ref()]);
    let found: serde_json::Value = serde_json::from_str(&said.stdout).unwrap();
    let unit = &found["limits"]["specimens"][0]["geometry"];
    assert_eq!(unit["actuators"].as_array().unwrap().len(), 3, "{unit}");
    let platform = &found["rehearsal"]["specimens"][0]["platform"];
    assert!(
        platform["worst_condition"].as_f64().unwrap() >= platform["condition"].as_f64().unwrap()
    );
    // The need that it shows for actuator 1 is the largest command of the run.
    let need = found["rehearsal"]["specimens"][0]["axes"][0][0]["high"].as_f64();
    let out = home.path().join("out");
    completed(&test, &out, &[]);
    let sent = Run::open(&out).unwrap().columns(&["cmd_1_1"]).unwrap();
    let most = sent[0].iter().copied().fold(f64::MIN, f64::max);
    assert_eq!(need, Some(most));
    let summary = json(&out, "summary.json");
    assert_eq!(
        summary["limits"]["specimens"][0]["geometry"]["form"],
        "plane"
    );
}

/// A law at the end of an actuator that turns is another spring at every pose: the proof is of one of them.
#[test]
fn stability_uses_the_reference_pose() {
    let text = |at: &str| {
        format!(
            "[time]\nrate_hz = 25\nduration_s = 1\nclock = \"simulated\"\n[structure.matrices]\nmass = [[1000]]\n\
             stiffness = [[2e4]]\n[structure]\ninitial_displacement_m = [0.01]\n[[specimen]]\nname = \"strut\"\nrows = [[1]]\n\
             law.linear.stiffness_n_per_m = 1e4\n[specimen.geometry]\ncoordinates = [\"ux\"]\nlaw_at = \"{at}\"\n\
             plane = [{{ base_m = [-0.1, -0.8], joint_m = [0, 0] }}]\n"
        )
    };
    let home = tempfile::tempdir().unwrap();
    for (at, told) in [("actuators", true), ("platform", false)] {
        let test = write(home.path(), "test.toml", &text(at));
        let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        assert!(said.stdout.contains("is necessary"), "{}", said.stdout);
        let alone = said.stdout.contains("pose alone");
        assert_eq!(alone, told, "{}", said.stdout);
    }
}

/// Two actuators side by side hold what is across them badly: 1/tan of half their angle, and worse as they get longer.
#[test]
fn weak_geometry_warns_with_its_pose() {
    let text = "[time]\nrate_hz = 200\nduration_s = 1\nclock = \"simulated\"\n[[specimen]]\nname = \"column\"\n\
                [specimen.geometry]\ncoordinates = [\"ux\", \"uy\"]\n\
                plane = [{ base_m = [-1, 0.06] }, { base_m = [-1, -0.06] }]\n\
                [specimen.law.linear]\nstiffness_n_per_m = 1e5\n\
                [[excitation.prescribed_displacement]]\nspecimen = \"column\"\naxis = 1\n\
                signal.sine = { amplitude = 0.5, frequency_hz = 1 }\n";
    let home = tempfile::tempdir().unwrap();
    let test = write(home.path(), "test.toml", text);
    let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    for words in ["condition 25.", "ux = 0.5 m", "16.7"] {
        assert!(said.stderr.contains(words), "{}", said.stderr);
    }
}

#[test]
fn a_bad_geometry_is_refused_at_its_place() {
    let refused = |geometry: &str, line: &str, under: &str, words: &str| {
        let text = structure(&STIFFNESS, 2.0, "") + SEEN + "[specimen.geometry]\n" + geometry;
        crate::common::refusal::refused(&(text + "\n" + LAWS), &[], line, under, &[words]);
    };
    let star = "plane = [{ base_m = [-1, 0] }, { base_m = [1, 1] }, { base_m = [1, -1] }]";
    let words = "uy = 0 m, rz = 0 rad";
    refused(star, star, "plane", words);
    let two = "plane = [{ base_m = [-1, 0] }, { base_m = [0, -1] }]";
    refused(two, two, "plane", "`coordinates`");
    let few = "coordinates = [\"ux\"]\nplane = [{ base_m = [-1, 0] }]";
    let rows = SEEN.lines().last().unwrap();
    let words = "`rows` gives 3";
    refused(few, rows, "rows", words);
    let matrix = "matrix = [[1, 0], [0, 1], [1, 1]]";
    let all = matrix.to_owned() + "\ncoordinates = [\"ux\", \"uy\", \"rz\"]";
    let words = "row 1 of `matrix` has 2";
    refused(&all, matrix, "[1, 0]", words);
    let length = "plane = [{ base_m = [-1, 0], length_m = [1.1, 2] }]";
    let all = length.to_owned() + "\ncoordinates = [\"ux\"]";
    let words = "actuator 1: its pins are 1.000000 m";
    refused(&all, length, "[1.1, 2]", words);
    refused("plain = []", "plain = []", "plain", "plane");
    assert!(prepare(&column(1.0, "", "")).warnings.0.is_empty());
}
