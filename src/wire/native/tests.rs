use proptest::prelude::*;

use super::layout::*;
use super::*;
use crate::substructure::{Command, Measurement, Status};
use crate::wire::key::{PreSharedKey, SessionKey};
use crate::wire::window::Arrival;
use crate::wire::{Progress, Side, WireError};

const SESSION: u64 = 0xA1B2_C3D4_E5F6_0718;

fn key(last: u8) -> SessionKey {
    let mut secret = [9; 32];
    secret[31] = last;
    PreSharedKey::new(&secret)
        .unwrap()
        .session(&[1; 32], &[2; 32], SESSION)
}

fn ends(side: Side, axes: usize, keyed: bool) -> (Encoder, Decoder) {
    let key = keyed.then(|| key(0));
    (
        Encoder::new(side, axes, SESSION, key.clone()).unwrap(),
        Decoder::new(side, axes, SESSION, key).unwrap(),
    )
}

fn measurement(axes: usize, sequence: u64, force: f64) -> Measurement {
    Measurement {
        sequence,
        time: sequence as f64,
        status: Status::SATURATED,
        disp: (0..axes).map(|axis| axis as f64 * 0.5).collect(),
        force: (0..axes).map(|axis| force + axis as f64).collect(),
    }
}

/// One frame of every kind that this side may write, in one buffer each, all of them of `axes` axes.
fn all_frames(side: Side, axes: usize, keyed: bool) -> Vec<Vec<u8>> {
    let (mut encoder, _) = ends(side, axes, keyed);
    let vector = vec![0.25; axes];
    let notice = Notice {
        sequence: 3,
        cause: Cause::Operator,
    };
    let beat = Heartbeat {
        sequence: 3,
        time: 1.5,
        status: Status::default(),
    };
    let mut frames = Vec::new();
    let mut write = |encode: &mut dyn FnMut(&mut [u8]) -> Result<usize, WireError>| {
        let mut out = vec![0xAA; 8000];
        let length = encode(&mut out).unwrap();
        out.truncate(length);
        frames.push(out);
    };
    if side == Side::Controller {
        let command = Command {
            sequence: 3,
            time: 0.5,
            dt: 0.01,
            disp: &vector,
            vel: &vector,
        };
        write(&mut |out| encoder.command(&command, out));
        write(&mut |out| encoder.hold(notice, out));
        write(&mut |out| encoder.retire(notice, out));
    } else {
        let measured = measurement(axes, 3, 100.0);
        write(&mut |out| encoder.measurement(&measured, Moment::default(), out));
    }
    write(&mut |out| encoder.heartbeat(beat, out));
    write(&mut |out| encoder.goodbye(notice, out));
    write(&mut |out| encoder.control(b"not decoded here", out));
    frames
}

fn every_frame() -> impl Iterator<Item = (Side, bool, Vec<u8>)> {
    [Side::Controller, Side::Specimen]
        .into_iter()
        .flat_map(|side| [false, true].map(|keyed| (side, keyed)))
        .flat_map(|(side, keyed)| {
            all_frames(side, 2, keyed)
                .into_iter()
                .map(move |frame| (side, keyed, frame))
        })
}

#[test]
fn the_offsets_are_those_of_the_table() {
    assert_eq!(HEADER_LEN, 32);
    assert_eq!(
        (AT_COMMAND_TIME, AT_COMMAND_DT, AT_COMMAND_DISP),
        (40, 48, 56)
    );
    assert_eq!(at_command_vel(3), 56 + 24);
    assert_eq!((AT_SPECIMEN_TIME, AT_SAMPLED_AFTER), (40, 48));
    assert_eq!((AT_STATUS, AT_MISSED, AT_MEASURED_DISP), (56, 60, 64));
    assert_eq!(
        (at_force(3), at_earlier(3, 0), at_earlier(3, 1)),
        (88, 112, 144)
    );
    assert_eq!(
        (AT_BEAT_TIME, AT_BEAT_STATUS, AT_BEAT_RESERVED),
        (40, 48, 52)
    );
    assert_eq!((AT_CAUSE, AT_NOTICE_RESERVED), (40, 44));
    for axes in [1, 2, 64] {
        assert_eq!(frame_len(Kind::Command, axes, false), 56 + 16 * axes + 4);
        assert_eq!(
            frame_len(Kind::Measurement, axes, false),
            96 + 48 * axes + 4
        );
        assert_eq!(frame_len(Kind::Command, axes, true), 56 + 16 * axes + 20);
    }
    assert_eq!(frame_len(Kind::Heartbeat, 0, false), 60);
    assert_eq!(frame_len(Kind::Goodbye, 0, true), 68);
    let largest_datagram = 65_507;
    const { assert!(LARGEST_FRAME <= 65_507) };
    assert!(frame_len(Kind::Measurement, MAX_AXES, true) < largest_datagram);
}

