//! What a user sees: every mistake of a test file as it is shown, and what a good file becomes.

use super::*;

mod certificate;

const GOOD: &str = r#"# three storeys, the lowest in the laboratory
title = "three storeys"

[time]
rate_hz = 1024      # as the controller
duration_s = 20

[structure]
damping = { rayleigh = { mass_coefficient_per_s = 0.1, stiffness_coefficient_s = 0.001 } }
[structure.shear_building]
mass_kg = [1000, 1000, 1000]
stiffness_n_per_m = [1e6, 1e6, 1e6]

[excitation.ground_acceleration]
signal = { sine = { amplitude = 2.0, frequency_hz = 1.5 } }

[[specimen]]
name = "bottom"
storey = 1
law = { bilinear = { stiffness_n_per_m = 1e6, yield_force_n = 5e3, post_yield_ratio = 0.1 } }
"#;

const PRESCRIBED: &str = r#"
time = { step_s = 0.01, duration_s = 1 }
[[excitation.prescribed_displacement]]
specimen = "damper"
signal = { sine = { amplitude = 0.01, frequency_hz = 1.0 } }
[[specimen]]
name = "damper"
law = { linear = { stiffness_n_per_m = 1e6 } }
"#;

fn read(text: &str, sets: &[&str]) -> Result<Loaded, ConfigError> {
    let sets: Vec<String> = sets.iter().map(|s| (*s).to_owned()).collect();
    parse(Path::new("test.toml"), text.to_owned(), &sets)
}

fn accepted(text: &str, sets: &[&str]) -> Loaded {
    read(text, sets).unwrap_or_else(|error| panic!("{error}"))
}

/// The complaint about `GOOD` with `from` replaced by `to`.
fn complaint(from: &str, to: &str) -> String {
    complaint_of(GOOD, from, to)
}

fn complaint_of(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the test's own replacement {from:?}");
    read(&text.replace(from, to), &[]).unwrap_err().to_string()
}

fn complaint_about_set(arguments: &[&str]) -> String {
    read(GOOD, arguments).unwrap_err().to_string()
}

fn errors(text: &str) -> usize {
    text.matches("error: ").count()
}

#[track_caller]
fn shows(text: &str, part: &str) {
    assert!(text.contains(part), "wanted\n{part}\nin\n{text}");
}

// --- good files ---------------------------------------------------------------------------------

#[test]
fn a_good_file_gives_its_values_and_documented_defaults() {
    let loaded = accepted(GOOD, &[]);
    assert_eq!(loaded.time.steps, 20 * 1024);
    assert_eq!(loaded.time.step.terms(), (1, 1024));
    assert_eq!(loaded.file.integrator.lambda, LambdaValue::Auto);
    assert_eq!(loaded.file.time.clock, ClockChoice::Real);
    assert_eq!(loaded.file.specimen[0].sources()[0].0, "law");
    assert!(loaded.warnings.is_empty());
    assert_eq!(loaded.text, GOOD);
}

#[test]
fn time_scale_slows_the_wall_clock_and_not_the_step() {
    let loaded = accepted(GOOD, &["time.scale=10", "time.clock=simulated"]);
    assert_eq!(loaded.time.step.terms(), (1, 1024));
    assert_eq!(loaded.time.period.terms(), (5, 512));
    assert_eq!(loaded.time.clock, ClockChoice::Simulated);
}

#[test]
fn a_prescribed_test_needs_no_structure() {
    let loaded = accepted(PRESCRIBED, &[]);
    assert!(loaded.file.structure.is_none());
    assert_eq!(loaded.time.steps, 100);
}

#[test]
fn a_file_without_a_title_is_called_by_its_name() {
    assert_eq!(accepted(PRESCRIBED, &[]).file.title, "test");
}

#[test]
fn line_ends_of_windows_and_a_byte_order_mark_do_no_harm() {
    let text = format!("\u{feff}{}", GOOD.replace('\n', "\r\n"));
    accepted(&text, &[]);
    let wrong = text.replace("storey = 1", "storey = 'x'");
    let shown = read(&wrong, &[]).unwrap_err().to_string();
    shows(&shown, "test.toml:19:10");
    shows(
        &shown,
        "19 | storey = 'x'\n   |          ^^^ found the text \"x\"",
    );
}

