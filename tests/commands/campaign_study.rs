//! Studies of `gusset campaign`: the tables and pictures that they give, and wrong studies.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::common::{FRAME, Said, say};

const RECORD: &str = "time,accel\n0,0\n0.1,1\n0.2,-1\n0.3,0.5\n0.4,0\n";
const DAMPING: &str = "structure.damping.rayleigh_ratio.ratio";
const FORCE: &str = "specimen.0.law.bouc_wen.yield_force_n";

/// A folder with a test, two records and the study `text`.
fn folder(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let uncertain = format!(
        "{FRAME}\n[about]\noperator = \"A\"\n[[uncertainty]]\nkey = \"{FORCE}\"\nstd_share = 0.05\n"
    );
    fs::write(folder.path().join("frame.toml"), uncertain).unwrap();
    fs::create_dir(folder.path().join("records")).unwrap();
    fs::create_dir(folder.path().join("empty")).unwrap();
    fs::write(folder.path().join("records/a.csv"), RECORD).unwrap();
    fs::write(folder.path().join("records/b, c.csv"), RECORD).unwrap();
    fs::write(folder.path().join("study.toml"), text).unwrap();
    folder
}

fn command(name: &str, folder: &Path, more: &[&str]) -> Said {
    let study = folder.join("study.toml");
    let mut arguments = vec!["campaign", name, study.to_str().unwrap()];
    arguments.extend(more);
    say(arguments)
}

/// Runs the study `text`; the folder has its results in `out`.
fn computed(text: &str) -> tempfile::TempDir {
    let folder = folder(text);
    let out = folder.path().join("out");
    let more = ["--out", out.to_str().unwrap(), "--prove", "1"];
    let said = command("run", folder.path(), &more);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    folder
}

/// The cells of a CSV file. Only the names of records have commas.
fn csv(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path)
        .unwrap()
        .replace("\"b, c.csv\"", "b; c.csv");
    let cells = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().map(cells).collect()
}

fn column(rows: &[Vec<String>], name: &str) -> Vec<String> {
    let place = rows[0].iter().position(|cell| cell == name).unwrap();
    rows[1..].iter().map(|row| row[place].clone()).collect()
}

