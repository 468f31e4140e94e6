//! The cycle: one exchange of process data a tick, and whether it was complete.
//!
//! A tick is valid if every reply came, if the working counter is the sum that the mapping gives, and if all devices read exactly the
//! expected state. In any other tick the inputs are not taken: the last good values stand. Nothing here allocates after the bring-up.

use std::ops::Range;
use std::sync::Arc;

use gusset_quantity::substructure::LinkStats;
use gusset_quantity::time::Nanos;

use crate::axis_drive::{Drive, Place};
use crate::error::BusError;
use crate::follow::{BusTime, Follower};
use crate::line::{Line, LineFault};
use crate::plan::{BusPlan, EntryPlace};
use crate::request::{Requests, is_ours};
use crate::wire::datagram::{Datagram, FrameWriter, LONGEST, Service, at, datagrams};
use crate::wire::drive::DriveState;
use crate::wire::register as reg;
use crate::wire::register::AlState;
use gusset_wire::process_data::Entry;

/// Longest wait for a reply, as a share of the period.
const REPLY_SHARE: (u64, u64) = (3, 4);

/// Most bytes of process data: the frame has to hold the clock and two states besides.
const MOST_BYTES: usize = 1400;

/// One device and its part of the image.
#[derive(Debug)]
pub(crate) struct Member {
    pub name: String,
    pub station: u16,
    pub outputs: Range<usize>,
    pub inputs: Range<usize>,
}

/// Result of the last exchange.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// Complete.
    Valid,
    /// No reply came.
    Silent,
    /// A device did not take part, or has another state.
    Incomplete,
    /// The line is down, or carries the frames of another master.
    Broken,
}

/// A bus in SAFE-OP or OP.
pub struct Bus {
    line: Box<dyn Line>,
    plan: BusPlan,
    source: [u8; 6],
    members: Vec<Member>,
    is_simulated: bool,
    keeps_state: bool,
    /// Station with the reference clock.
    reference: Option<u16>,
    follower: Option<Follower>,
    /// Outputs of all devices, then inputs.
    image: Vec<u8>,
    drives: Vec<Drive>,
    out: Vec<u8>,
    back: Vec<u8>,
    tally: Tally,
}

/// Results and counts of the exchanges.
#[derive(Debug)]
struct Tally {
    index: u8,
    /// When the last frame left.
    sent: Nanos,
    outcome: Outcome,
    /// State that all devices are to have, and the bits that they have.
    wanted: AlState,
    states: u8,
    /// Ticks in a row that were not valid.
    stale: u32,
    /// Device whose state is read in this exchange, from 0, and the first one that had another state or an error.
    asked: usize,
    culprit: Option<(usize, u8, u16)>,
    line_fault: Option<LineFault>,
    /// The clock of the bus was not near the expected time in the last exchange.
    has_jumped: bool,
    stats: LinkStats,
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bus")
            .field("members", &self.members)
            .field("tally", &self.tally)
            .finish_non_exhaustive()
    }
}

impl Bus {
    pub(crate) fn new(
        line: Box<dyn Line>,
        plan: BusPlan,
        source: [u8; 6],
        (members, reference, is_simulated, keeps_state): (Vec<Member>, Option<u16>, bool, bool),
    ) -> Result<Self, BusError> {
        let length = members.last().map_or(0, |one| one.inputs.end);
        if length > MOST_BYTES {
            let found = length;
            let allowed = MOST_BYTES;
            return Err(BusError::Size { found, allowed });
        }
        let period_s = plan.period_ns as f64 * 1e-9;
        let each = plan.devices.iter().zip(&members).enumerate();
        let drives = each.filter_map(|(index, (device, member))| {
            let drive = device.drive.as_ref()?;
            let starts = [member.outputs.start, member.inputs.start];
            Some(Drive::new((index, device, drive), starts, period_s))
        });
        Ok(Self {
            image: vec![0; length],
            drives: drives.collect::<Result<_, _>>()?,
            tally: Tally {
                index: 0,
                sent: line.now(),
                outcome: Outcome::Silent,
                wanted: AlState::SafeOp,
                states: 0,
                stale: 0,
                asked: 0,
                culprit: None,
                line_fault: None,
                has_jumped: false,
                stats: LinkStats::default(),
            },
            line,
            plan,
            source,
            members,
            is_simulated,
            keeps_state,
            reference,
            follower: None,
            out: vec![0; LONGEST],
            back: vec![0; LONGEST],
        })
    }

