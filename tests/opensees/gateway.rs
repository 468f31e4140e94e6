//! OpenSees → gateway → specimen, the main role of a gateway in laboratories: the real OpenSees commands the real gateway through
//! `genericClient`, and its results equal those with its own material.

use std::path::Path;

use crate::link_common::{Served, gateway};
use crate::programs::{Peer, python};
use gusset_record::Run;
use gusset_record::summary::Status;

/// As in tests/opensees/client.rs: rounding and the tolerance of the iteration.
const SAME: f64 = 1e-10;

fn law(law: &str) -> String {
    format!("[[specimen]]\nname = \"column\"\nlaw = {law}\n")
}

const BILINEAR: &str =
    "{ bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
const LINEAR: &str = "{ linear = { stiffness_n_per_m = 8000.0 } }";

struct Speech {
    serve: &'static [&'static str],
    link: &'static str,
}

/// A formula cannot forget a trial across the native protocol, which has none; across OpenFresco's it can.
const OURS: Speech = Speech {
    serve: &["--transport", "tcp"],
    link: "transport = \"tcp\"",
};
const THEIRS: Speech = Speech {
    serve: &["--protocol", "openfresco"],
    link: "protocol = \"openfresco\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }",
};

/// The file of a gateway whose client iterates.
fn iterating(text: &str) -> String {
    format!("[serve.openfresco]\niterates_within_m = 0.1\n{text}")
}

fn agree(down: &Speech, specimen: &str, material: &str, scheme: &str, udp: bool) {
    let Some(python) = python() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let out = folder.join("kept");
    let far = Served::start(folder, &law(specimen), down.serve);
    let limits =
        "stiffness_n_per_m = 8000\n[specimen.limits]\nmeasured_force_n = { trip = [-1e4, 1e4] }\n";
    let transport = if udp { "udp" } else { "tcp" };
    let between = Served::start(
        folder,
        &iterating(&gateway(&far.address, limits, down.link)),
        &[
            "--protocol",
            "openfresco",
            "--transport",
            transport,
            "--out",
            out.to_str().unwrap(),
        ],
    );
    let port = between.address.rsplit(':').next().unwrap();
    for number in 1..=2 {
        let mut args = vec![
            "--port",
            port,
            "--material",
            material,
            "--scheme",
            scheme,
            "--steps",
            "200",
        ];
        if udp {
            args.push("--udp");
        }
        let result = Peer::script(&python, "client.py", &args).event("result");
        let [difference, peak] = ["difference", "peak"].map(|key| result[key].as_f64().unwrap());
        assert!(peak > 0.01, "nothing moved: {peak}");
        assert!(difference < SAME, "{scheme} {transport}: {difference}");
        between.hears("ended the test");
        let kept = Run::open(&out.join(format!("test-000{number}"))).unwrap();
        let summary = kept.summary().unwrap();
        assert_eq!(
            (summary.status, summary.steps >= 200),
            (Status::Completed, true)
        );
        let [commits, exchanges] =
            ["commits", "step"].map(|name| *kept.columns(&[name]).unwrap()[0].last().unwrap());
        assert!(exchanges >= commits, "{exchanges} {commits}");
    }
}

#[test]
fn yielding_specimen_behind_openfresco() {
    for scheme in ["newton", "explicit"] {
        agree(&THEIRS, BILINEAR, "Steel01:60,8000,0.05", scheme, false);
    }
    // AlphaOS needs the tangent, for which a gateway has only the estimate in its file.
    agree(&THEIRS, LINEAR, "Elastic:8000", "alphaos", false);
    agree(&THEIRS, BILINEAR, "Steel01:60,8000,0.05", "newton", true);
}

/// AlphaOS takes the tangent of each step: with the estimate of the file it differs after yielding.
#[test]
fn updated_tangent_serves_alphaos() {
    let Some(python) = python() else {
        return;
    };
    let difference = |key: &str| {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let far = Served::start(folder, &law(BILINEAR), OURS.serve);
        let limits = "stiffness_n_per_m = 8000\n[specimen.limits]\nmeasured_force_n = { trip = [-1e4, 1e4] }\n";
        let text = gateway(&far.address, limits, OURS.link);
        let text = format!("[serve.openfresco]\niterates_within_m = 0.1\n{key}\n{text}");
        let between = Served::start(folder, &text, &["--protocol", "openfresco"]);
        let port = between.address.rsplit(':').next().unwrap();
        let material = "Steel01:60,8000,0.05";
        let scheme = [
            "--port",
            port,
            "--material",
            material,
            "--scheme",
            "alphaos",
            "--steps",
            "200",
        ];
        let result = Peer::script(&python, "client.py", &scheme).event("result");
        let [difference, peak] = ["difference", "peak"].map(|key| result[key].as_f64().unwrap());
        difference / peak
    };
    let (estimate, updated) = (difference(""), difference("updates_tangent = true"));
    assert!(estimate > 2e-3 && updated < 5e-4, "{estimate} {updated}");
}

#[test]
fn our_own_protocol_towards_the_specimen() {
    // A specimen that yields in a trial stays yielded: an explicit scheme tries once.
    agree(&OURS, BILINEAR, "Steel01:60,8000,0.05", "explicit", false);
    agree(&OURS, LINEAR, "Elastic:8000", "newton", false);
    agree(&OURS, LINEAR, "Elastic:8000", "newton", true);
}

/// A client with the material `Elastic:8000` commands a gateway with these limits and keys until the specimen holds. Returns the line
/// of the log on it, and the folder of its test.
fn until_it_holds(
    trip: &str,
    keys: impl Fn(&str) -> String,
    folder: &Path,
) -> Option<([Served; 2], String, Run)> {
    let python = python()?;
    let out = folder.join("kept");
    let far = Served::start(folder, &law(LINEAR), OURS.serve);
    let limits = format!(
        "stiffness_n_per_m = 8000\n[specimen.limits]\nmeasured_force_n = {{ trip = [-{trip}, {trip}] }}\n"
    );
    let between = Served::start(
        folder,
        &keys(&gateway(&far.address, &limits, OURS.link)),
        &["--protocol", "openfresco", "--out", out.to_str().unwrap()],
    );
    let port = between.address.rsplit(':').next().unwrap();
    let args = [
        "--port",
        port,
        "--material",
        "Elastic:8000",
        "--steps",
        "200",
    ];
    let mut client = Peer::script(&python, "client.py", &args);
    let line = between.hears("the specimen holds");
    client.kill();
    let kept = Run::open(&out.join("test-0001")).unwrap();
    assert_eq!(kept.summary().unwrap().status, Status::Stopped);
    Some(([far, between], line, kept))
}

/// Newton's second trial trips a gateway without `iterates_within_m`.
#[test]
fn iterating_client_is_refused_with_advice() {
    let folder = tempfile::tempdir().unwrap();
    if let Some((_both, line, kept)) = until_it_holds("1e4", str::to_owned, folder.path()) {
        assert!(line.contains("iterates_within_m"), "{line}");
        assert_eq!(*kept.columns(&["trip"]).unwrap()[0].last().unwrap(), 54.0);
    }
}

/// Newton's trials exceed the limit. The gateway closes the connection, logs the reason and serves the next client; OpenSees 3.7
/// spins.
#[test]
fn exceeded_limit_closes_the_connection() {
    let folder = tempfile::tempdir().unwrap();
    if let Some(([far, _between], line, _)) = until_it_holds("40", iterating, folder.path()) {
        assert!(line.contains("measured_force_n"), "{line}");
        far.hears("because the test tripped");
    }
}
