//! A gateway that paces and compensates a client of OpenFresco's protocols in front of a rig with a lag: its record, and its end
//! when either side ends.

use crate::test_file::TestFile;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::link_common::{PATIENCE, Served, assert_replays};
use gusset_quantity::substructure::Command;
use gusset_record::Run;
use gusset_record::summary::Status;
use gusset_wire::handshake::{
    self, Arm, Axis, Control, Hello, Limits, Sampling, Unit, Versions, layout_hash,
};
use gusset_wire::native::{Decoder, Encoder, Frame, LARGEST_FRAME, split};
use gusset_wire::{Progress, Side};

/// Doubles of a vector.
const N: usize = 16;

const RIG: &str = "[[specimen]]\nname = \"column\"\nlaw = { linear = { stiffness_n_per_m = 4e5 } }\n\
                   transfer.actuator.first_order = { time_constant_s = 0.015 }\n";

/// The compensation of most gateways.
const INVERSE: &str = "inverse = { delay_s = 0.015 }";

/// The text of a gateway at twice the scale of its rig.
fn gateway(rig: &Served, pace: &str, more: &str, compensation: &str) -> String {
    let accel = match pace.contains("predict") {
        true => ", command_accel_m_per_s2 = { trip = 1e5 }",
        false => "",
    };
    format!(
        "[serve]\npace = {{ {pace} }}\n{more}\n[safety]\nunlimited = \"a formula\"\n[[specimen]]\nname = \"column\"\n\
         stiffness_n_per_m = 4e5\nsimilitude = {{ length = 2, force = 2 }}\ncompensation.{compensation}\n\
         limits = {{ command_vel_m_per_s = {{ trip = 10 }}, lag_s = {{ trip = 0.1 }}{accel} }}\n\
         [specimen.link]\naddress = \"{}\"\nprobe = \"none\"\ncomputed = true\nreply_timeout_s = 1\n",
        rig.address
    )
}

struct Bench {
    rig: Served,
    gateway: Served,
    out: PathBuf,
    _folder: tempfile::TempDir,
}

impl Bench {
    fn new(pace: &str, more: &str) -> Self {
        Self::speaking("openfresco", pace, more, INVERSE)
    }

    fn speaking(protocol: &str, pace: &str, more: &str, compensation: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let rig = Served::start(folder.path(), RIG, &[]);
        let out = folder.path().join("kept");
        let text = gateway(&rig, pace, more, compensation);
        let arguments = ["--protocol", protocol, "--out", out.to_str().unwrap()];
        let gateway = Served::start(folder.path(), &text, &arguments);
        Self {
            rig,
            gateway,
            out,
            _folder: folder,
        }
    }

    /// The record of the first test, once the gateway has closed it. It replays to the last bit.
    fn kept(&self) -> Run {
        let folder = self.out.join("test-0001");
        while !folder.join("summary.json").exists() {
            std::thread::yield_now();
        }
        assert_replays(&folder);
        Run::open(&folder).unwrap()
    }
}

fn column(run: &Run, name: &str) -> Vec<f64> {
    run.columns(&[name]).unwrap().remove(0)
}

/// A client of one displacement that sends the time.
struct Client(TcpStream);

impl Client {
    fn new(address: &str) -> Self {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let counts = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, N as i32];
        let bytes: Vec<u8> = counts.into_iter().flat_map(i32::to_le_bytes).collect();
        stream.write_all(&bytes).unwrap();
        Self(stream)
    }

    fn says(&mut self, values: &[f64]) {
        let mut vector = [0.0; N];
        vector[..values.len()].copy_from_slice(values);
        let bytes: Vec<u8> = vector.into_iter().flat_map(f64::to_le_bytes).collect();
        self.0.write_all(&bytes).unwrap();
    }

    /// The force at a target; none if the gateway closes.
    fn force(&mut self, disp: f64, time: f64) -> Option<f64> {
        self.says(&[3.0, disp, time]);
        self.says(&[10.0]);
        let mut answer = [0; 8 * N];
        self.0.read_exact(&mut answer).ok()?;
        Some(f64::from_le_bytes(answer[..8].try_into().unwrap()))
    }

    fn commits(&mut self) {
        self.says(&[5.0]);
    }
}