    /// From here on the offset of the bus clock is published there.
    pub(crate) fn follow(&mut self, time: Arc<BusTime>) {
        if self.reference.is_some() {
            self.follower = Some(Follower::new(time, self.plan.period_ns));
        }
    }

    /// True if the devices or the line say that nothing moves.
    pub(crate) fn is_simulated(&self) -> bool {
        self.is_simulated || self.line.is_simulated()
    }

    /// True if the devices are simulated, and keep the specimens of an earlier test.
    pub(crate) const fn keeps_state(&self) -> bool {
        self.keeps_state
    }

    /// The state that all devices are to have.
    pub(crate) const fn state(&self) -> AlState {
        self.tally.wanted
    }

    pub(crate) const fn plan(&self) -> &BusPlan {
        &self.plan
    }

    pub(crate) const fn stats(&self) -> LinkStats {
        self.tally.stats
    }

    /// When the last exchange began.
    pub(crate) const fn sent(&self) -> Nanos {
        self.tally.sent
    }

    #[cfg(test)]
    pub(crate) fn now(&self) -> Nanos {
        self.line.now()
    }

    pub(crate) fn wait_until(&mut self, at: Nanos) {
        self.line.wait_until(at);
    }

    /// The place of an entry in the image: of an input, or of an output.
    pub(crate) fn place(&self, at: EntryPlace, is_input: bool) -> Option<Place> {
        let (device, member) = (
            self.plan.devices.get(at.device)?,
            self.members.get(at.device)?,
        );
        let (entries, start): (&[Entry], usize) = if is_input {
            (&device.inputs, member.inputs.start)
        } else {
            (&device.outputs, member.outputs.start)
        };
        Place::nth(entries, start, at.entry)
    }

    /// The drive of a device, from 0, among all drives.
    pub(crate) fn drive_of(&self, device: usize) -> Option<usize> {
        self.drives.iter().position(|drive| drive.device == device)
    }

    pub(crate) fn drive(&mut self, index: usize) -> Option<(&mut Drive, &mut [u8])> {
        let drive = self.drives.get_mut(index)?;
        Some((drive, &mut self.image))
    }

    pub(crate) fn image(&mut self) -> &mut [u8] {
        &mut self.image
    }

    fn outputs(&self) -> usize {
        self.members.last().map_or(0, |member| member.outputs.end)
    }

    /// Sends the outputs of this tick. Real-time: yes.
    pub(crate) fn send(&mut self) {
        for drive in &mut self.drives {
            drive.prepare(&mut self.image);
        }
        let tally = &mut self.tally;
        tally.index = tally.index.wrapping_add(1);
        tally.asked = (tally.asked + 1) % self.members.len().max(1);
        tally.outcome = Outcome::Silent;
        if tally.stale > 0 {
            // Something is wrong: the state of every device is read, from the first on, as far as the frame has room.
            tally.asked = 0;
        }
        let stations = self.members.iter().map(|one| one.station);
        let most = if tally.stale > 0 { usize::MAX } else { 1 };
        let mut writer = FrameWriter::new(&mut self.out, self.source);
        let index = tally.index;
        // The bring-up has made sure that all of it fits.
        let _ = writer.add((Service::Lrw, index), 0, &self.image);
        if let Some(reference) = self.reference {
            let _ = writer.reserve((Service::Frmw, index), at(reference, reg::DC_TIME), 8);
        }
        let _ = writer.reserve((Service::Brd, index), at(0, reg::AL_STATUS), 1);
        for station in stations.skip(tally.asked).take(most) {
            let address = at(station, reg::AL_STATUS);
            if writer.reserve((Service::Fprd, index), address, 6).is_err() {
                break;
            }
        }
        let length = writer.finish();
        tally.sent = self.line.now();
        match self.line.send(self.out.get(..length).unwrap_or_default()) {
            // The frame has not left, and nothing comes back: the tick is stale.
            Ok(()) | Err(LineFault::Full) => {}
            Err(fault) => self.breaks(fault),
        }
    }

