//! Every address may be a host name, IPv4 or `[IPv6]:port`: real connections on ::1 and over "localhost", both protocols, TCP and
//! UDP. A machine without an IPv6 loopback skips this with a clear message.

use std::io::Write;
use std::net::UdpSocket;

use crate::link_common::{ONE_AXIS, ONE_AXIS_LAW, Served, linked, run, test_file};

const STEPS: u32 = 50;

fn has_ipv6() -> bool {
    let has = UdpSocket::bind("[::1]:0").is_ok();
    if !has {
        // Past the capture of the test harness, which hides the output of a passing test.
        let _ = std::io::stderr().write_all(b"SKIPPED: this machine has no IPv6 loopback (::1)\n");
    }
    has
}

/// A server at `listen` is reached at `near` and its port.
fn reaches(protocol: &str, transport: &str, listen: &str, near: &str) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let more = ["--transport", transport, "--protocol", protocol];
    let served = Served::listen(folder, &local, listen, &more);
    let port = served.address.rsplit_once(':').unwrap().1;
    // Over UDP OpenFresco's application servers expect no hello; ours knows both.
    for hello in [false, true] {
        let mut keys = format!("transport = \"{transport}\"\nprotocol = \"{protocol}\"\n");
        if hello {
            if (protocol, transport) != ("openfresco", "udp") {
                continue;
            }
            keys.push_str("openfresco.udp_hello = true\n");
        }
        let text = linked(STEPS, &format!("{near}:{port}"), &keys);
        let (code, said) = run(folder, &format!("run-{hello}"), &text);
        assert_eq!(code, 0, "{protocol} {transport} {near}: {said}");
    }
}

#[test]
fn ipv6_loopback_works_on_every_protocol() {
    if !has_ipv6() {
        return;
    }
    for protocol in ["gusset", "openfresco", "openfresco-actor"] {
        for transport in ["tcp", "udp"] {
            let client = protocol.replace("actor", "shadow");
            let folder = tempfile::tempdir().unwrap();
            let folder = folder.path();
            let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
            let more = ["--transport", transport, "--protocol", protocol];
            let served = Served::listen(folder, &local, "[::1]:0", &more);
            assert!(served.address.starts_with("[::1]:"), "{}", served.address);
            let keys = format!("transport = \"{transport}\"\nprotocol = \"{client}\"");
            // One test after another: the port is offered again.
            for name in ["first", "second"] {
                let (code, said) = run(folder, name, &linked(STEPS, &served.address, &keys));
                assert_eq!(code, 0, "{protocol} {transport}: {said}");
            }
        }
    }
    reaches("openfresco", "udp", "[::1]:0", "[::1]");
}

#[test]
fn a_host_name_is_resolved_at_both_ends() {
    for protocol in ["gusset", "openfresco"] {
        for transport in ["tcp", "udp"] {
            reaches(protocol, transport, "localhost:0", "localhost");
        }
    }
}

/// "localhost" may mean ::1 first: a server on 127.0.0.1 alone is found all the same.
#[test]
fn every_address_of_a_name_is_tried() {
    for protocol in ["gusset", "openfresco"] {
        reaches(protocol, "tcp", "127.0.0.1:0", "localhost");
        if has_ipv6() {
            let name = ["localhost", "ip6-localhost", "localhost6"];
            use std::net::ToSocketAddrs;
            let six = name.into_iter().find(|name| {
                let found = (*name, 1).to_socket_addrs();
                found.is_ok_and(|mut all| all.any(|address| address.is_ipv6()))
            });
            if let Some(name) = six {
                reaches(protocol, "tcp", "[::1]:0", name);
            }
        }
    }
}

#[test]
fn one_machine_may_be_named_to_command() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let more = ["--protocol", "openfresco", "--client"];
    let served = Served::start(folder, &local, &[&more[..], &["localhost"]].concat());
    let text = linked(STEPS, &served.address, "protocol = \"openfresco\"");
    let (code, said) = run(folder, "run", &text);
    assert_eq!(code, 0, "{said}");
    let served = Served::start(folder, &local, &[&more[..], &["192.0.2.7"]].concat());
    let text = linked(
        STEPS,
        &served.address,
        "protocol = \"openfresco\"\nconnect_timeout_s = 1",
    );
    assert_eq!(run(folder, "other", &text).0, 3);
    served.hears("it is not the machine that may command");
    let file = folder.join("run.toml");
    let mut command = crate::link_common::gusset();
    command
        .arg("serve")
        .arg(file)
        .args(more)
        .arg("no-such-rig.invalid");
    let output = crate::link_common::finish(command);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn invalid_name_shows_the_valid_forms() {
    let folder = tempfile::tempdir().unwrap();
    let text = linked(STEPS, "no-such-rig.invalid:4823", "");
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 3, "{said}");
    assert!(said.contains("is no address"), "{said}");
    assert!(said.contains("\"[::1]:port\""), "{said}");
}

#[test]
fn refused_setting_is_shown_at_its_source() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rig.toml");
    let refuses = |keys: &str, arguments: &[&str]| {
        let text = format!("[serve]\n{keys}\n[[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}");
        std::fs::write(&file, text).unwrap();
        let mut command = crate::link_common::gusset();
        command.arg("serve").arg(&file).args(arguments);
        let output = crate::link_common::finish(command);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        said
    };
    for (keys, line, words) in [
        ("listen = \"nonsense\"", 2, "is no address"),
        (
            "listen = \"0.0.0.0:0\"",
            2,
            "can be reached from other machines",
        ),
        (
            "protocol = \"openfresco\"\nlisten = \"0.0.0.0:0\"",
            3,
            "can be reached from other machines",
        ),
        (
            "protocol = \"openfresco\"\n[serve.openfresco]\nclient = \"no-such-rig.invalid\"",
            4,
            "names no machine",
        ),
        (
            "transport = \"tls\"\n[serve.tls]\ncertificate_file = \"nowhere.crt\"",
            4,
            "--tls-certificate",
        ),
    ] {
        let said = refuses(keys, &[]);
        assert!(said.contains(words), "{said}");
        assert!(said.contains(&format!("rig.toml:{line}:")), "{said}");
        let listens = "listen = \"127.0.0.1:0\"";
        if keys.contains("listen") {
            let said = refuses(listens, &["--listen", "nonsense"]);
            assert!(
                said.contains("--listen: \"nonsense\" is no address"),
                "{said}"
            );
            assert!(!said.contains("rig.toml:"), "{said}");
        }
    }
}
