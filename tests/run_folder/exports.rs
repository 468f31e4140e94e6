//! Exports: other programs open them and find the numbers of the log; refused exports give a reason.

use std::fs;
use std::path::Path;

use crate::common::test_file::TestFile;
use crate::common::{FRAME, Said, completed, copy, json, names, say, write};
use crate::readers::{TABLES, by_hand, judge, judge_in_octave, row};
use gusset_record::Run;
use sha2::{Digest, Sha256};

pub fn export(run: &Path, format: &str, out: &Path, more: &[&str]) -> Said {
    let (run, out) = (run.to_str().unwrap(), out.to_str().unwrap());
    let arguments = ["export", run, "--format", format, "--out", out];
    say(arguments.iter().chain(more))
}

/// Exports in every table format; returns the output of the last.
fn all_tables(run: &Path, into: &Path, more: &[&str]) -> Said {
    fs::create_dir(into).unwrap();
    let each = TABLES.map(|format| {
        let said = export(run, format, &into.join(format!("run.{format}")), more);
        assert_eq!(said.code, Some(0), "{format}: {}", said.stderr);
        let version = match format {
            "mat" => "(MATLAB level 5)",
            "mat73" => "(MATLAB 7.3)",
            _ => "",
        };
        assert!(said.stderr.contains(version), "{format}: {}", said.stderr);
        said
    });
    let [.., last] = each;
    last
}

fn a_run(folder: &Path) -> std::path::PathBuf {
    let test = write(
        folder,
        "frame.toml",
        &FRAME.with("about = { operator = \" \", notes = \"Σ 😀\" }"),
    );
    let run = folder.join("run");
    completed(&test, &run, &[]);
    run
}

#[test]
fn numpy_and_h5py_find_the_bits() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    for rate in ["step", "tick"] {
        let out = temp.path().join(rate);
        all_tables(&run, &out, &["--rate", rate]);
        let Some(said) = judge(&run, &out, rate, &TABLES) else {
            return;
        };
        assert!(said.starts_with("judged 7 formats, "), "{said}");
        assert!(said.ends_with("101 rows"), "{said}");
    }
}

