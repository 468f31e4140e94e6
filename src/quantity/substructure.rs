//! The interface between the loop and every specimen: commands out, measurements in.
//!
//! A [`Substructure`] may be a simulated specimen in this process, a server across a socket or a recorded test. The
//! loop issues command `k` to all of them, then collects from all of them, so that two remote specimens cost one
//! round trip and not two.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::catalog::ending::Cause;
use crate::state;
use crate::state::{Stateful, Visit};
use crate::time::Nanos;

/// One command to a substructure. Slices have one entry per axis.
#[derive(Debug, Clone, Copy)]
pub struct Command<'a> {
    /// Number of this command, growing by one from 0; exchanges before t = 0 are counted too.
    pub sequence: u64,
    /// Test time t in s that the displacement belongs to; 0 also for every exchange before t = 0.
    pub time: f64,
    /// Test time that passes from the previous command to this one, in s: Δt, or 0 for a hold.
    pub dt: f64,
    /// Displacement in m (rad for a rotational axis).
    pub disp: &'a [f64],
    /// Velocity in m/s. It is the integrator's published v, a backward difference: it belongs to t − Δt/2.
    pub vel: &'a [f64],
}

/// Flags that the server sends with each measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Status(pub u32);

impl Status {
    /// The interlock or emergency stop at the specimen's end is open.
    pub const INTERLOCK: Status = Status(1);
    /// The specimen holds because commands stopped coming.
    pub const HOLDING: Status = Status(2);
    /// A sensor or actuator is at the end of its range.
    pub const SATURATED: Status = Status(4);
    /// The iteration of a simulated actuator with its specimen did not converge: the measurement is not exact.
    pub const UNSETTLED: Status = Status(8);

    /// The loop's own mark in its rows, never on a link: from here on the specimen is lost.
    pub const LOST: Status = Status(1 << 16);
    /// The loop's own mark, too: the specimen is lost, and the last command was not sent.
    pub const UNSENT: Status = Status(1 << 17);

    /// The loop's own mark, too: the measurement is older than its command.
    pub const STALE: Status = Status(1 << 18);

    /// The loop's own mark, too: the operator did not wait for the answer to the last command.
    pub const OWED: Status = Status(1 << 19);

    /// The loop's own mark, too, beside [`Status::HOLDING`]: the specimen held until its last command came, but the answer to that
    /// command no longer reports it.
    pub const HELD: Status = Status(1 << 20);

    /// Status from the bits of a frame, without the marks that only the loop may set.
    #[must_use]
    pub const fn told(bits: u32) -> Self {
        Self(bits & (Self::LOST.0 - 1))
    }

    /// True if every bit of `flag` is set.
    #[must_use]
    pub const fn has(self, flag: Status) -> bool {
        self.0 & flag.0 == flag.0
    }
}

impl Stateful for Status {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.0.visit_state(visit);
    }
}

/// One measurement, filled in place. Vectors have one entry per axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Newest command that was in force when this was sampled.
    pub sequence: u64,
    /// The specimen's own time of sampling in s, 0 where it has none.
    pub time: f64,
    /// Flags of the server.
    pub status: Status,
    /// Measured displacement in m.
    pub disp: Vec<f64>,
    /// Measured resisting force in N, positive with positive displacement of a spring.
    pub force: Vec<f64>,
}

impl Measurement {
    /// A measurement of zeros for `axes` axes.
    #[must_use]
    pub fn zeros(axes: usize) -> Self {
        Self {
            sequence: 0,
            time: 0.0,
            status: Status::default(),
            disp: vec![0.0; axes],
            force: vec![0.0; axes],
        }
    }
}

state! { Measurement as "measurement" { sequence, time, status, disp, force } }

/// Whether the loop waits for one reply to each command, or the specimen measures on its own clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coupling {
    /// One reply is owed for each command; no command leaves while one is owed; stale data never occur.
    Lockstep,
    /// Replies carry sequence numbers; a missing one is stale data, for which a policy decides.
    Sampled,
}

