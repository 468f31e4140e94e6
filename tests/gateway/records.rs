//! `gusset serve --out`: every controller's test has a separate run folder, for a gateway and for a formula alike. It has one row
//! per exchange in the format of every run folder. The example in config/ works.

use std::path::{Path, PathBuf};

use crate::link_common::{
    COMPUTED, ONE_AXIS, ONE_AXIS_LAW, Served, TWO_AXES, TWO_AXES_LAW, UNLIMITED, as_read,
    assert_replays, finish, gateway, gusset, run, summary, test_file,
};
use crate::waits_for;
use gusset_actuator::specimen::SpecimenLaw;
use gusset_config::LimitsSpec;
use gusset_link::served::{Computed, Controller, RecordSettings, ServedSpecimen};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{Command, Measurement};
use gusset_quantity::units::AxisUnits;
use gusset_record::journal::encode;
use gusset_record::summary::Status;
use gusset_record::{Journal, Run};

const STEPS: u32 = 200;
const WARM_UP: usize = 5;

fn linked(seen: &str, address: &str, keys: &str) -> String {
    let link = format!("[specimen.link]\naddress = \"{address}\"\n{keys}\n");
    test_file(STEPS, &format!("{seen}{link}"))
}

fn column(folder: &Path, name: &str) -> Vec<f64> {
    Run::open(folder)
        .unwrap()
        .columns(&[name])
        .unwrap()
        .remove(0)
}

/// The server and the controller recorded the same test.
fn agrees(ours: &Path, theirs: &Path, axes: usize) {
    for axis in 1..=axes {
        for kind in ["cmd", "raw_disp", "raw_force"] {
            let name = format!("{kind}_1_{axis}");
            let (here, there) = (column(ours, &name), column(theirs, &name));
            // Warm-up exchanges are no rows of the controller.
            assert_eq!(here.len() + WARM_UP, there.len(), "{name}");
            assert_eq!(here, there[WARM_UP..], "{name}");
        }
    }
    let times = column(theirs, "time");
    assert_eq!(times[WARM_UP..], column(ours, "time"));
    assert!(column(theirs, "trip").iter().all(|code| *code == 0.0));
}

#[test]
fn served_formula_keeps_a_folder_per_test() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let out = folder.join("deep/kept");
    let units = "[[specimen.axis]]\nunit_disp = \"mm\"\nunit_force = \"kN\"\n[[specimen.axis]]\n";
    let file = format!("[[specimen]]\nname = \"column\"\n{units}{TWO_AXES_LAW}");
    let served = Served::start(folder, &file, &["--out", out.to_str().unwrap()]);
    for number in 1..=3 {
        let name = format!("run-{number}");
        let seen = format!("{TWO_AXES}{units}");
        let (code, said) = run(folder, &name, &linked(&seen, &served.address, ""));
        assert_eq!(code, 0, "{said}");
        served.hears("test over");
        let kept = out.join(format!("test-000{number}"));
        agrees(&folder.join(&name), &kept, 2);
        let run = Run::open(&kept).unwrap();
        let summary = run.summary().unwrap();
        assert_eq!(summary.status, Status::Completed);
        assert_eq!((summary.rows_lost, summary.rate_hz), (0, 1000.0));
        // The warm-up holds are one step with step 0.
        assert_eq!(summary.steps, u64::from(STEPS) + 1);
        assert_eq!(
            summary.link["column"].received,
            u64::from(STEPS) + 1 + WARM_UP as u64
        );
        let events = run.events().unwrap().to_json();
        let controller = events.iter().find(|e| e["event"] == "controller").unwrap();
        assert_eq!(controller["test"], "link");
        assert_eq!(events.last().unwrap()["event"], "ended");
        let given = std::fs::read_to_string(kept.join("test.toml")).unwrap();
        assert_eq!(given, file, "byte for byte");
        // Metres and newtons beside the units of the axis.
        let (target, cmd) = (column(&kept, "target_1_1"), column(&kept, "cmd_1_1"));
        for (target, cmd) in target.iter().zip(&cmd) {
            assert_eq!(*target, 1e-3 * cmd);
        }
    }
}

