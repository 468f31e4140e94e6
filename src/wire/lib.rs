//! Codecs: bytes in, values out. No socket, no clock, no thread.
//!
//! | module | speaks |
//! |---|---|
//! | [`native`] | our own data frames: fixed little-endian layout, byte by byte |
//! | [`handshake`] | our own control messages, which agree on everything before anything moves |
//! | [`openfresco`] | the four dialects of OpenFresco and OpenSees, both roles |
//! | [`key`] | pre-shared key, session key, keyed MAC |
//! | [`process_data`] | entries of the process data of an EtherCAT device |
//! | [`window`] | duplicates, replays and late datagrams |
//!
//! This member knows values and bytes, and the hinge. Begin reading with [`native`].
//!
//! Invariants: every size, count and length that comes from a peer is checked before it is used, and bounded by a
//! constant of this module; a frame either decodes as a whole or names the field that is wrong; nothing on the data
//! path allocates; arbitrary bytes never panic. The link decides when to give up waiting, what to do with a stale
//! value, and whom to listen to.

pub(crate) mod bytes;
pub mod handshake;
pub mod key;
pub mod native;
pub mod openfresco;
pub mod process_data;
pub mod window;

use thiserror::Error;

use gusset_quantity::substructure::LinkFault;

/// State of the bytes received so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum Progress {
    /// No whole frame yet: keep the bytes and read on.
    NeedMore,
    /// One whole frame is at the beginning.
    Frame {
        /// Its length; the next frame begins behind it.
        consumed: usize,
    },
}

/// Author of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The end that commands: the hybrid test.
    Controller,
    /// The end that measures.
    Specimen,
}

impl Side {
    /// The other end.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Side::Controller => Side::Specimen,
            Side::Specimen => Side::Controller,
        }
    }
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Side::Controller => "controller",
            Side::Specimen => "specimen",
        })
    }
}

