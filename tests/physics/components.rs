//! Several components of a ground acceleration, against the matrix exponential of a building with torsion.

use crate::common::engine::{Run, distance, run};
use crate::common::test_file::TestFile;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

const OMEGA: [f64; 2] = [9.0, 5.5];
const AMPLITUDE: [f64; 2] = [2.0, 1.4];
/// The second component begins here.
const DELAY: f64 = 0.5;
const DURATION: f64 = 3.0;

/// Storey with its floor as a rigid plate: mass and inertia, and springs that are eccentric in x and y.
fn matrices() -> [Matrix3<f64>; 3] {
    let (kx, ky, turn, [ex, ey]) = (4e5, 6e5, 3.5e6, [0.6, -0.4]);
    let mass = Matrix3::from_diagonal(&Vector3::new(4e3, 4e3, 2.6e4));
    let stiffness = Matrix3::new(
        kx,
        0.0,
        -kx * ey,
        0.0,
        ky,
        ky * ex,
        -kx * ey,
        ky * ex,
        turn + kx * ey * ey + ky * ex * ex,
    );
    [mass, mass * 0.3 + stiffness * 1e-3, stiffness]
}

fn rows(matrix: &Matrix3<f64>) -> String {
    let row = |i: usize| format!("{:?}", [0, 1, 2].map(|j| matrix[(i, j)]));
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}

/// The building under both components, with more keys.
fn building(rate: u32, more: &str) -> String {
    let [mass, damping, stiffness] = matrices().map(|matrix| rows(&matrix));
    let components = [0, 1].map(|i| {
        let (direction, influence) = [("x", "[1, 0, 0]"), ("y", "[0, 1, 0]")][i];
        format!(
            "[[excitation.ground_acceleration]]\ndirection = \"{direction}\"\ninfluence = {influence}\ndelay_s = {}\n\
             signal.sine = {{ amplitude = {}, angular_frequency_rad_per_s = {} }}\n",
            DELAY * i as f64, AMPLITUDE[i], OMEGA[i]
        )
    });
    let text = format!(
        "[time]\nrate_hz = {rate}\nduration_s = {DURATION}\n[integrator]\nlambda = 4\nstart = \"second-order\"\n\
         [structure.matrices]\nmass = {mass}\ndamping = {damping}\nstiffness = {stiffness}\n{}",
        components.concat()
    );
    match more {
        "" => text,
        more => text.with(more),
    }
}

/// Displacements every 1/128 s, by the exponential of the whole linear system, the sines included.
fn exact(degrees: f64) -> [Vec<f64>; 3] {
    let [mass, damping, stiffness] = matrices();
    let inverse = mass.try_inverse().unwrap();
    let (sine, cosine) = libm::sincos(degrees.to_radians());
    // x, v, and (sin, cos) of each component.
    let mut system = DMatrix::<f64>::zeros(10, 10);
    system.view_mut((0, 3), (3, 3)).fill_with_identity();
    system
        .view_mut((3, 0), (3, 3))
        .copy_from(&(-inverse * stiffness));
    system
        .view_mut((3, 3), (3, 3))
        .copy_from(&(-inverse * damping));
    for (i, along) in [[cosine, sine], [-sine, cosine]].into_iter().enumerate() {
        let at = 6 + 2 * i;
        system[(at, at + 1)] = OMEGA[i];
        system[(at + 1, at)] = -OMEGA[i];
        for (row, share) in along.into_iter().enumerate() {
            system[(3 + row, at)] = -AMPLITUDE[i] * share;
        }
    }
    let step = (system / 128.0).exp();
    let mut state = DVector::<f64>::zeros(10);
    state[7] = 1.0;
    let mut found = [const { Vec::new() }; 3];
    for i in 0..=(DURATION * 128.0) as usize {
        if i == (DELAY * 128.0) as usize {
            state[9] = 1.0;
        }
        for (dof, found) in found.iter_mut().enumerate() {
            found.push(state[dof]);
        }
        state = &step * state;
    }
    found
}

/// Largest difference of all degrees of freedom to the exponential, each over its peak.
fn error(rate: u32, degrees: f64) -> f64 {
    let angle = format!("excitation.incident_angle_deg = {degrees:?}");
    let run = run(&building(rate, &angle));
    let every = (rate / 128) as usize;
    let each = exact(degrees).into_iter().zip(1..);
    let each = each.map(|(exact, dof)| {
        let all = run.column(&format!("x{dof}")).into_iter();
        distance(&all.step_by(every).collect::<Vec<f64>>(), &exact)
    });
    each.fold(0.0, f64::max)
}

#[test]
fn two_components_converge_to_the_exponential() {
    for degrees in [0.0, 30.0] {
        let [coarse, middle, fine] = [256, 512, 1024].map(|rate| error(rate, degrees));
        for ratio in [coarse / middle, middle / fine] {
            assert!(
                (3.9..4.1).contains(&ratio),
                "{coarse:e} {middle:e} {fine:e}"
            );
        }
    }
    let finest = error(32768, 30.0);
    assert!(finest < 1e-6, "{finest:e}");
}

