//! The real-time side of links and servers allocates no memory during an exchange.
//!
//! These tests stay apart from the others: `tls` counts the TLS threads of its process. Nothing else here may open a TLS
//! connection.

#[path = "../tls_common/mod.rs"]
mod tls_common;

mod gateway;
mod link;
mod tls;
