//! What two ends agree on, and the secret that they share.

use super::*;
use crate::handshake::layout::layout_text;

#[test]
fn refusal_names_the_disagreement() {
    assert_eq!(agree(&hello(), &terms()), Ok(2));
    type Change = fn(&mut Hello, &mut Terms);
    let table: [(Change, RefuseCode, &str); 14] = [
        (
            |h, _| {
                h.versions = Versions {
                    lowest: 3,
                    highest: 4,
                }
            },
            RefuseCode::Version,
            "versions 1 to 2 wanted, 3 to 4 found",
        ),
        (|h, _| h.keyed = true, RefuseCode::Key, "no pre-shared key"),
        (|_, t| t.keyed = true, RefuseCode::Key, "is wanted"),
        (
            |h, _| h.axes.truncate(1),
            RefuseCode::Axes,
            "2 axes wanted, 1 found",
        ),
        (
            |h, _| h.axes[1].name = "c".into(),
            RefuseCode::Axes,
            "axis 2 is called 'b' here, 'c' there",
        ),
        (
            |h, _| h.axes[0].disp_unit = Unit::Millimetre,
            RefuseCode::Units,
            "axis 1 is in m and kN here, in mm and kN there",
        ),
        (|h, _| h.layout[7] ^= 1, RefuseCode::Layout, "layout hash"),
        (
            |h, _| h.rate_numerator = 10_000,
            RefuseCode::Rate,
            "10000 commands per second, at most 4096",
        ),
        (
            |h, _| h.axes[0].limits.disp_max = 0.3,
            RefuseCode::Limits,
            "largest displacement: the test allows 0.3 m, the specimen's end only 0.2 m",
        ),
        (
            |h, _| h.axes[1].limits.disp_min = -1e3,
            RefuseCode::Limits,
            "smallest displacement",
        ),
        (
            |h, _| h.axes[1].limits.force_max = 1e300,
            RefuseCode::Limits,
            "largest force",
        ),
        (
            |h, _| h.watchdog_s = 5.0,
            RefuseCode::Watchdog,
            "watchdog time 5 s",
        ),
        (
            |h, _| h.watchdog_s = 1e-4,
            RefuseCode::Watchdog,
            "one period",
        ),
        (
            |h, _| h.sampling = Sampling::Fraction(0.9),
            RefuseCode::Sampling,
            "sampled when the command comes",
        ),
    ];
    for (change, code, part) in table {
        let (mut hello, mut terms) = (hello(), terms());
        change(&mut hello, &mut terms);
        let refuse = agree(&hello, &terms).unwrap_err();
        assert_eq!(refuse.code, code);
        assert!(refuse.text.contains(part), "'{}'", refuse.text);
        // Whatever the reason, the refusal can be sent.
        assert!(encode(&Control::Refuse(refuse)).is_ok());
    }
}

#[test]
fn highest_common_version_is_spoken() {
    let mut old_and_new = hello();
    let mut ours = terms();
    for ((a, b), (c, d), expected) in [
        ((1, 3), (1, 1), Some(1)),
        ((1, 3), (2, 5), Some(3)),
        ((2, 9), (1, 4), Some(4)),
        ((1, 1), (2, 3), None),
        ((4, 9), (1, 3), None),
    ] {
        old_and_new.versions = Versions {
            lowest: a,
            highest: b,
        };
        ours.versions = Versions {
            lowest: c,
            highest: d,
        };
        assert_eq!(agree(&old_and_new, &ours).ok(), expected);
    }
}

#[test]
fn controller_refuses_changed_terms() {
    let hello = hello();
    assert_eq!(check_welcome(&hello, &welcome(&hello)), Ok(()));
    let table: [fn(&mut Welcome); 8] = [
        |w| w.version = 3,
        |w| w.keyed = true,
        |w| w.axes.truncate(1),
        |w| w.axes.swap(0, 1),
        |w| w.axes[0].force_unit = Unit::Newton,
        |w| w.layout[0] ^= 1,
        |w| w.sampling = Sampling::Fraction(0.5),
        |w| w.watchdog_s = 0.2,
    ];
    for change in table {
        let mut changed = welcome(&hello);
        change(&mut changed);
        assert!(check_welcome(&hello, &changed).is_err());
    }
}

