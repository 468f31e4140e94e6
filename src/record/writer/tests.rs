//! Tests of the writer: its turns on a hand-held clock, then the threads end to end.

use super::drain::CHUNK;
use super::*;
use crate::append::tests::SmallDisk;
use crate::checkpoint::STATE_FILES;
use crate::journal::{End, Journal};
use crate::layout::stride;
use crate::{
    Checkpoint, Checksum, Event, MissCause, Recorder, RingRecorder, RingSize, TimedEvent, WhenFull,
    ring,
};
use gusset_quantity::state::TestState;
use serde_json::{Map, Value};

const MS: u64 = 1_000_000;

/// A note of an event that no version knows.
fn told(event: &str) -> Note {
    let event = event.to_owned();
    let fields = Map::new();
    Event::Other { event, fields }.into()
}

fn at(monotonic_ns: u64) -> Moment {
    Moment {
        monotonic_ns,
        utc_ns: 1_772_366_400_000_000_000 + monotonic_ns,
    }
}

fn small(rows: usize) -> (RingRecorder, RingReader) {
    ring(2, RingSize { rows, events: 8 }, WhenFull::Drop).unwrap()
}

fn drain<S: Store, E: Store>(
    reader: RingReader,
    samples: S,
    events: E,
    settings: WriterSettings,
) -> (Drain<S, E>, Sender<Note>) {
    let (send, notes) = crossbeam_channel::bounded(4);
    (
        Drain::new(reader, samples, events, None, notes, settings),
        send,
    )
}

fn numbers(bytes: &[u8]) -> (Vec<u64>, End) {
    let mut journal = Journal::new(bytes, 2);
    let mut numbers = Vec::new();
    while let Some(row) = journal.next_row().unwrap() {
        assert_eq!(
            row.values,
            [row.sequence as f64, 0.25 * row.sequence as f64]
        );
        numbers.push(row.sequence);
    }
    (numbers, journal.end().unwrap())
}

fn push(recorder: &mut RingRecorder, range: std::ops::Range<u64>) -> usize {
    range
        .filter(|&k| recorder.row(&[k as f64, 0.25 * k as f64]))
        .count()
}

