//! Names to addresses, and why there is no connection.

use std::io;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};
use std::time::Duration;

use thiserror::Error;

use crate::tls_fault::TlsFault;

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
    /// The name of a machine means nothing.
    #[error(
        "{host:?} names no machine: {reason} (wanted a host name or an address, without a port)"
    )]
    Host {
        /// As given.
        host: String,
        /// The system's word.
        reason: String,
    },
    /// No program listens at the address.
    #[error(
        "{address} refused the connection: nothing listens on that port; is the specimen's end running?"
    )]
    Refused {
        /// Where to.
        address: String,
    },
    /// The machine cannot be reached.
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
    /// There is a connection, and no TLS session on it.
    #[error(
        "{address}: TLS: {fault}{}{}",
        detail.as_ref().map_or_else(String::new, |detail| format!(" ({detail})")),
        advice(*fault)
    )]
    Tls {
        /// Where to.
        address: String,
        /// Why.
        fault: TlsFault,
        /// More about it.
        detail: Option<String>,
    },
    /// The socket cannot be made or set up.
    #[error("{address}: {what}: {reason}")]
    Socket {
        /// Where to.
        address: String,
        /// The call that failed.
        what: &'static str,
        /// The system's word.
        reason: String,
    },
}

/// Remedy.
const fn advice(fault: TlsFault) -> &'static str {
    match fault {
        TlsFault::NotTls => {
            " (set `transport = \"tcp\"`, or start the far end with `--transport tls`)"
        }
        TlsFault::OtherName => {
            " (make its certificate for this name, name the right one with `server_name`, or set `check_name = false`)"
        }
        _ => "",
    }
}

impl ConnectError {
    pub(crate) fn socket(address: &str, what: &'static str, error: &io::Error) -> Self {
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

/// All addresses of a machine that is named without a port: `rig.lab`, `192.0.2.7`, `2001:db8::7` or `[2001:db8::7]`; never
/// empty.
///
/// # Errors
/// [`ConnectError::Host`].
pub fn resolve_host(host: &str) -> Result<Vec<IpAddr>, ConnectError> {
    let refused = |reason: String| ConnectError::Host {
        host: host.to_owned(),
        reason,
    };
    let bare = host
        .strip_prefix('[')
        .and_then(|inner| inner.strip_suffix(']'))
        .unwrap_or(host);
    let found: Vec<IpAddr> = (bare, 0)
        .to_socket_addrs()
        .map_err(|error| refused(error.to_string()))?
        .map(|address| address.ip())
        .collect();
    if found.is_empty() {
        Err(refused("the name has no address".to_owned()))
    } else {
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machine_is_named_without_its_port() {
        let one = |host: &str| resolve_host(host).map(|all| all[0]);
        assert_eq!(one("192.0.2.7"), Ok("192.0.2.7".parse().unwrap()));
        assert_eq!(one("2001:db8::7"), Ok("2001:db8::7".parse().unwrap()));
        assert_eq!(one("[::1]"), Ok("::1".parse().unwrap()));
        assert!(one("localhost").unwrap().is_loopback());
        let text = one("127.0.0.1:80").unwrap_err().to_string();
        assert!(text.contains("no machine"), "{text}");
    }
}
