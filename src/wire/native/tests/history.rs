//! Lost replies, allocation, and frames at random.

use super::*;

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
            .map(|entry| entry.sequence)
            .collect::<Vec<_>>(),
        [13, 12, 11, 10]
    );
}

#[test]
fn second_sample_replaces_the_first() {
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
            (entry.sequence, force[0])
        })
        .collect();
    assert_eq!(earlier, [(2, 22.0), (1, 11.0)]);
}

#[test]
fn data_path_allocates_nothing() {
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
                measured.sequence = frame.sequence;
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
        prop_assert_eq!(frame.sequence, sequence);
        prop_assert_eq!(bits(&[frame.time, frame.dt]), bits(&[time, dt]));
    }

    #[test]
    fn measurements_come_back_as_they_were(
        axes in 1_usize..=MAX_AXES,
        start in 0..u64::MAX - 10,
        numbers in prop::collection::vec(number(), 2 * MAX_AXES),
        status: u16,
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
                status: Status(status.into()),
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
            prop_assert_eq!(frame.missed, missed);
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
    fn arbitrary_bytes_never_panic_or_pass(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = split(&bytes);
        for keyed in [false, true] {
            let (_, mut decoder) = ends(Side::Controller, 2, keyed);
            prop_assert!(decoder.open(&bytes).is_err());
        }
    }

    /// A header that is right, so that the checks behind it are reached.
    #[test]
    fn arbitrary_content_never_panics(
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
