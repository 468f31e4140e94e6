//! A fault in mid-test ends it in a stated way: exit code, reason, event, a complete folder, and no hang.

use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::path::Path;
use std::sync::mpsc;

use crate::link_common::relay::{Fates, Relay};
use crate::link_common::{
    Fake, ONE_AXIS, ONE_AXIS_LAW, PATIENCE, Running, Served, as_read, events, finish, gusset,
    linked, run, summary, test_file,
};
use gusset_control::engine::NOT_AWAITED;
use gusset_quantity::substructure::Status;
use gusset_record::Run;
use gusset_record::summary::Status as Ended;
use gusset_wire::handshake::{Bye, Control};
use gusset_wire::native::{Cause, Frame};

const STEPS: u32 = 50;
/// Warm-up ticks of the test file.
const WARM_UP: u32 = 5;

/// Of `[timing]`: on the real clock no machine is too slow.
const PATIENT: &str = "[timing]\npolicy = \"ordinary\"\nmisses.in_total.trip = 1000000\nmisses.in_a_row.trip = 1000000\n\
                       misses.in_window.trip = 1000000\n";

fn local(steps: u32) -> String {
    test_file(steps, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"))
}

/// A test against `script`, which misbehaves after ten steps; the reason of its end.
fn against(code: i32, event: &str, script: impl FnOnce(Fake) + Send + 'static) -> String {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let address = Fake::start(|mut fake| {
        fake.behave(WARM_UP + 10);
        script(fake);
    });
    let (found, said) = run(
        folder,
        "run",
        &linked(STEPS, &address, "reply_timeout_s = 0.5"),
    );
    assert_eq!(found, code, "{said}");
    complete(folder, "run", event);
    summary(folder, "run").reason
}

/// Every file of a run folder is there, and the end is in the log.
fn complete(folder: &Path, name: &str, event: &str) {
    let summary = summary(folder, name);
    // Steps 0 to 9 were answered; a connection that is reset may take the last answer with it.
    assert!(matches!(summary.steps, 8 | 9), "{}", summary.steps);
    let expected = if event == "link" {
        Ended::Failed
    } else {
        Ended::Stopped
    };
    assert_eq!(summary.status, expected);
    let events = events(folder, name);
    assert!(events.contains(&event.to_owned()), "{events:?}");
    assert_eq!(events.last().map(String::as_str), Some("ended"));
    for file in [
        "test.toml",
        "resolved.toml",
        "samples.bin",
        "timing.json",
        "report.html",
    ] {
        assert!(folder.join(name).join(file).exists(), "{file}");
    }
}

/// Changes bytes of a frame and makes its checksum right again.
fn forged(mut frame: Vec<u8>, at: usize, bytes: &[u8]) -> Vec<u8> {
    frame[at..at + bytes.len()].copy_from_slice(bytes);
    let crc_at = frame.len() - 4;
    let crc = crc32fast::hash(&frame[..crc_at]);
    frame[crc_at..].copy_from_slice(&crc.to_le_bytes());
    frame
}

#[test]
fn a_force_that_is_no_number_ends_the_test() {
    let reason = against(3, "link", |mut fake| {
        let (sequence, _) = fake.command().unwrap();
        let frame = fake.answer(sequence, 1.0, Status::default());
        // Byte 72: the force of a specimen with one axis.
        fake.write(&forged(frame, 72, &f64::NAN.to_le_bytes()));
        fake.command();
    });
    assert!(
        reason.contains("measured force[0] is not a finite number"),
        "{reason}"
    );
}

#[test]
fn damaged_frame_ends_the_test_as_checksum() {
    let reason = against(3, "link", |mut fake| {
        let (sequence, _) = fake.command().unwrap();
        let mut frame = fake.answer(sequence, 1.0, Status::default());
        frame[80] ^= 1;
        fake.write(&frame);
        fake.command();
    });
    assert!(reason.contains("the checksum of the frame"), "{reason}");
}

