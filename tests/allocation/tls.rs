//! Over TLS the loop's thread allocates nothing and waits no longer than its deadline. The helper thread ends and is joined however
//! the test ends.

use std::net::SocketAddr;
use std::sync::Mutex;
use std::time::Duration;

use gusset_actuator::specimen::SpecimenLaw;
use gusset_config::{Carrier, ServeTlsSpec, TlsSpec};
use gusset_link::server::{Host, ServeError, ServeOptions, Server};
use gusset_link::tls::{TlsClient, TlsFiles, TlsServer};
use gusset_link::{NativeLink, NativeSetup, SocketOptions, Transport, Wait};
use gusset_numerics::law::{LawSpec, LinearSpec};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os::monotonic_ns;
use gusset_wire::handshake::{Axis, Limits, Sampling, Unit};

/// Threads are counted, so these tests run one after another.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn axes() -> Vec<Axis> {
    vec![Axis {
        name: "axis 1".into(),
        disp_unit: Unit::Metre,
        force_unit: Unit::Newton,
        limits: Limits::NONE,
    }]
}

fn options(carrier: Carrier, listen: &str) -> (Host, ServeOptions) {
    let law = SpecimenLaw::Law(LawSpec::Linear(LinearSpec {
        stiffness_n_per_m: 2e6,
        damping_n_s_per_m: 0.0,
    }));
    let build = move || law.build(1).map_err(|error| error.to_string());
    let host = Host::new("spring".into(), axes(), Box::new(build)).unwrap();
    let options = ServeOptions {
        listen: listen.into(),
        carrier,
        key: None,
        plan: None,
        spin_ns: 0,
    };
    (host, options)
}

struct Ends {
    client: TlsClient,
    server: TlsServer,
}

impl Ends {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        crate::tls_common::make(folder);
        Self {
            client: TlsClient::new(
                &TlsFiles::of_client(&TlsSpec::default(), folder),
                None,
                true,
            )
            .unwrap(),
            server: TlsServer::new(&TlsFiles::of_server(&ServeTlsSpec::default(), folder), true)
                .unwrap(),
        }
    }

    fn served(&self) -> SocketAddr {
        let (host, options) = options(Carrier::Tls, "127.0.0.1:0");
        let server = Server::bind_tls(host, options, self.server.clone()).unwrap();
        let address = server.local_addr();
        // Ends with the test's process.
        std::thread::spawn(move || server.run(&|| false, &mut |_| {}));
        address
    }

    fn link(&self, coupling: Coupling) -> NativeLink {
        let setup = NativeSetup {
            address: self.served().to_string(),
            carrier: Carrier::Tls,
            key: None,
            test: "thread".into(),
            axes: axes(),
            rate: (1000, 1),
            watchdog_s: 20.0,
            sampling: Sampling::Reply,
            coupling,
            connect_limit: Duration::from_secs(20),
            reply_timeout: Duration::from_secs(20),
            options: SocketOptions::default(),
        };
        let mut link = NativeLink::over_tls(setup, self.client.clone());
        let introduction = link.connect().unwrap();
        assert!(introduction.peer.contains("TLS"), "{}", introduction.peer);
        link.arm(0, &[0.0], &mut || true).unwrap();
        link
    }
}

/// Threads of this process that carry TLS and have not ended.
///
/// The kernel wakes who joins a thread shortly before it takes the thread from its list, so a thread that is exiting (flag `PF_EXITING`, field 9 of `stat`, see proc(5)) does not count.
fn helpers() -> usize {
    const PF_EXITING: u32 = 4;
    std::fs::read_dir("/proc/self/task")
        .unwrap()
        .filter(|task| {
            let stat = task.as_ref().unwrap().path().join("stat");
            let Ok(stat) = std::fs::read_to_string(stat) else {
                return false;
            };
            let (name, fields) = stat.split_once('(').unwrap().1.rsplit_once(") ").unwrap();
            let flags: u32 = fields.split(' ').nth(6).unwrap().parse().unwrap();
            name == "gusset-tls" && flags & PF_EXITING == 0
        })
        .count()
}

