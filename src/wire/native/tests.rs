mod bytes;
mod history;
mod refusals;

use proptest::prelude::*;

use super::layout::*;
use super::*;
use crate::key::{PreSharedKey, SessionKey};
use crate::window::Arrival;
use crate::{Progress, Side, WireError};
use gusset_quantity::substructure::{Command, Measurement, Status};

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
