//! The report command: two runs on one page, tracking metrics with their noise floors, and damaged folders.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{FRAME, Said, completed, json, say, write};
use gusset_record::{Run, journal::encode};

/// Runs the frame, with a changed text, into a separate folder.
fn made(folder: &Path, name: &str, text: &str) -> PathBuf {
    let test = write(folder, &format!("{name}.toml"), text);
    let out = folder.join(name);
    completed(&test, &out, &[]);
    out
}

fn compare(folder: &Path, first: &Path, second: &Path) -> (Said, String) {
    let out = folder.join("compared.html");
    let said = say([
        "report".as_ref(),
        first.as_os_str(),
        second.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
    ]);
    (said, fs::read_to_string(&out).unwrap_or_default())
}

/// The rows of a run, changed: (row, place, value).
fn changed(out: &Path, change: &[(usize, usize, f64)]) {
    let run = Run::open(out).unwrap();
    let mut journal = run.journal().unwrap();
    let mut bytes = Vec::new();
    let mut at = 0;
    while let Some(row) = journal.next_row().unwrap() {
        let mut values = row.values.to_vec();
        for (_, place, value) in change.iter().filter(|(row, ..)| *row == at) {
            values[*place] = *value;
        }
        encode(row.sequence, &values, &mut bytes);
        at += 1;
    }
    fs::write(out.join("samples.bin"), bytes).unwrap();
}

fn place(out: &Path, column: &str) -> usize {
    Run::open(out).unwrap().layout().index_of(column).unwrap()
}

#[test]
fn equal_runs_agree_and_one_bit_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let first = made(folder.path(), "first", FRAME);
    let second = made(folder.path(), "second", FRAME);
    let (said, page) = compare(folder.path(), &first, &second);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr
            .contains("the same to the last bit: 101\u{a0}rows"),
        "{}",
        said.stderr
    );
    assert!(
        page.contains("Both runs are identical to the last bit")
            && page.contains("configurations are alike")
    );

    let x2 = place(&second, "x2");
    let old = Run::open(&second).unwrap().columns(&["x2"]).unwrap()[0][40];
    changed(&second, &[(40, x2, f64::from_bits(old.to_bits() ^ 1))]);
    let (said, page) = compare(folder.path(), &first, &second);
    assert!(
        said.stderr
            .contains("they differ first at step 40, 200\u{a0}ms, in x2:"),
        "{}",
        said.stderr
    );
    assert!(page.contains("Differences by column") && page.contains("The runs differ"));
}

#[test]
fn comparison_shows_settings_and_metrics() {
    let folder = tempfile::tempdir().unwrap();
    let first = made(folder.path(), "first", FRAME);
    let stronger = FRAME.replace("amplitude = 3.0", "amplitude = 4.0");
    let second = made(folder.path(), "second", &stronger);
    let (said, page) = compare(folder.path(), &first, &second);
    // The sine begins at zero, so the first step is the same.
    assert!(
        said.stderr
            .contains("they differ first at step 1, 5\u{a0}ms, in ground: "),
        "{}",
        said.stderr
    );
    for part in [
        "excitation.ground_acceleration.signal.sine.amplitude",
        "<td>3.0</td><td>4.0</td>",
        "second − first",
        "Hysteresis of storey",
        "storey: FEI amplitude",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn incomparable_rows_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let first = made(folder.path(), "first", FRAME);
    let finer = made(
        folder.path(),
        "finer",
        &FRAME.replace("rate_hz = 200", "rate_hz = 400"),
    );
    let (said, page) = compare(folder.path(), &first, &finer);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr.contains("0.005 s and 0.0025 s"),
        "{}",
        said.stderr
    );
    assert!(
        page.contains("Displacement of DOF 2") && page.contains("cannot be compared row by row")
    );

    let prescribed = "title = \"P\"\n[time]\nrate_hz = 200\nduration_s = 0.5\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"other\"\nease_in_s = 0.1\nsignal.cyclic = { amplitudes = [0.002], cycles_per_amplitude = 1, shape = \"sine\", frequency_hz = 2.0 }\n\
        [[specimen]]\nname = \"other\"\nlaw.linear = { stiffness_n_per_m = 1e5 }\n";
    let other = made(folder.path(), "other", prescribed);
    let (said, page) = compare(folder.path(), &first, &other);
    // The one has DOFs that the other lacks; the specimen's columns are in both.
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        page.contains("Measured displacement, specimen 1, axis 1")
            && !page.contains("Displacement of DOF")
    );
}

