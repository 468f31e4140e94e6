//! A simulated drive: its state machine (ETG.6010) and its position.

use crate::wire::drive as words;
use crate::wire::drive::DriveState;

/// Share of its speed that a drive keeps from tick to tick in a quick stop, and the speed in counts a tick that counts as rest.
const QUICK_STOP: f64 = 0.8;
const REST: f64 = 0.5;
/// Bits of the statusword beside the state: voltage enabled and remote.
const ALWAYS: u16 = 0x0210;

/// A drive.
#[derive(Debug)]
pub(crate) struct Servo {
    pub state: DriveState,
    control: u16,
    /// Where it holds or moves its axis, in counts, and the change in the last tick.
    pub counts: f64,
    step: f64,
    /// Code of its fault, 0 without one.
    pub error: u16,
}

impl Servo {
    pub(crate) const fn at(counts: f64) -> Self {
        Self {
            state: DriveState::SwitchOnDisabled,
            control: 0,
            counts,
            step: 0.0,
            error: 0,
        }
    }

    pub(crate) const fn status(&self) -> u16 {
        self.state.bits() | ALWAYS
    }

    /// A fault: its axis holds where it is.
    pub(crate) const fn fail(&mut self, code: u16) {
        self.error = code;
        self.state = DriveState::FaultReaction;
        self.step = 0.0;
    }

    /// A controlword that came by the mailbox: it can reset a fault, and nothing else.
    pub(crate) fn reset(&mut self, control: u16) {
        let rises = control & words::FAULT_RESET != 0 && self.control & words::FAULT_RESET == 0;
        if rises && self.state == DriveState::Fault {
            self.state = DriveState::SwitchOnDisabled;
            self.error = 0;
        }
        self.control = control;
    }

    /// One tick with these outputs.
    pub(crate) fn go_on(&mut self, control: u16, target: f64, keeps_torque: bool) {
        use DriveState as S;
        self.reset(control);
        self.state = match self.state {
            S::FaultReaction => S::Fault,
            S::Fault => S::Fault,
            S::NotReady => S::SwitchOnDisabled,
            _ if control & 0x02 == 0 => S::SwitchOnDisabled,
            S::OperationEnabled if control & 0x06 == 0x02 => S::QuickStopActive,
            S::QuickStopActive => S::QuickStopActive,
            _ if control & 0x06 == 0x02 => S::SwitchOnDisabled,
            S::SwitchOnDisabled if control & 0x07 == 0x06 => S::ReadyToSwitchOn,
            S::SwitchOnDisabled => S::SwitchOnDisabled,
            _ if control & 0x07 == 0x06 => S::ReadyToSwitchOn,
            S::ReadyToSwitchOn => S::SwitchedOn,
            S::SwitchedOn | S::OperationEnabled if control & 0x0f == 0x0f => S::OperationEnabled,
            S::SwitchedOn | S::OperationEnabled => S::SwitchedOn,
        };
        match self.state {
            S::OperationEnabled => {
                self.step = target - self.counts;
                self.counts = target;
            }
            S::QuickStopActive => {
                self.step *= QUICK_STOP;
                if self.step.abs() < REST {
                    self.step = 0.0;
                    if !keeps_torque {
                        self.state = S::SwitchOnDisabled;
                    }
                }
                self.counts += self.step;
            }
            _ => self.step = 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_follows_the_words_of_the_standard() {
        let mut servo = Servo::at(10.0);
        let mut seen = Vec::new();
        for _ in 0..4 {
            servo.go_on(words::towards_operation(servo.state), 10.0, true);
            seen.push(servo.state);
        }
        let wanted = [
            DriveState::ReadyToSwitchOn,
            DriveState::SwitchedOn,
            DriveState::OperationEnabled,
            DriveState::OperationEnabled,
        ];
        assert_eq!(seen, wanted);
        servo.go_on(words::ENABLE_OPERATION, 110.0, true);
        let mut way = vec![servo.counts];
        for _ in 0..40 {
            servo.go_on(words::QUICK_STOP, 0.0, true);
            way.push(servo.counts);
        }
        assert!(way.windows(2).all(|pair| pair[1] >= pair[0]));
        assert_eq!(
            (servo.state, way[39]),
            (DriveState::QuickStopActive, way[40])
        );
        servo.go_on(words::DISABLE_VOLTAGE, 0.0, true);
        assert_eq!(servo.state, DriveState::SwitchOnDisabled);
    }

    #[test]
    fn a_fault_needs_the_rising_bit_to_end() {
        let mut servo = Servo::at(0.0);
        servo.fail(0x3220);
        servo.go_on(words::ENABLE_OPERATION, 5.0, true);
        servo.go_on(words::ENABLE_OPERATION, 5.0, true);
        assert_eq!(
            (servo.state, servo.error, servo.counts),
            (DriveState::Fault, 0x3220, 0.0)
        );
        servo.go_on(words::FAULT_RESET, 5.0, true);
        assert_eq!(
            (servo.state, servo.error),
            (DriveState::SwitchOnDisabled, 0)
        );
    }
}