fn command(sequence: u64, disp: &[f64]) -> Command<'_> {
    Command {
        sequence,
        time: 0.0,
        dt: 0.0,
        disp,
        vel: &[0.0],
    }
}

#[test]
fn tls_exchange_allocates_nothing() {
    let _alone = ONE_AT_A_TIME.lock();
    let ends = Ends::new();
    for coupling in [Coupling::Lockstep, Coupling::Sampled] {
        let mut link = ends.link(coupling);
        let mut measured = Measurement::zeros(1);
        let info = allocation_counter::measure(|| {
            for sequence in 0..300 {
                let disp = [sequence as f64 * 1e-3];
                link.issue(&command(sequence, &disp)).unwrap();
                let patience = Nanos(monotonic_ns()).plus(20_000_000_000);
                assert_eq!(link.collect(patience, &mut measured), Ok(Freshness::Fresh));
                assert_eq!(measured.force, [2e6 * disp[0]]);
            }
        });
        assert_eq!(info.count_total, 0);
        assert_eq!(helpers(), 1);
        link.retire(Retirement::Orderly);
        drop(link);
        assert_eq!(helpers(), 0);
    }
}

#[test]
fn wait_ends_at_its_deadline_as_stale() {
    let _alone = ONE_AT_A_TIME.lock();
    let ends = Ends::new();
    let mut link = ends.link(Coupling::Sampled);
    let mut measured = Measurement::zeros(1);
    link.issue(&command(0, &[0.001])).unwrap();
    // Long past: nothing is waited for.
    let info = allocation_counter::measure(|| {
        let _ = link.collect(Nanos(0), &mut measured);
    });
    assert_eq!(info.count_total, 0);
    let patience = Nanos(monotonic_ns()).plus(20_000_000_000);
    assert_eq!(link.collect(patience, &mut measured), Ok(Freshness::Fresh));
    // The next command is not out yet, so there is nothing to wait for but the deadline.
    let spins = Wait {
        spin_first_ns: u64::MAX,
        spin_last_ns: 0,
    };
    for wait in [spins, Wait::SLEEP, Wait::default()] {
        let options = SocketOptions {
            wait,
            ..SocketOptions::default()
        };
        let address = ends.served().to_string();
        let limit = Duration::from_secs(20);
        let mut silent = ends.client.connect(&address, limit, options, 100).unwrap();
        let info = allocation_counter::measure(|| {
            let deadline = Nanos(monotonic_ns()).plus(2_000_000);
            assert_eq!(silent.recv(&mut [0; 8], deadline), Ok(None));
            assert!(monotonic_ns() >= deadline.0);
            assert_eq!(silent.recv(&mut [0; 8], Nanos(0)), Ok(None), "long past");
        });
        assert_eq!(info.count_total, 0);
    }
}

