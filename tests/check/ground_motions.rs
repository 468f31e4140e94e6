//! Ground motions as other programs write them: `check` reads each with the right unit, step and peak and reports them, or refuses
//! the file with the reason.

use crate::common::refusal::{plain, with_record};
use crate::common::test_file::TestFile;
use crate::common::{Said, say, write};
use gusset_motion::STANDARD_GRAVITY;
use serde_json::Value;

/// `check` of a frame under the record `bytes`, with further keys of its table.
fn check(name: &str, bytes: &[u8], keys: &str, options: &[&str]) -> Said {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    let keys = format!("[excitation.ground_acceleration.signal.file]\n{keys}");
    let test = write(folder.path(), "test.toml", &with_record(name).with(&keys));
    let mut arguments = vec!["check".into(), test.into_os_string()];
    arguments.extend(options.iter().map(Into::into));
    say(arguments)
}

/// The record as `check` reports it in JSON.
#[track_caller]
fn record(name: &str, bytes: &[u8], keys: &str) -> Value {
    let said = check(name, bytes, keys, &["--json", "--no-rehearsal"]);
    assert_eq!(said.code, Some(0), "{name}: {}", said.stderr);
    let found: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(found["record"], found["records"][0]);
    found["record"].clone()
}

#[track_caller]
fn near(found: &Value, wanted: f64) {
    let found = found.as_f64().unwrap_or(f64::NAN);
    // Products of a few factors: a few roundings.
    assert!(
        (found - wanted).abs() <= 1e-12 * wanted.abs(),
        "{found} {wanted}"
    );
}

#[test]
fn check_reports_the_record_it_read() {
    let text = "Time (s),East [cm/s2],North [gal]\n0.00,10,1\n0.02,-98.0665,2\n0.04,30,3\n";
    let keys = "column = { name = \"East [cm/s2]\" }";
    let found = record("a.csv", text.as_bytes(), keys);
    assert_eq!(found["file"], "a.csv");
    assert_eq!(found["format"], "csv");
    assert_eq!(found["column"], "East [cm/s2]");
    assert_eq!(found["column_number"], 2);
    assert_eq!(found["unit"], "cm/s2");
    assert_eq!(found["npts"], 3);
    near(&found["dt_s"], 0.02);
    near(&found["duration_s"], 0.04);
    near(&found["peak_m_per_s2"], 0.980_665);
    near(&found["peak_g"], 0.1);
    for (options, peak) in [
        (&["--no-rehearsal"][..], "0.1 g"),
        (&["--no-rehearsal", "--verbose"], "0.1 g"),
    ] {
        let said = check("a.csv", text.as_bytes(), keys, options);
        // The short page may break the line once.
        let row = said.stdout.find("a.csv").map(|at| &said.stdout[at..]);
        let row = row.unwrap_or_else(|| panic!("{}", said.stdout));
        let row = row.lines().take(2).map(str::trim);
        let row = row.collect::<Vec<_>>().join(" ");
        for part in ["csv", "column 2", "cm/s2", "3 points", "20", peak] {
            assert!(row.contains(part), "no {part:?} in {row}");
        }
    }
    // A motion from a formula has no record.
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", crate::common::FRAME);
    let json = ["--json", "--no-rehearsal"].map(Into::into);
    let said = say(["check".into(), test.into_os_string()]
        .into_iter()
        .chain(json));
    let found: Value = serde_json::from_str(&said.stdout).unwrap();
    assert_eq!(found["record"], Value::Null);
    assert_eq!(found["records"].as_array().unwrap().len(), 0);
}

