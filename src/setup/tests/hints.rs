//! Frequent slips in a test file: the finding points at them and shows the correction.

use super::*;

#[test]
fn single_bracket_shows_the_right_header() {
    let text = complaint("[[specimen]]", "[specimen]");
    shows(&text, "`specimen`");
    shows(&text, "`[[specimen]]`");
    assert_eq!(errors(&text), 1, "{text}");
    let axis = complaint(
        "law = { bilinear",
        "axis = { unit_disp = 'mm' }\nlaw = { bilinear",
    );
    shows(&axis, "`[[specimen.axis]]`");
    let text = complaint("[time]", "[[time]]");
    shows(&text, "`[time]`");
    // An array of numbers is no table, whatever its brackets are.
    let text = complaint("mass_kg = [1000, 1000, 1000]", "mass_kg = { first = 1000 }");
    assert!(!text.contains("[["), "{text}");
}

#[test]
fn decimal_comma_is_shown_as_a_point() {
    for (line, found) in [
        ("duration_s = 20,5", "write 20.5"),
        ("duration_s = 20,5e0 # twenty", "write 20.5e0"),
        ("duration_s = \"20,5\"", "`20.5`"),
        ("duration_s = \"20.5\"", "`20.5`"),
    ] {
        let text = complaint("duration_s = 20", line);
        shows(&text, found);
        shows(&text, "duration_s");
        shows(&text, "test.toml:6:");
        assert_eq!(errors(&text), 1, "{text}");
    }
    let text = complaint("amplitude = 2.0,", "amplitude = 0,01,");
    shows(&text, "`amplitude`");
    shows(&text, "write 0.01");
    let text = complaint("[1000, 1000, 1000]", "[1000, 0,05, 1000]");
    shows(&text, "write 0.05");
    let text = complaint(
        "storey = 1",
        "storey = 1\nlimits.command_disp_m.trip = [-0,5, 0,5]",
    );
    shows(&text, "array of 4");
    shows(&text, "a point");
    for (set, found) in [
        ("time.duration_s=20,5", "`20.5`"),
        (
            "specimen[0].limits.command_step_m={trip=0,05}",
            "write 0.05",
        ),
    ] {
        let text = read(GOOD, &[set]).unwrap_err().to_string();
        shows(&text, found);
    }
}

#[test]
fn comma_may_separate_thousands() {
    for (value, written) in [
        ("100,000", "write 100.000 or 100000\n"),
        ("-1,000", "write -1.000 or -1000\n"),
        ("0,125", "write 0.125\n"),
        ("1234,567", "write 1234.567\n"),
        ("1,000,000", "write 1000000\n"),
        ("12,250,000", "write 12250000\n"),
    ] {
        let line = format!("duration_s = {value}");
        let text = complaint("duration_s = 20", &line);
        shows(&text, written);
        shows(&text, "`duration_s` has a");
    }
    for (array, written) in [
        ("[1,000,000, 1e6, 1e6]", "write 1000000\n"),
        ("[1,250,000, 1e6, 1e6]", "write 1250000\n"),
        ("[1e6, 1,000, 1e6]", "write 1.000 or 1000\n"),
        ("[0,050,100, 1]", "write 0.050\n"),
    ] {
        let text = complaint("[1000, 1000, 1000]", array);
        shows(&text, written);
    }
    let text = complaint("duration_s = 20", "duration_s = \"20,500\"");
    shows(&text, "`20.500` or `20500`");
    let text = read(GOOD, &["time.duration_s=20,500"])
        .unwrap_err()
        .to_string();
    shows(&text, "`20.500` or `20500`");
}

#[test]
fn correct_comma_is_not_blamed() {
    for text in [
        "mass_kg = [1,2, three]",
        "title = 1,x",
        "a = [10,20]\nb = = 2",
    ] {
        let text = read(text, &[]).unwrap_err().to_string();
        assert!(!text.contains("decimal"), "{text}");
    }
}

#[test]
fn number_for_a_range_is_shown_as_a_range() {
    let text = complaint(
        "storey = 1",
        "storey = 1\nlimits.command_disp_m = { warn = 0.03 }",
    );
    shows(&text, "`specimen[0].limits.command_disp_m.warn`");
    shows(&text, "`[-0.03, 0.03]`");
    shows(&text, "found 0.03");
    accepted(
        GOOD,
        &["specimen[0].limits.command_disp_m={warn=[-1,2],trip=[-2.5,3]}"],
    );
}

