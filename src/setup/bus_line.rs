//! The line of a bus through a network interface of this machine.

use gusset_ethercat::BusError;
use gusset_ethercat::line::{Line, LineFault};
use gusset_quantity::time::{Clock, Nanos};
use gusset_record::rt::clock::MonotonicClock;
use gusset_record::rt::os::Errno;
use gusset_record::rt::packet::PacketSocket;

/// Frames through a raw socket.
struct SocketLine {
    socket: PacketSocket,
    clock: MonotonicClock,
}

/// Opens the interface of this name.
///
/// # Errors
/// [`BusError::Interface`] says what is missing, and what helps.
pub fn open(interface: &str) -> Result<Box<dyn Line>, BusError> {
    let socket = PacketSocket::open(interface);
    let socket = socket.map_err(|error| BusError::Interface(error.to_string()))?;
    Ok(Box::new(SocketLine {
        socket,
        clock: MonotonicClock::default(),
    }))
}

impl Line for SocketLine {
    fn now(&self) -> Nanos {
        self.clock.now()
    }

    fn wait_until(&mut self, at: Nanos) {
        self.clock.sleep_until(at);
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LineFault> {
        self.socket.send(frame).map_err(|error| match error {
            Errno::AGAIN | Errno::NOBUFS | Errno::INTR => LineFault::Full,
            _ => LineFault::Down,
        })
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LineFault> {
        self.socket
            .receive(buffer, deadline)
            .map_err(|_| LineFault::Down)
    }
}