#[test]
fn octave_opens_every_format() {
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

/// 700,000 rows of 14 columns: many blocks, many pieces of a column that a library reads. Gaps, names that a format may forbid, a
/// run without summary.
#[test]
fn a_run_of_many_blocks_arrives_whole() {
    let temp = tempfile::tempdir().unwrap();
    let run = temp.path().join("run");
    by_hand(&run, (0..700_000).map(row));
    let out = temp.path().join("out");
    let said = all_tables(&run, &out, &["--rate", "tick"]);
    assert!(said.stderr.contains("700000 rows in"), "{}", said.stderr);
    assert!(said.stderr.contains("unfinished"), "{}", said.stderr);
    // The Python package `mcap` needs a minute for the messages.
    if let Some(said) = judge(&run, &out, "tick", &TABLES[1..6]) {
        assert_eq!(said, "judged 5 formats, 14 columns, 700000 rows");
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
fn torn_run_exports_its_sound_rows() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    fs::remove_file(run.join("summary.json")).unwrap();
    let samples = run.join("samples.bin");
    let bytes = fs::read(&samples).unwrap();
    fs::write(&samples, &bytes[..bytes.len() / 2 - 3]).unwrap();
    let out = temp.path().join("torn");
    let said = all_tables(&run, &out, &["--rate", "tick"]);
    for words in ["unfinished", "the middle", "50 rows in"] {
        assert!(said.stderr.contains(words), "{}", said.stderr);
    }
    if let Some(said) = judge(&run, &out, "tick", &TABLES) {
        assert!(said.ends_with(" 50 rows"), "{said}");
    }
    fs::write(&samples, b"").unwrap();
    let out = temp.path().join("none");
    let said = all_tables(&run, &out, &[]);
    assert!(said.stderr.contains("no row"), "{}", said.stderr);
    // `genfromtxt` cannot read an empty table of text.
    if let Some(said) = judge(&run, &out, "step", &TABLES[1..]) {
        assert!(said.ends_with(" 0 rows"), "{said}");
    }
    assert_eq!(
        fs::read_to_string(out.join("run.csv"))
            .unwrap()
            .lines()
            .count(),
        2,
        "names and units"
    );
    let said = export(&run, "trace", &out.join("trace.json"), &[]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert_eq!(crate::trace::phases(&json(&out, "trace.json")).len(), 0);
}

#[test]
fn time_window_is_the_same_in_every_format() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    let whole = temp.path().join("whole.csv");
    assert_eq!(export(&run, "csv", &whole, &[]).code, Some(0));
    let text = fs::read_to_string(&whole).unwrap();
    let inside = |line: &&str| {
        let time: f64 = line.split(',').next().unwrap().parse().unwrap();
        (0.1..=0.25).contains(&time)
    };
    let wanted: Vec<&str> = text.lines().skip(2).filter(inside).collect();
    let out = temp.path().join("part");
    let said = all_tables(&run, &out, &["--from", "0.1", "--to", "0.25"]);
    assert!(
        said.stderr.contains(&format!("{} rows in", wanted.len())),
        "{}",
        said.stderr
    );
    let part = fs::read_to_string(out.join("run.csv")).unwrap();
    assert_eq!(part.lines().skip(2).collect::<Vec<_>>(), wanted);
    assert!(wanted.len() > 20);
}

/// Names and numbers of a CSV, column by column.
fn columns_of(csv: &Path) -> std::collections::BTreeMap<String, Vec<f64>> {
    let text = fs::read_to_string(csv).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let column = |at: usize| rows.iter().map(|row| row[at]).collect();
    let each = head.iter().enumerate();
    each.map(|(at, name)| ((*name).to_owned(), column(at)))
        .collect()
}

/// The run of a test file, exported with every column that follows from the recorded ones, or with these.
fn exported_with(folder: &Path, test: &str, with: &str) -> (Said, std::path::PathBuf) {
    let file = write(folder, "test.toml", test);
    let run = folder.join("run");
    completed(&file, &run, &[]);
    let csv = folder.join("out.csv");
    (export(&run, "csv", &csv, &["--with", with]), csv)
}

const ALL: &str = "absolute-acceleration,storey-drift,storey-shear";

/// Without damping the storeys carry the forces of their springs and the specimen: an equation that the export does not use.
#[test]
fn inertia_shears_equal_storey_forces() {
    let temp = tempfile::tempdir().unwrap();
    let undamped = FRAME.without("structure.damping");
    assert_ne!(undamped, FRAME);
    let (said, csv) = exported_with(temp.path(), &undamped, ALL);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let found = columns_of(&csv);
    let column = |name: &str| &found[name];
    let rows = column("time").len();
    assert_eq!(rows, 101);
    let peak = column("shear1")
        .iter()
        .fold(0.0, |m: f64, v| m.max(v.abs()));
    assert!(peak > 1e3, "{peak}");
    for k in 0..rows {
        // The ground moves by 3 m/s² at 2 Hz.
        let ground = 3.0 * libm::sin(std::f64::consts::TAU * 2.0 * 0.005 * k as f64);
        assert!((column("ground")[k] - ground).abs() < 1e-12);
        for dof in ["1", "2"] {
            let wanted = column(&format!("a{dof}"))[k] + ground;
            let found = column(&format!("abs_a{dof}"))[k];
            assert!((found - wanted).abs() < 1e-12, "{k}: {found} {wanted}");
        }
        let drift = column("x2")[k] - column("x1")[k];
        assert_eq!(column("drift1")[k], column("x1")[k]);
        assert_eq!(column("drift2")[k], drift);
        for (name, wanted) in [("shear1", column("force_1_1")[k]), ("shear2", 4e5 * drift)] {
            let found = column(name)[k];
            let off = (found - wanted).abs();
            assert!(off < 1e-9 * peak, "{name} {k}: {found} {wanted}");
        }
    }
}

/// Two components of a shear building: each enters the absolute acceleration of a floor by its own influence.
#[test]
fn components_enter_absolute_values() {
    let temp = tempfile::tempdir().unwrap();
    let test = FRAME.without("excitation.ground_acceleration").without("structure.damping").with(
        "[[excitation.ground_acceleration]]\ninfluence = [1, 1]\nsignal.sine = { amplitude = 3, frequency_hz = 2 }\n\
         [[excitation.ground_acceleration]]\ninfluence = [0, 0.5]\nsignal.sine = { amplitude = 2, frequency_hz = 5 }\n",
    );
    let (said, csv) = exported_with(temp.path(), &test, ALL);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let found = columns_of(&csv);
    let at = |name: &str, k: usize| found[name][k];
    for k in 0..101 {
        let [first, second] = ["ground_1", "ground_2"].map(|name| at(name, k));
        assert!((at("abs_a1", k) - at("a1", k) - first).abs() < 1e-12);
        assert!((at("abs_a2", k) - at("a2", k) - first - 0.5 * second).abs() < 1e-12);
        // Undamped: the lower storey carries the force of the specimen.
        assert!((at("shear1", k) - at("force_1_1", k)).abs() < 1e-6);
    }
    let page = fs::read_to_string(temp.path().join("run/report.html")).unwrap();
    for title in [
        "Ground motion, 1",
        "Ground motion, 2",
        "relative to the ground",
    ] {
        assert!(page.contains(title), "{title}");
    }
}

#[test]
fn displaced_base_has_absolute_values() {
    let temp = tempfile::tempdir().unwrap();
    let base = FRAME.without("excitation.ground_acceleration").with(
        "excitation.base_displacement.signal.sine = { amplitude = 0.003, frequency_hz = 2.0 }",
    );
    let (said, csv) = exported_with(temp.path(), &base, ALL);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let found = columns_of(&csv);
    assert_eq!(found["abs_a1"], found["a1"]);
    assert_eq!(found["abs_a2"], found["a2"]);
    let at = |name: &str, k: usize| found[name][k];
    for k in 0..101 {
        assert_eq!(at("drift1", k), at("x1", k) - at("ground", k));
        let shear = -(1000.0 * at("a1", k) + 900.0 * at("a2", k));
        assert!((at("shear1", k) - shear).abs() <= 1e-12 * shear.abs());
    }
    let units = fs::read_to_string(&csv).unwrap();
    let units = units.lines().nth(1).unwrap();
    assert!(units.starts_with("# units: time s,x1 m,"), "{units}");
    assert!(
        units.contains(",ground m,") && units.ends_with(",shear2 N"),
        "{units}"
    );
}

#[test]
fn underivable_columns_are_refused() {
    let matrices = "[structure.matrices]\nmass = [[1000.0, 0], [0, 900.0]]\nstiffness = [[4e5, -4e5], [-4e5, 4e5]]\n";
    let matrices = FRAME
        .without("structure.shear_building")
        .without("specimen.0.storey")
        .with(&format!("{matrices}[specimen]\nrows = [[1, 0]]\n"));
    let pulled = FRAME.without("excitation.ground_acceleration").with(
        "[[excitation.nodal_force]]\ndofs = [2]\nsignal.sine = { amplitude = 100.0, frequency_hz = 2.0 }\n",
    );
    let own = FRAME.without("specimen").without("integrator.lambda").with(
        "structure.shear_building.stiffness_n_per_m = [5e5, 4e5]\n\
         integrator = { method = \"kr_alpha\", rho_infinity = 0.8, weighting = \"state\" }\n",
    );
    let heavy = FRAME.with("specimen.mass_in_force_kg = 20.0");
    for (test, with, words) in [
        (&matrices, "storey-drift", "[structure.matrices]"),
        (&matrices, "storey-shear", "[structure.matrices]"),
        (
            &pulled,
            "absolute-acceleration",
            "[excitation.ground_acceleration]",
        ),
        (&pulled, "storey-shear", "excitation.nodal_force"),
        (&own, "storey-shear", "integrator.weighting"),
        (&heavy, "storey-shear", "mass_in_force_kg"),
    ] {
        let temp = tempfile::tempdir().unwrap();
        let (said, csv) = exported_with(temp.path(), test, with);
        assert_eq!(said.code, Some(2), "{with}: {}", said.stderr);
        assert!(said.stderr.contains(words), "{with}: {}", said.stderr);
        assert!(!csv.exists());
    }
    // Between the ends of steps the ground moves on, and the acceleration does not.
    let temp = tempfile::tempdir().unwrap();
    let fine = FRAME.with("time.ticks_per_step = 2");
    let (said, csv) = exported_with(temp.path(), &fine, ALL);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let (run, ticks) = (temp.path().join("run"), temp.path().join("ticks.csv"));
    for (with, code) in [("absolute-acceleration", 2), ("storey-drift", 0)] {
        let said = export(&run, "csv", &ticks, &["--rate", "tick", "--with", with]);
        assert_eq!(said.code, Some(code), "{with}: {}", said.stderr);
    }
    let rows = |csv: &Path| columns_of(csv)["drift2"].len();
    assert_eq!((rows(&csv), rows(&ticks)), (101, 201));
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    let out = temp.path().join("out");
    for (format, more) in [
        ("trace", ["--with", "storey-drift"]),
        ("npz", ["--no-units-line", "--rate=step"]),
    ] {
        let said = export(&run, format, &out, &more);
        assert_eq!(said.code, Some(2), "{format}: {}", said.stderr);
        assert!(said.stderr.contains("--format"), "{}", said.stderr);
    }
}

/// The reader of records takes names and units from the two lines of the header, and opting out gives the names and numbers alone.
#[test]
fn exported_ground_motion_is_usable_again() {
    let temp = tempfile::tempdir().unwrap();
    let run = a_run(temp.path());
    let (csv, plain) = (temp.path().join("out.csv"), temp.path().join("plain.csv"));
    assert_eq!(export(&run, "csv", &csv, &[]).code, Some(0));
    assert_eq!(
        export(&run, "csv", &plain, &["--no-units-line"]).code,
        Some(0)
    );
    let text = fs::read_to_string(&csv).unwrap();
    let without: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(text.lines().count(), without.len() + 1);
    assert_eq!(
        fs::read_to_string(&plain)
            .unwrap()
            .lines()
            .collect::<Vec<_>>(),
        without
    );
    let again = FRAME.without("excitation.ground_acceleration.signal.sine").with(
        "excitation.ground_acceleration.signal.file = { path = \"out.csv\", column.name = \"ground\" }",
    );
    assert_ne!(again, FRAME);
    let file = write(temp.path(), "again.toml", &again);
    let second = temp.path().join("again");
    completed(&file, &second, &[]);
    let ground = |run: &Path| Run::open(run).unwrap().columns(&["ground"]).unwrap();
    assert_eq!(ground(&second), ground(&run));
}

#[test]
fn project_folder_has_every_part() {
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
        "designsafe.json",
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
    assert!(inside.stderr.contains("inside"), "{}", inside.stderr);
    // The log alone, without test file, is a run that can be exported.
    let bare = temp.path().join("bare");
    let said = export(
        &out.join("coordinator_output/log"),
        "designsafe",
        &bare,
        &[],
    );
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(read(&bare.join("README.md")).contains("no resolved.toml"));
}

/// Units are in a text file: the export warns if one was changed. An export of the log alone gives no warning.
#[test]
fn changed_sample_description_is_reported() {
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
fn refused_export_leaves_nothing_behind() {
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
            (&at("nowhere"), "not exist"),
            (&at("frame.toml"), "a folder"),
            (&at("empty"), "is empty"),
            (&at("foreign"), "run folder"),
            (&no_samples, "samples.bin"),
            (&damaged, "samples.json"),
            (&foreign_time, "\"time\""),
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
            assert!(said.stderr.contains("second time"), "{}", said.stderr);
        }
        let said = export(&run, format, &out, &["--from", "2", "--to", "1"]);
        assert!(said.stderr.contains("2 s to 1 s"), "{}", said.stderr);
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
        said.code == Some(2) && said.stderr.contains("--out -"),
        "{}",
        said.stderr
    );
    let said = export(&untimed, "trace", &out, &[]);
    assert!(said.stderr.contains("\"release_s\""), "{}", said.stderr);
    let said = export(&run, "excel", &out, &[]);
    let known = "[possible values: csv, npz, mat, mat73, hdf5, parquet, mcap, trace, designsafe]";
    assert!(
        said.code == Some(2) && said.stderr.contains(known),
        "{}",
        said.stderr
    );
    assert_eq!(names(temp.path()), before);
    assert!(Run::open(&run).is_ok(), "the run is unchanged");
}
