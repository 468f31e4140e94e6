//! Connected transports over loopback, for benches.

use std::error::Error;
use std::net::{TcpListener, TcpStream, UdpSocket};

use super::{SocketOptions, TcpTransport, UdpTransport};
use crate::Transport;

/// Two ends of a connection.
pub type Pair = [Box<dyn Transport>; 2];

/// Both ends of a TCP connection.
///
/// # Errors
/// The system refuses a socket.
pub fn tcp_pair(options: SocketOptions) -> Result<Pair, Box<dyn Error>> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let near = TcpStream::connect(listener.local_addr()?)?;
    let (far, _) = listener.accept()?;
    Ok([
        Box::new(TcpTransport::from_stream(near, options)?),
        Box::new(TcpTransport::from_stream(far, options)?),
    ])
}

/// Two UDP sockets that are connected to each other.
///
/// # Errors
/// The system refuses a socket.
pub fn udp_pair(options: SocketOptions) -> Result<Pair, Box<dyn Error>> {
    let near = UdpSocket::bind("127.0.0.1:0")?;
    let far = UdpSocket::bind("127.0.0.1:0")?;
    near.connect(far.local_addr()?)?;
    far.connect(near.local_addr()?)?;
    Ok([
        Box::new(UdpTransport::from_socket(near, options)?),
        Box::new(UdpTransport::from_socket(far, options)?),
    ])
}
