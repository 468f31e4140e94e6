//! The real-time side of links and servers allocates no memory during an exchange.
//!
//! A binary of its own: `tls` counts the TLS threads of its process, so no other test here may open a TLS connection.

#[path = "../tls_common/mod.rs"]
mod tls_common;

mod gateway;
mod link;
mod tls;
