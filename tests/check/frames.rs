//! `gusset check` lists nodes, members and damping of a frame, and reads a frame from its own file.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::common::refusal::refused;
use crate::common::test_file::TestFile;
use crate::common::{Said, completed, json, names, same_physics, say, write};

const TEST: &str = r#"[time]
rate_hz = 200
duration_s = 0.5
clock = "simulated"

[structure.frame]
file = "frame.toml"

[excitation.ground_acceleration.signal.sine]
amplitude = 3.0
frequency_hz = 2.0
"#;

/// A cantilever column of 3 m.
const FRAME: &str = r#"node = [
    { name = "foot", at_m = [0, 0], fixed = ["x", "y", "rz"] },
    { name = "top", at_m = [0, 3], mass_kg = 2e3, rotary_mass_kg_m2 = 50 },
]
member = [{ name = "column", nodes = ["foot", "top"], section = "s" }]
load = [{ node = "top", y_n = -2e4 }]

[material.steel.menegotto_pinto]
young_pa = 2e11
yield_pa = 3e8
hardening_ratio = 0.01

[section.s.rectangle]
material = "steel"
width_m = 0.1
depth_m = 0.2
"#;

/// The test with this frame in its own text.
fn inline() -> String {
    let tables = FRAME.parse::<toml::Table>().unwrap();
    let mut test: toml::Table = TEST.parse().unwrap();
    test["structure"]["frame"] = toml::Value::Table(tables);
    test.to_string()
}

fn check(folder: &Path, test: &str, files: &[(&str, &str)], more: &[&str]) -> Said {
    for (name, text) in files {
        write(folder, name, text);
    }
    let test = write(folder, "test.toml", test);
    let arguments = ["check", test.to_str().unwrap()];
    say(arguments.iter().chain(more))
}

fn structure(test: &str, files: &[(&str, &str)], more: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let said = check(folder.path(), test, files, &[&["--json"], more].concat());
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    serde_json::from_str::<Value>(&said.stdout).unwrap()["structure"].clone()
}

#[test]
fn check_lists_nodes_and_members() {
    let found = structure(TEST, &[("frame.toml", FRAME)], &[]);
    let frame = &found["frame"];
    assert_eq!(frame["mass_kg"], 2e3);
    assert_eq!(frame["weight_n"], 2e4);
    assert_eq!(frame["nodes"][1]["name"], "top");
    let column = &frame["members"][0];
    assert_eq!(column["length_m"], 3.0);
    let used = column["utilisation"].as_f64().unwrap();
    // σ = 20 kN over 0.02 m², of 300 MPa.
    assert!((used / (2e4 / 0.02 / 3e8) - 1.0).abs() < 1e-9, "{used}");

    let folder = tempfile::tempdir().unwrap();
    let frame = [("frame.toml", FRAME)];
    for more in [&[][..], &["--verbose"]] {
        let page = check(folder.path(), TEST, &frame, more).stdout;
        for (name, words) in [
            ("frame", "mass 2 t, static loads 20 kN downwards"),
            ("foot", "x y rz"),
            ("top", "(0, 3) m"),
            ("top", "50 kg m²"),
            ("column", "foot–top  elastic  s        3 m     0.003333"),
        ] {
            let row = |line: &str| line.trim_start().starts_with(name) && line.contains(words);
            assert!(page.lines().any(row), "{name}: {words}\n{page}");
        }
        assert_eq!(page.contains("first periods"), more.is_empty(), "{page}");
    }
}

#[test]
fn check_lists_the_most_used_members_first() {
    let members = 20;
    let mut frame = FRAME.without("member").without("node").without("load");
    let (mut nodes, mut all, mut loads) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..members {
        nodes.push(format!(
            "{{ name = 'f{k}', at_m = [{k}, 0], fixed = ['x', 'y', 'rz'] }}, \
             {{ name = 't{k}', at_m = [{k}, 3], mass_kg = 2e3, rotary_mass_kg_m2 = 50 }}"
        ));
        all.push(format!(
            "{{ name = 'c{k}', nodes = ['f{k}', 't{k}'], section = 's' }}"
        ));
        loads.push(format!(
            "{{ node = 't{k}', y_n = {} }}",
            -4.9e5 * f64::from(k)
        ));
    }
    let lists = [("node", nodes), ("member", all), ("load", loads)];
    let lists = lists.map(|(key, list)| format!("{key} = [{}]\n", list.join(", ")));
    frame = lists.concat() + &frame;
    let folder = tempfile::tempdir().unwrap();
    let said = check(folder.path(), TEST, &[("frame.toml", &frame)], &[]);
    let rows = said.stdout.lines().map(str::trim_start);
    let rows: Vec<&str> = rows
        .filter(|row| row.starts_with('c') && row.contains("f1"))
        .collect();
    assert!(
        rows[0].starts_with("c19 ") && rows[1].starts_with("c18 "),
        "{rows:?}"
    );
    assert!(
        said.stdout.contains("  8 more: --verbose shows them"),
        "{}",
        said.stdout
    );
    // σ of c13 is 318.5 MPa.
    assert!(said.stderr.contains("c19 yields"), "{}", said.stderr);
    assert!(said.stderr.contains("6 more"), "{}", said.stderr);
    let said = check(folder.path(), TEST, &[], &["--verbose"]);
    assert!(!said.stdout.contains("--verbose shows"), "{}", said.stdout);
}

