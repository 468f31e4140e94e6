//! Messages as bytes, whole and spoilt.

use super::*;

#[test]
fn arm_and_sampling_have_known_bytes() {
    let arm = Control::Arm(Arm {
        session: 0x0807_0605_0403_0201,
        first_sequence: 9,
        disp: vec![-2.0],
    });
    assert_eq!(
        encode(&arm).unwrap(),
        [
            3, 0, 0, 0, // variant
            1, 2, 3, 4, 5, 6, 7, 8, // session
            9, 0, 0, 0, 0, 0, 0, 0, // first sequence
            1, 0, 0, 0, 0, 0, 0, 0, // one entry
            0, 0, 0, 0, 0, 0, 0, 0xC0, // -2.0
        ]
    );
    let mut later = hello();
    later.sampling = Sampling::Fraction(0.5);
    let bytes = encode(&Control::Hello(later)).unwrap();
    assert_eq!(bytes[129..133], [1, 0, 0, 0]);
    assert_eq!(bytes[133..141], [0, 0, 0, 0, 0, 0, 0xE0, 0x3F]);
    assert_eq!(bytes[141..149], [4, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(&bytes[149..153], b"test");
}

#[test]
fn messages_come_back_as_they_were() {
    for message in all() {
        assert_eq!(decode(&encode(&message).unwrap()), Ok(message));
    }
}

#[test]
fn truncation_and_trailing_bytes_are_errors() {
    for message in all() {
        let mut bytes = encode(&message).unwrap();
        for end in 0..bytes.len() {
            assert!(
                matches!(
                    decode(&bytes[..end]),
                    Err(WireError::Control(
                        ControlFault::Short | ControlFault::Limit
                    ))
                ),
                "{} cut to {end}: {:?}",
                message.name(),
                decode(&bytes[..end])
            );
        }
        bytes.push(0);
        assert_eq!(
            decode(&bytes),
            Err(WireError::Control(ControlFault::Trailing(1)))
        );
    }
}

#[test]
fn huge_claimed_length_allocates_nothing() {
    // Arm: variant, session, sequence, then the length of the list.
    for claim in [u64::from(u32::MAX), u64::MAX, LIMIT as u64 / 8 + 1] {
        let mut bytes = vec![3, 0, 0, 0];
        bytes.extend([0; 16]);
        bytes.extend(claim.to_le_bytes());
        let info = allocation_counter::measure(|| {
            assert!(matches!(
                decode(&bytes),
                Err(WireError::Control(
                    ControlFault::Limit | ControlFault::Short
                ))
            ));
        });
        assert!(info.bytes_max <= LIMIT as u64, "{}", info.bytes_max);
    }
    assert_eq!(
        decode(&vec![0; LIMIT + 1]),
        Err(WireError::Control(ControlFault::Limit))
    );
    assert_eq!(
        decode(&[17, 0, 0, 0]),
        Err(WireError::Control(ControlFault::Variant(17)))
    );
}

#[test]
fn largest_welcome_fits_the_limit() {
    let name = |index: usize| format!("{index:0>width$}", width = NAME_LIMIT);
    let axes: Vec<_> = (0..MAX_AXES).map(|index| axis(&name(index))).collect();
    let mut big = welcome(&hello());
    big.layout = layout_hash(&axes);
    big.axes = axes;
    big.stiffness = vec![1.0; MAX_AXES * MAX_AXES];
    big.standing = vec![1.0; MAX_AXES];
    big.software = "s".repeat(TEXT_LIMIT);
    big.name = "n".repeat(TEXT_LIMIT);
    let bytes = encode(&Control::Welcome(big.clone())).unwrap();
    assert!(bytes.len() < LIMIT);
    assert_eq!(decode(&bytes), Ok(Control::Welcome(big)));
}

#[test]
fn nonsense_is_refused_in_both_directions() {
    let fails = |change: &dyn Fn(&mut Hello)| {
        let mut message = hello();
        change(&mut message);
        let sane = encode(&Control::Hello(message.clone())).unwrap_err();
        // What our encoder refuses, another program may send.
        let config = bincode::config::standard().with_fixed_int_encoding();
        let bytes = bincode::encode_to_vec(Control::Hello(message), config).unwrap();
        let received = decode(&bytes).unwrap_err();
        assert_eq!(format!("{received}"), format!("{sane}"));
        sane
    };
    assert!(matches!(
        fails(&|m| m.axes.clear()),
        WireError::Bounds { field: "axes", .. }
    ));
    assert!(matches!(
        fails(&|m| m.axes[1].name = "a".into()),
        WireError::Count {
            field: "axes of the same name",
            ..
        }
    ));
    for bad in ["", "a\nb", "a\u{202e}b", "\u{200b}", &"x".repeat(65)] {
        assert!(matches!(
            fails(&|m| m.axes[0].name = bad.into()),
            WireError::Text {
                field: "name of an axis",
                limit: 64
            }
        ));
    }
    assert!(matches!(
        fails(&|m| m.axes[0].force_unit = Unit::Metre),
        WireError::Code {
            field: "force unit of an axis",
            ..
        }
    ));
    assert!(matches!(
        fails(&|m| m.axes[0].disp_unit = Unit::Radian),
        WireError::Code { .. }
    ));
    type Change = fn(&mut Hello);
    let nan = f64::NAN;
    for (change, words) in [
        (
            (|m| m.axes[0].limits.disp_min = f64::NAN) as Change,
            format!("smallest displacement of an axis[0] is {nan}, outside its range"),
        ),
        (
            |m| m.axes[1].limits.disp_max = -1.0,
            "largest displacement of an axis[1] is -1, outside its range".to_owned(),
        ),
        (
            |m| m.axes[0].limits.speed_max = 0.0,
            "largest speed of an axis[0] is 0, outside its range".to_owned(),
        ),
        (
            |m| m.axes[0].limits.force_max = f64::NAN,
            format!("largest force of an axis[0] is {nan}, outside its range"),
        ),
        (
            |m| m.rate_numerator = u64::MAX,
            "numerator of the rate is 18446744073709551615, 1 to 1000000000000 allowed".to_owned(),
        ),
    ] {
        assert_eq!(fails(&change).to_string(), words);
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            fails(&|m| m.watchdog_s = bad),
            WireError::Range {
                field: "watchdog time",
                ..
            }
        ));
    }
    for bad in [0.0, 1.5, f64::NAN] {
        assert!(matches!(
            fails(&|m| m.sampling = Sampling::Fraction(bad)),
            WireError::Range { .. }
        ));
    }
    assert!(matches!(
        fails(&|m| m.rate_denominator = 0),
        WireError::Bounds {
            field: "denominator of the rate",
            ..
        }
    ));
    assert!(matches!(
        fails(&|m| m.versions.lowest = 9),
        WireError::Bounds {
            field: "highest version",
            ..
        }
    ));

    let mut no_session = welcome(&hello());
    no_session.session = 0;
    assert!(encode(&Control::Welcome(no_session)).is_err());
    let mut not_square = welcome(&hello());
    not_square.stiffness.pop();
    assert!(matches!(
        encode(&Control::Welcome(not_square)),
        Err(WireError::Count {
            field: "entries of the stiffness",
            expected: 4,
            found: 3
        })
    ));
    let mut one_short = welcome(&hello());
    one_short.standing.pop();
    assert!(matches!(
        encode(&Control::Welcome(one_short)),
        Err(WireError::Count {
            field: "axes of where it stands",
            expected: 2,
            found: 1
        })
    ));
    let mut nowhere = welcome(&hello());
    nowhere.standing[1] = f64::NAN;
    assert!(encode(&Control::Welcome(nowhere)).is_err());
}
