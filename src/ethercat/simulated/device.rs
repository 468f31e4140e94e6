//! A simulated device: the registers of its ESC (ETG.1000.4), its states (ETG.1000.6), its mailbox and its process data.

use super::dictionary::Dictionary;
use super::servo::Servo;
use crate::axis_drive::Place;
use crate::plan::{DevicePlan, TimeSource};
use crate::wire::drive as words;
use crate::wire::register as reg;
use crate::wire::register::AlState;
use crate::wire::sii::{Contents, Manager, Sii};
use gusset_wire::process_data::{Entry, Kind, length};

/// Bytes of memory: registers and process data.
const MEMORY: usize = 0x3000;
/// Mailboxes and process data in the memory.
pub(super) const RECEIVE: (u16, u16) = (0x1000, 256);
pub(super) const SEND: (u16, u16) = (0x1100, 256);
pub(super) const OUTPUTS: u16 = 0x1200;
pub(super) const INPUTS: u16 = 0x2000;
/// Way of a frame from device to device, in ns.
const CABLE_NS: u64 = 100;
/// How long a device waits for its first outputs before it refuses OP.
const FIRST_OUTPUTS_NS: u64 = 200_000_000;

/// Access of a frame to a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Access {
    Read,
    Write,
    Both,
}

/// One device.
#[derive(Debug)]
pub(super) struct Device {
    pub plan: DevicePlan,
    pub memory: Vec<u8>,
    eeprom: Vec<u8>,
    pub state: AlState,
    /// A state that it refuses, with its code.
    pub refuses: Option<(AlState, u16)>,
    pub dictionary: Dictionary,
    pub answers: Vec<Vec<u8>>,
    pub count: u8,
    pub servo: Option<Servo>,
    time: TimeSource,
    index: u64,
    /// Deviation of its clock, in ppm.
    pub ppm: f64,
    /// When its outputs were last written, from SAFE-OP on.
    pub written_ns: Option<u64>,
    /// When OP was requested, while it waits for its first outputs.
    pub asked_ns: Option<u64>,
    /// It left OP on its own: what its outputs became is still to be felt.
    pub has_dropped: bool,
}

impl Device {
    pub(super) fn new(
        (index, is_last): (usize, bool),
        (plan, mark): (&DevicePlan, &str),
        time: TimeSource,
        counts: f64,
    ) -> Self {
        let manager = |(start, length): (u16, u16), control, kind| Manager {
            start,
            length,
            control,
            kind,
        };
        let name = format!("{mark}{}", plan.name);
        let sii = Sii {
            vendor: plan.vendor,
            code: plan.code,
            revision: plan.revision.unwrap_or(1),
            serial: index as u32 + 1,
            receive: RECEIVE,
            send: SEND,
            coe: true,
            name: name.clone(),
            managers: vec![
                manager(RECEIVE, 0x26, 1),
                manager(SEND, 0x22, 2),
                manager((OUTPUTS, length(&plan.outputs) as u16), 0x64, 3),
                manager((INPUTS, length(&plan.inputs) as u16), 0x20, 4),
            ],
        };
        let contents = Contents {
            sii: &sii,
            outputs: &plan.outputs,
            inputs: &plan.inputs,
        };
        let identity = [sii.vendor, sii.code, sii.revision, sii.serial];
        let mut device = Self {
            memory: vec![0; MEMORY],
            eeprom: contents.bytes(),
            dictionary: Dictionary::new(plan, &name, identity),
            state: AlState::Init,
            refuses: None,
            answers: Vec::new(),
            count: 0,
            servo: plan.drive.as_ref().map(|_| Servo::at(counts)),
            time,
            index: index as u64,
            ppm: 0.0,
            written_ns: None,
            asked_ns: None,
            has_dropped: false,
            plan: plan.clone(),
        };
        // Type, revision, build, memory units, sync managers, RAM in kB, ports and features of an ESC with a 64 bit clock.
        device.put(0, &[0x11, 0, 2, 0, 8, 8, 8, 0x0f, 0x0c, 0]);
        let last: [u8; 2] = [0x11, 0x56];
        let between: [u8; 2] = [0x31, 0x5a];
        device.put(reg::DL_STATUS, if is_last { &last } else { &between });
        device.put(reg::AL_STATUS, &[1, 0]);
        device.put(reg::WATCHDOG_DIVIDER, &2498u16.to_le_bytes());
        device.put(0x0410, &1000u16.to_le_bytes());
        device.put(reg::WATCHDOG_DATA, &1000u16.to_le_bytes());
        device
    }

