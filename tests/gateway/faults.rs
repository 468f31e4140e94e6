//! A fault around a gateway ends the controller's test in a stated way, is in the log, and leaves the gateway ready for the next
//! test.

use std::path::Path;
use std::process::Command;
use std::sync::mpsc::channel;

use crate::link_common::{
    Fake, ONE_AXIS, ONE_AXIS_LAW, PATIENCE, Running, Served, as_read, finish, gateway, gusset, run,
    run_reworded, summary, test_file,
};
use gusset_quantity::substructure::Status;
use gusset_record::Run;
use gusset_record::summary::Status as Ended;
use gusset_wire::native::{Cause, Frame};

const STEPS: u32 = 100;
const KNOWN: &str = "stiffness_n_per_m = 4e5\n";

fn local() -> String {
    test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"))
}

fn through(steps: u32, address: &str, keys: &str) -> String {
    let link = format!("[specimen.link]\naddress = \"{address}\"\n{keys}\n");
    test_file(steps, &format!("{ONE_AXIS}{link}"))
}

fn event_names(folder: &Path) -> Vec<String> {
    let events = Run::open(folder).unwrap().events().unwrap();
    let names = events.events.iter().map(|line| line.name().to_owned());
    names.collect()
}

/// Waits until rows are on the disk, which they are within 25 ms.
fn recording(kept: &Path) {
    while std::fs::metadata(kept.join("samples.bin")).map_or(0, |m| m.len()) < 100_000 {
        std::thread::yield_now();
    }
}

/// A specimen on a free port, and again on the same port.
fn specimen_at(folder: &Path, address: &str, more: &[&str]) -> Served {
    let listen = ["--listen", address];
    Served::start(folder, &local(), &[&listen[..], more].concat())
}

#[test]
fn killed_specimen_spares_the_gateway() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let out = folder.join("kept");
        let carrier = ["--transport", transport];
        let mut specimen = Served::start(folder, &local(), &carrier);
        let keys = format!("transport = \"{transport}\"\nreply_timeout_s = 1");
        let between = Served::start(
            folder,
            &gateway(&specimen.address, KNOWN, &keys),
            &["--transport", transport, "--out", out.to_str().unwrap()],
        );
        let keys = format!("transport = \"{transport}\"");
        let text = through(1_000_000, &between.address, &keys);
        let owned = folder.to_owned();
        // The wording of the gateway decides nothing.
        let is_reworded = transport == "tcp";
        let run_it = if is_reworded { run_reworded } else { run };
        let test = std::thread::spawn(move || run_it(&owned, "killed", &text));
        recording(&out.join("test-0001"));
        specimen.kill();
        let (code, said) = test.join().unwrap();
        assert_eq!(code, 3, "{said}");
        let ours = summary(folder, "killed");
        assert_eq!(ours.cause.as_deref(), Some("link"));
        assert_eq!(ours.left["column"], "lost");
        let reason = ours.reason;
        let is_reworded = is_reworded || !as_read("").is_empty();
        assert_eq!(reason.contains("reworded"), is_reworded, "{reason}");
        // The agreed watchdog is the gateway's, which reports that it no longer has a specimen to hold.
        let stands = "; only the server of specimen \"column\" knows its position";
        assert!(
            reason.contains(stands) && !reason.contains("watchdog"),
            "{reason}"
        );
        let over = between.hears("test over: the specimen is lost");
        assert!(
            over.ends_with("only the server of the specimen knows its position"),
            "{over}"
        );
        let kept = out.join("test-0001");
        let theirs = Run::open(&kept).unwrap().summary().unwrap().clone();
        assert_eq!(theirs.status, Ended::Failed);
        assert_eq!(theirs.cause.as_deref(), Some("specimen_lost"));
        let said = theirs.reason.matches("the specimen is lost").count();
        assert_eq!(said, 1, "{}", theirs.reason);
        assert!(theirs.link["column"].lost <= 1 && theirs.link["column"].received > 0);
        assert_eq!(event_names(&kept).last().unwrap(), "ended");

        // The next test finds another specimen on the same port.
        let again = specimen_at(folder, &specimen.address, &carrier);
        let (code, said) = run(folder, "next", &through(STEPS, &between.address, &keys));
        assert_eq!(code, 0, "{said}");
        again.hears("retired at the end of the test");
        let next = Run::open(&out.join("test-0002")).unwrap();
        assert_eq!(next.summary().unwrap().status, Ended::Completed);
    }
}

