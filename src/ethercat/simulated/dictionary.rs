//! The objects of a simulated device, and the answers of its mailbox.

use std::collections::BTreeMap;

use crate::plan::DevicePlan;
use crate::wire::coe;
use crate::wire::coe::{Answer, Object, Request};
use crate::wire::drive as words;
use gusset_wire::process_data::Entry;

/// An object: its bytes, and when it may be written.
#[derive(Debug, Clone)]
struct Value {
    bytes: Vec<u8>,
    is_writable: bool,
}

/// All objects.
#[derive(Debug)]
pub(crate) struct Dictionary {
    objects: BTreeMap<(u16, u8), Value>,
    /// Rest of an object that is read in parts.
    upload: Vec<u8>,
    toggle: bool,
}

impl Dictionary {
    /// The objects of a device of this plan.
    pub(crate) fn new(plan: &DevicePlan, name: &str, identity: [u32; 4]) -> Self {
        let mut own = Self {
            objects: BTreeMap::new(),
            upload: Vec::new(),
            toggle: false,
        };
        own.add(0x1000, 0, &0x0000_1389u32.to_le_bytes(), false);
        own.add(0x1008, 0, name.as_bytes(), false);
        own.add(0x1018, 0, &[4], false);
        for (sub, number) in (1..).zip(identity) {
            own.add(0x1018, sub, &number.to_le_bytes(), false);
        }
        own.add(0x1c00, 0, &[4], false);
        for (sub, kind) in (1..).zip([1u8, 2, 3, 4]) {
            own.add(0x1c00, sub, &[kind], false);
        }
        own.map((0x1c12, 0x1600), &plan.outputs, plan.assign);
        own.map((0x1c13, 0x1a00), &plan.inputs, plan.assign);
        for (index, entries) in [(0x1c32, &plan.outputs), (0x1c33, &plan.inputs)] {
            if !entries.is_empty() {
                // Synchronisation: its type and its cycle.
                own.add(index, 0, &[2], false);
                own.add(index, 1, &1u16.to_le_bytes(), true);
                own.add(index, 2, &[0; 4], true);
            }
        }
        if plan.drive.is_some() {
            own.add(words::ERROR_CODE, 0, &[0; 2], false);
            own.add(words::CONTROLWORD, 0, &[0; 2], true);
            own.add(words::STATUSWORD, 0, &[0x40, 0], false);
            own.add(words::QUICK_STOP_OPTION, 0, &6i16.to_le_bytes(), true);
            own.add(words::MODE, 0, &[0], true);
            own.add(words::MODE_DISPLAY, 0, &[0], false);
            own.add(words::ACTUAL_POSITION, 0, &[0; 4], false);
            own.add(words::FOLLOWING_WINDOW, 0, &1000u32.to_le_bytes(), true);
            own.add(words::TARGET_POSITION, 0, &[0; 4], true);
            own.add(words::INTERPOLATION_TIME, 0, &[2], false);
            own.add(words::INTERPOLATION_TIME, 1, &[1], true);
            own.add(words::INTERPOLATION_TIME, 2, &[0xfd], true);
        }
        for write in &plan.setup {
            let Entry {
                index, sub, kind, ..
            } = write.entry;
            if !own.objects.contains_key(&(index, sub)) {
                own.add(index, sub, &vec![0; kind.bytes()], true);
            }
        }
        own
    }

    fn add(&mut self, index: u16, sub: u8, bytes: &[u8], is_writable: bool) {
        let bytes = bytes.to_vec();
        let value = Value { bytes, is_writable };
        self.objects.insert((index, sub), value);
    }

    /// One PDO with these entries. All subindices of a list exist if it may be written.
    fn map(&mut self, (assignment, pdo): (u16, u16), entries: &[Entry], assign: bool) {
        let count = entries.len() as u8;
        self.add(assignment, 0, &[u8::from(count > 0)], assign);
        self.add(assignment, 1, &pdo.to_le_bytes(), assign);
        self.add(pdo, 0, &[count], assign);
        for (sub, entry) in (1..).zip(entries) {
            let [low, high] = entry.index.to_le_bytes();
            let bits = 8 * entry.kind.bytes() as u8;
            self.add(pdo, sub, &[bits, entry.sub, low, high], assign);
        }
        if assign {
            for sub in count + 1..=32 {
                self.add(pdo, sub, &[0; 4], true);
            }
        }
    }

    pub(crate) fn get(&self, index: u16, sub: u8) -> &[u8] {
        let value = self.objects.get(&(index, sub));
        value.map_or(&[], |value| &value.bytes)
    }

