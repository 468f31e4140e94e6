//! Every exchange passes the gateway's limits. A command that trips one is not passed on, and a measurement that trips one is the
//! last. The controller is informed in its own protocol, and the log names the limit.

use std::path::Path;
use std::sync::{Arc, Mutex};

use crate::link_common::{
    COMPUTED, Fake, ONE_AXIS, ONE_AXIS_LAW, Served, as_read, finish, gateway, gusset, run, summary,
    test_file,
};
use gusset_quantity::substructure::Status;
use gusset_record::Run;
use gusset_record::summary::Status as Ended;

const STEPS: u32 = 500;
const KNOWN: &str = "stiffness_n_per_m = 4e5\n";

fn through(address: &str, keys: &str) -> String {
    let link = format!("[specimen.link]\naddress = \"{address}\"\n{keys}\n");
    test_file(STEPS, &format!("{ONE_AXIS}{link}"))
}

/// A spring of 4e5 N/m that records every command.
fn spring(told: &Arc<Mutex<Vec<f64>>>) -> String {
    let told = Arc::clone(told);
    Fake::start(move |mut fake| {
        while let Some((sequence, disp)) = fake.command() {
            told.lock().unwrap().push(disp);
            let frame = fake.answer(sequence, 4e5 * disp, Status::default());
            fake.write(&frame);
        }
    })
}

/// The last row of a run folder in these columns.
fn last(folder: &Path, names: &[&str]) -> Vec<f64> {
    let columns = Run::open(folder).unwrap().columns(names).unwrap();
    columns
        .iter()
        .map(|column| *column.last().unwrap())
        .collect()
}

fn trip(folder: &Path) -> serde_json::Value {
    let events = Run::open(folder).unwrap().events().unwrap().to_json();
    let trips: Vec<_> = events.iter().filter(|e| e["event"] == "trip").collect();
    assert_eq!(trips.len(), 1, "{events:?}");
    trips[0].clone()
}

/// Runs a test through a gateway with `limits`, one of which trips; returns the name of that limit and the specimen's commands.
fn tripped(limits: &str) -> (String, Vec<f64>) {
    let (name, told, _) = tripped_and_noted(limits);
    (name, told)
}

/// Like [`tripped`], and the log's notes about limits, too.
fn tripped_and_noted(limits: &str) -> (String, Vec<f64>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let told = Arc::default();
    let out = folder.join("kept");
    let served = Served::start(
        folder,
        &gateway(
            &spring(&told),
            &format!("{KNOWN}[specimen.limits]\n{limits}\n"),
            "",
        ),
        &["--out", out.to_str().unwrap()],
    );
    let (code, said) = run(folder, "run", &through(&served.address, ""));
    assert_eq!(code, 1, "{said}");
    let ours = summary(folder, "run");
    assert_eq!(ours.status, Ended::Stopped);
    let kept = out.join("test-0001");
    served.hears("test over");
    let trip = trip(&kept);
    let name = trip["what"].as_str().unwrap().to_owned();
    assert!(
        ours.reason.contains("interlock or emergency stop is open")
            && ours.reason.contains(as_read(&name)),
        "the controller receives the reason: {}",
        ours.reason
    );
    let theirs = Run::open(&kept).unwrap().summary().unwrap().clone();
    assert_eq!(theirs.status, Ended::Stopped);
    assert!(theirs.reason.contains(&name), "{}", theirs.reason);
    let code = last(&kept, &["trip", "status_1"]);
    assert_eq!(code[0], trip["code"].as_f64().unwrap());
    let status = Status(code[1] as u32);
    assert!(
        status.has(Status::INTERLOCK),
        "the flag went to the controller"
    );
    let told = told.lock().unwrap().clone();
    let size = |key: &str| trip[key].as_f64().unwrap().abs();
    assert!(size("value") > size("bound"), "{trip}");
    let events = Run::open(&kept).unwrap().events().unwrap().to_json();
    let notes = events.iter().filter(|event| event["event"] == "limit");
    let notes = notes.map(|note| note["text"].as_str().unwrap().to_owned());
    (name, told, notes.collect())
}

