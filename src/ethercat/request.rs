//! Requests outside the process data: registers, EEPROM, states and mailboxes. Not for the path of a tick.

use gusset_quantity::time::Nanos;

use crate::error::BusError;
use crate::line::{Line, LineFault};
use crate::plan::DevicePlan;
use crate::wire::coe::{Answer, Object, Request, SHORTEST_MESSAGE, abort_text};
use crate::wire::datagram::{FrameWriter, LONGEST, Service, at, datagrams};
use crate::wire::register as reg;
use crate::wire::register::AlState;
use crate::wire::sii::Sii;

/// How long a frame is awaited, and how often it is sent.
const REPLY_NS: u64 = 5_000_000;
const TRIES: u32 = 3;
/// How long an EEPROM, a mailbox and a state may take.
const EEPROM_NS: u64 = 100_000_000;
const MAILBOX_NS: u64 = 1_000_000_000;
const STATE_NS: u64 = 5_000_000_000;
/// Time between two looks at something that takes its time.
const LOOK_NS: u64 = 50_000;
/// Largest object that is read in parts.
const MOST_BYTES: usize = 4096;

/// A device under its station address.
#[derive(Debug, Clone)]
pub(crate) struct Station {
    /// Its name in messages.
    pub name: String,
    pub address: u16,
    /// Start and length of the mailbox that it receives from, and of the one that it sends by; none without CoE.
    pub mailbox: Option<[(u16, u16); 2]>,
    /// Running number of the mailbox, from 1 to 7.
    count: u8,
}

/// A device with its station and its EEPROM.
pub(crate) struct Known<'p> {
    pub plan: &'p DevicePlan,
    pub station: Station,
    pub sii: Sii,
}

impl Station {
    pub(crate) fn new(name: &str, address: u16) -> Self {
        Self {
            name: name.to_owned(),
            address,
            mailbox: None,
            count: 0,
        }
    }

    pub(crate) fn silent(&self, what: &'static str) -> BusError {
        BusError::Silent {
            device: self.name.clone(),
            what,
        }
    }

    fn refuses(&self, object: Object, why: impl Into<String>) -> BusError {
        BusError::Object {
            device: self.name.clone(),
            index: object.index,
            sub: object.sub,
            abort: None,
            why: why.into(),
        }
    }
}

/// Sends single datagrams and waits for each.
pub(crate) struct Requests<'l> {
    pub line: &'l mut dyn Line,
    source: [u8; 6],
    index: u8,
    /// How long a change of state may take, in ns.
    pub patience_ns: u64,
    out: [u8; LONGEST],
    back: [u8; LONGEST],
}

impl<'l> Requests<'l> {
    pub(crate) fn new(line: &'l mut dyn Line, source: [u8; 6]) -> Self {
        Self {
            line,
            source,
            index: 0,
            patience_ns: STATE_NS,
            out: [0; LONGEST],
            back: [0; LONGEST],
        }
    }

    /// Listens for the frames of another master.
    pub(crate) fn listen(&mut self, ns: u64) -> Result<(), BusError> {
        let until = self.line.now().plus(ns);
        while let Some(length) = self.line.receive(&mut self.back, until)? {
            let frame = self.back.get(..length).unwrap_or_default();
            if !is_ours(frame, self.source) {
                return Err(LineFault::Foreign.into());
            }
        }
        Ok(())
    }

    /// Sends a datagram and takes the data that come back; the working counter, 0 if no frame came back.
    pub(crate) fn ask(
        &mut self,
        service: Service,
        address: u32,
        data: &mut [u8],
    ) -> Result<u16, BusError> {
        for _ in 0..TRIES {
            self.index = self.index.wrapping_add(1);
            let mut writer = FrameWriter::new(&mut self.out, self.source);
            if writer.add((service, self.index), address, data).is_err() {
                return Ok(0);
            }
            let length = writer.finish();
            self.line.send(self.out.get(..length).unwrap_or_default())?;
            let deadline = self.line.now().plus(REPLY_NS);
            while let Some(length) = self.line.receive(&mut self.back, deadline)? {
                let frame = self.back.get(..length).unwrap_or_default();
                if !is_ours(frame, self.source) {
                    return Err(LineFault::Foreign.into());
                }
                let first = datagrams(frame).ok().and_then(|mut all| all.next());
                let Some(Ok(reply)) = first else {
                    continue;
                };
                let bytes = reply.bytes(frame);
                // A late reply to an earlier request may have the same number.
                let is_same =
                    (reply.service, reply.address >> 16) == (service as u8, address >> 16);
                if reply.index == self.index && is_same && bytes.len() == data.len() {
                    data.copy_from_slice(bytes);
                    return Ok(reply.counter(frame));
                }
            }
        }
        Ok(0)
    }

