//! Frames in space against closed forms and against plane frames.

use super::*;
use crate::model::{Base, Structure, StructureSpec};
use gusset_quantity::state::{Stateful, TestState};

const YOUNG: f64 = 2e11;
const H: f64 = 3.0;
const W: f64 = 5.0;
const MATERIALS: &str = r#"
material.steel.menegotto_pinto = { young_pa = 2e11, yield_pa = 250e6, hardening_ratio = 0.02 }
section.fibres.rectangle = { material = "steel", width_m = 0.2, depth_m = 0.3 }
section.solid.rectangle = { young_pa = 2e11, width_m = 0.2, depth_m = 0.3 }
hinge.h.bilinear = { stiffness_n_per_m = 4e7, yield_force_n = 1e5, post_yield_ratio = 0.1 }
"#;

fn structure(frame: FrameSpec) -> Structure {
    let spec = StructureSpec::Frame(frame);
    spec.build(None, &[], None, &Default::default()).unwrap()
}

/// A portal of these columns: in the plane, or in space in the vertical plane of this angle.
fn portal(columns: &str, angle: Option<f64>) -> FrameSpec {
    let (c, s) = (
        libm::cos(angle.unwrap_or(0.0)),
        libm::sin(angle.unwrap_or(0.0)),
    );
    let at = |x: f64, y: f64| match angle {
        Some(_) => format!("[{}, {}, {y}]", 1.0 + x * c, 2.0 + x * s),
        None => format!("[{x}, {y}]"),
    };
    let (dimension, all, turned, load) = match angle {
        Some(_) => (
            3,
            "\"x\", \"y\", \"z\", \"rx\", \"ry\", \"rz\"",
            format!("orientation = [{c}, {s}, 0]"),
            format!("x_n = {}, y_n = {}, z_n = -3e5", c * 1e4, s * 1e4),
        ),
        None => (
            2,
            "\"x\", \"y\", \"rz\"",
            String::new(),
            "x_n = 1e4, y_n = -3e5".into(),
        ),
    };
    let comma = if turned.is_empty() { "" } else { ", " };
    toml::from_str(&format!(
        r#"
dimension = {dimension}
node = [{{ name = "a", at_m = {}, fixed = [{all}] }}, {{ name = "b", at_m = {}, fixed = [{all}] }},
        {{ name = "c", at_m = {}, mass_kg = 1e3 }}, {{ name = "d", at_m = {}, mass_kg = 1e3 }}]
member = [{{ nodes = ["a", "c"], {columns}{comma}{turned} }}, {{ nodes = ["b", "d"], {columns}{comma}{turned} }},
          {{ nodes = ["c", "d"], section = "solid" }}]
load = [{{ node = "c", {load} }}]
{MATERIALS}"#,
        at(0.0, 0.0),
        at(W, 0.0),
        at(0.0, H),
        at(W, H),
    ))
    .unwrap()
}

/// Displacements under the load and back to a third of it, in small steps.
fn settled_path(frame: FrameSpec, factor: f64) -> (FrameModel, Vec<Vec<f64>>) {
    let model = frame.model().unwrap();
    let n = model.dofs.len();
    let mut solver = Spd::factor(&model.stiffness).unwrap();
    let mut structure = structure(frame);
    let (mut x, mut found) = (vec![0.0; n], Vec::new());
    let ups = (1..=10).chain((3..10).rev());
    for part in ups {
        for _ in 0..300 {
            let mut r: Vec<f64> = (model.load.iter())
                .map(|load| load * factor * f64::from(part) / 10.0)
                .collect();
            structure.subtract_trial(&x, &vec![0.0; n], Base::default(), 0.0, &mut r);
            solver.solve_in_place(&mut r);
            x.iter_mut().zip(&r).for_each(|(x, by)| *x += by);
        }
        structure.commit();
        found.push(x.clone());
    }
    (model, found)
}

