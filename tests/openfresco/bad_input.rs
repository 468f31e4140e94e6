//! A test whose specimen is behind OpenFresco's protocols and misbehaves: exit code 3, a reason with the place to look at, an
//! event, a complete folder, no hang. The protocols have no checksums, numbers or error messages: only detectable faults are
//! detected.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};

use crate::link_common::{ONE_AXIS, ONE_AXIS_LAW, PATIENCE, Served, TWO_AXES, TWO_AXES_LAW};
use crate::link_common::{events, linked, run, summary, test_file};
use gusset_record::summary::Status;

const STEPS: u32 = 50;
/// Warm-up ticks of the test file.
const WARM_UP: u32 = 5;
const SHORT: &str = "connect_timeout_s = 0.3\nreply_timeout_s = 0.3";
/// For ends that answer, however busy the machine is.
const PATIENT: &str = "connect_timeout_s = 20\nreply_timeout_s = 20";

/// The reason why a test against `address` fails, and whether anything had moved.
fn fails(address: &str, keys: &str) -> (String, bool) {
    fails_in(SHORT, address, keys)
}

fn fails_in(times: &str, address: &str, keys: &str) -> (String, bool) {
    let folder = tempfile::tempdir().unwrap();
    let text = linked(STEPS, address, &format!("{times}\n{keys}"));
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 3, "{said}");
    let summary = summary(folder.path(), "run");
    assert_eq!(summary.status, Status::Failed);
    let events = events(folder.path(), "run");
    assert!(events.contains(&"link".to_owned()), "{events:?}");
    (summary.reason, events.contains(&"started".to_owned()))
}

fn says(address: &str, keys: &str, words: &[&str]) {
    let (reason, moved) = fails(address, keys);
    assert!(!moved, "{reason}");
    for words in words {
        assert!(reason.contains(words), "{words:?} is not in {reason:?}");
    }
}

const KINDS: [&str; 3] = ["openfresco", "openfresco-shadow", "openfresco-adapter"];

fn keys(protocol: &str, transport: &str) -> String {
    format!("protocol = \"{protocol}\"\ntransport = \"{transport}\"")
}

#[test]
fn port_without_a_server_is_refused_there() {
    for protocol in KINDS {
        for transport in ["tcp", "udp"] {
            let port = {
                let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
                UdpSocket::bind(tcp.local_addr().unwrap()).unwrap();
                tcp.local_addr().unwrap()
            };
            // A client over UDP that is owed no answer in the set-up learns of it with its first command.
            if (protocol, transport) == ("openfresco-adapter", "udp") {
                continue;
            }
            says(
                &port.to_string(),
                &keys(protocol, transport),
                &[&format!("{port} refused"), "that port"],
            );
        }
    }
}

#[test]
fn unreachable_machine_is_reported() {
    // A broadcast address: the system refuses before anything leaves.
    for protocol in ["gusset", "openfresco"] {
        for transport in ["tcp", "udp"] {
            says(
                "255.255.255.255:4823",
                &keys(protocol, transport),
                &["255.255.255.255:4823 is unreachable", "address right"],
            );
        }
    }
    says(
        "no-such-host.invalid:4823",
        &keys("openfresco", "tcp"),
        &["no address", "host:port"],
    );
}

/// Accepts once and gives the stream to `script`.
fn server(script: impl FnOnce(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        script(stream);
    });
    address
}

#[test]
fn web_server_is_recognised() {
    for protocol in ["openfresco", "openfresco-shadow"] {
        // Shorter and longer than a vector.
        for length in [0, 5000] {
            let address = server(move |mut stream| {
                let _ = stream.read(&mut [0; 4096]);
                let page = format!("HTTP/1.1 400 Bad Request\r\n\r\n{}", "x".repeat(length));
                let _ = stream.write_all(page.as_bytes());
                let _ = stream.read_to_end(&mut Vec::new());
            });
            says(
                &address,
                &keys(protocol, "tcp"),
                &["another protocol", "right port"],
            );
        }
    }
}

#[test]
fn protocols_do_not_mistake_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let law = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    for transport in ["tcp", "udp"] {
        let arguments = ["--transport", transport, "--protocol", "openfresco"];
        let opensees = Served::start(folder.path(), &law, &arguments);
        let (reason, moved) = fails(&opensees.address, &keys("gusset", transport));
        assert!(!moved);
        assert!(reason.contains("gusset protocol"), "{reason}");
        let ours = Served::start(folder.path(), &law, &arguments[..2]);
        let (reason, moved) = fails(&ours.address, &keys("openfresco", transport));
        assert!(!moved);
        let words = match transport {
            "tcp" => "the first bytes are those of the gusset protocol",
            _ => "is it the right program",
        };
        assert!(reason.contains(words), "{reason}");
        ours.hears("the peer speaks another protocol");
    }
}