    /// Reads a register of one device.
    pub(crate) fn read<const N: usize>(
        &mut self,
        station: &Station,
        register: u16,
    ) -> Result<[u8; N], BusError> {
        let mut data = [0; N];
        let address = at(station.address, register);
        match self.ask(Service::Fprd, address, &mut data)? {
            1 => Ok(data),
            _ => Err(station.silent("a register was read")),
        }
    }

    /// Writes a register of one device.
    pub(crate) fn write(
        &mut self,
        station: &Station,
        register: u16,
        data: &[u8],
    ) -> Result<(), BusError> {
        let mut copy = [0; LONGEST];
        let Some(copy) = copy.get_mut(..data.len()) else {
            return Err(BusError::Size {
                found: data.len(),
                allowed: LONGEST,
            });
        };
        copy.copy_from_slice(data);
        match self.ask(Service::Fpwr, at(station.address, register), copy)? {
            1 => Ok(()),
            _ => Err(station.silent("a register was written")),
        }
    }

    /// Writes a register of all devices; how many took it.
    pub(crate) fn write_all(&mut self, register: u16, data: &[u8]) -> Result<u16, BusError> {
        let mut copy = [0; LONGEST];
        let copy = copy.get_mut(..data.len()).unwrap_or_default();
        copy.copy_from_slice(data);
        self.ask(Service::Bwr, at(0, register), copy)
    }

    fn pause(&mut self) {
        let now = self.line.now();
        self.line.wait_until(now.plus(LOOK_NS));
    }

    /// Reads the EEPROM of a device.
    pub(crate) fn sii(&mut self, station: &Station) -> Result<Sii, BusError> {
        // The master takes the access, by force if the device holds it.
        self.write(station, reg::SII_ACCESS, &[2])?;
        self.write(station, reg::SII_ACCESS, &[0])?;
        let mut fault = None;
        let sii = Sii::read(|address| match self.sii_words(station, address) {
            Ok(words) => Some(words),
            Err(error) => {
                fault = Some(error);
                None
            }
        });
        let access = self.write(station, reg::SII_ACCESS, &[1]);
        match (fault, sii) {
            (None, Some(sii)) => access.map(|()| sii),
            (Some(error), _) => Err(error),
            (None, None) => Err(station.silent("its EEPROM was read")),
        }
    }

    fn sii_words(&mut self, station: &Station, address: u16) -> Result<u32, BusError> {
        const READ: [u8; 2] = [0x00, 0x01];
        const BUSY: u16 = 0x8000;
        const ERRORS: u16 = 0x7800;
        let [low, high] = address.to_le_bytes();
        let request = [READ[0], READ[1], low, high, 0, 0];
        self.write(station, reg::SII_CONTROL, &request)?;
        let until = self.line.now().plus(EEPROM_NS);
        loop {
            let status = u16::from_le_bytes(self.read(station, reg::SII_CONTROL)?);
            if status & ERRORS != 0 {
                return Err(station.silent("its EEPROM reports an error"));
            }
            if status & BUSY == 0 {
                return Ok(u32::from_le_bytes(self.read(station, reg::SII_DATA)?));
            }
            if self.line.now() > until {
                return Err(station.silent("its EEPROM was read"));
            }
            self.pause();
        }
    }

    /// The state of a device, and whether it has an error, with its code.
    pub(crate) fn state(
        &mut self,
        station: &Station,
    ) -> Result<(Option<AlState>, bool, u16), BusError> {
        let status: [u8; 6] = self.read(station, reg::AL_STATUS)?;
        let code = u16::from_le_bytes([status[4], status[5]]);
        let error = status[0] & reg::AL_ERROR != 0;
        Ok((AlState::of(status[0]), error, code))
    }

    /// Asks a device for a state; it takes its time.
    pub(crate) fn request_state(
        &mut self,
        station: &Station,
        wanted: AlState,
    ) -> Result<(), BusError> {
        self.write(station, reg::AL_CONTROL, &[wanted as u8, 0])
    }

    /// Brings all devices to INIT, and acknowledges their errors.
    pub(crate) fn all_to_init(&mut self) -> Result<(), BusError> {
        let init = [AlState::Init as u8 | reg::AL_ERROR, 0];
        self.write_all(reg::AL_CONTROL, &init).map(drop)
    }

    /// Waits until a device has the state. `meanwhile` is called again and again.
    pub(crate) fn await_state(
        &mut self,
        station: &Station,
        wanted: AlState,
    ) -> Result<(), BusError> {
        let until = self.line.now().plus(self.patience_ns);
        loop {
            let (found, error, code) = self.state(station)?;
            if found == Some(wanted) && !error {
                return Ok(());
            }
            if error || self.line.now() > until {
                return Err(BusError::State {
                    device: station.name.clone(),
                    wanted,
                    found,
                    code,
                });
            }
            self.pause();
        }
    }

