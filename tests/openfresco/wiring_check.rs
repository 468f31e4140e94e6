//! The wiring check works over OpenFresco's dialects, too. A gateway connects OpenSees' adapter to a controller with the native
//! protocol.

use crate::test_file::TestFile;
use std::io::Write;
use std::net::TcpStream;
use std::path::Path;
use std::process::Stdio;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};

use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, PATIENCE, Running, Served, adapter, columns, gateway, gusset, run,
    summary, test_file, write,
};
use gusset_record::Run;
use gusset_record::summary::Status;

const STEPS: u32 = 100;
const K: f64 = 4e5;
const PROBE: &str = "probe_m = 1e-4\nprobe_ramp_s = 0.05\n";
const ADAPTER: &str = "protocol = \"openfresco-adapter\"\n";

fn linked(address: &str, keys: &str) -> String {
    let link = format!("[specimen.link]\naddress = \"{address}\"\n{keys}\n");
    test_file(STEPS, &format!("{ONE_AXIS}{link}"))
}

type Wiring = fn(f64) -> (f64, f64);

const WRONG: [(Wiring, &str); 5] = [
    (|d| (d, -K * d), "its force channel is reversed"),
    (|d| (-d, K * d), "its displacement sensor is reversed"),
    (|d| (-d, -K * d), "its actuator moves against the command"),
    (|d| (d, 3.0), "a dead load cell"),
    (|_| (0.0, 0.0), "a dead or frozen sensor"),
];

#[test]
fn miswired_adapter_is_not_armed() {
    for (wiring, words) in WRONG {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let address = adapter::start(move |d| {
            assert!((0.0..=1e-4).contains(&d), "the test moved it: {d}");
            wiring(d)
        });
        let (code, said) = run(
            folder,
            "run",
            &linked(&address, &format!("{ADAPTER}{PROBE}")),
        );
        assert_eq!(code, 3, "{said}");
        let reason = summary(folder, "run").reason;
        assert!(reason.contains(words), "{reason}");
        assert!(reason.contains("specimen \"column\""), "{reason}");
    }
    let folder = tempfile::tempdir().unwrap();
    let address = adapter::start(|d| (d, K * d));
    let text = linked(&address, &format!("{ADAPTER}{PROBE}"));
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 0, "{said}");
}

#[test]
fn gateway_does_not_arm_a_miswired_adapter() {
    for serve in [&["--protocol", "gusset"][..], &["--protocol", "openfresco"]] {
        for (wiring, words) in WRONG {
            let folder = tempfile::tempdir().unwrap();
            let folder = folder.path();
            let address = adapter::start(wiring);
            let file = gateway(
                &address,
                "stiffness_n_per_m = 4e5\n",
                &format!("{ADAPTER}{PROBE}"),
            );
            let between = Served::start(folder, &file.without("specimen.0.link.probe"), serve);
            let keys = format!("protocol = \"{}\"\nprobe = \"none\"", serve[1]);
            let (code, said) = run(folder, "run", &linked(&between.address, &keys));
            assert_eq!(code, 3, "{said}");
            between.hears(words);
        }
    }
}

/// The return half of the wiring check is no step that is taken back, although a shadow sends no time.
#[test]
fn irreversible_rig_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rig = format!(
        "[serve.openfresco]\nphysical = true\n[[specimen]]\nname = \"rig\"\n{ONE_AXIS_LAW}"
    );
    let rig = || Served::start(folder, &rig, &["--protocol", "openfresco-actor"]);
    let no_computation = |text: String| text.without("specimen.0.link.computed");
    let link = format!("protocol = \"openfresco-shadow\"\nstands_at_m = [0.0]\n{PROBE}");
    let direct = rig();
    let (code, said) = run(
        folder,
        "direct",
        &no_computation(linked(&direct.address, &link)).with("time.clock = 'real'"),
    );
    assert_eq!(code, 0, "{said}");
    let far = rig();
    let file = gateway(&far.address, "stiffness_n_per_m = 4e5\n", &link);
    let file = no_computation(file.without("specimen.0.link.probe"));
    let between = Served::start(folder, &file, &[]);
    let (code, said) = run(
        folder,
        "between",
        &linked(&between.address, "probe = \"none\""),
    );
    assert_eq!(code, 0, "{said}");
    between.hears("direction: axis 1");
}

/// A gateway whose wiring check takes ten seconds for each ramp, and a channel that signals when it has begun. Also every
/// displacement that its specimen receives.
fn trying(
    folder: &Path,
    protocol: &str,
    transport: &str,
) -> (Served, Receiver<()>, Arc<Mutex<Vec<f64>>>) {
    let told = Arc::new(Mutex::new(Vec::new()));
    let (goes_on, is_going_on) = channel();
    let into = Arc::clone(&told);
    let address = adapter::start(move |disp| {
        let mut told = into.lock().unwrap();
        told.push(disp);
        if told.len() == 20 {
            goes_on.send(()).unwrap();
        }
        (disp, K * disp)
    });
    let keys = format!("{ADAPTER}probe_m = 1e-4\nprobe_ramp_s = 10\n");
    let file = gateway(&address, "stiffness_n_per_m = 4e5\n", &keys);
    let file = file.without("specimen.0.link.probe");
    let out = folder.join("kept");
    let out = ["--out", out.to_str().unwrap()];
    let arguments = ["--protocol", protocol, "--transport", transport];
    let served = Served::start(folder, &file, &[&arguments[..], &out].concat());
    (served, is_going_on, told)
}

