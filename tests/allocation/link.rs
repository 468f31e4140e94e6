//! On the loop's thread a link allocates nothing: issue and collect, fresh and stale, over TCP and UDP, with and without a
//! key.

use std::net::SocketAddr;
use std::sync::mpsc;
use std::time::Duration;

use gusset_actuator::specimen::SpecimenLaw;
use gusset_config::Carrier;
use gusset_link::server::{Host, ServeOptions, Server};
use gusset_link::{NativeLink, NativeSetup, SocketOptions};
use gusset_numerics::law::{LawSpec, LinearSpec};
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os::monotonic_ns;
use gusset_wire::handshake::{Axis, Limits, Sampling, Unit};
use gusset_wire::key::PreSharedKey;

fn axes() -> Vec<Axis> {
    (1..=2)
        .map(|j| Axis {
            name: format!("axis {j}"),
            disp_unit: Unit::Metre,
            force_unit: Unit::Newton,
            limits: Limits::NONE,
        })
        .collect()
}

fn served(carrier: Carrier, key: Option<PreSharedKey>) -> SocketAddr {
    let law = SpecimenLaw::Law(LawSpec::Linear(LinearSpec {
        stiffness_n_per_m: 2e6,
        damping_n_s_per_m: 0.0,
    }));
    let build = move || law.build(2).map_err(|error| error.to_string());
    let host = Host::new("springs".into(), axes(), Box::new(build)).unwrap();
    let options = ServeOptions {
        listen: "127.0.0.1:0".into(),
        carrier,
        key,
        plan: None,
        spin_ns: 0,
    };
    let server = Server::bind(host, options).unwrap();
    let address = server.local_addr();
    // Ends with the test's process.
    std::thread::spawn(move || server.run(&|| false, &mut |_| {}));
    address
}

fn linked(carrier: Carrier, key: Option<PreSharedKey>, coupling: Coupling) -> NativeLink {
    let address = served(carrier, key.clone());
    let mut link = NativeLink::new(NativeSetup {
        address: address.to_string(),
        carrier,
        key,
        test: "allocation".into(),
        axes: axes(),
        rate: (1000, 1),
        watchdog_s: 20.0,
        sampling: Sampling::Reply,
        coupling,
        connect_limit: Duration::from_secs(20),
        reply_timeout: Duration::from_secs(20),
        options: SocketOptions::default(),
    });
    let introduction = link.connect().unwrap();
    assert_eq!(introduction.stiffness, [2e6, 0.0, 0.0, 2e6]);
    link.arm(0, &[0.0, 0.0], &mut || true).unwrap();
    link
}

#[test]
fn issue_and_collect_allocate_nothing() {
    let key = || PreSharedKey::new(b"a secret of more than sixteen bytes").unwrap();
    for carrier in [Carrier::Tcp, Carrier::Udp] {
        for key in [None, Some(key())] {
            let mut link = linked(carrier, key, Coupling::Lockstep);
            let mut measured = Measurement::zeros(2);
            let info = allocation_counter::measure(|| {
                for sequence in 0..300 {
                    let disp = [sequence as f64 * 1e-3, 0.5];
                    let command = Command {
                        sequence,
                        time: 0.0,
                        dt: 1e-3,
                        disp: &disp,
                        vel: &[0.0, 0.0],
                    };
                    link.issue(&command).unwrap();
                    let fresh = link.collect(Nanos(0), &mut measured).unwrap();
                    assert_eq!((fresh, measured.sequence), (Freshness::Fresh, sequence));
                    assert_eq!(measured.force, [2e6 * disp[0], 1e6]);
                    link.accepted(sequence).unwrap();
                }
            });
            assert_eq!(info.count_total, 0, "{carrier}");
            link.retire(Retirement::Orderly);
        }
    }
}

#[test]
fn stale_measurement_allocates_nothing() {
    let mut link = linked(Carrier::Udp, None, Coupling::Sampled);
    let mut measured = Measurement::zeros(2);
    let exchange = |link: &mut NativeLink, measured: &mut Measurement, sequence, wait_ns: u64| {
        let disp = [sequence as f64, 0.0];
        let command = Command {
            sequence,
            time: 0.0,
            dt: 1e-3,
            disp: &disp,
            vel: &[0.0, 0.0],
        };
        link.issue(&command).unwrap();
        let deadline = Nanos(monotonic_ns()).plus(wait_ns);
        link.collect(deadline, measured).unwrap()
    };
    let fresh = exchange(&mut link, &mut measured, 0, 20_000_000_000);
    assert_eq!(fresh, Freshness::Fresh);
    let info = allocation_counter::measure(|| {
        for sequence in 1..50 {
            // The deadline has passed already: the latest known measurement counts, and it is never newer than the command.
            match exchange(&mut link, &mut measured, sequence, 0) {
                Freshness::Fresh => assert_eq!(measured.sequence, sequence),
                Freshness::Stale => assert!(measured.sequence < sequence),
            }
            assert_eq!(measured.force[0], 2e6 * measured.sequence as f64);
        }
    });
    assert_eq!(info.count_total, 0);
    let fresh = exchange(&mut link, &mut measured, 50, 20_000_000_000);
    assert_eq!((fresh, measured.sequence), (Freshness::Fresh, 50));
    link.retire(Retirement::Orderly);
}

#[test]
fn unconnected_link_closes_without_panic() {
    let (tell, told) = mpsc::channel();
    std::thread::spawn(move || {
        let mut link = NativeLink::new(NativeSetup {
            address: "127.0.0.1:1".into(),
            carrier: Carrier::Tcp,
            key: None,
            test: "never".into(),
            axes: axes(),
            rate: (1000, 1),
            watchdog_s: 1.0,
            sampling: Sampling::Reply,
            coupling: Coupling::Lockstep,
            connect_limit: Duration::from_millis(100),
            reply_timeout: Duration::from_secs(1),
            options: SocketOptions::default(),
        });
        let refused = link.arm(0, &[0.0, 0.0], &mut || true);
        link.retire(Retirement::Tripped);
        tell.send(refused).unwrap();
    });
    assert!(told.recv_timeout(Duration::from_secs(20)).unwrap().is_err());
}
