//! Corotational members against published solutions of large displacements.

use super::*;
use crate::model::{Base, Structure, StructureSpec};

fn structure(frame: FrameSpec) -> Structure {
    let spec = StructureSpec::Frame(frame);
    spec.build(None, &[], None, &Default::default()).unwrap()
}

/// Displacements under these loads of the degrees of freedom, by Newton's method in steps; none where the frame no longer stands.
fn settled(frame: &FrameSpec, load: &[f64], steps: u32) -> Option<Vec<f64>> {
    let mut structure = structure(frame.clone());
    let n = load.len();
    let mut x = vec![0.0; n];
    for part in 1..=steps {
        let share = f64::from(part) / f64::from(steps);
        for iteration in 0.. {
            let mut r: Vec<f64> = load.iter().map(|f| share * f).collect();
            structure.subtract_trial(&x, &vec![0.0; n], Base::default(), 0.0, &mut r);
            let mut factor = Spd::factor(&structure.tangent_stiffness()).ok()?;
            factor.solve_in_place(&mut r);
            x.iter_mut().zip(&r).for_each(|(x, by)| *x += by);
            let size = |v: &[f64]| v.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            if size(&r) < 1e-10 * size(&x) {
                break;
            }
            if iteration > 60 {
                return None;
            }
        }
        structure.commit();
    }
    Some(x)
}

fn of(model: &FrameModel, x: &[f64], node: &str, direction: Direction) -> f64 {
    let motion = model.motion(node, direction).unwrap();
    motion.iter().map(|(dof, share)| share * x[*dof]).sum()
}

/// A row of members through these places, clamped at the first.
fn row(places: &[Vec<f64>], section: &str, more: &str) -> FrameSpec {
    let dimension = places[0].len();
    let all = match dimension {
        3 => "'x', 'y', 'z', 'rx', 'ry', 'rz'",
        _ => "'x', 'y', 'rz'",
    };
    let node = |(k, at): (usize, &Vec<f64>)| match k {
        0 => format!("{{ name = 'n0', at_m = {at:?}, fixed = [{all}] }}"),
        _ => format!("{{ name = 'n{k}', at_m = {at:?}, mass_kg = 1 }}"),
    };
    let nodes: Vec<String> = places.iter().enumerate().map(node).collect();
    let member = |k: usize| {
        format!(
            "{{ nodes = ['n{}', 'n{k}'], section = 's', corotational = {{}}{more} }}",
            k - 1
        )
    };
    let members: Vec<String> = (1..places.len()).map(member).collect();
    toml::from_str(&format!(
        "dimension = {dimension}\nnode = [{}]\nmember = [{}]\nsection.s.{section}\n",
        nodes.join(", "),
        members.join(", ")
    ))
    .unwrap()
}

/// A cantilever under a load P across its first direction. Places of its end over its length, and its rotation (Mattiasson 1981,
/// Int. J. Numer. Methods Eng. 17, table I), for P L²/(E I).
const ELASTICA: [(f64, f64, f64, f64); 4] = [
    (1.0, 0.30172, 0.05643, 0.46135),
    (2.0, 0.49346, 0.16064, 0.78175),
    (5.0, 0.71379, 0.38763, 1.21537),
    (10.0, 0.81061, 0.55500, 1.43029),
];

#[test]
fn cantilever_is_the_elastica() {
    // A·L²/I is so large that it does not stretch.
    let section = "elastic = { young_pa = 1e6, area_m2 = 1e3, inertia_m4 = 1e-2, weak_inertia_m4 = 1e-2, torsion_m4 = 1e-2 }";
    let (length, ei) = (2.0, 1e4);
    let count = 32;
    for in_space in [false, true] {
        // In space along no axis: the load is across it.
        let (way, across) = match in_space {
            false => (vec![1.0, 0.0], vec![0.0, 1.0]),
            true => (vec![0.6, 0.0, 0.8], vec![0.0, 1.0, 0.0]),
        };
        let at = |k: usize| -> Vec<f64> {
            let share = length * k as f64 / f64::from(count);
            way.iter().map(|x| share * x).collect()
        };
        let places: Vec<_> = (0..=count as usize).map(at).collect();
        let frame = row(&places, section, "");
        let model = frame.model().unwrap();
        let tip = format!("n{count}");
        let mut load = vec![0.0; model.dofs.len()];
        let [(dof, _)] = model.motion(&tip, Direction::Y).unwrap() else {
            panic!("free");
        };
        let dof = *dof;
        for (p, w, u, turn) in ELASTICA {
            load[dof] = p * ei / (length * length);
            let x = settled(&frame, &load, 10).unwrap();
            let directions = [Direction::X, Direction::Y, Direction::Z];
            let disp: Vec<f64> = (directions.iter().take(way.len()))
                .map(|direction| of(&model, &x, &tip, *direction))
                .collect();
            let dot = |v: &[f64]| disp.iter().zip(v).map(|(a, b)| a * b).sum::<f64>() / length;
            let near = |found: f64, expected: f64| {
                assert!(
                    (found - expected).abs() < 1.5e-3,
                    "{in_space} {p}: {found} {expected}"
                );
            };
            near(dot(&across), w);
            near(-dot(&way), u);
            let turned = match in_space {
                false => of(&model, &x, &tip, Direction::Rz),
                // About way × across.
                true => {
                    0.6 * of(&model, &x, &tip, Direction::Rz)
                        - 0.8 * of(&model, &x, &tip, Direction::Rx)
                }
            };
            near(turned, turn);
        }
    }
}

