//! Materials of fibres against those of the real OpenSees: stresses along cyclic and random paths.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use gusset_numerics::frame::MaterialSpec;
use serde_json::Value;

use crate::programs::python;

/// Our material, that of OpenSees, and the scale of its strains.
const MATERIALS: [(&str, &str, f64); 9] = [
    ("elastic = { young_pa = 2.1e11 }", "Elastic:2.1e11", 1e-3),
    ("elastic_no_tension = { young_pa = 3e10 }", "ENT:3e10", 1e-3),
    (
        "menegotto_pinto = { young_pa = 2e11, yield_pa = 4.2e8, hardening_ratio = 0.01 }",
        "Steel02:4.2e8,2e11,0.01,20,0.925,0.15",
        4e-3,
    ),
    (
        "menegotto_pinto = { young_pa = 2e11, yield_pa = 2.5e8, hardening_ratio = 0, r0 = 25, cr1 = 0.9, cr2 = 0.3 }",
        "Steel02:2.5e8,2e11,0,25,0.9,0.3",
        4e-3,
    ),
    (
        "menegotto_pinto = { young_pa = 2e11, yield_pa = 4.2e8, hardening_ratio = 0.02, r0 = 18, a1 = 0.05, a2 = 1.5, a3 = 0.1, a4 = 2 }",
        "Steel02:4.2e8,2e11,0.02,18,0.925,0.15,0.05,1.5,0.1,2",
        4e-3,
    ),
    (
        "concrete_01 = { strength_pa = 3e7, strain_at_strength = 0.002, crushing_strength_pa = 6e6, crushing_strain = 0.01 }",
        "Concrete01:-3e7,-0.002,-6e6,-0.01",
        2e-3,
    ),
    (
        "concrete_01 = { strength_pa = 4.1e7, strain_at_strength = 0.004, crushing_strength_pa = 3.4e7, crushing_strain = 0.014 }",
        "Concrete01:-4.1e7,-0.004,-3.4e7,-0.014",
        4e-3,
    ),
    (
        "concrete_02 = { strength_pa = 3e7, strain_at_strength = 0.002, crushing_strength_pa = 6e6, crushing_strain = 0.01, unloading_ratio = 0.1, tensile_strength_pa = 3e6, tension_softening_pa = 1.5e9 }",
        "Concrete02:-3e7,-0.002,-6e6,-0.01,0.1,3e6,1.5e9",
        2e-3,
    ),
    (
        "concrete_02 = { strength_pa = 4e7, strain_at_strength = 0.003, crushing_strength_pa = 1e7, crushing_strain = 0.02, unloading_ratio = 0.3, tensile_strength_pa = 1e6, tension_softening_pa = 3e10 }",
        "Concrete02:-4e7,-0.003,-1e7,-0.02,0.3,1e6,3e10",
        2e-3,
    ),
];

/// Cycles of growing amplitude about 0 or about compression, in 25 steps a leg, in units of the scale.
fn cycles(offset: f64) -> Vec<f64> {
    let mut path = vec![0.0];
    for amplitude in [0.2, 0.5, 1.0, 2.0, 3.5, 5.0, 2.0, 8.0] {
        for end in [amplitude - offset, -amplitude - offset] {
            let from = path[path.len() - 1];
            path.extend((1..=25).map(|i| from + (end - from) * f64::from(i) / 25.0));
        }
    }
    path
}

/// Steps of random sizes from 10⁻⁴ to 1 in random directions, about a slowly growing compression.
fn wandering(mut seed: u64) -> Vec<f64> {
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut at = 0.0;
    let mut step = |i: i32| {
        let size = libm::pow(10.0, -4.0 * random());
        at = 0.97 * at + if random() < 0.5 { size } else { -size };
        at - 0.01 * f64::from(i.min(100))
    };
    (0..3000).map(&mut step).collect()
}

pub fn theirs(python: &Path, material: &str, strains: &[f64]) -> Vec<f64> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/law.py");
    let mut child = Command::new(python)
        .args([script, material])
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let text = serde_json::to_string(strains).unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(text.as_bytes()).unwrap();
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let line = said.lines().find(|line| line.contains("\"stresses\""));
    let errors = String::from_utf8_lossy(&output.stderr);
    let found: Value =
        serde_json::from_str(line.unwrap_or_else(|| panic!("{said}{errors}"))).unwrap();
    serde_json::from_value(found["stresses"].clone()).unwrap()
}

#[test]
fn materials_follow_those_of_opensees() {
    let Some(python) = python() else {
        return;
    };
    for (ours, material, scale) in MATERIALS {
        let spec: MaterialSpec = toml::from_str(ours).unwrap();
        for (path, units) in [
            ("cycles", cycles(0.0)),
            ("cycles in compression", cycles(2.0)),
            ("seed 1", wandering(1)),
            ("seed 2", wandering(2)),
        ] {
            let strains: Vec<f64> = units.iter().map(|strain| scale * strain).collect();
            let found = spec.stresses(&strains).unwrap();
            let wanted = theirs(&python, material, &strains);
            assert_eq!(found.len(), wanted.len());
            let peak = wanted.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            assert!(peak > 1e6, "{material}, {path}");
            for (k, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
                let off = (found - wanted).abs() / peak;
                assert!(off < 1e-9, "{material}, {path}, step {k}: {found} {wanted}");
            }
        }
    }
}
