//! How to reach a specimen behind OpenFresco or OpenSees, with the defaults that suit the current programs.

use crate::link::socket::Wait;
use crate::link::tls::TlsClient;
use crate::wire::WireError;
use crate::wire::openfresco::{
    Carrier, Counts, DEFAULT_DATA_SIZE, Peer as Program, Sizes, UdpGreeting,
};

/// What listens at the other end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Peer {
    /// A: OpenFresco's `startSimAppElemServer`, or a server of ours. Answers requests for matrices.
    Element,
    /// A: OpenFresco's `startSimAppSiteServer`. Knows no matrices.
    Site,
    /// B: OpenFresco's `expSite ActorSite` with `startLabServer`.
    Actor,
    /// C: an OpenSees `adapter`, `actuator` or `corotActuator`.
    Adapter,
}

impl std::fmt::Display for Peer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Element => "OpenFresco element server",
            Self::Site => "OpenFresco site server",
            Self::Actor => "OpenFresco actor site",
            Self::Adapter => "OpenSees adapter",
        })
    }
}

/// How to reach a specimen behind OpenFresco or OpenSees.
#[derive(Debug, Clone, PartialEq)]
pub struct RemoteSettings {
    /// What listens there.
    pub peer: Peer,
    /// TCP or UDP.
    pub carrier: Carrier,
    /// "host:port".
    pub address: String,
    /// Number of axes.
    pub axes: usize,
    /// Signals of a command.
    pub ctrl: Counts,
    /// Signals of an answer.
    pub daq: Counts,
    /// Doubles in a vector; raised as far as commands, answers and matrices need it.
    pub data_size: usize,
    /// Bytes before everything else, over UDP.
    pub greeting: UdpGreeting,
    /// Dialect B: our site tag.
    pub site: f64,
    /// Dialect B: the version that both sides compare for exact equality.
    pub version: f64,
    /// Time limit of the connection and its set-up, in s. A refused connection is tried again until then: the far end
    /// may be started after us.
    pub connect_limit_s: f64,
    /// Time limit of each answer, in s.
    pub reply_limit_s: f64,
    /// How waits are spent.
    pub wait: Wait,
    /// With it the stream is TLS.
    pub tls: Option<TlsClient>,
}

impl RemoteSettings {
    /// The usual settings for a peer.
    #[must_use]
    pub fn new(peer: Peer, carrier: Carrier, address: impl Into<String>, axes: usize) -> Self {
        let n = axes;
        let (ctrl, daq, program) = match peer {
            // Its displacements, velocities, accelerations and times are always zero.
            Peer::Element => (
                Counts::new(n, n, n, 0, 1),
                Counts::new(0, 0, 0, n, 0),
                Program::OpenFrescoServer,
            ),
            Peer::Site => (
                Counts::new(n, n, n, 0, 1),
                Counts::new(n, n, n, n, 1),
                Program::OpenFrescoServer,
            ),
            // What a bank of uniaxial materials insists on.
            Peer::Actor => (
                Counts::new(n, n, 0, 0, 0),
                Counts::new(n, n, 0, n, 0),
                Program::OpenFrescoSite,
            ),
            Peer::Adapter => (
                Counts::new(n, 0, 0, 0, 0),
                Counts::new(n, 0, 0, n, 0),
                Program::OpenSees,
            ),
        };
        Self {
            peer,
            carrier,
            address: address.into(),
            axes,
            ctrl,
            daq,
            data_size: DEFAULT_DATA_SIZE,
            greeting: UdpGreeting::expected_by(program),
            site: 0.0,
            version: 2.8,
            connect_limit_s: 10.0,
            reply_limit_s: 5.0,
            wait: Wait::default(),
            tls: None,
        }
    }

    pub(super) const fn carrier_name(&self) -> &'static str {
        match (self.carrier, &self.tls) {
            (Carrier::Stream, Some(_)) => "TLS",
            (Carrier::Stream, None) => "TCP",
            (Carrier::Datagrams, _) => "UDP",
        }
    }

    /// False if the answers hold no displacement. The command then takes the place of the measured one.
    #[must_use]
    pub const fn measures_disp(&self) -> bool {
        self.daq.disp > 0
    }

    /// True of a force server that measures when it is asked. An actor only gives back what it measured after a command, and
    /// an adapter takes no request before one.
    #[must_use]
    pub fn tells_where_it_stands(&self) -> bool {
        let can = matches!(self.peer, Peer::Element | Peer::Site);
        can && self.daq.disp == self.axes && self.daq.force == self.axes
    }

    pub(super) fn sizes(&self) -> Result<Sizes, WireError> {
        let matrices = self.peer == Peer::Element;
        Sizes::fitted(self.ctrl, self.daq, self.data_size, matrices)
    }
}
