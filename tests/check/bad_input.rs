//! Every mistake of the list is explained: file, line, caret, what was found, what is allowed; exit code 2, no panic, and no run
//! folder. `check` and `run` both refuse it, and nothing moves.

use crate::common::test_file::TestFile;
use std::fs;
use std::path::Path;

use crate::common::refusal::{MATRICES, peer, pictured, plain, refused, with_record, wrong_line};
use crate::common::{FRAME, completed, names, run, say, write};
use gusset_record::Run;

#[test]
fn syntax_error_is_shown_at_its_place() {
    let words = ["valid TOML", "extra `=`"];
    wrong_line(FRAME, "rate_hz = 200", "rate_hz == 200", "=", &words);
    wrong_line(
        FRAME,
        "amplitude = 3.0",
        "amplitude = 3,0",
        "3,0",
        &["`amplitude`", "write 3.0"],
    );
}

#[test]
fn unknown_key_lists_the_valid_keys() {
    let words = [
        "`duration`",
        "`time`",
        "`duration_s`",
        "`step_s`, `rate_hz`",
    ];
    wrong_line(
        FRAME,
        "duration_s = 0.5",
        "duration = 0.5",
        "duration",
        &words,
    );
    let words = [
        "`yield_force`",
        "`specimen[0].law.bouc_wen`",
        "`yield_force_n`",
    ];
    wrong_line(
        FRAME,
        "yield_force_n = 1.5e3",
        "yield_force = 1.5e3",
        "yield_force",
        &words,
    );
    let words = ["`bouc_wen`", "allowed here: "];
    wrong_line(
        FRAME,
        "[specimen.law.bouc_wen]",
        "[specimen.law.bouc_when]",
        "bouc_when",
        &words,
    );
}

/// The unit of a target is wrong, not the signal before it.
#[test]
fn wrong_unit_is_shown_at_its_place() {
    let target = "target_peak = { value = 0.35, unit = \"mm\" }";
    let text = format!("{FRAME}\n[excitation.ground_acceleration.processing]\n{target}\n");
    let words = ["unit mm", "acceleration"];
    let under = "{ value = 0.35, unit = \"mm\" }";
    refused(&text, &[], target, under, &words);
}

#[test]
fn wrong_type_is_shown_with_the_right_one() {
    let words = ["`structure.shear_building.mass_kg`", "\"heavy\""];
    wrong_line(
        FRAME,
        "mass_kg = [1000.0, 900.0]",
        "mass_kg = \"heavy\"",
        "\"heavy\"",
        &words,
    );
    let words = ["`specimen[0].storey` must be", "found 1.5"];
    wrong_line(FRAME, "storey = 1", "storey = 1.5", "1.5", &words);
    let words = ["a fraction", "found `true`"];
    wrong_line(FRAME, "rate_hz = 200", "rate_hz = true", "true", &words);
}

#[test]
fn missing_file_suggests_a_similar_name() {
    let files = [("elcentro.at2", "x"), ("stiffness.csv", "x")];
    let record = with_record("elcntro.at2");
    let words = ["no file", "`elcentro.at2`", "relative to"];
    refused(
        &record,
        &files,
        "path = \"elcntro.at2\"",
        "\"elcntro.at2\"",
        &words,
    );
    let matrix = MATRICES
        .without("structure.matrices.stiffness")
        .with("structure.matrices.stiffness_file = 'stifness.csv'");
    let words = ["no file", "`stiffness.csv`"];
    refused(
        &matrix,
        &files,
        "stiffness_file = \"stifness.csv\"",
        "\"stifness.csv\"",
        &words,
    );
}

#[test]
fn missing_or_binary_test_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let said = say([
        "check".as_ref(),
        folder.path().join("none.toml").as_os_str(),
    ]);
    plain(&said);
    let file = folder.path().join("none.toml");
    let words = format!("cannot read {}: No such file", file.display());
    assert!(said.stderr.contains(&words), "{}", said.stderr);
    assert_eq!(said.stderr.matches("No such").count(), 1, "said once");
    fs::write(folder.path().join("bin.toml"), b"title = 1\n\xff\xfe").unwrap();
    let said = say(["check".as_ref(), folder.path().join("bin.toml").as_os_str()]);
    plain(&said);
    assert!(
        said.stderr.contains("is not UTF-8") && said.stderr.contains("line 2"),
        "{}",
        said.stderr
    );
}