#[test]
fn unavailable_specimen_is_refused_early() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let out = folder.join("kept");
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let nowhere = port.local_addr().unwrap().to_string();
    drop(port);
    let between = Served::start(
        folder,
        &gateway(&nowhere, KNOWN, ""),
        &["--out", out.to_str().unwrap()],
    );
    for number in 1..=2 {
        let name = format!("run-{number}");
        let (code, said) = run(folder, &name, &through(STEPS, &between.address, ""));
        assert_eq!(code, 3, "{said}");
        let reason = summary(folder, &name).reason;
        assert!(
            ["refused the connection", &nowhere]
                .map(as_read)
                .iter()
                .all(|words| reason.contains(words)),
            "{reason}"
        );
        between.hears("refused the connection");
        let kept = out.join(format!("test-000{number}"));
        let theirs = Run::open(&kept).unwrap().summary().unwrap().clone();
        assert_eq!((theirs.status, theirs.steps), (Ended::Failed, 0));
        assert!(event_names(&kept).contains(&"link".to_owned()));
    }
}

#[test]
fn reversed_specimen_is_refused_by_gateway() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let address = Fake::start_with(-4e5, |mut fake| {
        assert!(fake.command().is_none(), "nothing moves");
    });
    let between = Served::start(folder, &gateway(&address, KNOWN, ""), &[]);
    let (code, _) = run(folder, "run", &through(STEPS, &between.address, ""));
    assert_eq!(code, 3);
    let reason = summary(folder, "run").reason;
    assert!(
        reason.contains(as_read("a channel is reversed")),
        "{reason}"
    );
}

#[test]
fn vanished_controller_frees_the_specimen() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let out = folder.join("kept");
    let theirs = folder.join("theirs");
    let specimen = Served::start(folder, &local(), &["--out", theirs.to_str().unwrap()]);
    let between = Served::start(
        folder,
        &gateway(&specimen.address, KNOWN, ""),
        &["--out", out.to_str().unwrap()],
    );
    let file = crate::link_common::write(
        folder,
        "vanishes.toml",
        &through(1_000_000, &between.address, ""),
    );
    let mut controller = gusset()
        .arg("run")
        .arg(file)
        .arg("--out")
        .arg(folder.join("vanishes"))
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    specimen.hears("armed for");
    controller.kill().unwrap();
    controller.wait().unwrap();
    between.hears("without a goodbye");
    // Nothing tripped: the record must not suggest a limit.
    specimen.hears("retired because its controller is lost");
    // The gateway closes its record of the first test before it accepts the next one.
    for attempt in 0.. {
        let name = format!("next-{attempt}");
        let (code, said) = run(folder, &name, &through(STEPS, &between.address, ""));
        if code == 0 {
            break;
        }
        let cause = summary(folder, &name).cause;
        assert!(
            cause.as_deref() == Some("not_connected") && attempt < 50,
            "{said}"
        );
    }
    for kept in [out, theirs] {
        let first = Run::open(&kept.join("test-0001")).unwrap();
        assert_eq!(first.summary().unwrap().status, Ended::Failed);
    }
}

#[test]
fn second_controller_is_refused_quietly() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let specimen = Served::start(folder, &local(), &[]);
    let between = Served::start(folder, &gateway(&specimen.address, KNOWN, ""), &[]);
    let text = through(20_000, &between.address, "");
    let owned = folder.to_owned();
    let test = std::thread::spawn(move || run(&owned, "first", &text));
    between.hears("armed for");
    let (code, _) = run(folder, "second", &through(STEPS, &between.address, ""));
    assert_eq!(code, 3);
    let cause = summary(folder, "second").cause;
    assert_eq!(cause.as_deref(), Some("not_connected"));
    assert_eq!(test.join().unwrap().0, 0);
}

/// A specimen, a gateway that keeps its tests in `kept`, and a long test through it: returns its exit code and its output.
fn a_long_test_that_is_kept(
    folder: &Path,
) -> (Served, Served, std::thread::JoinHandle<(i32, String)>) {
    let out = folder.join("kept");
    let specimen = Served::start(folder, &local(), &[]);
    let between = Served::start(
        folder,
        &gateway(&specimen.address, KNOWN, ""),
        &["--out", out.to_str().unwrap()],
    );
    let text = through(1_000_000, &between.address, "");
    let owned = folder.to_owned();
    let test = std::thread::spawn(move || run(&owned, "run", &text));
    (specimen, between, test)
}

#[test]
fn stopped_gateway_ends_test_at_both_ends() {
    for signal in ["TERM", "HUP"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (specimen, mut between, test) = a_long_test_that_is_kept(folder);
        between.hears("armed for");
        assert_eq!(between.signal(signal), 143);
        assert_eq!(test.join().unwrap().0, 3);
        specimen.hears("retired because the program that commands it ends");
        let kept = Run::open(&folder.join("kept/test-0001")).unwrap();
        assert_eq!(kept.summary().unwrap().status, Ended::Interrupted);
    }
}

