//! Exports: other programs open them and find the numbers of the log; what cannot be exported is said.

mod common;
mod export;
#[path = "export/trace.rs"]
mod trace;

use std::fs;
use std::path::Path;

use common::{FRAME, Said, completed, copy, json, names, say, write};
use export::{TABLES, by_hand, judge, judge_in_octave, row};
use gusset::record::Run;
use sha2::{Digest, Sha256};

fn export(run: &Path, format: &str, out: &Path, more: &[&str]) -> Said {
    let (run, out) = (run.to_str().unwrap(), out.to_str().unwrap());
    let arguments = ["export", run, "--format", format, "--out", out];
    say(arguments.iter().chain(more))
}

/// Exports in every table format; what was said of the last.
fn all_tables(run: &Path, into: &Path, more: &[&str]) -> Said {
    fs::create_dir(into).unwrap();
    let each = TABLES.map(|format| {
        let said = export(run, format, &into.join(format!("run.{format}")), more);
        assert_eq!(said.code, Some(0), "{format}: {}", said.stderr);
        said
    });
    let [.., last] = each;
    last
}

fn a_run(folder: &Path) -> std::path::PathBuf {
    let test = write(folder, "frame.toml", FRAME);
    let run = folder.join("run");
    completed(&test, &run, &[]);
    run
}

#[test]
fn numpy_and_h5py_find_the_bits_of_the_log_in_every_format() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    for rate in ["step", "tick"] {
        let out = temp.path().join(rate);
        all_tables(&run, &out, &["--rate", rate]);
        let Some(said) = judge(&run, &out, rate, &TABLES) else {
            return;
        };
        assert!(said.starts_with("judged 4 formats, "), "{said}");
        assert!(said.ends_with("101 rows"), "{said}");
    }
}

#[test]
fn octave_opens_the_matlab_file_the_hdf5_file_and_the_log() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    let out = temp.path().join("out");
    all_tables(&run, &out, &["--rate", "tick"]);
    if let Some(said) = judge_in_octave(&run, &out) {
        assert!(
            said.starts_with("judged ") && said.ends_with(" 101 rows"),
            "{said}"
        );
    }
}

/// 700,000 rows of 14 columns: many blocks, many pieces of a column that a library asks for. Gaps, names that a format may not have, a run
/// without summary.
#[test]
fn a_run_of_many_blocks_arrives_whole() {
    let temp = tempfile::tempdir().unwrap();
    let run = temp.path().join("run");
    by_hand(&run, (0..700_000).map(row));
    let out = temp.path().join("out");
    let said = all_tables(&run, &out, &["--rate", "tick"]);
    assert!(said.stderr.contains("700000 rows in"), "{}", said.stderr);
    assert!(said.stderr.contains("unfinished"), "{}", said.stderr);
    if let Some(said) = judge(&run, &out, "tick", &["npz", "mat", "hdf5"]) {
        assert_eq!(said, "judged 3 formats, 14 columns, 700000 rows");
    }
    // A whole run of this length is no picture.
    let trace = out.join("trace.json");
    let said = export(&run, "trace", &trace, &[]);
    assert_eq!(said.code, Some(2));
    let reach = "700000 ticks are too many for a trace without a window, which takes 200000: the samples reach from 0 s to 699.999 s";
    assert!(said.stderr.contains(reach), "{}", said.stderr);
    assert!(!trace.exists());
    let said = export(&run, "trace", &trace, &["--from", "600", "--to", "600.01"]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stderr.contains("11 rows in"), "{}", said.stderr);
}

#[test]
fn a_torn_run_gives_what_is_sound_and_an_empty_one_gives_columns() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    fs::remove_file(run.join("summary.json")).unwrap();
    let samples = run.join("samples.bin");
    let bytes = fs::read(&samples).unwrap();
    fs::write(&samples, &bytes[..bytes.len() / 2 - 3]).unwrap();
    let out = temp.path().join("torn");
    let said = all_tables(&run, &out, &["--rate", "tick"]);
    for words in [
        "warning: the run is unfinished",
        "end in the middle of a row",
        "50 rows in",
    ] {
        assert!(said.stderr.contains(words), "{}", said.stderr);
    }
    if let Some(said) = judge(&run, &out, "tick", &TABLES) {
        assert!(said.ends_with(" 50 rows"), "{said}");
    }
    fs::write(&samples, b"").unwrap();
    let out = temp.path().join("none");
    let said = all_tables(&run, &out, &[]);
    assert!(
        said.stderr.contains("warning: there is no row"),
        "{}",
        said.stderr
    );
    // An empty table of text is not what `genfromtxt` can read.
    if let Some(said) = judge(&run, &out, "step", &["npz", "mat", "hdf5"]) {
        assert!(said.ends_with(" 0 rows"), "{said}");
    }
    assert_eq!(
        fs::read_to_string(out.join("run.csv"))
            .unwrap()
            .lines()
            .count(),
        1
    );
    let said = export(&run, "trace", &out.join("trace.json"), &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert_eq!(trace::phases(&json(&out, "trace.json")).len(), 0);
}

