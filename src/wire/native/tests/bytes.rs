//! Checks every byte against the table.

use super::*;

#[test]
fn frame_lengths_match_the_table() {
    assert_eq!(HEADER_LEN, 32);
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
fn measurement_has_known_bytes() {
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
fn mac_is_keyed_blake3_cut_to_16_bytes() {
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
fn every_byte_of_a_frame_is_written() {
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
fn marks_of_the_loop_never_reach_a_link() {
    let (mut specimen, _) = ends(Side::Specimen, 1, false);
    let (_, mut controller) = ends(Side::Specimen, 1, false);
    let mut out = [0; 1000];
    let status = Status(u32::MAX);
    let measured = Measurement {
        status,
        ..measurement(1, 3, 100.0)
    };
    let length = specimen
        .measurement(&measured, Moment::default(), &mut out)
        .unwrap();
    let Frame::Measurement(heard) = controller.open(&out[..length]).unwrap().frame else {
        panic!("a measurement");
    };
    let beat = Heartbeat {
        sequence: 3,
        time: 1.5,
        status,
    };
    let heard = heard.status;
    let length = specimen.heartbeat(beat, &mut out).unwrap();
    let Frame::Heartbeat(beat) = controller.open(&out[..length]).unwrap().frame else {
        panic!("a heartbeat");
    };
    for status in [heard, beat.status] {
        assert_eq!(status, Status(0xFFFF));
    }
}
