//! The boundary of the loop's thread catches a panic: every specimen is retired exactly once, and the folder shows how far the test
//! came.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::test_file::TestFile;
use crate::common::{FRAME, PATIENT, json, say, write};
use crate::link_common::Served;
use gusset_config as config;
use gusset_control::port::{Axis, AxisSpec, PortSpec};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::Nanos;
use gusset_record::summary::Status;
use gusset_record::{Run, RunFolder};
use gusset_session::{self as session, Finished, Watches};
use gusset_setup::{self as setup, Prepared};

/// A spring whose code has a bug that shows at a given time, and perhaps another one when it retires.
#[derive(Debug)]
struct Buggy {
    disp: f64,
    fails_at: f64,
    fails_at_the_end: bool,
    goodbyes: Arc<AtomicUsize>,
}

impl Substructure for Buggy {
    fn axes(&self) -> usize {
        1
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        assert!(command.time < self.fails_at, "the bug of step 50");
        self.disp = command.disp[0];
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.disp[0] = self.disp;
        into.force[0] = 2.5e5 * self.disp;
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, how: Retirement) {
        assert_eq!(how, Retirement::Tripped);
        self.goodbyes.fetch_add(1, Ordering::SeqCst);
        assert!(!self.fails_at_the_end, "the bug at the goodbye");
    }
}

/// Runs the frame with two buggy springs side by side in its bottom storey into `out`; returns its end, and the retirement of each
/// spring.
fn run(out: &Path, fails_at: f64, fails_at_the_end: bool) -> (Finished, [usize; 2]) {
    let loaded = config::parse(Path::new("test.toml"), FRAME.to_owned(), &[]).unwrap();
    let mut test: Prepared = setup::build(&loaded).unwrap();
    let goodbyes = [(); 2].map(|()| Arc::new(AtomicUsize::new(0)));
    let port = |index: usize, fails_at: f64, fails_at_the_end: bool| {
        let specimen = Buggy {
            disp: 0.0,
            fails_at,
            fails_at_the_end,
            goodbyes: Arc::clone(&goodbyes[index]),
        };
        PortSpec::new(
            ["first", "second"][index],
            Box::new(specimen),
            2,
            vec![AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 2.5e5)],
        )
        .build()
        .unwrap()
    };
    test.experiment.ports = vec![
        port(0, fails_at, fails_at_the_end),
        port(1, f64::MAX, false),
    ];
    let folder = RunFolder::create(out).unwrap();
    let requests = crossbeam_channel::never();
    let finished = session::run(test, folder, requests, Watches::default(), &mut |_| {}).unwrap();
    (finished, goodbyes.map(|count| count.load(Ordering::SeqCst)))
}

#[test]
fn panic_retires_specimens_and_keeps_folder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    // Step 50 of 200 Hz.
    let (finished, goodbyes) = run(&out, 0.2499, false);
    assert_eq!(goodbyes, [1, 1]);
    assert_eq!(
        (finished.cause, finished.summary.status),
        (Cause::Internal, Status::Failed)
    );
    let summary = json(&out, "summary.json");
    assert_eq!(
        (&summary["status"], &summary["steps"]),
        (&"failed".into(), &49.into())
    );
    let reason = summary["reason"].as_str().unwrap();
    assert!(reason.ends_with("the bug of step 50"), "{reason}");
    assert!(summary["peak"]["displacement"][0].as_f64().unwrap() > 0.0);
    let steps = Run::open(&out)
        .unwrap()
        .columns(&["step"])
        .unwrap()
        .remove(0);
    assert_eq!(
        steps,
        (0..50).map(f64::from).collect::<Vec<_>>(),
        "every row made is in the file"
    );
    assert!(
        json(&out, "timing.json")["compute"]["count"]
            .as_u64()
            .unwrap()
            >= 50
    );
    let events = fs::read_to_string(out.join("events.jsonl")).unwrap();
    assert!(
        events.contains("\"internal_error\"") && events.contains("\"ended\""),
        "{events}"
    );
    session::write_report(&out).unwrap();
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("step 50")
    );
}

#[test]
fn panic_in_retire_spares_the_next_specimen() {
    let folder = tempfile::tempdir().unwrap();
    let (finished, goodbyes) = run(&folder.path().join("out"), 0.2499, true);
    assert_eq!(goodbyes, [1, 1]);
    assert_eq!(finished.cause, Cause::Internal);
    let reason = finished.summary.reason;
    assert!(
        reason.contains("step 50") && reason.contains("the goodbye"),
        "{reason}"
    );
}