    /// Writes an object of the same length in place.
    pub(crate) fn set(&mut self, index: u16, bytes: &[u8]) {
        if let Some(value) = self.objects.get_mut(&(index, 0))
            && value.bytes.len() == bytes.len()
        {
            value.bytes.copy_from_slice(bytes);
        }
    }

    /// Length in bytes of the process data that an assignment maps.
    pub(crate) fn mapped(&self, assignment: u16) -> usize {
        let number = |index, sub| self.get(index, sub).first().copied().unwrap_or_default();
        let pdos = (1..=number(assignment, 0)).filter_map(|sub| {
            let pdo = self.get(assignment, sub).first_chunk()?;
            Some(u16::from_le_bytes(*pdo))
        });
        pdos.map(|pdo| {
            let bits = (1..=number(pdo, 0)).map(|sub| usize::from(number(pdo, sub)));
            bits.sum::<usize>() / 8
        })
        .sum()
    }

    /// Answers a message of the master; `maps`: the mapping may be written now.
    pub(crate) fn answer(&mut self, message: &[u8], count: u8, maps: bool) -> Option<Vec<u8>> {
        let mut out = vec![0; message.len()];
        let Some(request) = Request::read(message) else {
            let answer = Answer::to_unknown(message)?;
            return answer.write(count, &mut out).map(|_| out);
        };
        let room = message.len().saturating_sub(coe::SHORTEST_MESSAGE);
        let length = match request {
            Request::Upload(object) => self.begin_upload(object, room, (count, &mut out)),
            Request::UploadSegment(toggle) => self.go_on(toggle, room, (count, &mut out)),
            Request::Download(object, data) => {
                let answer = match self.download(object, data, maps) {
                    Ok(()) => Answer::Downloaded(object),
                    Err(code) => Answer::Aborted(object, code),
                };
                answer.write(count, &mut out)
            }
            Request::Complete(object) => {
                Answer::Aborted(object, coe::NO_ACCESS).write(count, &mut out)
            }
            Request::DownloadSegment(..) => {
                let object = Object { index: 0, sub: 0 };
                Answer::Aborted(object, coe::NOT_WRITABLE).write(count, &mut out)
            }
        };
        length.map(|_| out)
    }

    fn begin_upload(
        &mut self,
        object: Object,
        room: usize,
        (count, out): (u8, &mut [u8]),
    ) -> Option<usize> {
        let Some(value) = self.objects.get(&(object.index, object.sub)) else {
            return Answer::Aborted(object, self.missing(object)).write(count, out);
        };
        let bytes = value.bytes.clone();
        let part = bytes.get(..bytes.len().min(room.max(4)))?;
        self.upload = bytes.get(part.len()..)?.to_vec();
        self.toggle = false;
        Answer::Uploaded(object, part, bytes.len()).write(count, out)
    }

    fn go_on(&mut self, toggle: bool, room: usize, (count, out): (u8, &mut [u8])) -> Option<usize> {
        if toggle != self.toggle || self.upload.is_empty() {
            let object = Object { index: 0, sub: 0 };
            return Answer::Aborted(object, coe::TOGGLE_WRONG).write(count, out);
        }
        let rest = std::mem::take(&mut self.upload);
        let part = rest.get(..rest.len().min(room.max(7)))?;
        self.upload = rest.get(part.len()..)?.to_vec();
        self.toggle = !toggle;
        Answer::Segment(toggle, self.upload.is_empty(), part).write(count, out)
    }

    fn missing(&self, object: Object) -> u32 {
        let has_index = self.objects.keys().any(|(index, _)| *index == object.index);
        if has_index {
            coe::NO_SUBINDEX
        } else {
            coe::NO_OBJECT
        }
    }

    fn download(&mut self, object: Object, data: &[u8], maps: bool) -> Result<(), u32> {
        let is_mapping = matches!(object.index, 0x1600 | 0x1a00 | 0x1c12 | 0x1c13);
        let missing = self.missing(object);
        let is_locked = is_mapping && object.sub > 0 && self.get(object.index, 0) != [0];
        let value = self.objects.get_mut(&(object.index, object.sub));
        let value = value.ok_or(missing)?;
        if !value.is_writable {
            return Err(coe::NOT_WRITABLE);
        }
        if is_mapping && (!maps || is_locked) {
            return Err(coe::NOT_NOW);
        }
        if value.bytes.len() != data.len() {
            return Err(coe::WRONG_LENGTH);
        }
        value.bytes.copy_from_slice(data);
        if object.index == words::MODE {
            let mode = data.to_vec();
            self.set(words::MODE_DISPLAY, &mode);
        }
        Ok(())
    }
}
