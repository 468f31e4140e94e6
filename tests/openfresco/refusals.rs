//! Causes that end a test over OpenFresco's protocols, and others that must not: strangers, silence, nonsense, ends that vanish,
//! steps taken back. Nothing hangs, and the port is free again.

use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};

use crate::openfresco_ends::{LONG, Listen, Server, drive, in_process, path, settings};
use gusset_link::openfresco::{
    End, ExchangeFault, HostFault, Nature, Remote, RemoteSettings, Role, ServeSettings,
};
use gusset_link::server::ServerEvent;
use gusset_quantity::substructure::{Command, LinkFault, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_wire::openfresco::{Action, Carrier, Counts, Peer, Sizes};

#[test]
fn second_controller_is_refused_quietly() {
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        let server = Server::start(Role::Application, carrier, 1, Nature::Physical);
        let mut first = Remote::new(settings(Peer::Element, carrier, server.address, 1)).unwrap();
        first.open().unwrap();
        let before = drive(&mut first, 50);
        let mut second = Remote::new(RemoteSettings {
            connect_limit_s: 0.3,
            ..settings(Peer::Element, carrier, server.address, 1)
        })
        .unwrap();
        let refused = second.open().unwrap_err().to_string();
        assert!(
            refused.contains("closed") || refused.contains("not answer"),
            "{refused}"
        );
        server.hears(|event| matches!(event, ServerEvent::TurnedAway(_)));
        assert_eq!(before, in_process(1, 50));
        let mut into = Measurement::zeros(1);
        let disp = [path(50, 0)];
        let command = Command {
            sequence: 50,
            time: 0.5,
            dt: 0.01,
            disp: &disp,
            vel: &[0.0],
        };
        first.issue(&command).unwrap();
        first.collect(Nanos(0), &mut into).unwrap();
        assert_eq!(into.force, in_process(1, 51)[50].1);
        first.retire(Retirement::Orderly);
        assert_eq!(server.end(), End::Finished);
    }
}

/// A vector of two doubles.
fn vector(first: f64, second: f64) -> Vec<u8> {
    [first, second].map(f64::to_le_bytes).concat()
}

/// OpenSees spins for ever where its connection is closed.
#[test]
fn second_tcp_client_waits_for_the_first() {
    let server = Server::start(Role::Application, Carrier::Stream, 1, Nature::Simulated);
    let with = || settings(Peer::Element, Carrier::Stream, server.address, 1);
    let mut first = Remote::new(with()).unwrap();
    first.open().unwrap();
    let mut second = TcpStream::connect(server.address).unwrap();
    second.set_read_timeout(Some(LONG)).unwrap();
    let sizes = [1_i32, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2];
    let sizes: Vec<u8> = sizes.into_iter().flat_map(i32::to_le_bytes).collect();
    second.write_all(&sizes).unwrap();
    second.write_all(&vector(3.0, 0.005)).unwrap();
    second.write_all(&vector(10.0, 0.0)).unwrap();
    // Long enough for a look at the port.
    gusset_session::pause(std::time::Duration::from_millis(300));
    assert_eq!(drive(&mut first, 50), in_process(1, 50));
    first.retire(Retirement::Orderly);
    let mut answer = [0; 16];
    second.read_exact(&mut answer).unwrap();
    assert_eq!(answer[..8], 40.0_f64.to_le_bytes());
    second.write_all(&vector(99.0, 0.0)).unwrap();
    for _ in 0..2 {
        assert_eq!(server.end(), End::Finished);
    }
}

