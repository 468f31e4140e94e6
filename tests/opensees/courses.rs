//! Frames whose members yield, under a ground motion: displacements and forces of `gusset run` against the real OpenSees with four times finer steps.

use std::path::Path;
use std::process::Command;

use gusset_numerics::frame::FrameSpec;
use serde_json::Value;

use crate::programs::{Peer, python};

const RATE: u32 = 1024;
const SUBSTEPS: &str = "4";

/// A portal of 6 m by 3.5 m with 40 t, whose members are given by the key that is put in.
fn portal(members: [&str; 2], p_delta: bool, more: &str, amplitude: f64) -> String {
    let [column, beam] = members;
    format!(
        r#"
[structure.frame]
node = [
    {{ name = "A0", at_m = [0, 0], fixed = ["x", "y", "rz"] }},
    {{ name = "B0", at_m = [6, 0], fixed = ["x", "y", "rz"] }},
    {{ name = "A1", at_m = [0, 3.5], mass_kg = 20e3 }},
    {{ name = "B1", at_m = [6, 3.5], mass_kg = 20e3 }},
]
member = [
    {{ nodes = ["A0", "A1"], section = "column", p_delta = {p_delta}, {column} }},
    {{ nodes = ["B0", "B1"], section = "column", p_delta = {p_delta}, {column} }},
    {{ nodes = ["A1", "B1"], section = "beam", {beam} }},
]
load = [{{ node = "A1", y_n = -196e3 }}, {{ node = "B1", y_n = -196e3 }}]
{more}
{}"#,
        motion(amplitude, 4)
    )
}

fn motion(amplitude: f64, duration: u32) -> String {
    format!(
        r#"
[structure.damping.rayleigh]
mass_coefficient_per_s = 0.5
stiffness_coefficient_s = 0.0
[time]
rate_hz = {RATE}
duration_s = {duration}
clock = "simulated"
[excitation.ground_acceleration.signal.sine]
amplitude = {amplitude}
frequency_hz = 1.5
"#
    )
}

