//! Why there is no link, or no longer one, with everything that a person needs to look for the cause.

use thiserror::Error;

use super::settings::RemoteSettings;
use crate::socket::ConnectError;
use gusset_quantity::substructure::LinkFault;
use gusset_wire::WireError;
use gusset_wire::openfresco::Carrier;

/// Why there is no link to a specimen. Nothing was moved.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RemoteError {
    /// No connection.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// The settings, or the peer's answer, are invalid.
    #[error("{address}: {what}: {source}{}", hint(*source))]
    Wire {
        /// Where to.
        address: String,
        /// The operation that failed.
        what: &'static str,
        /// The fault.
        source: WireError,
    },
    /// The link was lost while it was set up.
    #[error("{address}: {what}: {fault}{}", closing(*fault))]
    Lost {
        /// Where to.
        address: String,
        /// The operation that failed.
        what: &'static str,
        /// How.
        fault: LinkFault,
    },
    /// The transport was lost, or hangs, and knows why.
    #[error("{address}: {text}")]
    Below {
        /// Where to.
        address: String,
        /// Why.
        text: String,
        /// The kind of the fault.
        fault: LinkFault,
    },
    /// The peer did not answer in time.
    #[error(
        "{address} did not answer {what} within {seconds} s: is it the right program, and, over UDP, the right hello?"
    )]
    Timeout {
        /// Where to.
        address: String,
        /// The item that was requested.
        what: &'static str,
        /// The time limit.
        seconds: f64,
    },
    /// A time limit or a number of axes that cannot be.
    #[error("{name} is {found}, but must be {allowed}")]
    Setting {
        /// Which.
        name: &'static str,
        /// The value that was given.
        found: f64,
        /// The domain, in words.
        allowed: &'static str,
    },
}

/// These programs give no reasons: the cause follows from when they fall silent.
fn closing(fault: LinkFault) -> &'static str {
    match fault {
        LinkFault::Closed => {
            " (a server does this with a second client, with other vector sizes, and with another protocol: compare the \
             number of axes, `protocol` and the port)"
        }
        _ => "",
    }
}

fn hint(error: WireError) -> &'static str {
    match error {
        WireError::SiteVersion { .. } => " (set `version` in `[specimen.link.openfresco]`)",
        WireError::Foreign { .. }
        | WireError::NotFinite { .. }
        | WireError::Action { .. }
        | WireError::Count { .. } => {
            " (is it the right port, and does `protocol` name what it speaks?)"
        }
        _ => "",
    }
}

impl RemoteError {
    /// The configuration key to point at.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::Setting { name, .. } => name,
            Self::Wire { .. } => "openfresco",
            Self::Connect(_) | Self::Lost { .. } | Self::Below { .. } | Self::Timeout { .. } => {
                "address"
            }
        }
    }

    /// The kind of the fault.
    #[must_use]
    pub fn fault(&self) -> LinkFault {
        match self {
            Self::Connect(ConnectError::Tls { fault, .. }) => fault.link(),
            Self::Connect(_) | Self::Setting { .. } => LinkFault::Closed,
            Self::Wire { source, .. } => source.fault(),
            Self::Lost { fault, .. } | Self::Below { fault, .. } => *fault,
            Self::Timeout { .. } => LinkFault::Timeout,
        }
    }
}

/// A lost link, or invalid bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Lost {
    Link(LinkFault),
    Wire(WireError),
}

impl Lost {
    pub(super) fn fault(self) -> LinkFault {
        match self {
            Self::Link(fault) => fault,
            Self::Wire(error) => error.fault(),
        }
    }
}

impl From<LinkFault> for Lost {
    fn from(fault: LinkFault) -> Self {
        Self::Link(fault)
    }
}

impl From<WireError> for Lost {
    fn from(error: WireError) -> Self {
        Self::Wire(error)
    }
}

/// Adds names to the errors of the set-up.
pub(super) struct Saying {
    address: String,
    carrier: Carrier,
    seconds: f64,
    what: &'static str,
}

impl Saying {
    pub(super) fn new(settings: &RemoteSettings, what: &'static str) -> Self {
        Self {
            address: settings.address.clone(),
            carrier: settings.carrier,
            seconds: settings.connect_limit_s,
            what,
        }
    }

    pub(super) fn wire(&self, source: WireError) -> RemoteError {
        RemoteError::Wire {
            address: self.address.clone(),
            what: self.what,
            source,
        }
    }

    pub(super) fn lost(&self, fault: LinkFault) -> RemoteError {
        let (address, what) = (self.address.clone(), self.what);
        match fault {
            // No datagram closes a connection: the machine itself reports that no program has the port.
            LinkFault::Closed if self.carrier == Carrier::Datagrams => {
                ConnectError::Refused { address }.into()
            }
            LinkFault::Timeout => RemoteError::Timeout {
                address,
                what,
                seconds: self.seconds,
            },
            fault => RemoteError::Lost {
                address,
                what,
                fault,
            },
        }
    }

    pub(super) fn why(&self, lost: Lost) -> RemoteError {
        match lost {
            Lost::Link(fault) => self.lost(fault),
            Lost::Wire(error) => self.wire(error),
        }
    }
}