/// Why bytes are not a message, or a value cannot become one.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum WireError {
    /// A frame ends before its last field.
    #[error("the frame is cut short: {needed} bytes wanted, {found} found")]
    Truncated {
        /// Bytes that the frame needs.
        needed: usize,
        /// Bytes that are there.
        found: usize,
    },
    /// The buffer to encode into is too small. Ours, never the peer's fault.
    #[error("the output buffer holds {found} bytes, {needed} wanted")]
    Room {
        /// Bytes that the frame needs.
        needed: usize,
        /// Bytes that the buffer holds.
        found: usize,
    },
    /// The first bytes are not ours: another protocol is spoken.
    #[error(
        "the first bytes are {found:02x?}, {expected:02x?} wanted: the peer speaks another protocol"
    )]
    Magic {
        /// The bytes that start every frame.
        expected: [u8; 4],
        /// The bytes received, filled up with zeros.
        found: [u8; 4],
    },
    /// The first bytes are known from elsewhere.
    #[error("the first bytes are those of {found}: the peer speaks another protocol")]
    Foreign {
        /// The protocol that begins with these bytes.
        found: &'static str,
    },
    /// No protocol version in common.
    #[error("protocol version {found} found, {lowest} to {highest} spoken here")]
    Version {
        /// Lowest version spoken here.
        lowest: u16,
        /// Highest version spoken here.
        highest: u16,
        /// The version of the peer (its highest, in a negotiation).
        found: u16,
    },
    /// A code that the table does not have.
    #[error("{field} is {found}, which the protocol does not have")]
    Code {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u64,
    },
    /// A reserved field is not zero.
    #[error("{field} is {found:#x}, bits outside {allowed:#x} must be zero")]
    Reserved {
        /// The field.
        field: &'static str,
        /// Bits that may be set.
        allowed: u32,
        /// The value found.
        found: u32,
    },
    /// A client of OpenFresco's protocols reads another number of forces than it commands displacements.
    #[error(
        "the client reads {found} forces for {disp} displacements, but this server has one force for each displacement (the \
         element `invertedVBrace` reads six load cells: use `generic` or `twoNodeLink` instead; `rows` serve a client with more \
         displacements than coordinates)"
    )]
    UnequalForces {
        /// Displacements that it commands.
        disp: usize,
        /// Forces that it reads.
        found: usize,
    },
    /// A number of things differs from what was agreed.
    #[error("{field}: {expected} wanted, {found} found")]
    Count {
        /// Name of the counted quantity.
        field: &'static str,
        /// As agreed.
        expected: usize,
        /// As found.
        found: usize,
    },
    /// A number from the wire is outside its bounds.
    #[error("{field} is {found}, {lowest} to {highest} allowed")]
    Bounds {
        /// The number.
        field: &'static str,
        /// Smallest value allowed.
        lowest: i64,
        /// Largest value allowed.
        highest: i64,
        /// The value found: any number that a field can hold.
        found: i128,
    },
    /// The checksum does not match: the frame was damaged.
    #[error("the checksum of the frame is {found:08x}, its bytes give {expected:08x}")]
    Checksum {
        /// Computed from the bytes.
        expected: u32,
        /// As received.
        found: u32,
    },
    /// The MAC does not match: wrong key, or a forged frame.
    #[error("the frame is not signed with the key of this session")]
    Mac,
    /// One end uses a key and the other does not.
    #[error("the frame is {}, the link is {}", keyed(*.found), keyed(*.expected))]
    Keyed {
        /// True if this end uses a key.
        expected: bool,
        /// True if the frame does.
        found: bool,
    },
    /// A frame of another session.
    #[error("the frame belongs to session {found:016x}, this one is {expected:016x}")]
    Session {
        /// This session.
        expected: u64,
        /// The frame's.
        found: u64,
    },
    /// A frame of a kind, or with a mark, that this end does not receive.
    #[error("a {field} frame comes from the {found}")]
    Direction {
        /// The kind of the frame.
        field: &'static str,
        /// The end that is marked as its writer.
        found: Side,
    },
    /// A frame that was here before: a duplicate of the network, or a replay.
    #[error("frame {counter} has been received before")]
    Replayed {
        /// The frame's counter.
        counter: u64,
    },
    /// A frame too far behind the newest one to decide whether it is a replay.
    #[error("frame {counter} is too old: {newest} has been received")]
    TooOld {
        /// The frame's counter.
        counter: u64,
        /// The newest counter so far.
        newest: u64,
    },
    /// Infinite or not a number.
    #[error("{field}[{index}] is not a finite number")]
    NotFinite {
        /// The vector or number.
        field: &'static str,
        /// Its entry, from 0.
        index: usize,
    },
    /// A number that is outside its range, or not a number.
    #[error("{field}[{index}] is {found}, outside its range")]
    Range {
        /// The vector or number.
        field: &'static str,
        /// Its entry, from 0.
        index: usize,
        /// The value found.
        found: f64,
    },
    /// A text is too long, empty, or not text.
    #[error(
        "{field} is not a text of 1 to {limit} bytes without control or other hidden characters"
    )]
    Text {
        /// The text.
        field: &'static str,
        /// Longest length in bytes.
        limit: usize,
    },
    /// A control message that does not decode.
    #[error("the control message does not decode: {0}")]
    Control(ControlFault),
    /// The peer could not prove that it has the key.
    #[error("the {found} could not prove that it has the pre-shared key")]
    Proof {
        /// The end that failed.
        found: Side,
    },
    /// A message that may not come now.
    #[error("{found} came where {expected} was due")]
    Order {
        /// What should have come.
        expected: &'static str,
        /// What came.
        found: &'static str,
    },
    /// An action that is not even a plausible number.
    #[error("the action is {found}; there are 1 to 15, 98 and 99, all whole, and 4.1, 4.2 and 4.3")]
    Action {
        /// The value found.
        found: f64,
    },
    /// Forces are commanded, as in force control.
    #[error(
        "the client commands forces ({found}), but this server commands displacements only: announce no commanded forces \
         (OpenFresco: no force in `-ctrlModes` or in the control points of the trial response, and no force control of a bearing)"
    )]
    CommandedForces {
        /// How many.
        found: usize,
    },
    /// Several axes have several quantities, whose order OpenFresco's `SimSimulink` does not announce.
    #[error(
        "{quantities} quantities of {axes} axes are sent, the time included, and SimSimulink does not announce their order: set \
         `signal_order` in [serve.openfresco], or --signal-order, to by_axis (d1 v1 d2 v2, without a time) or by_quantity \
         (d1 d2 v1 v2, then the time), as the control points of the OpenFresco model have them"
    )]
    SignalOrder {
        /// Axes of the vector.
        axes: usize,
        /// Quantities of the vector, the time included.
        quantities: usize,
    },
    /// The control points of `SimSimulink` have their signals by axis, and one of them holds the time. Nothing says which one.
    #[error(
        "the time is sent beside the signals of {axes} axes, and with `signal_order` = by_axis its place is unknown: leave the time \
         out of the control points of the OpenFresco model, commanded and measured, or set by_quantity in [serve.openfresco] or \
         --signal-order if the model sends d1 d2 v1 v2 and then the time"
    )]
    TimePlace {
        /// Axes of the vector.
        axes: usize,
    },
    /// `SimSimulink` of OpenFresco up to 2.7 sends other signals than it announces, or another order than was set.
    #[error(
        "the client is OpenFresco 2.7 or older (it sends action 4): its SimSimulink leaves out the velocities and accelerations \
         that it announces, and sends all displacements first; announce neither, and set `signal_order` to by_quantity, or use \
         OpenFresco 2.8"
    )]
    OldSimulink,
    /// The version numbers of an OpenFresco shadow and its actor differ.
    #[error("the peer is OpenFresco version {found}, {expected} wanted")]
    SiteVersion {
        /// The version set for this end.
        expected: f64,
        /// The peer's.
        found: f64,
    },
    /// The codec failed before; a failed machine stays failed.
    #[error("the connection failed before")]
    Failed,
}

