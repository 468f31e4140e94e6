//! Values to frames.

use super::kind::Kind;
use super::layout::{
    CONTROL_LIMIT, CRC_LEN, FLAG_KEYED, FLAG_SPECIMEN, HEADER_LEN, HEADER_WORDS, HISTORY, MAGIC,
    MAX_AXES, NO_SEQUENCE, VERSION, WORD, body_end, earlier_words, trailer_len,
};
use super::view::{Heartbeat, Notice};
use crate::bytes::{Word, bounded, finite, joined, put, same_length};
use crate::key::{MAC_LEN, SessionKey};
use crate::{Side, WireError};
use gusset_quantity::substructure::{Command, Measurement};

/// Time of a measurement, and commands missed so far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moment {
    /// Time from the arrival of the command in force to the sampling, in s.
    pub sampled_after: f64,
    /// Commands that never arrived, so far.
    pub missed: u32,
}

/// The sending half of one end: it counts, signs and remembers the last forces.
///
/// Frames are written into the caller's buffer, every byte of them; its old content does not matter. An error leaves
/// counter and history unchanged.
#[derive(Debug)]
pub struct Encoder {
    side: Side,
    axes: usize,
    session: u64,
    key: Option<SessionKey>,
    counter: u64,
    history: History,
}

impl Encoder {
    /// For an agreed session. `axes` is 1 to [`MAX_AXES`].
    ///
    /// # Errors
    /// [`WireError::Bounds`] for a number of axes outside that.
    pub fn new(
        side: Side,
        axes: usize,
        session: u64,
        key: Option<SessionKey>,
    ) -> Result<Self, WireError> {
        bounded("axes", 1, MAX_AXES, axes as i128)?;
        Ok(Self {
            side,
            axes,
            session,
            key,
            counter: 0,
            history: History::new(axes),
        })
    }

    /// For the messages before a session is agreed: control frames of session 0, without a key.
    #[must_use]
    pub fn greeting(side: Side) -> Self {
        Self {
            side,
            axes: 0,
            session: 0,
            key: None,
            counter: 0,
            history: History::new(0),
        }
    }

    /// Frames written so far.
    #[must_use]
    pub const fn sent(&self) -> u64 {
        self.counter
    }

    /// Writes a command; returns its length. Real-time: yes.
    ///
    /// # Errors
    /// Wrong number of axes, a number that is not finite, a buffer too small.
    pub fn command(&mut self, command: &Command<'_>, out: &mut [u8]) -> Result<usize, WireError> {
        same_length("axes of the command", self.axes, command.disp.len())?;
        same_length("axes of the velocity", self.axes, command.vel.len())?;
        a_sequence(command.sequence)?;
        finite("command time", &[command.time])?;
        finite("command dt", &[command.dt])?;
        finite("commanded displacement", command.disp)?;
        finite("commanded velocity", command.vel)?;
        let words = self.begin(Kind::Command, 0, out)?;
        let (head, vectors) = head(words)?;
        *head = [
            command.sequence.to_le_bytes(),
            command.time.to_le_bytes(),
            command.dt.to_le_bytes(),
        ];
        fill(vectors, [command.disp, command.vel]);
        self.finish(Kind::Command, 0, out)
    }

    /// Writes a measurement and the forces of the four commands before; returns its length. Real-time: yes.
    ///
    /// # Errors
    /// Wrong number of axes, a number that is not finite, a buffer too small.
    pub fn measurement(
        &mut self,
        measured: &Measurement,
        moment: Moment,
        out: &mut [u8],
    ) -> Result<usize, WireError> {
        same_length("axes of the measurement", self.axes, measured.disp.len())?;
        same_length("axes of the force", self.axes, measured.force.len())?;
        a_sequence(measured.sequence)?;
        finite("specimen time", &[measured.time])?;
        finite("moment of sampling", &[moment.sampled_after])?;
        finite("measured displacement", &measured.disp)?;
        finite("measured force", &measured.force)?;
        let words = self.begin(Kind::Measurement, 0, out)?;
        let (head, vectors) = head(words)?;
        *head = [
            measured.sequence.to_le_bytes(),
            measured.time.to_le_bytes(),
            moment.sampled_after.to_le_bytes(),
            joined(measured.status.0, moment.missed),
        ];
        let earlier = fill(vectors, [&measured.disp, &measured.force]);
        self.history.remember(measured.sequence, &measured.force);
        for (word, kept) in earlier.iter_mut().zip(self.history.earlier()) {
            *word = *kept;
        }
        self.finish(Kind::Measurement, 0, out)
    }

