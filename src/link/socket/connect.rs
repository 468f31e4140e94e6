//! Names to addresses, and why there is no connection.

use std::io;
use std::net::{SocketAddr, ToSocketAddrs};
use std::time::Duration;

use thiserror::Error;

/// Why there is no connection.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ConnectError {
    /// The address means nothing.
    #[error(
        "{address:?} is no address: {reason} (wanted \"host:port\", \"127.0.0.1:port\" or \"[::1]:port\")"
    )]
    Address {
        /// As given.
        address: String,
        /// The system's word.
        reason: String,
    },
    /// Nobody listens there.
    #[error(
        "{address} refused the connection: nothing listens on that port; is the specimen's end running?"
    )]
    Refused {
        /// Where to.
        address: String,
    },
    /// No way to the machine.
    #[error(
        "{address} is unreachable: {reason}; is the address right, the cable in, and a route there?"
    )]
    Unreachable {
        /// Where to.
        address: String,
        /// The system's word.
        reason: String,
    },
    /// No answer.
    #[error(
        "{address} did not answer within {seconds} s: is the address right, and is a firewall in between?"
    )]
    Timeout {
        /// Where to.
        address: String,
        /// The time limit.
        seconds: f64,
    },
    /// The socket cannot be made or set up.
    #[error("{address}: {what}: {reason}")]
    Socket {
        /// Where to.
        address: String,
        /// What failed.
        what: &'static str,
        /// The system's word.
        reason: String,
    },
}

impl ConnectError {
    pub(super) fn socket(address: &str, what: &'static str, error: &io::Error) -> Self {
        Self::Socket {
            address: address.to_owned(),
            what,
            reason: error.to_string(),
        }
    }

    pub(super) fn connect(address: &str, limit: Duration, error: &io::Error) -> Self {
        let address = address.to_owned();
        match error.kind() {
            io::ErrorKind::ConnectionRefused | io::ErrorKind::ConnectionReset => {
                Self::Refused { address }
            }
            io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => Self::Timeout {
                address,
                seconds: limit.as_secs_f64(),
            },
            _ => Self::Unreachable {
                address,
                reason: error.to_string(),
            },
        }
    }
}

/// All socket addresses behind "host:port", IPv4 and IPv6, in the system's order; never empty.
///
/// # Errors
/// [`ConnectError::Address`].
pub fn resolve(address: &str) -> Result<Vec<SocketAddr>, ConnectError> {
    let refused = |reason: String| ConnectError::Address {
        address: address.to_owned(),
        reason,
    };
    let found: Vec<SocketAddr> = address
        .to_socket_addrs()
        .map_err(|error| refused(error.to_string()))?
        .collect();
    if found.is_empty() {
        Err(refused("the name has no address".to_owned()))
    } else {
        Ok(found)
    }
}