#[test]
fn all_exceeded_levels_are_noted() {
    let both = "{ warn = [-500, 500], trip = [-1500, 1500] }";
    let limits = format!("measured_force_n = {both}\nsensor_force_n = {both}");
    let (name, _, notes) = tripped_and_noted(&limits);
    assert_eq!(name, "sensor_force_n");
    let noted = |end: &str| notes.iter().filter(|note| note.ends_with(end)).count();
    let warned = noted("(sensor_force_n): a warning");
    assert!(warned > 0, "{notes:?}");
    assert_eq!(noted("(measured_force_n): a warning"), warned, "{notes:?}");
    assert_eq!(noted("(measured_force_n): it trips, too"), 1, "{notes:?}");
    assert_eq!(notes.len(), 2 * warned + 1, "{notes:?}");
}

#[test]
fn command_beyond_its_limit_stays_back() {
    let (name, told) = tripped("command_disp_m = { trip = [-0.004, 0.004] }");
    assert_eq!(name, "command_disp_m");
    let largest = told.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
    assert!(largest < 0.004 && largest > 0.003, "{largest}");
    let (name, told) = tripped("command_vel_m_per_s = { trip = 0.05 }");
    assert_eq!(name, "command_vel_m_per_s");
    assert!(told.len() > 10);
    let (name, told) = tripped("command_step_m = { trip = 4e-5 }");
    assert_eq!(name, "command_step_m");
    for pair in told.windows(2) {
        assert!((pair[1] - pair[0]).abs() < 4e-5);
    }
}

#[test]
fn measurement_beyond_its_limit_is_the_last() {
    for (limits, name) in [
        (
            "measured_force_n = { trip = [-1500, 1500] }",
            "measured_force_n",
        ),
        (
            "sensor_force_n = { trip = [-1500, 1500] }",
            "sensor_force_n",
        ),
        (
            "measured_force_n = { warn = [-500, 500], trip = [-1500, 1500] }\nsensor_force_n = { trip = [-2e3, 2e3] }",
            "measured_force_n",
        ),
    ] {
        let (found, told) = tripped(limits);
        assert_eq!(found, name);
        // The spring gives 1500 N at 3.75 mm.
        let beyond = told.iter().filter(|d| d.abs() > 0.00375).count();
        assert_eq!(beyond, 1, "the specimen holds at its last command");
    }
}

#[test]
fn specimen_interlock_passes_and_latches() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let address = Fake::start(|mut fake| {
        fake.behave(20);
        let (sequence, disp) = fake.command().unwrap();
        let frame = fake.answer(sequence, 4e5 * disp, Status::INTERLOCK);
        fake.write(&frame);
        assert!(fake.command().is_none(), "nothing comes after that");
    });
    let out = folder.join("kept");
    let served = Served::start(
        folder,
        &gateway(&address, KNOWN, ""),
        &["--out", out.to_str().unwrap()],
    );
    let (code, said) = run(folder, "run", &through(&served.address, ""));
    assert_eq!(code, 1, "{said}");
    assert!(summary(folder, "run").reason.contains("interlock"));
    served.hears("test over");
    assert_eq!(trip(&out.join("test-0001"))["what"], "interlock");
}

#[test]
fn warning_is_an_event_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let told = Arc::default();
    let out = folder.join("kept");
    let limits = "[specimen.limits]\nmeasured_force_n = { warn = [-500, 500] }\n";
    let served = Served::start(
        folder,
        &gateway(&spring(&told), &format!("{KNOWN}{limits}"), ""),
        &["--out", out.to_str().unwrap()],
    );
    let (code, said) = run(folder, "run", &through(&served.address, ""));
    assert_eq!(code, 0, "{said}");
    served.hears("test over");
    let run = Run::open(&out.join("test-0001")).unwrap();
    let events = run.events().unwrap().to_json();
    let warned: Vec<_> = events.iter().filter(|e| e["event"] == "limit").collect();
    // Each crossing from inside: the spring swings.
    assert!((1..50).contains(&warned.len()), "{warned:?}");
    assert!(
        warned[0]["text"]
            .as_str()
            .unwrap()
            .contains("measured_force_n")
    );
    assert_eq!(run.summary().unwrap().status, Ended::Completed);
}

