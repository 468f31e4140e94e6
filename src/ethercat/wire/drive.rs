//! State machine of a drive: ETG.6010 (CiA 402), statusword 6041 and controlword 6040.

/// Objects of a drive.
pub(crate) const ERROR_CODE: u16 = 0x603f;
pub(crate) const CONTROLWORD: u16 = 0x6040;
pub(crate) const STATUSWORD: u16 = 0x6041;
pub(crate) const QUICK_STOP_OPTION: u16 = 0x605a;
pub(crate) const MODE: u16 = 0x6060;
pub(crate) const MODE_DISPLAY: u16 = 0x6061;
pub(crate) const ACTUAL_POSITION: u16 = 0x6064;
pub(crate) const FOLLOWING_WINDOW: u16 = 0x6065;
pub(crate) const TARGET_POSITION: u16 = 0x607a;
pub(crate) const INTERPOLATION_TIME: u16 = 0x60c2;
/// Mode of operation: cyclic synchronous position.
pub(crate) const CYCLIC_POSITION: i8 = 8;

/// State of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveState {
    /// It starts.
    NotReady,
    /// It has no power, and power is locked.
    SwitchOnDisabled,
    /// It may be switched on.
    ReadyToSwitchOn,
    /// It is switched on, without torque.
    SwitchedOn,
    /// It follows its target with torque.
    OperationEnabled,
    /// It stops, or holds after a quick stop.
    QuickStopActive,
    /// It reacts to a fault.
    FaultReaction,
    /// It has a fault, and no torque.
    Fault,
}

impl DriveState {
    /// From the statusword (ETG.6010, table of state coding).
    pub(crate) const fn of(status: u16) -> Self {
        match (status & 0x4f, status & 0x6f) {
            (0x40, _) => Self::SwitchOnDisabled,
            (0x0f, _) => Self::FaultReaction,
            (0x08, _) => Self::Fault,
            (_, 0x21) => Self::ReadyToSwitchOn,
            (_, 0x23) => Self::SwitchedOn,
            (_, 0x27) => Self::OperationEnabled,
            (_, 0x07) => Self::QuickStopActive,
            _ => Self::NotReady,
        }
    }

    /// The bits of the statusword that show it.
    pub(crate) const fn bits(self) -> u16 {
        match self {
            Self::NotReady => 0x00,
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::QuickStopActive => 0x07,
            Self::FaultReaction => 0x0f,
            Self::Fault => 0x08,
        }
    }

    /// True if it has a fault.
    #[must_use]
    pub const fn is_fault(self) -> bool {
        matches!(self, Self::Fault | Self::FaultReaction)
    }

    /// Its name in the standard.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotReady => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStopActive => "quick stop active",
            Self::FaultReaction => "fault reaction active",
            Self::Fault => "fault",
        }
    }
}

/// Commands of the controlword.
pub(crate) const DISABLE_VOLTAGE: u16 = 0x00;
pub(crate) const QUICK_STOP: u16 = 0x02;
pub(crate) const SHUTDOWN: u16 = 0x06;
pub(crate) const SWITCH_ON: u16 = 0x07;
pub(crate) const ENABLE_OPERATION: u16 = 0x0f;
pub(crate) const FAULT_RESET: u16 = 0x80;

/// The controlword that brings a drive a step nearer to operation. A fault stays: only the operator resets it. A drive that made a
/// quick stop keeps its torque.
pub(crate) const fn towards_operation(state: DriveState) -> u16 {
    match state {
        DriveState::SwitchOnDisabled => SHUTDOWN,
        DriveState::ReadyToSwitchOn => SWITCH_ON,
        DriveState::SwitchedOn | DriveState::OperationEnabled => ENABLE_OPERATION,
        // It holds with torque: only the operator ends that.
        DriveState::QuickStopActive => QUICK_STOP,
        DriveState::NotReady | DriveState::FaultReaction | DriveState::Fault => DISABLE_VOLTAGE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_is_read_from_its_bits() {
        for state in [
            DriveState::NotReady,
            DriveState::SwitchOnDisabled,
            DriveState::ReadyToSwitchOn,
            DriveState::SwitchedOn,
            DriveState::OperationEnabled,
            DriveState::QuickStopActive,
            DriveState::FaultReaction,
            DriveState::Fault,
        ] {
            // Voltage enabled, warning, remote and target reached change nothing.
            for other in [0, 0x10, 0x80, 0x200, 0x1400] {
                assert_eq!(DriveState::of(state.bits() | other), state);
            }
        }
    }

    #[test]
    fn a_fault_is_never_reset_by_itself() {
        for state in [DriveState::Fault, DriveState::FaultReaction] {
            assert_eq!(towards_operation(state), DISABLE_VOLTAGE);
        }
        assert_eq!(towards_operation(DriveState::QuickStopActive), QUICK_STOP);
    }
}