const ELASTIC: &str = "[structure.frame.section]
column.elastic = { young_pa = 2.1e11, area_m2 = 0.0149, inertia_m4 = 2.517e-4 }
beam.elastic = { young_pa = 2.1e11, area_m2 = 0.0106, inertia_m4 = 1.5e-4 }
";
const HINGES: &str = "[structure.frame.hinge]
column.bilinear = { stiffness_n_per_m = 9.06e8, yield_force_n = 400e3, post_yield_ratio = 0.003 }
beam.bilinear = { stiffness_n_per_m = 3.15e8, yield_force_n = 250e3, post_yield_ratio = 0.003 }
";
const STEEL: &str = "[structure.frame.material]
s355.menegotto_pinto = { young_pa = 2e11, yield_pa = 355e6, hardening_ratio = 0.01 }
[structure.frame.section]
column.i_shape = { material = \"s355\", depth_m = 0.3, flange_width_m = 0.3, flange_thickness_m = 0.019, web_thickness_m = 0.011 }
beam.i_shape = { material = \"s355\", depth_m = 0.36, flange_width_m = 0.17, flange_thickness_m = 0.0127, web_thickness_m = 0.008 }
";
const CONCRETE: &str = "[structure.frame.material]
cover.concrete_01 = { strength_pa = 30e6, strain_at_strength = 0.002, crushing_strength_pa = 6e6, crushing_strain = 0.006 }
core.concrete_02 = { strength_pa = 36e6, strain_at_strength = 0.0024, crushing_strength_pa = 20e6, crushing_strain = 0.015, unloading_ratio = 0.1, tensile_strength_pa = 2.5e6, tension_softening_pa = 2e9 }
b500.menegotto_pinto = { young_pa = 2e11, yield_pa = 500e6, hardening_ratio = 0.01 }
[structure.frame.section]
column.rc_rectangle = { concrete = \"cover\", core = \"core\", steel = \"b500\", width_m = 0.4, depth_m = 0.4, cover_m = 0.04, top_area_m2 = 1.2e-3, bottom_area_m2 = 1.2e-3, middle_area_m2 = 8e-4 }
";

fn frames() -> Vec<(&'static str, String, f64)> {
    let force = "kind = \"force_based\"";
    let both = |member| [member, member];
    let concrete_column = format!(
        r#"
[structure.frame]
node = [
    {{ name = "A0", at_m = [0, 0], fixed = ["x", "y", "rz"] }},
    {{ name = "A1", at_m = [0, 3.0], mass_kg = 40e3 }},
]
member = [{{ nodes = ["A0", "A1"], section = "column", {force}, p_delta = true }}]
load = [{{ node = "A1", y_n = -392e3 }}]
{CONCRETE}
{}"#,
        motion(3.0, 4)
    );
    vec![
        (
            "elastic",
            portal(both("kind = \"elastic\""), false, ELASTIC, 4.0),
            1e-4,
        ),
        (
            "p-delta",
            portal(both("kind = \"elastic\""), true, ELASTIC, 4.0),
            1e-4,
        ),
        (
            "hinged",
            portal(
                [
                    "hinge_start = \"column\", hinge_end = \"column\"",
                    "hinge_start = \"beam\", hinge_end = \"beam\"",
                ],
                true,
                &format!("{ELASTIC}{HINGES}"),
                6.0,
            ),
            3e-3,
        ),
        ("force-based", portal(both(force), true, STEEL, 8.0), 3e-3),
        (
            "displacement-based",
            portal(
                both("kind = \"displacement_based\", points = 4"),
                true,
                STEEL,
                8.0,
            ),
            3e-3,
        ),
        ("concrete column", concrete_column, 3e-2),
        ("three storeys", three_storeys(), 3e-3),
        ("corotational", mast(2), 1e-2),
        ("space, corotational", mast(3), 1e-2),
        ("lead-rubber bearings", isolated(LEAD_RUBBER), 3e-3),
        ("friction pendulums", isolated(PENDULUM), 3e-2),
        (
            "space, elastic",
            in_space(["kind = \"elastic\""; 2], 3.0),
            3e-4,
        ),
        ("space, force-based", in_space([force; 2], 7.0), 3e-4),
        (
            "space, displacement-based",
            in_space(["kind = \"displacement_based\", points = 4"; 2], 7.0),
            1e-3,
        ),
    ]
}

/// The motion with a second component of this amplitude.
fn in_two_directions(motion: &str, amplitude: f64) -> String {
    motion.replace(
        "[excitation.ground_acceleration.signal.sine]",
        &format!(
            "[[excitation.ground_acceleration]]\ndirection = \"y\"\nsignal.sine = {{ amplitude = {amplitude}, frequency_hz = 2.3 }}\n\
             [[excitation.ground_acceleration]]\ndirection = \"x\"\n[excitation.ground_acceleration.signal.sine]"
        ),
    )
}

const LEAD_RUBBER: &str = "elastomeric = { stiffness_n_per_m = 1e7, characteristic_strength_n = 2e4, post_yield_stiffness_n_per_m = 8e5 }";
/// The axial force changes as the building tilts.
const PENDULUM: &str = "friction_pendulum = { radius_m = 2, stiffness_n_per_m = 2e7, friction_slow = 0.05, friction_fast = 0.05, rate_s_per_m = 0, \
                        largest_axial_force_n = 4e5, vertical_stiffness_n_per_m = 5e8 }";

/// An elastic storey in space on four bearings, under two components of motion.
fn isolated(bearing: &str) -> String {
    let fixed = if bearing.contains("vertical") {
        ""
    } else {
        "\"z\", "
    };
    let corners = [("A", 0, 0), ("B", 6, 0), ("C", 6, 4), ("D", 0, 4)];
    let (mut nodes, mut members, mut links, mut loads) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (k, (name, x, y)) in corners.into_iter().enumerate() {
        let next = corners[(k + 1) % 4].0;
        let all = "\"x\", \"y\", \"z\", \"rx\", \"ry\", \"rz\"";
        nodes.extend([
            format!("{{ name = \"{name}g\", at_m = [{x}, {y}, 0], fixed = [{all}] }}"),
            format!("{{ name = \"{name}0\", at_m = [{x}, {y}, 0], mass_kg = 5e3, fixed = [{fixed}\"rx\", \"ry\"] }}"),
            format!("{{ name = \"{name}1\", at_m = [{x}, {y}, 3.5], mass_kg = 10e3 }}"),
        ]);
        members.push(format!(
            "{{ nodes = [\"{name}0\", \"{name}1\"], section = \"s\" }}"
        ));
        members.push(format!(
            "{{ nodes = [\"{name}1\", \"{next}1\"], section = \"s\" }}"
        ));
        links.push(format!(
            "{{ nodes = [\"{name}g\", \"{name}0\"], bearing.{bearing}, reach_disp_m = 0.2 }}"
        ));
        loads.push(format!(
            "{{ node = \"{name}0\", z_n = -50e3 }}, {{ node = \"{name}1\", z_n = -100e3 }}"
        ));
    }
    format!(
        r#"
[structure.frame]
dimension = 3
node = [
    {},
    {{ name = "M0", at_m = [3.3, 2, 0], mass_kg = 10e3, rotary_mass_kg_m2 = 2e5, fixed = ["z", "rx", "ry"] }},
    {{ name = "M1", at_m = [3.3, 2, 3.5], mass_kg = 10e3, rotary_mass_kg_m2 = 2e5, fixed = ["z", "rx", "ry"] }},
]
member = [{}]
link = [{}]
load = [{}]
constraint = [
    {{ diaphragm = {{ master = "M0", nodes = ["A0", "B0", "C0", "D0"] }} }},
    {{ diaphragm = {{ master = "M1", nodes = ["A1", "B1", "C1", "D1"] }} }},
]
[structure.frame.section]
s.i_shape = {{ young_pa = 2e11, depth_m = 0.3, flange_width_m = 0.3, flange_thickness_m = 0.019, web_thickness_m = 0.011 }}
{}"#,
        nodes.join(", "),
        members.join(", "),
        links.join(", "),
        loads.join(", "),
        in_two_directions(&motion(4.0, 2), 3.0)
    )
}

/// A slender mast under its weight, which swings by a tenth of its height.
fn mast(dimension: usize) -> String {
    let at = |z: f64| match dimension {
        3 => format!("[0, 0, {z}]"),
        _ => format!("[0, {z}]"),
    };
    let (fixed, weight) = match dimension {
        3 => ("\"x\", \"y\", \"z\", \"rx\", \"ry\", \"rz\"", "z_n"),
        _ => ("\"x\", \"y\", \"rz\"", "y_n"),
    };
    let mut nodes = vec![format!(
        "{{ name = \"n0\", at_m = {}, fixed = [{fixed}] }}",
        at(0.0)
    )];
    let mut members = Vec::new();
    for k in 1..=3 {
        let mass = if k == 3 { 500 } else { 100 };
        nodes.push(format!(
            "{{ name = \"n{k}\", at_m = {}, mass_kg = {mass} }}",
            at(f64::from(k))
        ));
        members.push(format!(
            "{{ nodes = [\"n{}\", \"n{k}\"], section = \"s\", corotational = {{ largest_rotation_rad = 0.2, largest_tension_n = 2e4 }} }}",
            k - 1
        ));
    }
    let motion = motion(6.0, 2).replace(
        &format!("rate_hz = {RATE}"),
        &format!("rate_hz = {}", 4 * RATE),
    );
    let motion = match dimension {
        3 => in_two_directions(&motion, 8.0),
        _ => motion,
    };
    format!(
        r#"
[structure.frame]
dimension = {dimension}
node = [{}]
member = [{}]
load = [{{ node = "n3", {weight} = -5e3 }}]
[structure.frame.section]
s.rectangle = {{ young_pa = 2e11, width_m = 0.1, depth_m = 0.05 }}
{motion}"#,
        nodes.join(", "),
        members.join(", ")
    )
}

/// A storey of 6 m by 4 m in space under a rigid floor, askew to the two components of the motion, with its mass beside its centre: it
/// twists.
fn in_space([column, beam]: [&str; 2], amplitude: f64) -> String {
    let turn = |x: f64, y: f64| format!("{}, {}", 0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
    let corners = [
        ("A", 0.0, 0.0),
        ("B", 6.0, 0.0),
        ("C", 6.0, 4.0),
        ("D", 0.0, 4.0),
    ];
    let (mut nodes, mut members, mut loads) = (Vec::new(), Vec::new(), Vec::new());
    for (k, (name, x, y)) in corners.into_iter().enumerate() {
        let (at, next) = (turn(x, y), corners[(k + 1) % 4].0);
        nodes.push(format!(
            "{{ name = \"{name}0\", at_m = [{at}, 0], fixed = [\"x\", \"y\", \"z\", \"rx\", \"ry\", \"rz\"] }}"
        ));
        nodes.push(format!("{{ name = \"{name}1\", at_m = [{at}, 3.5] }}"));
        members.push(format!(
            "{{ nodes = [\"{name}0\", \"{name}1\"], section = \"column\", orientation = [0.8, 0.6, 0], {column} }}"
        ));
        members.push(format!(
            "{{ nodes = [\"{name}1\", \"{next}1\"], section = \"beam\", {beam} }}"
        ));
        loads.push(format!("{{ node = \"{name}1\", z_n = -150e3 }}"));
    }
    format!(
        r#"
[structure.frame]
dimension = 3
node = [
    {},
    {{ name = "M", at_m = [{}, 3.5], mass_kg = 60e3, rotary_mass_kg_m2 = 3e5, fixed = ["z", "rx", "ry"] }},
]
member = [{}]
load = [{}]
constraint = [{{ diaphragm = {{ master = "M", nodes = ["A1", "B1", "C1", "D1"] }} }}]
{STEEL}
{}"#,
        nodes.join(", "),
        turn(3.6, 2.4),
        members.join(", "),
        loads.join(", "),
        in_two_directions(&motion(amplitude, 2), 0.6 * amplitude)
    )
}

/// The study of three storeys under a motion near its first frequency.
fn three_storeys() -> String {
    let mut test: toml::Table = include_str!("../../config/steel-frame.toml")
        .parse()
        .unwrap();
    let ours: toml::Table = motion(2.0, 6).replace("1.5", "0.8").parse().unwrap();
    test["structure"]["damping"] = ours["structure"]["damping"].clone();
    for key in ["time", "excitation"] {
        test[key] = ours[key].clone();
    }
    test.to_string()
}

/// Displacements of our run, and the forces of its recorded members: one row for each step.
fn ours(folder: &Path, file: &Path, name: &str) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let (run, csv) = (folder.join(name), folder.join(format!("{name}.csv")));
    let word = |path: &Path| path.to_str().unwrap().to_owned();
    let made = Peer::gusset(&["run", &word(file), "--out", &word(&run)]);
    let (status, said) = made.end();
    assert!(status.success(), "{name}: {said:#?}");
    let export = Peer::gusset(&[
        "export",
        &word(&run),
        "--no-units-line",
        "--out",
        &word(&csv),
    ]);
    let (status, said) = export.end();
    assert!(status.success(), "{said:#?}");
    let text = std::fs::read_to_string(csv).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|column| *column == name);
    let places: Vec<usize> = (1..).map_while(|dof| column(&format!("x{dof}"))).collect();
    // The names of the three forces begin like this, and a link has only the first.
    let kinds = ["member_force_", "moment_", "weak_moment_", "torque_"];
    let of_member = |name: &str| kinds.iter().any(|kind| name.starts_with(kind));
    let forces = (0..head.len()).filter(|at| of_member(head[*at]));
    let forces: Vec<usize> = forces.collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let numbers = |places: &[usize]| {
        let row = |cells: &Vec<&str>| {
            places
                .iter()
                .map(|at| cells[*at].parse().unwrap())
                .collect()
        };
        rows.iter().map(row).collect()
    };
    (numbers(&places), numbers(&forces))
}

/// Root of the mean square of these numbers.
fn rms(numbers: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = numbers.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x * x));
    f64::sqrt(sum / count)
}

