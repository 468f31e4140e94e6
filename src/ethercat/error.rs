//! Why a bus, or a device on it, cannot take part.

use thiserror::Error;

use crate::line::LineFault;
use crate::wire::register::{AlState, cause};

/// Why a bus cannot take part. Nothing has moved, unless the test had begun.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum BusError {
    /// The line carries no frames.
    #[error(transparent)]
    Line(#[from] LineFault),
    /// The network interface cannot be used.
    #[error("{0}")]
    Interface(String),
    /// The devices cannot be simulated.
    #[error("the simulated bus cannot be made: {0}")]
    Simulation(String),
    /// The system gives no thread.
    #[error("the system gives no thread for the bus")]
    NoKeeper,
    /// No device answers.
    #[error("no device answers: look at the cable to the first device and at its power")]
    NoDevice,
    /// A device is in operation: another program commands the bus, or a program ended without leaving it.
    #[error(
        "device {position} is in {} (AL status code {code:#06x}): another program may use the bus, or its outputs may hold a specimen. \
         Make sure that nothing is loaded; then `gusset bus scan INTERFACE --release` releases the devices",
        state.name()
    )]
    InOperation {
        /// Its position on the bus, from 1.
        position: u16,
        /// Its state.
        state: AlState,
        /// Its AL status code.
        code: u16,
    },
    /// More or fewer devices than the test file has.
    #[error("{found} devices answer, but the test file has {wanted}: `gusset bus scan` lists them")]
    Count {
        /// Devices that answer.
        found: usize,
        /// Devices of the test file.
        wanted: usize,
    },
    /// Another device than the test file has.
    #[error(
        "device {position} (`{name}`) is vendor {:#x}, product {:#x}, revision {:#x}; the test file has vendor {:#x}, product {:#x}{}",
        found[0], found[1], found[2], wanted.0, wanted.1, in_words(wanted.2)
    )]
    Identity {
        /// Its position on the bus, from 1.
        position: usize,
        /// Its name in the test file.
        name: String,
        /// Vendor, product code and revision of the device.
        found: [u32; 3],
        /// Those of the test file.
        wanted: (u32, u32, Option<u32>),
    },
    /// A device that answered before is silent.
    #[error("device `{device}` does not answer ({what}): look at its cable and its power")]
    Silent {
        /// Its name.
        device: String,
        /// The request.
        what: &'static str,
    },
    /// A device refuses a state, or has left it.
    #[error(
        "device `{device}` is in {} and not in {} (AL status code {code:#06x}): {}",
        found.map_or("no known state", AlState::name), wanted.name(), why_in_state(*found, *wanted, *code)
    )]
    State {
        /// Its name.
        device: String,
        /// The state that it is to have.
        wanted: AlState,
        /// The state that it has.
        found: Option<AlState>,
        /// Its AL status code.
        code: u16,
    },
    /// A device refuses an object.
    #[error("device `{device}` refuses object {index:04x}:{sub:02x}: {why}")]
    Object {
        /// Its name.
        device: String,
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub: u8,
        /// Its abort code, if it gave one.
        abort: Option<u32>,
        /// Its answer.
        why: String,
    },
    /// The process data of a device differ from the test file.
    #[error(
        "device `{device}`: its {direction} are {found}, but the test file has {wanted}: correct `{direction}`, or let `assign = true` \
         write them"
    )]
    Mapping {
        /// Its name.
        device: String,
        /// "outputs" or "inputs".
        direction: &'static str,
        /// The entries of the device.
        found: String,
        /// Those of the test file.
        wanted: String,
    },
    /// The process data do not fit into one frame.
    #[error(
        "the devices have {found} bytes of process data together; at most {allowed} are allowed"
    )]
    Size {
        /// Bytes of all devices.
        found: usize,
        /// Bytes that fit.
        allowed: usize,
    },
    /// A watchdog is not what was asked for.
    #[error(
        "device `{device}` has a watchdog of {found_us} µs, but {wanted_us} µs were written: it does not take `watchdog_s`"
    )]
    Watchdog {
        /// Its name.
        device: String,
        /// As read back; 0: it never expires.
        found_us: u64,
        /// As written.
        wanted_us: u64,
    },
    /// No device has a distributed clock.
    #[error("no device has a distributed clock of 64 bits: use `clock = \"free\"`")]
    NoClock,
    /// A drive must not have torque.
    #[error("drive `{device}`: {why}")]
    Drive {
        /// Its name.
        device: String,
        /// Why.
        why: String,
    },
    /// An axis is not where its first command is.
    #[error(
        "drive `{device}` is at {found} counts, but the first command is at {wanted}: it moved since it was connected"
    )]
    Moved {
        /// Its name.
        device: String,
        /// Its actual position.
        found: f64,
        /// The command.
        wanted: f64,
    },
    /// The interlock is open.
    #[error("the interlock is open: close it, then start again")]
    Interlock,
    /// No valid exchange for too long.
    #[error("{ticks} successive exchanges were not complete: {what}")]
    Stale {
        /// Successive ticks.
        ticks: u32,
        /// The missing part.
        what: String,
    },
    /// An axis that was brought to rest got a command.
    #[error("no command came in time: the axis was brought to rest and takes no more commands")]
    Rested,
    /// A reply is missing while a drive moves, and the command would be sent once more.
    #[error(
        "a reply is missing while a drive moves that cannot stop in one tick: it was brought to rest, because a gateway sends a \
         command again only to an axis that stands"
    )]
    Unrepeated,
    /// The standing command does not fit its output.
    #[error(
        "the standing command is count {0:.0}, which its output cannot carry: correct `m_per_count` or `stands_at_m`"
    )]
    Beyond(f64),
    /// A drive holds its axis, but takes no commands since the last test.
    #[error(
        "drive `{0}` takes no commands since the last test: unload its axis, end the program, then start again"
    )]
    Spent(String),
    /// The operator ended the test meanwhile.
    #[error("it is not wanted any more")]
    Unwanted,
}

/// Why a device is in another state.
fn why_in_state(found: Option<AlState>, wanted: AlState, code: u16) -> &'static str {
    if (found, wanted, code) == (Some(AlState::SafeOp), AlState::Op, 0) {
        return "it gives no error, so it still waits for its first outputs or for its clock";
    }
    cause(code)
}

fn in_words(revision: Option<u32>) -> String {
    revision.map_or_else(String::new, |one| format!(", revision {one:#x}"))
}