#[test]
fn summary_has_metrics_and_zeroing_noise() {
    let folder = tempfile::tempdir().unwrap();
    // A rig that follows perfectly but for the noise of its sensors: 0.2 mm and 10 N rms.
    let text = format!(
        "{}\n[specimen.transfer]\nseed = 3\ndisp_sensor = {{ noise_rms_m = 2e-4 }}\nforce_sensor = {{ noise_rms_n = 10.0 }}\n[safety]\nzero_s = 5.0\n",
        FRAME
            .replace("duration_s = 0.5", "duration_s = 5.0")
            .replace("amplitude = 3.0", "amplitude = 6.0")
    );
    let out = made(folder.path(), "noisy", &text);
    let metrics = &json(&out, "summary.json")["metrics"]["storey"][0];
    let number = |path: &str| {
        metrics
            .pointer(path)
            .and_then(serde_json::Value::as_f64)
            .unwrap_or(f64::NAN)
    };
    assert_eq!(number("/noise/count"), 1000.0, "{metrics:#}");
    // A standard deviation of 1000 readings is known to 1/√2000 = 2.2 %.
    assert!(
        (number("/noise/disp_std_m") / 2e-4 - 1.0).abs() < 0.1,
        "{metrics:#}"
    );
    assert!((number("/noise/force_std_n") / 10.0 - 1.0).abs() < 0.1);
    let (value, floor) = (number("/nrmse/value"), number("/nrmse/floor"));
    assert!(
        floor > 0.0 && (value / floor - 1.0).abs() < 0.1,
        "{metrics:#}"
    );
    assert!(number("/nrmse/corrected") < 0.5 * value);
    assert!(number("/samples") == 1001.0);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("noise floor") && page.contains("1000\u{a0}readings while zeroing"));

    // Without zeroing nothing is made up.
    let plain = made(folder.path(), "plain", FRAME);
    let metrics = &json(&plain, "summary.json")["metrics"]["storey"][0];
    assert_eq!(
        (&metrics["noise"], &metrics["nrmse"]["floor"]),
        (&serde_json::Value::Null, &serde_json::Value::Null)
    );
    assert_eq!(metrics["nrmse"]["value"], 0.0);
}

#[test]
fn missing_numbers_are_gaps_in_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let out = made(folder.path(), "gaps", FRAME);
    let places =
        ["x1", "v1", "meas_1_1", "force_1_1", "ground", "compute_s"].map(|name| place(&out, name));
    let gaps: Vec<_> = (20..30)
        .flat_map(|row| places.map(|at| (row, at, f64::NAN)))
        .collect();
    changed(&out, &gaps);
    let said = say(["report".as_ref(), out.as_os_str()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!page.contains("NaN<") && page.contains("Energy balance"));

    let samples = fs::read(out.join("samples.bin")).unwrap();
    fs::write(out.join("samples.bin"), &samples[..samples.len() / 2 + 3]).unwrap();
    assert_eq!(say(["report".as_ref(), out.as_os_str()]).code, Some(0));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("Damaged") && page.contains("in the middle of a row"));

    // Not one row.
    fs::write(out.join("samples.bin"), b"").unwrap();
    assert_eq!(say(["report".as_ref(), out.as_os_str()]).code, Some(0));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("No row was recorded while the test was running"));
}

