//! Values out of range, and values that contradict each other.

use super::*;

#[test]
fn lambda_must_be_positive() {
    for value in ["0", "-4.0", "nan", "-inf"] {
        let text = complaint(
            "[structure]",
            &format!("[integrator]\nlambda = {value}\n[structure]"),
        );
        shows(&text, "`integrator.lambda`");
        shows(&text, &format!("lambda = {value}\n  |          ^"));
        assert_eq!(errors(&text), 1, "{text}");
    }
    let loaded = accepted(GOOD, &["integrator.lambda=inf"]);
    assert_eq!(loaded.file.integrator.lambda, LambdaValue::Infinite);
}

#[test]
fn step_and_rate_must_be_positive() {
    for (key, value) in [
        ("step_s", "0"),
        ("step_s", "-0.01"),
        ("rate_hz", "nan"),
        ("rate_hz", "inf"),
        ("rate_hz", "\"1/0\""),
    ] {
        let text = complaint("rate_hz = 1024", &format!("{key} = {value}"));
        shows(&text, &format!("`time.{key}`"));
        assert_eq!(errors(&text), 1, "{text}");
    }
}

#[test]
fn values_that_are_not_finite_are_refused() {
    let text = complaint("1e6, yield_force_n = 5e3", "nan, yield_force_n = inf");
    shows(&text, "`specimen[0].law.bilinear.stiffness_n_per_m`");
    shows(&text, "`specimen[0].law.bilinear.yield_force_n`");
    shows(&text, "^^^ found nan");
    shows(
        &complaint("duration_s = 20", "duration_s = inf"),
        "`time.duration_s`",
    );
    let text = complaint("amplitude = 2.0", "amplitude = 1e999");
    shows(&text, "must be a finite number");
    shows(&text, "found 1e999");
}

#[test]
fn uneven_duration_suggests_the_nearest() {
    let text = complaint("duration_s = 20", "duration_s = 20.0003");
    shows(
        &text,
        "\
error: the duration is not a whole number of steps
 --> test.toml:6:14
  |
6 | duration_s = 20.0003
  |              ^^^^^^^ 20.0003 s are 20480.3072 steps of 0.0009765625 s
  |
  = help: the nearest durations that fit are 20 s (20480 steps) and 20.0009765625 s (20481 steps)",
    );
    let text = complaint("duration_s = 20", "duration_s = 0.0001");
    shows(&text, "0.0009765625 s");
    shows(
        &complaint("duration_s = 20", "duration_s = -1"),
        "greater than",
    );
    shows(&complaint("duration_s = 20", "duration_s = 1e30"), "2^53");
}

#[test]
fn duration_is_whole_within_a_billionth() {
    // 20 s at 1024 Hz are 20480 steps; the bound is 1e-9 of that, 2.0e-5 steps or 2.0e-8 s.
    assert_eq!(
        accepted(GOOD, &["time.duration_s=20.000000019"]).time.steps,
        20480
    );
    assert!(read(GOOD, &["time.duration_s=20.000000021"]).is_err());
    // Not representable in binary, whole in decimals.
    assert_eq!(
        accepted(PRESCRIBED, &["time.duration_s=0.07"]).time.steps,
        7
    );
}

// --- contradictions -----------------------------------------------------------------------------

#[test]
fn step_and_rate_exclude_each_other() {
    let text = complaint("duration_s = 20", "duration_s = 20\nstep_s = 0.01");
    shows(
        &text,
        "\
error: both `step_s` and `rate_hz` are given
 --> test.toml:5:1
  |
5 | rate_hz = 1024      # as the controller
  | ^^^^^^^ one of them must go
6 | duration_s = 20
7 | step_s = 0.01
  |          ---- the step is given here
  |
  = help: they say the same thing twice: a step of 0.01 s is 100 Hz",
    );
    let text = complaint("rate_hz = 1024", "");
    shows(&text, "`step_s`");
    shows(&text, "`rate_hz`");
}

#[test]
fn a_structure_is_of_exactly_one_kind() {
    let text = complaint(
        "[excitation.g",
        "[structure.chain]\ndofs = 3\nmass_kg = 1.0\nstiffness_n_per_m = 1.0\n[excitation.g",
    );
    shows(&text, "`structure`");
    shows(&text, "`shear_building`");
    shows(&text, "`matrices`");
    shows(&text, "`chain`");
    shows(&text, "one structure");
    let text = complaint(
        "[structure.shear_building]\nmass_kg = [1000, 1000, 1000]\nstiffness_n_per_m = [0, 1e6, 1e6]",
        "",
    );
    shows(&text, "none of");
}

