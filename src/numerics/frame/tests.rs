//! Frames against closed forms.

use super::*;
use crate::linalg::{Spd, modes};
use gusset_quantity::assert_is;

mod large;
mod space;

const E: f64 = 2.1e11;
const A: f64 = 0.0149;
const I: f64 = 2.517e-4;
const L: f64 = 3.5;

fn frame(text: &str) -> FrameSpec {
    toml::from_str(&format!(
        "{text}\n[section.column.elastic]\nyoung_pa = {E:e}\narea_m2 = {A}\ninertia_m4 = {I:e}\n"
    ))
    .unwrap()
}

/// Displacements under the static load, by node and direction.
fn settled(spec: &FrameSpec) -> impl Fn(&str, Direction) -> f64 {
    let model = spec.model().unwrap();
    let mut disp = model.load.clone();
    Spd::factor(&model.stiffness)
        .unwrap()
        .solve_in_place(&mut disp);
    move |node, direction| {
        let motion = model.motion(node, direction).unwrap();
        motion.iter().map(|(dof, share)| share * disp[*dof]).sum()
    }
}

fn assert_near(found: f64, expected: f64) {
    assert!(
        (found / expected - 1.0).abs() < 1e-9,
        "{found:e} {expected:e}"
    );
}

/// A cantilever that leans by `angle`: δ = P L³/(3 E I) across it, P L/(E A) along it, and the rotation P L²/(2 E I).
#[test]
fn cantilever_bends_at_any_angle() {
    for angle in [0.0, 0.7, 1.9, -2.4] {
        let (c, s) = (libm::cos(angle), libm::sin(angle));
        let (across, along) = (1e4, 3e5);
        let spec = frame(&format!(
            "node = [{{ name = \"a\", at_m = [1.0, 2.0], fixed = [\"x\", \"y\", \"rz\"] }}, \
             {{ name = \"b\", at_m = [{}, {}] }}]\nmember = [{{ nodes = [\"a\", \"b\"], section = \"column\" }}]\n\
             load = [{{ node = \"b\", x_n = {}, y_n = {} }}]",
            1.0 + L * c,
            2.0 + L * s,
            along * c - across * s,
            along * s + across * c
        ));
        let at = settled(&spec);
        let (x, y) = (at("b", Direction::X), at("b", Direction::Y));
        assert_near(x * c + y * s, along * L / (E * A));
        assert_near(y * c - x * s, across * L * L * L / (3.0 * E * I));
        assert_near(at("b", Direction::Rz), across * L * L / (2.0 * E * I));
        assert_eq!(at("a", Direction::Y), 0.0);
    }
}

/// A portal with a rigid beam sways with 12 E I/L³ a column, 3 E I/L³ where a column is hinged at its top.
#[test]
fn portal_sways_by_its_columns() {
    let portal = |more: &str, release: &str| {
        let spec = frame(&format!(
            "node = [{{ name = \"a0\", at_m = [0.0, 0.0], fixed = [\"x\", \"y\", \"rz\"] }}, \
             {{ name = \"b0\", at_m = [6.0, 0.0], fixed = [\"x\", \"y\", \"rz\"] }}, \
             {{ name = \"a1\", at_m = [0.0, {L}], mass_kg = 2e4, fixed = [\"y\", \"rz\"] }}, \
             {{ name = \"b1\", at_m = [6.0, {L}], mass_kg = 1e4, fixed = [\"y\", \"rz\"] }}]\n\
             member = [{{ nodes = [\"a0\", \"a1\"], section = \"column\" }}, \
             {{ nodes = [\"b0\", \"b1\"], section = \"column\", release = [{release}] }}]\n{more}"
        ));
        let model = spec.model().unwrap();
        modes(&model.stiffness, &model.mass).unwrap().frequencies
    };
    let column = E * I / (L * L * L);
    let floor = "constraint = [{ diaphragm = { master = \"a1\", nodes = [\"b1\"] } }]";
    assert_near(portal(floor, "")[0], (24.0 * column / 3e4).sqrt());
    assert_near(portal(floor, "\"end\"")[0], (15.0 * column / 3e4).sqrt());
    let equal =
        "constraint = [{ equal = { master = \"b1\", nodes = [\"a1\"], directions = [\"x\"] } }]";
    assert_near(portal(equal, "")[0], (24.0 * column / 3e4).sqrt());
    assert_eq!(portal("", "").len(), 2);
}

