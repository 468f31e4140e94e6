//! The header that all frames have in common, taken apart and checked.

use super::kind::Kind;
use super::layout::{
    CONTROL_LIMIT, FLAG_KEYED, FLAG_SPECIMEN, HEADER_LEN, HEADER_WORDS, MAGIC, MAX_AXES, VERSION,
    WORD, body_end, trailer_len,
};
use crate::bytes::{bounded, halves};
use crate::{Side, WireError};

/// As much of a header as is here.
pub(super) fn begins_right(bytes: &[u8]) -> Result<(), WireError> {
    let mut start = [0; MAGIC.len()];
    let mut matches = true;
    for ((copy, found), expected) in start.iter_mut().zip(bytes).zip(MAGIC) {
        *copy = *found;
        matches &= *found == expected;
    }
    if !matches {
        return Err(WireError::Magic {
            expected: MAGIC,
            found: start,
        });
    }
    bytes
        .get(MAGIC.len())
        .map_or(Ok(()), |&version| same_version(version))
}

/// Fields of a header, checked.
pub(super) struct Header {
    pub kind: Kind,
    pub keyed: bool,
    pub from: Side,
    pub length: usize,
    pub axes: usize,
    pub session: u64,
    pub counter: u64,
}

impl Header {
    /// Invariant of the result: `length` is what the kind, the axes and the key make it, and bounded.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, WireError> {
        let Some((words, _)) = bytes
            .as_chunks::<WORD>()
            .0
            .split_first_chunk::<HEADER_WORDS>()
        else {
            return Err(WireError::Truncated {
                needed: HEADER_LEN,
                found: bytes.len(),
            });
        };
        let [
            [m0, m1, m2, m3, version, kind, f0, f1],
            sizes,
            session,
            counter,
        ] = *words;
        let found = [m0, m1, m2, m3];
        if found != MAGIC {
            return Err(WireError::Magic {
                expected: MAGIC,
                found,
            });
        }
        same_version(version)?;
        let kind = Kind::from_code(kind)?;
        let flags = u16::from_le_bytes([f0, f1]);
        reserved(
            "frame flags",
            u32::from(FLAG_KEYED | FLAG_SPECIMEN),
            u32::from(flags),
        )?;
        let keyed = flags & FLAG_KEYED != 0;
        let (length, axes) = halves(sizes);
        let (length, reserve) = (length as usize, axes >> 16);
        let axes = (axes & 0xFFFF) as usize;
        if kind.has_axes() {
            bounded("axes", 1, MAX_AXES, axes as i128)?;
        } else {
            bounded("axes of a frame without vectors", 0, 0, axes as i128)?;
        }
        reserved("header reserve", 0, reserve)?;
        let shortest = body_end(kind, axes, 0) + trailer_len(keyed);
        let longest = if kind == Kind::Control {
            shortest + CONTROL_LIMIT
        } else {
            shortest
        };
        bounded("length of the frame", shortest, longest, length as i128)?;
        Ok(Self {
            kind,
            keyed,
            from: if flags & FLAG_SPECIMEN != 0 {
                Side::Specimen
            } else {
                Side::Controller
            },
            length,
            axes,
            session: u64::from_le_bytes(session),
            counter: u64::from_le_bytes(counter),
        })
    }
}

fn same_version(found: u8) -> Result<(), WireError> {
    if found == VERSION {
        Ok(())
    } else {
        Err(WireError::Version {
            lowest: u16::from(VERSION),
            highest: u16::from(VERSION),
            found: u16::from(found),
        })
    }
}

pub(super) fn reserved(field: &'static str, allowed: u32, found: u32) -> Result<(), WireError> {
    if found & !allowed == 0 {
        Ok(())
    } else {
        Err(WireError::Reserved {
            field,
            allowed,
            found,
        })
    }
}
