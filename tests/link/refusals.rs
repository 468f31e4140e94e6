//! A mismatch is refused before anything moves: exit code 3, a message with the remedy, an event, a complete folder.
//!
//! Which bad input is tested where (O: over OpenFresco's protocols):
//!
//! | what is wrong | ours | O |
//! |---|---|---|
//! | wrong port, refused | here | openfresco_bad_input |
//! | unreachable, name without an address | openfresco_bad_input | openfresco_bad_input |
//! | no reply | here | openfresco_bad_input, openfresco_refusals |
//! | a web server; a browser, SSH, TLS or noise at our port | here | openfresco_bad_input; openfresco_strangers |
//! | one of our protocols at the other's port | openfresco_bad_input | openfresco_bad_input |
//! | wrong version | here | openfresco_bad_input |
//! | wrong axes, names, units, limits | here | openfresco_bad_input |
//! | N or a count too small, too large, negative | (bounded: wire::native) | openfresco_strangers |
//! | cut messages | link_faults, link_bad_network | openfresco_bad_input, openfresco_strangers |
//! | bad checksum | link_faults, link_bad_network | (not in protocol) |
//! | wrong key, none, unwanted | here | (not in protocol) |
//! | expired, foreign or wrong certificate | tls_refusals | tls_openfresco |
//! | a force that is no number | link_faults | openfresco_bad_input |
//! | a force beyond the sensor's range | link_faults | (limits of the test) |
//! | frozen sequence, answers that come twice | link_faults, link_bad_network | openfresco_bad_input, link_bad_network |
//! | noise at every port while a test runs | link_faults | openfresco_strangers |

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::link_common::{
    Fake, ONE_AXIS, ONE_AXIS_LAW, Served, TWO_AXES, TWO_AXES_LAW, as_read, events, finish, gusset,
    linked, run, summary, test_file, write,
};
use gusset_record::summary::Status;
use gusset_wire::Side;
use gusset_wire::handshake::{
    self, Arm, Bye, Capabilities, Control, Refuse, RefuseCode, Versions, Welcome,
};
use gusset_wire::native::{Cause, Decoder, Frame};

const STEPS: u32 = 50;

/// Runs a test that must fail to connect; its reason.
fn unmoved(folder: &Path, text: &str) -> String {
    let (code, said) = run(folder, "run", text);
    assert_eq!(code, 3, "{said}");
    let summary = summary(folder, "run");
    assert_eq!((summary.status, summary.steps), (Status::Failed, 0));
    assert!(events(folder, "run").contains(&"link".to_owned()));
    assert!(!events(folder, "run").contains(&"started".to_owned()));
    assert!(
        summary.reason.ends_with("nothing was moved"),
        "{}",
        summary.reason
    );
    summary.reason
}

fn local() -> String {
    test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"))
}

#[test]
fn port_without_a_server_is_refused_there() {
    let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
    let udp = UdpSocket::bind("127.0.0.1:0").unwrap();
    let ports = [tcp.local_addr().unwrap(), udp.local_addr().unwrap()];
    drop((tcp, udp));
    for (address, transport) in ports.iter().zip(["tcp", "udp"]) {
        let folder = tempfile::tempdir().unwrap();
        let keys = format!("transport = \"{transport}\"");
        let reason = unmoved(folder.path(), &linked(STEPS, &address.to_string(), &keys));
        let words = format!("{address} refused the connection: nothing listens on that port");
        assert!(reason.contains(&words), "{reason}");
    }
}