#[test]
fn resolved_toml_serves_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let out = folder.join("kept");
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let specimen = Served::start(folder, &local, &[]);
    let keys = "[specimen.limits]\ncommand_disp_m = { trip = [-1, 1] }\n";
    let file = gateway(
        &specimen.address,
        &format!("stiffness_n_per_m = 4e5\n{keys}"),
        "",
    );
    let first = Served::start(
        folder,
        &file,
        &["--transport", "udp", "--out", out.to_str().unwrap()],
    );
    let text = linked(ONE_AXIS, &first.address, "transport = \"udp\"");
    assert_eq!(run(folder, "first", &text).0, 0);
    first.hears("test over");
    agrees(&folder.join("first"), &out.join("test-0001"), 1);
    let resolved = std::fs::read_to_string(out.join("test-0001/resolved.toml")).unwrap();
    drop(first);
    let again = Served::start(folder, &resolved, &["--out", out.to_str().unwrap()]);
    let text = linked(ONE_AXIS, &again.address, "transport = \"udp\"");
    let (code, said) = run(folder, "again", &text);
    assert_eq!(code, 0, "{said}");
    again.hears("test over");
    agrees(&folder.join("again"), &out.join("test-0002"), 1);
}

/// A server of a formula whose first test has run, and the folder of its records.
fn kept_of_a_formula(folder: &Path, more: &[&str]) -> (Served, PathBuf) {
    let out = folder.join("kept");
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let arguments = [&["--out", out.to_str().unwrap()], more].concat();
    let served = Served::start(folder, &local, &arguments);
    let (code, said) = run(folder, "run", &linked(ONE_AXIS, &served.address, ""));
    assert_eq!(code, 0, "{said}");
    served.hears("test over");
    (served, out)
}

#[test]
fn report_and_export_read_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (_served, out) = kept_of_a_formula(folder, &[]);
    let kept = out.join("test-0001");
    let metric = |key: &str| {
        let metrics = serde_json::to_value(summary(&out, "test-0001").metrics).unwrap();
        metrics["column"][0][key]["value"].as_f64()
    };
    waits_for("no metrics", || metric("slope").is_some());
    // A formula measures what is commanded: the target, converted to its unit and back.
    assert!((metric("slope").unwrap() - 1.0).abs() < 1e-9);
    assert!(metric("peak_error_m").unwrap() < 1e-12);
    let mut report = gusset();
    report.arg("report").arg(&kept);
    assert!(finish(report).status.success());
    assert_replays(&kept);
    let page = std::fs::read_to_string(kept.join("report.html")).unwrap();
    assert!(page.contains("Completed") && page.contains("<svg") && page.contains("column"));
    let csv = folder.join("rows.csv");
    let mut export = gusset();
    export.arg("export").arg(&kept).arg("--no-units-line");
    export.arg("--out").arg(&csv);
    assert!(finish(export).status.success());
    let text = std::fs::read_to_string(csv).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("time,target_1_1,cmd_1_1,meas_1_1,force_1_1,status_1")
    );
    // The first place is commanded again in each tick of the warm-up: one step.
    assert_eq!(lines.count(), STEPS as usize + 1);
}

/// A number that its specimen would not have been sent.
#[test]
fn changed_command_of_a_server_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (_, out) = kept_of_a_formula(folder, &[]);
    let kept = out.join("test-0001");
    assert_replays(&kept);
    let layout = Run::open(&kept).unwrap().layout().clone();
    let summary_text = std::fs::read_to_string(kept.join("summary.json")).unwrap();
    let samples = std::fs::read(kept.join("samples.bin")).unwrap();
    for name in ["cmd_1_1", "meas_1_1", "status_1", "asked_1_1"] {
        let place = layout.index_of(name).unwrap();
        let mut journal = Journal::new(&samples[..], layout.columns().len());
        let mut changed = Vec::new();
        while let Some(row) = journal.next_row().unwrap() {
            let mut values = row.values.to_vec();
            if row.sequence == 20 {
                values[place] = f64::from_bits(values[place].to_bits() ^ 1);
            }
            encode(row.sequence, &values, &mut changed);
        }
        std::fs::write(kept.join("samples.bin"), &changed).unwrap();
        let found = gusset_session::replay(&kept).unwrap();
        let difference = found.difference.unwrap();
        assert_eq!(difference.row, 20, "{name}: {difference:?}");
    }
    // Whole rows are missing at the end, with a summary and without.
    let stride = layout.stride();
    std::fs::write(kept.join("samples.bin"), &samples[..20 * stride]).unwrap();
    let cut = || gusset_session::replay(&kept).unwrap();
    let found = cut();
    assert_eq!((found.rows, found.is_exact()), (20, false), "{found:?}");
    std::fs::remove_file(kept.join("summary.json")).unwrap();
    assert!(!cut().is_exact());
    std::fs::write(kept.join("samples.bin"), &samples).unwrap();
    assert!(cut().is_exact());
    let mut summary: serde_json::Value = serde_json::from_str(&summary_text).unwrap();
    summary["link"]["column"]["sent"] = 7.into();
    std::fs::write(kept.join("summary.json"), summary.to_string()).unwrap();
    let [difference] = &cut().summary[..] else {
        panic!("one number of the summary was changed")
    };
    assert_eq!(difference.key, "link.column.sent");
}

