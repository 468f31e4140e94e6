//! `[specimen.link.openfresco]`: what the set-up of these protocols cannot find out by itself.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Peer, RemoteError, RemoteSettings};
use crate::link::Wait;
use crate::link::spec::{Carrier, LinkSpec, Protocol};
use crate::wire::openfresco::{Carrier as Bytes, Counts, MAX_COUNT, MAX_DATA_SIZE, SignalOrder};

/// What the set-up cannot find out by itself. Every key has a default that suits the current programs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpenFrescoSpec {
    /// For "openfresco": what listens there. A site server measures displacements and answers no matrices. An element server
    /// answers matrices, and its displacements are always zero: only its force is used, unless `answer_signals` asks for more.
    pub server: Far,
    /// Doubles in every vector. It is raised as far as commands and answers need it; smaller is faster. Default: 256.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_size: Option<usize>,
    /// Over UDP: begin with the byte `a` and wait for `b`. Default: as the current program of the far end wants it (no for
    /// OpenFresco 2.8 application servers; yes for its sites, for OpenSees and for OpenFresco 2.7).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub udp_hello: Option<bool>,
    /// Over UDP, for "openfresco-shadow": exchange the endian byte after the hello, as OpenFresco 2.7 does. Default: no.
    pub udp_endian: bool,
    /// Numbers of displacements, velocities, accelerations, forces and times (0 or 1) in a command. Default: what the
    /// far end is known to take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_signals: Option<[usize; 5]>,
    /// Numbers of displacements, velocities, accelerations, forces and times (0 or 1) in an answer. Default: what the far end is
    /// known to give; an element server gives forces only. A number of displacements above 0 says that the server measures them. That is true of `gusset serve` (`[1, 1, 1, 1, 1]` for one axis)
    /// and false of OpenFresco's `startSimAppElemServer`, which answers zeros.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer_signals: Option<[usize; 5]>,
    /// For "openfresco-shadow": the version number that both sites compare for exact equality. Default: 2.8.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub version: Option<f64>,
    /// For "openfresco-shadow": our site tag.
    #[schemars(range(max = u32::MAX))]
    pub site: u32,
}

/// How a specimen is offered over OpenFresco's protocols.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpenFrescoServeSpec {
    /// Name or address of the one machine that may command the specimen; everybody else is turned away. Required beyond
    /// loopback, for these protocols know no key, unless TLS requires certificates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub client: Option<String>,
    /// Silence in s after which a client counts as gone. Default: none over TCP, where the connection shows it; 60 over
    /// UDP. At a computed specimen over UDP, a new client of the same machine takes over after 2 s of silence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub idle_timeout_s: Option<f64>,
    /// Something moves here: a step that the client takes back ends the test, and a new client finds the specimen as the
    /// last one left it.
    pub physical: bool,
    /// Test time of one step in s, for clients that send no time. Default: rate effects follow the velocities alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_s: Option<f64>,
    /// For "openfresco-simulink": the order of the signals in commands and answers, as the control points of the OpenFresco
    /// model have them. OpenFresco does not announce it. Required with more than one axis and more than one quantity
    /// (displacement, velocity, acceleration, force, time), either commanded or measured: otherwise such a client is refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signal_order: Option<SignalOrderSpec>,
}

/// The order of SimSimulink's signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SignalOrderSpec {
    /// d1 v1 d2 v2, and d1 f1 d2 f2: all quantities of an axis (displacement, velocity, acceleration, force), then those of
    /// the next axis. A client that sends or requests the time, too, is refused: its place is unknown.
    ByAxis,
    /// d1 d2 v1 v2, and d1 d2 f1 f2: one quantity of all axes, then the next quantity. The time stands last.
    ByQuantity,
}

impl From<SignalOrderSpec> for SignalOrder {
    fn from(spec: SignalOrderSpec) -> Self {
        match spec {
            SignalOrderSpec::ByAxis => Self::ByAxis,
            SignalOrderSpec::ByQuantity => Self::ByQuantity,
        }
    }
}

/// What listens at the far end of "openfresco".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Far {
    /// `startSimAppElemServer`, or `gusset serve` with `answer_signals`.
    #[default]
    Element,
    /// `startSimAppSiteServer`.
    Site,
}

