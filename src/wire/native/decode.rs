//! Frames to values.

use super::encode::{a_sequence, axes_inside, may_write};
use super::layout::{
    AT_AXES, AT_BEAT_RESERVED, AT_BEAT_STATUS, AT_BEAT_TIME, AT_CAUSE, AT_COMMAND_DISP,
    AT_COMMAND_DT, AT_COMMAND_TIME, AT_COUNTER, AT_FLAGS, AT_HEADER_RESERVED, AT_KIND, AT_LENGTH,
    AT_MEASURED_DISP, AT_MISSED, AT_NOTICE_RESERVED, AT_SAMPLED_AFTER, AT_SEQUENCE, AT_SESSION,
    AT_SPECIMEN_TIME, AT_STATUS, AT_VERSION, CONTROL_LIMIT, CRC_LEN, FLAG_KEYED, FLAG_SPECIMEN,
    HEADER_LEN, HISTORY, MAGIC, NO_SEQUENCE, VERSION, at_command_vel, at_earlier, at_force,
    body_end, trailer_len,
};
use super::view::{Cause, CommandFrame, Earlier, Frame, Heartbeat, Kind, MeasurementFrame, Notice};
use crate::substructure::Status;
use crate::wire::bytes::{array, finite, finite_words, get_f64, get_u16, get_u32, get_u64, words};
use crate::wire::key::{MAC_LEN, SessionKey};
use crate::wire::window::{Arrival, SequenceWindow};
use crate::wire::{Progress, Side, WireError};

/// Finds the end of the first frame in a stream. Only the header is looked at, every length in it is bounded
/// by [`super::LARGEST_FRAME`], and a wrong protocol shows with its first byte. An error is final: a stream
/// that has lost its frames is not searched for new ones. Real-time: yes.
///
/// # Errors
/// Another protocol, another version, an unknown kind, a length that this kind cannot have.
pub fn split(bytes: &[u8]) -> Result<Progress, WireError> {
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
    if let Some(&version) = bytes.get(AT_VERSION) {
        same_version(version)?;
    }
    if bytes.len() < HEADER_LEN {
        return Ok(Progress::NeedMore);
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
    /// What it says.
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
        axes_inside(axes)?;
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
        let crc_at = bytes.len() - CRC_LEN;
        let expected = crc32fast::hash(bytes.get(..crc_at).unwrap_or_default());
        let found = get_u32(bytes, crc_at)?;
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
        match header.kind {
            Kind::Command => command(bytes, self.axes).map(Frame::Command),
            Kind::Measurement => measurement(bytes, self.axes).map(Frame::Measurement),
            Kind::Heartbeat => heartbeat(bytes).map(Frame::Heartbeat),
            Kind::Hold => notice(bytes).map(Frame::Hold),
            Kind::Retire => notice(bytes).map(Frame::Retire),
            Kind::Goodbye => notice(bytes).map(Frame::Goodbye),
            Kind::Control => {
                let end = header.length - trailer_len(header.keyed);
                Ok(Frame::Control(
                    bytes.get(HEADER_LEN..end).unwrap_or_default(),
                ))
            }
        }
    }
}

struct Header {
    kind: Kind,
    keyed: bool,
    from: Side,
    length: usize,
    axes: usize,
    session: u64,
    counter: u64,
}