#[test]
fn frame_of_a_file_is_that_of_the_text() {
    let beneath = FRAME
        .replace("[material", "[structure.frame.material")
        .replace("[section", "[structure.frame.section");
    let beneath = format!("[structure.frame]\n{beneath}");
    let expected = structure(&inline(), &[], &[]);
    for text in [FRAME, &beneath] {
        assert_eq!(structure(TEST, &[("frame.toml", text)], &[]), expected);
    }
    let heavier = FRAME.replace("2e3", "3e3");
    let files = [("frame.toml", FRAME), ("other.toml", &heavier)];
    let expected = structure(TEST, &[("frame.toml", &heavier)], &[]);
    for set in [
        "structure.frame.file=other.toml",
        "structure.frame.node[1].mass_kg=3e3",
    ] {
        assert_eq!(structure(TEST, &files, &["--set", set]), expected, "{set}");
    }
}

/// A campaign may vary the file: the run folder keeps the one that was used.
#[test]
fn varied_file_replaces_the_frame() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "frame.toml", FRAME);
    write(folder.path(), "other.toml", &FRAME.replace("2e3", "3e3"));
    let test = write(folder.path(), "test.toml", TEST);
    let loaded = gusset_config::load(&test, &[]).unwrap_or_else(|error| panic!("{error}"));
    let varied = loaded.varied(&["structure.frame.file=other.toml".to_owned()]);
    let varied = varied.unwrap_or_else(|error| panic!("{error}"));
    for (loaded, mass, name) in [(&loaded, 2e3, "frame.toml"), (&varied, 3e3, "other.toml")] {
        let test = gusset_setup::build(loaded).unwrap_or_else(|error| panic!("{error}"));
        let facts = test.facts.structure.and_then(|structure| structure.frame);
        assert_eq!(facts.unwrap().mass, mass);
        let inputs = test.files.inputs.iter().map(|(name, _)| name);
        assert!(inputs.eq([Path::new(name)]));
    }
}

#[test]
fn mistake_in_the_file_of_a_frame_names_its_line() {
    let folder = tempfile::tempdir().unwrap();
    for (right, wrong, place, words) in [
        ("width_m", "widht_m", "frame.toml:15:1", "width_m"),
        ("mass_kg = 2e3", "mass_kg = -1", "frame.toml:3:", "mass_kg"),
        (
            "\"foot\", \"top\"]",
            "\"foot\", \"tip\"]",
            "frame.toml:5:",
            "tip",
        ),
        ("2e11", "2,0e11", "frame.toml:9:", "comma"),
        (
            "[section.s",
            "[time]\n[section.s",
            "frame.toml:13:2",
            "time",
        ),
        (
            "[section.s",
            "[structure]\n[section.s",
            "frame.toml",
            "[structure.frame]",
        ),
        (
            "node = [",
            "file = 'more.toml'\nnode = [",
            "frame.toml:1:1",
            "another file",
        ),
    ] {
        let frame = FRAME.replacen(right, wrong, 1);
        let said = check(folder.path(), TEST, &[("frame.toml", &frame)], &[]);
        assert_eq!(said.code, Some(2), "{wrong}: {}", said.stderr);
        for word in [place, words] {
            assert!(
                said.stderr.contains(word),
                "{wrong}: no {word} in\n{}",
                said.stderr
            );
        }
    }
    let set = ["--set", "structure.frame.node[1].mass_kg=-1"];
    let said = check(folder.path(), TEST, &[("frame.toml", FRAME)], &set);
    assert!(said.stderr.contains("command line:1:"), "{}", said.stderr);
}