#[test]
fn other_number_of_axes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let law = test_file(STEPS, &format!("{TWO_AXES}{TWO_AXES_LAW}"));
    let served = Served::start(folder.path(), &law, &["--protocol", "openfresco"]);
    says(
        &served.address,
        &keys("openfresco", "tcp"),
        &["closed", "of axes"],
    );
    served.hears("2 wanted, 1 found");
}

/// Double 0 of each vector, and the answers of a spring of 4e5 N/m, until `script` takes over after ten steps.
struct Element {
    stream: TcpStream,
    vector: Vec<u8>,
}

impl Element {
    fn read(&mut self) -> Option<f64> {
        self.stream.read_exact(&mut self.vector).ok()?;
        Some(self.double(0))
    }

    fn double(&self, index: usize) -> f64 {
        f64::from_le_bytes(self.vector[8 * index..8 * index + 8].try_into().unwrap())
    }

    fn answer(&mut self, value: f64) {
        let mut answer = vec![0; self.vector.len()];
        answer[..8].copy_from_slice(&value.to_le_bytes());
        let _ = self.stream.write_all(&answer);
    }

    /// Up to the request of force `last`, which is not answered.
    fn behave(&mut self, last: u32) {
        let (mut force, mut requests) = (0.0, 0);
        loop {
            match self.read().unwrap() as u32 {
                3 => force = 4e5 * self.double(1),
                12 => self.answer(4e5),
                10 => {
                    requests += 1;
                    if requests == last {
                        return;
                    }
                    self.answer(force);
                }
                _ => {}
            }
        }
    }
}

/// The reason of a test against an element server that misbehaves at its eleventh force.
fn against(script: impl FnOnce(Element) + Send + 'static) -> String {
    against_in(PATIENT, script)
}

fn against_in(times: &str, script: impl FnOnce(Element) + Send + 'static) -> String {
    let address = server(move |mut stream| {
        let mut sizes = [0; 44];
        stream.read_exact(&mut sizes).unwrap();
        let n = i32::from_le_bytes(sizes[40..].try_into().unwrap());
        let vector = vec![0; 8 * n as usize];
        let mut element = Element { stream, vector };
        element.behave(WARM_UP + 11);
        script(element);
    });
    let only_force = "[specimen.link.openfresco]\nanswer_signals = [0, 0, 0, 1, 0]";
    let (reason, moved) = fails_in(
        times,
        &address,
        &format!("{}\n{only_force}", keys("openfresco", "tcp")),
    );
    assert!(moved);
    reason
}

#[test]
fn a_force_that_is_no_number_ends_the_test() {
    for nonsense in [f64::NAN, f64::INFINITY] {
        let reason = against(move |mut element| {
            element.answer(nonsense);
            while element.read().is_some() {}
        });
        assert!(
            reason.contains("finite number") && reason.contains("the sensor"),
            "{reason}"
        );
    }
}

#[test]
fn silence_or_half_an_answer_ends_the_test() {
    let silent = against_in(SHORT, |mut element| while element.read().is_some() {});
    assert!(silent.contains("0.3 s"), "{silent}");
    let half = against_in(SHORT, |mut element| {
        let _ = element.stream.write_all(&[0; 1000]);
        while element.read().is_some() {}
    });
    assert!(half.contains("0.3 s"), "{half}");
    let gone = against(drop);
    assert!(
        gone.contains("peer closed") && gone.contains("the specimen"),
        "{gone}"
    );
    let unasked = against(|mut element| {
        element.answer(1.0);
        element.answer(2.0);
        while element.read().is_some() {}
    });
    assert!(unasked.contains("peer sent"), "{unasked}");
}

#[test]
fn other_version_shows_both_numbers() {
    let address = server(|mut stream| {
        let mut endian = [0; 4];
        stream.read_exact(&mut endian).unwrap();
        stream.write_all(&endian).unwrap();
        let mut open = [0; 2048];
        stream.read_exact(&mut open).unwrap();
        open[..8].fill(0);
        open[16..24].copy_from_slice(&2.7_f64.to_le_bytes());
        stream.write_all(&open).unwrap();
        let _ = stream.read_to_end(&mut Vec::new());
    });
    says(
        &address,
        &keys("openfresco-shadow", "tcp"),
        &["version 2.7, 2.8 wanted", "set `version`"],
    );
}
