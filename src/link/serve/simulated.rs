//! The far end on simulated time: the same greeting, the same stand and the same station as behind a socket, and in
//! between a wire of a constant delay.
//!
//! It is the controller's end of that wire, too: whoever waits for a reply lets time pass, and the far end does what is due
//! meanwhile. Everything happens on one thread, in the order of simulated time, so that a test with the same faults is the
//! same test to the last bit. What it does not do: faults. They are the host's ([`Host::faulty`]).

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::mpsc::UnboundedReceiver;

use super::data::{self, Session};
use super::greet::{self, Greeted};
use super::line::{Carried, Line};
use super::stand::Stand;
use super::{Desk, Heard, Host};
use crate::link::Transport;
use crate::link::fault::Queue;
use crate::link::inbox::Inbox;
use crate::substructure::LinkFault;
use crate::time::{Clock, Nanos, SimClock};
use crate::wire::Side;
use crate::wire::native::{Decoder, Frame, Kind, commanded, peek};

/// What a controller sent, as seen on the wire, and what the far end had to tell.
#[derive(Debug, Clone, PartialEq)]
pub enum Tapped {
    /// A frame of the controller left it.
    Sent {
        /// When.
        at: Nanos,
        /// What.
        kind: Kind,
        /// Number of the command that it belongs to.
        sequence: u64,
        /// Displacement of each axis of a command.
        disp: Vec<f64>,
    },
    /// The far end told this.
    Heard {
        /// When.
        at: Nanos,
        /// What.
        what: Heard,
    },
}

/// Where a simulated wire writes down what passes; everyone who has it can read it.
pub type Tap = Arc<Mutex<Vec<Tapped>>>;

/// The far end's end of the wire.
#[derive(Debug)]
pub(super) struct FarEnd {
    incoming: Queue,
    outgoing: Queue,
    now: Nanos,
    /// Time does not pass beyond this.
    limit: Nanos,
    delay_ns: u64,
}

impl FarEnd {
    /// True if something happens here until `limit`, before something arrives at the other end.
    fn is_due(&self, limit: Nanos) -> bool {
        let coming = self.incoming.next_at().is_some_and(|at| at <= limit);
        (self.now < limit || coming) && self.outgoing.next_at().is_none()
    }
}

impl Transport for FarEnd {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        self.outgoing.push(self.now.plus(self.delay_ns), frame);
        Ok(())
    }

    /// Returns before the deadline where the present of the controller's end is reached.
    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let until = deadline.min(self.limit).max(self.now);
        let at = self.incoming.next_at().filter(|at| *at <= until);
        self.now = self.now.max(at.unwrap_or(until));
        Ok(self.incoming.take(until, buffer))
    }

    fn now(&self) -> Nanos {
        self.now
    }
}

/// Where in its life the far end is.
enum Far {
    /// Nobody has armed it.
    Waiting(Box<Waiting>),
    /// With the time until which it waits.
    Testing(Box<Stand>, Nanos),
    /// Its session is over.
    Over(Line),
    /// While it goes on from one to the next.
    Between,
}

struct Waiting {
    line: Line,
    inbox: Inbox,
    greeted: Option<Greeted>,
}

/// A specimen behind a server, with both ends of the wire to it, on simulated time.
pub struct Simulated {
    clock: SimClock,
    delay_ns: u64,
    stream: bool,
    desk: Desk,
    far: Far,
    tapped: Option<Tapping>,
}

/// Who wants to know what passes.
struct Tapping {
    tap: Tap,
    heard: UnboundedReceiver<Heard>,
}

impl Tapping {
    fn write_down(&self, what: Tapped) {
        let mut tap = self.tap.lock().unwrap_or_else(PoisonError::into_inner);
        tap.push(what);
    }
}

impl std::fmt::Debug for Simulated {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Simulated")
            .field("host", &self.desk.host)
            .field("delay_ns", &self.delay_ns)
            .finish_non_exhaustive()
    }
}

/// Turns of the far end in which no time passes: beyond, it waits for nothing, and a real one would burn a processor.
const MOST_IN_VAIN: u32 = 10_000;

/// Nobody has an address here.
const PEER: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 0);

