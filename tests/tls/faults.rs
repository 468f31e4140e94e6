//! Faults of a test over TLS while it runs: strangers disturb nothing; a peer that stops, falls silent or leaves ends the test in a
//! stated way.

use crate::test_file::TestFile;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, Running, Served, events, linked, moving, run, summary, test_file,
};
use crate::tls_common::{Authority, EXPIRED, VALID};
use gusset_record::summary::Status;

const STEPS: u32 = 50;
/// Long enough that the test ends only when it is stopped.
const ENDLESS: u32 = 20_000_000;
const TLS: &[&str] = &["--transport", "tls"];

fn local() -> String {
    test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"))
}

fn over_tls(steps: u32, address: &str, keys: &str) -> String {
    linked(steps, address, &format!("transport = \"tls\"\n{keys}"))
}

/// The test in the folder `run` fails, and the reason has these words.
fn fails_for(test: Running, folder: &Path, words: &str) {
    let (code, said) = test.wait();
    assert_eq!(code, 3, "{said}");
    let reason = summary(folder, "run").reason;
    assert!(reason.contains(words), "{reason}");
}

#[test]
fn failed_handshakes_do_not_disturb_a_test() {
    for protocol in ["gusset", "openfresco"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let authority = crate::tls_common::make(folder);
        let served = Served::start(
            folder,
            // A computed specimen of OpenFresco's protocols makes others wait.
            &if protocol == "gusset" {
                local()
            } else {
                moving()
            },
            &["--transport", "tls", "--protocol", protocol],
        );
        let keys = format!("protocol = \"{protocol}\"");
        let native = protocol == "gusset";
        let first = Running::start(folder, "first", &over_tls(ENDLESS, &served.address, &keys));
        served.hears(if native {
            "armed for"
        } else {
            "commands 1 displacements"
        });
        first.moves();
        // Nonsense, a plain client, an expired one, one of another laboratory, a second controller.
        let mut noise = TcpStream::connect(&served.address).unwrap();
        let _ = noise.write_all(&[0xff; 100_000]);
        let _ = noise.read_to_end(&mut Vec::new());
        served.hears(if native {
            "refused: TLS: it speaks no TLS"
        } else {
            "turned away"
        });
        let mut half = TcpStream::connect(&served.address).unwrap();
        half.write_all(&[22, 3, 1, 2, 0, 1]).unwrap();
        drop(half);
        let second = |name: &str| {
            let keys = format!("{keys}\nconnect_timeout_s = 1");
            let (code, said) = run(folder, name, &over_tls(STEPS, &served.address, &keys));
            assert_eq!(code, 3, "{said}");
            summary(folder, name).reason
        };
        let reason = second("second");
        let words = if native {
            "another controller is connected"
        } else {
            "it closed the connection in the middle of the TLS handshake: does it speak TLS, and is it free?"
        };
        assert!(reason.contains(words), "{reason}");
        if native {
            authority.issue(folder, "client", &["controller"], EXPIRED);
            assert!(second("expired").contains("has expired"));
            served.hears("refused: TLS: its certificate expired");
            Authority::named("elsewhere").issue(folder, "client", &["controller"], VALID);
            assert!(second("elsewhere").contains("an authority"));
            served.hears("refused: TLS: its certificate is not signed");
        }
        first.moves();
        let (code, said) = first.interrupt();
        assert_eq!(code, 130, "{said}");
        let summary = summary(folder, "first");
        assert_eq!(summary.status, Status::Interrupted);
        let link = summary.link["column"];
        assert!(link.sent > 0);
        assert_eq!((link.received, link.corrupt, link.lost), (link.sent, 0, 0));
        served.hears(if native {
            "test over: retired"
        } else {
            "the client ended the test"
        });
    }
}

#[test]
fn lost_server_differs_from_a_goodbye() {
    for (kill, words) in [(true, "closed"), (false, "program ends")] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        crate::tls_common::make(folder);
        let mut served = Served::start(folder, &local(), TLS);
        let test = Running::start(folder, "run", &over_tls(ENDLESS, &served.address, ""));
        served.hears("armed for");
        if kill {
            served.kill();
        } else {
            assert_eq!(served.signal("TERM"), 143);
        }
        fails_for(test, folder, words);
        assert!(events(folder, "run").contains(&"link".to_owned()));
    }
}

