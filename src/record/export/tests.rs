//! Tests of the CSV, row by row.

use std::io::{self, Write};
use std::path::Path;

use super::columns::Columns;
use super::csv::{self, Sheet};
use super::plan::{Plan, Trouble};
use super::*;
use crate::folder::tests::recorded;
use crate::summary::tests::example;
#[cfg(feature = "mcap")]
use crate::utc;
use proptest::prelude::*;

const NAMES: [&str; 15] = [
    "step",
    "sub_tick",
    "state",
    "time",
    "x2",
    "x10",
    "v2",
    "v10",
    "a2",
    "a10",
    "force_1_1",
    "target_1_1",
    "cmd_1_1",
    "meas_1_1",
    "vendor_flag",
];

fn row(step: f64, sub_tick: f64, time: f64, x2: f64) -> Vec<f64> {
    let mut row = vec![step, sub_tick, 3.0, time, x2];
    row.extend((1..=10).map(f64::from));
    row[9] = f64::NAN;
    row
}

fn export_csv(run: &Run, rows: Rows, out: &Path) -> Result<Exported, ExportError> {
    let extra = Extra {
        units_line: false,
        ..Extra::default()
    };
    export(run, Format::Csv, &Choice::all(rows), &extra, out)
}

fn exported(rows: &[Vec<f64>], which: Rows) -> (String, Exported) {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    recorded(&path, &NAMES, &rows);
    let out = temp.path().join("out.csv");
    let exported = export_csv(&Run::open(&path).unwrap(), which, &out).unwrap();
    (std::fs::read_to_string(out).unwrap(), exported)
}

#[test]
fn header_and_first_line_are_as_documented() {
    let (text, _) = exported(&[row(0.0, 0.0, 0.0, -0.1)], Rows::Step);
    assert_eq!(
        text,
        "time,x2,x10,v2,v10,a2,a10,target_1_1,cmd_1_1,meas_1_1,force_1_1\n\
         0.0000000000000000e0,-1.0000000000000001e-1,1.0000000000000000e0,2.0000000000000000e0,\
         3.0000000000000000e0,4.0000000000000000e0,,7.0000000000000000e0,8.0000000000000000e0,\
         9.0000000000000000e0,6.0000000000000000e0\n"
    );
}

#[test]
fn step_rows_are_the_last_ticks_of_steps() {
    let rows = [
        row(-1.0, 0.0, -0.75, 8.0),
        row(0.0, 0.0, -0.5, 9.0),
        row(0.0, 0.0, 0.0, 1.0),
        row(1.0, 0.0, 0.25, 2.0),
        row(1.0, 1.0, 0.5, 3.0),
        row(2.0, 0.0, 0.75, 4.0),
    ];
    let x2 = |text: &str| -> Vec<f64> {
        let cell = |line: &str| line.split(',').nth(1).unwrap().parse().unwrap();
        text.lines().skip(1).map(cell).collect()
    };
    let (text, result) = exported(&rows, Rows::Step);
    assert_eq!((x2(&text), result.rows), (vec![1.0, 3.0, 4.0], 3));
    let (text, result) = exported(&rows, Rows::Tick);
    assert_eq!(
        (x2(&text), result.rows),
        (vec![8.0, 9.0, 1.0, 2.0, 3.0, 4.0], 6)
    );
    let (text, result) = exported(&[], Rows::Step);
    assert_eq!((text.lines().count(), result.rows), (1, 0));
}

#[test]
fn trip_belongs_to_a_step_if_one_was_made() {
    let at = |step: f64, state: f64| {
        let mut row = row(step, 0.0, step, 1.0);
        row[2] = state;
        row
    };
    let steps = |rows: &[Vec<f64>]| exported(rows, Rows::Step).1.rows;
    assert_eq!(steps(&[at(0.0, 5.0), at(0.0, 8.0)]), 0);
    assert_eq!(steps(&[at(0.0, 5.0), at(0.0, 3.0), at(1.0, 8.0)]), 2);
}