impl Simulated {
    /// `host` behind a wire whose frames take `delay_ns` either way; a `stream` tells when the far end has closed it,
    /// datagrams do not. Whoever waits at this end lets time pass on `clock`.
    #[must_use]
    pub fn new(host: Host, clock: SimClock, delay_ns: u64, stream: bool) -> Self {
        // Nobody listens, unless it is tapped.
        let (heard_in, _) = tokio::sync::mpsc::unbounded_channel();
        let (sessions, _) = crossbeam_channel::bounded(1);
        let line = Line::from(Carried::Simulated(Box::new(FarEnd {
            incoming: Queue::default(),
            outgoing: Queue::default(),
            now: clock.now(),
            limit: clock.now(),
            delay_ns,
        })));
        Self {
            clock,
            delay_ns,
            stream,
            desk: Desk {
                host,
                key: None,
                tls: None,
                spin_ns: 0,
                present: AtomicBool::new(false),
                waiting: AtomicUsize::new(0),
                stop: AtomicBool::new(false),
                sessions,
                heard: heard_in,
            },
            far: Far::Waiting(Box::new(Waiting {
                line,
                inbox: Inbox::new(stream),
                greeted: None,
            })),
            tapped: None,
        }
    }

    /// Writes down what the controller sends and what the far end tells.
    #[must_use]
    pub fn tapped(mut self, tap: Tap) -> Self {
        let (heard_in, heard) = tokio::sync::mpsc::unbounded_channel();
        self.desk.heard = heard_in;
        self.tapped = Some(Tapping { tap, heard });
        self
    }

    fn end(&mut self) -> Option<&mut FarEnd> {
        self.far.end()
    }

    /// When the next frame is here.
    fn next_at(&mut self) -> Option<Nanos> {
        self.end().and_then(|end| end.outgoing.next_at())
    }

    /// Lets the far end live until `limit`, or until something is on its way to this end.
    fn live(&mut self, limit: Nanos) {
        let mut in_vain = 0;
        while let Some(end) = self.far.end()
            && end.is_due(limit)
        {
            let before = end.now;
            end.limit = limit;
            self.far.turn(limit, &self.desk);
            let now = self.end().map_or(limit, |end| end.now);
            in_vain = if now > before { 0 } else { in_vain + 1 };
            debug_assert!(in_vain < MOST_IN_VAIN, "the far end spins at {now:?}");
            if let Some(tapped) = &mut self.tapped {
                while let Ok(what) = tapped.heard.try_recv() {
                    tapped.write_down(Tapped::Heard { at: now, what });
                }
            }
        }
    }
}

impl Far {
    fn end(&mut self) -> Option<&mut FarEnd> {
        match self {
            Far::Waiting(waiting) => waiting.line.far_end(),
            Far::Testing(stand, _) => stand.line().far_end(),
            Far::Over(line) => line.far_end(),
            Far::Between => None,
        }
    }

    /// Lives on by one turn, up to `limit`.
    fn turn(&mut self, limit: Nanos, desk: &Desk) {
        let over = match self {
            Far::Testing(stand, until) => {
                match stand.listen(*until).and_then(|()| stand.turn(desk)) {
                    Ok(next) => {
                        *until = next;
                        return;
                    }
                    Err(end) => Some(end),
                }
            }
            Far::Over(line) => {
                if let Some(end) = line.far_end() {
                    // What comes now is heard by nobody.
                    end.incoming = Queue::default();
                    end.now = end.now.max(limit);
                }
                return;
            }
            Far::Waiting(_) | Far::Between => None,
        };
        *self = match (std::mem::replace(self, Far::Between), over) {
            (Far::Waiting(waiting), _) => waiting.turn(desk),
            (Far::Testing(stand, _), Some(end)) => {
                let (ended, line) = stand.finish(end);
                desk.tell(ended);
                desk.give_back();
                Far::Over(line)
            }
            (other, _) => other,
        };
    }
}