// --- syntax, keys, types ------------------------------------------------------------------------

#[test]
fn a_syntax_error_is_shown_with_its_line() {
    let text = complaint("\"three storeys\"", "three storeys");
    shows(
        &text,
        "\
error: the file is not valid TOML
 --> test.toml:2:9
  |
2 | title = three storeys
  |         ^^^^^^^^^^^^^ string values must be quoted",
    );
    shows(&complaint("[time]", "[time"), "unclosed table");
}

#[test]
fn an_unknown_key_is_shown_with_the_key_that_was_meant() {
    let text = complaint("duration_s", "duration");
    shows(
        &text,
        "\
error: unknown key `duration` in `time`
 --> test.toml:6:1
  |
6 | duration = 20
  | ^^^^^^^^ did you mean `duration_s`?
  |
  = help: the keys here are `step_s`, `rate_hz`, `duration_s`, `ticks_per_step`, `prediction_order`, `clock` and `scale`",
    );
    // That `duration_s` is now missing follows from it and is not said.
    assert_eq!(errors(&text), 1, "{text}");
}

#[test]
fn unknown_keys_are_refused_at_every_depth() {
    let text = complaint("yield_force_n", "yield_force");
    shows(&text, "in `specimen[0].law.bilinear`");
    shows(&text, "did you mean `yield_force_n`?");
    let text = complaint("storey = 1", "storey = 1\ncolour = 'red'");
    shows(&text, "unknown key `colour` in `specimen[0]`");
    shows(&text, "not a key of this table");
    shows(
        &complaint("bilinear", "bilinaer"),
        "did you mean `bilinear`?",
    );
    shows(
        &complaint("shear_building]", "shear_bilding]"),
        "did you mean `shear_building`?",
    );
    let text = complaint("[time]", "[tme]");
    shows(&text, "did you mean `time`?");
    assert_eq!(errors(&text), 1, "{text}");
}

#[test]
fn a_wrong_type_says_what_was_found_and_what_is_wanted() {
    let text = complaint("storey = 1", "storey = \"one\"");
    shows(
        &text,
        "\
error: `specimen[0].storey` must be a whole number, zero or greater
  --> test.toml:19:10
   |
19 | storey = \"one\"
   |          ^^^^^ found the text \"one\"",
    );
    shows(
        &complaint("duration_s = 20", "duration_s = true"),
        "found `true`",
    );
    shows(
        &complaint("[1000, 1000, 1000]", "[1000, \"x\", 1000]"),
        "`structure.shear_building.mass_kg[1]` must be a number",
    );
    shows(&complaint("storey = 1", "storey = -1"), "found -1");
    shows(
        &complaint("storey = 1", "storey = 99999999999999999999"),
        "integer number overflowed",
    );
    shows(
        &complaint("law = { bilinear = {", "law = \"bilinear\" # {"),
        "a table with its parameters",
    );
}

#[test]
fn a_table_is_not_read_from_an_array() {
    let text = complaint(
        "[time]\nrate_hz = 1024      # as the controller\nduration_s = 20",
        "time = [1, 2, 3]",
    );
    shows(&text, "`time` must be a table");
    shows(&text, "found an array");
}

#[test]
fn a_missing_key_is_named() {
    let text = complaint("duration_s = 20", "");
    shows(
        &text,
        "error: missing key `duration_s` in `time`\n --> test.toml:4:1",
    );
    let text = read("", &[]).unwrap_err().to_string();
    shows(&text, "missing key `time` in the test file");
}

#[test]
fn a_name_that_is_not_in_the_list_is_shown_with_the_list() {
    let text = complaint(
        "[structure]",
        "[integrator]\nstart = \"second_order\"\n[structure]",
    );
    shows(&text, "`integrator.start` cannot be `second_order`");
    shows(&text, "did you mean `second-order`?");
}

