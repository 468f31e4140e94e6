//! Single-byte datagrams that open a UDP connection: they depend on the program and its version.
//!
//! A server recognises them by itself (a first datagram of one byte). A client cannot find out by a trial: a stray
//! hello spoils the set-up of a server that expects none. So it is a setting, with these defaults.

/// Hello of the client.
pub(super) const HELLO: u8 = b'a';
/// The server's answer to it.
pub(super) const HELLO_ANSWER: u8 = b'b';
/// Both directions of the 1-byte endian exchange.
pub(super) const ENDIAN: u8 = 1;

/// Greeting of a client before the first message, over UDP.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct UdpGreeting {
    /// One datagram `61`, answered by one datagram `62`.
    pub hello: bool,
    /// After that, one datagram `01`, answered by one datagram `01`.
    pub endian: bool,
}

/// The listening program of a UDP connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Program {
    /// OpenSees `adapter`, `actuator`, `corotActuator` (3.7.1).
    OpenSees,
    /// OpenFresco 2.8 `startSimAppSiteServer`, `startSimAppElemServer`.
    OpenFrescoServer,
    /// OpenFresco 2.8 `ActorSite`.
    OpenFrescoSite,
    /// OpenFresco 2.7 and before: its application servers.
    OldOpenFrescoServer,
    /// OpenFresco 2.7 and before: its `ActorSite`.
    OldOpenFrescoSite,
    /// A server on OpenFresco's C socket library.
    CLibrary,
}

impl UdpGreeting {
    /// Neither.
    pub const NONE: UdpGreeting = UdpGreeting {
        hello: false,
        endian: false,
    };

    /// What `program` expects, from the table in section 4 of the protocol notes.
    #[must_use]
    pub const fn expected_by(program: Program) -> Self {
        match program {
            Program::OpenSees | Program::OpenFrescoSite | Program::OldOpenFrescoServer => Self {
                hello: true,
                endian: false,
            },
            Program::OpenFrescoServer | Program::CLibrary => Self::NONE,
            Program::OldOpenFrescoSite => Self {
                hello: true,
                endian: true,
            },
        }
    }
}