impl RemoteSettings {
    /// The settings that a test file describes for a specimen of `axes` axes; `None` if it speaks our own protocol.
    ///
    /// # Errors
    /// [`RemoteError::Setting`] for a number outside its domain, by the name of its key.
    pub fn from_spec(spec: &LinkSpec, axes: usize) -> Result<Option<Self>, RemoteError> {
        let more = spec.openfresco.clone().unwrap_or_default();
        let peer = match (spec.protocol, more.server) {
            (Protocol::Gusset, _) => return Ok(None),
            (Protocol::OpenFresco, Far::Element) => Peer::Element,
            (Protocol::OpenFresco, Far::Site) => Peer::Site,
            (Protocol::OpenFrescoShadow, _) => Peer::Actor,
            (Protocol::OpenFrescoAdapter, _) => Peer::Adapter,
        };
        let carrier = match spec.transport {
            Carrier::Tcp | Carrier::Tls => Bytes::Stream,
            Carrier::Udp => Bytes::Datagrams,
        };
        let mut settings = Self::new(peer, carrier, spec.address.clone(), axes);
        if let Some(size) = more.data_size {
            if !(1..=MAX_DATA_SIZE).contains(&size) {
                return Err(RemoteError::Setting {
                    name: "data_size",
                    found: size as f64,
                    allowed: "from 1 to 65536",
                });
            }
            settings.data_size = size;
        }
        for (name, given, counts) in [
            ("command_signals", more.command_signals, &mut settings.ctrl),
            ("answer_signals", more.answer_signals, &mut settings.daq),
        ] {
            let Some([d, v, a, f, t]) = given else {
                continue;
            };
            let highest = [d, v, a, f].into_iter().max().unwrap_or(0);
            if !(highest <= MAX_COUNT && t <= 1) {
                return Err(RemoteError::Setting {
                    name,
                    found: highest.max(t) as f64,
                    allowed: "four numbers up to 4096 and a last one of 0 or 1",
                });
            }
            let odd = [d, v, a, f].into_iter().find(|&n| n != 0 && n != axes);
            if let Some(found) = odd {
                return Err(RemoteError::Setting {
                    name,
                    found: found as f64,
                    allowed: "0 or the number of axes in each of its first four numbers",
                });
            }
            *counts = Counts::new(d, v, a, f, t);
        }
        if let Some(hello) = more.udp_hello {
            settings.greeting.hello = hello;
        }
        settings.greeting.endian = more.udp_endian;
        if let Some(version) = more.version {
            if !version.is_finite() {
                return Err(RemoteError::Setting {
                    name: "version",
                    found: version,
                    allowed: "a finite number",
                });
            }
            settings.version = version;
        }
        settings.site = f64::from(more.site);
        settings.connect_limit_s = spec.connect_timeout_s;
        settings.reply_limit_s = spec.reply_timeout_s;
        if !(0.0..=1e6).contains(&spec.spin_us) {
            return Err(RemoteError::Setting {
                name: "spin_us",
                found: spec.spin_us,
                allowed: "from 0 to 1e6",
            });
        }
        settings.wait = Wait {
            spin_first_ns: (spec.spin_us * 1e3) as u64,
            spin_last_ns: 0,
        };
        Ok(Some(settings))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::openfresco::UdpGreeting;

    fn settings(text: &str) -> Result<RemoteSettings, RemoteError> {
        let spec: LinkSpec = toml::from_str(text).unwrap();
        RemoteSettings::from_spec(&spec, 2).map(Option::unwrap)
    }

    #[test]
    fn defaults_suit_the_current_programs() {
        let found = settings("protocol = \"openfresco\"\naddress = \"h:8090\"").unwrap();
        assert_eq!(found.peer, Peer::Element);
        assert_eq!(found.greeting, UdpGreeting::NONE);
        let found = settings("protocol = \"openfresco-adapter\"\naddress = \"h:44000\"").unwrap();
        assert!(found.greeting.hello && !found.greeting.endian);
        assert_eq!(found.ctrl, Counts::new(2, 0, 0, 0, 0));
        assert_eq!(found.daq, Counts::new(2, 0, 0, 2, 0));
        let found = settings("protocol = \"openfresco-shadow\"\naddress = \"h:8091\"").unwrap();
        assert_eq!((found.peer, found.version), (Peer::Actor, 2.8));
        let own: LinkSpec = toml::from_str("address = \"h:4823\"").unwrap();
        assert_eq!(RemoteSettings::from_spec(&own, 1), Ok(None));
    }

    #[test]
    fn every_key_arrives_and_nonsense_is_named() {
        let head =
            "protocol = \"openfresco\"\naddress = \"h:1\"\ntransport = \"udp\"\n[openfresco]\n";
        let all = "server = \"site\"\ndata_size = 9\nudp_hello = true\ncommand_signals = [2, 0, 0, 0, 0]\n\
                   answer_signals = [0, 0, 0, 2, 0]\n";
        let found = settings(&format!("{head}{all}")).unwrap();
        assert_eq!(found.peer, Peer::Site);
        assert_eq!((found.data_size, found.greeting.hello), (9, true));
        assert_eq!(found.carrier, Bytes::Datagrams);
        assert_eq!(found.daq, Counts::new(0, 0, 0, 2, 0));
        for (text, key) in [
            ("data_size = 70000", "data_size"),
            ("command_signals = [2, 0, 0, 0, 2]", "command_signals"),
            ("answer_signals = [5000, 0, 0, 0, 0]", "answer_signals"),
            ("answer_signals = [1, 0, 0, 2, 0]", "answer_signals"),
            ("answer_signals = [2, 0, 0, 3, 0]", "answer_signals"),
            ("command_signals = [4, 0, 0, 0, 0]", "command_signals"),
            ("version = nan", "version"),
        ] {
            let error = settings(&format!("{head}{text}")).unwrap_err();
            assert!(error.to_string().starts_with(key), "{error}");
        }
    }
}