    pub(super) fn put(&mut self, at: u16, bytes: &[u8]) {
        let at = usize::from(at);
        if let Some(place) = self.memory.get_mut(at..at + bytes.len()) {
            place.copy_from_slice(bytes);
        }
    }

    pub(super) fn word(&self, at: u16) -> u16 {
        let pair = self.memory.get(usize::from(at)..);
        let pair = pair.and_then(|rest| rest.first_chunk());
        pair.map_or(0, |pair| u16::from_le_bytes(*pair))
    }

    fn long(&self, at: u16) -> u64 {
        let eight = self.memory.get(usize::from(at)..);
        let eight = eight.and_then(|rest| rest.first_chunk());
        eight.map_or(0, |eight| u64::from_le_bytes(*eight))
    }

    fn local_ns(&self, now_ns: u64) -> u64 {
        let drifted = now_ns as f64 * 1e-6 * self.ppm;
        now_ns
            .wrapping_add_signed(drifted as i64)
            .wrapping_add(self.index * 1_234_567_891)
    }

    pub(super) fn station(&self) -> u16 {
        self.word(reg::STATION)
    }

    /// A datagram reads or writes registers or memory; true if it took part. `devices` is the number of devices on the bus.
    pub(super) fn access(
        &mut self,
        (access, register): (Access, u16),
        data: &mut [u8],
        combine: bool,
        (now_ns, devices): (u64, u64),
    ) -> bool {
        let range = usize::from(register)..usize::from(register) + data.len();
        if range.end > MEMORY || data.is_empty() {
            return false;
        }
        let covers = |at: u16, length: u16| {
            range.start <= usize::from(at) && range.end >= usize::from(at) + usize::from(length)
        };
        let touches = |at: u16| range.contains(&usize::from(at));
        if access != Access::Write {
            let system = self
                .local_ns(now_ns)
                .wrapping_add(self.long(reg::DC_OFFSET));
            self.put(reg::DC_TIME, &system.to_le_bytes());
        }
        let (receives, sends) = (covers(RECEIVE.0, RECEIVE.1), covers(SEND.0, SEND.1));
        if access != Access::Read && receives && self.mailbox_status(0) {
            // The mailbox is full: the message is not taken.
            return false;
        }
        if access != Access::Write && sends && !self.mailbox_status(1) {
            return false;
        }
        let written: Option<Vec<u8>> = (access == Access::Both).then(|| data.to_vec());
        if access != Access::Write {
            let from = self.memory.get(range.clone()).unwrap_or_default();
            for (to, from) in data.iter_mut().zip(from) {
                *to = if combine { *to | from } else { *from };
            }
            if sends {
                self.set_mailbox(1, false);
                self.next_answer();
            }
        }
        if access == Access::Read {
            return true;
        }
        let written = written.as_deref().unwrap_or(data);
        if register == reg::DC_TIME {
            let eight = written.first_chunk().copied().map(u64::from_le_bytes);
            if let Some(time) = eight {
                let offset = time.wrapping_sub(self.local_ns(now_ns));
                self.put(reg::DC_OFFSET, &offset.to_le_bytes());
            }
            return true;
        }
        let is_status =
            (0x0110..0x0112).contains(&register) || (0x0130..0x0136).contains(&register);
        if !is_status {
            let copy = written.len();
            if let Some(place) = self.memory.get_mut(range.start..range.start + copy) {
                place.copy_from_slice(written);
            }
        }
        if touches(reg::AL_CONTROL) {
            let control = self.memory.get(usize::from(reg::AL_CONTROL)).copied();
            self.request(control.unwrap_or_default(), now_ns);
        }
        if touches(reg::SII_CONTROL) {
            self.read_eeprom();
        }
        if register == reg::DC_RECEIVE {
            self.latch(now_ns, devices);
        }
        if receives {
            self.hear();
        }
        true
    }

    fn latch(&mut self, now_ns: u64, devices: u64) {
        let arrival = now_ns + CABLE_NS * self.index;
        let back = now_ns + CABLE_NS * (2 * (devices - 1) - self.index);
        let (first, second) = (self.local_ns(arrival), self.local_ns(back));
        self.put(reg::DC_RECEIVE, &(first as u32).to_le_bytes());
        let is_last = self.index + 1 == devices;
        let second = if is_last { 0 } else { second as u32 };
        self.put(reg::DC_RECEIVE + 4, &second.to_le_bytes());
        self.put(reg::DC_RECEIVE + 8, &[0; 8]);
        self.put(reg::DC_LOCAL_RECEIVE, &first.to_le_bytes());
    }

