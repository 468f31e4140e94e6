//! Our two ends of OpenFresco's dialects over real sockets: dialects A, B and the controller of D behave as one specimen. The
//! messages of the real programs are in tests/captures and, live, in the tests with OpenSees; dialects B and D were not run against
//! the real program here.

use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::time::Duration;

use crate::openfresco_ends::{LONG, Listen, Server, drive, in_process, path, settings};
use gusset_link::openfresco::{End, Nature, Remote, RemoteSettings, Role, ServeSettings};
use gusset_quantity::substructure::{Command, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_wire::openfresco::{Action, Carrier, Counts, Peer, Sizes, UdpGreeting};

#[test]
fn every_dialect_gives_the_in_process_bits() {
    for (role, peer) in [
        (Role::Application, Peer::Element),
        (Role::Application, Peer::Site),
        (Role::Actor, Peer::Actor),
    ] {
        for carrier in [Carrier::Stream, Carrier::Datagrams] {
            for axes in [1, 3] {
                let server = Server::start(role, carrier, axes, Nature::Simulated);
                // Twice: the port is offered again, and the specimen is virgin again.
                for _ in 0..2 {
                    let mut remote =
                        Remote::new(settings(peer, carrier, server.address, axes)).unwrap();
                    remote.open().unwrap();
                    if peer == Peer::Element {
                        let k = remote.initial_stiffness().unwrap();
                        assert!((0..axes).all(|i| k[i * axes + i] == 8000.0));
                    }
                    assert_eq!(drive(&mut remote, 200), in_process(axes, 200));
                    remote.retire(Retirement::Orderly);
                    assert_eq!(server.end(), End::Finished, "{role:?} {carrier:?}");
                }
            }
        }
    }
}

#[test]
fn server_is_queried_an_actor_warned_about() {
    for (role, peer) in [
        (Role::Application, Peer::Element),
        (Role::Application, Peer::Site),
        (Role::Actor, Peer::Actor),
    ] {
        let server = Server::start(role, Carrier::Stream, 2, Nature::Physical);
        let mut with = settings(peer, Carrier::Stream, server.address, 2);
        if peer == Peer::Element {
            with.daq = Counts::new(2, 2, 2, 2, 1);
        }
        let mut left = [0.0; 2];
        for _ in 0..2 {
            let mut remote = Remote::new(with.clone()).unwrap();
            let introduction = remote.connect().unwrap();
            if peer == Peer::Actor {
                assert!(introduction.standing.is_empty());
                assert!(introduction.warnings[0].contains("tell where"));
            } else {
                assert_eq!(introduction.standing, left);
                assert!(introduction.measured && introduction.warnings.is_empty());
            }
            drive(&mut remote, 20);
            remote.retire(Retirement::Orderly);
            assert_eq!(server.end(), End::Finished);
            left = [path(19, 0), path(19, 1)];
        }
    }
}

/// The first hello comes back; nothing of that may be left when the test runs.
#[test]
#[expect(
    clippy::disallowed_methods,
    reason = "the other thread says hello meanwhile"
)]
fn late_udp_server_is_driven_normally() {
    for (role, peer) in [
        (Role::Application, Peer::Element),
        (Role::Actor, Peer::Actor),
    ] {
        let gone = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = gone.local_addr().unwrap();
        drop(gone);
        let with = RemoteSettings {
            greeting: UdpGreeting {
                hello: true,
                endian: false,
            },
            ..settings(peer, Carrier::Datagrams, address, 1)
        };
        let test = std::thread::spawn(move || {
            let mut remote = Remote::new(with).unwrap();
            remote.open().unwrap();
            assert_eq!(drive(&mut remote, 200), in_process(1, 200));
            remote.retire(Retirement::Orderly);
        });
        std::thread::sleep(Duration::from_millis(100));
        let server = Listen::at(Carrier::Datagrams, &address.to_string()).serve(
            ServeSettings::new(role, Some(30.0)),
            1,
            Nature::Simulated,
        );
        test.join().unwrap();
        assert_eq!(server.end(), End::Finished, "{role:?}");
    }
}

