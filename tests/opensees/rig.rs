//! OpenSees → a gateway that converts, paces and compensates → a rig behind two actuators. The files of the guide's page are
//! compared with the model in OpenSees alone, and with the same test of `gusset run`; and how such a test ends.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use gusset_motion::metrics::tracking::Tracking;
use gusset_record::Run;
use gusset_record::summary::Status;

use crate::link_common::{Served, finish, gusset, write};
use crate::programs::{LONG, Peer, python};

const PAGE: &str = include_str!("../../src/guide/opensees-rig.md");

/// As in tools/opensees/portal.py, in in, kip and s.
const HEIGHT: f64 = 120.0;
const SPAN: f64 = 240.0;
const COLUMN: f64 = 29_000.0 * 300.0;
const BEAM: f64 = 29_000.0 * 1000.0;
const MASS: f64 = 0.25;
const INERTIA: f64 = 200.0;

const INCH: f64 = 0.0254;
const KIP: f64 = 4_448.221_615_260_5;

/// OpenSees and a test of Gusset sum the same products in another order: a few units in the last place in each of 300 steps. An
/// error in a factor, a sign or a unit is far larger.
const SAME: f64 = 1e-12;

type Two = [[f64; 2]; 2];

/// The file that the page shows under this name.
fn shown(name: &str) -> String {
    let (_, text) = PAGE
        .split_once(&format!("```toml file=\"{name}\"\n"))
        .unwrap();
    text.split_once("\n```").unwrap().0.to_owned()
}

/// The rig of the page without its lag.
fn ideal_rig() -> String {
    let text = shown("rig.toml");
    let lines: Vec<&str> = text
        .lines()
        .filter(|line| !line.starts_with("transfer"))
        .collect();
    assert_eq!(lines.len() + 1, text.lines().count());
    lines.join("\n")
}

/// The gateway of the page without its compensation.
fn without_compensation(gateway: &str) -> String {
    let (before, table) = gateway.split_once("[specimen.compensation.ats]").unwrap();
    let (_, after) = table.split_once("[specimen.limits]").unwrap();
    format!("{before}[specimen.limits]{after}")
}

/// One value replaced by another, which must be there.
fn with(text: &str, old: &str, new: &str) -> String {
    assert!(text.contains(old), "{old}");
    text.replace(old, new)
}

#[expect(
    clippy::disallowed_methods,
    reason = "another process decides when that is; it must not take for ever"
)]
fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < LONG, "{what} does not come");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Rig and gateway, each with its records.
struct Laboratory {
    rig: Served,
    gateway: Served,
    kept: PathBuf,
    theirs: PathBuf,
    _folder: tempfile::TempDir,
}

impl Laboratory {
    fn start(rig: &str, gateway: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let [kept, theirs] = ["kept", "theirs"].map(|name| folder.path().join(name));
        let rig = Served::start(folder.path(), rig, &["--out", theirs.to_str().unwrap()]);
        let gateway = with(gateway, "127.0.0.1:27511", &rig.address);
        let gateway = Served::start(folder.path(), &gateway, &["--out", kept.to_str().unwrap()]);
        Self {
            rig,
            gateway,
            kept,
            theirs,
            _folder: folder,
        }
    }

    fn port(&self) -> &str {
        self.gateway.address.rsplit(':').next().unwrap()
    }

    fn frame(&self, python: &Path, more: &[&str]) -> Peer {
        Peer::script(
            python,
            "portal.py",
            &[&["--port", self.port()], more].concat(),
        )
    }

    /// The largest differences of sway and rotation over their largest values.
    fn differences(&self, python: &Path, more: &[&str]) -> [f64; 2] {
        let result = self.frame(python, more).event("result");
        let number = |key: &str| result[key].as_f64().unwrap();
        let peak = number("sway_peak");
        assert!(peak > 0.5, "hardly anything moved: {peak} in");
        ["sway", "rotation"].map(number)
    }

    fn ended(folder: &Path, number: u32) -> Run {
        let folder = folder.join(format!("test-000{number}"));
        wait_for("the end of a test", || folder.join("summary.json").exists());
        Run::open(&folder).unwrap()
    }

    /// The record of the gateway, once a test has ended.
    fn record(&self, number: u32) -> Run {
        Self::ended(&self.kept, number)
    }
}

