//! The position of a specimen before its first command, over protocols that cannot report it or do not limit that command. The test
//! file states it, and the specimen is held there and ramped from there. A served machine never jumps.

use crate::test_file::TestFile;
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};

use crate::link_common::{
    Fake, ONE_AXIS_LAW, Served, adapter, element, finish, gateway, gusset, linked, run, summary,
};
use gusset_link::openfresco::{Remote, RemoteSettings};
use gusset_quantity::substructure::{Command, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_record::Run;
use gusset_wire::handshake::{Capabilities, Welcome};
use gusset_wire::openfresco::{Carrier, Peer};

const STEPS: u32 = 100;
const K: f64 = 4e5;
const STANDS: f64 = 0.01;
const ADAPTER: &str = "protocol = \"openfresco-adapter\"\nprobe = \"none\"\n";

/// An adapter that records every displacement that it receives. At place `breaks_at` of the list its connection breaks, and it
/// accepts another one.
fn witnessed(breaks_at: usize) -> (String, Arc<Mutex<Vec<f64>>>) {
    let told = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&told);
    let address = adapter::start_for(5, move |disp| {
        let mut told = into.lock().unwrap();
        told.push(disp);
        (told.len() != breaks_at).then_some((disp, K * disp))
    });
    (address, told)
}

fn largest_step(told: &[f64]) -> f64 {
    let steps = told.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    steps.fold(0.0, f64::max)
}

#[test]
fn unknown_position_comes_from_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (address, told) = witnessed(0);
    let keys = format!("{ADAPTER}stands_at_m = [{STANDS}]");
    let (code, said) = run(folder.path(), "run", &linked(STEPS, &address, &keys));
    assert_eq!(code, 0, "{said}");
    assert!(!said.contains("POSITION IS"), "{said}");
    let told = told.lock().unwrap();
    // Half a cosine over a second of ticks of 1 ms, and a test that moves by less in one.
    assert!((told[0] - STANDS).abs() < 1e-6, "{}", told[0]);
    assert!(told.len() > 1000 && largest_step(&told) < 2e-4);
}

#[test]
fn without_it_only_computed_ones_move() {
    let folder = tempfile::tempdir().unwrap();
    let (address, told) = witnessed(0);
    let text = linked(STEPS, &address, ADAPTER);
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("POSITION IS"), "{said}");
    assert_eq!(told.lock().unwrap()[0], 0.0);
    let text = text.without("specimen.0.link.computed");
    let (code, said) = run(folder.path(), "refused", &text);
    assert_eq!(code, 2, "{said}");
    for words in ["is unknown", "`stands_at_m = [0.0]`"] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn resumed_test_uses_the_last_position() {
    const BREAKS_AT: usize = 1060;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (address, told) = witnessed(BREAKS_AT);
    let keys = format!("{ADAPTER}stands_at_m = [{STANDS}]");
    let (code, said) = run(folder, "run", &linked(STEPS, &address, &keys));
    assert_eq!(code, 3, "{said}");
    let broken = summary(folder, "run");
    assert!(broken.steps > 10);
    let left = "; no watchdog holds specimen \"column\": it is where its own controller leaves it";
    assert!(broken.reason.ends_with(left), "{}", broken.reason);
    let mut command = gusset();
    command.arg("run").arg("--resume").arg(folder.join("run"));
    command.arg("--out").arg(folder.join("again"));
    let output = finish(command);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    // The position in the file is outdated from the first command on.
    assert!(said.contains("was left"));
    assert!(!said.contains("stands_at_m") && !said.contains("from there"));
    let told = told.lock().unwrap();
    assert!(told.len() > BREAKS_AT + 10 && largest_step(&told) < 2e-4);
}

/// OpenFresco's element servers always answer displacement 0. Only their force is used: a wiring check finds no dead sensor, no
/// following error trips, and the start is at the position in the file, not at 0.
#[test]
fn zero_displacement_server_gives_forces() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (address, told) = element::start(K);
    let link = format!(
        "protocol = \"openfresco\"\nprobe_m = 1e-4\nprobe_ramp_s = 0.05\nstands_at_m = [{STANDS}]"
    );
    let text = linked(STEPS, &address, &link);
    let (code, said) = run(folder, "run", &text);
    assert_eq!(code, 0, "{said}");
    let kept = Run::open(&folder.join("run")).unwrap();
    let warnings = &kept.summary().unwrap().warnings;
    assert!(warnings.iter().any(|text| text.contains("forces only")));
    // Nothing compares the command with the target as if it had been measured.
    let told_of = kept.summary().unwrap();
    let metrics = &told_of.metrics.as_ref().unwrap().0;
    assert_eq!(metrics.as_slice(), [("column".to_owned(), vec![None])]);
    let [missing] = told_of.metrics_missing.as_slice() else {
        panic!("{:?}", told_of.metrics_missing);
    };
    assert!(missing.starts_with("column") && missing.contains("not measured"));
    let columns = kept.columns(&["cmd_1_1", "meas_1_1", "force_1_1"]).unwrap();
    assert_eq!(columns[0], columns[1]);
    let forces = columns[0].iter().zip(&columns[2]);
    assert!(forces.clone().all(|(disp, force)| *force == K * disp));
    assert!(columns[0].iter().any(|disp| disp.abs() > 1e-3));
    let told = told.lock().unwrap();
    assert!((told[0] - STANDS).abs() < 1e-6 && largest_step(&told) < 2e-4);
    // A user who vouches for the displacements gets the zeros.
    let measures =
        "openfresco = { answer_signals = [1, 1, 1, 1, 1] }\nprobe_m = 1e-4\nprobe_ramp_s = 0.05";
    let (address, _) = element::start(K);
    let text = linked(
        STEPS,
        &address,
        &format!("protocol = \"openfresco\"\n{measures}"),
    );
    let (code, _) = run(folder, "vouched", &text);
    assert_eq!(code, 3);
    let reason = summary(folder, "vouched").reason;
    assert!(reason.contains("frozen sensor"), "{reason}");
}