/// Fault in the encoding of a control message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ControlFault {
    /// It ends too early.
    #[error("it ends too early")]
    Short,
    /// Bytes follow it.
    #[error("{0} bytes stand behind its end")]
    Trailing(usize),
    /// It claims more than a control message may hold.
    #[error("it claims to be larger than the limit")]
    Limit,
    /// An unknown variant of an enum.
    #[error("variant {0} is unknown")]
    Variant(u32),
    /// A text that is not UTF-8, a truth value that is neither 0 nor 1, or the like.
    #[error("a value is outside its type")]
    Value,
}

impl WireError {
    /// The fault that the loop sees; the text stays with the link's log.
    #[must_use]
    pub fn fault(self) -> LinkFault {
        match self {
            WireError::Version { .. } | WireError::SiteVersion { .. } => LinkFault::Version,
            WireError::Mac | WireError::Keyed { .. } | WireError::Proof { .. } => LinkFault::Auth,
            WireError::NotFinite { .. } => LinkFault::NotFinite,
            _ => LinkFault::Malformed,
        }
    }
}

/// Names the known protocol that begins with these bytes, where the expected protocol has no magic number.
///
/// # Errors
/// [`WireError::Foreign`].
pub fn not_foreign(first: &[u8]) -> Result<(), WireError> {
    const KNOWN: [(&[u8], &str); 8] = [
        (&native::MAGIC, "the gusset protocol"),
        (b"HTTP", "a web server"),
        (b"GET ", "a browser"),
        (b"POST", "a browser"),
        (b"HEAD", "a browser"),
        (b"SSH-", "an SSH server or client"),
        // A handshake record of TLS 1.0 to 1.3.
        (&[0x16, 3, 1], "TLS"),
        (&[0x16, 3, 3], "TLS"),
    ];
    match KNOWN.iter().find(|(start, _)| first.starts_with(start)) {
        Some(&(_, found)) => Err(WireError::Foreign { found }),
        None => Ok(()),
    }
}

fn keyed(yes: bool) -> &'static str {
    if yes { "keyed" } else { "not keyed" }
}