/// Root mean square of the difference of two courses, in parts of a size.
fn error(ours: &[Vec<f64>], column: usize, theirs: &[f64], size: f64) -> f64 {
    let off = ours
        .iter()
        .zip(theirs)
        .map(|(row, theirs)| row[column] - theirs);
    rms(off) / size
}

/// The test with the forces of every member that has its own in the record.
fn recorded(test: &str) -> toml::Table {
    let mut test: toml::Table = test.parse().unwrap();
    let members = test["structure"]["frame"]["member"].as_array_mut().unwrap();
    for member in members {
        let member = member.as_table_mut().unwrap();
        let is_elastic = member
            .get("kind")
            .is_none_or(|kind| kind.as_str() == Some("elastic"));
        let hinged = ["hinge_start", "hinge_end", "corotational"]
            .iter()
            .any(|key| member.contains_key(*key));
        member.insert("record".into(), (!is_elastic || hinged).into());
    }
    test
}

#[test]
fn frames_move_as_in_opensees() {
    let Some(python) = python() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for (name, text, most) in frames() {
        let file = folder.path().join(format!("{name}.toml"));
        let test = recorded(&text);
        std::fs::write(&file, test.to_string()).unwrap();
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/opensees/frame.py");
        let said = Command::new(&python)
            .arg(script)
            .arg(&file)
            .arg(SUBSTEPS)
            .output()
            .unwrap();
        let line = String::from_utf8_lossy(&said.stdout).into_owned();
        let theirs: Value = serde_json::from_str(line.lines().last().unwrap_or_default())
            .unwrap_or_else(|_| panic!("{name}: {line}{}", String::from_utf8_lossy(&said.stderr)));
        let (rows, forces) = ours(folder.path(), &file, name);
        let frame: FrameSpec = test["structure"]["frame"].clone().try_into().unwrap();
        let places = frame.places();
        assert!(rows.len() > 1000, "{name}: {}", rows.len());
        let mut worst = (0.0, String::new());
        for (dof, (node, direction)) in places.iter().enumerate() {
            // OpenSees adds up increments of rotations there; ours are rotation vectors.
            if name == "space, corotational" && direction.turns() {
                continue;
            }
            let column = (frame.directions().iter().position(|d| d == direction)).unwrap();
            let theirs = theirs["course"][node].as_array().unwrap();
            let theirs = theirs.iter().map(|row| row[column].as_f64().unwrap());
            let theirs: Vec<f64> = theirs.collect();
            // Some directions do not move.
            let size = rms(theirs.iter().copied()).max(1e-7);
            let error = error(&rows, dof, &theirs, size);
            if error > worst.0 {
                worst = (error, format!("{node} {}", direction.word()));
            }
        }
        assert!(worst.0 < most, "{name}, {}: {:e}", worst.1, worst.0);
        // Axial force and moments at both ends, member after member. A force that is nearly none is compared with the largest of its kind.
        let count = if frame.dimension == 3 { 6 } else { 3 };
        let theirs = theirs["forces"].as_array().unwrap();
        let theirs = theirs.iter().flat_map(|member| {
            let member = member.as_array().unwrap();
            let course = |k: usize| member.iter().map(move |row| row[k].as_f64().unwrap());
            (0..count)
                .map(|k| course(k).collect::<Vec<f64>>())
                .collect::<Vec<_>>()
        });
        let theirs: Vec<Vec<f64>> = theirs.collect();
        let size = |is_moment: bool| {
            let alike = theirs
                .iter()
                .enumerate()
                .filter(|(k, _)| (k % count > 0) == is_moment);
            alike
                .map(|(_, course)| rms(course.iter().copied()))
                .fold(0.0, f64::max)
        };
        let (axial, moment) = (size(false), size(true));
        for (k, theirs) in theirs.iter().enumerate() {
            let size = if k % count > 0 { moment } else { axial };
            let error = error(&forces, k, theirs, size);
            assert!(error < most.max(1e-2), "{name}, force {k}: {error:e}");
        }
    }
}