#[test]
fn foreign_tables_have_their_units() {
    let utf16: Vec<u8> = "\u{feff}t;a (g)\r\n0;0,1\r\n0,01;0,2\r\n"
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    for (name, bytes, keys, dt, npts, peak) in [
        // A header between blanks, with times in minutes and milliseconds.
        (
            "min.txt",
            &b"Time [min]  Acc [g]\n0.0 0.1\n0.001 -0.2\n0.002 0.1\n"[..],
            "",
            0.06,
            3,
            0.2 * STANDARD_GRAVITY,
        ),
        (
            "ms.txt",
            b"Time [msec] Acc [m/sec^2]\n0 0.1\n10 -0.2\n20 0.1\n",
            "",
            0.01,
            3,
            0.2,
        ),
        // numpy.savetxt with a header.
        (
            "numpy.txt",
            b"# time [ms], acc [g]\n0.0e+00 1.0e-01\n1.0e+01 2.0e-01\n",
            "",
            0.01,
            2,
            0.2 * STANDARD_GRAVITY,
        ),
        // A recorder of OpenSees with times and three columns.
        (
            "accel.out",
            b"0.01 0.1 0.2 0.3\n0.02 0.1 -0.4 0.3\n0.03 0.1 0.2 0.3\n",
            "column = { number = 3 }\nunit = \"m/s2\"",
            0.01,
            3,
            0.4,
        ),
        // A spreadsheet of a country with decimal commas.
        (
            "excel.csv",
            b"sep=;\r\nTime;Acc\r\n(s);(g)\r\n0,00;0,1\r\n0,01;0,2\r\n",
            "",
            0.01,
            2,
            0.2 * STANDARD_GRAVITY,
        ),
        (
            "comma.txt",
            b"t [s]  a [g]\r\n0,00  0,1\r\n0,01  0,2\r\n\x1a\x1a",
            "",
            0.01,
            2,
            0.2 * STANDARD_GRAVITY,
        ),
        ("wide.csv", &utf16, "", 0.01, 2, 0.2 * STANDARD_GRAVITY),
        // Count and step, then the values.
        (
            "list.txt",
            b"Somewhere 1999, acceleration in units of g\n5 0.005\n0.1 0.2 0.3\n0.1 0.1\n",
            "",
            0.005,
            5,
            0.3 * STANDARD_GRAVITY,
        ),
        // Lines of a logger, the last of which would pass for a row.
        (
            "logger.dat",
            b"logger 7\n1999 12\n3 4\n0.00 0.1\n0.01 0.2\n",
            "skip_rows = 3\nunit = \"%g\"",
            0.01,
            2,
            0.002 * STANDARD_GRAVITY,
        ),
        (
            "tenth.txt",
            b"acc (G/10)\n1\n-2\n",
            "dt_s = 0.01",
            0.01,
            2,
            0.2 * STANDARD_GRAVITY,
        ),
    ] {
        let found = record(name, bytes, keys);
        near(&found["dt_s"], dt);
        assert_eq!(found["npts"], npts, "{name}");
        near(&found["peak_m_per_s2"], peak);
    }
}

#[test]
fn ambiguous_file_names_the_missing_key() {
    for (name, text, keys, words) in [
        (
            "a.csv",
            "time (samples),acc (g)\n0,1\n10,2\n20,3\n",
            "",
            &["time (samples)", "dt_s"][..],
        ),
        (
            "a.txt",
            "Time Acc [mils]\n0 1\n1 2\n",
            "",
            &["Acc [mils]", "unit"],
        ),
        ("a.txt", "5 0.01\n1\n2\n3\n", "unit = \"g\"", &["5", "3"]),
        (
            "a.txt",
            "1,000 2,500\n2,000 3,500\n",
            "unit = \"g\"",
            &["a.txt:1:2"],
        ),
        (
            "a.txt",
            "0 1 2\n1 2 3\n",
            "unit = \"g\"",
            &["column", "3 column"],
        ),
        (
            "a.AT2",
            "a\nb\nc\nNPTS= 2, DT= .01 SEC\n0.1 0.2\n",
            "format = \"peer\"\nskip_rows = 1",
            &["skip_rows"],
        ),
    ] {
        let said = check(name, text.as_bytes(), keys, &[]);
        plain(&said);
        for word in words {
            assert!(said.stderr.contains(word), "no {word:?} in {}", said.stderr);
        }
    }
}

#[test]
fn suspicious_values_give_a_warning() {
    let even: String = (0..9)
        .map(|i| format!("{}\n", 0.01 * f64::from(i)))
        .collect();
    for (text, keys, word) in [
        ("4\n0.1\n0.2\n-0.1\n0.3\n", "unit = \"m/s2\"", "skip_rows"),
        (even.as_str(), "unit = \"g\"", "rise evenly"),
        ("0.1\n60\n0.2\n", "unit = \"g\"", "is 60 g"),
        ("0.1\n-0.6\n0.2\n", "unit = \"mg\"", "is 6e-4 g"),
    ] {
        let keys = format!("dt_s = 0.01\n{keys}");
        let said = check("a.txt", text.as_bytes(), &keys, &["--no-rehearsal"]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        assert!(said.stderr.contains(word), "no {word:?} in {}", said.stderr);
    }
    let keys = "dt_s = 0.01\nunit = \"g\"";
    let said = check("a.txt", b"0.1\n-0.3\n0.2\n0.1\n", keys, &["--no-rehearsal"]);
    for word in ["skip_rows", "evenly", "peak ground"] {
        assert!(!said.stderr.contains(word), "{}", said.stderr);
    }
}

#[test]
fn given_step_overrules_nonuniform_times() {
    let text = "t a\n0 0.1\n0.01 0.2\n0.05 0.3\n0.06 0.1\n";
    let unit = "unit = \"g\"";
    let refused = check("a.txt", text.as_bytes(), unit, &[]);
    plain(&refused);
    assert!(refused.stderr.contains("a.txt:4"), "{}", refused.stderr);
    let keys = format!("{unit}\ndt_s = 0.01");
    let found = record("a.txt", text.as_bytes(), &keys);
    near(&found["dt_s"], 0.01);
    let said = check("a.txt", text.as_bytes(), &keys, &["--no-rehearsal"]);
    assert!(said.stderr.contains("by 0.03 s"), "{}", said.stderr);
}
