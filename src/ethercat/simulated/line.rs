//! The line to a simulated bus in the same process.

use std::sync::{Arc, Mutex};

use gusset_quantity::time::{Clock, Nanos};

use super::{Passage, SimulatedBus};
use crate::line::{Line, LineFault};
use crate::wire::datagram::LONGEST;

/// A frame on its way back.
#[derive(Debug, Clone)]
struct Returning {
    bytes: Vec<u8>,
    length: usize,
    at: Option<Nanos>,
}

/// Frames to a [`SimulatedBus`]. An exchange takes no time.
pub struct SimulatedLine {
    bus: Arc<Mutex<SimulatedBus>>,
    clock: Box<dyn Clock>,
    /// Room for a few frames on their way.
    back: [Returning; 4],
}

impl std::fmt::Debug for SimulatedLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SimulatedLine").finish_non_exhaustive()
    }
}

impl SimulatedLine {
    /// The line to this bus, on this clock. Others may look at the bus meanwhile.
    #[must_use]
    pub fn new(bus: Arc<Mutex<SimulatedBus>>, clock: Box<dyn Clock>) -> Self {
        let empty = || Returning {
            bytes: vec![0; LONGEST],
            length: 0,
            at: None,
        };
        Self {
            bus,
            clock,
            back: [empty(), empty(), empty(), empty()],
        }
    }

    fn keep(&mut self, frame: &[u8], at: Nanos) {
        if let Some(free) = self.back.iter_mut().find(|one| one.at.is_none())
            && let Some(room) = free.bytes.get_mut(..frame.len())
        {
            room.copy_from_slice(frame);
            free.length = frame.len();
            free.at = Some(at);
        }
    }
}

impl Line for SimulatedLine {
    fn now(&self) -> Nanos {
        self.clock.now()
    }

    fn wait_until(&mut self, at: Nanos) {
        self.clock.sleep_until(at);
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LineFault> {
        let mut own = [0u8; LONGEST];
        let now = self.clock.now();
        let Some(own) = own.get_mut(..frame.len()) else {
            return Err(LineFault::Full);
        };
        own.copy_from_slice(frame);
        let passage = match self.bus.lock() {
            Ok(mut bus) => bus.process(own, now.0),
            Err(_) => return Err(LineFault::Down),
        };
        match passage {
            Passage::Lost => {}
            Passage::Returns => self.keep(own, now),
            Passage::Late(ns) => self.keep(own, now.plus(ns)),
            Passage::Twice => {
                self.keep(own, now);
                self.keep(own, now);
            }
            Passage::BehindForeign => {
                self.keep(&Passage::foreign(own), now);
                self.keep(own, now);
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LineFault> {
        let now = self.clock.now();
        let due = self.back.iter_mut().filter(|one| one.at.is_some());
        let Some(next) = due.min_by_key(|one| one.at) else {
            self.clock.sleep_until(deadline);
            return Ok(None);
        };
        let at = next.at.unwrap_or(now);
        if at > now {
            self.clock.sleep_until(at.min(deadline));
            if at > deadline {
                return Ok(None);
            }
        }
        next.at = None;
        let bytes = next.bytes.get(..next.length).unwrap_or_default();
        let room = buffer.get_mut(..bytes.len());
        Ok(room.map(|room| {
            room.copy_from_slice(bytes);
            bytes.len()
        }))
    }

    fn is_simulated(&self) -> bool {
        true
    }
}