/// The reason of a test that does not begin at a latched specimen.
fn refused(folder: &Path, name: &str, address: &str) -> String {
    let (code, said) = run(folder, name, &through(address, ""));
    assert_eq!(code, 3, "{said}");
    let reason = summary(folder, name).reason;
    assert!(reason.contains("nothing was moved"), "{reason}");
    reason
}

#[test]
fn trip_refuses_tests_until_it_is_cleared() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (out, theirs) = (folder.join("kept"), folder.join("theirs"));
    let specimen = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let specimen = Served::start(folder, &specimen, &["--out", theirs.to_str().unwrap()]);
    let commanded = || std::fs::read_dir(&theirs).unwrap().count();
    let limits = "[specimen.limits]\ncommand_disp_m = { trip = [-0.004, 0.004] }\n";
    let text = gateway(&specimen.address, &format!("{KNOWN}{limits}"), "");
    let file = crate::link_common::write(folder, "gateway.toml", &text);
    let starts = |arguments: &[&str]| Served::serves(&file, "127.0.0.1:0", arguments);
    let arguments = ["--out", out.to_str().unwrap()];
    let mut served = starts(&arguments);
    let (code, said) = run(folder, "trips", &through(&served.address, ""));
    assert_eq!(code, 1, "{said}");
    let next = served.hears("no test begins until");
    let command = format!("gusset reset {}", out.display());
    assert!(next.contains(&command), "{next}");
    served.hears("test over");
    let reason = refused(folder, "again", &served.address);
    assert!(reason.contains(as_read("command_disp_m")), "{reason}");
    served.kill();
    // The folder of a server's records does not change its memory.
    let elsewhere = folder.join("elsewhere");
    for (name, arguments) in [
        ("none", &[][..]),
        ("other", &["--out", elsewhere.to_str().unwrap()]),
    ] {
        let mut served = starts(arguments);
        served.hears("warning: the specimen tripped at");
        refused(folder, name, &served.address);
        served.kill();
    }
    let mut served = starts(&arguments);
    served.hears("warning: the specimen tripped at");
    refused(folder, "restarted", &served.address);
    let state = std::fs::read_dir(folder.join("state")).unwrap();
    assert_eq!(state.count(), 2, "the record and its lock");
    assert_eq!(commanded(), 1, "the specimen had one test");

    let (code, said) = served.reset();
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("command_disp_m"), "{said}");
    let (code, said) = served.reset();
    assert_eq!((code, said.trim()), (0, "no trip is latched"));
    let (code, _) = run(folder, "cleared", &through(&served.address, ""));
    assert_eq!(code, 1);
    assert_eq!(commanded(), 2);
    served.hears("test over");
    assert_eq!(served.signal("TERM"), 143);
    let (code, said) = served.reset();
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("--reset"), "{said}");

    let with_reset = [&arguments[..], &["--reset"]].concat();
    let served = starts(&with_reset);
    served.hears("cleared: ");
    let (code, _) = run(folder, "anew", &through(&served.address, ""));
    assert_eq!(code, 1);
}

#[test]
fn two_servers_share_no_control_socket() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = gateway("127.0.0.1:1", KNOWN, "");
    let place = folder.join("rig.sock");
    let control = ["--control", place.to_str().unwrap()];
    let _served = Served::start(folder, &text, &control);
    let file = crate::link_common::write(folder, "second.toml", &text);
    let mut second = gusset();
    second.arg("serve").arg(file).args(control);
    second.args(["--listen", "127.0.0.1:0"]);
    let output = finish(second);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("--control"), "{said}");
}