fn lines(disk: &SmallDisk) -> Vec<Value> {
    let text = String::from_utf8(disk.bytes()).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[test]
fn rows_are_flushed_within_the_flush_time() {
    let (mut recorder, reader) = small(64);
    let disk = SmallDisk::with_room(1 << 20);
    let (mut drain, _notes) = drain(reader, disk.clone(), Vec::new(), WriterSettings::default());
    drain.turn(at(1000 * MS));
    push(&mut recorder, 0..3);
    drain.turn(at(1019 * MS));
    assert_eq!(disk.bytes().len(), 0);
    drain.turn(at(1020 * MS));
    assert_eq!(numbers(&disk.bytes()), (vec![0, 1, 2], End::Clean));
}

#[test]
fn flushed_rows_survive_a_kill() {
    // A kill takes the drain's memory and leaves the file: look at the file without finishing.
    let (mut recorder, reader) = small(64);
    let disk = SmallDisk::with_room(1 << 20);
    let (mut drain, _notes) = drain(reader, disk.clone(), Vec::new(), WriterSettings::default());
    for k in 0..500u64 {
        push(&mut recorder, k..k + 1);
        drain.turn(at(k * 2 * MS));
        let (seen, end) = numbers(&disk.bytes());
        assert_eq!(end, End::Clean);
        // 25 ms at one row per 2 ms.
        assert!(k < 13 || seen.len() as u64 >= k - 12, "{k}: {}", seen.len());
    }
}

#[test]
fn event_follows_its_rows_into_the_file() {
    let (mut recorder, reader) = small(64);
    let (samples, events) = (SmallDisk::with_room(1 << 20), SmallDisk::with_room(1 << 20));
    let (mut drain, notes) = drain(
        reader,
        samples.clone(),
        events.clone(),
        WriterSettings::default(),
    );
    drain.turn(at(1000 * MS));
    push(&mut recorder, 0..3);
    recorder.event(TimedEvent {
        tick: 2,
        time: 0.5,
        clock_ns: 1002 * MS,
        kind: Event::HoldRequested,
    });
    drain.turn(at(1002 * MS));
    let seen = || (numbers(&samples.bytes()).0.len(), lines(&events).len());
    assert_eq!(seen(), (3, 1));
    push(&mut recorder, 3..5);
    notes.send(told("told")).unwrap();
    drain.turn(at(1004 * MS));
    assert_eq!(seen(), (5, 2));
}

#[test]
fn ring_losses_are_counted_and_reported() {
    let (mut recorder, reader) = small(4);
    let (samples, events) = (SmallDisk::with_room(1 << 20), SmallDisk::with_room(1 << 20));
    let (mut drain, _notes) = drain(
        reader,
        samples.clone(),
        events.clone(),
        WriterSettings::default(),
    );
    assert_eq!(push(&mut recorder, 0..7), 4);
    assert!(drain.turn(at(MS)), "a full ring asks for another turn");
    assert_eq!(push(&mut recorder, 7..9), 2);
    let recorded = drain.finish(at(2 * MS));
    assert_eq!(
        numbers(&samples.bytes()),
        (vec![0, 1, 2, 3, 7, 8], End::Clean)
    );
    assert_eq!(
        (
            recorded.rows_written,
            recorded.rows_lost_queue,
            recorded.rows_lost()
        ),
        (6, 3, 3)
    );
    let shout = lines(&events)
        .into_iter()
        .find(|l| l["event"] == "rows_lost")
        .unwrap();
    assert_eq!(
        (&shout["rows_lost"], &shout["to_full_queue"]),
        (&3.into(), &3.into())
    );
}

#[test]
fn full_disk_loses_only_rows_past_the_bound() {
    let (mut recorder, reader) = small(100_000);
    let size = stride(2);
    let bound = 2 * CHUNK;
    let (samples, events) = (
        SmallDisk::with_room(10 * size + 5),
        SmallDisk::with_room(1 << 20),
    );
    let settings = WriterSettings {
        waiting_bytes: 0,
        step_column: Some(0),
        time_column: Some(1),
        ..WriterSettings::default()
    };
    let (mut drain, _notes) = drain(reader, samples.clone(), events.clone(), settings);
    let offered = (bound / size + 1000) as u64;
    assert_eq!(push(&mut recorder, 0..offered) as u64, offered);
    drain.turn(at(1000 * MS));
    assert_eq!(
        samples.bytes().len(),
        10 * size,
        "whole rows only, also while the disk is full"
    );
    let kept = 10 + (bound / size) as u64;
    assert_eq!(drain.rows_lost(), offered - kept);
    samples.set_room(64 << 20);
    push(&mut recorder, offered..offered + 5);
    drain.turn(at(1050 * MS));
    assert_eq!(samples.bytes().len(), 10 * size, "asked again too early");
    drain.turn(at(1101 * MS));
    push(&mut recorder, offered + 5..offered + 7);
    let recorded = drain.finish(at(1200 * MS));
    let (seen, end) = numbers(&samples.bytes());
    assert_eq!(end, End::Clean);
    assert_eq!(seen[..kept as usize], (0..kept).collect::<Vec<_>>());
    // While it was full even the five rows after it found no room.
    assert_eq!(seen[kept as usize..], [offered + 5, offered + 6]);
    assert_eq!(recorded.rows_lost_file, offered - kept + 5);
    assert_eq!(recorded.rows_written + recorded.rows_lost(), offered + 7);
    assert!(recorded.first_error.unwrap().starts_with("samples.bin: "));
    let names: Vec<_> = lines(&events)
        .iter()
        .map(|l| l["event"].as_str().unwrap().to_owned())
        .collect();
    for name in ["write_failed", "write_recovered", "rows_lost"] {
        assert!(
            names.iter().any(|n| n == name),
            "{name} missing in {names:?}"
        );
    }
    // The first to fail was the write of the first chunk; it knows the tick and the time of the row that filled it.
    let at_failure = (CHUNK / size - 1) as u64;
    let first = &lines(&events)[0];
    assert_eq!(
        (&first["tick"], &first["time"]),
        (&at_failure.into(), &(0.25 * at_failure as f64).into())
    );
}

#[test]
fn lasting_full_disk_is_reported_at_the_end() {
    let (mut recorder, reader) = small(64);
    let (samples, events) = (
        SmallDisk::with_room(stride(2) * 2 + 1),
        SmallDisk::with_room(0),
    );
    let (mut drain, _notes) = drain(
        reader,
        samples.clone(),
        events.clone(),
        WriterSettings::default(),
    );
    push(&mut recorder, 0..10);
    recorder.event(TimedEvent {
        tick: 1,
        time: 0.0,
        clock_ns: 1,
        kind: Event::Started,
    });
    drain.turn(at(50 * MS));
    let recorded = drain.finish(at(60 * MS));
    assert_eq!(numbers(&samples.bytes()), (vec![0, 1], End::Clean));
    assert_eq!((recorded.rows_written, recorded.rows_lost_file), (2, 8));
    assert_eq!(recorded.events_written, 0);
    assert!(
        recorded.events_lost >= 3,
        "started, write_failed, rows_lost: {}",
        recorded.events_lost
    );
}

#[test]
fn progress_shows_the_latest_row() {
    let (mut recorder, reader) = small(64);
    let (mut drain, _notes) = drain(reader, Vec::new(), Vec::new(), WriterSettings::default());
    push(&mut recorder, 0..5);
    recorder.event(TimedEvent {
        tick: 4,
        time: 0.0,
        clock_ns: 30 * MS,
        kind: Event::Miss {
            late_ns: 1,
            stretched: 0,
            class: MissCause::LateReply,
            evidence: None,
        },
    });
    drain.turn(at(30 * MS));
    let progress = lock(&drain.progress).clone();
    assert_eq!(progress.last_row, [4.0, 1.0]);
    assert_eq!(
        (progress.rows_written, progress.rows_lost, progress.events),
        (5, 0, 1)
    );
    assert_eq!(progress.misses.late_reply, 1);
}

#[test]
fn syncs_happen_once_per_period_if_needed() {
    let (mut recorder, reader) = small(64);
    let (mut drain, _notes) = drain(reader, Vec::new(), Vec::new(), WriterSettings::default());
    let mut asked = Vec::new();
    for ms in (0..4000).step_by(20) {
        if ms < 2000 {
            push(&mut recorder, ms / 20..ms / 20 + 1);
        }
        let before = drain.synced_ns;
        drain.turn(at(ms * MS));
        if drain.synced_ns != before {
            asked.push(ms);
        }
    }
    assert_eq!(asked, [900, 1800, 2700]);
}

static TIME: AtomicU64 = AtomicU64::new(0);

fn ticking() -> u64 {
    TIME.fetch_add(MS, Ordering::Relaxed)
}

const TICKING: Clocks = Clocks {
    monotonic_ns: ticking,
    utc_ns: ticking,
};

#[test]
fn notes_have_the_step_of_the_row_before() {
    let (mut recorder, reader) = small(8);
    let events = SmallDisk::with_room(1 << 20);
    let settings = WriterSettings {
        step_column: Some(0),
        time_column: Some(1),
        ..WriterSettings::default()
    };
    let (mut drain, notes) = drain(
        reader,
        SmallDisk::with_room(1 << 20),
        events.clone(),
        settings,
    );
    recorder.row(&[799.0, 0.5]);
    recorder.row(&[800.0, 0.75]);
    notes.send(told("asked")).unwrap();
    drain.turn(at(MS));
    drain.finish(at(2 * MS));
    let line = &lines(&events)[0];
    assert_eq!((&line["tick"], &line["time"]), (&800.into(), &0.75.into()));
}

#[test]
fn every_row_and_event_is_in_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let open = |name: &str| {
        let mut options = std::fs::OpenOptions::new();
        options.create_new(true).append(true);
        options.open(folder.path().join(name)).unwrap()
    };
    let (mut recorder, reader) = ring(
        2,
        RingSize {
            rows: 100,
            events: 8,
        },
        WhenFull::Wait,
    )
    .unwrap();
    let settings = WriterSettings {
        real_clock: false,
        ..WriterSettings::default()
    };
    let (samples, events) = (open("samples.bin"), open("events.jsonl"));
    let writer = Writer::spawn(reader, samples, events, None, TICKING, settings, None).unwrap();
    let mut fields = Map::new();
    fields.insert("policy".to_owned(), "fifo".into());
    writer.note(Event::Other {
        event: "granted".to_owned(),
        fields,
    });
    let count = 20_000;
    let pushed = std::thread::spawn(move || {
        let pushed = push(&mut recorder, 0..count);
        recorder.event(TimedEvent {
            tick: count,
            time: 1.0,
            clock_ns: 5,
            kind: Event::Ended,
        });
        pushed as u64
    });
    assert_eq!(pushed.join().unwrap(), count);
    let recorded = writer.finish().unwrap();
    assert_eq!((recorded.rows_written, recorded.rows_lost()), (count, 0));
    assert_eq!(
        (
            recorded.events_written,
            recorded.events_lost,
            recorded.sync_failures
        ),
        (2, 0, 0)
    );
    let bytes = std::fs::read(folder.path().join("samples.bin")).unwrap();
    assert_eq!(numbers(&bytes), ((0..count).collect(), End::Clean));
    let text = std::fs::read_to_string(folder.path().join("events.jsonl")).unwrap();
    let lines: Vec<Value> = text
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    assert_eq!(
        (&lines[0]["event"], &lines[0]["policy"]),
        (&"granted".into(), &"fifo".into())
    );
    assert_eq!(
        (&lines[1]["event"], &lines[1]["clock_ns"]),
        (&"ended".into(), &5.into())
    );
}