#[test]
fn a_measurement_has_these_bytes() {
    // By hand from the table; the CRC-32 of the 192 bytes before it from another program (zlib).
    let mut expected = Vec::new();
    expected.extend(b"GUST\x01\x02\x02\x00");
    expected.extend(196_u32.to_le_bytes());
    expected.extend([2, 0, 0, 0]);
    expected.extend([0x18, 0x07, 0xF6, 0xE5, 0xD4, 0xC3, 0xB2, 0xA1]);
    expected.extend([2, 0, 0, 0, 0, 0, 0, 0]);
    expected.extend([6, 0, 0, 0, 0, 0, 0, 0]);
    expected.extend([0, 0, 0, 0, 0, 0, 0x18, 0x40]); // 6.0
    expected.extend([0, 0, 0, 0, 0, 0, 0xE0, 0x3F]); // 0.5
    expected.extend([4, 0, 0, 0, 9, 0, 0, 0]);
    expected.extend([0; 8]); // 0.0
    expected.extend([0, 0, 0, 0, 0, 0, 0xE0, 0x3F]); // 0.5
    expected.extend([0, 0, 0, 0, 0, 0, 0x00, 0xC0]); // -2.0
    expected.extend([0, 0, 0, 0, 0, 0, 0xF0, 0xBF]); // -1.0
    expected.extend([5, 0, 0, 0, 0, 0, 0, 0]);
    expected.extend([0, 0, 0, 0, 0, 0, 0xF0, 0x3F]); // 1.0
    expected.extend([0, 0, 0, 0, 0, 0, 0x00, 0x40]); // 2.0
    for _ in 0..3 {
        expected.extend([0xFF; 8]);
        expected.extend([0; 16]);
    }
    expected.extend(0x5F42_8321_u32.to_le_bytes());

    let (mut encoder, _) = ends(Side::Specimen, 2, false);
    let mut out = [0xAA; 300];
    encoder
        .measurement(&measurement(2, 5, 1.0), Moment::default(), &mut out)
        .unwrap();
    let moment = Moment {
        sampled_after: 0.5,
        missed: 9,
    };
    let length = encoder
        .measurement(&measurement(2, 6, -2.0), moment, &mut out)
        .unwrap();
    assert_eq!(out[..length], expected);
    assert!(out[length..].iter().all(|byte| *byte == 0xAA));
}

#[test]
fn the_mac_is_keyed_blake3_cut_to_sixteen_bytes() {
    // The published test vector of BLAKE3: this key, no input.
    let vector = blake3::keyed_hash(b"whats the Elvish word for friend", b"");
    assert_eq!(
        vector.to_hex().as_str(),
        "92b2b75604ed3c761f9d6f62392c8a9227ad0ea3f09573e783f1498a4ed60d26"
    );
    let (mut encoder, _) = ends(Side::Controller, 1, true);
    let mut out = [0xAA; 100];
    let notice = Notice {
        sequence: 0,
        cause: Cause::Orderly,
    };
    assert_eq!(encoder.goodbye(notice, &mut out), Ok(68));
    assert_eq!(out[48..64], key(0).mac(&out[..48]));
    assert_eq!(out[64..68], crc32fast::hash(&out[..64]).to_le_bytes());
}