/// The weight on a rigid body beside its master is a moment at the master, and an offset shortens a member.
#[test]
fn rigid_bodies_and_offsets_have_levers() {
    let spec = frame(&format!(
        "node = [{{ name = \"a\", at_m = [0.0, 0.0], fixed = [\"x\", \"y\", \"rz\"] }}, {{ name = \"b\", at_m = [0.0, {L}] }}, \
         {{ name = \"c\", at_m = [0.8, {}] }}]\nmember = [{{ nodes = [\"a\", \"b\"], section = \"column\" }}]\n\
         constraint = [{{ rigid = {{ master = \"b\", nodes = [\"c\"] }} }}]\nload = [{{ node = \"c\", y_n = -1e4 }}]",
        L + 0.5
    ));
    let at = settled(&spec);
    // The moment −P d bends the column to the right by M L²/(2 E I), and turns it by M L/(E I).
    let turn = -0.8 * 1e4 * L / (E * I);
    assert_near(at("b", Direction::Rz), turn);
    assert_near(at("b", Direction::X), -turn * L / 2.0);
    assert_near(at("c", Direction::X), -turn * L / 2.0 - 0.5 * turn);
    assert_near(at("c", Direction::Y), -1e4 * L / (E * A) + 0.8 * turn);

    let short = frame(&format!(
        "node = [{{ name = \"a\", at_m = [0.0, 0.0], fixed = [\"x\", \"y\", \"rz\"] }}, {{ name = \"b\", at_m = [{L}, 0.0] }}]\n\
         member = [{{ nodes = [\"a\", \"b\"], section = \"column\", offset_start_m = [0.5, 0.0] }}]\n\
         load = [{{ node = \"b\", y_n = 1e4 }}]"
    ));
    let clear = L - 0.5;
    assert_near(
        settled(&short)("b", Direction::Y),
        1e4 * clear * clear * clear / (3.0 * E * I),
    );
}

/// A rigid column that a hinge holds up by a beam-like spring: N/L lowers the sway by P/L, and the frame buckles at k L.
#[test]
fn weight_lowers_the_sway_until_it_buckles() {
    let column = E * I / (L * L * L);
    let leaning = |weight: f64| {
        frame(&format!(
            "node = [{{ name = \"a0\", at_m = [0.0, 0.0], fixed = [\"x\", \"y\", \"rz\"] }}, \
             {{ name = \"b0\", at_m = [6.0, 0.0], fixed = [\"x\", \"y\"] }}, \
             {{ name = \"a1\", at_m = [0.0, {L}], mass_kg = 1e4 }}, {{ name = \"b1\", at_m = [6.0, {L}] }}]\n\
             member = [{{ nodes = [\"a0\", \"a1\"], section = \"column\" }}, \
             {{ nodes = [\"b0\", \"b1\"], section = \"column\", p_delta = true }}]\n\
             constraint = [{{ diaphragm = {{ master = \"a1\", nodes = [\"b1\"] }} }}, \
             {{ equal = {{ master = \"b0\", nodes = [\"b1\"], directions = [\"rz\"] }} }}]\n\
             load = [{{ node = \"b1\", y_n = {:e} }}]",
            -weight
        ))
    };
    // The second column only leans: both of its ends turn alike, so that it bears 12 E I/L³ less its turning 6 E I/L².
    let sway = |weight: f64| {
        let model = leaning(weight).model().unwrap();
        modes(&model.stiffness, &model.mass).unwrap().frequencies[0]
    };
    let own = sway(0.0);
    assert_near(own * own, 3.0 * column / 1e4);
    let lower = sway(2e5);
    assert_near(lower * lower, (3.0 * column - 2e5 / L) / 1e4);
    let critical = 3.0 * column * L;
    let Err(FrameError::Buckles {
        share,
        node,
        direction,
    }) = leaning(1.25 * critical).model()
    else {
        panic!("it stands");
    };
    assert!((share - 0.8).abs() < 1e-6, "{share}");
    assert_eq!((node.as_str(), direction), ("a1", Direction::X));
}

