//! Reads a frame in transit and builds false ones: for test tools between the two ends that imitate a bad network or a
//! broken peer.
//!
//! Nothing is checked here but the length; a frame of a keyed session that was changed fails its MAC. The two ends use
//! [`super::Decoder`] and [`super::Encoder`].

use super::kind::Kind;
use super::layout::{COMMAND_WORDS, CRC_LEN, HEADER_LEN, MEASURED_WORDS, WORD, frame_len};
use crate::bytes::{Word, halves, put};

/// Header fields of a frame in transit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Peek {
    /// Its kind.
    pub kind: Kind,
    /// Its session.
    pub session: u64,
    /// Number of the command that it belongs to; 0 for a control message.
    pub sequence: u64,
}

/// What `frame` says of itself, if it is one whole frame. Real-time: yes.
#[must_use]
pub fn peek(frame: &[u8]) -> Option<Peek> {
    let [first, sizes, session, _, rest @ ..] = frame.as_chunks::<WORD>().0 else {
        return None;
    };
    let [_, _, _, _, _, kind, ..] = *first;
    let kind = Kind::from_code(kind).ok()?;
    let (length, _) = halves(*sizes);
    if usize::try_from(length) != Ok(frame.len()) {
        return None;
    }
    let sequence = match kind {
        Kind::Control => 0,
        _ => u64::from_le_bytes(*rest.first()?),
    };
    Some(Peek {
        kind,
        session: u64::from_le_bytes(*session),
        sequence,
    })
}

/// The vectors of a frame of one kind, and its axes; none if it is of another or not whole.
fn vectors(frame: &[u8], kind: Kind, head: usize) -> Option<(usize, &[Word])> {
    peek(frame).filter(|peek| peek.kind == kind)?;
    let words = frame.as_chunks().0;
    let (_, axes) = halves(*words.get(1)?);
    let axes = usize::from(axes as u16);
    let whole = frame.len() >= frame_len(kind, axes, false);
    let at = HEADER_LEN / WORD + head;
    whole.then_some((axes, words.get(at..at + 2 * axes)?))
}

/// Displacement and velocity of every axis of a command; empty for another frame.
pub fn commanded(frame: &[u8]) -> impl Iterator<Item = (f64, f64)> + '_ {
    let (axes, values) = vectors(frame, Kind::Command, COMMAND_WORDS).unwrap_or_default();
    let value = |word: &Word| f64::from_le_bytes(*word);
    let (disp, vel) = values.split_at(axes);
    disp.iter().map(value).zip(vel.iter().map(value))
}

/// Writes another number into a frame, and a checksum that fits.
pub fn forge_sequence(frame: &mut [u8], sequence: u64) {
    let _ = put(frame, HEADER_LEN, sequence.to_le_bytes());
    seal(frame);
}

/// Writes another force into a measurement, and a checksum that fits. Nothing if there is no such axis (from 0).
pub fn forge_force(frame: &mut [u8], axis: usize, force: f64) {
    let found = vectors(frame, Kind::Measurement, MEASURED_WORDS);
    if let Some((axes, _)) = found.filter(|(axes, _)| axis < *axes) {
        let at = HEADER_LEN + WORD * (MEASURED_WORDS + axes + axis);
        let _ = put(frame, at, force.to_le_bytes());
        seal(frame);
    }
}

/// Writes another length into the header; the checksum does not know.
pub fn forge_length(frame: &mut [u8], length: u32) {
    let _ = put(frame, WORD, length.to_le_bytes());
}

fn seal(frame: &mut [u8]) {
    let at = frame.len().saturating_sub(CRC_LEN);
    let crc = crc32fast::hash(frame.get(..at).unwrap_or_default());
    let _ = put(frame, at, crc.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::{Decoder, Encoder, Frame, Moment};
    use crate::{Side, WireError};
    use gusset_quantity::substructure::{Command, Measurement};

    fn measurement() -> Vec<u8> {
        let measured = Measurement {
            sequence: 7,
            force: vec![1.0, 2.0],
            ..Measurement::zeros(2)
        };
        let mut out = vec![0; 1000];
        let mut encoder = Encoder::new(Side::Specimen, 2, 9, None).unwrap();
        let length = encoder.measurement(&measured, Moment::default(), &mut out);
        out.truncate(length.unwrap());
        out
    }

    #[test]
    fn forged_frame_passes_its_checks() {
        let mut frame = measurement();
        forge_sequence(&mut frame, 8);
        forge_force(&mut frame, 1, -5.0);
        let seen = peek(&frame).unwrap();
        assert_eq!((seen.kind, seen.session), (Kind::Measurement, 9));
        let mut decoder = Decoder::new(Side::Specimen, 2, 9, None).unwrap();
        let Frame::Measurement(found) = decoder.open(&frame).unwrap().frame else {
            panic!("a measurement");
        };
        let mut into = Measurement::zeros(2);
        found.read(&mut into).unwrap();
        assert_eq!((into.sequence, into.force), (8, vec![1.0, -5.0]));
    }

    #[test]
    fn forged_nan_force_fails_only_for_that() {
        let mut frame = measurement();
        forge_force(&mut frame, 0, f64::NAN);
        let mut decoder = Decoder::new(Side::Specimen, 2, 9, None).unwrap();
        let refused = decoder.open(&frame).map(|_| ()).unwrap_err();
        assert!(
            matches!(refused, WireError::NotFinite { .. }),
            "{refused:?}"
        );
        forge_force(&mut frame, 2, 0.0);
        assert!(decoder.open(&frame).is_err(), "there is no third axis");
    }

    #[test]
    fn only_commands_are_read_in_transit() {
        let mut out = vec![0; 1000];
        let mut encoder = Encoder::new(Side::Controller, 2, 9, None).unwrap();
        let command = Command {
            sequence: 3,
            time: 0.0,
            dt: 0.0,
            disp: &[1.0, 2.0],
            vel: &[3.0, 4.0],
        };
        let length = encoder.command(&command, &mut out).unwrap();
        out.truncate(length);
        let found: Vec<_> = commanded(&out).collect();
        assert_eq!(found, [(1.0, 3.0), (2.0, 4.0)]);
        assert_eq!(commanded(&measurement()).count(), 0);
        for cut in 0..length {
            assert_eq!(commanded(&out[..cut]).count(), 0);
            assert_eq!(peek(&out[..cut]), None);
        }
    }
}
