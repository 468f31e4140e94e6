//! The offsets of the tables in the parent module, in one block, and the length of each frame.

use super::view::Kind;
use crate::wire::key::MAC_LEN;

/// The first four bytes of every frame.
pub const MAGIC: [u8; 4] = *b"GUST";
/// The version of the layout.
pub const VERSION: u8 = 1;
/// Most axes of one link.
pub const MAX_AXES: usize = 64;
/// How many earlier measurements travel with each measurement.
pub const HISTORY: usize = 4;
/// Stands where there is no earlier measurement.
pub const NO_SEQUENCE: u64 = u64::MAX;
/// Largest control message, so that its frame fits into one UDP datagram.
pub const CONTROL_LIMIT: usize = 64_000;
/// Length of the header.
pub const HEADER_LEN: usize = AT_COUNTER + 8;
/// Length of the checksum.
pub const CRC_LEN: usize = 4;
/// No frame is longer than this.
pub const LARGEST_FRAME: usize = HEADER_LEN + CONTROL_LIMIT + MAC_LEN + CRC_LEN;

pub(super) const AT_MAGIC: usize = 0;
pub(super) const AT_VERSION: usize = 4;
pub(super) const AT_KIND: usize = 5;
pub(super) const AT_FLAGS: usize = 6;
pub(super) const AT_LENGTH: usize = 8;
pub(super) const AT_AXES: usize = 12;
pub(super) const AT_HEADER_RESERVED: usize = 14;
pub(super) const AT_SESSION: usize = 16;
pub(super) const AT_COUNTER: usize = 24;

/// Command, measurement, heartbeat and notices begin alike.
pub(super) const AT_SEQUENCE: usize = HEADER_LEN;

pub(super) const AT_COMMAND_TIME: usize = AT_SEQUENCE + 8;
pub(super) const AT_COMMAND_DT: usize = AT_COMMAND_TIME + 8;
pub(super) const AT_COMMAND_DISP: usize = AT_COMMAND_DT + 8;

pub(super) const AT_SPECIMEN_TIME: usize = AT_SEQUENCE + 8;
pub(super) const AT_SAMPLED_AFTER: usize = AT_SPECIMEN_TIME + 8;
pub(super) const AT_STATUS: usize = AT_SAMPLED_AFTER + 8;
pub(super) const AT_MISSED: usize = AT_STATUS + 4;
pub(super) const AT_MEASURED_DISP: usize = AT_MISSED + 4;

pub(super) const AT_BEAT_TIME: usize = AT_SEQUENCE + 8;
pub(super) const AT_BEAT_STATUS: usize = AT_BEAT_TIME + 8;
pub(super) const AT_BEAT_RESERVED: usize = AT_BEAT_STATUS + 4;
const BEAT_END: usize = AT_BEAT_RESERVED + 4;

pub(super) const AT_CAUSE: usize = AT_SEQUENCE + 8;
pub(super) const AT_NOTICE_RESERVED: usize = AT_CAUSE + 4;
const NOTICE_END: usize = AT_NOTICE_RESERVED + 4;

/// Flag: a MAC stands before the CRC.
pub(super) const FLAG_KEYED: u16 = 1;
/// Flag: written by the specimen.
pub(super) const FLAG_SPECIMEN: u16 = 2;

/// Offset of the commanded velocities.
pub(super) const fn at_command_vel(axes: usize) -> usize {
    AT_COMMAND_DISP + 8 * axes
}

/// Offset of the measured forces.
pub(super) const fn at_force(axes: usize) -> usize {
    AT_MEASURED_DISP + 8 * axes
}

/// Offset of earlier measurement `entry`, 0 being the newest.
pub(super) const fn at_earlier(axes: usize, entry: usize) -> usize {
    at_force(axes) + 8 * axes + entry * (8 + 8 * axes)
}

/// End of the body; `payload` is the length of a control message, else unused.
pub(super) const fn body_end(kind: Kind, axes: usize, payload: usize) -> usize {
    match kind {
        Kind::Command => at_command_vel(axes) + 8 * axes,
        Kind::Measurement => at_earlier(axes, HISTORY),
        Kind::Heartbeat => BEAT_END,
        Kind::Hold | Kind::Retire | Kind::Goodbye => NOTICE_END,
        Kind::Control => HEADER_LEN + payload,
    }
}

/// Bytes behind the body.
pub(super) const fn trailer_len(keyed: bool) -> usize {
    if keyed { MAC_LEN + CRC_LEN } else { CRC_LEN }
}

/// Length of a whole data frame; for a control frame, of one without a message.
#[must_use]
pub const fn frame_len(kind: Kind, axes: usize, keyed: bool) -> usize {
    body_end(kind, axes, 0) + trailer_len(keyed)
}