#[test]
fn narrower_limits_are_found_past_rounding() {
    let mut hello = hello();
    let found = |hello: &Hello, change: fn(&mut Limits)| {
        let mut welcome = welcome(hello);
        change(&mut welcome.axes[1].limits);
        let wider = wider(&welcome.axes, &hello.axes);
        wider.map(|wider| {
            (
                wider.axis,
                wider.what,
                wider.promised,
                wider.own,
                wider.unit,
            )
        })
    };
    let equal: [fn(&mut Limits); 4] = [
        |_| {},
        |own| *own = Limits::NONE,
        |own| own.disp_min *= 1.0 - 1e-12,
        |own| own.force_max *= 1.0 - 1e-12,
    ];
    for change in equal {
        assert_eq!(found(&hello, change), None);
    }
    type Narrower = (fn(&mut Limits), &'static str, f64, &'static str);
    let narrower: [Narrower; 4] = [
        (
            |own| own.disp_min = -0.01,
            "smallest displacement",
            -0.01,
            "m",
        ),
        (|own| own.disp_max = 0.01, "largest displacement", 0.01, "m"),
        (
            |own| own.speed_max = 0.05,
            "largest speed per second",
            0.05,
            "m",
        ),
        (|own| own.force_max = 5.0, "largest force", 5.0, "kN"),
    ];
    let promised = hello.axes[1].limits;
    let promised = [
        promised.disp_min,
        promised.disp_max,
        promised.speed_max,
        promised.force_max,
    ];
    for ((change, what, own, unit), promised) in narrower.into_iter().zip(promised) {
        assert_eq!(found(&hello, change), Some((1, what, promised, own, unit)));
    }
    hello.axes[1].limits = Limits::NONE;
    for (change, ..) in narrower {
        assert_eq!(found(&hello, change), None, "nothing was promised");
    }
}

fn secret(byte: u8) -> PreSharedKey {
    PreSharedKey::new(&[byte; 32]).unwrap()
}

/// Hello and Welcome as bytes, both proven, and the key of the session.
fn keyed_greeting(key: &PreSharedKey) -> (Vec<u8>, Vec<u8>, SessionKey) {
    let mut hello = hello();
    hello.keyed = true;
    let welcome = welcome(&hello);
    let session = key.session(&hello.nonce, &welcome.nonce, welcome.session);
    let mut hello = encode(&Control::Hello(hello)).unwrap();
    prove_hello(&mut hello, key).unwrap();
    let mut welcome = encode(&Control::Welcome(welcome)).unwrap();
    prove_welcome(&hello, &mut welcome, &session).unwrap();
    (hello, welcome, session)
}

#[test]
fn equal_secrets_give_equal_session_keys() {
    let (hello_bytes, welcome_bytes, at_specimen) = keyed_greeting(&secret(1));
    verify_hello(&hello_bytes, &secret(1)).unwrap();
    let Ok(Control::Hello(hello)) = decode(&hello_bytes) else {
        panic!("no hello");
    };
    let Ok(Control::Welcome(welcome)) = decode(&welcome_bytes) else {
        panic!("no welcome");
    };
    let at_controller = secret(1).session(&hello.nonce, &welcome.nonce, welcome.session);
    verify_welcome(&hello_bytes, &welcome_bytes, &at_controller).unwrap();
    check_welcome(&hello, &welcome).unwrap();

    let side = Side::Controller;
    let mut encoder = Encoder::new(side, 2, welcome.session, Some(at_controller)).unwrap();
    let mut decoder = Decoder::new(side, 2, welcome.session, Some(at_specimen)).unwrap();
    let mut out = [0; 200];
    let command = Command {
        sequence: 0,
        time: 0.0,
        dt: 0.0,
        disp: &[1.0, 2.0],
        vel: &[0.0; 2],
    };
    let length = encoder.command(&command, &mut out).unwrap();
    let got = decoder.open(&out[..length]).unwrap();
    assert!(matches!(got.frame, Frame::Command(_)));
}

#[test]
fn other_secret_is_refused_by_both_ends() {
    let (hello, welcome, session) = keyed_greeting(&secret(1));
    assert_eq!(
        verify_hello(&hello, &secret(2)),
        Err(WireError::Proof {
            found: Side::Controller
        })
    );
    let Ok(Control::Hello(h)) = decode(&hello) else {
        panic!("no hello");
    };
    let wrong = secret(2).session(&h.nonce, &[4; 32], 99);
    assert_eq!(
        verify_welcome(&hello, &welcome, &wrong),
        Err(WireError::Proof {
            found: Side::Specimen
        })
    );
    // A controller without a key sends zeros.
    let mut unproven = hello.clone();
    unproven[4..36].fill(0);
    assert!(verify_hello(&unproven, &secret(1)).is_err());
    assert!(verify_hello(&hello[..20], &secret(1)).is_err());
    assert_eq!(verify_welcome(&hello, &welcome, &session), Ok(()));
}

