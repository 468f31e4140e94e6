//! `gusset serve` on OpenFresco's protocols and the meaning of its clients' messages: the order of SimSimulink's signals, clients
//! that never commit or commit without a time, commanded forces, and analyses that begin again.

use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::path::Path;
use std::time::Duration;

use crate::link_common::{PATIENCE, Served, events, finish, gusset, summary, write};

/// Doubles of a vector.
const N: usize = 16;

const STIFFNESS: f64 = 4e5;
const ONE_SPRING: &str =
    "[[specimen]]\nname = \"column\"\nlaw = { linear = { stiffness_n_per_m = 4e5 } }\n";
const TWO_SPRINGS: &str = "[[specimen]]\nname = \"frame\"\n[[specimen.laws]]\n\
                           linear = { stiffness_n_per_m = 4e5 }\n[[specimen.laws]]\n\
                           linear = { stiffness_n_per_m = 8e5 }\n";
const LIMITS: &str = "[specimen.limits]\ncommand_disp_m = { trip = [-0.1, 0.1] }\n\
                      command_step_m = { trip = 0.05 }\nmeasured_force_n = { trip = [-1e5, 1e5] }\n";

/// A client whose messages the test chooses.
struct Client(TcpStream);

impl Client {
    fn new(served: &Served, counts: [i32; 10]) -> Self {
        let mut stream = TcpStream::connect(&served.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
        let sizes = counts.into_iter().chain([N as i32]);
        let bytes: Vec<u8> = sizes.flat_map(i32::to_le_bytes).collect();
        stream.write_all(&bytes).unwrap();
        Self(stream)
    }

    fn says(&mut self, values: &[f64]) {
        let mut vector = [0.0; N];
        vector[..values.len()].copy_from_slice(values);
        let bytes: Vec<u8> = vector.into_iter().flat_map(f64::to_le_bytes).collect();
        self.0.write_all(&bytes).unwrap();
    }

    fn asks(&mut self, code: f64) -> Vec<f64> {
        self.says(&[code]);
        let mut answer = [0; 8 * N];
        self.0.read_exact(&mut answer).unwrap();
        let words = answer.chunks_exact(8);
        words
            .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
            .collect()
    }

    /// The server must close without a message.
    fn expects_a_close(mut self) {
        let mut answer = Vec::new();
        // A reset is a close, too.
        let _ = self.0.read_to_end(&mut answer);
        assert!(answer.is_empty(), "{answer:?}");
    }
}

fn serve(folder: &Path, text: &str, protocol: &str, more: &[&str]) -> Served {
    let arguments = [&["--protocol", protocol], more].concat();
    Served::start(folder, text, &arguments)
}

#[test]
fn simulink_commands_need_a_named_order() {
    let folder = tempfile::tempdir().unwrap();
    let keyed = format!("{TWO_SPRINGS}[serve.openfresco]\nsignal_order = \"by_axis\"\n");
    let counts = [2, 2, 0, 0, 0, 2, 0, 0, 2, 0];
    for (text, more, wanted) in [
        // d1 f1 d2 f2.
        (keyed.as_str(), &[][..], [0.001, 400.0, 0.002, 1600.0]),
        // The flag is stronger than the key. d1 d2 f1 f2, of the command d1 d2 v1 v2.
        (
            &keyed,
            &["--signal-order", "by_quantity"],
            [0.001, 0.5, 400.0, 4e5],
        ),
    ] {
        let served = serve(folder.path(), text, "openfresco-simulink", more);
        let mut client = Client::new(&served, counts);
        client.says(&[3.0, 0.001, 0.5, 0.002, 0.7]);
        let answer = client.asks(6.0);
        assert_eq!(answer[0], 1.0);
        for (found, wanted) in answer[1..5].iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-9 * wanted, "{answer:?}");
        }
        client.says(&[99.0]);
        served.hears("the client ended the test");
    }
    let out = folder.path().join("runs");
    let more = ["--out", out.to_str().unwrap()];
    let served = serve(folder.path(), TWO_SPRINGS, "openfresco-simulink", &more);
    Client::new(&served, counts).expects_a_close();
    served.hears("signal_order");
    assert!(!out.join("test-0001").exists());
    // The other protocols have only one order.
    for protocol in ["openfresco", "openfresco-controller"] {
        let served = serve(folder.path(), TWO_SPRINGS, protocol, &[]);
        let mut client = Client::new(&served, counts);
        client.says(&[3.0, 0.001, 0.002, 0.5, 0.7]);
        let answer = client.asks(6.0);
        assert!((answer[3] - 1600.0).abs() < 1e-9, "{answer:?}");
    }
}