#[test]
fn unrecorded_column_stays_empty() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let names = [
        "step",
        "status_2",
        "time",
        "x1",
        "force_2_1",
        "x01",
        "force_1",
        "a0",
    ];
    let row = [0.0, 262_144.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
    recorded(&path, &names, &[&row]);
    let out = temp.path().join("out.csv");
    let exported = export_csv(&Run::open(&path).unwrap(), Rows::Step, &out).unwrap();
    let empty = Notice::NotRecorded("v1, a1, target_2_1, cmd_2_1, meas_2_1".to_owned());
    assert_eq!(exported.notices, [Notice::Unfinished, empty]);
    assert_eq!(
        std::fs::read_to_string(&out).unwrap(),
        "time,x1,v1,a1,target_2_1,cmd_2_1,meas_2_1,force_2_1,status_2\n\
         0.0000000000000000e0,1.0000000000000000e0,,,,,,2.0000000000000000e0,2.6214400000000000e5\n"
    );
}

#[test]
fn ground_and_sums_are_exported_with_units() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let names = ["step", "time", "ground", "x1", "v1", "a1", "x2", "v2", "a2"];
    recorded(
        &path,
        &names,
        &[&[0.0, 0.0, 8.0, 1.0, 2.0, 3.0, 1.5, 4.0, 5.0]],
    );
    let run = Run::open(&path).unwrap();
    let sum = |name: &str, terms: &[(&str, f64)]| Sum {
        name: name.to_owned(),
        unit: "m".to_owned(),
        meaning: "a sum".to_owned(),
        terms: terms.iter().map(|(n, f)| ((*n).to_owned(), *f)).collect(),
    };
    let mut extra = Extra {
        sums: vec![
            sum("drift2", &[("x2", 1.0), ("x1", -1.0)]),
            sum("abs_a1", &[("a1", 1.0), ("ground", 0.25)]),
        ],
        units_line: true,
    };
    let choice = Choice::all(Rows::Step);
    let out = temp.path().join("out.csv");
    export(&run, Format::Csv, &choice, &extra, &out).unwrap();
    let text = std::fs::read_to_string(&out).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "time,x1,x2,v1,v2,a1,a2,ground,drift2,abs_a1");
    let comment = lines[1].strip_prefix("# units: ").unwrap();
    let named: Vec<&str> = comment.split(',').collect();
    assert_eq!((named.len(), named[8]), (10, "drift2 m"));
    let values: Vec<f64> = lines[2].split(',').map(|v| v.parse().unwrap()).collect();
    assert_eq!(values[7..], [8.0, 0.5, 5.0]);
    // The other formats have the same columns in the same order.
    let (mut columns, _) = Columns::within(&run, &choice, &extra.sums, 1 << 20).unwrap();
    let names: Vec<_> = columns
        .plan
        .columns
        .iter()
        .map(|c| c.column.name.clone())
        .collect();
    assert_eq!(names[..10].join(","), lines[0]);
    assert_eq!(columns.take(9).unwrap(), 5.0_f64.to_le_bytes());
    extra.sums.push(sum("drift3", &[("x3", 1.0)]));
    assert!(matches!(
        export(&run, Format::Csv, &choice, &extra, &out),
        Err(ExportError::NotRecorded { name, needs }) if (&*name, &*needs) == ("drift3", "x3")
    ));
}

#[test]
fn faulty_run_exports_its_sound_part() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let (a, b) = (row(0.0, 0.0, 0.0, 1.0), row(1.0, 0.0, 0.1, 2.0));
    let folder = recorded(&path, &NAMES, &[&a, &b]);
    let out = temp.path().join("out.csv");
    let export = || export_csv(&Run::open(&path).unwrap(), Rows::Step, &out).unwrap();
    assert_eq!(export().notices, [Notice::Unfinished]);
    let mut summary = example();
    folder.write_summary(&summary).unwrap();
    let missing = MissingEnd::of(&Run::open(&path).unwrap(), Some(0.1)).map(Notice::MissingEnd);
    assert_eq!(export().notices, [missing.unwrap()], "30 steps of 40");
    summary.steps = 10;
    folder.write_summary(&summary).unwrap();
    assert_eq!(export().notices, []);
    summary.rows_lost = 7;
    folder.write_summary(&summary).unwrap();
    let samples = path.join("samples.bin");
    let bytes = std::fs::read(&samples).unwrap();
    std::fs::write(&samples, &bytes[..bytes.len() - 1]).unwrap();
    let torn = End::Torn {
        bytes: bytes.len() / 2 - 1,
    };
    let result = export();
    let missing = MissingEnd::of(&Run::open(&path).unwrap(), Some(0.0)).map(Notice::MissingEnd);
    let wanted = [Notice::RowsLost(7), Notice::Ended(torn), missing.unwrap()];
    assert_eq!(result.notices, wanted);
    assert_eq!(result.rows, 1);
}