#[test]
fn injected_faults_are_shown_in_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let script = "title = \"a spike\" # of 7 N\n[[fault]]\nat = 60\nfor = 1\nkind = { bias = { force_n = 7.0 } }\n";
    let path = crate::link_common::write(folder, "spike.toml", script);
    let (_, out) = kept_of_a_formula(folder, &["--fault", path.to_str().unwrap()]);
    let kept = out.join("test-0001");
    let run = Run::open(&kept).unwrap();
    let summary = run.summary().unwrap();
    assert_eq!(summary.warnings, ["FAULTS are played: a spike"]);
    let [copy] = summary.inputs.as_slice() else {
        panic!("{:?}", summary.inputs)
    };
    let copied = std::fs::read_to_string(kept.join(&copy.path)).unwrap();
    assert_eq!(copied, script, "byte for byte");
    let mut report = gusset();
    report.arg("report").arg(&kept);
    assert!(finish(report).status.success());
    let page = std::fs::read_to_string(kept.join("report.html")).unwrap();
    let head = page.split("</header>").next().unwrap();
    for words in [
        "FAULTS were played on it",
        "Warning: FAULTS are played: a spike",
    ] {
        assert!(head.contains(words), "{words}");
    }
}

#[test]
fn rows_hold_what_opensees_would_command() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let out = folder.join("kept");
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let arguments = ["--protocol", "openfresco", "--out", out.to_str().unwrap()];
    let served = Served::start(folder, &local, &arguments);
    let text = linked(
        ONE_AXIS,
        &served.address,
        "protocol = \"openfresco\"\nprobe = \"none\"",
    );
    let (code, said) = run(folder, "run", &text);
    assert_eq!(code, 0, "{said}");
    served.hears("ended the test");
    let kept = Run::open(&out.join("test-0001")).unwrap();
    let summary = kept.summary().unwrap();
    assert_eq!(
        (summary.status, summary.steps),
        (Status::Completed, u64::from(STEPS) + 1)
    );
    // Repeats of one command are one exchange.
    let ours = column(&folder.join("run"), "cmd_1_1");
    let theirs = column(&out.join("test-0001"), "cmd_1_1");
    assert_eq!(ours, theirs);
}

#[test]
fn unavailable_folder_is_refused_early() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("taken"), "a file").unwrap();
    let file = crate::link_common::write(
        folder,
        "serve.toml",
        &format!("[[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}"),
    );
    let mut serve = gusset();
    serve
        .arg("serve")
        .arg(file)
        .arg("--out")
        .arg(folder.join("taken"));
    serve.args(["--listen", "127.0.0.1:0"]);
    let said = finish(serve);
    assert_eq!(said.status.code(), Some(2));
}