/// The specimen's server accepts the connection and stays silent. The gateway's operator, or that of the test, can end the wait.
#[test]
fn gateway_wait_ends_by_either_operator() {
    for is_told in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let out = folder.join("kept");
        let mute = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = mute.local_addr().unwrap().to_string();
        let file = gateway(&address, KNOWN, "");
        let file = file.replace("connect_timeout_s = 2", "connect_timeout_s = 50");
        let mut between = Served::start(folder, &file, &["--out", out.to_str().unwrap()]);
        let keys = "connect_timeout_s = 50";
        let test = Running::start(folder, "run", &through(STEPS, &between.address, keys));
        let _gateway = mute.accept().unwrap();
        let kept = || Run::open(&out.join("test-0001")).unwrap();
        if is_told {
            assert_eq!(between.signal("INT"), 130);
            let (code, said) = test.wait();
            assert_eq!(code, 3, "{said}");
            let reason = summary(folder, "run").reason;
            assert!(
                reason.contains(as_read("the server was stopped")),
                "{reason}"
            );
            assert_eq!(kept().summary().unwrap().status, Ended::Interrupted);
        } else {
            assert_eq!(test.interrupt().0, 130);
            between.hears("refused: ");
            let reason = kept().summary().unwrap().reason.clone();
            assert!(reason.contains("the controller said goodbye"), "{reason}");
        }
    }
}

/// In the running test the specimen takes long over an answer. An operator can end the wait, and both ends are informed. If the
/// operator's command took effect only after the reply time limit, the specimen would count as lost.
#[test]
fn gateway_operator_ends_a_wait_in_the_test() {
    for protocol in ["gusset", "openfresco"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let out = folder.join("kept");
        let (tell, told) = channel();
        let address = Fake::start(move |mut fake| {
            for _ in 0..20 {
                let (sequence, disp) = fake.command().unwrap();
                let answer = fake.reading(sequence, disp, 4e5 * disp, Status::default());
                fake.write(&answer);
            }
            fake.command().unwrap();
            tell.send(None).unwrap();
            while let Some(frame) = fake.frame() {
                if let Frame::Retire(notice) = fake.decoder.open(&frame).unwrap().frame {
                    tell.send(Some(notice.cause)).unwrap();
                }
            }
        });
        let file = gateway(&address, KNOWN, "reply_timeout_s = 20");
        let kept = ["--out", out.to_str().unwrap(), "--protocol", protocol];
        let mut between = Served::start(folder, &file, &kept);
        let keys = format!("protocol = \"{protocol}\"\nprobe = \"none\"\nreply_timeout_s = 60");
        let test = Running::start(folder, "run", &through(STEPS, &between.address, &keys));
        assert_eq!(told.recv_timeout(PATIENCE).unwrap(), None);
        assert_eq!(between.signal("TERM"), 143, "{protocol}");
        let kept = Run::open(&out.join("test-0001")).unwrap();
        let summary = kept.summary().unwrap();
        assert_eq!(summary.status, Ended::Interrupted, "{}", summary.reason);
        let cause = told.recv_timeout(PATIENCE).unwrap();
        assert_eq!(cause, Some(Cause::Shutdown), "{protocol}");
        assert_eq!(test.wait().0, 3, "{protocol}");
        // The log shows which command was not answered.
        let status = kept.columns(&["status_1"]).unwrap().remove(0);
        let (last, before) = status.split_last().unwrap();
        assert_eq!(*last as u32, Status::OWED.0);
        assert!(before.iter().all(|status| *status == 0.0));
    }
}

#[test]
fn operator_who_ended_the_test_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let [kept, theirs] = ["kept", "theirs"].map(|name| folder.join(name));
    let out = ["--out", theirs.to_str().unwrap()];
    let specimen = Served::start(folder, &local(), &out);
    let between = Served::start(
        folder,
        &gateway(&specimen.address, KNOWN, ""),
        &["--out", kept.to_str().unwrap()],
    );
    let test = Running::start(folder, "run", &through(1_000_000, &between.address, ""));
    between.hears("armed for");
    test.moves();
    let (code, said) = test.interrupt();
    assert_eq!(code, 130, "{said}");
    for (served, records) in [(&between, &kept), (&specimen, &theirs)] {
        served.hears("retired by the operator");
        let record = Run::open(&records.join("test-0001")).unwrap();
        let summary = record.summary().unwrap();
        assert_eq!(summary.status, Ended::Interrupted, "{}", summary.reason);
    }
}

/// After a kill −9 the folder shows that it is unfinished, and every row up to the last moments is there.
#[test]
fn killed_gateways_folder_is_readable() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (specimen, mut between, test) = a_long_test_that_is_kept(folder);
    let kept = folder.join("kept/test-0001");
    recording(&kept);
    between.kill();
    assert_eq!(test.join().unwrap().0, 3);
    specimen.hears("without a goodbye");
    let mut report = gusset();
    report.arg("report").arg(&kept);
    let said = finish(report);
    assert!(said.status.success());
    let words = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(words.contains("unfinished"), "{words}");
    let csv = folder.join("rows.csv");
    let mut export: Command = gusset();
    export.arg("export").arg(&kept).arg("--out").arg(&csv);
    let said = finish(export);
    assert!(said.status.success(), "{said:?}");
    let rows = std::fs::read_to_string(csv).unwrap().lines().count();
    assert!(rows > 100, "{rows}");
}