#[test]
fn several_mistakes_are_reported_at_once_in_the_order_of_the_file() {
    let text = complaint("rate_hz = 1024", "rate_hz = 0");
    assert_eq!(errors(&text), 1);
    let file = GOOD
        .replace("rate_hz = 1024", "rate_hz = 0")
        .replace("storey = 1", "story = 1")
        .replace("5e3", "\"soft\"")
        .replace("amplitude = 2.0", "amplitude = nan");
    let text = read(&file, &[]).unwrap_err().to_string();
    assert_eq!(errors(&text), 4, "{text}");
    let at = |part: &str| {
        text.find(part)
            .unwrap_or_else(|| panic!("{part} in\n{text}"))
    };
    assert!(
        at("rate_hz") < at("amplitude")
            && at("amplitude") < at("story")
            && at("story") < at("soft")
    );
}

#[test]
fn a_flood_of_mistakes_is_cut_short() {
    let many = vec!["\"x\""; 3000].join(", ");
    let text = complaint("[1000, 1000, 1000]", &format!("[{many}]"));
    assert_eq!(errors(&text), 20);
    shows(&text, "more mistakes");
}

// --- values -------------------------------------------------------------------------------------

#[test]
fn lambda_must_be_positive() {
    for value in ["0", "-4.0", "nan", "-inf"] {
        let text = complaint(
            "[structure]",
            &format!("[integrator]\nlambda = {value}\n[structure]"),
        );
        shows(
            &text,
            "`integrator.lambda` must be a number greater than zero, `inf` or \"auto\"",
        );
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
        shows(
            &text,
            &format!("`time.{key}` must be a finite number greater than zero"),
        );
        assert_eq!(errors(&text), 1, "{text}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused_everywhere() {
    let text = complaint("1e6, yield_force_n = 5e3", "nan, yield_force_n = inf");
    shows(
        &text,
        "`specimen[0].law.bilinear.stiffness_n_per_m` must be a finite number",
    );
    shows(
        &text,
        "`specimen[0].law.bilinear.yield_force_n` must be a finite number",
    );
    shows(&text, "^^^ found nan");
    shows(
        &complaint("duration_s = 20", "duration_s = inf"),
        "`time.duration_s` must be a finite number",
    );
    shows(
        &complaint("amplitude = 2.0", "amplitude = 1e999"),
        "floating-point number overflowed",
    );
}

#[test]
fn a_duration_that_is_no_whole_number_of_steps_is_refused_with_the_nearest_that_are() {
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
    shows(
        &text,
        "the shortest duration that fits is 0.0009765625 s (1 step)",
    );
    shows(
        &complaint("duration_s = 20", "duration_s = -1"),
        "must be greater than zero",
    );
    shows(
        &complaint("duration_s = 20", "duration_s = 1e30"),
        "at most 2^53 steps",
    );
}

#[test]
fn a_duration_counts_as_whole_within_a_billionth() {
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
fn step_and_rate_together_are_refused_and_so_is_neither() {
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
    shows(&text, "neither `step_s` nor `rate_hz` is given");
}

#[test]
fn a_structure_is_of_exactly_one_kind() {
    let text = complaint(
        "[excitation.g",
        "[structure.chain]\ndofs = 3\nmass_kg = 1.0\nstiffness_n_per_m = 1.0\n[excitation.g",
    );
    shows(
        &text,
        "`structure` must have exactly one of `shear_building`, `matrices` and `chain`",
    );
    shows(&text, "two of them would be two structures");
    let text = complaint(
        "[structure.shear_building]\nmass_kg = [1000, 1000, 1000]\nstiffness_n_per_m = [1e6, 1e6, 1e6]",
        "",
    );
    shows(&text, "has none of them");
}

#[test]
fn a_specimen_sees_one_deformation_through_one_law() {
    shows(
        &complaint("storey = 1", "storey = 1\nrows = [[1, 0, 0]]"),
        "exactly one of `storey` and `rows`",
    );
    shows(
        &complaint("storey = 1", ""),
        "exactly one of `storey` and `rows`",
    );
    shows(
        &complaint("law = {", "# law = {"),
        "exactly one of `law`, `laws`, `coupled` and `link`",
    );
    shows(
        &complaint("storey = 1", "storey = 0"),
        "storeys are counted from 1",
    );
    shows(
        &complaint("law = {", "law = { linear = { stiffness_n_per_m = 1 },"),
        "must hold exactly one of",
    );
}

#[test]
fn names_of_specimens_are_unique_and_fit_for_files() {
    let second = "\n[[specimen]]\nname = \"Bottom\"\nstorey = 2\nlaw = { linear = { stiffness_n_per_m = 1 } }\n";
    let text = read(&format!("{GOOD}{second}"), &[])
        .unwrap_err()
        .to_string();
    shows(&text, "two specimens are called `Bottom`");
    shows(&text, "first here");
    for name in ["a/b", "", ".hidden", "é"] {
        let text = complaint("\"bottom\"", &format!("\"{name}\""));
        shows(&text, "cannot name a specimen");
    }
}

#[test]
fn estimates_and_axes_fit_the_specimen() {
    let with = |more: &str| complaint("storey = 1", &format!("storey = 1\n{more}"));
    shows(
        &with("stiffness_n_per_m = [[1, 2], [2, 1]]"),
        "has 1 axis, but its estimate is for 2",
    );
    shows(&with("stiffness_n_per_m = -1"), "must not be negative");
    shows(
        &with("axis = [{}, {}]"),
        "has 1 axis, but 2 `axis` tables are given",
    );
    shows(
        &with("axis = [{ sign = 2 }]"),
        "`sign` is 2, but must be 1 or -1",
    );
    shows(
        &with("axis = [{ unit_force = \"kn\" }]"),
        "did you mean `kN`?",
    );
    shows(
        &with("similitude = { length = 0 }"),
        "`specimen[0].similitude.length` must be greater than zero",
    );
    shows(&with("mass_in_force_kg = -3"), "a mass is not negative");
    let rows = |more: &str| {
        complaint(
            "storey = 1",
            &format!("rows = [[1, 0, 0], [-1, 1, 0]]\n{more}"),
        )
    };
    shows(
        &rows("damping_n_s_per_m = [[1, 2], [2.5, 1]]"),
        "the matrix is not symmetric",
    );
    shows(
        &rows("damping_n_s_per_m = [[1, 2], [2]]"),
        "the matrix is not square",
    );
    shows(
        &complaint("storey = 1", "rows = [[1, 0, 0], [1, 0]]"),
        "row 2 has 2 numbers, but row 1 has 3",
    );
    shows(
        &complaint("storey = 1", "rows = [[0, 0, 0]]"),
        "row 1 is all zero",
    );
}

#[test]
fn a_prescribed_test_is_contradicted_by_a_structure_or_its_loads() {
    let prescribed = "[[excitation.prescribed_displacement]]\nspecimen = \"bottom\"\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{GOOD}{prescribed}"), &[])
        .unwrap_err()
        .to_string();
    shows(&text, "the specimen can follow only one of them");
    let load = "[excitation.ground_acceleration]\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{PRESCRIBED}{load}"), &[])
        .unwrap_err()
        .to_string();
    shows(
        &text,
        "`excitation.ground_acceleration` loads a structure, and there is none",
    );
    shows(
        &complaint_of(
            PRESCRIBED,
            "name = \"damper\"",
            "name = \"damper\"\nstorey = 1",
        ),
        "there is none",
    );
    shows(
        &complaint_of(PRESCRIBED, "specimen = \"damper\"", "specimen = \"dampr\""),
        "did you mean `damper`?",
    );
    shows(
        &complaint_of(
            PRESCRIBED,
            "specimen = \"damper\"",
            "specimen = \"damper\"\naxis = 0",
        ),
        "axes are counted from 1",
    );
    shows(
        &complaint_of(
            PRESCRIBED,
            "specimen = \"damper\"",
            "specimen = \"damper\"\nease_in_s = 3",
        ),
        "`ease_in_s` must be inside the test, from 0 to 1 s",
    );
    let twice = "[[excitation.prescribed_displacement]]\nspecimen = \"damper\"\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{PRESCRIBED}{twice}"), &[])
        .unwrap_err()
        .to_string();
    shows(&text, "axis 1 of specimen `damper` is prescribed twice");
}

