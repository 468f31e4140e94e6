//! A simulated bus: devices without wires, and the specimens that they move.
//!
//! [`SimulatedBus::process`] sends one frame through all devices, as ESCs change it on the way. The same devices stand behind a network
//! interface and in the process of a test on the simulated clock. Bits equal those of the specimen's law where process data are `f64`.
//! Limits: no times of wires, no bit mapping, no FoE, EoE, SoE and no second ring.

mod device;
mod dictionary;
mod fault;
mod line;
mod mailbox;
mod plant;
mod servo;
mod units;

use thiserror::Error;

use crate::bring_up::SIMULATED;
use crate::plan::BusPlan;
use crate::wire::datagram::{Datagram, Service, datagrams};
use crate::wire::register::{AlState, USER_MEMORY};
use device::{Access, Device};
use plant::Running;

pub use fault::{Fault, FaultKind, FaultScript};
pub use line::SimulatedLine;
pub use plant::Plant;

/// Why a simulated bus cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SimulationError {
    /// A fault of a device that is not on the bus.
    #[error("the fault script names the device `{0}`, which is not on the bus")]
    NoDevice(String),
    /// A state that no device has.
    #[error("`{0}` is no state; allowed are PRE-OP, SAFE-OP and OP")]
    NoState(String),
    /// A fault without a time.
    #[error("a fault needs `at_tick` or `at_frame`")]
    NoTime,
    /// A plant refers to an entry that no device has, or its law has another number of axes.
    #[error("specimen {0} of the simulated bus does not fit the devices")]
    Plant(usize),
}

/// How a frame comes back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passage {
    /// At once.
    Returns,
    /// Never.
    Lost,
    /// This many ns later.
    Late(u64),
    /// Twice.
    Twice,
    /// At once, behind a frame of another master.
    BehindForeign,
}

impl Passage {
    /// This frame as another master would send it.
    #[must_use]
    pub fn foreign(frame: &[u8]) -> Vec<u8> {
        const SOURCE: [u8; 6] = [2, 1, 2, 3, 4, 5];
        let mut foreign = frame.to_vec();
        if let Some(source) = foreign.get_mut(6..12) {
            source.copy_from_slice(&SOURCE);
        }
        foreign
    }
}

/// Devices and the specimens that they move.
#[derive(Debug)]
pub struct SimulatedBus {
    devices: Vec<Device>,
    plants: Vec<Running>,
    faults: Vec<Fault>,
    period_s: f64,
    frames: u64,
    /// Exchanges with all devices in OP.
    ticks: u64,
    /// Devices that a frame reaches.
    reach: usize,
    frozen: Vec<bool>,
    silent: Vec<bool>,
}

impl SimulatedBus {
    /// The devices of `plan`, whose specimens are `plants`, with the faults of a script.
    ///
    /// # Errors
    /// The script or a plant does not fit the devices.
    pub fn new(
        plan: &BusPlan,
        plants: Vec<Plant>,
        faults: Vec<Fault>,
    ) -> Result<Self, SimulationError> {
        let number = plan.devices.len();
        let time = plan.time;
        let is_unmarked = faults.iter().any(|fault| fault.what == FaultKind::Unmarked);
        let mark = if is_unmarked { "" } else { SIMULATED };
        let mut devices: Vec<Device> = plan
            .devices
            .iter()
            .enumerate()
            .map(|(index, device)| {
                let counts = plant::stands_at(&plants, plan, index);
                Device::new((index, index + 1 == number), (device, mark), time, counts)
            })
            .collect();
        for fault in &faults {
            prepare(fault, &mut devices)?;
        }
        let mut running = Vec::with_capacity(plants.len());
        for (index, plant) in plants.into_iter().enumerate() {
            let made = Running::new(plant, plan, &mut devices);
            running.push(made.ok_or(SimulationError::Plant(index + 1))?);
        }
        Ok(Self {
            frozen: vec![false; number],
            silent: vec![false; number],
            devices,
            plants: running,
            faults,
            period_s: plan.period_ns as f64 * 1e-9,
            frames: 0,
            ticks: 0,
            reach: number,
        })
    }