/// Commands one after another, as fast as the server takes them: the writer falls behind.
#[test]
fn events_have_the_index_of_their_exchange() {
    let folder = tempfile::tempdir().unwrap();
    let law: SpecimenLaw =
        toml::from_str("law = { linear = { stiffness_n_per_m = 8000.0 } }").unwrap();
    let commands: Vec<f64> = (0..3000)
        .map(|k| 0.03 * libm::sin(0.05 * f64::from(k)))
        .collect();
    for (number, (limits, last, state)) in (1..).zip([
        (
            "command_disp_m = { warn = [-0.01, 0.01], trip = [-0.04, 0.04] }",
            0.05,
            8.0,
        ),
        (
            "command_disp_m = { warn = [-0.01, 0.01] }\nmeasured_force_n = { trip = [-300, 300] }",
            0.039,
            3.0,
        ),
    ]) {
        let rig = Computed::new(law.build(1).unwrap(), false);
        let (stiffness, mass) = rig.reference();
        let limits: LimitsSpec = toml::from_str(limits).unwrap();
        let units = vec![AxisUnits::SI];
        let mut served = ServedSpecimen::new("rig".into(), Box::new(rig), units, stiffness, mass)
            .limited(&[limits])
            .recorded(Some(RecordSettings {
                root: folder.path().into(),
                file: Vec::new(),
                resolved: String::new(),
                about: None,
                inputs: Vec::new(),
                queue_s: 4.0,
                required: true,
                accepted: Default::default(),
                verdict: None,
                ended: None,
            }));
        let controller = Controller::nobody();
        served.begin(&controller, &mut || Ok(())).unwrap();
        let mut measured = Measurement::zeros(1);
        let mut trip = None;
        for (sequence, disp) in (0..).zip(commands.iter().chain([&last, &0.0])) {
            let command = Command {
                sequence,
                time: 0.01 * sequence as f64,
                dt: 0.01,
                disp: &[*disp],
                vel: &[0.0],
            };
            trip = served
                .exchange(&command, 0.01, &mut || true, &mut measured)
                .err();
            served.commit();
        }
        assert!(trip.is_some());
        served.end(Cause::Protocol, "the end");
        let kept = folder.path().join(format!("test-000{number}"));
        let run = Run::open(&kept).unwrap();
        let summary = run.summary().unwrap();
        // The last was refused in any case.
        let passed_on = commands.len() as u64 + u64::from(state == 3.0);
        assert_eq!(summary.rows_lost, 0);
        assert_eq!(summary.link["rig"].sent, passed_on);
        let (states, times) = (column(&kept, "state"), column(&kept, "time"));
        assert!(states[..commands.len()].iter().all(|state| *state == 3.0));
        assert_eq!(states[commands.len()..], [state, 8.0]);
        let beyond: Vec<bool> = commands
            .iter()
            .chain([&last])
            .map(|d| d.abs() > 0.01)
            .collect();
        let crosses = (1..beyond.len()).filter(|k| beyond[*k] && !beyond[k - 1]);
        let events = run.events().unwrap().to_json();
        let of = |name: &str| {
            let named = events.iter().filter(|event| event["event"] == name);
            named.cloned().collect::<Vec<_>>()
        };
        let controller = &of("controller")[0];
        assert!(controller["tick"].is_null() && controller["time"].is_null());
        let warned = of("limit");
        let ticks: Vec<_> = warned
            .iter()
            .map(|e| e["tick"].as_u64().unwrap() as usize)
            .collect();
        assert_eq!(ticks, crosses.collect::<Vec<_>>());
        let tripped = of("trip");
        assert_eq!(tripped[0]["tick"], commands.len());
        let received = column(&kept, "received_s");
        let [first, newest] = [&warned[0], &tripped[0]];
        for event in warned.iter().chain(&tripped) {
            let tick = event["tick"].as_u64().unwrap() as usize;
            // Read from decimals to the last bit but one.
            assert!((event["time"].as_f64().unwrap() - times[tick]).abs() < 1e-12);
        }
        // It was made between its own command and the next.
        let place = |event: &serde_json::Value| event["tick"].as_u64().unwrap() as usize;
        let made = |event: &serde_json::Value| event["clock_ns"].as_u64().unwrap() as f64 * 1e-9;
        let between = made(newest) - made(first);
        let (from, to) = (place(first), place(newest));
        assert!(
            between >= received[to] - received[from + 1] - 1e-8,
            "{between}"
        );
        assert!(
            between <= received[to + 1] - received[from] + 1e-8,
            "{between}"
        );
    }
}