#[test]
fn damaged_run_differs_from_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let first = made(folder.path(), "first", FRAME);
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let foreign = folder.path().join("foreign");
    fs::create_dir(&foreign).unwrap();
    fs::write(foreign.join("notes.txt"), "nothing of ours").unwrap();
    let damaged = made(folder.path(), "damaged", FRAME);
    fs::write(damaged.join("samples.json"), "{ \"a\": ").unwrap();
    for (bad, word) in [
        (&empty, "empty"),
        (&foreign, "foreign"),
        (&damaged, "samples.json"),
    ] {
        for arguments in [vec![bad.as_path()], vec![first.as_path(), bad.as_path()]] {
            let mut line = vec!["report".as_ref()];
            line.extend(arguments.iter().map(|path| path.as_os_str()));
            let said = say(line);
            assert!(
                said.code.is_some_and(|code| code != 0 && code != 5),
                "{}",
                said.stderr
            );
            assert!(
                said.stderr.starts_with("error: ") && said.stderr.contains(word),
                "{}",
                said.stderr
            );
        }
        assert!(!bad.join("report.html").exists() || *bad == damaged);
    }
    let said = say([
        "report".as_ref(),
        first.as_os_str(),
        "--out".as_ref(),
        "x.html".as_ref(),
    ]);
    assert_eq!(said.code, Some(2), "--out is for a comparison");
}

#[test]
fn unreadable_summary_counts_as_missing() {
    let folder = tempfile::tempdir().unwrap();
    let run = made(folder.path(), "run", FRAME);
    let events = fs::read_to_string(run.join("events.jsonl")).unwrap();
    fs::write(run.join("events.jsonl"), format!("{{\"event\": \n{events}")).unwrap();
    assert_eq!(say(["report".as_ref(), run.as_os_str()]).code, Some(0));
    let page = fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("of events.jsonl CANNOT BE READ") && !page.contains("verdict good"));
    let whole = events.lines().count();
    let all_but = |last: usize| {
        let kept = events.lines().take(whole - last);
        kept.map(|line| format!("{line}\n")).collect::<String>()
    };
    for (left, words) in [
        (Some(all_but(0)), None),
        (
            Some(all_but(1)),
            Some("Events.jsonl ends before the test did"),
        ),
        (
            Some(String::new()),
            Some("Events.jsonl ends before the test did"),
        ),
        (None, Some("Events.jsonl is not there")),
    ] {
        match left {
            Some(text) => fs::write(run.join("events.jsonl"), text).unwrap(),
            None => fs::remove_file(run.join("events.jsonl")).unwrap(),
        }
        assert_eq!(say(["report".as_ref(), run.as_os_str()]).code, Some(0));
        let page = fs::read_to_string(run.join("report.html")).unwrap();
        assert_eq!(page.contains("verdict good"), words.is_none());
        assert!(words.is_none_or(|words| page.contains(words)), "{words:?}");
    }
    fs::write(run.join("events.jsonl"), &events).unwrap();
    fs::write(run.join("summary.json"), "{ \"status\": ").unwrap();
    let out = folder.path().join("out.csv");
    for line in [
        vec!["report".as_ref(), run.as_os_str()],
        vec!["replay".as_ref(), run.as_os_str()],
        vec![
            "export".as_ref(),
            run.as_os_str(),
            "--out".as_ref(),
            out.as_os_str(),
        ],
    ] {
        let said = say(line);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        assert!(
            said.stderr.contains("summary.json is DAMAGED"),
            "{}",
            said.stderr
        );
    }
    let page = fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("Summary.json is DAMAGED") && page.contains("verdict bad"));
}

