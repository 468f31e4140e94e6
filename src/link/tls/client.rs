//! The controller's end of a TLS session: connects and proves both ends, before anything moves.

use std::sync::Arc;
use std::time::Duration;

use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::client::{Resumption, verify_server_cert_signed_by_trust_anchor};
use rustls::crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::server::ParsedCertificate;
use rustls::{
    ClientConfig, ClientConnection, DigitallySignedStruct, Error, RootCertStore, SignatureScheme,
};

use super::files::{FileError, Identity, TlsFiles};
use super::stream::TlsStream;
use super::thread::TlsTransport;
use super::{RECORD_LIMIT_NS, provider};
use crate::socket::{ConnectError, SocketOptions, TcpTransport};
use crate::tls_fault::TlsFault;
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;

/// Our certificate, the trusted authorities and the required name of the far end.
#[derive(Clone)]
pub struct TlsClient {
    config: Arc<ClientConfig>,
    name: Option<ServerName<'static>>,
    record_limit_ns: u64,
}

impl std::fmt::Debug for TlsClient {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TlsClient")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl PartialEq for TlsClient {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.config, &other.config) && self.name == other.name
    }
}

impl TlsClient {
    /// Reads the files. With `check_name` the far end's certificate must be for `name`, or else for the host in its
    /// address. Without it any certificate of the authority is accepted, as in OpenFresco's programs.
    ///
    /// # Errors
    /// The file that is wrong, by the key that names it; `server_name` if that is no name.
    pub fn new(files: &TlsFiles, name: Option<&str>, check_name: bool) -> Result<Self, FileError> {
        let name = match name {
            None => None,
            Some(name) => Some(
                ServerName::try_from(name.to_owned()).map_err(|_| FileError {
                    key: "server_name",
                    text: format!("{name:?} is neither a host name nor an address"),
                })?,
            ),
        };
        let Identity { chain, key } = files.identity()?;
        let roots = files.authorities()?;
        let provider = provider();
        let builder = ClientConfig::builder_with_provider(Arc::clone(&provider))
            .with_safe_default_protocol_versions()
            .map_err(|error| files.wrong_identity(&error))?;
        let builder = if check_name {
            builder.with_root_certificates(roots)
        } else {
            let verifier = Arc::new(AnyName { roots, provider });
            builder
                .dangerous()
                .with_custom_certificate_verifier(verifier)
        };
        let mut config = builder
            .with_client_auth_cert(chain, key)
            .map_err(|error| files.wrong_identity(&error))?;
        config.resumption = Resumption::disabled();
        Ok(Self {
            config: Arc::new(config),
            name,
            record_limit_ns: RECORD_LIMIT_NS,
        })
    }

    /// A record that has begun must be whole after `limit`; otherwise the link is lost.
    #[must_use]
    pub fn with_record_limit(mut self, limit: Duration) -> Self {
        self.record_limit_ns = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        self
    }

    /// Connects within `limit` and hands the session over to its thread. `largest`: bytes of the longest message that is
    /// sent at once.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn connect(
        &self,
        address: &str,
        limit: Duration,
        options: SocketOptions,
        largest: usize,
    ) -> Result<TlsTransport, ConnectError> {
        let limit_ns = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        let until = Nanos(os::monotonic_ns()).plus(limit_ns);
        let failed = |fault: TlsFault, detail: Option<&str>| ConnectError::Tls {
            address: address.to_owned(),
            fault,
            detail: detail.map(str::to_owned),
        };
        let name = match &self.name {
            Some(name) => name.clone(),
            None => ServerName::try_from(host(address).to_owned()).map_err(|_| {
                ConnectError::Address {
                    address: address.to_owned(),
                    reason: "it names no host that a certificate could be for".to_owned(),
                }
            })?,
        };
        let tcp = TcpTransport::connect(address, limit, options)?;
        let tls = ClientConnection::new(Arc::clone(&self.config), name)
            .map_err(|error| failed(TlsFault::Broken, Some(&error.to_string())))?;
        let mut stream = TlsStream::new(tcp, tls.into());
        stream.set_record_limit(self.record_limit_ns);
        match stream.handshake(until) {
            Ok(true) => {}
            Ok(false) => return Err(failed(TlsFault::SlowHandshake, None)),
            Err(fault) => return Err(failed(fault, stream.session.detail())),
        }
        TlsTransport::start(stream, largest)
            .map_err(|error| ConnectError::socket(address, "a thread for TLS", &error))
    }
}

/// The host of "host:port", without the brackets of an IPv6 address.
fn host(address: &str) -> &str {
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    host.strip_prefix('[')
        .and_then(|inner| inner.strip_suffix(']'))
        .unwrap_or(host)
}

/// Any certificate of the authority, whatever name it has.
#[derive(Debug)]
struct AnyName {
    roots: RootCertStore,
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for AnyName {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        intermediates: &[CertificateDer<'_>],
        _server_name: &ServerName<'_>,
        _ocsp_response: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        let certificate = ParsedCertificate::try_from(end_entity)?;
        let algorithms = self.provider.signature_verification_algorithms.all;
        verify_server_cert_signed_by_trust_anchor(
            &certificate,
            &self.roots,
            intermediates,
            now,
            algorithms,
        )?;
        Ok(ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls12_signature(message, certificate, signed, algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls13_signature(message, certificate, signed, algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider
            .signature_verification_algorithms
            .supported_schemes()
    }
}

#[cfg(test)]
mod tests {
    use super::host;

    #[test]
    fn host_is_the_part_before_the_port() {
        assert_eq!(host("rig.lab:4823"), "rig.lab");
        assert_eq!(host("[::1]:4823"), "::1");
        assert_eq!(host("127.0.0.1:1"), "127.0.0.1");
    }
}
