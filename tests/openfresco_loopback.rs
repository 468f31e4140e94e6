//! Our two ends of OpenFresco's dialects, joined by real sockets: dialect A, B and the controller of D behave as one
//! and the same specimen. What the real programs say to them is in tests/captures and, live, in the tests with
//! OpenSees; dialects B and D were not run against the real program here.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use gusset::link::openfresco::{
    Door, End, ExchangeFault, Host, HostFault, Nature, News, Peer, Remote, RemoteSettings, Role,
    ServeSettings, serve_openfresco,
};
use gusset::specimen::SpecimenLaw;
use gusset::substructure::{Command, LinkFault, Measurement, Retirement, Substructure};
use gusset::time::Nanos;
use gusset::wire::openfresco::{Action, Carrier, Counts, Sizes, UdpGreeting, write_action};

const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
/// Nothing here takes longer unless it hangs.
const LONG: Duration = Duration::from_secs(20);

struct Server {
    address: SocketAddr,
    news: Receiver<News>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    fn start(role: Role, carrier: Carrier, axes: usize, nature: Nature) -> Self {
        let settings = ServeSettings::new(role, Some(30.0));
        Self::with(settings, carrier, axes, nature)
    }

    fn with(settings: ServeSettings, carrier: Carrier, axes: usize, nature: Nature) -> Self {
        let door = Door::bind(carrier, "127.0.0.1:0", None).unwrap();
        Self::behind(door, settings, axes, nature)
    }

    fn behind(door: Door, settings: ServeSettings, axes: usize, nature: Nature) -> Self {
        let address = door.local_addr().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let (tell, news) = channel();
        let told = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
            let mut host = Host::new(law.build(axes).unwrap(), nature, Some(0.01));
            let stop = || told.load(Ordering::Relaxed);
            serve_openfresco(&door, &mut host, &settings, &stop, &mut |news| {
                let _ = tell.send(*news);
            })
            .unwrap();
        });
        Self {
            address,
            news,
            stop,
            thread: Some(thread),
        }
    }

    fn hears(&self, wanted: impl Fn(&News) -> bool) -> News {
        loop {
            let news = self.news.recv_timeout(LONG).expect("no such news");
            if wanted(&news) {
                return news;
            }
        }
    }

    fn end(&self) -> End {
        match self.hears(|news| matches!(news, News::Ended(..))) {
            News::Ended(_, end, _) => end,
            _ => unreachable!(),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let result = self.thread.take().unwrap().join();
        assert!(result.is_ok() || std::thread::panicking());
    }
}

fn settings(peer: Peer, carrier: Carrier, address: SocketAddr, axes: usize) -> RemoteSettings {
    RemoteSettings {
        data_size: 2,
        ..RemoteSettings::new(peer, carrier, address.to_string(), axes)
    }
}

fn path(k: u64, axis: usize) -> f64 {
    0.03 * (0.3 * k as f64 + axis as f64).sin()
}

/// Drives a substructure along the path; all measurements.
fn drive(port: &mut dyn Substructure, steps: u64) -> Vec<(Vec<f64>, Vec<f64>)> {
    let axes = port.axes();
    let mut into = Measurement::zeros(axes);
    (0..steps)
        .map(|k| {
            let disp: Vec<f64> = (0..axes).map(|axis| path(k, axis)).collect();
            let vel = vec![0.0; axes];
            let command = Command {
                sequence: k,
                time: 0.01 * k as f64,
                dt: 0.01,
                disp: &disp,
                vel: &vel,
            };
            port.issue(&command).unwrap();
            port.collect(Nanos(0), &mut into).unwrap();
            port.accepted(k).unwrap();
            assert_eq!(into.sequence, k);
            (into.disp.clone(), into.force.clone())
        })
        .collect()
}

fn in_process(axes: usize, steps: u64) -> Vec<(Vec<f64>, Vec<f64>)> {
    let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
    drive(
        &mut gusset::specimen::InProcess::new(law.build(axes).unwrap()),
        steps,
    )
}

#[test]
fn over_every_dialect_and_carrier_a_test_is_bit_for_bit_the_one_in_process() {
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
fn an_exchange_allocates_nothing_on_our_side() {
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

#[test]
fn a_second_controller_is_turned_away_and_the_first_does_not_notice() {
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        let server = Server::start(Role::Application, carrier, 1, Nature::Simulated);
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
            refused.contains("closed the connection") || refused.contains("did not answer"),
            "{refused}"
        );
        server.hears(|news| matches!(news, News::TurnedAway(_)));
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
fn a_server_that_vanishes_or_falls_silent_is_a_fault_and_never_a_hang() {
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

    let deaf = UdpSocket::bind("127.0.0.1:0").unwrap();
    let mut remote = Remote::new(RemoteSettings {
        reply_limit_s: 0.1,
        ..settings(
            Peer::Site,
            Carrier::Datagrams,
            deaf.local_addr().unwrap(),
            1,
        )
    })
    .unwrap();
    remote.open().unwrap();
    remote.issue(&command).unwrap();
    assert_eq!(remote.collect(Nanos(0), &mut into), Err(LinkFault::Timeout));
    assert_eq!(remote.issue(&command), Err(LinkFault::Timeout), "final");
}

#[test]
fn a_step_taken_back_ends_the_test_of_a_physical_specimen_only() {
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
            write_action(&mut vector, action).unwrap();
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
            Action::Read(gusset::wire::openfresco::Reading::Force),
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
fn other_protocols_garbage_and_silence_are_named_and_the_port_is_free_again() {
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
    let two = Sizes::generic_client(2, 256).unwrap();
    two.write(&mut sizes).unwrap();
    wrong.write_all(&sizes).unwrap();
    assert!(matches!(server.end(), End::Refused(ExchangeFault::Wire(_))));

    let server = Server::with(limits, Carrier::Datagrams, 1, Nature::Simulated);
    let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
    stranger.send_to(&[7; 300], server.address).unwrap();
    server.hears(|news| matches!(news, News::Stray(_, 300)));
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
fn beyond_loopback_one_machine_must_be_named_and_only_it_is_served() {
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        let open = Door::bind(carrier, "0.0.0.0:0", None).unwrap_err();
        assert!(open.to_string().contains("--client"), "{open}");
        let other = "192.0.2.7".parse().unwrap();
        let door = Door::bind(carrier, "127.0.0.1:0", Some(other)).unwrap();
        let server = Server::behind(
            door,
            ServeSettings::new(Role::Application, None),
            1,
            Nature::Simulated,
        );
        let mut remote = Remote::new(RemoteSettings {
            connect_limit_s: 0.3,
            ..settings(Peer::Element, carrier, server.address, 1)
        })
        .unwrap();
        remote.open().unwrap_err();
        server.hears(|news| matches!(news, News::NotAdmitted(_)));
    }
}

/// The other ends of dialect D are OpenFresco's controls; here their course stands in the protocol's own terms.
#[test]
fn our_laboratory_controllers_follow_generic_tcp_and_sim_simulink() {
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
            write_action(&mut vector, action).unwrap();
            vector[8..16].copy_from_slice(&disp.to_le_bytes());
            stream.write_all(&vector).unwrap();
            let mut answer = vec![0; 8 * n];
            if answered {
                stream.read_exact(&mut answer).unwrap();
            }
            [0, 8, 16].map(|at| f64::from_le_bytes(answer[at..at + 8].try_into().unwrap()))
        };
        let all = Action::Read(gusset::wire::openfresco::Reading::All);
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