impl Waiting {
    /// Hears one frame, and answers it.
    fn turn(self, desk: &Desk) -> Far {
        let Self {
            mut line,
            mut inbox,
            mut greeted,
        } = self;
        match line.recv(inbox.space(), Nanos(u64::MAX)) {
            Ok(Some(count)) => inbox.filled(count),
            Ok(None) => {}
            Err(_) => return Far::Over(line),
        }
        while let Ok(Some(place)) = inbox.next() {
            let frame = inbox.frame(place);
            let answer = match greeted.take() {
                None => hello(desk, frame).map(|new| {
                    let welcome = new.welcome.clone();
                    greeted = Some(new);
                    welcome
                }),
                Some(mut known) => match arming(desk, &mut known, frame) {
                    Ok(Some(arm)) => {
                        let session = Session {
                            line,
                            inbox,
                            peer: PEER,
                            greeted: known,
                            arm,
                        };
                        return match data::get_ready(session, desk, None) {
                            Ok(stand) => Far::Testing(Box::new(stand), Nanos(0)),
                            Err(refused) => {
                                let (refused, line) = *refused;
                                desk.tell(refused);
                                desk.give_back();
                                Far::Over(line)
                            }
                        };
                    }
                    other => {
                        greeted = Some(known);
                        other.map(|_| Vec::new())
                    }
                },
            };
            let (Ok(frame) | Err(frame)) = answer;
            if !frame.is_empty() {
                let _ = line.send(&frame);
            }
        }
        Far::Waiting(Box::new(Self {
            line,
            inbox,
            greeted,
        }))
    }
}

/// The judgement on a hello; an error is the answer to what is none.
fn hello(desk: &Desk, frame: &[u8]) -> Result<Greeted, Vec<u8>> {
    let mut decoder = Decoder::greeting(Side::Controller);
    let refused = |refuse| greet::refusal(refuse, None);
    let received = decoder
        .open(frame)
        .map_err(|error| refused(greet::nonsense(error)))?;
    let Frame::Control(message) = received.frame else {
        return Err(Vec::new());
    };
    let greeted = greet::judge(desk, message).map_err(refused)?;
    desk.tell(Heard::Hello {
        peer: PEER,
        software: greeted.software.clone(),
        test: greeted.test.clone(),
    });
    Ok(greeted)
}

/// The judgement on what comes after the welcome.
fn arming(
    desk: &Desk,
    greeted: &mut Greeted,
    frame: &[u8],
) -> Result<Option<crate::wire::handshake::Arm>, Vec<u8>> {
    let message = match greeted.decoder.open(frame).map(|received| received.frame) {
        Ok(Frame::Control(message)) => message,
        // A greeting that was repeated because its answer was late.
        Err(_) if Decoder::greeting(Side::Controller).open(frame).is_ok() => {
            return Err(greeted.welcome.clone());
        }
        Ok(_) | Err(_) => return Err(Vec::new()),
    };
    match greeted.arming(message) {
        Ok(Some(_)) if !desk.take() => Err(greet::refusal(greet::busy(), None)),
        Ok(arm) => Ok(arm),
        Err(refuse) => {
            let encoder = Some(&mut greeted.encoder);
            Err(greet::refusal(refuse, encoder))
        }
    }
}

impl Transport for Simulated {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        let now = self.clock.now();
        if self.stream && matches!(self.far, Far::Over(_)) && self.next_at().is_none() {
            return Err(LinkFault::Closed);
        }
        if let Some(tapped) = &self.tapped
            && let Some(seen) = peek(frame)
        {
            tapped.write_down(Tapped::Sent {
                at: now,
                kind: seen.kind,
                sequence: seen.sequence,
                disp: commanded(frame).map(|(disp, _)| disp).collect(),
            });
        }
        let delay_ns = self.delay_ns;
        if let Some(end) = self.end() {
            end.incoming.push(now.plus(delay_ns), frame);
        }
        Ok(())
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let until = deadline.max(self.clock.now());
        self.live(until);
        match self.next_at() {
            Some(at) if at <= until => {
                self.clock.sleep_until(at);
                Ok(self.end().and_then(|end| end.outgoing.take(at, buffer)))
            }
            None if self.stream && matches!(self.far, Far::Over(_)) => Err(LinkFault::Closed),
            Some(_) | None => {
                self.clock.sleep_until(until);
                Ok(None)
            }
        }
    }

    fn now(&self) -> Nanos {
        self.clock.now()
    }
}
