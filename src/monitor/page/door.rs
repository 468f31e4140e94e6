//! The listening end: a bounded number of connections, each with a small buffer, and none without an answer for long.
//!
//! A connection takes a file descriptor and memory; neither may run out because of viewers.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep};

/// Connections at the same time; who comes after waits in the system's queue.
const MOST: usize = 96;
/// Bytes that the system may keep for one viewer: a slow one skips instead of reading what was long ago.
const SEND_BUFFER: usize = 128 << 10;
/// How long a caller stays who has not asked anything: who is silent, or does not come to the end of his first request. Whoever waits
/// at the door, with a STOP perhaps, waits no longer.
const NOTHING_ASKED: Duration = Duration::from_secs(3);
/// How long a caller stays who is told nothing more: who asks no more, or takes nothing. A viewer is told something ten times a
/// second.
const NOTHING_TOLD: Duration = Duration::from_secs(20);
/// How long what was sent may stay without an answer of the other machine, ms.
const NO_ANSWER_MS: u32 = 30_000;
/// Pause after a listener that fails, for want of descriptors for example.
const PAUSE: Duration = Duration::from_millis(200);

/// The listening end.
#[derive(Debug)]
pub(super) struct Door {
    listener: TcpListener,
    places: Arc<Semaphore>,
}

impl Door {
    pub fn new(listener: TcpListener) -> Self {
        Self {
            listener,
            places: Arc::new(Semaphore::new(MOST)),
        }
    }
}

impl Listener for Door {
    type Io = Caller;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Caller, SocketAddr) {
        loop {
            let Ok(place) = Arc::clone(&self.places).acquire_owned().await else {
                // Nobody closes it.
                std::future::pending::<()>().await;
                continue;
            };
            match self.listener.accept().await {
                Ok((stream, peer)) => {
                    // What is refused is a comfort and nothing more.
                    let _ = rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER);
                    let _ = rustix::net::sockopt::set_tcp_user_timeout(&stream, NO_ANSWER_MS);
                    let _ = stream.set_nodelay(true);
                    return (Caller::new(stream, place), peer);
                }
                Err(_) => tokio::time::sleep(PAUSE).await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// One connection.
#[derive(Debug)]
pub(super) struct Caller {
    stream: TcpStream,
    /// Until something is told to it.
    untold: Pin<Box<Sleep>>,
    _place: OwnedSemaphorePermit,
}

impl Caller {
    fn new(stream: TcpStream, place: OwnedSemaphorePermit) -> Self {
        Self {
            stream,
            untold: Box::pin(tokio::time::sleep(NOTHING_ASKED)),
            _place: place,
        }
    }

    /// Something was told, or was not.
    fn note(&mut self, told: &Poll<io::Result<usize>>) {
        if matches!(told, Poll::Ready(Ok(count)) if *count > 0) {
            self.untold.as_mut().reset(Instant::now() + NOTHING_TOLD);
        }
    }
}

impl AsyncRead for Caller {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.stream).poll_read(cx, buffer);
        if read.is_pending() && self.untold.as_mut().poll(cx).is_ready() {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        read
    }
}

impl AsyncWrite for Caller {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let told = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.note(&told);
        told
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let told = Pin::new(&mut self.stream).poll_write_vectored(cx, parts);
        self.note(&told);
        told
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

/// Who calls.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peer(pub SocketAddr);

impl Connected<IncomingStream<'_, Door>> for Peer {
    fn connect_info(stream: IncomingStream<'_, Door>) -> Self {
        Self(*stream.remote_addr())
    }
}