    /// Takes the reply to the last frame that this end sent, if it comes by the deadline. Real-time: yes.
    fn reply(&mut self, deadline: Nanos) -> Option<usize> {
        loop {
            match self.line.receive(&mut self.back, deadline) {
                Ok(Some(length)) => {
                    let frame = self.back.get(..length).unwrap_or_default();
                    if !is_ours(frame, self.source) {
                        self.breaks(LineFault::Foreign);
                        return None;
                    }
                    let first = datagrams(frame).ok().and_then(|mut all| all.next());
                    match first {
                        Some(Ok(first)) if first.index == self.tally.index => return Some(length),
                        Some(Ok(_)) => self.tally.stats.late += 1,
                        _ => self.tally.stats.corrupt += 1,
                    }
                }
                Ok(None) => return None,
                Err(fault) => {
                    self.breaks(fault);
                    return None;
                }
            }
        }
    }

    fn breaks(&mut self, fault: LineFault) {
        self.tally.outcome = Outcome::Broken;
        self.tally.line_fault = Some(fault);
    }

    /// Until when a reply to the last frame is awaited.
    fn reply_ends(&self) -> Nanos {
        let (part, whole) = REPLY_SHARE;
        self.tally.sent.plus(self.plan.period_ns * part / whole)
    }

    /// Until when the inputs of this tick are awaited on simulated time: the loop takes them by then.
    pub(crate) fn tick_ends(&self) -> Nanos {
        self.tally.sent.plus(self.plan.period_ns / 8 * 7)
    }

    /// Takes the inputs of this tick; true if the exchange was complete. Real-time: yes.
    pub(crate) fn receive(&mut self, deadline: Nanos) -> bool {
        if self.tally.outcome != Outcome::Broken
            && let Some(length) = self.reply(deadline)
        {
            self.judge(length);
        }
        let is_valid = self.tally.outcome == Outcome::Valid;
        self.tally.stale = match (is_valid, self.plan.sample_after_ns) {
            (false, _) => self.tally.stale.saturating_add(1),
            (true, None) => 0,
            // The tick is complete with its sample.
            (true, Some(_)) => self.tally.stale,
        };
        is_valid
    }