#[test]
fn relative_and_absolute_coordinates_do_not_mix() {
    let base = "[excitation.base_displacement]\nsignal = { file = { path = 'x' } }\n";
    let text = read(&format!("{GOOD}{base}"), &[]).unwrap_err().to_string();
    shows(&text, "displacements would mean nothing");
}

#[test]
fn dofs_are_counted_from_one_and_named_once() {
    let force = |dofs: &str| {
        format!(
            "{GOOD}[[excitation.nodal_force]]\n{dofs}\nsignal = {{ file = {{ path = 'x' }} }}\n"
        )
    };
    let complaint = |dofs: &str| read(&force(dofs), &[]).unwrap_err().to_string();
    shows(&complaint("dofs = [0]"), "DOFs are counted from 1");
    shows(&complaint("dofs = [1, 3, 1]"), "DOF 1 is listed twice");
    shows(
        &complaint("dofs = [1]\npattern = [1, 0, 0]"),
        "exactly one of `dofs` and `pattern`",
    );
    let text = read(GOOD, &["record.dofs=[]"]).unwrap_err().to_string();
    shows(&text, "at least one DOF is needed");
}

#[test]
fn a_structure_that_nothing_moves_is_a_warning() {
    let text = GOOD.replace("[excitation.ground_acceleration]\nsignal", "# signal");
    let warnings = accepted(&text, &[]).warnings;
    shows(
        &warnings[0].render(false),
        "warning: nothing sets the structure in motion",
    );
    accepted(&text, &["structure.initial_displacement_m=[0.1, 0, 0]"]);
}