/// The first command of a client is a step from the gateway's last command, or from the position in the file, and is checked as
/// such.
#[test]
fn gateway_knows_its_last_command() {
    let folder = tempfile::tempdir().unwrap();
    let (address, told) = witnessed(0);
    let text = |stands: &str| {
        format!(
            "[[specimen]]\nname = \"rig\"\nstiffness_n_per_m = {K}\n[specimen.limits]\ncommand_step_m = {{ trip = 0.004 }}\n\
             command_disp_m = {{ trip = [-0.1, 0.1] }}\nmeasured_force_n = {{ trip = [-1e5, 1e5] }}\n[specimen.link]\naddress = \"{address}\"\n{ADAPTER}{stands}"
        )
    };
    std::fs::write(folder.path().join("unsaid.toml"), text("")).unwrap();
    let mut command = gusset();
    command.arg("serve").arg(folder.path().join("unsaid.toml"));
    let output = finish(command);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("is unknown"), "{said}");

    let stands = format!("stands_at_m = [{STANDS}]");
    let served = Served::start(folder.path(), &text(&stands), &["--protocol", "openfresco"]);
    assert!(!goes_to(&served, 0.0));
    assert_eq!(served.reset().0, 0);
    assert!(goes_to(&served, STANDS + 0.003));
    assert!(!goes_to(&served, STANDS - 0.003));
    assert_eq!(served.reset().0, 0);
    assert!(goes_to(&served, STANDS + 0.005));
    let told = told.lock().unwrap();
    assert!(largest_step(&told) <= 0.003 + 1e-12, "{told:?}");
    assert_eq!(told.last(), Some(&(STANDS + 0.005)));
}

/// A specimen behind the native protocol may report its position, but need not: then the file states it. A gateway commands no
/// specimen before its client does.
#[test]
fn file_gives_an_unreported_native_position() {
    let silent = || {
        let (tell, told) = channel();
        let real = |welcome: &mut Welcome| welcome.capabilities = Capabilities::default();
        let address = Fake::start_welcoming(real, move |mut fake| {
            fake.obey(
                |disp| (disp, K * disp),
                move |told| {
                    let _ = tell.send(told);
                },
            );
        });
        (address, told)
    };
    let folder = tempfile::tempdir().unwrap();
    let (address, told) = silent();
    let keys = format!("probe = \"none\"\nstands_at_m = [{STANDS}]");
    let (code, said) = run(folder.path(), "run", &linked(STEPS, &address, &keys));
    assert_eq!(code, 0, "{said}");
    assert!(!said.contains("POSITION IS"), "{said}");
    let told: Vec<f64> = told.try_iter().flatten().collect();
    assert!((told[0] - STANDS).abs() < 1e-6 && largest_step(&told) < 2e-4);

    let (address, told) = silent();
    let table = format!("stiffness_n_per_m = {K}\n");
    let file = gateway(&address, &table, "").without("specimen.0.link.computed");
    let served = Served::start(folder.path(), &file, &["--protocol", "openfresco"]);
    let settings = RemoteSettings::new(Peer::Element, Carrier::Stream, served.address.clone(), 1);
    assert!(Remote::new(settings).unwrap().open().is_err());
    served.hears("its position is unknown");
    assert_eq!(told.try_iter().count(), 0);
}

/// A specimen of ±50 mm that moves, and whose steps nothing bounds.
fn served(folder: &std::path::Path, limits: &str) -> Served {
    let text = format!(
        "[serve.openfresco]\nphysical = true\n[[specimen]]\nname = \"rig\"\n[specimen.limits]\n\
         command_disp_m = {{ trip = [-0.05, 0.05] }}\n{limits}{ONE_AXIS_LAW}"
    );
    Served::start(folder, &text, &["--protocol", "openfresco"])
}

/// True if a client's first command is answered.
fn goes_to(served: &Served, disp: f64) -> bool {
    let settings = RemoteSettings::new(Peer::Element, Carrier::Stream, served.address.clone(), 1);
    let mut client = Remote::new(settings).unwrap();
    client.open().unwrap();
    let command = Command {
        sequence: 0,
        time: 0.0,
        dt: 0.01,
        disp: &[disp],
        vel: &[0.0],
    };
    let mut into = Measurement::zeros(1);
    let went = client.issue(&command).is_ok()
        && client.collect(Nanos(0), &mut into).is_ok()
        && client.accepted(0).is_ok();
    client.retire(Retirement::Orderly);
    went
}

#[test]
fn first_command_is_a_share_of_the_range() {
    let folder = tempfile::tempdir().unwrap();
    let open = served(folder.path(), "");
    open.hears("note: axis 1: neither `command_step_m` nor");
    assert!(goes_to(&open, 0.0049));
    open.hears("the client ended the test");
    // It stays there, and the next client assumes it at zero: near enough. Then it is too far.
    assert!(goes_to(&open, 0.0));
    assert!(!goes_to(&open, 0.0051));
    open.hears("a first command may go a twentieth of its range");
    drop(open);
    let bounded = served(folder.path(), "command_step_m = { trip = 0.03 }\n");
    assert!(goes_to(&bounded, 0.02));
}
