//! Exchanges per second of our clients of dialects A and B on loopback, against a ping-pong of the same bytes over the same
//! transports. `cargo bench --bench openfresco`

#![allow(clippy::disallowed_macros, reason = "a bench prints its result")]

use std::sync::atomic::{AtomicBool, Ordering};

use gusset_actuator::specimen::SpecimenLaw;
use gusset_config as config;
use gusset_link::SocketOptions;
use gusset_link::openfresco::{Host, Nature, Remote, RemoteSettings, Role, ServeSettings};
use gusset_link::server::{ServeOptions, Server};
use gusset_link::socket::{tcp_pair, udp_pair};
use gusset_quantity::substructure::{Command, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os::{monotonic_ns, process_cpus};
use gusset_wire::openfresco::{Carrier, Peer};

const STEPS: u64 = 20_000;
const FAR: Nanos = Nanos(u64::MAX);

/// Two threads that spin for each other must not share a core; with one core there is nothing to be done.
fn pin(far: bool) {
    // Read before anybody is pinned.
    static CPUS: std::sync::OnceLock<Vec<usize>> = std::sync::OnceLock::new();
    let cpus = CPUS.get_or_init(process_cpus);
    let chosen = if far { cpus.last() } else { cpus.first() };
    if let Some(cpu) = chosen {
        let mut set = rustix::thread::CpuSet::new();
        set.set(*cpu);
        let _ = rustix::thread::sched_setaffinity(None, &set);
    }
}

fn median_us(mut times: Vec<u64>) -> f64 {
    times.sort_unstable();
    times[times.len() / 2] as f64 * 1e-3
}

/// Command and request, 2 × 8N bytes, out; 8N bytes back; then a commit without an answer.
fn raw(carrier: Carrier, vector: usize) -> f64 {
    let options = SocketOptions::default();
    let [mut near, mut far] = match carrier {
        Carrier::Stream => tcp_pair(options).unwrap(),
        Carrier::Datagrams => udp_pair(options).unwrap(),
    };
    let server = std::thread::spawn(move || {
        pin(true);
        let (mut buffer, mut have) = (vec![0; 65_536], 0);
        for step in 0..STEPS {
            let due = vector * (if step == 0 { 2 } else { 3 });
            while have < due {
                have += far.recv(&mut buffer, FAR).unwrap().unwrap();
            }
            have -= due;
            far.send(&vec![1; vector]).unwrap();
        }
    });
    let (out, commit, mut buffer) = (vec![2; 2 * vector], vec![3; vector], vec![0; 65_536]);
    let mut times = Vec::new();
    for _ in 0..STEPS {
        let begun = monotonic_ns();
        match carrier {
            Carrier::Stream => near.send(&out).unwrap(),
            Carrier::Datagrams => out.chunks(vector).for_each(|part| near.send(part).unwrap()),
        }
        let mut have = 0;
        while have < vector {
            have += near.recv(&mut buffer, FAR).unwrap().unwrap();
        }
        let _ = near.send(&commit);
        times.push(monotonic_ns() - begun);
    }
    server.join().unwrap();
    median_us(times)
}

fn ours(role: Role, peer: Peer, carrier: Carrier, data_size: usize) -> f64 {
    let law = "law = { linear = { stiffness_n_per_m = 8000.0 } }";
    let law: SpecimenLaw = toml::from_str(law).unwrap();
    let host = Host::new(law.build(1).unwrap(), Nature::Simulated, None);
    let options = ServeOptions {
        listen: "127.0.0.1:0".into(),
        carrier: match carrier {
            Carrier::Stream => config::Carrier::Tcp,
            Carrier::Datagrams => config::Carrier::Udp,
        },
        key: None,
        plan: None,
        spin_ns: 0,
    };
    let settings = ServeSettings::new(role, None);
    let server = Server::bind_openfresco(host, settings, options, None, None).unwrap();
    let address = server.local_addr().to_string();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let stop = &stop;
        scope.spawn(move || {
            // The server's threads inherit it.
            pin(true);
            let stop = || stop.load(Ordering::Relaxed);
            server.run(&stop, &mut |_| {}).unwrap();
        });
        let mut settings = RemoteSettings::new(peer, carrier, address, 1);
        settings.data_size = data_size;
        let mut remote = Remote::new(settings).unwrap();
        remote.open().unwrap();
        let mut into = Measurement::zeros(1);
        let mut times = Vec::new();
        for sequence in 0..STEPS {
            let begun = monotonic_ns();
            let command = Command {
                sequence,
                time: sequence as f64 * 1e-3,
                dt: 1e-3,
                disp: &[sequence as f64 * 1e-6],
                vel: &[0.0],
            };
            remote.issue(&command).unwrap();
            remote.collect(FAR, &mut into).unwrap();
            remote.accepted(sequence).unwrap();
            times.push(monotonic_ns() - begun);
        }
        remote.retire(Retirement::Orderly);
        stop.store(true, Ordering::Relaxed);
        median_us(times)
    })
}

fn main() {
    pin(false);
    println!("median of a step (command, request, answer, commit) on loopback, one axis");
    for carrier in [Carrier::Stream, Carrier::Datagrams] {
        for (name, role, peer, smallest) in [
            ("A", Role::Application, Peer::Element, 5),
            ("B", Role::Actor, Peer::Actor, 3),
        ] {
            for size in [smallest, 256] {
                let (us, raw) = (ours(role, peer, carrier, size), raw(carrier, 8 * size));
                let rate = 1e3 / us;
                println!(
                    "dialect {name} {carrier:?} N = {size:3}: {us:7.1} us ({rate:5.1} kHz), raw {raw:7.1} us, ratio {:.2}",
                    us / raw
                );
            }
        }
    }
}