// --- overrides ----------------------------------------------------------------------------------

#[test]
fn an_override_changes_the_test_and_leaves_the_comments() {
    let loaded = accepted(GOOD, &["time.rate_hz=512", "specimen[0].storey=2"]);
    assert_eq!(loaded.time.steps, 20 * 512);
    assert_eq!(loaded.file.specimen[0].storey, Some(2));
    let expected = GOOD
        .replace("1024", "512")
        .replace("storey = 1", "storey = 2");
    assert_eq!(loaded.effective, expected);
    assert_eq!(loaded.text, GOOD);
}

#[test]
fn an_override_of_an_unknown_key_is_shown_in_the_argument() {
    let text = complaint_about_set(&["time.duration=3"]);
    shows(
        &text,
        "\
error: unknown key `duration` in `time`
 --> command line:1:12
  |
1 | --set time.duration=3
  |            ^^^^^^^^ did you mean `duration_s`?",
    );
    shows(
        &complaint_about_set(&["timng.cpu=1"]),
        "--set timng.cpu=1\n  |       ^^^^^ did you mean `timing`?",
    );
}

#[test]
fn an_override_of_the_wrong_type_is_shown_in_the_argument() {
    let text = complaint_about_set(&["time.duration_s=2o"]);
    shows(
        &text,
        "--set time.duration_s=2o\n  |                       ^^ found the text \"2o\"",
    );
    let text = complaint_about_set(&["specimen.0.law={linear={stiffness_n_per_m=\"x\"}}"]);
    shows(
        &text,
        "`specimen[0].law.linear.stiffness_n_per_m` must be a number\n --> command line:1:49",
    );
}

#[test]
fn a_contradiction_between_file_and_override_shows_both() {
    let text = complaint_about_set(&["time.step_s=0.5"]);
    shows(
        &text,
        "5 | rate_hz = 1024      # as the controller\n  | ^^^^^^^ one of them must go",
    );
    shows(&text, "::: command line:1:19");
}