#[test]
fn silent_specimen_is_lost_after_the_limit() {
    let reason = against(3, "link", |mut fake| {
        // Half an answer is no answer.
        let (sequence, _) = fake.command().unwrap();
        let frame = fake.answer(sequence, 1.0, Status::default());
        fake.write(&frame[..40]);
        while fake.frame().is_some() {}
    });
    assert!(
        reason.contains("no reply within the time limit (0.5 s)"),
        "{reason}"
    );
}

#[test]
fn frozen_sequence_counts_as_silent() {
    let reason = against(3, "link", |mut fake| {
        while fake.frame().is_some() {
            let frame = fake.answer(3, 1.0, Status::default());
            fake.write(&frame);
        }
    });
    assert!(
        reason.contains("no reply within the time limit"),
        "{reason}"
    );
}

#[test]
fn answer_without_a_command_ends_the_test() {
    let reason = against(3, "link", |mut fake| {
        let (sequence, _) = fake.command().unwrap();
        let frame = fake.answer(sequence + 1, 1.0, Status::default());
        fake.write(&frame);
        fake.command();
    });
    assert!(reason.contains("one to a later command"), "{reason}");
}

#[test]
fn a_connection_that_breaks_is_seen_at_once() {
    let reason = against(3, "link", |mut fake| {
        fake.command().unwrap();
    });
    assert!(
        reason.contains("the peer closed the connection"),
        "{reason}"
    );
}

#[test]
fn open_interlock_trips_and_stays_tripped() {
    let reason = against(1, "interlock", |mut fake| {
        let (sequence, _) = fake.command().unwrap();
        let frame = fake.answer(sequence, 1.0, Status::INTERLOCK);
        fake.write(&frame);
        while fake.frame().is_some() {}
    });
    assert!(
        reason.starts_with(
            "specimen \"column\": it reports a trip, or its interlock or emergency stop is open"
        ),
        "{reason}"
    );
}

#[test]
fn force_beyond_sensor_range_ends_the_test() {
    let reason = against(1, "saturated", |mut fake| {
        let (sequence, _) = fake.command().unwrap();
        let frame = fake.answer(sequence, 1.0, Status::SATURATED);
        fake.write(&frame);
        while fake.frame().is_some() {}
    });
    assert!(
        reason.contains("a sensor or actuator at the end of its range"),
        "{reason}"
    );
}

/// Its watchdog has stopped it, and no operator resets it: its answers belong to no command. The replay ends there, too.
#[test]
fn specimen_that_keeps_holding_ends_test() {
    const STEPS: u32 = 200;
    let folder = tempfile::tempdir().unwrap();
    let address = Fake::start(|mut fake| {
        fake.behave(WARM_UP + 10);
        while let Some((sequence, _)) = fake.command() {
            let frame = fake.answer(sequence, 1.0, Status::HOLDING);
            fake.write(&frame);
        }
    });
    let (code, said) = run(folder.path(), "run", &linked(STEPS, &address, ""));
    assert_eq!(code, 1, "{said}");
    let found = summary(folder.path(), "run");
    assert_eq!(found.status, Ended::Stopped);
    // The loop tolerates 0.1 s of ticks of 1 ms.
    let wanted =
        "specimen \"column\": it reported in 101 answers in a row that its own watchdog holds it";
    assert!(found.reason.starts_with(wanted), "{}", found.reason);
    assert_eq!(found.steps, 109);
    let warned = "specimen \"column\": it reported once that its own watchdog holds it";
    assert!(
        found.warnings.iter().any(|text| text.starts_with(warned)),
        "{:?}",
        found.warnings
    );
    let events = events(folder.path(), "run");
    let told = |name: &str| events.iter().filter(|event| *event == name).count();
    assert_eq!((told("specimen_holds"), told("specimen_holds_on")), (1, 1));
    let mut replay = gusset();
    replay.arg("replay").arg(folder.path().join("run"));
    let replayed = finish(replay);
    let said = String::from_utf8_lossy(&replayed.stderr);
    assert_eq!(replayed.status.code(), Some(0), "{said}");
}