#[test]
fn failed_export_changes_nothing() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    recorded(&path, &["x1"], &[&[1.0]]);
    let out = temp.path().join("out.csv");
    std::fs::write(&out, "old").unwrap();
    let run = Run::open(&path).unwrap();
    assert!(matches!(
        export_csv(&run, Rows::Step, &out),
        Err(ExportError::NoColumn("step"))
    ));
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "old");
    assert_eq!(std::fs::read_dir(temp.path()).unwrap().count(), 2);

    let plan = Plan::new(&crate::layout::tests::named(&NAMES), &[]).unwrap();
    struct Full;
    impl Write for Full {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let mut journal = Journal::new(&[][..], NAMES.len());
    let sheet = Sheet::of(plan.csv_columns());
    let result = csv::write(
        &plan,
        &sheet,
        &mut journal,
        &Choice::all(Rows::Step),
        &mut Full,
    );
    assert!(matches!(result, Err(Trouble::Write(_))));
}

/// 477 · 0.005 is 2.3850000000000002.
#[test]
fn boundary_row_belongs_to_the_window() {
    let part = |from, to| Choice {
        rows: Rows::Step,
        from,
        to,
    };
    for rate in [100, 200, 256, 1000, 1024, 4096] {
        let dt = 1.0 / f64::from(rate);
        for step in 0..20_000 {
            let told: f64 = format!("{:.9}", f64::from(step) * dt).parse().unwrap();
            let held = |choice: Choice, step: i32| choice.holds(f64::from(step) * dt);
            // Where nine digits are all of it.
            if f64::from(step) / f64::from(rate) == told {
                assert!(held(part(None, Some(told)), step), "{step} of {rate}");
                assert!(held(part(Some(told), None), step), "{step} of {rate}");
            }
            assert!(!held(part(None, Some(told)), step + 1));
            assert!(!held(part(Some(told), None), step - 1));
        }
    }
}

/// 40,000 rows of 15 columns and the sequence: four blocks, and with 700,000 bytes of memory two columns at a time.
#[test]
fn columns_do_not_depend_on_memory() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let rows: Vec<Vec<f64>> = (0..40_000)
        .map(|k| row(f64::from(k), 0.0, f64::from(k) * 1e-3, -f64::from(k)))
        .collect();
    let slices: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    recorded(&path, &NAMES, &slices);
    let run = Run::open(&path).unwrap();
    let choice = Choice {
        rows: Rows::Tick,
        from: Some(1.0),
        to: None,
    };
    for memory in [0, 700_000, 1 << 30] {
        let (mut columns, exported) = Columns::within(&run, &choice, &[], memory).unwrap();
        assert_eq!((columns.rows, exported.rows), (39_000, 39_000));
        let exposed: Vec<_> = columns.plan.columns.to_vec();
        assert_eq!(exposed.len(), 16);
        for (index, exposed) in exposed.iter().enumerate() {
            let values = columns.take(index).unwrap();
            let place = NAMES.iter().position(|name| *name == exposed.column.name);
            // Sequence numbers begin at zero.
            let wanted = rows.iter().enumerate().skip(1000).flat_map(|(k, row)| {
                let bits = place.map_or(k as u64, |place| row[place].to_bits());
                bits.to_le_bytes()
            });
            assert!(
                wanted.eq(values),
                "{} with {memory} bytes",
                exposed.column.name
            );
        }
    }
}

/// A run of one row, exported in this format.
#[cfg(any(feature = "mcap", feature = "parquet"))]
fn one_row(format: Format) -> (tempfile::TempDir, std::path::PathBuf) {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    recorded(&path, &NAMES, &[&row(0.0, 0.0, 0.5, -0.1)]);
    let test = "[[specimen]]\nname = \"pier\"\n";
    std::fs::write(path.join("resolved.toml"), test).unwrap();
    let (run, out) = (Run::open(&path).unwrap(), temp.path().join("out"));
    let choice = Choice::all(Rows::Step);
    export(&run, format, &choice, &Extra::default(), &out).unwrap();
    (temp, out)
}