#[test]
fn killed_controller_frees_the_port() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let served = Served::start(folder, &local(), TLS);
    let mut test = Running::start(folder, "first", &over_tls(ENDLESS, &served.address, ""));
    served.hears("armed for");
    test.kill();
    served.hears("closed the connection");
    let (code, said) = run(folder, "next", &over_tls(STEPS, &served.address, ""));
    assert_eq!(code, 0, "{said}");
}

/// Passes bytes between a controller and a server. From `stall` on it keeps the last byte of the server's data and everything after
/// it.
fn stalling(server: &str, stall: Arc<AtomicBool>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = server.to_owned();
    std::thread::spawn(move || {
        let near = listener.accept().unwrap().0;
        let far = TcpStream::connect(server).unwrap();
        for socket in [&near, &far] {
            socket.set_nodelay(true).unwrap();
        }
        let (mut from, mut to) = (near.try_clone().unwrap(), far.try_clone().unwrap());
        std::thread::spawn(move || std::io::copy(&mut from, &mut to));
        let (mut from, mut to) = (far, near);
        let mut buffer = [0; 65_536];
        loop {
            let count = from.read(&mut buffer).unwrap_or(0);
            if count == 0 {
                return;
            }
            if stall.load(Ordering::Acquire) {
                // Several records may have come at once: the last of them is cut.
                to.write_all(&buffer[..count - 1]).unwrap();
                break;
            }
            if to.write_all(&buffer[..count]).is_err() {
                return;
            }
        }
        // Held open until the controller closes.
        while from.read(&mut buffer).is_ok_and(|count| count > 0) {}
    });
    address
}

#[test]
fn peer_stalled_in_a_record_is_given_up() {
    for protocol in ["gusset", "openfresco"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        crate::tls_common::make(folder);
        let served = Served::start(
            folder,
            &local(),
            &["--transport", "tls", "--protocol", protocol],
        );
        let stall = Arc::new(AtomicBool::new(false));
        let address = stalling(&served.address, Arc::clone(&stall));
        let keys = format!("protocol = \"{protocol}\"\nreply_timeout_s = 0.4");
        let test = Running::start(folder, "run", &over_tls(ENDLESS, &address, &keys));
        served.hears(if protocol == "gusset" {
            "armed for"
        } else {
            "commands 1 displacements"
        });
        stall.store(true, Ordering::Release);
        fails_for(test, folder, "TLS record");
    }
}

/// The loop continues with stale data meanwhile; the helper thread gives up the incomplete record all the same.
#[test]
fn stalled_peer_ends_a_sampled_tls_test() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let served = Served::start(folder, &local(), TLS);
    let stall = Arc::new(AtomicBool::new(false));
    let address = stalling(&served.address, Arc::clone(&stall));
    let keys =
        "coupling = \"sampled\"\non_stale = \"hold\"\nmax_stale = 1000000\nreply_timeout_s = 0.3";
    let text = over_tls(60_000, &address, keys)
        .with("time = { clock = 'real', scale = 5 }")
        .with("timing.misses = { in_a_row.trip = 1000000, in_total.trip = 1000000 }");
    let test = Running::start(folder, "run", &text);
    served.hears("armed for");
    // A specimen that never answered does not enter the first step at all.
    test.moves();
    stall.store(true, Ordering::Release);
    fails_for(test, folder, "TLS record");
}

/// A server's reaction to a controller that stops in the middle of a record.
#[test]
fn client_stalled_in_a_record_is_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let served = Served::start(folder, &local(), TLS);
    let mut half = TcpStream::connect(&served.address).unwrap();
    half.set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    // A handshake record of 512 bytes of which one arrives.
    half.write_all(&[22, 3, 1, 2, 0, 1]).unwrap();
    served.hears("no end of the TLS handshake within 5 s");
    // The connection closes, after a TLS alert at most.
    let mut last = Vec::new();
    let _ = half.read_to_end(&mut last);
    assert!(last.len() <= 7, "{last:?}");
}
