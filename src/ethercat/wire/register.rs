//! Registers of an ESC (ETG.1000.4) and the states of its application layer (ETG.1000.6).

/// Station address that the master gives.
pub(crate) const STATION: u16 = 0x0010;
/// Number of memory units, and of sync managers.
pub(crate) const COUNTS: u16 = 0x0004;
/// Features: bit 2 says that it has a distributed clock, bit 3 that the clock has 64 bits.
pub(crate) const FEATURES: u16 = 0x0008;
pub(crate) const HAS_CLOCK: u16 = 1 << 2;
pub(crate) const HAS_LONG_CLOCK: u16 = 1 << 3;
/// Link state of the ports: bits 4 to 7 say whether a link is there, 8 and 9 of port 0 the loop and the communication.
/// Memory of the user of an ESC: a simulated device says there that its specimens have been commanded.
pub(crate) const USER_MEMORY: u16 = 0x0f80;
pub(crate) const DL_STATUS: u16 = 0x0110;
/// Requested and actual state, and the code of a refusal.
pub(crate) const AL_CONTROL: u16 = 0x0120;
pub(crate) const AL_STATUS: u16 = 0x0130;
pub(crate) const AL_CODE: u16 = 0x0134;
/// Divider of both watchdogs in units of 40 ns less two, and the time of the process data in these units.
pub(crate) const WATCHDOG_DIVIDER: u16 = 0x0400;
pub(crate) const WATCHDOG_DATA: u16 = 0x0420;
/// Access to the EEPROM: 0 gives it to the master.
pub(crate) const SII_ACCESS: u16 = 0x0500;
pub(crate) const SII_CONTROL: u16 = 0x0502;
pub(crate) const SII_ADDRESS: u16 = 0x0504;
pub(crate) const SII_DATA: u16 = 0x0508;
/// First memory unit, and the distance from unit to unit.
pub(crate) const FMMU: u16 = 0x0600;
pub(crate) const FMMU_SIZE: u16 = 16;
/// First sync manager, and the distance from one to the next.
pub(crate) const SYNC_MANAGER: u16 = 0x0800;
pub(crate) const SYNC_MANAGER_SIZE: u16 = 8;
/// Byte of a sync manager with its state; bit 3: the mailbox is full.
pub(crate) const SYNC_MANAGER_STATUS: u16 = 5;
pub(crate) const MAILBOX_FULL: u8 = 1 << 3;
/// Distributed clock: time of arrival at the four ports, system time, its offset and its delay.
pub(crate) const DC_RECEIVE: u16 = 0x0900;
pub(crate) const DC_TIME: u16 = 0x0910;
pub(crate) const DC_LOCAL_RECEIVE: u16 = 0x0918;
pub(crate) const DC_OFFSET: u16 = 0x0920;
pub(crate) const DC_DELAY: u16 = 0x0928;
pub(crate) const DC_SPEED_START: u16 = 0x0930;
/// Activation of SYNC0, its start and its cycle.
pub(crate) const DC_ACTIVATION: u16 = 0x0980;
pub(crate) const DC_START: u16 = 0x0990;
pub(crate) const DC_CYCLE: u16 = 0x09a0;

/// State of the application layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AlState {
    /// No communication but registers.
    Init = 1,
    /// Mailbox.
    PreOp = 2,
    /// Mailbox and inputs; outputs are off.
    SafeOp = 4,
    /// Inputs and outputs.
    Op = 8,
}

/// Bit of the AL status that marks an error, and of the AL control that acknowledges it.
pub(crate) const AL_ERROR: u8 = 0x10;

impl AlState {
    /// The state with this number, without the error bit.
    #[must_use]
    pub const fn of(number: u8) -> Option<Self> {
        match number & 0x0f {
            1 => Some(Self::Init),
            2 => Some(Self::PreOp),
            4 => Some(Self::SafeOp),
            8 => Some(Self::Op),
            _ => None,
        }
    }

    /// Its name in the standard.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Init => "INIT",
            Self::PreOp => "PRE-OP",
            Self::SafeOp => "SAFE-OP",
            Self::Op => "OP",
        }
    }
}

/// The likely cause of a refusal, from the code of the AL status (ETG.1000.6, table of AL status codes).
#[must_use]
pub const fn cause(code: u16) -> &'static str {
    match code {
        0x0000 => "it gives no reason",
        0x0001 => "an error that its maker does not describe",
        0x0002 => "its memory is used up",
        0x0011 => "it does not allow this change of state",
        0x0012 => "it does not know the requested state",
        0x0013 => "it has no bootstrap state",
        0x0014 => "its firmware is not valid",
        0x0015 | 0x0016 => "it refuses the settings of its mailbox",
        0x0017 => "it refuses the settings of a sync manager",
        0x0018 => "it has no valid inputs",
        0x0019 => "it has no valid outputs: its first outputs did not arrive in time",
        0x001a => "it lost its synchronisation",
        0x001b => "its watchdog expired: no process data arrived in time",
        0x001c => "it refuses the type of a sync manager",
        0x001d => {
            "the length of its outputs differs from its mapping: compare `outputs` with its manual"
        }
        0x001e => {
            "the length of its inputs differs from its mapping: compare `inputs` with its manual"
        }
        0x001f => "it refuses the setting of its watchdog: change `watchdog_s`",
        0x0020 => "it needs a cold start: switch its power off and on",
        0x0021 => "it needs INIT first",
        0x0022 => "it needs PRE-OP first",
        0x0023 => "it needs SAFE-OP first",
        0x0024 => "its mapping of inputs is not valid",
        0x0025 => "its mapping of outputs is not valid",
        0x0026 => "its settings do not fit together",
        0x0027 => "it does not run without distributed clocks: use `clock = \"follow\"`",
        0x0028 => "it does not support its kind of synchronisation",
        0x0029 => "it needs three buffers for its process data",
        0x002a => "its watchdog of the background expired",
        0x002b => "it has neither valid inputs nor valid outputs",
        0x002c | 0x002d => "it gets no SYNC signal: its clock did not start",
        0x002e => "the cycle is too short for it: use a lower rate",
        0x0030 => {
            "it refuses the settings of its clock: it wants distributed clocks and another cycle"
        }
        0x0031..=0x0033 => "its clock does not lock to the bus clock",
        0x0034 => "it does not support this cycle: use another rate",
        0x0035 => "the cycle of its clock is not valid: use another rate",
        0x0036 => "the cycle of SYNC0 is not valid: use another rate",
        0x0042 => "its mailbox failed",
        0x0050 => "its EEPROM cannot be read",
        0x0051 => "its EEPROM is faulty",
        0x0060 => "it restarted by itself",
        0x00f0 => "its controller reports an error of the application",
        _ => "see the manual of the device for this code",
    }
}
