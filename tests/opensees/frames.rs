//! Frames against the real OpenSees: displacements under static loads and natural frequencies there.

use std::process::Command;

use gusset_numerics::frame::FrameSpec;
use gusset_numerics::linalg::{Spd, modes};
use serde_json::Value;

use crate::programs::python;

const STUDY: &str = include_str!("../../config/portal-frame.toml");

/// A leaning frame with everything that a frame can have: levers, releases, constraints, all sections.
const LEANING: &str = r#"
[structure.frame]
node = [
    { name = "a", at_m = [0, 0], fixed = ["x", "y", "rz"] },
    { name = "b", at_m = [0.4, 3.2], mass_kg = 4e3, rotary_mass_kg_m2 = 200 },
    { name = "c", at_m = [5.1, 3.6], mass_kg = 3e3 },
    { name = "d", at_m = [5.5, 0.3], fixed = ["x", "y"] },
    { name = "e", at_m = [0.9, 4.1], mass_kg = 1e3 },
    { name = "f", at_m = [9.0, 3.6], mass_kg = 2e3 },
    { name = "g", at_m = [9.2, 0.0], fixed = ["x", "y", "rz"] },
]
member = [
    { nodes = ["a", "b"], section = "pier", offset_end_m = [0.0, -0.2] },
    { nodes = ["b", "c"], section = "girder", offset_start_m = [0.15, 0.05], offset_end_m = [-0.1, 0.02] },
    { nodes = ["d", "c"], section = "post", release = ["end"] },
    { nodes = ["c", "f"], section = "girder", release = ["start"] },
    { nodes = ["g", "f"], section = "post" },
]
constraint = [
    { rigid = { master = "b", nodes = ["e"] } },
    { equal = { master = "c", nodes = ["f"], directions = ["x"] } },
]
load = [
    { node = "b", x_n = 2e4, y_n = -8e4 },
    { node = "e", x_n = -5e3, y_n = -1e4, rz_n_m = 3e3 },
    { node = "c", y_n = -6e4, rz_n_m = -4e3 },
    { node = "f", x_n = 1.2e4, y_n = -5e4 },
]
[structure.frame.section]
pier.rectangle = { young_pa = 3e10, width_m = 0.3, depth_m = 0.5 }
girder.i_shape = { young_pa = 2.1e11, depth_m = 0.36, flange_width_m = 0.17, flange_thickness_m = 0.0127, web_thickness_m = 0.008 }
post.elastic = { young_pa = 2.1e11, area_m2 = 5e-3, inertia_m4 = 4e-5 }
"#;

/// A space frame with levers, a release, rigid bodies, a floor, and all elastic sections.
const IN_SPACE: &str = r#"
[structure.frame]
dimension = 3
node = [
    { name = "a", at_m = [0, 0, 0], fixed = ["x", "y", "z", "rx", "ry", "rz"] },
    { name = "b", at_m = [0.4, 0.2, 3.2], mass_kg = 4e3, rotary_mass_kg_m2 = 200, tilting_mass_kg_m2 = [150, 90] },
    { name = "c", at_m = [5.1, 0.5, 3.6], mass_kg = 3e3 },
    { name = "d", at_m = [5.5, 0.1, 0.3], fixed = ["x", "y", "z", "rx", "ry", "rz"] },
    { name = "e", at_m = [0.9, -0.4, 4.1], mass_kg = 1e3 },
    { name = "f", at_m = [4.6, 4.9, 3.6], mass_kg = 2e3 },
    { name = "g", at_m = [4.8, 5.2, 0.0], fixed = ["x", "y", "z", "rx", "ry", "rz"] },
]
member = [
    { nodes = ["a", "b"], section = "pier", offset_end_m = [0.0, 0.1, -0.2], orientation = [0.2, 1, 0] },
    { nodes = ["b", "c"], section = "girder", offset_start_m = [0.15, 0.05, 0.1], offset_end_m = [-0.1, 0.02, 0.0] },
    { nodes = ["d", "c"], section = "post", release = ["start"] },
    { nodes = ["c", "f"], section = "girder" },
    { nodes = ["g", "f"], section = "post", orientation = [1, 1, 0] },
    { nodes = ["b", "f"], section = "tube" },
]
constraint = [
    { rigid = { master = "b", nodes = ["e"] } },
    { diaphragm = { master = "c", nodes = ["f"] } },
]
load = [
    { node = "b", x_n = 2e4, y_n = 1e4, z_n = -8e4 },
    { node = "e", x_n = -5e3, z_n = -1e4, rx_n_m = 2e3, ry_n_m = -1e3, rz_n_m = 3e3 },
    { node = "c", y_n = -6e3, z_n = -6e4, rz_n_m = -4e3 },
    { node = "f", x_n = 1.2e4, z_n = -5e4 },
]
[structure.frame.section]
pier.rectangle = { young_pa = 3e10, width_m = 0.3, depth_m = 0.5 }
girder.i_shape = { young_pa = 2.1e11, depth_m = 0.36, flange_width_m = 0.17, flange_thickness_m = 0.0127, web_thickness_m = 0.008 }
post.elastic = { young_pa = 2.1e11, area_m2 = 5e-3, inertia_m4 = 4e-5, weak_inertia_m4 = 2e-5, torsion_m4 = 1e-5 }
tube.tube = { young_pa = 2.1e11, diameter_m = 0.2, thickness_m = 0.01 }
"#;

#[test]
fn frames_stand_and_vibrate_as_in_opensees() {
    let Some(python) = python() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("portal", STUDY),
        ("leaning", LEANING),
        ("in space", IN_SPACE),
    ] {
        let file = folder.path().join(format!("{name}.toml"));
        std::fs::write(&file, text).unwrap();
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/frame.py");
        let said = Command::new(&python)
            .arg(script)
            .arg(&file)
            .output()
            .unwrap();
        let line = String::from_utf8_lossy(&said.stdout).into_owned();
        let theirs: Value = serde_json::from_str(line.lines().last().unwrap_or_default())
            .unwrap_or_else(|_| panic!("{line}{}", String::from_utf8_lossy(&said.stderr)));

        let test: toml::Table = text.parse().unwrap();
        let frame: FrameSpec = test["structure"]["frame"].clone().try_into().unwrap();
        let model = frame.model().unwrap();
        let mut disp = model.load.clone();
        Spd::factor(&model.stiffness)
            .unwrap()
            .solve_in_place(&mut disp);
        let moved = |node: &str, direction| -> f64 {
            let motion = model.motion(node, direction).unwrap();
            motion.iter().map(|(dof, share)| share * disp[*dof]).sum()
        };
        let largest = disp.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        for node in model.nodes() {
            for (place, &direction) in frame.directions().iter().enumerate() {
                let wanted = theirs["disp"][node][place].as_f64().unwrap();
                let off = (moved(node, direction) - wanted).abs() / largest;
                assert!(off < 1e-9, "{name}, {node} {direction:?}: {off:e}");
            }
        }
        let found = modes(&model.stiffness, &model.mass).unwrap().frequencies;
        let wanted = theirs["frequencies_rad_per_s"].as_array().unwrap();
        assert_eq!(wanted.len(), 3);
        for (found, wanted) in found.iter().zip(wanted) {
            let off = (found / wanted.as_f64().unwrap() - 1.0).abs();
            assert!(off < 1e-9, "{name}: {found} {wanted}");
        }
    }
}
