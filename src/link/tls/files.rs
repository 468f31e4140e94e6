//! Certificates, keys and authorities from PEM files.
//!
//! The names that are not given are those that OpenFresco looks for: `server.crt`, `server.key` and `server_ca.crt` at a
//! server, `client.crt`, `client.key` and `client_ca.crt` at a client; each `…_ca.crt` verifies the other end.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{Error, InconsistentKeys, RootCertStore};
use thiserror::Error as Thiserror;

use crate::tls_fault::TlsFault;
use gusset_config::{ServeTlsSpec, TlsSpec};
use gusset_record::rt::secret_file::{SecretError, open_secret};

/// No PEM file of use is longer.
const LONGEST: u64 = 1 << 20;

/// Which end of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Connects.
    Client,
    /// Listens.
    Server,
}

/// A faulty file, and the key that names it.
#[derive(Debug, Clone, PartialEq, Eq, Thiserror)]
#[error("{text}")]
pub struct FileError {
    /// The key in the table of TLS.
    pub key: &'static str,
    /// The file and its fault.
    pub text: String,
}

/// Where certificate, key and authorities are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// Our certificate and those above it.
    pub certificate: PathBuf,
    /// The private key of our certificate.
    pub key: PathBuf,
    /// The authorities that may have signed the other end's.
    pub ca: PathBuf,
}

/// A certificate with its key.
pub(super) struct Identity {
    pub(super) chain: Vec<CertificateDer<'static>>,
    pub(super) key: PrivateKeyDer<'static>,
}

impl TlsFiles {
    /// The files of a controller, for a test file in `folder`.
    #[must_use]
    pub fn of_client(spec: &TlsSpec, folder: &Path) -> Self {
        let given = [&spec.certificate_file, &spec.key_file, &spec.ca_file];
        Self::locate(given.map(Option::as_deref), End::Client, folder)
    }

    /// The files of a server, for a file of specimens in `folder`.
    #[must_use]
    pub fn of_server(spec: &ServeTlsSpec, folder: &Path) -> Self {
        let given = [&spec.certificate_file, &spec.key_file, &spec.ca_file];
        Self::locate(given.map(Option::as_deref), End::Server, folder)
    }

    /// Certificate, key and authorities as `given`, relative to `folder`. Missing names are those of OpenFresco, in
    /// `folder` or, if none of them is there, in the working directory.
    #[must_use]
    pub(crate) fn locate(given: [Option<&str>; 3], end: End, folder: &Path) -> Self {
        let usual = match end {
            End::Client => ["client.crt", "client.key", "client_ca.crt"],
            End::Server => ["server.crt", "server.key", "server_ca.crt"],
        };
        let there = |place: &Path| {
            let mut missing = given.iter().zip(usual).filter(|(given, _)| given.is_none());
            missing.any(|(_, name)| place.join(name).exists())
        };
        let here = Path::new("");
        let place = if !there(folder) && there(here) {
            here
        } else {
            folder
        };
        let [certificate, key, ca] = [0, 1, 2].map(|index: usize| {
            let path = match given.get(index).copied().flatten() {
                Some(file) => folder.join(file),
                None => place.join(usual.get(index).copied().unwrap_or_default()),
            };
            std::path::absolute(&path).unwrap_or(path)
        });
        Self {
            certificate,
            key,
            ca,
        }
    }

    pub(super) fn identity(&self) -> Result<Identity, FileError> {
        let what = "the certificate file";
        let bytes = read("certificate_file", what, &self.certificate)?;
        let chain = certificates("certificate_file", what, &self.certificate, &bytes)?;
        let what = "the private key file";
        let file = open_secret(&self.key).map_err(|error| match error {
            SecretError::Io(error) => unreadable("key_file", what, &self.key, &error),
            open @ SecretError::Open { .. } => wrong("key_file", what, &self.key, &open),
        })?;
        let bytes = read_from(file, "key_file", what, &self.key)?;
        let key = PrivateKeyDer::from_pem_slice(&bytes).map_err(|_| {
            let encrypted = bytes
                .windows(ENCRYPTED.len())
                .any(|window| window == ENCRYPTED);
            let reason = if encrypted {
                "its key is encrypted: openssl pkey -in FILE -out PLAIN-FILE decrypts it"
            } else {
                "it holds no private key in PEM"
            };
            wrong("key_file", what, &self.key, &reason)
        })?;
        Ok(Identity { chain, key })
    }

