//! A server behind a simulated wire of a constant delay, with the client's end of that wire.
//!
//! The handshake and the session are the same as behind a socket. While the client waits for a reply, time passes and the
//! server does its due work. Everything happens on one thread in the order of simulated time, so a test with the same
//! faults is the same bit for bit. The host plays faults ([`Host::faulty`]), not this wire.

use std::sync::{Arc, Mutex, PoisonError};

use crossbeam_channel::{Receiver, unbounded};

use super::native_handshake::Offer;
use super::shared::Shared;
use super::simulated_server::SimulatedServer;
use super::wire_end::WireEnd;
use super::{Host, ServerEvent};
use crate::Transport;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_wire::native::{Kind, commanded, peek};

/// A frame that the client sent, or an event of the server.
#[derive(Debug, Clone, PartialEq)]
pub enum Tapped {
    /// The client sent a frame.
    Sent {
        /// The time.
        at: Nanos,
        /// The kind of the frame.
        kind: Kind,
        /// Number of the command that it belongs to.
        sequence: u64,
        /// Displacement of each axis of a command.
        disp: Vec<f64>,
    },
    /// The server reported an event.
    Event {
        /// The time.
        at: Nanos,
        /// The event.
        event: ServerEvent,
    },
}

/// The record of a simulated wire.
pub type Tap = Arc<Mutex<Vec<Tapped>>>;

/// A specimen behind a server on simulated time, with both ends of the wire to it.
pub struct Simulated {
    clock: SimClock,
    stream: bool,
    offer: Arc<Offer>,
    shared: Shared,
    server: SimulatedServer,
    tapped: Option<Tapping>,
}

/// The record of a wire, and the events of its server.
struct Tapping {
    tap: Tap,
    events: Receiver<ServerEvent>,
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
            .field("host", &self.offer.host)
            .finish_non_exhaustive()
    }
}

/// Largest number of turns in which no time passes: a server that needs more waits for nothing.
const MOST_IDLE_TURNS: u32 = 10_000;

impl Simulated {
    /// A server of `host` behind a wire whose frames take `delay_ns` in each direction. A `stream` shows that the server has closed
    /// it; datagrams do not. A wait of the client lets time pass on `clock`. `tap` records what the client sends and the events of
    /// the server.
    #[must_use]
    pub fn new(host: Host, clock: SimClock, delay_ns: u64, stream: bool, tap: Option<Tap>) -> Self {
        // The events are dropped, unless the wire is tapped.
        let (events_in, events) = unbounded();
        let end = WireEnd::new(clock.now(), delay_ns);
        let offer = Arc::new(Offer { host, key: None });
        Self {
            clock,
            stream,
            shared: Shared::new(events_in),
            server: SimulatedServer::waiting(Arc::clone(&offer), end, stream),
            offer,
            tapped: tap.map(|tap| Tapping { tap, events }),
        }
    }

    fn end(&mut self) -> Option<&mut WireEnd> {
        self.server.end()
    }

    /// When the next frame is here.
    fn next_at(&mut self) -> Option<Nanos> {
        self.end().and_then(|end| end.next_at())
    }

    /// Lets the server run until `limit`, or until a message leaves for the client.
    fn run(&mut self, limit: Nanos) {
        let mut idle_turns = 0;
        while let Some(end) = self.server.end()
            && end.is_due(limit)
        {
            let before = end.now();
            end.allow(limit);
            self.server.turn(limit, &self.offer, &self.shared);
            let now = self.end().map_or(limit, |end| end.now());
            idle_turns = if now > before { 0 } else { idle_turns + 1 };
            debug_assert!(idle_turns < MOST_IDLE_TURNS, "the server spins at {now:?}");
            if let Some(tapped) = &mut self.tapped {
                while let Ok(event) = tapped.events.try_recv() {
                    tapped.write_down(Tapped::Event { at: now, event });
                }
            }
        }
    }
}

impl Transport for Simulated {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        let now = self.clock.now();
        if self.stream && self.server.is_over() && self.next_at().is_none() {
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
        if let Some(end) = self.end() {
            end.carry(now, frame);
        }
        Ok(())
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let until = deadline.max(self.clock.now());
        self.run(until);
        match self.next_at() {
            Some(at) if at <= until => {
                self.clock.sleep_until(at);
                Ok(self.end().and_then(|end| end.arrived(at, buffer)))
            }
            None if self.stream && self.server.is_over() => Err(LinkFault::Closed),
            Some(_) | None => {
                self.clock.sleep_until(until);
                Ok(None)
            }
        }
    }

    fn now(&self) -> Nanos {
        self.clock.now()
    }

    fn is_simulated(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_actuator::specimen::SpecimenLaw;
    use gusset_wire::handshake::{Axis, Limits, Unit};

    fn host() -> Host {
        let axis = Axis {
            name: "axis 1".to_owned(),
            disp_unit: Unit::Metre,
            force_unit: Unit::Newton,
            limits: Limits::NONE,
        };
        let build = || {
            let text = "law = { linear = { stiffness_n_per_m = 8000.0 } }";
            let law: SpecimenLaw = toml::from_str(text).unwrap();
            Ok(law.build(1).unwrap())
        };
        Host::new("rig".into(), vec![axis], Box::new(build)).unwrap()
    }

    #[test]
    fn each_repeatable_event_has_a_quota() {
        let sequence = 1;
        for event in [
            ServerEvent::Tripped {
                sequence,
                text: String::new(),
            },
            ServerEvent::Holding {
                sequence: None,
                silent_s: 1.0,
            },
            ServerEvent::Resumed { sequence },
        ] {
            let tap = Tap::default();
            let mut end = Simulated::new(host(), SimClock::new(), 0, true, Some(tap));
            for _ in 0..1000 {
                end.shared.tell(event.clone());
            }
            let tapping = end.tapped.as_mut().unwrap();
            let told = std::iter::from_fn(|| tapping.events.try_recv().ok());
            // The last one announces that further events are not reported.
            assert_eq!(told.count(), 101, "{event:?}");
        }
    }
}
