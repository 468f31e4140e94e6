//! TCP and UDP on plain non-blocking sockets, with a wait that ends at a deadline.
//!
//! Invariants: after the set-up nothing here allocates, locks or blocks; a wait never lasts past its deadline on
//! CLOCK_MONOTONIC by more than the kernel's wake-up; the next call notices a peer that closed. Not here: bytes and
//! their meaning, and reactions to a fault. Resolving a host's name happens before the test and has no time limit of
//! ours: it is the system's resolver that waits.

mod beside;
mod connect;
#[cfg(feature = "test-doubles")]
mod pairs;
mod tcp;
mod udp;

use std::io;
use std::os::fd::BorrowedFd;

use rustix::event::{PollFd, PollFlags, Timespec};

pub(crate) use beside::beside;
pub use connect::{ConnectError, resolve, resolve_host};
#[cfg(feature = "test-doubles")]
pub use pairs::{Pair, tcp_pair, udp_pair};
pub(crate) use tcp::{TcpTransport, discard};
pub(crate) use udp::UdpTransport;

use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;

/// Largest remainder of frames that a transport keeps while the system takes no bytes.
const KEPT: usize = 96 * 1024;

/// A deadline that has always passed: bytes that have arrived are taken, without waiting.
pub(crate) const LOOK: Nanos = Nanos(0);

/// How a wait for bytes spends its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wait {
    /// Reads in a busy loop for so long from the beginning of a wait, in ns: a reply on the same switch is there
    /// within tens of microseconds.
    pub spin_first_ns: u64,
    /// Reads in a busy loop for so long before the deadline, in ns; between the two the thread sleeps until
    /// bytes come.
    pub spin_last_ns: u64,
}

impl Wait {
    /// Never sleeps. A thread under SCHED_FIFO that does this for whole periods meets the kernel's throttling.
    pub(crate) const SPIN: Wait = Wait {
        spin_first_ns: u64::MAX,
        spin_last_ns: 0,
    };
    /// Sleeps until bytes come.
    pub const SLEEP: Wait = Wait {
        spin_first_ns: 0,
        spin_last_ns: 0,
    };
}

impl Default for Wait {
    fn default() -> Self {
        Self {
            spin_first_ns: 60_000,
            spin_last_ns: 0,
        }
    }
}

/// Advice for a server whose port the system refuses, to follow the system's message.
#[must_use]
pub(crate) fn listen_advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::AddrInUse => {
            "; another `gusset serve` or the live page of a test may be using this port: choose another one with \
             --listen ADDR:PORT or `serve.listen`"
        }
        io::ErrorKind::AddrNotAvailable => {
            "; this machine has no such address: choose another one with --listen ADDR:PORT or `serve.listen`"
        }
        io::ErrorKind::PermissionDenied => {
            "; ports below 1024 need privileges: choose a higher one"
        }
        _ => "",
    }
}

/// Options of a socket.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SocketOptions {
    /// How a wait spends its time.
    pub wait: Wait,
    /// TCP_QUICKACK before a wait while an acknowledgement is pending: without it two ends that both wait lose 40 ms to
    /// delayed acknowledgements.
    pub quick_ack: bool,
    /// SO_BUSY_POLL in µs: the kernel polls the network card while a read waits. A refusal is no error.
    pub busy_poll_us: Option<u32>,
}

impl Default for SocketOptions {
    fn default() -> Self {
        Self {
            wait: Wait::default(),
            quick_ack: true,
            busy_poll_us: None,
        }
    }
}

/// Bytes that the system did not take at once.
#[derive(Debug)]
struct Kept {
    bytes: Vec<u8>,
    start: usize,
}

impl Kept {
    fn new() -> Self {
        Self {
            bytes: Vec::with_capacity(KEPT),
            start: 0,
        }
    }

    fn is_empty(&self) -> bool {
        self.start >= self.bytes.len()
    }

    /// Keeps the remainder of one frame. One frame may wait, a second one is backpressure: a specimen must never
    /// receive a burst of old commands.
    fn keep(&mut self, rest: &[u8]) -> Result<(), LinkFault> {
        if !self.is_empty() || rest.len() > KEPT {
            return Err(LinkFault::Backpressure);
        }
        self.start = 0;
        self.bytes.clear();
        self.bytes.extend_from_slice(rest);
        Ok(())
    }