/// A portal in the plane and in any vertical plane: equal displacements while it yields, and none out of its plane.
#[test]
fn turned_plane_frames_are_equal() {
    for (columns, factor) in [
        ("section = \"solid\"", 1.0),
        ("section = \"solid\", p_delta = true", 1.0),
        ("section = \"solid\", hinge_start = \"h\"", 15.0),
        ("section = \"fibres\", kind = \"force_based\"", 15.0),
        ("section = \"fibres\", kind = \"displacement_based\"", 15.0),
    ] {
        let (model, plane) = settled_path(portal(columns, None), factor);
        let most = plane.iter().map(|x| x[0].abs()).fold(0.0, f64::max);
        for angle in [0.0, 0.6, 2.5] {
            let (c, s) = (libm::cos(angle), libm::sin(angle));
            let (space, found) = settled_path(portal(columns, Some(angle)), factor);
            let value = |model: &FrameModel, x: &[f64], node: &str, direction| {
                let motion = model.motion(node, direction).unwrap();
                motion
                    .iter()
                    .map(|(dof, share)| share * x[*dof])
                    .sum::<f64>()
            };
            for (plane, space_x) in plane.iter().zip(&found) {
                let near = |found: f64, expected: f64, what: &str| {
                    assert!(
                        (found - expected).abs() < 1e-7 * most,
                        "{columns}, {angle}, {what}: {found} {expected}"
                    );
                };
                for node in ["c", "d"] {
                    let at = |direction| value(&space, space_x, node, direction);
                    let [x, y] = [Direction::X, Direction::Y].map(at);
                    let [about_x, about_y] = [Direction::Rx, Direction::Ry].map(at);
                    let wanted = |direction| value(&model, plane, node, direction);
                    near(x * c + y * s, wanted(Direction::X), "x");
                    near(y * c - x * s, 0.0, "out of the plane");
                    near(at(Direction::Z), wanted(Direction::Y), "up");
                    near(about_x * s - about_y * c, wanted(Direction::Rz), "turn");
                    near(at(Direction::Rz), 0.0, "torsion");
                }
            }
        }
    }
}

/// P L³/(3 E I) about each axis, M L/(E I), T L/(G J) and P L/(E A), of a cantilever that leans, with a lever at its end.
#[test]
fn cantilever_in_space_has_its_closed_forms() {
    let way = [2.0, -1.0, 2.0];
    let orientation = [0.3, 0.8, -0.2];
    let unit = |v: [f64; 3]| {
        let l = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.map(|x| x / l)
    };
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let x = unit(way);
    let z = unit(cross(x, orientation));
    let y = cross(z, x);
    let (area, strong, weak) = (0.06, 0.2 * 0.027 / 12.0, 0.3 * 0.008 / 12.0);
    let (l, ei, weak) = (3.0, YOUNG * strong, YOUNG * weak);
    let t: f64 = 2.0 / 3.0;
    let j = 0.3 * 0.008 * (1.0 / 3.0 - 0.21 * t * (1.0 - t.powi(4) / 12.0));
    let gj = YOUNG / 2.6 * j;
    for kind in [
        "section = \"solid\"",
        "section = \"fibres\", kind = \"force_based\"",
    ] {
        // Sums of 20 layers and 8 fibres.
        let (ei, weak) = match kind.contains("based") {
            true => (ei * (1.0 - 1.0 / 400.0), weak * (1.0 - 1.0 / 64.0)),
            false => (ei, weak),
        };
        let tip = |force: [f64; 3], moment: [f64; 3]| {
            let spec: FrameSpec = toml::from_str(&format!(
                "dimension = 3\nnode = [{{ name = 'a', at_m = [1, 1, 1], fixed = ['x', 'y', 'z', 'rx', 'ry', 'rz'] }}, \
                 {{ name = 'b', at_m = [{}, {}, {}], mass_kg = 1 }}]\n\
                 member = [{{ nodes = ['a', 'b'], {kind}, orientation = {orientation:?} }}]\n\
                 load = [{{ node = 'b', x_n = {}, y_n = {}, z_n = {}, rx_n_m = {}, ry_n_m = {}, rz_n_m = {} }}]\n{MATERIALS}",
                1.0 + way[0], 1.0 + way[1], 1.0 + way[2],
                force[0], force[1], force[2], moment[0], moment[1], moment[2],
            ))
            .unwrap();
            let at = settled(&spec);
            let get = |all: [Direction; 3]| all.map(|direction| at("b", direction));
            (
                get([Direction::X, Direction::Y, Direction::Z]),
                get([Direction::Rx, Direction::Ry, Direction::Rz]),
            )
        };
        let none = [0.0; 3];
        let times = |v: [f64; 3], f: f64| v.map(|x| f * x);
        let (disp, turn) = tip(times(y, 1e4), none);
        assert_near(dot(disp, y), 1e4 * l * l * l / (3.0 * ei));
        assert_near(dot(turn, z), 1e4 * l * l / (2.0 * ei));
        assert!(dot(disp, z).abs() < 1e-12 && dot(turn, y).abs() < 1e-12);
        let (disp, turn) = tip(times(z, 1e4), none);
        assert_near(dot(disp, z), 1e4 * l * l * l / (3.0 * weak));
        assert_near(dot(turn, y), -1e4 * l * l / (2.0 * weak));
        let (disp, _) = tip(times(x, 1e5), none);
        assert_near(dot(disp, x), 1e5 * l / (YOUNG * area));
        let (disp, turn) = tip(none, times(x, 1e3));
        assert_near(dot(turn, x), 1e3 * l / gj);
        assert!(disp.iter().all(|u| u.abs() < 1e-12));
    }
}