#[test]
fn nan_and_infinity_are_refused_everywhere() {
    let words = ["signal.sine.amplitude`", "found nan"];
    wrong_line(FRAME, "amplitude = 3.0", "amplitude = nan", "nan", &words);
    let words = ["mass_kg[1]`", "found inf"];
    wrong_line(
        FRAME,
        "mass_kg = [1000.0, 900.0]",
        "mass_kg = [1000.0, inf]",
        "inf",
        &words,
    );
    let record = ("a.at2", &*peer("NPTS= 3, DT= .01 SEC", "0.1 NaN 0.2"));
    let words = ["a.at2:5:5: ", "NaN"];
    refused(
        &with_record("a.at2"),
        &[record],
        "path = \"a.at2\"",
        "\"a.at2\"",
        &words,
    );
    let text = MATRICES
        .without("structure.matrices.mass")
        .with("structure.matrices.mass_file = 'm.csv'");
    let words = ["m.csv, line 2, field 1: \"-inf\""];
    refused(
        &text,
        &[("m.csv", "1000,0\n-inf,1000\n")],
        "mass_file = \"m.csv\"",
        "\"m.csv\"",
        &words,
    );
}

#[test]
fn lambda_must_be_greater_than_zero() {
    for (lambda, found) in [
        ("0", "0"),
        ("-3", "-3"),
        ("-inf", "-inf"),
        ("nan", "NaN"),
        ("\"fast\"", "the text \"fast\""),
    ] {
        let wrong = format!("lambda = {lambda}");
        let found = format!("found {found}");
        let words = ["`inf`", "\"auto\"", &found];
        wrong_line(FRAME, "lambda = \"auto\"", &wrong, lambda, &words);
    }
}

#[test]
fn step_must_be_greater_than_zero() {
    for (key, value) in [
        ("step_s", "0"),
        ("step_s", "-0.01"),
        ("step_s", "nan"),
        ("rate_hz", "-200"),
        ("rate_hz", "\"0/1\""),
    ] {
        let wrong = format!("{key} = {value}");
        let subject = format!("`time.{key}` must be a finite number greater than zero");
        wrong_line(FRAME, "rate_hz = 200", &wrong, value, &[&subject, "found "]);
    }
}

/// The test runs, and both commands print `words` with a picture of the line that names the record.
#[track_caller]
fn warned(record: &str, words: &[&str]) -> Vec<Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.at2", record);
    let text = with_record("a.at2");
    let test = write(folder.path(), "test.toml", &text);
    let out = folder.path().join("out");
    let checked = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(checked.code, Some(0), "{}", checked.stderr);
    let ran = completed(&test, &out, &[]);
    for said in [checked, ran] {
        pictured(&said.stderr, &text, "path = \"a.at2\"", "\"a.at2\"", words);
    }
    let warnings = crate::common::json(&out, "summary.json")["warnings"].to_string();
    for word in words {
        assert!(warnings.contains(word), "no {word:?} in {warnings}");
    }
    Run::open(&out)
        .unwrap()
        .columns(&["time", "ground"])
        .unwrap()
}

#[test]
fn short_record_warns_and_ends_in_zeros() {
    let values = ["0.1"; 21].join(" ");
    let columns = warned(&peer("NPTS= 21, DT= .01 SEC", &values), &["0.2 s", "0.5 s"]);
    // 0.1 g at the points of the record, nothing beyond it; one step between may be interpolated.
    for (time, ground) in columns[0].iter().zip(&columns[1]) {
        let expected = if *time <= 0.2 { 0.980_665 } else { 0.0 };
        let between = (0.2..0.2 + 0.0051).contains(time);
        assert!(
            between || (ground - expected).abs() < 1e-12,
            "{time}: {ground}"
        );
    }
}

