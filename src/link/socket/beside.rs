//! Two UDP sockets on one port: one for all peers, and one for a single peer.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::AsFd;

use rustix::net::{AddressFamily, SocketFlags, SocketType, sockopt};

/// A socket on the port `local` of `door` that receives only from `peer`; from now on `door` receives only from the
/// others.
///
/// # Errors
/// The system refuses.
pub(crate) fn beside(
    door: impl AsFd,
    local: SocketAddr,
    peer: SocketAddr,
) -> io::Result<UdpSocket> {
    let family = if peer.is_ipv4() {
        AddressFamily::INET
    } else {
        AddressFamily::INET6
    };
    let socket = rustix::net::socket_with(family, SocketType::DGRAM, SocketFlags::CLOEXEC, None)?;
    // Only while this second socket is bound: two programs on one port must not go unnoticed.
    sockopt::set_socket_reuseaddr(&door, true)?;
    sockopt::set_socket_reuseaddr(&socket, true)?;
    let bound = rustix::net::bind(&socket, &local);
    sockopt::set_socket_reuseaddr(&door, false)?;
    sockopt::set_socket_reuseaddr(&socket, false)?;
    bound?;
    rustix::net::connect(&socket, &peer)?;
    Ok(socket.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_peer_has_a_separate_socket() {
        let door = UdpSocket::bind("127.0.0.1:0").unwrap();
        let local = door.local_addr().unwrap();
        let (friend, other) = (
            UdpSocket::bind("127.0.0.1:0").unwrap(),
            UdpSocket::bind("127.0.0.1:0").unwrap(),
        );
        let own = beside(&door, local, friend.local_addr().unwrap()).unwrap();
        friend.send_to(b"friend", local).unwrap();
        other.send_to(b"other", local).unwrap();
        let mut buffer = [0; 16];
        let count = own.recv(&mut buffer).unwrap();
        assert_eq!(&buffer[..count], b"friend");
        let count = door.recv(&mut buffer).unwrap();
        assert_eq!(&buffer[..count], b"other");

        assert_eq!(
            UdpSocket::bind(local).unwrap_err().kind(),
            io::ErrorKind::AddrInUse
        );
    }
}