/// The section of this table in a frame with a material "m" of 1 Pa.
fn section(text: &str) -> Result<super::section::Section, FrameError> {
    let spec: FrameSpec = toml::from_str(&format!(
        "node = []\nmaterial.m.elastic = {{ young_pa = 1.0 }}\nsection.it.{text}"
    ))
    .unwrap();
    spec.section_named(0, "it")
}

#[test]
fn sections_have_their_known_values() {
    let rigidity = |text: &str| section(text).unwrap().rigidity().unwrap();
    let found = rigidity("rectangle = { young_pa = 1.0, width_m = 0.3, depth_m = 0.5 }");
    assert_near(found.axial, 0.15);
    assert_near(found.bending, 0.3 * 0.125 / 12.0);
    // HEB 300 without its fillets: the tables say 149.1 cm² and 25 170 cm⁴ with them.
    let shape = "i_shape = { young_pa = 1.0, depth_m = 0.3, flange_width_m = 0.3, flange_thickness_m = 0.019, \
                 web_thickness_m = 0.011 }";
    let found = rigidity(shape);
    assert!((found.axial / 149.1e-4 - 1.0).abs() < 0.05, "{found:?}");
    assert!((found.bending / 25170e-8 - 1.0).abs() < 0.05, "{found:?}");
    let thick = shape.replace("0.019", "0.2");
    assert_is!(section(&thick).unwrap_err() => FrameError::Section { key: "depth_m", .. });
}

/// Fibres add up to the area of their shape, and nearly to its second moment; a bar of reinforced concrete counts once.
#[test]
fn fibres_fill_their_shapes() {
    const SHAPES: [&str; 5] = [
        "rectangle = { young_pa = 1.0, width_m = 0.3, depth_m = 0.5 }",
        "i_shape = { young_pa = 1.0, depth_m = 0.3, flange_width_m = 0.3, flange_thickness_m = 0.019, web_thickness_m = 0.011 }",
        "circle = { young_pa = 1.0, diameter_m = 0.4 }",
        "tube = { young_pa = 1.0, diameter_m = 0.4, thickness_m = 0.01 }",
        "tube = { young_pa = 1.0, diameter_m = 0.4, thickness_m = 0.15 }",
    ];
    for shape in SHAPES {
        let whole = section(shape).unwrap().rigidity().unwrap();
        let cut = shape.replace("young_pa = 1.0", "material = \"m\", layers = 40");
        let cut = section(&cut).unwrap().rigidity().unwrap();
        assert_near(cut.axial, whole.axial);
        assert!(
            (cut.bending / whole.bending - 1.0).abs() < 2e-3,
            "{shape}: {cut:?} {whole:?}"
        );
    }
    let concrete = "rc_rectangle = { concrete = \"m\", steel = \"m\", width_m = 0.3, depth_m = 0.5, cover_m = 0.05, \
                    top_area_m2 = 1e-3, bottom_area_m2 = 1e-3, middle_area_m2 = 5e-4 }";
    let found = section(concrete).unwrap().rigidity().unwrap();
    assert_near(found.axial, 0.15 + 2.5e-3);
    let bars = 2e-3 * 0.2 * 0.2;
    assert!(
        (found.bending / (0.3 * 0.125 / 12.0 + bars) - 1.0).abs() < 5e-3,
        "{found:?}"
    );
    let uneven = section(&concrete.replace("top_area_m2 = 1e-3", "top_area_m2 = 2e-3"));
    assert!(uneven.unwrap().rigidity().is_none());
}