#[cfg(feature = "mcap")]
#[test]
fn mcap_has_a_channel_for_each_group() {
    let (_temp, out) = one_row(Format::Mcap);
    let bytes = std::fs::read(out).unwrap();
    let stream = ::mcap::MessageStream::new(&bytes).unwrap();
    let mut found = Vec::new();
    for message in stream.map(Result::unwrap) {
        let schema: serde_json::Value =
            serde_json::from_slice(&message.channel.schema.as_ref().unwrap().data).unwrap();
        assert_eq!(schema["properties"]["time"]["type"], "number");
        // Without events the start of the run is not known.
        assert_eq!(message.log_time, 500_000_000);
        let text = String::from_utf8(message.data.to_vec()).unwrap();
        found.push((message.channel.topic.clone(), text));
    }
    let expected = [
        (
            "/state",
            r#"{"time":0.5,"x2":-0.1,"x10":1.0,"v2":2.0,"v10":3.0,"a2":4.0}"#,
        ),
        (
            "/specimen/pier",
            r#"{"time":0.5,"target_1_1":7.0,"cmd_1_1":8.0,"meas_1_1":9.0,"force_1_1":6.0}"#,
        ),
        (
            "/loop",
            r#"{"time":0.5,"step":0.0,"sub_tick":0.0,"state":3.0,"vendor_flag":10.0,"sequence":0}"#,
        ),
    ];
    assert_eq!(found, expected.map(|(a, b)| (a.to_owned(), b.to_owned())));
}