#[test]
fn key_that_names_the_file_of_a_frame_is_checked() {
    let line = "file = \"frame.toml\"";
    refused(
        TEST,
        &[("fram.toml", FRAME)],
        line,
        "\"frame.toml\"",
        &["did you mean `fram.toml`?"],
    );
    let both = TEST.replace(line, &format!("{line}\nload = []"));
    refused(
        &both,
        &[("frame.toml", FRAME)],
        "load = []",
        "load",
        &["both `file` and `load`"],
    );
}

#[test]
fn run_folder_keeps_the_file_of_a_frame() {
    let folder = tempfile::tempdir().unwrap();
    let frame = write(folder.path(), "frame.toml", FRAME);
    let test = write(folder.path(), "test.toml", TEST);
    let out = folder.path().join("out");
    completed(
        &test,
        &out,
        &["--set", "structure.frame.node[1].mass_kg=3e3"],
    );
    assert_eq!(names(&out.join("inputs")), ["frame.toml"]);
    assert_eq!(
        fs::read_to_string(out.join("inputs/frame.toml")).unwrap(),
        FRAME
    );
    assert_eq!(
        json(&out, "summary.json")["inputs"][0]["path"],
        "inputs/frame.toml"
    );
    fs::remove_file(frame).unwrap();
    let said = say(["replay".as_ref(), out.as_os_str()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let again = folder.path().join("again");
    completed(&out.join("resolved.toml"), &again, &[]);
    same_physics(&out, &again);
}

/// The column with a brace, a link and this rule.
fn braced(rule: &str) -> String {
    let brace = "specimen = [{ name = 'brace', deformations = [{ node = 'top', direction = 'x' }], \
                 law.linear.stiffness_n_per_m = 1e5 }]\n";
    let link = "[[structure.frame.link]]\nnodes = ['foot', 'top']\ndirection = 'rz'\n\
                law.linear.stiffness_n_per_m = 2e5\n";
    inline().with(&format!("{brace}[structure]\n{rule}\n{link}"))
}

#[test]
fn check_shows_what_a_rule_adds_to_a_specimen() {
    let rule =
        "damping.rayleigh = { mass_coefficient_per_s = 0.1, stiffness_coefficient_s = 1e-3 }";
    let damped = braced(rule).with("specimen.0.damped = true");
    let storey = braced(rule)
        .without("structure.frame")
        .without("specimen.0.deformations");
    let storey = storey
        .with("specimen.0.storey = 1\n")
        .with("structure.shear_building = { mass_kg = [2e3], stiffness_n_per_m = [1e6] }");
    let modal = braced("damping.modal = { ratios = [0.02] }");
    for (text, json, words) in [
        (
            braced(rule),
            serde_json::json!([[]]),
            "brace: none from the stiffness",
        ),
        (
            damped,
            serde_json::json!([[100.0]]),
            "brace: 100 N s/m from the stiffness",
        ),
        (
            storey,
            serde_json::json!([[100.0]]),
            "brace: 100 N s/m from the stiffness",
        ),
        (
            modal,
            serde_json::json!("modal"),
            "every motion of its masses",
        ),
        (braced(""), Value::Null, ""),
    ] {
        assert_eq!(
            structure(&text, &[], &[])["rule_damping_of_specimens"],
            json,
            "{text}"
        );
        let folder = tempfile::tempdir().unwrap();
        let page = check(folder.path(), &text, &[], &[]).stdout;
        let row = page.lines().find(|line| line.starts_with("rule damping"));
        let is_right = row.map_or(words.is_empty(), |row| row.contains(words));
        assert!(is_right, "{words}\n{page}");
    }
}

#[test]
fn keys_of_damping_need_a_frame_and_a_rule() {
    let rule =
        "damping.rayleigh = { mass_coefficient_per_s = 0.1, stiffness_coefficient_s = 1e-3 }";
    let modal = braced("damping.modal = { ratios = [0.02] }");
    let refused = |text: &str, words: &str| {
        let folder = tempfile::tempdir().unwrap();
        let said = check(folder.path(), text, &[], &[]);
        assert_eq!(said.code, Some(2), "{text}{}", said.stderr);
        assert!(
            said.stderr.contains(words),
            "no {words} in\n{}",
            said.stderr
        );
    };
    for (key, words) in [
        ("specimen.0.damped = true", "`specimen[0].damped`"),
        (
            "structure.frame.link.0.damped = true",
            "`structure.frame.link[0].damped`",
        ),
        (
            "structure.frame.member.0.stiffness_coefficient_s = 0.0",
            "`structure.frame.member[0].stiffness_coefficient_s`",
        ),
    ] {
        let words = format!("{words} needs a damping rule");
        refused(&modal.with(key), &words);
        refused(&braced("").with(key), &words);
        let ruled = braced(rule).with(key);
        structure(&ruled, &[], &[]);
    }
    refused(
        &braced(rule).with("structure.frame.member.0.stiffness_coefficient_s = -1.0"),
        "`stiffness_coefficient_s` is -1",
    );
    let storey = modal
        .without("structure.frame")
        .without("specimen.0.deformations");
    let storey = storey
        .with("specimen.0 = { storey = 1, damped = false }")
        .with("structure.shear_building = { mass_kg = [2e3], stiffness_n_per_m = [1e6] }");
    refused(&storey, "only for a specimen of a frame");
}

/// A brace that yields couples two directions of a joint without mass that were not coupled at first.
#[test]
fn coupling_that_appears_later_has_room() {
    let frame = r#"node = [
    { name = "a", at_m = [-3, 0], fixed = ["x", "y", "rz"] },
    { name = "b", at_m = [3, 0], fixed = ["x", "y", "rz"] },
    { name = "joint", at_m = [0, 3], fixed = ["rz"] },
    { name = "top", at_m = [0, 6], mass_kg = 2e4, fixed = ["rz"] },
]
member = [
    { nodes = ["a", "joint"], section = "s", kind = "truss", record = true },
    { nodes = ["b", "joint"], section = "s", kind = "truss" },
    { nodes = ["joint", "top"], section = "mast" },
]
load = [{ node = "top", y_n = -2e5, x_n = 2e4 }]
"#;
    let (_, tables) = FRAME.split_once("[material").unwrap();
    let frame = format!("{frame}[section.mast.elastic]\nyoung_pa = 2e11\narea_m2 = 0.01\ninertia_m4 = 1e-4\n[material{tables}")
        .replace("width_m = 0.1", "width_m = 0.03")
        .replace("depth_m = 0.2", "depth_m = 0.03");
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "frame.toml", &frame);
    let amplitude = "excitation.ground_acceleration.signal.sine.amplitude = 12.0";
    let test = write(folder.path(), "test.toml", &TEST.with(amplitude));
    let out = folder.path().join("out");
    completed(&test, &out, &[]);
    let brace = &json(&out, "summary.json")["members"][0];
    assert!(brace["demand"][0].as_f64().unwrap() > 1.0, "{brace}");
}