#[test]
fn silent_host_is_given_up_after_the_limit() {
    // A socket has the port and stays silent.
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    for (address, transport) in [
        (silent.local_addr().unwrap(), "udp"),
        (listener.local_addr().unwrap(), "tcp"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let keys = format!("transport = \"{transport}\"\nconnect_timeout_s = 0.3");
        let reason = unmoved(folder.path(), &linked(STEPS, &address.to_string(), &keys));
        assert!(
            reason.contains("no answer to our hello within 0.3 s"),
            "{reason}"
        );
    }
}

#[test]
fn specimen_armed_elsewhere_is_refused() {
    let elsewhere = |arm| match arm {
        Control::Arm(arm) => Control::Arm(Arm {
            disp: vec![0.01],
            ..arm
        }),
        other => other,
    };
    let address = Fake::start_saying(4e5, |_| {}, elsewhere, |_| {});
    let folder = tempfile::tempdir().unwrap();
    let text = linked(STEPS, &address, "").replace("\"simulated\"", "\"real\"");
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 3, "{said}");
    let summary = summary(folder.path(), "run");
    let reason = &summary.reason;
    assert!(reason.contains("armed for another place"), "{reason}");
    assert_eq!((summary.steps, summary.wall_seconds), (0, 0.0));
}

/// Nothing has left for it, so nothing there need be held.
#[test]
fn unarmed_specimen_is_not_reported_as_held() {
    let refuse = Control::Refuse(Refuse {
        code: RefuseCode::NotReady,
        versions: Versions::OURS,
        text: String::new(),
    });
    let leave = Control::Bye(Bye {
        cause: Cause::Tripped.code(),
        text: "pump lost pressure".to_owned(),
    });
    let never = "; specimen \"column\" was never armed: no command was sent to it";
    // The text may say that it was lost.
    let unknown = "; only the server of specimen \"column\" knows its position";
    for (answer, told, end) in [
        (
            refuse,
            "(refused: it is not ready: its interlock is open",
            never,
        ),
        (
            leave,
            "(it said goodbye where the arming was due: it tripped: ",
            unknown,
        ),
    ] {
        let address = Fake::start_saying(4e5, |_| {}, |_| answer, |_| {});
        let folder = tempfile::tempdir().unwrap();
        let (code, said) = run(folder.path(), "run", &linked(STEPS, &address, ""));
        assert_eq!(code, 3, "{said}");
        let reason = summary(folder.path(), "run").reason;
        assert!(reason.contains(told), "{reason}");
        assert!(reason.ends_with(end), "{reason}");
        assert!(!reason.contains("watchdog"), "{reason}");
    }
}

#[test]
fn web_server_is_recognised() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let _ = stream.read(&mut [0; 1000]);
        stream
            .write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            .unwrap();
    });
    let folder = tempfile::tempdir().unwrap();
    let reason = unmoved(folder.path(), &linked(STEPS, &address, ""));
    assert!(
        reason.contains("the peer speaks another protocol"),
        "{reason}"
    );
}

#[test]
fn browser_and_noise_disturb_nothing() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let served = Served::start(folder.path(), &local(), &["--transport", transport]);
        if transport == "tcp" {
            let mut stream = TcpStream::connect(&served.address).unwrap();
            stream
                .write_all(b"GET / HTTP/1.1\r\nHost: rig\r\n\r\n")
                .unwrap();
            let mut answer = Vec::new();
            let _ = stream.read_to_end(&mut answer);
        } else {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            for noise in [&b"GET / HTTP/1.1\r\n\r\n"[..], b"GUST", &[0; 60_000], b"x"] {
                socket.send_to(noise, &served.address).unwrap();
            }
        }
        served.hears("the peer speaks another protocol");
        let keys = format!("transport = \"{transport}\"");
        let (code, said) = run(folder.path(), "run", &linked(STEPS, &served.address, &keys));
        assert_eq!(code, 0, "{said}");
    }
}

#[test]
fn silent_client_keeps_no_controller_out() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), &local(), &[]);
    let connect = |_| TcpStream::connect(&served.address).unwrap();
    let silent: Vec<_> = (0..40).map(connect).collect();
    let (code, said) = run(folder.path(), "run", &linked(STEPS, &served.address, ""));
    assert_eq!(code, 0, "{said}");
    served.hears("it gave way");
    drop(silent);
}