/// Whether the collected measurement answers the issued command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freshness {
    /// It does.
    Fresh,
    /// The deadline passed; the measurement holds the newest data known, and its sequence says how old they are.
    Stale,
}

/// Why a substructure is lost. Final: recovering in mid-test is not a thing a specimen survives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error, Serialize, Deserialize)]
#[error("{}", self.text())]
#[serde(rename_all = "snake_case")]
pub enum LinkFault {
    /// The peer closed the connection.
    Closed,
    /// No reply within the reply time-out.
    Timeout,
    /// Bytes that the protocol does not allow.
    Malformed,
    /// The peer refuses to take part.
    Refused,
    /// The peer speaks another version.
    Version,
    /// The peer could not prove who it is.
    Auth,
    /// The peer does not take our bytes.
    Backpressure,
    /// A number in the specimen's answer is not finite.
    NotFinite,
    /// The law of a specimen that is computed in this process gave no finite number. Nothing was lost but the computation.
    Diverged,
}

impl LinkFault {
    /// The cause of a test that ended by it. Real-time: yes.
    #[must_use]
    pub const fn cause(self) -> Cause {
        match self {
            Self::NotFinite => Cause::LinkNotFinite,
            Self::Diverged => Cause::LinkDiverged,
            _ => Cause::Link,
        }
    }

    /// What happened, in words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Closed => "the peer closed the connection",
            Self::Timeout => "no reply within the time limit",
            Self::Malformed => "the peer sent bytes that the protocol does not allow",
            Self::Refused => "the peer refused",
            Self::Version => "the peer speaks another protocol version",
            Self::Auth => "the peer failed authentication",
            Self::Backpressure => "the peer does not read: its receive window is full",
            Self::NotFinite => "a number in the specimen's answer is not finite",
            Self::Diverged => {
                "its law, which is computed here, gives no finite force any more: the computation diverged"
            }
        }
    }

    /// Advice on the fault, for someone who reads of it the next day.
    #[must_use]
    pub const fn advice(self) -> &'static str {
        match self {
            Self::Closed => "look at the specimen's end: its program ended, or its log says why",
            Self::Timeout => {
                "look at the specimen's end and at the network; `reply_timeout_s` is the limit"
            }
            Self::Malformed => {
                "is it the right port, does `protocol` name what it speaks, does it keep to the layout?"
            }
            Self::Refused => {
                "the specimen's end says why; two commands without an answer are refused, too"
            }
            Self::Version => "one of the two programs is too old",
            Self::Auth => "give both ends the same key file",
            Self::Backpressure => "the specimen's end hangs, or commands come faster than it reads",
            Self::NotFinite => "look at the sensor, its amplifier and the law of the specimen",
            Self::Diverged => {
                "a law that goes beyond all bounds, an unstable integration, or a step that is too long for it"
            }
        }
    }
}

/// How a substructure is left at the end of a test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Retirement {
    /// The test ran to its end.
    Orderly,
    /// An operator ended it.
    Operator,
    /// The test was tripped or failed; the specimen holds where it is.
    Tripped,
    /// The client that commanded it through us is gone without a goodbye.
    Abandoned,
    /// The program through which it was commanded received a request to end.
    Shutdown,
}

impl From<Cause> for Retirement {
    /// Message to a specimen about the end.
    fn from(cause: Cause) -> Self {
        match cause {
            Cause::Done => Self::Orderly,
            Cause::Operator => Self::Operator,
            Cause::Shutdown => Self::Shutdown,
            Cause::ControllerVanished => Self::Abandoned,
            _ => Self::Tripped,
        }
    }
}