#[test]
fn wrong_count_of_points_is_refused() {
    let values = ["0.01"; 60].join(" ");
    for stated in ["80", "20", "0"] {
        let record = peer(&format!("NPTS= {stated}, DT= .01 SEC"), &values);
        let word = format!("the header announces NPTS = {stated} values, the file holds 60");
        refused(
            &with_record("a.at2"),
            &[("a.at2", &record)],
            "path = \"a.at2\"",
            "\"a.at2\"",
            &[&word],
        );
    }
    for (counts, words) in [
        (
            "NPTS= -5, DT= .01 SEC",
            "a.at2:4: wanted a whole number of points after NPTS, found \"-5\"",
        ),
        (
            "NPTS= 60, DT= 0.0 SEC",
            "a.at2:4: wanted a positive time step DT, found \"0.0\"",
        ),
    ] {
        let record = peer(counts, &values);
        refused(
            &with_record("a.at2"),
            &[("a.at2", &record)],
            "path = \"a.at2\"",
            "\"a.at2\"",
            &[words],
        );
    }
}

#[test]
fn decimal_commas_are_refused() {
    let record = peer("NPTS= 60, DT= .01 SEC", "  0,0000000E+00  2,9552021E-03");
    refused(
        &with_record("a.at2"),
        &[("a.at2", &record)],
        "path = \"a.at2\"",
        "\"a.at2\"",
        &["a.at2:5:4", "\"0,0000000E+00\""],
    );
}

#[test]
fn duration_must_be_a_whole_number_of_steps() {
    let words = [
        "whole number",
        "100.6 steps",
        "0.5 s (100 steps)",
        "0.505 s (101 steps)",
    ];
    wrong_line(
        FRAME,
        "duration_s = 0.5",
        "duration_s = 0.503",
        "0.503",
        &words,
    );
    // 1e11 steps: a slip of the pen must not ask the machine for terabytes.
    let words = ["100000000000 steps", "178956970 steps"];
    wrong_line(FRAME, "duration_s = 0.5", "duration_s = 5e8", "5e8", &words);
    for value in ["0", "-1", "inf"] {
        wrong_line(
            FRAME,
            "duration_s = 0.5",
            &format!("duration_s = {value}"),
            value,
            &["`time.duration_s` must be"],
        );
    }
}

#[test]
fn command_line_mistake_is_shown_there() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    for (set, words) in [
        ("integrator.lambda=0", "`integrator.lambda`"),
        ("integrator.lamda=4", "`lambda`"),
        ("specimen.0.storey=3", "storey 3"),
        ("time.rate_hz=", "time.rate_hz="),
    ] {
        let out = folder.path().join("out");
        let said = run(&test, &out, &["--set", set]);
        plain(&said);
        assert!(
            said.stderr.contains(words) && said.stderr.contains(set) && said.stderr.contains('^'),
            "{}",
            said.stderr
        );
        assert!(!out.exists());
    }
}

#[test]
fn nonempty_output_folder_stays_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", FRAME);
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    write(&out, "precious.txt", "keep");
    let said = run(&test, &out, &[]);
    plain(&said);
    assert!(said.stderr.contains("precious.txt"), "{}", said.stderr);
    assert_eq!(names(&out), ["precious.txt"]);
    let said = run(&test, &test, &[]);
    plain(&said);
    assert!(said.stderr.contains("a folder"), "{}", said.stderr);
    assert_eq!(fs::read_to_string(&test).unwrap(), FRAME);
    // An empty folder belongs to no run.
    fs::remove_file(out.join("precious.txt")).unwrap();
    completed(&test, &out, &[]);
}

#[test]
fn meaningless_energy_share_is_refused() {
    let refused = |safety: &str, words: &[&str]| {
        let text = format!("{}\n[safety]\n{safety}\n", FRAME);
        let path = Path::new("test.toml");
        let said = gusset_config::parse(path, text, &[])
            .map(|_| ())
            .unwrap_err();
        for words in words {
            assert!(
                said.to_string().contains(words),
                "{words:?} is not in {said}"
            );
        }
    };
    refused(
        "added_energy_share = { trip = 0.1 }",
        &["floor_j", "test.toml:"],
    );
    refused(
        "added_energy_share = { trip = 0.1, floor_j = 0 }",
        &["floor_j", "greater than"],
    );
    refused(
        "added_energy_share = { warn = 0.2, trip = 0.1, floor_j = 1 }",
        &["`added_energy_share` warns at 0.2"],
    );
    refused(
        "added_energy_share = { floor_j = 1 }",
        &["added_energy_share"],
    );
    let prescribed = "[time]\nrate_hz = 100\nduration_s = 1\n[[specimen]]\nname = \"a\"\n[specimen.law.linear]\n\
                      stiffness_n_per_m = 1e5\n[safety]\nadded_energy_share = { trip = 0.1, floor_j = 1 }\n";
    let path = Path::new("test.toml");
    let said = gusset_config::parse(path, prescribed.to_owned(), &[]).map(|_| ());
    let said = said.unwrap_err().to_string();
    assert!(said.contains("no structure"), "{said}");
}

