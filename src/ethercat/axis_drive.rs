//! A CiA-402 drive in the cycle: its way to torque and back, and its target.
//!
//! Until a drive has torque, its target is its actual position. A target that moves and gets no new command comes to rest within the
//! limit of acceleration; after that it takes no more commands. A drive that lost its torque does not get it back, and one that stops by
//! itself keeps it. A fault is never reset here.

use crate::error::BusError;
use crate::plan::{DevicePlan, DrivePlan};
use crate::wire::drive as words;
use crate::wire::drive::DriveState;
use gusset_wire::process_data::{Entry, Kind, length};

/// Place of a value in the image of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    pub offset: usize,
    pub kind: Kind,
}

impl Place {
    /// The entry of this number among entries that begin at `start` in the image.
    pub(crate) fn nth(entries: &[Entry], start: usize, number: usize) -> Option<Self> {
        Some(Self {
            offset: start + length(entries.get(..number)?),
            kind: entries.get(number)?.kind,
        })
    }

    /// The entry of this object among entries that begin at `start` in the image.
    pub(crate) fn of_object(entries: &[Entry], start: usize, index: u16) -> Option<Self> {
        let number = entries.iter().position(|entry| entry.index == index)?;
        Self::nth(entries, start, number)
    }

    pub(crate) fn read(self, image: &[u8]) -> f64 {
        self.kind.read(image.get(self.offset..).unwrap_or_default())
    }

    pub(crate) fn write(self, value: f64, image: &mut [u8]) {
        let place = image.get_mut(self.offset..).unwrap_or_default();
        self.kind.write(value, place);
    }
}

/// Wanted state of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    NoTorque,
    Operation,
    QuickStop,
}

/// Its objects in the image.
#[derive(Debug)]
struct Places {
    control: Place,
    status: Place,
    target: Place,
    actual: Place,
    /// Mode of operation and its display, if they are process data.
    mode: Option<[Place; 2]>,
}

/// A drive that shows another mode than the one that was written.
pub(crate) fn wrong_mode(found: f64) -> String {
    format!(
        "its mode 6061 is {found}, but 8 (cyclic synchronous position) was written to 6060: it gets no torque"
    )
}

/// One drive.
#[derive(Debug)]
pub(crate) struct Drive {
    /// Its device, from 0.
    pub device: usize,
    places: Places,
    counts_per_unit: f64,
    /// Largest change of the step from tick to tick, in counts.
    brake: f64,
    wanted: Wanted,
    state: DriveState,
    /// It had torque, and the last controlword.
    had_torque: bool,
    word: u16,
    /// Target in counts, and what it last moved by in a tick.
    counts: f64,
    step: f64,
    is_told: bool,
    has_rested: bool,
}

impl Drive {
    /// The drive of a device whose outputs and inputs begin at these places of the image.
    pub(crate) fn new(
        (device, plan, drive): (usize, &DevicePlan, &DrivePlan),
        [outputs, inputs]: [usize; 2],
        period_s: f64,
    ) -> Result<Self, BusError> {
        let missing = |what: &str| BusError::Drive {
            device: plan.name.clone(),
            why: format!("it does not map {what}"),
        };
        let output = |index| Place::of_object(&plan.outputs, outputs, index);
        let input = |index| Place::of_object(&plan.inputs, inputs, index);
        let mode = match (output(words::MODE), input(words::MODE_DISPLAY)) {
            (Some(mode), Some(display)) => Some([mode, display]),
            (Some(_), None) => return Err(missing("6061 (mode display), but 6060 (mode)")),
            (None, _) => None,
        };
        let places = Places {
            control: output(words::CONTROLWORD).ok_or_else(|| missing("6040 (controlword)"))?,
            target: output(words::TARGET_POSITION)
                .ok_or_else(|| missing("607A (target position)"))?,
            status: input(words::STATUSWORD).ok_or_else(|| missing("6041 (statusword)"))?,
            actual: input(words::ACTUAL_POSITION)
                .ok_or_else(|| missing("6064 (actual position)"))?,
            mode,
        };
        Ok(Self {
            device,
            places,
            counts_per_unit: drive.counts_per_unit,
            brake: drive.accel * drive.counts_per_unit.abs() * period_s * period_s,
            wanted: Wanted::NoTorque,
            state: DriveState::NotReady,
            had_torque: false,
            word: words::DISABLE_VOLTAGE,
            counts: 0.0,
            step: 0.0,
            is_told: false,
            has_rested: false,
        })
    }

