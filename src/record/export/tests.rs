//! What the CSV is, row by row.

use std::io::{self, Write};
use std::path::Path;

use super::block::{Columnar, Skeleton, Table};
use super::csv::{self, Sheet};
use super::hdf5::Hdf5;
use super::mat::Mat;
use super::npz::Npz;
use super::plan::{Plan, Trouble};
use super::*;
use crate::record::folder::tests::recorded;
use crate::record::summary::tests::example;
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
    export(run, Format::Csv, &Choice::all(rows), out)
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
fn the_header_and_the_first_line_are_these() {
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
fn per_step_it_is_the_last_tick_of_each_step_from_t_0_and_per_tick_all() {
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
fn a_column_that_was_not_recorded_stays_empty_in_its_place() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let names = ["step", "time", "x1", "force_2_1", "x01", "force_1", "a0"];
    recorded(&path, &names, &[&[0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]]);
    let out = temp.path().join("out.csv");
    export_csv(&Run::open(&path).unwrap(), Rows::Step, &out).unwrap();
    assert_eq!(
        std::fs::read_to_string(&out).unwrap(),
        "time,x1,v1,a1,target_2_1,cmd_2_1,meas_2_1,force_2_1\n\
         0.0000000000000000e0,1.0000000000000000e0,,,,,,2.0000000000000000e0\n"
    );
}

#[test]
fn what_is_wrong_with_a_run_is_said_and_what_is_right_is_exported() {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    let (a, b) = (row(0.0, 0.0, 0.0, 1.0), row(1.0, 0.0, 0.1, 2.0));
    let folder = recorded(&path, &NAMES, &[&a, &b]);
    let out = temp.path().join("out.csv");
    let export = || export_csv(&Run::open(&path).unwrap(), Rows::Step, &out).unwrap();
    assert_eq!(export().notices, [Notice::Unfinished]);
    let mut summary = example();
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
    assert_eq!(result.notices, [Notice::RowsLost(7), Notice::Ended(torn)]);
    assert_eq!(result.rows, 1);
}

#[test]
fn an_export_that_fails_leaves_what_was_there() {
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

    let plan = Plan::new(&crate::record::layout::tests::named(&NAMES)).unwrap();
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
    let sheet = Sheet::of(plan.contract());
    let result = csv::write(
        &plan,
        &sheet,
        &mut journal,
        &Choice::all(Rows::Step),
        &mut Full,
    );
    assert!(matches!(result, Err(Trouble::Write(_))));
}

fn laid_out<F: Columnar>(rows: u64) -> Result<(F, Skeleton), ExportError> {
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("run");
    recorded(&path, &NAMES, &[]);
    let run = Run::open(&path).unwrap();
    let plan = Plan::new(run.layout()).unwrap();
    F::lay_out(&Table {
        run: &run,
        plan: &plan,
        rows,
    })
}

/// Every byte of the file has one owner; only up to seven bytes before a multiple of eight may have none.
fn nothing_overlaps<F: Columnar>(rows: u64) {
    let (format, skeleton) = laid_out::<F>(rows).unwrap();
    let sums = vec![7; skeleton.checksums.len()];
    let mut parts: Vec<(u64, u64)> = skeleton.places.iter().map(|p| (*p, 8 * rows)).collect();
    let pieces = skeleton.pieces.iter();
    parts.extend(pieces.map(|(place, bytes)| (*place, bytes.len() as u64)));
    // Checksums are written over the head that they belong to.
    let closing = format.close(&sums);
    let closing = closing.iter().filter(|(_, bytes)| bytes.len() > 4);
    parts.extend(closing.map(|(place, bytes)| (*place, bytes.len() as u64)));
    parts.sort_unstable();
    let mut end = 0;
    for (place, length) in parts {
        assert!(place >= end && place < end + 8, "{place} follows {end}");
        end = place + length;
    }
    assert_eq!(end, skeleton.length);
}

#[test]
fn what_a_format_lays_out_covers_its_file_and_nothing_twice() {
    for rows in [0, 1, 3, 1000, 200_000_000] {
        nothing_overlaps::<Npz>(rows);
        nothing_overlaps::<Hdf5>(rows);
        nothing_overlaps::<Mat>(rows);
    }
    nothing_overlaps::<Npz>(1 << 33);
    nothing_overlaps::<Hdf5>(1 << 33);
}

#[test]
fn a_column_that_matlab_does_not_read_is_refused() {
    // 2^31 − 1 bytes, less what stands around the values.
    let limit = (2_147_483_647 - 256) / 8;
    assert!(laid_out::<Mat>(limit).is_ok());
    let refused = laid_out::<Mat>(limit + 1).err().unwrap().to_string();
    assert!(
        refused.contains("268435424 rows are more than a MATLAB file can hold"),
        "{refused}"
    );
}

/// A sparse file of 120 GiB: its last entries are found and read where they stand.
#[test]
fn an_archive_beyond_4_gib_is_read_by_another_program() {
    let rows = 1 << 30;
    let (format, skeleton) = laid_out::<Npz>(rows).unwrap();
    let temp = tempfile::tempdir().unwrap();
    let path = temp.path().join("large.npz");
    let file = crate::record::atomic::AtomicFile::create(&path).unwrap();
    if file.set_len(skeleton.length).is_err() {
        return; // A file system without large files.
    }
    let sums = vec![0; skeleton.checksums.len()];
    for (place, bytes) in skeleton.pieces.iter().chain(&format.close(&sums)) {
        file.write_all_at(bytes, *place).unwrap();
    }
    file.commit().unwrap();
    let code = "import sys, zipfile\nz = zipfile.ZipFile(sys.argv[1])\n\
        print(z.getinfo('x2.npy').file_size, z.getinfo('sequence.npy').header_offset > 2**36, len(z.read('units.npy')) > 64)";
    let Ok(output) = std::process::Command::new("python3")
        .args(["-c", code])
        .arg(&path)
        .output()
    else {
        return; // No Python here; the layout is held by the test above.
    };
    let said = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(said.trim(), "8589934720 True True", "{errors}");
}

#[test]
fn a_line_is_made_without_allocation() {
    let plan = Plan::new(&crate::record::layout::tests::named(&NAMES)).unwrap();
    let values = row(1.0, 0.0, -1.2345678901234567e-300, f64::MAX);
    let sheet = Sheet::of(plan.contract());
    let mut line = Vec::with_capacity(26 * sheet.width());
    let used = allocation_counter::measure(|| sheet.line(&values, &mut line).unwrap());
    assert_eq!(used.count_total, 0);
}

proptest! {
    #[test]
    fn every_number_reads_back_to_the_same_bits(bits in any::<u64>()) {
        let value = f64::from_bits(bits);
        let plan = Plan::new(&crate::record::layout::tests::named(&["step", "time", "x1"])).unwrap();
        let mut line = Vec::new();
        Sheet::of(plan.contract()).line(&[0.0, 0.0, value], &mut line).unwrap();
        let text = std::str::from_utf8(&line).unwrap();
        let cell = text.split(',').nth(1).unwrap();
        if value.is_nan() {
            prop_assert_eq!(cell, "");
        } else {
            prop_assert_eq!(cell.parse::<f64>().unwrap().to_bits(), bits);
        }
    }
}
