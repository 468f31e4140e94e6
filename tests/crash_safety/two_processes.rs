//! `gusset run` and `gusset serve` in real time, over UDP and TCP; one of them is killed or stops.

use crate::common::test_file::{NEVER_LATE, TestFile};
use std::path::Path;

use gusset_record::summary::Status;
use gusset_record::{End, Run};

use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, Running, Served, finish, gateway, gusset, linked, run, summary,
    test_file,
};
use crate::{is_whole, rows};

const STEPS: u32 = 40;
/// Far longer than these tests last.
const LONG: u32 = 3_000_000;

fn specimen(folder: &Path, transport: &str) -> Served {
    let text = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    Served::start(folder, &text, &["--transport", transport])
}

/// In real time, sampled, at 200 Hz: slow enough for any machine. Lateness is forgiven.
fn in_real_time(steps: u32, address: &str, transport: &str, keys: &str) -> String {
    linked(
        steps,
        address,
        &format!("transport = \"{transport}\"\nwatchdog_s = 0.2\nprobe = \"none\"\n{keys}"),
    )
    .with("time = { clock = 'real', scale = 5 }")
    .with(NEVER_LATE)
}

/// As soon as the specimen takes one, the next test runs to its end.
fn the_next_one_completes(folder: &Path, address: &str, transport: &str) {
    let text = linked(STEPS, address, &format!("transport = \"{transport}\"\n"));
    for attempt in 0.. {
        let name = format!("next-{attempt}");
        let (code, said) = run(folder, &name, &text);
        if code == 0 {
            return;
        }
        // A UDP server waits half a minute for a silent controller: it may come back.
        assert!(
            said.contains("another controller") && attempt < 4000,
            "{said}"
        );
        crate::rest(std::time::Duration::from_millis(50));
    }
}

/// A served specimen, and a long test on it that moves.
fn in_mid_test(folder: &Path, name: &str, transport: &str, keys: &str) -> (Served, Running) {
    let served = specimen(folder, transport);
    let text = in_real_time(LONG, &served.address, transport, keys);
    let test = Running::start(folder, name, &text);
    served.hears("armed for");
    test.moves();
    (served, test)
}

#[test]
fn killed_controller_leaves_a_held_specimen() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (served, mut test) = in_mid_test(folder, "killed", transport, "max_stale = 100000");
        test.kill();
        if transport == "udp" {
            // Nothing closes: silence is all that there is.
            served.hears("HOLDING: no command received for");
        } else {
            let over = served.hears("test over");
            assert!(over.contains("a goodbye"), "{over}");
            assert!(over.contains("stays where"), "{over}");
        }
        let killed = Run::open(&folder.join("killed")).unwrap();
        assert!(killed.summary().is_none());
        let (rows, end) = rows(&killed);
        assert!(
            !rows.is_empty() && matches!(end, End::Clean | End::Torn { .. }),
            "{end}"
        );
        the_next_one_completes(folder, &served.address, transport);
    }
}

#[test]
fn killed_specimen_ends_the_test_as_planned() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (mut served, test) = in_mid_test(folder, "run", transport, "max_stale = 400");
        served.kill();
        let (code, said) = test.wait();
        // UDP: the system may report that no server is there, or stay silent.
        let summary = summary(folder, "run");
        match code {
            3 => assert_eq!(summary.status, Status::Failed),
            1 if transport == "udp" => assert_eq!(summary.status, Status::Stopped),
            other => panic!("{other}: {said}"),
        }
        let reason = &summary.reason;
        let closed = reason.contains("peer closed");
        assert!(closed || reason.contains("fresh measurement"), "{reason}");
        assert_eq!(summary.rows_lost, 0);
        is_whole(folder, "run", true);
    }
}

#[test]
fn stopped_controller_continues() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (served, test) = in_mid_test(folder, "run", transport, "max_stale = 100000");
        test.signal("STOP");
        served.hears("HOLDING: no command received for");
        test.signal("CONT");
        served.hears("commands come again");
        test.moves();
        let (code, said) = test.interrupt();
        assert_eq!(code, 130, "{said}");
        let over = served.hears("test over");
        assert!(over.contains("retired"), "{over}");
        let summary = summary(folder, "run");
        assert_eq!(summary.status, Status::Interrupted);
        // The specimen saw slower time; it was 40 ticks of 5 ms at least, and no step was lost.
        assert!(summary.deadline_misses > 0, "{summary:?}");
        assert!(summary.stretched_ticks >= 30, "{}", summary.stretched_ticks);
        is_whole(folder, "run", false);
        let run = Run::open(&folder.join("run")).unwrap();
        let steps = run.columns(&["step"]).unwrap().remove(0);
        assert_eq!(steps.last().copied(), Some(summary.steps as f64));
        assert!(
            steps
                .iter()
                .enumerate()
                .all(|(row, step)| *step == row as f64)
        );
        the_next_one_completes(folder, &served.address, transport);
    }
}