#[test]
fn columns_hold_the_turned_components() {
    let text = building(128, "excitation.incident_angle_deg = 90.0");
    let (turned, plain) = (run(&text), run(&building(128, "")));
    let of = |run: &Run, name: &str| run.column(name);
    // A quarter of a turn: x' = −y, y' = x.
    let (x, y) = (of(&turned, "ground_x"), of(&turned, "ground_y"));
    assert!(distance(&y, &of(&plain, "ground_x")) < 1e-15);
    let negative: Vec<f64> = of(&plain, "ground_y").iter().map(|a| -a).collect();
    assert!(distance(&x, &negative) < 1e-15);
    let late = of(&plain, "ground_y");
    assert_eq!(late[..=64], [0.0; 65]);
    assert!((late[65] - AMPLITUDE[1] * libm::sin(OMEGA[1] / 128.0)).abs() < 1e-14);
    assert!(!plain.columns.iter().any(|column| column.name == "ground"));
}

#[test]
fn list_of_one_has_the_bits_of_a_table() {
    let one = "[time]\nrate_hz = 128\nduration_s = 2\n[structure.shear_building]\nmass_kg = [2e3, 3e3]\n\
               stiffness_n_per_m = [1e5, 4e5]\n[[excitation.ground_acceleration]]\nsignal.sine = { amplitude = 3, frequency_hz = 1.3 }\n";
    let table = one.replace(
        "[[excitation.ground_acceleration]]",
        "[excitation.ground_acceleration]",
    );
    let (list, table) = (run(one), run(&table));
    assert_eq!(list.rows.len(), table.rows.len());
    for name in ["ground", "x1", "x2", "a2"] {
        assert_eq!(list.column(name), table.column(name), "{name}");
    }
    // Two halves of one motion add up to it.
    let half = one.replace("amplitude = 3", "amplitude = 1.5");
    let half = half.replace("signal.sine", "influence = [1, 1]\nsignal.sine");
    let again = half.split_once("[[").unwrap().1.to_owned();
    let both = run(&format!("{half}[[{again}"));
    assert!(distance(&both.column("x2"), &table.column("x2")) < 1e-13);
    assert_eq!(both.column("ground_1"), both.column("ground_2"));
}

/// A portal with masses in x and y: each direction has the influence vector of the nodes.
#[test]
fn frame_knows_its_directions() {
    let frame = |components: &str| {
        run(&format!(
            "[time]\nrate_hz = 1024\nduration_s = 1\n[structure.frame]\n\
             node = [{{ name = \"A\", at_m = [0, 0], fixed = [\"x\", \"y\", \"rz\"] }}, \
             {{ name = \"B\", at_m = [0, 3], mass_kg = 2000 }}, {{ name = \"C\", at_m = [4, 3], mass_kg = 1000 }}, \
             {{ name = \"D\", at_m = [4, 0], fixed = [\"x\", \"y\"] }}]\n\
             member = [{{ nodes = [\"A\", \"B\"], section = \"s\" }}, {{ nodes = [\"B\", \"C\"], section = \"s\" }}, \
             {{ nodes = [\"C\", \"D\"], section = \"s\" }}]\n\
             section.s.elastic = {{ young_pa = 2.1e11, area_m2 = 4e-3, inertia_m4 = 4e-5 }}\n{components}"
        ))
    };
    let sine = "signal.sine = { amplitude = 2.0, frequency_hz = 3.0 }";
    let of = |keys: &str| format!("[[excitation.ground_acceleration]]\n{keys}\n{sine}\n");
    // B x, B y, B rz, C x, C y, C rz, D rz.
    for (direction, influence) in [
        ("x", "[1, 0, 0, 1, 0, 0, 0]"),
        ("y", "[0, 1, 0, 0, 1, 0, 0]"),
    ] {
        let named = frame(&of(&format!("direction = \"{direction}\"")));
        let given = frame(&of(&format!("influence = {influence}")));
        for name in ["x1", "x2", "x5", "ground"] {
            assert_eq!(named.column(name), given.column(name), "{direction} {name}");
        }
    }
    let plain = frame(&of("").replace("[[", "[").replace("]]", "]"));
    let along = frame(&of("direction = \"x\""));
    assert_eq!(plain.column("x4"), along.column("x4"));
    let both = frame(&(of("direction = \"x\"") + &of("direction = \"y\"")));
    let upwards = frame(&of("direction = \"y\""));
    let sum: Vec<f64> = along
        .column("x5")
        .iter()
        .zip(upwards.column("x5"))
        .map(|(a, b)| a + b)
        .collect();
    assert!(distance(&both.column("x5"), &sum) < 1e-12);
}
