//! Values to frames.

use super::layout::{
    AT_AXES, AT_BEAT_RESERVED, AT_BEAT_STATUS, AT_BEAT_TIME, AT_CAUSE, AT_COMMAND_DISP,
    AT_COMMAND_DT, AT_COMMAND_TIME, AT_COUNTER, AT_FLAGS, AT_HEADER_RESERVED, AT_KIND, AT_LENGTH,
    AT_MAGIC, AT_MEASURED_DISP, AT_MISSED, AT_NOTICE_RESERVED, AT_SAMPLED_AFTER, AT_SEQUENCE,
    AT_SESSION, AT_SPECIMEN_TIME, AT_STATUS, AT_VERSION, CONTROL_LIMIT, CRC_LEN, FLAG_KEYED,
    FLAG_SPECIMEN, HEADER_LEN, HISTORY, MAGIC, MAX_AXES, NO_SEQUENCE, VERSION, at_command_vel,
    at_earlier, at_force, body_end, trailer_len,
};
use super::view::{Heartbeat, Kind, Notice};
use crate::substructure::{Command, Measurement};
use crate::wire::bytes::{finite, put, put_doubles, same_length};
use crate::wire::key::{MAC_LEN, SessionKey};
use crate::wire::{Side, WireError};

/// What a specimen says about the moment of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moment {
    /// Time from the arrival of the command in force to the sampling, in s.
    pub sampled_after: f64,
    /// Commands that never arrived, so far.
    pub missed: u32,
}

/// The sending half of one end: it counts, signs and remembers the last forces.
///
/// Frames are written into a buffer of the caller, every byte of them; nothing is taken from what the buffer
/// held. An error leaves counter and history as they were.
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
        axes_inside(axes)?;
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
        let frame = self.begin(Kind::Command, 0, out)?;
        put(frame, AT_SEQUENCE, command.sequence.to_le_bytes())?;
        put(frame, AT_COMMAND_TIME, command.time.to_le_bytes())?;
        put(frame, AT_COMMAND_DT, command.dt.to_le_bytes())?;
        put_doubles(frame, AT_COMMAND_DISP, command.disp)?;
        put_doubles(frame, at_command_vel(self.axes), command.vel)?;
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
        let frame = self.begin(Kind::Measurement, 0, out)?;
        put(frame, AT_SEQUENCE, measured.sequence.to_le_bytes())?;
        put(frame, AT_SPECIMEN_TIME, measured.time.to_le_bytes())?;
        put(frame, AT_SAMPLED_AFTER, moment.sampled_after.to_le_bytes())?;
        put(frame, AT_STATUS, measured.status.0.to_le_bytes())?;
        put(frame, AT_MISSED, moment.missed.to_le_bytes())?;
        put_doubles(frame, AT_MEASURED_DISP, &measured.disp)?;
        put_doubles(frame, at_force(self.axes), &measured.force)?;
        self.history.remember(measured.sequence, &measured.force);
        for (entry, (sequence, force)) in self.history.earlier().enumerate() {
            let at = at_earlier(self.axes, entry);
            put(frame, at, sequence.to_le_bytes())?;
            put_doubles(frame, at + 8, force)?;
        }
        self.finish(Kind::Measurement, 0, out)
    }

    /// Writes a heartbeat; returns its length. Real-time: yes.
    ///
    /// # Errors
    /// A time that is not finite, a buffer too small.
    pub fn heartbeat(&mut self, beat: Heartbeat, out: &mut [u8]) -> Result<usize, WireError> {
        finite("heartbeat time", &[beat.time])?;
        let frame = self.begin(Kind::Heartbeat, 0, out)?;
        put(frame, AT_SEQUENCE, beat.sequence.to_le_bytes())?;
        put(frame, AT_BEAT_TIME, beat.time.to_le_bytes())?;
        put(frame, AT_BEAT_STATUS, beat.status.0.to_le_bytes())?;
        put(frame, AT_BEAT_RESERVED, [0; 4])?;
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

    /// Writes a control message, already encoded by [`crate::wire::handshake`]; returns the frame's length.
    ///
    /// # Errors
    /// A message beyond [`CONTROL_LIMIT`], a buffer too small.
    pub fn control(&mut self, message: &[u8], out: &mut [u8]) -> Result<usize, WireError> {
        if message.len() > CONTROL_LIMIT {
            return Err(WireError::Bounds {
                field: "length of the control message",
                lowest: 0,
                highest: CONTROL_LIMIT as i64,
                found: i64::try_from(message.len()).unwrap_or(i64::MAX),
            });
        }
        let frame = self.begin(Kind::Control, message.len(), out)?;
        if let Some(place) = frame.get_mut(HEADER_LEN..HEADER_LEN + message.len()) {
            place.copy_from_slice(message);
        }
        self.finish(Kind::Control, message.len(), out)
    }

    fn notice(&mut self, kind: Kind, notice: Notice, out: &mut [u8]) -> Result<usize, WireError> {
        let frame = self.begin(kind, 0, out)?;
        put(frame, AT_SEQUENCE, notice.sequence.to_le_bytes())?;
        put(frame, AT_CAUSE, notice.cause.code().to_le_bytes())?;
        put(frame, AT_NOTICE_RESERVED, [0; 4])?;
        self.finish(kind, 0, out)
    }

    /// Writes the header; the returned slice is exactly the frame.
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
        let axes = if kind.has_axes() { self.axes as u16 } else { 0 };
        put(frame, AT_MAGIC, MAGIC)?;
        put(frame, AT_VERSION, [VERSION])?;
        put(frame, AT_KIND, [kind.code()])?;
        put(frame, AT_FLAGS, flags.to_le_bytes())?;
        put(frame, AT_LENGTH, (needed as u32).to_le_bytes())?;
        put(frame, AT_AXES, axes.to_le_bytes())?;
        put(frame, AT_HEADER_RESERVED, [0; 2])?;
        put(frame, AT_SESSION, self.session.to_le_bytes())?;
        put(
            frame,
            AT_COUNTER,
            self.counter.saturating_add(1).to_le_bytes(),
        )?;
        Ok(frame)
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

/// Who may write what.
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
            found: u32::MAX,
        })
    } else {
        Ok(())
    }
}

