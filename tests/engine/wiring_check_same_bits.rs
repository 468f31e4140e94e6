//! The wiring check changes no number of the test that follows, even if its motion went far beyond yielding. A formula restarts
//! (native protocol) or forgets uncommitted motion (OpenFresco).

use crate::common::test_file::TestFile;
use std::path::Path;

use crate::link_common::{ONE_AXIS, ONE_AXIS_LAW, Served, gateway, run, test_file};
use gusset_record::Run;

const STEPS: u32 = 400;
/// The Bouc-Wen law yields at 5 mm.
const PROBE: &str = "probe_m = 0.03\nprobe_ramp_s = 0.05\n";
/// Value of the column `state` while a test runs.
const RUNNING: f64 = 3.0;

/// The columns of the test itself, as bits.
fn tested(folder: &Path, name: &str) -> Vec<(String, Vec<u64>)> {
    let run = Run::open(&folder.join(name)).unwrap();
    let state = run.columns(&["state"]).unwrap().remove(0);
    let columns = run.layout().columns().iter();
    let names = columns.filter(|c| !c.timing);
    let names: Vec<&str> = names.map(|c| c.name.as_str()).collect();
    let values = run.columns(&names).unwrap();
    let of_test = |column: Vec<f64>| {
        let rows = column.into_iter().zip(&state);
        rows.filter(|(_, state)| **state == RUNNING)
            .map(|(value, _)| value.to_bits())
            .collect()
    };
    let named = names.iter().map(|name| (*name).to_owned());
    named.zip(values.into_iter().map(of_test)).collect()
}

fn linked(address: &str, keys: &str) -> String {
    let link = format!("[specimen.link]\naddress = \"{address}\"\n{keys}\n");
    yielding(&test_file(STEPS, &format!("{ONE_AXIS}{link}")))
}

/// Beyond yielding its stiffness is a third of the estimate.
fn yielding(file: &str) -> String {
    let reason = "[safety]\naccept_wiring = \"the motion goes beyond yielding\"\n";
    file.replacen("[safety]\n", reason, 1)
}

#[test]
fn formula_forgets_the_wiring_check() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    for (name, serve, keys) in [
        ("tcp", &["--transport", "tcp"][..], ""),
        ("udp", &["--transport", "udp"], "transport = \"udp\""),
        (
            "element",
            &["--protocol", "openfresco"],
            "protocol = \"openfresco\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }",
        ),
        (
            "site",
            &["--protocol", "openfresco-actor"],
            "protocol = \"openfresco-shadow\"\n[specimen.link.openfresco]\ncommand_signals = [1, 1, 0, 0, 1]",
        ),
    ] {
        let served = Served::start(folder, &local, serve);
        let (code, said) = run(
            folder,
            name,
            &linked(&served.address, &format!("{PROBE}{keys}")),
        );
        assert_eq!(code, 0, "{said}");
        let run = Run::open(&folder.join(name)).unwrap();
        let tried = run.columns(&["state", "cmd_1_1"]).unwrap();
        let largest = tried[0]
            .iter()
            .zip(&tried[1])
            .filter(|(state, _)| **state == 2.0)
            .fold(0.0, |m: f64, (_, cmd)| m.max(*cmd));
        assert_eq!(largest, 0.03, "{name}: it was tried");
        assert_eq!(tested(folder, "local"), tested(folder, name), "{name}");
    }
}

/// The gateway tries its specimen before it answers the arming, and passes on the trial of its controller.
#[test]
fn gateway_checks_its_specimen_itself() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let specimen = Served::start(folder, &local, &[]);
    let file = gateway(&specimen.address, "stiffness_n_per_m = 4e5\n", PROBE)
        .without("specimen.0.link.probe");
    let between = Served::start(folder, &yielding(&file), &[]);
    for (name, keys) in [("plain", ""), ("tried", PROBE)] {
        let (code, said) = run(folder, name, &linked(&between.address, keys));
        assert_eq!(code, 0, "{said}");
        between.hears("direction: axis 1");
        assert_eq!(tested(folder, "local"), tested(folder, name), "{name}");
    }
}

#[test]
fn gateway_does_not_arm_a_reversed_specimen() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let address = crate::link_common::Fake::start(|mut fake| {
        fake.obey(
            |d| (d, -4e5 * d),
            |disp| assert!(disp.is_none_or(|d| d.abs() <= 0.03)),
        );
    });
    let file =
        gateway(&address, "stiffness_n_per_m = 4e5\n", PROBE).without("specimen.0.link.probe");
    let between = Served::start(folder, &file, &[]);
    let (code, said) = run(folder, "run", &linked(&between.address, ""));
    assert_eq!(code, 3, "{said}");
    let reason = crate::link_common::summary(folder, "run").reason;
    assert!(reason.contains("force channel"), "{reason}");
    between.hears("its force channel is reversed");
}