#[test]
fn closing_client_leaves_specimen_at_rest() {
    let bench = Bench::new("ticks_per_step = 40, rate_hz = 2000, settle_ticks = 90", "");
    let mut client = Client::new(&bench.gateway.address);
    for step in 1..=12_i32 {
        let disp = 0.004 * libm::sin(1.5 * f64::from(step));
        let force = client.force(disp, 0.065 * f64::from(step)).unwrap();
        // The spring of the rig is 4e5 N/m at half the scale: at the target within what 45 ms leave of a lag of 15 ms.
        assert!(
            (force - 4e5 * disp).abs() < 0.2 * 4e5 * 0.004,
            "{force} {disp}"
        );
        client.commits();
    }
    assert!(client.force(0.002, 0.065 * 13.0).is_some());
    drop(client);
    let run = bench.kept();
    let summary = run.summary().unwrap();
    assert_eq!(summary.status, Status::Failed, "{}", summary.reason);
    let trips = column(&run, "trip");
    assert!(trips.iter().all(|code| *code == 0.0), "{}", summary.reason);
    let (commands, velocities) = (column(&run, "cmd_1_1"), column(&run, "vel_1_1"));
    // The compensator has forgotten the motion after 90 ticks.
    assert!(
        (commands.last().unwrap() - 0.001).abs() < 1e-9,
        "{:?}",
        commands.last()
    );
    assert!(velocities.last().unwrap().abs() < 1e-9);
    let most = commands.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(most.fold(0.0, f64::max) < 0.002 * 31.0 / 40.0);
    // 13 targets of 130 commands, and the reading at rest.
    assert_eq!(commands.len(), 13 * 130 + 1);
    let lags = column(&run, "lag_1_1");
    assert!(lags.iter().any(|lag| lag.abs() < 0.01), "{:?}", lags.last());
    let states = column(&run, "state");
    assert_eq!(states.iter().filter(|state| **state == 5.0).count(), 130);
}

/// Late targets are gaps for an adaptive compensator, and a silent client lets the specimen rest: the rows have both.
#[test]
fn late_targets_replay_with_an_adaptive_compensator() {
    let adaptive = "ats = { delay_s = 0.015, window_s = 0.1, least_motion_m = 1e-5 }";
    let pace = "ticks_per_step = 20, rate_hz = 250";
    let bench = Bench::speaking("openfresco", pace, "", adaptive);
    let mut client = Client::new(&bench.gateway.address);
    for step in 1..=60_i32 {
        let disp = 0.004 * libm::sin(0.7 * f64::from(step));
        assert!(client.force(disp, 0.02 * f64::from(step)).is_some());
        client.commits();
        if step % 15 == 0 {
            gusset_session::pause(Duration::from_millis(60));
        }
    }
    drop(client);
    let run = bench.kept();
    let between = column(&run, "between");
    let late = between.iter().filter(|flags| **flags == 32.0);
    assert!(late.count() >= 3);
    let learns = |name: &str| {
        let values = column(&run, name);
        values.iter().any(|value| *value != values[0])
    };
    let columns = run.layout().columns().iter();
    let mut learned = columns.filter(|column| column.name.starts_with("comp_"));
    assert!(learned.any(|column| learns(&column.name)));
}

/// Waits until more rows are there than after the last call.
fn runs_on(bench: &Bench) {
    let samples = bench.out.join("test-0001/samples.bin");
    let length = || std::fs::metadata(&samples).map_or(0, |m| m.len());
    let before = length();
    while length() < before + 20_000 {
        std::thread::yield_now();
    }
}

#[test]
fn dying_client_lets_the_specimen_slow_down() {
    let bench = Bench::new("ticks_per_step = 20000, rate_hz = 1000", "");
    let mut client = Client::new(&bench.gateway.address);
    client.says(&[3.0, 0.004, 0.01]);
    runs_on(&bench);
    drop(client);
    rests_on_the_way(&bench, 0.002);
}