    /// Its state after the last exchange.
    pub(crate) const fn state(&self) -> DriveState {
        self.state
    }

    /// Why it gets no torque.
    pub(crate) fn why_no_torque(&self, image: &[u8]) -> String {
        match self.places.mode {
            Some([_, display]) if !self.is_in_mode(image) => wrong_mode(display.read(image)),
            _ => format!("it stays in \"{}\" and gets no torque", self.state.name()),
        }
    }

    /// True while its target moves.
    pub(crate) fn moves(&self) -> bool {
        self.step != 0.0
    }

    /// True if its target can come to rest within one tick.
    pub(crate) fn can_stop(&self) -> bool {
        self.step.abs() <= self.brake
    }

    /// True if its axis was brought to rest for want of a command.
    pub(crate) const fn has_rested(&self) -> bool {
        self.has_rested
    }

    /// Actual position in counts, and in the unit of the axis.
    pub(crate) fn position(&self, image: &[u8]) -> (f64, f64) {
        let counts = self.places.actual.read(image);
        (counts, counts / self.counts_per_unit)
    }

    /// A command in counts, and the largest step in counts with which the axis may leave its place.
    pub(crate) fn in_counts(&self, disp: f64) -> (f64, f64) {
        (disp * self.counts_per_unit, self.brake.max(2.0))
    }

    /// Takes a command; true if it is beyond the type of the target. Real-time: yes.
    pub(crate) fn aim(&mut self, disp: f64) -> bool {
        let counts = disp * self.counts_per_unit;
        let (low, high) = self.places.target.kind.range();
        let limited = counts.clamp(low, high);
        self.step = limited - self.counts;
        self.counts = limited;
        self.is_told = true;
        counts != limited
    }

    /// From here on it is brought to torque. It takes commands again.
    pub(crate) const fn enable(&mut self) {
        self.wanted = Wanted::Operation;
        self.has_rested = false;
    }

    pub(crate) const fn quick_stop(&mut self) {
        self.wanted = Wanted::QuickStop;
    }

    pub(crate) const fn disable(&mut self) {
        self.wanted = Wanted::NoTorque;
        self.had_torque = false;
    }

    /// True if it holds its axis.
    pub(crate) const fn has_torque(&self) -> bool {
        matches!(
            self.state,
            DriveState::OperationEnabled | DriveState::QuickStopActive
        )
    }

    /// True if it is to follow its target.
    pub(crate) fn is_wanted(&self) -> bool {
        self.wanted == Wanted::Operation
    }

    /// True if it had torque, and does not follow its target any more.
    pub(crate) fn is_lost(&self) -> bool {
        self.had_torque && self.state != DriveState::OperationEnabled
    }

    /// Its last command counts for one more exchange: the target stays where it is. Real-time: yes.
    pub(crate) const fn repeat(&mut self) {
        (self.step, self.is_told) = (0.0, true);
    }

    /// It went without targets for a while. One that could not rest at once takes no more. Real-time: yes.
    pub(crate) fn note_silence(&mut self) {
        self.has_rested |= !self.can_stop();
        self.step = 0.0;
    }

    /// Writes its outputs before an exchange. Real-time: yes.
    pub(crate) fn prepare(&mut self, image: &mut [u8]) {
        self.word = match self.wanted {
            Wanted::NoTorque => words::DISABLE_VOLTAGE,
            // A state that cannot be read changes nothing.
            Wanted::Operation if self.had_torque && self.state == DriveState::NotReady => self.word,
            // A drive in another mode gets no torque.
            Wanted::Operation if !self.had_torque && !self.is_in_mode(image) => words::SHUTDOWN,
            Wanted::Operation => words::towards_operation(self.state),
            Wanted::QuickStop => words::QUICK_STOP,
        };
        self.places.control.write(f64::from(self.word), image);
        if let Some([mode, _]) = self.places.mode {
            mode.write(words::CYCLIC_POSITION.into(), image);
        }
        let is_told = std::mem::take(&mut self.is_told);
        if !self.has_torque() {
            (self.counts, self.step) = (self.places.actual.read(image), 0.0);
        } else if !is_told && self.moves() {
            let slower = (self.step.abs() - self.brake).max(0.0);
            // An axis that can rest at once is at rest.
            self.has_rested |= slower > 0.0;
            self.step = if slower > 0.0 {
                slower.copysign(self.step)
            } else {
                0.0
            };
            self.counts += self.step;
        }
        self.places.target.write(self.counts, image);
    }