#[test]
fn specimen_has_one_law_and_deformation() {
    shows(
        &complaint("storey = 1", "storey = 1\nrows = [[1, 0, 0]]"),
        "`storey`",
    );
    shows(
        &complaint("storey = 1", "storey = 1\nrows = [[1, 0, 0]]"),
        "`rows`",
    );
    shows(&complaint("storey = 1", ""), "`storey`");
    shows(&complaint("storey = 1", ""), "`rows`");
    shows(&complaint("law = {", "# law = {"), "`laws`");
    shows(&complaint("law = {", "# law = {"), "`coupled`");
    shows(&complaint("law = {", "# law = {"), "`link`");
    shows(&complaint("storey = 1", "storey = 0"), "from 1");
    shows(
        &complaint("law = {", "law = { linear = { stiffness_n_per_m = 1 },"),
        "exactly one",
    );
}

#[test]
fn specimen_names_are_unique_file_names() {
    let second = "\n[[specimen]]\nname = \"Bottom\"\nstorey = 2\nlaw = { linear = { stiffness_n_per_m = 1 } }\n";
    let text = read(&format!("{GOOD}{second}"), &[])
        .unwrap_err()
        .to_string();
    shows(&text, "`Bottom`");
    shows(&text, "first here");
    for name in ["a/b", "", ".hidden", "é"] {
        let text = complaint("\"bottom\"", &format!("\"{name}\""));
        shows(&text, "cannot name");
    }
}

#[test]
fn estimates_and_axes_fit_the_specimen() {
    let with = |more: &str| complaint("storey = 1", &format!("storey = 1\n{more}"));
    shows(&with("stiffness_n_per_m = [[1, 2], [2, 1]]"), "1 axis");
    shows(&with("stiffness_n_per_m = -1"), "negative");
    shows(&with("axis = [{}, {}]"), "2 `axis`");
    shows(&with("axis = [{ sign = 2 }]"), "`sign` is 2");
    shows(&with("axis = [{ unit_force = \"kn\" }]"), "`kN`");
    shows(
        &with("similitude = { length = 0 }"),
        "`specimen[0].similitude.length`",
    );
    shows(&with("mass_in_force_kg = -3"), "not negative");
    let rows = |more: &str| {
        complaint(
            "storey = 1",
            &format!("rows = [[1, 0, 0], [-1, 1, 0]]\n{more}"),
        )
    };
    shows(
        &rows("damping_n_s_per_m = [[1, 2], [2.5, 1]]"),
        "not symmetric",
    );
    shows(&rows("damping_n_s_per_m = [[1, 2], [2]]"), "not square");
    shows(
        &complaint("storey = 1", "rows = [[1, 0, 0], [1, 0]]"),
        "row 2 has 2",
    );
    shows(
        &complaint("storey = 1", "rows = [[1, 0, 0], [1, 0]]"),
        "row 1 has 3",
    );
    shows(&complaint("storey = 1", "rows = [[0, 0, 0]]"), "row 1");
}

#[test]
fn prescribed_test_excludes_a_structure() {
    let prescribed = "[[excitation.prescribed_displacement]]\nspecimen = \"bottom\"\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{GOOD}{prescribed}"), &[])
        .unwrap_err()
        .to_string();
    shows(&text, "only one");
    let load = "[excitation.ground_acceleration]\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{PRESCRIBED}{load}"), &[])
        .unwrap_err()
        .to_string();
    shows(&text, "`excitation.ground_acceleration`");
    shows(&text, "`[structure]`");
    shows(
        &complaint_of(
            PRESCRIBED,
            "name = \"damper\"",
            "name = \"damper\"\nstorey = 1",
        ),
        "`[structure]`",
    );
    shows(
        &complaint_of(PRESCRIBED, "specimen = \"damper\"", "specimen = \"dampr\""),
        "`damper`",
    );
    shows(
        &complaint_of(
            PRESCRIBED,
            "specimen = \"damper\"",
            "specimen = \"damper\"\naxis = 0",
        ),
        "from 1",
    );
    shows(
        &complaint_of(
            PRESCRIBED,
            "specimen = \"damper\"",
            "specimen = \"damper\"\nease_in_s = 3",
        ),
        "`ease_in_s`",
    );
    let twice = "[[excitation.prescribed_displacement]]\nspecimen = \"damper\"\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{PRESCRIBED}{twice}"), &[])
        .unwrap_err()
        .to_string();
    shows(&text, "axis 1");
    shows(&text, "`damper`");
}

