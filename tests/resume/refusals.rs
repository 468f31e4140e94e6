//! Tests that cannot be resumed, or only with an explicit flag.

use gusset_record::Checkpoint;

use super::rigs::{Rig, built, run_rigs, two_rigs};
use super::*;

#[test]
fn changed_run_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("whole"), &[]);
    refused(&at("whole"), "is complete", &[]);
    let fresh = |name: &str| {
        killed(&at("whole"), &at(name), 300);
        at(name)
    };
    for file in ["test.toml", "resolved.toml", "inputs/motion.csv"] {
        let run = fresh(&format!("changed-{}", file.len()));
        let text = std::fs::read_to_string(run.join(file)).unwrap();
        std::fs::write(run.join(file), format!("{text} ")).unwrap();
        refused(&run, "was changed", &[]);
    }
    let run = fresh("another");
    let other = write(home.path(), "other.toml", &frame(200, 1, 2.5, 0.0));
    refused(&run, "was interrupted", &[other.to_str().unwrap()]);
    let run = fresh("nameless");
    std::fs::write(run.join("events.jsonl"), "").unwrap();
    refused(&run, "which files", &[]);
    // Killed before it had written anything.
    let run = fresh("unwritten");
    for file in ["events.jsonl", "samples.bin"] {
        std::fs::write(run.join(file), "").unwrap();
    }
    refused(&run, "first step", &[]);
    let run = at("early");
    killed(&at("whole"), &run, 1);
    refused(&run, "first step", &[]);

    // One bit of row 250 is wrong: everything before it counts, and the test resumes from the last checkpoint before it.
    let run = fresh("damaged");
    let stride = Run::open(&run).unwrap().layout().stride();
    let mut rows = std::fs::read(run.join("samples.bin")).unwrap();
    rows[250 * stride + 20] ^= 1;
    std::fs::write(run.join("samples.bin"), &rows).unwrap();
    let said = go_on(&run, &at("after"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stderr.contains("last checkpoint"), "{}", said.stderr);
    let mut parts = steps(&[&run]);
    let after = steps(&[&at("after")]);
    let begins = *after.keys().next().unwrap();
    assert!((140..=170).contains(&begins), "{begins}");
    parts.retain(|step, _| *step < begins);
    parts.extend(after);
    assert_eq!(parts, steps(&[&at("whole")]));

    let run = fresh("worse");
    let mut rows = std::fs::read(run.join("samples.bin")).unwrap();
    let states = Run::open(&run).unwrap().columns(&["state"]).unwrap();
    let first = states[0].iter().position(|s| *s == 3.0).unwrap();
    rows[(first + 3) * stride + 20] ^= 1;
    std::fs::write(run.join("samples.bin"), &rows).unwrap();
    refused(&run, "no checkpoint", &[]);
}

/// Without a summary the events prove that the test went further, as after a disk that filled up. Its last steps must not act on
/// the specimens a second time, and the refusal reports this.
#[test]
fn record_ending_before_events_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("whole"), &[]);
    let rows = column(&at("whole"), "time").len();
    let ended = |name: &str, lost: usize| {
        copy(&at("whole"), &at(name));
        std::fs::remove_file(at(name).join("summary.json")).unwrap();
        without_rows(&at(name), rows - lost..rows);
        at(name)
    };
    let short = ended("short", 100);
    let missing = "there are events up to 2 s, but the rows end at 1.5 s";
    refused(&short, missing, &[]);
    let csv = at("short.csv");
    for (command, code, more) in [
        ("report", 0, None),
        ("replay", 1, None),
        ("export", 0, Some(["--out", csv.to_str().unwrap()])),
    ] {
        let mut args = vec![command, short.to_str().unwrap()];
        args.extend(more.into_iter().flatten());
        let said = say(args);
        assert_eq!(said.code, Some(code), "{command}: {}", said.stderr);
        let told = format!("{}{}", said.stdout, said.stderr);
        assert!(told.contains(missing), "{command}: {told}");
    }
    let page = std::fs::read_to_string(short.join("report.html")).unwrap();
    assert!(page.contains("up to 2 s"), "it also reports this");
    // All of it is there: only its summary was not written any more.
    refused(&ended("closing", 0), "is complete", &[]);
}

/// Changes one value of a row, with a new checksum of the row.
fn edited_row(run: &Path, row: usize, column: &str, change: impl Fn(f64) -> f64) {
    let path = run.join("samples.bin");
    let layout = Run::open(run).unwrap().layout().clone();
    let mut bytes = std::fs::read(&path).unwrap();
    let record = &mut bytes[row * layout.stride()..(row + 1) * layout.stride()];
    let at = 8 + 8 * layout.index_of(column).unwrap();
    let value = f64::from_le_bytes(record[at..at + 8].try_into().unwrap());
    record[at..at + 8].copy_from_slice(&change(value).to_le_bytes());
    let end = layout.stride() - 8;
    let checksum = crc32fast::hash(&record[..end]);
    record[end..end + 4].copy_from_slice(&checksum.to_le_bytes());
    std::fs::write(path, bytes).unwrap();
}