    /// Writes a heartbeat; returns its length. Real-time: yes.
    ///
    /// # Errors
    /// A time that is not finite, a buffer too small.
    pub fn heartbeat(&mut self, beat: Heartbeat, out: &mut [u8]) -> Result<usize, WireError> {
        finite("heartbeat time", &[beat.time])?;
        let words = self.begin(Kind::Heartbeat, 0, out)?;
        let (head, _) = head(words)?;
        *head = [
            beat.sequence.to_le_bytes(),
            beat.time.to_le_bytes(),
            joined(beat.status.0, 0),
        ];
        self.finish(Kind::Heartbeat, 0, out)
    }

    /// Writes a hold; returns its length. Real-time: yes.
    ///
    /// # Errors
    /// A specimen that tries, a buffer too small.
    pub fn hold(&mut self, notice: Notice, out: &mut [u8]) -> Result<usize, WireError> {
        self.notice(Kind::Hold, notice, out)
    }

    /// Writes a retire; returns its length. Real-time: yes.
    ///
    /// # Errors
    /// A specimen that tries, a buffer too small.
    pub fn retire(&mut self, notice: Notice, out: &mut [u8]) -> Result<usize, WireError> {
        self.notice(Kind::Retire, notice, out)
    }

    /// Writes a goodbye; returns its length. Real-time: yes.
    ///
    /// # Errors
    /// A buffer too small.
    pub fn goodbye(&mut self, notice: Notice, out: &mut [u8]) -> Result<usize, WireError> {
        self.notice(Kind::Goodbye, notice, out)
    }

    /// Writes a control message, already encoded by [`crate::handshake`]; returns the frame's length.
    ///
    /// # Errors
    /// A message beyond [`CONTROL_LIMIT`], a buffer too small.
    pub fn control(&mut self, message: &[u8], out: &mut [u8]) -> Result<usize, WireError> {
        let (field, found) = ("length of the control message", message.len() as i128);
        bounded(field, 0, CONTROL_LIMIT, found)?;
        let body = self.begin(Kind::Control, message.len(), out)?;
        if let Some(place) = body.get_mut(..message.len()) {
            place.copy_from_slice(message);
        }
        self.finish(Kind::Control, message.len(), out)
    }

    fn notice(&mut self, kind: Kind, notice: Notice, out: &mut [u8]) -> Result<usize, WireError> {
        let words = self.begin(kind, 0, out)?;
        let (head, _) = head(words)?;
        *head = [
            notice.sequence.to_le_bytes(),
            joined(notice.cause.code(), 0),
        ];
        self.finish(kind, 0, out)
    }

