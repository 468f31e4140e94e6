//! Native frames, with and without a key.

use gusset_quantity::substructure::{Command, Measurement, Status};
use gusset_wire::key::{PreSharedKey, SessionKey};
use gusset_wire::native::{
    Cause, Decoder, Encoder, Frame, Heartbeat, LARGEST_FRAME, Moment, Notice, Received, split,
};
use gusset_wire::{Progress, Side, WireError};

use super::{Dice, Target, corpus, mutate};

const SESSION: u64 = 0xa1b2_c3d4_e5f6_0718;

/// Lengths of a header, a signature and a checksum.
const HEADER_LEN: usize = 32;
const MAC_LEN: usize = 16;
const CRC_LEN: usize = 4;

/// The signature of [`key`], as PROTOCOL.md says it.
fn mac(bytes: &[u8]) -> [u8; MAC_LEN] {
    let secret = blake3::derive_key("gusset wire 1 pre-shared key", &[9; 32]);
    let number = SESSION.to_le_bytes();
    let material = [&secret[..], &[1; 32], &[2; 32], &number].concat();
    let session = blake3::derive_key("gusset wire 1 session key", &material);
    let whole = blake3::keyed_hash(&session, bytes);
    std::array::from_fn(|at| whole.as_bytes()[at])
}

fn key() -> SessionKey {
    PreSharedKey::new(&[9; 32])
        .unwrap()
        .session(&[1; 32], &[2; 32], SESSION)
}

/// The sender of a frame, its number of axes, and whether it is signed.
type Terms = (Side, usize, bool);

fn encoder((side, axes, keyed): Terms) -> Encoder {
    Encoder::new(side, axes, SESSION, keyed.then(key)).unwrap()
}

fn decoder((side, axes, keyed): Terms) -> Decoder {
    Decoder::new(side, axes, SESSION, keyed.then(key)).unwrap()
}

type Put<'a> = &'a mut dyn FnMut(&mut Encoder, &mut [u8]) -> Result<usize, WireError>;

/// Frames of every kind that this side may write, as in a session.
fn session(terms: Terms) -> Vec<Vec<u8>> {
    let (side, axes, _) = terms;
    let mut encoder = encoder(terms);
    let mut out = vec![0; LARGEST_FRAME];
    let mut frames = Vec::new();
    let vector: Vec<f64> = (0..axes).map(|axis| 0.25 - axis as f64).collect();
    for sequence in 0..7 {
        let length = match side {
            Side::Controller => {
                let command = Command {
                    sequence,
                    time: 1e-3 * sequence as f64,
                    dt: 1e-3,
                    disp: &vector,
                    vel: &vector,
                };
                encoder.command(&command, &mut out).unwrap()
            }
            Side::Specimen => {
                let measured = Measurement {
                    sequence,
                    time: 1e-3 * sequence as f64,
                    status: Status(sequence as u32),
                    disp: vector.clone(),
                    force: vector.iter().map(|v| v + sequence as f64).collect(),
                };
                let moment = Moment {
                    sampled_after: 1e-4,
                    missed: 1,
                };
                encoder.measurement(&measured, moment, &mut out).unwrap()
            }
        };
        frames.push(out[..length].to_vec());
    }
    let beat = Heartbeat {
        sequence: 7,
        time: 1.5,
        status: Status::HOLDING,
    };
    let notice = Notice {
        sequence: 7,
        cause: Cause::Operator,
    };
    let mut write = |put: Put<'_>| {
        let length = put(&mut encoder, &mut out).unwrap();
        frames.push(out[..length].to_vec());
    };
    write(&mut |encoder, out| encoder.heartbeat(beat, out));
    write(&mut |encoder, out| encoder.goodbye(notice, out));
    write(&mut |encoder, out| encoder.control(b"a message, not decoded here", out));
    if side == Side::Controller {
        write(&mut |encoder, out| encoder.hold(notice, out));
        write(&mut |encoder, out| encoder.retire(notice, out));
    }
    frames
}

pub struct Native {
    seeds: Vec<(Terms, Vec<u8>)>,
    terms: Terms,
    /// The seal was made right after the bytes were spoilt.
    forged: bool,
    accepted: u64,
}

