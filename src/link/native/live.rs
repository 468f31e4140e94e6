//! A connected specimen: commands out, measurements in, on the loop's thread.

mod ends;

use std::time::Duration;

use super::ask::{nudge_ns, watchdog_ns};
use super::book::Book;
use super::refused::{parting, reason};
use super::setup::NativeSetup;
use crate::Transport;
use crate::inbox::Inbox;
use crate::socket::LOOK;
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, LinkStats, Measurement, Status,
};
use gusset_quantity::time::Nanos;
use gusset_wire::WireError;
use gusset_wire::handshake::{self, Control, Welcome};
use gusset_wire::native::{
    Cause, Decoder, Encoder, Frame, Heartbeat, LARGEST_FRAME, Notice, SAYS_LOST,
};

/// How often a stop is sent over UDP before shutdown begins.
const HALTS: u32 = 4;
/// Reads after the deadline: frames that have arrived are taken, a flood is not.
const EXTRA_READS: u32 = 64;
/// A specimen that receives nothing for half a minute gives a controller up: between commands it receives a heartbeat
/// this often.
const KEEP_ALIVE_NS: u64 = 10_000_000_000;
/// Variant number of a control message that repeats an Arm.
const ARM: [u8; 4] = [3, 0, 0, 0];

/// More details than a [`LinkFault`].
#[derive(Debug, Clone, PartialEq)]
enum Detail {
    Wire(WireError),
    Silent { seconds: f64 },
    Goodbye(Cause),
    Said(String),
}

/// One session.
pub(super) struct Live {
    transport: Box<dyn Transport>,
    inbox: Inbox,
    encoder: Encoder,
    decoder: Decoder,
    out: Vec<u8>,
    book: Book,
    coupling: Coupling,
    session: u64,
    /// Version of the handshake that both speak.
    version: u16,
    reply_timeout_ns: u64,
    /// After this time over UDP an unanswered command is sent again; over TCP a heartbeat is sent.
    nudge_ns: u64,
    connect_limit: Duration,
    /// When the last frame left.
    sent_ns: u64,
    /// The newest command, to be sent again.
    issued: Option<u64>,
    /// Since when its answer is waited for.
    awaited_since: Option<Nanos>,
    time: f64,
    dt: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    armed: bool,
    /// The operator holds the test.
    paused: bool,
    /// The request to arm that has been sent and not been answered.
    asked_to_arm: Option<Vec<u8>>,
    fault: Option<LinkFault>,
    detail: Option<Detail>,
    /// Its goodbye reports that the specimen behind it is lost, or cannot rule this out.
    may_be_lost: bool,
    /// Its goodbye has come; none before that was waited for.
    acknowledged: Option<bool>,
    /// Text of its goodbye, beyond the cause.
    last_words: Option<String>,
}

impl Live {
    pub(super) fn new(
        mut transport: Box<dyn Transport>,
        inbox: Inbox,
        encoder: Encoder,
        decoder: Decoder,
        setup: &NativeSetup,
        welcome: &Welcome,
    ) -> Self {
        let axes = setup.axes.len();
        let reply_timeout = setup.reply_timeout.as_nanos();
        let reply_timeout_ns = u64::try_from(reply_timeout).unwrap_or(u64::MAX);
        let nudge_ns = nudge_ns(watchdog_ns(welcome), reply_timeout_ns, inbox.is_stream());
        if setup.key.is_some() {
            transport.trust_only_frames();
        }
        Self {
            sent_ns: transport.now().0,
            transport,
            inbox,
            encoder,
            decoder,
            out: vec![0; LARGEST_FRAME],
            book: Book::new(axes),
            coupling: setup.coupling,
            session: welcome.session,
            version: welcome.version,
            reply_timeout_ns,
            nudge_ns,
            connect_limit: setup.connect_limit,
            issued: None,
            awaited_since: None,
            time: 0.0,
            dt: 0.0,
            disp: vec![0.0; axes],
            vel: vec![0.0; axes],
            armed: false,
            paused: false,
            asked_to_arm: None,
            fault: None,
            detail: None,
            may_be_lost: false,
            acknowledged: None,
            last_words: None,
        }
    }

