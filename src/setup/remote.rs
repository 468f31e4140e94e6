//! From `[specimen.link]` to the settings of a client of OpenFresco and OpenSees.

use gusset_config::{Carrier, LinkSpec};
use gusset_link::Wait;
use gusset_link::openfresco::RemoteSettings;
use gusset_wire::openfresco::Carrier as Bytes;

/// The settings for a specimen of `axes` axes; none if its link has the protocol of Gusset. The check of the file has found every
/// number in its range.
pub(super) fn remote_settings(link: &LinkSpec, axes: usize) -> Option<RemoteSettings> {
    let (ctrl, daq) = link.signals(axes)?;
    let carrier = match link.transport {
        Carrier::Tcp | Carrier::Tls => Bytes::Stream,
        Carrier::Udp => Bytes::Datagrams,
    };
    let more = link.openfresco.clone().unwrap_or_default();
    let usual = RemoteSettings::new(link.peer()?, carrier, link.address.clone(), axes);
    let mut greeting = usual.greeting;
    greeting.hello = more.udp_hello.unwrap_or(greeting.hello);
    Some(RemoteSettings {
        ctrl,
        daq,
        data_size: more.data_size.unwrap_or(usual.data_size),
        greeting,
        version: more.version.unwrap_or(usual.version),
        site: f64::from(more.site),
        connect_limit_s: link.connect_timeout_s,
        reply_limit_s: link.reply_timeout_s,
        wait: Wait {
            spin_first_ns: (link.spin_us * 1e3) as u64,
            spin_last_ns: 0,
        },
        ..usual
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_wire::openfresco::{Counts, Peer, UdpGreeting};

    fn settings(text: &str) -> RemoteSettings {
        let spec: LinkSpec = toml::from_str(text).unwrap();
        remote_settings(&spec, 2).unwrap()
    }

    #[test]
    fn defaults_suit_the_current_programs() {
        let found = settings("protocol = \"openfresco\"\naddress = \"h:8090\"");
        assert_eq!(found.peer, Peer::Element);
        assert_eq!(found.greeting, UdpGreeting::NONE);
        let found = settings("protocol = \"openfresco-adapter\"\naddress = \"h:44000\"");
        assert!(found.greeting.hello && !found.greeting.endian);
        assert_eq!(found.ctrl, Counts::new(2, 0, 0, 0, 0));
        assert_eq!(found.daq, Counts::new(2, 0, 0, 2, 0));
        let found = settings("protocol = \"openfresco-shadow\"\naddress = \"h:8091\"");
        assert_eq!((found.peer, found.version), (Peer::Actor, 2.8));
        let own: LinkSpec = toml::from_str("address = \"h:4823\"").unwrap();
        assert_eq!(remote_settings(&own, 1), None);
    }

    #[test]
    fn every_key_arrives() {
        let head =
            "protocol = \"openfresco\"\naddress = \"h:1\"\ntransport = \"udp\"\n[openfresco]\n";
        let all = "server = \"site\"\ndata_size = 9\nudp_hello = true\ncommand_signals = [2, 0, 0, 0, 0]\n\
                   answer_signals = [0, 0, 0, 2, 0]\n";
        let found = settings(&format!("{head}{all}"));
        assert_eq!(found.peer, Peer::Site);
        assert_eq!((found.data_size, found.greeting.hello), (9, true));
        assert_eq!(found.carrier, Bytes::Datagrams);
        assert_eq!(found.daq, Counts::new(0, 0, 0, 2, 0));
    }
}