#[test]
fn noise_of_strangers_is_reported_rarely() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = Served::start(folder, &local(), &[]);
    for _ in 0..300 {
        let mut stream = TcpStream::connect(&served.address).unwrap();
        stream.write_all(b"GET / HTTP/1.1\r\n\r\n").unwrap();
        // It is turned away, with or without a reset.
        let _ = stream.read_to_end(&mut Vec::new());
    }
    let (code, said) = run(folder, "run", &linked(STEPS, &served.address, ""));
    assert_eq!(code, 0, "{said}");
    let before = served.says_before("test over");
    let told = |words: &str| before.iter().filter(|line| line.contains(words)).count();
    assert_eq!(told(": refused: "), 100);
    assert_eq!(told("are not told for"), 1);
}

/// A connection from another address of this machine.
fn connect_from(own: [u8; 4], to: &str) -> TcpStream {
    use rustix::net::{AddressFamily, SocketType};
    let socket = rustix::net::socket(AddressFamily::INET, SocketType::STREAM, None).unwrap();
    let own = std::net::SocketAddrV4::new(own.into(), 0);
    rustix::net::bind(&socket, &own).unwrap();
    let to: std::net::SocketAddrV4 = to.parse().unwrap();
    rustix::net::connect(&socket, &to).unwrap();
    TcpStream::from(socket)
}

/// A hello proves nothing: an eavesdropper can send it again.
#[test]
fn captured_hello_does_not_lock_out_the_key() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(folder, "lab.key", "a secret of more than sixteen bytes\n");
    let key = folder.join("lab.key").display().to_string();
    let keyed = |address: &str| linked(STEPS, address, "key_file = \"lab.key\"");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let captured = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bytes = vec![0; 4096];
        let count = stream.read(&mut bytes).unwrap();
        bytes.truncate(count);
        bytes
    });
    run(folder, "captured", &keyed(&address));
    let hello = captured.join().unwrap();

    let served = Served::start(folder, &local(), &["--key", &key]);
    let mut strangers = Vec::new();
    for index in 0..64 {
        let mut stream = connect_from([127, 0, 0, 2 + index / 16], &served.address);
        stream.write_all(&hello).unwrap();
        // The welcome: this client has identified itself.
        assert!(stream.read(&mut [0; 4096]).unwrap() > 0);
        strangers.push(stream);
    }
    let (code, said) = run(folder, "run", &keyed(&served.address));
    assert_eq!(code, 0, "{said}");
    served.hears("it gave way");
}

#[test]
fn other_version_shows_both_versions() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), &local(), &[]);
    let mut stream = TcpStream::connect(&served.address).unwrap();
    // A header of version 9: the fifth byte.
    stream
        .write_all(&[b'G', b'U', b'S', b'T', 9, 16, 0, 0])
        .unwrap();
    let mut frame = Vec::new();
    stream.read_to_end(&mut frame).unwrap();
    let mut decoder = Decoder::greeting(Side::Specimen);
    let Frame::Control(message) = decoder.open(&frame).unwrap().frame else {
        panic!("a control message");
    };
    match handshake::decode(message).unwrap() {
        Control::Refuse(refuse) => {
            assert_eq!(refuse.code, RefuseCode::Version);
            assert!(
                refuse.text.contains("version 9 found, 1 to 1"),
                "{}",
                refuse.text
            );
        }
        other => panic!("{other:?}"),
    }
    // And a specimen of version 9 is refused by the controller.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let _ = stream.read(&mut [0; 1000]);
        stream
            .write_all(&[b'G', b'U', b'S', b'T', 9, 16, 0, 0])
            .unwrap();
    });
    let reason = unmoved(folder.path(), &linked(STEPS, &address, ""));
    assert!(reason.contains("version 9 found"), "{reason}");
}