/// Rows and events have the same wall times, also in a hold, in which the test time is stopped, and in a part of the run.
#[cfg(feature = "mcap")]
#[test]
fn mcap_has_wall_times() {
    const WALL_NS: u64 = 1_772_366_400_000_000_000;
    const TICK_NS: u64 = 10_000_000;
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let names = [
        "step",
        "state",
        "time",
        "release_s",
        "wakeup_lateness_s",
        "command_lateness_s",
        "round_trip_s",
        "compute_s",
    ];
    // The ramp, a step, two ticks of a hold, a step, and the return move.
    let rows = [
        (5.0, -1, 0),
        (3.0, 0, 0),
        (6.0, 0, 1),
        (6.0, 0, 2),
        (3.0, 1, 3),
        (7.0, 1, 4),
    ];
    let rows = rows.map(|(state, step, tick)| {
        let mut row = [0.0; 8];
        row[0] = f64::from(step);
        (row[1], row[2], row[3]) = (state, 0.01 * f64::from(step), 0.01 * f64::from(tick));
        row
    });
    recorded(&path, &names, &rows.each_ref().map(|row| &row[..]));
    let line = |event: &str, time: f64, after_ns: u64| {
        let wall = utc::rfc3339(WALL_NS + after_ns);
        let clock_ns = 7 + after_ns;
        format!("{{\"wall\": \"{wall}\", \"clock_ns\": {clock_ns}, \"time\": {time}, {event}}}\n")
    };
    let grid = |of: &str, ns: u64| {
        format!(
            "\"event\": \"grid\", \"of\": \"{of}\", \"first_edge_ns\": {}",
            7 + ns
        )
    };
    let events = [
        line(&grid("opening", 2_000), -0.01, 0),
        line(&grid("test", TICK_NS), -0.01, TICK_NS / 2),
        line("\"event\": \"hold\"", 0.0, 2 * TICK_NS + 5),
    ];
    std::fs::write(path.join("events.jsonl"), events.concat()).unwrap();
    let run = Run::open(&path).unwrap();
    let times = |from: Option<f64>| {
        let (choice, out) = (
            Choice {
                from,
                ..Choice::all(Rows::Tick)
            },
            temp.path().join("out"),
        );
        let told = export(&run, Format::Mcap, &choice, &Extra::default(), &out).unwrap();
        let bytes = std::fs::read(out).unwrap();
        let all = ::mcap::MessageStream::new(&bytes)
            .unwrap()
            .map(Result::unwrap);
        let all = all.filter(|one| ["/loop", "/events"].contains(&&*one.channel.topic));
        let all: Vec<u64> = all.map(|one| one.log_time - WALL_NS).collect();
        (told.rows, all)
    };
    let of_test = [1, 2, 3, 4, 5].map(|tick| tick * TICK_NS);
    let (rows, all) = times(None);
    let [first, hold, more @ ..] = of_test;
    let expected = [&[0, 2_000, TICK_NS / 2, first, hold, hold + 5][..], &more].concat();
    assert_eq!((rows, all), (6, expected));
    assert_eq!(times(Some(0.01)), (2, more[1..].to_vec()));
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_has_units_and_metadata() {
    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    let (_temp, out) = one_row(Format::Parquet);
    let reader = SerializedFileReader::new(std::fs::File::open(out).unwrap()).unwrap();
    let metadata = reader.metadata().file_metadata();
    assert_eq!(metadata.num_rows(), 1);
    let pairs = metadata.key_value_metadata().unwrap().iter();
    let pairs: std::collections::BTreeMap<_, _> = pairs
        .map(|pair| (pair.key.as_str(), pair.value.as_deref().unwrap()))
        .collect();
    assert_eq!(pairs["gusset.format"], "gusset-run");
    assert!(pairs["gusset.resolved"].contains("pier"));
    let columns: serde_json::Value = serde_json::from_str(pairs["gusset.columns"]).unwrap();
    let last = columns.as_array().unwrap().last().unwrap();
    assert_eq!(
        (&last["name"], &last["unit"]),
        (&"sequence".into(), &"1".into())
    );
}

/// MATLAB and SciPy count the bytes of a file of level 5 as `int32`.
#[test]
fn level_5_ends_at_2_gb() {
    let fits = |rows| mat::rows_that_fit(rows, 16, 1 << 16).is_some();
    let most = ((1 << 31) - (1 << 16)) / (8 * 16);
    assert!(fits(0) && fits(most - 20));
    assert!(!fits(most) && !fits(1 << 32) && !fits(u64::MAX));
}

#[test]
fn missing_feature_is_named() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    recorded(&path, &NAMES, &[]);
    let run = Run::open(&path).unwrap();
    let out = temp.path().join("out");
    let formats = [
        (Format::Mat73, "hdf5", cfg!(feature = "hdf5")),
        (Format::Hdf5, "hdf5", cfg!(feature = "hdf5")),
        (Format::Parquet, "parquet", cfg!(feature = "parquet")),
        (Format::Mcap, "mcap", cfg!(feature = "mcap")),
    ];
    for (format, feature, is_built) in formats {
        if is_built {
            continue;
        }
        let refused = export(
            &run,
            format,
            &Choice::all(Rows::Step),
            &Extra::default(),
            &out,
        )
        .unwrap_err();
        assert!(
            refused
                .to_string()
                .contains(&format!("--features {feature}")),
            "{refused}"
        );
        assert!(!out.exists());
    }
}

#[test]
fn line_is_made_without_allocation() {
    let plan = Plan::new(&crate::layout::tests::named(&NAMES), &[]).unwrap();
    let values = row(1.0, 0.0, -1.2345678901234567e-300, f64::MAX);
    let sheet = Sheet::of(plan.csv_columns());
    let mut line = Vec::with_capacity(26 * sheet.width());
    let used = allocation_counter::measure(|| sheet.line(&values, &mut line).unwrap());
    assert_eq!(used.count_total, 0);
}

proptest! {
    #[test]
    fn every_number_reads_back_to_the_same_bits(bits in any::<u64>()) {
        let value = f64::from_bits(bits);
        let plan = Plan::new(&crate::layout::tests::named(&["step", "time", "x1"]), &[]).unwrap();
        let mut line = Vec::new();
        Sheet::of(plan.csv_columns()).line(&[0.0, 0.0, value], &mut line).unwrap();
        let text = std::str::from_utf8(&line).unwrap();
        let cell = text.split(',').nth(1).unwrap();
        if value.is_nan() {
            prop_assert_eq!(cell, "");
        } else {
            prop_assert_eq!(cell.parse::<f64>().unwrap().to_bits(), bits);
        }
    }
}