#[test]
fn helper_thread_is_always_joined() {
    let _alone = ONE_AT_A_TIME.lock();
    let ends = Ends::new();
    // Dropped without a goodbye, in the middle of an exchange, and by a panic.
    drop(ends.link(Coupling::Lockstep));
    assert_eq!(helpers(), 0);
    let mut link = ends.link(Coupling::Lockstep);
    link.issue(&command(0, &[0.001])).unwrap();
    drop(link);
    assert_eq!(helpers(), 0);
    let link = ends.link(Coupling::Lockstep);
    let panicked = std::thread::spawn(move || {
        let _held = link;
        panic!("a panic in the loop");
    });
    assert!(panicked.join().is_err());
    assert_eq!(helpers(), 0);
    // The transport alone, against a peer that no longer reads: full, then closed, and joined.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = ends.server.clone();
    let accepted = std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        let mut session = server.accept(stream, SocketOptions::default()).unwrap();
        let until = Nanos(monotonic_ns()).plus(20_000_000_000);
        assert_eq!(session.handshake(until), Ok(true));
        session
    });
    let options = SocketOptions {
        wait: Wait::SLEEP,
        ..SocketOptions::default()
    };
    let limit = Duration::from_secs(20);
    let mut transport = ends.client.connect(&address, limit, options, 1000).unwrap();
    let session = accepted.join().unwrap();
    let frame = [7; 20_000];
    let a_moment = || Nanos(monotonic_ns() + 1_000_000);
    let mut refused = 0;
    // The ring alone fills at once; the kernel behind it takes megabytes, and then nothing more.
    while refused < 200 {
        match transport.send(&frame) {
            Ok(()) => refused = 0,
            Err(fault) => {
                assert_eq!(fault, LinkFault::Backpressure);
                refused += 1;
            }
        }
        assert_eq!(transport.recv(&mut [0; 8], a_moment()), Ok(None));
    }
    assert_eq!(helpers(), 1);
    drop(transport);
    assert_eq!(helpers(), 0);
    drop(session);
}

#[test]
fn closing_peer_is_seen_after_last_bytes() {
    let _alone = ONE_AT_A_TIME.lock();
    let ends = Ends::new();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = ends.server.clone();
    let said: Vec<u8> = (0..200_000_u32).map(|i| (i % 251) as u8).collect();
    let sent = said.clone();
    let peer = std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        let mut session = server.accept(stream, SocketOptions::default()).unwrap();
        let until = Nanos(monotonic_ns()).plus(20_000_000_000);
        assert_eq!(session.handshake(until), Ok(true));
        for piece in sent.chunks(10_000) {
            while session.send(piece) == Err(LinkFault::Backpressure) {
                let _ = session.recv(&mut [0; 8], Nanos(monotonic_ns() + 1_000_000));
            }
        }
        // Until everything has left.
        let _ = session.recv(&mut [0; 8], Nanos(monotonic_ns() + 200_000_000));
    });
    let limit = Duration::from_secs(20);
    let options = SocketOptions::default();
    let mut transport = ends.client.connect(&address, limit, options, 1000).unwrap();
    let mut heard = Vec::new();
    let mut buffer = [0; 3000];
    let mut is_over = false;
    let fault = loop {
        if heard.len() >= 150_000 && !is_over {
            is_over = true;
            // The rest fits into the ring: the end of the session is known before the last bytes are taken.
            while !peer.is_finished() || helpers() > 0 {
                std::thread::yield_now();
            }
            // The next send first receives the final bytes.
            assert_eq!(transport.send(&[1]), Ok(()));
        }
        let patience = Nanos(monotonic_ns()).plus(20_000_000_000);
        match transport.recv(&mut buffer, patience) {
            Ok(Some(count)) => heard.extend_from_slice(&buffer[..count]),
            Ok(None) => panic!("silence"),
            Err(fault) => break fault,
        }
    };
    assert_eq!(fault, LinkFault::Closed);
    assert_eq!(transport.send(&[1]), Err(LinkFault::Closed));
    assert_eq!(transport.tls_fault(), None, "a plain end");
    assert!(heard == said, "every byte, in order");
    peer.join().unwrap();
}

#[test]
fn tls_replaces_a_key_beyond_loopback() {
    let ends = Ends::new();
    let (host, plain) = options(Carrier::Tcp, "0.0.0.0:0");
    let refused = Server::bind(host, plain).unwrap_err();
    assert!(matches!(refused, ServeError::Open { .. }));
    assert!(refused.to_string().contains("--transport tls"), "{refused}");
    let (host, open) = options(Carrier::Tls, "0.0.0.0:0");
    Server::bind_tls(host, open, ends.server.clone()).unwrap();
    let (host, bare) = options(Carrier::Tls, "127.0.0.1:0");
    assert!(matches!(
        Server::bind(host, bare).unwrap_err(),
        ServeError::Bare
    ));
}
