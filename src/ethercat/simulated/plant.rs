//! A specimen behind the devices of a simulated bus.

use gusset_quantity::substructure::{Command, Measurement, Substructure};
use gusset_quantity::time::Nanos;

use super::device::Device;
use crate::axis_drive::Place;
use crate::plan::{BusPlan, Check, CommandPlan, EntryPlace, Scaled, SpecimenPlan};

/// Load of a simulated bus: a specimen of the test file, and its law in the same units.
pub struct Plant {
    /// Its axes on the bus.
    pub specimen: SpecimenPlan,
    /// Answers its displacement with a force.
    pub law: Box<dyn Substructure>,
    /// Where it stands before outputs act, one value per axis.
    pub stands_at: Vec<f64>,
}

impl std::fmt::Debug for Plant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Plant")
            .field("specimen", &self.specimen)
            .finish_non_exhaustive()
    }
}

/// Where the drive of a device stands, in counts; 0 if it moves no axis.
pub(super) fn stands_at(plants: &[Plant], plan: &BusPlan, device: usize) -> f64 {
    let mut all = plants
        .iter()
        .flat_map(|plant| plant.specimen.axes.iter().zip(&plant.stands_at));
    let drive = plan.devices.get(device).and_then(|one| one.drive.as_ref());
    let axis = all.find(|(axis, _)| axis.command == CommandPlan::Drive(device));
    match (drive, axis) {
        (Some(drive), Some((_, disp))) => (disp * drive.counts_per_unit).round(),
        _ => 0.0,
    }
}

/// A quantity in the memory of a device.
#[derive(Debug, Clone, Copy)]
struct Signal {
    place: Place,
    scaled: Scaled,
}

impl Signal {
    fn new(scaled: &Scaled, devices: &[Device], is_input: bool) -> Option<Self> {
        let EntryPlace { device, entry } = scaled.at;
        Some(Self {
            place: devices.get(device)?.place(entry, is_input)?,
            scaled: *scaled,
        })
    }

    fn read(&self, devices: &[Device]) -> f64 {
        let device = devices.get(self.scaled.at.device);
        let count = device.map_or(0.0, |device| self.place.read(&device.memory));
        self.scaled.value(count)
    }

    fn write(&self, value: f64, devices: &mut [Device], frozen: &[bool]) {
        let device = self.scaled.at.device;
        if frozen.get(device) == Some(&true) {
            return;
        }
        if let Some(device) = devices.get_mut(device) {
            self.place
                .write(self.scaled.count(value), &mut device.memory);
        }
    }
}

/// What carries out the command of an axis.
#[derive(Debug, Clone, Copy)]
enum Mover {
    Output(Signal),
    /// Device, and counts per unit.
    Drive(usize, f64),
}

/// A plant that runs.
pub(super) struct Running {
    specimen: SpecimenPlan,
    law: Box<dyn Substructure>,
    movers: Vec<Mover>,
    forces: Vec<Signal>,
    disps: Vec<Option<Signal>>,
    sequence: u64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    measured: Measurement,
}

impl std::fmt::Debug for Running {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Running")
            .field("specimen", &self.specimen)
            .field("disp", &self.disp)
            .finish_non_exhaustive()
    }
}

impl Running {
    pub(super) fn new(plant: Plant, plan: &BusPlan, devices: &mut [Device]) -> Option<Self> {
        let Plant {
            specimen,
            mut law,
            stands_at,
        } = plant;
        let axes = specimen.axes.len();
        if law.axes() != axes || stands_at.len() != axes {
            return None;
        }
        let (mut movers, mut forces, mut disps) = (Vec::new(), Vec::new(), Vec::new());
        for axis in &specimen.axes {
            movers.push(match &axis.command {
                CommandPlan::Output(scaled) => Mover::Output(Signal::new(scaled, devices, false)?),
                CommandPlan::Drive(device) => {
                    let drive = plan.devices.get(*device)?.drive.as_ref()?;
                    Mover::Drive(*device, drive.counts_per_unit)
                }
            });
            forces.push(Signal::new(&axis.force, devices, true)?);
            disps.push(match &axis.disp {
                Some(disp) => Some(Signal::new(disp, devices, true)?),
                None => None,
            });
        }
        let mut measured = Measurement::zeros(axes);
        if !law.at_rest(&mut measured) {
            measured.disp.copy_from_slice(&stands_at);
        }
        let mut own = Self {
            specimen,
            law,
            movers,
            forces,
            disps,
            sequence: 0,
            vel: vec![0.0; axes],
            disp: stands_at,
            measured,
        };
        own.show(devices, &[]);
        Some(own)
    }

    pub(super) fn commands(&self) -> &[f64] {
        &self.disp
    }

    /// One tick: the outputs become commands, and the answers of the law become inputs.
    pub(super) fn step(&mut self, devices: &mut [Device], frozen: &[bool], period_s: f64) {
        for ((mover, disp), vel) in self.movers.iter().zip(&mut self.disp).zip(&mut self.vel) {
            let command = match mover {
                Mover::Output(signal) => signal.read(devices),
                Mover::Drive(device, counts_per_unit) => {
                    let servo = devices.get(*device).and_then(|one| one.servo.as_ref());
                    servo.map_or(*disp, |servo| servo.counts / counts_per_unit)
                }
            };
            *vel = (command - *disp) / period_s;
            *disp = command;
        }
        let command = Command {
            sequence: self.sequence,
            time: self.sequence as f64 * period_s,
            dt: period_s,
            disp: &self.disp,
            vel: &self.vel,
        };
        let answered = self.law.issue(&command).is_ok()
            && self
                .law
                .collect(Nanos(u64::MAX), &mut self.measured)
                .is_ok()
            && self.law.accepted(self.sequence).is_ok();
        if answered {
            self.sequence += 1;
        }
        self.show(devices, frozen);
    }

    /// Writes what was measured into the inputs.
    fn show(&mut self, devices: &mut [Device], frozen: &[bool]) {
        let Measurement { disp, force, .. } = &self.measured;
        for (signal, force) in self.forces.iter().zip(force) {
            signal.write(*force, devices, frozen);
        }
        for ((signal, mover), disp) in self.disps.iter().zip(&self.movers).zip(disp) {
            if let Some(signal) = signal {
                signal.write(*disp, devices, frozen);
            }
            if let Mover::Drive(device, counts_per_unit) = mover
                && frozen.get(*device) != Some(&true)
                && let Some(device) = devices.get_mut(*device)
            {
                device.show_drive(disp * counts_per_unit);
            }
        }
    }

    /// Writes the flags of its interlock and of its sensors: right, or wrong.
    pub(super) fn show_flags(&self, devices: &mut [Device], interlock: bool, sensors: bool) {
        let axes = self.specimen.axes.iter();
        let good = axes
            .flat_map(|axis| &axis.good)
            .map(|check| (check, sensors));
        let interlocks = self
            .specimen
            .interlock
            .iter()
            .map(|check| (check, interlock));
        for (Check { at, mask, equals }, is_right) in good.chain(interlocks) {
            let value = if is_right { *equals } else { *equals ^ mask };
            if let Some(device) = devices.get_mut(at.device) {
                device.set_flags(at.entry, value);
            }
        }
    }
}