/// A client of Gusset's own protocol, which has sent its first command.
fn native(address: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let axis = Axis {
        name: "axis 1".to_owned(),
        disp_unit: Unit::Metre,
        force_unit: Unit::Newton,
        limits: Limits::NONE,
    };
    let hello = Hello {
        proof: [0; 32],
        nonce: [7; 32],
        layout: layout_hash(std::slice::from_ref(&axis)),
        versions: Versions::OURS,
        keyed: false,
        rate_numerator: 1,
        rate_denominator: 25,
        watchdog_s: 25.0,
        sampling: Sampling::Reply,
        software: "test".to_owned(),
        name: "test".to_owned(),
        axes: vec![axis],
    };
    let (mut encoder, mut decoder) = (
        Encoder::greeting(Side::Controller),
        Decoder::greeting(Side::Specimen),
    );
    let mut out = vec![0; LARGEST_FRAME];
    let mut ask = |encoder: &mut Encoder, decoder: &mut Decoder, control: &Control| {
        let message = handshake::encode(control).unwrap();
        let length = encoder.control(&message, &mut out).unwrap();
        stream.write_all(&out[..length]).unwrap();
        let mut bytes = Vec::new();
        while !matches!(split(&bytes), Ok(Progress::Frame { .. })) {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap();
            bytes.push(byte[0]);
        }
        match decoder.open(&bytes).unwrap().frame {
            Frame::Control(message) => handshake::decode(message).unwrap(),
            other => panic!("{other:?}"),
        }
    };
    let answer = ask(&mut encoder, &mut decoder, &Control::Hello(hello));
    let Control::Welcome(welcome) = answer else {
        panic!("not welcome: {answer:?}");
    };
    let session = welcome.session;
    encoder = Encoder::new(Side::Controller, 1, session, None).unwrap();
    decoder = Decoder::new(Side::Specimen, 1, session, None).unwrap();
    let arm = Arm {
        session,
        first_sequence: 0,
        disp: vec![0.0],
    };
    let answer = ask(&mut encoder, &mut decoder, &Control::Arm(arm));
    assert!(matches!(answer, Control::Arm(_)), "{answer:?}");
    let command = Command {
        sequence: 0,
        time: 0.0,
        dt: 25.0,
        // A controller begins within 1 mm of the place that it named.
        disp: &[0.0009],
        vel: &[0.0],
    };
    let mut out = vec![0; LARGEST_FRAME];
    let length = encoder.command(&command, &mut out).unwrap();
    stream.write_all(&out[..length]).unwrap();
    stream
}

#[test]
fn dying_native_client_slows_the_specimen() {
    let pace = "ticks_per_step = 20000, rate_hz = 1000";
    let bench = Bench::speaking("gusset", pace, "", INVERSE);
    let stream = native(&bench.gateway.address);
    runs_on(&bench);
    drop(stream);
    rests_on_the_way(&bench, 0.000_45);
}

/// `target` is that of the rig, in m.
fn rests_on_the_way(bench: &Bench, target: f64) {
    let run = bench.kept();
    let summary = run.summary().unwrap();
    assert_eq!(summary.status, Status::Failed, "{}", summary.reason);
    let (commands, velocities) = (column(&run, "cmd_1_1"), column(&run, "vel_1_1"));
    assert!(*commands.last().unwrap() < 0.5 * target);
    assert!(commands.len() < 15_000, "{}", commands.len());
    assert!(velocities.last().unwrap().abs() < 1e-9);
    let fastest = velocities.iter().copied().fold(0.0, f64::max);
    let hardest = velocities.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(fastest > 0.0 && hardest.fold(0.0, f64::max) < 0.1 * fastest);
}

#[test]
fn client_may_query_but_not_run_ahead() {
    let bench = Bench::new(
        "ticks_per_step = 1500, rate_hz = 1000",
        "openfresco.idle_timeout_s = 1",
    );
    let mut client = Client::new(&bench.gateway.address);
    client.says(&[3.0, 0.001, 0.01]);
    runs_on(&bench);
    client.says(&[10.0]);
    let mut answer = [0; 8 * N];
    client.0.read_exact(&mut answer).unwrap();
    let force = f64::from_le_bytes(answer[..8].try_into().unwrap());
    assert!((force - 4e2).abs() < 0.05 * 4e2, "{force}");
    // A new target before the answer to the last request is one too many.
    client.says(&[5.0]);
    client.says(&[3.0, 0.002, 0.02]);
    runs_on(&bench);
    client.says(&[10.0]);
    client.says(&[5.0]);
    client.says(&[3.0, 0.003, 0.03]);
    let run = bench.kept();
    let summary = run.summary().unwrap();
    assert_eq!(summary.status, Status::Failed, "{}", summary.reason);
    let commands = column(&run, "cmd_1_1");
    let farthest = commands.iter().copied().fold(0.0, f64::max);
    // The rig has half of the client's scale.
    assert!(farthest < 0.0011, "{farthest}");
}