/// An end that turns against a clamped one: 4 E I/L about both axes, and 3 E I/L if that one is released.
#[test]
fn released_end_turns_about_both_axes() {
    for (release, factor) in [("", 4.0), (", release = ['start']", 3.0)] {
        let spec: FrameSpec = toml::from_str(&format!(
            "dimension = 3\nnode = [{{ name = 'a', at_m = [0, 0, 0], fixed = ['x', 'y', 'z', 'rx', 'ry', 'rz'] }}, \
             {{ name = 'b', at_m = [{W}, 0, 0], mass_kg = 1, fixed = ['x', 'y', 'z', 'rx'] }}]\n\
             member = [{{ nodes = ['a', 'b'], section = 'solid'{release} }}]\n{MATERIALS}"
        ))
        .unwrap();
        let model = spec.model().unwrap();
        assert_near(
            model.stiffness.get(0, 0),
            factor * YOUNG * 0.2 * 0.027 / 12.0 / W,
        );
        assert_near(
            model.stiffness.get(1, 1),
            factor * YOUNG * 0.3 * 0.008 / 12.0 / W,
        );
    }
}

/// A storey of four columns clamped at both ends under a rigid floor: Σ 12 E I/h³ each way, and Σ (k_x y² + k_y x²) + Σ G J/h about z.
#[test]
fn rigid_floor_turns_with_its_columns() {
    let columns = [
        ("a", 0.0, 0.0),
        ("b", 6.0, 0.0),
        ("c", 6.0, 4.0),
        ("d", 0.0, 4.0),
    ];
    let (mut nodes, mut members) = (Vec::new(), Vec::new());
    for (name, x, y) in columns {
        nodes.push(format!("{{ name = '{name}0', at_m = [{x}, {y}, 0], fixed = ['x', 'y', 'z', 'rx', 'ry', 'rz'] }}"));
        nodes.push(format!(
            "{{ name = '{name}1', at_m = [{x}, {y}, {H}], fixed = ['z', 'rx', 'ry'] }}"
        ));
        members.push(format!(
            "{{ nodes = ['{name}0', '{name}1'], section = 'solid' }}"
        ));
    }
    nodes.push(format!(
        "{{ name = 'm', at_m = [3, 2, {H}], mass_kg = 2e4, rotary_mass_kg_m2 = 9e4, fixed = ['z', 'rx', 'ry'] }}"
    ));
    let spec: FrameSpec = toml::from_str(&format!(
        "dimension = 3\nnode = [{}]\nmember = [{}]\n\
         constraint = [{{ diaphragm = {{ master = 'm', nodes = ['a1', 'b1', 'c1', 'd1'] }} }}]\n{MATERIALS}",
        nodes.join(", "),
        members.join(", ")
    ))
    .unwrap();
    let model = spec.model().unwrap();
    let directions: Vec<_> = model.dofs.iter().map(|(_, direction)| *direction).collect();
    assert_eq!(directions, [Direction::X, Direction::Y, Direction::Rz]);
    // The depth of a column lies along x.
    let k = |inertia: f64| 12.0 * YOUNG * inertia / (H * H * H);
    let (kx, ky) = (k(0.2 * 0.027 / 12.0), k(0.3 * 0.008 / 12.0));
    assert_near(model.stiffness.get(0, 0), 4.0 * kx);
    assert_near(model.stiffness.get(1, 1), 4.0 * ky);
    let gj = super::section("rectangle = { young_pa = 2e11, width_m = 0.2, depth_m = 0.3 }");
    let torsion = gj.unwrap().rigidity().unwrap().torsion;
    let turning = 4.0 * (kx * 4.0 + ky * 9.0) + 4.0 * torsion / H;
    assert_near(model.stiffness.get(2, 2), turning);
    assert!(model.stiffness.get(0, 2).abs() < 1e-6 * turning);
    assert_near(model.mass.get(2, 2), 9e4);
    // A master at a corner carries the coupling.
    let mut corner = spec.clone();
    corner.node[8].at_m = vec![0.0, 0.0, H];
    let model = corner.model().unwrap();
    assert_near(model.stiffness.get(0, 2), -4.0 * kx * 2.0);
    assert_near(model.stiffness.get(1, 2), 4.0 * ky * 3.0);
}

