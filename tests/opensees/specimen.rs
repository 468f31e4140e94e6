//! The real OpenSees is the specimen: its `adapter`, `actuator` and `corotActuator` elements take our commands and
//! answer with displacement and force, as exactly as the stiff spring between the two allows.

use crate::programs::{LONG, Peer, free_port, python};
use gusset_actuator::specimen::{InProcess, SpecimenLaw};
use gusset_link::openfresco::{Remote, RemoteSettings};
use gusset_quantity::substructure::{Command, LinkFault, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_wire::openfresco as of;
use gusset_wire::openfresco::Carrier;

const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";

struct Rig {
    opensees: Peer,
    remote: Remote,
}

/// OpenSees with two springs or one, and our controller connected to it.
fn rig(kind: &str, carrier: Carrier, dofs: usize, stiffness: &str) -> Option<Rig> {
    let python = python()?;
    let port = free_port();
    let (port_word, dofs_word) = (port.to_string(), dofs.to_string());
    let mut args = vec!["--port", &port_word, "--kind", kind, "--dofs", &dofs_word];
    args.extend(["--stiffness", stiffness]);
    if carrier == Carrier::Datagrams {
        args.push("--udp");
    }
    let mut opensees = Peer::script(&python, "specimen.py", &args);
    opensees.event("listening");
    let address = format!("127.0.0.1:{port}");
    let mut settings = RemoteSettings::new(of::Peer::Adapter, carrier, address, dofs);
    // The port is open a moment after that line; a refused connection is tried again, on a busy machine for long.
    settings.connect_limit_s = LONG.as_secs_f64();
    let mut remote = Remote::new(settings).unwrap();
    remote.open().unwrap();
    Some(Rig { opensees, remote })
}

fn path(k: u64, axis: usize) -> f64 {
    0.02 * libm::sin(0.1 * k as f64) * (1.0 - 0.3 * axis as f64)
}

fn step(port: &mut dyn Substructure, k: u64, into: &mut Measurement) -> Result<(), LinkFault> {
    let disp: Vec<f64> = (0..port.axes()).map(|axis| path(k, axis)).collect();
    let vel = vec![0.0; disp.len()];
    let command = Command {
        sequence: k,
        time: 0.01 * k as f64,
        dt: 0.01,
        disp: &disp,
        vel: &vel,
    };
    port.issue(&command)?;
    port.collect(Nanos(0), into)?;
    port.accepted(k)
}

/// Displacements are reached to k/kb, forces are good to kb·1e-16·d beside k·(that displacement). With kb = 1e8 k both
/// are about 1e-8 of the peaks here; a hundred times that is allowed, for the solver's own rounding. The corotational
/// element takes its elongation from two lengths of 100, whose difference carries 1.4e-14·kb.
#[test]
fn elements_follow_the_law_in_process() {
    for (kind, carrier, dofs, stiffness, tolerance) in [
        ("adapter", Carrier::Stream, 1, "8e11", 60e-6),
        ("adapter", Carrier::Datagrams, 1, "8e11", 60e-6),
        ("adapter", Carrier::Stream, 2, "8e11", 60e-6),
        ("actuator", Carrier::Stream, 1, "8e11", 60e-6),
        ("corotActuator", Carrier::Stream, 1, "8e9", 1e-3),
    ] {
        let Some(Rig {
            mut opensees,
            mut remote,
        }) = rig(kind, carrier, dofs, stiffness)
        else {
            return;
        };
        let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
        let mut own = InProcess::new(law.build(dofs).unwrap());
        let (mut theirs, mut ours) = (Measurement::zeros(dofs), Measurement::zeros(dofs));
        for k in 1..=200 {
            step(&mut remote, k, &mut theirs).unwrap();
            step(&mut own, k, &mut ours).unwrap();
            for (a, b) in theirs.force.iter().zip(&ours.force) {
                assert!((a - b).abs() < tolerance, "{kind} step {k}: {a} {b}");
            }
            for (a, b) in theirs.disp.iter().zip(&ours.disp) {
                assert!((a - b).abs() < 2e-8, "{kind} step {k}: {a} {b}");
            }
        }
        remote.retire(Retirement::Orderly);
        let steps = opensees.events("step");
        assert!(steps.len() >= 199, "{kind}: {}", steps.len());
        let (status, _) = opensees.end();
        // OpenSees exits in this way when it is stopped.
        assert_eq!(status.code(), Some(255), "{kind}");
    }
}

#[test]
fn killed_opensees_closes_the_link_at_once() {
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        let Some(Rig {
            mut opensees,
            mut remote,
        }) = rig("adapter", carrier, 1, "8e11")
        else {
            return;
        };
        let mut into = Measurement::zeros(1);
        for k in 1..20 {
            step(&mut remote, k, &mut into).unwrap();
        }
        opensees.kill();
        assert_eq!(step(&mut remote, 20, &mut into), Err(LinkFault::Closed));
        remote.retire(Retirement::Tripped);
    }
}
