//! `[specimen.link.openfresco]` and `[serve.openfresco]`: settings that a connection cannot determine itself.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use gusset_wire::openfresco::{MAX_COUNT, MAX_DATA_SIZE, SignalOrder};

/// Settings that a connection by an OpenFresco protocol cannot determine itself. The defaults suit
/// the current programs. More: guide, opensees.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OpenFrescoSpec {
    /// Kind of server with "openfresco". A site server measures displacements. An element server
    /// gives matrices, but its displacements are always zero, so only its forces are used.
    #[schemars(example = &"site")]
    pub server: ServerKind,
    /// Number of values in each message. It grows if commands or answers need more. A smaller
    /// number is faster. Default: 256.
    #[schemars(example = 64)]
    pub data_size: Option<usize>,
    /// Whether a UDP connection begins with an exchange of two bytes, `a` and `b`. Default: no for
    /// application servers of OpenFresco 2.8, yes for its sites, OpenSees and OpenFresco 2.7.
    #[schemars(example = true)]
    pub udp_hello: Option<bool>,
    /// Numbers of displacements, velocities, accelerations, forces and times in a command. The last
    /// number is 0 or 1. Default: the numbers that the other end is known to accept.
    #[schemars(example = [1, 0, 0, 0, 0])]
    pub command_signals: Option<[usize; 5]>,
    /// Numbers of displacements, velocities, accelerations, forces and times in an answer. A first
    /// number above 0 declares measured displacements, as `gusset serve` has them and an element
    /// server of OpenFresco has not. Default: the known numbers; an element server gives forces
    /// only.
    #[schemars(example = [1, 1, 1, 1, 1])]
    pub answer_signals: Option<[usize; 5]>,
    /// Version number that both sites compare with "openfresco-shadow". Default: 2.8.
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
    #[schemars(example = &"10.0.0.5")]
    pub client: Option<String>,
    /// Time without a message after which a client counts as gone. Default: 60 s with UDP, none
    /// with TCP. With UDP, a new client on the same computer takes over a simulated specimen after
    /// 2 s.
    #[schemars(example = 30.0)]
    pub idle_timeout_s: Option<f64>,
    /// If true, the specimen is physical: a step that the client takes back ends the test, and the
    /// specimen keeps its position between clients.
    #[schemars(example = true)]
    pub physical: bool,
    /// Largest distance of later trials of a step from its first one, for a client that iterates. It
    /// is in m (or rad) at the client's scale. Only for a gateway and with `physical = true`.
    /// Default: a second, different target in a step ends the test.
    #[schemars(example = 0.0005)]
    pub iterates_within_m: Option<f64>,
    /// If true, a client that requests the tangent stiffness of a gateway gets one that follows the
    /// measurements. Default: false, it gets the estimate of the file.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub updates_tangent: bool,
    /// Test time of one step, for clients that send no time. Default: rate effects depend on the
    /// velocities only.
    #[schemars(example = 0.01)]
    pub step_s: Option<f64>,
    /// Order of the signals with "openfresco-simulink", as in the OpenFresco model. Required for
    /// several axes with several quantities, because OpenFresco does not send the order. Default:
    /// none; such a client is refused.
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
pub enum ServerKind {
    /// Element server: `startSimAppElemServer`, or `gusset serve` with `answer_signals`.
    #[default]
    Element,
    /// Site server: `startSimAppSiteServer`.
    Site,
}

impl OpenFrescoSpec {
    /// Keys outside their ranges for a specimen of `axes` axes: the key, the value, and what is allowed.
    #[must_use]
    pub(crate) fn out_of_range(&self, axes: usize) -> Vec<(&'static str, usize, &'static str)> {
        let mut wrong = Vec::new();
        if let Some(size) = self.data_size.filter(|n| !(1..=MAX_DATA_SIZE).contains(n)) {
            wrong.push(("data_size", size, "from 1 to 65536"));
        }
        for (key, given) in [
            ("command_signals", self.command_signals),
            ("answer_signals", self.answer_signals),
        ] {
            let Some([signals @ .., times]) = given else {
                continue;
            };
            let highest = signals.into_iter().max().unwrap_or(0);
            let odd = signals.into_iter().find(|&n| n != 0 && n != axes);
            if highest > MAX_COUNT || times > 1 {
                let allowed = "four numbers up to 4096 and a last one of 0 or 1";
                wrong.push((key, highest.max(times), allowed));
            } else if let Some(found) = odd {
                let allowed = "0 or the number of axes in each of its first four numbers";
                wrong.push((key, found, allowed));
            }
        }
        wrong
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_out_of_range_is_named() {
        let wrong = |text: &str| {
            let spec: OpenFrescoSpec = toml::from_str(text).unwrap();
            let wrong = spec.out_of_range(2).into_iter();
            wrong
                .map(|(key, found, _)| (key, found))
                .collect::<Vec<_>>()
        };
        for (text, expected) in [
            (
                "data_size = 65536\ncommand_signals = [2, 0, 0, 0, 1]",
                vec![],
            ),
            ("data_size = 70000", vec![("data_size", 70_000)]),
            ("data_size = 0", vec![("data_size", 0)]),
            (
                "command_signals = [2, 0, 0, 0, 2]",
                vec![("command_signals", 2)],
            ),
            (
                "answer_signals = [5000, 0, 0, 0, 0]",
                vec![("answer_signals", 5000)],
            ),
            (
                "answer_signals = [1, 0, 0, 2, 0]",
                vec![("answer_signals", 1)],
            ),
            (
                "answer_signals = [2, 0, 0, 3, 0]",
                vec![("answer_signals", 3)],
            ),
            (
                "command_signals = [4, 0, 0, 0, 0]",
                vec![("command_signals", 4)],
            ),
            (
                "data_size = 0\nanswer_signals = [0, 0, 0, 1, 0]",
                vec![("data_size", 0), ("answer_signals", 1)],
            ),
        ] {
            assert_eq!(wrong(text), expected, "{text}");
        }
    }
}