#[test]
fn misplaced_key_is_shown_with_its_table() {
    for (from, to) in [
        ("signal = {", "scale = 2\nsignal = {"),
        ("amplitude = 2.0,", "amplitude = 2.0, scale = 2,"),
    ] {
        let text = complaint(from, to);
        shows(&text, "`scale`");
        shows(&text, "`scale_factor`");
        shows(&text, "[excitation.ground_acceleration.processing]");
        assert!(!text.contains("did you"), "{text}");
    }
    let text = complaint("title =", "duration_s = 20\ntitle =");
    shows(&text, "`duration_s`");
    shows(&text, "[time]");
}

#[test]
fn key_with_another_meaning_is_not_offered() {
    let link = "stiffness_n_per_m = 1e6\nlimits.command_disp_m.trip = [-1, 1]\nlink = { address = '127.0.0.1:4823'";
    let law = "law = { bilinear = { stiffness_n_per_m = 1e6, yield_force_n = 5e3, post_yield_ratio = 0.1 } }";
    for (from, to, key) in [
        ("storey = 1", "storey = 1\nforce = 5".to_owned(), "force"),
        ("storey = 1", "storey = 1\nlength = 5".to_owned(), "length"),
        // A key of another law.
        (
            "post_yield_ratio = 0.1",
            "post_yield_ratio = 0.1, pinching = 2".to_owned(),
            "pinching",
        ),
        (
            "post_yield_ratio = 0.1",
            "post_yield_ratio = 0.1, exponent = 2".to_owned(),
            "exponent",
        ),
        // Keys of a simulated actuator, which a specimen behind a link lacks.
        (
            law,
            format!("{link}, between_ticks = 'held' }}"),
            "between_ticks",
        ),
        (law, format!("{link}, rate_limit = 0.1 }}"), "rate_limit"),
        // Two tables have this key, and either can be meant.
        ("storey = 1", "storey = 1\ndelay = 0.1".to_owned(), "delay"),
        // A key of another kind of structure.
        (
            "mass_kg = [1000, 1000, 1000]",
            "mass_kg = [1000, 1000, 1000]\nabsolute_damper = true".to_owned(),
            "absolute_damper",
        ),
    ] {
        let text = complaint(from, &to);
        shows(&text, &format!("unknown key `{key}`"));
        assert!(!text.contains("` is a"), "{text}");
        assert!(!text.contains("did you"), "{text}");
    }
    let text = complaint("storey = 1", "storey = 1\nrate_limit = 0.1");
    shows(&text, "`rate_limit_m_per_s`");
    shows(&text, "[specimen.transfer]");
}

#[test]
fn too_many_digits_are_shown_as_a_fraction() {
    let text = complaint("rate_hz = 1024", "step_s = 0.00333333333333333");
    shows(&text, "12 digits");
    shows(&text, "\"1/300\"");
    let text = complaint("rate_hz = 1024", "rate_hz = 1024.123456789012");
    shows(&text, "\"1/1024\"");
    accepted(GOOD, &["time.rate_hz=\"3072/3\""]);
}

#[test]
fn implicit_method_lists_the_alternatives() {
    let text = read(GOOD, &["integrator.method=newmark"])
        .unwrap_err()
        .to_string();
    for method in [
        "`gui`",
        "`kr_alpha`",
        "`mkr_alpha`",
        "`newmark_average`",
        "implicit",
    ] {
        shows(&text, method);
    }
}

#[test]
fn server_file_is_not_read_as_a_test() {
    let law = "[[specimen]]\nname = 'a'\nlaw = { linear = { stiffness_n_per_m = 1e6 } }\n";
    for text in [
        law.to_owned(),
        format!("[serve]\nlisten = '127.0.0.1:0'\n{law}"),
    ] {
        let text = read(&text, &[]).unwrap_err().to_string();
        shows(&text, "`gusset serve FILE`");
        shows(&text, "`[time]`");
        assert_eq!(errors(&text), 1, "{text}");
    }
    let text = complaint("[time]", "[serve]\nlisten = '127.0.0.1:0'\n[time]");
    shows(&text, "`[serve]`");
    assert_eq!(errors(&text), 1, "{text}");
}

#[test]
fn two_links_to_one_server_are_refused() {
    let link = |name: &str, address: &str| {
        format!(
            "[[specimen]]\nname = '{name}'\nstorey = 2\nstiffness_n_per_m = 1e6\nlimits.command_disp_m.trip = [-1, 1]\n\
             link = {{ address = '{address}' }}\n"
        )
    };
    let two = |second: &str| {
        let first = link("first", "127.0.0.1:4823");
        read(&format!("{GOOD}{first}{}", link("second", second)), &[])
    };
    let text = two("localhost:4823").unwrap_err().to_string();
    shows(&text, "`first`");
    shows(&text, "`second`");
    shows(&text, "each specimen");
    assert!(!two("127.0.0.1:4824").is_err_and(|e| e.to_string().contains("same address")));
}