#[test]
fn rig_lost_in_a_move_ends_the_test() {
    let mut bench = Bench::new("ticks_per_step = 20000, rate_hz = 1000", "");
    let mut client = Client::new(&bench.gateway.address);
    client.says(&[3.0, 0.004, 0.01]);
    while std::fs::metadata(bench.out.join("test-0001/samples.bin")).map_or(0, |m| m.len()) < 20_000
    {
        std::thread::yield_now();
    }
    bench.rig.kill();
    assert_eq!(client.force(0.005, 0.01), None);
    let run = bench.kept();
    let summary = run.summary().unwrap();
    assert_eq!(summary.status, Status::Failed);
    assert!(summary.reason.contains("lost"), "{}", summary.reason);
    let commands = column(&run, "cmd_1_1");
    assert!(*commands.last().unwrap() < 0.002, "nothing leads on");
}

#[test]
fn stopped_server_slows_down_first() {
    let bench = Bench::new("ticks_per_step = 1000, rate_hz = 1000", "");
    let mut client = Client::new(&bench.gateway.address);
    assert!(client.force(0.0, 0.0).is_some());
    client.says(&[3.0, 0.004, 0.01]);
    // On the second path.
    let samples = bench.out.join("test-0001/samples.bin");
    let first = std::fs::metadata(&samples).map_or(0, |m| m.len());
    while std::fs::metadata(&samples).map_or(0, |m| m.len()) < first + 20_000 {
        std::thread::yield_now();
    }
    bench.gateway.send("INT");
    let run = bench.kept();
    assert_eq!(run.summary().unwrap().status, Status::Interrupted);
    let velocities = column(&run, "vel_1_1");
    assert!(
        velocities.last().unwrap().abs() < 1e-6,
        "{:?}",
        velocities.last()
    );
    assert!(velocities.iter().any(|vel| *vel > 1e-5));
}

#[test]
fn second_target_of_a_step_trips() {
    let pace = "ticks_per_step = 10, rate_hz = 2000";
    for (more, near) in [("", false), ("openfresco.iterates_within_m = 0.0005", true)] {
        let bench = Bench::new(pace, more);
        let mut client = Client::new(&bench.gateway.address);
        assert!(client.force(0.001, 0.01).is_some());
        assert!(client.force(0.001, 0.01).is_some(), "the same target again");
        assert_eq!(client.force(0.0014, 0.01).is_some(), near);
        if near {
            assert_eq!(client.force(0.0016, 0.01), None);
        }
        let run = bench.kept();
        let summary = run.summary().unwrap();
        assert_eq!(summary.status, Status::Stopped, "{}", summary.reason);
        let trips = column(&run, "trip");
        assert_eq!(*trips.last().unwrap(), 54.0);
        assert_eq!(*column(&run, "state").last().unwrap(), 8.0);
        let commands = column(&run, "cmd_1_1");
        let most = commands
            .iter()
            .copied()
            .filter(|disp| disp.is_finite())
            .fold(0.0, f64::max);
        assert!(most < if near { 0.002 } else { 0.0015 }, "{most}");
    }
}