/// Values of a column while the test ran.
fn running(run: &Run, name: &str) -> Vec<f64> {
    let columns = run.columns(&["state", name]).unwrap();
    let pairs = columns[0].iter().zip(&columns[1]);
    let values = pairs.filter(|(state, _)| **state == 3.0);
    values.map(|(_, value)| *value).collect()
}

fn last(run: &Run, name: &str) -> f64 {
    *run.columns(&[name]).unwrap()[0].last().unwrap()
}

#[test]
fn guide_frame_equals_the_pure_model() {
    let Some(python) = python() else {
        return;
    };
    let gateway = without_compensation(&shown("gateway.toml"));
    let gateway = with(&gateway, "ticks_per_step = 20", "ticks_per_step = 4");
    let laboratory = Laboratory::start(&ideal_rig(), &gateway);
    for number in 1..=2 {
        let differences = laboratory.differences(&python, &[]);
        assert!(differences.iter().all(|one| *one < SAME), "{differences:?}");
        let run = laboratory.record(number);
        let summary = run.summary().unwrap();
        assert_eq!((summary.status, summary.steps), (Status::Completed, 300));
    }
}

/// 12EI/h³, 6EI/h² and 4EI/h of a column, in SI.
fn column() -> Two {
    let coupling = 6.0 * COLUMN / HEIGHT.powi(2) * KIP;
    [
        [12.0 * COLUMN / HEIGHT.powi(3) * KIP / INCH, coupling],
        [coupling, 4.0 * COLUMN / HEIGHT * KIP * INCH],
    ]
}

fn inverse([[a, b], [c, d]]: Two) -> Two {
    let whole = a * d - b * c;
    [[d / whole, -b / whole], [-c / whole, a / whole]]
}

