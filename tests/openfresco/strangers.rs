//! `gusset serve` on OpenFresco's protocols and the traffic at an open port: impossible sizes, other programs, cut messages, noise.
//! Each is named, none reaches the specimen, and a running test is not disturbed.

use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::path::Path;

use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, PATIENCE, Served, linked, moving, run, summary, test_file,
};

const STEPS: u32 = 50;

fn serve(folder: &Path, protocol: &str, transport: &str) -> Served {
    let text = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let arguments = ["--protocol", protocol, "--transport", transport];
    Served::start(folder, &text, &arguments)
}

fn serve_moving(folder: &Path, protocol: &str, transport: &str) -> Served {
    let arguments = ["--protocol", protocol, "--transport", transport];
    Served::start(folder, &moving(), &arguments)
}

/// The first message of dialects A and D for one axis, with one count changed.
fn sizes(place: usize, count: i32) -> Vec<u8> {
    let mut counts = [1, 1, 1, 0, 1, 0, 0, 0, 1, 0, 256];
    counts[place] = count;
    counts
        .iter()
        .flat_map(|count| count.to_le_bytes())
        .collect()
}

/// Sends bytes to the server; it must close.
fn say(address: &str, bytes: &[u8]) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    // A reset is a close, too.
    let _ = stream.read_to_end(&mut answer);
    assert!(answer.is_empty(), "{answer:?}");
}

#[test]
fn impossible_sizes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for protocol in ["openfresco", "openfresco-controller", "openfresco-simulink"] {
        let served = serve(folder.path(), protocol, "tcp");
        for (place, count, words) in [
            (10, -1, "data size N is -1"),
            (10, 0, "data size N is 0"),
            (10, 4, "data size N is 4"),
            (10, i32::MAX, "data size N is 2147483647"),
            (10, i32::MIN, "data size N is -2147483648"),
            (0, -1, "number of displacements is -1"),
            (0, i32::MAX, "number of displacements is 2147483647"),
            (3, 4097, "number of forces is 4097"),
            (4, 2, "number of times is 2, 0 to 1 allowed"),
        ] {
            say(&served.address, &sizes(place, count));
            served.hears(words);
        }
    }
}

#[test]
fn other_programs_are_recognised() {
    let folder = tempfile::tempdir().unwrap();
    let served = serve(folder.path(), "openfresco", "tcp");
    let noise = [0xa5; 100];
    for (bytes, words) in [
        (
            &b"GET / HTTP/1.1\r\nHost: rig.lab.example:8090\r\nUser-Agent: curl\r\n\r\n"[..],
            "the first bytes are those of a browser: the peer speaks another protocol",
        ),
        (
            b"SSH-2.0-OpenSSH_9.6 and the rest of a long first line that continues",
            "those of an SSH server or client",
        ),
        (
            b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 a client hello with more than 44 bytes",
            "it speaks TLS, and plain TCP is served here",
        ),
        (&noise, "number of displacements is"),
    ] {
        say(&served.address, bytes);
        served.hears(words);
    }
    // The actor's first message is four bytes long, and then 2048.
    let served = serve(folder.path(), "openfresco-actor", "tcp");
    say(&served.address, b"GET / HTTP/1.1\r\n\r\n");
    served.hears("the first bytes are those of a browser");
}

#[test]
fn cut_message_moves_nothing_frees_the_port() {
    let folder = tempfile::tempdir().unwrap();
    let served = serve(folder.path(), "openfresco", "tcp");
    let whole = [sizes(10, 5), vec![0; 40]].concat();
    for length in [1, 43, 44, 60] {
        let mut stream = TcpStream::connect(&served.address).unwrap();
        stream.write_all(&whole[..length]).unwrap();
        drop(stream);
        let end = served.hears("closed the connection without a goodbye");
        assert!(end.contains("0 commands"), "{end}");
        // The sizes are 44 bytes long, and a separate message.
        let within = format!("a goodbye, {} bytes into a message", length % 44);
        assert_eq!(end.contains(&within), length != 44, "{end}");
    }
}

/// The lines up to the sizes of the first client.
fn lines_before_the_client(served: &Served) -> Vec<String> {
    let mut lines = Vec::new();
    loop {
        let line = served.hears("");
        if line.contains("commands 1 displacements") {
            return lines;
        }
        lines.push(line);
    }
}

