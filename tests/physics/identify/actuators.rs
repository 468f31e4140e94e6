//! Specimens with several coupled axes: a platform held by actuators, and a law between the axes themselves. One axis moves at a
//! time, the others are held, and the forces of all of them are one column of the stiffness.

use std::path::{Path, PathBuf};

use gusset_record::Run;
use serde_json::Value;

use super::command::{best, folder, identified, near};
use crate::common::{json, say, write};
use crate::link_common::Served;

/// Pins on the frame and on the platform, as in tests/physics/geometry.rs.
const PINS: [([f64; 2], [f64; 2]); 3] = [
    ([-1.6, 0.1], [-0.4, 0.15]),
    ([-0.5, -1.2], [-0.5, -0.1]),
    ([0.6, -1.3], [0.5, -0.1]),
];
/// Stiffness and damping of the platform's coordinates.
const K: [[f64; 3]; 3] = [[1.2e6, 0.0, 0.9e6], [0.0, 2e6, 0.0], [0.9e6, 0.0, 9e5]];
const C: [[f64; 3]; 3] = [[3e3, 0.0, 0.0], [0.0, 5e3, 1e3], [0.0, 1e3, 2e3]];
/// sign · scale of each actuator.
const GEARS: [f64; 3] = [1.0, -2.0, 1.0];
const DELAY: f64 = 0.011;
const AMPLITUDE: f64 = 1e-3;

/// Rows (eₓ, e_y, a × e): strokes per coordinate.
fn jacobian() -> [[f64; 3]; 3] {
    PINS.map(|(base, joint)| {
        let span = [joint[0] - base[0], joint[1] - base[1]];
        let length = libm::hypot(span[0], span[1]);
        let [x, y] = span.map(|value| value / length);
        [x, y, joint[0] * y - joint[1] * x]
    })
}

/// The inverse by cofactors.
fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |i: usize, j: usize| {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i) / determinant))
}