    /// Reads an object.
    pub(crate) fn upload(
        &mut self,
        station: &mut Station,
        object: Object,
    ) -> Result<Vec<u8>, BusError> {
        let message = self.converse(station, object, &Request::Upload(object))?;
        let Some(Answer::Uploaded(_, data, size)) = Answer::read(&message) else {
            return Err(station.refuses(object, "it gives another answer"));
        };
        if size > MOST_BYTES {
            return Err(station.refuses(object, format!("it has {size} bytes")));
        }
        let mut all = data.to_vec();
        let mut toggle = false;
        while all.len() < size {
            let message = self.converse(station, object, &Request::UploadSegment(toggle))?;
            match Answer::read(&message) {
                Some(Answer::Segment(same, last, data)) if same == toggle => {
                    all.extend(data);
                    if last || data.is_empty() {
                        break;
                    }
                }
                _ => return Err(station.refuses(object, "it gives another answer")),
            }
            toggle = !toggle;
        }
        Ok(all)
    }

    /// Reads an object of this length.
    pub(crate) fn upload_exact<const N: usize>(
        &mut self,
        station: &mut Station,
        object: Object,
    ) -> Result<[u8; N], BusError> {
        let data = self.upload(station, object)?;
        let found = data.len();
        data.try_into()
            .map_err(|_| station.refuses(object, format!("it has {found} bytes, {N} are expected")))
    }

    /// Writes an object.
    pub(crate) fn download(
        &mut self,
        station: &mut Station,
        object: Object,
        data: &[u8],
    ) -> Result<(), BusError> {
        let message = self.converse(station, object, &Request::Download(object, data))?;
        match Answer::read(&message) {
            Some(Answer::Downloaded(_)) => Ok(()),
            _ => Err(station.refuses(object, "it gives another answer")),
        }
    }

    /// Sends a request to a mailbox and takes the answer to it. An emergency in between is no answer.
    fn converse(
        &mut self,
        station: &mut Station,
        object: Object,
        request: &Request<'_>,
    ) -> Result<Vec<u8>, BusError> {
        let Some([receive, send]) = station.mailbox else {
            return Err(station.refuses(object, "it has no mailbox"));
        };
        let until = self.line.now().plus(MAILBOX_NS);
        let mut emergency = None;
        // An earlier message is no answer.
        while self.is_full(station, 1)? {
            self.mailbox(station, send)?;
        }
        station.count = station.count % 7 + 1;
        let mut message = vec![0; usize::from(receive.1)];
        if request.write(station.count, &mut message).is_none() {
            return Err(station.refuses(object, "the value is longer than its mailbox"));
        }
        while self.is_full(station, 0)? {
            self.patience(station, until, "its mailbox is full")?;
        }
        self.write(station, receive.0, &message)?;
        loop {
            while !self.is_full(station, 1)? {
                if let (Some(code), true) = (emergency, self.line.now() > until) {
                    let why = format!("it reported the emergency {code:#06x} and gives no answer");
                    return Err(station.refuses(object, why));
                }
                self.patience(station, until, "its mailbox gives no answer")?;
            }
            let message = self.mailbox(station, send)?;
            match Answer::read(&message) {
                Some(Answer::Aborted(_, code)) => {
                    return Err(BusError::Object {
                        device: station.name.clone(),
                        index: object.index,
                        sub: object.sub,
                        abort: Some(code),
                        why: format!("{} (abort code {code:#010x})", abort_text(code)),
                    });
                }
                // An answer to an earlier request came late.
                Some(Answer::Uploaded(other, ..) | Answer::Downloaded(other))
                    if other != object => {}
                Some(Answer::Refused(code)) => {
                    let why = format!("its mailbox reports the error {code:#06x}");
                    return Err(station.refuses(object, why));
                }
                Some(Answer::Emergency(code)) => emergency = Some(code),
                Some(Answer::Other) | None => {}
                Some(_) => return Ok(message),
            }
        }
    }

    fn patience(
        &mut self,
        station: &Station,
        until: Nanos,
        what: &'static str,
    ) -> Result<(), BusError> {
        if self.line.now() > until {
            return Err(station.silent(what));
        }
        self.pause();
        Ok(())
    }

    fn is_full(&mut self, station: &Station, manager: u16) -> Result<bool, BusError> {
        let register =
            reg::SYNC_MANAGER + manager * reg::SYNC_MANAGER_SIZE + reg::SYNC_MANAGER_STATUS;
        let status: [u8; 1] = self.read(station, register)?;
        Ok(status[0] & reg::MAILBOX_FULL != 0)
    }

    fn mailbox(
        &mut self,
        station: &Station,
        (start, length): (u16, u16),
    ) -> Result<Vec<u8>, BusError> {
        let mut message = vec![0; usize::from(length).max(SHORTEST_MESSAGE)];
        match self.ask(Service::Fprd, at(station.address, start), &mut message)? {
            1 => Ok(message),
            _ => Err(station.silent("its mailbox was read")),
        }
    }
}

/// True of a frame that this program sent: the first device changes a bit of the first byte of the source.
pub(crate) fn is_ours(frame: &[u8], source: [u8; 6]) -> bool {
    frame.get(7..12) == source.get(1..)
}