#[test]
fn coordinates_do_not_mix() {
    let base = "[excitation.base_displacement]\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{GOOD}{base}"), &[]).unwrap_err().to_string();
    shows(&text, "only one");
}

#[test]
fn dofs_are_counted_from_one_and_named_once() {
    let force = |dofs: &str| {
        format!(
            "{GOOD}[[excitation.nodal_force]]\n{dofs}\nsignal = {{ file = {{ path = 'x' }} }}\n"
        )
    };
    let complaint = |dofs: &str| read(&force(dofs), &[]).unwrap_err().to_string();
    shows(&complaint("dofs = [0]"), "from 1");
    shows(&complaint("dofs = [1, 3, 1]"), "DOF 1");
    shows(&complaint("dofs = [1]\npattern = [1, 0, 0]"), "`dofs`");
    shows(&complaint("dofs = [1]\npattern = [1, 0, 0]"), "`pattern`");
    let text = read(GOOD, &["record.dofs=[]"]).unwrap_err().to_string();
    shows(&text, "one DOF");
}

#[test]
fn structure_without_motion_is_a_warning() {
    let text = GOOD.without("excitation");
    let warnings = accepted(&text, &[]).warnings;
    shows(&warnings[0].render(false), "warning: nothing");
    accepted(&text, &["structure.initial_displacement_m=[0.1, 0, 0]"]);
}

/// A row of ±1 at rotations alone is a rotation; one with a lever arm is a length.
#[test]
fn a_rotation_has_no_unit_of_length() {
    let built = |row: &str, unit: &str| {
        let text = format!(
            "title = \"turns\"\ntime = {{ rate_hz = 1000, duration_s = 1.0 }}\n\
             structure.rotations = [2]\n\
             structure.matrices = {{ mass = [[10, 0], [0, 10]], stiffness = [[4e4, 0], [0, 4e4]], damping = [[1, 0], [0, 1]] }}\n\
             structure.initial_displacement_m = [0.001, 0]\n\
             [[specimen]]\nname = \"joint\"\nrows = [{row}]\n\
             law.linear.stiffness_n_per_m = 1000.0\naxis = [{{ unit_disp = \"{unit}\" }}]\n"
        );
        let loaded = read(&text, &[]).expect("a file that can be read");
        crate::build(&loaded).map(|_| ())
    };
    for row in ["[0, 1]", "[0, -1]"] {
        assert!(built(row, "m").is_ok(), "{row}");
        for unit in ["mm", "in"] {
            let error = built(row, unit).unwrap_err().to_string();
            shows(&error, "axis 1");
            shows(&error, "unit_disp");
        }
    }
    for row in ["[1, 0]", "[1, 1]", "[0, 2.5]"] {
        assert!(built(row, "mm").is_ok(), "{row}");
    }
}

#[test]
fn rotations_are_recorded_in_radians() {
    let node = include_str!("../../../config/three-actuators.toml");
    let built = |text: &str, rotations: &str| {
        let loaded = read(text, &[&format!("structure.rotations={rotations}")])
            .expect("a file that can be read");
        crate::build(&loaded).map(|test| (test.experiment.columns(), test.facts))
    };
    let units = |rotations: &str| {
        let (columns, _) = built(node, rotations).expect("a test");
        ["x1", "x3", "v3", "a3", "x6", "a4"].map(|name| {
            let column = columns.iter().find(|column| column.name == name);
            column.expect("a recorded DOF").unit.clone()
        })
    };
    assert_eq!(
        units("[6, 3]"),
        ["m", "rad", "rad/s", "rad/s2", "rad", "m/s2"]
    );
    assert_eq!(units("[]"), ["m", "m", "m/s", "m/s2", "m", "m/s2"]);
    let refused = |text: &str, rotations: &str| match built(text, rotations) {
        Ok(_) => panic!("{rotations} is taken"),
        Err(error) => error.to_string(),
    };
    shows(&refused(node, "[3, 7]"), "DOF 7");
    shows(&refused(node, "[3, 7]"), " 6,");
    shows(&refused(node, "[0]"), "DOF 0");
    shows(&refused(node, "[3, 6, 3]"), "DOF 3");
    let building = include_str!("../../../config/two-specimens.toml");
    shows(&refused(building, "[1]"), "translation");
}