    fn flush(
        &mut self,
        mut write: impl FnMut(&[u8]) -> io::Result<usize>,
    ) -> Result<(), LinkFault> {
        while let Some(rest) = self.bytes.get(self.start..).filter(|rest| !rest.is_empty()) {
            match write(rest) {
                Ok(0) => return Err(LinkFault::Closed),
                Ok(taken) => self.start += taken,
                Err(error) => match verdict(&error) {
                    Verdict::Again => {}
                    Verdict::NotNow => return Ok(()),
                    Verdict::Lost(fault) => return Err(fault),
                },
            }
        }
        Ok(())
    }
}

pub(crate) enum Verdict {
    /// A signal came in between.
    Again,
    /// Nothing there, or no room.
    NotNow,
    Lost(LinkFault),
}

pub(crate) fn verdict(error: &io::Error) -> Verdict {
    match error.kind() {
        io::ErrorKind::Interrupted => Verdict::Again,
        io::ErrorKind::WouldBlock => Verdict::NotNow,
        io::ErrorKind::TimedOut => Verdict::Lost(LinkFault::Timeout),
        // A lack of buffers counts as a full buffer, too.
        _ if error.raw_os_error() == Some(os::Errno::NOBUFS.raw_os_error()) => Verdict::NotNow,
        _ => Verdict::Lost(LinkFault::Closed),
    }
}

/// One wait for bytes: spin, sleep in poll(2), spin.
pub(crate) struct Pause {
    wait: Wait,
    deadline: Nanos,
    begun: Option<Nanos>,
    slept: bool,
}

impl Pause {
    pub(crate) const fn new(wait: Wait, deadline: Nanos) -> Self {
        Self {
            wait,
            deadline,
            begun: None,
            slept: false,
        }
    }

    /// True if it ever slept: whatever wakes it may then be signalled.
    pub(crate) const fn slept(&self) -> bool {
        self.slept
    }

    fn is_over(&self) -> bool {
        os::monotonic_ns() >= self.deadline.0
    }

    /// Waits for a while; false once the deadline has passed. The clock is read only when there was nothing to read.
    pub(crate) fn wait(&mut self, fd: BorrowedFd<'_>, unsent: bool) -> bool {
        let now = Nanos(os::monotonic_ns());
        if now >= self.deadline {
            return false;
        }
        let begun = *self.begun.get_or_insert(now);
        let sleep_until = self.deadline.minus(self.wait.spin_last_ns);
        if now.since(begun) < self.wait.spin_first_ns || now >= sleep_until {
            std::hint::spin_loop();
            return true;
        }
        let mut events = PollFlags::IN;
        if unsent {
            events |= PollFlags::OUT;
        }
        let left = sleep_until.since(now);
        let limit = Timespec {
            tv_sec: i64::try_from(left / 1_000_000_000).unwrap_or(i64::MAX),
            tv_nsec: (left % 1_000_000_000) as _,
        };
        self.slept = true;
        // An error of poll shows again, and better, in the read that follows.
        let _ = rustix::event::poll(&mut [PollFd::from_borrowed_fd(fd, events)], Some(&limit));
        true
    }
}

/// True if the other end of a stream has closed its side. Earlier bytes may still be unread. Real-time: yes.
pub(crate) fn has_hung_up(fd: BorrowedFd<'_>) -> bool {
    let gone = PollFlags::RDHUP | PollFlags::HUP | PollFlags::ERR;
    let mut polled = [PollFd::from_borrowed_fd(fd, PollFlags::RDHUP)];
    // An error of poll shows again in the read that follows.
    let found = rustix::event::poll(&mut polled, Some(&Timespec::default()));
    matches!(found, Ok(1..)) && polled.iter().any(|one| one.revents().intersects(gone))
}