/// A step in space allocates nothing, and a restored state goes the same way to the last bit.
#[test]
fn restored_space_frame_has_equal_bits() {
    for columns in [
        "section = \"solid\", hinge_start = \"h\"",
        "section = \"fibres\", kind = \"force_based\"",
        "section = \"fibres\", kind = \"displacement_based\"",
    ] {
        let mut one = structure(portal(columns, Some(0.4)));
        let n = portal(columns, Some(0.4)).places().len();
        let run = |structure: &mut Structure, from: u32, r: &mut [f64], x: &mut [f64]| {
            for step in from..from + 30 {
                let t = 0.2 * f64::from(step);
                for (k, x) in x.iter_mut().enumerate() {
                    *x = 0.02 * libm::sin(t + k as f64) * if k % 6 < 3 { 1.0 } else { 0.3 };
                }
                r.fill(0.0);
                structure.subtract_internal(x, &[0.0; 24], Base::default(), 0.01, r);
            }
        };
        let (mut r, mut x) = (vec![0.0; n], vec![0.0; n]);
        run(&mut one, 0, &mut r, &mut x);
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        let mut two = structure(portal(columns, Some(0.4)));
        state.restore(|visit| two.visit_state(visit)).unwrap();
        run(&mut one, 30, &mut r, &mut x);
        let expected = r.clone();
        let counted = allocation_counter::measure(|| run(&mut two, 30, &mut r, &mut x));
        assert_eq!(counted.count_total, 0, "{columns}");
        assert_eq!(r, expected, "{columns}");
    }
}