#[test]
fn the_last_of_two_overrides_counts_and_is_blamed() {
    assert_eq!(
        accepted(GOOD, &["time.duration_s=1", "time.duration_s=2"])
            .time
            .steps,
        2048
    );
    shows(
        &complaint_about_set(&["time.duration_s=1", "time.duration_s=-2"]),
        "--set time.duration_s=-2",
    );
}

// --- places for later layers --------------------------------------------------------------------

#[test]
fn a_later_layer_points_by_path_even_where_the_entry_is_absent() {
    let loaded = accepted(GOOD, &["specimen[0].storey=3"]);
    let path = |text: &str| KeyPath::parse(text).unwrap();
    let line = |text: &str| {
        let place = loaded.locator.locate(&path(text), Part::Value);
        place.span.map(|span| place.source.text[span].to_owned())
    };
    assert_eq!(line("structure.shear_building.mass_kg[2]").unwrap(), "1000");
    assert_eq!(line("specimen[0].storey").unwrap(), "3");
    assert_eq!(line("specimen[0].reach_disp_m").unwrap(), "[[specimen]]");
    assert_eq!(line("integrator.lambda"), None);
    let parameter = loaded
        .locator
        .beneath(&path("specimen[0].law"), "yield_force_n");
    assert_eq!(
        parameter.to_string(),
        "specimen[0].law.bilinear.yield_force_n"
    );
    let error = loaded.refuse([
        Finding::error(path("specimen[0].storey"), "there is no storey 3")
            .label("the building has 2"),
    ]);
    shows(
        &error.to_string(),
        "--set specimen[0].storey=3\n  |                          ^ the building has 2",
    );
}

// --- the file itself ----------------------------------------------------------------------------

#[test]
fn a_file_that_is_missing_or_no_text_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent.toml");
    shows(
        &load(&path, &[]).unwrap_err().to_string(),
        "cannot read the test file",
    );
    std::fs::write(&path, b"title = 'x'\n# \xff\n").unwrap();
    shows(
        &load(&path, &[]).unwrap_err().to_string(),
        "byte 14 on line 2",
    );
    std::fs::write(&path, GOOD).unwrap();
    assert_eq!(load(&path, &[]).unwrap().file, accepted(GOOD, &[]).file);
}

// --- resolved.toml and the schema ---------------------------------------------------------------

#[test]
fn the_resolved_file_is_the_same_test() {
    let everything = format!(
        "{GOOD}mass_in_force_kg = 12\nreach_disp_m = 0.1\nstiffness_n_per_m = 2e6\naxis = [{{ sign = -1, unit_disp = \"mm\" }}]\n\
         [[specimen]]\nname = \"two\"\nrows = [[1, 0, 0], [0, 1, 0]]\ndamping_n_s_per_m = [[1, 0], [0, 1]]\n\
         laws = [{{ linear = {{ stiffness_n_per_m = 1 }} }}, {{ linear = {{ stiffness_n_per_m = 2 }} }}]\n\
         [[specimen]]\nname = \"three\"\nstorey = 2\ncoupled = {{ stiffness_n_per_m = [[1]] }}\n\
         [[excitation.nodal_force]]\ndofs = [2]\nsignal = {{ sine = {{ amplitude = 1, frequency_hz = 2 }} }}\n\
         [[structure.element]]\nfrom = 1\nto = 2\nlaw = {{ linear = {{ stiffness_n_per_m = 1 }} }}\n\
         [structure.gravity]\ninfluence = [0, 0, 1]\n[record]\ndofs = \"all\"\n"
    );
    for sets in [
        &[][..],
        &[
            "time.rate_hz=\"4096/3\"",
            "time.duration_s=3",
            "integrator.lambda=inf",
            "integrator.start=second-order",
        ],
    ] {
        let loaded = accepted(&everything, sets);
        let text = resolve(&loaded.file, None, &loaded.inputs()).unwrap();
        let again = accepted(&text, &[]);
        assert_eq!(again.file, loaded.file, "{text}");
        assert_eq!(again.time, loaded.time);
        assert_eq!(resolve(&again.file, None, &again.inputs()).unwrap(), text);
    }
}

