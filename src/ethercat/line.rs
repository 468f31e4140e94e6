//! The line of a bus: Ethernet frames to the devices and back.

use gusset_quantity::time::Nanos;
use thiserror::Error;

/// Why the line carries no frames.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LineFault {
    /// The interface is down or gone.
    #[error("the network interface is down or gone")]
    Down,
    /// The interface does not take a frame.
    #[error("the network interface does not take frames")]
    Full,
    /// Frames of another EtherCAT master are on the line.
    #[error("another EtherCAT master sends frames on this line")]
    Foreign,
}

/// Ethernet frames of type 0x88A4, without their checksum.
pub trait Line: Send {
    /// The present, on the clock of this machine. Real-time: yes.
    fn now(&self) -> Nanos;

    /// Waits until then. Real-time: yes.
    fn wait_until(&mut self, at: Nanos);

    /// Sends a frame; never blocks. Real-time: yes.
    ///
    /// # Errors
    /// The line is down.
    fn send(&mut self, frame: &[u8]) -> Result<(), LineFault>;

    /// Takes the next frame that came back, and its length; `None` if none came by the deadline. Real-time: yes.
    ///
    /// # Errors
    /// The line is down, or carries the frames of another master.
    fn receive(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LineFault>;

    /// True if the devices are simulated: nothing moves.
    fn is_simulated(&self) -> bool {
        false
    }
}
