//! The listener of the live page: a bounded number of connections, each with a small buffer and a timeout.
//!
//! A connection takes a file descriptor and memory; neither may run out because of viewers. Every connection is accepted at once,
//! so that a STOP never waits behind others. If there are too many, the listener closes an idle one.
//! Viewers never use all connections ([`MOST_VIEWERS`] of [`MOST`]); the others are for requests that are answered at once.

use std::io;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker, ready};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Instant, Sleep};

use gusset_record::rt::os::monotonic_ns;

/// Connections at the same time.
const MOST: usize = 96;
/// Idle connections of one address.
const MOST_IDLE_OF_ONE: usize = 16;
/// Viewers at the same time.
pub(super) const MOST_VIEWERS: usize = 64;
/// Bytes that the system may keep for one viewer: a slow viewer skips old data.
const SEND_BUFFER: usize = 128 << 10;
/// Time after which a connection without a complete first request is closed. A client that waits for a free connection,
/// perhaps with a STOP, waits no longer than this.
const NOTHING_ASKED: Duration = Duration::from_secs(3);
/// Time after which a connection is closed to which nothing was written. The server writes to a viewer ten times a second.
const NOTHING_WRITTEN: Duration = Duration::from_secs(20);
/// Longest time without an acknowledgement of sent data, ms.
const NO_ANSWER_MS: u32 = 30_000;
/// Pause after a failed `accept`, for example without free descriptors.
const PAUSE: Duration = Duration::from_millis(200);

/// Accepts connections, and closes idle ones if there are too many.
#[derive(Debug)]
pub(super) struct WebListener {
    listener: TcpListener,
    places: Arc<OpenConnections>,
}

impl WebListener {
    pub(crate) fn new(listener: TcpListener) -> Self {
        Self {
            listener,
            places: Arc::default(),
        }
    }

    /// Its open connections.
    pub(crate) fn connections(&self) -> Arc<OpenConnections> {
        Arc::clone(&self.places)
    }
}