#[test]
fn campaign_states_errors_of_its_tests() {
    let study = "test = \"frame.toml\"\n[[vary]]\nkey = \"specimen.0.transfer.delay_s\"\nvalues = [0.0, 0.03]\n";
    let folder = computed(study);
    let summary = fs::read(folder.path().join("out/summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    let drift = |place: usize| {
        let one = &summary["errors"][place];
        assert_eq!(one["task"], place + 1, "{one}");
        one["errors"]["coupling"]["drift"].as_f64().unwrap()
    };
    assert!(drift(0) < 1e-3 && drift(1) > 0.05, "{summary:#}");
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert_eq!(summary["about"]["operator"], "A");
    for key in ["began", "host"] {
        assert!(summary["origin"][key].is_string(), "{key}");
    }
    assert!(page.contains("<dt>operator</dt><dd>A</dd>"));
    assert!(page.contains("verdict warning") && page.contains("LARGE ERROR: task 2"));
}

/// A column of each type: whole numbers, numbers, texts, and missing values.
const EVERY_TYPE: &str = r#"
test = "frame.toml"
[campaign]
design = "one_at_a_time"
replicates = 2
[[vary]]
key = "structure.damping.rayleigh_ratio.ratio"
values = [0.02, 0.05]
[[vary]]
key = "integrator.lambda"
values = [2, 4]
[[vary]]
key = "title"
values = ["a b"]
[[sample]]
key = "specimen.0.law.bouc_wen.yield_force_n"
std_share = 0.1
[[records]]
folder = "records"
record_unit = "m/s2"
[measure]
residual = true
"#;

#[cfg(feature = "parquet")]
mod parquet_table {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    use super::*;

    /// The rows of a Parquet file as the texts of a CSV file, and its metadata of the columns.
    fn read(path: &Path) -> (Vec<Vec<String>>, Value) {
        let reader = SerializedFileReader::new(fs::File::open(path).unwrap()).unwrap();
        let metadata = reader.metadata().file_metadata();
        let pairs = metadata.key_value_metadata().unwrap();
        let value = |key: &str| {
            let pair = pairs.iter().find(|pair| pair.key == key).unwrap();
            pair.value.as_deref().unwrap()
        };
        assert_eq!(value("gusset.operator"), "A");
        let columns = serde_json::from_str(value("gusset.columns")).unwrap();
        let names = metadata.schema_descr().columns().iter();
        let mut rows: Vec<Vec<String>> = vec![names.map(|one| one.name().to_owned()).collect()];
        for row in reader.get_row_iter(None).unwrap() {
            let cell = |(_, field): (&String, &Field)| match field {
                Field::Null => String::new(),
                Field::Long(value) => value.to_string(),
                Field::Double(value) => format!("{value:?}"),
                Field::Str(text) => text.replace(", ", "; "),
                other => panic!("{other:?}"),
            };
            rows.push(row.unwrap().get_column_iter().map(cell).collect());
        }
        (rows, columns)
    }

    #[test]
    fn parquet_table_has_the_bits_of_the_csv() {
        let folder = computed(EVERY_TYPE);
        let out = folder.path().join("out");
        let (rows, columns) = read(&out.join("table.parquet"));
        let expected = csv(&out.join("table.csv"));
        assert_eq!(rows.len(), 6 * 2 * 2 + 1);
        // The shortest text of a number reads back as the same bits, so equal texts are equal bits.
        assert_eq!(rows, expected);
        // Missing values are there: the test file decides them.
        assert!(column(&rows, "integrator.lambda").contains(&String::new()));
        assert!(column(&rows, "record").contains(&"b; c.csv".to_owned()));
        let kind = |name: &str| {
            let all = columns.as_array().unwrap();
            let one = all.iter().find(|one| one["name"] == name).unwrap();
            (one["type"].clone(), one["unit"].clone())
        };
        assert_eq!(kind("task"), ("integer".into(), "1".into()));
        assert_eq!(kind("integrator.lambda"), ("integer".into(), "".into()));
        assert_eq!(kind(DAMPING), ("number".into(), "".into()));
        assert_eq!(kind("title"), ("text".into(), "".into()));
        assert_eq!(kind("max_drift"), ("number".into(), "m".into()));
        let summary = fs::read_to_string(out.join("summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        assert_eq!(summary["columns"], columns);
    }

    /// A spreadsheet would run a text that begins as a formula does.
    #[test]
    fn only_the_csv_table_marks_a_formula() {
        let folder = folder(
            "test = \"frame.toml\"\n[[records]]\nfolder = \"empty\"\nrecord_unit = \"m/s2\"\n",
        );
        for name in ["=1+2.csv", "@a.csv", "'b.csv", "c.csv"] {
            fs::write(folder.path().join("empty").join(name), RECORD).unwrap();
        }
        let out = folder.path().join("out");
        let more = ["--out", out.to_str().unwrap(), "--prove", "1"];
        let said = command("run", folder.path(), &more);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let names = column(&csv(&out.join("table.csv")), "record");
        assert_eq!(names, ["''b.csv", "'=1+2.csv", "'@a.csv", "c.csv"]);
        let (rows, _) = read(&out.join("table.parquet"));
        let names = column(&rows, "record");
        assert_eq!(names, ["'b.csv", "=1+2.csv", "@a.csv", "c.csv"]);
    }

    #[test]
    fn equal_results_give_equal_bytes() {
        let folder = computed(EVERY_TYPE);
        let out = folder.path().join("out");
        let before = fs::read(out.join("table.parquet")).unwrap();
        let collect = || say(["campaign", "collect", out.to_str().unwrap(), "--prove", "0"]);
        assert_eq!(collect().code, Some(0));
        assert!(fs::read(out.join("table.parquet")).unwrap() == before);
        fs::remove_dir_all(out.join("parts")).unwrap();
        assert_eq!(collect().code, Some(1));
        assert!(!out.join("table.parquet").exists());
        let (rows, _) = read(&out.join("table.partial.parquet"));
        assert_eq!(rows.len(), 1);
        let again = say(["campaign", "run", out.to_str().unwrap(), "--prove", "0"]);
        assert_eq!(again.code, Some(0), "{}", again.stderr);
        assert!(fs::read(out.join("table.parquet")).unwrap() == before);
        assert!(!out.join("table.partial.parquet").exists());
    }
}

#[test]
fn sobol_draws_fill_each_interval_once() {
    let study = format!(
        "test = \"frame.toml\"\n[campaign]\nsampling = \"sobol\"\nreplicates = 16\nseed = 5\n\
         [[sample]]\nkey = \"{FORCE}\"\nrange = [1000.0, 2600.0]\n\
         [[sample]]\nkey = \"{DAMPING}\"\nrange = [0.01, 0.09]\n"
    );
    let folder = computed(&study);
    let rows = csv(&folder.path().join("out/table.csv"));
    let force = rows[0]
        .iter()
        .find(|name| name.ends_with("yield_force_n"))
        .unwrap();
    for (name, low, width) in [(force.as_str(), 1000.0, 100.0), (DAMPING, 0.01, 0.005)] {
        let values = column(&rows, name).into_iter();
        let mut found: Vec<u64> = values
            .map(|value| ((value.parse::<f64>().unwrap() - low) / width) as u64)
            .collect();
        found.sort_unstable();
        assert_eq!(found, (0..16).collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn reports_have_their_designs_pictures() {
    let report = |text: &str| {
        let folder = computed(text);
        fs::read_to_string(folder.path().join("out/report.html")).unwrap()
    };
    let alone = report(EVERY_TYPE);
    for words in [
        "smallest",
        "All pairs",
        "Exceedance: max_drift",
        "test file",
    ] {
        assert!(alone.contains(words), "{words}");
    }
    assert!(!alone.contains("IDA curves"));
    let scaled = report(
        r#"
test = "frame.toml"
[[records]]
folder = "records"
record_unit = "m/s2"
values = [0.5, 4.0, 8.0]
unit = "m/s2"
[measure]
collapse = { measure = "max_drift", above = 0.006 }
"#,
    );
    for words in [
        "IDA curves: max_drift",
        "84 % fractile",
        "criterion of collapse",
        "Fragility",
    ] {
        assert!(scaled.contains(words), "{words}");
    }
    assert!(!scaled.contains("smallest") && !scaled.contains("All pairs"));
    for page in [alone, scaled] {
        let (own, _) = page.split_once("<script>").unwrap();
        assert!(!own.contains("NaN") && page.matches("<script").count() == 1);
        // A line whose class has no colour is invisible.
        for piece in page.split("class=\"l-").skip(1) {
            let class = piece.split('"').next().unwrap();
            assert!(page.contains(&format!(".l-{class} {{ stroke:")), "{class}");
        }
    }
}

/// A plan of one storey under two components.
const PLAN: &str = r#"[time]
rate_hz = 128
duration_s = 1

[structure.matrices]
mass = [[4000, 0], [0, 4000]]
stiffness = [[4e5, 1e5], [1e5, 6e5]]

[[excitation.ground_acceleration]]
direction = "x"
influence = [1, 0]
processing.zero_tail = true
signal.sine = { amplitude = 1, frequency_hz = 2 }

[[excitation.ground_acceleration]]
direction = "y"
influence = [0, 1]
processing.zero_tail = true
signal.sine = { amplitude = 1, frequency_hz = 3 }
"#;

/// A folder with the pairs A and B, and a study of them with more keys.
fn of_pairs(more: &str) -> tempfile::TempDir {
    let pairs = "test = \"plan.toml\"\n[[records]]\nfolder = \"pairs\"\ncomponents = [\"*-H1.csv\", \"*-H2.csv\"]\n\
                 record_unit = \"m/s2\"\n";
    let folder = folder(&format!("{pairs}{more}"));
    fs::write(folder.path().join("plan.toml"), PLAN).unwrap();
    fs::create_dir(folder.path().join("pairs")).unwrap();
    for (name, factor) in [
        ("A-H1", "1"),
        ("A-H2", "-0.7"),
        ("B-H1", "0.4"),
        ("B-H2", "0.9"),
        ("B-UP", "9"),
    ] {
        let text = RECORD.replace("0.1,1", &format!("0.1,{factor}"));
        fs::write(folder.path().join(format!("pairs/{name}.csv")), text).unwrap();
    }
    folder
}

#[test]
fn pairs_go_to_both_components() {
    let levels = "intensity = \"rotd50\"\nperiod_s = 0.5\nvalues = [0.5, 1.0]\nunit = \"m/s2\"\n[measure]\npeaks = true\n";
    let folder = of_pairs(levels);
    let out = folder.path().join("out");
    let said = command(
        "run",
        folder.path(),
        &["--out", out.to_str().unwrap(), "--prove", "1"],
    );
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let rows = csv(&out.join("table.csv"));
    let names = column(&rows, "record");
    let [a, b] = ["A-H1.csv + A-H2.csv", "B-H1.csv + B-H2.csv"];
    assert_eq!(names, [a, a, b, b]);
    assert_eq!(column(&rows, "intensity"), ["0.5", "1.0", "0.5", "1.0"]);
    // Linear: twice the level is twice the response, in both directions.
    for name in ["peak_x1", "peak_x2"] {
        let peaks: Vec<f64> = column(&rows, name)
            .iter()
            .map(|cell| cell.parse().unwrap())
            .collect();
        for pair in peaks.chunks(2) {
            assert!((pair[1] / pair[0] - 2.0).abs() < 1e-9, "{name} {peaks:?}");
        }
    }
    let summary = fs::read_to_string(out.join("summary.json")).unwrap();
    assert!(summary.contains("RotD50(0.500 s)"));
}

#[test]
fn missing_partner_names_both_files() {
    let folder = of_pairs("");
    fs::remove_file(folder.path().join("pairs/B-H2.csv")).unwrap();
    let said = command("plan", folder.path(), &["--out", "out"]);
    assert_eq!(said.code, Some(2));
    for word in ["pairs/B-H1.csv", "B-H2.csv", "study.toml:4:"] {
        assert!(said.stderr.contains(word), "{}", said.stderr);
    }
}

#[test]
fn wrong_pairs_are_refused() {
    let sa = "intensity = \"sa\"\nperiod_s = 0.5\nvalues = [0.5]\nunit = \"m/s2\"\n";
    let study = |text: &str| fs::read_to_string(of_pairs(text).path().join("study.toml")).unwrap();
    let plain = study("");
    let components = "components = [\"*-H1.csv\", \"*-H2.csv\"]\n";
    for (text, words) in [
        (study(sa), "\"rotd50\""),
        (plain.replace("*-H1.csv", "A-H1.csv"), "exactly one `*`"),
        (plain.replace("*-H2.csv", "*-H1.csv"), "same file"),
        (
            plain
                .replace("*-H1.csv", "*-N.csv")
                .replace("*-H2.csv", "*-E.csv"),
            "no pairs",
        ),
        (plain.replace(components, ""), "give `components`"),
        (
            plain.replace("folder = \"pairs\"", "files = [\"pairs/A-H1.csv\"]"),
            "needs `folder`",
        ),
        (
            plain.replace(components, "") + "intensity = \"rotd50\"\n",
            "needs `components`",
        ),
        (plain.replace("plan.toml", "frame.toml"), "two components"),
        (
            study("intensity = \"rotd50\"\ndamping_ratio = 0.02\n"),
            "5 % damping",
        ),
    ] {
        let folder = of_pairs("");
        fs::write(folder.path().join("study.toml"), &text).unwrap();
        let said = command("plan", folder.path(), &["--out", "out"]);
        assert_eq!(said.code, Some(2), "{text}");
        assert!(said.stderr.contains(words), "{words}:\n{}", said.stderr);
    }
}

/// Each study has one mistake: the message names file and line, and has these words.
#[test]
fn wrong_studies_are_refused_at_their_line() {
    let vary = format!("[[vary]]\nkey = \"{DAMPING}\"\nvalues = [0.02, 0.05]\n");
    let sample = format!("[[sample]]\nkey = \"{FORCE}\"\nstd_share = 0.1\n");
    let records = "[[records]]\nfolder = \"records\"\nrecord_unit = \"m/s2\"\n";
    let levels = "values = [0.5, 1.0]\nunit = \"m/s2\"\n";
    let with = |key: &str, value: &str| vary.replace(key, value);
    let cases = [
        (with("key =", "kye ="), 3, "`key`"),
        (
            with("values = [0.02, 0.05]", "valeus = [0.02]"),
            4,
            "`values`",
        ),
        (with(".ratio\"", ".ration\""), 3, "`ratio`"),
        (with("[0.02, 0.05]", "[]"), 4, "values"),
        (with("[0.02, 0.05]", "[\"much\"]"), 3, DAMPING),
        (
            with(
                "values = [0.02, 0.05]",
                "linear = { from = 1, to = 1, count = 3 }",
            ),
            4,
            "from",
        ),
        (
            with(
                "values = [0.02, 0.05]",
                "log = { from = -1, to = 2, count = 3 }",
            ),
            4,
            "log",
        ),
        (
            with(
                "values = [0.02, 0.05]",
                "log = { from = 1, to = 0, count = 3 }",
            ),
            4,
            "log",
        ),
        (format!("{vary}{vary}"), 6, "twice"),
        (
            format!("{vary}{}", sample.replace(FORCE, DAMPING)),
            3,
            "`sample`",
        ),
        (
            format!(
                "{vary}{}",
                vary.replace("rayleigh_ratio.ratio", "rayleigh_ratio.ratio ")
            ),
            6,
            "twice",
        ),
        (format!("{sample}{sample}"), 6, FORCE),
        (
            sample.replace("yield_force_n", "yeild_force_n"),
            3,
            "yield_force_n",
        ),
        (
            format!("[campaign]\nsample_uncertainty = true\n{sample}"),
            5,
            "uncertainty",
        ),
        (
            format!(
                "[campaign]\nsample_uncertainty = true\n{}",
                vary.replace(DAMPING, FORCE)
            ),
            5,
            "uncertainty",
        ),
        (
            "[campaign]\nsampling = \"sobol\"\nreplicates = 65537\n".to_owned(),
            4,
            "65536",
        ),
        (
            "[campaign]\nsampling = \"soboll\"\n".to_owned(),
            3,
            "`sobol`",
        ),
        (records.replace("records\"", "empty\""), 3, "no records"),
        (records.replace("records\"", "recrods\""), 3, "recrods"),
        (
            records.replace("folder = \"records\"", "files = [\"records/d.csv\"]"),
            3,
            "records/d.csv",
        ),
        (
            records.replace("folder = \"records\"", "files = [\"frame.toml\"]"),
            3,
            "frame.toml",
        ),
        (records.replace("m/s2", "mm"), 4, "record_unit"),
        (
            format!("{records}{}", levels.replace("m/s2", "kN")),
            6,
            "unit",
        ),
        (
            records.replace("record_unit = \"m/s2\"\n", ""),
            3,
            "record_unit",
        ),
        (
            format!("{records}{}", levels.replace("0.5", "0.0")),
            5,
            "values",
        ),
        (
            format!("{records}linear = {{ from = -1, to = 2, count = 3 }}\nunit = \"g\"\n"),
            5,
            "from",
        ),
        (
            format!(
                "{records}{levels}{records}{}",
                levels.replace("\"m/s2\"", "\"g\"")
            ),
            7,
            "unit",
        ),
        (
            "[measure]\nreport = [\"max_drfit\"]\n".to_owned(),
            3,
            "`max_drift`",
        ),
        (
            "[measure]\ncollapse = { measure = \"max_drfit\", above = 1 }\n".to_owned(),
            3,
            "`max_drift`",
        ),
    ];
    let mut wrong = Vec::new();
    for (text, line, words) in cases {
        let folder = folder(&format!("test = \"frame.toml\"\n{text}"));
        let out = folder.path().join("out");
        let said = command("plan", folder.path(), &["--out", out.to_str().unwrap()]);
        let place = format!("study.toml:{line}:");
        let is_refused = said.code == Some(2) && !said.stderr.contains("panicked");
        let is_told = said.stderr.contains(&place) && said.stderr.contains(words);
        if !is_refused || !is_told || out.exists() {
            wrong.push(format!("{place} {words}:\n{text}{}", said.stderr));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// Velocities and displacements in a folder of records are named and refused; a pattern excludes them.
#[test]
fn a_folder_of_records_takes_a_pattern() {
    let records = "test = \"frame.toml\"\n[[records]]\nfolder = \"empty\"\nrecord_unit = \"g\"\n";
    let folder = folder(records);
    let peer = |title: &str| format!("PEER\nSOMEWHERE\n{title}\nNPTS= 4, DT= .1 SEC\n0 1 -1 0\n");
    let write = |name: &str, title: &str| {
        fs::write(folder.path().join("empty").join(name), peer(title)).unwrap();
    };
    write("a.AT2", "ACCELERATION TIME SERIES IN UNITS OF G");
    let planned = |text: String, out: &str| {
        fs::write(folder.path().join("study.toml"), text).unwrap();
        let out = folder.path().join(out);
        command("plan", folder.path(), &["--out", out.to_str().unwrap()])
    };
    for (name, title) in [
        ("b.VT2", "VELOCITY TIME SERIES IN UNITS OF CM/S"),
        ("b.DT2", "DISPLACEMENT"),
        ("README.txt", ""),
    ] {
        match title {
            "" => fs::write(folder.path().join("empty").join(name), "not a record\n").unwrap(),
            title => write(name, title),
        }
        let said = planned(records.to_owned(), "refused");
        assert_eq!(said.code, Some(2), "{}", said.stderr);
        assert!(
            said.stderr.contains(name) && said.stderr.contains("pattern"),
            "{}",
            said.stderr
        );
        if name != "README.txt" {
            fs::remove_file(folder.path().join("empty").join(name)).unwrap();
        }
    }
    let none = planned(format!("{records}pattern = \"*.V2\"\n"), "refused");
    assert!(
        none.code == Some(2) && none.stderr.contains("*.V2"),
        "{}",
        none.stderr
    );
    let said = planned(format!("{records}pattern = \"*.at2\"\n"), "chosen");
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stdout.contains("1 tasks"), "{}", said.stdout);
}

/// A limit of the specimen stops the stronger tests: that is no collapse. A peak above the criterion before the trip is one.
#[test]
fn a_trip_of_a_specimen_is_no_collapse() {
    let summary = |above: f64| {
        let folder = folder(&format!(
            "test = \"frame.toml\"\n[[records]]\nfolder = \"records\"\nrecord_unit = \"m/s2\"\nvalues = [0.5, 4.0, 8.0]\n\
             unit = \"m/s2\"\n[measure]\ncollapse = {{ measure = \"max_drift\", above = {above} }}\n"
        ));
        let limits =
            "[specimen.limits]\ncommand_disp_m = { trip = [-0.003, 0.003] }\n[specimen.law";
        let frame = FRAME.replace("[specimen.law", limits);
        fs::write(folder.path().join("frame.toml"), frame).unwrap();
        let out = folder.path().join("out");
        let said = command("run", folder.path(), &["--out", out.to_str().unwrap()]);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let rows = csv(&out.join("table.csv"));
        let summary = fs::read_to_string(out.join("summary.json")).unwrap();
        (rows, serde_json::from_str::<Value>(&summary).unwrap())
    };
    let (rows, high) = summary(1.0);
    let ended = column(&rows, "ended");
    let tripped = ended.iter().filter(|word| *word != "done").count();
    assert!(tripped > 0 && tripped < ended.len(), "{ended:?}");
    let collapse = column(&rows, "collapse");
    for (word, cell) in ended.iter().zip(&collapse) {
        assert_eq!(cell, if word == "done" { "0.0" } else { "" }, "{word}");
    }
    assert_eq!(
        (&high["collapsed"], &high["censored"]),
        (&0.into(), &tripped.into())
    );
    let levels = high["fragility"]["points"][0]["levels"].as_array().unwrap();
    let sum = |key: &str| -> f64 { levels.iter().filter_map(|one| one[key].as_f64()).sum() };
    assert_eq!((sum("collapses"), sum("censored")), (0.0, tripped as f64));
    assert_eq!(sum("tests") + sum("censored"), ended.len() as f64);
    // A criterion that is met before the trip is a collapse.
    let (_, low) = summary(1e-6);
    assert_eq!(
        (&low["censored"], &low["collapsed"]),
        (&0.into(), &ended.len().into())
    );
}

/// Draws that the test file must not have are replaced, whatever the sampling, and counted.
#[test]
fn impossible_draws_are_drawn_again() {
    for sampling in ["random", "latin_hypercube", "sobol"] {
        let text = format!(
            "test = \"frame.toml\"\n[campaign]\nsampling = \"{sampling}\"\nreplicates = 16\n\
             [[sample]]\nkey = \"{FORCE}\"\nrange = [-1000.0, 3000.0]\n"
        );
        let folder = folder(&text);
        let out = folder.path().join("out");
        let more = ["--out", out.to_str().unwrap(), "--prove", "100%", "--json"];
        let said = command("run", folder.path(), &more);
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        let rows = csv(&out.join("table.csv"));
        let name = rows[0]
            .iter()
            .find(|name| name.ends_with("yield_force_n"))
            .unwrap();
        let values: Vec<f64> = column(&rows, name)
            .iter()
            .map(|one| one.parse().unwrap())
            .collect();
        assert!(
            values.len() == 16 && values.iter().all(|value| *value > 0.0),
            "{values:?}"
        );
        let mut other = values.clone();
        other.sort_by(f64::total_cmp);
        other.dedup();
        assert_eq!(other.len(), 16, "{sampling}");
        let summary: Value = serde_json::from_str(&said.stdout).unwrap();
        // A quarter of the range is impossible: each stratum of the evenly filled ones.
        let redrawn = summary["redrawn"].as_u64().unwrap();
        match sampling {
            "random" => assert!((1..12).contains(&redrawn), "{redrawn}"),
            _ => assert_eq!(redrawn, 4, "{sampling}"),
        }
    }
}

/// The last line counts the tasks whose values give no valid test, and the exit code shows them.
#[test]
fn invalid_tasks_are_in_the_last_line() {
    let folder = folder(&format!(
        "test = \"frame.toml\"\n[[vary]]\nkey = \"{DAMPING}\"\nvalues = [0.02, -0.5, 0.05]\n"
    ));
    let out = folder.path().join("out");
    let said = command("run", folder.path(), &["--out", out.to_str().unwrap()]);
    assert_eq!(said.code, Some(1), "{}{}", said.stdout, said.stderr);
    let last = said.stderr.trim_end().lines().last().unwrap();
    assert!(last.contains("INVALID: 1 of 3"), "{}", said.stderr);
    assert!(said.stdout.contains("task 2"), "{}", said.stdout);
    assert_eq!(
        column(&csv(&out.join("table.csv")), "ended"),
        ["done", "invalid", "done"]
    );
}

#[test]
fn study_schema_has_its_and_a_tests_tables() {
    let schema: Value = serde_json::from_str(&say(["schema", "--study"]).stdout).unwrap();
    for key in [
        "campaign", "vary", "sample", "records", "measure", "test", "time", "specimen",
    ] {
        assert!(schema["properties"].get(key).is_some(), "{key}");
    }
    assert!(
        schema["$defs"].get("VaryTable").is_some() && schema["$defs"].get("TimeTable").is_some()
    );
    assert_eq!(schema["additionalProperties"], false);
}