#[test]
fn a_folder_that_keeps_no_record_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let file = crate::link_common::write(folder, "rig.toml", &gateway("127.0.0.1:1", KNOWN, ""));
    let state = crate::link_common::write(folder, "state", "no folder");
    let mut command = gusset();
    command.arg("serve").arg(&file).env("GUSSET_STATE", &state);
    command.args(["--listen", "127.0.0.1:0", "--out"]);
    command.arg(folder.join("kept"));
    let output = finish(command);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("GUSSET_STATE"), "{said}");
}

/// A sensor with an absurd reading, and no limit of the measured displacement.
#[test]
fn absurd_measured_displacement_trips() {
    let broken = || {
        Fake::start(|mut fake| {
            fake.behave(20);
            while let Some((sequence, disp)) = fake.command() {
                let frame = fake.reading(sequence, 1e308, 4e5 * disp, Status::default());
                fake.write(&frame);
            }
        })
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (code, said) = run(folder, "alone", &through(&broken(), ""));
    assert_eq!(code, 1, "{said}");
    let trip_of_test = trip_of_loop(&folder.join("alone"));
    assert_eq!(trip_of_test["limit"], "measured_disp_m", "{trip_of_test}");
    assert_eq!(trip_of_test["bound"], 1e3, "{trip_of_test}");
    let out = folder.join("kept");
    let served = Served::start(
        folder,
        &gateway(&broken(), KNOWN, ""),
        &["--out", out.to_str().unwrap()],
    );
    let (code, said) = run(folder, "run", &through(&served.address, ""));
    assert_eq!(code, 1, "{said}");
    served.hears("test over");
    assert_eq!(trip(&out.join("test-0001"))["what"], "measured_disp_m");
}

/// The event of the limit that tripped in the controller's run folder.
fn trip_of_loop(folder: &Path) -> serde_json::Value {
    let events = Run::open(folder).unwrap().events().unwrap().to_json();
    let of_a_limit = |event: &&serde_json::Value| event["bound"].is_number();
    events
        .iter()
        .find(of_a_limit)
        .cloned()
        .unwrap_or_else(|| panic!("{events:?}"))
}

/// OpenFresco's protocols have no message for a trip: the connection is closed, and the cause is logged on our side.
#[test]
fn openfresco_link_is_closed_with_its_cause() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let told = Arc::default();
    let out = folder.join("kept");
    let limits = "[specimen.limits]\ncommand_disp_m = { trip = [-0.004, 0.004] }\n";
    let served = Served::start(
        folder,
        &gateway(&spring(&told), &format!("{KNOWN}{limits}"), ""),
        &["--protocol", "openfresco", "--out", out.to_str().unwrap()],
    );
    let text = through(&served.address, "protocol = \"openfresco\"");
    let (code, said) = run(folder, "run", &text);
    assert_eq!(code, 3, "{said}");
    let line = served.hears("the specimen holds");
    assert!(line.contains("command_disp"), "{line}");
    assert_eq!(trip(&out.join("test-0001"))["what"], "command_disp_m");
    let largest = told
        .lock()
        .unwrap()
        .iter()
        .fold(0.0, |m: f64, d| m.max(d.abs()));
    assert!(largest < 0.004, "{largest}");
}

/// A gateway does not report whether a machine is behind it: the simulated clock needs `computed = true`.
#[test]
fn simulated_clock_commands_no_machine() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let told = Arc::default();
    let served = Served::start(folder, &gateway(&spring(&told), KNOWN, ""), &[]);
    let text = through(&served.address, "").replace(COMPUTED, "");
    let (code, said) = run(folder, "run", &text);
    assert_eq!(code, 3, "{said}");
    let reason = summary(folder, "run").reason;
    assert!(reason.contains("`computed = true`"), "{reason}");
    assert!(reason.contains("nothing was moved"), "{reason}");
    assert!(told.lock().unwrap().is_empty());
}