impl Listener for WebListener {
    type Io = ClientStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (ClientStream, SocketAddr) {
        // Earlier connections get a chance to send their request: a connection with a request is not closed.
        for _ in 0..2 {
            tokio::task::yield_now().await;
        }
        loop {
            match self.listener.accept().await {
                Ok((stream, peer)) => {
                    // The connection works without these options.
                    let _ = rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER);
                    let _ = rustix::net::sockopt::set_tcp_user_timeout(&stream, NO_ANSWER_MS);
                    let _ = stream.set_nodelay(true);
                    return (ClientStream::new(self.places.take(stream, peer)), peer);
                }
                Err(_) => tokio::time::sleep(PAUSE).await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// Open connections, the oldest first.
#[derive(Debug, Default)]
pub(super) struct OpenConnections {
    open: Mutex<Vec<Arc<Connection>>>,
    written: AtomicU64,
}

impl OpenConnections {
    fn all(&self) -> MutexGuard<'_, Vec<Arc<Connection>>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes that clients took so far: a client that does not read takes none once its buffers are full.
    pub(crate) fn bytes_written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Registers a connection until the returned slot is dropped.
    fn take(self: &Arc<Self>, stream: TcpStream, peer: SocketAddr) -> ConnectionSlot {
        let connection = Arc::new(Connection {
            stream,
            peer,
            requests: AtomicU32::new(0),
            idle_since_ns: AtomicU64::new(monotonic_ns()),
        });
        let mut all = self.all();
        while let Some(index) = connection_to_close(&all, peer.ip()) {
            all.remove(index).close();
        }
        all.push(Arc::clone(&connection));
        ConnectionSlot {
            connection,
            places: Arc::clone(self),
        }
    }
}

/// The connection to close before another is accepted: the longest idle one of the address with the most idle connections.
fn connection_to_close(all: &[Arc<Connection>], new_peer: IpAddr) -> Option<usize> {
    let idle_of = |ip: IpAddr| {
        let idle = all.iter().filter(|one| one.is_idle());
        idle.filter(|one| one.peer.ip() == ip).count()
    };
    let crowd = if idle_of(new_peer) >= MOST_IDLE_OF_ONE {
        new_peer
    } else if all.len() >= MOST {
        let idle = all.iter().filter(|one| one.is_idle());
        idle.map(|one| one.peer.ip())
            .max_by_key(|ip| idle_of(*ip))?
    } else {
        return None;
    };
    let may_go = |one: &Connection| one.is_idle() && one.peer.ip() == crowd;
    let places = all.iter().enumerate().filter(|(_, one)| may_go(one));
    let since = |one: &Connection| one.idle_since_ns.load(Ordering::Relaxed);
    let longest = places.min_by_key(|(_, one)| since(one));
    longest.map(|(index, _)| index)
}

/// One connection, shared by its task and its requests.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    pub peer: SocketAddr,
    /// Requests that are being answered.
    requests: AtomicU32,
    /// Time of the last answer, or of the connection.
    idle_since_ns: AtomicU64,
}

impl Connection {
    /// Counts a request as pending until the returned value is dropped.
    pub(crate) fn asks(self: &Arc<Self>) -> PendingRequest {
        self.requests.fetch_add(1, Ordering::Relaxed);
        PendingRequest(Arc::clone(self))
    }

    fn is_idle(&self) -> bool {
        self.requests.load(Ordering::Relaxed) == 0
    }

    /// True if the client has closed its connection, or at least its sending half.
    pub(crate) fn has_left(&self) -> bool {
        let mut end = [PollFd::new(&self.stream, PollFlags::RDHUP)];
        let looked = poll(&mut end, Some(&Timespec::default()));
        let gone = PollFlags::RDHUP | PollFlags::HUP | PollFlags::ERR;
        // An unknown state counts as closed.
        looked.is_err() || end.iter().any(|end| end.revents().intersects(gone))
    }

    /// Closes the connection under its task.
    fn close(&self) {
        // It may be closed already.
        let _ = rustix::net::shutdown(&self.stream, rustix::net::Shutdown::Both);
    }
}

/// Counts as a pending request of its connection until it is dropped.
#[derive(Debug)]
pub(super) struct PendingRequest(Arc<Connection>);

impl Drop for PendingRequest {
    fn drop(&mut self) {
        let now = monotonic_ns();
        self.0.idle_since_ns.store(now, Ordering::Relaxed);
        self.0.requests.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The entry of one connection, removed when this is dropped.
#[derive(Debug)]
struct ConnectionSlot {
    connection: Arc<Connection>,
    places: Arc<OpenConnections>,
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        let mut all = self.places.all();
        all.retain(|one| !Arc::ptr_eq(one, &self.connection));
    }
}

/// Server side of one connection.
#[derive(Debug)]
pub(super) struct ClientStream {
    place: ConnectionSlot,
    /// Data was read, and nothing written since.
    unanswered: bool,
    /// Wakes the reader once the answer is written: only then the reader sees the end of the stream.
    at_the_end: Option<Waker>,
    /// Timeout until the next write.
    no_progress: Pin<Box<Sleep>>,
}

impl ClientStream {
    fn new(place: ConnectionSlot) -> Self {
        Self {
            place,
            unanswered: false,
            at_the_end: None,
            no_progress: Box::pin(tokio::time::sleep(NOTHING_ASKED)),
        }
    }

    fn stream(&self) -> &TcpStream {
        &self.place.connection.stream
    }

    /// Restarts the timeout after a write.
    fn note(&mut self, written: &Poll<io::Result<usize>>) {
        if let Poll::Ready(Ok(count)) = written
            && *count > 0
        {
            let bytes = &self.place.places.written;
            bytes.fetch_add(*count as u64, Ordering::Relaxed);
            self.no_progress
                .as_mut()
                .reset(Instant::now() + NOTHING_WRITTEN);
            self.unanswered = false;
            self.at_the_end.take().into_iter().for_each(Waker::wake);
        }
    }

    fn poll_read_now(
        &self,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        loop {
            ready!(self.stream().poll_read_ready(cx))?;
            match self.stream().try_read(buffer.initialize_unfilled()) {
                Ok(count) => {
                    buffer.advance(count);
                    return Poll::Ready(Ok(()));
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Poll::Ready(Err(error)),
            }
        }
    }

    fn poll_write_now(
        &self,
        cx: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        loop {
            ready!(self.stream().poll_write_ready(cx))?;
            match self.stream().try_write_vectored(parts) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                written => return Poll::Ready(written),
            }
        }
    }
}

impl AsyncRead for ClientStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let mut read = self.poll_read_now(cx, buffer);
        match (&read, buffer.filled().len() > before) {
            (Poll::Ready(Ok(())), true) => self.unanswered = true,
            // The server would drop the request of a client that has closed, perhaps a STOP.
            (Poll::Ready(Ok(())), false) if self.unanswered => {
                self.at_the_end = Some(cx.waker().clone());
                read = Poll::Pending;
            }
            _ => {}
        }
        if read.is_pending() && self.no_progress.as_mut().poll(cx).is_ready() {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        read
    }
}

impl AsyncWrite for ClientStream {
    fn poll_write(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.poll_write_vectored(cx, &[io::IoSlice::new(bytes)])
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = self.poll_write_now(cx, parts);
        self.note(&written);
        written
    }

    fn is_write_vectored(&self) -> bool {
        true
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        let ended = rustix::net::shutdown(self.stream(), rustix::net::Shutdown::Write);
        Poll::Ready(ended.map_err(io::Error::from))
    }
}

/// The connection of a request.
#[derive(Debug, Clone)]
pub(super) struct Peer(pub Arc<Connection>);

impl Connected<IncomingStream<'_, WebListener>> for Peer {
    fn connect_info(stream: IncomingStream<'_, WebListener>) -> Self {
        Self(Arc::clone(&stream.io().place.connection))
    }
}
