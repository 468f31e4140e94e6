//! How to reach a specimen behind OpenFresco or OpenSees, with the defaults that suit the current programs.

use super::role::Role;
use crate::socket::Wait;
use crate::tls::TlsClient;
use gusset_wire::WireError;
use gusset_wire::openfresco::{
    Carrier, Counts, DEFAULT_DATA_SIZE, Peer, SignalOrder, Sizes, UdpGreeting,
};

/// How to reach a specimen behind OpenFresco or OpenSees.
#[derive(Debug, Clone, PartialEq)]
pub struct RemoteSettings {
    /// The program that listens there.
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
        let (ctrl, daq) = peer.usual_signals(axes);
        Self {
            peer,
            carrier,
            address: address.into(),
            axes,
            ctrl,
            daq,
            data_size: DEFAULT_DATA_SIZE,
            greeting: UdpGreeting::expected_by(peer.program()),
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
    pub(crate) const fn measures_disp(&self) -> bool {
        self.daq.disp > 0
    }

    /// True if the server reports the position of the specimen before the first command.
    #[must_use]
    pub(crate) fn reports_position(&self) -> bool {
        self.peer.reports_position(self.daq, self.axes)
    }

    pub(super) fn sizes(&self) -> Result<Sizes, WireError> {
        let matrices = self.peer == Peer::Element;
        Sizes::fitted(self.ctrl, self.daq, self.data_size, matrices)
    }
}

/// How a server treats its clients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServeSettings {
    /// The program it takes the place of.
    pub role: Role,
    /// From the connection to the sizes, in s: a silent client must not keep the port.
    pub setup_limit_s: f64,
    /// Silence after which a client counts as lost, in s; `None`: while the connection lasts. Over UDP there is no
    /// connection, so it should be set there.
    pub idle_limit_s: Option<f64>,
    /// Order of the signals behind `SimSimulink`; none: a client for which it matters is refused.
    pub signal_order: Option<SignalOrder>,
    /// Computed specimens over UDP: silence after which a new client of the same machine takes over, in s. A killed client
    /// sends no goodbye there.
    pub takeover_s: f64,
}

impl ServeSettings {
    /// Default limit for the silence of a UDP client, in s.
    pub const UDP_IDLE_S: f64 = 60.0;

    /// The usual limits.
    #[must_use]
    pub const fn new(role: Role, idle_limit_s: Option<f64>) -> Self {
        Self {
            role,
            setup_limit_s: 10.0,
            idle_limit_s,
            signal_order: None,
            takeover_s: 2.0,
        }
    }
}