    /// A frame travels through the devices, which change it in place. `now_ns` is the time of this machine.
    pub fn process(&mut self, frame: &mut [u8], now_ns: u64) -> Passage {
        let is_exchange = datagrams(frame).is_ok_and(|mut all| {
            all.any(|one| {
                one.is_ok_and(|one| {
                    matches!(Service::of(one.service), Some(Service::Lrw | Service::Lwr))
                })
            })
        });
        let in_op = self.devices.iter().all(|one| one.state == AlState::Op);
        let tick = (is_exchange && in_op).then_some(self.ticks);
        // A frame between two exchanges belongs to the tick of the first.
        let begun = (in_op && !is_exchange).then(|| self.ticks.checked_sub(1));
        let passage = self.play(tick.or(begun.flatten()), tick.is_some() || !in_op);
        self.frames += 1;
        if tick.is_some() {
            self.ticks += 1;
        }
        for device in &mut self.devices {
            device.watch(now_ns);
        }
        if passage == Passage::Lost {
            self.feel(false);
            return passage;
        }
        // An ESC marks a frame that it has processed, and passes on all others unchanged.
        if datagrams(frame).is_ok()
            && let Some(byte) = frame.get_mut(6)
        {
            *byte |= 0x02;
        }
        let mut number = 0;
        while let Some(Ok(one)) = datagrams(frame).ok().and_then(|mut all| all.nth(number)) {
            self.pass(&one, frame, now_ns);
            number += 1;
        }
        self.feel(tick.is_some() && self.reach == self.devices.len());
        passage
    }

    /// Number of exchanges so far with all devices in OP.
    #[must_use]
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Commands of each axis of each specimen, in the units of the plan, as the devices carry them out.
    pub fn commands(&self) -> impl Iterator<Item = &[f64]> {
        self.plants.iter().map(Running::commands)
    }

    /// One datagram passes all devices that it reaches.
    fn pass(&mut self, one: &Datagram, frame: &mut [u8], now_ns: u64) {
        let Some(service) = Service::of(one.service) else {
            return;
        };
        let (device, register) = (one.address as u16, (one.address >> 16) as u16);
        let devices = self.devices.len() as u64;
        let mut position = device;
        // Devices behind the addressed one see its answer.
        for (index, own) in self.devices.iter_mut().take(self.reach).enumerate() {
            let by_position = matches!(
                service,
                Service::Aprd | Service::Apwr | Service::Aprw | Service::Armw
            );
            let by_station = matches!(
                service,
                Service::Fprd | Service::Fpwr | Service::Fprw | Service::Frmw
            );
            let is_meant =
                (by_position && position == 0) || (by_station && device == own.station());
            position = position.wrapping_add(1);
            let (access, combine) = match service {
                Service::Lrd | Service::Lwr | Service::Lrw => {
                    let reads = service != Service::Lwr;
                    let writes = service != Service::Lrd;
                    let data = one.bytes_mut(frame);
                    let way = (one.address, reads, writes);
                    if !self.silent.get(index).copied().unwrap_or_default() {
                        let counter = own.exchange(way, data, now_ns);
                        one.count(frame, counter);
                    }
                    continue;
                }
                Service::Brd => (Access::Read, true),
                Service::Bwr => (Access::Write, false),
                Service::Brw => (Access::Both, true),
                Service::Aprd | Service::Fprd if is_meant => (Access::Read, false),
                Service::Apwr | Service::Fpwr if is_meant => (Access::Write, false),
                Service::Aprw | Service::Fprw if is_meant => (Access::Both, false),
                Service::Armw | Service::Frmw if is_meant => (Access::Read, false),
                Service::Armw | Service::Frmw => (Access::Write, false),
                _ => continue,
            };
            let data = one.bytes_mut(frame);
            if own.access((access, register), data, combine, (now_ns, devices)) {
                let by = if access == Access::Both { 3 } else { 1 };
                one.count(frame, by);
            }
        }
        let by_position = matches!(
            service,
            Service::Aprd | Service::Apwr | Service::Aprw | Service::Armw
        );
        let is_broadcast = matches!(service, Service::Brd | Service::Bwr | Service::Brw);
        if by_position || is_broadcast {
            one.set_device(frame, device.wrapping_add(self.reach as u16));
        }
    }