impl Native {
    pub fn new() -> Self {
        let mut seeds = Vec::new();
        for side in [Side::Controller, Side::Specimen] {
            for axes in [1, 3, 64] {
                for keyed in [false, true] {
                    let terms = (side, axes, keyed);
                    seeds.extend(session(terms).into_iter().map(|frame| (terms, frame)));
                }
            }
        }
        Self {
            terms: seeds[0].0,
            seeds,
            forged: false,
            accepted: 0,
        }
    }
}

/// Makes the length, the signature and the checksum of spoilt bytes right, as far as there is room.
fn seal(bytes: &mut [u8], how: usize) {
    let length = bytes.len();
    if length < HEADER_LEN + CRC_LEN {
        return;
    }
    if how > 1 {
        bytes[8..12].copy_from_slice(&(length as u32).to_le_bytes());
    }
    if how > 2 && bytes[6] & 1 == 1 && length >= HEADER_LEN + CRC_LEN + MAC_LEN {
        let at = length - CRC_LEN - MAC_LEN;
        let mac = mac(&bytes[..at]);
        bytes[at..at + MAC_LEN].copy_from_slice(&mac);
    }
    let at = length - CRC_LEN;
    let crc = crc32fast::hash(&bytes[..at]);
    bytes[at..].copy_from_slice(&crc.to_le_bytes());
}

impl Target for Native {
    fn name(&self) -> &'static str {
        "native"
    }

    fn input(&mut self, dice: &mut Dice) -> Vec<u8> {
        let (terms, seed) = dice.pick(&self.seeds).clone();
        let (_, other) = dice.pick(&self.seeds);
        let mut bytes = seed;
        mutate(dice, &mut bytes, other);
        let how = dice.below(5);
        if how > 0 {
            seal(&mut bytes, how);
        }
        (self.terms, self.forged) = (terms, how > 2);
        bytes
    }

    /// Its own header names its sender.
    fn adopt(&mut self, input: &[u8]) {
        let byte = |at: usize| input.get(at).copied().unwrap_or(0);
        let side = match byte(6) & 2 {
            0 => Side::Controller,
            _ => Side::Specimen,
        };
        self.terms = (side, usize::from(byte(12)).clamp(1, 64), byte(6) & 1 == 1);
        self.forged = false;
    }

    fn check(&mut self, dice: &mut Dice, input: &[u8]) {
        let found = alone(|| split(input));
        if let Ok(Progress::Frame { consumed }) = found {
            assert!(consumed <= input.len() && consumed <= LARGEST_FRAME);
        }
        // A stream in pieces decodes alike, and as early as possible.
        let prefix = &input[..dice.below(input.len() + 1)];
        match (split(prefix), found) {
            (Ok(Progress::Frame { consumed }), found) => {
                assert_eq!(found, Ok(Progress::Frame { consumed }));
            }
            (Ok(Progress::NeedMore), _) => {
                let claimed = prefix.get(8..12).map_or(0, |bytes| {
                    u32::from_le_bytes(bytes.try_into().unwrap()) as usize
                });
                // Before its header is whole, no length counts.
                let whole = prefix.len() >= HEADER_LEN;
                assert!(
                    !whole || claimed <= LARGEST_FRAME,
                    "it would wait for {claimed}"
                );
            }
            (Err(_), found) => assert!(found.is_err()),
        }
        let (side, axes, keyed) = self.terms;
        let mut strict = decoder(self.terms);
        let received = alone(|| strict.open(input).map(|received| received.counter));
        // No other reader may panic on it either.
        for terms in [
            (side.other(), axes, keyed),
            (side, axes, !keyed),
            (side, 2, keyed),
        ] {
            let mut other = decoder(terms);
            alone(|| other.open(input).is_ok());
        }
        let mut greeting = Decoder::greeting(side);
        alone(|| greeting.open(input).is_ok());
        let Ok(counter) = received else {
            return;
        };
        self.accepted += 1;
        // Once is enough.
        let again = strict.open(input).map(|_| ());
        assert_eq!(again, Err(WireError::Replayed { counter }));
        if keyed && !self.forged {
            let known = self.seeds.iter().any(|(_, seed)| seed == input);
            assert!(known || corpus("native").iter().any(|(_, seed)| seed == input));
        }
        let mut first = decoder(self.terms);
        let length = same_again(self.terms, &first.open(input).unwrap());
        assert_eq!(
            length,
            input.len(),
            "something stands behind the last field"
        );
    }

    fn accepted(&self) -> u64 {
        self.accepted
    }
}

