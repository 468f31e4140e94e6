//! TLS under our own protocol and under OpenFresco's: the same bytes, inside a session that both ends have proven.
//!
//! | file | does |
//! |---|---|
//! | `files` | certificates, keys and authorities from PEM files, with OpenFresco's names as the defaults |
//! | `client` | connects: on the caller's thread, before anything moves |
//! | `server` | which clients may connect |
//! | `session` | one TLS session over any socket that does not block |
//! | `stream` | the session on the thread that asks: a server's |
//! | `thread` | the session on a separate thread: the loop's |
//!
//! **The exception to the promise of no allocation.** Encrypting and decrypting allocates. So on the loop's side the
//! whole exchange lives on a helper thread. The loop's own thread hands bytes over through two rings and one atomic,
//! allocates nothing, takes no lock and waits no longer than its deadline, as over plain TCP. The helper thread costs two
//! more changes of thread for each exchange, and gives no promise about time. For real time through an untrusted network,
//! use frames signed with a pre-shared key. A server's data thread decrypts by itself.
//!
//! Versions 1.2 and 1.3; no resumption, no early data: a session is one test. The cryptography is ring's (ISC and Apache
//! 2.0): C and prebuilt assembly that the compiler driver of the linker builds, no cmake, no system library. aws-lc
//! costs twice the build for the same suites; the pure Rust providers are no releases yet.
//!
//! Invariants: no wait without a limit, in the handshake, in the middle of a record and at the goodbye; every failure has a
//! name ([`TlsFault`]); keys never leave this module. Not here: revocation lists, and the meaning of the bytes.

mod client;
mod files;
mod record;
mod server;
mod session;
mod stream;
mod thread;

pub use crate::tls_fault::TlsFault;
pub use client::TlsClient;
pub use files::{End, FileError, TlsFiles};
pub use server::TlsServer;
pub use stream::TlsStream;
pub use thread::TlsTransport;

use std::sync::Arc;

use rustls::crypto::{CryptoProvider, ring};

/// A record that has begun must be whole after this time, unless its link sets another.
pub(crate) const RECORD_LIMIT_NS: u64 = 5_000_000_000;

fn provider() -> Arc<CryptoProvider> {
    Arc::new(ring::default_provider())
}

/// True for the beginning of a TLS session where something else was due: a ClientHello. No frame of ours and no sizes
/// of OpenFresco's begin so: these sizes would be counts beyond every bound.
#[must_use]
pub(crate) fn is_client_hello(bytes: &[u8]) -> bool {
    matches!(bytes, [22, 3, 0..=4, ..])
}

/// True for a TLS alert where an answer was due: a TLS server sends it to a client without TLS.
#[must_use]
pub(crate) fn is_alert(bytes: &[u8]) -> bool {
    matches!(bytes, [21, 3, 0..=4, 0, ..])
}