/// Traffic counters of a link, as the link counts them. All zero in process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStats {
    /// Answers that came after the deadline of their command.
    pub late: u64,
    /// Answers that did not arrive themselves but were recovered from the history of a later one.
    pub recovered: u64,
    /// Messages that failed a check.
    pub corrupt: u64,
    /// Messages that came more than once.
    pub duplicates: u64,
    /// Commands that never arrived, as the server counts them.
    pub missed: u64,
    /// ICMP errors in a signed session over datagrams.
    pub unreachable: u64,
}

/// Description of a specimen once it is connected. Empty in process.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Introduction {
    /// Description of the server, in words.
    pub peer: String,
    /// Its own estimate of its initial stiffness in its own units, n × n by columns; empty if it has none.
    pub stiffness: Vec<f64>,
    /// Its position: the command that would not move it, in its own units; empty if it is not known.
    pub standing: Vec<f64>,
    /// That position was measured: it is near the command that would not move it, not that command itself.
    pub measured: bool,
    /// Its force there, in its own units; empty if it does not say.
    pub force: Vec<f64>,
    /// Warnings for the user; the test may still run.
    pub warnings: Vec<String>,
    /// It reports that it is simulated: nothing breaks.
    pub simulated: bool,
    /// It reports that an earlier test of its process left its state. Other computations make a new specimen for each test.
    pub keeps_state: bool,
    /// It does not report that it measures displacement, although its protocol has a flag for that: its displacement may be the
    /// command.
    pub repeats_the_command: bool,
}

/// The end that holds a specimen when commands cease.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holder {
    /// None is needed: it is computed in this process, and ends with the test.
    Needless,
    /// The watchdog at its server, which was agreed on.
    ItsWatchdog,
    /// The watchdog at its server, but it was never armed: no command was sent.
    NeverArmed,
    /// A gateway lost it, or cannot rule that out: only the server of the specimen knows its position.
    Unknown,
    /// No end: the protocol has no message for it.
    Nobody,
}

/// For a specimen whose server is gone or silent: its present state is not known here, only the agreement is.
pub const AGREED: &str =
    "a watchdog was agreed with its end, which has to hold it: look whether it does";

/// Why a specimen cannot take part. Nothing was moved.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{text}")]
pub struct Unavailable {
    /// The kind of the fault.
    pub fault: LinkFault,
    /// What happened and what to do about it.
    pub text: String,
}

/// Period in ns at which a wait for a specimen checks whether its answer is still wanted.
pub const LISTEN_NS: u64 = 50_000_000;

/// Anything that answers a displacement with a force.
pub trait Substructure: Send {
    /// Number of axes; fixed for the whole test.
    fn axes(&self) -> usize;

    /// How this substructure is coupled: it answers each command, unless it says otherwise.
    fn coupling(&self) -> Coupling {
        Coupling::Lockstep
    }

    /// True if replies come from outside this process.
    fn is_remote(&self) -> bool {
        false
    }

    /// The end that holds the specimen if commands stay away.
    fn holder(&self) -> Holder {
        if self.is_remote() {
            Holder::Nobody
        } else {
            Holder::Needless
        }
    }