/// The data path allocates nothing.
fn alone<R>(work: impl FnOnce() -> R) -> R {
    let mut result = None;
    let info = allocation_counter::measure(|| result = Some(work()));
    assert_eq!(info.count_total, 0, "it allocated");
    result.unwrap()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// A frame is unchanged when it is decoded, encoded and decoded again; returns its length.
fn same_again(terms: Terms, received: &Received<'_>) -> usize {
    let axes = terms.1;
    let mut encoder = encoder(terms);
    let mut out = vec![0; LARGEST_FRAME];
    let written = match received.frame {
        Frame::Command(frame) => {
            let (mut disp, mut vel) = (vec![0.0; axes], vec![0.0; axes]);
            frame.read(&mut disp, &mut vel).unwrap();
            let command = Command {
                sequence: frame.sequence,
                time: frame.time,
                dt: frame.dt,
                disp: &disp,
                vel: &vel,
            };
            encoder.command(&command, &mut out)
        }
        Frame::Measurement(frame) => {
            let earlier: Vec<_> = frame.earlier().collect();
            let mut measured = Measurement::zeros(axes);
            for entry in earlier.iter().rev() {
                measured.sequence = entry.sequence;
                entry.read(&mut measured.force).unwrap();
                let _ = encoder.measurement(&measured, Moment::default(), &mut out);
            }
            frame.read(&mut measured).unwrap();
            let moment = Moment {
                sampled_after: frame.sampled_after,
                missed: frame.missed,
            };
            encoder.measurement(&measured, moment, &mut out)
        }
        Frame::Heartbeat(beat) => encoder.heartbeat(beat, &mut out),
        Frame::Hold(notice) => encoder.hold(notice, &mut out),
        Frame::Retire(notice) => encoder.retire(notice, &mut out),
        Frame::Goodbye(notice) => encoder.goodbye(notice, &mut out),
        Frame::Control(message) => encoder.control(message, &mut out),
    };
    let length = written.unwrap();
    let mut decoder = decoder(terms);
    let again = decoder.open(&out[..length]).unwrap();
    match (received.frame, again.frame) {
        (Frame::Command(one), Frame::Command(two)) => {
            let read = |frame: gusset_wire::native::CommandFrame<'_>| {
                let (mut disp, mut vel) = (vec![0.0; axes], vec![0.0; axes]);
                frame.read(&mut disp, &mut vel).unwrap();
                let numbers = [disp, vel, vec![frame.time, frame.dt]].concat();
                (frame.sequence, bits(&numbers))
            };
            assert_eq!(read(one), read(two));
        }
        (Frame::Measurement(one), Frame::Measurement(two)) => {
            let read = |frame: gusset_wire::native::MeasurementFrame<'_>| {
                let mut into = Measurement::zeros(axes);
                frame.read(&mut into).unwrap();
                let times = vec![frame.time, frame.sampled_after];
                let numbers = [into.disp, into.force, times].concat();
                let codes = (frame.sequence, frame.status, frame.missed);
                (codes, bits(&numbers))
            };
            assert_eq!(read(one), read(two));
            let history = |frame: gusset_wire::native::MeasurementFrame<'_>| -> Vec<_> {
                let mut force = vec![0.0; axes];
                let entries = frame.earlier().map(|entry| {
                    entry.read(&mut force).unwrap();
                    (entry.sequence, bits(&force))
                });
                entries.collect()
            };
            // A history that repeats a number, which no encoder writes, is not kept unchanged.
            let mut numbers: Vec<_> = one.earlier().map(|entry| entry.sequence).collect();
            numbers.insert(0, one.sequence);
            if numbers.windows(2).all(|pair| pair[0] != pair[1]) {
                assert_eq!(history(one), history(two));
            }
        }
        (Frame::Heartbeat(one), Frame::Heartbeat(two)) => {
            assert_eq!((one.sequence, one.status), (two.sequence, two.status));
            assert_eq!(one.time.to_bits(), two.time.to_bits());
        }
        (Frame::Hold(one), Frame::Hold(two))
        | (Frame::Retire(one), Frame::Retire(two))
        | (Frame::Goodbye(one), Frame::Goodbye(two)) => assert_eq!(one, two),
        (Frame::Control(one), Frame::Control(two)) => assert_eq!(one, two),
        (one, two) => panic!("{one:?} became {two:?}"),
    }
    length
}