/// A client that was killed says no goodbye over UDP, and the next one of its machine must not wait for a minute.
#[test]
fn new_udp_client_replaces_a_silent_one() {
    for nature in [Nature::Simulated, Nature::Physical] {
        for hello in [true, false] {
            let serve = ServeSettings {
                takeover_s: 0.2,
                ..ServeSettings::new(Role::Application, Some(30.0))
            };
            let server = Server::with(serve, Carrier::Datagrams, 1, nature);
            let mut with = settings(Peer::Element, Carrier::Datagrams, server.address, 1);
            with.greeting.hello = hello;
            let mut killed = Remote::new(with.clone()).unwrap();
            killed.open().unwrap();
            drive(&mut killed, 5);
            drop(killed);
            if nature == Nature::Physical {
                with.connect_limit_s = 1.0;
            }
            let mut next = Remote::new(with).unwrap();
            let opened = next.open();
            match nature {
                Nature::Simulated => {
                    opened.unwrap();
                    assert_eq!(server.end(), End::Replaced(0.2));
                    assert_eq!(drive(&mut next, 50), in_process(1, 50));
                    next.retire(Retirement::Orderly);
                    assert_eq!(server.end(), End::Finished);
                }
                Nature::Physical => {
                    opened.unwrap_err();
                    server.hears(|event| matches!(event, ServerEvent::TurnedAway(_)));
                }
            }
        }
    }
}

#[test]
fn a_client_that_vanishes_frees_the_port() {
    let server = Server::start(Role::Application, Carrier::Stream, 1, Nature::Simulated);
    for _ in 0..2 {
        let mut remote =
            Remote::new(settings(Peer::Element, Carrier::Stream, server.address, 1)).unwrap();
        remote.open().unwrap();
        drive(&mut remote, 5);
        drop(remote);
        assert_eq!(server.end(), End::Vanished);
    }
    let silent = ServeSettings {
        idle_limit_s: Some(0.2),
        ..ServeSettings::new(Role::Application, None)
    };
    let server = Server::with(silent, Carrier::Datagrams, 1, Nature::Simulated);
    let mut remote = Remote::new(settings(
        Peer::Element,
        Carrier::Datagrams,
        server.address,
        1,
    ))
    .unwrap();
    remote.open().unwrap();
    drop(remote);
    assert_eq!(server.end(), End::Silent(0.2));
}

#[test]
fn vanished_server_is_a_fault_and_no_hang() {
    let server = Server::start(Role::Application, Carrier::Stream, 1, Nature::Simulated);
    let mut remote =
        Remote::new(settings(Peer::Element, Carrier::Stream, server.address, 1)).unwrap();
    remote.open().unwrap();
    drive(&mut remote, 5);
    drop(server);
    let command = Command {
        sequence: 5,
        time: 0.05,
        dt: 0.01,
        disp: &[0.0],
        vel: &[0.0],
    };
    let mut into = Measurement::zeros(1);
    let lost = remote
        .issue(&command)
        .and_then(|()| remote.collect(Nanos(0), &mut into).map(|_| ()));
    assert_eq!(lost, Err(LinkFault::Closed));
    remote.retire(Retirement::Tripped);

    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let deaf = socket.local_addr().unwrap();
    let mut remote = Remote::new(RemoteSettings {
        connect_limit_s: 0.1,
        ..settings(Peer::Site, Carrier::Datagrams, deaf, 1)
    })
    .unwrap();
    let asked = remote.open().unwrap_err();
    assert_eq!(asked.fault(), LinkFault::Timeout, "{asked}");
    let mut remote = Remote::new(RemoteSettings {
        reply_limit_s: 0.1,
        // Without a displacement there is nothing to query before the first command.
        daq: Counts::new(0, 0, 0, 1, 0),
        ..settings(Peer::Site, Carrier::Datagrams, deaf, 1)
    })
    .unwrap();
    remote.open().unwrap();
    remote.issue(&command).unwrap();
    assert_eq!(remote.collect(Nanos(0), &mut into), Err(LinkFault::Timeout));
    assert_eq!(remote.issue(&command), Err(LinkFault::Timeout), "final");
}