#[test]
fn the_old_udp_greetings_work_too() {
    let old = UdpGreeting {
        hello: true,
        endian: true,
    };
    let server = Server::start(Role::Actor, Carrier::Datagrams, 1, Nature::Simulated);
    let mut remote = Remote::new(RemoteSettings {
        greeting: old,
        ..settings(Peer::Actor, Carrier::Datagrams, server.address, 1)
    })
    .unwrap();
    remote.open().unwrap();
    assert_eq!(drive(&mut remote, 20), in_process(1, 20));
}

#[test]
fn exchange_allocates_nothing_on_our_side() {
    for (role, peer) in [
        (Role::Application, Peer::Element),
        (Role::Actor, Peer::Actor),
    ] {
        for carrier in [Carrier::Stream, Carrier::Datagrams] {
            let server = Server::start(role, carrier, 1, Nature::Simulated);
            let mut remote = Remote::new(settings(peer, carrier, server.address, 1)).unwrap();
            remote.open().unwrap();
            let mut into = Measurement::zeros(1);
            let count = allocation_counter::measure(|| {
                for k in 0..100 {
                    let command = Command {
                        sequence: k,
                        time: 0.01 * k as f64,
                        dt: 0.01,
                        disp: &[path(k, 0)],
                        vel: &[0.0],
                    };
                    remote.issue(&command).unwrap();
                    remote.collect(Nanos(0), &mut into).unwrap();
                    remote.accepted(k).unwrap();
                }
            });
            assert_eq!(count.count_total, 0);
        }
    }
}

/// The other ends of dialect D are OpenFresco's controls; this test gives their course in the protocol's own terms.
#[test]
fn our_controllers_follow_the_real_ones() {
    let counts = (Counts::new(1, 0, 0, 0, 0), Counts::new(1, 0, 0, 1, 0));
    let n = 256;
    for role in [Role::Controller, Role::Simulink] {
        let server = Server::start(role, Carrier::Stream, 1, Nature::Simulated);
        let mut stream = TcpStream::connect(server.address).unwrap();
        stream.set_read_timeout(Some(LONG)).unwrap();
        stream.set_nodelay(true).unwrap();
        let mut sizes = [0; 44];
        Sizes::new(counts.0, counts.1, n)
            .unwrap()
            .write(&mut sizes)
            .unwrap();
        stream.write_all(&sizes).unwrap();
        let mut say = |action: Action, disp: f64, answered: bool| {
            let mut vector = vec![0; 8 * n];
            // Some codes have a tenth.
            let mut codes = (10..1000).map(|tenths| f64::from(tenths) / 10.0);
            let code = codes.find(|code| Action::exact(*code) == Ok(Some(action)));
            vector[..8].copy_from_slice(&code.unwrap().to_le_bytes());
            vector[8..16].copy_from_slice(&disp.to_le_bytes());
            stream.write_all(&vector).unwrap();
            let mut answer = vec![0; 8 * n];
            if answered {
                stream.read_exact(&mut answer).unwrap();
            }
            [0, 8, 16].map(|at| f64::from_le_bytes(answer[at..at + 8].try_into().unwrap()))
        };
        let all = Action::Read(gusset_wire::openfresco::Reading::All);
        let expected = in_process(1, 50);
        for (k, (disp, force)) in expected.iter().enumerate() {
            let target = path(k as u64, 0);
            say(Action::Trial, target, false);
            match role {
                Role::Simulink => {
                    assert_eq!(say(Action::TargetTaken, 0.0, true)[0], 1.0);
                    say(Action::TargetDone, 0.0, false);
                    assert_eq!(say(Action::SwitchedBack, 0.0, true)[0], 0.0);
                    assert_eq!(say(all, 0.0, true), [1.0, disp[0], force[0]]);
                    say(Action::Commit, 0.0, false);
                }
                _ => assert_eq!(say(all, 0.0, true)[..2], [disp[0], force[0]]),
            }
        }
        say(Action::Die, 0.0, false);
        assert_eq!(server.end(), End::Finished);
    }
}
