//! Frames and datagrams of ETG.1000.4: an Ethernet frame of type 0x88A4 with datagrams that every device reads and changes.

use std::ops::Range;

use thiserror::Error;

/// Ethernet type of EtherCAT.
pub(crate) const ETHER_TYPE: u16 = 0x88a4;
/// Ethernet header: destination, source, type.
const ETHERNET: usize = 14;
/// The EtherCAT header behind it.
const HEADER: usize = 2;
/// Header of a datagram, and the working counter behind its data.
const DATAGRAM: usize = 10;
const COUNTER: usize = 2;
/// Shortest and longest frame without its checksum.
const SHORTEST: usize = 60;
pub(crate) const LONGEST: usize = 1514;
/// Kind of the EtherCAT header that carries datagrams.
const KIND: u16 = 1;
/// Bits of the length field of a datagram.
const LENGTH: u16 = 0x07ff;
const MORE: u16 = 0x8000;

/// Service that a datagram requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Service {
    /// Read by position.
    Aprd = 1,
    /// Write by position.
    Apwr = 2,
    /// Read and write by position.
    Aprw = 3,
    /// Read by station address.
    Fprd = 4,
    /// Write by station address.
    Fpwr = 5,
    /// Read and write by station address.
    Fprw = 6,
    /// Read from all: the data are combined by OR.
    Brd = 7,
    /// Write to all.
    Bwr = 8,
    /// Read and write all.
    Brw = 9,
    /// Read the logical image.
    Lrd = 10,
    /// Write the logical image.
    Lwr = 11,
    /// Read and write the logical image.
    Lrw = 12,
    /// Read by position, and write what was read to all that follow.
    Armw = 13,
    /// Read by station address, and write what was read to all others.
    Frmw = 14,
}

impl Service {
    const ALL: [Self; 14] = [
        Self::Aprd,
        Self::Apwr,
        Self::Aprw,
        Self::Fprd,
        Self::Fpwr,
        Self::Fprw,
        Self::Brd,
        Self::Bwr,
        Self::Brw,
        Self::Lrd,
        Self::Lwr,
        Self::Lrw,
        Self::Armw,
        Self::Frmw,
    ];

    /// The service with this number.
    pub(crate) fn of(number: u8) -> Option<Self> {
        let index = usize::from(number).checked_sub(1)?;
        Self::ALL.get(index).copied()
    }
}

/// Address of a register: a device by its position (counted down from 0 as a negative number) or its station address.
pub(crate) const fn at(device: u16, register: u16) -> u32 {
    device as u32 | (register as u32) << 16
}

/// The position of the device of number `index`, as a datagram counts it.
pub(crate) const fn position(index: u16) -> u16 {
    0u16.wrapping_sub(index)
}

/// Why bytes are no frame of datagrams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub(crate) enum FrameError {
    /// It ends before what it announces.
    #[error("the frame ends after {found} bytes, {needed} announced")]
    Short {
        /// Bytes that it needs.
        needed: usize,
        /// Bytes that are there.
        found: usize,
    },
    /// It is of another Ethernet type, or carries no datagrams.
    #[error("the frame carries no EtherCAT datagrams")]
    Foreign,
    /// The buffer has no room.
    #[error("the frame needs {needed} bytes, {found} allowed")]
    Room {
        /// Bytes that it needs.
        needed: usize,
        /// Bytes that it may have.
        found: usize,
    },
}

/// Place of one datagram in a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Datagram {
    /// Number of the service; [`Service::of`] names it.
    pub service: u8,
    /// Number that its sender gave it.
    pub index: u8,
    /// Device and register, or a logical address.
    pub address: u32,
    /// Where its data are in the frame.
    pub data: Range<usize>,
    start: usize,
}

impl Datagram {
    /// Its data.
    pub(crate) fn bytes<'f>(&self, frame: &'f [u8]) -> &'f [u8] {
        frame.get(self.data.clone()).unwrap_or_default()
    }

    /// Its data, to be changed.
    pub(crate) fn bytes_mut<'f>(&self, frame: &'f mut [u8]) -> &'f mut [u8] {
        frame.get_mut(self.data.clone()).unwrap_or_default()
    }

    /// The working counter: each device that takes part adds to it.
    pub(crate) fn counter(&self, frame: &[u8]) -> u16 {
        word(frame, self.data.end)
    }

    /// Adds to the working counter.
    pub(crate) fn count(&self, frame: &mut [u8], by: u16) {
        let counter = self.counter(frame).wrapping_add(by);
        put(frame, self.data.end, &counter.to_le_bytes());
    }

    /// Writes the address of a device.
    pub(crate) fn set_device(&self, frame: &mut [u8], device: u16) {
        put(frame, self.start + 2, &device.to_le_bytes());
    }
}