#[test]
fn silent_client_keeps_no_other_out() {
    // Some, and more than are greeted at a time.
    for (strangers, moves) in [(5, true), (40, true), (5, false), (40, false)] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let served = if moves {
            serve_moving(folder, "openfresco", "tcp")
        } else {
            serve(folder, "openfresco", "tcp")
        };
        let silent: Vec<_> = (0..strangers)
            .map(|_| {
                let stranger = TcpStream::connect(&served.address).unwrap();
                served.hears("connected");
                stranger
            })
            .collect();
        let text = linked(STEPS, &served.address, "protocol = \"openfresco\"");
        let (code, said) = run(folder, "run", &text);
        assert_eq!(code, 0, "{said}");
        let before = lines_before_the_client(&served);
        let says = |words: &str| before.iter().any(|line| line.contains(words));
        // No time limit of a stranger had to pass first.
        assert!(!says("sent no sizes within"), "{before:?}");
        let turned_away = || {
            let mut after = served.says_before("client ended").into_iter();
            after.any(|line| line.contains("turned away"))
        };
        if !moves {
            // They wait until the computed specimen is free again.
            assert!(!says("turned away") && !turned_away(), "{before:?}");
            continue;
        }
        assert!(says("turned away"), "{before:?}");
        // They were all sent away for the client's sake.
        for mut stranger in silent {
            stranger.set_read_timeout(Some(PATIENCE)).unwrap();
            assert!(!matches!(stranger.read(&mut [0]), Ok(1..)));
        }
    }
}

#[test]
fn half_a_hello_on_udp_keeps_no_other_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = serve(folder, "openfresco", "udp");
    let silent: Vec<_> = (0..5)
        .map(|_| {
            let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
            stranger.set_read_timeout(Some(PATIENCE)).unwrap();
            stranger.send_to(b"a", &served.address).unwrap();
            let mut answer = [0; 4];
            let (count, _) = stranger.recv_from(&mut answer).unwrap();
            assert_eq!(&answer[..count], b"b");
            stranger
        })
        .collect();
    let keys = "protocol = \"openfresco\"\ntransport = \"udp\"\nopenfresco = { udp_hello = true }";
    let (code, said) = run(folder, "run", &linked(STEPS, &served.address, keys));
    assert_eq!(code, 0, "{said}");
    let before = lines_before_the_client(&served);
    assert!(
        !before.iter().any(|line| line.contains("no sizes")),
        "{before:?}"
    );
    drop(silent);
}

#[test]
fn noise_of_strangers_is_reported_rarely() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = serve(folder, "openfresco", "udp");
    let strangers: Vec<_> = (0..50)
        .map(|_| UdpSocket::bind("127.0.0.1:0").unwrap())
        .collect();
    for _ in 0..20 {
        for stranger in &strangers {
            stranger.send_to(&[0xff; 100], &served.address).unwrap();
        }
        gusset_session::pause(std::time::Duration::from_millis(5));
    }
    let keys = "protocol = \"openfresco\"\ntransport = \"udp\"";
    let (code, said) = run(folder, "run", &linked(STEPS, &served.address, keys));
    assert_eq!(code, 0, "{said}");
    let before = served.says_before("client ended");
    let told = |words: &str| before.iter().filter(|line| line.contains(words)).count();
    assert_eq!(told("100 bytes"), 100);
    assert_eq!(told("told for"), 1);
}

/// Every port of OpenFresco's protocols, over TCP and UDP, while a test runs over it.
#[test]
fn noise_does_not_disturb_a_running_test() {
    let ports = [
        ("openfresco", "openfresco"),
        ("openfresco-actor", "openfresco-shadow"),
    ];
    for (serves, asks) in ports {
        for transport in ["tcp", "udp"] {
            let folder = tempfile::tempdir().unwrap();
            let folder = folder.path();
            let served = serve_moving(folder, serves, transport);
            let keys = format!("protocol = \"{asks}\"\ntransport = \"{transport}\"");
            let text = linked(20_000, &served.address, &keys);
            let owned = folder.to_owned();
            let test = std::thread::spawn(move || run(&owned, "run", &text));
            // From here on it runs: over UDP its client has a separate socket.
            served.hears(" displacements, ");
            if transport == "tcp" {
                for _ in 0..5 {
                    let mut stranger = TcpStream::connect(&served.address).unwrap();
                    let _ = stranger.write_all(&[0xff; 100_000]);
                    let _ = stranger.read_to_end(&mut Vec::new());
                }
            } else {
                let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
                for length in (0..3000).step_by(7) {
                    let _ = stranger.send_to(&vec![0xff; length], &served.address);
                }
            }
            served.hears("turned away");
            let (code, said) = test.join().unwrap();
            assert_eq!(code, 0, "{serves} {transport}: {said}");
            let link = summary(folder, "run").link["column"];
            assert_eq!((link.received, link.corrupt), (link.sent, 0));
        }
    }
}