#[test]
fn a_window_of_test_time_is_the_same_in_every_format() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    let whole = temp.path().join("whole.csv");
    assert_eq!(export(&run, "csv", &whole, &[]).code, Some(0));
    let text = fs::read_to_string(&whole).unwrap();
    let inside = |line: &&str| {
        let time: f64 = line.split(',').next().unwrap().parse().unwrap();
        (0.1..=0.25).contains(&time)
    };
    let wanted: Vec<&str> = text.lines().skip(1).filter(inside).collect();
    let out = temp.path().join("part");
    let said = all_tables(&run, &out, &["--from", "0.1", "--to", "0.25"]);
    assert!(
        said.stderr.contains(&format!("{} rows in", wanted.len())),
        "{}",
        said.stderr
    );
    let part = fs::read_to_string(out.join("run.csv")).unwrap();
    assert_eq!(part.lines().skip(1).collect::<Vec<_>>(), wanted);
    assert!(wanted.len() > 20);
}

#[test]
fn a_project_folder_has_every_part_and_says_truly_what_is_in_it() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    let out = temp.path().join("project");
    let said = export(&run, "designsafe", &out, &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let categories = [
        "README.md",
        "analysis",
        "coordinator",
        "coordinator_output",
        "experimental_output",
        "experimental_substructure",
        "global_model",
        "project.json",
        "report",
        "simulation_output",
        "simulation_substructure",
    ];
    assert_eq!(names(&out), categories);
    let project = json(&out, "project.json");
    let files = project["files"].as_array().unwrap();
    assert!(files.len() > 20);
    for file in files {
        let bytes = fs::read(out.join(file["path"].as_str().unwrap())).unwrap();
        let digest: String = Sha256::digest(&bytes)
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        assert_eq!(
            (&file["bytes"], &file["sha256"]),
            (&bytes.len().into(), &digest.into()),
            "{file}"
        );
    }
    for name in [
        "samples.bin",
        "samples.json",
        "events.jsonl",
        "summary.json",
    ] {
        let same = fs::read(run.join(name)).unwrap()
            == fs::read(out.join("coordinator_output/log").join(name)).unwrap();
        assert!(same, "{name}");
    }
    let csv = temp.path().join("one.csv");
    export(&run, "csv", &csv, &[]);
    let read = |path: &Path| fs::read_to_string(path).unwrap();
    assert_eq!(
        read(&csv),
        read(&out.join("coordinator_output/response.csv"))
    );
    let head = |path: &str| read(&out.join(path)).lines().next().unwrap().to_owned();
    assert_eq!(
        head("simulation_output/response.csv"),
        "time,x1,x2,v1,v2,a1,a2,ground"
    );
    let measured = head("experimental_output/1-storey/measured.csv");
    assert!(
        measured.starts_with("time,target_1_1,cmd_1_1,meas_1_1,force_1_1,status_1,raw_disp_1_1,"),
        "{measured}"
    );
    assert!(!measured.contains("x1"), "{measured}");
    let sensors = json(
        &out.join("experimental_substructure/1-storey"),
        "sensors.json",
    );
    let force = sensors["channels"]
        .as_array()
        .unwrap()
        .iter()
        .find(|c| c["name"] == "force_1_1");
    assert_eq!(force.unwrap()["unit"], "N");
    // The model is whole: it is checked without the folder that it came from.
    fs::remove_dir_all(&run).unwrap();
    let model = out.join("global_model/resolved.toml");
    let said = say(["check".as_ref(), model.as_os_str()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let again = export(&out.join("coordinator_output/log"), "designsafe", &out, &[]);
    assert_eq!(again.code, Some(2), "never over what exists");
    assert!(again.stderr.contains("exists already"), "{}", again.stderr);
    let inside = export(
        &out.join("coordinator_output/log"),
        "designsafe",
        &out.join("coordinator_output/log/copy"),
        &[],
    );
    assert_eq!(inside.code, Some(2), "{}", inside.stderr);
    assert!(
        inside.stderr.contains("is inside of the run"),
        "{}",
        inside.stderr
    );
    // The log alone, without test file, is a run that can be exported.
    let bare = temp.path().join("bare");
    let said = export(
        &out.join("coordinator_output/log"),
        "designsafe",
        &bare,
        &[],
    );
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(read(&bare.join("README.md")).contains("- the run has no resolved.toml"));
}

/// Units stand in a text file: who changed one is told of it, and who exports nothing but the log is told nothing.
#[test]
fn a_description_of_the_samples_that_was_changed_is_told() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    let said = export(&run, "csv", &temp.path().join("as-it-was.csv"), &[]);
    assert!(!said.stderr.contains("warning"), "{}", said.stderr);
    fs::remove_file(run.join("test.toml")).unwrap();
    let said = export(&run, "csv", &temp.path().join("alone.csv"), &[]);
    assert!(!said.stderr.contains("was changed"), "{}", said.stderr);
    let layout = run.join("samples.json");
    let text = fs::read_to_string(&layout).unwrap();
    fs::write(&layout, text.replace("\"unit\": \"m\"", "\"unit\": \"mm\"")).unwrap();
    let said = export(&run, "csv", &temp.path().join("changed.csv"), &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr.contains("samples.json was changed"),
        "{}",
        said.stderr
    );
    let said = say(["report".as_ref(), run.as_os_str()]);
    assert!(
        said.stderr.contains("samples.json was changed"),
        "{}",
        said.stderr
    );
}

#[test]
fn what_cannot_be_exported_is_said_and_leaves_nothing_behind() {
    let temp = tempfile::tempdir().unwrap();
    let at = |name: &str| temp.path().join(name);
    let run = a_run(temp.path());
    let changed = |name: &str, change: &dyn Fn(&Path)| {
        copy(&run, &at(name));
        change(&at(name));
        at(name)
    };
    std::os::unix::fs::symlink(at("nothing"), at("dangling")).unwrap();
    fs::create_dir(at("empty")).unwrap();
    fs::create_dir(at("foreign")).unwrap();
    write(&at("foreign"), "notes.txt", "hello");
    let layout = fs::read_to_string(run.join("samples.json")).unwrap();
    let no_samples = changed("no-samples", &|path| {
        fs::remove_file(path.join("samples.bin")).unwrap()
    });
    let damaged = changed("damaged", &|path| {
        fs::write(path.join("samples.json"), &layout[..layout.len() / 2]).unwrap();
    });
    let foreign_time = changed("no-time", &|path| {
        fs::write(
            path.join("samples.json"),
            layout.replace("\"time\"", "\"clock\""),
        )
        .unwrap();
    });
    let untimed = changed("untimed", &|path| {
        fs::write(
            path.join("samples.json"),
            layout.replace("\"release_s\"", "\"release\""),
        )
        .unwrap();
    });
    let before = names(temp.path());
    let out = at("out");
    let formats = TABLES.iter().chain(&["trace", "designsafe"]);
    for format in formats {
        for (run, words) in [
            (&at("nowhere"), "nowhere does not exist"),
            (&at("frame.toml"), "frame.toml is not a folder"),
            (&at("empty"), "is empty: no run was recorded there"),
            (&at("foreign"), "is not a run folder"),
            (&no_samples, "samples.bin"),
            (&damaged, "samples.json"),
            (&foreign_time, "the samples have no column \"time\""),
        ] {
            let said = export(run, format, &out, &[]);
            assert_eq!(
                said.code,
                Some(2),
                "{format} of {}: {}",
                run.display(),
                said.stderr
            );
            assert!(said.stderr.contains(words), "{format}: {}", said.stderr);
            assert_eq!(names(temp.path()), before, "{format} of {}", run.display());
        }
        for window in [["--from", "nan"], ["--to", "nan"]] {
            let said = export(&run, format, &out, &window);
            assert_eq!(said.code, Some(2), "{}", said.stderr);
            assert!(
                said.stderr.contains("is none: wanted two numbers"),
                "{}",
                said.stderr
            );
        }
        let said = export(&run, format, &out, &["--from", "2", "--to", "1"]);
        assert!(
            said.stderr.contains("the window from 2 s to 1 s is none"),
            "{}",
            said.stderr
        );
        let said = export(&run, format, &at("empty"), &[]);
        assert!(said.stderr.contains("exists already"), "{}", said.stderr);
        let said = export(&run, format, &at("dangling"), &[]);
        assert!(said.stderr.contains("exists already"), "{}", said.stderr);
        let said = export(&run, format, &at("nowhere/deep/out"), &[]);
        assert_eq!(said.code, Some(2));
        assert!(said.stderr.contains("cannot write"), "{}", said.stderr);
        assert_eq!(names(temp.path()), before, "{format}");
    }
    let said = export(&run, "csv", Path::new("-"), &[]);
    assert!(
        said.code == Some(2) && said.stderr.contains("--out -: an export is a file"),
        "{}",
        said.stderr
    );
    let said = export(&untimed, "trace", &out, &[]);
    assert!(
        said.stderr
            .contains("no loop to draw a timeline of: the samples have no column \"release_s\""),
        "{}",
        said.stderr
    );
    let said = export(&run, "excel", &out, &[]);
    let known = "[possible values: csv, npz, mat, hdf5, trace, designsafe]";
    assert!(
        said.code == Some(2) && said.stderr.contains(known),
        "{}",
        said.stderr
    );
    assert_eq!(names(temp.path()), before);
    assert!(Run::open(&run).is_ok(), "the run is as it was");
}