#[test]
fn six_displacements_command_four_axes() {
    let folder = tempfile::tempdir().unwrap();
    let laws = "[[specimen.laws]]\nlinear = { stiffness_n_per_m = 4e5 }\n".repeat(4);
    let rig = Served::start(
        folder.path(),
        &format!("[[specimen]]\nname = \"platform\"\n{laws}"),
        &[],
    );
    let row = |index: usize| {
        let entries: Vec<String> = (0..6)
            .map(|k| f64::from(u8::from(k == index)).to_string())
            .collect();
        format!("[{}]", entries.join(", "))
    };
    let matrix = |size: usize| {
        let rows: Vec<String> = (0..4)
            .map(|i| {
                let row: Vec<String> = (0..size)
                    .map(|j| if i == j { "4e5" } else { "0" }.to_owned())
                    .collect();
                format!("[{}]", row.join(", "))
            })
            .collect();
        format!("[{}]", rows.join(", "))
    };
    let text = format!(
        "[safety]\nunlimited = \"a formula\"\n[[specimen]]\nname = \"platform\"\nstiffness_n_per_m = {}\nrows = [{}]\n\
         geometry.law_at = \"actuators\"\ngeometry.coordinates = [\"ux\", \"uy\", \"uz\", \"rz\"]\n\
         geometry.space = [\n\
         {{ base_m = [-1, 0.5, 0], joint_m = [0, 0.5, 0] }},\n{{ base_m = [-1, -0.5, 0], joint_m = [0, -0.5, 0] }},\n\
         {{ base_m = [0, -1, 0], joint_m = [0, 0, 0] }},\n{{ base_m = [0, 0, -1], joint_m = [0, 0, 0] }},\n]\n\
         [specimen.link]\naddress = \"{}\"\nprobe = \"none\"\ncomputed = true\n",
        matrix(4),
        [0, 1, 2, 5].map(row).join(", "),
        rig.address
    );
    let served = Served::start(folder.path(), &text, &["--protocol", "openfresco"]);
    let mut stream = TcpStream::connect(&served.address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let counts = [6, 0, 0, 0, 1, 0, 0, 0, 6, 0, N as i32];
    let bytes: Vec<u8> = counts.into_iter().flat_map(i32::to_le_bytes).collect();
    stream.write_all(&bytes).unwrap();
    let mut client = Client(stream);
    let pose = [1e-4, -2e-4, 3e-4, 0.5, 0.6, 0.0];
    client.says(&[&[3.0], &pose[..], &[0.01]].concat());
    client.says(&[10.0]);
    let mut answer = [0; 8 * N];
    client.0.read_exact(&mut answer).unwrap();
    let forces: Vec<f64> = answer
        .chunks_exact(8)
        .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
        .take(6)
        .collect();
    // Two actuators along x, one along y and one along z; small motions.
    let wanted = [80.0, -80.0, 120.0, 0.0, 0.0, 0.0];
    for (found, wanted) in forces.iter().zip(wanted) {
        assert!((found - wanted).abs() < 0.5, "{forces:?}");
    }
    // The other two rotations have no coordinate, and no force.
    assert_eq!(forces[3..5], [0.0, 0.0]);
}

#[test]
fn six_forces_for_three_axes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let laws = "[[specimen.laws]]\nlinear = { stiffness_n_per_m = 4e5 }\n".repeat(3);
    let text = format!("[[specimen]]\nname = \"brace\"\n{laws}");
    let served = Served::start(
        Path::new(folder.path()),
        &text,
        &["--protocol", "openfresco"],
    );
    let mut stream = TcpStream::connect(&served.address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let counts = [3, 3, 3, 0, 1, 3, 3, 3, 6, 1, 32];
    let bytes: Vec<u8> = counts.into_iter().flat_map(i32::to_le_bytes).collect();
    stream.write_all(&bytes).unwrap();
    served.hears("invertedVBrace");
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert!(rest.is_empty());
}

#[test]
fn accepted_speed_is_in_the_summary() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Served::start(folder.path(), RIG, &[]);
    let out = folder.path().join("kept");
    let text = gateway(&rig, "ticks_per_step = 20, rate_hz = 2000", "", INVERSE)
        .with("specimen.damping_n_s_per_m = 100\nsafety.accept_speed = \"hardly damped\"");
    let arguments = ["--protocol", "openfresco", "--out", out.to_str().unwrap()];
    let gateway = Served::start(folder.path(), &text, &arguments);
    let bench = Bench {
        rig,
        gateway,
        out,
        _folder: folder,
    };
    let mut client = Client::new(&bench.gateway.address);
    assert!(client.force(1e-4, 0.01).is_some());
    drop(client);
    let run = bench.kept();
    let summary = run.summary().unwrap();
    assert_eq!(summary.accepted["accept_speed"], "hardly damped");
    let verdict = summary.verdict.as_ref().unwrap();
    assert_eq!(verdict.findings[0].severity, "accepted");
}

const PREDICTS: &str =
    "ticks_per_step = 20, rate_hz = 1000, between = \"predict\", predict_within_m = 0.01";

/// A smooth motion of the client at its structure.
fn sway(step: i32) -> f64 {
    0.004 * (1.0 - libm::cos(0.2 * f64::from(step)))
}

