//! The data thread: one session after another, each with a specimen in its virgin state or a connection of its own.

use std::net::SocketAddr;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError};

use super::greet::{self, Greeted};
use super::line::Line;
use super::stand::{Stand, gone_silent, hear, said_goodbye};
use super::{Desk, Heard};
use crate::catalog::ending::Cause;
use crate::link::Transport;
use crate::link::inbox::Inbox;
use crate::link::rig::{TestEnd, Visitor};
use crate::link::socket::LOOK;
use crate::rt::throttle::Throttle;
use crate::rt::{RtPlan, apply};
use crate::time::Nanos;
use crate::wire::handshake::{self, Arm, Control};
use crate::wire::native::Frame;

/// The stop flag is looked at this often while nobody is there.
const PAUSE: Duration = Duration::from_millis(50);

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
    /// When something of it was heard last.
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
}

/// One session after another until the server stops.
pub(super) fn serve(desk: &Desk, sessions: &Receiver<Session>, plan: Option<&RtPlan>) {
    // Held for as long as the thread lives: it keeps the processors awake.
    let granted = plan.map(apply);
    for feature in granted.iter().flat_map(|granted| granted.missing()) {
        let reason = feature.reason.as_deref().unwrap_or("refused");
        desk.tell(Heard::NotGranted {
            text: format!("{}: {reason}", feature.asked),
        });
    }
    let cpu = granted.as_ref().and_then(|granted| granted.cpu);
    while !desk.stop.load(Ordering::Acquire) {
        match sessions.recv_timeout(PAUSE) {
            Ok(session) => {
                desk.tell(attend(session, desk, cpu));
                desk.give_back();
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// One test, from its beginning to its end.
fn attend(session: Session, desk: &Desk, cpu: Option<usize>) -> Heard {
    match get_ready(session, desk, cpu) {
        Ok(stand) => stand.run(desk),
        Err(refused) => refused.0,
    }
}

/// Everything is got ready, and only then the controller hears that the specimen is armed. An error is what has to be told
/// of a test that cannot begin, and its line.
pub(super) fn get_ready(
    mut session: Session,
    desk: &Desk,
    cpu: Option<usize>,
) -> Result<Stand, Box<(Heard, Line)>> {
    if let Some(script) = &desk.host.faults {
        let text = script.words();
        desk.tell(Heard::Told { text });
        session.line = session.line.played(
            script,
            session.greeted.period_ns,
            session.arm.first_sequence,
        );
    }
    let peer = session.peer;
    let station = desk.host.station(false).and_then(|mut station| {
        station.keep_log_away_from(cpu);
        station.now_is(session.line.now());
        let visitor = session.visitor();
        let told = station.begin(&visitor, &mut || session.is_wanted(desk));
        for text in told.map_err(|over| over.text)? {
            desk.tell(Heard::Told { text });
        }
        Ok(station)
    });
    let mut station = match station {
        Ok(station) => station,
        Err(text) => {
            let refuse = greet::not_ready(&text);
            let frame = greet::refusal(refuse, Some(&mut session.greeted.encoder));
            // Who does not hear it sees the connection close.
            let _ = session.line.send(&frame);
            return Err(Box::new((Heard::Refused { peer, text }, session.line)));
        }
    };
    let armed = session.greeted.armed(session.arm.clone());
    if let Err(fault) = session.line.send(&armed) {
        let text = fault.to_string();
        station.end(Cause::ControllerVanished, &text);
        return Err(Box::new((Heard::Refused { peer, text }, session.line)));
    }
    desk.tell(Heard::Armed {
        peer,
        test: session.greeted.test.clone(),
    });
    // A data thread that has a processor of its own must leave the kernel its share of it.
    let spin_ns = match cpu {
        None => desk.spin_ns,
        Some(_) => {
            let around = desk.spin_ns.saturating_mul(2);
            Throttle::USUAL.fit_spin(around, session.greeted.period_ns) / 2
        }
    };
    Ok(Stand::new(session, station, spin_ns))
}

impl Session {
    /// While its specimen is got ready: the controller, who waits for that, is still there, and nobody told us to stop. Other
    /// words of his before he is armed are repeated questions and signs of life.
    fn is_wanted(&mut self, desk: &Desk) -> Result<(), TestEnd> {
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

    fn visitor(&self) -> Visitor {
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
