//! A controller that has armed: the session on its way to the specimen, and how its end is noticed.

use std::net::SocketAddr;
use std::sync::atomic::Ordering;

use super::Desk;
use super::greet::Greeted;
use super::line::Line;
use crate::catalog::ending::Cause;
use crate::link::Transport;
use crate::link::inbox::Inbox;
use crate::link::native::with_words;
use crate::link::rig::{TestEnd, Visitor};
use crate::link::socket::LOOK;
use crate::substructure::LinkFault;
use crate::time::Nanos;
use crate::wire::handshake::{self, Arm, Control};
use crate::wire::native::{self, Frame};

/// Over UDP a controller asks to be armed again and again until it is. One that has not for so long, and not for the time of
/// its watchdog, is gone: many of its questions would have been lost in a row.
const SILENT_NS: u64 = 2_000_000_000;

/// A controller that has armed, on its way to the data thread.
pub(super) struct Session {
    pub(super) line: Line,
    pub(super) inbox: Inbox,
    pub(super) peer: SocketAddr,
    pub(super) greeted: Greeted,
    pub(super) arm: Arm,
    /// Time of its last message.
    pub(super) heard_at: Nanos,
}

impl Session {
    /// Hands a session over; the specimen is reserved for it, and the controller still owed an answer to its request to
    /// arm.
    pub(super) fn start(
        desk: &Desk,
        line: Line,
        inbox: Inbox,
        peer: SocketAddr,
        greeted: Greeted,
        arm: Arm,
    ) {
        let session = Session {
            heard_at: line.now(),
            line,
            inbox,
            peer,
            greeted,
            arm,
        };
        // The reservation makes room in the queue certain; a data thread that is gone ends the server.
        if desk.sessions.try_send(session).is_err() {
            desk.give_back();
        }
    }
    /// Checks, while the specimen gets ready, that the controller is still connected and that no stop was requested. Before it is
    /// armed, other messages of the controller are repeated questions and signs of life.
    pub(super) fn is_wanted(&mut self, desk: &Desk) -> Result<(), TestEnd> {
        if desk.stop.load(Ordering::Acquire) {
            return Err(TestEnd::told_to_stop());
        }
        hear(&mut self.line, &mut self.inbox, self.peer, LOOK)?;
        loop {
            let place = match self.inbox.next() {
                Ok(Some(place)) => place,
                Ok(None) => return self.is_heard(),
                Err(error) if self.inbox.is_stream() => return Err(TestEnd::failed(error)),
                // A datagram of anybody's.
                Err(_) => continue,
            };
            let parting = match self.greeted.decoder.open(self.inbox.frame(place)) {
                Ok(received) => {
                    self.heard_at = self.line.now();
                    match received.frame {
                        Frame::Retire(notice) | Frame::Goodbye(notice) => {
                            Some(said_goodbye(notice.cause.code(), ""))
                        }
                        Frame::Control(message) => match handshake::decode(message) {
                            Ok(Control::Bye(bye)) => Some(said_goodbye(bye.cause, &bye.text)),
                            _ => None,
                        },
                        _ => None,
                    }
                }
                Err(error) if self.inbox.is_stream() => return Err(TestEnd::failed(error)),
                Err(_) => None,
            };
            if let Some(over) = parting {
                // Nothing was completed: it was not armed.
                let cause = match over.cause {
                    Cause::Done => Cause::Operator,
                    cause => cause,
                };
                return Err(TestEnd { cause, ..over });
            }
        }
    }

    /// Where no connection tells that a controller is gone, its silence does.
    fn is_heard(&self) -> Result<(), TestEnd> {
        let silent = self.line.now().since(self.heard_at);
        if self.inbox.is_stream() || silent < SILENT_NS.max(self.greeted.watchdog_ns) {
            return Ok(());
        }
        Err(gone_silent(self.peer, silent))
    }

    pub(super) fn visitor(&self) -> Visitor {
        Visitor {
            peer: self.peer,
            test: self.greeted.test.clone(),
            software: self.greeted.software.clone(),
            rate: Some(self.greeted.rate),
            watchdog_s: Some(self.greeted.watchdog_s),
            sampling: self.greeted.sampling,
            first_sequence: self.arm.first_sequence,
            start: self.arm.disp.clone(),
            limits: self.greeted.limits.clone(),
        }
    }
}

/// The controller said goodbye, with the code of its cause and a text that may be empty.
pub(super) fn said_goodbye(cause: u32, text: &str) -> TestEnd {
    let cause = native::Cause::from_code(cause).ok();
    let why = match cause {
        Some(native::Cause::Orderly) => " at the end of the test",
        Some(cause) => &format!(": {}", cause.why()),
        None => ": for an unknown reason",
    };
    TestEnd {
        // A cause of a later version is unknown here. It counts as a trip.
        cause: cause.map_or(Cause::ControllerTripped, native::Cause::ending),
        text: with_words(format!("the controller said goodbye{why}"), text.trim()),
    }
}

/// The controller has sent no message for `silent_ns`.
pub(super) fn gone_silent(peer: SocketAddr, silent_ns: u64) -> TestEnd {
    let seconds = silent_ns / 1_000_000_000;
    TestEnd::vanished(format_args!("{peer} has been silent for {seconds} s"))
}

/// Takes what comes from the controller until then; false if nothing does.
pub(super) fn hear(
    line: &mut Line,
    inbox: &mut Inbox,
    peer: SocketAddr,
    until: Nanos,
) -> Result<bool, TestEnd> {
    match line.recv(inbox.space(), until) {
        Ok(Some(count)) => {
            inbox.filled(count);
            Ok(true)
        }
        Ok(None) => Ok(false),
        Err(fault) => Err(lost_controller(line, inbox.is_stream(), peer, fault)),
    }
}

/// Why nothing more comes from the controller.
pub(super) fn lost_controller(
    line: &Line,
    is_stream: bool,
    peer: SocketAddr,
    fault: LinkFault,
) -> TestEnd {
    match (line.tls_fault(), fault) {
        _ if line.is_cut() => TestEnd::vanished(format_args!(
            "the connection to {peer} is cut: a fault that is played (closed)"
        )),
        (Some(why), _) => TestEnd::vanished(format_args!("{peer}: TLS: {why}")),
        (None, LinkFault::Closed) if !is_stream => TestEnd::vanished(format_args!(
            "{peer} left without a goodbye: its port is closed"
        )),
        (None, LinkFault::Closed) => TestEnd::vanished(format_args!(
            "{peer} closed the connection without a goodbye"
        )),
        (None, fault) => TestEnd::vanished(fault),
    }
}
