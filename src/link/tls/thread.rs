//! TLS on a separate thread, as a transport of the loop.
//!
//! The loop's thread writes into one ring and reads from another; the helper thread encrypts, decrypts and owns the socket.
//! On the loop's thread nothing is allocated, locked or formatted, a send is a copy and one write to an event
//! counter, and a wait ends at its deadline as over plain TCP: a busy loop on the ring first, then poll(2) on an
//! event counter. The helper thread does allocate: the exception that the documentation names.
//!
//! Invariants: bytes come out in order and before the fault that ended them. The helper sleeps 100 ms at most. It ends when the
//! transport is dropped or lost, after at most half a second for the goodbye, and is joined.

use std::io;
use std::net::SocketAddr;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;

use rtrb::{Consumer, Producer, RingBuffer};
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd};

use super::stream::TlsStream;
use crate::Transport;
use crate::socket::{Pause, Wait};
use crate::tls_fault::TlsFault;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;

/// Bytes of a ring, at least.
const RING: usize = 64 * 1024;
/// Decrypted at once.
const CHUNK: usize = 16 * 1024;
/// The helper looks up this often, whatever happens.
const LOOK_NS: u64 = 100_000_000;
/// While the loop takes nothing, the helper looks for room this often.
const ROOM_NS: u64 = 1_000_000;
/// Time limit for the goodbye.
const FAREWELL_NS: u64 = 500_000_000;

/// State shared by both threads.
#[derive(Debug)]
struct Shared {
    /// Readable: the helper has something to do.
    to_helper: OwnedFd,
    /// Readable: something came for the loop.
    to_loop: OwnedFd,
    closing: AtomicBool,
    /// Set once, by the helper, after the last bytes.
    fault: OnceLock<TlsFault>,
    /// The record that is coming: bytes so far in the upper half, of all in the lower.
    unfinished: AtomicU64,
}

/// A TLS session whose work is done by a helper thread.
#[derive(Debug)]
pub struct TlsTransport {
    out: Producer<u8>,
    back: Consumer<u8>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    wait: Wait,
    peer: SocketAddr,
}

impl TlsTransport {
    /// Hands a session over to a separate helper thread. `largest`: bytes of the longest message that is sent at once.
    ///
    /// # Errors
    /// The system gives no thread or no event counter.
    pub(crate) fn start(stream: TlsStream, largest: usize) -> io::Result<Self> {
        let flags = EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK;
        let shared = Arc::new(Shared {
            to_helper: eventfd(0, flags)?,
            to_loop: eventfd(0, flags)?,
            closing: AtomicBool::new(false),
            fault: OnceLock::new(),
            unfinished: AtomicU64::new(0),
        });
        let (out, commands) = touched_ring(RING.max(largest));
        let (answers, back) = touched_ring(RING);
        let (peer, wait) = (stream.peer(), stream.options().wait);
        let helper = Helper {
            stream,
            commands,
            answers,
            shared: Arc::clone(&shared),
            buffer: vec![0; CHUNK],
        };
        let thread = std::thread::Builder::new()
            .name("gusset-tls".into())
            .spawn(move || helper.run())?;
        Ok(Self {
            out,
            back,
            shared,
            thread: Some(thread),
            wait,
            peer,
        })
    }

    /// The other end.
    #[must_use]
    pub(crate) const fn peer(&self) -> SocketAddr {
        self.peer
    }
}

/// A ring whose pages have been touched: the first use must not cost a page fault on the loop's thread.
fn touched_ring(capacity: usize) -> (Producer<u8>, Consumer<u8>) {
    let (mut producer, mut consumer) = RingBuffer::new(capacity);
    let _ = producer.push_partial_slice(&vec![0; capacity]);
    let _ = consumer.pop_partial_slice(&mut vec![0; capacity]);
    (producer, consumer)
}

fn ring_bell(counter: &OwnedFd) {
    // It can be full only after 2^64 unread rings; then it is readable anyway.
    let _ = rustix::io::write(counter, &1_u64.to_ne_bytes());
}

fn hush(counter: &OwnedFd) {
    let _ = rustix::io::read(counter, &mut [0; 8]);
}

impl Transport for TlsTransport {
    /// Backpressure: earlier bytes fill the ring, because the peer does not read. Real-time: yes.
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        if let Some(fault) = self.shared.fault.get() {
            // The peer's final message, such as a goodbye, is read first; plain TCP accepts such a frame, too.
            if !self.back.is_empty() {
                return Ok(());
            }
            return Err(fault.link());
        }
        self.out
            .push_entire_slice(frame)
            .map_err(|_| LinkFault::Backpressure)?;
        ring_bell(&self.shared.to_helper);
        Ok(())
    }

    /// Real-time: yes.
    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let mut pause = Pause::new(self.wait, deadline);
        loop {
            // In this order: the fault is set after the last bytes.
            let fault = self.shared.fault.get();
            let (taken, _) = self.back.pop_partial_slice(buffer);
            if !taken.is_empty() {
                return Ok(Some(taken.len()));
            }
            if let Some(fault) = fault {
                return Err(fault.link());
            }
            if !pause.wait(self.shared.to_loop.as_fd(), false) {
                return Ok(None);
            }
            if pause.slept() {
                hush(&self.shared.to_loop);
            }
        }
    }

    fn tls_fault(&self) -> Option<TlsFault> {
        if let Some(fault) = self.shared.fault.get() {
            return Some(*fault).filter(|fault| fault.is_telling());
        }
        let unfinished = self.shared.unfinished.load(Ordering::Acquire);
        let (got, of) = ((unfinished >> 32) as u32, unfinished as u32);
        (got > 0).then_some(TlsFault::Stalled { got, of })
    }
}

