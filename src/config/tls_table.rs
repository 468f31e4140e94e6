//! `[specimen.link.tls]` and `[serve.tls]`: the files of certificates, keys and authorities.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Certificates for `transport = "tls"`. Both ends present a certificate. A separate thread
/// encrypts the data, so there is no real-time guarantee. For real time, use the protocol of Gusset
/// with `key_file` instead.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TlsSpec {
    /// File (PEM) with the certificate of this end and all intermediate certificates. Default:
    /// `client.crt` beside the test file, otherwise in the working directory.
    #[schemars(example = &"client.pem")]
    pub certificate_file: Option<String>,
    /// File (PEM) with the private key of the certificate, not encrypted. Other users must not have
    /// access to it (`chmod 600`). It is never copied into the run folder. Default: `client.key`.
    #[schemars(example = &"client.key")]
    pub key_file: Option<String>,
    /// File (PEM) with the authorities that may sign the certificate of the other end. Default:
    /// `client_ca.crt`.
    #[schemars(example = &"laboratory-ca.pem")]
    pub ca_file: Option<String>,
    /// Name or address for which the certificate of the other end must be valid. Default: the host
    /// in `address`.
    #[schemars(example = &"rig.lab")]
    pub server_name: Option<String>,
    /// If false, any certificate of the authority is accepted, whatever its name, as in OpenFresco.
    /// Every owner of such a certificate can then act as the specimen.
    #[schemars(example = false)]
    pub check_name: bool,
}

impl Default for TlsSpec {
    fn default() -> Self {
        Self {
            certificate_file: None,
            key_file: None,
            ca_file: None,
            server_name: None,
            check_name: true,
        }
    }
}

/// Certificates for `transport = "tls"`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServeTlsSpec {
    /// File (PEM) with the certificate of this server and all intermediate certificates. Default:
    /// `server.crt` beside this file, otherwise in the working directory.
    #[schemars(example = &"server.pem")]
    pub certificate_file: Option<String>,
    /// File (PEM) with the private key of the certificate, not encrypted. Other users must not have
    /// access to it (`chmod 600`). Default: `server.key`.
    #[schemars(example = &"server.key")]
    pub key_file: Option<String>,
    /// File (PEM) with the authorities that may sign the certificate of a client. Default:
    /// `server_ca.crt`.
    #[schemars(example = &"laboratory-ca.pem")]
    pub ca_file: Option<String>,
    /// Whether a client must present a certificate. The protocol of Gusset always requires it.
    /// Default for OpenFresco: optional on loopback or if `openfresco.client` is given, otherwise
    /// required.
    #[schemars(example = &"required")]
    pub client_certificate: Option<ClientCertificate>,
}

/// Whether a client must present a certificate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClientCertificate {
    /// A client without a valid certificate is refused.
    Required,
    /// A client without a certificate is accepted. A certificate that is presented must be valid.
    Optional,
}