/// Where rows are missing between others, a simulated specimen restarts from the checkpoint before them. A real one remembers.
#[test]
fn gap_in_a_linked_record_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let test = two_rigs(home.path(), "[record]\ncheckpoint_s = 0.1");
    let places: [Arc<Mutex<f64>>; 2] = Default::default();
    let rigs = || places.each_ref().map(|place| Rig::boxed(place, None));
    let whole = run_rigs(built(&test), rigs(), &at("whole"), None);
    assert_eq!(whole.cause, Cause::Done);
    killed(&at("whole"), &at("first"), 380);
    killed(&at("whole"), &at("gap"), 380);
    without_rows(&at("gap"), 200..260);
    let again = |from: &str| resume(&at(from), None, false);
    let refusal = again("gap").err().unwrap();
    let ResumeError::Back {
        again_s,
        trouble,
        specimens,
        ..
    } = &refusal
    else {
        panic!("{refusal}");
    };
    assert!(trouble.contains("row 200"), "{trouble}");
    assert_eq!(specimens, "one, other");
    assert!((0.9..1.1).contains(again_s), "{again_s}");
    assert!(again("first").is_ok(), "nothing is missing there");
    let said = say([
        "run",
        "--resume",
        at("gap").to_str().unwrap(),
        "--out",
        at("out").to_str().unwrap(),
    ]);
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("be resumed"), "{}", said.stderr);

    // The newest kept state follows the damage. It replaces no row of a specimen that remembers.
    let made = column(&at("whole"), "step").len();
    let states = ["state.bin", "state-before.bin"]
        .map(|name| Checkpoint::read(&at("whole").join(name)).unwrap());
    let mut states = states.into_iter().flatten();
    let rows =
        states.find_map(|(state, _)| Some(state.rows as usize).filter(|rows| rows + 2 < made));
    let rows = rows.unwrap();
    for name in ["kept", "kept-gap", "kept-force"] {
        killed(&at("whole"), &at(name), rows + 2);
    }
    let kept = Run::open(&at("kept")).unwrap().usable_state(u64::MAX);
    assert!(kept.unwrap().0.is_some());
    assert!(again("kept").is_ok());
    let row = rows - 35;
    without_rows(&at("kept-gap"), row..row + 30);
    edited_row(&at("kept-force"), row, "raw_force_2_1", |force| force + 1.0);
    for (name, damage) in [
        ("kept-gap", format!("row {row} ")),
        ("kept-force", format!("of row {row} ")),
    ] {
        let refusal = again(name).err();
        let Some(ResumeError::Back { trouble, .. } | ResumeError::Damaged { trouble, .. }) =
            &refusal
        else {
            panic!("{name}: {refusal:?}");
        };
        assert!(trouble.contains(&damage), "{name}: {trouble}");
    }

    let test = test_in(home.path(), &frame(200, 1, 2.0, 0.0));
    completed(&test, &at("formula"), &[]);
    killed(&at("formula"), &at("anew"), 380);
    without_rows(&at("anew"), 200..260);
    // A kept state may follow the gap.
    for name in ["state.bin", "state-before.bin"] {
        std::fs::remove_file(at("anew").join(name)).unwrap();
    }
    let said = go_on(&at("anew"), &at("after"));
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let note = "the last checkpoint before that";
    assert!(said.stderr.contains(note), "{}", said.stderr);
}

