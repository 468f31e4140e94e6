//! Refused frames and the error of each.

use super::*;

#[test]
fn truncated_frame_names_the_missing_part() {
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
fn mac_finds_a_forged_checksum() {
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
fn wrong_or_unwanted_key_is_refused() {
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
fn replays_and_foreign_frames_are_refused() {
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
            found: u64::MAX
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
fn nan_force_is_refused_by_both_ends() {
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
fn other_protocol_shows_in_its_first_bytes() {
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
fn length_is_bounded_before_waiting() {
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
fn only_control_frames_precede_a_session() {
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
fn each_end_writes_only_its_own_kinds() {
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
