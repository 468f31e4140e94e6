//! `gusset check` with a record of each strong-motion network: the samples of `tests/records`.

use crate::common::test_file::TestFile;
use std::fs;
use std::path::Path;

use crate::common::refusal::{peer, refused, with_record};
use crate::common::{say, write};

const RECORDS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/records");

/// Checks a test with the record of `name`, and more lines of the table of the file.
fn check(name: &str, more: &str) -> crate::common::Said {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(Path::new(RECORDS).join(name), folder.path().join(name)).unwrap();
    let keys = format!("[excitation.ground_acceleration.signal.file]\n{more}");
    let test = write(folder.path(), "test.toml", &with_record(name).with(&keys));
    say(["check".as_ref(), test.as_os_str()])
}

#[test]
fn each_networks_record_is_recognised() {
    for (name, format, column) in [
        ("knet.NS", "knet", ""),
        ("kiknet.UD2", "knet", ""),
        ("cosmos.V2c", "cosmos", "Channel 2"),
        ("csmip.V1", "csmip", ""),
        ("csmip.V2", "csmip", "H1"),
        ("bhrc.V1", "csmip", "T3"),
        ("usc.s0a", "csmip", ""),
        ("renadic.v1", "renadic", "NS"),
        ("esm.ASC", "esm", ""),
        ("geonet.V1A", "geonet", ""),
        ("geonet.V2A", "geonet", "N10E"),
        ("nsmn.txt", "nsmn", "E-W"),
        ("cwa.txt", "cwa", "U"),
        ("smc.smc", "smc", ""),
        ("bbp.acc.bbp", "bbp", "N-S"),
        ("unam.asa", "unam", "N00E"),
    ] {
        let column = match column {
            "" => String::new(),
            column => format!("column = {{ name = \"{column}\" }}\n"),
        };
        for more in [column.clone(), format!("{column}format = \"{format}\"\n")] {
            let said = check(name, &more);
            assert_eq!(said.code, Some(0), "{name} {more}: {}", said.stderr);
        }
        // The unit is that of the file: another quantity is refused.
        let said = check(name, &format!("{column}unit = \"mm\"\n"));
        assert_eq!(said.code, Some(2), "{name}");
    }
}

#[test]
fn recorder_offset_is_reported_with_its_key() {
    let said = check("kiknet.UD2", "");
    let told = said.stdout + &said.stderr;
    assert!(told.contains("processing.detrend"), "{told}");
}

#[test]
fn a_component_must_be_chosen_from_a_list() {
    let name = "nsmn.txt";
    let bytes = fs::read_to_string(Path::new(RECORDS).join(name)).unwrap();
    let path = format!("path = \"{name}\"");
    let words = ["1 = \"N-S\"", "2 = \"E-W\"", "3 = \"U-D\"", "column"];
    refused(
        &with_record(name),
        &[(name, &bytes)],
        &path,
        &format!("\"{name}\""),
        &words,
    );
}

#[test]
fn contradicting_count_is_refused() {
    let name = "esm.ASC";
    let whole = fs::read_to_string(Path::new(RECORDS).join(name)).unwrap();
    let short = whole.replace("NDATA: 16", "NDATA: 17");
    let path = format!("path = \"{name}\"");
    let words = ["esm.ASC:34", "NDATA", "17", "16"];
    refused(
        &with_record(name),
        &[(name, &short)],
        &path,
        &format!("\"{name}\""),
        &words,
    );
}

#[test]
fn old_peer_header_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "old.acc",
        &peer("  4  .0100", ".1 -.1 .1 -.1"),
    );
    let test = write(folder.path(), "test.toml", &with_record("old.acc"));
    let said = say([
        "check".as_ref(),
        "--no-rehearsal".as_ref(),
        test.as_os_str(),
    ]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
}

#[test]
fn component_facts_come_from_its_file() {
    for (name, column, unit, points, dt, peak) in [
        ("cosmos.V2c", "90 deg", "g", 16, 0.01, 0.125 * 9.806_65),
        ("csmip.V2", "H1", "cm/s2", 16, 0.01, 0.987_654_32),
        ("renadic.v1", "EW", "g", 16, 0.01, 0.25 * 9.806_65),
        ("geonet.V2A", "N10E", "mm/s2", 16, 0.02, 10.234_5),
        ("nsmn.txt", "E-W", "gal", 16, 0.01, 2.205),
        ("bbp.acc.bbp", "N-S", "cm/s2", 16, 0.025, 3.215),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::copy(Path::new(RECORDS).join(name), folder.path().join(name)).unwrap();
        let text = with_record(name).with(&format!(
            "excitation.ground_acceleration.signal.file.column.name = \"{column}\""
        ));
        let test = write(folder.path(), "test.toml", &text);
        let said = say(["check".as_ref(), "--json".as_ref(), test.as_os_str()]);
        let told: serde_json::Value = serde_json::from_str(&said.stdout).unwrap();
        let record = &told["record"];
        assert_eq!(record["unit"], unit, "{name}");
        assert_eq!(record["npts"], points, "{name}");
        assert_eq!(record["dt_s"], dt, "{name}");
        let found = record["peak_m_per_s2"].as_f64().unwrap();
        assert!((found - peak).abs() < 1e-9, "{name}: {found}");
    }
}