#[test]
fn simulink_commands_no_axis_to_the_time() {
    let folder = tempfile::tempdir().unwrap();
    // The control points hold d1 t and d2.
    let counts = [2, 0, 0, 0, 1, 2, 0, 0, 0, 0];
    for (more, key) in [
        (&[][..], "`signal_order`"),
        (&["--signal-order", "by_axis"], "by_quantity"),
    ] {
        let served = serve(folder.path(), TWO_SPRINGS, "openfresco-simulink", more);
        Client::new(&served, counts).expects_a_close();
        let end = served.hears("0 commands");
        assert!(end.contains(key) && end.contains("the time"), "{end}");
    }
    let more = ["--signal-order", "by_quantity"];
    let served = serve(folder.path(), TWO_SPRINGS, "openfresco-simulink", &more);
    let mut client = Client::new(&served, counts);
    client.says(&[3.0, 0.001, 0.0005, 0.01]);
    assert_eq!(client.asks(6.0)[..3], [1.0, 0.001, 0.0005]);
}

#[test]
fn server_reports_where_an_order_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    for (text, protocol, more, is_told) in [
        (TWO_SPRINGS, "openfresco-simulink", &[][..], true),
        (ONE_SPRING, "openfresco-simulink", &[], false),
        (TWO_SPRINGS, "openfresco", &[], false),
        (
            TWO_SPRINGS,
            "openfresco-simulink",
            &["--signal-order", "by_axis"],
            false,
        ),
    ] {
        let served = serve(folder.path(), text, protocol, more);
        let _client = TcpStream::connect(&served.address).unwrap();
        let before = served.says_before("connected");
        let told = |line: &String| line.contains("note:") && line.contains("signal_order");
        assert_eq!(before.iter().any(told), is_told, "{protocol} {before:?}");
    }
}

#[test]
fn order_without_effect_is_refused_early() {
    let folder = tempfile::tempdir().unwrap();
    let keyed = format!("{TWO_SPRINGS}[serve.openfresco]\nsignal_order = \"by_axis\"\n");
    for (text, protocol, more) in [
        (keyed.as_str(), "openfresco", None),
        (TWO_SPRINGS, "openfresco-controller", Some("by_quantity")),
        (TWO_SPRINGS, "gusset", Some("by_axis")),
    ] {
        let file = write(folder.path(), "served.toml", text);
        let mut command = gusset();
        command
            .arg("serve")
            .arg(file)
            .args(["--protocol", protocol]);
        if let Some(order) = more {
            command.args(["--signal-order", order]);
        }
        let output = finish(command);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        let key = more.map_or("signal_order", |_| "--signal-order");
        assert!(said.contains(key), "{said}");
    }
    // Over our own protocol the whole table has no effect.
    serve(folder.path(), &keyed, "gusset", &[]);
}

#[test]
fn client_that_never_commits_has_no_history() {
    let folder = tempfile::tempdir().unwrap();
    let physical = format!("{ONE_SPRING}{LIMITS}[serve.openfresco]\nphysical = true\n");
    for (name, text) in [("physical", physical.as_str()), ("computed", ONE_SPRING)] {
        let out = folder.path().join(name);
        let more = ["--out", out.to_str().unwrap()];
        let served = serve(folder.path(), text, "openfresco", &more);
        // As OpenFresco's C client: no time, and forces back.
        let mut client = Client::new(&served, [1, 1, 1, 0, 0, 0, 0, 0, 1, 0]);
        for disp in [0.0, 0.005, 0.01, 0.005, 0.0] {
            client.says(&[3.0, disp]);
            assert!((client.asks(10.0)[0] - STIFFNESS * disp).abs() < 1e-9);
        }
        client.says(&[99.0]);
        served.hears("5 commands without a commit");
        let end = served.hears("the client ended the test");
        assert!(end.contains("0 steps committed, 0"), "{end}");
        drop(served);
        let warnings = summary(&out, "test-0001").warnings;
        let told = |text: &&String| text.contains("without a");
        assert_eq!(warnings.iter().filter(told).count(), 1, "{warnings:?}");
        let names = events(&out, "test-0001");
        assert!(names.contains(&"client_without_commits".to_owned()));
    }
    // While the test runs, after more commands than any iteration takes, and once.
    let served = serve(folder.path(), ONE_SPRING, "openfresco", &[]);
    let mut client = Client::new(&served, [1, 0, 0, 0, 0, 0, 0, 0, 1, 0]);
    for k in 0..30 {
        client.says(&[3.0, 1e-4 * f64::from(k)]);
    }
    served.hears("10 commands without a commit");
    client.says(&[99.0]);
    let between = served.says_before("client ended");
    assert!(between.iter().all(|line| !line.contains("commit")));
}

#[test]
fn iterations_do_not_count_as_commits() {
    let folder = tempfile::tempdir().unwrap();
    let physical = format!("{ONE_SPRING}{LIMITS}[serve.openfresco]\nphysical = true\n");
    for (name, text) in [("physical", physical.as_str()), ("computed", ONE_SPRING)] {
        let out = folder.path().join(name);
        let more = ["--out", out.to_str().unwrap()];
        let served = serve(folder.path(), text, "openfresco", &more);
        let mut client = Client::new(&served, [1, 0, 0, 0, 1, 0, 0, 0, 1, 0]);
        for k in 1..=12 {
            client.says(&[3.0, 1e-4 * f64::from(k), 0.01 * f64::from(k)]);
        }
        served.hears("10 commands without a commit");
        client.says(&[99.0]);
        served.hears("the client ended the test");
        drop(served);
        let warnings = summary(&out, "test-0001").warnings;
        let told: Vec<_> = warnings
            .iter()
            .filter(|text| text.contains("without a"))
            .collect();
        assert_eq!(told.len(), 1, "{warnings:?}");
        // A machine starts from its position.
        let is_computed = name == "computed";
        assert_eq!(told[0].contains("initial state"), is_computed, "{told:?}");
    }
    // A first step that does not converge.
    let served = serve(folder.path(), ONE_SPRING, "openfresco", &[]);
    let mut client = Client::new(&served, [1, 0, 0, 0, 1, 0, 0, 0, 1, 0]);
    for k in 1..=30 {
        client.says(&[3.0, 1e-4 * f64::from(k), 0.01]);
    }
    client.says(&[99.0]);
    let before = served.says_before("client ended");
    let told = |line: &String| line.contains("without a");
    assert!(!before.iter().any(told), "{before:?}");
}

