//! Over TLS a hybrid test is the same test, to the last bit: our own protocol and OpenFresco's, one test after another.

use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, Served, TWO_AXES, TWO_AXES_LAW, columns, gateway, linked, run, summary,
    test_file,
};
use crate::openfresco_ends::{Listen, drive, in_process, settings};
use gusset_config::{ServeTlsSpec, TlsSpec};
use gusset_link::openfresco::{End, Nature, Remote, RemoteSettings, Role, ServeSettings};
use gusset_link::tls::{TlsClient, TlsFiles, TlsServer};
use gusset_quantity::substructure::{Retirement, Substructure};
use gusset_wire::openfresco::{Carrier, Peer};

const STEPS: u32 = 600;

fn is_the_same(seen: &str, law: &str, protocol: &str, address: &dyn Fn(&str) -> String) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let local = test_file(STEPS, &format!("{seen}{law}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let served = Served::start(
        folder,
        &local,
        &["--transport", "tls", "--protocol", protocol],
    );
    for name in ["first", "second"] {
        let at = address(&served.address);
        let link = format!(
            "[specimen.link]\naddress = \"{at}\"\nprotocol = \"{protocol}\"\ntransport = \"tls\"\n"
        );
        let (code, said) = run(folder, name, &test_file(STEPS, &format!("{seen}{link}")));
        assert_eq!(code, 0, "{said}");
        assert_eq!(columns(folder, "local", ""), columns(folder, name, ""));
        let link = summary(folder, name).link["column"];
        assert_eq!(link.sent, u64::from(STEPS) + 1 + 5);
        assert_eq!((link.received, link.lost, link.corrupt), (link.sent, 0, 0));
        served.hears(match protocol {
            "gusset" => "retired at the end of the test",
            _ => "the client ended the test",
        });
        let resolved = std::fs::read_to_string(folder.join(name).join("resolved.toml")).unwrap();
        let key = folder.join("client.key").display().to_string();
        assert!(resolved.contains(&key), "named from anywhere: {resolved}");
        assert!(!folder.join(name).join("inputs/client.key").exists());
    }
}

#[test]
fn native_protocol_over_tls_keeps_the_bits() {
    is_the_same(ONE_AXIS, ONE_AXIS_LAW, "gusset", &str::to_owned);
    // By name, and with more than one axis.
    is_the_same(TWO_AXES, TWO_AXES_LAW, "gusset", &|address| {
        address.replace("127.0.0.1", "localhost")
    });
}

#[test]
fn openfresco_over_tls_keeps_the_bits() {
    is_the_same(ONE_AXIS, ONE_AXIS_LAW, "openfresco", &str::to_owned);
}

/// OpenFresco's protocol to the specimen, ours to the test, TLS on both: one authority for three ends.
#[test]
fn gateway_between_two_tls_links_keeps_bits() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let over_tls = ["--transport", "tls"];
    let openfresco = ["--protocol", "openfresco"];
    let specimen = Served::start(folder, &local, &[over_tls, openfresco].concat());
    let keys = "protocol = \"openfresco\"\ntransport = \"tls\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }";
    let between = gateway(&specimen.address, "stiffness_n_per_m = 4e5\n", keys);
    let between = Served::start(folder, &between, &over_tls);
    for name in ["first", "second"] {
        let text = linked(STEPS, &between.address, "transport = \"tls\"");
        let (code, said) = run(folder, name, &text);
        assert_eq!(code, 0, "{said}");
        assert_eq!(columns(folder, "local", ""), columns(folder, name, ""));
        between.hears("retired at the end of the test");
    }
}

#[test]
fn every_dialect_keeps_the_bits_over_tls() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let client = TlsClient::new(
        &TlsFiles::of_client(&TlsSpec::default(), folder),
        None,
        true,
    )
    .unwrap();
    let files = TlsFiles::of_server(&ServeTlsSpec::default(), folder);
    for required in [true, false] {
        let tls = TlsServer::new(&files, required).unwrap();
        for (role, peer) in [
            (Role::Application, Peer::Element),
            (Role::Application, Peer::Site),
            (Role::Actor, Peer::Actor),
        ] {
            let limits = ServeSettings::new(role, Some(30.0));
            let listen = Listen::tls("127.0.0.1:0", tls.clone());
            let server = listen.serve(limits, 3, Nature::Simulated);
            for data_size in [2, 4096] {
                let mut remote = Remote::new(RemoteSettings {
                    tls: Some(client.clone()),
                    data_size,
                    ..settings(peer, Carrier::Stream, server.address, 3)
                })
                .unwrap();
                remote.open().unwrap();
                assert_eq!(drive(&mut remote, 50), in_process(3, 50));
                remote.retire(Retirement::Orderly);
                assert_eq!(server.end(), End::Finished, "{role:?}");
            }
        }
    }
}