/// config/serve, with the addresses of this test.
#[test]
fn example_config_runs_with_limits_and_log() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/serve");
    let read = |name: &str| std::fs::read_to_string(config.join(name)).unwrap();
    let rig = Served::start(folder, &read("rig.toml"), &[]);
    // On the simulated clock the specimen moves faster than its limit of speed allows.
    let speed = "command_vel_m_per_s = { warn = 0.8, trip = 1.0 }\n";
    let file = read("gateway.toml").replace("127.0.0.1:4825", &rig.address);
    assert!(file.contains(speed));
    let file = file.replace(speed, "");
    let out = folder.join("kept");
    let mut between = Served::start(folder, &file, &["--out", out.to_str().unwrap()]);
    let cyclic = |amplitude: &str| {
        format!(
            "[time]\nrate_hz = 500\nduration_s = 2\nclock = \"simulated\"\n[safety]\n{UNLIMITED}[[specimen]]\nname = \"column\"\n\
             stiffness_n_per_m = 8e6\n[[specimen.axis]]\nunit_disp = \"mm\"\nunit_force = \"kN\"\n[specimen.link]\n{COMPUTED}\n\
             address = \"{}\"\n[[excitation.prescribed_displacement]]\nspecimen = \"column\"\nease_in_s = 0.5\n\
             [excitation.prescribed_displacement.signal.sine]\nfrequency_hz = 1\namplitude = {amplitude}\n",
            between.address
        )
    };
    let (code, said) = run(folder, "inside", &cyclic("0.03"));
    assert_eq!(code, 0, "{said}");
    between.hears("direction: axis 1");
    rig.hears("retired at the end of the test");
    let (code, said) = run(folder, "outside", &cyclic("0.06"));
    assert_eq!(code, 1, "{said}");
    let reason = summary(folder, "outside").reason;
    assert!(reason.contains(as_read("command_disp_m")), "{reason}");
    let states = column(&out.join("test-0002"), "state");
    assert_eq!((states[0], *states.last().unwrap()), (2.0, 8.0));
    let largest = column(&out.join("test-0002"), "target_1_1");
    let passed_on = largest[..largest.len() - 1].iter();
    assert!(passed_on.fold(0.0, |m: f64, d| m.max(d.abs())) <= 0.05);
    // The server has written the report of every test before it ends.
    between.signal("TERM");
    for test in ["test-0001", "test-0002"] {
        let page = std::fs::read_to_string(out.join(test).join("report.html")).unwrap();
        assert!(!page.contains("Identified specimen"), "{test}");
    }
}

/// Two trials of every step before the one that its controller accepts.
#[test]
fn a_history_of_trials_has_one_row_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let law: SpecimenLaw =
        toml::from_str("law = { linear = { stiffness_n_per_m = 8000.0 } }").unwrap();
    let rig = Computed::new(law.build(1).unwrap(), false);
    let (stiffness, mass) = rig.reference();
    let units = vec![AxisUnits::SI];
    let (ended, folders) = crossbeam_channel::unbounded();
    let mut served = ServedSpecimen::new("rig".into(), Box::new(rig), units, stiffness, mass)
        .recorded(Some(RecordSettings {
            root: folder.path().into(),
            file: Vec::new(),
            resolved: String::new(),
            about: None,
            inputs: Vec::new(),
            queue_s: 4.0,
            required: true,
            accepted: Default::default(),
            verdict: None,
            ended: Some(ended),
        }));
    let controller = Controller::nobody();
    served.begin(&controller, &mut || Ok(())).unwrap();
    let mut measured = Measurement::zeros(1);
    let mut sequence = 0;
    for step in 0..200 {
        for trial in 0..3 {
            let disp = 0.01 * libm::sin(0.05 * f64::from(step)) + 1e-3 * f64::from(2 - trial);
            let command = Command {
                sequence,
                time: 0.01 * f64::from(step),
                dt: 0.01,
                disp: &[disp],
                vel: &[0.0],
            };
            sequence += 1;
            served
                .exchange(&command, 0.01, &mut || true, &mut measured)
                .unwrap();
        }
        served.commit();
    }
    served.end(Cause::Done, "the end");
    let kept = folder.path().join("test-0001");
    let (folder, _) = folders.try_recv().unwrap().unwrap();
    assert_eq!(folder.path(), kept);
    assert_eq!(column(&kept, "state").len(), 600);
    let table = folder.path().join("history.csv");
    let mut export = gusset();
    export
        .arg("export")
        .arg(&kept)
        .args(["--no-units-line", "--out"]);
    export.arg(&table);
    let said = finish(export);
    assert_eq!(said.status.code(), Some(0));
    let text = std::fs::read_to_string(&table).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = head.iter().position(|name| *name == "target_1_1").unwrap();
    let rows: Vec<f64> = lines
        .map(|line| line.split(',').nth(place).unwrap().parse().unwrap())
        .collect();
    assert_eq!(rows.len(), 200);
    for (step, target) in rows.iter().enumerate() {
        assert!(
            (target - 0.01 * libm::sin(0.05 * step as f64)).abs() < 1e-12,
            "{step}"
        );
    }
    let page = gusset_session::write_report(&kept).unwrap();
    let page = std::fs::read_to_string(page.path).unwrap();
    assert!(page.contains("400\u{a0}exchanges beside the last exchange of each step"));
    assert!(!page.contains("MISSING") && !page.contains("Identified specimen"));
}
