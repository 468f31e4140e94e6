//! A specimen on a bus, as a [`Substructure`].
//!
//! `connect` brings the bus to SAFE-OP: sensors are live and outputs are off. `arm` brings it to OP, with the outputs at the standing
//! command and drives at their actual position, and gives drives torque. `issue` and `collect` are on the path of a tick. Where a drive
//! or an output holds the axis, `settle` reports it: torque and outputs end in `retire`, when the operator has said that the axis is
//! unloaded.

use std::sync::Arc;

use gusset_quantity::substructure::{
    Command, Coupling, Freshness, Holder, Introduction, LinkFault, LinkStats, Measurement,
    Retirement, Status, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;

use crate::axis_drive::Place;
use crate::cycle::Bus;
use crate::error::BusError;
use crate::line::LineFault;
use crate::plan::{Check, CommandPlan, Scaled, SpecimenPlan};
use crate::shared::{Held, SharedBus, Stage};
use crate::wire::register::AlState;

/// The remark of every test on devices that are not simulated.
const UNTRIED: &str = "EtherCAT in Gusset was never tried on hardware: prove it without a specimen first (guide: ethercat)";

/// A quantity in the image.
#[derive(Debug, Clone, Copy)]
struct Signal {
    place: Place,
    scaled: Scaled,
}

impl Signal {
    fn new(bus: &Bus, scaled: &Scaled, is_input: bool) -> Option<Self> {
        Some(Self {
            place: bus.place(scaled.at, is_input)?,
            scaled: *scaled,
        })
    }

    fn read(&self, image: &[u8]) -> f64 {
        self.scaled.value(self.place.read(image))
    }

    /// True if it is at an end of its type, where a sensor reads no more. An unsigned one may be at 0.
    fn is_at_end(&self, image: &[u8]) -> bool {
        let count = self.place.read(image);
        let (low, high) = self.place.kind.range();
        count >= high || (low < 0.0 && count <= low)
    }

    /// The count of a value, and that within its type.
    fn counts(&self, value: f64) -> (f64, f64) {
        let count = self.scaled.count(value);
        let (low, high) = self.place.kind.range();
        (count, count.clamp(low, high))
    }

    /// Writes a value; true if it is beyond the type.
    fn write(&self, value: f64, image: &mut [u8]) -> bool {
        let (count, limited) = self.counts(value);
        self.place.write(limited, image);
        limited != count
    }
}

#[derive(Debug, Clone, Copy)]
enum Mover {
    Output(Signal),
    /// Number among the drives of the bus.
    Drive(usize),
}

/// Flags in the image.
#[derive(Debug, Clone, Copy)]
struct Flags {
    place: Place,
    mask: u32,
    equals: u32,
}

impl Flags {
    fn new(bus: &Bus, check: &Check) -> Option<Self> {
        Some(Self {
            place: bus.place(check.at, true)?,
            mask: check.mask,
            equals: check.equals,
        })
    }

    fn are_right(&self, image: &[u8]) -> bool {
        let count = self.place.read(image) as i64 as u32;
        count & self.mask == self.equals
    }
}

/// The places of a specimen in the image of its bus.
#[derive(Debug)]
struct Places {
    movers: Vec<Mover>,
    drives: Vec<usize>,
    forces: Vec<Signal>,
    disps: Vec<Option<Signal>>,
    good: Vec<Flags>,
    interlock: Vec<Flags>,
}

impl Places {
    fn new(bus: &Bus, plan: &SpecimenPlan) -> Option<Self> {
        let mut own = Self {
            movers: Vec::new(),
            drives: Vec::new(),
            forces: Vec::new(),
            disps: Vec::new(),
            good: Vec::new(),
            interlock: Vec::new(),
        };
        for axis in &plan.axes {
            own.movers.push(match &axis.command {
                CommandPlan::Output(scaled) => Mover::Output(Signal::new(bus, scaled, false)?),
                CommandPlan::Drive(device) => {
                    let drive = bus.drive_of(*device)?;
                    own.drives.push(drive);
                    Mover::Drive(drive)
                }
            });
            own.forces.push(Signal::new(bus, &axis.force, true)?);
            own.disps.push(match &axis.disp {
                Some(disp) => Some(Signal::new(bus, disp, true)?),
                None => None,
            });
            for check in &axis.good {
                own.good.push(Flags::new(bus, check)?);
            }
        }
        for check in &plan.interlock {
            own.interlock.push(Flags::new(bus, check)?);
        }
        Some(own)
    }

    /// Displacement of an axis, if anything measures it.
    fn disp(&self, axis: usize, bus: &mut Bus) -> Option<f64> {
        match (self.disps.get(axis)?, self.movers.get(axis)?) {
            (Some(signal), _) => Some(signal.read(bus.image())),
            (None, Mover::Drive(drive)) => {
                let (drive, image) = bus.drive(*drive)?;
                Some(drive.position(image).1)
            }
            (None, Mover::Output(_)) => None,
        }
    }

    /// Whether all drives are where these commands send them.
    fn are_at(&self, disp: &[f64], bus: &mut Bus) -> Result<(), BusError> {
        for (mover, disp) in self.movers.iter().zip(disp) {
            let Mover::Drive(drive) = mover else {
                continue;
            };
            let Some((drive, image)) = bus.drive(*drive) else {
                continue;
            };
            let (wanted, tolerance) = drive.in_counts(*disp);
            let (found, _) = drive.position(image);
            let device = drive.device;
            if (found - wanted).abs() > tolerance {
                return Err(BusError::Moved {
                    device: bus.name(device).to_owned(),
                    found,
                    wanted,
                });
            }
        }
        Ok(())
    }

    /// Exchanges until all drives have torque.
    fn await_torque(
        &self,
        bus: &mut Bus,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<(), BusError> {
        let drives = &self.drives;
        let enabled = |bus: &mut Bus| {
            let mut faulty = drives.iter().filter_map(|index| {
                let (drive, _) = bus.drive(*index)?;
                drive.state().is_fault().then_some(drive.device)
            });
            match faulty.next() {
                Some(device) => Err(BusError::Drive {
                    device: bus.name(device).to_owned(),
                    why: "it has a fault: remove its cause, then `gusset bus reset`".to_owned(),
                }),
                None => Ok(bus.have_torque(drives)),
            }
        };
        if bus.exchange_until(enabled, wanted)? {
            return Ok(());
        }
        let mut without = drives.iter().copied();
        let first = without.find(|index| !bus.have_torque(&[*index]));
        let found = first.and_then(|index| {
            let (drive, image) = bus.drive(index)?;
            Some((drive.device, drive.why_no_torque(image)))
        });
        Err(match found {
            Some((device, why)) => {
                let device = bus.name(device).to_owned();
                BusError::Drive { device, why }
            }
            None => bus.complaint().unwrap_or(BusError::NoDevice),
        })
    }

    fn all_right(flags: &[Flags], bus: &mut Bus) -> bool {
        flags.iter().all(|flags| flags.are_right(bus.image()))
    }
}

/// A specimen on a bus.
#[derive(Debug)]
pub struct BusPort {
    shared: Arc<SharedBus>,
    plan: SpecimenPlan,
    places: Option<Places>,
    is_armed: bool,
    is_simulated: bool,
    is_saturated: bool,
    /// Command that the newest inputs answer, and the last one.
    answered: u64,
    issued: u64,
    /// The last command whose exchange was complete.
    delivered: u64,
    /// The last command of each axis.
    disp: Vec<f64>,
    complaint: Option<String>,
    /// The devices left normal operation when they were asked to; none before that.
    has_left: Option<bool>,
    stats: LinkStats,
}

impl BusPort {
    /// A specimen with these axes on a bus, which is not connected yet.
    #[must_use]
    pub fn new(shared: Arc<SharedBus>, plan: SpecimenPlan) -> Self {
        Self {
            shared,
            disp: vec![0.0; plan.axes.len()],
            plan,
            places: None,
            is_armed: false,
            is_simulated: false,
            is_saturated: false,
            answered: 0,
            issued: 0,
            delivered: 0,
            complaint: None,
            has_left: None,
            stats: LinkStats::default(),
        }
    }

    fn complain(&mut self, error: &BusError) -> LinkFault {
        self.complaint = Some(error.to_string());
        fault_of(error)
    }

    /// Finds its places and where it stands.
    fn introduce(&mut self, bus: &mut Bus) -> Result<Introduction, BusError> {
        let unmapped = BusError::NoDevice;
        let places = Places::new(bus, &self.plan).ok_or(unmapped)?;
        let axes = self.plan.axes.len();
        let all_drives = places.drives.len() == axes;
        let standing = if all_drives {
            // The command that moves nothing is the drive's own position, whatever another sensor reads.
            let drives = places.drives.iter();
            drives
                .filter_map(|drive| {
                    let (drive, image) = bus.drive(*drive)?;
                    Some(drive.position(image).1)
                })
                .collect()
        } else {
            Vec::new()
        };
        let repeats = (0..axes).any(|axis| places.disp(axis, bus).is_none());
        let force = places
            .forces
            .iter()
            .map(|force| force.read(bus.image()))
            .collect();
        self.is_simulated = bus.is_simulated();
        let untried = (!self.is_simulated).then(|| UNTRIED.to_owned());
        self.places = Some(places);
        Ok(Introduction {
            peer: format!(
                "EtherCAT bus \"{}\" with {} devices{}",
                bus.plan().name,
                bus.plan().devices.len(),
                if self.is_simulated {
                    " (simulated)"
                } else {
                    ""
                }
            ),
            standing,
            force,
            warnings: untried.into_iter().collect(),
            simulated: self.is_simulated,
            keeps_state: bus.keeps_state(),
            repeats_the_command: repeats,
            ..Introduction::default()
        })
    }

    /// Brings the bus to OP, and gives its drives torque. A drive that does not get it is left without.
    fn arm_on(
        &mut self,
        bus: &mut Bus,
        disp: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<(), BusError> {
        let places = self.places.as_ref().ok_or(BusError::NoDevice)?;
        if !Places::all_right(&places.interlock, bus) {
            return Err(BusError::Interlock);
        }
        places.are_at(disp, bus)?;
        if bus.state() != AlState::Op {
            // The devices must have the standing command before they use it.
            if !bus.exchange_until(|bus| Ok(bus.trouble().2 == 0), wanted)? {
                return Err(bus.complaint().unwrap_or(BusError::NoDevice));
            }
            self.shared.set_live();
            bus.go_to(AlState::Op, wanted)?;
        }
        for index in &places.drives {
            if let Some((drive, _)) = bus.drive(*index) {
                drive.enable();
            }
        }
        let armed = places.await_torque(bus, wanted);
        // It may have sagged meanwhile: the first command must not be a step.
        let armed = armed.and_then(|()| places.are_at(disp, bus));
        if armed.is_err() {
            for index in &places.drives {
                if let Some((drive, _)) = bus.drive(*index)
                    && !drive.has_torque()
                {
                    drive.disable();
                }
            }
        }
        armed
    }

    /// Receives the inputs of this tick, once for all specimens of the bus; none if the bus was closed. Real-time: yes.
    fn receive(&self, mut held: Box<Held>, deadline: Nanos) -> Option<(Box<Held>, bool)> {
        if held.stage == Stage::Writing {
            held.bus.send();
            held.stage = Stage::Sent;
        }
        if held.stage == Stage::Sent {
            let deadline = if self.shared.is_on_simulated_time() {
                held.bus.tick_ends()
            } else {
                held.bus.on_machine(deadline).min(held.bus.tick_ends())
            };
            let mut is_valid = held.bus.receive(deadline);
            if let (true, Some(after)) = (is_valid, held.bus.plan().sample_after_ns) {
                let at = held.bus.sent().plus(after);
                held = self.shared.wait_until(held, at)?;
                // The keeper may have exchanged meanwhile.
                is_valid = held.stage == Stage::Sent && held.bus.sample(deadline);
            }
            held.stage = Stage::Done(is_valid);
        }
        let is_valid = held.stage == Stage::Done(true);
        Some((held, is_valid))
    }

    /// Flags of this tick. Real-time: yes.
    fn status(&self, bus: &mut Bus) -> Status {
        let Some(places) = &self.places else {
            return Status::default();
        };
        let mut status = Status::default();
        let mut drives = places.drives.iter();
        let lost_torque =
            drives.any(|index| bus.drive(*index).is_some_and(|(drive, _)| drive.is_lost()));
        if lost_torque || !Places::all_right(&places.interlock, bus) {
            status.0 |= Status::INTERLOCK.0;
        }
        let mut sensors = places.forces.iter().chain(places.disps.iter().flatten());
        let is_at_end = sensors.any(|sensor| sensor.is_at_end(bus.image()));
        if self.is_saturated || is_at_end || !Places::all_right(&places.good, bus) {
            status.0 |= Status::SATURATED.0;
        }
        status
    }

    /// Whether the bus is lost. Real-time: yes.
    fn loss(bus: &Bus) -> Option<LinkFault> {
        let (is_broken, is_refused, stale) = bus.trouble();
        let is_late = stale >= bus.plan().stale_ticks;
        if is_broken {
            Some(LinkFault::Closed)
        } else if is_late && is_refused {
            Some(LinkFault::Refused)
        } else {
            is_late.then_some(LinkFault::Timeout)
        }
    }
}

const fn fault_of(error: &BusError) -> LinkFault {
    match error {
        BusError::Line(LineFault::Down | LineFault::Full) => LinkFault::Closed,
        BusError::NoDevice
        | BusError::Silent { .. }
        | BusError::Stale { .. }
        | BusError::Unrepeated => LinkFault::Timeout,
        _ => LinkFault::Refused,
    }
}

impl Substructure for BusPort {
    fn axes(&self) -> usize {
        self.plan.axes.len()
    }

    fn coupling(&self) -> Coupling {
        Coupling::Sampled
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn holder(&self) -> Holder {
        if self.shared.is_live() {
            Holder::ItsWatchdog
        } else {
            Holder::NeverArmed
        }
    }

    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        let shared = Arc::clone(&self.shared);
        let unavailable = |error: &BusError| Unavailable {
            fault: fault_of(error),
            text: format!("bus \"{}\": {error}", shared.plan().name),
        };
        shared.open().map_err(|error| unavailable(&error))?;
        let Some(mut held) = shared.take() else {
            return Err(unavailable(&BusError::NoDevice));
        };
        let trouble = match held.bus.unwanted() {
            Some(name) if shared.is_live() => Some(BusError::Spent(name.to_owned())),
            _ => held.bus.complaint(),
        };
        let introduction = match trouble {
            Some(error) => Err(error),
            None => self.introduce(&mut held.bus),
        };
        shared.put_back(held);
        introduction.map_err(|error| unavailable(&error))
    }

    fn ask_to_arm(&mut self, _: u64, disp: &[f64]) -> Result<(), LinkFault> {
        let Some(mut held) = self.shared.take() else {
            return Err(LinkFault::Closed);
        };
        let holds_its_outputs = self.shared.is_lent() && self.shared.is_live();
        let movers = self.places.iter().flat_map(|places| &places.movers);
        let mut beyond = None;
        for (mover, disp) in movers.zip(disp) {
            if let (Mover::Output(signal), false) = (mover, holds_its_outputs) {
                let (count, limited) = signal.counts(*disp);
                if count != limited {
                    beyond = Some(count);
                    break;
                }
                signal.write(*disp, held.bus.image());
            }
        }
        self.shared.put_back(held);
        if let Some(count) = beyond {
            return Err(self.complain(&BusError::Beyond(count)));
        }
        self.disp.copy_from_slice(disp);
        Ok(())
    }

    fn arm(
        &mut self,
        sequence: u64,
        disp: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        if !self.is_armed {
            self.ask_to_arm(sequence, disp)?;
        }
        let Some(mut held) = self.shared.take() else {
            return Err(LinkFault::Closed);
        };
        let outcome = self.arm_on(&mut held.bus, disp, wanted);
        self.shared.put_back(held);
        self.shared.set_idle(true);
        self.answered = sequence.saturating_sub(1);
        self.delivered = self.answered;
        match outcome {
            Ok(()) => {
                self.is_armed = true;
                Ok(true)
            }
            Err(BusError::Unwanted) => Ok(false),
            Err(error) => Err(self.complain(&error)),
        }
    }

    fn stats(&self) -> LinkStats {
        self.stats
    }

    fn complaint(&self) -> Option<String> {
        self.complaint.clone()
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        let Some(mut held) = self.shared.take() else {
            return Err(LinkFault::Closed);
        };
        // While it is held here, the keeper takes no part.
        self.shared.set_idle(false);
        let is_on_clock = !self.shared.is_on_simulated_time();
        if is_on_clock && held.bus.silent_ns() > self.shared.silence_ns() {
            held.bus.note_silence();
        }
        if let Stage::Done(_) = held.stage {
            if self.shared.is_on_simulated_time() {
                let edge = held.bus.next_edge();
                held.bus.wait_until(edge);
            }
            if held.written > 0 {
                held.expected = held.written;
            }
            (held.stage, held.written) = (Stage::Writing, 0);
        }
        let movers = self.places.iter().flat_map(|places| &places.movers);
        let mut has_rested = false;
        for (mover, disp) in movers.zip(command.disp) {
            match mover {
                Mover::Output(signal) => {
                    self.is_saturated |= signal.write(*disp, held.bus.image());
                }
                Mover::Drive(drive) => {
                    if let Some((drive, _)) = held.bus.drive(*drive) {
                        has_rested |= drive.has_rested();
                        if !drive.has_rested() {
                            self.is_saturated |= drive.aim(*disp);
                        }
                    }
                }
            }
        }
        self.issued = command.sequence;
        for (own, disp) in self.disp.iter_mut().zip(command.disp) {
            *own = *disp;
        }
        held.written += 1;
        if held.stage == Stage::Writing && held.written >= held.expected {
            held.bus.send();
            held.stage = Stage::Sent;
        }
        self.shared.put_back(held);
        if has_rested {
            return Err(self.complain(&BusError::Rested));
        }
        Ok(())
    }

    fn collect(&mut self, deadline: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let held = self.shared.take();
        let Some((mut held, mut is_valid)) = held.and_then(|held| self.receive(held, deadline))
        else {
            return Err(LinkFault::Closed);
        };
        let mut loss = Self::loss(&held.bus);
        while !is_valid && self.shared.is_lent() && loss.is_none() {
            // A gateway has one answer for each command. A drive that cannot stop in one tick comes to rest, and the session ends.
            if held.bus.repeats() {
                is_valid = held.bus.exchange_again();
                loss = Self::loss(&held.bus);
            } else {
                loss = Some(self.complain(&BusError::Unrepeated));
            }
        }
        self.stats = held.bus.stats();
        if is_valid {
            let same = held.bus.plan().sample_after_ns.is_some();
            self.answered = if same { self.issued } else { self.delivered };
            self.delivered = self.issued;
        }
        if let Some(places) = &self.places {
            for (axis, (force, disp)) in into.force.iter_mut().zip(&mut into.disp).enumerate() {
                if let Some(signal) = places.forces.get(axis) {
                    *force = signal.read(held.bus.image());
                }
                let command = self.disp.get(axis).copied().unwrap_or_default();
                *disp = places.disp(axis, &mut held.bus).unwrap_or(command);
            }
        }
        into.sequence = self.answered;
        into.status = self.status(&mut held.bus);
        self.shared.put_back(held);
        match loss {
            Some(fault) => Err(fault),
            None if is_valid => Ok(Freshness::Fresh),
            None => Ok(Freshness::Stale),
        }
    }

    fn clock_ppm(&self) -> f64 {
        self.shared.time().ppm()
    }

    fn settle(&mut self, how: Retirement) -> bool {
        let holds = self.shared.is_live() && !self.is_simulated;
        let Some(mut held) = self.shared.take() else {
            return holds;
        };
        // Nothing is commanded any more: targets that move come to rest.
        let places = self.places.as_ref();
        let drives = places.map_or(&[][..], |places| &places.drives);
        let rest = |bus: &mut Bus| {
            let moves = |index: &usize| bus.drive(*index).is_some_and(|(drive, _)| drive.moves());
            Ok(!drives.iter().any(moves))
        };
        if let Some(error) = held.bus.complaint() {
            self.complaint.get_or_insert_with(|| error.to_string());
        }
        let _ = held.bus.exchange_until(rest, &mut || true);
        let tripped = matches!(how, Retirement::Tripped | Retirement::Abandoned);
        for index in drives {
            let Some((drive, _)) = held.bus.drive(*index) else {
                continue;
            };
            let (device, state, lost) = (drive.device, drive.state(), drive.is_lost());
            if !drive.has_torque() {
                // It must not get torque again while people are at the specimen.
                drive.disable();
            } else if tripped {
                drive.quick_stop();
            }
            if lost && self.complaint.is_none() {
                let name = held.bus.name(device).to_owned();
                self.complaint = Some(format!("drive `{name}` is in \"{}\"", state.name()));
            }
        }
        held.bus.exchange();
        self.shared.put_back(held);
        self.shared.set_idle(true);
        holds
    }

    fn has_acknowledged(&self) -> Option<bool> {
        self.has_left
    }

    fn retire(&mut self, how: Retirement) {
        self.has_left = self.shared.is_live().then_some(false);
        let Some(mut held) = self.shared.take() else {
            return;
        };
        if self.shared.is_lent() && !held.bus.is_past_watchdog() {
            self.has_left = None;
            self.shared.put_back(held);
            self.settle(how);
            return;
        }
        let drives = self.places.as_ref().map(|places| places.drives.as_slice());
        let is_off = held.bus.take_torque(Some(drives.unwrap_or_default()));
        held.retired += 1;
        let is_last = held.retired == self.shared.specimens();
        let has_left = if is_last {
            held.bus.leave()
        } else {
            held.bus.exchange()
        };
        self.has_left = self.shared.is_live().then_some(has_left && is_off);
        if !is_last {
            self.shared.put_back(held);
            return;
        }
        self.shared.close(held);
    }
}