/// Through the program itself, on both clocks: a computed specimen panics on purpose at 0.25 s, and another one is behind a link.
/// The latter is informed of the trip, and the folder is whole.
#[test]
fn injected_panic_exits_with_5_and_retires() {
    for clock in ["simulated", "real"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let far = "[[specimen]]\nname = \"far\"\nlaw.linear.stiffness_n_per_m = 2e5\n\
                   limits = { command_disp_m = { trip = [-0.1, 0.1] }, measured_force_n = { trip = [-1e5, 1e5] } }\n";
        let served = Served::start(folder, far, &["--transport", "udp"]);
        let linked = format!(
            "{far}storey = 2\nstiffness_n_per_m = 2e5\n\
             link = {{ address = \"{}\", transport = \"udp\", coupling = \"lockstep\" }}\n",
            served.address
        );
        let text = FRAME
            .with("specimen.drill.panic_at_s = 0.2499")
            .with(&linked.without("specimen.0.law"));
        let test = write(folder, "test.toml", &text);
        let out = folder.join("out");
        let mut arguments = vec![
            "run".as_ref(),
            test.as_os_str(),
            "--out".as_ref(),
            out.as_os_str(),
        ];
        arguments.extend(["--clock", clock].map(std::ffi::OsStr::new));
        arguments.extend(PATIENT.map(std::ffi::OsStr::new));
        let said = say(arguments);
        assert_eq!(said.code, Some(5), "{}", said.stderr);
        assert!(said.stderr.contains("0.2499 s"), "{}", said.stderr);
        assert!(said.stderr.contains("internal error"), "{}", said.stderr);
        served.hears("retired because the test tripped");

        let summary = json(&out, "summary.json");
        assert_eq!(summary["status"], "failed");
        let reason = summary["reason"].as_str().unwrap();
        assert_eq!(summary["cause"], "internal_error");
        assert!(reason.contains("0.25 s"), "{reason}");
        // Step 50 of 200 Hz was never closed, and every row before it is there.
        assert_eq!(
            (&summary["steps"], &summary["rows_lost"]),
            (&49.into(), &0.into())
        );
        let run = Run::open(&out).unwrap();
        let columns = run.columns(&["step", "state", "cmd_2_1"]).unwrap();
        let test = columns[0]
            .iter()
            .zip(&columns[1])
            .filter(|(_, state)| **state == 3.0);
        let steps: Vec<f64> = test.map(|(step, _)| *step).collect();
        assert_eq!(steps, (0..50).map(f64::from).collect::<Vec<_>>());
        assert!(
            columns[2].iter().any(|disp| disp.abs() > 1e-6),
            "it had moved"
        );
        let report = fs::read_to_string(out.join("report.html")).unwrap();
        assert!(report.contains("on purpose"));
        let events = fs::read_to_string(out.join("events.jsonl")).unwrap();
        assert!(events.contains("\"internal_error\""), "{events}");
        // The recorded part is replayed, without the injected fault.
        let said = say(["replay".as_ref(), out.as_os_str()]);
        assert_eq!(said.code, Some(0), "{}{}", said.stdout, said.stderr);
    }
}

#[test]
fn injected_panic_after_the_end_is_refused() {
    let line = "drill = { panic_at_s = 3 }";
    let text = FRAME.replace("storey = 1\n", &format!("storey = 1\n{line}\n"));
    let words = ["`drill`", "3 s", "0.5 s"];
    crate::common::refusal::refused(&text, &[], line, "3", &words);
    let text = FRAME.replace("storey = 1\n", "storey = 1\ndrill = { panic_at_s = -1 }\n");
    crate::common::refusal::refused(
        &text,
        &[],
        "drill = { panic_at_s = -1 }",
        "-1",
        &["panic_at_s"],
    );
}

/// A test with an injected panic resumes from its last row with the same bits as without the panic. It resumes at full pace: a hold
/// ramp would change the rounding of a yielding spring.
#[test]
fn test_resumes_after_an_injected_panic() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let plain = format!("{FRAME}\n[safety]\nease_s = 0\n");
    let drilled = plain.with("specimen.drill.panic_at_s = 0.2499");
    let test = write(folder, "test.toml", &drilled);
    let broken = folder.join("broken");
    assert_eq!(crate::common::run(&test, &broken, &[]).code, Some(5));
    let next = folder.join("next");
    let said = say([
        "run".as_ref(),
        "--resume".as_ref(),
        broken.as_os_str(),
        "--out".as_ref(),
        next.as_os_str(),
    ]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let whole = folder.join("whole");
    crate::common::completed(&write(folder, "whole.toml", &plain), &whole, &[]);
    let last = |folder: &Path| {
        let names = ["step", "x1", "x2", "v1", "v2", "force_1_1", "cmd_1_1"];
        let columns = Run::open(folder).unwrap().columns(&names).unwrap();
        let last = columns
            .iter()
            .map(|column| column.last().unwrap().to_bits());
        last.collect::<Vec<_>>()
    };
    assert_eq!(last(&next), last(&whole));
}