    /// True if the drive shows cyclic synchronous position as its mode, or shows none.
    fn is_in_mode(&self, image: &[u8]) -> bool {
        let display = self.places.mode.map(|[_, display]| display.read(image));
        display.is_none_or(|mode| mode == f64::from(words::CYCLIC_POSITION))
    }

    /// Reads its inputs after a valid exchange. Real-time: yes.
    pub(crate) fn read(&mut self, image: &[u8]) {
        self.state = DriveState::of(self.places.status.read(image) as u16);
        match self.state {
            // It left its mode on its own: it stops and holds.
            DriveState::OperationEnabled if self.had_torque && !self.is_in_mode(image) => {
                self.wanted = Wanted::QuickStop;
            }
            DriveState::OperationEnabled => self.had_torque |= self.wanted == Wanted::Operation,
            DriveState::NotReady => {}
            // It stops by itself, and holds.
            DriveState::QuickStopActive if self.had_torque => self.wanted = Wanted::QuickStop,
            _ if self.had_torque => self.wanted = Wanted::NoTorque,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive with these further inputs, and its image: 10 bytes of outputs, then its inputs.
    fn drive(outputs: &[&str], inputs: &[&str]) -> Result<(Drive, Vec<u8>), BusError> {
        let entries = |texts: &[&str]| texts.iter().map(|text| text.parse().unwrap()).collect();
        let own = DrivePlan {
            counts_per_unit: 1000.0,
            accel: 1.0,
            following_counts: None,
            accepts_free_stop: false,
        };
        let plan = DevicePlan {
            name: "axis".to_owned(),
            vendor: 1,
            code: 1,
            revision: None,
            outputs: entries(outputs),
            inputs: entries(inputs),
            assign: false,
            setup: Vec::new(),
            drive: None,
        };
        Drive::new((0, &plan, &own), [0, 10], 0.001).map(|drive| (drive, vec![0; 20]))
    }

    /// The controlword after the drive has shown this state and these two bytes behind its position.
    fn word(drive: &mut Drive, image: &mut [u8], state: DriveState, more: u8) -> u16 {
        image[10..12].copy_from_slice(&state.bits().to_le_bytes());
        image[16] = more;
        drive.read(image);
        drive.prepare(image);
        u16::from_le_bytes([image[0], image[1]])
    }

    const OUTPUTS: [&str; 3] = ["6040:00 u16", "607a:00 i32", "6060:00 i8"];
    const INPUTS: [&str; 3] = ["6041:00 u16", "6064:00 i32", "6061:00 i8"];

    #[test]
    fn lost_torque_does_not_come_back() {
        use DriveState as S;
        let (mut own, mut image) = drive(&OUTPUTS[..2], &INPUTS[..2]).unwrap();
        own.enable();
        for (state, wanted) in [
            (S::SwitchOnDisabled, words::SHUTDOWN),
            (S::ReadyToSwitchOn, words::SWITCH_ON),
            (S::SwitchedOn, words::ENABLE_OPERATION),
            (S::OperationEnabled, words::ENABLE_OPERATION),
            (S::QuickStopActive, words::QUICK_STOP),
            (S::OperationEnabled, words::QUICK_STOP),
            (S::SwitchOnDisabled, words::DISABLE_VOLTAGE),
            (S::ReadyToSwitchOn, words::DISABLE_VOLTAGE),
        ] {
            assert_eq!(word(&mut own, &mut image, state, 0), wanted, "{state:?}");
        }
        assert!(own.is_lost());
        own.disable();
        own.enable();
        let again = word(&mut own, &mut image, S::SwitchOnDisabled, 0);
        assert_eq!(again, words::SHUTDOWN);
    }

    #[test]
    fn a_mapped_mode_is_written_and_awaited() {
        use DriveState as S;
        let (mut own, mut image) = drive(&OUTPUTS, &INPUTS).unwrap();
        own.enable();
        let ready = S::ReadyToSwitchOn;
        assert_eq!(word(&mut own, &mut image, ready, 0), words::SHUTDOWN);
        assert_eq!(image[6], 8);
        assert_eq!(word(&mut own, &mut image, ready, 8), words::SWITCH_ON);
        let enabled = word(&mut own, &mut image, S::OperationEnabled, 8);
        assert_eq!(enabled, words::ENABLE_OPERATION);
        let other = word(&mut own, &mut image, S::OperationEnabled, 1);
        assert_eq!(other, words::QUICK_STOP);
        let without = drive(&OUTPUTS, &INPUTS[..2]);
        assert!(matches!(without, Err(BusError::Drive { .. })));
    }
}
