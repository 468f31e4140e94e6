//! Frames to values.

use super::encode::{a_sequence, may_write};
use super::header::{Header, begins_right, reserved};
use super::kind::Kind;
use super::layout::{
    CRC_LEN, HEADER_LEN, HISTORY, MAX_AXES, MEASURED_WORDS, WORD, earlier_words, trailer_len,
};
use super::view::{Cause, CommandFrame, Frame, Heartbeat, MeasurementFrame, Notice};
use crate::bytes::{Word, array, bounded, finite, finite_words, halves};
use crate::key::{MAC_LEN, SessionKey};
use crate::window::{Arrival, SequenceWindow};
use crate::{Progress, Side, WireError};
use gusset_quantity::substructure::Status;

/// Finds the end of the first frame in a stream. Only the header is read, every length in it is bounded by
/// [`super::LARGEST_FRAME`], and a wrong protocol shows with its first byte. An error is final: a stream that has
/// lost its frames is not searched for new ones. Real-time: yes.
///
/// # Errors
/// Another protocol, another version, an unknown kind, a length that this kind cannot have.
pub fn split(bytes: &[u8]) -> Result<Progress, WireError> {
    if bytes.len() < HEADER_LEN {
        return begins_right(bytes).map(|()| Progress::NeedMore);
    }
    let header = Header::parse(bytes)?;
    if bytes.len() < header.length {
        return Ok(Progress::NeedMore);
    }
    Ok(Progress::Frame {
        consumed: header.length,
    })
}

/// A frame, and how it came.
#[derive(Debug, Clone, Copy)]
pub struct Received<'a> {
    /// Its content.
    pub frame: Frame<'a>,
    /// The sender's counter.
    pub counter: u64,
    /// Newest, or overtaken on the way. Before a session is agreed every frame counts as newest.
    pub arrival: Arrival,
}

/// The receiving half of one end: it checks everything, and takes no frame twice.
#[derive(Debug)]
pub struct Decoder {
    from: Side,
    axes: usize,
    session: u64,
    key: Option<SessionKey>,
    window: SequenceWindow,
}

impl Decoder {
    /// For frames that `from` writes in an agreed session. `axes` is 1 to [`super::MAX_AXES`].
    ///
    /// # Errors
    /// [`WireError::Bounds`] for a number of axes outside that.
    pub fn new(
        from: Side,
        axes: usize,
        session: u64,
        key: Option<SessionKey>,
    ) -> Result<Self, WireError> {
        bounded("axes", 1, MAX_AXES, axes as i128)?;
        Ok(Self {
            from,
            axes,
            session,
            key,
            window: SequenceWindow::new(),
        })
    }

    /// For the messages before a session is agreed: control frames of session 0, without a key. Repeats pass:
    /// a greeting that is repeated because its answer was lost must be answered again.
    #[must_use]
    pub const fn greeting(from: Side) -> Self {
        Self {
            from,
            axes: 0,
            session: 0,
            key: None,
            window: SequenceWindow::new(),
        }
    }

    /// Opens one whole frame: a datagram, or what [`split`] found. Real-time: yes.
    ///
    /// # Errors
    /// Whatever is wrong with it. The frame then has had no effect; on a datagram link it is counted and
    /// dropped, on a stream the link is lost.
    pub fn open<'a>(&mut self, bytes: &'a [u8]) -> Result<Received<'a>, WireError> {
        let header = Header::parse(bytes)?;
        if header.length != bytes.len() {
            return Err(if bytes.len() < header.length {
                WireError::Truncated {
                    needed: header.length,
                    found: bytes.len(),
                }
            } else {
                WireError::Count {
                    field: "length of the frame",
                    expected: header.length,
                    found: bytes.len(),
                }
            });
        }
        let (covered, crc) = bytes
            .split_last_chunk::<CRC_LEN>()
            .unwrap_or((bytes, &[0; CRC_LEN]));
        let expected = crc32fast::hash(covered);
        let found = u32::from_le_bytes(*crc);
        if expected != found {
            return Err(WireError::Checksum { expected, found });
        }
        self.authenticate(&header, bytes)?;
        let frame = self.body(&header, bytes)?;
        let arrival = if self.session == 0 {
            Arrival::Newest { skipped: 0 }
        } else {
            self.window.accept(header.counter)?
        };
        Ok(Received {
            frame,
            counter: header.counter,
            arrival,
        })
    }

    fn authenticate(&self, header: &Header, bytes: &[u8]) -> Result<(), WireError> {
        if header.from != self.from || !may_write(header.from, header.kind) {
            return Err(WireError::Direction {
                field: header.kind.name(),
                found: header.from,
            });
        }
        if header.keyed != self.key.is_some() {
            return Err(WireError::Keyed {
                expected: self.key.is_some(),
                found: header.keyed,
            });
        }
        if header.session != self.session {
            return Err(WireError::Session {
                expected: self.session,
                found: header.session,
            });
        }
        let Some(key) = &self.key else {
            return Ok(());
        };
        // Header::parse made sure that a keyed frame has room for its trailer.
        let mac_at = bytes.len() - CRC_LEN - MAC_LEN;
        let mac = array(bytes, mac_at)?;
        if key.verify(bytes.get(..mac_at).unwrap_or_default(), &mac) {
            Ok(())
        } else {
            Err(WireError::Mac)
        }
    }

    fn body<'a>(&self, header: &Header, bytes: &'a [u8]) -> Result<Frame<'a>, WireError> {
        if header.kind != Kind::Control && self.session == 0 {
            return Err(WireError::Order {
                expected: "a control message",
                found: header.kind.name(),
            });
        }
        if header.kind.has_axes() && header.axes != self.axes {
            return Err(WireError::Count {
                field: "axes of the frame",
                expected: self.axes,
                found: header.axes,
            });
        }
        let body = bytes.get(HEADER_LEN..).unwrap_or_default();
        let words = body.as_chunks::<WORD>().0;
        match header.kind {
            Kind::Command => command(words, self.axes).map(Frame::Command),
            Kind::Measurement => measurement(words, self.axes).map(Frame::Measurement),
            Kind::Heartbeat => heartbeat(words).map(Frame::Heartbeat),
            Kind::Hold => notice(words).map(Frame::Hold),
            Kind::Retire => notice(words).map(Frame::Retire),
            Kind::Goodbye => notice(words).map(Frame::Goodbye),
            Kind::Control => {
                let end = header.length - trailer_len(header.keyed);
                Ok(Frame::Control(
                    bytes.get(HEADER_LEN..end).unwrap_or_default(),
                ))
            }
        }
    }
}