fn product(one: Two, other: Two) -> Two {
    let entry = |i: usize, j: usize| one[i][0] * other[0][j] + one[i][1] * other[1][j];
    [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
}

fn transposed([[a, b], [c, d]]: Two) -> Two {
    [[a, c], [b, d]]
}

/// A third of the size, a seventh of the force; a matrix of arms, a lever, a reversed axis, and another unit at each axis. The rig
/// is the matrix of springs that all of that makes of the column.
#[test]
fn similitude_and_signs_change_nothing() {
    let Some(python) = python() else {
        return;
    };
    let (length, force) = (3.0, 7.0);
    let arms = [[1.0, 0.2], [1.0, -0.5]];
    let gears = [[-1.0, 0.0], [0.0, 0.5]];
    // Strokes of the structure are arms·q with arms of its size; commands are gears·strokes/length.
    let at_structure = arms.map(|[shift, turn]| [shift, turn * length]);
    let back = inverse(product(gears, at_structure));
    let springs = product(product(transposed(back), column()), back);
    let springs = springs.map(|row| row.map(|entry| entry * length / force));
    let axes = |more: [&str; 2]| {
        format!(
            "axis = [{{ unit_disp = \"mm\", unit_force = \"kN\"{} }}, {{ unit_disp = \"in\", unit_force = \"lbf\"{} }}]",
            more[0], more[1]
        )
    };
    // The native protocol has neither inches nor pounds: OpenFresco's has.
    let rig = format!(
        "[serve]\nprotocol = \"openfresco\"\n[[specimen]]\nname = \"column\"\n{}\n[specimen.coupled]\nstiffness_n_per_m = {springs:?}\n",
        axes(["", ""])
    );
    let gateway = format!(
        "[serve]\nprotocol = \"openfresco\"\nunit_disp = \"in\"\nunit_force = \"kip\"\npace = {{ ticks_per_step = 3, rate_hz = 2000 }}\n\
         [[specimen]]\nname = \"column\"\nsimilitude = {{ length = {length}, force = {force} }}\nstiffness_n_per_m = {:?}\n{}\n\
         geometry = {{ coordinates = [\"ux\", \"rz\"], matrix = {arms:?} }}\n\
         [specimen.limits]\ncommand_disp_m = {{ trip = [-0.2, 0.2] }}\ncommand_vel_m_per_s = {{ trip = 50 }}\n\
         measured_force_n = {{ trip = [-5e6, 5e6] }}\n\
         [specimen.link]\naddress = \"127.0.0.1:27511\"\nprotocol = \"openfresco\"\ncomputed = true\n\
         openfresco = {{ answer_signals = [2, 2, 2, 2, 1] }}\n",
        column(),
        axes([", sign = -1", ", scale = 0.5"]),
    );
    let laboratory = Laboratory::start(&rig, &gateway);
    let differences = laboratory.differences(&python, &[]);
    assert!(differences.iter().all(|one| *one < SAME), "{differences:?}");
}

/// The table of the page: 18 % and 0.5 %.
#[test]
fn compensation_removes_a_lag_of_15_ms() {
    let Some(python) = python() else {
        return;
    };
    let (rig, gateway) = (shown("rig.toml"), shown("gateway.toml"));
    let lagging = Laboratory::start(&rig, &without_compensation(&gateway));
    let [without, _] = lagging.differences(&python, &[]);
    let compensated = Laboratory::start(&rig, &gateway);
    let [ats, _] = compensated.differences(&python, &[]);
    assert!(without > 0.1 && ats < 0.02, "{without} {ats}");
    let summary = compensated.record(1).summary().unwrap().clone();
    assert_eq!(summary.status, Status::Completed, "{}", summary.reason);
}

const DT: f64 = 0.02;
const DAMPING: f64 = 4.0;

/// The frame as a test of `gusset run` in SI. Its specimen is computed: the rig of the page with its actuators.
fn test_file(specimen: &str) -> String {
    let [[shift, coupling], [_, turn]] = column();
    let (mass, inertia) = (2.0 * MASS * KIP / INCH, INERTIA * KIP * INCH);
    let ends = 4.0 * BEAM / SPAN * KIP * INCH;
    let stiffness = [
        [shift, 0.0, coupling],
        [0.0, ends, 0.5 * ends],
        [coupling, 0.5 * ends, turn + ends],
    ];
    let masses = [mass, inertia, inertia];
    let diagonal = |factor: f64| {
        let row = |i: usize| (0..3).map(move |j| if i == j { factor * masses[i] } else { 0.0 });
        (0..3).map(|i| row(i).collect()).collect::<Vec<Vec<f64>>>()
    };
    let ground = |step: u32| {
        let t = f64::from(step) * DT;
        libm::sin(0.8 * t) * (60.0 * libm::sin(13.0 * t) + 30.0 * libm::sin(31.0 * t))
    };
    let values: Vec<f64> = (0..=STEPS).map(ground).collect();
    format!(
        "title = \"frame\"\n[time]\nrate_hz = {}\nduration_s = {}\nticks_per_step = 20\nclock = \"simulated\"\n\
         [structure]\nrotations = [2, 3]\n[structure.matrices]\ninfluence = [1, 0, 0]\nmass = {:?}\ndamping = {:?}\n\
         stiffness = {stiffness:?}\n[excitation.ground_acceleration.signal.values]\nunit = \"in/s2\"\ndt_s = {DT}\nvalues = {values:?}\n\
         {specimen}",
        1.0 / DT,
        f64::from(STEPS) * DT,
        diagonal(1.0),
        diagonal(DAMPING),
    )
}

const STEPS: u32 = 150;

/// The tracking of each actuator. A gateway records each command, and a test each step.
fn tracking(run: &Run) -> [Tracking; 2] {
    let time = running(run, "time");
    let dt = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    [1, 2].map(|axis| {
        let [target, meas, force] =
            ["target", "meas", "force"].map(|name| running(run, &format!("{name}_1_{axis}")));
        Tracking::of(&target, &meas, &force, dt, None).unwrap()
    })
}

/// RMS error, delay in s and amplitude of one actuator.
fn figures(tracking: &Tracking) -> [f64; 3] {
    let index = tracking.fei.unwrap();
    [
        tracking.nrmse.value,
        index.delay_s.value,
        index.amplitude.value,
    ]
}

/// Structure, rig, actuators and compensator are equal, and both command a millisecond apart. The paths differ: a gateway rests at each
/// target, a test passes it. So the actuator sees faster motions within a step. Without compensation RMS errors agree to 1 % of the
/// target, delays of 14 ms to 2 ms and amplitudes to 1 %. With it both are close to a perfect specimen: what remains is the error of
/// differences over one tick, which grows with the acceleration on the path.
#[test]
fn actuator_follows_in_a_gateway_too() {
    let Some(python) = python() else {
        return;
    };
    let (rig, gateway) = (shown("rig.toml"), shown("gateway.toml"));
    let specimen = rig.split_once("[[specimen]]").unwrap().1;
    let similitude = "similitude = { length = 2, force = 4 }\nrows = [[1, 0, 0], [0, 1, 0]]\n";
    let specimen = with(
        &format!("[[specimen]]{specimen}"),
        "name = \"column\"\n",
        &format!("name = \"column\"\n{similitude}"),
    );
    let ats = "\n[specimen.compensation.ats]\nstart = [1, 0.015]\norder = 1\n";
    for (is_compensated, allowed) in [(false, [0.01, 2e-3, 0.01]), (true, [0.01, 2e-4, 2e-3])] {
        let (gateway, specimen) = if is_compensated {
            (gateway.clone(), format!("{specimen}{ats}"))
        } else {
            (without_compensation(&gateway), specimen.clone())
        };
        let laboratory = Laboratory::start(&rig, &gateway);
        let (steps, dt, damping) = (STEPS.to_string(), DT.to_string(), DAMPING.to_string());
        laboratory.differences(
            &python,
            &["--steps", &steps, "--dt", &dt, "--damping", &damping],
        );
        let by_gateway = tracking(&laboratory.record(1));
        let folder = tempfile::tempdir().unwrap();
        let file = write(folder.path(), "frame.toml", &test_file(&specimen));
        let mut command = gusset();
        let out = folder.path().join("run");
        command.arg("run").arg(file).arg("--out").arg(&out);
        let output = finish(command);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let by_test = tracking(&Run::open(&out).unwrap());
        for (one, other) in by_gateway.iter().zip(&by_test) {
            let (one, other) = (figures(one), figures(other));
            for (place, allowed) in allowed.iter().enumerate() {
                let difference = (one[place] - other[place]).abs();
                assert!(difference < *allowed, "{is_compensated} {one:?} {other:?}");
            }
            let lag = if is_compensated { 0.0 } else { 0.015 };
            assert!((one[1] - lag).abs() < 2e-3, "{one:?}");
        }
    }
}

#[test]
fn killed_opensees_leaves_the_last_target() {
    let Some(python) = python() else {
        return;
    };
    let gateway = without_compensation(&shown("gateway.toml"));
    let laboratory = Laboratory::start(&ideal_rig(), &gateway);
    let endless = ["--steps", "100000", "--report-step", "60"];
    let mut frame = laboratory.frame(&python, &endless);
    frame.event("step");
    frame.kill();
    let run = laboratory.record(1);
    let summary = run.summary().unwrap();
    assert_eq!(summary.status, Status::Failed, "{}", summary.reason);
    assert!(summary.steps >= 60, "{}", summary.steps);
    let rig = Laboratory::ended(&laboratory.theirs, 1);
    for axis in 1..=2 {
        let [target, told] = ["target", "cmd"].map(|name| last(&run, &format!("{name}_1_{axis}")));
        // The target is a stroke in m at full scale, and the command one in mm at half scale: the last path has ended.
        assert!(
            told != 0.0 && (told * 2e-3 - target).abs() < 1e-15,
            "{told} {target}"
        );
        assert_eq!(told, last(&rig, &format!("cmd_1_{axis}")), "axis {axis}");
    }
    // The next client finds the rig there, and its own start is reached by a ramp.
    let differences = laboratory.differences(&python, &[]);
    assert!(differences.iter().all(|one| *one < SAME), "{differences:?}");
}

/// True while a client has an open connection with this port: state 01 in the table of the system. A client that does not close its
/// end keeps it in another state.
fn is_connected(port: &str) -> bool {
    let hex = format!(":{:04X}", port.parse::<u16>().unwrap());
    let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
    table.lines().skip(1).any(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        words[2].ends_with(&hex) && words[3] == "01"
    })
}

