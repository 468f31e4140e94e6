//! The page for programmers of the far end agrees with the program: every example on it is encoded here from the values in its
//! caption, and decoded back.

use std::collections::BTreeMap;

use gusset_quantity::substructure::{Command, Measurement, Status};
use gusset_wire::handshake::{
    self, Arm, Axis, Bye, Capabilities, Control, Hello, Limits, Refuse, RefuseCode, Sampling, Unit,
    Versions, Welcome, layout_hash,
};
use gusset_wire::native::{Cause, Decoder, Encoder, Frame, Heartbeat, Moment, Notice};
use gusset_wire::{Side, native};

const SESSION: u64 = 0x1122_3344_5566_7788;

/// The blocks of the page: `# name, n bytes`, then lines of an offset and bytes in hex.
fn examples() -> BTreeMap<String, Vec<u8>> {
    let page = include_str!("../../tools/PROTOCOL.md");
    let mut blocks = BTreeMap::new();
    for block in page.split("```text\n# ").skip(1) {
        let (caption, rest) = block.split_once('\n').unwrap();
        let (name, length) = caption.split_once(", ").unwrap();
        let mut bytes = Vec::new();
        for line in rest.split("```").next().unwrap().lines() {
            let mut words = line.split_whitespace();
            assert_eq!(words.next().unwrap().parse(), Ok(bytes.len()), "{name}");
            bytes.extend(words.map(|word| u8::from_str_radix(word, 16).unwrap()));
        }
        assert_eq!(length, format!("{} bytes", bytes.len()), "{name}");
        blocks.insert(name.to_owned(), bytes);
    }
    blocks
}

fn axis() -> Axis {
    Axis {
        name: "storey 1".into(),
        disp_unit: Unit::Metre,
        force_unit: Unit::Newton,
        limits: Limits {
            disp_min: -0.1,
            disp_max: 0.1,
            speed_max: 0.5,
            force_max: 200_000.0,
        },
    }
}

fn counting(from: u8) -> [u8; 32] {
    std::array::from_fn(|index| from + index as u8)
}

/// An encoder whose next frame has this counter.
fn at_counter(side: Side, counter: u64) -> Encoder {
    let mut encoder = Encoder::new(side, 1, SESSION, None).unwrap();
    let beat = Heartbeat {
        sequence: 0,
        time: 0.0,
        status: Status::default(),
    };
    while encoder.sent() + 1 < counter {
        encoder.heartbeat(beat, &mut [0; 100]).unwrap();
    }
    encoder
}

fn framed(mut encoder: Encoder, message: &Control) -> Vec<u8> {
    let mut out = vec![0xAA; native::LARGEST_FRAME];
    let message = handshake::encode(message).unwrap();
    let length = encoder.control(&message, &mut out).unwrap();
    out.truncate(length);
    out
}

fn messages() -> Vec<(&'static str, Encoder, Control)> {
    let axes = vec![axis()];
    let layout = layout_hash(&axes);
    let greeting = Encoder::greeting;
    vec![
        (
            "hello",
            greeting(Side::Controller),
            Control::Hello(Hello {
                proof: [0; 32],
                nonce: counting(0),
                layout,
                versions: Versions::OURS,
                keyed: false,
                rate_numerator: 1000,
                rate_denominator: 1,
                watchdog_s: 0.05,
                sampling: Sampling::Reply,
                software: "demo 1.0".into(),
                name: "frame test".into(),
                axes: axes.clone(),
            }),
        ),
        (
            "welcome",
            greeting(Side::Specimen),
            Control::Welcome(Welcome {
                proof: [0; 32],
                nonce: counting(32),
                layout,
                session: SESSION,
                version: 1,
                keyed: false,
                capabilities: Capabilities::SIMULATED.and(Capabilities::MEASURES_DISP),
                watchdog_s: 0.05,
                sampling: Sampling::Reply,
                stiffness: vec![1.5e6],
                standing: vec![0.0125],
                software: "rig 2.3".into(),
                name: "column".into(),
                axes,
            }),
        ),
        (
            "refuse",
            greeting(Side::Specimen),
            Control::Refuse(Refuse {
                code: RefuseCode::Busy,
                versions: Versions {
                    lowest: 1,
                    highest: 1,
                },
                text: "busy".into(),
            }),
        ),
        (
            "arm",
            at_counter(Side::Controller, 1),
            Control::Arm(Arm {
                session: SESSION,
                first_sequence: 7,
                disp: vec![0.0],
            }),
        ),
        (
            "bye",
            at_counter(Side::Controller, 10),
            Control::Bye(Bye {
                cause: Cause::Orderly.code(),
                text: String::new(),
            }),
        ),
    ]
}

#[test]
fn control_messages_match_the_page() {
    let page = examples();
    for (name, encoder, message) in messages() {
        assert_eq!(framed(encoder, &message), page[name], "{name}");
    }
}

#[test]
fn bytes_of_the_page_decode_to_messages() {
    let page = examples();
    for (name, _, message) in messages() {
        let from = match name {
            "welcome" | "refuse" => Side::Specimen,
            _ => Side::Controller,
        };
        let mut decoder = match name {
            "arm" | "bye" => Decoder::new(from, 1, SESSION, None).unwrap(),
            _ => Decoder::greeting(from),
        };
        let Frame::Control(bytes) = decoder.open(&page[name]).unwrap().frame else {
            panic!("{name} is no control frame");
        };
        assert_eq!(handshake::decode(bytes), Ok(message), "{name}");
    }
}

#[test]
fn data_frames_have_the_bytes_of_the_page() {
    let page = examples();
    assert_eq!(page.len(), 9, "an example that no test knows");
    let mut out = [0xAA; 500];

    let command = Command {
        sequence: 7,
        time: 0.5,
        dt: 0.01,
        disp: &[0.001],
        vel: &[-0.25],
    };
    let length = at_counter(Side::Controller, 1)
        .command(&command, &mut out)
        .unwrap();
    assert_eq!(out[..length], page["command"]);

    let mut encoder = Encoder::new(Side::Specimen, 1, SESSION, None).unwrap();
    let mut measured = Measurement::zeros(1);
    for (sequence, force) in [(4, 1200.0), (6, 1400.0)] {
        measured.sequence = sequence;
        measured.force[0] = force;
        encoder
            .measurement(&measured, Moment::default(), &mut out)
            .unwrap();
    }
    let measured = Measurement {
        sequence: 7,
        time: 123.5,
        status: Status::HOLDING,
        disp: vec![0.000_99],
        force: vec![1500.0],
    };
    let moment = Moment {
        sampled_after: 0.0002,
        missed: 1,
    };
    let length = encoder.measurement(&measured, moment, &mut out).unwrap();
    assert_eq!(out[..length], page["measurement"]);

    let beat = Heartbeat {
        sequence: 7,
        time: 0.75,
        status: Status::default(),
    };
    let length = at_counter(Side::Controller, 2)
        .heartbeat(beat, &mut out)
        .unwrap();
    assert_eq!(out[..length], page["heartbeat"]);

    let notice = Notice {
        sequence: 7,
        cause: Cause::Tripped,
    };
    let length = at_counter(Side::Controller, 9)
        .retire(notice, &mut out)
        .unwrap();
    assert_eq!(out[..length], page["retire"]);
}
