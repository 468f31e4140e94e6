//! Who came over TCP: a bare connection, or a TLS session on one. Above, both are the same.

use std::io;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use super::line::{Carried, Line};
use crate::link::tls::{Greeting, TlsFault, TlsServer};
use crate::link::{SocketOptions, TcpTransport};

/// A connection that has not armed yet.
pub(super) enum Caller {
    Plain(TcpStream),
    Tls(Box<Greeting>),
}

/// Why nothing more comes from a caller.
pub(super) enum Lost {
    /// It is gone.
    Gone,
    /// It is turned away, for this reason.
    Tls(String),
}

impl From<io::Error> for Lost {
    fn from(_: io::Error) -> Self {
        Lost::Gone
    }
}

impl From<TlsFault> for Lost {
    fn from(fault: TlsFault) -> Self {
        match fault {
            TlsFault::Closed | TlsFault::Lost => Lost::Gone,
            fault => Lost::Tls(reason(fault, None)),
        }
    }
}

fn reason(fault: TlsFault, detail: Option<&str>) -> String {
    let detail = detail.map_or_else(String::new, |detail| format!(" ({detail})"));
    let advice = if fault == TlsFault::NotTls {
        ": its end wants `transport = \"tls\"`"
    } else {
        ""
    };
    format!("TLS: {fault}{detail}{advice}")
}

impl Caller {
    /// With `tls`, its handshake; the caller of this sets the time limit.
    pub(super) async fn let_in(stream: TcpStream, tls: Option<&TlsServer>) -> Result<Self, Lost> {
        let Some(server) = tls else {
            return Ok(Self::Plain(stream));
        };
        match Greeting::accept(stream, server).await {
            Ok(greeting) => Ok(Self::Tls(Box::new(greeting))),
            Err((fault, detail)) => Err(Lost::Tls(reason(fault, detail.as_deref()))),
        }
    }

    /// The next bytes.
    pub(super) async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Lost> {
        match self {
            Self::Plain(stream) => match stream.read(buffer).await? {
                0 => Err(Lost::Gone),
                count => Ok(count),
            },
            Self::Tls(greeting) => Ok(greeting.read(buffer).await?),
        }
    }

    pub(super) async fn write_all(&mut self, bytes: &[u8]) -> Result<(), Lost> {
        match self {
            Self::Plain(stream) => Ok(stream.write_all(bytes).await?),
            Self::Tls(greeting) => Ok(greeting.write_all(bytes).await?),
        }
    }

    /// Nothing more will be written.
    pub(super) async fn shutdown(&mut self) {
        match self {
            Self::Plain(stream) => {
                let _ = stream.shutdown().await;
            }
            Self::Tls(greeting) => greeting.shutdown().await,
        }
    }

    /// Leaves the runtime, for the data thread.
    pub(super) fn into_line(self) -> Result<Line, String> {
        let options = SocketOptions::default();
        match self {
            Self::Plain(stream) => {
                let stream = stream.into_std().map_err(|error| error.to_string())?;
                let tcp = TcpTransport::from_stream(stream, options);
                Ok(Carried::Tcp(tcp.map_err(|error| error.to_string())?).into())
            }
            Self::Tls(greeting) => {
                Ok(Carried::Tls(Box::new(greeting.into_stream(options)?)).into())
            }
        }
    }
}