#[test]
fn no_byte_of_a_frame_is_left_as_the_buffer_was() {
    for side in [Side::Controller, Side::Specimen] {
        for keyed in [false, true] {
            let (mut first, _) = ends(side, 3, keyed);
            let (mut second, _) = ends(side, 3, keyed);
            let (mut zeros, mut junk) = ([0_u8; 400], [0xFF_u8; 400]);
            let disp = [0.0; 3];
            let command = Command {
                sequence: 0,
                time: 0.0,
                dt: 0.0,
                disp: &disp,
                vel: &disp,
            };
            let write = |encoder: &mut Encoder, out: &mut [u8]| match side {
                Side::Controller => encoder.command(&command, out),
                Side::Specimen => {
                    encoder.measurement(&Measurement::zeros(3), Moment::default(), out)
                }
            };
            let length = write(&mut first, &mut zeros).unwrap();
            assert_eq!(write(&mut second, &mut junk), Ok(length));
            assert_eq!(zeros[..length], junk[..length]);
        }
    }
}

#[test]
fn every_truncation_needs_more_or_names_what_is_missing() {
    for (side, keyed, frame) in every_frame() {
        let (_, mut decoder) = ends(side, 2, keyed);
        for end in 0..frame.len() {
            assert_eq!(split(&frame[..end]), Ok(Progress::NeedMore), "{end}");
            match decoder.open(&frame[..end]) {
                Err(WireError::Truncated { needed, found }) => {
                    assert!(found == end && needed > end && needed <= frame.len());
                }
                other => panic!("{end}: {other:?}"),
            }
        }
        let consumed = frame.len();
        assert_eq!(split(&frame), Ok(Progress::Frame { consumed }));
        let mut two = frame.clone();
        two.extend_from_slice(&frame);
        assert_eq!(split(&two), Ok(Progress::Frame { consumed }));
        assert!(matches!(
            decoder.open(&two),
            Err(WireError::Count {
                field: "length of the frame",
                ..
            })
        ));
        assert!(decoder.open(&frame).is_ok());
    }
}

#[test]
fn flipping_any_one_bit_is_detected() {
    for (side, keyed, frame) in every_frame() {
        for bit in 0..frame.len() * 8 {
            let mut damaged = frame.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let (_, mut decoder) = ends(side, 2, keyed);
            assert!(decoder.open(&damaged).is_err(), "{side} bit {bit}");
            // And nothing has been counted: the good frame still passes.
            assert!(decoder.open(&frame).is_ok());
        }
    }
}

#[test]
fn a_forger_who_mends_the_checksum_is_found_by_the_mac() {
    for (side, keyed, frame) in every_frame().filter(|(_, keyed, _)| *keyed) {
        for bit in 0..(frame.len() - CRC_LEN) * 8 {
            let mut forged = frame.clone();
            forged[bit / 8] ^= 1 << (bit % 8);
            let end = forged.len() - CRC_LEN;
            let crc = crc32fast::hash(&forged[..end]);
            forged[end..].copy_from_slice(&crc.to_le_bytes());
            let (_, mut decoder) = ends(side, 2, keyed);
            assert!(decoder.open(&forged).is_err(), "{side} bit {bit}");
        }
    }
}

#[test]
fn another_key_no_key_or_an_unwanted_key_is_refused() {
    let frame = &all_frames(Side::Controller, 2, true)[0];
    let mut other = Decoder::new(Side::Controller, 2, SESSION, Some(key(1))).unwrap();
    assert_eq!(other.open(frame).err(), Some(WireError::Mac));
    let (_, mut without) = ends(Side::Controller, 2, false);
    assert_eq!(
        without.open(frame).err(),
        Some(WireError::Keyed {
            expected: false,
            found: true
        })
    );
    let plain = &all_frames(Side::Controller, 2, false)[0];
    let (_, mut with) = ends(Side::Controller, 2, true);
    assert_eq!(
        with.open(plain).err(),
        Some(WireError::Keyed {
            expected: true,
            found: false
        })
    );
}