fn word(bytes: &[u8], at: usize) -> u16 {
    let pair = bytes.get(at..).and_then(|rest| rest.first_chunk());
    pair.map_or(0, |pair| u16::from_le_bytes(*pair))
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + value.len()) {
        place.copy_from_slice(value);
    }
}

/// The datagrams of a frame, in order. A wrong length ends them with an error.
pub(crate) fn datagrams(frame: &[u8]) -> Result<Datagrams<'_>, FrameError> {
    let needed = ETHERNET + HEADER;
    let found = frame.len();
    if found < needed {
        return Err(FrameError::Short { needed, found });
    }
    let kind = word(frame, 12).swap_bytes();
    let header = word(frame, ETHERNET);
    if kind != ETHER_TYPE || header >> 12 != KIND {
        return Err(FrameError::Foreign);
    }
    let end = needed + usize::from(header & LENGTH);
    if found < end {
        return Err(FrameError::Short { needed: end, found });
    }
    Ok(Datagrams {
        frame,
        next: Some(needed),
        end,
    })
}

/// See [`datagrams`].
#[derive(Debug)]
pub(crate) struct Datagrams<'f> {
    frame: &'f [u8],
    next: Option<usize>,
    end: usize,
}

impl Iterator for Datagrams<'_> {
    type Item = Result<Datagram, FrameError>;

    fn next(&mut self) -> Option<Self::Item> {
        let start = self.next.take()?;
        let (frame, found) = (self.frame, self.end);
        let needed = start + DATAGRAM + COUNTER;
        if found < needed {
            return Some(Err(FrameError::Short { needed, found }));
        }
        let length = word(frame, start + 6);
        let data = start + DATAGRAM..start + DATAGRAM + usize::from(length & LENGTH);
        let needed = data.end + COUNTER;
        if found < needed {
            return Some(Err(FrameError::Short { needed, found }));
        }
        if length & MORE != 0 {
            self.next = Some(needed);
        }
        let address = u32::from(word(frame, start + 2)) | u32::from(word(frame, start + 4)) << 16;
        Some(Ok(Datagram {
            service: frame.get(start).copied().unwrap_or_default(),
            index: frame.get(start + 1).copied().unwrap_or_default(),
            address,
            data,
            start,
        }))
    }
}

/// Writes a frame into a buffer. Real-time: yes.
#[derive(Debug)]
pub(crate) struct FrameWriter<'b> {
    buffer: &'b mut [u8],
    end: usize,
    /// Start of the last datagram.
    last: Option<usize>,
}

impl<'b> FrameWriter<'b> {
    /// A frame to all devices from `source`.
    pub(crate) fn new(buffer: &'b mut [u8], source: [u8; 6]) -> Self {
        put(buffer, 0, &[0xff; 6]);
        put(buffer, 6, &source);
        put(buffer, 12, &ETHER_TYPE.to_be_bytes());
        Self {
            buffer,
            end: ETHERNET + HEADER,
            last: None,
        }
    }

    /// Adds a datagram with these data.
    pub(crate) fn add(
        &mut self,
        (service, index): (Service, u8),
        address: u32,
        data: &[u8],
    ) -> Result<(), FrameError> {
        let place = self.reserve((service, index), address, data.len())?;
        put(self.buffer, place.start, data);
        Ok(())
    }

    /// Adds a datagram whose data are zero.
    pub(crate) fn reserve(
        &mut self,
        (service, index): (Service, u8),
        address: u32,
        length: usize,
    ) -> Result<Range<usize>, FrameError> {
        let start = self.end;
        let data = start + DATAGRAM..start + DATAGRAM + length;
        let needed = data.end + COUNTER;
        let found = self.buffer.len().min(LONGEST);
        if needed > found || length > usize::from(LENGTH) {
            return Err(FrameError::Room { needed, found });
        }
        if let Some(last) = self.last {
            let more = word(self.buffer, last + 6) | MORE;
            put(self.buffer, last + 6, &more.to_le_bytes());
        }
        let room = self.buffer.get_mut(start..needed).unwrap_or_default();
        room.fill(0);
        put(self.buffer, start, &[service as u8, index]);
        put(self.buffer, start + 2, &address.to_le_bytes());
        put(self.buffer, start + 6, &(length as u16).to_le_bytes());
        self.last = Some(start);
        self.end = needed;
        Ok(data)
    }