#[test]
fn other_axes_units_and_names_are_refused() {
    let cases = [
        (
            format!("{TWO_AXES}{TWO_AXES_LAW}"),
            "",
            "2 axes wanted, 1 found",
        ),
        (
            format!("{ONE_AXIS}[[specimen.axis]]\nunit_disp = \"mm\"\n{ONE_AXIS_LAW}"),
            "",
            "axis 1 is in mm and N here, in m and N there",
        ),
        (
            format!("{ONE_AXIS}{ONE_AXIS_LAW}"),
            "axis_names = [\"east\"]",
            "axis 1 is called 'axis 1' here, 'east' there",
        ),
    ];
    for (specimen, keys, words) in cases {
        let folder = tempfile::tempdir().unwrap();
        let served = Served::start(folder.path(), &test_file(STEPS, &specimen), &[]);
        let reason = unmoved(folder.path(), &linked(STEPS, &served.address, keys));
        assert!(reason.contains(as_read(words)), "{reason}");
        served.hears(words);
    }
}

/// The limit of the test file and that of the specimen's end are equal.
#[test]
fn longest_allowed_watchdog_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path(), &local(), &[]);
    let text = linked(STEPS, &served.address, "watchdog_s = 3600");
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 0, "{said}");
}

#[test]
fn only_the_right_key_connects_and_signs() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(folder, "right.key", "a secret of more than sixteen bytes\n");
        write(folder, "wrong.key", "another secret of enough bytes here\n");
        let key = folder.join("right.key").display().to_string();
        let served = Served::start(folder, &local(), &["--transport", transport, "--key", &key]);
        let with = |keys: &str| {
            let keys = format!("transport = \"{transport}\"\n{keys}");
            linked(STEPS, &served.address, &keys)
        };
        let (code, said) = run(folder, "right", &with("key_file = \"right.key\""));
        assert_eq!(code, 0, "{said}");
        let resolved = std::fs::read_to_string(folder.join("right/resolved.toml")).unwrap();
        assert!(resolved.contains(&key), "named from anywhere");
        assert!(
            !folder.join("right/inputs/right.key").exists(),
            "never copied"
        );
        for (name, keys) in [("wrong", "key_file = \"wrong.key\""), ("none", "")] {
            let (code, _) = run(folder, name, &with(keys));
            assert_eq!(code, 3);
            let reason = summary(folder, name).reason;
            assert!(reason.contains("key"), "{reason}");
        }
    }
}

#[test]
fn server_without_a_key_refuses_one() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "a.key",
        "a secret of more than sixteen bytes\n",
    );
    let served = Served::start(folder.path(), &local(), &[]);
    let text = linked(STEPS, &served.address, "key_file = \"a.key\"");
    let reason = unmoved(folder.path(), &text);
    assert!(
        reason.contains(as_read("no pre-shared key is configured here")),
        "{reason}"
    );
}

#[test]
fn beyond_loopback_a_key_is_required() {
    let folder = tempfile::tempdir().unwrap();
    let file = write(folder.path(), "serve.toml", &local());
    let mut command = gusset();
    command
        .arg("serve")
        .arg(file)
        .args(["--listen", "0.0.0.0:0"]);
    let output = finish(command);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.contains("a pre-shared key is required there"),
        "{said}"
    );
}

#[test]
fn other_stiffness_warns_reversed_refuses() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = Served::start(folder, &local(), &[]);
    let text = linked(STEPS, &served.address, "").replace("4e5", "5e5");
    let (code, said) = run(folder, "softer", &text);
    assert_eq!(code, 0, "{said}");
    let warnings = summary(folder, "softer").warnings;
    assert!(
        warnings
            .iter()
            .any(|w| w.contains("it reports a stiffness of 400 kN/m")),
        "{warnings:?}"
    );
    // The bound is 10 % of what the test file says.
    for (expected, warned) in [("4.4e5", false), ("4.5e5", true)] {
        let text = linked(STEPS, &served.address, "").replace("4e5", expected);
        assert_eq!(run(folder, expected, &text).0, 0);
        let warnings = summary(folder, expected).warnings;
        let differs = warnings.iter().any(|w| w.contains("reports a stiffness"));
        assert_eq!(differs, warned, "{warnings:?}");
    }
    // A specimen that reports −4e5 N/m.
    let address = Fake::start_with(-4e5, |_| {});
    let (code, said) = run(folder, "reversed", &linked(STEPS, &address, ""));
    assert_eq!(code, 3);
    let headline = " — FAILED: a specimen could not be connected\n";
    assert!(said.contains(headline), "{said}");
    let logged = said.lines().find(|line| line.contains("ERROR")).unwrap();
    let specimen = "specimen \"column\": could not be connected: ";
    assert!(
        logged.contains(specimen) && !logged.contains("message="),
        "{said}"
    );
    let reason = summary(folder, "reversed").reason;
    assert!(reason.contains("a channel is reversed"), "{reason}");
}