#[test]
fn replays_reflections_and_frames_of_other_sessions_are_refused() {
    for keyed in [false, true] {
        let (mut encoder, mut decoder) = ends(Side::Controller, 1, keyed);
        let mut frames = Vec::new();
        for sequence in 0..100 {
            let mut out = vec![0; 200];
            let command = Command {
                sequence,
                time: 0.0,
                dt: 0.0,
                disp: &[0.0],
                vel: &[0.0],
            };
            let length = encoder.command(&command, &mut out).unwrap();
            out.truncate(length);
            frames.push(out);
        }
        let arrival = |outcome: Result<Received<'_>, WireError>| outcome.map(|got| got.arrival);
        assert_eq!(
            arrival(decoder.open(&frames[0])),
            Ok(Arrival::Newest { skipped: 0 })
        );
        assert_eq!(
            arrival(decoder.open(&frames[0])),
            Err(WireError::Replayed { counter: 1 })
        );
        assert_eq!(
            arrival(decoder.open(&frames[2])),
            Ok(Arrival::Newest { skipped: 1 })
        );
        assert_eq!(
            arrival(decoder.open(&frames[1])),
            Ok(Arrival::Late { behind: 1 })
        );
        assert_eq!(
            arrival(decoder.open(&frames[1])),
            Err(WireError::Replayed { counter: 2 })
        );
        assert!(decoder.open(&frames[99]).is_ok());
        assert_eq!(
            arrival(decoder.open(&frames[35])),
            Err(WireError::TooOld {
                counter: 36,
                newest: 100
            })
        );

        let mut own = Decoder::new(Side::Specimen, 1, SESSION, keyed.then(|| key(0))).unwrap();
        assert_eq!(
            own.open(&frames[5]).err(),
            Some(WireError::Direction {
                field: "command",
                found: Side::Controller
            })
        );
        let mut later = Decoder::new(Side::Controller, 1, 77, keyed.then(|| key(0))).unwrap();
        assert_eq!(
            later.open(&frames[5]).err(),
            Some(WireError::Session {
                expected: 77,
                found: SESSION
            })
        );
    }
}

#[test]
fn each_wrong_field_has_its_own_error() {
    let good = all_frames(Side::Controller, 2, false)[0].clone();
    let with = |at: usize, bytes: &[u8]| {
        let mut frame = good.clone();
        frame[at..at + bytes.len()].copy_from_slice(bytes);
        let end = frame.len() - CRC_LEN;
        let crc = crc32fast::hash(&frame[..end]);
        frame[end..].copy_from_slice(&crc.to_le_bytes());
        let (_, mut decoder) = ends(Side::Controller, 2, false);
        decoder.open(&frame).err()
    };
    assert_eq!(with(0, &[]), None);
    assert!(matches!(with(0, b"HTTP"), Some(WireError::Magic { found, .. }) if &found == b"HTTP"));
    assert_eq!(
        with(4, &[2]),
        Some(WireError::Version {
            lowest: 1,
            highest: 1,
            found: 2
        })
    );
    assert_eq!(
        with(5, &[9]),
        Some(WireError::Code {
            field: "frame kind",
            found: 9
        })
    );
    assert_eq!(
        with(6, &[4]),
        Some(WireError::Reserved {
            field: "frame flags",
            allowed: 3,
            found: 4
        })
    );
    assert!(matches!(
        with(8, &[93]),
        Some(WireError::Bounds {
            field: "length of the frame",
            lowest: 92,
            highest: 92,
            found: 93
        })
    ));
    assert!(matches!(
        with(12, &[0]),
        Some(WireError::Bounds { field: "axes", .. })
    ));
    assert!(matches!(
        with(12, &[65]),
        Some(WireError::Bounds { field: "axes", .. })
    ));
    assert!(matches!(
        with(14, &[1]),
        Some(WireError::Reserved {
            field: "header reserve",
            ..
        })
    ));
    assert!(matches!(
        with(32, &[0xFF; 8]),
        Some(WireError::Code {
            field: "sequence",
            ..
        })
    ));
    let nan = f64::NAN.to_le_bytes();
    for (at, field, index) in [
        (40, "command time", 0),
        (48, "command dt", 0),
        (56, "commanded displacement", 0),
        (64, "commanded displacement", 1),
        (80, "commanded velocity", 1),
    ] {
        assert_eq!(with(at, &nan), Some(WireError::NotFinite { field, index }));
    }
    let (_, mut other) = ends(Side::Controller, 3, false);
    assert_eq!(
        other.open(&good).err(),
        Some(WireError::Count {
            field: "axes of the frame",
            expected: 3,
            found: 2
        })
    );
}