    /// Writes the header; the returned slice is the rest of the frame.
    fn begin<'o>(
        &self,
        kind: Kind,
        payload: usize,
        out: &'o mut [u8],
    ) -> Result<&'o mut [u8], WireError> {
        if self.session == 0 && kind != Kind::Control {
            return Err(WireError::Order {
                expected: "a control message",
                found: kind.name(),
            });
        }
        if !may_write(self.side, kind) {
            return Err(WireError::Direction {
                field: kind.name(),
                found: self.side,
            });
        }
        let needed = body_end(kind, self.axes, payload) + trailer_len(self.key.is_some());
        let found = out.len();
        let frame = out
            .get_mut(..needed)
            .ok_or(WireError::Room { needed, found })?;
        let mut flags = 0;
        if self.key.is_some() {
            flags |= FLAG_KEYED;
        }
        if self.side == Side::Specimen {
            flags |= FLAG_SPECIMEN;
        }
        // Bounded by MAX_AXES and CONTROL_LIMIT: both casts are lossless.
        let axes = if kind.has_axes() { self.axes as u32 } else { 0 };
        let [m0, m1, m2, m3] = MAGIC;
        let [f0, f1] = flags.to_le_bytes();
        let (header, body) = frame
            .split_first_chunk_mut::<HEADER_LEN>()
            .ok_or(WireError::Room { needed, found })?;
        let words: [Word; HEADER_WORDS] = [
            [m0, m1, m2, m3, VERSION, kind.code(), f0, f1],
            joined(needed as u32, axes),
            self.session.to_le_bytes(),
            self.counter.saturating_add(1).to_le_bytes(),
        ];
        header.copy_from_slice(words.as_flattened());
        Ok(body)
    }

    /// Writes MAC and CRC, and counts the frame.
    fn finish(&mut self, kind: Kind, payload: usize, out: &mut [u8]) -> Result<usize, WireError> {
        let mut end = body_end(kind, self.axes, payload);
        if let Some(key) = &self.key {
            let mac = key.mac(out.get(..end).unwrap_or_default());
            put(out, end, mac)?;
            end += MAC_LEN;
        }
        let crc = crc32fast::hash(out.get(..end).unwrap_or_default());
        put(out, end, crc.to_le_bytes())?;
        self.counter = self.counter.saturating_add(1);
        Ok(end + CRC_LEN)
    }
}

/// Whether this end may write this kind of frame.
pub(super) const fn may_write(side: Side, kind: Kind) -> bool {
    match kind {
        Kind::Command | Kind::Hold | Kind::Retire => matches!(side, Side::Controller),
        Kind::Measurement => matches!(side, Side::Specimen),
        Kind::Heartbeat | Kind::Goodbye | Kind::Control => true,
    }
}

/// 2^64−1 means "none" and is no sequence number.
pub(super) fn a_sequence(sequence: u64) -> Result<(), WireError> {
    if sequence == NO_SEQUENCE {
        Err(WireError::Code {
            field: "sequence",
            found: sequence,
        })
    } else {
        Ok(())
    }
}

/// The first `N` words of a body, and the words behind them.
fn head<const N: usize>(body: &mut [u8]) -> Result<(&mut [Word; N], &mut [Word]), WireError> {
    let found = body.len();
    let words = body.as_chunks_mut::<WORD>().0;
    words.split_first_chunk_mut().ok_or(WireError::Room {
        needed: N * size_of::<Word>(),
        found,
    })
}

/// Writes vectors one behind the other; returns the words behind them.
fn fill<'w>(mut words: &'w mut [Word], vectors: [&[f64]; 2]) -> &'w mut [Word] {
    for vector in vectors {
        let length = vector.len().min(words.len());
        let (place, rest) = words.split_at_mut(length);
        for (word, value) in place.iter_mut().zip(vector) {
            *word = value.to_le_bytes();
        }
        words = rest;
    }
    words
}

/// The last forces, one entry for each command that was ever in force; the newest measurement of a command counts. The
/// order is that of a frame: for each entry the sequence and the forces, the current one first, then the earlier ones,
/// newest first.
#[derive(Debug)]
struct History {
    words: Vec<Word>,
    /// Words of one measurement.
    stride: usize,
}

impl History {
    fn new(axes: usize) -> Self {
        let stride = earlier_words(axes);
        let mut words = vec![[0; 8]; (HISTORY + 1) * stride];
        for first in words.iter_mut().step_by(stride) {
            *first = NO_SEQUENCE.to_le_bytes();
        }
        Self { words, stride }
    }

    /// Real-time: yes.
    fn remember(&mut self, sequence: u64, force: &[f64]) {
        let current = self.words.first().map(|word| u64::from_le_bytes(*word));
        if current.is_some_and(|current| current != sequence && current != NO_SEQUENCE) {
            // The oldest falls off the end.
            self.words.copy_within(..HISTORY * self.stride, self.stride);
        }
        if let Some((first, forces)) = self.words.split_first_mut() {
            *first = sequence.to_le_bytes();
            for (kept, new) in forces.iter_mut().zip(force) {
                *kept = new.to_le_bytes();
            }
        }
    }

    fn earlier(&self) -> &[Word] {
        self.words.get(self.stride..).unwrap_or_default()
    }
}