    /// Judges the reply of this length, and takes its inputs if it is valid. Real-time: yes.
    fn judge(&mut self, length: usize) {
        let frame = self.back.get(..length).unwrap_or_default();
        let Ok(mut all) = datagrams(frame) else {
            return;
        };
        let mut next = |service: Service| -> Option<Datagram> {
            let one = all.next()?.ok()?;
            (one.service == service as u8).then_some(one)
        };
        let image = next(Service::Lrw);
        let time = match self.reference {
            Some(_) => next(Service::Frmw),
            None => None,
        };
        let (Some(image), Some(states)) = (image, next(Service::Brd)) else {
            self.tally.outcome = Outcome::Incomplete;
            return;
        };
        let tally = &mut self.tally;
        for device in tally.asked.. {
            let Some(asked) = next(Service::Fprd) else {
                break;
            };
            let own = asked.bytes(frame).first_chunk::<6>();
            let own = own.copied().unwrap_or_default();
            let answers = asked.counter(frame) == 1;
            let is_right = answers && own[0] == tally.wanted as u8;
            // The first of several is the one to look at.
            if !is_right && tally.culprit.is_none_or(|(known, ..)| device < known) {
                let found = if answers { own[0] } else { 0 };
                tally.culprit = Some((device, found, u16::from_le_bytes([own[4], own[5]])));
            }
        }
        let status = states.bytes(frame).first().copied().unwrap_or_default();
        tally.states = status;
        let all_wanted = status == tally.wanted as u8
            && usize::from(states.counter(frame)) == self.members.len();
        let counter = self.members.iter().fold(0u16, |sum, member| {
            sum + u16::from(!member.inputs.is_empty()) + 2 * u16::from(!member.outputs.is_empty())
        });
        let is_whole = image.data.len() == self.image.len();
        if !all_wanted || !is_whole || image.counter(frame) != counter {
            tally.outcome = Outcome::Incomplete;
            return;
        }
        if let (Some(time), Some(follower)) = (time, &mut self.follower)
            && let Some(bytes) = time.bytes(frame).first_chunk()
            && time.counter(frame) > 0
        {
            tally.has_jumped = !follower.read(u64::from_le_bytes(*bytes), tally.sent);
        }
        if tally.has_jumped {
            tally.outcome = Outcome::Incomplete;
            return;
        }
        tally.outcome = Outcome::Valid;
        tally.culprit = None;
        let start = self.members.last().map_or(0, |member| member.outputs.end);
        self.take_inputs(image.data.start + start..image.data.end);
    }

    fn take_inputs(&mut self, range: Range<usize>) {
        let start = self.outputs();
        let from = self.back.get(range).unwrap_or_default();
        let to = self.image.get_mut(start..).unwrap_or_default();
        if from.len() == to.len() {
            to.copy_from_slice(from);
        }
        for drive in &mut self.drives {
            drive.read(&self.image);
        }
    }

    /// Reads the inputs once more; true if all devices answered. Real-time: yes.
    pub(crate) fn sample(&mut self, deadline: Nanos) -> bool {
        let start = self.outputs();
        let length = self.image.len() - start;
        self.tally.index = self.tally.index.wrapping_add(1);
        let mut writer = FrameWriter::new(&mut self.out, self.source);
        let _ = writer.reserve((Service::Lrd, self.tally.index), start as u32, length);
        let bytes = writer.finish();
        match self.line.send(self.out.get(..bytes).unwrap_or_default()) {
            Ok(()) | Err(LineFault::Full) => {}
            Err(fault) => {
                self.breaks(fault);
                return false;
            }
        }
        let with_inputs = self
            .members
            .iter()
            .filter(|one| !one.inputs.is_empty())
            .count();
        let Some(bytes) = self.reply(deadline) else {
            return self.misses_sample(Outcome::Silent);
        };
        let frame = self.back.get(..bytes).unwrap_or_default();
        let first = datagrams(frame).ok().and_then(|mut all| all.next());
        match first {
            Some(Ok(one))
                if usize::from(one.counter(frame)) == with_inputs && one.data.len() == length =>
            {
                self.take_inputs(one.data);
                if self.tally.outcome == Outcome::Valid {
                    self.tally.stale = 0;
                }
                true
            }
            _ => self.misses_sample(Outcome::Incomplete),
        }
    }

    fn misses_sample(&mut self, outcome: Outcome) -> bool {
        // A tick is stale once.
        if self.tally.outcome == Outcome::Valid {
            self.tally.outcome = outcome;
            self.tally.stale = self.tally.stale.saturating_add(1);
        }
        false
    }

    /// Brings all devices to OP with unchanged outputs.
    ///
    /// # Errors
    /// A device refuses.
    pub fn to_op(&mut self) -> Result<(), BusError> {
        self.go_to(AlState::Op, &mut || true)
    }

    /// One whole exchange beside the loop; true if it was complete.
    pub fn exchange(&mut self) -> bool {
        self.send();
        let deadline = self.reply_ends();
        let is_valid = self.receive(deadline);
        if is_valid {
            self.tally.stale = 0;
        }
        is_valid
    }