#[test]
fn dropped_writer_finishes_its_files() {
    let (mut recorder, reader) = small(64);
    let disk = SmallDisk::with_room(1 << 20);
    let settings = WriterSettings::default();
    let writer = Writer::spawn(
        reader,
        disk.clone(),
        Vec::new(),
        None,
        TICKING,
        settings,
        None,
    )
    .unwrap();
    push(&mut recorder, 0..5);
    drop(writer);
    assert_eq!(numbers(&disk.bytes()).0.len(), 5);
}

#[test]
fn set_up_note_precedes_events_of_its_turn() {
    let (mut recorder, reader) = small(8);
    let events = SmallDisk::with_room(1 << 20);
    let (mut drain, notes) = drain(
        reader,
        Vec::new(),
        events.clone(),
        WriterSettings::default(),
    );
    notes.send(told("connected")).unwrap();
    let ended = TimedEvent {
        tick: 0,
        time: 0.0,
        clock_ns: 0,
        kind: Event::Ended,
    };
    assert!(recorder.event(ended));
    drain.turn(at(1000 * MS));
    drain.finish(at(1001 * MS));
    let kinds: Vec<Value> = lines(&events).iter().map(|l| l["event"].clone()).collect();
    assert_eq!(kinds, ["connected", "ended"]);
}

