//! The companion methods against the real OpenSees: Newmark (average and linear acceleration), explicit Newmark, central
//! differences, KR-α with both weightings, linear and yielding, one and several degrees of freedom.
//!
//! MKR-α is not in OpenSees 3.7: it is tested against its own poles elsewhere.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::programs::{Peer, python};
use serde_json::Value;

const DT: f64 = 0.02;
const STEPS: usize = 300;

/// A storey: OpenSees' material, our law, N s/m beside it.
type Storey = (&'static str, &'static str, f64);

const LINEAR: [Storey; 3] = [
    (
        "Elastic:8000",
        "{ linear = { stiffness_n_per_m = 8000.0 } }",
        14.0,
    ),
    (
        "Elastic:6000",
        "{ linear = { stiffness_n_per_m = 6000.0 } }",
        9.0,
    ),
    (
        "Elastic:5000",
        "{ linear = { stiffness_n_per_m = 5000.0 } }",
        0.0,
    ),
];

/// Both know the law exactly: Steel01 is the bilinear law with kinematic hardening.
const YIELDING: [Storey; 3] = [
    (
        "Steel01:60,8000,0.05",
        "{ bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }",
        14.0,
    ),
    (
        "Steel01:50,6000,0.1",
        "{ bilinear = { stiffness_n_per_m = 6000.0, yield_force_n = 50.0, post_yield_ratio = 0.1 } }",
        9.0,
    ),
    (
        "Elastic:5000",
        "{ linear = { stiffness_n_per_m = 5000.0 } }",
        0.0,
    ),
];

/// Force on floor i is i times this; it starts at zero with a zero slope.
fn force(step: usize) -> f64 {
    let t = step as f64 * DT;
    80.0 * libm::sin(7.0 * t) * libm::sin(1.3 * t) + 30.0 * (1.0 - libm::cos(19.0 * t))
}

/// Displacement, velocity and acceleration: rows of floors.
struct Course {
    disp: Vec<Vec<f64>>,
    vel: Vec<Vec<f64>>,
    accel: Vec<Vec<f64>>,
}

fn theirs(python: &Path, scheme: &str, storeys: &[Storey]) -> Course {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/integrate.py");
    let mut command = Command::new(python);
    command
        .args([script, "--scheme", scheme, "--dt", &DT.to_string()])
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    for (material, _, dashpot) in storeys {
        command.args(["--storey", material, "--dashpot", &dashpot.to_string()]);
    }
    let mut child = command.spawn().unwrap();
    let history: Vec<f64> = (0..=STEPS).map(force).collect();
    let text = serde_json::to_string(&history).unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(text.as_bytes())
        .unwrap();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    // OpenSees silently replaces an integrator that it does not know, except for this message.
    assert!(!errors.contains("unknown integrator"), "{errors}");
    let line = said.lines().find(|line| line.contains("\"course\""));
    let found: Value =
        serde_json::from_str(line.unwrap_or_else(|| panic!("{said}{errors}"))).unwrap();
    let rows = |key: &str| -> Vec<Vec<f64>> { serde_json::from_value(found[key].clone()).unwrap() };
    Course {
        disp: rows("disp"),
        vel: rows("vel"),
        accel: rows("accel"),
    }
}

fn ours(method: &str, storeys: &[Storey]) -> Course {
    let folder = tempfile::tempdir().unwrap();
    let n = storeys.len();
    let history: Vec<String> = (0..=STEPS)
        .map(|step| {
            let each = (1..=n).map(|floor| format!("{:.17e}", floor as f64 * force(step)));
            each.collect::<Vec<_>>().join(",")
        })
        .collect();
    std::fs::write(folder.path().join("force.csv"), history.join("\n")).unwrap();
    let list = |value: &dyn Fn(&Storey) -> String| {
        storeys.iter().map(value).collect::<Vec<_>>().join(", ")
    };
    let mut text = format!(
        "[time]\nstep_s = {DT}\nduration_s = {}\nclock = \"simulated\"\n[structure.shear_building]\nmass_kg = [{}]\n\
         stiffness_n_per_m = [{}]\ndamping_n_s_per_m = [{}]\n[excitation.nodal_table]\nfile = \"force.csv\"\n\
         [integrator]\n{method}\n",
        STEPS as f64 * DT,
        list(&|_| "10".to_owned()),
        list(&|_| "0".to_owned()),
        list(&|storey| storey.2.to_string()),
    );
    for (floor, (_, law, _)) in storeys.iter().enumerate() {
        let from = if floor == 0 {
            "\"ground\"".to_owned()
        } else {
            floor.to_string()
        };
        text += &format!(
            "[[structure.element]]\nfrom = {from}\nto = {}\nlaw = {law}\n",
            floor + 1
        );
    }
    let file = folder.path().join("test.toml");
    std::fs::write(&file, text).unwrap();
    let (run, csv) = (folder.path().join("run"), folder.path().join("all.csv"));
    let path = |path: &Path| path.to_str().unwrap().to_owned();
    let (status, said) = Peer::gusset(&["run", &path(&file), "--out", &path(&run)]).end();
    assert!(status.success(), "{said:#?}");
    let (status, said) = Peer::gusset(&[
        "export",
        &path(&run),
        "--no-units-line",
        "--out",
        &path(&csv),
    ])
    .end();
    assert!(status.success(), "{said:#?}");
    let text = std::fs::read_to_string(csv).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let columns = |letter: &str| -> Vec<Vec<f64>> {
        let at: Vec<usize> = (1..=n)
            .map(|dof| {
                head.iter()
                    .position(|c| *c == format!("{letter}{dof}"))
                    .unwrap()
            })
            .collect();
        let row = |row: &Vec<&str>| at.iter().map(|c| row[*c].parse().unwrap()).collect();
        rows.iter().map(row).collect()
    };
    Course {
        disp: columns("x"),
        vel: columns("v"),
        accel: columns("a"),
    }
}