/// How the test of the gateway ended in which the specimen never got to the other end of the small motion.
fn broken_off(folder: &Path, told: &Mutex<Vec<f64>>) -> (Status, String) {
    let largest = told.lock().unwrap().iter().copied().fold(0.0, f64::max);
    assert!(largest < 1e-4, "{largest}");
    let kept = Run::open(&folder.join("kept/test-0001")).unwrap();
    let summary = kept.summary().unwrap();
    (summary.status, summary.reason.clone())
}

/// The sizes of a client of one axis that commands displacements and wants forces.
fn client(address: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    let sizes = [1_i32, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2];
    let sizes: Vec<u8> = sizes.into_iter().flat_map(i32::to_le_bytes).collect();
    stream.write_all(&sizes).unwrap();
    stream
}

#[test]
fn stopped_gateway_ends_its_check_in_place() {
    for protocol in ["openfresco", "gusset"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (mut between, is_going_on, told) = trying(folder, protocol, "tcp");
        let (mut stream, mut test) = (None, None);
        if protocol == "openfresco" {
            stream = Some(client(&between.address));
        } else {
            let text = linked(&between.address, "connect_timeout_s = 60");
            let owned = folder.to_owned();
            test = Some(std::thread::spawn(move || run(&owned, "run", &text)));
        }
        is_going_on.recv_timeout(PATIENCE).unwrap();
        assert_eq!(between.signal("INT"), 130, "{protocol}");
        let (status, reason) = broken_off(folder, &told);
        assert_eq!(status, Status::Interrupted, "{reason}");
        assert!(reason.contains("was stopped"), "{reason}");
        if let Some(test) = test {
            assert_eq!(test.join().unwrap().0, 3);
            let reason = summary(folder, "run").reason;
            assert!(reason.contains("was stopped"), "{reason}");
        }
        drop(stream);
    }
}

#[test]
fn check_ends_when_its_controller_leaves() {
    for protocol in ["openfresco", "gusset"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (between, is_going_on, told) = trying(folder, protocol, "tcp");
        if protocol == "openfresco" {
            let stream = client(&between.address);
            is_going_on.recv_timeout(PATIENCE).unwrap();
            drop(stream);
        } else {
            let text = linked(&between.address, "connect_timeout_s = 60");
            let mut command = gusset();
            let file = write(folder, "run.toml", &text);
            command.arg("run").arg(file);
            command.arg("--out").arg(folder.join("run"));
            let mut controller = command.stderr(Stdio::null()).spawn().unwrap();
            is_going_on.recv_timeout(PATIENCE).unwrap();
            controller.kill().unwrap();
            controller.wait().unwrap();
        }
        // Logged when the folder is closed.
        between.hears(match protocol {
            "openfresco" => "without a goodbye; 0 commands",
            _ => "refused: ",
        });
        let (status, reason) = broken_off(folder, &told);
        assert_eq!(status, Status::Failed, "{reason}");
        assert!(reason.contains("a goodbye"), "{reason}");
    }
}

/// Over UDP no connection shows that a controller is gone: the missing requests to arm do.
#[test]
fn check_ends_when_its_udp_controller_dies() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (between, is_going_on, told) = trying(folder, "gusset", "udp");
    let keys = "transport = \"udp\"\nconnect_timeout_s = 60";
    let mut test = Running::start(folder, "run", &linked(&between.address, keys));
    is_going_on.recv_timeout(PATIENCE).unwrap();
    test.kill();
    between.hears("refused: ");
    let (status, reason) = broken_off(folder, &told);
    assert_eq!(status, Status::Failed, "{reason}");
    assert!(reason.contains("2 s"), "{reason}");
}

/// An operator need not wait until a gateway has checked its specimen: the gateway is informed and ends the check.
#[test]
fn stop_ends_the_wait_for_a_gateways_check() {
    for (transport, signal, code) in [("tcp", "INT", 130), ("udp", "TERM", 143)] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (between, is_going_on, told) = trying(folder, "gusset", transport);
        let keys = format!("transport = \"{transport}\"\nconnect_timeout_s = 60");
        let test = Running::start(folder, "run", &linked(&between.address, &keys));
        is_going_on.recv_timeout(PATIENCE).unwrap();
        test.signal(signal);
        let (found, said) = test.wait();
        assert_eq!(found, code, "{said}");
        between.hears("refused: ");
        let (status, reason) = broken_off(folder, &told);
        assert_eq!(status, Status::Interrupted, "{reason}");
        let told = "its operator";
        assert!(reason.contains(told), "{reason}");
        let summary = summary(folder, "run");
        assert_eq!(summary.status, Status::Interrupted);
        let reason = summary.reason;
        assert!(reason.contains("the operator"), "{reason}");
        assert!(reason.contains("being armed"), "{reason}");
    }
}

#[test]
fn gateway_to_an_adapter_keeps_the_test() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let law = "[specimen.law.linear]\nstiffness_n_per_m = 4e5\n";
    let local = test_file(STEPS, &format!("{ONE_AXIS}{law}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let out = folder.join("kept");
    let address = adapter::start(|d| (d, K * d));
    let file = gateway(&address, "stiffness_n_per_m = 4e5\n", ADAPTER);
    let between = Served::start(folder, &file, &["--out", out.to_str().unwrap()]);
    let (code, said) = run(folder, "run", &linked(&between.address, ""));
    assert_eq!(code, 0, "{said}");
    assert_eq!(columns(folder, "local", ""), columns(folder, "run", ""));
    between.hears("test over");
    let kept = Run::open(&out.join("test-0001")).unwrap();
    assert_eq!(kept.summary().unwrap().steps, u64::from(STEPS) + 1);
}