    fn read_eeprom(&mut self) {
        const READ: u16 = 0x0100;
        let control = self.word(reg::SII_CONTROL);
        if control & 0x0700 == READ {
            let at = 2 * usize::from(self.word(reg::SII_ADDRESS));
            let mut four = [0xff; 4];
            let from = self.eeprom.get(at..).unwrap_or_default();
            for (to, from) in four.iter_mut().zip(from) {
                *to = *from;
            }
            self.put(reg::SII_DATA, &four);
        }
        self.put(reg::SII_CONTROL, &[0, 0]);
    }

    /// The master asks for a state.
    pub(super) fn request(&mut self, control: u8, now_ns: u64) {
        let has_error = self.word(reg::AL_STATUS) & u16::from(reg::AL_ERROR) != 0;
        if has_error && control & reg::AL_ERROR == 0 {
            return;
        }
        let Some(wanted) = AlState::of(control) else {
            return self.show(self.state, 0x12);
        };
        let code = match self.refuses {
            Some((refused, code)) if refused == wanted && wanted > self.state => code,
            _ => self.refusal(wanted),
        };
        self.asked_ns = None;
        if code == 0 && self.lacks_outputs(wanted, now_ns) {
            // The answer follows with the first outputs, or with a refusal.
            self.asked_ns = Some(now_ns);
            return;
        }
        if code == 0 {
            self.enter(wanted);
        }
        self.show(self.state, code);
    }

    /// True if OP is wanted, and no outputs came within the time of the watchdog.
    fn lacks_outputs(&self, wanted: AlState, now_ns: u64) -> bool {
        let is_step = (self.state, wanted) == (AlState::SafeOp, AlState::Op);
        let age = self.written_ns.map(|at| now_ns.saturating_sub(at));
        let limit = self.watchdog_ns();
        let is_old = age.is_none_or(|age| limit > 0 && age > limit);
        is_step && !self.plan.outputs.is_empty() && is_old
    }

    fn watchdog_ns(&self) -> u64 {
        let unit = (u64::from(self.word(reg::WATCHDOG_DIVIDER)) + 2) * 40;
        unit * u64::from(self.word(reg::WATCHDOG_DATA))
    }

    pub(super) fn show(&mut self, state: AlState, code: u16) {
        let error = if code == 0 { 0 } else { reg::AL_ERROR };
        self.put(reg::AL_STATUS, &[state as u8 | error, 0]);
        self.put(reg::AL_CODE, &code.to_le_bytes());
    }

    /// Why it does not enter a state; 0 if it does.
    fn refusal(&self, wanted: AlState) -> u16 {
        use AlState as S;
        let manager = |index: u16| {
            let at = reg::SYNC_MANAGER + index * reg::SYNC_MANAGER_SIZE;
            (self.word(at), self.word(at + 2), self.word(at + 6) & 1)
        };
        let enabled = |(start, length): (u16, u16)| (start, length, 1);
        let fits = |(start, length, enabled): (u16, u16, u16), own: u16, mapped: usize| {
            usize::from(length) == mapped && (mapped == 0 || (start, enabled) == (own, 1))
        };
        if wanted <= self.state {
            return 0;
        }
        match (self.state, wanted) {
            (S::Init, S::PreOp) if [manager(0), manager(1)] != [RECEIVE, SEND].map(enabled) => 0x16,
            (S::Init, S::PreOp) | (S::SafeOp, S::Op) => 0,
            (S::PreOp, S::SafeOp) => {
                let is_synced = self.word(reg::DC_ACTIVATION) & 0x0300 == 0x0300;
                if !fits(manager(2), OUTPUTS, self.dictionary.mapped(0x1c12)) {
                    0x1d
                } else if !fits(manager(3), INPUTS, self.dictionary.mapped(0x1c13)) {
                    0x1e
                } else if self.servo.is_some() && self.time == TimeSource::Bus && !is_synced {
                    0x30
                } else {
                    0
                }
            }
            _ => 0x11,
        }
    }

    pub(super) fn enter(&mut self, wanted: AlState) {
        if self.state == AlState::Op && wanted < AlState::Op {
            self.drop_outputs();
        }
        if wanted < AlState::SafeOp {
            self.written_ns = None;
        }
        if wanted == AlState::SafeOp && self.object(words::MODE, false).is_some() {
            // Its outputs give the mode, from OP on.
            self.dictionary.set(words::MODE_DISPLAY, &[0]);
        }
        if wanted == AlState::Init {
            self.answers.clear();
            self.set_mailbox(0, false);
            self.set_mailbox(1, false);
        }
        self.state = wanted;
    }

