//! `[specimen.link.openfresco]`: settings that a connection cannot determine itself.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Peer, RemoteError, RemoteSettings};
use crate::link::Wait;
use crate::link::spec::{Carrier, LinkSpec, Protocol};
use crate::wire::openfresco::{Carrier as Bytes, Counts, MAX_COUNT, MAX_DATA_SIZE, SignalOrder};

/// Settings that a connection by an OpenFresco protocol cannot determine itself. The defaults suit
/// the current programs. More: guide, opensees.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpenFrescoSpec {
    /// Kind of server with "openfresco". A site server measures displacements. An element server
    /// gives matrices, but its displacements are always zero, so only its forces are used.
    #[schemars(example = &"site")]
    pub server: Far,
    /// Number of values in each message. It grows if commands or answers need more. A smaller
    /// number is faster. Default: 256.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 64)]
    pub data_size: Option<usize>,
    /// Whether a UDP connection begins with an exchange of two bytes, `a` and `b`. Default: no for
    /// application servers of OpenFresco 2.8, yes for its sites, OpenSees and OpenFresco 2.7.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = true)]
    pub udp_hello: Option<bool>,
    /// Numbers of displacements, velocities, accelerations, forces and times in a command. The last
    /// number is 0 or 1. Default: the numbers that the other end is known to accept.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [1, 0, 0, 0, 0])]
    pub command_signals: Option<[usize; 5]>,
    /// Numbers of displacements, velocities, accelerations, forces and times in an answer. A first
    /// number above 0 declares measured displacements, as `gusset serve` has them and an element
    /// server of OpenFresco has not. Default: the known numbers; an element server gives forces
    /// only.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = [1, 1, 1, 1, 1])]
    pub answer_signals: Option<[usize; 5]>,
    /// Version number that both sites compare with "openfresco-shadow". Default: 2.8.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 2.7)]
    pub version: Option<f64>,
    /// Site tag of this controller with "openfresco-shadow".
    #[schemars(range(max = u32::MAX))]
    #[schemars(example = 1)]
    pub site: u32,
}

/// Settings of `gusset serve` for OpenFresco protocols. More: guide, opensees.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpenFrescoServeSpec {
    /// Name or address of the only computer that may command the specimen. Required beyond
    /// loopback, unless TLS requires certificates, because these protocols have no key.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"10.0.0.5")]
    pub client: Option<String>,
    /// Time without a message after which a client counts as gone. Default: 60 s with UDP, none
    /// with TCP. With UDP, a new client on the same computer takes over a simulated specimen after
    /// 2 s.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 30.0)]
    pub idle_timeout_s: Option<f64>,
    /// If true, the specimen is physical: a step that the client takes back ends the test, and the
    /// specimen keeps its position between clients.
    #[schemars(example = true)]
    pub physical: bool,
    /// Test time of one step, for clients that send no time. Default: rate effects depend on the
    /// velocities only.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.01)]
    pub step_s: Option<f64>,
    /// Order of the signals with "openfresco-simulink", as in the OpenFresco model. Required for
    /// several axes with several quantities, because OpenFresco does not send the order. Default:
    /// none; such a client is refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"by_quantity")]
    pub signal_order: Option<SignalOrderSpec>,
}

/// Order of the signals of `SimSimulink`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SignalOrderSpec {
    /// All quantities of one axis (displacement, velocity, acceleration, force), then those of the
    /// next axis. A client that uses the time is refused.
    ByAxis,
    /// One quantity of all axes, then the next quantity. The time is last.
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

/// Kind of server with "openfresco".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Far {
    /// Element server: `startSimAppElemServer`, or `gusset serve` with `answer_signals`.
    #[default]
    Element,
    /// Site server: `startSimAppSiteServer`.
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
