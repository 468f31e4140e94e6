//! Several remote specimens are made ready at the same time: connecting and arming them takes as long as the slowest, and a refusal
//! of one releases the others. The test needs no clock: the specimens answer only when all have been called, so a controller that
//! calls them one after the other waits in vain.

use std::io::Read;
use std::net::TcpListener;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Barrier, mpsc};

use crate::link_common::{Fake, PATIENCE, UNLIMITED, events, run, summary, test_file};
use gusset_record::summary::Status;

const STEPS: u32 = 20;
const WARM_UP: u32 = 5;

/// A frame of two storeys, each of them a specimen behind a link.
fn test_of(addresses: &[String]) -> String {
    let specimens = addresses.iter().enumerate().map(|(index, address)| {
        let storey = index % 2 + 1;
        format!(
            "name = \"storey-{index}\"\nstorey = {storey}\nstiffness_n_per_m = 4e5\n[specimen.link]\n\
             address = \"{address}\"\nconnect_timeout_s = 2\n"
        )
    });
    let specimens: Vec<String> = specimens.collect();
    test_file(STEPS, "")
        .replace("[safety]\n", &format!("[safety]\n{UNLIMITED}"))
        .replace("name = \"column\"\n", &specimens.join("[[specimen]]\n"))
}

#[test]
fn specimens_may_answer_after_all_calls() {
    const SPECIMENS: usize = 3;
    let folder = tempfile::tempdir().unwrap();
    let (greeted, armed) = (
        Arc::new(Barrier::new(SPECIMENS)),
        Arc::new(Barrier::new(SPECIMENS)),
    );
    let addresses: Vec<String> = (0..SPECIMENS)
        .map(|_| {
            let (greeted, armed) = (Arc::clone(&greeted), Arc::clone(&armed));
            let before = move |what| {
                let all = if what == "arm" { &armed } else { &greeted };
                all.wait();
            };
            Fake::start_when(4e5, before, |mut fake| {
                fake.behave(WARM_UP + STEPS + 1);
                while fake.frame().is_some() {}
            })
        })
        .collect();
    let (code, said) = run(folder.path(), "run", &test_of(&addresses));
    assert_eq!(code, 0, "{said}");
    let connected = events(folder.path(), "run");
    let connected = connected.iter().filter(|event| *event == "connected");
    assert_eq!(connected.count(), SPECIMENS);
}

/// Waits for the last message to a welcomed specimen; true for a clean end of the connection without a command.
fn released(commands: &AtomicUsize, mut fake: Fake) -> bool {
    while fake.command().is_some() {
        commands.fetch_add(1, Ordering::Relaxed);
    }
    true
}

#[test]
fn refusal_releases_the_other_specimens() {
    let folder = tempfile::tempdir().unwrap();
    // This port has no server.
    let gone = TcpListener::bind("127.0.0.1:0").unwrap();
    let nowhere = gone.local_addr().unwrap().to_string();
    drop(gone);
    let commands = Arc::new(AtomicUsize::new(0));
    let (tell, told) = mpsc::channel();
    let mut addresses: Vec<String> = (0..2)
        .map(|_| {
            let (commands, tell) = (Arc::clone(&commands), tell.clone());
            // It is released before it is armed: with a goodbye where the arming was due.
            let before = move |what| {
                if what != "arm" {
                    let _ = tell.send(what);
                }
            };
            Fake::start_when(4e5, before, move |fake| {
                released(&commands, fake);
            })
        })
        .collect();
    addresses.insert(1, nowhere.clone());
    let (code, said) = run(folder.path(), "run", &test_of(&addresses));
    assert_eq!(code, 3, "{said}");
    let summary = summary(folder.path(), "run");
    assert_eq!((summary.status, summary.steps), (Status::Failed, 0));
    assert!(
        summary.reason.starts_with("specimen \"storey-1\": ") && summary.reason.contains(&nowhere),
        "{}",
        summary.reason
    );
    assert!(summary.reason.ends_with("nothing was moved"));
    for word in ["welcome", "welcome", "released", "released"] {
        assert_eq!(told.recv_timeout(PATIENCE), Ok(word));
    }
    assert_eq!(commands.load(Ordering::Relaxed), 0);
}

#[test]
fn every_specimen_that_refuses_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let addresses: Vec<String> = (0..2)
        .map(|_| {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let address = listener.local_addr().unwrap().to_string();
            std::thread::spawn(move || {
                // Takes the hello, and closes.
                let (mut stream, _) = listener.accept().unwrap();
                let _ = stream.read(&mut [0; 4096]);
            });
            address
        })
        .collect();
    let (code, _) = run(folder.path(), "run", &test_of(&addresses));
    assert_eq!(code, 3);
    let reason = summary(folder.path(), "run").reason;
    for name in ["storey-0", "storey-1"] {
        assert!(reason.contains(name), "{reason}");
    }
}