#[test]
fn killed_rig_ends_the_opensees_connection() {
    let Some(python) = python() else {
        return;
    };
    let gateway = without_compensation(&shown("gateway.toml"));
    let mut laboratory = Laboratory::start(&ideal_rig(), &gateway);
    let endless = ["--steps", "100000", "--report-step", "60"];
    let mut frame = laboratory.frame(&python, &endless);
    frame.event("step");
    assert!(is_connected(laboratory.port()));
    laboratory.rig.kill();
    let run = laboratory.record(1);
    let summary = run.summary().unwrap();
    assert_eq!(summary.status, Status::Failed, "{}", summary.reason);
    assert!(summary.steps >= 60, "{}", summary.steps);
    assert_eq!(last(&run, "trip"), 70.0, "specimen lost");
    wait_for("the end of the connection", || {
        !is_connected(laboratory.port())
    });
    // genericClient may wait for ever.
    frame.kill();
    assert!(frame.events("result").is_empty());
}

#[test]
fn newton_is_refused_at_its_second_target() {
    let Some(python) = python() else {
        return;
    };
    let gateway = without_compensation(&shown("gateway.toml"));
    let laboratory = Laboratory::start(&ideal_rig(), &gateway);
    let mut frame = laboratory.frame(&python, &["--scheme", "newton"]);
    frame.event("loaded");
    let run = laboratory.record(1);
    frame.kill();
    let summary = run.summary().unwrap();
    assert_eq!(summary.status, Status::Stopped, "{}", summary.reason);
    assert_eq!(last(&run, "trip"), 54.0, "trial too far");
    // The first target of the step was followed, and nothing of the second left.
    let states = run.columns(&["state"]).unwrap().remove(0);
    assert_eq!(*states.last().unwrap(), 8.0);
    let rig = Laboratory::ended(&laboratory.theirs, 1);
    for axis in 1..=2 {
        let name = format!("cmd_1_{axis}");
        let commands = run.columns(&[&name]).unwrap().remove(0);
        assert_eq!(commands[commands.len() - 2], last(&rig, &name));
    }
}

