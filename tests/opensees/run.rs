//! Whole hybrid tests over OpenFresco's protocols: `gusset run` with the real OpenSees, or our own server, as its specimen takes
//! the course of the same test with the law in process.

use std::path::Path;

use crate::programs::{Peer, Server, free_port, python};
use serde_json::Value;

const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";

/// Three floors of 10 kg on 8000 N/m at 100 Hz, driven so that the ground storey yields; `specimen` replaces that storey.
fn test_file(folder: &Path, name: &str, clock: &str, specimen: &str) -> String {
    let text = format!(
        r#"
title = "{name}"
[time]
rate_hz = 100
duration_s = 4
clock = "{clock}"
[structure.shear_building]
mass_kg = [10, 10, 10]
stiffness_n_per_m = [0, 8000, 8000]
[excitation.ground_acceleration.signal.sine]
amplitude = 3
frequency_hz = 1.5
[timing]
warmup_ticks = 5
[[specimen]]
name = "storey"
storey = 1
stiffness_n_per_m = 8000
{specimen}
"#
    );
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Floors and force of the specimen, row by row.
fn history(folder: &Path, name: &str) -> Vec<Vec<f64>> {
    let (run, csv) = (folder.join(name), folder.join(format!("{name}.csv")));
    let export = Peer::gusset(&[
        "export",
        run.to_str().unwrap(),
        "--no-units-line",
        "--out",
        csv.to_str().unwrap(),
    ]);
    let (status, said) = export.end();
    assert!(status.success(), "{said:#?}");
    let text = std::fs::read_to_string(csv).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns: Vec<usize> = ["x1", "x2", "x3", "force_1_1"]
        .iter()
        .map(|name| head.iter().position(|column| column == name).unwrap())
        .collect();
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            columns.iter().map(|c| cells[*c].parse().unwrap()).collect()
        })
        .collect()
}

fn run(folder: &Path, name: &str, clock: &str, specimen: &str) -> (Option<i32>, Vec<String>) {
    let file = test_file(folder, name, clock, specimen);
    let out = folder.join(name);
    let (status, said) = Peer::gusset(&["run", &file, "--out", out.to_str().unwrap()]).end();
    (status.code(), said)
}

fn link(protocol: &str, transport: &str, port: u16) -> String {
    format!(
        "[specimen.link]\ncomputed = true\nprotocol = \"{protocol}\"\ntransport = \"{transport}\"\naddress = \"127.0.0.1:{port}\"\n\
         connect_timeout_s = 30\n[specimen.limits]\ncommand_disp_m = {{ trip = [-1, 1] }}\n\
         measured_force_n = {{ trip = [-1e5, 1e5] }}\n"
    )
}

fn opensees_specimen(kind: &str, transport: &str) -> Option<(Peer, u16)> {
    let python = python()?;
    let port = free_port();
    let word = port.to_string();
    let mut args = vec!["--port", &word, "--kind", kind];
    if transport == "udp" {
        args.push("--udp");
    }
    let mut peer = Peer::script(&python, "specimen.py", &args);
    peer.event("listening");
    Some((peer, port))
}

/// Largest difference, column by column.
fn differences(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<f64> {
    assert_eq!(a.len(), b.len());
    let mut largest = vec![0.0_f64; a[0].len()];
    for (row_a, row_b) in a.iter().zip(b) {
        for (value, (x, y)) in largest.iter_mut().zip(row_a.iter().zip(row_b)) {
            *value = value.max((x - y).abs());
        }
    }
    largest
}

/// With kb = 1e8 k the element reaches the command to 1e-8 of it, and its force is a difference times kb: about 1e-16 ·
/// kb · 0.05 m = 4e-6 N. Such a noise on a storey of 8000 N/m displaces it by 5e-10 m; the motion neither damps nor
/// amplifies it much in 400 steps. Allowed is a hundred times as much.
#[test]
fn opensees_specimen_equals_the_law() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, transport) in [("adapter", "tcp"), ("adapter", "udp"), ("actuator", "tcp")] {
        let Some((opensees, port)) = opensees_specimen(kind, transport) else {
            return;
        };
        let name = format!("{kind}-{transport}");
        let (code, said) = run(
            folder.path(),
            &name,
            "simulated",
            &link("openfresco-adapter", transport, port),
        );
        assert_eq!(code, Some(0), "{said:#?}");
        let (status, _) = opensees.end();
        assert_eq!(
            status.code(),
            Some(255),
            "OpenSees ends with this code on request"
        );
        let law = format!("{name}-law");
        assert_eq!(run(folder.path(), &law, "simulated", BILINEAR).0, Some(0));
        let (theirs, ours) = (history(folder.path(), &name), history(folder.path(), &law));
        let peak = ours.iter().fold(0.0_f64, |m, row| m.max(row[3].abs()));
        assert!(peak > 70.0, "it never yielded: {peak}");
        let differences = differences(&theirs, &ours);
        assert!(
            differences[..3].iter().all(|d| *d < 5e-8) && differences[3] < 4e-4,
            "{differences:?}"
        );
    }
}

