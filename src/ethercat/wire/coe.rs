//! CANopen over EtherCAT (ETG.1000.6): the mailbox and the service data objects in it, both ends.

/// Header of a mailbox message, of CoE, and of an SDO.
const MAILBOX: usize = 6;
const COE: usize = 2;
const SDO: usize = 8;
/// Bytes of a message with an SDO and no more.
pub(crate) const SHORTEST_MESSAGE: usize = MAILBOX + COE + SDO;
/// Types of the mailbox.
const TYPE_ERROR: u8 = 0;
const TYPE_COE: u8 = 3;
/// Services of CoE.
const EMERGENCY: u16 = 1;
const REQUEST: u16 = 2;
const RESPONSE: u16 = 3;
/// Commands of an SDO, in the upper three bits of its first byte.
const DOWNLOAD_SEGMENT: u8 = 0;
const DOWNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
const UPLOAD_SEGMENT: u8 = 3;
const ABORT: u8 = 4;
/// Answers of a device.
const UPLOAD_SEGMENT_ANSWER: u8 = 0;
const DOWNLOAD_SEGMENT_ANSWER: u8 = 1;
const UPLOAD_ANSWER: u8 = 2;
const DOWNLOAD_ANSWER: u8 = 3;
/// Size indicated, and expedited.
const SIZED: u8 = 1;
const EXPEDITED: u8 = 2;
const TOGGLE: u8 = 0x10;
/// Bit of a request that begins a transfer of all subindices at once.
const COMPLETE: u8 = 0x10;
/// Command of a mailbox error, and its codes (ETG.1000.6, mailbox error reply).
const ERROR_COMMAND: u16 = 1;
const NO_PROTOCOL: u16 = 2;
const NO_SERVICE: u16 = 4;

/// An object of a dictionary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Object {
    pub index: u16,
    pub sub: u8,
}

