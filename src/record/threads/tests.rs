//! The bytes, the queue, the file that refuses.

use super::log::ThreadLog;
use super::*;
use crate::record::append::tests::SmallDisk;

fn still() -> u64 {
    1000
}

fn caller() -> Who {
    Who {
        name: "gusset-sampler".to_owned(),
        id: 4_194_303,
    }
}

fn read(bytes: &[u8]) -> (Vec<ThreadRecord>, ThreadEnd) {
    let mut reader = ThreadReader::new(bytes);
    let mut records = Vec::new();
    while let Some(record) = reader.next_record().unwrap() {
        records.push(record);
    }
    (records, reader.end().unwrap())
}

fn stamp(begin_ns: u64, duration_ns: u64, amount: u64) -> Stamp {
    Stamp {
        thread: 3,
        what: What::WriteRows,
        pieces: 1,
        begin_ns,
        duration_ns,
        amount,
    }
}

/// The table of the module's text, byte for byte, with the CRC of another implementation: zlib's `crc32` of the 20 bytes.
#[test]
fn a_record_is_these_bytes() {
    let mut bytes = Vec::new();
    stamp(0x0102_0304_0506_0708, 0x0a0b_0c0d, 0x1112_1314).encode(&mut bytes);
    let body = [
        3, 2, 1, 0, 0x0d, 0x0c, 0x0b, 0x0a, 8, 7, 6, 5, 4, 3, 2, 1, 0x14, 0x13, 0x12, 0x11,
    ];
    assert_eq!(bytes[..BODY], body);
    assert_eq!(bytes[BODY..], CRC_OF_THAT.to_le_bytes());
    let mut bytes = Vec::new();
    encode_name(7, "gusset-sampler", 4_194_303, &mut bytes);
    assert_eq!(bytes[..BODY], *b"\x07\x00gusset-sampler\x00\xff\xff\x3f");
    assert_eq!(bytes.len(), RECORD);
}

const CRC_OF_THAT: u32 = 0x7ca9_9748;

#[test]
fn every_code_is_one_and_is_read_back() {
    for (place, what) in What::ALL.iter().enumerate() {
        assert_eq!(usize::from(what.code()), place + 1);
        assert_eq!(What::of_code(what.code()), Some(*what));
        assert!(!what.word().is_empty());
    }
    let beyond = What::ALL.len() as u8 + 1;
    assert_eq!(What::of_code(beyond), None);
    // A later version may say more: it is passed over.
    let mut bytes = Vec::new();
    encode_head(&mut bytes);
    seal(body(0, beyond, 1, 5, 6, 7), &mut bytes);
    stamp(1, 2, 3).encode(&mut bytes);
    let known = vec![ThreadRecord::Stamp(stamp(1, 2, 3))];
    assert_eq!(read(&bytes), (known, ThreadEnd::Clean));
}

#[test]
fn what_takes_longer_than_a_record_can_say_is_several_one_behind_the_other() {
    let most = u64::from(u32::MAX);
    for (duration, records) in [(0, 1), (most, 1), (most + 1, 2), (3 * most, 3)] {
        let long = stamp(70, duration, u64::MAX);
        let mut bytes = Vec::new();
        encode_head(&mut bytes);
        long.encode(&mut bytes);
        assert_eq!(bytes.len(), RECORD * (1 + records), "{duration}");
        assert_eq!(long.records(), records);
        let (found, _) = read(&bytes);
        let mut at = 70;
        for record in &found {
            let ThreadRecord::Stamp(found) = record else {
                panic!("{record:?}")
            };
            assert_eq!(found.begin_ns, at);
            let amount = if at == 70 { most } else { 0 };
            assert_eq!(
                found.amount, amount,
                "written once, with the largest amount"
            );
            at += found.duration_ns;
        }
        assert_eq!(at, 70 + duration);
    }
}

#[test]
fn a_file_cut_anywhere_gives_every_whole_record_and_a_changed_byte_ends_it() {
    let mut bytes = Vec::new();
    encode_head(&mut bytes);
    (0..4).for_each(|k| stamp(k, 1, k).encode(&mut bytes));
    for cut in 0..=bytes.len() {
        let (records, end) = read(&bytes[..cut]);
        assert_eq!(records.len(), (cut / RECORD).saturating_sub(1));
        let torn = ThreadEnd::Torn {
            bytes: cut % RECORD,
        };
        let whole = cut % RECORD == 0;
        assert_eq!(end, if whole { ThreadEnd::Clean } else { torn });
    }
    for place in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[place] ^= 0x10;
        let (records, end) = read(&changed);
        let record = (place / RECORD) as u64;
        if record == 0 {
            assert_eq!((records.len(), end), (0, ThreadEnd::Foreign));
        } else {
            assert_eq!(records.len() as u64, record - 1);
            assert_eq!(end, ThreadEnd::Damaged { record });
        }
    }
    assert_eq!(read(b"step,time\n0,0\n1,2,3,4,5,6,7").1, ThreadEnd::Foreign);
}