    /// Connects and agrees on everything; nothing moves yet. May block, within its own time limit. Called once,
    /// before the loop's thread takes over.
    ///
    /// # Errors
    /// The specimen cannot take part.
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction::default())
    }

    /// Sends the request that [`Substructure::arm`] waits for, and does not wait, so that several specimens get ready
    /// in parallel.
    ///
    /// # Errors
    /// The specimen is gone.
    fn ask_to_arm(&mut self, sequence: u64, disp: &[f64]) -> Result<(), LinkFault> {
        let _ = (sequence, disp);
        Ok(())
    }

    /// Prepares the specimen for the first command: its number and its position. May block on the loop's thread, within its
    /// own time limit and for as long as it is `wanted`. A second call, after the commands of the wiring check, restarts
    /// simulated specimens. False if it was not wanted any more before the specimen was ready.
    ///
    /// # Errors
    /// The specimen is not ready, is in another position, or is gone.
    fn arm(
        &mut self,
        sequence: u64,
        disp: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        let _ = (sequence, disp, wanted);
        Ok(true)
    }

    /// Traffic counters of the link so far.
    fn stats(&self) -> LinkStats {
        LinkStats::default()
    }

    /// More than the fault says about why the link was lost, in words. Called after the end.
    fn complaint(&self) -> Option<String> {
        None
    }

    /// Sends one command; never blocks. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault>;

    /// Takes the answer to the last command; never blocks past `deadline`. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    fn collect(&mut self, deadline: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault>;

    /// An answer recovered from the history of a later one: its force, and the number of its command. Each call takes one.
    /// Real-time: yes.
    fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
        let _ = force;
        None
    }

    /// True if [`Substructure::collect`] would not have to wait: the answer to the last command is here, or comes within
    /// `wait_ns` of wall time. Never blocks longer, and not at all with 0: a specimen may take several ticks, and the caller
    /// may have other work meanwhile. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        let _ = wait_ns;
        Ok(true)
    }

    /// Visits the state of a specimen that is computed in this process. False if it has none here: a physical specimen behind a
    /// link keeps its own state, and a recording follows its rows. Real-time: yes.
    fn visit_state(&mut self, visit: &mut dyn Visit) -> bool {
        let _ = visit;
        false
    }

    /// The controller announces the wall time from command to command in s; 0 if it does not.
    fn commanded_every(&mut self, seconds: f64) {
        let _ = seconds;
    }

    /// Measures before the first command. False if the specimen does not: then only its introduction is known.
    fn at_rest(&mut self, into: &mut Measurement) -> bool {
        let _ = into;
        false
    }

    /// A specimen that is computed in this process forgets what was not accepted.
    fn revert(&mut self) {}

    /// Tangent stiffness, n × n by columns, in its own units. False if it is not known here. Real-time: yes.
    fn tangent(&self, stiffness: &mut [f64]) -> bool {
        let _ = stiffness;
        false
    }

    /// The step of command `sequence` is accepted: commit. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        let _ = sequence;
        Ok(())
    }

    /// Nothing to command for now: notices a peer that has gone, and keeps one that is there from giving us up. Does not
    /// block.
    ///
    /// # Errors
    /// The link is lost.
    fn attend(&mut self) -> Result<(), LinkFault> {
        Ok(())
    }

    /// The operator holds the test: no commands follow until the operator continues it, and silence is no fault. Real-time:
    /// yes.
    ///
    /// # Errors
    /// The link is lost.
    fn pause(&mut self) -> Result<(), LinkFault> {
        Ok(())
    }

    /// The test is over here, and the shutdown begins with the next command. The specimen stops, and its server judges
    /// the next commands from rest. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    fn halt(&mut self) -> Result<(), LinkFault> {
        self.pause()
    }

    /// All commands were sent: the specimen comes to rest where it is. True if a drive holds it with a torque that only the operator
    /// may remove; then [`Substructure::retire`] follows when the operator has said that the specimen is unloaded. May block.
    fn settle(&mut self, how: Retirement) -> bool {
        let _ = how;
        false
    }

    /// Deviation of the clock of the specimen from the clock of this machine, in ppm; NaN before it is known. Real-time: yes.
    fn clock_ppm(&self) -> f64 {
        f64::NAN
    }

    /// Says goodbye in the link's protocol. Called once, whatever happened before.
    fn retire(&mut self, how: Retirement);

    /// Whether the specimen has acknowledged the goodbye. `None` where no acknowledgement is expected: before it was armed,
    /// in this process, or in a protocol without such an answer.
    fn has_acknowledged(&self) -> Option<bool> {
        None
    }

    /// The specimen's answer to the goodbye beyond a plain goodbye, in words: for instance, that it tripped.
    fn last_words(&self) -> Option<String> {
        None
    }
}