impl Drop for TlsTransport {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Release);
        ring_bell(&self.shared.to_helper);
        if let Some(thread) = self.thread.take() {
            // It looks at the flag ten times a second at least, and has half a second for the goodbye.
            let _ = thread.join();
        }
    }
}

/// The other side of the rings.
struct Helper {
    stream: TlsStream,
    commands: Consumer<u8>,
    answers: Producer<u8>,
    shared: Arc<Shared>,
    buffer: Vec<u8>,
}

/// State between two polls.
struct Round {
    moved: bool,
    room: bool,
}

impl Helper {
    fn run(mut self) {
        // Signals are for the threads that handle them.
        let _ = os::block_signals();
        let fault = self.carry();
        let _ = self.shared.fault.set(fault);
        ring_bell(&self.shared.to_loop);
    }

    /// Carries bytes until the end, and returns its cause.
    fn carry(&mut self) -> TlsFault {
        let mut farewell: Option<u64> = None;
        loop {
            // Read before the ring: bytes sent before the transport is dropped still leave.
            let closing =
                self.shared.closing.load(Ordering::Acquire) || self.commands.is_abandoned();
            let round = match self.round() {
                Ok(round) => round,
                Err(fault) => return self.last_words(fault),
            };
            if closing {
                let until = *farewell.get_or_insert_with(|| os::monotonic_ns() + FAREWELL_NS);
                let unsent = !self.commands.is_empty() || self.stream.session.wants_write();
                if !unsent || os::monotonic_ns() >= until {
                    self.stream.say_closed();
                    return TlsFault::Closed;
                }
            }
            if round.moved {
                continue;
            }
            if let Err(fault) = self.stream.check_record() {
                return fault;
            }
            self.sleep(&round);
        }
    }

    /// Does the work that needs no wait.
    fn round(&mut self) -> Result<Round, TlsFault> {
        let mut moved = false;
        // Bytes that the socket does not take stay in the ring, where the loop sees that it fills.
        if !self.stream.session.wants_write() {
            let count = self.commands.slots();
            if let Ok(chunk) = self.commands.read_chunk(count)
                && count > 0
            {
                let (first, second) = chunk.as_slices();
                self.stream.session.put(first)?;
                if !second.is_empty() {
                    self.stream.session.put(second)?;
                }
                chunk.commit_all();
                moved = true;
            }
        }
        self.stream.push()?;
        let room = self.answers.slots().min(self.buffer.len());
        if room > 0 {
            moved |= self.give(room)? || self.stream.pull()?;
        }
        let unfinished = self.stream.session.records().unfinished();
        let (got, of) = unfinished.unwrap_or((0, 0));
        let word = u64::from(got) << 32 | u64::from(of);
        self.shared.unfinished.store(word, Ordering::Release);
        Ok(Round {
            moved,
            room: room > 0,
        })
    }

    /// Gives the loop decrypted bytes; false without any.
    fn give(&mut self, room: usize) -> Result<bool, TlsFault> {
        let buffer = self.buffer.get_mut(..room).unwrap_or_default();
        let Some(count) = self.stream.take(buffer)? else {
            return Ok(false);
        };
        let bytes = self.buffer.get(..count).unwrap_or_default();
        // There is room: only this thread fills the ring.
        let _ = self.answers.push_entire_slice(bytes);
        ring_bell(&self.shared.to_loop);
        Ok(true)
    }

    /// Messages that the peer sent before the connection broke under a write still count.
    fn last_words(&mut self, fault: TlsFault) -> TlsFault {
        loop {
            let room = self.answers.slots().min(self.buffer.len());
            if room == 0 {
                return fault;
            }
            match self.give(room) {
                Ok(true) => continue,
                Ok(false) => {}
                Err(_) => return fault,
            }
            match self.stream.pull() {
                Ok(true) => {}
                Err(telling) if telling.is_telling() => return telling,
                Ok(false) | Err(_) => return fault,
            }
        }
    }

    fn sleep(&mut self, round: &Round) {
        let left = if round.room { LOOK_NS } else { ROOM_NS };
        let left = match self.stream.session.records().waiting() {
            Some((_, _, since)) => {
                let ends = since.saturating_add(self.stream.record_limit_ns());
                left.min(ends.saturating_sub(os::monotonic_ns()).max(ROOM_NS))
            }
            None => left,
        };
        let limit = Timespec {
            tv_sec: 0,
            tv_nsec: left as _,
        };
        let mut events = PollFlags::empty();
        if round.room {
            events |= PollFlags::IN;
        }
        if self.stream.session.wants_write() {
            events |= PollFlags::OUT;
        }
        let socket = self.stream.socket();
        let mut watched = [
            PollFd::new(&self.shared.to_helper, PollFlags::IN),
            PollFd::from_borrowed_fd(socket, events),
        ];
        // Without room a socket that hung up would end every sleep at once.
        let watched = if events.is_empty() {
            watched.split_at_mut(1).0
        } else {
            &mut watched[..]
        };
        // An error of poll shows again, and better, in the next round.
        let _ = rustix::event::poll(watched, Some(&limit));
        let rung = watched
            .first()
            .is_some_and(|bell| bell.revents().contains(PollFlags::IN));
        if rung {
            hush(&self.shared.to_helper);
        }
    }
}
