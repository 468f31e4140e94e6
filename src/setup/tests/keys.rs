//! Good files, and mistakes of syntax, keys and types.

use super::*;

#[test]
fn good_file_gives_values_and_defaults() {
    let loaded = accepted(GOOD, &[]);
    assert_eq!(loaded.time.steps, 20 * 1024);
    assert_eq!(loaded.time.step.terms(), (1, 1024));
    assert_eq!(loaded.file.integrator.lambda, LambdaValue::Auto);
    assert_eq!(loaded.file.time.clock, ClockChoice::Real);
    assert_eq!(loaded.file.specimen[0].source().unwrap().0, "law");
    assert!(loaded.warnings.is_empty());
    assert_eq!(loaded.text, GOOD);
}

#[test]
fn time_scale_slows_only_the_wall_clock() {
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
fn file_without_a_title_uses_its_name() {
    assert_eq!(accepted(PRESCRIBED, &[]).file.title, "test");
}

#[test]
fn windows_line_ends_and_bom_are_accepted() {
    let text = format!("\u{feff}{}", GOOD.replace('\n', "\r\n"));
    accepted(&text, &[]);
    let wrong = text.replace("storey = 1", "storey = 'x'");
    let shown = read(&wrong, &[]).unwrap_err().to_string();
    shows(&shown, "test.toml:19:10");
    shows(&shown, "19 | storey = 'x'\n   |          ^^^ ");
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
fn unknown_key_suggests_the_right_one() {
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
    // The missing `duration_s` follows from it and is not reported.
    assert_eq!(errors(&text), 1, "{text}");
}

#[test]
fn unknown_keys_are_refused_at_every_depth() {
    let text = complaint("yield_force_n", "yield_force");
    shows(&text, "in `specimen[0].law.bilinear`");
    shows(&text, "`yield_force_n`");
    let text = complaint("storey = 1", "storey = 1\ncolour = 'red'");
    shows(&text, "`colour`");
    shows(&text, "`specimen[0]`");
    shows(&text, "this table");
    shows(&complaint("bilinear", "bilinaer"), "`bilinear`");
    shows(
        &complaint("shear_building]", "shear_bilding]"),
        "`shear_building`",
    );
    let text = complaint("[time]", "[tme]");
    shows(&text, "`time`");
    assert_eq!(errors(&text), 1, "{text}");
}

#[test]
fn wrong_type_shows_found_and_wanted() {
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
        "`structure.shear_building.mass_kg[1]`",
    );
    shows(&complaint("storey = 1", "storey = -1"), "found -1");
    shows(
        &complaint("storey = 1", "storey = 99999999999999999999"),
        "from 0 to 9223372036854775807",
    );
    shows(
        &complaint("law = { bilinear = {", "law = \"bilinear\" # {"),
        "parameters",
    );
    shows(
        &complaint("law = { bilinear = {", "law = 2 # {"),
        "`bilinear`",
    );
}

#[test]
fn a_table_is_not_read_from_an_array() {
    let text = complaint(
        "[time]\nrate_hz = 1024      # as the controller\nduration_s = 20",
        "time = [1, 2, 3]",
    );
    shows(&text, "`time`");
    shows(&text, "an array");
}

#[test]
fn a_missing_key_is_named() {
    let text = complaint("duration_s = 20", "");
    shows(&text, "`duration_s`");
    shows(&text, "--> test.toml:4:1");
    let text = read("", &[]).unwrap_err().to_string();
    shows(&text, "`time`");
}

#[test]
fn unknown_name_is_shown_with_the_list() {
    let text = complaint(
        "[structure]",
        "[integrator]\nstart = \"second_order\"\n[structure]",
    );
    shows(&text, "`integrator.start` cannot be `second_order`");
    shows(&text, "`second-order`");
}

#[test]
fn mistakes_come_in_file_order() {
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