    /// It falls to SAFE-OP on its own.
    pub(super) fn fall(&mut self, code: u16) {
        if self.state == AlState::Op {
            self.drop_outputs();
            self.state = AlState::SafeOp;
        }
        self.show(self.state, code);
    }

    /// Outputs become zero, unless a setting keeps the last value; a drive stops.
    fn drop_outputs(&mut self) {
        if let Some(servo) = &mut self.servo {
            if servo.state == words::DriveState::OperationEnabled {
                servo.fail(0x8700);
            }
        } else if self.plan.setup.is_empty() {
            let length = length(&self.plan.outputs);
            let at = usize::from(OUTPUTS);
            if let Some(place) = self.memory.get_mut(at..at + length) {
                place.fill(0);
            }
        }
        self.has_dropped = true;
    }

    /// The watchdog of its process data, and the patience for its first outputs.
    pub(super) fn watch(&mut self, now_ns: u64) {
        let limit = self.watchdog_ns();
        let age = |at: Option<u64>| at.map_or(0, |at| now_ns.saturating_sub(at));
        let has_outputs = !self.plan.outputs.is_empty();
        if self.state == AlState::Op && has_outputs && limit > 0 && age(self.written_ns) > limit {
            self.fall(0x1b);
        }
        if age(self.asked_ns) > FIRST_OUTPUTS_NS {
            self.asked_ns = None;
            self.show(self.state, 0x19);
        }
    }

    /// Its entries of one direction, and where they begin in its memory.
    fn entries(&self, is_input: bool) -> (&[Entry], usize) {
        if is_input {
            (&self.plan.inputs, INPUTS.into())
        } else {
            (&self.plan.outputs, OUTPUTS.into())
        }
    }

    /// Place of an entry in its memory.
    pub(super) fn place(&self, entry: usize, is_input: bool) -> Option<Place> {
        let (entries, start) = self.entries(is_input);
        Place::nth(entries, start, entry)
    }

    fn object(&self, index: u16, is_input: bool) -> Option<Place> {
        let (entries, start) = self.entries(is_input);
        Place::of_object(entries, start, index)
    }

    /// One tick of its drive, with the outputs that it has.
    pub(super) fn drive(&mut self) {
        let option = self.dictionary.get(words::QUICK_STOP_OPTION, 0);
        let keeps_torque = option.first().is_some_and(|option| *option >= 5);
        let read = |place: Option<Place>| place.map_or(0.0, |place| place.read(&self.memory));
        let control = read(self.object(words::CONTROLWORD, false)) as u16;
        let target = read(self.object(words::TARGET_POSITION, false));
        if let Some(place) = self.object(words::MODE, false) {
            let mode = [place.read(&self.memory) as i8 as u8];
            self.dictionary.set(words::MODE, &mode);
            self.dictionary.set(words::MODE_DISPLAY, &mode);
        }
        let mode = self.mode();
        if let Some(servo) = &mut self.servo {
            // It follows its target in this mode only.
            let follows = mode == words::CYCLIC_POSITION;
            let target = if follows { target } else { servo.counts };
            servo.go_on(control, target, keeps_torque);
        }
    }

    /// The mode that its drive shows.
    fn mode(&self) -> i8 {
        let mode = self.dictionary.get(words::MODE_DISPLAY, 0).first();
        mode.map_or(0, |mode| *mode as i8)
    }

    /// Writes the inputs of its drive, whose axis is at `counts`.
    pub(super) fn show_drive(&mut self, counts: f64) {
        let Some(servo) = &self.servo else {
            return;
        };
        let mode = f64::from(self.mode());
        for (index, value) in [
            (words::STATUSWORD, f64::from(servo.status())),
            (words::ACTUAL_POSITION, counts),
            (words::ERROR_CODE, f64::from(servo.error)),
            (words::MODE_DISPLAY, mode),
        ] {
            if let Some(place) = self.object(index, true) {
                place.write(value, &mut self.memory);
            }
        }
    }

    /// Reads flags of an input, and writes them.
    pub(super) fn set_flags(&mut self, entry: usize, value: u32) {
        if let Some(place) = self.place(entry, true) {
            let value = if matches!(place.kind, Kind::I8 | Kind::I16 | Kind::I32) {
                f64::from(value as i32)
            } else {
                f64::from(value)
            };
            place.write(value, &mut self.memory);
        }
    }
}