fn ask_busy_poll(fd: BorrowedFd<'_>, options: SocketOptions) {
    if let Some(us) = options.busy_poll_us {
        // Beyond the system's own setting this is a privilege; without it reads poll from here all the same.
        let _ = os::set_busy_poll(fd, us);
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::{TcpListener, TcpStream, UdpSocket};
    use std::time::Duration;

    use super::*;
    use crate::Transport;

    const SECOND: u64 = 1_000_000_000;

    fn later(ns: u64) -> Nanos {
        Nanos(os::monotonic_ns()).plus(ns)
    }

    fn tcp_pair(options: SocketOptions) -> (TcpTransport, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let ours = TcpTransport::connect(&address, Duration::from_secs(5), options).unwrap();
        (ours, listener.accept().unwrap().0)
    }

    #[test]
    fn bytes_pass_under_every_kind_of_wait() {
        for wait in [Wait::SPIN, Wait::SLEEP, Wait::default()] {
            let options = SocketOptions {
                wait,
                busy_poll_us: Some(50),
                ..SocketOptions::default()
            };
            let (mut ours, mut theirs) = tcp_pair(options);
            ours.send(b"command").unwrap();
            let mut seen = [0; 7];
            theirs.read_exact(&mut seen).unwrap();
            assert_eq!(&seen, b"command");
            theirs.write_all(b"measurement").unwrap();
            let mut buffer = [0; 64];
            let count = ours.recv(&mut buffer, later(5 * SECOND)).unwrap().unwrap();
            assert!(b"measurement".starts_with(&buffer[..count]) && count > 0);
        }
    }

    #[test]
    fn wait_without_bytes_ends_at_its_deadline() {
        let (mut ours, _theirs) = tcp_pair(SocketOptions::default());
        let deadline = later(2_000_000);
        assert_eq!(ours.recv(&mut [0; 8], deadline), Ok(None));
        assert!(os::monotonic_ns() >= deadline.0);
        assert_eq!(ours.recv(&mut [0; 8], Nanos(0)), Ok(None), "long past");
    }

    #[test]
    fn a_peer_that_closes_is_seen_at_once() {
        let (mut ours, theirs) = tcp_pair(SocketOptions::default());
        drop(theirs);
        assert_eq!(
            ours.recv(&mut [0; 8], later(60 * SECOND)),
            Err(LinkFault::Closed)
        );
    }

    #[test]
    fn slow_reader_gets_every_kept_byte() {
        let (mut ours, mut theirs) = tcp_pair(SocketOptions::default());
        let frame: Vec<u8> = (0..60_000_u32).map(|i| i as u8).collect();
        let mut sent = 0;
        let fault = loop {
            match ours.send(&frame) {
                Ok(()) => sent += 1,
                Err(fault) => break fault,
            }
            assert!(sent < 10_000, "the kernel never filled up");
        };
        assert_eq!(fault, LinkFault::Backpressure);
        // The peer wakes up and reads all; the kept remainder is flushed in recv.
        let total = sent * frame.len();
        let reader = std::thread::spawn(move || {
            let mut all = vec![0; total];
            theirs.read_exact(&mut all).unwrap();
            theirs.write_all(b"!").unwrap();
            all
        });
        assert_eq!(ours.recv(&mut [0; 8], later(30 * SECOND)), Ok(Some(1)));
        let all = reader.join().unwrap();
        assert!(all.chunks(frame.len()).all(|chunk| chunk == frame));
    }

    /// A peer with Nagle's algorithm sends its second small message when the first is acknowledged. A kernel that has
    /// seen us answer would delay that by 40 ms; a loaded machine may be as slow now and then, but not always.
    #[test]
    fn nagle_peer_gets_acknowledgements_at_once() {
        let (mut ours, mut theirs) = tcp_pair(SocketOptions::default());
        theirs.set_nodelay(false).unwrap();
        let mut buffer = [0; 64];
        let mut fastest = u64::MAX;
        for round in 0..40 {
            let begun = os::monotonic_ns();
            theirs.write_all(b"command").unwrap();
            theirs.write_all(b"request").unwrap();
            let mut found = 0;
            while found < 14 {
                found += ours.recv(&mut buffer, later(5 * SECOND)).unwrap().unwrap();
            }
            // A new connection acknowledges its first 16 segments at once, whatever its options.
            if round >= 20 {
                fastest = fastest.min(os::monotonic_ns() - begun);
            }
            ours.send(b"answer").unwrap();
            theirs.read_exact(&mut buffer[..6]).unwrap();
        }
        assert!(fastest < 20_000_000, "{fastest} ns");
    }

    #[test]
    fn refusal_and_bad_name_show_the_address() {
        let port = {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            listener.local_addr().unwrap().port()
        };
        let address = format!("127.0.0.1:{port}");
        let connect = |address: &str| {
            TcpTransport::connect(address, Duration::from_secs(5), SocketOptions::default())
                .unwrap_err()
        };
        let refused = connect(&address);
        assert_eq!(refused, ConnectError::Refused { address });
        assert!(matches!(connect("127.0.0.1"), ConnectError::Address { .. }));
        assert!(matches!(
            connect("127.0.0.1:99999"),
            ConnectError::Address { .. }
        ));
    }

    #[test]
    fn datagrams_keep_their_borders() {
        let far = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = far.local_addr().unwrap().to_string();
        let mut ours = UdpTransport::connect(&address, SocketOptions::default()).unwrap();
        ours.send(b"one").unwrap();
        ours.send(b"three").unwrap();
        let mut buffer = [0; 64];
        let (count, peer) = far.recv_from(&mut buffer).unwrap();
        assert_eq!(&buffer[..count], b"one");
        let (count, _) = far.recv_from(&mut buffer).unwrap();
        assert_eq!(&buffer[..count], b"three");
        far.send_to(b"", peer).unwrap();
        far.send_to(b"answer", peer).unwrap();
        let count = ours.recv(&mut buffer, later(5 * SECOND)).unwrap().unwrap();
        assert_eq!(&buffer[..count], b"answer");
        assert_eq!(ours.recv(&mut buffer, later(1_000)), Ok(None));
    }

    #[test]
    fn unused_udp_port_is_seen_as_closed() {
        let port = {
            let gone = UdpSocket::bind("127.0.0.1:0").unwrap();
            gone.local_addr().unwrap().port()
        };
        let address = format!("127.0.0.1:{port}");
        let mut ours = UdpTransport::connect(&address, SocketOptions::default()).unwrap();
        ours.send(b"hello").unwrap();
        assert_eq!(
            ours.recv(&mut [0; 8], later(5 * SECOND)),
            Err(LinkFault::Closed)
        );
    }

    /// A program that opens its port after the first word is as good as one that had it open before.
    #[test]
    fn udp_peer_after_a_refusal_is_found() {
        let gone = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = gone.local_addr().unwrap();
        drop(gone);
        let options = SocketOptions::default();
        let mut ours = UdpTransport::connect(&address.to_string(), options).unwrap();
        let mut buffer = [0; 8];
        for _ in 0..2 {
            ours.send(b"hello").unwrap();
            let heard = ours.recv(&mut buffer, later(5 * SECOND));
            assert_eq!(heard, Err(LinkFault::Closed));
        }
        let far = UdpSocket::bind(address).unwrap();
        ours.send(b"hello").unwrap();
        assert_eq!(ours.recv(&mut buffer, later(SECOND / 100)), Ok(None));
        let (_, peer) = far.recv_from(&mut buffer).unwrap();
        far.send_to(b"hi", peer).unwrap();
        assert_eq!(ours.recv(&mut buffer, later(5 * SECOND)), Ok(Some(2)));
    }

    /// An attacker can forge an ICMP message, but no signed frame.
    #[test]
    fn errors_of_signed_datagrams_are_counted() {
        let gone = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = gone.local_addr().unwrap();
        drop(gone);
        let options = SocketOptions::default();
        let mut ours = UdpTransport::connect(&address.to_string(), options).unwrap();
        ours.trust_only_frames();
        let mut buffer = [0; 8];
        for round in 1..=3 {
            ours.send(b"hello").unwrap();
            assert_eq!(ours.recv(&mut buffer, later(SECOND / 100)), Ok(None));
            assert_eq!(ours.unreachable(), round);
        }
        let far = UdpSocket::bind(address).unwrap();
        ours.send(b"hello").unwrap();
        let (_, peer) = far.recv_from(&mut buffer).unwrap();
        far.send_to(b"hi", peer).unwrap();
        assert_eq!(ours.recv(&mut buffer, later(5 * SECOND)), Ok(Some(2)));
    }

    /// A peer that is gone refuses the port while its last datagrams still wait here. They are read before the link counts as
    /// closed.
    #[test]
    fn last_datagrams_are_read_before_the_loss() {
        let far = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = far.local_addr().unwrap().to_string();
        let mut ours = UdpTransport::connect(&address, SocketOptions::default()).unwrap();
        ours.send(b"hello").unwrap();
        let (_, peer) = far.recv_from(&mut [0; 64]).unwrap();
        for word in [b"command".as_slice(), b"command", b"retire"] {
            far.send_to(word, peer).unwrap();
        }
        drop(far);
        let mut buffer = [0; 64];
        for word in [b"command".as_slice(), b"command", b"retire"] {
            let count = ours.recv(&mut buffer, later(5 * SECOND)).unwrap().unwrap();
            assert_eq!(&buffer[..count], word);
            ours.send(b"answer").unwrap();
        }
        assert_eq!(
            ours.recv(&mut buffer, later(5 * SECOND)),
            Err(LinkFault::Closed)
        );
    }

    #[test]
    fn sending_and_receiving_allocate_nothing() {
        let (mut ours, mut theirs) = tcp_pair(SocketOptions::default());
        theirs.write_all(&[1; 64]).unwrap();
        let mut buffer = [0; 64];
        let info = allocation_counter::measure(|| {
            ours.send(&[2; 76]).unwrap();
            ours.recv(&mut buffer, later(5 * SECOND)).unwrap();
            ours.recv(&mut buffer, later(100_000)).unwrap();
        });
        assert_eq!(info.count_total, 0);
    }
}