impl Header {
    /// Invariant of the result: `length` is what the kind, the axes and the key make it, and bounded.
    fn parse(bytes: &[u8]) -> Result<Self, WireError> {
        let found = array(bytes, 0)?;
        if found != MAGIC {
            return Err(WireError::Magic {
                expected: MAGIC,
                found,
            });
        }
        let [version] = array(bytes, AT_VERSION)?;
        same_version(version)?;
        let [kind] = array(bytes, AT_KIND)?;
        let kind = Kind::from_code(kind)?;
        let flags = get_u16(bytes, AT_FLAGS)?;
        reserved(
            "frame flags",
            u32::from(FLAG_KEYED | FLAG_SPECIMEN),
            u32::from(flags),
        )?;
        let keyed = flags & FLAG_KEYED != 0;
        let axes = usize::from(get_u16(bytes, AT_AXES)?);
        if kind.has_axes() {
            axes_inside(axes)?;
        } else if axes != 0 {
            return Err(WireError::Bounds {
                field: "axes of a frame without vectors",
                lowest: 0,
                highest: 0,
                found: axes as i64,
            });
        }
        reserved(
            "header reserve",
            0,
            u32::from(get_u16(bytes, AT_HEADER_RESERVED)?),
        )?;
        let length = get_u32(bytes, AT_LENGTH)? as usize;
        let shortest = body_end(kind, axes, 0) + trailer_len(keyed);
        let longest = if kind == Kind::Control {
            shortest + CONTROL_LIMIT
        } else {
            shortest
        };
        if !(shortest..=longest).contains(&length) {
            return Err(WireError::Bounds {
                field: "length of the frame",
                lowest: shortest as i64,
                highest: longest as i64,
                found: length as i64,
            });
        }
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
            session: get_u64(bytes, AT_SESSION)?,
            counter: get_u64(bytes, AT_COUNTER)?,
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

fn reserved(field: &'static str, allowed: u32, found: u32) -> Result<(), WireError> {
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

fn command(bytes: &[u8], axes: usize) -> Result<CommandFrame<'_>, WireError> {
    let frame = CommandFrame {
        sequence: sequence(bytes)?,
        time: get_f64(bytes, AT_COMMAND_TIME)?,
        dt: get_f64(bytes, AT_COMMAND_DT)?,
        disp: words(bytes, AT_COMMAND_DISP, axes)?,
        vel: words(bytes, at_command_vel(axes), axes)?,
    };
    finite("command time", &[frame.time])?;
    finite("command dt", &[frame.dt])?;
    finite_words("commanded displacement", frame.disp)?;
    finite_words("commanded velocity", frame.vel)?;
    Ok(frame)
}

fn measurement(bytes: &[u8], axes: usize) -> Result<MeasurementFrame<'_>, WireError> {
    let mut earlier = [None; HISTORY];
    for (entry, place) in earlier.iter_mut().enumerate() {
        let at = at_earlier(axes, entry);
        let sequence = get_u64(bytes, at)?;
        let force = words(bytes, at + 8, axes)?;
        finite_words("earlier force", force)?;
        if sequence != NO_SEQUENCE {
            *place = Some(Earlier { sequence, force });
        }
    }
    let frame = MeasurementFrame {
        sequence: sequence(bytes)?,
        time: get_f64(bytes, AT_SPECIMEN_TIME)?,
        sampled_after: get_f64(bytes, AT_SAMPLED_AFTER)?,
        status: Status(get_u32(bytes, AT_STATUS)?),
        missed: get_u32(bytes, AT_MISSED)?,
        disp: words(bytes, AT_MEASURED_DISP, axes)?,
        force: words(bytes, at_force(axes), axes)?,
        earlier,
    };
    finite("specimen time", &[frame.time])?;
    finite("moment of sampling", &[frame.sampled_after])?;
    finite_words("measured displacement", frame.disp)?;
    finite_words("measured force", frame.force)?;
    Ok(frame)
}

fn heartbeat(bytes: &[u8]) -> Result<Heartbeat, WireError> {
    let time = get_f64(bytes, AT_BEAT_TIME)?;
    finite("heartbeat time", &[time])?;
    reserved("heartbeat reserve", 0, get_u32(bytes, AT_BEAT_RESERVED)?)?;
    Ok(Heartbeat {
        sequence: get_u64(bytes, AT_SEQUENCE)?,
        time,
        status: Status(get_u32(bytes, AT_BEAT_STATUS)?),
    })
}

fn notice(bytes: &[u8]) -> Result<Notice, WireError> {
    reserved("notice reserve", 0, get_u32(bytes, AT_NOTICE_RESERVED)?)?;
    Ok(Notice {
        sequence: get_u64(bytes, AT_SEQUENCE)?,
        cause: Cause::from_code(get_u32(bytes, AT_CAUSE)?)?,
    })
}

/// The sequence number of a command or measurement.
fn sequence(bytes: &[u8]) -> Result<u64, WireError> {
    let sequence = get_u64(bytes, AT_SEQUENCE)?;
    a_sequence(sequence).map(|()| sequence)
}