#[test]
fn a_force_that_is_not_a_number_is_refused_by_both_ends() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let (mut encoder, mut decoder) = ends(Side::Specimen, 2, false);
        let mut measured = measurement(2, 1, 5.0);
        let mut out = [0; 300];
        let length = encoder
            .measurement(&measured, Moment::default(), &mut out)
            .unwrap();
        for (at, field) in [
            (88, "measured force"),
            (112 + 16 * 2 - 8 - 8, "earlier force"),
        ] {
            let mut frame = out[..length].to_vec();
            frame[at..at + 8].copy_from_slice(&bad.to_le_bytes());
            let crc = crc32fast::hash(&frame[..length - 4]);
            frame[length - 4..].copy_from_slice(&crc.to_le_bytes());
            assert!(matches!(
                decoder.open(&frame),
                Err(WireError::NotFinite { field: found, .. }) if found == field
            ));
        }
        measured.force[1] = bad;
        let sent = encoder.sent();
        assert_eq!(
            encoder.measurement(&measured, Moment::default(), &mut out),
            Err(WireError::NotFinite {
                field: "measured force",
                index: 1
            })
        );
        assert_eq!(encoder.sent(), sent);
    }
}

#[test]
fn another_protocol_shows_with_its_first_bytes() {
    assert_eq!(split(b""), Ok(Progress::NeedMore));
    assert_eq!(split(b"GU"), Ok(Progress::NeedMore));
    assert!(matches!(
        split(b"GET / HTTP/1.1"),
        Err(WireError::Magic { .. })
    ));
    assert!(matches!(split(b"\x16"), Err(WireError::Magic { .. })));
    assert!(matches!(
        split(b"GUST\x02"),
        Err(WireError::Version { found: 2, .. })
    ));
    let message = split(b"GET / HTTP/1.1").unwrap_err().to_string();
    assert!(message.contains("another protocol"), "{message}");
}

#[test]
fn a_length_from_the_wire_is_bounded_before_it_is_waited_for() {
    for length in [0_u32, 31, 35, LARGEST_FRAME as u32 + 1, u32::MAX] {
        let mut frame = all_frames(Side::Controller, 1, false).pop().unwrap();
        frame[8..12].copy_from_slice(&length.to_le_bytes());
        assert!(matches!(
            split(&frame),
            Err(WireError::Bounds {
                field: "length of the frame",
                ..
            })
        ));
    }
}

#[test]
fn before_a_session_only_control_frames_pass_and_they_may_repeat() {
    let mut encoder = Encoder::greeting(Side::Controller);
    let mut out = [0; 100];
    let length = encoder.control(b"hello", &mut out).unwrap();
    let mut decoder = Decoder::greeting(Side::Controller);
    for _ in 0..3 {
        let got = decoder.open(&out[..length]).unwrap();
        assert!(matches!(got.frame, Frame::Control(b"hello")));
    }
    let command = Command {
        sequence: 0,
        time: 0.0,
        dt: 0.0,
        disp: &[],
        vel: &[],
    };
    assert!(matches!(
        encoder.command(&command, &mut out),
        Err(WireError::Order { .. })
    ));
    for frame in all_frames(Side::Controller, 2, false) {
        assert!(decoder.open(&frame).is_err());
    }
}

#[test]
fn an_end_does_not_write_what_only_the_other_may_write() {
    let (mut specimen, _) = ends(Side::Specimen, 1, false);
    let notice = Notice {
        sequence: 0,
        cause: Cause::Orderly,
    };
    let mut out = [0; 200];
    assert!(matches!(
        specimen.retire(notice, &mut out),
        Err(WireError::Direction {
            field: "retire",
            found: Side::Specimen
        })
    ));
    let (mut controller, _) = ends(Side::Controller, 1, false);
    assert!(
        controller
            .measurement(&Measurement::zeros(1), Moment::default(), &mut out)
            .is_err()
    );
    assert!(matches!(
        controller.goodbye(notice, &mut out[..51]),
        Err(WireError::Room {
            needed: 52,
            found: 51
        })
    ));
    assert_eq!(controller.sent(), 0);
}

