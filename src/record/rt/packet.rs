//! stub
use gusset_quantity::time::Nanos;
/// Socket.
#[derive(Debug)]
pub struct PacketSocket;
impl PacketSocket {
    /// Opens.
    pub fn open(_: &str) -> Result<Self, std::io::Error> {
        Err(std::io::ErrorKind::Other.into())
    }
    /// Sends.
    pub fn send(&self, _: &[u8]) -> Result<(), std::io::Error> {
        Ok(())
    }
    /// Receives.
    pub fn receive(&self, _: &mut [u8], _: Nanos) -> Result<Option<usize>, std::io::Error> {
        Ok(None)
    }
}