/// Largest difference over the largest value.
fn apart(ours: &[Vec<f64>], theirs: &[Vec<f64>]) -> f64 {
    assert_eq!(ours.len(), theirs.len());
    let (mut worst, mut peak) = (0.0f64, 0.0f64);
    for (a, b) in ours.iter().flatten().zip(theirs.iter().flatten()) {
        assert!(a.is_finite() && b.is_finite());
        worst = worst.max((a - b).abs());
        peak = peak.max(b.abs());
    }
    assert!(peak > 0.0);
    worst / peak
}

/// What both programs report of a step.
#[derive(Clone, Copy, PartialEq)]
enum Compared {
    /// Displacement, velocity, acceleration.
    All,
    /// The acceleration of an α method is a weighted one there and that of equilibrium here.
    Motion,
    /// Central differences report velocity and acceleration one step late there.
    Displacement,
}

/// Both compute the same formula in another order: some 1e-16 a step, of stable motions 300 times, and Newton's iteration
/// ends at 1e-14 m here and there, on a law whose two branches it finds exactly. A hundred times that is allowed: any error
/// of meaning (another weight, a step's shift, half a step of a load) is larger by ten orders.
const SAME: f64 = 1e-11;

fn agree(method: &str, scheme: &str, compared: Compared) {
    let Some(python) = python() else {
        return;
    };
    let method = if method.contains("newmark") || method.contains("central") {
        format!("{method}\nnewton_tolerance = 1e-14")
    } else {
        method.to_owned()
    };
    for storeys in [&LINEAR[..1], &LINEAR, &YIELDING[..1], &YIELDING] {
        let (ours, theirs) = (ours(&method, storeys), theirs(&python, scheme, storeys));
        let mut found = vec![apart(&ours.disp, &theirs.disp)];
        if compared != Compared::Displacement {
            found.push(apart(&ours.vel, &theirs.vel));
        }
        if compared == Compared::All {
            found.push(apart(&ours.accel[1..], &theirs.accel[1..]));
        }
        let peak = ours
            .disp
            .iter()
            .flatten()
            .fold(0.0f64, |p, x| p.max(x.abs()));
        // Storey 1 yields at 7.5 mm.
        assert!(peak > 0.015, "{scheme}: nothing yielded: {peak}");
        assert!(
            found.iter().all(|gap| *gap < SAME),
            "{method} {scheme}, {} storeys {}: {found:?}",
            storeys.len(),
            storeys[0].0
        );
    }
}

#[test]
fn average_acceleration() {
    agree(
        "method = \"newmark_average\"",
        "Newmark:0.5,0.25",
        Compared::All,
    );
}

#[test]
fn linear_acceleration() {
    let sixth = format!("Newmark:0.5,{}", 1.0f64 / 6.0);
    agree("method = \"newmark_linear\"", &sixth, Compared::All);
}

#[test]
fn explicit_newmark() {
    agree(
        "method = \"newmark_explicit\"",
        "NewmarkExplicit:0.5",
        Compared::All,
    );
}

#[test]
fn central_differences() {
    agree(
        "method = \"central_difference\"",
        "CentralDifference",
        Compared::Displacement,
    );
}

#[test]
fn kr_alpha_with_forces_at_weighted_state() {
    for rho in ["0", "0.5", "0.8", "1"] {
        let method = format!("method = \"kr_alpha\"\nrho_infinity = {rho}\nweighting = \"state\"");
        agree(&method, &format!("KRAlphaExplicit:{rho}"), Compared::Motion);
    }
}

#[test]
fn kr_alpha_with_weighted_forces() {
    for rho in ["0", "0.5", "0.8", "1"] {
        let method = format!("method = \"kr_alpha\"\nrho_infinity = {rho}");
        agree(
            &method,
            &format!("KRAlphaExplicit_TP:{rho}"),
            Compared::Motion,
        );
    }
}

/// KR-α with ρ = 1 is λ = 4 for a linear structure, from rest without a force: the family itself against OpenSees.
#[test]
fn family_at_lambda_4_is_undamped_kr_alpha() {
    let Some(python) = python() else {
        return;
    };
    let ours = ours("lambda = 4", &LINEAR);
    let theirs = theirs(&python, "KRAlphaExplicit:1", &LINEAR);
    let found = [
        apart(&ours.disp, &theirs.disp),
        apart(&ours.vel, &theirs.vel),
    ];
    assert!(found.iter().all(|gap| *gap < SAME), "{found:?}");
}

/// The two weightings are one for a linear structure and two where the law yields: which one is compared above matters.
#[test]
fn weightings_differ_where_the_law_yields() {
    let of = |weighting: &str, storeys: &[Storey]| {
        let method =
            format!("method = \"kr_alpha\"\nrho_infinity = 0.5\nweighting = \"{weighting}\"");
        ours(&method, storeys)
    };
    let gap = |storeys: &[Storey]| apart(&of("forces", storeys).disp, &of("state", storeys).disp);
    assert!(gap(&LINEAR) < SAME);
    assert!(gap(&YIELDING) > 1e-4);
}