/// Targets in time and late ones: the specimen keeps moving between them, and its record replays to the last bit, with its rest after the
/// client has gone.
#[test]
fn specimen_that_goes_on_replays() {
    let bench = Bench::new(PREDICTS, "");
    let mut client = Client::new(&bench.gateway.address);
    for step in 0..=60_i32 {
        let force = client.force(sway(step), 0.02 * f64::from(step)).unwrap();
        // The inverse of the lag leaves a per mille or so of the motion.
        assert!(
            (force - 4e5 * sway(step)).abs() < 0.02 * 4e5 * 0.008,
            "{step}: {force}"
        );
        client.commits();
        if step % 15 == 14 {
            gusset_session::pause(Duration::from_millis(60));
        }
    }
    drop(client);
    let run = bench.kept();
    let summary = run.summary().unwrap();
    let times = summary.between_targets.unwrap();
    assert!(
        times.whole.holding > 0.05 && times.whole.slow_downs >= 3,
        "{times:?}"
    );
    let shares = [
        times.whole.correcting,
        times.whole.predicting,
        times.whole.slowing,
        times.whole.holding,
    ];
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    let states = column(&run, "state");
    for state in [3.0, 11.0, 12.0, 13.0] {
        assert!(states.contains(&state), "{state}");
    }
    // One row of each target has its force; the first is reached by a ramp.
    assert_eq!(states.iter().filter(|state| **state == 3.0).count(), 60);
    let (targets, commands) = (column(&run, "target_1_1"), column(&run, "cmd_1_1"));
    let vel = column(&run, "vel_1_1");
    assert!(vel.last().unwrap().abs() < 1e-3, "{:?}", vel.last());
    let last = sway(60);
    assert!((targets.last().unwrap() - last).abs() < 0.01);
    let jumps = commands.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(jumps.fold(0.0, f64::max) < 2e-4);
}

#[test]
fn predicting_gateway_refuses_what_it_cannot_follow() {
    let ends = |within: &str, act: &dyn Fn(&mut Client), words: &str| {
        let pace = PREDICTS.replace("0.01", within);
        let bench = Bench::new(&pace, "");
        let mut client = Client::new(&bench.gateway.address);
        for step in 0..=10_i32 {
            client.force(sway(step), 0.02 * f64::from(step)).unwrap();
            client.commits();
        }
        act(&mut client);
        let run = bench.kept();
        let summary = run.summary().unwrap();
        assert!(summary.reason.contains(words), "{}", summary.reason);
        assert!(column(&run, "vel_1_1").last().unwrap().abs() < 1e-3);
    };
    ends(
        "0.01",
        &|client| {
            client.force(sway(11), 0.22).unwrap();
            assert_eq!(client.force(sway(11) + 1e-4, 0.22), None);
        },
        "second target",
    );
    ends(
        "0.01",
        &|client| assert_eq!(client.force(sway(11), 0.21), None),
        "another length",
    );
    ends(
        "0.001",
        &|client| assert_eq!(client.force(sway(10) + 0.008, 0.22), None),
        "predict_within_m",
    );
}

/// A rig with a lag that nothing makes up for: the correction adds what the force lacks, up to its bound.
#[test]
fn force_is_corrected_by_the_initial_stiffness() {
    let corrects = format!("{PREDICTS}, correct = \"initial_stiffness\", correct_at_most_n = 60");
    let bench = Bench::speaking(
        "openfresco",
        &corrects,
        "",
        "polynomial = { order = 1, delay_s = 0.005 }",
    );
    let mut client = Client::new(&bench.gateway.address);
    let mut forces = Vec::new();
    for step in 0..=60_i32 {
        forces.push(client.force(sway(step), 0.02 * f64::from(step)).unwrap());
        client.commits();
    }
    drop(client);
    let run = bench.kept();
    let (states, corrections) = (column(&run, "state"), column(&run, "correction_1_1"));
    let measured = column(&run, "force_1_1");
    let at_targets = |values: &[f64]| -> Vec<f64> {
        let rows = states
            .iter()
            .zip(values)
            .filter(|(state, _)| **state == 3.0);
        rows.map(|(_, value)| *value).collect()
    };
    let (corrections, measured) = (at_targets(&corrections), at_targets(&measured));
    assert_eq!(corrections.len(), 60);
    let mut bounded = 0;
    for (step, force) in (1_i32..).zip(&forces[1..]) {
        let index = step as usize - 1;
        // The record keeps what was measured, and the correction beside it.
        let own = corrections[index];
        let told = measured[index] + own;
        assert!((force - told).abs() < 1e-6, "{step}: {force} {told}");
        let lacks = 4e5 * sway(step) - measured[index];
        assert!(own.abs() <= 60.0 * (1.0 + 1e-12));
        bounded += usize::from(lacks.abs() > 60.0);
    }
    assert!(bounded > 5, "{bounded}");
    assert!(
        column(&run, "correction_energy_1")
            .iter()
            .any(|energy| *energy != 0.0)
    );
}
