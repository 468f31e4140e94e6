//! OpenFresco's protocols over TLS: accepted clients, messages when plain and TLS meet, and forbidden settings.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;

use crate::openfresco_ends::{Listen, Server, drive, in_process, settings};
use crate::tls_common::{Authority, EXPIRED, LOCAL, VALID};
use gusset_config::{ServeTlsSpec, TlsSpec};
use gusset_link::openfresco::{End, Nature, Remote, RemoteSettings, Role, ServeSettings};
use gusset_link::server::ServerEvent;
use gusset_link::tls::{TlsClient, TlsFault, TlsFiles, TlsServer};
use gusset_quantity::substructure::{Command, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_wire::openfresco::{Carrier, Peer};

fn client(folder: &Path) -> TlsClient {
    TlsClient::new(
        &TlsFiles::of_client(&TlsSpec::default(), folder),
        None,
        true,
    )
    .unwrap()
}

fn server(folder: &Path, required: bool) -> Server {
    let tls = TlsServer::new(
        &TlsFiles::of_server(&ServeTlsSpec::default(), folder),
        required,
    )
    .unwrap();
    let limits = ServeSettings {
        setup_limit_s: 0.5,
        ..ServeSettings::new(Role::Application, Some(30.0))
    };
    Listen::tls("127.0.0.1:0", tls).serve(limits, 1, Nature::Simulated)
}

fn remote(peer: Peer, server: &Server, tls: Option<TlsClient>) -> Remote {
    Remote::new(RemoteSettings {
        tls,
        connect_limit_s: 5.0,
        reply_limit_s: 5.0,
        ..settings(peer, Carrier::Stream, server.address, 1)
    })
    .unwrap()
}

/// Runs everything up to the first answer; returns the error.
fn failure(mut remote: Remote) -> String {
    if let Err(error) = remote.open() {
        return error.to_string();
    }
    let command = Command {
        sequence: 0,
        time: 0.0,
        dt: 0.01,
        disp: &[0.0],
        vel: &[0.0],
    };
    let mut into = Measurement::zeros(1);
    let lost = remote
        .issue(&command)
        .and_then(|()| remote.collect(Nanos(0), &mut into).map(|_| ()));
    assert!(lost.is_err());
    remote.complaint().unwrap()
}

#[test]
fn plain_and_tls_report_it_at_both_ends() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    // The loop queries an element server during setup, a site server with the first command.
    for peer in [Peer::Element, Peer::Site] {
        let secure = server(folder, true);
        let said = failure(remote(peer, &secure, None));
        assert!(said.contains("`transport = \"tls\"`"), "{said}");
        assert_eq!(secure.end(), End::Tls(TlsFault::NotTls));

        let plain = Server::start(Role::Application, Carrier::Stream, 1, Nature::Simulated);
        let said = failure(remote(peer, &plain, Some(client(folder))));
        assert!(said.contains("speak TLS"), "{said}");
        assert_eq!(plain.end(), End::SpeaksTls);
        // The port is free again, and the specimen was not touched.
        let mut good = remote(peer, &plain, None);
        good.open().unwrap();
        assert_eq!(drive(&mut good, 20), in_process(1, 20));
    }
}

#[test]
fn unsuitable_certificate_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let authority = crate::tls_common::make(folder);
    // A client need not send a certificate, but a certificate that is sent must be valid.
    for required in [true, false] {
        let here = server(folder, required);
        authority.issue(folder, "client", &["controller"], EXPIRED);
        for peer in [Peer::Element, Peer::Site] {
            let said = failure(remote(peer, &here, Some(client(folder))));
            assert!(said.contains("has expired"), "{said}");
            assert!(matches!(here.end(), End::Tls(TlsFault::Expired(_))));
        }
        Authority::named("elsewhere").issue(folder, "client", &["controller"], VALID);
        let said = failure(remote(Peer::Site, &here, Some(client(folder))));
        assert!(said.contains("an authority"), "{said}");
        assert_eq!(here.end(), End::Tls(TlsFault::UnknownAuthority));
        authority.issue(folder, "client", &["controller"], VALID);
        let mut good = remote(Peer::Site, &here, Some(client(folder)));
        good.open().unwrap();
        assert_eq!(drive(&mut good, 20), in_process(1, 20));
    }
    authority.issue(folder, "server", LOCAL, EXPIRED);
    let here = server(folder, true);
    let said = failure(remote(Peer::Element, &here, Some(client(folder))));
    assert!(said.contains("2003-01-01"), "{said}");
    assert!(matches!(here.end(), End::Tls(TlsFault::RefusedUs(_))));
}

#[test]
fn stalled_handshake_frees_the_port() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let here = server(folder, true);
    let stall = || {
        let mut half = TcpStream::connect(here.address).unwrap();
        half.write_all(&[22, 3, 1, 2, 0, 1]).unwrap();
        here.hears(|event| matches!(event, ServerEvent::Connected(_)));
        half
    };
    let alone = stall();
    assert_eq!(here.end(), End::Tls(TlsFault::SlowHandshake));
    drop(alone);
    // Nor does it keep other clients out in the meantime.
    let mut half = stall();
    let mut good = remote(Peer::Element, &here, Some(client(folder)));
    good.open().unwrap();
    assert_eq!(drive(&mut good, 20), in_process(1, 20));
    // The other client waits until the first leaves. Then its handshake comes too late.
    good.retire(Retirement::Orderly);
    drop(good);
    let _how = half.read_to_end(&mut Vec::new());
}

#[test]
fn certificates_required_beyond_loopback() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let files = TlsFiles::of_server(&ServeTlsSpec::default(), folder);
    let lenient = || TlsServer::new(&files, false).unwrap();
    let bind = |listen: Listen| {
        let limits = ServeSettings::new(Role::Application, Some(30.0));
        listen.bind(limits, 1, Nature::Simulated)
    };
    let refused = bind(Listen::tls("0.0.0.0:0", lenient())).unwrap_err();
    assert!(
        refused.to_string().contains("require certificates"),
        "{refused}"
    );
    let strict = TlsServer::new(&files, true).unwrap();
    bind(Listen::tls("0.0.0.0:0", strict)).unwrap();
    let named = Listen::tls("0.0.0.0:0", lenient()).only([192, 0, 2, 7].into());
    bind(named).unwrap();
}