    /// The specimens feel a tick, or outputs that were dropped.
    fn feel(&mut self, is_tick: bool) {
        let mut dropped = false;
        for device in &mut self.devices {
            dropped |= std::mem::take(&mut device.has_dropped);
            if is_tick {
                device.put(USER_MEMORY, &[1]);
                device.drive();
            }
        }
        if !(is_tick || dropped) {
            return;
        }
        for plant in &mut self.plants {
            plant.step(&mut self.devices, &self.frozen, self.period_s);
        }
    }

    /// Plays the faults of this frame, which may be the first of its tick.
    fn play(&mut self, tick: Option<u64>, is_new: bool) -> Passage {
        let mut passage = Passage::Returns;
        self.frozen.fill(false);
        self.silent.fill(false);
        let (mut interlock, mut sensors) = (true, true);
        for fault in &self.faults {
            let begins = is_new && fault.begins(self.frames, tick);
            let ends_cut = matches!(fault.what, FaultKind::Cut { .. })
                && self.reach < self.devices.len()
                && !fault.is_on(self.frames, tick);
            if !fault.is_on(self.frames, tick) && !ends_cut {
                continue;
            }
            let name = fault.what.device();
            let at = self
                .devices
                .iter()
                .position(|one| Some(one.plan.name.as_str()) == name);
            match (&fault.what, at) {
                (FaultKind::Drop, _) => passage = Passage::Lost,
                (FaultKind::Late { micros }, _) => passage = Passage::Late(1000 * micros),
                (FaultKind::Duplicate, _) => passage = Passage::Twice,
                (FaultKind::Foreign, _) => passage = Passage::BehindForeign,
                (FaultKind::Wkc { .. }, Some(at)) => mark(&mut self.silent, at),
                (FaultKind::FrozenInput { .. }, Some(at)) => mark(&mut self.frozen, at),
                (FaultKind::Cut { .. }, Some(at)) => {
                    // While the cable is cut nothing comes in OP: a tick does not end it.
                    let heals = ends_cut && fault.at_frame.is_some();
                    self.reach = if heals { self.devices.len() } else { at + 1 };
                }
                (FaultKind::Interlock, _) => interlock = false,
                (FaultKind::BadSensor, _) => sensors = false,
                (FaultKind::AlError { code, .. }, Some(at)) if begins => {
                    if let Some(device) = self.devices.get_mut(at) {
                        device.fall(*code);
                    }
                }
                (FaultKind::DriveFault { code, .. }, Some(at)) if begins => {
                    if let Some(device) = self.devices.get_mut(at) {
                        if let Some(servo) = &mut device.servo {
                            servo.fail(*code);
                        }
                        device.report(*code);
                    }
                }
                (FaultKind::Emergency { code, .. }, Some(at)) if begins => {
                    if let Some(device) = self.devices.get_mut(at) {
                        device.report(*code);
                    }
                }
                _ => {}
            }
        }
        for plant in &self.plants {
            plant.show_flags(&mut self.devices, interlock, sensors);
        }
        passage
    }
}

fn mark(flags: &mut [bool], at: usize) {
    if let Some(flag) = flags.get_mut(at) {
        *flag = true;
    }
}

/// Checks a fault, and sets what it means from the beginning.
fn prepare(fault: &Fault, devices: &mut [Device]) -> Result<(), SimulationError> {
    if !fault.what.is_lasting() && fault.at_tick.is_none() && fault.at_frame.is_none() {
        return Err(SimulationError::NoTime);
    }
    if let Some(name) = fault.what.device()
        && !devices.iter().any(|device| device.plan.name == name)
    {
        return Err(SimulationError::NoDevice(name.to_owned()));
    }
    match &fault.what {
        FaultKind::ClockPpm { ppm } => {
            devices.iter_mut().for_each(|device| device.ppm = *ppm);
        }
        FaultKind::RefuseState {
            device,
            state,
            code,
        } => {
            let states = [AlState::PreOp, AlState::SafeOp, AlState::Op];
            let mut states = states.into_iter();
            let wanted = states.find(|one| one.name() == state);
            let wanted = wanted.ok_or_else(|| SimulationError::NoState(state.clone()))?;
            let mut own = devices.iter_mut();
            if let Some(own) = own.find(|own| own.plan.name == *device) {
                own.refuses = Some((wanted, *code));
            }
        }
        _ => {}
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests;
