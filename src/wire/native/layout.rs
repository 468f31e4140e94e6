//! The constants of the tables in the parent module, and the length of each frame.
//!
//! Everything before the trailer of a frame with vectors is whole words of eight bytes, and no field crosses a word: the
//! codecs take frames apart word by word.

use super::kind::Kind;
use crate::key::MAC_LEN;

/// The first four bytes of every frame.
pub const MAGIC: [u8; 4] = *b"GUST";
/// The version of the layout.
pub const VERSION: u8 = 1;
/// Most axes of one link.
pub(crate) const MAX_AXES: usize = 64;
/// How many earlier measurements travel with each measurement.
pub const HISTORY: usize = 4;
/// Stands where there is no earlier measurement.
pub(crate) const NO_SEQUENCE: u64 = u64::MAX;
/// Largest control message, so that its frame fits into one UDP datagram.
pub(crate) const CONTROL_LIMIT: usize = 64_000;
/// Length of the header.
pub(crate) const HEADER_LEN: usize = WORD * HEADER_WORDS;
/// Length of the checksum.
pub(crate) const CRC_LEN: usize = 4;
/// No frame is longer than this.
pub const LARGEST_FRAME: usize = HEADER_LEN + CONTROL_LIMIT + MAC_LEN + CRC_LEN;

/// Bytes of a word.
pub(super) const WORD: usize = 8;
/// Words of the header: mark, version, kind and flags; length and axes; session; counter.
pub(super) const HEADER_WORDS: usize = 4;
/// Words of a command before its vectors.
pub(super) const COMMAND_WORDS: usize = 3;
/// Words of a measurement before its vectors.
pub(super) const MEASURED_WORDS: usize = 4;

/// Flag: a MAC precedes the CRC.
pub(super) const FLAG_KEYED: u16 = 1;
/// Flag: written by the specimen.
pub(super) const FLAG_SPECIMEN: u16 = 2;

/// Words of one earlier measurement: sequence and forces.
pub(super) const fn earlier_words(axes: usize) -> usize {
    1 + axes
}

/// End of the body; `payload` is the length of a control message, else unused.
pub(super) const fn body_end(kind: Kind, axes: usize, payload: usize) -> usize {
    match kind {
        // Sequence, time, dt; displacements, velocities.
        Kind::Command => HEADER_LEN + WORD * (COMMAND_WORDS + 2 * axes),
        // Sequence, time, moment of sampling, status and missed; displacements, forces; the earlier ones.
        Kind::Measurement => {
            HEADER_LEN + WORD * (MEASURED_WORDS + 2 * axes + HISTORY * earlier_words(axes))
        }
        Kind::Heartbeat => HEADER_LEN + WORD * 3,
        Kind::Hold | Kind::Retire | Kind::Goodbye => HEADER_LEN + WORD * 2,
        Kind::Control => HEADER_LEN + payload,
    }
}

/// Bytes behind the body.
pub(super) const fn trailer_len(keyed: bool) -> usize {
    if keyed { MAC_LEN + CRC_LEN } else { CRC_LEN }
}

/// Length of a whole data frame; for a control frame, of one without a message.
#[must_use]
pub(crate) const fn frame_len(kind: Kind, axes: usize, keyed: bool) -> usize {
    body_end(kind, axes, 0) + trailer_len(keyed)
}