#[test]
fn four_lost_replies_in_a_row_cost_nothing() {
    let (mut encoder, mut decoder) = ends(Side::Specimen, 2, false);
    let mut out = [0; 300];
    let mut length = 0;
    for sequence in 10..15 {
        let measured = measurement(2, sequence, 100.0 * sequence as f64);
        length = encoder
            .measurement(&measured, Moment::default(), &mut out)
            .unwrap();
    }
    let got = decoder.open(&out[..length]).unwrap();
    let Frame::Measurement(frame) = got.frame else {
        panic!("not a measurement");
    };
    assert_eq!(got.arrival, Arrival::Newest { skipped: 4 });
    let mut force = [0.0; 2];
    for sequence in 10..15 {
        assert_eq!(frame.force_of(sequence, &mut force), Ok(true));
        assert_eq!(
            force,
            [100.0 * sequence as f64, 100.0 * sequence as f64 + 1.0]
        );
    }
    assert_eq!(frame.force_of(9, &mut force), Ok(false));
    assert_eq!(
        frame
            .earlier()
            .map(|entry| entry.sequence())
            .collect::<Vec<_>>(),
        [13, 12, 11, 10]
    );
}

#[test]
fn a_second_sample_of_the_same_command_replaces_the_first_in_the_history() {
    let (mut encoder, mut decoder) = ends(Side::Specimen, 1, false);
    let mut out = [0; 300];
    let mut length = 0;
    for (sequence, force) in [(1, 10.0), (1, 11.0), (2, 20.0), (2, 22.0), (3, 30.0)] {
        let measured = measurement(1, sequence, force);
        length = encoder
            .measurement(&measured, Moment::default(), &mut out)
            .unwrap();
    }
    let got = decoder.open(&out[..length]).unwrap();
    let Frame::Measurement(frame) = got.frame else {
        panic!("not a measurement");
    };
    let mut force = [0.0];
    let earlier: Vec<_> = frame
        .earlier()
        .map(|entry| {
            entry.read(&mut force).unwrap();
            (entry.sequence(), force[0])
        })
        .collect();
    assert_eq!(earlier, [(2, 22.0), (1, 11.0)]);
}

#[test]
fn the_data_path_allocates_nothing() {
    for keyed in [false, true] {
        let (mut controller, mut at_specimen) = ends(Side::Controller, 3, keyed);
        let (mut specimen, mut at_controller) = ends(Side::Specimen, 3, keyed);
        let mut out = [0; 500];
        let (mut disp, mut vel) = ([0.0; 3], [0.0; 3]);
        let mut measured = Measurement::zeros(3);
        let info = allocation_counter::measure(|| {
            for sequence in 0..200 {
                let command = Command {
                    sequence,
                    time: 0.1,
                    dt: 0.1,
                    disp: &[0.1; 3],
                    vel: &[0.2; 3],
                };
                let length = controller.command(&command, &mut out).unwrap();
                assert!(matches!(split(&out[..length]), Ok(Progress::Frame { .. })));
                let got = at_specimen.open(&out[..length]).unwrap();
                let Frame::Command(frame) = got.frame else {
                    return;
                };
                frame.read(&mut disp, &mut vel).unwrap();
                measured.sequence = frame.sequence();
                let length = specimen
                    .measurement(&measured, Moment::default(), &mut out)
                    .unwrap();
                let got = at_controller.open(&out[..length]).unwrap();
                let Frame::Measurement(frame) = got.frame else {
                    return;
                };
                frame.read(&mut measured).unwrap();
            }
        });
        assert_eq!(info.count_total, 0);
        assert_eq!(measured.sequence, 199);
    }
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>().prop_filter("finite", |value| value.is_finite()),
        Just(0.0),
        Just(-0.0),
        Just(f64::MIN_POSITIVE / 4.0),
        Just(f64::MAX),
    ]
}

