//! The far end on simulated time: the same greeting, the same stand and the same station as behind a socket, and in
//! between a wire of a constant delay.
//!
//! This is the controller's end of that wire: whoever waits for a reply lets time pass, and the far end ([`Far`]) does what is
//! due meanwhile. Everything happens on one thread, in the order of simulated time, so that a test with the same faults is
//! the same test to the last bit. What it does not do: faults. They are the host's ([`Host::faulty`]).

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::mpsc::UnboundedReceiver;

use super::far::Far;
use super::wire_end::FarEnd;
use super::{Desk, Heard, Host};
use crate::link::Transport;
use crate::substructure::LinkFault;
use crate::time::{Clock, Nanos, SimClock};
use crate::wire::native::{Kind, commanded, peek};

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

/// A specimen behind a server, with both ends of the wire to it, on simulated time.
pub struct Simulated {
    clock: SimClock,
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
            .finish_non_exhaustive()
    }
}

/// Turns of the far end in which no time passes: beyond, it waits for nothing, and a real one would burn a processor.
const MOST_IN_VAIN: u32 = 10_000;

impl Simulated {
    /// `host` behind a wire whose frames take `delay_ns` either way; a `stream` tells when the far end has closed it,
    /// datagrams do not. Whoever waits at this end lets time pass on `clock`.
    #[must_use]
    pub fn new(host: Host, clock: SimClock, delay_ns: u64, stream: bool) -> Self {
        // Nobody listens, unless it is tapped.
        let (heard_in, _) = tokio::sync::mpsc::unbounded_channel();
        let (sessions, _) = crossbeam_channel::bounded(1);
        let end = FarEnd::new(clock.now(), delay_ns);
        Self {
            clock,
            stream,
            desk: Desk {
                quotas: Mutex::default(),
                host,
                key: None,
                tls: None,
                spin_ns: 0,
                present: AtomicBool::new(false),
                stop: AtomicBool::new(false),
                sessions,
                heard: heard_in,
                parted: Mutex::default(),
            },
            far: Far::waiting(end, stream),
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
        self.end().and_then(|end| end.next_at())
    }

    /// Lets the far end live until `limit`, or until something is on its way to this end.
    fn live(&mut self, limit: Nanos) {
        let mut in_vain = 0;
        while let Some(end) = self.far.end()
            && end.is_due(limit)
        {
            let before = end.now();
            end.allow(limit);
            self.far.turn(limit, &self.desk);
            let now = self.end().map_or(limit, |end| end.now());
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

impl Transport for Simulated {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        let now = self.clock.now();
        if self.stream && self.far.is_over() && self.next_at().is_none() {
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
        self.live(until);
        match self.next_at() {
            Some(at) if at <= until => {
                self.clock.sleep_until(at);
                Ok(self.end().and_then(|end| end.arrived(at, buffer)))
            }
            None if self.stream && self.far.is_over() => Err(LinkFault::Closed),
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
    use crate::specimen::SpecimenLaw;
    use crate::wire::handshake::{Axis, Limits, Unit};

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
    fn every_event_that_a_client_can_repeat_has_a_quota() {
        let sequence = 1;
        for heard in [
            Heard::Tripped {
                sequence,
                text: String::new(),
            },
            Heard::Holding {
                sequence: None,
                silent_s: 1.0,
            },
            Heard::Resumed { sequence },
        ] {
            let tap = Tap::default();
            let mut end = Simulated::new(host(), SimClock::new(), 0, true).tapped(tap);
            for _ in 0..1000 {
                end.desk.tell(heard.clone());
            }
            let tapping = end.tapped.as_mut().unwrap();
            let told = std::iter::from_fn(|| tapping.heard.try_recv().ok());
            // The last one says that further events are not reported.
            assert_eq!(told.count(), 101, "{heard:?}");
        }
    }
}