/// Keeps the rows it is shown; panics at one row if requested.
struct Keeper {
    seen: Arc<Mutex<Vec<u64>>>,
    panics_at: Option<u64>,
    notes: usize,
}

impl crate::Onlooker for Keeper {
    fn row(&mut self, sequence: u64, row: &[f64]) {
        assert_eq!(row[1], 0.25 * sequence as f64);
        lock(&self.seen).push(sequence);
        assert_ne!(self.panics_at, Some(sequence));
    }

    fn turn(&mut self, _now_ns: u64, _progress: &Progress) {}

    fn note(&mut self) -> Option<Note> {
        self.notes = self.notes.checked_sub(1)?;
        Some(told("seen"))
    }

    fn finish(&mut self, _now_ns: u64, progress: &Progress) {
        lock(&self.seen).push(1000 + progress.rows_written);
    }
}

#[test]
fn panicking_observer_costs_no_rows() {
    for panics_at in [None, Some(17)] {
        let (mut recorder, reader) = small(64);
        let (samples, events) = (SmallDisk::with_room(1 << 20), SmallDisk::with_room(1 << 20));
        let (mut drain, _notes) = drain(
            reader,
            samples.clone(),
            events.clone(),
            WriterSettings::default(),
        );
        let seen = Arc::new(Mutex::new(Vec::new()));
        let keeper = Keeper {
            seen: Arc::clone(&seen),
            panics_at,
            notes: 2,
        };
        drain.onlooker = Watched::by(Some(Box::new(keeper)));
        assert_eq!(push(&mut recorder, 0..50), 50);
        drain.turn(at(MS));
        let recorded = drain.finish(at(2 * MS));
        assert_eq!((recorded.rows_written, recorded.rows_lost()), (50, 0));
        assert_eq!(numbers(&samples.bytes()), ((0..50).collect(), End::Clean));
        let lines = lines(&events);
        let count = |name: &str| lines.iter().filter(|line| line["event"] == name).count();
        let seen = lock(&seen).clone();
        match panics_at {
            None => {
                assert_eq!(seen, (0..50).chain([1050]).collect::<Vec<_>>());
                assert_eq!((count("seen"), count("internal_error")), (2, 0));
            }
            Some(last) => {
                assert_eq!(seen, (0..=last).collect::<Vec<_>>());
                assert_eq!((count("seen"), count("internal_error")), (0, 1));
            }
        }
    }
}