proptest! {
    #[test]
    fn commands_come_back_as_they_were(
        axes in 1_usize..=MAX_AXES,
        sequence in 0..u64::MAX,
        time in number(),
        dt in number(),
        numbers in prop::collection::vec(number(), 2 * MAX_AXES),
        keyed: bool,
    ) {
        let (disp, rest) = numbers.split_at(axes);
        let vel = &rest[..axes];
        let (mut encoder, mut decoder) = ends(Side::Controller, axes, keyed);
        let mut out = [0xAA; 4000];
        let length = encoder.command(&Command { sequence, time, dt, disp, vel }, &mut out).unwrap();
        prop_assert_eq!(length, frame_len(Kind::Command, axes, keyed));
        let got = decoder.open(&out[..length]).unwrap();
        let Frame::Command(frame) = got.frame else { panic!("another kind") };
        let (mut d, mut v) = (vec![0.0; axes], vec![0.0; axes]);
        frame.read(&mut d, &mut v).unwrap();
        let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&d), bits(disp));
        prop_assert_eq!(bits(&v), bits(vel));
        prop_assert_eq!(frame.sequence(), sequence);
        prop_assert_eq!(bits(&[frame.time(), frame.dt()]), bits(&[time, dt]));
    }

    #[test]
    fn measurements_come_back_as_they_were(
        axes in 1_usize..=MAX_AXES,
        start in 0..u64::MAX - 10,
        numbers in prop::collection::vec(number(), 2 * MAX_AXES),
        status: u32,
        missed: u32,
        keyed: bool,
    ) {
        let (mut encoder, mut decoder) = ends(Side::Specimen, axes, keyed);
        let mut out = [0xAA; 4000];
        let mut sent = Vec::new();
        for k in 0..7 {
            let measured = Measurement {
                sequence: start + k,
                time: numbers[k as usize],
                status: Status(status),
                disp: numbers[..axes].to_vec(),
                force: numbers[k as usize..][..axes].to_vec(),
            };
            let moment = Moment { sampled_after: numbers[5], missed };
            let length = encoder.measurement(&measured, moment, &mut out).unwrap();
            sent.push(measured);
            let got = decoder.open(&out[..length]).unwrap();
            let Frame::Measurement(frame) = got.frame else { panic!("another kind") };
            let mut back = Measurement::zeros(axes);
            frame.read(&mut back).unwrap();
            prop_assert_eq!(&back, &sent[k as usize]);
            prop_assert_eq!(frame.missed(), missed);
            let mut force = vec![0.0; axes];
            for earlier in sent.iter().rev().take(1 + HISTORY) {
                prop_assert!(frame.force_of(earlier.sequence, &mut force).unwrap());
                prop_assert_eq!(&force, &earlier.force);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(5000))]

    #[test]
    fn arbitrary_bytes_never_panic_and_never_pass(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = split(&bytes);
        for keyed in [false, true] {
            let (_, mut decoder) = ends(Side::Controller, 2, keyed);
            prop_assert!(decoder.open(&bytes).is_err());
        }
    }

    /// A header that is right, so that the checks behind it are reached.
    #[test]
    fn arbitrary_content_in_a_right_envelope_never_panics(
        kind in prop::sample::select(&Kind::ALL[..]),
        axes in 0_u16..70,
        content in prop::collection::vec(any::<u8>(), 0..700),
        length_off in -2_i64..3,
        flags in 0_u16..5,
    ) {
        let keyed = flags & 1 != 0;
        let end = body_end(kind, usize::from(axes), content.len());
        let mut frame = vec![0; end + trailer_len(keyed)];
        for (place, byte) in frame[HEADER_LEN..].iter_mut().zip(content.iter().cycle()) {
            *place = *byte;
        }
        frame[..8].copy_from_slice(&[b'G', b'U', b'S', b'T', 1, kind.code(), flags as u8, 0]);
        let length = (frame.len() as i64 + length_off) as u32;
        frame[8..12].copy_from_slice(&length.to_le_bytes());
        frame[12..14].copy_from_slice(&axes.to_le_bytes());
        frame[16..24].copy_from_slice(&SESSION.to_le_bytes());
        frame[24..32].copy_from_slice(&1_u64.to_le_bytes());
        if keyed {
            let mac = key(0).mac(&frame[..end]);
            frame[end..end + 16].copy_from_slice(&mac);
        }
        let crc_at = frame.len() - CRC_LEN;
        let crc = crc32fast::hash(&frame[..crc_at]);
        frame[crc_at..].copy_from_slice(&crc.to_le_bytes());
        let _ = split(&frame);
        for side in [Side::Controller, Side::Specimen] {
            let (_, mut decoder) = ends(side, usize::from(axes).clamp(1, 64), keyed);
            let info = allocation_counter::measure(|| {
                let _ = decoder.open(&frame);
            });
            prop_assert_eq!(info.count_total, 0);
        }
    }
}