/// A request of the master.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Request<'m> {
    /// Read an object.
    Upload(Object),
    /// Write an object.
    Download(Object, &'m [u8]),
    /// Read or write an object with all its subindices.
    Complete(Object),
    /// The next part of an object that is read; the bit alternates.
    UploadSegment(bool),
    /// The next part of an object that is written, which is the last if the second flag is set.
    DownloadSegment(bool, bool, &'m [u8]),
}

/// An answer of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Answer<'m> {
    /// The object as a whole, or its first part; the number is its size.
    Uploaded(Object, &'m [u8], usize),
    /// The next part; the first flag alternates, the second says that it is the last.
    Segment(bool, bool, &'m [u8]),
    /// It was written.
    Downloaded(Object),
    /// A part of it was written.
    SegmentTaken(bool),
    /// The device refuses, with this code.
    Aborted(Object, u32),
    /// It reports an emergency, which is no answer: its error code.
    Emergency(u16),
    /// The mailbox itself refuses, with this code.
    Refused(u16),
    /// Another message.
    Other,
}

fn le16(bytes: &[u8], at: usize) -> u16 {
    let pair = bytes.get(at..).and_then(|rest| rest.first_chunk());
    pair.map_or(0, |pair| u16::from_le_bytes(*pair))
}

fn le32(bytes: &[u8], at: usize) -> u32 {
    let four = bytes.get(at..).and_then(|rest| rest.first_chunk());
    four.map_or(0, |four| u32::from_le_bytes(*four))
}

/// Type and content of a mailbox message; `None` if it is cut short.
fn message(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let length = usize::from(le16(bytes, 0));
    let kind = bytes.get(5)? & 0x0f;
    Some((kind, bytes.get(MAILBOX..MAILBOX + length)?))
}

/// The object and the data of an SDO.
fn object(sdo: &[u8]) -> Object {
    Object {
        index: le16(sdo, 1),
        sub: sdo.get(3).copied().unwrap_or_default(),
    }
}

/// Writes a message: header of the mailbox with the running `count` from 1 to 7, of CoE, and the SDO. Returns its length.
fn write(out: &mut [u8], count: u8, service: u16, parts: [&[u8]; 2]) -> Option<usize> {
    let [sdo, data] = parts;
    let content = COE + sdo.len() + data.len();
    let total = MAILBOX + content;
    let out = out.get_mut(..total)?;
    let (header, rest) = out.split_at_mut_checked(MAILBOX)?;
    let length = (content as u16).to_le_bytes();
    header.copy_from_slice(&[length[0], length[1], 0, 0, 0, TYPE_COE | (count & 7) << 4]);
    let (coe, rest) = rest.split_at_mut_checked(COE)?;
    coe.copy_from_slice(&(service << 12).to_le_bytes());
    let (head, tail) = rest.split_at_mut_checked(sdo.len())?;
    head.copy_from_slice(sdo);
    tail.copy_from_slice(data);
    Some(total)
}

fn sdo(command: u8, object: Object, data: [u8; 4]) -> [u8; SDO] {
    let [low, high] = object.index.to_le_bytes();
    let [a, b, c, d] = data;
    [command, low, high, object.sub, a, b, c, d]
}

/// Up to four bytes, and how many are missing.
fn expedited(data: &[u8]) -> ([u8; 4], u8) {
    let mut four = [0; 4];
    for (to, from) in four.iter_mut().zip(data) {
        *to = *from;
    }
    (four, 4u8.saturating_sub(data.len() as u8))
}

/// A segment of at most `room` bytes: seven at least, filled with zeros.
fn segment(data: &[u8]) -> (u8, [u8; 7]) {
    let mut seven = [0; 7];
    for (to, from) in seven.iter_mut().zip(data) {
        *to = *from;
    }
    (7u8.saturating_sub(data.len() as u8) << 1, seven)
}

impl<'m> Request<'m> {
    /// Writes the request; its length, or `None` if there is no room.
    pub(crate) fn write(&self, count: u8, out: &mut [u8]) -> Option<usize> {
        match *self {
            Self::Upload(object) => write(
                out,
                count,
                REQUEST,
                [&sdo(UPLOAD << 5, object, [0; 4]), &[]],
            ),
            Self::Download(object, data) if (1..=4).contains(&data.len()) => {
                let (four, missing) = expedited(data);
                let command = DOWNLOAD << 5 | missing << 2 | EXPEDITED | SIZED;
                write(out, count, REQUEST, [&sdo(command, object, four), &[]])
            }
            Self::Download(object, data) => {
                let size = (data.len() as u32).to_le_bytes();
                let head = sdo(DOWNLOAD << 5 | SIZED, object, size);
                write(out, count, REQUEST, [&head, data])
            }
            Self::Complete(object) => {
                let command = UPLOAD << 5 | COMPLETE;
                write(out, count, REQUEST, [&sdo(command, object, [0; 4]), &[]])
            }
            Self::UploadSegment(toggle) => {
                let command = UPLOAD_SEGMENT << 5 | if toggle { TOGGLE } else { 0 };
                write(out, count, REQUEST, [&[command, 0, 0, 0, 0, 0, 0, 0], &[]])
            }
            Self::DownloadSegment(toggle, last, data) => write_segment(
                out,
                (count, REQUEST, DOWNLOAD_SEGMENT),
                (toggle, last),
                data,
            ),
        }
    }

    /// Reads a request; `None` for any other message.
    pub(crate) fn read(bytes: &'m [u8]) -> Option<Self> {
        let (kind, content) = message(bytes)?;
        if kind != TYPE_COE || le16(content, 0) >> 12 != REQUEST {
            return None;
        }
        let sdo = content.get(COE..)?;
        let command = *sdo.first()?;
        let toggle = command & TOGGLE != 0;
        match command >> 5 {
            DOWNLOAD_SEGMENT => {
                let data = segment_data(sdo)?;
                Some(Self::DownloadSegment(toggle, command & 1 != 0, data))
            }
            DOWNLOAD | UPLOAD if command & COMPLETE != 0 => Some(Self::Complete(object(sdo))),
            DOWNLOAD => Some(Self::Download(object(sdo), object_data(sdo)?.0)),
            UPLOAD => Some(Self::Upload(object(sdo))),
            UPLOAD_SEGMENT => Some(Self::UploadSegment(toggle)),
            _ => None,
        }
    }
}

fn write_segment(
    out: &mut [u8],
    (count, service, command): (u8, u16, u8),
    (toggle, last): (bool, bool),
    data: &[u8],
) -> Option<usize> {
    let flags = command << 5 | if toggle { TOGGLE } else { 0 } | u8::from(last);
    if data.len() > 7 {
        return write(out, count, service, [&[flags], data]);
    }
    let (missing, seven) = segment(data);
    write(out, count, service, [&[flags | missing], &seven])
}

/// Data of an SDO that begins a transfer, and the size of the whole object.
fn object_data(sdo: &[u8]) -> Option<(&[u8], usize)> {
    let command = *sdo.first()?;
    if command & EXPEDITED != 0 {
        let missing = if command & SIZED != 0 {
            command >> 2 & 3
        } else {
            0
        };
        let data = sdo.get(4..8 - usize::from(missing))?;
        return Some((data, data.len()));
    }
    let size = le32(sdo, 4) as usize;
    let data = sdo.get(SDO..)?;
    // Bytes beyond the announced size are padding.
    Some((data.get(..size.min(data.len()))?, size))
}

/// Data of a segment. Seven bytes may say that some of them are missing.
fn segment_data(sdo: &[u8]) -> Option<&[u8]> {
    let data = sdo.get(1..)?;
    let missing = match data.len() {
        7 => usize::from(sdo.first()? >> 1 & 7),
        _ => 0,
    };
    data.get(..data.len() - missing)
}

impl<'m> Answer<'m> {
    /// Reads what a device sent; `None` if it is no whole message.
    pub(crate) fn read(bytes: &'m [u8]) -> Option<Self> {
        let (kind, content) = message(bytes)?;
        if kind == TYPE_ERROR {
            return Some(Self::Refused(le16(content, 2)));
        }
        if kind != TYPE_COE {
            return Some(Self::Other);
        }
        let service = le16(content, 0) >> 12;
        let sdo = content.get(COE..)?;
        if service == EMERGENCY {
            return Some(Self::Emergency(le16(sdo, 0)));
        }
        let command = *sdo.first()?;
        let toggle = command & TOGGLE != 0;
        Some(match (service, command >> 5) {
            (REQUEST | RESPONSE, ABORT) => Self::Aborted(object(sdo), le32(sdo, 4)),
            (RESPONSE, UPLOAD_SEGMENT_ANSWER) => {
                Self::Segment(toggle, command & 1 != 0, segment_data(sdo)?)
            }
            (RESPONSE, DOWNLOAD_SEGMENT_ANSWER) => Self::SegmentTaken(toggle),
            (RESPONSE, UPLOAD_ANSWER) => {
                let (data, size) = object_data(sdo)?;
                Self::Uploaded(object(sdo), data, size)
            }
            (RESPONSE, DOWNLOAD_ANSWER) => Self::Downloaded(object(sdo)),
            _ => Self::Other,
        })
    }

    /// Writes the answer; its length, or `None` if there is no room or no device sends it.
    pub(crate) fn write(&self, count: u8, out: &mut [u8]) -> Option<usize> {
        match *self {
            Self::Uploaded(object, data, size) if size <= 4 && size > 0 => {
                let (four, missing) = expedited(data);
                let command = UPLOAD_ANSWER << 5 | missing << 2 | EXPEDITED | SIZED;
                write(out, count, RESPONSE, [&sdo(command, object, four), &[]])
            }
            Self::Uploaded(object, data, size) => {
                let head = sdo(
                    UPLOAD_ANSWER << 5 | SIZED,
                    object,
                    (size as u32).to_le_bytes(),
                );
                write(out, count, RESPONSE, [&head, data])
            }
            Self::Segment(toggle, last, data) => write_segment(
                out,
                (count, RESPONSE, UPLOAD_SEGMENT_ANSWER),
                (toggle, last),
                data,
            ),
            Self::Downloaded(object) => {
                let head = sdo(DOWNLOAD_ANSWER << 5, object, [0; 4]);
                write(out, count, RESPONSE, [&head, &[]])
            }
            Self::SegmentTaken(toggle) => {
                let command = DOWNLOAD_SEGMENT_ANSWER << 5 | if toggle { TOGGLE } else { 0 };
                write(out, count, RESPONSE, [&[command, 0, 0, 0, 0, 0, 0, 0], &[]])
            }
            Self::Aborted(object, code) => {
                let head = sdo(ABORT << 5, object, code.to_le_bytes());
                write(out, count, REQUEST, [&head, &[]])
            }
            Self::Emergency(code) => {
                let [low, high] = code.to_le_bytes();
                write(out, count, EMERGENCY, [&[low, high, 0, 0, 0, 0, 0, 0], &[]])
            }
            Self::Refused(code) => {
                let out = out.first_chunk_mut::<{ MAILBOX + 4 }>()?;
                let ([a, b], [c, d]) = (ERROR_COMMAND.to_le_bytes(), code.to_le_bytes());
                *out = [4, 0, 0, 0, 0, TYPE_ERROR | (count & 7) << 4, a, b, c, d];
                Some(out.len())
            }
            Self::Other => None,
        }
    }

    /// The mailbox error with which a device answers a message that [`Request::read`] does not know; none if it expects no answer.
    pub(crate) fn to_unknown(bytes: &[u8]) -> Option<Self> {
        let (kind, content) = message(bytes)?;
        match (kind, le16(content, 0) >> 12) {
            (TYPE_ERROR, _) | (TYPE_COE, REQUEST) => None,
            (TYPE_COE, _) => Some(Self::Refused(NO_SERVICE)),
            _ => Some(Self::Refused(NO_PROTOCOL)),
        }
    }
}

/// Codes of an abort.
pub(crate) const TOGGLE_WRONG: u32 = 0x0503_0000;
pub(crate) const NO_ACCESS: u32 = 0x0601_0000;
pub(crate) const NOT_READABLE: u32 = 0x0601_0001;
pub(crate) const NOT_WRITABLE: u32 = 0x0601_0002;
pub(crate) const NO_OBJECT: u32 = 0x0602_0000;
pub(crate) const NOT_MAPPABLE: u32 = 0x0604_0041;
pub(crate) const WRONG_LENGTH: u32 = 0x0607_0010;
pub(crate) const NO_SUBINDEX: u32 = 0x0609_0011;
pub(crate) const WRONG_VALUE: u32 = 0x0609_0030;
pub(crate) const NOT_NOW: u32 = 0x0800_0022;

/// The meaning of an abort code (ETG.1000.6, table of SDO abort codes).
#[must_use]
pub(crate) const fn abort_text(code: u32) -> &'static str {
    match code {
        TOGGLE_WRONG => "a part of the object was repeated or left out",
        0x0504_0000 => "the device took too long",
        0x0504_0001 => "it does not know this command",
        NO_ACCESS => "it does not support this access",
        NOT_READABLE => "the object cannot be read",
        NOT_WRITABLE => "the object cannot be written",
        NO_OBJECT => "it has no such object",
        NOT_MAPPABLE => "the object cannot be mapped",
        0x0604_0042 => "the mapped objects are longer than the process data may be",
        0x0604_0043 => "the parameters do not fit together",
        WRONG_LENGTH | 0x0607_0012 | 0x0607_0013 => "the object has another length",
        NO_SUBINDEX => "the object has no such subindex",
        WRONG_VALUE | 0x0609_0031 | 0x0609_0032 => "the value is outside its range",
        0x0800_0020 | 0x0800_0021 => "it cannot store this now",
        NOT_NOW => "it does not allow this in its present state",
        _ => "see the manual of the device for this code",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: Object = Object {
        index: 0x1a00,
        sub: 2,
    };

    #[test]
    fn an_upload_request_has_the_bytes_of_the_standard() {
        let mut out = [0xff; 32];
        let length = Request::Upload(Object {
            index: 0x1018,
            sub: 1,
        })
        .write(1, &mut out)
        .unwrap();
        assert_eq!(
            out[..length],
            [
                10, 0, 0, 0, 0, 0x13, 0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0
            ]
        );
        let length = Request::Download(AT, &[0x34, 0x12])
            .write(2, &mut out)
            .unwrap();
        assert_eq!(
            out[..length],
            [
                10, 0, 0, 0, 0, 0x23, 0, 0x20, 0x2b, 0x00, 0x1a, 2, 0x34, 0x12, 0, 0
            ]
        );
    }

    #[test]
    fn requests_and_answers_read_back() {
        let long = [7u8; 40];
        let mut out = [0; 64];
        for request in [
            Request::Upload(AT),
            Request::Download(AT, &[1]),
            Request::Download(AT, &[1, 2, 3, 4]),
            Request::Download(AT, &long),
            Request::Complete(AT),
            Request::UploadSegment(true),
            Request::DownloadSegment(false, true, &[1, 2, 3]),
            Request::DownloadSegment(true, false, &long),
        ] {
            let length = request.write(3, &mut out).unwrap();
            assert_eq!(Request::read(&out[..length]), Some(request));
            assert!(request.write(3, &mut [0; 8]).is_none());
        }
        for answer in [
            Answer::Uploaded(AT, &[1, 2], 2),
            Answer::Uploaded(AT, &long, 40),
            Answer::Uploaded(AT, &long[..10], 40),
            Answer::Segment(true, false, &long),
            Answer::Segment(false, true, &[1, 2, 3]),
            Answer::Downloaded(AT),
            Answer::SegmentTaken(true),
            Answer::Aborted(AT, NO_OBJECT),
            Answer::Emergency(0x3220),
            Answer::Refused(NO_SERVICE),
        ] {
            let length = answer.write(5, &mut out).unwrap();
            assert_eq!(Answer::read(&out[..length]), Some(answer));
            for cut in 0..length.min(7) {
                assert_eq!(Answer::read(&out[..cut]), None, "{answer:?} {cut}");
            }
        }
    }

    #[test]
    fn unknown_messages_get_a_mailbox_error() {
        // SDO information, then EoE, an abort of the master, and an error.
        let mut bytes = [8, 0, 0, 0, 0, 0x13, 0, 0x80, 1, 0, 0, 0, 0, 0];
        assert_eq!(Request::read(&bytes), None);
        assert_eq!(
            Answer::to_unknown(&bytes),
            Some(Answer::Refused(NO_SERVICE))
        );
        let mut out = [0; 16];
        let length = Answer::Refused(NO_SERVICE).write(1, &mut out).unwrap();
        assert_eq!(out[..length], [4, 0, 0, 0, 0, 0x10, 1, 0, 4, 0]);
        bytes[5] = 0x12;
        assert_eq!(
            Answer::to_unknown(&bytes),
            Some(Answer::Refused(NO_PROTOCOL))
        );
        (bytes[5], bytes[7], bytes[8]) = (0x13, 0x20, 0x80);
        assert_eq!(Answer::to_unknown(&bytes), None);
        bytes[5] = 0x10;
        assert_eq!(Answer::to_unknown(&bytes), None);
    }

    #[test]
    fn arbitrary_bytes_never_panic() {
        let mut dice = 2u64;
        let mut bytes = [0u8; 80];
        for round in 0..100_000 {
            for byte in &mut bytes {
                dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                *byte = (dice >> 56) as u8;
            }
            let length = usize::from(bytes[2]).min(bytes.len());
            if round % 2 == 0 {
                bytes[0] = (length as u8).saturating_sub(6);
                bytes[1] = 0;
                bytes[5] = 0x13;
                bytes[7] = (bytes[7] % 4) << 4;
            }
            let bytes = &bytes[..length];
            let _ = (Request::read(bytes), Answer::read(bytes));
        }
    }
}