#[test]
fn control_characters_never_reach_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let with = |from: &str, to: &str| {
        assert!(FRAME.contains(from));
        write(folder.path(), "test.toml", &FRAME.replace(from, to))
    };
    for (from, to) in [
        ("title = \"Frame\"", "title = \"a\\u001b[2Jb\""),
        ("name = \"storey\"", "name = \"a\\u001b[2Jb\""),
        ("storey = 1", "storey = \"\\u001b[2J\""),
        ("rate_hz = 200", "rate_hz = 200\n\"\\u001b[2J\" = 1"),
        ("lambda = \"auto\"", "lambda = \"\\u001b[2J\""),
        (
            "signal.sine]\namplitude = 3.0\nfrequency_hz = 2.0",
            "signal.file]\npath = \"\\u001b[2J.csv\"\nformat = \"csv\"",
        ),
    ] {
        let said = run(&with(from, to), &out, &[]);
        assert_eq!(said.code, Some(2), "{to}: {}", said.stderr);
        assert!(!said.stderr.contains('\u{1b}'), "{to}: {:?}", said.stderr);
        assert!(!out.exists());
    }
    let said = run(&folder.path().join("no\u{1b}[2J.toml"), &out, &[]);
    assert!(!said.stderr.contains('\u{1b}'), "{:?}", said.stderr);
    assert!(said.stderr.contains("\\u{1b}[2J.toml"), "{}", said.stderr);
}

#[test]
fn impossible_rate_is_refused() {
    let words = ["too fast", "1e9 Hz"];
    wrong_line(FRAME, "rate_hz = 200", "rate_hz = 1e10", "1e10", &words);
    let folder = tempfile::tempdir().unwrap();
    let text =
        FRAME.with("time = { rate_hz = 1e7, duration_s = 1e-4 }\ntiming.misses.window_s = 3600");
    let test = write(folder.path(), "test.toml", &text);
    let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let real = ["--clock".as_ref(), "real".as_ref()];
    let said = say(["run".as_ref(), test.as_os_str(), real[0], real[1]]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("1e6 Hz"));
}

#[test]
fn oversized_excitation_is_refused_early() {
    let words = ["of memory", "GiB", "178956970 steps"];
    wrong_line(FRAME, "duration_s = 0.5", "duration_s = 1e6", "1e6", &words);
}

#[test]
fn prescribed_motion_warnings_name_the_axis() {
    let text = "time = { rate_hz = 128, duration_s = 2, clock = \"simulated\" }\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"p\"\naxis = 2\n\
        signal.values = { values = [0, 1, 2, 3, 2, 0], dt_s = 0.2, unit = \"mm\" }\n\
        [[specimen]]\nname = \"p\"\n\
        laws = [{ linear = { stiffness_n_per_m = 1e5 } }, { linear = { stiffness_n_per_m = 1e5 } }]\n";
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", text);
    let said = say(["check".as_ref(), test.as_os_str(), "--verbose".as_ref()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    for words in ["axis 2: values", "axis 2 starts"] {
        assert!(said.stderr.contains(words), "{}", said.stderr);
    }
    assert!(!said.stderr.contains("axis 1"), "{}", said.stderr);
}

#[test]
fn refused_fault_number_shows_both_bounds() {
    let complaint = |fault: &str| {
        let text = format!("title = \"a\"\n[[fault]]\nat = 3\nkind = {{ {fault} }}\n");
        let script = gusset_config::parse_script(Path::new("fault.toml"), text);
        script.unwrap_err().to_string()
    };
    for (fault, words) in [
        ("late = { ticks = 1e300 }", "`ticks` is 1e300"),
        ("late = { ticks = 0 }", "`ticks` is 0"),
        ("noise = { disp_m = -1 }", "`disp_m` is -1"),
    ] {
        let said = complaint(fault);
        assert!(said.contains(words), "{said}");
    }
}