#[test]
fn mistakes_name_their_place() {
    const NODES: &str = "node = [{ name = \"a\", at_m = [0, 0], fixed = [\"x\", \"y\", \"rz\"] }, { name = \"b\", at_m = [0, 3] }, \
                         { name = \"c\", at_m = [1, 3] }]\n";
    let refused = |more: &str| frame(&format!("{NODES}{more}")).model().unwrap_err();
    let member = |nodes: &str, section: &str| {
        refused(&format!(
            "member = [{{ nodes = {nodes}, section = \"{section}\" }}]"
        ))
    };
    assert_is!(member("[\"a\", \"z\"]", "column") => FrameError::NoNode { at: ("member", 0), .. });
    assert_is!(member("[\"a\", \"b\"]", "beam") => FrameError::NoSection { index: 0, .. });
    assert_is!(member("[\"a\", \"a\"]", "column") => FrameError::Unfit { at: ("member", 0), key: "nodes", .. });
    let tied = |text: &str| refused(&format!("constraint = [{text}]"));
    let floor = "{ diaphragm = { master = \"b\", nodes = [\"c\"] } }";
    assert_is!(
        tied(&format!("{floor}, {floor}"))
        => FrameError::Constrained { index: 1, direction: Direction::X, .. }
    );
    assert_is!(
        tied("{ diaphragm = { master = \"b\", nodes = [\"a\"] } }") => FrameError::Constrained { index: 0, .. }
    );
    assert_is!(
        tied("{ diaphragm = { master = \"b\", nodes = [\"b\"] } }") => FrameError::Constrained { index: 0, .. }
    );
    assert_is!(
        tied(&format!("{floor}, {{ rigid = {{ master = \"c\", nodes = [\"b\"] }} }}"))
        => FrameError::Constrained { .. }
    );
    assert_is!(
        refused("load = [{ node = \"b\", y_n = nan }]") => FrameError::Value { key: "y_n", .. }
    );
    let kind = |text: &str| {
        refused(&format!(
            "member = [{{ nodes = [\"a\", \"b\"], section = \"column\", {text} }}]"
        ))
    };
    for (text, wrong) in [
        ("kind = \"force_based\"", "section"),
        ("points = 3", "points"),
        ("kind = \"truss\", release = [\"end\"]", "release"),
        ("kind = \"truss\", hinge_end = \"h\"", "hinge_end"),
    ] {
        assert_is!(kind(text) => FrameError::Unfit { at: ("member", 0), key, .. } if *key == wrong);
    }
    assert_is!(kind("hinge_start = \"h\"") => FrameError::NoHinge { key: "hinge_start", .. });
    let soft = "imk = { stiffness_n_per_m = 1e9, yield_force_n = 1e6, capping_ratio = 1.1, plastic_disp_m = 0.02, \
                post_capping_disp_m = 0.01, ultimate_disp_m = 0.1 }";
    let soft = refused(&format!(
        "hinge.h.{soft}\nmember = [{{ nodes = [\"a\", \"b\"], section = \"column\", hinge_end = \"h\" }}]"
    ));
    assert_is!(soft => FrameError::SnapBack { index: 0, key: "hinge_end", .. });
    let link = |text: &str| {
        refused(&format!(
            "link = [{{ law.linear.stiffness_n_per_m = 1.0, {text} }}]"
        ))
    };
    assert_is!(
        link("nodes = [\"a\", \"a\"], direction = \"x\"") => FrameError::Unfit { at: ("link", 0), key: "nodes", .. }
    );
    assert_is!(
        link("nodes = [\"b\", \"b\"], direction = \"axial\"") => FrameError::Unfit { key: "direction", .. }
    );
    for (text, key) in [
        ("circle = { diameter_m = 0.4 }", false),
        (
            "circle = { diameter_m = 0.4, material = \"m\", young_pa = 1.0 }",
            true,
        ),
    ] {
        assert_is!(section(text).unwrap_err() => FrameError::OneMaterial { both, .. } if *both == key);
    }
    assert_is!(
        section("circle = { diameter_m = 0.4, material = \"n\" }").unwrap_err() => FrameError::NoMaterial { .. }
    );
    assert_is!(
        section("circle = { diameter_m = 0.4, material = \"m\", layers = 1 }").unwrap_err()
        => FrameError::Section { key: "layers", .. }
    );
    assert_is!(
        frame("node = [{ name = \"a\", at_m = [0, 0] }, { name = \"a\", at_m = [0, 1] }]").model().unwrap_err()
        => FrameError::SameName { index: 1, .. }
    );
    assert_is!(
        frame("node = [{ name = \"a\", at_m = [0, 0], mass_kg = -1.0 }]").model().unwrap_err()
        => FrameError::Value { key: "mass_kg", .. }
    );
}
