//! The specimen's end of a TLS session: which clients may connect.

use std::net::TcpStream;
use std::sync::Arc;

use rustls::server::{NoServerSessionStorage, WebPkiClientVerifier};
use rustls::{ServerConfig, ServerConnection};

use super::files::{FileError, Identity, TlsFiles};
use super::provider;
use super::stream::TlsStream;
use crate::socket::{ConnectError, SocketOptions, TcpTransport};

/// Our certificate, and the accepted ones.
#[derive(Clone)]
pub struct TlsServer {
    config: Arc<ServerConfig>,
    required: bool,
}

impl std::fmt::Debug for TlsServer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TlsServer")
            .field("required", &self.required)
            .finish_non_exhaustive()
    }
}

impl TlsServer {
    /// Reads the files. If a certificate is not `required` of clients, one that is shown must still hold.
    ///
    /// # Errors
    /// The file that is wrong, by the key that names it.
    pub fn new(files: &TlsFiles, required: bool) -> Result<Self, FileError> {
        let Identity { chain, key } = files.identity()?;
        let roots = Arc::new(files.authorities()?);
        let provider = provider();
        let verifier = WebPkiClientVerifier::builder_with_provider(roots, Arc::clone(&provider));
        let verifier = if required {
            verifier
        } else {
            verifier.allow_unauthenticated()
        };
        let verifier = verifier
            .build()
            .map_err(|error| files.wrong_authority(&error))?;
        let mut config = ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .map_err(|error| files.wrong_identity(&error))?
            .with_client_cert_verifier(verifier)
            .with_single_cert(chain, key)
            .map_err(|error| files.wrong_identity(&error))?;
        config.session_storage = Arc::new(NoServerSessionStorage {});
        config.send_tls13_tickets = 0;
        Ok(Self {
            config: Arc::new(config),
            required,
        })
    }

    /// True if every client needs a certificate.
    #[must_use]
    pub(crate) const fn requires_certificate(&self) -> bool {
        self.required
    }

    pub(super) fn session(&self) -> Result<ServerConnection, rustls::Error> {
        ServerConnection::new(Arc::clone(&self.config))
    }

    /// A session on a connection that was accepted; its handshake is still to come ([`TlsStream::handshake`]).
    ///
    /// # Errors
    /// [`ConnectError`]: the connection is already closed.
    pub fn accept(
        &self,
        stream: TcpStream,
        options: SocketOptions,
    ) -> Result<TlsStream, ConnectError> {
        let tcp = TcpTransport::from_stream(stream, options)?;
        match self.session() {
            Ok(tls) => Ok(TlsStream::new(tcp, tls.into())),
            Err(error) => Err(ConnectError::socket(
                &tcp.peer().to_string(),
                "a TLS session",
                &std::io::Error::other(error),
            )),
        }
    }
}