/// Tᵀ M T.
fn seen(m: [[f64; 3]; 3], t: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let entry = |i: usize, j: usize| {
        let each = (0..9).map(|n| (n / 3, n % 3));
        each.map(|(a, b)| t[a][i] * m[a][b] * t[b][j]).sum()
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// The matrix at the actuators, in the signs and units of their axes.
fn at_axes(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let m = seen(m, inverse(jacobian()));
    std::array::from_fn(|i| std::array::from_fn(|j| m[i][j] / (GEARS[i] * GEARS[j])))
}

fn platform(exact: bool) -> String {
    let pins =
        PINS.map(|(b, j)| format!("{{ base_m = {b:?}, joint_m = {j:?}, length_m = [1.0, 1.5] }}"));
    format!(
        "[[specimen]]
name = \"column\"
geometry = {{ exact = {exact}, plane = [{}] }}
stiffness_n_per_m = {K:?}
damping_n_s_per_m = {C:?}
axis = [{{}}, {{ scale = 2, sign = -1, unit_disp = \"mm\", unit_force = \"kN\", offset_m = 0.02 }}, {{}}]
limits.measured_force_n = {{ trip = [-1e5, 1e5] }}
",
        pins.join(", ")
    )
}

fn behind_delay(seed: u32) -> String {
    format!(
        "coupled = {{ stiffness_n_per_m = {K:?}, damping_n_s_per_m = {C:?} }}
transfer = {{ delay_s = {DELAY}, seed = {seed}, disp_sensor = {{ noise_rms_m = 1e-6 }}, force_sensor = {{ noise_rms_n = 3.0 }} }}
"
    )
}

/// A column on top of which a structure would stand.
fn frame() -> &'static str {
    "title = \"unit\"\n[time]\nrate_hz = 512\nduration_s = 1\nclock = \"simulated\"\n"
}

const PRESCRIBED: &str = "[[excitation.prescribed_displacement]]\nspecimen = \"column\"\naxis = 3\n\
                          signal.sine = { amplitude = 0.001, frequency_hz = 1 }\n";

fn test(exact: bool) -> String {
    format!(
        "{}{PRESCRIBED}{}{}",
        frame(),
        platform(exact),
        behind_delay(4)
    )
}

const MOTION: [&str; 6] = [
    "--duration",
    "6",
    "--band",
    "0.5,12",
    "--amplitude",
    "0.001",
];

/// Number and standard error of the force of axis `i` (from 0) while `j` moved.
fn entry(found: &Value, i: usize, j: usize, key: &str) -> (f64, f64) {
    let axis = &found["axes"][j];
    let of = if i == j {
        &axis["identification"]["specimen"]
    } else {
        let felt = axis["felt_by"].as_array().unwrap();
        let felt = felt.iter().find(|felt| felt["axis"] == i + 1);
        felt.unwrap_or_else(|| panic!("{} does not feel {}: {axis:#}", i + 1, j + 1))
    };
    let number = |what: &str| of[key][what].as_f64().unwrap();
    (number("value"), number("std"))
}

/// k̂, ĉ and the delay of every actuator come back within five standard errors, and within `share` of the largest stiffness.
fn assert_column(found: &Value, share: f64) {
    let (k, c) = (at_axes(K), at_axes(C));
    let largest = k.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    for j in 0..3 {
        near(best(found, j, "delay_s"), DELAY);
        for i in 0..3 {
            let (value, std) = entry(found, i, j, "stiffness");
            let allowed = 5.0 * std + share * largest;
            assert!(
                (value - k[i][j]).abs() < allowed && std < 0.01 * largest,
                "k {i} {j}: {value} ± {std}, wanted {}",
                k[i][j]
            );
            let (value, std) = entry(found, i, j, "damping");
            // The nonlinear geometry matters up to 12 Hz.
            let allowed = 5.0 * std + share * largest / (std::f64::consts::TAU * 12.0);
            assert!(
                (value - c[i][j]).abs() < allowed,
                "c {i} {j}: {value} ± {std}, wanted {}",
                c[i][j]
            );
        }
    }
}

/// While one moves all others keep their position.
fn assert_one_at_a_time(out: &Path) {
    let run = Run::open(out).unwrap();
    let columns = run.columns(&["cmd_1_1", "cmd_1_2", "cmd_1_3"]).unwrap();
    // The second one counts in millimetres from its offset, twice and the other way.
    let at = |axis: usize, i: usize| match axis {
        1 => (columns[1][i] - 20.0) / 1e3,
        _ => columns[axis][i],
    };
    let mut peaks = [0.0_f64; 3];
    for i in 0..columns[0].len() {
        let now = [0, 1, 2].map(|axis| at(axis, i).abs());
        // Roundoff of lengths of 2 m, as millimetres.
        let moving = now.iter().filter(|way| **way > 1e-13).count();
        assert!(moving <= 1, "row {i}: {now:?}");
        for (peak, now) in peaks.iter_mut().zip(now) {
            *peak = peak.max(now);
        }
    }
    for peak in peaks {
        assert!((peak / AMPLITUDE - 1.0).abs() < 1e-9, "{peak}");
    }
}

/// With small displacements everything is linear, and all that is between found and true is noise.
#[test]
fn every_platform_actuator_is_identified() {
    let (_keep, folder) = folder();
    let out = folder.join("out");
    let found = identified(&write(&folder, "test.toml", &test(false)), &out, &MOTION);
    assert_column(&found, 0.0);
    assert_one_at_a_time(&out);
    let metrics = &json(&out, "summary.json")["metrics"]["column"];
    // The correlation knows the delay to a share of the tick of 1.95 ms.
    for axis in metrics.as_array().unwrap() {
        let delay = axis["lag_s"]["value"].as_f64().unwrap();
        assert!((delay - DELAY).abs() < 1e-3, "{axis}");
    }
    assert_eq!(metrics.as_array().unwrap().len(), 3);
}

/// Exact strokes are curved: a stroke of A turns the lines of action by A / L, so that forces change by that share, L ≥ 1.1 m. Half
/// of the motion is on either side of zero, and the mean curvature over a sweep is below its peak.
#[test]
fn exact_actuators_are_found_nearly() {
    let (_keep, folder) = folder();
    let out = folder.join("out");
    let found = identified(&write(&folder, "test.toml", &test(true)), &out, &MOTION);
    assert_column(&found, AMPLITUDE / 1.1);
    assert_one_at_a_time(&out);
    // The twin knows the platform, whatever the signs and units of its actuators.
    let twin = out.join("identified.toml");
    let said = say(["check", twin.to_str().unwrap()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let text = std::fs::read_to_string(&twin).unwrap();
    let table: toml::Table = text.parse().unwrap();
    let specimen = &table["specimen"][0];
    let number = |value: &toml::Value| value.as_float().unwrap();
    for places in [
        &specimen["stiffness_n_per_m"],
        &specimen["coupled"]["stiffness_n_per_m"],
    ] {
        for i in 0..3 {
            for j in 0..3 {
                let value = number(&places[i][j]);
                // Noise of 3 N on 1 mm over 3072 samples: 80 N/m, times three from the strokes to the coordinates.
                assert!((value - K[i][j]).abs() < 3e3, "{i} {j}: {value}");
            }
        }
    }
    let again = identified(&twin, &folder.join("again"), &MOTION);
    assert_column(&again, AMPLITUDE / 1.1);
}

#[test]
fn served_actuators_are_identified() {
    for transport in ["tcp", "udp"] {
        let (_keep, folder) = folder();
        let served = format!("{}{}[serve]\n", platform(true), behind_delay(9));
        let server = Served::start(&folder, &served, &["--transport", transport]);
        let linked = format!(
            "{}{PRESCRIBED}{}limits.command_disp_m = {{ trip = [-0.1, 0.1] }}\nlink = {{ address = \"{}\", transport = \"{transport}\" }}\n",
            frame(),
            platform(true),
            server.address
        );
        let out = folder.join("out");
        let found = identified(&write(&folder, "linked.toml", &linked), &out, &MOTION);
        assert_column(&found, AMPLITUDE / 1.1);
        let twin: PathBuf = out.join("identified.toml");
        let said = say(["check", twin.to_str().unwrap()]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
    }
}

/// Without limits the strokes are a twentieth of the available lengths, at the axis that counts double.
#[test]
fn actuators_share_the_remaining_length() {
    let (_keep, folder) = folder();
    let out = folder.join("out");
    let found = identified(
        &write(&folder, "test.toml", &test(true)),
        &out,
        &["--duration", "6", "--band", "0.5,12"],
    );
    for (index, (base, joint)) in PINS.iter().enumerate() {
        let length = libm::hypot(joint[0] - base[0], joint[1] - base[1]);
        let way = (length - 1.0).min(1.5 - length) * GEARS[index].abs();
        let amplitude = found["axes"][index]["amplitude_m"].as_f64().unwrap();
        // Two digits, rounded down.
        let share = amplitude / (0.05 * way);
        assert!(share > 0.9 && share <= 1.0 + 1e-12, "{amplitude} of {way}");
    }
}

const COUPLED: [[f64; 2]; 2] = [[3e6, -1e6], [-1e6, 2e6]];

/// Coupled axes without a geometry, at a model scale and with a lever.
#[test]
fn coupled_law_is_found_with_its_coupling() {
    let (_keep, folder) = folder();
    let text = format!(
        "{}[structure.shear_building]
mass_kg = [1000.0, 900.0]
stiffness_n_per_m = [1e5, 4e5]
[structure]
initial_displacement_m = [0.001, 0.0]
[[specimen]]
name = \"table\"
rows = [[1, 0], [0, 1]]
similitude = {{ length = 4, force = 16, time = 2 }}
coupled = {{ stiffness_n_per_m = {COUPLED:?}, damping_n_s_per_m = [[2e3, 0.0], [0.0, 3e3]] }}
axis = [{{ scale = 2, sign = -1 }}, {{}}]
limits.command_disp_m = {{ trip = [-0.05, 0.05] }}
transfer = {{ delay_s = {DELAY}, seed = 2, disp_sensor = {{ noise_rms_m = 1e-6 }}, force_sensor = {{ noise_rms_n = 3.0 }} }}
",
        frame()
    );
    let out = folder.join("out");
    let found = identified(&write(&folder, "test.toml", &text), &out, &MOTION);
    for (i, row) in COUPLED.iter().enumerate() {
        for (j, wanted) in row.iter().enumerate() {
            near(entry(&found, i, j, "stiffness"), *wanted);
        }
    }
    let twin = std::fs::read_to_string(out.join("identified.toml")).unwrap();
    let table: toml::Table = twin.parse().unwrap();
    let specimen = &table["specimen"][0];
    // f_s = 16 g f and d = g d_s / 4 with g = −2 and 1.
    let share = |i: usize| [-2.0, 1.0][i];
    for i in 0..2 {
        for j in 0..2 {
            let law = specimen["coupled"]["stiffness_n_per_m"][i][j].as_float();
            let seen = specimen["stiffness_n_per_m"][i][j].as_float();
            let close = |found: Option<f64>, wanted: f64| {
                let found = found.unwrap();
                assert!((found / wanted - 1.0).abs() < 1e-3, "{found} {wanted}");
            };
            close(law, COUPLED[i][j]);
            close(seen, COUPLED[i][j] * share(i) * share(j) * 16.0 / 4.0);
        }
    }
    let said = say(["check", out.join("identified.toml").to_str().unwrap()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
}