    /// Completes the frame; its length in bytes.
    pub(crate) fn finish(self) -> usize {
        let length = (self.end - ETHERNET - HEADER) as u16;
        put(self.buffer, ETHERNET, &(length | KIND << 12).to_le_bytes());
        let padded = self.end.max(SHORTEST).min(self.buffer.len());
        if let Some(padding) = self.buffer.get_mut(self.end..padded) {
            padding.fill(0);
        }
        padded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: [u8; 6] = [2, 0, 0, 0, 0, 1];

    #[test]
    fn broadcast_read_has_the_bytes_of_the_standard() {
        let mut buffer = [0xaa; LONGEST];
        let mut writer = FrameWriter::new(&mut buffer, SOURCE);
        writer.reserve((Service::Brd, 7), at(0, 0x0130), 2).unwrap();
        let length = writer.finish();
        assert_eq!(length, SHORTEST);
        let wanted = [
            0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 2, 0, 0, 0, 0, 1, 0x88, 0xa4, 0x0e, 0x10, 7, 7, 0,
            0, 0x30, 0x01, 2, 0, 0, 0, 0, 0, 0, 0,
        ];
        assert_eq!(buffer[..30], wanted);
        assert!(buffer[30..60].iter().all(|byte| *byte == 0));
    }

    #[test]
    fn datagrams_read_back_and_count() {
        let mut buffer = [0; LONGEST];
        let mut writer = FrameWriter::new(&mut buffer, SOURCE);
        writer.add((Service::Lrw, 1), 0x1_0000, &[1, 2, 3]).unwrap();
        writer
            .reserve((Service::Frmw, 2), at(0x1001, 0x910), 8)
            .unwrap();
        let length = writer.finish();
        let all: Vec<Datagram> = datagrams(&buffer[..length])
            .unwrap()
            .map(Result::unwrap)
            .collect();
        assert_eq!(all.len(), 2);
        assert_eq!(
            (all[0].address, all[0].bytes(&buffer)),
            (0x1_0000, &[1, 2, 3][..])
        );
        assert_eq!(Service::of(all[1].service), Some(Service::Frmw));
        assert_eq!(all[1].address, at(0x1001, 0x910));
        all[1].count(&mut buffer, 3);
        all[1].set_device(&mut buffer, 0xffff);
        let second = datagrams(&buffer[..length])
            .unwrap()
            .nth(1)
            .unwrap()
            .unwrap();
        assert_eq!(
            (second.counter(&buffer), second.address & 0xffff),
            (3, 0xffff)
        );
    }

    #[test]
    fn a_frame_never_exceeds_its_room() {
        let mut buffer = [0; LONGEST + 100];
        let mut writer = FrameWriter::new(&mut buffer, SOURCE);
        let found = writer.reserve((Service::Lrw, 0), 0, 1487);
        assert_eq!(
            found,
            Err(FrameError::Room {
                needed: 1515,
                found: LONGEST
            })
        );
        writer.reserve((Service::Lrw, 0), 0, 1486).unwrap();
        assert_eq!(writer.finish(), LONGEST);
    }

    #[test]
    fn every_truncation_is_an_error() {
        let mut buffer = [0; LONGEST];
        let mut writer = FrameWriter::new(&mut buffer, SOURCE);
        writer.add((Service::Lrw, 1), 0, &[7; 60]).unwrap();
        let length = writer.finish();
        for cut in 0..length {
            let bad = match datagrams(&buffer[..cut]) {
                Ok(mut all) => all.any(|one| one.is_err()),
                Err(_) => true,
            };
            assert!(bad, "{cut}");
        }
    }

    #[test]
    fn arbitrary_bytes_never_panic() {
        let mut dice = 1u64;
        let mut bytes = [0u8; 200];
        for round in 0..100_000 {
            for byte in &mut bytes {
                dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                *byte = (dice >> 56) as u8;
            }
            let length = usize::from(bytes[0]).min(bytes.len());
            if round % 2 == 0 {
                bytes[12..14].copy_from_slice(&ETHER_TYPE.to_be_bytes());
                bytes[15] = 0x10;
                bytes[22] %= 64;
                bytes[23] &= 0x80;
            }
            let bytes = &bytes[..length];
            if let Ok(all) = datagrams(bytes) {
                for one in all.flatten() {
                    let _ = (one.bytes(bytes), one.counter(bytes));
                }
            }
        }
    }
}