#[test]
fn frozen_sampled_specimen_hits_stale_limit() {
    let folder = tempfile::tempdir().unwrap();
    let address = Fake::start(|mut fake| {
        fake.behave(WARM_UP + 10);
        while fake.frame().is_some() {
            let frame = fake.answer(3, 1.0, Status::default());
            fake.write(&frame);
        }
    });
    let text = linked(STEPS, &address, "coupling = \"sampled\"\nmax_stale = 20")
        .replace("clock = \"simulated\"", "clock = \"real\"\nscale = 5")
        .replace(
            "[timing]",
            "[timing]\nmisses.in_a_row.trip = 100000\nmisses.in_total.trip = 100000",
        );
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 1, "{said}");
    let found = summary(folder.path(), "run");
    let reason = &found.reason;
    assert!(
        reason.contains("no fresh measurement for 21 ticks") && reason.contains("one old command"),
        "{reason}"
    );
    // Its position is unknown.
    assert!(found.left.values().all(|left| left == "lost"), "{reason}");
    assert!(events(folder.path(), "run").contains(&"stale".to_owned()));
}

/// The specimen's watchdog must not take a waiting controller for a lost one. The specimen answered every command, so its position
/// is known; but its end does not know that the test is over.
#[test]
fn unacknowledged_end_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let address = Fake::start(|mut fake| fake.obey(|disp| (disp, 4e5 * disp), |_| {}));
    let (code, said) = run(folder, "run", &linked(STEPS, &address, ""));
    assert_eq!(code, 0, "{said}");
    let found = summary(folder, "run");
    let told = "specimen \"column\" did not acknowledge the end of the test: a watchdog was agreed with its end";
    assert!(found.reason.contains(told) && said.contains(told), "{said}");
    assert!(found.left.values().all(|left| left == "stayed"));
    let told = events(folder, "run");
    assert!(told.contains(&"unacknowledged".to_owned()), "{told:?}");
}

/// The loop no longer reads its status, but the operator must not find out only the next morning.
#[test]
fn trip_after_the_test_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let address = Fake::start(|mut fake| {
        fake.obey_until_retired(|disp| (disp, 4e5 * disp));
        fake.say(&Control::Bye(Bye {
            cause: Cause::Tripped.code(),
            text: "pump lost pressure".to_owned(),
        }));
        fake.say_goodbye(Cause::Tripped);
        while fake.frame().is_some() {}
    });
    let (code, said) = run(folder, "run", &linked(STEPS, &address, ""));
    assert_eq!(code, 0, "{said}");
    let found = summary(folder, "run");
    assert_eq!(found.status, Ended::Completed);
    let told = as_read("pump lost pressure");
    let told = format!("reported after the test: it tripped: {told}");
    assert!(
        found
            .reason
            .contains(&format!("specimen \"column\" {told}")),
        "{}",
        found.reason
    );
    let warning = format!("specimen \"column\" {told}");
    assert!(found.warnings.contains(&warning), "{:?}", found.warnings);
    assert!(said.contains(&warning), "{said}");
    let events = Run::open(&folder.join("run"))
        .unwrap()
        .events()
        .unwrap()
        .to_json();
    let event = events
        .iter()
        .find(|event| event["event"] == "last_words")
        .unwrap();
    assert_eq!(
        (&event["text"], &event["specimen"]),
        (&warning.into(), &1.into())
    );
}