#[test]
fn mistakes_in_space_name_their_place() {
    let broken = |from: &str, to: &str| {
        let text = toml::to_string(&portal("section = \"solid\"", Some(0.0))).unwrap();
        let changed = text.replacen(from, to, 1);
        assert_ne!(text, changed, "{from}: {text}");
        toml::from_str::<FrameSpec>(&changed)
            .unwrap()
            .model()
            .unwrap_err()
    };
    let text = toml::to_string(&portal("section = \"fibres\"", Some(0.0))).unwrap();
    let mut many = toml::from_str::<FrameSpec>(&text).unwrap();
    let Some(SectionSpec::Rectangle(cut)) = many.section.get_mut("fibres") else {
        panic!("{text}");
    };
    (cut.layers, cut.layers_across) = (200, 21);
    assert_is!(
        many.section_named(0, "fibres").unwrap_err()
        => FrameError::Section { key: "layers_across", .. }
    );
    assert_is!(broken("dimension = 3", "dimension = 2") => FrameError::Coordinates { key: "at_m", found: 3, wanted: 2, .. });
    assert_is!(broken("dimension = 3", "dimension = 4") => FrameError::Dimension(4));
    assert_is!(
        broken("orientation = [1.0, 0.0, 0.0]", "orientation = [0.0, 0.0, 1.0]")
        => FrameError::Unfit { key: "nodes", .. }
    );
    let plane = |key: &str| {
        let text = toml::to_string(&portal("section = \"solid\"", None)).unwrap();
        let text = text.replacen("mass_kg = 1000.0", &format!("mass_kg = 1000.0\n{key}"), 1);
        toml::from_str::<FrameSpec>(&text)
            .unwrap()
            .model()
            .unwrap_err()
    };
    assert_is!(
        plane("fixed = [\"z\"]")
        => FrameError::NotInPlane { at: ("node", 2), key: "fixed", direction: Direction::Z }
    );
    let concrete = section(
        "fibres = [{ y_m = 0.1, area_m2 = 1e-3, material = \"m\" }, { y_m = -0.1, area_m2 = 1e-3, material = \"m\" }]",
    );
    assert_eq!(concrete.unwrap().torsion(), 0.0);
}

/// A mass on a bearing: yielding in any horizontal direction at k and Q, and a lifted pendulum without force.
#[test]
fn bearings_stand_between_nodes() {
    let bearing = |more: &str| -> Result<FrameModel, FrameError> {
        let text = format!(
            "dimension = 3\nnode = [{{ name = 'g', at_m = [0, 0, 0], fixed = ['x', 'y', 'z', 'rx', 'ry', 'rz'] }}, \
             {{ name = 'b', at_m = [0, 0, 0], mass_kg = 1e3, fixed = ['rx', 'ry', 'rz'] }}]\n\
             link = [{{ nodes = ['g', 'b'], {more} }}]"
        );
        toml::from_str::<FrameSpec>(&text).unwrap().model()
    };
    let pendulum = "bearing.friction_pendulum = { radius_m = 2, stiffness_n_per_m = 1e6, friction_slow = 0.05, friction_fast = 0.05, \
                    rate_s_per_m = 0, largest_axial_force_n = 2e4, vertical_stiffness_n_per_m = 1e8 }";
    let model = bearing(&format!("record = true, {pendulum}")).unwrap();
    let recorded: Vec<_> = model
        .members
        .recorded()
        .map(|member| member.axes())
        .collect();
    assert_eq!(recorded, [3]);
    assert_near(model.stiffness.get(0, 0), 1e6 + 2e4 / 2.0);
    assert_near(model.stiffness.get(2, 2), 1e8);
    let mut members = model.members;
    let mut force = |x: [f64; 3]| {
        let mut r = [0.0; 3];
        let (at, none) = ([x[0], x[1], x[2]], [0.0; 3]);
        let at = At {
            disp: &at,
            vel: &none,
            base: [0.0; 2],
            dt: 0.01,
        };
        members.subtract(0..1, at, crate::linalg::Lanes::best(), &mut r, &mut []);
        members.commit();
        r
    };
    // 1e4 N: N d/R + 0.05 N against the motion.
    let found = force([0.06, 0.08, -1e-4]);
    assert_near(found[0], -0.6 * (500.0 + 500.0));
    assert_near(found[1], -0.8 * (500.0 + 500.0));
    assert_near(found[2], 1e4);
    assert_eq!(force([0.06, 0.08, 1e-3]), [0.0; 3]);
    for (wrong, key) in [
        (format!("direction = 'x', {pendulum}"), "direction"),
        (
            format!("law.linear = {{ stiffness_n_per_m = 1.0 }}, {pendulum}"),
            "nodes",
        ),
        ("direction = 'x'".to_owned(), "nodes"),
        (
            "law.linear = { stiffness_n_per_m = 1.0 }".to_owned(),
            "nodes",
        ),
    ] {
        match bearing(&wrong).unwrap_err() {
            FrameError::Unfit { key: found, .. } => assert_eq!(found, key, "{wrong}"),
            other => panic!("{wrong}: {other}"),
        }
    }
}