/// A bend of 45° with a radius of 100 and a square section of 1 under a load of 600 out of its plane: its end goes from
/// (29.3, 70.7, 0) to (15.9, 47.2, 53.4) after Bathe & Bolourchi (1979, Int. J. Numer. Methods Eng. 14), and to (15.55, 47.04, 53.50) after Cardona & Geradin (1988,
/// Int. J. Numer. Methods Eng. 26).
#[test]
fn bend_of_45_degrees_leaves_its_plane() {
    let at = |k: usize| {
        let angle = std::f64::consts::FRAC_PI_4 * k as f64 / 8.0;
        vec![
            100.0 * (1.0 - libm::cos(angle)),
            100.0 * libm::sin(angle),
            0.0,
        ]
    };
    let places: Vec<_> = (0..=8).map(at).collect();
    // ν = 0: G J = E/2 · 0.1406.
    let section = "elastic = { young_pa = 1e7, area_m2 = 1.0, inertia_m4 = 0.08333333333, weak_inertia_m4 = 0.08333333333, torsion_m4 = 0.14058 }";
    let more = ", orientation = [0, 0, 1], torsion_n_m2 = 7.029e5";
    let frame = row(&places, section, more);
    let model = frame.model().unwrap();
    let mut load = vec![0.0; model.dofs.len()];
    let [(dof, _)] = model.motion("n8", Direction::Z).unwrap() else {
        panic!("free");
    };
    load[*dof] = 600.0;
    let x = settled(&frame, &load, 40).unwrap();
    let end = [Direction::X, Direction::Y, Direction::Z].map(|d| of(&model, &x, "n8", d));
    let found = [0, 1, 2].map(|k| places[8][k] + end[k]);
    for (found, wanted) in found.into_iter().zip([15.55, 47.04, 53.5]) {
        assert!((found - wanted).abs() < 0.15, "{found} {wanted}");
    }
}

/// Lee's frame: it stands up to the load 1.855 of its first turning point, and snaps there (Schweizerhof & Wriggers 1986, Comput. Methods
/// Appl. Mech. Eng. 59, 261–279).
#[test]
fn frame_of_lee_stands_up_to_its_snap() {
    let mut nodes = vec!["{ name = 'a', at_m = [0, 0], fixed = ['x', 'y'] }".to_owned()];
    let mut members = Vec::new();
    let mut last = "a".to_owned();
    let mut add = |name: String, x: f64, y: f64, more: &str| {
        nodes.push(format!("{{ name = '{name}', at_m = [{x}, {y}]{more} }}"));
        members.push(format!(
            "{{ nodes = ['{last}', '{name}'], section = 's', corotational = {{}} }}"
        ));
        last = name;
    };
    for k in 1..=10 {
        add(format!("c{k}"), 0.0, 12.0 * f64::from(k), ", mass_kg = 1");
    }
    for k in 1..=10 {
        let more = match k {
            10 => ", fixed = ['x', 'y']",
            _ => ", mass_kg = 1",
        };
        add(format!("b{k}"), 12.0 * f64::from(k), 120.0, more);
    }
    let frame: FrameSpec = toml::from_str(&format!(
        "node = [{}]\nmember = [{}]\nsection.s.elastic = {{ young_pa = 720, area_m2 = 6, inertia_m4 = 2 }}",
        nodes.join(", "),
        members.join(", ")
    ))
    .unwrap();
    let model = frame.model().unwrap();
    let mut load = vec![0.0; model.dofs.len()];
    let [(dof, _)] = model.motion("b2", Direction::Y).unwrap() else {
        panic!("free");
    };
    let mut under = |p: f64| {
        load[*dof] = -p;
        settled(&frame, &load, 60)
    };
    // The load moves by about 48 there, more than a third of a column.
    let x = under(1.8).unwrap();
    let fall = -of(&model, &x, "b2", Direction::Y);
    assert!((30.0..50.0).contains(&fall), "{fall}");
    assert!(under(1.9).is_none());
}

/// A member that turns or is pulled more than its user expects is named, with its largest tension and rotation.
#[test]
fn motion_beyond_the_declared_one_is_named() {
    let section = "elastic = { young_pa = 1e6, area_m2 = 1e-2, inertia_m4 = 1e-4 }";
    let found = |declared: &str, disp: [f64; 3]| -> Vec<[f64; 2]> {
        let mut frame = row(&[vec![0.0, 0.0], vec![1.0, 0.0]], section, "");
        frame.member[0].corotational = Some(toml::from_str(declared).unwrap());
        let mut structure = structure(frame);
        structure.subtract_trial(&disp, &[0.0; 3], Base::default(), 0.0, &mut [0.0; 3]);
        structure.commit();
        let members = structure.members();
        members.beyond_declared().map(|(_, most)| most).collect()
    };
    let declared = "largest_rotation_rad = 0.1\nlargest_tension_n = 1e2";
    let turned = |angle: f64| [libm::cos(angle) - 1.0, libm::sin(angle), angle];
    assert!(found(declared, turned(0.09)).is_empty());
    let [[tension, rotation]] = found(declared, turned(0.2))[..] else {
        panic!("it turns");
    };
    assert!(
        tension.abs() < 1e-6 && (rotation - 0.2).abs() < 1e-9,
        "{tension} {rotation}"
    );
    // 1e4 N/m times 2 cm.
    let [[tension, _]] = found(declared, [0.02, 0.0, 0.0])[..] else {
        panic!("it is pulled");
    };
    assert!((tension - 200.0).abs() < 1e-9, "{tension}");
    // Without a declared rotation nothing was promised.
    assert!(found("", turned(0.2)).is_empty());
}