#[test]
fn file_changes_by_others_are_reported_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let open = |name: &str| {
        let mut options = std::fs::OpenOptions::new();
        options.create_new(true).append(true);
        options.open(path(name)).unwrap()
    };
    let (mut recorder, reader) = small(64);
    let events = SmallDisk::with_room(1 << 20);
    let settings = WriterSettings::default();
    let (mut drain, _notes) = drain(reader, open("samples.bin"), events.clone(), settings);
    let mut turn = |number: u64| {
        push(&mut recorder, number..number + 1);
        drain.turn(at(number * 1000 * MS));
        drain.turn(at(number * 1000 * MS + MS));
        lines(&events)
    };
    assert_eq!((turn(1).len(), turn(2).len()), (0, 0));
    std::fs::File::options()
        .write(true)
        .open(path("samples.bin"))
        .unwrap()
        .set_len(10)
        .unwrap();
    turn(3);
    let told = turn(4);
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!(
        (&told[0]["event"], &told[0]["file"]),
        (&"record_damaged".into(), &"samples.bin".into())
    );
    let text = told[0]["text"].as_str().unwrap();
    assert!(text.starts_with("samples.bin "), "{text}");
    let recorded = drain.finish(at(5000 * MS));
    let [(file, extent)] = recorded.files.as_slice() else {
        panic!("{:?}", recorded.files);
    };
    assert_eq!(*file, "samples.bin");
    assert!(extent.meddled_at(&path(file)).is_some());
}

/// Takes a state of two numbers after `step`, as the loop does: row, state, event.
fn checkpoint(recorder: &mut RingRecorder, step: u64) -> bool {
    let mut values = [step as f64, 0.5];
    push(recorder, step..step + 1);
    let kept = recorder.state(step, &mut |state| {
        state.take(|visit| visit.numbers(&mut values))
    });
    recorder.event(TimedEvent {
        tick: step,
        time: 0.0,
        clock_ns: 0,
        kind: Event::Checkpoint {
            digest: step,
            sha256: None,
        },
    });
    kept
}