#[test]
fn tripped_test_needs_after_trip() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    tripped_in(home.path(), &at("first"));
    let wanted = "(measured_force_n): ";
    refused(&at("first"), wanted, &[]);
    refused(&at("first"), wanted, &["--yes"]);
    let (first, second) = (at("first"), at("second"));
    let said = say([
        "run",
        "--resume",
        first.to_str().unwrap(),
        "--out",
        second.to_str().unwrap(),
        "--after-trip",
    ]);
    // The rows show the trip, too, should the event have been lost with the process.
    let unsaid = at("unsaid");
    copy(&first, &unsaid);
    std::fs::remove_file(unsaid.join("summary.json")).unwrap();
    let events = std::fs::read_to_string(unsaid.join("events.jsonl")).unwrap();
    let torn = events.find("limit_trip").unwrap();
    std::fs::write(unsaid.join("events.jsonl"), &events[..torn]).unwrap();
    refused(&unsaid, "(limit): ", &[]);
    // A record of an earlier version does not have the causes. Nothing explains its last row.
    let earlier = at("earlier");
    copy(&unsaid, &earlier);
    let file = earlier.join("samples.json");
    let columns = std::fs::read_to_string(&file).unwrap();
    let without = columns.replace("\"cause\"", "\"cause_2\"");
    std::fs::write(&file, &without).unwrap();
    let [hash, other] = [&columns, &without].map(|text| sha256(text.as_bytes()));
    let events = events[..torn].replace(&hash, &other);
    std::fs::write(earlier.join("events.jsonl"), events).unwrap();
    refused(&earlier, "(unknown): ", &[]);
    // It may trip at once again: the run reports the earlier trip either way.
    assert!(matches!(said.code, Some(0 | 1)), "{}", said.stderr);
    assert!(said.stderr.contains("HAD TRIPPED"), "{}", said.stderr);
    let summary = common::json(&second, "summary.json");
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("HAD TRIPPED"), "{warnings}");
    // The effect of steps without a row on the specimen is unknown.
    let samples = std::fs::File::options()
        .write(true)
        .open(first.join("samples.bin"))
        .unwrap();
    let length = samples.metadata().unwrap().len();
    samples.set_len(length / 2).unwrap();
    refused(&first, "rows end", &["--after-trip"]);
}

/// A test that froze at its trip has the same commands as an interrupted one: only its events show the difference.
#[test]
fn lost_trip_event_needs_after_trip() {
    let home = tempfile::tempdir().unwrap();
    let at = |name: &str| home.path().join(name);
    let text =
        frame(200, 1, 2.0, 0.0) + "[specimen.limits]\ncommand_disp_m = { trip = [-2e-3, 2e-3] }\n";
    let test = test_in(home.path(), &text);
    let said = common::run(&test, &at("tripped"), &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    let events = std::fs::read(at("tripped").join("events.jsonl")).unwrap();
    let text = String::from_utf8(events.clone()).unwrap();
    let line = text
        .lines()
        .find(|line| line.contains("limit_trip"))
        .unwrap();
    let begins = text.find(line).unwrap();
    let with = |change: &dyn Fn(&mut Vec<u8>), summary: &dyn Fn(String) -> String| {
        let changed = at("changed");
        let _ = std::fs::remove_dir_all(&changed);
        copy(&at("tripped"), &changed);
        let mut bytes = events.clone();
        change(&mut bytes);
        std::fs::write(changed.join("events.jsonl"), bytes).unwrap();
        let file = changed.join("summary.json");
        let told = summary(std::fs::read_to_string(&file).unwrap());
        std::fs::write(file, told).unwrap();
        changed
    };
    let cut: &dyn Fn(&mut Vec<u8>) = &|bytes| bytes.truncate(begins);
    let bent: &dyn Fn(&mut Vec<u8>) = &|bytes| bytes[begins] ^= 0x80;
    let torn: &dyn Fn(&mut Vec<u8>) = &|bytes| bytes.truncate(begins + 20);
    for change in [cut, torn] {
        let run = with(change, &|told| told);
        refused(&run, "(unknown): ", &[]);
    }
    // The phase that follows the lost line tells what tripped.
    let run = with(bent, &|told| told);
    refused(&run, "(command_disp_m): ", &[]);
    let wider = ["specimen.0.limits.command_disp_m.trip=[-1.0, 1.0]".to_owned()];
    let allowed = Allowed {
        after_trip: true,
        wider: Some((&wider, "a trial")),
        ..Allowed::default()
    };
    let next = resume_allowed(&with(torn, &|told| told), None, allowed);
    let warnings = next
        .unwrap_or_else(|e| panic!("{e}"))
        .facts
        .warnings
        .join("\n");
    assert!(warnings.contains("TRIPPED (unknown): "), "{warnings}");
    // The operator had ended this one; a trip would have come before.
    let run = with(torn, &|told| told.replace("\"stopped\"", "\"interrupted\""));
    let said = go_on(&run, &at("second"));
    assert!(!said.stderr.contains("--after-trip"), "{}", said.stderr);
}

/// A value that is not finite is latched as any other trip, wherever it was computed.
#[test]
fn nonfinite_ending_needs_after_trip() {
    let home = tempfile::tempdir().unwrap();
    let text = "[time]\nrate_hz = 100\nduration_s = 0.5\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"spring\"\n\
        signal.sine = { amplitude = 100, frequency_hz = 1 }\n[[specimen]]\nname = \"spring\"\n\
        law.cubic = { stiffness_n_per_m = 1e3, cubic_n_per_m3 = 1e304 }\n";
    let test = write(home.path(), "test.toml", text);
    let first = home.path().join("first");
    let said = common::run(&test, &first, &[]);
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    refused(&first, "(diverged): ", &[]);
}