#[test]
fn waiting_controller_shows_it_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let address = Fake::start(|mut fake| {
        fake.behave(WARM_UP + 10);
        let (sequence, disp) = fake.command().unwrap();
        let mut beats = 0;
        while beats < 3 {
            let frame = fake.frame().unwrap();
            if let Frame::Heartbeat(beat) = fake.decoder.open(&frame).unwrap().frame {
                assert_eq!(beat.sequence, sequence);
                beats += 1;
            }
        }
        let frame = fake.answer(sequence, 4e5 * disp, Status::default());
        fake.write(&frame);
        fake.behave(STEPS - 10);
        while fake.frame().is_some() {}
    });
    let text = linked(STEPS, &address, "watchdog_s = 0.02\nreply_timeout_s = 10");
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 0, "{said}");
}

/// The answer of a lockstep specimen stays away. An operator need not wait for its time limit, on either clock. It had not answered
/// its last command, so its position is unknown. The commands that had left have a row, which a replay repeats.
#[test]
fn operator_can_end_the_wait_for_an_answer() {
    for (word, clock, code) in [
        ("INT", "real", 130),
        ("TERM", "simulated", 143),
        ("stop", "real", 130),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (owes, is_waited_for) = mpsc::channel();
        let address = Fake::start(move |mut fake| {
            fake.behave(WARM_UP + 10);
            fake.command().unwrap();
            owes.send(()).unwrap();
            while fake.frame().is_some() {}
        });
        let keys = "coupling = \"lockstep\"\nreply_timeout_s = 50";
        let text = linked(STEPS, &address, keys)
            .replace("\"simulated\"", &format!("\"{clock}\""))
            .replace("[timing]\n", PATIENT);
        let test = Running::start(folder, "run", &text);
        is_waited_for.recv_timeout(PATIENCE).unwrap();
        if word == "stop" {
            let mut stop = gusset();
            stop.arg("stop").arg(folder.join("run"));
            assert!(finish(stop).status.success());
        } else {
            test.signal(word);
        }
        let (found, said) = test.wait();
        assert_eq!(found, code, "{word}: {said}");
        let summary = summary(folder, "run");
        assert!(summary.reason.starts_with("stopped by the operator"));
        assert_eq!(summary.left["column"], "lost");
        let told = events(folder, "run");
        assert!(told.contains(&"stop_requested".to_owned()), "{told:?}");
        let run = Run::open(&folder.join("run")).unwrap();
        let columns = run.columns(&["state", "status_1", "cmd_1_1"]).unwrap();
        let last = columns[0].len() - 1;
        assert_eq!(columns[0][last], NOT_AWAITED, "{word}");
        assert!(Status(columns[1][last] as u32).has(Status::OWED));
        assert_ne!(columns[2][last].to_bits(), columns[2][last - 1].to_bits());
        let replayed = gusset_session::replay(run.path()).unwrap();
        assert!(replayed.is_exact(), "{replayed:?}");
    }
}

#[test]
fn killed_specimen_is_a_lost_link() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let mut served = Served::start(folder, &local(STEPS), &["--transport", transport]);
        // Long enough that it is certainly running when it is killed.
        let keys = format!("transport = \"{transport}\"\nreply_timeout_s = 1");
        let text = linked(1_000_000, &served.address, &keys);
        let owned = folder.to_owned();
        let test = std::thread::spawn(move || run(&owned, "run", &text));
        served.hears("armed for");
        served.kill();
        let (code, said) = test.join().unwrap();
        assert_eq!(code, 3, "{said}");
        let summary = summary(folder, "run");
        assert_eq!(summary.status, Ended::Failed);
        assert!(
            summary.reason.contains("the peer closed the connection"),
            "{}",
            summary.reason
        );
        // Its present state is unknown.
        let held = "specimen \"column\": a watchdog was agreed with its end, which has to hold it: look whether it does";
        assert!(summary.reason.ends_with(held), "{}", summary.reason);
        assert!(events(folder, "run").contains(&"link".to_owned()));
    }
}

