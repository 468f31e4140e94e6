//! The real OpenSees commands the real `gusset serve` through `genericClient`: its results with our specimen equal those with its
//! own material.

use crate::programs::{Peer, Server, python};

const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
const STEEL: &str = "Steel01:60,8000,0.05";

/// One analysis: largest difference, largest displacement, and the median time of a step in ms.
fn analysis(server: &Server, udp: bool, material: &str, more: &[&str]) -> Option<(f64, f64, f64)> {
    let python = python()?;
    let port = server.port.to_string();
    let mut args = vec!["--port", &port, "--material", material];
    if udp {
        args.push("--udp");
    }
    args.extend(more);
    let mut client = Peer::script(&python, "client.py", &args);
    let result = client.event("result");
    let number = |key: &str| result[key].as_f64().unwrap();
    Some((number("difference"), number("peak"), number("step_ms")))
}

/// Forces differ by rounding (both programs compute the same formula in another order), and the iteration stops at
/// 1e-13 m: a difference of 1e-10 m in 400 steps of 0.04 m is far above both and far below any error of meaning.
const SAME: f64 = 1e-10;

fn agree(law: &str, transport: &str, material: &str, more: &[&str]) {
    if python().is_none() {
        return;
    }
    let mut server = Server::start(law, transport);
    let udp = transport == "udp";
    // Twice against one server: the port is offered again, and the specimen is virgin again.
    for _ in 0..2 {
        let Some((difference, peak, _)) = analysis(&server, udp, material, more) else {
            return;
        };
        assert!(peak > 0.02, "nothing moved: {peak}");
        assert!(
            difference < SAME,
            "{transport} {material} {more:?}: {difference}"
        );
        server.peer.line(|line| line.contains("ended the test"));
    }
    server.peer.terminate();
    let (status, _) = server.peer.end();
    assert_eq!(status.code(), Some(143));
}

#[test]
fn yielding_storey_with_every_integrator() {
    for scheme in ["newton", "initial", "alphaos", "explicit"] {
        agree(BILINEAR, "tcp", STEEL, &["--scheme", scheme]);
    }
}

/// A step begins with the displacement of the last one: the tangent there is that of the motion that led there. Looser than
/// rounding, so that rounding decides no iteration.
#[test]
fn newton_iterates_as_in_opensees() {
    let Some(python) = python() else {
        return;
    };
    let server = Server::start(BILINEAR, "tcp");
    let port = server.port.to_string();
    let args = ["--port", &port, "--material", STEEL, "--tolerance", "1e-8"];
    let mut client = Peer::script(&python, "client.py", &args);
    let result = client.event("result");
    let count = |key: &str| result[key].as_u64().unwrap();
    let (iterations, own) = (count("iterations"), count("own_iterations"));
    assert!(own > 400, "one a step at least: {own}");
    assert_eq!(iterations, own);
}

#[test]
fn the_same_over_udp() {
    agree(BILINEAR, "udp", STEEL, &[]);
    agree(BILINEAR, "udp", STEEL, &["--scheme", "explicit"]);
    // 16 kB a vector: two datagrams.
    agree(
        BILINEAR,
        "udp",
        STEEL,
        &["--size", "2000", "--steps", "200"],
    );
}

#[test]
fn a_linear_and_a_hardening_storey() {
    let linear = "law = { linear = { stiffness_n_per_m = 8000.0 } }";
    agree(linear, "tcp", "Elastic:8000", &[]);
    let cubic = "law = { cubic = { stiffness_n_per_m = 8000.0, cubic_n_per_m3 = 2e6 } }";
    let power = "ElasticPowerFunc:-coeff,8000,2e6,-exp,1,3";
    for scheme in ["newton", "alphaos", "explicit"] {
        agree(cubic, "tcp", power, &["--scheme", scheme]);
    }
}

/// `genericClient` adds C·v to the force that it reads, so the server must not report a damping that is in its force: it would act
/// twice. An explicit scheme, which needs C for its operator, then sees the damper half a step late; that difference decreases with
/// the step.
#[test]
fn a_damper_acts_once() {
    let damper = "law = { linear = { stiffness_n_per_m = 8000.0, damping_n_s_per_m = 40.0 } }";
    let material = "Elastic:8000,40";
    agree(damper, "tcp", material, &[]);
    if python().is_none() {
        return;
    }
    let server = Server::start(damper, "tcp");
    let late = |dt, steps| {
        let more = ["--scheme", "explicit", "--dt", dt, "--steps", steps];
        analysis(&server, false, material, &more).unwrap().0
    };
    let (coarse, fine) = (late("0.01", "400"), late("0.0025", "1600"));
    assert!(fine < 1e-4 && fine < 0.4 * coarse, "{coarse} {fine}");
}

#[test]
fn two_dofs_have_separate_laws() {
    let one = "{ bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
    let two = format!("laws = [{one}, {one}]");
    for transport in ["tcp", "udp"] {
        for scheme in ["newton", "alphaos", "explicit"] {
            agree(&two, transport, STEEL, &["--dofs", "2", "--scheme", scheme]);
        }
    }
    agree(&two, "tcp", STEEL, &["--dofs", "2", "--size", "8"]);
}

/// OpenSees integrates its Bouc-Wen law with one implicit step of first order, we along the path to roundoff: the
/// two meet in proportion to the step.
#[test]
fn bouc_wen_converges_to_that_of_opensees() {
    if python().is_none() {
        return;
    }
    let law = "law = { bouc_wen = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05, \
               beta = 0.5, gamma = 0.5, exponent = 1.0 } }";
    // alpha, ko, n, gamma, beta, Ao, deltaA, deltaNu, deltaEta; z is a displacement there: beta and gamma per 7.5 mm.
    let material = "BoucWen:0.05,8000,1,66.66666666666667,66.66666666666667,1,0,0,0";
    let server = Server::start(law, "tcp");
    let error = |dt: &str, steps: &str| {
        let more = ["--dt", dt, "--steps", steps];
        let (difference, peak, _) = analysis(&server, false, material, &more).unwrap();
        difference / peak
    };
    let (coarse, fine) = (error("0.01", "400"), error("0.0025", "1600"));
    assert!(fine < 0.02, "{coarse} {fine}");
    assert!(fine < 0.5 * coarse, "{coarse} {fine}");
}

#[test]
fn killed_opensees_frees_the_port() {
    let Some(python) = python() else {
        return;
    };
    for transport in ["tcp", "udp"] {
        let mut server = Server::start(BILINEAR, transport);
        let port = server.port.to_string();
        let udp: &[&str] = if transport == "udp" { &["--udp"] } else { &[] };
        // It is killed long before two hundred thousand steps are over.
        let endless = ["--port", &port, "--steps", "200000", "--pause-after", "20"];
        let mut client = Peer::script(&python, "client.py", &[&endless[..], udp].concat());
        client.event("step");
        let short = ["--port", &port, "--steps", "20", "--material", STEEL];
        let mut second = Peer::script(&python, "client.py", &[&short[..], udp].concat());
        second.event("loaded");
        client.kill();
        server.peer.line(|line| {
            ["without a goodbye", "broke", "takes over"]
                .iter()
                .any(|words| line.contains(words))
        });
        let difference = second.event("result")["difference"].as_f64().unwrap();
        assert!(difference < SAME, "{transport}: {difference}");
        let (difference, ..) =
            analysis(&server, transport == "udp", STEEL, &["--steps", "20"]).unwrap();
        assert!(difference < SAME, "{transport}: {difference}");
    }
}