#[test]
fn changed_greeting_breaks_its_proof() {
    let (hello, welcome, session) = keyed_greeting(&secret(1));
    for bit in 32..hello.len() * 8 {
        let mut changed = hello.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        assert!(verify_hello(&changed, &secret(1)).is_err(), "bit {bit}");
        if bit >= 36 * 8 {
            // The Welcome answers this Hello and no other.
            assert!(verify_welcome(&changed, &welcome, &session).is_err());
        }
    }
    for bit in 32..welcome.len() * 8 {
        let mut changed = welcome.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        assert!(
            verify_welcome(&hello, &changed, &session).is_err(),
            "bit {bit}"
        );
    }
}

#[test]
fn replayed_hello_gives_no_session_key() {
    let key = secret(1);
    let (hello, _, first) = keyed_greeting(&key);
    // The server answers the recorded Hello with its own nonce: the old key signs nothing of the new session.
    verify_hello(&hello, &key).unwrap();
    let second = key.session(&[3; 32], &[5; 32], 100);
    let mut encoder = Encoder::new(Side::Controller, 1, 100, Some(first)).unwrap();
    let mut decoder = Decoder::new(Side::Controller, 1, 100, Some(second)).unwrap();
    let arm = encode(&Control::Arm(Arm {
        session: 100,
        first_sequence: 0,
        disp: vec![0.0],
    }));
    let mut out = [0; 200];
    let length = encoder.control(&arm.unwrap(), &mut out).unwrap();
    assert_eq!(decoder.open(&out[..length]).err(), Some(WireError::Mac));
}

#[test]
fn layout_hash_covers_all_but_limits() {
    let base = layout_hash(&[axis("a"), axis("b")]);
    assert_ne!(base, layout_hash(&[axis("b"), axis("a")]));
    assert_ne!(base, layout_hash(&[axis("a")]));
    let mut other = axis("b");
    other.force_unit = Unit::Newton;
    assert_ne!(base, layout_hash(&[axis("a"), other]));
    let mut same = axis("b");
    same.limits = Limits::NONE;
    assert_eq!(base, layout_hash(&[axis("a"), same]));
    assert_eq!(
        layout_text(&[axis("a"), axis("b")]),
        "gusset frames 1 axes 2 history 4\na|m|kN\nb|m|kN\n"
    );
}

fn texts() -> impl Strategy<Value = String> {
    "[ -~äéß☃]{1,20}"
}

proptest! {
    #[test]
    fn any_sane_message_reads_back(
        names in prop::collection::hash_set(texts(), 1..20),
        software in texts(),
        nonce: [u8; 32],
        numbers in prop::collection::vec(1e-6_f64..1e6, 4),
        session in 1_u64..,
    ) {
        let axes: Vec<_> = names.iter().map(|name| Axis {
            name: name.clone(),
            disp_unit: Unit::Millimetre,
            force_unit: Unit::Newton,
            limits: Limits { disp_min: -numbers[0], ..Limits::NONE },
        }).collect();
        let hello = Hello {
            nonce,
            layout: layout_hash(&axes),
            watchdog_s: numbers[1],
            software,
            axes,
            ..hello()
        };
        let mut welcome = welcome(&hello);
        welcome.session = session;
        welcome.stiffness = vec![numbers[2]; hello.axes.len() * hello.axes.len()];
        welcome.standing = vec![numbers[3]; hello.axes.len()];
        for message in [Control::Hello(hello), Control::Welcome(welcome)] {
            prop_assert_eq!(decode(&encode(&message).unwrap()), Ok(message));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(5000))]

    #[test]
    fn arbitrary_bytes_never_overallocate(
        variant in 0_u8..6,
        start in 0_usize..5,
        bytes in prop::collection::vec(any::<u8>(), 0..600),
        at in 0_usize..300,
    ) {
        // Half of it is a good message with a stretch of nonsense in it, so that the depths are reached.
        let mut hostile = vec![variant, 0, 0, 0];
        hostile.extend(&bytes);
        let mut broken = encode(&all()[start]).unwrap();
        let length = broken.len();
        for (place, byte) in broken[at.min(length)..].iter_mut().zip(bytes.iter().take(9)) {
            *place = *byte;
        }
        for message in [hostile, broken] {
            let info = allocation_counter::measure(|| {
                let _ = decode(&message);
            });
            prop_assert!(info.bytes_max <= LIMIT as u64);
        }
    }
}