#[test]
fn stamps_reach_the_file_behind_the_name_of_their_thread() {
    let disk = SmallDisk::with_room(1 << 20);
    let roll = Roll::with_queue(still, caller, 8);
    let mut log = ThreadLog::new(disk.clone(), roll.clone());
    let first = roll.enter();
    first.since(What::Look, 400, 0);
    log.turn(5);
    let second = roll.enter();
    second.pieces(What::Carries, 9, 500, 700, 30);
    assert_eq!(log.finish(6), 0);
    let (records, end) = read(&disk.bytes());
    let name = |thread| ThreadRecord::Name {
        thread,
        name: "gusset-sampler".to_owned(),
        id: 4_194_303,
    };
    let look = Stamp {
        thread: 0,
        what: What::Look,
        pieces: 1,
        begin_ns: 400,
        duration_ns: 600,
        amount: 0,
    };
    let carries = Stamp {
        thread: 1,
        what: What::Carries,
        pieces: 9,
        begin_ns: 500,
        duration_ns: 200,
        amount: 30,
    };
    let expected = [
        name(0),
        ThreadRecord::Stamp(look),
        name(1),
        ThreadRecord::Stamp(carries),
    ];
    assert_eq!((records.as_slice(), end), (&expected[..], ThreadEnd::Clean));
}

#[test]
fn a_full_queue_waits_for_nobody_and_what_it_drops_is_counted_in_the_file() {
    let disk = SmallDisk::with_room(1 << 20);
    let roll = Roll::with_queue(still, caller, 3);
    let mut log = ThreadLog::new(disk.clone(), roll.clone());
    let stamper = roll.enter();
    (0..10).for_each(|k| stamper.since(What::Request, k, k));
    log.turn(77);
    stamper.since(What::Request, 10, 10);
    assert_eq!(log.finish(78), 7);
    let (records, _) = read(&disk.bytes());
    let begins = records.iter().filter_map(|record| match record {
        ThreadRecord::Stamp(stamp) => Some(stamp.begin_ns),
        _ => None,
    });
    assert_eq!(begins.collect::<Vec<_>>(), [0, 1, 2, 10]);
    let lost = ThreadRecord::Lost {
        at_ns: 77,
        stamps: 7,
    };
    assert_eq!(records.iter().filter(|r| **r == lost).count(), 1);
}

#[test]
fn a_full_disk_is_met_with_a_bound_and_a_count_and_leaves_whole_records() {
    let disk = SmallDisk::with_room(5 * RECORD + 7);
    let roll = Roll::with_queue(still, caller, 8);
    let mut log = ThreadLog::new(disk.clone(), roll.clone());
    let stamper = roll.enter();
    let offered = 10_000_u64;
    for k in 0..offered {
        stamper.since(What::Request, k, 0);
        log.turn(k);
        log.flush(k);
    }
    assert_eq!(disk.bytes().len(), 5 * RECORD, "whole records only");
    let lost = log.finish(offered);
    let (records, end) = read(&disk.bytes());
    assert_eq!(end, ThreadEnd::Clean);
    // A head, a name, three stamps.
    assert_eq!(records.len(), 4);
    assert_eq!(lost, offered - 3);
    assert!(log.file.waiting() <= log::WAITING);
}

#[test]
fn nobody_is_heard_who_is_on_no_roll_or_on_a_closed_one() {
    let roll = Roll::with_queue(still, caller, 8);
    let stampers: Vec<Stamper> = (0..300).map(|_| roll.enter()).collect();
    stampers[254].since(What::Request, 1, 0);
    stampers[255].since(What::Request, 2, 0);
    roll.close();
    stampers[0].since(What::Request, 3, 0);
    let begins: Vec<u64> = roll.waiting().map(|stamp| stamp.begin_ns).collect();
    assert_eq!((begins, roll.lost()), (vec![1], 0));
}

#[test]
fn a_roll_is_found_where_work_is_done_for_it_and_nowhere_else() {
    let roll = Roll::with_queue(still, caller, 8);
    assert!(Roll::here().is_none());
    roll.within(|| {
        let found = Roll::here().unwrap();
        let _ = found.enter();
    });
    assert!(Roll::here().is_none());
    assert_eq!(roll.name_those_after(0, |_, _| ()), 1);
}

#[test]
fn a_stamp_allocates_nothing() {
    let roll = Roll::with_queue(still, caller, 8);
    let stamper = roll.enter();
    let used = allocation_counter::measure(|| {
        (0..20).for_each(|k| stamper.since(What::Look, k, 0));
    });
    assert_eq!((used.count_total, roll.lost()), (0, 12));
}
