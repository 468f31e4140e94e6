//! A TLS session of a server under the asynchronous runtime: from the first byte until the controller has armed.

use std::io::{self, Read, Write};

use tokio::net::TcpStream;

use super::server::TlsServer;
use super::session::Session;
use super::stream::TlsStream;
use crate::link::socket::{SocketOptions, TcpTransport};
use crate::link::tls_fault::TlsFault;

/// One caller.
pub(in crate::link) struct Greeting {
    stream: TcpStream,
    session: Session,
}

/// The socket as far as it is ready now.
struct Ready<'a>(&'a TcpStream);

impl Read for Ready<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.try_read(buffer)
    }
}

impl Write for Ready<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.try_write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Greeting {
    /// The handshake; the caller sets the time limit.
    pub(in crate::link) async fn accept(
        stream: TcpStream,
        server: &TlsServer,
    ) -> Result<Self, (TlsFault, Option<String>)> {
        let session = server
            .session()
            .map_err(|error| (TlsFault::Broken, Some(error.to_string())))?;
        let mut greeting = Self {
            stream,
            session: Session::new(session.into()),
        };
        match greeting.handshake().await {
            Ok(()) => Ok(greeting),
            Err(fault) => {
                // The reason must not be torn away by a reset: the caller may still be talking.
                let _ = greeting.session.push(&mut Ready(&greeting.stream));
                let _ = tokio::io::AsyncWriteExt::shutdown(&mut greeting.stream).await;
                greeting.hear_out();
                Err((fault, greeting.session.detail().map(str::to_owned)))
            }
        }
    }

    async fn handshake(&mut self) -> Result<(), TlsFault> {
        loop {
            self.session.push(&mut Ready(&self.stream))?;
            if !self.session.is_handshaking() {
                return self.flush().await;
            }
            self.ready().await?;
            self.session.pull(&mut Ready(&self.stream))?;
        }
    }

    async fn ready(&self) -> Result<(), TlsFault> {
        let interest = if self.session.wants_write() {
            tokio::io::Interest::READABLE | tokio::io::Interest::WRITABLE
        } else {
            tokio::io::Interest::READABLE
        };
        match self.stream.ready(interest).await {
            Ok(_) => Ok(()),
            Err(_) => Err(TlsFault::Lost),
        }
    }

    /// Takes what lies there already, so that closing is no reset.
    fn hear_out(&self) {
        let mut waste = [0; 4096];
        // Bounded: who floods gets the reset.
        for _ in 0..64 {
            if !matches!(self.stream.try_read(&mut waste), Ok(1..)) {
                return;
            }
        }
    }

    /// The next bytes.
    pub(in crate::link) async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, TlsFault> {
        loop {
            if let Some(count) = self.session.take(buffer)? {
                return Ok(count);
            }
            self.session.push(&mut Ready(&self.stream))?;
            if !self.session.pull(&mut Ready(&self.stream))? {
                self.ready().await?;
            }
        }
    }

    pub(in crate::link) async fn write_all(&mut self, bytes: &[u8]) -> Result<(), TlsFault> {
        self.session.put(bytes)?;
        self.flush().await
    }

    async fn flush(&mut self) -> Result<(), TlsFault> {
        loop {
            self.session.push(&mut Ready(&self.stream))?;
            if !self.session.wants_write() {
                return Ok(());
            }
            self.stream.writable().await.map_err(|_| TlsFault::Lost)?;
        }
    }

    /// The goodbye of TLS, as far as the caller takes it.
    pub(in crate::link) async fn shutdown(&mut self) {
        self.session.say_closed(&mut Ready(&self.stream));
        let _ = tokio::io::AsyncWriteExt::shutdown(&mut self.stream).await;
        self.hear_out();
    }

    /// The session leaves the runtime.
    pub(in crate::link) fn into_stream(self, options: SocketOptions) -> Result<TlsStream, String> {
        let stream = self.stream.into_std().map_err(|error| error.to_string())?;
        let tcp = TcpTransport::from_stream(stream, options).map_err(|error| error.to_string())?;
        Ok(TlsStream::over(tcp, self.session))
    }
}