    /// True if the command of the last exchange can stay for another one: every drive can stop in one tick. Real-time: yes.
    pub(crate) fn repeats(&self) -> bool {
        self.drives.iter().all(Drive::can_stop)
    }

    /// Time since the last exchange began, in ns. Real-time: yes.
    pub(crate) fn silent_ns(&self) -> u64 {
        self.line.now().since(self.tally.sent)
    }

    /// The last exchange once more, at the next edge; true if it was complete.
    pub(crate) fn exchange_again(&mut self) -> bool {
        self.drives.iter_mut().for_each(Drive::repeat);
        let edge = self.next_edge();
        self.line.wait_until(edge);
        self.exchange()
    }

    /// The next moment at which an exchange is due, on the clock of this machine: the bus clock has its phase there.
    pub(crate) fn next_edge(&self) -> Nanos {
        let period = self.plan.period_ns;
        let Some(follower) = &self.follower else {
            return self.tally.sent.plus(period);
        };
        let earliest = self.tally.sent.plus(period / 2);
        let phase = earliest.0.wrapping_add_signed(follower.offset_ns()) % period;
        earliest.plus(period - phase)
    }

    /// A moment of the loop's clock on the clock of this machine.
    pub(crate) fn on_machine(&self, at: Nanos) -> Nanos {
        let offset = self.follower.as_ref().map_or(0, Follower::lead_ns);
        Nanos(at.0.wrapping_add_signed(offset.wrapping_neg()))
    }