/// As Gusset does before t = 0: the specimen is held while the loop warms up, and steps are committed from then on.
#[test]
fn client_that_commits_later_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let served = serve(folder.path(), ONE_SPRING, "openfresco", &[]);
    let mut client = Client::new(&served, [1, 0, 0, 0, 1, 0, 0, 0, 1, 0]);
    for _ in 0..30 {
        client.says(&[3.0, 0.0, 0.0]);
        assert_eq!(client.asks(10.0)[0], 0.0);
    }
    for k in 1..=12 {
        client.says(&[3.0, 1e-4 * f64::from(k), 0.01 * f64::from(k)]);
        client.says(&[5.0, 1e-4 * f64::from(k), 0.01 * f64::from(k)]);
    }
    client.says(&[99.0]);
    let before = served.says_before("client ended");
    let told = |line: &String| line.contains("without a");
    assert!(!before.iter().any(told), "{before:?}");
}

/// The second client sends its hello while the first one is still active, and repeats it.
#[test]
fn waiting_udp_client_takes_over() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--transport", "udp"];
    let served = serve(folder.path(), ONE_SPRING, "openfresco", &more);
    let [first, second] = [(), ()].map(|()| {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(&served.address).unwrap();
        socket
            .set_read_timeout(Some(Duration::from_millis(200)))
            .unwrap();
        socket
    });
    let sizes = [1_i32, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2];
    let sizes: Vec<u8> = sizes.into_iter().flat_map(i32::to_le_bytes).collect();
    let vector = |code: f64, disp: f64| [code.to_le_bytes(), disp.to_le_bytes()].concat();
    first.send(&sizes).unwrap();
    served.hears("doubles a vector");
    let mut answer = [0; 64];
    second.send(b"a").unwrap();
    for _ in 0..3 {
        first.send(&vector(3.0, 0.001)).unwrap();
        first.send(&vector(10.0, 0.0)).unwrap();
        assert_eq!(first.recv(&mut answer).unwrap(), 16);
        gusset_session::pause(Duration::from_millis(200));
    }
    let is_answered = (0..100).any(|_| {
        second.send(b"a").unwrap();
        matches!(second.recv(&mut answer), Ok(1)) && answer[0] == b'b'
    });
    assert!(is_answered, "the first client was silent for 20 s");
}

#[test]
fn commanded_forces_are_refused_at_sizes() {
    let folder = tempfile::tempdir().unwrap();
    for protocol in ["openfresco", "openfresco-controller", "openfresco-simulink"] {
        let served = serve(folder.path(), ONE_SPRING, protocol, &[]);
        for ctrl in [[1, 1, 1, 1, 1], [0, 0, 0, 1, 0]] {
            let mut counts = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1];
            counts[..5].copy_from_slice(&ctrl);
            Client::new(&served, counts).expects_a_close();
            let end = served.hears("the client commands forces (1)");
            assert!(end.contains("0 commands"), "{end}");
        }
    }
}

#[test]
fn reset_is_reported_and_recorded_once() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("runs");
    let more = ["--out", out.to_str().unwrap()];
    let served = serve(folder.path(), ONE_SPRING, "openfresco", &more);
    let mut client = Client::new(&served, [1, 1, 1, 0, 1, 0, 0, 0, 1, 0]);
    // Two analyses after the first one, each after a reset.
    client.says(&[3.0]);
    for _ in 0..3 {
        for k in 1..5 {
            let command = [3.0, 1e-3 * f64::from(k), 0.1, 0.0, 0.01 * f64::from(k)];
            client.says(&command);
            client.says(&[&[5.0], &command[1..]].concat());
        }
        client.says(&[3.0]);
    }
    client.says(&[99.0]);
    served.hears("the client went back to displacement 0 at time 0");
    let between = served.says_before("client ended");
    let again = |line: &&String| line.contains("went back");
    assert_eq!(between.iter().filter(again).count(), 0, "{between:?}");
    drop(served);
    let warnings = summary(&out, "test-0001").warnings;
    let told = |text: &&String| text.contains("displacement 0");
    assert_eq!(warnings.iter().filter(told).count(), 1, "{warnings:?}");
    let names = events(&out, "test-0001");
    assert_eq!(
        names.iter().filter(|name| *name == "client_reset").count(),
        1
    );
}