    pub(super) fn authorities(&self) -> Result<RootCertStore, FileError> {
        let (key, what) = ("ca_file", "the file of authorities");
        let bytes = read(key, what, &self.ca)?;
        let mut roots = RootCertStore::empty();
        for certificate in certificates(key, what, &self.ca, &bytes)? {
            roots
                .add(certificate)
                .map_err(|error| self.wrong_authority(&error))?;
        }
        Ok(roots)
    }

    pub(super) fn wrong_authority(&self, error: &dyn Display) -> FileError {
        wrong("ca_file", "the file of authorities", &self.ca, error)
    }

    /// Certificate and key are readable, and cannot be used.
    pub(super) fn wrong_identity(&self, error: &Error) -> FileError {
        match error {
            Error::InconsistentKeys(InconsistentKeys::KeyMismatch) => {
                let reason = format!(
                    "it is not the key of the certificate {}",
                    self.certificate.display()
                );
                wrong("key_file", "the private key file", &self.key, &reason)
            }
            Error::InvalidCertificate(_) => {
                let reason = format!("{}; {error}", TlsFault::of(error)).replace("its ", "the ");
                wrong(
                    "certificate_file",
                    "the certificate file",
                    &self.certificate,
                    &reason,
                )
            }
            other => wrong("key_file", "the private key file", &self.key, other),
        }
    }
}

const ENCRYPTED: &[u8] = b"ENCRYPTED";

fn wrong(key: &'static str, what: &str, path: &Path, reason: &dyn Display) -> FileError {
    FileError {
        key,
        text: format!("{what} {} cannot be used: {reason}", path.display()),
    }
}

fn unreadable(key: &'static str, what: &str, path: &Path, error: &io::Error) -> FileError {
    FileError {
        key,
        text: format!("{what} {} cannot be read: {error}", path.display()),
    }
}

fn read(key: &'static str, what: &str, path: &Path) -> Result<Vec<u8>, FileError> {
    let file = File::open(path).map_err(|error| unreadable(key, what, path, &error))?;
    read_from(file, key, what, path)
}

fn read_from(file: File, key: &'static str, what: &str, path: &Path) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    let read = file.take(LONGEST).read_to_end(&mut bytes);
    read.map_err(|error| unreadable(key, what, path, &error))?;
    Ok(bytes)
}

fn certificates(
    key: &'static str,
    what: &str,
    path: &Path,
    bytes: &[u8],
) -> Result<Vec<CertificateDer<'static>>, FileError> {
    let found: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(bytes).collect();
    match found {
        Ok(found) if !found.is_empty() => Ok(found),
        Ok(_) => Err(wrong(key, what, path, &"it holds no certificate in PEM")),
        Err(error) => Err(wrong(key, what, path, &error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_names_are_those_of_openfresco() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let files = TlsFiles::of_server(&ServeTlsSpec::default(), folder);
        assert_eq!(files.certificate, folder.join("server.crt"));
        assert_eq!(files.key, folder.join("server.key"));
        assert_eq!(files.ca, folder.join("server_ca.crt"));
        let spec: TlsSpec = toml::from_str("key_file = \"keys/mine.pem\"").unwrap();
        let files = TlsFiles::of_client(&spec, folder);
        assert_eq!(files.certificate, folder.join("client.crt"));
        assert_eq!(files.key, folder.join("keys/mine.pem"));
        assert!(spec.check_name);
    }

    #[test]
    fn unusable_file_is_named_with_its_key() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let files = TlsFiles::of_client(&TlsSpec::default(), folder);
        let said = |files: &TlsFiles| match files.identity() {
            Ok(_) => panic!("it is none"),
            Err(error) => (error.key, error.text),
        };
        let (key, text) = said(&files);
        assert_eq!(key, "certificate_file");
        assert!(text.contains("client.crt"), "{text}");
        std::fs::write(folder.join("client.crt"), "nothing").unwrap();
        let (key, text) = said(&files);
        assert_eq!(key, "certificate_file");
        assert!(text.contains("no certificate"), "{text}");
        let authorities = files.authorities().unwrap_err();
        assert_eq!(authorities.key, "ca_file");
        assert!(authorities.text.contains("client_ca.crt"));
    }
}