#[test]
fn step_taken_back_ends_physical_tests_only() {
    for nature in [Nature::Simulated, Nature::Physical] {
        let server = Server::start(Role::Application, Carrier::Stream, 1, nature);
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.set_read_timeout(Some(LONG)).unwrap();
        let n = 5;
        let mut sizes = [0; 44];
        let counts = (Counts::new(1, 1, 1, 0, 1), Counts::new(0, 0, 0, 1, 0));
        Sizes::new(counts.0, counts.1, n)
            .unwrap()
            .write(&mut sizes)
            .unwrap();
        stream.write_all(&sizes).unwrap();
        let mut say = |action: Action, disp: f64, time: f64| {
            let mut vector = vec![0; 8 * n];
            let mut codes = (0..100).map(f64::from);
            let code = codes.find(|code| Action::whole(*code) == Ok(Some(action)));
            vector[..8].copy_from_slice(&code.unwrap().to_le_bytes());
            vector[8..16].copy_from_slice(&disp.to_le_bytes());
            vector[32..40].copy_from_slice(&time.to_le_bytes());
            stream.write_all(&vector).unwrap();
        };
        say(Action::Trial, 0.0, 0.0);
        say(Action::Trial, 0.004, 0.01);
        say(Action::Commit, 0.004, 0.01);
        say(Action::Trial, 0.5, 0.02);
        say(Action::Trial, 0.004, 0.01);
        say(
            Action::Read(gusset_wire::openfresco::Reading::Force),
            0.0,
            0.0,
        );
        let mut answer = [0; 40];
        match nature {
            Nature::Simulated => {
                stream.read_exact(&mut answer).unwrap();
                let force = f64::from_le_bytes(answer[..8].try_into().unwrap());
                assert!((force - 32.0).abs() < 1e-12);
            }
            Nature::Physical => {
                let fault = ExchangeFault::Host(HostFault::TakenBack { time: 0.01 });
                assert_eq!(server.end(), End::Refused(fault));
            }
        }
    }
}

#[test]
fn garbage_is_named_and_frees_the_port() {
    let limits = ServeSettings {
        setup_limit_s: 0.2,
        ..ServeSettings::new(Role::Application, None)
    };
    let server = Server::with(limits, Carrier::Stream, 1, Nature::Simulated);
    let mut http = TcpStream::connect(server.address).unwrap();
    http.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\nUser-Agent: browser\r\n\r\n")
        .unwrap();
    assert!(matches!(server.end(), End::Refused(ExchangeFault::Wire(_))));
    let quiet = TcpStream::connect(server.address).unwrap();
    assert_eq!(server.end(), End::NoSizes(0.2));
    drop(quiet);
    let mut wrong = TcpStream::connect(server.address).unwrap();
    let mut sizes = [0; 44];
    let two = Sizes::new(Counts::new(2, 2, 2, 0, 1), Counts::new(0, 0, 0, 2, 0), 256).unwrap();
    two.write(&mut sizes).unwrap();
    wrong.write_all(&sizes).unwrap();
    assert!(matches!(server.end(), End::Refused(ExchangeFault::Wire(_))));

    let server = Server::with(limits, Carrier::Datagrams, 1, Nature::Simulated);
    let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
    stranger.send_to(&[7; 300], server.address).unwrap();
    server.hears(|event| matches!(event, ServerEvent::Stray(_, 300)));
    let mut remote = Remote::new(settings(
        Peer::Element,
        Carrier::Datagrams,
        server.address,
        1,
    ))
    .unwrap();
    remote.open().unwrap();
    assert_eq!(drive(&mut remote, 10), in_process(1, 10));
}

#[test]
fn only_the_named_machine_is_served() {
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        let limits = ServeSettings::new(Role::Application, None);
        let open = Listen::at(carrier, "0.0.0.0:0").bind(limits, 1, Nature::Simulated);
        let open = open.unwrap_err();
        assert!(open.to_string().contains("--client"), "{open}");
        let other = "192.0.2.7".parse().unwrap();
        let listen = Listen::at(carrier, "127.0.0.1:0").only(other);
        let server = listen.serve(limits, 1, Nature::Simulated);
        let mut remote = Remote::new(RemoteSettings {
            connect_limit_s: 0.3,
            ..settings(Peer::Element, carrier, server.address, 1)
        })
        .unwrap();
        remote.open().unwrap_err();
        server.hears(|event| matches!(event, ServerEvent::NotAdmitted(_)));
    }
}