/// The first `N` words of a body, and those behind them. [`Header::parse`] made sure that they are there.
fn head<const N: usize>(words: &[Word]) -> Result<(&[Word; N], &[Word]), WireError> {
    words.split_first_chunk().ok_or_else(|| missing(N, words))
}

/// The first `count` words, and those behind them.
fn vector(words: &[Word], count: usize) -> Result<(&[Word], &[Word]), WireError> {
    words
        .split_at_checked(count)
        .ok_or_else(|| missing(count, words))
}

const fn missing(needed: usize, words: &[Word]) -> WireError {
    WireError::Truncated {
        needed: needed * size_of::<Word>(),
        found: size_of_val(words),
    }
}

fn command(words: &[Word], axes: usize) -> Result<CommandFrame<'_>, WireError> {
    let ([sequence, time, dt], vectors) = head(words)?;
    let (disp, vectors) = vector(vectors, axes)?;
    let (vel, _) = vector(vectors, axes)?;
    let frame = CommandFrame {
        sequence: number(*sequence)?,
        time: f64::from_le_bytes(*time),
        dt: f64::from_le_bytes(*dt),
        disp,
        vel,
    };
    finite("command time", &[frame.time])?;
    finite("command dt", &[frame.dt])?;
    finite_words("commanded displacement", frame.disp)?;
    finite_words("commanded velocity", frame.vel)?;
    Ok(frame)
}

fn measurement(words: &[Word], axes: usize) -> Result<MeasurementFrame<'_>, WireError> {
    let ([sequence, time, after, counts], vectors) = head::<MEASURED_WORDS>(words)?;
    let (disp, vectors) = vector(vectors, axes)?;
    let (force, vectors) = vector(vectors, axes)?;
    let (earlier, _) = vector(vectors, HISTORY * earlier_words(axes))?;
    for entry in earlier.chunks_exact(earlier_words(axes)) {
        finite_words("earlier force", entry.get(1..).unwrap_or_default())?;
    }
    let (status, missed) = halves(*counts);
    let frame = MeasurementFrame {
        sequence: number(*sequence)?,
        time: f64::from_le_bytes(*time),
        sampled_after: f64::from_le_bytes(*after),
        status: Status::told(status),
        missed,
        disp,
        force,
        earlier,
    };
    finite("specimen time", &[frame.time])?;
    finite("moment of sampling", &[frame.sampled_after])?;
    finite_words("measured displacement", frame.disp)?;
    finite_words("measured force", frame.force)?;
    Ok(frame)
}

fn heartbeat(words: &[Word]) -> Result<Heartbeat, WireError> {
    let ([sequence, time, flags], _) = head(words)?;
    let time = f64::from_le_bytes(*time);
    finite("heartbeat time", &[time])?;
    let (status, reserve) = halves(*flags);
    reserved("heartbeat reserve", 0, reserve)?;
    Ok(Heartbeat {
        sequence: u64::from_le_bytes(*sequence),
        time,
        status: Status::told(status),
    })
}

fn notice(words: &[Word]) -> Result<Notice, WireError> {
    let ([sequence, cause], _) = head(words)?;
    let (cause, reserve) = halves(*cause);
    reserved("notice reserve", 0, reserve)?;
    Ok(Notice {
        sequence: u64::from_le_bytes(*sequence),
        cause: Cause::from_code(cause)?,
    })
}

/// The sequence number of a command or measurement.
fn number(word: Word) -> Result<u64, WireError> {
    let sequence = u64::from_le_bytes(word);
    a_sequence(sequence).map(|()| sequence)
}