    pub(super) fn stats(&self) -> LinkStats {
        LinkStats {
            unreachable: self.transport.unreachable(),
            ..self.book.stats
        }
    }

    pub(super) fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
        self.book.recover(force)
    }

    pub(super) fn complaint(&self) -> Option<String> {
        let ours = self.detail.as_ref().map(|detail| match detail {
            Detail::Wire(error) => error.to_string(),
            Detail::Silent { seconds } => format!("{seconds} s"),
            Detail::Goodbye(cause) => format!("the specimen said goodbye: {}", cause.why()),
            Detail::Said(text) => text.clone(),
        });
        let lost = matches!(self.detail, None | Some(Detail::Silent { .. }));
        let below = self.fault.filter(|_| lost).and(self.transport.tls_fault());
        let below = below.map(|why| format!("TLS: {why}"));
        let all: Vec<_> = ours.into_iter().chain(below).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }

    /// True if only the server at the other end knows where the specimen is: it lost it, or is too old to rule this out.
    pub(super) const fn may_be_lost(&self) -> bool {
        self.may_be_lost
    }

    /// Keeps what a goodbye says about who holds the specimen. An older peer has only a text for that, which may say anything.
    fn heard_goodbye(&mut self, code: u32, text: &str) {
        let says_only = self.version < SAYS_LOST && !text.is_empty();
        self.may_be_lost |= match Cause::from_code(code) {
            Ok(Cause::Tripped) => says_only,
            cause => cause == Ok(Cause::Lost),
        };
    }

    /// Real-time: yes.
    pub(super) fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        if command.disp.len() != self.disp.len() || command.vel.len() != self.vel.len() {
            return Err(self.fail_plainly(LinkFault::Refused));
        }
        self.issued = Some(command.sequence);
        self.awaited_since = None;
        self.paused = false;
        (self.time, self.dt) = (command.time, command.dt);
        // Lengths are equal: checked above.
        self.disp.copy_from_slice(command.disp);
        self.vel.copy_from_slice(command.vel);
        self.send_command()
    }

    fn send_command(&mut self) -> Result<(), LinkFault> {
        let command = Command {
            sequence: self.issued.unwrap_or_default(),
            time: self.time,
            dt: self.dt,
            disp: &self.disp,
            vel: &self.vel,
        };
        let written = self.encoder.command(&command, &mut self.out);
        self.send(written)
    }

    fn send(&mut self, written: Result<usize, WireError>) -> Result<(), LinkFault> {
        let length = match written {
            Ok(length) => length,
            Err(error) => return Err(self.fail(error.fault(), Detail::Wire(error))),
        };
        let frame = self.out.get(..length).unwrap_or_default();
        self.sent_ns = self.transport.now().0;
        match self.transport.send(frame) {
            Ok(()) => Ok(()),
            Err(fault) => Err(self.fail_plainly(fault)),
        }
    }

    /// Real-time: yes. A lockstep answer is waited for by the transport's clock, whatever clock the loop runs on.
    pub(super) fn collect(
        &mut self,
        deadline: Nanos,
        into: &mut Measurement,
    ) -> Result<Freshness, LinkFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        // Nothing was asked, so nothing will ever come.
        let issued = self.issued.ok_or(LinkFault::Timeout)?;
        let lockstep = self.coupling == Coupling::Lockstep;
        let (deadline, nudge) = if lockstep {
            let nudge = self.transport.now().plus(self.nudge_ns);
            (self.patience_ends(), nudge)
        } else {
            (deadline, Nanos(u64::MAX))
        };
        if self.hear_answer(issued, deadline, nudge)? {
            self.book.copy_into(into);
            return Ok(Freshness::Fresh);
        }
        if lockstep {
            let seconds = self.reply_timeout_ns as f64 * 1e-9;
            return Err(self.fail(LinkFault::Timeout, Detail::Silent { seconds }));
        }
        self.book.copy_into(into);
        Ok(Freshness::Stale)
    }

    /// Until when a lockstep answer is waited for. Real-time: yes.
    fn patience_ends(&mut self) -> Nanos {
        let now = self.transport.now();
        let since = *self.awaited_since.get_or_insert(now);
        since.plus(self.reply_timeout_ns)
    }

    /// Reads incoming frames up to `deadline`, or up to the answer: then true. From `nudge` on it repeats the request
    /// now and then. Real-time: yes.
    fn hear_answer(
        &mut self,
        issued: u64,
        deadline: Nanos,
        mut nudge: Nanos,
    ) -> Result<bool, LinkFault> {
        let mut extra = EXTRA_READS;
        if self.has_answer(issued)? {
            return Ok(true);
        }
        loop {
            let until = deadline.min(nudge);
            match self.transport.recv(self.inbox.space(), until) {
                Ok(Some(count)) => {
                    self.inbox.filled(count);
                    if self.has_answer(issued)? {
                        return Ok(true);
                    }
                    if self.transport.now() >= deadline {
                        extra -= 1;
                        if extra == 0 {
                            return Ok(false);
                        }
                    }
                }
                Ok(None) if until < deadline => {
                    self.nudge(issued)?;
                    nudge = self.transport.now().plus(self.nudge_ns);
                }
                Ok(None) => return Ok(false),
                Err(fault) => return Err(self.fail_plainly(fault)),
            }
        }
    }

    /// Takes the frames that are here; true if the answer is one of them. Real-time: yes.
    fn has_answer(&mut self, issued: u64) -> Result<bool, LinkFault> {
        self.take_frames(issued)?;
        Ok(self.book.has(issued))
    }

    /// True if the answer to the last command is here, or comes within `wait_ns` and within its time limit. A lost answer is
    /// requested again, as [`Live::collect`] does while it waits. On simulated time no wait takes any: then the specimen is
    /// responsible. Real-time: yes.
    pub(super) fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let issued = self.issued.ok_or(LinkFault::Timeout)?;
        if wait_ns > 0 && self.transport.is_simulated() {
            return Ok(true);
        }
        let deadline = match wait_ns {
            0 => LOOK,
            wait_ns => self.transport.now().plus(wait_ns).min(self.patience_ends()),
        };
        let nudge = Nanos(self.sent_ns).plus(self.nudge_ns);
        if self.hear_answer(issued, deadline, nudge)? {
            return Ok(true);
        }
        if self.transport.now() >= Nanos(self.sent_ns).plus(self.nudge_ns) {
            self.nudge(issued)?;
        }
        Ok(false)
    }

    /// A lockstep answer is overdue. A lost datagram is sent again (the specimen answers again and moves nothing). A
    /// stream loses nothing, but a heartbeat shows the specimen's watchdog that the controller is alive.
    fn nudge(&mut self, issued: u64) -> Result<(), LinkFault> {
        if self.inbox.is_stream() {
            let beat = Heartbeat {
                sequence: issued,
                time: self.time,
                status: Status::default(),
            };
            let written = self.encoder.heartbeat(beat, &mut self.out);
            self.send(written)
        } else {
            self.send_command()
        }
    }

    /// Between commands: takes the frames that have come, and sends a heartbeat now and then. A heartbeat does not end
    /// the hold of a specimen whose commands have stopped.
    pub(super) fn attend(&mut self) -> Result<(), LinkFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let Some(issued) = self.issued else {
            return Ok(());
        };
        for _ in 0..EXTRA_READS {
            self.take_frames(issued)?;
            match self.transport.recv(self.inbox.space(), Nanos(0)) {
                Ok(Some(count)) => self.inbox.filled(count),
                Ok(None) => break,
                Err(fault) => return Err(self.fail_plainly(fault)),
            }
        }
        let silent_ns = self.transport.now().0.saturating_sub(self.sent_ns);
        if self.paused && !self.inbox.is_stream() && silent_ns >= self.nudge_ns {
            // The message that nothing will come may have been lost.
            return self.say_hold(issued, Cause::Operator);
        }
        if silent_ns < KEEP_ALIVE_NS {
            return Ok(());
        }
        let beat = Heartbeat {
            sequence: issued,
            time: self.time,
            status: Status::default(),
        };
        let written = self.encoder.heartbeat(beat, &mut self.out);
        self.send(written)
    }

    /// See [`gusset_quantity::substructure::Substructure::pause`].
    pub(super) fn pause(&mut self) -> Result<(), LinkFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        self.paused = true;
        let cause = Cause::Operator;
        self.issued
            .map_or(Ok(()), |issued| self.say_hold(issued, cause))
    }

    /// See [`gusset_quantity::substructure::Substructure::halt`]. It has no effect once the next command has overtaken it: over
    /// UDP it is sent as often as datagrams may be lost in a row.
    pub(super) fn halt(&mut self) -> Result<(), LinkFault> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let Some(issued) = self.issued else {
            return Ok(());
        };
        let times = if self.inbox.is_stream() { 1 } else { HALTS };
        (0..times).try_for_each(|_| self.say_hold(issued, Cause::Orderly))
    }

    fn say_hold(&mut self, sequence: u64, cause: Cause) -> Result<(), LinkFault> {
        let written = self.encoder.hold(Notice { sequence, cause }, &mut self.out);
        self.send(written)
    }

    /// Takes every whole frame that is here. Over UDP a frame that fails a check is counted and dropped, over TCP it
    /// ends the link. A force that is NaN, in a frame that is otherwise right, always ends it.
    fn take_frames(&mut self, issued: u64) -> Result<(), LinkFault> {
        loop {
            let outcome = match self.inbox.next() {
                Ok(None) => return Ok(()),
                Ok(Some(place)) => self.take(place, issued),
                Err(error) => Err((error.fault(), Some(Detail::Wire(error)))),
            };
            let Err((fault, detail)) = outcome else {
                continue;
            };
            let dropped = match &detail {
                Some(Detail::Wire(WireError::NotFinite { .. })) => false,
                Some(Detail::Wire(error)) => {
                    if matches!(error, WireError::Replayed { .. } | WireError::TooOld { .. }) {
                        self.book.stats.duplicates += 1;
                    } else {
                        self.book.stats.corrupt += 1;
                    }
                    !self.inbox.is_stream()
                }
                _ => false,
            };
            if !dropped {
                self.fault = Some(fault);
                self.detail = detail;
                return Err(fault);
            }
        }
    }

    fn take(
        &mut self,
        place: std::ops::Range<usize>,
        issued: u64,
    ) -> Result<(), (LinkFault, Option<Detail>)> {
        let wire = |error: WireError| (error.fault(), Some(Detail::Wire(error)));
        let received = self.decoder.open(self.inbox.frame(place)).map_err(wire)?;
        match received.frame {
            Frame::Measurement(measurement) => self
                .book
                .measured(&measurement, received.arrival, issued)
                .map_err(wire),
            Frame::Heartbeat(beat) => {
                self.book.flags(beat.status);
                Ok(())
            }
            Frame::Goodbye(notice) => {
                let cause = notice.cause;
                self.heard_goodbye(cause.code(), "");
                Err((LinkFault::Closed, Some(Detail::Goodbye(cause))))
            }
            // The answer to an Arm that was repeated.
            Frame::Control(message) if message.starts_with(&ARM) => Ok(()),
            Frame::Control(message) => Err(match handshake::decode(message).map_err(wire)? {
                Control::Bye(bye) => {
                    self.heard_goodbye(bye.cause, &bye.text);
                    let said = format!(
                        "the specimen said goodbye: {}",
                        parting(bye.cause, &bye.text)
                    );
                    (LinkFault::Closed, Some(Detail::Said(said)))
                }
                Control::Refuse(refuse) => {
                    let said = reason(refuse.code, &refuse.text).to_owned();
                    (LinkFault::Refused, Some(Detail::Said(said)))
                }
                other => wire(WireError::Order {
                    expected: "a measurement",
                    found: other.name(),
                }),
            }),
            // A specimen cannot write these: the decoder refuses them.
            Frame::Command(_) | Frame::Hold(_) | Frame::Retire(_) => Ok(()),
        }
    }

    fn fail_plainly(&mut self, fault: LinkFault) -> LinkFault {
        self.fault = Some(fault);
        fault
    }

    fn fail(&mut self, fault: LinkFault, detail: Detail) -> LinkFault {
        self.detail = Some(detail);
        self.fail_plainly(fault)
    }
}