#[test]
fn stopped_server_says_goodbye() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut served = Served::start(folder, &local(STEPS), &[]);
    let text = linked(1_000_000, &served.address, "");
    let owned = folder.to_owned();
    let test = std::thread::spawn(move || run(&owned, "run", &text));
    served.hears("armed for");
    assert_eq!(served.signal("TERM"), 143);
    assert_eq!(test.join().unwrap().0, 3);
    let reason = summary(folder, "run").reason;
    assert!(
        reason.contains("the specimen said goodbye: its program ends"),
        "{reason}"
    );
}

#[test]
fn strangers_do_not_disturb_a_running_test() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let served = Served::start(folder, &local(STEPS), &["--transport", transport]);
        let keys = format!("transport = \"{transport}\"");
        // It must outlast all these disturbances on any machine: the test stops it.
        let text = linked(20_000_000, &served.address, &keys);
        let first = Running::start(folder, "first", &text);
        served.hears("armed for");
        first.moves();
        let (code, _) = run(folder, "second", &linked(STEPS, &served.address, &keys));
        assert_eq!(code, 3);
        let cause = summary(folder, "second").cause;
        assert_eq!(cause.as_deref(), Some("not_connected"));
        if transport == "tcp" {
            let mut stranger = TcpStream::connect(&served.address).unwrap();
            let _ = stranger.write_all(&[0xff; 100_000]);
            let _ = stranger.read_to_end(&mut Vec::new());
        } else {
            let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
            for _ in 0..100 {
                let _ = stranger.send_to(&[0xff; 1000], &served.address);
            }
        }
        first.moves();
        let (code, said) = first.interrupt();
        assert_eq!(code, 130, "{said}");
        let summary = summary(folder, "first");
        assert_eq!(summary.status, Ended::Interrupted);
        let link = summary.link["column"];
        assert!(link.sent > 0);
        assert_eq!((link.received, link.corrupt), (link.sent, 0));
    }
}

/// Sampled, in real time, over a network that loses, repeats, damages and overtakes: the books balance.
#[test]
fn sampled_test_over_bad_network_adds_up() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = Served::start(folder, &local(STEPS), &["--transport", "udp"]);
    let fates = Fates {
        lost: 6,
        twice: 6,
        damaged: 6,
        overtaken: 6,
        ..Fates::default()
    };
    let mut relay = Relay::start(&served.address, 7, fates);
    let keys =
        "transport = \"udp\"\ncoupling = \"sampled\"\non_stale = \"extrapolate\"\nmax_stale = 400";
    let text = linked(300, &relay.address, keys)
        .replace("clock = \"simulated\"", "clock = \"real\"\nscale = 5")
        .replace(
            "[timing]",
            "[timing]\nmisses.in_a_row.trip = 100000\nmisses.in_total.trip = 100000",
        );
    let (code, said) = run(folder, "run", &text);
    relay.stop();
    assert_eq!(code, 0, "{said}");
    let link = summary(folder, "run").link["column"];
    assert_eq!(link.sent, 300 + 1 + u64::from(WARM_UP));
    assert_eq!(link.sent, link.received + link.late + link.lost);
    assert!(link.received > 0 && link.lost > 0, "{link:?}");
    // Whatever was damaged or repeated on the way to us was noticed, unless it came after the end.
    let done =
        |count: &std::sync::atomic::AtomicU64| count.load(std::sync::atomic::Ordering::Relaxed);
    let (damaged, twice) = (
        done(&relay.to_controller.damaged),
        done(&relay.to_controller.twice),
    );
    assert!(
        link.corrupt <= damaged && link.corrupt + 2 >= damaged,
        "{link:?} {damaged}"
    );
    assert!(
        link.duplicates <= twice && link.duplicates + 2 >= twice,
        "{link:?} {twice}"
    );
    assert!(link.recovered > 0 && link.missed > 0, "{link:?}");
    let over = served.hears("test over");
    assert!(over.contains("retired"), "{over}");
}