#[test]
fn stopped_specimen_trips_at_stale_bound() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (served, test) = in_mid_test(folder, "run", transport, "max_stale = 200");
        served.send("STOP");
        let (code, said) = test.wait();
        assert_eq!(code, 1, "{said}");
        let summary = summary(folder, "run");
        assert_eq!(summary.status, Status::Stopped);
        let reason = &summary.reason;
        assert!(reason.contains("201 ticks"), "{reason}");
        is_whole(folder, "run", true);
        // It resumes after its controller is gone, and accepts the next one.
        served.send("CONT");
        served.hears("test over");
        the_next_one_completes(folder, &served.address, transport);
    }
}

#[test]
fn shortly_stopped_specimen_is_waited_for() {
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let (served, test) = in_mid_test(folder, "run", transport, "max_stale = 100000");
        served.send("STOP");
        // The test continues with the last known force.
        test.moves();
        served.send("CONT");
        test.moves();
        let (code, said) = test.interrupt();
        assert_eq!(code, 130, "{said}");
        let link = summary(folder, "run").link["column"];
        assert_eq!(link.sent, link.received + link.late + link.lost);
        assert!(link.received > 0, "{link:?}");
        is_whole(folder, "run", false);
    }
}

/// Allowed distance in m of a specimen from its last position: more than it moves in the instant without a row.
const NEAR: f64 = 1e-3;

/// The commands of a test on record.
fn commands(folder: &Path) -> Vec<f64> {
    let Ok(run) = Run::open(&folder.join("killed")) else {
        return Vec::new();
    };
    let commands = run.columns(&["cmd_1_1"]).map(|mut all| all.remove(0));
    commands.unwrap_or_default()
}

/// A specimen that keeps its position, or restarts with each controller.
fn that_remembers(folder: &Path, remembers: bool) -> Served {
    let text = format!(
        "[serve]\nremembers = {remembers}\n[[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}"
    );
    Served::start(folder, &text, &["--transport", "tcp"])
}

/// A test on such a specimen that was killed midway.
fn killed_on(folder: &Path, remembers: bool) -> Served {
    let served = that_remembers(folder, remembers);
    far_from_its_start(folder, &served).kill();
    served.hears("the specimen stays where it is");
    served
}

/// A running test on the served specimen, far from its start.
fn far_from_its_start(folder: &Path, served: &Served) -> Running {
    let keys = "max_stale = 100000";
    let text = in_real_time(LONG, &served.address, "tcp", keys);
    let text = text.with(&format!("safety.resume_within_m = {NEAR}"));
    let test = Running::start(folder, "killed", &text);
    served.hears("armed for");
    while commands(folder).last().copied().unwrap_or(0.0).abs() < 3.0 * NEAR {
        test.moves();
    }
    test
}

/// Resumes the killed test, which reports this at its start.
fn go_on(folder: &Path) -> Running {
    let (killed, next) = (folder.join("killed"), folder.join("next"));
    Running::with(
        &[
            "run".as_ref(),
            "--resume".as_ref(),
            killed.as_os_str(),
            "--out".as_ref(),
            next.as_os_str(),
        ],
        &next,
    )
}

fn standing(folder: &Path, name: &str) -> f64 {
    let events = Run::open(&folder.join(name)).unwrap().events().unwrap();
    let said = events
        .events
        .iter()
        .find_map(|line| line.fields().get("standing"));
    said.unwrap().as_str().unwrap().parse().unwrap()
}

#[test]
fn killed_test_resumes_where_specimen_is() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = killed_on(folder, true);
    assert_eq!(standing(folder, "killed"), 0.0);
    let test = go_on(folder);
    served.hears("armed for");
    test.moves();
    let (code, said) = test.interrupt();
    assert_eq!(code, 130, "{said}");
    let stood = standing(folder, "next");
    assert_ne!(stood, 0.0);
    let run = Run::open(&folder.join("next")).unwrap();
    let commands = run.columns(&["cmd_1_1"]).unwrap().remove(0);
    assert_eq!(commands[0], stood, "the first command moves nothing");
    is_whole(folder, "next", false);
}

#[test]
fn restarted_computed_specimen_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = killed_on(folder, false);
    let (code, said) = go_on(folder).wait();
    assert_eq!(code, 2, "{said}");
    let summary = summary(folder, "next");
    let reason = &summary.reason;
    assert!(reason.contains("[serve] remembers = true"), "{reason}");
    let run = Run::open(&folder.join("next")).unwrap();
    assert!(rows(&run).0.is_empty(), "nothing was sent");
    drop(served);
}

/// Only with its next test does a gateway learn whether a specimen that calls itself a computation keeps its state. The test is
/// held before, so that the last command is on record.
#[test]
fn killed_test_resumes_through_a_gateway() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let specimen = that_remembers(folder, true);
    let file = gateway(&specimen.address, "stiffness_n_per_m = 4e5\n", "");
    let between = Served::start(folder, &file, &["--transport", "tcp"]);
    let mut test = far_from_its_start(folder, &between);
    let mut hold = gusset();
    hold.arg("hold").arg(folder.join("killed"));
    assert!(finish(hold).status.success());
    while !commands(folder)
        .windows(2)
        .last()
        .is_some_and(|pair| pair[0] == pair[1])
    {
        test.moves();
    }
    test.kill();
    between.hears("the specimen stays where it is");
    let test = go_on(folder);
    between.hears("armed for");
    test.moves();
    let (code, said) = test.interrupt();
    assert_eq!(code, 130, "{said}");
}