/// A specimen between targets on the move: the rows of the table, each with its device, its law at half the speed of the model, whether the
/// rig lags by 15 ms, the time that OpenSees takes before each step, and the largest difference of the sway.
#[test]
fn damper_has_its_force_on_the_move() {
    let Some(python) = python() else {
        return;
    };
    let pace = PAGE
        .lines()
        .find(|line| line.contains("between = \"predict\""))
        .unwrap();
    let damper = "linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 297600 }";
    let brace =
        "bilinear = { stiffness_n_per_m = 2e6, yield_force_n = 20e3, post_yield_ratio = 0.05 }";
    // 25e3 N (s/m)^0.4, at half the speed.
    let power = "power_damper = { force_at_unit_velocity_n = 32987.7, exponent = 0.4, reference_damping_n_s_per_m = 1e6 }";
    let rubber = "parallel = [{ linear = { stiffness_n_per_m = 5e5 } }, { maxwell = { stiffness_n_per_m = 5e5, force_at_unit_velocity_n = 3e5 } }]";
    for (device, law, lags, delay, most) in [
        ("damper", damper, false, &["--delay-ms", "0"][..], 0.003),
        (
            "damper",
            damper,
            true,
            &["--delay-ms", "10", "--random"],
            0.003,
        ),
        ("power", power, false, &["--delay-ms", "0"], 0.01),
        ("rubber", rubber, false, &["--delay-ms", "10"], 0.01),
        (
            "bilinear",
            brace,
            true,
            &["--delay-ms", "50", "--random"],
            0.01,
        ),
    ] {
        let (transfer, led) = match lags {
            true => (
                "transfer.actuator.first_order = { time_constant_s = 0.015 }\n",
                "compensation.ats = { start = [1, 0.015], order = 1 }\n",
            ),
            false => ("", ""),
        };
        let rig = format!("[[specimen]]\nname = \"device\"\nlaw.{law}\n{transfer}");
        let gateway = format!(
            "[serve]\nprotocol = \"openfresco\"\n{}\n[[specimen]]\nname = \"device\"\nstiffness_n_per_m = 1e6\n{led}\
             [specimen.limits]\ncommand_disp_m = {{ trip = [-0.3, 0.3] }}\ncommand_vel_m_per_s = {{ trip = 3 }}\n\
             command_accel_m_per_s2 = {{ trip = 3e4 }}\nmeasured_disp_m = {{ trip = [-0.3, 0.3] }}\nmeasured_force_n = {{ trip = [-1e6, 1e6] }}\n\
             [specimen.link]\naddress = \"127.0.0.1:27511\"\nprobe = \"none\"\n",
            pace.replace("0.02", "0.05")
        );
        let laboratory = Laboratory::start(&rig, &gateway);
        let arguments = ["--port", laboratory.port(), "--device", device];
        let mut made = Peer::script(&python, "device.py", &[&arguments, delay].concat());
        let result = made.event("result");
        let off = result["sway"].as_f64().unwrap();
        assert!(off < most, "{device} {delay:?}: {off}");
        let run = laboratory.record(1);
        let summary = run.summary().unwrap();
        assert_eq!(summary.status, Status::Completed, "{}", summary.reason);
        let times = summary.between_targets.unwrap().whole;
        // OpenSees is late where it takes longer than 60 % of 20 ms.
        assert_eq!(times.holding > 0.2, delay[1] == "50", "{times:?}");
    }
}