    /// Exchanges at its edges until `is_done`; false if that takes too long, or is not `wanted` any more.
    pub(crate) fn exchange_until(
        &mut self,
        mut is_done: impl FnMut(&mut Self) -> Result<bool, BusError>,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, BusError> {
        let until = self.line.now().plus(self.plan.patience_ns);
        loop {
            let edge = self.next_edge();
            self.line.wait_until(edge);
            self.exchange();
            if is_done(self)? {
                return Ok(true);
            }
            if !wanted() {
                return Err(BusError::Unwanted);
            }
            if self.tally.outcome == Outcome::Broken || self.line.now() > until {
                return Ok(false);
            }
        }
    }

    /// Brings all devices to a state while process data are exchanged.
    pub(crate) fn go_to(
        &mut self,
        state: AlState,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<(), BusError> {
        let mut requests = Requests::new(self.line.as_mut(), self.source);
        requests.write_all(reg::AL_CONTROL, &[state as u8, 0])?;
        self.tally.wanted = state;
        self.tally.culprit = None;
        let refused = |bus: &mut Self| {
            if bus.tally.states & reg::AL_ERROR != 0 {
                return Err(bus.in_other_state());
            }
            Ok(bus.tally.outcome == Outcome::Valid)
        };
        if self.exchange_until(refused, wanted)? {
            return Ok(());
        }
        Err(self.in_other_state())
    }

    /// Leaves the bus: INIT for all devices. Nothing is exchanged after that.
    pub(crate) fn close(&mut self) {
        let mut requests = Requests::new(self.line.as_mut(), self.source);
        let _ = requests.all_to_init();
    }

    /// The first device that is not in the wanted state. Asks each of them.
    fn in_other_state(&mut self) -> BusError {
        let wanted = self.tally.wanted;
        for member in &self.members {
            let station = crate::request::Station::new(&member.name, member.station);
            let mut requests = Requests::new(self.line.as_mut(), self.source);
            match requests.state(&station) {
                Ok((found, false, _)) if found == Some(wanted) => {}
                Ok((found, _, code)) => {
                    return BusError::State {
                        device: member.name.clone(),
                        wanted,
                        found,
                        code,
                    };
                }
                Err(error) => return error,
            }
        }
        self.stale_error()
    }

    fn stale_error(&self) -> BusError {
        let what = match self.tally.outcome {
            Outcome::Silent => "no reply came: look at the cable",
            _ if self.tally.has_jumped => {
                "the clock of the bus has jumped by more than half a tick"
            }
            _ => "a device did not take part in the exchange (working counter)",
        };
        BusError::Stale {
            ticks: self.tally.stale,
            what: what.to_owned(),
        }
    }

    /// Why the exchange is not valid, in words; none if it is.
    pub(crate) fn complaint(&self) -> Option<BusError> {
        if let Some(fault) = &self.tally.line_fault {
            return Some(fault.clone().into());
        }
        if let Some((device, found, code)) = self.tally.culprit {
            let device = self.members.get(device)?.name.clone();
            return Some(match found {
                0 => BusError::Silent {
                    device,
                    what: "its state was read",
                },
                found => BusError::State {
                    device,
                    wanted: self.tally.wanted,
                    found: AlState::of(found),
                    code,
                },
            });
        }
        (self.tally.stale > 0).then(|| self.stale_error())
    }

    /// Whether the line carries no frames, whether a device refuses or is gone, and how many ticks in a row were not valid.
    pub(crate) const fn trouble(&self) -> (bool, bool, u32) {
        let tally = &self.tally;
        (
            tally.line_fault.is_some(),
            tally.culprit.is_some() && tally.stale > 0,
            tally.stale,
        )
    }

    /// True if no exchange was complete for longer than the watchdog of the devices: one that gets no outputs has dropped them.
    pub(crate) fn is_past_watchdog(&self) -> bool {
        let lost_ns = u64::from(self.tally.stale).saturating_mul(self.plan.period_ns);
        self.tally.outcome != Outcome::Valid && lost_ns > self.plan.watchdog_ns
    }

    /// True if all of these drives have torque.
    pub(crate) fn have_torque(&self, drives: &[usize]) -> bool {
        let mut all = drives.iter().filter_map(|index| self.drives.get(*index));
        all.all(|drive| drive.state() == DriveState::OperationEnabled)
    }

    /// The loop was silent for so long that the drives went without targets: those that moved take no more commands. Real-time: yes.
    pub(crate) fn note_silence(&mut self) {
        self.drives.iter_mut().for_each(Drive::note_silence);
    }

    /// The first drive that is to have no torque, or a quick stop, or takes no more commands.
    pub(crate) fn unwanted(&self) -> Option<&str> {
        let mut drives = self.drives.iter();
        let drive = drives.find(|drive| !drive.is_wanted() || drive.has_rested())?;
        Some(self.name(drive.device))
    }

    /// Takes the torque from these drives, or from all of them, and waits until they have none; false if one keeps it. A bus that
    /// was lost for longer than the watchdog of its devices says nothing more.
    pub(crate) fn take_torque(&mut self, of: Option<&[usize]>) -> bool {
        let of = of.map_or_else(|| (0..self.drives.len()).collect(), <[usize]>::to_vec);
        if of.is_empty() {
            return true;
        }
        for index in &of {
            if let Some(drive) = self.drives.get_mut(*index) {
                drive.disable();
            }
        }
        let off = |bus: &mut Self| {
            let hold = of.iter().filter_map(|index| bus.drives.get(*index));
            let is_off =
                bus.tally.outcome == Outcome::Valid && !hold.into_iter().any(Drive::has_torque);
            Ok(is_off || bus.is_past_watchdog())
        };
        self.exchange_until(off, &mut || true).unwrap_or_default() && !self.is_past_watchdog()
    }

    /// Leaves normal operation, if the devices still take part; true if they did.
    pub(crate) fn leave(&mut self) -> bool {
        if self.is_past_watchdog() || self.state() != AlState::Op {
            return self.exchange();
        }
        self.go_to(AlState::SafeOp, &mut || true).is_ok()
    }

    /// Name of a device, from 0.
    pub(crate) fn name(&self, device: usize) -> &str {
        self.members.get(device).map_or("", |member| &member.name)
    }
}