fn with_states(recorder: &mut RingRecorder, folder: &tempfile::TempDir) -> WriterSettings {
    let room = TestState::with_room(|visit| visit.numbers(&mut [0.0; 2]));
    recorder.allocate_states(&room);
    WriterSettings {
        states: Some(StateFolder::open(folder.path()).unwrap()),
        ..WriterSettings::default()
    }
}

#[test]
fn state_and_event_share_a_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let (mut recorder, reader) = small(64);
    let settings = with_states(&mut recorder, &folder);
    let events = SmallDisk::with_room(1 << 20);
    let clocks = Clocks {
        monotonic_ns: || 0,
        utc_ns: || 0,
    };
    let writer = Writer::spawn(
        reader,
        Vec::new(),
        events.clone(),
        None,
        clocks,
        settings,
        None,
    );
    let writer = writer.unwrap();
    for step in 0..3 {
        assert!(checkpoint(&mut recorder, step));
    }
    let recorded = writer.finish().unwrap();
    assert_eq!((recorded.states_written, recorded.states_skipped), (3, 0));
    let sums: Vec<Checksum> = lines(&events)
        .iter()
        .map(|line| serde_json::from_value(line["sha256"].clone()).unwrap())
        .collect();
    for (name, step) in STATE_FILES.into_iter().zip([2u64, 1]) {
        let (state, checksum) = Checkpoint::read(&folder.path().join(name))
            .unwrap()
            .unwrap();
        assert_eq!((state.step, state.rows), (step, step + 1));
        assert_eq!(state.state.words()[0], (step as f64).to_bits());
        assert_eq!(checksum, sums[step as usize]);
    }
}

/// The loop never waits: a checkpoint that finds no buffer has an event without a state, and the next one has both.
#[test]
fn checkpoint_without_a_buffer_has_no_state() {
    let folder = tempfile::tempdir().unwrap();
    let (mut recorder, mut reader) = small(64);
    let settings = with_states(&mut recorder, &folder);
    let snapshots = Snapshots::spawn(
        reader.take_states().unwrap(),
        settings.states.clone().unwrap(),
    );
    let events = SmallDisk::with_room(1 << 20);
    let (mut drain, _notes) = drain(reader, Vec::new(), events.clone(), settings);
    drain.snapshots = Some(snapshots.unwrap());
    let kept: Vec<bool> = (0..5).map(|step| checkpoint(&mut recorder, step)).collect();
    assert_eq!(kept, [true, true, true, false, false]);
    let recorded = drain.finish(at(MS));
    assert_eq!((recorded.states_written, recorded.states_skipped), (3, 2));
    let have: Vec<bool> = lines(&events)
        .iter()
        .map(|line| line.get("sha256").is_some())
        .collect();
    assert_eq!(have, kept);
}

#[test]
fn refused_states_do_not_end_the_test() {
    let folder = tempfile::tempdir().unwrap();
    let (mut recorder, mut reader) = small(64);
    let settings = with_states(&mut recorder, &folder);
    let states = settings.states.clone().unwrap();
    let snapshots = Snapshots::spawn(reader.take_states().unwrap(), states).unwrap();
    let (mut drain, _notes) = drain(reader, Vec::new(), Vec::new(), settings);
    drain.snapshots = Some(snapshots);
    folder.close().unwrap();
    assert!(checkpoint(&mut recorder, 0));
    let recorded = drain.finish(at(MS));
    assert_eq!((recorded.states_written, recorded.states_skipped), (0, 1));
    assert_eq!(recorded.rows_written, 1);
    assert!(recorded.first_error.unwrap().starts_with("state.bin"));
}