pub(super) fn axes_inside(axes: usize) -> Result<(), WireError> {
    if (1..=MAX_AXES).contains(&axes) {
        Ok(())
    } else {
        Err(WireError::Bounds {
            field: "axes",
            lowest: 1,
            highest: MAX_AXES as i64,
            found: i64::try_from(axes).unwrap_or(i64::MAX),
        })
    }
}

/// The last forces, one for each command that was ever in force; the newest of a command counts.
#[derive(Debug)]
struct History {
    axes: usize,
    /// Current first, then the earlier ones, newest first.
    sequences: [u64; HISTORY + 1],
    forces: Vec<f64>,
}

impl History {
    fn new(axes: usize) -> Self {
        Self {
            axes,
            sequences: [NO_SEQUENCE; HISTORY + 1],
            forces: vec![0.0; (HISTORY + 1) * axes],
        }
    }

    /// Real-time: yes.
    fn remember(&mut self, sequence: u64, force: &[f64]) {
        let [current, ..] = self.sequences;
        if current != sequence && current != NO_SEQUENCE {
            self.sequences.rotate_right(1);
            self.forces.rotate_right(self.axes);
        }
        let [current, ..] = &mut self.sequences;
        *current = sequence;
        for (kept, new) in self.forces.iter_mut().zip(force) {
            *kept = *new;
        }
    }

    fn earlier(&self) -> impl Iterator<Item = (u64, &[f64])> {
        self.sequences
            .iter()
            .copied()
            .zip(self.forces.chunks_exact(self.axes.max(1)))
            .skip(1)
    }
}