#[test]
fn frames_that_mislead_are_refused() {
    let refused = |frame: &str, test: &str, words: &str| {
        let folder = tempfile::tempdir().unwrap();
        let said = check(folder.path(), test, &[("frame.toml", frame)], &[]);
        assert_eq!(said.code, Some(2), "{frame}{}", said.stderr);
        assert!(
            said.stderr.contains(words),
            "no {words} in\n{}",
            said.stderr
        );
    };
    // The axial forces of P-Δ come from the loads of the frame.
    let leaning = FRAME.with("member.0.p_delta = true");
    for (key, more) in [
        ("`gravity`", "structure.gravity = { influence = [0, 1, 0] }"),
        ("`static_load_n`", "structure.static_load_n = [0, -1e6, 0]"),
    ] {
        refused(&leaning, &TEST.with(more), key);
        structure(&TEST.with(more), &[("frame.toml", FRAME)], &[]);
    }
    let hinged = |law: &str| FRAME.with(&format!("member.0.hinge_start = 'h'\nhinge.h.{law}"));
    for law in [
        "cubic = { stiffness_n_per_m = 1e8, cubic_n_per_m3 = -1e13 }",
        "cubic = { stiffness_n_per_m = 1e8, cubic_n_per_m3 = 5e10 }",
        "gap = { stiffness_n_per_m = 1e8, gap_m = 0.01, side = 'both' }",
    ] {
        refused(&hinged(law), TEST, "hinge \"h\"");
    }
    // Two columns that are pinned at all ends carry a beam.
    let mechanism = FRAME
        .replace(
            "node = [",
            "node = [\n    { name = \"foot 2\", at_m = [5, 0], fixed = [\"x\", \"y\", \"rz\"] },\n    { name = \"top 2\", at_m = [5, 3], mass_kg = 2e3 },",
        )
        .replace(
            "section = \"s\" }]",
            "section = \"s\", release = [\"start\", \"end\"] },\n    { nodes = [\"foot 2\", \"top 2\"], section = \"s\", release = [\"start\", \"end\"] },\n    \
             { nodes = [\"top\", \"top 2\"], section = \"s\" }]",
        );
    refused(&mechanism, TEST, "nothing holds direction x");
    let loose = mechanism.with("member.2.release = ['end']");
    refused(&loose, TEST, "nothing holds direction rz of node \"top 2\"");
}