/// A limit must not compare the command with itself. The connection shows it before the specimen is armed.
#[test]
fn echoed_command_is_no_displacement() {
    let silent = Capabilities::default();
    let limit = |limit: &str| format!("[specimen.limits]\n{limit}");
    let following = limit("following_error_m = { trip = 0.5 }");
    let cases = [
        (
            silent,
            limit("measured_disp_m = { trip = [-1, 1] }"),
            "limits.measured_disp_m",
        ),
        (
            silent,
            limit("sensor_disp_m = { trip = [-1, 1] }"),
            "limits.sensor_disp_m",
        ),
        (silent, following.clone(), "limits.following_error_m"),
        (
            silent,
            limit("stuck_ticks = { trip = 1000 }"),
            "limits.stuck_ticks",
        ),
        (
            silent,
            limit("added_energy_j = { trip = 1e9 }"),
            "limits.added_energy_j",
        ),
        (silent, limit("lag_s = { trip = 10 }"), "limits.lag_s"),
        (
            silent,
            limit("gain_error = { trip = 10 }"),
            "limits.gain_error",
        ),
        (
            silent,
            "[specimen.compensation.ats]\norder = 1\ndelay_s = 0.001".to_owned(),
            "compensation.ats",
        ),
        (
            silent,
            "[safety]\ndelay_used = { warn = 0.5 }".to_owned(),
            "safety.delay_used",
        ),
        (
            silent,
            "[safety]\nadded_energy_share = { trip = 0.9, floor_j = 1e6 }".to_owned(),
            "safety.added_energy_share",
        ),
        (silent, String::new(), ""),
        (Capabilities::MEASURES_DISP, following.clone(), ""),
        (Capabilities::SIMULATED, following, ""),
    ];
    for (capabilities, keys, refused) in cases {
        let folder = tempfile::tempdir().unwrap();
        let change = move |welcome: &mut Welcome| {
            welcome.capabilities = capabilities;
            welcome.standing = vec![0.0];
        };
        let armed_or_commanded = Arc::new(AtomicUsize::new(0));
        let counter = Arc::clone(&armed_or_commanded);
        let address = Fake::start_welcoming(change, move |mut fake| {
            let count = |_| {
                counter.fetch_add(1, Ordering::SeqCst);
            };
            fake.obey(|disp| (disp, 4e5 * disp), count);
        });
        let text = match keys.strip_prefix("[safety]\n") {
            Some(key) => {
                linked(STEPS, &address, "").replace("[safety]\n", &format!("[safety]\n{key}\n"))
            }
            None => linked(STEPS, &address, &keys),
        };
        let (code, said) = run(folder.path(), "run", &text);
        if refused.is_empty() {
            assert_eq!(code, 0, "{keys}: {said}");
            continue;
        }
        assert_eq!(code, 2, "{keys}: {said}");
        assert!(said.contains("nothing was moved"), "{refused}: {said}");
        let reason = summary(folder.path(), "run").reason;
        assert!(reason.contains(refused), "{refused}: {reason}");
        assert_eq!(armed_or_commanded.load(Ordering::SeqCst), 0, "{refused}");
    }
}