#[test]
fn defaults_and_overrides_stand_in_the_resolved_file() {
    let loaded = accepted(GOOD, &["time.scale=2"]);
    let text = resolve(&loaded.file, None, &loaded.inputs()).unwrap();
    for line in [
        "clock = \"real\"",
        "scale = 2",
        "method = \"gui\"",
        "start = \"published\"",
        "queue_s = 4.0",
        "require_realtime = false",
    ] {
        shows(&text, line);
    }
}

#[test]
fn an_automatic_lambda_stands_as_its_number_beside_the_request() {
    let loaded = accepted(GOOD, &[]);
    let lambda = 3.987_654_321_012_345;
    let text = resolve(&loaded.file, Some(lambda), &loaded.inputs()).unwrap();
    shows(&text, "lambda = 3.987654321012345 # requested \"auto\"\n");
    assert_eq!(
        accepted(&text, &[]).file.integrator.lambda,
        LambdaValue::Number(lambda)
    );
    let asked = accepted(GOOD, &["integrator.lambda=2"]);
    let text = resolve(&asked.file, Some(2.0), &asked.inputs()).unwrap();
    shows(&text, "lambda = 2.0\n");
}

#[test]
fn inputs_of_the_resolved_file_lie_in_the_run_folder() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("records")).unwrap();
    std::fs::write(folder.path().join("records/a.at2"), "1").unwrap();
    let path = folder.path().join("t.toml");
    std::fs::write(
        &path,
        GOOD.replace(
            "{ sine = { amplitude = 2.0, frequency_hz = 1.5 } }",
            "{ file = { path = \"records/a.at2\" } }",
        ),
    )
    .unwrap();
    let loaded = load(&path, &[]).unwrap();
    let mut inputs = loaded.inputs();
    inputs.read("records/a.at2").unwrap();
    let text = resolve(&loaded.file, None, &inputs).unwrap();
    shows(&text, "path = \"inputs/a.at2\"");
    let mut stray = loaded.inputs();
    stray.read("t.toml").unwrap();
    let error = resolve(&loaded.file, None, &stray).unwrap_err();
    assert!(matches!(error, ResolveError::Unplaced { .. }), "{error}");
}

#[test]
fn the_schema_is_json_and_describes_every_table() {
    let schema: serde_json::Value = serde_json::from_str(&json_schema()).unwrap();
    let properties = schema["properties"].as_object().unwrap();
    for table in [
        "title",
        "time",
        "structure",
        "integrator",
        "excitation",
        "specimen",
        "safety",
        "timing",
        "record",
    ] {
        assert!(properties[table]["description"].is_string(), "{table}");
    }
    assert_eq!(schema["additionalProperties"], false);
    assert_eq!(
        schema["$defs"]["IntegratorTable"]["properties"]["lambda"]["default"],
        "auto"
    );
    let structure = &schema["$defs"]["StructureTable"]["properties"];
    assert_eq!(
        structure["shear_building"]["$ref"],
        "#/$defs/ShearBuildingSpec"
    );
    assert!(schema["$defs"]["ShearBuildingSpec"]["properties"]["mass_kg"].is_object());
    assert!(!json_schema().contains("\"null\""));
}

#[test]
fn every_key_of_the_schema_is_described() {
    fn walk(value: &serde_json::Value, path: &str) {
        if let Some(properties) = value.get("properties").and_then(|p| p.as_object()) {
            for (key, schema) in properties {
                // The key of a variant is described by the variant.
                let one_of = path.contains("oneOf");
                assert!(
                    one_of || schema.get("description").is_some(),
                    "{path}.{key} has no description"
                );
            }
        }
        match value {
            serde_json::Value::Object(object) => object
                .iter()
                .for_each(|(k, v)| walk(v, &format!("{path}.{k}"))),
            serde_json::Value::Array(items) => items.iter().for_each(|v| walk(v, path)),
            _ => {}
        }
    }
    walk(&serde_json::from_str(&json_schema()).unwrap(), "");
}
