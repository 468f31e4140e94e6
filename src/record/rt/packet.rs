//! A raw socket for the frames of an EtherCAT bus: one interface, one process.

use std::os::fd::OwnedFd;

use gusset_quantity::time::Nanos;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType, bind, recv, send,
    socket_with,
};
use thiserror::Error;

use super::os;
use super::os::Errno;

/// Ethernet type of EtherCAT.
const ETHER_TYPE: u16 = 0x88a4;
/// Content of the longest Ethernet frame.
const LEAST_MTU: i32 = 1500;
/// A frame is waited for in a loop this long before the thread sleeps, and from this long before the deadline on.
const SPIN_NS: u64 = 60_000;

/// Why an interface cannot carry a bus.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PacketError {
    /// This program may not send raw frames.
    #[error(
        "this program may not send raw frames on `{0}`: sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep $(command -v gusset)"
    )]
    NoRight(String),
    /// There is no such interface.
    #[error("there is no network interface `{name}`; this machine has {}", known.join(", "))]
    NoInterface {
        /// The name.
        name: String,
        /// Names of the interfaces that there are.
        known: Vec<String>,
    },
    /// It is switched off.
    #[error("the network interface `{0}` is down: ip link set {0} up")]
    Down(String),
    /// It is no wired Ethernet interface.
    #[error("`{0}` is no wired Ethernet interface: an EtherCAT bus needs a cable")]
    NotWired(String),
    /// Its frames are too short for the process data of a bus.
    #[error(
        "the network interface `{0}` carries {1} bytes a frame, 1500 are needed: ip link set {0} mtu 1500"
    )]
    ShortFrames(String, i32),
    /// Another process of this program uses it.
    #[error("another process of gusset uses the bus at `{0}`: end it first")]
    InUse(String),
    /// Another refusal of the kernel.
    #[error("the network interface `{0}` cannot be opened: {1}")]
    Refused(String, Errno),
}

/// Raw frames of the Ethernet type of EtherCAT.
#[derive(Debug)]
pub struct PacketSocket {
    socket: OwnedFd,
    /// Held open: a second process of this program cannot bind its name.
    _claim: OwnedFd,
}

/// The network interfaces of this machine, except the loopback.
#[must_use]
pub fn interfaces() -> Vec<String> {
    let table = std::fs::read_to_string("/proc/self/net/dev").unwrap_or_default();
    let names = table.lines().filter_map(|line| line.split_once(':'));
    let names = names.map(|(name, _)| name.trim().to_owned());
    names.filter(|name| name != "lo").collect()
}

impl PacketSocket {
    /// Opens the interface of this name.
    ///
    /// # Errors
    /// [`PacketError`] says what is missing and what helps.
    pub fn open(name: &str) -> Result<Self, PacketError> {
        let own = || name.to_owned();
        let refused = |error| match error {
            Errno::NODEV => PacketError::NoInterface {
                name: own(),
                known: interfaces(),
            },
            Errno::PERM | Errno::ACCESS => PacketError::NoRight(own()),
            error => PacketError::Refused(own(), error),
        };
        let facts = os::interface_facts(name).map_err(refused)?;
        if !facts.is_ethernet || facts.is_wireless {
            return Err(PacketError::NotWired(own()));
        }
        if !facts.is_up {
            return Err(PacketError::Down(own()));
        }
        if facts.mtu < LEAST_MTU {
            return Err(PacketError::ShortFrames(own(), facts.mtu));
        }
        let claim = claim(name).map_err(|error| match error {
            Errno::ADDRINUSE => PacketError::InUse(own()),
            error => PacketError::Refused(own(), error),
        })?;
        let socket = os::packet_socket(name, ETHER_TYPE).map_err(refused)?;
        Ok(Self {
            socket,
            _claim: claim,
        })
    }

    /// Sends a frame; never blocks. Real-time: yes.
    ///
    /// # Errors
    /// The interface is down or does not take the frame.
    pub fn send(&self, frame: &[u8]) -> Result<(), Errno> {
        send(&self.socket, frame, SendFlags::DONTWAIT).map(drop)
    }

    /// Takes the next frame, if one comes by the deadline on the monotonic clock. Real-time: yes.
    ///
    /// # Errors
    /// The interface is down.
    pub fn receive(&self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, Errno> {
        let spin_until = os::monotonic_ns() + SPIN_NS;
        loop {
            match recv(&self.socket, &mut *buffer, RecvFlags::DONTWAIT) {
                Ok((length, _)) => return Ok(Some(length)),
                Err(Errno::AGAIN | Errno::INTR) => {}
                Err(error) => return Err(error),
            }
            let now = os::monotonic_ns();
            if now >= deadline.0 {
                return Ok(None);
            }
            let left = deadline.0 - now;
            if now < spin_until || left < SPIN_NS {
                std::hint::spin_loop();
                continue;
            }
            let nap = left - SPIN_NS / 2;
            let nap = Timespec {
                tv_sec: i64::try_from(nap / 1_000_000_000).unwrap_or(i64::MAX),
                tv_nsec: (nap % 1_000_000_000) as _,
            };
            let mut waits = [PollFd::new(&self.socket, PollFlags::IN)];
            match poll(&mut waits, Some(&nap)) {
                Ok(_) | Err(Errno::INTR) => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// A name that one process of a network namespace can have.
fn claim(name: &str) -> Result<OwnedFd, Errno> {
    // A program that this process starts must not inherit the claim.
    let flags = SocketFlags::CLOEXEC;
    let claim = socket_with(AddressFamily::UNIX, SocketType::DGRAM, flags, None)?;
    let address = SocketAddrUnix::new_abstract_name(format!("gusset-bus-{name}").as_bytes())?;
    bind(&claim, &address)?;
    Ok(claim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusable_interfaces_are_refused() {
        let missing = PacketSocket::open("gusset-none").unwrap_err();
        assert!(
            matches!(missing, PacketError::NoInterface { .. }),
            "{missing}"
        );
        let long = PacketSocket::open("a-name-that-no-interface-can-have").unwrap_err();
        assert!(matches!(long, PacketError::NoInterface { .. }), "{long}");
        assert_eq!(
            PacketSocket::open("lo").unwrap_err(),
            PacketError::NotWired("lo".into())
        );
    }

    #[test]
    fn an_interface_is_claimed_once() {
        let first = claim("gusset-test").unwrap();
        assert_eq!(claim("gusset-test").unwrap_err(), Errno::ADDRINUSE);
        drop(first);
        assert!(claim("gusset-test").is_ok());
    }
}
