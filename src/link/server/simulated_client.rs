//! The far end's life on simulated time: it waits, is greeted and armed, stands through the test, and is over.
//!
//! Time passes here turn by turn, as far as the controller's end ([`super::Simulated`]) allows.

use std::net::SocketAddr;

use super::armed::Session;
use super::data;
use super::greet::{self, Greeted};
use super::line::{Carried, Line};
use super::stand::Stand;
use super::wire_end::FarEnd;
use super::{Desk, Heard};
use crate::link::Transport;
use crate::link::inbox::Inbox;
use crate::time::Nanos;
use crate::wire::Side;
use crate::wire::native::{Decoder, Frame};

/// Where in its life the far end is.
pub(super) enum Far {
    /// Nobody has armed it.
    Waiting(Box<Waiting>),
    /// With the time until which it waits.
    Testing(Box<Stand>, Nanos),
    /// Its session is over.
    Over(Line),
    /// While it goes on from one to the next.
    Between,
}

pub(super) struct Waiting {
    line: Line,
    inbox: Inbox,
    greeted: Option<Greeted>,
}

/// Nobody has an address here.
const PEER: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 0);

impl Far {
    /// Behind this end of a wire, and waiting for a controller.
    pub fn waiting(end: FarEnd, stream: bool) -> Self {
        Self::Waiting(Box::new(Waiting {
            line: Line::from(Carried::Simulated(Box::new(end))),
            inbox: Inbox::new(stream),
            greeted: None,
        }))
    }

    pub const fn is_over(&self) -> bool {
        matches!(self, Self::Over(_))
    }

    /// Its end of the wire.
    pub fn end(&mut self) -> Option<&mut FarEnd> {
        match self {
            Far::Waiting(waiting) => waiting.line.far_end(),
            Far::Testing(stand, _) => stand.line().far_end(),
            Far::Over(line) => line.far_end(),
            Far::Between => None,
        }
    }

    /// Lives on by one turn, up to `limit`.
    pub fn turn(&mut self, limit: Nanos, desk: &Desk) {
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
                    end.drop_what_comes(limit);
                }
                return;
            }
            Far::Waiting(_) | Far::Between => None,
        };
        *self = match (std::mem::replace(self, Far::Between), over) {
            (Far::Waiting(waiting), _) => waiting.turn(desk),
            (Far::Testing(stand, _), Some(end)) => {
                let (ended, line) = stand.finish(end, desk.host.starts_anew());
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
                            heard_at: line.now(),
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