/// Our controller against our server: nothing is lost on the wire.
#[test]
fn our_servers_equal_the_law_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(run(folder.path(), "law", "simulated", BILINEAR).0, Some(0));
    let law = history(folder.path(), "law");
    for (offer, protocol, transport) in [
        ("openfresco", "openfresco", "tcp"),
        ("openfresco", "openfresco", "udp"),
        ("openfresco-actor", "openfresco-shadow", "tcp"),
        ("openfresco-actor", "openfresco-shadow", "udp"),
    ] {
        let mut server = Server::offering(offer, BILINEAR, transport);
        let name = format!("{protocol}-{transport}");
        let remote = link(protocol, transport, server.port);
        let (code, said) = run(folder.path(), &name, "simulated", &remote);
        assert_eq!(code, Some(0), "{said:#?}");
        server.peer.line(|line| line.contains("ended the test"));
        assert_eq!(history(folder.path(), &name), law, "{name}");
    }
}

#[test]
fn killed_opensees_exits_with_3() {
    for transport in ["tcp", "udp"] {
        let Some((mut opensees, port)) = opensees_specimen("adapter", transport) else {
            return;
        };
        let folder = tempfile::tempdir().unwrap();
        let remote = link("openfresco-adapter", transport, port);
        let file = test_file(folder.path(), "killed", "real", &remote);
        let out = folder.path().join("killed");
        let gusset = Peer::gusset(&["run", &file, "--out", out.to_str().unwrap()]);
        for _ in 0..20 {
            opensees.event("step");
        }
        opensees.kill();
        let (status, said) = gusset.end();
        assert_eq!(status.code(), Some(3), "{said:#?}");
        let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        assert_eq!(summary["status"], "failed");
        let reason = summary["reason"].as_str().unwrap();
        // A UDP peer that dies while it handles our command leaves no trace for us.
        let silent = transport == "udp" && reason.contains("time limit");
        assert!(silent || reason.contains("closed"), "{reason}");
        assert!(out.join("report.html").exists());
    }
}

#[test]
fn wrong_or_missing_server_exits_with_3() {
    let folder = tempfile::tempdir().unwrap();
    let short = |protocol: &str, port: u16| {
        link(protocol, "tcp", port).replace("connect_timeout_s = 30", "connect_timeout_s = 0.5")
    };
    let nobody = free_port();
    let (code, said) = run(
        folder.path(),
        "nobody",
        "simulated",
        &short("openfresco", nobody),
    );
    assert_eq!(code, Some(3), "{said:#?}");
    assert!(
        said.iter().any(|line| line.contains("nothing listens")),
        "{said:#?}"
    );
    // A shadow that meets an element server: its endian check is no set of sizes.
    let server = Server::start(BILINEAR, "tcp");
    let wrong = short("openfresco-shadow", server.port);
    let (code, said) = run(folder.path(), "wrong", "simulated", &wrong);
    assert_eq!(code, Some(3), "{said:#?}");
    assert!(
        said.iter().any(|line| line.contains("right program")),
        "{said:#?}"
    );
}

#[test]
fn stiffness_far_from_the_servers_warns() {
    let folder = tempfile::tempdir().unwrap();
    let stiffer = "law = { linear = { stiffness_n_per_m = 12000.0 } }";
    let server = Server::start(stiffer, "tcp");
    let remote = link("openfresco", "tcp", server.port);
    let (code, _) = run(folder.path(), "stiffer", "simulated", &remote);
    assert_eq!(code, Some(0));
    let events = std::fs::read_to_string(folder.path().join("stiffer/events.jsonl")).unwrap();
    assert!(events.contains("12 kN/m"), "{events}");
}