#[test]
fn cut_record_never_equals_another() {
    let folder = tempfile::tempdir().unwrap();
    let first = made(folder.path(), "first", FRAME);
    let second = made(folder.path(), "second", FRAME);
    let samples = second.join("samples.bin");
    let stride = gusset_record::Run::open(&second).unwrap().layout().stride();
    let bytes = fs::read(&samples).unwrap();
    fs::write(&samples, &bytes[..bytes.len() / stride / 2 * stride]).unwrap();
    let said = say(["report".as_ref(), second.as_os_str()]);
    assert!(
        said.stderr.contains("but the rows end at"),
        "{}",
        said.stderr
    );
    let page = fs::read_to_string(second.join("report.html")).unwrap();
    assert!(page.contains("verdict bad") && page.contains("but the rows end at"));
    let (said, page) = compare(folder.path(), &first, &second);
    assert!(
        said.stderr.contains("second run: the summary has"),
        "{}",
        said.stderr
    );
    assert!(!page.contains("verdict good"));
    // Damaged in the middle: another headline.
    let mut flipped = bytes;
    let middle = flipped.len() / 2;
    flipped[middle] ^= 4;
    fs::write(&samples, flipped).unwrap();
    let csv = folder.path().join("damaged.csv");
    for line in [
        vec!["report".as_ref(), second.as_os_str()],
        vec![
            "export".as_ref(),
            second.as_os_str(),
            "--out".as_ref(),
            csv.as_os_str(),
        ],
    ] {
        let said = say(line);
        assert_eq!(said.code, Some(1), "{}", said.stderr);
        assert!(
            said.stderr.contains("of the samples is damaged"),
            "{}",
            said.stderr
        );
    }
    assert!(
        fs::read_to_string(csv).unwrap().lines().count() > 10,
        "whole rows are exported"
    );
    let page = fs::read_to_string(second.join("report.html")).unwrap();
    assert!(page.contains("Damaged: this record") && !page.contains("Unfinished"));
    assert!(page.contains("is damaged; nothing behind it is read"));
}

/// 30 GB of zeros behind the rows, and more events of a kind than any reader looks at.
#[test]
fn report_of_endless_files_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let out = made(folder.path(), "endless", FRAME);
    let run = gusset_record::Run::open(&out).unwrap();
    let rows = run.places().unwrap();
    let before = run.events().unwrap().events.len();
    let samples = fs::File::options()
        .write(true)
        .open(out.join("samples.bin"))
        .unwrap();
    samples.set_len(30_000_000_000).unwrap();
    let line = "{\"tick\": 1, \"time\": 0.1, \"event\": \"limit_warning\", \"specimen\": 1, \"axis\": 1, \
        \"limit\": \"command_disp_m\", \"value\": 1.0, \"bound\": 0.5}\n";
    let events = out.join("events.jsonl");
    let text = fs::read_to_string(&events).unwrap();
    fs::write(&events, text + &line.repeat(10_250)).unwrap();
    let told = run.events().unwrap();
    assert_eq!(told.events.len(), before + 10_000);
    assert_eq!(
        told.left_out.into_iter().collect::<Vec<_>>(),
        [("limit_warning", 250)]
    );
    let csv = folder.path().join("endless.csv");
    for line in [
        vec!["report".as_ref(), out.as_os_str()],
        vec![
            "export".as_ref(),
            out.as_os_str(),
            "--out".as_ref(),
            csv.as_os_str(),
        ],
    ] {
        let said = say(line);
        assert_eq!(said.code, Some(1), "{}", said.stderr);
        assert!(
            said.stderr
                .contains(&format!("row {rows} of the samples is damaged")),
            "{}",
            said.stderr
        );
    }
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("events.jsonl has 250 more"));
}

#[test]
fn audit_without_a_number_proves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = made(folder.path(), "lost", FRAME);
    let page = |out: &Path| {
        assert_eq!(say(["report".as_ref(), out.as_os_str()]).code, Some(0));
        fs::read_to_string(out.join("report.html")).unwrap()
    };
    assert!(page(&out).contains("rows are booked right"));
    let last = Run::open(&out).unwrap().columns(&["x1"]).unwrap()[0].len() - 1;
    changed(&out, &[(last, place(&out, "step_audit"), f64::NAN)]);
    let page = page(&out);
    assert!(!page.contains("booked right") && page.contains("in the last row it is not a number"));
}

