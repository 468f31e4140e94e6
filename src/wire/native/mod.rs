//! Our own data frames: fixed layout, little-endian, readable by anyone with this table.
//!
//! Every frame is a 32-byte header, a body whose size follows from its kind and the number of axes n, an optional MAC
//! and a CRC. Integers are unsigned, numbers IEEE 754 doubles. There is no padding and there are no variable parts: a
//! frame of one kind has the same length for the whole session. `tools/PROTOCOL.md` repeats this table for
//! programmers of the other end, with a worked example that a test compares with this code.
//!
//! Header, all kinds:
//!
//! | offset | size | type | meaning |
//! |---:|---:|---|---|
//! | 0 | 4 | bytes | magic `47 55 53 54` ("GUST") |
//! | 4 | 1 | u8 | protocol version: 1 |
//! | 5 | 1 | u8 | kind, see [`Kind`] |
//! | 6 | 2 | u16 | flags: bit 0 keyed (a MAC precedes the CRC), bit 1 written by the specimen; others zero |
//! | 8 | 4 | u32 | length of the whole frame in bytes |
//! | 12 | 2 | u16 | axes n for command and measurement, else 0 |
//! | 14 | 2 | u16 | reserved, zero |
//! | 16 | 8 | u64 | session number from the Welcome message; 0 before it |
//! | 24 | 8 | u64 | counter: 1 for the sender's first frame of the session, then growing by one with every frame |
//!
//! Command (kind 1, controller):
//!
//! | offset | size | type | meaning |
//! |---:|---:|---|---|
//! | 32 | 8 | u64 | sequence: number of the command |
//! | 40 | 8 | f64 | test time that the displacement belongs to, s |
//! | 48 | 8 | f64 | test time since the previous command, s; 0 for a hold |
//! | 56 | 8n | f64 | displacement of each axis, in the agreed unit |
//! | 56+8n | 8n | f64 | velocity of each axis, per second; it belongs to time − dt/2 |
//!
//! Measurement (kind 2, specimen):
//!
//! | offset | size | type | meaning |
//! |---:|---:|---|---|
//! | 32 | 8 | u64 | sequence: newest command that was in force when this was sampled |
//! | 40 | 8 | f64 | the specimen's own time of sampling, s; 0 if it has none |
//! | 48 | 8 | f64 | time from the arrival of that command to the sampling, s |
//! | 56 | 4 | u32 | status: bit 0 interlock open, bit 1 holding, bit 2 saturated, bit 3 simulated actuator not settled |
//! | 60 | 4 | u32 | commands missed so far: sequence numbers that never arrived |
//! | 64 | 8n | f64 | measured displacement |
//! | 64+8n | 8n | f64 | measured force |
//! | 64+16n | 4·(8+8n) | | the four previous measurements, newest first: each u64 sequence, then n forces; sequence 2^64−1 and zeros in an empty place |
//!
//! Heartbeat (kind 3, either): 32 u64 newest sequence sent or in force; 40 f64 the sender's time, s; 48 u32
//! status; 52 u32 reserved, zero. Hold (4, controller), retire (5, controller), goodbye (6, either): 32 u64
//! last sequence that counts; 40 u32 cause, see [`Cause`]; 44 u32 reserved, zero. Control (16, either): from
//! 32 on one message of [`crate::handshake`].
//!
//! Trailer, all kinds: if keyed, 16 bytes MAC over everything before it; then u32 CRC-32 (IEEE 802.3, as in
//! zlib and Ethernet) over everything before it.
//!
//! **Nothing is repeated that moves a specimen.** A command with a sequence number that is already in force is
//! answered again and moves nothing. The counter, the session number and the mark of the writer are signed, so a
//! frame cannot be replayed, sent back or carried into another session.
//!
//! Guarantee: [`split`] bounds every length before it is used; [`Decoder::open`] checks everything, so the
//! frames it returns have getters that cannot fail. NaN and infinity are refused in both directions.

mod decode;
mod encode;
mod header;
mod kind;
mod layout;
mod peek;
mod view;

pub use decode::{Decoder, Received, split};
pub use encode::{Encoder, Moment};
pub use kind::Kind;
pub(crate) use layout::{CONTROL_LIMIT, MAX_AXES};
pub use layout::{HISTORY, LARGEST_FRAME, MAGIC, VERSION};
pub use peek::{Peek, commanded, forge_force, forge_length, forge_sequence, peek};
pub use view::{
    Cause, CommandFrame, Earlier, Frame, Heartbeat, MeasurementFrame, Notice, SAYS_LOST,
};

#[cfg(test)]
mod tests;