#[test]
fn page_shows_the_shutdown_and_limits() {
    // ±2 mm in the test, then 20 mm: 16 kN in the one, 40 kN + 0.05 · 8 MN/m · 15 mm = 46 kN in the other.
    let text = "title = \"Shutdown\"\n[time]\nrate_hz = 256\nduration_s = 4\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"column\"\nease_in_s = 0.5\n\
        signal.cyclic = { amplitudes = [0.002], cycles_per_amplitude = 2, shape = \"sine\", frequency_hz = 0.5 }\n\
        [[specimen]]\nname = \"column\"\n\
        law.bilinear = { stiffness_n_per_m = 8e6, yield_force_n = 40e3, post_yield_ratio = 0.05 }\n\
        safe_disp_m = [0.02]\n\
        [specimen.limits]\nmeasured_force_n = { warn = [-30e3, 30e3], trip = [-60e3, 60e3] }\n\
        [safety]\nat_end = \"safe_displacement\"\nexit_speed_m_per_s = 0.05\n";
    let folder = tempfile::tempdir().unwrap();
    let out = made(folder.path(), "way", text);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let page = page.replace("&quot;", "\"");
    for part in [
        "Specimen \"column\" was moved to its end position (`at_end` of the test file); last command sent 20.0\u{a0}mm, last measurements received \
         20.0\u{a0}mm and 46.0\u{a0}kN, largest force during shutdown 46.0\u{a0}kN, more than in the running test.",
        "<b>16.0\u{a0}kN</b><span>largest force of the running test, column; 46.0\u{a0}kN during shutdown",
        "1025\u{a0}steps of the running test; 161\u{a0}rows of the shutdown",
        "<td>not checked: the simulated clock misses no deadlines</td>",
        "At the end: every specimen moves to its `safe_disp_m`, at 0.05 m/s at most",
        "safe displacement: 20\u{a0}mm.",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

/// The page of a test that need not complete.
fn page_of(folder: &Path, name: &str, text: &str) -> (PathBuf, String) {
    let test = write(folder, &format!("{name}.toml"), text);
    let out = folder.join(name);
    crate::common::run(&test, &out, &[]);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    (out, page.replace("&quot;", "\""))
}

/// Two storeys of which the lower one is a spring of 6 MN/m, at 500 Hz; `more` are tables of the test.
fn two_storeys(seconds: f64, structure: &str, more: &str) -> String {
    format!(
        "title = \"Two storeys\"\n[time]\nrate_hz = 500\nduration_s = {seconds}\nclock = \"simulated\"\n[structure]\n{structure}\n\
         [structure.shear_building]\nmass_kg = [10e3, 10e3]\nstiffness_n_per_m = [0, 5e6]\ndamping_n_s_per_m = [5e3, 5e3]\n\
         [[specimen]]\nname = \"col\"\nstorey = 1\nlaw.linear = {{ stiffness_n_per_m = 6e6, damping_n_s_per_m = 0 }}\n{more}"
    )
}

#[test]
fn displaced_base_has_absolute_coordinates() {
    let base =
        "[excitation.base_displacement]\nsignal.sine = { amplitude = 0.1, frequency_hz = 0.5 }\n";
    let folder = tempfile::tempdir().unwrap();
    let (out, page) = page_of(folder.path(), "base", &two_storeys(3.0, "", base));
    let columns = Run::open(&out).unwrap().columns(&["x1", "ground"]).unwrap();
    let drifts = columns[0].iter().zip(&columns[1]).map(|(x, g)| x - g);
    let drift = drifts.fold(0.0, |most: f64, drift| {
        if drift.abs() > most.abs() {
            drift
        } else {
            most
        }
    });
    // The base moves by 100 mm: the drift is far less than x1.
    assert!((0.01..0.05).contains(&drift.abs()), "{drift}");
    let told = format!("{:.1}\u{a0}mm", 1e3 * drift).replace('-', "\u{2212}");
    assert!(page.contains(&format!("<td>storey 1</td><td>{told}</td>")));
    for title in [
        "Displacement, absolute",
        "Velocity, absolute",
        "Acceleration, absolute",
    ] {
        assert!(page.contains(title), "{title}");
    }
    assert!(!page.contains("relative to the ground"));
    let told = "Displacements, velocities and accelerations are";
    assert!(page.contains(&format!("{told} absolute.")));

    let ground = base.replace("base_displacement", "ground_acceleration");
    let (_, page) = page_of(folder.path(), "ground", &two_storeys(1.0, "", &ground));
    assert!(page.contains("Acceleration, relative to the ground") && !page.contains(", absolute"));
    assert!(page.contains(&format!("{told} relative to the ground.")));
}

/// The page draws the frame at the sample of the record where the floor drifts most.
#[test]
fn frame_is_drawn_where_it_drifts_most() {
    let text = "title = \"Portal\"\n[time]\nrate_hz = 500\nduration_s = 2\nclock = \"simulated\"\n\
        [structure.frame]\nnode = [{ name = \"A\", at_m = [0, 0], fixed = [\"x\", \"y\", \"rz\"] }, { name = \"B\", at_m = [0, 3], mass_kg = 1e4 }]\n\
        member = [{ nodes = [\"A\", \"B\"], section = \"s\" }]\nload = [{ node = \"B\", x_n = 4e4 }]\n\
        section.s.elastic = { young_pa = 2e11, area_m2 = 1e-2, inertia_m4 = 1e-4 }\n\
        [[specimen]]\nname = \"brace\"\ndeformations = [{ node = \"B\", direction = \"x\" }]\n\
        law.linear = { stiffness_n_per_m = 1e6, damping_n_s_per_m = 1e4 }\n\
        [excitation.ground_acceleration]\nsignal.sine = { amplitude = 2, frequency_hz = 1.5 }\n";
    let folder = tempfile::tempdir().unwrap();
    let (out, page) = page_of(folder.path(), "frame", text);
    let columns = Run::open(&out)
        .unwrap()
        .columns(&["state", "time", "x1"])
        .unwrap();
    let rows = (0..columns[0].len()).filter(|row| columns[0][*row] == 3.0);
    let most = rows
        .max_by(|a, b| columns[2][*a].abs().total_cmp(&columns[2][*b].abs()))
        .unwrap();
    let (time, drift) = (columns[1][most], columns[2][most]);
    // The load alone: 40 kN over 2.22 MN/m of the column and 1 MN/m of the brace.
    assert!(drift > 4e4 / 3.23e6, "{drift}");
    let told = format!(
        "At {time}\u{a0}s node B has the largest drift: {:.1}\u{a0}mm in x.",
        1e3 * drift
    );
    assert!(page.contains(&told), "{told}");
}

#[test]
fn row_of_a_trip_is_in_the_tables() {
    let more = "[specimen.limits]\nmeasured_force_n = { trip = [-59e3, 59e3] }\n\
        [excitation.ground_acceleration]\nsignal.sine = { amplitude = 3, frequency_hz = 1.5 }\n";
    let folder = tempfile::tempdir().unwrap();
    let (out, page) = page_of(folder.path(), "trip", &two_storeys(2.0, "", more));
    let run = Run::open(&out).unwrap();
    let columns = run.columns(&["state", "time", "x1", "x2"]).unwrap();
    let last = columns[0].iter().rposition(|state| *state == 8.0).unwrap();
    let peak = &json(&out, "summary.json")["peak"]["displacement"];
    assert_eq!(
        peak[0],
        columns[2][last].abs(),
        "it trips where it is largest"
    );
    let millimetres = |metres: f64| {
        let decimals = if metres.abs() < 0.01 { 2 } else { 1 };
        format!("{:.decimals$}\u{a0}mm", 1e3 * metres).replace('-', "\u{2212}")
    };
    let time = format!("{}\u{a0}s", columns[1][last]);
    let row = format!(
        "<td>DOF 1</td><td>{}</td><td>{time}</td>",
        millimetres(columns[2][last])
    );
    assert!(page.contains(&row), "{row}");
    let drift = format!(
        "<td>storey 1</td><td>{}</td>",
        millimetres(columns[2][last])
    );
    assert!(page.contains(&drift), "{drift}");
    let tile = format!(
        "<b>{}</b><span>largest displacement, DOF 2<",
        millimetres(columns[3][last])
    );
    assert!(page.contains(&tile), "{tile}");
}

#[test]
fn trip_in_startup_has_no_step() {
    let more = "[specimen.limits]\nmeasured_force_n = { trip = [-59e3, 59e3] }\n\
        [excitation.ground_acceleration]\nsignal.sine = { amplitude = 3, frequency_hz = 0.5 }\n";
    let text = two_storeys(2.0, "initial_displacement_m = [0.01, 0.01]", more);
    let folder = tempfile::tempdir().unwrap();
    let (_, page) = page_of(folder.path(), "way_in", &text);
    for part in [
        "<b>10.0\u{a0}mm</b><span>displacement at the start, DOF 1: no step was made<",
        "<b>59.0\u{a0}kN</b><span>largest force before the first step, col<",
        "and 59.0\u{a0}kN, largest force before the first step 59.0\u{a0}kN.",
        "0\u{a0}steps of the running test; ",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for part in ["during shutdown", "of the shutdown", "largest displacement"] {
        assert!(!page.contains(part), "{part}");
    }
}

#[test]
fn test_without_a_step_shows_earlier_forces() {
    let more = "[specimen.limits]\nmeasured_force_n = { trip = [-59e3, 59e3] }\n\
        [excitation.ground_acceleration]\nsignal.sine = { amplitude = 3, frequency_hz = 0.5 }\n";
    let text = two_storeys(2.0, "initial_displacement_m = [0.01, 0.01]", more);
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "way_in.toml", &text);
    let out = folder.path().join("way_in");
    let said = crate::common::run(&test, &out, &[]);
    let forces = Run::open(&out).unwrap().columns(&["force_1_1"]).unwrap();
    let largest = forces[0].iter().map(|force| force.abs());
    let largest = largest.fold(0.0, f64::max);
    assert!(largest > 59e3);
    let summary = json(&out, "summary.json");
    assert_eq!(summary["steps"], 0);
    assert_eq!(summary["force_on_the_way_in"]["col"][0], largest);
    assert_eq!(summary["peak"]["force"]["col"][0], 0.0);
    let mut lines = said.stderr.lines().map(str::trim_start);
    let line = lines.find(|line| line.starts_with("peak force"));
    let line = line.unwrap_or_else(|| panic!("{}", said.stderr));
    let kilonewtons = format!("{:.1}", 1e-3 * largest);
    assert!(
        line.starts_with("peak force before the first step, col") && line.contains(&kilonewtons),
        "{line}"
    );
}

#[test]
fn scaled_forces_are_those_of_the_structure() {
    let folder = tempfile::tempdir().unwrap();
    let shaken =
        "[excitation.ground_acceleration]\nsignal.sine = { amplitude = 1, frequency_hz = 1 }\n";
    for (name, scale) in [("plain", ""), ("scaled", "length = 3.0\nforce = 9.0\n")] {
        let text = two_storeys(1.0, "", &format!("[specimen.similitude]\n{scale}{shaken}"));
        let test = write(folder.path(), &format!("{name}.toml"), &text);
        let out = folder.path().join(name);
        let said = completed(&test, &out, &[]);
        let page = fs::read_to_string(out.join("report.html")).unwrap();
        let is_scaled = !scale.is_empty();
        let words = "as the structure sees it";
        let told = said.stderr.lines().find(|line| line.contains("peak force"));
        assert_eq!(told.unwrap().ends_with(words), is_scaled, "{}", said.stderr);
        for part in [
            &format!("<span>largest force, col, {words}<"),
            "col: 1\u{a0}m of the specimen is 3\u{a0}m of the structure, 1\u{a0}N is 9\u{a0}N.",
            ", all as the structure sees it: ",
        ] {
            assert_eq!(page.contains(part), is_scaled, "{part}");
        }
    }
}

#[test]
fn motionless_test_has_no_empty_pictures() {
    let still =
        "[excitation.ground_acceleration]\nsignal.sine = { amplitude = 0, frequency_hz = 0.5 }\n";
    let folder = tempfile::tempdir().unwrap();
    let (out, page) = page_of(folder.path(), "still", &two_storeys(0.5, "", still));
    assert!(page.contains("every energy is zero from the first step to the last"));
    assert!(!page.contains("no finite values were recorded"));
    let loops = page
        .split("<svg class=\"chart\"")
        .find(|svg| svg.contains("force against measured"));
    assert!(
        loops
            .unwrap()
            .split("</svg>")
            .next()
            .unwrap()
            .contains("h0")
    );
    let picture = folder.path().join("still.svg");
    let said = say([
        "report".as_ref(),
        out.as_os_str(),
        "--picture".as_ref(),
        picture.as_os_str(),
    ]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(fs::read_to_string(picture).unwrap().contains("h0"));
}

/// Times and values, in SI units, of a series of a page: as its script reads them from the line.
fn embedded(page: &str, label: &str, name: &str) -> Vec<(f64, f64)> {
    let charts = page.split("<svg class=\"chart\"").skip(1);
    let label = format!("aria-label=\"{label}");
    let mut charts = charts.filter(|chart| chart.contains(&label));
    let chart = charts.next().unwrap();
    let between = |text: &str, name: &str| {
        let (_, rest) = text.split_once(&format!(" {name}=\"")).unwrap();
        rest.split_once('"').unwrap().0.to_owned()
    };
    let lines = chart.split_once("<svg class=\"lines\"").unwrap().1;
    let ends = |name: &str| -> [f64; 2] {
        let text = between(lines, name).replace("&quot;", "\"");
        let axis: serde_json::Value = serde_json::from_str(&text).unwrap();
        [0, 1].map(|end| axis[end].as_f64().unwrap())
    };
    let ([x0, x1], [y0, y1]) = (ends("data-x"), ends("data-y"));
    let size = between(lines, "viewBox");
    let size: Vec<f64> = size.split(' ').map(|n| n.parse().unwrap()).collect();
    let path = lines
        .split_once(&format!("data-name=\"{name}\""))
        .unwrap()
        .1;
    let path = between(path, "d").replace('-', " -").replace('m', " ");
    let numbers = path.split_whitespace().map(|n| n.parse::<f64>().unwrap());
    let numbers: Vec<f64> = numbers.collect();
    let mut at = (0.0, 0.0);
    let point = |way: &[f64]| {
        at = (at.0 + way[0], at.1 + way[1]);
        let (across, up) = (at.0 / size[2], 1.0 - at.1 / size[3]);
        (x0 + across * (x1 - x0), y0 + up * (y1 - y0))
    };
    numbers.chunks(2).map(point).collect()
}

#[test]
fn embedded_histories_are_the_samples() {
    let folder = tempfile::tempdir().unwrap();
    let text = FRAME
        .replace("rate_hz = 200", "rate_hz = 1000")
        .replace("duration_s = 0.5", "duration_s = 20");
    let out = made(folder.path(), "run", &text);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let run = Run::open(&out).unwrap();
    for (title, series, column) in [
        ("Displacement", "DOF 1", "x1"),
        ("Displacement", "DOF 2", "x2"),
        ("Ground motion", "acceleration", "ground"),
        ("Storey drift", "storey 1", "x1"),
    ] {
        let [state, time, values] = &run.columns(&["state", "time", column]).unwrap()[..] else {
            unreachable!()
        };
        let rows = state.iter().zip(time.iter().zip(values));
        let rows: Vec<(f64, f64)> = rows
            .filter(|(state, _)| **state == 3.0)
            .map(|(_, (time, value))| (*time, *value))
            .collect();
        assert_eq!(rows.len(), 20_001);
        let peak = rows.iter().map(|row| row.1.abs()).fold(0.0, f64::max);
        let drawn = embedded(&page, title, series);
        let mut next = 0;
        for &(time, value) in &rows {
            while drawn[next].0 < time && next + 1 < drawn.len() {
                next += 1;
            }
            let (b, a) = (drawn[next], drawn[next.saturating_sub(1)]);
            let along = ((time - a.0) / (b.0 - a.0)).clamp(0.0, 1.0);
            let along = if b.0 > a.0 { along } else { 1.0 };
            let shown = a.1 + along * (b.1 - a.1);
            assert!(
                (shown - value).abs() <= 1e-3 * peak,
                "{column} at {time} s: {shown} {value}"
            );
        }
        let highest = drawn.iter().map(|point| point.1.abs()).fold(0.0, f64::max);
        assert!(
            (highest / peak - 1.0).abs() < 3e-4,
            "{column}: {highest} {peak}"
        );
    }
}
